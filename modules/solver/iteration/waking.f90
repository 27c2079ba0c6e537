!> When the contacts that sleep wake in the course of a solve.
module gravier_waking
  use gravier_kinds, only: dp
  implicit none
  private
  public :: waking_t

  !> share of the squared defect in contacts that sleep from which on they wake
  real(dp), parameter :: most_of_the_defect = 0.5_dp
  !> what is left of a figure since the last check where sweeps over the other contacts gain enough
  real(dp), parameter :: still_falling = 0.85_dp

  type :: waking_t
    !> the figure at the last check at which the estimate was trusted
    real(dp), private :: last_figure = huge(1.0_dp)
  contains
    procedure :: is_due => waking_is_due
  end type waking_t

contains

  !> Whether contacts that sleep wake after a check that did not end the solve, because sweeps over the others would not bring it to
  !> its end. They wake where most of the defect lies in them. Where the residual is within its tolerance and the velocity error is
  !> not, they also wake where the error has not fallen since the last check; before the estimate of the error is trusted, such a
  !> residual is no reason to wake anything.
  logical function waking_is_due(self, asleep_share, is_within, is_trusted, figure) result(is_due)
    class(waking_t), intent(inout) :: self
    !> share of the squared defect that lies in contacts that sleep
    real(dp), intent(in) :: asleep_share
    !> the residual is within its tolerance; the estimate of the velocity error, by which the solve ends, is trusted
    logical, intent(in) :: is_within, is_trusted
    !> what is compared with the goal of the solve
    real(dp), intent(in) :: figure

    is_due = asleep_share >= most_of_the_defect
    if (.not. is_within) return
    if (.not. is_trusted) then
      is_due = .false.
      return
    end if
    is_due = is_due .or. .not. figure < still_falling*self%last_figure
    self%last_figure = figure
  end function waking_is_due

end module gravier_waking
