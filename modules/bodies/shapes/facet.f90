!> Facets, the pieces that mesh walls are made of: segments in the plane, triangles in space; and those of a wall that are near a
!> point.
module gravier_facet
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  implicit none
  private
  public :: near_facets_t, find_foot, find_facet_normal, longest_side, within, on_side, at_corner

  !> what the point of a facet that is nearest to another point is: a point within the facet, of a side of a triangle, or a corner
  integer, parameter :: within = 0, on_side = 1, at_corner = 2

  !> Facets near a point, seen from there.
  !> Added to the number of a facet for each further image of it. Keys of points keep numbers modulo a power of two, of which this
  !> is no multiple.
  integer, parameter :: image_stride = 16411

  type :: near_facets_t
    integer :: n = 0
    !> numbers of the facets, in the order in which they were found (n)
    integer, allocatable :: number(:)
    !> (3, corners of a facet, n) [m]
    real(dp), allocatable :: corner(:, :, :)
    !> distance below which rounding of the file does not tell points of two facets apart [m]
    real(dp) :: tolerance = 0.0_dp
  contains
    procedure :: add => near_facets_add
    procedure :: number_images => near_facets_number_images
    procedure :: join_lines => near_facets_join_lines
  end type near_facets_t

contains

  !> Give the second and further images of a facet numbers of their own: by these the points where a body touches them are known
  !> again. Images have an order in which they are found.
  pure subroutine near_facets_number_images(self)
    class(near_facets_t), intent(inout) :: self
    integer :: k

    do k = self%n, 2, -1
      self%number(k) = self%number(k) + image_stride*count(self%number(1:k - 1) == self%number(k))
    end do
  end subroutine near_facets_number_images

  !> Add a facet.
  pure subroutine near_facets_add(self, number, corner)
    class(near_facets_t), intent(inout) :: self
    integer, intent(in) :: number
    !> (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    integer, allocatable :: longer_number(:)
    real(dp), allocatable :: longer_corner(:, :, :)

    if (.not. allocated(self%number)) allocate (self%number(16), self%corner(3, size(corner, 2), 16))
    if (self%n == size(self%number)) then
      allocate (longer_number(2*self%n), longer_corner(3, size(corner, 2), 2*self%n))
      longer_number(1:self%n) = self%number
      longer_corner(:, :, 1:self%n) = self%corner
      call move_alloc(longer_number, self%number)
      call move_alloc(longer_corner, self%corner)
    end if
    self%n = self%n + 1
    self%number(self%n) = number
    self%corner(:, :, self%n) = corner
  end subroutine near_facets_add

  !> Make one of the segments that continue each other along a line; it has the lowest of their numbers.
  pure subroutine near_facets_join_lines(self)
    class(near_facets_t), intent(inout) :: self
    real(dp) :: low(3), high(3)
    integer :: k, l
    logical :: joined

    k = 1
    do while (k <= self%n)
      joined = .false.
      do l = k + 1, self%n
        call join(self%corner(:, :, k), self%corner(:, :, l), self%tolerance, joined, low, high)
        if (.not. joined) cycle
        self%corner(:, 1, k) = low
        self%corner(:, 2, k) = high
        self%number(k) = min(self%number(k), self%number(l))
        self%corner(:, :, l) = self%corner(:, :, self%n)
        self%number(l) = self%number(self%n)
        self%n = self%n - 1
        exit
      end do
      ! a longer segment may continue one that was passed over
      if (.not. joined) k = k + 1
    end do
  end subroutine near_facets_join_lines

  !> The ends of two segments that lie along one line and touch, if they do.
  pure subroutine join(a, b, tolerance, joined, low, high)
    real(dp), intent(in) :: a(3, 2), b(3, 2), tolerance
    logical, intent(out) :: joined
    real(dp), intent(out) :: low(3), high(3)
    real(dp) :: along(3), across(3), length, place(2), way(3)
    integer :: k

    low(:) = a(:, 1)
    high(:) = a(:, 2)
    along(:) = high - low
    length = norm2(along)
    along(:) = along/length
    joined = .true.
    do k = 1, 2
      way(:) = b(:, k) - low
      place(k) = dot_product(way, along)
      across(:) = way - place(k)*along
      joined = joined .and. norm2(across) <= tolerance
    end do
    joined = joined .and. maxval(place) >= -tolerance .and. minval(place) <= length + tolerance
    if (.not. joined) return
    if (minval(place) < 0.0_dp) low(:) = b(:, minloc(place, dim=1))
    if (maxval(place) > length) high(:) = b(:, maxloc(place, dim=1))
  end subroutine join

  !> The point of a facet that is nearest to the origin (C. Ericson, Real-Time Collision Detection, 2005, 5.1.5).
  pure subroutine find_foot(corner, foot, place)
    !> (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp), intent(out) :: foot(3)
    !> within, on_side or at_corner
    integer, intent(out) :: place

    if (size(corner, 2) == 2) then
      call find_foot_of_segment(corner(:, 1), corner(:, 2), foot, place)
    else
      call find_foot_of_triangle(corner(:, 1), corner(:, 2), corner(:, 3), foot, place)
    end if
  end subroutine find_foot

  pure subroutine find_foot_of_segment(a, b, foot, place)
    real(dp), intent(in) :: a(3), b(3)
    real(dp), intent(out) :: foot(3)
    integer, intent(out) :: place
    real(dp) :: along(3), share

    along(:) = b - a
    share = -dot_product(a, along)/dot_product(along, along)
    place = at_corner
    if (share <= 0.0_dp) then
      foot(:) = a
    else if (share >= 1.0_dp) then
      foot(:) = b
    else
      foot(:) = a + share*along
      ! the part along the segment is rounding
      foot(:) = foot - dot_product(foot, along)/dot_product(along, along)*along
      place = within
    end if
  end subroutine find_foot_of_segment

  pure subroutine find_foot_of_triangle(a, b, c, foot, place)
    real(dp), intent(in) :: a(3), b(3), c(3)
    real(dp), intent(out) :: foot(3)
    integer, intent(out) :: place
    real(dp) :: ab(3), ac(3), d(6), part_a, part_b, part_c, normal(3)

    ab(:) = b - a
    ac(:) = c - a
    d(1) = -dot_product(ab, a)
    d(2) = -dot_product(ac, a)
    d(3) = -dot_product(ab, b)
    d(4) = -dot_product(ac, b)
    d(5) = -dot_product(ab, c)
    d(6) = -dot_product(ac, c)
    part_a = d(3)*d(6) - d(5)*d(4)
    part_b = d(5)*d(2) - d(1)*d(6)
    part_c = d(1)*d(4) - d(3)*d(2)
    place = at_corner
    if (d(1) <= 0.0_dp .and. d(2) <= 0.0_dp) then
      foot(:) = a
    else if (d(3) >= 0.0_dp .and. d(4) <= d(3)) then
      foot(:) = b
    else if (d(6) >= 0.0_dp .and. d(5) <= d(6)) then
      foot(:) = c
    else if (part_c <= 0.0_dp .and. d(1) >= 0.0_dp .and. d(3) <= 0.0_dp) then
      call find_foot_of_side(a, b, foot, place)
    else if (part_b <= 0.0_dp .and. d(2) >= 0.0_dp .and. d(6) <= 0.0_dp) then
      call find_foot_of_side(a, c, foot, place)
    else if (part_a <= 0.0_dp .and. d(4) >= d(3) .and. d(5) >= d(6)) then
      call find_foot_of_side(b, c, foot, place)
    else
      normal(:) = cross(ab, ac)
      foot(:) = dot_product(a, normal)/dot_product(normal, normal)*normal
      place = within
    end if
  end subroutine find_foot_of_triangle

  pure subroutine find_foot_of_side(a, b, foot, place)
    real(dp), intent(in) :: a(3), b(3)
    real(dp), intent(out) :: foot(3)
    integer, intent(out) :: place

    call find_foot_of_segment(a, b, foot, place)
    if (place == within) place = on_side
  end subroutine find_foot_of_side

  !> Unit normal of a facet: of a triangle, the side from which its corners run anticlockwise; of a segment, its right.
  pure subroutine find_facet_normal(corner, normal)
    !> (3, 2 or 3)
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp), intent(out) :: normal(3)
    real(dp) :: ab(3), ac(3)

    ab(:) = corner(:, 2) - corner(:, 1)
    if (size(corner, 2) == 2) then
      normal(1) = ab(2)
      normal(2) = -ab(1)
      normal(3) = 0.0_dp
    else
      ac(:) = corner(:, 3) - corner(:, 1)
      normal(:) = cross(ab, ac)
    end if
    normal(:) = normal/norm2(normal)
  end subroutine find_facet_normal

  !> Length of the longest side of a facet.
  pure real(dp) function longest_side(corner) result(longest)
    !> (3, 2 or 3)
    real(dp), intent(in), contiguous :: corner(:, :)
    integer :: k

    longest = 0.0_dp
    do k = 1, size(corner, 2)
      longest = max(longest, norm2(corner(:, mod(k, size(corner, 2)) + 1) - corner(:, k)))
    end do
  end function longest_side

end module gravier_facet
