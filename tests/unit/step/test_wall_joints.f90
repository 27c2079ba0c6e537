!> Joints of walls that several boundaries make: points at edges that lie in a hollow, and what a side keeps that leans there.
program test_wall_joints
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_manifold, only: manifold_t
  use gravier_surface_registry, only: make_surface
  use gravier_facet_contacts, only: keep_corners
  use gravier_wall_joints, only: is_in_joint, joints_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: tolerance = 1.0e-7_dp, slack = 1.0e-3_dp
  real(dp), parameter :: up(3) = [0.0_dp, 1.0_dp, 0.0_dp], leans(3) = [-0.6_dp, 0.8_dp, 0.0_dp]

  call test_segments()
  call test_walls_that_join()
  call test_rectangles()
  call test_corners_that_stay()
  call finish_checks()

contains

  !> A segment or a rectangle.
  subroutine put(kind, point, edge, boundary)
    character(len=*), intent(in) :: kind
    real(dp), intent(in) :: point(3), edge(3, 2)
    type(boundary_t), intent(out) :: boundary

    call make_surface(kind, boundary%surface)
    boundary%surface%point(:) = point
    boundary%surface%edge(:, :) = edge
    boundary%surface%axis(:) = up
  end subroutine put

  !> A segment that the second one goes on, upwards, downwards, level or elsewhere.
  subroutine test_segments()
    type(boundary_t) :: wall(3)
    real(dp) :: edge(3, 2), line(3, 2, 1), values(3, 2), beside(2)
    character(len=:), allocatable :: wrong, expected
    real(dp), parameter :: joint(2) = [1.0_dp, 0.0_dp], from(3) = [1.0_dp, 0.0_dp, 0.0_dp]

    edge(:, :) = 0.0_dp
    edge(1, 1) = 1.0_dp
    call put("segment", [0.0_dp, 0.0_dp, 0.0_dp], edge, wall(1))
    call put("segment", [0.0_dp, 5.0_dp, 0.0_dp], edge, wall(3))
    edge(2, 1) = 0.2_dp
    call put("segment", from, edge, wall(2))
    call check(is_in_joint(wall, 1, joint, up, tolerance, slack), "upwards")
    call check(.not. is_in_joint(wall, 1, joint, leans, tolerance, slack), "upwards, but not along the normal")
    call check(.not. is_in_joint(wall, 2, joint, up, tolerance, slack), "the level one does not hide the end of the other")
    beside(:) = joint - 1.0e-4_dp
    call check(.not. is_in_joint(wall, 1, beside, up, tolerance, slack), "not at the joint")
    wall(2)%present = .false.
    call check(.not. is_in_joint(wall, 1, joint, up, tolerance, slack), "taken away")
    edge(2, 1) = -0.2_dp
    call put("segment", from, edge, wall(2))
    call check(.not. is_in_joint(wall, 1, joint, up, tolerance, slack), "downwards")
    edge(2, 1) = 0.9_dp*slack
    call put("segment", from, edge, wall(2))
    call check(.not. is_in_joint(wall, 1, joint, up, tolerance, slack), "level but for the slack")
    call make_surface("mesh", wall(2)%surface)
    line(:, 1, 1) = from
    line(:, 2, 1) = from + [1.0_dp, 0.2_dp, 0.0_dp]
    values(:, 1) = 0.0_dp
    values(:, 2) = 1.0_dp
    call wall(2)%surface%set(values, wrong, expected)
    call wall(2)%surface%take_facets(line)
    call check(is_in_joint(wall, 1, joint, up, tolerance, slack), "a mesh upwards")
  end subroutine test_segments

  !> One boundary joins nothing, two that end may, and what is taken away or goes on for ever does not.
  subroutine test_walls_that_join()
    type(boundary_t) :: wall(2)
    type(joints_t) :: joints
    real(dp) :: edge(3, 2)

    edge(:, :) = 0.0_dp
    edge(1, 1) = 1.0_dp
    call put("segment", [0.0_dp, 0.0_dp, 0.0_dp], edge, wall(1))
    call joints%find(wall(1:1))
    call check(.not. (joints%exist .or. allocated(joints%reach)), "one segment")
    call put("segment", [1.0_dp, 0.0_dp, 0.0_dp], edge, wall(2))
    call joints%find(wall)
    call check(joints%exist, "two segments")
    call check_close(joints%middle(1, 1), 0.5_dp, 1.0e-15_dp, "middle of a segment")
    call check_close(joints%reach(1), 0.5_dp, 1.0e-15_dp, "half of its length")
    wall(2)%present = .false.
    call joints%find(wall)
    call check(.not. joints%exist, "one is taken away")
    wall(2)%present = .true.
    call make_surface("plane", wall(2)%surface)
    call joints%find(wall)
    call check(.not. joints%exist, "a segment and a plane")
    call put("segment", [1.0_dp, 0.0_dp, 0.0_dp], edge, wall(2))
    wall(2)%period(1) = 7.0_dp
    call joints%find(wall)
    call check(joints%reach(2) > 1.0e100_dp, "a segment in a period may be anywhere")
  end subroutine test_walls_that_join

  !> Both triangles of a rectangle rise from its edge.
  subroutine test_rectangles()
    type(boundary_t) :: wall(2)
    real(dp) :: edge(3, 2), place(3)
    integer :: k

    place(:) = [1.0_dp, 0.0_dp, 0.0_dp]
    edge(:, :) = 0.0_dp
    edge(1, 1) = 1.0_dp
    edge(3, 2) = 1.0_dp
    call put("rectangle", [0.0_dp, 0.0_dp, 0.0_dp], edge, wall(1))
    edge(2, 1) = 0.2_dp
    call put("rectangle", [1.0_dp, 0.0_dp, 0.0_dp], edge, wall(2))
    do k = 0, 4
      place(3) = 0.25_dp*k
      call check(is_in_joint(wall, 1, place, up, tolerance, slack), "along the edge")
    end do
    call check(.not. is_in_joint(wall, 1, [1.0_dp, 0.0_dp, 1.2_dp], up, tolerance, slack), "beyond the edge")
  end subroutine test_rectangles

  !> Points as deep as the deepest go, and those on other edges; a corner that is less deep, over the sheet, stays.
  subroutine test_corners_that_stay()
    type(manifold_t) :: manifold
    real(dp) :: square(3, 4)
    integer :: k

    square(:, :) = 0.0_dp
    square(1, 2:3) = 1.0_dp
    square(3, 3:4) = 1.0_dp
    manifold%n = 4
    manifold%normal(:) = up
    do k = 1, 4
      manifold%key(k) = 10*k
      manifold%gap(k) = 0.0_dp
    end do
    manifold%gap(3) = 0.1_dp
    manifold%gap(4) = 0.1_dp
    manifold%point(:, 1:4) = reshape([1.0_dp, 0.0_dp, 0.3_dp, 1.0_dp - 1.0e-5_dp, 1.0e-8_dp, 0.7_dp, 0.0_dp, 0.05_dp, 0.3_dp, &
      & 0.2_dp, 0.05_dp, 0.7_dp], [3, 4])
    call keep_corners(square, tolerance, slack, manifold)
    call check_equal(manifold%n, 1, "one corner stays")
    call check_equal(manifold%key(1), 40, "it is the one over the sheet")
    call check_close(manifold%gap(1), 0.1_dp, 0.0_dp, "its gap")
    call check_close(manifold%point(3, 1), 0.7_dp, 0.0_dp, "its place")
    manifold%n = 0
    call keep_corners(square, tolerance, slack, manifold)
    call check_equal(manifold%n, 0, "nothing")
    manifold%n = 2
    manifold%gap(1:2) = [0.1_dp, 0.0_dp]
    manifold%point(:, 1:2) = reshape([0.3_dp, 0.05_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp], [3, 2])
    call keep_corners(square(:, 1:2), tolerance, slack, manifold)
    call check_equal(manifold%n, 1, "of a segment only the ends are edges")
  end subroutine test_corners_that_stay

end program test_wall_joints
