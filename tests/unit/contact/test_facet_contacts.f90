!> Contacts of pieces with walls of facets: a flat wall is one, sides that stick out turn the normal, hollows have several contacts;
!> and how often pairs stand in a list for that.
program test_facet_contacts
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_facet, only: near_facets_t
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: core_distance_t
  use gravier_simple_shapes, only: make_polyhedron
  use gravier_shape_library, only: body_shape_t, shape_library_t, point_counts_t
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_plane_manifold
  use gravier_polyhedron_pair, only: find_halfspace_manifold
  use gravier_manifold, only: manifold_t
  use gravier_facet_candidates, only: facet_candidate_t, facet_candidates_t, tolerance_for
  use gravier_flat_patch, only: make_facet_piece, set_facet_piece, lies_flat
  use gravier_facet_rims, only: extend_rims, extend_edge, is_on_wall
  use gravier_facet_contacts, only: facet_contacts_t, find_ball_contacts, find_polygon_contacts, find_polyhedron_contacts
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_surface_registry, only: make_surface
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_neighbour_rule, only: neighbour_rule_t
  use gravier_pair_places, only: has_facets, repeat_pairs
  use gravier_errors, only: error_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: up(3) = [0.0_dp, 0.0_dp, 1.0_dp]
  integer(i8) :: drawn = 0

  call test_candidates()
  call test_flat_wall()
  call test_ridge()
  call test_valley()
  call test_hole()
  call test_gap_in_file()
  call test_facet_piece()
  call test_rims()
  call test_box_on_floor()
  call test_box_along_floor()
  call test_box_in_corner()
  call test_box_over_edge()
  call test_square_on_line()
  call test_places()
  call finish_checks()

