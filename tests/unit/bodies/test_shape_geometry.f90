!> What shapes in space are made with: vectors, planes of faces, hulls, closed surfaces, cores, unions and corners that are known.
program test_shape_geometry
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_convex_piece, only: convex_piece_t
  use gravier_spatial, only: triple_product, find_normal, find_box, extent_of, turn_back, shorten
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t, find_planes, find_neighbours, start_of_face
  use gravier_convex_hull, only: find_hull
  use gravier_hull_faces, only: merge_triangles
  use gravier_closed_surface, only: merge_points, check_closed_convex
  use gravier_rounded_core, only: find_core
  use gravier_mass_properties, only: mass_t, mass_of_polyhedron
  use gravier_known_corners, only: regular_polygon, platonic_solid, random_polygon, random_polyhedron
  use gravier_random_turn, only: random_turn
  use gravier_polyhedron, only: make_piece, make_capsule_piece
  use gravier_polyhedra, only: tetrahedron, cube, octahedron
  use gravier_piece_width, only: half_width_of
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-13_dp, flat = 1.0e-9_dp
  real(dp), parameter :: no_way(3) = 0.0_dp
  real(dp), parameter :: first_axis(3) = [1.0_dp, 0.0_dp, 0.0_dp], second_axis(3) = [0.0_dp, 1.0_dp, 0.0_dp], &
    & third_axis(3) = [0.0_dp, 0.0_dp, 1.0_dp]
  real(dp), parameter :: straight(3, 3) = reshape([first_axis, second_axis, third_axis], [3, 3])

  call test_vectors()
  call test_planes()
  call test_hull()
  call test_no_hull()
  call test_merging()
  call test_same_points()
  call test_closed_surfaces()
  call test_core_of_cube()
  call test_core_of_roof()
  call test_widths()
  call test_known_corners()
  call test_random_corners()
  call test_random_turns()
  call finish_checks()

