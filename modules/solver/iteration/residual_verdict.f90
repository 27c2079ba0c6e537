!> Whether a residual within its tolerance ends a solve.
!>
!> A residual is relative to the impulses, and small for two reasons: contacts nearly obey their laws, or impulses have grown. Where
!> walls close on grains, impulses grow without bound and the residual falls as one over them. It is relative to the largest
!> impulses, too, and does not see light bodies beside heavy ones, nor new contacts beside loaded ones. Where everything prescribed
!> is at rest, the residual alone ends a solve all the same: impulses do not grow there, and the closing lines of a run tell of
!> velocities that are far off. Elsewhere a small residual ends a solve only if velocities are not far beyond the accuracy: no
!> contact may violate its law by more than the default criterion allows, nor the velocity error that it compares be above `far`
!> times the accuracy. Iterations go on otherwise, until that holds or impulses are seen to grow in vain (gravier_vain_impulses).
!> Walls that close by less than the accuracy are no contradiction for it.
module gravier_residual_verdict
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_kept_impulses, only: kept_impulses_t
  use gravier_vain_impulses, only: are_in_vain, speed_against
  use gravier_velocity_error, only: velocity_error_t, violations_allowed
  implicit none
  private
  public :: residual_ends, residual_waits, residual_in_vain, find_residual_verdict, grow_in_vain, excess_of, vain_look_t

  !> the residual ends the solve; iterations go on; they would do so for ever
  integer, parameter :: residual_ends = 0, residual_waits = 1, residual_in_vain = 2

  !> times the accuracy up to which the velocity error, as the default criterion compares it, may be
  real(dp), parameter :: far = 10.0_dp
  !> iterations before the first look
  integer, parameter :: first_look = 1000

  !> Looks, at iterations that double, whether a solve by the velocity error has no solution: where light bodies count much, its
  !> error may fall for thousands of iterations that add to the impulses in vain.
  type :: vain_look_t
    integer, private :: next = first_look
  contains
    procedure :: is_due => vain_look_is_due
  end type vain_look_t

contains

  !> Whether a look is due after so many iterations; the next one then comes after twice as many.
  logical function vain_look_is_due(self, iteration) result(is_due)
    class(vain_look_t), intent(inout) :: self
    integer, intent(in) :: iteration

    is_due = iteration >= self%next
    if (is_due) self%next = 2*iteration
  end function vain_look_is_due

  !> The verdict on a residual within its tolerance, by the whole estimate of the velocity error. Collective.
  subroutine find_residual_verdict(problem, method, velocity, iteration, allowed, verdict)
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    type(velocity_error_t), intent(inout) :: velocity
    !> iterations made
    integer, intent(in) :: iteration
    !> velocity error that the accuracy allows [m/s]
    real(dp), intent(in) :: allowed
    integer, intent(out) :: verdict

    verdict = residual_ends
    if (problem%rest_is_admissible) return
    call velocity%complete(problem, method, iteration)
    if (excess_of(velocity, allowed) <= 1.0_dp) return
    if (speed_against(problem) <= allowed) return
    verdict = residual_waits
    if (grow_in_vain(problem, method, velocity, iteration)) verdict = residual_in_vain
  end subroutine find_residual_verdict

  !> Whether the impulses have grown in vain since those of an earlier iteration, where some are known. They cannot where rest obeys
  !> all laws. Collective.
  logical function grow_in_vain(problem, method, velocity, iteration) result(in_vain)
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    type(velocity_error_t), intent(in) :: velocity
    !> iterations made
    integer, intent(in) :: iteration
    type(kept_impulses_t) :: earlier(size(problem%sub))

    in_vain = .false.
    if (problem%rest_is_admissible) return
    call velocity%tests%take_earlier(problem, method, iteration, earlier, in_vain)
    if (in_vain) in_vain = are_in_vain(problem, earlier)
  end function grow_in_vain

  !> How far velocities are beyond what a small residual may leave, at most 1 where they are not; 0 where no velocity is there to
  !> compare with.
  pure real(dp) function excess_of(velocity, allowed) result(excess)
    type(velocity_error_t), intent(in) :: velocity
    !> velocity error that the accuracy allows [m/s]
    real(dp), intent(in) :: allowed

    excess = 0.0_dp
    if (allowed > 0.0_dp) excess = max(velocity%largest_violation/violations_allowed, velocity%criterion()/far)/allowed
  end function excess_of

end module gravier_residual_verdict
