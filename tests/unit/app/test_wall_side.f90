!> Names of walls in a &boundary: sides of a scene in the plane or in space, identifiers, and what is neither.
program test_wall_side
  use gravier_kinds, only: i8
  use gravier_wall_side, only: wall_side_t, wall_side_of
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  call check_side("+x", 2, 1, 1, 0_i8)
  call check_side("-y  ", 2, 2, -1, 0_i8)
  call check_side("-z", 3, 3, -1, 0_i8)
  call check_side("153", 2, 0, 0, 153_i8)
  call check_side("9000000000", 3, 0, 0, 9000000000_i8)
  call check_nothing("+z", 2)
  call check_nothing("x+", 3)
  call check_nothing("+", 3)
  call check_nothing("", 3)
  call check_nothing("+xy", 3)
  call check_nothing("1 2", 2)
  call check_nothing("-3", 2)
  call check_nothing("99999999999999999999999", 2)
  call finish_checks()

contains

  subroutine check_side(text, dimension, axis, sign, id)
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension, axis, sign
    integer(i8), intent(in) :: id
    type(wall_side_t) :: side

    side = wall_side_of(text, dimension)
    call check_equal(side%axis, axis, text//": axis")
    call check_equal(side%sign, sign, text//": sign")
    call check_equal(side%id, id, text//": identifier")
  end subroutine check_side

  subroutine check_nothing(text, dimension)
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension
    type(wall_side_t) :: side

    side = wall_side_of(text, dimension)
    call check(side%axis == 0 .and. side%sign == 0 .and. side%id == 0_i8, "'"//text//"' is no wall")
  end subroutine check_nothing

end program test_wall_side
