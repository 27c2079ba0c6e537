!> Surfaces of triangles as STL files hold them, binary or ASCII. Their normals are not read: the order of the corners tells them.
module gravier_stl_file
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_narrow, only: narrow
  use gravier_number_text, only: read_real, size_usual, size_tiny
  use gravier_text, only: lower, to_text
  use gravier_file_lines, only: lines_t
  use, intrinsic :: iso_fortran_env, only: real32
  implicit none
  private
  public :: read_stl

  !> bytes of a binary file before the first triangle, and of a triangle
  integer, parameter :: head = 84, record = 50

contains

  !> Points and faces of a file; each triangle has three points of its own. Failures (status_input): no such file, neither of both
  !> formats, cut short, something that is no number, no triangle.
  subroutine read_stl(path, points, first, corner, error)
    character(len=*), intent(in) :: path
    !> (3, 3 n)
    real(dp), allocatable, intent(out) :: points(:, :)
    !> face f has the corners corner(first(f):first(f + 1) - 1)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    type(lines_t) :: lines
    integer :: n, k

    if (allocated(error)) return
    call lines%open(path, error)
    if (allocated(error)) return
    n = 0
    if (is_binary(lines%text)) then
      n = (len(lines%text) - head)/record
      allocate (points(3, 3*n))
      call read_binary(path, lines%text, points, error)
    else if (lower(lines%text(1:min(5, len(lines%text)))) == "solid" .and. index(lines%text, achar(0)) == 0) then
      n = count_vertices(lines%text)
      allocate (points(3, n))
      n = n/3
      call read_ascii(path, lines, points, error)
    else
      call raise(error, status_input, path//": no STL file: it is no text that begins with ""solid"", and its length of "// &
        & to_text(len(lines%text))//" bytes is not that of a binary file"//length_of(lines%text))
    end if
    if (allocated(error)) return
    if (n == 0) call raise(error, status_input, path//": no triangle")
    allocate (first(n + 1), corner(3*n))
    do k = 1, n + 1
      first(k) = 3*k - 2
    end do
    do k = 1, 3*n
      corner(k) = k
    end do
  end subroutine read_stl

  !> Whether the length of a file is that which a binary one of so many triangles as it tells has.
  pure logical function is_binary(text)
    character(len=*), intent(in) :: text

    is_binary = .false.
    if (len(text) < head) return
    is_binary = word_at(text, head - 3)*record + head == len(text)
  end function is_binary

  !> What the length of a binary file with so many triangles as it tells is, in words.
  pure function length_of(text) result(words)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: words

    words = ""
    if (len(text) < head) return
    words = " of "//to_text(word_at(text, head - 3))//" triangles, "//to_text(word_at(text, head - 3)*record + head)
  end function length_of

  !> The whole number of four bytes, the lowest first.
  pure integer(i8) function word_at(text, place) result(word)
    character(len=*), intent(in) :: text
    integer, intent(in) :: place
    integer :: k

    word = 0
    do k = 3, 0, -1
      word = 256*word + iachar(text(place + k:place + k))
    end do
  end function word_at

  !> The real number of four bytes, the lowest first.
  pure real(dp) function real_at(text, place) result(x)
    character(len=*), intent(in) :: text
    integer, intent(in) :: place
    integer(i8) :: word
    real(real32), parameter :: single = 0.0_real32

    word = word_at(text, place)
    if (word > huge(0_i4)) word = word - 2_i8**32
    x = 0.0_dp
    ! -0.0, whose bits are the one number that is no integer of 32 bits here
    if (word == -2_i8**31) return
    ! what is not finite has all bits of the exponent
    x = huge(x)
    if (ibits(word, 23, 8) == 255) return
    x = real(transfer(narrow(word), single), dp)
  end function real_at

  subroutine read_binary(path, text, points, error)
    character(len=*), intent(in) :: path, text
    real(dp), intent(out) :: points(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, d, place

    do k = 1, size(points, 2)
      ! three reals of a normal, three corners, two bytes
      place = head + record*((k - 1)/3) + 12 + 12*mod(k - 1, 3)
      do d = 1, 3
        points(d, k) = real_at(text, place + 4*d - 3)
        if (points(d, k) < huge(1.0_dp)) cycle
        call raise(error, status_input, path//": triangle "//to_text((k - 1)/3 + 1)//": a coordinate that is not finite")
        return
      end do
    end do
  end subroutine read_binary

  !> Lines that begin with the word vertex.
  integer function count_vertices(text) result(n)
    character(len=*), intent(in) :: text
    type(lines_t) :: lines

    n = 0
    lines%text = text
    do while (lines%next())
      if (lower(lines%word()) == "vertex") n = n + 1
    end do
  end function count_vertices

  subroutine read_ascii(path, lines, points, error)
    character(len=*), intent(in) :: path
    type(lines_t), intent(inout) :: lines
    real(dp), intent(out) :: points(:, :)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: word
    integer :: in_facet, n, d, how
    logical :: open_facet

    n = 0
    in_facet = 0
    open_facet = .false.
    do while (lines%next())
      word = lower(lines%word())
      select case (word)
      case ("facet")
        if (open_facet) call refuse("a facet within a facet, but endfacet was expected")
        in_facet = 0
        open_facet = .true.
      case ("endfacet")
        if (.not. open_facet) call refuse("endfacet without a facet")
        open_facet = .false.
        if (in_facet /= 3) call refuse("a facet of "//to_text(in_facet)//" corners, but 3 were expected")
      case ("vertex")
        in_facet = in_facet + 1
        n = n + 1
        if (.not. open_facet) call refuse("a corner outside of a facet")
        if (in_facet > 3) call refuse("a fourth corner of a facet, but 3 were expected")
        if (allocated(error)) return
        do d = 1, 3
          word = lines%word()
          call read_real(word, points(d, n), how)
          if (how /= size_usual .and. how /= size_tiny) call refuse(""""//word//""", but a number was expected")
        end do
        word = lines%word()
        if (word /= "") call refuse(""""//word//""" after the three numbers of a corner")
      case ("", "solid", "outer", "endloop", "endsolid")
        continue
      case default
        call refuse(""""//word//""", but facet, outer loop, vertex, endloop, endfacet or endsolid was expected")
      end select
      if (allocated(error)) return
    end do
    if (open_facet) call refuse("the file ends within a facet")

  contains

    subroutine refuse(what)
      character(len=*), intent(in) :: what
      call raise(error, status_input, path//": line "//to_text(lines%number)//": "//what)
    end subroutine refuse

  end subroutine read_ascii

end module gravier_stl_file
