!> What the command line of gravier_error asks for.
module gravier_error_options
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_command_line, only: argument, option_value, positive_integer, positive_real
  use gravier_error_plan, only: plan_t, situation_t, start_cold, start_lost, start_turned, start_loose
  implicit none
  private
  public :: options_t, read_options, usage

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_error CASE.nml [OPTION]...    the estimated velocity error of unfinished solves beside the true one"//nl// &
    & "  --out FILE          table, one row a state (error.csv)"//nl// &
    & "  --situations LIST   how solves start (cold):"//nl// &
    & "    cold              from zero impulses"//nl// &
    & "    lost:FRACTION     from converged impulses, a fraction of them set to zero"//nl// &
    & "    turned:DEGREES    from converged impulses, then gravity turns"//nl// &
    & "    loose:SPEED       from converged impulses, then the grains get random velocities, in g h"//nl// &
    & "    program           from zero impulses, by the program's own control"//nl// &
    & "  --iterations LIST   iterations after which a state is looked at (4,8,20,40,80,160)"//nl// &
    & "  --steps N           steps that the program makes before (0)"//nl// &
    & "  --every M           look at the state after every M-th of these steps"//nl// &
    & "  --rest              the exact velocities are zero; otherwise each solve goes on to find them:"//nl// &
    & "  --tight RESIDUAL    until this residual (1e-10)"//nl// &
    & "  --limit N           or for so many iterations (20000),"//nl// &
    & "  --sweeps N          and then for so many plain sweeps (20000)"//nl// &
    & "  --help"//nl// &
    & "exit status: 0 done; 2 bad input or usage; 4 anything else"

  type :: options_t
    logical :: help = .false.
    !> the case, and where the table goes
    character(len=:), allocatable :: file, table
    !> without the configuration of the case
    type(plan_t) :: plan
  end type options_t

contains

  !> Read the command line; the same on all ranks. Failure: status_input, for what it does not know or cannot take.
  subroutine read_options(options, error)
    type(options_t), intent(out) :: options
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    options%file = ""
    options%table = "error.csv"
    options%plan%iterations = [4, 8, 20, 40, 80, 160]
    allocate (options%plan%situations(1))
    k = 1
    do while (k <= command_argument_count() .and. .not. allocated(error))
      select case (argument(k))
      case ("--help", "-h")
        options%help = .true.
      case ("--rest")
        options%plan%at_rest = .true.
      case ("--out", "--situations", "--iterations", "--steps", "--every", "--tight", "--limit", "--sweeps")
        call read_value(options, argument(k), option_value(k), error)
        k = k + 1
      case default
        if (index(argument(k), "-") == 1) then
          call raise(error, status_input, "unknown option "//argument(k)//"; see gravier_error --help")
        else if (options%file /= "") then
          call raise(error, status_input, "more than one input file: "//options%file//" and "//argument(k)//"; expected one")
        end if
        options%file = argument(k)
      end select
      k = k + 1
    end do
    if (options%plan%every > options%plan%steps) call raise(error, status_input, "--every '"//to_text(options%plan%every)// &
      & "': expected at most the number of --steps, "//to_text(options%plan%steps))
    if (options%file == "" .and. .not. options%help) call raise(error, status_input, "no input file; see gravier_error --help")
  end subroutine read_options

  !> Take the value of an option.
  subroutine read_value(options, option, word, error)
    type(options_t), intent(inout) :: options
    character(len=*), intent(in) :: option, word
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: expected

    expected = ""
    select case (option)
    case ("--out")
      options%table = word
      if (word == "") expected = "a path"
    case ("--situations")
      call read_situations(options%plan, word, error)
    case ("--iterations")
      call read_iterations(options%plan, word, expected)
    case ("--tight")
      options%plan%tight = positive_real(word)
      if (.not. options%plan%tight > 0.0_dp) expected = "a finite real number > 0"
    case default
      if (positive_integer(word) == 0) expected = "an integer >= 1"
      if (option == "--steps") options%plan%steps = positive_integer(word)
      if (option == "--every") options%plan%every = positive_integer(word)
      if (option == "--limit") options%plan%limit = positive_integer(word)
      if (option == "--sweeps") options%plan%sweeps = positive_integer(word)
    end select
    if (expected /= "") call raise(error, status_input, option//" '"//word//"': expected "//expected)
  end subroutine read_value

  !> Numbers in ascending order, with commas between.
  subroutine read_iterations(plan, list, expected)
    type(plan_t), intent(inout) :: plan
    character(len=*), intent(in) :: list
    character(len=:), allocatable, intent(inout) :: expected
    integer :: numbers(len(list) + 1), first, last, n

    n = 0
    first = 1
    ! after a comma at the end there is an empty item
    do while (first <= len(list) + 1)
      last = end_of_item(list, first)
      n = n + 1
      numbers(n) = positive_integer(list(first:last))
      first = last + 2
    end do
    deallocate (plan%iterations)
    allocate (plan%iterations(n))
    plan%iterations(:) = numbers(1:n)
    if (n > 0) then
      if (numbers(1) > 0 .and. all(numbers(2:n) > numbers(1:n - 1))) return
    end if
    expected = "integers >= 1 in ascending order, with commas between"
  end subroutine read_iterations

  !> Names, some with a number after a colon, with commas between; 'none' stands for none.
  subroutine read_situations(plan, list, error)
    type(plan_t), intent(inout) :: plan
    character(len=*), intent(in) :: list
    type(error_t), allocatable, intent(inout) :: error
    type(situation_t) :: situations(len(list) + 1)
    integer :: first, last, n

    n = 0
    first = 1
    if (list == "none") first = len(list) + 2
    ! after a comma at the end there is an empty item
    do while (first <= len(list) + 1)
      last = end_of_item(list, first)
      if (list(first:last) == "program") then
        plan%by_program = .true.
      else
        n = n + 1
        call read_situation(list(first:last), situations(n), error)
        if (allocated(error)) return
      end if
      first = last + 2
    end do
    deallocate (plan%situations)
    allocate (plan%situations(n))
    plan%situations(:) = situations(1:n)
  end subroutine read_situations

  subroutine read_situation(item, situation, error)
    character(len=*), intent(in) :: item
    type(situation_t), intent(out) :: situation
    type(error_t), allocatable, intent(inout) :: error
    logical :: good
    integer :: colon

    colon = index(item//":", ":")
    if (colon < len(item)) situation%amount = positive_real(item(colon + 1:))
    good = situation%amount > 0.0_dp
    select case (item(1:colon - 1))
    case ("cold")
      good = item == "cold"
      situation%start = start_cold
    case ("lost")
      good = good .and. situation%amount <= 1.0_dp
      situation%start = start_lost
    case ("turned")
      situation%start = start_turned
    case ("loose")
      situation%start = start_loose
    case default
      good = .false.
    end select
    if (.not. good) call raise(error, status_input, "--situations '"//item// &
      & "': expected cold, program, lost:FRACTION of at most 1, turned:DEGREES or loose:SPEED, with a number > 0")
  end subroutine read_situation

  !> Last character of the item of a list that begins at `first`.
  pure integer function end_of_item(list, first) result(last)
    character(len=*), intent(in) :: list
    integer, intent(in) :: first

    last = index(list(first:), ",") + first - 2
    if (last < first - 1) last = len(list)
  end function end_of_item

end module gravier_error_options
