!> The algorithm of a time step: what it takes to make one step after the other, without output. `advance` is the step.
module gravier_time_stepper
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: start_timer, stop_timer, phase_bodies, phase_neighbourhood, phase_setup
  use gravier_time_table, only: time_table_t
  use gravier_effects, only: effects_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_convergence_history, only: effort_t
  use gravier_backoff, only: backoff_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_watch_t, exact_solution_t, solve_converged, solve_diverged
  use gravier_fallback, only: fallback_t
  use gravier_refinement, only: refinement_t
  use gravier_decomposition, only: decomposition_t
  use gravier_removal, only: some_leave, remove_grains, drop_grains
  use gravier_inflow, only: inflow_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_repartition, only: repartition_rule_t, repartition, repartition_is_due
  use gravier_physics, only: physics_t
  use gravier_load_areas, only: find_load_areas
  use gravier_problem_builder, only: build_problem
  use gravier_pair_laws, only: conclude_pairs, bonds_at_limit
  use gravier_contact_springs, only: conclude_springs, measure_springs
  use gravier_velocity_scale, only: velocity_scale_t
  use gravier_drift, only: drift_t
  use gravier_body_motion, only: move_to_middle, drive, move_to_end
  use gravier_fast_grains, only: count_fast
  use gravier_velocity_return, only: take_velocities
  use gravier_boundary_loads, only: sum_boundary_impulses, take_boundary_velocities
  use gravier_cell_drive, only: cell_drive_t, take_cell
  use gravier_cell_response, only: start_response
  use gravier_overlap_projection, only: project_overlaps
  use gravier_sleeping, only: sleeping_rule_t, count_rest
  use gravier_borne_impulses, only: take_back
  use gravier_waking, only: resting_t, watch_step, watch_awake, wake_disturbed, wake_left_behind, wake_all
  use gravier_whole_problem, only: build_whole, make_whole, take_whole
  use gravier_impulse_memory, only: keep_impulses, recall_impulses
  use gravier_memory_carrying, only: carry_memory
  use gravier_given_contacts, only: given_contacts_t
  use gravier_given_impulses, only: take_given_impulses
  use gravier_schedule, only: schedule_t
  use gravier_diagnostic, only: solved_step_t
  use gravier_diagnostics, only: diagnostics_t
  use gravier_grain_balance, only: grain_balance_t
  use gravier_failed_contact, only: find_cause
  use gravier_spot_checks, only: spot_checks_t
  use gravier_step_figures, only: step_figures_t
  use gravier_run_tally, only: run_tally_t
  use gravier_population, only: population_t
  implicit none
  private
  public :: time_stepper_t

  !> shifts of all grains by a projection, over the overlap allowed, that are rounding: grains that a projection has left at the
  !> overlap allowed are projected again where it is exceeded by rounding
  real(dp), parameter :: rounded_shift = 1.0e-6_dp

  integer, parameter :: most_tries = 4 ! times that a step is solved anew with more bodies awake before all wake

  type :: time_stepper_t
    type(communicator_t), pointer :: comm => null()
    ! ---- what moves, and what acts on it
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(physics_t) :: physics
    type(effects_t) :: effects ! that the scene has
    type(time_table_t) :: gravity_table
    !> what moves the periodic cell
    type(cell_drive_t) :: cell_drive
    ! ---- how a step is made
    !> solves start from the impulses of the step before
    logical :: warm_start = .true.
    !> contacts that the first solve starts from, where the bodies file has some; none afterwards
    type(given_contacts_t) :: given
    !> overlap beyond which places are projected, and what a projection leaves of it; huge where that is off [m]
    real(dp) :: overlap_allowed = huge(1.0_dp), overlap_left = huge(1.0_dp)
    type(sleeping_rule_t) :: sleeping
    type(repartition_rule_t) :: division
    type(inflow_t) :: inflow ! grains that enter
    class(method_t), allocatable :: method
    type(fallback_t) :: fallback
    type(refinement_t) :: refinement ! of solves that aim at less error than the goal
    type(solve_control_t) :: control
    !> whether solves may try a pass over layers
    type(backoff_t) :: pass_backoff
    !> what the last solve tells the next one about when to check
    real(dp) :: figure_ratio = 0.0_dp
    class(exact_solution_t), allocatable :: exact ! where it is known
    ! ---- the present step
    !> what is solved; where it is shown, after the step, of all contacts
    type(contact_problem_t) :: problem
    !> what sleeps, and is left out of the problem that is solved; whether the problem has all contacts
    type(resting_t) :: resting
    logical :: is_whole = .true.
    !> velocity against which errors of the solve of the present step are compared
    type(velocity_scale_t) :: velocity_scale
    !> impulse of the contacts of the last step on each boundary (nd, boundaries) [N s]
    real(dp), allocatable :: boundary_impulses(:, :)
    integer :: step = 0
    real(dp) :: time = 0.0_dp ! [s]
    !> grains of the scene now, and those of them that are glued to boundaries
    integer(i8) :: n_grains = 0, n_glued = 0
    !> mass of the free grains of the scene now, and of those that have left [kg]
    real(dp) :: mass = 0.0_dp, left_mass = 0.0_dp
    !> velocities of grains were set since the last step
    logical :: velocities_set = .false.
    type(population_t) :: population ! how many grains there were, at least and at most
    !> largest over mean number of contacts of a subdomain in the last step
    real(dp) :: imbalance = 1.0_dp
    !> the same just after space was last divided in a step; 0 before
    real(dp) :: reached_imbalance = 0.0_dp
    real(dp) :: largest_overlap = 0.0_dp ! of the last step [m]
    ! ---- what is noted
    !> figures that the user asked for, and the steps whose states are written, which some of them wait for
    type(diagnostics_t) :: diagnostics
    type(schedule_t) :: written_steps
    integer :: dumped_step = 0 ! the step whose problem is written, 0: none
    !> energies of the grains since this run began or went on from a checkpoint
    type(grain_balance_t) :: balance
    !> messages between ranks, and numbers in them, that iterations of this rank have sent
    integer(i8) :: messages = 0, values = 0
    !> over all steps: solves that missed their tolerance, grains that left by outlets, grains too fast for the step
    integer(i8) :: failed = 0, left = 0, fast = 0
    !> steps, the last ones, in which the kinetic energy of the grains was at most `rest_energy` [J] and no grain was to enter
    integer :: quiet = 0
    real(dp) :: rest_energy = 0.0_dp
    !> motion that is not told from errors of solves
    type(drift_t) :: drift
    type(spot_checks_t) :: spot_checks
    !> since this run began or went on from a checkpoint: what solves took
    type(effort_t) :: effort
    !> how solves ended and what was mended, since this run began or went on from a checkpoint
    type(run_tally_t) :: tally
  contains
    procedure :: assemble => time_stepper_assemble
    procedure :: advance => time_stepper_advance
    procedure :: take_forces => time_stepper_take_forces
    procedure :: wake => time_stepper_wake
    procedure :: make_whole => time_stepper_make_whole
    procedure :: free => time_stepper_free
  end type time_stepper_t

