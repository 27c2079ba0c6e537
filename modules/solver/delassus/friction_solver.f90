!> The methods for packed contact problems with any blocks, by name, and the choice among them: sweeps with momentum as long as
!> they promise a result soon, then Newton's method, and so on in turn with budgets that double, from the best impulses so far.
module gravier_friction_solver
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_delassus, only: delassus_t
  use gravier_block_sweeps, only: sweep_control_t, solve_by_sweeps
  use gravier_contact_newton, only: newton_control_t, contact_newton_t
  use gravier_unbounded, only: growth_t, growth_proven
  implicit none
  private
  public :: friction_methods, friction_control_t, friction_report_t, solve_friction
  public :: verdict_solved, verdict_not_converged, verdict_no_solution

  character(len=*), parameter :: friction_methods(4) = [character(len=8) :: "auto", "nlgs", "momentum", "newton"]

  integer, parameter :: verdict_solved = 0, verdict_not_converged = 1, verdict_no_solution = 2

  type :: friction_control_t
    !> one of friction_methods
    character(len=:), allocatable :: method
    !> on the figure of gravier_delassus: the consistent measure and the velocities of approach
    real(dp) :: tolerance = 1.0e-8_dp
    !> sweeps and Newton's steps together
    integer :: max_iterations = 100000
  end type friction_control_t

  type :: friction_report_t
    logical :: converged = .false.
    !> verdict_solved, verdict_not_converged, or verdict_no_solution where impulses grow without bound
    integer :: verdict = verdict_not_converged
    integer :: sweeps = 0, newton_steps = 0
    !> of the impulses found: the two measures of gravier_delassus
    real(dp) :: literature = 0.0_dp, consistent = 0.0_dp
    !> largest impulse as a velocity s |r|, relative to max|q|; contacts of the largest velocity of approach and of that impulse
    real(dp) :: impulse = 0.0_dp
    integer :: worst(2) = 0
    !> how impulses grew
    type(growth_t) :: growth
  end type friction_report_t

  !> of the first turn: sweeps within which a result must be in sight, Newton's steps; bounds of their doubling
  integer, parameter :: first_patience = 2000, most_patience = 10**9, first_steps = 20, most_doublings = 20
  !> sweeps that leave more than this of the measure bring little
  real(dp), parameter :: little_gain = 0.5_dp
  !> times that sweeps or Newton's steps ended with impulses that grow, with friction in their growth, after which the turns end
  integer, parameter :: most_growths = 4
  !> the turn in which a proof is sought that there is no solution, and Newton's steps from zero impulses for it
  integer, parameter :: proof_turn = 2
  integer, parameter :: last_steps = 200

