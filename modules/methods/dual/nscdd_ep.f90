!> NSCDD-EP: NSCDD with an enriched interface problem (paper, (24)-(29), with v_E restored in (27)).
!>
!> The interface problem (28) is solved for the change of F. With M~_E V_E = R_E^d + H_E r_E - A_E^T F before the solve,
!>   X_eta (F_new - F) = sum_E A_E [ V_E + M_eta,E^-1 H_E l_E (v_E - H_E^T V_E) ],
!> which is (28) less X_eta F: the same solution, but rounding shrinks with the change, and F itself need not be kept.
!>
!> That is the paper's method, with l on all contacts. With l on active contacts, an iteration is one of NSCDD, and a correction of
!> the impulses follows (gravier_impulse_feedback).
module gravier_nscdd_ep
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_exchange, phase_interface_solve, phase_factorise
  use gravier_body_mass, only: subtract_inverse_mass
  use gravier_contact_kernels, only: kernels_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: work_t, start_sweeps
  use gravier_method_options, only: method_features_t, method_options_t, held_list_t, default_on_active
  use gravier_nscdd, only: nscdd_t, average_copies
  use gravier_search_direction, only: chosen_direction
  use gravier_interface_cg, only: interface_cg_t
  use gravier_interface_direct, only: interface_direct_t
  use gravier_enriched_matrix, only: enriched_matrix_t, sweep_all_recording
  use gravier_direction_guard, only: direction_guard_t
  use gravier_impulse_feedback, only: impulse_feedback_t
  use gravier_interface_problem, only: interface_field_t, interface_solver_t, make_field, chain_differences
  implicit none
  private
  public :: nscdd_ep_t

  !> l where none is given, on active contacts and on all [1/W_aa]
  real(dp), parameter :: direction_on_active = 100.0_dp, direction_on_all = 0.3_dp

  !> With l = 0 it is NSCDD, bit for bit.
  type, extends(nscdd_t) :: nscdd_ep_t
    type(enriched_matrix_t) :: matrix
    class(interface_solver_t), allocatable :: interface_solver
    !> change of the multipliers, and the right-hand side of the interface problem
    type(interface_field_t), allocatable, private :: change(:), b(:)
    !> l on active contacts: impulses are fed back
    type(impulse_feedback_t), private :: feedback
    type(direction_guard_t), private :: guard
    logical, private :: prepared = .false.
  contains
    procedure, nopass :: features => nscdd_ep_features
    procedure :: set => nscdd_ep_set
    procedure :: held => nscdd_ep_held
    procedure :: start => nscdd_ep_start
    procedure :: iterate => nscdd_ep_iterate
    procedure :: free => nscdd_ep_free
    procedure :: work_done => nscdd_ep_work_done
  end type nscdd_ep_t

