!> From the matrices of a problem of FCLIB to the problem of its contacts alone, v = W r + q: bodies and bilateral constraints are
!> eliminated by the factors of their own matrix.
module gravier_condensation
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, transposed, no_columns
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t
  use gravier_sparse_direct, only: sparse_factor_t
  implicit none
  private
  public :: multipliers_t, condense, eliminate_constraints

  !> Multipliers of the bilateral constraints of a problem, given by the impulses of its contacts: l = L r + l_0.
  type :: multipliers_t
    private
    !> L (p, dimension*contacts)
    type(sparse_rows_t) :: of_impulses
    !> l_0 (p)
    real(dp), allocatable :: without_impulses(:)
  contains
    procedure :: evaluate => multipliers_evaluate
  end type multipliers_t

  !> entries found so far, by columns
  type :: entries_t
    integer :: n = 0
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
  end type entries_t

  !> Unknowns x to eliminate from v = W r + sign B^T x + q: K x = B r + c.
  type :: unknowns_t
    !> of K, for messages
    character(len=:), allocatable :: name
    type(entries_t) :: k
    !> (order of K)
    real(dp), allocatable :: c(:)
    !> (order of K or less: the rows below are 0, dimension*contacts)
    type(sparse_rows_t) :: b
    real(dp) :: sign = 1.0_dp
    !> unknowns before the multipliers
    integer :: before = 0
  end type unknowns_t

  !> right-hand sides solved together
  integer, parameter :: batch = 64
  !> a pivot below this part of the scaled matrix is rounding
  real(dp), parameter :: smallest_pivot = 1.0e-13_dp

