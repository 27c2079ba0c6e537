!> What Fortran leaves to the operating system: directories, atomic renames, reserved disk space, text files whose every
!> write is checked, and whether the standard output is a terminal. The only file with bindings to the C library.
module gravier_file_system
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_size_t, c_char, c_ptr, c_null_char, c_null_ptr, &
    & c_f_pointer, c_associated, c_loc
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  implicit none
  private
  public :: make_directory, remove_directory, rename_file, remove_file, check_readable, check_creatable, reserve_space, file_length
  public :: extend_file, replace_file, on_terminal, place_t, place_of
  public :: path_t, add_path, list_files, text_file_t, text_at

  !> Where a path leads, whatever it is spelled like: two places are equal (==) where the paths lead to one file.
  type :: place_t
    private
    !> of the file, or of the nearest directory above it that is there
    integer(i8) :: device = 0, inode = 0
    !> the way on from there, to what is not there yet
    character(len=:), allocatable :: rest
  contains
    procedure, private :: equals => place_equals
    generic :: operator(==) => equals
  end type place_t

  !> A path of any length.
  type :: path_t
    character(len=:), allocatable :: text
  end type path_t

  !> A text file written piece by piece; after a failed write it ends with the last complete piece.
  type :: text_file_t
    private
    integer(c_int) :: descriptor = -1
    !> bytes written so far
    integer(c_int64_t) :: length = 0
    character(len=:), allocatable :: path
  contains
    procedure :: create => text_file_create
    procedure :: continue => text_file_continue
    procedure :: append => text_file_append
    procedure :: replace => text_file_replace
    procedure :: close => text_file_close
    procedure :: is_open => text_file_is_open
  end type text_file_t

  ! Linux values of the constants of <fcntl.h>, <errno.h> and <unistd.h>
  integer(c_int), parameter :: o_rdonly = 0, o_wronly = 1
  integer(c_int), parameter :: falloc_fl_keep_size = 1
  integer(c_int), parameter :: seek_set = 0, seek_end = 2
  integer(c_int), parameter :: eintr = 4, eexist = 17, enospc = 28, enosys = 38, eopnotsupp = 95, edquot = 122
  !> more than the length of struct statvfs of 64-bit Linux
  integer, parameter :: statvfs_words = 32
  !> more than the length of struct glob_t of 64-bit Linux, which begins with the number of paths and their address
  integer, parameter :: glob_words = 16
  !> processes between a rank and its launcher, at most
  integer, parameter :: highest_ancestor = 16
  !> of the C library's statx: paths from the working directory on; what is asked for; more words than its struct has, on every
  !> processor the same, and those of the inode and of the device
  integer(c_int), parameter :: at_fdcwd = -100, statx_ino = 256
  integer, parameter :: statx_words = 64, inode_word = 5, device_word = 18
  !> permissions before the user's umask
  integer(c_int), parameter :: file_mode = int(o"666", c_int), directory_mode = int(o"777", c_int)

  interface
    integer(c_int) function c_mkdir(path, mode) bind(C, name="mkdir")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: mode
    end function c_mkdir

    integer(c_int) function c_rename(from, to) bind(C, name="rename")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_rename

    integer(c_int) function c_unlink(path) bind(C, name="unlink")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
    end function c_unlink
    integer(c_int) function c_rmdir(path) bind(C, name="rmdir")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
    end function c_rmdir

    integer(c_int) function c_open(path, flags) bind(C, name="open")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: flags
    end function c_open

    integer(c_int) function c_creat(path, mode) bind(C, name="creat")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: mode
    end function c_creat

    integer(c_int) function c_close(descriptor) bind(C, name="close")
      import :: c_int
      implicit none
      integer(c_int), value :: descriptor
    end function c_close

    integer(c_int64_t) function c_write(descriptor, buffer, count) bind(C, name="write")
      import :: c_int, c_int64_t, c_size_t, c_char
      implicit none
      integer(c_int), value :: descriptor
      character(kind=c_char), intent(in) :: buffer(*)
      integer(c_size_t), value :: count
    end function c_write

    integer(c_int64_t) function c_lseek(descriptor, offset, whence) bind(C, name="lseek")
      import :: c_int, c_int64_t
      implicit none
      integer(c_int), value :: descriptor
      integer(c_int64_t), value :: offset
      integer(c_int), value :: whence
    end function c_lseek

    integer(c_int) function c_fsync(descriptor) bind(C, name="fsync")
      import :: c_int
      implicit none
      integer(c_int), value :: descriptor
    end function c_fsync

    integer(c_int) function c_ftruncate(descriptor, length) bind(C, name="ftruncate")
      import :: c_int, c_int64_t
      implicit none
      integer(c_int), value :: descriptor
      integer(c_int64_t), value :: length
    end function c_ftruncate

    integer(c_int) function c_fallocate(descriptor, mode, offset, length) bind(C, name="fallocate")
      import :: c_int, c_int64_t
      implicit none
      integer(c_int), value :: descriptor, mode
      integer(c_int64_t), value :: offset, length
    end function c_fallocate

    integer(c_int) function c_fstatvfs(descriptor, status) bind(C, name="fstatvfs")
      import :: c_int, c_int64_t
      implicit none
      integer(c_int), value :: descriptor
      integer(c_int64_t), intent(inout) :: status(*)
    end function c_fstatvfs

    integer(c_int) function c_statx(directory, path, flags, mask, status) bind(C, name="statx")
      import :: c_int, c_int64_t, c_char
      implicit none
      integer(c_int), value :: directory, flags, mask
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(inout) :: status(*)
    end function c_statx

    integer(c_int) function c_glob(pattern, flags, on_error, found) bind(C, name="glob")
      import :: c_int, c_int64_t, c_char, c_ptr
      implicit none
      character(kind=c_char), intent(in) :: pattern(*)
      integer(c_int), value :: flags
      type(c_ptr), value :: on_error
      integer(c_int64_t), intent(inout) :: found(*)
    end function c_glob

    subroutine c_globfree(found) bind(C, name="globfree")
      import :: c_int64_t
      implicit none
      integer(c_int64_t), intent(inout) :: found(*)
    end subroutine c_globfree

    integer(c_int) function c_getpid() bind(C, name="getpid")
      import :: c_int
      implicit none
    end function c_getpid

    integer(c_int) function c_isatty(descriptor) bind(C, name="isatty")
      import :: c_int
      implicit none
      integer(c_int), value :: descriptor
    end function c_isatty

    integer(c_int64_t) function c_readlink(path, target, room) bind(C, name="readlink")
      import :: c_int64_t, c_size_t, c_char, c_ptr
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      type(c_ptr), value :: target
      integer(c_size_t), value :: room
    end function c_readlink

    type(c_ptr) function c_errno_location() bind(C, name="__errno_location")
      import :: c_ptr
      implicit none
    end function c_errno_location

    type(c_ptr) function c_strerror(number) bind(C, name="strerror")
      import :: c_ptr, c_int
      implicit none
      integer(c_int), value :: number
    end function c_strerror

    integer(c_size_t) function c_strlen(text) bind(C, name="strlen")
      import :: c_ptr, c_size_t
      implicit none
      type(c_ptr), value :: text
    end function c_strlen
  end interface

