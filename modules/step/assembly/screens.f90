!> Walls without a thickness between grains: segments, rectangles and meshes. Grains on both sides of one do not touch each other
!> through it, though the places where they touch it may be one. Facets are looked at between two bodies that both may come to touch
!> some: to look for them at each contact would take three times as long as all the rest of detection.
module gravier_screens
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: screens_t

  !> The walls without a thickness of a scene that are there.
  type :: screens_t
    !> there are some
    logical :: exist = .false.
    !> numbers of their boundaries (n)
    integer, private, allocatable :: boundary(:)
  contains
    procedure :: find => screens_find
    procedure :: part => screens_part
  end type screens_t

contains

  pure subroutine screens_find(self, boundaries)
    class(screens_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: b, n

    n = 0
    do b = 1, size(boundaries)
      if (is_screen(boundaries(b))) n = n + 1
    end do
    self%exist = n > 0
    if (.not. self%exist) return
    if (allocated(self%boundary)) deallocate (self%boundary)
    allocate (self%boundary(n))
    n = 0
    do b = 1, size(boundaries)
      if (.not. is_screen(boundaries(b))) cycle
      n = n + 1
      self%boundary(n) = b
    end do
  end subroutine screens_find

  !> Whether a boundary is a wall without a thickness.
  pure logical function is_screen(boundary)
    type(boundary_t), intent(in) :: boundary
    is_screen = boundary%touches() .and. (boundary%has_corners() .or. boundary%is_faceted())
  end function is_screen

  !> Whether one of them, through which neither of two bodies passes, lies between a point of one and a point of the other.
  pure logical function screens_part(self, decomposition, view, pair, place, branch) result(part)
    class(screens_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: view
    !> place of the two bodies in the list
    integer, intent(in) :: pair
    !> the point of the candidate, and from the point of the antagonist to it (nd) [m]
    real(dp), intent(in) :: place(:), branch(:)
    logical :: at_facets
    integer :: k

    part = .false.
    associate (list => view%list, filter => decomposition%rule%filter)
      at_facets = allocated(list%at_facets)
      if (at_facets) at_facets = list%at_facets(list%candidate(pair)) .and. list%at_facets(list%antagonist(pair))
      do k = 1, size(self%boundary)
        associate (boundary => decomposition%boundaries(self%boundary(k)), b => self%boundary(k))
          if (boundary%is_faceted()) then
            if (.not. at_facets) cycle
          end if
          if (.not. boundary%lies_between(place, branch)) cycle
          part = .not. (filter%lets_pass(view%bodies, decomposition%boundaries, list%candidate(pair), -b) .or. &
            & filter%lets_pass(view%bodies, decomposition%boundaries, list%antagonist(pair), -b))
          if (part) return
        end associate
      end do
    end associate
  end function screens_part

end module gravier_screens
