!> The impulses that the enriched interface problem predicts, fed back into those of the contacts.
!>
!> With velocities V that agree in all copies, the search direction r~ - r + l (v~ - v) = 0 on active contacts gives one linear
!> problem for the undivided bodies, (M + H l H^T) Y = H l (v - H^T V), which the interface problem solves: V + Y are the
!> velocities that it predicts, r~ = r + l (v - H^T (V + Y)) the impulses. They are projected on the cones of the contact laws,
!> d = P(r~) - r, and taken as far as the energy 1/2 r.W r + r.(v^d + shift) falls along d, but not beyond r + d: cones are
!> convex, so that r + alpha d obeys the laws for alpha in [0, 1]. Without friction sweeps let that energy fall too, and the
!> contacts' solution is where it is lowest.
module gravier_impulse_feedback
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_contact_kernels, only: kernels_t, project_on_cones
  use gravier_body_mass, only: apply_inverse_mass
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_enriched_matrix, only: enriched_matrix_t, drop_inactive
  use gravier_interface_problem, only: interface_field_t, load_transpose
  implicit none
  private
  public :: impulse_feedback_t

  type :: feedback_part_t
    !> Y (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable :: lead(:, :)
    !> d (lanes, nc, blocks) [N s]
    real(dp), allocatable :: step(:, :, :)
  end type feedback_part_t

  type :: impulse_feedback_t
    !> alpha of the last correction
    real(dp) :: share = 1.0_dp
    type(feedback_part_t), allocatable, private :: part(:)
  contains
    procedure :: start => impulse_feedback_start
    procedure :: keep_lead => impulse_feedback_keep_lead
    procedure :: take => impulse_feedback_take
  end type impulse_feedback_t

contains

  !> Make room for the contacts of a new problem.
  subroutine impulse_feedback_start(self, problem)
    class(impulse_feedback_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer :: s

    if (allocated(self%part)) deallocate (self%part)
    allocate (self%part(size(problem%sub)))
    do s = 1, size(problem%sub)
      allocate (self%part(s)%lead, mold=problem%sub(s)%velocity)
      allocate (self%part(s)%step, mold=problem%sub(s)%impulse)
    end do
  end subroutine impulse_feedback_start

  !> Keep what `enrich` has left in body_work of subdomain `s`: Y before multipliers tie the copies.
  subroutine impulse_feedback_keep_lead(self, s, matrix)
    class(impulse_feedback_t), intent(inout) :: self
    integer, intent(in) :: s
    type(enriched_matrix_t), intent(in) :: matrix
    self%part(s)%lead(:, :) = matrix%part(s)%body_work
  end subroutine impulse_feedback_keep_lead

  !> Correct impulses and velocities. Velocities must agree in all copies, and do so afterwards. Collective; an error is the same
  !> on all ranks.
  subroutine impulse_feedback_take(self, problem, matrix, multipliers, error)
    class(impulse_feedback_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    !> that tie the copies [N s, N m s]
    type(interface_field_t), intent(in) :: multipliers(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: parts(2, size(problem%sub)), sums(2)
    integer :: s

    do s = 1, size(problem%sub)
      call load_transpose(problem%shared, s, multipliers(s), matrix)
      call matrix%solve(problem%sub(s), s, matrix%part(s)%body_work, error)
      associate (part => self%part(s), sub => problem%sub(s), work => matrix%part(s)%contact_work)
        part%lead(:, :) = sub%velocity + part%lead - matrix%part(s)%body_work
        call sub%contact_velocity(problem%kernels, part%lead, work)
        work(:, :, :) = matrix%part(s)%direction*(matrix%part(s)%law_velocity - work)
        call drop_inactive(problem%kernels, sub, work)
        part%step(:, :, :) = sub%impulse + work
        call project_on_cones(problem%kernels, sub%n_contacts, sub%hot, part%step)
        part%step(:, :, :) = part%step - sub%impulse
        call sub%react_to(problem%kernels, part%step)
        call problem%shared%load(s, sub%reaction)
      end associate
    end do
    call problem%comm%agree(error)
    if (allocated(error)) return
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%reaction, mean=.false.)
      call velocity_change(problem%sub(s), self%part(s)%lead)
      associate (part => self%part(s), sub => problem%sub(s), work => matrix%part(s)%contact_work)
        call sub%contact_velocity(problem%kernels, sub%velocity, work)
        work(:, 1, :) = work(:, 1, :) + sub%hot(:, problem%nd + 1, :)
        associate (row => problem%shift_row, nf => problem%nf)
          if (row > 0) work(:, 2:nf, :) = work(:, 2:nf, :) + sub%hot(:, row + 1:row + nf - 1, :)
        end associate
        call add_compliance(problem%kernels, sub, sub%impulse, work)
        parts(1, s) = sum(part%step*work)
        call sub%contact_velocity(problem%kernels, part%lead, work)
        call add_compliance(problem%kernels, sub, part%step, work)
        parts(2, s) = sum(part%step*work)
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    self%share = 0.0_dp
    if (sums(1) < 0.0_dp) self%share = min(1.0_dp, -sums(1)/max(sums(2), -sums(1)))
    do s = 1, size(problem%sub)
      associate (part => self%part(s), sub => problem%sub(s))
        call sub%add_impulses(self%share, part%step)
        sub%velocity(:, :) = sub%velocity + self%share*part%lead
      end associate
    end do
  end subroutine impulse_feedback_take

  !> Add to velocities of contacts what compliant ones yield under impulses.
  pure subroutine add_compliance(kernels, sub, impulse, velocity)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> (lanes, nc, blocks) [N s], [m/s]
    real(dp), intent(in), contiguous :: impulse(:, :, :)
    real(dp), intent(inout), contiguous :: velocity(:, :, :)
    integer :: d

    if (.not. kernels%has_compliance()) return
    velocity(:, 1, :) = velocity(:, 1, :) + sub%hot(:, kernels%row%compliance_n, :)*impulse(:, 1, :)
    do d = 2, kernels%nf
      velocity(:, d, :) = velocity(:, d, :) + sub%hot(:, kernels%row%compliance_t, :)*impulse(:, d, :)
    end do
  end subroutine add_compliance

  !> M^-1 H d of the undivided bodies, from the reactions that all copies have summed.
  pure subroutine velocity_change(sub, change)
    type(subproblem_t), intent(in) :: sub
    !> (nv, n_columns)
    real(dp), intent(inout), contiguous :: change(:, :)
    integer :: b

    do b = 1, sub%n_columns
      call apply_inverse_mass(sub%inverse_mass(:, b), sub%reaction(:, b), change(:, b))
    end do
  end subroutine velocity_change

end module gravier_impulse_feedback