contains

  real(dp) function random()
    drawn = drawn + 1
    random = 2.0_dp*hash_uniform(11, drawn, 1) - 1.0_dp
  end function random

  pure subroutine set(v, x, y, z)
    real(dp), intent(out) :: v(3)
    real(dp), intent(in) :: x, y, z

    v(1) = x
    v(2) = y
    v(3) = z
  end subroutine set

  !> A segment of the plane.
  subroutine add_line(number, x, y, near)
    integer, intent(in) :: number
    !> of both ends
    real(dp), intent(in) :: x(2), y(2)
    type(near_facets_t), intent(inout) :: near
    real(dp) :: line(3, 2)

    line(1, :) = x
    line(2, :) = y
    line(3, :) = 0.0_dp
    call near%add(number, line)
  end subroutine add_line

  !> Triangles of a square of half width `half` about a point, cut into m x m pieces whose inner corners are moved at random.
  subroutine add_floor(near, m, half, centre, first, second)
    type(near_facets_t), intent(inout) :: near
    integer, intent(in) :: m
    real(dp), intent(in) :: half, centre(3), first(3), second(3)
    real(dp) :: p(3, 0:m, 0:m), u, v, corner(3, 3)
    integer :: i, j

    do j = 0, m
      do i = 0, m
        u = 2.0_dp*i/m - 1.0_dp
        v = 2.0_dp*j/m - 1.0_dp
        if (i > 0 .and. i < m .and. j > 0 .and. j < m) then
          u = u + 0.5_dp*random()/m
          v = v + 0.5_dp*random()/m
        end if
        p(:, i, j) = centre + half*(u*first + v*second)
      end do
    end do
    do j = 1, m
      do i = 1, m
        corner(:, 1) = p(:, i - 1, j - 1)
        corner(:, 2) = p(:, i, j - 1)
        corner(:, 3) = p(:, i, j)
        call near%add(near%n + 1, corner)
        corner(:, 2) = p(:, i - 1, j)
        call near%add(near%n + 1, corner)
      end do
    end do
    near%tolerance = 1.0e-7_dp*half
  end subroutine add_floor

  !> Order by distance, facets along the plane of contact first where distances are equal, then by number.
  subroutine test_candidates()
    type(facet_candidates_t) :: candidates
    type(near_facets_t) :: near

    call add_floor(near, 2, 1.0_dp, [0.0_dp, 0.0_dp, 0.0_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    call candidates%clear(4)
    call candidates%add(facet_candidate_t(place=1, distance=0.3_dp))
    call candidates%add(facet_candidate_t(place=2, distance=0.1_dp))
    call candidates%add(facet_candidate_t(place=4, distance=0.1_dp, lies_along=.true.))
    call candidates%add(facet_candidate_t(place=3, distance=0.1_dp, lies_along=.true.))
    call candidates%sort(near, 1.0_dp)
    call check(all(candidates%order(1:4) == [4, 3, 2, 1]), "order of candidates")
    call candidates%drop_repeated(1.0_dp)
    call check_equal(count(candidates%item(1:4)%dropped), 3, "candidates at one place are one")
    call candidates%clear(2)
    call check_equal(candidates%n, 0, "forgotten")
    near%tolerance = 1.0e-2_dp
    call check_close(tolerance_for(near, 1.0_dp), 1.0e-3_dp, 1.0e-18_dp, "a tolerance is small against the rounding")
    call check_close(tolerance_for(near, 100.0_dp), 1.0e-2_dp, 0.0_dp, "and at most that of the file")
  end subroutine test_candidates

  !> A ball on a flat wall has one contact, wherever it is and however the wall is cut.
  subroutine test_flat_wall()
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp) :: centre(3), normal(3), worst
    integer :: k, m, several
    logical :: one

    several = 0
    worst = 0.0_dp
    do m = 1, 7, 2
      near%n = 0
      call add_floor(near, m, 1.0_dp, [0.0_dp, 0.0_dp, 0.0_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
      do k = 1, 300
        call set(centre, 0.9_dp*random(), 0.9_dp*random(), sign(0.21_dp, random()))
        ! over sides and corners too
        if (k > 100) centre(1:2) = near%corner(1:2, 1, 1 + mod(k, near%n))
        if (k > 200) centre(1:2) = 0.5_dp*(centre(1:2) + near%corner(1:2, 3, 1 + mod(k, near%n)))
        call find_ball_contacts(centre, 0.2_dp, near, 0.15_dp, found)
        one = found%n == 1
        if (.not. one) several = several + 1
        if (.not. one) cycle
        call set(normal, 0.0_dp, 0.0_dp, sign(1.0_dp, centre(3)))
        worst = max(worst, abs(found%manifold(1)%gap(1) - 0.01_dp), maxval(abs(found%manifold(1)%normal - normal)), &
          & maxval(abs(found%manifold(1)%point(1:2, 1) - centre(1:2))), abs(found%manifold(1)%point(3, 1) - 0.005_dp*normal(3)))
      end do
    end do
    call check_equal(several, 0, "one contact")
    call check_close(worst, 0.0_dp, 1.0e-14_dp, "that with the plane")
  end subroutine test_flat_wall

  !> Two halves of a roof whose ridge is the y axis; each falls or rises by `slope` from there.
  subroutine make_roof(slope, near)
    real(dp), intent(in) :: slope
    type(near_facets_t), intent(out) :: near
    real(dp) :: width, centre(3), first(3)

    width = sqrt(1.0_dp + slope**2)
    call set(centre, 1.0_dp, 0.0_dp, slope)
    call set(first, 1.0_dp/width, 0.0_dp, slope/width)
    call add_floor(near, 3, width, centre, first, [0.0_dp, 1.0_dp, 0.0_dp])
    centre(1) = -centre(1)
    first(1) = -first(1)
    call add_floor(near, 3, width, centre, first, [0.0_dp, 1.0_dp, 0.0_dp])
  end subroutine make_roof

  !> Over a ridge there is one contact, whose normal turns with the place.
  subroutine test_ridge()
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp) :: angle, side, normal(3), centre(3)
    integer :: k

    call make_roof(-0.5_dp, near)
    do k = -40, 40
      angle = 0.02_dp*k
      side = sign(1.0_dp, angle)
      call set(normal, sin(angle), 0.0_dp, cos(angle))
      ! of the slopes
      if (abs(angle) > atan(0.5_dp)) call set(normal, 0.5_dp*side/sqrt(1.25_dp), 0.0_dp, 1.0_dp/sqrt(1.25_dp))
      centre(:) = 0.205_dp*normal
      centre(2) = 0.013_dp*k
      ! down a slope
      if (abs(angle) > atan(0.5_dp)) centre(1) = centre(1) + 0.1_dp*side
      if (abs(angle) > atan(0.5_dp)) centre(3) = centre(3) - 0.05_dp
      call find_ball_contacts(centre, 0.2_dp, near, 0.02_dp, found)
      call check_equal(found%n, 1, "one contact at a ridge")
      if (found%n /= 1) cycle
      call check_close(maxval(abs(found%manifold(1)%normal - normal)), 0.0_dp, 1.0e-13_dp, "normal at a ridge")
      call check_close(found%manifold(1)%gap(1), 0.005_dp, 1.0e-14_dp, "gap at a ridge")
    end do
  end subroutine test_ridge

  !> In a valley there are two contacts, and none with its bottom.
  subroutine test_valley()
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp) :: centre(3)
    integer :: k

    call make_roof(0.5_dp, near)
    do k = -5, 5
      call set(centre, 0.0_dp, 0.1_dp*k, 0.2_dp*sqrt(1.25_dp))
      call find_ball_contacts(centre, 0.2_dp, near, 0.05_dp, found)
      call check_equal(found%n, 2, "two contacts in a valley")
      call check_close(maxval(abs(found%manifold(1:2)%gap(1))), 0.0_dp, 1.0e-14_dp, "both close")
      call check_close(sum(found%manifold(1:2)%normal(1)), 0.0_dp, 1.0e-14_dp, "from both sides")
    end do
    ! an angle that rounding of a file could make
    call make_roof(1.0e-8_dp, near)
    call find_ball_contacts([0.0_dp, 0.02_dp, 0.2_dp], 0.2_dp, near, 0.05_dp, found)
    call check_equal(found%n, 1, "a valley that is none")
  end subroutine test_valley

  !> A ball in a square hole of a floor touches its four sides.
  subroutine test_hole()
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    integer :: i, j
    real(dp) :: centre(3)
    real(dp), parameter :: half = 0.1_dp

    do j = -1, 1
      do i = -1, 1
        if (i == 0 .and. j == 0) cycle
        call set(centre, 2*half*i, 2*half*j, 0.0_dp)
        call add_floor(near, 1, half, centre, [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
      end do
    end do
    call find_ball_contacts([0.0_dp, 0.0_dp, sqrt(0.15_dp**2 - half**2)], 0.15_dp, near, 0.01_dp, found)
    call check_equal(found%n, 4, "the sides of a hole")
    call check_close(maxval(abs(found%manifold(1:4)%gap(1))), 0.0_dp, 1.0e-15_dp, "all close")
    ! at a corner that sticks out
    near%n = 0
    call add_floor(near, 1, half, [half, half, 0.0_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    call find_ball_contacts([-0.1_dp, -0.1_dp, 0.1_dp], 0.17_dp, near, 0.01_dp, found)
    call check_equal(found%n, 1, "a corner of a sheet")
    call check_close(maxval(abs(abs(found%manifold(1)%normal) - 1.0_dp/sqrt(3.0_dp))), 0.0_dp, 1.0e-15_dp, "its normal")
  end subroutine test_hole

  !> Facets that do not quite meet, as in files of single precision, make no contacts of their own and let nothing through.
  subroutine test_gap_in_file()
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    integer :: k, c
    real(dp) :: worst, shift(3)

    call add_floor(near, 5, 1.0_dp, [0.0_dp, 0.0_dp, 0.0_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    do k = 1, near%n
      do c = 1, 3
        call set(shift, random(), random(), random())
        near%corner(:, c, k) = near%corner(:, c, k) + 3.0e-8_dp*shift
      end do
    end do
    worst = 0.0_dp
    do k = 1, 300
      call set(shift, 0.9_dp*random(), 0.9_dp*random(), 0.2_dp)
      call find_ball_contacts(shift, 0.2_dp, near, 0.02_dp, found)
      call check(found%n >= 1, "something carries the ball")
      if (found%n > 0) worst = max(worst, abs(found%manifold(1)%gap(1)), maxval(abs(found%manifold(1)%normal - up)))
    end do
    call check_close(worst, 0.0_dp, 1.0e-6_dp, "the floor does")
  end subroutine test_gap_in_file

  !> Of a wall in the shape of an L the rim x = 0 is cut at y = -2 and y = -1 and ends at y = 0, where the wall goes on beyond it.
  subroutine test_rims()
    type(near_facets_t) :: near
    type(convex_piece_t) :: sheet
    real(dp), parameter :: corners(2, 3, 5) = reshape([0.0_dp, -3.0_dp, 3.0_dp, -3.0_dp, 0.0_dp, -2.0_dp, &
      & 0.0_dp, -2.0_dp, 3.0_dp, -3.0_dp, 0.0_dp, -1.0_dp, 0.0_dp, -1.0_dp, 3.0_dp, -3.0_dp, 0.0_dp, 0.0_dp, &
      & 0.0_dp, 0.0_dp, 3.0_dp, -3.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 2.0_dp, -2.0_dp, 0.0_dp], [2, 3, 5])
    real(dp) :: corner(3, 3)
    integer :: k

    near%n = 0
    do k = 1, 5
      corner(1:2, :) = corners(:, :, k)
      corner(3, :) = 0.0_dp
      call near%add(k, corner)
    end do
    near%tolerance = 1.0e-7_dp
    call make_facet_piece(sheet)
    do k = 1, 3
      call set_facet_piece(near%corner(:, :, k), 2.0_dp, sheet)
      call extend_rims(near, k, 2.0_dp, sheet)
      call check_ends(sheet, "all rims")
      call set_facet_piece(near%corner(:, :, k), 2.0_dp, sheet)
      call extend_edge(near, k, [-0.8_dp, 0.0_dp, 0.6_dp], [1, 3], 2.0_dp, sheet)
      call check_ends(sheet, "the edge that is touched")
    end do
    call check(is_on_wall(near, [-0.5_dp, 0.5_dp, 0.0_dp], 1.0e-6_dp), "a point of the wall")
    call check(.not. is_on_wall(near, [-0.5_dp, -0.5_dp, 0.0_dp], 1.0e-6_dp), "a point beyond the rim")
  end subroutine test_rims

  !> The rim of test_rims from end to end, in a facet whose corners 1 and 3 are on it.
  subroutine check_ends(sheet, what)
    type(convex_piece_t), intent(in) :: sheet
    character(len=*), intent(in) :: what

    call check_close(2.0_dp*min(sheet%vertex(2, 1), sheet%vertex(2, 3)), -3.0_dp, 1.0e-14_dp, what//": lower end")
    call check_close(2.0_dp*max(sheet%vertex(2, 1), sheet%vertex(2, 3)), 0.0_dp, 1.0e-14_dp, what//": upper end")
    call check_close(max(abs(sheet%vertex(1, 1)), abs(sheet%vertex(1, 3))), 0.0_dp, 1.0e-14_dp, what//": on the line")
  end subroutine check_ends

  subroutine test_facet_piece()
    type(convex_piece_t) :: sheet
    type(core_distance_t) :: found
    real(dp), parameter :: corner(3, 3) = reshape([0, 0, 0, 2, 0, 0, 0, 2, 0]*1.0_dp, [3, 3])

    call make_facet_piece(sheet)
    call set_facet_piece(corner, 2.0_dp, sheet)
    call check_close(sheet%vertex(1, 2), 1.0_dp, 0.0_dp, "a facet as a piece")
    call check_close(sheet%face_normal(3, 1), 1.0_dp, 0.0_dp, "its faces")
    found%normal(:) = up
    found%n = 1
    found%vertex_b(1) = 2
    call check(lies_flat(sheet, found), "a facet lies along the plane of contact")
    found%normal(:) = [0.8_dp, 0.0_dp, 0.6_dp]
    call check(.not. lies_flat(sheet, found), "a facet stands across it")
  end subroutine test_facet_piece

  !> A box, over the radius of its ball.
  subroutine make_box(piece, a, b, c, rounding)
    type(convex_piece_t), intent(out) :: piece
    !> half of its sides, and its rounding
    real(dp), intent(in) :: a, b, c, rounding
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp) :: point(3, 8)
    integer :: k

    do k = 0, 7
      call set(point(:, k + 1), sign(a, btest_sign(k, 0)), sign(b, btest_sign(k, 1)), sign(c, btest_sign(k, 2)))
    end do
    call make_polyhedron("box", point, rounding, shape, error)
    call check(.not. allocated(error), "a box")
    piece = shape%piece(1)
  end subroutine make_box

  !> 1 or -1 by a bit of a number.
  pure real(dp) function btest_sign(k, bit)
    integer, intent(in) :: k, bit
    btest_sign = merge(1.0_dp, -1.0_dp, btest(k, bit))
  end function btest_sign

  !> Height of the centre of a box of radius r that stands on a plane through the origin.
  pure real(dp) function standing(piece)
    type(convex_piece_t), intent(in) :: piece
    standing = maxval(piece%corner(3, :))
  end function standing

  !> A box touches a floor in four points wherever it stands on its cuts, also where rounding puts points of a cut before or behind
  !> its corners along a side: its axes and those of the floor differ by rounding.
  subroutine test_box_along_floor()
    type(convex_piece_t) :: piece
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp), parameter :: radius = 0.27_dp
    real(dp) :: normal(3), first(3), second(3), centre(3), yaw
    integer :: k, others

    call make_box(piece, 0.2_dp, 0.15_dp, 0.1_dp, 0.005_dp)
    others = 0
    do k = 1, 20000
      yaw = 3.0_dp*random()
      call set(normal, 1.0e-16_dp*random(), 1.0e-16_dp*random(), 1.0_dp)
      call set(first, cos(yaw), -sin(yaw), -cos(yaw)*normal(1) + sin(yaw)*normal(2))
      call set(second, sin(yaw), cos(yaw), -sin(yaw)*normal(1) - cos(yaw)*normal(2))
      centre(:) = radius*(-standing(piece)*normal + 0.3_dp*random()*first)
      near%n = 0
      call add_floor(near, 2, 4.0_dp*radius, centre, first, second)
      call find_polyhedron_contacts(piece, radius, near, 0.02_dp*radius, 8, found)
      if (found%n /= 1) others = others + 1
      if (found%n == 1) others = others + merge(0, 1, found%manifold(1)%n == 4)
    end do
    call check_equal(others, 0, "four points along a floor")
  end subroutine test_box_along_floor

  !> On a floor that is cut in any way a box touches in the points in which it touches a plane, at rest and a little turned.
  subroutine test_box_on_floor()
    type(convex_piece_t) :: piece
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    type(manifold_t) :: wanted
    real(dp) :: normal(3), first(3), second(3), centre(3), tilt, distance, nearest
    integer :: m, k, l, turn

    call make_box(piece, 1.0_dp, 0.8_dp, 0.5_dp, 0.03_dp)
    do turn = 0, 3
      tilt = 1.0e-4_dp*turn
      call set(normal, sin(tilt), 0.0_dp, cos(tilt))
      call set(first, cos(tilt), 0.0_dp, -sin(tilt))
      call set(second, 0.0_dp, 1.0_dp, 0.0_dp)
      distance = standing(piece) + 1.0e-3_dp
      call find_halfspace_manifold(piece, 1.0_dp, normal, distance, 0.02_dp, 8, wanted)
      call check_equal(wanted%n, 4, "points with a plane")
      do m = 1, 13, 3
        near%n = 0
        centre(:) = -distance*normal
        call add_floor(near, m, 2.5_dp, centre, first, second)
        call find_polyhedron_contacts(piece, 1.0_dp, near, 0.02_dp, 8, found)
        call check_equal(found%n, 1, "one patch")
        if (found%n /= 1) cycle
        call check_equal(found%manifold(1)%n, 4, "of four points")
        if (found%manifold(1)%n /= 4) cycle
        call check_close(maxval(abs(found%manifold(1)%normal - normal)), 0.0_dp, 1.0e-13_dp, "the normal")
        do k = 1, 4
          nearest = huge(1.0_dp)
          do l = 1, 4
            nearest = min(nearest, norm2(found%manifold(1)%point(:, l) - wanted%point(:, k)))
          end do
          call check_close(nearest, 0.0_dp, 1.0e-9_dp, "a point of the plane")
        end do
        call check_close(maxval(found%manifold(1)%gap(1:4)), maxval(wanted%gap(1:4)), 1.0e-9_dp, "the largest gap")
        call check_close(minval(found%manifold(1)%gap(1:4)), minval(wanted%gap(1:4)), 1.0e-9_dp, "the smallest gap")
        call check(all(found%manifold(1)%key(2:4) > found%manifold(1)%key(1:3)), "keys ascend")
      end do
    end do
  end subroutine test_box_on_floor

  !> In a corner of three floors a box touches each with four points.
  subroutine test_box_in_corner()
    type(convex_piece_t) :: piece
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp) :: half(3), low(3), centre(3)
    integer :: k, d

    call make_box(piece, 1.0_dp, 0.8_dp, 0.5_dp, 0.03_dp)
    do d = 1, 3
      half(d) = maxval(piece%corner(d, :))
    end do
    low(:) = -half - 1.0e-3_dp
    call set(centre, low(1) + 2.0_dp, low(2) + 2.0_dp, low(3))
    call add_floor(near, 3, 2.0_dp, centre, [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    call set(centre, low(1), low(2) + 2.0_dp, low(3) + 2.0_dp)
    call add_floor(near, 3, 2.0_dp, centre, [0.0_dp, 1.0_dp, 0.0_dp], [0.0_dp, 0.0_dp, 1.0_dp])
    call set(centre, low(1) + 2.0_dp, low(2), low(3) + 2.0_dp)
    call add_floor(near, 3, 2.0_dp, centre, [0.0_dp, 0.0_dp, 1.0_dp], [1.0_dp, 0.0_dp, 0.0_dp])
    call find_polyhedron_contacts(piece, 1.0_dp, near, 0.02_dp, 8, found)
    call check_equal(found%n, 3, "three walls")
    do k = 1, found%n
      call check_equal(found%manifold(k)%n, 4, "four points each")
      call check_close(maxval(found%manifold(k)%normal), 1.0_dp, 1.0e-13_dp, "normals of the walls")
    end do
  end subroutine test_box_in_corner

  !> A box that hangs over the end of a floor stands on what is below it.
  subroutine test_box_over_edge()
    type(convex_piece_t) :: piece
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    real(dp) :: half, bottom, centre(3)

    call make_box(piece, 1.0_dp, 0.8_dp, 0.5_dp, 0.03_dp)
    half = maxval(piece%corner(1, :))
    bottom = -standing(piece) - 1.0e-3_dp
    call set(centre, 2.1_dp, 0.0_dp, bottom)
    call add_floor(near, 4, 2.0_dp, centre, [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp])
    ! the table has a side, whose upper end sticks out
    call set(centre, 0.1_dp, 0.0_dp, bottom - 2.0_dp)
    call add_floor(near, 4, 2.0_dp, centre, [0.0_dp, 1.0_dp, 0.0_dp], [0.0_dp, 0.0_dp, 1.0_dp])
    call find_polyhedron_contacts(piece, 1.0_dp, near, 0.02_dp, 8, found)
    call check_equal(found%n, 1, "one patch with a table")
    if (found%n /= 1) return
    call check_equal(found%manifold(1)%n, 4, "of four points")
    call check_close(minval(found%manifold(1)%point(1, 1:4)), 0.1_dp, 1.0e-12_dp, "up to the end of the table")
    call check_close(maxval(found%manifold(1)%point(1, 1:4)), half, 1.0e-12_dp, "and to that of the box")
  end subroutine test_box_over_edge

  !> A square on a line of joined segments touches in the points of a plane; at the end of a line, in what is left of them.
  subroutine test_square_on_line()
    type(placed_piece_t) :: square
    type(near_facets_t) :: near
    type(facet_contacts_t) :: found
    type(manifold_t) :: wanted
    real(dp), parameter :: core(2, 4) = reshape([-0.9_dp, -0.9_dp, 0.9_dp, -0.9_dp, 0.9_dp, 0.9_dp, -0.9_dp, 0.9_dp], [2, 4])
    real(dp) :: low

    call place_piece(core, core/0.9_dp, 0.1_dp, 1.0_dp, 0.0_dp, [0.0_dp, 0.0_dp], square)
    low = -1.001_dp
    call find_plane_manifold(square, [0.0_dp, 1.0_dp], low, 0.01_dp, wanted)
    call add_line(1, [-2.0_dp, 0.3_dp], [-1.001_dp, -1.001_dp], near)
    call add_line(2, [0.3_dp, 2.0_dp], [-1.001_dp, -1.001_dp], near)
    call add_line(3, [2.0_dp, 2.0_dp], [-1.001_dp, 3.0_dp], near)
    near%tolerance = 1.0e-7_dp
    call near%join_lines()
    call find_polygon_contacts(square, near, 0.01_dp, found)
    call check_equal(found%n, 1, "a floor of two segments")
    call check_equal(found%manifold(1)%n, 2, "two points")
    call check_close(sum(abs(found%manifold(1)%point(1:2, 1) + found%manifold(1)%point(1:2, 2) - wanted%point(1:2, 1) - &
      & wanted%point(1:2, 2))), 0.0_dp, 1.0e-14_dp, "those of a plane")
    ! beside a wall there are both
    near%corner(1, :, 2) = 1.002_dp
    call find_polygon_contacts(square, near, 0.01_dp, found)
    call check_equal(found%n, 2, "a floor and a wall")
    call find_ball_contacts([0.0_dp, 0.0_dp, 0.0_dp], 1.0_dp, near, 0.01_dp, found)
    call check_equal(found%n, 2, "of a disk too")
  end subroutine test_square_on_line

  !> A pair with a boundary of facets stands in a list as often as facets are near, up to a bound; other pairs as before.
  subroutine test_places()
    type(boundary_t) :: boundaries(2)
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(point_counts_t) :: counts
    type(neighbour_rule_t) :: rule
    real(dp) :: values(3, 2), line(3, 2, 100)
    character(len=:), allocatable :: wrong, expected
    integer, allocatable :: order(:)
    integer :: k

    call make_surface("plane", boundaries(1)%surface)
    boundaries(1)%surface%axis(2) = 1.0_dp
    call check(.not. has_facets(boundaries), "no facets")
    call make_surface("mesh", boundaries(2)%surface)
    values(:, 1) = 0.0_dp
    values(:, 2) = 1.0_dp
    call boundaries(2)%surface%set(values, wrong, expected)
    do k = 1, size(line, 3)
      ! a zigzag
      call set(line(:, 1, k), 1.0_dp*k, 0.1_dp*mod(k, 2), 0.0_dp)
      call set(line(:, 2, k), 1.0_dp*k + 1, 0.1_dp*mod(k + 1, 2), 0.0_dp)
    end do
    call boundaries(2)%surface%take_facets(line)
    call check(has_facets(boundaries), "facets")
    bodies%nd = 2
    bodies%n = 2
    allocate (bodies%position(2, 2), source=reshape([5.5_dp, 0.5_dp, 5.5_dp, 3.0_dp], [2, 2]))
    allocate (bodies%radius(2), source=[0.5_dp, 120.0_dp])
    allocate (bodies%velocity(3, 2), source=0.0_dp)
    rule%alert_distance = 0.05_dp
    rule%skin = 0.2_dp
    call list%init(.false., 4)
    call list%add(1, 2, 0)
    call list%add(1, -1, 0)
    call list%add(1, -2, 0)
    call list%add(2, -2, 0)
    order = [4, 2, 3, 1]
    call repeat_pairs(counts, boundaries, rule, bodies, list, order)
    call check_equal(count(order == 1), 1, "a pair of disks")
    call check_equal(count(order == 2), 1, "with a plane")
    call check_equal(count(order == 3), 3, "with the segments near")
    call check_equal(count(order == 4), 64, "with as many as it may touch")
    call check(all(order(1:64) == 4), "in the order of the list")
  end subroutine test_places

end program test_facet_contacts
