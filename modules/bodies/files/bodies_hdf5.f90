!> Bodies and walls from and to HDF5: /bodies/{id, position, velocity, radius, mass, group, material}, /walls/{id, point,
!> normal} and /box/{origin, period}.
module gravier_bodies_hdf5
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow, take_count
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, is_size, bounded_text, size_text
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_hdf5_file, only: h5_file_t
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_walls, find_own_rows, make_unit
  implicit none
  private
  public :: read_bodies_hdf5, write_bodies_hdf5

  character(len=*), parameter :: body_sets(7) = [character(len=8) :: "id", "position", "velocity", "radius", "mass", "group", &
    & "material"]
  character(len=*), parameter :: wall_sets(3) = [character(len=8) :: "id", "point", "normal"]
  character(len=*), parameter :: box_sets(2) = [character(len=8) :: "origin", "period"]
  !> kinds of numbers: any of which only ratios count; of a place or velocity; of a size above 0
  integer, parameter :: direction = 0, quantity = 1, extent = 2
  !> room for the headers of the file
  integer(i8), parameter :: bytes_of_headers = 65536
  integer, parameter :: bytes_of_word = 8

contains

  !> Read the rows of this rank and all walls. Failure: status_input, with file, dataset, row or id, and what was
  !> expected. Collective.
  subroutine read_bodies_hdf5(comm, path, dimension, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(out) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file

    call file%open(comm, path, error)
    if (allocated(error)) return
    call check_members(file, path, "/bodies", body_sets, error)
    if (file%exists("/walls")) call check_members(file, path, "/walls", wall_sets, error)
    if (file%exists("/box")) call check_members(file, path, "/box", box_sets, error)
    call read_grains(comm, file, path, dimension, bodies, error)
    call comm%agree(error)
    call read_walls(file, path, dimension, bodies, error)
    call read_box(file, path, dimension, bodies, error)
    call comm%agree(error)
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

  subroutine read_grains(comm, file, path, dimension, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: first
    integer :: n

    call check_lengths(file, path, "/bodies", body_sets, [.true., .true., .false., .true., .false., .false., .false.], &
      & bodies%total, error)
    if (allocated(error)) return
    call find_own_rows(comm, bodies%total, dimension, path//": /bodies", first, n, error)
    call allocate_bodies(bodies, dimension, n, file%exists("/bodies/mass"), path//": /bodies", error)
    call comm%agree(error)
    if (allocated(error)) return
    call file%read_rows("/bodies/id", first, bodies%id, error)
    call check_ids(comm, path//": /bodies/id", first, bodies%id, error)
    call file%read_rows("/bodies/position", first, bodies%position, error)
    call check_numbers(comm, path//": /bodies/position", dimension, bodies%id, bodies%position, quantity, error)
    call file%read_rows("/bodies/radius", first, bodies%radius, error)
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

    if (allocated(error)) return
    bodies%has_box = file%exists("/box")
    if (.not. bodies%has_box) return
    call check_lengths(file, path, "/box", box_sets, [.true., .true.], n, error)
    if (allocated(error)) return
    if (n /= dimension) then
      call raise(error, status_input, path//": /box/origin: "//to_text(n)//" numbers, but "//to_text(dimension)// &
        & " were expected")
      return
    end if
    call file%read_rows("/box/origin", 0_i8, bodies%origin(1:dimension), error)
    call file%read_rows("/box/period", 0_i8, bodies%period(1:dimension), error)
    call check_box(path, bodies, error)
  end subroutine read_box

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

  subroutine check_ids(comm, place, first, id, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: place
    integer(i8), intent(in) :: first
    integer(i8), intent(in), contiguous :: id(:)
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call check_own_ids(place, first, id, error)
    call comm%agree(error)
  end subroutine check_ids

  !> Refuse ids below 1.
  subroutine check_own_ids(place, first, id, error)
    character(len=*), intent(in) :: place
    integer(i8), intent(in) :: first
    integer(i8), intent(in), contiguous :: id(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    do i = 1, size(id)
      if (id(i) >= 1) cycle
      call raise(error, status_input, place//": row "//to_text(first + i - 1)//" (counted from 0): "//to_text(id(i))// &
        & ", but an id >= 1 was expected")
      return
    end do
  end subroutine check_own_ids

  subroutine check_numbers(comm, place, n_columns, id, values, kind, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: place
    integer, intent(in) :: n_columns
    integer(i8), intent(in), contiguous :: id(:)
    real(dp), intent(in) :: values(n_columns, size(id))
    !> direction, quantity or extent
    integer, intent(in) :: kind
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call check_own_numbers(place, n_columns, id, values, kind, error)
    call comm%agree(error)
  end subroutine check_numbers

  !> Refuse NaN and infinity, and numbers that are not of the kind.
  subroutine check_own_numbers(place, n_columns, id, values, kind, error)
    character(len=*), intent(in) :: place
    integer, intent(in) :: n_columns
    integer(i8), intent(in), contiguous :: id(:)
    real(dp), intent(in) :: values(n_columns, size(id))
    !> direction, quantity or extent
    integer, intent(in) :: kind
    type(error_t), allocatable, intent(inout) :: error
    integer :: i, k

    if (allocated(error)) return
    do i = 1, size(id)
      do k = 1, n_columns
        if (.not. is_finite(values(k, i))) then
          call raise(error, status_input, place//": id "//to_text(id(i))//": NaN or infinity, but a finite number was expected")
          return
        else if (kind == extent .and. .not. values(k, i) > 0) then
          call raise(error, status_input, place//": id "//to_text(id(i))//": "//to_text(values(k, i))// &
            & ", but a number > 0 was expected")
          return
        else if (kind == extent .and. .not. is_size(values(k, i))) then
          call raise(error, status_input, place//": id "//to_text(id(i))//": "//to_text(values(k, i))//", but "//size_text// &
            & " was expected")
          return
        else if (kind == quantity .and. .not. is_bounded(values(k, i))) then
          call raise(error, status_input, place//": id "//to_text(id(i))//": "//to_text(values(k, i))//", but "//bounded_text// &
            & " was expected")
          return
        end if
      end do
    end do
  end subroutine check_own_numbers

  !> Refuse a number of a group or a material that is below the least one or too large.
  subroutine check_whole(comm, path, name, least, id, values, error)
    type(communicator_t), intent(in) :: comm
    !> of the file; of the dataset
    character(len=*), intent(in) :: path, name
    integer, intent(in) :: least
    integer(i8), intent(in), contiguous :: id(:), values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (allocated(error)) return
    do i = 1, size(id)
      if (values(i) >= least .and. values(i) <= huge(i)) cycle
      call raise(error, status_input, path//": /bodies/"//name//": id "//to_text(id(i))//": "//to_text(values(i))//", but a "// &
        & name//" from "//to_text(least)//" to "//to_text(huge(i))//" was expected")
      exit
    end do
    call comm%agree(error)
  end subroutine check_whole

  !> Refuse a box that is not finite or has a negative length.
  subroutine check_box(path, bodies, error)
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (.not. all(is_finite(bodies%origin))) then
      call raise(error, status_input, path//": /box/origin: NaN or infinity, but finite numbers were expected")
    else if (.not. all(is_finite(bodies%period))) then
      call raise(error, status_input, path//": /box/period: NaN or infinity, but finite numbers were expected")
    else if (any(bodies%period < 0)) then
      call raise(error, status_input, path//": /box/period: "//to_text(minval(bodies%period))// &
        & ", but a number >= 0 was expected")
    else if (.not. all(is_bounded(bodies%origin))) then
      call raise(error, status_input, path//": /box/origin: "//to_text(maxval(abs(bodies%origin)))//" in size, but "// &
        & bounded_text//" was expected")
    else if (.not. all(is_bounded(bodies%period))) then
      call raise(error, status_input, path//": /box/period: "//to_text(maxval(bodies%period))//", but "//bounded_text// &
        & " was expected")
    end if
  end subroutine check_box

  !> Write the bodies of all ranks in the order of the ids, the walls, groups where a grain has one, materials where
  !> one is not the first, and the box. The
  !> file appears under its name only when it is complete. Failure: status_failure; what had that name before is left as
  !> it was. Collective.
  subroutine write_bodies_hdf5(comm, path, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file
    type(bodies_data_t) :: sorted

    if (allocated(error)) return
    call sort_by_id(comm, bodies, sorted)
    call refuse_bad_numbers(comm, path, sorted, error)
    if (allocated(error)) return
    call file%create(comm, path, error)
    call file%reserve(bytes_of_headers + bytes_of_word*(sorted%total*(5 + 4*sorted%dimension) + &
      & sorted%n_walls*(1_i8 + 2*sorted%dimension)), error)
    call write_groups(comm, file, sorted, error)
    call file%close(error)
  end subroutine write_bodies_hdf5

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
    integer :: n

    n = merge(bodies%dimension, 0, comm%rank == 0)
    call file%make_group("/box", error)
    call file%write_rows("/box/origin", bodies%origin(1:n), error)
    call file%write_attribute("/box/origin", "unit", "m", error)
    call file%write_rows("/box/period", bodies%period(1:n), error)
    call file%write_attribute("/box/period", "unit", "m", error)
  end subroutine write_box

  !> The bodies of all ranks in the order of the ids, cut into equal blocks.
  subroutine sort_by_id(comm, bodies, sorted)
    type(communicator_t), intent(in) :: comm
    type(bodies_data_t), intent(in) :: bodies
    type(bodies_data_t), intent(out) :: sorted
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: column(:, :)
    integer :: nd, nv

    nd = bodies%dimension
    nv = size(bodies%velocity, 1)
    allocate (records(5 + nd + nv, bodies%n), source=0_i8)
    records(1, :) = bodies%id
    call pack_reals(1, bodies%radius, 2, records)
    if (allocated(bodies%mass)) call pack_reals(1, bodies%mass, 3, records)
    call pack_reals(nd, bodies%position, 4, records)
    call pack_reals(nv, bodies%velocity, 4 + nd, records)
    records(4 + nd + nv, :) = bodies%group
    records(5 + nd + nv, :) = bodies%material
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
    sorted%n_walls = bodies%n_walls
    sorted%wall_id = bodies%wall_id
    sorted%wall_point = bodies%wall_point
    sorted%wall_normal = bodies%wall_normal
    sorted%has_box = bodies%has_box
    sorted%origin = bodies%origin
    sorted%period = bodies%period
  end subroutine sort_by_id

  !> What read_bodies would refuse is not written.
  subroutine refuse_bad_numbers(comm, path, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: numbers(:)

    call check_ids(comm, path//": /bodies/id", comm%offset(int(bodies%n, i8)), bodies%id, error)
    call check_numbers(comm, path//": /bodies/position", bodies%dimension, bodies%id, bodies%position, quantity, error)
    call check_numbers(comm, path//": /bodies/velocity", size(bodies%velocity, 1), bodies%id, bodies%velocity, quantity, error)
    call check_numbers(comm, path//": /bodies/radius", 1, bodies%id, bodies%radius, extent, error)
    if (allocated(bodies%mass)) call check_numbers(comm, path//": /bodies/mass", 1, bodies%id, bodies%mass, extent, error)
    numbers = bodies%group
    call check_whole(comm, path, "group", 0, bodies%id, numbers, error)
    numbers = bodies%material
    call check_whole(comm, path, "material", 1, bodies%id, numbers, error)
    call check_box(path, bodies, error)
    call check_ids(comm, path//": /walls/id", 0_i8, bodies%wall_id, error)
    call check_numbers(comm, path//": /walls/point", bodies%dimension, bodies%wall_id, bodies%wall_point, quantity, error)
    call check_numbers(comm, path//": /walls/normal", bodies%dimension, bodies%wall_id, bodies%wall_normal, direction, error)
    if (allocated(error)) error%status = status_failure
  end subroutine refuse_bad_numbers

end module gravier_bodies_hdf5
