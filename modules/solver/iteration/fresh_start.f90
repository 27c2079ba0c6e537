!> Starts of a method in the course of a solve, from the impulses that the problem holds.
!>
!> Sweeps change velocities by additions, and these keep the roundings of the impulses that they started from. Where the impulses of
!> a solve are far below those, as after a shock of a group on which nothing acts, these roundings are more than the tolerance of
!> the residual. The method then starts anew: its velocities are made from the impulses of now. Impulses that have grown in between
!> do not count: what a safeguard of the method has learned from their growth would be forgotten.
module gravier_fresh_start
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_velocity_error, only: velocity_error_t
  implicit none
  private
  public :: fresh_start_t, begin_anew

  !> roundings of impulses, a contact, that velocities may keep; part of the tolerance that these may take
  real(dp), parameter :: rounding = 64.0_dp*epsilon(1.0_dp), share = 0.1_dp
  !> impulses are not far below others above this part of them, however small the tolerance is
  real(dp), parameter :: far_below = 0.1_dp

  type :: fresh_start_t
    private
    !> part of the first impulses below which velocities are made anew
    real(dp) :: part = 0.0_dp
    !> root mean square of the impulses that velocities were made from [N s]
    real(dp) :: first = 0.0_dp
  contains
    procedure :: init => fresh_start_init
    procedure :: renew => fresh_start_renew
  end type fresh_start_t

contains

  !> Say what a solve starts with, after its first check.
  pure subroutine fresh_start_init(self, problem, tolerance)
    class(fresh_start_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> of the residual
    real(dp), intent(in) :: tolerance

    self%part = min(far_below, rounding/(share*max(tolerance, rounding)))
    self%first = problem%impulse_scale
  end subroutine fresh_start_init

  !> After a check that did not end the solve: let the method start anew where its velocities keep too large roundings. Collective.
  subroutine fresh_start_renew(self, problem, method, velocity, iteration, anew, error)
    class(fresh_start_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    !> becomes true where the method has started anew
    logical, intent(inout) :: anew
    type(error_t), allocatable, intent(inout) :: error

    if (.not. problem%impulse_scale < self%part*self%first) return
    self%first = problem%impulse_scale
    call begin_anew(problem, method, velocity, iteration, error)
    anew = .true.
  end subroutine fresh_start_renew

  !> The method starts anew from the impulses that the problem holds now. Collective.
  subroutine begin_anew(problem, method, velocity, iteration, error)
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iteration
    type(error_t), allocatable, intent(inout) :: error

    call method%start(problem, error)
    method%work%solves = method%work%solves - 1
    call velocity%begin_anew(iteration)
  end subroutine begin_anew

end module gravier_fresh_start
