!> Small helpers of geometry in space.
module gravier_spatial
  use gravier_kinds, only: dp
  implicit none
  private
  public :: triple_product, find_normal, find_box, extent_of, turn_back, shorten

contains

  !> a . (b x c).
  pure real(dp) function triple_product(a, b, c) result(product)
    real(dp), intent(in) :: a(3), b(3), c(3)
    product = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function triple_product

  !> normal := (b - a) x (c - a), of twice the length that the triangle has as area.
  pure subroutine find_normal(a, b, c, normal)
    real(dp), intent(in) :: a(3), b(3), c(3)
    real(dp), intent(out) :: normal(3)
    real(dp) :: u(3), v(3)

    u(:) = b - a
    v(:) = c - a
    normal(1) = u(2)*v(3) - u(3)*v(2)
    normal(2) = u(3)*v(1) - u(1)*v(3)
    normal(3) = u(1)*v(2) - u(2)*v(1)
  end subroutine find_normal

  !> The box with the axes of coordinates that holds points (3, n), 0 where there is none.
  pure subroutine find_box(points, low, high)
    real(dp), intent(in) :: points(:, :)
    real(dp), intent(out) :: low(3), high(3)
    integer :: k

    low(:) = 0.0_dp
    high(:) = 0.0_dp
    do k = 1, size(points, 2)
      if (k == 1) then
        low(:) = points(:, 1)
        high(:) = points(:, 1)
      end if
      low(:) = min(low, points(:, k))
      high(:) = max(high, points(:, k))
    end do
  end subroutine find_box

  !> The longest side of that box.
  pure real(dp) function extent_of(points)
    real(dp), intent(in) :: points(:, :)
    real(dp) :: low(3), high(3)

    call find_box(points, low, high)
    extent_of = max(high(1) - low(1), high(2) - low(2), high(3) - low(3))
  end function extent_of

  !> x := the components along three axes of x, seen from a centre.
  pure subroutine turn_back(axes, centre, x)
    !> axis k in column k
    real(dp), intent(in) :: axes(3, 3), centre(3)
    real(dp), intent(inout) :: x(3)
    real(dp) :: u(3)
    integer :: k

    u(:) = x - centre
    do k = 1, 3
      x(k) = axes(1, k)*u(1) + axes(2, k)*u(2) + axes(3, k)*u(3)
    end do
  end subroutine turn_back

  !> Keep the first n items of a list.
  pure subroutine shorten(list, n)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in) :: n
    integer, allocatable :: kept(:)

    allocate (kept(n))
    kept(:) = list(1:n)
    call move_alloc(kept, list)
  end subroutine shorten

end module gravier_spatial
