!> Rows of a table put in an order of their own, so that a file does not show how many ranks wrote it.
module gravier_ordered_rows
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_communicator, only: communicator_t
  use gravier_sorting, only: argsort, argsort_rows
  use gravier_sparse_exchange, only: exchange_sorted
  implicit none
  private
  public :: row_order_t, order_rows, pack_reals, unpack_reals

  !> How the rows of all ranks go to the places that their keys give them. It is found once for a table; the columns of the table
  !> are then put in the order one after the other, which takes memory for a column and not for the table.
  type :: row_order_t
    private
    type(communicator_t) :: comm
    !> (rows before), on several ranks: the rows in the order in which they are sent, and the rank to which each then goes
    integer, allocatable :: leaving(:), target_rank(:)
    !> (rows after): where the ordered rows stand among those that have come
    integer, allocatable :: place(:)
  contains
    procedure :: find => row_order_find
    procedure :: put_words => row_order_put_words
    procedure :: put_reals => row_order_put_reals
  end type row_order_t

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

  !> Find the order of rows by their keys, and put the keys in this order: rank 0 then holds the first block, rank 1 the next. The
  !> blocks are equal but for rows with the same first key, which stay together. Rows with the same keys stand in the order of
  !> their ranks and their places there. Collective.
  subroutine row_order_find(self, comm, key)
    class(row_order_t), intent(out) :: self
    type(communicator_t), intent(in) :: comm
    !> (keys, rows): the first key counts most and must be >= 0; afterwards those of the ordered rows of this rank
    integer(i8), allocatable, intent(inout) :: key(:, :)
    integer(i8), allocatable :: destination(:), splitters(:)
    integer :: i

    self%comm = comm
    if (comm%size > 1) then
      call find_splitters(comm, key(1, :), splitters)
      allocate (destination(size(key, 2)), self%leaving(size(key, 2)), self%target_rank(size(key, 2)))
      do i = 1, size(destination)
        destination(i) = count_up_to(splitters, key(1, i) - 1)
      end do
      call argsort(destination, self%leaving)
      do i = 1, size(destination)
        self%target_rank(i) = narrow(destination(self%leaving(i)))
      end do
      deallocate (destination)
      call send_rows(self, key)
    end if
    allocate (self%place(size(key, 2)))
    call argsort_rows(key, self%place)
    call place_rows(self, key)
  end subroutine row_order_find

  !> Put rows of integers, or of any words, in the order. Collective.
  subroutine row_order_put_words(self, words)
    class(row_order_t), intent(in) :: self
    !> (words of a row, rows): those of this rank before; afterwards those of its block
    integer(i8), allocatable, intent(inout) :: words(:, :)

    if (self%comm%size > 1) call send_rows(self, words)
    call place_rows(self, words)
  end subroutine row_order_put_words

  !> Put rows of reals in the order, bit by bit. No more than three copies of them are in memory at any time. Collective.
  subroutine row_order_put_reals(self, values)
    class(row_order_t), intent(in) :: self
    !> (components, rows): those of this rank before; afterwards those of its block
    real(dp), allocatable, intent(inout) :: values(:, :)
    integer(i8), allocatable :: words(:, :)

    allocate (words(size(values, 1), size(values, 2)))
    call pack_reals(size(values, 1), values, 1, words)
    deallocate (values)
    call self%put_words(words)
    call unpack_reals(words, 1, size(words, 1), values)
  end subroutine row_order_put_reals

  !> Send each row to the rank whose block it is in.
  subroutine send_rows(self, words)
    class(row_order_t), intent(in) :: self
    !> (words of a row, rows)
    integer(i8), allocatable, intent(inout) :: words(:, :)
    integer(i8), allocatable, asynchronous :: outgoing(:, :)
    integer :: i

    allocate (outgoing(size(words, 1), size(words, 2)))
    do i = 1, size(self%leaving)
      outgoing(:, i) = words(:, self%leaving(i))
    end do
    deallocate (words)
    call exchange_sorted(self%comm, outgoing, self%target_rank, words)
  end subroutine send_rows

  !> Put the rows that have come in their order.
  pure subroutine place_rows(self, words)
    class(row_order_t), intent(in) :: self
    !> (words of a row, rows)
    integer(i8), allocatable, intent(inout) :: words(:, :)
    integer(i8), allocatable :: placed(:, :)
    integer :: i

    allocate (placed(size(words, 1), size(words, 2)))
    do i = 1, size(self%place)
      placed(:, i) = words(:, self%place(i))
    end do
    call move_alloc(placed, words)
  end subroutine place_rows

  !> Sort records over all ranks by their first words, in the order of row_order_t. Collective.
  subroutine order_rows(comm, n_keys, records, ordered)
    type(communicator_t), intent(in) :: comm
    !> words 1 to n_keys are the keys
    integer, intent(in) :: n_keys
    !> (words of a record, number of records); deallocated at the end
    integer(i8), allocatable, intent(inout) :: records(:, :)
    integer(i8), allocatable, intent(out) :: ordered(:, :)
    type(row_order_t) :: order
    integer(i8), allocatable :: key(:, :)

    allocate (key(n_keys, size(records, 2)))
    key(:, :) = records(1:n_keys, :)
    call order%find(comm, key)
    deallocate (key)
    call order%put_words(records)
    call move_alloc(records, ordered)
  end subroutine order_rows

  !> Last key of each block but that of the last rank, by bisection on the value of all of them together: the least
  !> value that as many keys do not exceed as the blocks up to it should hold.
  subroutine find_splitters(comm, unsorted, splitters)
    type(communicator_t), intent(in) :: comm
    !> >= 0
    integer(i8), intent(in) :: unsorted(:)
    !> (comm%size - 1)
    integer(i8), allocatable, intent(out) :: splitters(:)
    integer(i8), allocatable :: keys(:), lower(:), upper(:), middle(:), counts(:)
    integer, allocatable :: order(:)
    integer(i8) :: total
    integer :: k

    allocate (keys(size(unsorted)), order(size(unsorted)))
    keys(:) = unsorted
    call argsort(keys, order)
    do k = 1, size(keys)
      keys(k) = unsorted(order(k))
    end do
    deallocate (order)
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
