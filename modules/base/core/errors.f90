!> Errors travel as values to the top level, which prints one line and exits with a status.
module gravier_errors
  implicit none
  private
  public :: error_t, raise
  public :: status_ok, status_input, status_unconverged, status_failure

  !> exit statuses of every command
  integer, parameter :: status_ok = 0
  !> bad input or usage
  integer, parameter :: status_input = 2
  !> a solve did not reach its tolerance
  integer, parameter :: status_unconverged = 3
  !> anything else
  integer, parameter :: status_failure = 4

  !> One error: what a user reads, and the exit status it leads to.
  type :: error_t
    integer :: status = status_failure
    character(len=:), allocatable :: message
  end type error_t

contains

  !> Raise an error; an error raised earlier is kept, since it is the cause.
  pure subroutine raise(error, status, message)
    !> left as it is when already allocated
    type(error_t), allocatable, intent(inout) :: error
    !> one of the status_ constants
    integer, intent(in) :: status
    !> one line: where, what was found, what was expected
    character(len=*), intent(in) :: message

    if (allocated(error)) return
    allocate (error)
    error%status = status
    error%message = printable(message)
  end subroutine raise

  !> A text that quotes what a user wrote, on one line and without characters that steer a terminal: each becomes a question mark.
  pure function printable(text) result(line)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: line
    integer :: k

    line = text
    do k = 1, len(line)
      if (iachar(line(k:k)) < iachar(" ") .or. iachar(line(k:k)) == 127) line(k:k) = "?"
    end do
  end function printable

end module gravier_errors