contains

  !> Make a directory and those above it, and check that a file can be written there. Not collective: call on one
  !> rank. Failure: status_failure, with the system's reason.
  subroutine make_directory(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer :: i
    integer(c_int) :: number

    if (allocated(error)) return
    number = 0
    do i = 1, len_trim(path)
      if (i > 1 .and. (i == len_trim(path) .or. path(i:i) == "/")) number = make_one(path(1:i))
      if (i == 1 .and. len_trim(path) == 1) number = make_one(path(1:1))
    end do
    if (number /= 0 .and. number /= eexist) then
      call raise(error, status_failure, trim(path)//": cannot make this directory: "//reason(number))
      return
    end if
    call probe_directory(trim(path), error)
  end subroutine make_directory

  !> Make one directory; the result is the system's error number, 0 for success.
  integer(c_int) function make_one(path) result(number)
    character(len=*), intent(in) :: path
    number = 0
    if (c_mkdir(c_text(path), directory_mode) /= 0) number = last_error()
  end function make_one

  !> Write and remove a small file in `path`.
  subroutine probe_directory(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(text_file_t) :: probe
    type(error_t), allocatable :: failure
    character(len=:), allocatable :: name

    name = ".gravier-probe-"//to_text(int(c_getpid(), i8))
    if (len(path) > 0) name = path//"/"//name
    call probe%create(name, failure)
    call probe%append("probe", failure)
    call probe%close(failure)
    if (allocated(failure)) then
      call raise(error, status_failure, path//": this directory cannot be written to: "//failure%message)
    end if
    call remove_file(name)
  end subroutine probe_directory

  !> Rename a file, replacing what had the new name in one indivisible operation.
  subroutine rename_file(from, to, error)
    character(len=*), intent(in) :: from, to
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (c_rename(c_text(from), c_text(to)) /= 0) then
      call raise(error, status_failure, from//": cannot rename to "//to//": "//reason(last_error()))
    end if
  end subroutine rename_file

  !> Remove a directory that is empty, if it is there; any other stays.
  subroutine remove_directory(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: ignored
    ignored = c_rmdir(c_text(path))
  end subroutine remove_directory

  !> Remove a file if it is there.
  subroutine remove_file(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: ignored
    ignored = c_unlink(c_text(path))
  end subroutine remove_file

  !> Check that a file can be opened for reading. Failure: status_input, with the system's reason.
  subroutine check_readable(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int) :: descriptor, ignored

    if (allocated(error)) return
    descriptor = c_open(c_text(path), o_rdonly)
    if (descriptor < 0) then
      call raise(error, status_input, path//": cannot read this file: "//reason(last_error()))
      return
    end if
    ignored = c_close(descriptor)
  end subroutine check_readable

  !> Check that a file can be created; it is left empty. Failure: status_failure, with the system's reason.
  subroutine check_creatable(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(text_file_t) :: file

    if (allocated(error)) return
    call file%create(path, error)
    if (.not. allocated(error)) call file%close(error)
  end subroutine check_creatable

  !> Reserve disk space beyond the end of a file, leaving its length as it is, so that writing it later cannot fail
  !> for want of space. Where the file system knows no reservation, only compare with the space that is free now.
  !> Failure: status_failure; the file is as it was.
  subroutine reserve_space(path, bytes, error, start)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: bytes
    type(error_t), allocatable, intent(inout) :: error
    !> also reserve what is missing between this place (from 0) and the end
    integer(i8), intent(in), optional :: start
    integer(c_int) :: descriptor, number, ignored
    integer(c_int64_t) :: length, first

    if (allocated(error) .or. bytes <= 0) return
    descriptor = c_open(c_text(path), o_wronly)
    if (descriptor < 0) then
      call raise(error, status_failure, path//": cannot write to this file: "//reason(last_error()))
      return
    end if
    length = c_lseek(descriptor, 0_c_int64_t, seek_end)
    first = length
    if (present(start)) first = min(first, int(start, c_int64_t))
    number = allocate_range(descriptor, first, length + bytes)
    if (number == enosys .or. number == eopnotsupp) number = compare_with_free(descriptor, bytes)
    if (number /= 0) then
      ! some file systems keep the part that did fit: give it back
      ignored = c_ftruncate(descriptor, length)
      call raise(error, status_failure, path//": "//reason(number)//": "//to_text(bytes)// &
        & " bytes needed; what was written before stays readable")
    end if
    ignored = c_close(descriptor)
  end subroutine reserve_space

  !> Whether a person looks at the standard output of this process. Open MPI gives a rank a pseudo terminal whatever its own
  !> output is: where it has started the process, the first process above that writes elsewhere is asked, the launcher.
  logical function on_terminal()
    character(len=:), allocatable :: mine, place
    integer :: process, level, length

    on_terminal = c_isatty(1_c_int) == 1
    call get_environment_variable("OMPI_COMM_WORLD_SIZE", length=length)
    if (.not. on_terminal .or. length == 0) return
    process = int(c_getpid())
    mine = output_of(process)
    place = mine
    do level = 1, highest_ancestor
      process = parent_of(process)
      place = output_of(process)
      if (process <= 1 .or. place /= mine) exit
    end do
    on_terminal = index(place, "/dev/pts/") == 1 .or. index(place, "/dev/tty") == 1
  end function on_terminal

  !> What a process has as its standard output; empty where that is not known.
  function output_of(process) result(place)
    integer, intent(in) :: process
    character(len=:), allocatable :: place
    character(kind=c_char, len=256), target :: buffer
    integer(c_int64_t) :: length

    length = c_readlink(c_text("/proc/"//to_text(process)//"/fd/1"), c_loc(buffer), int(len(buffer), c_size_t))
    place = buffer(1:max(0, int(length)))
  end function output_of

  !> The process that started another one; 0 where that is not known.
  integer function parent_of(process) result(parent)
    integer, intent(in) :: process
    character(len=1024) :: row
    character :: state
    integer :: unit, stat

    parent = 0
    open (newunit=unit, file="/proc/"//to_text(process)//"/stat", action="read", status="old", iostat=stat)
    if (stat /= 0) return
    read (unit, "(a)", iostat=stat) row
    close (unit)
    ! the name of the program, in brackets, may hold anything
    if (stat == 0) read (row(index(row, ")", back=.true.) + 1:), *, iostat=stat) state, parent
    if (stat /= 0) parent = 0
  end function parent_of

  !> Where a path leads: the file by its device and inode, links followed; for a file that is not there yet, the nearest directory
  !> above it and the names on the way.
  function place_of(path) result(place)
    character(len=*), intent(in) :: path
    type(place_t) :: place
    character(len=:), allocatable :: here, name
    integer(c_int64_t) :: status(statx_words)
    integer :: cut

    here = path
    if (here == "") here = "."
    place%rest = ""
    do
      status(:) = 0
      if (c_statx(at_fdcwd, c_text(here), 0_c_int, statx_ino, status) == 0) exit
      if (here == "." .or. here == "/") exit
      cut = index(here, "/", back=.true.)
      name = here(cut + 1:)
      if (name /= "" .and. name /= ".") place%rest = "/"//name//place%rest
      if (cut == 0) then
        here = "."
      else
        here = here(1:max(1, cut - 1))
      end if
    end do
    place%device = int(status(device_word), i8)
    place%inode = int(status(inode_word), i8)
  end function place_of

  pure logical function place_equals(self, other) result(equal)
    class(place_t), intent(in) :: self
    type(place_t), intent(in) :: other

    equal = self%inode == other%inode .and. self%device == other%device
    if (equal) equal = self%rest == other%rest
  end function place_equals

  !> Length of a file in bytes, 0 when there is none.
  integer(i8) function file_length(path) result(length)
    character(len=*), intent(in) :: path
    integer(c_int) :: descriptor, ignored

    length = 0
    descriptor = c_open(c_text(path), o_rdonly)
    if (descriptor < 0) return
    length = int(c_lseek(descriptor, 0_c_int64_t, seek_end), i8)
    ignored = c_close(descriptor)
  end function file_length

  !> Give a file at least `length` bytes, zeros behind its end. Failure: status_failure, with the system's reason.
  subroutine extend_file(path, length, error)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: length
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int) :: descriptor, number, ignored

    if (allocated(error)) return
    number = 0
    descriptor = c_open(c_text(path), o_wronly)
    if (descriptor < 0) then
      number = last_error()
    else
      if (c_lseek(descriptor, 0_c_int64_t, seek_end) < length) then
        if (c_ftruncate(descriptor, int(length, c_int64_t)) /= 0) number = last_error()
      end if
      ignored = c_close(descriptor)
    end if
    if (number /= 0) call raise(error, status_failure, path//": cannot write to this file: "//reason(number))
  end subroutine extend_file

  !> Put a finished file in the place of another in one indivisible operation, once its content is on the disk: whatever
  !> happens, a loss of power included, `to` is the older file or the new one whole. Failure: status_failure, with the
  !> system's reason; `to` is as it was.
  subroutine replace_file(from, to, error)
    character(len=*), intent(in) :: from, to
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int) :: number

    if (allocated(error)) return
    number = sync_to_disk(from)
    if (number /= 0) call raise(error, status_failure, from//": cannot bring this file to the disk: "//reason(number))
    call rename_file(from, to, error)
    ! the new name itself; not every file system can, and the rename is done
    if (.not. allocated(error)) number = sync_to_disk(directory_of(to))
  end subroutine replace_file

  pure function directory_of(path) result(directory)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: directory
    directory = path(1:index(path, "/", back=.true.))
    if (len(directory) == 0) directory = "."
  end function directory_of

  !> Bring a file, or the names in a directory, to the disk; the result is the system's error number, 0 for success.
  integer(c_int) function sync_to_disk(path) result(number)
    character(len=*), intent(in) :: path
    integer(c_int) :: descriptor, ignored

    number = 0
    descriptor = c_open(c_text(path), o_rdonly)
    if (descriptor < 0) then
      number = last_error()
      return
    end if
    if (c_fsync(descriptor) /= 0) number = last_error()
    ignored = c_close(descriptor)
  end function sync_to_disk

  !> Reserve bytes [first, last) of an open file; the result is the system's error number, 0 for success.
  integer(c_int) function allocate_range(descriptor, first, last) result(number)
    integer(c_int), intent(in) :: descriptor
    integer(c_int64_t), intent(in) :: first, last

    do
      number = 0
      if (c_fallocate(descriptor, falloc_fl_keep_size, first, last - first) /= 0) number = last_error()
      if (number /= eintr) return
    end do
  end function allocate_range

  !> ENOSPC when the file system of an open file has less free space than `bytes`, else 0.
  integer(c_int) function compare_with_free(descriptor, bytes) result(number)
    integer(c_int), intent(in) :: descriptor
    integer(i8), intent(in) :: bytes
    integer(c_int64_t) :: status(statvfs_words)

    number = 0
    if (c_fstatvfs(descriptor, status) /= 0) return
    ! words of struct statvfs: 2 is the size of a block, 5 the number of blocks free to this user
    if (status(5) < bytes/max(status(2), 1_c_int64_t) + 1) number = enospc
  end function compare_with_free

  !> Create an empty text file, replacing an older one. Failure: status_failure, with the system's reason.
  subroutine text_file_create(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call self%close(error)
    self%path = path
    self%length = 0
    self%descriptor = c_creat(c_text(path), file_mode)
    if (self%descriptor < 0) then
      call raise(error, status_failure, path//": cannot create this file: "//reason(last_error()))
    end if
  end subroutine text_file_create

  !> Open a text file behind what it holds, creating it where there is none. Failure: status_failure, with the system's
  !> reason.
  subroutine text_file_continue(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    logical :: exists

    if (allocated(error)) return
    inquire (file=path, exist=exists)
    if (.not. exists) then
      call self%create(path, error)
      return
    end if
    call self%close(error)
    self%path = path
    self%descriptor = c_open(c_text(path), o_wronly)
    if (self%descriptor < 0) then
      call raise(error, status_failure, path//": cannot write to this file: "//reason(last_error()))
      return
    end if
    self%length = c_lseek(self%descriptor, 0_c_int64_t, seek_end)
  end subroutine text_file_continue

  !> Append text and hand it to the system at once. On failure the file is cut back to what it held before.
  subroutine text_file_append(self, text, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int64_t) :: done, written, ignored
    integer(c_int) :: number, cut

    if (allocated(error)) return
    done = 0
    do while (done < len(text))
      written = c_write(self%descriptor, text(done + 1:), int(len(text) - done, c_size_t))
      if (written >= 0) then
        done = done + written
        cycle
      end if
      number = last_error()
      if (number == eintr) cycle
      cut = c_ftruncate(self%descriptor, self%length)
      ignored = c_lseek(self%descriptor, self%length, seek_set)
      call raise(error, status_failure, self%path//": cannot write to this file: "//reason(number)//": "// &
        & to_text(int(len(text), i8))//" bytes needed; what was written before stays readable")
      return
    end do
    self%length = self%length + done
  end subroutine text_file_append

  !> Give the file the name `path`, as replace_file does; it stays open.
  subroutine text_file_replace(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call replace_file(self%path, path, error)
    if (.not. allocated(error)) self%path = path
  end subroutine text_file_replace

  !> Close; a failure that the system had kept to itself shows here. Without effect on a file not open.
  subroutine text_file_close(self, error)
    class(text_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (self%descriptor < 0) return
    if (c_close(self%descriptor) /= 0) then
      call raise(error, status_failure, self%path//": cannot close this file: "//reason(last_error()))
    end if
    self%descriptor = -1
  end subroutine text_file_close

  pure logical function text_file_is_open(self) result(is_open)
    class(text_file_t), intent(in) :: self
    is_open = self%descriptor >= 0
  end function text_file_is_open

  !> The text as C wants it.
  pure function c_text(text) result(terminated)
    character(len=*), intent(in) :: text
    character(len=:, kind=c_char), allocatable :: terminated
    terminated = text//c_null_char
  end function c_text

  !> errno of the last call that failed.
  integer(c_int) function last_error() result(number)
    integer(c_int), pointer :: errno
    call c_f_pointer(c_errno_location(), errno)
    number = errno
  end function last_error

  !> The system's words for an error number.
  function reason(number) result(text)
    integer(c_int), intent(in) :: number
    character(len=:), allocatable :: text

    select case (number)
    case (enospc)
      text = "no space left on device"
    case (edquot)
      text = "disk quota exceeded"
    case default
      text = text_at(c_strerror(number))
    end select
  end function reason

  !> Add the paths of the files in a directory whose names end with `suffix`, in the order of their bytes.
  subroutine list_files(directory, suffix, paths)
    character(len=*), intent(in) :: directory, suffix
    type(path_t), allocatable, intent(inout) :: paths(:)
    integer(c_int64_t) :: found(glob_words)
    type(c_ptr), pointer :: address(:)
    integer :: k, n(1)

    found(:) = 0
    n = 0
    nullify (address)
    if (c_glob(escaped(directory)//"/*"//suffix//c_null_char, 0_c_int, c_null_ptr, found) == 0) n(1) = int(found(1))
    if (n(1) > 0) call c_f_pointer(transfer(found(2), c_null_ptr), address, n)
    do k = 1, n(1)
      call add_path(text_at(address(k)), paths)
    end do
    call c_globfree(found)
  end subroutine list_files

  !> Add a path at the end of a list.
  subroutine add_path(path, paths)
    character(len=*), intent(in) :: path
    type(path_t), allocatable, intent(inout) :: paths(:)
    type(path_t), allocatable :: longer(:)
    integer :: k

    allocate (longer(size(paths) + 1))
    do k = 1, size(paths)
      call move_alloc(paths(k)%text, longer(k)%text)
    end do
    longer(size(longer))%text = path
    call move_alloc(longer, paths)
  end subroutine add_path

  !> A path in which no letter is a pattern.
  pure function escaped(path) result(pattern)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: pattern
    integer :: i

    pattern = ""
    do i = 1, len(path)
      if (index("*?[\", path(i:i)) > 0) pattern = pattern//"\"
      pattern = pattern//path(i:i)
    end do
  end function escaped

  !> The text that C keeps at an address, empty for the null address.
  function text_at(address) result(text)
    type(c_ptr), intent(in) :: address
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer(c_size_t) :: length(1)
    integer :: i

    length = 0
    if (c_associated(address)) length = c_strlen(address)
    allocate (character(len=length(1)) :: text)
    if (length(1) == 0) return
    call c_f_pointer(address, letters, length)
    do i = 1, len(text)
      text(i:i) = letters(i)
    end do
  end function text_at

end module gravier_file_system
