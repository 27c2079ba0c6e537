!> From the &scene group to grains, boundaries and the physics of their contacts.
module gravier_scene
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: sharpest, far_text
  use gravier_communicator, only: communicator_t
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls, find_own_rows
  use gravier_bodies_file, only: read_bodies
  use gravier_given_contacts, only: given_contacts_t, check_pulls, check_points
  use gravier_pair_places, only: has_facets
  use gravier_shape_library, only: shape_library_t
  use gravier_shapes_file, only: read_shapes
  use gravier_periodic, only: period_t
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_boundary, only: boundary_t
  use gravier_insertion, only: insertion_t
  use gravier_effects, only: effects_t
  use gravier_motion, only: grain_mass
  use gravier_law_set, only: law_set_t
  use gravier_pair_laws, only: set_default_laws
  use gravier_method_choice, only: check_moments
  use gravier_cell_drive, only: cell_drive_t
  use gravier_scene_cell, only: cell_moves, make_cell_drive, set_period, stop_cell, check_cell
  use gravier_known_column, only: what_else_acts
  use gravier_config_types, only: config_t, scene_config_t
  use gravier_config_laws, only: density_of, collect_laws
  use gravier_run_memory, only: check_planned_grains, check_read_grains, check_entering_grains
  use gravier_sample_bodies, only: make_lattice, make_sample, farthest_place
  use gravier_scene_boundaries, only: make_boundaries, check_pressures
  use gravier_scene_insertions, only: make_insertions, check_regions
  use gravier_scene_regions, only: check_mean_regions
  use gravier_scene_tracks, only: check_tracked_bodies
  implicit none
  private
  public :: scene_t, make_scene

  !> what make_column and make_nothing make, for messages
  character(len=*), parameter :: column = "the grains of the column", nothing = "no grains"

  !> A scene as it starts. Grains are spread over the ranks in any way; boundaries are on all of them.
  type :: scene_t
    type(body_set_t) :: grains
    !> those that came with the grains, then those of the input file
    type(boundary_t), allocatable :: boundaries(:)
    !> that bodies may have
    type(shape_library_t) :: shapes
    integer :: n_walls = 0
    !> that the bodies file gives
    type(given_contacts_t) :: contacts
    !> of grains that enter
    type(insertion_t), allocatable :: insertions(:)
    type(period_t) :: period
    !> what moves it
    type(cell_drive_t) :: cell_drive
    !> grains of all ranks, and those of them that are glued to boundaries
    integer(i8) :: n_grains = 0, n_glued = 0
    !> the largest identifier of grains and boundaries
    integer(i8) :: last_id = 0
    !> of all ranks, of the grains that enter too [m]; 0 without grains. The mean is that of the grains at the start, or of those of
    !> an insertion where it is smaller
    real(dp) :: largest_radius = 0.0_dp, mean_radius = 0.0_dp
    !> of the edges and corners of all bodies; huge without shapes [m]
    real(dp) :: least_rounding = huge(1.0_dp)
    type(effects_t) :: effects
    !> of contact, by pairs of materials
    type(law_set_t) :: laws
  end type scene_t

