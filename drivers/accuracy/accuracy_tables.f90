!> From a study to its tables: the runs or solves that gravier_accuracy compares, and what it writes of them.
module gravier_accuracy_tables
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: make_directory
  use gravier_own_files, only: check_own_files
  use gravier_table_place, only: check_table_place
  use gravier_output_lock, only: output_lock_t
  use gravier_accuracy_study, only: study_t
  use gravier_accuracy_input, only: read_study
  use gravier_accuracy_measure, only: case_run_t, case_solve_t, check_scenes, measure_runs, measure_solves
  use gravier_accuracy_report, only: summary_t, write_runs, write_solves, print_solves
  implicit none
  private
  public :: make_tables

contains

  !> Read, run and write. Everything that can be refused is refused before a file is touched. Errors are the same
  !> on all ranks. Collective.
  subroutine make_tables(comm, path, study, missed, error)
    type(communicator_t), target, intent(in) :: comm
    character(len=*), intent(in) :: path
    type(study_t), intent(out) :: study
    !> solves that did not reach their tolerance
    integer, intent(out) :: missed
    type(error_t), allocatable, intent(inout) :: error
    type(case_run_t), allocatable :: runs(:, :)
    type(case_solve_t), allocatable :: solves(:)
    type(case_run_t) :: reference
    type(summary_t) :: summary
    type(output_lock_t) :: lock

    missed = 0
    call read_study(comm, path, study, error)
    if (.not. allocated(error) .and. study%kind == "run") call check_scenes(comm, study, error)
    if (.not. allocated(error)) call prepare_directory(comm, study, error)
    call lock%take_directory(comm, study%directory, "gravier_accuracy "//path, error)
    if (comm%rank == 0 .and. .not. allocated(error)) then
      call check_table_place(study%directory//"/accuracy.csv", "title,kind,", error)
      call check_table_place(study%directory//"/accuracy_summary.csv", "variant,figure,", error)
    end if
    call comm%agree(error)
    if (allocated(error)) then
      call lock%release()
      return
    end if
    if (comm%rank == 0) write (output_unit, "(a)") trim(study%file//"  "//study%title)
    if (study%kind == "run") then
      call measure_runs(comm, study, runs, reference, error)
      if (.not. allocated(error)) missed = sum(runs%run%failed) + reference%run%failed
      if (.not. allocated(error) .and. comm%rank == 0) call write_runs(study, runs, reference, comm%size, summary, error)
      if (comm%rank == 0) call summary%print(output_unit)
    else
      call measure_solves(comm, study, solves, error)
      if (.not. allocated(error)) missed = sum(solves%run%failed)
      if (.not. allocated(error) .and. comm%rank == 0) call write_solves(study, solves, comm%size, summary, error)
      if (.not. allocated(error) .and. comm%rank == 0) call print_solves(output_unit, study, solves)
    end if
    if (comm%rank == 0 .and. .not. allocated(error)) call finish(study, summary, missed, error)
    call comm%agree(error)
    call lock%release()
  end subroutine make_tables

  !> The summary, and where things are.
  subroutine finish(study, summary, missed, error)
    type(study_t), intent(in) :: study
    type(summary_t), intent(in) :: summary
    integer, intent(in) :: missed
    type(error_t), allocatable, intent(inout) :: error

    call summary%write(study%directory//"/accuracy_summary.csv", error)
    call check_own_files(error)
    if (allocated(error)) return
    if (missed > 0) write (output_unit, "(a)") "*** "//to_text(missed)//" of the solves did NOT reach their tolerance"
    write (output_unit, "(a)") "written:", "  "//study%directory//"/accuracy.csv", "  "//study%directory//"/accuracy_summary.csv"
    flush (output_unit)
  end subroutine finish

  !> Make the output directory, or say why it cannot be used. Collective.
  subroutine prepare_directory(comm, study, error)
    type(communicator_t), intent(in) :: comm
    type(study_t), intent(in) :: study
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason

    if (comm%rank == 0) then
      call make_directory(study%directory, reason)
      if (allocated(reason)) call study%complain("directory = '"//study%directory//"'", &
        & "a directory that can be written to: "//reason%message, error)
    end if
    call comm%agree(error)
  end subroutine prepare_directory

end module gravier_accuracy_tables
