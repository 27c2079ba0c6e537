!> Regions of means: the space that they take, the parts of balls, of segments and of points in their bins, also across a period.
program test_mean_region
  use gravier_kinds, only: dp
  use gravier_shape_library, only: body_shape_t
  use gravier_body_part, only: turned_body_t
  use gravier_simple_shapes, only: make_polygon
  use gravier_mean_region, only: mean_region_t, region_grid_t, share_list_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> parts of a disk and of a ball below a plane half a radius above the centre: 1/2 + (sqrt(3)/4 + pi/6)/pi, 27/32
  real(dp), parameter :: disk = 0.80449889052211463_dp, ball = 0.84375_dp
  !> a few roundings
  real(dp), parameter :: rounding = 4.0e-15_dp

  call test_space()
  call test_balls()
  call test_bins()
  call test_bodies()
  call test_periods()
  call test_points()
  call test_segments()
  call finish_checks()

contains

  !> A region in a scene from 0 to 1 along each axis.
  function grid_of(region, nd, period) result(grid)
    type(mean_region_t), intent(in) :: region
    integer, intent(in) :: nd
    !> along x
    real(dp), intent(in) :: period
    type(region_grid_t) :: grid
    real(dp) :: low(nd), high(nd), periods(nd)

    low(:) = 0.0_dp
    high(:) = 1.0_dp
    periods(:) = 0.0_dp
    periods(1) = period
    call region%make_grid(low, high, periods, .true., grid)
  end function grid_of

  !> The sum of the shares, all or of one bin.
  real(dp) function total(list, bin)
    type(share_list_t), intent(in) :: list
    integer, intent(in), optional :: bin
    integer :: k

    total = 0.0_dp
    do k = 1, list%n
      if (present(bin)) then
        if (list%bin(k) /= bin) cycle
      end if
      total = total + list%share(k)
    end do
  end function total

  real(dp) function ball_share(grid, x, radius, bin) result(share)
    type(region_grid_t), intent(in) :: grid
    real(dp), intent(in) :: x(:), radius
    integer, intent(in), optional :: bin
    type(share_list_t) :: list

    call grid%share_ball(x, radius, list)
    share = total(list, bin)
  end function ball_share

  real(dp) function body_share(shape, grid, x, bin) result(share)
    type(body_shape_t), intent(in) :: shape
    type(region_grid_t), intent(in) :: grid
    real(dp), intent(in) :: x(2)
    integer, intent(in), optional :: bin
    type(turned_body_t) :: body
    type(share_list_t) :: list

    call body%turn(shape, 2, shape%size, [0.0_dp])
    call grid%share_body(x, shape, body, list)
    share = total(list, bin)
  end function body_share

  real(dp) function segment_share(grid, from, to, bin) result(share)
    type(region_grid_t), intent(in) :: grid
    real(dp), intent(in) :: from(:), to(:)
    integer, intent(in), optional :: bin
    type(share_list_t) :: list

    call grid%share_segment(from, to, list)
    share = total(list, bin)
  end function segment_share

  !> Sides that a region does not have are those of the scene; bins share its volume.
  subroutine test_space()
    type(mean_region_t) :: region
    type(region_grid_t) :: grid

    grid = grid_of(region, 3, 0.0_dp)
    call check_close(grid%volume(1), 1.0_dp, 0.0_dp, "all of the scene")
    call check_equal(grid%n, 1, "in one")
    region%lower(2) = 0.25_dp
    region%upper(1) = 2.0_dp
    region%axis = 2
    region%bins = 3
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(grid%volume(1), 0.5_dp, rounding, "volume of a bin")
    call check_close(grid%side(0), 0.25_dp, 0.0_dp, "first side")
    call check_close(grid%side(1), 0.5_dp, rounding, "second side")
    call check_close(grid%side(3), 1.0_dp, 0.0_dp, "last side")
    call check_close(grid%upper(1), 2.0_dp, 0.0_dp, "a side beyond the scene")
    region%lower(2) = 3.0_dp
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(grid%volume(1), 0.0_dp, 0.0_dp, "no volume beyond the scene")
    call check_close(ball_share(grid, [0.5_dp, 0.5_dp], 0.1_dp), 0.0_dp, 0.0_dp, "nothing in it")
  end subroutine test_space

  !> Exact where one axis cuts, a product where several do, all of the ball where no side is.
  subroutine test_balls()
    type(mean_region_t) :: region, open_one
    type(region_grid_t) :: grid

    region%lower(2) = 0.5_dp
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(ball_share(grid, [0.3_dp, 0.45_dp], 0.1_dp), 1.0_dp - disk, rounding, "a disk above a side")
    call check_close(ball_share(grid, [0.0_dp, 0.55_dp], 0.1_dp), disk, rounding, "no side along x")
    call check_close(ball_share(grid, [0.3_dp, 0.61_dp], 0.1_dp), 1.0_dp, 0.0_dp, "a disk inside")
    call check_close(ball_share(grid, [0.3_dp, 0.39_dp], 0.1_dp), 0.0_dp, 0.0_dp, "a disk outside")
    grid = grid_of(region, 3, 0.0_dp)
    call check_close(ball_share(grid, [0.3_dp, 0.55_dp, 0.2_dp], 0.1_dp), ball, rounding, "a ball above a side")
    region%upper(3) = 0.9_dp
    grid = grid_of(region, 3, 0.0_dp)
    call check_close(ball_share(grid, [0.3_dp, 0.55_dp, 0.85_dp], 0.1_dp), ball**2, rounding, "a ball at an edge")
    call check_close(ball_share(grid, [0.3_dp, 0.5_dp, 0.9_dp], 0.1_dp), 0.25_dp, rounding, "a ball on an edge")
    grid = grid_of(open_one, 3, 0.0_dp)
    call check_close(ball_share(grid, [-7.0_dp, 0.5_dp, 9.0_dp], 0.1_dp), 1.0_dp, 0.0_dp, "no sides at all")
  end subroutine test_balls

  !> Bins together have what the region has, and a ball across several has its segments.
  subroutine test_bins()
    type(mean_region_t) :: region, whole
    type(region_grid_t) :: grid, one
    real(dp) :: x(2)
    integer :: k

    region%lower(1) = 0.1_dp
    region%upper(1) = 0.9_dp
    region%upper(2) = 0.8_dp
    whole = region
    region%axis = 1
    region%bins = 8
    grid = grid_of(region, 2, 0.0_dp)
    one = grid_of(whole, 2, 0.0_dp)
    call check_close(ball_share(grid, [0.45_dp, 0.4_dp], 0.1_dp, 3), 1.0_dp - disk, 10*rounding, "a segment in the third bin")
    call check_close(ball_share(grid, [0.45_dp, 0.4_dp], 0.1_dp, 4), 2*disk - 1.0_dp, 10*rounding, "the middle in the fourth")
    do k = 1, 40
      x(1) = k*0.027_dp
      x(2) = 0.83_dp - k*0.01_dp
      call check_close(ball_share(grid, x, 0.21_dp), ball_share(one, x, 0.21_dp), rounding, "bins have what the region has")
    end do
    ! the last bins reach as far as there are grains
    region%lower(1) = -1.0e30_dp
    region%upper(1) = 1.0e30_dp
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(ball_share(grid, [-0.3_dp, 0.4_dp], 0.1_dp, 1), 1.0_dp, 0.0_dp, "before the first bin")
    call check_close(ball_share(grid, [1.3_dp, 0.4_dp], 0.1_dp, 8), 1.0_dp, 0.0_dp, "behind the last bin")
  end subroutine test_bins

  !> A square body of side 0.2 is cut exactly by all sides at once, by bins, and across a period; the ball around it does not count.
  subroutine test_bodies()
    type(mean_region_t) :: region, binned
    type(region_grid_t) :: grid
    type(body_shape_t) :: shape
    character(len=:), allocatable :: message
    real(dp) :: corners(2, 4)

    corners(:, 1) = [-0.1_dp, -0.1_dp]
    corners(:, 2) = [0.1_dp, -0.1_dp]
    corners(:, 3) = [0.1_dp, 0.1_dp]
    corners(:, 4) = [-0.1_dp, 0.1_dp]
    call make_polygon("square", corners, 0.001_dp, shape, message)
    region%lower(1) = 0.0_dp
    region%upper(2) = 0.5_dp
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(body_share(shape, grid, [0.1_dp, 0.4_dp]), 1.0_dp, 10*rounding, "its sides lie on those of the region")
    call check_close(body_share(shape, grid, [0.05_dp, 0.45_dp]), 0.5625_dp, 10*rounding, "three quarters along both axes")
    call check_close(body_share(shape, grid, [-0.11_dp, 0.3_dp]), 0.0_dp, 10*rounding, "outside, where its ball is not")
    binned%axis = 1
    binned%bins = 10
    binned%upper(2) = 0.5_dp
    grid = grid_of(binned, 2, 0.0_dp)
    call check_close(body_share(shape, grid, [0.45_dp, 0.45_dp], 4), 0.1875_dp, 10*rounding, "the first of its bins")
    call check_close(body_share(shape, grid, [0.45_dp, 0.45_dp], 5), 0.375_dp, 10*rounding, "the second")
    call check_close(body_share(shape, grid, [0.45_dp, 0.45_dp]), 0.75_dp, 10*rounding, "all bins")
    call check_close(body_share(shape, grid, [-0.3_dp, 0.3_dp], 1), 1.0_dp, 10*rounding, "before the first bin")
    grid = grid_of(binned, 2, 1.0_dp)
    call check_close(body_share(shape, grid, [0.05_dp, 0.3_dp], 10), 0.25_dp, 10*rounding, "across the period")
    call check_close(body_share(shape, grid, [0.05_dp, 0.3_dp]), 1.0_dp, 10*rounding, "all bins of the period")
  end subroutine test_bodies

  !> Regions repeat themselves with the cell; a whole period has no sides.
  subroutine test_periods()
    type(mean_region_t) :: region, binned
    type(region_grid_t) :: grid

    region%upper(1) = 0.5_dp
    grid = grid_of(region, 2, 1.0_dp)
    call check_close(grid%volume(1), 0.5_dp, 0.0_dp, "half of the cell")
    call check_close(ball_share(grid, [0.95_dp, 0.4_dp], 0.1_dp), 1.0_dp - disk, rounding, "from across the period")
    call check_close(ball_share(grid, [0.0_dp, 0.4_dp], 0.1_dp), 0.5_dp, rounding, "at its origin")
    call check_close(segment_share(grid, [0.45_dp, 0.4_dp], [0.6_dp, 0.4_dp]), 1.0_dp/3.0_dp, rounding, "a branch leaves")
    call check_close(segment_share(grid, [0.9_dp, 0.4_dp], [1.05_dp, 0.4_dp]), 1.0_dp/3.0_dp, 10*rounding, &
      & "a branch crosses the period")
    region%lower(1) = 0.8_dp
    region%upper(1) = 1.2_dp
    grid = grid_of(region, 2, 1.0_dp)
    call check_close(ball_share(grid, [0.1_dp, 0.4_dp], 0.05_dp), 1.0_dp, 0.0_dp, "a region across the period")
    call check_close(ball_share(grid, [0.9_dp, 0.4_dp], 0.05_dp), 1.0_dp, 0.0_dp, "its other side")
    call check_equal(grid%bin_of([0.1_dp, 0.4_dp]), 1, "a point across the period")
    call check_equal(grid%bin_of([0.3_dp, 0.4_dp]), 0, "a point outside")
    region%lower(1) = 0.3_dp
    region%upper(1) = 1.3_dp
    grid = grid_of(region, 2, 1.0_dp)
    call check_close(ball_share(grid, [0.3_dp, 0.4_dp], 0.1_dp), 1.0_dp, 0.0_dp, "a whole period")
    binned%axis = 1
    binned%bins = 4
    grid = grid_of(binned, 2, 1.0_dp)
    call check_close(ball_share(grid, [0.0_dp, 0.4_dp], 0.1_dp, 4), 0.5_dp, rounding, "a disk at the origin, last bin")
    call check_close(ball_share(grid, [1.0_dp, 0.4_dp], 0.1_dp, 1), 0.5_dp, rounding, "a disk at the end, first bin")
    call check_close(ball_share(grid, [0.9_dp, 0.4_dp], 0.3_dp), 1.0_dp, rounding, "all bins have all of it")
    call check_equal(grid%bin_of([-0.1_dp, 0.4_dp]), 4, "a point before the cell")
    ! 0.7 less a period is below -0.3 by rounding
    binned%lower(1) = -0.3_dp
    binned%upper(1) = 0.2_dp
    grid = grid_of(binned, 2, 1.0_dp)
    call check(grid%bin_of([0.7_dp, 0.4_dp]) > 0, "a point on the lower side, a period on")
  end subroutine test_periods

  !> Lower sides belong to a bin.
  subroutine test_points()
    type(mean_region_t) :: region
    type(region_grid_t) :: grid
    real(dp) :: x(3)
    integer :: k

    region%lower(:) = [0.1_dp, 0.2_dp, 0.3_dp]
    region%upper(:) = [0.8_dp, 0.9_dp, 0.6_dp]
    region%axis = 1
    region%bins = 7
    grid = grid_of(region, 3, 0.0_dp)
    x(:) = [0.0_dp, 0.2_dp, 0.3_dp]
    do k = 1, 7
      x(1) = grid%side(k - 1)
      call check_equal(grid%bin_of(x), k, "on its lower side")
      x(1) = grid%side(k) - 1.0e-15_dp
      call check_equal(grid%bin_of(x), k, "below its upper side")
    end do
    call check_equal(grid%bin_of([0.8_dp, 0.5_dp, 0.5_dp]), 0, "on the upper side along x")
    call check_equal(grid%bin_of([0.5_dp, 0.9_dp, 0.5_dp]), 0, "on the upper side along y")
    call check_equal(grid%bin_of([0.5_dp, 0.5_dp, 0.29_dp]), 0, "below along z")
  end subroutine test_points

  !> Parts of branches by the sides of all axes at once.
  subroutine test_segments()
    type(mean_region_t) :: region
    type(region_grid_t) :: grid

    region%lower(:) = [0.2_dp, 0.2_dp, 0.0_dp]
    region%upper(:) = [0.6_dp, 0.6_dp, 0.0_dp]
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(segment_share(grid, [0.3_dp, 0.3_dp], [0.5_dp, 0.4_dp]), 1.0_dp, rounding, "inside")
    call check_close(segment_share(grid, [0.1_dp, 0.1_dp], [0.5_dp, 0.5_dp]), 0.75_dp, rounding, "into the corner")
    call check_close(segment_share(grid, [0.5_dp, 0.5_dp], [0.1_dp, 0.1_dp]), 0.75_dp, rounding, "the other way")
    ! x is inside from 1/4 on, y up to 1/2
    call check_close(segment_share(grid, [0.1_dp, 0.4_dp], [0.5_dp, 0.8_dp]), 0.25_dp, rounding, "through two sides")
    call check_close(segment_share(grid, [0.0_dp, 0.4_dp], [0.4_dp, 0.8_dp]), 0.0_dp, rounding, "past the corner")
    call check_close(segment_share(grid, [0.3_dp, 0.2_dp], [0.4_dp, 0.2_dp]), 1.0_dp, rounding, "along the lower side")
    call check_close(segment_share(grid, [0.3_dp, 0.6_dp], [0.4_dp, 0.6_dp]), 0.0_dp, rounding, "along the upper side")
    region%axis = 2
    region%bins = 4
    grid = grid_of(region, 2, 0.0_dp)
    call check_close(segment_share(grid, [0.3_dp, 0.25_dp], [0.3_dp, 0.45_dp], 1), 0.25_dp, rounding*10, "first bin")
    call check_close(segment_share(grid, [0.3_dp, 0.25_dp], [0.3_dp, 0.45_dp], 2), 0.5_dp, rounding*10, "second bin")
    call check_close(segment_share(grid, [0.3_dp, 0.45_dp], [0.3_dp, 0.25_dp], 3), 0.25_dp, rounding*10, "third bin")
    call check_close(segment_share(grid, [0.1_dp, 0.1_dp], [0.5_dp, 0.5_dp]), 0.75_dp, rounding*10, "bins have what the region has")
    call check(all(grid%side >= 0.2_dp), "bins are in the region")
  end subroutine test_segments

end program test_mean_region
