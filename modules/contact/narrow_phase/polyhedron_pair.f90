!> Contacts of two rounded convex pieces in space, and of a piece and a half-space.
!>
!> The normal is the direction of the shortest way between the cores, which is continuous in their places. Where both pieces lie
!> along the plane of contact with a face or an edge, the contact is a patch: the common part of both, seen along the normal.
!> Neither face is the reference, so that nothing changes where parallel faces swap their roles. Other pieces touch in one point.
module gravier_polyhedron_pair
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t, find_support, looks_along, first_of_corner
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance
  use gravier_core_overlap, only: find_least_separation
  use gravier_contact_feature, only: placement_t, feature_t, frame_t, find_feature, lay_out_feature, edge_number, face_number, &
    & turn_back
  use gravier_contact_patch, only: patch_point_t, add_point, leave_corners, fill_manifold
  use gravier_edge_patch, only: add_edge_points
  use gravier_face_patch, only: add_face_points
  use gravier_manifold, only: manifold_t, feature_base
  implicit none
  private
  public :: find_polyhedron_manifold, find_halfspace_manifold, find_patch
  public :: make_frame, needs_exact, number_of, same_gap

  real(dp), parameter :: unturned(3, 3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
  real(dp), parameter :: origin(3) = 0.0_dp
  !> the exact point is kept beside a patch where it is deeper by this part of both roundings: blended corners make less of a
  !> difference
  real(dp), parameter :: deeper = 0.02_dp
  !> points whose gaps differ by less than this part of the roundings are equally deep
  real(dp), parameter :: same_gap = 0.01_dp

contains

  !> The contacts of two pieces, in the axes of the first.
  pure subroutine find_polyhedron_manifold(a, b, pair, alert, most, manifold)
    type(convex_piece_t), intent(in) :: a, b
    !> where they are, with the radii that their lengths are multiplied by
    type(placed_pair_t), intent(in) :: pair
    !> points whose gap is this or more are no contacts [m]
    real(dp), intent(in) :: alert
    !> points wanted at most: 4, or up to most_points
    integer, intent(in) :: most
    !> from the centre of a, in its axes; what it held is lost
    type(manifold_t), intent(inout) :: manifold
    type(core_distance_t) :: found
    real(dp) :: reach

    manifold%n = 0
    manifold%cores_overlap = .false.
    if (dot_product(pair%way, pair%way) >= (pair%radius_a + pair%radius_b + max(alert, 0.0_dp))**2) return
    reach = pair%radius_a*a%rounding + pair%radius_b*b%rounding
    call find_core_distance(a, b, pair, max(0.0_dp, reach + alert), found)
    if (found%beyond) return
    if (found%overlap) call find_least_separation(a, b, pair, found)
    if (.not. found%distance - reach < alert) return
    manifold%cores_overlap = found%overlap
    manifold%normal(:) = found%normal
    call find_patch(a, b, pair, found, alert, most, manifold)
  end subroutine find_polyhedron_manifold

  !> The points of a manifold from the features that the nearest points are in.
  pure subroutine find_patch(a, b, pair, found, alert, most, manifold)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: found
    real(dp), intent(in) :: alert
    integer, intent(in) :: most
    type(manifold_t), intent(inout) :: manifold
    type(placement_t) :: at_b
    type(feature_t) :: feature_a, feature_b
    type(frame_t) :: frame
    type(patch_point_t) :: point(2*(a%largest_face + b%largest_face) + 1), exact
    real(dp) :: along(3), rounding(2)
    integer :: n

    rounding(1) = pair%radius_a*a%rounding
    rounding(2) = pair%radius_b*b%rounding
    along(:) = -found%normal
    call find_feature(a, along, found%vertex_a(1:found%n), feature_a)
    feature_a%at = placement_t(pair%radius_a, unturned, origin)
    at_b = placement_t(pair%radius_b, pair%rotation, pair%way)
    call turn_back(at_b, found%normal, along)
    call find_feature(b, along, found%vertex_b(1:found%n), feature_b)
    feature_b%at = at_b
    call make_frame(found, alert, frame)
    n = 0
    associate (scale => min(pair%radius_a, pair%radius_b))
      if (feature_a%n > 1 .and. feature_b%n > 1) then
        if (feature_a%n == 2 .and. feature_b%n == 2) then
          call add_edge_points(a, b, feature_a, feature_b, frame, n, point)
        else
          call add_face_points(a, b, feature_a, feature_b, frame, n, point)
          if (pair%straight > 0.0_dp) call leave_corners(pair%straight*scale, min(feature_a%n, feature_b%n), n, point)
        end if
      end if
      exact%gap = found%distance - rounding(1) - rounding(2)
      if (needs_exact(exact%gap, sum(rounding), n, point)) then
        exact%place(1:2) = 0.0_dp
        exact%place(3) = 0.5_dp*(rounding(2) - rounding(1))
        exact%key = number_of(a, feature_a)*feature_base + number_of(b, feature_b)
        call add_point(exact, alert, scale, n, point)
      end if
      call fill_manifold(frame, scale, same_gap*sum(rounding), most, n, point, manifold)
    end associate
  end subroutine find_patch

  !> Whether the nearest points are deeper than what a patch has.
  pure logical function needs_exact(gap, reach, n, point)
    real(dp), intent(in) :: gap, reach
    integer, intent(in) :: n
    type(patch_point_t), intent(in) :: point(:)
    integer :: k

    needs_exact = .true.
    do k = 1, n
      needs_exact = needs_exact .and. gap < point(k)%gap - deeper*reach
    end do
  end function needs_exact

  !> Number of a feature among those of a piece. The vertices of a corner have one number.
  pure integer function number_of(piece, feature)
    type(convex_piece_t), intent(in) :: piece
    type(feature_t), intent(in) :: feature

    number_of = first_of_corner(piece, feature%vertex) - 1
    if (feature%other > 0) number_of = edge_number(piece, feature%vertex, feature%other)
    if (feature%face > 0) number_of = face_number(piece, feature%face)
  end function number_of

  !> A frame with the normal of the nearest points, from half-way between them.
  pure subroutine make_frame(found, alert, frame)
    type(core_distance_t), intent(in) :: found
    !> [m]
    real(dp), intent(in) :: alert
    type(frame_t), intent(out) :: frame

    frame%origin(:) = 0.5_dp*(found%point_a + found%point_b)
    frame%normal(:) = found%normal
    frame%alert = alert
    call find_tangents(frame)
  end subroutine make_frame

  !> Two axes across the normal of a frame, right-handed with it (Duff et al., J. Comput. Graph. Tech. 6 (2017) 1).
  pure subroutine find_tangents(frame)
    type(frame_t), intent(inout) :: frame
    real(dp) :: s, p, q

    associate (n => frame%normal)
      s = sign(1.0_dp, n(3))
      p = -1.0_dp/(s + n(3))
      q = n(1)*n(2)*p
      frame%first(1) = 1.0_dp + s*n(1)*n(1)*p
      frame%first(2) = s*q
      frame%first(3) = -s*n(1)
      frame%second(1) = q
      frame%second(2) = s + n(2)*n(2)*p
      frame%second(3) = -n(2)
    end associate
  end subroutine find_tangents

  !> The contacts of a piece and a half-space, in the axes of the piece: blended corners of the face or edge that lies along the
  !> plane, and all other corners of this side that are near enough, each with its lowest vertex. Keys are those of the piece's
  !> vertices.
  pure subroutine find_halfspace_manifold(a, radius, normal, distance, alert, most, manifold)
    type(convex_piece_t), intent(in) :: a
    !> what the lengths of the piece are multiplied by [m]
    real(dp), intent(in) :: radius
    !> of the plane, out of the half-space, in the axes of the piece
    real(dp), intent(in) :: normal(3)
    !> of the piece's centre from the plane [m]
    real(dp), intent(in) :: distance
    real(dp), intent(in) :: alert
    integer, intent(in) :: most
    !> from the centre of the piece, in its axes; what it held is lost
    type(manifold_t), intent(inout) :: manifold
    type(placement_t) :: at
    type(feature_t) :: feature
    type(frame_t) :: frame
    type(patch_point_t) :: point(a%largest_face + size(a%vertex, 2))
    integer :: vertex(a%largest_face), n, m, k, lowest(1)
    real(dp) :: place(3, a%largest_face), along(3), x(3), corner(3)

    manifold%n = 0
    manifold%cores_overlap = .false.
    if (.not. distance - radius < alert) return
    manifold%normal(:) = normal
    at = placement_t(radius, unturned, origin)
    frame%origin(:) = 0.0_dp
    frame%normal(:) = normal
    call find_tangents(frame)
    along(:) = -normal
    call find_support(a, along, lowest(1))
    call find_feature(a, along, lowest, feature)
    feature%at = at
    if (feature%n > 1) then
      call lay_out_feature(a, feature, frame, m, vertex, place)
    else
      m = 0
    end if
    n = 0
    do k = 1, size(a%vertex, 2)
      x(:) = radius*a%vertex(:, k)
      corner(3) = dot_product(x, normal)
      ! most vertices are far from the plane
      if (.not. corner(3) + distance - radius*a%rounding < alert) cycle
      if (any(vertex(1:m) == k)) cycle
      if (k /= lowest(1) .and. .not. looks_along(a, k, along)) cycle
      corner(1) = dot_product(x, frame%first)
      corner(2) = dot_product(x, frame%second)
      call add_point(point_of(k, corner), alert, radius, n, point)
    end do
    do k = 1, m
      call add_point(point_of(vertex(k), place(:, k)), alert, radius, n, point)
    end do
    call fill_manifold(frame, radius, same_gap*radius*a%rounding, most, n, point, manifold)
    do k = 1, manifold%n
      manifold%cores_overlap = manifold%cores_overlap .or. manifold%gap(k) < -radius*a%rounding
    end do

  contains

    !> A corner of the piece.
    pure function point_of(v, corner) result(new)
      integer, intent(in) :: v
      !> in the frame
      real(dp), intent(in) :: corner(3)
      type(patch_point_t) :: new

      new%gap = corner(3) + distance - radius*a%rounding
      new%place(1:2) = corner(1:2)
      new%place(3) = -distance + 0.5_dp*new%gap
      ! of points with one key the deepest counts
      new%key = (first_of_corner(a, v) - 1)*feature_base
    end function point_of

  end subroutine find_halfspace_manifold

end module gravier_polyhedron_pair
