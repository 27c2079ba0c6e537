!> Surfaces of polygons as OBJ files hold them: lines "v x y z" and "f i j k ...". Textures, normals, names and groups are passed over.
module gravier_obj_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_narrow, only: narrow
  use gravier_number_text, only: read_integer, read_real, size_usual, size_tiny
  use gravier_text, only: to_text
  use gravier_file_lines, only: lines_t
  implicit none
  private
  public :: read_obj

contains

  !> Points and faces of a file. Failures (status_input): no such file, something that is no number, a face of fewer than three corners
  !> or of a point that there is not, no face.
  subroutine read_obj(path, points, first, corner, error)
    character(len=*), intent(in) :: path
    !> (3, n)
    real(dp), allocatable, intent(out) :: points(:, :)
    !> face f has the corners corner(first(f):first(f + 1) - 1)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    type(lines_t) :: lines
    integer :: counts(3)

    if (allocated(error)) return
    call lines%open(path, error)
    if (allocated(error)) return
    call count_lines(lines%text, counts)
    allocate (points(3, counts(1)), first(counts(2) + 1), corner(counts(3)))
    call read_lines(path, lines, points, first, corner, error)
    if (allocated(error)) return
    if (counts(2) == 0) call raise(error, status_input, path//": no line of a face, ""f i j k"", was found")
  end subroutine read_obj

  !> Points, faces, and corners of faces.
  subroutine count_lines(text, counts)
    character(len=*), intent(in) :: text
    integer, intent(out) :: counts(3)
    type(lines_t) :: lines

    counts(:) = 0
    lines%text = text
    do while (lines%next())
      select case (lines%word())
      case ("v")
        counts(1) = counts(1) + 1
      case ("f")
        counts(2) = counts(2) + 1
        do while (len(lines%word()) > 0)
          counts(3) = counts(3) + 1
        end do
      end select
    end do
  end subroutine count_lines

  subroutine read_lines(path, lines, points, first, corner, error)
    character(len=*), intent(in) :: path
    type(lines_t), intent(inout) :: lines
    real(dp), intent(out) :: points(:, :)
    integer, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word
    integer :: n, n_faces, n_corners, d, how

    n = 0
    n_faces = 0
    n_corners = 0
    first(1) = 1
    do while (lines%next())
      select case (lines%word())
      case ("v")
        n = n + 1
        do d = 1, 3
          word = lines%word()
          call read_real(word, points(d, n), how)
          if (how /= size_usual .and. how /= size_tiny) call refuse(""""//word//""", but a number was expected")
        end do
      case ("f")
        n_faces = n_faces + 1
        do
          word = lines%word()
          if (len(word) == 0) exit
          n_corners = n_corners + 1
          call read_corner(word, n, corner(n_corners))
          if (corner(n_corners) == 0) call refuse(""""//word//""", but the number of a point was expected, from 1 to "//to_text(n))
        end do
        first(n_faces + 1) = n_corners + 1
        if (n_corners + 1 - first(n_faces) < 3) call refuse("a face of "//to_text(n_corners + 1 - first(n_faces))// &
          & " corners, but 3 or more were expected")
      end select
      if (allocated(error)) return
    end do

  contains

    subroutine refuse(what)
      character(len=*), intent(in) :: what
      call raise(error, status_input, path//": line "//to_text(lines%number)//": "//what)
    end subroutine refuse

  end subroutine read_lines

  !> The point that "7", "7/1", "7/1/2" or "7//2" names; a number below 0 counts from the last point on. 0 where there is none.
  pure subroutine read_corner(word, n, point)
    character(len=*), intent(in) :: word
    !> points so far
    integer, intent(in) :: n
    integer, intent(out) :: point
    integer(i8) :: value
    integer :: length
    logical :: fits

    length = index(word, "/") - 1
    if (length < 0) length = len(word)
    call read_integer(word(1:length), value, fits)
    point = 0
    if (.not. fits) return
    if (value < 0) value = n + 1 + value
    if (value >= 1 .and. value <= n) point = narrow(value)
  end subroutine read_corner

end module gravier_obj_file