contains

  !> One step. After a solve that diverged, velocities and places are not those of any step: the run must end. Collective.
  subroutine time_stepper_advance(self, figures, error, watch)
    class(time_stepper_t), target, intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    type(error_t), allocatable, intent(inout) :: error
    !> is told how the solve goes on
    class(solve_watch_t), intent(inout), optional :: watch
    type(contact_problem_t), target :: whole
    type(solved_step_t) :: solved
    real(dp) :: shifts

    if (allocated(error)) return
    call self%assemble(figures)
    call solve(self, figures, error, watch)
    if (.not. (self%refinement%aims .or. self%refinement%is_fine)) call self%spot_checks%look(self%decomposition, &
      & self%problem, self%method, self%control, figures%solve, error)
    call note_solve(self, figures, error)
    if (allocated(error) .or. figures%solve%status == solve_diverged) return
    call start_timer(phase_bodies)
    call take_solution(self, figures, whole)
    if (allocated(whole%sub)) call sum_boundary_impulses(self%decomposition, whole, self%boundary_impulses)
    solved = solved_step_of(self, figures)
    call self%balance%take_step(solved)
    if (allocated(whole%sub)) solved%problem => whole
    call self%diagnostics%take_step(solved)
    self%velocities_set = .false.
    call move_to_end(self%decomposition, self%physics, self%physics%theta, self%n_glued > 0)
    call stop_timer(phase_bodies)
    figures%projected = figures%max_overlap > self%overlap_allowed
    shifts = 0.0_dp
    if (figures%projected) call project_overlaps(self%decomposition, self%problem, self%physics%h, self%overlap_left, shifts)
    call note_step(self, figures, shifts)
    call self%diagnostics%measure(solved, self%written_steps%due(self%step))
    call figures%check_numbers(self%decomposition, self%diagnostics, self%step, error)
    if (allocated(whole%sub)) call take_whole(whole, self%problem, self%is_whole)
  end subroutine time_stepper_advance

  !> Solve the contact problem, anew as long as it wakes bodies. A problem beside sleepers may have no solution, as where three of
  !> them hold a body that rebounds from one: all wake where none is found, without a try of the second method. Collective.
  subroutine solve(self, figures, error, watch)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    type(error_t), allocatable, intent(inout) :: error
    class(solve_watch_t), intent(inout), optional :: watch
    type(solve_control_t) :: control
    real(dp) :: seconds
    integer :: tries, iterations
    logical :: woken

    control = self%control
    iterations = 0
    seconds = 0.0_dp
    control%figure_ratio = self%figure_ratio
    ! a pass over layers would replace the impulses that were given
    control%layered = control%layered .and. figures%started%matched == 0 .and. self%pass_backoff%allows(self%step)
    do tries = 1, most_tries + 1
      call self%refinement%decide(self%problem, control, self%drift%goal_share(self%velocity_scale))
      if (self%refinement%aims) then
        call self%refinement%solve(self%problem, self%method, control, figures%solve, error, watch)
      else
        call solve_contacts(self%problem, self%method, control, figures%solve, error, self%exact, watch)
      end if
      if (self%physics%laws%breaks .and. .not. (allocated(error) .or. self%velocity_scale%moves())) then
        if (bonds_at_limit(self%problem, self%decomposition%boundaries, self%physics%laws, self%halo%view)) &
          & call self%refinement%settle(self%problem, self%method, control, figures%solve, error, watch)
      end if
      if (self%resting%bodies == 0) call self%fallback%take_over(self%problem, control, figures%solve, error, self%exact, watch)
      self%messages = self%messages + self%problem%shared%messages
      self%values = self%values + self%problem%shared%values
      if (allocated(error) .or. figures%solve%status == solve_diverged) return
      call self%effort%add(figures%solve%history, figures%solve%iterations, figures%solve%figure, figures%solve%seconds, &
        & figures%solve%start_seconds)
      figures%solve%iterations = figures%solve%iterations + iterations
      figures%solve%seconds = figures%solve%seconds + seconds
      if (self%resting%bodies == 0) return
      if (figures%solve%status == solve_converged) then
        call wake_disturbed(self%decomposition, self%halo, self%physics, self%problem, 2**(tries - 1), woken)
        if (.not. woken) return
      end if
      if (figures%solve%status /= solve_converged .or. tries == most_tries) then
        call wake_all(self%decomposition)
        call self%halo%refresh(self%decomposition)
      end if
      figures%tries = tries + 1
      iterations = figures%solve%iterations
      seconds = figures%solve%seconds
      if (self%warm_start) call keep_impulses(self%problem, self%halo%view)
      call watch_awake(self%decomposition, self%halo, self%resting)
      call set_up(self, figures)
    end do
  end subroutine solve

  !> Move grains and boundaries to q_m, bring the neighbour lists up to date, find the contacts and start them from the
  !> impulses of the last step. Collective.
  subroutine time_stepper_assemble(self, figures)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    logical :: listed, changed

    call start_timer(phase_bodies)
    self%physics%first = self%step == 0
    call move_to_middle(self%decomposition, self%physics, self%physics%theta, self%time, self%n_glued > 0, listed)
    call drive(self%decomposition, self%physics, self%gravity_table, self%time, changed)
    if (self%sleeping%after > 0 .and. (listed .or. changed)) call wake_all(self%decomposition)
    if (self%inflow%is_due()) call let_in(self, figures, listed)
    figures%fast = count_fast(self%decomposition, self%physics)
    call stop_timer(phase_bodies)
    call start_timer(phase_neighbourhood)
    if (.not. listed) listed = self%halo%are_due(self%decomposition)
    figures%divided = repartition_is_due(self%division, self%step, self%imbalance, self%reached_imbalance)
    figures%listed = listed .or. figures%divided
    call list_neighbours(self, figures)
    if (self%sleeping%after > 0) call watch_step(self%sleeping, self%step + 1, self%decomposition, self%halo, self%resting)
    call stop_timer(phase_neighbourhood)
    call set_up(self, figures)
    if (figures%divided) then
      self%reached_imbalance = self%imbalance
      call self%method%measure_balance(self%comm, self%decomposition%n_subdomains, figures%rank_balance, figures%subdomain_balance)
      call self%method%forget_times()
    end if
  end subroutine time_stepper_assemble

  !> Find the contacts and start them from the impulses of the last step. Collective.
  subroutine set_up(self, figures)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    real(dp) :: area(size(self%decomposition%boundaries))
    integer :: s

    call self%cell_drive%begin_step(self%decomposition%period, self%decomposition%nd, self%mass, self%physics%h, &
      & self%time + self%physics%h, self%physics%cell)
    call build_problem(self%decomposition, self%halo, self%problem%kernels, self%physics, self%problem, &
      & figures%interface_statistics)
    call start_timer(phase_setup)
    if (self%given%total > 0) then
      call take_given_impulses(self%given, self%decomposition, self%physics, self%problem, self%halo%view, figures%started)
      self%given = given_contacts_t()
    end if
    if (self%warm_start) call recall_impulses(self%halo%view, self%problem)
    if (self%resting%bodies > 0) call take_back(self%problem, self%halo%view, self%decomposition)
    if (self%problem%cell_moves()) call start_response(self%problem)
    call stop_timer(phase_setup)
    self%problem%load(:) = self%physics%h*self%physics%gravity
    figures%contacts = self%problem%n_contacts + self%resting%contacts
    figures%asleep = self%resting%contacts
    self%is_whole = self%resting%bodies == 0
    figures%max_overlap = 0.0_dp
    do s = 1, size(self%problem%sub)
      figures%max_overlap = max(figures%max_overlap, self%problem%sub(s)%overlap(yielding=.false.))
    end do
    figures%max_overlap = self%comm%highest(figures%max_overlap)
    if (self%physics%laws%yields) call measure_springs(self%problem, self%tally%deformation, self%tally%stiffest)
    call figures%deep%find(self%decomposition, self%halo, self%problem, self%tally%deformation)
    self%largest_overlap = figures%max_overlap
    if (figures%contacts > 0) self%imbalance = real(figures%interface_statistics%most_contacts, dp) &
      & *self%decomposition%n_subdomains/real(figures%contacts, dp)
    call start_timer(phase_setup)
    call find_load_areas(self%decomposition, area)
    call self%velocity_scale%measure(self%decomposition, self%physics, self%problem, self%time + self%physics%h, area)
    call stop_timer(phase_setup)
  end subroutine set_up

  !> Give all grains an applied force, of 0. The same on every rank, between two steps.
  subroutine time_stepper_take_forces(self)
    class(time_stepper_t), intent(inout) :: self

    call self%decomposition%take_forces()
    call self%halo%take_forces()
  end subroutine time_stepper_take_forces

  !> Wake the bodies that sleep: what acts on the scene has changed.
  subroutine time_stepper_wake(self)
    class(time_stepper_t), intent(inout) :: self

    if (self%sleeping%after > 0) call wake_all(self%decomposition)
  end subroutine time_stepper_wake

  !> After a step, bring the contacts back into the problem that it has left out, for whoever looks at all of them. Collective.
  subroutine time_stepper_make_whole(self)
    class(time_stepper_t), intent(inout) :: self

    if (self%is_whole) return
    call make_whole(self%decomposition, self%halo, self%physics, self%boundary_impulses, self%problem, self%is_whole)
  end subroutine time_stepper_make_whole

  !> Let grains enter, for which lists are made anew. Collective.
  subroutine let_in(self, figures, listed)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    logical, intent(inout) :: listed

    figures%entered = self%inflow%entered()
    figures%entered_mass = self%inflow%mass()
    call self%inflow%enter(self%decomposition, self%time, self%physics%h)
    figures%entered = self%inflow%entered() - figures%entered
    figures%entered_mass = self%inflow%mass() - figures%entered_mass
    self%n_grains = self%n_grains + figures%entered
    listed = listed .or. figures%entered > 0
  end subroutine let_in

  !> From the impulses of a solve to velocities of grains and boundaries, and to what the next step starts from. Collective.
  subroutine take_solution(self, figures, whole)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(in) :: figures
    !> the problem of all contacts, where it is shown and differs from the one that was solved; empty otherwise
    type(contact_problem_t), intent(inout) :: whole
    logical :: doubtful

    if (self%problem%cell_moves()) then
      call take_cell(self%problem, self%decomposition%period)
      self%physics%cell = self%problem%cell
    end if
    if (self%sleeping%after > 0) call count_rest(self%sleeping, figures%tries == 1, self%halo%view, self%problem, &
      & self%decomposition)
    if (self%warm_start) call keep_impulses(self%problem, self%halo%view)
    if (.not. self%is_whole .and. (self%diagnostics%in_each_step() .or. self%written_steps%due(self%step + 1) .or. &
      & self%step + 1 == self%dumped_step)) call build_whole(self%decomposition, self%halo, self%physics, self%problem, whole)
    if (self%physics%laws%yields) call conclude_springs(self%problem, self%physics%h, self%halo%view)
    if (self%physics%laws%remembers) call conclude_pairs(self%problem, self%decomposition%boundaries, self%physics%laws, &
      & self%refinement%doubt(figures%uncertain_velocity(self%velocity_scale%bonds), &
      & self%control%accuracy*self%velocity_scale%value), self%velocity_scale%moves(), self%halo%view, doubtful)
    if (self%physics%laws%breaks) call self%refinement%note_bonds(doubtful, self%velocity_scale%moves() .or. &
      & self%method%keeps_best, min(figures%solve%velocity_error, figures%solve%velocity_scale))
    call take_velocities(self%decomposition, self%physics, self%problem)
    call sum_boundary_impulses(self%decomposition, self%problem, self%boundary_impulses)
    call take_boundary_velocities(self%decomposition, self%boundary_impulses)
  end subroutine take_solution

  !> What diagnostics see of a step: it lives as long as the stepper.
  type(solved_step_t) function solved_step_of(self, figures) result(solved)
    class(time_stepper_t), target, intent(in) :: self
    type(step_figures_t), intent(in) :: figures

    solved%decomposition => self%decomposition
    solved%halo => self%halo
    solved%physics => self%physics
    solved%problem => self%problem
    solved%boundary_impulses => self%boundary_impulses
    solved%time = self%time
    solved%n_free = self%n_grains - self%n_glued
    solved%others = figures%left > 0 .or. figures%entered > 0 .or. self%velocities_set
  end function solved_step_of

  !> Note how a solve ended, and the contact where it failed. Collective.
  subroutine note_solve(self, figures, error)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    type(error_t), allocatable, intent(in) :: error

    if (allocated(error)) return
    associate (solve => figures%solve)
      if (solve%status /= solve_converged) self%failed = self%failed + 1
      call self%tally%add_solve(solve, self%velocity_scale%kind, self%step + 1)
      self%figure_ratio = solve%figure_ratio
      call self%pass_backoff%note(self%step, tried=solve%layered_sweeps > 0.0_dp, kept=solve%layered)
      call find_cause(self%problem, solve%status, figures%cause)
    end associate
  end subroutine note_solve

  !> Note what a step has done, and count it. Collective.
  subroutine note_step(self, figures, shifts)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    !> sum of the lengths by which grains were shifted [m]
    real(dp), intent(in) :: shifts
    real(dp) :: free_grains

    free_grains = real(max(self%n_grains - self%n_glued, 1_i8), dp)
    call self%tally%add_step(figures%max_overlap, figures%interface_statistics, shifts/self%overlap_allowed > rounded_shift, &
      & shifts/free_grains, self%physics%h*self%balance%speeds/free_grains, figures%deep%number)
    call self%drift%note(self%decomposition, self%physics, self%boundary_impulses, self%mass, self%velocity_scale, figures%solve)
    self%step = self%step + 1
    self%time = self%step*self%physics%h
    figures%kinetic_energy = self%balance%kinetic
    self%quiet = merge(self%quiet + 1, 0, self%balance%moving <= self%rest_energy .and. figures%entered == 0 .and. &
      & .not. self%inflow%awaits(self%time))
    call self%population%note(self%n_grains - self%n_glued, self%mass)
    self%left = self%left + figures%left
    self%fast = self%fast + figures%fast
    self%tally%slept = self%tally%slept + figures%asleep
    self%tally%woken = self%tally%woken + figures%tries - 1
  end subroutine note_step

  !> Bring views and lists up to date, without the grains that leave, or make them anew with the impulses carried over. Collective.
  subroutine list_neighbours(self, figures)
    class(time_stepper_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    type(local_bodies_t), allocatable :: before(:)
    integer(i8) :: n_glued
    logical :: remembered

    if (self%halo%builds > 0) call self%halo%refresh(self%decomposition)
    if (self%halo%builds > 0 .and. self%sleeping%after > 0) call wake_left_behind(self%decomposition, self%halo)
    if (.not. figures%listed) then
      if (.not. some_leave(self%decomposition)) return
      call drop_grains(self%decomposition, self%halo)
    end if
    call remove_grains(self%decomposition, self%n_glued > 0, figures%left, n_glued, figures%left_mass)
    self%left_mass = self%left_mass + figures%left_mass
    if (figures%left > 0 .or. figures%entered > 0) self%mass = self%decomposition%free_mass()
    self%n_grains = self%n_grains - figures%left - n_glued
    self%n_glued = self%n_glued - n_glued
    if (.not. figures%listed) return
    remembered = self%halo%memory%words() > 0 .and. self%halo%builds > 0
    ! the problem of the last step is built anew below: its memory is free for the lists
    if (allocated(self%problem%sub)) deallocate (self%problem%sub)
    if (figures%divided) call repartition(self%division, self%halo, self%decomposition, figures%refusal)
    call self%decomposition%migrate()
    if (remembered) call move_alloc(self%halo%view, before)
    call self%halo%build(self%decomposition)
    if (remembered) call carry_memory(self%decomposition, before, self%halo)
  end subroutine list_neighbours

  !> Give back what the method holds, and go back to step 0.
  subroutine time_stepper_free(self)
    class(time_stepper_t), intent(inout) :: self

    if (allocated(self%method)) then
      call self%method%free()
      deallocate (self%method)
    end if
    call self%fallback%free()
    call self%problem%shared%free()
    if (allocated(self%exact)) deallocate (self%exact)
    if (allocated(self%boundary_impulses)) deallocate (self%boundary_impulses)
    if (allocated(self%halo%view)) deallocate (self%halo%view)
    self%given = given_contacts_t()
    self%halo%builds = 0
    self%step = 0
    self%time = 0.0_dp
    self%messages = 0
    self%values = 0
    self%failed = 0
    self%left = 0
    self%left_mass = 0.0_dp
    self%population = population_t()
    self%pass_backoff = backoff_t()
    self%figure_ratio = 0.0_dp
    self%fast = 0
    self%quiet = 0
    self%velocities_set = .false.
    self%resting = resting_t()
    self%is_whole = .true.
    self%drift = drift_t()
    self%spot_checks = spot_checks_t()
    self%refinement = refinement_t()
    self%effort = effort_t()
    self%tally = run_tally_t()
    self%imbalance = 1.0_dp
    self%reached_imbalance = 0.0_dp
  end subroutine time_stepper_free

end module gravier_time_stepper
