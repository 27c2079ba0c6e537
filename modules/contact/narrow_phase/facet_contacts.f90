!> Contacts of a convex piece with facets of a wall that are near it, in the plane and in space. The facets have two sides and no
!> thickness.
module gravier_facet_contacts
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t, find_foot, find_facet_normal, within
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance
  use gravier_core_overlap, only: find_least_separation, find_separation_by_faces
  use gravier_facet_rims, only: extend_rims, extend_edge, is_on_wall
  use gravier_polygon_pair, only: placed_piece_t, find_polygon_manifold
  use gravier_polyhedron_pair, only: find_patch
  use gravier_flat_patch, only: make_facet_piece, set_facet_piece, lies_flat, find_flat_patch
  use gravier_facet_candidates, only: facet_candidate_t, facet_candidates_t, tolerance_for, has_point, rises
  use gravier_manifold, only: manifold_t
  implicit none
  private
  public :: facet_contacts_t, find_ball_contacts, find_polygon_contacts, find_polyhedron_contacts, keep_corners

  !> Sine of the slope of a facet at and below which it does not hide a point: rounding for balls. Pieces with sides also keep
  !> points that they reach by a small turn.
  real(dp), parameter :: slack_of_balls = 1.0e-10_dp, slack_of_pieces = 1.0e-3_dp
  !> sine of the angle between the normals of a contact and of a facet within which they are one
  real(dp), parameter :: aligned = 1.0e-8_dp
  !> corners of facets are this near to a plane that has them, in parts of the rounding, and over the tolerance of the file
  real(dp), parameter :: in_plane = 1.0e-2_dp, over_tolerance = 5.0_dp
  !> cosine of the angle between normals of contacts with one plane
  real(dp), parameter :: one_side = 0.98_dp

  !> Manifolds, each with one facet or with a flat part of several.
  type :: facet_contacts_t
    integer :: n = 0
    !> number of the facet, or of the nearest of several (n)
    integer, allocatable :: facet(:)
    type(manifold_t), allocatable :: manifold(:)
    !> corners of the facet, where the piece touches its edge with this edge as far as the wall goes on along it, in the axes of the
    !> manifold; in the plane the first two (3, 3, n) [m]
    real(dp), allocatable :: corner(:, :, :)
    type(facet_candidates_t), private :: candidates
    type(convex_piece_t), private :: sheet
  contains
    procedure, private :: add => facet_contacts_add
  end type facet_contacts_t

