!> gravier_fclib: solves problems of frictional contact in the format of FCLIB and judges the results.
program gravier_fclib
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: path_t, add_path, list_files, make_directory
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real, leave
  use gravier_fclib_file, only: write_fclib_local, name_of_solution, name_of_guess
  use gravier_friction_solver, only: friction_control_t, friction_methods, verdict_no_solution
  use gravier_fclib_outputs, only: written_path, check_outputs
  use gravier_fclib_study, only: problem_t, read_problem, solve_timed
  use gravier_fclib_report, only: result_t, print_heading, print_result, open_results, add_result, write_profile
  implicit none

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_fclib [OPTION]... FILE|DIRECTORY..."//nl// &
    & "  solves frictional contact problems in the HDF5 format of FCLIB; of a directory all *.hdf5 and *.h5"//nl// &
    & "  --method M           auto (default): sweeps with momentum and Newton's method in turn; nlgs; momentum; newton;"//nl// &
    & "                       several with commas between, or all"//nl// &
    & "  --tolerance T        on es, the unit-consistent measure of the defect (1e-8)"//nl// &
    & "  --max-iterations N   sweeps and Newton steps of one solve (100000)"//nl// &
    & "  --warm               start from the impulses in the file, its solution or first guess, and say where it has none"//nl// &
    & "  --csv FILE           the results as a table"//nl// &
    & "  --profile FILE       performance profile of the methods, as a table"//nl// &
    & "  --write DIR          each problem, reduced to its contacts, with the impulses found by the method named last"//nl// &
    & "                       and the multipliers of its bilateral constraints"//nl// &
    & "  --help"//nl// &
    & "exit status: 0 all solved; 2 bad input or usage; 3 a solve did not reach its tolerance or found no solution; 4 anything else"

  type :: options_t
    logical :: help = .false., warm = .false.
    character(len=8), allocatable :: methods(:)
    real(dp) :: tolerance = 1.0e-8_dp
    integer :: max_iterations = 100000
    !> empty where not given
    character(len=:), allocatable :: csv, profile, directory
  end type options_t

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
      call run_study(options, files, status, error)
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

