!> An HDF5 file on the disk: created aside and named when it is whole, opened, closed, and kept readable whatever becomes of the
!> program.
!>
!> HDF5 can neither close nor forget a file whose headers find no room on the disk: on several ranks it waits for ever, and at the
!> end of the program it dies. So nothing is made in a file before there is room for it: writers call `reserve` with a bound of what
!> they write up to the next flush, headers included.
module gravier_hdf5_storage
  use hdf5, only: H5F_ACC_RDONLY_F, H5F_ACC_RDWR_F, H5F_ACC_TRUNC_F, H5F_SCOPE_GLOBAL_F, H5P_FILE_CREATE_F, h5fclose_f, &
    & h5fcreate_f, h5fflush_f, h5fget_filesize_f, h5fis_hdf5_f, h5fopen_f, h5pclose_f, h5pcreate_f, h5pset_istore_k_f, &
    & h5pset_obj_track_times_f, hid_t, hsize_t
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_disk_space, only: reserve_space, give_back_space, extend_file
  use gravier_file_system, only: check_readable, check_creatable, file_length, remove_file, replace_file
  use gravier_own_files, only: part_of, give_name, note_own
  use gravier_hdf5_properties, only: start_library, parallel_access, ask_for_one_block
  implicit none
  private
  public :: h5_storage_t, bytes_of_link, check_length

  !> An open HDF5 file.
  type, abstract :: h5_storage_t
    private
    !> the ranks that hold it open
    type(communicator_t), public :: comm
    !> its name, and where it is: aside until it has its name
    character(len=:), allocatable :: name, path
    integer(hid_t) :: id = -1
    logical :: writable = .false.
    !> on rank 0: length of the file when it was flushed last
    integer(i8) :: flushed = 0
    !> on rank 0: bytes that were reserved since
    integer(i8) :: reserved = 0
  contains
    procedure :: create => h5_create
    procedure :: open => h5_open
    procedure :: reopen => h5_reopen
    procedure :: show => h5_show
    procedure :: hide => h5_hide
    procedure :: leave => h5_leave
    procedure :: close => h5_close
    procedure :: discard => h5_discard
    procedure :: flush => h5_flush
    procedure :: reserve => h5_reserve
    procedure :: give_back => h5_give_back
    procedure :: is_open => h5_is_open
    procedure :: length => h5_length

    !> for the types that extend this one
    procedure :: root => h5_root
    procedure :: where_it_is => h5_where_it_is
    procedure :: fail => h5_fail
    procedure(abandon), deferred :: abandon_group
  end type h5_storage_t

  abstract interface
    !> Let go of a group that is not finished, before the file is closed.
    subroutine abandon(self)
      import :: h5_storage_t
      implicit none
      class(h5_storage_t), intent(inout) :: self
    end subroutine abandon
  end interface

  !> characters of a path: Open MPI 4.1 ends a process that opens a file whose path has more than some 230
  integer, parameter :: longest_path = 200
  !> reserved for an empty file, and for the link of a hidden group or other headers
  integer(i8), parameter :: bytes_of_file = 16384, bytes_of_link = 16384
  !> groups at the root that find room in its first block
  integer, parameter :: members_of_root = 8

