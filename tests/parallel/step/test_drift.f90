!> Ways in steps whose motion is not told from errors: of the centre, of the spread, of boundaries and of a cell against their
!> formulas, on grains in a row in several subdomains.
program test_drift
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_solve_report, only: solve_report_t, solve_converged, solve_stagnated
  use gravier_velocity_scale, only: velocity_scale_t
  use gravier_drift, only: drift_t, drift_words, most_drift
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> grains in a row, their distance [m], the step [s] and a velocity error [m/s]
  integer, parameter :: n = 12
  real(dp), parameter :: spacing = 0.25_dp, h = 0.5_dp, error = 1.0_dp, rounding = 1.0e-12_dp
  character(len=*), parameter :: row = "&scene bodies = 'lattice', lattice_count = 12, 1, radius_min = 0.1, "// &
    & "radius_max = 0.1"
  character(len=*), parameter :: rest = " / &time step = 0.5, steps = 4 / "// &
    & "&decomposition subdomains = 3 / &solver method = 'schwarz' / "
  !> root mean square distance from the middle of the row [m]
  real(dp), parameter :: gyration = spacing*sqrt((real(n, dp)**2 - 1.0_dp)/12.0_dp)
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_centre()
  call test_spread()
  call test_boundaries()
  call test_cell()
  call test_share()
  call test_beside_others()
  call test_state()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Put the grains in a row, and give them the velocity `v + rate (x - x_c)` along x.
  subroutine set_velocities(sim, v, rate)
    type(simulation_t), intent(inout) :: sim
    !> (2) [m/s], [1/s]
    real(dp), intent(in) :: v(2), rate
    integer :: s, k

    do s = 1, size(sim%decomposition%owned)
      associate (bodies => sim%decomposition%owned(s))
        do k = 1, bodies%n
          bodies%position(1, k) = spacing*real(bodies%id(k), dp)
          bodies%position(2, k) = 0.5_dp
          bodies%velocity(:, k) = 0.0_dp
          bodies%velocity(1:2, k) = v
          bodies%velocity(1, k) = v(1) + rate*spacing*(real(bodies%id(k), dp) - 0.5_dp*real(n + 1, dp))
        end do
      end associate
    end do
  end subroutine set_velocities

  !> Note a step with the velocity `apart` before it, whose boundaries bear something but for the first one. The bodies move as a
  !> whole if they have a mean velocity.
  subroutine note(drift, sim, apart, frame, status, mean)
    type(drift_t), intent(inout) :: drift
    type(simulation_t), intent(in) :: sim
    real(dp), intent(in) :: apart
    !> along x [m/s]
    real(dp), intent(in), optional :: frame
    !> of the solve; converged unless told
    integer, intent(in), optional :: status
    !> velocity of the bodies beside the frame (3) [m/s]
    real(dp), intent(in), optional :: mean(:)
    real(dp) :: impulses(2, size(sim%decomposition%boundaries))
    type(velocity_scale_t) :: scale
    type(solve_report_t) :: solve

    solve%status = solve_converged
    if (present(status)) solve%status = status
    solve%velocity_error = error
    impulses(:, :) = 1.0_dp
    if (size(impulses, 2) > 0) impulses(:, 1) = 0.0_dp
    scale%apart = apart
    scale%own = apart
    if (present(frame)) scale%frame(1) = frame
    if (present(mean)) then
      scale%mean(:) = mean
      scale%own = hypot(apart, norm2(mean))
    end if
    call drift%note(sim%decomposition, sim%physics, impulses, sim%mass, scale, solve)
  end subroutine note

  !> The way of the centre of mass: with its sense, in unresolved steps alone, by no more than twice the error.
  subroutine test_centre()
    type(simulation_t) :: sim
    type(drift_t) :: drift

    call make_scene(comm, row//rest, sim)
    call set_velocities(sim, [0.0_dp, 2.1_dp], 0.0_dp)
    call note(drift, sim, 2.1_dp)
    call set_velocities(sim, [0.3_dp, 0.4_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp, status=solve_stagnated)
    call check_equal(int(drift%steps), 0, "a motion that is told from the error of its solve, and a solve that missed its goal")
    call check_close(drift%length(), 0.0_dp, 0.0_dp, "has no part")
    call note(drift, sim, 1.9_dp)
    call check_equal(int(drift%steps), 1, "a motion that is not")
    call check_close(drift%length(), 0.5_dp*h, rounding, "way of the centre of mass")
    call set_velocities(sim, [-0.3_dp, 0.4_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp)
    call check_close(drift%length(), 0.8_dp*h, rounding, "what goes to and fro counts for nothing")
    call set_velocities(sim, [0.0_dp, 9.0_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp)
    call check_close(drift%length(), (0.8_dp + 2.0_dp*error)*h, rounding, "no more than twice the error")
    call set_velocities(sim, [0.0_dp, 100.0_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp)
    call check_close(drift%length(), (0.8_dp + 2.0_dp*error)*h, rounding, "nothing of grains in the air")
    drift = drift_t()
    call set_velocities(sim, [5.1_dp, 0.0_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp, frame=5.0_dp)
    call check_close(drift%length(), 0.1_dp*h, rounding, "beside what all boundaries have in common")
    drift = drift_t()
    call note(drift, sim, 1.9_dp, frame=2.0_dp, mean=[3.0_dp, 0.0_dp, 0.0_dp])
    call check_equal(int(drift%steps), 1, "bodies that move as a whole")
    call check_close(drift%length(), 0.0_dp, rounding, "their centre has no way against itself")
    call sim%free()
  end subroutine test_centre

  !> Grains that part from their middle, though it stays; along a periodic axis they have no place.
  subroutine test_spread()
    type(simulation_t) :: sim
    type(drift_t) :: drift

    call make_scene(comm, row//rest, sim)
    call set_velocities(sim, [0.0_dp, 0.0_dp], 0.1_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.1_dp*gyration*h, rounding, "way of the spread")
    call sim%free()
    drift = drift_t()
    call make_scene(comm, row//", period = 3.0, 0.0"//rest, sim)
    call set_velocities(sim, [0.0_dp, 0.0_dp], 0.1_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.0_dp, rounding, "none along a periodic axis")
    call sim%free()
  end subroutine test_spread

  !> A boundary goes along the components that forces move.
  subroutine test_boundaries()
    type(simulation_t) :: sim
    type(drift_t) :: drift
    integer :: lid

    call make_scene(comm, row//rest//"&boundary name = 'floor', shape = 'plane', normal = 0, 1, point = 0, -9 / "// &
      & "&boundary name = 'lid', shape = 'plane', normal = 0, -1, point = 0, 9, free = F, T, mass = 1.0, force = 0, -5 / ", sim)
    lid = size(sim%decomposition%boundaries)
    call set_velocities(sim, [0.0_dp, 0.0_dp], 0.0_dp)
    sim%decomposition%boundaries(lid)%velocity(:) = [3.0_dp, 0.1_dp, 0.0_dp]
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.1_dp*h, rounding, "a lid along the component that is free")
    sim%decomposition%boundaries(lid)%velocity(2) = -0.1_dp
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.0_dp, rounding, "and back")
    sim%decomposition%boundaries(1)%free(2) = .true.
    sim%decomposition%boundaries(1)%velocity(2) = 0.7_dp
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.1_dp*h, rounding, "one that bears nothing moves freely")
    sim%decomposition%boundaries(lid)%velocity(2) = 21.0_dp
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.1_dp*h, rounding, "and so does one that is fast")
    ! the bodies go on with 7 m/s and are faster at the end of the step
    drift = drift_t()
    sim%decomposition%boundaries(1)%velocity(:) = 0.0_dp
    sim%decomposition%boundaries(lid)%velocity(2) = 7.6_dp
    call set_velocities(sim, [0.0_dp, 7.5_dp], 0.0_dp)
    call note(drift, sim, 1.9_dp, mean=[0.0_dp, 7.0_dp, 0.0_dp])
    call check_close(drift%length(), 0.1_dp*h, rounding, "a lid beside bodies that move as a whole")
    call sim%free()
  end subroutine test_boundaries

  !> An edge of a cell goes along the components that stresses drive.
  subroutine test_cell()
    type(simulation_t) :: sim
    type(drift_t) :: drift

    call make_scene(comm, row//", period = 3.0, 2.0"//rest, sim)
    call set_velocities(sim, [0.0_dp, 0.0_dp], 0.0_dp)
    sim%physics%cell%now(1, 2) = 0.1_dp
    sim%physics%cell%now(2, 2) = 0.2_dp
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.0_dp, rounding, "no stress drives the cell")
    sim%physics%cell%is_driven = .true.
    sim%physics%cell%driven(2, 2) = .true.
    call note(drift, sim, 0.0_dp)
    call check_close(drift%length(), 0.2_dp*2.0_dp*h, rounding, "one drives its height")
    call sim%free()
  end subroutine test_cell

  !> Beside grains that move, those that rest have ways as long as they have half of the mass, and they alone; less error is aimed
  !> at than their own motion allows.
  subroutine test_beside_others()
    type(simulation_t) :: sim
    type(drift_t) :: drift
    type(velocity_scale_t) :: moving
    integer :: s, k, fast

    call make_scene(comm, row//rest, sim)
    do fast = 7, 6, -1
      call set_velocities(sim, [0.3_dp, 0.4_dp], 0.0_dp)
      do s = 1, size(sim%decomposition%owned)
        associate (bodies => sim%decomposition%owned(s))
          do k = 1, bodies%n
            if (bodies%id(k) <= fast) bodies%velocity(1, k) = 100.0_dp
          end do
        end associate
      end do
      call note(drift, sim, 70.0_dp)
      call check_equal(int(drift%steps), 7 - fast, "steps in which grains with half of the mass rest")
    end do
    call check_close(drift%length(), 0.5_dp*h*0.5_dp, rounding, "their way as a share of all")
    moving = velocity_scale_t(diameter=0.2_dp, value=8.0_dp, share=0.3_dp, apart=70.0_dp)
    call check_close(drift%goal_share(moving), 0.3_dp*0.5_dp/8.0_dp, rounding, "errors are compared with their motion")
    call set_velocities(sim, [0.3_dp, 0.4_dp], 0.0_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%goal_share(moving), 1.0_dp, 0.0_dp, "and with that of all where none are faster")
  end subroutine test_beside_others

  !> Beyond a part of the way that is free, half of the error is aimed at with each further part, down to a least share, and to no
  !> less than what is allowed where the motion is all there is.
  subroutine test_share()
    type(simulation_t) :: sim
    type(drift_t) :: drift
    real(dp), parameter :: part = 0.04_dp*most_drift*0.2_dp
    type(velocity_scale_t) :: at_rest, moving

    at_rest = velocity_scale_t(diameter=0.2_dp, value=1.0_dp)
    moving = velocity_scale_t(diameter=0.2_dp, value=8.0_dp, share=0.3_dp, apart=10.0_dp)
    call make_scene(comm, row//rest, sim)
    call check_close(drift%goal_share(at_rest), 1.0_dp, 0.0_dp, "before the first step")
    call set_velocities(sim, [0.0_dp, 9.9_dp*part/h], 0.0_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%goal_share(at_rest), 1.0_dp, 0.0_dp, "within ten parts")
    call set_velocities(sim, [0.0_dp, 3.1_dp*part/h], 0.0_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%goal_share(at_rest), 0.125_dp, 1.0e-9_dp, "three parts beyond them")
    call check_close(drift%goal_share(velocity_scale_t(value=1.0_dp)), 1.0_dp, 0.0_dp, "without grains")
    call check_close(drift%goal_share(velocity_scale_t(diameter=0.2_dp)), 1.0_dp, 0.0_dp, "without a scale")
    call check_close(drift%goal_share(moving), 0.375_dp, 1.0e-12_dp, "what errors are compared with where only motion counts")
    moving%value = 1.0_dp
    call check_close(drift%goal_share(moving), 1.0_dp, 0.0_dp, "no more than the goal")
    call set_velocities(sim, [0.0_dp, 1.0_dp], 0.0_dp)
    call note(drift, sim, 0.0_dp)
    call check_close(drift%goal_share(at_rest), 1.0e-3_dp, 0.0_dp, "the least share")
    call sim%free()
  end subroutine test_share

  !> What a checkpoint holds is all of it.
  subroutine test_state()
    type(simulation_t) :: sim
    type(drift_t) :: drift, again
    integer(i8), allocatable :: words(:)
    integer :: lid

    call make_scene(comm, row//rest//"&boundary name = 'floor', shape = 'plane', normal = 0, 1, point = 0, -9, free = F, T, "// &
      & "mass = 1 / ", sim)
    lid = size(sim%decomposition%boundaries)
    allocate (words(drift_words(lid)))
    call drift%get_state(words)
    call again%set_state(words)
    call check(words(1) == 0 .and. all(words(3:) == 0) .and. again%steps == 0, "before the first step")
    call set_velocities(sim, [0.1_dp, 0.0_dp], 0.0_dp)
    sim%decomposition%boundaries(lid)%velocity(2) = 0.3_dp
    call note(drift, sim, 0.0_dp)
    call drift%get_state(words)
    call again%set_state(words)
    call check(abs(drift%length() - again%length()) <= 0.0_dp .and. drift%steps == again%steps, "it is as it was")
    sim%decomposition%boundaries(lid)%velocity(2) = 0.0_dp
    call set_velocities(sim, [0.9_dp, 0.0_dp], 0.0_dp)
    call note(drift, sim, 0.0_dp)
    call note(again, sim, 0.0_dp)
    call check_close(again%length(), 1.0_dp*h, rounding, "and goes on")
    call check(abs(drift%length() - again%length()) <= 0.0_dp .and. drift%steps == again%steps, "with the same bits")
    call sim%free()
  end subroutine test_state

end program test_drift
