!> Wall-clock timers of the phases of a run, one set per process.
module gravier_timers
  use mpi_f08, only: MPI_Wtime, MPI_Allreduce, MPI_DOUBLE_PRECISION, MPI_SUM, MPI_MIN, MPI_MAX
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: clock, start_timer, stop_timer, reset_timers, gather_timers, phase_names, n_phases
  public :: phase_bodies, phase_neighbourhood, phase_detection, phase_interface, phase_setup, phase_sweep, phase_exchange, &
    & phase_interface_solve, phase_factorise, phase_check, phase_projection, phase_output

  integer, parameter :: phase_bodies = 1, phase_neighbourhood = 2, phase_detection = 3, phase_interface = 4, phase_setup = 5, &
    & phase_sweep = 6, phase_exchange = 7, phase_factorise = 8, phase_interface_solve = 9, phase_check = 10, &
    & phase_projection = 11, phase_output = 12
  integer, parameter :: n_phases = 12
  !> what the log calls the phases
  character(len=28), parameter :: phase_names(n_phases) = [character(len=28) :: "bodies: move, migrate", &
    & "neighbour lists and ghosts", "detection of contacts", "interface: who shares whom", &
    & "set-up of the solve", "sweeps", "exchange", "factorisation", "interface solve", "residual checks", &
    & "projection of overlaps", "output"]

  real(dp) :: elapsed(n_phases) = 0.0_dp
  real(dp) :: started(n_phases) = 0.0_dp

contains

  !> Seconds on the clock of this rank.
  real(dp) function clock()
    clock = MPI_Wtime()
  end function clock

  subroutine start_timer(phase)
    integer, intent(in) :: phase
    started(phase) = MPI_Wtime()
  end subroutine start_timer

  subroutine stop_timer(phase)
    integer, intent(in) :: phase
    elapsed(phase) = elapsed(phase) + MPI_Wtime() - started(phase)
  end subroutine stop_timer

  subroutine reset_timers()
    elapsed(:) = 0.0_dp
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
