!> Which run a handle of C means. One run at a time is open in a process, so that a handle is that of this run, or a wrong one: null
!> after an error, or of a run that has been closed.
module gravier_c_handle
  use, intrinsic :: iso_c_binding, only: c_associated, c_loc, c_null_ptr, c_ptr
  use gravier_errors, only: error_t, raise, status_input
  use gravier_user_loop, only: user_loop_t
  implicit none
  private
  public :: is_open, keep_open, forget_open, find_loop

  !> the run that is open
  type(user_loop_t), pointer :: open_loop => null()

contains

  !> Whether a run is open.
  logical function is_open()
    is_open = associated(open_loop)
  end function is_open

  !> A run is open from now on; its handle.
  type(c_ptr) function keep_open(loop) result(handle)
    type(user_loop_t), pointer, intent(in) :: loop

    open_loop => loop
    handle = c_loc(loop)
  end function keep_open

  !> No run is open any more.
  subroutine forget_open()
    open_loop => null()
  end subroutine forget_open

  !> The run of a handle.
  subroutine find_loop(handle, loop, error)
    type(c_ptr), intent(in) :: handle
    type(user_loop_t), pointer, intent(out) :: loop
    !> there is none: input
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: known

    loop => open_loop
    known = c_null_ptr
    if (associated(open_loop)) known = c_loc(open_loop)
    if (c_associated(handle, known)) return
    call raise(error, status_input, "simulation: not open; expected one that gravier_open has opened, and that is not closed yet")
  end subroutine find_loop

end module gravier_c_handle
