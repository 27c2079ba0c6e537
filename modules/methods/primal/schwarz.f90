!> Schwarz-NSCD: whole masses in every subdomain, the neighbours' impulses on shared bodies as loads (paper, (15)-(23)).
module gravier_schwarz
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_exchange
  use gravier_body_mass, only: add_inverse_mass, inverse_product
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_acceleration, only: acceleration_t, extrapolate
  use gravier_method, only: method_t, take_options, work_t, start_sweeps, sweep_all
  use gravier_method_options, only: method_features_t, method_options_t
  implicit none
  private
  public :: schwarz_t, neighbour_load_t, relaxation_t, start_neighbour_loads, shared_reactions, take_neighbour_loads, &
    & extrapolate_loads, chosen_relaxation

  !> a change not measured yet; its multiple by growth_allowed is a number still [J]
  real(dp), parameter :: unknown = 0.1_dp*huge(1.0_dp)
  !> growth of the alternating part of the changes that lowers the factor, and what is left of it then
  real(dp), parameter :: growth_allowed = 2.0_dp, factor_kept = 0.8_dp
  !> a cycle: changes that go back at least this fraction of the change before, iteration after iteration, so many times, without an
  !> alternating part below `progress` times that of the first of them
  real(dp), parameter :: way_back = 0.5_dp, progress = 0.8_dp
  integer, parameter :: idle_iterations = 20

  !> Loads of the neighbours on the shared bodies of one subdomain, each (nv, n_shared) [N s, N m s].
  type :: neighbour_load_t
    !> R^ddm
    real(dp), allocatable :: value(:, :)
    !> what the last iteration asked it to change by
    real(dp), private, allocatable :: change(:, :)
    !> R^ddm of the iteration before; allocated where sweeps are accelerated
    real(dp), private, allocatable :: previous(:, :)
  end type neighbour_load_t

  !> The relaxation factor, the fraction of a change of R^ddm that is applied: 1 in the paper, less where the method would
  !> diverge. It does so by changes d_k that alternate from one iteration to the next, and grow: where |d_k - d_k-1|^2 is more
  !> than twice its lowest value so far, and d_k no longer goes along with d_k-1, the automatic factor is lowered. Impulses that
  !> cannot be negative bound the growth: the factor is lowered too where the changes go to and fro and do not fall. See
  !> doc/theory.md section 9.
  type :: relaxation_t
    !> in (0, 1]
    real(dp) :: factor = 1.0_dp
    !> whether `adapt` may lower the factor; each solve starts at 1 then
    logical :: automatic = .true.
    !> whether a factor that stays is asked for `grows`
    logical :: watched = .false.
    !> the automatic factor is not lowered beyond this
    real(dp) :: least = 1.0_dp
    !> by the last `adapt`, the changes alternate, and grow or stay
    logical :: grows = .false.
    !> |d|^2 of the last iteration, negative before the first, and lowest |d_k - d_k-1|^2 since the factor was lowered [J]
    real(dp) :: last = -1.0_dp, lowest = unknown
    !> iterations in a row that went back, and |d_k - d_k-1|^2 of the last of them that had made progress [J]
    integer, private :: idle = 0
    real(dp), private :: mark = unknown
  contains
    procedure :: adapt => relaxation_adapt
    procedure, private :: note_cycle => relaxation_note_cycle
  end type relaxation_t

  type, extends(method_t) :: schwarz_t
    type(relaxation_t) :: relaxation
    type(neighbour_load_t), allocatable :: load(:)
  contains
    procedure, nopass :: features => schwarz_features
    procedure :: set => schwarz_set
    procedure :: start => schwarz_start
    procedure :: iterate => schwarz_iterate
  end type schwarz_t

