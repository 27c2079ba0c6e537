!> The contacts of two convex pieces.
module gravier_manifold
  use gravier_kinds, only: dp
  use gravier_shape_library, only: most_of_face
  implicit none
  private
  public :: manifold_t, most_points, feature_base

  !> points that a manifold can hold
  integer, parameter :: most_points = most_of_face
  !> features of a piece (vertices, edges or faces) have numbers from 0 to feature_base - 1, so that two make a key below 2^30
  integer, parameter :: feature_base = 32768

  !> Up to most_points points with a common normal, in ascending order of their keys. The arrays of points are not set beyond n:
  !> most pairs have few points.
  type :: manifold_t
    integer :: n = 0
    !> unit vector from the second piece, the antagonist, to the first, the candidate; in 2D its third component is 0
    real(dp) :: normal(3) = 0.0_dp
    !> half-way between the two surfaces (3, n) [m]; in 2D the third component is 0
    real(dp) :: point(3, most_points)
    !> (n) [m]
    real(dp) :: gap(most_points)
    !> number that tells a point from the others of the two pieces, and stays while it persists (n)
    integer :: key(most_points)
    !> the cores overlap, so that the normal is the direction of least separation
    logical :: cores_overlap = .false.
  end type manifold_t

end module gravier_manifold
