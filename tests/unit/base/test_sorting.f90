!> Sorting: permutations that ascend and keep ties in order, lexicographic order of rows, search.
program test_sorting
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: i8
  use gravier_random_hash, only: hash_uniform
  use gravier_sorting, only: argsort, argsort_rows, find_sorted, first_not_before
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer, parameter :: sizes(*) = [0, 1, 2, 3, 4, 5, 7, 8, 9, 31, 64, 65, 1000]
  integer :: k

  call MPI_Init()
  do k = 1, size(sizes)
    call test_ties(sizes(k), 1)
    call test_ties(sizes(k), 5)
    call test_ties(sizes(k), 100000)
    call test_runs(sizes(k))
    call test_rows(sizes(k))
    call test_first_not_before(sizes(k))
    call test_search(sizes(k))
  end do
  call test_extreme_keys()
  call test_row_weights()
  call test_no_rows()
  call finish_checks()
  call MPI_Finalize()

contains

  !> An integer in [1, n] for (place, stream).
  integer function dice(place, stream, n)
    integer, intent(in) :: place, stream, n
    dice = 1 + int(n*hash_uniform(7, int(place, i8), stream))
  end function dice

  !> Keys drawn from `n_values` values.
  subroutine test_ties(n, n_values)
    integer, intent(in) :: n, n_values
    integer(i8) :: keys(n)
    integer :: order(n), i

    do i = 1, n
      keys(i) = dice(i, n_values, n_values) - n_values/2
    end do
    call argsort(keys, order)
    call check_order(keys, order, "random keys")
  end subroutine test_ties

  !> As many items come before a key as are less than it, by two numbers or by the first one alone.
  subroutine test_first_not_before(n)
    integer, intent(in) :: n
    integer(i8) :: keys(2, n), key(2)
    integer :: order(n), i, a, b
    logical :: right

    do i = 1, n
      keys(1, i) = dice(i, 1, 5)
      keys(2, i) = dice(i, 2, 5) - 3
    end do
    call argsort_rows(keys, order)
    right = .true.
    do a = 0, 6
      do b = -3, 3
        key(1) = a
        key(2) = b
        right = right .and. first_not_before(keys, order, key) == &
          & 1 + count(keys(1, :) < a .or. (keys(1, :) == a .and. keys(2, :) < b))
        right = right .and. first_not_before(keys, order, key(1:1)) == 1 + count(keys(1, :) < a)
      end do
    end do
    call check(right, "the first place not before a key")
  end subroutine test_first_not_before

  !> Keys that ascend already, and keys that descend in pairs.
  subroutine test_runs(n)
    integer, intent(in) :: n
    integer(i8) :: keys(n)
    integer :: order(n), i

    do i = 1, n
      keys(i) = 3*i
    end do
    call argsort(keys, order)
    call check_order(keys, order, "ascending keys")
    do i = 1, n
      keys(i) = -(i/2)
    end do
    call argsort(keys, order)
    call check_order(keys, order, "descending keys")
    do i = 1, n
      keys(i) = ishft(int(mod(7*i, 11), i8) - 5, 8*mod(i, 8))
    end do
    if (n > 2) then
      keys(2) = -huge(1_i8) - 1
      keys(n) = huge(1_i8)
    end if
    call argsort(keys, order)
    call check_order(keys, order, "keys of all magnitudes")
  end subroutine test_runs

  !> A stable sort has one result: a permutation along which (key, place) ascends strictly.
  subroutine check_order(keys, order, name)
    integer(i8), intent(in), contiguous :: keys(:)
    integer, intent(in), contiguous :: order(:)
    character(len=*), intent(in) :: name
    logical :: met(size(keys)), ascends
    integer :: i

    met(:) = .false.
    ascends = .true.
    do i = 1, size(keys)
      if (order(i) >= 1 .and. order(i) <= size(keys)) met(order(i)) = .true.
    end do
    call check(all(met), name//": a permutation")
    if (.not. all(met)) return
    do i = 2, size(keys)
      if (keys(order(i - 1)) > keys(order(i))) ascends = .false.
      if (keys(order(i - 1)) == keys(order(i)) .and. order(i - 1) > order(i)) ascends = .false.
    end do
    call check(ascends, name//": ascending, ties in order")
  end subroutine check_order

  !> Differences of these keys overflow; the order must not be taken from differences.
  subroutine test_extreme_keys()
    integer(i8), parameter :: most = huge(1_i8)
    integer(i8) :: keys(7)
    integer :: order(7), pair(2)

    keys(:) = [most, 0_i8, -most - 1_i8, most - 1_i8, -most, -1_i8, most]
    call argsort(keys, order)
    call check(all(order == [3, 5, 6, 2, 4, 1, 7]), "largest and smallest integers")
    keys(1) = most
    keys(2) = -most - 1_i8
    call argsort(keys(1:2), pair)
    call check(all(pair == [2, 1]), "largest before smallest integer")
  end subroutine test_extreme_keys

  !> Columns with many ties in every row, against the comparison of whole columns.
  subroutine test_rows(n)
    integer, intent(in) :: n
    integer(i8) :: keys(3, n)
    integer :: order(n), i, a, b
    logical :: ascends

    do i = 1, n
      keys(1, i) = dice(i, 11, 4)
      keys(2, i) = -dice(i, 12, 4)
      keys(3, i) = dice(i, 13, 3)
    end do
    call argsort_rows(keys, order)
    ascends = .true.
    do i = 2, n
      a = order(i - 1)
      b = order(i)
      if (.not. precedes(keys(:, a), a, keys(:, b), b)) ascends = .false.
    end do
    call check(ascends, "rows: lexicographic, ties in order")
    call check_equal(sum(int(order, i8)), int(n, i8)*(n + 1)/2, "rows: a permutation")
  end subroutine test_rows

  !> Whether column `a` at place `i` comes before column `b` at place `j`.
  logical function precedes(a, i, b, j)
    integer(i8), intent(in) :: a(3), b(3)
    integer, intent(in) :: i, j
    integer :: k

    do k = 1, 3
      if (a(k) == b(k)) cycle
      precedes = a(k) < b(k)
      return
    end do
    precedes = i < j
  end function precedes

  !> The first row decides before the second.
  subroutine test_row_weights()
    integer(i8) :: keys(2, 3)
    integer :: order(3)

    keys(:, 1) = [2_i8, 1_i8]
    keys(:, 2) = [1_i8, 3_i8]
    keys(:, 3) = [1_i8, 2_i8]
    call argsort_rows(keys, order)
    call check(all(order == [3, 2, 1]), "rows: the first is the most significant")
  end subroutine test_row_weights

  !> Without keys everything is equal and stays.
  subroutine test_no_rows()
    integer(i8) :: keys(0, 4)
    integer :: order(4)

    call argsort_rows(keys, order)
    call check(all(order == [1, 2, 3, 4]), "rows: none")
  end subroutine test_no_rows

  !> Every key present is found in its place, every absent one is not.
  subroutine test_search(n)
    integer, intent(in) :: n
    integer(i8) :: keys(n)
    integer :: i
    logical :: right

    do i = 1, n
      keys(i) = 10_i8*i + mod(i, 3)
    end do
    right = .true.
    do i = 1, n
      right = right .and. find_sorted(keys, keys(i)) == i
      right = right .and. find_sorted(keys, keys(i) - 1) == 0 .and. find_sorted(keys, keys(i) + 1) == 0
    end do
    right = right .and. find_sorted(keys, -huge(1_i8)) == 0 .and. find_sorted(keys, huge(1_i8)) == 0
    call check(right, "search")
  end subroutine test_search

end program test_sorting