contains

  pure subroutine facet_contacts_add(self, facet, corner, manifold)
    class(facet_contacts_t), intent(inout) :: self
    integer, intent(in) :: facet
    !> of the facet (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    type(manifold_t), intent(in) :: manifold
    integer, allocatable :: longer_facet(:)
    type(manifold_t), allocatable :: longer(:)
    real(dp), allocatable :: longer_corner(:, :, :)

    if (.not. allocated(self%facet)) allocate (self%facet(8), self%manifold(8), self%corner(3, 3, 8))
    if (self%n == size(self%facet)) then
      allocate (longer_facet(2*self%n), longer(2*self%n), longer_corner(3, 3, 2*self%n))
      longer_facet(1:self%n) = self%facet
      longer(1:self%n) = self%manifold
      longer_corner(:, :, 1:self%n) = self%corner
      call move_alloc(longer_facet, self%facet)
      call move_alloc(longer, self%manifold)
      call move_alloc(longer_corner, self%corner)
    end if
    self%n = self%n + 1
    self%facet(self%n) = facet
    self%manifold(self%n) = manifold
    self%corner(:, 1:size(corner, 2), self%n) = corner
  end subroutine facet_contacts_add

  !> The contacts of a disk or a ball: one with each facet that it touches within, one with each side or corner that sticks out.
  pure subroutine find_ball_contacts(centre, radius, near, alert, found)
    !> [m], from where the facets are seen
    real(dp), intent(in) :: centre(3)
    !> [m]
    real(dp), intent(in) :: radius
    type(near_facets_t), intent(in) :: near
    !> largest gap of a contact [m]
    real(dp), intent(in) :: alert
    !> what it held is lost
    type(facet_contacts_t), intent(inout) :: found
    type(facet_candidate_t) :: candidate
    type(manifold_t) :: manifold
    real(dp) :: corner(3, size(near%corner, 2)), foot(3)
    integer :: k, c, where_foot_is

    found%n = 0
    call found%candidates%clear(near%n)
    do k = 1, near%n
      do c = 1, size(corner, 2)
        corner(:, c) = near%corner(:, c, k) - centre
      end do
      call find_foot(corner, foot, where_foot_is)
      candidate = facet_candidate_t(place=k, distance=norm2(foot), lies_along=where_foot_is == within)
      if (candidate%distance - radius > alert) cycle
      if (candidate%lies_along .or. .not. candidate%distance > 0.0_dp) then
        call find_facet_normal(corner, candidate%normal)
        if (dot_product(candidate%normal, foot) > 0.0_dp) candidate%normal(:) = -candidate%normal
      else
        candidate%normal(:) = -foot/candidate%distance
      end if
      candidate%foot(:) = centre + foot
      call found%candidates%add(candidate)
    end do
    call found%candidates%sort(near, radius)
    call found%candidates%drop_hidden(near, tolerance_for(near, radius), slack_of_balls)
    call found%candidates%drop_repeated(radius)
    do k = 1, found%candidates%n
      associate (item => found%candidates%item(found%candidates%order(k)))
        if (item%dropped) cycle
        manifold%n = 1
        manifold%normal(:) = item%normal
        manifold%gap(1) = item%distance - radius
        manifold%point(:, 1) = item%foot + 0.5_dp*manifold%gap(1)*item%normal
        manifold%cores_overlap = .not. item%distance > 0.0_dp
        call found%add(near%number(item%place), near%corner(:, :, item%place), manifold)
      end associate
    end do
  end subroutine find_ball_contacts

  !> The contacts of a capsule or a polygon in the plane.
  subroutine find_polygon_contacts(piece, near, alert, found)
    !> from where the facets are seen
    type(placed_piece_t), intent(in) :: piece
    type(near_facets_t), intent(in) :: near
    real(dp), intent(in) :: alert
    !> what it held is lost
    type(facet_contacts_t), intent(inout) :: found
    type(placed_piece_t) :: line
    type(facet_candidate_t) :: candidate
    type(manifold_t) :: manifold(near%n)
    real(dp) :: foot(3)
    integer :: k, c

    found%n = 0
    call found%candidates%clear(near%n)
    line%n = 2
    allocate (line%vertex(2, 2), line%corner(2, 2))
    do k = 1, near%n
      line%vertex(:, :) = near%corner(1:2, :, k)
      line%corner(:, :) = line%vertex
      call find_polygon_manifold(piece, line, alert, manifold(k))
      if (manifold(k)%n == 0) cycle
      candidate = facet_candidate_t(place=k, distance=minval(manifold(k)%gap(1:manifold(k)%n)) + piece%rounding)
      candidate%lies_along = abs(dot_product(manifold(k)%normal, near%corner(:, 2, k) - near%corner(:, 1, k))) <= &
        & aligned*norm2(near%corner(:, 2, k) - near%corner(:, 1, k))
      candidate%normal(:) = manifold(k)%normal
      ! of two points the middle: the ends of a common part may lie on facets beside this one
      do c = 1, manifold(k)%n
        call find_foot_of(manifold(k), c, foot)
        candidate%foot(:) = candidate%foot + foot/manifold(k)%n
      end do
      call found%candidates%add(candidate)
    end do
    call found%candidates%sort(near, piece%rounding)
    call found%candidates%drop_hidden(near, tolerance_for(near, piece%rounding), slack_of_pieces)
    do k = 1, found%candidates%n
      associate (item => found%candidates%item(found%candidates%order(k)))
        if (item%dropped) cycle
        call drop_joint(found%candidates, k, near, tolerance_for(near, piece%rounding), manifold(item%place))
        if (manifold(item%place)%n > 0) &
          & call found%add(near%number(item%place), near%corner(:, :, item%place), manifold(item%place))
      end associate
    end do
  end subroutine find_polygon_contacts

  !> Where point `c` of a manifold lies on the facet [m].
  pure subroutine find_foot_of(manifold, c, foot)
    type(manifold_t), intent(in) :: manifold
    integer, intent(in) :: c
    real(dp), intent(out) :: foot(3)

    foot(:) = manifold%point(:, c) - 0.5_dp*manifold%gap(c)*manifold%normal
  end subroutine find_foot_of

  !> Drop what a side that leans over a facet has at a joint of a hollow wall. Where the normal is that of the side, the facet
  !> touches it with one of its ends. If the next facet hides that end, a side that passes over the joint would be stopped there.
  pure subroutine drop_joint(candidates, k, near, tolerance, manifold)
    type(facet_candidates_t), intent(in) :: candidates
    !> place of the candidate in the order
    integer, intent(in) :: k
    type(near_facets_t), intent(in) :: near
    !> of tolerance_for [m]
    real(dp), intent(in) :: tolerance
    !> of the candidate
    type(manifold_t), intent(inout) :: manifold
    real(dp) :: foot(3, 2), end_of_facet(3)
    integer :: nearer

    if (manifold%n < 2) return
    associate (item => candidates%item(candidates%order(k)))
      if (item%lies_along) return
      call find_foot_of(manifold, 1, foot(:, 1))
      call find_foot_of(manifold, 2, foot(:, 2))
      if (abs(manifold%gap(2) - manifold%gap(1)) <= slack_of_pieces*norm2(foot(:, 2) - foot(:, 1))) return
      nearer = merge(1, 2, manifold%gap(1) < manifold%gap(2))
      end_of_facet(:) = near%corner(:, 1, item%place)
      if (norm2(foot(:, nearer) - near%corner(:, 2, item%place)) < norm2(foot(:, nearer) - end_of_facet)) &
        & end_of_facet(:) = near%corner(:, 2, item%place)
      if (candidates%is_hidden(k, near, end_of_facet, tolerance, slack_of_pieces)) &
        & call keep_corners(near%corner(:, :, item%place), tolerance, slack_of_pieces, manifold)
    end associate
  end subroutine drop_joint

  !> Of a side that leans over a segment, a facet or a rectangle whose nearest edge is in a joint, keep the corners of the body that
  !> lie over it: they stand on it once the side turns.
  pure subroutine keep_corners(corners, tolerance, slack, manifold)
    !> of the segment, facet or rectangle, from where the manifold is seen (3, 2 to 4) [m]
    real(dp), intent(in) :: corners(:, :)
    !> distance from its edges within which points are on them [m]; slope below which points are as deep as the deepest
    real(dp), intent(in) :: tolerance, slack
    type(manifold_t), intent(inout) :: manifold
    real(dp) :: foot(3), deepest(3), least, edge(3, 2), to_edge(3)
    integer :: c, e, n, where_foot_is
    logical :: kept

    if (manifold%n == 0) return
    c = minloc(manifold%gap(1:manifold%n), 1)
    least = manifold%gap(c)
    call find_foot_of(manifold, c, deepest)
    n = 0
    do c = 1, manifold%n
      call find_foot_of(manifold, c, foot)
      kept = manifold%gap(c) - least > slack*norm2(foot - deepest)
      do e = 1, size(corners, 2)
        to_edge(:) = corners(:, e) - foot
        if (size(corners, 2) > 2) then
          edge(:, 1) = to_edge
          edge(:, 2) = corners(:, mod(e, size(corners, 2)) + 1) - foot
          call find_foot(edge, to_edge, where_foot_is)
        end if
        kept = kept .and. norm2(to_edge) > tolerance
      end do
      if (.not. kept) cycle
      call keep_point(c, n, manifold)
    end do
    manifold%n = n
  end subroutine keep_corners

  !> Keep point `c` of a manifold as the next of those kept.
  pure subroutine keep_point(c, n, manifold)
    integer, intent(in) :: c
    !> points kept; one more afterwards
    integer, intent(inout) :: n
    type(manifold_t), intent(inout) :: manifold

    n = n + 1
    manifold%point(:, n) = manifold%point(:, c)
    manifold%gap(n) = manifold%gap(c)
    manifold%key(n) = manifold%key(c)
  end subroutine keep_point

  !> The contacts of a piece in space that is no ball, in its axes.
  pure subroutine find_polyhedron_contacts(piece, radius, near, alert, most, found)
    type(convex_piece_t), intent(in) :: piece
    !> what the lengths of the piece are multiplied by [m]
    real(dp), intent(in) :: radius
    !> in the axes of the piece, from its centre
    type(near_facets_t), intent(in) :: near
    real(dp), intent(in) :: alert
    !> points of a manifold wanted at most
    integer, intent(in) :: most
    !> what it held is lost
    type(facet_contacts_t), intent(inout) :: found
    type(core_distance_t) :: distance(near%n)
    type(placed_pair_t) :: pair
    type(manifold_t) :: manifold
    real(dp) :: corner(3, 3, near%n), reached(3, 3)
    integer :: k, n, pass

    found%n = 0
    if (.not. allocated(found%sheet%vertex)) call make_facet_piece(found%sheet)
    pair%radius_a = radius
    pair%radius_b = radius
    do k = 1, 3
      pair%rotation(k, k) = 1.0_dp
    end do
    call find_candidates(piece, pair, near, alert, distance, found)
    call found%candidates%sort(near, radius*piece%rounding)
    call found%candidates%drop_hidden(near, tolerance_for(near, radius*piece%rounding), slack_of_pieces)
    ! planes first: they have the sides that they end at
    do pass = 1, 2
      do k = 1, found%candidates%n
        associate (item => found%candidates%item(found%candidates%order(k)))
          if (item%dropped) cycle
          call set_facet_piece(near%corner(:, :, item%place), radius, found%sheet)
          if (lies_flat(found%sheet, distance(item%place)) .neqv. pass == 1) cycle
          manifold%n = 0
          manifold%normal(:) = distance(item%place)%normal
          manifold%cores_overlap = distance(item%place)%overlap
          if (pass == 1) then
            call take_plane(near, k, radius*piece%rounding, found, n, corner)
            call find_flat_patch(piece, radius, distance(item%place), corner(:, :, 1:n), alert, most, manifold)
          else
            associate (own => distance(item%place))
              call extend_edge(near, item%place, own%normal, own%vertex_b(1:own%n), radius, found%sheet)
            end associate
            call find_patch(piece, found%sheet, pair, distance(item%place), alert, most, manifold)
          end if
          if (item%beside > 0) call leave_plane(near, item%beside, radius*piece%rounding, manifold)
          reached(:, :) = radius*found%sheet%vertex
          if (manifold%n > 0) call found%add(near%number(item%place), reached, manifold)
        end associate
      end do
    end do
  end subroutine find_polyhedron_contacts

  !> The facets that the core of a piece is near enough to, each with the distance.
  pure subroutine find_candidates(piece, pair, near, alert, distance, found)
    type(convex_piece_t), intent(in) :: piece
    type(placed_pair_t), intent(in) :: pair
    type(near_facets_t), intent(in) :: near
    real(dp), intent(in) :: alert
    type(core_distance_t), intent(inout) :: distance(:)
    type(facet_contacts_t), intent(inout) :: found
    type(facet_candidate_t) :: candidate
    type(core_distance_t) :: by_faces
    real(dp) :: reach
    integer :: k

    call found%candidates%clear(near%n)
    reach = pair%radius_a*piece%rounding
    do k = 1, near%n
      call set_facet_piece(near%corner(:, :, k), pair%radius_b, found%sheet)
      call find_core_distance(piece, found%sheet, pair, max(0.0_dp, reach + alert), distance(k))
      if (distance(k)%beyond) cycle
      if (distance(k)%overlap) call find_least_separation(piece, found%sheet, pair, distance(k))
      if (distance(k)%distance - reach > alert) cycle
      call make_candidate(found%sheet, k, distance(k), candidate)
      if (distance(k)%overlap .and. .not. candidate%lies_along) then
        if (is_stopped(near, candidate, tolerance_for(near, reach))) then
          call find_separation_by_faces(piece, found%sheet, pair, by_faces)
          if (is_on_wall(near, by_faces%point_b, tolerance_for(near, reach))) then
            distance(k) = by_faces
          else
            call extend_rims(near, k, pair%radius_b, found%sheet)
            call find_least_separation(piece, found%sheet, pair, distance(k))
          end if
          call make_candidate(found%sheet, k, distance(k), candidate)
        end if
      end if
      call found%candidates%add(candidate)
    end do
  end subroutine find_candidates

  !> A candidate of the distance to a facet. A normal along that of the facet becomes this one.
  pure subroutine make_candidate(sheet, place, distance, candidate)
    !> the facet, and its place among those near
    type(convex_piece_t), intent(in) :: sheet
    integer, intent(in) :: place
    type(core_distance_t), intent(inout) :: distance
    type(facet_candidate_t), intent(out) :: candidate
    real(dp) :: normal(3), along

    normal(:) = sheet%face_normal(:, 1)
    along = dot_product(normal, distance%normal)
    candidate = facet_candidate_t(place=place, distance=distance%distance)
    candidate%lies_along = norm2(distance%normal - along*normal) <= aligned
    if (candidate%lies_along) distance%normal(:) = sign(1.0_dp, along)*normal
    candidate%normal(:) = distance%normal
    candidate%foot(:) = distance%point_b
  end subroutine make_candidate

  !> Whether another facet rises from the point of a candidate. A core that overlaps the facet may be least separated from it over
  !> one of its sides; if the wall goes on there, this is no way out.
  pure logical function is_stopped(near, candidate, tolerance)
    type(near_facets_t), intent(in) :: near
    type(facet_candidate_t), intent(in) :: candidate
    !> of tolerance_for [m]
    real(dp), intent(in) :: tolerance
    integer :: k

    is_stopped = .false.
    do k = 1, near%n
      if (k == candidate%place) cycle
      is_stopped = rises(near%corner(:, :, k), candidate%normal, candidate%foot, tolerance, slack_of_pieces)
      if (is_stopped) return
    end do
  end function is_stopped

  !> The facets that lie in the plane of that of a candidate, which comes first. They have no contacts of their own on this side.
  !> Others have none at points of these facets, but may have some away from there, where a side of the piece lies over a ridge so
  !> flat that it is near to both of its slopes.
  pure subroutine take_plane(near, first, rounding, found, n, corner)
    type(near_facets_t), intent(in) :: near
    !> place of the candidate in the order
    integer, intent(in) :: first
    !> of the piece [m]
    real(dp), intent(in) :: rounding
    type(facet_contacts_t), intent(inout) :: found
    integer, intent(out) :: n
    !> the first n [m]
    real(dp), intent(out), contiguous :: corner(:, :, :)
    logical :: is_in_plane(near%n)
    integer :: k, lead

    lead = found%candidates%item(found%candidates%order(first))%place
    call gather_plane(near, lead, rounding, is_in_plane, n, corner)
    associate (chosen => found%candidates%item(found%candidates%order(first)))
      do k = 1, found%candidates%n
        associate (item => found%candidates%item(k))
          if (item%dropped .or. item%place == lead .or. dot_product(item%normal, chosen%normal) <= one_side) cycle
          item%dropped = is_in_plane(item%place)
          if (item%dropped .or. item%beside > 0) cycle
          if (is_on_one(corner(:, :, 1:n), item%foot, tolerance_for(near, rounding))) item%beside = lead
        end associate
      end do
    end associate
  end subroutine take_plane

  !> The facets that lie in the plane of one, which comes first.
  pure subroutine gather_plane(near, lead, rounding, is_in_plane, n, corner)
    type(near_facets_t), intent(in) :: near
    !> place of the one
    integer, intent(in) :: lead
    !> of the piece [m]
    real(dp), intent(in) :: rounding
    logical, intent(out) :: is_in_plane(near%n)
    integer, intent(out) :: n
    !> the first n [m]
    real(dp), intent(out), contiguous :: corner(:, :, :)
    real(dp) :: normal(3), height, room
    integer :: k, c

    call find_facet_normal(near%corner(:, :, lead), normal)
    room = min(over_tolerance*near%tolerance, in_plane*rounding)
    n = 1
    corner(:, :, 1) = near%corner(:, :, lead)
    do k = 1, near%n
      is_in_plane(k) = .true.
      do c = 1, 3
        height = dot_product(normal, near%corner(:, c, k) - near%corner(:, 1, lead))
        is_in_plane(k) = is_in_plane(k) .and. abs(height) <= room
      end do
      if (k == lead .or. .not. is_in_plane(k)) cycle
      n = n + 1
      corner(:, :, n) = near%corner(:, :, k)
    end do
  end subroutine gather_plane

  !> Whether one of some facets has a point.
  pure logical function is_on_one(corner, point, tolerance) result(is_on)
    !> (3, 3, facets) [m]
    real(dp), intent(in), contiguous :: corner(:, :, :)
    real(dp), intent(in) :: point(3), tolerance
    integer :: k

    is_on = .false.
    do k = 1, size(corner, 3)
      is_on = has_point(corner(:, :, k), point, tolerance)
      if (is_on) return
    end do
  end function is_on_one

  !> Leave out the points of a manifold that lie on the facets of a plane, which has them.
  pure subroutine leave_plane(near, lead, rounding, manifold)
    type(near_facets_t), intent(in) :: near
    !> place of one of the facets of the plane
    integer, intent(in) :: lead
    !> of the piece [m]
    real(dp), intent(in) :: rounding
    type(manifold_t), intent(inout) :: manifold
    logical :: is_in_plane(near%n)
    real(dp) :: foot(3), corner(3, 3, near%n)
    integer :: c, n, n_facets

    call gather_plane(near, lead, rounding, is_in_plane, n_facets, corner)
    n = 0
    do c = 1, manifold%n
      call find_foot_of(manifold, c, foot)
      if (.not. is_on_one(corner(:, :, 1:n_facets), foot, tolerance_for(near, rounding))) call keep_point(c, n, manifold)
    end do
    manifold%n = n
  end subroutine leave_plane

end module gravier_facet_contacts
