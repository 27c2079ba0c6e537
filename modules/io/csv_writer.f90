!> Tables as comma-separated text, one line a row, on the disk as soon as the row is complete. Not collective: one rank
!> writes, and what fails is to be made known to the others by the caller.
module gravier_csv_writer
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_finite, only: is_finite
  use gravier_file_system, only: text_file_t
  implicit none
  private
  public :: csv_writer_t

  !> An open table. A row is built with `add`, cell by cell, and written by `end_row`.
  type :: csv_writer_t
    private
    type(text_file_t) :: file
    character(len=:), allocatable :: path, row
    integer :: n_columns = 0
    integer :: n_cells = 0
  contains
    procedure :: open => csv_open
    !> add(value): the next cell of the row; reals with 17 significant digits, NaN and infinity as nan, inf and -inf
    generic :: add => add_text, add_i4, add_i8, add_real, add_logical
    procedure, private :: add_text => csv_add_text
    procedure, private :: add_i4 => csv_add_i4
    procedure, private :: add_i8 => csv_add_i8
    procedure, private :: add_real => csv_add_real
    procedure, private :: add_logical => csv_add_logical
    procedure :: end_row => csv_end_row
    procedure :: close => csv_close
    procedure :: is_open => csv_is_open
    procedure, private :: append_cell
  end type csv_writer_t

contains

  !> Create the table, replacing an older one, and write its first line. Failure: status_failure.
  subroutine csv_open(self, path, header, error)
    class(csv_writer_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> the names of the columns with commas between
    character(len=*), intent(in) :: header
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (allocated(error)) return
    self%path = path
    self%row = ""
    self%n_cells = 0
    self%n_columns = 1
    do i = 1, len(header)
      if (header(i:i) == ",") self%n_columns = self%n_columns + 1
    end do
    call self%file%create(path, error)
    call self%file%append(header//new_line("a"), error)
  end subroutine csv_open

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
