!> The table of contacts: keys of both ends, and the fields of contacts whose geometry is known and whose impulses are invented, in
!> 2D and 3D, with and without friction, rolling and attractions, across a period and in two subdomains.
program test_contact_collector
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_field_list, only: field_t, field_list_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_contact_collector, only: collect_contacts, idle, sticking, sliding
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> step [s]; of places and gaps, which are a few differences of numbers of the order of one [m]
  real(dp), parameter :: h = 0.25_dp, rounding = 1.0e-14_dp
  character(len=16), parameter :: all_fields(8) = [character(len=16) :: "normal", "gap", "impulse", "moment", "normal_force", &
    & "tangential_force", "status", "points"]
  character(len=*), parameter :: disks = "id,radius,mass,group,x,y,vx,vy,omega", spheres = "id,radius,mass,x,y,z,vx,vy,vz,wx,wy,wz"
  character(len=6), parameter :: status_alone(1) = ["status"], points_alone(1) = ["points"]
  !> two disks that nearly touch, the second of which overlaps with a third one and with a floor; the third one is glued
  character(len=40), parameter :: three_disks(3) = [character(len=40) :: "8,0.1,1,0,0,0.5,0,0,0", "5,0.2,1,0,0,0.15,0,0,0", &
    & "30,0.1,1,1,0.28,0.15,0,0,0"]
  character(len=40), parameter :: two_spheres(2) = [character(len=40) :: "1,0.1,1,0,0,0,0,0,0,0,0,0", &
    & "2,0.3,1,0,0,0.39,0,0,0,0,0,0"]
  character(len=*), parameter :: floor_and_group = "&boundary shape = 'plane', point = 0, -0.04, normal = 0, 1 /"//newline// &
    & "&boundary shape = 'grains', group = 1 /"//newline
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_disks()
  call test_status()
  call test_attraction()
  call test_rolling_disks()
  call test_rolling_spheres()
  call test_frictionless_spheres()
  call test_period()
  call test_subdomains()
  call test_nothing()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> The contacts of the first step of a scene of grains from a file, which rest.
  subroutine make(header, rows, groups, simulation)
    character(len=*), intent(in) :: header, rows(:)
    !> the groups of the input, from the keys of &scene on
    character(len=*), intent(in) :: groups
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t) :: figures
    type(config_t) :: config
    type(error_t), allocatable :: error
    integer :: unit, k

    open (newunit=unit, file="bodies.csv", action="write", status="replace")
    write (unit, "(a)") header
    do k = 1, size(rows)
      write (unit, "(a)") trim(rows(k))
    end do
    close (unit)
    call parse_config("case", "&scene bodies = 'file', bodies_file = 'bodies.csv', start_overlap = 1, gravity = 3*0, "// &
      & "alert_distance = 0.1, overlap_projection = F, "//groups//newline//"&time step = 0.25, steps = 1 /"//newline// &
      & "&solver method = 'nscdd', warm_start = F /", config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    call check(.not. allocated(error), "the scene is made")
    if (allocated(error)) then
      print "(a)", error%message
      call finish_checks()
    end if
    call simulation%assemble(figures)
  end subroutine make

  !> A field of a table, which it must have, with its unit, and whether it is a number an item.
  type(field_t) function field_of(table, name, unit, scalar) result(field)
    type(field_list_t), intent(in) :: table
    character(len=*), intent(in) :: name, unit
    logical, intent(in) :: scalar

    call check(table%place(name) > 0, "field "//name)
    if (table%place(name) == 0) call finish_checks()
    field = table%field(table%place(name))
    call check_equal(field%unit, unit, "unit of "//name)
    call check(field%scalar .eqv. scalar, "one number or a row: "//name)
  end function field_of

  !> Place in a table of the contact between two identifiers.
  integer function item_of(table, a, b) result(item)
    type(field_list_t), intent(in) :: table
    integer, intent(in) :: a, b

    do item = table%n_items(), 1, -1
      if (all(table%key(:, item) == int(a, i8) .or. table%key(:, item) == int(b, i8))) return
    end do
    call check(.false., "two bodies have a contact")
    call finish_checks()
  end function item_of

  subroutine check_vector(found, expected, tolerance, name)
    real(dp), intent(in) :: found(:), expected(:)
    real(dp), intent(in) :: tolerance
    character(len=*), intent(in) :: name
    integer :: d

    call check_equal(size(found), size(expected), "components: "//name)
    do d = 1, min(size(found), size(expected))
      call check_close(found(d), expected(d), tolerance, name)
    end do
  end subroutine check_vector

  !> Set the impulses of contact `c` of the table, which is contact c of the only subdomain.
  subroutine invent(simulation, c, impulse)
    type(simulation_t), intent(inout) :: simulation
    integer, intent(in) :: c
    real(dp), intent(in) :: impulse(:)
    simulation%problem%sub(1)%impulse(lane_of(c), :, block_of(c)) = impulse
  end subroutine invent

  !> Disks with friction: pairs of grains, a grain on a boundary, a grain on a glued one.
  subroutine test_disks()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: normal, gap, impulse, pushing, dragging, points
    real(dp) :: side
    integer :: pair, glued, ground, floor_id

    call make(disks, three_disks, "friction = 0.5 /"//newline//floor_and_group, simulation)
    floor_id = int(simulation%decomposition%boundaries(1)%id)
    call collect_contacts(simulation, all_fields, table)
    call check_equal(table%name, "contacts", "name of the table")
    call check_equal(trim(table%key_name(1))//" "//trim(table%key_name(2)), "candidate antagonist", "names of the keys")
    call check(.not. table%everywhere, "each rank has its own")
    call check_equal(table%n_items(), 3, "contacts")
    call check_equal(table%n_fields, 7, "all fields but the moment")
    call check_equal(table%place("moment"), 0, "without rolling there is no moment")
    pair = item_of(table, 5, 8)
    glued = item_of(table, 5, 30)
    ground = item_of(table, 5, floor_id)
    call check_equal(table%key(2, ground), int(floor_id, i8), "a boundary is the antagonist")
    ! the place in the table is the place in the problem
    call invent(simulation, pair, [3.0_dp, -4.0_dp])
    call invent(simulation, glued, [0.0_dp, 0.0_dp])
    call invent(simulation, ground, [5.0_dp, 0.5_dp])
    call collect_contacts(simulation, all_fields, table)
    normal = field_of(table, "normal", "", .false.)
    gap = field_of(table, "gap", "m", .true.)
    impulse = field_of(table, "impulse", "N s", .false.)
    pushing = field_of(table, "normal_force", "N", .true.)
    dragging = field_of(table, "tangential_force", "N", .true.)
    points = field_of(table, "points", "m", .false.)
    call check_vector(normal%value(:, ground), [0.0_dp, 1.0_dp], rounding, "normal of the floor")
    call check_close(gap%value(1, ground), -0.01_dp, rounding, "overlap with the floor")
    call check_close(gap%value(1, pair), 0.05_dp, rounding, "gap of two disks")
    call check_close(gap%value(1, glued), -0.02_dp, rounding, "overlap with a glued disk")
    call check_vector(impulse%value(:, pair), [3.0_dp, -4.0_dp], 0.0_dp, "impulse of two disks")
    call check_vector(impulse%value(:, ground), [5.0_dp, 0.5_dp], 0.0_dp, "impulse of the floor")
    call check_close(pushing%value(1, pair), 3.0_dp/h, 0.0_dp, "normal force of two disks")
    call check_close(pushing%value(1, glued), 0.0_dp, 0.0_dp, "no normal force")
    call check_close(dragging%value(1, pair), 4.0_dp/h, 0.0_dp, "size of the tangential force of two disks")
    call check_close(dragging%value(1, ground), 0.5_dp/h, 0.0_dp, "tangential force of the floor")
    ! the normal points to the candidate, which may be either
    side = merge(1.0_dp, -1.0_dp, table%key(1, pair) == 8_i8)
    call check_close(normal%value(1, pair), 0.0_dp, rounding, "normal of two disks along x")
    call check_close(normal%value(2, pair), side, rounding, "normal of two disks along y")
    call check_close(points%value(2, pair), merge(0.5_dp, 0.15_dp, side > 0.0_dp), rounding, "from the centre of the candidate")
    call check_close(points%value(5, pair), merge(0.15_dp, 0.5_dp, side > 0.0_dp), rounding, "to that of the antagonist")
    side = merge(1.0_dp, -1.0_dp, table%key(1, glued) == 30_i8)
    call check_close(normal%value(1, glued), side, rounding, "normal at a glued disk")
    call check_vector(points%value(1:3, ground), [0.0_dp, 0.15_dp, 0.0_dp], rounding, "from a disk, in the plane z = 0")
    call check_vector(points%value(4:6, ground), [0.0_dp, -0.04_dp, 0.0_dp], rounding, "to the floor")
    call simulation%free()
  end subroutine test_disks

  !> A contact sticks below the cone, and slides on it but for a millionth; without a force it does neither.
  subroutine test_status()
    type(simulation_t) :: simulation

    call make(disks, three_disks, "friction = 0.5, wall_friction = 0 /"//newline//floor_and_group, simulation)
    call expect_status(simulation, 5, 8, 0.0_dp, 0.0_dp, idle, "no force")
    call expect_status(simulation, 5, 8, 2.0_dp, 0.0_dp, sticking, "a normal force")
    call expect_status(simulation, 5, 8, 2.0_dp, -0.999_dp, sticking, "nearly on the cone")
    call expect_status(simulation, 5, 8, 2.0_dp, 1.0_dp - 2.0e-6_dp, sticking, "two millionths below the cone")
    call expect_status(simulation, 5, 8, 2.0_dp, 1.0_dp - 0.5e-6_dp, sliding, "half a millionth below the cone")
    call expect_status(simulation, 5, 8, 2.0_dp, -1.0_dp, sliding, "on the cone")
    call expect_status(simulation, 5, int(simulation%decomposition%boundaries(1)%id), 2.0_dp, 0.0_dp, sliding, &
      & "a floor without friction")
    call simulation%free()
  end subroutine test_status

  !> What the contact of two bodies does under an impulse.
  subroutine expect_status(simulation, a, b, push, drag, expected, name)
    type(simulation_t), intent(inout) :: simulation
    integer, intent(in) :: a, b
    real(dp), intent(in) :: push, drag
    integer, intent(in) :: expected
    character(len=*), intent(in) :: name
    type(field_list_t) :: table
    type(field_t) :: status
    integer :: c

    call collect_contacts(simulation, status_alone, table)
    c = item_of(table, a, b)
    simulation%problem%sub(1)%impulse(lane_of(c), 1, block_of(c)) = push
    simulation%problem%sub(1)%impulse(lane_of(c), 2, block_of(c)) = drag
    call collect_contacts(simulation, status_alone, table)
    status = field_of(table, "status", "", .true.)
    call check_equal(status%whole(1, c), int(expected, i8), "status: "//name)
  end subroutine expect_status

  !> An attraction F is no part of what the solve calls the impulse: the contact has r_n - h F, and its cone is that of r_n.
  subroutine test_attraction()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: impulse, pushing, status
    integer :: pair

    call make(disks, three_disks, "friction = 0.5 /"//newline//"&material name = 'sticky' /"//newline// &
      & "&law materials = 'sticky', kind = 'adhesive', adhesion = 8.0, adhesion_range = 0.06, friction = 0.5 /"//newline// &
      & floor_and_group, simulation)
    call collect_contacts(simulation, all_fields, table)
    pair = item_of(table, 5, 8)
    call invent(simulation, pair, [1.5_dp, 0.5_dp])
    call collect_contacts(simulation, all_fields, table)
    impulse = field_of(table, "impulse", "N s", .false.)
    pushing = field_of(table, "normal_force", "N", .true.)
    status = field_of(table, "status", "", .true.)
    call check_vector(impulse%value(:, pair), [-0.5_dp, 0.5_dp], 0.0_dp, "impulse under an attraction")
    call check_close(pushing%value(1, pair), -2.0_dp, 0.0_dp, "a tension")
    call check_equal(status%whole(1, pair), int(sticking, i8), "the attraction holds")
    call simulation%free()
  end subroutine test_attraction

  !> The moment about the axis of disks is R* times the third component; between a disk and a boundary R* is its radius.
  subroutine test_rolling_disks()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: moment, impulse
    integer :: pair, ground

    call make(disks, three_disks, "friction = 0.5, rolling_friction = 0.1 /"//newline//floor_and_group, simulation)
    call collect_contacts(simulation, all_fields, table)
    pair = item_of(table, 5, 8)
    ground = item_of(table, 5, int(simulation%decomposition%boundaries(1)%id))
    call invent(simulation, pair, [3.0_dp, -4.0_dp, 6.0_dp])
    call invent(simulation, ground, [1.0_dp, 2.0_dp, -7.0_dp])
    call collect_contacts(simulation, all_fields, table)
    moment = field_of(table, "moment", "N m s", .false.)
    impulse = field_of(table, "impulse", "N s", .false.)
    call check_equal(moment%components(), 1, "components of the moment of disks")
    call check_close(moment%value(1, pair), 6.0_dp*(0.1_dp*0.2_dp)/(0.1_dp + 0.2_dp), rounding, "moment of two disks")
    call check_close(moment%value(1, ground), -7.0_dp*0.2_dp, rounding, "moment of a disk and a floor")
    call check_vector(impulse%value(:, pair), [3.0_dp, -4.0_dp], 0.0_dp, "an impulse has no moment in it")
    call simulation%free()
  end subroutine test_rolling_disks

  !> A solve has the moment of spheres about t, s, n, the table has it about n, t, s.
  subroutine test_rolling_spheres()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: moment, impulse, dragging, points, normal
    real(dp), parameter :: radius = 0.1_dp*0.3_dp/(0.1_dp + 0.3_dp)

    call make(spheres, two_spheres, "dimension = 3, friction = 0.5, rolling_friction = 0.1, pivoting_friction = 0.1 /", simulation)
    call invent(simulation, 1, [10.0_dp, 3.0_dp, -4.0_dp, 20.0_dp, 30.0_dp, 40.0_dp])
    call collect_contacts(simulation, all_fields, table)
    call check_equal(table%n_items(), 1, "one contact")
    call check_equal(table%n_fields, 8, "all fields")
    moment = field_of(table, "moment", "N m s", .false.)
    impulse = field_of(table, "impulse", "N s", .false.)
    dragging = field_of(table, "tangential_force", "N", .true.)
    points = field_of(table, "points", "m", .false.)
    normal = field_of(table, "normal", "", .false.)
    call check_vector(moment%value(:, 1), [radius*40.0_dp, radius*20.0_dp, radius*30.0_dp], rounding, "moment of two spheres")
    call check_vector(impulse%value(:, 1), [10.0_dp, 3.0_dp, -4.0_dp], 0.0_dp, "impulse of two spheres")
    call check_close(dragging%value(1, 1), 5.0_dp/h, rounding, "both tangents count")
    if (table%key(1, 1) == 2_i8) then
      call check_vector(normal%value(:, 1), [0.0_dp, 0.0_dp, 1.0_dp], rounding, "normal of two spheres")
      call check_vector(points%value(:, 1), [0.0_dp, 0.0_dp, 0.39_dp, 0.0_dp, 0.0_dp, 0.0_dp], rounding, "down to the first")
    else
      call check_vector(normal%value(:, 1), [0.0_dp, 0.0_dp, -1.0_dp], rounding, "normal of two spheres")
      call check_vector(points%value(:, 1), [0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.39_dp], rounding, "up to the second")
    end if
    call simulation%free()
  end subroutine test_rolling_spheres

  !> Without friction an impulse has no tangential components, yet the table has them; what carries slides.
  subroutine test_frictionless_spheres()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: impulse, dragging, status

    call make(spheres, two_spheres, "dimension = 3, friction = 0 /", simulation)
    call invent(simulation, 1, [10.0_dp])
    call collect_contacts(simulation, all_fields, table)
    impulse = field_of(table, "impulse", "N s", .false.)
    dragging = field_of(table, "tangential_force", "N", .true.)
    status = field_of(table, "status", "", .true.)
    call check_vector(impulse%value(:, 1), [10.0_dp, 0.0_dp, 0.0_dp], 0.0_dp, "impulse without friction")
    call check_close(dragging%value(1, 1), 0.0_dp, 0.0_dp, "no tangential force")
    call check_equal(status%whole(1, 1), int(sliding, i8), "what carries without friction slides")
    call invent(simulation, 1, [0.0_dp])
    call collect_contacts(simulation, all_fields, table)
    status = field_of(table, "status", "", .true.)
    call check_equal(status%whole(1, 1), int(idle, i8), "what does not carry is idle")
    call simulation%free()
  end subroutine test_frictionless_spheres

  !> Two disks on both sides of a period: the line from the candidate ends at the image of the antagonist that it touches.
  subroutine test_period()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: points
    character(len=40), parameter :: rows(2) = [character(len=40) :: "1,0.1,1,0,0.1,0,0,0,0", "2,0.1,1,0,3.9,0,0,0,0"]

    call make(disks, rows, "friction = 0.5, period = 4, 0 /", simulation)
    call collect_contacts(simulation, points_alone, table)
    call check_equal(table%n_fields, 1, "one field is asked for")
    call check_equal(table%n_items(), 1, "a contact across the period")
    points = field_of(table, "points", "m", .false.)
    if (table%key(1, 1) == 1_i8) then
      call check_vector(points%value(:, 1), [0.1_dp, 0.0_dp, 0.0_dp, -0.1_dp, 0.0_dp, 0.0_dp], rounding, "to the image on the left")
    else
      call check_vector(points%value(:, 1), [3.9_dp, 0.0_dp, 0.0_dp, 4.1_dp, 0.0_dp, 0.0_dp], rounding, "to the image on the right")
    end if
    call simulation%free()
  end subroutine test_period

  !> Contacts of two subdomains stand one after the other, in the order of their subproblems, keys and fields alike.
  subroutine test_subdomains()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    type(field_t) :: gap, impulse, status
    character(len=40), parameter :: rows(5) = [character(len=40) :: "1,0.1,1,0,0,0,0,0,0", "2,0.1,1,0,0.201,0,0,0,0", &
      & "3,0.1,1,0,0.403,0,0,0,0", "4,0.1,1,0,3,0,0,0,0", "5,0.1,1,0,3.204,0,0,0,0"]
    integer :: s, c, n, left

    call make(disks, rows, "friction = 0.5 /"//newline//"&decomposition grid = 2, 1 /", simulation)
    n = 0
    do s = 1, 2
      do c = 1, simulation%problem%sub(s)%n_contacts
        n = n + 1
        simulation%problem%sub(s)%impulse(lane_of(c), 1, block_of(c)) = n
        simulation%problem%sub(s)%impulse(lane_of(c), 2, block_of(c)) = 0.0_dp
      end do
    end do
    call check(all(simulation%problem%sub%n_contacts > 0), "both subdomains have contacts")
    call collect_contacts(simulation, all_fields, table)
    call check_equal(table%n_items(), 3, "contacts of both")
    gap = field_of(table, "gap", "m", .true.)
    impulse = field_of(table, "impulse", "N s", .false.)
    status = field_of(table, "status", "", .true.)
    do c = 1, 3
      call check_close(impulse%value(1, c), real(c, dp), 0.0_dp, "impulses in the order of the subdomains")
      ! the gaps are made so that they tell the pair
      left = int(minval(table%key(:, c)))
      call check_equal(abs(table%key(1, c) - table%key(2, c)), 1_i8, "neighbours touch")
      call check_close(gap%value(1, c), 1.0e-3_dp*left, rounding, "gaps go with their keys")
      call check_equal(status%whole(1, c), int(sticking, i8), "status in both subdomains")
    end do
    call simulation%free()
  end subroutine test_subdomains

  !> Keys alone, and a scene without contacts.
  subroutine test_nothing()
    type(simulation_t) :: simulation
    type(field_list_t) :: table
    character(len=1), parameter :: no_fields(0) = ""
    character(len=40), parameter :: alone(1) = [character(len=40) :: "1,0.1,1,0,0,5,0,0,0"]

    call make(disks, three_disks, "friction = 0.5 /"//newline//floor_and_group, simulation)
    call collect_contacts(simulation, no_fields, table)
    call check_equal(table%n_items(), 3, "contacts without fields")
    call check_equal(table%n_fields, 0, "no field")
    call simulation%free()
    call make(disks, alone, "friction = 0.5 /", simulation)
    call collect_contacts(simulation, all_fields, table)
    call check_equal(table%n_items(), 0, "no contact")
    call check_equal(table%n_fields, 7, "and yet all fields")
    call simulation%free()
  end subroutine test_nothing

end program test_contact_collector
