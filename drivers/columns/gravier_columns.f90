!> gravier_columns: the four decomposition methods and NLGS on columns of disks, as table, CSV and figure.
program gravier_columns
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, status_ok, status_unconverged
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: leave
  use gravier_drawing, only: draw_figure
  use gravier_columns_options, only: options_t, read_options, usage
  use gravier_columns_tables, only: make_tables
  implicit none

  type(communicator_t), target :: comm
  type(options_t) :: options
  type(error_t), allocatable :: error
  integer :: status, failed

  call start_parallel()
  call comm%init()
  status = status_ok
  call read_options(options, error)
  if (allocated(error)) options%help = .false.
  if (options%help .and. comm%rank == 0) write (output_unit, "(a)") usage
  failed = 0
  if (.not. (allocated(error) .or. options%help)) call make_tables(comm, options, failed, error)
  if (failed > 0) status = status_unconverged
  call report_failure()
  call comm%free()
  call stop_parallel()
  if (.not. (allocated(error) .or. options%help)) then
    ! rank 0 alone speaks for all: an MPI that sees another rank fail would end it while it draws
    if (comm%rank /= 0) call leave(status_ok)
    call draw_figure("columns", options%directory, error)
    call report_failure()
    if (.not. allocated(error)) write (output_unit, "(2x,a)") options%directory//"/columns.png", options%directory//"/columns.svg"
  end if
  call leave(status)

contains

  !> Print the one line of an error, if there is one, and take its exit status.
  subroutine report_failure()
    if (.not. allocated(error)) return
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_columns: error: "//error%message
    flush (error_unit)
    status = error%status
  end subroutine report_failure

end program gravier_columns
