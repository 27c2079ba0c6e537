!> Polygons of space cut into triangles.
module gravier_ear_clipping
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  implicit none
  private
  public :: clip_ears

  !> share of the area of a polygon, rounding of its corners included, from which on triangles that cover it twice are told
  real(dp), parameter :: twice_covered = 1.0e-4_dp
  !> area over the square of the extension below which a polygon has none
  real(dp), parameter :: flat = 1.0e-12_dp

contains

  !> The triangles of a simple polygon, which need not be convex and may be a little out of its plane: corners that stick out and
  !> have no other corner in their triangle are cut off one after the other (G. H. Meisters, Amer. Math. Monthly 82 (1975) 648).
  !> A hole may be joined to the outline by a bridge, whose corners stand twice. Where none is left, as in a polygon that crosses
  !> itself, the next corner goes.
  pure subroutine clip_ears(point, triangle, is_simple)
    !> corners, in order around it (3, n), n >= 3
    real(dp), intent(in) :: point(:, :)
    !> numbers of corners (3, n - 2)
    integer, allocatable, intent(out) :: triangle(:, :)
    !> whether the triangles cover the polygon and nothing twice
    logical, intent(out) :: is_simple
    integer :: left(size(point, 2)), m, k, n
    real(dp) :: normal(3), u(3), v(3), w(3), area, whole, extent

    n = size(point, 2)
    normal(:) = 0.0_dp
    do k = 1, n
      left(k) = k
      u(:) = point(:, k) - point(:, 1)
      v(:) = point(:, mod(k, n) + 1) - point(:, 1)
      w(:) = cross(u, v)
      normal(:) = normal + w
    end do
    allocate (triangle(3, n - 2))
    do m = n, 4, -1
      do k = 1, m
        if (is_ear(point, left(1:m), k, normal)) exit
      end do
      if (k > m) k = 2
      triangle(1, n - m + 1) = left(merge(m, k - 1, k == 1))
      triangle(2, n - m + 1) = left(k)
      triangle(3, n - m + 1) = left(merge(1, k + 1, k == m))
      left(k:m - 1) = left(k + 1:m)
    end do
    triangle(:, n - 2) = left(1:3)
    ! seen along the normal, triangles that lie on others have areas of the other sign
    area = 0.0_dp
    whole = 0.0_dp
    extent = 0.0_dp
    do k = 1, n - 2
      u(:) = point(:, triangle(2, k)) - point(:, triangle(1, k))
      v(:) = point(:, triangle(3, k)) - point(:, triangle(1, k))
      w(:) = cross(u, v)
      area = area + abs(dot_product(normal, w))
      whole = whole + norm2(w)
      extent = max(extent, norm2(u), norm2(v))
    end do
    is_simple = area <= (1.0_dp + twice_covered)*sum(normal**2)
    ! one whose parts outweigh each other has no normal; one of collinear corners has no parts
    if (whole > flat*extent**2) is_simple = is_simple .and. whole <= 2.0_dp*norm2(normal)
  end subroutine clip_ears

  !> Whether corner `k` of those that are left can be cut off.
  pure logical function is_ear(point, left, k, normal)
    real(dp), intent(in) :: point(:, :)
    integer, intent(in) :: left(:), k
    !> of the polygon, of any length
    real(dp), intent(in) :: normal(3)
    integer :: m, i, before, at, behind

    m = size(left)
    before = left(merge(m, k - 1, k == 1))
    at = left(k)
    behind = left(merge(1, k + 1, k == m))
    is_ear = turn_at(before, at, behind) > 0.0_dp
    if (.not. is_ear) return
    do i = 1, m
      if (stands_at(before, left(i)) .or. stands_at(at, left(i)) .or. stands_at(behind, left(i))) cycle
      if (turn_at(before, at, left(i)) < 0.0_dp .or. turn_at(at, behind, left(i)) < 0.0_dp .or. &
        & turn_at(behind, before, left(i)) < 0.0_dp) cycle
      is_ear = .false.
      return
    end do

  contains

    !> Whether two corners are one, or at one place as the two ends of a bridge are.
    pure logical function stands_at(a, b)
      integer, intent(in) :: a, b
      stands_at = .not. maxval(abs(point(:, a) - point(:, b))) > 0.0_dp
    end function stands_at

    !> Twice the area of a triangle, seen along the normal.
    pure real(dp) function turn_at(a, b, c)
      integer, intent(in) :: a, b, c
      real(dp) :: u(3), v(3), w(3)

      u(:) = point(:, b) - point(:, a)
      v(:) = point(:, c) - point(:, b)
      w(:) = cross(u, v)
      turn_at = dot_product(normal, w)
    end function turn_at

  end function is_ear

end module gravier_ear_clipping
