!> Checks for test programs. A failed check prints what it found and the program goes on; `finish_checks`, called
!> last but before MPI_Finalize, fails the program when a check failed on any rank.
module gravier_check
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use mpi_f08, only: MPI_Allreduce, MPI_Comm_rank, MPI_Finalize, MPI_Finalized, MPI_Initialized, &
    & MPI_COMM_WORLD, MPI_IN_PLACE, MPI_INTEGER, MPI_SUM
  use gravier_kinds, only: dp, i4, i8
  implicit none
  private
  public :: check, check_close, check_equal, finish_checks

  !> Exact equality of integers or of text (trailing blanks do not count), value first, expected second.
  interface check_equal
    module procedure check_equal_i4
    module procedure check_equal_i8
    module procedure check_equal_text
  end interface check_equal

  !> checks passed and failed on this rank
  integer :: passed = 0, failed = 0

contains

  subroutine check(condition, name)
    logical, intent(in) :: condition
    character(len=*), intent(in) :: name
    call count_check(condition, name, "is false")
  end subroutine check

  !> |value - expected| <= tolerance, all three finite: an infinity or a NaN fails.
  subroutine check_close(value, expected, tolerance, name)
    real(dp), intent(in) :: value, expected
    !> absolute
    real(dp), intent(in) :: tolerance
    character(len=*), intent(in) :: name
    character(len=160) :: found

    ! no arithmetic on what is not finite: builds for debugging trap it
    if (ieee_is_finite(value) .and. ieee_is_finite(expected) .and. ieee_is_finite(tolerance)) then
      write (found, "(3(a, es24.16e3), a, es10.3e3)") "value ", value, ", expected ", expected, &
        & ", difference ", value - expected, ", tolerance ", tolerance
      call count_check(abs(value - expected) <= tolerance, name, trim(found))
    else
      write (found, "(2(a, es24.16e3), a, es10.3e3, a)") "value ", value, ", expected ", expected, &
        & ", tolerance ", tolerance, ": not all finite"
      call count_check(.false., name, trim(found))
    end if
  end subroutine check_close

  subroutine check_equal_i4(value, expected, name)
    integer(i4), intent(in) :: value, expected
    character(len=*), intent(in) :: name
    call check_equal_i8(int(value, i8), int(expected, i8), name)
  end subroutine check_equal_i4

  subroutine check_equal_i8(value, expected, name)
    integer(i8), intent(in) :: value, expected
    character(len=*), intent(in) :: name
    character(len=80) :: found
    write (found, "(a, i0, a, i0)") "value ", value, ", expected ", expected
    call count_check(value == expected, name, trim(found))
  end subroutine check_equal_i8

  subroutine check_equal_text(value, expected, name)
    character(len=*), intent(in) :: value, expected
    character(len=*), intent(in) :: name
    call count_check(value == expected, name, "value '"//value//"', expected '"//expected//"'")
  end subroutine check_equal_text

  !> Count a check; print `found` when it failed.
  subroutine count_check(condition, name, found)
    logical, intent(in) :: condition
    character(len=*), intent(in) :: name, found

    if (condition) then
      passed = passed + 1
    else
      failed = failed + 1
      write (error_unit, "(a, i0, 4a)") "FAILED on rank ", world_rank(), ": ", name, ": ", found
    end if
  end subroutine count_check

  !> Sum the checks over the ranks and print the sums. Ends the program with status 1 when one failed, and when
  !> none was made. Collective over MPI_COMM_WORLD; a program without MPI may call it too.
  subroutine finish_checks()
    integer :: counts(2)
    logical :: parallel

    parallel = mpi_runs()
    counts(1) = passed
    counts(2) = failed
    if (parallel) call MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_INTEGER, MPI_SUM, MPI_COMM_WORLD)
    if (world_rank() == 0) write (output_unit, "(i0, a, i0, a)") counts(1), " passed, ", counts(2), " failed"
    flush (output_unit)
    if (counts(2) == 0 .and. counts(1) > 0) return
    if (parallel) call MPI_Finalize()
    stop 1
  end subroutine finish_checks

  !> True between MPI_Init and MPI_Finalize.
  logical function mpi_runs()
    logical :: started, ended
    call MPI_Initialized(started)
    call MPI_Finalized(ended)
    mpi_runs = started .and. .not. ended
  end function mpi_runs

  !> Rank in MPI_COMM_WORLD, 0 without MPI.
  integer function world_rank()
    world_rank = 0
    if (mpi_runs()) call MPI_Comm_rank(MPI_COMM_WORLD, world_rank)
  end function world_rank

end module gravier_check
