!> From &boundary groups and the walls of a bodies file to boundaries.
module gravier_scene_boundaries
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_bodies_file, only: bodies_data_t
  use gravier_surface_registry, only: make_surface, wall_of_bodies
  use gravier_mesh_file, only: read_mesh
  use gravier_boundary, only: boundary_t
  use gravier_boundary_drive, only: boundary_drive_t, drive_names, drives_velocity, drives_spin, drives_force, drives_pressure
  use gravier_facing_planes, only: faces_along, open_axis, is_pressed
  use gravier_config_types, only: config_t, boundary_config_t
  use gravier_wall_side, only: wall_side_t, wall_side_of
  use gravier_config_surfaces, only: set_surface
  use gravier_config_laws, only: material_number
  implicit none
  private
  public :: make_boundaries, wall_name, check_pressures, check_pressed

  !> cosine of the angle to an axis within which the normal of a wall lies along it
  real(dp), parameter :: along_axis = 0.999_dp

contains

  !> Walls first, then the groups of the input file, with the identifiers that follow on the largest of `data`. A wall that a group
  !> names is a boundary of this group: it is none of `data` any more, keeps its identifier, and contacts of `data` know it by its
  !> new name. Errors are the same on all ranks. Collective.
  subroutine make_boundaries(comm, config, data, boundaries, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(inout) :: data
    type(boundary_t), allocatable, intent(out) :: boundaries(:)
    type(error_t), allocatable, intent(inout) :: error
    type(boundary_t) :: taken(size(config%boundaries))
    integer(i8) :: last_id
    integer :: w, b, nd

    nd = config%scene%dimension
    last_id = 0
    if (data%n > 0) last_id = maxval(data%id)
    if (data%n_walls > 0) last_id = max(last_id, maxval(data%wall_id))
    last_id = comm%largest(last_id)
    call take_walls(config, data, taken, error)
    call check_wall_names(config, data, error)
    if (allocated(error)) return
    allocate (boundaries(data%n_walls + size(config%boundaries)))
    do w = 1, data%n_walls
      associate (wall => boundaries(w))
        call make_wall(data, w, wall)
        wall%contact = config%scene%wall_contact
        wall%material = material_number(config, config%scene%wall_material)
      end associate
    end do
    do b = 1, size(config%boundaries)
      associate (boundary => boundaries(data%n_walls + b))
        boundary%id = last_id + b
        call set_boundary(config%boundaries(b), nd, boundary)
        if (allocated(taken(b)%surface)) then
          boundary%id = taken(b)%id
          call move_alloc(taken(b)%surface, boundary%surface)
          if (.not. config%boundaries(b)%pivot_given) boundary%pivot(:) = taken(b)%pivot
        end if
        boundary%material = material_number(config, config%boundaries(b)%material)
        if (boundary%is_faceted()) call read_facets(trim(config%boundaries(b)%file), nd, boundary, error)
        call read_table(trim(config%boundaries(b)%table), nd, config%boundaries(b)%table_repeats, boundary, error)
      end associate
    end do
    call comm%agree(error)
    do b = 1, size(boundaries)
      boundaries(b)%faces = faces_along(boundaries(b))
      if (allocated(error)) exit
      call boundaries(b)%prescribe(nd, 0.0_dp, config%time%step)
      if (b <= data%n_walls) cycle
      call check_table(boundaries(b), nd, trim(config%boundaries(b - data%n_walls)%table), error)
      call check_constants(boundaries(b), nd, config%file, trim(config%boundaries(b - data%n_walls)%table), error)
    end do
  end subroutine make_boundaries

  !> A plane of the bodies.
  subroutine make_wall(data, w, wall)
    type(bodies_data_t), intent(in) :: data
    integer, intent(in) :: w
    type(boundary_t), intent(inout) :: wall

    wall%id = data%wall_id(w)
    wall%name = wall_name(data%wall_id(w))
    call make_surface("plane", wall%surface)
    wall%surface%point(1:data%dimension) = data%wall_point(:, w)
    wall%pivot(:) = wall%surface%point
    wall%surface%axis(1:data%dimension) = data%wall_normal(:, w)
  end subroutine make_wall

  !> Take the walls that groups name out of the bodies.
  subroutine take_walls(config, data, taken, error)
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(inout) :: data
    !> those that groups are, the others without a surface (groups)
    type(boundary_t), intent(inout) :: taken(:)
    type(error_t), allocatable, intent(inout) :: error
    logical :: left(data%n_walls)
    integer :: b, w

    left(:) = .true.
    do b = 1, size(taken)
      if (config%boundaries(b)%shape /= wall_of_bodies) cycle
      call find_wall(config, b, data, w, error)
      if (allocated(error)) return
      if (.not. left(w)) then
        call raise(error, status_input, config%file//": &boundary '"//trim(config%boundaries(b)%name)//"' wall = '"// &
          & trim(config%boundaries(b)%wall)//"': expected a wall of its own, but another boundary is the wall "// &
          & to_text(data%wall_id(w))//", too")
        return
      end if
      left(w) = .false.
      call make_wall(data, w, taken(b))
      call data%contacts%rename_boundary(taken(b)%name, config%boundaries(b)%name)
    end do
    if (.not. all(left)) call keep_walls(left, data)
  end subroutine take_walls

  !> Leave some walls of the bodies out.
  subroutine keep_walls(kept, data)
    logical, intent(in) :: kept(:)
    type(bodies_data_t), intent(inout) :: data
    integer(i8), allocatable :: id(:)
    real(dp), allocatable :: point(:, :), normal(:, :)
    integer :: w, n

    allocate (id(count(kept)), point(data%dimension, count(kept)), normal(data%dimension, count(kept)))
    n = 0
    do w = 1, size(kept)
      if (.not. kept(w)) cycle
      n = n + 1
      id(n) = data%wall_id(w)
      point(:, n) = data%wall_point(:, w)
      normal(:, n) = data%wall_normal(:, w)
    end do
    data%n_walls = n
    call move_alloc(id, data%wall_id)
    call move_alloc(point, data%wall_point)
    call move_alloc(normal, data%wall_normal)
  end subroutine keep_walls

  !> The wall that a group names: the one on a side, whose normal lies along the axis, or the one with an identifier.
  subroutine find_wall(config, b, data, w, error)
    type(config_t), intent(in) :: config
    !> number of the group
    integer, intent(in) :: b
    type(bodies_data_t), intent(in) :: data
    integer, intent(out) :: w
    type(error_t), allocatable, intent(inout) :: error
    type(wall_side_t) :: side
    character(len=:), allocatable :: walls
    integer :: k, found

    side = wall_side_of(config%boundaries(b)%wall, data%dimension)
    w = 0
    found = 0
    walls = ""
    do k = 1, data%n_walls
      walls = walls//trim(merge(",", " ", k > 1))//" "//to_text(data%wall_id(k))//side_text(data%wall_normal(:, k))
      if (side%axis > 0) then
        if (-side%sign*data%wall_normal(side%axis, k) < along_axis) cycle
      else if (data%wall_id(k) /= side%id) then
        cycle
      end if
      found = found + 1
      w = k
    end do
    if (found == 1) return
    if (walls == "") then
      walls = "expected another shape, since the bodies bring no walls"
    else
      walls = to_text(found)//" walls of the bodies are meant; expected one of"//walls
    end if
    call raise(error, status_input, config%file//": &boundary '"//trim(config%boundaries(b)%name)//"' wall = '"// &
      & trim(config%boundaries(b)%wall)//"': "//walls)
  end subroutine find_wall

  !> The side of a wall with a normal towards the free side, in parentheses; nothing of one that leans.
  pure function side_text(normal) result(text)
    real(dp), intent(in) :: normal(:)
    character(len=:), allocatable :: text
    character(len=*), parameter :: axes = "xyz"
    integer :: d

    text = ""
    do d = 1, size(normal)
      if (abs(normal(d)) >= along_axis) text = " ("//merge("-", "+", normal(d) > 0.0_dp)//axes(d:d)//")"
    end do
  end function side_text

  !> The name of a wall of a bodies file, a lattice or a sample.
  pure function wall_name(id) result(name)
    integer(i8), intent(in) :: id
    character(len=:), allocatable :: name

    name = "wall "//to_text(id)
  end function wall_name

  !> Refuse a boundary with the name of a wall, which the walls of all ranks have.
  subroutine check_wall_names(config, data, error)
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer :: w, b

    do w = 1, data%n_walls
      name = wall_name(data%wall_id(w))
      do b = 1, size(config%boundaries)
        if (config%boundaries(b)%name == name) call raise(error, status_input, config%file//": &boundary name = '"//name// &
          & "': expected a name of its own, but the wall "//to_text(data%wall_id(w))//" of the scene has it too")
      end do
    end do
  end subroutine check_wall_names

  !> Read the facets of a boundary. Failures (status_input): as of read_mesh; no facet with an area or, in 2D, a length.
  subroutine read_facets(path, nd, boundary, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: nd
    type(boundary_t), intent(inout) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: facet(:, :, :)

    if (allocated(error)) return
    call read_mesh(path, nd, facet, error)
    if (allocated(error)) then
      error%message = "boundary '"//boundary%name//"': file: "//error%message
      return
    end if
    call boundary%surface%take_facets(facet)
    if (boundary%surface%n_facets() == 0) call raise(error, status_input, "boundary '"//boundary%name//"': file: "//path// &
      & ": expected a facet with "//trim(merge("a length", "an area ", nd == 2)))
  end subroutine read_facets

  !> Read the table of a drive, where there is one. Failures: as of the table, with the boundary.
  subroutine read_table(path, nd, repeats, boundary, error)
    !> empty without a table
    character(len=*), intent(in) :: path
    integer, intent(in) :: nd
    logical, intent(in) :: repeats
    type(boundary_t), intent(inout) :: boundary
    type(error_t), allocatable, intent(inout) :: error

    if (path == "" .or. allocated(error)) return
    call boundary%drive%table%read(path, drive_names(nd), repeats, error)
    if (.not. allocated(error)) return
    if (index(error%message, path//": ") == 1) error%message = path//": table of boundary '"//boundary%name//"': "// &
      & error%message(len(path) + 3:)
  end subroutine read_table

  !> Refuse a table with a column that would do nothing, or that turns what forces move.
  subroutine check_table(boundary, nd, path, error)
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: nd
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    integer :: d
    logical :: pressed, turned

    do d = 1, nd
      if (boundary%drive%gives(drives_velocity, d) .and. boundary%free(d)) call refuse("v"//axes(d), &
        & "no such column where this component is free")
      if (boundary%drive%gives(drives_force, d) .and. .not. boundary%free(d)) call refuse("f"//axes(d), &
        & "no such column where this component is not free")
    end do
    turned = boundary%drive%gives(drives_spin, 1) .or. boundary%drive%gives(drives_spin, 2) .or. &
      & boundary%drive%gives(drives_spin, 3)
    if (boundary%is_driven() .and. turned) call refuse("of a rotation rate", &
      & "no such column where a component of the translation is free")
    pressed = boundary%is_plane()
    if (pressed) pressed = any(boundary%free .and. abs(boundary%surface%axis) > 0.0_dp)
    if (boundary%drive%gives(drives_pressure, 1) .and. .not. pressed) call refuse("pressure", &
      & "no such column but for a plane of which a component along normal is free")

  contains

    subroutine refuse(column, expected)
      character(len=*), intent(in) :: column, expected

      call raise(error, status_input, path//": column "//column//": boundary '"//boundary%name//"': expected "//expected)
    end subroutine refuse

  end subroutine check_table

  !> Refuse a constant that would do nothing, since the table has a column for it. Along other axes constants stay in force.
  subroutine check_constants(boundary, nd, file, path, error)
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: nd
    !> of the case, and of the table
    character(len=*), intent(in) :: file, path
    type(error_t), allocatable, intent(inout) :: error
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    integer :: k

    associate (drive => boundary%drive)
      do k = 1, 3
        call look(drives_velocity, drive%velocity(k), "velocity", " along "//axes(k), "v"//axes(k))
        if (nd == 2) call look(drives_spin, drive%spin(k), "rotation", "", "omega")
        if (nd == 3) call look(drives_spin, drive%spin(k), "rotation", " about "//axes(k), "w"//axes(k))
        call look(drives_force, drive%force(k), "force", " along "//axes(k), "f"//axes(k))
      end do
      k = 1
      call look(drives_pressure, drive%pressure, "pressure", "", "pressure")
    end associate

  contains

    subroutine look(quantity, constant, key, axis, column)
      integer, intent(in) :: quantity
      real(dp), intent(in) :: constant
      character(len=*), intent(in) :: key, axis, column

      if (allocated(error) .or. .not. abs(constant) > 0.0_dp) return
      if (boundary%drive%gives(quantity, k)) call raise(error, status_input, file//": &boundary '"//boundary%name//"' "//key// &
        & ": "//to_text(constant, 4)//axis//": expected 0, since the column "//column//" of "//path//" replaces it")
    end subroutine look

  end subroutine check_constants

  !> Refuse a pressure whose area is not known.
  subroutine check_pressures(file, nd, period, boundaries, error)
    !> of the case
    character(len=*), intent(in) :: file
    integer, intent(in) :: nd
    !> 0 along axes that are not periodic [m]
    real(dp), intent(in) :: period(:)
    type(boundary_t), intent(in) :: boundaries(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: b

    do b = 1, size(boundaries)
      if (allocated(error)) return
      if (.not. is_pressed(boundaries(b))) cycle
      call check_pressed(boundaries, b, nd, period, error)
      if (allocated(error)) error%message = file//": "//error%message
    end do
  end subroutine check_pressures

  !> Refuse a pressure on plane `b` whose area is not known: it is the distance of planes that face each other, or a period, along
  !> each other axis.
  subroutine check_pressed(boundaries, b, nd, period, error)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: b, nd
    !> 0 along axes that are not periodic [m]
    real(dp), intent(in) :: period(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    integer :: axis

    axis = abs(faces_along(boundaries(b)))
    if (axis == 0) then
      call refuse("a plane whose normal lies along an axis")
      return
    end if
    axis = open_axis(boundaries, nd, period, axis)
    if (axis > 0) call refuse("two planes that face each other along "//axes(axis)//" in the whole run, or a period, because "// &
      & "their distance gives the area; or `force` instead")

  contains

    subroutine refuse(expected)
      character(len=*), intent(in) :: expected

      call raise(error, status_input, "boundary '"//boundaries(b)%name//"': pressure: expected "//expected)
    end subroutine refuse

  end subroutine check_pressed

  subroutine set_boundary(config, nd, boundary)
    type(boundary_config_t), intent(in) :: config
    integer, intent(in) :: nd
    type(boundary_t), intent(inout) :: boundary
    character(len=:), allocatable :: wrong, expected

    boundary%name = trim(config%name)
    boundary%pivot(:) = config%pivot
    boundary%group = config%group
    ! the values were checked
    call set_surface(config, boundary%surface, wrong, expected)
    where (config%free) boundary%velocity = config%velocity
    boundary%free(:) = config%free
    boundary%mass = config%mass
    boundary%contact = config%contact
    boundary%remove_at = config%remove_at
    call set_drive(config, nd, boundary%drive)
  end subroutine set_boundary

  !> What is prescribed of a boundary, but for what a table gives.
  subroutine set_drive(config, nd, drive)
    type(boundary_config_t), intent(in) :: config
    integer, intent(in) :: nd
    type(boundary_drive_t), intent(inout) :: drive

    where (.not. config%free) drive%velocity = config%velocity
    call take_rotation(config%rotation, drive%spin)
    call take_rotation(config%rotation_oscillation, drive%rotation_oscillation)
    drive%oscillation(:) = config%oscillation
    drive%frequency = config%frequency
    drive%phase = config%phase
    drive%force(:) = config%force
    drive%pressure = config%pressure

  contains

    !> In 2D the only entry of the input is the one about the third axis.
    subroutine take_rotation(entries, rotation)
      real(dp), intent(in) :: entries(3)
      real(dp), intent(out) :: rotation(3)

      rotation(:) = entries
      if (nd == 3) return
      rotation(3) = entries(1)
      rotation(1) = 0.0_dp
    end subroutine take_rotation

  end subroutine set_drive

end module gravier_scene_boundaries
