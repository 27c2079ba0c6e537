!> Recognition of NaN and infinity without a floating-point operation, which could trap.
module gravier_finite
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: is_finite, has_finite_square

contains

  !> True when `x` is neither NaN nor infinite, by its exponent bits (IEEE 754 binary64).
  elemental logical function is_finite(x)
    real(dp), intent(in) :: x
    is_finite = ibits(transfer(x, 0_i8), 52, 11) /= 2047_i8
  end function is_finite

  !> True when the square of `x` is finite too, and sums of some squares like it, by its exponent bits.
  elemental logical function has_finite_square(x)
    real(dp), intent(in) :: x
    has_finite_square = ibits(transfer(x, 0_i8), 52, 11) < 1023_i8 + 510_i8
  end function has_finite_square

end module gravier_finite
