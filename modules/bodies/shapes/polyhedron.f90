!> Bodies in space other than spheres: rounded convex polyhedra, capsules, and rigid unions of such pieces.
!>
!> Their mass, centre and inertia are those of the polyhedron that is wanted, with sharp edges.
module gravier_polyhedron
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_convex_hull, only: find_hull
  use gravier_closed_surface, only: merge_points, check_closed_convex
  use gravier_convex_piece, only: convex_piece_t, find_candidates, list_faces, bound_piece
  use gravier_mass_properties, only: mass_t, mass_of_polyhedron, mass_of_capsule, find_principal_axes
  use gravier_rounded_core, only: find_core
  use gravier_shape_library, only: body_shape_t
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_spatial, only: extent_of, turn_back
  implicit none
  private
  public :: make_piece, make_piece_of_faces, make_capsule_piece, make_shape

  !> features of a piece (vertices, sides of faces, faces) that a contact can name
  integer, parameter :: most_features = 32768
  !> distance from a plane, in parts of the extent, up to which points lie in it; files of single precision are off by less
  real(dp), parameter :: flat = 1.0e-6_dp

contains

  !> The rounded hull of points as a piece, in their unit and axes, and its mass. Failures (status_input): fewer than 4 points, all
  !> in one plane, a rounding that is 0 or as large as the distance from the centre of mass to a face, too many corners.
  subroutine make_piece(name, points, rounding, piece, mass, error)
    character(len=*), intent(in) :: name
    real(dp), intent(in), contiguous :: points(:, :)
    real(dp), intent(in) :: rounding
    type(convex_piece_t), intent(out) :: piece
    type(mass_t), intent(out) :: mass
    type(error_t), allocatable, intent(inout) :: error
    type(sharp_polyhedron_t) :: sharp
    real(dp) :: moment(3), axes(3, 3)
    character(len=:), allocatable :: message

    if (allocated(error)) return
    call find_hull(points, flat*extent_of(points), sharp, message)
    if (len(message) == 0) then
      mass = mass_of_polyhedron(sharp)
      call find_principal_axes(mass%inertia, moment, axes)
      call find_core(sharp, mass%centre, axes, rounding, piece, message)
    end if
    if (len(message) == 0) call check_features(piece, message)
    if (len(message) > 0) call raise(error, status_input, name//": "//message)
  end subroutine make_piece

  !> The same of a closed surface, whose corners at one place become one, and whose planes are not read. Failures (status_input)
  !> beside those above: the surface is not closed, has no volume, is inside out or not convex, or has a face without area.
  subroutine make_piece_of_faces(name, surface, rounding, piece, mass, error)
    character(len=*), intent(in) :: name
    type(sharp_polyhedron_t), intent(in) :: surface
    real(dp), intent(in) :: rounding
    type(convex_piece_t), intent(out) :: piece
    type(mass_t), intent(out) :: mass
    type(error_t), allocatable, intent(inout) :: error
    type(sharp_polyhedron_t) :: merged
    character(len=:), allocatable :: message
    integer :: same(size(surface%vertex, 2)), k
    logical :: used(size(surface%vertex, 2))

    if (allocated(error)) return
    if (size(surface%face_vertex) == 0) then
      call raise(error, status_input, name//": no faces")
      return
    else
      if (minval(surface%face_vertex) < 1 .or. maxval(surface%face_vertex) > size(surface%vertex, 2)) then
        call raise(error, status_input, name//": a face names a corner that there is not")
        return
      end if
    end if
    call merge_points(surface%vertex, 0.1_dp*flat*extent_of(surface%vertex), same)
    merged%vertex = surface%vertex
    merged%face_first = surface%face_first
    allocate (merged%face_vertex(size(surface%face_vertex)))
    used(:) = .false.
    do k = 1, size(surface%face_vertex)
      merged%face_vertex(k) = same(surface%face_vertex(k))
      used(same(surface%face_vertex(k))) = .true.
    end do
    ! points that no face names do not count
    do k = 1, size(same)
      if (.not. used(k)) merged%vertex(:, k) = surface%vertex(:, merged%face_vertex(1))
    end do
    call check_closed_convex(merged, flat*extent_of(surface%vertex), message)
    if (len(message) > 0) then
      call raise(error, status_input, name//": "//message)
      return
    end if
    call make_piece(name, merged%vertex, rounding, piece, mass, error)
  end subroutine make_piece_of_faces

  !> A capsule between two points, or a sphere where they are one. Failures: a radius that is not above 0.
  subroutine make_capsule_piece(name, ends, radius, piece, mass, error)
    character(len=*), intent(in) :: name
    !> (3, 2)
    real(dp), intent(in) :: ends(:, :)
    real(dp), intent(in) :: radius
    type(convex_piece_t), intent(out) :: piece
    type(mass_t), intent(out) :: mass
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    if (allocated(error)) return
    if (.not. radius > 0.0_dp) then
      call raise(error, status_input, name//": a radius of "//to_text(radius)//", but one above 0 was expected")
      return
    end if
    n = 2
    if (norm2(ends(:, 2) - ends(:, 1)) <= flat*radius) n = 1
    piece%rounding = radius
    piece%vertex = ends(:, 1:n)
    piece%corner = piece%vertex
    allocate (piece%face_first(1), piece%face_vertex(0), piece%face_normal(3, 0), piece%neighbour_first(n + 1))
    piece%face_first(1) = 1
    piece%neighbour_first(1) = 1
    if (n == 1) then
      allocate (piece%neighbour(0))
    else
      piece%neighbour = [2, 1]
      piece%neighbour_first(2) = 2
    end if
    piece%neighbour_first(n + 1) = n
    if (n == 2) piece%neighbour_first(3) = 3
    mass = mass_of_capsule(ends, radius)
  end subroutine make_capsule_piece

  !> A shape of pieces: turned into principal axes about the centre of mass, and scaled to the radius 1.
  subroutine make_shape(name, pieces, mass, shape, error)
    character(len=*), intent(in) :: name
    type(convex_piece_t), intent(in) :: pieces(:)
    !> of the whole body
    type(mass_t), intent(in) :: mass
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    real(dp), parameter :: no_way(3) = 0.0_dp
    real(dp) :: moment(3), axes(3, 3)
    integer :: k, v

    if (allocated(error)) return
    if (.not. mass%volume > 0.0_dp) then
      call raise(error, status_input, name//": a body without volume")
      return
    end if
    call find_principal_axes(mass%inertia, moment, axes)
    shape%name = name
    shape%piece = pieces
    shape%size = 0.0_dp
    do k = 1, size(pieces)
      associate (piece => shape%piece(k))
        do v = 1, size(piece%vertex, 2)
          call turn_back(axes, mass%centre, piece%vertex(:, v))
          call turn_back(axes, mass%centre, piece%corner(:, v))
          shape%size = max(shape%size, norm2(piece%corner(:, v)), norm2(piece%vertex(:, v)) + piece%rounding)
        end do
        do v = 1, size(piece%face_normal, 2)
          call turn_back(axes, no_way, piece%face_normal(:, v))
        end do
      end associate
    end do
    do k = 1, size(pieces)
      shape%piece(k)%rounding = shape%piece(k)%rounding/shape%size
      shape%piece(k)%vertex(:, :) = shape%piece(k)%vertex/shape%size
      shape%piece(k)%corner(:, :) = shape%piece(k)%corner/shape%size
      call find_candidates(shape%piece(k))
      call list_faces(shape%piece(k))
      call bound_piece(shape%piece(k))
    end do
    shape%volume = mass%volume/shape%size**3
    shape%inertia(:) = moment/mass%volume/shape%size**2
  end subroutine make_shape

  !> Refuse a piece with more features than a contact can name.
  pure subroutine check_features(piece, message)
    type(convex_piece_t), intent(in) :: piece
    character(len=:), allocatable, intent(inout) :: message
    integer :: n

    n = size(piece%vertex, 2) + size(piece%neighbour) + size(piece%face_first) - 1
    if (n > most_features) message = "corners, faces and their sides are "//to_text(n)//", but at most "//to_text(most_features)// &
      & " were expected"
  end subroutine check_features

end module gravier_polyhedron
