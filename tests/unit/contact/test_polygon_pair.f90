!> Contacts of pieces of the plane: bricks, disks and capsules in known places, and random pairs whose distance is proved by
!> duality.
program test_polygon_pair
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_polygon, only: flat_piece_t, polygon_piece
  use gravier_manifold, only: manifold_t, feature_base
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_polygon_manifold, find_plane_manifold
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-13_dp, pi = acos(-1.0_dp), rho = 0.01_dp

  call test_bricks()
  call test_turned_bricks()
  call test_round_pieces()
  call test_plane()
  call test_overlap()
  call test_swap()
  call test_random_pairs()
  call finish_checks()

contains

  !> A brick of 2 by 1 with its centre at a place.
  subroutine put_brick(x, y, angle, placed)
    real(dp), intent(in) :: x, y, angle
    type(placed_piece_t), intent(out) :: placed
    type(flat_piece_t) :: made
    character(len=:), allocatable :: message
    real(dp), parameter :: corners(2, 4) = &
      & reshape([-1.0_dp, -0.5_dp, 1.0_dp, -0.5_dp, 1.0_dp, 0.5_dp, -1.0_dp, 0.5_dp], [2, 4])
    real(dp) :: centre(2)

    call polygon_piece(corners, rho, made, message)
    centre(1) = x
    centre(2) = y
    call place_piece(made%piece%vertex, made%piece%corner, rho, 1.0_dp, angle, centre, placed)
  end subroutine put_brick

  !> A disk, or a capsule of two ends.
  subroutine put_round(ends, radius, placed)
    real(dp), intent(in) :: ends(:, :), radius
    type(placed_piece_t), intent(out) :: placed
    real(dp), parameter :: origin(2) = 0.0_dp
    real(dp) :: vertex(2, size(ends, 2))

    vertex(:, :) = ends
    call place_piece(vertex, vertex, radius, 1.0_dp, 0.0_dp, origin, placed)
  end subroutine put_round

  !> A brick on a brick, shifted by half its length: two points at the ends of the common part, corners of the sharp bricks.
  subroutine test_bricks()
    type(placed_piece_t) :: upper, lower
    type(manifold_t) :: manifold

    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, lower)
    call put_brick(1.0_dp, 1.0_dp + 0.002_dp, 0.0_dp, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
    call check_equal(manifold%n, 2, "two points between bricks")
    call check_close(maxval(abs(manifold%gap(1:2) - 0.002_dp)), 0.0_dp, rounding, "the gap between flat sides")
    call check_close(norm2(manifold%normal(1:2) - [0.0_dp, 1.0_dp]), 0.0_dp, rounding, "the normal is up")
    call check_close(minval(manifold%point(1, 1:2)), 0.0_dp, rounding, "the corner of the upper brick")
    call check_close(maxval(manifold%point(1, 1:2)), 1.0_dp, rounding, "the corner of the lower brick")
    call check_close(maxval(abs(manifold%point(2, 1:2) - 0.501_dp)), 0.0_dp, rounding, "half-way between the sides")
    call check(manifold%key(1) < manifold%key(2), "keys ascend")
    call check(.not. manifold%cores_overlap, "cores are apart")
    call put_brick(1.0_dp, 1.0_dp + 0.02_dp, 0.0_dp, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
    call check_equal(manifold%n, 0, "beyond the alert distance")
  end subroutine test_bricks

  !> Bricks at an angle: a corner on a side, one point and its rounding.
  subroutine test_turned_bricks()
    type(placed_piece_t) :: upper, lower
    type(manifold_t) :: manifold
    real(dp) :: lowest

    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, lower)
    call put_brick(0.2_dp, 2.0_dp, 0.25_dp*pi, upper)
    lowest = minval(upper%vertex(2, 1:4)) - rho
    call put_brick(0.2_dp, 2.0_dp - (lowest - 0.5_dp) + 0.003_dp, 0.25_dp*pi, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
    call check_equal(manifold%n, 1, "a corner touches in one point")
    call check_close(manifold%gap(1), 0.003_dp, rounding, "the gap at a corner")
    call check_close(manifold%point(2, 1), 0.5015_dp, rounding, "half-way between corner and side")
    call check_close(norm2(manifold%normal(1:2) - [0.0_dp, 1.0_dp]), 0.0_dp, rounding, "the normal of the side")
    ! corner against corner
    call put_brick(2.0_dp + 0.02_dp, 1.0_dp + 0.02_dp, 0.0_dp, upper)
    call find_polygon_manifold(upper, lower, 0.1_dp, manifold)
    call check_equal(manifold%n, 1, "two corners touch in one point")
    call check_close(norm2(manifold%normal(1:2) - sqrt(0.5_dp)), 0.0_dp, rounding, "along the line of the corners")
    call check_close(manifold%gap(1), sqrt(2.0_dp)*0.04_dp - 2*rho, rounding, "their rounded gap")
  end subroutine test_turned_bricks

  subroutine test_round_pieces()
    type(placed_piece_t) :: disk, other, brick
    type(manifold_t) :: manifold

    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, brick)
    call put_round(reshape([0.3_dp, 0.8_dp], [2, 1]), 0.25_dp, disk)
    call find_polygon_manifold(disk, brick, 0.1_dp, manifold)
    call check_equal(manifold%n, 1, "a disk on a brick")
    call check_close(manifold%gap(1), 0.05_dp, rounding, "its gap")
    call check_close(manifold%point(1, 1), 0.3_dp, rounding, "below its centre")
    call put_round(reshape([0.3_dp, 1.4_dp], [2, 1]), 0.25_dp, other)
    call find_polygon_manifold(other, disk, 0.2_dp, manifold)
    call check_close(manifold%gap(1), 0.1_dp, rounding, "two disks")
    call check_close(manifold%point(2, 1), 1.1_dp, rounding, "half-way between them")
    ! a capsule that lies on the brick touches at its two ends
    call put_round(reshape([-0.5_dp, 0.8_dp, 0.5_dp, 0.8_dp], [2, 2]), 0.25_dp, other)
    call find_polygon_manifold(other, brick, 0.1_dp, manifold)
    call check_equal(manifold%n, 2, "a capsule on a brick")
    call check_close(maxval(abs(abs(manifold%point(1, 1:2)) - 0.5_dp)), 0.0_dp, rounding, "at the ends of its axis")
    call check_close(maxval(abs(manifold%gap(1:2) - 0.05_dp)), 0.0_dp, rounding, "its gaps")
  end subroutine test_round_pieces

  !> A brick on the ground: corners of the sharp brick where it lies flat, of the core where it stands at an angle.
  subroutine test_plane()
    type(placed_piece_t) :: brick
    type(manifold_t) :: manifold
    real(dp), parameter :: up(2) = [0.0_dp, 1.0_dp]

    call put_brick(0.0_dp, 0.5_dp, 0.0_dp, brick)
    call find_plane_manifold(brick, up, 0.0_dp, 0.1_dp, manifold)
    call check_equal(manifold%n, 2, "a brick on the ground")
    call check_close(maxval(abs(abs(manifold%point(1, 1:2)) - 1.0_dp)), 0.0_dp, rounding, "at its sharp corners")
    call check_close(maxval(abs(manifold%gap(1:2))), 0.0_dp, rounding, "without a gap")
    call check_close(maxval(abs(manifold%point(2, 1:2))), 0.0_dp, rounding, "on the ground")
    call put_brick(0.0_dp, 0.5_dp, 0.05_dp, brick)
    call find_plane_manifold(brick, up, -0.05_dp, 0.2_dp, manifold)
    call check_equal(manifold%n, 2, "a tilted brick")
    call check_close(minval(manifold%gap(1:2)), minval(brick%vertex(2, 1:4)) - rho + 0.05_dp, rounding, "the lower corner")
    call put_brick(0.0_dp, 1.0_dp, 0.5_dp, brick)
    call find_plane_manifold(brick, up, 0.0_dp, 0.2_dp, manifold)
    call check_equal(manifold%n, 1, "a brick on its corner")
    call check_close(manifold%gap(1), minval(brick%vertex(2, 1:4)) - rho, rounding, "the gap of its corner")
    call find_plane_manifold(brick, up, -1.0_dp, 0.2_dp, manifold)
    call check_equal(manifold%n, 0, "a brick in the air")
  end subroutine test_plane

  !> Cores that overlap have the normal of least separation.
  subroutine test_overlap()
    type(placed_piece_t) :: upper, lower
    type(manifold_t) :: manifold
    integer :: k

    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, lower)
    call put_brick(0.3_dp, 0.9_dp, 0.0_dp, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
    call check(manifold%cores_overlap, "cores overlap")
    call check_close(norm2(manifold%normal(1:2) - [0.0_dp, 1.0_dp]), 0.0_dp, rounding, "the way out is up")
    call check_close(maxval(abs(manifold%gap(1:manifold%n) + 0.1_dp)), 0.0_dp, rounding, "how deep they are")
    ! a corner in a side, whichever of the two is the candidate
    call put_brick(0.3_dp, 0.45_dp + 1.5_dp*sqrt(0.5_dp), 0.25_dp*acos(-1.0_dp), upper)
    do k = 1, 2
      if (k == 1) call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
      if (k == 2) call find_polygon_manifold(lower, upper, 0.01_dp, manifold)
      call check(manifold%n == 1 .and. manifold%cores_overlap, "a corner in a side")
      call check_close(manifold%normal(2), merge(1.0_dp, -1.0_dp, k == 1), rounding, "the normal of the side")
      ! the round corner is nearer to the middle of its brick than the sharp one
      call check_close(manifold%gap(1), -0.05_dp + (sqrt(2.0_dp) - 1.0_dp)*rho, rounding, "how deep the corner is")
      call check_close(manifold%point(1, 1), 0.3_dp - 0.5_dp*sqrt(0.5_dp), 1.0e-9_dp, "the contact is at the corner")
      call check_close(manifold%point(2, 1), 0.5_dp + 0.5_dp*manifold%gap(1), rounding, "half-way between both")
    end do
    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, manifold)
    call check(manifold%n > 0 .and. all(abs(manifold%gap(1:manifold%n)) < huge(1.0_dp)), "one brick in the place of another")
  end subroutine test_overlap

  !> The same contacts with the pieces swapped, the normal turned round; keys do not change where the nearer side does.
  subroutine test_swap()
    type(placed_piece_t) :: upper, lower
    type(manifold_t) :: one, other, tilted
    integer :: k

    call put_brick(0.0_dp, 0.0_dp, 0.0_dp, lower)
    call put_brick(0.7_dp, 1.0_dp, 1.0e-9_dp, upper)
    call find_polygon_manifold(upper, lower, 0.01_dp, one)
    call find_polygon_manifold(lower, upper, 0.01_dp, other)
    call check_equal(other%n, one%n, "as many points")
    call check_close(norm2(one%normal + other%normal), 0.0_dp, 1.0e-8_dp, "the other normal")
    do k = 1, one%n
      call check(any(abs(other%point(1, 1:other%n) - one%point(1, k)) < 1.0e-8_dp), "the same points")
    end do
    do k = -2, 2
      call put_brick(0.7_dp, 1.0_dp, 1.0e-12_dp*k, upper)
      call find_polygon_manifold(upper, lower, 0.01_dp, tilted)
      call check(tilted%n == 2 .and. all(tilted%key(1:2) == one%key(1:2)), "keys stay where parallel sides swap roles")
    end do
  end subroutine test_swap

  !> Random polygons: no direction separates the cores by more than the shortest way between them, and the normal found separates
  !> them by just that.
  subroutine test_random_pairs()
    integer, parameter :: n_pairs = 20000
    type(placed_piece_t) :: a, b
    type(manifold_t) :: manifold
    real(dp) :: gap, worst, least
    integer :: k, missed, beyond

    worst = 0.0_dp
    missed = 0
    beyond = 0
    do k = 1, n_pairs
      call put_random(2_i8*k, 0.0_dp, a)
      call put_random(2_i8*k + 1_i8, 1.0_dp + 1.5_dp*hash_uniform(7, int(k, i8), 1), b)
      call find_polygon_manifold(a, b, 0.5_dp, manifold)
      if (manifold%n == 0) then
        ! some direction separates them by more than the alert distance
        if (best_separation(a, b) < 0.5_dp) missed = missed + 1
        cycle
      end if
      if (manifold%cores_overlap) cycle
      gap = separation(a, b, manifold%normal(1:2)) - 2*rho
      least = minval(manifold%gap(1:manifold%n))
      ! the number of a side says that the point is the end of one, and not of the shortest way
      if (mod(manifold%key(1), feature_base) > b%n) worst = max(worst, abs(gap - least))
      if (gap > least + 2*rho) beyond = beyond + 1
    end do
    call check_close(worst, 0.0_dp, 1.0e-12_dp, "the way between two pieces is the shortest")
    call check_equal(missed, 0, "no pair within the alert distance is missed")
    call check_equal(beyond, 0, "points of sides are not deeper than their corners make them")
  end subroutine test_random_pairs

  !> A random polygon of 3 to 9 corners on an ellipse.
  subroutine put_random(seed, x, placed)
    integer(i8), intent(in) :: seed
    real(dp), intent(in) :: x
    type(placed_piece_t), intent(out) :: placed
    type(flat_piece_t) :: made
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 9), centre(2), angle, width
    integer :: n, k

    n = 3 + int(6.99_dp*hash_uniform(1, seed, 1))
    width = 0.05_dp + 0.9_dp*hash_uniform(2, seed, 1)
    do k = 1, n
      angle = 2.0_dp*pi*(k + 0.4_dp*hash_uniform(3, seed, k))/n
      corners(1, k) = cos(angle)
      corners(2, k) = width*sin(angle)
    end do
    call polygon_piece(corners(:, 1:n), 0.001_dp, made, message)
    centre(1) = x
    centre(2) = 0.3_dp*hash_uniform(4, seed, 1)
    call place_piece(made%piece%vertex, made%piece%corner, rho, 1.0_dp, 2.0_dp*pi*hash_uniform(5, seed, 1), centre, placed)
  end subroutine put_random

  pure real(dp) function separation(a, b, normal)
    type(placed_piece_t), intent(in) :: a, b
    real(dp), intent(in) :: normal(2)
    real(dp) :: least, most
    integer :: k

    least = huge(1.0_dp)
    most = -huge(1.0_dp)
    do k = 1, a%n
      least = min(least, sum(a%vertex(:, k)*normal))
    end do
    do k = 1, b%n
      most = max(most, sum(b%vertex(:, k)*normal))
    end do
    separation = least - most
  end function separation

  !> The largest separation over many directions, less the roundings.
  pure real(dp) function best_separation(a, b) result(best)
    type(placed_piece_t), intent(in) :: a, b
    real(dp) :: normal(2)
    integer :: k

    best = -huge(1.0_dp)
    do k = 1, 3600
      normal(1) = cos(2.0_dp*pi*k/3600)
      normal(2) = sin(2.0_dp*pi*k/3600)
      best = max(best, separation(a, b, normal) - 2*rho)
    end do
  end function best_separation

end program test_polygon_pair
