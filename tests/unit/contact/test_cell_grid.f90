!> Grids of cells: what covers what, clamping, numbering, limits.
program test_cell_grid
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_cell_grid, only: cell_grid_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_counts()
  call test_limits()
  call test_numbering()
  call test_clamping()
  call test_random_points(2)
  call test_random_points(3)
  call test_reuse()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A box of 2.5 by 1 edges: cells 0 to 2 and 0 to 1, since the upper corner lies in the box.
  subroutine test_counts()
    type(cell_grid_t) :: grid

    call grid%init([1.0_dp, -1.0_dp], [2.25_dp, -0.5_dp], 0.5_dp, 1000_i8)
    call check(all(grid%n == [3, 2, 1]), "cells along the axes")
    call check_equal(grid%cells(), 6, "cells")
    call check_equal(grid%nd, 2, "dimension")
    call check_close(grid%edge, 0.5_dp, 0.0_dp, "edge")
    call grid%init([1.0_dp, 1.0_dp, 1.0_dp], [1.0_dp, 1.0_dp, 1.0_dp], 0.5_dp, 1000_i8)
    call check_equal(grid%cells(), 1, "a point has one cell")
  end subroutine test_counts

  !> 10 x 10 x 10 cells: the limit doubles the edge until the cells fit, to 5 x 5 x 5, 3 x 3 x 3, 2 x 2 x 2, 1.
  subroutine test_limits()
    call check_limit(1000_i8, 10)
    call check_limit(999_i8, 5)
    call check_limit(125_i8, 5)
    call check_limit(124_i8, 3)
    call check_limit(26_i8, 2)
    call check_limit(7_i8, 1)
    call check_limit(1_i8, 1)
    call check_limit(0_i8, 1)
    call check_limit(-5_i8, 1)
    call test_huge_box()
  end subroutine test_limits

  subroutine check_limit(limit, n)
    integer(i8), intent(in) :: limit
    integer, intent(in) :: n
    type(cell_grid_t) :: grid
    real(dp), parameter :: lower(3) = 0.0_dp, upper(3) = 9.5_dp

    call grid%init(lower, upper, 1.0_dp, limit)
    call check(all(grid%n == n), "cells within the limit")
    call check(grid%edge >= 1.0_dp, "an edge no smaller than asked for")
  end subroutine check_limit

  !> 1e30 cells would be wanted: the counts must not overflow on the way.
  subroutine test_huge_box()
    type(cell_grid_t) :: grid

    call grid%init([-1.0e10_dp, 0.0_dp, 0.0_dp], [1.0e10_dp, 1.0e10_dp, 1.0e10_dp], 1.0_dp, int(huge(1), i8) - 1)
    call check(product(real(grid%n, dp)) < real(huge(1), dp), "cells of a huge box")
    call check(grid%cells() > 100000000, "as many cells as the limit allows")
    call check_equal(number_at(grid, [1.0e10_dp, 1.0e10_dp, 1.0e10_dp]), grid%cells(), "upper corner of a huge box")
    call check_equal(number_at(grid, [-1.0e10_dp, 0.0_dp, 0.0_dp]), 1, "lower corner of a huge box")
  end subroutine test_huge_box

  !> Numbers from 1, the first axis fastest, the last slowest.
  subroutine test_numbering()
    type(cell_grid_t) :: grid
    integer :: x, y, z, expected, place(3)
    logical :: right

    call grid%init([0.0_dp, 0.0_dp, 0.0_dp], [3.5_dp, 2.5_dp, 4.5_dp], 1.0_dp, 1000_i8)
    call check(all(grid%n == [4, 3, 5]), "cells in space")
    expected = 0
    right = .true.
    do z = 0, 4
      do y = 0, 2
        do x = 0, 3
          expected = expected + 1
          place(1) = x
          place(2) = y
          place(3) = z
          right = right .and. grid%flat(place) == expected
        end do
      end do
    end do
    call check(right, "numbers of the cells")
    call check_equal(number_at(grid, [2.5_dp, 1.5_dp, 3.5_dp]), 1 + 2 + 4*(1 + 3*3), "number at a point")
    ! a point on a face belongs to the upper cell
    call check_equal(number_at(grid, [2.0_dp, 1.0_dp, 3.0_dp]), 1 + 2 + 4*(1 + 3*3), "number at a corner")
  end subroutine test_numbering

  !> Points outside belong to the nearest cell of the border, however far.
  subroutine test_clamping()
    type(cell_grid_t) :: grid

    call grid%init([0.0_dp, 0.0_dp], [3.5_dp, 2.5_dp], 1.0_dp, 1000_i8)
    call check_equal(number_at(grid, [-0.1_dp, 1.5_dp]), 1 + 4, "left")
    call check_equal(number_at(grid, [-1.0e300_dp, 1.5_dp]), 1 + 4, "far left")
    call check_equal(number_at(grid, [4.1_dp, 1.5_dp]), 4 + 4, "right")
    call check_equal(number_at(grid, [1.0e300_dp, -1.0e300_dp]), 4, "far right below")
    call check_equal(number_at(grid, [1.5_dp, 3.1_dp]), 2 + 8, "above")
    call check_equal(number_at(grid, [1.5_dp, -huge(1.0_dp)]), 2, "below")
  end subroutine test_clamping

  !> Points of the box lie in the cell that their place says; two points no farther apart than an edge lie in cells that
  !> touch: what detection relies on.
  subroutine test_random_points(nd)
    integer, intent(in) :: nd
    type(cell_grid_t) :: grid
    real(dp) :: lower(nd), upper(nd), point(nd), other(nd), direction(nd), slack
    integer :: k, d, place(3), near(3)
    logical :: inside, touch

    do d = 1, nd
      lower(d) = -3.7_dp*d
      upper(d) = 5.3_dp + d
    end do
    call grid%init(lower, upper, 0.37_dp, 20000_i8)
    inside = .true.
    touch = .true.
    ! roundings of coordinates below 30 in units of the edge
    slack = 30*4*epsilon(1.0_dp)/grid%edge
    do k = 1, 3000
      do d = 1, nd
        point(d) = lower(d) + (upper(d) - lower(d))*hash_uniform(1, int(k, i8), d)
        direction(d) = hash_uniform(2, int(k, i8), d) - 0.5_dp
      end do
      other(:) = point + direction/norm2(direction)*grid%edge*hash_uniform(3, int(k, i8), 1)**0.1_dp
      call grid%locate(point, place)
      call grid%locate(other, near)
      inside = inside .and. all(place >= 0) .and. all(place < grid%n) .and. number_at(grid, point) == grid%flat(place)
      do d = 1, nd
        inside = inside .and. (point(d) - lower(d))/grid%edge >= place(d) - slack
        inside = inside .and. (point(d) - lower(d))/grid%edge <= place(d) + 1 + slack
      end do
      touch = touch .and. all(abs(place - near) <= 1)
    end do
    call check(inside, "a point lies in its cell")
    call check(touch, "points within an edge lie in cells that touch")
  end subroutine test_random_points

  !> A grid that was one in space is one in the plane again.
  subroutine test_reuse()
    type(cell_grid_t) :: grid

    call grid%init([0.0_dp, 0.0_dp, 0.0_dp], [3.5_dp, 2.5_dp, 4.5_dp], 1.0_dp, 1000_i8)
    call grid%init([0.0_dp, 0.0_dp], [1.5_dp, 1.5_dp], 1.0_dp, 1000_i8)
    call check(all(grid%n == [2, 2, 1]) .and. grid%cells() == 4, "a grid made anew")
    call check_close(grid%origin(3), 0.0_dp, 0.0_dp, "origin made anew")
  end subroutine test_reuse

  !> Number of the cell of a point.
  integer function number_at(grid, point) result(number)
    type(cell_grid_t), intent(in) :: grid
    real(dp), intent(in) :: point(:)
    integer :: place(3)

    call grid%locate(point, place)
    number = grid%flat(place)
  end function number_at

end program test_cell_grid
