!> Random pairs of convex pieces for tests, most of them in places that are hard to tell: hulls of 4 to 100 points, flat and thin
!> ones, prisms with faces and edges that are parallel but for any angle, corners on corners.
module gravier_fuzz_pairs
  use gravier_kinds, only: dp
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance, place_a, place_b
  use gravier_errors, only: error_t
  use gravier_polyhedra, only: draws_t, turn_t, vector_t, vec, about, between, random_turn
  use gravier_simple_shapes, only: make_polyhedron
  use gravier_shape_library, only: body_shape_t
  implicit none
  private
  public :: fuzz_library_t, make_library, draw_pair, families, family_names, parallel_faces, parallel_edges

  integer, parameter :: families = 7
  character(len=*), parameter :: family_names(families) = [character(len=24) :: "random hulls", "parallel faces", &
    & "parallel edges", "corner on corner", "slivers", "faces nearly parallel", "far from the origin"]
  integer, parameter :: parallel_faces = 2, parallel_edges = 3
  integer, parameter :: n_hulls = 60, n_prisms = 30, n_slivers = 30
  !> sides of a prism at most
  integer, parameter :: most_sides = 8

  type :: fuzz_library_t
    type(body_shape_t), allocatable :: hull(:), prism(:), sliver(:)
  end type fuzz_library_t

