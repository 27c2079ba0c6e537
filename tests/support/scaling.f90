!> A method that finds no solution, for tests of what goes on with solves.
module gravier_test_scaling
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_method_options, only: method_features_t
  implicit none
  private
  public :: scaling_t

  !> Not a method: multiplies the impulses at each iteration.
  type, extends(method_t) :: scaling_t
    real(dp) :: factor = 1.0_dp
    integer :: done = 0
  contains
    procedure, nopass :: features => scaling_features
    procedure :: start => scaling_start
    procedure :: iterate => scaling_iterate
  end type scaling_t

contains

  pure function scaling_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="scaling")
  end function scaling_features

  subroutine scaling_start(self, problem, error)
    class(scaling_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    ! it has no sweeps that tell how far they went: no check is left out
    if (allocated(problem%progress)) deallocate (problem%progress)
    allocate (problem%progress(2, 1), source=0.0_dp)
    problem%progress_is_summed = .false.
    call problem%evaluate()
  end subroutine scaling_start

  subroutine scaling_iterate(self, problem, measure, jump, error)
    class(scaling_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error

    jump = merge(0.0_dp, -1.0_dp, measure)
    if (allocated(error)) return
    self%done = self%done + 1
    problem%sub(1)%impulse(:, :, :) = self%factor*problem%sub(1)%impulse
  end subroutine scaling_iterate

end module gravier_test_scaling
