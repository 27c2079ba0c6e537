!> A lock on the place where a program writes, so that no other one writes there at the same time. The system keeps it for each rank
!> and releases it when the last one has died, whatever becomes of the launcher. Places: a directory, locked by the file
!> .gravier.lock in it, or one file, locked by .NAME.lock beside it; a text in the lock file says who holds it.
module gravier_output_lock
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_loc, c_short, c_size_t
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_process, only: pause_for
  use gravier_text, only: to_text, shell_word
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: place_t, place_of, place_of_open, is_device, host_name, remove_file
  use gravier_system_calls, only: c_close, c_fcntl, c_ftruncate, c_getpid, c_open, c_read, c_write, c_text, &
    & last_error, reason, range_lock_t, set_lock, lock_exclusive, lock_shared, o_rdonly, o_rdwr, o_creat, o_cloexec, &
    & file_mode, eacces, eagain, eintr, enolck, enosys, eopnotsupp
  implicit none
  private
  public :: output_lock_t

  !> A lock that is held from `take_directory` or `take_file` to `release`. All procedures are collective.
  type :: output_lock_t
    private
    type(communicator_t) :: comm
    character(len=:), allocatable :: path
    integer(c_int) :: descriptor = -1
    !> the file system keeps no locks: nothing is held
    logical, public :: unknown = .false.
  contains
    procedure :: take_directory => output_lock_take_directory
    procedure :: take_file => output_lock_take_file
    procedure :: release => output_lock_release
  end type output_lock_t

  !> bytes of the lock file: rank 0 alone locks the first, all ranks of a program share the second; a program begins by locking
  !> both for itself
  integer(c_int64_t), parameter :: byte_of_root = 0, byte_of_ranks = 1
  !> ranks of a program whose launcher was killed are gone after a second or two: looks at the lock, and time between them [us]
  integer, parameter :: looks = 50
  integer(c_int), parameter :: pause = 100000
  integer, parameter :: longest_note = 1000

