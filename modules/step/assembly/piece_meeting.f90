!> Where two convex pieces touch, each of a body or a sheet: in the plane or in space.
module gravier_piece_meeting
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t
  use gravier_shape_library, only: of_face
  use gravier_manifold, only: manifold_t
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_polygon_manifold
  use gravier_polyhedron_pair, only: find_polyhedron_manifold
  use gravier_seen_body, only: seen_body_t, turn_manifold
  implicit none
  private
  public :: room_t, meet_pieces

  !> Room for two placed pieces of the plane, made once for many pairs.
  type :: room_t
    type(placed_piece_t) :: a, b
  end type room_t

contains

  !> The points of a piece of body a, the candidate, and a piece of body b, in global axes.
  subroutine meet_pieces(piece_a, piece_b, a, b, alert, room, manifold)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    !> points with a larger gap are no contacts [m]
    real(dp), intent(in) :: alert
    type(room_t), intent(inout) :: room
    type(manifold_t), intent(inout) :: manifold

    if (size(piece_a%vertex, 1) == 2) then
      call place_piece(piece_a%vertex, piece_a%corner, piece_a%rounding, a%radius, a%angle, a%centre(1:2), room%a)
      call place_piece(piece_b%vertex, piece_b%corner, piece_b%rounding, b%radius, b%angle, b%centre(1:2), room%b)
      call find_polygon_manifold(room%a, room%b, alert, manifold)
    else
      call meet_in_space(piece_a, piece_b, a, b, alert, manifold)
    end if
  end subroutine meet_pieces

  !> The same in space.
  subroutine meet_in_space(piece_a, piece_b, a, b, alert, manifold)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    real(dp), intent(in) :: alert
    type(manifold_t), intent(inout) :: manifold
    type(placed_pair_t) :: pair
    integer :: k, l

    pair%radius_a = a%radius
    pair%radius_b = b%radius
    do k = 1, 3
      pair%way(k) = sum(a%axes(:, k)*b%centre)
      do l = 1, 3
        pair%rotation(k, l) = sum(a%axes(:, k)*b%axes(:, l))
      end do
    end do
    call find_polyhedron_manifold(piece_a, piece_b, pair, alert, of_face, manifold)
    call turn_manifold(a%axes, manifold)
  end subroutine meet_in_space

end module gravier_piece_meeting
