!> How solves come down to their goal, the accuracy or the tolerance, in a record of fixed size, and between which numbers of
!> iterations ten times looser and tighter goals would have taken.
module gravier_convergence_history
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: convergence_history_t, effort_t, at_tolerance, tenfold, unknown_effort

  !> places of the levels: tolerance 10^(k/2), so that the last one is ten times the tolerance
  integer, parameter :: at_tolerance = 0, half_a_decade = 1, tenfold = 2
  !> what is not known
  real(dp), parameter :: unknown_effort = -1.0_dp
  !> iterations spent below ten times the tolerance, over all of them: less is too little to judge a decay by
  real(dp), parameter :: least_share = 0.3_dp
  !> solves without an iteration, over all, from which on a scene counts as one that rests
  real(dp), parameter :: many_idle = 0.2_dp
  !> ends of the intervals, from runs with all three goals (doc/accuracy.md): iterations of a looser goal, over those to the first
  !> figure that passed it, and of a tighter one over the last decade's and over a power law at least and at most
  real(dp), parameter :: least_looser = 0.5_dp, least_tighter = 0.8_dp, most_tighter = 2.0_dp

  !> One solve.
  type :: convergence_history_t
    !> iteration of the first figure at or below each level, -1 for none
    integer :: first(at_tolerance:tenfold) = -1
    !> the first iteration that may end a solve
    integer :: first_check = 1
  contains
    procedure :: note => descent_note
    procedure :: follow => descent_follow
  end type convergence_history_t

  !> Many solves with one tolerance.
  type :: effort_t
    !> solves, those of them without an iteration, iterations
    integer(i8) :: solves = 0, idle = 0, iterations = 0
    !> solves that did not get down to each level
    integer(i8) :: unreached(at_tolerance:tenfold) = 0
    !> iterations of the others down to it
    integer(i8) :: reached(at_tolerance:tenfold) = 0
    !> largest figure at the end of a solve
    real(dp) :: worst = 0.0_dp
    !> on this rank: in all, and before the first iterations [s]
    real(dp) :: seconds = 0.0_dp, start_seconds = 0.0_dp
  contains
    procedure :: add => effort_add
    procedure :: looser => effort_looser
    procedure :: looser_range => effort_looser_range
    procedure :: tighter_range => effort_tighter_range
    procedure :: sees_decay => effort_sees_decay
    procedure :: often_idle => effort_often_idle
    procedure :: seconds_of => effort_seconds_of
  end type effort_t

