!> Datasets as HDF5 has them: rows in memory, made, asked for their shape, and moved to and from the file.
module gravier_hdf5_datasets
  use, intrinsic :: iso_c_binding, only: c_loc, c_null_ptr, c_ptr
  use hdf5, only: H5D_ALLOC_TIME_EARLY_F, H5D_FILL_TIME_NEVER_F, H5FD_MPIO_COLLECTIVE_F, H5FD_MPIO_INDEPENDENT_F, &
    & H5P_DATASET_CREATE_F, H5P_DATASET_XFER_F, H5S_SELECT_SET_F, H5S_UNLIMITED_F, H5T_FLOAT_F, H5T_IEEE_F64LE, &
    & H5T_NO_CLASS_F, H5T_STD_I64LE, H5T_STRING_F, H5_INTEGER_KIND, H5_REAL_KIND, h5dclose_f, h5dcreate_f, &
    & h5dget_create_plist_f, h5dget_space_f, h5dget_type_f, h5dopen_f, h5dread_f, h5dwrite_f, h5kind_to_type, h5pclose_f, &
    & h5pcreate_f, h5pget_chunk_f, h5pset_alloc_time_f, h5pset_chunk_f, h5pset_dxpl_mpio_f, h5pset_fill_time_f, &
    & h5pset_obj_track_times_f, h5sclose_f, h5screate_simple_f, h5sget_simple_extent_dims_f, h5sget_simple_extent_ndims_f, &
    & h5sget_simple_extent_npoints_f, h5sselect_all_f, h5sselect_hyperslab_f, h5sselect_none_f, h5tclose_f, h5tget_class_f, &
    & h5tget_size_f, h5tis_variable_str_f, hid_t, hsize_t, size_t
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_text, only: to_text
  use gravier_hdf5_tree, only: h5_tree_t
  implicit none
  private
  public :: rows_t, rows_of, create_dataset, transfer_rows, get_shape, get_extent, can_grow, chunk_rows, class_of, type_of, &
    & is_fixed_text, columns_text

  !> Rows of this rank in memory.
  type :: rows_t
    !> 0: a vector
    integer :: n_columns = 0
    integer :: n = 0
    !> 64-bit words of a row
    integer :: words = 1
    !> of a number in a file and in memory
    integer(hid_t) :: file_type = -1, memory_type = -1
    type(c_ptr) :: buffer = c_null_ptr
    !> of a text that type_of made
    integer(hid_t) :: own_type = -1
  contains
    procedure :: close => rows_close
  end type rows_t

  interface rows_of
    procedure :: rows_of_integers, rows_of_integer_columns, rows_of_reals, rows_of_real_columns
  end interface rows_of

