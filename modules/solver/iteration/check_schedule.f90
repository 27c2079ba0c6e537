!> When the state of a solve is checked.
!>
!> A residual costs as much as two sweeps, the estimate of the velocity error as much again. What sweeps move impulses by goes with
!> them and comes for nothing. A check is therefore left out where that, times the ratio of the two at the last check, is far from
!> the goal; accelerated sweeps, whose sums are there after each iteration, are checked as soon as these indicate convergence. The
!> estimate follows these sums loosely and costs more: checks that ask for it keep longer pauses, and come after it is trusted,
!> unless the scene is nearly at rest. The ratio at the end of a solve holds for the first checks of the next one, because a step
!> changes little.
module gravier_check_schedule
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_convergence_history, only: convergence_history_t
  implicit none
  private
  public :: check_schedule_t, growth_limit

  !> growth of the defect, relative to that at the start or to the largest |R^d| of a body, taken for divergence
  real(dp), parameter :: growth_limit = 1.0e4_dp
  !> checks that may be left out one after the other, and times the goal: an expected figure that is worth a check
  integer, parameter :: most_skips = 9
  real(dp), parameter :: worth_a_check = 1.2_dp
  !> the first iteration that accelerated sweeps may have checked before it is due
  integer, parameter :: early_check = 2
  !> iterations between two checks, over those made: at least where they are not due, and at most
  real(dp), parameter :: least_pause = 0.06_dp, most_pause = 0.25_dp
  !> Checks that ask for the estimate: so many regular ones may be left out one after the other, and more where the figure that is
  !> expected is above so many times the goal.
  integer, parameter :: most_left_out = 1, most_left_out_far = 3
  real(dp), parameter :: far_from_goal = 1.5_dp
  !> what a check costs that asks for the estimate, in iterations
  real(dp), parameter :: estimate_cost = 3.0_dp
  !> times the goal: a figure of the start that may meet it in the first iterations
  real(dp), parameter :: near_the_goal = 3.0_dp
  !> what is left of the figure since the last check where the next one need not wait twice as long
  real(dp), parameter :: falling = 0.85_dp
  !> ratio of a figure to what the sweeps before it moved impulses by, until a check has measured it, for accelerated sweeps
  real(dp), parameter :: first_ratio = 0.5_dp

  !> what a ratio is that of: none is known; a check that found a bound, because the estimate was not asked for; a solve before this
  !> one; a check that found the estimate. A later one tells more.
  integer, parameter :: no_check = 0, bound = 1, solve_before = 2, estimate = 3

  type :: check_schedule_t
    !> iterations between two regular checks
    integer :: check_every = 10
    !> regular checks may be left out and others come before them: not for a trace or the error, which are of all regular ones alone
    logical :: chooses = .false.
    !> checks ask for the estimate of the velocity error, which is trusted from iteration `trusted` on; no pause between them is
    !> longer than a part of the iterations made
    logical :: by_estimate = .false.
    integer :: trusted = 0
    !> the first residual was within its tolerance: the estimate is asked for as soon as it is trusted, unless a ratio is known
    logical :: settled = .false.
    !> figure at the last check over what the sweeps before it moved impulses by, relative to them; before that what a solve before
    !> this one has ended with; 0 where it is not known
    real(dp), private :: ratio = 0.0_dp
    !> one of the constants above: what it is the ratio of
    integer, private :: ratio_of = no_check
    !> what the sweeps before the last check moved impulses by
    real(dp), private :: progress = 0.0_dp
    real(dp), private :: last_figure = huge(1.0_dp), pause = 0.0_dp
    integer, private :: skips = 0, last_check = 0
    !> the iteration from which on the estimate is believed, if the last check came before
    integer, private :: believed_from = 0
    !> the first iteration that a check of accelerated sweeps may follow before it is due
    integer, private :: earliest = early_check
  contains
    procedure :: first_check => check_schedule_first_check
    procedure :: calls => check_schedule_calls
    procedure :: take_ratio => check_schedule_take_ratio
    procedure :: note_check => check_schedule_note_check
    procedure :: forget_ratio => check_schedule_forget_ratio
    procedure :: mean_ratio => check_schedule_mean_ratio
  end type check_schedule_t

