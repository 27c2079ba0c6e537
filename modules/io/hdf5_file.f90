!> One HDF5 file shared by all ranks: the only file of the program that uses the HDF5 library.
!> Tables are cut into rows: a Fortran array (k, n) is an (N, k) dataset in C, Python and h5dump, and each rank holds
!> n of the N rows. Every procedure with an `error` is collective and leaves the same error on all ranks. What is
!> wrong with a file that is read ends in status_input, what fails while writing in status_failure.
module gravier_hdf5_file
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_double, c_int, c_int64_t, c_loc, c_long, c_null_char, c_null_ptr, &
    & c_ptr, c_size_t
  use mpi_f08, only: MPI_INFO_NULL
  use hdf5, only: h5aclose_f, h5acreate_f, h5aget_space_f, h5aget_type_f, h5aopen_f, h5aopen_by_name_f, h5aread_f, h5awrite_f, &
    & h5dclose_f, &
    & h5dcreate_f, h5dget_space_f, h5dget_type_f, h5dopen_f, h5dread_f, h5dset_extent_f, h5dvlen_reclaim_f, &
    & h5dwrite_f, h5eset_auto_f, &
    & h5fclose_f, h5fcreate_f, h5fflush_f, h5fget_filesize_f, h5fis_hdf5_f, h5fopen_f, h5gclose_f, h5gcreate_anon_f, h5gcreate_f, &
    & h5gn_members_f, h5kind_to_type, h5ldelete_f, h5lexists_f, h5lget_name_by_idx_f, h5oclose_f, h5odecr_refcount_f, &
    & h5oincr_refcount_f, h5olink_f, h5oopen_f, h5open_f, &
    & h5pclose_f, h5pcreate_f, h5pset_create_inter_group_f, h5pset_dxpl_mpio_f, &
    & h5pset_alloc_time_f, h5pset_chunk_f, h5pset_istore_k_f, h5pset_est_link_info_f, &
    & h5pset_fapl_mpio_f, h5pset_link_creation_order_f, h5pset_link_phase_change_f, &
    & h5pset_fclose_degree_f, h5pset_fill_time_f, h5pset_obj_track_times_f, h5sclose_f, h5screate_f, &
    & h5screate_simple_f, h5sget_simple_extent_dims_f, h5sget_simple_extent_ndims_f, h5sget_simple_extent_npoints_f, &
    & h5sselect_hyperslab_f, h5sselect_none_f, h5tclose_f, h5tcopy_f, h5tget_class_f, h5tget_size_f, &
    & h5tis_variable_str_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, hsize_t, size_t, &
    & H5D_ALLOC_TIME_EARLY_F, H5D_FILL_TIME_NEVER_F, H5FD_MPIO_COLLECTIVE_F, H5FD_MPIO_INDEPENDENT_F, &
    & H5F_ACC_RDONLY_F, H5F_ACC_RDWR_F, H5F_ACC_TRUNC_F, &
    & H5F_CLOSE_STRONG_F, H5F_SCOPE_GLOBAL_F, H5P_DATASET_CREATE_F, H5P_DATASET_XFER_F, H5P_DEFAULT_F, &
    & H5P_CRT_ORDER_TRACKED_F, H5P_FILE_ACCESS_F, H5P_FILE_CREATE_F, H5P_GROUP_CREATE_F, H5P_LINK_CREATE_F, &
    & H5S_SCALAR_F, H5S_SELECT_SET_F, H5S_UNLIMITED_F, H5T_IEEE_F32LE, H5T_CSET_UTF8_F, H5T_C_S1, H5T_FLOAT_F, &
    & H5T_IEEE_F64LE, H5T_INTEGER_F, H5T_NO_CLASS_F, H5T_STD_I64LE, H5T_STRING, H5T_STRING_F, H5T_STR_NULLPAD_F, &
    & H5_INDEX_NAME_F, H5_INTEGER_KIND, H5_ITER_INC_F, H5_REAL_KIND
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: check_readable, check_creatable, reserve_space, file_length, extend_file, text_at
  implicit none
  private
  public :: h5_file_t
  public :: table_integer, table_single, table_double

  !> An open HDF5 file. Paths start at the root: "/steps/12/bodies/id".
  type :: h5_file_t
    private
    type(communicator_t) :: comm
    character(len=:), allocatable :: path
    integer(hid_t) :: id = -1
    logical :: writable = .false.
    !> on rank 0: length of the file when it was flushed last
    integer(i8) :: flushed = 0
    !> the group that begin_group started, not yet seen by readers
    integer(hid_t) :: hidden = -1
    character(len=:), allocatable :: hidden_path
  contains
    procedure :: create => h5_create
    procedure :: open => h5_open
    procedure :: reopen => h5_reopen
    procedure :: close => h5_close
    procedure :: flush => h5_flush
    procedure :: reserve => h5_reserve
    procedure :: is_open => h5_is_open

    procedure :: make_group => h5_make_group
    procedure :: begin_group => h5_begin_group
    procedure :: commit_group => h5_commit_group
    procedure :: abandon_group => h5_abandon_group
    procedure :: remove_group => h5_remove_group

    procedure :: exists => h5_exists
    procedure :: columns => h5_columns
    procedure :: row_count => h5_row_count
    procedure :: member_count => h5_member_count
    procedure :: member => h5_member

    !> write_rows(path, values, error): make a dataset of the rows of all ranks, in the order of the ranks
    generic :: write_rows => write_integers, write_integer_columns, write_reals, write_real_columns, write_texts
    procedure, private :: write_integers => h5_write_integers
    procedure, private :: write_integer_columns => h5_write_integer_columns
    procedure, private :: write_texts => h5_write_texts
    procedure, private :: write_reals => h5_write_reals
    procedure, private :: write_real_columns => h5_write_real_columns

    !> put_rows(path, first_row, values, error): write the rows of all ranks into a table, in the order of the ranks, from row
    !> first_row (from 0) on; the table grows
    procedure :: make_table => h5_make_table
    procedure :: cut_rows => h5_cut_rows
    generic :: put_rows => put_integer_rows, put_real_rows
    procedure, private :: put_integer_rows => h5_put_integer_rows
    procedure, private :: put_real_rows => h5_put_real_rows

    !> read_rows(path, first_row, values, error): fill `values` with rows first_row (from 0) and following; each rank
    !> asks for its own block, empty if it likes
    generic :: read_rows => read_integers, read_integer_columns, read_reals, read_real_columns
    procedure, private :: read_integers => h5_read_integers
    procedure, private :: read_integer_columns => h5_read_integer_columns
    procedure, private :: read_reals => h5_read_reals
    procedure, private :: read_real_columns => h5_read_real_columns

    !> write_attribute(path, name, value, error): attach a value, the same on all ranks, to a group or dataset
    generic :: write_attribute => write_text, write_i4, write_i8, write_i8_list, write_real
    procedure, private :: write_text => h5_write_text
    procedure, private :: write_i4 => h5_write_i4
    procedure, private :: write_i8 => h5_write_i8
    procedure, private :: write_i8_list => h5_write_i8_list
    procedure, private :: write_real => h5_write_real
    procedure :: change_attribute => h5_change_attribute

    !> read_attribute(path, name, value, error)
    generic :: read_attribute => read_text, read_i8, read_real
    procedure, private :: read_text => h5_read_text
    procedure, private :: read_i8 => h5_read_i8
    procedure, private :: read_real => h5_read_real

    procedure, private :: locate
    procedure, private :: fail
    procedure, private :: write_block
    procedure, private :: put_block
    procedure, private :: read_block
    procedure, private :: check_shape
    procedure, private :: write_value
    procedure, private :: read_value
  end type h5_file_t

  !> what a table holds
  integer, parameter :: table_integer = 1, table_single = 2, table_double = 3

  !> H5AC_cache_config_t of HDF5's C library, which its Fortran interface does not have
  type, bind(C) :: cache_config_t
    integer(c_int) :: version = 1
    logical(c_bool) :: report, open_trace, close_trace
    character(kind=c_char) :: trace_file(1025)
    logical(c_bool) :: evictions, set_initial_size
    integer(c_size_t) :: initial_size
    real(c_double) :: min_clean_fraction
    integer(c_size_t) :: max_size, min_size
    integer(c_long) :: epoch_length
    integer(c_int) :: increase_mode
    real(c_double) :: lower_threshold, increment
    logical(c_bool) :: limit_increment
    integer(c_size_t) :: max_increment
    integer(c_int) :: flash_mode
    real(c_double) :: flash_multiple, flash_threshold
    integer(c_int) :: decrease_mode
    real(c_double) :: upper_threshold, decrement
    logical(c_bool) :: limit_decrement
    integer(c_size_t) :: max_decrement
    integer(c_int) :: epochs_before_eviction
    logical(c_bool) :: apply_empty_reserve
    real(c_double) :: empty_reserve
    integer(c_size_t) :: dirty_bytes_threshold
    !> 0: rank 0 alone writes headers; 1: all ranks share them out
    integer(c_int) :: write_strategy
  end type cache_config_t

  interface
    integer(c_int) function c_get_cache_config(properties, config) bind(C, name="H5Pget_mdc_config")
      import :: c_int, c_int64_t, cache_config_t
      implicit none
      integer(c_int64_t), value :: properties
      type(cache_config_t), intent(inout) :: config
    end function c_get_cache_config

    integer(c_int) function c_set_cache_config(properties, config) bind(C, name="H5Pset_mdc_config")
      import :: c_int, c_int64_t, cache_config_t
      implicit none
      integer(c_int64_t), value :: properties
      type(cache_config_t), intent(in) :: config
    end function c_set_cache_config
  end interface

  !> the library is started at first use and ends with MPI
  logical :: library_started = .false.
  !> longest text kept in an object header, whose messages hold 64 KiB; longer ones go to a heap
  integer, parameter :: longest_inline_text = 60000
  !> reserved for an empty file, and for the link of a hidden group or other headers
  integer(i8), parameter :: bytes_of_file = 65536, bytes_of_link = 16384
  !> groups at the root that find room in its first block
  integer, parameter :: members_of_root = 8
  !> length of their names that this room is counted for
  integer, parameter :: length_of_name = 10

