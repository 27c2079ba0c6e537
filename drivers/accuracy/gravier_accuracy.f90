!> gravier_accuracy STUDY.nml: what accuracy costs, by methods, tolerances and steps; tables and a figure.
program gravier_accuracy
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: make_directory
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_command_line, only: argument, leave
  use gravier_start_lines, only: banner_text
  use gravier_drawing, only: draw_figure
  use gravier_accuracy_study, only: study_t, read_study
  use gravier_accuracy_measure, only: case_run_t, case_solve_t, check_scenes, measure_runs, measure_solves
  use gravier_accuracy_report, only: summary_t, write_runs, write_solves, print_solves
  implicit none

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_accuracy STUDY.nml     run a case with methods, tolerances or steps of a study, compare with what is"//nl// &
    & "                                      exact or tight, and write accuracy.csv, accuracy_summary.csv and a figure"//nl// &
    & "                                      (mpirun -n RANKS gravier_accuracy STUDY.nml)"//nl// &
    & "       gravier_accuracy --version | --help"//nl// &
    & "exit status: 0 done and converged; 2 bad input or usage; 3 a solve did not reach its tolerance; 4 anything else"

  type(communicator_t), target :: comm
  type(study_t) :: study
  type(error_t), allocatable :: error
  character(len=:), allocatable :: word
  logical :: draws
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  draws = .false.
  word = ""
  if (command_argument_count() > 0) word = argument(1)
  if (command_argument_count() /= 1) then
    call raise(error, status_input, "expected one study, but "//to_text(command_argument_count())// &
      & " arguments are given; see gravier_accuracy --help")
  else if (word == "--help" .or. word == "-h") then
    if (comm%rank == 0) write (output_unit, "(a)") usage
  else if (word == "--version") then
    if (comm%rank == 0) write (output_unit, "(a)", advance="no") banner_text()
  else if (index(word, "-") == 1) then
    call raise(error, status_input, "unknown option "//word//"; see gravier_accuracy --help")
  else
    call make_study(word)
  end if
  call report_failure()
  call comm%free()
  call stop_parallel()
  if (draws) then
    ! rank 0 alone speaks for all: an MPI that sees another rank fail would end it while it draws
    if (comm%rank /= 0) call leave(status_ok)
    call draw_figure("accuracy", study%directory, error)
    call report_failure()
    if (.not. allocated(error)) write (output_unit, "(2x,a)") study%directory//"/accuracy.png", study%directory//"/accuracy.svg"
  end if
  call leave(status)

contains

  !> Print the one line of an error, if there is one, and take its exit status.
  subroutine report_failure()
    if (.not. allocated(error)) return
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_accuracy: error: "//error%message
    flush (error_unit)
    status = error%status
  end subroutine report_failure

  !> Read, run and write. Everything that can be refused is refused before a file is touched. Collective.
  subroutine make_study(path)
    character(len=*), intent(in) :: path
    type(case_run_t), allocatable :: runs(:, :)
    type(case_solve_t), allocatable :: solves(:)
    type(case_run_t) :: reference
    type(summary_t) :: summary
    type(output_lock_t) :: lock
    integer :: missed

    missed = 0
    call read_study(comm, path, study, error)
    if (.not. allocated(error) .and. study%kind == "run") call check_scenes(comm, study, error)
    if (.not. allocated(error)) call prepare_directory()
    call lock%take_directory(comm, study%directory, "gravier_accuracy "//path, error)
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
    if (comm%rank == 0 .and. .not. allocated(error)) call finish(summary, missed)
    call comm%agree(error)
    call lock%release()
    draws = .not. allocated(error)
    if (missed > 0) status = status_unconverged
  end subroutine make_study

  !> The summary, and where things are.
  subroutine finish(summary, missed)
    type(summary_t), intent(in) :: summary
    integer, intent(in) :: missed

    call summary%write(study%directory//"/accuracy_summary.csv", error)
    call check_own_files(error)
    if (allocated(error)) return
    if (missed > 0) write (output_unit, "(a)") "*** "//to_text(missed)//" of the solves did NOT reach their tolerance"
    write (output_unit, "(a)") "written:", "  "//study%directory//"/accuracy.csv", "  "//study%directory//"/accuracy_summary.csv"
    flush (output_unit)
  end subroutine finish

  !> Make the output directory, or say why it cannot be used. Collective.
  subroutine prepare_directory()
    type(error_t), allocatable :: reason

    if (comm%rank == 0) then
      call make_directory(study%directory, reason)
      if (allocated(reason)) call study%complain("directory = '"//study%directory//"'", &
        & "a directory that can be written to: "//reason%message, error)
    end if
    call comm%agree(error)
  end subroutine prepare_directory

end program gravier_accuracy