contains

  !> Solve, from the impulses given.
  subroutine solve_friction(problem, control, r, report, error)
    type(delassus_t), intent(in) :: problem
    type(friction_control_t), intent(in) :: control
    !> start in, result out (dimension, contacts)
    real(dp), intent(inout), contiguous :: r(:, :)
    type(friction_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: v(:, :)
    type(sweep_control_t) :: sweeping
    type(contact_newton_t) :: newton
    real(dp) :: figure, approach

    if (allocated(error)) return
    select case (control%method)
    case ("nlgs", "momentum")
      sweeping = sweep_control_t(control%tolerance, control%max_iterations, control%method == "momentum")
      call solve_by_sweeps(problem, sweeping, r, report%sweeps, figure, report%growth)
    case ("newton")
      call newton%init(problem, error)
      if (.not. allocated(error)) call newton%solve(problem, newton_control_t(control%tolerance, &
        & control%max_iterations), r, report%newton_steps, figure, report%growth)
      call newton%free()
    case ("auto")
      call solve_in_turn(problem, control, r, report, error)
    case default
      call raise(error, status_input, "method '"//control%method//"': expected auto, nlgs, momentum or newton")
    end select
    if (allocated(error)) return
    allocate (v(size(r, 1), size(r, 2)))
    call problem%velocity(r, v)
    call problem%measure(r, v, report%literature, report%consistent)
    call problem%find_extremes(r, v, approach, report%impulse, report%worst)
    report%converged = problem%figure(r, v) <= control%tolerance
    if (report%converged) then
      report%verdict = verdict_solved
    else if (report%growth%ends()) then
      report%verdict = verdict_no_solution
    end if
  end subroutine solve_friction

  !> Sweeps and Newton's steps in turn. A proof that there is no solution ends them; growth with friction in it is no proof: it
  !> has to be met by both methods, or by one of them over and over, before Newton's method tries for the last time. When some turns
  !> have brought no result, a proof is sought. The routine is long by the procedures within it, which share the state of the turns.
  subroutine solve_in_turn(problem, control, r, report, error)
    type(delassus_t), intent(in) :: problem
    type(friction_control_t), intent(in) :: control
    real(dp), intent(inout), contiguous :: r(:, :)
    type(friction_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    type(contact_newton_t) :: newton
    real(dp), allocatable :: best(:, :)
    real(dp) :: least, figure
    type(sweep_control_t) :: sweeping
    type(growth_t) :: growth
    integer :: turn, done, growths(2)

    allocate (best(size(r, 1), size(r, 2)))
    best(:, :) = r
    least = huge(least)
    growths = 0
    sweeping = sweep_control_t(control%tolerance, control%max_iterations, .true., first_patience)
    do turn = 0, huge(turn) - 1
      sweeping%most_sweeps = left()
      call solve_by_sweeps(problem, sweeping, r, done, figure, growth)
      report%sweeps = report%sweeps + done
      sweeping%patience = merge(first_patience, min(2*sweeping%patience, most_patience), figure > little_gain*least)
      call keep_best()
      if (is_over(1)) exit
      if (turn == proof_turn) call seek_proof()
      if (turn == 0) call newton%init(problem, error)
      if (is_over(0) .or. allocated(error)) exit
      call take_steps(newton, problem, first_steps*2**min(turn, most_doublings))
      call keep_best()
      if (is_over(2)) exit
    end do
    call newton%free()
    if (report%growth%ends() .and. report%growth%kind /= growth_proven) then
      call start_afresh(problem)
      if (growth%kind == growth_proven) report%growth = growth
      call keep_best()
    end if

  contains

    !> iterations that are left
    integer function left()
      left = control%max_iterations - report%sweeps - report%newton_steps
    end function left

    !> Newton's steps, so many at most.
    subroutine take_steps(newton, problem, most_steps)
      type(contact_newton_t), intent(inout) :: newton
      type(delassus_t), intent(in) :: problem
      integer, intent(in) :: most_steps

      growth = growth_t()
      call newton%solve(problem, newton_control_t(control%tolerance, min(most_steps, left())), r, done, figure, growth)
      report%newton_steps = report%newton_steps + done
    end subroutine take_steps

    !> Newton's steps from zero impulses.
    subroutine start_afresh(problem)
      type(delassus_t), intent(in) :: problem
      type(contact_newton_t) :: fresh

      r(:, :) = 0.0_dp
      call fresh%init(problem, error)
      if (.not. allocated(error)) call take_steps(fresh, problem, last_steps)
      call fresh%free()
    end subroutine start_afresh

    !> The problem without friction has no solution exactly where normal impulses alone prove that the problem itself has none.
    subroutine seek_proof()
      type(delassus_t) :: smooth

      if (left() == 0) return
      smooth = problem
      smooth%mu(:) = 0.0_dp
      call start_afresh(smooth)
      if (growth%kind == growth_proven) report%growth = growth
      r(:, :) = best
      growth = growth_t()
    end subroutine seek_proof

    !> Go on from the best impulses so far.
    subroutine keep_best()
      if (figure < least) then
        least = figure
        best(:, :) = r
      else
        r(:, :) = best
      end if
    end subroutine keep_best

    !> Whether the turns end: with the result of sweeps (1) or of Newton's method (2), with the budget, or with a proof.
    logical function is_over(method)
      !> 0 where no method has just ended
      integer, intent(in) :: method

      is_over = least <= control%tolerance .or. left() == 0 .or. report%growth%ends()
      if (is_over .or. .not. growth%ends()) return
      growths(method) = growths(method) + 1
      is_over = growth%kind == growth_proven .or. all(growths > 0) .or. any(growths >= most_growths)
      if (is_over) report%growth = growth
    end function is_over

  end subroutine solve_in_turn

end module gravier_friction_solver
