!> Joints of walls that several boundaries make: segments that continue each other, rectangles, meshes.
module gravier_wall_joints
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t, find_foot
  use gravier_facet_candidates, only: rises
  use gravier_boundary, only: boundary_t
  use gravier_manifold, only: manifold_t
  implicit none
  private
  public :: is_in_joint, keep_corners

contains

  !> Whether a point at the edge of a boundary lies in a hollow of the wall: another segment, rectangle or mesh has the point, too,
  !> and rises from it along the normal. Such a point is no place of contact (theory.md, mesh walls).
  logical function is_in_joint(boundaries, j, point, normal, tolerance, slack) result(in_joint)
    type(boundary_t), intent(in) :: boundaries(:)
    !> the boundary of the edge
    integer, intent(in) :: j
    !> (nd) [m]; (3) unit vector towards the body
    real(dp), intent(in) :: point(:), normal(3)
    !> distance below which points are one [m]; sine of the slope below which a wall is flat
    real(dp), intent(in) :: tolerance, slack
    type(near_facets_t) :: near
    real(dp), parameter :: here(3) = [0.0_dp, 0.0_dp, 0.0_dp]
    real(dp) :: corners(3, 4)
    integer :: k, f, n

    in_joint = .false.
    do k = 1, size(boundaries)
      if (in_joint) return
      if (k == j .or. .not. boundaries(k)%touches()) cycle
      if (boundaries(k)%is_faceted()) then
        call boundaries(k)%find_facets(point, tolerance, near)
        do f = 1, near%n
          in_joint = in_joint .or. rises(near%corner(:, :, f), normal, here, tolerance, slack)
        end do
      else
        call boundaries(k)%find_corners(point, n, corners)
        if (n == 2) in_joint = rises(corners(:, 1:2), normal, here, tolerance, slack)
        if (n < 4) cycle
        in_joint = rises(corners(:, 1:3), normal, here, tolerance, slack)
        corners(:, 2) = corners(:, 4)
        in_joint = in_joint .or. rises(corners(:, 1:3), normal, here, tolerance, slack)
      end if
    end do
  end function is_in_joint

  !> Of a side that leans over a segment or a rectangle whose nearest edge is in a joint, keep the corners of the body that lie over
  !> it: they stand on it once the side turns.
  pure subroutine keep_corners(corners, tolerance, slack, manifold)
    !> of the boundary, from where the manifold is seen (3, 2 or 4) [m]
    real(dp), intent(in) :: corners(:, :)
    !> distance from its edges within which points are on them [m]; slope below which points are as deep as the deepest
    real(dp), intent(in) :: tolerance, slack
    type(manifold_t), intent(inout) :: manifold
    real(dp) :: foot(3), deepest(3), least, edge(3, 2), to_edge(3)
    integer :: c, e, n, where_foot_is
    logical :: kept

    if (manifold%n == 0) return
    c = minloc(manifold%gap(1:manifold%n), 1)
    least = manifold%gap(c)
    deepest(:) = manifold%point(:, c) - 0.5_dp*least*manifold%normal
    n = 0
    do c = 1, manifold%n
      foot(:) = manifold%point(:, c) - 0.5_dp*manifold%gap(c)*manifold%normal
      kept = manifold%gap(c) - least > slack*norm2(foot - deepest)
      do e = 1, size(corners, 2)
        to_edge(:) = corners(:, e) - foot
        if (size(corners, 2) == 4) then
          edge(:, 1) = to_edge
          edge(:, 2) = corners(:, mod(e, 4) + 1) - foot
          call find_foot(edge, to_edge, where_foot_is)
        end if
        kept = kept .and. norm2(to_edge) > tolerance
      end do
      if (.not. kept) cycle
      n = n + 1
      manifold%point(:, n) = manifold%point(:, c)
      manifold%gap(n) = manifold%gap(c)
      manifold%key(n) = manifold%key(c)
    end do
    manifold%n = n
  end subroutine keep_corners

end module gravier_wall_joints
