!> A second method, which takes over the solves that stagnate. Sweeps do not carry loads along rows of hundreds of bodies, nor
!> turn a strip of bonded ones; Newton's method does, at the price of factorisations, in problems that are not too large.
module gravier_fallback
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, return_to
  use gravier_method, only: method_t
  use gravier_backoff, only: backoff_t, backoff_words, backoff_record
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_watch_t, exact_solution_t, solve_converged, &
    & solve_exhausted, solve_diverged, solve_stagnated, solve_unbounded
  implicit none
  private
  public :: fallback_t, fallback_words, fallback_record

  !> Most iterations of the second method. Tens of factorisations bring most solves to their goal. Where friction leaves velocities
  !> undetermined, thousands of iterations do not help either.
  integer, parameter :: most_iterations = 2000
  !> Iterations that may gain nothing: so many over the number of contacts, at least and at most. A factorisation of 8000 contacts
  !> in space takes half a second, as thousands of sweeps do.
  real(dp), parameter :: patience = 4.0e5_dp
  integer, parameter :: shortest = 40, longest = 1000
  !> A solve that ended at `max_iterations` is taken over if it made at least so many iterations itself; a smaller limit is one that
  !> the user has set on purpose.
  integer, parameter :: least_tried = 2000

  !> words of its state, and what they are, in their order: the version of checkpoints, which changes with them
  integer, parameter :: fallback_words = 1 + backoff_words
  character(len=*), parameter :: fallback_record = "met "//backoff_record

  type :: fallback_t
    !> the second method; not allocated where there is none
    class(method_t), allocatable :: method
    !> contacts of a problem that it takes over, at most
    integer(i8) :: most_contacts = 0
    !> since this run began or went on from a checkpoint: solves taken over, those of them that reached their goal, and
    !> iterations that all of them took
    integer(i8) :: taken = 0, solved = 0, iterations = 0
    !> since then: solves that it might have taken over, and did not because too many before them were in vain
    integer(i8) :: passed_over = 0
    !> solves that it might have taken over, since the first step
    integer, private :: met = 0
    type(backoff_t), private :: backoff = backoff_t(forgiven=1)
  contains
    procedure :: take_over => fallback_take_over
    procedure :: get_state => fallback_get_state
    procedure :: set_state => fallback_set_state
    procedure :: free => fallback_free
  end type fallback_t

contains

  !> Go on with a solve that has stagnated, or that made many iterations in vain, unless too many like it were not solved in the
  !> end. The impulses and the report are those of the better end. Collective.
  subroutine fallback_take_over(self, problem, control, report, error, exact, watch)
    class(fallback_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> of the first solve
    type(solve_control_t), intent(in) :: control
    !> of the first solve; then of both as of one
    type(solve_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    class(exact_solution_t), intent(in), optional :: exact
    class(solve_watch_t), intent(inout), optional :: watch
    type(kept_impulses_t) :: kept(size(problem%sub))
    type(solve_control_t) :: again
    type(solve_report_t) :: second

    if (allocated(error) .or. .not. allocated(self%method)) return
    if (.not. has_failed(report) .or. problem%n_contacts > self%most_contacts) return
    self%met = self%met + 1
    if (.not. self%backoff%allows(self%met)) then
      self%passed_over = self%passed_over + 1
      return
    end if
    again = control
    again%layered = .false.
    again%figure_ratio = 0.0_dp
    again%patience = max(shortest, nint(min(real(longest, dp), patience/real(max(problem%n_contacts, 1_i8), dp))))
    again%max_iterations = min(most_iterations, control%max_iterations)
    call copy_impulses(problem, kept)
    call solve_contacts(problem, self%method, again, second, error, exact, watch)
    if (allocated(error)) return
    self%taken = self%taken + 1
    self%iterations = self%iterations + second%iterations
    if (second%status == solve_converged) self%solved = self%solved + 1
    call self%backoff%note(self%met, tried=.true., kept=second%status == solve_converged)
    if (is_better(second, report)) then
      call join(report, second)
      return
    end if
    call return_to(problem, kept)
    report%iterations = report%iterations + second%iterations
    report%seconds = report%seconds + second%seconds
  end subroutine fallback_take_over

  !> Whether more iterations of the first method promise nothing.
  pure logical function has_failed(report)
    type(solve_report_t), intent(in) :: report
    has_failed = report%status == solve_stagnated .or. (report%status == solve_exhausted .and. report%iterations >= least_tried)
  end function has_failed

  !> Whether the second solve has ended nearer to the goal than the first.
  pure logical function is_better(second, first)
    type(solve_report_t), intent(in) :: second, first

    is_better = second%status == solve_converged
    ! the figure of a solve that diverged may be NaN
    if (is_better .or. second%status == solve_diverged) return
    is_better = second%figure < first%figure
  end function is_better

  !> The report of both solves as of one. It ends as the second has ended where that has found the solution or that there is none.
  pure subroutine join(report, second)
    !> of the first; then of both
    type(solve_report_t), intent(inout) :: report
    type(solve_report_t), intent(in) :: second
    type(solve_report_t) :: first

    first = report
    report = second
    call report%follow(first)
    ! it tells nothing about the first method
    report%figure_ratio = 0.0_dp
    if (report%status /= solve_converged .and. report%status /= solve_unbounded) then
      report%status = first%status
      report%creep = first%creep
    end if
  end subroutine join

  pure subroutine fallback_get_state(self, words)
    class(fallback_t), intent(in) :: self
    integer(i8), intent(out) :: words(fallback_words)

    words(1) = self%met
    call self%backoff%get_state(words(2:))
  end subroutine fallback_get_state

  pure subroutine fallback_set_state(self, words)
    class(fallback_t), intent(inout) :: self
    integer(i8), intent(in) :: words(fallback_words)

    self%met = narrow(words(1))
    call self%backoff%set_state(words(2:))
  end subroutine fallback_set_state

  !> Give back what the method holds, and forget what it has met.
  subroutine fallback_free(self)
    class(fallback_t), intent(inout) :: self

    if (allocated(self%method)) then
      call self%method%free()
      deallocate (self%method)
    end if
    self%taken = 0
    self%solved = 0
    self%iterations = 0
    self%passed_over = 0
    self%met = 0
    self%backoff = backoff_t(forgiven=1)
  end subroutine fallback_free

end module gravier_fallback
