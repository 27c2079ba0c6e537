!> Datasets of an HDF5 file by rows: a Fortran array (k, n) is an (N, k) dataset in C, Python and h5dump, and each rank holds n of
!> the N rows. What write_rows wrote has a checksum as an attribute, against which it is read.
module gravier_hdf5_rows
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_loc, c_null_char
  use hdf5, only: H5T_FLOAT_F, H5T_INTEGER_F, H5T_STD_I64LE, H5T_STRING_F, h5dclose_f, h5dopen_f, h5tclose_f, hid_t, hsize_t
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_rows
  use gravier_hdf5_properties, only: text_type, is_ascii
  use gravier_hdf5_attributes, only: h5_attributes_t, attach_integer
  use gravier_hdf5_datasets, only: rows_t, rows_of, create_dataset, transfer_rows, get_extent, class_of, type_of, &
    & is_fixed_text, columns_text
  implicit none
  private
  public :: h5_rows_t

  type, extends(h5_attributes_t) :: h5_rows_t
  contains
    procedure :: columns => h5_columns
    procedure :: row_count => h5_row_count

    !> write_rows(path, values, error): make a dataset of the rows of all ranks, in the order of the ranks
    generic :: write_rows => write_integers, write_integer_columns, write_reals, write_real_columns, write_texts
    procedure, private :: write_integers => h5_write_integers
    procedure, private :: write_integer_columns => h5_write_integer_columns
    procedure, private :: write_texts => h5_write_texts
    procedure, private :: write_reals => h5_write_reals
    procedure, private :: write_real_columns => h5_write_real_columns

    !> read_rows(path, first_row, values, error): fill `values` with rows first_row (from 0) and following; each rank
    !> asks for its own block, empty if it likes
    generic :: read_rows => read_integers, read_integer_columns, read_reals, read_real_columns
    procedure, private :: read_integers => h5_read_integers
    procedure, private :: read_integer_columns => h5_read_integer_columns
    procedure, private :: read_reals => h5_read_reals
    procedure, private :: read_real_columns => h5_read_real_columns
    procedure :: read_long_text => h5_read_long_text
  end type h5_rows_t

  !> attribute of a dataset: hash_rows of its words
  character(len=*), parameter :: checksum = "checksum"
  integer, parameter :: bytes_of_word = 8
  !> words that a rank reads at a time to check them
  integer, parameter :: words_a_piece = 131072

