!> Shapes of the plane: areas, centres of mass and moments of inertia, cores, and what is refused.
program test_polygon
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_shape_library, only: body_shape_t, shape_library_t, boundary_number
  use gravier_polygon, only: flat_piece_t, polygon_piece, round_piece, make_flat_shape
  use gravier_simple_shapes, only: make_polygon
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-13_dp, pi = acos(-1.0_dp)

  call test_brick()
  call test_regular()
  call test_round_pieces()
  call test_union()
  call test_refusals()
  call test_counts()
  call finish_checks()

contains

  !> A brick of 2 by 1 far from the origin, in either sense of rotation.
  subroutine test_brick()
    type(body_shape_t) :: shape
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 4), radius
    integer :: k

    radius = sqrt(1.25_dp)
    do k = 1, 2
      corners(:, 1) = [100.0_dp, 50.0_dp]
      corners(:, merge(2, 4, k == 1)) = [102.0_dp, 50.0_dp]
      corners(:, 3) = [102.0_dp, 51.0_dp]
      corners(:, merge(4, 2, k == 1)) = [100.0_dp, 51.0_dp]
      call make_polygon("brick", corners, 0.01_dp, shape, message)
      call check(len(message) == 0, "a brick is a polygon: "//message)
      call check_close(shape%size, radius, rounding, "half of its diagonal")
      call check_close(shape%volume*shape%size**2, 2.0_dp, rounding, "area of a brick")
      call check_close(shape%inertia(1)*shape%size**2, 5.0_dp/12.0_dp, rounding, "inertia of a brick of 1 kg")
      associate (piece => shape%piece(1))
        call check_close(sum(piece%corner), 0.0_dp, 10*rounding, "its centre is the origin")
        call check_close(maxval(piece%vertex(1, :))*radius, 0.99_dp, rounding, "the core lacks the rounding along x")
        call check_close(maxval(piece%vertex(2, :))*radius, 0.49_dp, rounding, "and along y")
        call check_close(piece%rounding*radius, 0.01_dp, rounding, "the rounding")
        call check(turns_left(piece), "its vertices are anticlockwise")
      end associate
    end do
  end subroutine test_brick

  pure logical function turns_left(piece)
    type(convex_piece_t), intent(in) :: piece
    real(dp) :: a(2), b(2)

    a(:) = piece%vertex(:, 2) - piece%vertex(:, 1)
    b(:) = piece%vertex(:, 3) - piece%vertex(:, 2)
    turns_left = a(1)*b(2) - a(2)*b(1) > 0.0_dp
  end function turns_left

  !> Regular polygons: area n/2 sin(2 pi/n), inertia 1/6 (1 + 2 cos^2(pi/n)) about the centre, for a circumscribed radius of 1.
  subroutine test_regular()
    type(body_shape_t) :: shape
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 12), apothem
    integer :: n, k

    do n = 3, 12
      do k = 1, n
        corners(1, k) = cos(2.0_dp*pi*k/n)
        corners(2, k) = sin(2.0_dp*pi*k/n)
      end do
      call make_polygon("regular", corners(:, 1:n), 0.001_dp, shape, message)
      call check_close(shape%volume, 0.5_dp*n*sin(2.0_dp*pi/n), rounding, "area of a regular polygon")
      call check_close(shape%inertia(1), (1.0_dp + 2.0_dp*cos(pi/n)**2)/6.0_dp, rounding, "inertia of a regular polygon")
      apothem = cos(pi/n)
      call check_close(norm2(shape%piece(1)%vertex(:, 1)), 1.0_dp - 0.001_dp/apothem, rounding, "corners of its core")
    end do
  end subroutine test_regular

  !> A disk and a capsule, against the sum of a rectangle and two half disks by hand.
  subroutine test_round_pieces()
    type(flat_piece_t) :: made
    character(len=:), allocatable :: message

    call round_piece(reshape([3.0_dp, 4.0_dp], [2, 1]), 0.5_dp, made, message)
    call check_close(made%area, pi*0.25_dp, rounding, "area of a disk")
    call check_close(made%moment, pi*0.5_dp**4/2.0_dp, rounding, "moment of a disk")
    call check_close(norm2(made%centroid - [3.0_dp, 4.0_dp]), 0.0_dp, rounding, "centre of a disk")
    call round_piece(reshape([-1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp], [2, 2]), 1.0_dp, made, message)
    call check_close(made%area, pi + 4.0_dp, rounding, "area of a capsule")
    ! integral over the two halves x from 1 on, a half disk about (1, 0), and the square |x|, |y| <= 1
    call check_close(made%moment, 8.0_dp/3.0_dp + pi/2.0_dp + pi + 8.0_dp/3.0_dp, rounding, "moment of a capsule")
  end subroutine test_round_pieces

  !> Two squares side by side are a brick.
  subroutine test_union()
    type(flat_piece_t) :: made(2)
    type(body_shape_t) :: shape
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 4)
    integer :: k

    do k = 1, 2
      corners(1, :) = [0.0_dp, 1.0_dp, 1.0_dp, 0.0_dp]
      corners(1, :) = corners(1, :) + (k - 1)
      corners(2, :) = [0.0_dp, 0.0_dp, 1.0_dp, 1.0_dp]
      call polygon_piece(corners, 0.01_dp, made(k), message)
    end do
    call make_flat_shape("pair", made, shape)
    call check_equal(size(shape%piece), 2, "two pieces")
    call check_close(shape%size, sqrt(1.25_dp), rounding, "radius of two squares")
    call check_close(shape%volume*shape%size**2, 2.0_dp, rounding, "area of two squares")
    call check_close(shape%inertia(1)*shape%size**2, 5.0_dp/12.0_dp, rounding, "inertia of two squares")
    call check_close(maxval(shape%piece(2)%corner(1, :))*shape%size, 1.0_dp, rounding, "the second one is on the right")
  end subroutine test_union

  subroutine test_refusals()
    type(flat_piece_t) :: made
    character(len=:), allocatable :: message
    real(dp), parameter :: square(2, 4) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.0_dp, 1.0_dp], [2, 4])
    real(dp) :: corners(2, 4)

    call refuse(square(:, 1:2), 0.01_dp, "at least 3")
    call refuse(square, 0.0_dp, "expected more than 0")
    call refuse(square, 0.5_dp, "leaves nothing of the side after corner 1")
    corners(:, :) = square
    corners(:, 3) = [0.4_dp, 0.4_dp]
    call refuse(corners, 0.01_dp, "not convex")
    corners(:, 3) = [0.5_dp, 0.5_dp]
    call refuse(corners, 0.01_dp, "not convex, or straight")
    corners(:, 3) = corners(:, 2)
    call refuse(corners, 0.01_dp, "in the same place")
    corners(2, :) = 0.0_dp
    call refuse(corners, 0.01_dp, "without area")
    call round_piece(square(:, 1:1), 0.0_dp, made, message)
    call check(index(message, "expected more than 0") > 0, "a disk without radius")
    corners(:, :) = 0.0_dp
    call round_piece(corners(:, 1:2), 1.0_dp, made, message)
    call check(index(message, "expected two ends") > 0, "a capsule without length")
  end subroutine test_refusals

  subroutine refuse(corners, rounding, expected)
    real(dp), intent(in) :: corners(:, :), rounding
    character(len=*), intent(in) :: expected
    type(flat_piece_t) :: made
    character(len=:), allocatable :: message

    call polygon_piece(corners, rounding, made, message)
    call check(index(message, expected) > 0, "'"//message//"' says '"//expected//"'")
  end subroutine refuse

  !> The points in which two bodies may touch.
  subroutine test_counts()
    type(shape_library_t) :: library
    type(flat_piece_t) :: made(2)
    type(body_shape_t) :: shape
    character(len=:), allocatable :: message
    real(dp), parameter :: square(2, 4) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.0_dp, 1.0_dp], [2, 4])

    call make_polygon("square", square, 0.01_dp, shape, message)
    call library%add(shape)
    call polygon_piece(square, 0.01_dp, made(1), message)
    call polygon_piece(square + 2.0_dp, 0.01_dp, made(2), message)
    call make_flat_shape("two", made, shape)
    call library%add(shape)
    call round_piece(square(:, 1:1), 1.0_dp, made(1), message)
    call make_flat_shape("disk", made(1:1), shape)
    call library%add(shape)
    call check_equal(library%n, 3, "three shapes")
    call check_equal(library%find("two"), 2, "found by its name")
    call check_equal(library%find("three"), 0, "no such shape")
    call check_equal(library%counts%between(0, 0), 1, "two disks")
    call check_equal(library%counts%between(1, 0), 1, "a square and a disk")
    call check_equal(library%counts%between(1, 1), 2, "two squares")
    call check_equal(library%counts%between(2, 1), 4, "two pieces and a square")
    call check_equal(library%counts%between(2, 2), 8, "two and two pieces")
    call check_equal(library%counts%between(3, 3), 1, "disks of the library")
    call check_equal(library%counts%between(2, boundary_number), 4, "two pieces and a boundary")
  end subroutine test_counts

end program test_polygon
