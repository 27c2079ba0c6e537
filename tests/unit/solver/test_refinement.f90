!> Solves that go on beyond their goal: when they do, how far, and whose impulses and figures are left.
program test_refinement
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_method, only: method_t
  use gravier_nlgs, only: nlgs_t
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_velocity, by_residual, solve_converged, solve_stagnated
  use gravier_refinement, only: refinement_t, refinement_words
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_simulations, only: make_scene
  use gravier_test_scaling, only: scaling_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm
  !> iterations of the first solve, and its velocity error [m/s]
  integer, parameter :: before = 3
  real(dp), parameter :: error_before = 0.7_dp

  call start_parallel()
  call comm%init()
  call test_success()
  call test_not_gone_on()
  call test_worse()
  call test_limits()
  call test_pauses()
  call test_trace()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of two unit grains under unit gravity with impulses of 0.6 and 0.3 of the exact ones, the velocity scale 1, and the
  !> report of a solve that has converged there.
  subroutine prepare(sim, control, report)
    type(simulation_t), intent(inout) :: sim
    type(solve_control_t), intent(out) :: control
    type(solve_report_t), intent(out) :: report
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
    control%accuracy = 0.8_dp
    control%tolerance = 0.5_dp
    control%max_iterations = 500
    report%status = solve_converged
    report%iterations = before
    report%seconds = 3.0_dp
    report%velocity_error = error_before
    report%figure = 0.7_dp
    report%goal = control%accuracy
    report%figure_ratio = 5.0_dp
    report%history%first = [3, 2, 1]
  end subroutine prepare

  !> The impulse of the ground [N s].
  real(dp) function on_ground(sim) result(impulse)
    type(simulation_t), intent(in) :: sim
    integer :: c

    impulse = 0.0_dp
    do c = 1, 2
      impulse = max(impulse, sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)))
    end do
  end function on_ground

  !> The smaller goal is reached: impulses, errors and iterations are those of the end, the goal is that of the user.
  subroutine test_success()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control, report)
    allocate (nlgs_t :: method)
    call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    call check(.not. allocated(error), "no error")
    call check_close(on_ground(sim), 2.0_dp, 1.0e-5_dp, "the ground carries both")
    call check_equal(report%status, solve_converged, "it has converged")
    call check(report%iterations > before, "iterations of both")
    call check_equal(int(refinement%iterations), report%iterations - before, "further iterations")
    call check_equal(int(refinement%refined), 1, "solves that went on")
    call check_equal(int(refinement%reached), 1, "solves that came to what they aimed at")
    call check_close(refinement%least_share, 1.0e-6_dp, 0.0_dp, "what they aimed at")
    call check(report%velocity_error < 1.0e-5_dp, "the velocity error of the end")
    call check(report%residual < 1.0e-5_dp .and. report%figure < 1.0e-5_dp, "residual and figure of the end")
    call check(report%seconds > 3.0_dp, "seconds of both")
    call check_close(report%goal, 0.8_dp, 0.0_dp, "the goal of the user")
    call check_close(report%figure_ratio, 5.0_dp, 0.0_dp, "what the first tells the next solve")
    call check_equal(report%history%first(0), 3, "the first reached its goal where it did")
    call sim%free()
  end subroutine test_success

  !> A goal that is hardly smaller, another criterion and a solve that missed its own are left alone.
  subroutine test_not_gone_on()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control, report)
    allocate (nlgs_t :: method)
    call refinement%go_on(sim%problem, method, control, 0.9_dp, report, error)
    report%status = solve_stagnated
    call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    report%status = solve_converged
    control%criterion = by_residual
    call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    call check_equal(int(refinement%refined), 0, "none went on")
    call check_equal(report%iterations, before, "no iterations were made")
    call check_close(on_ground(sim), 1.2_dp, 0.0_dp, "the impulses are those of the first")
    call sim%free()
  end subroutine test_not_gone_on

  !> Impulses that became worse are given up.
  subroutine test_worse()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    real(dp) :: speed

    call prepare(sim, control, report)
    speed = sim%problem%sub(1)%v_global(2, 1)
    allocate (method, source=scaling_t(factor=3.0_dp))
    call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    call check_equal(report%status, solve_converged, "worse: the solve has converged")
    call check_close(on_ground(sim), 1.2_dp, 0.0_dp, "worse: impulses of the first")
    call check_close(sim%problem%sub(1)%v_global(2, 1), speed, 0.0_dp, "worse: velocities of the first")
    call check_close(report%velocity_error, error_before, 0.0_dp, "worse: error of the first")
    call check(report%iterations > before, "worse: iterations of both")
    call check_equal(int(refinement%reached), 0, "worse: not reached")
    call sim%free()
  end subroutine test_worse

  !> Two hundred iterations, or twice those of the first solve, and no more than all solves may take.
  subroutine test_limits()
    integer, parameter :: made(*) = [3, 300, 3], most(*) = [5000, 5000, 50], further(*) = [200, 600, 50]
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer :: k

    do k = 1, size(made)
      call prepare(sim, control, report)
      control%max_iterations = most(k)
      report%iterations = made(k)
      if (allocated(method)) deallocate (method)
      ! the impulses stay as they are
      allocate (method, source=scaling_t(factor=1.0_dp))
      call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
      call check_equal(report%iterations - made(k), further(k), "further iterations")
      call sim%free()
    end do
  end subroutine test_limits

  !> After five solves that went on in vain two are left alone, also by a run that goes on from a checkpoint; those that came nearer,
  !> by half of their error, are not in vain.
  subroutine test_pauses()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement, again
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer(i8) :: words(refinement_words)
    integer :: k

    call prepare(sim, control, report)
    control%max_iterations = 2
    allocate (method, source=scaling_t(factor=1.0_dp))
    do k = 1, 6
      report%figure = 10.0_dp
      call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    end do
    call check_equal(int(refinement%refined), 6, "figures that fell by half")
    do k = 1, 6
      call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    end do
    call check_equal(int(refinement%refined), 11, "solves that went on in vain before a pause")
    call refinement%get_state(words)
    call again%set_state(words)
    do k = 1, 2
      call again%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
      call check_equal(int(again%refined), k - 1, "the next one is left alone too, after a restart")
    end do
    call sim%free()
  end subroutine test_pauses

  !> The checks of both in one trace.
  subroutine test_trace()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(refinement_t) :: refinement
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control, report)
    control%trace = .true.
    allocate (report%trace(6, 8), source=0.0_dp)
    report%n_trace = 2
    report%trace(1, 1:2) = [0.0_dp, 3.0_dp]
    allocate (nlgs_t :: method)
    call refinement%go_on(sim%problem, method, control, 1.0e-6_dp, report, error)
    call check(report%n_trace > 3, "checks of both")
    call check_close(report%trace(1, 2), 3.0_dp, 0.0_dp, "the last one of the first")
    call check_close(report%trace(1, 3), 3.0_dp, 0.0_dp, "the second begins there")
    call check_close(report%trace(1, report%n_trace), real(report%iterations, dp), 0.0_dp, "the last one of the second")
    call check(report%trace(6, 3) >= 3.0_dp, "seconds go on")
    call sim%free()
  end subroutine test_trace

end program test_refinement
