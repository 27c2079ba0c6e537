!> From columns to the tables of gravier_columns: solves, what is printed of them, and the CSV files.
module gravier_columns_tables
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: make_directory
  use gravier_own_files, only: check_own_files
  use gravier_table_place, only: check_table_place
  use gravier_output_lock, only: output_lock_t
  use gravier_solve_report, only: solve_report_t, solve_converged
  use gravier_columns_options, only: options_t
  use gravier_columns_study, only: column_t, paper_columns, solve_columns
  use gravier_columns_report, only: write_table, write_csv
  implicit none
  private
  public :: make_tables

contains

  !> Solve, print the table and write the CSV files. Errors are the same on all ranks. Collective.
  subroutine make_tables(comm, options, failed, error)
    type(communicator_t), target, intent(in) :: comm
    type(options_t), intent(in) :: options
    !> solves that did not reach the tolerance
    integer, intent(out) :: failed
    type(error_t), allocatable, intent(inout) :: error
    type(column_t), allocatable :: columns(:)
    type(solve_report_t), allocatable :: reports(:, :, :)
    type(output_lock_t) :: lock

    failed = 0
    allocate (columns(merge(1, size(paper_columns), options%count > 0)))
    columns(:) = paper_columns(1:size(columns))
    if (options%count > 0) columns(1) = column_t(0, options%count, options%subdomains)
    call prepare_directory(comm, options%directory, error)
    call lock%take_directory(comm, options%directory, "gravier_columns", error)
    if (comm%rank == 0) then
      call check_table_place(options%directory//"/columns_table.csv", "problem,disks,", error)
      call check_table_place(options%directory//"/columns_error.csv", "problem,method,", error)
    end if
    call comm%agree(error)
    if (.not. allocated(error)) call solve_columns(comm, columns, options%tolerance, reports, error)
    if (allocated(error)) then
      call lock%release()
      return
    end if
    failed = count(reports%status /= solve_converged)
    if (comm%rank == 0) then
      call write_table(output_unit, columns, options%tolerance, reports)
      if (failed > 0) write (output_unit, "(a)") "*** "//to_text(failed)//" of the solves did NOT reach the tolerance"
      call write_csv(options%directory, columns, reports, error)
      call check_own_files(error)
      if (.not. allocated(error)) write (output_unit, "(a)") "written:", "  "//options%directory//"/columns_table.csv", &
        & "  "//options%directory//"/columns_error.csv"
      flush (output_unit)
    end if
    call comm%agree(error)
    call lock%release()
  end subroutine make_tables

  !> Make the output directory, or say why it cannot be used. Collective.
  subroutine prepare_directory(comm, directory, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: directory
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason

    if (comm%rank == 0) then
      call make_directory(directory, reason)
      if (allocated(reason)) call raise(error, status_input, "--out '"//directory// &
        & "': expected a directory that can be written to: "//reason%message)
    end if
    call comm%agree(error)
  end subroutine prepare_directory

end module gravier_columns_tables
