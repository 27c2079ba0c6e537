!> gravier_accuracy STUDY.nml: what accuracy costs, by methods, tolerances and steps; tables and a figure.
program gravier_accuracy
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: argument, leave
  use gravier_start_lines, only: banner_text
  use gravier_drawing, only: draw_figure
  use gravier_accuracy_study, only: study_t
  use gravier_accuracy_tables, only: make_tables
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
  integer :: status, missed

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
    call make_tables(comm, word, study, missed, error)
    if (missed > 0) status = status_unconverged
    draws = .not. allocated(error)
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

end program gravier_accuracy
