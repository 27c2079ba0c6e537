!> Coordinates along periodic axes: always inside, also after rounding, and whole periods away.
program test_periodic
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_periodic, only: period_t, wrap, shift_code, shift_of_code, no_shift
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_values()
  call test_rounding()
  call test_far()
  call test_random()
  call test_codes()
  call test_shift()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine check_wrap(x, origin, period, inside, turns)
    real(dp), intent(in) :: x, origin, period, inside
    integer, intent(in) :: turns
    real(dp) :: found
    integer :: n

    call wrap(x, origin, period, found, n)
    call check_close(found, inside, 0.0_dp, "coordinate inside")
    call check_equal(n, turns, "whole periods")
  end subroutine check_wrap

  !> Numbers that are exact.
  subroutine test_values()
    call check_wrap(0.25_dp, 0.0_dp, 2.0_dp, 0.25_dp, 0)
    call check_wrap(0.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, 0)
    call check_wrap(2.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, 1)
    call check_wrap(-0.5_dp, 0.0_dp, 2.0_dp, 1.5_dp, -1)
    call check_wrap(-4.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, -2)
    call check_wrap(7.25_dp, -1.0_dp, 2.0_dp, -0.75_dp, 4)
    call check_wrap(7.25_dp, -1.0_dp, 0.0_dp, 7.25_dp, 0)
  end subroutine test_values

  !> Just below the origin: one period up rounds to the upper end, which belongs to the next period.
  subroutine test_rounding()
    call check_wrap(-1.0e-30_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0)
    call check_wrap(-tiny(1.0_dp), 0.0_dp, 3.7_dp, 0.0_dp, 0)
    call check_wrap(nearest(1.0_dp, -1.0_dp), 0.0_dp, 1.0_dp, nearest(1.0_dp, -1.0_dp), 0)
  end subroutine test_rounding

  !> Places that no simulation survives end inside all the same.
  subroutine test_far()
    real(dp), parameter :: far(4) = [1.0e300_dp, -1.0e300_dp, 1.0e12_dp, -1.0e12_dp]
    real(dp) :: inside
    integer :: k, turns

    do k = 1, size(far)
      call wrap(far(k), 0.3_dp, 0.7_dp, inside, turns)
      call check(inside >= 0.3_dp .and. inside < 0.3_dp + 0.7_dp, "far away: inside")
      call check_equal(turns, merge(1, -1, far(k) > 0.0_dp)*huge(1), "far away: periods")
    end do
  end subroutine test_far

  !> Every shift has a code of its own, and comes back from it.
  subroutine test_codes()
    integer :: x, y, z, shift(3), again(3)
    logical :: same

    same = .true.
    do z = -1, 1
      do y = -1, 1
        do x = -1, 1
          shift(1) = x
          shift(2) = y
          shift(3) = z
          again(:) = shift_of_code(shift_code(shift))
          same = same .and. all(again == shift)
        end do
      end do
    end do
    call check(same, "shifts and their codes")
    shift(:) = 0
    call check_equal(shift_code(shift), no_shift, "the code of no shift")
  end subroutine test_codes

  !> Up to a million periods away: the roundings of coordinates below 1e7.
  subroutine test_random()
    real(dp) :: x, origin, period, inside
    integer :: k, turns
    logical :: within, same

    within = .true.
    same = .true.
    do k = 1, 20000
      origin = 4.0_dp*hash_uniform(1, int(k, i8), 1) - 2.0_dp
      period = 0.01_dp + 3.0_dp*hash_uniform(1, int(k, i8), 2)
      x = origin + period*(2.0_dp*hash_uniform(1, int(k, i8), 3) - 1.0_dp)*10.0_dp**mod(k, 7)
      if (mod(k, 3) == 0) x = origin + period*nint((x - origin)/period)
      call wrap(x, origin, period, inside, turns)
      within = within .and. inside >= origin .and. inside < origin + period
      same = same .and. abs(inside + turns*period - x) <= 8*epsilon(1.0_dp)*(abs(x) + abs(origin) + period)
    end do
    call check(within, "inside the period")
    call check(same, "whole periods away")
  end subroutine test_random

  !> Places go forth and back by whole periods, along periodic axes alone.
  subroutine test_shift()
    type(period_t) :: period
    real(dp) :: place(3)
    integer :: shift(3)

    period%length(:) = [2.0_dp, 0.0_dp, 8.0_dp]
    shift(:) = [1, 0, -1]
    place(:) = [0.5_dp, 0.25_dp, 1.0_dp]
    call period%add_shift(shift_code(shift), 1, place)
    call check(all(abs(place - [2.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "a place that is shifted")
    call period%add_shift(shift_code(shift), -1, place(1:2))
    call check(all(abs(place - [0.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "one of the plane that is shifted back")
    call period%add_shift(no_shift, 1, place)
    call check(all(abs(place - [0.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "no shift")
  end subroutine test_shift

end program test_periodic
