!> gravier_error CASE.nml: the estimated velocity error of unfinished solves beside the true one.
program gravier_error
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, status_ok
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_own_files, only: check_own_files
  use gravier_table_place, only: check_table_place
  use gravier_output_lock, only: output_lock_t
  use gravier_config, only: parse_config
  use gravier_read_case, only: read_input
  use gravier_command_line, only: leave
  use gravier_error_options, only: options_t, read_options, usage
  use gravier_error_plan, only: row_t
  use gravier_error_measure, only: measure_case
  use gravier_error_report, only: write_rows, print_rows
  implicit none

  type(communicator_t), target :: comm
  type(options_t) :: options
  type(error_t), allocatable :: error
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  call read_options(options, error)
  if (options%help .and. .not. allocated(error)) then
    if (comm%rank == 0) write (output_unit, "(a)") usage
  else if (.not. allocated(error)) then
    call make_table(error)
  end if
  if (allocated(error)) then
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_error: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call comm%free()
  call stop_parallel()
  call leave(status)

contains

  !> Read the case, measure, print and write. Collective.
  subroutine make_table(error)
    type(error_t), allocatable, intent(inout) :: error
    type(row_t), allocatable :: rows(:)
    character(len=:), allocatable :: text
    type(output_lock_t) :: lock

    call read_input(comm, options%file, text, error)
    if (.not. allocated(error)) call parse_config(options%file, text, options%plan%config, error)
    if (comm%rank == 0) call check_table_place(options%table, "title,method,", error)
    call comm%agree(error)
    call lock%take_file(comm, options%table, "gravier_error "//options%file, error)
    if (.not. allocated(error)) call measure_case(comm, options%plan, rows, error)
    call comm%agree(error)
    if (comm%rank == 0 .and. .not. allocated(error)) then
      call print_rows(output_unit, rows)
      call write_rows(options%table, options%plan, rows, comm%size, error)
      call check_own_files(error)
      if (.not. allocated(error)) write (output_unit, "(a)") "written: "//options%table
      flush (output_unit)
    end if
    call comm%agree(error)
    call lock%release()
  end subroutine make_table

end program gravier_error
