!> Sparse matrices by compressed rows, and halves of symmetric ones.
module gravier_sparse_rows
  use gravier_kinds, only: dp
  implicit none
  private
  public :: sparse_rows_t, entries_t, compressed_rows, transposed, no_columns, half_of, mirrored

  !> Rows and columns are numbered from 1; entries of the same place add up, and the columns of a row come in any order.
  type :: sparse_rows_t
    integer :: n_rows = 0, n_columns = 0
    !> (n_rows + 1): entries start(i) to start(i + 1) - 1 are those of row i
    integer, allocatable :: start(:)
    !> (entries)
    integer, allocatable :: column(:)
    real(dp), allocatable :: value(:)
  end type sparse_rows_t

  !> Entries of a matrix, one after the other, the first n of those that there is room for.
  type :: entries_t
    integer :: n = 0
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => entries_init
    procedure :: add => entries_add
  end type entries_t

  !> what rounding may add to the square of an entry of a positive matrix, relative to the product of those on the diagonal
  real(dp), parameter :: rounding = 1.0e-6_dp

contains

  !> No entries, and room for so many.
  subroutine entries_init(self, room)
    class(entries_t), intent(out) :: self
    integer, intent(in) :: room

    allocate (self%row(room), self%column(room), self%value(room))
  end subroutine entries_init

  pure subroutine entries_add(self, i, j, x)
    class(entries_t), intent(inout) :: self
    integer, intent(in) :: i, j
    real(dp), intent(in) :: x

    self%n = self%n + 1
    self%row(self%n) = i
    self%column(self%n) = j
    self%value(self%n) = x
  end subroutine entries_add

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

  !> On which side of the diagonal of a square matrix the entries other than 0 are: 1 above alone, -1 below alone, 0 on both or
  !> none.
  pure integer function half_of(matrix) result(side)
    type(sparse_rows_t), intent(in) :: matrix
    integer :: i, k

    side = 0
    do i = 1, matrix%n_rows
      do k = matrix%start(i), matrix%start(i + 1) - 1
        if (matrix%column(k) == i .or. abs(matrix%value(k)) <= 0.0_dp) cycle
        if (side == 0) side = sign(1, matrix%column(k) - i)
        if (side == sign(1, matrix%column(k) - i)) cycle
        side = 0
        return
      end do
    end do
  end function half_of

  !> The symmetric matrix of which one half is given. `bad_row` is 0 where every entry allows it to be positive, or negative,
  !> semidefinite, a_ij^2 <= a_ii a_jj, and otherwise a row with one that does not: that was no half.
  subroutine mirrored(half, whole, bad_row)
    !> square, with entries on one side of its diagonal
    type(sparse_rows_t), intent(in) :: half
    type(sparse_rows_t), intent(out) :: whole
    integer, intent(out) :: bad_row
    type(entries_t) :: entries
    real(dp), allocatable :: diagonal(:), sums(:)
    integer :: i, k, n

    call entries%init(2*size(half%value))
    allocate (diagonal(half%n_rows), sums(half%n_rows))
    diagonal(:) = 0.0_dp
    do i = 1, half%n_rows
      do k = half%start(i), half%start(i + 1) - 1
        call entries%add(i, half%column(k), half%value(k))
        if (half%column(k) == i) then
          diagonal(i) = diagonal(i) + half%value(k)
        else
          call entries%add(half%column(k), i, half%value(k))
        end if
      end do
    end do
    n = entries%n
    whole = compressed_rows(half%n_rows, half%n_rows, entries%row(1:n), entries%column(1:n), entries%value(1:n))
    bad_row = 0
    sums(:) = 0.0_dp
    do i = 1, half%n_rows
      do k = half%start(i), half%start(i + 1) - 1
        sums(half%column(k)) = sums(half%column(k)) + half%value(k)
      end do
      do k = half%start(i), half%start(i + 1) - 1
        if (half%column(k) /= i .and. .not. sums(half%column(k))**2 <= (1.0_dp + rounding)*diagonal(i)*diagonal(half%column(k))) &
          & bad_row = i
      end do
      do k = half%start(i), half%start(i + 1) - 1
        sums(half%column(k)) = 0.0_dp
      end do
    end do
  end subroutine mirrored

end module gravier_sparse_rows