contains

  ! ------------------------------------------------------------------------------------------------ the file itself

  !> Create a file, replacing an older one.
  subroutine h5_create(self, comm, path, error, chunks)
    class(h5_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    !> keep room for so many chunks of each table in one block: to add one more of them is then a single write
    integer, intent(in), optional :: chunks
    integer(hid_t) :: access, creation
    integer :: stat, ignored

    if (allocated(error)) return
    call prepare(self, comm, path, error)
    ! HDF5 cannot even close a file that it cannot write to: find out beforehand
    if (comm%rank == 0) then
      call check_creatable(path, error)
      call reserve_space(path, bytes_of_file, error)
    end if
    call comm%agree(error)
    if (allocated(error)) return
    access = parallel_access(comm)
    call h5pcreate_f(H5P_FILE_CREATE_F, creation, ignored)
    call ask_for_one_block(creation, members_of_root)
    if (present(chunks)) call h5pset_istore_k_f(creation, (chunks + 1)/2, ignored)
    call h5fcreate_f(path, H5F_ACC_TRUNC_F, self%id, stat, creation_prp=creation, access_prp=access)
    call h5pclose_f(creation, ignored)
    call h5pclose_f(access, ignored)
    if (stat < 0) call raise(error, status_failure, path//": cannot create this HDF5 file")
    self%writable = .true.
    call comm%agree(error)
    call self%reserve(bytes_of_file, error)
  end subroutine h5_create

  !> Open an existing file for reading.
  subroutine h5_open(self, comm, path, error)
    class(h5_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    call open_existing(self, comm, path, .false., error)
  end subroutine h5_open

  !> Open an existing file for reading and for writing more into it.
  subroutine h5_reopen(self, comm, path, error)
    class(h5_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    call open_existing(self, comm, path, .true., error)
  end subroutine h5_reopen

  subroutine open_existing(self, comm, path, writable, error)
    type(h5_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: access
    integer :: stat, ignored

    if (allocated(error)) return
    call prepare(self, comm, path, error)
    ! one rank alone looks first: a file that HDF5 cannot make sense of is never opened by all together
    if (comm%rank == 0) then
      call check_format(path, error)
      if (writable) call reserve_space(path, bytes_of_file, error)
    end if
    call comm%agree(error)
    if (allocated(error)) return
    access = parallel_access(comm)
    call h5fopen_f(path, merge(H5F_ACC_RDWR_F, H5F_ACC_RDONLY_F, writable), self%id, stat, access_prp=access)
    call h5pclose_f(access, ignored)
    if (stat < 0) call raise(error, status_input, path//": truncated or damaged HDF5 file")
    self%writable = writable
    call comm%agree(error)
  end subroutine open_existing

  !> Check that `path` can be read and begins like an HDF5 file.
  subroutine check_format(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    logical :: is_hdf5
    integer :: stat

    call check_readable(path, error)
    if (allocated(error)) return
    call h5fis_hdf5_f(path, is_hdf5, stat)
    if (stat < 0 .or. .not. is_hdf5) call raise(error, status_input, path//": not an HDF5 file")
  end subroutine check_format

  !> Start the library, close what was open and remember where to find the file.
  subroutine prepare(self, comm, path, error)
    type(h5_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    call self%close(error)
    if (.not. library_started) then
      call h5open_f(stat)
      if (stat < 0) call raise(error, status_failure, "cannot start the HDF5 library")
      ! the library would print every error of its own accord
      call h5eset_auto_f(0, stat)
      library_started = .true.
    end if
    self%comm = comm
    self%path = path
    self%flushed = 0
  end subroutine prepare

  !> Access by all ranks of `comm` together.
  integer(hid_t) function parallel_access(comm) result(access)
    type(communicator_t), intent(in) :: comm
    type(cache_config_t) :: config
    integer :: stat

    call h5pcreate_f(H5P_FILE_ACCESS_F, access, stat)
    ! headers change together or not at all, as nearly as can be: ranks that are killed one after the other would leave
    ! some of a change written and some not
    if (c_get_cache_config(access, config) == 0) then
      config%write_strategy = 0
      stat = c_set_cache_config(access, config)
    end if
    ! HDF5 1.10 takes integer handles
    call h5pset_fapl_mpio_f(access, comm%mpi%mpi_val, MPI_INFO_NULL%mpi_val, stat)
    call h5pset_fclose_degree_f(access, H5F_CLOSE_STRONG_F, stat)
  end function parallel_access

  !> Close, whatever happened before; without effect on a file not open. A hidden group is lost.
  subroutine h5_close(self, error)
    class(h5_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    if (self%id < 0) return
    call self%abandon_group()
    call h5fclose_f(self%id, stat)
    self%id = -1
    if (stat < 0) call raise(error, merge(status_failure, status_input, self%writable), self%path//": cannot close this file")
    call self%comm%agree(error)
  end subroutine h5_close

  !> Bring everything written so far to the disk: the file stays readable whatever becomes of the program afterwards.
  subroutine h5_flush(self, error)
    class(h5_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer(hsize_t) :: length
    integer :: stat

    if (allocated(error)) return
    ! a file that the program dies over must not be shorter than its headers say
    if (self%comm%rank == 0) then
      call h5fget_filesize_f(self%id, length, stat)
      if (stat == 0) call extend_file(self%path, int(length, i8), error)
    end if
    ! HDF5 waits for ever when one rank cannot write its share of the headers: give them their place first
    if (self%comm%rank == 0) call reserve_space(self%path, bytes_of_link, error, start=self%flushed)
    call self%comm%agree(error)
    if (allocated(error)) return
    call h5fflush_f(self%id, H5F_SCOPE_GLOBAL_F, stat)
    if (stat < 0) call raise(error, status_failure, self%path//": cannot write to this file: is the disk full?")
    call self%comm%agree(error)
    if (self%comm%rank == 0) self%flushed = file_length(self%path)
  end subroutine h5_flush

  !> Make sure of `bytes` of disk space for what will be written next, its headers included (allow 64 KiB for those of
  !> a few groups). On failure nothing has been written and the file is as the last flush left it. Where the file
  !> system knows no reservation, the space that is free now is all that can be asked for.
  subroutine h5_reserve(self, bytes, error)
    class(h5_file_t), intent(in) :: self
    !> on rank 0: of all ranks together
    integer(i8), intent(in) :: bytes
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (self%comm%rank == 0) call reserve_space(self%path, bytes, error)
    call self%comm%agree(error)
  end subroutine h5_reserve

  pure logical function h5_is_open(self) result(is_open)
    class(h5_file_t), intent(in) :: self
    is_open = self%id >= 0
  end function h5_is_open

  !> Raise an error that names the file and the object in it.
  subroutine fail(self, path, what, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, merge(status_failure, status_input, self%writable), self%path//": "//path//": "//what)
  end subroutine fail

  ! ------------------------------------------------------------------------------------------------ groups

  !> Make a group, and those above it that are missing.
  subroutine h5_make_group(self, path, error, members)
    class(h5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    !> keep room for so many members, 1500 at most, in one block: to show one more of them is then a single write
    integer, intent(in), optional :: members
    integer(hid_t) :: place, group, links, creation
    character(len=:), allocatable :: name
    integer :: stat, ignored

    if (allocated(error)) return
    call self%locate(path, place, name)
    links = with_groups_above()
    call h5pcreate_f(H5P_GROUP_CREATE_F, creation, ignored)
    if (present(members)) call ask_for_one_block(creation, members)
    call h5gcreate_f(place, name, group, stat, lcpl_id=links, gcpl_id=creation)
    call h5pclose_f(creation, ignored)
    call h5pclose_f(links, ignored)
    if (stat < 0) then
      call self%fail(path, "cannot make this group", error)
    else
      call h5gclose_f(group, ignored)
    end if
    call self%comm%agree(error)
  end subroutine h5_make_group

  !> Let a group keep its links side by side in its header, with room for so many: HDF5 would share them out over a tree
  !> and a heap, which a program that dies while it writes them leaves in contradiction.
  subroutine ask_for_one_block(creation, members)
    integer(hid_t), intent(in) :: creation
    integer, intent(in) :: members
    integer :: ignored

    ! only groups with an order of their members can be kept like this
    call h5pset_link_creation_order_f(creation, H5P_CRT_ORDER_TRACKED_F, ignored)
    call h5pset_link_phase_change_f(creation, members, members, ignored)
    call h5pset_est_link_info_f(creation, members, length_of_name, ignored)
  end subroutine ask_for_one_block

  !> Start a group that appears in the file only with commit_group; until then every path at or below `path` leads
  !> into it. Should the program die meanwhile, the file is what it was before.
  subroutine h5_begin_group(self, path, error)
    class(h5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    if (allocated(error)) return
    call self%abandon_group()
    if (self%exists(path)) call self%fail(path, "is in the file already", error)
    if (.not. allocated(error)) then
      call h5gcreate_anon_f(self%id, self%hidden, stat)
      if (stat < 0) then
        self%hidden = -1
        call self%fail(path, "cannot make this group", error)
      else
        self%hidden_path = path
      end if
    end if
    call self%comm%agree(error)
  end subroutine h5_begin_group

  !> Show the group that begin_group started: first its content is brought to the disk, then its name, which is one write
  !> where the group above has room for it in one block. Whenever the program dies, a reader finds the group whole or not.
  subroutine h5_commit_group(self, error)
    class(h5_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: links
    integer :: stat, ignored

    ! counted as if it had its name, so that the name changes nothing in it
    if (.not. allocated(error)) call h5oincr_refcount_f(self%hidden, ignored)
    call self%flush(error)
    call self%reserve(bytes_of_link, error)
    if (allocated(error)) then
      if (self%hidden >= 0) call h5odecr_refcount_f(self%hidden, ignored)
      call self%abandon_group()
      return
    end if
    links = with_groups_above()
    call h5olink_f(self%hidden, self%id, self%hidden_path, stat, lcpl_id=links)
    call h5pclose_f(links, ignored)
    if (stat < 0) call self%fail(self%hidden_path, "cannot make this group", error)
    call h5odecr_refcount_f(self%hidden, ignored)
    call self%comm%agree(error)
    call self%abandon_group()
    call self%flush(error)
  end subroutine h5_commit_group

  !> Let go of the group that begin_group started; HDF5 drops its content if it has no name yet. Collective.
  subroutine h5_abandon_group(self)
    class(h5_file_t), intent(inout) :: self
    integer :: ignored

    if (self%hidden < 0) return
    call h5gclose_f(self%hidden, ignored)
    self%hidden = -1
    deallocate (self%hidden_path)
  end subroutine h5_abandon_group

  !> Remove a group and all that is in it; the file can use its room again.
  subroutine h5_remove_group(self, path, error)
    class(h5_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: stat

    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5ldelete_f(place, name, stat)
    if (stat < 0) call self%fail(path, "cannot remove this group", error)
    call self%comm%agree(error)
  end subroutine h5_remove_group

  !> Property of links: missing groups on the way are made.
  integer(hid_t) function with_groups_above() result(links)
    integer :: stat
    call h5pcreate_f(H5P_LINK_CREATE_F, links, stat)
    call h5pset_create_inter_group_f(links, 1, stat)
  end function with_groups_above

  !> Where HDF5 finds `path`: a place and a name relative to it.
  subroutine locate(self, path, place, name)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t), intent(out) :: place
    character(len=:), allocatable, intent(out) :: name

    place = self%id
    name = path
    if (self%hidden < 0) return
    if (path == self%hidden_path) then
      place = self%hidden
      name = "."
    else if (index(path, self%hidden_path//"/") == 1) then
      place = self%hidden
      name = path(len(self%hidden_path) + 2:)
    end if
  end subroutine locate

  ! ------------------------------------------------------------------------------------------------ what is there

  !> True when the file has a group or dataset at `path`. Not collective.
  logical function h5_exists(self, path) result(exists)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: i, stat

    call self%locate(path, place, name)
    exists = .true.
    ! every link on the way must exist before the next one may be asked for
    do i = 2, len(name)
      if (i < len(name) .and. name(min(i + 1, len(name)):min(i + 1, len(name))) /= "/") cycle
      call h5lexists_f(place, name(1:i), exists, stat)
      if (stat < 0) exists = .false.
      if (.not. exists) return
    end do
    if (len(name) == 1 .and. name /= "/" .and. name /= ".") call h5lexists_f(place, name, exists, stat)
  end function h5_exists

  !> k of an (N, k) dataset, 0 of a vector of N numbers, -1 of anything else. Not collective.
  integer function h5_columns(self, path) result(columns)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hsize_t) :: extent(2)
    integer :: n_dims

    columns = -1
    if (.not. self%exists(path)) return
    call get_extent(self, path, n_dims, extent)
    if (n_dims == 1) columns = 0
    if (n_dims == 2) columns = int(extent(1))
  end function h5_columns

  !> N of an (N, k) dataset or of a vector of N numbers.
  subroutine h5_row_count(self, path, n, error)
    class(h5_file_t), intent(in) :: self
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
      case default
        call self%fail(path, "a dataset of one or two dimensions was expected", error)
      end select
    end if
    call self%comm%agree(error)
  end subroutine h5_row_count

  !> Number of dimensions of a dataset, -1 for anything else, and their lengths in Fortran's order when it has 1 or 2.
  subroutine get_extent(self, path, n_dims, extent)
    type(h5_file_t), intent(in) :: self
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
      end if
      call h5sclose_f(space, stat)
    end if
    call h5dclose_f(dataset, stat)
  end subroutine get_extent

  !> Number of groups and datasets in a group. Not collective.
  integer function h5_member_count(self, path) result(n)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: stat

    call self%locate(path, place, name)
    call h5gn_members_f(place, name, n, stat)
    if (stat < 0) n = 0
  end function h5_member_count

  !> Name of the i-th group or dataset in a group, in alphabetic order. Not collective.
  function h5_member(self, path, i) result(member)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: i
    character(len=:), allocatable :: member
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    character(len=255) :: buffer
    integer :: stat

    call self%locate(path, place, name)
    call h5lget_name_by_idx_f(place, name, H5_INDEX_NAME_F, H5_ITER_INC_F, int(i - 1, hsize_t), buffer, stat)
    if (stat < 0) buffer = ""
    member = trim(buffer)
  end function h5_member

  ! ------------------------------------------------------------------------------------------------ writing rows

  subroutine h5_write_integers(self, path, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    integer(i8), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1))
    call self%write_block(path, 0, size(values), H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), buffer, error)
  end subroutine h5_write_integers

  subroutine h5_write_integer_columns(self, path, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (columns, rows of this rank); the number of columns is the same on all ranks
    integer(i8), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%write_block(path, size(values, 1), size(values, 2), H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), buffer, error)
  end subroutine h5_write_integer_columns

  !> Texts without their trailing blanks, as strings of one fixed length.
  subroutine h5_write_texts(self, path, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    character(len=*), intent(in), contiguous :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    character(kind=c_char, len=:), allocatable, target :: letters
    integer(hid_t) :: type
    integer :: i, length, stat

    if (allocated(error)) return
    length = 1
    if (size(values) > 0) length = max(1, maxval(len_trim(values)))
    length = nint(self%comm%highest(real(length, dp)))
    letters = repeat(c_null_char, length*max(1, size(values)))
    do i = 1, size(values)
      letters(length*(i - 1) + 1:length*(i - 1) + len_trim(values(i))) = trim(values(i))
    end do
    call h5tcopy_f(H5T_C_S1, type, stat)
    call h5tset_size_f(type, int(length, size_t), stat)
    call h5tset_strpad_f(type, H5T_STR_NULLPAD_F, stat)
    if (self%comm%any_true(.not. is_ascii(letters))) call h5tset_cset_f(type, H5T_CSET_UTF8_F, stat)
    call self%write_block(path, 0, size(values), type, type, c_loc(letters), error)
    call h5tclose_f(type, stat)
  end subroutine h5_write_texts

  subroutine h5_write_reals(self, path, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (rows of this rank)
    real(dp), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1))
    call self%write_block(path, 0, size(values), H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND), buffer, error)
  end subroutine h5_write_reals

  subroutine h5_write_real_columns(self, path, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    !> (columns, rows of this rank); the number of columns is the same on all ranks
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%write_block(path, size(values, 1), size(values, 2), H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND), buffer, error)
  end subroutine h5_write_real_columns

  !> Make a dataset and write the rows of all ranks; n_columns = 0 makes a vector.
  subroutine write_block(self, path, n_columns, n_rows, file_type, memory_type, buffer, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: n_columns, n_rows
    integer(hid_t), intent(in) :: file_type, memory_type
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: dataset
    integer(i8) :: first, total
    integer :: stat, ignored

    if (allocated(error)) return
    total = self%comm%total(int(n_rows, i8))
    first = self%comm%offset(int(n_rows, i8))
    if (self%comm%any_true(n_columns /= nint(self%comm%highest(real(n_columns, dp))))) then
      call self%fail(path, "the number of columns differs between ranks", error)
      return
    end if
    call create_dataset(self, path, file_type, n_columns, total, dataset, stat)
    if (stat < 0) call self%fail(path, "cannot make this dataset", error)
    call self%comm%agree(error)
    if (allocated(error)) return
    if (total > 0) then
      call transfer_block(dataset, n_columns, first, n_rows, memory_type, buffer, .true., stat)
      if (stat < 0) call self%fail(path, "cannot write this dataset: is the disk full?", error)
    end if
    call h5dclose_f(dataset, ignored)
    call self%comm%agree(error)
  end subroutine write_block

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
  subroutine create_dataset(self, path, file_type, n_columns, n_rows, dataset, stat, rows_a_chunk)
    type(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t), intent(in) :: file_type
    integer, intent(in) :: n_columns
    integer(i8), intent(in) :: n_rows
    integer(hid_t), intent(out) :: dataset
    integer, intent(out) :: stat
    integer(i8), intent(in), optional :: rows_a_chunk
    integer(hid_t) :: place, space, creation, links
    integer(hsize_t) :: extent(2), chunk(2), greatest(2)
    character(len=:), allocatable :: name
    integer :: n_dims, ignored

    call self%locate(path, place, name)
    links = with_groups_above()
    call h5pcreate_f(H5P_DATASET_CREATE_F, creation, ignored)
    ! every row is written, and a file must not tell when it was made
    call h5pset_fill_time_f(creation, H5D_FILL_TIME_NEVER_F, ignored)
    call h5pset_obj_track_times_f(creation, .false., ignored)
    call get_shape(n_columns, n_rows, n_dims, extent)
    greatest = extent
    if (present(rows_a_chunk)) then
      call get_shape(n_columns, rows_a_chunk, n_dims, chunk)
      call h5pset_chunk_f(creation, n_dims, chunk(1:n_dims), ignored)
      call h5pset_alloc_time_f(creation, H5D_ALLOC_TIME_EARLY_F, ignored)
      greatest(n_dims) = H5S_UNLIMITED_F
    end if
    call h5screate_simple_f(n_dims, extent(1:n_dims), space, ignored, greatest(1:n_dims))
    call h5dcreate_f(place, name, file_type, space, dataset, stat, dcpl_id=creation, lcpl_id=links)
    call h5sclose_f(space, ignored)
    call h5pclose_f(creation, ignored)
    call h5pclose_f(links, ignored)
  end subroutine create_dataset

  !> Write or read rows [first, first + n_rows) of an open dataset. Reading is collective MPI I/O. Writing is not: the
  !> rows of a rank are one contiguous piece of the file, so that nothing is gained, and when the disk is full the
  !> aggregators of OpenMPI 4.1 lose the error and wait for ever.
  subroutine transfer_block(dataset, n_columns, first, n_rows, memory_type, buffer, writing, stat)
    integer(hid_t), intent(in) :: dataset
    integer, intent(in) :: n_columns
    integer(i8), intent(in) :: first
    integer, intent(in) :: n_rows
    integer(hid_t), intent(in) :: memory_type
    type(c_ptr), intent(in) :: buffer
    logical, intent(in) :: writing
    integer, intent(out) :: stat
    integer(hid_t) :: file_space, memory_space, mode
    integer(hsize_t) :: start(2), count(2)
    type(c_ptr) :: place
    integer :: n_dims, ignored

    place = buffer
    call get_shape(n_columns, int(max(n_rows, 1), i8), n_dims, count)
    start = 0
    start(n_dims) = int(first, hsize_t)
    call h5dget_space_f(dataset, file_space, ignored)
    call h5screate_simple_f(n_dims, count(1:n_dims), memory_space, ignored)
    if (n_rows > 0) then
      call h5sselect_hyperslab_f(file_space, H5S_SELECT_SET_F, start(1:n_dims), count(1:n_dims), ignored)
    else
      call h5sselect_none_f(file_space, ignored)
      call h5sselect_none_f(memory_space, ignored)
    end if
    call h5pcreate_f(H5P_DATASET_XFER_F, mode, ignored)
    if (writing) then
      call h5pset_dxpl_mpio_f(mode, H5FD_MPIO_INDEPENDENT_F, ignored)
      call h5dwrite_f(dataset, memory_type, place, stat, memory_space, file_space, mode)
    else
      call h5pset_dxpl_mpio_f(mode, H5FD_MPIO_COLLECTIVE_F, ignored)
      call h5dread_f(dataset, memory_type, place, stat, memory_space, file_space, mode)
    end if
    call h5pclose_f(mode, ignored)
    call h5sclose_f(memory_space, ignored)
    call h5sclose_f(file_space, ignored)
  end subroutine transfer_block

  ! ------------------------------------------------------------------------------------------------ tables that grow

  !> Make a table without rows, which put_rows lengthens: (N) with n_columns = 0, (N, n_columns) otherwise.
  subroutine h5_make_table(self, path, n_columns, kind, rows_a_chunk, error)
    class(h5_file_t), intent(inout) :: self
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

  subroutine h5_put_integer_rows(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, or 1, rows of this rank)
    integer(i8), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%put_block(path, first_row, size(values, 2), h5kind_to_type(i8, H5_INTEGER_KIND), buffer, error)
  end subroutine h5_put_integer_rows

  !> Reals; a table of integers takes them too, rounded towards zero.
  subroutine h5_put_real_rows(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, or 1, rows of this rank)
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%put_block(path, first_row, size(values, 2), h5kind_to_type(dp, H5_REAL_KIND), buffer, error)
  end subroutine h5_put_real_rows

  !> Leave the first rows of a table alone.
  subroutine h5_cut_rows(self, path, n_rows, error)
    class(h5_file_t), intent(inout) :: self
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
  subroutine put_block(self, path, first_row, n_rows, memory_type, buffer, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    integer, intent(in) :: n_rows
    integer(hid_t), intent(in) :: memory_type
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, dataset
    integer(hsize_t) :: extent(2)
    integer(i8) :: first, total, length
    character(len=:), allocatable :: name
    integer :: n_columns, n_dims, stat, ignored

    call self%row_count(path, length, error)
    if (allocated(error)) return
    n_columns = self%columns(path)
    total = self%comm%total(int(n_rows, i8))
    first = first_row + self%comm%offset(int(n_rows, i8))
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat == 0) then
      if (first_row + total > length) then
        call get_shape(n_columns, first_row + total, n_dims, extent)
        call h5dset_extent_f(dataset, extent(1:n_dims), stat)
      end if
      if (stat == 0 .and. total > 0) call transfer_block(dataset, n_columns, first, n_rows, memory_type, buffer, .true., stat)
      call h5dclose_f(dataset, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write rows of this table: is the disk full?", error)
    call self%comm%agree(error)
  end subroutine put_block

  ! ------------------------------------------------------------------------------------------------ reading rows

  subroutine h5_read_integers(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (rows this rank wants)
    integer(i8), intent(inout), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1))
    call self%read_block(path, .true., 0, first_row, size(values), h5kind_to_type(i8, H5_INTEGER_KIND), buffer, error)
  end subroutine h5_read_integers

  subroutine h5_read_integer_columns(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, rows this rank wants)
    integer(i8), intent(inout), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%read_block(path, .true., size(values, 1), first_row, size(values, 2), h5kind_to_type(i8, H5_INTEGER_KIND), &
      & buffer, error)
  end subroutine h5_read_integer_columns

  subroutine h5_read_reals(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (rows this rank wants)
    real(dp), intent(inout), contiguous, target :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1))
    call self%read_block(path, .false., 0, first_row, size(values), h5kind_to_type(dp, H5_REAL_KIND), buffer, error)
  end subroutine h5_read_reals

  subroutine h5_read_real_columns(self, path, first_row, values, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first_row
    !> (columns, rows this rank wants)
    real(dp), intent(inout), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: buffer

    buffer = c_null_ptr
    if (size(values) > 0) buffer = c_loc(values(1, 1))
    call self%read_block(path, .false., size(values, 1), first_row, size(values, 2), h5kind_to_type(dp, H5_REAL_KIND), &
      & buffer, error)
  end subroutine h5_read_real_columns

  !> Read rows [first, first + n_rows) of a dataset of the given kind and number of columns.
  subroutine read_block(self, path, integers, n_columns, first, n_rows, memory_type, buffer, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: integers
    integer, intent(in) :: n_columns, n_rows
    integer(i8), intent(in) :: first
    integer(hid_t), intent(in) :: memory_type
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, dataset
    character(len=:), allocatable :: name
    integer :: stat, ignored

    if (allocated(error)) return
    call self%check_shape(path, integers, n_columns, first, n_rows, error)
    if (allocated(error)) return
    if (self%comm%total(int(n_rows, i8)) == 0) return
    call self%locate(path, place, name)
    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) call self%fail(path, "cannot open this dataset", error)
    call self%comm%agree(error)
    if (allocated(error)) return
    call transfer_block(dataset, n_columns, first, n_rows, memory_type, buffer, .false., stat)
    if (stat < 0) call self%fail(path, "cannot read this dataset", error)
    call h5dclose_f(dataset, ignored)
    call self%comm%agree(error)
  end subroutine read_block

  !> Check that a dataset is there, of the kind and shape expected, and long enough.
  subroutine check_shape(self, path, integers, n_columns, first, n_rows, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: integers
    integer, intent(in) :: n_columns, n_rows
    integer(i8), intent(in) :: first
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: total
    integer :: found, kind_found

    call self%row_count(path, total, error)
    if (allocated(error)) return
    found = self%columns(path)
    kind_found = class_of(self, path)
    if (found /= n_columns) then
      call self%fail(path, columns_text(found)//", but "//columns_text(n_columns)//" was expected", error)
    else if (integers .and. kind_found /= H5T_INTEGER_F) then
      call self%fail(path, "not made of integers", error)
    else if (kind_found /= H5T_INTEGER_F .and. kind_found /= H5T_FLOAT_F) then
      call self%fail(path, "not made of numbers", error)
    else if (n_rows > 0 .and. (first < 0 .or. first + n_rows > total)) then
      call self%fail(path, "rows "//to_text(first)//" to "//to_text(first + n_rows - 1)//" were asked for, but it has "// &
        & to_text(total), error)
    end if
    call self%comm%agree(error)
  end subroutine check_shape

  pure function columns_text(n_columns) result(text)
    integer, intent(in) :: n_columns
    character(len=:), allocatable :: text
    if (n_columns == 0) then
      text = "a dataset of shape (N)"
    else
      text = "a dataset of shape (N, "//to_text(n_columns)//")"
    end if
  end function columns_text

  !> Class of the elements of a dataset, one of the H5T_ class constants.
  integer function class_of(self, path) result(data_class)
    type(h5_file_t), intent(in) :: self
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

  ! ------------------------------------------------------------------------------------------------ attributes

  !> Text of any length, as a string of fixed length where it fits into the header of the object.
  subroutine h5_write_text(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name, value
    type(error_t), allocatable, intent(inout) :: error
    character(kind=c_char, len=:), allocatable, target :: letters
    type(c_ptr), target :: address
    integer(hid_t) :: type
    integer :: stat

    if (allocated(error)) return
    letters = value//c_null_char
    address = c_loc(letters)
    if (len(value) > longest_inline_text) then
      call h5tcopy_f(H5T_STRING, type, stat)
      call set_character_set(type, value)
      call self%write_value(path, name, type, type, 0, c_loc(address), error)
    else
      call h5tcopy_f(H5T_C_S1, type, stat)
      call h5tset_size_f(type, int(max(1, len(value)), size_t), stat)
      call h5tset_strpad_f(type, H5T_STR_NULLPAD_F, stat)
      call set_character_set(type, value)
      call self%write_value(path, name, type, type, 0, address, error)
    end if
    call h5tclose_f(type, stat)
  end subroutine h5_write_text

  !> ASCII where the text is, UTF-8 otherwise.
  subroutine set_character_set(type, text)
    integer(hid_t), intent(in) :: type
    character(len=*), intent(in) :: text
    integer :: stat
    if (.not. is_ascii(text)) call h5tset_cset_f(type, H5T_CSET_UTF8_F, stat)
  end subroutine set_character_set

  pure logical function is_ascii(text)
    character(len=*), intent(in) :: text
    integer :: i

    is_ascii = .true.
    do i = 1, len(text)
      is_ascii = is_ascii .and. iachar(text(i:i)) <= 127
    end do
  end function is_ascii

  subroutine h5_write_i4(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i4), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%write_attribute(path, name, int(value, i8), error)
  end subroutine h5_write_i4

  subroutine h5_write_i8(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy

    copy = value
    call self%write_value(path, name, H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), 0, c_loc(copy), error)
  end subroutine h5_write_i8

  subroutine h5_write_i8_list(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    !> not empty
    integer(i8), intent(in) :: value(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy(size(value))

    copy = value
    call self%write_value(path, name, H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), size(copy), c_loc(copy), error)
  end subroutine h5_write_i8_list

  subroutine h5_write_real(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    real(dp), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp), target :: copy

    copy = value
    call self%write_value(path, name, H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND), 0, c_loc(copy), error)
  end subroutine h5_write_real

  !> Give an integer attribute that is there another value, in its place.
  subroutine h5_change_attribute(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, object, attribute
    integer(i8), target :: copy
    character(len=:), allocatable :: object_name
    type(c_ptr) :: address
    integer :: stat, ignored

    if (allocated(error)) return
    copy = value
    address = c_loc(copy)
    call self%locate(path, place, object_name)
    call h5oopen_f(place, object_name, object, stat)
    if (stat == 0) then
      call h5aopen_f(object, name, attribute, stat)
      if (stat == 0) then
        call h5awrite_f(attribute, h5kind_to_type(i8, H5_INTEGER_KIND), address, stat)
        call h5aclose_f(attribute, ignored)
      end if
      call h5oclose_f(object, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write attribute "//name, error)
    call self%comm%agree(error)
  end subroutine h5_change_attribute

  !> Write one attribute; length = 0 makes a scalar.
  subroutine write_value(self, path, name, file_type, memory_type, length, buffer, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(hid_t), intent(in) :: file_type, memory_type
    integer, intent(in) :: length
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, object, space, attribute
    integer(hsize_t) :: extent(1)
    character(len=:), allocatable :: object_name
    type(c_ptr) :: address
    integer :: stat, ignored

    if (allocated(error)) return
    address = buffer
    call self%locate(path, place, object_name)
    call h5oopen_f(place, object_name, object, stat)
    if (stat == 0) then
      if (length == 0) then
        call h5screate_f(H5S_SCALAR_F, space, ignored)
      else
        extent = int(length, hsize_t)
        call h5screate_simple_f(1, extent, space, ignored)
      end if
      call h5acreate_f(object, name, file_type, space, attribute, stat)
      if (stat == 0) then
        call h5awrite_f(attribute, memory_type, address, stat)
        call h5aclose_f(attribute, ignored)
      end if
      call h5sclose_f(space, ignored)
      call h5oclose_f(object, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write attribute "//name, error)
    call self%comm%agree(error)
  end subroutine write_value

  subroutine h5_read_i8(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy

    copy = 0
    call self%read_value(path, name, H5T_INTEGER_F, h5kind_to_type(i8, H5_INTEGER_KIND), c_loc(copy), error)
    value = copy
  end subroutine h5_read_i8

  subroutine h5_read_real(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    real(dp), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp), target :: copy

    copy = 0
    call self%read_value(path, name, H5T_FLOAT_F, h5kind_to_type(dp, H5_REAL_KIND), c_loc(copy), error)
    value = copy
  end subroutine h5_read_real

  !> Read one number of the given class.
  subroutine read_value(self, path, name, data_class, memory_type, buffer, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer, intent(in) :: data_class
    integer(hid_t), intent(in) :: memory_type
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: attribute, type
    type(c_ptr) :: address
    integer :: found, stat, ignored

    if (allocated(error)) return
    address = buffer
    call open_attribute(self, path, name, attribute, type, found, stat)
    if (stat == 0) then
      if (found /= data_class) stat = -1
      if (.not. is_scalar(attribute)) stat = -1
      if (stat == 0) call h5aread_f(attribute, memory_type, address, stat)
      call h5tclose_f(type, ignored)
      call h5aclose_f(attribute, ignored)
    end if
    if (stat < 0) call self%fail(path, "attribute "//name//" is missing or not one number of its kind", error)
    call self%comm%agree(error)
  end subroutine read_value

  !> Text of fixed or variable length, without the padding.
  subroutine h5_read_text(self, path, name, value, error)
    class(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    character(len=:), allocatable, intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: attribute, type
    logical :: variable
    integer :: found, stat, ignored

    value = ""
    if (allocated(error)) return
    call open_attribute(self, path, name, attribute, type, found, stat)
    if (stat == 0) then
      if (found /= H5T_STRING_F) stat = -1
      if (.not. is_scalar(attribute)) stat = -1
      if (stat == 0) call h5tis_variable_str_f(type, variable, stat)
      if (stat == 0 .and. variable) call read_variable_text(attribute, type, value, stat)
      if (stat == 0 .and. .not. variable) call read_fixed_text(attribute, type, value, stat)
      call h5tclose_f(type, ignored)
      call h5aclose_f(attribute, ignored)
    end if
    if (stat < 0) call self%fail(path, "attribute "//name//" is missing or not one text", error)
    call self%comm%agree(error)
  end subroutine h5_read_text

  subroutine read_fixed_text(attribute, type, value, stat)
    integer(hid_t), intent(in) :: attribute, type
    character(len=:), allocatable, intent(inout) :: value
    integer, intent(out) :: stat
    character(kind=c_char, len=:), allocatable, target :: letters
    type(c_ptr) :: address
    integer(size_t) :: length

    call h5tget_size_f(type, length, stat)
    if (stat < 0) return
    allocate (character(kind=c_char, len=length) :: letters)
    address = c_loc(letters)
    call h5aread_f(attribute, type, address, stat)
    if (stat == 0) value = up_to_null(letters)
  end subroutine read_fixed_text

  subroutine read_variable_text(attribute, type, value, stat)
    integer(hid_t), intent(in) :: attribute, type
    character(len=:), allocatable, intent(inout) :: value
    integer, intent(out) :: stat
    type(c_ptr), target :: text
    type(c_ptr) :: address
    integer(hid_t) :: space
    integer :: ignored

    text = c_null_ptr
    address = c_loc(text)
    call h5aread_f(attribute, type, address, stat)
    if (stat < 0) return
    value = text_at(text)
    call h5aget_space_f(attribute, space, ignored)
    call h5dvlen_reclaim_f(type, space, H5P_DEFAULT_F, address, ignored)
    call h5sclose_f(space, ignored)
  end subroutine read_variable_text

  pure function up_to_null(letters) result(text)
    character(len=*), intent(in) :: letters
    character(len=:), allocatable :: text
    integer :: n

    n = index(letters, c_null_char) - 1
    if (n < 0) n = len(letters)
    text = letters(1:n)
  end function up_to_null

  !> Open an attribute and its type; stat < 0 when there is none.
  subroutine open_attribute(self, path, name, attribute, type, data_class, stat)
    type(h5_file_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(hid_t), intent(out) :: attribute, type
    integer, intent(out) :: data_class, stat
    integer(hid_t) :: place
    character(len=:), allocatable :: object_name
    integer :: ignored

    attribute = -1
    type = -1
    data_class = H5T_NO_CLASS_F
    stat = -1
    if (.not. self%exists(path)) return
    call self%locate(path, place, object_name)
    call h5aopen_by_name_f(place, object_name, name, attribute, stat)
    if (stat < 0) return
    call h5aget_type_f(attribute, type, stat)
    if (stat == 0) call h5tget_class_f(type, data_class, stat)
    if (stat < 0) call h5aclose_f(attribute, ignored)
  end subroutine open_attribute

  logical function is_scalar(attribute)
    integer(hid_t), intent(in) :: attribute
    integer(hid_t) :: space
    integer(hsize_t) :: n_points
    integer :: stat

    is_scalar = .false.
    call h5aget_space_f(attribute, space, stat)
    if (stat < 0) return
    call h5sget_simple_extent_npoints_f(space, n_points, stat)
    is_scalar = stat == 0 .and. n_points == 1
    call h5sclose_f(space, stat)
  end function is_scalar

end module gravier_hdf5_file
