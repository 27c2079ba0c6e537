!> Facets, the tree that finds them, meshes and their files: nearest points, facets near a point, boxes, images, what is refused.
program test_facets
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_random_hash, only: hash_uniform
  use gravier_facet, only: near_facets_t, find_foot, find_facet_normal, longest_side, within, on_side, at_corner
  use gravier_facet_tree, only: facet_tree_t, box_distance
  use gravier_mesh, only: mesh_t
  use gravier_mesh_file, only: read_mesh
  use gravier_ear_clipping, only: clip_ears
  use gravier_boundary, only: boundary_t
  use gravier_surface_registry, only: make_surface
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: n = new_line("a")
  integer(i8) :: drawn = 0

  call MPI_Init()
  call test_foot()
  call test_shape_of_facets()
  call test_tree()
  call test_lines()
  call test_mesh()
  call test_images()
  call test_ears()
  call test_files()
  call test_refused()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A number in [-1, 1].
  real(dp) function random()
    drawn = drawn + 1
    random = 2.0_dp*hash_uniform(7, drawn, 1) - 1.0_dp
  end function random

  subroutine draw(corner)
    real(dp), intent(out) :: corner(:, :)
    integer :: c, d

    corner(:, :) = 0.0_dp
    do c = 1, size(corner, 2)
      do d = 1, size(corner, 2)
        corner(d, c) = random()
      end do
    end do
  end subroutine draw

  !> The nearest point of a convex set to the origin is that from which the way to no corner leads nearer.
  subroutine test_foot()
    real(dp) :: corner(3, 3), line(3, 2), foot(3)
    integer :: k, c, place, found(0:2), found_on_lines(0:2)
    logical :: nearest

    nearest = .true.
    found(:) = 0
    found_on_lines(:) = 0
    do k = 1, 5000
      call draw(corner)
      call find_foot(corner, foot, place)
      found(place) = found(place) + 1
      do c = 1, 3
        nearest = nearest .and. dot_product(foot, corner(:, c) - foot) > -1.0e-13_dp
      end do
      nearest = nearest .and. is_in(corner, foot)
      call draw(line)
      call find_foot(line, foot, place)
      found_on_lines(place) = found_on_lines(place) + 1
      do c = 1, 2
        nearest = nearest .and. dot_product(foot, line(:, c) - foot) > -1.0e-13_dp
      end do
    end do
    call check(nearest, "the nearest points are the nearest")
    call check(minval(found) > 100, "points within triangles, on sides and at corners")
    call check(found_on_lines(within) > 100 .and. found_on_lines(at_corner) > 100, "points within segments and at ends")
    call check_equal(found_on_lines(on_side), 0, "segments have no sides")
  end subroutine test_foot

  !> Whether a point is in a triangle: shares of the corners are at least 0.
  logical function is_in(corner, point)
    real(dp), intent(in) :: corner(3, 3), point(3)
    real(dp) :: u(3), v(3), w(3), uu, uv, vv, uw, vw, whole, share(3)

    u = corner(:, 2) - corner(:, 1)
    v = corner(:, 3) - corner(:, 1)
    w = point - corner(:, 1)
    uu = dot_product(u, u)
    uv = dot_product(u, v)
    vv = dot_product(v, v)
    uw = dot_product(u, w)
    vw = dot_product(v, w)
    whole = uu*vv - uv*uv
    share(2) = (vv*uw - uv*vw)/whole
    share(3) = (uu*vw - uv*uw)/whole
    share(1) = 1.0_dp - share(2) - share(3)
    is_in = minval(share) > -1.0e-9_dp .and. norm2(corner(:, 1) + share(2)*u + share(3)*v - point) < 1.0e-9_dp
  end function is_in

  subroutine test_shape_of_facets()
    real(dp), parameter :: triangle(3, 3) = reshape([0, 0, 0, 3, 0, 0, 0, 4, 0]*1.0_dp, [3, 3])
    real(dp) :: normal(3)

    call find_facet_normal(triangle, normal)
    call check(norm2(normal - [0.0_dp, 0.0_dp, 1.0_dp]) <= 0.0_dp, "the normal of a triangle")
    call check_close(longest_side(triangle), 5.0_dp, 1.0e-15_dp, "its longest side")
    call find_facet_normal(triangle(:, 1:2), normal)
    call check(norm2(normal - [0.0_dp, -1.0_dp, 0.0_dp]) <= 0.0_dp, "the normal of a segment is its right")
    call check_close(longest_side(triangle(:, 1:2)), 3.0_dp, 1.0e-15_dp, "its length")
  end subroutine test_shape_of_facets

  !> All facets within a reach are found, and not many that are not.
  subroutine test_tree()
    type(facet_tree_t) :: tree
    real(dp) :: corner(3, 3, 500), seen(3, 3), point(3), foot(3), low(3), high(3)
    integer, allocatable :: found(:)
    integer :: k, c, d, m, place, missing, idle, all_near
    real(dp), parameter :: reach = 0.2_dp

    do k = 1, size(corner, 3)
      call draw(corner(:, :, k))
      low(:) = corner(:, 1, k)
      do c = 1, 3
        corner(:, c, k) = low + 0.1_dp*(corner(:, c, k) - low)
      end do
    end do
    ! many in one place, which cannot be halved by their middles
    do k = 301, 350
      corner(:, :, k) = corner(:, :, 300)
    end do
    call tree%build(corner)
    missing = 0
    idle = 0
    all_near = 0
    do m = 1, 200
      do d = 1, 3
        point(d) = random()
      end do
      call tree%find(point, reach, k, found)
      call check(k == 0 .or. all(found(1:k) >= 1 .and. found(1:k) <= size(corner, 3)), "numbers of facets")
      idle = idle + k
      do c = 1, size(corner, 3)
        do d = 1, 3
          seen(d, :) = corner(d, :, c) - point(d)
        end do
        call find_foot(seen, foot, place)
        if (norm2(foot) > reach) cycle
        all_near = all_near + 1
        if (count(found(1:k) == c) /= 1) missing = missing + 1
      end do
    end do
    call check_equal(missing, 0, "facets near a point are found, each once")
    call check(all_near > 500, "there are some")
    call check(idle < 6*all_near, "few others are")
    low(:) = 0.0_dp
    high(:) = 1.0_dp
    point(:) = [-3.0_dp, 0.5_dp, 5.0_dp]
    call check_close(box_distance(low, high, point), 5.0_dp, 1.0e-15_dp, "distance from a box")
    point(:) = [0.3_dp, 0.5_dp, 1.0_dp]
    call check_close(box_distance(low, high, point), 0.0_dp, 0.0_dp, "distance within it")
  end subroutine test_tree

  !> Segments that continue each other are one; those across, beside or apart are not.
  subroutine test_lines()
    type(near_facets_t) :: near

    near%tolerance = 1.0e-9_dp
    call add_line(5, [1.0_dp, 0.0_dp, 2.0_dp, 0.0_dp], near)
    call add_line(3, [4.0_dp, 0.0_dp, 3.0_dp, 0.0_dp], near)
    call add_line(7, [2.0_dp, 0.0_dp, 3.0_dp, 0.0_dp], near)
    call add_line(8, [5.0_dp, 0.0_dp, 6.0_dp, 0.0_dp], near)
    call add_line(2, [4.0_dp, 0.0_dp, 4.0_dp, 1.0_dp], near)
    call add_line(9, [1.0_dp, 1.0e-3_dp, 2.0_dp, 1.0e-3_dp], near)
    call near%join_lines()
    call check_equal(near%n, 4, "three segments are one")
    call check_equal(near%number(1), 3, "with the lowest number")
    call check_close(abs(near%corner(1, 1, 1) - near%corner(1, 2, 1)), 3.0_dp, 0.0_dp, "as long as all of them")
    call check_close(maxval(near%corner(1, :, 1)), 4.0_dp, 0.0_dp, "up to the last end")
  end subroutine test_lines

  subroutine add_line(number, ends, near)
    integer, intent(in) :: number
    real(dp), intent(in) :: ends(4)
    type(near_facets_t), intent(inout) :: near
    real(dp) :: line(3, 2)

    line(:, :) = 0.0_dp
    line(1:2, 1) = ends(1:2)
    line(1:2, 2) = ends(3:4)
    call near%add(number, line)
  end subroutine add_line

  !> A surface of facets on a wave.
  subroutine make_wave(mesh, facet)
    type(mesh_t), intent(out) :: mesh
    real(dp), intent(out) :: facet(3, 3, 202)
    character(len=:), allocatable :: wrong, expected
    integer :: i, k, x(3)
    real(dp) :: values(3, 2)

    k = 0
    do i = 0, 99
      x(:) = [0, 1, 1]
      x(:) = i + x
      call set_facet(x, [0, 0, 1], facet(:, :, k + 1))
      x(3) = i
      call set_facet(x, [0, 1, 1], facet(:, :, k + 2))
      k = k + 2
    end do
    ! a needle and a point: neither has an area
    call set_facet([0, 4, 0], [0, 0, 0], facet(:, :, 201))
    call set_facet([3, 3, 3], [1, 1, 1], facet(:, :, 202))
    values(:, 1) = [10.0_dp, 20.0_dp, 30.0_dp]
    values(:, 2) = [2.0_dp, 0.0_dp, 0.0_dp]
    call mesh%set(values, wrong, expected)
    call check(wrong == "", "a mesh")
    call mesh%take_facets(facet)
  end subroutine make_wave

  !> A facet of the wave between points by their numbers along both axes.
  pure subroutine set_facet(x, y, corner)
    integer, intent(in) :: x(3), y(3)
    real(dp), intent(out) :: corner(3, 3)
    integer :: c

    do c = 1, 3
      corner(1, c) = 0.1_dp*x(c)
      corner(2, c) = 1.0_dp*y(c)
      corner(3, c) = sin(0.3_dp*x(c))
    end do
  end subroutine set_facet

  subroutine test_mesh()
    type(mesh_t) :: mesh, other
    type(near_facets_t) :: near
    real(dp) :: facet(3, 3, 202), corner(3, 3), foot(3), from(3), normal(3), distance, least, level, box(3, 8)
    integer :: k, c, m, place, missing
    logical :: known
    character(len=:), allocatable :: wrong, expected

    call mesh%set(reshape([0, 0, 0, 0, 0, 0]*1.0_dp, [3, 2]), wrong, expected)
    call check(wrong == "scale", "a scale of 0")
    call make_wave(mesh, facet)
    call check_equal(mesh%n_facets(), 200, "facets without area are left out")
    call check_equal(mesh%n_left_out(), 2, "and counted")
    ! turned by a right angle about z
    mesh%edge(:, 1) = [0.0_dp, 1.0_dp, 0.0_dp]
    mesh%edge(:, 2) = [-1.0_dp, 0.0_dp, 0.0_dp]
    call mesh%get_facet(1, corner)
    call check(norm2(corner(:, 2) - [10.0_dp, 20.2_dp, 30.0_dp + 2*sin(0.3_dp)]) < 1.0e-14_dp, &
      & "a facet, scaled, turned and put in its place")
    call mesh%find_box(k, box)
    call check_equal(k, 8, "corners of the box")
    call check_close(minval(box(1, :)), 8.0_dp, 1.0e-14_dp, "its end along x")
    call check_close(maxval(box(2, :)), 40.0_dp, 1.0e-13_dp, "its end along y")
    call check_close(mesh%half_width(2, .false.), 10.0_dp, 1.0e-13_dp, "half of its width")
    call check_close(mesh%half_width(2, .true.), 0.5_dp*mesh%data%diagonal(), 1.0e-13_dp, "half of that of all its turns")
    call check_close(mesh%far_off(), 40.0_dp, 1.0e-13_dp, "its farthest coordinate")
    call check_close(mesh%support(3, 1.0_dp), minval(box(3, :)), 0.0_dp, "its lowest point")
    call mesh%level(3, level, known)
    call check(.not. known, "a wave faces along no axis")
    missing = 0
    do m = 1, 100
      from(1) = random() - 1.0_dp
      from(2) = 10.0_dp*random() + 10.0_dp
      from(3) = 3.0_dp*random()
      near%n = 0
      call mesh%find_facets(from, 0.8_dp, near)
      call mesh%locate(from, distance, normal)
      least = huge(1.0_dp)
      do k = 1, mesh%n_facets()
        call mesh%get_facet(k, corner)
        do c = 1, 3
          corner(:, c) = corner(:, c) - mesh%point - from
        end do
        call find_foot(corner, foot, place)
        least = min(least, norm2(foot))
        if (norm2(foot) > 0.8_dp .neqv. all(near%number(1:near%n) /= k)) missing = missing + 1
      end do
      if (abs(least - distance) > 1.0e-13_dp) missing = missing + 1
      from(:) = from - distance*normal
      call mesh%locate(from, distance, normal)
      if (distance > 1.0e-13_dp) missing = missing + 1
    end do
    call check_equal(missing, 0, "facets near a point and the nearest point")
    call check(near%tolerance > 0.0_dp .and. near%tolerance < 1.0e-5_dp, "a tolerance for files of single precision")
    other = mesh
    call check(other%digest() == mesh%digest() .and. associated(other%data, mesh%data), "copies share their facets")
    facet(3, 1, 5) = facet(3, 1, 5) + 1.0e-9_dp
    call other%take_facets(facet)
    call check(other%digest() /= mesh%digest(), "other facets are others")
    other%point(:) = other%point + [0.0_dp, 3.0_dp, 4.0_dp]
    call check_close(other%way(mesh), 5.0_dp, 1.0e-8_dp, "how far a mesh has moved")
  end subroutine test_mesh

  !> A floor as wide as the period is met across the seam, unless it turns.
  subroutine test_images()
    type(boundary_t) :: boundary
    type(near_facets_t) :: near
    real(dp) :: values(3, 2), line(3, 2, 1)
    character(len=:), allocatable :: wrong, expected

    call make_surface("mesh", boundary%surface)
    values(:, 1) = 0.0_dp
    values(:, 2) = 1.0_dp
    call boundary%surface%set(values, wrong, expected)
    line(:, :, :) = 0.0_dp
    line(1, 2, 1) = 2.0_dp
    call boundary%surface%take_facets(line)
    call check(boundary%is_faceted() .and. boundary%touches(), "a mesh can be touched")
    call boundary%find_facets([1.9_dp, 0.1_dp], 0.5_dp, near)
    call check_equal(near%n, 1, "a line")
    call check_close(maxval(near%corner(1, :, 1)), 0.1_dp, 1.0e-15_dp, "it ends")
    boundary%period(1) = 2.0_dp
    call boundary%find_facets([7.9_dp, 0.1_dp], 0.5_dp, near)
    call check_equal(near%n, 1, "with its image it is one line")
    call check_close(maxval(near%corner(1, :, 1)), 2.1_dp, 1.0e-14_dp, "which goes on")
    boundary%drive%spin(3) = 1.0_dp
    call boundary%find_facets([7.9_dp, 0.1_dp], 0.5_dp, near)
    call check_close(maxval(near%corner(1, :, 1)), 0.1_dp, 1.0e-14_dp, "what turns has the nearest image alone")
    boundary%present = .false.
    call check(boundary%is_faceted() .and. .not. boundary%touches(), "one that was taken away")
  end subroutine test_images

  !> Triangles of a polygon that is not convex have its area, and no triangle is turned round.
  subroutine test_ears()
    real(dp), parameter :: ell(3, 6) = reshape([0, 0, 1, 2, 0, 1, 2, 1, 1, 1, 1, 1, 1, 2, 1, 0, 2, 1]*1.0_dp, [3, 6])
    integer, allocatable :: triangle(:, :)
    !> a square of 4 with a hole of 2, joined by a bridge; and a polygon that crosses itself
    real(dp), parameter :: key(3, 10) = reshape([0, 0, 1, 4, 0, 1, 4, 4, 1, 0, 4, 1, 0, 0, 1, 1, 1, 1, 1, 3, 1, 3, 3, 1, 3, 1, 1, &
      & 1, 1, 1]*1.0_dp, [3, 10])
    real(dp), parameter :: bow(3, 4) = reshape([0, 0, 1, 1, 1, 1, 1, 0, 1, 0, 1, 1]*1.0_dp, [3, 4])
    real(dp) :: area, whole, p(3, 6), q(3, 10)
    logical :: is_simple
    integer :: k, start

    do start = 0, 9
      q(:, :) = cshift(key, start, dim=2)
      call clip_ears(q, triangle, is_simple)
      call check(is_simple, "triangles around a hole do not cover it")
      whole = 0.0_dp
      do k = 1, size(triangle, 2)
        whole = whole + abs(area_of(q(:, triangle(1, k)), q(:, triangle(2, k)), q(:, triangle(3, k))))
      end do
      call check_close(whole, 12.0_dp, 1.0e-14_dp, "they fill what is around it")
    end do
    call clip_ears(bow, triangle, is_simple)
    call check(.not. is_simple, "a polygon that crosses itself")
    do start = 0, 5
      p(:, :) = cshift(ell, start, dim=2)
      call clip_ears(p, triangle, is_simple)
      call check(is_simple, "no triangle lies on another")
      call check_equal(size(triangle, 2), 4, "triangles of six corners")
      whole = 0.0_dp
      do k = 1, 4
        area = area_of(p(:, triangle(1, k)), p(:, triangle(2, k)), p(:, triangle(3, k)))
        call check(area >= 0.0_dp, "no triangle is turned round")
        whole = whole + area
      end do
      call check_close(whole, 3.0_dp, 1.0e-15_dp, "they fill it")
    end do
    call clip_ears(ell(:, 1:3), triangle, is_simple)
    call check(all(triangle(:, 1) == [1, 2, 3]) .and. size(triangle, 2) == 1, "a triangle is one")
  end subroutine test_ears

  !> Area of a triangle in the plane, with a sign.
  pure real(dp) function area_of(a, b, c)
    real(dp), intent(in) :: a(3), b(3), c(3)
    area_of = 0.5_dp*((b(1) - a(1))*(c(2) - a(2)) - (b(2) - a(2))*(c(1) - a(1)))
  end function area_of

  subroutine write_file(file, text)
    character(len=*), intent(in) :: file, text
    integer :: unit

    open (newunit=unit, file=file, access="stream", status="replace", action="write")
    write (unit) text
    close (unit)
  end subroutine write_file

  subroutine test_files()
    real(dp), allocatable :: facet(:, :, :)
    type(error_t), allocatable :: error

    call write_file("line.csv", "# a remark"//n//"y,x"//n//"0,0"//n//"0,1"//n//"2,1"//n//"0,0"//n)
    call read_mesh("line.csv", 2, facet, error)
    call check(.not. allocated(error), "a line")
    call check(all(shape(facet) == [3, 2, 3]), "three segments")
    call check(norm2(facet(:, 2, 2) - [1.0_dp, 2.0_dp, 0.0_dp]) <= 0.0_dp .and. norm2(facet(:, 2, 3)) <= 0.0_dp, "a closed line")
    call write_file("line.obj", "v 0 0 0"//n//"v 1 0 0"//n//"v 1 1 0"//n//"l 1 2 3"//n//"l 3 -3"//n)
    call read_mesh("line.obj", 2, facet, error)
    call check(.not. allocated(error), "lines of an OBJ file")
    call check(all(shape(facet) == [3, 2, 3]) .and. norm2(facet(:, 2, 3)) <= 0.0_dp, "their segments")
    call write_file("face.OBJ", "v 0 0 0"//n//"v 1 0 0"//n//"v 1 1 0"//n//"v 0 1 0"//n//"f 1 2 3 4"//n//"l 1 2"//n)
    call read_mesh("face.OBJ", 3, facet, error)
    call check(.not. allocated(error), "a face of four corners")
    call check(all(shape(facet) == [3, 3, 2]), "its triangles")
  end subroutine test_files

  subroutine test_refused()
    character(len=*), parameter :: points = "v 0 0 0"//n//"v 1 0 0"//n//"v 1 1 0.5"//n

    call refuse("a.txt", "", 3, ".stl or .obj")
    call refuse("a.stl", "solid", 2, ".csv or .obj")
    call refuse("a.csv", "x,y"//n//"0,0"//n, 2, "two points or more were expected")
    call refuse("b.csv", "x,z"//n//"0,0"//n, 2, "columns x and y")
    call refuse("c.csv", "x,y"//n//"0,0"//n//"1e40,0"//n, 2, "1e30")
    call refuse("g.csv", "x,y,z"//n//"0,0,0"//n//"1,0,0.5"//n, 2, "point 2: z = 5.00000000E-01: expected 0 in 2D")
    call refuse("d.obj", points//"l 1 2 3", 2, ": expected 0 in 2D")
    call refuse("e.obj", points//"f 1 2 3", 2, "e.obj: no line through points, ""l i j"", was found")
    call refuse("f.obj", points//"l 1", 2, "a line of 1 corners, but 2")
    call refuse("g.obj", points//"f 1 2", 3, "a face of 2 corners, but 3")
    call refuse("none.stl", "", 3, "none.stl")
  end subroutine test_refused

  subroutine refuse(file, text, dimension, wanted)
    character(len=*), intent(in) :: file, text, wanted
    integer, intent(in) :: dimension
    real(dp), allocatable :: facet(:, :, :)
    type(error_t), allocatable :: error

    if (index(file, "none") == 0) call write_file(file, text)
    call read_mesh(file, dimension, facet, error)
    call check(allocated(error), "refused: "//file)
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "bad input: "//file)
    call check(index(error%message, file) == 1 .and. index(error%message, wanted) > 0, file//": "//error%message)
  end subroutine refuse

end program test_facets
