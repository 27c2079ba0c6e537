!> Places of files whose names the user gives: what is there stays unless it is a file of the same kind.
program test_table_place
  use gravier_errors, only: error_t, status_input
  use gravier_file_system, only: make_directory, remove_file
  use gravier_table_place, only: check_table_place, check_hdf5_place
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: columns = "title,method,", mark = char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)

  call write_file("own.csv", columns//"step"//new_line("a"))
  call write_file("foreign.csv", "title,other,step"//new_line("a"))
  call write_file("short.csv", "title")
  call write_file("empty.csv", "")
  call write_file("case.nml", "&scene /"//new_line("a"))
  call write_file("text.hdf5", "none of its kind")
  call write_file("own.hdf5", mark//"and more")
  call check_place("nothing.csv", .true.)
  call check_place("own.csv", .true.)
  call check_place("empty.csv", .true.)
  call check_place("foreign.csv", .false.)
  call check_place("short.csv", .false.)
  call check_place("case.nml", .false.)
  call check_place("new.nml", .false.)
  call check_place("csv", .false.)
  call check_place("", .false.)
  call check_directory()
  call check_problem("nothing.hdf5", .true.)
  call check_problem("own.hdf5", .true.)
  call check_problem("text.hdf5", .false.)
  call finish_checks()

contains

  subroutine check_place(path, is_free)
    character(len=*), intent(in) :: path
    logical, intent(in) :: is_free
    type(error_t), allocatable :: error

    call check_table_place(path, columns, error)
    call check(allocated(error) .neqv. is_free, "a table as '"//path//"'")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "status of '"//path//"'")
    call check(index(error%message, path//": ") == 1, "message of '"//path//"'")
    call check(index(error%message, "expected") > 0, "what was expected of '"//path//"'")
  end subroutine check_place

  subroutine check_problem(path, is_free)
    character(len=*), intent(in) :: path
    logical, intent(in) :: is_free
    type(error_t), allocatable :: error

    call check_hdf5_place(path, error)
    call check(allocated(error) .neqv. is_free, "a problem as '"//path//"'")
  end subroutine check_problem

  subroutine check_directory()
    type(error_t), allocatable :: error

    call make_directory("folder.csv", error)
    call check(.not. allocated(error), "a directory is made")
    call check_place("folder.csv", .false.)
  end subroutine check_directory

  !> A file with these bytes.
  subroutine write_file(path, text)
    character(len=*), intent(in) :: path, text
    integer :: unit

    call remove_file(path)
    open (newunit=unit, file=path, access="stream", form="unformatted", action="write", status="new")
    write (unit) text
    close (unit)
  end subroutine write_file

end program test_table_place
