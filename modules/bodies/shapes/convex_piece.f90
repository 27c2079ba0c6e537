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
  public :: find_support, find_candidates, list_faces, bound_piece, number_of_sectors, shares_corner, looks_along, first_of_corner

  type :: convex_piece_t
    !> the rounding, above 0
    real(dp) :: rounding = 0.0_dp
    !> vertices of the core (nd, n); in 2D anticlockwise
    real(dp), allocatable :: vertex(:, :)
    !> the sharp corner behind each vertex, where the sides that meet there would meet without rounding (nd, n); the vertex itself
    !> where the core has no sides: one vertex or two. A corner where more than three faces meet may be behind several vertices, one
    !> after the other: they are one point where another body touches them
    real(dp), allocatable :: corner(:, :)
    !> whether a side, a face or an edge that lies in the plane of contact reaches out to the sharp corners
    logical :: reaches_out = .true.
    !> in 3D, faces of the core: vertices face_vertex(face_first(f):face_first(f + 1) - 1) of face f, anticlockwise seen from
    !> outside (faces + 1), unit normals to the outside (3, faces); all 0 in size where the core has no volume
    integer, allocatable :: face_first(:), face_vertex(:)
    real(dp), allocatable :: face_normal(:, :)
    !> in 3D, the vertices that share an edge with each: neighbour(neighbour_first(v):neighbour_first(v + 1) - 1) of vertex v, in
    !> ascending order (n + 1)
    integer, allocatable :: neighbour_first(:), neighbour(:)
    !> in 3D, the faces that have each vertex as a corner: vertex_face(vertex_face_first(v):vertex_face_first(v + 1) - 1) of vertex
    !> v, in ascending order (n + 1)
    integer, allocatable :: vertex_face_first(:), vertex_face(:)
    !> centre and radius of a ball that holds the piece with its rounding (nd)
    real(dp), allocatable :: middle(:)
    real(dp) :: reach = 0.0_dp
    !> corners of the largest face, at least 2
    integer :: largest_face = 2
    !> in 3D, for a core of some vertices, those that can be the farthest along a direction of a sector, in ascending order:
    !> candidate(candidate_first(s):candidate_first(s + 1) - 1) of sector s (number_of_sectors + 1)
    integer, allocatable :: candidate_first(:), candidate(:)
  end type convex_piece_t

  !> from this number of vertices on, the farthest one is sought among those of a sector of directions
  integer, parameter :: some_vertices = 8
  !> sectors of directions: the sides of a cube, each divided this often along both of its axes
  integer, parameter :: divisions = 8
  integer, parameter :: number_of_sectors = 6*divisions**2
  !> a vertex that another is ahead of by more than this, along all directions of a sector whose largest component is 1, is never
  !> the farthest there, whatever rounding does; the body has the radius 1
  real(dp), parameter :: ahead = 1.0e-9_dp

