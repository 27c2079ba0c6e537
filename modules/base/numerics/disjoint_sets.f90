!> Sets of numbers that are joined two by two. Each number has the number of another one of its set, the first one itself.
module gravier_disjoint_sets
  implicit none
  private
  public :: first_of

contains

  !> The first number of the set of number `i`.
  pure integer function first_of(i, before) result(first)
    integer, intent(in) :: i
    !> of each number another one of its set, none of them larger
    integer, intent(in) :: before(:)

    first = i
    do while (before(first) /= first)
      first = before(first)
    end do
  end function first_of

end module gravier_disjoint_sets
