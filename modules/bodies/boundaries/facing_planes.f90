!> The planes that shut a scene in along the axes. Which these are is settled when they are made; they may turn from then on.
module gravier_facing_planes
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_boundary_drive, only: drives_pressure
  implicit none
  private
  public :: find_facing_planes, faces_along, open_axis, is_pressed

  !> least component along an axis of the normal of a plane that faces along it as it is made, and once it has turned
  real(dp), parameter :: facing = 0.99_dp, still_facing = 0.1_dp

contains

  !> Where the line along axis `d` through a place meets the planes that shut the scene in along it: the highest that faces up the
  !> axis and the lowest that faces down it [m]; -huge and huge where there is none, or none any more.
  pure subroutine find_facing_planes(boundaries, d, place, low, high)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: d
    !> its component along `d` does not matter [m]
    real(dp), intent(in) :: place(3)
    real(dp), intent(out) :: low, high
    real(dp) :: way(3), at
    integer :: b

    low = -huge(1.0_dp)
    high = huge(1.0_dp)
    do b = 1, size(boundaries)
      associate (plane => boundaries(b))
        if (.not. (plane%present .and. abs(plane%faces) == d)) cycle
        if (.not. sign(1, plane%faces)*plane%surface%axis(d) > still_facing) cycle
        way(:) = place - plane%surface%point
        way(d) = 0.0_dp
        at = plane%surface%point(d) - sum(way*plane%surface%axis)/plane%surface%axis(d)
        if (plane%faces > 0) low = max(low, at)
        if (plane%faces < 0) high = min(high, at)
      end associate
    end do
  end subroutine find_facing_planes

  !> The axis that a boundary faces along as it stands, negative where it faces down the axis; 0 of planes that are oblique, and of
  !> other boundaries.
  pure integer function faces_along(boundary) result(axis)
    type(boundary_t), intent(in) :: boundary

    axis = 0
    if (.not. boundary%is_plane()) return
    axis = maxloc(abs(boundary%surface%axis), dim=1)
    if (.not. abs(boundary%surface%axis(axis)) > facing) axis = 0
    if (axis > 0) axis = nint(sign(1.0_dp, boundary%surface%axis(axis)))*axis
  end function faces_along

  !> The first axis across `main` along which the scene is open: it has no period, and no two planes that stay face each other. 0 if
  !> there is none.
  pure integer function open_axis(boundaries, nd, period, main) result(axis)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: nd
    !> 0 along axes that are not periodic [m]
    real(dp), intent(in) :: period(:)
    integer, intent(in) :: main
    logical :: stays(size(boundaries))

    stays(:) = .not. boundaries%remove_at < huge(1.0_dp)
    do axis = 1, nd
      if (axis == main .or. period(axis) > 0.0_dp) cycle
      if (.not. (any(stays .and. boundaries%faces == axis) .and. any(stays .and. boundaries%faces == -axis))) return
    end do
    axis = 0
  end function open_axis

  !> Whether a pressure acts on a boundary at some time, by a key or by a table.
  pure logical function is_pressed(boundary)
    type(boundary_t), intent(in) :: boundary

    is_pressed = abs(boundary%drive%pressure) > 0.0_dp .or. boundary%drive%gives(drives_pressure, 1)
  end function is_pressed

end module gravier_facing_planes
