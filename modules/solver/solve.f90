!> The iterations of one solve: run a method until its impulses meet the tolerance.
module gravier_solve
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_setup, phase_check, clock
  use gravier_contact_problem, only: contact_problem_t
  use gravier_scheme, only: scheme_t
  use gravier_descent, only: descent_t
  use gravier_closing, only: find_closing
  implicit none
  private
  public :: solve_control_t, solve_report_t, exact_solution_t, solve_contacts
  public :: solve_converged, solve_exhausted, solve_diverged

  integer, parameter :: solve_converged = 0, solve_exhausted = 1, solve_diverged = 2

  !> growth of the defect, relative to that at the start or to the largest |R^d| of a body, taken for divergence
  real(dp), parameter :: growth_limit = 1.0e4_dp
  !> the same for methods that cannot mend it themselves, whose defect has stayed above the reference for so many iterations
  real(dp), parameter :: unmended_limit = 4.0_dp
  integer, parameter :: unmended_iterations = 9
  !> checks that may be left out one after the other, and times the tolerance: an expected residual that is worth a check
  integer, parameter :: most_skips = 9
  real(dp), parameter :: worth_a_check = 1.2_dp
  !> momentum with which a body may go against contacts, see `find_closing`: at most, and over the tolerance; packings that have
  !> converged have a third of it and less
  real(dp), parameter :: most_closing = 0.3_dp, closing_of_tolerance = 3.0e2_dp
  !> the first iteration that sweeps with momentum may have checked before it is due
  integer, parameter :: early_check = 2
  !> ratio of a residual to what the sweeps before it moved impulses by, until a check has measured it, with momentum
  real(dp), parameter :: first_ratio = 0.5_dp
  !> figures of a check that a trace keeps
  integer, parameter :: n_traced = 5

  type :: solve_control_t
    real(dp) :: tolerance = 1.0e-4_dp
    integer :: max_iterations = 10000
    !> iterations between two checks; of these, some that would tell nothing new are left out; with momentum, whose sums are
    !> there after each iteration, a check comes as soon as they speak for one
    integer :: check_every = 10
    !> keep the figures of every check, and leave none out
    logical :: trace = .false.
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
    !> solve_converged, solve_exhausted (tolerance not met in max_iterations) or solve_diverged
    integer :: status = solve_exhausted
    integer :: iterations = 0
    real(dp) :: residual = 0.0_dp, jump = 0.0_dp
    !> above 0, a body went against contacts with this share of the largest momentum, and the solve had not converged whatever the
    !> figure
    real(dp) :: closing = 0.0_dp
    !> the contacts that slept were woken
    logical :: woken = .false.
    !> relative error on the impulses, negative where no exact solution is known
    real(dp) :: error = -1.0_dp
    !> what the tolerance is compared with at the end: residual or error
    real(dp) :: figure = 0.0_dp
    !> how the figure came down
    type(descent_t) :: descent
    !> on this rank: the whole solve, and what comes before its first check [s]
    real(dp) :: seconds = 0.0_dp, start_seconds = 0.0_dp
    !> one column a check, n_trace of them: iteration, residual, jump, error, seconds of this rank without those of checks
    !> (n_traced, room)
    integer :: n_trace = 0
    real(dp), allocatable :: trace(:, :)
  end type solve_report_t

