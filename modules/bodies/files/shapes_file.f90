!> A library of shapes from a text file that a person can write: shapes by name, each made of one piece or of several.
module gravier_shapes_file
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, lower
  use gravier_magnitude, only: is_size, is_bounded, size_text, bounded_text
  use gravier_communicator, only: communicator_t
  use gravier_input_text, only: read_input_text
  use gravier_shape_library, only: body_shape_t, shape_library_t
  use gravier_shape_names, only: find_shape, is_reserved_name
  use gravier_convex_piece, only: convex_piece_t
  use gravier_mass_properties, only: mass_t, mass_of_sum, find_principal_axes
  use gravier_polyhedron, only: make_piece, make_piece_of_faces, make_capsule_piece, make_shape
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_stl_file, only: read_stl
  use gravier_obj_file, only: read_obj
  use gravier_quaternion, only: find_quaternion
  use gravier_polygon, only: flat_piece_t, polygon_piece, round_piece, make_flat_shape
  use gravier_shapes_text, only: statement_t, split_statements, check_count, refuse => refuse_statement
  use gravier_shapes_words, only: is_generated, generate_corners
  implicit none
  private
  public :: read_shapes, parse_shapes

  !> rounding of a shape that says none, over its size, and one over the extent of a piece with which the size is found first
  real(dp), parameter :: usual_rounding = 1.0e-3_dp, trial_rounding = 1.0e-9_dp
  integer, parameter :: longest_name = 64

