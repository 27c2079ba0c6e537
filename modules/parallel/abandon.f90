!> The end of all ranks where one of them cannot go on, for what waits for it in messages would wait for ever.
module gravier_abandon
  use mpi_f08, only: MPI_COMM_WORLD, MPI_Abort, MPI_Finalized, MPI_Initialized
  use gravier_process, only: end_at_once
  implicit none
  private
  public :: end_all_ranks

contains

  !> End the processes of all ranks with a status; files that are open stay as those of a run that was killed. Not collective.
  subroutine end_all_ranks(status)
    integer, intent(in) :: status
    logical :: running, ended

    call MPI_Initialized(running)
    call MPI_Finalized(ended)
    if (running .and. .not. ended) call MPI_Abort(MPI_COMM_WORLD, status)
    call end_at_once(status)
  end subroutine end_all_ranks

end module gravier_abandon
