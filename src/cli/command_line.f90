!> The command line of the program, and how it ends.
module gravier_command_line
  use, intrinsic :: iso_c_binding, only: c_int
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_number_text, only: read_integer, read_real
  use gravier_restart, only: restart_t
  implicit none
  private
  public :: arguments_t, read_arguments, argument, option_value, positive_integer, positive_real, leave
  public :: action_run, action_check, action_help, action_version, action_keys

  integer, parameter :: action_run = 1, action_check = 2, action_help = 3, action_version = 4, action_keys = 5

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier CASE.nml            run a case (mpirun -n RANKS gravier CASE.nml)"//nl// &
    & "       gravier --restart CASE.nml  go on from the checkpoint in its output directory, if there is one"//nl// &
    & "       gravier --restart --changed CASE.nml"//nl// &
    & "                                   the same with loads, drives and coefficients of contact that have changed"//nl// &
    & "       gravier --check CASE.nml    read and check it, say what a run would do, run nothing"//nl// &
    & "       gravier --keys              reference of all input keys, in Markdown"//nl// &
    & "       gravier --version | --help"//nl// &
    & "exit status: 0 done and converged; 2 bad input or usage; 3 a solve did not converge; 4 anything else"

  type :: arguments_t
    integer :: action = action_run
    type(restart_t) :: restart
    !> the input file
    character(len=:), allocatable :: file
    !> the whole command line
    character(len=:), allocatable :: command
    character(len=:), allocatable :: usage
  end type arguments_t

  interface
    subroutine c_exit(status) bind(C, name="exit")
      import :: c_int
      implicit none
      integer(c_int), value :: status
    end subroutine c_exit
  end interface

contains

  !> Read the command line; the same on all ranks.
  subroutine read_arguments(arguments, error)
    type(arguments_t), intent(out) :: arguments
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word
    integer :: k

    arguments%usage = usage
    arguments%file = ""
    arguments%command = "gravier"
    do k = 1, command_argument_count()
      word = argument(k)
      arguments%command = arguments%command//" "//word
      select case (word)
      case ("--check")
        arguments%action = action_check
      case ("--restart")
        arguments%restart%asked = .true.
      case ("--changed")
        arguments%restart%accepts = .true.
      case ("--help", "-h")
        arguments%action = action_help
      case ("--version")
        arguments%action = action_version
      case ("--keys")
        arguments%action = action_keys
      case default
        if (index(word, "-") == 1) then
          call raise(error, status_input, "unknown option "//word//"; see gravier --help")
        else if (arguments%file /= "") then
          call raise(error, status_input, "more than one input file: "//arguments%file//" and "//word//"; expected one")
        end if
        arguments%file = word
      end select
    end do
    if (arguments%action <= action_check .and. arguments%file == "") &
      & call raise(error, status_input, "no input file; see gravier --help")
    if (arguments%action == action_check .and. arguments%restart%asked) call raise(error, status_input, &
      & "--check beside --restart: --check looks at a run from its beginning, and what a restart refuses it refuses before it "// &
      & "changes a file; expected one of the two")
    if (arguments%restart%accepts .and. .not. arguments%restart%asked) call raise(error, status_input, &
      & "--changed without --restart: expected both, since a run that begins has nothing to differ from; see gravier --help")
    if (arguments%action == action_keys .and. arguments%file /= "") call raise(error, status_input, &
      & "an input file, "//arguments%file//", beside --keys, which shows the keys of every input file; see gravier --help")
  end subroutine read_arguments

  !> Word `k` of the command line.
  function argument(k) result(word)
    integer, intent(in) :: k
    character(len=:), allocatable :: word
    integer :: length

    call get_command_argument(k, length=length)
    allocate (character(len=length) :: word)
    call get_command_argument(k, word)
  end function argument

  !> The word after word `k` of the command line; empty where there is none or another option follows.
  function option_value(k) result(word)
    integer, intent(in) :: k
    character(len=:), allocatable :: word

    word = ""
    if (k < command_argument_count()) word = argument(k + 1)
    if (index(word, "--") == 1) word = ""
  end function option_value

  !> The number that a word of digits means; 0 for anything else.
  pure integer function positive_integer(word) result(value)
    character(len=*), intent(in) :: word
    integer(i8) :: found
    logical :: fits

    call read_integer(word, found, fits)
    value = 0
    if (found > 0 .and. found <= huge(value)) value = narrow(found)
  end function positive_integer

  !> The finite number > 0 that a word means; 0 for anything else.
  pure real(dp) function positive_real(word) result(value)
    character(len=*), intent(in) :: word
    integer :: size

    call read_real(word, value, size)
    value = max(value, 0.0_dp)
  end function positive_real

  !> End the process with an exit status, without the lines that STOP prints.
  subroutine leave(status)
    integer, intent(in) :: status
    call c_exit(int(status, c_int))
  end subroutine leave

end module gravier_command_line
