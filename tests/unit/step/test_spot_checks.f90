!> Spot checks: what they find of a solve whose error is known, when they are due, and that they leave everything as it was.
program test_spot_checks
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_method, only: method_t
  use gravier_nlgs, only: nlgs_t
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_velocity, by_residual, solve_converged, solve_stagnated
  use gravier_spot_checks, only: spot_checks_t, difference_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_simulations, only: make_scene
  use gravier_test_scaling, only: scaling_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_difference()
  call test_found()
  call test_refuted()
  call test_given_up()
  call test_due()
  call test_none()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of two unit grains under unit gravity with impulses 1.2 of the ground and 0.3 between the grains, where 2 and 1 are
  !> exact; the velocity scale is 2. A solve is said to have converged to that, in no iterations.
  subroutine prepare(sim, control, solve)
    type(simulation_t), intent(inout) :: sim
    type(solve_control_t), intent(out) :: control
    type(solve_report_t), intent(out) :: solve
    type(step_figures_t) :: figures
    integer :: c

    call make_scene(comm, "&scene dimension = 2, bodies = 'column', column_count = 2, gravity = 0, -1 / "// &
      & "&time step = 1, steps = 1, theta = 1 /", sim)
    call sim%assemble(figures)
    do c = 1, 2
      sim%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = merge(1.2_dp, 0.3_dp, sim%problem%sub(1)%pair(2, c) > 2)
    end do
    sim%problem%error_scale = 2.0_dp
    call sim%problem%evaluate()
    control%criterion = by_velocity
    control%accuracy = 1.0_dp
    control%tolerance = 1.0e-11_dp
    control%max_iterations = 10000
    solve%status = solve_converged
    solve%velocity_error = 0.8_dp
    solve%velocity_scale = 2.0_dp
  end subroutine prepare

  !> Checks that may take all iterations; looks until one is due, after 20 solves that had nothing to do.
  subroutine look(checks, sim, method, control, solve, error)
    type(spot_checks_t), intent(inout) :: checks
    type(simulation_t), intent(inout) :: sim
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: solve
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    checks%part = 1.0_dp
    do k = 1, 21
      if (checks%made == 1) return
      call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    end do
  end subroutine look

  subroutine test_difference()
    type(difference_t) :: difference

    call check_close(difference%share(), 0.0_dp, 0.0_dp, "nothing is off by nothing")
    call difference%add(9.0_dp, 1.0_dp)
    call difference%add(0.0_dp, 3.0_dp)
    call check_close(difference%share(), 1.5_dp, 1.0e-15_dp, "roots of sums of squares")
  end subroutine test_difference

  !> Velocities are -0.1 and -0.7 where the grains are at rest; moments of the ground and of the pair have levers of 1 and 2.
  subroutine test_found()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: solve
    type(spot_checks_t) :: checks
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    real(dp), allocatable :: impulse(:, :, :), velocity(:, :)

    call prepare(sim, control, solve)
    allocate (nlgs_t :: method)
    impulse = sim%problem%sub(1)%impulse
    velocity = sim%problem%sub(1)%v_global
    call look(checks, sim, method, control, solve, error)
    call check(.not. allocated(error), "no error")
    call check_equal(int(checks%made), 1, "a check")
    call check_equal(int(checks%reached), 1, "it came to its goal")
    call check_close(checks%mean(checks%found), sqrt(0.25_dp)/2.0_dp, 1.0e-8_dp, "velocity error over its scale")
    call check_close(checks%mean(checks%estimated), 0.4_dp, 1.0e-15_dp, "what was estimated")
    call check_close(checks%contacts%share(), sqrt(1.13_dp/5.0_dp), 1.0e-8_dp, "forces of contacts")
    call check_close(checks%stress%share(), (0.8_dp + 1.4_dp)/4.0_dp, 1.0e-8_dp, "mean stress")
    call check_equal(size(checks%boundary), 1, "a boundary")
    call check_close(checks%boundary(1)%share(), 0.4_dp, 1.0e-8_dp, "force on the ground")
    call check(checks%further > 0, "iterations of the check")
    call check_close(checks%times(), 1.0_dp, 0.0_dp, "times of no iterations")
    checks%iterations = checks%further
    call check_close(checks%times(), 2.0_dp, 1.0e-15_dp, "times of as many iterations")
    call check_equal(int(checks%beyond), 0, "within the goal")
    call check(all(abs(impulse - sim%problem%sub(1)%impulse) <= 0.0_dp), "the same impulses as before")
    call check(all(abs(velocity - sim%problem%sub(1)%v_global) <= 0.0_dp), "the same velocities as before")
    call check_equal(int(method%work%solves), 0, "no solve of the run")
    call check_equal(int(method%work%iterations), 0, "no iteration of the run")
    call sim%free()
  end subroutine test_found

  !> The velocity error is 0.25 of the scale: more than twice a goal of 0.12, less than twice one of 0.13. Two of such checks, more
  !> than one in twenty, say that the estimates are too small.
  subroutine test_refuted()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: solve
    type(spot_checks_t) :: checks
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer :: k

    do k = 1, 2
      call prepare(sim, control, solve)
      if (allocated(method)) deallocate (method)
      allocate (nlgs_t :: method)
      checks = spot_checks_t()
      control%accuracy = merge(0.12_dp, 0.13_dp, k == 1)
      call look(checks, sim, method, control, solve, error)
      call check_equal(int(checks%reached), 1, "checked")
      call check_equal(int(checks%beyond), merge(1, 0, k == 1), "beyond twice the goal")
      call check(.not. checks%refute(), "one says nothing")
      call sim%free()
    end do
    checks%beyond = 2
    checks%reached = 39
    call check(checks%refute(), "two of 39 do")
    checks%reached = 40
    call check(.not. checks%refute(), "two of 40 do not")
  end subroutine test_refuted

  !> A method that comes nowhere is given up after 30 times the iterations of the solve, which count as ten at least.
  subroutine test_given_up()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: solve
    type(spot_checks_t) :: checks
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control, solve)
    allocate (method, source=scaling_t(factor=1.0001_dp))
    call look(checks, sim, method, control, solve, error)
    call check_equal(int(checks%made), 1, "given up: a check")
    call check_equal(int(checks%reached), 0, "given up: not reached")
    call check_equal(int(checks%further), 300, "given up: iterations")
    call check_close(checks%mean(checks%found), 0.0_dp, 0.0_dp, "given up: nothing is known")
    call check_equal(int(checks%beyond), 0, "given up: not found wrong")
    call sim%free()
  end subroutine test_given_up

  !> The first check is expected to take ten times the iterations of its solve, later ones what those before took; solves save up
  !> their part of their iterations, of which each has five more.
  subroutine test_due()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: solve
    type(spot_checks_t) :: checks
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error
    integer :: k

    call prepare(sim, control, solve)
    allocate (nlgs_t :: method)
    checks%part = 0.5_dp
    solve%iterations = 15
    do k = 1, 16
      call check_equal(int(checks%made), 0, "not due before 15 solves")
      call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    end do
    call check_equal(int(checks%made), 1, "due after 15 solves")
    call check_equal(int(checks%iterations), 15, "iterations of the solve that was checked")
    checks%further = 200
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    call check_equal(int(checks%made), 1, "not due again before 400 are saved up")
    solve%iterations = 480
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    call check_equal(int(checks%made), 1, "not due by its own iterations")
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    call check_equal(int(checks%made), 2, "due again")
    call sim%free()
  end subroutine test_due

  !> Checks that are off, another criterion, a solve that has failed.
  subroutine test_none()
    type(simulation_t) :: sim
    type(solve_control_t) :: control
    type(solve_report_t) :: solve
    type(spot_checks_t) :: checks
    class(method_t), allocatable :: method
    type(error_t), allocatable :: error

    call prepare(sim, control, solve)
    allocate (nlgs_t :: method)
    solve%iterations = 1000000
    solve%status = solve_stagnated
    checks%part = 100.0_dp
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    solve%status = solve_converged
    control%criterion = by_residual
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    control%criterion = by_velocity
    checks%part = 0.0_dp
    call checks%look(sim%decomposition, sim%problem, method, control, solve, error)
    call check_equal(int(checks%made), 0, "no check")
    call sim%free()
  end subroutine test_none

end program test_spot_checks
