!> Spot checks of the accuracy: now and then a solve that has converged is continued to a tenth of its goal, compared with where it
!> had ended, and set back. They tell what an estimate cannot: how far the velocities and the forces of a single step are off, and
!> what a tenth of the error costs. They change no result, and take about a given part of the iterations of a run.
module gravier_spot_checks
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_body_mass, only: inverse_of_translation
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, return_to
  use gravier_method, only: method_t, work_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_velocity, solve_converged
  use gravier_decomposition, only: decomposition_t
  use gravier_boundary_loads, only: sum_boundary_impulses
  use gravier_mean_stress, only: sum_moments
  implicit none
  private
  public :: spot_checks_t, difference_t, checked_share

  !> the goal of a check, over that of the solve
  real(dp), parameter :: checked_share = 0.1_dp
  !> a check is given up after so many times the iterations of its solve, which count as `few` at least, and after so many times
  !> those that are saved up
  integer, parameter :: most_times = 30, few = 10
  real(dp), parameter :: most_of_saved = 4.0_dp
  !> times the iterations of its solve that the first check is expected to take
  real(dp), parameter :: expected_times = 10.0_dp
  !> iterations that the rest of a step counts as: what a step costs whose solve has nothing to do
  real(dp), parameter :: rest_of_step = 5.0_dp
  !> times the error allowed beyond which a solve has not reached its goal, whatever its estimate was; and the part of the checks,
  !> at least so many, that may find that: estimates scatter
  real(dp), parameter :: wrong_from = 2.0_dp, may_be_wrong = 0.05_dp
  integer, parameter :: least_wrong = 2
  !> tolerance of the residual that no check asks less of
  real(dp), parameter :: least_tolerance = 1.0e-12_dp

  !> How far a quantity was off in the checks: sums of squares of its differences and of itself.
  type :: difference_t
    real(dp) :: off = 0.0_dp, whole = 0.0_dp
  contains
    procedure :: add => difference_add
    procedure :: share => difference_share
  end type difference_t

  !> What checks have found, since this run began or went on from a checkpoint. The same on every rank.
  type :: spot_checks_t
    !> part of the iterations that checks take; 0: there are none
    real(dp) :: part = 0.0_dp
    !> iterations that checks may have taken by now
    real(dp), private :: allowed = 0.0_dp
    !> checks, iterations of the solves that were checked, and those that checks have added
    integer(i8) :: made = 0, iterations = 0, further = 0
    !> checks that came to their goal; all that follows is of these
    integer(i8) :: reached = 0
    !> those that found more than twice the error allowed
    integer(i8) :: beyond = 0
    !> sums of squares of the velocity error over its scale, as found and as the solves had estimated it
    real(dp) :: found = 0.0_dp, estimated = 0.0_dp
    !> forces of contacts, mean stress, force on each boundary (boundaries)
    type(difference_t) :: contacts, stress
    type(difference_t), allocatable :: boundary(:)
  contains
    procedure :: look => spot_checks_look
    procedure :: refute => spot_checks_refute
    procedure :: times => spot_checks_times
    procedure :: mean => spot_checks_mean
  end type spot_checks_t

  !> Velocities of a subdomain (nv, n_columns) [m/s, rad/s].
  type :: velocities_t
    real(dp), allocatable :: value(:, :)
  end type velocities_t

