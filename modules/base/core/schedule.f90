!> When something is due in the steps of a run.
module gravier_schedule
  implicit none
  private
  public :: schedule_t

  !> Steps in which something is due; by default none. Step 0 is the start, before any step is made.
  type :: schedule_t
    !> steps between two times, counted from the start, which is one of them; 0: never
    integer :: every = 0
    !> one step by itself; 0: none
    integer :: at = 0
    !> the last step of the run, in which it is due whatever `every` is; 0: it is not due for being the last
    integer :: last = 0
  contains
    procedure :: due => schedule_due
  end type schedule_t

contains

  !> Whether it is due once step `step` is made.
  pure logical function schedule_due(self, step) result(due)
    class(schedule_t), intent(in) :: self
    !> 0 for the start
    integer, intent(in) :: step

    due = step > 0 .and. (step == self%at .or. step == self%last)
    if (self%every > 0) due = due .or. mod(step, self%every) == 0
  end function schedule_due

end module gravier_schedule
