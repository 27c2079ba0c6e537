!> A convex piece of a body: all points within a rounding of a convex core.
!>
!> The core of a polygon or polyhedron is what its user wants, with all sides moved inwards by the rounding, so that flat sides are
!> exactly where they are wanted and only corners, and edges in space, are round. A core of one vertex makes a disk or a sphere,
!> one of two a capsule. Lengths are those of a body whose radius, that of the ball about its centre of mass that holds all of it,
!> is 1; places are in the axes of the body from its centre of mass.
module gravier_convex_piece
  use gravier_kinds, only: dp
  implicit none
  private
  public :: convex_piece_t

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
  end type convex_piece_t

end module gravier_convex_piece
