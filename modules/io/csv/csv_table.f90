!> Reading of comma-separated tables line by line: a header with the names of the columns, then rows. Blank lines and
!> lines that begin with # are passed over; lines may end in CR LF. A first line "# checksum" with 16 hexadecimal digits seals the
!> table: it is refused where what follows is not what it was. Not collective.
module gravier_csv_table
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, lower
  use gravier_random_hash, only: hash_rows
  use gravier_number_text, only: read_integer, read_real, size_usual, size_tiny, size_huge
  use gravier_file_system, only: check_readable
  implicit none
  private
  public :: csv_table_t

  integer, parameter :: block_length = 65536
  character(len=*), parameter :: checksum_mark = "# checksum "
  integer, parameter :: bytes_of_word = 8
  !> put by some programs before UTF-8 text
  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

  !> An open table, standing on one of its rows.
  type :: csv_table_t
    private
    character(len=:), allocatable :: path
    integer :: unit = -1
    !> bytes of the file, and how many of them have been read into `block`
    integer(i8) :: length = 0
    integer(i8) :: position = 0
    character(len=:), allocatable :: block
    integer :: block_fill = 0
    integer :: block_next = 1
    !> the line read last is line(1:line_length)
    character(len=:), allocatable :: line
    integer :: line_length = 0
    integer(i8) :: line_number = 0
    !> whether its first line has a checksum, that, and that of the lines read since
    logical :: sealed = .false.
    integer(i8) :: written = 0, found = 0
    !> names of the columns
    character(len=:), allocatable :: header
    integer :: n_columns = 0
    !> cell k of the row is line(first(k):last(k))
    integer, allocatable :: first(:), last(:)
    integer, allocatable :: header_first(:), header_last(:)
  contains
    procedure :: open => table_open
    procedure :: close => table_close
    procedure :: next_row => table_next_row
    procedure :: column_count => table_column_count
    procedure :: column_name => table_column_name
    procedure :: column => table_column
    procedure :: is_empty => table_is_empty
    procedure :: get_text => table_get_text
    procedure :: get_integer => table_get_integer
    procedure :: get_real => table_get_real
    procedure :: refuse => table_refuse
    procedure :: refuse_file => table_refuse_file
    procedure, private :: next_line
    procedure, private :: read_block
    procedure, private :: append_to_line
    procedure, private :: check_line
    procedure, private :: read_header
    procedure, private :: split
  end type csv_table_t

