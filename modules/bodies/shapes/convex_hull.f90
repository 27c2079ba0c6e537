!> The convex hull of points in space, with exact decisions.
!>
!> Points are put on a grid of 2^-35 of their extent, where the side of a plane on which a point lies is found without error: in
!> double precision where that is enough, and in quadruple precision elsewhere. So the hull is always a closed surface, whatever
!> points coincide or lie in a line or a plane. Triangles in a common plane are then merged.
module gravier_convex_hull
  use, intrinsic :: iso_fortran_env, only: real128
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort_rows
  use gravier_hull_faces, only: merge_triangles
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_spatial, only: extent_of, find_box, find_normal, shorten
  implicit none
  private
  public :: find_hull

  !> half the extent of the points on the grid
  real(dp), parameter :: half_extent = 2.0_dp**34
  !> a determinant above this in size has the right sign in double precision, whose error is below 40 epsilon times the cube of
  !> the extent
  real(dp), parameter :: certain = 1.0e-14_dp*(2*half_extent)**3

  !> part of the extent up to which points lie in a line or a plane
  real(dp), parameter :: thin = 1.0e-9_dp

  !> A surface of triangles under way.
  type :: surface_t
    !> triangles in use or free, and those that are in use
    integer :: n = 0
    integer, allocatable :: corner(:, :)
    logical, allocatable :: used(:)
    !> normals, not of unit length, in units of the grid (3, n)
    real(dp), allocatable :: normal(:, :)
  end type surface_t

