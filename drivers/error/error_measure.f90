!> True errors of the velocities of unfinished solves beside their estimates, in situations: how a solve starts, and after how many
!> iterations it is looked at.
module gravier_error_measure
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_timers, only: clock
  use gravier_communicator, only: communicator_t
  use gravier_velocity_error, only: velocity_error_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_velocity
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_error_plan, only: plan_t, reference_t, row_t, start_cold
  use gravier_error_fields, only: field_t, set_impulses, take_fields, take_velocities, mass_of, distance
  use gravier_error_situations, only: cold_text, name_of, prepare
  use gravier_error_reference, only: take_figures, look, solve_tightly, compare
  implicit none
  private
  public :: measure_case

  !> solves for a time
  integer, parameter :: repetitions = 3
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
        call velocity%tests%keep_copy(problem, method, k)
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

end module gravier_error_measure
