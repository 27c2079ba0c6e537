!> Where two convex pieces touch, each of a body or a sheet: in the plane or in space.
module gravier_piece_meeting
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance
  use gravier_shape_library, only: face_points
  use gravier_manifold, only: manifold_t
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_polygon_manifold, find_shortest_way
  use gravier_polyhedron_pair, only: find_polyhedron_manifold
  use gravier_seen_body, only: seen_body_t, turn_manifold
  implicit none
  private
  public :: room_t, nearest_t, meet_pieces, find_nearest_points

  !> Room for two placed pieces of the plane, made once for many pairs.
  type :: room_t
    type(placed_piece_t) :: a, b
    !> of placed_pair_t
    real(dp) :: straight = 0.0_dp
  end type room_t

  !> Where two pieces are nearest, in global axes.
  type :: nearest_t
    !> the cores overlap: the rest is not known
    logical :: overlap = .false.
    !> between the surfaces [m]
    real(dp) :: gap = 0.0_dp
    !> unit vector from the second piece to the first, and a point between the nearest ones [m]
    real(dp) :: normal(3) = 0.0_dp, point(3) = 0.0_dp
  end type nearest_t

contains

  !> The points of a piece of body a, the candidate, and a piece of body b, in global axes.
  subroutine meet_pieces(piece_a, piece_b, a, b, alert, room, manifold)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    !> points with a larger gap are no contacts [m]
    real(dp), intent(in) :: alert
    type(room_t), intent(inout) :: room
    type(manifold_t), intent(inout) :: manifold
    type(placed_pair_t) :: pair

    if (size(piece_a%vertex, 1) == 2) then
      call place_in_plane(piece_a, piece_b, a, b, room)
      call find_polygon_manifold(room%a, room%b, alert, manifold)
    else
      call place_in_space(a, b, pair)
      pair%straight = room%straight
      call find_polyhedron_manifold(piece_a, piece_b, pair, alert, max(face_points(piece_a), face_points(piece_b)), manifold)
      call turn_manifold(a%axes, manifold)
    end if
  end subroutine meet_pieces

  !> The nearest points of the same two pieces.
  subroutine find_nearest_points(piece_a, piece_b, a, b, room, near)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    type(room_t), intent(inout) :: room
    type(nearest_t), intent(out) :: near
    type(placed_pair_t) :: pair
    type(core_distance_t) :: found
    real(dp) :: on_a(2), on_b(2), middle(3)
    integer :: d

    if (size(piece_a%vertex, 1) == 2) then
      call place_in_plane(piece_a, piece_b, a, b, room)
      call find_shortest_way(room%a, room%b, near%overlap, near%normal(1:2), near%gap, on_a, on_b)
      near%point(1:2) = 0.5_dp*(on_a + on_b)
    else
      call place_in_space(a, b, pair)
      call find_core_distance(piece_a, piece_b, pair, huge(1.0_dp), found)
      near%overlap = found%overlap
      near%gap = found%distance
      middle(:) = 0.5_dp*(found%point_a + found%point_b)
      do d = 1, 3
        near%normal(d) = sum(a%axes(d, :)*found%normal)
        near%point(d) = sum(a%axes(d, :)*middle)
      end do
    end if
    near%gap = near%gap - a%radius*piece_a%rounding - b%radius*piece_b%rounding
  end subroutine find_nearest_points

  !> Put two pieces of the plane in their places.
  subroutine place_in_plane(piece_a, piece_b, a, b, room)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    type(room_t), intent(inout) :: room

    room%a%reaches_out = piece_a%reaches_out
    room%b%reaches_out = piece_b%reaches_out
    call place_piece(piece_a%vertex, piece_a%corner, piece_a%rounding, a%radius, a%angle, a%centre(1:2), room%a)
    call place_piece(piece_b%vertex, piece_b%corner, piece_b%rounding, b%radius, b%angle, b%centre(1:2), room%b)
  end subroutine place_in_plane

  !> Where body b is in the axes of body a.
  pure subroutine place_in_space(a, b, pair)
    type(seen_body_t), intent(in) :: a, b
    type(placed_pair_t), intent(out) :: pair
    integer :: k, l

    pair%radius_a = a%radius
    pair%radius_b = b%radius
    do k = 1, 3
      pair%way(k) = sum(a%axes(:, k)*b%centre)
      do l = 1, 3
        pair%rotation(k, l) = sum(a%axes(:, k)*b%axes(:, l))
      end do
    end do
  end subroutine place_in_space

end module gravier_piece_meeting