contains

  !> The hull of points, its vertices in the order of the points.
  subroutine find_hull(points, flat, hull, message)
    !> (3, n)
    real(dp), intent(in), contiguous :: points(:, :)
    !> distance from a plane up to which points lie in it
    real(dp), intent(in) :: flat
    type(sharp_polyhedron_t), intent(out) :: hull
    !> empty; otherwise why there is no hull, in some words
    character(len=:), allocatable, intent(out) :: message
    type(surface_t) :: surface
    real(dp), allocatable :: grid(:, :)
    integer, allocatable :: point(:), triangles(:, :)
    integer :: start(4), k, n, e

    call place_on_grid(points, grid, point)
    call find_start(grid(:, 1:size(point)), start, message)
    if (len(message) > 0) return
    call begin_surface(grid, start, surface)
    do k = 1, size(point)
      if (all(start /= k)) call add_point(grid, k, surface)
    end do
    n = count(surface%used(1:surface%n))
    allocate (triangles(3, n))
    n = 0
    do k = 1, surface%n
      if (.not. surface%used(k)) cycle
      n = n + 1
      do e = 1, 3
        triangles(e, n) = point(surface%corner(e, k))
      end do
    end do
    call merge_triangles(points, triangles, flat, hull, message)
  end subroutine find_hull

  !> Different points on the grid, in ascending order of their coordinates.
  subroutine place_on_grid(points, grid, point)
    real(dp), intent(in) :: points(:, :)
    !> whole numbers (3, m or more)
    real(dp), allocatable, intent(out) :: grid(:, :)
    !> the first of the points that lies there (m)
    integer, allocatable, intent(out) :: point(:)
    integer(i8), allocatable :: keys(:, :)
    integer, allocatable :: order(:)
    real(dp) :: low(3), high(3), middle(3), extent
    integer :: k, m, n
    logical :: differs

    n = size(points, 2)
    allocate (keys(3, n), order(n))
    call find_box(points, low, high)
    middle(:) = 0.5_dp*low + 0.5_dp*high
    extent = 0.5_dp*extent_of(points)
    if (.not. extent > 0.0_dp) extent = 1.0_dp
    do k = 1, n
      keys(:, k) = nint((points(:, k) - middle)/extent*half_extent, i8)
    end do
    call argsort_rows(keys, order)
    allocate (grid(3, n), point(n))
    m = 0
    do k = 1, n
      differs = k == 1
      if (k > 1) differs = any(keys(:, order(k)) /= keys(:, order(k - 1)))
      if (.not. differs) cycle
      m = m + 1
      grid(:, m) = real(keys(:, order(k)), dp)
      point(m) = order(k)
    end do
    call shorten(point, m)
  end subroutine place_on_grid

  !> Four points that span a tetrahedron: the first and the last, the one farthest from their line, the one farthest from the plane.
  subroutine find_start(grid, start, message)
    real(dp), intent(in), contiguous :: grid(:, :)
    integer, intent(out) :: start(4)
    character(len=:), allocatable, intent(out) :: message
    real(dp) :: largest, found, normal(3)
    integer :: k

    start(:) = 0
    message = "at least 4 different points are needed"
    if (size(grid, 2) < 4) return
    start(1) = 1
    start(2) = size(grid, 2)
    message = "all points lie on a line"
    largest = thin*(2*half_extent)**2
    do k = 2, size(grid, 2) - 1
      call find_normal(grid(:, start(1)), grid(:, start(2)), grid(:, k), normal)
      found = norm2(normal)
      if (.not. found > largest) cycle
      largest = found
      start(3) = k
    end do
    if (start(3) == 0) return
    message = "all points lie in a plane"
    largest = thin*2*half_extent*largest
    do k = 1, size(grid, 2)
      if (any(start(1:3) == k)) cycle
      found = abs(side(grid, start(1), start(2), start(3), k))
      if (.not. found > largest) cycle
      largest = found
      start(4) = k
    end do
    if (start(4) == 0) return
    message = ""
    ! the fourth point behind the first three
    if (side(grid, start(1), start(2), start(3), start(4)) > 0.0_dp) then
      k = start(1)
      start(1) = start(2)
      start(2) = k
    end if
  end subroutine find_start

  !> The tetrahedron that the hull begins with.
  subroutine begin_surface(grid, start, surface)
    real(dp), intent(in), contiguous :: grid(:, :)
    integer, intent(in) :: start(4)
    type(surface_t), intent(out) :: surface
    integer :: room

    ! a closed surface of triangles has at most 2 n - 4 of them
    room = 2*size(grid, 2)
    allocate (surface%corner(3, room), surface%used(room), surface%normal(3, room))
    surface%used(:) = .false.
    call add_triangle(grid, start(1), start(2), start(3), surface)
    call add_triangle(grid, start(2), start(1), start(4), surface)
    call add_triangle(grid, start(3), start(2), start(4), surface)
    call add_triangle(grid, start(1), start(3), start(4), surface)
  end subroutine begin_surface

  !> Take one more point into the hull: triangles that it sees go, and new ones lead from their border to it.
  subroutine add_point(grid, k, surface)
    real(dp), intent(in), contiguous :: grid(:, :)
    integer, intent(in) :: k
    type(surface_t), intent(inout) :: surface
    integer, allocatable :: seen(:, :), border(:, :)
    integer :: t, n, n_border, e, u, v
    real(dp) :: height

    n = 0
    allocate (seen(3, count(surface%used(1:surface%n))))
    do t = 1, surface%n
      if (.not. surface%used(t)) cycle
      height = dot_product(surface%normal(:, t), grid(:, k) - grid(:, surface%corner(1, t)))
      if (abs(height) <= certain) height = side(grid, surface%corner(1, t), surface%corner(2, t), surface%corner(3, t), k)
      if (height <= 0.0_dp) cycle
      n = n + 1
      seen(:, n) = surface%corner(:, t)
      surface%used(t) = .false.
    end do
    allocate (border(2, 3*n))
    n_border = 0
    do t = 1, n
      do e = 1, 3
        u = seen(e, t)
        v = seen(mod(e, 3) + 1, t)
        if (has_side(seen(:, 1:n), v, u)) cycle
        n_border = n_border + 1
        border(1, n_border) = u
        border(2, n_border) = v
      end do
    end do
    do e = 1, n_border
      call add_triangle(grid, border(1, e), border(2, e), k, surface)
    end do
  end subroutine add_point

  !> Whether one of some triangles has a side from u to v.
  pure logical function has_side(triangles, u, v)
    integer, intent(in), contiguous :: triangles(:, :)
    integer, intent(in) :: u, v
    integer :: t

    has_side = .true.
    do t = 1, size(triangles, 2)
      if (triangles(1, t) == u .and. triangles(2, t) == v) return
      if (triangles(2, t) == u .and. triangles(3, t) == v) return
      if (triangles(3, t) == u .and. triangles(1, t) == v) return
    end do
    has_side = .false.
  end function has_side

  !> Put a triangle into the first place that is free.
  subroutine add_triangle(grid, a, b, c, surface)
    real(dp), intent(in), contiguous :: grid(:, :)
    !> anticlockwise seen from outside
    integer, intent(in) :: a, b, c
    type(surface_t), intent(inout) :: surface
    integer :: t

    do t = 1, surface%n
      if (.not. surface%used(t)) exit
    end do
    surface%n = max(surface%n, t)
    surface%used(t) = .true.
    surface%corner(1, t) = a
    surface%corner(2, t) = b
    surface%corner(3, t) = c
    call find_normal(grid(:, a), grid(:, b), grid(:, c), surface%normal(:, t))
  end subroutine add_triangle

  !> Six times the volume of the tetrahedron of three points and a fourth, above 0 where the fourth is in front of the triangle. The
  !> sign is exact: differences have at most 36 bits, so that all terms and their sum fit the 113 bits of the precision used.
  pure real(dp) function side(grid, a, b, c, d)
    real(dp), intent(in) :: grid(:, :)
    integer, intent(in) :: a, b, c, d
    real(real128) :: u(3), v(3), w(3)

    u(:) = real(grid(:, b) - grid(:, a), real128)
    v(:) = real(grid(:, c) - grid(:, a), real128)
    w(:) = real(grid(:, d) - grid(:, a), real128)
    side = real(w(1)*(u(2)*v(3) - u(3)*v(2)) + w(2)*(u(3)*v(1) - u(1)*v(3)) + w(3)*(u(1)*v(2) - u(2)*v(1)), dp)
  end function side

end module gravier_convex_hull
