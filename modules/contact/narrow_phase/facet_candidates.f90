!> Which facets of a wall a convex piece touches, among those that it is near to.
!>
!> A piece touches a wall where its core is locally nearest to the union of the facets. The point of a facet that is nearest to the
!> core is such a place if no other facet that has the point rises from it along the normal: the normal then lies in the normal cone
!> of each of them (R. T. Rockafellar, Convex Analysis, 1970, theorem 27.4, for each pair of convex sets). A side or a corner inside
!> a flat part of the wall, or in a hollow, is therefore no place of contact, and one that sticks out is one place, however many
!> facets have it.
module gravier_facet_candidates
  use gravier_kinds, only: dp
  use gravier_facet, only: near_facets_t, find_foot, find_facet_normal, longest_side
  implicit none
  private
  public :: facet_candidate_t, facet_candidates_t, tolerance_for, has_point, rises

  !> places nearer to each other than this part of the rounding, with normals that differ by less, are one
  real(dp), parameter :: same = 1.0e-6_dp
  !> distances that differ by less than this part of the rounding may be equal: facets that lie along the plane of contact come
  !> first
  real(dp), parameter :: equal = 1.0e-9_dp
  !> gaps between facets are rounding of the file where they are less than this part of the rounding of a piece
  real(dp), parameter :: narrow_gap = 1.0e-3_dp
  !> rise of a facet, in parts of its longest side, that rounding could make
  real(dp), parameter :: rounding_of_rise = 1.0e-10_dp

  !> A place where a piece may touch a facet.
  type :: facet_candidate_t
    !> of the facet among those near
    integer :: place = 0
    !> of the core [m]; below 0 where it overlaps the facet
    real(dp) :: distance = 0.0_dp
    !> the normal is that of the facet
    logical :: lies_along = .false.
    !> unit vector from the facet to the piece, and the point of the facet [m]
    real(dp) :: normal(3) = 0.0_dp, foot(3) = 0.0_dp
    !> it is no place of contact, or one that was seen to
    logical :: dropped = .false.
    !> place of a facet whose plane has the point of this candidate and is the first to touch there; 0 for none
    integer :: beside = 0
  end type facet_candidate_t

  !> Candidates, the nearest first once they are sorted.
  type :: facet_candidates_t
    integer :: n = 0
    type(facet_candidate_t), allocatable :: item(:)
    !> numbers of the items in the order of their distances (n)
    integer, allocatable :: order(:)
  contains
    procedure :: clear => facet_candidates_clear
    procedure :: add => facet_candidates_add
    procedure :: sort => facet_candidates_sort
    procedure :: drop_hidden => facet_candidates_drop_hidden
    procedure :: is_hidden => facet_candidates_is_hidden
    procedure :: drop_repeated => facet_candidates_drop_repeated
  end type facet_candidates_t