contains

  pure function schwarz_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="schwarz", meaning="Schwarz-NSCD", moments=.true., relaxes=.true.)
  end function schwarz_features

  subroutine schwarz_set(self, options)
    class(schwarz_t), intent(inout) :: self
    type(method_options_t), intent(in) :: options

    call take_options(self, options)
    self%relaxation = chosen_relaxation(options)
  end subroutine schwarz_set

  !> A given factor is fixed.
  pure type(relaxation_t) function chosen_relaxation(options) result(relaxation)
    type(method_options_t), intent(in) :: options
    relaxation%automatic = .not. options%relaxation_given
    if (options%relaxation_given) relaxation%factor = options%relaxation
  end function chosen_relaxation

  subroutine schwarz_start(self, problem, error)
    class(schwarz_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    self%adapts = self%relaxation%automatic
    call start_sweeps(self, problem, shared_masses=.false.)
    call start_neighbour_loads(problem, self%acceleration%on, self%relaxation, self%load)
  end subroutine schwarz_start

  subroutine schwarz_iterate(self, problem, measure, jump, error)
    class(schwarz_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    jump = 0.0_dp
    if (allocated(error)) return
    call extrapolate_loads(self%acceleration, self%load)
    call sweep_all(self, problem)
    if (measure) jump = problem%jump()
    call start_timer(phase_exchange)
    do s = 1, size(problem%sub)
      call shared_reactions(problem%sub(s), problem%shared, s, self%load(s))
      call problem%shared%load(s, problem%sub(s)%reaction)
    end do
    call take_neighbour_loads(problem%sub, problem%comm, problem%shared, self%relaxation, self%load, self%work)
    call stop_timer(phase_exchange)
    self%work%interface_solves = self%work%interface_solves + 1
  end subroutine schwarz_iterate

  !> R_E = M (V_E - M^-1 R^d) - R_E^ddm on the shared bodies of subdomain `s`, into `reaction`: equal to H_E r_E, without
  !> a pass over the contacts. Components that cannot move have none.
  subroutine shared_reactions(sub, shared, s, load)
    type(subproblem_t), intent(inout) :: sub
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: s
    type(neighbour_load_t), intent(in) :: load
    integer :: k, b

    associate (part => shared%part(s))
      do k = 1, part%n_shared
        b = part%body(k)
        sub%reaction(:, b) = sub%velocity(:, b) - sub%v_free(:, b)
        call sub%multiply_mass(b, sub%reaction(:, b))
        sub%reaction(:, b) = sub%reaction(:, b) - load%value(:, k)
      end do
    end associate
  end subroutine shared_reactions

  !> Loads that agree with the impulses at the start of a solve, which `start_sweeps` has put into the velocities; none
  !> on components that cannot move. Collective.
  subroutine start_neighbour_loads(problem, acceleration, relaxation, load)
    type(contact_problem_t), intent(inout) :: problem
    !> whether the loads are to be extrapolated
    logical, intent(in) :: acceleration
    !> started anew
    type(relaxation_t), intent(inout) :: relaxation
    type(neighbour_load_t), allocatable, intent(out) :: load(:)
    integer :: s

    allocate (load(size(problem%sub)))
    do s = 1, size(problem%sub)
      call problem%own_reactions(s)
      call problem%shared%load(s, problem%sub(s)%reaction)
      allocate (load(s)%value(problem%nv, problem%shared%n_shared(s)), source=0.0_dp)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%reaction, mean=.false.)
      call take_reactions_of_others(problem%sub(s), problem%shared, s, load(s)%value)
      allocate (load(s)%change, mold=load(s)%value)
      load(s)%change(:, :) = 0.0_dp
      if (acceleration) load(s)%previous = load(s)%value
    end do
    if (relaxation%automatic) then
      relaxation = relaxation_t(least=1.0_dp/largest_multiplicity(problem%comm, problem%shared))
    else
      relaxation = relaxation_t(factor=relaxation%factor, automatic=.false., watched=relaxation%watched)
    end if
  end subroutine start_neighbour_loads

  !> Sum of the reactions of the other copies of each body that a subdomain shares; none on components that cannot move.
  subroutine take_reactions_of_others(sub, shared, s, load)
    type(subproblem_t), intent(in) :: sub
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: s
    !> (nv, n_shared), zero on entry [N s, N m s]
    real(dp), intent(inout), contiguous :: load(:, :)
    integer :: k, d

    associate (part => shared%part(s))
      do k = 1, part%n_shared
        call shared%add_copies(s, k, load(:, k))
        do d = 1, size(load, 1)
          if (.not. sub%moves(d, part%body(k))) load(d, k) = 0.0_dp
        end do
      end do
    end associate
  end subroutine take_reactions_of_others

  !> Subdomains that share the body which most share. Collective.
  real(dp) function largest_multiplicity(comm, shared) result(largest)
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(in) :: shared
    integer :: s, k

    largest = 1.0_dp
    do s = 1, size(shared%part)
      associate (part => shared%part(s))
        do k = 1, part%n_shared
          largest = max(largest, real(part%multiplicity(k), dp))
        end do
      end associate
    end do
    largest = comm%highest(largest)
  end function largest_multiplicity

  !> Where sweeps are accelerated, bring the loads to those under the extrapolated impulses, as `begin_sweeps` does with the
  !> velocities.
  subroutine extrapolate_loads(acceleration, load)
    type(acceleration_t), intent(in) :: acceleration
    type(neighbour_load_t), intent(inout) :: load(:)
    integer :: s

    if (.not. acceleration%on .or. acceleration%resting) return
    do s = 1, size(load)
      call extrapolate(acceleration%beta, load(s)%value, load(s)%previous)
    end do
  end subroutine extrapolate_loads

  !> Pass the reactions loaded into the exchange on, R_E^ddm = sum over E* /= E of B_E B_E*^T R_E*, and change the velocities by
  !> what the loads have changed. With under-relaxation, only a fraction of the change is applied. Collective.
  subroutine take_neighbour_loads(sub, comm, shared, relaxation, load, work)
    type(subproblem_t), intent(inout) :: sub(:)
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(inout) :: shared
    type(relaxation_t), intent(inout) :: relaxation
    type(neighbour_load_t), intent(inout) :: load(:)
    !> counts how often the factor is lowered
    type(work_t), intent(inout) :: work
    real(dp) :: change(shared%width), parts(2, size(load)), sums(2), factor
    integer :: s, k, b

    call shared%pass()
    parts(:, :) = 0.0_dp
    do s = 1, size(sub)
      associate (part => shared%part(s), own => sub(s), load => load(s))
        do k = 1, part%n_shared
          b = part%body(k)
          change(:) = 0.0_dp
          call shared%add_copies(s, k, change)
          change(:) = change - load%value(:, k)
          parts(1, s) = parts(1, s) + inverse_product(own%weight(:, b), change, change)
          parts(2, s) = parts(2, s) + inverse_product(own%weight(:, b), change, load%change(:, k))
          load%change(:, k) = change
        end do
      end associate
    end do
    if (relaxation%automatic .or. relaxation%watched) then
      call comm%sum_parts(parts, sums)
      factor = relaxation%factor
      call relaxation%adapt(sums(1), sums(2))
      if (relaxation%factor < factor) then
        work%relaxed = work%relaxed + 1
        work%least_factor = min(work%least_factor, relaxation%factor)
      end if
    end if
    do s = 1, size(sub)
      associate (part => shared%part(s), own => sub(s), load => load(s))
        do k = 1, part%n_shared
          b = part%body(k)
          change(:) = relaxation%factor*load%change(:, k)
          load%value(:, k) = load%value(:, k) + change
          call add_inverse_mass(own%weight(:, b), change, own%velocity(:, b))
        end do
      end associate
    end do
  end subroutine take_neighbour_loads

  !> Whether the changes of the loads alternate, and grow or stay; the automatic factor is lowered then.
  pure subroutine relaxation_adapt(self, change, product)
    class(relaxation_t), intent(inout) :: self
    !> |d_k|^2 and d_k . d_k-1 over all subdomains, 0 in the first iteration [J]
    real(dp), intent(in) :: change, product
    real(dp) :: alternating

    self%grows = .false.
    if (self%last >= 0.0_dp) then
      alternating = change + self%last - 2.0_dp*product
      self%grows = alternating > growth_allowed*self%lowest .and. 2.0_dp*product < self%last
      call self%note_cycle(alternating, product)
      if (self%grows) then
        if (self%automatic) self%factor = max(self%least, factor_kept*self%factor)
        self%lowest = alternating
        self%idle = 0
      end if
      self%lowest = min(self%lowest, alternating)
    end if
    self%last = change
  end subroutine relaxation_adapt

  !> Count the iterations of a cycle, and take a long one for growth.
  pure subroutine relaxation_note_cycle(self, alternating, product)
    class(relaxation_t), intent(inout) :: self
    !> |d_k - d_k-1|^2 and d_k . d_k-1 [J]
    real(dp), intent(in) :: alternating, product

    if (product < -way_back*self%last .and. self%idle > 0 .and. alternating > progress*self%mark) then
      self%idle = self%idle + 1
    else
      self%idle = merge(1, 0, product < -way_back*self%last)
      self%mark = alternating
    end if
    if (self%idle > idle_iterations) self%grows = .true.
  end subroutine relaxation_note_cycle

end module gravier_schwarz
