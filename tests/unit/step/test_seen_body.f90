!> Bodies as contacts see them: what is turned from their axes and back.
program test_seen_body
  use gravier_kinds, only: dp
  use gravier_body_store, only: body_set_t
  use gravier_facet, only: near_facets_t
  use gravier_manifold, only: manifold_t
  use gravier_seen_body, only: seen_body_t, see_body, turn_manifold, turn_vertex, turn_facets
  use gravier_check, only: check_close, check_equal, finish_checks
  implicit none
  !> a third of a turn about (1, 1, 1): x to y, y to z, z to x
  real(dp), parameter :: third(4) = 0.5_dp

  call test_in_space()
  call test_in_the_plane()
  call test_round()
  call finish_checks()

contains

  !> A set of one body.
  subroutine make_body(nd, no, bodies)
    integer, intent(in) :: nd, no
    type(body_set_t), intent(out) :: bodies

    bodies%nd = nd
    bodies%no = no
    bodies%n = 1
    bodies%nv = 3*nd - 3
    allocate (bodies%velocity(bodies%nv, 1), source=0.0_dp)
    allocate (bodies%radius(1), source=2.0_dp)
    allocate (bodies%shape(merge(1, 0, no > 0)), source=3)
    allocate (bodies%orientation(no, merge(1, 0, no > 0)), source=0.5_dp)
  end subroutine make_body

  subroutine test_in_space()
    type(body_set_t) :: bodies
    type(seen_body_t) :: seen
    type(manifold_t) :: manifold
    type(near_facets_t) :: near, turned
    real(dp) :: vertex(3)
    real(dp), parameter :: corner(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1]*1.0_dp, [3, 3])

    call make_body(3, 4, bodies)
    bodies%orientation(:, 1) = third
    bodies%velocity(:, :) = 7.0_dp
    bodies%velocity(4, 1) = 5.0_dp
    call see_body(bodies, 1, seen)
    call check_close(seen%velocity(3), 7.0_dp, 0.0_dp, "the velocity")
    call check_close(seen%spin(1), 5.0_dp, 0.0_dp, "the spin")
    call check_equal(seen%shape, 3, "the shape")
    call check_close(seen%radius, 2.0_dp, 0.0_dp, "the radius")
    call turn_vertex([1.0_dp, 0.0_dp, 0.0_dp], seen, vertex)
    call check_close(vertex(2), 2.0_dp, 1.0e-15_dp, "x becomes y, at the size of the body")
    manifold%n = 1
    manifold%normal(2) = 1.0_dp
    manifold%point(3, 1) = 5.0_dp
    call turn_manifold(seen%axes, manifold)
    call check_close(manifold%normal(3), 1.0_dp, 1.0e-15_dp, "y becomes z")
    call check_close(manifold%point(1, 1), 5.0_dp, 1.0e-14_dp, "z becomes x")
    near%tolerance = 0.125_dp
    call near%add(7, corner)
    call turn_facets(seen%axes, near, turned)
    call turn_facets(seen%axes, near, turned)
    call check_equal(turned%n, 1, "facets of before are gone")
    call check_equal(turned%number(1), 7, "the number of a facet")
    call check_close(turned%tolerance, 0.125_dp, 0.0_dp, "the tolerance")
    call check_close(turned%corner(3, 1, 1), 1.0_dp, 1.0e-15_dp, "global x is z of the body")
    call check_close(turned%corner(1, 2, 1), 1.0_dp, 1.0e-15_dp, "global y is x of the body")
  end subroutine test_in_space

  subroutine test_in_the_plane()
    type(body_set_t) :: bodies
    type(seen_body_t) :: seen
    real(dp) :: vertex(3)

    call make_body(2, 1, bodies)
    bodies%orientation(1, 1) = 2.0_dp*atan(1.0_dp)
    bodies%velocity(3, 1) = 5.0_dp
    call see_body(bodies, 1, seen)
    call check_close(seen%spin(3), 5.0_dp, 0.0_dp, "the spin in the plane")
    call turn_vertex([1.0_dp, 0.0_dp], seen, vertex)
    call check_close(vertex(2), 2.0_dp, 1.0e-15_dp, "a quarter of a turn")
    call check_close(abs(vertex(1)) + abs(vertex(3)), 0.0_dp, 1.0e-15_dp, "in the plane")
  end subroutine test_in_the_plane

  !> Scenes of disks and spheres have neither shapes nor orientations.
  subroutine test_round()
    type(body_set_t) :: bodies
    type(seen_body_t) :: seen

    call make_body(3, 0, bodies)
    call see_body(bodies, 1, seen)
    call check_equal(seen%shape, 0, "a sphere")
    call check_close(seen%axes(1, 1) + seen%axes(2, 2) + seen%axes(3, 3), 3.0_dp, 0.0_dp, "axes of a sphere")
  end subroutine test_round

end program test_seen_body
