!> The planes that shut a scene in along the axes.
module gravier_facing_planes
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: find_facing_planes

  !> least component along an axis of the normal of a plane that faces along it
  real(dp), parameter :: facing = 0.99_dp

contains

  !> Places along axis `d` of the highest plane that faces up the axis and of the lowest one that faces down it [m];
  !> -huge and huge where there is none.
  pure subroutine find_facing_planes(boundaries, d, low, high)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: d
    real(dp), intent(out) :: low, high
    integer :: b

    low = -huge(1.0_dp)
    high = huge(1.0_dp)
    do b = 1, size(boundaries)
      associate (plane => boundaries(b))
        if (.not. (plane%is_plane() .and. plane%present)) cycle
        if (plane%surface%axis(d) > facing) low = max(low, plane%surface%point(d))
        if (plane%surface%axis(d) < -facing) high = min(high, plane%surface%point(d))
      end associate
    end do
  end subroutine find_facing_planes

end module gravier_facing_planes
