!> Conversion of numbers to text and small string helpers.
module gravier_text
  use gravier_kinds, only: dp, i4, i8
  implicit none
  private
  public :: to_text, lower

  !> Shortest usual text of a number: integers without blanks, reals with 9 significant digits
  !> or as many as asked, logicals as T or F.
  interface to_text
    module procedure text_of_i4
    module procedure text_of_i8
    module procedure text_of_real
    module procedure text_of_logical
  end interface to_text

contains

  pure function text_of_i4(value) result(text)
    integer(i4), intent(in) :: value
    character(len=:), allocatable :: text
    text = text_of_i8(int(value, i8))
  end function text_of_i4

  pure function text_of_i8(value) result(text)
    integer(i8), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    write (buffer, "(i0)") value
    text = trim(buffer)
  end function text_of_i8

  pure function text_of_real(value, digits) result(text)
    real(dp), intent(in) :: value
    !> significant digits, 1 to 17; 17 reproduces the value exactly when read back
    integer, intent(in), optional :: digits
    character(len=:), allocatable :: text
    character(len=40) :: buffer
    character(len=16) :: form
    integer :: n
    n = 9
    if (present(digits)) n = max(1, min(17, digits))
    write (form, "('(es',i0,'.',i0,'e3)')") n + 9, n - 1
    write (buffer, form) value
    text = trim(adjustl(buffer))
  end function text_of_real

  pure function text_of_logical(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    if (value) then
      text = "T"
    else
      text = "F"
    end if
  end function text_of_logical

  !> ASCII lower case of a string.
  pure function lower(text) result(low)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: low
    integer :: i, c
    do i = 1, len(text)
      c = iachar(text(i:i))
      if (c >= iachar("A") .and. c <= iachar("Z")) c = c + 32
      low(i:i) = achar(c)
    end do
  end function lower

end module gravier_text
