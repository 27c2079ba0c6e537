!> Cross products and rotations against values by hand: the right-handed sense, lengths, angles that add up, and no rotation at all.
program test_rotation
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross, make_rotation, rotate
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-15_dp, quarter = 2.0_dp*atan(1.0_dp)

  call MPI_Init()
  call test_cross()
  call test_quarter_turns()
  call test_any_axis()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Each axis times the next is the third one.
  subroutine test_cross()
    real(dp) :: unit(3, 3), c(3)
    integer :: d

    unit(:, :) = 0.0_dp
    do d = 1, 3
      unit(d, d) = 1.0_dp
    end do
    do d = 1, 3
      c(:) = cross(unit(:, d), unit(:, mod(d, 3) + 1))
      call check(all(abs(c - unit(:, mod(d + 1, 3) + 1)) <= 0.0_dp), "an axis times the next")
      c(:) = cross(unit(:, mod(d, 3) + 1), unit(:, d))
      call check(all(abs(c + unit(:, mod(d + 1, 3) + 1)) <= 0.0_dp), "the next times an axis")
    end do
    c(:) = cross([1.0_dp, 2.0_dp, 3.0_dp], [4.0_dp, 5.0_dp, 7.0_dp])
    call check(all(abs(c - [-1.0_dp, 5.0_dp, -3.0_dp]) <= 0.0_dp), "two vectors")
  end subroutine test_cross

  !> A quarter turn about each axis takes the next axis to the one after it.
  subroutine test_quarter_turns()
    real(dp) :: vector(3), turn(3, 3), v(3)
    integer :: d, e

    do d = 1, 3
      vector(:) = 0.0_dp
      vector(d) = quarter
      call make_rotation(vector, turn)
      v(:) = 0.0_dp
      v(mod(d, 3) + 1) = 2.0_dp
      call rotate(turn, v)
      do e = 1, 3
        call check_close(v(e), merge(2.0_dp, 0.0_dp, e == mod(d + 1, 3) + 1), rounding, "a quarter turn")
      end do
    end do
  end subroutine test_quarter_turns

  !> The axis stays, lengths stay, a turn back undoes a turn, and a turn by nothing is exact.
  subroutine test_any_axis()
    real(dp), parameter :: vector(3) = [0.3_dp, -0.7_dp, 1.1_dp], start(3) = [2.0_dp, 0.5_dp, -1.5_dp]
    real(dp) :: turn(3, 3), back(3, 3), v(3)
    integer :: d

    call make_rotation(vector, turn)
    call make_rotation(-vector, back)
    v(:) = vector
    call rotate(turn, v)
    do d = 1, 3
      call check_close(v(d), vector(d), rounding, "the axis")
    end do
    v(:) = start
    call rotate(turn, v)
    call check_close(norm2(v), norm2(start), 2.0_dp*rounding, "length")
    call check(norm2(v - start) > 0.5_dp, "it turns")
    call rotate(back, v)
    do d = 1, 3
      call check_close(v(d), start(d), 2.0_dp*rounding, "there and back")
    end do
    call make_rotation([0.0_dp, 0.0_dp, 0.0_dp], turn)
    v(:) = start
    call rotate(turn, v)
    call check(all(abs(v - start) <= 0.0_dp), "no turn")
  end subroutine test_any_axis

end program test_rotation
