!> A dense scene that is stepped again and again from the same state, and the parts of its step.
module gravier_bench_scene
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: reset_timers, gather_timers, n_phases, phase_bodies, phase_neighbourhood, phase_detection, &
    & phase_interface, phase_setup, phase_sweep, phase_exchange, phase_interface_solve, phase_factorise, phase_check, &
    & phase_reduction
  use gravier_nscdd, only: average_copies
  use gravier_method, only: work_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_report_t
  use gravier_file_system, only: make_directory, remove_directory
  use gravier_own_files, only: remove_own
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: of_states
  use gravier_run_output, only: run_output_t
  use gravier_bench_packing, only: packing_t, make_simulation, reset_grains
  use gravier_bench_record, only: record_t, case_t
  implicit none
  private
  public :: bench_scene_t, step_times_t

  type :: bench_scene_t
    type(packing_t) :: packing
    type(simulation_t) :: simulation
    !> of the step taken last
    type(step_figures_t) :: figures
    type(case_t) :: of
  contains
    procedure :: init => bench_scene_init
    procedure :: measure_lists => bench_scene_measure_lists
    procedure :: measure_detection => bench_scene_measure_detection
    procedure :: measure_step => bench_scene_measure_step
    procedure :: measure_output => bench_scene_measure_output
    procedure :: measure_exchange => bench_scene_measure_exchange
    procedure :: measure_interface => bench_scene_measure_interface
    procedure :: unknowns => bench_scene_unknowns
  end type bench_scene_t

  !> [s]
  type :: step_times_t
    real(dp) :: step = 0.0_dp, solve = 0.0_dp
  end type step_times_t

