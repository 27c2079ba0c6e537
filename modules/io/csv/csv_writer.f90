!> Tables as comma-separated text, one line a row, on the disk as soon as the row is complete. Not collective: one rank
!> writes, and what fails is to be made known to the others by the caller.
module gravier_csv_writer
  use gravier_kinds, only: dp, i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_number_text, only: number_size, not_a_number
  use gravier_finite, only: is_finite
  use gravier_file_system, only: check_readable, file_length
  use gravier_text_file, only: text_file_t
  implicit none
  private
  public :: csv_writer_t, csv_option_t

  !> A logical option of the input with which a table has columns more, and the first of them.
  type :: csv_option_t
    character(len=24) :: column = ""
    character(len=24) :: option = ""
  end type csv_option_t

  !> An open table. A row is built with `add`, cell by cell, and written by `end_row`.
  type :: csv_writer_t
    private
    type(text_file_t) :: file
    character(len=:), allocatable :: path, row
    integer :: n_columns = 0
    integer :: n_cells = 0
    !> steps that have rows at least: multiples of it
    integer, public :: every = 1
  contains
    procedure :: open => csv_open
    procedure :: resume => csv_resume
    !> add(value): the next cell of the row; reals with 17 significant digits, NaN and infinity as nan, inf and -inf
    generic :: add => add_text, add_i4, add_i8, add_real, add_logical
    procedure, private :: add_text => csv_add_text
    procedure, private :: add_i4 => csv_add_i4
    procedure, private :: add_i8 => csv_add_i8
    procedure, private :: add_real => csv_add_real
    procedure, private :: add_logical => csv_add_logical
    procedure :: end_row => csv_end_row
    !> forget the cells of a row that is not ended, or end it if it has all of them
    procedure :: drop_row => csv_drop_row
    procedure :: keep_row => csv_keep_row
    procedure :: sync => csv_sync
    procedure :: close => csv_close
    procedure :: is_open => csv_is_open
    procedure, private :: append_cell
  end type csv_writer_t

  integer, parameter :: block_length = 65536
  !> characters of a cell that a message quotes
  integer, parameter :: longest_quote = 40