contains

  !> Make the bodies of a scene. Errors are the same on all ranks. Collective.
  subroutine make_scene(comm, config, scene, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(scene_t), intent(out) :: scene
    type(error_t), allocatable, intent(inout) :: error
    type(bodies_data_t) :: data
    integer :: b

    call check_planned_grains(comm, config, error)
    if (allocated(error)) return
    if (config%scene%shapes /= "") call read_shapes(comm, trim(config%scene%shapes), config%scene%dimension, scene%shapes, error)
    if (allocated(error)) return
    call make_insertions(comm, config, scene%shapes, scene%insertions, error)
    if (allocated(error)) return
    call check_entering_grains(comm, config, scene%insertions, error)
    if (allocated(error)) return
    select case (config%scene%bodies)
    case ("column")
      call make_column(comm, config%scene, data, error)
    case ("lattice")
      call make_lattice(comm, config, data, error)
    case ("sample")
      call make_sample(comm, config, scene%shapes, data, error)
    case ("none")
      call make_nothing(config%scene%dimension, data, error)
    case default
      call read_bodies(comm, trim(config%scene%bodies_file), config%scene%dimension, data, error, scene%shapes)
      call check_read_grains(comm, config, data%total, error)
    end select
    call check_exact_solution(config, error)
    if (allocated(error)) return
    call make_boundaries(comm, config, data, scene%boundaries, error)
    if (allocated(error)) return
    scene%n_walls = data%n_walls
    call set_period(config, data, scene%period, error)
    do b = 1, size(scene%boundaries)
      scene%boundaries(b)%period(:) = scene%period%length
    end do
    call check_pressures(config%file, config%scene%dimension, scene%period%length, scene%boundaries, error)
    if (.not. allocated(error)) call make_cell_drive(config, scene%cell_drive, error)
    if (.not. allocated(error)) call check_cell(config, scene%cell_drive, scene%period, size(scene%boundaries), error)
    call check_regions(config, scene%insertions, scene%period, scene%boundaries, error)
    call check_mean_regions(config, scene%period, error)
    call check_tracked_bodies(comm, config, data%id, error)
    call comm%agree(error)
    if (allocated(error)) return
    call collect_laws(config, scene%laws)
    call set_default_laws(scene%laws, config%scene%contact, scene%boundaries)
    call check_data(comm, config, data, error)
    if (allocated(error)) return
    if (scene%shapes%n > 0 .and. size(scene%insertions) > 0 .and. .not. allocated(data%shape)) &
      & call allocate_shapes(data, "the bodies", error)
    call comm%agree(error)
    if (allocated(error)) return
    call take_data(comm, config, data, scene)
    if (.not. cell_moves(config%scene)) call stop_cell(scene%period, scene%grains)
    call check_moments(config, scene%effects, error)
    call check_shapes(config, scene, error)
    if (scene%effects%compliance) call scene%shapes%keep_round()
    call check_places(comm, config, data, scene, error)
    if (config%solver%warm_start) scene%contacts = data%contacts
    if (.not. scene%laws%attracts) call check_pulls(comm, scene%contacts, error)
    if (scene%effects%shapes .or. has_facets(scene%boundaries)) call check_points(scene%contacts, error)
    call glue(comm, config, data, scene, error)
  end subroutine make_scene

  !> Refuse places so far from the origin that rounding would hide the gaps between grains. Errors are the same on all ranks.
  !> Collective.
  subroutine check_places(comm, config, data, scene, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(scene_t), intent(in) :: scene
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: far, far_off
    integer :: k

    if (scene%n_grains == 0 .and. size(scene%insertions) == 0) return
    far = farthest_place(comm, data%radius)
    do k = 1, size(scene%insertions)
      far = min(far, sharpest*scene%insertions(k)%radii%smallest())
    end do
    if (scene%period%on()) call check("period", maxval(abs(scene%period%origin) + scene%period%length))
    do k = 1, size(scene%boundaries)
      associate (boundary => scene%boundaries(k))
        far_off = maxval(abs(boundary%pivot))
        if (allocated(boundary%surface)) far_off = max(far_off, boundary%surface%far_off())
        call check("boundary '"//boundary%name//"'", far_off)
      end associate
    end do
    do k = 1, data%n
      ! a name is made for the grain that needs it alone
      if (maxval(abs(data%position(:, k))) > far) call check("id "//to_text(data%id(k)), maxval(abs(data%position(:, k))))
    end do
    call comm%agree(error)

  contains

    subroutine check(what, coordinate)
      character(len=*), intent(in) :: what
      !> the largest in size [m]
      real(dp), intent(in) :: coordinate

      if (coordinate > far) call raise(error, status_input, config%file//": "//what//": a coordinate or length of "// &
        & to_text(coordinate, 4)//" m: expected at most "//to_text(far, 4)//" m, "//far_text)
    end subroutine check

  end subroutine check_places

  !> Refuse grains of a material that the input does not have; without any &material all are of the first, which then says nothing.
  !> Errors are the same on all ranks. Collective.
  subroutine check_data(comm, config, data, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: expected
    integer :: k, n

    n = size(config%materials)
    do k = 1, data%n
      if (data%material(k) <= max(1, n)) cycle
      expected = "1 to "//to_text(n)//", the number of a &material of "//config%file
      if (n == 0) expected = "1, since "//config%file//" has no &material"
      call raise(error, status_input, trim(config%scene%bodies_file)//": id "//to_text(data%id(k))//": material "// &
        & to_text(data%material(k))//": expected "//expected)
      exit
    end do
    call comm%agree(error)
  end subroutine check_data

  !> Glue the grains of a group to the boundary of that group, which has some. Errors are the same on all ranks. Collective.
  subroutine glue(comm, config, data, scene, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(scene_t), intent(inout) :: scene
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, b, members(size(config%boundaries))

    scene%n_glued = comm%total(int(count(data%group > 0), i8))
    members(:) = 0
    do k = 1, data%n
      if (data%group(k) == 0) cycle
      do b = 1, size(config%boundaries)
        if (config%boundaries(b)%shape /= "grains" .or. config%boundaries(b)%group /= data%group(k)) cycle
        scene%grains%glued(k) = data%n_walls + b
        members(b) = members(b) + 1
      end do
      if (scene%grains%glued(k) > 0) cycle
      call raise(error, status_input, trim(config%scene%bodies_file)//": id "//to_text(data%id(k))//": group "// &
        & to_text(data%group(k))//": expected 0, or the group of a &boundary with shape = 'grains' in "//config%file)
      exit
    end do
    call comm%agree(error)
    do b = 1, size(members)
      if (config%boundaries(b)%shape /= "grains" .or. allocated(error)) cycle
      if (comm%total(int(members(b), i8)) > 0) cycle
      call raise(error, status_input, config%file//": &boundary '"//trim(config%boundaries(b)%name)//"': group = "// &
        & to_text(config%boundaries(b)%group)//": "//trim(config%scene%bodies_file)//" has no grain of this group; expected some")
    end do
  end subroutine glue

  !> Bodies with shapes turn, and no moments resist that: the arms of their contacts do.
  subroutine check_shapes(config, scene, error)
    type(config_t), intent(in) :: config
    type(scene_t), intent(in) :: scene
    type(error_t), allocatable, intent(inout) :: error

    if (.not. scene%effects%shapes) return
    if (.not. config%scene%rotation) call raise(error, status_input, config%file// &
      & ": &scene rotation = .false.: expected .true. where bodies have shapes")
    if (scene%effects%rolling) call raise(error, status_input, config%file// &
      & ": rolling or pivoting friction: expected 0 where bodies have shapes")
    if (scene%laws%of_spheres) call raise(error, status_input, config%file// &
      & ": &law kind = 'hertz': expected another, as 'elastic', where bodies have shapes: this one is of spheres")
  end subroutine check_shapes

  !> The criterion 'error' knows the impulses of a column that gravity presses on the ground.
  subroutine check_exact_solution(config, error)
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: what
    integer :: nd

    if (config%solver%criterion /= "error") return
    what = what_else_acts(config)
    if (what /= "") call raise(error, status_input, config%file//": &solver criterion = 'error': expected another "//what// &
      & ": the impulses of the column alone are known")
    nd = config%scene%dimension
    if (any(abs(config%scene%gravity(1:nd - 1)) > 0.0_dp) .or. config%scene%gravity(nd) >= 0.0_dp) &
      & call raise(error, status_input, config%file//": &scene gravity: criterion = 'error' knows the column under gravity "// &
      & "along its axis only; expected zeros, then a negative last component")
  end subroutine check_exact_solution

  !> Equal grains, one upon the other on a ground: the columns of the paper.
  subroutine make_column(comm, scene, data, error)
    type(communicator_t), intent(in) :: comm
    type(scene_config_t), intent(in) :: scene
    type(bodies_data_t), intent(out) :: data
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: first
    integer :: k, n

    data%total = scene%column_count
    call find_own_rows(comm, data%total, scene%dimension, column, first, n, error)
    call allocate_bodies(data, scene%dimension, n, .true., column, error)
    call allocate_walls(data, scene%dimension, 1, column, error)
    call comm%agree(error)
    if (allocated(error)) return
    data%mass(:) = scene%mass
    data%radius(:) = scene%radius
    data%position(:, :) = 0.0_dp
    do k = 1, n
      data%id(k) = first + k
      data%position(scene%dimension, k) = (2*data%id(k) - 1)*scene%radius
    end do
    data%wall_id(1) = data%total + 1
    data%wall_point(:, 1) = 0.0_dp
    data%wall_normal(:, 1) = 0.0_dp
    data%wall_normal(scene%dimension, 1) = 1.0_dp
  end subroutine make_column

  !> A scene without grains and planes: all grains enter.
  subroutine make_nothing(nd, data, error)
    integer, intent(in) :: nd
    type(bodies_data_t), intent(out) :: data
    type(error_t), allocatable, intent(inout) :: error

    data%total = 0
    call allocate_bodies(data, nd, 0, .true., nothing, error)
    call allocate_walls(data, nd, 0, nothing, error)
  end subroutine make_nothing

  !> Find out what the scene has, from its laws, bodies, boundaries and loads. What no pair can feel is off: a law between grains
  !> where there are no two, one of an outlet, rolling friction where nothing turns. Collective.
  subroutine deduce_effects(comm, config, data, scene)
    type(communicator_t), intent(in) :: comm
    type(scene_config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(scene_t), intent(inout) :: scene
    logical :: turning
    integer :: k, nd

    nd = config%dimension
    associate (effects => scene%effects)
      if (data%total > 1 .or. size(scene%insertions) > 0) call add_law(config%contact)
      do k = 1, size(scene%boundaries)
        associate (boundary => scene%boundaries(k))
          effects%drives = effects%drives .or. moves(boundary)
          effects%forces = effects%forces .or. boundary%is_driven()
          effects%removal = effects%removal .or. boundary%lets_out()
          if (.not. boundary%lets_out()) call add_law(boundary%contact)
        end associate
      end do
      if (scene%laws%n > 0) then
        call add_law(scene%laws%largest)
        effects%cohesion = scene%laws%attracts
        effects%bonds = scene%laws%breaks
        effects%compliance = scene%laws%yields
      end if
      ! moments are in the kernels of friction
      effects%friction = effects%friction .or. effects%rolling
      turning = comm%any_true(any(abs(data%velocity(nd + 1:, :)) > 0.0_dp)) .and. config%rotation
      if (allocated(data%shape)) effects%shapes = comm%any_true(any(data%shape > 0))
      do k = 1, size(scene%insertions)
        if (allocated(scene%insertions(k)%shape)) effects%shapes = effects%shapes .or. any(scene%insertions(k)%shape > 0)
      end do
      effects%rotation = effects%friction .or. turning .or. effects%shapes .or. effects%compliance
      effects%periodic = scene%period%on()
      effects%moving_cell = scene%period%moves
      effects%insertion = size(scene%insertions) > 0
      effects%glued = comm%any_true(any(data%group > 0))
      effects%gravity = any(abs(config%gravity) > 0.0_dp) .or. config%gravity_table /= ""
      effects%body_force = any(abs(config%body_force) > 0.0_dp)
    end associate

  contains

    subroutine add_law(contact)
      type(coefficients_t), intent(in) :: contact

      associate (effects => scene%effects)
        effects%friction = effects%friction .or. contact%friction > 0.0_dp
        effects%restitution = effects%restitution .or. contact%restitution > 0.0_dp
        effects%tangential_restitution = effects%tangential_restitution .or. &
          & (contact%friction > 0.0_dp .and. contact%tangential_restitution > 0.0_dp)
        if (.not. config%rotation) return
        effects%rolling = effects%rolling .or. contact%rolling_friction > 0.0_dp .or. contact%pivoting_friction > 0.0_dp
        effects%pivoting = effects%pivoting .or. contact%pivoting_friction > 0.0_dp
      end associate
    end subroutine add_law

    !> Whether a boundary moves as prescribed.
    pure logical function moves(boundary)
      type(boundary_t), intent(in) :: boundary

      moves = boundary%drive%moves()
    end function moves

  end subroutine deduce_effects

  !> Turn the rows of a file, or made rows, into bodies. Collective.
  subroutine take_data(comm, config, data, scene)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(scene_t), intent(inout) :: scene
    type(body_layout_t) :: layout
    integer :: k

    layout%nd = config%scene%dimension
    call deduce_effects(comm, config%scene, data, scene)
    layout%nv = merge(3*layout%nd - 3, layout%nd, scene%effects%rotation)
    layout%ni = merge(layout%nd, 0, scene%period%on())
    if (scene%effects%shapes) layout%no = size(data%orientation, 1)
    layout%nr = merge(1, 0, config%solver%sleeping)
    call scene%grains%init(layout, data%n)
    scene%grains%glued(:) = 0
    scene%grains%image(:, :) = 0
    do k = 1, data%n
      scene%grains%id(k) = data%id(k)
      scene%grains%position(:, k) = data%position(:, k)
      scene%grains%velocity(:, k) = data%velocity(1:layout%nv, k)
      if (.not. config%scene%rotation) scene%grains%velocity(layout%nd + 1:, k) = 0.0_dp
      scene%grains%radius(k) = data%radius(k)
      scene%grains%material(k) = data%material(k)
      call set_mass(config, data, k, scene%shapes, scene%grains)
    end do
    scene%n_grains = data%total
    if (data%n > 0) scene%largest_radius = maxval(data%radius)
    scene%largest_radius = comm%highest(scene%largest_radius)
    if (data%total > 0) scene%mean_radius = comm%sum_real(data%radius)/real(data%total, dp)
    do k = 1, size(scene%insertions)
      associate (radii => scene%insertions(k)%radii)
        scene%largest_radius = max(scene%largest_radius, radii%largest())
        if (scene%mean_radius > 0.0_dp) scene%mean_radius = min(scene%mean_radius, radii%moment(1))
        if (.not. scene%mean_radius > 0.0_dp) scene%mean_radius = radii%moment(1)
      end associate
    end do
    if (data%n > 0) scene%last_id = maxval(data%id)
    do k = 1, size(scene%boundaries)
      scene%last_id = max(scene%last_id, scene%boundaries(k)%id)
    end do
    scene%last_id = comm%largest(scene%last_id)
    if (scene%effects%shapes) call find_least_rounding(comm, scene)
  end subroutine take_data

  !> The least rounding of pieces with edges or corners. Collective.
  subroutine find_least_rounding(comm, scene)
    type(communicator_t), intent(in) :: comm
    type(scene_t), intent(inout) :: scene
    real(dp) :: of_shape(scene%shapes%n)
    integer :: k, p

    do k = 1, scene%shapes%n
      of_shape(k) = scene%shapes%shape(k)%least_rounding()
    end do
    do k = 1, scene%grains%n
      if (scene%grains%shape(k) == 0) cycle
      associate (rounding => of_shape(scene%grains%shape(k)))
        if (rounding < huge(1.0_dp)) scene%least_rounding = min(scene%least_rounding, rounding*scene%grains%radius(k))
      end associate
    end do
    do p = 1, size(scene%insertions)
      if (.not. allocated(scene%insertions(p)%shape)) cycle
      do k = 1, size(scene%insertions(p)%shape)
        if (scene%insertions(p)%shape(k) == 0) cycle
        associate (rounding => of_shape(scene%insertions(p)%shape(k)))
          if (rounding < huge(1.0_dp)) scene%least_rounding = min(scene%least_rounding, &
            & rounding*scene%insertions(p)%radii%smallest())
        end associate
      end do
    end do
    scene%least_rounding = -comm%highest(-scene%least_rounding)
  end subroutine find_least_rounding

  !> Mass, inertia, shape and orientation of body `k`.
  subroutine set_mass(config, data, k, shapes, grains)
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    integer, intent(in) :: k
    type(shape_library_t), intent(in) :: shapes
    !> the radius is set
    type(body_set_t), intent(inout) :: grains
    integer :: number

    number = 0
    if (grains%no > 0) then
      number = data%shape(k)
      grains%shape(k) = number
      grains%orientation(:, k) = data%orientation(:, k)
    end if
    associate (mass => grains%mass(k), radius => grains%radius(k))
      if (allocated(data%mass)) then
        mass = data%mass(k)
      else if (number > 0) then
        mass = density_of(config, data%material(k))*shapes%volume_of(number)*radius**grains%nd
      else
        mass = grain_mass(grains%nd, radius, density_of(config, data%material(k)))
      end if
      if (grains%nv == grains%nd) return
      grains%inertia(k) = shapes%inertia(number, grains%nd, radius, mass)
    end associate
  end subroutine set_mass

end module gravier_scene