contains

  !> Make the scene and take its first step. Errors are the same on all ranks of `comm`. Collective over them, as everything
  !> here.
  subroutine bench_scene_init(self, packing, comm, group, name, error)
    class(bench_scene_t), intent(inout) :: self
    type(packing_t), intent(in) :: packing
    type(communicator_t), target, intent(in) :: comm
    character(len=*), intent(in) :: group, name
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%packing = packing
    self%of = case_t(group, name, packing%grains(), comm%size)
    call make_simulation(packing, comm, self%simulation, error)
    call self%simulation%advance(self%figures, error)
  end subroutine bench_scene_init

  !> Make the neighbour lists anew; their impulses are lost, so that the next step starts without.
  subroutine bench_scene_measure_lists(self, record, seconds)
    class(bench_scene_t), intent(inout) :: self
    type(record_t), intent(inout) :: record
    !> [s]
    real(dp), intent(out) :: seconds
    real(dp) :: start

    associate (simulation => self%simulation)
      call reset_grains(self%packing, simulation, middle=.true.)
      call simulation%comm%barrier()
      start = MPI_Wtime()
      call simulation%halo%build(simulation%decomposition)
      call simulation%comm%barrier()
    end associate
    seconds = MPI_Wtime() - start
    call record%note(self%of, "list_build", "s/grain", seconds/real(self%packing%grains(), dp))
  end subroutine bench_scene_measure_lists

  !> What finding the contacts of a step and packing them takes, with lists that hold.
  subroutine bench_scene_measure_detection(self, record)
    class(bench_scene_t), intent(inout) :: self
    type(record_t), intent(inout) :: record
    real(dp) :: mean(n_phases), least(n_phases), most(n_phases), grains

    call reset_grains(self%packing, self%simulation, middle=.false.)
    call reset_timers()
    call self%simulation%assemble(self%figures)
    call gather_timers(self%simulation%comm, mean, least, most)
    grains = real(self%packing%grains(), dp)
    call record%note(self%of, "list_check_and_ghosts", "s/grain", mean(phase_neighbourhood)/grains)
    call record%note(self%of, "contact_search", "s/grain", mean(phase_detection)/grains)
    call record%note(self%of, "contact_packing", "s/grain", mean(phase_setup)/grains)
    call record%note(self%of, "interface_search", "s/grain", mean(phase_interface)/grains)
  end subroutine bench_scene_measure_detection

  !> A step from the state of the start, by phases, and its solve once more from the impulses that it found.
  subroutine bench_scene_measure_step(self, record, times, error)
    class(bench_scene_t), intent(inout) :: self
    type(record_t), intent(inout) :: record
    type(step_times_t), intent(out) :: times
    type(error_t), allocatable, intent(inout) :: error
    type(solve_report_t) :: report
    real(dp) :: mean(n_phases), least(n_phases), most(n_phases), start, lists

    call self%measure_lists(record, lists)
    associate (simulation => self%simulation)
      call reset_grains(self%packing, simulation, middle=.false.)
      call reset_timers()
      call simulation%comm%barrier()
      start = MPI_Wtime()
      call simulation%advance(self%figures, error)
      call simulation%comm%barrier()
      times%step = MPI_Wtime() - start
      if (allocated(error)) return
      call gather_timers(simulation%comm, mean, least, most)
      start = MPI_Wtime()
      call solve_contacts(simulation%problem, simulation%method, simulation%control, report, error)
      call simulation%comm%barrier()
      times%solve = MPI_Wtime() - start
    end associate
    call record%note(self%of, "contacts", "1", real(self%figures%contacts, dp))
    call record%note(self%of, "iterations", "1", real(report%iterations, dp))
    call record%note(self%of, "step", "s", times%step)
    call record%note(self%of, "solve", "s", times%solve)
    call record%note(self%of, "solve_per_contact_iteration", "s", &
      & times%solve/(real(self%figures%contacts, dp)*report%iterations))
    call note_shares(self%of, mean, times%step, record)
    call record%note(self%of, "list_build_over_step", "1", lists/times%step)
  end subroutine bench_scene_measure_step

  !> Shares of a step, mean of the ranks; what waits for another rank is where it waits.
  subroutine note_shares(of, mean, step, record)
    type(case_t), intent(in) :: of
    !> (n_phases), [s]
    real(dp), intent(in) :: mean(:), step
    type(record_t), intent(inout) :: record

    call record%note(of, "share_sweeps", "1", mean(phase_sweep)/step)
    call record%note(of, "share_exchange", "1", (mean(phase_exchange) + mean(phase_interface_solve) + mean(phase_factorise))/step)
    call record%note(of, "share_checks", "1", mean(phase_check)/step)
    call record%note(of, "share_reductions", "1", mean(phase_reduction)/step)
    call record%note(of, "share_detection", "1", mean(phase_detection)/step)
    call record%note(of, "share_lists_and_ghosts", "1", mean(phase_neighbourhood)/step)
    call record%note(of, "share_setup", "1", (mean(phase_setup) + mean(phase_interface))/step)
    call record%note(of, "share_bodies", "1", mean(phase_bodies)/step)
    call record%note(of, "share_rest", "1", max(0.0_dp, 1.0_dp - sum(mean)/step))
  end subroutine note_shares

  !> Write the state as a run does, to a directory that is removed.
  subroutine bench_scene_measure_output(self, directory, step, record, error)
    class(bench_scene_t), intent(inout) :: self
    character(len=*), intent(in) :: directory
    !> what the step took [s]
    real(dp), intent(in) :: step
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(run_output_t) :: output
    type(step_figures_t) :: none
    real(dp) :: start, seconds

    if (allocated(error)) return
    if (self%simulation%comm%rank == 0) call make_directory(directory, error)
    call self%simulation%comm%agree(error)
    if (allocated(error)) return
    self%simulation%config%output%directory = directory
    call output%open(self%simulation, "gravier_bench", error)
    start = MPI_Wtime()
    if (.not. allocated(error)) call output%write(of_states, self%simulation, none, 0.0_dp, error, always=.true.)
    seconds = MPI_Wtime() - start
    call output%finish(self%simulation, .false., error)
    if (self%simulation%comm%rank == 0) then
      call remove_own(directory//"/results.h5")
      call remove_own(directory//"/history.csv")
      call remove_directory(directory)
    end if
    call record%note(self%of, "write_state", "s", seconds)
    call record%note(self%of, "write_state_over_step", "1", seconds/step)
  end subroutine bench_scene_measure_output

  !> One exchange between the copies of shared bodies, as NSCDD makes it.
  subroutine bench_scene_measure_exchange(self, seconds, record)
    class(bench_scene_t), intent(inout) :: self
    !> [s]
    real(dp), intent(in) :: seconds
    type(record_t), intent(inout) :: record
    real(dp) :: start, one
    integer(i8) :: sent(2)
    integer :: k, n

    associate (problem => self%simulation%problem, comm => self%simulation%comm)
      call comm%barrier()
      start = MPI_Wtime()
      call average_copies(problem)
      one = comm%highest(MPI_Wtime() - start)
      ! the same on all ranks
      n = max(1, min(1000000, nint(seconds/max(one, 1.0e-7_dp))))
      sent(1) = problem%shared%messages
      sent(2) = problem%shared%values
      call comm%barrier()
      start = MPI_Wtime()
      do k = 1, n
        call average_copies(problem)
      end do
      call comm%barrier()
      one = (MPI_Wtime() - start)/n
      sent(1) = (problem%shared%messages - sent(1))/n
      sent(2) = (problem%shared%values - sent(2))/n
      call comm%sum_counts(sent)
      call record%note(self%of, "exchange", "s", one)
      call record%note(self%of, "shared_bodies", "1", real(self%figures%interface_statistics%bodies, dp))
      call record%note(self%of, "copies_values", "1", real(self%figures%interface_statistics%values, dp))
      call record%note(self%of, "seconds_per_value", "s", one/self%figures%interface_statistics%values)
      if (comm%size == 1) return
      call record%note(self%of, "messages_between_ranks", "1", real(sent(1), dp))
      call record%note(self%of, "values_between_ranks", "1", real(sent(2), dp))
    end associate
  end subroutine bench_scene_measure_exchange

  !> Factors and solves of the interface problem of NSCDD-EP, from one step.
  subroutine bench_scene_measure_interface(self, record, error)
    class(bench_scene_t), intent(inout) :: self
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(work_t) :: before, after
    real(dp) :: mean(n_phases), least(n_phases), most(n_phases)

    before = self%simulation%method%work_done()
    call reset_grains(self%packing, self%simulation, middle=.false.)
    call reset_timers()
    call self%simulation%advance(self%figures, error)
    if (allocated(error)) return
    call gather_timers(self%simulation%comm, mean, least, most)
    after = self%simulation%method%work_done()
    call record%note(self%of, "factorisation", "s", mean(phase_factorise))
    call record%note(self%of, "interface_solve", "s", &
      & mean(phase_interface_solve)/real(after%interface_solves - before%interface_solves, dp))
    if (self%packing%interface == "cg") call record%note(self%of, "iterations", "1", &
      & real(after%interface_iterations - before%interface_iterations, dp)/ &
      & real(after%interface_solves - before%interface_solves, dp))
  end subroutine bench_scene_measure_interface

  !> Unknowns of the interface problem: a body of multiplicity m gives m - 1 times its degrees of freedom.
  pure integer(i8) function bench_scene_unknowns(self) result(n)
    class(bench_scene_t), intent(in) :: self
    integer :: m

    n = 0
    do m = 2, size(self%figures%interface_statistics%multiplicity)
      n = n + (m - 1)*self%figures%interface_statistics%multiplicity(m)
    end do
    n = n*self%simulation%problem%nv
  end function bench_scene_unknowns

end module gravier_bench_scene