contains

  !> The shapes that pairs are drawn of.
  subroutine make_library(draws, library)
    type(draws_t), intent(inout) :: draws
    type(fuzz_library_t), intent(out) :: library
    integer :: k

    allocate (library%hull(n_hulls), library%prism(n_prisms), library%sliver(n_slivers))
    do k = 1, n_hulls
      call draw_hull(draws, 1.0_dp, library%hull(k))
    end do
    do k = 1, n_prisms
      call draw_prism(draws, library%prism(k))
    end do
    do k = 1, n_slivers
      call draw_hull(draws, 1.0e-4_dp, library%sliver(k))
    end do
  end subroutine make_library

  !> The hull of 4 to 100 points of an ellipsoid.
  subroutine draw_hull(draws, thinnest, shape)
    type(draws_t), intent(inout) :: draws
    !> its third axis, the first being 1; the second is anything between
    real(dp), intent(in) :: thinnest
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable :: error
    type(vector_t) :: point, axis
    real(dp), allocatable :: points(:, :)
    integer :: k, n

    do
      n = nint(4.0_dp*25.0_dp**draws%uniform())
      allocate (points(3, n))
      axis = vec(1.0_dp, thinnest**draws%uniform(), thinnest)
      if (thinnest >= 1.0_dp) axis = vec(1.0_dp, draws%between(0.3_dp, 1.0_dp), draws%between(0.3_dp, 1.0_dp))
      do k = 1, n
        point = draws%direction()
        points(:, k) = axis%x*point%x
      end do
      call make_polyhedron("hull", points, draws%between(1.0e-3_dp, 2.0e-2_dp)*axis%x(3), shape, error)
      if (.not. allocated(error)) return
      deallocate (points, error)
    end do
  end subroutine draw_hull

  !> A prism along the third axis.
  subroutine draw_prism(draws, shape)
    type(draws_t), intent(inout) :: draws
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable :: error
    real(dp) :: points(3, 2*most_sides), angle
    integer :: k, n

    do
      n = 3 + int(draws%uniform()*(most_sides - 2), kind(n))
      do k = 1, n
        angle = 2*acos(-1.0_dp)*(k + draws%between(-0.3_dp, 0.3_dp))/n
        points(1, k:k + n:n) = cos(angle)
        points(2, k:k + n:n) = draws%between(0.9_dp, 1.0_dp)*sin(angle)
        points(3, k) = -0.6_dp
        points(3, k + n) = 0.6_dp
      end do
      call make_polyhedron("prism", points(:, 1:2*n), draws%between(1.0e-3_dp, 2.0e-2_dp), shape, error)
      if (.not. allocated(error)) return
      deallocate (error)
    end do
  end subroutine draw_prism

  !> Two shapes of a family and their places: cores apart by 1e-6 to 1 of the size, but for corners on corners, which may overlap.
  subroutine draw_pair(draws, library, family, a, b, pair)
    type(draws_t), intent(inout) :: draws
    type(fuzz_library_t), intent(in), target :: library
    integer, intent(in) :: family
    type(body_shape_t), pointer, intent(out) :: a, b
    type(placed_pair_t), intent(out) :: pair
    type(turn_t) :: turn
    type(vector_t) :: way

    pair%radius_a = draws%between(0.5_dp, 2.0_dp)
    pair%radius_b = draws%between(0.5_dp, 2.0_dp)
    way = draws%direction()
    turn = random_turn(draws)
    select case (family)
    case (2, 3, 6)
      a => library%prism(drawn(draws, n_prisms))
      b => library%prism(drawn(draws, n_prisms))
      turn = about(vec(0.0_dp, 0.0_dp, 1.0_dp), draws%between(0.0_dp, 6.3_dp))
      ! some sides are parallel too
      if (draws%uniform() < 0.2_dp) turn = about(vec(0.0_dp, 0.0_dp, 1.0_dp), 0.0_dp)
      if (family /= 3) way = vec(draws%between(-0.5_dp, 0.5_dp), draws%between(-0.5_dp, 0.5_dp), sign(1.0_dp, way%x(3)))
      if (family == 3) way%x(3) = 0.2_dp*way%x(3)
      if (family == 6) turn = between(about(draws%direction(), 10.0_dp**draws%between(-16.0_dp, -1.0_dp)), turn)
    case (5)
      a => library%sliver(drawn(draws, n_slivers))
      b => library%sliver(drawn(draws, n_slivers))
    case default
      a => library%hull(drawn(draws, n_hulls))
      b => library%hull(drawn(draws, n_hulls))
    end select
    pair%rotation(:, :) = turn%m
    pair%way(:) = 2*(pair%radius_a + pair%radius_b)/norm2(way%x)*way%x
    if (family == 4) then
      call put_corners_together(draws, a, b, pair)
    else
      call approach(draws, a, b, pair)
    end if
    if (family == 7) call shift_far(draws, pair)
  end subroutine draw_pair

  integer function drawn(draws, n)
    type(draws_t), intent(inout) :: draws
    integer, intent(in) :: n
    drawn = min(n, 1 + int(draws%uniform()*n, kind(n)))
  end function drawn

  !> Move b along the shortest way until the cores are apart by what is drawn.
  subroutine approach(draws, a, b, pair)
    type(draws_t), intent(inout) :: draws
    type(body_shape_t), intent(in) :: a, b
    type(placed_pair_t), intent(inout) :: pair
    type(core_distance_t) :: found
    real(dp) :: wanted

    call find_core_distance(a%piece(1), b%piece(1), pair, huge(1.0_dp), found)
    wanted = 10.0_dp**draws%between(-6.0_dp, 0.0_dp)
    ! half of them as contacts are
    if (draws%uniform() < 0.5_dp) wanted = pair%radius_a*a%piece(1)%rounding + pair%radius_b*b%piece(1)%rounding + &
      & draws%between(-1.0e-3_dp, 1.0e-3_dp)
    pair%way(:) = pair%way + (found%distance - max(wanted, 1.0e-6_dp))*found%normal
  end subroutine approach

  !> A corner of b at one of a, but for a small way.
  subroutine put_corners_together(draws, a, b, pair)
    type(draws_t), intent(inout) :: draws
    type(body_shape_t), intent(in) :: a, b
    type(placed_pair_t), intent(inout) :: pair
    type(vector_t) :: direction
    real(dp) :: x(3), y(3)

    direction = draws%direction()
    pair%way(:) = 0.0_dp
    call place_a(a%piece(1), pair, drawn(draws, size(a%piece(1)%vertex, 2)), x)
    call place_b(b%piece(1), pair, drawn(draws, size(b%piece(1)%vertex, 2)), y)
    pair%way(:) = x - y + 10.0_dp**draws%between(-9.0_dp, -1.0_dp)*direction%x
  end subroutine put_corners_together

  !> The way as it is found from places a million sizes from the origin.
  subroutine shift_far(draws, pair)
    type(draws_t), intent(inout) :: draws
    type(placed_pair_t), intent(inout) :: pair
    type(vector_t) :: direction
    real(dp) :: place(3), other(3)

    direction = draws%direction()
    place(:) = 1.0e6_dp*direction%x
    other(:) = place + pair%way
    pair%way(:) = other - place
  end subroutine shift_far

end module gravier_fuzz_pairs