contains

  !> Read the command line; the same on all ranks.
  subroutine read_options(options, files, error)
    type(options_t), intent(out) :: options
    type(path_t), allocatable, intent(out) :: files(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    allocate (options%methods(1), files(0))
    options%methods(1) = "auto"
    options%csv = ""
    options%profile = ""
    options%directory = ""
    k = 1
    do while (k <= command_argument_count() .and. .not. allocated(error))
      select case (argument(k))
      case ("--help", "-h")
        options%help = .true.
      case ("--warm")
        options%warm = .true.
      case ("--method", "--tolerance", "--max-iterations", "--csv", "--profile", "--write")
        call read_value(options, k, error)
        k = k + 1
      case default
        if (index(argument(k), "-") == 1) then
          call raise(error, status_input, "unknown option '"//argument(k)//"'; see gravier_fclib --help")
        else
          call add_files(argument(k), files, error)
        end if
      end select
      k = k + 1
    end do
    if (size(files) == 0 .and. .not. options%help) call raise(error, status_input, "no file given; see gravier_fclib --help")
  end subroutine read_options

  !> Read option `k` of the command line and its value, which follows.
  subroutine read_value(options, k, error)
    type(options_t), intent(inout) :: options
    integer, intent(in) :: k
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word

    word = option_value(k)
    select case (argument(k))
    case ("--method")
      call read_methods(word, options%methods, error)
    case ("--tolerance")
      options%tolerance = positive_real(word)
      if (options%tolerance <= 0.0_dp) call raise(error, status_input, "--tolerance '"//word// &
        & "': expected a finite real number > 0")
    case ("--max-iterations")
      options%max_iterations = positive_integer(word)
      if (options%max_iterations == 0) call raise(error, status_input, "--max-iterations '"//word//"': expected an integer >= 1")
    case ("--csv")
      options%csv = word
    case ("--profile")
      options%profile = word
    case default
      options%directory = word
    end select
    if (word == "") call raise(error, status_input, argument(k)//" '': expected a path")
  end subroutine read_value

  !> Names of methods with commas between.
  subroutine read_methods(list, methods, error)
    character(len=*), intent(in) :: list
    character(len=8), allocatable, intent(inout) :: methods(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: rest
    integer :: k, n, comma

    deallocate (methods)
    if (list == "all") then
      allocate (methods(size(friction_methods)))
      methods(:) = friction_methods
      return
    end if
    n = 1
    do k = 1, len(list)
      if (list(k:k) == ",") n = n + 1
    end do
    allocate (methods(n))
    rest = list//","
    do k = 1, size(methods)
      comma = index(rest, ",")
      methods(k) = rest(1:comma - 1)
      if (.not. any(rest(1:comma - 1) == friction_methods)) call raise(error, status_input, "--method '"//list// &
        & "': expected auto, nlgs, momentum, newton, or all")
      rest = rest(comma + 1:)
    end do
  end subroutine read_methods

  !> Add a file, or those of a directory.
  subroutine add_files(path, files, error)
    character(len=*), intent(in) :: path
    type(path_t), allocatable, intent(inout) :: files(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), parameter :: suffixes(2) = [character(len=5) :: ".hdf5", ".h5"]
    integer :: i, before
    logical :: is_directory

    inquire (file=path//"/.", exist=is_directory)
    if (.not. is_directory) then
      call add_path(path, files)
      return
    end if
    before = size(files)
    do i = 1, size(suffixes)
      call list_files(path, trim(suffixes(i)), files)
    end do
    if (size(files) == before) call raise(error, status_input, path//": expected a directory with files *.hdf5 or *.h5")
  end subroutine add_files

  !> Read every problem, take the places that are written to, then solve. Collective.
  subroutine run_study(options, files, status, error)
    type(options_t), intent(in) :: options
    type(path_t), intent(in) :: files(:)
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(problem_t) :: problem
    type(output_lock_t) :: directory_lock, csv_lock, profile_lock
    character(len=:), allocatable :: notes
    integer :: p

    if (comm%rank == 0) call check_outputs(files, options%csv, options%profile, options%directory, error)
    call comm%agree(error)
    notes = ""
    do p = 1, size(files)
      call read_problem(comm, files(p)%text, problem, error)
      if (allocated(error)) return
      notes = notes//notes_on(options, files(p)%text, problem)
    end do
    if (comm%rank == 0) write (error_unit, "(a)", advance="no") notes
    if (options%directory /= "") then
      if (comm%rank == 0) call make_directory(options%directory, error)
      call comm%agree(error)
      call directory_lock%take_directory(comm, options%directory, "gravier_fclib", error)
    end if
    if (options%csv /= "") call csv_lock%take_file(comm, options%csv, "gravier_fclib", error)
    if (options%profile /= "") call profile_lock%take_file(comm, options%profile, "gravier_fclib", error)
    if (.not. allocated(error)) call solve_all(options, files, status, error)
    call directory_lock%release()
    call csv_lock%release()
    call profile_lock%release()
  end subroutine run_study

  !> Solve every problem by every method, and write what was asked for. Collective.
  subroutine solve_all(options, files, status, error)
    type(options_t), intent(in) :: options
    type(path_t), intent(in) :: files(:)
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(problem_t) :: problem
    type(result_t), allocatable :: results(:, :)
    type(csv_writer_t) :: table
    integer :: p, failed, unbounded

    if (comm%rank == 0) then
      if (options%csv /= "") call open_results(table, options%csv, error)
      if (.not. allocated(error)) call print_heading()
    end if
    call comm%agree(error)
    allocate (results(size(options%methods), size(files)))
    do p = 1, size(files)
      call read_problem(comm, files(p)%text, problem, error)
      if (allocated(error)) return
      call solve_problem(options, files(p)%text, problem, results(:, p), table, error)
    end do
    failed = count(.not. results%report%converged)
    unbounded = count(results%report%verdict == verdict_no_solution)
    if (failed > 0) status = status_unconverged
    if (comm%rank == 0) then
      if (table%is_open()) call table%close(error)
      if (options%profile /= "") call write_profile(options%profile, options%methods, results, error)
      call check_own_files(error)
      if (failed > 0) write (output_unit, "(a)") "*** "//to_text(failed)//" of "//to_text(size(results))// &
        & " solves did NOT reach the tolerance "//to_text(options%tolerance, 2)
      if (unbounded > 0) write (output_unit, "(a)") "*** "//to_text(unbounded)//" of "//to_text(size(results))// &
        & " solves found NO solution: loads grow without bound"
      flush (output_unit)
    end if
    call comm%agree(error)
  end subroutine solve_all

  !> Lines to say of a problem once all files are read: what was read otherwise than it stands, and that --warm has nothing to start
  !> from.
  function notes_on(options, path, problem) result(notes)
    type(options_t), intent(in) :: options
    character(len=*), intent(in) :: path
    type(problem_t), intent(in) :: problem
    character(len=:), allocatable :: notes

    notes = ""
    if (problem%local%remark /= "") notes = "gravier_fclib: note: "//path//": "//problem%local%remark//nl
    if (options%warm .and. .not. allocated(problem%local%r)) notes = notes//"gravier_fclib: note: "//path// &
      & ": --warm found neither "//name_of_solution//" nor "//name_of_guess//": the solve starts from zero impulses"//nl
  end function notes_on

  !> One problem by every method. Collective.
  subroutine solve_problem(options, path, problem, results, table, error)
    type(options_t), intent(in) :: options
    character(len=*), intent(in) :: path
    type(problem_t), intent(inout) :: problem
    !> (methods)
    type(result_t), intent(inout) :: results(:)
    type(csv_writer_t), intent(inout) :: table
    type(error_t), allocatable, intent(inout) :: error
    type(friction_control_t) :: control
    real(dp), allocatable :: start(:, :), r(:, :), v(:, :), l(:)
    character(len=:), allocatable :: name
    integer :: m

    name = path(index(path, "/", back=.true.) + 1:)
    control%tolerance = options%tolerance
    control%max_iterations = options%max_iterations
    allocate (start(problem%local%dimension, size(problem%local%mu)))
    allocate (r, v, mold=start)
    start(:, :) = 0.0_dp
    if (options%warm .and. allocated(problem%local%r)) start(:, :) = problem%local%r
    do m = 1, size(options%methods)
      control%method = trim(options%methods(m))
      results(m)%problem = name
      results(m)%method = control%method
      results(m)%dimension = problem%local%dimension
      results(m)%contacts = size(problem%local%mu)
      call solve_timed(problem%packed, control, start, r, results(m)%report, results(m)%seconds, error)
      call comm%agree(error)
      if (allocated(error)) return
      if (comm%rank /= 0) cycle
      call print_result(results(m))
      if (table%is_open()) call add_result(table, results(m), error)
    end do
    call comm%agree(error)
    if (options%directory == "" .or. allocated(error)) return
    call problem%packed%velocity(r, v)
    call problem%multipliers%evaluate(r, l)
    problem%local%r = r
    call write_fclib_local(comm, written_path(options%directory, path), problem%local, error, velocity=v, multipliers=l, &
      & origin=path, same_matrix=problem%same_matrix)
  end subroutine solve_problem

end program gravier_fclib
