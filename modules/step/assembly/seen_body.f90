!> A body as contacts see it from the centre of the candidate, and what is turned between its axes and the global ones.
module gravier_seen_body
  use gravier_kinds, only: dp
  use gravier_orientation, only: orientation_matrix
  use gravier_body_store, only: body_set_t
  use gravier_facet, only: near_facets_t
  use gravier_manifold, only: manifold_t
  implicit none
  private
  public :: seen_body_t, see_body, turn_manifold, turn_vertex, turn_facets, turn_corners

  !> A body, seen from the centre of the candidate.
  type :: seen_body_t
    !> number of its shape, 0 for a disk or a sphere; of its material, for what is asked of boundaries, 0 for none
    integer :: shape = 0, material = 0
    !> [m]
    real(dp) :: radius = 0.0_dp
    !> its centre (3) [m]
    real(dp) :: centre(3) = 0.0_dp
    !> its angle in the plane [rad], its axes in space, one a column
    real(dp) :: angle = 0.0_dp, axes(3, 3) = 0.0_dp
    !> of its centre [m/s], and its spin [rad/s]
    real(dp) :: velocity(3) = 0.0_dp, spin(3) = 0.0_dp
  end type seen_body_t

contains

  !> What contacts need of body `k`.
  pure subroutine see_body(bodies, k, seen)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    type(seen_body_t), intent(out) :: seen
    integer :: d

    if (bodies%no > 0) seen%shape = bodies%shape(k)
    seen%radius = bodies%radius(k)
    do d = 1, 3
      seen%axes(d, d) = 1.0_dp
    end do
    seen%velocity(1:bodies%nd) = bodies%velocity(1:bodies%nd, k)
    if (bodies%nv == 3 .and. bodies%nd == 2) seen%spin(3) = bodies%velocity(3, k)
    if (bodies%nv == 6) seen%spin(:) = bodies%velocity(4:6, k)
    if (seen%shape == 0) return
    if (bodies%nd == 2) then
      seen%angle = bodies%orientation(1, k)
    else
      call orientation_matrix(bodies%orientation(:, k), seen%axes)
    end if
  end subroutine see_body

  !> From the axes of a body to global axes.
  pure subroutine turn_manifold(axes, manifold)
    real(dp), intent(in) :: axes(3, 3)
    type(manifold_t), intent(inout) :: manifold
    real(dp) :: before(3)
    integer :: k, d

    before(:) = manifold%normal
    do d = 1, 3
      manifold%normal(d) = sum(axes(d, :)*before)
    end do
    do k = 1, manifold%n
      before(:) = manifold%point(:, k)
      do d = 1, 3
        manifold%point(d, k) = sum(axes(d, :)*before)
      end do
    end do
  end subroutine turn_manifold

  !> A vertex of a body from its centre, in global axes [m].
  pure subroutine turn_vertex(vertex, a, turned)
    !> (nd) of a body of radius 1
    real(dp), intent(in) :: vertex(:)
    type(seen_body_t), intent(in) :: a
    real(dp), intent(out) :: turned(3)
    integer :: d

    turned(3) = 0.0_dp
    if (size(vertex) == 2) then
      turned(1) = a%radius*(cos(a%angle)*vertex(1) - sin(a%angle)*vertex(2))
      turned(2) = a%radius*(sin(a%angle)*vertex(1) + cos(a%angle)*vertex(2))
    else
      do d = 1, 3
        turned(d) = a%radius*sum(a%axes(d, :)*vertex)
      end do
    end if
  end subroutine turn_vertex

  !> Facets in the axes of a body.
  pure subroutine turn_facets(axes, near, turned)
    real(dp), intent(in) :: axes(3, 3)
    type(near_facets_t), intent(in) :: near
    type(near_facets_t), intent(inout) :: turned
    real(dp) :: corner(3, 3)
    integer :: k, c, d

    turned%n = 0
    turned%tolerance = near%tolerance
    do k = 1, near%n
      do c = 1, 3
        do d = 1, 3
          corner(d, c) = sum(axes(:, d)*near%corner(:, c, k))
        end do
      end do
      call turned%add(near%number(k), corner)
    end do
  end subroutine turn_facets

  !> Turn corners of a facet back from the axes of the body.
  pure subroutine turn_corners(axes, corner)
    real(dp), intent(in) :: axes(3, 3)
    !> (3, 3)
    real(dp), intent(inout) :: corner(:, :)
    real(dp) :: turned(3)
    integer :: c, d

    do c = 1, 3
      do d = 1, 3
        turned(d) = sum(axes(d, :)*corner(:, c))
      end do
      corner(:, c) = turned
    end do
  end subroutine turn_corners

end module gravier_seen_body
