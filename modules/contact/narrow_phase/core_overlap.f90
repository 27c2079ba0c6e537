!> The direction of least separation of two convex cores that overlap.
!>
!> Overlapping convex polyhedra are least separated along the normal of a face of one of them or along the common normal of two
!> edges. Pairs of edges come into question where the arcs of their normals cross (the Gauss map, Gregorius 2013). This is slow beside
!> the search for a distance, and is meant for the rare cores that overlap.
module gravier_core_overlap
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, support_a, support_b, place_a, place_b
  implicit none
  private
  public :: find_least_separation

  !> an axis is better than those before it if the separation is by this part of the sizes greater
  real(dp), parameter :: better = 1.0e-12_dp

  !> A piece's edges, and the normals of the faces at both sides of each.
  type :: edges_t
    integer :: n = 0
    !> (2, n)
    integer, allocatable :: vertex(:, :)
    !> (3, 2, n), 0 where there are no faces
    real(dp), allocatable :: normal(:, :, :)
  end type edges_t

contains

  !> Direction and depth for cores that overlap: distance <= 0, normal, points at both ends of the overlap along it.
  pure subroutine find_least_separation(a, b, pair, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(inout) :: found
    type(edges_t) :: edges_a, edges_b
    real(dp) :: n(3)
    integer :: f

    found%overlap = .true.
    found%distance = -huge(1.0_dp)
    do f = 1, size(a%face_normal, 2)
      n(:) = -a%face_normal(:, f)
      call try_axis(a, b, pair, n, found)
    end do
    do f = 1, size(b%face_normal, 2)
      call turn(pair, b%face_normal(:, f), n)
      call try_axis(a, b, pair, n, found)
    end do
    call find_edges(a, edges_a)
    call find_edges(b, edges_b)
    call try_edges(a, b, pair, edges_a, edges_b, found)
    if (found%distance > -huge(1.0_dp)) return
    ! cores without faces and without edges that cross
    call find_any_axis(pair, edges_a, edges_b, a, b, n)
    call try_axis(a, b, pair, n, found)
  end subroutine find_least_separation

  !> Take an axis where it is better than that before.
  pure subroutine try_axis(a, b, pair, n, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    !> unit vector
    real(dp), intent(in) :: n(3)
    type(core_distance_t), intent(inout) :: found
    real(dp) :: x(3), y(3), separation
    integer :: i, j
    logical :: walk

    i = 1
    j = 1
    ! walks are fast and bound the separation from above; all vertices tell it
    walk = .true.
    do
      call support_a(a, n, walk, i)
      call support_b(b, pair, n, walk, j)
      call place_a(a, pair, i, x)
      call place_b(b, pair, j, y)
      separation = dot_product(n, x) - dot_product(n, y)
      if (.not. separation > found%distance + better*(pair%radius_a + pair%radius_b)) return
      if (.not. walk) exit
      walk = .false.
    end do
    found%distance = separation
    found%normal(:) = n
    ! half-way between the two vertices, across the axis
    found%point_a(:) = 0.5_dp*(x + y) + 0.5_dp*separation*n
    found%point_b(:) = found%point_a - separation*n
    found%n = 1
    found%vertex_a(1) = i
    found%vertex_b(1) = j
    found%share(1) = 1.0_dp
  end subroutine try_axis

  !> Common normals of edges of both.
  pure subroutine try_edges(a, b, pair, edges_a, edges_b, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(edges_t), intent(in) :: edges_a, edges_b
    type(core_distance_t), intent(inout) :: found
    real(dp) :: along_a(3), along_b(3), side(3), n(3), x(3), y(3), bound, normal_b(3, 2), length
    integer :: i, j

    do j = 1, edges_b%n
      side(:) = b%vertex(:, edges_b%vertex(2, j)) - b%vertex(:, edges_b%vertex(1, j))
      call turn(pair, side, along_b)
      call place_b(b, pair, edges_b%vertex(1, j), y)
      call turn(pair, edges_b%normal(:, 1, j), normal_b(:, 1))
      call turn(pair, edges_b%normal(:, 2, j), normal_b(:, 2))
      do i = 1, edges_a%n
        along_a(:) = a%vertex(:, edges_a%vertex(2, i)) - a%vertex(:, edges_a%vertex(1, i))
        if (.not. arcs_cross(edges_a%normal(:, :, i), normal_b, along_a, along_b)) cycle
        n(1) = along_a(2)*along_b(3) - along_a(3)*along_b(2)
        n(2) = along_a(3)*along_b(1) - along_a(1)*along_b(3)
        n(3) = along_a(1)*along_b(2) - along_a(2)*along_b(1)
        length = norm2(n)
        if (length <= 1.0e-9_dp*norm2(along_a)*norm2(along_b)) cycle
        n(:) = n/length
        if (dot_product(n, pair%way) > 0.0_dp) n(:) = -n
        call place_a(a, pair, edges_a%vertex(1, i), x)
        ! any two points bound the separation from above
        bound = dot_product(n, x) - dot_product(n, y)
        if (bound > found%distance) call try_axis(a, b, pair, n, found)
        n(:) = -n
        if (-bound > found%distance) call try_axis(a, b, pair, n, found)
      end do
    end do
  end subroutine try_edges

  !> Whether a common normal of two edges may be one of both pieces: each edge crosses the plane between the normals beside the other,
  !> so that the arcs of these normals cross, or cross the opposite ones. An edge without faces has a full circle of normals.
  pure logical function arcs_cross(normal_a, normal_b, along_a, along_b)
    real(dp), intent(in) :: normal_a(3, 2), normal_b(3, 2), along_a(3), along_b(3)
    logical :: bare_a, bare_b

    bare_a = .not. dot_product(normal_a(:, 1), normal_a(:, 1)) > 0.0_dp
    bare_b = .not. dot_product(normal_b(:, 1), normal_b(:, 1)) > 0.0_dp
    arcs_cross = .true.
    if (.not. bare_a) arcs_cross = dot_product(along_b, normal_a(:, 1))*dot_product(along_b, normal_a(:, 2)) <= 0.0_dp
    if (.not. (bare_b .or. .not. arcs_cross)) arcs_cross = dot_product(along_a, normal_b(:, 1))*dot_product(along_a, &
      & normal_b(:, 2)) <= 0.0_dp
  end function arcs_cross

  !> An axis where nothing gives one: across both edges, else from centre to centre, else the third.
  pure subroutine find_any_axis(pair, edges_a, edges_b, a, b, n)
    type(placed_pair_t), intent(in) :: pair
    type(edges_t), intent(in) :: edges_a, edges_b
    type(convex_piece_t), intent(in) :: a, b
    real(dp), intent(out) :: n(3)
    real(dp) :: along(3), side(3), length
    integer :: k

    n(:) = -pair%way
    if (.not. norm2(n) > 0.0_dp) n(3) = 1.0_dp
    along(:) = 0.0_dp
    if (edges_a%n > 0) then
      along(:) = a%vertex(:, edges_a%vertex(2, 1)) - a%vertex(:, edges_a%vertex(1, 1))
    else if (edges_b%n > 0) then
      side(:) = b%vertex(:, edges_b%vertex(2, 1)) - b%vertex(:, edges_b%vertex(1, 1))
      call turn(pair, side, along)
    end if
    length = norm2(along)
    if (length > 0.0_dp) then
      along(:) = along/length
      k = minloc(abs(along), 1)
      if (norm2(n - dot_product(n, along)*along) <= 1.0e-6_dp*norm2(n)) then
        n(:) = 0.0_dp
        n(k) = 1.0_dp
      end if
      n(:) = n - dot_product(n, along)*along
    end if
    n(:) = n/norm2(n)
  end subroutine find_any_axis

  !> Edges of a piece with the normals of the faces beside them.
  pure subroutine find_edges(piece, edges)
    type(convex_piece_t), intent(in) :: piece
    type(edges_t), intent(out) :: edges
    integer :: f, k, v, w, e, n, number(size(piece%neighbour))

    n = size(piece%neighbour)/2
    allocate (edges%vertex(2, n), edges%normal(3, 2, n))
    edges%normal(:, :, :) = 0.0_dp
    number(:) = 0
    do v = 1, size(piece%vertex, 2)
      do k = piece%neighbour_first(v), piece%neighbour_first(v + 1) - 1
        if (piece%neighbour(k) < v) cycle
        edges%n = edges%n + 1
        edges%vertex(1, edges%n) = v
        edges%vertex(2, edges%n) = piece%neighbour(k)
        number(k) = edges%n
      end do
    end do
    do f = 1, size(piece%face_first) - 1
      do k = piece%face_first(f), piece%face_first(f + 1) - 1
        v = piece%face_vertex(k)
        w = piece%face_vertex(merge(piece%face_first(f), k + 1, k + 1 == piece%face_first(f + 1)))
        do e = piece%neighbour_first(min(v, w)), piece%neighbour_first(min(v, w) + 1) - 1
          if (piece%neighbour(e) == max(v, w)) edges%normal(:, merge(1, 2, v < w), number(e)) = piece%face_normal(:, f)
        end do
      end do
    end do
  end subroutine find_edges

  !> A direction of b in the axes of a.
  pure subroutine turn(pair, u, v)
    type(placed_pair_t), intent(in) :: pair
    real(dp), intent(in) :: u(3)
    real(dp), intent(out) :: v(3)
    integer :: k

    do k = 1, 3
      v(k) = pair%rotation(k, 1)*u(1) + pair%rotation(k, 2)*u(2) + pair%rotation(k, 3)*u(3)
    end do
  end subroutine turn

end module gravier_core_overlap