contains

  !> Distance below which points of two facets are one, for a piece of some rounding [m].
  pure real(dp) function tolerance_for(near, rounding) result(tolerance)
    type(near_facets_t), intent(in) :: near
    !> [m]
    real(dp), intent(in) :: rounding
    tolerance = min(near%tolerance, narrow_gap*rounding)
  end function tolerance_for

  !> Forget all candidates, and have room for so many.
  pure subroutine facet_candidates_clear(self, room)
    class(facet_candidates_t), intent(inout) :: self
    integer, intent(in) :: room

    self%n = 0
    if (allocated(self%item)) then
      if (size(self%item) >= room) return
      deallocate (self%item, self%order)
    end if
    allocate (self%item(2*room + 8), self%order(2*room + 8))
  end subroutine facet_candidates_clear

  pure subroutine facet_candidates_add(self, candidate)
    class(facet_candidates_t), intent(inout) :: self
    type(facet_candidate_t), intent(in) :: candidate

    self%n = self%n + 1
    self%item(self%n) = candidate
  end subroutine facet_candidates_add

  !> Find the order of the candidates: by distance, those along the plane of contact first where distances may be equal, then by the
  !> numbers of their facets.
  pure subroutine facet_candidates_sort(self, near, rounding)
    class(facet_candidates_t), intent(inout) :: self
    type(near_facets_t), intent(in) :: near
    !> of the piece [m]
    real(dp), intent(in) :: rounding
    real(dp) :: value(self%n)
    integer :: k, l, kept

    do k = 1, self%n
      value(k) = self%item(k)%distance
      if (.not. self%item(k)%lies_along) value(k) = value(k) + equal*rounding
    end do
    do k = 1, self%n
      kept = k
      l = k
      do while (l > 1)
        if (.not. is_before(kept, self%order(l - 1))) exit
        self%order(l) = self%order(l - 1)
        l = l - 1
      end do
      self%order(l) = kept
    end do

  contains

    pure logical function is_before(a, b)
      integer, intent(in) :: a, b

      is_before = value(a) < value(b)
      if (.not. is_before .and. .not. value(b) < value(a)) &
        & is_before = near%number(self%item(a)%place) < near%number(self%item(b)%place)
    end function is_before

  end subroutine facet_candidates_sort

  !> Drop candidates from whose points a facet rises that is nearer to the piece. The first candidate stays.
  pure subroutine facet_candidates_drop_hidden(self, near, tolerance, slack)
    !> sorted
    class(facet_candidates_t), intent(inout) :: self
    type(near_facets_t), intent(in) :: near
    !> of tolerance_for [m]
    real(dp), intent(in) :: tolerance
    !> sine of the slope of a facet at and below which it counts as flat
    real(dp), intent(in) :: slack
    integer :: k

    do k = 2, self%n
      associate (item => self%item(self%order(k)))
        item%dropped = self%is_hidden(k, near, item%foot, tolerance, slack)
      end associate
    end do
  end subroutine facet_candidates_drop_hidden

  !> Whether a facet that is nearer to the piece rises from a point of a candidate.
  pure logical function facet_candidates_is_hidden(self, k, near, foot, tolerance, slack) result(hidden)
    !> sorted
    class(facet_candidates_t), intent(in) :: self
    !> place of the candidate in the order
    integer, intent(in) :: k
    type(near_facets_t), intent(in) :: near
    !> point of its facet; and of tolerance_for [m]
    real(dp), intent(in) :: foot(3), tolerance
    !> sine of the slope of a facet at and below which it counts as flat
    real(dp), intent(in) :: slack
    integer :: l

    hidden = .false.
    do l = 1, k - 1
      hidden = rises(near%corner(:, :, self%item(self%order(l))%place), self%item(self%order(k))%normal, foot, tolerance, slack)
      if (hidden) return
    end do
  end function facet_candidates_is_hidden

  !> Whether a facet has a point and rises from there along a normal.
  pure logical function rises(corner, normal, point, tolerance, slack)
    !> (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    !> unit vector, and the point [m]
    real(dp), intent(in) :: normal(3), point(3)
    real(dp), intent(in) :: tolerance, slack
    real(dp) :: height, of_facet(3)
    integer :: c

    rises = .false.
    height = 0.0_dp
    do c = 1, size(corner, 2)
      height = max(height, dot_product(normal, corner(:, c) - point))
    end do
    if (height <= tiny(1.0_dp)) return
    if (height <= rounding_of_rise*longest_side(corner)) return
    ! the slope, and not the rise over the longest side: a facet may be long and narrow
    call find_facet_normal(corner, of_facet)
    if (norm2(normal - dot_product(normal, of_facet)*of_facet) > slack) rises = has_point(corner, point, tolerance)
  end function rises

  !> Whether a facet has a point.
  pure logical function has_point(corner, point, tolerance)
    !> (3, 2 or 3) [m]
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp), intent(in) :: point(3)
    !> distance below which the point is on the facet [m]
    real(dp), intent(in) :: tolerance
    real(dp) :: from(3, size(corner, 2)), foot(3)
    integer :: c, where_foot_is

    do c = 1, size(corner, 2)
      from(:, c) = corner(:, c) - point
    end do
    call find_foot(from, foot, where_foot_is)
    has_point = dot_product(foot, foot) <= tolerance**2
  end function has_point

  !> Drop candidates that are one with another: a point of a side or corner that several facets have.
  pure subroutine facet_candidates_drop_repeated(self, rounding)
    !> sorted
    class(facet_candidates_t), intent(inout) :: self
    !> [m]
    real(dp), intent(in) :: rounding
    integer :: k, l

    do k = 2, self%n
      associate (item => self%item(self%order(k)))
        do l = 1, k - 1
          if (item%dropped) exit
          associate (other => self%item(self%order(l)))
            if (other%dropped) cycle
            if (maxval(abs(item%foot - other%foot)) > same*rounding) cycle
            item%dropped = maxval(abs(item%normal - other%normal)) <= same
          end associate
        end do
      end associate
    end do
  end subroutine facet_candidates_drop_repeated

end module gravier_facet_candidates
