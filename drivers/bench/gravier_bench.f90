!> gravier_bench: kernels, parts of a step and scaling, measured in one run.
program gravier_bench
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_errors, only: error_t, status_ok
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: leave
  use gravier_bench_all, only: run_kernel, run_all
  use gravier_bench_kernels, only: kernel_names
  use gravier_bench_options, only: options_t, read_options, usage
  implicit none

  type(communicator_t), target :: world, alone
  type(options_t) :: options
  type(error_t), allocatable :: error
  integer :: status

  call start_parallel()
  call world%init()
  call alone%init(MPI_COMM_SELF)
  status = status_ok
  call read_options(kernel_names, options, error)
  if (allocated(error)) then
    continue
  else if (options%help) then
    if (world%rank == 0) write (output_unit, "(a)") usage
  else if (options%kernel /= "") then
    call run_kernel(world, options, error)
  else
    call run_all(world, alone, options, error)
  end if
  if (allocated(error)) then
    if (world%rank == 0) write (error_unit, "(a)") "gravier_bench: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call alone%free()
  call world%free()
  call stop_parallel()
  call leave(status)

end program gravier_bench