contains

  !> Note a figure of the iteration, measured or expected from what sweeps move impulses by.
  pure subroutine descent_note(self, iteration, figure, tolerance)
    class(convergence_history_t), intent(inout) :: self
    integer, intent(in) :: iteration
    real(dp), intent(in) :: figure, tolerance
    integer :: k

    do k = at_tolerance, tenfold
      if (self%first(k) < 0 .and. figure <= tolerance*10.0_dp**(0.5_dp*k)) self%first(k) = iteration
    end do
  end subroutine descent_note

  !> The record of a solve that went on from another one, as of both together.
  pure subroutine descent_follow(self, before, iterations)
    class(convergence_history_t), intent(inout) :: self
    type(convergence_history_t), intent(in) :: before
    !> of the other one
    integer, intent(in) :: iterations

    where (self%first >= 0) self%first = self%first + iterations
    where (before%first >= 0) self%first = before%first
    self%first_check = before%first_check
  end subroutine descent_follow

  !> Add a solve. One that took iterations to its tolerance would have taken those to its first check at a looser one: what a
  !> looser tolerance leaves adds up from step to step, until it is too much for that one too.
  pure subroutine effort_add(self, history, iterations, figure, seconds, start_seconds)
    class(effort_t), intent(inout) :: self
    type(convergence_history_t), intent(in) :: history
    integer, intent(in) :: iterations
    !> at its end
    real(dp), intent(in) :: figure
    !> in all, and before the first iteration [s]
    real(dp), intent(in) :: seconds, start_seconds
    integer :: k

    self%solves = self%solves + 1
    if (iterations == 0) self%idle = self%idle + 1
    self%iterations = self%iterations + iterations
    self%worst = max(self%worst, figure)
    self%seconds = self%seconds + seconds
    self%start_seconds = self%start_seconds + start_seconds
    do k = at_tolerance, tenfold
      if (history%first(k) < 0) then
        self%unreached(k) = self%unreached(k) + 1
      else if (iterations > 0) then
        self%reached(k) = self%reached(k) + max(history%first(k), min(history%first_check, iterations))
      end if
    end do
  end subroutine effort_add

  !> Iterations to ten times the tolerance; `unknown_effort` where a solve did not get down to that.
  pure real(dp) function effort_looser(self) result(iterations)
    class(effort_t), intent(in) :: self

    iterations = unknown_effort
    if (self%unreached(tenfold) == 0) iterations = real(self%reached(tenfold), dp)
  end function effort_looser

  !> Whether so many solves found nothing to do that a run at a tighter goal, whose solves start from better impulses, finds little
  !> to do either.
  pure logical function effort_often_idle(self) result(often)
    class(effort_t), intent(in) :: self

    often = real(self%idle, dp) >= many_idle*real(self%solves, dp)
  end function effort_often_idle

  !> Whether the last decade above the tolerance was seen: a fair fraction of the iterations lies in it.
  pure logical function effort_sees_decay(self) result(sees)
    class(effort_t), intent(in) :: self
    real(dp) :: all, decade

    all = real(self%reached(at_tolerance), dp)
    decade = real(self%reached(tenfold), dp)
    sees = self%unreached(at_tolerance) == 0 .and. decade > 0.0_dp .and. all - decade >= least_share*all
  end function effort_sees_decay

  !> Between how many iterations ten times the tolerance would have taken. At most those made: what a looser tolerance leaves adds
  !> up from step to step. At least half of those to the first figure that passed it; 0 where no decay is seen. Both are
  !> `unknown_effort` where a solve did not get down to that.
  pure subroutine effort_looser_range(self, least, most)
    class(effort_t), intent(in) :: self
    real(dp), intent(out) :: least, most

    least = self%looser()
    most = least
    if (least < 0.0_dp) return
    most = real(self%iterations, dp)
    least = merge(least_looser*least, 0.0_dp, self%sees_decay() .or. self%unreached(at_tolerance) > 0)
  end subroutine effort_looser_range

  !> Between how many iterations a tenth of the tolerance would have taken, if solves get there: at least most of what the last
  !> decade has taken once more, as where errors decay exponentially, and at most twice what a power law through the last decade,
  !> or its second half, asks for. Both are `unknown_effort` where a solve missed the tolerance, which would miss a tighter one
  !> too, and where no decay is seen.
  pure subroutine effort_tighter_range(self, least, most)
    class(effort_t), intent(in) :: self
    real(dp), intent(out) :: least, most
    real(dp) :: all, decade, half

    least = unknown_effort
    most = unknown_effort
    if (.not. self%sees_decay()) return
    all = real(self%reached(at_tolerance), dp)
    half = real(self%reached(half_a_decade), dp)
    decade = real(self%reached(tenfold), dp)
    least = all + least_tighter*(all - decade)
    most = most_tighter*all*max(all/decade, (all/half)**2)
  end subroutine effort_tighter_range

  !> Seconds that so many iterations would have taken on this rank; `unknown_effort` for unknown ones.
  pure real(dp) function effort_seconds_of(self, iterations) result(seconds)
    class(effort_t), intent(in) :: self
    real(dp), intent(in) :: iterations

    seconds = unknown_effort
    if (iterations < 0.0_dp) return
    seconds = self%start_seconds
    if (self%iterations > 0) seconds = seconds + (self%seconds - self%start_seconds)*(iterations/real(self%iterations, dp))
  end function effort_seconds_of

end module gravier_convergence_history
