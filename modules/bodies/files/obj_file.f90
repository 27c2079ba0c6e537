!> Surfaces of polygons as OBJ files hold them: lines "v x y z" and "f i j k ..."; and lines through points, "l i j k ...".
!> Textures, normals, names, groups and comments are passed over.
module gravier_obj_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_narrow, only: narrow
  use gravier_number_text, only: read_integer, read_real, size_usual, size_tiny
  use gravier_text, only: to_text
  use gravier_file_lines, only: lines_t
  implicit none
  private
  public :: read_obj, read_obj_lines

contains

  !> Points and faces of a file. Failures (status_input): no such file, something that is no number, a face of fewer than three
  !> corners or of a point that there is not, no face.
  subroutine read_obj(path, points, first, corner, error)
    character(len=*), intent(in) :: path
    !> (3, n)
    real(dp), allocatable, intent(out) :: points(:, :)
    !> face f has the corners corner(first(f):first(f + 1) - 1)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error

    call read_elements(path, "f", points, first, corner, error)
    if (allocated(error)) return
    if (size(first) == 1) call raise(error, status_input, path//": no line of a face, ""f i j k"", was found")
  end subroutine read_obj

  !> Points of a file and lines through them. Failures (status_input): no such file, something that is no number, a line of fewer
  !> than two points or of one that there is not, no line.
  subroutine read_obj_lines(path, points, first, corner, error)
    character(len=*), intent(in) :: path
    !> (3, n)
    real(dp), allocatable, intent(out) :: points(:, :)
    !> line k goes through the points corner(first(k):first(k + 1) - 1)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error

    call read_elements(path, "l", points, first, corner, error)
    if (allocated(error)) return
    if (size(first) == 1) call raise(error, status_input, path//": no line through points, ""l i j"", was found")
  end subroutine read_obj_lines

  !> Points of a file and its elements of a kind, by the letter of that.
  subroutine read_elements(path, letter, points, first, corner, error)
    character(len=*), intent(in) :: path
    character(len=1), intent(in) :: letter
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    type(lines_t) :: lines
    integer :: counts(3)

    if (allocated(error)) return
    call lines%open(path, error)
    if (allocated(error)) return
    call count_lines(lines%text, letter, counts)
    allocate (points(3, counts(1)), first(counts(2) + 1), corner(counts(3)))
    call read_lines(path, letter, lines, points, first, corner, error)
  end subroutine read_elements

  !> Points, elements of a kind, and corners of these.
  subroutine count_lines(text, letter, counts)
    character(len=*), intent(in) :: text
    character(len=1), intent(in) :: letter
    integer, intent(out) :: counts(3)
    type(lines_t) :: lines
    character(len=:), allocatable :: word

    counts(:) = 0
    lines%text = text
    do while (lines%next())
      word = lines%word()
      if (word == "v") then
        counts(1) = counts(1) + 1
      else if (word == letter) then
        counts(2) = counts(2) + 1
        do while (.not. ends(lines%word()))
          counts(3) = counts(3) + 1
        end do
      end if
    end do
  end subroutine count_lines

  subroutine read_lines(path, letter, lines, points, first, corner, error)
    character(len=*), intent(in) :: path
    character(len=1), intent(in) :: letter
    type(lines_t), intent(inout) :: lines
    real(dp), intent(out) :: points(:, :)
    integer, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word
    integer :: n, n_faces, n_corners, d, how, least

    n = 0
    n_faces = 0
    n_corners = 0
    first(1) = 1
    least = merge(2, 3, letter == "l")
    do while (lines%next())
      word = lines%word()
      if (word == "v") then
        n = n + 1
        do d = 1, 3
          word = lines%word()
          call read_real(word, points(d, n), how)
          if (how /= size_usual .and. how /= size_tiny) call refuse(""""//word//""", but a number was expected")
        end do
      else if (word == letter) then
        n_faces = n_faces + 1
        do
          word = lines%word()
          if (ends(word)) exit
          n_corners = n_corners + 1
          call read_corner(word, n, corner(n_corners))
          if (corner(n_corners) == 0) call refuse(""""//word//""", but the number of a point was expected, from 1 to "//to_text(n))
        end do
        first(n_faces + 1) = n_corners + 1
        if (n_corners + 1 - first(n_faces) < least) call refuse(trim(merge("a line of", "a face of", letter == "l"))//" "// &
          & to_text(n_corners + 1 - first(n_faces))//" corners, but "//to_text(least)//" or more were expected")
      end if
      if (allocated(error)) return
    end do

  contains

    subroutine refuse(what)
      character(len=*), intent(in) :: what
      call raise(error, status_input, path//": line "//to_text(lines%number)//": "//what)
    end subroutine refuse

  end subroutine read_lines

  !> Whether a line has no more words, or a comment from here on.
  pure logical function ends(word)
    character(len=*), intent(in) :: word

    ends = len(word) == 0
    if (.not. ends) ends = word(1:1) == "#"
  end function ends

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
