!> The iterations of one solve: run a method until its velocities, or its impulses, are as exact as asked for.
module gravier_solve
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_setup, phase_check, clock
  use gravier_contact_problem, only: contact_problem_t
  use gravier_scheme, only: scheme_t
  use gravier_descent, only: descent_t
  use gravier_velocity_error, only: velocity_error_t, copies_ready, violations_allowed
  use gravier_layered_start, only: carry_loads
  use gravier_vain_impulses, only: kept_impulses_t, are_in_vain
  implicit none
  private
  public :: solve_control_t, solve_report_t, exact_solution_t, solve_contacts
  public :: by_velocity, by_residual, by_error
  public :: solve_converged, solve_exhausted, solve_diverged, solve_stagnated, solve_unbounded

  !> what ends a solve: the estimated velocity error and the residual; the residual alone; the error of known impulses
  integer, parameter :: by_velocity = 1, by_residual = 2, by_error = 3

  !> met; not met in max_iterations; grown beyond bounds; not met, and nothing gained any more; no solution seems to exist
  integer, parameter :: solve_converged = 0, solve_exhausted = 1, solve_diverged = 2, solve_stagnated = 3, solve_unbounded = 4

  !> growth of the defect, relative to that at the start or to the largest |R^d| of a body, taken for divergence
  real(dp), parameter :: growth_limit = 1.0e4_dp
  !> the same for methods that cannot mend it themselves, whose defect has stayed above the reference for so many iterations
  real(dp), parameter :: unmended_limit = 4.0_dp
  integer, parameter :: unmended_iterations = 9
  !> checks that may be left out one after the other, and times the goal: an expected figure that is worth a check
  integer, parameter :: most_skips = 9
  real(dp), parameter :: worth_a_check = 1.2_dp
  !> the first iteration that sweeps with momentum may have checked before it is due
  integer, parameter :: early_check = 2
  !> iterations between two checks, over those made: at least where they are not due, and at most
  real(dp), parameter :: least_pause = 0.06_dp, most_pause = 0.25_dp
  !> what is left of the figure since the last check where the next one need not wait twice as long
  real(dp), parameter :: falling = 0.85_dp
  !> ratio of a figure to what the sweeps before it moved impulses by, until a check has measured it, with momentum
  real(dp), parameter :: first_ratio = 0.5_dp
  !> what is left of the figure where a solve has gained something. A solve has stagnated that has gained nothing for so many iterations,
  !> with momentum or without, and for as many as until then, and that has had so many times those that a wave takes from end to end;
  !> where a residual that is small already is what is missing, so many times that
  real(dp), parameter :: gained = 0.9_dp, small_residual = 1.0e-3_dp
  integer, parameter :: patience = 1000, plain_patience = 2000, waves = 6, residual_patience = 4
  !> where a pass over layers is tried: after the first iterations, if residual at the start, velocity error over its scale and
  !> way to supports are above these; later, after a part of the depth, where that is above another; iterations after it until it is
  !> judged, and what must be left of the error then
  real(dp), parameter :: unsettled = 0.1_dp, much = 0.5_dp, worth_keeping = 0.8_dp, late = 0.3_dp, nearly = 0.7_dp
  real(dp), parameter :: deep = 25.0_dp, very_deep = 60.0_dp
  integer, parameter :: trial = 6
  !> root mean square of the impulses over the largest load of a body, beyond what heights and arches make of loads
  real(dp), parameter :: most_impulses = 1.0e6_dp
  !> figures of a check that a trace keeps
  integer, parameter :: n_traced = 6

  type :: solve_control_t
    integer :: criterion = by_residual
    !> of the residual, or the error
    real(dp) :: tolerance = 1.0e-4_dp
    !> velocity error over the velocity scale of the problem
    real(dp) :: accuracy = 0.1_dp
    integer :: max_iterations = 10000
    !> iterations between two checks; of these, some that would tell nothing new are left out; with momentum, whose sums are
    !> there after each iteration, a check comes as soon as they speak for one
    integer :: check_every = 10
    !> keep the figures of every check, and leave none out
    logical :: trace = .false.
    !> try a start that carries loads across layers
    logical :: layered = .true.
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
    !> the contacts that slept were woken
    logical :: woken = .false.
    !> sweeps over all contacts that a pass over layers took, 0 where there was none; whether the solve went on from it
    real(dp) :: layered_sweeps = 0.0_dp
    logical :: layered = .false.
    !> relative error on the impulses, negative where no exact solution is known
    real(dp) :: error = -1.0_dp
    !> what the goal is compared with at the end, and that: the residual or the error and the tolerance; or the velocity error over
    !> its scale, or the residual in its place where that is farther from its tolerance, and the accuracy
    real(dp) :: figure = 0.0_dp, goal = 0.0_dp
    !> how the figure came down
    type(descent_t) :: descent
    !> on this rank: the whole solve, and what comes before its first check [s]
    real(dp) :: seconds = 0.0_dp, start_seconds = 0.0_dp
    !> one column a check, n_trace of them: iteration, residual, jump, error, velocity error, seconds of this rank without those of
    !> checks (n_traced, room)
    integer :: n_trace = 0
    real(dp), allocatable :: trace(:, :)
  end type solve_report_t

