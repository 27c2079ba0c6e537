!> The text form of a library of shapes, as statements: a word and what belongs to it.
!>
!> A statement begins with its word at the start of a line. Its numbers may go over several lines, each of which then begins with a
!> number. Blank lines and what follows a # are passed over.
module gravier_shapes_text
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_number_text, only: number_size, read_real, not_a_number, size_huge
  implicit none
  private
  public :: statement_t, split_statements, check_count, refuse_statement

  !> One statement of a file of shapes.
  type :: statement_t
    !> where it begins
    integer :: line = 0
    character(len=:), allocatable :: word
    !> the name of a shape, the path of a file; otherwise empty
    character(len=:), allocatable :: text
    !> (n)
    real(dp), allocatable :: number(:)
  end type statement_t

  !> Statements as they are read.
  type :: reader_t
    character(len=:), allocatable :: path, expected
    integer :: line = 0, n = 0
    type(statement_t), allocatable :: statement(:)
    !> numbers of the last statement, the first `n_numbers` of them
    real(dp), allocatable :: number(:)
    integer :: n_numbers = 0
  end type reader_t

  character(len=*), parameter :: blanks = " "//achar(9)//achar(13)
  !> put by some programs before UTF-8 text
  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

contains

  !> Words with which a statement may begin.
  pure subroutine get_words(dimension, words)
    !> 2 or 3
    integer, intent(in) :: dimension
    character(len=12), allocatable, intent(out) :: words(:)

    if (dimension == 2) then
      allocate (words(7))
      words(:) = [character(len=12) :: "shape", "rounding", "polygon", "disk", "capsule", "regular", "random_hull"]
    else
      allocate (words(13))
      words(:) = [character(len=12) :: "shape", "rounding", "hull", "box", "sphere", "capsule", "file", "tetrahedron", "cube", &
        & "octahedron", "dodecahedron", "icosahedron", "random_hull"]
    end if
  end subroutine get_words

  !> Cut a text into statements. Failure: status_input, with file, line, what was found and what was expected.
  subroutine split_statements(path, text, dimension, statements, error)
    !> for messages
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension
    type(statement_t), allocatable, intent(out) :: statements(:)
    type(error_t), allocatable, intent(inout) :: error
    type(reader_t) :: reader
    character(len=12), allocatable :: words(:)
    integer :: at, length, last

    call get_words(dimension, words)
    reader%path = path
    reader%expected = listed(words)
    allocate (reader%statement(16), reader%number(16))
    at = 1
    if (index(text, byte_order_mark) == 1) at = 1 + len(byte_order_mark)
    do while (at <= len(text) .and. .not. allocated(error))
      length = index(text(at:), new_line("a")) - 1
      if (length < 0) length = len(text) - at + 1
      reader%line = reader%line + 1
      last = index(text(at:at + length - 1), "#") - 1
      if (last < 0) last = length
      call read_line(reader, words, text(at:at + last - 1), error)
      at = at + length + 1
    end do
    call end_statement(reader)
    statements = reader%statement(1:reader%n)
  end subroutine split_statements

  pure function listed(words) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=:), allocatable :: text
    integer :: k

    text = trim(words(1))
    do k = 2, size(words)
      if (k < size(words)) text = text//", "//trim(words(k))
    end do
    text = text//" or "//trim(words(size(words)))
  end function listed

  !> Take what a line says.
  subroutine read_line(reader, words, line, error)
    type(reader_t), intent(inout) :: reader
    character(len=*), intent(in) :: words(:), line
    type(error_t), allocatable, intent(inout) :: error
    integer :: first, last, final

    first = verify(line, blanks)
    if (first == 0) return
    last = scan(line(first:), blanks) + first - 2
    if (last < first) last = len(line)
    final = verify(line, blanks, back=.true.)
    if (number_size(line(first:last)) /= not_a_number) then
      if (reader%n == 0) then
        call refuse(reader, '"'//line(first:last)//'": expected shape and a name before any number', error)
      else if (takes_text(reader%statement(reader%n)%word)) then
        call refuse(reader, '"'//line(first:last)//'": expected '//reader%expected, error)
      else
        call read_numbers(reader, line(first:), error)
      end if
    else if (.not. any(words == line(first:last))) then
      call refuse(reader, '"'//line(first:last)//'": expected '//reader%expected, error)
    else
      call begin_statement(reader, line(first:last))
      if (takes_text(line(first:last))) then
        reader%statement(reader%n)%text = line(last + verify(line(last + 1:final)//"x", blanks):final)
      else
        call read_numbers(reader, line(last + 1:), error)
      end if
    end if
  end subroutine read_line

  pure logical function takes_text(word)
    character(len=*), intent(in) :: word
    takes_text = word == "shape" .or. word == "file"
  end function takes_text

  subroutine begin_statement(reader, word)
    type(reader_t), intent(inout) :: reader
    character(len=*), intent(in) :: word
    type(statement_t), allocatable :: more(:)

    call end_statement(reader)
    if (reader%n == size(reader%statement)) then
      allocate (more(2*reader%n))
      more(1:reader%n) = reader%statement
      call move_alloc(more, reader%statement)
    end if
    reader%n = reader%n + 1
    reader%statement(reader%n)%line = reader%line
    reader%statement(reader%n)%word = word
    reader%statement(reader%n)%text = ""
  end subroutine begin_statement

  !> Give the last statement its numbers.
  subroutine end_statement(reader)
    type(reader_t), intent(inout) :: reader

    if (reader%n > 0) reader%statement(reader%n)%number = reader%number(1:reader%n_numbers)
    reader%n_numbers = 0
  end subroutine end_statement

  !> The numbers of a line.
  subroutine read_numbers(reader, line, error)
    type(reader_t), intent(inout) :: reader
    character(len=*), intent(in) :: line
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: more(:)
    real(dp) :: value
    integer :: first, last, size_of

    last = 0
    do
      first = last + verify(line(last + 1:), blanks)
      if (first == last .or. allocated(error)) return
      last = first + scan(line(first:)//" ", blanks) - 2
      call read_real(line(first:last), value, size_of)
      if (size_of == not_a_number) then
        call refuse(reader, '"'//line(first:last)//'": expected a finite number', error)
      else if (size_of == size_huge .or. .not. is_bounded(value)) then
        call refuse(reader, '"'//line(first:last)//'": expected '//bounded_text, error)
      end if
      if (reader%n_numbers == size(reader%number)) then
        allocate (more(2*reader%n_numbers))
        more(1:reader%n_numbers) = reader%number
        call move_alloc(more, reader%number)
      end if
      reader%n_numbers = reader%n_numbers + 1
      reader%number(reader%n_numbers) = value
    end do
  end subroutine read_numbers

  !> Raise an error about the line being read.
  subroutine refuse(reader, what, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, reader%path//": line "//to_text(reader%line)//": "//what)
  end subroutine refuse

  !> Refuse a statement that has not as many numbers as it should.
  subroutine check_count(path, statement, right, expected, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    logical, intent(in) :: right
    character(len=*), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    if (.not. right) call refuse_statement(path, statement, statement%word//" with "//to_text(size(statement%number))// &
      & " numbers: expected "//expected, error)
  end subroutine check_count

  !> Raise an error about a statement.
  subroutine refuse_statement(path, statement, what, error)
    character(len=*), intent(in) :: path
    type(statement_t), intent(in) :: statement
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, path//": line "//to_text(statement%line)//": "//what)
  end subroutine refuse_statement

end module gravier_shapes_text
