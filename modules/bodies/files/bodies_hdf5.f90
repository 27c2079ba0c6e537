!> Bodies and walls from and to HDF5: /bodies/{id, position, velocity, radius, mass, group, material, shape, scale, orientation},
!> /walls/{id, point, normal}, /box/{origin, period, edge, velocity} and /contacts (gravier_bodies_contacts).
module gravier_bodies_hdf5
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow, take_count
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_shape_library, only: shape_library_t
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls, find_own_rows, make_unit
  use gravier_bodies_checks, only: check_ids, check_own_ids, check_numbers, check_own_numbers, check_whole, check_box, &
    & refuse_bad_numbers, direction, quantity, extent
  use gravier_bodies_shapes, only: read_body_shapes, write_body_shapes
  use gravier_given_contacts, only: check_known_bodies
  use gravier_bodies_contacts, only: contact_sets, read_contacts, write_contacts, contact_words
  implicit none
  private
  public :: read_bodies_hdf5, write_bodies_hdf5, holds_bodies

  character(len=*), parameter :: body_sets(7) = [character(len=8) :: "id", "position", "velocity", "radius", "mass", "group", &
    & "material"]
  !> those of scenes that have shapes
  character(len=*), parameter :: shaped_sets(10) = [character(len=11) :: body_sets, "shape", "scale", "orientation"]
  character(len=*), parameter :: wall_sets(3) = [character(len=8) :: "id", "point", "normal"]
  character(len=*), parameter :: box_sets(4) = [character(len=8) :: "origin", "period", "edge", "velocity"]
  character(len=*), parameter :: form_of_edges = "rows with parts along their own axis and the axes before it alone, as far as "// &
    & "these are periodic"
  !> room for the headers of the file
  integer(i8), parameter :: bytes_of_headers = 65536
  integer, parameter :: bytes_of_word = 8

