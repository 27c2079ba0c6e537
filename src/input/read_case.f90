!> Input files from their paths, on all ranks.
module gravier_read_case
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_input_text, only: read_input_text
  use gravier_config, only: config_t, parse_config
  implicit none
  private
  public :: read_config, read_input

contains

  !> Read the input file on rank 0 and parse it on all. Collective; errors are the same on all ranks.
  subroutine read_config(comm, path, config, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    call read_input(comm, path, text, error)
    if (allocated(error)) return
    call parse_config(path, text, config, error)
    call comm%agree(error)
  end subroutine read_config

  !> The whole of a file as text, on all ranks. Collective; errors are the same on all ranks.
  subroutine read_input(comm, path, text, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error

    call read_input_text(comm, path, text, error)
  end subroutine read_input

end module gravier_read_case
