!> Checkpoints: everything that a run needs to go on, bit by bit, in one HDF5 file that any number of ranks can read. It
!> takes its name only when it is complete and on the disk: whatever happens meanwhile, an older checkpoint stays.
module gravier_checkpoint_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_room, only: room_for
  use gravier_narrow, only: check_counts
  use gravier_communicator, only: communicator_t
  use gravier_hdf5_file, only: h5_file_t
  implicit none
  private
  public :: checkpoint_file_t

  !> A checkpoint being written (create, write_..., commit) or read (open, read_..., close). All procedures are
  !> collective and leave the same error on all ranks.
  type :: checkpoint_file_t
    private
    type(communicator_t) :: comm
    type(h5_file_t) :: file
    character(len=:), allocatable :: path
  contains
    procedure :: create => checkpoint_create
    procedure :: commit => checkpoint_commit
    procedure :: open => checkpoint_open
    procedure :: close => checkpoint_close
    !> write_scalar(name, value, error): an integer(i8) or a real, the same on all ranks
    generic :: write_scalar => write_integer, write_real
    procedure, private :: write_integer => checkpoint_write_integer
    procedure, private :: write_real => checkpoint_write_real
    procedure :: write_text => checkpoint_write_text
    procedure :: write_array => checkpoint_write_array
    procedure :: write_table => checkpoint_write_table
    !> read_scalar(name, value, error)
    generic :: read_scalar => read_integer, read_real
    procedure, private :: read_integer => checkpoint_read_integer
    procedure, private :: read_real => checkpoint_read_real
    procedure :: read_text => checkpoint_read_text
    procedure :: read_array => checkpoint_read_array
    procedure :: read_table => checkpoint_read_table
    procedure, private :: refuse
  end type checkpoint_file_t

  !> what /format says of itself
  character(len=*), parameter :: format_name = "gravier checkpoint"
  !> room for the headers of the file, and of a table
  integer(i8), parameter :: bytes_of_headers = 65536, bytes_of_table = 16384
  integer, parameter :: bytes_of_word = 8