contains

  pure subroutine difference_add(self, off, whole)
    class(difference_t), intent(inout) :: self
    !> squares of a difference and of the quantity
    real(dp), intent(in) :: off, whole

    self%off = self%off + off
    self%whole = self%whole + whole
  end subroutine difference_add

  !> The root mean square of the differences over that of the quantity; 0 where there is nothing.
  pure real(dp) function difference_share(self) result(share)
    class(difference_t), intent(in) :: self
    share = 0.0_dp
    if (self%whole > 0.0_dp) share = sqrt(self%off/self%whole)
  end function difference_share

  !> Check a solve that has reached the velocity error, when as many iterations are saved up as that is expected to take.
  !> Collective.
  subroutine spot_checks_look(self, decomposition, problem, method, control, solve, error)
    class(spot_checks_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> solved, with its velocity scale
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(in) :: solve
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: expected, allowed

    if (allocated(error) .or. .not. self%part > 0.0_dp .or. control%criterion /= by_velocity) return
    ! the solves before it decide: those that take many iterations are not to be checked more often than others
    allowed = self%allowed
    self%allowed = allowed + self%part*(solve%iterations + rest_of_step)
    expected = expected_times*max(solve%iterations, few)
    if (self%made > 0) expected = real(self%further, dp)/real(self%made, dp)
    if (solve%status /= solve_converged .or. self%further + expected > allowed) return
    call continue_solve(self, decomposition, problem, method, control, solve, error)
  end subroutine spot_checks_look

  !> Continue a solve, compare, and set the problem back to what it was. Collective.
  subroutine continue_solve(self, decomposition, problem, method, control, solve, error)
    class(spot_checks_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> solved, with its velocity scale
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(in) :: solve
    type(error_t), allocatable, intent(inout) :: error
    type(kept_impulses_t) :: kept(size(problem%sub))
    type(velocities_t) :: velocities(size(problem%sub))
    real(dp), allocatable :: on_boundaries(:, :), moments(:)
    type(solve_control_t) :: further
    type(solve_report_t) :: report
    type(work_t) :: work
    integer :: s

    work = method%work
    call copy_impulses(problem, kept)
    do s = 1, size(velocities)
      velocities(s)%value = problem%sub(s)%v_global
    end do
    call sum_boundary_impulses(decomposition, problem, on_boundaries)
    call sum_moments(problem, moments)
    further = control
    further%accuracy = checked_share*control%accuracy
    further%tolerance = max(checked_share*control%tolerance, min(control%tolerance, least_tolerance))
    further%max_iterations = min(most_times*max(solve%iterations, few), &
      & max(few, narrow(nint(min(most_of_saved*(self%allowed - self%further), real(huge(1), dp)), i8))))
    further%layered = .false.
    further%trace = .false.
    call solve_contacts(problem, method, further, report, error)
    if (allocated(error)) return
    self%made = self%made + 1
    self%iterations = self%iterations + solve%iterations
    self%further = self%further + report%iterations
    if (report%status == solve_converged) then
      self%reached = self%reached + 1
      call compare_velocities(self, problem, velocities, control%accuracy, solve)
      call compare_forces(self, decomposition, problem, kept, on_boundaries, moments)
    end if
    call return_to(problem, kept)
    method%work = work
  end subroutine continue_solve

  !> The velocity error of a solve, now that its solution is known better. Collective.
  subroutine compare_velocities(self, problem, before, accuracy, solve)
    class(spot_checks_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> at the end of the solve, by subdomains of this rank
    type(velocities_t), intent(in) :: before(:)
    !> of the solve
    real(dp), intent(in) :: accuracy
    type(solve_report_t), intent(in) :: solve
    !> |V - V*|_M^2, mass of the grains and of all that can move
    real(dp) :: parts(3, size(problem%sub)), sums(3), error
    integer :: s

    if (.not. solve%velocity_scale > 0.0_dp) return
    do s = 1, size(problem%sub)
      call add_bodies(problem, s, before(s)%value, parts(:, s))
    end do
    call problem%comm%sum_parts(parts, sums)
    if (.not. sums(3) > 0.0_dp) return
    error = sqrt(sums(1)/merge(sums(2), sums(3), sums(2) > 0.0_dp))/solve%velocity_scale
    self%found = self%found + error**2
    self%estimated = self%estimated + (solve%velocity_error/solve%velocity_scale)**2
    if (error > wrong_from*accuracy) self%beyond = self%beyond + 1
  end subroutine compare_velocities

  !> |V - V*|_M^2, mass of the grains and of all that can move, of subdomain `s` of this rank.
  pure subroutine add_bodies(problem, s, before, part)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> velocities at the end of the solve (nv, n_columns)
    real(dp), intent(in) :: before(:, :)
    real(dp), intent(out) :: part(3)
    real(dp) :: change(size(before, 1), size(before, 2)), inverse
    integer :: b

    associate (sub => problem%sub(s))
      change(:, :) = sub%v_global - before
      part(:) = 0.0_dp
      part(1) = sub%product_of(change, change)
      do b = 1, sub%n_bodies
        inverse = inverse_of_translation(sub%inverse_mass(:, b), problem%nd)
        if (.not. inverse > 0.0_dp) cycle
        if (b <= sub%n_grains) part(2) = part(2) + 1.0_dp/(inverse*sub%multiplicity(b))
        part(3) = part(3) + 1.0_dp/(inverse*sub%multiplicity(b))
      end do
    end associate
  end subroutine add_bodies

  !> How far the forces of the solve are off. Collective.
  subroutine compare_forces(self, decomposition, problem, kept, on_boundaries, moments)
    class(spot_checks_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    !> at the end of the solve: impulses of contacts, on boundaries (nd, boundaries) [N s], sum of p l^T (nd**2) [N m s]
    type(kept_impulses_t), intent(in) :: kept(:)
    real(dp), intent(in) :: on_boundaries(:, :), moments(:)
    real(dp), allocatable :: better(:, :), better_moments(:)
    real(dp) :: parts(2, size(problem%sub)), sums(2)
    integer :: s, b

    do s = 1, size(problem%sub)
      call add_contacts(problem%nf, problem%sub(s)%n_contacts, kept(s)%value, problem%sub(s)%impulse, parts(:, s))
    end do
    call problem%comm%sum_parts(parts, sums)
    call self%contacts%add(sums(1), sums(2))
    call sum_moments(problem, better_moments)
    call self%stress%add(sum((moments - better_moments)**2), sum(better_moments**2))
    call sum_boundary_impulses(decomposition, problem, better)
    if (.not. allocated(self%boundary)) allocate (self%boundary(size(better, 2)))
    do b = 1, size(better, 2)
      call self%boundary(b)%add(sum((on_boundaries(:, b) - better(:, b))**2), sum(better(:, b)**2))
    end do
  end subroutine compare_forces

  !> Whether the estimates that end solves are too small in this scene: too many checks found more than twice the error allowed.
  pure logical function spot_checks_refute(self) result(refute)
    class(spot_checks_t), intent(in) :: self
    refute = self%beyond >= least_wrong .and. real(self%beyond, dp) > may_be_wrong*real(self%reached, dp)
  end function spot_checks_refute

  !> Squares of the differences of impulses and of the impulses of the contacts of a subdomain.
  pure subroutine add_contacts(nf, n_contacts, before, now, part)
    !> components of a force, one where no contact has friction; contacts
    integer, intent(in) :: nf, n_contacts
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in) :: before(:, :, :), now(:, :, :)
    real(dp), intent(out) :: part(2)
    integer :: c, d

    part(:) = 0.0_dp
    do c = 1, n_contacts
      do d = 1, nf
        part(1) = part(1) + (before(lane_of(c), d, block_of(c)) - now(lane_of(c), d, block_of(c)))**2
        part(2) = part(2) + now(lane_of(c), d, block_of(c))**2
      end do
    end do
  end subroutine add_contacts

  !> How many times the iterations of a solve a tenth of its goal takes; at least so many, where some checks were given up.
  pure real(dp) function spot_checks_times(self) result(times)
    class(spot_checks_t), intent(in) :: self
    times = 1.0_dp
    if (self%iterations > 0) times = real(self%iterations + self%further, dp)/real(self%iterations, dp)
  end function spot_checks_times

  !> Root of the mean of a sum of squares over the checks that came to their goal.
  pure real(dp) function spot_checks_mean(self, squares) result(mean)
    class(spot_checks_t), intent(in) :: self
    !> `found` or `estimated`
    real(dp), intent(in) :: squares
    mean = 0.0_dp
    if (self%reached > 0) mean = sqrt(squares/real(self%reached, dp))
  end function spot_checks_mean

end module gravier_spot_checks
