!> What is done to the grains of a sample before they are written: let gravity settle them, or press them together.
module gravier_sample_preparation
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_ok, status_unconverged
  use gravier_text, only: to_text, counted
  use gravier_communicator, only: communicator_t
  use gravier_body_store, only: body_set_t
  use gravier_solve_report, only: solve_converged, solve_diverged
  use gravier_config, only: config_t
  use gravier_sample_container, only: hold_still
  use gravier_load_areas, only: facing_area
  use gravier_scene_extent, only: find_extent
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_structure, only: carrying_neighbours
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_run_log, only: run_log_t
  use gravier_sample_place, only: sample_program, open_log
  use gravier_sample_rest, only: rest_t
  use gravier_own_files, only: check_own_files
  use gravier_final_bodies, only: write_final_bodies
  implicit none
  private
  public :: prepare_sample

  !> steps from one line of the log to the next
  integer, parameter :: steps_a_line = 100
  !> way of a plane that presses, in a step, relative to the mean radius
  real(dp), parameter :: way_of_plane = 0.05_dp
  !> fraction of its velocity that everything keeps from one step of a compaction to the next once the loads are out of
  !> balance by less than the second figure: nothing else would ever stop grains that touch no others. At rest it does
  !> nothing; a factor common to all does not push bodies into each other
  real(dp), parameter :: velocity_kept = 0.98_dp, imbalance_damped = 0.1_dp

