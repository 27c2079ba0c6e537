!> Numbers as people write them, -1.5e-3 or 1d4, read alike wherever a text is to be one: in namelists, tables and command lines.
!> Fortran itself takes more for a number: 1-1 for 0.1, inf, and 1, for a list of two.
module gravier_number_text
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: number_size, is_integer, read_real, read_integer
  public :: not_a_number, size_usual, size_tiny, size_huge

  !> what number_size tells: no number, one that a real can hold, one that is 0 as a real, one that is too large for it
  integer, parameter :: not_a_number = 0, size_usual = 1, size_tiny = 2, size_huge = 3
  !> power of ten and digits of the largest real
  integer, parameter :: largest_power = 308
  character(len=*), parameter :: largest_digits = "17976931348623157"
  !> digits that always fit an integer of 64 bits
  integer, parameter :: most_digits = 18

contains

  !> The real that a text says; 0 for what is tiny, and for what is no number or too large, which `size` tells.
  pure subroutine read_real(text, value, size)
    character(len=*), intent(in) :: text
    real(dp), intent(out) :: value
    !> as number_size gives it
    integer, intent(out) :: size
    integer :: stat

    value = 0.0_dp
    size = number_size(text)
    if (size /= size_usual) return
    read (text, *, iostat=stat) value
    if (stat == 0) return
    value = 0.0_dp
    size = not_a_number
  end subroutine read_real

  !> The integer that a text of at most 18 digits says.
  pure subroutine read_integer(text, value, fits)
    character(len=*), intent(in) :: text
    !> 0 for anything else
    integer(i8), intent(out) :: value
    logical, intent(out) :: fits
    integer :: stat

    value = 0
    fits = .false.
    if (.not. is_integer(text)) return
    if (len(text) - sign_length(text) > most_digits) return
    read (text, "(i20)", iostat=stat) value
    fits = stat == 0
  end subroutine read_integer

  !> Whether a text is a decimal number such as -1.5e-3, and whether its size fits a real (deciding that by reading it
  !> could raise a floating-point exception).
  pure integer function number_size(text) result(size)
    character(len=*), intent(in) :: text
    integer :: mantissa_start, mantissa_end, exponent

    size = not_a_number
    mantissa_start = 1 + sign_length(text)
    mantissa_end = scan(text, "eEdD") - 1
    if (mantissa_end < 0) mantissa_end = len(text)
    exponent = 0
    if (mantissa_end < len(text)) then
      if (.not. is_integer(text(mantissa_end + 2:))) return
      exponent = bounded_integer(text(mantissa_end + 2:))
    end if
    associate (mantissa => text(mantissa_start:mantissa_end))
      if (verify(mantissa, "0123456789.") > 0 .or. scan(mantissa, "0123456789") == 0) return
      if (index(mantissa, ".") /= index(mantissa, ".", back=.true.)) return
      size = size_usual
      if (scan(mantissa, "123456789") == 0) return
      exponent = exponent + leading_exponent(mantissa)
      if (exponent > largest_power .or. (exponent == largest_power .and. significant(mantissa) > largest_digits)) size = size_huge
    end associate
    if (exponent < -320) size = size_tiny
  end function number_size

  !> The digits from the first on that is not 0, without the point and without zeros at the end.
  pure function significant(mantissa) result(digits)
    character(len=*), intent(in) :: mantissa
    character(len=:), allocatable :: digits
    integer :: point

    digits = mantissa(scan(mantissa, "123456789"):scan(mantissa, "123456789", back=.true.))
    point = index(digits, ".")
    if (point > 0) digits = digits(1:point - 1)//digits(point + 1:)
  end function significant

  !> Power of ten of the first digit that is not 0.
  pure integer function leading_exponent(mantissa) result(exponent)
    character(len=*), intent(in) :: mantissa
    integer :: point, first

    first = scan(mantissa, "123456789")
    point = index(mantissa, ".")
    if (point == 0) point = len(mantissa) + 1
    exponent = point - first
    if (first < point) exponent = exponent - 1
  end function leading_exponent

  !> Whether a text is digits, perhaps behind a sign.
  pure logical function is_integer(text)
    character(len=*), intent(in) :: text
    is_integer = len(text) > sign_length(text) .and. verify(text(1 + sign_length(text):), "0123456789") == 0
  end function is_integer

  !> Value of a text that is an integer, cut at a million in size.
  pure integer function bounded_integer(text) result(value)
    character(len=*), intent(in) :: text
    integer :: i

    value = 0
    do i = 1 + sign_length(text), len(text)
      value = min(1000000, 10*value + iachar(text(i:i)) - iachar("0"))
    end do
    if (text(1:1) == "-") value = -value
  end function bounded_integer

  pure integer function sign_length(text) result(length)
    character(len=*), intent(in) :: text

    length = 0
    if (len(text) > 0) length = merge(1, 0, scan(text(1:1), "+-") == 1)
  end function sign_length

end module gravier_number_text
