!> The direction in which two convex cores that overlap are least separated: cubes and rods by formulas, random hulls, and cubes on
!> the edge of a sheet by trying all axes that can be it.
program test_core_overlap
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_convex_piece, only: convex_piece_t, list_faces
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, place_a, place_b
  use gravier_core_overlap, only: find_least_separation
  use gravier_simple_shapes, only: make_capsule, make_polyhedron
  use gravier_shape_library, only: body_shape_t
  use gravier_polyhedra, only: draws_t, vector_t, turn_t, random_turn, about, vec, put_pair, make_box_rod_ball, &
    & half => half_core, straight
  use gravier_check, only: check, check_close, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-13_dp
  type(body_shape_t) :: box, rod, ball

  call make_box_rod_ball(box, rod, ball)
  call test_overlap()
  call test_overlap_of_rods()
  call test_all_axes()
  call test_edge_of_sheet()
  call finish_checks()

contains

  !> Cubes one within the other by a face, and by an edge on an edge.
  subroutine test_overlap()
    real(dp), parameter :: depth = 0.2_dp
    type(core_distance_t) :: found
    type(placed_pair_t) :: pair
    type(turn_t) :: turn
    real(dp) :: way(3)

    way(:) = [0.3_dp, 2*half - depth, 0.1_dp]
    call put_pair(box, box, way, turn_t(straight), pair)
    call find_least_separation(box%piece(1), box%piece(1), pair, found)
    call check_close(found%distance, -depth, tight, "faces: the depth")
    call check_close(found%normal(2), -1.0_dp, tight, "faces: the normal from the second to the first")
    call check_close(found%point_a(2) - found%point_b(2), depth, tight, "faces: both ends of the overlap")
    call check_close(0.5_dp*(found%point_a(2) + found%point_b(2)), half - 0.5_dp*depth, tight, "faces: their middle")
    ! the second is turned so that an edge of it meets a face of the first
    turn = about(vec(0.0_dp, 0.0_dp, 1.0_dp), 0.25_dp*pi)
    call put_pair(box, box, [0.0_dp, 0.0_dp, 0.0_dp], turn_t(straight), pair)
    pair%rotation(:, :) = turn%m
    way(:) = 0.0_dp
    way(1) = half + sqrt(2.0_dp)*half - depth
    pair%way(:) = way
    call find_least_separation(box%piece(1), box%piece(1), pair, found)
    call check_close(found%distance, -depth, tight, "an edge in a face: the depth")
    call check_close(found%normal(1), -1.0_dp, tight, "an edge in a face: the normal")
    call check_close(found%point_b(1), half - depth, tight, "an edge in a face: a point of the edge")
    call check_close(found%point_b(2), 0.0_dp, tight, "an edge in a face: not half-way to a corner of the face")
    call check_close(found%point_a(1), half, tight, "an edge in a face: the point of the face before it")
    ! edges across each other, each half-way between two faces
    turn = about(vec(1.0_dp, 1.0_dp, 0.0_dp), 0.5_dp*pi)
    pair%rotation(:, :) = turn%m
    pair%way(1:2) = 2*half - depth/sqrt(2.0_dp)
    call find_least_separation(box%piece(1), box%piece(1), pair, found)
    call check_close(found%distance, -depth, 10*tight, "edges: the depth")
    call check_close(found%normal(1), -sqrt(0.5_dp), tight, "edges: the normal")
    call check_close(found%normal(2), -sqrt(0.5_dp), tight, "edges: is between the faces")
    way(:) = [half, half, 0.0_dp]
    call check_close(norm2(found%point_a - way), 0.0_dp, 10*tight, "edges: the point of the first")
    call check_close(norm2(found%point_a - found%point_b - found%distance*found%normal), 0.0_dp, tight, "edges: the way between")
  end subroutine test_overlap

  !> Cores without faces.
  subroutine test_overlap_of_rods()
    type(core_distance_t) :: found
    type(placed_pair_t) :: pair

    call put_pair(rod, rod, [0.0_dp, 0.0_dp, 0.0_dp], about(vec(1.0_dp, 0.0_dp, 0.0_dp), 0.5_dp*pi), pair)
    call find_least_separation(rod%piece(1), rod%piece(1), pair, found)
    call check_close(found%distance, 0.0_dp, tight, "rods that cross")
    call check_close(abs(found%normal(1)), 1.0_dp, tight, "are pushed across both")
    call put_pair(rod, ball, [0.0_dp, 0.0_dp, 0.5_dp], turn_t(straight), pair)
    call find_least_separation(rod%piece(1), ball%piece(1), pair, found)
    call check_close(norm2(found%normal), 1.0_dp, tight, "a ball on a rod has a normal")
    call check_close(found%normal(3), 0.0_dp, tight, "across the rod")
    call put_pair(ball, ball, [0.0_dp, 0.0_dp, 0.0_dp], turn_t(straight), pair)
    call find_least_separation(ball%piece(1), ball%piece(1), pair, found)
    call check_close(found%normal(3), 1.0_dp, tight, "balls at one place: the third axis")
  end subroutine test_overlap_of_rods

  !> Random hulls that overlap, beside all axes: normals of faces, and common normals of every two edges in both directions.
  !> Where the hulls are apart the axis of least separation may be another one.
  subroutine test_all_axes()
    type(draws_t) :: draws
    type(vector_t) :: u
    type(error_t), allocatable :: error
    type(body_shape_t) :: hull(6), bar
    type(placed_pair_t) :: pair
    type(core_distance_t) :: found
    real(dp) :: points(3, 14), way(3), best, worst, beside
    integer :: k, p, trial, by_edges
    logical :: edges

    draws%seed = 11
    do k = 1, size(hull)
      do p = 1, size(points, 2)
        u = draws%direction()
        points(1, p) = u%x(1)
        points(2, p) = 0.8_dp*u%x(2)
        points(3, p) = 0.5_dp*u%x(3)
      end do
      call make_polyhedron("hull", points(:, 1:4 + 2*k - 2), 0.01_dp, hull(k), error)
      call check(.not. allocated(error), "hulls")
    end do
    call make_capsule("bar", 1.2_dp, 0.05_dp, bar, error)
    worst = 0.0_dp
    beside = 0.0_dp
    by_edges = 0
    do trial = 1, 600
      u = draws%direction()
      associate (a => hull(1 + modulo(trial, 6)), b => hull(1 + modulo(trial/6, 6)))
        way(:) = draws%between(0.0_dp, 0.6_dp)*u%x
        call put_pair(a, b, way, random_turn(draws), pair)
        call find_least_separation(a%piece(1), b%piece(1), pair, found)
        call try_all_axes(a%piece(1), b%piece(1), pair, best, edges)
        if (best < 0.0_dp) worst = max(worst, abs(found%distance - best))
        if (edges .and. best < 0.0_dp) by_edges = by_edges + 1
        if (best < 0.0_dp) beside = max(beside, outside(a%piece(1), b%piece(1), pair, found))
        way(:) = 0.3_dp*u%x
        call put_pair(a, bar, way, random_turn(draws), pair)
        call find_least_separation(a%piece(1), bar%piece(1), pair, found)
        call try_all_axes(a%piece(1), bar%piece(1), pair, best, edges)
        if (best < 0.0_dp) worst = max(worst, abs(found%distance - best))
      end associate
    end do
    call check_close(worst, 0.0_dp, 1.0e-12_dp, "no axis separates more")
    call check_close(beside, 0.0_dp, 1.0e-12_dp, "the points of the contact are on both hulls")
    call check(by_edges > 50, "some of them are common normals of edges")
  end subroutine test_all_axes

  !> Cubes turned at random over an edge of a long sheet without a thickness. Its two faces have opposite normals, which do not tell
  !> on which side of the sheet an edge is: the edge that is met is the near one, and not that on the other side, which is parallel.
  subroutine test_edge_of_sheet()
    integer, parameter :: trials = 400
    !> of the sheet along x and y
    real(dp), parameter :: long = 4.0_dp, wide = 50.0_dp
    type(draws_t) :: draws
    type(turn_t) :: turn
    type(convex_piece_t) :: sheet
    type(placed_pair_t) :: pair
    type(core_distance_t) :: found
    real(dp) :: place(3), x(3), best, worst, beside
    integer :: trial, by_edges
    logical :: edges

    sheet%vertex = reshape([-long, -wide, 0.0_dp, 0.0_dp, -wide, 0.0_dp, 0.0_dp, wide, 0.0_dp, -long, wide, 0.0_dp], [3, 4])
    sheet%corner = sheet%vertex
    sheet%face_first = [1, 5, 9]
    sheet%face_vertex = [1, 2, 3, 4, 4, 3, 2, 1]
    sheet%neighbour_first = [1, 3, 5, 7, 9]
    sheet%neighbour = [2, 4, 1, 3, 2, 4, 1, 3]
    call list_faces(sheet)
    sheet%face_normal = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, -1.0_dp], [3, 2])
    draws%seed = 5
    worst = 0.0_dp
    beside = 0.0_dp
    by_edges = 0
    do trial = 1, trials
      turn = random_turn(draws)
      pair = placed_pair_t()
      pair%rotation(:, :) = turn%m
      place(1) = draws%between(0.0_dp, 1.5_dp*half)
      place(2) = draws%between(-wide + 2.0_dp, wide - 2.0_dp)
      place(3) = draws%between(-half, half)
      x(:) = matmul(turn%m, place)
      pair%way(:) = -x
      call find_least_separation(box%piece(1), sheet, pair, found)
      call try_all_axes(box%piece(1), sheet, pair, best, edges)
      if (best >= 0.0_dp) cycle
      worst = max(worst, abs(found%distance - best))
      if (edges) by_edges = by_edges + 1
      place(:) = found%point_b - pair%way
      x(:) = matmul(place, turn%m)
      beside = max(beside, outside(box%piece(1), sheet, pair, found), x(1), -long - x(1), abs(x(2)) - wide)
    end do
    call check_close(worst, 0.0_dp, 1.0e-12_dp, "edge of a sheet: no axis separates more")
    call check_close(beside, 0.0_dp, 1.0e-12_dp, "edge of a sheet: the points are on the cube and on the sheet")
    call check(by_edges > 50, "edge of a sheet: some are met by an edge of the cube")
  end subroutine test_edge_of_sheet

  !> How far the points of a contact are outside the cores that they belong to [m].
  pure real(dp) function outside(a, b, pair, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: found
    real(dp) :: x(3), out(3)
    integer :: f

    outside = 0.0_dp
    do f = 1, size(a%face_normal, 2)
      call place_a(a, pair, a%face_vertex(a%face_first(f)), x)
      outside = max(outside, dot_product(a%face_normal(:, f), found%point_a - x))
    end do
    do f = 1, size(b%face_normal, 2)
      call place_b(b, pair, b%face_vertex(b%face_first(f)), x)
      out(:) = matmul(pair%rotation, b%face_normal(:, f))
      outside = max(outside, dot_product(out, found%point_b - x))
    end do
  end function outside

  !> The greatest separation of all axes that can be it.
  subroutine try_all_axes(a, b, pair, best, edges)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    real(dp), intent(out) :: best
    !> whether it is that of two edges, clearly more than that of any face
    logical, intent(out) :: edges
    real(dp) :: u(3), v(3), n(3), of_faces
    integer :: f, i, j, k, l

    best = -huge(1.0_dp)
    do f = 1, size(a%face_normal, 2)
      n(:) = -a%face_normal(:, f)
      best = max(best, separation(a, b, pair, n))
    end do
    do f = 1, size(b%face_normal, 2)
      n(:) = matmul(pair%rotation, b%face_normal(:, f))
      best = max(best, separation(a, b, pair, n))
    end do
    of_faces = best
    do i = 1, size(a%vertex, 2)
      do k = a%neighbour_first(i), a%neighbour_first(i + 1) - 1
        u(:) = a%vertex(:, a%neighbour(k)) - a%vertex(:, i)
        do j = 1, size(b%vertex, 2)
          do l = b%neighbour_first(j), b%neighbour_first(j + 1) - 1
            n(:) = b%vertex(:, b%neighbour(l)) - b%vertex(:, j)
            v(:) = matmul(pair%rotation, n)
            n(1) = u(2)*v(3) - u(3)*v(2)
            n(2) = u(3)*v(1) - u(1)*v(3)
            n(3) = u(1)*v(2) - u(2)*v(1)
            if (norm2(n) <= 1.0e-6_dp*norm2(u)*norm2(v)) cycle
            n(:) = n/norm2(n)
            best = max(best, separation(a, b, pair, n))
          end do
        end do
      end do
    end do
    edges = best > of_faces + 1.0e-6_dp
  end subroutine try_all_axes

  !> How far a lies beyond b along an axis, below 0 where they overlap.
  real(dp) function separation(a, b, pair, n)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    real(dp), intent(in) :: n(3)
    real(dp) :: x(3), low, high
    integer :: v

    low = huge(1.0_dp)
    do v = 1, size(a%vertex, 2)
      call place_a(a, pair, v, x)
      low = min(low, dot_product(n, x))
    end do
    high = -huge(1.0_dp)
    do v = 1, size(b%vertex, 2)
      call place_b(b, pair, v, x)
      high = max(high, dot_product(n, x))
    end do
    separation = low - high
  end function separation

end program test_core_overlap
