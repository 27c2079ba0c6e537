!> Space that repeats itself along some axes.
module gravier_periodic
  use gravier_kinds, only: dp
  implicit none
  private
  public :: period_t, wrap, no_shift, shift_code, shift_of_code

  !> The cell that repeats: [origin, origin + length) along each axis whose length is not 0.
  type :: period_t
    !> [m]
    real(dp) :: length(3) = 0.0_dp, origin(3) = 0.0_dp
  contains
    procedure :: on => period_on
    procedure :: wrap => period_wrap
    procedure :: add_shift => period_add_shift
  end type period_t

  !> code of the shift by no period
  integer, parameter :: no_shift = 13

contains

  !> Whether some axis is periodic.
  pure logical function period_on(self)
    class(period_t), intent(in) :: self
    period_on = any(self%length > 0.0_dp)
  end function period_on

  !> Bring a point into the cell.
  pure subroutine period_wrap(self, x, turns)
    class(period_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    !> (nd): periods taken away along each axis
    integer, intent(out) :: turns(:)
    real(dp) :: inside
    integer :: d

    do d = 1, size(x)
      call wrap(x(d), self%origin(d), self%length(d), inside, turns(d))
      x(d) = inside
    end do
  end subroutine period_wrap

  !> Move a place, or a way, by the shift of a code times `sense`.
  pure subroutine period_add_shift(self, code, sense, x)
    class(period_t), intent(in) :: self
    integer, intent(in) :: code
    !> 1, or -1 for the opposite way
    integer, intent(in) :: sense
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    integer :: shift(3), d

    shift(:) = shift_of_code(code)
    do d = 1, size(x)
      x(d) = x(d) + sense*shift(d)*self%length(d)
    end do
  end subroutine period_add_shift

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

  !> One number for a shift of -1, 0 or 1 periods along each axis.
  pure integer function shift_code(shift) result(code)
    integer, intent(in) :: shift(3)
    code = (shift(1) + 1) + 3*(shift(2) + 1) + 9*(shift(3) + 1)
  end function shift_code

  pure function shift_of_code(code) result(shift)
    integer, intent(in) :: code
    integer :: shift(3)

    shift(1) = mod(code, 3) - 1
    shift(2) = mod(code/3, 3) - 1
    shift(3) = code/9 - 1
  end function shift_of_code

end module gravier_periodic
