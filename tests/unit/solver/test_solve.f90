!> The iterations of a solve: when it stops and what it reports, and NLGS on problems with known solutions.
module test_solve_schemes
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_method_options, only: method_features_t
  use gravier_solve_report, only: exact_solution_t
  implicit none
  private
  public :: growing_t, first_impulse_t

  !> Not a method: multiplies the impulses at each iteration.
  type, extends(method_t) :: growing_t
    real(dp) :: factor = 1.0_dp
    !> iteration that fails, iteration that makes a NaN; 0 for never
    integer :: fails_at = 0, nan_at = 0
    integer :: done = 0, measured = 0
  contains
    procedure, nopass :: features => growing_features
    procedure :: start => growing_start
    procedure :: iterate => growing_iterate
  end type growing_t

  !> The error is what the impulse of the first contact lacks of a number.
  type, extends(exact_solution_t) :: first_impulse_t
    real(dp) :: value = 0.0_dp
  contains
    procedure :: error => first_impulse_error
  end type first_impulse_t

contains

  pure function growing_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="growing")
  end function growing_features

  subroutine growing_start(self, problem, error)
    class(growing_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: c

    self%done = 0
    self%measured = 0
    if (allocated(error)) return
    ! it has no sweeps that tell how far they went: no check is left out
    if (allocated(problem%progress)) deallocate (problem%progress)
    allocate (problem%progress(2, 1), source=0.0_dp)
    problem%progress_is_summed = .false.
    do c = 1, problem%sub(1)%n_contacts
      problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = 1.0_dp
    end do
    call problem%evaluate()
  end subroutine growing_start

  subroutine growing_iterate(self, problem, measure, jump, error)
    class(growing_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: nan

    self%done = self%done + 1
    if (measure) self%measured = self%measured + 1
    jump = merge(0.5_dp*self%done, 0.0_dp, measure)
    problem%sub(1)%impulse(:, :, :) = self%factor*problem%sub(1)%impulse
    nan = ieee_value(nan, ieee_quiet_nan)
    if (self%done == self%nan_at) problem%sub(1)%impulse(1, 1, 1) = nan
    if (self%done == self%fails_at) call raise(error, status_failure, "on purpose")
  end subroutine growing_iterate

  real(dp) function first_impulse_error(self, problem) result(error)
    class(first_impulse_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    error = abs(problem%sub(1)%impulse(1, 1, 1)/self%value - 1.0_dp)
  end function first_impulse_error

end module test_solve_schemes

program test_solve
  use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_invalid
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_nlgs, only: nlgs_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_converged, solve_exhausted, solve_diverged, &
    & solve_stagnated, solve_unbounded, by_velocity, by_error
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use test_solve_schemes, only: growing_t, first_impulse_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm
  character(len=*), parameter :: newline = new_line("a")
  !> numbers of size 1 to 10, some tens of operations
  real(dp), parameter :: rounding = 1.0e-13_dp
  integer :: dimension

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    call test_one_grain(dimension)
    call test_roll_and_slide(dimension)
    call test_squeeze(dimension)
  end do
  call test_impact()
  call test_gap()
  call test_checks()
  call test_descent()
  call test_at_the_start()
  call test_warm_start()
  call test_rest_after_shock(2, .false.)
  call test_rest_after_shock(3, .true.)
  call test_work()
  call test_exact_criterion()
  call test_divergence()
  call test_bound_by_rest()
  call test_estimate()
  call test_stagnation()
  call test_no_solution()
  call test_errors()
  call test_no_contacts()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of `count` unit grains under unit gravity, step 1, its contact problem assembled.
  subroutine make_column(sim, dimension, count, friction)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: dimension, count
    real(dp), intent(in) :: friction
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    character(len=:), allocatable :: gravity

    gravity = "0, -1"
    if (dimension == 3) gravity = "0, 0, -1"
    call parse_config("column", "&scene dimension = "//to_text(dimension)//", bodies = 'column', column_count = "// &
      & to_text(count)//", gravity = "//gravity//", friction = "//to_text(friction)//" /"//newline// &
      & "&time step = 1, steps = 1, theta = 1 /", config, error)
    call check(.not. allocated(error), "configuration")
    call sim%init(comm, config, error)
    call sim%assemble(figures)
    call check(.not. allocated(error), "assembly")
    call check_equal(figures%contacts, int(count, i8), "contacts of a column")
  end subroutine make_column

  subroutine solve(problem, report, iterations)
    type(contact_problem_t), intent(inout) :: problem
    type(solve_report_t), intent(out) :: report
    integer, intent(in) :: iterations
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(error_t), allocatable :: error

    control%tolerance = 1.0e-12_dp
    control%check_every = 1
    control%max_iterations = iterations
    call solve_contacts(problem, nlgs, control, report, error)
    call check(.not. allocated(error), "no error")
  end subroutine solve

  !> A grain on the ground carries its weight after one sweep.
  subroutine test_one_grain(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(solve_report_t) :: report

    call make_column(sim, dimension, 1, 0.0_dp)
    call solve(sim%problem, report, 5)
    call check_equal(report%status, solve_converged, "one grain: converged")
    call check_equal(report%iterations, 1, "one grain: iterations")
    call check_close(sim%problem%sub(1)%impulse(1, 1, 1), 1.0_dp, rounding, "one grain: its weight")
    call check_close(maxval(abs(sim%problem%sub(1)%v_global)), 0.0_dp, rounding, "one grain: at rest")
    call check_close(report%error, -1.0_dp, 0.0_dp, "no exact solution given")
    call sim%free()
  end subroutine test_one_grain

  !> A grain thrown along the ground at speed u = 0.9. What turns it is r_t at its rim: it rolls when
  !> r_t = u/(1/m + R^2/I) = u/3 (disk, I = 1/2) or 2 u/7 (sphere, I = 2/5) is within mu r_n, else it slides with mu r_n.
  subroutine test_roll_and_slide(dimension)
    integer, intent(in) :: dimension
    real(dp), parameter :: u = 0.9_dp
    type(simulation_t) :: sim
    type(solve_report_t) :: report
    real(dp) :: wanted, friction, speed, turn, inertia
    integer :: k

    inertia = merge(0.5_dp, 0.4_dp, dimension == 2)
    do k = 1, 2
      friction = merge(0.8_dp, 0.1_dp, k == 1)
      call make_column(sim, dimension, 1, friction)
      sim%problem%sub(1)%v_free(1, 1) = u
      call solve(sim%problem, report, 5)
      wanted = merge(u/(1.0_dp + 1.0_dp/inertia), friction, k == 1)
      call check_equal(report%status, solve_converged, "thrown grain: converged")
      associate (sub => sim%problem%sub(1))
        call check_close(sub%impulse(1, 1, 1), 1.0_dp, rounding, "thrown grain: weight")
        call check_close(norm2(sub%impulse(1, 2:, 1)), wanted, rounding, "thrown grain: tangential impulse")
        speed = u - wanted
        turn = wanted/inertia
        call check_close(sub%v_global(1, 1), speed, rounding, "thrown grain: speed")
        ! a grain that moves along x turns about -z in the plane, about y in space
        if (dimension == 2) call check_close(sub%v_global(3, 1), -turn, rounding, "thrown disk: spin")
        if (dimension == 3) call check_close(sub%v_global(5, 1), turn, rounding, "thrown sphere: spin")
        if (k == 1) call check_close(turn, speed, rounding, "it rolls")
      end associate
      call sim%free()
    end do
  end subroutine test_roll_and_slide

  !> Two grains, the upper one pushed down by q: the ground carries 2 + q, the contact above it 1 + q.
  subroutine test_squeeze(dimension)
    integer, intent(in) :: dimension
    real(dp), parameter :: q = 3.0_dp
    type(simulation_t) :: sim
    type(solve_report_t) :: report
    integer :: c, b

    call make_column(sim, dimension, 2, 0.3_dp)
    associate (sub => sim%problem%sub(1))
      do b = 1, 2
        if (sub%id(b) == 2) sub%v_free(dimension, b) = sub%v_free(dimension, b) - q
      end do
      call solve(sim%problem, report, 2000)
      call check_equal(report%status, solve_converged, "two grains: converged")
      do c = 1, 2
        ! the error is some ten times the residual on a column of two
        call check_close(sub%impulse(lane_of(c), 1, block_of(c)), merge(2.0_dp, 1.0_dp, sub%pair(2, c) > 2) + q, 1.0e-10_dp, &
          & "two grains: impulses")
        call check_close(norm2(sub%impulse(lane_of(c), 2:, block_of(c))), 0.0_dp, rounding, "two grains: nothing tangential")
      end do
    end associate
    call sim%free()
  end subroutine test_squeeze

  !> The lower of two grains thrown up at speed 4 - 1 under one of free speed -1: plastic impact, mean speed 1.
  subroutine test_impact()
    type(simulation_t) :: sim
    type(solve_report_t) :: report
    integer :: b, c

    call make_column(sim, 2, 2, 0.0_dp)
    associate (sub => sim%problem%sub(1))
      do b = 1, 2
        if (sub%id(b) == 1) sub%v_free(2, b) = 3.0_dp
      end do
      call solve(sim%problem, report, 2000)
      do c = 1, 2
        call check_close(sub%impulse(lane_of(c), 1, block_of(c)), merge(0.0_dp, 2.0_dp, sub%pair(2, c) > 2), 1.0e-10_dp, &
          & "impact: impulses")
      end do
      do b = 1, 2
        call check_close(sub%v_global(2, b), 1.0_dp, 1.0e-10_dp, "impact: one speed")
      end do
    end associate
    call sim%free()
  end subroutine test_impact

  !> A gap g may close within the step: a grain of free speed -1 keeps -g/h.
  subroutine test_gap()
    type(simulation_t) :: sim
    type(solve_report_t) :: report

    call make_column(sim, 2, 1, 0.0_dp)
    associate (sub => sim%problem%sub(1))
      sub%hot(1, 3, 1) = 0.25_dp
      call solve(sim%problem, report, 5)
      call check_close(sub%impulse(1, 1, 1), 0.75_dp, rounding, "gap: impulse")
      call check_close(sub%v_global(2, 1), -0.25_dp, rounding, "gap: speed that closes it")
      sub%impulse(:, :, :) = 0.0_dp
      sub%hot(1, 3, 1) = 1.5_dp
      call solve(sim%problem, report, 5)
      call check_close(sub%impulse(1, 1, 1), 0.0_dp, 0.0_dp, "wide gap: no impulse")
      call check_equal(report%iterations, 0, "wide gap: nothing to do")
    end associate
    call sim%free()
  end subroutine test_gap

  !> Checks at the start, every check_every iterations and at the last one; the trace has one column for each.
  subroutine test_checks()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    integer, parameter :: expected(*) = [0, 7, 14, 20]
    integer :: k

    call make_column(sim, 2, 2, 0.0_dp)
    control%tolerance = 1.0e-12_dp
    control%check_every = 7
    control%max_iterations = 20
    control%trace = .true.
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%status, solve_exhausted, "gives up")
    call check_equal(report%iterations, 20, "iterations until it gives up")
    call check_equal(method%done, 20, "iterations of the method")
    call check_equal(method%measured, 3, "iterations that measure the jump")
    call check_equal(report%n_trace, 4, "checks")
    do k = 1, min(4, report%n_trace)
      call check_equal(nint(report%trace(1, k)), expected(k), "iteration of a check")
      ! r = (1, 1): speeds -1 and 0, so v = (-1, 1), W = (1, 2), P - r = (1, -1/2) and the residual is sqrt(5/4)/sqrt(2)
      call check_close(report%trace(2, k), sqrt(0.625_dp), rounding, "residual of a check")
      call check_close(report%trace(3, k), 0.5_dp*expected(k), 0.0_dp, "jump of a check")
      call check_close(report%trace(4, k), -1.0_dp, 0.0_dp, "error of a check")
    end do
    call check_close(report%residual, sqrt(0.625_dp), rounding, "last residual")
    ! more checks than the trace has room for at first
    control%check_every = 1
    control%max_iterations = 200
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%n_trace, 201, "a long trace")
    do k = 1, report%n_trace
      call check_close(report%trace(1, k), k - 1.0_dp, 0.0_dp, "iterations of a long trace")
    end do
    control%trace = .false.
    call solve_contacts(sim%problem, method, control, report, error)
    call check(report%n_trace == 0 .and. .not. allocated(report%trace), "no trace unless asked for")
    call sim%free()
  end subroutine test_checks

  !> Checks that are left out are known from what the sweeps moved: the levels are passed within a check of where a trace, which
  !> leaves none out, has them. With momentum a check may come early, and figures are known at each iteration.
  subroutine test_descent()
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs, accelerated
    type(solve_control_t) :: control
    type(solve_report_t) :: traced, report
    type(error_t), allocatable :: error
    integer :: k

    control%tolerance = 1.0e-8_dp
    control%trace = .true.
    call make_column(sim, 2, 20, 0.0_dp)
    call solve_contacts(sim%problem, nlgs, control, traced, error)
    call sim%free()
    control%trace = .false.
    call make_column(sim, 2, 20, 0.0_dp)
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call sim%free()
    call check_equal(report%iterations, traced%iterations, "history: iterations")
    call check_equal(report%history%first(0), report%iterations, "history: the tolerance")
    call check(traced%history%first(0) - traced%history%first(2) > 10*control%check_every, "history: a decade takes many checks")
    do k = 1, 2
      call check(abs(report%history%first(k) - traced%history%first(k)) <= control%check_every, "history: levels")
    end do
    call check_equal(report%history%first_check, control%check_every, "history: the first check")
    accelerated%acceleration%on = .true.
    call make_column(sim, 2, 20, 0.0_dp)
    call solve_contacts(sim%problem, accelerated, control, report, error)
    call sim%free()
    call check_equal(report%history%first_check, 2, "history with momentum: the first check")
    call check(mod(report%history%first(2), control%check_every) /= 0, "history with momentum: a level between checks")
    control%trace = .true.
    call make_column(sim, 2, 20, 0.0_dp)
    call solve_contacts(sim%problem, accelerated, control, traced, error)
    call sim%free()
    call check_equal(traced%history%first_check, control%check_every, "history with momentum: the first check of a trace")
    call check_close(report%figure, report%residual, 0.0_dp, "history: the figure is the residual")
    call check(report%start_seconds > 0.0_dp .and. report%seconds > report%start_seconds, "seconds of the solve")
    ! of a check: not before the one before it, and not after the solve
    do k = 2, traced%n_trace
      if (traced%trace(6, k) < traced%trace(6, k - 1)) exit
    end do
    call check(k > traced%n_trace .and. traced%trace(6, traced%n_trace) <= traced%seconds, "seconds of the checks")
  end subroutine test_descent

  !> Impulses that are right already take no iteration, and a tolerance is met when the residual equals it.
  subroutine test_at_the_start()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 1, 0.0_dp)
    control%tolerance = 0.0_dp
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%status, solve_converged, "right from the start")
    call check_equal(report%iterations, 0, "right from the start: iterations")
    call check_close(report%residual, 0.0_dp, 0.0_dp, "right from the start: residual")
    call sim%free()
  end subroutine test_at_the_start

  !> A solve that starts from the solution of the same problem has nothing to do.
  subroutine test_warm_start()
    type(simulation_t) :: sim
    type(solve_report_t) :: report

    call make_column(sim, 3, 4, 0.3_dp)
    call solve(sim%problem, report, 5000)
    call check_equal(report%status, solve_converged, "cold start: converged")
    call check(report%iterations > 10, "cold start: iterations")
    call solve(sim%problem, report, 5000)
    call check_equal(report%iterations, 0, "warm start: iterations")
    call sim%free()
  end subroutine test_warm_start

  !> A solve that starts from impulses 10^12 times those that it ends with loses the roundings of these on the way: its velocities
  !> are those of the solution, and those that sweeps work with are the same.
  subroutine test_rest_after_shock(dimension, accelerated)
    integer, intent(in) :: dimension
    logical, intent(in) :: accelerated
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    integer :: c

    call make_column(sim, dimension, 4, 0.3_dp)
    do c = 1, 4
      sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = 1.0e12_dp*c
    end do
    nlgs%acceleration%on = accelerated
    control%tolerance = 1.0e-10_dp
    control%check_every = 1
    control%max_iterations = 2000
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call check_equal(report%status, solve_converged, "after a shock: converged")
    call check_equal(nlgs%work%solves, 1_i8, "after a shock: one solve")
    associate (sub => sim%problem%sub(1))
      ! roundings of the shock would be 1e-4 of the velocity that a grain falls at
      call check(maxval(abs(sub%v_global(1:dimension, 1:4))) < 1.0e-7_dp, "after a shock: rest")
      call check(maxval(abs(sub%velocity(1:dimension, 1:4) - sub%v_global(1:dimension, 1:4))) < 1.0e-9_dp, &
        & "after a shock: sweeps have the velocities of the impulses")
    end associate
    call sim%free()
  end subroutine test_rest_after_shock

  !> Sweeps and relaxations are counted: n_GS sweeps in each iteration, each of all contacts.
  subroutine test_work()
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 5, 0.0_dp)
    nlgs%sweeps = 3
    control%tolerance = 0.0_dp
    control%max_iterations = 4
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call solve_contacts(sim%problem, nlgs, control, report, error)
    associate (work => nlgs%work_done())
      call check_equal(work%solves, 2_i8, "solves")
      call check_equal(work%iterations, 8_i8, "iterations")
      call check_equal(work%sweeps, 24_i8, "sweeps")
      call check_equal(work%relaxations, 120_i8, "relaxations")
    end associate
    call nlgs%free()
    associate (work => nlgs%work_done())
      call check_equal(work%sweeps + work%solves, 0_i8, "work after free")
    end associate
    call sim%free()
  end subroutine test_work

  !> With an exact solution the error decides, whatever the residual says.
  subroutine test_exact_criterion()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 2, 0.0_dp)
    method%factor = 2.0_dp
    control%criterion = by_error
    control%tolerance = 1.0e-6_dp
    control%check_every = 1
    call solve_contacts(sim%problem, method, control, report, error, first_impulse_t(value=16.0_dp))
    call check_equal(report%status, solve_converged, "exact solution: converged")
    call check_equal(report%iterations, 4, "exact solution: iterations")
    call check_close(report%error, 0.0_dp, rounding, "exact solution: error")
    call check(report%residual > 0.1_dp, "exact solution: the residual is reported too")
    call sim%free()
  end subroutine test_exact_criterion

  !> Growth beyond ten thousand times the defect at the start is divergence; less is not; a NaN is, at once.
  subroutine test_divergence()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    logical :: halting

    call make_column(sim, 2, 2, 0.0_dp)
    control%tolerance = 1.0e-12_dp
    control%check_every = 1
    control%max_iterations = 1000
    method%factor = 10.0_dp
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%status, solve_diverged, "growth: diverged")
    ! the defect at the start is of size 1, and grows ten times an iteration
    call check(report%iterations >= 4 .and. report%iterations <= 6, "growth: soon")
    ! builds for debugging stop at the first operation on a NaN
    call ieee_get_halting_mode(ieee_invalid, halting)
    if (.not. halting) then
      method%factor = 1.0_dp
      method%nan_at = 3
      call solve_contacts(sim%problem, method, control, report, error)
      call check_equal(report%status, solve_diverged, "NaN: diverged")
      call check_equal(report%iterations, 3, "NaN: at once")
      method%nan_at = 0
    end if
    method%factor = 10.0_dp
    control%max_iterations = 3
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%status, solve_exhausted, "some growth is no divergence")
    call check(.not. allocated(error), "divergence is not an error")
    call sim%free()
  end subroutine test_divergence

  !> Where rest is admissible, the bound by rest ends a solve. The velocities are the error there.
  subroutine test_bound_by_rest()
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    real(dp) :: speed

    call make_column(sim, 2, 3, 0.0_dp)
    control = velocity_control()
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call check_equal(report%status, solve_converged, "bound by rest: converged")
    ! the load of a step: h g
    call check_close(report%velocity_scale, 1.0_dp, rounding, "bound by rest: velocity scale")
    speed = norm2(sim%problem%sub(1)%v_global(2, 1:3))/sqrt(3.0_dp)
    call check(speed > 0.0_dp .and. speed <= control%accuracy, "bound by rest: the error is within its limit")
    call check(report%velocity_error <= speed*(1.0_dp + rounding), "bound by rest: no estimate above the bound")
    call sim%free()
  end subroutine test_bound_by_rest

  !> On a ground that rises at speed 1, so that rest is not admissible, the estimate ends a solve: not before 4 iterations, however
  !> much is allowed, and with velocities whose error is within its limit.
  subroutine test_estimate()
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 3, 0.0_dp)
    sim%problem%sub(1)%v_free(2, 4) = 1.0_dp
    control = velocity_control()
    control%accuracy = 1.0e3_dp
    control%tolerance = 1.0e3_dp
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call check_equal(report%status, solve_converged, "estimate: converged")
    call check_equal(report%iterations, 4, "estimate: iterations before it is trusted")
    sim%problem%sub(1)%impulse(:, :, :) = 0.0_dp
    control = velocity_control()
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call check_equal(report%status, solve_converged, "estimate: converged to an accuracy")
    call check(report%iterations > 4, "estimate: an accuracy takes iterations")
    call check(norm2(sim%problem%sub(1)%v_global(2, 1:3) - 1.0_dp)/sqrt(3.0_dp) <= control%accuracy, &
      & "estimate: the error is within its limit")
    call sim%free()
  end subroutine test_estimate

  !> Iterations that change nothing end a solve 500 of them after twice the first, at which the figure was known last to fall.
  subroutine test_stagnation()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 2, 0.0_dp)
    call solve_contacts(sim%problem, method, velocity_control(), report, error)
    call check_equal(report%status, solve_stagnated, "stagnation")
    call check_equal(report%iterations, 2002, "stagnation: iterations")
    ! a method that has other means goes on
    control = velocity_control()
    control%max_iterations = 2000
    method%persists = .true.
    call solve_contacts(sim%problem, method, control, report, error)
    call check_equal(report%status, solve_exhausted, "persistence")
    call sim%free()
  end subroutine test_stagnation

  !> A column of two grains of radius 1 under a lid that sinks: no velocities obey the law, and impulses grow for ever.
  subroutine test_no_solution()
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(config_t) :: config
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    integer :: k

    call parse_config("lid", "&scene bodies = 'column', column_count = 2, gravity = 0, -1 /"//newline// &
      & "&boundary shape = 'plane', point = 0, 4, normal = 0, -1, velocity = 0, -0.1 /"//newline// &
      & "&time step = 1, steps = 1, theta = 1 /", config, error)
    call check(.not. allocated(error), "lid: configuration")
    call sim%init(comm, config, error)
    do k = 1, 2
      call sim%assemble(figures)
      call check_equal(figures%contacts, 3_i8, "lid: contacts")
      nlgs%acceleration%on = k == 2
      control = velocity_control()
      call solve_contacts(sim%problem, nlgs, control, report, error)
      call check_equal(report%status, solve_unbounded, "lid: no solution")
      call check(report%iterations < 4000, "lid: soon")
      sim%problem%sub(1)%impulse(:, :, :) = 0.0_dp
    end do
    call sim%free()
  end subroutine test_no_solution

  !> The default criterion of a run, with a check at each iteration.
  pure type(solve_control_t) function velocity_control() result(control)
    control%criterion = by_velocity
    control%tolerance = 1.0e-2_dp
    control%check_every = 1
  end function velocity_control

  !> An error of the method ends the solve, and an error from before starts none.
  subroutine test_errors()
    type(simulation_t) :: sim
    type(growing_t) :: method
    type(nlgs_t) :: nlgs
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    call make_column(sim, 2, 2, 0.0_dp)
    control%tolerance = 1.0e-12_dp
    method%fails_at = 5
    call solve_contacts(sim%problem, method, control, report, error)
    call check(allocated(error), "an error ends a solve")
    call check_equal(report%iterations, 5, "where it happened")
    call solve_contacts(sim%problem, nlgs, control, report, error)
    call check_equal(report%iterations, 0, "no solve after an error")
    call check_equal(nlgs%work%solves, 0_i8, "no start after an error")
    call sim%free()
  end subroutine test_errors

  !> A problem without contacts is solved.
  subroutine test_no_contacts()
    type(simulation_t) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    type(solve_report_t) :: report

    call parse_config("flight", "&scene bodies = 'lattice', lattice_count = 2, 2, radius_min = 0.1, radius_max = 0.1, "// &
      & "alert_distance = 0 /"//newline//"&time step = 1e-3, steps = 1 /", config, error)
    call sim%init(comm, config, error)
    call sim%assemble(figures)
    call check_equal(figures%contacts, 0_i8, "flight: no contacts")
    call solve(sim%problem, report, 5)
    call check_equal(report%status, solve_converged, "flight: converged")
    call check_equal(report%iterations, 0, "flight: iterations")
    call check_close(report%residual, 0.0_dp, 0.0_dp, "flight: residual")
    call sim%free()
  end subroutine test_no_contacts

end program test_solve
