!> Orientations of bodies: an angle in the plane, a unit quaternion in space, whose real part comes first.
module gravier_orientation
  use gravier_kinds, only: dp
  use gravier_quaternion, only: multiply_quaternions
  implicit none
  private
  public :: turn_orientation, orientation_matrix, shape_axes

contains

  !> Turn a body for a time at a constant spin in global axes. In space it is the exact rotation about the axis of the spin.
  pure subroutine turn_orientation(orientation, spin, duration)
    !> (1) [rad], or (4)
    real(dp), intent(inout) :: orientation(:)
    !> (1 or 3) [rad/s]
    real(dp), intent(in) :: spin(:)
    !> [s]
    real(dp), intent(in) :: duration
    real(dp) :: angle, q(4), turn(4), turned(4)

    if (size(spin) == 1) then
      orientation(1) = orientation(1) + duration*spin(1)
      return
    end if
    angle = duration*norm2(spin)
    if (.not. abs(angle) > 0.0_dp) return
    turn(1) = cos(0.5_dp*angle)
    turn(2:4) = sin(0.5_dp*angle)/norm2(spin)*spin
    q(:) = orientation
    call multiply_quaternions(turn, q, turned)
    orientation(:) = turned/norm2(turned)
  end subroutine turn_orientation

  !> The matrix whose columns are the axes of a body in global axes.
  pure subroutine orientation_matrix(q, axes)
    !> unit quaternion
    real(dp), intent(in) :: q(4)
    real(dp), intent(out) :: axes(3, 3)

    axes(1, 1) = 1.0_dp - 2.0_dp*(q(3)**2 + q(4)**2)
    axes(2, 1) = 2.0_dp*(q(2)*q(3) + q(1)*q(4))
    axes(3, 1) = 2.0_dp*(q(2)*q(4) - q(1)*q(3))
    axes(1, 2) = 2.0_dp*(q(2)*q(3) - q(1)*q(4))
    axes(2, 2) = 1.0_dp - 2.0_dp*(q(2)**2 + q(4)**2)
    axes(3, 2) = 2.0_dp*(q(3)*q(4) + q(1)*q(2))
    axes(1, 3) = 2.0_dp*(q(2)*q(4) + q(1)*q(3))
    axes(2, 3) = 2.0_dp*(q(3)*q(4) - q(1)*q(2))
    axes(3, 3) = 1.0_dp - 2.0_dp*(q(2)**2 + q(3)**2)
  end subroutine orientation_matrix

  !> The axes of a body by its orientation as bodies store it; those of the plane are the first two.
  pure subroutine shape_axes(orientation, axes)
    !> (1) [rad], or (4)
    real(dp), intent(in) :: orientation(:)
    real(dp), intent(out) :: axes(3, 3)
    real(dp) :: q(4)

    if (size(orientation) == 4) then
      q(:) = orientation
      call orientation_matrix(q, axes)
      return
    end if
    axes(:, :) = 0.0_dp
    axes(1, 1) = cos(orientation(1))
    axes(2, 1) = sin(orientation(1))
    axes(1, 2) = -axes(2, 1)
    axes(2, 2) = axes(1, 1)
  end subroutine shape_axes

end module gravier_orientation
