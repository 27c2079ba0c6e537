!> How far from its pivot a boundary that turns reaches grains: its spin times this is its largest velocity.
module gravier_boundary_levers
  use gravier_kinds, only: dp
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: find_levers

contains

  !> Distance from its pivot, across the axis that it turns about, up to which each boundary reaches grains: that of its
  !> farthest point, of the farthest glued grain, or, of a plane, which has no end, of the farthest grain.
  subroutine find_levers(grains, boundaries, lever)
    type(body_set_t), intent(in) :: grains
    type(boundary_t), intent(in) :: boundaries(:)
    !> (boundaries) [m]
    real(dp), intent(out) :: lever(:)
    real(dp) :: place(3), corner(3, 8), facet(3, 3)
    integer :: b, k, c, n

    lever(:) = 0.0_dp
    do b = 1, size(boundaries)
      associate (boundary => boundaries(b))
        if (.not. boundary%drive%turns()) cycle
        if (boundary%is_glued() .or. boundary%is_plane()) then
          do k = 1, grains%n
            if (boundary%is_glued() .and. grains%glued(k) /= b) cycle
            place(:) = 0.0_dp
            place(1:grains%nd) = grains%position(:, k)
            lever(b) = max(lever(b), arm(boundary, place) + grains%radius(k))
          end do
        else if (boundary%is_faceted()) then
          do k = 1, boundary%surface%n_facets()
            call boundary%surface%get_facet(k, facet(:, 1:grains%nd))
            do c = 1, grains%nd
              lever(b) = max(lever(b), arm(boundary, facet(:, c)))
            end do
          end do
        else
          associate (surface => boundary%surface)
            call surface%find_box(n, corner)
            do k = 1, n
              lever(b) = max(lever(b), arm(boundary, corner(:, k)) + surface%radius)
            end do
          end associate
        end if
      end associate
    end do
  end subroutine find_levers

  !> Distance of a point from the axis through the pivot; from the pivot where a table or an oscillation may change the axis [m].
  pure real(dp) function arm(boundary, place)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: place(3)
    real(dp) :: way(3), axis(3)

    way(:) = place - boundary%pivot
    call boundary%drive%find_axis(axis)
    way(:) = way - sum(way*axis)*axis
    arm = norm2(way)
  end function arm

end module gravier_boundary_levers