contains

  !> Open a table and read its header. Failure (status_input): no such file, not readable, no header, two columns of
  !> one name.
  subroutine table_open(self, path, error)
    class(csv_table_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    character(len=200) :: reason
    integer :: stat

    if (allocated(error)) return
    call self%close()
    self%path = path
    call check_readable(path, error)
    if (allocated(error)) return
    open (newunit=self%unit, file=path, access="stream", form="unformatted", action="read", status="old", &
      & iostat=stat, iomsg=reason)
    if (stat /= 0) then
      self%unit = -1
      call self%refuse_file("cannot read this file: "//trim(reason), error)
      return
    end if
    inquire (unit=self%unit, size=self%length)
    self%position = 0
    self%block_fill = 0
    self%block_next = 1
    self%line_number = 0
    self%sealed = .false.
    self%found = 0
    if (.not. allocated(self%block)) allocate (character(len=block_length) :: self%block)
    if (.not. allocated(self%line)) allocate (character(len=256) :: self%line)
    call self%read_header(error)
    if (allocated(error)) call self%close()
  end subroutine table_open

  subroutine table_close(self)
    class(csv_table_t), intent(inout) :: self
    if (self%unit /= -1) close (self%unit)
    self%unit = -1
  end subroutine table_close

  !> Take the names of the columns from the first line that counts.
  subroutine read_header(self, error)
    class(csv_table_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    logical :: found
    integer :: k

    call self%next_line(found, error)
    if (allocated(error)) return
    if (.not. found) then
      call self%refuse_file("empty; a first line with the names of the columns was expected", error)
      return
    end if
    call self%split()
    self%n_columns = size(self%first)
    self%header = lower(self%line(1:self%line_length))
    call move_alloc(self%first, self%header_first)
    call move_alloc(self%last, self%header_last)
    do k = 1, self%n_columns
      if (self%column(self%column_name(k)) /= k) then
        call self%refuse_file("column "//self%column_name(k)//" appears twice", error)
        return
      end if
    end do
  end subroutine read_header

  !> Go to the next row; `found` is false at the end of the table. Failure (status_input): a row that has not as many
  !> cells as the header, a file that cannot be read.
  subroutine table_next_row(self, found, error)
    class(csv_table_t), intent(inout) :: self
    logical, intent(out) :: found
    type(error_t), allocatable, intent(inout) :: error

    found = .false.
    if (allocated(error)) return
    call self%next_line(found, error)
    if (.not. found .or. allocated(error)) return
    call self%split()
    if (size(self%first) /= self%n_columns) then
      call raise(error, status_input, self%path//": line "//to_text(self%line_number)//": "//to_text(size(self%first))// &
        & " cells, but the header has "//to_text(self%n_columns))
      found = .false.
    end if
  end subroutine table_next_row

  !> Read the next line that is neither blank nor a comment.
  subroutine next_line(self, found, error)
    class(csv_table_t), intent(inout) :: self
    logical, intent(out) :: found
    type(error_t), allocatable, intent(inout) :: error
    integer :: newline, first

    do
      self%line_length = 0
      found = .false.
      do
        if (self%block_next > self%block_fill) call self%read_block(error)
        if (allocated(error) .or. self%block_fill == 0) exit
        found = .true.
        newline = index(self%block(self%block_next:self%block_fill), new_line("a"))
        if (newline > 0) then
          call self%append_to_line(newline - 1)
          self%block_next = self%block_next + 1
          exit
        end if
        call self%append_to_line(self%block_fill - self%block_next + 1)
      end do
      if (allocated(error) .or. .not. found) exit
      self%line_number = self%line_number + 1
      call self%check_line()
      first = verify(self%line(1:self%line_length), " "//achar(9)//achar(13))
      if (first == 0) cycle
      if (self%line(first:first) /= "#") exit
    end do
    if (allocated(error)) found = .false.
    if (.not. found .and. self%sealed .and. self%found /= self%written) call self%refuse_file( &
      & "the checksum of its first line is not that of the others: the file is damaged, or was changed since it was sealed", error)
  end subroutine next_line

  !> Take a checksum from the first line, and add the others to theirs.
  subroutine check_line(self)
    class(csv_table_t), intent(inout) :: self
    integer(i8) :: words(self%line_length/bytes_of_word + 2, 1)
    character(len=bytes_of_word) :: letters
    integer :: k, stat

    if (self%line_number == 1) then
      if (index(self%line(1:self%line_length), checksum_mark) /= 1) return
      letters = ""
      associate (digits => self%line(len(checksum_mark) + 1:self%line_length))
        ! a seal that is damaged is that of no table
        stat = 0
        self%written = not(self%found)
        if (len_trim(digits) == 16 .and. verify(trim(digits), "0123456789abcdef") == 0) &
          & read (digits, "(z16)", iostat=stat) self%written
      end associate
      self%sealed = stat == 0
    else if (self%sealed) then
      do k = 1, size(words, 1) - 1
        letters = self%line(min((k - 1)*bytes_of_word, self%line_length) + 1:min(k*bytes_of_word, self%line_length))
        words(k, 1) = transfer(letters, 0_i8)
      end do
      ! blanks that fill up the last word are told from those of the line
      words(size(words, 1), 1) = self%line_length
      self%found = ieor(self%found, hash_rows(words, self%line_number))
    end if
  end subroutine check_line

  !> Move `n` characters from the block to the end of the line.
  subroutine append_to_line(self, n)
    class(csv_table_t), intent(inout) :: self
    integer, intent(in) :: n
    character(len=:), allocatable :: longer

    if (self%line_length + n > len(self%line)) then
      allocate (character(len=2*(self%line_length + n)) :: longer)
      longer(1:self%line_length) = self%line(1:self%line_length)
      call move_alloc(longer, self%line)
    end if
    self%line(self%line_length + 1:self%line_length + n) = self%block(self%block_next:self%block_next + n - 1)
    self%line_length = self%line_length + n
    self%block_next = self%block_next + n
  end subroutine append_to_line

  !> Read the next block of the file; block_fill = 0 at its end.
  subroutine read_block(self, error)
    class(csv_table_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    character(len=200) :: reason
    integer :: stat

    self%block_next = 1
    self%block_fill = narrow(min(int(block_length, i8), self%length - self%position))
    if (self%block_fill <= 0) then
      self%block_fill = 0
      return
    end if
    read (self%unit, iostat=stat, iomsg=reason) self%block(1:self%block_fill)
    if (stat /= 0) call self%refuse_file("cannot read this file: "//trim(reason), error)
    if (self%position == 0 .and. index(self%block(1:self%block_fill), byte_order_mark) == 1) then
      self%block_next = 1 + len(byte_order_mark)
    end if
    self%position = self%position + self%block_fill
  end subroutine read_block

  !> Find the cells of the line, without the blanks around them.
  subroutine split(self)
    class(csv_table_t), intent(inout) :: self
    integer :: i, k, n, start

    n = 1
    do i = 1, self%line_length
      if (self%line(i:i) == ",") n = n + 1
    end do
    if (allocated(self%first)) then
      if (size(self%first) /= n) deallocate (self%first, self%last)
    end if
    if (.not. allocated(self%first)) allocate (self%first(n), self%last(n))
    start = 1
    do k = 1, n
      i = index(self%line(start:self%line_length), ",")
      if (i == 0) i = self%line_length - start + 2
      self%first(k) = start
      self%last(k) = start + i - 2
      do while (self%first(k) <= self%last(k))
        if (.not. is_blank(self%line(self%first(k):self%first(k)))) exit
        self%first(k) = self%first(k) + 1
      end do
      do while (self%first(k) <= self%last(k))
        if (.not. is_blank(self%line(self%last(k):self%last(k)))) exit
        self%last(k) = self%last(k) - 1
      end do
      start = start + i
    end do
  end subroutine split

  elemental logical function is_blank(letter)
    character(len=1), intent(in) :: letter
    is_blank = letter == " " .or. letter == achar(9) .or. letter == achar(13)
  end function is_blank

  pure integer function table_column_count(self) result(n)
    class(csv_table_t), intent(in) :: self
    n = self%n_columns
  end function table_column_count

  !> Name of column k in lower case.
  pure function table_column_name(self, k) result(name)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k
    character(len=:), allocatable :: name
    name = self%header(self%header_first(k):self%header_last(k))
  end function table_column_name

  !> Place of the column `name`, or 0 where there is none.
  pure integer function table_column(self, name) result(k)
    class(csv_table_t), intent(in) :: self
    character(len=*), intent(in) :: name

    do k = 1, self%n_columns
      if (self%column_name(k) == name) return
    end do
    k = 0
  end function table_column

  !> True when the row has nothing in column k, or when k = 0: there is no such column.
  pure logical function table_is_empty(self, k) result(is_empty)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k

    is_empty = .true.
    if (k > 0) is_empty = self%first(k) > self%last(k)
  end function table_is_empty

  !> What the row has in column k.
  pure function table_get_text(self, k) result(text)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k
    character(len=:), allocatable :: text
    text = self%line(self%first(k):self%last(k))
  end function table_get_text

  !> The integer in column k.
  subroutine table_get_integer(self, k, value, error)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k
    integer(i8), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: found
    logical :: fits

    if (allocated(error)) return
    call read_integer(self%get_text(k), found, fits)
    if (fits) value = found
    if (.not. fits) call self%refuse(k, "a whole number of at most 18 digits", error)
  end subroutine table_get_integer

  !> The finite real in column k.
  subroutine table_get_real(self, k, value, error)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k
    real(dp), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: found
    integer :: size

    if (allocated(error)) return
    call read_real(self%get_text(k), found, size)
    select case (size)
    case (size_usual, size_tiny)
      value = found
    case (size_huge)
      call self%refuse(k, "a number of at most 1.7976931348623157e308 in size", error)
    case default
      call self%refuse(k, "a finite number", error)
    end select
  end subroutine table_get_real

  !> Raise an error about the cell in column k of the row: file, line, column, value, and what was expected.
  subroutine table_refuse(self, k, expected, error)
    class(csv_table_t), intent(in) :: self
    integer, intent(in) :: k
    character(len=*), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: found

    found = "empty"
    if (.not. self%is_empty(k)) found = '"'//self%get_text(k)//'"'
    call raise(error, status_input, self%path//": line "//to_text(self%line_number)//": column "//self%column_name(k)//": "// &
      & found//", but "//expected//" was expected")
  end subroutine table_refuse

  !> Raise an error about the whole file.
  subroutine table_refuse_file(self, what, error)
    class(csv_table_t), intent(in) :: self
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, self%path//": "//what)
  end subroutine table_refuse_file

end module gravier_csv_table
