!> A scene in time: the time stepper of a case, made from its configuration.
module gravier_simulation
  use gravier_kinds, only: dp, i8
  use gravier_allocator_tuning, only: keep_heap
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, text_from
  use gravier_communicator, only: communicator_t
  use gravier_schedule, only: schedule_t
  use gravier_time_table, only: time_table_t
  use gravier_neighbour_rule, only: rule_dual, rule_primal
  use gravier_solve_report, only: by_velocity, by_residual, by_error
  use gravier_body_store, only: body_set_t
  use gravier_repartition, only: repartition_rule_t, divide
  use gravier_boundary_loads, only: set_glued_velocities
  use gravier_sleeping, only: sleeping_rule_t
  use gravier_pair_places, only: has_facets
  use gravier_impulse_memory, only: memory_of
  use gravier_step_figures, only: step_figures_t
  use gravier_fallen_grains, only: fallen_grains_t
  use gravier_time_stepper, only: time_stepper_t
  use gravier_config_types, only: config_t
  use gravier_scene_thickness, only: mean_half_thickness
  use gravier_scene, only: scene_t, make_scene
  use gravier_scene_period, only: check_in_period
  use gravier_diagnostic_registry, only: diagnostic_holder_t
  use gravier_scene_regions, only: make_region_means
  use gravier_scene_tracks, only: make_tracked_bodies
  use gravier_method_choice, only: choose_scheme, choose_fallback
  use gravier_column_solution, only: column_solution_t
  implicit none
  private
  public :: simulation_t, step_figures_t

  !> what a projection leaves of the overlap allowed where bodies have shapes: faces that rest on each other creep by the error of
  !> solves, and would be projected again in every step
  real(dp), parameter :: overlap_left_of_shapes = 0.75_dp

  !> the farthest way that neighbour lists leave fast bodies to go, over the mean radius: beyond it more pairs cost more than fewer
  !> lists save
  real(dp), parameter :: most_travel = 0.5_dp
  !> in which rates outweigh all bounds on the grains that enter [s]
  real(dp), parameter :: long_run = 1.0e12_dp

  type, extends(time_stepper_t) :: simulation_t
    !> of the grains as the run begins; of disks and spheres the mean radius [m]
    real(dp) :: mean_half_thickness = 0.0_dp
    type(config_t) :: config
    !> boundaries that came with the grains: the first ones
    integer :: n_walls = 0
    !> grains of the scene at its start
    integer(i8) :: n_first = 0
    !> the boundary whose displacement may end the run, 0 for none, and its place at the start of the scene [m]
    integer :: watched = 0
    real(dp) :: watched_from(3) = 0.0_dp
    !> lengths of the period at the start of the scene [m]
    real(dp) :: first_length(3) = 0.0_dp
    !> mass of the free grains of the scene at its start [kg]
    real(dp) :: first_mass = 0.0_dp
    !> in the state of the last look
    type(fallen_grains_t) :: fallen
    !> step written last in results.h5, -1 for none
    integer :: last_written = -1
    !> the state comes from a checkpoint
    logical :: restarted = .false.
    !> names of the files that the run has, those before a restart among them, with commas between
    character(len=:), allocatable :: files
    !> what a loop of the user's own has set since the run began or went on from a checkpoint, and what it had set before that, and
    !> no checkpoint keeps; with commas between
    character(len=:), allocatable :: set_by_loop, set_before
    !> options of the case that are others than those of the checkpoint that the run goes on from, a line each
    character(len=:), allocatable :: changes
  contains
    procedure :: init => simulation_init
    procedure :: make => simulation_make
    procedure :: start => simulation_start
    procedure :: make_subdomains => simulation_make_subdomains
    procedure :: start_diagnostics => simulation_start_diagnostics
    procedure :: note_files => simulation_note_files
    procedure :: goes_on_with => simulation_goes_on_with
    procedure :: cell_strain => simulation_cell_strain
    procedure :: free => simulation_free
  end type simulation_t

