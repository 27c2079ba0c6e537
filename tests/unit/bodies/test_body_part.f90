!> The parts of bodies with shapes in boxes: polygons and polyhedra exactly, capsules by slices, and boxes that fill space.
program test_body_part
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_orientation, only: turn_orientation
  use gravier_polyhedra, only: octahedron, dodecahedron, draws_t
  use gravier_polygon, only: flat_piece_t, polygon_piece, round_piece, make_flat_shape
  use gravier_simple_shapes, only: make_polyhedron, make_box, make_capsule, make_polygon
  use gravier_shape_library, only: body_shape_t
  use gravier_body_part, only: turned_body_t
  use gravier_check, only: check, check_close, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-14_dp, far = 1.0e30_dp
  !> what the slices of a capsule are off by
  real(dp), parameter :: sliced = 3.0e-4_dp

  call MPI_Init()
  call test_square()
  call test_flat_cluster()
  call test_box()
  call test_octahedron()
  call test_capsule()
  call test_boxes_fill_space()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A square that stands on a corner, |x| + |y| <= 1.
  subroutine test_square()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 4)

    corners(:, 1) = [-1.0_dp, -1.0_dp]
    corners(:, 2) = [1.0_dp, -1.0_dp]
    corners(:, 3) = [1.0_dp, 1.0_dp]
    corners(:, 4) = [-1.0_dp, 1.0_dp]
    call make_polygon("square", corners, 0.01_dp, shape, message)
    call body%turn(shape, 2, 1.0_dp, [0.25_dp*pi])
    call check_close(body%high(2), 1.0_dp, tight, "it stands on a corner")
    call check_close(body%share_between(shape, [-far, -far], [far, -0.5_dp]), 0.125_dp, tight, "its lowest corner")
    call check_close(body%share_between(shape, [0.0_dp, 0.0_dp], [far, far]), 0.25_dp, tight, "a quarter")
    call check_close(body%share_between(shape, [0.25_dp, 0.25_dp], [2.0_dp, 3.0_dp]), 0.0625_dp, tight, "between two sides")
    call check_close(body%share_between(shape, [-0.1_dp, -0.2_dp], [0.3_dp, 0.1_dp]), 0.06_dp, tight, "a box within")
    call check_close(body%share_between(shape, [0.6_dp, 0.6_dp], [far, far]), 0.0_dp, tight, "past its side")
    call check_close(body%share_between(shape, [-1.5_dp, -1.5_dp], [1.5_dp, 1.5_dp]), 1.0_dp, 0.0_dp, "all of it")
    call check_close(body%share_between(shape, [1.0_dp, -far], [far, far]), 0.0_dp, 0.0_dp, "nothing of it")
  end subroutine test_square

  !> A cluster of a square and a disk beside it: each piece counts.
  subroutine test_flat_cluster()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    type(flat_piece_t) :: made(2)
    character(len=:), allocatable :: message
    real(dp), parameter :: middle = (4.0_dp*1.0_dp + pi*5.0_dp)/(4.0_dp + pi)
    real(dp) :: corners(2, 4)

    corners(:, 1) = [0.0_dp, 0.0_dp]
    corners(:, 2) = [2.0_dp, 0.0_dp]
    corners(:, 3) = [2.0_dp, 2.0_dp]
    corners(:, 4) = [0.0_dp, 2.0_dp]
    call polygon_piece(corners, 0.01_dp, made(1), message)
    call round_piece(reshape([5.0_dp, 1.0_dp], [2, 1]), 1.0_dp, made(2), message)
    call make_flat_shape("two", made, shape)
    call body%turn(shape, 2, shape%size, [0.0_dp])
    call check_close(body%share_between(shape, [-far, -far], [3.0_dp - middle, far]), 4.0_dp/(4.0_dp + pi), tight, "the square")
    call check_close(body%share_between(shape, [5.0_dp - middle, 0.0_dp], [far, far]), 0.25_dp*pi/(4.0_dp + pi), tight, &
      & "a quarter of the disk")
  end subroutine test_flat_cluster

  !> A box in the axes of its file.
  subroutine test_box()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    type(error_t), allocatable :: error

    call make_box("box", [2.0_dp, 3.0_dp, 4.0_dp], 0.1_dp, shape, error)
    call body%turn(shape, 3, shape%size, shape%turn)
    call check_close(body%share_between(shape, [-0.5_dp, -1.0_dp, -2.0_dp], [0.5_dp, 0.25_dp, 0.0_dp]), &
      & 0.5_dp*1.25_dp/3.0_dp*0.5_dp, 10*tight, "a box in a box")
    call check_close(body%share_between(shape, [-far, -far, 1.0_dp], [far, far, far]), 0.25_dp, 10*tight, "its upper quarter")
  end subroutine test_box

  !> |x| + |y| + |z| <= 1.
  subroutine test_octahedron()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    type(error_t), allocatable :: error
    real(dp) :: points(3, 6)

    points(:, :) = octahedron()
    points(:, :) = points/norm2(points(:, 1))
    call make_polyhedron("octahedron", points, 0.05_dp, shape, error)
    call body%turn(shape, 3, 1.0_dp, shape%turn)
    call check_close(body%share_between(shape, [0.0_dp, 0.0_dp, 0.0_dp], [far, far, far]), 0.125_dp, 10*tight, "an octant")
    call check_close(body%share_between(shape, [0.25_dp, 0.25_dp, 0.0_dp], [far, far, far]), 1.0_dp/64.0_dp, 10*tight, &
      & "beyond two sides")
  end subroutine test_octahedron

  !> Across its axis a capsule is cut as its cylinder and its ball are; along it at the centre of an end half of the ball remains.
  subroutine test_capsule()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    type(flat_piece_t) :: made(1)
    type(error_t), allocatable :: error
    character(len=:), allocatable :: message
    real(dp), parameter :: disk = 0.80449889052211463_dp, ball = 0.84375_dp

    call round_piece(reshape([-1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp], [2, 2]), 0.5_dp, made(1), message)
    call make_flat_shape("rod", made, shape)
    call body%turn(shape, 2, 1.5_dp, [0.0_dp])
    call check_close(body%share_between(shape, [-far, -far], [-1.0_dp, far]), pi/8.0_dp/(2.0_dp + 0.25_dp*pi), sliced, "an end")
    call check_close(body%share_between(shape, [-far, -far], [far, 0.25_dp]), (1.5_dp + 0.25_dp*pi*disk)/(2.0_dp + 0.25_dp*pi), &
      & sliced, "above its axis")
    call body%turn(shape, 2, 1.5_dp, [0.5_dp*pi])
    call check_close(body%share_between(shape, [-far, -far], [far, -1.0_dp]), pi/8.0_dp/(2.0_dp + 0.25_dp*pi), sliced, "turned")
    call make_capsule("rod", 2.0_dp, 0.5_dp, shape, error)
    call body%turn(shape, 3, 1.5_dp, shape%turn)
    call check_close(body%share_between(shape, [-far, -far, -far], [0.25_dp, far, far]), (3.0_dp*disk + ball)/4.0_dp, sliced, &
      & "a capsule in space")
    call check_close(body%share_between(shape, [-far, -far, 1.0_dp], [far, far, far]), 0.125_dp, sliced, "its end")
  end subroutine test_capsule

  !> Boxes that fill space have all of a body, however it lies, and none has less than nothing.
  subroutine test_boxes_fill_space()
    type(body_shape_t) :: shape
    type(turned_body_t) :: body
    type(error_t), allocatable :: error
    type(draws_t) :: draws
    real(dp) :: points(3, 20), q(4), spin(3), side(3, 0:3), from(3), to(3), share, total, least
    integer :: at(3), trial, i, j, k, d

    points(:, :) = dodecahedron()
    call make_polyhedron("dodecahedron", points, 0.05_dp, shape, error)
    least = 0.0_dp
    do trial = 1, 20
      q(:) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
      do d = 1, 3
        spin(d) = draws%between(-1.0_dp, 1.0_dp)
      end do
      call turn_orientation(q, spin, 1.0_dp)
      call body%turn(shape, 3, 0.7_dp, q)
      side(:, 0) = -far
      side(:, 3) = far
      do d = 1, 3
        side(d, 1) = draws%between(-0.7_dp, 0.1_dp)
        side(d, 2) = draws%between(side(d, 1), 0.7_dp)
      end do
      total = 0.0_dp
      do i = 1, 3
        do j = 1, 3
          do k = 1, 3
            at(1) = i
            at(2) = j
            at(3) = k
            do d = 1, 3
              from(d) = side(d, at(d) - 1)
              to(d) = side(d, at(d))
            end do
            share = body%share_between(shape, from, to)
            least = min(least, share)
            total = total + share
          end do
        end do
      end do
      call check_close(total, 1.0_dp, 1.0e-13_dp, "boxes that fill space")
    end do
    call check(least > -1.0e-13_dp, "no box has less than nothing")
  end subroutine test_boxes_fill_space

end program test_body_part
