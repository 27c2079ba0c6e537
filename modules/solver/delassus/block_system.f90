!> Linear systems with the pattern of a packed contact problem, general blocks: assembled and solved with dense factors where
!> they are small, sparse ones where not. The pattern is analysed once.
module gravier_block_system
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_delassus, only: delassus_t
  use gravier_dense_direct, only: solve_dense
  use gravier_sparse_direct, only: sparse_factor_t
  implicit none
  private
  public :: block_system_t

  !> largest order of dense factors
  integer, parameter :: dense_order = 160

  type :: block_system_t
    private
    integer :: n = 0
    !> places of the entries, block by block: own blocks, then couplings (entries)
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:), dense(:, :)
    type(sparse_factor_t) :: factor
  contains
    procedure :: init => block_system_init
    procedure :: free => block_system_free
    procedure :: solve => block_system_solve
  end type block_system_t

contains

  !> Take the pattern of a problem.
  subroutine block_system_init(self, problem, error)
    class(block_system_t), intent(inout) :: self
    type(delassus_t), intent(in) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: a, k, m, size_of_block

    call self%free()
    self%n = problem%dimension*problem%n_contacts
    size_of_block = problem%dimension**2
    m = size_of_block*(problem%n_contacts + size(problem%other))
    allocate (self%row(m), self%column(m))
    if (self%n <= dense_order) then
      allocate (self%dense(self%n, self%n))
    else
      allocate (self%value(m))
      call self%factor%init_local(error, general=.true.)
    end if
    m = 0
    do a = 1, problem%n_contacts
      call place_block(a, a)
    end do
    do a = 1, problem%n_contacts
      do k = problem%first(a), problem%first(a + 1) - 1
        call place_block(a, problem%other(k))
      end do
    end do

  contains

    subroutine place_block(i, j)
      integer, intent(in) :: i, j
      integer :: row, column

      do column = 1, problem%dimension
        do row = 1, problem%dimension
          m = m + 1
          self%row(m) = (i - 1)*problem%dimension + row
          self%column(m) = (j - 1)*problem%dimension + column
        end do
      end do
    end subroutine place_block

  end subroutine block_system_init

  subroutine block_system_free(self)
    class(block_system_t), intent(inout) :: self

    self%n = 0
    if (allocated(self%row)) deallocate (self%row)
    if (allocated(self%column)) deallocate (self%column)
    if (allocated(self%value)) deallocate (self%value)
    if (allocated(self%dense)) deallocate (self%dense)
    call self%factor%free()
  end subroutine block_system_free

  !> Solve for one right-hand side.
  subroutine block_system_solve(self, own, coupling, x, regular)
    class(block_system_t), intent(inout) :: self
    !> blocks by columns (dimension**2, contacts), (dimension**2, couplings)
    real(dp), intent(in), contiguous :: own(:, :), coupling(:, :)
    !> right-hand side in, solution out (dimension, contacts)
    real(dp), intent(inout), contiguous, target :: x(:, :)
    !> if not, `x` is of no use
    logical, intent(out) :: regular
    type(error_t), allocatable :: error
    real(dp), pointer, contiguous :: flat(:, :)
    integer :: k, n_own

    flat(1:self%n, 1:1) => x
    n_own = size(own)
    if (allocated(self%dense)) then
      self%dense(:, :) = 0.0_dp
      call scatter(n_own, own, 0)
      call scatter(size(coupling), coupling, n_own)
      call solve_dense(self%dense, flat(:, 1), regular)
    else
      do k = 1, size(own, 2)
        self%value((k - 1)*size(own, 1) + 1:k*size(own, 1)) = own(:, k)
      end do
      do k = 1, size(coupling, 2)
        self%value(n_own + (k - 1)*size(own, 1) + 1:n_own + k*size(own, 1)) = coupling(:, k)
      end do
      call self%factor%factorise(self%n, self%row, self%column, self%value, error)
      regular = .not. allocated(error)
      if (regular) call self%factor%solve(flat, error)
      regular = .not. allocated(error)
    end if

  contains

    subroutine scatter(n, values, offset)
      integer, intent(in) :: n, offset
      real(dp), intent(in) :: values(n)
      integer :: i

      do i = 1, n
        self%dense(self%row(offset + i), self%column(offset + i)) = values(i)
      end do
    end subroutine scatter

  end subroutine block_system_solve

end module gravier_block_system
