!> Sparse matrices by compressed rows.
module gravier_sparse_rows
  use gravier_kinds, only: dp
  implicit none
  private
  public :: sparse_rows_t, compressed_rows, transposed, no_columns

  !> Rows and columns are numbered from 1; entries of the same place add up, and the columns of a row come in any order.
  type :: sparse_rows_t
    integer :: n_rows = 0, n_columns = 0
    !> (n_rows + 1): entries start(i) to start(i + 1) - 1 are those of row i
    integer, allocatable :: start(:)
    !> (entries)
    integer, allocatable :: column(:)
    real(dp), allocatable :: value(:)
  end type sparse_rows_t

contains

  !> A matrix from entries in any order.
  pure function compressed_rows(n_rows, n_columns, row, column, value) result(matrix)
    integer, intent(in) :: n_rows, n_columns
    !> (entries)
    integer, intent(in), contiguous :: row(:), column(:)
    real(dp), intent(in), contiguous :: value(:)
    type(sparse_rows_t) :: matrix
    integer :: i, k, next(n_rows)

    matrix%n_rows = n_rows
    matrix%n_columns = n_columns
    allocate (matrix%start(n_rows + 1), matrix%column(size(row)), matrix%value(size(row)))
    next(:) = 0
    do k = 1, size(row)
      next(row(k)) = next(row(k)) + 1
    end do
    matrix%start(1) = 1
    do i = 1, n_rows
      matrix%start(i + 1) = matrix%start(i) + next(i)
      next(i) = matrix%start(i)
    end do
    do k = 1, size(row)
      i = row(k)
      matrix%column(next(i)) = column(k)
      matrix%value(next(i)) = value(k)
      next(i) = next(i) + 1
    end do
  end function compressed_rows

  pure function transposed(matrix) result(transpose)
    type(sparse_rows_t), intent(in) :: matrix
    type(sparse_rows_t) :: transpose
    integer, allocatable :: row(:)
    integer :: i

    allocate (row(size(matrix%column)))
    do i = 1, matrix%n_rows
      row(matrix%start(i):matrix%start(i + 1) - 1) = i
    end do
    transpose = compressed_rows(matrix%n_columns, matrix%n_rows, matrix%column, row, matrix%value)
  end function transposed

  !> A matrix of rows without columns.
  pure function no_columns(n_rows) result(matrix)
    integer, intent(in) :: n_rows
    type(sparse_rows_t) :: matrix

    matrix%n_rows = n_rows
    allocate (matrix%start(n_rows + 1), matrix%column(0), matrix%value(0))
    matrix%start(:) = 1
  end function no_columns

end module gravier_sparse_rows
