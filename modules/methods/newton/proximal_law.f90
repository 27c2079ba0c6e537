!> The contact law of one subdomain as an equation to which Newton's method applies, in its proximal form.
!>
!> With the projection P of Alart and Curnier (gravier_friction_cone: P_n = max(x_n, 0), P_t = x_t cut to the disc of radius
!> mu P_n), s the diagonal of the undivided local operator, v~ the velocity with its shift and r_k the centre of a proximal point,
!>   F(r, v) = r - P(x),   x = r - (v~ + alpha s (r - r_k))/(b s):
!> F = 0 says that r and v~ + alpha s (r - r_k) satisfy Signorini's condition and Coulomb's law, and for r = r_k that r and v~ do.
!> b = 1 gives the function of gravier_alart_curnier, b = alpha the augmented Lagrangian, in which x is a function of v alone;
!> between them, with b = sqrt(alpha), points are found in the fewest steps (doc/newton.md). Linearised, dr = c - L dv with
!>   L = (1 - (1 - a) D)^-1 D/(b s),   c = -(1 - (1 - a) D)^-1 F,   D = dP/dx,   a = alpha/b.
!> Where contacts are compliant v~ has a part c r, and a is alpha/b + c/(b s), one along the normal and one along the tangents.
module gravier_proximal_law
  use gravier_kinds, only: dp
  use gravier_friction_cone, only: project_by_parts, is_open, sticks, slides
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, lane_of, block_of
  use gravier_contact_problem, only: subproblem_t
  use gravier_contact_operator, only: find_local_operator
  implicit none
  private
  public :: proximal_law_t

  type :: proximal_law_t
    !> centre r_k, F and c (lanes, nc, blocks) [N s]
    real(dp), allocatable :: centre(:, :, :), f(:, :, :), offset(:, :, :)
    !> L (nc, nc, contacts) [kg]
    real(dp), allocatable :: slope(:, :, :)
    !> 1/W_nn and 1/W_tt of the undivided bodies (2, contacts) [kg]
    real(dp), allocatable, private :: softness(:, :)
    !> where contacts are compliant: compliances over W_nn and W_tt (2, contacts)
    real(dp), allocatable, private :: yielding(:, :)
    !> where x lies (contacts); where it is cut to the disc, its direction (2, contacts) and what is left of it (contacts)
    integer, allocatable, private :: state(:)
    real(dp), allocatable, private :: along(:, :), kept(:)
  contains
    procedure :: init => proximal_law_init
    procedure :: evaluate => proximal_law_evaluate
    procedure :: linearise => proximal_law_linearise
    procedure :: find_step => proximal_law_find_step
  end type proximal_law_t

