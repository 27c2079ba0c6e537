!> Where a program may write a file: where there is none, an empty one, or one that it has made.
module gravier_table_place
  use gravier_errors, only: error_t, raise, status_input
  use gravier_file_system, only: file_length, is_directory
  implicit none
  private
  public :: check_table_place, check_hdf5_place, may_replace, begins_with

  !> first bytes of an HDF5 file
  character(len=*), parameter :: hdf5_mark = char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)

contains

  !> Refuse a place for a table (status_input): a name that does not end in .csv, a directory, and a file that does not begin with
  !> the first columns of the table. Not collective.
  subroutine check_table_place(path, columns, error)
    character(len=*), intent(in) :: path
    !> first names of the header, the last one with its comma
    character(len=*), intent(in) :: columns
    type(error_t), allocatable, intent(inout) :: error
    integer :: length

    if (allocated(error)) return
    length = len(path)
    if (path(max(1, length - 3):) /= ".csv") then
      call raise(error, status_input, path//": expected a name that ends in .csv, as it becomes a table")
    else
      call check_origin(path, columns, "a table that this program has made", error)
    end if
  end subroutine check_table_place

  !> Refuse a place for an HDF5 file that has a directory or a file of another kind (status_input). Not collective.
  subroutine check_hdf5_place(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    call check_origin(path, hdf5_mark, "an HDF5 file", error)
  end subroutine check_hdf5_place

  !> Whether a run may replace what has the name of one of its files. The ending of the name says how a file of the program begins.
  !> Not collective.
  logical function may_replace(path)
    character(len=*), intent(in) :: path

    select case (path(index(path, ".", back=.true.):))
    case (".csv")
      may_replace = is_own(path, "step,")
    case (".log")
      may_replace = is_own(path, "Gravier ")
    case default
      may_replace = is_own(path, hdf5_mark)
    end select
  end function may_replace

  !> Refuse to replace what does not begin as a file of the program does.
  subroutine check_origin(path, beginning, kind, error)
    character(len=*), intent(in) :: path, beginning, kind
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (is_own(path, beginning)) return
    call raise(error, status_input, path//": there is something else, which is not replaced; expected the name of no file, or "// &
      & "of "//kind)
  end subroutine check_origin

  !> Whether a path has nothing, an empty file, or a file that begins with these bytes; a directory is none of them.
  logical function is_own(path, beginning)
    character(len=*), intent(in) :: path, beginning

    inquire (file=path, exist=is_own)
    is_own = .not. is_own
    if (is_own) return
    if (is_directory(path)) return
    is_own = file_length(path) == 0
    if (.not. is_own) is_own = begins_with(path, beginning)
  end function is_own

  !> Whether a file can be read and begins with these bytes. Not collective.
  logical function begins_with(path, beginning) result(begins)
    character(len=*), intent(in) :: path, beginning
    character(len=len(beginning)) :: head
    integer :: unit, stat

    begins = .false.
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=stat)
    if (stat /= 0) return
    read (unit, iostat=stat) head
    close (unit)
    begins = stat == 0 .and. head == beginning
  end function begins_with

end module gravier_table_place
