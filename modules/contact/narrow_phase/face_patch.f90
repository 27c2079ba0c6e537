!> Contacts of a face and a face, or of a face and an edge: corners of their common part, seen along the normal.
module gravier_face_patch
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_contact_feature, only: feature_t, frame_t, lay_out_feature, edge_number, face_number
  use gravier_contact_patch, only: patch_point_t, add_point
  use gravier_manifold, only: feature_base
  use gravier_polygon_clip, only: clip_polygon, room_for_clip, one_place
  implicit none
  private
  public :: add_face_points

  !> corners this near, in parts of the size of the pair, are at one place
  real(dp), parameter :: equal = 1.0e-5_dp

  !> A feature laid out across the normal.
  type :: laid_out_t
    !> height above the origin, and slope, of its plane or line
    real(dp) :: height = 0.0_dp, slope(2) = 0.0_dp
    !> corners this near are at one place, as some are
    real(dp) :: least = 0.0_dp
    logical :: joined = .false.
    !> number of its face, or of its edge, among the features of its piece
    integer :: number = 0
    !> the face, or 0
    integer :: face = 0
  end type laid_out_t

contains

  !> Add the corners of the common part of two features, of which one at least is a face and the other an edge or a face.
  pure subroutine add_face_points(a, b, feature_a, feature_b, frame, n, point)
    type(convex_piece_t), intent(in) :: a, b
    type(feature_t), intent(in) :: feature_a, feature_b
    type(frame_t), intent(in) :: frame
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    real(dp) :: x(3, feature_a%n), y(3, feature_b%n), room
    real(dp) :: place(2, room_for_clip(feature_a%n, feature_b%n)), height_a, height_b, reach_a, reach_b
    integer :: v(feature_a%n), w(feature_b%n), label(size(place, 2)), na, nb, m, k, key(2)
    type(laid_out_t) :: plane_a, plane_b
    type(patch_point_t) :: new

    call lay_out_feature(a, feature_a, frame, na, v, x)
    call lay_out_feature(b, feature_b, frame, nb, w, y)
    call find_plane(a, feature_a, frame, x, plane_a)
    call find_plane(b, feature_b, frame, y, plane_b)
    plane_a%joined = has_joined(x(:, 1:na), plane_a%least)
    plane_b%joined = has_joined(y(:, 1:nb), plane_b%least)
    ! seen along the normal, faces of a turn the other way round than those of b
    if (feature_b%n > 2) then
      call clip_polygon(x(:, 1:na), y(:, 1:nb), 1.0_dp, plane_b%least, m, place, label)
    else
      call clip_polygon(y(:, 1:nb), x(:, 1:na), -1.0_dp, plane_a%least, m, place, label)
      label(1:m) = -label(1:m)
    end if
    room = equal*min(feature_a%at%radius, feature_b%at%radius)
    reach_a = feature_a%at%radius*a%rounding
    reach_b = feature_b%at%radius*b%rounding
    do k = 1, m
      call name_corner(label(merge(m, k - 1, k == 1)), label(k), x(:, 1:na), y(:, 1:nb), room, place(:, k), key)
      if (key(1) > 0 .and. key(2) > 0) then
        if (is_idle(place, m, k, room)) cycle
      end if
      height_a = plane_a%height + dot_product(plane_a%slope, place(:, k))
      height_b = plane_b%height + dot_product(plane_b%slope, place(:, k))
      new%place(1:2) = place(:, k)
      new%place(3) = 0.5_dp*(height_a - reach_a + height_b + reach_b)
      new%gap = height_a - height_b - reach_a - reach_b
      if (.not. new%gap < frame%alert) cycle
      new%key = number_of(a, v(1:na), x(:, 1:na), plane_a, key(1))*feature_base
      new%key = new%key + number_of(b, w(1:nb), y(:, 1:nb), plane_b, key(2))
      call add_point(new, frame%alert, min(feature_a%at%radius, feature_b%at%radius), n, point)
    end do
  end subroutine add_face_points

  !> Height and slope of the plane of a face, or of the line of an edge.
  pure subroutine find_plane(piece, feature, frame, x, plane)
    type(convex_piece_t), intent(in) :: piece
    type(feature_t), intent(in) :: feature
    type(frame_t), intent(in) :: frame
    !> corners in the frame (3, n)
    real(dp), intent(in) :: x(:, :)
    type(laid_out_t), intent(out) :: plane
    real(dp) :: normal(3), way(2), core(3)
    integer :: k

    plane%least = one_place*feature%at%radius
    if (feature%face > 0) then
      associate (u => piece%face_normal(:, feature%face), x => piece%vertex(:, feature%vertex), at => feature%at)
        do k = 1, 3
          normal(k) = at%rotation(k, 1)*u(1) + at%rotation(k, 2)*u(2) + at%rotation(k, 3)*u(3)
          ! the vertex of the nearest points lies in the face, so that the gap there is exact
          core(k) = at%centre(k) - frame%origin(k) + at%radius*(at%rotation(k, 1)*x(1) + at%rotation(k, 2)*x(2) + &
            & at%rotation(k, 3)*x(3))
        end do
      end associate
      plane%slope(1) = -dot_product(normal, frame%first)/dot_product(normal, frame%normal)
      plane%slope(2) = -dot_product(normal, frame%second)/dot_product(normal, frame%normal)
      plane%number = face_number(piece, feature%face)
      plane%face = feature%face
      way(1) = dot_product(core, frame%first)
      way(2) = dot_product(core, frame%second)
      plane%height = dot_product(core, frame%normal) - dot_product(plane%slope, way)
    else
      way(:) = x(1:2, 2) - x(1:2, 1)
      if (dot_product(way, way) > 0.0_dp) plane%slope(:) = (x(3, 2) - x(3, 1))/dot_product(way, way)*way
      plane%number = edge_number(piece, feature%vertex, feature%other)
      plane%height = x(3, 1) - dot_product(plane%slope, x(1:2, 1))
    end if
  end subroutine find_plane

  !> What a corner of the common part is on each piece: a corner k of its feature as -k, a side as k, anything within as 0. Corners
  !> of both that are at one place, and ends of sides near a crossing, are taken for corners, first of a: so a name does not depend
  !> on which of two corners at one place is by rounding within the other piece.
  pure subroutine name_corner(before, behind, x, y, room, place, key)
    !> sides that meet there: of a above 0, of b below
    integer, intent(in) :: before, behind
    !> corners of both features
    real(dp), intent(in) :: x(:, :), y(:, :), room
    real(dp), intent(inout) :: place(2)
    integer, intent(out) :: key(2)
    integer :: near_a, near_b

    near_a = 0
    near_b = 0
    if (before > 0 .and. behind > 0) then
      near_a = nearest_end(x, place, before, behind, huge(room))
      place(:) = x(1:2, near_a)
    else if (before < 0 .and. behind < 0) then
      near_b = nearest_end(y, place, -before, -behind, huge(room))
      place(:) = y(1:2, near_b)
      near_a = nearest_corner(x, place, room)
    else
      near_a = nearest_end(x, place, max(before, behind), max(before, behind), room)
      if (near_a == 0) near_b = nearest_end(y, place, -min(before, behind), -min(before, behind), room)
    end if
    if (near_a > 0) then
      key(1) = -near_a
      key(2) = 0
    else if (near_b > 0) then
      key(1) = 0
      key(2) = -near_b
    else
      key(1) = max(before, behind)
      key(2) = -min(before, behind)
    end if
    if (size(x, 2) == 2 .and. key(1) == 0) key(1) = 1
    if (size(y, 2) == 2 .and. key(2) == 0) key(2) = 1
  end subroutine name_corner

  !> The end of one of two sides that is nearest to a place, 0 if it is not within a distance.
  pure integer function nearest_end(x, place, one, other, room) result(near)
    real(dp), intent(in) :: x(:, :), place(2), room
    integer, intent(in) :: one, other
    integer :: ends(4), k
    real(dp) :: nearest, found

    ends(1) = one
    ends(2) = mod(one, size(x, 2)) + 1
    ends(3) = other
    ends(4) = mod(other, size(x, 2)) + 1
    near = 0
    nearest = room
    do k = 1, 4
      found = norm2(x(1:2, ends(k)) - place)
      if (found > nearest .or. (found >= nearest .and. near > 0)) cycle
      nearest = found
      near = ends(k)
    end do
  end function nearest_end

  !> The first corner within a distance of a place, or 0.
  pure integer function nearest_corner(x, place, room) result(near)
    real(dp), intent(in) :: x(:, :), place(2), room
    integer :: k

    near = 0
    do k = 1, size(x, 2)
      if (norm2(x(1:2, k) - place) > room) cycle
      near = k
      return
    end do
  end function nearest_corner

  !> Whether a crossing lies on the line from the corner before it to that behind it, as where two sides lie along each other.
  pure logical function is_idle(place, n, k, room)
    real(dp), intent(in) :: place(:, :), room
    integer, intent(in) :: n, k
    real(dp) :: u(2), v(2), long_u, long_v

    is_idle = .false.
    if (n < 3) return
    u(:) = place(:, merge(n, k - 1, k == 1)) - place(:, k)
    v(:) = place(:, merge(1, k + 1, k == n)) - place(:, k)
    long_u = norm2(u)
    long_v = norm2(v)
    if (min(long_u, long_v) <= 2*room .or. dot_product(u, v) >= 0.0_dp) return
    is_idle = abs(u(1)*v(2) - u(2)*v(1)) <= room*min(long_u, long_v)
  end function is_idle

  !> Number of what name_corner found among the features of a piece. Corners at one place have the lowest number of their vertices:
  !> rounding decides which of them is found. A side has the number of the edge that begins at its first corner in the face.
  pure integer function number_of(piece, vertex, x, plane, name)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: vertex(:), name
    !> corners
    real(dp), intent(in) :: x(:, :)
    type(laid_out_t), intent(in) :: plane
    integer :: k

    if (name < 0) then
      number_of = vertex(-name) - 1
      if (.not. plane%joined) return
      do k = 1, size(vertex)
        if (max(abs(x(1, k) - x(1, -name)), abs(x(2, k) - x(2, -name))) > plane%least) cycle
        number_of = min(number_of, vertex(k) - 1)
      end do
    else if (name > 0 .and. size(vertex) > 2) then
      number_of = edge_number(piece, vertex(name), behind(piece, plane%face, vertex(name), name))
    else
      number_of = plane%number
    end if
  end function number_of

  !> Whether some corner is at the place of the one before it.
  pure logical function has_joined(x, least)
    real(dp), intent(in) :: x(:, :), least
    integer :: k, before

    has_joined = .false.
    before = size(x, 2)
    do k = 1, size(x, 2)
      has_joined = has_joined .or. max(abs(x(1, k) - x(1, before)), abs(x(2, k) - x(2, before))) <= least
      before = k
    end do
  end function has_joined

  !> The vertex behind another one in a face.
  pure integer function behind(piece, face, vertex, place)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: face, vertex
    !> of that one among the corners, if none before it is left out
    integer, intent(in) :: place
    integer :: k

    associate (first => piece%face_first(face), last => piece%face_first(face + 1) - 1)
      k = first + place - 1
      if (piece%face_vertex(k) /= vertex) then
        do k = first, last
          if (piece%face_vertex(k) == vertex) exit
        end do
      end if
      behind = piece%face_vertex(merge(first, k + 1, k >= last))
    end associate
  end function behind

end module gravier_face_patch
