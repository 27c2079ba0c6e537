!> Wall-clock timers of the phases of a run, one set per process. A phase may start within another: the time is that of the
!> innermost one alone, so that the phases add up to no more than the run.
module gravier_timers
  use mpi_f08, only: MPI_Wtime, MPI_Allreduce, MPI_DOUBLE_PRECISION, MPI_SUM, MPI_MIN, MPI_MAX
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: clock, start_timer, stop_timer, reset_timers, gather_timers, phase_names, n_phases
  public :: phase_bodies, phase_neighbourhood, phase_detection, phase_interface, phase_setup, phase_sweep, phase_exchange, &
    & phase_interface_solve, phase_factorise, phase_check, phase_reduction, phase_projection, phase_diagnostics, &
    & phase_output

  integer, parameter :: phase_bodies = 1, phase_neighbourhood = 2, phase_detection = 3, phase_interface = 4, phase_setup = 5, &
    & phase_sweep = 6, phase_exchange = 7, phase_factorise = 8, phase_interface_solve = 9, phase_check = 10, &
    & phase_reduction = 11, phase_projection = 12, phase_diagnostics = 13, phase_output = 14
  integer, parameter :: n_phases = 14
  !> what the log calls the phases
  character(len=28), parameter :: phase_names(n_phases) = [character(len=28) :: "motion and migration", &
    & "neighbour lists and ghosts", "detection of contacts", "interface: shared bodies", &
    & "set-up of the solve", "sweeps", "exchange", "factorisation", "interface solve", "residual checks", &
    & "reductions of the solve", &
    & "projection of overlaps", "diagnostics and regions", "output"]

  real(dp) :: elapsed(n_phases) = 0.0_dp
  !> phases under way, the innermost last, and since when it is the innermost
  integer, parameter :: deepest = 16
  integer :: under_way(deepest) = 0, depth = 0
  real(dp) :: since = 0.0_dp

contains

  !> Seconds on the clock of this rank.
  real(dp) function clock()
    clock = MPI_Wtime()
  end function clock

  subroutine start_timer(phase)
    integer, intent(in) :: phase

    call take_time()
    depth = depth + 1
    under_way(depth) = phase
  end subroutine start_timer

  !> End a phase, and those within it that an error has left.
  subroutine stop_timer(phase)
    integer, intent(in) :: phase

    call take_time()
    do while (depth > 0)
      depth = depth - 1
      if (under_way(depth + 1) == phase) exit
    end do
  end subroutine stop_timer

  !> Count the time until now for the innermost phase.
  subroutine take_time()
    real(dp) :: now

    now = MPI_Wtime()
    if (depth > 0) elapsed(under_way(depth)) = elapsed(under_way(depth)) + (now - since)
    since = now
  end subroutine take_time

  subroutine reset_timers()
    elapsed(:) = 0.0_dp
    depth = 0
  end subroutine reset_timers

  !> Mean, least and most seconds of each phase over the ranks. Collective.
  subroutine gather_timers(comm, mean, least, most)
    type(communicator_t), intent(in) :: comm
    !> (n_phases) [s]
    real(dp), intent(out) :: mean(n_phases), least(n_phases), most(n_phases)

    call MPI_Allreduce(elapsed, mean, n_phases, MPI_DOUBLE_PRECISION, MPI_SUM, comm%mpi)
    call MPI_Allreduce(elapsed, least, n_phases, MPI_DOUBLE_PRECISION, MPI_MIN, comm%mpi)
    call MPI_Allreduce(elapsed, most, n_phases, MPI_DOUBLE_PRECISION, MPI_MAX, comm%mpi)
    mean(:) = mean/comm%size
  end subroutine gather_timers

end module gravier_timers
