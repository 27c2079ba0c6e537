!> The contact of a piece in space with a flat part of a wall that several facets make up: one patch, as with one face.
module gravier_flat_patch
  use gravier_kinds, only: dp
  use gravier_facet, only: find_facet_normal
  use gravier_convex_piece, only: convex_piece_t, list_faces
  use gravier_convex_distance, only: placed_pair_t, core_distance_t
  use gravier_contact_feature, only: placement_t, feature_t, frame_t, find_feature
  use gravier_contact_patch, only: patch_point_t, add_point, keep_outline, fill_manifold
  use gravier_face_patch, only: add_face_points
  use gravier_polyhedron_pair, only: make_frame, needs_exact, number_of, same_gap
  use gravier_manifold, only: manifold_t, feature_base
  implicit none
  private
  public :: make_facet_piece, set_facet_piece, lies_flat, find_flat_patch

  real(dp), parameter :: unturned(3, 3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
  real(dp), parameter :: origin(3) = 0.0_dp
  !> features of a triangle: corners, sides seen from both of their ends, two faces
  integer, parameter :: features_of_facet = 11, first_face = 9
  !> a point that is this near to the line of two others, in parts of the size of the piece, lies on it
  real(dp), parameter :: straight = 1.0e-5_dp

contains

  !> A triangle as a piece without rounding, with a face to either side; where it is comes later.
  pure subroutine make_facet_piece(sheet)
    type(convex_piece_t), intent(out) :: sheet

    allocate (sheet%vertex(3, 3), sheet%corner(3, 3), sheet%face_normal(3, 2), source=0.0_dp)
    sheet%face_first = [1, 4, 7]
    sheet%face_vertex = [1, 2, 3, 3, 2, 1]
    sheet%neighbour_first = [1, 3, 5, 7]
    sheet%neighbour = [2, 3, 1, 3, 1, 2]
    call list_faces(sheet)
  end subroutine make_facet_piece

  !> Make the piece the facet of three corners.
  pure subroutine set_facet_piece(corner, radius, sheet)
    !> (3, 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    !> what the lengths of the piece are to be multiplied by [m]
    real(dp), intent(in) :: radius
    !> of make_facet_piece
    type(convex_piece_t), intent(inout) :: sheet
    real(dp) :: normal(3)

    sheet%vertex(:, :) = corner/radius
    sheet%corner(:, :) = sheet%vertex
    call find_facet_normal(corner, normal)
    sheet%face_normal(:, 1) = normal
    sheet%face_normal(:, 2) = -normal
  end subroutine set_facet_piece

  !> Whether a facet lies along the plane of contact, so that the contact is with its face.
  pure logical function lies_flat(sheet, found)
    type(convex_piece_t), intent(in) :: sheet
    type(core_distance_t), intent(in) :: found
    type(feature_t) :: feature

    call find_feature(sheet, found%normal, found%vertex_b(1:found%n), feature)
    lies_flat = feature%face > 0
  end function lies_flat

  !> The manifold of a piece and the facets of a plane. The nearest points and the normal are those of one of them.
  pure subroutine find_flat_patch(a, radius, found, corner, alert, most, manifold)
    type(convex_piece_t), intent(in) :: a
    !> what the lengths of the piece are multiplied by [m]
    real(dp), intent(in) :: radius
    !> of the nearest facet, which is the first one
    type(core_distance_t), intent(in) :: found
    !> in the axes of the piece (3, 3, facets) [m]
    real(dp), intent(in), contiguous :: corner(:, :, :)
    real(dp), intent(in) :: alert
    !> points wanted at most
    integer, intent(in) :: most
    !> from the centre of the piece, in its axes; what it held is lost
    type(manifold_t), intent(inout) :: manifold
    type(convex_piece_t) :: sheet
    type(placement_t) :: at
    type(feature_t) :: feature_a, feature_b, nearest_b
    type(frame_t) :: frame
    type(patch_point_t) :: part(2*a%largest_face + 8), point(4*a%largest_face + 64), exact
    real(dp) :: along(3)
    integer :: n, m, f, k

    at = placement_t(radius, unturned, origin)
    call make_facet_piece(sheet)
    along(:) = -found%normal
    call find_feature(a, along, found%vertex_a(1:found%n), feature_a)
    feature_a%at = at
    call make_frame(found, alert, frame)
    n = 0
    do f = 1, size(corner, 3)
      call set_facet_piece(corner(:, :, f), radius, sheet)
      if (f == 1) then
        call find_feature(sheet, found%normal, found%vertex_b(1:found%n), feature_b)
        nearest_b = feature_b
      else
        call find_feature(sheet, found%normal, [1], feature_b)
      end if
      if (feature_a%n == 1) exit
      if (feature_b%face == 0) cycle
      m = 0
      feature_b%at = at
      call add_face_points(a, sheet, feature_a, feature_b, frame, m, part)
      do k = 1, m
        part(k)%key = name_in_plane(part(k)%key, f)
        call add_point(part(k), alert, radius, n, point)
      end do
      if (n > size(point)/2) call keep_outline(straight*radius, n, point)
    end do
    if (size(corner, 3) > 1) call keep_outline(straight*radius, n, point)
    exact%gap = found%distance - radius*a%rounding
    if (needs_exact(exact%gap, radius*a%rounding, n, point)) then
      exact%place(1:2) = 0.0_dp
      exact%place(3) = -0.5_dp*radius*a%rounding
      exact%key = number_of(a, feature_a)*feature_base + name_of(number_of(sheet, nearest_b), 1)
      call add_point(exact, alert, radius, n, point)
    end if
    manifold%normal(:) = found%normal
    call fill_manifold(frame, radius, same_gap*radius*a%rounding, most, n, point, manifold)
  end subroutine find_flat_patch

  !> The key of a point among those of all facets of a plane.
  pure integer function name_in_plane(key, f)
    !> of a point of facet f
    integer, intent(in) :: key, f
    name_in_plane = (key/feature_base)*feature_base + name_of(mod(key, feature_base), f)
  end function name_in_plane

  !> The number of a feature of facet f among those of all facets of a plane; all faces are one, whose number is 0.
  pure integer function name_of(feature, f)
    integer, intent(in) :: feature, f

    name_of = 0
    if (feature < first_face) name_of = mod(features_of_facet*f + feature, feature_base)
  end function name_of

end module gravier_flat_patch
