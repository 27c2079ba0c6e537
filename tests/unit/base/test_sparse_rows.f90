!> Sparse matrices by compressed rows, from entries in any order, and halves of symmetric ones.
program test_sparse_rows
  use gravier_kinds, only: dp
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, transposed, no_columns, half_of, mirrored
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  ! rows 1, 2 (empty), 3 and columns 1 to 4; the entry (3, 2) in two parts
  integer, parameter :: row(5) = [3, 1, 3, 3, 1], column(5) = [2, 4, 1, 2, 1]
  real(dp), parameter :: value(5) = [1.0_dp, 2.0_dp, 3.0_dp, 4.0_dp, 5.0_dp]
  real(dp), parameter :: expected(3, 4) = reshape([5.0_dp, 0.0_dp, 3.0_dp, 0.0_dp, 0.0_dp, 5.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
    & 2.0_dp, 0.0_dp, 0.0_dp], [3, 4])
  ! upper half of a symmetric matrix; the entry (1, 3) in two parts
  integer, parameter :: half_row(6) = [1, 1, 1, 2, 1, 3], half_column(6) = [3, 1, 2, 2, 3, 3]
  real(dp), parameter :: half_value(6) = [2.0_dp, 4.0_dp, 1.0_dp, 9.0_dp, -6.0_dp, 4.0_dp]
  real(dp), parameter :: symmetric(3, 3) = reshape([4.0_dp, 1.0_dp, -4.0_dp, 1.0_dp, 9.0_dp, 0.0_dp, -4.0_dp, 0.0_dp, 4.0_dp], &
    & [3, 3])
  type(sparse_rows_t) :: matrix, back
  real(dp) :: found(3, 4), turned(4, 3), whole(3, 3)
  integer :: bad_row

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
  call check_halves()
  call finish_checks()

contains

  !> Halves are told from whole matrices, and mirrored where that makes a matrix that may be positive.
  subroutine check_halves()
    matrix = compressed_rows(3, 3, half_row, half_column, half_value)
    call check_equal(half_of(matrix), 1, "a half above the diagonal")
    call check_equal(half_of(transposed(matrix)), -1, "a half below the diagonal")
    call mirrored(matrix, back, bad_row)
    call check_equal(bad_row, 0, "half of a symmetric matrix")
    call expand(back, whole)
    call check_close(maxval(abs(whole - symmetric)), 0.0_dp, 0.0_dp, "mirrored")
    call check_equal(half_of(back), 0, "a whole matrix")
    call mirrored(transposed(matrix), back, bad_row)
    call expand(back, whole)
    call check_close(maxval(abs(whole - symmetric)), 0.0_dp, 0.0_dp, "mirrored from below")
    call check_equal(half_of(compressed_rows(2, 2, [1, 2, 2], [1, 2, 1], [1.0_dp, 1.0_dp, 0.0_dp])), 0, "a diagonal matrix")
    ! without its second part the entry (1, 3) is too large
    call mirrored(compressed_rows(3, 3, half_row(2:), half_column(2:), half_value(2:)), back, bad_row)
    call check_equal(bad_row, 1, "half of no positive matrix")
    ! two large entries of one column, each of which may be
    call mirrored(compressed_rows(3, 3, [1, 2, 3, 1, 2], [1, 2, 3, 3, 3], [1.0_dp, 1.0_dp, 1.0_dp, 0.9_dp, 0.9_dp]), back, bad_row)
    call check_equal(bad_row, 0, "each entry is compared by itself")
  end subroutine check_halves

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
