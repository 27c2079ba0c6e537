!> Bodies and walls from a comma-separated table: one row a body or plane, columns by name in any order.
module gravier_bodies_csv
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow, take_count
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, lower
  use gravier_magnitude, only: is_size, size_text
  use gravier_communicator, only: communicator_t
  use gravier_csv_table, only: csv_table_t
  use gravier_shape_library, only: shape_library_t
  use gravier_shape_names, only: find_shape, shape_names
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls, find_own_rows, make_unit
  use gravier_bodies_cells, only: read_id, read_number, read_positive, read_numbers, read_quantities, expect_nothing
  use gravier_body_turn, only: settle_turn, settle_radius, take_principal_axes, is_fine_turn, fine_turn_text
  implicit none
  private
  public :: read_bodies_csv

  !> Places of the columns in the table, 0 for a column that the file does not have.
  type :: layout_t
    integer :: id = 0, radius = 0, mass = 0, shape = 0, group = 0, material = 0, scale = 0
    !> (dimension)
    integer, allocatable :: position(:), normal(:)
    !> (3 or 6)
    integer, allocatable :: velocity(:)
    !> (1 or 4)
    integer, allocatable :: turn(:)
  end type layout_t

  !> what a row may be besides a shape of the library, whose number is above 0
  integer, parameter :: is_grain = 0, is_plane = -1

