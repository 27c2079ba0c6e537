!> The iterations of one solve: run a method until its velocities, or its impulses, are as exact as asked for.
module gravier_solve
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_setup, phase_check, clock
  use gravier_cell_response, only: respond
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_velocity_error, only: velocity_error_t, copies_ready, violations_allowed
  use gravier_check_schedule, only: check_schedule_t, growth_limit
  use gravier_defect_growth, only: defect_growth_t
  use gravier_stagnation, only: stagnation_t
  use gravier_layer_trial, only: layer_trial_t
  use gravier_fresh_start, only: fresh_start_t
  use gravier_solve_report, only: solve_control_t, solve_report_t, exact_solution_t, solve_watch_t, n_traced, by_velocity, &
    & by_residual, by_error, solve_converged, solve_exhausted, solve_diverged, solve_stagnated, solve_unbounded
  use gravier_residual_verdict, only: residual_ends, residual_in_vain, find_residual_verdict, grow_in_vain, &
    & excess_of, vain_look_t
  implicit none
  private
  public :: solve_contacts

  !> What a solve carries along.
  type :: solve_state_t
    type(velocity_error_t) :: velocity
    type(check_schedule_t) :: schedule
    type(stagnation_t) :: stagnation
    type(layer_trial_t) :: trial
    type(fresh_start_t) :: fresh
    !> the first defect, or the scale of forces where that is larger [N s]
    real(dp) :: reference = 0.0_dp
    !> when the solve began, and what its checks have taken [s]
    real(dp) :: began = 0.0_dp, checking = 0.0_dp
    type(defect_growth_t) :: growth
    !> the criterion is by_velocity
    logical :: by_estimate = .false.
    !> the verdict on a residual that is within its tolerance, of by_velocity at some iterations alone
    integer :: verdict = residual_ends
    type(vain_look_t) :: look
    !> accelerated sweeps have stagnated: plain ones come next
    logical :: ends_momentum = .false.
  end type solve_state_t

