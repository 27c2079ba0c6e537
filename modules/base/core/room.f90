!> Memory: what is left of it, arrays that may be too large for it, and how an amount is written.
module gravier_room
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  implicit none
  private
  public :: make_room, free_memory, process_limit, bytes_text, raise_no_room

  !> make_room(array, n, what, error) and make_room(array, k, n, what, error): allocate (n) or (k, n) zeros. Failure
  !> (status_failure): there is no memory for it; the array is then empty.
  interface make_room
    procedure :: room_for_integers, room_for_integer_rows, room_for_reals, room_for_real_rows, room_for_small_integers
  end interface make_room

  !> struct rlimit of the C library.
  type, bind(C) :: limit_t
    integer(c_int64_t) :: soft, hard
  end type limit_t

  interface
    integer(c_int) function c_getrlimit(resource, limit) bind(C, name="getrlimit")
      import :: c_int, limit_t
      implicit none
      integer(c_int), value :: resource
      type(limit_t), intent(out) :: limit
    end function c_getrlimit
  end interface

  !> RLIMIT_AS of Linux: bytes of addresses of a process
  integer(c_int), parameter :: limit_of_addresses = 9
  !> where the limits of a control group are, and what of them is used, in its two versions
  character(len=*), parameter :: group_limit(2) = [character(len=48) :: "/sys/fs/cgroup/memory.max", &
    & "/sys/fs/cgroup/memory/memory.limit_in_bytes"]
  character(len=*), parameter :: group_use(2) = [character(len=48) :: "/sys/fs/cgroup/memory.current", &
    & "/sys/fs/cgroup/memory/memory.usage_in_bytes"]
  integer(i8), parameter :: kibibyte = 1024

contains

  subroutine room_for_integers(array, n, what, error)
    integer(i8), allocatable, intent(out) :: array(:)
    integer(i8), intent(in) :: n
    !> for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    allocate (array(n), source=0_i8, stat=stat)
    if (stat == 0) return
    call raise_no_room(what, 8*real(n, dp), error)
    allocate (array(0))
  end subroutine room_for_integers

  subroutine room_for_integer_rows(array, k, n, what, error)
    integer(i8), allocatable, intent(out) :: array(:, :)
    integer, intent(in) :: k
    integer(i8), intent(in) :: n
    !> for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    allocate (array(k, n), source=0_i8, stat=stat)
    if (stat == 0) return
    call raise_no_room(what, 8*k*real(n, dp), error)
    allocate (array(k, 0))
  end subroutine room_for_integer_rows

  subroutine room_for_reals(array, n, what, error)
    real(dp), allocatable, intent(out) :: array(:)
    integer(i8), intent(in) :: n
    !> for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    allocate (array(n), source=0.0_dp, stat=stat)
    if (stat == 0) return
    call raise_no_room(what, 8*real(n, dp), error)
    allocate (array(0))
  end subroutine room_for_reals

  subroutine room_for_real_rows(array, k, n, what, error)
    real(dp), allocatable, intent(out) :: array(:, :)
    integer, intent(in) :: k
    integer(i8), intent(in) :: n
    !> for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    allocate (array(k, n), source=0.0_dp, stat=stat)
    if (stat == 0) return
    call raise_no_room(what, 8*k*real(n, dp), error)
    allocate (array(k, 0))
  end subroutine room_for_real_rows

  subroutine room_for_small_integers(array, n, what, error)
    integer(i4), allocatable, intent(out) :: array(:)
    integer(i8), intent(in) :: n
    !> for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat

    allocate (array(n), source=0_i4, stat=stat)
    if (stat == 0) return
    call raise_no_room(what, 4*real(n, dp), error)
    allocate (array(0))
  end subroutine room_for_small_integers

  !> Raise status_failure: there is no memory for so many bytes.
  pure subroutine raise_no_room(what, bytes, error)
    !> that wants them
    character(len=*), intent(in) :: what
    real(dp), intent(in) :: bytes
    type(error_t), allocatable, intent(inout) :: error

    call raise(error, status_failure, what//": out of memory: "//bytes_text(bytes)//" cannot be had")
  end subroutine raise_no_room

  !> Bytes of memory that all processes of this machine together can still get, within the limits of the control group of this one;
  !> 0 where the system does not tell.
  integer(i8) function free_memory() result(bytes)
    integer(i8) :: limit, used
    integer :: k

    bytes = kibibyte*(number_after("/proc/meminfo", "MemAvailable:") + number_after("/proc/meminfo", "SwapFree:"))
    do k = 1, size(group_limit)
      limit = number_after(trim(group_limit(k)), "")
      used = number_after(trim(group_use(k)), "")
      if (limit > 0 .and. bytes > 0) bytes = max(1_i8, min(bytes, limit - used))
    end do
  end function free_memory

  !> Bytes that this process may still get below its own limit (ulimit -v); huge without one.
  integer(i8) function process_limit() result(bytes)
    type(limit_t) :: limit

    bytes = huge(bytes)
    if (c_getrlimit(limit_of_addresses, limit) /= 0) return
    ! RLIM_INFINITY has all bits set
    if (limit%soft >= 0 .and. limit%soft < huge(bytes)) bytes = max(0_i8, limit%soft - kibibyte*number_after("/proc/self/status", &
      & "VmSize:"))
  end function process_limit

  !> The number behind a word that a line of a file begins with; 0 without one.
  integer(i8) function number_after(path, word) result(number)
    character(len=*), intent(in) :: path, word
    character(len=120) :: line
    integer :: unit, stat, ignored

    number = 0
    open (newunit=unit, file=path, action="read", status="old", iostat=stat)
    if (stat /= 0) return
    do
      read (unit, "(a)", iostat=stat) line
      if (stat /= 0) exit
      if (line(1:len(word)) /= word) cycle
      read (line(len(word) + 1:), *, iostat=ignored) number
      if (ignored /= 0) number = 0
      exit
    end do
    close (unit)
  end function number_after

  !> An amount of memory in the unit that suits it: 3.2 GB.
  pure function bytes_text(bytes) result(text)
    real(dp), intent(in) :: bytes
    character(len=:), allocatable :: text
    character(len=*), parameter :: units(6) = [character(len=2) :: "kB", "MB", "GB", "TB", "PB", "EB"]
    character(len=24) :: buffer
    integer :: k

    k = 1
    do while (bytes >= 0.9995_dp*1000.0_dp**(k + 1) .and. k < size(units))
      k = k + 1
    end do
    write (buffer, "(f12.1)") bytes/1000.0_dp**k
    text = trim(adjustl(buffer))//" "//units(k)
  end function bytes_text

end module gravier_room