contains

  !> Read a library. Failure: status_input, with file, line, what was found and what was expected. Errors are the same on all ranks.
  !> Collective.
  subroutine read_shapes(comm, path, dimension, library, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    type(shape_library_t), intent(out) :: library
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    call read_input_text(comm, path, text, error)
    call parse_shapes(path, text, dimension, library, error)
    call comm%agree(error)
  end subroutine read_shapes

  !> Make a library of what a text says. Failure: status_input, as above.
  subroutine parse_shapes(path, text, dimension, library, error)
    !> for messages
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension
    type(shape_library_t), intent(out) :: library
    type(error_t), allocatable, intent(inout) :: error
    type(statement_t), allocatable :: statements(:)
    integer :: first, last

    if (allocated(error)) return
    call split_statements(path, text, dimension, statements, error)
    if (allocated(error)) return
    first = 1
    do while (first <= size(statements) .and. .not. allocated(error))
      last = first
      do while (last < size(statements))
        if (statements(last + 1)%word == "shape") exit
        last = last + 1
      end do
      call check_name(path, statements(first), library, error)
      call check_order(path, statements(first:last), error)
      call add_shape(path, statements(first:last), dimension, library, error)
      first = last + 1
    end do
    if (library%n == 0) call raise(error, status_input, path//": no shapes: expected shape and a name, then its pieces")
  end subroutine parse_shapes

  !> Refuse a shape without a name of its own.
  subroutine check_name(path, statement, library, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    type(shape_library_t), intent(in) :: library
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    associate (name => statement%text)
      if (statement%word /= "shape") then
        call refuse(path, statement, statement%word//": expected shape and a name before it", error)
      else if (len(name) == 0) then
        call refuse(path, statement, "shape: expected a name behind it", error)
      else if (scan(name, " ,"//achar(9)//"'"//'"') > 0 .or. len(name) > longest_name) then
        call refuse(path, statement, "shape "//name//": expected a name of at most "//to_text(longest_name)// &
          & " characters without blanks, commas and quotes", error)
      else if (is_reserved_name(name)) then
        call refuse(path, statement, "shape "//name//": expected another name: grain, disk, sphere and plane stand for "// &
          & "themselves in bodies files", error)
      else if (find_shape(library, name) > 0) then
        call refuse(path, statement, "shape "//name//": expected a name that no shape above has", error)
      end if
    end associate
  end subroutine check_name

  !> Refuse a shape without pieces, or with a rounding that is not its first statement.
  subroutine check_order(path, statements, error)
    character(len=*), intent(in) :: path
    !> that of its name first
    type(statement_t), intent(in) :: statements(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    if (allocated(error)) return
    do k = 2, size(statements)
      if (statements(k)%word /= "rounding") cycle
      if (k > 2) call refuse(path, statements(k), "rounding: expected once, before the pieces of the shape", error)
      call check_count(path, statements(k), size(statements(k)%number) == 1, "one number", error)
      if (allocated(error)) return
      if (.not. is_size(statements(k)%number(1))) call refuse(path, statements(k), "rounding "//to_text(statements(k)%number(1))// &
        & ": expected "//size_text, error)
    end do
    if (size(statements) == 1 .or. statements(size(statements))%word == "rounding") &
      & call refuse(path, statements(1), "shape "//statements(1)%text//": expected a piece or several behind it", error)
  end subroutine check_order

  !> Make a shape of its statements.
  subroutine add_shape(path, statements, dimension, library, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statements(:)
    integer, intent(in) :: dimension
    type(shape_library_t), intent(inout) :: library
    type(error_t), allocatable, intent(inout) :: error
    type(body_shape_t) :: shape
    integer :: first

    if (allocated(error)) return
    first = 2
    if (statements(2)%word == "rounding") first = 3
    if (first == 3) then
      call make(statements(2)%number(1))
    else
      call make(0.0_dp)
      if (.not. allocated(error)) call make(usual_rounding*shape%size)
    end if
    if (allocated(error)) return
    if (.not. is_size(shape%size)) call refuse(path, statements(1), "shape "//shape%name//": a size of "//to_text(shape%size)// &
      & ": expected "//size_text, error)
    if (.not. allocated(error)) call library%add(shape)

  contains

    subroutine make(rounding)
      !> in the unit of the file; 0 for one that is small beside each piece
      real(dp), intent(in) :: rounding

      if (dimension == 2) then
        call make_flat(path, statements(1)%text, statements(first:), rounding, shape, error)
      else
        call make_solid(path, statements(1)%text, statements(first:), rounding, shape, error)
      end if
    end subroutine make

  end subroutine add_shape

  !> A rounding, or one that is small beside some points.
  pure real(dp) function rounding_of(rounding, points)
    !> 0 for none
    real(dp), intent(in) :: rounding
    !> (2 or 3, n)
    real(dp), intent(in) :: points(:, :)
    integer :: d

    rounding_of = rounding
    if (rounding > 0.0_dp) return
    do d = 1, size(points, 1)
      rounding_of = max(rounding_of, trial_rounding*(maxval(points(d, :)) - minval(points(d, :))))
    end do
  end function rounding_of

  !> Make a shape of the plane.
  subroutine make_flat(path, name, pieces, rounding, shape, error)
    character(len=*), intent(in) :: path, name
    type(statement_t), intent(in) :: pieces(:)
    !> of polygons, in the unit of the file; 0 for one that is small beside each
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(flat_piece_t) :: made(size(pieces))
    character(len=:), allocatable :: message
    real(dp), allocatable :: corner(:, :)
    integer :: k, n

    do k = 1, size(pieces)
      n = size(pieces(k)%number)
      if (is_generated(pieces(k)%word)) then
        call generate_corners(path, pieces(k), 2, corner, error)
      else
        call take_points(2, pieces(k)%number, corner)
      end if
      message = ""
      select case (pieces(k)%word)
      case ("polygon")
        call check_count(path, pieces(k), mod(n, 2) == 0 .and. n >= 6, "x and y of three corners or more", error)
        if (.not. allocated(error)) call polygon_piece(corner, rounding_of(rounding, corner), made(k), message)
      case ("regular", "random_hull")
        if (.not. allocated(error)) call polygon_piece(corner, rounding_of(rounding, corner), made(k), message)
      case ("disk")
        call check_count(path, pieces(k), n == 3, "x, y and a radius", error)
        call check_radius(path, pieces(k), error)
        if (.not. allocated(error)) call round_piece(corner, pieces(k)%number(n), made(k), message)
      case default
        call check_count(path, pieces(k), n == 5, "x and y of both ends and a radius", error)
        call check_radius(path, pieces(k), error)
        if (.not. allocated(error)) call round_piece(corner, pieces(k)%number(n), made(k), message)
      end select
      if (allocated(error)) return
      if (len(message) > 0) call refuse(path, pieces(k), "shape "//name//": "//message, error)
      if (allocated(error)) return
    end do
    call make_flat_shape(name, made, shape)
  end subroutine make_flat

  !> Make a shape of space.
  subroutine make_solid(path, name, pieces, rounding, shape, error)
    character(len=*), intent(in) :: path, name
    type(statement_t), intent(in) :: pieces(:)
    !> of pieces with corners, in the unit of the file; 0 for one that is small beside each
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(convex_piece_t) :: made(size(pieces))
    type(mass_t) :: mass(size(pieces)), whole
    real(dp) :: moment(3), axes(3, 3)
    integer :: k

    do k = 1, size(pieces)
      call make_solid_piece(path, name, pieces(k), rounding, made(k), mass(k), error)
      if (allocated(error)) return
    end do
    whole = mass_of_sum(mass)
    call make_shape(name, made, whole, shape, error)
    call find_principal_axes(whole%inertia, moment, axes)
    call find_quaternion(axes, shape%turn)
  end subroutine make_solid

  subroutine make_solid_piece(path, name, statement, rounding, piece, mass, error)
    character(len=*), intent(in) :: path, name
    type(statement_t), intent(in) :: statement
    real(dp), intent(in) :: rounding
    type(convex_piece_t), intent(out) :: piece
    type(mass_t), intent(out) :: mass
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: what
    real(dp), allocatable :: point(:, :)
    integer :: n

    n = size(statement%number)
    what = path//": line "//to_text(statement%line)//": shape "//name
    if (is_generated(statement%word)) then
      call generate_corners(path, statement, 3, point, error)
      if (allocated(error)) return
      call make_piece(what, point, rounding_of(rounding, point), piece, mass, error)
      return
    end if
    select case (statement%word)
    case ("hull")
      call check_count(path, statement, mod(n, 3) == 0 .and. n >= 12, "x, y and z of four corners or more", error)
      if (allocated(error)) return
      call take_points(3, statement%number, point)
      call make_piece(what, point, rounding_of(rounding, point), piece, mass, error)
    case ("box")
      call check_count(path, statement, n == 3 .or. n == 6, "three lengths, and perhaps x, y and z of the centre", error)
      if (allocated(error)) return
      if (.not. all(is_size(statement%number(1:3)))) call refuse(path, statement, "box with a length of "// &
        & to_text(minval(statement%number(1:3)))//": expected "//size_text, error)
      call take_box(statement%number, point)
      call make_piece(what, point, rounding_of(rounding, point), piece, mass, error)
    case ("file")
      call make_piece_of_file(what, statement, rounding, piece, mass, error)
    case default
      if (statement%word == "sphere") then
        call check_count(path, statement, n == 4, "x, y, z and a radius", error)
      else
        call check_count(path, statement, n == 7, "x, y and z of both ends and a radius", error)
      end if
      call check_radius(path, statement, error)
      if (allocated(error)) return
      allocate (point(3, 2))
      point(:, 1) = statement%number(1:3)
      point(:, 2) = statement%number(n - 3:n - 1)
      call make_capsule_piece(what, point, statement%number(n), piece, mass, error)
      if (statement%word == "capsule" .and. size(piece%vertex, 2) == 1 .and. .not. allocated(error)) &
        & call refuse(path, statement, "shape "//name//": a capsule of length 0: expected two ends", error)
    end select
  end subroutine make_solid_piece

  !> The piece that a file of a surface holds.
  subroutine make_piece_of_file(what, statement, rounding, piece, mass, error)
    !> it is, for messages
    character(len=*), intent(in) :: what
    type(statement_t), intent(in) :: statement
    real(dp), intent(in) :: rounding
    type(convex_piece_t), intent(out) :: piece
    type(mass_t), intent(out) :: mass
    type(error_t), allocatable, intent(inout) :: error
    type(sharp_polyhedron_t) :: surface
    integer :: n

    associate (path => statement%text)
      n = len(path)
      select case (lower(path(max(1, n - 3):)))
      case (".stl")
        call read_stl(path, surface%vertex, surface%face_first, surface%face_vertex, error)
      case (".obj")
        call read_obj(path, surface%vertex, surface%face_first, surface%face_vertex, error)
      case default
        call raise(error, status_input, what//": file "//path//": expected a path that ends with .stl or .obj")
      end select
      if (allocated(error)) then
        ! what is wrong with a file has its path; where it is asked for stands before
        if (index(error%message, what) /= 1) error%message = what//": "//error%message
        return
      end if
      if (.not. all(is_bounded(surface%vertex))) call raise(error, status_input, what//": "//path//": a coordinate of "// &
        & to_text(maxval(abs(surface%vertex)))//" in size: expected "//bounded_text)
      if (.not. allocated(error)) &
        & call make_piece_of_faces(what//": "//path, surface, rounding_of(rounding, surface%vertex), piece, mass, error)
    end associate
  end subroutine make_piece_of_file

  !> Points of their coordinates one after the other.
  pure subroutine take_points(dimension, number, point)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: number(:)
    real(dp), allocatable, intent(out) :: point(:, :)
    integer :: k

    allocate (point(dimension, size(number)/dimension))
    do k = 1, size(point, 2)
      point(:, k) = number(dimension*(k - 1) + 1:dimension*k)
    end do
  end subroutine take_points

  !> Corners of a box of three lengths, about the origin or about a point.
  pure subroutine take_box(number, point)
    !> (3 or 6)
    real(dp), intent(in) :: number(:)
    real(dp), allocatable, intent(out) :: point(:, :)
    integer :: k, d

    allocate (point(3, 8))
    do k = 1, 8
      do d = 1, 3
        point(d, k) = number(d)*(ibits(k - 1, d - 1, 1) - 0.5_dp)
        if (size(number) == 6) point(d, k) = point(d, k) + number(d + 3)
      end do
    end do
  end subroutine take_box

  !> The last number of a round piece.
  subroutine check_radius(path, statement, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    associate (radius => statement%number(size(statement%number)))
      if (.not. is_size(radius)) call refuse(path, statement, statement%word//" with a radius of "//to_text(radius)// &
        & ": expected "//size_text, error)
    end associate
  end subroutine check_radius

end module gravier_shapes_file
