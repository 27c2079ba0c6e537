!> Rims of a wall of facets: edges beyond which no facet goes on in the same plane. A rim is straight where edges of several facets
!> follow each other on one line; where facets end along it says nothing.
module gravier_facet_rims
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t, find_facet_normal
  use gravier_convex_piece, only: convex_piece_t
  use gravier_contact_feature, only: feature_t, find_feature
  use gravier_facet_candidates, only: has_point
  implicit none
  private
  public :: extend_rims, extend_edge, is_on_wall

  !> corners of facets are this near to a line or a plane that has them, in tolerances of the file
  real(dp), parameter :: over_tolerance = 5.0_dp
  !> how far beyond an edge another facet is looked for, in parts of the width of its facet
  real(dp), parameter :: beyond = 1.0e-3_dp

contains

  !> Let the edge of a facet in the direction of a contact, and its sides, go on where the wall goes on along the same line.
  pure subroutine extend_edge(near, place, normal, known, radius, sheet)
    type(near_facets_t), intent(in) :: near
    !> of the facet among those near
    integer, intent(in) :: place
    !> of the contact, and corners of the facet that the piece touches
    real(dp), intent(in) :: normal(3)
    integer, intent(in) :: known(:)
    !> what the lengths of the piece are multiplied by [m]
    real(dp), intent(in) :: radius
    !> the facet; corners on the line are moved
    type(convex_piece_t), intent(inout) :: sheet
    type(feature_t) :: feature

    call find_feature(sheet, normal, known, feature)
    if (feature%n == 2) call extend(near, place, feature%vertex, feature%other, radius, sheet)
  end subroutine extend_edge

  !> Let all rims of a facet go on where the wall goes on along their lines.
  pure subroutine extend_rims(near, place, radius, sheet)
    type(near_facets_t), intent(in) :: near
    integer, intent(in) :: place
    real(dp), intent(in) :: radius
    type(convex_piece_t), intent(inout) :: sheet
    integer :: c

    do c = 1, 3
      if (.not. goes_on_beyond(near, place, c)) call extend(near, place, c, mod(c, 3) + 1, radius, sheet)
    end do
  end subroutine extend_rims

  !> Let an edge of a facet go on over the rims of other facets in its plane that follow it on its line.
  pure subroutine extend(near, place, first, last, radius, sheet)
    type(near_facets_t), intent(in) :: near
    !> of the facet; its corners at the ends of the edge
    integer, intent(in) :: place, first, last
    real(dp), intent(in) :: radius
    type(convex_piece_t), intent(inout) :: sheet
    real(dp) :: along(3), normal(3), from(3), reach(2), part(2), tolerance
    integer :: k, c, pass
    logical :: longer

    from(:) = near%corner(:, first, place)
    along(:) = near%corner(:, last, place) - from
    reach(1) = 0.0_dp
    reach(2) = norm2(along)
    along(:) = along/reach(2)
    call find_facet_normal(near%corner(:, :, place), normal)
    tolerance = over_tolerance*near%tolerance
    ! each pass may add the neighbours of what was added before
    do pass = 1, near%n
      longer = .false.
      do k = 1, near%n
        if (k == place) cycle
        do c = 1, 3
          if (.not. (is_on_line(c) .and. is_on_line(mod(c, 3) + 1))) cycle
          if (abs(dot_product(normal, near%corner(:, mod(c + 1, 3) + 1, k) - from)) > tolerance) cycle
          part(1) = dot_product(along, near%corner(:, c, k) - from)
          part(2) = dot_product(along, near%corner(:, mod(c, 3) + 1, k) - from)
          if (maxval(part) <= reach(2) + tolerance .and. minval(part) >= reach(1) - tolerance) cycle
          if (maxval(part) < reach(1) - tolerance .or. minval(part) > reach(2) + tolerance) cycle
          if (goes_on_beyond(near, k, c)) cycle
          reach(1) = min(reach(1), minval(part))
          reach(2) = max(reach(2), maxval(part))
          longer = .true.
        end do
      end do
      if (.not. longer) exit
    end do
    sheet%vertex(:, first) = (from + reach(1)*along)/radius
    sheet%vertex(:, last) = (from + reach(2)*along)/radius
    sheet%corner(:, :) = sheet%vertex

  contains

    !> Whether a corner of facet k lies on the line.
    pure logical function is_on_line(corner)
      integer, intent(in) :: corner
      real(dp) :: way(3)

      way(:) = near%corner(:, corner, k) - from
      is_on_line = norm2(way - dot_product(way, along)*along) <= tolerance
    end function is_on_line

  end subroutine extend

  !> Whether a facet lies in the plane of facet `k` on the other side of its edge from corner `c` on.
  pure logical function goes_on_beyond(near, k, c)
    type(near_facets_t), intent(in) :: near
    integer, intent(in) :: k, c
    real(dp) :: middle(3), inside(3), along(3), past(3)
    integer :: l

    along(:) = near%corner(:, mod(c, 3) + 1, k) - near%corner(:, c, k)
    middle(:) = near%corner(:, c, k) + 0.5_dp*along
    inside(:) = near%corner(:, mod(c + 1, 3) + 1, k) - middle
    past(:) = middle - beyond*(inside - dot_product(inside, along)/dot_product(along, along)*along)
    goes_on_beyond = .true.
    do l = 1, near%n
      if (l == k) cycle
      if (has_point(near%corner(:, :, l), past, over_tolerance*near%tolerance)) return
    end do
    goes_on_beyond = .false.
  end function goes_on_beyond

  !> Whether some facet has a point.
  pure logical function is_on_wall(near, point, tolerance)
    type(near_facets_t), intent(in) :: near
    !> [m]; distance below which the point is on a facet [m]
    real(dp), intent(in) :: point(3), tolerance
    integer :: k

    is_on_wall = .true.
    do k = 1, near%n
      if (has_point(near%corner(:, :, k), point, tolerance)) return
    end do
    is_on_wall = .false.
  end function is_on_wall

end module gravier_facet_rims
