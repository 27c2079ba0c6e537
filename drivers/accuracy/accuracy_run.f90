!> One case of a study: a run from its start to its end in memory, and what is kept of it; or one solve, check by check.
module gravier_accuracy_run
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: clock
  use gravier_config, only: config_t
  use gravier_solve_report, only: solve_report_t, solve_converged, solve_diverged
  use gravier_mean_stress, only: mean_stress_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_accuracy_motion, only: state_t, take_state, unknown
  use gravier_accuracy_study, only: text_t
  implicit none
  private
  public :: run_t, run_case_in_memory, solve_first_step, find_quantities

  !> What is kept of a run; the same on every rank but for states.
  type :: run_t
    type(config_t) :: config
    integer(i8) :: grains = 0, contacts = 0, iterations = 0
    integer :: subdomains = 1
    !> steps made; solves that missed their tolerance
    integer :: steps = 0, failed = 0
    logical :: diverged = .false.
    !> largest figure that the tolerance is compared with at the end of a solve; largest overlap [m]
    real(dp) :: residual = 0.0_dp, overlap = 0.0_dp
    !> [m]
    real(dp) :: mean_radius = 0.0_dp
    !> of the impulses in the last step, relative, where they are known
    real(dp) :: force_error = unknown
    !> of all solves, of all steps, the most of the ranks [s]
    real(dp) :: solve_seconds = 0.0_dp, run_seconds = 0.0_dp
    !> means over the steps: of quantities, of the mean stress (nd, nd) [Pa, N/m in 2D]
    real(dp), allocatable :: means(:), stress(:, :)
    !> at equal distances in time, the last one at the end (samples); none after a solve that diverged
    type(state_t), allocatable :: states(:)
  end type run_t

