!> Text files written piece by piece, every write checked. Not collective: one rank writes.
module gravier_text_file
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_size_t
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_file_system, only: is_device, remove_file
  use gravier_own_files, only: part_of, give_name, note_own
  use gravier_system_calls, only: c_close, c_creat, c_fsync, c_ftruncate, c_lseek, c_open, c_write, c_text, last_error, &
    & reason, o_wronly, file_mode, seek_set, seek_end, eintr
  implicit none
  private
  public :: text_file_t

  !> A text file that is readable at any moment: it takes its name once it holds what it begins with; after a failed write it ends
  !> with the last complete piece.
  type :: text_file_t
    private
    integer(c_int) :: descriptor = -1
    !> bytes written so far
    integer(c_int64_t) :: length = 0
    !> where it is
    character(len=:), allocatable :: path
  contains
    procedure :: create => text_file_create
    procedure :: begin => text_file_begin
    procedure :: show => text_file_show
    procedure :: continue => text_file_continue
    procedure :: append => text_file_append
    procedure :: sync => text_file_sync
    procedure :: close => text_file_close
    procedure :: is_open => text_file_is_open
  end type text_file_t

contains

  !> Create a file that begins with `text`, in place of an older one. Failure: status_failure, with the system's reason; an older
  !> file is as it was.
  subroutine text_file_create(self, path, text, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path, text
    type(error_t), allocatable, intent(inout) :: error

    call self%begin(path, error)
    call self%append(text, error)
    call self%show(path, error)
  end subroutine text_file_create

  !> Begin a file aside, to be shown under the name `path`. A terminal, a pipe or the like is written to at once. Failure:
  !> status_failure, with the system's reason.
  subroutine text_file_begin(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call self%close(error)
    self%path = part_of(path)
    if (is_device(path)) self%path = path
    self%length = 0
    self%descriptor = c_creat(c_text(self%path), file_mode)
    if (self%descriptor < 0) then
      call raise(error, status_failure, self%path//": cannot create this file: "//reason(last_error()))
    end if
  end subroutine text_file_begin

  !> Give the file that was begun aside its name; it stays open. To be called also when something failed before: what was begun is
  !> then closed and removed.
  subroutine text_file_show(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: ignored

    if (.not. self%is_open() .or. self%path == path) return
    call give_name(path, error)
    if (allocated(error)) then
      call self%close(ignored)
      call remove_file(self%path)
    else
      self%path = path
    end if
  end subroutine text_file_show

  !> Open a file behind what it holds, creating it where there is none. Failure: status_failure, with the system's reason.
  subroutine text_file_continue(self, path, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    logical :: exists

    if (allocated(error)) return
    inquire (file=path, exist=exists)
    if (.not. exists) then
      call self%create(path, "", error)
      return
    end if
    call self%close(error)
    self%path = path
    self%descriptor = c_open(c_text(path), o_wronly, 0_c_int)
    if (self%descriptor < 0) then
      call raise(error, status_failure, path//": cannot write to this file: "//reason(last_error()))
      return
    end if
    call note_own(path)
    self%length = c_lseek(self%descriptor, 0_c_int64_t, seek_end)
  end subroutine text_file_continue

  !> Append text and hand it to the system at once. On failure the file is cut back to what it held before.
  subroutine text_file_append(self, text, error)
    class(text_file_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int64_t) :: done, written, ignored
    integer(c_int) :: number, cut

    if (allocated(error)) return
    done = 0
    do while (done < len(text))
      written = c_write(self%descriptor, text(done + 1:), int(len(text) - done, c_size_t))
      if (written >= 0) then
        done = done + written
        cycle
      end if
      number = last_error()
      if (number == eintr) cycle
      cut = c_ftruncate(self%descriptor, self%length)
      ignored = c_lseek(self%descriptor, self%length, seek_set)
      call raise(error, status_failure, self%path//": cannot write to this file: "//reason(number)//": "// &
        & to_text(int(len(text), i8))//" bytes needed; what was written before stays readable")
      return
    end do
    self%length = self%length + done
  end subroutine text_file_append

  !> Bring what was written to the disk. Without effect on a file not open, and on what has no room on a disk. Failure:
  !> status_failure, with the system's reason.
  subroutine text_file_sync(self, error)
    class(text_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (self%descriptor < 0 .or. allocated(error)) return
    if (is_device(self%path)) return
    if (c_fsync(self%descriptor) /= 0) call raise(error, status_failure, self%path//": cannot bring this file to the disk: "// &
      & reason(last_error()))
  end subroutine text_file_sync

  !> Close; a failure that the system had kept to itself shows here. Without effect on a file not open.
  subroutine text_file_close(self, error)
    class(text_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (self%descriptor < 0) return
    if (c_close(self%descriptor) /= 0) then
      call raise(error, status_failure, self%path//": cannot close this file: "//reason(last_error()))
    end if
    self%descriptor = -1
  end subroutine text_file_close

  pure logical function text_file_is_open(self) result(is_open)
    class(text_file_t), intent(in) :: self
    is_open = self%descriptor >= 0
  end function text_file_is_open

end module gravier_text_file
