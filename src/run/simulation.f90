!> A scene in time: what it takes to make one step after the other, without output.
module gravier_simulation
  use gravier_kinds, only: dp, i8
  use gravier_heap, only: keep_heap
  use gravier_errors, only: error_t, raise, status_input, status_unconverged, status_failure
  use gravier_text, only: to_text
  use gravier_finite, only: is_finite, has_finite_square
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: start_timer, stop_timer, phase_bodies, phase_neighbourhood, phase_setup
  use gravier_time_table, only: time_table_t
  use gravier_motion, only: predict_position, advance_position
  use gravier_boundary, only: shape_plane, shape_segment, shape_rectangle
  use gravier_facing_planes, only: find_facing_planes
  use gravier_neighbour_search, only: rule_dual, rule_primal
  use gravier_effects, only: effects_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_scheme, only: scheme_t
  use gravier_descent, only: effort_t
  use gravier_run_tally, only: run_tally_t
  use gravier_solve, only: solve_control_t, solve_report_t, solve_watch_t, solve_contacts, solve_converged, solve_diverged, &
    & solve_unbounded, by_velocity, by_residual, by_error
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  use gravier_departures, only: some_leave, let_grains_out
  use gravier_neighbourhood, only: neighbourhoods_t
  use gravier_physics, only: physics_t
  use gravier_interface, only: interface_figures_t
  use gravier_problem_builder, only: build_problem
  use gravier_velocity_scale, only: velocity_scale_t
  use gravier_velocity_return, only: take_velocities
  use gravier_boundary_loads, only: sum_boundary_impulses, take_boundary_velocities, carry_glued, set_glued_velocities
  use gravier_overlap_projection, only: project_overlaps
  use gravier_diagnostics, only: diagnostics_t
  use gravier_grain_balance, only: grain_balance_t
  use gravier_sleeping, only: sleeping_rule_t, count_rest, wake_all
  use gravier_pair_laws, only: conclude_pairs
  use gravier_impulse_memory, only: memory_of, keep_impulses, recall_impulses, gather_impulses, spread_impulses
  use gravier_config_types, only: config_t
  use gravier_scene, only: scene_t, make_scene
  use gravier_scene_period, only: check_in_period
  use gravier_scheme_choice, only: choose_scheme
  use gravier_division, only: divide, divide_again, division_is_due
  use gravier_column_solution, only: column_solution_t
  implicit none
  private
  public :: simulation_t, step_figures_t

  !> shifts of all grains by a projection, over the overlap allowed, that are rounding: grains that a projection has left at the
  !> overlap allowed are projected again where it is exceeded by rounding
  real(dp), parameter :: rounded_shift = 1.0e-6_dp

  !> Figures of a step, the same on every rank.
  type :: step_figures_t
    type(solve_report_t) :: solve
    type(interface_figures_t) :: sharing
    integer(i8) :: contacts = 0
    !> grains that left by an outlet; grains that move by more than their radius in a step
    integer(i8) :: left = 0, fast = 0
    !> the neighbour lists were made anew; space was divided anew, or should have been but the scene fills too few cells
    logical :: listed = .false., divided = .false., refused = .false.
    !> seconds in sweeps since the partition before this one, the most over the mean, of the ranks and of the subdomains; where
    !> space was divided anew
    real(dp) :: rank_balance = 1.0_dp, subdomain_balance = 1.0_dp
    !> contacts that slept at the start of the solve; where they can
    integer(i8) :: asleep = 0
    !> places were projected, because some overlap exceeded what is allowed
    logical :: projected = .false.
    !> [m], 0 where nothing overlaps; [J]
    real(dp) :: max_overlap = 0.0_dp, kinetic_energy = 0.0_dp
    !> after a solve that diverged to NaN or infinity: a contact where it did; after one whose impulses grow without bound: the
    !> contact with the largest
    character(len=:), allocatable :: cause
  end type step_figures_t

  type :: simulation_t
    type(config_t) :: config
    type(communicator_t), pointer :: comm => null()
    type(decomposition_t) :: decomposition
    type(neighbourhoods_t) :: neighbourhoods
    type(physics_t) :: physics
    !> what the scene has
    type(effects_t) :: effects
    type(time_table_t) :: gravity_table
    type(contact_problem_t) :: problem
    !> velocity against which errors of the solve of the present step are compared
    type(velocity_scale_t) :: velocity_scale
    class(scheme_t), allocatable :: scheme
    type(solve_control_t) :: control
    type(column_solution_t) :: column
    !> figures that the user asked for
    type(diagnostics_t) :: diagnostics
    !> energies of the grains since this run began or went on from a checkpoint
    type(grain_balance_t) :: balance
    !> impulse of the contacts of the last step on each boundary (nd, boundaries) [N s]
    real(dp), allocatable :: boundary_impulses(:, :)
    !> grains of the scene now, and those of them that are glued to boundaries
    integer(i8) :: n_grains = 0, n_glued = 0
    !> boundaries that came with the grains: the first ones
    integer :: n_walls = 0
    !> messages between ranks, and numbers in them, that iterations of this rank have sent
    integer(i8) :: messages = 0, values = 0
    integer :: step = 0
    !> [s]
    real(dp) :: time = 0.0_dp
    !> grains of the scene at its start
    integer(i8) :: n_first = 0
    !> over all steps: solves that missed their tolerance, grains that left by outlets, grains too fast for the step
    integer(i8) :: failed = 0, left = 0, fast = 0
    !> step written last in results.h5, -1 for none
    integer :: last_written = -1
    !> the state comes from a checkpoint
    logical :: restarted = .false.
    !> of the last step [m]
    real(dp) :: largest_overlap = 0.0_dp
    !> since this run began or went on from a checkpoint: the largest overlap [m], and what solves took
    real(dp) :: worst_overlap = 0.0_dp
    type(effort_t) :: effort
    !> how solves ended and what was mended, since this run began or went on from a checkpoint
    type(run_tally_t) :: tally
    !> overlap beyond which places are projected; huge where that is off [m]
    real(dp) :: overlap_allowed = huge(1.0_dp)
    type(sleeping_rule_t) :: sleeping
    !> over all steps of this run: contacts that slept at the start of a solve, and solves that woke them
    integer(i8) :: slept = 0, woken = 0
    !> largest over mean number of contacts of a subdomain in the last step
    real(dp) :: imbalance = 1.0_dp
    !> the same just after space was last divided in a step; 0 before
    real(dp) :: reached_imbalance = 0.0_dp
  contains
    procedure :: init => simulation_init
    procedure :: make => simulation_make
    procedure :: assemble => simulation_assemble
    procedure :: start => simulation_start
    procedure :: make_subdomains => simulation_make_subdomains
    procedure :: start_diagnostics => simulation_start_diagnostics
    procedure :: advance => simulation_advance
    procedure :: facing_area => simulation_facing_area
    procedure :: load_areas => simulation_load_areas
    procedure :: free => simulation_free
  end type simulation_t

