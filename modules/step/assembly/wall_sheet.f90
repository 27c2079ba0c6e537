!> Flat parts of walls as pieces, for what is asked of two pieces: the nearest points, the contact, whether they go past each other.
module gravier_wall_sheet
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t, list_faces
  use gravier_facet, only: find_facet_normal
  use gravier_boundary, only: boundary_t
  use gravier_seen_body, only: seen_body_t
  implicit none
  private
  public :: wall_sheet_t, level, leans

  !> sine of the slope of a wall at and below which it is level
  real(dp), parameter :: level = 1.0e-3_dp

  !> A segment, a facet or a rectangle of a boundary, seen from the centre of a body.
  type :: wall_sheet_t
    !> number of the boundary
    integer :: boundary = 0
    !> in order around it (3, 2 to 4) [m]; unit vector
    real(dp), allocatable :: corner(:, :)
    real(dp) :: normal(3) = 0.0_dp
    !> as a piece of a body
    type(convex_piece_t) :: piece
    type(seen_body_t) :: seen
  contains
    procedure :: init => wall_sheet_init
    procedure :: leans_at_edge => wall_sheet_leans_at_edge
  end type wall_sheet_t

contains

  !> The sheet with these corners of boundary `number`, with the velocities that it has at the start of the step.
  subroutine wall_sheet_init(self, boundary, number, centre, corners)
    class(wall_sheet_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: number
    !> of the body (nd) [m]
    real(dp), intent(in), contiguous :: centre(:)
    !> from there, in order around the sheet (3, 2 to 4) [m]
    real(dp), intent(in), contiguous :: corners(:, :)
    real(dp) :: place(size(centre))

    self%boundary = number
    self%corner = corners
    call find_facet_normal(corners(:, 1:min(size(corners, 2), 3)), self%normal)
    call make_piece(size(centre), corners, self%piece, self%seen)
    place(:) = centre + self%seen%centre(1:size(centre))
    call boundary%last_velocity_at(place, self%seen%velocity(1:size(centre)))
    self%seen%spin(:) = boundary%last_spin
  end subroutine wall_sheet_init

  !> Whether a contact is with the edge of the sheet, and not with its face: its normal leans.
  pure logical function wall_sheet_leans_at_edge(self, normal) result(leans_at_edge)
    class(wall_sheet_t), intent(in) :: self
    !> of the contact, a unit vector
    real(dp), intent(in) :: normal(3)
    leans_at_edge = leans(normal, self%normal)
  end function wall_sheet_leans_at_edge

  !> Whether a unit vector leans from the normal of a wall, to whichever side it looks.
  pure logical function leans(normal, of_wall)
    real(dp), intent(in) :: normal(3), of_wall(3)
    leans = norm2(normal - dot_product(normal, of_wall)*of_wall) > level
  end function leans

  !> A segment, a triangle or a rectangle as a piece without rounding, with one face to either side.
  pure subroutine make_piece(nd, corners, sheet, seen)
    integer, intent(in) :: nd
    !> from the centre of the candidate, in order around it (3, 2 to 4) [m]
    real(dp), intent(in) :: corners(:, :)
    type(convex_piece_t), intent(out) :: sheet
    type(seen_body_t), intent(out) :: seen
    integer :: k, n, next, last

    n = size(corners, 2)
    seen%shape = 1
    seen%centre(:) = sum(corners, dim=2)/n
    do k = 1, 3
      seen%axes(k, k) = 1.0_dp
    end do
    do k = 1, n
      seen%radius = max(seen%radius, norm2(corners(:, k) - seen%centre))
    end do
    allocate (sheet%vertex(nd, n))
    do k = 1, n
      sheet%vertex(:, k) = (corners(1:nd, k) - seen%centre(1:nd))/seen%radius
    end do
    sheet%corner = sheet%vertex
    if (nd == 2) return
    allocate (sheet%face_first(3), sheet%face_vertex(2*n), sheet%neighbour_first(n + 1), sheet%neighbour(2*n))
    do k = 1, 3
      sheet%face_first(k) = (k - 1)*n + 1
    end do
    do k = 1, n
      sheet%face_vertex(k) = k
      sheet%face_vertex(2*n + 1 - k) = k
      sheet%neighbour_first(k) = 2*k - 1
      next = mod(k, n) + 1
      last = mod(k + n - 2, n) + 1
      sheet%neighbour(2*k - 1) = min(next, last)
      sheet%neighbour(2*k) = max(next, last)
    end do
    sheet%neighbour_first(n + 1) = 2*n + 1
    call list_faces(sheet)
    allocate (sheet%face_normal(3, 2))
    sheet%face_normal(1, 1) = across(2, 3)
    sheet%face_normal(2, 1) = across(3, 1)
    sheet%face_normal(3, 1) = across(1, 2)
    sheet%face_normal(:, 1) = sheet%face_normal(:, 1)/norm2(sheet%face_normal(:, 1))
    sheet%face_normal(:, 2) = -sheet%face_normal(:, 1)

  contains

    !> A component of the cross product of the edges at the first corner.
    pure real(dp) function across(d, e)
      integer, intent(in) :: d, e

      across = (corners(d, 2) - corners(d, 1))*(corners(e, n) - corners(e, 1)) &
        & - (corners(e, 2) - corners(e, 1))*(corners(d, n) - corners(d, 1))
    end function across

  end subroutine make_piece

end module gravier_wall_sheet
