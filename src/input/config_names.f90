!> Lists of names in one text, with commas or blanks between.
module gravier_config_names
  implicit none
  private
  public :: count_names, get_name, has_empty_name

  character(len=*), parameter :: between = " ,"//achar(9)

contains

  !> How many names a text has.
  pure integer function count_names(text) result(n)
    character(len=*), intent(in) :: text
    integer :: first, last

    n = 0
    last = 0
    do
      call find_next(text, last, first)
      if (first == 0) return
      n = n + 1
    end do
  end function count_names

  !> The name at a place, from 1; empty behind the last one.
  pure subroutine get_name(text, place, name)
    character(len=*), intent(in) :: text
    integer, intent(in) :: place
    character(len=:), allocatable, intent(out) :: name
    integer :: first, last, n

    last = 0
    first = 0
    do n = 1, place
      call find_next(text, last, first)
      if (first == 0) exit
    end do
    name = ""
    if (first > 0) name = text(first:last)
  end subroutine get_name

  !> Whether a comma has no name before or behind it.
  pure logical function has_empty_name(text)
    character(len=*), intent(in) :: text
    logical :: named
    integer :: i

    has_empty_name = .false.
    if (index(text, ",") == 0) return
    named = .false.
    do i = 1, len(text)
      if (text(i:i) == ",") then
        has_empty_name = has_empty_name .or. .not. named
        named = .false.
      else if (scan(text(i:i), between) == 0) then
        named = .true.
      end if
    end do
    has_empty_name = has_empty_name .or. .not. named
  end function has_empty_name

  !> Where the next name is.
  pure subroutine find_next(text, last, first)
    character(len=*), intent(in) :: text
    !> of the name before on entry, of this one on return
    integer, intent(inout) :: last
    !> 0 where there is none
    integer, intent(out) :: first

    first = verify(text(last + 1:), between)
    if (first == 0) return
    first = first + last
    last = first + scan(text(first:)//" ", between) - 2
  end subroutine find_next

end module gravier_config_names
