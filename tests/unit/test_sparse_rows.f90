!> Sparse matrices by compressed rows, from entries in any order.
program test_sparse_rows
  use gravier_kinds, only: dp
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, transposed, no_columns
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  ! rows 1, 2 (empty), 3 and columns 1 to 4; the entry (3, 2) in two parts
  integer, parameter :: row(5) = [3, 1, 3, 3, 1], column(5) = [2, 4, 1, 2, 1]
  real(dp), parameter :: value(5) = [1.0_dp, 2.0_dp, 3.0_dp, 4.0_dp, 5.0_dp]
  real(dp), parameter :: expected(3, 4) = reshape([5.0_dp, 0.0_dp, 3.0_dp, 0.0_dp, 0.0_dp, 5.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
    & 2.0_dp, 0.0_dp, 0.0_dp], [3, 4])
  type(sparse_rows_t) :: matrix, back
  real(dp) :: found(3, 4), turned(4, 3)

  matrix = compressed_rows(3, 4, row, column, value)
  call check(all(matrix%start == [1, 3, 3, 6]), "starts of the rows")
  call expand(matrix, found)
  call check_close(maxval(abs(found - expected)), 0.0_dp, 0.0_dp, "entries")
  back = transposed(matrix)
  call check_equal(back%n_rows, 4, "rows of the transpose")
  call expand(back, turned)
  found = transpose(turned)
  call check_close(maxval(abs(found - expected)), 0.0_dp, 0.0_dp, "transpose")
  matrix = no_columns(3)
  call check(all(matrix%start == 1) .and. size(matrix%value) == 0, "rows without columns")
  call finish_checks()

contains

  !> The full matrix.
  pure subroutine expand(a, dense)
    type(sparse_rows_t), intent(in) :: a
    real(dp), intent(out) :: dense(:, :)
    integer :: i, k

    dense = 0.0_dp
    do i = 1, a%n_rows
      do k = a%start(i), a%start(i + 1) - 1
        dense(i, a%column(k)) = dense(i, a%column(k)) + a%value(k)
      end do
    end do
  end subroutine expand

end program test_sparse_rows
