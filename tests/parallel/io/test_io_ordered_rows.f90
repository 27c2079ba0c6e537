!> Rows sorted over the ranks: order, blocks, content, whatever the ids and wherever they start.
program test_io_ordered_rows
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_ordered_rows, only: row_order_t, order_rows, pack_reals, unpack_reals
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  type(communicator_t) :: comm

  call start_parallel()
  call comm%init()
  call test_scattered(1000, 3_i8, 0_i8)
  call test_scattered(7, 1_i8, 0_i8)
  call test_scattered(3, 1_i8, 0_i8)
  call test_scattered(1, 1_i8, 0_i8)
  call test_scattered(100, 90000000000000000_i8, 0_i8)
  call test_scattered(100, 1_i8, 9000000000000000000_i8)
  call test_two_clusters()
  call test_ties()
  call test_columns()
  call test_nothing()
  call test_reals()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Row g (from 0) of n has the id base + spacing*(g + 1); the rows start scattered over the ranks but the first one,
  !> which has none (unless alone).
  subroutine test_scattered(n, spacing, base)
    integer, intent(in) :: n
    integer(i8), intent(in) :: spacing, base
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    integer(i8) :: first
    integer :: i

    call scatter(n, spacing, base, records)
    call order_rows(comm, 1, records, ordered)
    call check_equal(size(ordered, 1), 3, "words of a record")
    call check(.not. allocated(records), "records are deallocated")
    first = comm%offset(size(ordered, 2, kind=i8))
    call check_equal(first, int(n, i8)*comm%rank/comm%size, "first row of the rank")
    call check_equal(first + size(ordered, 2), int(n, i8)*(comm%rank + 1)/comm%size, "last row of the rank")
    do i = 1, size(ordered, 2)
      call check_equal(ordered(1, i), base + spacing*(first + i), "id of a row")
      call check_equal(ordered(2, i), -ordered(1, i), "content of a row")
      call check_equal(ordered(3, i), first + i - 1, "number of a row")
    end do
  end subroutine test_scattered

  subroutine scatter(n, spacing, base, records)
    integer, intent(in) :: n
    integer(i8), intent(in) :: spacing, base
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer :: g, own, pass

    do pass = 1, 2
      own = 0
      do g = n - 1, 0, -1
        if (owner(g) /= comm%rank) cycle
        own = own + 1
        if (pass == 1) cycle
        records(1, own) = base + spacing*(g + 1)
        records(2, own) = -records(1, own)
        records(3, own) = g
      end do
      if (pass == 1) allocate (records(3, own))
    end do
  end subroutine scatter

  pure integer function owner(g)
    integer, intent(in) :: g
    owner = 0
    if (comm%size > 1) owner = 1 + mod(7*g + g/5, comm%size - 1)
  end function owner

  !> Half of the ids small, half huge: the blocks are equal all the same.
  subroutine test_two_clusters()
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    integer(i8) :: first
    integer :: i

    call scatter(100, 1_i8, 0_i8, records)
    do i = 1, size(records, 2)
      if (records(1, i) > 50) records(1, i) = records(1, i) + 1000000000000_i8
    end do
    call order_rows(comm, 1, records, ordered)
    first = comm%offset(size(ordered, 2, kind=i8))
    call check_equal(first, 100_i8*comm%rank/comm%size, "two clusters: first row of the rank")
    do i = 1, size(ordered, 2)
      call check_equal(ordered(3, i), first + i - 1, "two clusters: number of a row")
    end do
  end subroutine test_two_clusters

  !> Rows with the same first key stay together and are sorted by the second.
  subroutine test_ties()
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    integer(i8) :: first
    integer :: i

    call scatter(60, 1_i8, 0_i8, records)
    do i = 1, size(records, 2)
      records(1, i) = (records(3, i))/20
      records(2, i) = mod(records(3, i), 20_i8)
    end do
    call order_rows(comm, 2, records, ordered)
    first = comm%offset(size(ordered, 2, kind=i8))
    call check_equal(mod(size(ordered, 2), 20), 0, "ties: groups are whole")
    do i = 1, size(ordered, 2)
      call check_equal(ordered(3, i), first + i - 1, "ties: number of a row")
    end do
  end subroutine test_ties

  !> Columns put in the order one by one stand as whole records do, rows with the same two keys included: these stay in the order of
  !> their ranks, and on a rank in theirs.
  subroutine test_columns()
    type(row_order_t) :: order
    integer(i8), allocatable :: records(:, :), ordered(:, :), key(:, :), number(:, :)
    real(dp), allocatable :: value(:, :)
    integer(i8) :: before
    integer :: i

    call scatter(90, 1_i8, 0_i8, records)
    before = comm%offset(size(records, 2, kind=i8))
    allocate (key(2, size(records, 2)), number(1, size(records, 2)), value(2, size(records, 2)))
    do i = 1, size(records, 2)
      number(1, i) = before + i
      value(:, i) = [0.1_dp, -0.7_dp]*real(before + i, dp)
      key(1, i) = mod(records(3, i), 7_i8)
      key(2, i) = mod(records(3, i)/7, 3_i8)
      records(1:2, i) = key(:, i)
      records(3, i) = number(1, i)
    end do
    call order%find(comm, key)
    call order%put_words(number)
    call order%put_reals(value)
    call order_rows(comm, 2, records, ordered)
    call check_equal(size(number, 2), size(ordered, 2), "columns: rows of the rank")
    call check(all(key == ordered(1:2, :)), "columns: keys")
    call check(all(number(1, :) == ordered(3, :)), "columns: words")
    do i = 1, size(number, 2)
      call check(all(same(value(:, i), [0.1_dp, -0.7_dp]*real(number(1, i), dp))), "columns: reals bit by bit")
      if (i == 1) cycle
      if (all(key(:, i) == key(:, i - 1))) call check(number(1, i) > number(1, i - 1), "columns: rows with the same keys")
    end do
  end subroutine test_columns

  subroutine test_nothing()
    integer(i8), allocatable :: records(:, :), ordered(:, :)

    allocate (records(4, 0))
    call order_rows(comm, 2, records, ordered)
    call check_equal(size(ordered, 1), 4, "nothing: words of a record")
    call check_equal(size(ordered, 2), 0, "nothing: rows")
  end subroutine test_nothing

  subroutine test_reals()
    integer(i8) :: records(4, 2)
    real(dp) :: values(2, 2)
    real(dp), allocatable :: found(:, :)

    values = reshape([-0.0_dp, 1.0_dp/3, huge(1.0_dp), -tiny(1.0_dp)], [2, 2])
    records = 0
    call pack_reals(2, values, 2, records)
    call unpack_reals(records, 2, 2, found)
    call check(all(same(found, values)), "reals come back bit by bit")
    call check(all(records(1, :) == 0) .and. all(records(4, :) == 0), "other words are left alone")
  end subroutine test_reals

  !> Equality bit by bit.
  elemental logical function same(a, b)
    real(dp), intent(in) :: a, b
    same = transfer(a, 0_i8) == transfer(b, 0_i8)
  end function same

end program test_io_ordered_rows
