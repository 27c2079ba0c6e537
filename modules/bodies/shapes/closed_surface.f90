!> Surfaces as files give them: faces that each name their corners. What a body needs of them is checked here.
module gravier_closed_surface
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_sorting, only: argsort, find_sorted
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t, find_planes
  implicit none
  private
  public :: merge_points, check_closed_convex

contains

  !> Make one of points closer together than a distance, the first of them.
  subroutine merge_points(points, distance, same)
    !> (3, n)
    real(dp), intent(in) :: points(:, :), distance
    !> the first point at the place of each (n)
    integer, intent(out) :: same(:)
    integer, allocatable :: order(:)
    integer(i8), allocatable :: keys(:)
    real(dp) :: lowest, unit
    integer :: j, k

    same(:) = 0
    if (size(same) == 0) return
    allocate (order(size(same)), keys(size(same)))
    lowest = minval(points(1, :))
    unit = max(distance, tiny(1.0_dp), (maxval(points(1, :)) - lowest)*2.0_dp**(-60))
    do k = 1, size(same)
      keys(k) = int((points(1, k) - lowest)/unit, i8)
    end do
    call argsort(keys, order)
    do k = 1, size(same)
      if (same(order(k)) == 0) same(order(k)) = order(k)
      do j = k + 1, size(same)
        if (keys(order(j)) - keys(order(k)) > 1) exit
        if (same(order(j)) /= 0) cycle
        if (norm2(points(:, order(j)) - points(:, order(k))) <= distance) same(order(j)) = same(order(k))
      end do
    end do
    call name_by_first(same)
  end subroutine merge_points

  !> Give each group the lowest number of its points.
  pure subroutine name_by_first(same)
    integer, intent(inout) :: same(:)
    integer :: lowest(size(same)), k

    lowest(:) = huge(1)
    do k = 1, size(same)
      lowest(same(k)) = min(lowest(same(k)), k)
    end do
    do k = 1, size(same)
      same(k) = lowest(same(k))
    end do
  end subroutine name_by_first

  !> Check that faces make up the surface of one convex body.
  subroutine check_closed_convex(surface, flat, message)
    !> corners of one place have one number; its planes are found here
    type(sharp_polyhedron_t), intent(inout) :: surface
    !> distance from a plane up to which points lie in it
    real(dp), intent(in) :: flat
    !> empty; otherwise what is wrong, in some words that name the first face it is wrong with
    character(len=:), allocatable, intent(out) :: message

    message = ""
    call check_corners(surface, message)
    if (len(message) > 0) return
    call check_sides(surface, message)
    if (len(message) > 0) return
    call find_planes(surface)
    call check_planes(surface, flat, message)
  end subroutine check_closed_convex

  !> Each face has three different corners or more.
  pure subroutine check_corners(surface, message)
    type(sharp_polyhedron_t), intent(in) :: surface
    character(len=:), allocatable, intent(inout) :: message
    integer :: f, j, k

    if (size(surface%face_first) < 5) message = "fewer than 4 faces"
    do f = 1, size(surface%face_first) - 1
      associate (corner => surface%face_vertex(surface%face_first(f):surface%face_first(f + 1) - 1))
        if (size(corner) < 3) message = "face "//to_text(f)//" has fewer than 3 corners"
        do k = 2, size(corner)
          do j = 1, k - 1
            if (corner(j) == corner(k)) message = "face "//to_text(f)//" has two corners at one place"
          end do
        end do
      end associate
      if (len(message) > 0) return
    end do
  end subroutine check_corners

  !> Each side of a face is, the other way, a side of one other face.
  subroutine check_sides(surface, message)
    type(sharp_polyhedron_t), intent(in) :: surface
    character(len=:), allocatable, intent(inout) :: message
    integer(i8), allocatable :: keys(:), sorted(:)
    integer, allocatable :: order(:), face(:)
    integer(i8) :: turned
    integer :: f, k, v, w, n

    n = size(surface%vertex, 2)
    allocate (keys(size(surface%face_vertex)), sorted(size(surface%face_vertex)))
    allocate (order(size(keys)), face(size(keys)))
    do f = 1, size(surface%face_first) - 1
      do k = surface%face_first(f), surface%face_first(f + 1) - 1
        v = surface%face_vertex(k)
        w = surface%face_vertex(merge(surface%face_first(f), k + 1, k + 1 == surface%face_first(f + 1)))
        keys(k) = v*(n + 1_i8) + w
        face(k) = f
      end do
    end do
    call argsort(keys, order)
    do k = 1, size(keys)
      sorted(k) = keys(order(k))
    end do
    do k = 1, size(keys)
      turned = mod(keys(k), n + 1_i8)*(n + 1_i8) + keys(k)/(n + 1)
      if (find_sorted(sorted, turned) > 0) cycle
      message = "the surface is not closed: beyond one side of face "//to_text(face(k))// &
        & " there is no face, or one with its corners the other way round"
      return
    end do
    do k = 2, size(keys)
      if (sorted(k) /= sorted(k - 1)) cycle
      message = "faces "//to_text(face(order(k - 1)))//" and "//to_text(face(order(k)))// &
        & " have a side in common, the same way round"
      return
    end do
  end subroutine check_sides

  !> Each face has an area and all of its corners in one plane, the volume is above 0, and all points are behind all faces.
  subroutine check_planes(surface, flat, message)
    type(sharp_polyhedron_t), intent(in) :: surface
    real(dp), intent(in) :: flat
    character(len=:), allocatable, intent(inout) :: message
    integer :: f, v, outside, inside
    real(dp) :: height

    outside = 0
    inside = 0
    do f = 1, size(surface%face_offset)
      if (.not. norm2(surface%face_normal(:, f)) > 0.0_dp) then
        message = "face "//to_text(f)//" has no area"
        return
      end if
      do v = surface%face_first(f), surface%face_first(f + 1) - 1
        if (abs(height_of(surface%face_vertex(v))) <= flat) cycle
        message = "face "//to_text(f)//" is not plane: its corners do not lie in one plane"
        return
      end do
      do v = 1, size(surface%vertex, 2)
        height = height_of(v)
        if (height > flat .and. outside == 0) outside = f
        if (height < -flat .and. inside == 0) inside = f
      end do
    end do
    if (outside > 0 .and. inside == 0) then
      message = "the surface is inside out: the corners of its faces must be anticlockwise seen from outside"
    else if (inside == 0) then
      message = "the surface has no volume"
    else if (outside > 0) then
      message = "the body is not convex: a point lies in front of face "//to_text(outside)
    end if

  contains

    !> The height of a point above the plane of face f.
    pure real(dp) function height_of(point)
      integer, intent(in) :: point
      height_of = dot_product(surface%face_normal(:, f), surface%vertex(:, point)) - surface%face_offset(f)
    end function height_of

  end subroutine check_planes

end module gravier_closed_surface
