!> Sparse direct solution of a matrix whose entries and rows are spread over the ranks, against a dense factorisation
!> that every rank makes for itself.
program test_sparse_direct
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_sparse_direct, only: sparse_factor_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> The entries given by this rank.
  type :: entries_t
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
  end type entries_t

  type(communicator_t) :: comm
  integer, parameter :: orders(*) = [1, 2, 3, 10, 80]
  integer :: k

  call start_parallel()
  call comm%init()
  do k = 1, size(orders)
    call test_solution(orders(k))
  end do
  call test_counters()
  call test_singular()
  call test_entries_of_one_rank()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A symmetric, diagonally dominant matrix, the same on all ranks.
  subroutine make_dense(n, trial, dense)
    integer, intent(in) :: n, trial
    real(dp), allocatable, intent(out) :: dense(:, :)
    integer :: i, j

    allocate (dense(n, n), source=0.0_dp)
    do j = 1, n
      do i = j + 1, n
        if (hash_uniform(1, int(i, i8), j) > 6.0_dp/n) cycle
        dense(i, j) = hash_uniform(trial, int(i, i8), j) - 0.5_dp
        dense(j, i) = dense(i, j)
      end do
    end do
    do i = 1, n
      dense(i, i) = 1.0_dp + sum(abs(dense(:, i)))
    end do
  end subroutine make_dense

  !> Entries of the lower triangle: each is given by a random rank, and every third by the next rank too, half each.
  subroutine share_out(dense, entries)
    real(dp), intent(in) :: dense(:, :)
    type(entries_t), intent(out) :: entries
    integer :: i, j, k, m, r, round, pieces

    do round = 1, 2
      m = 0
      do j = 1, size(dense, 2)
        do i = j, size(dense, 1)
          if (abs(dense(i, j)) <= 0.0_dp) cycle
          r = int(comm%size*hash_uniform(7, int(i, i8), j))
          pieces = merge(2, 1, mod(i + j, 3) == 0)
          do k = 1, pieces
            if (mod(r + k - 1, comm%size) /= comm%rank) cycle
            m = m + 1
            if (round == 1) cycle
            entries%row(m) = i
            entries%column(m) = j
            entries%value(m) = dense(i, j)/pieces
          end do
        end do
      end do
      if (round == 1) allocate (entries%row(m), entries%column(m), entries%value(m))
    end do
  end subroutine share_out

  !> Solve by a dense Cholesky factorisation.
  subroutine solve_dense(dense, b)
    real(dp), intent(in) :: dense(:, :)
    real(dp), intent(inout) :: b(:)
    real(dp) :: factor(size(b), size(b))
    integer :: i, j, n

    n = size(b)
    factor(:, :) = dense
    do j = 1, n
      factor(j, j) = sqrt(factor(j, j) - sum(factor(j, 1:j - 1)**2))
      do i = j + 1, n
        factor(i, j) = (factor(i, j) - sum(factor(i, 1:j - 1)*factor(j, 1:j - 1)))/factor(j, j)
      end do
    end do
    do i = 1, n
      b(i) = (b(i) - sum(factor(i, 1:i - 1)*b(1:i - 1)))/factor(i, i)
    end do
    do i = n, 1, -1
      b(i) = (b(i) - sum(factor(i + 1:, i)*b(i + 1:)))/factor(i, i)
    end do
  end subroutine solve_dense

  !> Solve for rows in blocks, of even sizes or all but one on the last rank. Rows sum to 1 + twice the off-diagonal, so
  !> eigenvalues lie between 1 and 20 and the error is some 20 n roundings of the right-hand side.
  subroutine check_solves(factor, dense, name)
    type(sparse_factor_t), intent(inout) :: factor
    real(dp), intent(in) :: dense(:, :)
    character(len=*), intent(in) :: name
    type(error_t), allocatable :: error
    real(dp), allocatable :: b(:), expected(:)
    integer :: first_row(comm%size + 1), n, r, i, trial

    n = size(dense, 1)
    do trial = 1, 4
      do r = 0, comm%size
        first_row(r + 1) = 1 + (n*r)/comm%size
        if (trial > 2 .and. r > 0 .and. r < comm%size) first_row(r + 1) = min(2, n + 1)
      end do
      allocate (b(first_row(comm%rank + 2) - first_row(comm%rank + 1)), expected(n))
      do i = 1, n
        expected(i) = hash_uniform(3, int(i, i8), trial) - 0.5_dp
      end do
      b(:) = expected(first_row(comm%rank + 1):first_row(comm%rank + 2) - 1)
      call solve_dense(dense, expected)
      call factor%solve_rows(first_row, b, error)
      call check(.not. allocated(error), name//": no error")
      if (size(b) > 0) call check_close(maxval(abs(b - expected(first_row(comm%rank + 1):first_row(comm%rank + 2) - 1))), 0.0_dp, &
        & 20*(n + 5)*epsilon(1.0_dp), name//": solution")
      deallocate (b, expected)
    end do
  end subroutine check_solves

  subroutine test_solution(n)
    integer, intent(in) :: n
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), allocatable :: dense(:, :)
    type(entries_t) :: entries

    call make_dense(n, 2, dense)
    call share_out(dense, entries)
    call factor%init_distributed(comm, error)
    call factor%factorise(n, entries%row, entries%column, entries%value, error)
    call check(.not. allocated(error), "factorisation")
    call check_solves(factor, dense, "shared matrix")
    call check_equal(factor%solves, 4_i8, "solves")
    call factor%free()
  end subroutine test_solution

  subroutine check_counts(factor, analyses, factorisations, name)
    type(sparse_factor_t), intent(in) :: factor
    integer, intent(in) :: analyses, factorisations
    character(len=*), intent(in) :: name
    call check_equal(factor%analyses, int(analyses, i8), name//": analyses")
    call check_equal(factor%factorisations, int(factorisations, i8), name//": factorisations")
  end subroutine check_counts

  !> What changes on one rank is factorised, or analysed, on all.
  subroutine test_counters()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), allocatable :: dense(:, :), small(:, :)
    type(entries_t) :: entries, small_entries
    integer :: r, done

    call make_dense(50, 2, dense)
    call share_out(dense, entries)
    call factor%init_distributed(comm, error)
    call factor%factorise(50, entries%row, entries%column, entries%value, error)
    call check_counts(factor, 1, 1, "first matrix")
    call factor%factorise(50, entries%row, entries%column, entries%value, error)
    call check_counts(factor, 1, 1, "same matrix")
    call check_solves(factor, dense, "same matrix")
    call factor%factorise(50, entries%row, entries%column, entries%value, error)
    call check_counts(factor, 1, 1, "same matrix after solves")
    done = 1
    do r = 0, comm%size - 1
      if (comm%rank == r) entries%value(1) = entries%value(1)*(1.0_dp + epsilon(1.0_dp))
      done = done + 1
      call factor%factorise(50, entries%row, entries%column, entries%value, error)
      call check_counts(factor, 1, done, "a value of one rank changed")
    end do
    do r = 0, comm%size - 1
      ! one entry of one rank in two pieces of the same place: the same matrix, another pattern
      if (comm%rank == r) call split_first(entries)
      done = done + 1
      call factor%factorise(50, entries%row, entries%column, entries%value, error)
      call check_counts(factor, 2 + r, done, "the pattern of one rank changed")
    end do
    call check_solves(factor, dense, "the pattern of one rank changed")
    call make_dense(49, 3, small)
    call share_out(small, small_entries)
    call factor%factorise(49, small_entries%row, small_entries%column, small_entries%value, error)
    call check_solves(factor, small, "another order")
    call check_equal(factor%n, 49, "order")
    call check(.not. allocated(error), "no error")
    call factor%free()
  end subroutine test_counters

  subroutine split_first(entries)
    type(entries_t), intent(inout) :: entries
    type(entries_t) :: old
    integer :: m

    m = size(entries%row)
    old = entries
    deallocate (entries%row, entries%column, entries%value)
    allocate (entries%row(m + 1), entries%column(m + 1), entries%value(m + 1))
    entries%row(1:m) = old%row
    entries%column(1:m) = old%column
    entries%value(1:m) = old%value
    entries%row(m + 1) = old%row(1)
    entries%column(m + 1) = old%column(1)
    entries%value(1) = 0.5_dp*old%value(1)
    entries%value(m + 1) = 0.5_dp*old%value(1)
  end subroutine split_first

  !> Every rank learns of a matrix that cannot be factorised.
  subroutine test_singular()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    integer :: place(1)
    real(dp) :: value(1)

    call factor%init_distributed(comm, error)
    place(1) = comm%rank + 1
    value(1) = merge(0.0_dp, 1.0_dp, comm%rank == comm%size - 1)
    call factor%factorise(comm%size, place, place, value, error)
    call check(allocated(error), "a singular matrix is an error on every rank")
    if (allocated(error)) call check_equal(error%status, status_failure, "status of a singular matrix")
    call check_equal(factor%n, 0, "nothing is factorised")
    call factor%free()
  end subroutine test_singular

  !> All entries come from the last rank.
  subroutine test_entries_of_one_rank()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), allocatable :: dense(:, :)
    type(entries_t) :: entries
    integer :: i, j, m

    call make_dense(12, 9, dense)
    m = merge(78, 0, comm%rank == comm%size - 1)
    allocate (entries%row(m), entries%column(m), entries%value(m))
    m = 0
    do j = 1, 12
      do i = j, 12
        if (comm%rank < comm%size - 1) cycle
        m = m + 1
        entries%row(m) = i
        entries%column(m) = j
        entries%value(m) = dense(i, j)
      end do
    end do
    call factor%init_distributed(comm, error)
    call factor%factorise(12, entries%row, entries%column, entries%value, error)
    call check_solves(factor, dense, "entries of one rank")
    call check(.not. allocated(error), "no error")
    call factor%free()
  end subroutine test_entries_of_one_rank

end program test_sparse_direct
