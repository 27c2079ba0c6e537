!> Joints of walls that several boundaries make: segments that continue each other, rectangles, meshes.
module gravier_wall_joints
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t, find_foot
  use gravier_facet_candidates, only: rises, has_point
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: is_in_joint, has_other, joints_t

  !> Of disks and spheres, in radii: distance below which edges of walls meet, below which two points are one, and below which two
  !> distances are equal; sine of the slope below which a wall is flat. Beside a flush joint distances are equal up to
  !> sqrt(2 equal), which is less than one_place.
  real(dp), parameter :: one_edge = 1.0e-3_dp, one_place = 2.0e-6_dp, equal = 1.0e-12_dp, flat = 1.0e-10_dp

  !> reach of what may be anywhere; its square is a number [m]
  real(dp), parameter :: anywhere = 1.0e150_dp

  !> Which boundaries may make one wall, and a sphere around each, so that most are left out at once.
  type :: joints_t
    !> there are several of them
    logical :: exist = .false.
    !> where there are: (3, boundaries), (boundaries), below 0 of a boundary that joins nothing, without end in scenes with a
    !> period [m]
    real(dp), allocatable :: middle(:, :), reach(:)
  contains
    procedure :: find => joints_find
  end type joints_t

contains

  !> Whether a point at the edge of a boundary lies in a hollow of the wall: another segment, rectangle or mesh has the point, too,
  !> and rises from it along the normal. Such a point is no place of contact (theory.md, mesh walls).
  logical function is_in_joint(boundaries, j, point, normal, tolerance, slack, passed) result(in_joint)
    type(boundary_t), intent(in) :: boundaries(:)
    !> the boundary of the edge
    integer, intent(in) :: j
    !> (nd) [m]; (3) unit vector towards the body
    real(dp), intent(in) :: point(:), normal(3)
    !> distance below which points are one [m]; sine of the slope below which a wall is flat
    real(dp), intent(in) :: tolerance, slack
    !> (boundaries) those that the body passes through; none where absent
    logical, intent(in), optional :: passed(:)
    logical :: has_it
    integer :: k

    in_joint = .false.
    do k = 1, size(boundaries)
      if (in_joint) return
      if (k == j .or. .not. boundaries(k)%touches()) cycle
      if (present(passed)) then
        if (passed(k)) cycle
      end if
      call meet_at(boundaries(k), point, normal, tolerance, slack, has_it, in_joint)
    end do
  end function is_in_joint

  !> Find the segments, rectangles and meshes that are there, where they are now.
  subroutine joints_find(self, boundaries)
    class(joints_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundaries(:)
    real(dp) :: corner(3, 8)
    integer :: b, k, n

    n = 0
    do b = 1, size(boundaries)
      if (joins(boundaries(b))) n = n + 1
    end do
    self%exist = n > 1
    if (.not. self%exist) return
    if (allocated(self%reach)) deallocate (self%middle, self%reach)
    allocate (self%middle(3, size(boundaries)), source=0.0_dp)
    allocate (self%reach(size(boundaries)), source=-1.0_dp)
    do b = 1, size(boundaries)
      if (.not. joins(boundaries(b))) cycle
      self%reach(b) = anywhere
      if (any(boundaries(b)%period > 0.0_dp)) cycle
      call boundaries(b)%surface%find_box(n, corner)
      self%middle(:, b) = sum(corner(:, 1:n), dim=2)/n
      self%reach(b) = 0.0_dp
      do k = 1, n
        self%reach(b) = max(self%reach(b), norm2(corner(:, k) - self%middle(:, b)))
      end do
    end do
  end subroutine joints_find

  !> Whether a boundary is there that may continue another one.
  pure logical function joins(boundary)
    type(boundary_t), intent(in) :: boundary

    joins = boundary%touches()
    if (joins) joins = boundary%has_corners() .or. boundary%is_faceted()
  end function joins

  !> Whether a contact of a disk or a sphere with a segment, a rectangle or a mesh is none, because the wall goes on with another
  !> boundary: its point lies in a hollow of the wall, or the other boundary has the contact, too. Only a boundary that is nearer,
  !> or as near and before it (a mesh, or the first), takes the contact away. Of all that are near one therefore always stays.
  logical function has_other(decomposition, joints, bodies, i, j, gap, normal)
    type(decomposition_t), intent(in) :: decomposition
    !> of its boundaries
    type(joints_t), intent(in) :: joints
    type(body_set_t), intent(in) :: bodies
    !> the body, and the boundary
    integer, intent(in) :: i, j
    !> [m], (nd) unit vector towards the body
    real(dp), intent(in) :: gap, normal(:)
    real(dp) :: point(size(normal)), corners(3, 4), towards(3), radius
    logical :: has_it, rises_there
    integer :: k, n

    has_other = .false.
    associate (boundaries => decomposition%boundaries)
      if (.not. (boundaries(j)%is_faceted() .or. boundaries(j)%has_corners())) return
      radius = bodies%radius(i)
      point(:) = bodies%position(:, i) - (gap + radius)*normal
      if (.not. boundaries(j)%is_faceted()) then
        call boundaries(j)%find_corners(point, n, corners)
        if (.not. is_on_rim(corners(:, 1:n), one_place*radius)) return
      end if
      towards(:) = 0.0_dp
      towards(1:size(normal)) = normal
      do k = 1, size(boundaries)
        if (k == j .or. joints%reach(k) < 0.0_dp) cycle
        if (sum((point - joints%middle(1:size(point), k))**2) > (joints%reach(k) + one_edge*radius)**2) cycle
        if (decomposition%rule%filter%lets_pass(bodies, boundaries, i, -k)) cycle
        call meet_at(boundaries(k), point, towards, one_edge*radius, flat, has_it, rises_there)
        if (has_it .and. .not. rises_there) call meet_at(boundaries(k), point, towards, one_place*radius, flat, has_it, rises_there)
        if (.not. has_it) cycle
        has_other = comes_before(boundaries, k, j, bodies%position(:, i), gap + radius, equal*radius)
        if (has_other) return
      end do
    end associate
  end function has_other

  !> Whether boundary `k` is nearer to a point than boundary `j`, or as near and before it.
  logical function comes_before(boundaries, k, j, centre, distance, tolerance)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k, j
    !> (nd), distance of `j`, difference below which distances are equal [m]
    real(dp), intent(in) :: centre(:), distance, tolerance
    type(near_facets_t) :: near
    real(dp) :: found, normal(size(centre)), foot(3)
    integer :: f, where_foot_is

    if (boundaries(k)%is_faceted()) then
      found = huge(1.0_dp)
      call boundaries(k)%find_facets(centre, abs(distance) + 2.0_dp*tolerance, near)
      do f = 1, near%n
        call find_foot(near%corner(:, :, f), foot, where_foot_is)
        found = min(found, norm2(foot))
      end do
    else
      call boundaries(k)%locate(centre, found, normal)
    end if
    comes_before = found < distance - tolerance
    if (abs(found - distance) > tolerance) return
    comes_before = k < j
    if (boundaries(k)%is_faceted() .neqv. boundaries(j)%is_faceted()) comes_before = boundaries(k)%is_faceted()
  end function comes_before

  !> Whether the origin lies on the rim of a segment or a rectangle with these corners, in order around it.
  pure logical function is_on_rim(corners, tolerance)
    !> (3, 2 or 4) [m]
    real(dp), intent(in) :: corners(:, :)
    real(dp), intent(in) :: tolerance
    real(dp) :: side(3), share
    integer :: c, n

    is_on_rim = .false.
    n = size(corners, 2)
    do c = 1, n
      side(:) = 0.0_dp
      if (n == 4) side(:) = corners(:, mod(c, n) + 1) - corners(:, c)
      share = 0.0_dp
      if (n == 4) share = min(max(-dot_product(corners(:, c), side)/max(sum(side**2), tiny(1.0_dp)), 0.0_dp), 1.0_dp)
      is_on_rim = is_on_rim .or. norm2(corners(:, c) + share*side) <= tolerance
    end do
  end function is_on_rim

  !> Whether a boundary has a point, within a tolerance, and whether it rises from it along a normal.
  pure subroutine meet_at(boundary, point, normal, tolerance, slack, has_it, rises_there)
    type(boundary_t), intent(in) :: boundary
    !> (nd) [m]; (3) unit vector
    real(dp), intent(in) :: point(:), normal(3)
    !> [m], and the sine of the slope below which a wall is flat
    real(dp), intent(in) :: tolerance, slack
    logical, intent(out) :: has_it, rises_there
    type(near_facets_t) :: near
    real(dp) :: corners(3, 4)
    integer :: f, n

    has_it = .false.
    rises_there = .false.
    if (boundary%is_faceted()) then
      call boundary%find_facets(point, tolerance, near)
      do f = 1, near%n
        call look(near%corner(:, :, f), normal, tolerance, slack, has_it, rises_there)
      end do
    else
      call boundary%find_corners(point, n, corners)
      if (n == 2) call look(corners(:, 1:2), normal, tolerance, slack, has_it, rises_there)
      if (n < 4) return
      ! the two triangles of a rectangle
      call look(corners(:, 1:3), normal, tolerance, slack, has_it, rises_there)
      corners(:, 2) = corners(:, 4)
      call look(corners(:, 1:3), normal, tolerance, slack, has_it, rises_there)
    end if
  end subroutine meet_at

  !> The same of one facet, seen from the point, beside what is known of others.
  pure subroutine look(corner, normal, tolerance, slack, has_it, rises_there)
    !> (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp), intent(in) :: normal(3), tolerance, slack
    logical, intent(inout) :: has_it, rises_there
    real(dp), parameter :: here(3) = [0.0_dp, 0.0_dp, 0.0_dp]

    if (rises(corner, normal, here, tolerance, slack)) then
      ! it has the point
      rises_there = .true.
      has_it = .true.
    else if (.not. has_it) then
      has_it = has_point(corner, here, tolerance)
    end if
  end subroutine look

end module gravier_wall_joints
