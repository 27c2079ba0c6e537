!> Contacts of convex pieces in the plane: disks, capsules and polygons with rounded corners.
!>
!> Where the cores are apart, the normal is the direction of the shortest way between them, which is unique and changes continuously
!> with the places. Where they overlap, it is the direction of least separation. Two sides that face each other within
!> `facing_angle` touch in up to two points, the ends of the part that they have in common; else the pieces touch in the ends of
!> the shortest way. Sides that are parallel reach to the sharp corners, so that a brick stands on the whole of its base; the larger
!> the angle between them, the less they reach beyond the core, and from `blend_angle` on not at all. The shortest way of sides that
!> have a part of their cores in common is across one of them. As it turns from there, sides reach less far in the same way, and
!> from `blend_angle` on there is a corner on a corner: bricks whose tops are flush do not meet with their sides.
module gravier_polygon_pair
  use gravier_kinds, only: dp
  use gravier_manifold, only: manifold_t, feature_base
  implicit none
  private
  public :: placed_piece_t, place_piece, find_polygon_manifold, find_plane_manifold, find_shortest_way

  !> sine of the angle within which sides face each other; angle from which on sides end where the core does [rad]
  real(dp), parameter :: facing_angle = 0.34_dp, blend_angle = 0.02_dp
  !> cosine of the angle between a normal and that of a side from which on the normal is the side's
  real(dp), parameter :: on_side = 1.0_dp - 1.0e-10_dp

  !> A piece where it is: turned, scaled and shifted. One vertex makes a disk, two a capsule.
  type :: placed_piece_t
    integer :: n = 0
    !> (2, n) [m]
    real(dp), allocatable :: vertex(:, :), corner(:, :)
    !> [m]
    real(dp) :: rounding = 0.0_dp
    !> whether a side that lies along another one reaches out to the sharp corners
    logical :: reaches_out = .true.
  end type placed_piece_t

  !> A side of a piece from vertex k to the next, which is `along` a unit vector and has the unit normal `out`.
  type :: side_t
    integer :: k = 0
    real(dp) :: along(2) = 0.0_dp, out(2) = 0.0_dp
    !> cosine of the angle between `out` and the direction towards the other piece
    real(dp) :: facing = -2.0_dp
    !> ends (2, 2) [m]
    real(dp) :: ends(2, 2) = 0.0_dp
  end type side_t

  !> The ends of the part that two sides have in common.
  type :: ends_t
    integer :: n = 0
    !> between the cores at first, then between the surfaces [m]
    real(dp) :: gap(2) = 0.0_dp
    !> (2, n) [m], and the unit normal of the reference to its inside
    real(dp) :: on_reference(2, 2) = 0.0_dp, inwards(2) = 0.0_dp
  end type ends_t

