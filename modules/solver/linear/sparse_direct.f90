!> Sparse direct solution of linear systems, symmetric positive definite or general: the only module that knows MUMPS.
module gravier_sparse_direct
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_narrow, only: narrow
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  implicit none
  private
  public :: sparse_factor_t

  include "dmumps_struc.h"

  interface
    subroutine dmumps(id)
      import :: dmumps_struc
      implicit none
      type(dmumps_struc), intent(inout) :: id
    end subroutine dmumps
  end interface

  !> A factorised matrix, held by one rank (`init_local`) or spread over all (`init_distributed`). It remembers
  !> what it factorised: the same matrix is never factorised twice, the same pattern never analysed twice.
  type :: sparse_factor_t
    private
    type(dmumps_struc), pointer :: id => null()
    type(communicator_t), pointer :: comm => null()
    !> MUMPS has set `id` up, so that its pointers are defined
    logical :: started = .false.
    integer, public :: n = 0
    !> work done since `init`
    integer(i8), public :: analyses = 0, factorisations = 0, solves = 0
  contains
    procedure :: init_local => sparse_factor_init_local
    procedure :: init_distributed => sparse_factor_init_distributed
    procedure :: factorise => sparse_factor_factorise
    procedure :: solve => sparse_factor_solve
    procedure :: solve_rows => sparse_factor_solve_rows
    procedure :: is_alive => sparse_factor_is_alive
    procedure :: free => sparse_factor_free
  end type sparse_factor_t

  !> MUMPS: stages of its work
  integer, parameter :: job_start = -1, job_end = -2, job_analyse = 1, job_factorise = 2, job_solve = 3
  !> MUMPS: errors that more work space mends
  integer, parameter :: mended_by_space(4) = [-8, -9, -17, -20]

