!> Checks of bodies that an HDF5 file holds or is to hold.
module gravier_bodies_checks
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, is_size, bounded_text, size_text
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_bodies_data, only: bodies_data_t
  implicit none
  private
  public :: check_ids, check_own_ids, check_numbers, check_own_numbers, check_whole, check_box, refuse_bad_numbers
  public :: direction, quantity, extent

  !> kinds of numbers: any of which only ratios count; of a place or velocity; of a size above 0
  integer, parameter :: direction = 0, quantity = 1, extent = 2
  !> that a body or wall of a file may have, of 18 digits as in tables: boundaries and grains that enter get larger ones
  integer(i8), parameter :: largest_id = 10_i8**18 - 1

contains

  !> Refuse ids below 1 and those of more digits than a table may have, on any rank. Collective.
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

  !> Refuse ids below 1 and those of more digits than a table may have. HDF5 makes an unsigned number that is too large for a word
  !> the largest word.
  subroutine check_own_ids(place, first, id, error)
    character(len=*), intent(in) :: place
    integer(i8), intent(in) :: first
    integer(i8), intent(in), contiguous :: id(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: place_of_row
    integer :: i

    do i = 1, size(id)
      if (id(i) >= 1 .and. id(i) <= largest_id) cycle
      place_of_row = place//": row "//to_text(first + i - 1)//" (counted from 0): "//to_text(id(i))
      if (id(i) < 1) then
        call raise(error, status_input, place_of_row//", but an id >= 1 was expected")
      else if (id(i) < huge(id)) then
        call raise(error, status_input, place_of_row//", but an id of at most 18 digits was expected")
      else
        call raise(error, status_input, place_of_row//" or more, but an id of at most 18 digits was expected")
      end if
      return
    end do
  end subroutine check_own_ids

  !> Refuse numbers of any rank that are not of the kind. Collective.
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

  !> Refuse, on any rank, a number of a group or a material that is below the least one or too large. Collective.
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
    else if (.not. (all(is_finite(bodies%tilt)) .and. all(is_bounded(bodies%tilt)))) then
      call raise(error, status_input, path//": /box/edge: a number in it is none or too large, but "//bounded_text//" was expected")
    else if (.not. (all(is_finite(bodies%length_rate)) .and. all(is_bounded(bodies%length_rate)) .and. &
      & all(is_finite(bodies%tilt_rate)) .and. all(is_bounded(bodies%tilt_rate)))) then
      call raise(error, status_input, path//": /box/velocity: a number in it is none or too large, but "//bounded_text// &
        & " was expected")
    end if
  end subroutine check_box

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

end module gravier_bodies_checks
