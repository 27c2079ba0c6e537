!> NSCDD: dual domain decomposition with shared masses (paper, (10)-(14)).
module gravier_nscdd
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_exchange
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t, start_sweeps, sweep_and_pass
  use gravier_method_options, only: method_features_t, default_always
  implicit none
  private
  public :: nscdd_t, average_copies

  type, extends(method_t) :: nscdd_t
  contains
    procedure, nopass :: features => nscdd_features
    procedure :: start => nscdd_start
    procedure :: iterate => nscdd_iterate
  end type nscdd_t

contains

  pure function nscdd_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="nscdd", meaning="NSCDD", moments=.true., &
      & accelerated_by_default=default_always)
  end function nscdd_features

  subroutine nscdd_start(self, problem, error)
    class(nscdd_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    call start_sweeps(self, problem, shared_masses=.true.)
  end subroutine nscdd_start

  subroutine nscdd_iterate(self, problem, measure, jump, error)
    class(nscdd_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error

    jump = 0.0_dp
    if (allocated(error)) return
    call sweep_and_pass(self, problem)
    if (measure) jump = problem%received_jump()
    call start_timer(phase_exchange)
    call take_averages(problem)
    call stop_timer(phase_exchange)
    self%work%interface_solves = self%work%interface_solves + 1
  end subroutine nscdd_iterate

  !> Solve the interface problem X F = sum_E A_E M~_E^-1 (R_E + R_E^d) (11) in closed form: with masses shared equally,
  !> every copy of a body takes the mean of its copies' velocities. Collective.
  subroutine average_copies(problem)
    type(contact_problem_t), intent(inout) :: problem
    integer :: s

    do s = 1, size(problem%sub)
      call problem%shared%load(s, problem%sub(s)%velocity)
    end do
    call problem%shared%pass()
    call take_averages(problem)
  end subroutine average_copies

  !> The same where the copies' velocities have just been passed.
  subroutine take_averages(problem)
    type(contact_problem_t), intent(inout) :: problem
    integer :: s

    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%velocity, mean=.true.)
    end do
  end subroutine take_averages

end module gravier_nscdd
