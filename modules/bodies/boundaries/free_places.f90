!> Places that boundaries leave free for grains.
module gravier_free_places
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: is_clear, is_seen, least_distance

  !> radius of a ball that can go straight to a place which is seen, over that of the grain: less than 1, so that rounding hides no
  !> place at a wall
  real(dp), parameter :: of_radius = 0.5_dp

contains

  !> Whether a grain at a place overlaps no boundary and no outlet.
  pure logical function is_clear(boundaries, radius, position) result(clear)
    type(boundary_t), intent(in) :: boundaries(:)
    !> [m]; (nd) [m]
    real(dp), intent(in) :: radius, position(:)

    clear = .not. least_distance(boundaries, position) < radius
  end function is_clear

  !> Whether a ball of half the radius of a grain can go straight from one point to another and touches no boundary and no outlet.
  !> A ball about a point as wide as its distance from all surfaces meets none of them, so that the way is looked at in such steps.
  pure logical function is_seen(boundaries, from, radius, position) result(seen)
    type(boundary_t), intent(in) :: boundaries(:)
    !> (nd) [m]; radius of the grain [m]; (nd) [m]
    real(dp), intent(in) :: from(:), radius, position(:)
    real(dp), dimension(size(position)) :: way, place
    real(dp) :: length, gone, distance

    seen = .false.
    way(:) = position - from
    length = norm2(way)
    if (length > 0.0_dp) way(:) = way/length
    gone = 0.0_dp
    do
      place(:) = from + gone*way
      distance = least_distance(boundaries, place)
      if (distance < of_radius*radius) return
      if (gone >= length) exit
      gone = min(gone + distance, length)
    end do
    seen = .true.
  end function is_seen

  !> Distance of a point from the nearest boundary or outlet, negative behind one that has a behind; huge without any [m]. Glued
  !> grains have no surface.
  pure real(dp) function least_distance(boundaries, position) result(least)
    type(boundary_t), intent(in) :: boundaries(:)
    !> (nd) [m]
    real(dp), intent(in) :: position(:)
    real(dp) :: distance, normal(size(position))
    integer :: b

    least = huge(1.0_dp)
    do b = 1, size(boundaries)
      if (.not. boundaries(b)%present .or. boundaries(b)%is_glued()) cycle
      call boundaries(b)%locate(position, distance, normal)
      least = min(least, distance)
    end do
  end function least_distance

end module gravier_free_places