contains

  !> Put a piece in its place.
  pure subroutine place_piece(vertex, corner, rounding, scale, angle, centre, placed)
    !> (2, n) of a body of radius 1
    real(dp), intent(in), contiguous :: vertex(:, :), corner(:, :)
    real(dp), intent(in) :: rounding
    !> radius of the body [m], its orientation [rad] and its centre (2) [m]
    real(dp), intent(in) :: scale, angle, centre(2)
    type(placed_piece_t), intent(inout) :: placed
    real(dp) :: c, s
    integer :: k

    placed%n = size(vertex, 2)
    placed%rounding = scale*rounding
    if (allocated(placed%vertex)) then
      if (size(placed%vertex, 2) < placed%n) deallocate (placed%vertex, placed%corner)
    end if
    if (.not. allocated(placed%vertex)) allocate (placed%vertex(2, placed%n), placed%corner(2, placed%n))
    c = scale*cos(angle)
    s = scale*sin(angle)
    do k = 1, placed%n
      placed%vertex(1, k) = centre(1) + (c*vertex(1, k) - s*vertex(2, k))
      placed%vertex(2, k) = centre(2) + (s*vertex(1, k) + c*vertex(2, k))
      placed%corner(1, k) = centre(1) + (c*corner(1, k) - s*corner(2, k))
      placed%corner(2, k) = centre(2) + (s*corner(1, k) + c*corner(2, k))
    end do
  end subroutine place_piece

  !> The contacts of piece a, the candidate, with piece b.
  pure subroutine find_polygon_manifold(a, b, alert, manifold)
    type(placed_piece_t), intent(in) :: a, b
    !> points with a larger gap are no contacts [m]
    real(dp), intent(in) :: alert
    type(manifold_t), intent(out) :: manifold
    type(side_t) :: side_a, side_b
    real(dp) :: normal(2), on_a(2), on_b(2), distance, range
    integer :: vertex_a, vertex_b

    manifold%point(3, 1:2) = 0.0_dp
    range = a%rounding + b%rounding + alert
    call find_separation(a, b, range, normal, distance)
    if (distance > range) return
    if (distance > 0.0_dp) then
      call find_distance(a, b, normal, distance, on_a, on_b)
      if (distance > range) return
    else
      manifold%cores_overlap = .true.
    end if
    vertex_a = extreme_vertex(a, -1.0_dp, normal)
    vertex_b = extreme_vertex(b, 1.0_dp, normal)
    call choose_side(a, vertex_a, -1.0_dp, normal, side_a)
    call choose_side(b, vertex_b, 1.0_dp, normal, side_b)
    if (manifold%cores_overlap) then
      ! the vertex before the side whose normal it is touches once the cores are apart
      on_b(:) = b%vertex(:, vertex_b)
      if (side_a%facing <= side_b%facing) on_b(:) = a%vertex(:, vertex_a) - distance*normal
    end if
    if (a%n > 1 .and. b%n > 1) call clip_sides(a, b, side_a, side_b, normal, alert, manifold)
    if (manifold%n > 0) return
    manifold%n = 1
    manifold%normal(1:2) = normal
    manifold%gap(1) = distance - a%rounding - b%rounding
    manifold%point(1:2, 1) = on_b + (b%rounding + 0.5_dp*manifold%gap(1))*normal
    manifold%key(1) = feature_base*feature(a, side_a, vertex_a) + feature(b, side_b, vertex_b)
  end subroutine find_polygon_manifold

  !> The contacts of a piece with the half-space behind a plane.
  pure subroutine find_plane_manifold(a, normal, level, alert, manifold)
    type(placed_piece_t), intent(in) :: a
    !> (2) unit vector to the free side
    real(dp), intent(in) :: normal(2)
    !> the plane is where normal . x = level [m]
    real(dp), intent(in) :: level, alert
    type(manifold_t), intent(out) :: manifold
    type(side_t) :: side
    real(dp) :: gap, ends(2, 2)
    integer :: vertex, k, first

    manifold%point(3, 1:2) = 0.0_dp
    vertex = extreme_vertex(a, -1.0_dp, normal)
    gap = sum(normal*a%vertex(:, vertex)) - level - a%rounding
    if (gap > alert) return
    manifold%normal(1:2) = normal
    call choose_side(a, vertex, -1.0_dp, normal, side)
    if (a%n > 1 .and. abs(cross(side%along, normal)) > sqrt(1.0_dp - facing_angle**2)) then
      call blend_ends(a, side, abs(sum(side%along*normal)), ends)
      do k = 1, 2
        gap = sum(normal*ends(:, k)) - level - a%rounding
        if (gap > alert) cycle
        manifold%n = manifold%n + 1
        manifold%gap(manifold%n) = gap
        manifold%point(1:2, manifold%n) = ends(:, k) - (a%rounding + 0.5_dp*gap)*normal
        first = merge(0, 1, k == 1)
        manifold%key(manifold%n) = feature_base*(2*side%k + first)
      end do
      if (manifold%n > 0) return
    end if
    manifold%n = 1
    manifold%gap(1) = gap
    if (a%n > 1) manifold%gap(1) = sum(normal*a%vertex(:, vertex)) - level - a%rounding
    manifold%point(1:2, 1) = a%vertex(:, vertex) - (a%rounding + 0.5_dp*manifold%gap(1))*normal
    manifold%key(1) = feature_base*feature(a, side, vertex)
  end subroutine find_plane_manifold

  !> The number of the feature of a piece that a single point lies on: its vertex, or its side where the normal is that of the side.
  pure integer function feature(piece, side, vertex)
    type(placed_piece_t), intent(in) :: piece
    type(side_t), intent(in) :: side
    integer, intent(in) :: vertex

    feature = 2*piece%n + 2 + vertex
    if (piece%n > 1 .and. side%facing > on_side) feature = 3*piece%n + 3 + side%k
  end function feature

  !> The largest distance by which a direction separates the cores: that from centre to centre, then those of all sides. More than
  !> `range` ends the search.
  pure subroutine find_separation(a, b, range, normal, distance)
    type(placed_piece_t), intent(in) :: a, b
    real(dp), intent(in) :: range
    !> from b to a
    real(dp), intent(out) :: normal(2), distance
    real(dp) :: length

    normal(:) = sum(a%vertex(:, 1:a%n), dim=2)/a%n - sum(b%vertex(:, 1:b%n), dim=2)/b%n
    length = norm2(normal)
    if (length > 0.0_dp) then
      normal(:) = normal/length
    else
      normal(:) = [0.0_dp, 1.0_dp]
    end if
    distance = separation(a, b, normal)
    if (distance > range) return
    call try_sides(a, b, -1.0_dp, normal, distance)
    if (distance > range) return
    call try_sides(b, a, 1.0_dp, normal, distance)
  end subroutine find_separation

  !> Take the normal of a side of `piece` where it separates the cores by more than `distance`.
  pure subroutine try_sides(piece, other, sense, normal, distance)
    type(placed_piece_t), intent(in) :: piece, other
    !> of the normal of a side in `normal`
    real(dp), intent(in) :: sense
    real(dp), intent(inout) :: normal(2), distance
    type(side_t) :: side
    real(dp) :: apart
    integer :: k

    if (piece%n < 2) return
    do k = 1, piece%n
      call make_side(piece, k, side)
      apart = sum(side%out*(other%vertex(:, extreme_vertex(other, -1.0_dp, side%out)) - piece%vertex(:, k)))
      if (apart <= distance) cycle
      distance = apart
      normal(:) = sense*side%out
    end do
  end subroutine try_sides

  !> By how much a direction separates the cores; below 0 where it does not [m].
  pure real(dp) function separation(a, b, normal)
    type(placed_piece_t), intent(in) :: a, b
    real(dp), intent(in) :: normal(2)

    separation = sum(normal*(a%vertex(:, extreme_vertex(a, -1.0_dp, normal)) - b%vertex(:, extreme_vertex(b, 1.0_dp, normal))))
  end function separation

  !> The shortest way between two cores, from b to a.
  pure subroutine find_shortest_way(a, b, overlap, normal, distance, on_a, on_b)
    type(placed_piece_t), intent(in) :: a, b
    !> they are not apart: the rest is not known
    logical, intent(out) :: overlap
    !> unit vector, and its length [m]
    real(dp), intent(out) :: normal(2), distance
    !> its ends [m]
    real(dp), intent(out) :: on_a(2), on_b(2)

    on_a(:) = 0.0_dp
    on_b(:) = 0.0_dp
    call find_separation(a, b, huge(1.0_dp), normal, distance)
    overlap = .not. distance > 0.0_dp
    if (.not. overlap) call find_distance(a, b, normal, distance, on_a, on_b)
  end subroutine find_shortest_way

  !> The shortest way between cores that are apart.
  pure subroutine find_distance(a, b, normal, distance, on_a, on_b)
    type(placed_piece_t), intent(in) :: a, b
    real(dp), intent(inout) :: normal(2), distance
    !> its ends [m]
    real(dp), intent(out) :: on_a(2), on_b(2)
    real(dp) :: least, foot(2), square
    integer :: k, l

    least = huge(1.0_dp)
    on_a(:) = a%vertex(:, 1)
    on_b(:) = b%vertex(:, 1)
    do k = 1, a%n
      do l = 1, b%n
        foot(:) = nearest_on_side(b, l, a%vertex(:, k))
        square = sum((a%vertex(:, k) - foot)**2)
        if (square >= least) cycle
        least = square
        on_a(:) = a%vertex(:, k)
        on_b(:) = foot
      end do
    end do
    do l = 1, b%n
      do k = 1, a%n
        foot(:) = nearest_on_side(a, k, b%vertex(:, l))
        square = sum((b%vertex(:, l) - foot)**2)
        if (square >= least) cycle
        least = square
        on_a(:) = foot
        on_b(:) = b%vertex(:, l)
      end do
    end do
    ! cores that touch keep the direction that separates them
    if (.not. sqrt(least) > tiny(1.0_dp)) return
    distance = sqrt(least)
    normal(:) = (on_a - on_b)/distance
  end subroutine find_distance

  !> The point of a side from vertex k on that is nearest to a point.
  pure function nearest_on_side(piece, k, point) result(nearest)
    type(placed_piece_t), intent(in) :: piece
    integer, intent(in) :: k
    real(dp), intent(in) :: point(2)
    real(dp) :: nearest(2), edge(2), square

    edge(:) = piece%vertex(:, mod(k, piece%n) + 1) - piece%vertex(:, k)
    square = sum(edge**2)
    nearest(:) = piece%vertex(:, k)
    if (square > 0.0_dp) nearest(:) = nearest + min(max(sum((point - nearest)*edge)/square, 0.0_dp), 1.0_dp)*edge
  end function nearest_on_side

  !> The vertex that lies farthest in a direction, or with the sense -1 against it; the first of several.
  pure integer function extreme_vertex(piece, sense, direction) result(vertex)
    type(placed_piece_t), intent(in) :: piece
    real(dp), intent(in) :: sense, direction(2)
    real(dp) :: most, along
    integer :: k

    vertex = 1
    most = -huge(1.0_dp)
    do k = 1, piece%n
      along = sense*sum(direction*piece%vertex(:, k))
      if (along <= most) cycle
      most = along
      vertex = k
    end do
  end function extreme_vertex

  pure subroutine make_side(piece, k, side)
    type(placed_piece_t), intent(in) :: piece
    integer, intent(in) :: k
    type(side_t), intent(out) :: side

    side%k = k
    side%ends(:, 1) = piece%vertex(:, k)
    side%ends(:, 2) = piece%vertex(:, mod(k, piece%n) + 1)
    side%along(:) = side%ends(:, 2) - side%ends(:, 1)
    side%along(:) = side%along/norm2(side%along)
    side%out(1) = side%along(2)
    side%out(2) = -side%along(1)
  end subroutine make_side

  !> Of the two sides at a vertex, the one that faces a direction most, or with the sense -1 its opposite.
  pure subroutine choose_side(piece, vertex, sense, direction, chosen)
    type(placed_piece_t), intent(in) :: piece
    integer, intent(in) :: vertex
    real(dp), intent(in) :: sense, direction(2)
    type(side_t), intent(out) :: chosen
    type(side_t) :: side
    integer :: k

    if (piece%n < 2) return
    do k = 0, 1
      call make_side(piece, mod(vertex - 1 - k + piece%n, piece%n) + 1, side)
      side%facing = sense*sum(side%out*direction)
      if (side%facing > chosen%facing) chosen = side
    end do
  end subroutine choose_side

  !> The ends of a side that stands at an angle to what it touches: between those of the core and the sharp corners. Long ways, to
  !> thin corners, are left at smaller angles, so that none is moved by more than a part of the rounding into what it touches.
  pure subroutine blend_ends(piece, side, angle, ends)
    type(placed_piece_t), intent(in) :: piece
    type(side_t), intent(in) :: side
    !> [rad], or its sine
    real(dp), intent(in) :: angle
    real(dp), intent(out) :: ends(2, 2)
    real(dp) :: way, over
    integer :: k, corner

    ends(:, :) = side%ends
    if (.not. piece%reaches_out) return
    do k = 1, 2
      corner = mod(side%k + k - 2, piece%n) + 1
      way = sum(side%along*(piece%corner(:, corner) - side%ends(:, k)))
      over = 1.0_dp
      if (abs(way) > piece%rounding) over = abs(way)/piece%rounding
      ends(:, k) = side%ends(:, k) + max(0.0_dp, 1.0_dp - angle/blend_angle*over)*way*side%along
    end do
  end subroutine blend_ends

  !> The ends of the part that two sides have in common, where they face each other. The side that faces the other piece more, or
  !> that of a, gives the normal; keys and the order of points do not depend on which it is.
  pure subroutine clip_sides(a, b, side_a, side_b, shortest, alert, manifold)
    type(placed_piece_t), intent(in) :: a, b
    type(side_t), intent(in) :: side_a, side_b
    !> direction of the shortest way (2)
    real(dp), intent(in) :: shortest(2), alert
    type(manifold_t), intent(inout) :: manifold
    type(ends_t) :: points
    real(dp) :: angle, turned, ends_a(2, 2), ends_b(2, 2)
    integer :: k

    angle = abs(cross(side_a%along, side_b%along))
    if (angle > facing_angle) return
    if (manifold%cores_overlap) then
      if (side_a%facing < 0.5_dp .or. side_b%facing < 0.5_dp) return
    else
      turned = min(abs(sum(side_a%along*shortest)), abs(sum(side_b%along*shortest)))
      if (turned > blend_angle) return
      angle = max(angle, turned)
    end if
    call blend_ends(a, side_a, angle, ends_a)
    call blend_ends(b, side_b, angle, ends_b)
    if (side_b%facing > side_a%facing) then
      manifold%normal(1:2) = side_b%out
      call clip(ends_b, side_b, b%rounding, ends_a, .true., points)
    else
      manifold%normal(1:2) = -side_a%out
      call clip(ends_a, side_a, a%rounding, ends_b, .false., points)
    end if
    points%gap(:) = points%gap - a%rounding - b%rounding
    do k = 1, points%n
      if (points%gap(k) > alert) cycle
      manifold%n = manifold%n + 1
      manifold%gap(manifold%n) = points%gap(k)
      manifold%point(1:2, manifold%n) = points%on_reference(:, k) - 0.5_dp*points%gap(k)*points%inwards
      manifold%key(manifold%n) = feature_base*(2*side_a%k + k - 1) + side_b%k
    end do
  end subroutine clip_sides

  !> The ends of the common part on the surface of the reference, from its first end on; the other side runs against it.
  pure subroutine clip(reference, side, rounding, other, other_is_a, points)
    !> (2, 2) ends [m]
    real(dp), intent(in) :: reference(2, 2), other(2, 2)
    !> of the reference, and its rounding [m]
    type(side_t), intent(in) :: side
    real(dp), intent(in) :: rounding
    !> points stand in ascending order along the side of piece a
    logical, intent(in) :: other_is_a
    type(ends_t), intent(out) :: points
    real(dp) :: place(2), height(2), low, high, at
    integer :: k

    do k = 1, 2
      place(k) = sum((other(:, k) - reference(:, 1))*side%along)
      height(k) = sum((other(:, k) - reference(:, 1))*side%out)
    end do
    low = max(place(2), 0.0_dp)
    high = min(place(1), sum((reference(:, 2) - reference(:, 1))*side%along))
    if (.not. high > low) return
    points%n = 2
    points%inwards(:) = -side%out
    do k = 1, 2
      at = merge(low, high, (k == 1) .neqv. other_is_a)
      points%gap(k) = height(2) + (height(1) - height(2))*((at - place(2))/(place(1) - place(2)))
      points%on_reference(:, k) = reference(:, 1) + at*side%along + rounding*side%out
    end do
  end subroutine clip

  pure real(dp) function cross(a, b)
    real(dp), intent(in) :: a(2), b(2)
    cross = a(1)*b(2) - a(2)*b(1)
  end function cross

end module gravier_polygon_pair