contains

  !> Create a file, which is written aside: it takes its name, and the place of an older file, when it is shown or closed.
  subroutine h5_create(self, comm, path, error, chunks)
    class(h5_storage_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    !> keep room for so many chunks of each table in one block: to add one more of them is then a single write
    integer, intent(in), optional :: chunks
    integer(hid_t) :: access, creation
    integer :: stat, ignored

    if (allocated(error)) return
    call prepare(self, comm, path, part_of(path), error)
    if (comm%rank == 0 .and. .not. allocated(error)) then
      call check_creatable(self%path, error)
      call reserve_space(self%path, bytes_of_file, error)
      if (allocated(error)) call remove_file(self%path)
    end if
    call comm%agree(error)
    if (allocated(error)) return
    ! with headers of version 1.8 the room for chunks is kept in an object of HDF5's own that tells when it was made
    access = parallel_access(comm, .not. present(chunks))
    call h5pcreate_f(H5P_FILE_CREATE_F, creation, ignored)
    call h5pset_obj_track_times_f(creation, .false., ignored)
    call ask_for_one_block(creation, members_of_root)
    if (present(chunks)) call h5pset_istore_k_f(creation, (chunks + 1)/2, ignored)
    call h5fcreate_f(self%path, H5F_ACC_TRUNC_F, self%id, stat, creation_prp=creation, access_prp=access)
    call h5pclose_f(creation, ignored)
    call h5pclose_f(access, ignored)
    if (stat < 0) call raise(error, status_failure, self%path//": cannot create this HDF5 file")
    self%writable = .true.
    call comm%agree(error)
    ! to create the file has cut it, and given back what was reserved
    call self%reserve(bytes_of_file, error)
    if (allocated(error)) call self%discard()
  end subroutine h5_create

  !> Open an existing file for reading.
  subroutine h5_open(self, comm, path, error)
    class(h5_storage_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    call open_existing(self, comm, path, path, .false., error)
  end subroutine h5_open

  !> Open an existing file for reading and for writing more into it.
  subroutine h5_reopen(self, comm, path, error, aside)
    class(h5_storage_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    !> go on with a file that was left aside
    logical, intent(in), optional :: aside
    logical :: named

    named = .true.
    if (present(aside)) named = .not. aside
    if (named) then
      call open_existing(self, comm, path, path, .true., error)
      if (comm%rank == 0 .and. .not. allocated(error)) call note_own(path)
    else
      call open_existing(self, comm, path, part_of(path), .true., error)
    end if
  end subroutine h5_reopen

  !> Take its name away from an open file until it is shown or closed. On failure it is closed and keeps its name.
  subroutine h5_hide(self, error)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    type(communicator_t) :: comm
    character(len=:), allocatable :: name

    if (self%id < 0) return
    call close_file(self, error)
    if (self%comm%rank == 0) call replace_file(self%name, part_of(self%name), error)
    call self%comm%agree(error)
    if (allocated(error)) return
    comm = self%comm
    name = self%name
    call self%reopen(comm, name, error, aside=.true.)
  end subroutine h5_hide

  !> Open the file `name` where it is, at `path`.
  subroutine open_existing(self, comm, name, path, writable, error)
    class(h5_storage_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: name, path
    logical, intent(in) :: writable
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: access
    integer :: stat, ignored

    if (allocated(error)) return
    call prepare(self, comm, name, path, error)
    ! one rank alone looks first: a file that HDF5 cannot make sense of is never opened by all together
    if (comm%rank == 0 .and. .not. allocated(error)) then
      call check_format(path, error)
      if (writable) call reserve_space(path, bytes_of_file, error)
    end if
    call comm%agree(error)
    if (allocated(error)) return
    access = parallel_access(comm, writable)
    call h5fopen_f(path, merge(H5F_ACC_RDWR_F, H5F_ACC_RDONLY_F, writable), self%id, stat, access_prp=access)
    call h5pclose_f(access, ignored)
    if (stat < 0) call raise(error, status_input, path//": truncated or damaged HDF5 file")
    if (comm%rank == 0) self%flushed = file_length(path)
    self%writable = writable
    call comm%agree(error)
  end subroutine open_existing

  !> Check that `path` can be read and begins like an HDF5 file.
  subroutine check_format(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    logical :: is_hdf5
    integer :: stat

    call check_readable(path, error)
    if (allocated(error)) return
    call h5fis_hdf5_f(path, is_hdf5, stat)
    if (stat < 0 .or. .not. is_hdf5) call raise(error, status_input, path//": not an HDF5 file")
  end subroutine check_format

  !> Start the library, close what was open and remember where to find the file.
  subroutine prepare(self, comm, name, path, error)
    class(h5_storage_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: name, path
    type(error_t), allocatable, intent(inout) :: error

    call self%close(error)
    call start_library(error)
    self%comm = comm
    self%name = name
    self%path = path
    self%flushed = 0
    self%reserved = 0
    call check_length(path, error)
  end subroutine prepare

  !> Refuse a path with which MPI may not open a file (status_input).
  pure subroutine check_length(path, error)
    !> while the file is written, it has `part_of` its path
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (len(path) > longest_path) call raise(error, status_input, path//": a path of "//to_text(len(path))// &
      & " characters; MPI opens files with up to "//to_text(longest_path)//": expected a path from a directory that is nearer")
  end subroutine check_length

  !> Give the file its name, with what was written so far; it stays open. On failure it is removed, and an older file stays.
  subroutine h5_show(self, error)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    type(communicator_t) :: comm
    character(len=:), allocatable :: name

    if (self%id < 0) return
    call self%close(error)
    if (allocated(error)) return
    comm = self%comm
    name = self%name
    call open_existing(self, comm, name, name, .true., error)
  end subroutine h5_show

  !> Close; a file that is aside takes its name, or is removed where something failed before. Without effect on a file not open. A
  !> hidden group is lost.
  subroutine h5_close(self, error)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    logical :: aside

    if (self%id < 0) return
    aside = self%path /= self%name
    if (aside) call self%flush(error)
    if (aside .and. allocated(error)) then
      call self%discard()
      return
    end if
    call close_file(self, error)
    if (.not. aside) return
    if (self%comm%rank == 0) then
      if (allocated(error)) call remove_file(self%path)
      call give_name(self%name, error)
    end if
    call self%comm%agree(error)
  end subroutine h5_close

  !> Close, whatever happened before; a file that is aside is removed. Without effect on a file not open.
  subroutine h5_discard(self)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable :: ignored

    if (self%id < 0) return
    call close_file(self, ignored)
    if (self%comm%rank == 0 .and. self%path /= self%name) call remove_file(self%path)
  end subroutine h5_discard

  !> Close a file as it is, aside or not, whatever happened before. Without effect on a file not open.
  subroutine h5_leave(self)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable :: ignored

    if (self%id >= 0) call close_file(self, ignored)
  end subroutine h5_leave

  subroutine close_file(self, error)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    call self%abandon_group()
    call h5fclose_f(self%id, stat)
    self%id = -1
    if (stat < 0) call raise(error, merge(status_failure, status_input, self%writable), self%path//": cannot close this file")
    call self%comm%agree(error)
  end subroutine close_file

  !> Bring everything written so far to the disk: the file stays readable whatever becomes of the program afterwards.
  subroutine h5_flush(self, error)
    class(h5_storage_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer(hsize_t) :: length
    integer :: stat

    if (allocated(error)) return
    if (self%comm%rank == 0) then
      ! a file that the program dies over must not be shorter than its headers say
      call h5fget_filesize_f(self%id, length, stat)
      if (stat == 0) call extend_file(self%path, int(length, i8), error)
      ! HDF5 waits for ever when one rank cannot write its fraction of the headers: give them their place first
      call reserve_space(self%path, bytes_of_link, error, start=self%flushed, held=self%flushed + self%reserved)
    end if
    call self%comm%agree(error)
    if (allocated(error)) return
    call h5fflush_f(self%id, H5F_SCOPE_GLOBAL_F, stat)
    if (stat < 0) call raise(error, status_failure, self%path//": cannot write to this file: is the disk full?")
    call self%comm%agree(error)
    if (self%comm%rank == 0) self%flushed = file_length(self%path)
    ! HDF5 may have cut what was reserved behind the end
    self%reserved = 0
  end subroutine h5_flush

  !> Make sure of `bytes` of disk space for what will be written next, its headers included (allow 64 KiB for those of
  !> a few groups), besides what was reserved since the last flush. On failure nothing has been written and the file is as
  !> the last flush left it. Where the file system knows no reservation, the space that is free now is all that can be
  !> asked for.
  subroutine h5_reserve(self, bytes, error)
    class(h5_storage_t), intent(inout) :: self
    !> on rank 0: of all ranks together
    integer(i8), intent(in) :: bytes
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: held

    if (allocated(error)) return
    if (self%comm%rank == 0) then
      held = self%flushed + self%reserved
      call reserve_space(self%path, held + bytes - file_length(self%path), error, held=held)
      if (.not. allocated(error)) self%reserved = self%reserved + bytes
    end if
    call self%comm%agree(error)
  end subroutine h5_reserve

  !> Give back what was reserved since the last flush, where what it was for is not written after all. Collective.
  subroutine h5_give_back(self)
    class(h5_storage_t), intent(inout) :: self

    if (self%comm%rank == 0 .and. self%id >= 0 .and. self%reserved > 0) call give_back_space(self%path)
    self%reserved = 0
  end subroutine h5_give_back

  pure logical function h5_is_open(self) result(is_open)
    class(h5_storage_t), intent(in) :: self
    is_open = self%id >= 0
  end function h5_is_open

  !> Raise an error that names the file and the object in it.
  subroutine h5_fail(self, path, what, error)
    class(h5_storage_t), intent(in) :: self
    character(len=*), intent(in) :: path, what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, merge(status_failure, status_input, self%writable), self%name//": "//path//": "//what)
  end subroutine h5_fail

  !> Bytes of the file on the disk. Not collective.
  integer(i8) function h5_length(self) result(length)
    class(h5_storage_t), intent(in) :: self
    length = file_length(self%path)
  end function h5_length

  !> What HDF5 knows the open file by.
  pure integer(hid_t) function h5_root(self) result(root)
    class(h5_storage_t), intent(in) :: self
    root = self%id
  end function h5_root

  !> The path of the file now, aside or not.
  pure function h5_where_it_is(self) result(path)
    class(h5_storage_t), intent(in) :: self
    character(len=:), allocatable :: path
    path = self%path
  end function h5_where_it_is

end module gravier_hdf5_storage
