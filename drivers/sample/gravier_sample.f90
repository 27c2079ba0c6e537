!> gravier_sample SAMPLE.nml: generates the grains of &sample, prepares them, and writes them to a bodies file.
program gravier_sample
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, raise, status_ok, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: argument, leave
  use gravier_start_lines, only: banner_text
  use gravier_sample_file, only: write_sample
  implicit none

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_sample SAMPLE.nml      generate the grains of &sample, settle or compact them as it says, and write"//nl// &
    & "                                      them to its bodies file (mpirun -n RANKS gravier_sample SAMPLE.nml)"//nl// &
    & "       gravier_sample --version | --help"//nl// &
    & "exit status: 0 done and at rest; 2 bad input or usage; 3 not at rest; 4 anything else"

  type(communicator_t), target :: comm
  type(error_t), allocatable :: error
  character(len=:), allocatable :: word
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  word = ""
  if (command_argument_count() > 0) word = argument(1)
  if (command_argument_count() /= 1) then
    call raise(error, status_input, "expected one input file, but "//to_text(command_argument_count())// &
      & " arguments are given; see gravier_sample --help")
  else if (word == "--help" .or. word == "-h") then
    if (comm%rank == 0) write (output_unit, "(a)") usage
  else if (word == "--version") then
    if (comm%rank == 0) write (output_unit, "(a)", advance="no") banner_text()
  else if (index(word, "-") == 1) then
    call raise(error, status_input, "unknown option "//word//"; see gravier_sample --help")
  else
    call write_sample(comm, word, status, error)
  end if
  if (allocated(error)) then
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_sample: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call comm%free()
  call stop_parallel()
  call leave(status)

end program gravier_sample