contains

  !> k of an (N, k) dataset, 0 of a vector of N numbers or of a scalar, -1 of anything else. Not collective.
  integer function h5_columns(self, path) result(columns)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hsize_t) :: extent(2)
    integer :: n_dims

    columns = -1
    if (.not. self%exists(path)) return
    call get_extent(self, path, n_dims, extent)
    if (n_dims == 1) columns = 0
    if (n_dims == 2) columns = narrow(extent(1))
  end function h5_columns

  !> N of an (N, k) dataset or of a vector of N numbers, 1 of a scalar.
  subroutine h5_row_count(self, path, n, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(out) :: n
    type(error_t), allocatable, intent(inout) :: error
    integer(hsize_t) :: extent(2)
    integer :: n_dims

    n = 0
    if (allocated(error)) return
    if (.not. self%exists(path)) then
      call self%fail(path, "missing", error)
    else
      call get_extent(self, path, n_dims, extent)
      select case (n_dims)
      case (1, 2)
        n = int(extent(n_dims), i8)
      case (:-1)
        call self%fail(path, "a dataset was expected, but it is none or damaged", error)
      case default
        call self%fail(path, "a dataset of one or two dimensions was expected", error)
      end select
    end if
    call self%comm%agree(error)
  end subroutine h5_row_count

  subroutine h5_write_integers(self, path, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    integer(i8), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    call write_block(self, path, rows_of(values), error)
  end subroutine h5_write_integers

  subroutine h5_write_integer_columns(self, path, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (columns, rows of this rank); the number of columns is the same on all ranks
    integer(i8), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call write_block(self, path, rows_of(values), error)
  end subroutine h5_write_integer_columns

  subroutine h5_write_reals(self, path, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    real(dp), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    call write_block(self, path, rows_of(values), error)
  end subroutine h5_write_reals

  subroutine h5_write_real_columns(self, path, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (columns, rows of this rank); the number of columns is the same on all ranks
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call write_block(self, path, rows_of(values), error)
  end subroutine h5_write_real_columns

  !> Texts without their trailing blanks, as strings of one fixed length.
  subroutine h5_write_texts(self, path, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    character(len=*), intent(in), contiguous :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    character(kind=c_char, len=:), allocatable, target :: letters
    integer(hid_t) :: type
    integer :: i, length, stat
    logical :: ascii

    if (allocated(error)) return
    length = 1
    if (size(values) > 0) length = max(1, maxval(len_trim(values)))
    length = nint(self%comm%highest(real(length, dp)))
    ! rows of whole words
    length = bytes_of_word*((length + bytes_of_word - 1)/bytes_of_word)
    letters = repeat(c_null_char, length*max(1, size(values)))
    do i = 1, size(values)
      letters(length*(i - 1) + 1:length*(i - 1) + len_trim(values(i))) = trim(values(i))
    end do
    ascii = .not. self%comm%any_true(.not. is_ascii(letters))
    type = text_type(length, ascii)
    call write_block(self, path, rows_t(0, size(values), length/bytes_of_word, type, type, c_loc(letters)), error)
    call h5tclose_f(type, stat)
  end subroutine h5_write_texts

  subroutine h5_read_integers(self, path, first_row, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (rows this rank wants)
    integer(i8), intent(inout), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    call read_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_read_integers

  subroutine h5_read_integer_columns(self, path, first_row, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, rows this rank wants)
    integer(i8), intent(inout), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call read_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_read_integer_columns

  subroutine h5_read_reals(self, path, first_row, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (rows this rank wants)
    real(dp), intent(inout), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    call read_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_read_reals

  subroutine h5_read_real_columns(self, path, first_row, values, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, rows this rank wants)
    real(dp), intent(inout), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    call read_block(self, path, first_row, rows_of(values), error)
  end subroutine h5_read_real_columns

  !> Make a dataset and write the rows of all ranks.
  subroutine write_block(self, path, rows, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(rows_t), intent(in) :: rows
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: dataset
    integer(i8) :: first, total, digest
    integer :: stat, ignored

    if (allocated(error)) return
    total = self%comm%total(int(rows%n, i8))
    first = self%comm%offset(int(rows%n, i8))
    if (self%comm%any_true(rows%n_columns /= nint(self%comm%highest(real(rows%n_columns, dp))))) then
      call self%fail(path, "the number of columns differs between ranks", error)
      return
    end if
    call create_dataset(self, path, rows, total, dataset, stat)
    if (stat < 0) call self%fail(path, "cannot make this dataset", error)
    call self%comm%agree(error)
    if (allocated(error)) return
    if (total > 0) then
      call transfer_rows(dataset, rows, first, .true., stat)
      if (stat < 0) call self%fail(path, "cannot write this dataset: is the disk full?", error)
    end if
    call self%comm%agree(error)
    if (.not. allocated(error)) then
      digest = self%comm%exclusive_or(checksum_of(rows, first))
      call attach_integer(dataset, checksum, digest, stat)
      if (stat < 0) call self%fail(path, "cannot write attribute "//checksum, error)
    end if
    call h5dclose_f(dataset, ignored)
    call self%comm%agree(error)
  end subroutine write_block

  !> Of the rows of this rank, from row `first` of the table on.
  integer(i8) function checksum_of(rows, first) result(digest)
    type(rows_t), intent(in) :: rows
    integer(i8), intent(in) :: first
    integer(i8), pointer, contiguous :: words(:, :)
    integer :: extent(2)

    digest = 0
    if (rows%n == 0 .or. .not. c_associated(rows%buffer)) return
    extent(1) = rows%words
    extent(2) = rows%n
    call c_f_pointer(rows%buffer, words, extent)
    digest = hash_rows(words, first)
  end function checksum_of

  !> Refuse a dataset whose words do not have the checksum with which it was written; without one it is taken as it is. The ranks
  !> share the rows out.
  subroutine check_whole(self, path, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable, target :: words(:)
    type(rows_t) :: piece
    integer(hid_t) :: place, dataset
    character(len=:), allocatable :: name
    integer(i8) :: written, found, total, first, rows_a_piece
    integer :: stat, ignored

    if (allocated(error)) return
    if (.not. self%has_attribute(path, checksum)) return
    call self%read_attribute(path, checksum, written, error)
    call self%row_count(path, total, error)
    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    found = 0
    if (stat == 0) then
      call type_of(dataset, self%columns(path), piece)
      rows_a_piece = max(1, words_a_piece/max(1, piece%words))
      allocate (words(rows_a_piece*max(1, piece%words)))
      piece%buffer = c_loc(words)
      first = rows_a_piece*self%comm%rank
      ! every rank reads as often as rank 0
      do while (first - rows_a_piece*self%comm%rank < total .and. stat == 0)
        piece%n = narrow(max(0_i8, min(rows_a_piece, total - first)))
        call transfer_rows(dataset, piece, min(first, total), .false., stat)
        found = ieor(found, checksum_of(piece, first))
        first = first + rows_a_piece*self%comm%size
      end do
      call piece%close()
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot read this dataset", error)
    call self%comm%agree(error)
    if (self%comm%exclusive_or(found) /= written) call self%fail(path, "its attribute "//checksum// &
      & " is not that of what it holds: the file is damaged, or was changed since it was written", error)
    call self%comm%agree(error)
  end subroutine check_whole

  !> A text that write_rows wrote as the only row of a dataset, without the blanks and zeros at its end.
  subroutine h5_read_long_text(self, path, value, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    character(kind=c_char, len=:), allocatable, target :: letters
    type(rows_t) :: row
    integer(hid_t) :: place, dataset
    integer(i8) :: total
    character(len=:), allocatable :: name
    integer :: columns, kind_found, stat, ignored

    value = ""
    call self%row_count(path, total, error)
    if (allocated(error)) return
    columns = self%columns(path)
    kind_found = class_of(self, path)
    if (total /= 1 .or. columns /= 0 .or. kind_found /= H5T_STRING_F) then
      call self%fail(path, "not one text", error)
    else if (.not. is_fixed_text(self, path)) then
      call self%fail(path, "a text of variable length, but one of fixed length was expected", error)
    end if
    call check_whole(self, path, error)
    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat == 0) then
      call type_of(dataset, 0, row)
      letters = repeat(c_null_char, bytes_of_word*row%words)
      row%buffer = c_loc(letters)
      row%n = 1
      call transfer_rows(dataset, row, 0_i8, .false., stat)
      value = trim(letters(1:verify(letters, c_null_char, back=.true.)))
      call row%close()
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot read this dataset", error)
    call self%comm%agree(error)
  end subroutine h5_read_long_text

  !> Read rows [first, first + n) of a dataset of the same numbers and columns into memory.
  subroutine read_block(self, path, first, rows, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first
    type(rows_t), intent(in) :: rows
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, dataset
    character(len=:), allocatable :: name
    integer :: stat, ignored

    if (allocated(error)) return
    call check_shape(self, path, first, rows, error)
    if (allocated(error)) return
    if (self%comm%total(int(rows%n, i8)) == 0) return
    call check_whole(self, path, error)
    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) call self%fail(path, "cannot open this dataset", error)
    call self%comm%agree(error)
    if (allocated(error)) return
    call transfer_rows(dataset, rows, first, .false., stat)
    if (stat < 0) call self%fail(path, "cannot read this dataset", error)
    call h5dclose_f(dataset, ignored)
    call self%comm%agree(error)
  end subroutine read_block

  !> Check that a dataset is there, of the kind and shape expected, and long enough.
  subroutine check_shape(self, path, first, rows, error)
    class(h5_rows_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first
    type(rows_t), intent(in) :: rows
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: total
    integer :: found, kind_found

    call self%row_count(path, total, error)
    if (allocated(error)) return
    found = self%columns(path)
    kind_found = class_of(self, path)
    if (found /= rows%n_columns) then
      call self%fail(path, columns_text(found)//", but "//columns_text(rows%n_columns)//" was expected", error)
    else if (rows%file_type == H5T_STD_I64LE .and. kind_found /= H5T_INTEGER_F) then
      call self%fail(path, "not made of integers", error)
    else if (kind_found /= H5T_INTEGER_F .and. kind_found /= H5T_FLOAT_F) then
      call self%fail(path, "not made of numbers", error)
    else if (rows%n > 0 .and. (first < 0 .or. first + rows%n > total)) then
      call self%fail(path, "rows "//to_text(first)//" to "//to_text(first + rows%n - 1)//" were asked for, but it has "// &
        & to_text(total), error)
    end if
    call self%comm%agree(error)
  end subroutine check_shape

end module gravier_hdf5_rows
