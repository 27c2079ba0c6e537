!> What a process does with itself: it leaves its processor to others for a while, or ends at once.
module gravier_process
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private
  public :: pause_for, end_at_once

  interface
    integer(c_int) function c_usleep(microseconds) bind(C, name="usleep")
      import :: c_int
      implicit none
      integer(c_int), value :: microseconds
    end function c_usleep

    subroutine c_exit_now(status) bind(C, name="_exit")
      import :: c_int
      implicit none
      integer(c_int), value :: status
    end subroutine c_exit_now
  end interface

contains

  !> Do nothing for so many microseconds, fewer than a million, or until a signal comes.
  subroutine pause_for(microseconds)
    integer(c_int), intent(in) :: microseconds
    integer(c_int) :: ignored
    ignored = c_usleep(microseconds)
  end subroutine pause_for

  !> End with a status, without what libraries do at the end of a program.
  subroutine end_at_once(status)
    integer, intent(in) :: status
    call c_exit_now(int(status, c_int))
  end subroutine end_at_once

end module gravier_process
