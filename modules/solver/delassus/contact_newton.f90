!> Proximal Newton method for a packed contact problem with any blocks, W possibly of deficient rank. Outer loop: proximal
!> points, the solutions of v = W r + q + alpha S (r - r_k), S the stiffnesses; the weight alpha falls while they are found in
!> few steps and rises where they are not found. The fixed points of the loop are the solutions of the problem itself, Coulomb's
!> exact law included, for every alpha. Inner loop: semismooth Newton steps on the function of Alart and Curnier, with a
!> nonmonotone line search.
module gravier_contact_newton
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_delassus, only: delassus_t
  use gravier_unbounded, only: growth_t, note_growth
  use gravier_alart_curnier, only: alart_curnier_t
  use gravier_block_system, only: block_system_t
  implicit none
  private
  public :: newton_control_t, contact_newton_t

  !> alpha at the start and its bounds
  real(dp), parameter :: alpha_start = 1.0e-3_dp, alpha_least = 1.0e-13_dp, alpha_most = 10.0_dp
  !> what it is multiplied with after a proximal point found in very few steps, in few, in many, not found
  real(dp), parameter :: drop = 0.1_dp, fall = 0.7_dp, climb = 1.5_dp, rise = 3.0_dp
  !> steps to a proximal point that are very few, few, not many, and the most
  integer, parameter :: very_few_steps = 2, few_steps = 6, some_steps = 12, most_inner_steps = 25
  !> what is left of |F| where a proximal point counts as found
  real(dp), parameter :: found_point = 0.05_dp
  !> the line search compares with the greatest of so many last values, and halves the step so often at most
  integer, parameter :: memory = 5, most_halvings = 8
  real(dp), parameter :: sufficient = 1.0e-4_dp

  type :: newton_control_t
    !> on the figure of gravier_delassus
    real(dp) :: tolerance = 1.0e-8_dp
    !> Newton's steps, each a factorisation, and proximal points found without any
    integer :: most_steps = 100000
  end type newton_control_t

  !> The method and its work space. It can be called again and goes on with the weight it had.
  type :: contact_newton_t
    private
    real(dp) :: alpha = alpha_start
    !> the problem of the proximal point at hand
    type(delassus_t) :: near
    type(alart_curnier_t) :: law
    type(block_system_t) :: system
    !> (dimension, contacts)
    real(dp), allocatable :: centre(:, :), x(:, :), v(:, :), trial(:, :), direction(:, :)
  contains
    procedure :: init => contact_newton_init
    procedure :: free => contact_newton_free
    procedure :: solve => contact_newton_solve
  end type contact_newton_t

