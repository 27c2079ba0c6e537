!> The interface problem of the enriched dual method, X_eta F = b, X_eta = sum_E A_E M_eta,E^-1 A_E^T (paper, (28)-(29)).
!>
!> The rows of A_E tie the copies of a body one to the next, over its sharers in ascending order: multiplier p of a body
!> of multiplicity m, p = 1 to m - 1, says V_p - V_(p+1) = 0. The subdomain with copy rank p of a body holds multiplier p as
!> `upper` and p - 1 as `lower`, and so does its neighbour on the chain: both compute the same bits.
module gravier_interface_problem
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  implicit none
  private
  public :: interface_field_t, interface_solver_t
  public :: make_field, chain_differences, load_transpose, dot_field

  !> Values on the multipliers that one subdomain touches; zero beyond the ends of a chain.
  type :: interface_field_t
    !> (nv, n_shared)
    real(dp), allocatable :: upper(:, :), lower(:, :)
  end type interface_field_t

  !> A way to solve X_eta F = b.
  type, abstract :: interface_solver_t
    integer(i8) :: iterations = 0
  contains
    procedure(prepare_problem), deferred :: prepare
    procedure(solve_problem), deferred :: solve
    procedure(free_solver), deferred :: free
  end type interface_solver_t

  abstract interface
    !> Make ready for new matrices or a new interface. Collective; an error is the same on all ranks.
    subroutine prepare_problem(self, problem, matrix, error)
      import :: interface_solver_t, contact_problem_t, enriched_matrix_t, error_t
      implicit none
      class(interface_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      type(enriched_matrix_t), intent(inout) :: matrix
      type(error_t), allocatable, intent(inout) :: error
    end subroutine prepare_problem
    !> Solve for F. Collective; an error is the same on all ranks.
    subroutine solve_problem(self, problem, matrix, b, f, error)
      import :: interface_solver_t, contact_problem_t, enriched_matrix_t, interface_field_t, error_t
      implicit none
      class(interface_solver_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      type(enriched_matrix_t), intent(inout) :: matrix
      !> right-hand side, by subdomain of this rank [m/s, rad/s]
      type(interface_field_t), intent(in) :: b(:)
      !> a guess in, the solution out [N s, N m s]; only the iterative solver uses the guess
      type(interface_field_t), intent(inout) :: f(:)
      type(error_t), allocatable, intent(inout) :: error
    end subroutine solve_problem
    subroutine free_solver(self)
      import :: interface_solver_t
      implicit none
      class(interface_solver_t), intent(inout) :: self
    end subroutine free_solver
  end interface

contains

  !> A field of zeros.
  subroutine make_field(shared, field)
    type(shared_exchange_t), intent(in) :: shared
    type(interface_field_t), allocatable, intent(out) :: field(:)
    integer :: s

    allocate (field(size(shared%part)))
    do s = 1, size(field)
      allocate (field(s)%upper(shared%width, shared%n_shared(s)), field(s)%lower(shared%width, shared%n_shared(s)), source=0.0_dp)
    end do
  end subroutine make_field

  !> sum_E A_E y_E of the body values in `body_work`: the difference of neighbours on each chain. Collective.
  subroutine chain_differences(shared, matrix, field)
    type(shared_exchange_t), intent(inout) :: shared
    type(enriched_matrix_t), intent(in) :: matrix
    type(interface_field_t), intent(inout) :: field(:)
    integer :: s, k, at

    do s = 1, size(field)
      call shared%load(s, matrix%part(s)%body_work)
    end do
    call shared%pass()
    do s = 1, size(field)
      associate (part => shared%part(s), y => matrix%part(s)%body_work)
        do k = 1, part%n_shared
          at = part%first(k) + part%copy_rank(k) - 1
          field(s)%upper(:, k) = 0.0_dp
          field(s)%lower(:, k) = 0.0_dp
          if (at < part%first(k + 1) - 1) field(s)%upper(:, k) = y(:, part%body(k)) - part%recv(:, part%slot(at + 1))
          if (at > part%first(k)) field(s)%lower(:, k) = part%recv(:, part%slot(at - 1)) - y(:, part%body(k))
        end do
      end associate
    end do
  end subroutine chain_differences

  !> body_work := A_E^T f.
  subroutine load_transpose(shared, s, f, matrix)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: s
    type(interface_field_t), intent(in) :: f
    type(enriched_matrix_t), intent(inout) :: matrix
    integer :: k

    associate (part => shared%part(s))
      matrix%part(s)%body_work(:, :) = 0.0_dp
      do k = 1, part%n_shared
        matrix%part(s)%body_work(:, part%body(k)) = f%upper(:, k) - f%lower(:, k)
      end do
    end associate
  end subroutine load_transpose

  !> Scalar product of two fields, each multiplier counted once. Collective.
  real(dp) function dot_field(problem, a, b) result(dot)
    type(contact_problem_t), intent(in) :: problem
    type(interface_field_t), intent(in) :: a(:), b(:)
    real(dp), allocatable :: part(:)
    integer :: s

    allocate (part(size(a)))
    do s = 1, size(a)
      part(s) = sum(a(s)%upper*b(s)%upper)
    end do
    dot = problem%comm%sum_real(part)
  end function dot_field

end module gravier_interface_problem
