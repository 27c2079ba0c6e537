!> What a process does with itself: it leaves its processor to others for a while, tells libraries something, or ends at once.
module gravier_process
  use, intrinsic :: iso_c_binding, only: c_int, c_char, c_null_char
  implicit none
  private
  public :: pause_for, suggest_environment, forget_environment, end_at_once

  interface
    integer(c_int) function c_usleep(microseconds) bind(C, name="usleep")
      import :: c_int
      implicit none
      integer(c_int), value :: microseconds
    end function c_usleep

    integer(c_int) function c_setenv(name, value, overwrite) bind(C, name="setenv")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: name(*), value(*)
      integer(c_int), value :: overwrite
    end function c_setenv

    integer(c_int) function c_unsetenv(name) bind(C, name="unsetenv")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: name(*)
    end function c_unsetenv

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

  !> Set a variable of the environment of this process, unless it is set.
  subroutine suggest_environment(name, value, is_new)
    character(len=*), intent(in) :: name, value
    !> it was not set
    logical, intent(out) :: is_new
    integer(c_int) :: ignored
    integer :: status

    call get_environment_variable(name, status=status)
    is_new = status == 1
    if (is_new) ignored = c_setenv(name//c_null_char, value//c_null_char, 1_c_int)
  end subroutine suggest_environment

  !> Take a variable out of the environment of this process.
  subroutine forget_environment(name)
    character(len=*), intent(in) :: name
    integer(c_int) :: ignored
    ignored = c_unsetenv(name//c_null_char)
  end subroutine forget_environment

  !> End with a status, without what libraries do at the end of a program.
  subroutine end_at_once(status)
    integer, intent(in) :: status
    call c_exit_now(int(status, c_int))
  end subroutine end_at_once

end module gravier_process