contains

  !> Create the table with its first line, replacing an older one. Failure: status_failure; an older table is as it was.
  subroutine csv_open(self, path, header, error)
    class(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> the names of the columns with commas between
    character(len=*), intent(in) :: header
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call begin(self, path, header)
    call self%file%create(path, header//new_line("a"), error)
  end subroutine csv_open

  !> Go on with a table whose first column counts steps: keep its rows up to step `last_step`, without a last line that
  !> has no end, and append to them. Each multiple of `every` from the first row to `last_step` must have a row. A table that is
  !> missing or died within its header is begun anew. What is kept replaces the older file in one indivisible operation; after a
  !> failure that file is as it was. Failure: status_input for another header, or a row that has not a step and numbers under the
  !> names, or that is missing; status_failure where the system refuses.
  subroutine csv_resume(self, path, header, last_step, error, options)
    class(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> the names of the columns with commas between
    character(len=*), intent(in) :: header
    integer, intent(in) :: last_step
    type(error_t), allocatable, intent(inout) :: error
    !> what the message about another header names, where one of these is the reason
    type(csv_option_t), intent(in), optional :: options(:)
    integer(i8) :: kept
    logical :: exists

    if (allocated(error)) return
    call begin(self, path, header)
    kept = 0
    inquire (file=path, exist=exists)
    if (exists) call find_kept(self, header//new_line("a"), last_step, kept, error, options)
    call self%file%begin(path, error)
    if (kept == 0) call self%file%append(header//new_line("a"), error)
    call copy(path, kept, self%file, error)
    call self%file%show(path, error)
  end subroutine csv_resume

  !> No cells yet, and as many columns as the header has.
  subroutine begin(self, path, header)
    type(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: path, header
    integer :: i

    self%path = path
    self%row = ""
    self%n_cells = 0
    self%n_columns = 1
    do i = 1, len(header)
      if (header(i:i) == ",") self%n_columns = self%n_columns + 1
    end do
  end subroutine begin

  !> Number of bytes up to the end of the last whole row of a step not above `last_step`; 0 for part of a header.
  subroutine find_kept(table, first_line, last_step, kept, error, options)
    class(csv_writer_t), intent(in) :: table
    !> the header with its end
    character(len=*), intent(in) :: first_line
    integer, intent(in) :: last_step
    integer(i8), intent(out) :: kept
    type(error_t), allocatable, intent(inout) :: error
    type(csv_option_t), intent(in), optional :: options(:)
    character(len=:), allocatable :: path, text, row
    !> of the row before the present one
    integer(i8) :: before
    !> the next step that must have one
    integer(i8) :: next
    integer(i8) :: position, length, step
    integer :: line, unit, first, last

    kept = 0
    path = table%path
    call open_old(path, unit, length, error)
    if (allocated(error)) return
    call read_text(path, unit, narrow(min(length, len(first_line, i8))), text, error)
    if (text /= first_line(1:len(text))) then
      rewind (unit)
      call read_text(path, unit, narrow(min(length, int(block_length, i8))), text, error)
      last = index(text, new_line("a"))
      call refuse_header(path, text(1:merge(last - 1, len(text), last > 0)), first_line(1:len(first_line) - 1), error, options)
    end if
    position = len(text)
    if (position == len(first_line)) kept = position
    line = 2
    before = -1
    row = ""
    rows: do while (position < length .and. .not. allocated(error))
      call read_text(path, unit, narrow(min(length - position, int(block_length, i8))), text, error)
      first = 1
      do
        last = index(text(first:), new_line("a"))
        if (last == 0) exit
        last = first + last - 1
        row = row//text(first:last - 1)
        call check_row(path, line, table%n_columns, row, step, error)
        if (allocated(error) .or. step > last_step) exit rows
        next = (before/table%every + 1)*table%every
        if (before >= 0 .and. step > next) then
          call raise(error, status_input, path//": line "//to_text(line)//": step "//to_text(step)//", but rows of step "// &
            & to_text(next)//" were expected")
          exit rows
        end if
        before = step
        kept = position + last
        line = line + 1
        row = ""
        first = last + 1
      end do
      row = row//text(first:)
      position = position + len(text)
    end do rows
    close (unit)
    next = (before/table%every + 1)*table%every
    if (before >= 0 .and. next <= last_step .and. .not. allocated(error)) call raise(error, status_input, path// &
      & ": its last row is of step "//to_text(before)//", but rows up to step "//to_text(last_step)//" were expected; "// &
      & "without this file a new table begins")
  end subroutine find_kept

  !> Say which column a header lacks or has beside those expected, and what option makes it.
  subroutine refuse_header(path, found, expected, error, options)
    character(len=*), intent(in) :: path, found, expected
    type(error_t), allocatable, intent(inout) :: error
    type(csv_option_t), intent(in), optional :: options(:)
    character(len=:), allocatable :: lacking, beside

    lacking = first_beyond(expected, found)
    beside = first_beyond(found, expected)
    if (lacking /= "") then
      call raise(error, status_input, path//": line 1: no column "//lacking// &
        & reason(lacking, ".true.", ".false.", ", but one was expected"))
    else if (beside /= "") then
      call raise(error, status_input, path//": line 1: a column "//beside(1:min(len(beside), longest_quote))// &
        & reason(beside, ".false.", ".true.", ", but none was expected"))
    else
      call raise(error, status_input, path//": line 1: "//expected//" was expected")
    end if

  contains

    !> The option behind a column, or `otherwise`.
    function reason(column, now, before, otherwise) result(text)
      character(len=*), intent(in) :: column, now, before, otherwise
      character(len=:), allocatable :: text
      integer :: k

      text = otherwise
      if (.not. present(options)) return
      do k = 1, size(options)
        if (index(column, trim(options(k)%column)) == 1) text = ": "//trim(options(k)%option)//" = "//now//", but "//before// &
          & " was expected, with which this table was begun"
      end do
    end function reason

  end subroutine refuse_header

  !> The first name of a header that another one has not; empty where there is none.
  pure function first_beyond(header, other) result(name)
    character(len=*), intent(in) :: header, other
    character(len=:), allocatable :: name
    integer :: first, last

    first = 1
    do while (first <= len(header))
      last = index(header(first:), ",")
      last = merge(len(header), first + last - 2, last == 0)
      name = header(first:last)
      if (index(","//other//",", ","//name//",") == 0) return
      first = last + 2
    end do
    name = ""
  end function first_beyond

  !> Check that a row has numbers only, as many as the header has names; the first is the number of a step.
  subroutine check_row(path, line, n_columns, row, step, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: line, n_columns
    character(len=*), intent(in) :: row
    integer(i8), intent(out) :: step
    type(error_t), allocatable, intent(inout) :: error
    integer :: column, first, last

    first = 1
    column = 0
    do
      column = column + 1
      last = index(row(first:), ",")
      last = merge(len(row), first + last - 2, last == 0)
      associate (cell => row(first:last))
        if (column == 1) then
          call read_step(path, line, cell, step, error)
        else if (.not. is_number(cell)) then
          call raise(error, status_input, path//": line "//to_text(line)//': "'//cell(1:min(len(cell), longest_quote))// &
            & '", but a number was expected')
        end if
      end associate
      first = last + 2
      if (last == len(row) .or. allocated(error)) exit
    end do
    if (column /= n_columns) call raise(error, status_input, path//": line "//to_text(line)//": "//to_text(column)// &
      & " cells, but the header has "//to_text(n_columns))
  end subroutine check_row

  !> Whether a cell is a number as `add` writes them.
  pure logical function is_number(cell)
    character(len=*), intent(in) :: cell

    is_number = number_size(cell) /= not_a_number .and. scan(cell, "dD") == 0
    if (.not. is_number) is_number = cell == "nan" .or. cell == "inf" .or. cell == "-inf"
  end function is_number

  !> The number of a step from the first cell of a row.
  subroutine read_step(path, line, cell, step, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: line
    character(len=*), intent(in) :: cell
    integer(i8), intent(out) :: step
    type(error_t), allocatable, intent(inout) :: error

    step = 0
    if (len(cell) > 0 .and. len(cell) <= 18 .and. verify(cell, "0123456789") == 0) then
      read (cell, "(i18)") step
    else
      call raise(error, status_input, path//": line "//to_text(line)//': "'//cell(1:min(len(cell), longest_quote))// &
        & '", but the number of a step was expected')
    end if
  end subroutine read_step

  !> Copy the first `n` bytes of the file at `path` to the end of another.
  subroutine copy(path, n, file, error)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: n
    type(text_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text
    integer(i8) :: position, length
    integer :: unit

    if (allocated(error) .or. n == 0) return
    call open_old(path, unit, length, error)
    if (allocated(error)) return
    position = 0
    do while (position < n .and. .not. allocated(error))
      call read_text(path, unit, narrow(min(n - position, int(block_length, i8))), text, error)
      call file%append(text, error)
      position = position + len(text)
    end do
    close (unit)
  end subroutine copy

  subroutine open_old(path, unit, length, error)
    character(len=*), intent(in) :: path
    integer, intent(out) :: unit
    integer(i8), intent(out) :: length
    type(error_t), allocatable, intent(inout) :: error
    character(len=200) :: reason
    integer :: stat

    call check_readable(path, error)
    if (allocated(error)) return
    length = file_length(path)
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=stat, iomsg=reason)
    if (stat /= 0) call raise(error, status_input, path//": cannot read this file: "//trim(reason))
  end subroutine open_old

  !> The next `n` bytes.
  subroutine read_text(path, unit, n, text, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: unit, n
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error
    character(len=200) :: reason
    integer :: stat

    allocate (character(len=n) :: text)
    if (n == 0) return
    read (unit, iostat=stat, iomsg=reason) text
    if (stat /= 0) call raise(error, status_input, path//": cannot read this file: "//trim(reason))
  end subroutine read_text

  !> Text; in quotes where it holds a comma, a quote or the end of a line.
  subroutine csv_add_text(self, value)
    class(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: value
    character(len=:), allocatable :: cell
    integer :: i

    if (scan(value, ',"'//new_line("a")) == 0) then
      call self%append_cell(value)
      return
    end if
    cell = '"'
    do i = 1, len(value)
      cell = cell//value(i:i)
      if (value(i:i) == '"') cell = cell//'"'
    end do
    call self%append_cell(cell//'"')
  end subroutine csv_add_text

  subroutine csv_add_i4(self, value)
    class(csv_writer_t), intent(inout) :: self
    integer(i4), intent(in) :: value
    call self%append_cell(to_text(value))
  end subroutine csv_add_i4

  subroutine csv_add_i8(self, value)
    class(csv_writer_t), intent(inout) :: self
    integer(i8), intent(in) :: value
    call self%append_cell(to_text(value))
  end subroutine csv_add_i8

  subroutine csv_add_real(self, value)
    class(csv_writer_t), intent(inout) :: self
    real(dp), intent(in) :: value

    if (is_finite(value)) then
      call self%append_cell(to_text(value, 17))
    else if (ibits(transfer(value, 0_i8), 0, 52) /= 0) then
      call self%append_cell("nan")
    else if (transfer(value, 0_i8) < 0) then
      call self%append_cell("-inf")
    else
      call self%append_cell("inf")
    end if
  end subroutine csv_add_real

  subroutine csv_add_logical(self, value)
    class(csv_writer_t), intent(inout) :: self
    logical, intent(in) :: value
    call self%append_cell(to_text(value))
  end subroutine csv_add_logical

  subroutine append_cell(self, cell)
    class(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: cell

    if (self%n_cells > 0) self%row = self%row//","
    self%row = self%row//cell
    self%n_cells = self%n_cells + 1
  end subroutine append_cell

  !> Write the row and begin the next one. Failure (status_failure): a row that has not as many cells as the header, or
  !> the system's refusal, a full disk for one; the file then ends with the last complete row.
  subroutine csv_end_row(self, error)
    class(csv_writer_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (self%n_cells /= self%n_columns) then
      call raise(error, status_failure, self%path//": a row of "//to_text(self%n_cells)//" cells under a header of "// &
        & to_text(self%n_columns))
    end if
    call self%file%append(self%row//new_line("a"), error)
    self%row = ""
    self%n_cells = 0
  end subroutine csv_end_row

  subroutine csv_drop_row(self)
    class(csv_writer_t), intent(inout) :: self

    self%row = ""
    self%n_cells = 0
  end subroutine csv_drop_row

  subroutine csv_keep_row(self, error)
    class(csv_writer_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (self%is_open() .and. self%n_cells == self%n_columns) call self%end_row(error)
  end subroutine csv_keep_row

  !> Bring the rows to the disk, so that a loss of power leaves them. Failure: status_failure, with the system's reason.
  subroutine csv_sync(self, error)
    class(csv_writer_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%file%sync(error)
  end subroutine csv_sync

  !> Close; without effect on a table not open.
  subroutine csv_close(self, error)
    class(csv_writer_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%file%close(error)
  end subroutine csv_close

  pure logical function csv_is_open(self) result(is_open)
    class(csv_writer_t), intent(in) :: self
    is_open = self%file%is_open()
  end function csv_is_open

end module gravier_csv_writer
