!> The program gravier, for its own main program and for those of users who add laws, shapes, methods or diagnostics of their own.
module gravier_program
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_errors, only: error_t, status_ok
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: arguments_t, read_arguments, action_run, action_check, action_help, action_version, action_keys, &
    & leave
  use gravier_config, only: write_key_reference
  use gravier_run, only: run_case, check_case, report_error
  use gravier_start_lines, only: banner_text
  implicit none
  private
  public :: run_program

contains

  !> Do what the command line asks for, and end the process with the status that the usage names.
  subroutine run_program()
    ! pointers to it outlive this routine
    type(communicator_t), target, save :: comm
    type(arguments_t) :: arguments
    type(error_t), allocatable :: error
    integer :: status

    call start_parallel()
    call comm%init()
    status = status_ok
    call read_arguments(arguments, error)
    if (.not. allocated(error)) then
      select case (arguments%action)
      case (action_run)
        call run_case(comm, arguments%file, arguments%command, arguments%restart, status, error)
      case (action_check)
        call check_case(comm, arguments%file, error)
      case (action_version)
        if (comm%rank == 0) write (output_unit, "(a)", advance="no") banner_text()
      case (action_keys)
        if (comm%rank == 0) call write_key_reference(output_unit)
      case (action_help)
        if (comm%rank == 0) write (output_unit, "(a)") arguments%usage
      end select
    end if
    if (allocated(error)) then
      call report_error(comm, error)
      status = error%status
    end if
    call comm%free()
    call stop_parallel()
    call leave(status)
  end subroutine run_program

end module gravier_program
