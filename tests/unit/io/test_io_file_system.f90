!> Directories, renames, reservation of disk space, text files whose writes are checked, and files that are others than before.
program test_io_file_system
  use, intrinsic :: iso_c_binding, only: c_int
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_file_system, only: make_directory, check_directory, is_directory, remove_directory, rename_file, &
    & replace_file, remove_file, check_readable, check_creatable, is_device, place_t, place_of, &
    & place_of_open
  use gravier_disk_space, only: reserve_space, give_back_space, extend_file
  use gravier_system_calls, only: c_open, c_close, c_text, o_rdonly
  use gravier_own_files, only: part_of, give_name, note_own, remove_own, check_own_files, forget_own_files
  use gravier_text_file, only: text_file_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=:), allocatable :: here

  call MPI_Init()
  here = scratch("io_file_system")
  call test_directories()
  call test_text_files()
  call test_renames()
  call test_places()
  call test_removing_directories()
  call test_replacing()
  call test_own_files()
  call test_reservation()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A path for files of this test.
  function scratch(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    character(len=1000) :: directory
    integer :: length, stat

    call get_environment_variable("GRAVIER_TEST_DIR", directory, length, stat)
    path = name
    if (stat == 0 .and. length > 0) path = directory(1:length)//"/"//name
  end function scratch

  subroutine expect(error, status, part, name)
    type(error_t), allocatable, intent(inout) :: error
    integer, intent(in) :: status
    character(len=*), intent(in) :: part, name

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, status, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    call check(index(error%message, new_line("a")) == 0, name//": one line")
    deallocate (error)
  end subroutine expect

  subroutine expect_none(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    if (allocated(error)) then
      call check(.false., name//": "//error%message)
      deallocate (error)
    else
      call check(.true., name)
    end if
  end subroutine expect_none

  !> A file is where its device and inode are, whatever the path; what is not there yet is where it would be.
  subroutine test_places()
    type(error_t), allocatable :: error
    type(text_file_t) :: file
    type(place_t) :: place

    call make_directory(here//"/places/deep", error)
    call file%create(here//"/places/file", "", error)
    call file%close(error)
    call expect_none(error, "a file to find")
    place = place_of(here//"/places/file")
    call check(place == place_of(here//"//places/./deep/../file"), "another spelling of a file")
    call check(.not. place == place_of(here//"/places/deep"), "a file and a directory")
    call check(.not. place == place_of(here//"/places/new"), "a file and one that is not there")
    place = place_of(here//"/places/new/file")
    call check(place == place_of(here//"/places/deep/../new/./file"), "another spelling of a file that is not there")
    call check(.not. place == place_of(here//"/places/deep/new/file"), "two directories that are not there")
    call check(place_of("new") == place_of("./new"), "from the working directory on")
    call check(place_of("") == place_of("."), "no path")
    call test_place_of_open(here//"/places/open")
  end subroutine test_places

  !> A file that is open is where its name leads to, until the name leads to another file or to none.
  subroutine test_place_of_open(path)
    character(len=*), intent(in) :: path
    type(error_t), allocatable :: error
    type(text_file_t) :: file
    type(place_t) :: place
    integer(c_int) :: descriptor, ignored

    call file%create(path, "older", error)
    call file%close(error)
    descriptor = c_open(c_text(path), o_rdonly, 0_c_int)
    call check(place_of_open(descriptor) == place_of(path), "an open file and its name")
    call check(place_of_open(descriptor) == place_of_open(descriptor), "an open file and itself")
    call file%create(path, "newer", error)
    call file%close(error)
    call expect_none(error, "a file that takes the place of an open one")
    call check(.not. place_of_open(descriptor) == place_of(path), "an open file whose name another one has")
    place = place_of(path)
    call check(place%is_there(), "a file that is there")
    call remove_own(path)
    call check(.not. place_of_open(descriptor) == place_of(path), "an open file without a name")
    place = place_of(path)
    call check(.not. place%is_there(), "a file that is not there any more")
    ignored = c_close(descriptor)
    call check(.not. place_of_open(descriptor) == place_of_open(descriptor), "no open file is equal to none")
  end subroutine test_place_of_open

  subroutine test_directories()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call make_directory(here//"/a/b/c", error)
    call expect_none(error, "nested directories")
    call make_directory(here//"/a/b/c", error)
    call expect_none(error, "a directory that exists")
    call make_directory(here//"/a//d/", error)
    call expect_none(error, "a path with slashes to spare")
    call file%create(here//"/a/d/file", "", error)
    call file%close(error)
    call expect_none(error, "a file in the new directory")
    call make_directory(here//"/a/d/file", error)
    call expect(error, status_failure, here//"/a/d/file", "a file where a directory should be")
    call make_directory(here//"/a/d/file/e", error)
    call expect(error, status_failure, "Not a directory", "a directory below a file")
    call check(is_directory(here//"/a/d"), "a directory")
    call check(.not. is_directory(here//"/a/d/file"), "a file is no directory")
    call check(.not. is_directory(here//"/a/none"), "what is not there is no directory")
    call check_directory(here//"/a/d", error)
    call expect_none(error, "a directory that could be made, and is there")
    call check_directory(here//"/a/none/below", error)
    call expect_none(error, "directories that could be made")
    call check(.not. is_directory(here//"/a/none"), "none of them is made")
    call check_directory("none/below", error)
    call expect_none(error, "directories that could be made here")
    call check_directory("", error)
    call expect_none(error, "the directory of work")
    call check_directory(here//"/a/d/file", error)
    call expect(error, status_failure, here//"/a/d/file: nothing can be written there: Not a directory", "a file")
    call check_directory(here//"/a/d/file/e", error)
    call expect(error, status_failure, here//"/a/d/file: nothing can be written there: Not a directory", "below a file")
    call make_directory("/proc/gravier", error)
    call expect(error, status_failure, "/proc/gravier: cannot make this directory", "a directory that may not be made")
    call make_directory("/proc/self", error)
    call expect(error, status_failure, "/proc/self: this directory cannot be written to", "a directory that exists, not writable")
    call make_directory("", error)
    call expect_none(error, "the current directory")
  end subroutine test_directories

  subroutine test_text_files()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call file%create(here//"/text", "one"//new_line("a"), error)
    call check(file%is_open(), "open after create")
    call check_equal(content(here//"/text"), "one"//new_line("a"), "what it begins with")
    call file%append("", error)
    call file%append("two", error)
    call check_equal(content(here//"/text"), "one"//new_line("a")//"two", "content before the file is closed")
    call file%close(error)
    call check(.not. file%is_open(), "not open after close")
    call file%close(error)
    call expect_none(error, "text file")

    call file%create(here//"/missing/text", "", error)
    call expect(error, status_failure, "missing/text.part: cannot create this file: No such file", "create in a missing directory")
    call check(.not. is_device(here//"/text"), "a file is no device")
    call check(.not. is_device(here//"/none"), "what is not there is no device")
    call check(is_device("/dev/full"), "a device")
    call file%create("/dev/full", "", error)
    call file%append("some text", error)
    call expect(error, status_failure, "/dev/full: cannot write to this file: no space left on device: 9 bytes needed", &
      & "append to a full device")
    call file%close(error)
    call check_readable(here//"/none", error)
    call expect(error, status_input, "none: cannot read this file: No such file", "reading what is not there")
    call check_creatable(here, error)
    call expect(error, status_failure, "cannot create this file: Is a directory", "creating a file over a directory")
  end subroutine test_text_files

  subroutine test_renames()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call file%create(here//"/new", "new", error)
    call file%create(here//"/old", "old", error)
    call file%close(error)
    call rename_file(here//"/new", here//"/old", error)
    call expect_none(error, "rename")
    call check_equal(content(here//"/old"), "new", "a rename replaces")
    call rename_file(here//"/new", here//"/old", error)
    call expect(error, status_failure, "new: cannot rename to ", "rename of what is not there")
    call remove_own(here//"/new")
    call remove_own(here//"/old")
    call remove_own(here//"/old")
    call check_readable(here//"/old", error)
    call expect(error, status_input, "No such file", "removed")
  end subroutine test_renames

  !> A directory goes when it is empty.
  subroutine test_removing_directories()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call make_directory(here//"/gone", error)
    call file%create(here//"/gone/text", "", error)
    call file%close(error)
    call remove_directory(here//"/gone")
    call check_readable(here//"/gone/text", error)
    call expect_none(error, "a directory with a file stays")
    call remove_own(here//"/gone/text")
    call remove_directory(here//"/gone")
    call file%create(here//"/gone/text", "", error)
    call expect(error, status_failure, "No such file", "an empty directory goes")
  end subroutine test_removing_directories

  !> A file takes the place of another and can still be written to; a failure leaves both.
  subroutine test_replacing()
    type(error_t), allocatable :: error
    type(text_file_t) :: file, other

    call other%create(here//"/place", "older", error)
    call other%close(error)
    call file%begin(here//"/place", error)
    call file%append("new", error)
    call check_equal(content(here//"/place"), "older", "the older file while another is begun")
    call file%show(here//"/place", error)
    call file%append("er", error)
    call expect_none(error, "a file in the place of another")
    call check_equal(content(here//"/place"), "newer", "what is written after it took its place")
    call file%close(error)
    call replace_file(here//"/place.part", here//"/place", error)
    call expect(error, status_failure, "place.part: cannot bring this file to the disk: No such file", "replacing by nothing")
    call replace_file(here//"/place", here//"/a", error)
    call expect(error, status_failure, "place: cannot rename to ", "replacing a directory")
    call check_equal(content(here//"/place"), "newer", "the file after a failure")
    call extend_file(here//"/place", 3_i8, error)
    call check_equal(content(here//"/place"), "newer", "a file that is long enough")
    call extend_file(here//"/place", 7_i8, error)
    call expect_none(error, "a longer file")
    call check_equal(content(here//"/place"), "newer"//char(0)//char(0), "zeros behind the end")
    call extend_file(here//"/none", 7_i8, error)
    call expect(error, status_failure, "none: cannot write to this file: No such file", "a longer file that is not there")
  end subroutine test_replacing

  !> Files of this process that others have replaced or removed, and those that it removed itself.
  subroutine test_own_files()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call file%create(here//"/own", "own", error)
    call file%close(error)
    call check_own_files(error)
    call expect_none(error, "files as they were written")
    call execute_command_line("cd '"//here//"' && cp own other && mv other own")
    call check_own_files(error)
    call expect(error, status_failure, here//"/own"// &
      & ": the file that was written under this name is not there any more: it was removed, or another program has replaced it", &
      & "replaced")
    call note_own(here//"/own")
    call check_own_files(error)
    call expect_none(error, "gone on with")
    call remove_file(here//"/own")
    call check_own_files(error)
    call expect(error, status_failure, here//"/own: the file that was written", "removed")
    call file%create(here//"/own", "own", error)
    call file%close(error)
    call remove_own(here//"/own")
    call check_own_files(error)
    call expect_none(error, "removed by itself")
    call file%create(here//"/own", "own", error)
    call file%close(error)
    call remove_file(here//"/own")
    call forget_own_files()
    call check_own_files(error)
    call expect_none(error, "of a run that is over")
    call give_name(here//"/own", error)
    call expect(error, status_failure, "own.part: cannot bring this file to the disk: No such file", "a name for no file")
  end subroutine test_own_files

  !> What a full disk does is tested on a small file system in test_io_full_disk.
  subroutine test_reservation()
    type(error_t), allocatable :: error
    type(text_file_t) :: file

    call file%create(here//"/reserved", "12345", error)
    call file%close(error)
    call reserve_space(here//"/reserved", 100000_i8, error)
    call reserve_space(here//"/reserved", 0_i8, error)
    call expect_none(error, "reservation")
    call check_equal(content(here//"/reserved"), "12345", "a reservation leaves the file as it is")
    call give_back_space(here//"/reserved")
    call check_equal(content(here//"/reserved"), "12345", "and so does giving it back")
    call give_back_space(here//"/nowhere")
    call check_equal(is_there(here//"/nowhere"), 0, "nothing is made where nothing was reserved")
    call reserve_space(here//"/nowhere", 1_i8, error)
    call expect(error, status_failure, "nowhere: cannot write to this file: No such file", "reservation for no file")
    ! 4 EiB: more than any disk
    call reserve_space(here//"/reserved", 4611686018427387904_i8, error)
    call expect(error, status_failure, "4611686018427387904 bytes needed; what was written before stays readable", &
      & "reservation of more than there is")
    call check_equal(content(here//"/reserved"), "12345", "the file after a reservation refused")
  end subroutine test_reservation

  !> 1 where there is a file, 0 where there is none.
  integer function is_there(path)
    character(len=*), intent(in) :: path
    logical :: exists

    inquire (file=path, exist=exists)
    is_there = merge(1, 0, exists)
  end function is_there

  function content(path) result(text)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer :: unit, length

    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old")
    inquire (unit=unit, size=length)
    allocate (character(len=length) :: text)
    if (length > 0) read (unit) text
    close (unit)
  end function content

end program test_io_file_system
