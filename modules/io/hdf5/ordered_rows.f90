!> Rows of a table put in an order of their own, so that a file does not show how many ranks wrote it.
module gravier_ordered_rows
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t
  use gravier_sorting, only: argsort_rows
  use gravier_sparse_exchange, only: sparse_exchange
  implicit none
  private
  public :: order_rows, pack_reals, unpack_reals

contains

  !> Put real columns into records, bit by bit, from word `first` on.
  pure subroutine pack_reals(n_columns, values, first, records)
    integer, intent(in) :: n_columns
    integer, intent(in) :: first
    !> (words of a record, number of records)
    integer(i8), intent(inout), contiguous :: records(:, :)
    real(dp), intent(in) :: values(n_columns, size(records, 2))
    integer :: i, k

    do i = 1, size(records, 2)
      do k = 1, n_columns
        records(first + k - 1, i) = transfer(values(k, i), 0_i8)
      end do
    end do
  end subroutine pack_reals

  !> Take `n_columns` real columns out of records, from word `first` on.
  pure subroutine unpack_reals(records, first, n_columns, values)
    !> (words of a record, number of records)
    integer(i8), intent(in), contiguous :: records(:, :)
    integer, intent(in) :: first, n_columns
    !> (n_columns, number of records)
    real(dp), allocatable, intent(out) :: values(:, :)
    integer :: i, k

    allocate (values(n_columns, size(records, 2)))
    do i = 1, size(values, 2)
      do k = 1, n_columns
        values(k, i) = transfer(records(first + k - 1, i), 0.0_dp)
      end do
    end do
  end subroutine unpack_reals

  !> Sort records over all ranks by their first words. Afterwards rank 0 holds the first block, rank 1 the next; the
  !> blocks are equal but for rows with the same first word, which stay together. Collective.
  subroutine order_rows(comm, n_keys, records, ordered)
    type(communicator_t), intent(in) :: comm
    !> the order is that of words 1 to n_keys, the first one counting most; word 1 must be >= 0
    integer, intent(in) :: n_keys
    !> (words of a record, number of records); deallocated at the end
    integer(i8), allocatable, intent(inout) :: records(:, :)
    integer(i8), allocatable, intent(out) :: ordered(:, :)

    integer(i8), allocatable :: sorted(:, :), first_keys(:), splitters(:), received(:, :)
    integer, allocatable :: destination(:)
    integer :: i, r

    call sort_rows(n_keys, records, sorted)
    if (comm%size == 1) then
      call move_alloc(sorted, ordered)
      return
    end if
    first_keys = sorted(1, :)
    call find_splitters(comm, first_keys, splitters)
    allocate (destination(size(sorted, 2)))
    r = 0
    do i = 1, size(sorted, 2)
      do while (r < comm%size - 1)
        if (first_keys(i) <= splitters(r + 1)) exit
        r = r + 1
      end do
      destination(i) = r
    end do
    call sparse_exchange(comm, sorted, destination, received)
    deallocate (sorted)
    call sort_rows(n_keys, received, ordered)
  end subroutine order_rows

  !> Sort the local records, which are deallocated.
  subroutine sort_rows(n_keys, records, sorted)
    integer, intent(in) :: n_keys
    integer(i8), allocatable, intent(inout) :: records(:, :)
    integer(i8), allocatable, intent(out) :: sorted(:, :)
    integer(i8), allocatable :: keys(:, :)
    integer, allocatable :: order(:)
    integer :: i

    allocate (keys(n_keys, size(records, 2)), order(size(records, 2)))
    keys(:, :) = records(1:n_keys, :)
    call argsort_rows(keys, order)
    deallocate (keys)
    allocate (sorted(size(records, 1), size(records, 2)))
    do i = 1, size(order)
      sorted(:, i) = records(:, order(i))
    end do
    deallocate (records)
  end subroutine sort_rows

  !> Last key of each block but that of the last rank, by bisection on the value of all of them together: the least
  !> value that as many keys do not exceed as the blocks up to it should hold.
  subroutine find_splitters(comm, keys, splitters)
    type(communicator_t), intent(in) :: comm
    !> ascending, >= 0
    integer(i8), intent(in), contiguous :: keys(:)
    !> (comm%size - 1)
    integer(i8), allocatable, intent(out) :: splitters(:)
    integer(i8), allocatable :: lower(:), upper(:), middle(:), counts(:)
    integer(i8) :: total
    integer :: k

    total = comm%total(size(keys, kind=i8))
    allocate (lower(comm%size - 1), source=0_i8)
    allocate (upper(comm%size - 1), source=upper_bound(comm, keys))
    allocate (middle(comm%size - 1), counts(comm%size - 1))
    do while (any(lower < upper))
      middle(:) = lower + (upper - lower)/2
      do k = 1, size(counts)
        counts(k) = count_up_to(keys, middle(k))
      end do
      call comm%sum_counts(counts)
      do k = 1, size(counts)
        if (counts(k) >= total*k/comm%size) then
          upper(k) = middle(k)
        else
          lower(k) = middle(k) + 1
        end if
      end do
    end do
    call move_alloc(upper, splitters)
  end subroutine find_splitters

  !> A power of two, or huge, not below any key of any rank.
  integer(i8) function upper_bound(comm, keys) result(bound)
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in), contiguous :: keys(:)
    real(dp) :: greatest
    integer :: bits

    greatest = 0
    if (size(keys) > 0) greatest = real(keys(size(keys)), dp)
    bits = exponent(comm%highest(greatest)) + 1
    bound = huge(bound)
    if (bits < 62) bound = shiftl(1_i8, bits)
  end function upper_bound

  !> Number of ascending keys that do not exceed `value`.
  pure integer(i8) function count_up_to(keys, value) result(n)
    integer(i8), intent(in), contiguous :: keys(:)
    integer(i8), intent(in) :: value
    integer(i8) :: low, high, middle

    low = 0
    high = size(keys, kind=i8)
    do while (low < high)
      middle = low + (high - low)/2
      if (keys(middle + 1) <= value) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    n = low
  end function count_up_to

end module gravier_ordered_rows