contains

  !> A vector of integers.
  type(rows_t) function rows_of_integers(values) result(rows)
    integer(i8), intent(in), contiguous, target :: values(:)

    rows = rows_t(0, size(values), 1, H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND))
    if (size(values) > 0) rows%buffer = c_loc(values(1))
  end function rows_of_integers

  !> Integers (columns, rows).
  type(rows_t) function rows_of_integer_columns(values) result(rows)
    integer(i8), intent(in), contiguous, target :: values(:, :)

    rows = rows_t(size(values, 1), size(values, 2), size(values, 1), H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND))
    if (size(values) > 0) rows%buffer = c_loc(values(1, 1))
  end function rows_of_integer_columns

  !> A vector of reals.
  type(rows_t) function rows_of_reals(values) result(rows)
    real(dp), intent(in), contiguous, target :: values(:)

    rows = rows_t(0, size(values), 1, H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND))
    if (size(values) > 0) rows%buffer = c_loc(values(1))
  end function rows_of_reals

  !> Reals (columns, rows).
  type(rows_t) function rows_of_real_columns(values) result(rows)
    real(dp), intent(in), contiguous, target :: values(:, :)

    rows = rows_t(size(values, 1), size(values, 2), size(values, 1), H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND))
    if (size(values) > 0) rows%buffer = c_loc(values(1, 1))
  end function rows_of_real_columns

  !> Rows, none yet, of the numbers or texts of an open dataset of n_columns, as write_rows has them in memory. To be closed.
  subroutine type_of(dataset, n_columns, rows)
    integer(hid_t), intent(in) :: dataset
    integer, intent(in) :: n_columns
    type(rows_t), intent(out) :: rows
    integer(size_t) :: bytes
    integer :: data_class, stat

    rows%n_columns = max(0, n_columns)
    rows%words = max(1, n_columns)
    rows%memory_type = h5kind_to_type(i8, H5_INTEGER_KIND)
    call h5dget_type_f(dataset, rows%own_type, stat)
    if (stat < 0) return
    call h5tget_class_f(rows%own_type, data_class, stat)
    if (data_class == H5T_FLOAT_F) rows%memory_type = h5kind_to_type(dp, H5_REAL_KIND)
    if (data_class /= H5T_STRING_F) return
    call h5tget_size_f(rows%own_type, bytes, stat)
    rows%memory_type = rows%own_type
    rows%words = narrow((bytes + 7)/8)
  end subroutine type_of

  subroutine rows_close(self)
    class(rows_t), intent(inout) :: self
    integer :: stat

    if (self%own_type >= 0) call h5tclose_f(self%own_type, stat)
    self%own_type = -1
  end subroutine rows_close

  !> Number of dimensions of a table and their lengths in Fortran's order; n_columns = 0 is a vector.
  pure subroutine get_shape(n_columns, n_rows, n_dims, extent)
    integer, intent(in) :: n_columns
    integer(i8), intent(in) :: n_rows
    integer, intent(out) :: n_dims
    integer(hsize_t), intent(out) :: extent(2)

    n_dims = merge(1, 2, n_columns == 0)
    extent = int(n_rows, hsize_t)
    if (n_columns > 0) extent(1) = int(n_columns, hsize_t)
  end subroutine get_shape

  !> A dataset of a given length, or a table that grows by chunks of `rows_a_chunk`.
  subroutine create_dataset(self, path, rows, n_rows, dataset, stat, rows_a_chunk)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> whose columns and type the dataset has
    type(rows_t), intent(in) :: rows
    !> of all ranks
    integer(i8), intent(in) :: n_rows
    integer(hid_t), intent(out) :: dataset
    integer, intent(out) :: stat
    integer(i8), intent(in), optional :: rows_a_chunk
    integer(hid_t) :: place, space, creation
    integer(hsize_t) :: extent(2), chunk(2), greatest(2)
    character(len=:), allocatable :: name
    integer :: n_dims, ignored

    call self%make_groups_above(path)
    call self%locate(path, place, name)
    call h5pcreate_f(H5P_DATASET_CREATE_F, creation, ignored)
    ! every row is written, and a file must not tell when it was made
    call h5pset_fill_time_f(creation, H5D_FILL_TIME_NEVER_F, ignored)
    call h5pset_obj_track_times_f(creation, .false., ignored)
    call get_shape(rows%n_columns, n_rows, n_dims, extent)
    greatest = extent
    if (present(rows_a_chunk)) then
      call get_shape(rows%n_columns, rows_a_chunk, n_dims, chunk)
      call h5pset_chunk_f(creation, n_dims, chunk(1:n_dims), ignored)
      call h5pset_alloc_time_f(creation, H5D_ALLOC_TIME_EARLY_F, ignored)
      greatest(n_dims) = H5S_UNLIMITED_F
    end if
    call h5screate_simple_f(n_dims, extent(1:n_dims), space, ignored, greatest(1:n_dims))
    call h5dcreate_f(place, name, rows%file_type, space, dataset, stat, dcpl_id=creation)
    call h5sclose_f(space, ignored)
    call h5pclose_f(creation, ignored)
  end subroutine create_dataset

  !> Write or read rows [first, first + n) of an open dataset. Reading is collective MPI I/O. Writing is not: the
  !> rows of a rank are one contiguous piece of the file, so that nothing is gained, and when the disk is full the
  !> aggregators of OpenMPI 4.1 lose the error and wait for ever.
  subroutine transfer_rows(dataset, rows, first, writing, stat)
    integer(hid_t), intent(in) :: dataset
    type(rows_t), intent(in) :: rows
    integer(i8), intent(in) :: first
    logical, intent(in) :: writing
    integer, intent(out) :: stat
    integer(hid_t) :: file_space, memory_space, mode
    integer(hsize_t) :: start(2), count(2)
    type(c_ptr) :: place
    integer :: n_dims, n_dims_of_file, ignored

    place = rows%buffer
    call get_shape(rows%n_columns, int(max(rows%n, 1), i8), n_dims, count)
    start = 0
    start(n_dims) = int(first, hsize_t)
    call h5dget_space_f(dataset, file_space, ignored)
    call h5screate_simple_f(n_dims, count(1:n_dims), memory_space, ignored)
    call h5sget_simple_extent_ndims_f(file_space, n_dims_of_file, ignored)
    if (rows%n > 0 .and. n_dims_of_file == 0) then
      call h5sselect_all_f(file_space, ignored)
    else if (rows%n > 0) then
      call h5sselect_hyperslab_f(file_space, H5S_SELECT_SET_F, start(1:n_dims), count(1:n_dims), ignored)
    else
      call h5sselect_none_f(file_space, ignored)
      call h5sselect_none_f(memory_space, ignored)
    end if
    call h5pcreate_f(H5P_DATASET_XFER_F, mode, ignored)
    if (writing) then
      call h5pset_dxpl_mpio_f(mode, H5FD_MPIO_INDEPENDENT_F, ignored)
      call h5dwrite_f(dataset, rows%memory_type, place, stat, memory_space, file_space, mode)
    else
      call h5pset_dxpl_mpio_f(mode, H5FD_MPIO_COLLECTIVE_F, ignored)
      call h5dread_f(dataset, rows%memory_type, place, stat, memory_space, file_space, mode)
    end if
    call h5pclose_f(mode, ignored)
    call h5sclose_f(memory_space, ignored)
    call h5sclose_f(file_space, ignored)
  end subroutine transfer_rows

  !> Number of dimensions of a dataset, -1 for anything else, and their lengths in Fortran's order when it has 1 or 2. A scalar is a
  !> vector of one number.
  subroutine get_extent(self, path, n_dims, extent)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer, intent(out) :: n_dims
    integer(hsize_t), intent(out) :: extent(2)
    integer(hid_t) :: place, dataset, space
    integer(hsize_t) :: greatest(2)
    character(len=:), allocatable :: name
    integer :: stat

    n_dims = -1
    extent = 0
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) return
    call h5dget_space_f(dataset, space, stat)
    if (stat == 0) then
      call h5sget_simple_extent_ndims_f(space, n_dims, stat)
      if (n_dims == 1 .or. n_dims == 2) then
        call h5sget_simple_extent_dims_f(space, extent(1:n_dims), greatest(1:n_dims), stat)
      else if (n_dims == 0) then
        ! a dataset may have no dimension and no number either
        call h5sget_simple_extent_npoints_f(space, extent(1), stat)
        n_dims = 1
      end if
      call h5sclose_f(space, stat)
    end if
    call h5dclose_f(dataset, stat)
  end subroutine get_extent

  !> Whether a dataset of one or two dimensions takes more rows than it has.
  logical function can_grow(self, path)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place, dataset, space
    integer(hsize_t) :: extent(2), greatest(2)
    character(len=:), allocatable :: name
    integer :: n_dims, stat

    can_grow = .false.
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) return
    call h5dget_space_f(dataset, space, stat)
    if (stat == 0) then
      call h5sget_simple_extent_ndims_f(space, n_dims, stat)
      if (n_dims == 1 .or. n_dims == 2) then
        call h5sget_simple_extent_dims_f(space, extent(1:n_dims), greatest(1:n_dims), stat)
        can_grow = greatest(n_dims) == H5S_UNLIMITED_F
      end if
      call h5sclose_f(space, stat)
    end if
    call h5dclose_f(dataset, stat)
  end function can_grow

  !> Rows of a chunk of a dataset, 1 at least. HDF5 is asked for as many dimensions as the dataset has: in the place of one more it
  !> would leave what was there by chance.
  integer(i8) function chunk_rows(dataset) result(rows)
    integer(hid_t), intent(in) :: dataset
    integer(hid_t) :: creation, space
    integer(hsize_t) :: chunk(2)
    integer :: n_dims, found, ignored

    rows = 1
    n_dims = 0
    call h5dget_space_f(dataset, space, ignored)
    call h5sget_simple_extent_ndims_f(space, n_dims, ignored)
    call h5sclose_f(space, ignored)
    if (n_dims < 1 .or. n_dims > size(chunk)) return
    call h5dget_create_plist_f(dataset, creation, ignored)
    call h5pget_chunk_f(creation, n_dims, chunk, found)
    call h5pclose_f(creation, ignored)
    if (found == n_dims) rows = max(1_i8, int(chunk(n_dims), i8))
  end function chunk_rows

  !> Class of the elements of a dataset, one of the H5T_ class constants.
  integer function class_of(self, path) result(data_class)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place, dataset, type
    character(len=:), allocatable :: name
    integer :: stat

    data_class = H5T_NO_CLASS_F
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) return
    call h5dget_type_f(dataset, type, stat)
    if (stat == 0) then
      call h5tget_class_f(type, data_class, stat)
      call h5tclose_f(type, stat)
    end if
    call h5dclose_f(dataset, stat)
  end function class_of

  !> Whether a dataset holds texts of one length, as write_rows writes them.
  logical function is_fixed_text(self, path) result(is_fixed)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place, dataset, type
    character(len=:), allocatable :: name
    integer :: stat
    logical :: varies

    is_fixed = class_of(self, path) == H5T_STRING_F
    if (.not. is_fixed) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) return
    call h5dget_type_f(dataset, type, stat)
    varies = .true.
    if (stat == 0) call h5tis_variable_str_f(type, varies, stat)
    is_fixed = stat == 0 .and. .not. varies
    call h5tclose_f(type, stat)
    call h5dclose_f(dataset, stat)
  end function is_fixed_text

  !> The shape of a dataset of n_columns, for messages.
  pure function columns_text(n_columns) result(text)
    integer, intent(in) :: n_columns
    character(len=:), allocatable :: text
    if (n_columns == 0) then
      text = "a dataset of shape (N)"
    else
      text = "a dataset of shape (N, "//to_text(n_columns)//")"
    end if
  end function columns_text

end module gravier_hdf5_datasets
