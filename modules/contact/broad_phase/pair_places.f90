!> How often pairs stand in a list: once for each point in which the two may touch.
module gravier_pair_places
  use gravier_kinds, only: dp
  use gravier_body_store, only: body_set_t
  use gravier_shape_library, only: point_counts_t, boundary_number
  use gravier_facet, only: near_facets_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_neighbour_rule, only: neighbour_rule_t
  implicit none
  private
  public :: has_facets, repeat_pairs

  !> facets of a boundary that a body touches at most, each in as many points as a plane; a run says where points are left out
  integer, parameter :: most_facets = 64

contains

  !> Whether a grain may touch some boundary in several points for its facets.
  pure logical function has_facets(boundaries)
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: b

    has_facets = .false.
    do b = 1, size(boundaries)
      has_facets = has_facets .or. boundaries(b)%is_faceted()
    end do
  end function has_facets

  !> Let each pair stand in the order as often as its bodies may touch in points. With a boundary of facets that depends on how many
  !> of these are in range.
  pure subroutine repeat_pairs(counts, boundaries, rule, bodies, list, order)
    !> of the shapes, where bodies have some
    type(point_counts_t), intent(in) :: counts
    type(boundary_t), intent(in) :: boundaries(:)
    !> by which pairs are listed
    type(neighbour_rule_t), intent(in) :: rule
    type(body_set_t), intent(in) :: bodies
    type(neighbour_list_t), intent(in) :: list
    !> of the pairs
    integer, allocatable, intent(inout) :: order(:)
    integer, allocatable :: longer(:), points(:)
    type(near_facets_t) :: near
    real(dp) :: reach
    integer :: k, p, n, b, antagonist

    allocate (points(list%n), source=1)
    do p = 1, list%n
      associate (i => list%candidate(p))
        antagonist = boundary_number
        if (bodies%no > 0) then
          if (list%antagonist(p) > 0) antagonist = bodies%shape(list%antagonist(p))
          points(p) = counts%between(bodies%shape(i), antagonist)
        end if
        if (list%antagonist(p) > 0) cycle
        b = -list%antagonist(p)
        if (.not. boundaries(b)%is_faceted()) cycle
        reach = bodies%radius(i) + rule%margin(norm2(bodies%velocity(1:bodies%nd, i))) + rule%alert_distance + &
          & rule%margin(norm2(boundaries(b)%velocity))
        call boundaries(b)%find_facets(bodies%position(:, i), reach, near)
        points(p) = points(p)*min(near%n, most_facets)
      end associate
    end do
    allocate (longer(sum(points)))
    n = 0
    do k = 1, size(order)
      p = order(k)
      longer(n + 1:n + points(p)) = p
      n = n + points(p)
    end do
    call move_alloc(longer, order)
  end subroutine repeat_pairs

end module gravier_pair_places
