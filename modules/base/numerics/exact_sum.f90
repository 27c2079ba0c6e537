!> Exact summation of reals: the result does not depend on the order or the grouping of the terms.
!>
!> A sum is held as a fixed-point number of 64-bit limbs of 32 bits each that spans the whole range of the
!> working precision (a long accumulator, Kulisch 2002). Sums of sums are sums of integers, so a reduction over
!> subdomains gives the same bits on any number of ranks.
module gravier_exact_sum
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: exact_sum_words, exact_add, exact_value

  !> limbs of the accumulator, and one word that counts terms that are not finite
  integer, parameter :: limbs = 72
  !> 64-bit words of one sum; up to 2^30 terms may be added to one
  integer, parameter :: exact_sum_words = limbs + 1
  !> weight of the lowest bit is 2^(-bias)
  integer, parameter :: bias = 1152
  integer(i8), parameter :: low_half = int(z'FFFFFFFF', i8)

contains

  !> Add `x` to the sum held in `words`, which starts from zeros.
  pure subroutine exact_add(words, x)
    integer(i8), intent(inout) :: words(exact_sum_words)
    real(dp), intent(in) :: x
    integer(i8) :: mantissa, low, high, sign_of
    integer :: place, limb, shift

    if (.not. ieee_is_finite(x)) then
      words(exact_sum_words) = words(exact_sum_words) + 1
      return
    end if
    if (abs(x) <= 0.0_dp) return
    mantissa = int(scale(fraction(abs(x)), 53), i8)
    place = exponent(x) - 53 + bias
    limb = place/32 + 1
    shift = mod(place, 32)
    sign_of = merge(-1_i8, 1_i8, x < 0.0_dp)
    low = shiftl(iand(mantissa, low_half), shift)
    high = shiftl(shiftr(mantissa, 32), shift)
    words(limb) = words(limb) + sign_of*iand(low, low_half)
    words(limb + 1) = words(limb + 1) + sign_of*(shiftr(low, 32) + iand(high, low_half))
    words(limb + 2) = words(limb + 2) + sign_of*shiftr(high, 32)
  end subroutine exact_add

  !> The sum as a real, within one unit in the last place; NaN where a term was not finite.
  pure real(dp) function exact_value(words) result(x)
    integer(i8), intent(in) :: words(exact_sum_words)
    integer(i8) :: digit(limbs)
    integer :: i, top
    logical :: negative

    if (words(exact_sum_words) /= 0) then
      x = ieee_value(x, ieee_quiet_nan)
      return
    end if
    digit(:) = words(1:limbs)
    call carry(digit)
    negative = digit(limbs) < 0
    if (negative) then
      digit(:) = -digit
      call carry(digit)
    end if
    x = 0.0_dp
    top = 0
    do i = limbs, 1, -1
      if (digit(i) /= 0) then
        top = i
        exit
      end if
    end do
    if (top == 0) return
    do i = max(1, top - 3), top
      x = x + scale(real(digit(i), dp), 32*(i - top))
    end do
    x = scale(x, 32*(top - 1) - bias)
    if (negative) x = -x
  end function exact_value

  !> Bring every limb but the last into [0, 2^32).
  pure subroutine carry(digit)
    integer(i8), intent(inout) :: digit(limbs)
    integer :: i

    do i = 1, limbs - 1
      digit(i + 1) = digit(i + 1) + shifta(digit(i), 32)
      digit(i) = iand(digit(i), low_half)
    end do
  end subroutine carry

end module gravier_exact_sum
