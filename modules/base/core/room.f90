!> Memory: what is left of it, arrays that may be too large for it, and how an amount is written.
module gravier_room
  use, intrinsic :: iso_c_binding, only: c_associated, c_int, c_int64_t, c_ptr, c_size_t
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  implicit none
  private
  public :: room_for, free_memory, group_memory, process_limit, bytes_text

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

    type(c_ptr) function c_calloc(n, bytes_each) bind(C, name="calloc")
      import :: c_ptr, c_size_t
      implicit none
      integer(c_size_t), value :: n, bytes_each
    end function c_calloc

    subroutine c_free(address) bind(C, name="free")
      import :: c_ptr
      implicit none
      type(c_ptr), value :: address
    end subroutine c_free
  end interface

  !> RLIMIT_AS of Linux: bytes of addresses of a process
  integer(c_int), parameter :: limit_of_addresses = 9
  !> control groups in their two versions: where their directories are, what a line with the group of a process has before its path,
  !> and, in the directory of a group, its limit, what of it is used, and what of that are files which the system forgets at need
  character(len=*), parameter :: group_root(2) = [character(len=24) :: "/sys/fs/cgroup", "/sys/fs/cgroup/memory"]
  character(len=*), parameter :: group_mark(2) = [character(len=8) :: "0::", ":memory:"]
  character(len=*), parameter :: group_limit(2) = [character(len=24) :: "/memory.max", "/memory.limit_in_bytes"]
  character(len=*), parameter :: group_use(2) = [character(len=24) :: "/memory.current", "/memory.usage_in_bytes"]
  character(len=*), parameter :: group_files(2, 2) = reshape([character(len=20) :: "inactive_file ", "active_file ", &
    & "total_inactive_file ", "total_active_file "], [2, 2])
  integer(i8), parameter :: kibibyte = 1024

contains

  !> n where there is memory for so many items, and 0 where there is none (status_failure), or an error already: what an array that
  !> may be too large is allocated with. It is tried whether the system gives so much at once; the trial touches no memory.
  integer(i8) function room_for(n, bytes_each, what, error)
    integer(i8), intent(in) :: n
    integer, intent(in) :: bytes_each
    !> that wants them, for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    type(c_ptr) :: trial

    room_for = 0
    if (allocated(error)) return
    trial = c_calloc(int(n, c_size_t), int(bytes_each, c_size_t))
    if (n > 0 .and. .not. c_associated(trial)) then
      call raise(error, status_failure, what//": out of memory: "//bytes_text(real(n, dp)*bytes_each)//" could not be allocated")
      return
    end if
    call c_free(trial)
    room_for = n
  end function room_for

  !> Bytes of memory that all processes of this machine together can still get, within the limits of the control group of this one
  !> and of those that this one is in; 0 where the system does not tell.
  integer(i8) function free_memory() result(bytes)
    character(len=:), allocatable :: group
    integer :: k

    bytes = kibibyte*(number_after("/proc/meminfo", "MemAvailable:") + number_after("/proc/meminfo", "SwapFree:"))
    do k = 1, size(group_root)
      group = group_of(trim(group_mark(k)))
      do
        if (bytes > 0) bytes = max(1_i8, min(bytes, group_memory(trim(group_root(k))//group, k)))
        if (group == "") exit
        group = group(1:index(group, "/", back=.true.) - 1)
      end do
    end do
  end function free_memory

  !> Bytes that processes of a control group can still get; huge without a limit.
  integer(i8) function group_memory(directory, version) result(bytes)
    character(len=*), intent(in) :: directory
    !> of control groups, as the names above have them: the present one first, then the older one
    integer, intent(in) :: version
    integer(i8) :: limit
    integer :: k

    bytes = huge(bytes)
    limit = number_after(directory//trim(group_limit(version)), "")
    if (limit <= 0) return
    bytes = limit - number_after(directory//trim(group_use(version)), "")
    do k = 1, size(group_files, 1)
      bytes = bytes + number_after(directory//"/memory.stat", trim(group_files(k, version))//" ")
    end do
  end function group_memory

  !> Path of the control group of this process below the root of control groups; empty for that root, and where there is none.
  function group_of(mark) result(group)
    character(len=*), intent(in) :: mark
    character(len=:), allocatable :: group
    character(len=1024) :: line
    integer :: unit, stat, at

    group = ""
    open (newunit=unit, file="/proc/self/cgroup", action="read", status="old", iostat=stat)
    if (stat /= 0) return
    do
      read (unit, "(a)", iostat=stat) line
      if (stat /= 0) exit
      at = index(line, mark)
      if (at == 0) cycle
      group = trim(line(at + len(mark):))
      exit
    end do
    close (unit)
    if (group == "/") group = ""
  end function group_of

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
    if (bytes < 9999.5_dp*1000.0_dp**k) then
      write (buffer, "(f12.1)") bytes/1000.0_dp**k
      text = trim(adjustl(buffer))//" "//units(k)
    else
      text = to_text(bytes/1000.0_dp**k, 2)//" "//units(k)
    end if
  end function bytes_text

end module gravier_room
