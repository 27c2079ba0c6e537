!> Overlaps that errors of many steps have built up are taken back by moving grains, not by velocities: a projection of
!> the places on the places without too much overlap. It gives no grain kinetic energy, whatever the time step.
module gravier_overlap_projection
  use gravier_kinds, only: dp, i8
  use gravier_timers, only: start_timer, stop_timer, phase_bodies
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_nscdd, only: average_copies
  use gravier_problem_builder, only: take_displacements
  implicit none
  private
  public :: project_overlaps

  !> sweeps of one projection: what they leave is for the next steps
  integer, parameter :: sweeps = 10

  !> What a projection borrows of a subproblem.
  type :: borrowed_t
    real(dp), allocatable :: hot(:, :), impulse(:, :)
  end type borrowed_t

contains

  !> Move grains so that no overlap exceeds `allowed`, as far as some sweeps of nonlinear Gauss-Seidel lead there:
  !> displacements in the metric of the masses, M d = H p with p >= 0 orthogonal to n.(d_i - d_j) + gap + allowed >= 0, in all
  !> subdomains with shared masses as in NSCDD. Boundaries stay where they are. The problem comes back as it was but for the
  !> velocities in it. Collective.
  subroutine project_overlaps(decomposition, problem, allowed)
    type(decomposition_t), intent(inout) :: decomposition
    !> of a step that is over; gaps at its q_m
    type(contact_problem_t), intent(inout) :: problem
    !> [m]
    real(dp), intent(in) :: allowed
    type(borrowed_t) :: borrowed(size(problem%sub))
    integer :: s, k

    call start_timer(phase_bodies)
    do s = 1, size(problem%sub)
      call lend(problem, s, allowed, borrowed(s))
    end do
    do k = 1, sweeps
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          call problem%kernels%sweep(sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse)
        end associate
      end do
      call average_copies(problem)
    end do
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        sub%v_global(:, :) = sub%velocity
        call move_alloc(borrowed(s)%hot, sub%hot)
        call move_alloc(borrowed(s)%impulse, sub%impulse)
      end associate
    end do
    call take_displacements(decomposition, problem)
    call stop_timer(phase_bodies)
  end subroutine project_overlaps

  !> Make a subproblem one of displacements: frictionless, from rest, with gaps in the place of velocities.
  subroutine lend(problem, s, allowed, borrowed)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s
    real(dp), intent(in) :: allowed
    type(borrowed_t), intent(out) :: borrowed
    integer :: c, nd

    nd = problem%kernels%nd
    associate (sub => problem%sub(s))
      borrowed%hot = sub%hot
      borrowed%impulse = sub%impulse
      sub%velocity(:, :) = 0.0_dp
      sub%impulse(:, :) = 0.0_dp
      do c = 1, sub%n_contacts
        sub%hot(nd + 1, c) = sub%gap(c) + allowed
        ! no friction
        if (problem%kernels%nc > 1) sub%hot(nd + 6, c) = 0.0_dp
      end do
      call sub%share_masses(.true.)
      sub%weight(:, sub%n_grains + 1:) = 0.0_dp
      call sub%update_local_operator()
    end associate
  end subroutine lend

end module gravier_overlap_projection
