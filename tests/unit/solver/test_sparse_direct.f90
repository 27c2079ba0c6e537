!> Sparse direct solution on one rank, against a dense Cholesky factorisation, and of general matrices, sparse and dense:
!> values, right-hand sides, what is factorised again and what is not, errors.
program test_sparse_direct
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_random_hash, only: hash_uniform
  use gravier_sparse_direct, only: sparse_factor_t
  use gravier_dense_direct, only: solve_general => solve_dense
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer :: k
  integer, parameter :: orders(*) = [1, 2, 3, 10, 60]

  call MPI_Init()
  do k = 1, size(orders)
    call test_solution(orders(k), 1)
    call test_solution(orders(k), 3)
    call test_solution(orders(k), 70)
  end do
  call test_general()
  call test_counters()
  call test_singular()
  call test_smallest_pivot()
  call test_free()
  call test_two_at_once()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A symmetric matrix that is diagonally dominant, dense and as entries of its lower triangle, some in two pieces.
  subroutine make_matrix(n, trial, dense, row, column, value)
    integer, intent(in) :: n, trial
    real(dp), allocatable, intent(out) :: dense(:, :), value(:)
    integer, allocatable, intent(out) :: row(:), column(:)
    integer :: i, j, k, m, round, pieces

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
    do round = 1, 2
      m = 0
      do j = 1, n
        do i = j, n
          if (abs(dense(i, j)) <= 0.0_dp) cycle
          pieces = merge(2, 1, mod(i + j, 3) == 0)
          do k = 1, pieces
            m = m + 1
            if (round == 1) cycle
            row(m) = i
            column(m) = j
            value(m) = dense(i, j)/pieces
          end do
        end do
      end do
      if (round == 1) allocate (row(m), column(m), value(m))
    end do
  end subroutine make_matrix

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

  !> Rows sum to 1 + twice the off-diagonal: eigenvalues lie between 1 and 1 + 2 sum < 20, so the error is some
  !> 20 n roundings of the solution, which is no larger than the right-hand side.
  subroutine test_solution(n, n_sides)
    integer, intent(in) :: n, n_sides
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), allocatable :: dense(:, :), value(:), b(:, :), expected(:, :)
    integer, allocatable :: row(:), column(:)
    integer :: i, k

    call make_matrix(n, 2, dense, row, column, value)
    allocate (b(n, n_sides), expected(n, n_sides))
    do k = 1, n_sides
      do i = 1, n
        b(i, k) = hash_uniform(3, int(i, i8), k) - 0.5_dp
      end do
      expected(:, k) = b(:, k)
      call solve_dense(dense, expected(:, k))
    end do
    call factor%init_local(error)
    call factor%factorise(n, row, column, value, error)
    call factor%solve(b, error)
    call check(.not. allocated(error), "no error")
    call check_close(maxval(abs(b - expected)), 0.0_dp, 20*(n + 5)*epsilon(1.0_dp), "solution")
    call check_equal(factor%n, n, "order")
    call check_equal(factor%solves, int(n_sides, i8), "right-hand sides solved")
    ! the factors are good for another solve
    b(:, :) = 0.0_dp
    call factor%solve(b, error)
    call check_close(maxval(abs(b)), 0.0_dp, 0.0_dp, "no right-hand side, no solution")
    call factor%free()
  end subroutine test_solution

  !> A matrix without a diagonal, heavy beside it, and its solution by sparse and by dense factors; a singular one.
  subroutine test_general()
    integer, parameter :: n = 40
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp) :: dense(n, n), value(n**2), expected(n), b(n, 1), x(n)
    integer :: row(n**2), column(n**2), i, j, m
    logical :: regular

    m = 0
    dense = 0.0_dp
    do j = 1, n
      expected(j) = j
      do i = 1, n
        if (i == j) cycle
        if (i == 1 + mod(j, n)) dense(i, j) = n
        dense(i, j) = dense(i, j) + hash_uniform(5, int(i, i8), j) - 0.5_dp
        m = m + 1
        row(m) = i
        column(m) = j
        value(m) = dense(i, j)
      end do
    end do
    b = 0.0_dp
    do j = 1, n
      b(:, 1) = b(:, 1) + dense(:, j)*expected(j)
    end do
    x = b(:, 1)
    call factor%init_local(error, general=.true.)
    call factor%factorise(n, row(1:m), column(1:m), value(1:m), error)
    call factor%solve(b, error)
    call check(.not. allocated(error), "general: no error")
    ! the heavy entries dominate: condition below 10
    call check_close(maxval(abs(b(:, 1) - expected)), 0.0_dp, 100*n*epsilon(1.0_dp)*n, "general: solution")
    call factor%free()
    call solve_general(dense, x, regular)
    call check(regular, "dense: regular")
    call check_close(maxval(abs(x - expected)), 0.0_dp, 100*n*epsilon(1.0_dp)*n, "dense: solution")
    dense = 1.0_dp
    call solve_general(dense, x, regular)
    call check(.not. regular, "dense: singular")
  end subroutine test_general

  subroutine check_counts(factor, analyses, factorisations, name)
    type(sparse_factor_t), intent(in) :: factor
    integer, intent(in) :: analyses, factorisations
    character(len=*), intent(in) :: name
    call check_equal(factor%analyses, int(analyses, i8), name//": analyses")
    call check_equal(factor%factorisations, int(factorisations, i8), name//": factorisations")
  end subroutine check_counts

  !> After a factorisation: whether the factors solve the dense system.
  subroutine check_solves(factor, dense, name)
    type(sparse_factor_t), intent(inout) :: factor
    real(dp), intent(in) :: dense(:, :)
    character(len=*), intent(in) :: name
    type(error_t), allocatable :: error
    real(dp) :: b(size(dense, 1), 1), expected(size(dense, 1))

    b(:, :) = 1.0_dp
    expected(:) = 1.0_dp
    call solve_dense(dense, expected)
    call factor%solve(b, error)
    call check_close(maxval(abs(b(:, 1) - expected)), 0.0_dp, 20*(size(dense, 1) + 5)*epsilon(1.0_dp), name//": solution")
  end subroutine check_solves

  !> A matrix is factorised when its values are new, analysed when its pattern is.
  subroutine test_counters()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), allocatable :: dense(:, :), value(:), small(:, :), small_value(:)
    integer, allocatable :: row(:), column(:), small_row(:), small_column(:)
    integer :: i

    call make_matrix(40, 2, dense, row, column, value)
    call make_matrix(39, 2, small, small_row, small_column, small_value)
    call factor%init_local(error)
    call check_counts(factor, 0, 0, "new")
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 1, "first matrix")
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 1, "same matrix")
    call check_solves(factor, dense, "same matrix")
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 1, "same matrix after a solve")
    value(5) = value(5)*(1.0_dp + epsilon(1.0_dp))
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 2, "one value changed in its last bit")
    value(:) = 2*value
    dense(:, :) = 2*dense
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 3, "all values changed")
    call check_solves(factor, dense, "all values changed")
    call factor%factorise(39, small_row, small_column, small_value, error)
    call check_counts(factor, 2, 4, "another order")
    call check_solves(factor, small, "another order")
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 3, 5, "the first order again")
    ! as many entries, elsewhere: the first one below the diagonal goes to another row
    do i = 1, size(row)
      if (row(i) == column(i)) cycle
      if (row(i) == 40) cycle
      dense(row(i), column(i)) = dense(row(i), column(i)) - value(i)
      dense(column(i), row(i)) = dense(column(i), row(i)) - value(i)
      row(i) = row(i) + 1
      dense(row(i), column(i)) = dense(row(i), column(i)) + value(i)
      dense(column(i), row(i)) = dense(column(i), row(i)) + value(i)
      exit
    end do
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 4, 6, "another pattern")
    call check_solves(factor, dense, "another pattern")
    call check(.not. allocated(error), "no error")
    call factor%init_local(error)
    call check_counts(factor, 0, 0, "made anew")
    call factor%factorise(40, row, column, value, error)
    call check_counts(factor, 1, 1, "made anew, first matrix")
    call factor%free()
  end subroutine test_counters

  !> A matrix A^T A with fewer rows of A than columns is singular but for rounding: an error where pivots may not be as small as
  !> that; regular ones, of scales far apart too, are factorised.
  subroutine test_smallest_pivot()
    integer, parameter :: n = 12
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp) :: a(n, n), value(n*n), scale(n), b(n, 1)
    integer :: row(n*n), column(n*n), i, j

    do j = 1, n
      scale(j) = 10.0_dp**(j - n/2)
      do i = 1, n
        a(i, j) = hash_uniform(5, int(i, i8), j) - 0.5_dp
        row(i + (j - 1)*n) = i
        column(i + (j - 1)*n) = j
      end do
    end do
    call factor%init_local(error, general=.true., smallest_pivot=1.0e-13_dp)
    value(:) = scaled_products(a(1:n - 2, :), scale)
    call factor%factorise(n, row, column, value, error)
    call check(allocated(error), "a matrix of rank n - 2 is an error")
    if (allocated(error)) then
      call check_equal(error%status, status_failure, "status of a matrix of rank n - 2")
      call check(index(error%message, "2 of 12 pivots are 0") > 0, "message of a matrix of rank n - 2: "//error%message)
      deallocate (error)
    end if
    call check_equal(factor%n, 0, "nothing is factorised of rank n - 2")
    value(:) = scaled_products(a, scale)
    call factor%factorise(n, row, column, value, error)
    do i = 1, n
      b(i, 1) = sum(value(i::n)*scale)
    end do
    call factor%solve(b, error)
    call check(.not. allocated(error), "a regular matrix of scales far apart")
    ! the condition of the scaled matrix, below 1e8, times rounding
    call check_close(maxval(abs(b(:, 1)/scale - 1.0_dp)), 0.0_dp, 1.0e-8_dp, "solution of scales far apart")
    call factor%free()
  end subroutine test_smallest_pivot

  !> S A^T A S, S = diag(1/scale), by columns.
  pure function scaled_products(a, scale) result(value)
    real(dp), intent(in) :: a(:, :), scale(:)
    real(dp) :: value(size(scale)**2)
    integer :: i, j

    do j = 1, size(scale)
      do i = 1, size(scale)
        value(i + (j - 1)*size(scale)) = sum(a(:, i)*a(:, j))/(scale(i)*scale(j))
      end do
    end do
  end function scaled_products

  !> A zero column is an error, and no end: the next matrix is factorised.
  subroutine test_singular()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    real(dp), parameter :: zero(3) = [1.0_dp, 1.0_dp, 0.0_dp], good(3) = [1.0_dp, 2.0_dp, 4.0_dp]
    integer, parameter :: place(3) = [1, 2, 3]
    real(dp) :: b(3, 1)

    call factor%init_local(error)
    call factor%factorise(3, place, place, zero, error)
    call check(allocated(error), "a singular matrix is an error")
    if (allocated(error)) then
      call check_equal(error%status, status_failure, "status of a singular matrix")
      call check(index(error%message, "factorisation failed with INFOG(1) = -10") > 0, &
        & "message of a singular matrix: "//error%message)
      deallocate (error)
    end if
    call check_equal(factor%n, 0, "nothing is factorised")
    call factor%factorise(3, place, place, good, error)
    b(:, :) = 8.0_dp
    call factor%solve(b, error)
    call check(.not. allocated(error), "the next matrix is factorised")
    call check_close(b(1, 1), 8.0_dp, 0.0_dp, "first of the next")
    call check_close(b(3, 1), 2.0_dp, 0.0_dp, "last of the next")
    call factor%free()
  end subroutine test_singular

  subroutine test_free()
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: error
    integer :: k

    call check(.not. factor%is_alive(), "not alive before it is made")
    call factor%free()
    ! many: what MUMPS holds is given back
    do k = 1, 50
      call factor%init_local(error)
      call check(factor%is_alive(), "alive")
      call factor%free()
      call check(.not. factor%is_alive(), "freed")
      call factor%free()
    end do
    call check(.not. allocated(error), "no error")
  end subroutine test_free

  !> Two matrices at once do not know of each other.
  subroutine test_two_at_once()
    type(sparse_factor_t) :: factors(2)
    type(error_t), allocatable :: error
    real(dp), allocatable :: first(:, :), second(:, :), value(:)
    integer, allocatable :: row(:), column(:)

    call make_matrix(20, 5, first, row, column, value)
    call factors(1)%init_local(error)
    call factors(1)%factorise(20, row, column, value, error)
    call make_matrix(31, 6, second, row, column, value)
    call factors(2)%init_local(error)
    call factors(2)%factorise(31, row, column, value, error)
    call check_solves(factors(1), first, "first of two")
    call check_solves(factors(2), second, "second of two")
    call factors(1)%free()
    call check_solves(factors(2), second, "second alone")
    call factors(2)%free()
  end subroutine test_two_at_once

end program test_sparse_direct
