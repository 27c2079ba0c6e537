!> Statements of a library of shapes that say corners without writing them: regular polygons, Platonic solids, random stones.
module gravier_shapes_words
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_size, size_text
  use gravier_shapes_text, only: statement_t, check_count, refuse_statement
  use gravier_known_corners, only: regular_polygon, platonic_solid, random_polygon, random_polyhedron
  implicit none
  private
  public :: is_generated, generate_corners

  character(len=*), parameter :: solids(5) = &
    & [character(len=12) :: "tetrahedron", "cube", "octahedron", "dodecahedron", "icosahedron"]
  integer, parameter :: most_corners = 1000, largest_seed = huge(1)

contains

  !> Whether a word stands for corners.
  pure logical function is_generated(word)
    character(len=*), intent(in) :: word
    is_generated = any(solids == word) .or. word == "regular" .or. word == "random_hull"
  end function is_generated

  !> The corners that a statement stands for, about the origin or about the point that its last numbers are. Failure: status_input,
  !> with file, line, what was found and what was expected.
  subroutine generate_corners(path, statement, dimension, corner, error)
    !> for messages
    character(len=*), intent(in) :: path
    !> its word is generated
    type(statement_t), intent(in) :: statement
    integer, intent(in) :: dimension
    !> (dimension, corners)
    real(dp), allocatable, intent(out) :: corner(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: needed, k

    associate (number => statement%number, point => merge("x and y   ", "x, y and z", dimension == 2))
      select case (statement%word)
      case ("regular")
        needed = 2
        call check(needed, "a number of corners and a radius, and perhaps "//trim(point)//" of the centre")
        call check_whole(path, statement, 1, "corners", 3, most_corners, error)
        call check_sizes(path, statement, 2, 2, error)
        if (allocated(error)) return
        call regular_polygon(nint(number(1)), number(2), corner)
      case ("random_hull")
        needed = 2 + dimension
        call check(needed, "a seed, a number of corners and "//to_text(dimension)//" half-axes, and perhaps "//trim(point)// &
          & " of the centre")
        call check_whole(path, statement, 1, "a seed", 0, largest_seed, error)
        call check_whole(path, statement, 2, "corners", dimension + 1, most_corners, error)
        call check_sizes(path, statement, 3, needed, error)
        if (allocated(error)) return
        if (dimension == 2) then
          call random_polygon(nint(number(1)), nint(number(2)), number(3:4), corner)
        else
          call random_polyhedron(nint(number(1)), nint(number(2)), number(3:5), corner)
        end if
      case default
        needed = 1
        call check(needed, "a radius, and perhaps "//trim(point)//" of the centre")
        call check_sizes(path, statement, 1, 1, error)
        if (allocated(error)) return
        call platonic_solid(statement%word, number(1), corner)
      end select
      if (size(number) == needed) return
      do k = 1, size(corner, 2)
        corner(:, k) = corner(:, k) + number(needed + 1:)
      end do
    end associate

  contains

    subroutine check(needed, expected)
      integer, intent(in) :: needed
      character(len=*), intent(in) :: expected
      integer :: n

      n = size(statement%number)
      call check_count(path, statement, n == needed .or. n == needed + dimension, expected, error)
    end subroutine check

  end subroutine generate_corners

  !> Refuse a number that is not whole, or out of bounds.
  subroutine check_whole(path, statement, k, what, least, most, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    !> place of the number
    integer, intent(in) :: k
    !> it is
    character(len=*), intent(in) :: what
    integer, intent(in) :: least, most
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    associate (x => statement%number(k))
      if (x >= least .and. x <= most) then
        if (.not. abs(x - anint(x)) > 0.0_dp) return
      end if
      call refuse_statement(path, statement, statement%word//" with "//what//" "//to_text(x, 6)// &
        & ": expected a whole number from "//to_text(least)//" to "//to_text(most), error)
    end associate
  end subroutine check_whole

  !> Refuse lengths that are not above 0.
  subroutine check_sizes(path, statement, first, last, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    !> places of the lengths
    integer, intent(in) :: first, last
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    if (allocated(error)) return
    do k = first, last
      if (.not. is_size(statement%number(k))) call refuse_statement(path, statement, statement%word//" with a length of "// &
        & to_text(statement%number(k))//": expected "//size_text, error)
    end do
  end subroutine check_sizes

end module gravier_shapes_words