contains

  !> Eliminate the bodies from M V = H r + G l + f, G^T V + b = 0, v = H^T V + w: K = (M -G; G^T 0), B = (H; 0), c = (f; -b). A
  !> singular K raises an error.
  subroutine condense(global, local, multipliers, error)
    type(fclib_global_t), intent(in) :: global
    type(fclib_local_t), intent(out) :: local
    type(multipliers_t), intent(out) :: multipliers
    type(error_t), allocatable, intent(inout) :: error
    type(unknowns_t) :: unknowns
    type(entries_t) :: nothing
    integer :: i, n

    if (allocated(error)) return
    n = size(global%f)
    do i = 1, n
      call append_row(unknowns%k, global%m, i)
      call append_constraints(unknowns%k, global%g, i, n)
    end do
    unknowns%name = "the matrix of masses and constraints"
    allocate (unknowns%c(n + size(global%b)))
    unknowns%c(1:n) = global%f
    unknowns%c(n + 1:) = -global%b
    unknowns%b = global%h
    unknowns%before = n
    local%dimension = global%dimension
    local%mu = global%mu
    local%q = global%w
    local%w = matrix_of(nothing, size(local%q), size(local%q))
    call eliminate(unknowns, local, multipliers, error)
  end subroutine condense

  !> Eliminate the constraints from v = W r + V l + q, V^T r + R l + s = 0: K = R, B = -V^T, c = -s. A problem without any stays as
  !> it is; a singular R raises an error.
  subroutine eliminate_constraints(local, multipliers, error)
    type(fclib_local_t), intent(inout) :: local
    type(multipliers_t), intent(out) :: multipliers
    type(error_t), allocatable, intent(inout) :: error
    type(unknowns_t) :: unknowns
    integer :: i

    if (allocated(error)) return
    if (size(local%s) == 0) then
      multipliers%of_impulses = no_columns(0)
      allocate (multipliers%without_impulses(0))
      return
    end if
    do i = 1, size(local%s)
      call append_row(unknowns%k, local%constraint, i)
    end do
    unknowns%name = "/fclib_local/R"
    unknowns%c = -local%s
    unknowns%b = transposed(local%coupling)
    unknowns%b%value(:) = -unknowns%b%value
    unknowns%sign = -1.0_dp
    call eliminate(unknowns, local, multipliers, error)
  end subroutine eliminate_constraints

  !> Append row `i` of a matrix.
  subroutine append_row(entries, matrix, i)
    type(entries_t), intent(inout) :: entries
    type(sparse_rows_t), intent(in) :: matrix
    integer, intent(in) :: i
    integer :: e

    do e = matrix%start(i), matrix%start(i + 1) - 1
      call append(entries, i, matrix%column(e), matrix%value(e))
    end do
  end subroutine append_row

  !> Append row `i` of -G right of the first `n` columns, and what G^T has of it below the first `n` rows.
  subroutine append_constraints(entries, g, i, n)
    type(entries_t), intent(inout) :: entries
    type(sparse_rows_t), intent(in) :: g
    integer, intent(in) :: i, n
    integer :: e

    do e = g%start(i), g%start(i + 1) - 1
      call append(entries, i, n + g%column(e), -g%value(e))
      call append(entries, n + g%column(e), i, g%value(e))
    end do
  end subroutine append_constraints

  !> Add to W and q what the unknowns do.
  subroutine eliminate(unknowns, local, multipliers, error)
    type(unknowns_t), intent(in) :: unknowns
    type(fclib_local_t), intent(inout) :: local
    type(multipliers_t), intent(inout) :: multipliers
    type(error_t), allocatable, intent(inout) :: error
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: reason
    type(sparse_rows_t) :: columns_b, columns_w
    type(entries_t) :: w, l
    real(dp), allocatable :: x(:, :)
    integer :: first, n

    associate (k => unknowns%k)
      call factor%init_local(reason, general=.true., smallest_pivot=smallest_pivot)
      call factor%factorise(size(unknowns%c), k%row(1:k%n), k%column(1:k%n), k%value(1:k%n), reason)
    end associate
    if (allocated(reason)) then
      call raise(error, status_input, unknowns%name//": expected a regular one ("//reason%message//")")
    else
      n = size(local%q)
      allocate (x(factor%n, 1))
      x(:, 1) = unknowns%c
      call factor%solve(x, error)
      call add_transposed(unknowns%b, unknowns%sign, x(:, 1), local%q)
      multipliers%without_impulses = x(unknowns%before + 1:, 1)
      columns_b = transposed(unknowns%b)
      columns_w = transposed(local%w)
      do first = 1, n, batch
        call solve_columns(first, min(first + batch - 1, n))
      end do
      local%w = matrix_of(w, n, n)
      multipliers%of_impulses = matrix_of(l, factor%n - unknowns%before, n)
    end if
    call factor%free()

  contains

    !> Columns first to last of W and L; entries that are exactly 0 are left out.
    subroutine solve_columns(first, last)
      integer, intent(in) :: first, last
      real(dp), allocatable :: columns(:, :), column(:)
      integer :: i, j

      allocate (columns(factor%n, last - first + 1), column(n))
      columns(:, :) = 0.0_dp
      do j = first, last
        call add_row(columns_b, j, columns(:, j - first + 1))
      end do
      call factor%solve(columns, error)
      do j = first, last
        column(:) = 0.0_dp
        call add_row(columns_w, j, column)
        call add_transposed(unknowns%b, unknowns%sign, columns(:, j - first + 1), column)
        do i = 1, n
          if (abs(column(i)) > 0.0_dp) call append(w, i, j, column(i))
        end do
        do i = unknowns%before + 1, factor%n
          if (abs(columns(i, j - first + 1)) > 0.0_dp) call append(l, i - unknowns%before, j, columns(i, j - first + 1))
        end do
      end do
    end subroutine solve_columns

  end subroutine eliminate

  !> y = y + row i of A.
  pure subroutine add_row(a, i, y)
    type(sparse_rows_t), intent(in) :: a
    integer, intent(in) :: i
    !> (n_columns or more)
    real(dp), intent(inout), contiguous :: y(:)
    integer :: k

    do k = a%start(i), a%start(i + 1) - 1
      y(a%column(k)) = y(a%column(k)) + a%value(k)
    end do
  end subroutine add_row

  !> y = y + sign B^T x.
  pure subroutine add_transposed(b, sign, x, y)
    type(sparse_rows_t), intent(in) :: b
    real(dp), intent(in) :: sign
    !> (n_rows or more), (n_columns)
    real(dp), intent(in), contiguous :: x(:)
    real(dp), intent(inout), contiguous :: y(:)
    integer :: i, k

    do i = 1, b%n_rows
      do k = b%start(i), b%start(i + 1) - 1
        y(b%column(k)) = y(b%column(k)) + sign*b%value(k)*x(i)
      end do
    end do
  end subroutine add_transposed

  !> Multipliers of a solution.
  pure subroutine multipliers_evaluate(self, r, l)
    class(multipliers_t), intent(in) :: self
    !> impulses (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :)
    !> (p)
    real(dp), allocatable, intent(out) :: l(:)
    integer :: a, i, k

    l = self%without_impulses
    do i = 1, size(l)
      do k = self%of_impulses%start(i), self%of_impulses%start(i + 1) - 1
        a = (self%of_impulses%column(k) - 1)/size(r, 1)
        l(i) = l(i) + self%of_impulses%value(k)*r(self%of_impulses%column(k) - a*size(r, 1), a + 1)
      end do
    end do
  end subroutine multipliers_evaluate

  pure function matrix_of(entries, n_rows, n_columns) result(matrix)
    type(entries_t), intent(in) :: entries
    integer, intent(in) :: n_rows, n_columns
    type(sparse_rows_t) :: matrix

    if (allocated(entries%row)) then
      matrix = compressed_rows(n_rows, n_columns, entries%row(1:entries%n), entries%column(1:entries%n), entries%value(1:entries%n))
    else
      matrix = no_columns(n_rows)
      matrix%n_columns = n_columns
    end if
  end function matrix_of

  !> One more entry; the room doubles when it is full.
  pure subroutine append(entries, row, column, value)
    type(entries_t), intent(inout) :: entries
    integer, intent(in) :: row, column
    real(dp), intent(in) :: value
    type(entries_t) :: larger
    integer :: n

    n = entries%n
    if (.not. allocated(entries%row)) allocate (entries%row(0), entries%column(0), entries%value(0))
    if (n == size(entries%row)) then
      allocate (larger%row(max(1024, 2*n)), larger%column(max(1024, 2*n)), larger%value(max(1024, 2*n)))
      larger%row(1:n) = entries%row
      larger%column(1:n) = entries%column
      larger%value(1:n) = entries%value
      call move_alloc(larger%row, entries%row)
      call move_alloc(larger%column, entries%column)
      call move_alloc(larger%value, entries%value)
    end if
    entries%n = entries%n + 1
    entries%row(entries%n) = row
    entries%column(entries%n) = column
    entries%value(entries%n) = value
  end subroutine append

end module gravier_condensation