contains

  !> Settle or compact the sample of `config` and write it to its file. `status` is status_unconverged where the grains did
  !> not come to rest. Errors are the same on all ranks. Collective.
  subroutine prepare_sample(comm, config, log, status, error)
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    type(run_log_t), intent(inout) :: log
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: loads
    type(simulation_t) :: simulation
    type(rest_t) :: rest
    logical :: keep

    status = status_ok
    loads = config
    call hold_still(loads)
    if (config%sample%preparation == "compacted") then
      loads%scene%gravity(:) = 0.0_dp
      loads%scene%gravity_table = ""
      loads%scene%body_force(:) = 0.0_dp
    end if
    call simulation%init(comm, loads, error)
    if (allocated(error)) return
    call open_log(config, log, error)
    call log%write_start(simulation, error)
    if (config%sample%preparation == "compacted") then
      call free_planes(simulation)
      call log%line("loads       pressure "//to_text(config%sample%pressure, 4)//" on the upper planes; no gravity", error)
    end if
    if (size(config%boundaries) > 0) call log%line("boundaries  stand still until the grains are at rest", error)
    call log%write_head(error)
    call comm%agree(error)
    call rest%init(simulation)
    call run_steps(simulation, log, rest, keep, error)
    if (.not. allocated(error)) call write_summary(simulation, log, rest, error)
    if (keep) then
      if (rest%reached()) call stop_grains(simulation)
      call write_final_bodies(simulation, trim(config%sample%file), .true., sample_program, error)
    end if
    call check_own_files(error)
    call comm%agree(error)
    if (.not. rest%reached()) status = status_unconverged
    if (.not. allocated(error)) call write_verdict(simulation, log, rest, keep, error)
    call comm%agree(error)
    call simulation%free()
  end subroutine prepare_sample

  !> Let forces move the upper plane across each axis that is not periodic. Collective.
  subroutine free_planes(simulation)
    type(simulation_t), intent(inout) :: simulation
    real(dp) :: layer
    integer :: b, nd

    nd = simulation%decomposition%nd
    layer = total_mass(simulation)/real(simulation%n_grains, dp)**(1.0_dp/nd)
    associate (boundaries => simulation%decomposition%boundaries)
      do b = 1, simulation%n_walls
        boundaries(b)%free(1:nd) = boundaries(b)%surface%axis(1:nd) < 0.0_dp
        ! at least as heavy as a layer of grains, and so heavy that a step does not add much to its speed
        boundaries(b)%mass = max(layer, 2.0_dp*simulation%physics%h*simulation%config%sample%pressure* &
          & facing_area(simulation%decomposition, b)/speed_limit(simulation))
      end do
    end associate
  end subroutine free_planes

  !> Give the free planes the force that is the pressure on their present area, towards the grains, hold their speed below
  !> the limit; on request damp all motion.
  subroutine press(simulation, damp)
    type(simulation_t), intent(inout) :: simulation
    logical, intent(in) :: damp
    real(dp) :: limit, keep
    integer :: b, s

    keep = merge(velocity_kept, 1.0_dp, damp)
    limit = speed_limit(simulation)
    associate (boundaries => simulation%decomposition%boundaries)
      do b = 1, simulation%n_walls
        if (.not. boundaries(b)%is_driven()) cycle
        boundaries(b)%drive%force(:) = simulation%config%sample%pressure*facing_area(simulation%decomposition, b)* &
          & boundaries(b)%surface%axis
        where (boundaries(b)%free) boundaries(b)%velocity = keep*min(max(boundaries(b)%velocity, -limit), limit)
      end do
    end associate
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        owned%velocity(:, :) = keep*owned%velocity
      end associate
    end do
  end subroutine press

  !> Of the planes that press [m/s]: contacts are then seen before they overlap, whatever the way to go.
  pure real(dp) function speed_limit(simulation)
    type(simulation_t), intent(in) :: simulation
    speed_limit = way_of_plane*simulation%decomposition%rule%mean_radius/simulation%physics%h
  end function speed_limit

  !> [kg]. Collective.
  real(dp) function total_mass(simulation)
    type(simulation_t), intent(in) :: simulation
    real(dp), allocatable :: mass(:)
    integer :: s, n

    allocate (mass(sum(simulation%decomposition%owned%n)))
    n = 0
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        mass(n + 1:n + owned%n) = owned%mass
        n = n + owned%n
      end associate
    end do
    total_mass = simulation%comm%sum_real(mass)
  end function total_mass

  !> Steps until the grains rest. Collective.
  subroutine run_steps(simulation, log, rest, keep, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    type(rest_t), intent(inout) :: rest
    !> whether the state is one to be written
    logical, intent(out) :: keep
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: figures
    real(dp) :: start
    logical :: ends

    start = MPI_Wtime()
    keep = .not. allocated(error)
    ends = allocated(error)
    do while (.not. ends)
      if (rest%compacted) call press(simulation, rest%imbalance < imbalance_damped)
      call simulation%advance(figures, error)
      if (allocated(error)) exit
      call rest%judge(simulation, figures)
      ends = rest%reached() .or. simulation%step >= simulation%config%sample%max_steps
      if (figures%solve%status /= solve_converged) call judge_failure(simulation, figures, ends, keep)
      if (mod(simulation%step, steps_a_line) == 0 .or. ends) then
        call log%write_step(simulation, figures, MPI_Wtime() - start, error)
        start = MPI_Wtime()
      end if
      call simulation%comm%agree(error)
      ends = ends .or. allocated(error)
    end do
    if (allocated(error)) keep = .false.
  end subroutine run_steps

  !> What a solve that failed leads to, as on_failure says. A step that diverged is never kept.
  subroutine judge_failure(simulation, figures, ends, keep)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    logical, intent(inout) :: ends, keep

    associate (choice => simulation%config%solver%on_failure)
      ends = ends .or. choice /= "continue" .or. figures%solve%status == solve_diverged
      keep = choice /= "discard" .and. figures%solve%status /= solve_diverged
    end associate
  end subroutine judge_failure

  !> At rest means a velocity of 0.
  subroutine stop_grains(simulation)
    type(simulation_t), intent(inout) :: simulation
    integer :: s

    do s = 1, size(simulation%decomposition%owned)
      simulation%decomposition%owned(s)%velocity(:, :) = 0.0_dp
    end do
  end subroutine stop_grains

  !> What the sample is like. Collective.
  subroutine write_summary(simulation, log, rest, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    type(rest_t), intent(in) :: rest
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: fraction, points
    integer :: b

    fraction = ""
    points = ""
    if (simulation%effects%shapes) points = " ("//fixed(contacts_per_grain(simulation), 3)//" points of contact a grain)"
    if (simulation%config%sample%container == "box") fraction = ", solid fraction "//fixed(solid_fraction(simulation), 4)
    call log%line("sample      "//to_text(simulation%n_grains)//" grains"//fraction//", coordination "// &
      & fixed(carrying_neighbours(simulation%problem, simulation%halo, simulation%n_grains), 3)//points//", largest overlap "// &
      & fixed(rest%overlap/simulation%decomposition%rule%mean_radius, 4)//" mean radii"// &
      & trim(merge(" of rigid contacts", "                  ", simulation%physics%laws%yields))//", "// &
      & to_text(simulation%step)//" steps", error)
    if (simulation%left > 0) call log%line("warning     *** "//counted(simulation%left, "grain")//" left through outlets", error)
    call write_size(simulation, log, error)
    if (simulation%config%sample%preparation == "compacted") then
      do b = 1, simulation%n_walls
        call log%line("pressure    "//fixed(rest%pressure(b)/simulation%config%sample%pressure, 4)// &
          & " of what was asked for on "//simulation%decomposition%boundaries(b)%name, error)
      end do
    end if
    if (rest%failed > 0) call log%line("warning     *** "//to_text(rest%failed)//" of the solves did NOT reach the tolerance", &
      & error)
  end subroutine write_summary

  !> How large the sample is along each axis, also in mean diameters: a loose box that equal pressures compact may become narrow.
  !> Collective.
  subroutine write_size(simulation, log, error)
    type(simulation_t), intent(in) :: simulation
    type(run_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(inout) :: error
    real(dp), dimension(simulation%decomposition%nd) :: low, high, length
    character(len=:), allocatable :: sizes, diameters
    integer :: d

    call find_extent(simulation%decomposition, .false., low, high, length)
    sizes = ""
    diameters = ""
    do d = 1, size(length)
      if (d > 1) sizes = sizes//" x "
      if (d > 1) diameters = diameters//" x "
      sizes = sizes//to_text(length(d), 4)
      diameters = diameters//fixed(0.5_dp*length(d)/simulation%decomposition%rule%mean_radius, 1)
    end do
    call log%line("size        "//sizes//" m, "//diameters//" mean diameters", error)
  end subroutine write_size

  !> A number with so many digits after the point.
  pure function fixed(x, digits) result(text)
    real(dp), intent(in) :: x
    integer, intent(in) :: digits
    character(len=:), allocatable :: text
    character(len=40) :: buffer
    character(len=8) :: format

    write (format, "('(f0.', i0, ')')") digits
    write (buffer, format) x
    text = trim(buffer)
    if (index(text, ".") == 1) text = "0"//text
  end function fixed

  !> Share of the space that the grains fill: of the box where it is closed, else of the box up to twice the height of
  !> their centre of mass, which is the top of a sample that is as dense everywhere. Collective.
  real(dp) function solid_fraction(simulation)
    type(simulation_t), intent(in) :: simulation
    real(dp), allocatable :: volume(:), moment(:)
    real(dp) :: floor
    integer :: s, k, n, nd

    associate (decomposition => simulation%decomposition)
      nd = decomposition%nd
      allocate (volume(sum(decomposition%owned%n)), moment(sum(decomposition%owned%n)))
      floor = decomposition%boundaries(1)%surface%point(nd)
      n = 0
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          do k = 1, owned%n
            n = n + 1
            volume(n) = simulation%decomposition%figures%volume_of(owned, k)
            moment(n) = volume(n)*(owned%position(nd, k) - floor)
          end do
        end associate
      end do
    end associate
    ! the first plane is the floor, where there is one
    solid_fraction = simulation%comm%sum_real(volume)/(facing_area(simulation%decomposition, 1)*height())

  contains

    !> Of the space above the first plane. Collective.
    real(dp) function height()
      integer :: d, k

      associate (boundaries => simulation%decomposition%boundaries)
        d = maxloc(abs(boundaries(1)%surface%axis), dim=1)
        height = 0.0_dp
        do k = 1, simulation%n_walls
          if (boundaries(k)%surface%axis(d) < 0.0_dp) height = boundaries(k)%surface%point(d) - boundaries(1)%surface%point(d)
        end do
        if (height > 0.0_dp) return
        height = 2.0_dp*simulation%comm%sum_real(moment)/simulation%comm%sum_real(volume)
      end associate
    end function height

  end function solid_fraction

  !> Mean number of points of contact of a grain that bear an impulse. Collective.
  real(dp) function contacts_per_grain(simulation)
    type(simulation_t), intent(in) :: simulation
    integer(i8) :: ends
    integer :: s, c

    ends = 0
    do s = 1, size(simulation%problem%sub)
      associate (sub => simulation%problem%sub(s))
        do c = 1, sub%n_contacts
          if (sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) ends = ends + count(sub%pair(:, c) <= sub%n_grains)
        end do
      end associate
    end do
    contacts_per_grain = real(simulation%comm%total(ends), dp)/real(simulation%n_grains, dp)
  end function contacts_per_grain

  !> The last word: is the sample at rest, and where is it.
  subroutine write_verdict(simulation, log, rest, kept, error)
    type(simulation_t), intent(in) :: simulation
    type(run_log_t), intent(inout) :: log
    type(rest_t), intent(in) :: rest
    logical, intent(in) :: kept
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    text = "finished    at rest after "//to_text(simulation%step)//" steps"
    if (.not. rest%reached()) text = "finished    *** NOT AT REST after "//to_text(simulation%step)//" steps: energy "// &
      & to_text(rest%energy, 3)//" of a rest_tolerance of "//to_text(simulation%config%sample%rest_tolerance, 3)// &
      & ", loads out of balance by "//to_text(100.0_dp*rest%imbalance, 3)//" %"
    if (kept) then
      text = text//"; written to "//trim(simulation%config%sample%file)
    else
      text = text//"; not written"
    end if
    call log%line(text, error)
  end subroutine write_verdict

end module gravier_sample_preparation
