!> Input files as text, the same on all ranks.
module gravier_input_text
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_file_lines, only: read_whole_file
  implicit none
  private
  public :: read_input_text

contains

  !> The whole of a file as text, on all ranks; rank 0 alone reads it. Failure: status_input. Errors are the same on all ranks.
  !> Collective.
  subroutine read_input_text(comm, path, text, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (comm%rank == 0) then
      call read_whole_file(path, text, error)
    else
      text = ""
    end if
    call comm%agree(error)
    if (allocated(error)) return
    call comm%broadcast_text(text, 0)
  end subroutine read_input_text

end module gravier_input_text
