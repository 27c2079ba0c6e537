!> The core of a convex polyhedron whose edges are to be round: all its faces moved inwards.
module gravier_rounded_core
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_sorting, only: argsort, find_sorted
  use gravier_spatial, only: extent_of, find_box, triple_product, turn_back
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_hull, only: find_hull
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t, find_neighbours, start_of_face
  implicit none
  private
  public :: find_core

  !> distance, in parts of the extent, up to which planes meet in a point
  real(dp), parameter :: flat = 1.0e-6_dp
  real(dp), parameter :: no_way(3) = 0.0_dp

contains

  !> The rounded piece of a polyhedron: the intersection of its half-spaces, each moved inwards by the rounding. A corner where more
  !> than three faces meet may become several vertices, and a face that is small beside the rounding may vanish.
  subroutine find_core(sharp, inside, axes, rounding, piece, message)
    type(sharp_polyhedron_t), intent(in) :: sharp
    !> a point that is to be in the core
    real(dp), intent(in) :: inside(3)
    !> principal axes, one a column
    real(dp), intent(in) :: axes(3, 3)
    !> in the unit of the points
    real(dp), intent(in) :: rounding
    !> in the unit and axes of the points
    type(convex_piece_t), intent(out) :: piece
    !> empty; otherwise why there is no core, in some words
    character(len=:), allocatable, intent(out) :: message
    type(sharp_polyhedron_t) :: dual
    real(dp) :: offset(size(sharp%face_offset)), low(3), high(3), extent(3), pole(3, size(sharp%face_offset))
    real(dp), allocatable :: turned(:, :)
    integer :: k

    message = ""
    do k = 1, size(offset)
      offset(k) = sharp%face_offset(k) - dot_product(inside, sharp%face_normal(:, k))
    end do
    if (.not. rounding > 0.0_dp) message = "a rounding above 0 is needed"
    if (rounding >= minval(offset)) message = "the rounding of "//to_text(rounding)//" is too large: a face is only "// &
      & to_text(minval(offset))//" from the centre"
    if (len(message) > 0) return
    offset(:) = offset - rounding
    ! planes become points and points planes (duality), in axes in which the body is as long as wide
    turned = sharp%vertex
    do k = 1, size(turned, 2)
      call turn_back(axes, inside, turned(:, k))
    end do
    call find_box(turned, low, high)
    extent(:) = high - low
    do k = 1, size(offset)
      pole(:, k) = sharp%face_normal(:, k)
      call turn_back(axes, no_way, pole(:, k))
      pole(:, k) = pole(:, k)*extent/offset(k)
    end do
    call find_hull(pole, flat*maxval(abs(pole)), dual, message)
    if (len(message) > 0) return
    piece%rounding = rounding
    call take_vertices(sharp, inside, offset, pole, dual, piece)
    call take_faces(sharp, pole, dual, piece)
    call find_neighbours(size(piece%vertex, 2), piece%face_first, piece%face_vertex, piece%neighbour_first, piece%neighbour)
  end subroutine find_core

  !> Vertices of the core from the faces of the dual hull, and the sharp corners behind them. On return the faces of the dual hull
  !> are in the order of the vertices.
  subroutine take_vertices(sharp, inside, offset, pole, dual, piece)
    type(sharp_polyhedron_t), intent(in) :: sharp
    real(dp), intent(in) :: inside(3), offset(:), pole(:, :)
    type(sharp_polyhedron_t), intent(inout) :: dual
    type(convex_piece_t), intent(inout) :: piece
    real(dp), allocatable :: vertex(:, :)
    integer, allocatable :: corner(:), order(:), plane(:), meeting(:)
    integer(i8), allocatable :: keys(:)
    integer :: n, v, k

    n = size(dual%face_first) - 1
    allocate (keys(n), vertex(3, n), corner(n), order(n), plane(size(dual%vertex, 2)))
    call find_planes_of_poles(pole, dual, plane)
    do v = 1, n
      allocate (meeting(dual%face_first(v + 1) - dual%face_first(v)))
      do k = 1, size(meeting)
        meeting(k) = plane(dual%face_vertex(dual%face_first(v) + k - 1))
      end do
      call meet_planes(sharp%face_normal, offset, meeting, vertex(:, v))
      vertex(:, v) = inside + vertex(:, v)
      corner(v) = corner_behind(sharp, meeting, vertex(:, v))
      keys(v) = corner(v)
      deallocate (meeting)
    end do
    call argsort(keys, order)
    call order_faces(order, dual)
    allocate (piece%vertex(3, n), piece%corner(3, n))
    do k = 1, n
      piece%vertex(:, k) = vertex(:, order(k))
      piece%corner(:, k) = sharp%vertex(:, corner(order(k)))
    end do
  end subroutine take_vertices

  !> The plane that each vertex of the dual hull stands for: vertices are poles, in the order of these.
  pure subroutine find_planes_of_poles(pole, dual, plane)
    real(dp), intent(in) :: pole(:, :)
    type(sharp_polyhedron_t), intent(in) :: dual
    integer, intent(out) :: plane(:)
    integer :: f, v

    f = 1
    do v = 1, size(plane)
      do while (any(abs(pole(:, f) - dual%vertex(:, v)) > 0.0_dp) .and. f < size(pole, 2))
        f = f + 1
      end do
      plane(v) = f
    end do
  end subroutine find_planes_of_poles

  !> The point where planes meet, by those three of them that are farthest from being parallel.
  pure subroutine meet_planes(normal, offset, meeting, point)
    real(dp), intent(in), contiguous :: normal(:, :)
    real(dp), intent(in) :: offset(:)
    integer, intent(in) :: meeting(:)
    real(dp), intent(out) :: point(3)
    real(dp) :: largest, found, rows(3, 3), right(3)
    integer :: i, j, k, best(3)

    largest = 0.0_dp
    best(:) = meeting(1:3)
    do i = 1, size(meeting) - 2
      do j = i + 1, size(meeting) - 1
        do k = j + 1, size(meeting)
          found = abs(triple_product(normal(:, meeting(i)), normal(:, meeting(j)), normal(:, meeting(k))))
          if (.not. found > largest) cycle
          largest = found
          best(1) = meeting(i)
          best(2) = meeting(j)
          best(3) = meeting(k)
        end do
      end do
    end do
    ! Cramer's rule, the rows of the matrix being the normals
    do k = 1, 3
      rows(k, :) = normal(:, best(k))
      right(k) = offset(best(k))
    end do
    point(:) = 0.0_dp
    found = triple_product(rows(:, 1), rows(:, 2), rows(:, 3))
    if (.not. abs(found) > 0.0_dp) return
    point(1) = triple_product(right, rows(:, 2), rows(:, 3))/found
    point(2) = triple_product(rows(:, 1), right, rows(:, 3))/found
    point(3) = triple_product(rows(:, 1), rows(:, 2), right)/found
  end subroutine meet_planes

  !> The sharp corner in most of some planes; of several the nearest to a place, then the lowest.
  pure integer function corner_behind(sharp, meeting, place) result(corner)
    type(sharp_polyhedron_t), intent(in) :: sharp
    integer, intent(in) :: meeting(:)
    real(dp), intent(in) :: place(3)
    integer :: most, found, v, k
    real(dp) :: nearest, distance, room

    room = flat*extent_of(sharp%vertex)
    most = -1
    nearest = 0.0_dp
    corner = 1
    do v = 1, size(sharp%vertex, 2)
      found = 0
      do k = 1, size(meeting)
        associate (normal => sharp%face_normal(:, meeting(k)))
          if (abs(dot_product(normal, sharp%vertex(:, v)) - sharp%face_offset(meeting(k))) <= room) found = found + 1
        end associate
      end do
      if (found < most) cycle
      distance = norm2(sharp%vertex(:, v) - place)
      if (found == most .and. distance >= nearest) cycle
      most = found
      nearest = distance
      corner = v
    end do
  end function corner_behind

  !> Put the faces of a polyhedron into an order.
  pure subroutine order_faces(order, polyhedron)
    integer, intent(in) :: order(:)
    type(sharp_polyhedron_t), intent(inout) :: polyhedron
    integer :: first(size(polyhedron%face_first)), corner(size(polyhedron%face_vertex)), k, n, old

    first(1) = 1
    do k = 1, size(order)
      n = polyhedron%face_first(order(k) + 1) - polyhedron%face_first(order(k))
      old = polyhedron%face_first(order(k))
      corner(first(k):first(k) + n - 1) = polyhedron%face_vertex(old:old + n - 1)
      first(k + 1) = first(k) + n
    end do
    polyhedron%face_first(:) = first
    polyhedron%face_vertex(:) = corner
  end subroutine order_faces

  !> Faces of the core: around each vertex of the dual hull its faces, which are the vertices of the core, in turn.
  subroutine take_faces(sharp, pole, dual, piece)
    type(sharp_polyhedron_t), intent(in) :: sharp, dual
    real(dp), intent(in) :: pole(:, :)
    type(convex_piece_t), intent(inout) :: piece
    integer(i8), allocatable :: keys(:), sorted(:)
    integer, allocatable :: order(:), face(:), begin(:), plane(:)
    integer :: f, k, n, v, w, start

    allocate (keys(size(dual%face_vertex)), sorted(size(dual%face_vertex)), order(size(dual%face_vertex)))
    allocate (face(size(keys)), begin(size(dual%vertex, 2)), plane(size(dual%vertex, 2)))
    call find_planes_of_poles(pole, dual, plane)
    n = size(dual%vertex, 2)
    do f = 1, size(dual%face_first) - 1
      do k = dual%face_first(f), dual%face_first(f + 1) - 1
        v = dual%face_vertex(k)
        w = dual%face_vertex(merge(dual%face_first(f), k + 1, k + 1 == dual%face_first(f + 1)))
        keys(k) = v*(n + 1_i8) + w
        face(k) = f
        begin(v) = k
      end do
    end do
    call argsort(keys, order)
    do k = 1, size(keys)
      sorted(k) = keys(order(k))
    end do
    allocate (piece%face_first(n + 1), piece%face_vertex(size(keys)), piece%face_normal(3, n))
    piece%face_first(1) = 1
    do v = 1, n
      k = begin(v)
      start = face(k)
      f = piece%face_first(v)
      do
        piece%face_vertex(f) = face(k)
        f = f + 1
        ! the side before v in this face is, turned, the side behind v in the next one
        k = order(find_sorted(sorted, v*(n + 1_i8) + before(k)))
        if (face(k) == start) exit
      end do
      piece%face_first(v + 1) = f
      call start_of_face(piece%face_vertex(piece%face_first(v):f - 1))
      piece%face_normal(:, v) = sharp%face_normal(:, plane(v))
    end do

  contains

    !> The vertex of the dual hull before that at place k, in the same face.
    integer function before(k)
      integer, intent(in) :: k
      before = dual%face_vertex(merge(dual%face_first(face(k) + 1) - 1, k - 1, k == dual%face_first(face(k))))
    end function before

  end subroutine take_faces

end module gravier_rounded_core
