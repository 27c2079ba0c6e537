!> Bindings to the C library, for the modules that deal with files: the only ones of this layer. Linux, 64 bits.
module gravier_system_calls
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_long, c_short, c_size_t, c_char, c_ptr, c_null_char, &
    & c_f_pointer, c_associated
  implicit none
  private
  public :: c_access, c_mkdir, c_rename, c_unlink, c_rmdir, c_open, c_creat, c_close, c_write, c_lseek, c_fsync, c_ftruncate
  public :: c_fallocate, c_fstatvfs, c_glob, c_globfree, c_getpid, c_isatty, c_readlink
  public :: c_strlen, c_read, c_fcntl, c_statx, c_gethostname, c_window_size
  public :: ask_window_size, o_rdonly, o_wronly, o_rdwr, o_creat, o_nonblock, o_cloexec, file_mode, directory_mode
  public :: falloc_fl_keep_size, falloc_fl_punch_hole, seek_set, seek_end, statvfs_words, glob_words
  public :: at_fdcwd, at_empty_path, statx_ino, statx_words, statx_inode_word, statx_device_word
  public :: file_is_there, file_is_writable
  public :: eintr, eacces, eagain, eexist, enodev, enospc, espipe, enolck, enosys, eopnotsupp
  public :: range_lock_t, set_lock, lock_shared, lock_exclusive
  public :: c_text, text_at, last_error, reason

  ! Linux values of the constants of <fcntl.h>, <errno.h> and <unistd.h>
  integer(c_int), parameter :: o_rdonly = 0, o_wronly = 1, o_rdwr = 2, o_creat = int(o"100", c_int), &
    & o_nonblock = int(o"4000", c_int), o_cloexec = int(o"2000000", c_int)
  integer(c_int), parameter :: falloc_fl_keep_size = 1, falloc_fl_punch_hole = 2
  integer(c_int), parameter :: seek_set = 0, seek_end = 2
  integer(c_int), parameter :: eintr = 4, eagain = 11, eacces = 13, eexist = 17, enodev = 19, enospc = 28, espipe = 29, &
    & enolck = 37, enosys = 38, eopnotsupp = 95, edquot = 122
  !> of fcntl: take a lock or fail at once; two kinds of locks
  integer(c_int), parameter :: set_lock = 6
  integer(c_short), parameter :: lock_shared = 0, lock_exclusive = 1
  !> of ioctl: rows, columns, and two more numbers
  integer(c_long), parameter :: ask_window_size = int(z"5413", c_long)
  !> of statx: paths from the working directory on, or none and an open file; what is asked for
  integer(c_int), parameter :: at_fdcwd = -100, at_empty_path = int(z"1000", c_int), statx_ino = 256
  !> of access
  integer(c_int), parameter :: file_is_there = 0, file_is_writable = 2
  !> more than the length of struct statx, on every processor the same, and its words of the inode and of the device
  integer, parameter :: statx_words = 64, statx_inode_word = 5, statx_device_word = 18
  !> more than the length of struct statvfs
  integer, parameter :: statvfs_words = 32
  !> more than the length of struct glob_t, which begins with the number of paths and their address
  integer, parameter :: glob_words = 16
  !> permissions before the user's umask
  integer(c_int), parameter :: file_mode = int(o"666", c_int), directory_mode = int(o"777", c_int)

  !> struct flock: a lock on bytes [start, start + length) of a file.
  type, bind(C) :: range_lock_t
    integer(c_short) :: kind = lock_shared
    !> start counts from the beginning of the file
    integer(c_short) :: whence = 0
    integer(c_int64_t) :: start = 0, length = 0
    integer(c_int) :: process = 0
  end type range_lock_t

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

    integer(c_int) function c_access(path, mode) bind(C, name="access")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: mode
    end function c_access

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

    integer(c_int) function c_open(path, flags, mode) bind(C, name="open")
      import :: c_int, c_char
      implicit none
      character(kind=c_char), intent(in) :: path(*)
      !> the second counts for o_creat only
      integer(c_int), value :: flags, mode
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

    integer(c_int) function c_window_size(descriptor, request, size) bind(C, name="ioctl")
      import :: c_int, c_long, c_short
      implicit none
      integer(c_int), value :: descriptor
      integer(c_long), value :: request
      integer(c_short), intent(inout) :: size(4)
    end function c_window_size

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

    integer(c_int64_t) function c_read(descriptor, buffer, count) bind(C, name="read")
      import :: c_int, c_int64_t, c_size_t, c_ptr
      implicit none
      integer(c_int), value :: descriptor
      type(c_ptr), value :: buffer
      integer(c_size_t), value :: count
    end function c_read

    integer(c_int) function c_fcntl(descriptor, command, range) bind(C, name="fcntl")
      import :: c_int, range_lock_t
      implicit none
      integer(c_int), value :: descriptor, command
      type(range_lock_t), intent(inout) :: range
    end function c_fcntl

    integer(c_int) function c_statx(directory, path, flags, mask, status) bind(C, name="statx")
      import :: c_int, c_int64_t, c_char
      implicit none
      integer(c_int), value :: directory, flags, mask
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(inout) :: status(*)
    end function c_statx

    integer(c_int) function c_gethostname(name, room) bind(C, name="gethostname")
      import :: c_int, c_size_t, c_ptr
      implicit none
      type(c_ptr), value :: name
      integer(c_size_t), value :: room
    end function c_gethostname
  end interface

contains

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

end module gravier_system_calls