contains

  !> Solve. The state is checked at the start, every check_every iterations and at the end. A residual costs as much as two
  !> sweeps, the estimate of the velocity error as much again; what sweeps move impulses by goes with them and comes for nothing:
  !> a check is left out where that, times the ratio of the two at the last check, is far from the goal. Collective.
  subroutine solve_contacts(problem, scheme, control, report, error, exact)
    !> with its velocity scale
    type(contact_problem_t), intent(inout) :: problem
    class(scheme_t), intent(inout) :: scheme
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    !> needed where the criterion is by_error
    class(exact_solution_t), intent(in), optional :: exact
    type(velocity_error_t) :: velocity
    real(dp) :: reference, progress, ratio, began, checking, ignored, best, last_figure, pause
    integer :: skips, exceeded_at, last_check, best_at, trial_end, next_look
    logical :: measure, done, choosy, may_try_layers, wants_layers, settled
    type(kept_impulses_t) :: kept(size(problem%sub))
    real(dp) :: error_before

    began = clock()
    checking = 0.0_dp
    if (control%trace) allocate (report%trace(n_traced, 64))
    reference = 0.0_dp
    progress = 0.0_dp
    ratio = 0.0_dp
    skips = 0
    exceeded_at = -1
    last_check = 0
    last_figure = huge(1.0_dp)
    pause = 0.0_dp
    best = huge(1.0_dp)
    best_at = 0
    next_look = 0
    trial_end = 0
    error_before = 0.0_dp
    report%goal = merge(control%accuracy, control%tolerance, control%criterion == by_velocity)
    report%velocity_scale = problem%error_scale
    report%violation_allowed = violations_allowed*control%accuracy*problem%error_scale
    call start_timer(phase_setup)
    call scheme%start(problem, error)
    if (.not. allocated(error)) call velocity%start(problem)
    call stop_timer(phase_setup)
    if (allocated(error)) return
    report%start_seconds = clock() - began
    report%descent%first_check = control%check_every
    ! a trace and the error are of regular checks alone, and of all of them
    choosy = .not. (control%trace .or. control%criterion == by_error)
    if (choosy .and. scheme%momentum%on) report%descent%first_check = min(early_check, control%check_every)
    call check(done)
    may_try_layers = control%layered .and. control%criterion == by_velocity .and. any(abs(problem%load) > 0.0_dp)
    wants_layers = may_try_layers .and. report%residual > unsettled
    settled = report%residual <= control%tolerance
    do while (.not. done)
      report%iterations = report%iterations + 1
      measure = mod(report%iterations, control%check_every) == 0
      ! sums of the iterations before are there with momentum
      if (choosy .and. (measure .or. (scheme%momentum%on .and. report%iterations >= early_check))) &
        & measure = is_worth_a_check(measure)
      measure = measure .or. scheme%check_next .or. report%iterations == control%max_iterations .or. &
        & ((wants_layers .or. (settled .and. control%criterion == by_velocity)) .and. report%iterations == copies_ready) .or. &
        & report%iterations == trial_end
      call scheme%iterate(problem, measure, report%jump, error)
      if (allocated(error)) return
      if (measure) call check(done)
      if (done) exit
      if (report%iterations == trial_end) call judge_layers(error)
      if (wants_layers .and. report%iterations == copies_ready) call try_layers(much, deep, error)
      if (measure .and. may_try_layers .and. velocity%most_depth > very_deep .and. &
        & (report%layered .or. report%iterations > late*velocity%most_depth) .and. report%iterations >= trial_end) &
        & call try_layers(control%accuracy, very_deep, error)
      if (allocated(error)) return
      call velocity%keep_copy(problem, report%iterations)
    end do
    if (report%status /= solve_converged .and. report%status /= solve_diverged .and. scheme%keeps_best) then
      call scheme%conclude(problem)
      call problem%residual(report%residual, ignored)
      call complete_estimate()
      if (control%criterion == by_error) report%error = exact%error(problem)
      call take_figure()
    end if
    report%seconds = clock() - began

  contains

    !> Whether the sweeps of the iteration before speak for a check. Collective.
    logical function is_worth_a_check(regular) result(is_worth)
      !> whether check_every asks for one
      logical, intent(in) :: regular
      real(dp) :: sums(2), expected, enough
      logical :: due

      call problem%sum_progress(sums)
      progress = 0.0_dp
      is_worth = regular
      expected = 0.0_dp
      due = skips >= most_skips
      if (control%criterion == by_velocity) due = due .or. report%iterations - last_check >= most_pause*report%iterations
      if (all(ieee_is_finite(sums))) then
        if (sums(2) > 0.0_dp) progress = sqrt(sums(1)/sums(2))
        expected = ratio*progress
        enough = worth_a_check
        if (scheme%momentum%on) then
          if (.not. ratio > 0.0_dp) expected = first_ratio*progress
          enough = 1.0_dp
        end if
        if (expected > 0.0_dp) is_worth = (expected <= enough*report%goal .and. &
          & (regular .or. report%iterations - last_check > max(pause, least_pause*report%iterations))) .or. &
          & (regular .and. (.not. ratio > 0.0_dp .or. due .or. sqrt(sums(1)) > watched_growth()*reference))
      end if
      if (is_worth) then
        skips = 0
      else
        if (regular) skips = skips + 1
        if (regular .or. ratio > 0.0_dp) call report%descent%note(report%iterations, expected, report%goal)
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
      if (control%criterion == by_error) report%error = exact%error(problem)
      call judge(defect, finished)
      if (control%trace) call keep_trace(report, start - began - checking)
      if (ieee_is_finite(report%figure)) call report%descent%note(report%iterations, report%figure, report%goal)
      if (report%iterations > 0 .and. progress > 0.0_dp) ratio = report%figure/progress
      if (report%iterations > 0) pause = merge(0.0_dp, min(2.0_dp*max(pause, 1.0_dp), most_pause*report%iterations), &
        & report%figure < falling*last_figure)
      last_figure = report%figure
      last_check = report%iterations
      if (.not. finished .and. problem%n_asleep > 0) call wake_if_due()
      checking = checking + clock() - start
      call stop_timer(phase_check)
    end subroutine check

    !> Where most of the defect lies in contacts that sleep, no sweep would lower it: they wake. Else the other contacts'
    !> part has to fall first, and may do.
    subroutine wake_if_due()
      if (problem%asleep_share < 0.5_dp .and. report%residual > control%tolerance) return
      call problem%wake()
      report%woken = .true.
      ! changes of all contacts are other changes
      ratio = 0.0_dp
    end subroutine wake_if_due

    !> Whether the criterion is met; the velocity error as far as that needs it. Collective.
    logical function is_met()
      is_met = .false.
      if (report%residual > control%tolerance .and. control%criterion /= by_error) return
      select case (control%criterion)
      case (by_residual)
        is_met = .true.
      case (by_error)
        is_met = report%error <= control%tolerance
      case default
        is_met = velocity_is_met()
      end select
    end function is_met

    !> Whether the estimated velocity error is within its limit, and no contact violates its law by much: the error is a mean by mass,
    !> which says little of light bodies. The bound by rest tells at once, the projection alone where the error is larger, and from
    !> zero impulses neither before some iterations. Collective.
    logical function velocity_is_met() result(is_met)
      real(dp) :: limit

      limit = control%accuracy*problem%error_scale
      is_met = .not. report%residual > 0.0_dp
      if (is_met) return
      if (velocity%criterion() <= limit) then
        is_met = velocity%excludes_violations(problem, limit)
        if (is_met) return
      else if (report%iterations < copies_ready) then
        return
      end if
      call velocity%project(problem, scheme, report%iterations)
      if (velocity%criterion() <= limit) call velocity%add_levels(problem)
      report%velocity_error = velocity%estimate()
      is_met = velocity%criterion() <= limit
    end function velocity_is_met

    !> The whole estimate. Where the residual is rounding the velocities are exact. Collective.
    subroutine complete_estimate()
      call velocity%bound(problem)
      report%velocity_error = 0.0_dp
      if (.not. report%residual > 0.0_dp) return
      call velocity%project(problem, scheme, report%iterations)
      call velocity%add_levels(problem)
      report%velocity_error = velocity%estimate()
      report%violation = velocity%largest_violation
    end subroutine complete_estimate

    !> Where much of the velocities is missing and the way to the supports is long, go on from a pass over layers. Collective.
    subroutine try_layers(least_error, least_way, error)
      !> error over its scale, and way to supports in mean diameters, above which it is tried
      real(dp), intent(in) :: least_error, least_way
      type(error_t), allocatable, intent(inout) :: error
      real(dp) :: sweeps
      integer :: s

      ! there are at least as many contacts on the way as mean diameters, or nearly so
      if (velocity%most_depth < 0) call velocity%find_depth(problem)
      if (velocity%most_depth < nearly*least_way) then
        may_try_layers = .false.
        return
      end if
      call complete_estimate()
      if (velocity%criterion() <= least_error*problem%error_scale) return
      may_try_layers = .false.
      do s = 1, size(problem%sub)
        kept(s)%value = problem%sub(s)%impulse
      end do
      error_before = velocity%criterion()
      call carry_loads(problem, least_way, scheme%work, sweeps)
      if (.not. sweeps > 0.0_dp) return
      report%layered_sweeps = report%layered_sweeps + sweeps
      report%layered = .true.
      trial_end = report%iterations + trial
      call begin_anew(error)
    end subroutine try_layers

    !> Go on from the pass over layers where it has brought something, else from the impulses before it. Collective.
    subroutine judge_layers(error)
      type(error_t), allocatable, intent(inout) :: error
      integer :: s

      call complete_estimate()
      if (velocity%criterion() < worth_keeping*error_before) then
        ! what errors of the layers have left, another pass lowers again
        may_try_layers = velocity%most_depth > very_deep
        return
      end if
      report%layered = .false.
      do s = 1, size(problem%sub)
        problem%sub(s)%impulse(:, :, :) = kept(s)%value
      end do
      call begin_anew(error)
    end subroutine judge_layers

    !> The method starts anew from the impulses that the problem holds now.
    subroutine begin_anew(error)
      type(error_t), allocatable, intent(inout) :: error

      call scheme%start(problem, error)
      scheme%work%solves = scheme%work%solves - 1
      call velocity%forget_copies(report%iterations, report%layered)
      ratio = 0.0_dp
    end subroutine begin_anew

    !> What the goal is compared with.
    subroutine take_figure()
      select case (control%criterion)
      case (by_residual)
        report%figure = report%residual
      case (by_error)
        report%figure = report%error
      case default
        report%figure = report%residual*(control%accuracy/control%tolerance)
        if (problem%error_scale > 0.0_dp .and. report%residual > 0.0_dp) &
          & report%figure = max(report%figure, velocity%criterion()/problem%error_scale)
      end select
    end subroutine take_figure

    subroutine judge(defect, finished)
      real(dp), intent(in) :: defect
      logical, intent(out) :: finished
      logical :: met

      finished = .true.
      report%figure = report%residual
      if (.not. (ieee_is_finite(report%residual) .and. ieee_is_finite(defect))) then
        report%status = solve_diverged
        return
      end if
      if (report%iterations == 0) reference = max(defect, problem%force_scale)
      call velocity%bound(problem)
      report%velocity_error = velocity%estimate()
      if (.not. report%residual > 0.0_dp) report%velocity_error = 0.0_dp
      ! impulses that no loads can make are those of a problem without a solution
      met = is_met() .and. problem%impulse_scale <= most_impulses*problem%rounded_scale
      call take_figure()
      if (met) then
        report%status = solve_converged
      else if (defect > growth_limit*reference .and. .not. (scheme%guarded .and. report%iterations < control%max_iterations)) then
        report%status = solve_diverged
      else if (grows(defect)) then
        report%status = solve_diverged
      else if (report%iterations >= control%max_iterations) then
        report%status = solve_exhausted
      else
        finished = stagnates()
      end if
      if (control%trace .or. (finished .and. .not. (met .and. control%criterion == by_velocity))) call complete_estimate()
      if (control%trace) call take_figure()
    end subroutine judge

    !> Whether nothing was gained in so many iterations that nothing is to be expected of more: because there is no solution, or
    !> because the method finds none. Collective.
    logical function stagnates()
      stagnates = .false.
      ! the residual of no impulses is relative to something else
      if (report%iterations == 0) return
      if (report%figure < gained*best) then
        best = report%figure
        best_at = report%iterations
        next_look = best_at + merge(patience, plain_patience, scheme%momentum%on) + best_at
        ! residuals that are to become small fall in phases with and without momentum, which grow
        if (report%residual > control%tolerance .and. report%residual < small_residual) &
          & next_look = best_at + residual_patience*(plain_patience + best_at)
        return
      end if
      if (report%iterations < next_look) return
      if (velocity%most_depth < 0) call velocity%find_depth(problem)
      if (report%iterations < waves*velocity%most_depth) return
      next_look = report%iterations + patience
      if (grow_in_vain()) then
        stagnates = .true.
        report%status = solve_unbounded
      else if (.not. scheme%persists) then
        stagnates = .true.
        report%status = solve_stagnated
      end if
    end function stagnates

    !> Whether impulses have grown in vain since the older copy of them. Collective.
    logical function grow_in_vain() result(in_vain)
      type(kept_impulses_t) :: earlier(size(problem%sub))
      integer :: s

      do s = 1, size(problem%sub)
        call velocity%copy_of(problem, s, earlier(s)%value)
      end do
      in_vain = are_in_vain(problem, earlier)
    end function grow_in_vain

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
    report%trace(5, report%n_trace) = report%velocity_error
    report%trace(6, report%n_trace) = seconds
  end subroutine keep_trace

end module gravier_solve
