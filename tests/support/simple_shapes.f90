!> Bodies of one shape for tests: made from numbers, as the file of shapes makes them from words.
module gravier_simple_shapes
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_convex_piece, only: convex_piece_t
  use gravier_mass_properties, only: mass_t, mass_of_sum
  use gravier_shape_library, only: body_shape_t
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_polyhedron, only: make_piece, make_piece_of_faces, make_capsule_piece, make_shape
  use gravier_polygon, only: flat_piece_t, polygon_piece, make_flat_shape
  implicit none
  private
  public :: make_polyhedron, make_polyhedron_of_faces, make_box, make_capsule, make_union, make_polygon

contains

  !> A body that is the convex hull of points, with round edges. Failures (status_input): fewer than 4 points, all in one plane, a
  !> rounding that is 0 or as large as the distance from the centre of mass to a face, too many corners.
  subroutine make_polyhedron(name, points, rounding, shape, error)
    !> for messages, and the name of the shape
    character(len=*), intent(in) :: name
    !> (3, n)
    real(dp), intent(in), contiguous :: points(:, :)
    !> in the unit of the points
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(convex_piece_t) :: piece(1)
    type(mass_t) :: mass

    call make_piece(name, points, rounding, piece(1), mass, error)
    call make_shape(name, piece, mass, shape, error)
  end subroutine make_polyhedron

  !> A body with the faces of a closed surface. Failures (status_input) beside those above: the surface is not closed, has no
  !> volume, is inside out or not convex, or has a face without area.
  subroutine make_polyhedron_of_faces(name, surface, rounding, shape, error)
    character(len=*), intent(in) :: name
    !> its corners and faces; corners at one place become one, and planes are not read
    type(sharp_polyhedron_t), intent(in) :: surface
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(convex_piece_t) :: piece(1)
    type(mass_t) :: mass

    call make_piece_of_faces(name, surface, rounding, piece(1), mass, error)
    call make_shape(name, piece, mass, shape, error)
  end subroutine make_polyhedron_of_faces

  !> A box with the axes of coordinates.
  subroutine make_box(name, sides, rounding, shape, error)
    character(len=*), intent(in) :: name
    !> lengths along the axes, and the rounding in their unit
    real(dp), intent(in) :: sides(3), rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: points(3, 8)
    integer :: k, d

    if (allocated(error)) return
    if (.not. all(sides > 0.0_dp)) then
      call raise(error, status_input, name//": a side of "//to_text(minval(sides))//", but one above 0 was expected")
      return
    end if
    do k = 1, 8
      do d = 1, 3
        points(d, k) = sides(d)*(ibits(k - 1, d - 1, 1) - 0.5_dp)
      end do
    end do
    call make_polyhedron(name, points, rounding, shape, error)
  end subroutine make_box

  !> A capsule: a cylinder with half-balls at its ends, along the third axis; a sphere where the length is 0.
  subroutine make_capsule(name, length, radius, shape, error)
    character(len=*), intent(in) :: name
    !> of the cylinder, between the centres of the half-balls
    real(dp), intent(in) :: length
    real(dp), intent(in) :: radius
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(convex_piece_t) :: piece(1)
    type(mass_t) :: mass
    real(dp) :: ends(3, 2)

    ends(:, :) = 0.0_dp
    ends(3, 1) = -0.5_dp*length
    ends(3, 2) = 0.5_dp*length
    call make_capsule_piece(name, ends, radius, piece(1), mass, error)
    call make_shape(name, piece, mass, shape, error)
  end subroutine make_capsule

  !> A body of several pieces that touch but do not overlap: its mass, centre and inertia are the sums of theirs.
  subroutine make_union(name, pieces, masses, shape, error)
    character(len=*), intent(in) :: name
    !> in common axes, as make_piece and its like give them
    type(convex_piece_t), intent(in) :: pieces(:)
    type(mass_t), intent(in) :: masses(:)
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error

    call make_shape(name, pieces, mass_of_sum(masses), shape, error)
  end subroutine make_union

  !> A body that is one convex polygon.
  pure subroutine make_polygon(name, corners, rounding, shape, message)
    character(len=*), intent(in) :: name
    !> (2, n) in either sense of rotation, in any unit of length
    real(dp), intent(in) :: corners(:, :)
    !> of the corners, in the same unit
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    !> why there is no such polygon, without a full stop; empty where there is
    character(len=:), allocatable, intent(out) :: message
    type(flat_piece_t) :: made(1)

    call polygon_piece(corners, rounding, made(1), message)
    if (len(message) == 0) call make_flat_shape(name, made, shape)
  end subroutine make_polygon

end module gravier_simple_shapes
