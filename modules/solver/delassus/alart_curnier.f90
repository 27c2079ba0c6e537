!> The function of Alart and Curnier on a packed contact problem: zero where impulses and velocities satisfy Signorini's condition
!> and Coulomb's law, and piecewise smooth, with the blocks of its generalised Jacobian.
!>
!> With x = r - v/s, s the stiffness of each contact, P_n = max(x_n, 0) and P_t = x_t cut to the disc of radius mu P_n
!> (gravier_friction_cone), it is F = s (r - P) [m/s]: v where a contact sticks, s r where it is open.
module gravier_alart_curnier
  use gravier_kinds, only: dp
  use gravier_friction_cone, only: project_by_parts, is_open, sticks
  use gravier_delassus, only: delassus_t
  implicit none
  private
  public :: alart_curnier_t

  type :: alart_curnier_t
    !> velocities and the function at the point evaluated last (dimension, contacts)
    real(dp), allocatable :: v(:, :), f(:, :)
    !> dP/dx of each contact by columns (dimension**2, contacts)
    real(dp), private, allocatable :: cut(:, :)
    !> blocks of the Jacobian, in the order of those of the problem
    real(dp), allocatable :: own(:, :), coupling(:, :)
  contains
    procedure :: init => alart_curnier_init
    procedure :: evaluate => alart_curnier_evaluate
    procedure :: differentiate => alart_curnier_differentiate
  end type alart_curnier_t

contains

  subroutine alart_curnier_init(self, problem)
    class(alart_curnier_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    integer :: d, n

    d = problem%dimension
    n = problem%n_contacts
    if (allocated(self%v)) deallocate (self%v, self%f, self%cut, self%own, self%coupling)
    allocate (self%v(d, n), self%f(d, n), self%cut(d**2, n), self%own(d**2, n), self%coupling(d**2, size(problem%other)))
  end subroutine alart_curnier_init

  !> Velocities, the function and dP/dx at r.
  subroutine alart_curnier_evaluate(self, problem, r, size_of_f)
    class(alart_curnier_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    !> (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :)
    !> |F| [m/s]
    real(dp), intent(out) :: size_of_f
    integer :: a

    call problem%velocity(r, self%v)
    do a = 1, problem%n_contacts
      self%f(:, a) = r(:, a) - self%v(:, a)/problem%stiffness(a)
      call cut_to_law(problem%mu(a), self%f(:, a), self%cut(:, a))
      self%f(:, a) = problem%stiffness(a)*(r(:, a) - self%f(:, a))
    end do
    size_of_f = norm2(self%f)
  end subroutine alart_curnier_evaluate

  !> P of x, and dP/dx.
  pure subroutine cut_to_law(mu, x, derivative)
    real(dp), intent(in) :: mu
    !> x in, P out
    real(dp), intent(inout), contiguous :: x(:)
    !> by columns
    real(dp), intent(out), contiguous :: derivative(:)
    real(dp) :: along(2), kept
    integer :: d, i, j, state

    d = size(x)
    along(:) = 0.0_dp
    kept = 0.0_dp
    call project_by_parts(mu, x, state, along(1:d - 1), kept)
    derivative(:) = 0.0_dp
    if (state == is_open) return
    derivative(1) = 1.0_dp
    do i = 2, d
      if (state == sticks) then
        derivative(i + (i - 1)*d) = 1.0_dp
        cycle
      end if
      derivative(i) = mu*along(i - 1)
      do j = 2, d
        derivative(i + (j - 1)*d) = -kept*along(i - 1)*along(j - 1)
      end do
      derivative(i + (i - 1)*d) = derivative(i + (i - 1)*d) + kept
    end do
  end subroutine cut_to_law

  !> Blocks of the Jacobian at the point evaluated last: cut W + s (1 - cut).
  subroutine alart_curnier_differentiate(self, problem)
    class(alart_curnier_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    real(dp) :: moved(problem%dimension**2)
    integer :: a, i, k, d, diagonal

    d = problem%dimension
    do a = 1, problem%n_contacts
      moved = problem%own(:, a)
      do i = 1, d
        diagonal = 1 + (i - 1)*(d + 1)
        moved(diagonal) = moved(diagonal) - problem%stiffness(a)
      end do
      call multiply(d, self%cut(:, a), moved, self%own(:, a))
      do i = 1, d
        diagonal = 1 + (i - 1)*(d + 1)
        self%own(diagonal, a) = self%own(diagonal, a) + problem%stiffness(a)
      end do
      do k = problem%first(a), problem%first(a + 1) - 1
        call multiply(d, self%cut(:, a), problem%coupling(:, k), self%coupling(:, k))
      end do
    end do
  end subroutine alart_curnier_differentiate

  !> c = a b, of order d.
  pure subroutine multiply(d, a, b, c)
    integer, intent(in) :: d
    real(dp), intent(in) :: a(d, d), b(d, d)
    real(dp), intent(out) :: c(d, d)
    integer :: i, j

    do j = 1, d
      c(:, j) = 0.0_dp
      do i = 1, d
        c(:, j) = c(:, j) + a(:, i)*b(i, j)
      end do
    end do
  end subroutine multiply

end module gravier_alart_curnier
