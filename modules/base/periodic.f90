!> Space that repeats itself along some axes.
module gravier_periodic
  use gravier_kinds, only: dp
  implicit none
  private
  public :: period_t, no_shift, shift_code, shift_of_code

  !> The cell that repeats: [origin, origin + length) along each axis whose length is not 0.
  type :: period_t
    !> [m]
    real(dp) :: length(3) = 0.0_dp, origin(3) = 0.0_dp
  contains
    procedure :: on => period_on
    procedure :: wrap => period_wrap
  end type period_t

  !> code of the shift by no period
  integer, parameter :: no_shift = 13

contains

  !> Whether some axis is periodic.
  pure logical function period_on(self)
    class(period_t), intent(in) :: self
    period_on = any(self%length > 0.0_dp)
  end function period_on

  !> Bring a point into the cell by whole periods.
  pure subroutine period_wrap(self, x, periods)
    class(period_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    !> (nd): periods added along each axis
    integer, intent(out) :: periods(:)
    integer :: d

    periods(:) = 0
    do d = 1, size(x)
      if (.not. self%length(d) > 0.0_dp) cycle
      associate (length => self%length(d), origin => self%origin(d))
        if (x(d) >= origin .and. x(d) < origin + length) cycle
        periods(d) = -floor((x(d) - origin)/length)
        x(d) = x(d) + periods(d)*length
        ! rounding may leave it on or beyond an end of the cell
        if (x(d) < origin) x(d) = origin
        if (x(d) >= origin + length) then
          x(d) = origin
          periods(d) = periods(d) - 1
        end if
      end associate
    end do
  end subroutine period_wrap

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
