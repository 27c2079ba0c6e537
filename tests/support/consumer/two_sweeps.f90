!> A method of one's own: nonlinear Gauss-Seidel that looks at the solution after every second sweep.
module two_sweeps
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method_options, only: method_features_t
  use gravier_nlgs, only: nlgs_t
  implicit none
  private
  public :: two_sweeps_t

  type, extends(nlgs_t) :: two_sweeps_t
  contains
    procedure, nopass :: features => two_sweeps_features
    procedure :: iterate => two_sweeps_iterate
  end type two_sweeps_t

contains

  pure function two_sweeps_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="two_sweeps", meaning="two sweeps of nonlinear Gauss-Seidel an iteration", &
      & decomposes=.false., moments=.true.)
  end function two_sweeps_features

  subroutine two_sweeps_iterate(self, problem, measure, jump, error)
    class(two_sweeps_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error

    call self%nlgs_t%iterate(problem, .false., jump, error)
    call self%nlgs_t%iterate(problem, measure, jump, error)
  end subroutine two_sweeps_iterate

end module two_sweeps
