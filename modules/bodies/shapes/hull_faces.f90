!> Triangles of a convex surface merged into the polygons that its faces are.
module gravier_hull_faces
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort, find_sorted
  use gravier_narrow, only: narrow
  use gravier_spatial, only: find_normal, shorten
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t, find_planes, start_of_face
  implicit none
  private
  public :: merge_triangles

contains

  !> Merge triangles in common planes into polygons, and leave out points that are no corners of three polygons.
  subroutine merge_triangles(points, triangles, flat, polyhedron, message)
    !> (3, n)
    real(dp), intent(in), contiguous :: points(:, :)
    !> a closed convex surface, anticlockwise seen from outside (3, triangles)
    integer, intent(in) :: triangles(:, :)
    !> distance from a plane up to which points lie in it
    real(dp), intent(in) :: flat
    type(sharp_polyhedron_t), intent(out) :: polyhedron
    !> empty; otherwise what is wrong, in some words
    character(len=:), allocatable, intent(out) :: message
    integer, allocatable :: across(:, :), group(:), first(:), corner(:)
    integer :: n_groups

    allocate (across(3, size(triangles, 2)), group(size(triangles, 2)))
    call find_across(triangles, size(points, 2), across)
    call find_groups(points, triangles, across, flat, group, n_groups)
    call trace_groups(triangles, across, group, n_groups, first, corner)
    call keep_corners(points, first, corner, polyhedron)
    call find_planes(polyhedron)
    message = ""
    if (.not. is_closed(polyhedron)) message = "its faces cannot be told from each other: it has points too close together"
  end subroutine merge_triangles

  !> The triangle on the other side of each side of each triangle.
  subroutine find_across(triangles, n, across)
    integer, intent(in) :: triangles(:, :)
    !> number of points
    integer, intent(in) :: n
    !> across(e, t) lies behind the side from corner e to the next (3, triangles)
    integer, intent(out) :: across(:, :)
    integer(i8), allocatable :: keys(:), sorted(:)
    integer, allocatable :: order(:)
    integer :: t, e, k

    allocate (keys(size(triangles)), sorted(size(triangles)), order(size(triangles)))
    do t = 1, size(triangles, 2)
      do e = 1, 3
        keys(3*(t - 1) + e) = triangles(e, t)*(n + 1_i8) + triangles(mod(e, 3) + 1, t)
      end do
    end do
    call argsort(keys, order)
    do k = 1, size(order)
      sorted(k) = keys(order(k))
    end do
    do t = 1, size(triangles, 2)
      do e = 1, 3
        k = find_sorted(sorted, triangles(mod(e, 3) + 1, t)*(n + 1_i8) + triangles(e, t))
        across(e, t) = (order(k) - 1)/3 + 1
      end do
    end do
  end subroutine find_across

  !> Groups of triangles: each grows from its largest one over all that lie in its plane.
  subroutine find_groups(points, triangles, across, flat, group, n_groups)
    real(dp), intent(in), contiguous :: points(:, :)
    real(dp), intent(in) :: flat
    integer, intent(in) :: triangles(:, :), across(:, :)
    integer, intent(out) :: group(:), n_groups
    real(dp), allocatable :: normal(:, :), area(:)
    integer, allocatable :: stack(:)
    integer :: seed, t, e, next, height

    allocate (normal(3, size(group)), area(size(group)), stack(size(group)))
    do t = 1, size(group)
      call find_normal(points(:, triangles(1, t)), points(:, triangles(2, t)), points(:, triangles(3, t)), normal(:, t))
      area(t) = norm2(normal(:, t))
      if (area(t) > 0.0_dp) normal(:, t) = normal(:, t)/area(t)
    end do
    group(:) = 0
    n_groups = 0
    do while (any(group == 0))
      seed = maxloc(area, 1, mask=group == 0)
      n_groups = n_groups + 1
      group(seed) = n_groups
      stack(1) = seed
      height = 1
      do while (height > 0)
        t = stack(height)
        height = height - 1
        do e = 1, 3
          next = across(e, t)
          if (group(next) /= 0) cycle
          if (.not. lies_in(next)) cycle
          group(next) = n_groups
          height = height + 1
          stack(height) = next
        end do
      end do
    end do

  contains

    !> Whether triangle `next` lies in the plane of the seed and faces the same way, if it can be told where it faces.
    logical function lies_in(next)
      integer, intent(in) :: next
      real(dp) :: way(3)
      integer :: k

      lies_in = .true.
      do k = 1, 3
        way(:) = points(:, triangles(k, next)) - points(:, triangles(1, seed))
        lies_in = lies_in .and. abs(dot_product(way, normal(:, seed))) <= flat
      end do
      if (area(next) > flat*flat) lies_in = lies_in .and. dot_product(normal(:, next), normal(:, seed)) > -0.5_dp
    end function lies_in

  end subroutine find_groups

  !> The border of each group as a polygon.
  subroutine trace_groups(triangles, across, group, n_groups, first, corner)
    integer, intent(in) :: triangles(:, :), across(:, :), group(:), n_groups
    !> polygon g is corner(first(g):first(g + 1) - 1)
    integer, allocatable, intent(out) :: first(:), corner(:)
    integer, allocatable :: after(:)
    integer :: g, t, e, n, start, v

    allocate (first(n_groups + 1), corner(size(triangles)), after(maxval(triangles)))
    n = 0
    do g = 1, n_groups
      first(g) = n + 1
      after(:) = 0
      start = huge(start)
      do t = 1, size(group)
        if (group(t) /= g) cycle
        do e = 1, 3
          if (group(across(e, t)) == g) cycle
          after(triangles(e, t)) = triangles(mod(e, 3) + 1, t)
          start = min(start, triangles(e, t))
        end do
      end do
      v = start
      do while (v <= size(after))
        if (after(v) == 0) exit
        n = n + 1
        corner(n) = v
        v = after(v)
        after(corner(n)) = 0
      end do
    end do
    first(n_groups + 1) = n + 1
    call shorten(corner, n)
  end subroutine trace_groups

  !> Polygons without the points that fewer than three of them share, and without polygons that are left with two.
  subroutine keep_corners(points, first, corner, polyhedron)
    real(dp), intent(in) :: points(:, :)
    integer, intent(in) :: first(:), corner(:)
    type(sharp_polyhedron_t), intent(inout) :: polyhedron
    integer :: shares(size(points, 2)), number(size(points, 2)), f, k, n, n_faces, left

    shares(:) = 0
    do k = 1, size(corner)
      shares(corner(k)) = shares(corner(k)) + 1
    end do
    number(:) = 0
    n = 0
    do k = 1, size(points, 2)
      if (shares(k) < 3) cycle
      n = n + 1
      number(k) = n
    end do
    allocate (polyhedron%vertex(3, n), polyhedron%face_first(size(first)), polyhedron%face_vertex(count(shares(corner) >= 3)))
    do k = 1, size(points, 2)
      if (number(k) > 0) polyhedron%vertex(:, number(k)) = points(:, k)
    end do
    n = 0
    n_faces = 0
    polyhedron%face_first(1) = 1
    do f = 1, size(first) - 1
      left = count(shares(corner(first(f):first(f + 1) - 1)) >= 3)
      if (left < 3) cycle
      do k = first(f), first(f + 1) - 1
        if (number(corner(k)) == 0) cycle
        n = n + 1
        polyhedron%face_vertex(n) = number(corner(k))
      end do
      call start_of_face(polyhedron%face_vertex(n - left + 1:n))
      n_faces = n_faces + 1
      polyhedron%face_first(n_faces + 1) = n + 1
    end do
    call shorten(polyhedron%face_first, n_faces + 1)
    call shorten(polyhedron%face_vertex, n)
  end subroutine keep_corners

  !> Whether every side of a face is, the other way, a side of one other face, and Euler's formula holds.
  logical function is_closed(polyhedron)
    type(sharp_polyhedron_t), intent(in) :: polyhedron
    integer(i8), allocatable :: keys(:), sorted(:)
    integer, allocatable :: order(:)
    integer :: f, k, n, v, w

    n = size(polyhedron%vertex, 2)
    associate (first => polyhedron%face_first, corner => polyhedron%face_vertex)
      allocate (keys(size(corner)), sorted(size(corner)), order(size(corner)))
      do f = 1, size(first) - 1
        do k = first(f), first(f + 1) - 1
          v = corner(k)
          w = corner(merge(first(f), k + 1, k + 1 == first(f + 1)))
          keys(k) = v*(n + 1_i8) + w
        end do
      end do
      call argsort(keys, order)
      do k = 1, size(order)
        sorted(k) = keys(order(k))
      end do
      is_closed = 2*(n + size(first) - 1 - 2) == size(corner)
    end associate
    do k = 1, size(sorted)
      if (k > 1) is_closed = is_closed .and. sorted(k) /= sorted(max(k, 2) - 1)
      v = narrow(sorted(k)/(n + 1))
      w = narrow(mod(sorted(k), n + 1_i8))
      is_closed = is_closed .and. find_sorted(sorted, w*(n + 1_i8) + v) > 0
    end do
  end function is_closed

end module gravier_hull_faces
