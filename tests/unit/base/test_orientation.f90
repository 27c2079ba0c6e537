!> Orientations in the plane and in space: turns about axes, matrices, and unit length after many turns.
program test_orientation
  use gravier_kinds, only: dp
  use gravier_rotation, only: make_rotation
  use gravier_orientation, only: turn_orientation, orientation_matrix
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-14_dp, pi = acos(-1.0_dp)

  call test_plane()
  call test_axes()
  call test_general()
  call test_many_turns()
  call finish_checks()

contains

  subroutine test_plane()
    real(dp) :: angle(1)

    angle(1) = 0.5_dp
    call turn_orientation(angle, [2.0_dp], 0.25_dp)
    call check_close(angle(1), 1.0_dp, rounding, "an angle grows by spin times time")
  end subroutine test_plane

  !> A right angle about each axis takes the axis after it to the one after that.
  subroutine test_axes()
    real(dp) :: q(4), spin(3), axes(3, 3)
    integer :: k, a, b

    do k = 1, 3
      q(:) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
      spin(:) = 0.0_dp
      spin(k) = pi
      call turn_orientation(q, spin, 0.5_dp)
      call orientation_matrix(q, axes)
      a = mod(k, 3) + 1
      b = mod(k + 1, 3) + 1
      call check_close(axes(b, a), 1.0_dp, rounding, "the next axis goes to the one behind it")
      call check_close(axes(a, b), -1.0_dp, rounding, "and that one to the opposite of it")
      call check_close(axes(k, k), 1.0_dp, rounding, "the axis itself stays")
    end do
  end subroutine test_axes

  !> A turn after another, against the product of their matrices; a spin in global axes turns from the left.
  subroutine test_general()
    real(dp) :: q(4), axes(3, 3), first(3, 3), second(3, 3), expected
    real(dp), parameter :: one(3) = [0.3_dp, -0.7_dp, 0.2_dp], two(3) = [-0.5_dp, 0.1_dp, 0.9_dp]
    integer :: r, c

    q(:) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
    call turn_orientation(q, one, 1.0_dp)
    call turn_orientation(q, two, 1.0_dp)
    call orientation_matrix(q, axes)
    call make_rotation(one, first)
    call make_rotation(two, second)
    do c = 1, 3
      do r = 1, 3
        expected = sum(second(r, :)*first(:, c))
        call check_close(axes(r, c), expected, rounding, "two turns")
      end do
    end do
    call turn_orientation(q, two, -1.0_dp)
    call turn_orientation(q, one, -1.0_dp)
    call check_close(abs(q(1)), 1.0_dp, rounding, "and back")
    call turn_orientation(q, [0.0_dp, 0.0_dp, 0.0_dp], 1.0_dp)
    call check_close(abs(q(1)), 1.0_dp, rounding, "no spin turns nothing")
  end subroutine test_general

  subroutine test_many_turns()
    real(dp) :: q(4)
    integer :: k

    q(:) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
    do k = 1, 100000
      call turn_orientation(q, [0.3_dp, -0.7_dp, 0.2_dp], 0.01_dp)
    end do
    call check_close(norm2(q), 1.0_dp, rounding, "the quaternion keeps its length")
  end subroutine test_many_turns

end program test_orientation