contains

  !> A matrix that lives on this rank alone.
  subroutine sparse_factor_init_local(self, error, general, smallest_pivot)
    class(sparse_factor_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    !> the matrix is not symmetric, or not definite, and given by all of its entries; default: false
    logical, intent(in), optional :: general
    !> a pivot of less than this part of the scaled matrix is an error; default: only one of 0 is
    real(dp), intent(in), optional :: smallest_pivot

    call self%free()
    allocate (self%id)
    self%id%comm = MPI_COMM_SELF%mpi_val
    self%id%sym = 1
    if (present(general)) self%id%sym = merge(0, 1, general)
    call start(self, error)
    if (.not. present(smallest_pivot) .or. allocated(error)) return
    ! pivots that are too small are counted and passed over
    self%id%icntl(24) = 1
    self%id%cntl(3) = smallest_pivot
  end subroutine sparse_factor_init_local

  !> A matrix whose entries and rows are spread over the ranks. Collective.
  subroutine sparse_factor_init_distributed(self, comm, error, general)
    class(sparse_factor_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    type(error_t), allocatable, intent(inout) :: error
    !> as for a local matrix
    logical, intent(in), optional :: general

    call self%free()
    allocate (self%id)
    self%comm => comm
    self%id%comm = comm%mpi%mpi_val
    self%id%sym = 1
    if (present(general)) self%id%sym = merge(0, 1, general)
    call start(self, error)
  end subroutine sparse_factor_init_distributed

  subroutine start(self, error)
    class(sparse_factor_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    self%n = 0
    self%analyses = 0
    self%factorisations = 0
    self%solves = 0
    self%id%par = 1
    call run(self, job_start, "start", error)
    if (allocated(error)) return
    self%started = .true.
    self%id%icntl(1:3) = -1
    self%id%icntl(4) = 0
    ! sequential analysis: the ordering sees the pattern, never the values, on the host
    self%id%icntl(28) = 1
    if (associated(self%comm)) then
      self%id%icntl(18) = 3
      self%id%icntl(20) = 10
      self%id%icntl(21) = 1
      ! no dense root spread by ScaLAPACK: interface matrices are small beside it
      self%id%icntl(13) = 1
    end if
  end subroutine start

  pure logical function sparse_factor_is_alive(self) result(alive)
    class(sparse_factor_t), intent(in) :: self
    alive = associated(self%id)
  end function sparse_factor_is_alive

  !> Analyse and factorise, as far as the matrix or its pattern are new. Collective when distributed.
  subroutine sparse_factor_factorise(self, n, row, column, value, error)
    class(sparse_factor_t), intent(inout) :: self
    !> order of the matrix
    integer, intent(in) :: n
    !> entries given by this rank, of the lower triangle where the matrix is symmetric; entries of the same place add up
    integer, intent(in), contiguous :: row(:), column(:)
    real(dp), intent(in), contiguous :: value(:)
    type(error_t), allocatable, intent(inout) :: error
    logical :: same_pattern, same_values

    if (allocated(error)) return
    call compare(self, n, row, column, value, same_pattern, same_values)
    if (same_values) return
    if (.not. same_pattern) then
      call keep_pattern(self, n, row, column)
      call run(self, job_analyse, "analysis", error)
      self%analyses = self%analyses + 1
    end if
    if (associated(self%comm)) then
      self%id%a_loc(1:size(value)) = value
    else
      self%id%a(1:size(value)) = value
    end if
    call run(self, job_factorise, "factorisation", error)
    self%factorisations = self%factorisations + 1
    self%n = n
    if (self%id%icntl(24) == 1 .and. self%id%infog(28) > 0) call raise(error, status_failure, "sparse direct solver (MUMPS): "// &
      & to_text(self%id%infog(28))//" of "//to_text(n)//" pivots are 0 up to rounding")
    if (allocated(error)) self%n = 0
  end subroutine sparse_factor_factorise

  !> Whether the matrix factorised last has the same pattern, and the same values too.
  subroutine compare(self, n, row, column, value, same_pattern, same_values)
    class(sparse_factor_t), intent(inout) :: self
    integer, intent(in) :: n
    integer, intent(in), contiguous :: row(:), column(:)
    real(dp), intent(in), contiguous :: value(:)
    logical, intent(out) :: same_pattern, same_values

    same_pattern = self%n == n .and. self%n > 0
    same_values = .false.
    if (associated(self%comm)) then
      if (same_pattern) same_pattern = self%id%nnz_loc == size(row, kind=i8)
      if (same_pattern) same_pattern = all(self%id%irn_loc(1:size(row)) == row) .and. all(self%id%jcn_loc(1:size(row)) == column)
      same_pattern = .not. self%comm%any_true(.not. same_pattern)
      if (same_pattern) same_values = all(abs(self%id%a_loc(1:size(row)) - value) <= 0.0_dp)
      same_values = .not. self%comm%any_true(.not. same_values)
    else
      if (same_pattern) same_pattern = self%id%nnz == size(row, kind=i8)
      if (same_pattern) same_pattern = all(self%id%irn(1:size(row)) == row) .and. all(self%id%jcn(1:size(row)) == column)
      if (same_pattern) same_values = all(abs(self%id%a(1:size(row)) - value) <= 0.0_dp)
    end if
  end subroutine compare

  subroutine keep_pattern(self, n, row, column)
    class(sparse_factor_t), intent(inout) :: self
    integer, intent(in) :: n
    integer, intent(in), contiguous :: row(:), column(:)
    integer :: m

    m = size(row)
    call drop_matrix(self)
    self%id%n = n
    if (associated(self%comm)) then
      self%id%nnz_loc = m
      allocate (self%id%irn_loc(max(m, 1)), self%id%jcn_loc(max(m, 1)), self%id%a_loc(max(m, 1)))
      self%id%irn_loc(1:m) = row
      self%id%jcn_loc(1:m) = column
      self%id%a_loc(:) = 0.0_dp
    else
      self%id%nnz = m
      allocate (self%id%irn(max(m, 1)), self%id%jcn(max(m, 1)), self%id%a(max(m, 1)))
      self%id%irn(1:m) = row
      self%id%jcn(1:m) = column
      self%id%a(:) = 0.0_dp
    end if
  end subroutine keep_pattern

  subroutine drop_matrix(self)
    class(sparse_factor_t), intent(inout) :: self

    if (associated(self%id%irn_loc)) deallocate (self%id%irn_loc, self%id%jcn_loc, self%id%a_loc)
    if (associated(self%id%irn)) deallocate (self%id%irn, self%id%jcn, self%id%a)
    nullify (self%id%irn_loc, self%id%jcn_loc, self%id%a_loc, self%id%irn, self%id%jcn, self%id%a)
    self%n = 0
  end subroutine drop_matrix

  !> Solve in place for several right-hand sides; local matrices only.
  subroutine sparse_factor_solve(self, b, error)
    class(sparse_factor_t), intent(inout) :: self
    !> (n, number of right-hand sides)
    real(dp), intent(inout), contiguous :: b(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, n

    if (size(b) == 0) return
    n = self%n
    allocate (self%id%rhs(size(b)))
    do k = 1, size(b, 2)
      self%id%rhs((k - 1)*n + 1:k*n) = b(:, k)
    end do
    self%id%nrhs = size(b, 2)
    self%id%lrhs = n
    call run(self, job_solve, "solve", error)
    do k = 1, size(b, 2)
      b(:, k) = self%id%rhs((k - 1)*n + 1:k*n)
    end do
    deallocate (self%id%rhs)
    self%solves = self%solves + size(b, 2)
  end subroutine sparse_factor_solve

  !> Solve for one right-hand side whose rows are spread over the ranks in blocks. Collective.
  subroutine sparse_factor_solve_rows(self, first_row, b, error)
    class(sparse_factor_t), intent(inout) :: self
    !> first row of each rank, and the order plus 1 (number of ranks + 1)
    integer, intent(in), contiguous :: first_row(:)
    !> rows of this rank: right-hand side in, solution out
    real(dp), intent(inout), contiguous :: b(:)
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: found(:)
    real(dp), allocatable :: solution(:)
    integer :: k, n_found

    associate (id => self%id)
      allocate (id%irhs_loc(max(size(b), 1)), id%rhs_loc(max(size(b), 1)))
      do k = 1, size(b)
        id%irhs_loc(k) = first_row(self%comm%rank + 1) + k - 1
        id%rhs_loc(k) = b(k)
      end do
      n_found = id%info(23)
      allocate (id%isol_loc(max(n_found, 1)), id%sol_loc(max(n_found, 1)))
      id%nrhs = 1
      id%nloc_rhs = size(b)
      id%lrhs_loc = size(id%rhs_loc)
      id%lsol_loc = size(id%sol_loc)
      call run(self, job_solve, "solve", error)
      found = id%isol_loc(1:n_found)
      solution = id%sol_loc(1:n_found)
      deallocate (id%irhs_loc, id%rhs_loc, id%isol_loc, id%sol_loc)
    end associate
    self%solves = self%solves + 1
    if (.not. allocated(error)) call return_rows(self%comm, first_row, found, solution, b)
  end subroutine sparse_factor_solve_rows

  !> Bring the rows of a solution from where the factors left them to the ranks that own them.
  subroutine return_rows(comm, first_row, found, solution, b)
    type(communicator_t), intent(in) :: comm
    integer, intent(in), contiguous :: first_row(:), found(:)
    real(dp), intent(in), contiguous :: solution(:)
    real(dp), intent(inout), contiguous :: b(:)
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: k, low, high, middle

    allocate (records(2, size(found)), destination(size(found)))
    do k = 1, size(found)
      low = 1
      high = size(first_row) - 1
      do while (low < high)
        middle = (low + high + 1)/2
        if (first_row(middle) <= found(k)) then
          low = middle
        else
          high = middle - 1
        end if
      end do
      destination(k) = low - 1
      records(1, k) = found(k)
      records(2, k) = transfer(solution(k), 0_i8)
    end do
    call sparse_exchange(comm, records, destination, received)
    do k = 1, size(received, 2)
      b(narrow(received(1, k)) - first_row(comm%rank + 1) + 1) = transfer(received(2, k), 0.0_dp)
    end do
  end subroutine return_rows

  !> Run one stage; grow the work space as long as that is what it lacks.
  subroutine run(self, job, what, error)
    class(sparse_factor_t), intent(inout) :: self
    integer, intent(in) :: job
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: attempt

    if (allocated(error)) return
    do attempt = 1, 6
      self%id%job = job
      call dmumps(self%id)
      if (all(self%id%infog(1) /= mended_by_space)) exit
      self%id%icntl(14) = 2*max(self%id%icntl(14), 20)
    end do
    if (self%id%infog(1) < 0) call raise(error, status_failure, "sparse direct solver (MUMPS): "//what// &
      & " failed with INFOG(1) = "//to_text(self%id%infog(1))//", INFOG(2) = "//to_text(self%id%infog(2))// &
      & ", order "//to_text(self%id%n))
  end subroutine run

  subroutine sparse_factor_free(self)
    class(sparse_factor_t), intent(inout) :: self

    if (.not. associated(self%id)) return
    if (self%started) then
      call drop_matrix(self)
      self%id%job = job_end
      call dmumps(self%id)
    end if
    self%started = .false.
    deallocate (self%id)
    nullify (self%comm)
  end subroutine sparse_factor_free

end module gravier_sparse_direct
