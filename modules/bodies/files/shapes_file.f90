!> A library of shapes from a text file that a person can write: shapes by name, each made of one piece or of several.
module gravier_shapes_file
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_size, size_text
  use gravier_communicator, only: communicator_t
  use gravier_whole_file, only: read_whole_file
  use gravier_shape_library, only: body_shape_t, shape_library_t
  use gravier_shape_lookup, only: find_shape, is_reserved_name
  use gravier_polygon, only: flat_piece_t, polygon_piece, round_piece, make_flat_shape
  use gravier_shapes_text, only: statement_t, split_statements
  implicit none
  private
  public :: read_shapes, parse_shapes

  !> rounding of a shape that says none, over its size, and one that is small beside any piece, with which the size is found
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

    call read_whole_file(comm, path, "a text file of shapes", text, error)
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
    if (dimension == 3) then
      call refuse(path, statements(1), "shape "//statements(1)%text//": expected a scene in the plane", error)
      return
    end if
    if (first == 3) then
      call make_flat(path, statements(1)%text, statements(first:), statements(2)%number(1), shape, error)
    else
      call make_flat(path, statements(1)%text, statements(first:), trial_rounding*least_extent(statements(first:)), shape, error)
      if (.not. allocated(error)) &
        & call make_flat(path, statements(1)%text, statements(first:), usual_rounding*shape%size, shape, error)
    end if
    if (allocated(error)) return
    if (.not. is_size(shape%size)) call refuse(path, statements(1), "shape "//shape%name//": a size of "//to_text(shape%size)// &
      & ": expected "//size_text, error)
    call library%add(shape)
  end subroutine add_shape

  !> Least extent of the polygons among some pieces, each along its longer axis; any number where there are none.
  pure real(dp) function least_extent(pieces) result(extent)
    type(statement_t), intent(in) :: pieces(:)
    integer :: k, n

    extent = huge(1.0_dp)
    do k = 1, size(pieces)
      if (pieces(k)%word /= "polygon") cycle
      n = size(pieces(k)%number)
      associate (x => pieces(k)%number(1:n:2), y => pieces(k)%number(2:n:2))
        extent = min(extent, max(maxval(x) - minval(x), maxval(y) - minval(y)))
      end associate
    end do
    if (extent >= huge(1.0_dp)) extent = 1.0_dp
  end function least_extent

  !> Make a shape of the plane.
  subroutine make_flat(path, name, pieces, rounding, shape, error)
    character(len=*), intent(in) :: path, name
    type(statement_t), intent(in) :: pieces(:)
    !> of polygons, in the unit of the file
    real(dp), intent(in) :: rounding
    type(body_shape_t), intent(out) :: shape
    type(error_t), allocatable, intent(inout) :: error
    type(flat_piece_t) :: made(size(pieces))
    character(len=:), allocatable :: message
    real(dp), allocatable :: corner(:, :)
    integer :: k, n, c

    do k = 1, size(pieces)
      n = size(pieces(k)%number)
      allocate (corner(2, n/2))
      do c = 1, n/2
        corner(:, c) = pieces(k)%number(2*c - 1:2*c)
      end do
      message = ""
      select case (pieces(k)%word)
      case ("polygon")
        call check_count(path, pieces(k), mod(n, 2) == 0 .and. n >= 6, "x and y of three corners or more", error)
        if (.not. allocated(error)) call polygon_piece(corner, rounding, made(k), message)
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
      deallocate (corner)
    end do
    call make_flat_shape(name, made, shape)
  end subroutine make_flat

  subroutine check_count(path, statement, right, expected, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    logical, intent(in) :: right
    character(len=*), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    if (.not. right) call refuse(path, statement, statement%word//" with "//to_text(size(statement%number))// &
      & " numbers: expected "//expected, error)
  end subroutine check_count

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

  !> Raise an error about a statement.
  subroutine refuse(path, statement, what, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, path//": line "//to_text(statement%line)//": "//what)
  end subroutine refuse

end module gravier_shapes_file
