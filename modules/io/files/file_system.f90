!> What Fortran leaves to the operating system: directories, atomic renames, where paths lead, and whether the standard output is
!> a terminal.
module gravier_file_system
  use, intrinsic :: iso_c_binding, only: c_int, c_short, c_int64_t, c_size_t, c_char, c_ptr, c_null_char, c_null_ptr, &
    & c_f_pointer, c_loc
  use gravier_kinds, only: i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_system_calls, only: ask_window_size, file_is_there, file_is_writable, c_window_size, c_access, c_close, &
    & c_creat, c_fallocate, c_fsync, c_getpid, c_gethostname, c_glob, c_globfree, c_isatty, c_lseek, c_mkdir, c_open, &
    & c_readlink, c_rename, c_rmdir, c_statx, c_unlink, c_write, c_text, text_at, last_error, reason, o_rdonly, o_wronly, &
    & o_nonblock, file_mode, directory_mode, falloc_fl_keep_size, falloc_fl_punch_hole, seek_end, at_fdcwd, at_empty_path, &
    & statx_ino, statx_words, statx_inode_word, statx_device_word, eexist, enodev, espipe, glob_words
  implicit none
  private
  public :: make_directory, check_directory, is_directory, remove_directory, rename_file, remove_file, check_readable
  public :: check_creatable, file_length, replace_file, terminal_width, host_name
  public :: path_t, add_path, list_files
  public :: place_t, place_of, place_of_open, is_device

  !> A path of any length.
  type :: path_t
    character(len=:), allocatable :: text
  end type path_t

  !> Where a path leads, whatever it is spelled like: two places are equal (==) where the paths lead to one file, be it there or not
  !> yet.
  type :: place_t
    private
    !> of the file, or of the nearest directory above it that is there
    integer(i8) :: device = 0, inode = 0
    !> the way on from there, to what is not there yet
    character(len=:), allocatable :: rest
  contains
    procedure :: is_there => place_is_there
    procedure, private :: equals => place_equals
    generic :: operator(==) => equals
  end type place_t

  !> columns of a terminal that does not say how many it has
  integer, parameter :: usual_width = 80
  !> processes between a rank and its launcher, at most
  integer, parameter :: highest_ancestor = 16
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

  !> Check that `make_directory` can make a directory, or find it, as far as permissions tell without a write. Failure:
  !> status_failure, with the system's reason. Not collective: call on one rank.
  subroutine check_directory(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: nearest
    integer :: last

    if (allocated(error)) return
    ! up to the nearest name that is there
    nearest = trim(path)
    do while (nearest /= "")
      if (c_access(c_text(nearest), file_is_there) == 0) exit
      last = index(nearest, "/", back=.true.)
      nearest = nearest(:last - 1)
      if (last == 1) nearest = "/"
    end do
    if (nearest == "") nearest = "."
    if (c_access(c_text(nearest//"/."), file_is_writable) /= 0) call raise(error, status_failure, nearest// &
      & ": nothing can be written there: "//reason(last_error()))
  end subroutine check_directory

  !> Whether a directory is there.
  logical function is_directory(path)
    character(len=*), intent(in) :: path
    is_directory = c_access(c_text(path//"/."), file_is_there) == 0
  end function is_directory

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
    character(len=*), parameter :: text = "probe"
    character(len=:), allocatable :: name
    integer(c_int) :: descriptor, number

    name = ".gravier-probe-"//to_text(int(c_getpid(), i8))
    if (len(path) > 0) name = path//"/"//name
    number = 0
    descriptor = c_creat(c_text(name), file_mode)
    if (descriptor < 0) then
      number = last_error()
    else
      if (c_write(descriptor, text, len(text, c_size_t)) /= len(text)) number = last_error()
      if (c_close(descriptor) /= 0 .and. number == 0) number = last_error()
    end if
    if (number /= 0) call raise(error, status_failure, path//": this directory cannot be written to: "//name//": "//reason(number))
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
    descriptor = c_open(c_text(path), o_rdonly, 0_c_int)
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
    integer(c_int) :: descriptor, ignored

    if (allocated(error)) return
    descriptor = c_creat(c_text(path), file_mode)
    if (descriptor < 0) then
      call raise(error, status_failure, path//": cannot create this file: "//reason(last_error()))
      return
    end if
    ignored = c_close(descriptor)
  end subroutine check_creatable

  !> Where a path leads: the file by its device and inode, links followed; for a file that is not there yet, the nearest directory
  !> above it and the names on the way.
  type(place_t) function place_of(path) result(place)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: here, name, rest
    integer :: cut

    here = path
    if (here == "") here = "."
    rest = ""
    do
      place = identified(at_fdcwd, here, 0_c_int)
      if (place%is_there() .or. here == "." .or. here == "/") exit
      cut = index(here, "/", back=.true.)
      name = here(cut + 1:)
      if (name /= "" .and. name /= ".") rest = "/"//name//rest
      if (cut == 0) then
        here = "."
      else
        here = here(1:max(1, cut - 1))
      end if
    end do
    place%rest = rest
  end function place_of

  !> The file that is open as a descriptor, be it under a name still or not.
  type(place_t) function place_of_open(descriptor) result(place)
    integer(c_int), intent(in) :: descriptor
    place = identified(descriptor, "", at_empty_path)
  end function place_of_open

  !> The file or directory that statx finds, by its device and inode; both zero where it finds none.
  type(place_t) function identified(directory, path, flags) result(place)
    integer(c_int), intent(in) :: directory, flags
    character(len=*), intent(in) :: path
    integer(c_int64_t) :: status(statx_words)

    place%rest = ""
    if (c_statx(directory, c_text(path), flags, statx_ino, status) /= 0) return
    place%device = int(status(statx_device_word), i8)
    place%inode = int(status(statx_inode_word), i8)
  end function identified

  !> Whether there was a file or directory when the place was asked for.
  pure logical function place_is_there(self) result(is_there)
    class(place_t), intent(in) :: self
    is_there = self%inode /= 0 .and. self%rest == ""
  end function place_is_there

  pure logical function place_equals(self, other) result(equal)
    class(place_t), intent(in) :: self
    type(place_t), intent(in) :: other

    equal = self%inode /= 0 .and. self%inode == other%inode .and. self%device == other%device
    if (equal) equal = self%rest == other%rest
  end function place_equals

  !> Whether a name leads to a terminal, a pipe, /dev/null or the like: what has no room on a disk.
  logical function is_device(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: descriptor, number, ignored

    is_device = .false.
    descriptor = c_open(c_text(path), ior(o_wronly, o_nonblock), 0_c_int)
    if (descriptor < 0) return
    ! to free room behind the end of a file changes nothing in it
    number = 0
    if (c_fallocate(descriptor, ior(falloc_fl_keep_size, falloc_fl_punch_hole), 2_c_int64_t**40, 1_c_int64_t) /= 0) &
      & number = last_error()
    is_device = number == enodev .or. number == espipe
    ignored = c_close(descriptor)
  end function is_device

  !> The name of this machine.
  function host_name() result(name)
    character(len=:), allocatable :: name
    character(kind=c_char, len=256), target :: buffer
    integer(c_int) :: ignored

    buffer = ""
    ignored = c_gethostname(c_loc(buffer), int(len(buffer) - 1, c_size_t))
    name = trim(buffer(1:index(buffer//c_null_char, c_null_char) - 1))
  end function host_name

  !> Columns of the terminal on which a person looks at the standard output of this process, 0 where nobody does. Open MPI gives a
  !> rank a pseudo terminal whatever its own output is: where it has started the process, the first process above that writes
  !> elsewhere is asked, the launcher. Where the terminal does not say, 80.
  integer function terminal_width() result(width)
    character(len=:), allocatable :: mine, place
    integer :: process, level, length
    integer(c_int) :: descriptor, ignored

    width = 0
    if (c_isatty(1_c_int) /= 1) return
    call get_environment_variable("OMPI_COMM_WORLD_SIZE", length=length)
    if (length == 0) then
      width = width_of(1_c_int)
      return
    end if
    process = int(c_getpid(), i4)
    mine = output_of(process)
    place = mine
    do level = 1, highest_ancestor
      process = parent_of(process)
      place = output_of(process)
      if (process <= 1 .or. place /= mine) exit
    end do
    if (index(place, "/dev/pts/") /= 1 .and. index(place, "/dev/tty") /= 1) return
    descriptor = c_open(c_text(place), ior(o_rdonly, o_nonblock), 0_c_int)
    width = width_of(descriptor)
    if (descriptor >= 0) ignored = c_close(descriptor)
  end function terminal_width

  integer function width_of(descriptor) result(width)
    integer(c_int), intent(in) :: descriptor
    integer(c_short) :: sizes(4)

    sizes(:) = 0_c_short
    width = 0
    if (descriptor >= 0) then
      if (c_window_size(descriptor, ask_window_size, sizes) == 0) width = sizes(2)
    end if
    if (width < 1) width = usual_width
  end function width_of

  !> What a process has as its standard output; empty where that is not known.
  function output_of(process) result(place)
    integer, intent(in) :: process
    character(len=:), allocatable :: place
    character(kind=c_char, len=256), target :: buffer
    integer(c_int64_t) :: length

    length = c_readlink(c_text("/proc/"//to_text(process)//"/fd/1"), c_loc(buffer), int(len(buffer), c_size_t))
    place = buffer(1:max(0, narrow(length)))
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

  !> Length of a file in bytes, 0 when there is none.
  integer(i8) function file_length(path) result(length)
    character(len=*), intent(in) :: path
    integer(c_int) :: descriptor, ignored

    length = 0
    descriptor = c_open(c_text(path), o_rdonly, 0_c_int)
    if (descriptor < 0) return
    length = int(c_lseek(descriptor, 0_c_int64_t, seek_end), i8)
    ignored = c_close(descriptor)
  end function file_length

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
    descriptor = c_open(c_text(path), o_rdonly, 0_c_int)
    if (descriptor < 0) then
      number = last_error()
      return
    end if
    if (c_fsync(descriptor) /= 0) number = last_error()
    ignored = c_close(descriptor)
  end function sync_to_disk

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
    if (c_glob(escaped(directory)//"/*"//suffix//c_null_char, 0_c_int, c_null_ptr, found) == 0) n(1) = narrow(found(1))
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

end module gravier_file_system
