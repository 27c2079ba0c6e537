!> Tables of bodies: grains of several subdomains with the fields of files, boundaries of every kind, and the bodies of a contact
!> problem with their masses, loads and velocities.
program test_body_collector
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_field_list, only: field_t, field_list_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_body_collector, only: collect_bodies, collect_boundaries, collect_problem_bodies
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> boundaries in 2D: a moving plane, a bar that turns about its end, an outlet, a group of grains that turns about a pivot
  character(len=*), parameter :: boundaries_2d = &
    & "&boundary shape = 'plane', point = 1, -0.1, normal = 0, 2, velocity = 0.25, 0.5 /"//newline// &
    & "&boundary shape = 'segment', point = -1, 5, end = 1, 6, rotation = 3 /"//newline// &
    & "&boundary shape = 'outlet', point = 0, -7, normal = 0, 1 /"//newline// &
    & "&boundary shape = 'grains', group = 1, pivot = 2, 4, rotation = -2 /"//newline
  !> in 3D: a wall that turns and slides, and a drum
  character(len=*), parameter :: boundaries_3d = &
    & "&boundary shape = 'plane', point = 1, 2, -3, normal = 0, 0, 1, velocity = 1, 2, 3, rotation = 0, 0, 6 /"//newline// &
    & "&boundary shape = 'cylinder', point = 0, 0, 9, axis = 0, 1, 0, radius = 20, rotation = 0, 5, 0 /"//newline
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_grains()
  call test_periodic_grains()
  call test_boundaries()
  call test_boundaries_in_space()
  call test_problem_bodies()
  call test_frictionless_bodies()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A scene of grains from a file, in two subdomains along x.
  subroutine make(header, rows, groups, simulation)
    !> columns, and rows with blanks at their ends
    character(len=*), intent(in) :: header, rows(:)
    !> the groups of the input, from the keys of &scene on
    character(len=*), intent(in) :: groups
    type(simulation_t), intent(inout) :: simulation
    type(config_t) :: config
    type(error_t), allocatable :: error
    integer :: unit, k

    open (newunit=unit, file="bodies.csv", action="write", status="replace")
    write (unit, "(a)") header
    do k = 1, size(rows)
      write (unit, "(a)") trim(rows(k))
    end do
    close (unit)
    call parse_config("case", "&scene bodies = 'file', bodies_file = 'bodies.csv', start_overlap = 1, "//groups//newline// &
      & "&time step = 0.01, steps = 1 /"//newline//"&solver method = 'nscdd' /", config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    call check(.not. allocated(error), "the scene is made")
    if (.not. allocated(error)) return
    print "(a)", error%message
    call finish_checks()
  end subroutine make

  !> A scene of five disks, two of which are glued to each other.
  subroutine make_disks(keys, groups, simulation)
    !> of &scene; the groups behind it
    character(len=*), intent(in) :: keys, groups
    type(simulation_t), intent(inout) :: simulation
    character(len=48), parameter :: rows(5) = [character(len=48) :: "40,0.1,2,0,0,0,1,2,3", "7,0.2,3,0,5,1,-1,0,0.5", &
      & "3,0.1,4,0,0.2,0,0,0,0", "99,0.1,5,1,3,3,0,0,0", "5,0.1,6,1,3,3.2,0,0,0"]

    call make("id,radius,mass,group,x,y,vx,vy,omega", rows, keys//" /"//newline//groups//"&decomposition grid = 2, 1 /", &
      & simulation)
  end subroutine make_disks

  !> A field of a table, which it must have, with its unit.
  type(field_t) function field_of(table, name, unit) result(field)
    type(field_list_t), intent(in) :: table
    character(len=*), intent(in) :: name, unit

    call check(table%place(name) > 0, "field "//name)
    if (table%place(name) == 0) call finish_checks()
    field = table%field(table%place(name))
    call check_equal(field%unit, unit, "unit of "//name)
  end function field_of

  !> Place of an item by its first key.
  integer function item_of(table, key) result(item)
    type(field_list_t), intent(in) :: table
    integer, intent(in) :: key

    item = findloc(table%key(1, :), int(key, i8), dim=1)
    call check(item > 0, "an item has the key")
    if (item == 0) call finish_checks()
  end function item_of

  subroutine check_vector(found, expected, name)
    real(dp), intent(in) :: found(:), expected(:)
    character(len=*), intent(in) :: name
    integer :: d

    call check_equal(size(found), size(expected), "components: "//name)
    do d = 1, min(size(found), size(expected))
      call check_close(found(d), expected(d), 0.0_dp, name)
    end do
  end subroutine check_vector

  !> The grains of both subdomains stand one after the other, each with its own fields, glued ones too.
  subroutine test_grains()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: radius, mass, material, position, velocity, boundary
    integer :: k

    call make_disks("friction = 0.5, gravity = 0, 0", boundaries_2d, simulation)
    call check_equal(size(simulation%decomposition%owned), 2, "subdomains")
    call check(all(simulation%decomposition%owned%n > 0), "both have grains")
    call collect_bodies(simulation, table)
    call check_equal(table%name, "bodies", "name of the table")
    call check_equal(trim(table%key_name(1)), "id", "name of the key")
    call check_equal(table%n_items(), 5, "grains")
    call check(.not. table%everywhere, "each rank has its own")
    radius = field_of(table, "radius", "m")
    mass = field_of(table, "mass", "kg")
    material = field_of(table, "material", "")
    position = field_of(table, "position", "m")
    velocity = field_of(table, "velocity", "m/s, rad/s")
    call check_equal(table%place("image"), 0, "no image without a period")
    call check_equal(table%place("glued"), 0, "what is not for files is not there")
    boundary = field_of(table, "boundary", "")
    call check_equal(boundary%whole(1, item_of(table, 40)), 0_i8, "a free grain is of no boundary")
    do k = 5, 99, 94
      call check_equal(boundary%whole(1, item_of(table, k)), simulation%decomposition%boundaries(4)%id, "a glued grain")
    end do
    k = item_of(table, 40)
    call check_vector(position%value(:, k), [0.0_dp, 0.0_dp], "place of grain 40")
    call check_vector(velocity%value(:, k), [1.0_dp, 2.0_dp, 3.0_dp], "velocity of grain 40")
    call check_close(mass%value(1, k), 2.0_dp, 0.0_dp, "mass of grain 40")
    k = item_of(table, 7)
    call check_vector(position%value(:, k), [5.0_dp, 1.0_dp], "place of grain 7")
    call check_vector(velocity%value(:, k), [-1.0_dp, 0.0_dp, 0.5_dp], "velocity of grain 7")
    call check_close(radius%value(1, k), 0.2_dp, 0.0_dp, "radius of grain 7")
    call check_equal(material%whole(1, k), 1_i8, "material of grain 7")
    k = item_of(table, 5)
    call check_vector(position%value(:, k), [3.0_dp, 3.2_dp], "place of a glued grain")
    call check_close(mass%value(1, k), 6.0_dp, 0.0_dp, "mass of a glued grain")
    call check_equal(table%key(1, 1), simulation%decomposition%owned(1)%id(1), "the first subdomain comes first")
    call simulation%free()
  end subroutine test_grains

  !> In a periodic scene grains have an image.
  subroutine test_periodic_grains()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: image

    call make_disks("friction = 0.5, gravity = 0, 0, period = 8, 0", "&boundary shape = 'grains', group = 1 /"//newline, simulation)
    simulation%decomposition%owned(1)%image(1, 1) = -3
    simulation%decomposition%owned(1)%image(2, 1) = 2
    call collect_bodies(simulation, table)
    image = field_of(table, "image", "")
    call check_equal(image%components(), 2, "an image has an entry an axis")
    call check_equal(image%whole(1, 1), -3_i8, "periods along x")
    call check_equal(image%whole(2, 1), 2_i8, "periods along y")
    call simulation%free()
  end subroutine test_periodic_grains

  !> Place, normal, motion and force of boundaries in 2D. Spins are about z. Only planes that grains touch have a normal, and what
  !> the grains do to a boundary is an impulse over the step.
  subroutine test_boundaries()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: position, normal, velocity, force

    call make_disks("friction = 0.5, gravity = 0, 0", boundaries_2d, simulation)
    simulation%boundary_impulses(:, 1) = [0.5_dp, -1.0_dp]
    simulation%boundary_impulses(:, 4) = [0.0_dp, 0.25_dp]
    call prescribe(simulation)
    call collect_boundaries(simulation, table)
    call check_equal(table%name, "boundaries", "name of the table")
    call check_equal(trim(table%key_name(1)), "id", "name of the key")
    call check(table%everywhere, "all ranks have all boundaries")
    call check_equal(table%n_items(), 4, "boundaries")
    call check(all(table%key(1, :) == simulation%decomposition%boundaries%id), "identifiers")
    position = field_of(table, "position", "m")
    normal = field_of(table, "normal", "")
    velocity = field_of(table, "velocity", "m/s, rad/s")
    force = field_of(table, "force", "N")
    call check_vector(position%value(:, 1), [1.0_dp, -0.1_dp], "point of a plane")
    call check_vector(normal%value(:, 1), [0.0_dp, 1.0_dp], "unit normal of a plane")
    call check_vector(velocity%value(:, 1), [0.25_dp, 0.5_dp, 0.0_dp], "velocity of a plane")
    call check_vector(force%value(:, 1), [0.5_dp/0.01_dp, -1.0_dp/0.01_dp], "force on a plane")
    call check_vector(position%value(:, 2), [-1.0_dp, 5.0_dp], "end of a segment")
    call check_vector(normal%value(:, 2), [0.0_dp, 0.0_dp], "a segment has no normal")
    call check_vector(velocity%value(:, 2), [0.0_dp, 0.0_dp, 3.0_dp], "spin of a segment")
    call check_vector(force%value(:, 2), [0.0_dp, 0.0_dp], "no force on a segment")
    call check_vector(normal%value(:, 3), [0.0_dp, 0.0_dp], "an outlet, which nothing touches, has no normal")
    call check_vector(position%value(:, 4), [2.0_dp, 4.0_dp], "glued grains are at their pivot")
    call check_vector(normal%value(:, 4), [0.0_dp, 0.0_dp], "glued grains have no normal")
    call check_vector(velocity%value(:, 4), [0.0_dp, 0.0_dp, -2.0_dp], "spin of glued grains")
    call check_vector(force%value(:, 4), [0.0_dp, 0.25_dp/0.01_dp], "force on glued grains")
    call simulation%free()
  end subroutine test_boundaries

  !> In 3D a spin has three components.
  subroutine test_boundaries_in_space()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: position, normal, velocity
    character(len=32), parameter :: rows(1) = [character(len=32) :: "1,0.1,1,0,0,0,1,2,3,4,5,6"]

    call make("id,radius,mass,x,y,z,vx,vy,vz,wx,wy,wz", rows, &
      & "dimension = 3, friction = 0.5, gravity = 3*0 /"//newline//boundaries_3d, simulation)
    call prescribe(simulation)
    call collect_boundaries(simulation, table)
    position = field_of(table, "position", "m")
    normal = field_of(table, "normal", "")
    velocity = field_of(table, "velocity", "m/s, rad/s")
    call check_vector(position%value(:, 1), [1.0_dp, 2.0_dp, -3.0_dp], "point of a plane in space")
    call check_vector(normal%value(:, 1), [0.0_dp, 0.0_dp, 1.0_dp], "normal of a plane in space")
    call check_vector(velocity%value(:, 1), [1.0_dp, 2.0_dp, 3.0_dp, 0.0_dp, 0.0_dp, 6.0_dp], "velocity, then spin")
    call check_vector(normal%value(:, 2), [0.0_dp, 0.0_dp, 0.0_dp], "a drum has an axis, and no normal")
    call check_vector(velocity%value(:, 2), [0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 5.0_dp, 0.0_dp], "spin of a drum")
    call collect_bodies(simulation, table)
    velocity = field_of(table, "velocity", "m/s, rad/s")
    call check_vector(velocity%value(:, 1), [1.0_dp, 2.0_dp, 3.0_dp, 4.0_dp, 5.0_dp, 6.0_dp], "velocity of a sphere")
    call simulation%free()
  end subroutine test_boundaries_in_space

  !> Give boundaries the velocities of time 0.
  subroutine prescribe(simulation)
    type(simulation_t), intent(inout) :: simulation
    integer :: b

    do b = 1, size(simulation%decomposition%boundaries)
      call simulation%decomposition%boundaries(b)%prescribe(simulation%decomposition%nd, 0.0_dp, simulation%physics%h)
    end do
  end subroutine prescribe

  !> Two disks between the subdomains, on a lid that forces move along y: each subdomain has copies. A load is M v_f; a component
  !> that cannot move has mass 1 and the velocity that is prescribed.
  subroutine test_problem_bodies()
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(field_list_t) :: table
    type(field_t) :: place, mass, load, velocity
    integer :: s, b, n, k
    real(dp) :: invented(3)
    logical :: ordered
    character(len=32), parameter :: rows(3) = [character(len=32) :: "11,0.1,2,-0.1,0,1,0,0", "12,0.1,4,0.1,0,-1,0,8", &
      & "13,0.1,8,0.3,0,0,0,0"]

    call make("id,radius,mass,x,y,vx,vy,omega", rows, "friction = 0.5, gravity = 0, -10 /"//newline// &
      & "&boundary shape = 'plane', point = 0, -0.1, normal = 0, 1, free = F, T, mass = 16, velocity = 0.5, 0, force = 0, 3 /"// &
      & newline//"&decomposition grid = 2, 1 /", simulation)
    call simulation%assemble(figures)
    do s = 1, 2
      do b = 1, simulation%problem%sub(s)%n_columns
        call invent(s, b, simulation%problem%sub(s)%v_global(:, b))
      end do
    end do
    call collect_problem_bodies(simulation%problem, table)
    call check_equal(table%name, "bodies", "name of the table")
    call check_equal(table%n_items(), sum(simulation%problem%sub%n_bodies), "an item a copy")
    call check(table%n_items() > 4, "some bodies have two copies")
    place = field_of(table, "place", "")
    mass = field_of(table, "mass", "kg, kg m^2")
    load = field_of(table, "load", "N s, N m s")
    velocity = field_of(table, "velocity", "m/s, rad/s")
    ordered = .true.
    n = 0
    do s = 1, 2
      do b = 1, simulation%problem%sub(s)%n_bodies
        n = n + 1
        ordered = ordered .and. place%whole(1, n) == 0 .and. place%whole(2, n) == s .and. place%whole(3, n) == b .and. &
          & table%key(1, n) == simulation%problem%sub(s)%id(b)
        call invent(s, b, invented)
        call check_vector(velocity%value(:, n), invented, "velocity of the solve")
      end do
    end do
    call check(ordered, "rank, subdomain and number of each copy")
    ! I = m R^2/2, and v_f = v + h g
    k = item_of(table, 12)
    call check_close(mass%value(1, k), 4.0_dp, 1e-15_dp, "mass of a disk along x")
    call check_close(mass%value(2, k), 4.0_dp, 1e-15_dp, "mass of a disk along y")
    call check_close(mass%value(3, k), 0.02_dp, 1e-15_dp, "inertia of a disk")
    call check_close(load%value(1, k), -4.0_dp, 1e-14_dp, "load of a disk along x")
    call check_close(load%value(2, k), -0.4_dp, 1e-15_dp, "load of a disk along y")
    call check_close(load%value(3, k), 0.16_dp, 1e-15_dp, "angular load of a disk")
    k = item_of(table, int(simulation%decomposition%boundaries(1)%id))
    call check_close(mass%value(1, k), 1.0_dp, 0.0_dp, "what cannot move has mass 1")
    call check_close(mass%value(2, k), 16.0_dp, 1e-14_dp, "mass of a lid")
    call check_close(load%value(1, k), 0.5_dp, 1e-15_dp, "and its velocity for a load")
    call check_close(load%value(2, k), 0.03_dp, 1e-15_dp, "impulse of the force on a lid")
    call simulation%free()
  end subroutine test_problem_bodies

  !> A velocity that tells subdomain and body.
  pure subroutine invent(s, b, velocity)
    integer, intent(in) :: s, b
    real(dp), intent(out) :: velocity(:)

    velocity(1) = 100.0_dp*s + b
    velocity(2) = 0.5_dp*b
    velocity(3) = -0.25_dp*b
  end subroutine invent

  !> Without friction spheres have no spin, and three components each.
  subroutine test_frictionless_bodies()
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(field_list_t) :: table
    type(field_t) :: mass, load
    character(len=32), parameter :: rows(2) = [character(len=32) :: "1,0.1,2,0,0,0,0,0,3", "2,0.1,5,0,0,0.2,0,0,0"]

    call make("id,radius,mass,x,y,z,vx,vy,vz", rows, &
      & "dimension = 3, friction = 0, gravity = 3*0 /", simulation)
    call simulation%assemble(figures)
    call collect_problem_bodies(simulation%problem, table)
    mass = field_of(table, "mass", "kg, kg m^2")
    load = field_of(table, "load", "N s, N m s")
    call check_equal(table%n_items(), 2, "two spheres")
    call check_equal(mass%components(), 3, "no inertia")
    call check_close(mass%value(3, item_of(table, 2)), 5.0_dp, 1e-14_dp, "mass of a sphere along z")
    call check_close(load%value(3, item_of(table, 1)), 6.0_dp, 1e-14_dp, "load of a sphere along z")
    call simulation%free()
  end subroutine test_frictionless_bodies

end program test_body_collector
