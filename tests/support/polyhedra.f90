!> Polyhedra for tests: the regular ones, random hulls, a box, a rod and a ball; turns.
module gravier_polyhedra
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_rotation, only: make_rotation
  use gravier_convex_distance, only: placed_pair_t
  use gravier_simple_shapes, only: make_box, make_capsule
  use gravier_shape_library, only: body_shape_t
  use gravier_check, only: check
  implicit none
  private
  public :: tetrahedron, cube, octahedron, dodecahedron, icosahedron, golden
  public :: draws_t, random_turn
  public :: put_pair
  public :: make_box_rod_ball, box_rounding, half_core, straight
  public :: vector_t, turn_t, vec, about, back, on, between, inverse

  real(dp), parameter :: golden = (1.0_dp + sqrt(5.0_dp))/2
  !> of the box of make_box_rod_ball, and the half-edge of its core
  real(dp), parameter :: box_rounding = 0.1_dp, half_core = 1.0_dp - box_rounding
  !> the turn that turns nothing
  real(dp), parameter :: straight(3, 3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
  real(dp), parameter :: signs(2) = [-1.0_dp, 1.0_dp]

  !> Numbers drawn one after the other.
  type :: draws_t
    integer :: seed = 1
    integer(i8) :: drawn = 0
  contains
    procedure :: uniform => draws_uniform
    procedure :: between => draws_between
    procedure :: direction => draws_direction
  end type draws_t

  !> A vector, and a rotation: what functions return in one piece.
  type :: vector_t
    real(dp) :: x(3) = 0.0_dp
  end type vector_t

  type :: turn_t
    real(dp) :: m(3, 3) = 0.0_dp
  end type turn_t

contains

  !> A cube of edge 2, a capsule of length 2 and radius 0.25 along the third axis, a ball of radius 1.
  subroutine make_box_rod_ball(box, rod, ball)
    type(body_shape_t), intent(out) :: box, rod, ball
    type(error_t), allocatable :: error

    call make_box("box", [2.0_dp, 2.0_dp, 2.0_dp], box_rounding, box, error)
    call make_capsule("rod", 2.0_dp, 0.25_dp, rod, error)
    call make_capsule("ball", 0.0_dp, 1.0_dp, ball, error)
    call check(.not. allocated(error), "shapes")
  end subroutine make_box_rod_ball

  !> A vector of three components.
  pure type(vector_t) function vec(x, y, z)
    real(dp), intent(in) :: x, y, z
    vec%x(1) = x
    vec%x(2) = y
    vec%x(3) = z
  end function vec

  !> The turn about a direction by an angle [rad].
  pure type(turn_t) function about(direction, angle) result(turn)
    type(vector_t), intent(in) :: direction
    real(dp), intent(in) :: angle
    real(dp) :: vector(3)
    vector(:) = angle/norm2(direction%x)*direction%x
    call make_rotation(vector, turn%m)
  end function about

  !> A vector turned.
  pure type(vector_t) function on(turn, v) result(u)
    type(turn_t), intent(in) :: turn
    type(vector_t), intent(in) :: v
    integer :: k
    do k = 1, 3
      u%x(k) = v%x(1)*turn%m(k, 1) + v%x(2)*turn%m(k, 2) + v%x(3)*turn%m(k, 3)
    end do
  end function on

  !> A vector turned back.
  pure type(vector_t) function back(turn, v) result(u)
    type(turn_t), intent(in) :: turn
    type(vector_t), intent(in) :: v
    integer :: k
    do k = 1, 3
      u%x(k) = dot_product(turn%m(:, k), v%x)
    end do
  end function back

  !> The turn of a second body in the axes of a first.
  pure type(turn_t) function between(first, second) result(turn)
    type(turn_t), intent(in) :: first, second
    integer :: i, j
    do j = 1, 3
      do i = 1, 3
        turn%m(i, j) = dot_product(first%m(:, i), second%m(:, j))
      end do
    end do
  end function between

  pure type(turn_t) function inverse(turn) result(opposite)
    type(turn_t), intent(in) :: turn
    opposite%m(:, :) = transpose(turn%m)
  end function inverse

  !> Corners of a regular tetrahedron of edge 2 sqrt(2).
  function tetrahedron() result(points)
    real(dp) :: points(3, 4)
    points(:, :) = reshape([1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1], [3, 4])
  end function tetrahedron

  !> Of a cube of edge 2.
  function cube() result(points)
    real(dp) :: points(3, 8)
    integer :: k, d

    do k = 1, 8
      do d = 1, 3
        points(d, k) = signs(ibits(k - 1, d - 1, 1) + 1)
      end do
    end do
  end function cube

  !> Of a regular octahedron of edge sqrt(2).
  function octahedron() result(points)
    real(dp) :: points(3, 6)
    integer :: d

    points(:, :) = 0.0_dp
    do d = 1, 3
      points(d, 2*d - 1) = 1.0_dp
      points(d, 2*d) = -1.0_dp
    end do
  end function octahedron

  !> Of a regular dodecahedron of edge 2/golden.
  function dodecahedron() result(points)
    real(dp) :: points(3, 20)

    points(:, 1:8) = cube()
    points(:, 9:20) = cyclic(1.0_dp/golden, golden)
  end function dodecahedron

  !> Of a regular icosahedron of edge 2.
  function icosahedron() result(points)
    real(dp) :: points(3, 12)
    points(:, :) = cyclic(1.0_dp, golden)
  end function icosahedron

  !> (0, +-p, +-q) and those with the axes in turn.
  function cyclic(p, q) result(points)
    real(dp), intent(in) :: p, q
    real(dp) :: points(3, 12)
    integer :: d, i, j, k

    points(:, :) = 0.0_dp
    k = 0
    do d = 1, 3
      do i = 1, 2
        do j = 1, 2
          k = k + 1
          points(mod(d, 3) + 1, k) = signs(i)*p
          points(mod(d + 1, 3) + 1, k) = signs(j)*q
        end do
      end do
    end do
  end function cyclic

  !> The next number, between 0 and 1.
  real(dp) function draws_uniform(self) result(x)
    class(draws_t), intent(inout) :: self

    self%drawn = self%drawn + 1
    x = hash_uniform(self%seed, self%drawn, 1)
  end function draws_uniform

  !> The next number, between two others.
  real(dp) function draws_between(self, low, high) result(x)
    class(draws_t), intent(inout) :: self
    real(dp), intent(in) :: low, high
    x = low + (high - low)*self%uniform()
  end function draws_between

  !> A random unit vector.
  type(vector_t) function draws_direction(self) result(u)
    class(draws_t), intent(inout) :: self
    real(dp) :: angle

    u%x(3) = self%between(-1.0_dp, 1.0_dp)
    angle = self%between(0.0_dp, 2*acos(-1.0_dp))
    u%x(1) = sqrt(1.0_dp - u%x(3)**2)*cos(angle)
    u%x(2) = sqrt(1.0_dp - u%x(3)**2)*sin(angle)
  end function draws_direction

  !> A random rotation: about a random axis, by up to half a turn.
  type(turn_t) function random_turn(draws) result(turn)
    type(draws_t), intent(inout) :: draws
    type(vector_t) :: axis

    axis = draws%direction()
    turn = about(axis, draws%between(0.0_dp, acos(-1.0_dp)))
  end function random_turn

  !> Two bodies, the second turned and at a way from the first, in the axes of the first.
  subroutine put_pair(shape_a, shape_b, way, turn, pair)
    type(body_shape_t), intent(in) :: shape_a, shape_b
    real(dp), intent(in) :: way(3)
    type(turn_t), intent(in) :: turn
    type(placed_pair_t), intent(out) :: pair

    pair%radius_a = shape_a%size
    pair%radius_b = shape_b%size
    pair%rotation(:, :) = turn%m
    pair%way(:) = way
  end subroutine put_pair

end module gravier_polyhedra
