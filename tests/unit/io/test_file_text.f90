!> Files as text: read at once, gone through by lines and words, the same on all ranks; and the room that tables of HDF5 files take.
program test_file_text
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, status_input
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_lines, only: lines_t, read_whole_file
  use gravier_input_text, only: read_input_text
  use gravier_table_growth, only: growth, chunks_in_block
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a"), tab = achar(9), return = achar(13)
  type(communicator_t) :: comm
  character(len=:), allocatable :: path

  call start_parallel()
  call comm%init()
  path = scratch("file_text.txt")
  call test_whole_files()
  call test_missing_files()
  call test_lines()
  call test_no_lines()
  call test_growth()
  call finish_checks()
  call comm%free()
  call stop_parallel()

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

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit

    open (newunit=unit, file=path, access="stream", form="unformatted", action="write", status="replace")
    write (unit) text
    close (unit)
  end subroutine put

  !> What is written is read back, to the byte.
  subroutine check_whole(text, name)
    character(len=*), intent(in) :: text, name
    character(len=:), allocatable :: found
    type(error_t), allocatable :: error

    call put(text)
    call read_whole_file(path, found, error)
    call check(.not. allocated(error), name//": is read")
    call check_equal(len(found), len(text), name//": its length")
    call check_equal(found, text, name//": its text")
    call read_input_text(comm, path, found, error)
    call check(.not. allocated(error), name//": is read for all ranks")
    call check_equal(len(found), len(text), name//": its length on all ranks")
    call check_equal(found, text, name//": its text on all ranks")
  end subroutine check_whole

  subroutine test_whole_files()
    call check_whole("", "an empty file")
    call check_whole("one", "a file without the end of a line")
    call check_whole(lf//"  one "//return//lf//tab//lf//lf, "a file of blanks")
    call check_whole(repeat("0123456789"//char(0)//char(255), 10000), "a long file")
  end subroutine test_whole_files

  subroutine test_missing_files()
    character(len=:), allocatable :: found
    type(error_t), allocatable :: error
    type(lines_t) :: lines

    call read_whole_file(path//".none", found, error)
    call check_missing(error, "a file that is not there")
    call read_input_text(comm, path//".none", found, error)
    call check_missing(error, "nor is there for all ranks")
    call lines%open(path//".none", error)
    call check_missing(error, "nor has lines")
  end subroutine test_missing_files

  subroutine check_missing(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    call check(allocated(error), name)
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, name//": the status of input")
    call check(index(error%message, path//".none") == 1, name//": the file is named")
    deallocate (error)
  end subroutine check_missing

  !> Lines with words between blanks, tabs and carriage returns; blank lines count.
  subroutine test_lines()
    type(lines_t) :: lines
    type(error_t), allocatable :: error

    call put("one  two"//return//lf//lf//tab//"three"//tab//" "//lf//"   "//lf//"four")
    call lines%open(path, error)
    call check(.not. allocated(error), "lines")
    call check(lines%next(), "a first line")
    call check_equal(lines%number, 1, "its number")
    call check_word(lines, "one")
    call check_word(lines, "two")
    call check_word(lines, "")
    call check_word(lines, "")
    call check(lines%next(), "an empty line")
    call check_word(lines, "")
    call check(lines%next(), "a line with tabs")
    call check_equal(lines%number, 3, "empty lines count")
    call check_equal(lines%last - lines%first + 1, 8, "its letters without the end")
    call check_word(lines, "three")
    call check_word(lines, "")
    call check(lines%next(), "a line of blanks")
    call check_word(lines, "")
    call check(lines%next(), "a last line without an end")
    call check_equal(lines%text(lines%first:lines%last), "four", "its text")
    call check_equal(lines%number, 5, "its number too")
    call check_word(lines, "four")
    call check_word(lines, "")
    call check(.not. lines%next(), "no line behind it")
  end subroutine test_lines

  subroutine check_word(lines, expected)
    type(lines_t), intent(inout) :: lines
    character(len=*), intent(in) :: expected
    character(len=:), allocatable :: word

    word = lines%word()
    call check_equal(word, expected, "the next word")
    call check_equal(len(word), len(expected), "the letters of "//expected)
  end subroutine check_word

  subroutine test_no_lines()
    type(lines_t) :: lines
    type(error_t), allocatable :: error

    call put("")
    call lines%open(path, error)
    call check(.not. lines%next(), "an empty file has no line")
    call put(lf)
    call lines%open(path, error)
    call check(lines%next(), "the end of a line is a line")
    call check_equal(lines%last, 0, "without letters")
    call check(.not. lines%next(), "and the only one")
  end subroutine test_no_lines

  !> Whole chunks, and a block that knows them with the first of them.
  subroutine test_growth()
    integer(i8), parameter :: chunk = 100_i8
    integer, parameter :: width = 24
    integer(i8) :: block, rows

    block = growth(0_i8, 1_i8, chunk, width) - chunk*width
    call check(block > 0_i8, "the first row takes a chunk and a block")
    call check_equal(growth(0_i8, 100_i8, chunk, width), chunk*width + block, "as do all rows of the chunk")
    call check_equal(growth(1_i8, 99_i8, chunk, width), 0_i8, "rows that fill a chunk take nothing")
    call check_equal(growth(100_i8, 1_i8, chunk, width), chunk*width, "the next row takes a chunk")
    call check_equal(growth(50_i8, 200_i8, chunk, width), 2*chunk*width, "many rows take what they need")
    call check_equal(growth(50_i8, 0_i8, chunk, width), 0_i8, "no rows take nothing")
    rows = chunk*chunks_in_block
    call check_equal(growth(0_i8, rows, chunk, width), rows*width + block, "a full block")
    call check(growth(rows, 1_i8, chunk, width) >= chunk*width + 2*block, "behind it blocks are divided")
  end subroutine test_growth

end program test_file_text
