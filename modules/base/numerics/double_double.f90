!> Matrix-vector products and sums in twice the working precision, as unevaluated sums high + low of two numbers.
!>
!> Error-free transformations (Dekker 1971; Ogita, Rump, Oishi 2005). They hold as written only: this file is compiled
!> without contraction of products and sums, see its CMake target.
module gravier_double_double
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: extended_product, extended_add

  !> keeps the 26 leading bits of a significand of 53
  integer(i8), parameter :: leading_bits = not(int(z'7FFFFFF', i8))

contains

  !> y := A v, with an error of a few times 2^-106 of sum |A| |v|.
  pure subroutine extended_product(matrix, v_high, v_low, y_high, y_low)
    !> (m, n)
    real(dp), intent(in), contiguous :: matrix(:, :)
    !> (n)
    real(dp), intent(in), contiguous :: v_high(:), v_low(:)
    !> (m)
    real(dp), intent(out), contiguous :: y_high(:), y_low(:)
    real(dp) :: factor, factor_high, factor_low, small
    real(dp) :: a, a_high, a_low, p, p_error, s, t
    integer :: i, j

    y_high(:) = 0.0_dp
    y_low(:) = 0.0_dp
    do j = 1, size(matrix, 2)
      factor = v_high(j)
      small = v_low(j)
      factor_high = leading_part(factor)
      factor_low = factor - factor_high
      do i = 1, size(matrix, 1)
        a = matrix(i, j)
        a_high = leading_part(a)
        a_low = a - a_high
        ! p + p_error = a factor, in this order: a sum of the two mixed products alone would be rounded at 2^-77
        p = a*factor
        p_error = ((a_high*factor_high - p + a_high*factor_low) + a_low*factor_high) + a_low*factor_low
        ! s + the error of the sum = y_high + p exactly
        s = y_high(i) + p
        t = s - y_high(i)
        y_low(i) = y_low(i) + (((y_high(i) - (s - t)) + (p - t)) + (p_error + a*small))
        y_high(i) = s
      end do
    end do
    do i = 1, size(y_high)
      s = y_high(i) + y_low(i)
      y_low(i) = y_low(i) - (s - y_high(i))
      y_high(i) = s
    end do
  end subroutine extended_product

  !> Add `x` to high + low.
  pure elemental subroutine extended_add(high, low, x)
    real(dp), intent(inout) :: high, low
    real(dp), intent(in) :: x
    real(dp) :: s, t, error

    s = high + x
    t = s - high
    error = (high - (s - t)) + (x - t) + low
    high = s + error
    low = error - (high - s)
  end subroutine extended_add

  !> `x` with the trailing half of its significand set to zero, so that products of two such halves are exact.
  pure elemental real(dp) function leading_part(x) result(part)
    real(dp), intent(in) :: x
    part = transfer(iand(transfer(x, 0_i8), leading_bits), 0.0_dp)
  end function leading_part

end module gravier_double_double
