!> Proximal Newton method for a packed contact problem with any blocks, W possibly of deficient rank: an outer loop of
!> proximal points, v = W r + q + alpha S (r - r_k), whose weight alpha falls while it goes well and rises when it does not,
!> around a semismooth Newton method on the function of Alart and Curnier with a nonmonotone line search. The outer loop has the
!> solutions of the problem itself, Coulomb's exact law included, as its fixed points for every alpha.
module gravier_contact_newton
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_delassus, only: delassus_t
  use gravier_alart_curnier, only: alart_curnier_t
  use gravier_block_system, only: block_system_t
  implicit none
  private
  public :: newton_control_t, solve_by_newton

  type :: newton_control_t
    real(dp) :: tolerance = 1.0e-8_dp
    !> Newton's steps, each a factorisation
    integer :: most_steps = 1000
    !> Newton's steps to one proximal point
    integer :: inner_steps = 25
    real(dp) :: alpha_start = 1.0e-3_dp, alpha_least = 1.0e-13_dp, alpha_most = 10.0_dp
    !> of alpha, after a proximal point found quickly, slowly, not at all
    real(dp) :: fall = 0.3_dp, hold = 1.5_dp, rise = 3.0_dp
    !> what is left of F when a proximal point counts as found
    real(dp) :: inner_tolerance = 0.05_dp
    real(dp) :: slope = 1.0_dp
    logical :: log = .false.
  end type newton_control_t

  !> the line search compares with the greatest of so many last values, and halves the step so often at most
  integer, parameter :: memory = 5, most_halvings = 8
  !> steps to a proximal point that are few, and not many
  integer, parameter :: few_steps = 6, some_steps = 12

contains

  !> Solve, from the impulses given.
  subroutine solve_by_newton(problem, control, r, steps, measure, error)
    type(delassus_t), intent(in) :: problem
    type(newton_control_t), intent(in) :: control
    !> start in, best result out (dimension, contacts)
    real(dp), intent(inout), contiguous :: r(:, :)
    integer, intent(out) :: steps
    !> of the result: the consistent measure of gravier_delassus
    real(dp), intent(out) :: measure
    type(error_t), allocatable, intent(inout) :: error
    type(alart_curnier_t) :: law
    type(block_system_t) :: system
    real(dp), allocatable :: x(:, :), v(:, :)
    real(dp) :: found, before, ignored
    integer :: taken
    logical :: success

    steps = 0
    measure = huge(measure)
    if (allocated(error)) return
    call law%init(problem, control%slope)
    call system%init(problem, error)
    allocate (x(size(r, 1), size(r, 2)), v(size(r, 1), size(r, 2)))
    call problem%velocity(r, v)
    call problem%measure(r, v, ignored, measure)
    before = measure
    law%alpha = control%alpha_start
    law%centre(:, :) = r
    do while (measure > control%tolerance .and. steps < control%most_steps .and. .not. allocated(error))
      x(:, :) = law%centre
      call find_proximal_point(problem, control, law, system, x, taken, success)
      steps = steps + taken
      call problem%velocity(x, v)
      call problem%measure(x, v, ignored, found)
      if (control%log) print "(a,es9.2,i4,l2,es10.2,i6)", "   prox alpha ", law%alpha, taken, success, found, steps
      if (found < measure) then
        measure = found
        r(:, :) = x
      end if
      if (success) then
        law%centre(:, :) = x
        if (taken <= few_steps) law%alpha = max(law%alpha*control%fall, control%alpha_least)
        if (taken > some_steps) law%alpha = law%alpha*control%hold
      else
        law%alpha = min(law%alpha*control%rise, control%alpha_most)
        if (found < before) law%centre(:, :) = x
      end if
      before = found
    end do
    call system%free()
  end subroutine solve_by_newton

  !> Newton's method on F(x) = 0 at a fixed centre.
  subroutine find_proximal_point(problem, control, law, system, x, steps, success)
    type(delassus_t), intent(in) :: problem
    type(newton_control_t), intent(in) :: control
    type(alart_curnier_t), intent(inout) :: law
    type(block_system_t), intent(inout) :: system
    !> start in, result out (dimension, contacts)
    real(dp), intent(inout), contiguous :: x(:, :)
    integer, intent(out) :: steps
    !> F has fallen as asked
    logical, intent(out) :: success
    real(dp), allocatable :: direction(:, :)
    real(dp) :: past(memory), f, goal
    logical :: regular

    allocate (direction(size(x, 1), size(x, 2)))
    steps = 0
    past = 0.0_dp
    call law%evaluate(problem, x, f)
    goal = max(control%inner_tolerance*f, 0.1_dp*control%tolerance)
    do
      success = f <= goal
      if (success .or. steps == control%inner_steps) exit
      past(1 + mod(steps, memory)) = f
      call law%differentiate(problem)
      direction(:, :) = -law%f
      call system%solve(law%own, law%coupling, direction, regular)
      steps = steps + 1
      if (.not. regular) exit
      call search_line(problem, law, maxval(past), direction, x, f)
    end do
  end subroutine find_proximal_point

  !> Go along a direction: the whole step, or half of it and so on until F falls below a reference, or to where it was least.
  subroutine search_line(problem, law, reference, direction, x, f)
    type(delassus_t), intent(in) :: problem
    type(alart_curnier_t), intent(inout) :: law
    real(dp), intent(in) :: reference
    real(dp), intent(in), contiguous :: direction(:, :)
    real(dp), intent(inout), contiguous :: x(:, :)
    !> |F| at the new point
    real(dp), intent(out) :: f
    real(dp), allocatable :: trial(:, :)
    real(dp) :: step, best_step, least
    integer :: k

    step = 1.0_dp
    best_step = 0.0_dp
    least = huge(least)
    allocate (trial(size(x, 1), size(x, 2)))
    do k = 1, most_halvings
      trial(:, :) = x + step*direction
      call law%evaluate(problem, trial, f)
      if (f < least) then
        least = f
        best_step = step
      end if
      if (f <= (1.0_dp - 1.0e-4_dp*step)*reference) exit
      step = 0.5_dp*step
    end do
    if (k > most_halvings) then
      trial(:, :) = x + best_step*direction
      call law%evaluate(problem, trial, f)
    end if
    x(:, :) = trial
  end subroutine search_line

end module gravier_contact_newton
