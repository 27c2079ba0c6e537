!> Going on with a solve that has reached its goal, to a smaller one, as long as that costs little. Errors within the goal may add
!> up from step to step where nothing moves (gravier_drift). What a solve leaves of the smaller goal, the next one starts from.
module gravier_refinement
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_narrow, only: narrow
  use gravier_cell_response, only: respond
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  use gravier_method, only: method_t
  use gravier_backoff, only: backoff_t, backoff_words, backoff_record
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_watch_t, by_velocity, solve_converged
  implicit none
  private
  public :: refinement_t, refinement_words, refinement_record

  !> further iterations that a solve may always take, and times those that it took to its goal
  integer, parameter :: few_iterations = 200, times_as_many = 2
  !> share of the goal above which a smaller one is not worth a second solve, and tolerance of the residual that none falls below
  real(dp), parameter :: worth_it = 0.7_dp, least_tolerance = 1.0e-12_dp
  !> what is left of the error where going on was of use though the smaller goal was not reached
  real(dp), parameter :: gained = 0.5_dp

  !> words of its state, and what they are, in their order: the version of checkpoints, which changes with them
  integer, parameter :: refinement_words = 1 + backoff_words
  character(len=*), parameter :: refinement_record = "turns "//backoff_record

  type :: refinement_t
    !> since this run began or went on from a checkpoint: solves that went on, those of them that reached the smaller goal, and
    !> iterations that all of them took for it
    integer(i8) :: refined = 0, reached = 0, iterations = 0
    !> the smallest of these goals, over that of the user
    real(dp) :: least_share = 1.0_dp
    !> solves that might have gone on, since the first step
    integer, private :: turns = 0
    type(backoff_t), private :: backoff = backoff_t(forgiven=1)
  contains
    procedure :: go_on => refinement_go_on
    procedure :: get_state => refinement_get_state
    procedure :: set_state => refinement_set_state
  end type refinement_t

contains

  !> Go on with a solve that has converged, unless too many before it gained nothing by that. Its report is then that of both as of
  !> one, with the goal of the first. Impulses that became worse are given up. Collective.
  subroutine refinement_go_on(self, problem, method, control, share, report, error, watch)
    class(refinement_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    !> of the first solve
    type(solve_control_t), intent(in) :: control
    !> the smaller goal over that of the control
    real(dp), intent(in) :: share
    !> of the first solve; then of both
    type(solve_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    class(solve_watch_t), intent(inout), optional :: watch
    type(kept_impulses_t), allocatable :: kept(:)
    type(solve_control_t) :: further
    type(solve_report_t) :: second

    if (allocated(error) .or. share > worth_it .or. control%criterion /= by_velocity) return
    if (report%status /= solve_converged .or. problem%n_contacts == 0) return
    self%turns = self%turns + 1
    if (.not. self%backoff%allows(self%turns)) return
    further = control
    further%layered = .false.
    further%accuracy = share*control%accuracy
    further%tolerance = max(share*control%tolerance, min(control%tolerance, least_tolerance))
    further%max_iterations = min(control%max_iterations, max(few_iterations, times_as_many*report%iterations))
    allocate (kept(size(problem%sub)))
    call copy_impulses(problem, kept)
    call solve_contacts(problem, method, further, second, error, watch=watch)
    if (allocated(error)) return
    ! both are one solve
    method%work%solves = method%work%solves - 1
    self%refined = self%refined + 1
    if (second%status == solve_converged) self%reached = self%reached + 1
    self%iterations = self%iterations + second%iterations
    self%least_share = min(self%least_share, share)
    call self%backoff%note(self%turns, tried=.true., kept=second%status == solve_converged .or. &
      & second%figure <= gained*report%figure)
    if (second%status == solve_converged .or. second%figure <= report%figure) then
      call take_end(report, second)
    else
      ! the figure of a solve that diverged may be NaN
      call restore_impulses(problem, kept)
      if (problem%cell%is_driven) call respond(problem)
      call problem%evaluate()
    end if
    report%iterations = report%iterations + second%iterations
    report%seconds = report%seconds + second%seconds
  end subroutine refinement_go_on

  !> What is known of the velocities at the end of the second solve.
  pure subroutine take_end(report, second)
    !> of the first; then of the velocities of the second
    type(solve_report_t), intent(inout) :: report
    type(solve_report_t), intent(inout) :: second

    report%residual = second%residual
    report%jump = second%jump
    report%velocity_error = second%velocity_error
    report%violation = second%violation
    report%figure = second%figure
    if (.not. allocated(report%trace)) return
    call second%follow_trace(report)
    report%n_trace = second%n_trace
    call move_alloc(second%trace, report%trace)
  end subroutine take_end

  pure subroutine refinement_get_state(self, words)
    class(refinement_t), intent(in) :: self
    integer(i8), intent(out) :: words(refinement_words)

    words(1) = self%turns
    call self%backoff%get_state(words(2:))
  end subroutine refinement_get_state

  pure subroutine refinement_set_state(self, words)
    class(refinement_t), intent(inout) :: self
    integer(i8), intent(in) :: words(refinement_words)

    self%turns = narrow(words(1))
    call self%backoff%set_state(words(2:))
  end subroutine refinement_set_state

end module gravier_refinement
