!> A process that has nothing to do leaves its processor to others for a while.
module gravier_pause
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private
  public :: pause_for

  interface
    integer(c_int) function c_usleep(microseconds) bind(C, name="usleep")
      import :: c_int
      implicit none
      integer(c_int), value :: microseconds
    end function c_usleep
  end interface

contains

  !> Do nothing for so many microseconds, fewer than a million, or until a signal comes.
  subroutine pause_for(microseconds)
    integer(c_int), intent(in) :: microseconds
    integer(c_int) :: ignored
    ignored = c_usleep(microseconds)
  end subroutine pause_for

end module gravier_pause
