!> Shapes of rounded polyhedra: hulls of points with known volume and inertia, cores, checks of surfaces, unions, files.
program test_polyhedron
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_convex_piece, only: convex_piece_t
  use gravier_mass_properties, only: mass_t, find_principal_axes
  use gravier_polyhedra, only: tetrahedron, cube, octahedron, dodecahedron, icosahedron, golden, draws_t, vector_t, turn_t, vec, &
    & about, random_turn
  use gravier_polyhedron, only: make_piece, make_capsule_piece
  use gravier_simple_shapes, only: make_polyhedron, make_polyhedron_of_faces, make_box, make_capsule, make_union
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_shape_library, only: body_shape_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-13_dp

  call MPI_Init()
  call test_regular()
  call test_box()
  call test_capsule()
  call test_points_in_faces()
  call test_turned()
  call test_core()
  call test_refusals()
  call test_faces()
  call test_axes()
  call test_unions()
  call finish_checks()
  call MPI_Finalize()

contains

  !> The five regular bodies of edge 1: volume, moment of inertia for a mass of 1, numbers of corners, faces and edges.
  subroutine test_regular()
    real(dp), parameter :: root2 = sqrt(2.0_dp), root5 = sqrt(5.0_dp)

    call check_regular("tetrahedron", 2*root2, 1/(6*root2), 1/20.0_dp, [4, 4, 6])
    call check_regular("cube", 2.0_dp, 1.0_dp, 1/6.0_dp, [8, 6, 12])
    call check_regular("octahedron", root2, root2/3, 1/10.0_dp, [6, 8, 12])
    call check_regular("dodecahedron", 2/golden, (15 + 7*root5)/4, (39*golden + 28)/150, [20, 12, 30])
    call check_regular("icosahedron", 2.0_dp, 5*(3 + root5)/12, golden**2/10, [12, 20, 30])
  end subroutine test_regular

  !> Corners of a regular body.
  subroutine take_points(name, points)
    character(len=*), intent(in) :: name
    real(dp), allocatable, intent(out) :: points(:, :)

    select case (name)
    case ("tetrahedron")
      allocate (points(3, 4))
      points(:, :) = tetrahedron()
    case ("cube")
      allocate (points(3, 8))
      points(:, :) = cube()
    case ("octahedron")
      allocate (points(3, 6))
      points(:, :) = octahedron()
    case ("dodecahedron")
      allocate (points(3, 20))
      points(:, :) = dodecahedron()
    case ("icosahedron")
      allocate (points(3, 12))
      points(:, :) = icosahedron()
    end select
  end subroutine take_points

  subroutine check_regular(name, edge, volume, inertia, counts)
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: edge, volume, inertia
    !> corners, faces, edges
    integer, intent(in) :: counts(3)
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer :: d

    call take_points(name, points)
    call make_polyhedron(name, points, 0.01_dp, shape, error)
    call check(.not. allocated(error), name)
    if (allocated(error)) return
    call check_close(shape%volume*(shape%size/edge)**3, volume, tight*volume, name//": volume")
    do d = 1, 3
      call check_close(shape%inertia(d)*(shape%size/edge)**2, inertia, tight, name//": inertia")
    end do
    call check_close(shape%size, norm2(points(:, 1)), tight, name//": size")
    call check_equal(size(shape%piece(1)%vertex, 2), counts(1), name//": corners")
    call check_equal(size(shape%piece(1)%face_first) - 1, counts(2), name//": faces")
    call check_equal(size(shape%piece(1)%neighbour), 2*counts(3), name//": edges")
    call check_piece(name, shape%piece(1))
  end subroutine check_regular

  !> Whether a core is what a piece tells: faces flat, convex and anticlockwise; each corner in its sharp faces.
  subroutine check_piece(name, piece)
    character(len=*), intent(in) :: name
    type(convex_piece_t), intent(in) :: piece
    logical :: flat, convex, sharp
    real(dp) :: offset, u(3), v(3), w(3)
    integer :: f, k, n, first

    flat = .true.
    convex = .true.
    sharp = .true.
    do f = 1, size(piece%face_first) - 1
      first = piece%face_first(f)
      n = piece%face_first(f + 1) - first
      associate (normal => piece%face_normal(:, f), corner => piece%face_vertex(first:first + n - 1))
        offset = dot_product(normal, piece%vertex(:, corner(1)))
        do k = 1, n
          flat = flat .and. abs(dot_product(normal, piece%vertex(:, corner(k))) - offset) <= tight
          sharp = sharp .and. abs(dot_product(normal, piece%corner(:, corner(k))) - offset - piece%rounding) <= tight
          u(:) = piece%vertex(:, corner(mod(k, n) + 1)) - piece%vertex(:, corner(k))
          v(:) = piece%vertex(:, corner(mod(k + 1, n) + 1)) - piece%vertex(:, corner(mod(k, n) + 1))
          w(1) = u(2)*v(3) - u(3)*v(2)
          w(2) = u(3)*v(1) - u(1)*v(3)
          w(3) = u(1)*v(2) - u(2)*v(1)
          convex = convex .and. dot_product(w, normal) > 0.0_dp
        end do
      end associate
      do k = 1, size(piece%vertex, 2)
        convex = convex .and. dot_product(piece%face_normal(:, f), piece%vertex(:, k)) <= offset + tight
      end do
    end do
    call check(flat, name//": faces are flat")
    call check(convex, name//": faces turn anticlockwise, the core is behind them")
    call check(sharp, name//": sharp corners lie in the faces before rounding")
    do k = 1, size(piece%vertex, 2)
      do n = piece%neighbour_first(k) + 1, piece%neighbour_first(k + 1) - 1
        convex = convex .and. piece%neighbour(n) > piece%neighbour(n - 1)
      end do
    end do
    call check(convex, name//": neighbours ascend")
  end subroutine check_piece

  !> Volume, moments and corners of a box, in its own axes.
  subroutine test_box()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    integer :: d

    call make_box("box", [1.0_dp, 2.0_dp, 3.0_dp], 0.05_dp, shape, error)
    call check(.not. allocated(error), "a box")
    call check_close(shape%size, 0.5_dp*sqrt(14.0_dp), tight, "box: size")
    call check_close(shape%inertia(1)*shape%size**2, 13/12.0_dp, tight, "box: first moment")
    call check_close(shape%inertia(2)*shape%size**2, 10/12.0_dp, tight, "box: second moment")
    call check_close(shape%inertia(3)*shape%size**2, 5/12.0_dp, tight, "box: third moment")
    do d = 1, 3
      call check_close(maxval(shape%piece(1)%vertex(d, :))*shape%size, 0.5_dp*d - 0.05_dp, tight, "box: core")
      call check_close(maxval(shape%piece(1)%corner(d, :))*shape%size, 0.5_dp*d, tight, "box: sharp corners")
    end do
    call check_close(shape%piece(1)%rounding*shape%size, 0.05_dp, tight, "box: rounding")
  end subroutine test_box

  subroutine test_capsule()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp), parameter :: r = 0.25_dp, l = 1.0_dp

    call make_capsule("rod", l, r, shape, error)
    call check_close(shape%volume*shape%size**3, pi*r**2*l + 4*pi/3*r**3, tight, "capsule: volume")
    call check_close(shape%size, 0.75_dp, tight, "capsule: size")
    ! the tensor by integrals along the axis: rod, and two half-balls
    call check_close(shape%inertia(3)*shape%size**2, (pi*r**4*l/2 + 8*pi/15*r**5)/(pi*r**2*l + 4*pi/3*r**3), tight, &
      & "capsule: moment about the axis")
    call check_close(shape%inertia(1)*shape%size**2, (pi*r**2*l*(l**2/12 + r**2/4) + 4*pi/3*r**3*(2*r**2/5 + l**2/4 + 3*l*r/8))/ &
      & (pi*r**2*l + 4*pi/3*r**3), tight, "capsule: moment across")
    call make_capsule("ball", 0.0_dp, 2.0_dp, shape, error)
    call check_equal(size(shape%piece(1)%vertex, 2), 1, "ball: one vertex")
    call check_close(shape%inertia(2), 0.4_dp, tight, "ball: moment")
    call check_close(shape%piece(1)%rounding, 1.0_dp, tight, "ball: rounding")
    call make_capsule("rod", 1.0_dp, 0.0_dp, shape, error)
    call check(allocated(error), "a capsule without radius is refused")
  end subroutine test_capsule

  !> Points in faces, on edges, inside and twice do not count.
  subroutine test_points_in_faces()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    type(draws_t) :: draws
    real(dp) :: points(3, 300)
    integer :: k

    do k = 1, 300
      points(1, k) = draws%between(-1.0_dp, 1.0_dp)
      points(2, k) = draws%between(-1.0_dp, 1.0_dp)
      points(3, k) = draws%between(-1.0_dp, 1.0_dp)
      if (k <= 200) points(mod(k, 3) + 1, k) = sign(1.0_dp, points(mod(k, 3) + 1, k))
      if (k <= 100) points(mod(k + 1, 3) + 1, k) = sign(1.0_dp, points(mod(k + 1, 3) + 1, k))
    end do
    points(:, 31:38) = cube()
    points(:, 231:238) = cube()
    call make_polyhedron("cube", points, 0.01_dp, shape, error)
    call check(.not. allocated(error), "points in faces")
    if (allocated(error)) return
    call check_equal(size(shape%piece(1)%vertex, 2), 8, "points in faces: corners")
    call check_equal(size(shape%piece(1)%face_first) - 1, 6, "points in faces: faces")
    call check_close(shape%volume*shape%size**3, 8.0_dp, 1.0e-12_dp, "points in faces: volume")
  end subroutine test_points_in_faces

  !> Turned and shifted, a body is the same: rounding of turned points does not split faces.
  subroutine test_turned()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    type(draws_t) :: draws
    type(turn_t) :: turn
    real(dp) :: points(3, 20), turned(3, 20)
    integer :: trial, k
    logical :: right

    points(:, :) = dodecahedron()
    points(3, :) = 0.5_dp*points(3, :)
    right = .true.
    do trial = 1, 50
      turn = random_turn(draws)
      do k = 1, 20
        turned(:, k) = points(1, k)*turn%m(:, 1) + points(2, k)*turn%m(:, 2) + points(3, k)*turn%m(:, 3) + 10.0_dp
      end do
      call make_polyhedron("flat dodecahedron", turned, 0.01_dp, shape, error)
      right = right .and. .not. allocated(error)
      if (.not. right) exit
      right = right .and. size(shape%piece(1)%vertex, 2) == 20 .and. size(shape%piece(1)%face_first) == 13
      right = right .and. abs(shape%volume*shape%size**3 - 0.5_dp*(15 + 7*sqrt(5.0_dp))/4*(2/golden)**3) < 1.0e-12_dp
    end do
    call check(right, "turned and shifted bodies")
  end subroutine test_turned

  !> Corners of four faces stay whole where the core keeps them so, and split where it does not.
  subroutine test_core()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp) :: points(3, 6)

    points(:, :) = octahedron()
    call make_polyhedron("octahedron", points, 0.1_dp, shape, error)
    call check_close(maxval(shape%piece(1)%vertex(1, :))*shape%size, 1.0_dp - 0.1_dp*sqrt(3.0_dp), tight, "octahedron: core")
    points(:, 5) = points(:, 5) + 0.3_dp*points(:, 1) + 0.1_dp*points(:, 3)
    call make_polyhedron("oblique octahedron", points, 0.1_dp, shape, error)
    call check(.not. allocated(error), "oblique octahedron")
    call check(size(shape%piece(1)%vertex, 2) > 6, "a corner of four faces becomes two vertices")
    call check_piece("oblique octahedron", shape%piece(1))
  end subroutine test_core

  !> A message begins so.
  subroutine check_refused(error, message)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: message

    call check(allocated(error), "refused: "//message)
    if (.not. allocated(error)) return
    call check_equal(error%message(1:min(len(message), len(error%message))), message, "message")
    deallocate (error)
  end subroutine check_refused

  subroutine test_refusals()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp) :: points(3, 8)
    integer :: k

    points(:, :) = cube()
    call make_polyhedron("x", points(:, 1:3), 0.01_dp, shape, error)
    call check_refused(error, "x: at least 4 different points are needed")
    do k = 1, 8
      points(1, k) = k
      points(2, k) = 2*k
      points(3, k) = 3*k
    end do
    call make_polyhedron("x", points, 0.01_dp, shape, error)
    call check_refused(error, "x: all points lie ")
    points(:, :) = cube()
    points(3, :) = 0.5_dp
    call make_polyhedron("x", points, 0.01_dp, shape, error)
    call check_refused(error, "x: all points lie in a plane")
    points(:, :) = cube()
    call make_polyhedron("x", points, 1.0_dp, shape, error)
    call check_refused(error, "x: the rounding of 1.00000000E+00 is too large: a face is only 1.00000000E+00 from the centre")
    call make_polyhedron("x", points, 0.0_dp, shape, error)
    call check_refused(error, "x: a rounding above 0 is needed")
    call make_box("x", [1.0_dp, -1.0_dp, 1.0_dp], 0.1_dp, shape, error)
    call check_refused(error, "x: a side of -1.00000000E+00, but one above 0 was expected")
  end subroutine test_refusals

  !> Surfaces that are given: squares and triangles, and what is wrong with them.
  subroutine test_faces()
    integer, parameter :: squares(24) = [1, 3, 4, 2, 5, 6, 8, 7, 1, 2, 6, 5, 3, 7, 8, 4, 1, 5, 7, 3, 2, 4, 8, 6]
    integer, parameter :: four(7) = [1, 5, 9, 13, 17, 21, 25]
    integer, parameter :: dent_first(10) = [1, 5, 9, 13, 17, 21, 24, 27, 30, 33]
    integer, parameter :: dent_corner(32) = [squares(1:20), 2, 4, 9, 4, 8, 9, 8, 6, 9, 6, 2, 9]
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp) :: points(3, 8), apart(3, 24), dent(3, 9)
    integer :: corner(24), k

    points(:, :) = cube()
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, squares), 0.01_dp, shape, error)
    call check(.not. allocated(error), "a cube of squares")
    call check_close(shape%volume*shape%size**3, 8.0_dp, tight, "a cube of squares: volume")
    ! each face with points of its own, off by what single precision leaves
    do k = 1, 24
      apart(:, k) = points(:, squares(k)) + 3.0e-8_dp*mod(k, 3)
      corner(k) = k
    end do
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(apart, four, corner), 0.01_dp, shape, error)
    call check(.not. allocated(error), "points merged by place")
    if (allocated(error)) print "(a)", error%message
    call check_equal(size(shape%piece(1)%vertex, 2), 8, "points merged by place: corners")
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four(1:6), squares(1:20)), 0.01_dp, shape, error)
    call check_refused(error, "x: the surface is not closed: beyond one side of face ")
    corner(:) = squares
    corner(5:8) = [7, 8, 6, 5]
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, corner), 0.01_dp, shape, error)
    call check_refused(error, "x: the surface is not closed: beyond one side of face 2 there is no face, or one with its")
    do k = 1, 24
      corner(k) = squares(25 - k)
    end do
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, corner), 0.01_dp, shape, error)
    call check_refused(error, "x: the surface is inside out")
    corner(:) = squares
    corner(4) = 4
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, corner), 0.01_dp, shape, error)
    call check_refused(error, "x: face 1 has two corners at one place")
    corner(4) = 9
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, corner), 0.01_dp, shape, error)
    call check_refused(error, "x: a face names a corner that there is not")
    points(3, :) = 0.0_dp
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(points, four, squares), 0.01_dp, shape, error)
    call check_refused(error, "x: ")
    ! a pyramid dented into the face of x = 1
    dent(:, 1:8) = cube()
    dent(:, 9) = 0.0_dp
    call make_polyhedron_of_faces("x", sharp_polyhedron_t(dent, dent_first, dent_corner), 0.01_dp, shape, error)
    call check_refused(error, "x: the body is not convex: a point lies in front of face ")
  end subroutine test_faces

  !> Principal axes: kept where they are principal already, else those of least turn; right-handed, with the moments.
  subroutine test_axes()
    type(draws_t) :: draws
    type(turn_t) :: turn
    real(dp) :: tensor(3, 3), moment(3), axes(3, 3), left(3)
    real(dp), parameter :: given(3) = [3.0_dp, 1.0_dp, 2.0_dp]
    integer :: trial, i, j, k

    tensor(:, :) = 0.0_dp
    do k = 1, 3
      tensor(k, k) = given(k)
    end do
    tensor(1, 2) = 1.0e-15_dp
    tensor(2, 1) = 1.0e-15_dp
    call find_principal_axes(tensor, moment, axes)
    call check(all(abs(moment - given) <= 0.0_dp), "principal axes stay in order")
    call check(axes(1, 1) >= 1.0_dp .and. axes(2, 2) >= 1.0_dp .and. axes(3, 3) >= 1.0_dp, "principal axes stay, to the last bit")
    do trial = 1, 100
      turn = random_turn(draws)
      do j = 1, 3
        do i = 1, 3
          tensor(i, j) = sum(turn%m(i, :)*given*turn%m(j, :))
        end do
      end do
      call find_principal_axes(tensor, moment, axes)
      call check(axes(1, 1) + axes(2, 2) + axes(3, 3) >= 1.0_dp, "axes of a small turn")
      do k = 1, 3
        left(:) = matmul(tensor, axes(:, k))
        call check_close(norm2(left - moment(k)*axes(:, k)), 0.0_dp, 1.0e-14_dp, "an axis is one")
      end do
      call check_close(axes(1, 1)*(axes(2, 2)*axes(3, 3) - axes(3, 2)*axes(2, 3)) - axes(2, 1)*(axes(1, 2)*axes(3, 3) - &
        & axes(3, 2)*axes(1, 3)) + axes(3, 1)*(axes(1, 2)*axes(2, 3) - axes(2, 2)*axes(1, 3)), 1.0_dp, 1.0e-14_dp, "right-handed")
    end do
    turn = about(vec(1.0_dp, 2.0_dp, 3.0_dp), 0.2_dp)
    do j = 1, 3
      do i = 1, 3
        tensor(i, j) = sum(turn%m(i, :)*given*turn%m(j, :))
      end do
    end do
    call find_principal_axes(tensor, moment, axes)
    call check_close(norm2(axes - turn%m), 0.0_dp, 1.0e-14_dp, "axes of least turn")
  end subroutine test_axes

  !> Two halves of a box, exactly; overlapping balls, to the error of the grid.
  subroutine test_unions()
    type(body_shape_t) :: whole, shape
    type(convex_piece_t) :: pieces(2)
    type(mass_t) :: masses(2)
    type(error_t), allocatable :: error
    real(dp) :: points(3, 8)
    integer :: k

    call make_box("box", [4.0_dp, 2.0_dp, 1.0_dp], 0.01_dp, whole, error)
    do k = 1, 2
      points(:, :) = cube()
      points(1, :) = points(1, :) + 2*k
      points(3, :) = 0.5_dp*points(3, :)
      call make_piece("half", points, 0.01_dp, pieces(k), masses(k), error)
    end do
    call make_union("box", pieces, masses, shape, error)
    call check(.not. allocated(error), "a union")
    call check_close(shape%volume, whole%volume, tight, "two halves: volume")
    do k = 1, 3
      call check_close(shape%inertia(k), whole%inertia(k), tight, "two halves: inertia")
    end do
    call check_close(minval(shape%piece(1)%corner(1, :))*shape%size, -2.0_dp, tight, "two halves: place")
  end subroutine test_unions

end program test_polyhedron
