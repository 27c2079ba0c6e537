!> Files read at once, and their text gone through by lines and words. Not collective.
module gravier_file_lines
  use gravier_kinds, only: i8
  use gravier_narrow, only: take_count
  use gravier_errors, only: error_t, raise, status_input
  use gravier_file_system, only: check_readable
  implicit none
  private
  public :: lines_t, read_whole_file

  !> A text that is gone through line by line.
  type :: lines_t
    character(len=:), allocatable :: text
    !> of the line, from 1; the line is text(first:last)
    integer :: number = 0
    integer :: first = 1, last = 0
    !> where the next word is sought
    integer, private :: place = 1
  contains
    procedure :: open => lines_open
    procedure :: next => lines_next
    procedure :: word => lines_word
  end type lines_t

contains

  !> Take the text of a file. Failures as of read_whole_file.
  subroutine lines_open(self, path, error)
    class(lines_t), intent(out) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    call read_whole_file(path, self%text, error)
  end subroutine lines_open

  !> The bytes of a file. Failure (status_input): no such file, not readable, more than 2^31 bytes.
  subroutine read_whole_file(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error
    character(len=200) :: reason
    integer(i8) :: length
    integer :: unit, stat, n

    call check_readable(path, error)
    if (allocated(error)) return
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=stat, iomsg=reason)
    if (stat == 0) then
      inquire (unit=unit, size=length)
      call take_count(length, path//": bytes", n, error)
      allocate (character(len=n) :: text)
      if (n > 0) read (unit, iostat=stat, iomsg=reason) text
      close (unit)
    end if
    if (stat /= 0) call raise(error, status_input, path//": cannot read this file: "//trim(reason))
  end subroutine read_whole_file

  !> Go to the next line; false behind the last one.
  logical function lines_next(self) result(found)
    class(lines_t), intent(inout) :: self
    integer :: length

    if (self%number > 0) self%first = self%last + 2
    found = self%first <= len(self%text)
    if (.not. found) return
    self%number = self%number + 1
    length = index(self%text(self%first:), new_line("a")) - 1
    if (length < 0) length = len(self%text) - self%first + 1
    self%last = self%first + length - 1
    self%place = self%first
  end function lines_next

  !> The next word of the line, between blanks, tabs or carriage returns; empty at its end.
  function lines_word(self) result(word)
    class(lines_t), intent(inout) :: self
    character(len=:), allocatable :: word
    integer :: start

    do while (self%place <= self%last)
      if (.not. is_blank(self%text(self%place:self%place))) exit
      self%place = self%place + 1
    end do
    start = self%place
    do while (self%place <= self%last)
      if (is_blank(self%text(self%place:self%place))) exit
      self%place = self%place + 1
    end do
    word = self%text(start:self%place - 1)
  end function lines_word

  elemental logical function is_blank(letter)
    character(len=1), intent(in) :: letter
    is_blank = letter == " " .or. letter == achar(9) .or. letter == achar(13)
  end function is_blank

end module gravier_file_lines
