!> Points of a contact: those that are one, those that are kept, their order.
program test_contact_patch
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_contact_feature, only: frame_t
  use gravier_contact_patch, only: patch_point_t, add_point, leave_corners, fill_manifold
  use gravier_manifold, only: manifold_t, most_points
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(frame_t), parameter :: frame = frame_t([1.0_dp, 2.0_dp, 3.0_dp], [0.0_dp, 0.0_dp, 1.0_dp], [1.0_dp, 0.0_dp, 0.0_dp], &
    & [0.0_dp, 1.0_dp, 0.0_dp])
  real(dp), parameter :: alert = 0.1_dp
  type(patch_point_t) :: points(2*most_points)
  integer :: n

  call MPI_Init()
  call test_order()
  call test_one_place()
  call test_four()
  call test_many()
  call test_corners()
  call finish_checks()
  call MPI_Finalize()

contains

  !> The patch of two equal squares, of which one is turned a little: corners, and points at the middle of the sides that stick out.
  subroutine test_corners()
    integer :: k

    call make_octagon(1.0e-3_dp)
    call leave_corners(3.0e-3_dp, 4, n, points)
    call check_equal(n, 4, "corners of a square")
    do k = 1, n
      call check_equal(points(k)%key, 2*k, "in their order")
    end do
    call make_octagon(1.0e-3_dp)
    call leave_corners(3.0e-3_dp, 6, n, points)
    call check_equal(n, 6, "as many as the simpler face has")
    call make_octagon(1.0e-2_dp)
    call leave_corners(3.0e-3_dp, 4, n, points)
    call check_equal(n, 8, "corners of an octagon")
    n = 2
    call leave_corners(3.0e-3_dp, 1, n, points)
    call check_equal(n, 2, "both ends of an edge")
  end subroutine test_corners

  !> Corners of a square of half width 1 with even keys, and middles of its sides that are farther out with odd ones.
  subroutine make_octagon(out)
    real(dp), intent(in) :: out

    n = 0
    call add(1.0_dp + out, 0.0_dp, 0.0_dp, 1)
    call add(1.0_dp, 1.0_dp, 0.0_dp, 2)
    call add(0.0_dp, 1.0_dp + out, 0.0_dp, 3)
    call add(-1.0_dp, 1.0_dp, 0.0_dp, 4)
    call add(-1.0_dp - out, 0.0_dp, 0.0_dp, 5)
    call add(-1.0_dp, -1.0_dp, 0.0_dp, 6)
    call add(0.0_dp, -1.0_dp - out, 0.0_dp, 7)
    call add(1.0_dp, -1.0_dp, 0.0_dp, 8)
  end subroutine make_octagon

  subroutine add(x, y, gap, key)
    real(dp), intent(in) :: x, y, gap
    integer, intent(in) :: key
    type(patch_point_t) :: new

    new%place(1) = x
    new%place(2) = y
    new%place(3) = 0.0_dp
    new%gap = gap
    new%key = key
    call add_point(new, alert, 1.0_dp, n, points)
  end subroutine add

  !> Ascending keys, places in the frame; what is at the alert distance is left out.
  subroutine test_order()
    type(manifold_t) :: manifold

    n = 0
    call add(0.0_dp, 0.0_dp, 0.05_dp, 7)
    call add(1.0_dp, 0.0_dp, 0.1_dp, 5)
    call add(0.0_dp, 1.0_dp, -0.02_dp, 3)
    call fill_manifold(frame, 1.0_dp, 1.0e-5_dp, 4, n, points, manifold)
    call check_equal(manifold%n, 2, "points below the alert distance")
    call check_equal(manifold%key(1), 3, "lowest key first")
    call check_equal(manifold%key(2), 7, "highest key last")
    call check_close(manifold%point(2, 1), 3.0_dp, 0.0_dp, "a place in the frame")
    call check_close(manifold%gap(1), -0.02_dp, 0.0_dp, "a gap")
  end subroutine test_order

  !> Points at one place are one, with the lower key but never with that of a third.
  subroutine test_one_place()
    n = 0
    call add(0.0_dp, 0.0_dp, 0.0_dp, 5)
    call add(1.0e-6_dp, 0.0_dp, -0.01_dp, 4)
    call check_equal(n, 1, "two points at one place")
    call check_equal(points(1)%key, 4, "two points at one place: key")
    call check_close(points(1)%gap, -0.01_dp, 0.0_dp, "two points at one place: gap")
    call add(1.0_dp, 0.0_dp, 0.0_dp, 3)
    call add(0.0_dp, 0.0_dp, 0.0_dp, 3)
    call check_equal(n, 2, "a key that another place has")
    call check(points(1)%key /= points(2)%key, "keys of two places differ")
    call add(0.0_dp, 1.0e-4_dp, 0.0_dp, 9)
    call check_equal(n, 3, "points beside each other")
  end subroutine test_one_place

  !> The deepest, and the corners of the largest quadrilateral.
  subroutine test_four()
    type(manifold_t) :: manifold

    n = 0
    call add(0.5_dp, 0.5_dp, 0.0_dp, 1)
    call add(0.0_dp, 0.0_dp, 0.0_dp, 6)
    call add(1.0_dp, 0.0_dp, 0.0_dp, 5)
    call add(0.4_dp, 0.6_dp, 0.0_dp, 2)
    call add(1.0_dp, 1.0_dp, -1.0e-3_dp, 4)
    call add(0.0_dp, 1.0_dp, 1.0e-9_dp, 3)
    call fill_manifold(frame, 1.0_dp, 1.0e-5_dp, 4, n, points, manifold)
    call check_equal(manifold%n, 4, "four of six points")
    call check(all(manifold%key(1:4) == [3, 4, 5, 6]), "four of six points: the corners")
  end subroutine test_four

  !> More than a manifold holds: those crowded go, the deepest stays.
  subroutine test_many()
    type(manifold_t) :: manifold
    integer :: k

    n = 0
    do k = 1, most_points
      call add(real(k, dp), 0.0_dp, 0.0_dp, k)
    end do
    do k = 1, 4
      call add(5.0_dp + 0.1_dp*k, 0.0_dp, merge(-0.01_dp, 0.0_dp, k == 3), most_points + k)
    end do
    call fill_manifold(frame, 1.0_dp, 1.0e-5_dp, most_points, n, points, manifold)
    call check_equal(manifold%n, most_points, "as many points as a manifold holds")
    call check_close(minval(manifold%gap), -0.01_dp, 0.0_dp, "the deepest of many stays")
    call check(all(manifold%key(2:) > manifold%key(:most_points - 1)), "ascending keys of many")
  end subroutine test_many

end program test_contact_patch
