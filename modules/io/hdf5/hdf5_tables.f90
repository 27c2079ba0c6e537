!> Tables of an HDF5 file that grow row by row: made empty, lengthened by what is written into them, checked and cut when a run goes
!> on. They have no checksum.
module gravier_hdf5_tables
  use, intrinsic :: iso_c_binding, only: c_loc
  use hdf5, only: H5T_FLOAT_F, H5T_IEEE_F32LE, H5T_IEEE_F64LE, H5T_INTEGER_F, H5T_STD_I64LE, h5dclose_f, h5dopen_f, &
    & h5dset_extent_f, hid_t, hsize_t
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_hdf5_datasets, only: rows_t, rows_of, create_dataset, transfer_rows, get_shape, can_grow, chunk_rows, class_of, &
    & type_of, columns_text
  use gravier_hdf5_rows, only: h5_rows_t
  implicit none
  private
  public :: h5_tables_t
  public :: table_integer, table_single, table_double

  type, extends(h5_rows_t) :: h5_tables_t
  contains
    !> put_rows(path, first_row, values, error): write the rows of all ranks into a table, in the order of the ranks, from row
    !> first_row (from 0) on; the table grows
    procedure :: make_table => h5_make_table
    procedure :: check_table => h5_check_table
    procedure :: cut_rows => h5_cut_rows
    generic :: put_rows => put_integer_rows, put_real_rows
    procedure, private :: put_integer_rows => h5_put_integer_rows
    procedure, private :: put_real_rows => h5_put_real_rows
  end type h5_tables_t

  !> what a table holds
  integer, parameter :: table_integer = 1, table_single = 2, table_double = 3
  !> of a number in single precision
  integer, parameter :: least_bytes_of_row = 4

contains

  subroutine h5_put_integer_rows(self, path, first_row, values, error)
    class(h5_tables_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, or 1, rows of this rank)
    integer(i8), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call put_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_put_integer_rows

  !> Reals; a table of integers takes them too, rounded towards zero.
  subroutine h5_put_real_rows(self, path, first_row, values, error)
    class(h5_tables_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, or 1, rows of this rank)
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call put_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_put_real_rows

  !> Make a table without rows, which put_rows lengthens: (N) with n_columns = 0, (N, n_columns) otherwise.
  subroutine h5_make_table(self, path, n_columns, kind, rows_a_chunk, error)
    class(h5_tables_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: n_columns
    !> table_integer (64 bits), table_single or table_double
    integer, intent(in) :: kind
    !> the file grows by so many rows at a time; the same on all ranks
    integer(i8), intent(in) :: rows_a_chunk
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: dataset, type
    integer :: stat, ignored

    if (allocated(error)) return
    type = H5T_STD_I64LE
    if (kind == table_single) type = H5T_IEEE_F32LE
    if (kind == table_double) type = H5T_IEEE_F64LE
    call create_dataset(self, path, type, n_columns, 0_i8, dataset, stat, rows_a_chunk)
    if (stat < 0) then
      call self%fail(path, "cannot make this dataset", error)
    else
      call h5dclose_f(dataset, ignored)
    end if
    call self%comm%agree(error)
  end subroutine h5_make_table

  !> Check that a table of a file to go on with is one that make_table made, with n_rows rows at least, and that its chunks from
  !> the last of these rows on can be read.
  subroutine h5_check_table(self, path, n_columns, kind, n_rows, error)
    class(h5_tables_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> as for make_table
    integer, intent(in) :: n_columns, kind
    integer(i8), intent(in) :: n_rows
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: total
    integer :: found

    call self%row_count(path, total, error)
    if (allocated(error)) return
    found = self%columns(path)
    if (found /= n_columns) then
      call self%fail(path, columns_text(found)//", but "//columns_text(n_columns)//" was expected", error)
    else if (class_of(self, path) /= merge(H5T_INTEGER_F, H5T_FLOAT_F, kind == table_integer)) then
      call self%fail(path, "not made of "//trim(merge("integers", "reals   ", kind == table_integer))// &
        & ", which were expected", error)
    else if (.not. can_grow(self, path)) then
      call self%fail(path, "a table of a fixed length, but one that grows was expected", error)
    else if (total > self%length()/least_bytes_of_row) then
      ! HDF5 makes room for all of them when the file is opened for writing
      call self%fail(path, to_text(total)//" rows, more than the file has room for", error)
    else if (total < n_rows) then
      call self%fail(path, to_text(total)//" rows, but at least "//to_text(n_rows)//" were expected", error)
    end if
    call self%comm%agree(error)
    call check_chunks(self, path, max(n_rows - 1, 0_i8), total, error)
  end subroutine h5_check_table

  !> Refuse a table of which a chunk cannot be read: from row `first` on, one row of each chunk is.
  subroutine check_chunks(self, path, first, total, error)
    class(h5_tables_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first, total
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable, target :: words(:)
    type(rows_t) :: row
    integer(hid_t) :: place, dataset
    character(len=:), allocatable :: name
    integer(i8) :: at, rows_a_chunk
    integer :: stat, ignored

    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat == 0) then
      call type_of(dataset, self%columns(path), row)
      allocate (words(max(1, row%words)))
      row%buffer = c_loc(words)
      ! all ranks read the same rows, so that they fail together
      row%n = 1
      rows_a_chunk = chunk_rows(dataset)
      at = first
      do while (at < total .and. stat == 0)
        call transfer_rows(dataset, row, at, .false., stat)
        at = (at/rows_a_chunk + 1)*rows_a_chunk
      end do
      call row%close()
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot read this table: the file is damaged", error)
    call self%comm%agree(error)
  end subroutine check_chunks

  !> Leave the first rows of a table alone.
  subroutine h5_cut_rows(self, path, n_rows, error)
    class(h5_tables_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: n_rows
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, dataset
    integer(hsize_t) :: extent(2)
    character(len=:), allocatable :: name
    integer :: n_dims, stat, ignored

    if (allocated(error)) return
    call self%locate(path, place, name)
    call get_shape(max(self%columns(path), 0), n_rows, n_dims, extent)
    call h5dopen_f(place, name, dataset, stat)
    if (stat == 0) then
      call h5dset_extent_f(dataset, extent(1:n_dims), stat)
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot cut this table", error)
    call self%comm%agree(error)
  end subroutine h5_cut_rows

  !> Lengthen a table where need be and write the rows of all ranks into it.
  subroutine put_block(self, path, first_row, values, error)
    class(h5_tables_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    type(rows_t), intent(in) :: values
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, dataset
    integer(hsize_t) :: extent(2)
    integer(i8) :: first, total, length
    character(len=:), allocatable :: name
    type(rows_t) :: rows
    integer :: n_dims, stat, ignored

    call self%row_count(path, length, error)
    if (allocated(error)) return
    rows = values
    rows%n_columns = self%columns(path)
    total = self%comm%total(int(rows%n, i8))
    first = first_row + self%comm%offset(int(rows%n, i8))
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat == 0) then
      if (first_row + total > length) then
        call get_shape(rows%n_columns, first_row + total, n_dims, extent)
        call h5dset_extent_f(dataset, extent(1:n_dims), stat)
      end if
      if (stat == 0 .and. total > 0) call transfer_rows(dataset, rows, first, .true., stat)
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write rows of this table: is the disk full?", error)
    call self%comm%agree(error)
  end subroutine put_block

end module gravier_hdf5_tables
