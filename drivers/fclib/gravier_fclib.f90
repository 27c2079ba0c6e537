!> gravier_fclib: solves problems of frictional contact in the format of FCLIB and judges the results.
program gravier_fclib
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, status_ok
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: path_t
  use gravier_command_line, only: leave
  use gravier_fclib_options, only: options_t, usage, read_options
  use gravier_fclib_run, only: run_study
  implicit none

  type(communicator_t), target :: comm
  type(options_t) :: options
  type(path_t), allocatable :: files(:)
  type(error_t), allocatable :: error
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  call read_options(options, files, error)
  if (.not. allocated(error)) then
    if (options%help) then
      if (comm%rank == 0) write (output_unit, "(a)") usage
    else
      call run_study(comm, options, files, status, error)
    end if
  end if
  if (allocated(error)) then
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_fclib: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call comm%free()
  call stop_parallel()
  call leave(status)

end program gravier_fclib
