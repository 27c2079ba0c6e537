!> The enriched matrices M_E + H_E l_E H_E^T of the subdomains of a rank, and their factors.
!>
!> A component that cannot move (inverse mass 0) is eliminated: its row and column hold a one on the diagonal and nothing else,
!> and its velocity is zero. Its place is kept, so that all bodies have as many unknowns.
module gravier_enriched_matrix
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_sparse_rows, only: entries_t
  use gravier_timers, only: start_timer, stop_timer, phase_factorise
  use gravier_contact_kernels, only: kernels_t, contact_jacobian, lanes, n_blocks, lane_of, block_of
  use gravier_body_mass, only: mass_column
  use gravier_contact_operator, only: find_local_operator
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_method_options, only: held_list_t
  use gravier_method, only: method_t, begin_sweeps, sweep_once, end_sweeps
  use gravier_sparse_direct, only: sparse_factor_t
  use gravier_search_direction, only: search_direction_t
  implicit none
  private
  public :: enriched_matrix_t, sweep_all_recording, drop_inactive

  !> What one subdomain adds to its contact problem.
  type :: enriched_part_t
    !> l of each component (lanes, nc, blocks) [kg]; like the next two, unallocated where l has blocks that are not symmetric
    real(dp), allocatable :: direction(:, :, :)
    !> velocity that solved the law at each contact's last update (lanes, nc, blocks) [m/s]
    real(dp), allocatable :: law_velocity(:, :, :)
    !> work spaces: contact values (lanes, nc, blocks), body values (nv, n_columns)
    real(dp), allocatable :: contact_work(:, :, :), body_work(:, :)
    type(sparse_factor_t) :: factor
  end type enriched_part_t

  type :: enriched_matrix_t
    type(search_direction_t) :: direction
    !> what the safeguard has left of l
    real(dp) :: factor = 1.0_dp
    !> iterations since l was set
    integer, private :: uses = 0
    !> l has blocks that are not symmetric: set before `start`, factorised by `factorise_blocks`
    logical :: general = .false.
    type(enriched_part_t), allocatable :: part(:)
  contains
    procedure :: is_enriched => enriched_matrix_is_enriched
    procedure :: on_active_only => enriched_matrix_on_active_only
    procedure :: set_factor => enriched_matrix_set_factor
    procedure :: count_use => enriched_matrix_count_use
    procedure, nopass :: held => enriched_matrix_held
    procedure :: start => enriched_matrix_start
    procedure :: update => enriched_matrix_update
    procedure :: factorise_blocks => enriched_matrix_factorise_blocks
    procedure :: solve => enriched_matrix_solve
    procedure :: enrich => enriched_matrix_enrich
    procedure :: counts => enriched_matrix_counts
    procedure :: free => enriched_matrix_free
  end type enriched_matrix_t

