!> Nesterov's extrapolation between the iterations of a method, which steers itself by what each iteration changes.
module gravier_acceleration
  use gravier_kinds, only: dp, i8
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_method_options, only: held_list_t
  implicit none
  private
  public :: acceleration_t, start_acceleration, change_relaxation_factors, extrapolate

  !> a change not measured yet; its multiples by growth_allowed are numbers still [N^2 s^2]
  real(dp), parameter :: unknown = 0.5_dp*huge(1.0_dp)
  !> growth of |r - y|^2 between iterations that shortens the memory
  real(dp), parameter :: growth_allowed = 1.02_dp
  !> least 1 - beta after an idle phase; its factor after a window that grew, and after one that shrank
  real(dp), parameter :: wary_margin = 0.3_dp, widen = 3.0_dp, narrow = 0.7_dp
  !> iterations without progress after which momentum begins anew; how often it does so before plain iterations come; ratio of
  !> window sums taken for progress
  integer, parameter :: idle_limit = 200, most_starts = 3
  real(dp), parameter :: progress_made = 0.8_dp
  !> How strongly acceleration answers to growth.
  type :: steering_t
    !> what is left of t after a growth
    real(dp) :: memory_kept
    !> 1 - beta at the start, and the least ever
    real(dp) :: first_margin, least_margin
    !> iterations of a window
    integer :: window
  end type steering_t

  !> Acceleration carries long waves across a scene as long as it keeps its memory. With friction, changes also grow by single per
  !> cent when contacts begin to slide, and such growth must cost little memory. In a problem of few contacts a wave crosses all
  !> of them within a window. Growth then means that the wave has passed the solution, and a shorter memory ends the solve sooner.
  type(steering_t), parameter :: of_many = steering_t(memory_kept=0.95_dp, first_margin=0.05_dp, least_margin=0.01_dp, window=20)
  type(steering_t), parameter :: of_few = steering_t(memory_kept=0.7_dp, first_margin=0.1_dp, least_margin=0.02_dp, window=10)
  integer, parameter :: few_contacts = 100
  !> relaxation factors of local solves in accelerated sweeps after the first window, of the normal, tangential and rolling
  !> part, of disks and of spheres
  real(dp), parameter :: relaxation_2d(3) = [1.0_dp, 0.7_dp, 1.0_dp], relaxation_3d(3) = [1.1_dp, 0.7_dp, 1.0_dp]

  !> What extrapolation keeps of the last iteration, for one subdomain.
  type :: acceleration_part_t
    !> impulses (lanes, nc, blocks) [N s]
    real(dp), allocatable :: impulse(:, :, :)
    !> velocities under them (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable :: velocity(:, :)
  end type acceleration_part_t

  !> Nesterov's extrapolation between iterations: iteration k starts from y = r_k + beta (r_k - r_k-1) with
  !> beta = min((t_k - 1)/t_k+1, 1 - margin), t_k+1 = (1 + sqrt(1 + 4 t_k^2))/2 (Nesterov 1983), and steers itself by the
  !> changes |r - y|^2 of the first sweeps, see doc/theory.md section 22: growth from one iteration to the next shortens the
  !> memory t; growth from one window of iterations to the next widens the margin, decay narrows it; after many windows
  !> without progress momentum begins anew, and after some such starts come as many plain iterations as the solve has had.
  type :: acceleration_t
    logical :: on = .false.
    !> the next iteration is a plain one: it extrapolates nothing and keeps nothing
    logical :: resting = .false.
    !> the local operators in place are those of whole local solves
    logical :: whole_in_place = .true.
    !> times that the memory was restarted in this solve
    integer :: restarted = 0
    real(dp) :: t = 1.0_dp, beta = 0.0_dp, margin = of_many%first_margin
    type(steering_t), private :: steering = of_many
    !> largest beta
    real(dp), private :: most = 1.0_dp
    !> |r - y|^2 of the last iteration, sums of it over this window and the last, and the lowest such sum [N^2 s^2]
    real(dp) :: change = unknown, window_change = 0.0_dp, last_window_change = unknown, lowest = unknown
    !> iterations of this solve, those of the windows since `lowest`, plain iterations to come
    integer :: iterations = 0, idle = 0, plain = 0
    !> times that momentum has begun anew since the start or the last plain iterations; iterations before the last start
    integer, private :: starts = 0, before = 0
    !> all iterations to come are plain ones
    logical, private :: has_ended = .false.
    type(acceleration_part_t), allocatable :: part(:)
  contains
    procedure :: choose_steering => acceleration_choose_steering
    procedure :: steer => acceleration_steer
    procedure :: whole => acceleration_whole
    procedure :: extrapolates => acceleration_extrapolates
    procedure :: end_for_good => acceleration_end_for_good
    procedure :: held => acceleration_held
  end type acceleration_t

contains

  !> The arrays that acceleration holds.
  pure subroutine acceleration_held(self, nc, nv, held)
    class(acceleration_t), intent(in) :: self
    !> components of a contact, of a body
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    if (.not. self%on) return
    call held%add("impulse before (acceleration)", .true., 8, nc)
    call held%add("velocity before (acceleration)", .false., 8, nv)
  end subroutine acceleration_held

  !> Begin a solve from the impulses and velocities that a problem holds. Collective.
  subroutine start_acceleration(acceleration, problem)
    type(acceleration_t), intent(inout) :: acceleration
    type(contact_problem_t), intent(in) :: problem
    integer :: s

    acceleration = acceleration_t(on=.true.)
    call acceleration%choose_steering(problem%n_contacts)
    if (problem%has_compliance()) acceleration%most = most_extrapolation(problem)
    allocate (acceleration%part(size(problem%sub)))
    do s = 1, size(problem%sub)
      call keep_start(problem%sub(s), acceleration%part(s))
    end do
  end subroutine start_acceleration

  !> Keep what a subdomain starts from, from which the first iteration has gone on.
  pure subroutine keep_start(sub, part)
    type(subproblem_t), intent(in) :: sub
    type(acceleration_part_t), intent(inout) :: part

    part%impulse = sub%impulse
    part%velocity = sub%velocity
  end subroutine keep_start

  !> The largest beta that pays where all contacts are compliant, (1 - sqrt(q))/(1 + sqrt(q)) with the least part q that the
  !> compliance has of a local operator (Nesterov 2004, section 2.2.1, for a problem with curvatures between q and 1): more would
  !> let friction keep waves alive that plain sweeps damp. 1 where some contact is rigid. Collective.
  real(dp) function most_extrapolation(problem) result(most)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: least, root
    integer :: s, c

    least = 1.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), row => problem%row)
        do c = 1, sub%n_contacts
          associate (contact => sub%hot(lane_of(c), :, block_of(c)))
            least = min(least, contact(row%compliance_n)*contact(row%per_wnn), contact(row%compliance_t)*contact(row%per_wtt))
          end associate
        end do
      end associate
    end do
    root = sqrt(max(0.0_dp, -problem%comm%highest(-least)))
    most = (1.0_dp - root)/(1.0_dp + root)
  end function most_extrapolation

  !> Choose how strongly growth is answered, by the number of contacts. Called before the first iteration.
  pure subroutine acceleration_choose_steering(self, n_contacts)
    class(acceleration_t), intent(inout) :: self
    !> of all subdomains
    integer(i8), intent(in) :: n_contacts

    self%steering = of_many
    if (n_contacts < few_contacts) self%steering = of_few
    self%margin = self%steering%first_margin
  end subroutine acceleration_choose_steering

  !> Choose beta of the next iteration by what this one has changed, or whether it is a plain one.
  pure subroutine acceleration_steer(self, change)
    class(acceleration_t), intent(inout) :: self
    !> |r - y|^2 of the first sweep, over all subdomains [N^2 s^2]
    real(dp), intent(in) :: change
    real(dp) :: t

    if (change > growth_allowed*self%change) then
      self%t = max(1.0_dp, self%steering%memory_kept*self%t)
      self%restarted = self%restarted + 1
    end if
    self%change = change
    self%window_change = self%window_change + change
    self%iterations = self%iterations + 1
    if (mod(self%iterations, self%steering%window) == 0) call close_window(self)
    self%resting = self%plain > 0
    self%beta = 0.0_dp
    if (self%resting) return
    t = self%t
    self%t = 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*t**2))
    self%beta = min((t - 1.0_dp)/self%t, 1.0_dp - self%margin, self%most)
  end subroutine acceleration_steer

  !> Whether the next iteration takes the whole of each local solve: those of the first window after a start, where small problems
  !> end exactly, and plain ones do.
  pure logical function acceleration_whole(self) result(whole)
    class(acceleration_t), intent(in) :: self
    whole = self%resting .or. self%iterations - self%before < self%steering%window
  end function acceleration_whole

  !> Whether momentum is in use in this solve, or comes back after plain iterations.
  pure logical function acceleration_extrapolates(self) result(extrapolates)
    class(acceleration_t), intent(in) :: self
    extrapolates = self%on .and. .not. self%has_ended
  end function acceleration_extrapolates

  !> Only plain iterations are left in this solve.
  pure subroutine acceleration_end_for_good(self)
    class(acceleration_t), intent(inout) :: self

    self%has_ended = .true.
    self%plain = huge(self%plain)
  end subroutine acceleration_end_for_good

  !> The end of a window of iterations: the margin, and whether acceleration still pays.
  pure subroutine close_window(acceleration)
    type(acceleration_t), intent(inout) :: acceleration

    if (acceleration%window_change > acceleration%last_window_change) then
      acceleration%margin = min(1.0_dp, widen*acceleration%margin)
    else
      acceleration%margin = max(acceleration%steering%least_margin, narrow*acceleration%margin)
    end if
    if (acceleration%plain > 0) then
      acceleration%plain = acceleration%plain - acceleration%steering%window
      if (acceleration%plain <= 0) then
        acceleration%t = 1.0_dp
        acceleration%margin = wary_margin
        acceleration%idle = 0
        acceleration%starts = 0
        acceleration%lowest = acceleration%window_change
      end if
    else if (acceleration%window_change < progress_made*acceleration%lowest) then
      acceleration%lowest = acceleration%window_change
      acceleration%idle = 0
    else
      acceleration%idle = acceleration%idle + acceleration%steering%window
      if (acceleration%idle >= idle_limit) then
        if (acceleration%starts < most_starts) then
          call begin_anew(acceleration)
          return
        end if
        acceleration%plain = acceleration%iterations
      end if
    end if
    acceleration%last_window_change = acceleration%window_change
    acceleration%window_change = 0.0_dp
  end subroutine close_window

  !> Momentum begins as in a solve that starts from the impulses of now. Where friction lets contacts change for ever, each start
  !> takes the impulses another way, and many of these ways pass a solution.
  pure subroutine begin_anew(acceleration)
    type(acceleration_t), intent(inout) :: acceleration

    acceleration%starts = acceleration%starts + 1
    acceleration%restarted = acceleration%restarted + 1
    acceleration%before = acceleration%iterations
    acceleration%t = 1.0_dp
    acceleration%margin = acceleration%steering%first_margin
    acceleration%idle = 0
    acceleration%change = unknown
    acceleration%window_change = 0.0_dp
    acceleration%last_window_change = unknown
    acceleration%lowest = unknown
  end subroutine begin_anew

  !> Set the local operators to the full step of a local solve, or to the relaxation factors with which acceleration gains most.
  subroutine change_relaxation_factors(acceleration, problem)
    type(acceleration_t), intent(inout) :: acceleration
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: factors(3)
    integer :: s

    if (acceleration%whole()) then
      factors(:) = 1.0_dp
    else if (problem%nd == 2) then
      factors(:) = relaxation_2d
    else
      factors(:) = relaxation_3d
    end if
    do s = 1, size(problem%sub)
      call problem%sub(s)%update_local_operator(problem%kernels, factors)
    end do
    acceleration%whole_in_place = acceleration%whole()
  end subroutine change_relaxation_factors

  !> v := v + beta (v - previous), previous := v.
  pure subroutine extrapolate(beta, velocity, previous)
    real(dp), intent(in) :: beta
    !> (nv, n_columns)
    real(dp), intent(inout), contiguous :: velocity(:, :), previous(:, :)
    call extrapolate_numbers(size(velocity), beta, velocity, previous)
  end subroutine extrapolate

  !> The same in one loop over all numbers, which the compiler makes vectors of.
  pure subroutine extrapolate_numbers(n, beta, velocity, previous)
    integer, intent(in) :: n
    real(dp), intent(in) :: beta
    real(dp), intent(inout) :: velocity(n), previous(n)
    real(dp) :: v
    integer :: k

    do k = 1, n
      v = velocity(k)
      velocity(k) = v + beta*(v - previous(k))
      previous(k) = v
    end do
  end subroutine extrapolate_numbers

end module gravier_acceleration
