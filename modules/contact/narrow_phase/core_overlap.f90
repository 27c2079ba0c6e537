!> The direction of least separation of two convex cores that overlap.
!>
!> Overlapping convex polyhedra are least separated along the normal of a face of one of them or along the common normal of two
!> edges. The points of the contact are those that touch once the pieces are apart by the depth: the vertex before the face, or
!> the nearest points of both edges. Pairs of edges come into question where the arcs of their normals cross (the Gauss map,
!> Gregorius 2013). Its cost grows with the product of the numbers of edges, so that it is meant for the rare cores that overlap.
module gravier_core_overlap
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, support_a, support_b, place_a, place_b
  implicit none
  private
  public :: find_least_separation, find_separation_by_faces

  !> an axis is better than those before it if the separation is by this part of the sizes greater
  real(dp), parameter :: better = 1.0e-12_dp

  !> the sine of the angle between edges that are taken for parallel
  real(dp), parameter :: parallel = 1.0e-9_dp
  !> whose faces have the axis, and with it the vertex of the other piece touches: of a, of b, of neither
  integer, parameter :: of_a = 1, of_b = 2, of_neither = 3
  !> less than any separation [m]
  real(dp), parameter :: nowhere = -huge(1.0_dp)
  !> a cosine whose sign rounding may have changed
  real(dp), parameter :: doubtful = 1.0e-9_dp

  !> A piece's edges, and the faces at both sides of each.
  type :: edges_t
    integer :: n = 0
    !> (2, n); of faces 0 where there are none
    integer, allocatable :: vertex(:, :), face(:, :)
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
      call try_axis(a, b, pair, n, of_a, nowhere, found)
    end do
    call try_faces_of_b(a, b, pair, found)
    call find_edges(a, edges_a)
    call find_edges(b, edges_b)
    call try_edges(a, b, pair, edges_a, edges_b, found)
    if (found%distance > -huge(1.0_dp)) return
    ! cores without faces and without edges that cross
    call find_any_axis(pair, edges_a, edges_b, a, b, n)
    call try_axis(a, b, pair, n, of_neither, nowhere, found)
  end subroutine find_least_separation

  !> The same where the normals of the faces of the second piece are the only directions.
  pure subroutine find_separation_by_faces(a, b, pair, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(inout) :: found

    found%overlap = .true.
    found%distance = -huge(1.0_dp)
    call try_faces_of_b(a, b, pair, found)
  end subroutine find_separation_by_faces

  pure subroutine try_faces_of_b(a, b, pair, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(inout) :: found
    real(dp) :: n(3)
    integer :: f

    do f = 1, size(b%face_normal, 2)
      call turn(pair, b%face_normal(:, f), n)
      call try_axis(a, b, pair, n, of_b, nowhere, found)
    end do
  end subroutine try_faces_of_b

  !> Take an axis where it is better than that before, and separates the pieces by no less than `least`.
  pure subroutine try_axis(a, b, pair, n, owner, least, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    !> unit vector
    real(dp), intent(in) :: n(3)
    !> of_a, of_b or of_neither
    integer, intent(in) :: owner
    !> [m]
    real(dp), intent(in) :: least
    type(core_distance_t), intent(inout) :: found
    real(dp) :: x(3), y(3), separation
    integer :: i, j

    call support_a(a, n, i)
    call support_b(b, pair, n, j)
    call place_a(a, pair, i, x)
    call place_b(b, pair, j, y)
    separation = dot_product(n, x) - dot_product(n, y)
    if (separation <= found%distance + better*(pair%radius_a + pair%radius_b) .or. separation < least) return
    found%distance = separation
    found%normal(:) = n
    select case (owner)
    case (of_a)
      found%point_a(:) = y + separation*n
    case (of_b)
      found%point_a(:) = x
    case default
      ! half-way between the two vertices, across the axis
      found%point_a(:) = 0.5_dp*(x + y) + 0.5_dp*separation*n
    end select
    found%point_b(:) = found%point_a - separation*n
    found%n = 1
    found%vertex_a(1) = i
    found%vertex_b(1) = j
    found%share(1) = 1.0_dp
  end subroutine try_axis

  !> Common normals of edges of both. A normal comes into question where the arcs of the normals of both edges cross, those of b
  !> seen from behind. The two edges are the outermost parts of their pieces along it, but for an edge of a flat piece: the normals
  !> of its two faces are opposite to each other, and do not tell on which side of the piece it is.
  pure subroutine try_edges(a, b, pair, edges_a, edges_b, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(edges_t), intent(in) :: edges_a, edges_b
    type(core_distance_t), intent(inout) :: found
    real(dp) :: along_a(3, edges_a%n), along_b(3), side(3), n(3), x(3), y(3), normal_b(3, 2), squared, bound, least, before
    !> of the edge of b against the faces of a; 0 for an edge that has none
    real(dp) :: slope(0:size(a%face_normal, 2))
    integer :: i, j, f, turned
    !> the edge of b is one of a flat piece
    logical :: is_flat

    do i = 1, edges_a%n
      along_a(:, i) = a%vertex(:, edges_a%vertex(2, i)) - a%vertex(:, edges_a%vertex(1, i))
    end do
    slope(0) = 0.0_dp
    do j = 1, edges_b%n
      side(:) = b%vertex(:, edges_b%vertex(2, j)) - b%vertex(:, edges_b%vertex(1, j))
      call turn(pair, side, along_b)
      call place_b(b, pair, edges_b%vertex(1, j), y)
      normal_b(:, :) = 0.0_dp
      do f = 1, 2
        if (edges_b%face(f, j) > 0) call turn(pair, b%face_normal(:, edges_b%face(f, j)), normal_b(:, f))
      end do
      is_flat = dot_product(normal_b(:, 1), normal_b(:, 2)) < doubtful - 1.0_dp
      do f = 1, size(a%face_normal, 2)
        slope(f) = along_b(1)*a%face_normal(1, f) + along_b(2)*a%face_normal(2, f) + along_b(3)*a%face_normal(3, f)
      end do
      do i = 1, edges_a%n
        if (slope(edges_a%face(1, i))*slope(edges_a%face(2, i)) > 0.0_dp) cycle
        if (dot_product(along_a(:, i), normal_b(:, 1))*dot_product(along_a(:, i), normal_b(:, 2)) > 0.0_dp) cycle
        n(1) = along_a(2, i)*along_b(3) - along_a(3, i)*along_b(2)
        n(2) = along_a(3, i)*along_b(1) - along_a(1, i)*along_b(3)
        n(3) = along_a(1, i)*along_b(2) - along_a(2, i)*along_b(1)
        squared = dot_product(n, n)
        if (squared <= parallel**2*dot_product(along_a(:, i), along_a(:, i))*dot_product(along_b, along_b)) cycle
        n(:) = n/sqrt(squared)
        call place_a(a, pair, edges_a%vertex(1, i), x)
        do turned = 1, 2
          ! any two points bound the separation from above, and outermost edges reach the bound; an edge on the far side of a flat
          ! piece does not
          bound = dot_product(n, x) - dot_product(n, y)
          if (bound > found%distance) then
            before = found%distance
            least = merge(bound - doubtful*(pair%radius_a*norm2(along_a(:, i)) + pair%radius_b*norm2(along_b)), nowhere, is_flat)
            if (faces_other(n, a, edges_a%face(:, i), normal_b)) call try_axis(a, b, pair, n, of_neither, least, found)
            if (found%distance > before) call meet_edges(pair, x, along_a(:, i), y, along_b, found)
          end if
          n(:) = -n
        end do
      end do
    end do
  end subroutine try_edges

  !> The points where two edges touch once they are apart by the depth: those where their lines are nearest to each other.
  pure subroutine meet_edges(pair, x, along_a, y, along_b, found)
    type(placed_pair_t), intent(in) :: pair
    !> where the edges of a and of b begin [m], and the ways along them for radii of 1; they are not parallel
    real(dp), intent(in) :: x(3), along_a(3), y(3), along_b(3)
    !> has the depth and the normal
    type(core_distance_t), intent(inout) :: found
    real(dp) :: u(3), w(3), uu, uw, ww, along_u, along_w, s, t

    u(:) = pair%radius_a*along_a
    w(:) = pair%radius_b*along_b
    uu = dot_product(u, u)
    uw = dot_product(u, w)
    ww = dot_product(w, w)
    along_u = dot_product(u, y - x)
    along_w = dot_product(w, y - x)
    s = (ww*along_u - uw*along_w)/(uu*ww - uw*uw)
    t = (uw*along_u - uu*along_w)/(uu*ww - uw*uw)
    s = max(0.0_dp, min(1.0_dp, s))
    t = max(0.0_dp, min(1.0_dp, t))
    found%point_a(:) = 0.5_dp*(x + s*u + y + t*w + found%distance*found%normal)
    found%point_b(:) = found%point_a - found%distance*found%normal
  end subroutine meet_edges

  !> Whether the normals of an edge of a point against a common normal and those of an edge of b along it. Otherwise the arc of one
  !> edge crosses the arc that is opposite to that of the other.
  pure logical function faces_other(n, a, face, normal_b)
    !> from b to a, a unit vector
    real(dp), intent(in) :: n(3)
    type(convex_piece_t), intent(in) :: a
    !> of a beside its edge, 0 where there is none
    integer, intent(in) :: face(2)
    !> of the faces of b beside its edge, 0 where there is none (3, 2)
    real(dp), intent(in) :: normal_b(:, :)
    real(dp) :: outward
    integer :: f

    outward = 0.0_dp
    do f = 1, 2
      if (face(f) > 0) outward = outward + dot_product(n, a%face_normal(:, face(f)))
    end do
    faces_other = outward <= doubtful .and. dot_product(n, normal_b(:, 1)) + dot_product(n, normal_b(:, 2)) >= -doubtful
  end function faces_other

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

  !> Edges of a piece with the faces beside them.
  pure subroutine find_edges(piece, edges)
    type(convex_piece_t), intent(in) :: piece
    type(edges_t), intent(out) :: edges
    integer :: f, k, v, w, e, n, number(size(piece%neighbour))

    n = size(piece%neighbour)/2
    allocate (edges%vertex(2, n), edges%face(2, n), source=0)
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
          if (piece%neighbour(e) == max(v, w)) edges%face(merge(1, 2, v < w), number(e)) = f
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
