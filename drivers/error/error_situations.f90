!> True errors of the velocities of unfinished solves beside their estimates, in situations: how a solve starts, and after how many
!> iterations it is looked at.
module gravier_error_situations
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_timers, only: clock
  use gravier_communicator, only: communicator_t
  use gravier_random_hash, only: hash_uniform, hash_words
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_velocity_error, only: velocity_error_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_solve, only: solve_control_t, solve_report_t, solve_contacts, by_residual, by_velocity
  use gravier_config, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  implicit none
  private
  public :: plan_t, situation_t, row_t, measure_case
  public :: start_cold, start_lost, start_turned, start_loose

  !> impulses at the start: zero; converged with a share of them set to zero; converged before gravity turned; converged, and
  !> velocities of the grains drawn at random
  integer, parameter :: start_cold = 1, start_lost = 2, start_turned = 3, start_loose = 4

  type :: situation_t
    integer :: start = start_cold
    !> of contacts whose impulses are lost; angle by which gravity turns [degrees]; velocities over the velocity scale
    real(dp) :: amount = 0.0_dp
  end type situation_t

  !> What is measured of a case.
  type :: plan_t
    type(config_t) :: config
    type(situation_t), allocatable :: situations(:)
    !> iterations after which a solve is looked at, in ascending order
    integer, allocatable :: iterations(:)
    !> steps made before; of these, every so many is looked at after its solve, 0 for none
    integer :: steps = 0, every = 0
    !> the exact velocities are zero; otherwise those of a solve that goes on to a residual, or to so many iterations
    logical :: at_rest = .false.
    real(dp) :: tight = 1.0e-10_dp
    integer :: limit = 20000
    !> sweeps without momentum after these, where the residual is not reached
    integer :: sweeps = 20000
    !> solve by the program's own control, too, from zero impulses
    logical :: by_program = .false.
  end type plan_t

  !> The solve that takes the place of an exact solution.
  type :: reference_t
    real(dp) :: residual = 0.0_dp
    !> its own estimate, and how far its velocities have still gone in the second half of its sweeps [m/s]
    real(dp) :: estimate = 0.0_dp, spread = 0.0_dp
    integer :: iterations = 0
  end type reference_t

  !> One state that was looked at. Velocities are root mean squares over the mass of the grains in contact [m/s].
  type :: row_t
    character(len=:), allocatable :: situation
    !> step of the run, 0 for the solves after it; iterations made
    integer :: step = 0, iterations = 0
    real(dp) :: residual = 0.0_dp
    !> distance from the exact velocities, and its estimate
    real(dp) :: true_error = 0.0_dp, estimate = 0.0_dp
    !> what the estimate is made of, see gravier_velocity_error; negative where the solver has kept it to itself
    real(dp) :: projection = -1.0_dp, levels = -1.0_dp, bound = -1.0_dp
    integer :: depth = -1
    !> contacts relaxed over contacts, and seconds of the solve on this rank, without the time of looking at its states [s]
    real(dp) :: sweeps = 0.0_dp, seconds = 0.0_dp
    !> sweeps of a pass over layers, 0 without one, and whether the solve went on from it; of solves by the program
    real(dp) :: layered_sweeps = 0.0_dp
    logical :: layered = .false.
    !> all zero where the exact velocities are known
    type(reference_t) :: reference
    !> velocity that errors are compared with [m/s]; contacts, and mass of the grains in contact [kg]
    real(dp) :: scale = 0.0_dp, mass = 0.0_dp
    integer(i8) :: grains = 0, contacts = 0
  end type row_t

  !> Fields of all subdomains of this rank.
  type :: field_t
    !> (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable :: velocity(:, :)
    !> (lanes, nc, blocks) [N s]
    real(dp), allocatable :: impulse(:, :, :)
  end type field_t

  !> A solve from zero impulses, by name.
  character(len=*), parameter :: cold_text = "zero impulses"
  !> seed of what is random
  integer, parameter :: seed = 20
  !> sweeps between two residuals
  integer, parameter :: check_interval = 100
  !> solves for a time
  integer, parameter :: repetitions = 3
  !> states kept of the second half of the sweeps
  integer, parameter :: kept_states = 5
  !> an accuracy that no solve reaches: its limit of iterations ends it
  real(dp), parameter :: unreachable = tiny(1.0_dp)

contains

  !> Measure a case. Errors are the same on all ranks. Collective.
  subroutine measure_case(comm, plan, rows, error)
    type(communicator_t), target, intent(in) :: comm
    type(plan_t), intent(in) :: plan
    type(row_t), allocatable, intent(out) :: rows(:)
    type(error_t), allocatable, intent(inout) :: error
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures

    allocate (rows(0))
    call simulation%init(comm, plan%config, error)
    if (.not. allocated(error)) call make_steps(plan, simulation, rows, error)
    if (.not. allocated(error) .and. (plan%by_program .or. size(plan%situations) > 0)) then
      call simulation%assemble(figures)
      call measure_situations(plan, simulation, rows, error)
    end if
    call simulation%free()
  end subroutine measure_case

  !> The steps before, some of them looked at. Collective.
  subroutine make_steps(plan, simulation, rows, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(row_t), allocatable, intent(inout) :: rows(:)
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: figures
    type(field_t), allocatable :: reached(:)
    type(row_t) :: row
    integer :: k

    do k = 1, plan%steps
      call simulation%advance(figures, error)
      if (allocated(error)) return
      if (plan%every == 0) cycle
      if (mod(k, plan%every) > 0) cycle
      ! the program is done with this problem: it may be solved on
      call take_figures(simulation, row)
      row%situation = "in a run"
      row%step = k
      row%iterations = figures%solve%iterations
      row%residual = figures%solve%residual
      row%estimate = figures%solve%velocity_error
      call take_fields(simulation%problem, reached)
      call compare(plan, simulation, reached, row, error)
      if (allocated(error)) return
      call append(rows, row)
    end do
  end subroutine make_steps

  !> All situations of the step that is assembled. Collective.
  subroutine measure_situations(plan, simulation, rows, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(row_t), allocatable, intent(inout) :: rows(:)
    type(error_t), allocatable, intent(inout) :: error
    !> the free velocities of the step; its impulses and velocities when it is solved
    type(field_t), allocatable :: free(:), solved(:)
    type(reference_t) :: reference
    integer :: k, s

    allocate (free(size(simulation%problem%sub)))
    do s = 1, size(free)
      free(s)%velocity = simulation%problem%sub(s)%v_free
    end do
    if (plan%by_program) call solve_by_program(plan, simulation, rows, error)
    do k = 1, size(plan%situations)
      if (allocated(error)) return
      if (plan%situations(k)%start /= start_cold .and. .not. allocated(solved)) then
        call set_impulses(simulation%problem)
        call solve_tightly(plan, simulation, reference, error)
        call take_fields(simulation%problem, solved)
        if (allocated(error)) return
      end if
      call prepare(plan%situations(k), simulation, solved)
      call follow(plan, simulation, name_of(plan%situations(k)), rows, error)
      if (plan%situations(k)%start == start_cold) call take_fields(simulation%problem, solved)
      do s = 1, size(free)
        simulation%problem%sub(s)%v_free = free(s)%velocity
      end do
    end do
  end subroutine measure_situations

  !> As the tables have it.
  function name_of(situation) result(name)
    type(situation_t), intent(in) :: situation
    character(len=:), allocatable :: name

    select case (situation%start)
    case (start_lost)
      name = number_text(100.0_dp*situation%amount)//" % of the impulses lost"
    case (start_turned)
      name = "gravity turned by "//number_text(situation%amount)//" degrees"
    case (start_loose)
      name = "velocities of "//number_text(situation%amount)//" g h at random"
    case default
      name = cold_text
    end select
  end function name_of

  !> A whole number without decimals.
  function number_text(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text

    if (abs(value - nint(value)) <= 1.0e-9_dp*abs(value)) then
      text = to_text(nint(value))
    else
      text = to_text(value, 3)
    end if
  end function number_text

  !> Impulses and free velocities at the start of a situation.
  subroutine prepare(situation, simulation, solved)
    type(situation_t), intent(in) :: situation
    type(simulation_t), intent(inout) :: simulation
    !> not used from zero impulses
    type(field_t), allocatable, intent(in) :: solved(:)

    if (situation%start == start_cold) then
      call set_impulses(simulation%problem)
      return
    end if
    call set_impulses(simulation%problem, solved)
    select case (situation%start)
    case (start_lost)
      call lose_impulses(simulation%problem, situation%amount)
    case (start_turned)
      call turn_gravity(simulation, situation%amount)
    case default
      call stir(simulation%problem, situation%amount*scale_of(simulation))
    end select
  end subroutine prepare

  !> Impulses: those given, or zero.
  subroutine set_impulses(problem, fields)
    type(contact_problem_t), intent(inout) :: problem
    type(field_t), intent(in), optional :: fields(:)
    integer :: s

    do s = 1, size(problem%sub)
      if (present(fields)) then
        problem%sub(s)%impulse = fields(s)%impulse
      else
        problem%sub(s)%impulse(:, :, :) = 0.0_dp
      end if
    end do
  end subroutine set_impulses

  !> Set a share of the impulses to zero, chosen by the names of the bodies.
  subroutine lose_impulses(problem, share)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: share
    integer(i8) :: pair(2), name
    integer :: s, c

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          pair(1) = min(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
          pair(2) = max(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
          name = iand(hash_words(pair), shiftr(huge(1_i8), 1))
          if (hash_uniform(seed, name, 1) < share) sub%impulse(lane_of(c), :, block_of(c)) = 0.0_dp
        end do
      end associate
    end do
  end subroutine lose_impulses

  !> Turn gravity about an axis across the vertical one and x: free velocities of the grains get h (g' - g).
  subroutine turn_gravity(simulation, angle)
    type(simulation_t), intent(inout) :: simulation
    !> [degrees]
    real(dp), intent(in) :: angle
    real(dp) :: turned(3), radians
    integer :: s, b, nd

    nd = simulation%problem%kernels%nd
    radians = angle*acos(-1.0_dp)/180.0_dp
    associate (g => simulation%physics%gravity)
      turned(1:nd) = g(1:nd)
      turned(1) = cos(radians)*g(1) - sin(radians)*g(nd)
      turned(nd) = sin(radians)*g(1) + cos(radians)*g(nd)
      do s = 1, size(simulation%problem%sub)
        associate (sub => simulation%problem%sub(s))
          do b = 1, sub%n_grains
            sub%v_free(1:nd, b) = sub%v_free(1:nd, b) + simulation%physics%h*(turned(1:nd) - g(1:nd))
          end do
        end associate
      end do
    end associate
  end subroutine turn_gravity

  !> Add to the free velocity of each grain, along each axis, a number between -speed and speed.
  subroutine stir(problem, speed)
    type(contact_problem_t), intent(inout) :: problem
    !> [m/s]
    real(dp), intent(in) :: speed
    integer :: s, b, d

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          do d = 1, problem%kernels%nd
            sub%v_free(d, b) = sub%v_free(d, b) + speed*(2.0_dp*hash_uniform(seed, sub%id(b), d) - 1.0_dp)
          end do
        end do
      end associate
    end do
  end subroutine stir

  !> Iterate from the impulses that the problem holds, look at the state after each of the given numbers of iterations, and
  !> solve on to what it is compared with. Collective.
  subroutine follow(plan, simulation, name, rows, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    character(len=*), intent(in) :: name
    type(row_t), allocatable, intent(inout) :: rows(:)
    type(error_t), allocatable, intent(inout) :: error
    type(velocity_error_t) :: velocity
    type(row_t) :: seen(size(plan%iterations))
    type(reference_t) :: reference
    !> states that were looked at, one column of subdomains each
    type(field_t) :: states(size(simulation%problem%sub), size(plan%iterations))
    real(dp) :: jump, seconds, began
    integer :: k, n

    associate (problem => simulation%problem, method => simulation%method)
      call method%start(problem, error)
      if (allocated(error)) return
      call velocity%start(problem, 0.1_dp*problem%error_scale)
      seconds = 0.0_dp
      n = 1
      do k = 1, plan%iterations(size(plan%iterations))
        began = clock()
        call method%iterate(problem, .false., jump, error)
        if (allocated(error)) return
        seconds = seconds + clock() - began
        if (k == plan%iterations(n)) then
          call look(simulation, velocity, k, seen(n))
          seen(n)%situation = name
          seen(n)%sweeps = real(k*method%sweeps, dp)
          seen(n)%seconds = seconds
          call take_velocities(problem, states(:, n))
          n = n + 1
        end if
        call velocity%keep_copy(problem, method, k)
      end do
    end associate
    call solve_tightly(plan, simulation, reference, error)
    if (allocated(error)) return
    do n = 1, size(seen)
      if (.not. plan%at_rest) seen(n)%reference = reference
      seen(n)%true_error = distance(simulation%problem, states(:, n), velocity%mass, plan%at_rest)
      call append(rows, seen(n))
    end do
  end subroutine follow

  !> The whole estimate of a state, as a solve that ends there would have it. Collective.
  subroutine look(simulation, velocity, iterations, row)
    type(simulation_t), intent(inout) :: simulation
    type(velocity_error_t), intent(inout) :: velocity
    integer, intent(in) :: iterations
    type(row_t), intent(inout) :: row
    real(dp) :: defect

    call take_figures(simulation, row)
    row%iterations = iterations
    associate (problem => simulation%problem)
      call problem%evaluate()
      call velocity%assess(problem, simulation%method, iterations, row%residual, defect)
      row%bound = merge(velocity%bound_by_rest, -1.0_dp, problem%rest_is_admissible)
      row%mass = velocity%mass
      if (.not. row%residual > 0.0_dp) return
      ! a solve finds the depths when it asks for them
      velocity%levels%most_depth = -1
      call velocity%add_levels(problem)
      row%estimate = velocity%estimate()
      row%projection = velocity%projection
      row%levels = velocity%levels%error
      row%depth = velocity%levels%most_depth
    end associate
  end subroutine look

  !> What is known of a step before it is solved. Collective.
  subroutine take_figures(simulation, row)
    type(simulation_t), intent(inout) :: simulation
    type(row_t), intent(inout) :: row

    row%scale = scale_of(simulation)
    row%grains = simulation%n_grains
    row%contacts = simulation%problem%n_contacts
  end subroutine take_figures

  !> g h; without gravity the root mean square velocity that bodies would have without contacts [m/s]. Collective.
  real(dp) function scale_of(simulation) result(scale)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: parts(1, size(simulation%problem%sub)), sums(1)
    integer :: s

    scale = norm2(simulation%physics%gravity)*simulation%physics%h
    if (scale > 0.0_dp) return
    do s = 1, size(simulation%problem%sub)
      associate (sub => simulation%problem%sub(s))
        parts(1, s) = sub%product_of(sub%v_free, sub%v_free)
      end associate
    end do
    call simulation%problem%comm%sum_parts(parts, sums)
    scale = sqrt(sums(1)/mass_of(simulation%problem))
  end function scale_of

  !> Mass of the grains in contact, each counted once [kg]. Collective.
  real(dp) function mass_of(problem) result(mass)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: parts(1, size(problem%sub)), sums(1)
    integer :: s, b

    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          parts(1, s) = parts(1, s) + 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    mass = sums(1)
  end function mass_of

  !> Copy impulses and velocities.
  subroutine take_fields(problem, fields)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), allocatable, intent(inout) :: fields(:)
    integer :: s

    if (.not. allocated(fields)) allocate (fields(size(problem%sub)))
    do s = 1, size(problem%sub)
      fields(s)%impulse = problem%sub(s)%impulse
      fields(s)%velocity = problem%sub(s)%v_global
    end do
  end subroutine take_fields

  subroutine take_velocities(problem, fields)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), intent(inout) :: fields(:)
    integer :: s

    do s = 1, size(problem%sub)
      fields(s)%velocity = problem%sub(s)%v_global
    end do
  end subroutine take_velocities

  !> Solve on from where the problem is, as tightly as the plan says; v_global is that of the solution then. Where friction makes
  !> momentum run in circles, sweeps without it follow. Collective.
  subroutine solve_tightly(plan, simulation, reference, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(reference_t), intent(out) :: reference
    type(error_t), allocatable, intent(inout) :: error
    type(solve_control_t) :: control
    type(solve_report_t) :: report

    control%criterion = by_residual
    control%tolerance = plan%tight
    control%max_iterations = plan%limit
    control%check_every = check_interval
    control%layered = .false.
    call solve_contacts(simulation%problem, simulation%method, control, report, error)
    reference%residual = report%residual
    reference%estimate = report%velocity_error
    reference%iterations = report%iterations
    if (.not. (allocated(error) .or. plan%sweeps == 0 .or. report%residual <= plan%tight)) &
      & call sweep_on(plan, simulation, reference, error)
  end subroutine solve_tightly

  !> Sweeps without momentum from where the problem is. How far velocities still go in the second half of them tells how well
  !> the solution is known, without the estimate that is judged by it. Collective.
  subroutine sweep_on(plan, simulation, reference, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(reference_t), intent(inout) :: reference
    type(error_t), allocatable, intent(inout) :: error
    type(velocity_error_t) :: velocity
    type(field_t) :: states(size(simulation%problem%sub), kept_states)
    type(row_t) :: row
    real(dp) :: jump
    integer :: k, n
    logical :: accelerated

    associate (problem => simulation%problem, method => simulation%method)
      accelerated = method%momentum%on
      method%momentum%on = .false.
      call method%start(problem, error)
      if (.not. allocated(error)) call velocity%start(problem, 0.1_dp*problem%error_scale)
      n = 0
      do k = 1, plan%sweeps
        call method%iterate(problem, .false., jump, error)
        if (allocated(error)) exit
        if (mod(k, check_interval) == 0 .or. k == plan%sweeps) then
          call look(simulation, velocity, k, row)
          if (row%residual <= plan%tight) exit
          if (2*k > plan%sweeps .and. n < kept_states .and. k >= plan%sweeps/2 + n*plan%sweeps/(2*kept_states)) then
            n = n + 1
            call take_velocities(problem, states(:, n))
          end if
        end if
        call velocity%keep_copy(problem, method, k)
      end do
      method%momentum%on = accelerated
      if (allocated(error)) return
      reference%residual = row%residual
      reference%estimate = row%estimate
      reference%iterations = reference%iterations + min(k, plan%sweeps)
      reference%spread = 0.0_dp
      if (row%residual <= plan%tight) return
      do k = 1, n
        reference%spread = max(reference%spread, distance(problem, states(:, k), velocity%mass, at_rest=.false.))
      end do
    end associate
  end subroutine sweep_on

  !> The error of a state against the solution that is found by going on from it. Collective.
  subroutine compare(plan, simulation, reached, row, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(field_t), intent(in) :: reached(:)
    type(row_t), intent(inout) :: row
    type(error_t), allocatable, intent(inout) :: error

    row%mass = mass_of(simulation%problem)
    if (.not. plan%at_rest) call solve_tightly(plan, simulation, row%reference, error)
    if (allocated(error)) return
    row%true_error = distance(simulation%problem, reached, row%mass, plan%at_rest)
  end subroutine compare

  !> |V - V*|_M over the root of the mass, V* being v_global of the problem, or rest [m/s]. Collective.
  real(dp) function distance(problem, state, mass, at_rest)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), intent(in) :: state(:)
    real(dp), intent(in) :: mass
    logical, intent(in) :: at_rest
    real(dp) :: parts(1, size(state)), sums(1)
    real(dp), allocatable :: difference(:, :)
    integer :: s

    do s = 1, size(state)
      allocate (difference, source=state(s)%velocity)
      if (.not. at_rest) difference(:, :) = difference - problem%sub(s)%v_global
      parts(1, s) = problem%sub(s)%product_of(difference, difference)
      deallocate (difference)
    end do
    call problem%comm%sum_parts(parts, sums)
    distance = 0.0_dp
    if (mass > 0.0_dp) distance = sqrt(sums(1)/mass)
  end function distance

  !> The least seconds of some repetitions of the solve by the program from zero impulses: other work of the machine only adds to
  !> them. Collective.
  subroutine time_again(simulation, seconds, error)
    type(simulation_t), intent(inout) :: simulation
    !> of the solve made, in; the least, out [s]
    real(dp), intent(inout) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    type(solve_report_t) :: report
    integer :: k

    do k = 1, repetitions
      call set_impulses(simulation%problem)
      call solve_contacts(simulation%problem, simulation%method, simulation%control, report, error, simulation%exact)
      if (allocated(error)) return
      seconds = min(seconds, report%seconds)
    end do
  end subroutine time_again

  subroutine append(rows, row)
    type(row_t), allocatable, intent(inout) :: rows(:)
    type(row_t), intent(in) :: row
    type(row_t), allocatable :: longer(:)
    integer :: k

    allocate (longer(size(rows) + 1))
    do k = 1, size(rows)
      longer(k) = rows(k)
    end do
    longer(size(longer)) = row
    call move_alloc(longer, rows)
  end subroutine append

  !> Solves from zero impulses by the program's own control: with each of the limits of iterations, and until it ends by itself.
  !> What the program does besides iterations is in them. Collective.
  subroutine solve_by_program(plan, simulation, rows, error)
    type(plan_t), intent(in) :: plan
    type(simulation_t), intent(inout) :: simulation
    type(row_t), allocatable, intent(inout) :: rows(:)
    type(error_t), allocatable, intent(inout) :: error
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(reference_t) :: reference
    type(row_t) :: seen(size(plan%iterations) + 1)
    type(field_t) :: states(size(simulation%problem%sub), size(plan%iterations) + 1)
    integer(i8) :: relaxed
    integer :: k

    do k = 1, size(seen)
      control = simulation%control
      seen(k)%situation = cold_text//", where the program ends it"
      if (k <= size(plan%iterations)) then
        control%criterion = by_velocity
        control%accuracy = unreachable
        control%max_iterations = plan%iterations(k)
        seen(k)%situation = cold_text//", by the program"
      end if
      call set_impulses(simulation%problem)
      relaxed = simulation%method%work%relaxations
      call solve_contacts(simulation%problem, simulation%method, control, report, error, simulation%exact)
      if (allocated(error)) return
      seen(k)%sweeps = real(simulation%method%work%relaxations - relaxed, dp)/max(1_i8, simulation%problem%n_contacts)
      if (k == size(seen)) call time_again(simulation, report%seconds, error)
      if (allocated(error)) return
      call take_figures(simulation, seen(k))
      seen(k)%mass = mass_of(simulation%problem)
      seen(k)%iterations = report%iterations
      seen(k)%residual = report%residual
      seen(k)%estimate = report%velocity_error
      seen(k)%layered_sweeps = report%layered_sweeps
      seen(k)%layered = report%layered
      seen(k)%seconds = report%seconds
      call take_velocities(simulation%problem, states(:, k))
    end do
    call solve_tightly(plan, simulation, reference, error)
    if (allocated(error)) return
    do k = 1, size(seen)
      if (.not. plan%at_rest) seen(k)%reference = reference
      seen(k)%true_error = distance(simulation%problem, states(:, k), seen(k)%mass, plan%at_rest)
      call append(rows, seen(k))
    end do
  end subroutine solve_by_program

end module gravier_error_situations
