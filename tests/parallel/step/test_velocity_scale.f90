!> The velocity against which errors of a solve are compared: each of its parts against its formula, the one that rules, the same
!> bits on any number of ranks, and the factor of a velocity under another choice of units.
program test_velocity_scale
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_motion, only: grain_mass
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_test_scenes, only: plane, change_shape
  use gravier_boundary_levers, only: find_levers
  use gravier_physics, only: physics_t
  use gravier_imposed_motion, only: imposed_motion_t, find_imposed, largest_imposed
  use gravier_velocity_scale, only: velocity_scale_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> of the grains, all equal [m], [kg/m^nd]; step [s] and number of steps; acceleration of gravity [m/s^2]
  real(dp), parameter :: radius = 0.0625_dp, density = 100.0_dp, step = 0.25_dp, g = 8.0_dp
  integer, parameter :: steps = 16
  !> sums of some hundred terms of one size
  real(dp), parameter :: rounding = 1.0e-13_dp

  !> Factors of the units of length, time and mass.
  type :: units_t
    real(dp) :: length = 1.0_dp, time = 1.0_dp, mass = 1.0_dp
  end type units_t

  !> What a scene has besides a lattice of equal grains in a box, each close to its neighbours.
  type :: scene_t
    integer :: nd = 2, subdomains = 4
    !> along the last axis, downwards [m/s^2]; on volumes, upwards [N/m^nd]
    real(dp) :: gravity = 0.0_dp, body_force = 0.0_dp
    !> of a lid: pressure [Pa] and velocity along x [m/s]; 0 and 0: there is no lid
    real(dp) :: pressure = 0.0_dp, sliding = 0.0_dp
    !> attraction of all grains [N]; rate of a drum of radius 8 m [rad/s]; velocity that the user gives [m/s]
    real(dp) :: adhesion = 0.0_dp, spin = 0.0_dp, given = 0.0_dp
    !> size of the velocities that the grains have, and of one that they have in common [m/s]
    real(dp) :: motion = 0.0_dp, wind = 0.0_dp
    !> largest component of the forces that a loop applies to grains, another force to each [N]
    real(dp) :: push = 0.0_dp
    !> the box is taken away
    logical :: open = .false.
    type(units_t) :: units
  end type scene_t

  type(communicator_t), target :: comm, alone
  integer :: nd

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  call test_turning_round()
  call test_levers()
  do nd = 2, 3
    call test_loads(nd)
    call test_drives(nd)
    call test_own(nd)
    call test_stress(nd)
    call test_slow_bodies(nd)
    call test_applied(nd)
    call test_given(nd)
    call test_ranks(nd)
    call test_units(nd)
  end do
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()