contains

  !> Solve. The state is checked at the start, at the end and in between as gravier_check_schedule says. Collective.
  subroutine solve_contacts(problem, method, control, report, error, exact, watch)
    !> with its velocity scale
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    !> needed where the criterion is by_error
    class(exact_solution_t), intent(in), optional :: exact
    class(solve_watch_t), intent(inout), optional :: watch
    type(solve_state_t) :: state
    logical :: measure, done, anew

    call prepare(state, problem, method, control, report, error)
    if (allocated(error)) return
    state%stagnation%patience = control%patience
    call check(state, problem, method, control, report, done, exact)
    state%schedule%settled = state%by_estimate .and. report%residual <= control%tolerance
    call state%fresh%init(problem, control%tolerance)
    if (state%by_estimate .and. control%layered) call state%trial%start(problem, report%residual, control%accuracy)
    do while (.not. done)
      report%iterations = report%iterations + 1
      measure = state%schedule%calls(problem, method, report%iterations, report%goal, state%reference, report%history)
      measure = measure .or. method%check_next .or. report%iterations == control%max_iterations .or. &
        & state%trial%calls(report%iterations)
      call method%iterate(problem, measure, report%jump, error)
      if (allocated(error)) return
      if (problem%cell_is_driven()) call respond(problem)
      if (measure) then
        call check(state, problem, method, control, report, done, exact)
        if (done) exit
        call state%trial%advance(problem, method, state%velocity, report%iterations, anew, error)
        if (allocated(error)) return
        if (.not. anew) call state%fresh%renew(problem, method, state%velocity, report%iterations, anew, error)
        if (allocated(error)) return
        if (state%ends_momentum) call sweep_plainly(state, method, report%iterations, anew)
        if (anew) call state%schedule%forget_ratio()
      end if
      call state%velocity%tests%keep_copy(problem, method, report%iterations)
      if (present(watch)) call watch%look(report)
    end do
    if (report%status == solve_converged .and. report%iterations > copies_ready .and. has_estimate(state)) &
      & report%figure_ratio = state%schedule%mean_ratio(control%figure_ratio)
    report%layered = state%trial%layered
    report%layered_sweeps = state%trial%sweeps
    if (report%status /= solve_converged .and. report%status /= solve_diverged .and. method%keeps_best) &
      & call take_best(state, problem, method, control, report, exact)
    report%seconds = clock() - state%began
  end subroutine solve_contacts

  !> All that comes before the first check. Collective.
  subroutine prepare(state, problem, method, control, report, error)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error

    state%began = clock()
    if (control%trace) allocate (report%trace(n_traced, 64))
    state%by_estimate = control%criterion == by_velocity
    state%schedule%check_every = control%check_every
    state%schedule%chooses = .not. (control%trace .or. control%criterion == by_error)
    state%schedule%by_estimate = state%by_estimate
    state%schedule%trusted = copies_ready
    if (state%by_estimate .and. method%acceleration%on) call state%schedule%take_ratio(control%figure_ratio)
    report%goal = merge(control%accuracy, control%tolerance, state%by_estimate)
    report%velocity_scale = problem%error_scale
    report%violation_allowed = violations_allowed*control%accuracy*problem%error_scale
    call start_timer(phase_setup)
    call method%start(problem, error)
    if (.not. allocated(error)) call state%velocity%start(problem, control%accuracy*problem%error_scale)
    call stop_timer(phase_setup)
    if (allocated(error)) return
    report%start_seconds = clock() - state%began
    report%history%first_check = state%schedule%first_check(method)
  end subroutine prepare

  !> The best impulses of a method that keeps them, where a solve ends without success, and their figures. Collective.
  subroutine take_best(state, problem, method, control, report, exact)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    class(exact_solution_t), intent(in), optional :: exact
    real(dp) :: ignored

    call method%conclude(problem)
    if (problem%cell_is_driven()) call respond(problem)
    call problem%residual(report%residual, ignored)
    call state%velocity%bound(problem)
    call complete_estimate(state, problem, method, report)
    if (control%criterion == by_error) report%error = exact%error(problem)
    call take_figure(state, problem, control, report)
  end subroutine take_best

  !> Judge the state after the iterations made. Collective.
  subroutine check(state, problem, method, control, report, finished, exact)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    logical, intent(out) :: finished
    class(exact_solution_t), intent(in), optional :: exact
    real(dp) :: defect, start

    call start_timer(phase_check)
    start = clock()
    if (report%iterations > 0) call problem%evaluate()
    ! where the last residual was within its tolerance, the velocity error is likely to be asked for
    if (state%by_estimate .and. report%iterations >= copies_ready .and. report%residual <= control%tolerance) then
      call state%velocity%assess(problem, method, report%iterations, report%residual, defect)
    else
      call problem%residual(report%residual, defect)
      call state%velocity%bound(problem)
    end if
    call method%see(problem, defect)
    if (control%criterion == by_error) report%error = exact%error(problem)
    call judge(state, problem, method, control, report, defect, finished)
    if (control%trace) call report%keep_trace(start - state%began - state%checking)
    if (ieee_is_finite(report%figure)) call report%history%note(report%iterations, report%figure, report%goal)
    call state%schedule%note_check(report%iterations, report%figure, report%goal, has_estimate(state), state%velocity%believed_from)
    state%checking = state%checking + clock() - start
    call stop_timer(phase_check)
  end subroutine check

  !> Whether the figure of the last check is what the criterion asks for, and no bound.
  pure logical function has_estimate(state)
    type(solve_state_t), intent(in) :: state
    has_estimate = state%velocity%is_assessed .or. .not. state%by_estimate
  end function has_estimate

  !> Whether the criterion is met; the velocity error as far as that needs it. Collective.
  subroutine find_whether_met(state, problem, method, control, report, is_met)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    logical, intent(out) :: is_met

    is_met = .false.
    state%verdict = residual_ends
    if (report%residual > control%tolerance .and. control%criterion /= by_error) return
    select case (control%criterion)
    case (by_residual)
      if (report%residual > 0.0_dp) call find_residual_verdict(problem, method, state%velocity, report%iterations, &
        & control%accuracy*problem%error_scale, state%verdict)
      is_met = state%verdict == residual_ends
    case (by_error)
      is_met = report%error <= control%tolerance
    case default
      call find_whether_velocity_met(state, problem, method, control, report, is_met)
    end select
  end subroutine find_whether_met

  !> Whether the estimated velocity error is within its limit, and no contact violates its law by much: the error is a mean by mass,
  !> which says little of light bodies. The bound by rest tells at once, the projection alone where the error is larger, and from
  !> zero impulses neither before some iterations. Collective.
  subroutine find_whether_velocity_met(state, problem, method, control, report, is_met)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    logical, intent(out) :: is_met
    real(dp) :: limit, defect

    limit = control%accuracy*problem%error_scale
    if (.not. report%residual > 0.0_dp) call state%velocity%look_at_bodies(problem, method, report%iterations)
    is_met = state%velocity%is_exact
    if (is_met .or. .not. report%residual > 0.0_dp) return
    if (.not. state%velocity%is_assessed) then
      if (state%velocity%rests()) then
        is_met = state%velocity%all_are_slow(problem)
        if (is_met) return
      else if (report%iterations < copies_ready) then
        return
      end if
      call state%velocity%assess(problem, method, report%iterations, report%residual, defect)
    end if
    if (state%velocity%criterion() <= limit) call state%velocity%add_levels(problem, method)
    report%velocity_error = state%velocity%estimate()
    is_met = state%velocity%criterion() <= limit
  end subroutine find_whether_velocity_met

  !> The whole estimate. Collective.
  subroutine complete_estimate(state, problem, method, report)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_report_t), intent(inout) :: report

    if (.not. report%residual > 0.0_dp) call state%velocity%look_at_bodies(problem, method, report%iterations)
    if (.not. state%velocity%is_exact) call state%velocity%complete(problem, method, report%iterations)
    report%velocity_error = state%velocity%estimate()
    report%violation = state%velocity%largest_violation
  end subroutine complete_estimate

  !> Whether a solve that another criterion has ended is within the accuracy, after the whole estimate. After few iterations test
  !> impulses tell too little, and a small error is not believed; the bound by rest stands in its place where there is one.
  !> Collective.
  subroutine judge_accuracy(state, problem, control, report)
    type(solve_state_t), intent(in) :: state
    type(contact_problem_t), intent(in) :: problem
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report

    report%accurate = state%velocity%is_exact
    if (state%velocity%rests() .and. .not. report%accurate) report%accurate = state%velocity%all_are_slow(problem)
    if (report%accurate) return
    report%accurate = state%velocity%criterion() <= control%accuracy*problem%error_scale
    if (report%iterations >= copies_ready) return
    report%judged = .not. report%accurate
    if (problem%rest_is_admissible) report%velocity_error = state%velocity%bound_by_rest
  end subroutine judge_accuracy

  !> What the goal is compared with.
  subroutine take_figure(state, problem, control, report)
    type(solve_state_t), intent(in) :: state
    type(contact_problem_t), intent(in) :: problem
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report

    select case (control%criterion)
    case (by_residual)
      report%figure = report%residual
      if (state%verdict /= residual_ends) report%figure = max(report%residual, &
        & control%tolerance*excess_of(state%velocity, control%accuracy*problem%error_scale))
    case (by_error)
      report%figure = report%error
    case default
      report%figure = report%residual*(control%accuracy/control%tolerance)
      if (problem%error_scale > 0.0_dp .and. .not. state%velocity%is_exact) &
        & report%figure = max(report%figure, state%velocity%criterion()/problem%error_scale)
    end select
  end subroutine take_figure

  !> Whether the solve ends here, and why. Collective.
  subroutine judge(state, problem, method, control, report, defect, finished)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    real(dp), intent(in) :: defect
    logical, intent(out) :: finished
    logical :: met

    finished = .true.
    report%figure = report%residual
    if (.not. (ieee_is_finite(report%residual) .and. ieee_is_finite(defect))) then
      report%status = solve_diverged
      return
    end if
    if (report%iterations == 0) state%reference = max(defect, problem%force_scale)
    report%velocity_error = merge(state%velocity%estimate(), 0.0_dp, report%residual > 0.0_dp)
    call find_whether_met(state, problem, method, control, report, met)
    if (state%by_estimate .and. .not. met .and. report%residual <= control%tolerance) then
      if (state%look%is_due(report%iterations)) call find_residual_verdict(problem, method, state%velocity, report%iterations, &
        & control%accuracy*problem%error_scale, state%verdict)
    end if
    call take_figure(state, problem, control, report)
    if (met) then
      report%status = solve_converged
    else if (state%verdict == residual_in_vain) then
      report%status = solve_unbounded
    else if (defect > growth_limit*state%reference .and. &
        & .not. (method%guarded .and. report%iterations < control%max_iterations)) then
      report%status = solve_diverged
    else
      call state%growth%note(method%mends_growth(), report%iterations, defect, state%reference)
      if (state%growth%unmended) then
        report%status = solve_diverged
      else if (report%iterations >= control%max_iterations) then
        report%status = merge(solve_stagnated, solve_exhausted, state%stagnation%is_last)
        if (control%criterion == by_residual) then
          if (grow_in_vain(problem, method, state%velocity, report%iterations)) report%status = solve_unbounded
        end if
      else
        call judge_stagnation(state, problem, method, control, report, finished)
      end if
    end if
    if (control%trace .or. (finished .and. .not. (met .and. state%by_estimate))) &
      & call complete_estimate(state, problem, method, report)
    if (met .and. .not. state%by_estimate) call judge_accuracy(state, problem, control, report)
    if (control%trace .or. .not. met) call take_figure(state, problem, control, report)
  end subroutine judge

  !> Whether more iterations promise nothing: because there is no solution, or because the method finds none. Where accelerated
  !> sweeps gain nothing more, plain ones, which end what oscillates, follow first. Collective.
  subroutine judge_stagnation(state, problem, method, control, report, has_stagnated)
    type(solve_state_t), intent(inout) :: state
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    logical, intent(out) :: has_stagnated
    real(dp) :: figures(2)
    logical :: due, in_vain

    has_stagnated = .false.
    ! the residual of no impulses is relative to something else
    if (report%iterations == 0) return
    figures(1) = merge(report%figure, report%residual*(control%accuracy/control%tolerance), has_estimate(state))
    figures(2) = report%velocity_error
    call state%stagnation%note(problem, report%iterations, figures, method%acceleration%extrapolates(), &
      & merge(report%residual, 0.0_dp, report%residual > control%tolerance), due)
    if (.not. due) return
    if (state%velocity%levels%most_depth < 0) call state%velocity%levels%find_depth(problem)
    call state%stagnation%judge(problem, report%iterations, state%velocity%levels%most_depth, has_stagnated, in_vain)
    if (in_vain) then
      report%status = solve_unbounded
    else if (has_stagnated .and. method%persists .and. control%patience == 0) then
      has_stagnated = .false.
      call state%stagnation%go_on(problem, report%iterations)
    else if (has_stagnated .and. method%acceleration%extrapolates() .and. &
      & state%stagnation%may_begin_last(report%iterations, state%velocity%levels%most_depth)) then
      has_stagnated = .false.
      state%ends_momentum = .true.
    else if (has_stagnated) then
      report%status = solve_stagnated
      call state%stagnation%describe(problem, report%creep)
    end if
  end subroutine judge_stagnation

  !> Plain sweeps take the place of accelerated ones, to the end of the solve.
  subroutine sweep_plainly(state, method, iteration, anew)
    type(solve_state_t), intent(inout) :: state
    class(method_t), intent(inout) :: method
    !> iterations made
    integer, intent(in) :: iteration
    logical, intent(out) :: anew

    anew = .true.
    state%ends_momentum = .false.
    call method%acceleration%end_for_good()
    method%work%suspended = method%work%suspended + 1
    call state%stagnation%begin_last(iteration)
    call state%velocity%begin_anew(iteration)
  end subroutine sweep_plainly

end module gravier_solve
