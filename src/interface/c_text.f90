!> What all functions for C need: texts, and the line of the last error.
module gravier_c_text
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_loc, c_null_char, c_ptr, c_size_t
  use gravier_kinds, only: i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, status_ok
  implicit none
  private
  public :: told, text_of, put_text, gravier_error

  character(kind=c_char), allocatable, target :: last_error(:)

  interface
    integer(c_size_t) function c_strlen(text) bind(C, name="strlen")
      import :: c_ptr, c_size_t
      implicit none
      type(c_ptr), value :: text
    end function c_strlen
  end interface

contains

  !> The status of an error, whose line is kept; 0 and an empty line where there is none.
  integer(c_int) function told(error) result(status)
    type(error_t), allocatable, intent(in) :: error

    status = status_ok
    if (allocated(error)) then
      status = int(error%status, c_int)
      call put_text(error%message, last_error)
    else
      call put_text("", last_error)
    end if
  end function told

  !> The line of the last error, valid until the next call; an empty text after a success.
  type(c_ptr) function gravier_error() result(line) bind(C, name="gravier_error")
    if (.not. allocated(last_error)) call put_text("", last_error)
    line = c_loc(last_error)
  end function gravier_error

  !> A text of C as one of Fortran; empty where there is none.
  function text_of(address) result(text)
    type(c_ptr), intent(in) :: address
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: k, n, length(1)

    n = 0
    if (c_associated(address)) n = narrow(int(c_strlen(address), i8))
    allocate (character(len=n) :: text)
    if (n == 0) return
    length(1) = n
    call c_f_pointer(address, letters, length)
    do k = 1, n
      text(k:k) = letters(k)
    end do
  end function text_of

  !> Keep a text for C.
  subroutine put_text(text, letters)
    character(len=*), intent(in) :: text
    character(kind=c_char), allocatable, intent(inout) :: letters(:)
    integer :: k

    if (allocated(letters)) deallocate (letters)
    allocate (letters(len(text) + 1))
    do k = 1, len(text)
      letters(k) = text(k:k)
    end do
    letters(len(text) + 1) = c_null_char
  end subroutine put_text

end module gravier_c_text