contains

  !> The scale of the first step of a scene.
  subroutine assemble(who, scene, sim)
    type(communicator_t), target, intent(in) :: who
    type(scene_t), intent(in) :: scene
    type(simulation_t), intent(inout) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    real(dp) :: speed
    integer :: s, k, d

    call parse_config("scene", text_of(scene), config, error)
    call check(.not. allocated(error), "configuration")
    if (allocated(error)) print "(a)", error%message
    call sim%init(who, config, error)
    call check(.not. allocated(error), "scene")
    if (allocated(error)) print "(a)", error%message
    if (scene%open) then
      deallocate (sim%decomposition%boundaries)
      allocate (sim%decomposition%boundaries(0))
    end if
    if (scene%push > 0.0_dp) call sim%take_forces()
    speed = scene%units%length/scene%units%time
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          do d = 1, scene%nd
            owned%velocity(d, k) = scene%motion*speed*(2.0_dp*hash_uniform(5, owned%id(k), d) - 1.0_dp)
          end do
          owned%velocity(1, k) = owned%velocity(1, k) + scene%wind*speed
          if (.not. scene%push > 0.0_dp) cycle
          do d = 1, scene%nd
            owned%force(d, k) = push_on(owned%id(k), d, scene%push)
          end do
        end do
      end associate
    end do
    call sim%assemble(figures)
    call check(figures%contacts > 60, "grains are in contact")
    call check_close(sim%problem%error_scale, sim%velocity_scale%value, 0.0_dp, "the contact problem has the scale")
  end subroutine assemble

  !> Levers of boundaries: across the axis that they turn about, up to the farthest corner, the farthest grain of a plane, the
  !> farthest grain of those that are glued; from the pivot where only a table knows the axis; none of what does not turn. Each rank
  !> has its own grains, the farthest ones are those of the last.
  subroutine test_levers()
    type(velocity_scale_t) :: scale
    type(body_set_t) :: grains
    type(boundary_t) :: boundaries(5)
    real(dp) :: lever(5)
    integer :: b

    do b = 1, 4, 3
      call change_shape("rectangle", boundaries(b))
      boundaries(b)%surface%point(:) = [3.0_dp, 0.0_dp, 7.0_dp]
      boundaries(b)%surface%edge(:, 1) = [0.0_dp, 4.0_dp, 0.0_dp]
      boundaries(b)%surface%edge(:, 2) = [0.0_dp, 0.0_dp, 1.0_dp]
      boundaries(b)%pivot(:) = [0.0_dp, 0.0_dp, 5.0_dp]
    end do
    boundaries(1)%drive%spin(3) = -2.0_dp
    boundaries(2) = plane(2, [0.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 0.0_dp, 1.0_dp])
    boundaries(2)%drive%spin(3) = 1.0_dp
    boundaries(3)%drive%spin(1) = 1.0_dp
    ! vx vy vz, wx wy wz, fx fy fz, pressure
    allocate (boundaries(4)%drive%table%has(10), source=.false.)
    boundaries(4)%drive%table%has(5:6) = .true.
    boundaries(5) = boundaries(2)
    boundaries(5)%drive%spin(:) = 0.0_dp
    call grains%init(body_layout_t(3, 6, 0), 2)
    grains%mass(:) = 1.0_dp
    grains%radius(1) = 0.5_dp
    grains%radius(2) = 0.25_dp
    grains%glued(1) = 0
    grains%glued(2) = 3
    grains%position(:, 1) = [6.0_dp, 8.0_dp, 100.0_dp]
    grains%position(:, 2) = [1.0_dp, 0.0_dp, 2.0_dp]
    call find_levers(grains, boundaries, lever)
    call check_close(lever(2), 10.5_dp, rounding, "lever of a plane, by the grains of one rank")
    if (comm%rank < comm%size - 1) grains%position(:, :) = 0.5_dp*grains%position
    call scale%init(comm, grains, boundaries, 1.0_dp, 0.0_dp)
    call check_close(scale%lever(1), 5.0_dp, rounding, "lever of a rectangle that turns")
    call check_close(scale%lever(2), 10.5_dp, rounding, "lever of a plane: the farthest grain")
    call check_close(scale%lever(3), 2.25_dp, rounding, "lever of glued grains: the farthest of them")
    call check_close(scale%lever(4), sqrt(34.0_dp), rounding, "lever about axes that a table knows")
    call check_close(lever_of_mesh(), 4.0_dp, rounding, "lever of a mesh about the axis of a table: its farthest corner")
    call check_close(scale%lever(5), 0.0_dp, 0.0_dp, "what does not turn has none")
    call check_close(scale%diameter, 0.75_dp, rounding, "mean diameter")
  end subroutine test_levers

  !> Lever of a triangle that turns about the third axis by a table.
  real(dp) function lever_of_mesh() result(lever)
    type(boundary_t) :: boundaries(1)
    type(body_set_t) :: grains
    real(dp) :: found(1), facet(3, 3, 1)

    call grains%init(body_layout_t(3, 6, 0), 0)
    facet(:, 1, 1) = [3.0_dp, 0.0_dp, 0.0_dp]
    facet(:, 2, 1) = [0.0_dp, 4.0_dp, 0.0_dp]
    facet(:, 3, 1) = [1.0_dp, 1.0_dp, 90.0_dp]
    call change_shape("mesh", boundaries(1))
    boundaries(1)%surface%edge(1, 1) = 1.0_dp
    boundaries(1)%surface%edge(2, 2) = 1.0_dp
    call boundaries(1)%surface%take_facets(facet)
    allocate (boundaries(1)%drive%table%has(10), source=.false.)
    boundaries(1)%drive%table%has(6) = .true.
    call find_levers(grains, boundaries, found)
    lever = found(1)
  end function lever_of_mesh

  !> What is imposed where drives turn round: the velocities of ten steps later, or of a quarter of the period of an oscillation, if
  !> that is sooner, and 30 steps where they begin or end at rest; of planes that go together without gravity nothing, at any time;
  !> of a cell the rates that it comes to.
  subroutine test_turning_round()
    real(dp), parameter :: lever(2) = 0.0_dp, two_pi = 8.0_dp*atan(1.0_dp)
    type(boundary_t) :: boundaries(2)
    type(physics_t) :: physics
    type(imposed_motion_t) :: now
    integer :: b

    physics%h = 0.01_dp
    do b = 1, 2
      boundaries(b) = plane(b, [0.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 0.0_dp, 1.0_dp])
      boundaries(b)%drive%frequency = 4.0_dp
      boundaries(b)%drive%oscillation(1) = 0.5_dp
    end do
    call turn_round(boundaries, physics, 0.0625_dp, now)
    call check_close(now%difference, 0.0_dp, 1.0e-12_dp, "planes that turn round together")
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.0625_dp, now), 0.0_dp, 1.0e-12_dp, &
      & "planes that go together")
    physics%gravity(3) = -1.0_dp
    call turn_round(boundaries, physics, 0.0625_dp, now)
    call check_close(now%difference, 0.0_dp, 1.0e-12_dp, "a box that turns round")
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.0625_dp, now), 2.0_dp*two_pi, 1.0e-12_dp, &
      & "a box that turns round, under gravity")
    physics%gravity(3) = 0.0_dp
    boundaries(2)%drive%phase = 0.5_dp*two_pi
    call turn_round(boundaries, physics, 0.0625_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.0625_dp, now), 4.0_dp*two_pi, 1.0e-12_dp, &
      & "planes that go against each other")
    do b = 1, 2
      boundaries(b)%drive%oscillation(:) = 0.0_dp
    end do
    call turn_round(boundaries, physics, 0.0625_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.0625_dp, now), 0.0_dp, 0.0_dp, "planes at rest")
    ! vx vy vz, wx wy wz, fx fy fz, pressure
    associate (table => boundaries(1)%drive%table)
      allocate (table%has(10), source=.false.)
      table%has(2) = .true.
      allocate (table%time(3), table%value(10, 3), source=0.0_dp)
      table%time(:) = [0.0_dp, 1.0_dp, 2.0_dp]
      table%value(2, :) = [0.0_dp, 3.0_dp, 7.0_dp]
    end associate
    call turn_round(boundaries, physics, 0.01_dp, now)
    call check_close(now%difference, 0.03_dp, 1.0e-12_dp, "a plane that starts slowly")
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.01_dp, now), 0.93_dp, 1.0e-12_dp, &
      & "a plane that starts slowly, 30 steps later")
    call turn_round(boundaries, physics, 0.5_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.5_dp, now), 1.8_dp, 1.0e-12_dp, &
      & "a plane that grows faster, ten steps later")
    boundaries(1)%drive%table%value(2, :) = [4.0_dp, 0.0_dp, 0.0_dp]
    call turn_round(boundaries, physics, 1.01_dp, now)
    call check_close(now%difference, 0.0_dp, 0.0_dp, "a plane that has come to rest")
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 1.01_dp, now), 1.16_dp, 1.0e-12_dp, &
      & "a plane that has come to rest slowly, 30 steps before")
    call turn_round(boundaries, physics, 1.2_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 1.2_dp, now), 0.0_dp, 0.0_dp, "a plane at rest")
    boundaries(1)%drive%table%value(2, :) = [0.0_dp, 0.0_dp, 1.0_dp]
    call turn_round(boundaries, physics, 0.95_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.95_dp, now), 0.0_dp, 0.0_dp, &
      & "a plane that has not begun to move")
    boundaries(1)%drive%table%value(2, :) = [1.0e-3_dp, 1.0e-3_dp, 1.0_dp]
    call turn_round(boundaries, physics, 0.85_dp, now)
    call check_close(largest_imposed(3, boundaries, lever, 1.0_dp, physics, 0.85_dp, now), 1.0e-3_dp, 1.0e-12_dp, &
      & "a plane whose slow stage goes on for ten steps")
    boundaries(1)%drive%table%value(2, :) = [0.0_dp, 3.0_dp, 7.0_dp]
    call turn_round(boundaries, physics, 1.0e-3_dp, now)
    physics%cell%fastest = 5.0_dp
    call check_close(largest_imposed(3, boundaries, lever, 2.0_dp, physics, 1.0e-3_dp, now), 10.0_dp, 1.0e-12_dp, &
      & "a cell whose rates begin")
  end subroutine test_turning_round

  !> What is imposed at a time by boundaries that do not turn.
  subroutine turn_round(boundaries, physics, time, now)
    type(boundary_t), intent(inout) :: boundaries(2)
    type(physics_t), intent(in) :: physics
    real(dp), intent(in) :: time
    type(imposed_motion_t), intent(out) :: now
    real(dp), parameter :: lever(2) = 0.0_dp
    integer :: k

    do k = 1, 2
      call boundaries(k)%prescribe(3, time, physics%h)
    end do
    call find_imposed(3, boundaries, lever, 1.0_dp, physics, now)
  end subroutine turn_round

  !> Input file of a scene, in its units.
  function text_of(scene) result(text)
    type(scene_t), intent(in) :: scene
    character(len=:), allocatable :: text
    character(len=:), allocatable :: zeros, lattice
    real(dp) :: force

    associate (u => scene%units)
      zeros = repeat("0, ", scene%nd - 1)
      lattice = "8, 6"
      if (scene%nd == 3) lattice = "4, 4, 4"
      ! kg m/s^2, over the area on which pressures act and the volume
      force = u%mass*u%length/u%time**2
      text = "&scene dimension = "//to_text(scene%nd)//", bodies = 'lattice', lattice_count = "//lattice//", gravity = "//zeros// &
        & number(-scene%gravity*u%length/u%time**2)//", body_force = "//zeros//number(scene%body_force*force/u%length**scene%nd)// &
        & ", radius_min = "//number(radius*u%length)//", radius_max = "//number(radius*u%length)//", density = "// &
        & number(density*u%mass/u%length**scene%nd)//", alert_distance = "//number(0.5_dp*radius*u%length)//" /"//newline
      if (scene%adhesion > 0.0_dp) text = text//"&material name = 'm' / &law materials = 'm', kind = 'adhesive', adhesion = "// &
        & number(scene%adhesion*force)//", adhesion_range = "//number(0.5_dp*radius*u%length)//" /"//newline
      if (scene%pressure > 0.0_dp .or. scene%sliding > 0.0_dp) then
        text = text//"&boundary name = 'lid', shape = 'plane', point = "//zeros//number(4.0_dp*u%length)//", normal = "//zeros// &
          & "-1, velocity = "//number(scene%sliding*u%length/u%time)
        if (scene%pressure > 0.0_dp) text = text//", free("//to_text(scene%nd)//") = .true., mass = "//number(64.0_dp*u%mass)// &
          & ", pressure = "//number(scene%pressure*force/u%length**(scene%nd - 1))
        text = text//" /"//newline
      end if
      if (scene%spin > 0.0_dp) then
        if (scene%nd == 2) then
          text = text//"&boundary shape = 'circle', radius = "//number(8.0_dp*u%length)//", rotation = "//number(scene%spin/u%time)
        else
          text = text//"&boundary shape = 'cylinder', axis = 0, 2, 0, radius = "//number(8.0_dp*u%length)//", rotation = 0, "// &
            & number(-scene%spin/u%time)//", 0"
        end if
        text = text//" /"//newline
      end if
      text = text//"&time step = "//number(step*u%time)//", steps = "//to_text(steps)//", theta = 1 /"//newline// &
        & "&solver method = 'nscdd'"
      if (scene%given > 0.0_dp) text = text//", velocity_scale = "//number(scene%given*u%length/u%time)
      text = text//" /"//newline//"&decomposition subdomains = "//to_text(scene%subdomains)//" /"//newline
    end associate
  end function text_of

  !> All bits of a number.
  function number(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(value, 17)
  end function number

  subroutine check_scale(sim, value, kind, name)
    type(simulation_t), intent(in) :: sim
    real(dp), intent(in) :: value
    character(len=*), intent(in) :: kind, name

    call check_value(sim%velocity_scale, value, kind, name)
  end subroutine check_scale

  subroutine check_value(scale, value, kind, name)
    type(velocity_scale_t), intent(in) :: scale
    real(dp), intent(in) :: value
    character(len=*), intent(in) :: kind, name

    call check_close(scale%value, value, rounding*value, name)
    call check_equal(trim(scale%kind), kind, name//": which rules")
  end subroutine check_value

  subroutine test_loads(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim
    real(dp), parameter :: small(1) = 1.0e-3_dp*radius, large(1) = 1.0e3_dp*radius
    type(boundary_t) :: plate(1)
    real(dp) :: mass, creep

    mass = grain_mass(nd, radius, density)
    creep = 0.01_dp*2.0_dp*radius/(steps*step)
    scene%nd = nd
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.0_dp, "none", "nothing acts, nothing moves")
    call check_close(sim%velocity_scale%creep, creep, rounding*creep, "creep")
    scene%gravity = g
    call assemble(comm, scene, sim)
    call check_scale(sim, g*step, "load of a step", "gravity")
    call check_close(sim%velocity_scale%own, 0.0_dp, 0.0_dp, "at rest under gravity nothing moves")
    ! half of the weight is borne by the force on volumes
    scene%body_force = 0.5_dp*g*density
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.5_dp*g*step, "load of a step", "gravity and a force on volumes")
    scene = scene_t(nd=nd, pressure=1000.0_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, step*1000.0_dp*(2.0_dp*radius)**(nd - 1)/mass, "load of a step", "pressure")
    plate(1) = pressed_plate(1000.0_dp)
    ! on a plate that is smaller than a grain all of its force acts on one grain
    call check_close(sim%velocity_scale%load_of(nd, plate, sim%physics, 0.0_dp, small), &
      & step*1000.0_dp/mass, rounding*step*1000.0_dp/mass, "a plate smaller than a grain")
    call check_close(sim%velocity_scale%load_of(nd, plate, sim%physics, 0.0_dp, large), &
      & step/radius*(2.0_dp*radius)**(nd - 1)/mass, rounding*step/radius/mass, "a large plate")
    call check_close(sim%velocity_scale%pressure_of(nd, plate(1), 0.0_dp, 0.1_dp, small(1)), 1.0e6_dp/radius, &
      & rounding*1.0e6_dp/radius, "its pressure is that of its area")
    ! attraction is an internal force where there is another load
    scene = scene_t(nd=nd, adhesion=3.0_dp, gravity=1.0e-3_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, step*1.0e-3_dp, "load of a step", "weight beside attraction")
    scene%gravity = 0.0_dp
    call assemble(comm, scene, sim)
    call check_scale(sim, creep, "creep", "attraction alone, which is balanced inside of bodies")
    call check_close(sim%velocity_scale%load, step*3.0_dp/mass, rounding*step*3.0_dp/mass, "load by attraction alone")
    scene%motion = 1.0_dp
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.3_dp*sim%velocity_scale%own, "motion of the bodies", "attraction of bodies that move")
    ! the range is crossed in a step with 0.125 m/s
    scene%motion = 0.0_dp
    scene%adhesion = 0.1_dp*mass/step
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.1_dp, "load of a step", "attraction that brings grains together in several steps")
    scene%motion = 0.0_dp
    scene%adhesion = 0.5_dp*creep*mass/step
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.5_dp*creep, "load of a step", "attraction that is weaker than creep")
    call check_close(sim%velocity_scale%own, 0.0_dp, rounding*creep, "at rest under attraction nothing moves")
  end subroutine test_loads

  !> A boundary that a force moves along z.
  function pressed_plate(force) result(boundary)
    real(dp), intent(in) :: force
    type(boundary_t) :: boundary

    boundary = plane(1, [0.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    boundary%free(2) = .true.
    boundary%drive%force(2) = -force
  end function pressed_plate

  subroutine test_drives(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim
    real(dp) :: load, creep

    load = step*1000.0_dp*(2.0_dp*radius)**(nd - 1)/grain_mass(nd, radius, density)
    creep = 0.01_dp*2.0_dp*radius/(steps*step)
    scene = scene_t(nd=nd, pressure=1000.0_dp, sliding=0.125_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.125_dp, "drive", "slow shear under pressure")
    scene%sliding = 2.0_dp*load
    call assemble(comm, scene, sim)
    call check_scale(sim, load, "load of a step", "fast shear under pressure")
    scene%sliding = 0.5_dp*creep
    call assemble(comm, scene, sim)
    call check_scale(sim, creep, "creep", "shear that nobody would see")
    scene = scene_t(nd=nd, sliding=100.0_dp*load)
    call assemble(comm, scene, sim)
    call check_scale(sim, 100.0_dp*load, "drive", "shear without loads")
    scene = scene_t(nd=nd, gravity=g, sliding=0.25_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.25_dp, "drive", "shear under gravity")
    scene = scene_t(nd=nd, gravity=g, spin=0.03125_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.25_dp, "drive", "the rim of a drum")
  end subroutine test_drives

  !> Motion of the bodies: root mean square over all of them, since all are in contact and have one mass. Where no boundary holds
  !> the scene, a velocity in common does not count: squares of 100 m/s leave roundings of 1e-12 m^2/s^2.
  subroutine test_own(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim
    real(dp) :: own, own_square, mean(nd), v
    integer :: k, d, n

    n = merge(48, 64, nd == 2)
    own_square = 0.0_dp
    mean(:) = 0.0_dp
    do k = 1, n
      do d = 1, nd
        v = 32.0_dp*(2.0_dp*hash_uniform(5, int(k, kind(sim%n_grains)), d) - 1.0_dp)
        own_square = own_square + v**2/n
        mean(d) = mean(d) + v/n
      end do
    end do
    own = sqrt(own_square)
    scene = scene_t(nd=nd, gravity=g, motion=4.0_dp, adhesion=1.0e-3_dp)
    call assemble(comm, scene, sim)
    call check_close(sim%velocity_scale%own, 0.125_dp*own, rounding*own, "root mean square velocity, loads not counted")
    ! g h = 2 m/s exceeds three tenths of it
    call check_scale(sim, g*step, "load of a step", "settling")
    scene = scene_t(nd=nd, motion=32.0_dp)
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.3_dp*own, "motion of the bodies", "a gas in a box")
    scene = scene_t(nd=nd, motion=32.0_dp, wind=128.0_dp, open=.true.)
    call assemble(comm, scene, sim)
    own = sqrt(own_square - sum(mean**2))
    call check_close(sim%velocity_scale%own, own, 1.0e-11_dp*own, "a gas that flies")
    call test_whole(nd, own, sum(mean**2))
  end subroutine test_own

  !> The motion of bodies that move as a whole between boundaries at rest, and their motion against each other.
  subroutine test_whole(nd, apart, square_of_mean)
    integer, intent(in) :: nd
    !> root mean square velocity beside the mean and square of the mean where `motion` is 32 m/s
    real(dp), intent(in) :: apart, square_of_mean
    type(scene_t) :: scene
    type(simulation_t) :: sim

    scene = scene_t(nd=nd, gravity=g, motion=32.0_dp, wind=256.0_dp)
    call assemble(comm, scene, sim)
    call check(sim%velocity_scale%own > 250.0_dp, "bodies that move as a whole")
    call check_close(sim%velocity_scale%apart, apart, 1.0e-11_dp*apart, "their motion against each other")
    call check_scale(sim, 0.3_dp*sim%velocity_scale%own, "motion of the bodies", "errors are compared with all of the motion")
    call check_close(norm2(sim%velocity_scale%mean - [256.0_dp, 0.0_dp, 0.0_dp]), sqrt(square_of_mean), 1.0e-9_dp, &
      & "their mean velocity")
  end subroutine test_whole

  !> Grains that nothing loads or drives and that do not move, but that press on each other: their forces are what is compared with.
  !> Those that move, and impulses that only part of the contacts have, make a difference.
  subroutine test_stress(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim
    real(dp) :: stress

    stress = 3.0_dp/grain_mass(nd, radius, density)
    scene%nd = nd
    call assemble(comm, scene, sim)
    call check_scale(sim, 0.0_dp, "none", "nothing presses")
    call press(sim, 3.0_dp)
    call check_scale(sim, stress, "contact forces", "wedged grains")
    scene%motion = 0.1_dp*stress
    call assemble(comm, scene, sim)
    call press(sim, 3.0_dp)
    call check_scale(sim, stress, "contact forces", "wedged grains that hardly move")
    scene%motion = 0.5_dp*stress
    call assemble(comm, scene, sim)
    call press(sim, 3.0_dp)
    call check(sim%velocity_scale%own > 0.2_dp*stress, "grains that move")
    call check_scale(sim, 0.3_dp*sim%velocity_scale%own, "motion of the bodies", "grains that move and press")
    scene = scene_t(nd=nd, gravity=g)
    call assemble(comm, scene, sim)
    call press(sim, 3.0e3_dp)
    call check_scale(sim, g*step, "load of a step", "grains that are loaded and press")
    scene = scene_t(nd=nd, sliding=1.0e-3_dp)
    call assemble(comm, scene, sim)
    call press(sim, 3.0e3_dp)
    call check(sim%velocity_scale%kind /= "contact forces", "grains that are driven and press")
  end subroutine test_stress

  !> Slow grains among fast ones: their errors count as the square of a quarter of the scale over their own one. Where nothing
  !> moves, and of fast grains, no error counts more than others.
  subroutine test_slow_bodies(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim
    real(dp) :: area(8), u, own, wanted
    integer :: s, b, slow

    scene = scene_t(nd=nd, gravity=1.0e-3_dp*g)
    call assemble(comm, scene, sim)
    do s = 1, size(sim%problem%sub)
      call check(.not. allocated(sim%problem%sub(s)%concern), "nothing moves")
    end do
    scene%motion = 32.0_dp
    call assemble(comm, scene, sim)
    area(:) = 1.0_dp
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do b = 1, sub%n_grains
          ! every third grain has 0 to a tenth of its velocity
          if (mod(sub%id(b), 3_i8) == 0) sub%v_free(1:nd, b) = 0.1_dp*mod(sub%id(b), 2_i8)*sub%v_free(1:nd, b)
        end do
      end associate
    end do
    call sim%velocity_scale%measure(sim%decomposition, sim%physics, sim%problem, step, area(1:size(sim%decomposition%boundaries)))
    call check_equal(trim(sim%velocity_scale%kind), "motion of the bodies", "some are slow: which rules")
    u = sim%velocity_scale%value
    slow = 0
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do b = 1, sub%n_grains
          own = speed_of(sim, s, b)
          own = max(0.3_dp*own, 1.0e-3_dp*g*step)
          wanted = max(1.0_dp, (0.25_dp*u/own)**2)
          if (wanted > 1.0_dp) slow = slow + 1
          call check_close(sub%concern(b), wanted, 1.0e-10_dp*wanted, "how much the error of a grain counts")
        end do
      end associate
    end do
    call check(slow > 0 .or. size(sim%problem%sub) == 0, "some are slow")
  end subroutine test_slow_bodies

  !> Speed of a grain at the start of a step under gravity along the last axis [m/s].
  real(dp) function speed_of(sim, s, b) result(speed)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: s, b
    real(dp) :: v(3)
    integer :: d

    do d = 1, nd
      v(d) = sim%problem%sub(s)%v_free(d, b)
    end do
    v(nd) = v(nd) + 1.0e-3_dp*g*step
    speed = norm2(v(1:nd))
  end function speed_of

  !> Give every second contact a normal impulse, and measure the scale anew.
  subroutine press(sim, impulse)
    type(simulation_t), intent(inout) :: sim
    !> [N s]
    real(dp), intent(in) :: impulse
    real(dp) :: area(size(sim%decomposition%boundaries))
    integer :: s, c

    do s = 1, size(sim%problem%sub)
      do c = 1, sim%problem%sub(s)%n_contacts, 2
        sim%problem%sub(s)%impulse(lane_of(c), 1, block_of(c)) = impulse
      end do
    end do
    area(:) = 1.0_dp
    call sim%velocity_scale%measure(sim%decomposition, sim%physics, sim%problem, step, area)
  end subroutine press

  !> The force that a loop applies to grain `k`.
  pure real(dp) function push_on(k, d, most) result(push)
    integer(i8), intent(in) :: k
    !> axis
    integer, intent(in) :: d
    !> along each axis [N]
    real(dp), intent(in) :: most

    push = most*hash_uniform(9, k, d)
  end function push_on

  !> Forces of a loop, other ones for each grain, in one subdomain and in many that share grains: a load of their root mean square,
  !> since all grains are in contact and have one mass, and at rest under them nothing moves.
  subroutine test_applied(nd)
    integer, intent(in) :: nd
    type(simulation_t) :: sim
    real(dp) :: square
    integer :: k, d, n, subdomains

    n = merge(48, 64, nd == 2)
    square = 0.0_dp
    do k = 1, n
      do d = 1, nd
        square = square + (step*push_on(int(k, i8), d, 5.0_dp)/grain_mass(nd, radius, density))**2/n
      end do
    end do
    do subdomains = 1, 7, 6
      call assemble(comm, scene_t(nd=nd, subdomains=subdomains, push=5.0_dp), sim)
      call check_scale(sim, sqrt(square), "load of a step", "forces of a loop")
      call check_close(sim%velocity_scale%own, 0.0_dp, rounding*sqrt(square), "at rest under forces of a loop nothing moves")
    end do
  end subroutine test_applied

  subroutine test_given(nd)
    integer, intent(in) :: nd
    type(simulation_t) :: sim

    call assemble(comm, scene_t(nd=nd, gravity=g, motion=100.0_dp, sliding=1.0_dp, given=0.375_dp), sim)
    call check_scale(sim, 0.375_dp, "given", "a velocity of the user replaces all rules")
  end subroutine test_given

  !> All parts at once, on these ranks and on each of them alone.
  subroutine test_ranks(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: together, apart

    scene = scene_t(nd=nd, subdomains=7, gravity=g, pressure=1000.0_dp, sliding=0.3_dp, adhesion=3.0_dp, motion=1.0_dp)
    call assemble(comm, scene, together)
    call assemble(alone, scene, apart)
    associate (one => together%velocity_scale, other => apart%velocity_scale)
      call check(one%own > 0.0_dp .and. one%load > 0.0_dp, "there is something to compare")
      call check_close(one%load, other%load, 0.0_dp, "load on any number of ranks")
      call check_close(one%drive, other%drive, 0.0_dp, "drive on any number of ranks")
      call check_close(one%own, other%own, 0.0_dp, "motion on any number of ranks")
      call check_close(one%value, other%value, 0.0_dp, "scale on any number of ranks")
    end associate
  end subroutine test_ranks

  !> Units that differ by powers of two: every part has the factor of a velocity, bit for bit but for the last place of an exact
  !> sum over subdomains, which is rounded where its limbs begin.
  subroutine test_units(nd)
    integer, intent(in) :: nd
    type(scene_t) :: scene
    type(simulation_t) :: sim, other
    real(dp) :: factor

    scene = scene_t(nd=nd, gravity=g, body_force=11.0_dp, pressure=1000.0_dp, sliding=0.3_dp, adhesion=3.0_dp, spin=0.1_dp, &
      & motion=1.0_dp)
    call assemble(comm, scene, sim)
    scene%units = units_t(1024.0_dp, 0.125_dp, 2.0_dp**(-7))
    factor = scene%units%length/scene%units%time
    call assemble(comm, scene, other)
    associate (one => sim%velocity_scale, scaled => other%velocity_scale)
      call check_close(scaled%load, factor*one%load, 0.0_dp, "units of the load")
      call check_close(scaled%drive, factor*one%drive, 0.0_dp, "units of the drive")
      call check_close(scaled%creep, factor*one%creep, 0.0_dp, "units of creep")
      call check_close(scaled%own, factor*one%own, 2.0_dp*epsilon(1.0_dp)*scaled%own, "units of the motion")
      call check_close(scaled%value, factor*one%value, 0.0_dp, "units of the scale")
    end associate
  end subroutine test_units

end program test_velocity_scale
