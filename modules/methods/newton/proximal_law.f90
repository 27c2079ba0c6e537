!> The contact law of one subdomain as an equation to which Newton's method applies, in its proximal form.
!>
!> With the projection P of Alart and Curnier (gravier_friction_cone: P_n = max(x_n, 0), P_t = x_t cut to the disc of radius
!> mu P_n, and the moments that resist rolling and pivoting likewise, each to the disc of its own coefficient), s the diagonal of
!> the undivided local operator, v~ the velocity with its shift and r_k the centre of a proximal point,
!>   F(r, v) = r - P(x),   x = r - (v~ + alpha s (r - r_k))/(b s):
!> F = 0 says that r and v~ + alpha s (r - r_k) satisfy Signorini's condition and Coulomb's law, and for r = r_k that r and v~ do.
!> b = 1 gives the function of gravier_alart_curnier, b = alpha the augmented Lagrangian, in which x is a function of v alone;
!> between them, with b = sqrt(alpha), points are found in the fewest steps (doc/newton.md). Linearised, dr = c - L dv with
!>   L = (1 - (1 - a) D)^-1 D/(b s),   c = -(1 - (1 - a) D)^-1 F,   D = dP/dx,   a = alpha/b.
!> Where contacts are compliant v~ has a part c r, and a is alpha/b + c/(b s), one along the normal and one along the tangents.
module gravier_proximal_law
  use gravier_kinds, only: dp
  use gravier_friction_cone, only: project_by_parts, sticks
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, lane_of, block_of
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_operator, only: find_local_operator, rolling_operator
  implicit none
  private
  public :: proximal_law_t, parts_of

  !> parts of an impulse that the normal part bounds, at most: the tangential one, and the moments against rolling and pivoting
  integer, parameter :: most_parts = 3

  !> Components of an impulse that one coefficient times the normal part bounds.
  type :: bounded_part_t
    !> first and last of them; row of `hot` that holds the coefficient
    integer :: first = 0, last = 0, coefficient = 0
  end type bounded_part_t

  type :: proximal_law_t
    !> centre r_k, F and c (lanes, nc, blocks) [N s]
    real(dp), allocatable :: centre(:, :, :), f(:, :, :), offset(:, :, :)
    !> L (nc, nc, contacts) [kg]
    real(dp), allocatable :: slope(:, :, :)
    !> of the tangential impulse, and of the moments against rolling and pivoting where there are such: none to three
    type(bounded_part_t), private :: part(most_parts)
    integer, private :: parts = 0
    !> 1/W_kk of the undivided bodies, the same for all components of a part (nc, contacts) [kg]
    real(dp), allocatable, private :: softness(:, :)
    !> where contacts are compliant: compliances over W_kk (nc, contacts)
    real(dp), allocatable, private :: yielding(:, :)
    !> contacts that carry nothing (contacts)
    logical, allocatable, private :: open(:)
    !> of the others, where x lies (parts, contacts); where it is cut to the disc, its direction (nc, contacts) and what is left of
    !> it (parts, contacts)
    integer, allocatable, private :: state(:, :)
    real(dp), allocatable, private :: along(:, :), kept(:, :)
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
    real(dp) :: w(2), w_rolling
    integer :: c, nc, n

    nc = kernels%nc
    n = sub%n_contacts
    call find_parts(self, kernels)
    if (allocated(self%centre)) deallocate (self%centre, self%f, self%offset, self%slope, self%softness, self%open, self%state, &
      & self%along, self%kept)
    allocate (self%centre(lanes, nc, n_blocks(n)), self%f(lanes, nc, n_blocks(n)), self%offset(lanes, nc, n_blocks(n)), &
      & self%slope(nc, nc, n), self%softness(nc, n), self%along(nc, n), self%kept(self%parts, n), source=0.0_dp)
    allocate (self%open(n), source=.true.)
    allocate (self%state(self%parts, n), source=sticks)
    if (allocated(self%yielding)) deallocate (self%yielding)
    if (kernels%has_compliance()) allocate (self%yielding(nc, n), source=0.0_dp)
    w_rolling = 0.0_dp
    do c = 1, n
      call find_local_operator(kernels, sub%pair, sub%hot, c, sub%inverse_mass, w)
      self%softness(1, c) = 1.0_dp/w(1)
      self%softness(2:kernels%nf, c) = 1.0_dp/w(2)
      ! moments on bodies that do not turn stay as they are
      if (kernels%has_rolling()) w_rolling = rolling_operator(kernels, sub%pair, sub%hot, c, sub%inverse_mass)
      if (w_rolling > 0.0_dp) self%softness(kernels%nf + 1:, c) = 1.0_dp/w_rolling
      if (.not. allocated(self%yielding)) cycle
      self%yielding(1, c) = sub%hot(lane_of(c), kernels%row%compliance_n, block_of(c))/w(1)
      self%yielding(2:kernels%nf, c) = sub%hot(lane_of(c), kernels%row%compliance_t, block_of(c))/w(2)
    end do
  end subroutine proximal_law_init

  !> How many parts of an impulse the normal part bounds.
  pure integer function parts_of(nc, nv)
    !> components of a contact, of a body: see gravier_contact_kernels
    integer, intent(in) :: nc, nv

    parts_of = 0
    if (nc > 1) parts_of = 1
    ! friction with rolling in the plane
    if (nc == 3 .and. nv == 3) parts_of = 2
    if (nc > 3) parts_of = most_parts
  end function parts_of

  !> Note the parts of an impulse that the normal part bounds, of these kernels.
  subroutine find_parts(self, kernels)
    class(proximal_law_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels

    self%parts = 0
    if (kernels%nf > 1) call add(2, kernels%nf, kernels%row%friction)
    if (.not. kernels%has_rolling()) return
    call add(kernels%nf + 1, 2*kernels%nf - 1, kernels%row%rolling_friction)
    if (kernels%nd == 3) call add(kernels%nc, kernels%nc, kernels%row%pivoting_friction)

  contains

    subroutine add(first, last, coefficient)
      integer, intent(in) :: first, last, coefficient

      self%parts = self%parts + 1
      self%part(self%parts) = bounded_part_t(first, last, coefficient)
    end subroutine add

  end subroutine find_parts

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
    real(dp) :: x(kernels%nc), a, b
    integer :: c, q, g, nf

    nf = kernels%nf
    b = sqrt(alpha)
    a = alpha/b
    square = 0.0_dp
    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      x(:) = (1.0_dp - a)*sub%impulse(q, :, g) + a*self%centre(q, :, g) - self%softness(:, c)/b*v(q, :, g)
      x(1) = x(1) - self%softness(1, c)/b*sub%hot(q, kernels%row%shift, g)
      if (kernels%row%shift_t > 0) x(2:nf) = x(2:nf) &
        & - self%softness(2:nf, c)/b*sub%hot(q, kernels%row%shift_t:kernels%row%shift_t + nf - 2, g)
      if (allocated(self%yielding)) x(:) = x - self%yielding(:, c)/b*sub%impulse(q, :, g)
      call project(self, c, sub%hot(q, :, g), x)
      self%f(q, :, g) = sub%impulse(q, :, g) - x
      square = square + sum(self%f(q, :, g)**2)
    end do
  end subroutine proximal_law_evaluate

  !> Replace x of contact `c` by P(x), part by part.
  pure subroutine project(self, c, hot, x)
    class(proximal_law_t), intent(inout) :: self
    integer, intent(in) :: c
    !> column of the contact (nh)
    real(dp), intent(in) :: hot(:)
    !> (nc) [N s]
    real(dp), intent(inout) :: x(:)
    !> the normal part and one of those that it bounds
    real(dp) :: y(3)
    integer :: k, last

    self%open(c) = x(1) <= 0.0_dp
    if (self%open(c)) then
      x(:) = 0.0_dp
      return
    end if
    y(1) = x(1)
    do k = 1, self%parts
      associate (part => self%part(k))
        last = part%last - part%first + 2
        y(2:last) = x(part%first:part%last)
        call project_by_parts(hot(part%coefficient), y(1:last), self%state(k, c), self%along(part%first:part%last, c), &
          & self%kept(k, c))
        x(part%first:part%last) = y(2:last)
      end associate
    end do
  end subroutine project

  !> L and c where `evaluate` was called last.
  pure subroutine proximal_law_linearise(self, kernels, sub, alpha)
    class(proximal_law_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(in) :: alpha
    real(dp) :: a(kernels%nc), b, soft(kernels%nc)
    integer :: c, q, g, k

    b = sqrt(alpha)
    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      self%slope(:, :, c) = 0.0_dp
      self%offset(q, :, g) = -self%f(q, :, g)
      if (self%open(c)) cycle
      a(:) = alpha/b
      if (allocated(self%yielding)) a(:) = a + self%yielding(:, c)/b
      soft(:) = self%softness(:, c)/b
      self%offset(q, 1, g) = -self%f(q, 1, g)/a(1)
      self%slope(1, 1, c) = soft(1)/a(1)
      do k = 1, self%parts
        call linearise_part(self, c, k, sub%hot(q, self%part(k)%coefficient, g), a, soft)
      end do
    end do
  end subroutine proximal_law_linearise

  !> L and c of part `k` of contact `c`, which carries something.
  pure subroutine linearise_part(self, c, k, mu, a, soft)
    class(proximal_law_t), intent(inout) :: self
    integer, intent(in) :: c, k
    !> coefficient of the part
    real(dp), intent(in) :: mu
    !> a and 1/(b s) of all components (nc)
    real(dp), intent(in) :: a(:), soft(:)
    real(dp) :: across, cut, f_along
    integer :: q, g, l, m, first, last

    q = lane_of(c)
    g = block_of(c)
    first = self%part(k)%first
    last = self%part(k)%last
    if (self%state(k, c) == sticks) then
      do l = first, last
        self%offset(q, l, g) = -self%f(q, l, g)/a(l)
        self%slope(l, l, c) = soft(l)/a(l)
      end do
      return
    end if
    ! across the sliding, D keeps a part and the inverse is 1/(1 - (1 - a) kept); along it D keeps nothing
    associate (e => self%along(:, c))
      across = 1.0_dp/((1.0_dp - self%kept(k, c)) + a(first)*self%kept(k, c))
      f_along = dot_product(e(first:last), self%f(q, first:last, g))
      cut = (1.0_dp - a(1))*mu*self%f(q, 1, g)/a(1)
      do l = first, last
        self%offset(q, l, g) = -across*(self%f(q, l, g) - e(l)*f_along) - e(l)*(f_along + cut)
        self%slope(l, 1, c) = mu*e(l)*soft(1)/a(1)
        do m = first, last
          self%slope(l, m, c) = self%kept(k, c)*across*soft(l)*(merge(1.0_dp, 0.0_dp, l == m) - e(l)*e(m))
        end do
      end do
    end associate
  end subroutine linearise_part

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
