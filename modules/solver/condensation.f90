!> From the dynamics of bodies to the problem of their contacts: M V = H r + G l + f, G^T V + b = 0 and v = H^T V + w become
!> v = W r + q, with W = H^T M^-1 H and q = H^T M^-1 f + w where there are no constraints G.
module gravier_condensation
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, transposed
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t
  use gravier_sparse_direct, only: sparse_factor_t
  implicit none
  private
  public :: condense

  !> right-hand sides solved together
  integer, parameter :: batch = 64

  !> entries found so far, by columns
  type :: entries_t
    integer :: n = 0
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
  end type entries_t

contains

  !> Eliminate the bodies. A singular matrix of masses and constraints raises an error.
  subroutine condense(global, local, error)
    type(fclib_global_t), intent(in) :: global
    type(fclib_local_t), intent(out) :: local
    type(error_t), allocatable, intent(inout) :: error
    type(sparse_factor_t) :: factor
    type(error_t), allocatable :: reason
    type(sparse_rows_t) :: columns
    type(entries_t) :: w
    real(dp), allocatable :: x(:, :)
    integer :: first, last, n_contact

    if (allocated(error)) return
    call factorise_bodies(global, factor, reason)
    if (allocated(reason)) call raise(error, status_input, "the matrix of masses and constraints: expected a regular one ("// &
      & reason%message//")")
    if (.not. allocated(error)) then
      n_contact = global%h%n_columns
      local%dimension = global%dimension
      local%mu = global%mu
      allocate (local%q(n_contact), x(factor%n, 1), w%row(0), w%column(0), w%value(0))
      x(1:size(global%f), 1) = global%f
      x(size(global%f) + 1:, 1) = -global%b
      call factor%solve(x, error)
      call add_transposed(global%h, x(:, 1), global%w, local%q)
      columns = transposed(global%h)
      do first = 1, n_contact, batch
        last = min(first + batch - 1, n_contact)
        call solve_columns(global%h, columns, factor, first, last, w, error)
      end do
      if (.not. allocated(error)) local%w = compressed_rows(n_contact, n_contact, w%row(1:w%n), w%column(1:w%n), w%value(1:w%n))
    end if
    call factor%free()
  end subroutine condense

  !> Factors of M, or of (M -G; G^T 0).
  subroutine factorise_bodies(global, factor, error)
    type(fclib_global_t), intent(in) :: global
    type(sparse_factor_t), intent(inout) :: factor
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    integer :: i, k, m, n

    n = global%m%n_rows
    m = size(global%m%value)
    allocate (row(m + 2*size(global%g%value)), column(m + 2*size(global%g%value)), value(m + 2*size(global%g%value)))
    m = 0
    do i = 1, n
      do k = global%m%start(i), global%m%start(i + 1) - 1
        call put(i, global%m%column(k), global%m%value(k))
      end do
      do k = global%g%start(i), global%g%start(i + 1) - 1
        call put(i, n + global%g%column(k), -global%g%value(k))
        call put(n + global%g%column(k), i, global%g%value(k))
      end do
    end do
    call factor%init_local(error, general=.true.)
    call factor%factorise(n + global%g%n_columns, row, column, value, error)

  contains

    subroutine put(at_row, at_column, entry)
      integer, intent(in) :: at_row, at_column
      real(dp), intent(in) :: entry
      m = m + 1
      row(m) = at_row
      column(m) = at_column
      value(m) = entry
    end subroutine put

  end subroutine factorise_bodies

  !> Columns first to last of W; entries that are exactly 0 are left out.
  subroutine solve_columns(h, columns, factor, first, last, w, error)
    !> H, and its transpose
    type(sparse_rows_t), intent(in) :: h, columns
    type(sparse_factor_t), intent(inout) :: factor
    integer, intent(in) :: first, last
    type(entries_t), intent(inout) :: w
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: x(:, :), column(:), none(:)
    integer :: i, j, k

    if (allocated(error)) return
    allocate (x(factor%n, last - first + 1), column(h%n_columns), none(h%n_columns))
    x(:, :) = 0.0_dp
    none(:) = 0.0_dp
    do j = first, last
      do k = columns%start(j), columns%start(j + 1) - 1
        i = columns%column(k)
        x(i, j - first + 1) = x(i, j - first + 1) + columns%value(k)
      end do
    end do
    call factor%solve(x, error)
    do j = first, last
      call add_transposed(h, x(:, j - first + 1), none, column)
      do i = 1, size(column)
        if (abs(column(i)) > 0.0_dp) call append(w, i, j, column(i))
      end do
    end do
  end subroutine solve_columns

  !> y = H^T x + w.
  pure subroutine add_transposed(h, x, w, y)
    type(sparse_rows_t), intent(in) :: h
    !> (n_rows or more), (n_columns)
    real(dp), intent(in), contiguous :: x(:), w(:)
    real(dp), intent(out), contiguous :: y(:)
    integer :: i, k

    y(:) = w
    do i = 1, h%n_rows
      do k = h%start(i), h%start(i + 1) - 1
        y(h%column(k)) = y(h%column(k)) + h%value(k)*x(i)
      end do
    end do
  end subroutine add_transposed

  !> One more entry; the room doubles when it is full.
  pure subroutine append(entries, row, column, value)
    type(entries_t), intent(inout) :: entries
    integer, intent(in) :: row, column
    real(dp), intent(in) :: value
    type(entries_t) :: larger
    integer :: n

    n = entries%n
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
