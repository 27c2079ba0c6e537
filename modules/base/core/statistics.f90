!> Figures of a few values.
module gravier_statistics
  use gravier_kinds, only: dp
  implicit none
  private
  public :: median, slope

contains

  !> The middle one of the values, of an even number the mean of the two in the middle.
  pure real(dp) function median(values)
    !> (1 or more)
    real(dp), intent(in) :: values(:)
    real(dp) :: sorted(size(values)), one
    integer :: k, j, n

    n = size(values)
    sorted(:) = values
    do k = 2, n
      one = sorted(k)
      j = k - 1
      do while (j >= 1)
        if (sorted(j) <= one) exit
        sorted(j + 1) = sorted(j)
        j = j - 1
      end do
      sorted(j + 1) = one
    end do
    median = 0.5_dp*(sorted((n + 1)/2) + sorted(n/2 + 1))
  end function median

  !> Slope of the straight line nearest to the points by least squares; 0 where all abscissas are the same.
  pure real(dp) function slope(x, y)
    !> as many as `y`, 1 or more
    real(dp), intent(in) :: x(:), y(:)
    real(dp) :: mean_x, mean_y, spread

    mean_x = sum(x)/size(x)
    mean_y = sum(y)/size(y)
    spread = sum((x - mean_x)**2)
    slope = 0.0_dp
    if (spread > 0.0_dp) slope = sum((x - mean_x)*(y - mean_y))/spread
  end function slope

end module gravier_statistics
