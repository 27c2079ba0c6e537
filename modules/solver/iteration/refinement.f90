!> Solves that aim at less error than they have to, as long as that costs little. Errors within the goal may add up from step to
!> step where nothing moves (gravier_drift), and they may hide whether a bond at its limit opens. What a solve leaves of the smaller
!> goal, the next one starts from: that is no failure.
module gravier_refinement
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_narrow, only: narrow
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, return_to
  use gravier_method, only: method_t
  use gravier_backoff, only: backoff_t, backoff_words, backoff_record
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_watch_t, by_velocity, &
    & solve_converged, solve_diverged, solve_unbounded
  implicit none
  private
  public :: refinement_t, refinement_words, refinement_record

  !> iterations in which the smaller goal has to be reached, and times that they are doubled where they do not suffice, because
  !> loads take more from end to end of a high scene
  integer, parameter :: few_iterations = 200, most_doublings = 3
  !> part of the iterations of a solve that it may aim at less error in at most
  integer, parameter :: part_of_all = 4
  !> share of the goal above which a smaller one is not worth aiming at, and tolerance of the residual that none falls below
  real(dp), parameter :: worth_it = 0.5_dp, least_tolerance = 1.0e-12_dp

  !> share of the goal while bonds are in doubt, steps for which that lasts once they are not, and times that goal by which a bond
  !> may move in a solve that comes to it, because the goal is a mean
  real(dp), parameter :: share_for_bonds = 0.01_dp, of_single_bond = 10.0_dp
  integer, parameter :: steps_for_bonds = 20
  !> iterations that it may take at least, and times those of the solve to the goal of the user
  integer, parameter :: iterations_for_bonds = 2500, times_for_bonds = 4

  !> words of its state, and what they are, in their order: the version of checkpoints, which changes with them
  integer, parameter :: refinement_words = 5 + backoff_words
  character(len=*), parameter :: refinement_record = "turns doublings caution usual before "//backoff_record

  type :: refinement_t
    !> since this run began or went on from a checkpoint: solves that aimed at less error, those of them that came to it, and
    !> iterations of the others until they gave it up
    integer(i8) :: refined = 0, reached = 0, in_vain = 0
    !> solves that aimed at less error because bonds were in doubt; steps whose solves left them there, as they did not come to it
    integer(i8) :: for_bonds = 0, in_doubt = 0
    !> the smallest error aimed at, over that of the user
    real(dp) :: least_share = 1.0_dp
    !> whether the next solve aims at less error, by the last `decide`
    logical :: aims = .false.
    !> the error that it aims at, over that of the user
    real(dp), private :: share = 1.0_dp
    !> solves that might have aimed at less error, since the first step
    integer, private :: turns = 0
    !> how often the iterations that they may take were doubled
    integer, private :: doublings = 0
    !> the last solve came to the share of its goal
    logical :: is_fine = .false.
    !> impulses of an attempt in vain are those of its start
    logical, private :: goes_back = .false.
    !> further steps whose solves aim at less error for the bonds; iterations of the last solve to the goal of the user alone
    integer, private :: caution = 0, usual = 0
    !> velocity error of the last step, with which bonded bodies start the present one [m/s]
    real(dp), private :: before = 0.0_dp
    type(backoff_t), private :: backoff = backoff_t(forgiven=1)
  contains
    procedure :: doubt => refinement_doubt
    procedure :: settle => refinement_settle
    procedure :: note_bonds => refinement_note_bonds
    procedure :: take_care => refinement_take_care
    procedure :: decide => refinement_decide
    procedure :: solve => refinement_solve
    procedure :: get_state => refinement_get_state
    procedure :: set_state => refinement_set_state
  end type refinement_t

