!> How HDF5 opens files, makes groups and stores texts: property lists and types, which callers close.
module gravier_hdf5_properties
  use, intrinsic :: iso_c_binding, only: c_bool, c_char, c_double, c_int, c_int64_t, c_long, c_size_t
  use mpi_f08, only: MPI_INFO_NULL
  use hdf5, only: H5F_CLOSE_STRONG_F, H5F_LIBVER_V18_F, H5P_CRT_ORDER_TRACKED_F, H5P_FILE_ACCESS_F, H5P_GROUP_CREATE_F, &
    & H5T_CSET_UTF8_F, H5T_C_S1, H5T_STRING, H5T_STR_NULLPAD_F, h5eset_auto_f, h5open_f, h5pcreate_f, h5pset_obj_track_times_f, &
    & h5pset_est_link_info_f, h5pset_fapl_mpio_f, h5pset_fclose_degree_f, h5pset_libver_bounds_f, h5pset_link_creation_order_f, &
    & h5pset_link_phase_change_f, h5tcopy_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, size_t
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: start_library, parallel_access, of_group, ask_for_one_block, text_type, is_ascii

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

  !> bytes of headers that HDF5 keeps in memory: each flush looks at all of them, those of earlier states too
  integer(c_size_t), parameter :: cache_size = 262144_c_size_t

  !> HDF5 runs
  logical :: library_started = .false.
  !> length of their names that this room is counted for
  integer, parameter :: length_of_name = 10

contains

  !> Start the library at its first use; it ends with MPI. Failure: status_failure.
  subroutine start_library(error)
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    if (library_started) return
    call h5open_f(stat)
    if (stat < 0) call raise(error, status_failure, "cannot start the HDF5 library")
    ! the library would print every error of its own accord
    call h5eset_auto_f(0, stat)
    library_started = .true.
  end subroutine start_library

  !> Access by all ranks of `comm` together.
  integer(hid_t) function parallel_access(comm, writing) result(access)
    type(communicator_t), intent(in) :: comm
    logical, intent(in) :: writing
    type(cache_config_t) :: config
    integer :: stat

    call h5pcreate_f(H5P_FILE_ACCESS_F, access, stat)
    ! headers change together or not at all, as nearly as can be: ranks that are killed one after the other would leave
    ! some of a change written and some not
    if (c_get_cache_config(access, config) == 0) then
      config%write_strategy = 0
      config%set_initial_size = .true._c_bool
      config%initial_size = cache_size
      config%min_size = cache_size
      config%max_size = cache_size
      stat = c_set_cache_config(access, config)
    end if
    ! HDF5 1.10 takes integer handles
    call h5pset_fapl_mpio_f(access, comm%mpi%mpi_val, MPI_INFO_NULL%mpi_val, stat)
    call h5pset_fclose_degree_f(access, H5F_CLOSE_STRONG_F, stat)
    ! headers that carry checksums, by which HDF5 knows those that were damaged; later versions mark files that are open, and
    ! those of a run that died could not be gone on with
    if (writing) call h5pset_libver_bounds_f(access, H5F_LIBVER_V18_F, H5F_LIBVER_V18_F, stat)
  end function parallel_access

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

  !> How a group is made: without the time, which a file must not tell. The caller closes it.
  integer(hid_t) function of_group() result(creation)
    integer :: stat
    call h5pcreate_f(H5P_GROUP_CREATE_F, creation, stat)
    call h5pset_obj_track_times_f(creation, .false., stat)
  end function of_group

  !> A string of fixed length, or of any where `length` is 0; the caller closes it.
  integer(hid_t) function text_type(length, ascii) result(type)
    integer, intent(in) :: length
    !> ASCII; else UTF-8
    logical, intent(in) :: ascii
    integer :: stat

    if (length > 0) then
      call h5tcopy_f(H5T_C_S1, type, stat)
      call h5tset_size_f(type, int(length, size_t), stat)
      call h5tset_strpad_f(type, H5T_STR_NULLPAD_F, stat)
    else
      call h5tcopy_f(H5T_STRING, type, stat)
    end if
    if (.not. ascii) call h5tset_cset_f(type, H5T_CSET_UTF8_F, stat)
  end function text_type

  pure logical function is_ascii(text)
    character(len=*), intent(in) :: text
    integer :: i

    is_ascii = .true.
    do i = 1, len(text)
      is_ascii = is_ascii .and. iachar(text(i:i)) <= 127
    end do
  end function is_ascii

end module gravier_hdf5_properties