contains

  !> Run a case. Errors are the same on all ranks. Collective.
  subroutine run_case_in_memory(comm, config, samples, quantities, run, error)
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    !> instants at which states are kept
    integer, intent(in) :: samples
    type(text_t), intent(in) :: quantities(:)
    type(run_t), intent(out) :: run
    type(error_t), allocatable, intent(inout) :: error
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures

    call start_measured(comm, config, simulation, error)
    if (.not. allocated(error)) call make_steps(simulation, figures, samples, quantities, run, error)
    if (allocated(error)) return
    run%config = config
    run%subdomains = simulation%decomposition%n_subdomains
    run%grains = simulation%n_grains
    run%contacts = figures%contacts
    run%mean_radius = simulation%decomposition%rule%mean_radius
    run%failed = narrow(simulation%failed)
    run%residual = simulation%tally%worst_residual
    run%overlap = max(simulation%tally%start_overlap, simulation%tally%later_overlap)
    run%iterations = simulation%effort%iterations
    run%solve_seconds = comm%highest(simulation%effort%seconds)
    run%run_seconds = comm%highest(run%run_seconds)
    if (config%scene%bodies == "column" .and. .not. run%diverged) run%force_error = simulation%exact%error(simulation%problem)
    call simulation%free()
  end subroutine run_case_in_memory

  !> Make a scene whose diagnostics have what is compared. Collective.
  subroutine start_measured(comm, config, simulation, error)
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    type(simulation_t), intent(inout) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: measured

    measured = config
    call measured%output%ask("stress")
    call measured%output%ask("boundary_forces")
    measured%output%trace = .false.
    call simulation%init(comm, measured, error)
  end subroutine start_measured

  !> Collective.
  subroutine make_steps(simulation, figures, samples, quantities, run, error)
    type(simulation_t), intent(inout) :: simulation
    !> of the last step
    type(step_figures_t), intent(out) :: figures
    integer, intent(in) :: samples
    type(text_t), intent(in) :: quantities(:)
    type(run_t), intent(inout) :: run
    type(error_t), allocatable, intent(inout) :: error
    integer :: places(size(quantities)), every, q
    real(dp) :: start

    call find_quantities(simulation, quantities, places)
    allocate (run%means(size(quantities)), source=0.0_dp)
    allocate (run%states(samples))
    every = simulation%config%time%steps/samples
    do while (run%steps < simulation%config%time%steps)
      call simulation%comm%barrier()
      start = clock()
      call simulation%advance(figures, error)
      run%run_seconds = run%run_seconds + clock() - start
      if (allocated(error)) return
      run%diverged = figures%solve%status == solve_diverged
      if (run%diverged) exit
      run%steps = run%steps + 1
      do q = 1, size(quantities)
        run%means(q) = run%means(q) + quantity(simulation, figures, places(q))
      end do
      call add_stress(simulation, run%stress)
      if (mod(run%steps, every) == 0) call take_state(simulation, run%states(run%steps/every))
    end do
    if (run%diverged) then
      deallocate (run%states)
      allocate (run%states(0))
    end if
    if (run%steps == 0) return
    run%means(:) = run%means/run%steps
    run%stress(:, :) = run%stress/run%steps
  end subroutine make_steps

  !> Add the mean stress of the last step; the sum begins with the first one.
  subroutine add_stress(simulation, total)
    type(simulation_t), intent(in) :: simulation
    !> (nd, nd) [Pa, N/m in 2D]
    real(dp), allocatable, intent(inout) :: total(:, :)

    associate (diagnostics => simulation%diagnostics)
      select type (measured => diagnostics%asked(diagnostics%place("stress"))%diagnostic)
      type is (mean_stress_t)
        if (.not. allocated(total)) then
          allocate (total, mold=measured%stress)
          total(:, :) = 0.0_dp
        end if
        total(:, :) = total + measured%stress
      end select
    end associate
  end subroutine add_stress

  !> Where quantities are: columns of the diagnostics, or negative for figures of the step; 0 for what there is not.
  subroutine find_quantities(simulation, quantities, places)
    type(simulation_t), intent(in) :: simulation
    type(text_t), intent(in) :: quantities(:)
    integer, intent(out) :: places(:)
    integer :: q, k

    places(:) = 0
    do q = 1, size(quantities)
      if (quantities(q)%text == "kinetic_energy") places(q) = -1
      if (quantities(q)%text == "max_overlap") places(q) = -2
      if (quantities(q)%text == "contacts") places(q) = -3
      do k = 1, simulation%diagnostics%n_columns
        if (simulation%diagnostics%name(k) == quantities(q)%text) places(q) = k
      end do
    end do
  end subroutine find_quantities

  pure real(dp) function quantity(simulation, figures, place)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    integer, intent(in) :: place

    select case (place)
    case (-1)
      quantity = figures%kinetic_energy
    case (-2)
      quantity = figures%max_overlap
    case (-3)
      quantity = real(figures%contacts, dp)
    case default
      quantity = simulation%diagnostics%value(place)
    end select
  end function quantity

  !> The solve of the first step, with the trace of every check. Collective.
  subroutine solve_first_step(comm, config, run, report, error)
    type(communicator_t), target, intent(in) :: comm
    type(config_t), intent(in) :: config
    type(run_t), intent(out) :: run
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(config_t) :: traced

    traced = config
    traced%output%trace = .true.
    call simulation%init(comm, traced, error)
    if (.not. allocated(error)) call simulation%advance(figures, error)
    if (allocated(error)) return
    report = figures%solve
    run%config = config
    run%subdomains = simulation%decomposition%n_subdomains
    run%grains = simulation%n_grains
    run%contacts = figures%contacts
    run%steps = 1
    run%iterations = report%iterations
    run%residual = report%residual
    run%solve_seconds = report%seconds
    run%diverged = report%status == solve_diverged
    run%failed = merge(0, 1, report%status == solve_converged)
    call simulation%free()
  end subroutine solve_first_step

end module gravier_accuracy_run