contains

  !> The velocity up to which the bodies of a bond at its limit may part by errors alone [m/s]. These are errors of the last solve,
  !> and of the step before: a more exact solve takes them back within one step.
  pure real(dp) function refinement_doubt(self, uncertain, goal) result(doubt)
    class(refinement_t), intent(in) :: self
    !> by the estimate of the solve; the error that the user allows [m/s]
    real(dp), intent(in) :: uncertain, goal

    doubt = uncertain
    if (self%is_fine) doubt = max(uncertain, of_single_bond*share_for_bonds*goal)
    doubt = max(doubt, self%before)
  end function refinement_doubt

  !> Go on with a solve that has reached its goal and leaves bonds at their limits, so that it tells which of them break. The report
  !> is that of both as of one. Collective.
  subroutine refinement_settle(self, problem, method, control, report, error, watch)
    class(refinement_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    !> with the goal of the user
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    class(solve_watch_t), intent(inout), optional :: watch
    type(solve_report_t) :: further

    if (self%aims .or. report%status /= solve_converged .or. .not. may_settle(method, control)) return
    self%turns = self%turns + 1
    if (.not. self%backoff%allows(self%turns)) return
    self%caution = steps_for_bonds
    self%usual = report%iterations
    self%share = share_for_bonds
    self%goes_back = .true.
    call attempt(self, problem, method, control, further, error, watch)
    if (allocated(error)) return
    if (further%status == solve_converged) then
      further%goal = control%accuracy
      further%violation_allowed = further%violation_allowed/self%share
      call further%follow(report)
      report = further
    else
      report%iterations = report%iterations + further%iterations
      report%seconds = report%seconds + further%seconds
    end if
    ! both are one solve
    method%work%solves = method%work%solves - 1
  end subroutine refinement_settle

  !> Whether solves can go on for bonds: iterations of methods of direct solves are too dear.
  pure logical function may_settle(method, control) result(may)
    class(method_t), intent(in) :: method
    type(solve_control_t), intent(in) :: control
    may = control%criterion == by_velocity .and. .not. method%keeps_best
  end function may_settle

  !> Solves aim at less error from now on, because some bond may be at its limit.
  pure subroutine refinement_take_care(self)
    class(refinement_t), intent(inout) :: self
    self%caution = steps_for_bonds
  end subroutine refinement_take_care

  !> After a step, whether some bond was at its limit and the solve did not tell whether it breaks. Ordinary solves have to do where
  !> bodies move by more than errors are compared with, as in impacts, and of methods whose iterations are too dear.
  pure subroutine refinement_note_bonds(self, doubtful, ordinary, velocity_error)
    class(refinement_t), intent(inout) :: self
    logical, intent(in) :: doubtful, ordinary
    !> of the step, at most its velocity scale [m/s]
    real(dp), intent(in) :: velocity_error

    if (doubtful .and. .not. (self%is_fine .or. ordinary)) self%in_doubt = self%in_doubt + 1
    self%caution = max(0, self%caution - 1)
    if (doubtful) call self%take_care()
    if (ordinary) self%caution = 0
    self%before = velocity_error
  end subroutine refinement_note_bonds

  !> Whether the next solve aims at a share of its goal: not where that is hardly smaller, or where too many solves before did not
  !> come to it.
  pure subroutine refinement_decide(self, problem, control, share)
    class(refinement_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(solve_control_t), intent(in) :: control
    !> that is asked for where no bond is in doubt
    real(dp), intent(in) :: share

    self%is_fine = .false.
    self%share = share
    if (self%caution > 0) self%share = min(share, share_for_bonds)
    self%aims = .not. (self%share > worth_it .or. control%criterion /= by_velocity .or. problem%n_contacts == 0)
    if (.not. self%aims) return
    self%turns = self%turns + 1
    self%aims = self%backoff%allows(self%turns)
  end subroutine refinement_decide

  !> Solve: first to the share of the goal, then, where that has failed, to the goal of the user, from where the first has ended.
  !> The report is that of both as of one. Collective.
  subroutine refinement_solve(self, problem, method, control, report, error, watch)
    class(refinement_t), intent(inout) :: self
    !> with its velocity scale
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    !> with the goal of the user
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    class(solve_watch_t), intent(inout), optional :: watch
    type(solve_report_t) :: first
    type(solve_control_t) :: further

    self%goes_back = .false.
    call attempt(self, problem, method, control, first, error, watch)
    if (allocated(error)) return
    if (first%status == solve_converged) then
      report = first
      report%goal = control%accuracy
      report%violation_allowed = first%violation_allowed/self%share
      return
    end if
    further = control
    further%max_iterations = control%max_iterations - first%iterations
    call solve_contacts(problem, method, further, report, error, watch=watch)
    if (allocated(error)) return
    call report%follow(first)
    ! both are one solve
    method%work%solves = method%work%solves - 1
  end subroutine refinement_solve

  !> Aim at a share of the goal. Impulses of a solve that found none are those of its start, and those of one in vain, if that is
  !> asked for. Collective.
  subroutine attempt(self, problem, method, control, report, error, watch)
    class(refinement_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    type(solve_control_t), intent(in) :: control
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    class(solve_watch_t), intent(inout), optional :: watch
    type(kept_impulses_t) :: kept(size(problem%sub))
    type(solve_control_t) :: further

    further = control
    further%accuracy = self%share*control%accuracy
    further%tolerance = max(self%share*control%tolerance, min(control%tolerance, least_tolerance))
    further%max_iterations = few_iterations*2**self%doublings
    if (self%caution > 0) further%max_iterations = max(further%max_iterations, iterations_for_bonds, times_for_bonds*self%usual)
    further%max_iterations = min(further%max_iterations, control%max_iterations/part_of_all)
    call copy_impulses(problem, kept)
    call solve_contacts(problem, method, further, report, error, watch=watch)
    if (allocated(error)) return
    self%refined = self%refined + 1
    if (self%caution > 0) self%for_bonds = self%for_bonds + 1
    self%least_share = min(self%least_share, self%share)
    if (report%status == solve_converged) then
      self%reached = self%reached + 1
      self%is_fine = .true.
      if (self%doublings > 0 .and. 4*report%iterations < further%max_iterations) self%doublings = self%doublings - 1
      call self%backoff%note(self%turns, tried=.true., kept=.true.)
    else
      self%in_vain = self%in_vain + report%iterations
      call self%backoff%note(self%turns, tried=self%doublings == most_doublings, kept=.false.)
      self%doublings = min(self%doublings + 1, most_doublings)
    end if
    if (report%status == solve_converged) return
    if (.not. self%goes_back .and. report%status /= solve_diverged .and. report%status /= solve_unbounded) return
    call return_to(problem, kept)
  end subroutine attempt

  pure subroutine refinement_get_state(self, words)
    class(refinement_t), intent(in) :: self
    integer(i8), intent(out) :: words(refinement_words)

    words(1) = self%turns
    words(2) = self%doublings
    words(3) = self%caution
    words(4) = self%usual
    words(5) = transfer(self%before, 0_i8)
    call self%backoff%get_state(words(6:))
  end subroutine refinement_get_state

  pure subroutine refinement_set_state(self, words)
    class(refinement_t), intent(inout) :: self
    integer(i8), intent(in) :: words(refinement_words)

    self%turns = narrow(words(1))
    self%doublings = narrow(words(2))
    self%caution = narrow(words(3))
    self%usual = narrow(words(4))
    self%before = transfer(words(5), 0.0_dp)
    call self%backoff%set_state(words(6:))
  end subroutine refinement_set_state

end module gravier_refinement
