!> A convex piece of a body: all points within a rounding of a convex core.
!>
!> The core of a polygon or polyhedron is what its user wants, with all sides moved inwards by the rounding, so that flat sides are
!> exactly where they are wanted and only corners, and edges in space, are round. A core of one vertex makes a disk or a sphere,
!> one of two a capsule. Lengths are those of a body whose radius, that of the ball about its centre of mass that holds all of it,
!> is 1; places are in the axes of the body from its centre of mass.
module gravier_convex_piece
  use gravier_kinds, only: dp, i4
  implicit none
  private
  public :: convex_piece_t
  public :: find_starts, sector_of

  type :: convex_piece_t
    !> the rounding, above 0
    real(dp) :: rounding = 0.0_dp
    !> vertices of the core (nd, n); in 2D anticlockwise
    real(dp), allocatable :: vertex(:, :)
    !> the sharp corner behind each vertex, where the sides that meet there would meet without rounding (nd, n); the vertex itself
    !> where the core has no sides: one vertex or two
    real(dp), allocatable :: corner(:, :)
    !> in 3D, faces of the core: vertices face_vertex(face_first(f):face_first(f + 1) - 1) of face f, anticlockwise seen from
    !> outside (faces + 1), unit normals to the outside (3, faces); all 0 in size where the core has no volume
    integer, allocatable :: face_first(:), face_vertex(:)
    real(dp), allocatable :: face_normal(:, :)
    !> in 3D, the vertices that share an edge with each: neighbour(neighbour_first(v):neighbour_first(v + 1) - 1) of vertex v, in
    !> ascending order (n + 1)
    integer, allocatable :: neighbour_first(:), neighbour(:)
    !> in 3D, for a core of many vertices, the vertex that is farthest along the middle of each sector of directions: a search along
    !> edges starts from it (number_of_sectors)
    integer, allocatable :: start(:)
  end type convex_piece_t

  !> from this number of vertices on, the farthest one is searched along edges
  integer, parameter :: many_vertices = 24
  !> sectors of directions: the sides of a cube, each divided this often along both of its axes
  integer, parameter :: divisions = 4
  integer, parameter :: number_of_sectors = 6*divisions**2

contains

  !> Find the vertices from which searches start, if the piece has many. It needs `vertex`, of which later only the scale may
  !> change.
  pure subroutine find_starts(piece)
    type(convex_piece_t), intent(inout) :: piece
    real(dp) :: middle(3), farthest, reach
    integer :: axis, side, first, second, v, sector

    if (allocated(piece%start)) deallocate (piece%start)
    if (size(piece%vertex, 1) /= 3 .or. size(piece%vertex, 2) < many_vertices) return
    allocate (piece%start(number_of_sectors))
    do axis = 1, 3
      do side = -1, 1, 2
        do first = 1, divisions
          do second = 1, divisions
            middle(axis) = real(side, dp)
            middle(mod(axis, 3) + 1) = real(2*first - 1 - divisions, dp)/divisions
            middle(mod(axis + 1, 3) + 1) = real(2*second - 1 - divisions, dp)/divisions
            sector = sector_of(middle)
            farthest = -huge(1.0_dp)
            do v = 1, size(piece%vertex, 2)
              reach = dot_product(middle, piece%vertex(:, v))
              if (.not. reach > farthest) cycle
              farthest = reach
              piece%start(sector) = v
            end do
          end do
        end do
      end do
    end do
  end subroutine find_starts

  !> The sector that a direction lies in, 1 to number_of_sectors; a vector without length lies in one of them.
  pure integer function sector_of(along) result(sector)
    !> of any length
    real(dp), intent(in) :: along(3)
    real(dp) :: longest, first, second
    integer :: axis

    axis = 1
    if (abs(along(2)) > abs(along(axis))) axis = 2
    if (abs(along(3)) > abs(along(axis))) axis = 3
    longest = max(abs(along(axis)), tiny(longest))
    first = along(mod(axis, 3) + 1)/longest
    second = along(mod(axis + 1, 3) + 1)/longest
    sector = 2*(axis - 1)
    if (along(axis) < 0.0_dp) sector = sector + 1
    sector = (sector*divisions + division_of(first))*divisions + division_of(second) + 1
  end function sector_of

  !> Division 0 to divisions - 1 of a side of the cube.
  pure integer function division_of(place) result(division)
    !> -1 to 1
    real(dp), intent(in) :: place

    division = min(int(0.5_dp*divisions*(place + 1.0_dp), i4), divisions - 1)
  end function division_of

end module gravier_convex_piece
