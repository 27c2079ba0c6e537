!> Walls without a thickness between grains: segments and rectangles. Grains on both sides of one do not touch each other through
!> it, though the places where they touch it may be one. Meshes are none: to look for facets at each contact would take three times
!> as long as all the rest of detection.
module gravier_screens
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: screens_t

  !> The segments and rectangles of a scene that are there.
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
    is_screen = boundary%present .and. boundary%has_corners()
    if (is_screen) is_screen = boundary%touches()
  end function is_screen

  !> Whether one of them, through which neither of two bodies passes, lies between a point of one and a point of the other.
  pure logical function screens_part(self, decomposition, bodies, i, j, place, branch) result(part)
    class(screens_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    !> bodies
    integer, intent(in) :: i, j
    !> the point of i, and from the point of j to it (nd) [m]
    real(dp), intent(in) :: place(:), branch(:)
    integer :: k

    part = .false.
    do k = 1, size(self%boundary)
      associate (boundary => decomposition%boundaries(self%boundary(k)))
        if (.not. is_between(boundary, place, branch)) cycle
        associate (filter => decomposition%rule%filter, b => self%boundary(k))
          part = .not. (filter%lets_pass(bodies, decomposition%boundaries, i, -b) .or. &
            & filter%lets_pass(bodies, decomposition%boundaries, j, -b))
        end associate
        if (part) return
      end associate
    end do
  end function screens_part

  !> Whether a segment or a rectangle lies between two points.
  pure logical function is_between(boundary, place, branch) result(parts)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: place(:), branch(:)
    real(dp) :: from(3), to(3)

    call boundary%find_image(place, from)
    from(:) = from - boundary%surface%point
    to(:) = from
    to(1:size(branch)) = from(1:size(branch)) - branch
    parts = boundary%surface%parts(from, to)
  end function is_between

end module gravier_screens