contains

  !> The first iteration that may be followed by a check.
  pure integer function check_schedule_first_check(self, method) result(first)
    class(check_schedule_t), intent(in) :: self
    class(method_t), intent(in) :: method

    first = self%check_every
    if (self%chooses .and. method%acceleration%on) first = min(early_check, self%check_every)
  end function check_schedule_first_check

  !> Whether a check comes after an iteration that is about to be made. Collective.
  logical function check_schedule_calls(self, problem, method, iteration, goal, reference, history) result(calls)
    class(check_schedule_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    !> what the figure is compared with, and what a growing defect is
    real(dp), intent(in) :: goal, reference
    !> takes the figures that are expected
    type(convergence_history_t), intent(inout) :: history

    calls = mod(iteration, self%check_every) == 0
    ! sums of the iterations before are there where sweeps are accelerated
    if (self%chooses .and. (calls .or. (method%acceleration%on .and. iteration >= self%earliest))) &
      & calls = is_worth_a_check(self, problem, method, iteration, goal, reference, history)
    if (self%settled .and. iteration == self%trusted) calls = calls .or. .not. self%ratio > 0.0_dp
    calls = calls .or. iteration == self%believed_from
  end function check_schedule_calls

  !> Whether the sweeps of the iteration before speak for a check. Collective.
  logical function is_worth_a_check(self, problem, method, iteration, goal, reference, history) result(is_worth)
    class(check_schedule_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    real(dp), intent(in) :: goal, reference
    type(convergence_history_t), intent(inout) :: history
    real(dp) :: sums(2), expected, enough
    !> check_every asks for one; so many were left out that one is due
    logical :: regular, due

    call problem%sum_progress(sums)
    self%progress = 0.0_dp
    regular = mod(iteration, self%check_every) == 0
    is_worth = regular
    expected = 0.0_dp
    due = self%skips >= most_skips
    if (all(ieee_is_finite(sums))) then
      if (sums(2) > 0.0_dp) self%progress = sqrt(sums(1)/sums(2))
      expected = self%ratio*self%progress
      enough = worth_a_check
      if (method%acceleration%on) then
        if (.not. self%ratio > 0.0_dp) expected = first_ratio*self%progress
        enough = 1.0_dp
      end if
      if (self%by_estimate) due = due .or. is_long_ago(self, iteration, expected > far_from_goal*goal)
      if (expected > 0.0_dp) is_worth = (expected <= enough*goal .and. has_paused(self, iteration, regular)) .or. &
        & (regular .and. (.not. self%ratio > 0.0_dp .or. due .or. sqrt(sums(1)) > watched_growth(method)*reference))
    end if
    if (is_worth) then
      self%skips = 0
    else
      if (regular) self%skips = self%skips + 1
      ! without a figure that is expected, the goal is not known to be reached
      if (expected > 0.0_dp .and. (regular .or. self%ratio > 0.0_dp)) call history%note(iteration, expected, goal)
    end if
  end function is_worth_a_check

  !> Whether the last check lies far enough back. Where the estimate is asked for, a solve that ends in the next T iterations, with
  !> a check after each p of them, takes T/p checks and makes p/2 iterations in vain. The sum is least with p^2 = 2 T estimate_cost.
  !> T is taken as a quarter of the iterations made.
  pure logical function has_paused(self, iteration, regular)
    class(check_schedule_t), intent(in) :: self
    integer, intent(in) :: iteration
    logical, intent(in) :: regular

    associate (pause => iteration - self%last_check)
      has_paused = pause > max(self%pause, least_pause*iteration)
      if (self%by_estimate) then
        has_paused = has_paused .and. pause >= sqrt(0.5_dp*iteration*estimate_cost)
      else
        has_paused = has_paused .or. regular
      end if
    end associate
  end function has_paused

  !> Whether the last check lies so far back that the next regular one is made whatever figure is expected, because the ratio may
  !> have changed: the estimate is asked for.
  pure logical function is_long_ago(self, iteration, is_far)
    class(check_schedule_t), intent(in) :: self
    integer, intent(in) :: iteration
    !> the figure that is expected is far from the goal
    logical, intent(in) :: is_far
    integer :: left_out

    left_out = 0
    if (self%ratio_of >= solve_before) left_out = most_left_out
    if (self%ratio_of == estimate .and. is_far) left_out = most_left_out_far
    is_long_ago = iteration - self%last_check >= most_pause*iteration
    if (left_out > 0) is_long_ago = is_long_ago .and. iteration - self%last_check >= (1 + left_out)*self%check_every
  end function is_long_ago

  !> Growth of the changes that is worth a check: methods that lower what makes them grow are left to do so.
  pure real(dp) function watched_growth(method) result(growth)
    class(method_t), intent(in) :: method
    growth = merge(growth_limit, 1.0_dp, method%mends_growth())
  end function watched_growth

  !> Take the ratio of a solve before this one; none where that is 0.
  pure subroutine check_schedule_take_ratio(self, ratio)
    class(check_schedule_t), intent(inout) :: self
    real(dp), intent(in) :: ratio

    self%ratio = ratio
    self%ratio_of = merge(solve_before, no_check, ratio > 0.0_dp)
  end subroutine check_schedule_take_ratio

  !> A check was made after an iteration, and found this figure.
  pure subroutine check_schedule_note_check(self, iteration, figure, goal, is_known, believed_from)
    class(check_schedule_t), intent(inout) :: self
    integer, intent(in) :: iteration
    real(dp), intent(in) :: figure, goal
    !> false where the figure is a bound, because the estimate was not asked for
    logical, intent(in) :: is_known
    !> iteration from which on the estimate is believed, which a check follows; 0 where it is now
    integer, intent(in) :: believed_from

    self%believed_from = believed_from
    if (iteration == 0) then
      ! before the estimate is trusted only what is nearly at rest may meet the goal
      if (self%by_estimate .and. .not. figure <= near_the_goal*goal) self%earliest = max(early_check, self%trusted)
    else if (believed_from == 0) then
      ! the ratio of a bound tells less than that of a solve before
      if (self%progress > 0.0_dp .and. (is_known .or. self%ratio_of < solve_before)) then
        self%ratio = figure/self%progress
        self%ratio_of = merge(estimate, bound, is_known)
      end if
      self%pause = merge(0.0_dp, min(2.0_dp*max(self%pause, 1.0_dp), most_pause*iteration), figure < falling*self%last_figure)
    end if
    self%last_figure = figure
    self%last_check = iteration
  end subroutine check_schedule_note_check

  !> Changes to come are other changes than those before.
  pure subroutine check_schedule_forget_ratio(self)
    class(check_schedule_t), intent(inout) :: self
    self%ratio = 0.0_dp
    self%ratio_of = no_check
  end subroutine check_schedule_forget_ratio

  !> The ratio at the end of a solve, as the geometric mean with that before it where there is one.
  pure real(dp) function check_schedule_mean_ratio(self, before) result(ratio)
    class(check_schedule_t), intent(in) :: self
    !> 0 for none
    real(dp), intent(in) :: before

    ratio = self%ratio
    if (before > 0.0_dp) ratio = sqrt(before*self%ratio)
  end function check_schedule_mean_ratio

end module gravier_check_schedule
