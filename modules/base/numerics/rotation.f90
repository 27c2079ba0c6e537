!> Vectors in space: their cross product, and rotations of them.
module gravier_rotation
  use gravier_kinds, only: dp
  implicit none
  private
  public :: cross, make_rotation, rotate, rigid_velocity

contains

  !> a x b.
  pure function cross(a, b) result(c)
    real(dp), intent(in) :: a(3), b(3)
    real(dp) :: c(3)

    c(1) = a(2)*b(3) - a(3)*b(2)
    c(2) = a(3)*b(1) - a(1)*b(3)
    c(3) = a(1)*b(2) - a(2)*b(1)
  end function cross

  !> v := turn v.
  pure subroutine rotate(turn, v)
    real(dp), intent(in) :: turn(3, 3)
    real(dp), intent(inout) :: v(3)
    real(dp) :: u(3)
    integer :: a

    u(:) = v
    do a = 1, 3
      v(a) = turn(a, 1)*u(1) + turn(a, 2)*u(2) + turn(a, 3)*u(3)
    end do
  end subroutine rotate

  !> Matrix of the rotation by a vector (Rodrigues).
  pure subroutine make_rotation(vector, turn)
    !> direction times angle [rad]
    real(dp), intent(in) :: vector(3)
    real(dp), intent(out) :: turn(3, 3)
    real(dp) :: u(3), angle
    integer :: a, b

    angle = norm2(vector)
    turn(:, :) = 0.0_dp
    do a = 1, 3
      turn(a, a) = 1.0_dp
    end do
    if (.not. angle > 0.0_dp) return
    u(:) = vector/angle
    do b = 1, 3
      do a = 1, 3
        turn(a, b) = (1.0_dp - cos(angle))*u(a)*u(b)
      end do
      turn(b, b) = turn(b, b) + cos(angle)
    end do
    turn(1, 2) = turn(1, 2) - sin(angle)*u(3)
    turn(2, 1) = turn(2, 1) + sin(angle)*u(3)
    turn(1, 3) = turn(1, 3) + sin(angle)*u(2)
    turn(3, 1) = turn(3, 1) - sin(angle)*u(2)
    turn(2, 3) = turn(2, 3) - sin(angle)*u(1)
    turn(3, 2) = turn(3, 2) + sin(angle)*u(1)
  end subroutine make_rotation

  !> Velocity of the point x of a body that turns about a pivot.
  pure subroutine rigid_velocity(x, pivot, translation, spin, velocity)
    !> places [m], velocity of the pivot [m/s], spin [rad/s]
    real(dp), intent(in) :: x(3), pivot(3), translation(3), spin(3)
    !> (nd) [m/s]
    real(dp), intent(out) :: velocity(:)
    real(dp) :: arm(3), turned(3)

    arm(:) = x - pivot
    turned(:) = cross(spin, arm)
    velocity(:) = translation(1:size(velocity)) + turned(1:size(velocity))
  end subroutine rigid_velocity

end module gravier_rotation