contains

  !> Make the scene of a configuration and share it out. Errors are the same on all ranks. Collective.
  subroutine simulation_init(self, comm, config, error)
    class(simulation_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(body_set_t) :: grains

    call self%make(comm, config, grains, error)
    call self%start(grains, error)
  end subroutine simulation_init

  !> Make the scene of a configuration; its grains wait for `start` or for a checkpoint. Errors are the same on all
  !> ranks. Collective.
  subroutine simulation_make(self, comm, config, grains, error)
    class(simulation_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    !> grains of this rank as they were made
    type(body_set_t), intent(out) :: grains
    type(error_t), allocatable, intent(inout) :: error
    type(scene_t) :: scene
    type(time_table_t) :: none

    call keep_heap()
    call self%free()
    self%comm => comm
    self%config = config
    self%gravity_table = none
    if (config%scene%gravity_table /= "") call self%gravity_table%read(trim(config%scene%gravity_table), &
      & trim(merge("gx gy   ", "gx gy gz", config%scene%dimension == 2)), error)
    call comm%agree(error)
    if (allocated(error)) return
    call make_scene(comm, config, scene, error)
    if (allocated(error)) return
    self%n_first = scene%n_grains
    self%n_grains = scene%n_grains
    self%n_glued = scene%n_glued
    self%n_walls = scene%n_walls
    call set_physics(self, scene)
    call check_period(self, scene, error)
    if (.not. allocated(error)) call check_in_period(config, scene, 2.0_dp*scene%largest_radius + &
      & self%decomposition%rule%range(), error)
    call comm%agree(error)
    if (allocated(error)) return
    call set_control(self)
    call choose_scheme(config, self%scheme)
    self%decomposition%boundaries = scene%boundaries
    ! one subdomain until it is known that the scene has room for so many
    call self%decomposition%init(comm, 1, scene%grains%nd, scene%grains%nv, scene%period)
    call self%velocity_scale%init(comm, scene%grains, scene%boundaries, config%time%steps*config%time%step, &
      & merge(config%solver%velocity_scale, 0.0_dp, config%solver%velocity_scale_given))
    allocate (self%boundary_impulses(scene%grains%nd, size(scene%boundaries)), source=0.0_dp)
    grains = scene%grains
  end subroutine simulation_make

  !> Share the grains of a new scene out. Errors are the same on all ranks. Collective.
  subroutine simulation_start(self, grains, error)
    class(simulation_t), intent(inout) :: self
    !> of this rank
    type(body_set_t), intent(in) :: grains
    type(error_t), allocatable, intent(inout) :: error
    type(body_set_t) :: newcomers(1)

    if (allocated(error)) return
    newcomers(1) = grains
    call divide(self%config, self%neighbourhoods, newcomers, self%decomposition, error)
    if (allocated(error)) return
    call self%make_subdomains()
    call self%decomposition%settle(grains)
    if (self%n_glued > 0) call set_glued_velocities(self%decomposition)
    call self%start_diagnostics()
  end subroutine simulation_start

  !> Prepare the balance of every run and the diagnostics that &output asks for, of the scene as it is. Collective.
  subroutine simulation_start_diagnostics(self)
    class(simulation_t), intent(inout) :: self

    call self%balance%begin(self%decomposition, self%physics)
    associate (output => self%config%output)
      call self%diagnostics%init(self%decomposition, output%energy, output%stress, output%structure, output%boundary_forces)
    end associate
  end subroutine simulation_start_diagnostics

  !> Make room for the subdomains that &decomposition asks for, without grains.
  subroutine simulation_make_subdomains(self)
    class(simulation_t), intent(inout) :: self

    associate (decomposition => self%decomposition)
      call decomposition%init(self%comm, self%config%decomposition%subdomains, decomposition%nd, decomposition%nv, &
        & decomposition%period)
    end associate
  end subroutine simulation_make_subdomains

  subroutine set_physics(self, scene)
    class(simulation_t), intent(inout) :: self
    type(scene_t), intent(in) :: scene

    associate (config => self%config%scene, rule => self%decomposition%rule)
      self%physics%gravity(:) = config%gravity
      self%physics%body_force(:) = config%body_force
      self%physics%contact = config%contact
      self%physics%rotation = config%rotation
      self%physics%laws = scene%laws
      self%physics%h = self%config%time%step
      associate (solver => self%config%solver)
        self%sleeping = sleeping_rule_t(merge(solver%sleep_after, 0, solver%sleeping), solver%sleep_speed)
      end associate
      self%physics%sleep_after = self%sleeping%after
      self%effects = scene%effects
      call self%problem%kernels%choose(config%dimension, scene%effects)
      self%neighbourhoods%memory = memory_of(self%problem%kernels, self%config%solver%warm_start, scene%laws%remembers, &
        & self%sleeping%after > 0)
      rule%largest_radius = scene%largest_radius
      rule%mean_radius = scene%mean_radius
      rule%alert_distance = merge(config%alert_distance, 0.1_dp*scene%largest_radius, config%alert_given)
      rule%alert_distance = max(rule%alert_distance, scene%laws%range)
      rule%skin = merge(config%skin, 0.2_dp*scene%mean_radius, config%skin_given)
      self%overlap_allowed = huge(1.0_dp)
      if (config%overlap_projection .and. scene%mean_radius > 0.0_dp) &
        & self%overlap_allowed = merge(config%overlap_allowed, 0.01_dp*scene%mean_radius, config%overlap_given)
      rule%kind = merge(rule_primal, rule_dual, self%config%decomposition%kind == "primal")
    end associate
  end subroutine set_physics

  !> A pair of grains must not be listed across both sides of a period.
  subroutine check_period(self, scene, error)
    type(simulation_t), intent(in) :: self
    type(scene_t), intent(in) :: scene
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: least

    least = 2.0_dp*(2.0_dp*scene%largest_radius + self%decomposition%rule%range())
    if (.not. any(scene%period%length > 0.0_dp .and. scene%period%length <= least)) return
    call raise(error, status_input, self%config%file//": &scene period: expected more than "//to_text(least, 4)// &
      & " m along each periodic axis: two diameters of the largest grain and twice the alert distance and the skin")
  end subroutine check_period

  subroutine set_control(self)
    class(simulation_t), intent(inout) :: self

    associate (config => self%config)
      select case (config%solver%criterion)
      case ("residual")
        self%control%criterion = by_residual
      case ("error")
        self%control%criterion = by_error
      case default
        self%control%criterion = by_velocity
      end select
      self%control%accuracy = config%solver%accuracy
      self%control%layered = config%solver%layered_start
      self%control%tolerance = config%solver%tolerance
      self%control%max_iterations = config%solver%max_iterations
      self%control%check_every = config%solver%check_every
      self%control%trace = config%output%trace
      self%column%count = config%scene%column_count
      self%column%unit_impulse = -config%scene%mass*config%scene%gravity(config%scene%dimension)*config%time%step
    end associate
  end subroutine set_control

  !> Move grains and boundaries to q_m, bring the neighbour lists up to date, find the contacts and start them from the
  !> impulses of the last step. Collective.
  subroutine simulation_assemble(self, figures)
    class(simulation_t), intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    logical :: listed
    integer :: s

    call start_timer(phase_bodies)
    listed = .false.
    self%physics%first = self%step == 0
    call move_to_middle(self, listed)
    call drive(self)
    call count_fast(self, figures)
    call stop_timer(phase_bodies)
    call start_timer(phase_neighbourhood)
    if (.not. listed) listed = self%neighbourhoods%are_due(self%decomposition)
    if (.not. listed) listed = some_leave(self%decomposition)
    figures%divided = division_is_due(self%config%decomposition, self%step, self%imbalance, self%reached_imbalance)
    figures%listed = listed .or. figures%divided
    call list_neighbours(self, figures)
    call stop_timer(phase_neighbourhood)
    call build_problem(self%decomposition, self%neighbourhoods, self%problem%kernels, self%physics, self%problem, figures%sharing)
    call start_timer(phase_setup)
    if (self%config%solver%warm_start) call recall_impulses(self%neighbourhoods, self%problem)
    call stop_timer(phase_setup)
    self%problem%load(:) = self%physics%h*self%physics%gravity
    figures%contacts = self%problem%n_contacts
    figures%asleep = self%problem%n_asleep
    do s = 1, size(self%problem%sub)
      if (self%problem%sub(s)%n_contacts > 0) figures%max_overlap = max(figures%max_overlap, -minval(self%problem%sub(s)%gap))
    end do
    figures%max_overlap = self%comm%highest(figures%max_overlap)
    self%largest_overlap = figures%max_overlap
    self%worst_overlap = max(self%worst_overlap, figures%max_overlap)
    if (figures%contacts > 0) self%imbalance = real(figures%sharing%most_contacts, dp)*self%decomposition%n_subdomains/ &
      & real(figures%contacts, dp)
    if (figures%divided) then
      self%reached_imbalance = self%imbalance
      call self%scheme%measure_balance(self%comm, self%decomposition%n_subdomains, figures%rank_balance, figures%subdomain_balance)
      call self%scheme%forget_times()
    end if
    call measure_velocity_scale(self)
  end subroutine simulation_assemble

  !> Find the velocity against which errors of the solve to come are compared. Collective.
  subroutine measure_velocity_scale(self)
    class(simulation_t), intent(inout) :: self
    real(dp) :: area(size(self%decomposition%boundaries))

    call start_timer(phase_setup)
    call self%load_areas(area)
    call self%velocity_scale%measure(self%decomposition, self%physics, self%problem, self%time + self%physics%h, area)
    self%problem%error_scale = self%velocity_scale%value
    call stop_timer(phase_setup)
  end subroutine measure_velocity_scale

  !> q_m of grains and boundaries; boundaries whose time has come are taken away.
  subroutine move_to_middle(self, listed)
    class(simulation_t), intent(inout) :: self
    logical, intent(inout) :: listed
    real(dp) :: part
    integer :: s, b, k, nd

    nd = self%decomposition%nd
    part = (1.0_dp - self%config%time%theta)*self%physics%h
    do s = 1, size(self%decomposition%home)
      associate (home => self%decomposition%home(s))
        do k = 1, home%n
          if (home%glued(k) == 0) home%position(:, k) = predict_position(home%position(:, k), home%velocity(1:nd, k), &
            & self%physics%h, self%config%time%theta)
        end do
      end associate
    end do
    if (self%n_glued > 0) call carry_glued(self%decomposition, part)
    do b = 1, size(self%decomposition%boundaries)
      associate (boundary => self%decomposition%boundaries(b))
        call boundary%move(part)
        if (.not. boundary%present .or. self%time < boundary%remove_at) cycle
        boundary%present = .false.
        listed = .true.
        if (self%sleeping%after > 0) call wake_all(self%neighbourhoods)
      end associate
    end do
  end subroutine move_to_middle

  !> Gravity and the velocities of boundaries at the end of the step, without contacts.
  subroutine drive(self)
    class(simulation_t), intent(inout) :: self
    real(dp) :: force(self%decomposition%nd), end_time
    integer :: b, d, nd

    nd = self%decomposition%nd
    end_time = self%time + self%physics%h
    if (allocated(self%gravity_table%has)) then
      do d = 1, nd
        if (.not. self%gravity_table%has(d)) cycle
        self%physics%gravity(d) = self%gravity_table%at(d, end_time)
        if (self%sleeping%after > 0 .and. abs(self%physics%gravity(d) - self%gravity_table%at(d, self%time)) > 0.0_dp) &
          & call wake_all(self%neighbourhoods)
      end do
    end if
    do b = 1, size(self%decomposition%boundaries)
      associate (boundary => self%decomposition%boundaries(b))
        boundary%last_velocity(:) = boundary%velocity
        boundary%last_spin(:) = boundary%spin
        call boundary%prescribe(nd, end_time)
        if (.not. boundary%is_driven()) cycle
        call boundary%applied_force(nd, end_time, self%facing_area(b), force)
        do d = 1, nd
          if (boundary%free(d)) boundary%velocity(d) = boundary%velocity(d) + self%physics%h*force(d)/boundary%mass
        end do
      end associate
    end do
  end subroutine drive

  !> Area that a pressure on plane `b` works on [m^2, m in 2D].
  pure real(dp) function simulation_facing_area(self, b) result(area)
    class(simulation_t), intent(in) :: self
    integer, intent(in) :: b

    area = area_across(self, maxloc(abs(self%decomposition%boundaries(b)%axis), dim=1))
  end function simulation_facing_area

  !> Area of the scene across axis `main`: along every other axis, the way between the two planes that face each other
  !> across it, or the period [m^2, m in 2D]. An axis without either counts 1 m.
  pure real(dp) function area_across(self, main) result(area)
    type(simulation_t), intent(in) :: self
    integer, intent(in) :: main
    real(dp) :: low, high
    integer :: d

    area = 1.0_dp
    associate (boundaries => self%decomposition%boundaries, length => self%decomposition%period%length)
      do d = 1, self%decomposition%nd
        if (d == main) cycle
        call find_facing_planes(boundaries, d, low, high)
        if (length(d) > 0.0_dp) then
          area = area*length(d)
        else if (low > -huge(1.0_dp) .and. high < huge(1.0_dp)) then
          area = area*max(high - low, 0.0_dp)
        end if
      end do
    end associate
  end function area_across

  !> Areas that the loads on boundaries work on: of a plane that of its pressure, of a segment or rectangle its own, of another
  !> shape that of the scene across its load.
  pure subroutine simulation_load_areas(self, area)
    class(simulation_t), intent(in) :: self
    !> (boundaries) [m^2, m in 2D]; 0 where no force moves the boundary
    real(dp), intent(out) :: area(:)
    integer :: b

    area(:) = 0.0_dp
    do b = 1, size(area)
      associate (boundary => self%decomposition%boundaries(b))
        if (.not. boundary%is_driven()) cycle
        select case (boundary%shape)
        case (shape_plane)
          area(b) = self%facing_area(b)
        case (shape_segment)
          area(b) = norm2(boundary%edge(:, 1))
        case (shape_rectangle)
          area(b) = norm2(boundary%edge(:, 1))*norm2(boundary%edge(:, 2))
        case default
          area(b) = area_across(self, boundary%load_axis())
        end select
      end associate
    end do
  end subroutine simulation_load_areas

  !> Count the grains that move by more than their radius in a step: they may pass through others unseen. Collective.
  subroutine count_fast(self, figures)
    class(simulation_t), intent(in) :: self
    type(step_figures_t), intent(inout) :: figures
    integer(i8) :: counts(1)
    integer :: s, k, nd

    nd = self%decomposition%nd
    counts(:) = 0
    do s = 1, size(self%decomposition%home)
      associate (home => self%decomposition%home(s))
        do k = 1, home%n
          if (self%physics%h**2*sum(home%velocity(1:nd, k)**2) > home%radius(k)**2) counts(1) = counts(1) + 1
        end do
      end associate
    end do
    call self%comm%sum_counts(counts)
    figures%fast = counts(1)
  end subroutine count_fast

  !> Bring views and lists up to date, or make them anew with the impulses carried over. Collective.
  subroutine list_neighbours(self, figures)
    class(simulation_t), intent(inout) :: self
    type(step_figures_t), intent(inout) :: figures
    integer(i8), allocatable :: records(:, :)
    integer(i8) :: n_glued
    logical :: remembered

    if (self%neighbourhoods%builds > 0) call self%neighbourhoods%refresh(self%decomposition)
    if (.not. figures%listed) return
    remembered = self%neighbourhoods%memory%words() > 0 .and. self%neighbourhoods%builds > 0
    if (remembered) call gather_impulses(self%decomposition, self%neighbourhoods, records)
    call let_grains_out(self%decomposition, self%n_glued > 0, figures%left, n_glued)
    self%n_grains = self%n_grains - figures%left - n_glued
    self%n_glued = self%n_glued - n_glued
    if (figures%divided) call divide_again(self%config, self%neighbourhoods, self%decomposition, figures%refused)
    call self%decomposition%settle()
    call self%neighbourhoods%build(self%decomposition)
    if (remembered) call spread_impulses(self%decomposition, records, self%neighbourhoods)
  end subroutine list_neighbours

  !> One step. After a solve that diverged, velocities and places are not those of any step: the run must end.
  !> Collective.
  subroutine simulation_advance(self, figures, error, watch)
    class(simulation_t), intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    type(error_t), allocatable, intent(inout) :: error
    !> is told how the solve goes on
    class(solve_watch_t), intent(inout), optional :: watch
    real(dp) :: shifts, free_grains

    if (allocated(error)) return
    call self%assemble(figures)
    call solve_contacts(self%problem, self%scheme, self%control, figures%solve, error, self%column, watch)
    if (.not. allocated(error)) then
      if (figures%solve%status /= solve_converged) self%failed = self%failed + 1
      call self%tally%add_solve(figures%solve, self%velocity_scale%kind)
    end if
    self%messages = self%messages + self%problem%shared%messages
    self%values = self%values + self%problem%shared%values
    if (allocated(error)) return
    if (figures%solve%status == solve_diverged) then
      call find_cause(self, figures)
      return
    end if
    if (figures%solve%status == solve_unbounded) call find_largest_impulse(self, figures)
    associate (solve => figures%solve)
      call self%effort%add(solve%descent, solve%iterations, solve%figure, solve%seconds, solve%start_seconds)
    end associate
    call start_timer(phase_bodies)
    if (self%sleeping%after > 0) call count_rest(self%sleeping, self%decomposition%boundaries, figures%solve%woken, &
      & self%neighbourhoods, self%problem)
    if (self%config%solver%warm_start) call keep_impulses(self%problem, self%neighbourhoods)
    if (self%physics%laws%remembers) call conclude_pairs(self%problem, self%decomposition%boundaries, self%physics%laws, &
      & self%neighbourhoods)
    call self%problem%shift_impulses(-1)
    call take_velocities(self%decomposition, self%physics, self%problem)
    call sum_boundary_impulses(self%decomposition, self%problem, self%boundary_impulses)
    call take_boundary_velocities(self%decomposition, self%boundary_impulses)
    call self%diagnostics%take_step(self%decomposition, self%neighbourhoods, self%physics, self%problem, self%boundary_impulses, &
      & self%time, figures%left > 0)
    call self%balance%take_step(self%decomposition, self%neighbourhoods, self%physics, self%problem, figures%left > 0)
    call move_to_end(self)
    call stop_timer(phase_bodies)
    figures%projected = figures%max_overlap > self%overlap_allowed
    shifts = 0.0_dp
    if (figures%projected) call project_overlaps(self%decomposition, self%problem, self%physics%h, self%overlap_allowed, shifts)
    free_grains = real(max(self%n_grains - self%n_glued, 1_i8), dp)
    call self%tally%add_step(figures%max_overlap, shifts/self%overlap_allowed > rounded_shift, shifts/free_grains, &
      & self%physics%h*self%balance%speeds/free_grains)
    self%step = self%step + 1
    self%time = self%step*self%physics%h
    figures%kinetic_energy = self%balance%kinetic
    self%left = self%left + figures%left
    self%fast = self%fast + figures%fast
    self%slept = self%slept + figures%asleep
    if (figures%solve%woken) self%woken = self%woken + 1
    call self%diagnostics%measure(self%decomposition, self%physics, self%problem, self%boundary_impulses, &
      & self%n_grains - self%n_glued)
    call check_numbers(self, figures, error)
  end subroutine simulation_advance

  !> After a solve that diverged: the first contact, in the order of the subdomains, whose impulse or velocities are not finite or
  !> have squares that are not. Collective.
  subroutine find_cause(self, figures)
    class(simulation_t), intent(in) :: self
    type(step_figures_t), intent(inout) :: figures
    type(error_t), allocatable :: found
    integer :: s, c

    do s = 1, size(self%problem%sub)
      associate (sub => self%problem%sub(s))
        do c = 1, sub%n_contacts
          associate (pair => sub%pair(:, c), impulse => sub%impulse(lane_of(c), :, block_of(c)))
            if (all(has_finite_square(impulse)) .and. all(has_finite_square(sub%velocity(:, pair)))) cycle
            call raise(found, status_unconverged, "contact of bodies "//to_text(sub%id(pair(1)))//" and "// &
              & to_text(sub%id(pair(2)))//": an impulse or a velocity whose square is not a finite number")
          end associate
        end do
      end associate
    end do
    call self%comm%agree(found)
    if (allocated(found)) figures%cause = found%message
  end subroutine find_cause

  !> After a solve whose impulses grow without bound: the contact with the largest one. Collective.
  subroutine find_largest_impulse(self, figures)
    class(simulation_t), intent(in) :: self
    type(step_figures_t), intent(inout) :: figures
    type(error_t), allocatable :: found
    real(dp) :: largest, size_of
    integer :: s, c, k

    largest = -1.0_dp
    do k = 1, 2
      do s = 1, size(self%problem%sub)
        associate (sub => self%problem%sub(s))
          do c = 1, sub%n_contacts
            size_of = norm2(sub%impulse(lane_of(c), :, block_of(c)))
            if (k == 1) then
              largest = max(largest, size_of)
            else if (size_of >= largest .and. .not. allocated(found)) then
              call raise(found, status_unconverged, "largest impulse: contact of bodies "//to_text(sub%id(sub%pair(1, c)))// &
                & " and "//to_text(sub%id(sub%pair(2, c))))
            end if
          end do
        end associate
      end do
      if (k == 1) largest = self%comm%highest(largest)
    end do
    call self%comm%agree(found)
    if (allocated(found)) figures%cause = found%message
  end subroutine find_largest_impulse

  !> Fail (status_failure) where a figure of the step is NaN or infinite. Errors are the same on all ranks. Collective.
  subroutine check_numbers(self, figures, error)
    class(simulation_t), intent(in) :: self
    type(step_figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error
    integer :: s, k, b

    if (.not. is_finite(figures%kinetic_energy)) then
      do s = 1, size(self%decomposition%home)
        associate (home => self%decomposition%home(s))
          do k = 1, home%n
            if (.not. is_finite(home%mass(k)*sum(home%velocity(:, k)**2))) &
              & call refuse("kinetic energy of body "//to_text(home%id(k)))
          end do
        end associate
      end do
      call self%comm%agree(error)
    end if
    do b = 1, size(self%decomposition%boundaries)
      associate (boundary => self%decomposition%boundaries(b))
        if (.not. (all(is_finite(boundary%point)) .and. all(is_finite(boundary%velocity)))) &
          & call refuse("motion of boundary '"//boundary%name//"'")
      end associate
    end do
    if (.not. is_finite(figures%kinetic_energy)) call refuse("kinetic energy")
    if (.not. is_finite(figures%max_overlap)) call refuse("largest overlap")
    if (.not. is_finite(figures%solve%residual)) call refuse("residual")
    if (.not. is_finite(figures%solve%jump)) call refuse("jump")
    do k = 1, self%diagnostics%n_columns
      if (.not. is_finite(self%diagnostics%value(k))) call refuse(trim(self%diagnostics%name(k)))
    end do

  contains

    subroutine refuse(what)
      character(len=*), intent(in) :: what

      call raise(error, status_failure, "step "//to_text(self%step)//": "//what//": not a finite number; expected speeds, "// &
        & "loads and a &time step that give finite ones")
    end subroutine refuse

  end subroutine check_numbers

  !> q_{i+1} of grains and boundaries.
  subroutine move_to_end(self)
    class(simulation_t), intent(inout) :: self
    integer :: s, b, k, nd

    nd = self%decomposition%nd
    do s = 1, size(self%decomposition%home)
      associate (home => self%decomposition%home(s))
        do k = 1, home%n
          if (home%glued(k) == 0) home%position(:, k) = advance_position(home%position(:, k), home%velocity(1:nd, k), &
            & self%physics%h, self%config%time%theta)
        end do
      end associate
    end do
    if (self%n_glued > 0) call carry_glued(self%decomposition, self%config%time%theta*self%physics%h)
    do b = 1, size(self%decomposition%boundaries)
      call self%decomposition%boundaries(b)%move(self%config%time%theta*self%physics%h)
    end do
    if (self%n_glued > 0) call set_glued_velocities(self%decomposition)
  end subroutine move_to_end

  !> Give back what the method holds.
  subroutine simulation_free(self)
    class(simulation_t), intent(inout) :: self

    if (allocated(self%scheme)) then
      call self%scheme%free()
      deallocate (self%scheme)
    end if
    if (allocated(self%boundary_impulses)) deallocate (self%boundary_impulses)
    if (allocated(self%neighbourhoods%view)) deallocate (self%neighbourhoods%view)
    self%neighbourhoods%builds = 0
    self%step = 0
    self%time = 0.0_dp
    self%failed = 0
    self%left = 0
    self%fast = 0
    self%slept = 0
    self%woken = 0
    self%last_written = -1
    self%restarted = .false.
    self%worst_overlap = 0.0_dp
    self%effort = effort_t()
    self%tally = run_tally_t()
    self%imbalance = 1.0_dp
    self%reached_imbalance = 0.0_dp
  end subroutine simulation_free

end module gravier_simulation
