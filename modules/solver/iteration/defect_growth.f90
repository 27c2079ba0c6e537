!> Growth of the defect that a method cannot mend itself: the defect has stayed above its reference for some iterations, and is a
!> multiple of it.
module gravier_defect_growth
  use gravier_kinds, only: dp
  implicit none
  private
  public :: defect_growth_t

  !> the multiple, and for how many iterations the defect has been above the reference then
  real(dp), parameter :: unmended_limit = 4.0_dp
  integer, parameter :: unmended_iterations = 9

  type :: defect_growth_t
    !> whether the defect has grown for too long
    logical :: unmended = .false.
    !> iteration from which on the defect has been above the reference, -1 where it is not
    integer, private :: exceeded_at = -1
  contains
    procedure :: note => defect_growth_note
  end type defect_growth_t

contains

  !> Note the defect after an iteration.
  pure subroutine defect_growth_note(self, is_mended, iteration, defect, reference)
    class(defect_growth_t), intent(inout) :: self
    !> the method has means of its own against growth
    logical, intent(in) :: is_mended
    integer, intent(in) :: iteration
    !> [N s]
    real(dp), intent(in) :: defect, reference

    self%unmended = .false.
    if (is_mended .or. .not. defect > reference) then
      self%exceeded_at = -1
    else if (self%exceeded_at < 0) then
      self%exceeded_at = iteration
    else
      self%unmended = iteration >= self%exceeded_at + unmended_iterations .and. defect > unmended_limit*reference
    end if
  end subroutine defect_growth_note

end module gravier_defect_growth