contains

  !> Read the rows of this rank and all walls. Failure: status_input, with file, dataset, row or id, and what was
  !> expected. Collective.
  subroutine read_bodies_hdf5(comm, path, dimension, shapes, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    !> that bodies may have; empty where all are disks or spheres
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(out) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file

    call file%open(comm, path, error)
    if (allocated(error)) return
    if (shapes%n > 0) then
      call check_members(file, path, "/bodies", shaped_sets, error)
    else
      call check_members(file, path, "/bodies", body_sets, error)
    end if
    if (file%exists("/walls")) call check_members(file, path, "/walls", wall_sets, error)
    if (file%exists("/box")) call check_members(file, path, "/box", box_sets, error)
    if (file%exists("/contacts")) call check_members(file, path, "/contacts", contact_sets, error)
    call read_grains(comm, file, path, dimension, shapes, bodies, error)
    call comm%agree(error)
    call read_walls(file, path, dimension, bodies, error)
    call read_box(file, path, dimension, bodies, error)
    call comm%agree(error)
    if (file%exists("/contacts") .and. .not. allocated(error)) then
      call read_contacts(comm, file, path, dimension, bodies%contacts, error)
      call check_known_bodies(comm, bodies%id, bodies%contacts, error)
    end if
    call file%close(error)
  end subroutine read_bodies_hdf5

  !> Refuse a file without the group, or with something in it that has no meaning.
  subroutine check_members(file, path, group, known, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path, group
    character(len=*), intent(in) :: known(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer :: i

    if (allocated(error)) return
    if (.not. file%exists(group)) then
      call raise(error, status_input, path//": "//group//": missing; a group with"//listed(known)//" was expected")
      return
    end if
    do i = 1, file%member_count(group)
      name = file%member(group, i)
      if (any(known == name)) cycle
      call raise(error, status_input, path//": "//group//"/"//name//": unknown; known are"//listed(known))
      return
    end do
  end subroutine check_members

  pure function listed(names) result(text)
    character(len=*), intent(in) :: names(:)
    character(len=:), allocatable :: text
    integer :: i

    text = " "//trim(names(1))
    do i = 2, size(names)
      text = text//", "//trim(names(i))
    end do
  end function listed

  subroutine read_grains(comm, file, path, dimension, shapes, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: first
    integer :: n
    logical :: sized, required(size(shaped_sets))

    ! the scale of a shape says its radius
    sized = .false.
    if (shapes%n > 0) sized = file%exists("/bodies/scale")
    if (sized) sized = .not. file%exists("/bodies/radius")
    required(:) = .false.
    required(1:2) = .true.
    required(4) = .not. sized
    call check_lengths(file, path, "/bodies", shaped_sets, required, bodies%total, error)
    if (allocated(error)) return
    call find_own_rows(comm, bodies%total, dimension, path//": /bodies", first, n, error)
    call allocate_bodies(bodies, dimension, n, file%exists("/bodies/mass"), path//": /bodies", error)
    call comm%agree(error)
    if (allocated(error)) return
    call file%read_rows("/bodies/id", first, bodies%id, error)
    call check_ids(comm, path//": /bodies/id", first, bodies%id, error)
    call file%read_rows("/bodies/position", first, bodies%position, error)
    call check_numbers(comm, path//": /bodies/position", dimension, bodies%id, bodies%position, quantity, error)
    bodies%radius(:) = 0.0_dp
    if (.not. sized) call file%read_rows("/bodies/radius", first, bodies%radius, error)
    if (shapes%n > 0) call allocate_shapes(bodies, path//": /bodies", error)
    if (shapes%n > 0) call read_body_shapes(comm, file, path, first, shapes, bodies, error)
    call check_numbers(comm, path//": /bodies/radius", 1, bodies%id, bodies%radius, extent, error)
    if (file%exists("/bodies/velocity")) then
      call file%read_rows("/bodies/velocity", first, bodies%velocity, error)
      call check_numbers(comm, path//": /bodies/velocity", size(bodies%velocity, 1), bodies%id, bodies%velocity, quantity, error)
    end if
    if (file%exists("/bodies/mass")) then
      call file%read_rows("/bodies/mass", first, bodies%mass, error)
      call check_numbers(comm, path//": /bodies/mass", 1, bodies%id, bodies%mass, extent, error)
    end if
    if (file%exists("/bodies/group")) call read_places("group", 0, bodies%group)
    if (file%exists("/bodies/material")) call read_places("material", 1, bodies%material)

  contains

    !> Numbers of groups, or of materials.
    subroutine read_places(name, least, numbers)
      character(len=*), intent(in) :: name
      integer, intent(in) :: least
      integer, intent(inout) :: numbers(:)
      integer(i8), allocatable :: values(:)

      if (allocated(error)) return
      allocate (values(bodies%n), source=0_i8)
      call file%read_rows("/bodies/"//name, first, values, error)
      call check_whole(comm, path, name, least, bodies%id, values, error)
      if (allocated(error)) return
      numbers(:) = narrow(values)
    end subroutine read_places

  end subroutine read_grains

  !> Read the periodic box, if the file has one; the same on all ranks.
  subroutine read_box(file, path, dimension, bodies, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: n
    logical :: required(size(box_sets))

    if (allocated(error)) return
    bodies%has_box = file%exists("/box")
    if (.not. bodies%has_box) return
    required(:) = [.true., .true., .false., .false.]
    required(3) = file%exists("/box/velocity")
    call check_lengths(file, path, "/box", box_sets, required, n, error)
    if (allocated(error)) return
    if (n /= dimension) then
      call raise(error, status_input, path//": /box/origin: "//to_text(n)//" numbers, but "//to_text(dimension)// &
        & " were expected")
      return
    end if
    call file%read_rows("/box/origin", 0_i8, bodies%origin(1:dimension), error)
    call file%read_rows("/box/period", 0_i8, bodies%period(1:dimension), error)
    bodies%has_edges = file%exists("/box/edge")
    if (bodies%has_edges) call read_edges(file, path, dimension, bodies, error)
    call check_box(path, bodies, error)
  end subroutine read_box

  !> Read the edges of a cell, a row each, and their velocities, 0 where the file has none.
  subroutine read_edges(file, path, dimension, bodies, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: edge(dimension, dimension), velocity(dimension, dimension), length(3)

    velocity(:, :) = 0.0_dp
    call file%read_rows("/box/edge", 0_i8, edge, error)
    if (file%exists("/box/velocity")) call file%read_rows("/box/velocity", 0_i8, velocity, error)
    if (allocated(error)) return
    call split_edges(edge, length, bodies%tilt)
    if (.not. all(abs(length - bodies%period) <= 0.0_dp)) call raise(error, status_input, path//": /box/edge: lengths "// &
      & "along the axes that are not those of /box/period")
    call split_edges(velocity, bodies%length_rate, bodies%tilt_rate)
    if (has_other_parts(edge, bodies%period)) call raise(error, status_input, path//": /box/edge: expected "//form_of_edges)
    if (has_other_parts(velocity, bodies%period)) call raise(error, status_input, path//": /box/velocity: expected "//form_of_edges)
  end subroutine read_edges

  !> What edges, in columns, have along their own axes, and along the axes before: b along x, c along x, c along y.
  pure subroutine split_edges(edge, length, tilt)
    real(dp), intent(in) :: edge(:, :)
    real(dp), intent(out) :: length(3), tilt(3)
    integer :: d

    length(:) = 0.0_dp
    tilt(:) = 0.0_dp
    do d = 1, size(edge, 1)
      length(d) = edge(d, d)
    end do
    tilt(1) = edge(1, 2)
    if (size(edge, 1) == 3) tilt(2:3) = edge(1:2, 3)
  end subroutine split_edges

  !> The edges of split_edges.
  pure subroutine join_edges(length, tilt, edge)
    real(dp), intent(in) :: length(3), tilt(3)
    real(dp), intent(out) :: edge(:, :)
    integer :: d

    edge(:, :) = 0.0_dp
    do d = 1, size(edge, 1)
      edge(d, d) = length(d)
    end do
    edge(1, 2) = tilt(1)
    if (size(edge, 1) == 3) edge(1:2, 3) = tilt(2:3)
  end subroutine join_edges

  !> Whether edges, or their velocities, have parts along axes after their own, or where an axis is not periodic. A number that is
  !> none is no such part.
  pure logical function has_other_parts(edge, period)
    real(dp), intent(in) :: edge(:, :), period(3)
    integer :: a, b

    has_other_parts = .false.
    do b = 1, size(edge, 1)
      do a = 1, size(edge, 1)
        if (a <= b .and. period(a) > 0.0_dp .and. period(b) > 0.0_dp) cycle
        has_other_parts = has_other_parts .or. abs(edge(a, b)) > 0.0_dp
      end do
    end do
  end function has_other_parts

  !> Every rank reads all walls.
  subroutine read_walls(file, path, dimension, bodies, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: rows
    integer :: n, i
    logical :: possible

    if (allocated(error)) return
    rows = 0
    if (file%exists("/walls")) call check_lengths(file, path, "/walls", wall_sets, [.true., .true., .true.], rows, error)
    call take_count(rows, path//": /walls/id: rows", n, error)
    call allocate_walls(bodies, dimension, n, path//": /walls", error)
    call file%comm%agree(error)
    if (allocated(error) .or. n == 0) return
    call file%read_rows("/walls/id", 0_i8, bodies%wall_id, error)
    call file%read_rows("/walls/point", 0_i8, bodies%wall_point, error)
    call file%read_rows("/walls/normal", 0_i8, bodies%wall_normal, error)
    if (allocated(error)) return
    call check_own_ids(path//": /walls/id", 0_i8, bodies%wall_id, error)
    call check_own_numbers(path//": /walls/point", dimension, bodies%wall_id, bodies%wall_point, quantity, error)
    call check_own_numbers(path//": /walls/normal", dimension, bodies%wall_id, bodies%wall_normal, direction, error)
    if (allocated(error)) return
    do i = 1, bodies%n_walls
      call make_unit(bodies%wall_normal(:, i), possible)
      if (possible) cycle
      call raise(error, status_input, path//": /walls/normal: id "//to_text(bodies%wall_id(i))// &
        & ": zero, but a normal that is not zero was expected")
      return
    end do
  end subroutine read_walls

  !> Number of rows of a group's datasets, which must be equal; `required` tells which ones must be there.
  subroutine check_lengths(file, path, group, names, required, n, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path, group
    character(len=*), intent(in) :: names(:)
    logical, intent(in) :: required(:)
    integer(i8), intent(out) :: n
    type(error_t), allocatable, intent(inout) :: error
    character(len=40) :: name
    integer(i8) :: rows
    integer :: i

    n = 0
    do i = 1, size(names)
      name = group//"/"//names(i)
      if (.not. required(i)) then
        if (.not. file%exists(trim(name))) cycle
      end if
      call file%row_count(trim(name), rows, error)
      if (allocated(error)) return
      if (i == 1) n = rows
      if (rows == n) cycle
      call raise(error, status_input, path//": "//trim(name)//": "//to_text(rows)//" rows, but "//group// &
        & "/"//trim(names(1))//" has "//to_text(n))
      return
    end do
  end subroutine check_lengths

  !> Write the bodies of all ranks in the order of the ids, the walls, groups where a grain has one, materials where
  !> one is not the first, and the box. The
  !> file appears under its name only when it is complete. Failure: status_failure; what had that name before is left as
  !> it was. Collective.
  subroutine write_bodies_hdf5(comm, path, bodies, error, shapes)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    !> of the bodies, where they have any
    type(shape_library_t), intent(in), optional :: shapes
    type(h5_file_t) :: file
    type(bodies_data_t) :: sorted
    integer :: words

    if (allocated(error)) return
    call sort_by_id(comm, bodies, sorted)
    call refuse_bad_numbers(comm, path, sorted, error)
    if (allocated(error)) return
    call file%create(comm, path, error)
    words = 5 + 4*sorted%dimension
    if (allocated(sorted%shape)) words = words + 2 + size(sorted%orientation, 1)
    call file%reserve(bytes_of_headers + bytes_of_word*(sorted%total*words + sorted%n_walls*(1_i8 + 2*sorted%dimension) + &
      & bodies%contacts%total*contact_words(sorted%dimension)), error)
    if (allocated(bodies%made_by)) call file%write_attribute("/", "made_by", bodies%made_by, error)
    call write_groups(comm, file, sorted, error)
    if (bodies%contacts%total > 0) call write_contacts(comm, file, bodies%contacts, error)
    if (present(shapes) .and. allocated(sorted%shape)) call write_body_shapes(file, sorted, shapes, error)
    call file%close(error)
  end subroutine write_bodies_hdf5

  !> Whether there is a file that holds these very bodies: the same identifiers, places and velocities to the last bit. Collective.
  logical function holds_bodies(comm, path, shapes, bodies) result(holds)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> of the bodies; empty where all are disks or spheres
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(in) :: bodies
    type(bodies_data_t) :: found, sorted_found, sorted
    type(error_t), allocatable :: none
    logical :: exists

    exists = .false.
    if (comm%rank == 0) inquire (file=path, exist=exists)
    holds = comm%any_true(exists)
    if (.not. holds) return
    call read_bodies_hdf5(comm, path, bodies%dimension, shapes, found, none)
    holds = .not. allocated(none)
    if (.not. holds) return
    call sort_by_id(comm, found, sorted_found)
    call sort_by_id(comm, bodies, sorted)
    holds = sorted_found%n == sorted%n
    if (holds) holds = all(sorted_found%id == sorted%id)
    if (holds) holds = .not. any(abs(sorted_found%position - sorted%position) > 0.0_dp)
    if (holds) holds = .not. any(abs(sorted_found%velocity - sorted%velocity) > 0.0_dp)
    holds = .not. comm%any_true(.not. holds)
  end function holds_bodies

  subroutine write_groups(comm, file, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(inout) :: file
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: numbers(:)
    integer :: n

    call file%make_group("/bodies", error)
    call file%write_rows("/bodies/id", bodies%id, error)
    call file%write_rows("/bodies/position", bodies%position, error)
    call file%write_attribute("/bodies/position", "unit", "m", error)
    call file%write_rows("/bodies/velocity", bodies%velocity, error)
    call file%write_attribute("/bodies/velocity", "unit", "m/s, rad/s", error)
    call file%write_rows("/bodies/radius", bodies%radius, error)
    call file%write_attribute("/bodies/radius", "unit", "m", error)
    if (allocated(bodies%mass)) then
      call file%write_rows("/bodies/mass", bodies%mass, error)
      call file%write_attribute("/bodies/mass", "unit", "kg", error)
    end if
    numbers = bodies%group
    if (comm%any_true(any(numbers > 0))) call file%write_rows("/bodies/group", numbers, error)
    numbers = bodies%material
    if (comm%any_true(any(numbers > 1))) call file%write_rows("/bodies/material", numbers, error)
    if (bodies%has_box) call write_box(comm, file, bodies, error)
    if (bodies%n_walls == 0) return
    n = merge(bodies%n_walls, 0, comm%rank == 0)
    call file%make_group("/walls", error)
    call file%write_rows("/walls/id", bodies%wall_id(1:n), error)
    call file%write_rows("/walls/point", bodies%wall_point(:, 1:n), error)
    call file%write_attribute("/walls/point", "unit", "m", error)
    call file%write_rows("/walls/normal", bodies%wall_normal(:, 1:n), error)
  end subroutine write_groups

  subroutine write_box(comm, file, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(inout) :: file
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: edge(bodies%dimension, bodies%dimension)
    integer :: n

    n = merge(bodies%dimension, 0, comm%rank == 0)
    call file%make_group("/box", error)
    call file%write_rows("/box/origin", bodies%origin(1:n), error)
    call file%write_attribute("/box/origin", "unit", "m", error)
    call file%write_rows("/box/period", bodies%period(1:n), error)
    call file%write_attribute("/box/period", "unit", "m", error)
    if (.not. bodies%has_edges) return
    call join_edges(bodies%period, bodies%tilt, edge)
    call file%write_rows("/box/edge", edge(:, 1:n), error)
    call file%write_attribute("/box/edge", "unit", "m", error)
    call join_edges(bodies%length_rate, bodies%tilt_rate, edge)
    call file%write_rows("/box/velocity", edge(:, 1:n), error)
    call file%write_attribute("/box/velocity", "unit", "m/s", error)
  end subroutine write_box

  !> The bodies of all ranks in the order of the ids, cut into equal blocks.
  subroutine sort_by_id(comm, bodies, sorted)
    type(communicator_t), intent(in) :: comm
    type(bodies_data_t), intent(in) :: bodies
    type(bodies_data_t), intent(out) :: sorted
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: column(:, :)
    integer :: nd, nv, no

    nd = bodies%dimension
    nv = size(bodies%velocity, 1)
    no = 0
    if (allocated(bodies%shape)) no = size(bodies%orientation, 1)
    allocate (records(merge(6, 5, no > 0) + nd + nv + no, bodies%n), source=0_i8)
    records(1, :) = bodies%id
    call pack_reals(1, bodies%radius, 2, records)
    if (allocated(bodies%mass)) call pack_reals(1, bodies%mass, 3, records)
    call pack_reals(nd, bodies%position, 4, records)
    call pack_reals(nv, bodies%velocity, 4 + nd, records)
    records(4 + nd + nv, :) = bodies%group
    records(5 + nd + nv, :) = bodies%material
    if (no > 0) then
      records(6 + nd + nv, :) = bodies%shape
      call pack_reals(no, bodies%orientation, 7 + nd + nv, records)
    end if
    call order_rows(comm, 1, records, ordered)
    sorted%dimension = nd
    sorted%n = size(ordered, 2)
    sorted%total = comm%total(int(bodies%n, i8))
    sorted%id = ordered(1, :)
    call unpack_reals(ordered, 2, 1, column)
    sorted%radius = column(1, :)
    if (allocated(bodies%mass)) then
      call unpack_reals(ordered, 3, 1, column)
      sorted%mass = column(1, :)
    end if
    call unpack_reals(ordered, 4, nd, sorted%position)
    call unpack_reals(ordered, 4 + nd, nv, sorted%velocity)
    sorted%group = narrow(ordered(4 + nd + nv, :))
    sorted%material = narrow(ordered(5 + nd + nv, :))
    if (no > 0) then
      sorted%shape = narrow(ordered(6 + nd + nv, :))
      call unpack_reals(ordered, 7 + nd + nv, no, sorted%orientation)
    end if
    sorted%n_walls = bodies%n_walls
    sorted%wall_id = bodies%wall_id
    sorted%wall_point = bodies%wall_point
    sorted%wall_normal = bodies%wall_normal
    sorted%has_box = bodies%has_box
    sorted%origin = bodies%origin
    sorted%period = bodies%period
    sorted%has_edges = bodies%has_edges
    sorted%tilt = bodies%tilt
    sorted%length_rate = bodies%length_rate
    sorted%tilt_rate = bodies%tilt_rate
  end subroutine sort_by_id

end module gravier_bodies_hdf5
