!> Coordinates along a periodic axis.
module gravier_periodic
  use gravier_kinds, only: dp
  implicit none
  private
  public :: wrap

contains

  !> The image of `x` in [origin, origin + period), also after rounding, and the whole periods between: `x` is about
  !> inside + turns*period. A coordinate more than 2^30 periods away has turns +-huge(1); one that is not a number goes to
  !> `origin`.
  elemental subroutine wrap(x, origin, period, inside, turns)
    !> [m]; period 0: the axis is not periodic, inside is x
    real(dp), intent(in) :: x, origin, period
    real(dp), intent(out) :: inside
    integer, intent(out) :: turns
    real(dp), parameter :: far = 2.0_dp**30
    real(dp) :: apart

    inside = x
    turns = 0
    if (.not. period > 0.0_dp) return
    apart = x - origin
    if (abs(apart)*(1.0_dp/far) < period) then
      turns = floor(apart/period)
      if (turns /= 0) inside = x - turns*period
    else
      turns = merge(huge(1), -huge(1), apart > 0.0_dp)
      inside = origin + modulo(apart, period)
    end if
    ! rounding may have put it one period off
    if (inside < origin) then
      inside = inside + period
      if (abs(turns) < huge(1)) turns = turns - 1
    end if
    if (inside >= origin + period) then
      inside = inside - period
      if (abs(turns) < huge(1)) turns = turns + 1
    end if
    if (.not. (inside >= origin .and. inside < origin + period)) inside = origin
  end subroutine wrap

end module gravier_periodic
