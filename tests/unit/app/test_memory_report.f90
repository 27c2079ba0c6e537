!> Bytes of a case: what --check prints of an item is what its arrays take, and what a scene does not have takes none.
program test_memory_report
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_set_t
  use gravier_contact_kernels, only: lanes, n_blocks
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_memory_report, only: memory_report_t, report_memory
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  character(len=*), parameter :: bridges = "&material name = 'wet' / &law materials = 'wet', kind = 'capillary', "// &
    & "capillarity = 1.0, decay_length = 0.01, debonding_distance = 0.02 /"
  !> items of a report
  integer, parameter :: contact = 1, near_pair = 2, body = 3, seen = 4, at_home = 5
  !> bytes of the reals of a spin and of an inertia by dimension
  integer, parameter :: spin(2:3) = [8, 24], inertia = 8
  type(communicator_t), target :: comm
  integer(i8) :: plain(5), other(5)
  integer :: nd

  call start_parallel()
  call comm%init()
  do nd = 2, 3
    ! nothing turns, nothing is kept: places and velocities, radii, masses and whole numbers
    call count_bytes(nd, "friction = 0", "warm_start = .false.", "", plain)
    call check_equal(plain(near_pair), 8_i8, "near pair: candidate and antagonist")
    call check_equal(plain(seen), 8_i8*(2*nd + 3) + 16, "grain seen: identifier, place, velocity, radius, mass, four whole numbers")
    call count_bytes(nd, "friction = 0", "warm_start = .true.", "", other)
    call check_more(0, 8, 0, "warm start keeps a normal impulse")
    call count_bytes(nd, "friction = 0.3", "warm_start = .false.", "", other)
    call check_equal(other(near_pair), plain(near_pair), "near pair with friction and no warm start")
    call check_equal(other(at_home) - plain(at_home), int(spin(nd) + inertia, i8), "grain with friction: spin and inertia")
    call count_bytes(nd, "friction = 0", "warm_start = .true., sleeping = .true.", "", other)
    call check_more(0, 16, 0, "bodies that may sleep have what they bear and have gone, pairs a mark and a place", 32 + 32*nd)
    call count_bytes(nd, "friction = 0", "warm_start = .true., sleeping = .true.", bridges, other)
    call check_more(8, 20, 8*nd, "bridges have a state, and attract", 32 + 32*nd)
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Bytes of each item of a lattice of spheres or disks, which must be those of its arrays.
  subroutine count_bytes(nd, scene, solver, groups, bytes)
    integer, intent(in) :: nd
    character(len=*), intent(in) :: scene, solver, groups
    integer(i8), intent(out) :: bytes(5)
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(memory_report_t) :: report
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=:), allocatable :: lattice
    integer(i8) :: arrays(5)
    integer :: k

    lattice = "lattice_count = 6, 5, gravity = 0, -9.81"
    if (nd == 3) lattice = "lattice_count = 4, 3, 3, gravity = 0, 0, -9.81"
    call parse_config("lattice", "&scene dimension = "//to_text(nd)//", bodies = 'lattice', "//lattice// &
      & ", radius_min = 0.05, radius_max = 0.1, alert_distance = 0.07, overlap_projection = .false., "//scene//" /"//newline// &
      & "&time step = 1.0e-3, steps = 2 / &solver method = 'nlgs', acceleration = 'none', "//solver//" /"//newline//groups, &
      & config, error)
    call check(.not. allocated(error), "configuration")
    call simulation%init(comm, config, error)
    call check(.not. allocated(error), "scene")
    call simulation%assemble(figures)
    call report_memory(simulation, 0.0_dp, report)
    bytes(:) = report%items%bytes
    call check(all(report%items%number > 0), "items of every kind")
    call sum_arrays(simulation, arrays)
    do k = 1, size(bytes)
      call check_equal(bytes(k), arrays(k), scene//", "//solver//": bytes of its arrays, item "//to_text(k))
    end do
    call simulation%free()
  end subroutine count_bytes

  !> How much more than the plain scene the last one has, of each item; of grains seen and owned together nothing by default.
  subroutine check_more(of_contact, of_pair, of_body, name, of_grain)
    integer, intent(in) :: of_contact, of_pair, of_body
    character(len=*), intent(in) :: name
    integer, intent(in), optional :: of_grain
    integer(i8) :: grains
    integer(i8) :: more(5)

    grains = 0
    if (present(of_grain)) grains = of_grain
    more(:) = other - plain
    call check_equal(more(contact), int(of_contact, i8), name//": a contact")
    call check_equal(more(near_pair), int(of_pair, i8), name//": a near pair")
    call check_equal(more(body), int(of_body, i8), name//": a body in contact")
    call check_equal(more(seen) + more(at_home), grains, name//": a grain")
  end subroutine check_more

  !> What the arrays take, over the number of items.
  subroutine sum_arrays(simulation, bytes)
    type(simulation_t), intent(in) :: simulation
    integer(i8), intent(out) :: bytes(5)
    integer :: room

    associate (sub => simulation%problem%sub(1), view => simulation%halo%view(1), &
      & owned => simulation%decomposition%owned(1))
      room = lanes*n_blocks(sub%n_contacts)
      bytes(contact) = (4*size(sub%pair) + 8*size(sub%hot) + 8*size(sub%impulse))/room + &
        & (8*size(sub%gap) + 4*size(sub%source))/sub%n_contacts
      if (allocated(sub%attraction)) bytes(contact) = bytes(contact) + 8*size(sub%attraction)/room
      bytes(near_pair) = (4*size(view%list%candidate) + 4*size(view%list%antagonist) + 4*size(view%list%shift) + &
        & 8*size(view%list%impulse) + 4*size(view%list%state))/view%list%n
      ! made once a body sleeps
      if (view%list%memory%touch_row > 0) bytes(near_pair) = bytes(near_pair) + 4
      bytes(body) = (8*size(sub%id) + 8*size(sub%v_free) + 8*size(sub%velocity) + 8*size(sub%v_global) + 8*size(sub%reaction) + &
        & 8*size(sub%inverse_mass) + 8*size(sub%weight))/sub%n_columns + (4*size(sub%owner) + &
        & 4*size(sub%multiplicity))/sub%n_bodies + (4*size(sub%place) + 8*size(sub%radius))/sub%n_grains
      if (allocated(sub%attraction_load)) bytes(body) = bytes(body) + 8*size(sub%attraction_load)/sub%n_columns
      bytes(seen) = grain_bytes(view%bodies) + (4*size(view%owner) + 4*size(view%origin))/view%bodies%n
      bytes(at_home) = grain_bytes(owned) + 8*(size(simulation%halo%reference(1)%position) + owned%n)/owned%n
    end associate
  end subroutine sum_arrays

  pure integer(i8) function grain_bytes(bodies) result(bytes)
    type(body_set_t), intent(in) :: bodies

    bytes = (8*size(bodies%id) + 8*size(bodies%position) + 8*size(bodies%velocity) + 8*size(bodies%radius) + 8*size(bodies%mass) + &
      & 8*size(bodies%inertia) + 4*size(bodies%glued) + 4*size(bodies%material) + 4*size(bodies%image) + &
      & 4*size(bodies%rest) + 4*size(bodies%stirred) + 8*size(bodies%wakes_at) + 8*size(bodies%held) + &
      & 8*size(bodies%wandered))/bodies%n
  end function grain_bytes

end program test_memory_report
