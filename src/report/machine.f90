!> What a measurement ran on: processor, cache and memory as Linux tells, compiler and its flags.
module gravier_machine
  use, intrinsic :: iso_fortran_env, only: compiler_options
  use gravier_kinds, only: i8
  use gravier_text, only: text_from
  implicit none
  private
  public :: processor_model, last_cache, compiler_flags, date_text

contains

  !> "unknown" where the system does not tell.
  function processor_model() result(model)
    character(len=:), allocatable :: model

    model = value_after("/proc/cpuinfo", "model name")
    if (model == "") model = "unknown"
  end function processor_model

  !> Bytes of the largest cache of a core, shared or not; 32 MiB where the system does not tell.
  integer(i8) function last_cache() result(bytes)
    integer(i8) :: one
    integer :: k

    bytes = 0
    do k = 0, 4
      one = bytes_of(value_after("/sys/devices/system/cpu/cpu0/cache/index"//achar(iachar("0") + k)//"/size", ""))
      bytes = max(bytes, one)
    end do
    if (bytes == 0) bytes = 33554432_i8
  end function last_cache

  !> Bytes of a text such as 2048K or 32M; 0 for any other.
  integer(i8) function bytes_of(text) result(bytes)
    character(len=*), intent(in) :: text
    integer :: n, stat

    bytes = 0
    n = verify(text, "0123456789") - 1
    if (n < 1) return
    read (text(1:n), *, iostat=stat) bytes
    if (stat /= 0) bytes = 0
    select case (text(n + 1:))
    case ("K")
      bytes = bytes*1024
    case ("M")
      bytes = bytes*1048576
    case default
      bytes = 0
    end select
  end function bytes_of

  !> What follows the colon of the first line that begins with `name`, or the whole first line for a blank name; blank where
  !> there is none.
  function value_after(path, name) result(value)
    character(len=*), intent(in) :: path, name
    character(len=:), allocatable :: value
    character(len=512) :: line
    integer :: unit, stat

    value = ""
    open (newunit=unit, file=path, action="read", status="old", iostat=stat)
    if (stat /= 0) return
    do
      read (unit, "(a)", iostat=stat) line
      if (stat /= 0) exit
      if (index(line, name) /= 1) cycle
      value = trim(adjustl(line))
      if (name /= "") value = trim(adjustl(line(index(line, ":") + 1:)))
      exit
    end do
    close (unit)
  end function value_after

  !> The flags that change code, of the many that the compiler names.
  function compiler_flags() result(flags)
    character(len=:), allocatable :: flags
    character(len=:), allocatable :: rest, word
    integer :: blank

    rest = compiler_options()//" "
    flags = ""
    do while (len(rest) > 0)
      blank = index(rest, " ")
      word = rest(1:blank - 1)
      rest = text_from(rest, blank + 1)
      if (.not. changes_code(word) .or. index(" "//flags//" ", " "//word//" ") > 0) cycle
      if (len(flags) > 0) flags = flags//" "
      flags = flags//word
    end do
  end function compiler_flags

  pure logical function changes_code(word)
    character(len=*), intent(in) :: word
    changes_code = index(word, "-O") == 1 .or. index(word, "-march=") == 1 .or. index(word, "-mprefer") == 1
    if (index(word, "-f") == 1) changes_code = index(word, "-fintrinsic-modules") /= 1 .and. index(word, "-fpre") /= 1 .and. &
      & word /= "-fno-backtrace"
  end function changes_code

  !> Today, as year-month-day.
  function date_text() result(text)
    character(len=10) :: text
    character(len=8) :: day

    call date_and_time(date=day)
    text = day(1:4)//"-"//day(5:6)//"-"//day(7:8)
  end function date_text

end module gravier_machine
