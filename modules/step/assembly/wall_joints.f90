!> Joints of walls that several boundaries make: segments that continue each other, rectangles, meshes.
module gravier_wall_joints
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t
  use gravier_facet_candidates, only: rises
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: is_in_joint

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
        ! the two triangles of a rectangle
        in_joint = rises(corners(:, 1:3), normal, here, tolerance, slack)
        corners(:, 2) = corners(:, 4)
        in_joint = in_joint .or. rises(corners(:, 1:3), normal, here, tolerance, slack)
      end if
    end do
  end function is_in_joint

end module gravier_wall_joints
