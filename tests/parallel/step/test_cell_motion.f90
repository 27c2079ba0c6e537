!> A periodic cell that deforms: what moves it without contacts, what it adds to their velocities, and the balance of a component
!> that a stress drives with the virial of the contacts of a solved step, in two subdomains.
program test_cell_motion
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_periodic, only: period_t
  use gravier_moving_cell, only: cell_motion_t
  use gravier_cell_response, only: respond, image_velocity, subtract_images
  use gravier_cell_drive, only: cell_drive_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_velocity_error, only: velocity_error_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call check_drive()
  call check_solved_steps()
  call check_returned()
  call check_error_seen()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Rates that are given, and a stress that accelerates what it drives: free = before - h V s/K, K = i M L^2.
  subroutine check_drive()
    type(cell_drive_t) :: drive
    type(period_t) :: period
    type(cell_motion_t) :: motion
    real(dp) :: branch(2), way(2), added(2)

    period = period_t(length=[2.0_dp, 3.0_dp, 0.0_dp], tilt=[0.5_dp, 0.0_dp, 0.0_dp], moves=.true.)
    drive%rate(1, 2) = 0.25_dp
    drive%stress(2, 2) = 7.0_dp
    drive%driven(2, 2) = .true.
    drive%inertia = 0.5_dp
    period%length_rate(2) = -0.3_dp
    call drive%begin_step(period, 2, 4.0_dp, 0.01_dp, 0.01_dp, motion)
    call check(motion%moves .and. motion%is_driven, "a stress drives it")
    call check_close(motion%before(2, 2), -0.1_dp, 1.0e-15_dp, "gradient at the start")
    call check_close(motion%inertia(2, 2), 0.5_dp*4.0_dp*9.0_dp, 1.0e-14_dp, "inertia")
    call check_close(motion%free(2, 2), -0.1_dp - 0.01_dp*6.0_dp*7.0_dp/18.0_dp, 1.0e-14_dp, "gradient without contacts")
    call check_close(motion%free(1, 2), 0.25_dp, 0.0_dp, "a rate that is given")
    branch(:) = [0.2_dp, -0.4_dp]
    way(:) = [0.5_dp, 3.0_dp]
    added(:) = motion%added(motion%free, branch, way)
    call check_close(added(1), 0.25_dp*(-0.4_dp), 1.0e-15_dp, "what is added along x")
    call check_close(added(2), (motion%free(2, 2) + 0.1_dp)*(-0.4_dp) + 0.1_dp*3.0_dp, 1.0e-15_dp, "what is added along y")
  end subroutine check_drive

  !> Disks in a cell that is sheared under a pressure.
  subroutine make_scene(restitution, sim)
    real(dp), intent(in) :: restitution
    type(simulation_t), intent(inout) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error

    call parse_config("cell", "&scene bodies = 'lattice', lattice_count = 6, 6, radius_min = 0.4, radius_max = 0.6, "// &
      & "friction = 0.4, restitution = "//to_text(restitution)//", density = 1, gravity = 0, 0, period = 7.6, 7.6, "// &
      & "cell_shear_rate = 0.2, cell_pressure = 0, 1, overlap_projection = F /"// &
      & new_line("a")//"&time step = 0.1, steps = 60 /"//new_line("a")// &
      & "&solver method = 'nscdd', criterion = 'residual', tolerance = 1e-10, max_iterations = 20000 /"//new_line("a")// &
      & "&decomposition grid = 2, 1 /", config, error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "the scene is made")
  end subroutine make_scene

  !> Disks come together under a pressure while they are sheared.
  subroutine check_solved_steps()
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    integer :: k, contacts

    call make_scene(0.0_dp, sim)
    contacts = 0
    do k = 1, 40
      call sim%advance(figures, error)
      call check(.not. allocated(error), "a step is made")
      if (mod(k, 10) > 0) cycle
      contacts = contacts + int(figures%contacts)
      call check_step(sim)
    end do
    call check(contacts > 60, "enough contacts to tell")
    call sim%free()
  end subroutine check_solved_steps

  !> What contacts send back of their velocities at the start of a step: that of the image which the candidate meets counts, and
  !> nothing is sent back where the bodies part and the cell and the loads close the contact again.
  subroutine check_returned()
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    real(dp) :: n(2), v(2), free(2), way(2), branch(2), expected
    integer :: s, c, k, across, apart, closed

    call make_scene(0.5_dp, sim)
    across = 0
    apart = 0
    closed = 0
    do k = 1, 30
      call sim%advance(figures, error)
      call check(.not. allocated(error), "a step with restitution is made")
      if (mod(k, 10) > 0) cycle
      call sim%assemble(figures)
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s), view => sim%halo%view(s), cell => sim%physics%cell)
          do c = 1, sub%n_contacts
            n(:) = sub%hot(lane_of(c), 1:2, block_of(c))
            way(:) = sub%cell%way(:, c)
            branch(:) = sub%cell%branch(:, c)
            associate (i => view%list%candidate(sub%source(c)), j => view%list%antagonist(sub%source(c)))
              v(:) = view%bodies%velocity(1:2, i) - view%bodies%velocity(1:2, j) - cell%before(1:2, 1)*way(1) &
                & - cell%before(1:2, 2)*way(2)
              free(:) = cell%added(cell%free, branch, way)
              free(:) = free + sub%v_free(1:2, sub%pair(1, c)) - sub%v_free(1:2, sub%pair(2, c))
              if (any(abs(way) > 0.0_dp)) across = across + 1
            end associate
            expected = 0.5_dp*dot_product(n, v)
            if (expected > 0.0_dp) then
              apart = apart + 1
              if (dot_product(n, free) < 0.0_dp) closed = closed + 1
              if (dot_product(n, free) < 0.0_dp) expected = 0.0_dp
            end if
            call check_close(sub%cell%shift(1, c), expected, 1.0e-14_dp, "what returns")
          end do
        end associate
      end do
    end do
    call check(comm%any_true(across > 0), "contacts across the period")
    call check(comm%any_true(apart > closed) .and. comm%any_true(closed > 0), "contacts that part, and some that are closed again")
    call sim%free()
  end subroutine check_returned

  !> A pressure on a square lattice of disks that touch. With nine tenths of the impulses that hold it every disk is in balance, and
  !> the cell closes with a tenth of the rate g that the pressure gives to it. The velocity error is that of the cell alone, K g^2
  !> with the inertia K = M L^2, over the mass M of the disks: g L. Test impulses that move no disk show it, because they move the
  !> cell.
  subroutine check_error_seen()
    integer, parameter :: count = 4
    real(dp), parameter :: h = 0.1_dp, pressure = 5.0_dp
    type(simulation_t) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    type(velocity_error_t) :: velocity
    real(dp) :: rate

    if (comm%rank == 0) call write_square(count)
    call comm%barrier()
    call parse_config("square", "&scene bodies = 'file', bodies_file = 'cell_motion.csv', density = 1, gravity = 0, 0, "// &
      & "period = 4, 4, cell_pressure = 0, 5, cell_inertia = 1 /"//new_line("a")// &
      & "&time step = 0.1, steps = 1 / &solver method = 'nscdd' / &decomposition grid = 2, 1 /", config, error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "the square is made")
    if (allocated(error)) return
    call sim%assemble(figures)
    call sim%method%start(sim%problem, error)
    call check(.not. allocated(error), "the solve starts")
    call velocity%start(sim%problem, 1.0_dp)
    rate = h*count**2*pressure/sim%problem%cell%inertia(2, 2)
    call check_close(sim%problem%cell%free(2, 2), -rate, 1.0e-12_dp, "the rate that the pressure gives")
    call check_error(sim, velocity, h*pressure, 0.9_dp, 0.1_dp*rate, "nine tenths of the impulses")
    ! without impulses violations alone show it
    call check_error(sim, velocity, h*pressure, 0.0_dp, rate, "no impulses")
    call check_change(sim, velocity, count, h*pressure)
    call sim%free()
  end subroutine check_error_seen

  !> Contacts above the row k of disks, 0 to count - 1, had the exact impulses, and have k a more. What has changed makes the whole
  !> error: a disk moves with a/m, those of the first row with (count - 1) a/m, and the cell with the virial of the change over K.
  !> No other test impulse has the same velocity.
  subroutine check_change(sim, velocity, count, held)
    type(simulation_t), intent(inout) :: sim
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: count
    real(dp), intent(in) :: held
    real(dp) :: residual, defect, a, mass, virial, square
    integer :: s, c, row(2)

    a = 0.1_dp*held
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        sim%method%acceleration%part(s)%impulse = sub%impulse
        do c = 1, sub%n_contacts
          if (abs(sub%hot(lane_of(c), 2, block_of(c))) < 0.5_dp) cycle
          row(1) = int(sub%id(sub%pair(1, c)) - 1)/count
          row(2) = int(sub%id(sub%pair(2, c)) - 1)/count
          if (abs(row(1) - row(2)) > 1) row(:) = count - 1
          sim%method%acceleration%part(s)%impulse(lane_of(c), 1, block_of(c)) = held
          sub%impulse(lane_of(c), 1, block_of(c)) = held + minval(row)*a
        end do
      end associate
    end do
    call respond(sim%problem)
    call sim%problem%evaluate()
    call velocity%assess(sim%problem, sim%method, 1, residual, defect)
    mass = velocity%mass/count**2
    virial = count*(count*(count - 1)/2)*a
    square = count*(count - 1)*count*a**2/mass + virial**2/sim%problem%cell%inertia(2, 2)
    call check_close(velocity%projection, sqrt(square/velocity%mass), 1.0e-9_dp, "Y of a change that moves disks and cell")
  end subroutine check_change

  !> A bodies file of disks of diameter 1, `count` by `count` in a square.
  subroutine write_square(count)
    integer, intent(in) :: count
    integer :: unit, i, j

    open (newunit=unit, file="cell_motion.csv", action="write", status="replace")
    write (unit, "(a)") "id,x,y,radius"
    do j = 1, count
      do i = 1, count
        write (unit, "(i0, ',', f5.2, ',', f5.2, ',0.5')") i + (j - 1)*count, i - 0.5_dp, j - 0.5_dp
      end do
    end do
    close (unit)
  end subroutine write_square

  !> What is found where contacts along y have a share of the impulses `held` each, and the cell closes with the rate `left`.
  subroutine check_error(sim, velocity, held, share, left, name)
    type(simulation_t), intent(inout) :: sim
    type(velocity_error_t), intent(inout) :: velocity
    real(dp), intent(in) :: held, share, left
    character(len=*), intent(in) :: name
    real(dp) :: residual, defect
    integer :: s, c

    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          if (abs(sub%hot(lane_of(c), 2, block_of(c))) > 0.5_dp) sub%impulse(lane_of(c), 1, block_of(c)) = share*held
        end do
      end associate
    end do
    call respond(sim%problem)
    call sim%problem%evaluate()
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call check_close(velocity%largest_violation, left, 1.0e-12_dp, name//": rate at which disks close")
    call check_close(velocity%projection, left*sim%decomposition%period%length(2), 1.0e-12_dp, name//": Y of the cell")
  end subroutine check_error

  !> K (now - before) = sum of p l - h V s, and contacts that press do not part or close, relative to the images that they meet.
  subroutine check_step(sim)
    type(simulation_t), intent(inout) :: sim
    real(dp), allocatable :: v(:, :, :), rows(:, :)
    real(dp) :: parts(1, size(sim%problem%sub)), sums(1), p(2), volume, image(2), worst
    integer :: s, c

    parts(:, :) = 0.0_dp
    worst = 0.0_dp
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        allocate (v, mold=sub%impulse)
        call sim%problem%kernels%contact_velocity(sub%pair, sub%hot, sub%v_global, v)
        rows = v(:, 1, :)
        call subtract_images(sim%problem, s, v)
        do c = 1, sub%n_contacts
          call sim%problem%impulse_on_candidate(s, c, p)
          parts(1, s) = parts(1, s) + p(2)*sub%cell%branch(2, c)
          image(:) = image_velocity(sub, 2, c, sim%problem%cell%now)
          call check_close(v(lane_of(c), 1, block_of(c)), rows(lane_of(c), block_of(c)) - image(1), 1.0e-14_dp, &
            & "the image is taken")
          ! gaps close within the step
          if (sub%impulse(lane_of(c), 1, block_of(c)) > 1.0e-6_dp) worst = max(worst, &
            & abs(v(lane_of(c), 1, block_of(c)) + max(sub%gap(c), 0.0_dp)/sim%physics%h))
        end do
        deallocate (v)
      end associate
    end do
    call comm%sum_parts(parts, sums)
    associate (cell => sim%problem%cell)
      ! the step's box: that of q_m, half a step of its rates before the end
      volume = product(sim%decomposition%period%length(1:2) - 0.05_dp*sim%decomposition%period%length_rate(1:2))
      call check_close(cell%inertia(2, 2)*(cell%now(2, 2) - cell%before(2, 2)), sums(1) - 0.1_dp*volume*1.0_dp, 1.0e-9_dp, &
        & "the pressure drives it against the virial")
      call check_close(cell%now(1, 2), 0.2_dp, 0.0_dp, "the rate of shear")
    end associate
    call check(worst < 1.0e-6_dp, "contacts that press hold")
    ! nothing changes where the impulses do not
    call respond(sim%problem)
    call check_close(sim%problem%cell%now(2, 2), sim%physics%cell%now(2, 2), 0.0_dp, "the response to the same impulses")
  end subroutine check_step

end program test_cell_motion
