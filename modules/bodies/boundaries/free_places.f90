!> Places that boundaries leave free for grains.
module gravier_free_places
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: is_clear, is_seen, least_distance

contains

  !> Whether a grain at a place overlaps no boundary and no outlet. Of facets, which may be many, those within its reach are looked
  !> for.
  pure logical function is_clear(boundaries, radius, position) result(clear)
    type(boundary_t), intent(in) :: boundaries(:)
    !> [m]; (nd) [m]
    real(dp), intent(in) :: radius, position(:)
    type(near_facets_t) :: near
    real(dp) :: distance, normal(size(position))
    integer :: b

    clear = .false.
    do b = 1, size(boundaries)
      associate (boundary => boundaries(b))
        if (.not. boundary%present .or. boundary%is_glued()) cycle
        if (boundary%is_faceted()) then
          call boundary%find_facets(position, radius, near)
          if (near%n > 0) return
          cycle
        end if
        call boundary%locate(position, distance, normal)
        if (distance < radius) return
      end associate
    end do
    clear = .true.
  end function is_clear

  !> Whether a straight line leads from a point inside boundaries to a place, or to a periodic image of it, and meets no boundary.
  !> The place is clear of boundaries. The insides of planes, circles and cylinders are convex, so that what lies inside is seen.
  pure logical function is_seen(boundaries, from, position) result(seen)
    type(boundary_t), intent(in) :: boundaries(:)
    !> (nd) [m]
    real(dp), intent(in) :: from(:), position(:)
    real(dp) :: branch(size(position)), period(3)
    integer :: images(3), i, j, k, b

    seen = .true.
    if (size(boundaries) == 0) return
    period(:) = boundaries(1)%period
    images(:) = merge(1, 0, period > 0.0_dp)
    do k = -images(3), images(3)
      do j = -images(2), images(2)
        do i = -images(1), images(1)
          branch(:) = from - position
          branch(1) = branch(1) + i*period(1)
          branch(2) = branch(2) + j*period(2)
          if (size(branch) == 3) branch(3) = branch(3) + k*period(3)
          seen = .true.
          do b = 1, size(boundaries)
            if (.not. boundaries(b)%touches()) cycle
            if (boundaries(b)%lies_between(from, branch)) seen = .false.
          end do
          if (seen) return
        end do
      end do
    end do
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
