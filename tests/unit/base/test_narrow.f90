!> Integers made narrow: what fits is kept, what does not is refused or stays large, never another number of the range.
program test_narrow
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, status_input
  use gravier_narrow, only: narrow, take_count, check_counts
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer(i8), parameter :: most = huge(0)

  call MPI_Init()
  call check_equal(narrow(-12_i8), -12, "a number")
  call check_equal(narrow(most), huge(0), "the largest")
  call check_equal(narrow(2_i8**32 + 2), huge(0), "beyond 2^32")
  call check_equal(narrow(-2_i8**40), -huge(0), "far below")
  call test_counts()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine test_counts()
    integer(i8) :: several(3)

    call expect(0_i8, "")
    call expect(most, "")
    call expect(-1_i8, "file: /rows: -1, but 0 to 2147483647 was expected")
    call expect(2_i8**32 + 2, "file: /rows: 4294967298, but 0 to 2147483647 was expected")
    call expect(huge(0_i8), "file: /rows: 9223372036854775807, but 0 to 2147483647 was expected")
    several = [most - 3, 2_i8, 1_i8]
    call expect_list(several, "")
    several(3) = 2
    call expect_list(several, "file: /rows: 2147483648, but 0 to 2147483647 was expected")
    several = huge(0_i8)
    call expect_list(several, "file: /rows: 9223372036854775807, but 0 to 2147483647 was expected")
  end subroutine test_counts

  subroutine expect(value, message)
    integer(i8), intent(in) :: value
    !> blank for none
    character(len=*), intent(in) :: message
    type(error_t), allocatable :: error
    integer :: count

    call take_count(value, "file: /rows", count, error)
    call check_equal(count, merge(narrow(value), 0, message == ""), "the count")
    call compare(error, message)
  end subroutine expect

  subroutine expect_list(values, message)
    integer(i8), intent(in) :: values(:)
    character(len=*), intent(in) :: message
    type(error_t), allocatable :: error

    call check_counts(values, "file: /rows", error)
    call compare(error, message)
  end subroutine expect_list

  subroutine compare(error, message)
    type(error_t), allocatable, intent(in) :: error
    character(len=*), intent(in) :: message

    call check(allocated(error) .eqv. message /= "", "an error: "//message)
    if (.not. allocated(error)) return
    call check_equal(error%message, message, "message")
    call check_equal(error%status, status_input, "status")
  end subroutine compare

end program test_narrow
