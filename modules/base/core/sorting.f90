!> Stable sorting by integer keys, and search in sorted keys.
module gravier_sorting
  use gravier_kinds, only: i4, i8
  implicit none
  private
  public :: argsort, argsort_rows, find_sorted, first_not_before, is_before

  !> bits of a digit; it divides those of a key
  integer, parameter :: digit = 8

contains

  !> Permutation that sorts `keys` in ascending order; equal keys keep their order.
  subroutine argsort(keys, order)
    integer(i8), intent(in), contiguous :: keys(:)
    !> order(k) is the place in `keys` of the k-th smallest; size(keys)
    integer, intent(out), contiguous :: order(:)
    integer :: i

    do i = 1, size(keys)
      order(i) = i
    end do
    call sort_stably(keys, order)
  end subroutine argsort

  !> Permutation that sorts the columns of `keys` lexicographically, the first row being the most significant.
  subroutine argsort_rows(keys, order)
    !> (number of keys, number of items)
    integer(i8), intent(in), contiguous :: keys(:, :)
    integer, intent(out), contiguous :: order(:)
    integer(i8), allocatable :: row(:)
    integer :: i, k

    do i = 1, size(keys, 2)
      order(i) = i
    end do
    allocate (row(size(keys, 2)))
    do k = size(keys, 1), 1, -1
      row(:) = keys(k, :)
      call sort_stably(row, order)
    end do
  end subroutine argsort_rows

  !> Place of `key` in ascending `keys`, or 0 where it is absent.
  pure integer function find_sorted(keys, key) result(place)
    integer(i8), intent(in), contiguous :: keys(:)
    integer(i8), intent(in) :: key
    integer :: low, high, middle

    place = 0
    low = 1
    high = size(keys)
    do while (low <= high)
      middle = low + (high - low)/2
      if (keys(middle) == key) then
        place = middle
        return
      else if (keys(middle) < key) then
        low = middle + 1
      else
        high = middle - 1
      end if
    end do
  end function find_sorted

  !> The first place in the order of argsort_rows whose item is not before `key`; one more than there are items where all are.
  pure integer function first_not_before(keys, order, key) result(low)
    !> (number of keys, number of items)
    integer(i8), intent(in), contiguous :: keys(:, :)
    integer, intent(in), contiguous :: order(:)
    !> its first numbers count, as many as it has
    integer(i8), intent(in) :: key(:)
    integer :: high, middle

    low = 1
    high = size(order) + 1
    do while (low < high)
      middle = low + (high - low)/2
      if (is_before(keys(1:size(key), order(middle)), key)) then
        low = middle + 1
      else
        high = middle
      end if
    end do
  end function first_not_before

  !> Whether numbers come before others of the same count in lexicographic order.
  pure logical function is_before(one, other)
    integer(i8), intent(in) :: one(:), other(:)
    integer :: k

    is_before = .false.
    do k = 1, size(one)
      is_before = one(k) < other(k)
      if (one(k) /= other(k)) return
    end do
  end function is_before

  !> Rearrange `order` so that keys(order) ascends, stably: by one digit after the other, from the lowest; those that all
  !> keys have in common take no pass (radix sort).
  subroutine sort_stably(keys, order)
    integer(i8), intent(in), contiguous :: keys(:)
    integer, intent(inout), contiguous :: order(:)
    integer(i8), allocatable :: word(:), sorted(:)
    integer, allocatable :: sorted_order(:)
    integer :: next(0:2**digit - 1), i, lowest, d, below, here
    integer(i8) :: differing

    if (is_sorted(keys, order)) return
    allocate (word(size(order)), sorted(size(order)), sorted_order(size(order)))
    differing = 0
    do i = 1, size(order)
      ! with the sign turned, words without a sign are in the order of the keys
      word(i) = ieor(keys(order(i)), ibset(0_i8, bit_size(0_i8) - 1))
      differing = ior(differing, ieor(word(i), word(1)))
    end do
    do lowest = 0, bit_size(0_i8) - digit, digit
      if (ibits(differing, lowest, digit) == 0) cycle
      next(:) = 0
      do i = 1, size(word)
        d = int(ibits(word(i), lowest, digit), i4)
        next(d) = next(d) + 1
      end do
      below = 0
      do d = 0, 2**digit - 1
        here = next(d)
        next(d) = below + 1
        below = below + here
      end do
      do i = 1, size(word)
        d = int(ibits(word(i), lowest, digit), i4)
        sorted(next(d)) = word(i)
        sorted_order(next(d)) = order(i)
        next(d) = next(d) + 1
      end do
      word(:) = sorted
      order(:) = sorted_order
    end do
  end subroutine sort_stably

  pure logical function is_sorted(keys, order)
    integer(i8), intent(in), contiguous :: keys(:)
    integer, intent(in), contiguous :: order(:)
    integer :: i

    is_sorted = .true.
    do i = 2, size(order)
      if (keys(order(i - 1)) > keys(order(i))) then
        is_sorted = .false.
        return
      end if
    end do
  end function is_sorted

end module gravier_sorting
