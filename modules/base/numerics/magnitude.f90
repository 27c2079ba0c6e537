!> Magnitudes that a scene may have. Products of a few of them, as masses from densities and radii, inertias, energies, and
!> their inverses, then stay within the range of numbers (1e-308 to 1e308).
module gravier_magnitude
  use gravier_kinds, only: dp
  implicit none
  private
  public :: is_bounded, is_size, bounded_text, size_text, sharpest, far_text

  real(dp), parameter :: largest = 1.0e30_dp, smallest = 1.0e-30_dp
  !> what is expected of a quantity of any sign, and of one that is above 0
  character(len=*), parameter :: bounded_text = "a number of at most 1e30 in size"
  character(len=*), parameter :: size_text = "a number from 1e-30 to 1e30"

  !> Coordinates may be so many radii of the smallest grain: rounding then stays below 3e-6 of it, far less than the overlaps
  !> that contacts have.
  real(dp), parameter :: sharpest = 1.0e10_dp
  character(len=*), parameter :: far_text = "1e10 radii of the smallest grain: rounding would hide gaps"

contains

  !> Whether a quantity that may be 0 or negative is one to reckon with; NaN is not.
  elemental logical function is_bounded(x)
    real(dp), intent(in) :: x
    is_bounded = abs(x) <= largest
  end function is_bounded

  !> Whether a quantity that must be above 0 is one to reckon with; NaN is not.
  elemental logical function is_size(x)
    real(dp), intent(in) :: x
    is_size = x >= smallest .and. x <= largest
  end function is_size

end module gravier_magnitude