contains

  subroutine contact_newton_init(self, problem, error)
    class(contact_newton_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: d, n

    call self%free()
    d = problem%dimension
    n = problem%n_contacts
    self%alpha = alpha_start
    self%near = problem
    call self%law%init(problem)
    allocate (self%centre(d, n), self%x(d, n), self%v(d, n), self%trial(d, n), self%direction(d, n))
    call self%system%init(problem, error)
  end subroutine contact_newton_init

  subroutine contact_newton_free(self)
    class(contact_newton_t), intent(inout) :: self

    call self%system%free()
    call self%near%free()
    if (allocated(self%x)) deallocate (self%centre, self%x, self%v, self%trial, self%direction)
  end subroutine contact_newton_free

  !> Solve the problem given to `init`, from the impulses given. Ends early where impulses grow without bound, or where rounding
  !> hides what a step could change. A proximal point that is found without a step counts as one.
  subroutine contact_newton_solve(self, problem, control, r, steps, figure, growth)
    class(contact_newton_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    type(newton_control_t), intent(in) :: control
    !> start in, best result out (dimension, contacts)
    real(dp), intent(inout), contiguous :: r(:, :)
    integer, intent(out) :: steps
    !> of the result
    real(dp), intent(out) :: figure
    type(growth_t), intent(inout) :: growth
    real(dp) :: found, before
    integer :: taken
    logical :: success

    steps = 0
    call problem%velocity(r, self%v)
    figure = problem%figure(r, self%v)
    before = figure
    self%centre(:, :) = r
    do while (figure > control%tolerance .and. steps < control%most_steps .and. .not. growth%ends())
      call set_proximal(self, problem)
      self%x(:, :) = self%centre
      call find_proximal_point(self, norm2(problem%q)*control%tolerance, &
        & min(most_inner_steps, control%most_steps - steps), taken, success)
      ! a point found at once counts, too: every pass brings the loop nearer to its end
      steps = steps + max(taken, 1)
      if (taken == 0 .and. self%alpha <= alpha_least) exit
      if (taken > 0) then
        self%direction(:, :) = self%x - self%centre
        call note_growth(problem, self%direction, growth)
      end if
      call problem%velocity(self%x, self%v)
      found = problem%figure(self%x, self%v)
      if (found < figure) then
        figure = found
        r(:, :) = self%x
      end if
      if (success .or. found < before) self%centre(:, :) = self%x
      if (.not. success) then
        self%alpha = min(self%alpha*rise, alpha_most)
      else if (taken <= very_few_steps) then
        self%alpha = max(self%alpha*drop, alpha_least)
      else if (taken <= few_steps) then
        self%alpha = max(self%alpha*fall, alpha_least)
      else if (taken > some_steps) then
        self%alpha = min(self%alpha*climb, alpha_most)
      end if
      before = found
    end do
  end subroutine contact_newton_solve

  !> v = W r + q + alpha S (r - centre).
  subroutine set_proximal(self, problem)
    class(contact_newton_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    real(dp) :: weight
    integer :: a, i, diagonal

    do a = 1, problem%n_contacts
      weight = self%alpha*problem%stiffness(a)
      self%near%own(:, a) = problem%own(:, a)
      do i = 1, problem%dimension
        diagonal = 1 + (i - 1)*(problem%dimension + 1)
        self%near%own(diagonal, a) = self%near%own(diagonal, a) + weight
      end do
      self%near%q(:, a) = problem%q(:, a) - weight*self%centre(:, a)
    end do
  end subroutine set_proximal

  !> Newton's method on F(x) = 0 of the proximal problem, from x.
  subroutine find_proximal_point(self, tolerance, most_steps, steps, success)
    class(contact_newton_t), intent(inout) :: self
    !> of the problem itself [m/s]
    real(dp), intent(in) :: tolerance
    integer, intent(in) :: most_steps
    integer, intent(out) :: steps
    !> F has fallen as asked
    logical, intent(out) :: success
    real(dp) :: past(memory), f, goal
    logical :: regular

    steps = 0
    past = 0.0_dp
    call self%law%evaluate(self%near, self%x, f)
    goal = max(found_point*f, 0.1_dp*tolerance)
    do
      success = f <= goal
      if (success .or. steps == most_steps) exit
      past(1 + mod(steps, memory)) = f
      call self%law%differentiate(self%near)
      self%direction(:, :) = -self%law%f
      call self%system%solve(self%law%own, self%law%coupling, self%direction, regular)
      steps = steps + 1
      if (.not. regular) exit
      call search_line(self, maxval(past), f)
    end do
  end subroutine find_proximal_point

  !> Go along the direction: the whole step, or half of it and so on until F falls below a reference, or to where it was least.
  subroutine search_line(self, reference, f)
    class(contact_newton_t), intent(inout) :: self
    real(dp), intent(in) :: reference
    !> |F| at the new point
    real(dp), intent(out) :: f
    real(dp) :: step, best_step, least
    integer :: k

    step = 1.0_dp
    best_step = 0.0_dp
    least = huge(least)
    do k = 1, most_halvings
      self%trial(:, :) = self%x + step*self%direction
      call self%law%evaluate(self%near, self%trial, f)
      if (f < least) then
        least = f
        best_step = step
      end if
      if (f <= (1.0_dp - sufficient*step)*reference) exit
      step = 0.5_dp*step
    end do
    if (k > most_halvings) then
      self%trial(:, :) = self%x + best_step*self%direction
      call self%law%evaluate(self%near, self%trial, f)
    end if
    self%x(:, :) = self%trial
  end subroutine search_line

end module gravier_contact_newton