contains

  !> Solve. The state is checked at the start, every check_every iterations and at the end, by the residual, or by
  !> the error where `exact` is given. A residual costs as much as two sweeps; what sweeps move impulses by goes with it and
  !> comes for nothing: a check is left out where that, times the ratio of the two at the last check, is far from the
  !> tolerance. Collective.
  subroutine solve_contacts(problem, scheme, control, report, error, exact)
    type(contact_problem_t), intent(inout) :: problem
    class(scheme_t), intent(inout) :: scheme
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    !> criterion 'error'
    class(exact_solution_t), intent(in), optional :: exact
    real(dp) :: reference, progress, ratio, began, checking, ignored
    integer :: skips, exceeded_at
    logical :: measure, done, choosy

    began = clock()
    checking = 0.0_dp
    if (control%trace) allocate (report%trace(n_traced, 64))
    reference = 0.0_dp
    progress = 0.0_dp
    ratio = 0.0_dp
    skips = 0
    exceeded_at = -1
    call start_timer(phase_setup)
    call scheme%start(problem, error)
    call stop_timer(phase_setup)
    if (allocated(error)) return
    report%start_seconds = clock() - began
    report%descent%first_check = control%check_every
    ! a trace and the error are of regular checks alone, and of all of them
    choosy = .not. (control%trace .or. present(exact))
    if (choosy .and. scheme%momentum%on) report%descent%first_check = min(early_check, control%check_every)
    call check(done)
    do while (.not. done)
      report%iterations = report%iterations + 1
      measure = mod(report%iterations, control%check_every) == 0
      ! sums of the iterations before are there with momentum; they tell nothing of bodies that go against contacts
      if (choosy .and. (measure .or. (scheme%momentum%on .and. report%iterations >= early_check .and. &
        & .not. report%closing > 0.0_dp))) measure = is_worth_a_check(measure)
      measure = measure .or. scheme%check_next .or. report%iterations == control%max_iterations
      call scheme%iterate(problem, measure, report%jump, error)
      if (allocated(error)) return
      if (measure) call check(done)
    end do
    if (report%status == solve_exhausted .and. scheme%keeps_best) then
      call scheme%conclude(problem)
      call problem%residual(report%residual, ignored)
      report%figure = report%residual
      if (present(exact)) then
        report%error = exact%error(problem)
        report%figure = report%error
      end if
    end if
    report%seconds = clock() - began

  contains

    !> Whether the sweeps of the iteration before speak for a check. Collective.
    logical function is_worth_a_check(regular) result(is_worth)
      !> whether check_every asks for one
      logical, intent(in) :: regular
      real(dp) :: sums(2), expected, enough

      call problem%sum_progress(sums)
      progress = 0.0_dp
      is_worth = regular
      expected = 0.0_dp
      if (all(ieee_is_finite(sums))) then
        if (sums(2) > 0.0_dp) progress = sqrt(sums(1)/sums(2))
        expected = ratio*progress
        enough = worth_a_check
        if (scheme%momentum%on) then
          if (.not. ratio > 0.0_dp) expected = first_ratio*progress
          enough = 1.0_dp
        end if
        if (expected > 0.0_dp) is_worth = expected <= enough*control%tolerance .or. &
          & (regular .and. (.not. ratio > 0.0_dp .or. skips >= most_skips .or. sqrt(sums(1)) > watched_growth()*reference))
      end if
      if (is_worth) then
        skips = 0
      else
        if (regular) skips = skips + 1
        if (regular .or. ratio > 0.0_dp) call report%descent%note(report%iterations, expected, control%tolerance)
      end if
    end function is_worth_a_check

    !> Growth of the changes that is worth a check: methods that lower what makes them grow are left to do so.
    real(dp) function watched_growth() result(growth)
      growth = merge(growth_limit, 1.0_dp, scheme%mends_growth())
    end function watched_growth

    !> Whether the defect has been above the reference for unmended_iterations and is unmended_limit times it, where the method
    !> has no means against it.
    logical function grows(defect)
      real(dp), intent(in) :: defect

      grows = .false.
      if (scheme%mends_growth() .or. .not. defect > reference) then
        exceeded_at = -1
      else if (exceeded_at < 0) then
        exceeded_at = report%iterations
      else
        grows = report%iterations >= exceeded_at + unmended_iterations .and. defect > unmended_limit*reference
      end if
    end function grows

    subroutine check(finished)
      logical, intent(out) :: finished
      real(dp) :: defect, start

      call start_timer(phase_check)
      start = clock()
      if (report%iterations > 0) call problem%evaluate()
      call problem%residual(report%residual, defect)
      report%figure = report%residual
      if (present(exact)) then
        report%error = exact%error(problem)
        report%figure = report%error
      end if
      if (control%trace) call keep_trace(report, start - began - checking)
      if (ieee_is_finite(report%figure)) call report%descent%note(report%iterations, report%figure, control%tolerance)
      if (report%iterations > 0 .and. progress > 0.0_dp) ratio = report%residual/progress
      call judge(defect, finished)
      if (.not. finished .and. problem%n_asleep > 0) call wake_if_due()
      checking = checking + clock() - start
      call stop_timer(phase_check)
    end subroutine check

    !> Where most of the defect lies in contacts that sleep, no sweep would lower it: they wake. Else the other contacts'
    !> part has to fall first, and may do.
    subroutine wake_if_due()
      if (problem%asleep_share < 0.5_dp) return
      call problem%wake()
      report%woken = .true.
      ! changes of all contacts are other changes
      ratio = 0.0_dp
    end subroutine wake_if_due

    !> A residual below the tolerance says little where a heavy body or one in strong bonds goes against contacts, or where there is
    !> no impulse yet and some contact asks for one.
    subroutine weigh_bodies()
      real(dp) :: closing, allowed

      allowed = min(most_closing, closing_of_tolerance*control%tolerance)
      closing = find_closing(problem, allowed)
      if (.not. problem%impulse_scale > 0.0_dp) closing = 1.0_dp
      if (closing > allowed) report%closing = closing
    end subroutine weigh_bodies

    subroutine judge(defect, finished)
      real(dp), intent(in) :: defect
      logical, intent(out) :: finished

      finished = .true.
      if (.not. (ieee_is_finite(report%figure) .and. ieee_is_finite(defect))) then
        report%status = solve_diverged
        return
      end if
      if (report%iterations == 0) reference = max(defect, problem%force_scale)
      report%closing = 0.0_dp
      if (report%figure <= control%tolerance .and. report%residual > 0.0_dp .and. .not. present(exact)) call weigh_bodies()
      if (report%figure <= control%tolerance .and. .not. report%closing > 0.0_dp) then
        report%status = solve_converged
      else if (defect > growth_limit*reference .and. .not. (scheme%guarded .and. report%iterations < control%max_iterations)) then
        report%status = solve_diverged
      else if (grows(defect)) then
        report%status = solve_diverged
      else if (report%iterations >= control%max_iterations) then
        report%status = solve_exhausted
      else
        finished = .false.
      end if
    end subroutine judge

  end subroutine solve_contacts

  subroutine keep_trace(report, seconds)
    type(solve_report_t), intent(inout) :: report
    !> since the start of the solve, without those of checks [s]
    real(dp), intent(in) :: seconds
    real(dp), allocatable :: longer(:, :)

    if (report%n_trace == size(report%trace, 2)) then
      allocate (longer(n_traced, 2*report%n_trace))
      longer(:, 1:report%n_trace) = report%trace
      call move_alloc(longer, report%trace)
    end if
    report%n_trace = report%n_trace + 1
    report%trace(1, report%n_trace) = report%iterations
    report%trace(2, report%n_trace) = report%residual
    report%trace(3, report%n_trace) = report%jump
    report%trace(4, report%n_trace) = report%error
    report%trace(5, report%n_trace) = seconds
  end subroutine keep_trace

end module gravier_solve
