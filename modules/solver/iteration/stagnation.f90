!> Whether a solve gains anything yet.
!>
!> A solve has stagnated if neither its figure nor its estimated velocity error has fallen by a tenth for so many iterations,
!> accelerated or plain, and for as many as it has had until then, and if it has had enough iterations for a wave to run from end to
!> end and back. The figure may rise while the error falls, because near rest the criterion allows less. Either the method finds no
!> solution, or there is none: then the impulses grow in vain (gravier_vain_impulses).
module gravier_stagnation
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses
  use gravier_vain_impulses, only: are_in_vain
  use gravier_creeping_groups, only: creep_t, find_creep
  implicit none
  private
  public :: stagnation_t

  !> what is left of the figure where a solve has gained something
  real(dp), parameter :: gained = 0.9_dp
  !> iterations without gain, accelerated and plain; before the end of which impulses are kept, to see whether they grow in vain
  integer, parameter :: patience = 1000, plain_patience = 2000, watch = 500
  !> times the plain patience where a residual that is small already is what is missing: it falls in accelerated and plain phases,
  !> which grow
  integer, parameter :: residual_patience = 4
  real(dp), parameter :: small_residual = 1.0e-3_dp
  !> times the depth: iterations that every solve has; times those that plain sweeps have: the square of the depth up to which these
  !> are tried, since a load spreads by plain sweeps as heat does
  integer, parameter :: waves = 6

  type :: stagnation_t
    !> iterations without gain of a method that does not carry loads by waves, as direct solves; 0 of sweeps
    integer :: patience = 0
    !> lowest figure and lowest velocity error so far; iteration from which on the solve is looked at
    real(dp), private :: best(2) = huge(1.0_dp)
    integer, private :: next_look = 0
    !> the method makes its last attempt, after it has stagnated: what it gains gives it no more time
    logical :: is_last = .false.
    !> impulses after the iteration `kept_at`, of the subdomains of this rank; 0 where there are none
    integer, private :: kept_at = 0
    type(kept_impulses_t), allocatable, private :: kept(:)
  contains
    procedure :: note => stagnation_note
    procedure :: judge => stagnation_judge
    procedure :: describe => stagnation_describe
    procedure :: go_on => stagnation_go_on
    procedure :: may_begin_last => stagnation_may_begin_last
    procedure :: begin_last => stagnation_begin_last
  end type stagnation_t

contains

  !> A check after an iteration found these figures: whether nothing was gained for too long.
  subroutine stagnation_note(self, problem, iteration, figures, accelerated, missing_residual, due)
    class(stagnation_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: iteration
    !> what is compared with the goal of the solve, and the estimated velocity error
    real(dp), intent(in) :: figures(2)
    logical, intent(in) :: accelerated
    !> the residual where it is above its tolerance, else 0
    real(dp), intent(in) :: missing_residual
    logical, intent(out) :: due
    integer :: watched

    due = .false.
    if (any(figures < gained*self%best)) then
      where (figures < gained*self%best) self%best = figures
      if (self%patience > 0) then
        self%next_look = 2*iteration + self%patience
        self%kept_at = 0
        return
      end if
      if (.not. self%is_last) then
        self%next_look = 2*iteration + merge(patience, plain_patience, accelerated)
        if (missing_residual > 0.0_dp .and. missing_residual < small_residual) &
          & self%next_look = iteration + residual_patience*(plain_patience + iteration)
        self%kept_at = 0
        return
      end if
    end if
    watched = watch
    if (self%patience > 0) watched = self%patience/2
    if (self%kept_at == 0 .and. iteration >= self%next_look - watched) call keep_impulses(self, problem, iteration)
    due = iteration >= self%next_look .and. self%kept_at > 0 .and. iteration - self%kept_at >= watched
  end subroutine stagnation_note

  subroutine keep_impulses(self, problem, iteration)
    type(stagnation_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: iteration

    if (.not. allocated(self%kept)) allocate (self%kept(size(problem%sub)))
    call copy_impulses(problem, self%kept)
    self%kept_at = iteration
  end subroutine keep_impulses

  !> Where stagnation is due, look whether the solve has really stagnated, because no solution is to be found or because the method
  !> finds none. Collective.
  subroutine stagnation_judge(self, problem, iteration, depth, stagnates, in_vain)
    class(stagnation_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: iteration
    !> of the problem, in contacts
    integer, intent(in) :: depth
    logical, intent(out) :: stagnates, in_vain

    in_vain = .false.
    stagnates = self%patience > 0 .or. iteration >= waves*depth
    if (stagnates) in_vain = are_in_vain(problem, self%kept)
  end subroutine stagnation_judge

  !> What still changes in a solve that has stagnated. Collective.
  subroutine stagnation_describe(self, problem, creep)
    class(stagnation_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(creep_t), intent(out) :: creep

    call find_creep(problem, self%kept, creep)
  end subroutine stagnation_describe

  !> Look at a solve again later that goes on although it has stagnated.
  subroutine stagnation_go_on(self, problem, iteration)
    class(stagnation_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: iteration

    self%next_look = iteration + patience
    call keep_impulses(self, problem, iteration)
  end subroutine stagnation_go_on

  !> Whether plain iterations, which were not tried before, may bring what accelerated ones do not, in the number that they would
  !> have.
  pure logical function stagnation_may_begin_last(self, iteration, depth) result(may_begin)
    class(stagnation_t), intent(in) :: self
    integer, intent(in) :: iteration
    !> of the problem, in contacts
    integer, intent(in) :: depth
    may_begin = self%patience == 0 .and. .not. self%is_last .and. real(depth, dp)**2 <= waves*real(plain_patience + iteration, dp)
  end function stagnation_may_begin_last

  !> The method goes on in another way, by plain iterations, which have as many as the solve has had, and some more. They are slow
  !> but gain something for ever, so that what they gain is no reason to wait for longer.
  subroutine stagnation_begin_last(self, iteration)
    class(stagnation_t), intent(inout) :: self
    integer, intent(in) :: iteration

    self%is_last = .true.
    self%next_look = 2*iteration + plain_patience
    self%kept_at = 0
  end subroutine stagnation_begin_last

end module gravier_stagnation
