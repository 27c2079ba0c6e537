!> Surfaces of boundaries: what their keys make of them, what they refuse, and what lists, loads and scales ask of them.
program test_surfaces
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t, collected_keys_t
  use gravier_surface, only: surface_t, surface_features_t, set_direction, is_vector, point_key
  use gravier_plane, only: plane_t, outlet_t
  use gravier_flat_piece, only: segment_t, rectangle_t
  use gravier_drum, only: circle_t, cylinder_t
  use gravier_surface_registry, only: surface_holder_t, registered_surfaces, surface_keys, glued_grains
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: zero(3) = 0.0_dp, rounding = 4.0_dp*epsilon(1.0_dp)

  call MPI_Init()
  call test_registry()
  call test_planes()
  call test_flat_pieces()
  call test_drums()
  call test_inside()
  call test_ways()
  call test_directions()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Each shape has a word, keys that include its point, and a place in two or three dimensions.
  subroutine test_registry()
    type(surface_holder_t), allocatable :: surfaces(:)
    type(declared_key_t), allocatable :: own(:)
    type(surface_features_t) :: features
    type(collected_keys_t) :: collected
    integer :: k

    call registered_surfaces(surfaces)
    call surface_keys(collected)
    call check(collected%kinds == "plane segment rectangle circle cylinder outlet mesh", "words of the shapes")
    call check(index(" "//trim(collected%kinds)//" ", " "//glued_grains//" ") == 0, "glued grains are no surface")
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      call surfaces(k)%surface%keys(own)
      call check(own(1)%name == point_key%name .and. own(1)%count == 3, "the first key of "//features%kind)
      select case (features%kind)
      case ("segment", "circle")
        call check(features%dimensions(2) .and. .not. features%dimensions(3), "a shape of the plane: "//features%kind)
      case ("rectangle", "cylinder")
        call check(features%dimensions(3) .and. .not. features%dimensions(2), "a shape of space: "//features%kind)
      case default
        call check(all(features%dimensions), "a shape of both: "//features%kind)
      end select
    end do
    k = collected%find("radius")
    call check(k > 0, "radius is a key")
    call check(collected%keys(k)%kinds == "circle cylinder" .and. collected%keys(k)%key%count == 1, &
      & "the shapes that have a radius")
    k = collected%find("point")
    call check(collected%keys(k)%kinds == collected%kinds, "all shapes have a point")
  end subroutine test_registry

  subroutine test_planes()
    type(plane_t) :: plane
    type(outlet_t) :: outlet
    type(surface_features_t) :: features
    real(dp) :: level
    logical :: known

    call expect(plane, reshape([1.0_dp, 2.0_dp, 3.0_dp, 0.0_dp, 3.0_dp, -4.0_dp], [3, 2]), "", "", "a plane")
    call check(all(abs(plane%axis - [0.0_dp, 0.6_dp, -0.8_dp]) <= rounding), "its unit normal")
    call check(all(abs(plane%point - [1.0_dp, 2.0_dp, 3.0_dp]) <= 0.0_dp), "its point")
    call expect(outlet, reshape([zero, zero], [3, 2]), "normal", "", "an outlet without a normal")
    call plane%level(2, level, known)
    call check(.not. known, "a slope faces along no axis")
    plane%axis(:) = [0.0_dp, 0.0_dp, -1.0_dp]
    call plane%level(3, level, known)
    call check(known, "a lid faces along z")
    call check_close(level, 3.0_dp, 0.0_dp, "where a lid stands")
    call check_close(plane%own_area(), 0.0_dp, 0.0_dp, "a plane has no area of its own")
    features = plane%features()
    call check(features%endless .and. features%touches .and. .not. features%lets_out, "what a plane is")
    features = outlet%features()
    call check(features%endless .and. .not. features%touches .and. features%lets_out, "what an outlet is")
  end subroutine test_planes

  subroutine test_flat_pieces()
    type(segment_t) :: segment
    type(rectangle_t) :: rectangle
    real(dp) :: level, middle(3)
    logical :: known

    call expect(segment, reshape([1.0_dp, 2.0_dp, 0.0_dp, 4.0_dp, 6.0_dp, 0.0_dp], [3, 2]), "", "", "a segment")
    call check_close(segment%own_area(), 5.0_dp, rounding, "length of a segment")
    call check_close(segment%half_width(1, .false.), 1.5_dp, rounding, "half of its width")
    call check_close(segment%half_width(1, .true.), 2.5_dp, rounding, "half of its width as it turns")
    call check_close(segment%support(2, 1.0_dp), 2.0_dp, 0.0_dp, "its lowest point")
    call check_close(segment%support(2, -1.0_dp), -6.0_dp, 0.0_dp, "its lowest point where up is down")
    call segment%find_middle(middle)
    call check(all(abs(middle - [2.5_dp, 4.0_dp, 0.0_dp]) <= rounding), "its middle")
    call segment%level(2, level, known)
    call check(.not. known, "a tilted segment faces along no axis")
    call expect(segment, reshape([1.0_dp, 2.0_dp, 0.0_dp, 1.0_dp, 2.0_dp, 0.0_dp], [3, 2]), "end", "another point than point", &
      & "a segment of one point")
    call expect(segment, reshape([0.0_dp, 0.0_dp, 0.0_dp, 1.0e-31_dp, 0.0_dp, 0.0_dp], [3, 2]), "end", &
      & "a point at least 1e-30 m from point", "a segment that is too short")
    call expect(segment, reshape([0.0_dp, 1.0_dp, 0.0_dp, 2.0_dp, 1.0_dp, 0.0_dp], [3, 2]), "", "", "a flat segment")
    call segment%level(2, level, known)
    call check(known, "a flat segment faces along y")
    call check_close(level, 1.0_dp, 0.0_dp, "where it stands")
    call expect(segment, reshape([0.0_dp, 1.0_dp, 0.0_dp, 2.0_dp, 1.015625_dp, 0.0_dp], [3, 2]), "", "", "a slight slope")
    call segment%level(2, level, known)
    call check(known, "a slight slope faces along y")
    call check_close(level, 1.0078125_dp, 0.0_dp, "it stands where its middle is")

    call expect(rectangle, reshape([zero, [2.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 3.0_dp, 0.0_dp]], [3, 3]), "", "", "a rectangle")
    call check_close(rectangle%own_area(), 6.0_dp, rounding, "area of a rectangle")
    call rectangle%level(3, level, known)
    call check(known, "a flat rectangle faces along z")
    call expect(rectangle, reshape([zero, zero, [0.0_dp, 3.0_dp, 0.0_dp]], [3, 3]), "edge_a", "", "no first edge")
    call expect(rectangle, reshape([zero, [2.0_dp, 0.0_dp, 0.0_dp], zero], [3, 3]), "edge_b", "", "no second edge")
    call expect(rectangle, reshape([zero, [1.0e-31_dp, 0.0_dp, 0.0_dp], [0.0_dp, 3.0_dp, 0.0_dp]], [3, 3]), "edge_a", &
      & "a length of at least 1e-30 m", "a first edge that is too short")
    call expect(rectangle, reshape([zero, [2.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0e-31_dp, 0.0_dp]], [3, 3]), "edge_b", &
      & "a length of at least 1e-30 m", "a second edge that is too short")
    call expect(rectangle, reshape([zero, [2.0_dp, 0.0_dp, 0.0_dp], [1.0e-5_dp, 3.0_dp, 0.0_dp]], [3, 3]), "edge_b", &
      & "an edge at right angles to {edge_a}, within 1e-6", "edges that are not at right angles")
    call expect(rectangle, reshape([zero, [2.0_dp, 0.0_dp, 0.0_dp], [1.0e-6_dp, 3.0_dp, 0.0_dp]], [3, 3]), "", "", &
      & "edges nearly at right angles")
    call test_round_a_period()
  end subroutine test_flat_pieces

  !> An edge of the length of a period along its axis has no end; any other one has.
  subroutine test_round_a_period()
    type(rectangle_t) :: plate
    type(cylinder_t) :: cylinder
    real(dp) :: corner(3), edge(3, 2)
    real(dp), parameter :: across(3) = [2.0_dp, 0.0_dp, 1.0_dp]

    call expect(plate, reshape([zero, across, [0.0_dp, -3.0_dp, 0.0_dp]], [3, 3]), "", "", "a plate")
    call check_equal(plate%edge_round(2, 3.0_dp), 2, "its edge along y goes round")
    call check_equal(plate%edge_round(2, 3.0_dp*(1.0_dp + 1.0e-10_dp)), 2, "but for rounding")
    call check_equal(plate%edge_round(2, 3.0_dp*(1.0_dp + 1.0e-8_dp)), 0, "a longer period")
    call check_equal(plate%edge_round(2, 2.9_dp), 0, "a shorter period")
    call check_equal(plate%edge_round(2, 0.0_dp), 0, "no period")
    call check_equal(plate%edge_round(1, 2.0_dp), 0, "an edge that is not along the axis")
    call check_equal(cylinder%edge_round(1, 2.0_dp), 0, "a cylinder has no edge")
    corner(:) = [0.5_dp, 0.25_dp, 0.0_dp]
    call plate%stretch([0.0_dp, 3.0_dp, 0.0_dp], corner, edge)
    call check(all(abs(corner - [0.5_dp, 3.25_dp, 0.0_dp]) <= rounding), "a period before its corner")
    call check(all(abs(edge(:, 1) - across) <= 0.0_dp) .and. all(abs(edge(:, 2) - [0.0_dp, -9.0_dp, 0.0_dp]) <= rounding), &
      & "three periods long")
    call plate%stretch([2.0_dp, 0.0_dp, 0.0_dp], corner, edge)
    call check(all(abs(edge - plate%edge) <= 0.0_dp), "edges that end stay")
  end subroutine test_round_a_period

  subroutine test_drums()
    type(circle_t) :: circle
    type(cylinder_t) :: cylinder
    real(dp) :: level
    logical :: known

    call expect(circle, reshape([1.0_dp, 2.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 0.0_dp], [3, 2]), "", "", "a circle")
    call check_close(circle%half_width(2, .true.), 0.5_dp, 0.0_dp, "half of its width")
    call check_close(circle%support(2, 1.0_dp), 1.5_dp, 0.0_dp, "its lowest point")
    call circle%level(2, level, known)
    call check(.not. known, "a circle faces along no axis")
    call expect(circle, reshape([zero, -1.0_dp, 0.0_dp, 0.0_dp], [3, 2]), "radius", "", "a radius below 0")
    call expect(circle, reshape([zero, zero], [3, 2]), "radius", "", "a radius of 0")
    call expect(cylinder, reshape([zero, [0.0_dp, 0.0_dp, 2.0_dp], [1.5_dp, 0.0_dp, 0.0_dp]], [3, 3]), "", "", "a cylinder")
    call check_close(cylinder%axis(3), 1.0_dp, 0.0_dp, "its unit axis")
    call check(cylinder%support(3, 1.0_dp) >= huge(1.0_dp), "an upright drum carries nothing")
    call check_close(cylinder%support(2, 1.0_dp), -1.5_dp, 0.0_dp, "a drum that lies does")
    call expect(cylinder, reshape([zero, zero, [1.5_dp, 0.0_dp, 0.0_dp]], [3, 3]), "axis", "", "no axis")
    call expect(cylinder, reshape([zero, [0.0_dp, 0.0_dp, 2.0_dp], zero], [3, 3]), "radius", "", "no radius")
  end subroutine test_drums

  !> Shares of boxes inside a drum, against areas that are known: a square about a circle, quadrants, a strip, a corner, what is
  !> outside; of an oblique cylinder about as of one that is nearly so.
  subroutine test_inside()
    type(circle_t) :: circle
    type(cylinder_t) :: cylinder
    type(plane_t) :: plane
    real(dp), parameter :: pi = acos(-1.0_dp)
    real(dp) :: low, high, strip

    circle%point = [1.0_dp, 2.0_dp, 0.0_dp]
    circle%radius = 0.5_dp
    call check_close(circle%share_inside([0.5_dp, 1.5_dp, 0.0_dp], [1.5_dp, 2.5_dp, 1.0_dp]), pi/4.0_dp, rounding, "its square")
    call check_close(circle%share_inside([1.0_dp, 2.0_dp, 0.0_dp], [1.5_dp, 2.5_dp, 1.0_dp]), pi/4.0_dp, rounding, "a quadrant")
    call check_close(circle%share_inside([0.0_dp, 1.0_dp, 0.0_dp], [1.0_dp, 2.0_dp, 1.0_dp]), pi/16.0_dp, rounding, &
      & "a quadrant in a larger square")
    call check_close(circle%share_inside([0.9_dp, 1.9_dp, 0.0_dp], [1.1_dp, 2.2_dp, 1.0_dp]), 1.0_dp, rounding, "a box inside")
    call check_close(circle%share_inside([1.4_dp, 2.4_dp, 0.0_dp], [1.5_dp, 2.5_dp, 1.0_dp]), 0.0_dp, 1.0e-14_dp, "a box outside")
    call check_close(circle%share_inside([2.0_dp, 2.0_dp, 0.0_dp], [3.0_dp, 2.5_dp, 1.0_dp]), 0.0_dp, 0.0_dp, "a box far outside")
    ! the part of a disk above half of its radius
    strip = 0.25_dp*(pi/3.0_dp - sqrt(0.1875_dp))
    call check_close(circle%share_inside([0.5_dp, 2.25_dp, 0.0_dp], [1.5_dp, 2.5_dp, 1.0_dp]), strip/0.25_dp, rounding, "a segment")
    call check_close(circle%share_inside([1.25_dp, 1.5_dp, 0.0_dp], [1.5_dp, 2.5_dp, 1.0_dp]), strip/0.25_dp, rounding, &
      & "a segment to the right")
    call check_close(circle%share_inside([1.0_dp, 1.0_dp, 0.0_dp], [1.0_dp, 3.0_dp, 1.0_dp]), 1.0_dp, 0.0_dp, &
      & "a box without an area")
    call check_close(plane%share_inside([-1.0_dp, -1.0_dp, 0.0_dp], [1.0_dp, 1.0_dp, 1.0_dp]), 1.0_dp, 0.0_dp, &
      & "a plane encloses nothing")
    low = -huge(1.0_dp)
    high = 1.2_dp
    call circle%shut(1, low, high)
    call check_close(low, 0.5_dp, 0.0_dp, "its left end")
    call check_close(high, 1.2_dp, 0.0_dp, "a plane within it")
    cylinder%radius = 1.0_dp
    cylinder%axis = [0.0_dp, 1.0_dp, 0.0_dp]
    call check_close(cylinder%share_inside([-1.0_dp, 3.0_dp, -1.0_dp], [1.0_dp, 9.0_dp, 1.0_dp]), pi/4.0_dp, rounding, "along y")
    call check_close(cylinder%share_inside([-1.0_dp, 3.0_dp, 0.0_dp], [0.0_dp, 9.0_dp, 2.0_dp]), pi/8.0_dp, rounding, &
      & "a part of it")
    low = -7.0_dp
    high = 7.0_dp
    call cylinder%shut(2, low, high)
    call check_close(low, -7.0_dp, 0.0_dp, "endless along its axis")
    call cylinder%shut(3, low, high)
    call check_close(high - low, 2.0_dp, 0.0_dp, "shut across it")
    call set_direction([1.0e-4_dp, 1.0_dp, 1.0e-4_dp], cylinder%axis)
    call check_close(cylinder%share_inside([-1.0_dp, -3.0_dp, -1.0_dp], [1.0_dp, 3.0_dp, 1.0_dp]), pi/4.0_dp, 1.0e-3_dp, &
      & "nearly along y")
    ! along the diagonal of x and y between two planes across y, which cut it on average where its axis goes through them
    call set_direction([1.0_dp, 1.0_dp, 0.0_dp], cylinder%axis)
    cylinder%radius = 0.5_dp
    call check_close(cylinder%share_inside([-9.0_dp, -1.0_dp, -1.0_dp], [9.0_dp, 1.0_dp, 1.0_dp]), &
      & 0.25_dp*pi*2.0_dp*sqrt(2.0_dp)/72.0_dp, 1.0e-4_dp, "oblique, between two planes")
    low = -7.0_dp
    call cylinder%shut(1, low, high)
    call check_close(low, -7.0_dp, 0.0_dp, "an oblique one shuts no box")
  end subroutine test_inside

  !> How far points of a surface have moved at most.
  subroutine test_ways()
    type(plane_t) :: plane, plane_before
    type(segment_t) :: segment, segment_before
    type(rectangle_t) :: rectangle, rectangle_before

    plane_before%axis(2) = 1.0_dp
    plane = plane_before
    plane%point(:) = [7.0_dp, -0.25_dp, 0.0_dp]
    call check_close(plane%way(plane_before), 0.25_dp, 0.0_dp, "a plane that slides and sinks")
    segment_before%edge(1, 1) = 2.0_dp
    segment = segment_before
    segment%edge(:, 1) = [0.0_dp, 2.0_dp, 0.0_dp]
    call check_close(segment%way(segment_before), sqrt(8.0_dp), rounding, "the end of a segment that turns by a right angle")
    segment%point(1) = 3.0_dp
    segment%edge(:, 1) = segment_before%edge(:, 1)
    call check_close(segment%way(segment_before), 3.0_dp, rounding, "a segment that is shifted")
    rectangle_before%edge(1, 1) = 2.0_dp
    rectangle_before%edge(2, 2) = 5.0_dp
    rectangle = rectangle_before
    rectangle%edge(:, 2) = [0.0_dp, 0.0_dp, 5.0_dp]
    call check_close(rectangle%way(rectangle_before), sqrt(50.0_dp), rounding, "a rectangle that turns about its first edge")
    rectangle%edge(:, 1) = [0.0_dp, 0.0_dp, -2.0_dp]
    rectangle%edge(:, 2) = rectangle_before%edge(:, 2)
    call check_close(rectangle%way(rectangle_before), sqrt(8.0_dp), rounding, "a rectangle that turns about its second edge")
  end subroutine test_ways

  !> Vectors whose squares are out of range have a direction too.
  subroutine test_directions()
    real(dp) :: unit(3)

    call set_direction([3.0e-200_dp, 4.0e-200_dp, 0.0_dp], unit)
    call check(all(abs(unit - [0.6_dp, 0.8_dp, 0.0_dp]) <= rounding), "direction of a tiny vector")
    call set_direction([0.0_dp, -3.0e200_dp, 4.0e200_dp], unit)
    call check(all(abs(unit - [0.0_dp, -0.6_dp, 0.8_dp]) <= rounding), "direction of a huge vector")
    call check(is_vector([0.0_dp, 1.0e-300_dp]) .and. .not. is_vector(zero), "vectors that are not 0")
  end subroutine test_directions

  !> Give a surface its values, and say what it should refuse.
  subroutine expect(surface, values, wrong, expected, name)
    class(surface_t), intent(inout) :: surface
    real(dp), intent(in) :: values(:, :)
    character(len=*), intent(in) :: wrong, expected, name
    real(dp) :: given(size(values, 1), size(values, 2))
    character(len=:), allocatable :: found, text

    given(:, :) = values
    call surface%set(given, found, text)
    call check_equal(found, wrong, name//": key")
    call check_equal(text, expected, name//": expectation")
  end subroutine expect

end program test_surfaces