contains

  !> Take the lock of a directory that exists. Failure: status_input where another program writes there, with what it says of
  !> itself; status_failure, with the system's reason. Errors are the same on all ranks.
  subroutine output_lock_take_directory(self, comm, directory, program, error)
    class(output_lock_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: directory
    !> for the others: what writes here
    character(len=*), intent(in) :: program
    type(error_t), allocatable, intent(inout) :: error
    call take(self, comm, directory, directory//"/.gravier.lock", program, error)
  end subroutine output_lock_take_directory

  !> Take the lock of one file, which need not exist, in a directory that does. Errors as for a directory. A terminal, a pipe or the
  !> like has none.
  subroutine output_lock_take_file(self, comm, path, program, error)
    class(output_lock_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> for the others: what writes this file
    character(len=*), intent(in) :: program
    type(error_t), allocatable, intent(inout) :: error
    integer :: slash
    logical :: device

    device = .false.
    if (comm%rank == 0) device = is_device(path)
    if (comm%any_true(device)) return
    slash = index(path, "/", back=.true.)
    call take(self, comm, path, path(1:slash)//"."//path(slash + 1:)//".lock", program, error)
  end subroutine output_lock_take_file

  subroutine take(self, comm, place, path, program, error)
    type(output_lock_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> what is locked, and the file that does it
    character(len=*), intent(in) :: place, path
    character(len=*), intent(in) :: program
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int) :: number
    integer :: look

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    if (comm%rank == 0) then
      do look = 1, looks
        call try(self, number)
        if (number /= eagain) exit
        call pause_for(pause)
      end do
      if (number == eagain) then
        call raise(error, status_input, place//": "//holder(path))
      else if (keeps_no_locks(number)) then
        self%unknown = .true.
      else if (number /= 0) then
        call raise(error, status_failure, path//": cannot lock this file: "//reason(number))
      else
        call sign(self, program, error)
      end if
    end if
    call comm%barrier_asleep()
    call comm%agree(error)
    self%unknown = comm%any_true(self%unknown)
    if (allocated(error) .or. self%unknown) return
    if (comm%rank /= 0) then
      self%descriptor = c_open(c_text(path), ior(o_rdwr, o_cloexec), 0_c_int)
      number = 0
      if (self%descriptor < 0) number = last_error()
      if (number == 0) number = lock_bytes(self%descriptor, lock_shared, byte_of_ranks, 1_c_int64_t)
      if (number /= 0) call raise(error, status_failure, path//": cannot lock this file: "//reason(number))
    end if
    call comm%agree(error)
    if (allocated(error)) call self%release()
  end subroutine take

  !> Lock the file for this program, unless another one does; the result is the system's error number, 0 for success.
  subroutine try(self, number)
    type(output_lock_t), intent(inout) :: self
    integer(c_int), intent(out) :: number
    type(place_t) :: opened
    integer(c_int) :: ignored

    do
      self%descriptor = c_open(c_text(self%path), ior(o_rdwr, ior(o_creat, o_cloexec)), file_mode)
      number = 0
      if (self%descriptor < 0) then
        number = last_error()
        return
      end if
      number = lock_bytes(self%descriptor, lock_exclusive, byte_of_root, 2_c_int64_t)
      ! a program that has ended meanwhile has removed the file: others do not see a lock on that one, where the system tells
      if (number == 0) then
        opened = place_of_open(self%descriptor)
        if (.not. opened%is_there()) exit
        if (opened == place_of(self%path)) exit
      end if
      ignored = c_close(self%descriptor)
      self%descriptor = -1
      if (number /= 0) return
    end do
    number = lock_bytes(self%descriptor, lock_shared, byte_of_ranks, 1_c_int64_t)
  end subroutine try

  !> Lock a range of bytes of an open file; the result is the system's error number, 0 for success, eagain where another process
  !> holds it.
  integer(c_int) function lock_bytes(descriptor, kind, start, length) result(number)
    integer(c_int), intent(in) :: descriptor
    integer(c_short), intent(in) :: kind
    integer(c_int64_t), intent(in) :: start, length
    type(range_lock_t) :: range

    do
      range = range_lock_t(kind=kind, start=start, length=length)
      number = 0
      if (c_fcntl(descriptor, set_lock, range) /= 0) number = last_error()
      if (number == eacces) number = eagain
      if (number /= eintr) return
    end do
  end function lock_bytes

  pure logical function keeps_no_locks(number)
    integer(c_int), intent(in) :: number
    keeps_no_locks = number == enolck .or. number == enosys .or. number == eopnotsupp
  end function keeps_no_locks

  !> Write into the lock file who holds it: the machine, then the program.
  subroutine sign(self, program, error)
    type(output_lock_t), intent(inout) :: self
    character(len=*), intent(in) :: program
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: note
    integer(c_int) :: ignored

    note = host_name()//new_line("a")//program//", process "//to_text(int(c_getpid(), i8))//new_line("a")
    ignored = c_ftruncate(self%descriptor, 0_c_int64_t)
    if (c_write(self%descriptor, note, len(note, c_size_t)) /= len(note)) then
      call raise(error, status_failure, self%path//": cannot write to this file: "//reason(last_error()))
      call remove_file(self%path)
      ignored = c_close(self%descriptor)
      self%descriptor = -1
    end if
  end subroutine sign

  !> Who holds a lock, and what can be done.
  function holder(path) result(text)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    character(len=:), allocatable :: host, program
    integer :: first, second

    text = note_of(path)
    first = index(text, new_line("a"))
    host = text(1:max(0, first - 1))
    second = first + index(text(first + 1:), new_line("a"))
    program = text(first + 1:max(first, second - 1))
    if (host == "" .or. program == "") then
      text = "another program writes here, "//path//" is locked"
    else if (host == host_name()) then
      text = "another program writes here: "//program
    else
      text = "another program writes here: "//program//" on "//host//"; if that one is no more, this clears its lock: rm "// &
        & shell_word(path)
    end if
    text = text//"; expected a place that no other program writes to"
  end function holder

  !> The text of a lock file; empty where it cannot be read.
  function note_of(path) result(note)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: note
    character(kind=c_char, len=longest_note), target :: buffer
    integer(c_int64_t) :: length
    integer(c_int) :: descriptor, ignored

    note = ""
    descriptor = c_open(c_text(path), o_rdonly, 0_c_int)
    if (descriptor < 0) return
    length = c_read(descriptor, c_loc(buffer), int(longest_note, c_size_t))
    if (length > 0) note = buffer(1:length)
    ignored = c_close(descriptor)
  end function note_of

  !> Release the lock and remove its file, once all ranks have come here; without effect where none is held.
  subroutine output_lock_release(self)
    class(output_lock_t), intent(inout) :: self
    integer(c_int) :: ignored

    if (.not. allocated(self%path)) return
    call self%comm%barrier()
    if (self%descriptor >= 0) then
      if (self%comm%rank == 0) then
        ! not that of a program that came after the file was removed by hand
        if (place_of_open(self%descriptor) == place_of(self%path)) call remove_file(self%path)
      end if
      ignored = c_close(self%descriptor)
    end if
    self%descriptor = -1
    deallocate (self%path)
  end subroutine output_lock_release

end module gravier_output_lock