contains

  !> Read the rows of this rank and all walls. Two passes of the file on each rank, line by line: memory holds no more
  !> than the rows of the rank. Failure: status_input, with file, line, column, value and what was expected. Collective.
  subroutine read_bodies_csv(comm, path, dimension, shapes, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    !> that bodies may have; empty where all are disks or spheres
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(out) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    type(layout_t) :: layout
    integer(i8) :: n_grains, n_planes, first
    integer :: n, n_walls

    if (allocated(error)) return
    n_grains = 0
    n_planes = 0
    if (comm%rank == 0) then
      call open_table(table, path, dimension, shapes, layout, error)
      call count_rows(table, layout, shapes, n_grains, n_planes, error)
      call table%close()
    end if
    call comm%agree(error)
    if (allocated(error)) return
    bodies%total = comm%total(n_grains)
    call take_count(comm%total(n_planes), path//": planes", n_walls, error)
    call find_own_rows(comm, bodies%total, dimension, path, first, n, error)
    call open_table(table, path, dimension, shapes, layout, error)
    call allocate_bodies(bodies, dimension, n, layout%mass > 0, path, error)
    if (shapes%n > 0) call allocate_shapes(bodies, path, error)
    call allocate_walls(bodies, dimension, n_walls, path, error)
    call comm%agree(error)
    if (allocated(error)) then
      call table%close()
      return
    end if
    if (layout%mass > 0) bodies%mass(:) = 0.0_dp
    call read_rows(table, layout, shapes, first, bodies, error)
    call table%close()
    call comm%agree(error)
    call settle_masses(comm, path, bodies, error)
  end subroutine read_bodies_csv

  !> Open the table and find its columns.
  subroutine open_table(table, path, dimension, shapes, layout, error)
    type(csv_table_t), intent(inout) :: table
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(shape_library_t), intent(in) :: shapes
    type(layout_t), intent(out) :: layout
    type(error_t), allocatable, intent(inout) :: error

    call table%open(path, error)
    if (allocated(error)) return
    layout%id = table%column("id")
    layout%radius = table%column("radius")
    layout%mass = table%column("mass")
    layout%shape = table%column("shape")
    layout%group = table%column("group")
    layout%material = table%column("material")
    call find_columns(table, position_names(dimension), layout%position)
    call find_columns(table, normal_names(dimension), layout%normal)
    call find_columns(table, velocity_names(dimension), layout%velocity)
    allocate (layout%turn(0))
    if (shapes%n > 0) then
      layout%scale = table%column("scale")
      call find_columns(table, turn_names(dimension), layout%turn)
    end if
    call check_columns(table, dimension, shapes%n > 0, layout, error)
  end subroutine open_table

  !> Places of columns by their names, given with ", " between.
  pure subroutine find_columns(table, names, columns)
    type(csv_table_t), intent(in) :: table
    character(len=*), intent(in) :: names
    integer, allocatable, intent(out) :: columns(:)
    integer :: i, k, start, length

    i = 1
    do k = 1, len(names)
      if (names(k:k) == ",") i = i + 1
    end do
    allocate (columns(i))
    start = 1
    do k = 1, size(columns)
      length = index(names(start:)//",", ",") - 1
      columns(k) = table%column(names(start:start + length - 1))
      start = start + length + 2
    end do
  end subroutine find_columns

  pure function position_names(dimension) result(names)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: names
    names = "x, y"
    if (dimension == 3) names = "x, y, z"
  end function position_names

  pure function normal_names(dimension) result(names)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: names
    names = "nx, ny"
    if (dimension == 3) names = "nx, ny, nz"
  end function normal_names

  pure function velocity_names(dimension) result(names)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: names
    names = "vx, vy, omega"
    if (dimension == 3) names = "vx, vy, vz, wx, wy, wz"
  end function velocity_names

  pure function turn_names(dimension) result(names)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: names
    names = "angle"
    if (dimension == 3) names = "qw, qx, qy, qz"
  end function turn_names

  !> Refuse a table without the columns that every body needs, or with a column of no meaning.
  subroutine check_columns(table, dimension, shaped, layout, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: dimension
    !> the scene has a library of shapes
    logical, intent(in) :: shaped
    type(layout_t), intent(in) :: layout
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: known, required
    logical :: sized
    integer :: k

    required = "id, "//position_names(dimension)//", radius"
    known = required//", "//velocity_names(dimension)//", mass, shape, "//normal_names(dimension)//", group, material"
    if (shaped) known = known//", scale, "//turn_names(dimension)
    sized = layout%radius > 0
    if (shaped .and. layout%shape > 0) then
      sized = .true.
      required = required//" (or shape)"
    end if
    if (layout%id == 0 .or. .not. sized .or. any(layout%position == 0)) then
      call table%refuse_file("in "//to_text(dimension)//"D the columns "//required//" are required, but the first line is: "// &
        & header_text(table), error)
    end if
    do k = 1, table%column_count()
      if (k == layout%id .or. k == layout%radius .or. k == layout%mass .or. k == layout%shape .or. &
        & k == layout%group .or. k == layout%material .or. k == layout%scale) cycle
      if (any(k == layout%turn)) cycle
      if (any(k == layout%position) .or. any(k == layout%normal) .or. any(k == layout%velocity)) cycle
      call table%refuse_file("column "//table%column_name(k)//" is unknown in "//to_text(dimension)//"D; known are "//known, error)
      return
    end do
  end subroutine check_columns

  pure function header_text(table) result(text)
    type(csv_table_t), intent(in) :: table
    character(len=:), allocatable :: text
    integer :: k

    text = table%column_name(1)
    do k = 2, table%column_count()
      text = text//","//table%column_name(k)
    end do
  end function header_text

  !> Number of bodies and of planes in the table.
  subroutine count_rows(table, layout, shapes, n_grains, n_planes, error)
    type(csv_table_t), intent(inout) :: table
    type(layout_t), intent(in) :: layout
    type(shape_library_t), intent(in) :: shapes
    integer(i8), intent(inout) :: n_grains, n_planes
    type(error_t), allocatable, intent(inout) :: error
    integer :: what
    logical :: found

    do
      call table%next_row(found, error)
      if (.not. found .or. allocated(error)) return
      call get_shape(table, layout, shapes, what, error)
      if (what == is_plane) then
        n_planes = n_planes + 1
      else
        n_grains = n_grains + 1
      end if
    end do
  end subroutine count_rows

  !> What the row is: is_plane, is_grain, or the number of a shape.
  subroutine get_shape(table, layout, shapes, what, error)
    type(csv_table_t), intent(in) :: table
    type(layout_t), intent(in) :: layout
    type(shape_library_t), intent(in) :: shapes
    integer, intent(out) :: what
    type(error_t), allocatable, intent(inout) :: error

    what = is_grain
    if (table%is_empty(layout%shape)) return
    what = find_shape(shapes, table%get_text(layout%shape))
    if (what > 0) return
    select case (lower(table%get_text(layout%shape)))
    case ("plane")
      what = is_plane
    case ("grain")
      what = is_grain
    case ("disk", "sphere")
      if (shapes%n == 0) call table%refuse(layout%shape, "grain or plane", error)
    case default
      if (shapes%n == 0) then
        call table%refuse(layout%shape, "grain or plane", error)
      else
        call table%refuse(layout%shape, "grain, disk, sphere, plane or one of the shapes "//shape_names(shapes, ", "), error)
      end if
    end select
  end subroutine get_shape

  !> Read bodies `first` (from 0) and following, as many as there is room for, and all planes.
  subroutine read_rows(table, layout, shapes, first, bodies, error)
    type(csv_table_t), intent(inout) :: table
    type(layout_t), intent(in) :: layout
    type(shape_library_t), intent(in) :: shapes
    integer(i8), intent(in) :: first
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: grain
    integer :: wall, what, i
    logical :: found

    grain = 0
    wall = 0
    do
      call table%next_row(found, error)
      if (.not. found .or. allocated(error)) exit
      call get_shape(table, layout, shapes, what, error)
      if (what == is_plane) then
        wall = wall + 1
        if (wall <= bodies%n_walls) call read_plane(table, layout, wall, bodies, error)
      else
        grain = grain + 1
        if (grain <= first .or. grain > first + bodies%n) cycle
        i = narrow(grain - first)
        if (allocated(bodies%shape)) bodies%shape(i) = what
        call read_grain(table, layout, i, bodies, error)
        if (shapes%n > 0) call read_turn(table, layout, bodies%orientation(:, i), error)
        if (what > 0) call take_principal_axes(shapes%shape(what)%turn, bodies%orientation(:, i))
        call read_size(table, layout, shapes, what, bodies%radius(i), error)
      end if
    end do
    if (grain /= bodies%total .or. wall /= bodies%n_walls) then
      call table%refuse_file("this file is not the same for all ranks, or changed while it was read", error)
    end if
  end subroutine read_rows

  !> Read what a body has whatever its shape.
  subroutine read_grain(table, layout, i, bodies, error)
    type(csv_table_t), intent(in) :: table
    type(layout_t), intent(in) :: layout
    integer, intent(in) :: i
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error

    call read_id(table, layout%id, bodies%id(i), error)
    call read_quantities(table, layout%position, .true., bodies%position(:, i), error)
    call read_quantities(table, layout%velocity, .false., bodies%velocity(:, i), error)
    call expect_nothing(table, layout%normal, "a body (normals are of planes)", error)
    if (.not. table%is_empty(layout%mass)) call read_positive(table, layout%mass, "a mass > 0", bodies%mass(i), error)
    call read_number(table, layout%group, "a group", 0, bodies%group(i), error)
    call read_number(table, layout%material, "a material", 1, bodies%material(i), error)
  end subroutine read_grain

  !> Read the radius of a disk or a sphere, or the scale of a shape, from which its radius follows; either may say it.
  subroutine read_size(table, layout, shapes, number, radius, error)
    type(csv_table_t), intent(in) :: table
    type(layout_t), intent(in) :: layout
    type(shape_library_t), intent(in) :: shapes
    !> of the shape, 0 for a disk or a sphere
    integer, intent(in) :: number
    real(dp), intent(inout) :: radius
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: scale
    logical :: agrees

    if (allocated(error)) return
    if (number == 0) then
      if (layout%radius == 0) then
        call table%refuse(layout%shape, "a shape (a disk or a sphere needs the column radius)", error)
      else
        call read_positive(table, layout%radius, "a radius > 0", radius, error)
      end if
      if (.not. table%is_empty(layout%scale)) call table%refuse(layout%scale, "an empty cell for a body without a shape", error)
      return
    end if
    scale = 1.0_dp
    radius = 0.0_dp
    if (.not. table%is_empty(layout%scale)) call read_positive(table, layout%scale, "a scale > 0", scale, error)
    if (.not. table%is_empty(layout%radius)) call read_positive(table, layout%radius, "a radius > 0", radius, error)
    if (allocated(error)) return
    call settle_radius(shapes%shape(number)%size, scale, .not. table%is_empty(layout%scale), radius, agrees)
    if (.not. agrees) then
      call table%refuse(layout%radius, "an empty cell, or the radius of the shape, which is "// &
        & to_text(scale*shapes%shape(number)%size)//" at this scale,", error)
    else if (.not. is_size(radius)) then
      call table%refuse(layout%shape, "a scale that makes a radius that is "//size_text, error)
    end if
  end subroutine read_size

  !> Read how a body is turned; a row that does not say it is not.
  subroutine read_turn(table, layout, turn, error)
    type(csv_table_t), intent(in) :: table
    type(layout_t), intent(in) :: layout
    !> angle or quaternion
    real(dp), intent(inout) :: turn(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: given(size(turn))
    logical :: possible, said
    integer :: k

    said = .false.
    do k = 1, size(turn)
      said = said .or. .not. table%is_empty(layout%turn(k))
    end do
    if (.not. said) return
    given(:) = 0.0_dp
    call read_quantities(table, layout%turn, .false., given, error)
    if (allocated(error)) return
    turn(:) = given
    if (.not. is_fine_turn(turn)) call table%refuse(layout%turn(1), fine_turn_text, error)
    call settle_turn(turn, possible)
    if (.not. possible) call table%refuse(layout%turn(maxloc(layout%turn, dim=1)), "a quaternion that is not zero", error)
  end subroutine read_turn

  subroutine read_plane(table, layout, i, bodies, error)
    type(csv_table_t), intent(in) :: table
    type(layout_t), intent(in) :: layout
    integer, intent(in) :: i
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: turn(4)
    integer :: number, others(4)
    logical :: possible

    call read_id(table, layout%id, bodies%wall_id(i), error)
    call read_quantities(table, layout%position, .true., bodies%wall_point(:, i), error)
    call expect_nothing(table, layout%velocity, "a plane, which stands still,", error)
    others(1) = layout%radius
    others(2) = layout%mass
    others(3) = layout%scale
    others(4) = layout%group
    call expect_nothing(table, others, "a plane", error)
    ! a real part alone is no turn
    call read_numbers(table, layout%turn, .false., turn, error)
    call expect_nothing(table, layout%turn(merge(2, 1, size(layout%turn) == 4):), "a plane", error)
    call read_number(table, layout%material, "a material", 1, number, error)
    if (number > 1) call table%refuse(layout%material, "an empty cell or 1 in the row of a plane, whose material is "// &
      & "wall_material of &scene,", error)
    if (any(layout%normal == 0)) then
      call table%refuse(layout%shape, "a grain (a plane needs the columns "//normal_names(bodies%dimension)//")", error)
      return
    end if
    call read_numbers(table, layout%normal, .true., bodies%wall_normal(:, i), error)
    if (allocated(error)) return
    call make_unit(bodies%wall_normal(:, i), possible)
    if (.not. possible) call table%refuse(layout%normal(1), "a normal that is not zero", error)
  end subroutine read_plane

  !> All bodies have a mass or none has: with none the masses are left to the caller.
  subroutine settle_masses(comm, path, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (allocated(error) .or. .not. allocated(bodies%mass)) return
    if (.not. comm%any_true(any(bodies%mass > 0))) then
      deallocate (bodies%mass)
      return
    end if
    do i = 1, bodies%n
      if (bodies%mass(i) > 0) cycle
      call raise(error, status_input, path//": id "//to_text(bodies%id(i))//": column mass: empty, but other bodies "// &
        & "have a mass; a mass for all or for none was expected")
      exit
    end do
    call comm%agree(error)
  end subroutine settle_masses

end module gravier_bodies_csv
