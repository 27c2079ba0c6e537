!> Direct solution of the interface problem: X_eta is assembled from the dense blocks of the subdomains, each rank
!> giving its own, and factorised by all ranks together.
!>
!> A parallel factorisation does not round the same way on every number of ranks. The solution is therefore refined in
!> twice the working precision, with residuals that do not depend on the ranks, far beyond the working precision: rounded
!> back, it has the same bits on any number of ranks.
module gravier_interface_direct
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_double_double, only: extended_product, extended_add
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_sparse_direct, only: sparse_factor_t
  use gravier_interface_problem, only: interface_field_t, interface_solver_t
  implicit none
  private
  public :: interface_direct_t

  !> What one subdomain adds to X_eta.
  type :: block_t
    !> M_eta^-1 between the degrees of freedom of its shared bodies (nv n_shared, nv n_shared) [1/kg]
    real(dp), allocatable :: compliance(:, :)
    !> numbers of the first unknown of the upper and lower multiplier of each shared body, 0 beyond the ends (n_shared)
    integer, allocatable :: upper(:), lower(:)
  end type block_t

  !> Values on the multipliers of a subdomain as sums high + low (nv, n_shared).
  type :: extended_field_t
    real(dp), allocatable :: upper(:, :), upper_low(:, :), lower(:, :), lower_low(:, :)
  end type extended_field_t

  type, extends(interface_solver_t) :: interface_direct_t
    type(sparse_factor_t) :: factor
    type(block_t), allocatable, private :: blocks(:)
    !> unknowns of all ranks, of this rank and of the ranks before it, and the first one of each rank (ranks + 1)
    integer, private :: n = 0, n_own = 0, before = 0
    integer, allocatable, private :: first_row(:)
  contains
    procedure :: prepare => interface_direct_prepare
    procedure :: solve => interface_direct_solve
    procedure :: free => interface_direct_free
  end type interface_direct_t

  !> relative size of a correction at which refinement stops, and steps it may take
  real(dp), parameter :: enough = 1.0e-28_dp
  integer, parameter :: most_refinements = 12
  !> right-hand sides solved together
  integer, parameter :: block_width = 64