contains

  ! ------------------------------------------------------------------------------------------------ writing

  !> Begin a checkpoint; it is written beside `path` until commit. Failure: status_failure.
  subroutine checkpoint_create(self, comm, path, records, error)
    class(checkpoint_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> what the words of its records are, a line a kind: the version of the file
    character(len=*), intent(in) :: records
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    call self%file%create(comm, path, error)
    call self%file%reserve(bytes_of_headers, error)
    call self%file%make_group("/format", error)
    call self%file%write_attribute("/format", "name", format_name, error)
    call self%file%write_attribute("/format", "records", records, error)
    call self%file%make_group("/scalars", error)
    call self%file%make_group("/texts", error)
    call self%file%make_group("/arrays", error)
    call self%file%make_group("/tables", error)
    ! files of no checkpoint are not left behind
    if (allocated(error)) call self%file%discard()
  end subroutine checkpoint_create

  !> Put what was written in the place of an older checkpoint. To be called also when something failed before: the part
  !> then goes and the older checkpoint stays.
  subroutine checkpoint_commit(self, error)
    class(checkpoint_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    call self%file%close(error)
  end subroutine checkpoint_commit

  subroutine checkpoint_write_integer(self, name, value, error)
    class(checkpoint_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%file%write_attribute("/scalars", name, value, error)
  end subroutine checkpoint_write_integer

  subroutine checkpoint_write_real(self, name, value, error)
    class(checkpoint_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%file%write_attribute("/scalars", name, value, error)
  end subroutine checkpoint_write_real

  !> A text of any length, the same on all ranks, without the blanks at its end.
  subroutine checkpoint_write_text(self, name, value, error)
    class(checkpoint_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, value
    type(error_t), allocatable, intent(inout) :: error
    character(len=len(value)) :: values(1)

    values(1) = value
    call self%file%reserve(bytes_of_table + len(value), error)
    call self%file%write_rows("/texts/"//name, values(1:merge(1, 0, self%comm%rank == 0)), error)
  end subroutine checkpoint_write_text

  !> Numbers that all ranks hold: those of rank 0 are written.
  subroutine checkpoint_write_array(self, name, values, error)
    class(checkpoint_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    n = merge(size(values), 0, self%comm%rank == 0)
    call self%file%reserve(bytes_of_table + bytes_of_word*size(values, kind=i8), error)
    call self%file%write_rows("/arrays/"//name, values(1:n), error)
  end subroutine checkpoint_write_array

  !> Records of all subdomains, in the order of the subdomains.
  subroutine checkpoint_write_table(self, name, n_subdomains, records, counts, error)
    class(checkpoint_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> of the whole scene
    integer, intent(in) :: n_subdomains
    !> (words of a record, n): those of the first subdomain of this rank, then those of the next; reals as 64-bit words
    integer(i8), intent(in), contiguous :: records(:, :)
    !> (subdomains of this rank): number of records of each
    integer(i8), intent(in), contiguous :: counts(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: words

    if (allocated(error)) return
    if (size(counts) /= own_subdomains(self%comm, n_subdomains) .or. sum(counts) /= size(records, 2) .or. any(counts < 0)) then
      call raise(error, status_failure, self%path//": table "//name//": the counts of rank "//to_text(self%comm%rank)// &
        & " do not fit its subdomains and records")
    end if
    call self%comm%agree(error)
    words = self%comm%total(size(records, kind=i8)) + n_subdomains
    call self%file%reserve(bytes_of_table + bytes_of_word*words, error)
    call self%file%make_group("/tables/"//name, error)
    call self%file%write_rows("/tables/"//name//"/counts", counts, error)
    call self%file%write_rows("/tables/"//name//"/records", records, error)
  end subroutine checkpoint_write_table

  !> Number of subdomains of this rank.
  pure integer function own_subdomains(comm, n_subdomains) result(n)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: n_subdomains
    n = comm%first_subdomain(comm%rank + 1, n_subdomains) - comm%first_subdomain(comm%rank, n_subdomains)
  end function own_subdomains

  ! ------------------------------------------------------------------------------------------------ reading

  !> Open a checkpoint. Failure (status_input): no such file, truncated, another kind of file, other records.
  subroutine checkpoint_open(self, comm, path, records, error)
    class(checkpoint_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> as for create
    character(len=*), intent(in) :: records
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name, found
    logical :: known

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    call self%file%open(comm, path, error)
    if (allocated(error)) return
    if (.not. self%file%exists("/format")) call self%refuse("not a checkpoint", error)
    call self%file%read_attribute("/format", "name", name, error)
    if (name /= format_name) call self%refuse("not a checkpoint", error)
    known = self%file%has_attribute("/format", "records")
    if (.not. known) then
      call self%refuse("a checkpoint of an earlier version of Gravier, which does not say what its records are", error)
    end if
    call self%file%read_attribute("/format", "records", found, error)
    if (found /= records) call self%refuse("a checkpoint of another version of Gravier: "//difference(found, records), error)
    if (allocated(error)) call self%file%close(error)
  end subroutine checkpoint_open

  !> The first line in which the records of a file are not those expected.
  pure function difference(found, expected) result(text)
    character(len=*), intent(in) :: found, expected
    character(len=:), allocatable :: text
    integer :: start

    start = 1
    do while (line_at(found, start) == line_at(expected, start) .and. start <= max(len(found), len(expected)))
      start = start + len(line_at(expected, start)) + 1
    end do
    text = 'its records are "'//line_at(found, start)//'", but "'//line_at(expected, start)//'" was expected'
  end function difference

  !> The line of a text that begins at a place, without its end; none beyond the text.
  pure function line_at(text, start) result(line)
    character(len=*), intent(in) :: text
    integer, intent(in) :: start
    character(len=:), allocatable :: line

    line = text(min(start, len(text) + 1):)
    if (index(line, new_line("a")) > 0) line = line(1:index(line, new_line("a")) - 1)
  end function line_at

  !> Close what was opened for reading; without effect on a file not open.
  subroutine checkpoint_close(self, error)
    class(checkpoint_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%file%close(error)
  end subroutine checkpoint_close

  subroutine refuse(self, what, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, self%path//": "//what)
  end subroutine refuse

  subroutine checkpoint_read_integer(self, name, value, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%file%read_attribute("/scalars", name, value, error)
  end subroutine checkpoint_read_integer

  subroutine checkpoint_read_real(self, name, value, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    real(dp), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%file%read_attribute("/scalars", name, value, error)
  end subroutine checkpoint_read_real

  subroutine checkpoint_read_text(self, name, value, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%file%read_long_text("/texts/"//name, value, error)
  end subroutine checkpoint_read_text

  !> The whole array on every rank. Failure: status_input, for an array that is missing, damaged or of another length.
  subroutine checkpoint_read_array(self, name, least, most, values, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    !> lengths that it may have
    integer, intent(in) :: least, most
    !> allocated in any case, empty after a failure
    integer(i8), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: n

    call self%file%row_count("/arrays/"//name, n, error)
    if (n < least .or. n > most) call self%refuse("/arrays/"//name//": "//to_text(n)//" words, but "//to_text(least)// &
      & " to "//to_text(most)//" were expected", error)
    allocate (values(room_for(n, 8, self%path//": /arrays/"//name, error)), source=0_i8)
    call self%comm%agree(error)
    call self%file%read_rows("/arrays/"//name, 0_i8, values, error)
  end subroutine checkpoint_read_array

  !> The records of the subdomains that this rank owns now, whatever rank wrote them. Failure: status_input, for a table
  !> that is missing or damaged, of another number of subdomains or of records of another width.
  subroutine checkpoint_read_table(self, name, n_subdomains, words, records, counts, error)
    class(checkpoint_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    !> of the whole scene
    integer, intent(in) :: n_subdomains
    !> of a record
    integer, intent(in) :: words
    !> (words, sum(counts)), as write_table has them; allocated in any case
    integer(i8), allocatable, intent(out) :: records(:, :)
    !> (subdomains of this rank)
    integer(i8), allocatable, intent(out) :: counts(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group
    integer(i8) :: n_counts, n_records, total, first
    integer :: width
    logical :: damaged

    allocate (counts(own_subdomains(self%comm, n_subdomains)), source=0_i8)
    if (allocated(error)) then
      allocate (records(words, 0))
      return
    end if
    group = "/tables/"//name
    width = self%file%columns(group//"/records")
    if (width >= 0 .and. width /= words) then
      call self%refuse(group//": records of "//to_text(width)//" words, but "//to_text(words)//" were expected", error)
    end if
    call self%file%row_count(group//"/records", n_records, error)
    call self%file%row_count(group//"/counts", n_counts, error)
    if (n_counts /= n_subdomains) then
      call self%refuse(group//": "//to_text(n_counts)//" subdomains, but "//to_text(n_subdomains)//" were expected", error)
    end if
    call self%file%read_rows(group//"/counts", int(self%comm%first_subdomain(self%comm%rank, n_subdomains) - 1, i8), counts, error)
    damaged = self%comm%any_true(any(counts < 0 .or. counts > n_records))
    total = self%comm%total(sum(counts))
    if (damaged .or. total /= n_records) then
      call self%refuse(group//": the counts of records do not add up to the "//to_text(n_records)//" that are there", error)
    end if
    if (allocated(error)) counts(:) = 0
    call check_counts(counts, self%path//": "//group//"/counts", error)
    allocate (records(words, room_for(sum(counts), 8*words, self%path//": "//group, error)), source=0_i8)
    call self%comm%agree(error)
    first = self%comm%offset(sum(counts))
    call self%file%read_rows(group//"/records", first, records, error)
  end subroutine checkpoint_read_table

end module gravier_checkpoint_file
