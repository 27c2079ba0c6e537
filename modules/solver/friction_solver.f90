!> The methods for packed contact problems with any blocks, by name, and the choice among them: sweeps with momentum as long as
!> they promise a result soon, then Newton's method, and so on in turn with budgets that double, from the best impulses so far.
module gravier_friction_solver
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_delassus, only: delassus_t
  use gravier_block_sweeps, only: sweep_control_t, solve_by_sweeps
  use gravier_contact_newton, only: contact_newton_t
  implicit none
  private
  public :: friction_methods, friction_control_t, friction_report_t, solve_friction

  character(len=*), parameter :: friction_methods(4) = [character(len=8) :: "auto", "nlgs", "momentum", "newton"]

  type :: friction_control_t
    !> one of friction_methods
    character(len=:), allocatable :: method
    !> on the consistent measure of gravier_delassus
    real(dp) :: tolerance = 1.0e-8_dp
    !> sweeps and Newton's steps together
    integer :: max_iterations = 100000
  end type friction_control_t

  type :: friction_report_t
    logical :: converged = .false.
    integer :: sweeps = 0, newton_steps = 0
    !> of the impulses found: the two measures of gravier_delassus
    real(dp) :: literature = 0.0_dp, consistent = 0.0_dp
  end type friction_report_t

  !> of the first turn: sweeps within which a result must be in sight, Newton's steps; bounds of their doubling
  integer, parameter :: first_patience = 2000, most_patience = 10**9, first_steps = 20, most_doublings = 20
  !> sweeps that leave more than this of the measure bring little
  real(dp), parameter :: little_gain = 0.5_dp

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
    real(dp) :: measure

    if (allocated(error)) return
    select case (control%method)
    case ("nlgs", "momentum")
      sweeping = sweep_control_t(control%tolerance, control%max_iterations, control%method == "momentum")
      call solve_by_sweeps(problem, sweeping, r, report%sweeps, measure)
    case ("newton")
      call newton%init(problem, error)
      if (.not. allocated(error)) call newton%solve(problem, control%tolerance, control%max_iterations, r, &
        & report%newton_steps, measure)
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
    report%converged = report%consistent <= control%tolerance
  end subroutine solve_friction

  !> Sweeps and Newton's steps in turn.
  subroutine solve_in_turn(problem, control, r, report, error)
    type(delassus_t), intent(in) :: problem
    type(friction_control_t), intent(in) :: control
    real(dp), intent(inout), contiguous :: r(:, :)
    type(friction_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    type(contact_newton_t) :: newton
    real(dp), allocatable :: best(:, :)
    real(dp) :: least, measure
    type(sweep_control_t) :: sweeping
    integer :: turn, done

    allocate (best(size(r, 1), size(r, 2)))
    best(:, :) = r
    least = huge(least)
    sweeping = sweep_control_t(control%tolerance, control%max_iterations, .true., first_patience)
    do turn = 0, huge(turn) - 1
      sweeping%most_sweeps = left()
      call solve_by_sweeps(problem, sweeping, r, done, measure)
      report%sweeps = report%sweeps + done
      sweeping%patience = merge(first_patience, min(2*sweeping%patience, most_patience), measure > little_gain*least)
      call keep_best()
      if (least <= control%tolerance .or. left() == 0) exit
      if (turn == 0) call newton%init(problem, error)
      if (allocated(error)) exit
      call newton%solve(problem, control%tolerance, min(first_steps*2**min(turn, most_doublings), left()), r, done, measure)
      report%newton_steps = report%newton_steps + done
      call keep_best()
      if (least <= control%tolerance .or. left() == 0) exit
    end do
    call newton%free()

  contains

    !> iterations that are left
    integer function left()
      left = control%max_iterations - report%sweeps - report%newton_steps
    end function left

    !> go on from the best impulses so far
    subroutine keep_best()
      if (measure < least) then
        least = measure
        best(:, :) = r
      else
        r(:, :) = best
      end if
    end subroutine keep_best

  end subroutine solve_in_turn

end module gravier_friction_solver
