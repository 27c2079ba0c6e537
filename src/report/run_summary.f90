!> The closing summary of a run, in words: whether it converged, where its time went, what would halve it.
module gravier_run_summary
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted, text_from
  use gravier_timers, only: phase_names, n_phases, phase_neighbourhood, phase_exchange, phase_factorise, phase_interface, &
    & phase_interface_solve, phase_reduction, phase_diagnostics, phase_output, phase_sweep, phase_check
  use gravier_convergence_history, only: at_tolerance
  use gravier_progress, only: duration_text
  use gravier_run_tally, only: far_off, often_mended
  use gravier_accuracy_lines, only: goal_name, goal_text, mean_size_name, drifts, percent, plain
  use gravier_config_types, only: decomposition_config_t
  use gravier_method_options, only: method_features_t, default_always
  use gravier_method_registry, only: features_of
  use gravier_inflow_lines, only: inflow_doubt
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: converged_text, mending_text, time_text, halving_text, verdict_text

  !> phases that are named, the dearest first, and the least fraction that is [%]
  integer, parameter :: named = 4
  real(dp), parameter :: least_share = 3.0_dp
  !> part of the paths of grains below which their shifts by projections are small
  real(dp), parameter :: little = 0.01_dp
  !> the same below which they are no fault, however many steps make them
  real(dp), parameter :: negligible = 1.0e-3_dp
  !> overlap of rigid contacts that is named, in mean radii, or halves of the mean thickness
  real(dp), parameter :: deep = 0.1_dp
  !> contacts of rank 0 below which more ranks do not pay
  integer(i8), parameter :: contacts_a_rank = 5000
  !> part of the run above which neighbour lists that hardly last a step are worth a word
  real(dp), parameter :: much = 0.2_dp
  !> velocity error over its scale that a looser goal may lead to
  real(dp), parameter :: loosest = 0.1_dp
  !> part of the run that a rank waits for the slowest one in the mean, from which on uneven subdomains are named
  real(dp), parameter :: long_wait = 0.2_dp
  !> plain iterations a solve from which on acceleration is advised: it takes a fifth of them and less (doc/acceleration.md)
  integer(i8), parameter :: many_iterations = 50