contains

  !> Make the scene of a configuration and distribute it. Errors are the same on all ranks. Collective.
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
    type(error_t), allocatable :: too_long

    call keep_heap()
    call self%free()
    self%comm => comm
    self%config = config
    self%gravity_table = none
    if (config%scene%gravity_table /= "") call self%gravity_table%read(trim(config%scene%gravity_table), &
      & trim(merge("gx gy   ", "gx gy gz", config%scene%dimension == 2)), config%scene%gravity_table_repeats, error)
    call comm%agree(error)
    if (allocated(error)) return
    call make_scene(comm, config, scene, error)
    if (allocated(error)) return
    self%n_first = scene%n_grains
    self%n_grains = scene%n_grains
    self%n_glued = scene%n_glued
    self%n_walls = scene%n_walls
    self%given = scene%contacts
    self%inflow%insertions = scene%insertions
    self%inflow%next_id = scene%last_id + 1
    call set_physics(self, scene)
    call check_lists_in_period(self, scene, too_long)
    ! lists that last less long have a shorter range
    if (allocated(too_long)) then
      self%decomposition%rule%most_travel = 0.0_dp
      call check_lists_in_period(self, scene, error)
    end if
    if (allocated(error)) return
    call set_control(self)
    call choose_scheme(config, self%method)
    call choose_fallback(config, self%fallback)
    self%decomposition%boundaries = scene%boundaries
    self%decomposition%shapes = scene%shapes
    call self%decomposition%figures%init(scene%shapes)
    ! one subdomain until it is known that the scene has room for so many
    call self%decomposition%init(comm, 1, scene%grains, scene%period)
    self%cell_drive = scene%cell_drive
    call self%velocity_scale%init(comm, scene%grains, scene%boundaries, config%time%steps*config%time%step, &
      & merge(config%solver%velocity_scale, 0.0_dp, config%solver%velocity_scale_given))
    if (self%inflow%exists()) call prepare_inflow(self)
    call watch_boundary(self)
    self%first_length(:) = scene%period%length
    allocate (self%boundary_impulses(scene%grains%nd, size(scene%boundaries)), source=0.0_dp)
    grains = scene%grains
  end subroutine simulation_make

  !> Strains of the periodic cell along its axes since the start of the scene, logarithms of the lengths over those of then,
  !> extension positive; 0 along axes that are not periodic.
  pure function simulation_cell_strain(self) result(strain)
    class(simulation_t), intent(in) :: self
    real(dp) :: strain(3)

    strain(:) = 0.0_dp
    associate (length => self%decomposition%period%length)
      where (length > 0.0_dp) strain = log(length/self%first_length)
    end associate
  end function simulation_cell_strain

  !> Share the grains of a new scene out. Errors are the same on all ranks. Collective.
  subroutine simulation_start(self, grains, error)
    class(simulation_t), intent(inout) :: self
    !> of this rank
    type(body_set_t), intent(in) :: grains
    type(error_t), allocatable, intent(inout) :: error
    type(body_set_t) :: newcomers(1)

    if (allocated(error)) return
    newcomers(1) = grains
    call divide(self%division, self%halo, newcomers, self%decomposition, error)
    if (allocated(error)) then
      error%message = self%config%file//": "//error%message
      return
    end if
    call self%make_subdomains()
    call self%decomposition%migrate(grains)
    if (self%n_glued > 0) call set_glued_velocities(self%decomposition)
    call self%start_diagnostics()
    self%mass = self%decomposition%free_mass()
    self%first_mass = self%mass
    call self%cell_drive%begin_step(self%decomposition%period, self%decomposition%nd, self%mass, self%physics%h, self%physics%h, &
      & self%physics%cell)
    call self%population%note(self%n_grains - self%n_glued, self%mass)
  end subroutine simulation_start

  !> Find the boundary of stop_boundary and its place at the start of the scene.
  subroutine watch_boundary(self)
    class(simulation_t), intent(inout) :: self
    integer :: b

    self%watched = 0
    do b = 1, size(self%config%boundaries)
      if (self%config%boundaries(b)%name == self%config%time%stop_boundary) self%watched = self%n_walls + b
    end do
    if (self%watched > 0) call self%decomposition%boundaries(self%watched)%find_place(self%watched_from)
  end subroutine watch_boundary

  !> Partitions cover the regions that grains enter in; where there are no grains at the start, the mean grain is that of those that
  !> are to enter.
  subroutine prepare_inflow(self)
    class(simulation_t), intent(inout) :: self
    real(dp) :: share(size(self%inflow%insertions))
    integer :: d, nd

    nd = self%decomposition%nd
    allocate (self%decomposition%entry_box(nd, 2))
    associate (insertions => self%inflow%insertions)
      do d = 1, nd
        self%decomposition%entry_box(d, 1) = minval(insertions%lower(d))
        self%decomposition%entry_box(d, 2) = maxval(insertions%upper(d))
      end do
      if (self%velocity_scale%mass > 0.0_dp) return
      ! the mean of all that enter in the long run, whatever the number of steps is: rates without an end outweigh all bounds, and
      ! one grain of each insertion counts where one has neither a rate nor a bound
      do d = 1, size(insertions)
        share(d) = insertions(d)%planned(long_run)
      end do
      if (.not. (maxval(share) > 0.0_dp .and. maxval(share) < huge(1.0_dp))) share(:) = 1.0_dp
      share(:) = share/sum(share)
      do d = 1, size(insertions)
        self%velocity_scale%diameter = self%velocity_scale%diameter + share(d)*2.0_dp*insertions(d)%radii%moment(1)
        self%velocity_scale%mass = self%velocity_scale%mass + share(d)*insertions(d)%mean_mass()
      end do
    end associate
  end subroutine prepare_inflow

  !> Prepare the balance of every run and the diagnostics that &output and the groups &region ask for, of the scene as it is.
  !> Collective.
  subroutine simulation_start_diagnostics(self)
    class(simulation_t), intent(inout) :: self
    type(diagnostic_holder_t) :: more(2)

    call self%balance%begin(self%decomposition, self%physics)
    call make_tracked_bodies(self%config, more(1))
    call make_region_means(self%config, more(2))
    call self%diagnostics%init(self%decomposition, self%physics, self%config%output%diagnostics, more)
  end subroutine simulation_start_diagnostics

  !> Make room for the subdomains that &decomposition asks for, without grains.
  subroutine simulation_make_subdomains(self)
    class(simulation_t), intent(inout) :: self

    associate (decomposition => self%decomposition)
      call decomposition%init(self%comm, self%config%decomposition%subdomains, decomposition%layout(), decomposition%period)
    end associate
  end subroutine simulation_make_subdomains

  subroutine set_physics(self, scene)
    class(simulation_t), intent(inout) :: self
    type(scene_t), intent(in) :: scene

    associate (config => self%config%scene, rule => self%decomposition%rule)
      self%physics%gravity(:) = config%gravity
      self%physics%body_force(:) = config%body_force
      self%physics%rotation = config%rotation
      self%physics%resists(1) = scene%effects%rolling
      self%physics%resists(2) = scene%effects%pivoting
      self%physics%laws = scene%laws
      self%physics%h = self%config%time%step
      self%physics%theta = self%config%time%theta
      self%rest_energy = self%config%time%rest_energy
      associate (solver => self%config%solver)
        self%sleeping = sleeping_rule_t(merge(solver%sleep_after, 0, solver%sleeping), solver%sleep_speed, &
          & solver%accuracy)
      end associate
      self%effects = scene%effects
      call self%problem%choose_kernels(config%dimension, scene%effects)
      self%halo%memory = memory_of(self%problem%kernels, self%config%solver%warm_start, scene%laws%remembers, &
        & self%sleeping%after > 0, scene%effects%shapes .or. has_facets(scene%boundaries))
      rule%largest_radius = scene%largest_radius
      rule%mean_radius = scene%mean_radius
      self%mean_half_thickness = mean_half_thickness(self%comm, scene)
      rule%alert_distance = merge(config%alert_distance, 0.1_dp*scene%largest_radius, config%alert_distance_given)
      rule%alert_distance = max(rule%alert_distance, scene%laws%range)
      rule%filter = scene%laws%filter
      rule%skin = merge(config%skin, 0.2_dp*scene%mean_radius, config%skin_given)
      rule%duration = config%list_steps*self%physics%h
      rule%most_travel = merge(most_travel*scene%mean_radius, 0.0_dp, config%list_steps > 0.0_dp)
      self%overlap_allowed = huge(1.0_dp)
      if (config%overlap_projection .and. scene%mean_radius > 0.0_dp) &
        & self%overlap_allowed = merge(config%overlap_allowed, min(0.01_dp*scene%mean_radius, scene%least_rounding), &
        & config%overlap_allowed_given)
      self%overlap_left = merge(overlap_left_of_shapes, 1.0_dp, scene%effects%shapes)*self%overlap_allowed
      rule%kind = merge(rule_primal, rule_dual, self%config%decomposition%kind == "primal")
    end associate
  end subroutine set_physics

  !> Refuse periods that are too short for the range of the lists. Errors are the same on all ranks. Collective.
  subroutine check_lists_in_period(self, scene, error)
    type(simulation_t), intent(in) :: self
    type(scene_t), intent(in) :: scene
    type(error_t), allocatable, intent(inout) :: error

    call check_period(self, scene, error)
    if (.not. allocated(error)) call check_in_period(self%config, scene, 2.0_dp*scene%largest_radius + &
      & self%decomposition%rule%range(), error)
    call self%comm%agree(error)
  end subroutine check_lists_in_period

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
      self%spot_checks%part = config%solver%spot_checks
      ! loads that act from the first step on bring bonds near to their limits at once; iterations of direct solves are too dear
      if (self%physics%laws%breaks .and. config%solver%method /= "newton") call self%refinement%take_care()
      self%written_steps = schedule_t(every=config%output%every, last=config%time%steps)
      self%dumped_step = config%output%fclib_step
      if (config%scene%bodies == "column") allocate (self%exact, source=column_solution_t(config%scene%column_count, &
        & -config%scene%mass*config%scene%gravity(config%scene%dimension)*config%time%step))
      self%warm_start = config%solver%warm_start
      associate (parts => config%decomposition)
        self%division = repartition_rule_t(parts%partition == "metis", parts%grid, parts%subdomains, parts%repartition_every, &
          & parts%repartition_imbalance)
      end associate
    end associate
  end subroutine set_control

  !> Give back what the method holds, and go back to step 0.
  subroutine simulation_free(self)
    class(simulation_t), intent(inout) :: self

    call self%time_stepper_t%free()
    if (allocated(self%decomposition%entry_box)) deallocate (self%decomposition%entry_box)
    self%last_written = -1
    self%restarted = .false.
    self%files = ""
    self%set_by_loop = ""
    self%set_before = ""
    self%changes = ""
  end subroutine simulation_free

  !> Remember the files that the run has from now on, beside those that it had before a restart.
  pure subroutine simulation_note_files(self, names)
    class(simulation_t), intent(inout) :: self
    !> with commas between
    character(len=*), intent(in) :: names
    integer :: first, last

    first = 1
    do while (first <= len(names))
      last = first + index(names(first:)//",", ",") - 2
      if (.not. is_among(names(first:last), self%files)) self%files = self%files//","//names(first:last)
      first = last + 2
    end do
    if (index(self%files, ",") == 1) self%files = text_from(self%files, 2)
  end subroutine simulation_note_files

  !> Whether the run that is restarted has written a file of this name before; one that it has not written is of another run.
  pure logical function simulation_goes_on_with(self, name) result(goes_on)
    class(simulation_t), intent(in) :: self
    character(len=*), intent(in) :: name

    goes_on = self%restarted .and. is_among(name, self%files)
  end function simulation_goes_on_with

  !> Whether a name is one of some with commas between.
  pure logical function is_among(name, names)
    character(len=*), intent(in) :: name, names

    is_among = index(","//names//",", ","//name//",") > 0
  end function is_among

end module gravier_simulation
