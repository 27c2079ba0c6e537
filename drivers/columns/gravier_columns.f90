!> gravier_columns: the four decomposition methods and NLGS on columns of disks, as table, CSV and figure.
program gravier_columns
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: make_directory
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_solve, only: solve_report_t, solve_converged
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real, leave
  use gravier_drawing, only: draw_figure
  use gravier_columns_study, only: column_t, paper_columns, solve_columns
  use gravier_columns_report, only: write_table, write_csv
  implicit none

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_columns [OPTION]...    NLGS, Schwarz, Schwarz-EC, NSCDD and NSCDD-EP on columns of unit disks:"//nl// &
    & "                                      iterations until the error on the impulses is below the tolerance"//nl// &
    & "  --out DIR          directory of the CSV tables and of the figure (columns)"//nl// &
    & "  --count N          a column of N disks, instead of the two of the paper"//nl// &
    & "  --subdomains S     in S subdomains; goes with --count"//nl// &
    & "  --tolerance T      on |r - r_exact|/|r_exact| (1e-6)"//nl// &
    & "  --help"//nl// &
    & "exit status: 0 done and converged; 2 bad usage; 3 a solve did not reach its tolerance; 4 anything else"

  type :: options_t
    logical :: help = .false.
    character(len=:), allocatable :: directory
    !> as it is written
    character(len=:), allocatable :: tolerance
    !> 0 where not given
    integer :: count = 0, subdomains = 0
  end type options_t

  type(communicator_t), target :: comm
  type(options_t) :: options
  type(error_t), allocatable :: error
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  call read_options(options, error)
  if (allocated(error)) options%help = .false.
  if (options%help .and. comm%rank == 0) write (output_unit, "(a)") usage
  if (.not. (allocated(error) .or. options%help)) call run_study(options, status, error)
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

  !> Read the command line; the same on all ranks.
  subroutine read_options(options, error)
    type(options_t), intent(out) :: options
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    options%directory = "columns"
    options%tolerance = "1e-6"
    k = 1
    do while (k <= command_argument_count() .and. .not. allocated(error))
      select case (argument(k))
      case ("--help", "-h")
        options%help = .true.
        k = k + 1
      case ("--out", "--count", "--subdomains", "--tolerance")
        call read_value(options, k, error)
        k = k + 2
      case default
        call raise(error, status_input, "unknown argument '"//argument(k)//"'; see gravier_columns --help")
      end select
    end do
    if ((options%count > 0) .neqv. (options%subdomains > 0)) call raise(error, status_input, &
      & "--count and --subdomains go together; only one is given")
  end subroutine read_options

  !> Read option `k` of the command line and its value, which follows.
  subroutine read_value(options, k, error)
    type(options_t), intent(inout) :: options
    integer, intent(in) :: k
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word

    word = option_value(k)
    select case (argument(k))
    case ("--out")
      options%directory = word
      if (word == "" .or. index(word, "-") == 1) call raise(error, status_input, "--out '"//word//"': expected a directory")
    case ("--count")
      options%count = positive_integer(word)
      if (options%count == 0) call raise(error, status_input, "--count '"//word//"': expected an integer >= 1")
    case ("--subdomains")
      options%subdomains = positive_integer(word)
      if (options%subdomains == 0) call raise(error, status_input, "--subdomains '"//word//"': expected an integer >= 1")
    case default
      options%tolerance = word
      if (positive_real(word) <= 0.0_dp) call raise(error, status_input, "--tolerance '"//word// &
        & "': expected a finite real number > 0")
    end select
  end subroutine read_value

  !> Solve, print the table and write the CSV files. Collective.
  subroutine run_study(options, status, error)
    type(options_t), intent(in) :: options
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(column_t), allocatable :: columns(:)
    type(solve_report_t), allocatable :: reports(:, :, :)
    type(output_lock_t) :: lock
    integer :: failed

    allocate (columns(merge(1, size(paper_columns), options%count > 0)))
    columns(:) = paper_columns(1:size(columns))
    if (options%count > 0) columns(1) = column_t(0, options%count, options%subdomains)
    call prepare_directory(options%directory, error)
    call lock%take_directory(comm, options%directory, "gravier_columns", error)
    if (.not. allocated(error)) call solve_columns(comm, columns, options%tolerance, reports, error)
    if (allocated(error)) then
      call lock%release()
      return
    end if
    failed = count(reports%status /= solve_converged)
    if (failed > 0) status = status_unconverged
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
  end subroutine run_study

  !> Make the output directory, or say why it cannot be used. Collective.
  subroutine prepare_directory(directory, error)
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

end program gravier_columns
