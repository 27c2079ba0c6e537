!> Solves that aim at less error than they have to: when they do, in how many iterations, and what is left where they do not come
!> to it.
program test_refinement
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_method, only: method_t
  use gravier_nlgs, only: nlgs_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_velocity, by_residual, solve_converged, solve_exhausted
  use gravier_refinement, only: refinement_t, refinement_words
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_simulations, only: make_scene
  use gravier_test_scaling, only: scaling_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_success()
  call test_plain()
  call test_in_vain()
  call test_diverged()
  call test_limits()
  call test_pauses()
  call test_trace()
  call test_bonds()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of two unit grains under unit gravity with impulses of 0.6 and 0.3 of the exact ones, the velocity scale 1, and a goal
  !> that they are within.
  subroutine prepare(sim, control)
    type(simulation_t), intent(inout) :: sim
    type(solve_control_t), intent(out) :: control
    type(step_figures_t) :: figures
    integer :: c

    call make_scene(comm, "&scene dimension = 2, bodies = 'column', column_count = 2, gravity = 0, -1 / "// &
      & "&time step = 1, steps = 1, theta = 1 /", sim)
    call sim%assemble(figures)
    do c = 1, 2
      sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = merge(1.2_dp, 0.3_dp, sim%problem%sub(1)%pair(2, c) > 2)
    end do
    call sim%problem%evaluate()
    control%criterion = by_velocity
    control%accuracy = 1.0e4_dp
    control%tolerance = 1.0e2_dp
    control%max_iterations = 10000
    control%layered = .false.
  end subroutine prepare

  !> Solve with a share of the goal to aim at.
  subroutine solve(refinement, sim, method, control, share, report, error)
    type(refinement_t), intent(inout) :: refinement
    type(simulation_t), intent(inout) :: sim
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    real(dp), intent(in) :: share
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error

    call refinement%decide(sim%problem, control, share)
    if (refinement%aims) then
      call refinement%solve(sim%problem, method, control, report, error)
    else
      call solve_contacts(sim%problem, method, control, report, error)
    end if
  end subroutine solve

  !> The impulse of the ground [N s].
  real(dp) function on_ground(sim) result(impulse)
    type(simulation_t), intent(in) :: sim
    integer :: c

    impulse = 0.0_dp
    do c = 1, 2
      impulse = max(impulse, sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)))
    end do
  end function on_ground

  !> The smaller goal is reached: the report is of one solve with the goal of the user.
  subroutine test_success()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control)
    allocate (nlgs_t :: method)
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check(.not. allocated(error), "no error")
    call check_close(on_ground(sim), 2.0_dp, 1.0e-5_dp, "the ground carries both")
    call check_equal(report%status, solve_converged, "it has converged")
    call check(report%iterations > 0, "iterations")
    call check_equal(int(method%work%solves), 1, "one solve")
    call check_equal(int(refinement%refined), 1, "solves that aimed at less error")
    call check_equal(int(refinement%reached), 1, "solves that came to it")
    call check_equal(int(refinement%in_vain), 0, "no iterations in vain")
    call check_close(refinement%least_share, 1.0e-10_dp, 0.0_dp, "what they aimed at")
    call check(report%velocity_error < 1.0e-5_dp .and. report%figure < 1.0e-5_dp, "error and figure of the end")
    call check_close(report%goal, 1.0e4_dp, 0.0_dp, "the goal of the user")
    call check_close(report%violation_allowed, 5.0e4_dp, 1.0e-3_dp, "and what it allows of a contact")
    call sim%free()
  end subroutine test_success

  !> A goal that is hardly smaller, and another criterion: solves are as without.
  subroutine test_plain()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control)
    allocate (nlgs_t :: method)
    call solve(refinement, sim, method, control, 0.6_dp, report, error)
    control%criterion = by_residual
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check_equal(int(refinement%refined), 0, "none aimed at less error")
    call check_close(on_ground(sim), 1.2_dp, 0.0_dp, "the impulses were good enough")
    call sim%free()
  end subroutine test_plain

  !> A smaller goal that is not reached: the solve goes on to that of the user, and both are one.
  subroutine test_in_vain()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control)
    allocate (method, source=scaling_t(factor=1.001_dp))
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check_equal(report%status, solve_converged, "in vain: it has converged")
    call check(report%iterations >= 200, "in vain: iterations of both")
    call check_close(on_ground(sim), 1.2_dp*1.001_dp**report%iterations, 1.0e-10_dp, "in vain: impulses of the end")
    call check_equal(int(method%work%solves), 1, "in vain: one solve")
    call check_equal(int(refinement%refined), 1, "in vain: aimed at")
    call check_equal(int(refinement%reached), 0, "in vain: not reached")
    call check_equal(int(refinement%in_vain), 200, "in vain: iterations until it was given up")
    call sim%free()
  end subroutine test_in_vain

  !> Impulses that grow beyond bounds are given up, and so are those of a problem without a solution.
  subroutine test_diverged()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    real(dp) :: speed

    call prepare(sim, control)
    speed = sim%problem%sub(1)%v_global(2, 1)
    allocate (method, source=scaling_t(factor=1.0e3_dp))
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check(report%status == solve_converged .or. report%status == solve_exhausted, "diverged: it begins anew")
    call check_equal(int(refinement%reached), 0, "diverged: not reached")
    if (report%status == solve_converged) then
      call check_close(on_ground(sim), 1.2_dp, 0.0_dp, "diverged: impulses of the start")
      call check_close(sim%problem%sub(1)%v_global(2, 1), speed, 0.0_dp, "diverged: velocities of the start")
    end if
    call sim%free()
  end subroutine test_diverged

  !> Two hundred iterations, twice as many after each attempt in vain, up to 1600, and no more than a quarter of
  !> what all solves may take. One that
  !> needs less than a quarter halves them again.
  subroutine test_limits()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method, solver
    type(error_t), allocatable :: error
    integer(i8) :: words(refinement_words)
    integer, parameter :: further(*) = [200, 400, 800, 1600, 1600]
    integer :: k, before

    call prepare(sim, control)
    ! the impulses stay as they are
    allocate (method, source=scaling_t(factor=1.0_dp))
    do k = 1, size(further)
      before = int(refinement%in_vain)
      call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
      call check_equal(int(refinement%in_vain) - before, further(k), "iterations of an attempt")
    end do
    control%max_iterations = 50
    before = int(refinement%in_vain)
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check_equal(int(refinement%in_vain) - before, 12, "a quarter of the limit of all solves")
    call check_equal(report%iterations, 12, "and the goal of the user needs no more")
    control%max_iterations = 5000
    allocate (nlgs_t :: solver)
    call solve(refinement, sim, solver, control, 1.0e-10_dp, report, error)
    call refinement%get_state(words)
    call check_equal(int(words(2)), 2, "fewer after one that needs few")
    call sim%free()
  end subroutine test_limits

  !> After five attempts in vain with as many iterations as there may be, two solves are left alone, also by a run that goes on from
  !> a checkpoint.
  subroutine test_pauses()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement, again
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer(i8) :: words(refinement_words)
    integer :: k

    call prepare(sim, control)
    control%max_iterations = 2
    allocate (method, source=scaling_t(factor=1.0_dp))
    do k = 1, 9
      call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    end do
    call check_equal(int(refinement%refined), 8, "attempts in vain before a pause")
    call refinement%get_state(words)
    call again%set_state(words)
    do k = 1, 2
      call solve(again, sim, method, control, 1.0e-10_dp, report, error)
      call check_equal(int(again%refined), k - 1, "the next one is left alone too, after a restart")
    end do
    call sim%free()
  end subroutine test_pauses

  !> The checks of both in one trace, whose iterations and seconds go on.
  subroutine test_trace()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer :: k

    call prepare(sim, control)
    control%trace = .true.
    allocate (method, source=scaling_t(factor=1.0_dp))
    call solve(refinement, sim, method, control, 1.0e-10_dp, report, error)
    call check(report%n_trace > 20, "checks of both")
    call check_close(report%trace(1, 1), 0.0_dp, 0.0_dp, "the first one")
    call check(report%trace(1, report%n_trace) >= 200.0_dp, "those of the second go on")
    do k = 2, report%n_trace
      call check(report%trace(1, k) >= report%trace(1, k - 1) .and. report%trace(6, k) >= report%trace(6, k - 1), "none goes back")
    end do
    call sim%free()
  end subroutine test_trace

  !> A solve that leaves bonds at their limits goes on to a hundredth of its goal, in one solve, and so do those of the next twenty
  !> steps. In vain, it is as if nothing had been tried.
  subroutine test_bonds()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement, again
    class(method_t), allocatable :: method, in_vain
    type(error_t), allocatable :: error
    integer(i8) :: words(refinement_words)
    integer :: k

    call prepare(sim, control)
    control%accuracy = 1.0e-3_dp
    control%tolerance = 1.0e-1_dp
    allocate (nlgs_t :: method)
    allocate (in_vain, source=scaling_t(factor=1.0001_dp))
    report%status = solve_converged
    report%iterations = 7
    in_vain%work%solves = 1
    method%work%solves = 1
    call refinement%decide(sim%problem, control, 1.0_dp)
    call refinement%settle(sim%problem, in_vain, control, report, error)
    call check(refinement%in_vain >= 1000, "bonds: iterations until it was given up")
    call check_equal(report%iterations - 7, int(refinement%in_vain), "bonds: iterations of both, in vain")
    call check_close(on_ground(sim), 1.2_dp, 0.0_dp, "bonds: impulses of the solve, in vain")
    call check_close(refinement%doubt(0.3_dp, 20.0_dp), 0.3_dp, 0.0_dp, "bonds: by the estimate of the solve, in vain")
    call refinement%note_bonds(.true., .false., 0.0_dp)
    call check_equal(int(refinement%in_doubt), 1, "bonds: a step in doubt")
    call refinement%get_state(words)
    call again%set_state(words)
    call again%decide(sim%problem, control, 1.0_dp)
    call check(again%aims, "bonds: the next one aims at less error, also after a restart")
    refinement = refinement_t()
    call refinement%decide(sim%problem, control, 1.0_dp)
    report%iterations = 7
    call refinement%settle(sim%problem, method, control, report, error)
    call check_close(on_ground(sim), 2.0_dp, 1.0e-4_dp, "bonds: less error")
    call check_close(refinement%least_share, 0.01_dp, 0.0_dp, "bonds: a hundredth of the goal")
    call check(report%iterations > 7, "bonds: iterations of both")
    call check_close(report%goal, 1.0e-3_dp, 0.0_dp, "bonds: the goal of the user")
    call check_equal(int(method%work%solves), 1, "bonds: one solve")
    call check_equal(int(in_vain%work%solves), 1, "bonds: one solve in vain")
    call check_equal(int(refinement%for_bonds), 1, "bonds: counted")
    call check_close(refinement%doubt(0.3_dp, 2.0_dp), 0.3_dp, 0.0_dp, "bonds: by the estimate of the solve")
    call check_close(refinement%doubt(1.0e-3_dp, 2.0_dp), 0.2_dp, 1.0e-15_dp, "bonds: no less than a tenth of the goal of the user")
    call refinement%note_bonds(.true., .false., 0.25_dp)
    call check_close(refinement%doubt(1.0e-3_dp, 2.0_dp), 0.25_dp, 0.0_dp, "bonds: no less than the error of the step before")
    call check_close(refinement%doubt(0.3_dp, 2.0_dp), 0.3_dp, 0.0_dp, "bonds: more than the error of the step before")
    call refinement%get_state(words)
    call again%set_state(words)
    call check_close(again%doubt(1.0e-3_dp, 2.0_dp), 0.25_dp, 0.0_dp, "bonds: the error of the step before, after a restart")
    do k = 1, 20
      call refinement%note_bonds(.false., .false., 0.0_dp)
      call refinement%decide(sim%problem, control, 1.0_dp)
      call check(refinement%aims .eqv. k < 20, "bonds: for twenty steps")
    end do
    call refinement%note_bonds(.true., .false., 0.0_dp)
    call refinement%decide(sim%problem, control, 1.0_dp)
    call check(refinement%aims, "bonds: again in doubt")
    call refinement%note_bonds(.true., .true., 0.0_dp)
    call refinement%decide(sim%problem, control, 1.0_dp)
    call check(.not. refinement%aims, "bonds: not where bodies move")
    call refinement%take_care()
    call refinement%decide(sim%problem, control, 1.0_dp)
    call check(refinement%aims, "bonds: from the start")
    refinement = refinement_t()
    control%criterion = by_residual
    call refinement%decide(sim%problem, control, 1.0_dp)
    report%iterations = 7
    call refinement%settle(sim%problem, method, control, report, error)
    call check_equal(report%iterations, 7, "bonds: another criterion goes on with nothing")
    call check_close(refinement%doubt(0.3_dp, 20.0_dp), 0.3_dp, 0.0_dp, "bonds: and tells as it is")
    control%criterion = by_velocity
    method%keeps_best = .true.
    call refinement%settle(sim%problem, method, control, report, error)
    call check_equal(report%iterations, 7, "bonds: a method of direct solves goes on with nothing")
    call sim%free()
  end subroutine test_bonds

end program test_refinement
