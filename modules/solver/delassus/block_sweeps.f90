!> Nonlinear Gauss-Seidel on a packed contact problem with any blocks: each contact in turn is solved exactly, by plain or
!> accelerated sweeps.
module gravier_block_sweeps
  use gravier_kinds, only: dp
  use gravier_delassus, only: delassus_t
  use gravier_unbounded, only: growth_t, note_growth
  use gravier_friction_cone, only: project_on_cone
  use gravier_local_law, only: solve_law_2d, solve_law_3d
  implicit none
  private
  public :: sweep_control_t, sweep_blocks, solve_by_sweeps

  type :: sweep_control_t
    !> on the figure of gravier_delassus
    real(dp) :: tolerance = 1.0e-8_dp
    integer :: most_sweeps = 100000
    !> extrapolate the impulses between sweeps
    logical :: acceleration = .false.
    !> end when the gain of the last sweeps promises no result within so many more
    integer :: patience = huge(1)
  end type sweep_control_t

  !> the measure is taken when a sweep moves impulses by less than so many tolerances
  real(dp), parameter :: near_tolerance = 4.0_dp
  !> sweeps between two looks at what they gain
  integer, parameter :: window = 100

contains

  !> Sweep until the figure of gravier_delassus meets the tolerance, the budget or patience is spent, or impulses grow without
  !> bound.
  subroutine solve_by_sweeps(problem, control, r, sweeps, figure, growth)
    type(delassus_t), intent(in) :: problem
    type(sweep_control_t), intent(in) :: control
    !> impulses: start in, result out (dimension, contacts)
    real(dp), intent(inout), contiguous :: r(:, :)
    integer, intent(out) :: sweeps
    !> of the result
    real(dp), intent(out) :: figure
    type(growth_t), intent(out) :: growth
    !> velocities, results of the sweep before where sweeps are accelerated, and of the one that ended the last window
    !> (dimension, contacts)
    real(dp), allocatable :: v(:, :), previous(:, :), past(:, :)
    real(dp) :: moved, moved_before, least, least_before, t

    allocate (v(size(r, 1), size(r, 2)), previous(size(r, 1), merge(size(r, 2), 0, control%acceleration)))
    if (control%acceleration) previous(:, :) = r
    allocate (past, source=r)
    t = 1.0_dp
    moved_before = huge(moved)
    least = huge(least)
    least_before = huge(least)
    sweeps = 0
    do
      if (sweeps == control%most_sweeps) exit
      call sweep_blocks(problem, r, moved)
      sweeps = sweeps + 1
      if (moved <= near_tolerance*control%tolerance .or. sweeps == 1) then
        if (reached()) return
      end if
      if (control%acceleration) call extrapolate(problem, moved > moved_before, t, previous, r)
      moved_before = moved
      least = min(least, moved)
      if (mod(sweeps, window) == 0) then
        ! where a local problem is singular, impulses may stand still without being a solution
        if (least <= control%tolerance) then
          if (reached()) return
          least = figure
        end if
        call look_at_growth()
        if (growth%ends() .or. .not. promising(least_before, least, control)) exit
        least_before = least
        least = huge(least)
      end if
    end do
    ! extrapolated impulses are no result
    if (control%acceleration .and. sweeps > 0) r(:, :) = previous
    if (reached()) return

  contains

    logical function reached()
      call problem%velocity(r, v)
      figure = problem%figure(r, v)
      reached = figure <= control%tolerance
    end function reached

    !> What the window added to the impulses.
    subroutine look_at_growth()
      if (control%acceleration) then
        v(:, :) = previous - past
        past(:, :) = previous
      else
        v(:, :) = r - past
        past(:, :) = r
      end if
      call note_growth(problem, v, growth)
    end subroutine look_at_growth

  end subroutine solve_by_sweeps

  !> Whether a figure that fell so far in a window comes down to the tolerance soon enough at this rate.
  pure logical function promising(before, after, control)
    real(dp), intent(in) :: before, after
    type(sweep_control_t), intent(in) :: control

    promising = after <= control%tolerance .or. control%patience == huge(control%patience)
    if (.not. promising) promising = window*(log(after) - log(control%tolerance)) <= control%patience*(log(before) - log(after))
  end function promising

  !> Nesterov's extrapolation x + beta (x - previous), brought back to the cones; none, and a fresh start, where the last sweep
  !> moved impulses by more than the one before.
  pure subroutine extrapolate(problem, restart, t, previous, r)
    type(delassus_t), intent(in) :: problem
    logical, intent(in) :: restart
    real(dp), intent(inout) :: t
    !> result of the sweep before; then of this one (dimension, contacts)
    real(dp), intent(inout), contiguous :: previous(:, :)
    !> result of this sweep; then the start of the next
    real(dp), intent(inout), contiguous :: r(:, :)
    real(dp) :: next, beta, x, along, across
    integer :: a, i

    next = 1.0_dp
    beta = 0.0_dp
    if (.not. restart) then
      next = 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*t**2))
      beta = (t - 1.0_dp)/next
    end if
    t = next
    do a = 1, problem%n_contacts
      across = 0.0_dp
      do i = 1, problem%dimension
        x = r(i, a)
        r(i, a) = x + beta*(x - previous(i, a))
        previous(i, a) = x
        if (i > 1) across = across + r(i, a)**2
      end do
      along = problem%mu(a)*r(1, a)
      if (along < 0.0_dp .or. across > along**2) call project_on_cone(r(:, a), problem%mu(a))
    end do
  end subroutine extrapolate

  !> One sweep over all contacts in their order.
  pure subroutine sweep_blocks(problem, r, moved)
    type(delassus_t), intent(in) :: problem
    !> (dimension, contacts)
    real(dp), intent(inout), contiguous :: r(:, :)
    !> |s (r - r before)| / |q|, s the stiffness of each contact: 0 at a solution
    real(dp), intent(out) :: moved
    real(dp) :: scale

    if (problem%dimension == 2) then
      call sweep_2d(problem%first, problem%other, problem%coupling, problem, r, moved)
    else
      call sweep_3d(problem%first, problem%other, problem%coupling, problem, r, moved)
    end if
    scale = norm2(problem%q)
    moved = sqrt(moved)
    if (scale > 0.0_dp) moved = moved/scale
  end subroutine sweep_blocks

  pure subroutine sweep_2d(first, other, coupling, problem, r, moved)
    integer, intent(in), contiguous :: first(:), other(:)
    real(dp), intent(in), contiguous :: coupling(:, :)
    type(delassus_t), intent(in) :: problem
    real(dp), intent(inout), contiguous :: r(:, :)
    real(dp), intent(out) :: moved
    real(dp) :: b(2), new(2), x1, x2
    integer :: a, k

    moved = 0.0_dp
    do a = 1, size(first) - 1
      b(1) = problem%q(1, a)
      b(2) = problem%q(2, a)
      do k = first(a), first(a + 1) - 1
        x1 = r(1, other(k))
        x2 = r(2, other(k))
        b(1) = b(1) + coupling(1, k)*x1 + coupling(3, k)*x2
        b(2) = b(2) + coupling(2, k)*x1 + coupling(4, k)*x2
      end do
      call solve_law_2d(problem%own(:, a), b, problem%mu(a), new)
      moved = moved + problem%stiffness(a)**2*((new(1) - r(1, a))**2 + (new(2) - r(2, a))**2)
      r(1, a) = new(1)
      r(2, a) = new(2)
    end do
  end subroutine sweep_2d

  pure subroutine sweep_3d(first, other, coupling, problem, r, moved)
    integer, intent(in), contiguous :: first(:), other(:)
    real(dp), intent(in), contiguous :: coupling(:, :)
    type(delassus_t), intent(in) :: problem
    real(dp), intent(inout), contiguous :: r(:, :)
    real(dp), intent(out) :: moved
    real(dp) :: b(3), new(3), x1, x2, x3
    integer :: a, k

    moved = 0.0_dp
    do a = 1, size(first) - 1
      b(1) = problem%q(1, a)
      b(2) = problem%q(2, a)
      b(3) = problem%q(3, a)
      do k = first(a), first(a + 1) - 1
        x1 = r(1, other(k))
        x2 = r(2, other(k))
        x3 = r(3, other(k))
        b(1) = b(1) + coupling(1, k)*x1 + coupling(4, k)*x2 + coupling(7, k)*x3
        b(2) = b(2) + coupling(2, k)*x1 + coupling(5, k)*x2 + coupling(8, k)*x3
        b(3) = b(3) + coupling(3, k)*x1 + coupling(6, k)*x2 + coupling(9, k)*x3
      end do
      call solve_law_3d(problem%own(:, a), b, problem%mu(a), new)
      moved = moved + problem%stiffness(a)**2*((new(1) - r(1, a))**2 + (new(2) - r(2, a))**2 + (new(3) - r(3, a))**2)
      r(1, a) = new(1)
      r(2, a) = new(2)
      r(3, a) = new(3)
    end do
  end subroutine sweep_3d

end module gravier_block_sweeps