contains

  !> Make room, and take the local operators.
  subroutine proximal_law_init(self, kernels, sub)
    class(proximal_law_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    real(dp) :: w(2)
    integer :: c, nc, n

    nc = kernels%nc
    n = sub%n_contacts
    if (allocated(self%centre)) deallocate (self%centre, self%f, self%offset, self%slope, self%softness, self%state, self%along, &
      & self%kept)
    allocate (self%centre(lanes, nc, n_blocks(n)), self%f(lanes, nc, n_blocks(n)), self%offset(lanes, nc, n_blocks(n)), &
      & self%slope(nc, nc, n), self%softness(2, n), self%along(2, n), self%kept(n), source=0.0_dp)
    allocate (self%state(n), source=is_open)
    if (allocated(self%yielding)) deallocate (self%yielding)
    if (kernels%row%compliance_n > 0) allocate (self%yielding(2, n))
    do c = 1, n
      call find_local_operator(kernels, sub%pair, sub%hot, c, sub%inverse_mass, w)
      self%softness(:, c) = 1.0_dp/w
      if (allocated(self%yielding)) self%yielding(:, c) = &
        & sub%hot(lane_of(c), kernels%row%compliance_n:kernels%row%compliance_t, block_of(c))/w
    end do
  end subroutine proximal_law_init

  !> F at the impulses of `sub`, and where each contact stands.
  subroutine proximal_law_evaluate(self, kernels, sub, v, alpha, square)
    class(proximal_law_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> velocities of the contacts (lanes, nc, blocks) [m/s]
    real(dp), intent(in), contiguous :: v(:, :, :)
    real(dp), intent(in) :: alpha
    !> |F|^2 [N^2 s^2]
    real(dp), intent(out) :: square
    real(dp) :: x(3), mu, a, b
    integer :: c, q, g, nc

    nc = kernels%nc
    b = sqrt(alpha)
    a = alpha/b
    square = 0.0_dp
    mu = 0.0_dp
    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      if (nc > 1) mu = sub%hot(q, kernels%row%friction, g)
      x(1:nc) = (1.0_dp - a)*sub%impulse(q, :, g) + a*self%centre(q, :, g)
      x(1) = x(1) - self%softness(1, c)/b*(v(q, 1, g) + sub%hot(q, kernels%row%shift, g))
      x(2:nc) = x(2:nc) - self%softness(2, c)/b*v(q, 2:, g)
      if (kernels%row%shift_t > 0) x(2:nc) = x(2:nc) &
        & - self%softness(2, c)/b*sub%hot(q, kernels%row%shift_t:kernels%row%shift_t + nc - 2, g)
      if (allocated(self%yielding)) then
        x(1) = x(1) - self%yielding(1, c)/b*sub%impulse(q, 1, g)
        x(2:nc) = x(2:nc) - self%yielding(2, c)/b*sub%impulse(q, 2:, g)
      end if
      call project_by_parts(mu, x(1:nc), self%state(c), self%along(1:nc - 1, c), self%kept(c))
      self%f(q, :, g) = sub%impulse(q, :, g) - x(1:nc)
      square = square + sum(self%f(q, :, g)**2)
    end do
  end subroutine proximal_law_evaluate

  !> L and c where `evaluate` was called last.
  pure subroutine proximal_law_linearise(self, kernels, sub, alpha)
    class(proximal_law_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(in) :: alpha
    real(dp) :: e(2), f(3), mu, across, a(2), b, soft(2)
    integer :: c, q, g, k, l, nc

    nc = kernels%nc
    b = sqrt(alpha)
    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      a(:) = alpha/b
      if (allocated(self%yielding)) a(:) = a + self%yielding(:, c)/b
      f(1:nc) = self%f(q, :, g)
      soft(:) = self%softness(:, c)/b
      self%slope(:, :, c) = 0.0_dp
      select case (self%state(c))
      case (is_open)
        self%offset(q, :, g) = -f(1:nc)
      case (sticks)
        self%offset(q, 1, g) = -f(1)/a(1)
        self%offset(q, 2:, g) = -f(2:nc)/a(2)
        self%slope(1, 1, c) = soft(1)/a(1)
        do k = 2, nc
          self%slope(k, k, c) = soft(2)/a(2)
        end do
      case (slides)
        ! across the sliding, D keeps a part and the inverse is 1/(1 - (1 - a) kept); along it D keeps nothing
        mu = sub%hot(q, kernels%row%friction, g)
        e(:) = self%along(:, c)
        across = 1.0_dp/((1.0_dp - self%kept(c)) + a(2)*self%kept(c))
        self%offset(q, 1, g) = -f(1)/a(1)
        self%slope(1, 1, c) = soft(1)/a(1)
        do k = 2, nc
          self%offset(q, k, g) = -across*(f(k) - e(k - 1)*dot_product(e(1:nc - 1), f(2:nc))) &
            & - e(k - 1)*(dot_product(e(1:nc - 1), f(2:nc)) + (1.0_dp - a(1))*mu*f(1)/a(1))
          self%slope(k, 1, c) = mu*e(k - 1)*soft(1)/a(1)
          do l = 2, nc
            self%slope(k, l, c) = self%kept(c)*across*soft(2)*(merge(1.0_dp, 0.0_dp, k == l) - e(k - 1)*e(l - 1))
          end do
        end do
      end select
    end do
  end subroutine proximal_law_linearise

  !> dr = c - L dv.
  pure subroutine proximal_law_find_step(self, dv, dr)
    class(proximal_law_t), intent(in) :: self
    !> (lanes, nc, blocks) [m/s], [N s]
    real(dp), intent(in), contiguous :: dv(:, :, :)
    real(dp), intent(inout), contiguous :: dr(:, :, :)
    integer :: c, q, g, k

    dr(:, :, :) = self%offset
    do c = 1, size(self%slope, 3)
      q = lane_of(c)
      g = block_of(c)
      do k = 1, size(dv, 2)
        dr(q, :, g) = dr(q, :, g) - self%slope(:, k, c)*dv(q, k, g)
      end do
    end do
  end subroutine proximal_law_find_step

end module gravier_proximal_law
