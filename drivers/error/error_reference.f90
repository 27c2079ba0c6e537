!> What a state is judged by: its whole estimate, and the solve from it that goes on until it takes the place of an exact solution.
module gravier_error_reference
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_velocity_error, only: velocity_error_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, by_residual
  use gravier_simulation, only: simulation_t
  use gravier_error_plan, only: plan_t, reference_t, row_t
  use gravier_error_fields, only: field_t, take_velocities, scale_of, mass_of, distance
  implicit none
  private
  public :: take_figures, look, solve_tightly, compare

  !> sweeps between two residuals
  integer, parameter :: check_interval = 100
  !> states kept of the second half of the sweeps
  integer, parameter :: kept_states = 5

contains

  !> What is known of a step before it is solved. Collective.
  subroutine take_figures(simulation, row)
    type(simulation_t), intent(inout) :: simulation
    type(row_t), intent(inout) :: row

    row%scale = scale_of(simulation)
    row%grains = simulation%n_grains
    row%contacts = simulation%problem%n_contacts
  end subroutine take_figures

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
      call velocity%add_levels(problem, simulation%method)
      row%estimate = velocity%estimate()
      row%projection = velocity%projection
      row%levels = velocity%levels%error
      row%depth = velocity%levels%most_depth
    end associate
  end subroutine look

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

  !> Plain sweeps from where the problem is. How far velocities still go in the second half of them tells how well
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
      accelerated = method%acceleration%on
      method%acceleration%on = .false.
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
        call velocity%tests%keep_copy(problem, method, k)
      end do
      method%acceleration%on = accelerated
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

end module gravier_error_reference
