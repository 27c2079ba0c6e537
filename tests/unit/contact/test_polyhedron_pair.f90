!> Contacts of rounded convex pieces: cubes in all positions, capsules and spheres, hulls of random corners, half-spaces.
program test_polyhedron_pair
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_convex_piece, only: convex_piece_t
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance
  use gravier_known_corners, only: random_polyhedron
  use gravier_manifold, only: manifold_t, most_points, feature_base
  use gravier_simple_shapes, only: make_polyhedron, make_box, make_capsule
  use gravier_polyhedron_pair, only: find_polyhedron_manifold, find_halfspace_manifold
  use gravier_polyhedra, only: draws_t, random_turn, vector_t, turn_t, vec, about, back, on, between, inverse
  use gravier_shape_library, only: body_shape_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp), rounding = 0.01_dp, alert = 0.02_dp
  !> of exact places
  real(dp), parameter :: tight = 1.0e-13_dp
  type(body_shape_t) :: box, rod, ball, prism
  type(turn_t), parameter :: straight = turn_t(reshape( &
    & [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3]))
  type(vector_t), parameter :: axis_x = vector_t([1.0_dp, 0.0_dp, 0.0_dp]), axis_y = vector_t([0.0_dp, 1.0_dp, 0.0_dp]), &
    & axis_z = vector_t([0.0_dp, 0.0_dp, 1.0_dp])

  call MPI_Init()
  call make_shapes()
  call test_faces()
  call test_turned_faces()
  call test_overhang()
  call test_crossed_edges()
  call test_parallel_edges()
  call test_vertex_on_face()
  call test_edge_on_face()
  call test_corners()
  call test_balls_and_rods()
  call test_overlap()
  call test_halfspace()
  call test_corner_of_many_faces()
  call test_all_points()
  call test_keys_of_flush_faces()
  call test_swap()
  call test_hulls(12)
  call test_hulls(40)
  call finish_checks()
  call MPI_Finalize()