contains

  subroutine test_vectors()
    real(dp), parameter :: points(3, 3) = reshape( &
      & [1.0_dp, 5.0_dp, -1.0_dp, -2.0_dp, 6.0_dp, 0.0_dp, 0.0_dp, 5.5_dp, 3.5_dp], [3, 3])
    real(dp) :: normal(3), low(3), high(3), x(3), axes(3, 3)
    integer, allocatable :: list(:)

    call check_close(triple_product(first_axis, second_axis, third_axis), 1.0_dp, 0.0_dp, "the volume of a cube")
    call check_close(triple_product(second_axis, first_axis, third_axis), -1.0_dp, 0.0_dp, "two axes the other way round")
    call check_close(triple_product(points(:, 1), points(:, 1), points(:, 3)), 0.0_dp, tight, "two vectors alike span no volume")
    call find_normal(points(:, 1), points(:, 2), points(:, 3), normal)
    call check_close(dot_product(normal, points(:, 2) - points(:, 1)), 0.0_dp, tight, "a normal is across the first side")
    call check_close(dot_product(normal, points(:, 3) - points(:, 1)), 0.0_dp, tight, "and across the other")
    call find_normal(no_way, 2*first_axis, 3*second_axis, normal)
    call check_close(normal(3), 6.0_dp, 0.0_dp, "its length is twice the area")
    call find_box(points, low, high)
    call check_close(maxval(abs(low - [-2.0_dp, 5.0_dp, -1.0_dp])), 0.0_dp, 0.0_dp, "the lower corner of a box")
    call check_close(maxval(abs(high - [1.0_dp, 6.0_dp, 3.5_dp])), 0.0_dp, 0.0_dp, "the upper corner of a box")
    call check_close(extent_of(points), 4.5_dp, 0.0_dp, "the longest side of a box")
    call check_close(extent_of(points(:, 1:0)), 0.0_dp, 0.0_dp, "no points have no extent")
    axes(:, 1) = [0.6_dp, 0.8_dp, 0.0_dp]
    axes(:, 2) = [-0.8_dp, 0.6_dp, 0.0_dp]
    axes(:, 3) = third_axis
    x(:) = points(:, 2) + 2*axes(:, 1) - 3*axes(:, 2) + 4*axes(:, 3)
    call turn_back(axes, points(:, 2), x)
    call check_close(maxval(abs(x - [2.0_dp, -3.0_dp, 4.0_dp])), 0.0_dp, tight, "components along turned axes")
    allocate (list(4))
    list(:) = [7, 5, 3, 1]
    call shorten(list, 2)
    call check_equal(size(list), 2, "a list cut short")
    call check(all(list == [7, 5]), "keeps its first items")
  end subroutine test_vectors

  !> The tetrahedron of the origin and the ends of three unit vectors.
  subroutine test_planes()
    type(sharp_polyhedron_t) :: corner
    integer, allocatable :: first(:), neighbour(:)
    integer :: face(4), k

    allocate (corner%vertex(3, 4), source=0.0_dp)
    do k = 1, 3
      corner%vertex(k, k + 1) = 1.0_dp
    end do
    allocate (corner%face_first(5), corner%face_vertex(12))
    corner%face_first(:) = [1, 4, 7, 10, 13]
    corner%face_vertex(:) = [1, 3, 2, 1, 2, 4, 1, 4, 3, 2, 3, 4]
    call find_planes(corner)
    call check_close(maxval(abs(corner%face_normal(:, 1) + third_axis)), 0.0_dp, tight, "the face across the third axis")
    call check_close(maxval(abs(corner%face_normal(:, 2) + second_axis)), 0.0_dp, tight, "the face across the second axis")
    call check_close(maxval(abs(corner%face_offset(1:3))), 0.0_dp, tight, "three planes through the origin")
    call check_close(maxval(abs(corner%face_normal(:, 4) - sqrt(1/3.0_dp))), 0.0_dp, tight, "the slope")
    call check_close(corner%face_offset(4), sqrt(1/3.0_dp), tight, "its distance from the origin")
    call find_neighbours(4, corner%face_first, corner%face_vertex, first, neighbour)
    call check(all(first == [1, 4, 7, 10, 13]), "each corner has three neighbours")
    call check(all(neighbour == [2, 3, 4, 1, 3, 4, 1, 2, 4, 1, 2, 3]), "the three others, in ascending order")
    face(:) = [4, 7, 2, 9]
    call start_of_face(face)
    call check(all(face == [2, 9, 4, 7]), "a face begins with its lowest number")
    ! a face without area
    corner%face_vertex(1:3) = [1, 2, 2]
    call find_planes(corner)
    call check_close(maxval(abs(corner%face_normal(:, 1))), 0.0_dp, 0.0_dp, "no area, no normal")
  end subroutine test_planes

  !> A cube among points in its faces, on its edges and inside, some of them twice.
  subroutine test_hull()
    real(dp) :: points(3, 20)
    type(sharp_polyhedron_t) :: hull
    character(len=:), allocatable :: message
    logical :: behind
    integer :: f, k

    points(:, :) = 0.0_dp
    points(:, 5:12) = cube()
    points(:, 13:20) = cube()
    points(1, 1) = 1.0_dp
    points(1:2, 2) = -1.0_dp
    points(:, 3) = 0.25_dp
    call find_hull(points, flat, hull, message)
    call check_equal(message, "", "the hull of a cube")
    call check(all(shape(hull%vertex) == [3, 8]), "a cube has eight corners")
    call check_close(maxval(abs(hull%vertex - points(:, 5:12))), 0.0_dp, 0.0_dp, "in the order of the points")
    call check_equal(size(hull%face_first), 7, "six faces")
    call check_equal(size(hull%face_vertex), 24, "of four corners each")
    behind = .true.
    do f = 1, 6
      call check_close(hull%face_offset(f), 1.0_dp, tight, "a face lies at 1 from the centre")
      call check_close(maxval(abs(hull%face_normal(:, f))), 1.0_dp, tight, "its normal is along an axis")
      do k = 1, 8
        behind = behind .and. dot_product(hull%face_normal(:, f), hull%vertex(:, k)) <= hull%face_offset(f) + tight
      end do
    end do
    call check(behind, "all corners are behind all faces")
  end subroutine test_hull

  subroutine test_no_hull()
    real(dp) :: points(3, 8)
    type(sharp_polyhedron_t) :: hull
    character(len=:), allocatable :: message

    points(:, :) = cube()
    call find_hull(points(:, 1:3), flat, hull, message)
    call check(index(message, "at least 4 different points") > 0, "three points: "//message)
    call find_hull(points(:, 1:4), flat, hull, message)
    call check(index(message, "in a plane") > 0, "points of a face: "//message)
    points(2:3, :) = 0.0_dp
    points(1, 1:4) = [1.0_dp, 2.0_dp, 3.0_dp, 5.0_dp]
    call find_hull(points(:, 1:4), flat, hull, message)
    call check(index(message, "on a line") > 0, "points of a line: "//message)
  end subroutine test_no_hull

  !> The faces of a cube cut into triangles, one of them about a point in its middle, make the cube again.
  subroutine test_merging()
    real(dp) :: points(3, 9)
    type(sharp_polyhedron_t) :: hull, merged
    character(len=:), allocatable :: message
    integer :: triangles(3, 14), f, k, n, first

    points(:, 9) = third_axis
    points(:, 1:8) = cube()
    call find_hull(points(:, 1:8), flat, hull, message)
    n = 0
    do f = 1, 6
      first = hull%face_first(f)
      do k = 0, 3
        if (hull%face_normal(3, f) > 0.5_dp) then
          n = n + 1
          triangles(1, n) = hull%face_vertex(first + k)
          triangles(2, n) = hull%face_vertex(first + mod(k + 1, 4))
          triangles(3, n) = 9
        else if (k >= 2) then
          n = n + 1
          triangles(1, n) = hull%face_vertex(first)
          triangles(2:3, n) = hull%face_vertex(first + k - 1:first + k)
        end if
      end do
    end do
    call check_equal(n, 14, "triangles of a cube")
    call merge_triangles(points, triangles, flat, merged, message)
    call check_equal(message, "", "triangles are merged")
    call check(all(shape(merged%vertex) == [3, 8]), "the point in the middle of a face is no corner")
    call check_equal(size(merged%face_first), 7, "merged: six faces")
    call check_equal(size(merged%face_vertex), 24, "merged: four corners each")
    call check_close(maxval(abs(merged%face_offset - 1.0_dp)), 0.0_dp, tight, "merged: the planes of a cube")
  end subroutine test_merging

  subroutine test_same_points()
    real(dp) :: points(3, 6)
    integer :: same(6), none(0)

    points(:, :) = 0.0_dp
    points(1, :) = [1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0e-7_dp]
    points(2, :) = [0.0_dp, 0.0_dp, 1.0e-7_dp, 2.0_dp, 1.0_dp, 0.0_dp]
    call merge_points(points, 1.0e-6_dp, same)
    call check(all(same == [1, 2, 1, 4, 5, 2]), "points closer together than a distance are one")
    call merge_points(points, 1.0e-8_dp, same)
    call check(all(same == [1, 2, 3, 4, 5, 6]), "those farther apart are not")
    call merge_points(points(:, 1:0), 1.0_dp, none)
  end subroutine test_same_points

  !> Surfaces of a cube and an octahedron, whole and with faults.
  subroutine test_closed_surfaces()
    real(dp) :: points(3, 8)
    type(sharp_polyhedron_t) :: whole, spoiled
    integer, allocatable :: list(:)
    integer :: f

    points(:, :) = cube()
    call take_hull(points, whole)
    call check_surface(whole, "", "a cube")
    call take_hull(points, spoiled)
    call shorten(spoiled%face_first, 6)
    call shorten(spoiled%face_vertex, 20)
    call check_surface(spoiled, "the surface is not closed", "a face less")
    call shorten(spoiled%face_first, 4)
    call shorten(spoiled%face_vertex, 12)
    call check_surface(spoiled, "fewer than 4 faces", "three faces")
    call take_hull(points, spoiled)
    do f = 1, 6
      list = spoiled%face_vertex(4*f:4*f - 3:-1)
      spoiled%face_vertex(4*f - 3:4*f) = list
    end do
    call check_surface(spoiled, "inside out", "all faces turned")
    call take_hull(points, spoiled)
    list = spoiled%face_vertex(8:5:-1)
    spoiled%face_vertex(5:8) = list
    call check_surface(spoiled, "the surface is not closed", "one face turned")
    call take_hull(points, spoiled)
    spoiled%face_vertex(10) = spoiled%face_vertex(9)
    call check_surface(spoiled, "face 3 has two corners at one place", "a corner twice")
    call take_hull(points, spoiled)
    spoiled%vertex(:, 1) = 1.01_dp*spoiled%vertex(:, 1)
    call check_surface(spoiled, "is not plane", "a corner of a cube further out")
    points(:, 1:6) = octahedron()
    call take_hull(points(:, 1:6), spoiled)
    call check_surface(spoiled, "", "an octahedron")
    ! its upper corner is pushed down between the others
    where (spoiled%vertex(3, :) > 0.5_dp) spoiled%vertex(3, :) = -0.5_dp
    call check_surface(spoiled, "the body is not convex", "a dent")
    spoiled%vertex(3, :) = 0.0_dp
    call check_surface(spoiled, "the surface has no volume", "an octahedron without height")
    spoiled%vertex(2, :) = 0.0_dp
    call check_surface(spoiled, "has no area", "an octahedron that is a line")
  end subroutine test_closed_surfaces

  subroutine take_hull(points, hull)
    real(dp), intent(in), contiguous :: points(:, :)
    type(sharp_polyhedron_t), intent(out) :: hull
    character(len=:), allocatable :: message

    call find_hull(points, flat, hull, message)
    call check_equal(message, "", "a hull")
  end subroutine take_hull

  !> The message has a part, or is empty.
  subroutine check_surface(surface, part, name)
    type(sharp_polyhedron_t), intent(inout) :: surface
    character(len=*), intent(in) :: part, name
    character(len=:), allocatable :: message

    call check_closed_convex(surface, flat, message)
    call check(index(message, part) > 0 .and. (len(part) > 0 .or. len(message) == 0), name//": "//message)
  end subroutine check_surface

  !> The core of a cube is a cube.
  subroutine test_core_of_cube()
    real(dp), parameter :: rounding = 0.125_dp
    real(dp) :: points(3, 8)
    type(sharp_polyhedron_t) :: sharp
    type(convex_piece_t) :: piece
    character(len=:), allocatable :: message

    points(:, :) = cube()
    call take_hull(points, sharp)
    call find_core(sharp, no_way, straight, rounding, piece, message)
    call check_equal(message, "", "the core of a cube")
    call check_close(maxval(abs(piece%corner - points)), 0.0_dp, tight, "its sharp corners are those of the cube")
    call check_close(maxval(abs(piece%vertex - (1.0_dp - rounding)*points)), 0.0_dp, tight, "its faces are moved inwards")
    call check_close(piece%rounding, rounding, 0.0_dp, "the rounding is kept")
    call check_equal(size(piece%face_first), 7, "the core has six faces")
    call check_equal(size(piece%neighbour), 24, "and twelve edges")
    call find_core(sharp, no_way, straight, 0.0_dp, piece, message)
    call check(index(message, "a rounding above 0") > 0, "no rounding: "//message)
    call find_core(sharp, 0.5_dp*first_axis, straight, 0.5_dp, piece, message)
    call check(index(message, "too large") > 0, "a face no farther away than the rounding: "//message)
  end subroutine test_core_of_cube

  !> A roof of four slopes that meet in a point: in the core, where slopes differ, the point is a ridge.
  subroutine test_core_of_roof()
    real(dp), parameter :: rounding = 0.1_dp, half = (2*sqrt(2.0_dp) - sqrt(5.0_dp))*rounding
    real(dp) :: points(3, 5)
    type(sharp_polyhedron_t) :: sharp
    type(convex_piece_t) :: piece
    character(len=:), allocatable :: message
    integer :: k, n

    points(:, :) = 0.0_dp
    points(1, 1:4) = [-2.0_dp, 2.0_dp, 2.0_dp, -2.0_dp]
    points(2, 1:4) = [-1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp]
    points(3, 5) = 1.0_dp
    call take_hull(points, sharp)
    call check_equal(size(sharp%face_first), 6, "a roof has four slopes and a floor")
    call find_core(sharp, 0.3_dp*third_axis, straight, rounding, piece, message)
    call check_equal(message, "", "the core of a roof")
    call check_equal(size(piece%vertex, 2), 6, "it has two corners more than a pyramid of four sides less one")
    n = 0
    do k = 1, size(piece%vertex, 2)
      if (norm2(piece%corner(:, k) - third_axis) > tight) then
        call check_close(piece%vertex(3, k), rounding, tight, "the floor is moved upwards")
      else
        n = n + 1
        call check_close(abs(piece%vertex(1, k)), half, tight, "half the ridge")
        call check_close(piece%vertex(2, k), 0.0_dp, tight, "the ridge is in the middle")
        call check_close(piece%vertex(3, k), 1.0_dp - sqrt(2.0_dp)*rounding, tight, "its height")
      end if
    end do
    call check_equal(n, 2, "both ends of the ridge have the top behind them")
  end subroutine test_core_of_roof

  !> Half of the least width: between two faces of a cube and of an octahedron, between two edges of a tetrahedron, between a side
  !> and a corner of a triangle, and of roundings alone.
  subroutine test_widths()
    type(convex_piece_t) :: piece
    type(mass_t) :: mass
    type(error_t), allocatable :: error
    real(dp) :: ends(3, 2), eight(3, 8), six(3, 6), four(3, 4)

    eight(:, :) = cube()
    six(:, :) = octahedron()
    four(:, :) = tetrahedron()
    call make_piece("cube", eight, 0.1_dp, piece, mass, error)
    call check_close(half_width_of(piece), 1.0_dp, tight, "half width of a cube of edge 2, rounded")
    call make_piece("octahedron", six, 1.0e-6_dp, piece, mass, error)
    call check_close(half_width_of(piece), 1.0_dp/sqrt(3.0_dp), 1.0e-5_dp, "half width of an octahedron")
    ! faces are 4/sqrt(3) from the corner across, which is more
    call make_piece("tetrahedron", four, 1.0e-6_dp, piece, mass, error)
    call check_close(half_width_of(piece), 1.0_dp, 1.0e-5_dp, "half width of a tetrahedron")
    ends(:, 1) = no_way
    ends(:, 2) = third_axis
    call make_capsule_piece("capsule", ends, 0.2_dp, piece, mass, error)
    call check_close(half_width_of(piece), 0.2_dp, 0.0_dp, "half width of a capsule")
    call check(.not. allocated(error), "the pieces are made")
    deallocate (piece%vertex)
    allocate (piece%vertex(2, 3))
    piece%vertex(:, :) = reshape([0.0_dp, 0.0_dp, 4.0_dp, 0.0_dp, 0.0_dp, 3.0_dp], [2, 3])
    call check_close(half_width_of(piece), 0.2_dp + 0.5_dp*2.4_dp, tight, "half width of a triangle, rounded")
  end subroutine test_widths

  subroutine test_known_corners()
    real(dp), allocatable :: corner(:, :)
    real(dp) :: area
    integer :: n, k, next

    do n = 3, 8
      call regular_polygon(n, 2.0_dp, corner)
      area = 0.0_dp
      do k = 1, n
        next = mod(k, n) + 1
        area = area + 0.5_dp*(corner(1, k)*corner(2, next) - corner(2, k)*corner(1, next))
        call check_close(norm2(corner(:, k)), 2.0_dp, tight, "a corner is on the circle")
      end do
      call check_close(area, 2.0_dp*n*sin(2*pi/n), 10*tight, "the area of a regular polygon, anticlockwise")
      call check_close(corner(2, 1), -2.0_dp*cos(pi/n), tight, "its lowest side")
      call check_close(corner(2, n), corner(2, 1), tight, "lies along the first axis")
    end do
    call check_solid("tetrahedron", 4, 4, 8/(9*sqrt(3.0_dp)))
    call check_solid("cube", 8, 6, 8/(3*sqrt(3.0_dp)))
    call check_solid("octahedron", 6, 8, 4/3.0_dp)
    call check_solid("dodecahedron", 20, 12, 2*sqrt(3.0_dp)/9*(5 + sqrt(5.0_dp)))
    call check_solid("icosahedron", 12, 20, sqrt(40 + 8*sqrt(5.0_dp))/3)
  end subroutine test_known_corners

  !> A Platonic solid of radius 1.
  subroutine check_solid(name, n_corners, n_faces, volume)
    character(len=*), intent(in) :: name
    integer, intent(in) :: n_corners, n_faces
    real(dp), intent(in) :: volume
    real(dp), allocatable :: corner(:, :)
    type(sharp_polyhedron_t) :: hull
    type(mass_t) :: mass
    integer :: k

    call platonic_solid(name, 3.0_dp, corner)
    call check_equal(size(corner, 2), n_corners, name//": corners")
    do k = 1, size(corner, 2)
      call check_close(norm2(corner(:, k)), 3.0_dp, 10*tight, name//": radius")
    end do
    call take_hull(corner, hull)
    call check_equal(size(hull%face_first) - 1, n_faces, name//": faces")
    mass = mass_of_polyhedron(hull)
    call check_close(mass%volume, 27*volume, 1000*tight, name//": volume")
    call check_close(norm2(mass%centre), 0.0_dp, 10*tight, name//": centre")
  end subroutine check_solid

  subroutine test_random_corners()
    real(dp), parameter :: axes(3) = [1.0_dp, 2.0_dp, 0.5_dp]
    real(dp), allocatable :: corner(:, :), again(:, :)
    type(sharp_polyhedron_t) :: hull
    real(dp) :: scaled(3), turn
    integer :: k, next

    call random_polygon(5, 9, axes(1:2), corner)
    call random_polygon(5, 9, axes(1:2), again)
    call check_close(maxval(abs(corner - again)), 0.0_dp, 0.0_dp, "one seed, one polygon")
    call random_polygon(6, 9, axes(1:2), again)
    call check(maxval(abs(corner - again)) > 1.0e-3_dp, "another seed, another polygon")
    do k = 1, 9
      next = mod(k, 9) + 1
      call check_close(norm2(corner(:, k)/axes(1:2)), 1.0_dp, tight, "a corner is on the ellipse")
      turn = corner(1, k)*corner(2, next) - corner(2, k)*corner(1, next)
      call check(turn > 0.0_dp, "corners follow each other anticlockwise")
    end do
    call random_polyhedron(5, 30, axes, corner)
    call random_polyhedron(5, 30, axes, again)
    call check_close(maxval(abs(corner - again)), 0.0_dp, 0.0_dp, "one seed, one stone")
    do k = 1, 30
      scaled(:) = corner(:, k)/axes
      call check_close(norm2(scaled), 1.0_dp, tight, "a corner is on the ellipsoid")
    end do
    call take_hull(corner, hull)
    call check_equal(size(hull%vertex, 2), 30, "all corners of a stone are corners of its hull")
  end subroutine test_random_corners

  !> Angles and quaternions: the moments of an even spread.
  subroutine test_random_turns()
    integer, parameter :: n = 20000
    real(dp) :: angle(1), turn(4), total, mean(4), square(4)
    integer :: k
    logical :: within, unit

    within = .true.
    unit = .true.
    total = 0.0_dp
    mean(:) = 0.0_dp
    square(:) = 0.0_dp
    do k = 1, n
      call random_turn(7, int(k, i8), 3, angle)
      within = within .and. angle(1) >= 0.0_dp .and. angle(1) < 2*pi
      total = total + angle(1)/n
      call random_turn(7, int(k, i8), 3, turn)
      unit = unit .and. abs(norm2(turn) - 1.0_dp) <= tight
      mean(:) = mean + turn/n
      square(:) = square + turn**2/n
    end do
    call check(within, "angles from 0 to a whole turn")
    call check(unit, "quaternions of length 1")
    ! five standard deviations of the means
    call check_close(total, pi, 5*2*pi/sqrt(12.0_dp*n), "the mean angle is half a turn")
    call check(all(abs(mean) < 5*sqrt(0.25_dp/n)), "no direction of quaternions is liked better")
    call check(all(abs(square - 0.25_dp) < 5*0.25_dp/sqrt(real(n, dp))), "nor any component of them")
  end subroutine test_random_turns

end program test_shape_geometry
