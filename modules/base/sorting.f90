!> Stable sorting by integer keys, and search in sorted keys.
module gravier_sorting
  use gravier_kinds, only: i8
  implicit none
  private
  public :: argsort, argsort_rows, find_sorted

contains

  !> Permutation that sorts `keys` in ascending order; equal keys keep their order (merge sort).
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

  !> Rearrange `order` so that keys(order) ascends, stably: bottom-up merges of runs of doubling length.
  subroutine sort_stably(keys, order)
    integer(i8), intent(in), contiguous :: keys(:)
    integer, intent(inout), contiguous :: order(:)
    integer, allocatable :: work(:)
    integer :: n, length, first

    n = size(order)
    if (is_sorted(keys, order)) return
    allocate (work(n))
    length = 1
    do while (length < n)
      do first = 1, n, 2*length
        call merge_runs(keys, order, work, first, min(first + length, n + 1), min(first + 2*length, n + 1))
      end do
      order(:) = work
      length = 2*length
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

  !> Merge the runs [first, second) and [second, last) of `order` into `work`.
  pure subroutine merge_runs(keys, order, work, first, second, last)
    integer(i8), intent(in), contiguous :: keys(:)
    integer, intent(in), contiguous :: order(:)
    integer, intent(inout), contiguous :: work(:)
    integer, intent(in) :: first, second, last
    integer :: a, b, k

    a = first
    b = second
    do k = first, last - 1
      if (b >= last) then
        work(k) = order(a)
        a = a + 1
      else if (a >= second) then
        work(k) = order(b)
        b = b + 1
      else if (keys(order(b)) < keys(order(a))) then
        work(k) = order(b)
        b = b + 1
      else
        work(k) = order(a)
        a = a + 1
      end if
    end do
  end subroutine merge_runs

end module gravier_sorting
