!> What the command line of gravier_columns asks for.
module gravier_columns_options
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real
  implicit none
  private
  public :: options_t, read_options, usage

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

contains

  !> Read the command line; the same on all ranks. Failure: status_input, for what it does not know or cannot take.
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

end module gravier_columns_options
