!> Tables of quantities against time: values at, between, before and after the rows; what a file must be.
program test_time_table
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, status_input
  use gravier_time_table, only: time_table_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: file = "table.csv", newline = new_line("a"), names = "vx vy omega"
  type(time_table_t) :: table

  call MPI_Init()
  call test_values()
  call test_repeating()
  call test_one_row()
  call test_means()
  call test_means_of_cycles()
  call test_variation()
  call test_equal_rows()
  call test_turns()
  call test_many_rows()
  call test_refusals()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine write_file(text)
    character(len=*), intent(in) :: text
    integer :: unit

    open (newunit=unit, file=file, access="stream", status="replace", action="write")
    write (unit) text
    close (unit)
  end subroutine write_file

  subroutine read_table(text, error, repeats)
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(out) :: error
    !> false where absent
    logical, intent(in), optional :: repeats
    logical :: again

    again = .false.
    if (present(repeats)) again = repeats
    call write_file(text)
    call table%read(file, names, again, error)
  end subroutine read_table

  !> Columns in another order than the names; numbers that are exact.
  subroutine test_values()
    type(error_t), allocatable :: error

    call read_table("omega,time,vx"//newline//"8,1,-1"//newline//"4,3,-1"//newline//"12,3.5,-2"//newline, error)
    call check(.not. allocated(error), "a table")
    if (allocated(error)) return
    call check(table%has(1) .and. .not. table%has(2) .and. table%has(3), "columns of the file")
    call check_equal(size(table%time), 3, "rows")
    call check_close(table%at(3, -7.0_dp), 8.0_dp, 0.0_dp, "before the first row")
    call check_close(table%at(3, 1.0_dp), 8.0_dp, 0.0_dp, "at the first row")
    call check_close(table%at(3, 1.5_dp), 7.0_dp, 0.0_dp, "between rows")
    call check_close(table%at(3, 3.0_dp), 4.0_dp, 0.0_dp, "at a row")
    call check_close(table%at(3, 3.25_dp), 8.0_dp, 0.0_dp, "between the last rows")
    call check_close(table%at(3, 3.5_dp), 12.0_dp, 0.0_dp, "at the last row")
    call check_close(table%at(3, 1.0e9_dp), 12.0_dp, 0.0_dp, "after the last row")
    call check_close(table%at(1, 2.0_dp), -1.0_dp, 0.0_dp, "a constant stretch of another column")
    call check(table%changes_after(-1.0_dp) .and. table%changes_after(3.4_dp), "it changes before the last row")
    call check(.not. table%changes_after(3.5_dp), "and not behind it")
    call read_table("vx,time"//newline//"8,1"//newline//"8,3"//newline, error)
    call check(.not. table%changes_after(0.0_dp), "equal rows are no change")
  end subroutine test_values

  !> A table from 1 to 5 that repeats, before and after these times; one that does not forgets that another one did.
  subroutine test_repeating()
    character(len=*), parameter :: saw = "time,vx,omega"//newline//"1,0,7"//newline//"2,4,7"//newline//"5,0,7"//newline
    type(error_t), allocatable :: error

    call read_table(saw, error, .true.)
    call check(.not. allocated(error), "a table that repeats")
    if (allocated(error)) return
    call check_close(table%at(1, 1.5_dp), 2.0_dp, 0.0_dp, "in the first period")
    call check_close(table%at(1, 5.5_dp), 2.0_dp, 0.0_dp, "in the second period")
    call check_close(table%at(1, 4.0e6_dp + 2.0_dp), 4.0_dp, 0.0_dp, "after a million of periods")
    call check_close(table%at(1, -2.0_dp), 0.0_dp, 0.0_dp, "before the first row")
    call check_close(table%at(3, 77.0_dp), 7.0_dp, 0.0_dp, "another column")
    call check(table%changes_after(1.0e9_dp), "it changes for ever")
    call read_table(saw, error)
    call check_close(table%at(1, 5.5_dp), 0.0_dp, 0.0_dp, "a table that does not repeat")
    call check(.not. table%changes_after(5.0_dp), "it ends")
    call refuse("time,vx"//newline//"1,2"//newline, "table.csv: a table that repeats has one row; expected two or more", .true.)
    call refuse("time,vx"//newline//"1,2"//newline//"2,3"//newline, "table.csv: a table that repeats ends with another row "// &
      & "than it begins with; expected the values of the first row in the last", .true.)
    call read_table("time,vx"//newline//"1,2"//newline//"2,2"//newline, error, .true.)
    call check(.not. table%changes_after(0.0_dp), "equal rows that repeat are no change")
  end subroutine test_repeating

  subroutine test_one_row()
    type(error_t), allocatable :: error

    call read_table("time,vy"//newline//"2,5"//newline, error)
    call check(.not. allocated(error), "one row")
    if (allocated(error)) return
    call check_close(table%at(2, 0.0_dp), 5.0_dp, 0.0_dp, "one row, before")
    call check_close(table%at(2, 2.0_dp), 5.0_dp, 0.0_dp, "one row, then")
    call check_close(table%at(2, 9.0_dp), 5.0_dp, 0.0_dp, "one row, after")
  end subroutine test_one_row

  !> Means between times that lie anywhere in a table; what they add up to is the integral.
  subroutine test_means()
    type(error_t), allocatable :: error
    real(dp) :: sum, times(0:100)
    integer :: k

    call read_table("omega,time,vx"//newline//"8,1,-1"//newline//"4,3,-1"//newline//"12,3.5,-2"//newline, error)
    call check(.not. allocated(error), "a table of means")
    if (allocated(error)) return
    call check_close(table%mean(3, 1.5_dp, 1.5_dp), 7.0_dp, 0.0_dp, "the mean of no time")
    call check_close(table%mean(3, 1.25_dp, 1.75_dp), 7.0_dp, 0.0_dp, "between two rows the value in the middle")
    call check_close(table%mean(3, 1.0_dp, 3.0_dp), 6.0_dp, 1.0e-15_dp, "from row to row")
    call check_close(table%mean(3, -7.0_dp, 1.0_dp), 8.0_dp, 0.0_dp, "before the first row")
    call check_close(table%mean(3, 3.5_dp, 1.0e9_dp), 12.0_dp, 0.0_dp, "after the last row")
    call check_close(table%mean(3, 2.0_dp, 3.25_dp), 5.2_dp, 1.0e-14_dp, "over a row")
    call check_close(table%mean(3, 0.0_dp, 3.0_dp), 20.0_dp/3.0_dp, 1.0e-14_dp, "over the first row")
    call check_close(table%mean(3, 3.25_dp, 5.5_dp), 26.5_dp/2.25_dp, 1.0e-14_dp, "over the last row")
    call check_close(table%mean(3, 0.0_dp, 5.5_dp), 48.0_dp/5.5_dp, 1.0e-14_dp, "over all rows")
    call check_close(table%mean(1, 0.5_dp, 3.1_dp), -1.0_dp - 0.01_dp/2.6_dp, 1.0e-14_dp, "of another column")
    call check_close(table%load_of(3, 3.25_dp, 1.25_dp), 5.2_dp, 1.0e-14_dp, "a load over its step")
    call check_close(table%rate_at(3, 2.625_dp, 1.25_dp), 5.2_dp, 1.0e-14_dp, "a rate over half a step before and after")
    call check_close(table%rate_at(3, 2.0_dp, 1.0_dp), table%at(3, 2.0_dp), 0.0_dp, "a rate where nothing turns")
    times(:) = [(5.0_dp*k**2*1.0e-4_dp, k=0, 100)]
    sum = 0.0_dp
    do k = 1, 100
      sum = sum + (times(k) - times(k - 1))*table%mean(3, times(k - 1), times(k))
    end do
    call check_close(sum, 42.0_dp, 1.0e-13_dp, "what means add up to")
    call read_table("time,vx"//newline//"0,0"//newline//"1,4"//newline, error)
    call check_close(table%rate_at(1, 0.0_dp, 0.5_dp), 0.5_dp, 1.0e-15_dp, "a rate at the start, of half a step")
    call check_close(table%rate_at(1, 0.5_dp, 0.5_dp), 2.0_dp, 0.0_dp, "a rate after the start")
    call check_close(table%load_of(1, 0.5_dp, 0.5_dp), 1.0_dp, 1.0e-15_dp, "the load of the first step")
  end subroutine test_means

  !> Means of a table that begins anew, over its end and over whole cycles.
  subroutine test_means_of_cycles()
    type(error_t), allocatable :: error
    integer :: k
    logical :: same

    call read_table("time,vx"//newline//"1,0"//newline//"2,4"//newline//"5,0"//newline, error, .true.)
    call check(.not. allocated(error), "means of a table that repeats")
    if (allocated(error)) return
    call check_close(table%mean(1, 1.0_dp, 5.0_dp), 2.0_dp, 1.0e-15_dp, "a cycle")
    call check_close(table%mean(1, 0.0_dp, 5.0_dp), 1.6_dp, 1.0e-15_dp, "a cycle and what was before it")
    call check_close(table%mean(1, 4.5_dp, 5.5_dp), 2.0_dp/3.0_dp, 1.0e-14_dp, "the end of a cycle and the next one")
    call check_close(table%mean(1, 4.5_dp, 45.5_dp), (2.0_dp/3.0_dp + 80.0_dp)/41.0_dp, 1.0e-13_dp, "many cycles and parts of two")
    call check_close(table%mean(1, 1.0_dp, 4001.0_dp), 2.0_dp, 1.0e-13_dp, "a thousand cycles")
    call check_close(table%mean(1, 4.0e6_dp + 1.5_dp, 4.0e6_dp + 2.5_dp), 10.0_dp/3.0_dp, 1.0e-8_dp, "after a million of cycles")
    call read_table("time,vx"//newline//"0,-777.7"//newline//"0.7,-777.7"//newline//"1.1,-777.7"//newline, error, .true.)
    call check(.not. allocated(error), "equal rows that repeat")
    if (allocated(error)) return
    same = .true.
    do k = 0, 300
      same = same .and. .not. abs(table%mean(1, 0.01_dp*k, 0.07_dp*k) + 777.7_dp) > 0.0_dp
    end do
    call check(same, "the mean over equal rows, without rounding")
  end subroutine test_means_of_cycles

  !> A triangle of period 2 from 0 to 6. The mean about a turn differs from it by a quarter of the step. Steps of the period keep
  !> next to nothing, but at the ends. A jump within a step is kept; what is behind the last step does not count.
  subroutine test_variation()
    type(error_t), allocatable :: error

    call read_table("time,vx,omega"//newline//"0,0,1"//newline//"1,1,1"//newline//"2,0,1"//newline//"3,1,1"//newline//"4,0,1"// &
      & newline//"5,1,1"//newline//"6,0,1"//newline, error)
    call check(.not. allocated(error), "a triangle")
    if (allocated(error)) return
    call check_close(table%kept_variation(3, 0.01_dp, 600), 5.975_dp/6.0_dp, 1.0e-12_dp, "fine steps keep ups and downs")
    call check_close(table%kept_variation(3, 0.5_dp, 12), 4.75_dp/6.0_dp, 1.0e-12_dp, "half of the time between turns")
    call check_close(table%kept_variation(3, 1.0_dp, 6), 3.5_dp/6.0_dp, 1.0e-12_dp, "the time between turns")
    call check_close(table%kept_variation(3, 2.0_dp, 3), 1.0_dp/6.0_dp, 1.0e-12_dp, "steps of the period keep next to none")
    call check_close(table%kept_variation(0, 0.5_dp, 12), 3.5_dp/6.0_dp, 1.0e-12_dp, "a load, half of the time between turns")
    call check_close(table%kept_variation(0, 1.0_dp, 6), 1.0_dp/6.0_dp, 1.0e-12_dp, "a load, the time between turns")
    call check_close(table%kept_variation(3, 2.0_dp, 0), 1.0_dp, 1.0e-12_dp, "no step loses nothing")
    call read_table("time,vx"//newline//"1.1,0"//newline//"1.2,3"//newline//"9,3"//newline//"9.1,0"//newline//"9.2,3"// &
      & newline, error)
    call check(.not. allocated(error), "a jump")
    if (allocated(error)) return
    call check_close(table%kept_variation(3, 0.5_dp, 8), 1.0_dp, 1.0e-12_dp, "a jump within a step is kept")
    call check_close(table%kept_variation(3, 0.5_dp, 40), 4.2_dp/9.0_dp, 1.0e-12_dp, "of a dip its mean is")
    call read_table("time,vx"//newline//"0,0"//newline//"1,1"//newline//"2,0"//newline, error, .true.)
    call check(.not. allocated(error), "a triangle that repeats")
    if (allocated(error)) return
    call check_close(table%kept_variation(0, 2.0_dp, 100), 1.0_dp/42.0_dp, 1.0e-12_dp, "a cycle in each step")
    call check_close(table%kept_variation(0, 2.0_dp, 1), 0.5_dp, 1.0e-12_dp, "a cycle in the only step")
  end subroutine test_variation

  !> Between equal rows the value is theirs to the last bit, wherever it is asked for.
  subroutine test_equal_rows()
    real(dp), parameter :: held = -777.7_dp
    type(error_t), allocatable :: error
    integer :: k
    logical :: same

    call read_table("time,vx"//newline//"0,-777.7"//newline//"0.7,-777.7"//newline//"3,-777.7"//newline, error)
    call check(.not. allocated(error), "equal rows")
    if (allocated(error)) return
    same = .true.
    do k = 0, 300
      same = same .and. .not. abs(table%at(1, 0.01_dp*k) - held) > 0.0_dp
    end do
    call check(same, "the value of equal rows, without rounding")
  end subroutine test_equal_rows

  !> Times between turns: a square wave with flats, one turn alone, a cycle that begins anew, with one turn or three in it.
  subroutine test_turns()
    call expect_turns("0,0 1,2 3,2 4,0 4.5,0 9,7", .false., 1.5_dp, "from the end of a flat to that of the next")
    call expect_turns("0,0 1,2 3,0", .false., huge(1.0_dp), "one turn")
    call expect_turns("0,0 1,2 3,2", .false., huge(1.0_dp), "none")
    call expect_turns("0,0 1,2 5,0", .true., 1.0_dp, "one turn of a cycle, and that at its ends")
    call expect_turns("0,0 2,1 8,-1 9,0", .true., 3.0_dp, "a turn of the next cycle")
  end subroutine test_turns

  !> The shortest time between turns of a table whose rows have a blank between two.
  subroutine expect_turns(rows, repeats, time, name)
    character(len=*), intent(in) :: rows, name
    logical, intent(in) :: repeats
    real(dp), intent(in) :: time
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    integer :: k

    text = "time,vx"//newline
    do k = 1, len(rows)
      if (rows(k:k) == " ") then
        text = text//newline
      else
        text = text//rows(k:k)
      end if
    end do
    call read_table(text//newline, error, repeats)
    call check(.not. allocated(error), name)
    if (allocated(error)) return
    call check_close(table%shortest_half_cycle(1), time, 1.0e-12_dp*time, name)
  end subroutine expect_turns

  !> More rows than there is room for at first: a square of the time, exact at rows, off by 1/4 between them.
  subroutine test_many_rows()
    type(error_t), allocatable :: error
    character(len=24) :: row
    character(len=:), allocatable :: text
    logical :: right
    integer :: k

    text = "time,vx"//newline
    do k = 0, 999
      write (row, "(i0, a, i0)") k, ",", k*k
      text = text//trim(row)//newline
    end do
    call read_table(text, error)
    call check(.not. allocated(error), "many rows")
    if (allocated(error)) return
    right = .true.
    do k = 0, 998
      right = right .and. abs(table%at(1, real(k, dp)) - k*k) <= 0.0_dp
      right = right .and. abs(table%at(1, k + 0.5_dp) - (k*(k + 1) + 0.5_dp)) <= 0.0_dp
    end do
    call check(right, "values of a long table")
    call check_equal(size(table%time), 1000, "a long table: rows")
  end subroutine test_many_rows

  subroutine test_refusals()
    call refuse("vx,vy"//newline//"1,2"//newline, "table.csv: column time is missing; known are time vx vy omega")
    call refuse("time,vz"//newline//"1,2"//newline, "table.csv: column vz is unknown here; known are time vx vy omega")
    call refuse("time"//newline//"1"//newline, "table.csv: no column besides time; known are vx vy omega")
    call refuse("time,vx"//newline, "table.csv: no rows; at least one was expected")
    call refuse("time,vx"//newline//"1,2"//newline//"1,3"//newline, &
      & "table.csv: line 3: column time: ""1"", but a time later than that of the row above")
    call refuse("time,vx"//newline//"1,2"//newline//"0,3"//newline, &
      & "table.csv: line 3: column time: ""0"", but a time later than that of the row above")
    call refuse("time,vx"//newline//"1,fast"//newline, "table.csv: line 2: column vx: ""fast"", but a")
    call refuse("time,vx"//newline//"1"//newline, "table.csv: line 2: ")
    call refuse("", "table.csv: empty")
  end subroutine test_refusals

  subroutine refuse(text, expected, repeats)
    !> of the file; how the message begins
    character(len=*), intent(in) :: text, expected
    logical, intent(in), optional :: repeats
    type(error_t), allocatable :: error

    call read_table(text, error, repeats)
    call check(allocated(error), "refused: "//expected)
    if (.not. allocated(error)) return
    call check_equal(error%message(1:min(len(expected), len(error%message))), expected, "message")
    call check_equal(error%status, status_input, "status of "//expected)
  end subroutine refuse

end program test_time_table
