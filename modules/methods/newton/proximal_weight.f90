!> The weight alpha of the proximal points of Newton's method: small where points are found in few steps, large where they are not.
module gravier_proximal_weight
  use gravier_kinds, only: dp
  implicit none
  private
  public :: proximal_weight_t

  !> the weight at the start of a turn and its bounds
  real(dp), parameter :: alpha_start = 1.0e-2_dp, alpha_least = 1.0e-10_dp, alpha_most = 10.0_dp
  !> what it is multiplied with after a proximal point found in very few steps, in few, in many, not found
  real(dp), parameter :: drop = 0.1_dp, fall = 0.5_dp, climb = 1.5_dp, rise = 5.0_dp
  !> steps to a proximal point that are very few, few, not many
  integer, parameter :: very_few_steps = 2, few_steps = 6, some_steps = 12

  type :: proximal_weight_t
    real(dp) :: alpha = alpha_start
    !> that for which a proximal point was not found last, 0 for none
    real(dp), private :: refused = 0.0_dp
  contains
    procedure :: adapt => proximal_weight_adapt
  end type proximal_weight_t

contains

  !> The next weight, after a proximal point was found or given up in so many steps of Newton's method.
  pure subroutine proximal_weight_adapt(self, found, steps)
    class(proximal_weight_t), intent(inout) :: self
    logical, intent(in) :: found
    integer, intent(in) :: steps

    if (found .and. self%alpha <= self%refused) self%refused = 0.0_dp
    if (.not. found) then
      self%refused = self%alpha
      self%alpha = min(self%alpha*rise, alpha_most)
    else if (steps <= very_few_steps .and. self%alpha*drop > self%refused) then
      self%alpha = max(self%alpha*drop, alpha_least)
    else if (steps <= few_steps) then
      self%alpha = max(self%alpha*fall, alpha_least)
    else if (steps > some_steps) then
      self%alpha = min(self%alpha*climb, alpha_most)
    end if
  end subroutine proximal_weight_adapt

end module gravier_proximal_weight
