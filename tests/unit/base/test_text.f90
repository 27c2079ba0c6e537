!> Numbers as text, lower case, and errors that keep the first cause.
program test_text
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_random_hash, only: hash_uniform
  use gravier_text, only: to_text, times_text, counted, lower, growing_text_t, text_from
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_integers()
  call test_reals()
  call test_times()
  call test_round_trip()
  call test_logicals_and_case()
  call test_growing_text()
  call test_raise()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A text put together from pieces is all of them.
  subroutine test_growing_text()
    type(growing_text_t) :: text
    character(len=:), allocatable :: expected
    integer :: k

    call check_equal(text%get(), "", "nothing added")
    expected = ""
    do k = 1, 2000
      call text%add(to_text(k)//" ")
      expected = expected//to_text(k)//" "
    end do
    call text%add("")
    call check_equal(text%get(), expected, "pieces of a growing text")
  end subroutine test_growing_text

  !> Equal in characters and in length: check_equal takes no notice of trailing blanks.
  subroutine check_text(text, expected, name)
    character(len=*), intent(in) :: text, expected, name
    call check_equal(text, expected, name)
    call check_equal(len(text), len(expected), name//": length")
  end subroutine check_text

  subroutine test_integers()
    call check_text(to_text(0), "0", "zero")
    call check_text(text_from(", and so on", 3), "and so on", "a text from its third character on")
    call check_text(text_from("ab", 3), "", "a text from behind its end")
    call check_text(to_text(-7), "-7", "negative")
    call check_text(to_text(huge(1)), "2147483647", "largest default integer")
    call check_text(to_text(-huge(1) - 1), "-2147483648", "smallest default integer")
    call check_text(to_text(huge(1_i8)), "9223372036854775807", "largest long integer")
    call check_text(to_text(-huge(1_i8) - 1_i8), "-9223372036854775808", "smallest long integer")
  end subroutine test_integers

  subroutine test_reals()
    call check_text(to_text(1.0_dp), "1.00000000E+00", "nine digits")
    call check_text(to_text(-0.0012345678912_dp), "-1.23456789E-03", "rounded to nine digits")
    call check_text(to_text(1.5_dp, 2), "1.5E+00", "two digits")
    call check_text(to_text(6.0_dp, 1), "6.E+00", "one digit")
    call check_text(to_text(6.0_dp, 0), "6.E+00", "at least one digit")
    call check_text(to_text(0.1_dp, 17), "1.0000000000000001E-001", "seventeen digits")
    call check_text(to_text(0.1_dp, 40), "1.0000000000000001E-001", "at most seventeen digits")
    call check_text(to_text(-huge(1.0_dp), 17), "-1.7976931348623157E+308", "widest")
    call check_text(to_text(0.0_dp, 3), "0.00E+00", "zero")
    call check_text(to_text(tiny(1.0_dp), 3), "2.23E-308", "small")
    call check_text(to_text(1.0e-100_dp, 16), "1.000000000000000E-100", "an exponent of three digits")
    call check_text(to_text(1.0e-99_dp, 16), "1.000000000000000E-99", "an exponent of two digits")
  end subroutine test_reals

  subroutine test_times()
    call check_text(times_text(0_i8), "never", "never")
    call check_text(times_text(1_i8), "once", "once")
    call check_text(times_text(2_i8), "twice", "twice")
    call check_text(times_text(3_i8), "3 times", "more often")
    call check_text(counted(0_i8, "solve"), "0 solves", "none")
    call check_text(counted(1_i8, "solve"), "1 solve", "a single one")
    call check_text(counted(2_i8, "solve"), "2 solves", "several")
  end subroutine test_times

  !> 17 digits say every bit: random bit patterns that are finite, read back.
  subroutine test_round_trip()
    character(len=30) :: text
    real(dp) :: x, back
    integer :: k, e
    logical :: same

    same = .true.
    do k = 1, 2000
      e = -1060 + int(2080*hash_uniform(1, int(k, i8), 1))
      x = scale(2.0_dp*hash_uniform(1, int(k, i8), 2) - 1.0_dp, e)
      text = to_text(x, 17)
      read (text, *) back
      same = same .and. transfer(x, 0_i8) == transfer(back, 0_i8)
    end do
    call check(same, "17 digits read back")
  end subroutine test_round_trip

  subroutine test_logicals_and_case()
    call check_text(to_text(.true.), "T", "true")
    call check_text(to_text(.false.), "F", "false")
    call check_text(lower("NSCDD_EP 'AZaz' [@`{] 09 "), "nscdd_ep 'azaz' [@`{] 09 ", "lower case")
    call check_text(lower(""), "", "lower case of nothing")
    call check_text(lower("É"), "É", "bytes beyond ASCII stay")
  end subroutine test_logicals_and_case

  subroutine test_raise()
    type(error_t), allocatable :: error

    call raise(error, status_input, "first")
    call check(allocated(error), "an error is raised")
    call raise(error, status_failure, "second")
    call check_text(error%message, "first", "the first message stays")
    call check_equal(error%status, status_input, "the first status stays")
  end subroutine test_raise

end program test_text
