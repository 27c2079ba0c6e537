!> Passes over layers (gravier_layered_start) tried in the course of a solve: where there is much to carry and a long way to carry
!> it, and kept only where they have brought something.
module gravier_layer_trial
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_velocity_error, only: velocity_error_t, copies_ready
  use gravier_layered_start, only: carry_loads
  use gravier_fresh_start, only: begin_anew
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  implicit none
  private
  public :: layer_trial_t

  !> a pass is tried after the first iterations if the residual at the start, the velocity error over its scale and the way to
  !> supports are above these [1, 1, mean diameters]
  real(dp), parameter :: unsettled = 0.1_dp, much = 0.5_dp, deep = 25.0_dp
  !> and after a part of the depth, where the way is above another [mean diameters]; the depth is found after so many iterations
  real(dp), parameter :: late = 0.3_dp, very_deep = 60.0_dp
  integer, parameter :: many = 20
  !> there are at least so many contacts on the way as mean diameters
  real(dp), parameter :: nearly = 0.7_dp
  !> iterations after a pass until it is judged, and what must be left of the error then
  integer, parameter :: trial = 6
  real(dp), parameter :: worth_keeping = 0.8_dp

  !> A pass is tried where the velocity error over its scale, and the way to supports in mean diameters, are above these.
  type :: threshold_t
    real(dp) :: error = 0.0_dp, way = 0.0_dp
  end type threshold_t

  type :: layer_trial_t
    !> sweeps over all contacts that passes took; whether the solve goes on from one
    real(dp) :: sweeps = 0.0_dp
    logical :: layered = .false.
    !> a pass may be tried; after the first iterations
    logical, private :: may_try = .false., wants_first = .false.
    !> velocity error over its scale at which the solve ends
    real(dp), private :: allowed = 0.0_dp
    !> the iterations go on from other impulses
    logical, private :: anew = .false.
    !> the iteration after which a pass is judged
    integer, private :: ends = 0
    !> what a start is judged by [m/s], and the impulses, before the pass
    real(dp), private :: error_before = 0.0_dp
    type(kept_impulses_t), allocatable, private :: before(:)
  contains
    procedure :: start => layer_trial_start
    procedure :: calls => layer_trial_calls
    procedure :: advance => layer_trial_advance
  end type layer_trial_t

contains

  !> Say what a solve starts with, whose control allows passes.
  subroutine layer_trial_start(self, problem, residual, allowed)
    class(layer_trial_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> residual at the start, and velocity error over its scale at which the solve ends
    real(dp), intent(in) :: residual, allowed

    self%allowed = allowed
    self%may_try = any(abs(problem%load) > 0.0_dp)
    self%wants_first = self%may_try .and. residual > unsettled
  end subroutine layer_trial_start

  !> Whether an iteration has to be followed by a check.
  pure logical function layer_trial_calls(self, iteration) result(calls)
    class(layer_trial_t), intent(in) :: self
    integer, intent(in) :: iteration
    calls = (self%wants_first .and. iteration == copies_ready) .or. iteration == self%ends
  end function layer_trial_calls

  !> After a check that did not end the solve: judge a pass or try one, where it is time. Collective.
  subroutine layer_trial_advance(self, problem, method, velocity, iteration, anew, error)
    class(layer_trial_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    !> the iterations go on from other impulses
    logical, intent(out) :: anew
    type(error_t), allocatable, intent(inout) :: error

    self%anew = .false.
    if (iteration == self%ends) call judge(self, problem, method, velocity, iteration, error)
    anew = self%anew
    if (allocated(error)) return
    if (self%wants_first .and. iteration == copies_ready) &
      & call try(self, problem, method, velocity, iteration, threshold_t(much, deep), error)
    anew = self%anew
    if (allocated(error)) return
    if (self%may_try .and. velocity%levels%most_depth < 0 .and. iteration >= many) call velocity%levels%find_depth(problem)
    if (self%may_try .and. velocity%levels%most_depth > very_deep .and. iteration >= self%ends .and. &
      & (self%layered .or. iteration > late*velocity%levels%most_depth)) &
      & call try(self, problem, method, velocity, iteration, threshold_t(self%allowed, very_deep), error)
    anew = self%anew
  end subroutine layer_trial_advance

  !> Where much of the velocities is missing and the way to the supports is long, go on from a pass over layers. Collective.
  subroutine try(self, problem, method, velocity, iteration, above, error)
    type(layer_trial_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    type(threshold_t), intent(in) :: above
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: sweeps
    logical :: carried

    if (velocity%levels%most_depth < 0) call velocity%levels%find_depth(problem)
    if (velocity%levels%most_depth < nearly*above%way) then
      self%may_try = .false.
      return
    end if
    call velocity%complete(problem, method, iteration)
    if (velocity%criterion() <= above%error*problem%error_scale) return
    self%may_try = .false.
    if (.not. allocated(self%before)) allocate (self%before(size(problem%sub)))
    call copy_impulses(problem, self%before)
    self%error_before = velocity%measure_of_start()
    call carry_loads(problem, above%way, method%work, sweeps, carried)
    if (.not. sweeps > 0.0_dp) return
    self%sweeps = self%sweeps + sweeps
    if (.not. carried) then
      call go_back(self, problem, method, velocity, iteration, error)
      return
    end if
    self%layered = .true.
    self%ends = iteration + trial
    call begin_anew(problem, method, velocity, iteration, error)
    self%anew = .true.
  end subroutine try

  !> Go on from the pass where it has brought something, else from the impulses before it. Collective.
  subroutine judge(self, problem, method, velocity, iteration, error)
    type(layer_trial_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    type(error_t), allocatable, intent(inout) :: error

    call velocity%complete(problem, method, iteration)
    if (velocity%measure_of_start() < worth_keeping*self%error_before) then
      ! what errors of the layers have left, another pass lowers again
      self%may_try = velocity%levels%most_depth > very_deep
      return
    end if
    call go_back(self, problem, method, velocity, iteration, error)
  end subroutine judge

  !> The method starts anew from the impulses before the pass. Collective.
  subroutine go_back(self, problem, method, velocity, iteration, error)
    type(layer_trial_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    type(error_t), allocatable, intent(inout) :: error

    self%layered = .false.
    call restore_impulses(problem, self%before)
    call begin_anew(problem, method, velocity, iteration, error)
    self%anew = .true.
  end subroutine go_back

end module gravier_layer_trial
