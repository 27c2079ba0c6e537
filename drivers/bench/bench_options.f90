!> The command line of gravier_bench.
module gravier_bench_options
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real
  implicit none
  private
  public :: options_t, read_options, usage

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_bench [OPTION]...   kernels, parts of a step and scaling, measured in one run in rounds, as a CSV"//nl// &
    & "                                   (mpirun -n 2 gravier_bench: on 1 and on 2 ranks)"//nl// &
    & "  --quick          less of everything, under a minute"//nl// &
    & "  --csv FILE       the table (gravier_bench.csv)"//nl// &
    & "  --rounds N       repetitions of every measurement (5; quick: 3)"//nl// &
    & "  --seconds S      shortest time over which a rate is taken (0.2; quick: 0.05)"//nl// &
    & "  --contacts N     contacts of the kernels' largest problems (as many as fill the last cache four times, and no"//nl// &
    & "                   fewer than 1000000; quick: 1000000)"//nl// &
    & "  --spheres N      spheres of the largest step (1000000; quick: 100000); scaling takes a fifth, or all if quick"//nl// &
    & "  --iterations N   iterations of each solve (100; quick: 30)"//nl// &
    & "  --triad N        numbers in each array of the bandwidth test (as many as fill the last cache four times)"//nl// &
    & "  --kernel NAME    nothing but sweeps of one kernel over --contacts N (2000), as many as --sweeps says; no table"//nl// &
    & "  --sweeps K       goes with --kernel"//nl// &
    & "  --recording      goes with --kernel: the version that records velocities"//nl// &
    & "  --help"//nl// &
    & "exit status: 0 done; 2 bad usage; 4 anything else"

  type :: options_t
    logical :: help = .false., quick = .false., recording = .false.
    character(len=:), allocatable :: csv
    !> blank where all are measured
    character(len=:), allocatable :: kernel
    !> 0 where not given
    integer :: rounds = 0, contacts = 0, spheres = 0, iterations = 0, triad = 0, sweeps = 0
    !> [s]
    real(dp) :: seconds = 0.0_dp
  end type options_t

contains

  !> Read the command line; the same on all ranks. `kernels` are the names that --kernel knows.
  subroutine read_options(kernels, options, error)
    character(len=*), intent(in) :: kernels(:)
    type(options_t), intent(out) :: options
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    options%csv = "gravier_bench.csv"
    options%kernel = ""
    k = 1
    do while (k <= command_argument_count() .and. .not. allocated(error))
      select case (argument(k))
      case ("--help", "-h")
        options%help = .true.
        k = k + 1
      case ("--recording")
        options%recording = .true.
        k = k + 1
      case ("--quick")
        options%quick = .true.
        k = k + 1
      case ("--csv", "--rounds", "--seconds", "--contacts", "--spheres", "--iterations", "--triad", "--kernel", "--sweeps")
        call read_value(options, k, error)
        k = k + 2
      case default
        call raise(error, status_input, "unknown argument '"//argument(k)//"'; see gravier_bench --help")
      end select
    end do
    if (allocated(error)) return
    if ((options%kernel /= "") .neqv. (options%sweeps > 0)) call raise(error, status_input, &
      & "--kernel and --sweeps go together; only one is given")
    if (options%recording .and. options%kernel == "") call raise(error, status_input, "--recording goes with --kernel")
    if (options%kernel /= "" .and. .not. any(kernels == options%kernel)) call raise(error, status_input, &
      & "--kernel '"//options%kernel//"': expected one of "//joined(kernels))
    call fill_in(options)
  end subroutine read_options

  !> Read option `k` of the command line and its value, which follows.
  subroutine read_value(options, k, error)
    type(options_t), intent(inout) :: options
    integer, intent(in) :: k
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word

    word = option_value(k)
    select case (argument(k))
    case ("--csv")
      options%csv = word
      if (word == "") call raise(error, status_input, "--csv '': expected the path of a file")
    case ("--kernel")
      options%kernel = word
      if (word == "") call raise(error, status_input, "--kernel '': expected the name of a kernel")
    case ("--seconds")
      options%seconds = positive_real(word)
      if (.not. options%seconds > 0.0_dp) call raise(error, status_input, "--seconds '"//word// &
        & "': expected a finite real number > 0")
    case ("--rounds")
      call read_count(options%rounds)
    case ("--contacts")
      call read_count(options%contacts)
    case ("--spheres")
      call read_count(options%spheres)
    case ("--iterations")
      call read_count(options%iterations)
    case ("--triad")
      call read_count(options%triad)
    case default
      call read_count(options%sweeps)
    end select

  contains

    subroutine read_count(value)
      integer, intent(inout) :: value

      value = positive_integer(word)
      if (value < 1) call raise(error, status_input, argument(k)//" '"//word//"': expected an integer >= 1")
    end subroutine read_count

  end subroutine read_value

  !> The defaults of what was not given; those of `contacts` and `triad` depend on the machine and stay 0.
  subroutine fill_in(options)
    type(options_t), intent(inout) :: options

    if (options%rounds == 0) options%rounds = merge(3, 5, options%quick)
    if (.not. options%seconds > 0.0_dp) options%seconds = merge(0.05_dp, 0.2_dp, options%quick)
    if (options%contacts == 0 .and. options%quick .and. options%kernel == "") options%contacts = 1000000
    if (options%spheres == 0) options%spheres = merge(100000, 1000000, options%quick)
    if (options%iterations == 0) options%iterations = merge(30, 100, options%quick)
  end subroutine fill_in

  pure function joined(names) result(text)
    character(len=*), intent(in) :: names(:)
    character(len=:), allocatable :: text
    integer :: k

    text = trim(names(1))
    do k = 2, size(names)
      text = text//", "//trim(names(k))
    end do
  end function joined

end module gravier_bench_options
