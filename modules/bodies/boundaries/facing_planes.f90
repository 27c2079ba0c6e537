!> The planes that shut a scene in along the axes.
module gravier_facing_planes
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: find_facing_planes, faces_along, open_axis

  !> least component along an axis of the normal of a plane that faces along it
  real(dp), parameter :: facing = 0.99_dp

contains

  !> Places along axis `d` of the highest plane that faces up the axis and of the lowest one that faces down it [m];
  !> -huge and huge where there is none.
  pure subroutine find_facing_planes(boundaries, d, low, high, stay)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: d
    real(dp), intent(out) :: low, high
    !> planes that are removed in the run do not count; without this argument they do
    logical, intent(in), optional :: stay
    integer :: b

    low = -huge(1.0_dp)
    high = huge(1.0_dp)
    do b = 1, size(boundaries)
      associate (plane => boundaries(b))
        if (.not. (plane%is_plane() .and. plane%present)) cycle
        if (present(stay)) then
          if (stay .and. plane%remove_at < huge(1.0_dp)) cycle
        end if
        if (plane%surface%axis(d) > facing) low = max(low, plane%surface%point(d))
        if (plane%surface%axis(d) < -facing) high = min(high, plane%surface%point(d))
      end associate
    end do
  end subroutine find_facing_planes

  !> The axis that a plane faces along, up or down; 0 for a plane that is oblique.
  pure integer function faces_along(plane) result(axis)
    type(boundary_t), intent(in) :: plane

    axis = maxloc(abs(plane%surface%axis), dim=1)
    if (.not. abs(plane%surface%axis(axis)) > facing) axis = 0
  end function faces_along

  !> The first axis across `main` along which the scene is open: it has no period, and no two planes that stay face each other. 0 if
  !> there is none.
  pure integer function open_axis(boundaries, nd, period, main) result(axis)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: nd
    !> 0 along axes that are not periodic [m]
    real(dp), intent(in) :: period(:)
    integer, intent(in) :: main
    real(dp) :: low, high

    do axis = 1, nd
      if (axis == main .or. period(axis) > 0.0_dp) cycle
      call find_facing_planes(boundaries, axis, low, high, stay=.true.)
      if (.not. (low > -huge(1.0_dp) .and. high < huge(1.0_dp))) return
    end do
    axis = 0
  end function open_axis

end module gravier_facing_planes
