!> When the contacts that sleep wake in the course of a solve.
module gravier_waking
  use gravier_kinds, only: dp
  implicit none
  private
  public :: wake_is_due

  !> share of the squared defect in contacts that sleep from which on they wake
  real(dp), parameter :: most_of_the_defect = 0.5_dp

contains

  !> Whether contacts that sleep wake after a check that did not end the solve. Where the residual is above its tolerance, they wake
  !> if most of the defect lies in them; otherwise sweeps over the others have to lower it first, and may do. Where the residual is
  !> within its tolerance, the velocity error is too large for the solve to end: they wake, unless that error is not known yet and
  !> so many sleep that it is worth while to wait for it.
  pure logical function wake_is_due(asleep_share, is_within, is_trusted, many_sleep) result(is_due)
    !> share of the squared defect that lies in contacts that sleep
    real(dp), intent(in) :: asleep_share
    !> the residual is within its tolerance; the estimate of the velocity error, by which the solve ends, is trusted; more contacts
    !> sleep than are awake
    logical, intent(in) :: is_within, is_trusted, many_sleep

    if (is_within) then
      is_due = is_trusted .or. .not. many_sleep
    else
      is_due = asleep_share >= most_of_the_defect
    end if
  end function wake_is_due

end module gravier_waking
