!> The command line of gravier_fclib.
module gravier_fclib_options
  use gravier_kinds, only: dp
  use gravier_text, only: text_from
  use gravier_errors, only: error_t, raise, status_input
  use gravier_file_system, only: path_t, add_path, list_files
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real
  use gravier_friction_solver, only: friction_methods
  implicit none
  private
  public :: options_t, usage, read_options

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_fclib [OPTION]... FILE|DIRECTORY..."//nl// &
    & "  solves frictional contact problems in the HDF5 format of FCLIB; of a directory all *.hdf5 and *.h5"//nl// &
    & "  --method M           auto (default): accelerated sweeps and Newton's method in turn; nlgs; momentum; newton;"//nl// &
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
      rest = text_from(rest, comma + 1)
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

end module gravier_fclib_options