contains

  subroutine interface_direct_prepare(self, problem, matrix, error)
    class(interface_direct_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    integer :: s

    if (.not. self%factor%is_alive()) call self%factor%init_distributed(problem%comm, error, general=matrix%general)
    call number_unknowns(self, problem%comm, problem%shared, error)
    if (self%n == 0 .or. allocated(error)) return
    do s = 1, size(self%blocks)
      call find_compliance(problem%shared, problem%sub(s)%n_bodies, matrix, s, self%blocks(s)%compliance, error)
    end do
    call problem%comm%agree(error)
    if (allocated(error)) return
    call assemble(self%blocks, problem%nv, matrix%general, row, column, value)
    call self%factor%factorise(self%n, row, column, value, error)
    call problem%comm%agree(error)
  end subroutine interface_direct_prepare

  !> Number the multipliers: those of a subdomain after those of the one before; a multiplier belongs to the lower of
  !> the two subdomains that it ties. Collective.
  subroutine number_unknowns(self, comm, shared, error)
    class(interface_direct_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(inout) :: shared
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: first(:)
    integer(i8) :: mine, next
    integer :: s, k, at, nv

    nv = shared%width
    mine = 0
    do s = 1, size(shared%part)
      associate (part => shared%part(s))
        do k = 1, part%n_shared
          if (part%copy_rank(k) < part%multiplicity(k)) mine = mine + nv
        end do
      end associate
    end do
    next = comm%offset(mine) + 1
    if (comm%total(mine) > huge(0)) call raise(error, status_failure, &
      & "the interface has more than 2^31 unknowns; choose interface = 'cg'")
    if (allocated(error)) return
    self%n = narrow(comm%total(mine))
    allocate (first(comm%size + 1), source=0_i8)
    first(comm%rank + 1) = next
    call comm%sum_counts(first)
    first(comm%size + 1) = self%n + 1
    self%first_row = narrow(first)
    self%n_own = narrow(mine)
    self%before = self%first_row(comm%rank + 1) - 1
    if (allocated(self%blocks)) deallocate (self%blocks)
    allocate (self%blocks(size(shared%part)))
    do s = 1, size(shared%part)
      associate (part => shared%part(s), block => self%blocks(s))
        allocate (block%upper(part%n_shared), block%lower(part%n_shared), source=0)
        do k = 1, part%n_shared
          if (part%copy_rank(k) == part%multiplicity(k)) cycle
          block%upper(k) = narrow(next)
          next = next + nv
        end do
        do k = 1, part%n_slots
          part%send(:, k) = block%upper(part%slot_shared(k))
        end do
      end associate
    end do
    call shared%pass()
    do s = 1, size(shared%part)
      associate (part => shared%part(s), block => self%blocks(s))
        do k = 1, part%n_shared
          at = part%first(k) + part%copy_rank(k) - 1
          if (at > part%first(k)) block%lower(k) = nint(part%recv(1, part%slot(at - 1)))
        end do
      end associate
    end do
  end subroutine number_unknowns

  !> Columns of M_eta,E^-1 of the shared bodies, at the shared bodies.
  subroutine find_compliance(shared, n_bodies, matrix, s, compliance, error)
    type(shared_exchange_t), intent(in) :: shared
    !> of the subdomain
    integer, intent(in) :: n_bodies
    type(enriched_matrix_t), intent(inout) :: matrix
    integer, intent(in) :: s
    real(dp), allocatable, intent(out) :: compliance(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: dof(:)
    real(dp), allocatable :: columns(:, :)
    integer :: k, d, nv, from, width, j

    nv = shared%width
    allocate (dof(nv*shared%n_shared(s)))
    associate (body => shared%part(s)%body)
      do k = 1, size(dof)/nv
        do d = 1, nv
          dof((k - 1)*nv + d) = (body(k) - 1)*nv + d
        end do
      end do
    end associate
    allocate (compliance(size(dof), size(dof)))
    do from = 1, size(dof), block_width
      width = min(block_width, size(dof) - from + 1)
      allocate (columns(nv*n_bodies, width), source=0.0_dp)
      do j = 1, width
        columns(dof(from + j - 1), j) = 1.0_dp
      end do
      call matrix%part(s)%factor%solve(columns, error)
      do j = 1, width
        do k = 1, size(dof)
          compliance(k, from + j - 1) = columns(dof(k), j)
        end do
      end do
      deallocate (columns)
    end do
  end subroutine find_compliance

  !> The blocks A_E M_eta,E^-1 A_E^T of this rank, as triplets; of symmetric ones the lower triangle.
  subroutine assemble(blocks, nv, general, row, column, value)
    type(block_t), intent(in) :: blocks(:)
    integer, intent(in) :: nv
    logical, intent(in) :: general
    integer, allocatable, intent(out) :: row(:), column(:)
    real(dp), allocatable, intent(out) :: value(:)
    integer :: s, round, n

    do round = 1, 2
      n = 0
      do s = 1, size(blocks)
        call scan_block(blocks(s))
      end do
      if (round == 1) allocate (row(n), column(n), value(n))
    end do

  contains

    subroutine scan_block(block)
      type(block_t), intent(in) :: block
      integer :: k, l

      do l = 1, size(block%upper)
        do k = 1, size(block%upper)
          call add_pair(block, k, l, block%upper(k), block%upper(l), 1.0_dp)
          call add_pair(block, k, l, block%upper(k), block%lower(l), -1.0_dp)
          call add_pair(block, k, l, block%lower(k), block%upper(l), -1.0_dp)
          call add_pair(block, k, l, block%lower(k), block%lower(l), 1.0_dp)
        end do
      end do
    end subroutine scan_block

    subroutine add_pair(block, k, l, first_row, first_column, factor)
      type(block_t), intent(in) :: block
      integer, intent(in) :: k, l, first_row, first_column
      real(dp), intent(in) :: factor
      integer :: p, q

      if (first_row == 0 .or. first_column == 0) return
      do q = 0, nv - 1
        do p = 0, nv - 1
          if (first_row + p < first_column + q .and. .not. general) cycle
          n = n + 1
          if (round == 1) cycle
          row(n) = first_row + p
          column(n) = first_column + q
          value(n) = factor*block%compliance((k - 1)*nv + p + 1, (l - 1)*nv + q + 1)
        end do
      end do
    end subroutine add_pair

  end subroutine assemble

  subroutine interface_direct_solve(self, problem, matrix, b, f, error)
    class(interface_direct_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(interface_field_t), intent(in) :: b(:)
    type(interface_field_t), intent(inout) :: f(:)
    type(error_t), allocatable, intent(inout) :: error
    type(extended_field_t), allocatable :: x(:)
    type(interface_field_t), allocatable :: r(:)
    real(dp), allocatable :: rows(:)
    real(dp) :: size_now(2), last
    integer :: k, s

    if (self%n == 0 .or. size(matrix%part) /= size(f)) return
    allocate (x(size(b)))
    do s = 1, size(b)
      allocate (x(s)%upper(size(b(s)%upper, 1), size(b(s)%upper, 2)), source=0.0_dp)
      x(s)%upper_low = x(s)%upper
      x(s)%lower = x(s)%upper
      x(s)%lower_low = x(s)%upper
    end do
    r = b
    allocate (rows(self%n_own))
    last = huge(1.0_dp)
    do k = 1, most_refinements
      call gather_rows(self, r, rows)
      call self%factor%solve_rows(self%first_row, rows, error)
      call problem%comm%agree(error)
      if (allocated(error)) return
      call add_rows(self, problem%comm, problem%shared, rows, x, size_now)
      self%iterations = self%iterations + 1
      if (size_now(1) <= enough*size_now(2) .or. size_now(1) >= 0.5_dp*last) exit
      last = size_now(1)
      call extended_residual(self, problem%shared, b, x, r)
    end do
    do s = 1, size(f)
      f(s)%upper(:, :) = x(s)%upper
      f(s)%lower(:, :) = x(s)%lower
    end do
  end subroutine interface_direct_solve

  !> The residual on the unknowns of this rank, in working precision.
  subroutine gather_rows(self, r, rows)
    class(interface_direct_t), intent(in) :: self
    type(interface_field_t), intent(in) :: r(:)
    real(dp), intent(inout), contiguous :: rows(:)
    integer :: s, k, at, nv

    do s = 1, size(r)
      nv = size(r(s)%upper, 1)
      do k = 1, size(self%blocks(s)%upper)
        if (self%blocks(s)%upper(k) == 0) cycle
        at = self%blocks(s)%upper(k) - self%before - 1
        rows(at + 1:at + nv) = r(s)%upper(:, k)
      end do
    end do
  end subroutine gather_rows

  !> Add a correction to x on both sides of each multiplier. Collective.
  subroutine add_rows(self, comm, shared, rows, x, size_now)
    class(interface_direct_t), intent(in) :: self
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(inout) :: shared
    real(dp), intent(in), contiguous :: rows(:)
    type(extended_field_t), intent(inout) :: x(:)
    !> largest entry of the correction and of x
    real(dp), intent(out) :: size_now(2)
    integer :: s, k, at, nv

    nv = shared%width
    size_now(:) = 0.0_dp
    do s = 1, size(x)
      associate (part => shared%part(s), block => self%blocks(s))
        do k = 1, part%n_slots
          part%send(:, k) = 0.0_dp
          if (block%upper(part%slot_shared(k)) == 0) cycle
          at = block%upper(part%slot_shared(k)) - self%before - 1
          part%send(:, k) = rows(at + 1:at + nv)
        end do
        do k = 1, part%n_shared
          if (block%upper(k) == 0) cycle
          at = block%upper(k) - self%before - 1
          call extended_add(x(s)%upper(:, k), x(s)%upper_low(:, k), rows(at + 1:at + nv))
          size_now(1) = max(size_now(1), maxval(abs(rows(at + 1:at + nv))))
          size_now(2) = max(size_now(2), maxval(abs(x(s)%upper(:, k))))
        end do
      end associate
    end do
    call shared%pass()
    do s = 1, size(x)
      associate (part => shared%part(s))
        do k = 1, part%n_shared
          at = part%first(k) + part%copy_rank(k) - 1
          if (at > part%first(k)) &
            & call extended_add(x(s)%lower(:, k), x(s)%lower_low(:, k), part%recv(:, part%slot(at - 1)))
        end do
      end associate
    end do
    call comm%highest_of(size_now)
  end subroutine add_rows

  !> r := b - X x, computed in twice the working precision, on upper multipliers. Collective.
  subroutine extended_residual(self, shared, b, x, r)
    class(interface_direct_t), intent(in) :: self
    type(shared_exchange_t), intent(inout) :: shared
    type(interface_field_t), intent(in) :: b(:)
    type(extended_field_t), intent(in) :: x(:)
    type(interface_field_t), intent(inout) :: r(:)
    type(extended_field_t), allocatable :: y(:)
    integer :: s, k, at

    ! y%upper holds b - y of the subdomain, y%lower the velocities y that its neighbours below want
    allocate (y(size(x)))
    do s = 1, size(x)
      call own_velocities(self%blocks(s)%compliance, x(s), y(s))
      y(s)%upper = b(s)%upper
      allocate (y(s)%upper_low(size(y(s)%upper, 1), size(y(s)%upper, 2)), source=0.0_dp)
      call extended_add(y(s)%upper, y(s)%upper_low, -y(s)%lower)
      call extended_add(y(s)%upper, y(s)%upper_low, -y(s)%lower_low)
    end do
    call add_neighbours(high=.true.)
    call add_neighbours(high=.false.)
    do s = 1, size(x)
      r(s)%upper(:, :) = y(s)%upper
    end do

  contains

    !> Add the high or the low part of the velocity of the next copy on each chain.
    subroutine add_neighbours(high)
      logical, intent(in) :: high

      do s = 1, size(x)
        associate (part => shared%part(s))
          do k = 1, part%n_slots
            if (high) then
              part%send(:, k) = y(s)%lower(:, part%slot_shared(k))
            else
              part%send(:, k) = y(s)%lower_low(:, part%slot_shared(k))
            end if
          end do
        end associate
      end do
      call shared%pass()
      do s = 1, size(x)
        associate (part => shared%part(s))
          do k = 1, part%n_shared
            at = part%first(k) + part%copy_rank(k) - 1
            if (at < part%first(k + 1) - 1) &
              & call extended_add(y(s)%upper(:, k), y(s)%upper_low(:, k), part%recv(:, part%slot(at + 1)))
          end do
        end associate
      end do
    end subroutine add_neighbours

  end subroutine extended_residual

  !> M_eta^-1 A^T x at the shared bodies, into lower + lower_low of `y`.
  pure subroutine own_velocities(compliance, x, y)
    real(dp), intent(in), contiguous :: compliance(:, :)
    type(extended_field_t), intent(in) :: x
    type(extended_field_t), intent(inout) :: y
    real(dp), dimension(size(compliance, 1)) :: v_high, v_low, y_high, y_low
    integer :: k, d, nv, at

    nv = size(x%upper, 1)
    do k = 1, size(x%upper, 2)
      do d = 1, nv
        at = (k - 1)*nv + d
        v_high(at) = x%upper(d, k)
        v_low(at) = x%upper_low(d, k)
        call extended_add(v_high(at), v_low(at), -x%lower(d, k))
        call extended_add(v_high(at), v_low(at), -x%lower_low(d, k))
      end do
    end do
    call extended_product(compliance, v_high, v_low, y_high, y_low)
    allocate (y%lower(nv, size(x%upper, 2)), y%lower_low(nv, size(x%upper, 2)))
    do k = 1, size(x%upper, 2)
      y%lower(:, k) = y_high((k - 1)*nv + 1:k*nv)
      y%lower_low(:, k) = y_low((k - 1)*nv + 1:k*nv)
    end do
  end subroutine own_velocities

  subroutine interface_direct_free(self)
    class(interface_direct_t), intent(inout) :: self
    call self%factor%free()
    if (allocated(self%blocks)) deallocate (self%blocks)
    self%n = 0
    self%iterations = 0
  end subroutine interface_direct_free

end module gravier_interface_direct
