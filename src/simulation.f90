!> A scene in time: what it takes to make one step after the other, without output.
module gravier_simulation
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: start_timer, stop_timer, phase_bodies, phase_setup
  use gravier_motion, only: predict_position, advance_position
  use gravier_detection, only: rule_dual, rule_primal
  use gravier_contact_problem, only: contact_problem_t
  use gravier_scheme, only: scheme_t
  use gravier_solve, only: solve_control_t, solve_report_t, solve_contacts, solve_diverged
  use gravier_partition, only: partition_t, choose_boxes, check_subdomains
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  use gravier_problem_builder, only: physics_t, interface_figures_t, build_problem, take_velocities
  use gravier_impulse_memory, only: impulse_memory_t
  use gravier_config_types, only: config_t
  use gravier_scene, only: scene_t, make_scene
  use gravier_scheme_choice, only: choose_scheme
  use gravier_column_solution, only: column_solution_t
  implicit none
  private
  public :: simulation_t, step_figures_t

  !> Figures of a step, the same on every rank.
  type :: step_figures_t
    type(solve_report_t) :: solve
    type(interface_figures_t) :: sharing
    integer(i8) :: contacts = 0
    !> [m], 0 where nothing overlaps; [J]
    real(dp) :: max_overlap = 0.0_dp, kinetic_energy = 0.0_dp
  end type step_figures_t

  type :: simulation_t
    type(config_t) :: config
    type(communicator_t), pointer :: comm => null()
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    class(scheme_t), allocatable :: scheme
    type(solve_control_t) :: control
    type(impulse_memory_t) :: memory
    type(column_solution_t) :: column
    integer(i8) :: n_grains = 0
    !> messages between ranks, and numbers in them, that iterations of this rank have sent
    integer(i8) :: messages = 0, values = 0
    integer :: step = 0
    !> [s]
    real(dp) :: time = 0.0_dp
  contains
    procedure :: init => simulation_init
    procedure :: assemble => simulation_assemble
    procedure :: advance => simulation_advance
    procedure :: kinetic_energy => simulation_kinetic_energy
    procedure :: free => simulation_free
  end type simulation_t

