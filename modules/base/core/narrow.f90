!> Integers of 64 bits made narrow: the only procedures by which they become those of 32. A count that comes from a file or an input
!> goes through take_count or check_counts, which refuse what is too large; narrow is for what is in range for another reason, and
!> even there a number too large never becomes a small one.
module gravier_narrow
  use gravier_kinds, only: i4, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  implicit none
  private
  public :: narrow, take_count, check_counts

  !> the largest count
  integer(i8), parameter :: most = huge(0_i4)

contains

  !> The same number; one beyond the range of 32 bits becomes the end of the range.
  elemental integer(i4) function narrow(value)
    integer(i8), intent(in) :: value
    narrow = int(max(-most, min(most, value)), i4)
  end function narrow

  !> A count from outside. Failure: status_input, for a number below 0 or beyond 32 bits; the count is then 0.
  subroutine take_count(value, what, count, error)
    integer(i8), intent(in) :: value
    !> file and place, for the message
    character(len=*), intent(in) :: what
    integer(i4), intent(out) :: count
    type(error_t), allocatable, intent(inout) :: error

    integer(i8) :: one(1)

    count = 0
    one(1) = value
    call check_counts(one, what, error)
    if (.not. allocated(error)) count = narrow(value)
  end subroutine take_count

  !> Refuse counts from outside that are below 0 or, alone or together, beyond 32 bits (status_input).
  subroutine check_counts(values, what, error)
    integer(i8), intent(in) :: values(:)
    !> file and place, for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: total, found
    integer :: k

    if (allocated(error)) return
    total = 0
    do k = 1, size(values)
      ! what has been added up is at most 2^31, so that nothing overflows
      total = total + max(-1_i8, min(values(k), most + 1))
      if (values(k) >= 0 .and. total <= most) cycle
      found = values(k)
      if (found >= 0) found = max(found, total)
      call raise(error, status_input, what//": "//to_text(found)//", but 0 to "//to_text(most)//" was expected")
      return
    end do
  end subroutine check_counts

end module gravier_narrow