contains

  !> A cube of edge 2, a capsule along the third axis from -1 to 1, a ball, a prism of twelve sides.
  subroutine make_shapes()
    type(error_t), allocatable :: error
    real(dp) :: points(3, 24)
    integer :: k

    call make_box("box", [2.0_dp, 2.0_dp, 2.0_dp], rounding, box, error)
    call make_capsule("rod", 2.0_dp, 0.25_dp, rod, error)
    call make_capsule("ball", 0.0_dp, 0.5_dp, ball, error)
    do k = 1, 12
      points(1, k:k + 12:12) = cos(k*pi/6)
      points(2, k:k + 12:12) = sin(k*pi/6)
      points(3, k) = -0.5_dp
      points(3, k + 12) = 0.5_dp
    end do
    call make_polyhedron("prism", points, rounding, prism, error)
    call check(.not. allocated(error), "shapes")
  end subroutine make_shapes

  !> The contacts of two shapes of their own sizes.
  subroutine meet(a, b, turn, way, manifold, most)
    type(body_shape_t), intent(in) :: a, b
    type(turn_t), intent(in) :: turn
    type(vector_t), intent(in) :: way
    type(manifold_t), intent(out) :: manifold
    integer, intent(in), optional :: most
    type(placed_pair_t) :: pair
    integer :: n

    n = 4
    if (present(most)) n = most
    pair%radius_a = a%size
    pair%radius_b = b%size
    pair%rotation(:, :) = turn%m
    pair%way(:) = way%x
    call find_polyhedron_manifold(a%piece(1), b%piece(1), pair, alert, n, manifold)
    call check(all(manifold%key(2:manifold%n) > manifold%key(1:manifold%n - 1)), "ascending keys")
  end subroutine meet

  !> The contacts of a shape and a plane.
  subroutine lie(a, normal, distance, manifold, most)
    type(body_shape_t), intent(in) :: a
    type(vector_t), intent(in) :: normal
    real(dp), intent(in) :: distance
    type(manifold_t), intent(out) :: manifold
    integer, intent(in), optional :: most
    integer :: n

    n = 4
    if (present(most)) n = most
    call find_halfspace_manifold(a%piece(1), a%size, normal%x, distance, alert, n, manifold)
  end subroutine lie

  !> A shift as bodies at rest make in a step.
  real(dp) function creep(draws)
    type(draws_t), intent(inout) :: draws
    creep = draws%between(-1.0e-7_dp, 1.0e-7_dp)
  end function creep

  type(turn_t) function shaken_turn(draws)
    type(draws_t), intent(inout) :: draws
    type(vector_t) :: axis
    axis = draws%direction()
    shaken_turn = about(axis, creep(draws))
  end function shaken_turn

  !> Whether one of the points is at a place, to a tolerance.
  logical function has_point(manifold, place, room)
    type(manifold_t), intent(in) :: manifold
    type(vector_t), intent(in) :: place
    real(dp), intent(in) :: room
    integer :: k

    has_point = .false.
    do k = 1, manifold%n
      has_point = has_point .or. norm2(manifold%point(:, k) - place%x) <= room
    end do
  end function has_point

  subroutine check_normal(manifold, normal, name)
    type(manifold_t), intent(in) :: manifold
    type(vector_t), intent(in) :: normal
    character(len=*), intent(in) :: name
    ! of a gap and two roundings of 1e-2 the direction is known to about 1e-16/1e-2
    call check_close(norm2(manifold%normal - normal%x), 0.0_dp, 1.0e-12_dp, name//": normal")
  end subroutine check_normal

  subroutine check_gaps(manifold, gap, name)
    type(manifold_t), intent(in) :: manifold
    real(dp), intent(in) :: gap
    character(len=*), intent(in) :: name
    integer :: k
    do k = 1, manifold%n
      call check_close(manifold%gap(k), gap, tight, name//": gap")
    end do
  end subroutine check_gaps

  !> One cube on the other: the four sharp corners, half-way between the faces.
  subroutine test_faces()
    type(manifold_t) :: manifold
    integer :: i, j

    call meet(box, box, straight, vec(0.0_dp, 0.0_dp, -2.004_dp), manifold)
    call check_equal(manifold%n, 4, "face on face: points")
    call check_normal(manifold, vec(0.0_dp, 0.0_dp, 1.0_dp), "face on face")
    call check_gaps(manifold, 0.004_dp, "face on face")
    do i = -1, 1, 2
      do j = -1, 1, 2
        call check(has_point(manifold, vec(real(i, dp), real(j, dp), -1.002_dp), tight), "face on face: a corner")
      end do
    end do
    call meet(box, box, straight, vec(0.0_dp, 0.0_dp, -1.996_dp), manifold)
    call check_gaps(manifold, -0.004_dp, "faces that overlap by less than the roundings")
    call check(.not. manifold%cores_overlap, "cores apart")
    call meet(box, box, straight, vec(0.0_dp, 0.0_dp, -2.021_dp), manifold)
    call check_equal(manifold%n, 0, "beyond the alert distance")
  end subroutine test_faces

  !> By 45 degrees turned: an octagon, of which four are kept, or all.
  subroutine test_turned_faces()
    type(manifold_t) :: manifold
    type(turn_t) :: turn
    real(dp) :: reach
    integer :: k

    turn = about(axis_z, pi/4)
    call meet(box, box, turn, vec(0.0_dp, 0.0_dp, -2.0_dp), manifold, most_points)
    call check_equal(manifold%n, 8, "turned by 45 degrees: points")
    reach = sqrt(2.0_dp) - 1.0_dp
    do k = 1, 8
      call check_close(maxval(abs(manifold%point(1:2, k))), 1.0_dp, tight, "octagon: on the side of a")
      call check_close(minval(abs(manifold%point(1:2, k))), reach, tight, "octagon: on the side of b")
    end do
    call meet(box, box, turn, vec(0.0_dp, 0.0_dp, -2.0_dp), manifold)
    call check_equal(manifold%n, 4, "turned by 45 degrees: 4 points")
    call check(maxval(manifold%point(1, 1:4)) > reach .and. minval(manifold%point(1, 1:4)) < -reach .and. &
      & maxval(manifold%point(2, 1:4)) > reach .and. minval(manifold%point(2, 1:4)) < -reach, "4 points reach to all sides")
  end subroutine test_turned_faces

  !> Half off the edge: corners of both.
  subroutine test_overhang()
    type(manifold_t) :: manifold

    call meet(box, box, straight, vec(1.2_dp, -0.4_dp, -2.0_dp), manifold)
    call check_equal(manifold%n, 4, "overhang: points")
    call check(has_point(manifold, vec(1.0_dp, -1.0_dp, -1.0_dp), tight), "overhang: corner of a")
    call check(has_point(manifold, vec(0.2_dp, 0.6_dp, -1.0_dp), tight), "overhang: corner of b")
    call check(has_point(manifold, vec(1.0_dp, 0.6_dp, -1.0_dp), tight), "overhang: a crossing")
    call check(has_point(manifold, vec(0.2_dp, -1.0_dp, -1.0_dp), tight), "overhang: the other crossing")
  end subroutine test_overhang

  !> Cubes on their edges, the edges crossing at a right angle: one point, where they cross.
  subroutine test_crossed_edges()
    type(manifold_t) :: manifold
    type(turn_t) :: turn_a, turn_b
    type(vector_t) :: way
    real(dp) :: height

    turn_a = about(axis_x, pi/4)
    turn_b = about(axis_y, pi/4)
    height = 2*(sqrt(2.0_dp)*(1.0_dp - rounding) + rounding) + 0.003_dp
    way = vec(0.2_dp, 0.3_dp, -height)
    call meet(box, box, between(turn_a, turn_b), back(turn_a, way), manifold)
    call check_equal(manifold%n, 1, "crossed edges: points")
    call check_gaps(manifold, 0.003_dp, "crossed edges")
    call check_normal(manifold, back(turn_a, vec(0.0_dp, 0.0_dp, 1.0_dp)), "crossed edges")
    ! the edge of a runs along x at y = 0, that of b along y at x = 0.2
    call check(has_point(manifold, back(turn_a, vec(0.2_dp, 0.0_dp, -height/2)), tight), "crossed edges: point")
  end subroutine test_crossed_edges

  !> Edge on edge: both sharp ends of the common stretch.
  subroutine test_parallel_edges()
    type(manifold_t) :: manifold
    type(turn_t) :: turn, turned
    real(dp) :: height
    integer :: k

    turn = about(axis_x, pi/4)
    height = 2*(sqrt(2.0_dp)*(1.0_dp - rounding) + rounding) - 0.001_dp
    call meet(box, box, straight, back(turn, vec(0.5_dp, 0.0_dp, -height)), manifold)
    call check_equal(manifold%n, 2, "parallel edges: points")
    call check_gaps(manifold, -0.001_dp, "parallel edges")
    do k = 1, 2
      call check(has_point(manifold, back(turn, vec(1.5_dp*k - 2.0_dp, 0.0_dp, -height/2)), tight), &
        & "parallel edges: an end")
    end do
    ! crossing at 0.01: the ends, by s half the length, are apart by hypot(w, 2 sin(0.005) s)
    turned = about(axis_z, 0.01_dp)
    turned = between(inverse(turned), turn)
    call meet(box, box, between(turn, turned), &
      & back(turn, vec(0.0_dp, 0.0_dp, -height)), manifold)
    call check_equal(manifold%n, 3, "nearly parallel edges: both ends and the crossing")
    call check_close(minval(manifold%gap(1:3)), -0.001_dp, tight, "nearly parallel edges: the crossing")
    call check_close(maxval(manifold%gap(1:3)), hypot(2*rounding - 0.001_dp, 0.01_dp) - 2*rounding, 2.0e-4_dp, &
      & "nearly parallel edges: the ends")
  end subroutine test_parallel_edges

  !> A cube on its corner.
  subroutine test_vertex_on_face()
    type(manifold_t) :: manifold
    type(turn_t) :: turn
    type(vector_t) :: way
    real(dp) :: height

    turn = on_corner()
    height = sqrt(3.0_dp)*(1.0_dp - rounding) + rounding + 1.0_dp + 0.002_dp
    way = vec(0.3_dp, -0.2_dp, -height)
    call meet(box, box, inverse(turn), back(turn, way), manifold)
    call check_equal(manifold%n, 1, "vertex on face: points")
    call check_gaps(manifold, 0.002_dp, "vertex on face")
    call check_normal(manifold, back(turn, vec(0.0_dp, 0.0_dp, 1.0_dp)), "vertex on face")
    call check(has_point(manifold, back(turn, vec(0.0_dp, 0.0_dp, 1.0_dp - height + 0.001_dp)), tight), &
      & "vertex on face: point")
  end subroutine test_vertex_on_face

  !> A turn that puts a cube on a corner.
  type(turn_t) function on_corner() result(turn)

    ! from (1, 1, 1)/sqrt(3) to the third axis
    turn = about(vec(1.0_dp, -1.0_dp, 0.0_dp), acos(1.0_dp/sqrt(3.0_dp)))
  end function on_corner

  !> A cube on an edge upon a face: both sharp ends of the edge.
  subroutine test_edge_on_face()
    type(manifold_t) :: manifold
    type(turn_t) :: turn
    real(dp) :: height
    integer :: k

    turn = about(axis_x, pi/4)
    height = sqrt(2.0_dp)*(1.0_dp - rounding) + rounding + 1.0_dp
    call meet(box, box, inverse(turn), back(turn, vec(0.0_dp, 0.2_dp, -height)), manifold)
    call check_equal(manifold%n, 2, "edge on face: points")
    call check_gaps(manifold, 0.0_dp, "edge on face")
    do k = -1, 1, 2
      call check(has_point(manifold, back(turn, vec(real(k, dp), 0.0_dp, 1.0_dp - height)), tight), &
        & "edge on face: an end")
    end do
    ! the same the other way round: the edge is that of b
    call meet(box, box, turn, vec(0.0_dp, -0.2_dp, height), manifold)
    call check_equal(manifold%n, 2, "face on edge: points")
    do k = -1, 1, 2
      call check(has_point(manifold, vec(real(k, dp), -0.2_dp, 1.0_dp), tight), "face on edge: an end")
    end do
    ! tilted along the edge by more than the angle of blending: one core end, and the other beyond the alert distance
    turn = between(about(axis_y, -0.1_dp), turn)
    height = 1.0_dp + rounding + (1.0_dp - rounding)*(sqrt(2.0_dp)*cos(0.1_dp) + sin(0.1_dp))
    call meet(box, box, inverse(turn), back(turn, vec(0.0_dp, 0.0_dp, -height)), manifold)
    call check_equal(manifold%n, 1, "tilted edge on face: points")
    call check_gaps(manifold, 0.0_dp, "tilted edge on face")
  end subroutine test_edge_on_face

  !> Vertex to vertex, and an edge beside a vertex: the normal is the way between them.
  subroutine test_corners()
    type(manifold_t) :: manifold
    real(dp), parameter :: near = 2.0_dp - 2*rounding, reach = 2*rounding + 0.001_dp

    call meet(box, box, straight, vec(near + reach/3, near + 2*reach/3, near + 2*reach/3), manifold)
    call check_equal(manifold%n, 1, "vertex to vertex: points")
    call check_gaps(manifold, 0.001_dp, "vertex to vertex")
    call check_normal(manifold, vec(-1.0_dp/3, -2.0_dp/3, -2.0_dp/3), "vertex to vertex")
    call meet(box, box, straight, vec(0.0_dp, near + 0.6_dp*reach, near + 0.8_dp*reach), manifold)
    call check_equal(manifold%n, 2, "edges beside each other: points")
    call check_gaps(manifold, 0.001_dp, "edges beside each other")
    call check_normal(manifold, vec(0.0_dp, -0.6_dp, -0.8_dp), "edges beside each other")
  end subroutine test_corners

  !> Pieces of one vertex and of two go through the same procedure.
  subroutine test_balls_and_rods()
    type(manifold_t) :: manifold
    call meet(ball, ball, straight, vec(0.594_dp, 0.792_dp, 0.0_dp), manifold)
    call check_equal(manifold%n, 1, "two balls: points")
    call check_gaps(manifold, -0.01_dp, "two balls")
    call check_normal(manifold, vec(-0.6_dp, -0.8_dp, 0.0_dp), "two balls")
    call check(has_point(manifold, vec(0.297_dp, 0.396_dp, 0.0_dp), tight), "two balls: point")
    call meet(rod, rod, straight, vec(0.5_dp, 0.0_dp, 0.5_dp), manifold)
    call check_equal(manifold%n, 2, "parallel rods: points")
    call check(has_point(manifold, vec(0.25_dp, 0.0_dp, 1.0_dp), tight), "parallel rods: the end of a")
    call check(has_point(manifold, vec(0.25_dp, 0.0_dp, -0.5_dp), tight), "parallel rods: the end of b")
    call meet(rod, rod, about(axis_x, pi/2), vec(0.51_dp, 0.1_dp, 0.2_dp), manifold)
    call check_equal(manifold%n, 1, "crossed rods: points")
    call check_gaps(manifold, 0.01_dp, "crossed rods")
    call check(has_point(manifold, vec(0.255_dp, 0.0_dp, 0.2_dp), tight), "crossed rods: point")
    call meet(rod, ball, straight, vec(0.0_dp, 0.0_dp, 1.75_dp), manifold)
    call check_equal(manifold%n, 1, "a ball at the end of a rod: points")
    call check_gaps(manifold, 0.0_dp, "a ball at the end of a rod")
    call meet(box, rod, about(axis_y, pi/2), vec(0.9_dp, 0.0_dp, 1.25_dp), manifold)
    call check_equal(manifold%n, 2, "a rod on a face: points")
    call check(has_point(manifold, vec(1.0_dp, 0.0_dp, 1.0_dp), tight), "a rod on a face: at the edge")
    call check(has_point(manifold, vec(-0.1_dp, 0.0_dp, 1.0_dp), tight), "a rod on a face: its end")
    call meet(ball, box, straight, vec(0.0_dp, 0.3_dp, -1.49_dp), manifold)
    call check_gaps(manifold, -0.01_dp, "a ball on a face")
    call check_normal(manifold, vec(0.0_dp, 0.0_dp, 1.0_dp), "a ball on a face")
  end subroutine test_balls_and_rods

  !> Cores that overlap: the direction of least separation.
  subroutine test_overlap()
    type(manifold_t) :: manifold
    type(turn_t) :: turn_a, turn_b
    real(dp) :: height

    call meet(box, box, straight, vec(0.1_dp, 0.2_dp, -1.9_dp), manifold)
    call check(manifold%cores_overlap, "cores overlap")
    call check_equal(manifold%n, 4, "cores overlap: points")
    call check_normal(manifold, vec(0.0_dp, 0.0_dp, 1.0_dp), "cores overlap")
    call check_gaps(manifold, -0.1_dp, "cores overlap")
    turn_a = about(axis_x, pi/4)
    turn_b = about(axis_y, pi/4)
    height = 2*(sqrt(2.0_dp)*(1.0_dp - rounding) + rounding) - 0.1_dp
    call meet(box, box, between(turn_a, turn_b), back(turn_a, vec(0.2_dp, 0.3_dp, -height)), manifold)
    call check(manifold%cores_overlap, "edges overlap")
    call check_gaps(manifold, -0.1_dp, "edges overlap")
    call check_normal(manifold, back(turn_a, vec(0.0_dp, 0.0_dp, 1.0_dp)), "edges overlap")
    call meet(box, ball, straight, vec(0.1_dp, 0.7_dp, 0.2_dp), manifold)
    call check_gaps(manifold, -0.8_dp, "a ball in a box")
    call check_normal(manifold, vec(0.0_dp, -1.0_dp, 0.0_dp), "a ball in a box")
    call meet(ball, ball, straight, vec(0.0_dp, 0.0_dp, 0.0_dp), manifold)
    call check_gaps(manifold, -1.0_dp, "balls at one place")
    call check_close(norm2(manifold%normal), 1.0_dp, tight, "balls at one place: a normal")
    call meet(rod, rod, straight, vec(0.0_dp, 0.0_dp, 0.3_dp), manifold)
    call check_gaps(manifold, -0.5_dp, "rods within each other")
    call meet(rod, rod, about(axis_x, pi/2), vec(0.0_dp, 0.1_dp, 0.2_dp), manifold)
    call check_gaps(manifold, -0.5_dp, "rods across each other")
    call check_close(abs(manifold%normal(1)), 1.0_dp, tight, "rods across each other: normal")
    call meet(box, rod, straight, vec(0.8_dp, 0.0_dp, 0.0_dp), manifold)
    call check_gaps(manifold, -0.45_dp, "a rod in a box")
    call check_normal(manifold, vec(-1.0_dp, 0.0_dp, 0.0_dp), "a rod in a box")
  end subroutine test_overlap

  !> A face, an edge, a vertex, a ball and a rod on a plane.
  subroutine test_halfspace()
    type(manifold_t) :: manifold
    type(turn_t) :: turn
    integer :: k

    call lie(box, vec(0.0_dp, 0.0_dp, 1.0_dp), 0.995_dp, manifold)
    call check_equal(manifold%n, 4, "face on plane: points")
    call check_gaps(manifold, -0.005_dp, "face on plane")
    call check(has_point(manifold, vec(1.0_dp, -1.0_dp, -0.9975_dp), tight), "face on plane: a corner")
    call check(all(modulo(manifold%key(1:4), feature_base) == 0), "face on plane: keys")
    call lie(box, vec(sin(0.01_dp), 0.0_dp, cos(0.01_dp)), 1.0_dp, manifold)
    call check_equal(manifold%n, 4, "tilted face on plane: points")
    do k = 1, 4
      call check_close(dot_product(manifold%normal, manifold%point(:, k)), -1.0_dp + 0.5_dp*manifold%gap(k), tight, &
        & "tilted face on plane: half-way")
      ! half the tilt of blending: half of the way from the core to the sharp corner, along the tilted sides
      call check_close(abs(manifold%point(1, k)), 1.0_dp - 0.5_dp*rounding, 1.0e-3_dp, "tilted face on plane: half blended")
      call check_close(abs(manifold%point(2, k)), 1.0_dp, tight, "tilted face on plane: sharp")
    end do
    turn = about(axis_x, pi/4)
    call lie(box, back(turn, vec(0.0_dp, 0.0_dp, 1.0_dp)), &
      & sqrt(2.0_dp)*(1.0_dp - rounding) + rounding, manifold)
    call check_equal(manifold%n, 2, "edge on plane: points")
    call check_gaps(manifold, 0.0_dp, "edge on plane")
    call check_close(maxval(manifold%point(1, 1:2)), 1.0_dp, tight, "edge on plane: sharp end")
    turn = on_corner()
    call lie(box, back(turn, vec(0.0_dp, 0.0_dp, 1.0_dp)), &
      & sqrt(3.0_dp)*(1.0_dp - rounding) + rounding, manifold)
    call check_equal(manifold%n, 1, "vertex on plane: points")
    call check_gaps(manifold, 0.0_dp, "vertex on plane")
    call lie(ball, vec(0.0_dp, 0.6_dp, 0.8_dp), 0.51_dp, manifold)
    call check_equal(manifold%n, 1, "ball on plane: points")
    call check_gaps(manifold, 0.01_dp, "ball on plane")
    call lie(rod, vec(1.0_dp, 0.0_dp, 0.0_dp), 0.25_dp, manifold)
    call check_equal(manifold%n, 2, "rod on plane: points")
    call check_gaps(manifold, 0.0_dp, "rod on plane")
    do k = 1, 2
      call check_close(abs(manifold%point(3, k)), 1.0_dp, tight, "rod on plane: ends")
    end do
    ! sunk in on a side of twelve: the corners of the sides beside it count too
    call lie(prism, vec(cos(pi/12), sin(pi/12), 0.0_dp), cos(pi/12) - 0.25_dp, manifold, most_points)
    call check_equal(manifold%n, 8, "prism on its side: points of three sides")
    call lie(box, vec(0.0_dp, 0.0_dp, 1.0_dp), 1.02_dp, manifold)
    call check_equal(manifold%n, 0, "beyond the alert distance of a plane")
  end subroutine test_halfspace

  !> A corner where seven unlike faces meet has several vertices. On a plane, and on a face of another body, it is one point with
  !> one key, whichever of its vertices is the lowest.
  subroutine test_corner_of_many_faces()
    type(body_shape_t) :: spike
    type(manifold_t) :: manifold
    type(error_t), allocatable :: error
    type(vector_t) :: apex, up
    type(turn_t) :: turn
    real(dp) :: points(3, 8), height
    integer :: k, key_on_plane, key_on_box

    points(:, 8) = [0.0_dp, 0.0_dp, -1.0_dp]
    do k = 1, 7
      points(1, k) = 0.8_dp*cos(2*pi*k/7 + 0.1_dp*sin(3.0_dp*k))
      points(2, k) = 0.6_dp*sin(2*pi*k/7 + 0.1_dp*sin(3.0_dp*k))
      points(3, k) = 0.5_dp + 0.1_dp*cos(5.0_dp*k)
    end do
    call make_polyhedron("spike", points, 0.02_dp, spike, error)
    call check(.not. allocated(error), "spike")
    associate (piece => spike%piece(1))
      k = size(piece%vertex, 2)
      apex = vector_t(spike%size*piece%corner(:, minloc(piece%corner(3, :), dim=1)))
      call check(count(abs(spike%size*piece%corner(3, :) - apex%x(3)) < tight) > 2, "spike: several vertices in its apex")
    end associate
    do k = 0, 24
      turn = about(vec(cos(0.26_dp*k), sin(0.26_dp*k), 0.0_dp), 0.18_dp*mod(k, 5))
      up = back(turn, vec(0.0_dp, 0.0_dp, 1.0_dp))
      height = -dot_product(apex%x, up%x)
      call lie(spike, up, height - 0.15_dp, manifold)
      call check_equal(manifold%n, 1, "spike on a plane: points")
      if (k == 0) key_on_plane = manifold%key(1)
      call check_equal(manifold%key(1), key_on_plane, "spike on a plane: key")
      call meet(spike, box, inverse(turn), vector_t(-(height + 0.85_dp)*up%x), manifold)
      call check_equal(manifold%n, 1, "spike on a box: points")
      if (k == 0) key_on_box = manifold%key(1)
      call check_equal(manifold%key(1), key_on_box, "spike on a box: key")
    end do
  end subroutine test_corner_of_many_faces

  !> All points of faces of twelve corners, and some of them.
  subroutine test_all_points()
    type(manifold_t) :: manifold
    real(dp) :: area
    integer :: i, j, k

    call lie(prism, vec(0.0_dp, 0.0_dp, 1.0_dp), 0.5_dp, manifold, most_points)
    call check_equal(manifold%n, 12, "prism on plane: all points")
    call meet(prism, box, straight, vec(0.0_dp, 0.0_dp, -1.5_dp), manifold, most_points)
    call check_equal(manifold%n, 12, "prism on box: all points")
    call meet(prism, box, straight, vec(0.0_dp, 0.0_dp, -1.5_dp), manifold)
    call check_equal(manifold%n, 4, "prism on box: 4 points")
    area = 0.0_dp
    do i = 1, 4
      do j = 1, 4
        do k = 1, 4
          area = max(area, (manifold%point(1, j) - manifold%point(1, i))*(manifold%point(2, k) - manifold%point(2, i)) - &
            & (manifold%point(2, j) - manifold%point(2, i))*(manifold%point(1, k) - manifold%point(1, i)))
        end do
      end do
    end do
    call check_close(area, 2.0_dp, 1.0e-9_dp, "prism on box: the 4 points are a square")
    call meet(prism, prism, about(axis_z, 0.2_dp), vec(0.0_dp, 0.0_dp, -1.0_dp), manifold, most_points)
    call check_equal(manifold%n, 24, "prism on prism: all points")
    call meet(prism, prism, about(axis_z, 0.2_dp), vec(0.0_dp, 0.0_dp, -1.0_dp), manifold, 16)
    call check_equal(manifold%n, 16, "prism on prism: as many points as asked for")
  end subroutine test_all_points

  !> Faces that are flush but for rounding keep their keys, whichever of two corners at one place is inside.
  subroutine test_keys_of_flush_faces()
    type(manifold_t) :: manifold, first
    type(draws_t) :: draws
    integer :: k
    logical :: same

    call meet(box, box, straight, vec(0.0_dp, 0.0_dp, -2.0_dp), first)
    same = .true.
    do k = 1, 500
      call meet(box, box, shaken_turn(draws), vec(creep(draws), creep(draws), creep(draws) - 2.0_dp), manifold, 8)
      same = same .and. manifold%n == first%n
      if (same) same = all(manifold%key(1:4) == first%key(1:4))
    end do
    call check(same, "keys of flush faces stay")
    ! bricks in running bond: one side flush
    call meet(box, box, straight, vec(1.0_dp, 0.0_dp, -2.0_dp), first)
    do k = 1, 500
      call meet(box, box, shaken_turn(draws), vec(creep(draws) + 1.0_dp, creep(draws), creep(draws) - 2.0_dp), &
        & manifold, 8)
      same = same .and. manifold%n == first%n
      if (same) same = all(manifold%key(1:4) == first%key(1:4))
    end do
    call check(same, "keys of bricks in running bond stay")
  end subroutine test_keys_of_flush_faces

  !> The second piece seen from the first, and the first from the second: the same places, gaps and normals.
  subroutine test_swap()
    type(manifold_t) :: one, other
    type(draws_t) :: draws
    type(turn_t) :: turn
    type(vector_t) :: way, place
    integer :: k, trial, met

    met = 0
    do trial = 1, 2000
      turn = random_turn(draws)
      if (modulo(trial, 3) == 0) turn = about(axis_z, 0.7_dp + 0.001_dp*draws%uniform())
      way = draws%direction()
      way%x(:) = draws%between(2.0_dp, 3.4_dp)*way%x
      call meet(box, box, turn, way, one, most_points)
      place = back(turn, way)
      place%x(:) = -place%x
      call meet(box, box, inverse(turn), place, other, most_points)
      call check_equal(one%n, other%n, "seen from the other: points")
      if (one%n == 0 .or. one%cores_overlap) cycle
      met = met + 1
      place = on(turn, vector_t(other%normal))
      call check_close(norm2(one%normal + place%x), 0.0_dp, 1.0e-11_dp, "seen from the other: normal")
      do k = 1, other%n
        place = on(turn, vector_t(other%point(:, k)))
        place%x(:) = place%x + way%x
        call check(has_point(one, place, 1.0e-9_dp), "seen from the other: a point")
      end do
    end do
    call check(met > 50, "seen from the other: enough contacts")
  end subroutine test_swap

  !> Hulls of random corners, most of which have several vertices in each face, mostly with a face of each against the other. Points
  !> are the same whatever rounding does to the way between the hulls, seen from the other one, and in a mirror.
  subroutine test_hulls(corners)
    integer, intent(in) :: corners
    type(body_shape_t) :: hull, image
    type(manifold_t) :: first, other
    type(draws_t) :: draws
    type(turn_t) :: turn, seen
    type(vector_t) :: way, shift, place
    real(dp), allocatable :: corner(:, :)
    integer :: trial, k, met

    call random_polyhedron(3, corners, [1.5_dp, 1.25_dp, 1.0_dp], corner)
    call make_hull("hull", corner, hull)
    corner(1, :) = -corner(1, :)
    call make_hull("image", corner, image)
    met = 0
    do trial = 1, 400
      call lay_hulls(hull, trial, draws, turn, way)
      if (.not. norm2(way%x) > 0.0_dp) cycle
      call meet(hull, hull, turn, way, first, most_points)
      call check(first%n > 0, "hulls: points")
      if (first%n >= 3) met = met + 1
      do k = 1, 8
        shift = draws%direction()
        place%x(:) = way%x + shift%x
        place%x(:) = place%x - shift%x
        call meet(hull, hull, turn, place, other, most_points)
        call check_equal(other%n, first%n, "hulls shifted together: points")
        call check(.not. any(other%key(1:first%n) /= first%key(1:first%n)), "hulls shifted together: keys")
        call check(covers(other, first) .and. covers(first, other), "hulls shifted together: places")
      end do
      seen = inverse(turn)
      place = on(seen, way)
      place%x(:) = -place%x
      call meet(hull, hull, seen, place, other, most_points)
      do k = 1, other%n
        place = on(turn, vector_t(other%point(:, k)))
        other%point(:, k) = place%x + way%x
      end do
      call check(covers(other, first) .and. covers(first, other), "hulls seen from the other: places")
      seen = turn
      seen%m(1, 2:3) = -seen%m(1, 2:3)
      seen%m(2:3, 1) = -seen%m(2:3, 1)
      place = way
      place%x(1) = -place%x(1)
      call meet(image, image, seen, place, other, most_points)
      other%point(1, 1:other%n) = -other%point(1, 1:other%n)
      call check(covers(other, first) .and. covers(first, other), "hulls in a mirror: places")
    end do
    call check(met > 200, "hulls: enough patches")
  end subroutine test_hulls

  subroutine make_hull(name, corner, hull)
    character(len=*), intent(in) :: name
    real(dp), intent(in), contiguous :: corner(:, :)
    type(body_shape_t), intent(out) :: hull
    type(error_t), allocatable :: error

    call make_polyhedron(name, corner, 0.025_dp, hull, error)
    call check(.not. allocated(error), "a hull of random corners")
  end subroutine make_hull

  !> Where the second of two equal hulls is that touches the first: turned at random, or with a face nearly on one of the first. No
  !> way where they overlap.
  subroutine lay_hulls(hull, trial, draws, turn, way)
    type(body_shape_t), intent(in) :: hull
    integer, intent(in) :: trial
    type(draws_t), intent(inout) :: draws
    type(turn_t), intent(out) :: turn
    type(vector_t), intent(out) :: way
    type(vector_t) :: a, b, axis
    type(placed_pair_t) :: pair
    type(core_distance_t) :: found
    integer :: n, face, k

    associate (piece => hull%piece(1))
      n = size(piece%face_normal, 2)
      face = 1 + modulo(trial, n)
      a%x(:) = piece%face_normal(:, face)
      b%x(:) = -piece%face_normal(:, 1 + modulo(face + int(draws%between(0.0_dp, n - 1.1_dp)), n))
      axis = vec(b%x(2)*a%x(3) - b%x(3)*a%x(2), b%x(3)*a%x(1) - b%x(1)*a%x(3), b%x(1)*a%x(2) - b%x(2)*a%x(1))
      turn = about(axis, atan2(norm2(axis%x), dot_product(a%x, b%x)))
      turn = between(about(a, draws%between(-pi, pi)), turn)
      axis = draws%direction()
      turn = between(about(axis, 10.0_dp**draws%between(-17.0_dp, -2.0_dp)), turn)
      if (modulo(trial, 8) == 0) turn = random_turn(draws)
      axis = draws%direction()
      way%x(:) = hull%size*(2.1_dp*a%x + 0.3_dp*axis%x)
      pair%radius_a = hull%size
      pair%radius_b = hull%size
      pair%rotation(:, :) = turn%m
      do k = 1, 4
        pair%way(:) = way%x
        call find_core_distance(piece, piece, pair, 10.0_dp, found)
        if (found%overlap) way%x(:) = 0.0_dp
        if (found%overlap) return
        way%x(:) = way%x + (found%distance - 2*hull%size*piece%rounding)*found%normal
      end do
    end associate
  end subroutine lay_hulls

  !> Whether each point of one manifold is near one of another. Points that are nearer than 1e-5 of the size may be one.
  logical function covers(one, other)
    type(manifold_t), intent(in) :: one, other
    integer :: k

    covers = .true.
    do k = 1, other%n
      covers = covers .and. has_point(one, vector_t(other%point(:, k)), 1.0e-4_dp)
    end do
  end function covers

end program test_polyhedron_pair
