!> Parallel conjugate gradient on the interface problem (paper, (34) and Algorithm 1): X_eta is never formed, its product
!> with a vector is one solve with the factors of M_eta,E in every subdomain and one exchange. The diagonal of X for l = 0,
!> twice the inverse of the shared masses, preconditions it: it costs nothing and makes the count of iterations
!> independent of units, since translations and spins meet in one vector.
module gravier_interface_cg
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_interface_problem, only: interface_field_t, interface_solver_t, make_field, chain_differences, load_transpose, &
    & dot_field
  implicit none
  private
  public :: interface_cg_t

  type, extends(interface_solver_t) :: interface_cg_t
    !> |b - X f| / |b| at which to stop, in the norm of the inverse of that diagonal
    real(dp) :: tolerance = 1.0e-12_dp
    integer :: max_iterations = 10000
  contains
    procedure :: prepare => interface_cg_prepare
    procedure :: solve => interface_cg_solve
    procedure :: free => interface_cg_free
  end type interface_cg_t

contains

  !> Nothing is formed: the factors of the subdomains are all it takes.
  subroutine interface_cg_prepare(self, problem, matrix, error)
    class(interface_cg_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(error_t), allocatable, intent(inout) :: error

    if (size(problem%sub) /= size(matrix%part)) call raise(error, status_failure, "interface problem without its matrices")
    self%tolerance = max(self%tolerance, epsilon(1.0_dp))
  end subroutine interface_cg_prepare

  subroutine interface_cg_solve(self, problem, matrix, b, f, error)
    class(interface_cg_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(interface_field_t), intent(in) :: b(:)
    type(interface_field_t), intent(inout) :: f(:)
    type(error_t), allocatable, intent(inout) :: error
    type(interface_field_t), allocatable :: r(:), z(:), p(:), xp(:)
    real(dp) :: bound, rz, rz_old, step
    integer :: k

    call make_field(problem%shared, r)
    call make_field(problem%shared, z)
    call make_field(problem%shared, xp)
    call precondition(problem%sub, problem%shared, b, z)
    bound = self%tolerance**2*dot_field(problem, b, z)
    call apply(problem, matrix, f, xp, error)
    call combine(r, b, -1.0_dp, xp)
    call precondition(problem%sub, problem%shared, r, z)
    p = z
    rz = dot_field(problem, r, z)
    do k = 1, self%max_iterations
      if (rz <= bound .or. allocated(error)) return
      call apply(problem, matrix, p, xp, error)
      step = rz/dot_field(problem, p, xp)
      call combine(f, f, step, p)
      call combine(r, r, -step, xp)
      call precondition(problem%sub, problem%shared, r, z)
      rz_old = rz
      rz = dot_field(problem, r, z)
      call combine(p, z, rz/rz_old, p)
      self%iterations = self%iterations + 1
    end do
    if (.not. rz <= bound) call raise(error, status_failure, "conjugate gradient on the interface: "// &
      & to_text(self%max_iterations)//" iterations did not reach cg_tolerance = "//to_text(self%tolerance, 3))
  end subroutine interface_cg_solve

  !> z := r divided by the diagonal of X for l = 0; zero, as r is, for a component that cannot move.
  subroutine precondition(sub, shared, r, z)
    type(subproblem_t), intent(in) :: sub(:)
    type(shared_exchange_t), intent(in) :: shared
    type(interface_field_t), intent(in) :: r(:)
    type(interface_field_t), intent(inout) :: z(:)
    integer :: s, k

    do s = 1, size(r)
      associate (part => shared%part(s))
        do k = 1, part%n_shared
          z(s)%upper(:, k) = 0.5_dp*r(s)%upper(:, k)
          z(s)%lower(:, k) = 0.5_dp*r(s)%lower(:, k)
          call sub(s)%multiply_mass(part%body(k), z(s)%upper(:, k))
          call sub(s)%multiply_mass(part%body(k), z(s)%lower(:, k))
        end do
      end associate
    end do
  end subroutine precondition

  !> xf := X_eta f. Collective; an error is the same on all ranks.
  subroutine apply(problem, matrix, f, xf, error)
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(interface_field_t), intent(in) :: f(:)
    type(interface_field_t), intent(inout) :: xf(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    do s = 1, size(f)
      call load_transpose(problem%shared, s, f(s), matrix)
      call matrix%solve(problem%sub(s), s, matrix%part(s)%body_work, error)
    end do
    call chain_differences(problem%shared, matrix, xf)
    call problem%comm%agree(error)
  end subroutine apply

  !> result := a + c b, on all multipliers.
  pure subroutine combine(result, a, c, b)
    type(interface_field_t), intent(inout) :: result(:)
    type(interface_field_t), intent(in) :: a(:)
    real(dp), intent(in) :: c
    type(interface_field_t), intent(in) :: b(:)
    integer :: s

    do s = 1, size(result)
      result(s)%upper(:, :) = a(s)%upper + c*b(s)%upper
      result(s)%lower(:, :) = a(s)%lower + c*b(s)%lower
    end do
  end subroutine combine

  subroutine interface_cg_free(self)
    class(interface_cg_t), intent(inout) :: self
    self%iterations = 0
  end subroutine interface_cg_free

end module gravier_interface_cg
