!> Impulses of a problem that are kept beside those under way.
module gravier_kept_impulses
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_cell_response, only: respond
  implicit none
  private
  public :: kept_impulses_t, copy_impulses, restore_impulses, return_to

  !> Of a subdomain (lanes, nc, blocks) [N s].
  type :: kept_impulses_t
    real(dp), allocatable :: value(:, :, :)
  end type kept_impulses_t

contains

  !> Keep the impulses of the problem.
  pure subroutine copy_impulses(problem, kept)
    type(contact_problem_t), intent(in) :: problem
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(inout) :: kept(:)
    integer :: s

    do s = 1, size(kept)
      kept(s)%value = problem%sub(s)%impulse
    end do
  end subroutine copy_impulses

  !> Put kept impulses back into the problem; its velocities are not those under them.
  pure subroutine restore_impulses(problem, kept)
    type(contact_problem_t), intent(inout) :: problem
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: kept(:)
    integer :: s

    do s = 1, size(kept)
      problem%sub(s)%impulse(:, :, :) = kept(s)%value
    end do
  end subroutine restore_impulses

  !> Take the problem back to a solve that has ended, of which its impulses were kept: to these impulses, the velocities of bodies
  !> and of the cell under them, and the velocities of the contacts. Collective.
  subroutine return_to(problem, kept)
    type(contact_problem_t), intent(inout) :: problem
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: kept(:)
    real(dp) :: residual, defect

    call restore_impulses(problem, kept)
    call respond(problem)
    call problem%evaluate()
    call problem%residual(residual, defect)
  end subroutine return_to

end module gravier_kept_impulses
