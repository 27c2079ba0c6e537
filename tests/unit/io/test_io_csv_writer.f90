!> Tables written row by row: exact content, exact numbers, and the errors.
program test_io_csv_writer
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf, ieee_negative_inf
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_finite, only: is_finite
  use gravier_file_system, only: remove_file
  use gravier_csv_writer, only: csv_writer_t, csv_option_t
  use gravier_text, only: to_text
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  character(len=:), allocatable :: path

  call MPI_Init()
  path = scratch("io_csv_writer.csv")
  call test_finite()
  call test_content()
  call test_exact_numbers()
  call test_errors()
  call test_resume()
  call test_resume_large()
  call test_resume_refused()
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

  subroutine test_finite()
    call check(all(is_finite([0.0_dp, -1.0_dp, huge(1.0_dp), -huge(1.0_dp), tiny(1.0_dp)])), "finite numbers")
    call check(.not. is_finite(ieee_value(1.0_dp, ieee_quiet_nan)), "NaN")
    call check(.not. is_finite(ieee_value(1.0_dp, ieee_positive_inf)), "infinity")
    call check(.not. is_finite(ieee_value(1.0_dp, ieee_negative_inf)), "minus infinity")
  end subroutine test_finite

  subroutine test_content()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error

    call table%open(path, "step,time,name,flag,count", error)
    call check(table%is_open(), "open")
    call check_equal(content(), "step,time,name,flag,count"//newline, "header")
    call table%add(-3)
    call table%add(0.25_dp)
    call table%add("plain")
    call table%add(.true.)
    call table%add(9007199254740993_i8)
    call check_equal(content(), "step,time,name,flag,count"//newline, "nothing of an unfinished row")
    call table%end_row(error)
    call check_equal(content(), "step,time,name,flag,count"//newline// &
      & "-3,2.5000000000000000E-001,plain,T,9007199254740993"//newline, "a row is in the file at once")
    call table%add(1)
    call table%add(ieee_value(1.0_dp, ieee_quiet_nan))
    call table%add('a "b", c')
    call table%add(ieee_value(1.0_dp, ieee_positive_inf))
    call table%add(ieee_value(1.0_dp, ieee_negative_inf))
    call table%end_row(error)
    call table%close(error)
    call check(.not. allocated(error), "no error")
    call check(.not. table%is_open(), "closed")
    call check(index(content(), newline//'1,nan,"a ""b"", c",inf,-inf'//newline) > 0, "quotes and numbers not finite: "//content())
  end subroutine test_content

  !> 17 significant digits give every double back.
  subroutine test_exact_numbers()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error
    real(dp), parameter :: values(6) = [1.0_dp/3, -0.1_dp, huge(1.0_dp), tiny(1.0_dp), 4.0_dp*atan(1.0_dp), nearest(1.0_dp, 1.0_dp)]
    real(dp) :: found
    integer :: i, unit, stat

    call table%open(path, "value", error)
    do i = 1, size(values)
      call table%add(values(i))
      call table%end_row(error)
    end do
    call table%close(error)
    open (newunit=unit, file=path, status="old", action="read")
    read (unit, *)
    do i = 1, size(values)
      read (unit, *, iostat=stat) found
      call check(stat == 0 .and. .not. (found < values(i) .or. found > values(i)), "a number comes back exactly")
    end do
    close (unit)
  end subroutine test_exact_numbers

  subroutine test_errors()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error

    call table%open(path, "a,b", error)
    call table%add(1)
    call table%end_row(error)
    call expect(error, path//": a row of 1 cells under a header of 2", "a row too short")
    call table%add(1)
    call table%add(2)
    call table%end_row(error)
    call table%close(error)
    call check_equal(content(), "a,b"//newline//"1,2"//newline, "a refused row leaves no trace")

    call table%open(path//"/none.csv", "a", error)
    call expect(error, "none.csv.part: cannot create this file: Not a directory", "no such directory")
    call table%open("/dev/full", "a", error)
    call expect(error, "/dev/full: cannot write to this file: no space left on device", "a full disk")
    call table%close(error)
    call check(.not. allocated(error), "close after an error")
  end subroutine test_errors

  !> Rows of steps up to the last one stay, a torn line goes, and new rows follow.
  subroutine test_resume()
    character(len=*), parameter :: head = "step,x"//newline, rows = head//"1,0.5"//newline//"2,nan"//newline//"2,-1E+3"//newline
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error

    call remove_file(path)
    call check_resumed(0, head, "a table that is missing")
    call put("")
    call check_resumed(5, head, "an empty file")
    call put("ste")
    call check_resumed(5, head, "a torn header")
    call put("step,x")
    call check_resumed(5, head, "a header without its end")
    call put(head)
    call check_resumed(5, head, "a header alone")
    call put(rows)
    call check_resumed(2, rows, "all rows")
    call put(rows//"3,7"//newline//"4,8"//newline)
    call check_resumed(2, rows, "rows of later steps")
    call check_resumed(3, rows//"3,9"//newline, "resumed twice")
    call put(rows//"3,7"//newline)
    call check_resumed(0, head, "no row to keep")
    call put(rows//"3,7")
    call check_resumed(2, rows, "a torn last line")
    call put(rows//"3")
    call check_resumed(2, rows, "a last line torn within the step")
    call put(rows//newline)
    call table%resume(path, "step,x", 3, error)
    call expect(error, 'line 5: "", but the number of a step was expected', "an empty line", status_input)
    call check_equal(content(), rows//newline, "the file after a refusal")
  end subroutine test_resume

  !> Resume, expect `kept`, and append a row of the next step.
  subroutine check_resumed(last_step, kept, name)
    integer, intent(in) :: last_step
    character(len=*), intent(in) :: kept, name
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error
    logical :: exists

    call table%resume(path, "step,x", last_step, error)
    call check(.not. allocated(error), name//": no error")
    call check(table%is_open(), name//": open")
    call check_equal(content(), kept, name)
    call check_equal(len(content()), len(kept), name//": length")
    inquire (file=path//".part", exist=exists)
    call check(.not. exists, name//": no part is left")
    call table%add(last_step + 1)
    call table%add(9)
    call table%end_row(error)
    call check_equal(content(), kept//to_text(last_step + 1)//",9"//newline, name//": and a new row")
    call table%close(error)
    call check(.not. allocated(error), name//": no error at the end")
  end subroutine check_resumed

  !> Longer than the blocks it is read in, and rows longer than any number.
  subroutine test_resume_large()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error
    character(len=:), allocatable :: before, after
    integer :: i

    before = ""
    call table%open(path, "step,x", error)
    do i = 1, 3000
      if (i == 2001) before = content()
      call table%add(i)
      call table%add(repeat("1", 97 + mod(7*i, 50)))
      call table%end_row(error)
    end do
    call table%resume(path, "step,x", 2000, error)
    call table%close(error)
    call check(.not. allocated(error), "resuming a large table")
    after = content()
    call check(after == before .and. len(after) == len(before), "rows of a large table")
  end subroutine test_resume_large

  !> What is refused stays as it was, and so does what a full disk keeps from being copied.
  subroutine test_resume_refused()
    character(len=*), parameter :: rows = "step,x"//newline//"1,1"//newline//"two,2"//newline
    type(csv_option_t), parameter :: options(2) = [csv_option_t("x", "&output x"), csv_option_t("w_", "&output w")]
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error

    call put(rows)
    call table%resume(path, "step,x", 5, error)
    call expect(error, 'csv_writer.csv: line 3: "two", but the number of a step was expected', "a row without a step", status_input)
    call check(.not. table%is_open(), "not open after a refusal")
    call put("step,x"//newline//"4,1"//newline//"5,1"//newline//"7,1"//newline)
    call table%resume(path, "step,x", 7, error)
    call expect(error, "csv_writer.csv: line 4: step 7, but rows of step 6 were expected", "a hole", status_input)
    call table%resume(path, "step,x", 5, error)
    call check(.not. allocated(error), "a hole behind what is kept")
    call table%close(error)
    call put("step,x"//newline//"4,1"//newline//"5,1"//newline//"8,1"//newline//"12,1"//newline)
    table%every = 4
    call table%resume(path, "step,x", 15, error)
    call check(.not. allocated(error), "rows of multiples suffice")
    call table%close(error)
    call table%resume(path, "step,x", 16, error)
    call expect(error, "its last row is of step 12, but rows up to step 16 were expected", "a multiple is missing", status_input)
    table%every = 2
    call table%resume(path, "step,x", 12, error)
    call expect(error, "csv_writer.csv: line 4: step 8, but rows of step 6 were expected", "a hole between multiples", status_input)
    table%every = 1
    call table%close(error)
    call put("step,x"//newline//"4,1"//newline//"5,1"//newline)
    call table%resume(path, "step,x", 6, error)
    call expect(error, "csv_writer.csv: its last row is of step 5, but rows up to step 6 were expected; without this file a "// &
      & "new table begins", "an end that is missing", status_input)
    call table%resume(path, "step,x", 5, error)
    call table%sync(error)
    call check(.not. allocated(error), "a table that begins in a later step, brought to the disk")
    call table%close(error)
    call put("step,x"//newline//"1,0*1"//newline)
    call table%resume(path, "step,x", 5, error)
    call expect(error, 'csv_writer.csv: line 2: "0*1", but a number was expected', "a cell that is no number", status_input)
    call put("step,x"//newline//"1,2"//newline//"2"//newline)
    call table%resume(path, "step,x", 5, error)
    call expect(error, "csv_writer.csv: line 3: 1 cells, but the header has 2", "a row that is too short", status_input)
    call put(rows)
    call table%resume(path, "step,y", 5, error)
    call expect(error, "csv_writer.csv: line 1: no column y, but one was expected", "another header", status_input)
    call table%resume(path, "step,x,y", 5, error)
    call expect(error, "csv_writer.csv: line 1: no column y, but one was expected", "a shorter header", status_input)
    call table%resume(path, "step", 5, error)
    call expect(error, "csv_writer.csv: line 1: a column x, but none was expected", "a longer header", status_input)
    call table%resume(path, "x,step", 5, error)
    call expect(error, "csv_writer.csv: line 1: x,step was expected", "another order", status_input)
    call table%resume(path, "step,x,w_1,w_2", 5, error, options)
    call expect(error, "csv_writer.csv: line 1: no column w_1: &output w = .true., but .false. was expected, with which this "// &
      & "table was begun", "a header without the columns of an option", status_input)
    call table%resume(path, "step", 5, error, options)
    call expect(error, "csv_writer.csv: line 1: a column x: &output x = .false., but .true. was expected, with which this "// &
      & "table was begun", "a header with the columns of an option", status_input)
    call check_equal(content(), rows, "the file after refusals")
    call table%resume(path//"/none.csv", "step", 5, error)
    call expect(error, "cannot create this file: Not a directory", "no such directory", status_failure)
  end subroutine test_resume_refused

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit

    open (newunit=unit, file=path, access="stream", form="unformatted", action="write", status="replace")
    write (unit) text
    close (unit)
  end subroutine put

  subroutine expect(error, part, name, status)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part, name
    integer, intent(in), optional :: status
    integer :: expected

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    expected = status_failure
    if (present(status)) expected = status
    call check_equal(error%status, expected, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    deallocate (error)
  end subroutine expect

  function content() result(text)
    character(len=:), allocatable :: text
    integer :: unit, length

    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old")
    inquire (unit=unit, size=length)
    allocate (character(len=length) :: text)
    if (length > 0) read (unit) text
    close (unit)
  end function content

end program test_io_csv_writer
