!> Sets of numbers that are joined two by two. Each number has the number of another one of its set, the first one itself.
module gravier_disjoint_sets
  implicit none
  private
  public :: first_of, join_sets, number_sets

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

  !> Join the sets of numbers `i` and `j`. Ways to the first numbers become shorter.
  pure subroutine join_sets(i, j, before)
    integer, intent(in) :: i, j
    !> as of `first_of`
    integer, intent(inout) :: before(:)
    integer :: k, first(2)

    first(1) = i
    first(2) = j
    do k = 1, 2
      ! each number on the way gets the one before the one before it
      do while (before(first(k)) /= first(k))
        before(first(k)) = before(before(first(k)))
        first(k) = before(first(k))
      end do
    end do
    before(maxval(first)) = minval(first)
  end subroutine join_sets

  !> Replace the number of another one of its set, of each number, by that of the set: sets count from 1, by their first numbers.
  pure subroutine number_sets(before, n_sets)
    !> in: as of `first_of`; out: number of the set of each number
    integer, intent(inout) :: before(:)
    integer, intent(out) :: n_sets
    integer :: i

    n_sets = 0
    do i = 1, size(before)
      if (before(i) == i) then
        n_sets = n_sets + 1
        before(i) = n_sets
      else
        ! the one before has its number already
        before(i) = before(before(i))
      end if
    end do
  end subroutine number_sets

end module gravier_disjoint_sets
