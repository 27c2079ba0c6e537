!> What contacts of convex pieces are made of: nearest points of simplices, distances of cores, polygons cut out of each
!> other, and the points of edges and faces that lie on each other.
program test_convex_contact
  use, intrinsic :: ieee_arithmetic, only: ieee_get_halting_mode, ieee_invalid, ieee_quiet_nan, ieee_set_flag, &
    & ieee_set_halting_mode, ieee_value
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_convex_piece, only: convex_piece_t, find_support, looks_along, number_of_sectors
  use gravier_nearest_simplex, only: find_nearest
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance, support_a, support_b, &
    & place_a, place_b
  use gravier_polygon_clip, only: clip_polygon, room_for_clip
  use gravier_contact_feature, only: placement_t, feature_t, frame_t, find_feature, edge_number
  use gravier_contact_patch, only: patch_point_t
  use gravier_edge_patch, only: add_edge_points
  use gravier_face_patch, only: add_face_points
  use gravier_manifold, only: feature_base, most_points
  use gravier_simple_shapes, only: make_polyhedron
  use gravier_shape_library, only: body_shape_t
  use gravier_polyhedra, only: draws_t, vector_t, turn_t, random_turn, about, vec, put_pair, make_box_rod_ball, &
    & half => half_core, straight
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> corners of polygons nearer than this are at one place
  real(dp), parameter :: near = 1.0e-9_dp
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-13_dp
  type(body_shape_t) :: box, rod, ball

  call make_box_rod_ball(box, rod, ball)
  call test_simplices()
  call test_random_simplices()
  call test_support()
  call test_bounds()
  call test_far_side()
  call test_candidates()
  call test_distance()
  call test_turned_distance()
  call test_needle()
  call test_beyond()
  call test_clip()
  call test_clip_segment()
  call test_faces()
  call test_face_and_edge()
  call test_edges()
  call finish_checks()

