!> What was run, in /run of results.h5: the program, its command line and its input file, at the start and at each restart.
module gravier_run_provenance
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_hdf5_file, only: h5_file_t
  implicit none
  private
  public :: provenance_t, make_restarts, note_restart

  !> What was run: enough to run it again.
  type :: provenance_t
    !> of the program
    character(len=:), allocatable :: version
    !> the command line, without the number of ranks
    character(len=:), allocatable :: command
    !> the input file, whole
    character(len=:), allocatable :: input_text
    !> 2 or 3
    integer :: dimension = 2
    !> of the start, 0 along axes that are not periodic; lower corner [m]
    real(dp) :: period(3) = 0.0_dp, origin(3) = 0.0_dp
  contains
    procedure :: bytes => provenance_bytes
    procedure :: write => provenance_write
  end type provenance_t

  character(len=*), parameter :: restarts = "/run/restarts"
  !> restarts for which their group has room in one block: up to there a program that dies leaves the file whole
  integer, parameter :: restarts_in_block = 50
  !> room for the headers of the group of a restart
  integer(i8), parameter :: bytes_of_headers = 8192

contains

  !> Bytes of what `write` writes.
  pure integer(i8) function provenance_bytes(self) result(bytes)
    class(provenance_t), intent(in) :: self
    bytes = len(self%version, kind=i8) + len(self%command, kind=i8) + len(self%input_text, kind=i8)
  end function provenance_bytes

  !> The texts, as attributes of a group. Collective.
  subroutine provenance_write(self, file, group, error)
    class(provenance_t), intent(in) :: self
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_t), allocatable, intent(inout) :: error

    call file%write_attribute(group, "version", self%version, error)
    call file%write_attribute(group, "command", self%command, error)
    call file%write_attribute(group, "input_text", self%input_text, error)
  end subroutine provenance_write

  !> The group of the restarts, empty. Collective.
  subroutine make_restarts(file, error)
    type(h5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    call file%make_group(restarts, error, members=restarts_in_block)
  end subroutine make_restarts

  !> Keep what is run from step `first` on in the place of what was run from it or from later ones. Collective.
  subroutine note_restart(file, first, error, run)
    type(h5_file_t), intent(inout) :: file
    integer, intent(in) :: first
    type(error_t), allocatable, intent(inout) :: error
    !> where a step follows
    type(provenance_t), intent(in), optional :: run
    character(len=:), allocatable :: name
    integer :: i, number, stat

    if (allocated(error)) return
    if (file%exists(restarts)) then
      do i = file%member_count(restarts), 1, -1
        name = file%member(restarts, i)
        read (name, *, iostat=stat) number
        if (stat == 0 .and. number >= first) call file%remove_group(restarts//"/"//name, error)
      end do
    end if
    if (.not. present(run)) return
    call file%reserve(bytes_of_headers + run%bytes(), error)
    name = restarts//"/"//to_text(first)
    call file%begin_group(name, error)
    call run%write(file, name, error)
    if (.not. allocated(error)) then
      call file%commit_group(error)
    else
      call file%abandon_group()
      call file%give_back()
    end if
  end subroutine note_restart

end module gravier_run_provenance