contains

  !> What `start` allocates where l has no blocks of the caller; not the factors, whose size the matrices decide.
  pure subroutine enriched_matrix_held(nc, nv, held)
    !> components of a contact, of a body
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    call held%add("enriched matrix, without factors", .true., 8, 3*nc)
    call held%add("right-hand side of the enriched matrix", .false., 8, nv)
  end subroutine enriched_matrix_held

  !> Whether l is more than 0.
  pure logical function enriched_matrix_is_enriched(self) result(is_enriched)
    class(enriched_matrix_t), intent(in) :: self
    is_enriched = self%direction%value*self%factor > 0.0_dp
  end function enriched_matrix_is_enriched

  !> Whether l is 0 on contacts that are not active.
  pure logical function enriched_matrix_on_active_only(self) result(on_active_only)
    class(enriched_matrix_t), intent(in) :: self
    on_active_only = self%direction%active_only
  end function enriched_matrix_on_active_only

  !> Make ready for a new problem. Factors of the last problem are kept, in case the matrices are the same.
  subroutine enriched_matrix_start(self, problem, error)
    class(enriched_matrix_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    if (allocated(self%part)) then
      if (size(self%part) /= size(problem%sub)) call self%free()
    end if
    if (.not. allocated(self%part)) allocate (self%part(size(problem%sub)))
    do s = 1, size(self%part)
      if (.not. self%part(s)%factor%is_alive()) call self%part(s)%factor%init_local(error, general=self%general)
      call make_room(self%part(s), problem%kernels, problem%sub(s), self%general)
    end do
  end subroutine enriched_matrix_start

  subroutine make_room(part, kernels, sub, general)
    type(enriched_part_t), intent(inout) :: part
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> the caller keeps the blocks of l
    logical, intent(in) :: general

    if (allocated(part%body_work)) deallocate (part%body_work)
    allocate (part%body_work(kernels%nv, sub%n_columns), source=0.0_dp)
    if (general) return
    if (allocated(part%direction)) deallocate (part%direction, part%law_velocity, part%contact_work)
    allocate (part%direction(lanes, kernels%nc, n_blocks(sub%n_contacts)), source=0.0_dp)
    allocate (part%law_velocity, part%contact_work, mold=part%direction)
    part%law_velocity(:, :, :) = 0.0_dp
    part%contact_work(:, :, :) = 0.0_dp
  end subroutine make_room

  !> Take another fraction of l, from the next `update` on, which is due at once.
  pure subroutine enriched_matrix_set_factor(self, factor)
    class(enriched_matrix_t), intent(inout) :: self
    real(dp), intent(in) :: factor
    self%factor = factor
    self%uses = 0
  end subroutine enriched_matrix_set_factor

  !> Count an iteration, and say whether `update` is due in it: in the first one; with l on active contacts, which come and go, in
  !> the 2nd, 4th, 8th ... too. Factors are worth hundreds of sweeps, and those of some iterations ago serve almost as well.
  pure subroutine enriched_matrix_count_use(self, due)
    class(enriched_matrix_t), intent(inout) :: self
    logical, intent(out) :: due

    self%uses = self%uses + 1
    due = self%uses == 1
    if (self%direction%active_only) due = iand(self%uses, self%uses - 1) == 0
  end subroutine enriched_matrix_count_use

  !> Set l and factorise the matrices that it or the problem changed.
  subroutine enriched_matrix_update(self, problem, changed, error)
    class(enriched_matrix_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> whether some matrix of this rank was factorised anew
    logical, intent(out) :: changed
    type(error_t), allocatable, intent(inout) :: error
    type(entries_t) :: entries
    real(dp), allocatable :: block(:, :, :)
    integer(i8) :: before
    integer :: s

    changed = .false.
    call start_timer(phase_factorise)
    do s = 1, size(self%part)
      associate (part => self%part(s), sub => problem%sub(s))
        if (sub%n_bodies == 0) cycle
        call set_direction(self%direction, self%factor, problem%kernels, sub, part%direction)
        call make_diagonal_blocks(part%direction, sub%n_contacts, block)
        call assemble(problem%kernels, sub, block, .false., entries)
        before = part%factor%factorisations
        call part%factor%factorise(sub%n_bodies*problem%nv, entries%row, entries%column, entries%value, error)
        changed = changed .or. part%factor%factorisations > before
      end associate
    end do
    call stop_timer(phase_factorise)
  end subroutine enriched_matrix_update

  !> l of every component of every contact, with W_aa of the undivided bodies.
  pure subroutine set_direction(rule, factor, kernels, sub, direction)
    type(search_direction_t), intent(in) :: rule
    real(dp), intent(in) :: factor
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> (lanes, nc, blocks)
    real(dp), intent(out), contiguous :: direction(:, :, :)
    real(dp) :: w(2)
    integer :: c, q, g

    direction(:, :, :) = 0.0_dp
    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      direction(q, :, g) = factor*rule%value
      if (rule%relative) then
        call find_local_operator(kernels, sub%pair, sub%hot, c, sub%inverse_mass, w)
        direction(q, 1, g) = factor*rule%value/w(1)
        direction(q, 2:, g) = factor*rule%value/w(2)
      end if
    end do
    if (rule%active_only) call drop_inactive(kernels, sub, direction)
  end subroutine set_direction

  !> Put zeros where contacts are not active: everywhere on contacts without impulse, in the tangential part of those that slide.
  pure subroutine drop_inactive(kernels, sub, field)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> (lanes, nc, blocks)
    real(dp), intent(inout), contiguous :: field(:, :, :)
    integer :: c, q, g

    do c = 1, sub%n_contacts
      q = lane_of(c)
      g = block_of(c)
      if (.not. sub%impulse(q, 1, g) > 0.0_dp) then
        field(q, :, g) = 0.0_dp
      else if (kernels%nc > 1) then
        if (norm2(sub%impulse(q, 2:, g)) >= sub%hot(q, kernels%friction_row, g)*sub%impulse(q, 1, g)) field(q, 2:, g) = 0.0_dp
      end if
    end do
  end subroutine drop_inactive

  !> Factorise M + H l H^T of a subdomain with any blocks l.
  subroutine enriched_matrix_factorise_blocks(self, kernels, sub, s, block, error)
    class(enriched_matrix_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> its place on this rank
    integer, intent(in) :: s
    !> (nc, nc, contacts) [kg]
    real(dp), intent(in), contiguous :: block(:, :, :)
    type(error_t), allocatable, intent(inout) :: error
    type(entries_t) :: entries

    if (sub%n_bodies == 0) return
    call assemble(kernels, sub, block, self%general, entries)
    call self%part(s)%factor%factorise(sub%n_bodies*kernels%nv, entries%row, entries%column, entries%value, error)
  end subroutine enriched_matrix_factorise_blocks

  !> The blocks (nc, nc, contacts) of an l without coupling.
  pure subroutine make_diagonal_blocks(direction, n_contacts, block)
    !> (lanes, nc, blocks)
    real(dp), intent(in), contiguous :: direction(:, :, :)
    integer, intent(in) :: n_contacts
    real(dp), allocatable, intent(out) :: block(:, :, :)
    integer :: c, k

    allocate (block(size(direction, 2), size(direction, 2), n_contacts), source=0.0_dp)
    do c = 1, n_contacts
      do k = 1, size(direction, 2)
        block(k, k, c) = direction(lane_of(c), k, block_of(c))
      end do
    end do
  end subroutine make_diagonal_blocks

  !> M + H l H^T with the masses in `weight`, as entries, of a symmetric matrix the lower triangle; components that cannot
  !> move eliminated.
  subroutine assemble(kernels, sub, block, general, entries)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> l (nc, nc, contacts) [kg]
    real(dp), intent(in), contiguous :: block(:, :, :)
    logical, intent(in) :: general
    type(entries_t), intent(out) :: entries
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), mass(kernels%nv)
    integer :: b, c, d, k, n, nv, coupled, side, on_wall, of_pair

    nv = kernels%nv
    ! on what moves as prescribed: the antagonist, or a candidate glued to it
    on_wall = 0
    do c = 1, sub%n_contacts
      if (any(sub%pair(:, c) > sub%n_bodies)) on_wall = on_wall + 1
    end do
    of_pair = merge(2*nv*nv, nv*(nv + 1), general)
    ! components of a velocity that a mass matrix couples to others: the last ones, where it is not diagonal
    coupled = merge(3, 0, kernels%nw == 9)
    n = sub%n_bodies*(nv + coupled*(coupled - 1)/merge(1, 2, general)) + on_wall*(of_pair/2) &
      & + (sub%n_contacts - on_wall)*(of_pair + merge(2, 1, general)*nv*nv)
    call entries%init(n)
    do b = 1, sub%n_bodies
      do d = 1, nv
        call mass_column(sub%inverse_mass(:, b), sub%weight(:, b), d, mass)
        if (.not. sub%moves(d, b)) mass(d) = 1.0_dp
        call entries%add((b - 1)*nv + d, (b - 1)*nv + d, mass(d))
        if (d <= nv - coupled) cycle
        do k = merge(nv - coupled + 1, d + 1, general), nv
          if (k /= d) call entries%add((b - 1)*nv + k, (b - 1)*nv + d, mass(k))
        end do
      end do
    end do
    do c = 1, sub%n_contacts
      call contact_jacobian(kernels, sub%hot, c, jacobian(:, :, 1), jacobian(:, :, 2))
      do side = 1, 2
        if (sub%pair(side, c) <= sub%n_bodies) call add_block(sub%pair(side, c), sub%pair(side, c), side, side)
      end do
      if (any(sub%pair(:, c) > sub%n_bodies)) cycle
      if (sub%pair(1, c) > sub%pair(2, c) .or. general) call add_block(sub%pair(1, c), sub%pair(2, c), 1, 2)
      if (sub%pair(1, c) < sub%pair(2, c) .or. general) call add_block(sub%pair(2, c), sub%pair(1, c), 2, 1)
    end do

  contains

    !> J_a^T l J_b at bodies (i, j); of a symmetric matrix i >= j, and of a diagonal block the lower triangle.
    subroutine add_block(i, j, a, b)
      integer, intent(in) :: i, j, a, b
      integer :: p, q, k
      real(dp) :: x, row_of(kernels%nc)

      do p = 1, nv
        do k = 1, kernels%nc
          row_of(k) = sum(jacobian(:, p, a)*block(:, k, c))
        end do
        do q = 1, merge(p, nv, i == j .and. .not. general)
          x = 0.0_dp
          if (sub%moves(p, i) .and. sub%moves(q, j)) x = sum(row_of*jacobian(:, q, b))
          call entries%add((i - 1)*nv + p, (j - 1)*nv + q, x)
        end do
      end do
    end subroutine add_block

  end subroutine assemble

  !> Solve (M + H l H^T) y = b in a subdomain, in place; what cannot move has no velocity, walls among it.
  subroutine enriched_matrix_solve(self, sub, s, b, error)
    class(enriched_matrix_t), intent(inout) :: self
    type(subproblem_t), intent(in) :: sub
    !> its place on this rank
    integer, intent(in) :: s
    !> (nv, n_columns) [N s, N m s] in, [m/s, rad/s] out
    real(dp), intent(inout), contiguous :: b(:, :)
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: flat(:, :)
    integer :: k, d, nv

    nv = size(b, 1)
    allocate (flat(nv*sub%n_bodies, 1))
    do k = 1, sub%n_bodies
      flat((k - 1)*nv + 1:k*nv, 1) = b(:, k)
    end do
    if (size(flat) > 0) call self%part(s)%factor%solve(flat, error)
    do k = 1, sub%n_bodies
      do d = 1, nv
        b(d, k) = merge(flat((k - 1)*nv + d, 1), 0.0_dp, sub%moves(d, k))
      end do
    end do
    b(:, sub%n_bodies + 1:) = 0.0_dp
  end subroutine enriched_matrix_solve

  !> (M + H l H^T)^-1 H l (v - H^T V) of a subdomain, into body_work: v is the velocity that solved the law at each
  !> contact's last update, V the present velocity of the bodies. It vanishes when the two agree.
  subroutine enriched_matrix_enrich(self, kernels, sub, s, error)
    class(enriched_matrix_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> its place on this rank
    integer, intent(in) :: s
    type(error_t), allocatable, intent(inout) :: error

    associate (part => self%part(s))
      call sub%contact_velocity(kernels, sub%velocity, part%contact_work)
      part%contact_work(:, :, :) = part%direction*(part%law_velocity - part%contact_work)
      if (self%direction%active_only) call drop_inactive(kernels, sub, part%contact_work)
      part%body_work(:, :) = 0.0_dp
      call sub%add_reaction(kernels, part%contact_work, part%body_work)
      call self%solve(sub, s, part%body_work, error)
    end associate
  end subroutine enriched_matrix_enrich

  !> Analyses and factorisations done on this rank.
  pure subroutine enriched_matrix_counts(self, analyses, factorisations)
    class(enriched_matrix_t), intent(in) :: self
    integer(i8), intent(out) :: analyses, factorisations
    integer :: s

    analyses = 0
    factorisations = 0
    if (.not. allocated(self%part)) return
    do s = 1, size(self%part)
      analyses = analyses + self%part(s)%factor%analyses
      factorisations = factorisations + self%part(s)%factor%factorisations
    end do
  end subroutine enriched_matrix_counts

  subroutine enriched_matrix_free(self)
    class(enriched_matrix_t), intent(inout) :: self
    integer :: s

    if (.not. allocated(self%part)) return
    do s = 1, size(self%part)
      call self%part(s)%factor%free()
    end do
    deallocate (self%part)
  end subroutine enriched_matrix_free

  !> As sweep_all, keeping in the last sweep the velocity that solved each contact's law.
  subroutine sweep_all_recording(method, problem, matrix)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    integer :: s, k

    call begin_sweeps(method, problem)
    do s = 1, size(problem%sub)
      do k = 1, method%sweeps - 1
        call sweep_once(method, problem, s, k)
      end do
      call sweep_once(method, problem, s, method%sweeps, matrix%part(s)%law_velocity)
    end do
    call end_sweeps(method, problem)
  end subroutine sweep_all_recording

end module gravier_enriched_matrix
