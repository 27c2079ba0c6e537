!> Unit quaternions as rotations; the real part comes first.
module gravier_quaternion
  use gravier_kinds, only: dp
  implicit none
  private
  public :: multiply_quaternions, find_quaternion

contains

  !> The rotation `b` first, then `a`.
  pure subroutine multiply_quaternions(a, b, c)
    real(dp), intent(in) :: a(4), b(4)
    real(dp), intent(out) :: c(4)

    c(1) = a(1)*b(1) - a(2)*b(2) - a(3)*b(3) - a(4)*b(4)
    c(2) = a(1)*b(2) + a(2)*b(1) + a(3)*b(4) - a(4)*b(3)
    c(3) = a(1)*b(3) - a(2)*b(4) + a(3)*b(1) + a(4)*b(2)
    c(4) = a(1)*b(4) + a(2)*b(3) - a(3)*b(2) + a(4)*b(1)
  end subroutine multiply_quaternions

  !> The rotation that brings the axes of coordinates onto other axes (Shepperd, J. Guidance Control 1 (1978) 223).
  pure subroutine find_quaternion(axes, q)
    !> axis k in column k; orthogonal, of length 1, right-handed
    real(dp), intent(in) :: axes(3, 3)
    real(dp), intent(out) :: q(4)
    real(dp) :: square(4)
    integer :: k

    ! four times the square of each component; the largest one is divided by
    square(1) = 1.0_dp + axes(1, 1) + axes(2, 2) + axes(3, 3)
    do k = 1, 3
      square(k + 1) = 1.0_dp + 2.0_dp*axes(k, k) - (axes(1, 1) + axes(2, 2) + axes(3, 3))
    end do
    k = maxloc(square, dim=1)
    q(1) = axes(3, 2) - axes(2, 3)
    q(2) = axes(1, 3) - axes(3, 1)
    q(3) = axes(2, 1) - axes(1, 2)
    select case (k)
    case (1)
      q(2:4) = q(1:3)
      q(1) = square(1)
    case (2)
      q(2) = square(2)
      q(3) = axes(1, 2) + axes(2, 1)
      q(4) = axes(1, 3) + axes(3, 1)
    case (3)
      q(1) = q(2)
      q(2) = axes(1, 2) + axes(2, 1)
      q(3) = square(3)
      q(4) = axes(2, 3) + axes(3, 2)
    case default
      q(1) = q(3)
      q(2) = axes(1, 3) + axes(3, 1)
      q(3) = axes(2, 3) + axes(3, 2)
      q(4) = square(4)
    end select
    q(:) = q/norm2(q)
    if (q(1) < 0.0_dp) q(:) = -q
  end subroutine find_quaternion

end module gravier_quaternion