contains

  pure function nscdd_ep_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="nscdd_ep", meaning="NSCDD-EP", accelerated_by_default=default_on_active, &
      & active_by_default=.true.)
  end function nscdd_ep_features

  subroutine nscdd_ep_set(self, options)
    class(nscdd_ep_t), intent(inout) :: self
    type(method_options_t), intent(in) :: options
    type(interface_cg_t), allocatable :: cg

    call self%nscdd_t%set(options)
    self%matrix%direction = chosen_direction(options, direction_on_active, direction_on_all)
    self%direction_text = self%matrix%direction%text()
    if (options%interface_cg) then
      allocate (cg)
      cg%tolerance = options%cg_tolerance
      cg%max_iterations = options%cg_max_iterations
      call move_alloc(cg, self%interface_solver)
    else
      allocate (interface_direct_t :: self%interface_solver)
    end if
  end subroutine nscdd_ep_set

  pure subroutine nscdd_ep_held(self, nc, nv, held)
    class(nscdd_ep_t), intent(in) :: self
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    call self%nscdd_t%held(nc, nv, held)
    call self%matrix%held(nc, nv, held)
    call held%add("impulses of the safeguard of l", .true., 8, nc)
    if (.not. self%matrix%on_active_only()) return
    call held%add("impulses fed back", .true., 8, nc)
    call held%add("velocities fed back", .false., 8, nv)
  end subroutine nscdd_ep_held

  subroutine nscdd_ep_start(self, problem, error)
    class(nscdd_ep_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call self%nscdd_t%start(problem, error)
    call self%matrix%set_factor(1.0_dp)
    self%guarded = is_enriched(self)
    if (.not. is_enriched(self)) return
    call make_field(problem%shared, self%change)
    call make_field(problem%shared, self%b)
    if (self%matrix%on_active_only()) call self%feedback%start(problem)
    call self%guard%start(problem)
    call self%matrix%start(problem, error)
    call problem%comm%agree(error)
    self%prepared = .false.
  end subroutine nscdd_ep_start

  pure logical function is_enriched(self)
    class(nscdd_ep_t), intent(in) :: self
    is_enriched = self%matrix%is_enriched()
  end function is_enriched

  subroutine nscdd_ep_iterate(self, problem, measure, jump, error)
    class(nscdd_ep_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error
    logical :: lowered

    jump = 0.0_dp
    if (allocated(error)) return
    if (.not. is_enriched(self)) then
      call self%nscdd_t%iterate(problem, measure, jump, error)
      return
    end if
    call sweep_all_recording(self, problem, self%matrix)
    if (measure) jump = problem%jump()
    if (self%matrix%on_active_only()) then
      call start_timer(phase_exchange)
      call average_copies(problem)
      call stop_timer(phase_exchange)
    end if
    call prepare(self, problem, error)
    if (allocated(error)) return
    call start_timer(phase_interface_solve)
    call solve_interface(self, problem, error)
    if (allocated(error)) return
    call stop_timer(phase_interface_solve)
    self%work%interface_solves = self%work%interface_solves + 1
    call self%guard%watch(problem, lowered)
    if (.not. lowered) return
    call start_sweeps(self, problem, shared_masses=.true.)
    call self%matrix%set_factor(self%guard%factor)
    self%guarded = is_enriched(self)
    self%work%lowered = self%work%lowered + 1
    self%prepared = .false.
  end subroutine nscdd_ep_iterate

  !> Factorise what is due: at the first iteration of a solve or with a new l, and for active contacts now and then. Collective.
  subroutine prepare(self, problem, error)
    class(nscdd_ep_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    logical :: due, changed

    call self%matrix%count_use(due)
    if (.not. due) return
    call self%matrix%update(problem, changed, error)
    call problem%comm%agree(error)
    if (allocated(error)) return
    if (self%prepared) changed = problem%comm%any_true(changed)
    call start_timer(phase_factorise)
    if (changed .or. .not. self%prepared) call self%interface_solver%prepare(problem, self%matrix, error)
    call stop_timer(phase_factorise)
    self%prepared = .true.
  end subroutine prepare

  !> Solve the interface problem and take over what it gives: multipliers, or impulses. Collective; an error is the same on all
  !> ranks.
  subroutine solve_interface(self, problem, error)
    class(nscdd_ep_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    do s = 1, size(problem%sub)
      if (self%matrix%on_active_only()) then
        call self%matrix%enrich(problem%kernels, problem%sub(s), s, error)
        call self%feedback%keep_lead(s, self%matrix)
      else
        call enriched_velocities(self, problem%kernels, problem%sub(s), s, error)
      end if
      self%change(s)%upper(:, :) = 0.0_dp
      self%change(s)%lower(:, :) = 0.0_dp
    end do
    call chain_differences(problem%shared, self%matrix, self%b)
    call problem%comm%agree(error)
    if (allocated(error)) return
    call self%interface_solver%solve(problem, self%matrix, self%b, self%change, error)
    if (allocated(error)) return
    if (self%matrix%on_active_only()) then
      call self%feedback%take(problem, self%matrix, self%change, error)
    else
      do s = 1, size(problem%sub)
        call take_multipliers(problem%shared, s, self%change(s), problem%sub(s))
      end do
    end if
  end subroutine solve_interface

  !> V_E + M_eta,E^-1 H_E l_E (v_E - H_E^T V_E), into body_work.
  subroutine enriched_velocities(self, kernels, sub, s, error)
    class(nscdd_ep_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> its place on this rank
    integer, intent(in) :: s
    type(error_t), allocatable, intent(inout) :: error

    call self%matrix%enrich(kernels, sub, s, error)
    associate (work => self%matrix%part(s)%body_work)
      work(:, :) = work + sub%velocity
    end associate
  end subroutine enriched_velocities

  !> V_E changes by - M~_E^-1 A_E^T (F_new - F).
  subroutine take_multipliers(shared, s, change, sub)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: s
    type(interface_field_t), intent(in) :: change
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: load(shared%width)
    integer :: k, b

    associate (part => shared%part(s))
      do k = 1, part%n_shared
        b = part%body(k)
        load(:) = change%upper(:, k) - change%lower(:, k)
        call subtract_inverse_mass(sub%weight(:, b), load, sub%velocity(:, b))
      end do
    end associate
  end subroutine take_multipliers

  subroutine nscdd_ep_free(self)
    class(nscdd_ep_t), intent(inout) :: self
    call self%matrix%free()
    if (allocated(self%interface_solver)) call self%interface_solver%free()
    if (allocated(self%change)) deallocate (self%change, self%b)
    self%feedback = impulse_feedback_t()
    self%guard = direction_guard_t()
    self%work = work_t()
  end subroutine nscdd_ep_free

  type(work_t) function nscdd_ep_work_done(self) result(work)
    class(nscdd_ep_t), intent(in) :: self
    work = self%work
    call self%matrix%counts(work%analyses, work%factorisations)
    work%interface_iterations = self%interface_solver%iterations
  end function nscdd_ep_work_done

end module gravier_nscdd_ep
