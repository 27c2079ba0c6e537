!> How thin a convex piece is: half of the least distance between two parallel planes, or lines, with the piece between them.
module gravier_piece_width
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_convex_piece, only: convex_piece_t
  implicit none
  private
  public :: half_width_of

  !> what rounding may put a vertex beyond a plane of support, and the sine of the least angle of edges that are not parallel
  real(dp), parameter :: beyond = 1.0e-9_dp

contains

  !> Half of the least width, rounding included, in the unit of the piece: the radius of a disk, a sphere or a capsule.
  pure real(dp) function half_width_of(piece) result(half)
    type(convex_piece_t), intent(in) :: piece
    real(dp) :: width

    width = 0.0_dp
    if (size(piece%vertex, 2) > 2) then
      if (size(piece%vertex, 1) == 2) then
        width = width_of_polygon(piece%vertex)
      else
        width = min(width_between_faces(piece), width_between_edges(piece))
      end if
    end if
    half = piece%rounding + 0.5_dp*width
  end function half_width_of

  !> Of a polygon with its corners in anticlockwise order: one of the two lines holds a side.
  pure real(dp) function width_of_polygon(vertex) result(width)
    !> (2, n)
    real(dp), intent(in) :: vertex(:, :)
    real(dp) :: side(2), farthest
    integer :: k, v, n

    n = size(vertex, 2)
    width = huge(1.0_dp)
    do k = 1, n
      side(:) = vertex(:, mod(k, n) + 1) - vertex(:, k)
      farthest = 0.0_dp
      do v = 1, n
        farthest = max(farthest, side(1)*(vertex(2, v) - vertex(2, k)) - side(2)*(vertex(1, v) - vertex(1, k)))
      end do
      width = min(width, farthest/norm2(side))
    end do
  end function width_of_polygon

  !> The least distance of a face of a polyhedron from the vertex farthest from it.
  pure real(dp) function width_between_faces(piece) result(width)
    type(convex_piece_t), intent(in) :: piece
    real(dp) :: farthest
    integer :: f, v

    width = huge(1.0_dp)
    do f = 1, size(piece%face_normal, 2)
      farthest = 0.0_dp
      do v = 1, size(piece%vertex, 2)
        farthest = max(farthest, sum(piece%face_normal(:, f)*(piece%vertex(:, piece%face_vertex(piece%face_first(f))) &
          & - piece%vertex(:, v))))
      end do
      width = min(width, farthest)
    end do
  end function width_between_faces

  !> The least distance of two planes that each hold an edge of a polyhedron and have it between them; huge without such edges.
  pure real(dp) function width_between_edges(piece) result(width)
    type(convex_piece_t), intent(in) :: piece
    integer :: ends(2, size(piece%neighbour)/2), k, l, n, v
    real(dp) :: normal(3), opposite(3), first(3), second(3), distance, length

    n = 0
    do v = 1, size(piece%vertex, 2)
      do k = piece%neighbour_first(v), piece%neighbour_first(v + 1) - 1
        if (piece%neighbour(k) < v) cycle
        n = n + 1
        ends(1, n) = v
        ends(2, n) = piece%neighbour(k)
      end do
    end do
    width = huge(1.0_dp)
    do k = 1, n
      do l = k + 1, n
        associate (a => piece%vertex(:, ends(1, k)), b => piece%vertex(:, ends(1, l)))
          first(:) = piece%vertex(:, ends(2, k)) - a
          second(:) = piece%vertex(:, ends(2, l)) - b
          normal(:) = cross(first, second)
          length = norm2(normal)
          if (length <= beyond*norm2(first)*norm2(second)) cycle
          normal(:) = normal/length
          distance = sum(normal*(a - b))
          if (abs(distance) >= width) cycle
          if (distance < 0.0_dp) normal(:) = -normal
          opposite(:) = -normal
          if (is_farthest(piece, ends(1, k), normal) .and. is_farthest(piece, ends(1, l), opposite)) width = abs(distance)
        end associate
      end do
    end do
  end function width_between_edges

  !> Whether no vertex is farther along a direction than vertex `v`: none of its neighbours is.
  pure logical function is_farthest(piece, v, along)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v
    !> of length 1
    real(dp), intent(in) :: along(3)
    integer :: k

    is_farthest = .true.
    do k = piece%neighbour_first(v), piece%neighbour_first(v + 1) - 1
      is_farthest = is_farthest .and. sum(along*(piece%vertex(:, piece%neighbour(k)) - piece%vertex(:, v))) <= beyond
    end do
  end function is_farthest

end module gravier_piece_width
