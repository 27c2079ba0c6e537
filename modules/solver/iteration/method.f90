!> What every method is: something that improves the impulses of a contact problem by iterations.
module gravier_method
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_sweep, phase_exchange, clock
  use gravier_communicator, only: communicator_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_acceleration, only: acceleration_t, start_acceleration, change_relaxation_factors, extrapolate
  use gravier_method_options, only: method_features_t, method_options_t, held_list_t
  implicit none
  private
  public :: method_t, take_options, work_t, start_sweeps, sweep_all, sweep_and_pass, begin_sweeps, sweep_once, end_sweeps

  !> What a method has done since it was made, for the closing table of a run.
  type :: work_t
    integer(i8) :: solves = 0, iterations = 0
    !> sweeps, and contacts relaxed on this rank
    integer(i8) :: sweeps = 0, relaxations = 0
    integer(i8) :: interface_solves = 0, interface_iterations = 0
    integer(i8) :: analyses = 0, factorisations = 0
    !> times that the safeguard of an enriched method has lowered its search direction
    integer(i8) :: lowered = 0
    !> times that the Nesterov momentum was restarted, and that acceleration gave way to plain iterations
    integer(i8) :: restarted = 0, suspended = 0
    !> times that the automatic relaxation factor of a Schwarz method was lowered, and how far at most
    integer(i8) :: relaxed = 0
    real(dp) :: least_factor = 1.0_dp
  contains
    procedure :: add => work_add
  end type work_t

  type, abstract :: method_t
    !> whether growth is left to a safeguard of the method, which mends it
    logical :: guarded = .false.
    !> what the log says of the search direction, empty without one
    character(len=:), allocatable :: direction_text
    !> the method lowers a factor of its own where changes grow
    logical :: adapts = .false.
    !> n_GS: sweeps of one iteration
    integer :: sweeps = 1
    type(acceleration_t) :: acceleration
    !> the next iteration costs much more than a check: check after it
    logical :: check_next = .false.
    !> the method keeps the best impulses of a solve: `conclude` takes them
    logical :: keeps_best = .false.
    !> the method has other means where its iterations gain nothing, and is not to be stopped there
    logical :: persists = .false.
    !> spent in sweeps of each subdomain of this rank since `forget_times` [s]
    real(dp), allocatable :: seconds(:)
    type(work_t) :: work
  contains
    procedure(describe_method), deferred, nopass :: features
    procedure(start_solve), deferred :: start
    procedure(iterate_once), deferred :: iterate
    procedure :: set => take_options
    procedure :: held => method_held
    procedure :: see => method_see
    procedure :: conclude => method_conclude
    procedure :: mends_growth => method_mends_growth
    procedure :: free => method_free
    procedure :: work_done => method_work_done
    procedure :: measure_balance => method_measure_balance
    procedure :: forget_times => method_forget_times
  end type method_t

  abstract interface
    !> What the method is called and what it serves.
    pure function describe_method() result(features)
      import :: method_features_t
      implicit none
      type(method_features_t) :: features
    end function describe_method
    !> Make ready for a new problem, from the impulses it holds, and evaluate v_global. Collective; an error is the same on all
    !> ranks.
    subroutine start_solve(self, problem, error)
      import :: method_t, contact_problem_t, error_t
      implicit none
      class(method_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      type(error_t), allocatable, intent(inout) :: error
    end subroutine start_solve
    !> One iteration: sweeps in every subdomain, then one exchange. Collective; an error is the same on all ranks.
    subroutine iterate_once(self, problem, measure, jump, error)
      import :: method_t, contact_problem_t, error_t, dp
      implicit none
      class(method_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      !> whether `jump` is asked for
      logical, intent(in) :: measure
      !> velocity jump between copies after the sweeps, see contact_problem_t%jump; 0 where not measured
      real(dp), intent(out) :: jump
      type(error_t), allocatable, intent(inout) :: error
    end subroutine iterate_once
  end interface

contains

  !> Take what the input says to the method; methods with options of their own take these, too.
  subroutine take_options(self, options)
    class(method_t), intent(inout) :: self
    type(method_options_t), intent(in) :: options

    self%sweeps = options%sweeps
    self%acceleration%on = options%acceleration
    self%direction_text = ""
  end subroutine take_options

  !> The arrays that the method holds beside those of all methods; methods with arrays of their own add them.
  pure subroutine method_held(self, nc, nv, held)
    class(method_t), intent(in) :: self
    !> components of a contact, of a body
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    call self%acceleration%held(nc, nv, held)
  end subroutine method_held

  !> A check has found this defect of the impulses of the problem; methods that keep the best ones override it.
  subroutine method_see(self, problem, defect)
    class(method_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> as the residual has it, not cut to 0 where it is rounding [N s]
    real(dp), intent(in) :: defect

    associate (unused_self => self, unused_problem => problem, unused => defect)
    end associate
  end subroutine method_see

  !> The end of a solve without success, with v_global evaluated: what is left are the impulses of the last iteration; methods
  !> that keep better ones override it. Collective.
  subroutine method_conclude(self, problem)
    class(method_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem

    self%check_next = .false.
    call problem%evaluate()
  end subroutine method_conclude

  !> Whether something in the method works against growth: a safeguard, acceleration that gives way, a factor that is lowered, or
  !> impulses kept from before.
  pure logical function method_mends_growth(self) result(mends)
    class(method_t), intent(in) :: self
    mends = self%guarded .or. self%adapts .or. self%keeps_best .or. self%acceleration%on
  end function method_mends_growth

  !> Give back what the method holds; methods that hold something override it.
  subroutine method_free(self)
    class(method_t), intent(inout) :: self
    self%work = work_t()
  end subroutine method_free

  !> Work done since the method was made; methods with factors of their own override it.
  type(work_t) function method_work_done(self) result(work)
    class(method_t), intent(in) :: self
    work = self%work
  end function method_work_done

  !> Add what another method has done in solves of this one.
  pure subroutine work_add(self, other)
    class(work_t), intent(inout) :: self
    type(work_t), intent(in) :: other

    self%iterations = self%iterations + other%iterations
    self%sweeps = self%sweeps + other%sweeps
    self%relaxations = self%relaxations + other%relaxations
    self%interface_solves = self%interface_solves + other%interface_solves
    self%interface_iterations = self%interface_iterations + other%interface_iterations
    self%analyses = self%analyses + other%analyses
    self%factorisations = self%factorisations + other%factorisations
    self%lowered = self%lowered + other%lowered
    self%restarted = self%restarted + other%restarted
    self%suspended = self%suspended + other%suspended
    self%relaxed = self%relaxed + other%relaxed
    self%least_factor = min(self%least_factor, other%least_factor)
  end subroutine work_add

  !> How unevenly the seconds in sweeps lie, of the ranks and of the subdomains: the most over the mean, 1 without any.
  !> Collective.
  subroutine method_measure_balance(self, comm, n_subdomains, ranks, subdomains)
    class(method_t), intent(in) :: self
    type(communicator_t), intent(in) :: comm
    !> of the scene
    integer, intent(in) :: n_subdomains
    real(dp), intent(out) :: ranks, subdomains
    real(dp) :: own(1, 1), longest, mean, total(1)

    own(:, :) = 0.0_dp
    longest = 0.0_dp
    if (allocated(self%seconds)) then
      own(1, 1) = sum(self%seconds)
      longest = maxval(self%seconds)
    end if
    call comm%sum_parts(own, total)
    mean = total(1)
    ranks = comm%highest(own(1, 1))
    subdomains = comm%highest(longest)
    if (mean > 0.0_dp) then
      ranks = ranks*comm%size/mean
      subdomains = subdomains*n_subdomains/mean
    else
      ranks = 1.0_dp
      subdomains = 1.0_dp
    end if
  end subroutine method_measure_balance

  subroutine method_forget_times(self)
    class(method_t), intent(inout) :: self
    if (allocated(self%seconds)) deallocate (self%seconds)
  end subroutine method_forget_times

  !> Masses as the method wants them, and reactions and velocities that agree with the impulses in all copies, v_global too.
  !> Collective.
  subroutine start_sweeps(method, problem, shared_masses)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    !> masses shared between the copies of a body (dual Schur methods), or whole in each
    logical, intent(in) :: shared_masses
    integer :: s

    if (problem%any_impulse()) then
      call problem%evaluate()
    else
      do s = 1, size(problem%sub)
        call problem%sub(s)%start_without_impulses()
      end do
    end if
    do s = 1, size(problem%sub)
      call problem%sub(s)%start_sweeps(problem%kernels, shared_masses)
    end do
    if (allocated(problem%progress)) deallocate (problem%progress)
    allocate (problem%progress(2, size(problem%sub)), source=0.0_dp)
    problem%progress_is_summed = .false.
    if (.not. allocated(method%seconds)) allocate (method%seconds(size(problem%sub)), source=0.0_dp)
    if (method%acceleration%on) call start_acceleration(method%acceleration, problem)
  end subroutine start_sweeps

  !> The sweeps of one iteration in every subdomain of this rank. Collective where they are accelerated.
  subroutine sweep_all(method, problem)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    integer :: s, k

    call begin_sweeps(method, problem)
    do s = 1, size(problem%sub)
      do k = 1, method%sweeps
        call sweep_once(method, problem, s, k)
      end do
    end do
    call end_sweeps(method, problem)
  end subroutine sweep_all

  !> The same, passing on the velocities of shared bodies. Subdomains with neighbours on other ranks come first, so that
  !> messages travel while the others are swept: no subdomain's sweeps depend on another's. Collective.
  subroutine sweep_and_pass(method, problem)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    integer :: s, k, round

    call begin_sweeps(method, problem)
    do round = 1, 2
      do s = 1, size(problem%sub)
        if (problem%shared%is_far(s) .neqv. round == 1) cycle
        do k = 1, method%sweeps
          call sweep_once(method, problem, s, k)
        end do
      end do
      call stop_timer(phase_sweep)
      call start_timer(phase_exchange)
      do s = 1, size(problem%sub)
        if (problem%shared%is_far(s) .eqv. round == 1) call problem%shared%load(s, problem%sub(s)%velocity)
      end do
      if (round == 1) call problem%shared%start()
      call stop_timer(phase_exchange)
      call start_timer(phase_sweep)
    end do
    call end_sweeps(method, problem)
    call start_timer(phase_exchange)
    call problem%shared%finish()
    call stop_timer(phase_exchange)
  end subroutine sweep_and_pass

  !> Where sweeps are accelerated, bring the velocities to those under the extrapolated impulses, from which the first sweep starts:
  !> V depends on r linearly.
  subroutine begin_sweeps(method, problem)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    integer :: s

    call start_timer(phase_sweep)
    problem%progress_is_summed = .false.
    if (.not. method%acceleration%on) return
    ! what alternates between subdomains, which a Schwarz method adapts a factor to, bears no longer steps
    if (.not. method%adapts .and. (method%acceleration%whole() .neqv. method%acceleration%whole_in_place)) then
      call change_relaxation_factors(method%acceleration, problem)
    end if
    if (method%acceleration%resting) return
    do s = 1, size(problem%sub)
      call extrapolate(method%acceleration%beta, problem%sub(s)%velocity, method%acceleration%part(s)%velocity)
    end do
  end subroutine begin_sweeps

  !> Sweep `k` of an iteration in subdomain `s` of this rank.
  subroutine sweep_once(method, problem, s, k, law_velocity)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s, k
    !> takes the velocity that solves the law at each contact (lanes, nc, blocks) [m/s]
    real(dp), intent(inout), contiguous, optional :: law_velocity(:, :, :)
    real(dp) :: sums(2), start

    start = clock()
    associate (sub => problem%sub(s), kernels => problem%kernels)
      if (method%acceleration%on .and. k == 1 .and. .not. method%acceleration%resting) then
        associate (previous => method%acceleration%part(s)%impulse, beta => method%acceleration%beta)
          if (present(law_velocity)) then
            call kernels%sweep_momentum_recording(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums, &
              & beta, previous, law_velocity)
          else
            call kernels%sweep_momentum(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums, beta, &
              & previous)
          end if
        end associate
      else if (present(law_velocity)) then
        call kernels%sweep_recording(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums, law_velocity)
      else
        call kernels%sweep(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums)
      end if
      method%work%relaxations = method%work%relaxations + sub%n_contacts
    end associate
    if (k == 1) problem%progress(:, s) = sums
    method%seconds(s) = method%seconds(s) + clock() - start
  end subroutine sweep_once

  !> Count the sweeps, and choose the extrapolation of the next iteration. Collective where they are accelerated.
  subroutine end_sweeps(method, problem)
    class(method_t), intent(inout) :: method
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: sums(2)
    integer :: restarted, plain

    method%work%sweeps = method%work%sweeps + method%sweeps
    method%work%iterations = method%work%iterations + 1
    call stop_timer(phase_sweep)
    if (.not. method%acceleration%on) return
    call problem%sum_progress(sums)
    restarted = method%acceleration%restarted
    plain = method%acceleration%plain
    call method%acceleration%steer(sums(1))
    method%work%restarted = method%work%restarted + method%acceleration%restarted - restarted
    if (method%acceleration%plain > plain) method%work%suspended = method%work%suspended + 1
  end subroutine end_sweeps

end module gravier_method
