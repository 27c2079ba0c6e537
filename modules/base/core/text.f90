!> Conversion of numbers to text and small string helpers.
module gravier_text
  use gravier_kinds, only: dp, i4, i8
  implicit none
  private
  public :: text_from, to_text, times_text, counted, lower, shell_word, growing_text_t

  !> Shortest usual text of a number: integers without blanks, reals with 9 significant digits
  !> or as many as asked, logicals as T or F. The exponent of a real has two digits, and three where it needs them; with 17
  !> digits, as tables have them, it always has three.
  interface to_text
    module procedure text_of_i4
    module procedure text_of_i8
    module procedure text_of_real
    module procedure text_of_logical
  end interface to_text

  !> A text put together piece by piece, in a time that grows as its length does.
  type :: growing_text_t
    private
    integer :: length = 0
    character(len=:), allocatable :: room
  contains
    procedure :: add => growing_text_add
    procedure :: get => growing_text_get
  end type growing_text_t

contains

  !> A text from character `first` on. `text = text(first:)` must not be written: gfortran makes `text` shorter before it moves the
  !> characters, and the last of them may be lost.
  pure function text_from(text, first) result(rest)
    character(len=*), intent(in) :: text
    integer, intent(in) :: first
    character(len=:), allocatable :: rest
    rest = text(first:)
  end function text_from

  !> One more piece at the end.
  pure subroutine growing_text_add(self, piece)
    class(growing_text_t), intent(inout) :: self
    character(len=*), intent(in) :: piece
    character(len=:), allocatable :: larger

    if (.not. allocated(self%room)) allocate (character(len=1024) :: self%room)
    if (self%length + len(piece) > len(self%room)) then
      allocate (character(len=2*(self%length + len(piece))) :: larger)
      larger(1:self%length) = self%room(1:self%length)
      call move_alloc(larger, self%room)
    end if
    self%room(self%length + 1:self%length + len(piece)) = piece
    self%length = self%length + len(piece)
  end subroutine growing_text_add

  !> What was added so far.
  pure function growing_text_get(self) result(text)
    class(growing_text_t), intent(in) :: self
    character(len=:), allocatable :: text

    text = ""
    if (allocated(self%room)) text = self%room(1:self%length)
  end function growing_text_get

  pure function text_of_i4(value) result(text)
    integer(i4), intent(in) :: value
    character(len=:), allocatable :: text
    text = text_of_i8(int(value, i8))
  end function text_of_i4

  pure function text_of_i8(value) result(text)
    integer(i8), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    write (buffer, "(i0)") value
    text = trim(buffer)
  end function text_of_i8

  pure function text_of_real(value, digits) result(text)
    real(dp), intent(in) :: value
    !> significant digits, 1 to 17; 17 reproduces the value exactly when read back
    integer, intent(in), optional :: digits
    character(len=:), allocatable :: text
    character(len=40) :: buffer
    character(len=16) :: form
    integer :: n, place
    n = 9
    if (present(digits)) n = max(1, min(17, digits))
    write (form, "('(es',i0,'.',i0,'e3)')") n + 9, n - 1
    write (buffer, form) value
    text = trim(adjustl(buffer))
    if (n == 17) return
    place = scan(text, "E")
    if (place > 0) then
      if (text(place + 2:place + 2) == "0") text = text(:place + 1)//text(place + 3:)
    end if
  end function text_of_real

  !> How often something happened, in words: never, once, twice, 3 times.
  pure function times_text(number) result(text)
    integer(i8), intent(in) :: number
    character(len=:), allocatable :: text

    select case (number)
    case (0)
      text = "never"
    case (1)
      text = "once"
    case (2)
      text = "twice"
    case default
      text = to_text(number)//" times"
    end select
  end function times_text

  !> A number with its noun, whose plural ends in s: 1 solve, 2 solves.
  pure function counted(number, noun) result(text)
    integer(i8), intent(in) :: number
    character(len=*), intent(in) :: noun
    character(len=:), allocatable :: text

    text = to_text(number)//" "//noun
    if (number /= 1) text = text//"s"
  end function counted

  pure function text_of_logical(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    if (value) then
      text = "T"
    else
      text = "F"
    end if
  end function text_of_logical

  !> ASCII lower case of a string.
  pure function lower(text) result(low)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: low
    integer :: i, c
    do i = 1, len(text)
      c = iachar(text(i:i))
      if (c >= iachar("A") .and. c <= iachar("Z")) c = c + 32
      low(i:i) = achar(c)
    end do
  end function lower

  !> A text as one word of the shell, whatever it holds.
  pure function shell_word(text) result(word)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: word
    integer :: i

    word = "'"
    do i = 1, len(text)
      if (text(i:i) == "'") then
        word = word//"'\''"
      else
        word = word//text(i:i)
      end if
    end do
    word = word//"'"
  end function shell_word

end module gravier_text
