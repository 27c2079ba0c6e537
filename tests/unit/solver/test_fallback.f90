!> The second method of a solve: when it takes over, and whose impulses and figures are left.
program test_fallback
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_nlgs, only: nlgs_t
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_converged, solve_exhausted, solve_stagnated, &
    & solve_unbounded
  use gravier_fallback, only: fallback_t, fallback_words
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_scaling, only: scaling_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm
  character(len=*), parameter :: newline = new_line("a")
  real(dp), parameter :: rounding = 1.0e-13_dp
  !> iterations and sweeps of the first solve
  integer, parameter :: before = 50

  call start_parallel()
  call comm%init()
  call test_success()
  call test_not_taken()
  call test_worse(1.5_dp, "worse")
  call test_worse(1.0e3_dp, "diverged")
  call test_better()
  call test_pauses()
  call test_trace()
  call test_words()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of two unit grains under unit gravity with impulses of 0.6 and 0.3 of the exact ones, and the report of a solve that
  !> has stagnated there.
  subroutine prepare(sim, control, report)
    type(simulation_t), intent(inout) :: sim
    type(solve_control_t), intent(out) :: control
    type(solve_report_t), intent(out) :: report
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    integer :: c

    call parse_config("column", "&scene dimension = 2, bodies = 'column', column_count = 2, gravity = 0, -1 /"//newline// &
      & "&time step = 1, steps = 1, theta = 1 /", config, error)
    call sim%init(comm, config, error)
    call check(.not. allocated(error), "configuration")
    call sim%assemble(figures)
    do c = 1, 2
      sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = merge(1.2_dp, 0.3_dp, sim%problem%sub(1)%pair(2, c) > 2)
    end do
    call sim%problem%evaluate()
    control%tolerance = 1.0e-10_dp
    control%max_iterations = 500
    control%check_every = 1
    report%status = solve_stagnated
    report%iterations = before
    report%seconds = 3.0_dp
    report%start_seconds = 1.0_dp
    report%layered = .true.
    report%layered_sweeps = 7.0_dp
    report%figure = 0.6_dp
    report%goal = control%tolerance
    report%creep%contacts = 11
    report%history%first_check = 4
  end subroutine prepare

  !> The normal impulses of both contacts, the larger one first [N s].
  function impulses(sim) result(r)
    type(simulation_t), intent(in) :: sim
    real(dp) :: r(2), all(2)
    integer :: c

    do c = 1, 2
      all(c) = sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c))
    end do
    r(1) = maxval(all)
    r(2) = minval(all)
  end function impulses

  subroutine check_impulses(sim, wanted, tolerance, name)
    type(simulation_t), intent(in) :: sim
    !> the larger one first [N s]
    real(dp), intent(in) :: wanted(2)
    real(dp), intent(in) :: tolerance
    character(len=*), intent(in) :: name
    real(dp) :: r(2)

    r = impulses(sim)
    call check_close(r(1), wanted(1), tolerance, name)
    call check_close(r(2), wanted(2), tolerance, name)
  end subroutine check_impulses

  !> The second method brings the solve to its goal: both are one solve.
  subroutine test_success()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback
    type(error_t), allocatable :: error
    real(dp) :: r(2)

    call prepare(sim, control, report)
    report%history%first = [-1, 33, 21]
    allocate (nlgs_t :: fallback%method)
    fallback%most_contacts = 2
    call fallback%take_over(sim%problem, control, report, error)
    call check(.not. allocated(error), "no error")
    call check_equal(report%status, solve_converged, "taken over: converged")
    r = impulses(sim)
    call check_close(r(1), 2.0_dp, 1.0e-9_dp, "taken over: the ground carries both")
    call check_close(r(2), 1.0_dp, 1.0e-9_dp, "taken over: the lower grain carries one")
    call check(report%iterations > before, "iterations of both")
    call check_equal(int(fallback%iterations), report%iterations - before, "iterations of the second method")
    call check_equal(int(fallback%taken), 1, "solves taken over")
    call check_equal(int(fallback%solved), 1, "solves brought to their goal")
    call check(report%residual <= control%tolerance, "the residual of the end")
    call check(report%seconds > 3.0_dp, "seconds of both")
    call check_close(report%start_seconds, 1.0_dp, 0.0_dp, "seconds before the first check of the first")
    call check(report%layered, "the first went on from a pass over layers")
    call check_close(report%layered_sweeps, 7.0_dp, 0.0_dp, "sweeps of that pass")
    call check_close(report%figure_ratio, 0.0_dp, 0.0_dp, "it tells nothing to the next solve")
    ! what the first had reached stays, what the second reached counts from the start of the first
    call check_equal(report%history%first(2), 21, "ten times the tolerance")
    call check_equal(report%history%first(1), 33, "half a decade")
    call check_equal(report%history%first(0), report%iterations, "the tolerance")
    call check_equal(report%history%first_check, 4, "first check")
    call fallback%free()
    call check(.not. allocated(fallback%method) .and. fallback%taken == 0, "freed")
    call sim%free()
  end subroutine test_success

  !> Solves that ended otherwise and problems that are too large are not taken over.
  subroutine test_not_taken()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback
    type(error_t), allocatable :: error
    integer, parameter :: others(*) = [solve_converged, solve_exhausted, solve_unbounded]
    integer :: k

    call prepare(sim, control, report)
    call fallback%take_over(sim%problem, control, report, error)
    allocate (nlgs_t :: fallback%method)
    fallback%most_contacts = 1
    call fallback%take_over(sim%problem, control, report, error)
    fallback%most_contacts = 2
    do k = 1, size(others)
      report%status = others(k)
      call fallback%take_over(sim%problem, control, report, error)
    end do
    call check_equal(int(fallback%taken), 0, "nothing was taken over")
    call check_equal(report%iterations, before, "no iterations were made")
    call check_impulses(sim, [1.2_dp, 0.3_dp], 0.0_dp, "the impulses are those of the first")
    ! what ended at max_iterations is taken over where these were many
    report%status = solve_exhausted
    report%iterations = 1999
    call fallback%take_over(sim%problem, control, report, error)
    call check_equal(int(fallback%taken), 0, "few iterations")
    report%iterations = 2000
    control%max_iterations = 1
    call fallback%take_over(sim%problem, control, report, error)
    call check_equal(int(fallback%taken), 1, "many iterations")
    call check_equal(report%iterations, 2001, "the second method has as many iterations at most as the first")
    call check_equal(report%status, solve_exhausted, "it stays what it was")
    call sim%free()
  end subroutine test_not_taken

  !> A second method that ends farther from the goal leaves the impulses and the figures of the first.
  subroutine test_worse(factor, name)
    real(dp), intent(in) :: factor
    character(len=*), intent(in) :: name
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback
    type(error_t), allocatable :: error
    real(dp) :: speed

    call prepare(sim, control, report)
    control%max_iterations = 10
    speed = sim%problem%sub(1)%v_global(2, 1)
    allocate (fallback%method, source=scaling_t(factor=factor))
    fallback%most_contacts = 2
    call fallback%take_over(sim%problem, control, report, error)
    call check_equal(report%status, solve_stagnated, name//": stagnated")
    call check_close(report%figure, 0.6_dp, 0.0_dp, name//": figure of the first")
    call check_impulses(sim, [1.2_dp, 0.3_dp], 0.0_dp, name//": impulses of the first")
    call check_close(sim%problem%sub(1)%v_global(2, 1), speed, 0.0_dp, name//": velocities of the first")
    call check(report%iterations > before .and. report%iterations <= before + 10, name//": iterations of both")
    call check(report%seconds > 3.0_dp, name//": seconds of both")
    call check_equal(int(report%creep%contacts), 11, name//": contacts that creep")
    call check_equal(int(fallback%taken), 1, name//": taken over")
    call check_equal(int(fallback%solved), 0, name//": not solved")
    call sim%free()
  end subroutine test_worse

  !> A second method that comes nearer, but not to the goal: the impulses are its own, and the solve has stagnated.
  subroutine test_better()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback
    type(error_t), allocatable :: error

    call prepare(sim, control, report)
    control%max_iterations = 3
    allocate (fallback%method, source=scaling_t(factor=1.1_dp))
    fallback%most_contacts = 2
    call fallback%take_over(sim%problem, control, report, error)
    call check_equal(report%status, solve_stagnated, "nearer: stagnated")
    call check(report%figure < 0.6_dp, "nearer: figure of the second")
    call check_impulses(sim, 1.1_dp**3*[1.2_dp, 0.3_dp], rounding, "nearer: impulses of the second")
    call check_equal(report%iterations, before + 3, "nearer: iterations of both")
    call check_equal(int(report%creep%contacts), 11, "nearer: contacts that creep, of the first")
    call sim%free()
  end subroutine test_better

  !> After five takeovers in vain two solves are left alone, also by a run that goes on from a checkpoint; one that is solved counts
  !> against one in vain.
  subroutine test_pauses()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback, again
    type(error_t), allocatable :: error
    integer(i8) :: words(fallback_words)
    integer :: k, made

    call prepare(sim, control, report)
    control%max_iterations = 2
    allocate (fallback%method, source=scaling_t(factor=1.5_dp))
    fallback%most_contacts = 2
    do k = 1, 6
      call fallback%take_over(sim%problem, control, report, error)
      made = report%iterations
    end do
    call check_equal(int(fallback%taken), 5, "takeovers in vain before a pause")
    call check_equal(int(fallback%passed_over), 1, "the next solve is left alone")
    call check_equal(report%status, solve_stagnated, "and stays what it was")
    call fallback%get_state(words)
    allocate (again%method, source=scaling_t(factor=1.5_dp))
    again%most_contacts = 2
    call again%set_state(words)
    do k = 1, 2
      call again%take_over(sim%problem, control, report, error)
      call check_equal(int(again%taken), k - 1, "the one after it too, after a restart")
      call check(report%iterations > made .eqv. k == 2, "a solve that is left alone costs nothing")
    end do
    call sim%free()
  end subroutine test_pauses

  !> The checks of both solves in one trace, whose iterations and seconds go on.
  subroutine test_trace()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(fallback_t) :: fallback
    type(error_t), allocatable :: error
    real(dp), parameter :: at(*) = [0.0_dp, 50.0_dp, 50.0_dp, 51.0_dp, 52.0_dp, 53.0_dp]
    integer :: k

    call prepare(sim, control, report)
    control%trace = .true.
    control%max_iterations = 3
    allocate (report%trace(6, 8), source=0.0_dp)
    report%n_trace = 2
    report%trace(1, 1:2) = [0.0_dp, 50.0_dp]
    report%trace(6, 1:2) = [0.0_dp, 2.0_dp]
    allocate (fallback%method, source=scaling_t(factor=1.1_dp))
    fallback%most_contacts = 2
    call fallback%take_over(sim%problem, control, report, error)
    ! two of the first, one at the start of the second and one after each of its iterations
    call check_equal(report%n_trace, 6, "checks of both")
    do k = 1, size(at)
      call check_close(report%trace(1, k), at(k), 0.0_dp, "iterations of the checks")
    end do
    call check(report%trace(6, 2) < report%trace(6, 3) .and. report%trace(6, 3) >= 3.0_dp, "seconds of the checks")
    call sim%free()
  end subroutine test_trace

  !> A scene has the second method that its options ask for.
  subroutine test_words()
    call check_words("", "newton", .true.)
    call check_words("&solver method = 'schwarz' /", "newton", .true., "&decomposition subdomains = 1 /")
    call check_words("&solver criterion = 'residual' /", "", .false.)
    call check_words("&solver criterion = 'residual', fallback = 'newton', fallback_contacts = 7 /", "newton", .true.)
    call check_words("&solver fallback = 'none' /", "", .false.)
    call check_words("&solver method = 'newton' /", "", .false.)
  end subroutine test_words

  subroutine check_words(groups, name, exists, more)
    character(len=*), intent(in) :: groups, name
    logical, intent(in) :: exists
    character(len=*), intent(in), optional :: more
    type(simulation_t) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=:), allocatable :: rest

    rest = ""
    if (present(more)) rest = more
    call parse_config("column", "&scene dimension = 2, bodies = 'column', column_count = 2 /"//newline// &
      & "&time step = 1e-3, steps = 1 /"//newline//groups//newline//rest, config, error)
    call sim%init(comm, config, error)
    call check(.not. allocated(error), "configuration with "//groups)
    call check(allocated(sim%fallback%method) .eqv. exists, "second method with "//groups)
    if (allocated(sim%fallback%method)) then
      associate (features => sim%fallback%method%features())
        call check(features%name == name, "its name with "//groups)
      end associate
      call check_equal(int(sim%fallback%most_contacts), merge(7, 10000, index(groups, "= 7") > 0), "its problems with "//groups)
    end if
    call sim%free()
  end subroutine check_words

end program test_fallback