contains

  !> How many steps reached the goal, in how many iterations, and how the others ended.
  function converged_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    character(len=24) :: mean

    associate (effort => simulation%effort, tally => simulation%tally)
      write (mean, "(f24.1)") real(effort%iterations, dp)/real(max(effort%solves, 1_i8), dp)
      if (simulation%failed == 0 .and. is_doubtful(simulation)) then
        text = "only by the "//trim(simulation%config%solver%criterion)//": every solve reached the "//goal_text(simulation)// &
          & ", but "//doubts_text(simulation)
      else if (simulation%failed == 0 .and. simulation%spot_checks%refute()) then
        text = "NO: "//checks_text(simulation)
      else if (simulation%failed == 0) then
        text = "yes: every solve reached the "//goal_text(simulation)
        if (goal_name(simulation) /= "accuracy") text = text//" and the accuracy "//to_text(simulation%config%solver%accuracy, 3)
      else
        text = "NO: "//to_text(simulation%failed)//" of "//to_text(max(int(simulation%step, i8), tally%solves))// &
          & " solves did not reach the "//goal_text(simulation)
        if (misses_residual_only(simulation)) then
          text = text//", because of the tolerance "//to_text(simulation%config%solver%tolerance, 3)// &
            & " of their residuals alone; at worst "//to_text(tally%worst_residual, 3)
        else
          text = text//"; at worst "//to_text(effort%worst, 3)
          ! the velocity error in a norm of one of the conditions may be larger than its mean over all mass
          if (simulation%config%solver%criterion == "velocity_error" .and. effort%worst > 1.001_dp*tally%worst_error) &
            & text = text//" in the strictest of its conditions"
        end if
      end if
      text = text//"; "//trim(adjustl(mean))//" iterations a solve"
      if (simulation%failed > 0) text = text//"; "//misses_text(simulation)
    end associate
  end function converged_text

  !> Whether solves ended by the velocity error have missed no more than the residual that goes with it.
  pure logical function misses_residual_only(simulation) result(only)
    type(simulation_t), intent(in) :: simulation

    associate (solver => simulation%config%solver, tally => simulation%tally)
      only = solver%criterion == "velocity_error" .and. tally%missed() > 0 .and. tally%worst_error <= solver%accuracy .and. &
        & tally%worst_residual > solver%tolerance
    end associate
  end function misses_residual_only

  !> What may bring the solves that missed their goal to it, by the way in which most of them ended.
  function mending_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (tally => simulation%tally, solver => simulation%config%solver, fallback => simulation%fallback)
      if (simulation%failed == 0) then
        text = "a smaller &solver accuracy: the estimates that end solves are too small in this scene"
      else if (tally%missed() == 0) then
        text = "the solves that missed it were made before the restart"
      else if (misses_residual_only(simulation) .or. (goal_name(simulation) == "tolerance" .and. &
        & tally%worst_error <= solver%accuracy .and. tally%unbounded + tally%diverged == 0)) then
        text = "velocities are within the accuracy "//to_text(solver%accuracy, 3)//": a larger &solver tolerance, now "// &
          & to_text(solver%tolerance, 3)//", if that is enough"
      else if (tally%stagnated > 0 .and. tally%stagnated + tally%exhausted >= max(tally%unbounded, tally%diverged) .and. &
        & .not. allocated(fallback%method) .and. solver%method /= "newton") then
        text = "&solver fallback = 'newton' takes over solves that stagnate"
      else if (tally%stagnated < max(tally%exhausted, tally%unbounded, tally%diverged)) then
        text = "a smaller &time step"
        if (tally%diverged > 0 .and. solver%acceleration == "momentum") text = "&solver acceleration = 'none', or "//text
        if (tally%unbounded > 0) text = text//", or more room: bodies that cannot part are pressed together"
        if (tally%exhausted > max(tally%unbounded, tally%diverged)) text = "a larger &solver max_iterations, now "// &
          & to_text(solver%max_iterations)//", or "//text
      else if (tally%stagnated > fallback%taken - fallback%solved + fallback%passed_over .and. allocated(fallback%method)) then
        text = "a larger &solver fallback_contacts, now "//to_text(solver%fallback_contacts)// &
          & ": Newton's method takes over solves of so many contacts at most"
      else
        text = "contacts that yield (&law kind = 'elastic')"
        ! solves with rolling resistance stagnate with a hundredth of the step, too
        if (.not. simulation%effects%rolling) text = "a smaller &time step, or "//text
      end if
    end associate
  end function mending_text

  !> How many solves spot checks have found wrong.
  function checks_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (checks => simulation%spot_checks)
      text = to_text(checks%beyond)//" of "//counted(checks%reached, "solve")//" that spot checks continued were off by more "// &
        & "than twice the "//goal_text(simulation)//", though all reached it by their estimates"
    end associate
  end function checks_text

  !> Whether solves reached a criterion that does not tell the velocity error, and are not known to be within the accuracy.
  pure logical function is_doubtful(simulation)
    type(simulation_t), intent(in) :: simulation
    is_doubtful = simulation%tally%inaccurate + simulation%tally%unjudged > 0
  end function is_doubtful

  !> How many solves these are, and how far their velocities are from the solution.
  function doubts_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (tally => simulation%tally)
      text = ""
      if (tally%inaccurate > 0) then
        text = to_text(tally%inaccurate)//" of them missed the accuracy "//to_text(simulation%config%solver%accuracy, 2)
        if (tally%worst_error > simulation%config%solver%accuracy) then
          text = text//", with velocities wrong by up to "//plain(tally%worst_error)//" times the velocity scale U"
        else
          text = text//", because single bodies or contacts are farther off than the mean"
        end if
      end if
      if (tally%inaccurate > 0 .and. tally%unjudged > 0) text = text//", and "
      if (tally%unjudged > 0) text = text//to_text(tally%unjudged)// &
        & trim(merge("        ", " of them", tally%inaccurate > 0))//" ended before their velocity error was known"
    end associate
  end function doubts_text

  !> How the solves ended that missed their goal, and in which steps.
  function misses_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (tally => simulation%tally)
      text = ""
      if (simulation%failed > tally%missed()) text = ", "//to_text(simulation%failed - tally%missed())//" missed before the restart"
      call add(tally%stagnated, "stagnated")
      call add(tally%unbounded, "found no solution")
      call add(tally%exhausted, "ended at max_iterations")
      call add(tally%diverged, "diverged")
      if (tally%last_missed > tally%first_missed) then
        text = text//", in steps "//to_text(tally%first_missed)//" to "//to_text(tally%last_missed)
      else if (tally%first_missed > 0) then
        text = text//", in step "//to_text(tally%first_missed)
      end if
    end associate
    text = text_from(text, 3)

  contains

    subroutine add(number, how)
      integer(i8), intent(in) :: number
      character(len=*), intent(in) :: how
      if (number > 0) text = text//", "//to_text(number)//" "//how
    end subroutine add

  end function misses_text

  !> The last words of a run: whether its steps reached the goal, and what would make that less than it seems.
  function verdict_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    character(len=:), allocatable :: steps

    associate (tally => simulation%tally)
      steps = "them"
      if (simulation%restarted) steps = "the "//to_text(tally%steps)//" steps since the restart"
      if (simulation%failed > 0) then
        text = "*** "//to_text(simulation%failed)//" of the steps did NOT reach the "
        if (misses_residual_only(simulation)) then
          text = text//"tolerance of the residual: their velocities are within the accuracy, their impulses may not be"
        else if (knows_misses(simulation)) then
          text = text//goal_name(simulation)//": by the estimates of their errors velocities were wrong by up to "// &
            & plain(tally%worst_error)//" times the velocity scale U"
        else
          text = text//goal_name(simulation)//": the accuracy of the results is not known"
        end if
      else if (simulation%spot_checks%refute()) then
        text = "*** "//checks_text(simulation)
      else if (is_doubtful(simulation)) then
        text = "every solve reached the "//trim(simulation%config%solver%criterion)//" "// &
          & to_text(simulation%config%solver%tolerance, 2)//", but "//doubts_text(simulation)
      else if (simulation%step == 0) then
        text = "no step was made"
      else if (simulation%restarted .and. tally%steps == 0) then
        text = "no step was left to make after step "//to_text(simulation%step)
      else
        text = "all "//to_text(simulation%step)//" steps"
        if (simulation%step == 1) text = "its only step"
        text = text//" reached the "//goal_name(simulation)
        if (goal_name(simulation) /= "accuracy") text = text//" and the accuracy"
      end if
      if (tally%worst_error > far_off .and. .not. (simulation%failed == 0 .and. is_doubtful(simulation)) .and. &
        & .not. knows_misses(simulation)) text = text// &
        & trim(merge(", but", ";    ", simulation%failed == 0))//" velocities were wrong by up to "//plain(tally%worst_error)// &
        & " times the velocity scale U in "//to_text(tally%far_off)//" of "//steps
      if (tally%mended_share() > often_mended) then
        text = text//"; overlaps were projected in "//percent(tally%mended_share())//" of "//steps
        if (tally%shift < little*tally%path) then
          text = text//", by "//plain(100.0_dp*tally%shift/tally%path)//" % of the paths of grains"
          if (tally%shift < negligible*tally%path) text = text//", which is too little to matter"
        else
          text = text//": the results are not those of the contact law"
        end if
      end if
      if (tally%later_overlap > deep*simulation%mean_half_thickness .and. simulation%mean_half_thickness > 0.0_dp) text = text// &
        & "; overlaps came to "//plain(tally%later_overlap/simulation%mean_half_thickness)//" of "//mean_size_name(simulation)
      if (tally%pressed_deep > 0) text = text//"; in "//counted(tally%pressed_deep, "step")// &
        & " bodies were pressed into each other by a quarter of a thickness and more, and may have come out on the other side"
      if (drifts(simulation)) text = text//"; in "//to_text(simulation%drift%steps)//" of the "// &
        & counted(int(simulation%step, i8), "step")// &
        & " bodies moved by no more than the errors of solves, and came "// &
        & plain(simulation%drift%length()/simulation%velocity_scale%diameter)//" mean diameters away: see `drift`"
      if (simulation%fast > 0) text = text//"; "//to_text(simulation%fast)//" times something moved too far for the step"
      if (simulation%fallen%number > 0) text = text//"; "//counted(simulation%fallen%number, "grain")// &
        & " had fallen below all boundaries"
      text = text//inflow_doubt(simulation)
      if (simulation%restarted .and. tally%steps > 0) text = text//"; errors and overlaps are those since the restart"
    end associate
  end function verdict_text

  !> Whether solves missed the accuracy alone, and by no more than half of U: larger estimates tell no size.
  pure logical function knows_misses(simulation) result(knows)
    type(simulation_t), intent(in) :: simulation

    associate (tally => simulation%tally)
      knows = simulation%failed > 0 .and. simulation%config%solver%criterion == "velocity_error" .and. &
        & simulation%failed == tally%missed() .and. tally%unbounded + tally%diverged == 0 .and. &
        & tally%worst_error > simulation%config%solver%accuracy .and. tally%worst_error <= far_off
    end associate
  end function knows_misses

  !> Whether a looser goal or a longer step may be advised: not where results are too loose already.
  logical function may_loosen(simulation) result(may)
    type(simulation_t), intent(in) :: simulation

    associate (tally => simulation%tally, solver => simulation%config%solver)
      may = simulation%failed == 0 .and. .not. tally%mended_share() > often_mended .and. .not. overlaps_grew(simulation) .and. &
        & .not. drifts(simulation) .and. simulation%refinement%refined == 0
      if (goal_name(simulation) == "accuracy") then
        may = may .and. 10.0_dp*solver%accuracy <= loosest*(1.0_dp + epsilon(1.0_dp))
      else
        ! errors of ten times the tolerance are ten times as large, at least
        may = may .and. 10.0_dp*tally%worst_error <= loosest .and. .not. is_doubtful(simulation)
      end if
    end associate
  end function may_loosen

  !> Whether overlaps have grown beyond what is allowed, and mending them shifts grains by more than a little of their paths; where
  !> they are not projected, beyond a hundredth of the mean radius, or of half of the mean thickness.
  pure logical function overlaps_grew(simulation) result(grew)
    type(simulation_t), intent(in) :: simulation

    associate (tally => simulation%tally)
      if (simulation%overlap_allowed < huge(1.0_dp)) then
        grew = tally%overlaps_grew(simulation%overlap_allowed) .and. .not. tally%shift < little*tally%path
      else
        grew = tally%overlaps_grew(0.01_dp*simulation%mean_half_thickness)
      end if
    end associate
  end function overlaps_grew

  !> The dearest phases.
  function time_text(phases, seconds, steps) result(text)
    !> (n_phases), mean over the ranks [s]
    real(dp), intent(in) :: phases(n_phases)
    !> of the whole run [s]
    real(dp), intent(in) :: seconds
    integer(i8), intent(in) :: steps
    character(len=:), allocatable :: text
    logical :: told(n_phases)
    real(dp) :: mean, share
    character(len=16) :: row
    integer :: k, p

    text = duration_text(seconds)
    mean = seconds/real(max(steps, 1_i8), dp)
    if (mean < 1.0_dp) then
      write (row, "(f8.1)") 1000.0_dp*mean
      text = text//", "//trim(adjustl(row))//" ms a step"
    else
      text = text//", "//duration_text(mean)//" a step"
    end if
    told(:) = .false.
    do k = 1, named
      p = maxloc(phases, dim=1, mask=.not. told)
      share = 100.0_dp*phases(p)/max(seconds, tiny(seconds))
      if (share < least_share) exit
      told(p) = .true.
      text = text//trim(merge(": ", ", ", k == 1))//" "//trim(phase_names(p))//" "//to_text(nint(share))//" %"
    end do
  end function time_text

  !> What would halve the time of the run, as far as its own figures tell. What is too loose is never advised to be looser.
  function halving_text(simulation, phases, seconds, looser_seconds, slowest) result(text)
    type(simulation_t), intent(in) :: simulation
    !> (n_phases), mean over the ranks [s]
    real(dp), intent(in) :: phases(n_phases)
    !> of the whole run [s]
    real(dp), intent(in) :: seconds
    !> of its solves with ten times the goal: expected, at least and at most (negative: not known) [s]
    real(dp), intent(in) :: looser_seconds(3)
    !> seconds of sweeps of the slowest rank over the mean
    real(dp), intent(in) :: slowest
    character(len=:), allocatable :: text, balancing
    type(method_features_t) :: features
    real(dp) :: half, shared, lost, rest

    half = 0.5_dp*seconds
    balancing = balancing_text(simulation%config%decomposition, (slowest - 1.0_dp)*phases(phase_sweep)/max(seconds, tiny(seconds)))
    shared = phases(phase_exchange) + phases(phase_factorise) + phases(phase_interface_solve) + phases(phase_reduction) + &
      & phases(phase_interface)
    associate (effort => simulation%effort, config => simulation%config)
      lost = real(effort%iterations - effort%reached(at_tolerance), dp)/real(max(effort%iterations, 1_i8), dp)
      rest = seconds - effort%seconds
      if (simulation%comm%size > simulation%decomposition%n_subdomains) then
        text = to_text(simulation%comm%size - simulation%decomposition%n_subdomains)//" of "// &
          & to_text(simulation%comm%size)//" ranks own no subdomain and wait: choose as many &decomposition "// &
          & "subdomains as ranks, now "//to_text(simulation%decomposition%n_subdomains)//", or fewer ranks"
      else if (balancing /= "") then
        text = balancing
      else if (phases(phase_output) > half .and. config%output%every > 0 .and. config%output%every < config%time%steps) then
        text = "output takes most of the time: a larger &output every, now "//to_text(config%output%every)
      else if (phases(phase_diagnostics) > half) then
        text = "diagnostics take most of the time: fewer groups &region or keys of &output that add columns to history.csv"
      else if (effort%unreached(at_tolerance) > 0 .and. lost > 0.5_dp) then
        text = "solves that do not converge take most of the iterations: see `to mend it`"
        ! beside sleepers they were solved anew
        if (simulation%failed == 0) text = "solves beside bodies that sleep, which fail and are solved anew with all awake, "// &
          & "take most of the iterations: a larger &solver sleep_after, now "//to_text(config%solver%sleep_after)
      else if (overlaps_grew(simulation)) then
        text = "nothing yet: overlaps grow; first choose a smaller &time step or &solver "//goal_name(simulation)
      else if (may_loosen(simulation) .and. looser_seconds(1) >= 0.0_dp .and. rest + looser_seconds(1) <= half) then
        text = goal_text(simulation, 10.0_dp)//", which is looser: "//duration_text(rest + looser_seconds(2))//" to "// &
          & duration_text(rest + looser_seconds(3))//" in all (estimated)"
      else if (may_accelerate(simulation) .and. phases(phase_sweep) + phases(phase_check) + phases(phase_exchange) > half) then
        text = "plain iterations take most of it, "//to_text(nint(real(effort%iterations, dp)/real(effort%solves, dp)))// &
          & " a solve: &solver acceleration = 'momentum' takes fewer"
      else if (phases(phase_factorise) + phases(phase_interface_solve) > half .and. simulation%fallback%taken > 0 .and. &
        & .not. simulation%physics%laws%yields) then
        text = "Newton's method, which takes over solves that stagnate, takes most of it: contacts that yield "// &
          & "(&law kind = 'elastic') may stagnate less"
      else if (shared > half .and. simulation%decomposition%n_subdomains > 1) then
        text = "the interface takes most of it: fewer &decomposition subdomains, now "// &
          & to_text(simulation%decomposition%n_subdomains)//", on fewer ranks"
      else if (phases(phase_neighbourhood) > half) then
        text = "neighbour lists take most of it: "//skin_text(simulation)
      else if (phases(phase_neighbourhood) > much*seconds .and. 2*simulation%halo%builds > simulation%tally%steps) then
        text = "no change of one key suffices; neighbour lists, built in "//to_text(simulation%halo%builds)//" of "// &
          & counted(simulation%tally%steps, "step")//", take "//percent(phases(phase_neighbourhood)/seconds)//": "// &
          & skin_text(simulation)
      else if (contacts_of(simulation) >= contacts_a_rank) then
        text = "twice the ranks, now "//to_text(simulation%comm%size)//", with as many &decomposition subdomains or more, now "// &
          & to_text(simulation%decomposition%n_subdomains)
        features = features_of(trim(config%solver%method))
        if (.not. features%decomposes) text = text//", by a &solver method that has subdomains, such as 'nscdd'"
      else if (may_loosen(simulation)) then
        text = "no change of one key suffices; a longer &time step makes fewer steps, at the price of accuracy"
      else
        text = "no change of one key suffices without making the results worse"
      end if
    end associate
  end function halving_text

  !> What lets neighbour lists last longer.
  function skin_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = "a larger &scene skin, now "//to_text(simulation%decomposition%rule%skin, 3)//" m, lets them last longer"
  end function skin_text

  !> What evens out the work of the ranks where they wait for the slowest one; empty where they hardly wait, or nothing is known to.
  pure function balancing_text(config, waiting) result(text)
    type(decomposition_config_t), intent(in) :: config
    !> of the run that a rank waits in the mean
    real(dp), intent(in) :: waiting
    character(len=:), allocatable :: text
    logical :: by_graph, again

    by_graph = config%partition == "metis"
    again = config%repartition_imbalance > 0.0_dp
    text = ""
    if (.not. waiting > long_wait .or. (by_graph .and. again)) return
    text = "ranks wait for the one with most sweeps to make, in "//to_text(nint(100.0_dp*waiting))// &
      & " % of the time: &decomposition "
    if (.not. by_graph) text = text//"partition = 'metis'"
    if (.not. (by_graph .or. again)) text = text//" and "
    if (.not. again) text = text//"repartition_imbalance = 1.2"
    text = text//" divides the contacts more evenly"
  end function balancing_text

  !> Whether plain iterations are many and may be accelerated.
  logical function may_accelerate(simulation) result(may)
    type(simulation_t), intent(in) :: simulation
    type(method_features_t) :: features

    associate (solver => simulation%config%solver, effort => simulation%effort)
      features = features_of(trim(solver%method))
      may = features%accelerated_by_default == default_always .or. (features%relaxes .and. .not. solver%relaxation_given)
      may = may .and. solver%acceleration == "none" .and. simulation%tally%diverged == 0 .and. &
        & effort%iterations >= many_iterations*effort%solves
    end associate
  end function may_accelerate

  !> Contacts of all subdomains of this rank.
  pure integer(i8) function contacts_of(simulation) result(contacts)
    type(simulation_t), intent(in) :: simulation
    integer :: s

    contacts = 0
    if (.not. allocated(simulation%problem%sub)) return
    do s = 1, size(simulation%problem%sub)
      contacts = contacts + simulation%problem%sub(s)%n_contacts
    end do
  end function contacts_of

end module gravier_run_summary
