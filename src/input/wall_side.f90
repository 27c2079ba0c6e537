!> How a &boundary names a wall of the bodies: by the side on which it lies, such as '+x', or by its identifier.
module gravier_wall_side
  use gravier_kinds, only: i8
  implicit none
  private
  public :: wall_side_t, wall_side_of

  !> A side or an identifier.
  type :: wall_side_t
    !> axis of the side, 0 of an identifier or of what is neither; 1 on the upper side, -1 on the lower one
    integer :: axis = 0, sign = 0
    !> 0 of a side or of what is neither
    integer(i8) :: id = 0
  end type wall_side_t

contains

  !> What a text says in a scene of a dimension.
  pure type(wall_side_t) function wall_side_of(text, dimension) result(side)
    character(len=*), intent(in) :: text
    !> 2 or 3
    integer, intent(in) :: dimension
    character(len=*), parameter :: axes = "xyz", digits = "0123456789"
    integer :: stat

    if (len_trim(text) == 2 .and. scan(text(1:1), "+-") == 1) then
      side%axis = index(axes(1:dimension), text(2:2))
      if (side%axis > 0) side%sign = merge(1, -1, text(1:1) == "+")
    else if (len_trim(text) > 0 .and. verify(trim(text), digits) == 0) then
      read (text, *, iostat=stat) side%id
      if (stat /= 0) side%id = 0
    end if
  end function wall_side_of

end module gravier_wall_side
