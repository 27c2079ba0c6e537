!> Numbers in texts: what is one, how large it may be, and what Fortran alone would take for one.
program test_number_text
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_number_text, only: read_real, read_integer, number_size, is_integer, not_a_number, size_usual, size_tiny, size_huge
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call check_reals()
  call check_integers()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine check_reals()
    character(len=22), parameter :: wrong(21) = [character(len=22) :: "", "1-1", "1+1", "1.5-3", "inf", "nan", "Infinity", "1e", &
      & "e5", ".", "-", "1.2.3", "1e1.5", "1,", "1 2", "0x10", "1_dp", "1e5e5", "--1", "1d-", "2*1"]
    character(len=24), parameter :: huge_ones(4) = [character(len=24) :: "1e309", "1.7976931348623158e308", "-2d308", &
      & "17976931348623159e292"]
    integer :: k

    call expect_real("0.5", 0.5_dp)
    call expect_real("-1.5e-3", -1.5e-3_dp)
    call expect_real("+.25D+2", 25.0_dp)
    call expect_real("3.", 3.0_dp)
    call expect_real("007", 7.0_dp)
    call expect_real("0e999", 0.0_dp)
    call expect_real("1.7976931348623157e308", huge(1.0_dp))
    call expect_real("17976931348623157000e289", huge(1.0_dp))
    call expect_real("1e308", 1.0e308_dp)
    do k = 1, size(wrong)
      call check_equal(number_size(trim(wrong(k))), not_a_number, "no number: "//trim(wrong(k)))
    end do
    do k = 1, size(huge_ones)
      call check_equal(number_size(trim(huge_ones(k))), size_huge, "too large: "//trim(huge_ones(k)))
    end do
    call check_equal(number_size("1e-400"), size_tiny, "tiny")
  end subroutine check_reals

  subroutine expect_real(text, expected)
    character(len=*), intent(in) :: text
    real(dp), intent(in) :: expected
    real(dp) :: value
    integer :: size

    call read_real(text, value, size)
    call check_equal(size, size_usual, text)
    call check_close(value, expected, 0.0_dp, text)
  end subroutine expect_real

  subroutine check_integers()
    integer(i8) :: value
    logical :: fits

    call read_integer("-123456789012345678", value, fits)
    call check(fits .and. value == -123456789012345678_i8, "18 digits")
    call read_integer("1234567890123456789", value, fits)
    call check(.not. fits .and. value == 0, "19 digits")
    call read_integer("1e3", value, fits)
    call check(.not. fits, "an integer with an exponent")
    call check(is_integer("+0") .and. .not. is_integer("+") .and. .not. is_integer("") .and. .not. is_integer("1.0"), "integers")
  end subroutine check_integers

end program test_number_text