contains

  !> The ball that holds a piece holds all of its core with the rounding, and touches it.
  subroutine test_bounds()
    call test_bound(box%piece(1))
    call test_bound(rod%piece(1))
    call test_bound(ball%piece(1))
    ! the radius of a body is that of a ball that holds its sharp corners
    call check(box%piece(1)%reach < 1.0_dp .and. box%piece(1)%reach > 0.9_dp, "that of a box is within the ball of the body")
  end subroutine test_bounds

  subroutine test_bound(piece)
    type(convex_piece_t), intent(in) :: piece
    real(dp) :: farthest
    integer :: v

    farthest = 0.0_dp
    do v = 1, size(piece%vertex, 2)
      farthest = max(farthest, norm2(piece%vertex(:, v) - piece%middle) + piece%rounding)
    end do
    call check_close(farthest, piece%reach, tight, "the ball that holds a piece")
  end subroutine test_bound

  !> Of a box the four corners of the side that looks at a plane are of this side, also where it leans by 20 degrees; all of a rod
  !> are.
  subroutine test_far_side()
    real(dp) :: along(3)
    integer :: v, n

    do n = 0, 1
      along(1) = sin(n*pi/9)
      along(2) = 0.0_dp
      along(3) = -cos(n*pi/9)
      associate (piece => box%piece(1))
        do v = 1, size(piece%vertex, 2)
          call check(looks_along(piece, v, along) .eqv. piece%vertex(3, v) < 0.0_dp, "the side of a corner of a box")
        end do
      end associate
    end do
    do v = 1, size(rod%piece(1)%vertex, 2)
      call check(looks_along(rod%piece(1), v, along), "a rod has no far side")
    end do
  end subroutine test_far_side

  !> Simplices whose nearest points are known.
  subroutine test_simplices()
    real(dp) :: w(3, 4), share(4), v(3)

    w(:, :) = 0.0_dp
    w(:, 1) = [3.0_dp, 4.0_dp, 0.0_dp]
    call find_nearest(w, 1, share, v)
    call check_close(norm2(v), 5.0_dp, 0.0_dp, "a point alone")
    w(:, 1) = [-1.0_dp, 2.0_dp, 0.0_dp]
    w(:, 2) = [3.0_dp, 2.0_dp, 0.0_dp]
    call find_nearest(w, 2, share, v)
    call check_close(share(1), 0.75_dp, tight, "within a segment: the share of the nearer end")
    call check_close(share(2), 0.25_dp, tight, "within a segment: the share of the other")
    call check_close(v(2), 2.0_dp, tight, "within a segment: its distance")
    w(1, 1) = 1.0_dp
    call find_nearest(w, 2, share, v)
    call check_close(share(2), 0.0_dp, 0.0_dp, "beside a segment the far end has no share")
    ! a triangle at height 1, whose first corner, first side and middle are nearest in turn
    w(:, 1) = [1.0_dp, 1.0_dp, 1.0_dp]
    w(:, 2) = [4.0_dp, 1.0_dp, 1.0_dp]
    w(:, 3) = [1.0_dp, 4.0_dp, 1.0_dp]
    call find_nearest(w, 3, share, v)
    call check_close(share(1), 1.0_dp, 0.0_dp, "the corner of a triangle")
    w(1, 1:3) = w(1, 1:3) - 2.0_dp
    call find_nearest(w, 3, share, v)
    call check_close(share(2), 1/3.0_dp, tight, "the side of a triangle")
    call check_close(share(3), 0.0_dp, 0.0_dp, "which its third corner has no share in")
    w(2, 1:3) = w(2, 1:3) - 2.0_dp
    call find_nearest(w, 3, share, v)
    call check_close(maxval(abs(share(1:3) - 1/3.0_dp)), 0.0_dp, tight, "the middle of a triangle")
    call check_close(v(3), 1.0_dp, tight, "at its height")
    w(:, 4) = [0.0_dp, 0.0_dp, 2.0_dp]
    call find_nearest(w, 4, share, v)
    call check_close(share(4), 0.0_dp, 0.0_dp, "a tetrahedron behind its face")
    call check_close(v(3), 1.0_dp, tight, "the face is nearest")
    w(3, 4) = -1.0_dp
    call find_nearest(w, 4, share, v)
    call check_close(norm2(v), 0.0_dp, 0.0_dp, "the origin within a tetrahedron")
    call check_close(share(4), 0.5_dp, tight, "half-way between its top and its floor")
    call check_close(sum(share), 1.0_dp, tight, "shares sum to 1")
  end subroutine test_simplices

  !> The nearest point is where all points of the simplex are behind the plane across it, and those with shares in it.
  subroutine test_random_simplices()
    type(draws_t) :: draws
    real(dp) :: w(3, 4), share(4), v(3), u(3)
    integer :: k, d, n, trial
    logical :: nearest, sums

    nearest = .true.
    sums = .true.
    do trial = 1, 3000
      n = 1 + mod(trial, 4)
      do k = 1, 4
        do d = 1, 3
          w(d, k) = draws%between(-1.0_dp, 1.0_dp)
        end do
        w(3, k) = w(3, k) + 0.5_dp
      end do
      call find_nearest(w, n, share, v)
      u(:) = 0.0_dp
      do k = 1, n
        u(:) = u + share(k)*w(:, k)
        nearest = nearest .and. dot_product(v, w(:, k)) - dot_product(v, v) >= -1.0e-9_dp
      end do
      sums = sums .and. norm2(u - v) <= 1.0e-9_dp .and. abs(sum(share(1:n)) - 1.0_dp) <= 1.0e-9_dp .and. minval(share) >= 0.0_dp
    end do
    call check(nearest, "no point of a simplex is nearer")
    call check(sums, "the nearest point is the sum of its shares")
  end subroutine test_random_simplices

  !> The place of one shape beside another, their lengths being those that the shapes were made with.
  subroutine test_support()
    type(draws_t) :: draws
    type(vector_t) :: along
    type(placed_pair_t) :: pair
    real(dp) :: x(3), y(3), against(3)
    integer :: best, other, trial, d
    logical :: farthest, same

    farthest = .true.
    same = .true.
    call put_pair(box, box, [3.0_dp, 1.0_dp, -2.0_dp], random_turn(draws), pair)
    do trial = 1, 200
      along = draws%direction()
      call find_support(box%piece(1), along%x, best)
      do d = 1, 3
        farthest = farthest .and. box%piece(1)%vertex(d, best)*along%x(d) > 0.0_dp
      end do
      against(:) = -along%x
      call support_a(box%piece(1), against, other)
      same = same .and. other == best
      call support_b(box%piece(1), pair, along%x, best)
      call place_b(box%piece(1), pair, best, y)
      farthest = farthest .and. dot_product(along%x, y - pair%way) > 0.0_dp
      do d = 1, 8
        call place_b(box%piece(1), pair, d, x)
        farthest = farthest .and. dot_product(along%x, x) <= dot_product(along%x, y) + tight
      end do
    end do
    call check(farthest, "the vertex farthest along a direction")
    call check(same, "the vertex of the first piece that is farthest against a direction")
    call place_a(box%piece(1), pair, 1, x)
    call check_close(norm2(x), sqrt(3.0_dp)*half, tight, "the corner of a core is where it was made")
  end subroutine test_support

  !> The farthest vertex of a stone, of a flake and of a cube is the lowest of those that are farthest of all: along any direction,
  !> along the borders of sectors, and along normals of faces, where all corners of a face are equally far but for rounding.
  subroutine test_candidates()
    type(draws_t) :: draws
    type(vector_t) :: along
    type(convex_piece_t) :: piece
    integer :: trial, k, wrong(3)
    logical :: halts

    wrong(:) = 0
    do trial = 1, 20000
      along = draws%direction()
      call count_wrong(along%x, wrong(1))
      do k = 1, 3
        along%x(k) = nint(12*along%x(k))/12.0_dp
      end do
      call count_wrong(along%x, wrong(2))
    end do
    piece = stone(0.5_dp)
    do k = 1, size(piece%face_normal, 2)
      call count_wrong(piece%face_normal(:, k), wrong(3))
    end do
    call check(allocated(piece%candidate), "a piece of some vertices has candidates")
    call check(size(piece%candidate) < size(piece%vertex, 2)*number_of_sectors/8, "and few of them in each sector")
    call check(.not. allocated(rod%piece(1)%candidate), "a rod has none")
    call check_equal(wrong(1), 0, "the farthest vertex along any direction")
    call check_equal(wrong(2), 0, "the farthest vertex along the borders of sectors")
    call check_equal(wrong(3), 0, "the farthest vertex along normals of faces")
    along%x(:) = 0.0_dp
    call find_support(piece, along%x, k)
    call check(k >= 1 .and. k <= size(piece%vertex, 2), "a vector without length has a vertex")
    ! builds that stop at what is no number do not do so here
    call ieee_get_halting_mode(ieee_invalid, halts)
    call ieee_set_halting_mode(ieee_invalid, .false.)
    along%x(:) = ieee_value(1.0_dp, ieee_quiet_nan)
    call find_support(piece, along%x, k)
    call check(k >= 1 .and. k <= size(piece%vertex, 2), "and what is no number has one")
    call ieee_set_flag(ieee_invalid, .false.)
    call ieee_set_halting_mode(ieee_invalid, halts)
  end subroutine test_candidates

  !> The piece of a stone of 60 corners, as thick as told.
  function stone(thickness) result(piece)
    real(dp), intent(in) :: thickness
    type(convex_piece_t) :: piece
    integer, parameter :: corners = 60
    type(draws_t) :: draws
    type(vector_t) :: along
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp) :: point(3, corners)
    integer :: k

    do k = 1, corners
      along = draws%direction()
      point(1, k) = along%x(1)
      point(2, k) = 0.8_dp*along%x(2)
      point(3, k) = thickness*along%x(3)
    end do
    call make_polyhedron("stone", point, 0.002_dp*thickness, shape, error)
    call check(.not. allocated(error), "a stone")
    piece = shape%piece(1)
  end function stone

  !> Count pieces whose farthest vertex along a direction is not the first that is farthest of all.
  subroutine count_wrong(along, wrong)
    real(dp), intent(in) :: along(3)
    integer, intent(inout) :: wrong
    type(convex_piece_t), save :: piece(3)
    real(dp) :: farthest, reach
    integer :: k, v, best, expected

    if (.not. allocated(piece(1)%vertex)) then
      piece(1) = stone(0.5_dp)
      piece(2) = stone(1.0e-4_dp)
      piece(3) = box%piece(1)
    end if
    do k = 1, size(piece)
      expected = 1
      farthest = -huge(1.0_dp)
      do v = 1, size(piece(k)%vertex, 2)
        reach = along(1)*piece(k)%vertex(1, v) + along(2)*piece(k)%vertex(2, v) + along(3)*piece(k)%vertex(3, v)
        if (reach > farthest) expected = v
        farthest = max(farthest, reach)
      end do
      call find_support(piece(k), along, best)
      ! two vertices that differ by rounding alone are equally far: compilers may fuse products and sums here and there otherwise
      reach = dot_product(along, piece(k)%vertex(:, best))
      if (best /= expected .and. reach < farthest - 1.0e-15_dp) wrong = wrong + 1
    end do
  end subroutine count_wrong

  !> Cubes and balls beside each other: faces, edges, corners.
  subroutine test_distance()
    type(core_distance_t) :: found
    type(placed_pair_t) :: pair

    call put_pair(box, box, [3.0_dp, 0.0_dp, 0.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), box%piece(1), pair, huge(1.0_dp), found)
    call check(.not. (found%overlap .or. found%beyond), "two cubes are apart")
    call check_close(found%distance, 3.0_dp - 2*half, tight, "from face to face")
    call check_close(found%normal(1), -1.0_dp, tight, "the normal is from the second to the first")
    call check_close(found%point_a(1), half, tight, "the nearest point of the first")
    call check_close(found%point_b(1), 3.0_dp - half, tight, "the nearest point of the second")
    call put_pair(box, box, [3.0_dp, 3.0_dp, 0.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), box%piece(1), pair, huge(1.0_dp), found)
    call check_close(found%distance, sqrt(2.0_dp)*(3.0_dp - 2*half), tight, "from edge to edge")
    call put_pair(box, box, [3.0_dp, 3.0_dp, 3.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), box%piece(1), pair, huge(1.0_dp), found)
    call check_close(found%distance, sqrt(3.0_dp)*(3.0_dp - 2*half), tight, "from corner to corner")
    call check_equal(found%n, 1, "of which each has one vertex")
    call put_pair(box, ball, [0.25_dp, 0.5_dp, 5.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), ball%piece(1), pair, huge(1.0_dp), found)
    call check_close(found%distance, 5.0_dp - half, tight, "from a face to the centre of a ball")
    call check_close(found%point_a(1), 0.25_dp, tight, "the nearest point is below it")
    call check_close(sum(found%share(1:found%n)), 1.0_dp, tight, "shares of vertices sum to 1")
    call put_pair(rod, rod, [0.0_dp, 3.0_dp, 0.5_dp], about(vec(0.0_dp, 1.0_dp, 0.0_dp), 0.5_dp*pi), pair)
    call find_core_distance(rod%piece(1), rod%piece(1), pair, huge(1.0_dp), found)
    call check_close(found%distance, 3.0_dp, tight, "two rods across each other")
    call check_close(found%point_b(3), 0.5_dp, tight, "the nearest point is where they cross")
  end subroutine test_distance

  !> Short edges beside long ones, as a pair of random hulls had them: the triangle of their differences is a needle, of which the
  !> shares must give the nearest points as exactly as those of other triangles do.
  subroutine test_needle()
    real(dp), parameter :: short = 1.0e-5_dp
    type(convex_piece_t) :: a, b
    type(placed_pair_t) :: pair
    type(core_distance_t) :: found
    type(draws_t) :: draws
    type(vector_t) :: way
    real(dp) :: x(3), y(3), u(3), worst
    integer :: k, trial, needles

    draws%seed = 5
    allocate (a%vertex(3, 2), b%vertex(3, 2))
    pair%rotation(:, :) = straight
    worst = 0.0_dp
    needles = 0
    do trial = 1, 20000
      way = draws%direction()
      a%vertex(:, 1) = 0.0_dp
      a%vertex(:, 2) = short*way%x
      way = draws%direction()
      b%vertex(:, 1) = 10*short*way%x
      way = draws%direction()
      b%vertex(:, 2) = 2*way%x
      call find_core_distance(a, b, pair, huge(1.0_dp), found)
      if (found%overlap .or. found%n < 3) cycle
      needles = needles + 1
      x(:) = 0.0_dp
      y(:) = 0.0_dp
      do k = 1, found%n
        call place_a(a, pair, found%vertex_a(k), u)
        x(:) = x + found%share(k)*u
        call place_b(b, pair, found%vertex_b(k), u)
        y(:) = y + found%share(k)*u
      end do
      worst = max(worst, norm2(x - found%point_a), norm2(y - found%point_b))
    end do
    call check(needles > 50, "triangles that are needles")
    call check_close(worst, 0.0_dp, 1.0e-14_dp, "the nearest points of needles")
  end subroutine test_needle

  !> Seen from the other piece, the distance is the same and the normal is turned.
  subroutine test_turned_distance()
    type(draws_t) :: draws
    type(core_distance_t) :: found, other
    type(placed_pair_t) :: pair, turned
    type(turn_t) :: turn
    type(vector_t) :: way
    real(dp) :: u(3)
    integer :: trial, k
    logical :: same

    same = .true.
    do trial = 1, 300
      way = draws%direction()
      turn = random_turn(draws)
      u(:) = 3.6_dp*way%x
      call put_pair(box, rod, u, turn, pair)
      turned = pair
      turned%radius_a = pair%radius_b
      turned%radius_b = pair%radius_a
      do k = 1, 3
        turned%way(k) = -dot_product(turn%m(:, k), u)
        turned%rotation(k, :) = turn%m(:, k)
      end do
      call find_core_distance(box%piece(1), rod%piece(1), pair, huge(1.0_dp), found)
      call find_core_distance(rod%piece(1), box%piece(1), turned, huge(1.0_dp), other)
      same = same .and. abs(found%distance - other%distance) <= 1.0e-12_dp
      do k = 1, 3
        same = same .and. abs(dot_product(turn%m(:, k), found%normal) + other%normal(k)) <= 1.0e-9_dp
      end do
    end do
    call check(same, "the distance is the same from both sides")
  end subroutine test_turned_distance

  subroutine test_beyond()
    type(core_distance_t) :: found
    type(placed_pair_t) :: pair

    call put_pair(box, box, [5.0_dp, 0.0_dp, 0.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), box%piece(1), pair, 1.0_dp, found)
    call check(found%beyond, "cubes farther than what was asked about")
    call find_core_distance(box%piece(1), box%piece(1), pair, 4.0_dp, found)
    call check(.not. found%beyond, "and within it")
    call put_pair(box, box, [1.0_dp, 0.5_dp, 0.0_dp], turn_t(straight), pair)
    call find_core_distance(box%piece(1), box%piece(1), pair, 4.0_dp, found)
    call check(found%overlap, "cubes that overlap")
  end subroutine test_beyond

  !> Area of a polygon, above 0 where it is anticlockwise.
  pure real(dp) function area_of(n, place) result(area)
    integer, intent(in) :: n
    real(dp), intent(in) :: place(:, :)
    integer :: k, next

    area = 0.0_dp
    do k = 1, n
      next = mod(k, n) + 1
      area = area + 0.5_dp*(place(1, k)*place(2, next) - place(2, k)*place(1, next))
    end do
  end function area_of

  !> Two squares of side 2, and polygons that have nothing or all in common.
  subroutine test_clip()
    real(dp), parameter :: c = sqrt(2.0_dp)
    real(dp) :: square(3, 4), other(3, 4), turned(3, 4), place(2, 16)
    integer :: n, label(16), k

    call check_equal(room_for_clip(4, 4), 16, "room for the corners of two squares")
    square(:, :) = 0.0_dp
    square(1, :) = [-1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp]
    square(2, :) = [-1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp]
    other(:, :) = square
    other(1, :) = square(1, :) + 1.5_dp
    other(2, :) = square(2, :) + 1.0_dp
    call clip_polygon(square, other, 1.0_dp, near, n, place, label)
    call check_equal(n, 4, "the common part of two squares has four corners")
    call check_close(area_of(n, place), 0.5_dp, tight, "its area")
    call check_equal(count(label(1:4) > 0), 2, "two sides are those of the first")
    call check_equal(count(label(1:4) < 0), 2, "two those of the second")
    do k = 1, 4
      turned(:, k) = other(:, 5 - k)
    end do
    call clip_polygon(square, turned, -1.0_dp, near, n, place, label)
    call check_close(area_of(n, place), 0.5_dp, tight, "a square that is clockwise")
    other(1, :) = [c, 0.0_dp, -c, 0.0_dp]
    other(2, :) = [0.0_dp, c, 0.0_dp, -c]
    call clip_polygon(square, other, 1.0_dp, near, n, place, label)
    call check_equal(n, 8, "a square on its corner cuts all corners off")
    call check_close(area_of(n, place), 8*(c - 1.0_dp), tight, "and leaves a regular octagon")
    do k = 1, 8
      call check(label(k)*label(mod(k, 8) + 1) < 0, "whose sides are of both in turn")
    end do
    turned(:, :) = 0.1_dp*square
    call clip_polygon(turned, other, 1.0_dp, near, n, place, label)
    call check_close(area_of(n, place), 0.04_dp, tight, "a square within is left as it is")
    other(1, :) = other(1, :) + 4.0_dp
    call clip_polygon(square, other, 1.0_dp, near, n, place, label)
    call check_equal(n, 0, "squares apart have nothing in common")
    ! side by side, seen from both: rounding does not decide
    do k = -1, 1
      other(:, :) = square
      other(1, :) = square(1, :) + 2.0_dp + k*4*epsilon(1.0_dp)
      other(2, :) = square(2, :) + 0.5_dp
      call clip_polygon(square, other, 1.0_dp, near, n, place, label)
      call check(n >= 2, "squares side by side have a stretch of their sides in common")
      call check_close(maxval(place(2, 1:n)) - minval(place(2, 1:n)), 1.5_dp, tight, "all of it")
      call check_close(area_of(n, place), 0.0_dp, tight, "which has no area")
    end do
    other(1, :) = square(1, :) + 2.0_dp + 1.0e-9_dp
    call clip_polygon(square, other, 1.0_dp, near, n, place, label)
    call check_equal(n, 0, "squares that are just apart have nothing in common")
  end subroutine test_clip

  subroutine test_clip_segment()
    real(dp) :: square(3, 4), segment(3, 2), place(2, 12)
    integer :: n, label(12)

    square(:, :) = 0.0_dp
    square(1, :) = [-1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp]
    square(2, :) = [-1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp]
    segment(:, :) = 0.0_dp
    segment(1, :) = [-3.0_dp, 0.5_dp]
    segment(2, :) = 0.25_dp
    call clip_polygon(segment, square, 1.0_dp, near, n, place, label)
    call check_equal(n, 3, "a segment is cut there and back")
    call check_close(minval(place(1, 1:n)), -1.0_dp, tight, "at the border")
    call check_close(maxval(place(1, 1:n)), 0.5_dp, tight, "its end within stays")
    call check_close(maxval(abs(place(2, 1:n) - 0.25_dp)), 0.0_dp, tight, "in its line")
    call check_close(area_of(n, place), 0.0_dp, tight, "without an area")
  end subroutine test_clip_segment

  !> Where two pieces are, and the frame between them at a height above the centre of b; a lies above b.
  subroutine put_above(shape_a, shape_b, centre, turn, height, at_a, at_b, frame)
    type(body_shape_t), intent(in) :: shape_a, shape_b
    !> of a
    real(dp), intent(in) :: centre(3)
    !> of a
    type(turn_t), intent(in) :: turn
    real(dp), intent(in) :: height
    type(placement_t), intent(out) :: at_a, at_b
    type(frame_t), intent(out) :: frame

    at_a%radius = shape_a%size
    at_a%rotation(:, :) = turn%m
    at_a%centre(:) = centre
    at_b%radius = shape_b%size
    at_b%rotation(:, :) = straight
    at_b%centre(:) = 0.0_dp
    frame%origin(:) = 0.0_dp
    frame%origin(3) = height
    frame%normal(:) = straight(:, 3)
    frame%first(:) = straight(:, 1)
    frame%second(:) = straight(:, 2)
  end subroutine put_above

  !> The vertex of a piece that lies farthest along a direction of its axes.
  integer function farthest(piece, x, y, z) result(best)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: x, y, z
    type(vector_t) :: along

    along = vec(x, y, z)
    call find_support(piece, along%x, best)
  end function farthest

  !> A cube on a cube, shifted: the corners of their common part.
  subroutine test_faces()
    real(dp), parameter :: gap = 0.005_dp
    type(placement_t) :: at_a, at_b
    type(frame_t) :: frame
    type(feature_t) :: feature_a, feature_b
    type(patch_point_t) :: point(most_points)
    real(dp) :: low(2), high(2), down(3)
    integer :: n, k, known_a(1), known_b(1)

    call put_above(box, box, [1.0_dp, 0.5_dp, 2.0_dp + gap], turn_t(straight), 1.0_dp, at_a, at_b, frame)
    known_a(1) = farthest(box%piece(1), 0.1_dp, 0.1_dp, -1.0_dp)
    known_b(1) = farthest(box%piece(1), 0.1_dp, 0.1_dp, 1.0_dp)
    down(:) = -frame%normal
    call find_feature(box%piece(1), down, known_a, feature_a)
    call find_feature(box%piece(1), frame%normal, known_b, feature_b)
    call check_equal(feature_a%n + feature_b%n, 8, "faces of cubes")
    feature_a%at = at_a
    feature_b%at = at_b
    frame%alert = 0.01_dp
    n = 0
    call add_face_points(box%piece(1), box%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 4, "a cube on a cube: four points")
    low(:) = huge(1.0_dp)
    high(:) = -huge(1.0_dp)
    do k = 1, n
      low(:) = min(low, point(k)%place(1:2))
      high(:) = max(high, point(k)%place(1:2))
      call check_close(point(k)%gap, gap, tight, "a cube on a cube: the gap")
      call check_close(point(k)%place(3), 0.5_dp*gap, tight, "a cube on a cube: points half-way between")
      call check(all(point(1:k - 1)%key /= point(k)%key), "a cube on a cube: keys differ")
    end do
    ! flat sides reach as far as those of the sharp cubes
    call check_close(low(1), 0.0_dp, tight, "the common part begins with the upper cube")
    call check_close(low(2), -0.5_dp, tight, "in both directions")
    call check_close(high(1), 1.0_dp, tight, "it ends with the lower cube")
    call check_close(high(2), 1.0_dp, tight, "in both directions too")
    frame%alert = 0.5_dp*gap
    n = 0
    call add_face_points(box%piece(1), box%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 0, "no points where the gap is too large")
  end subroutine test_faces

  !> A rod that lies on a cube, along the first axis, and hangs over.
  subroutine test_face_and_edge()
    real(dp), parameter :: gap = 0.003_dp
    type(placement_t) :: at_a, at_b
    type(frame_t) :: frame
    type(feature_t) :: feature_a, feature_b
    type(patch_point_t) :: point(most_points)
    real(dp) :: down(3), along(3)
    integer :: n, known_b(1)

    call put_above(rod, box, [0.75_dp, 0.25_dp, 1.25_dp + gap], about(vec(0.0_dp, 1.0_dp, 0.0_dp), 0.5_dp*pi), 1.0_dp, at_a, at_b, &
      & frame)
    down(:) = -frame%normal
    ! the direction down in the axes of the rod
    along(:) = down(3)*at_a%rotation(3, :)
    call find_feature(rod%piece(1), along, [1], feature_a)
    known_b(1) = farthest(box%piece(1), 0.1_dp, 0.1_dp, 1.0_dp)
    call find_feature(box%piece(1), frame%normal, known_b, feature_b)
    call check_equal(feature_a%n, 2, "a rod has an edge")
    feature_a%at = at_a
    feature_b%at = at_b
    frame%alert = 0.01_dp
    n = 0
    call add_face_points(rod%piece(1), box%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 2, "a rod on a cube: two points")
    call check_close(minval(point(1:2)%place(1)), -0.25_dp, tight, "the end of the rod")
    call check_close(maxval(point(1:2)%place(1)), 1.0_dp, tight, "the side of the cube")
    call check_close(point(1)%place(2), 0.25_dp, tight, "below the rod")
    call check_close(maxval(point(1:2)%gap), gap, tight, "a rod on a cube: the gap")
    call check_close(minval(point(1:2)%gap), gap, tight, "a rod on a cube: at both ends")
  end subroutine test_face_and_edge

  !> Rods above each other: side by side, and across.
  subroutine test_edges()
    real(dp), parameter :: gap = 0.004_dp
    type(frame_t) :: frame
    type(feature_t) :: feature_a, feature_b
    type(patch_point_t) :: point(most_points)
    integer :: n, edge

    feature_a%vertex = 1
    feature_a%other = 2
    feature_a%n = 2
    feature_b = feature_a
    edge = edge_number(rod%piece(1), 1, 2)
    call check(edge > 1, "edges come behind vertices")
    ! along the second axis for the normal, so that the third lies along the rods
    call put_above(rod, rod, [0.0_dp, 0.5_dp + gap, 1.5_dp], turn_t(straight), 0.0_dp, &
      & feature_a%at, feature_b%at, frame)
    frame%normal(:) = straight(:, 2)
    frame%first(:) = straight(:, 3)
    frame%second(:) = straight(:, 1)
    frame%alert = 0.01_dp
    frame%origin(2) = 0.25_dp
    n = 0
    call add_edge_points(rod%piece(1), rod%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 2, "rods side by side: two points")
    call check_close(minval(point(1:2)%place(1)), 0.5_dp, tight, "where the upper one begins")
    call check_close(maxval(point(1:2)%place(1)), 1.0_dp, tight, "where the lower one ends")
    call check_close(maxval(abs(point(1:2)%gap - gap)), 0.0_dp, tight, "rods side by side: the gap")
    call check_close(maxval(abs(point(1:2)%place(3) - 0.5_dp*gap)), 0.0_dp, tight, "half-way between")
    call check(any(point(1:2)%key/feature_base == edge) .and. any(mod(point(1:2)%key, feature_base) == edge), &
      & "each is an end of one on the edge of the other")
    feature_a%at%centre(3) = 2.5_dp
    n = 0
    call add_edge_points(rod%piece(1), rod%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 0, "rods one behind the other")
    call put_above(rod, rod, [0.0_dp, 0.5_dp + gap, 0.0_dp], about(vec(0.0_dp, 1.0_dp, 0.0_dp), 0.5_dp), 0.0_dp, &
      & feature_a%at, feature_b%at, frame)
    frame%normal(:) = straight(:, 2)
    frame%first(:) = straight(:, 3)
    frame%second(:) = straight(:, 1)
    frame%alert = 0.01_dp
    call add_edge_points(rod%piece(1), rod%piece(1), feature_a, feature_b, frame, n, point)
    call check_equal(n, 0, "rods across each other")
  end subroutine test_edges

end program test_convex_contact
