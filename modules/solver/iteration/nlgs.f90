!> Nonlinear Gauss-Seidel over one undivided domain.
module gravier_nlgs
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t, start_sweeps, sweep_all
  use gravier_method_options, only: method_features_t, default_always
  implicit none
  private
  public :: nlgs_t

  type, extends(method_t) :: nlgs_t
  contains
    procedure, nopass :: features => nlgs_features
    procedure :: start => nlgs_start
    procedure :: iterate => nlgs_iterate
  end type nlgs_t

contains

  pure function nlgs_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="nlgs", meaning="nonlinear Gauss-Seidel on one domain", decomposes=.false., &
      & moments=.true., accelerated_by_default=default_always)
  end function nlgs_features

  subroutine nlgs_start(self, problem, error)
    class(nlgs_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    call start_sweeps(self, problem, shared_masses=.false.)
  end subroutine nlgs_start

  subroutine nlgs_iterate(self, problem, measure, jump, error)
    class(nlgs_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error

    jump = 0.0_dp
    if (allocated(error)) return
    call sweep_all(self, problem)
    ! one domain has no copies
    if (measure) jump = 0.0_dp
  end subroutine nlgs_iterate

end module gravier_nlgs