contains

  !> Whether a vertex may be the next to meet a plane: a face at it looks at the plane within 60 degrees. Others are on the far
  !> side, however near they are, as the upper corners of a tile that lies there. A core without faces has no far side.
  pure logical function looks_along(piece, v, along) result(looks)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v
    !> unit vector towards the plane, in the axes of the piece
    real(dp), intent(in) :: along(3)
    integer :: k

    looks = size(piece%face_normal, 2) == 0
    if (looks) return
    do k = piece%vertex_face_first(v), piece%vertex_face_first(v + 1) - 1
      looks = dot_product(piece%face_normal(:, piece%vertex_face(k)), along) >= 0.5_dp
      if (looks) return
    end do
  end function looks_along

  !> Whether the same sharp corner is behind two vertices.
  pure logical function shares_corner(piece, v, w) result(shares)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v, w

    shares = .not. any(abs(piece%corner(:, v) - piece%corner(:, w)) > 0.0_dp)
  end function shares_corner

  !> The first of the vertices that the sharp corner behind `v` is behind.
  pure integer function first_of_corner(piece, v) result(first)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v

    first = v
    do while (first > 1)
      if (.not. shares_corner(piece, first - 1, v)) return
      first = first - 1
    end do
  end function first_of_corner

  !> The vertex that is farthest along a direction, the lowest of those equally far.
  pure subroutine find_support(piece, along, best)
    !> in space
    type(convex_piece_t), intent(in) :: piece
    !> of any length, in the axes of the piece
    real(dp), intent(in) :: along(3)
    integer, intent(out) :: best
    real(dp) :: farthest, reach
    integer :: k, v, sector, chosen

    if (.not. allocated(piece%candidate)) then
      call find_farthest(piece%vertex, along, best)
      return
    end if
    sector = sector_of(along)
    k = piece%candidate_first(sector)
    chosen = piece%candidate(k)
    farthest = along(1)*piece%vertex(1, chosen) + along(2)*piece%vertex(2, chosen) + along(3)*piece%vertex(3, chosen)
    do k = k + 1, piece%candidate_first(sector + 1) - 1
      v = piece%candidate(k)
      reach = along(1)*piece%vertex(1, v) + along(2)*piece%vertex(2, v) + along(3)*piece%vertex(3, v)
      ! nobody can foretell which it is: selections, and no branches
      chosen = merge(v, chosen, reach > farthest)
      farthest = merge(reach, farthest, reach > farthest)
    end do
    best = chosen
  end subroutine find_support

  !> List the vertices that can be the farthest in each sector of directions, if the piece has some. It needs `vertex`, of which
  !> later only the scale may change.
  pure subroutine find_candidates(piece)
    type(convex_piece_t), intent(inout) :: piece
    integer, allocatable :: found(:)
    real(dp) :: ray(3, 3, 3), middle(2)
    integer :: axis, side, first, second, sector, k, l, n

    if (allocated(piece%candidate)) deallocate (piece%candidate, piece%candidate_first)
    if (size(piece%vertex, 1) /= 3 .or. size(piece%vertex, 2) < some_vertices) return
    allocate (piece%candidate_first(number_of_sectors + 1), found(number_of_sectors*size(piece%vertex, 2)))
    n = 0
    do sector = 1, number_of_sectors
      piece%candidate_first(sector) = n + 1
      second = mod(sector - 1, divisions)
      first = mod((sector - 1)/divisions, divisions)
      side = mod((sector - 1)/divisions**2, 2)
      axis = (sector - 1)/divisions**2/2 + 1
      middle(1) = real(2*first + 1 - divisions, dp)/divisions
      middle(2) = real(2*second + 1 - divisions, dp)/divisions
      do l = 1, 3
        do k = 1, 3
          ray(axis, k, l) = real(1 - 2*side, dp)
          ray(mod(axis, 3) + 1, k, l) = middle(1) + real(k - 2, dp)/divisions
          ray(mod(axis + 1, 3) + 1, k, l) = middle(2) + real(l - 2, dp)/divisions
        end do
      end do
      call add_candidates(piece%vertex, ray, n, found)
    end do
    piece%candidate_first(number_of_sectors + 1) = n + 1
    piece%candidate = found(1:n)
  end subroutine find_candidates

  !> Add the vertices that can be the farthest between rays. One vertex is ahead of another along all directions between four rays
  !> where it is along each of these. It is enough to try the farthest along the rays.
  pure subroutine add_candidates(vertex, ray, n, found)
    real(dp), intent(in), contiguous :: vertex(:, :)
    !> the corners of the sector, and the middles between them (3, 3, 3)
    real(dp), intent(in) :: ray(3, 3, 3)
    integer, intent(inout) :: n, found(:)
    integer :: far(9), k, l, v, m
    real(dp) :: lead(4)

    m = 0
    do l = 1, 3
      do k = 1, 3
        call find_farthest(vertex, ray(:, k, l), v)
        if (any(far(1:m) == v)) cycle
        m = m + 1
        far(m) = v
      end do
    end do
    vertices: do v = 1, size(vertex, 2)
      do k = 1, m
        do l = 1, 4
          lead(l) = dot_product(ray(:, merge(1, 3, l < 3), merge(1, 3, mod(l, 2) == 1)), vertex(:, far(k)) - vertex(:, v))
        end do
        if (minval(lead) > ahead) cycle vertices
      end do
      n = n + 1
      found(n) = v
    end do vertices
  end subroutine add_candidates

  !> The vertex that is farthest along a direction, among all.
  pure subroutine find_farthest(vertex, along, best)
    real(dp), intent(in), contiguous :: vertex(:, :)
    real(dp), intent(in) :: along(3)
    integer, intent(out) :: best
    real(dp) :: farthest, reach
    integer :: v

    best = 1
    farthest = along(1)*vertex(1, 1) + along(2)*vertex(2, 1) + along(3)*vertex(3, 1)
    do v = 2, size(vertex, 2)
      reach = along(1)*vertex(1, v) + along(2)*vertex(2, v) + along(3)*vertex(3, v)
      if (reach > farthest) then
        farthest = reach
        best = v
      end if
    end do
  end subroutine find_farthest

  !> The sector that a direction lies in, 1 to number_of_sectors; a vector without length lies in one of them.
  pure integer function sector_of(along) result(sector)
    !> of any length
    real(dp), intent(in) :: along(3)
    !> a place on a side of the cube, from -1 to 1, becomes a division, from 0 to below divisions
    real(dp), parameter :: half = 0.5_dp*divisions*(1.0_dp - 4*epsilon(1.0_dp))
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
    sector = (sector*divisions + int(half*(first + 1.0_dp), i4))*divisions + int(half*(second + 1.0_dp), i4) + 1
    ! what is no number lies in none
    if (sector < 1 .or. sector > number_of_sectors) sector = 1
  end function sector_of

  !> List the faces at each vertex, by the corners of the faces, and find the largest face.
  pure subroutine list_faces(piece)
    type(convex_piece_t), intent(inout) :: piece
    integer :: f, k, v, next(size(piece%vertex, 2))

    next(:) = 0
    do k = 1, size(piece%face_vertex)
      next(piece%face_vertex(k)) = next(piece%face_vertex(k)) + 1
    end do
    if (allocated(piece%vertex_face)) deallocate (piece%vertex_face, piece%vertex_face_first)
    allocate (piece%vertex_face(size(piece%face_vertex)), piece%vertex_face_first(size(next) + 1))
    piece%vertex_face_first(1) = 1
    do v = 1, size(next)
      piece%vertex_face_first(v + 1) = piece%vertex_face_first(v) + next(v)
      next(v) = piece%vertex_face_first(v)
    end do
    piece%largest_face = 2
    do f = 1, size(piece%face_first) - 1
      piece%largest_face = max(piece%largest_face, piece%face_first(f + 1) - piece%face_first(f))
      do k = piece%face_first(f), piece%face_first(f + 1) - 1
        v = piece%face_vertex(k)
        piece%vertex_face(next(v)) = f
        next(v) = next(v) + 1
      end do
    end do
  end subroutine list_faces

  !> Find a ball that holds a piece: about the middle of the box of its vertices.
  pure subroutine bound_piece(piece)
    type(convex_piece_t), intent(inout) :: piece
    integer :: v, d

    if (.not. allocated(piece%middle)) allocate (piece%middle(size(piece%vertex, 1)))
    do d = 1, size(piece%middle)
      piece%middle(d) = 0.5_dp*(minval(piece%vertex(d, :)) + maxval(piece%vertex(d, :)))
    end do
    piece%reach = 0.0_dp
    do v = 1, size(piece%vertex, 2)
      piece%reach = max(piece%reach, norm2(piece%vertex(:, v) - piece%middle))
    end do
    piece%reach = piece%reach + piece%rounding
  end subroutine bound_piece

end module gravier_convex_piece
