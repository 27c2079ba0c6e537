!> Text files read as a whole.
module gravier_input_text
  use gravier_errors, only: error_t, raise, status_input
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: check_readable
  implicit none
  private
  public :: read_input_text

contains

  !> The whole of a file as text, on all ranks; rank 0 alone reads it. Failure: status_input. Errors are the same on all ranks.
  !> Collective.
  subroutine read_input_text(comm, path, expected, text, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> for the message: a text file of ...
    character(len=*), intent(in) :: expected
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error

    text = ""
    if (allocated(error)) return
    if (comm%rank == 0) call read_text(path, expected, text, error)
    call comm%agree(error)
    if (allocated(error)) return
    call comm%broadcast_text(text, 0)
  end subroutine read_input_text

  subroutine read_text(path, expected, text, error)
    character(len=*), intent(in) :: path, expected
    character(len=:), allocatable, intent(inout) :: text
    type(error_t), allocatable, intent(inout) :: error
    integer :: unit, length, stat

    call check_readable(path, error)
    if (allocated(error)) return
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=stat)
    if (stat == 0) then
      inquire (unit=unit, size=length)
      if (allocated(text)) deallocate (text)
      allocate (character(len=max(length, 0)) :: text)
      if (length > 0) read (unit, iostat=stat) text
      close (unit)
    end if
    if (stat /= 0) call raise(error, status_input, path//": cannot read this file; expected "//expected)
  end subroutine read_text

end module gravier_input_text
