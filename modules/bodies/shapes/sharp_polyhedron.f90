!> A convex polyhedron with sharp edges: its corners, and its faces as polygons.
module gravier_sharp_polyhedron
  use gravier_kinds, only: dp
  use gravier_spatial, only: find_normal
  implicit none
  private
  public :: sharp_polyhedron_t, find_planes, find_neighbours, start_of_face

  type :: sharp_polyhedron_t
    !> corners (3, n)
    real(dp), allocatable :: vertex(:, :)
    !> face f has the corners face_vertex(face_first(f):face_first(f + 1) - 1), anticlockwise seen from outside (faces + 1)
    integer, allocatable :: face_first(:), face_vertex(:)
    !> unit normals to the outside (3, faces); the plane of face f is normal . x = offset
    real(dp), allocatable :: face_normal(:, :), face_offset(:)
  end type sharp_polyhedron_t

contains

  !> Planes of all faces: normals by sums of the triangles of a fan (Newell), offsets as means over the corners. A face without area
  !> has the normal 0.
  pure subroutine find_planes(polyhedron)
    type(sharp_polyhedron_t), intent(inout) :: polyhedron
    real(dp) :: normal(3), part(3), mean(3), length
    integer :: f, k, n, first

    n = size(polyhedron%face_first) - 1
    if (allocated(polyhedron%face_normal)) deallocate (polyhedron%face_normal, polyhedron%face_offset)
    allocate (polyhedron%face_normal(3, n), polyhedron%face_offset(n))
    do f = 1, n
      first = polyhedron%face_first(f)
      normal(:) = 0.0_dp
      mean(:) = 0.0_dp
      associate (x => polyhedron%vertex, corner => polyhedron%face_vertex(first:polyhedron%face_first(f + 1) - 1))
        do k = 1, size(corner)
          if (k >= 3) then
            call find_normal(x(:, corner(1)), x(:, corner(k - 1)), x(:, corner(k)), part)
            normal(:) = normal + part
          end if
          mean(:) = mean + x(:, corner(k))
        end do
        mean(:) = mean/size(corner)
      end associate
      length = norm2(normal)
      if (length > 0.0_dp) normal(:) = normal/length
      polyhedron%face_normal(:, f) = normal
      polyhedron%face_offset(f) = dot_product(normal, mean)
    end do
  end subroutine find_planes

  !> Vertices that share a side of a face with each vertex, in ascending order.
  pure subroutine find_neighbours(n, face_first, face_vertex, first, neighbour)
    !> number of vertices
    integer, intent(in) :: n
    !> faces as in the type above; each side is one of two faces
    integer, intent(in), contiguous :: face_first(:), face_vertex(:)
    !> neighbour(first(v):first(v + 1) - 1) of vertex v (n + 1)
    integer, allocatable, intent(out) :: first(:), neighbour(:)
    integer :: count(n), f, k, v, w, place

    count(:) = 0
    do k = 1, size(face_vertex)
      count(face_vertex(k)) = count(face_vertex(k)) + 1
    end do
    allocate (first(n + 1), neighbour(size(face_vertex)))
    first(1) = 1
    do v = 1, n
      first(v + 1) = first(v) + count(v)
    end do
    count(:) = 0
    do f = 1, size(face_first) - 1
      do k = face_first(f), face_first(f + 1) - 1
        v = face_vertex(k)
        w = face_vertex(merge(face_first(f), k + 1, k + 1 == face_first(f + 1)))
        ! insertion into the sorted part
        place = first(v) + count(v)
        do while (place > first(v))
          if (neighbour(place - 1) <= w) exit
          neighbour(place) = neighbour(place - 1)
          place = place - 1
        end do
        neighbour(place) = w
        count(v) = count(v) + 1
      end do
    end do
  end subroutine find_neighbours

  !> Turn a polygon so that it begins with its lowest number.
  pure subroutine start_of_face(corner)
    integer, intent(inout) :: corner(:)
    integer :: turned(size(corner)), k, start

    start = minloc(corner, 1) - 1
    do k = 1, size(corner)
      turned(k) = corner(mod(start + k - 1, size(corner)) + 1)
    end do
    corner(:) = turned
  end subroutine start_of_face

end module gravier_sharp_polyhedron
