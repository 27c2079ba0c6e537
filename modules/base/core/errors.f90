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
    error%message = message
  end subroutine raise

end module gravier_errors
