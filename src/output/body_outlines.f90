!> Bodies as polygons for pictures: outlines in the plane, surfaces in space, with sharp corners. What is round has many sides.
module gravier_body_outlines
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_rotation, only: cross
  use gravier_orientation, only: shape_axes
  use gravier_convex_piece, only: convex_piece_t
  use gravier_shape_library, only: shape_library_t
  use gravier_body_store, only: body_set_t
  implicit none
  private
  public :: outline_t, make_outlines, place_polygon

  !> The polygons of a body of radius 1, in its axes from its centre of mass.
  type :: outline_t
    !> polygon c has the points point(:, first(c):first(c + 1) - 1), (3, points); z is 0 in the plane; both have room for more
    integer, allocatable :: first(:)
    real(dp), private, allocatable :: point(:, :)
    !> polygons
    integer :: n = 0
  end type outline_t

  real(dp), parameter :: pi = acos(-1.0_dp)
  !> sides of a circle, meridians of a sphere, and bands of half a sphere
  integer, parameter :: sides = 24, meridians = 12, bands = 3

contains

  !> The outlines of all shapes, and of a disk or a sphere (0 to number of shapes).
  subroutine make_outlines(library, nd, outline)
    type(shape_library_t), intent(in) :: library
    integer, intent(in) :: nd
    type(outline_t), allocatable, intent(out) :: outline(:)
    type(convex_piece_t) :: round
    integer :: k, p

    allocate (outline(0:library%n))
    do k = 0, library%n
      allocate (outline(k)%first(8), outline(k)%point(3, 32))
      outline(k)%first(1) = 1
    end do
    round%rounding = 1.0_dp
    allocate (round%corner(nd, 1), source=0.0_dp)
    call add_piece(round, nd, outline(0))
    do k = 1, library%n
      do p = 1, size(library%shape(k)%piece)
        call add_piece(library%shape(k)%piece(p), nd, outline(k))
      end do
    end do
  end subroutine make_outlines

  subroutine add_piece(piece, nd, outline)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: nd
    type(outline_t), intent(inout) :: outline
    real(dp), allocatable :: point(:, :)
    integer :: v

    if (size(piece%corner, 2) <= 2) then
      if (nd == 2) call add_round_outline(piece, outline)
      if (nd == 3) call add_round_surface(piece, outline)
    else if (nd == 2) then
      allocate (point(3, size(piece%corner, 2)))
      do v = 1, size(point, 2)
        point(1:2, v) = piece%corner(:, v)
        point(3, v) = 0.0_dp
      end do
      call add_polygon(point, outline)
    else
      call add_faces(piece, outline)
    end if
  end subroutine add_piece

  !> A disk, or a capsule of the plane.
  subroutine add_round_outline(piece, outline)
    type(convex_piece_t), intent(in) :: piece
    type(outline_t), intent(inout) :: outline
    real(dp) :: point(3, sides + 2), ends(2, 2), start
    integer :: k, n

    ends(:, 1) = piece%corner(:, 1)
    ends(:, 2) = piece%corner(:, size(piece%corner, 2))
    n = sides + 2*(size(piece%corner, 2) - 1)
    ! half a circle about each end; a disk needs none of their ends twice
    start = atan2(ends(2, 2) - ends(2, 1), ends(1, 2) - ends(1, 1)) - 0.5_dp*pi
    point(:, :) = 0.0_dp
    do k = 1, n
      if (k <= n/2) then
        call put(k, 2, start + 2*pi*(k - 1)/sides)
      else
        call put(k, 1, start + pi + 2*pi*(k - 1 - n/2)/sides)
      end if
    end do
    call add_polygon(point(:, 1:n), outline)

  contains

    subroutine put(k, which, angle)
      integer, intent(in) :: k, which
      real(dp), intent(in) :: angle

      point(1, k) = ends(1, which) + piece%rounding*cos(angle)
      point(2, k) = ends(2, which) + piece%rounding*sin(angle)
    end subroutine put

  end subroutine add_round_outline

  !> A sphere, or a capsule in space: bands of quadrangles around its axis, triangles at its ends.
  subroutine add_round_surface(piece, outline)
    type(convex_piece_t), intent(in) :: piece
    type(outline_t), intent(inout) :: outline
    real(dp) :: ring(3, meridians, 0:2*bands + 1), quadrangle(3, 4), axes(3, 3), ends(3, 2), way(3), height, width
    integer :: r, m, next, which

    ends(:, 1) = piece%corner(:, 1)
    ends(:, 2) = piece%corner(:, size(piece%corner, 2))
    way(:) = ends(:, 2) - ends(:, 1)
    call find_axes(way, axes)
    do r = 0, 2*bands + 1
      which = merge(1, 2, r <= bands)
      height = piece%rounding*sin(0.5_dp*pi*(r - which + 1 - bands)/bands)
      width = piece%rounding*cos(0.5_dp*pi*(r - which + 1 - bands)/bands)
      do m = 1, meridians
        ring(:, m, r) = ends(:, which) + height*axes(:, 3) + &
          & width*(cos(2*pi*m/meridians)*axes(:, 1) + sin(2*pi*m/meridians)*axes(:, 2))
      end do
    end do
    do r = 0, 2*bands
      ! both rings at the middle of a sphere are one
      if (r == bands .and. size(piece%corner, 2) == 1) cycle
      do m = 1, meridians
        next = mod(m, meridians) + 1
        quadrangle(:, 1) = ring(:, m, r)
        quadrangle(:, 2) = ring(:, next, r)
        quadrangle(:, 3) = ring(:, next, r + 1)
        quadrangle(:, 4) = ring(:, m, r + 1)
        if (r == 0) then
          call add_polygon(quadrangle(:, 2:4), outline)
        else
          call add_polygon(quadrangle(:, 1:merge(3, 4, r == 2*bands)), outline)
        end if
      end do
    end do
  end subroutine add_round_surface

  !> Unit vectors at right angles, the third along a vector or, for 0, along z.
  pure subroutine find_axes(along, axes)
    real(dp), intent(in) :: along(3)
    real(dp), intent(out) :: axes(3, 3)
    integer :: least

    axes(:, :) = 0.0_dp
    axes(3, 3) = 1.0_dp
    if (norm2(along) > 0.0_dp) axes(:, 3) = along/norm2(along)
    least = minloc(abs(axes(:, 3)), dim=1)
    axes(least, 2) = 1.0_dp
    axes(:, 1) = cross(axes(:, 2), axes(:, 3))
    axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
    axes(:, 2) = cross(axes(:, 3), axes(:, 1))
  end subroutine find_axes

  !> The faces of a polyhedron between its sharp corners. Vertices behind one corner are one, and faces that are left with two are
  !> none.
  subroutine add_faces(piece, outline)
    type(convex_piece_t), intent(in) :: piece
    type(outline_t), intent(inout) :: outline
    real(dp), allocatable :: point(:, :)
    integer :: f, c, n

    do f = 1, size(piece%face_first) - 1
      allocate (point(3, piece%face_first(f + 1) - piece%face_first(f)))
      n = 0
      do c = piece%face_first(f), piece%face_first(f + 1) - 1
        associate (corner => piece%corner(:, piece%face_vertex(c)))
          if (n > 0) then
            if (all(abs(corner - point(:, n)) <= 0.0_dp)) cycle
            if (all(abs(corner - point(:, 1)) <= 0.0_dp)) cycle
          end if
          n = n + 1
          point(:, n) = corner
        end associate
      end do
      if (n >= 3) call add_polygon(point(:, 1:n), outline)
      deallocate (point)
    end do
  end subroutine add_faces

  subroutine add_polygon(point, outline)
    real(dp), intent(in) :: point(:, :)
    type(outline_t), intent(inout) :: outline
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: first(:)
    integer :: n, last

    last = outline%first(outline%n + 1) - 1
    n = last + size(point, 2)
    if (n > size(outline%point, 2)) then
      allocate (points(3, 2*n))
      points(:, 1:last) = outline%point(:, 1:last)
      call move_alloc(points, outline%point)
    end if
    if (outline%n + 2 > size(outline%first)) then
      allocate (first(2*size(outline%first)))
      first(1:outline%n + 1) = outline%first
      call move_alloc(first, outline%first)
    end if
    outline%point(:, last + 1:n) = point
    outline%n = outline%n + 1
    outline%first(outline%n + 1) = n + 1
  end subroutine add_polygon

  !> The points of polygon `c` of an outline where body `k` has it, and how many they are.
  pure subroutine place_polygon(outline, c, bodies, k, points, n)
    type(outline_t), intent(in) :: outline
    integer, intent(in) :: c
    !> with orientations
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> coordinates one after the other (3 n at least)
    real(dp), intent(out) :: points(:)
    integer(i8), intent(out) :: n
    real(dp) :: axes(3, 3)
    integer :: i, d

    call shape_axes(bodies%orientation(:, k), axes)
    points(:) = 0.0_dp
    n = outline%first(c + 1) - outline%first(c)
    do i = 1, narrow(n)
      associate (point => outline%point(:, outline%first(c) + i - 1))
        do d = 1, bodies%nd
          points(3*(i - 1) + d) = bodies%position(d, k) + bodies%radius(k)*sum(axes(d, :)*point)
        end do
      end associate
    end do
  end subroutine place_polygon

end module gravier_body_outlines
