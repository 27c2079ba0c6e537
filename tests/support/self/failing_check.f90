!> Must fail on any number of ranks: the last rank alone has two failing checks, one of them a NaN.
program failing_check
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use mpi_f08, only: MPI_Init, MPI_Finalize, MPI_Comm_rank, MPI_Comm_size, MPI_COMM_WORLD
  use gravier_kinds, only: dp
  use gravier_check, only: check, check_close, finish_checks
  implicit none
  integer :: rank, ranks
  real(dp) :: value

  call MPI_Init()
  call MPI_Comm_rank(MPI_COMM_WORLD, rank)
  call MPI_Comm_size(MPI_COMM_WORLD, ranks)
  value = 1.0_dp
  if (rank == ranks - 1) value = ieee_value(value, ieee_quiet_nan)
  call check_close(value, 1.0_dp, 1.0e-15_dp, "a number, NaN on the last rank")
  call check(rank /= ranks - 1, "true but on the last rank")
  call check(.true., "true on every rank")
  call finish_checks()
  call MPI_Finalize()
end program failing_check