contains

  !> Make the scene of a configuration and share it out. Errors are the same on all ranks. Collective.
  subroutine simulation_init(self, comm, config, error)
    class(simulation_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(scene_t) :: scene
    type(body_set_t) :: newcomers(1)

    call self%free()
    self%comm => comm
    self%config = config
    self%step = 0
    self%time = 0.0_dp
    call make_scene(comm, config, scene, error)
    if (allocated(error)) return
    self%n_grains = scene%n_grains
    call set_physics(self, scene)
    call set_control(self)
    call choose_scheme(config, self%scheme)
    ! one subdomain until it is known that the scene has room for so many
    call self%decomposition%init(comm, 1, scene%grains%nd, scene%grains%nv)
    self%decomposition%walls = scene%walls
    newcomers(1) = scene%grains
    call divide(self, newcomers, error)
    if (allocated(error)) return
    call self%decomposition%init(comm, config%decomposition%subdomains, scene%grains%nd, scene%grains%nv)
    call self%decomposition%settle(scene%grains)
  end subroutine simulation_init

  subroutine set_physics(self, scene)
    class(simulation_t), intent(inout) :: self
    type(scene_t), intent(in) :: scene

    associate (config => self%config%scene, rule => self%decomposition%rule)
      self%physics%gravity(:) = config%gravity
      self%physics%friction = config%friction
      self%physics%wall_friction = config%wall_friction
      self%physics%h = self%config%time%step
      call self%problem%kernels%choose(config%dimension, scene%friction, scene%rotation)
      rule%largest_radius = scene%largest_radius
      rule%alert_distance = merge(config%alert_distance, 0.1_dp*scene%largest_radius, config%alert_given)
      rule%kind = merge(rule_primal, rule_dual, self%config%decomposition%kind == "primal")
    end associate
  end subroutine set_physics

  subroutine set_control(self)
    class(simulation_t), intent(inout) :: self

    associate (config => self%config)
      self%control%tolerance = config%solver%tolerance
      self%control%max_iterations = config%solver%max_iterations
      self%control%check_every = config%solver%check_every
      self%control%trace = config%output%trace
      self%column%count = config%scene%column_count
      self%column%unit_impulse = -config%scene%mass*config%scene%gravity(config%scene%dimension)*config%time%step
    end associate
  end subroutine set_control

  !> Divide space for the bodies given. Collective.
  subroutine divide(self, bodies, error)
    class(simulation_t), intent(inout) :: self
    type(body_set_t), intent(in) :: bodies(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: lower(self%decomposition%nd), upper(self%decomposition%nd), edge

    associate (config => self%config%decomposition, rule => self%decomposition%rule)
      call self%decomposition%bounding_box(bodies, lower, upper)
      edge = 2.0_dp*rule%largest_radius + rule%alert_distance
      ! without grains any edge serves
      if (.not. edge > 0.0_dp) edge = 1.0_dp
      call check_subdomains(lower, upper, edge, config%subdomains, error)
      if (.not. allocated(error)) call cut(self, bodies, lower, upper, edge, error)
    end associate
    if (allocated(error)) error%message = self%config%file//": "//error%message
    call self%comm%agree(error)
  end subroutine divide

  !> Divide space anew; where the scene has come to fill fewer cells than there are subdomains, the old partition
  !> stays. Collective.
  subroutine divide_again(self)
    class(simulation_t), intent(inout) :: self
    type(partition_t) :: old
    type(error_t), allocatable :: refused

    old = self%decomposition%partition
    call divide(self, self%decomposition%home, refused)
    if (allocated(refused)) self%decomposition%partition = old
  end subroutine divide_again

  !> Cut the box [lower, upper] as &decomposition says. Collective.
  subroutine cut(self, bodies, lower, upper, edge, error)
    class(simulation_t), intent(inout) :: self
    type(body_set_t), intent(in) :: bodies(:)
    !> (nd) [m]; edge of a detection cell [m]
    real(dp), intent(in) :: lower(:), upper(:), edge
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    integer :: boxes(3)

    associate (config => self%config%decomposition, partition => self%decomposition%partition)
      if (config%partition == "metis") then
        call list_centres(bodies, size(lower), points, weights)
        call partition%init_graph(self%comm, lower, upper, edge, points, weights, config%subdomains, error)
      else
        boxes(:) = config%grid
        if (any(boxes < 1)) boxes(:) = choose_boxes(lower, upper, config%subdomains)
        call partition%init_grid(lower, upper, boxes, edge, error)
      end if
    end associate
  end subroutine cut

  !> Centres of the grains [m], each of weight 1.
  subroutine list_centres(bodies, nd, points, weights)
    type(body_set_t), intent(in) :: bodies(:)
    integer, intent(in) :: nd
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: weights(:)
    integer :: s, n

    n = sum(bodies%n)
    allocate (points(nd, n))
    allocate (weights(n), source=1)
    n = 0
    do s = 1, size(bodies)
      points(:, n + 1:n + bodies(s)%n) = bodies(s)%position(:, 1:bodies(s)%n)
      n = n + bodies(s)%n
    end do
  end subroutine list_centres

  !> Move grains to q_m, bring each to its subdomain, detect the contacts and start them from the impulses of the
  !> last step. Collective.
  subroutine simulation_assemble(self, figures)
    class(simulation_t), intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    integer :: s, nd

    nd = self%decomposition%nd
    call start_timer(phase_bodies)
    do s = 1, size(self%decomposition%home)
      associate (home => self%decomposition%home(s))
        home%position(:, :) = predict_position(home%position, home%velocity(1:nd, :), self%physics%h, self%config%time%theta)
      end associate
    end do
    if (is_due(self)) call divide_again(self)
    call self%decomposition%settle()
    call stop_timer(phase_bodies)
    call build_problem(self%decomposition, self%problem%kernels, self%physics, self%problem, figures%sharing)
    call start_timer(phase_setup)
    if (self%config%solver%warm_start) call self%memory%recall(self%decomposition, self%problem)
    call stop_timer(phase_setup)
    figures%contacts = self%problem%n_contacts
    do s = 1, size(self%problem%sub)
      if (self%problem%sub(s)%n_contacts > 0) figures%max_overlap = max(figures%max_overlap, -minval(self%problem%sub(s)%gap))
    end do
    figures%max_overlap = self%comm%highest(figures%max_overlap)
  end subroutine simulation_assemble

  !> Whether this step starts from a new partition.
  pure logical function is_due(self)
    class(simulation_t), intent(in) :: self
    is_due = .false.
    if (self%config%decomposition%repartition_every > 0 .and. self%step > 0) &
      & is_due = mod(self%step, self%config%decomposition%repartition_every) == 0
  end function is_due

  !> One step. After a solve that diverged, velocities and places are not those of any step: the run must end.
  !> Collective.
  subroutine simulation_advance(self, figures, error)
    class(simulation_t), intent(inout) :: self
    type(step_figures_t), intent(out) :: figures
    type(error_t), allocatable, intent(inout) :: error
    integer :: s, nd

    if (allocated(error)) return
    call self%assemble(figures)
    if (self%config%solver%criterion == "error") then
      call solve_contacts(self%problem, self%scheme, self%control, figures%solve, error, self%column)
    else
      call solve_contacts(self%problem, self%scheme, self%control, figures%solve, error)
    end if
    self%messages = self%messages + self%problem%shared%messages
    self%values = self%values + self%problem%shared%values
    if (allocated(error) .or. figures%solve%status == solve_diverged) return
    call start_timer(phase_bodies)
    nd = self%decomposition%nd
    call take_velocities(self%decomposition, self%physics, self%problem)
    do s = 1, size(self%decomposition%home)
      associate (home => self%decomposition%home(s))
        home%position(:, :) = advance_position(home%position, home%velocity(1:nd, :), self%physics%h, self%config%time%theta)
      end associate
    end do
    if (self%config%solver%warm_start) call self%memory%keep(self%problem, self%decomposition%walls, &
      & self%decomposition%rule%kind, self%physics%h, self%config%time%theta)
    call stop_timer(phase_bodies)
    self%step = self%step + 1
    self%time = self%step*self%physics%h
    figures%kinetic_energy = self%kinetic_energy()
  end subroutine simulation_advance

  !> Kinetic energy of all grains [J]. Collective.
  real(dp) function simulation_kinetic_energy(self) result(energy)
    class(simulation_t), intent(in) :: self
    real(dp), allocatable :: part(:)
    integer :: s, k, nd

    nd = self%decomposition%nd
    allocate (part(size(self%decomposition%home)), source=0.0_dp)
    do s = 1, size(part)
      associate (home => self%decomposition%home(s))
        do k = 1, home%n
          part(s) = part(s) + 0.5_dp*home%mass(k)*sum(home%velocity(1:nd, k)**2) + &
            & 0.5_dp*home%inertia(k)*sum(home%velocity(nd + 1:, k)**2)
        end do
      end associate
    end do
    energy = self%comm%sum_real(part)
  end function simulation_kinetic_energy

  !> Give back what the method holds.
  subroutine simulation_free(self)
    class(simulation_t), intent(inout) :: self

    if (allocated(self%scheme)) then
      call self%scheme%free()
      deallocate (self%scheme)
    end if
    if (allocated(self%memory%records)) deallocate (self%memory%records)
  end subroutine simulation_free

end module gravier_simulation
