!> Schwarz-NSCD-EC: Schwarz with enriched impulses on the interface (paper, (30)-(33)).
module gravier_schwarz_ec
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_exchange, phase_interface_solve
  use gravier_contact_kernels, only: kernels_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t, take_options, work_t, start_sweeps
  use gravier_method_options, only: method_features_t, method_options_t, held_list_t
  use gravier_direction_guard, only: direction_guard_t
  use gravier_search_direction, only: chosen_direction
  use gravier_enriched_matrix, only: enriched_matrix_t, sweep_all_recording
  use gravier_schwarz, only: neighbour_load_t, relaxation_t, start_neighbour_loads, shared_reactions, take_neighbour_loads, &
    & extrapolate_loads, chosen_relaxation
  implicit none
  private
  public :: schwarz_ec_t

  !> l where none is given [1/W_aa]
  real(dp), parameter :: usual_direction = 3.0_dp

  type, extends(method_t) :: schwarz_ec_t
    type(enriched_matrix_t) :: matrix
    type(relaxation_t) :: relaxation
    type(neighbour_load_t), allocatable :: load(:)
    type(direction_guard_t), private :: guard
  contains
    procedure, nopass :: features => schwarz_ec_features
    procedure :: set => schwarz_ec_set
    procedure :: held => schwarz_ec_held
    procedure :: start => schwarz_ec_start
    procedure :: iterate => schwarz_ec_iterate
    procedure :: free => schwarz_ec_free
    procedure :: work_done => schwarz_ec_work_done
  end type schwarz_ec_t

contains

  pure function schwarz_ec_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="schwarz_ec", meaning="Schwarz-NSCD-EC", relaxes=.true.)
  end function schwarz_ec_features

  subroutine schwarz_ec_set(self, options)
    class(schwarz_ec_t), intent(inout) :: self
    type(method_options_t), intent(in) :: options

    call take_options(self, options)
    self%relaxation = chosen_relaxation(options)
    self%matrix%direction = chosen_direction(options, usual_direction, usual_direction)
    self%direction_text = self%matrix%direction%text()
  end subroutine schwarz_ec_set

  pure subroutine schwarz_ec_held(self, nc, nv, held)
    class(schwarz_ec_t), intent(in) :: self
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    call self%acceleration%held(nc, nv, held)
    call self%matrix%held(nc, nv, held)
    call held%add("impulses of the safeguard of l", .true., 8, nc)
  end subroutine schwarz_ec_held

  subroutine schwarz_ec_start(self, problem, error)
    class(schwarz_ec_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%work%solves = self%work%solves + 1
    self%adapts = self%relaxation%automatic
    self%relaxation%watched = .true.
    call start_sweeps(self, problem, shared_masses=.false.)
    call start_neighbour_loads(problem, self%acceleration%on, self%relaxation, self%load)
    call self%matrix%set_factor(1.0_dp)
    self%guarded = is_enriched(self)
    if (self%guarded) call self%guard%start(problem)
    call self%matrix%start(problem, error)
    call problem%comm%agree(error)
  end subroutine schwarz_ec_start

  subroutine schwarz_ec_iterate(self, problem, measure, jump, error)
    class(schwarz_ec_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error
    logical :: due, changed, lowered
    integer :: s

    jump = 0.0_dp
    if (allocated(error)) return
    call extrapolate_loads(self%acceleration, self%load)
    call sweep_all_recording(self, problem, self%matrix)
    if (measure) jump = problem%jump()
    call self%matrix%count_use(due)
    if (due .or. self%matrix%on_active_only()) then
      call self%matrix%update(problem, changed, error)
      call problem%comm%agree(error)
      if (allocated(error)) return
    end if
    call start_timer(phase_interface_solve)
    do s = 1, size(problem%sub)
      call enriched_reactions(self, problem%kernels, problem%shared, problem%sub(s), s, error)
      call problem%shared%load(s, self%matrix%part(s)%body_work)
    end do
    call stop_timer(phase_interface_solve)
    call problem%comm%agree(error)
    call start_timer(phase_exchange)
    call take_neighbour_loads(problem%sub, problem%comm, problem%shared, self%relaxation, self%load, self%work)
    call stop_timer(phase_exchange)
    self%work%interface_solves = self%work%interface_solves + 1
    if (.not. is_enriched(self)) return
    ! a growth of the loads that a given factor lets go on is that of Schwarz, which no lower l mends
    if (self%relaxation%grows .and. .not. self%relaxation%automatic) then
      call self%guard%give_up(problem, lowered)
    else
      call self%guard%watch(problem, lowered)
    end if
    if (.not. lowered) return
    call start_sweeps(self, problem, shared_masses=.false.)
    call start_neighbour_loads(problem, self%acceleration%on, self%relaxation, self%load)
    call self%matrix%set_factor(self%guard%factor)
    self%guarded = is_enriched(self)
    self%work%lowered = self%work%lowered + 1
  end subroutine schwarz_ec_iterate

  pure logical function is_enriched(self)
    class(schwarz_ec_t), intent(in) :: self
    is_enriched = self%matrix%is_enriched()
  end function is_enriched

  !> R~_E = (I + L_E M_E^-1)^-1 ( R_E - L_E M_E^-1 (R_E^d + R_E^ddm) + H_E l_E v_E ) with L_E = H_E l_E H_E^T, on the shared
  !> bodies, into body_work. With I + L M^-1 = (M + L) M^-1 and M V_E = R_E^d + R_E^ddm + R_E this is
  !>   R~_E = R_E + M_E (M_E + L_E)^-1 H_E l_E (v_E - H_E^T V_E),
  !> v_E being the velocity that solved the law: without it R~_E = R_E.
  subroutine enriched_reactions(self, kernels, shared, sub, s, error)
    class(schwarz_ec_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    type(shared_exchange_t), intent(in) :: shared
    type(subproblem_t), intent(inout) :: sub
    !> its place on this rank
    integer, intent(in) :: s
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, b

    call shared_reactions(sub, shared, s, self%load(s))
    call self%matrix%enrich(kernels, sub, s, error)
    associate (work => self%matrix%part(s)%body_work, part => shared%part(s))
      do k = 1, part%n_shared
        b = part%body(k)
        call sub%multiply_mass(b, work(:, b))
        work(:, b) = sub%reaction(:, b) + work(:, b)
      end do
    end associate
  end subroutine enriched_reactions

  subroutine schwarz_ec_free(self)
    class(schwarz_ec_t), intent(inout) :: self
    call self%matrix%free()
    self%work = work_t()
  end subroutine schwarz_ec_free

  type(work_t) function schwarz_ec_work_done(self) result(work)
    class(schwarz_ec_t), intent(in) :: self
    work = self%work
    call self%matrix%counts(work%analyses, work%factorisations)
  end function schwarz_ec_work_done

end module gravier_schwarz_ec
