!> Schwarz-NSCD: whole masses in every subdomain, the neighbours' impulses on shared bodies as loads (paper, (15)-(23)).
module gravier_schwarz
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_exchange
  use gravier_contact_problem, only: contact_problem_t
  use gravier_scheme, only: scheme_t, start_sweeps, sweep_all
  implicit none
  private
  public :: schwarz_t, neighbour_load_t, start_neighbour_loads, shared_reactions, take_neighbour_loads

  !> R^ddm on the shared bodies of one subdomain (nv, n_shared) [N s]
  type :: neighbour_load_t
    real(dp), allocatable :: value(:, :)
  end type neighbour_load_t

  type, extends(scheme_t) :: schwarz_t
    !> share of a change of R^ddm that is taken over: 1 in the paper, less where the method would diverge
    real(dp) :: relaxation = 1.0_dp
    type(neighbour_load_t), allocatable :: load(:)
  contains
    procedure :: start => schwarz_start
    procedure :: iterate => schwarz_iterate
  end type schwarz_t

contains

  subroutine schwarz_start(self, problem, error)
    class(schwarz_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    call start_sweeps(self, problem, shared_masses=.false.)
    call start_neighbour_loads(problem, self%load)
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
    call sweep_all(self, problem)
    if (measure) jump = problem%jump()
    call start_timer(phase_exchange)
    do s = 1, size(problem%sub)
      call shared_reactions(problem, s, self%load(s))
      call problem%shared%load(s, problem%sub(s)%reaction)
    end do
    call take_neighbour_loads(problem, self%relaxation, self%load)
    call stop_timer(phase_exchange)
    self%work%interface_solves = self%work%interface_solves + 1
  end subroutine schwarz_iterate

  !> R_E = M (V_E - M^-1 R^d) - R_E^ddm on the shared bodies of subdomain `s`, into `reaction`: equal to H_E r_E, without
  !> a pass over the contacts. Components that cannot move have none.
  subroutine shared_reactions(problem, s, load)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s
    type(neighbour_load_t), intent(in) :: load
    integer :: k, b

    associate (sub => problem%sub(s), part => problem%shared%part(s))
      do k = 1, part%n_shared
        b = part%body(k)
        sub%reaction(:, b) = sub%velocity(:, b) - sub%v_free(:, b)
        call sub%multiply_mass(b, sub%reaction(:, b))
        sub%reaction(:, b) = sub%reaction(:, b) - load%value(:, k)
      end do
    end associate
  end subroutine shared_reactions

  !> Loads that agree with the impulses at the start of a solve, which `start_sweeps` has put into the velocities; none
  !> on components that cannot move.
  subroutine start_neighbour_loads(problem, load)
    type(contact_problem_t), intent(inout) :: problem
    type(neighbour_load_t), allocatable, intent(out) :: load(:)
    integer :: s, k, d

    allocate (load(size(problem%sub)))
    do s = 1, size(problem%sub)
      call problem%own_reactions(s)
      call problem%shared%load(s, problem%sub(s)%reaction)
      allocate (load(s)%value(problem%kernels%nv, problem%shared%part(s)%n_shared), source=0.0_dp)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      do k = 1, problem%shared%part(s)%n_shared
        call problem%shared%add_copies(s, k, load(s)%value(:, k))
        do d = 1, problem%kernels%nv
          if (.not. problem%sub(s)%moves(d, problem%shared%part(s)%body(k))) load(s)%value(d, k) = 0.0_dp
        end do
      end do
    end do
  end subroutine start_neighbour_loads

  !> Pass the reactions loaded into the exchange on, R_E^ddm = sum over E* /= E of B_E B_E*^T R_E*, and change the velocities by
  !> what the loads have changed. With under-relaxation, only a share of the change is taken over. Collective.
  subroutine take_neighbour_loads(problem, relaxation, load)
    type(contact_problem_t), intent(inout) :: problem
    !> in (0, 1]
    real(dp), intent(in) :: relaxation
    type(neighbour_load_t), intent(inout) :: load(:)
    real(dp) :: change(problem%kernels%nv)
    integer :: s, k, b, nd, nw

    nd = problem%kernels%nd
    nw = problem%kernels%nw
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      associate (part => problem%shared%part(s), sub => problem%sub(s), old => load(s)%value)
        do k = 1, part%n_shared
          b = part%body(k)
          change(:) = 0.0_dp
          call problem%shared%add_copies(s, k, change)
          change(:) = relaxation*(change - old(:, k))
          old(:, k) = old(:, k) + change
          sub%velocity(1:nd, b) = sub%velocity(1:nd, b) + sub%weight(1:nd, b)*change(1:nd)
          sub%velocity(nd + 1:, b) = sub%velocity(nd + 1:, b) + sub%weight(nw, b)*change(nd + 1:)
        end do
      end associate
    end do
  end subroutine take_neighbour_loads

end module gravier_schwarz
