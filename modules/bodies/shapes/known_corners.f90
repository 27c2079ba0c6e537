!> Corners of regular polygons, of the five Platonic solids and of random stones.
module gravier_known_corners
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  implicit none
  private
  public :: regular_polygon, platonic_solid, random_polygon, random_polyhedron

  real(dp), parameter :: pi = acos(-1.0_dp)
  real(dp), parameter :: golden = 0.5_dp*(1.0_dp + sqrt(5.0_dp))
  !> places that are tried for a corner of a random stone, of which the one farthest from all corners before is taken
  integer, parameter :: tries = 16
  !> fraction of the room of a corner of a random polygon in which it lies
  real(dp), parameter :: loose = 0.8_dp

contains

  !> The corners of a regular polygon about the origin, its lowest side along the first axis.
  pure subroutine regular_polygon(n, radius, corner)
    !> corners, at least 3
    integer, intent(in) :: n
    !> of the circle through the corners
    real(dp), intent(in) :: radius
    !> (2, n), anticlockwise
    real(dp), allocatable, intent(out) :: corner(:, :)
    integer :: k
    real(dp) :: angle

    allocate (corner(2, n))
    do k = 1, n
      angle = (2*k - 1)*pi/n - 0.5_dp*pi
      corner(1, k) = radius*cos(angle)
      corner(2, k) = radius*sin(angle)
    end do
  end subroutine regular_polygon

  !> The corners of a Platonic solid about the origin; a cube has its edges along the axes.
  pure subroutine platonic_solid(name, radius, corner)
    !> tetrahedron, cube, octahedron, dodecahedron or icosahedron
    character(len=*), intent(in) :: name
    !> of the sphere through the corners
    real(dp), intent(in) :: radius
    !> (3, n)
    real(dp), allocatable, intent(out) :: corner(:, :)
    integer :: k

    select case (name)
    case ("tetrahedron")
      allocate (corner(3, 4))
      corner(:, :) = reshape(real([1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1], dp), [3, 4])
    case ("cube")
      allocate (corner(3, 8))
      call add_cube(corner)
    case ("octahedron")
      allocate (corner(3, 6), source=0.0_dp)
      do k = 1, 3
        corner(k, 2*k - 1) = -1.0_dp
        corner(k, 2*k) = 1.0_dp
      end do
    case ("dodecahedron")
      allocate (corner(3, 20))
      call add_cube(corner(:, 1:8))
      call add_rectangles(1.0_dp/golden, golden, corner(:, 9:20))
    case default
      allocate (corner(3, 12))
      call add_rectangles(1.0_dp, golden, corner)
    end select
    corner(:, :) = corner*(radius/norm2(corner(:, 1)))
  end subroutine platonic_solid

  pure subroutine add_cube(corner)
    !> (3, 8)
    real(dp), intent(out) :: corner(:, :)
    integer :: k, d

    do k = 1, 8
      do d = 1, 3
        corner(d, k) = 2*ibits(k - 1, d - 1, 1) - 1
      end do
    end do
  end subroutine add_cube

  !> Three rectangles across each other, in the planes of coordinates.
  pure subroutine add_rectangles(short, long, corner)
    !> half their sides
    real(dp), intent(in) :: short, long
    !> (3, 12)
    real(dp), intent(out) :: corner(:, :)
    integer :: k, d

    corner(:, :) = 0.0_dp
    do d = 1, 3
      do k = 1, 4
        corner(mod(d, 3) + 1, 4*d - 4 + k) = (2*ibits(k - 1, 0, 1) - 1)*short
        corner(mod(d + 1, 3) + 1, 4*d - 4 + k) = (2*ibits(k - 1, 1, 1) - 1)*long
      end do
    end do
  end subroutine add_rectangles

  !> Random corners on an ellipse, in turn: each in its own part of all directions, so that no two of them meet.
  pure subroutine random_polygon(seed, n, half_axes, corner)
    integer, intent(in) :: seed, n
    real(dp), intent(in) :: half_axes(2)
    !> (2, n), anticlockwise
    real(dp), allocatable, intent(out) :: corner(:, :)
    real(dp) :: angle
    integer :: k

    allocate (corner(2, n))
    do k = 1, n
      angle = 2.0_dp*pi*(k - 0.5_dp + loose*(hash_uniform(seed, int(k, i8), 0) - 0.5_dp))/n
      corner(1, k) = half_axes(1)*cos(angle)
      corner(2, k) = half_axes(2)*sin(angle)
    end do
  end subroutine random_polygon

  !> Random corners on an ellipsoid: of several places for a corner, which are all as likely on a sphere, the one farthest from all
  !> corners before. So no two of them meet, and stones are not far from round.
  pure subroutine random_polyhedron(seed, n, half_axes, corner)
    integer, intent(in) :: seed, n
    real(dp), intent(in) :: half_axes(3)
    !> (3, n)
    real(dp), allocatable, intent(out) :: corner(:, :)
    real(dp) :: place(3), distance, farthest, height, angle
    integer :: k, t, c, d

    allocate (corner(3, n), source=0.0_dp)
    do k = 1, n
      farthest = -1.0_dp
      do t = 1, tries
        height = 2.0_dp*hash_uniform(seed, int(k, i8), 2*t) - 1.0_dp
        angle = 2.0_dp*pi*hash_uniform(seed, int(k, i8), 2*t + 1)
        place(1) = sqrt(1.0_dp - height**2)*cos(angle)
        place(2) = sqrt(1.0_dp - height**2)*sin(angle)
        place(3) = height
        distance = huge(1.0_dp)
        do c = 1, k - 1
          distance = min(distance, norm2(corner(:, c) - place))
        end do
        if (.not. distance > farthest) cycle
        farthest = distance
        corner(:, k) = place
      end do
    end do
    do d = 1, 3
      corner(d, :) = half_axes(d)*corner(d, :)
    end do
  end subroutine random_polyhedron

end module gravier_known_corners
