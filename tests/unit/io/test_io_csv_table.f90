!> Tables read line by line: what is tolerated, what is refused, and the numbers.
program test_io_csv_table
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_csv_table, only: csv_table_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a")
  character(len=*), parameter :: crlf = achar(13)//new_line("a")
  character(len=:), allocatable :: path

  call MPI_Init()
  path = scratch("io_csv_table.csv")
  call test_plain()
  call test_tolerated()
  call test_long_lines()
  call test_numbers()
  call test_integers()
  call test_errors()
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

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit

    open (newunit=unit, file=path, access="stream", form="unformatted", action="write", status="replace")
    write (unit) text
    close (unit)
  end subroutine put

  subroutine expect(error, part, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part, name

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    call check(index(error%message, path) == 1, name//": names the file: "//error%message)
    deallocate (error)
  end subroutine expect

  subroutine test_plain()
    type(csv_table_t) :: table
    type(error_t), allocatable :: error
    logical :: found

    call put("id,x"//lf//"1,two words"//lf//"2,"//lf)
    call table%open(path, error)
    call check_equal(table%column_count(), 2, "columns")
    call check_equal(table%column("x"), 2, "place of a column")
    call check_equal(table%column("y"), 0, "place of a column that is missing")
    call check_equal(table%column_name(1), "id", "name of a column")
    call table%next_row(found, error)
    call check(found, "first row")
    call check_equal(table%get_text(1)//"|"//table%get_text(2), "1|two words", "cells")
    call table%next_row(found, error)
    call check(found .and. table%is_empty(2) .and. .not. table%is_empty(1), "an empty cell")
    call check(table%is_empty(0), "a column that is missing is empty")
    call table%next_row(found, error)
    call check(.not. found .and. .not. allocated(error), "end of the table")
    call table%close()
    call table%close()
  end subroutine test_plain

  !> CR LF, comments, blank lines, blanks around cells, capitals in names, a byte order mark, no end of the last line.
  subroutine test_tolerated()
    type(csv_table_t) :: table
    type(error_t), allocatable :: error
    logical :: found

    call put(char(239)//char(187)//char(191)//"# comment, with comma"//crlf//crlf//" ID , X"//crlf//"  # comment"//crlf// &
      & achar(9)//" 7 ,"//achar(9)//"8"//crlf//"   "//crlf//"9,10")
    call table%open(path, error)
    call check(.not. allocated(error), "opened")
    call check_equal(table%column_name(1)//"|"//table%column_name(2), "id|x", "names of columns")
    call table%next_row(found, error)
    call check_equal(table%get_text(1)//"|"//table%get_text(2), "7|8", "cells without blanks")
    call table%next_row(found, error)
    call check(found, "a last line without an end")
    if (found) call check_equal(table%get_text(1)//"|"//table%get_text(2), "9|10", "cells of the last line")
    call table%next_row(found, error)
    call check(.not. found .and. .not. allocated(error), "end of the table")
    call table%close()
  end subroutine test_tolerated

  !> Lines of every length across the borders of the blocks that the file is read in (65536 bytes).
  subroutine test_long_lines()
    type(csv_table_t) :: table
    type(error_t), allocatable :: error
    integer, parameter :: lengths(7) = [10, 65400, 117, 65535, 65536, 200000, 1]
    character(len=:), allocatable :: text
    logical :: found
    integer :: i

    text = "a,b"//lf
    do i = 1, size(lengths)
      text = text//repeat(achar(iachar("a") + i), lengths(i))//",end"//lf
    end do
    call put(text)
    call table%open(path, error)
    do i = 1, size(lengths)
      call table%next_row(found, error)
      call check(found, "a long row")
      if (.not. found) exit
      call check_equal(len(table%get_text(1)), lengths(i), "length of a long cell")
      call check(verify(table%get_text(1), achar(iachar("a") + i)) == 0, "content of a long cell")
      call check_equal(table%get_text(2), "end", "the cell after a long one")
    end do
    call table%next_row(found, error)
    call check(.not. found .and. .not. allocated(error), "end of the long table")
    call table%close()
  end subroutine test_long_lines

  subroutine test_numbers()
    call accept_real("1", 1.0_dp)
    call accept_real("+0.5", 0.5_dp)
    call accept_real("-.5", -0.5_dp)
    call accept_real("5.", 5.0_dp)
    call accept_real("1e3", 1000.0_dp)
    call accept_real("1.5E+02", 150.0_dp)
    call accept_real("25D-1", 2.5_dp)
    call accept_real("0e999999999999", 0.0_dp)
    call accept_real("1e-999999999999", 0.0_dp)
    call accept_real("0.00000000000000000000000000000000000000000001e50", 1e6_dp)
    call accept_real("3.3333333333333331E-001", 1.0_dp/3)
    call accept_real("9.9e307", 9.9e307_dp)
    call refuse_real("1.8e308", "at most 1.7976931348623157e308 in size")
    call refuse_real("-12e400", "at most 1.7976931348623157e308 in size")
    call refuse_real("1e999999999999", "at most 1.7976931348623157e308 in size")
    call refuse_real("1-1", "a finite number")
    call refuse_real("nan", "a finite number")
    call refuse_real("Infinity", "a finite number")
    call refuse_real("-inf", "a finite number")
    call refuse_real("1..2", "a finite number")
    call refuse_real("1 2", "a finite number")
    call refuse_real("1/", "a finite number")
    call refuse_real("2*3", "a finite number")
    call refuse_real("0x10", "a finite number")
    call refuse_real("1e", "a finite number")
    call refuse_real("e5", "a finite number")
    call refuse_real("1e5e5", "a finite number")
    call refuse_real("+", "a finite number")
    call refuse_real(".", "a finite number")
    call refuse_real("--1", "a finite number")
    call refuse_real('"1"', "a finite number")
    call refuse_real("", "empty, but a finite number was expected")
  end subroutine test_numbers

  subroutine read_real(text, value, error)
    character(len=*), intent(in) :: text
    real(dp), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    logical :: found

    call put("a,value"//lf//"1,"//text//lf)
    call table%open(path, error)
    call table%next_row(found, error)
    value = 77
    call table%get_real(2, value, error)
    call table%close()
  end subroutine read_real

  subroutine accept_real(text, expected)
    character(len=*), intent(in) :: text
    real(dp), intent(in) :: expected
    type(error_t), allocatable :: error
    real(dp) :: value

    call read_real(text, value, error)
    call check(.not. allocated(error) .and. .not. (value < expected .or. value > expected), "the real "//text)
  end subroutine accept_real

  subroutine refuse_real(text, part)
    character(len=*), intent(in) :: text, part
    type(error_t), allocatable :: error
    real(dp) :: value

    call read_real(text, value, error)
    if (allocated(error)) call check(index(error%message, ": line 2: column value: ") > 0, "place of the error: "//error%message)
    call expect(error, part, "not a real: "//text)
  end subroutine refuse_real

  subroutine test_integers()
    call accept_integer("12", 12_i8)
    call accept_integer("-7", -7_i8)
    call accept_integer("+7", 7_i8)
    call accept_integer("999999999999999999", 999999999999999999_i8)
    call refuse_integer("1234567890123456789")
    call refuse_integer("1.0")
    call refuse_integer("1e3")
    call refuse_integer("")
    call refuse_integer("-")
    call refuse_integer("one")
  end subroutine test_integers

  subroutine read_integer(text, value, error)
    character(len=*), intent(in) :: text
    integer(i8), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    logical :: found

    call put("a,value"//lf//"1,"//text//lf)
    call table%open(path, error)
    call table%next_row(found, error)
    value = 77
    call table%get_integer(2, value, error)
    call table%close()
  end subroutine read_integer

  subroutine accept_integer(text, expected)
    character(len=*), intent(in) :: text
    integer(i8), intent(in) :: expected
    type(error_t), allocatable :: error
    integer(i8) :: value

    call read_integer(text, value, error)
    call check(.not. allocated(error) .and. value == expected, "the integer "//text)
  end subroutine accept_integer

  subroutine refuse_integer(text)
    character(len=*), intent(in) :: text
    type(error_t), allocatable :: error
    integer(i8) :: value

    call read_integer(text, value, error)
    call expect(error, "a whole number", "not an integer: "//text)
  end subroutine refuse_integer

  subroutine test_errors()
    type(csv_table_t) :: table
    type(error_t), allocatable :: error
    logical :: found

    call put("# nothing but this"//lf)
    call table%open(path, error)
    call expect(error, "empty", "no header")
    call put("")
    call table%open(path, error)
    call expect(error, "empty", "an empty file")
    call put("a,b,A"//lf)
    call table%open(path, error)
    call expect(error, "column a appears twice", "two columns of one name")
    call put("a,b"//lf//lf//"1,2"//lf//"1,2,3"//lf//"1,2"//lf)
    call table%open(path, error)
    call table%next_row(found, error)
    call check(found .and. .not. allocated(error), "a good row")
    call table%next_row(found, error)
    call check(.not. found, "no row where there are too many cells")
    call expect(error, ": line 4: 3 cells, but the header has 2", "too many cells")
    call table%close()
    ! a seal that lost a digit
    call put("# checksum 0123456789abcde"//lf//"a,b"//lf//"1,2"//lf)
    call table%open(path, error)
    call table%next_row(found, error)
    call check(found .and. .not. allocated(error), "a row under a seal")
    call table%next_row(found, error)
    call expect(error, "the checksum of its first line is not that of the others", "a damaged seal")
    call table%close()
    call table%open(path//".none", error)
    call expect(error, "cannot read this file: No such file", "a missing file")
    call table%open("/", error)
    call check(allocated(error), "a directory is no table")
  end subroutine test_errors

end program test_io_csv_table
