!> What is asked of a solve, what it reports, and who watches it.
module gravier_solve_report
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_convergence_history, only: convergence_history_t
  use gravier_creeping_groups, only: creep_t
  implicit none
  private
  public :: solve_control_t, solve_report_t, exact_solution_t, solve_watch_t, n_traced
  public :: by_velocity, by_residual, by_error
  public :: solve_converged, solve_exhausted, solve_diverged, solve_stagnated, solve_unbounded

  !> what ends a solve: the velocity error and the residual; the residual (gravier_residual_verdict); the error of known impulses
  integer, parameter :: by_velocity = 1, by_residual = 2, by_error = 3

  !> met; not met in max_iterations; grown beyond bounds; not met, and nothing gained any more; no solution seems to exist
  integer, parameter :: solve_converged = 0, solve_exhausted = 1, solve_diverged = 2, solve_stagnated = 3, solve_unbounded = 4

  !> figures of a check that a trace keeps
  integer, parameter :: n_traced = 6

  type :: solve_control_t
    integer :: criterion = by_residual
    !> of the residual, or the error
    real(dp) :: tolerance = 1.0e-4_dp
    !> velocity error over the velocity scale of the problem
    real(dp) :: accuracy = 0.1_dp
    integer :: max_iterations = 10000
    !> iterations between two checks; of these, some that would tell nothing new are left out. Accelerated sweeps have their sums
    !> after each iteration, and are checked as soon as these indicate convergence
    integer :: check_every = 10
    !> iterations without gain after which a method of direct solves has stagnated; 0: those of sweeps
    integer :: patience = 0
    !> keep the figures of every check, and leave none out
    logical :: trace = .false.
    !> try a start that carries loads across layers
    logical :: layered = .true.
    !> `figure_ratio` of the report of a solve before this one, 0 where there was none: it tells when checks
    !> of accelerated sweeps that ask for the velocity error are worth making
    real(dp) :: figure_ratio = 0.0_dp
  end type solve_control_t

  !> The known impulses of a problem, for the criterion 'error'.
  type, abstract :: exact_solution_t
  contains
    procedure(error_of), deferred :: error
  end type exact_solution_t

  abstract interface
    !> |r - r_exact| / |r_exact|. Collective.
    real(dp) function error_of(self, problem)
      import :: exact_solution_t, contact_problem_t, dp
      implicit none
      class(exact_solution_t), intent(in) :: self
      type(contact_problem_t), intent(in) :: problem
    end function error_of
  end interface

  type :: solve_report_t
    !> solve_converged or the reason why not
    integer :: status = solve_exhausted
    integer :: iterations = 0
    real(dp) :: residual = 0.0_dp, jump = 0.0_dp
    !> the estimate of gravier_velocity_error, and what it is compared with [m/s]
    real(dp) :: velocity_error = 0.0_dp, velocity_scale = 0.0_dp
    !> largest velocity by which a contact violates its law, and what is allowed of it; 0 where it is not known [m/s]
    real(dp) :: violation = 0.0_dp, violation_allowed = 0.0_dp
    !> whether the velocities are within the accuracy, whatever the criterion; whether that is known, as it is not after few
    !> iterations. Both hold of solves that have converged alone.
    logical :: accurate = .true., judged = .true.
    !> sweeps over all contacts that a pass over layers took, 0 where there was none; whether the solve went on from it
    real(dp) :: layered_sweeps = 0.0_dp
    logical :: layered = .false.
    !> relative error on the impulses, negative where no exact solution is known
    real(dp) :: error = -1.0_dp
    !> what the goal is compared with at the end, and that: the residual or the error and the tolerance; or the velocity error over
    !> its scale, or the residual in its place where that is farther from its tolerance, and the accuracy
    real(dp) :: figure = 0.0_dp, goal = 0.0_dp
    !> that figure over what the last iteration moved impulses by, relative to them; the geometric mean of it and of that of the
    !> control, where there is one, because single solves scatter; 0 of a solve that tells nothing to the next one
    real(dp) :: figure_ratio = 0.0_dp
    !> of a solve that stagnated
    type(creep_t) :: creep
    !> how the figure came down
    type(convergence_history_t) :: history
    !> on this rank: the whole solve, and what comes before its first check [s]
    real(dp) :: seconds = 0.0_dp, start_seconds = 0.0_dp
    !> one column a check, n_trace of them: iteration, residual, jump, error, velocity error, seconds of this rank without those of
    !> checks (n_traced, room)
    integer :: n_trace = 0
    real(dp), allocatable :: trace(:, :)
  contains
    procedure :: keep_trace => solve_report_keep_trace
    procedure :: follow => solve_report_follow
  end type solve_report_t

  !> Who is told how a solve goes on.
  type, abstract :: solve_watch_t
  contains
    procedure(look_at), deferred :: look
  end type solve_watch_t

  abstract interface
    !> After an iteration, with the figures of the last check. Each rank is told on its own.
    subroutine look_at(self, report)
      import :: solve_watch_t, solve_report_t
      implicit none
      class(solve_watch_t), intent(inout) :: self
      type(solve_report_t), intent(in) :: report
    end subroutine look_at
  end interface

contains

  !> Keep the figures of a check.
  subroutine solve_report_keep_trace(self, seconds)
    class(solve_report_t), intent(inout) :: self
    !> since the start of the solve, without those of checks [s]
    real(dp), intent(in) :: seconds
    real(dp), allocatable :: longer(:, :)

    if (self%n_trace == size(self%trace, 2)) then
      allocate (longer(n_traced, 2*self%n_trace))
      longer(:, 1:self%n_trace) = self%trace
      call move_alloc(longer, self%trace)
    end if
    self%n_trace = self%n_trace + 1
    associate (row => self%trace(:, self%n_trace))
      row(1) = self%iterations
      row(2) = self%residual
      row(3) = self%jump
      row(4) = self%error
      row(5) = self%velocity_error
      row(6) = seconds
    end associate
  end subroutine solve_report_keep_trace

  !> Make the report of a solve that went on from another one that of both together. It ends as it has ended; iterations, seconds,
  !> passes over layers, history and trace are those of both.
  pure subroutine solve_report_follow(self, first)
    class(solve_report_t), intent(inout) :: self
    type(solve_report_t), intent(in) :: first

    if (allocated(first%trace)) call follow_trace(self, first)
    call self%history%follow(first%history, first%iterations)
    self%iterations = first%iterations + self%iterations
    self%seconds = first%seconds + self%seconds
    self%start_seconds = first%start_seconds
    self%layered = first%layered .or. self%layered
    self%layered_sweeps = first%layered_sweeps + self%layered_sweeps
  end subroutine solve_report_follow

  !> Put the trace of the first solve before that of the second, whose iterations and seconds go on.
  pure subroutine follow_trace(self, first)
    class(solve_report_t), intent(inout) :: self
    type(solve_report_t), intent(in) :: first
    real(dp), allocatable :: both(:, :)
    integer :: n

    n = first%n_trace
    allocate (both(n_traced, n + self%n_trace))
    both(:, 1:n) = first%trace(:, 1:n)
    both(:, n + 1:) = self%trace(:, 1:self%n_trace)
    both(1, n + 1:) = both(1, n + 1:) + first%iterations
    both(6, n + 1:) = both(6, n + 1:) + first%seconds
    self%n_trace = n + self%n_trace
    call move_alloc(both, self%trace)
  end subroutine follow_trace

end module gravier_solve_report
