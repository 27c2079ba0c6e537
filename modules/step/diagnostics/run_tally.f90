!> What the closing lines of a run need of its steps, in a record of fixed size: how solves ended, how far their velocities were
!> from the solution, how much of the geometry was mended. All counts and sums are since this run began or went on
!> from a checkpoint.
module gravier_run_tally
  use gravier_kinds, only: dp, i8
  use gravier_creeping_groups, only: creep_t
  use gravier_interface, only: interface_statistics_t
  use gravier_solve_report, only: solve_report_t, solve_converged, solve_exhausted, solve_diverged, solve_stagnated, &
    & solve_unbounded
  implicit none
  private
  public :: run_tally_t, relative_error, far_off, often_mended

  !> velocity error over its scale beyond which the accuracy of a step counts as unknown
  real(dp), parameter :: far_off = 0.5_dp
  !> share of the steps with projected overlaps beyond which results are not those of the contact law
  real(dp), parameter :: often_mended = 0.1_dp
  !> times the overlap of the first step, or the overlap that is allowed, from which on overlaps have grown
  real(dp), parameter :: grown = 2.0_dp
  !> kinds of velocity scales that are told apart
  integer, parameter :: most_kinds = 8

  type :: run_tally_t
    !> solves, and how those that missed the criterion ended
    integer(i8) :: solves = 0, stagnated = 0, unbounded = 0, exhausted = 0, diverged = 0
    !> first and last step whose solve missed it; 0: none
    integer :: first_missed = 0, last_missed = 0
    !> solves that reached another criterion than the velocity error: those that missed the accuracy, those that ended too soon to
    !> tell
    integer(i8) :: inaccurate = 0, unjudged = 0
    !> steps made, and those in which projections of overlaps shifted grains by more than rounding
    integer(i8) :: steps = 0, projected = 0
    !> means over the free grains of the lengths by which projections shifted them, and of their paths by their velocities [m]
    real(dp) :: shift = 0.0_dp, path = 0.0_dp
    !> largest overlap of the first step, which is that of the start, and of all later steps [m]
    real(dp) :: start_overlap = 0.0_dp, later_overlap = 0.0_dp
    !> of compliant contacts: largest deformation [m], largest product of the step and the frequency of a normal spring
    real(dp) :: deformation = 0.0_dp, stiffest = 0.0_dp
    !> largest residual at the end of a solve; largest velocity error over its scale, and solves where it is above far_off
    real(dp) :: worst_residual = 0.0_dp, worst_error = 0.0_dp
    integer(i8) :: far_off = 0
    !> smallest and largest velocity scale [m/s]; kinds in the order in which they came, and solves of each
    real(dp) :: least_scale = huge(1.0_dp), most_scale = 0.0_dp
    integer :: n_kinds = 0
    character(len=20) :: kind(most_kinds) = ""
    integer(i8) :: of_kind(most_kinds) = 0
    !> solves that tried a pass over layers, those of them that went on from it, and sweeps that the passes took
    integer(i8) :: tried_layers = 0, took_layers = 0
    real(dp) :: layered_sweeps = 0.0_dp
    !> of the last solve [m/s]
    real(dp) :: velocity_error = 0.0_dp, velocity_scale = 0.0_dp
    !> steps in which cores of bodies with shapes overlapped, and the most pairs of pieces in one
    integer(i8) :: steps_with_cores = 0, most_cores = 0
    !> steps in which bodies touched in more points than are kept, and the most points left out in one
    integer(i8) :: steps_left_out = 0, most_left_out = 0
    !> steps in which intact bonds were stretched, and the most of them in one
    integer(i8) :: steps_stretched = 0, most_stretched = 0
    !> steps in which contacts were pressed so deep that bodies may come out on the other side of each other
    integer(i8) :: pressed_deep = 0
    !> contacts that were left out because they sleep, and solves that were made anew because bodies woke
    integer(i8) :: slept = 0, woken = 0
    !> of the solve that stagnated with most contacts that creep, and the largest change over the velocity scale of all such solves
    type(creep_t) :: creep
    real(dp) :: worst_creep = 0.0_dp
  contains
    procedure :: add_solve => run_tally_add_solve
    procedure :: add_step => run_tally_add_step
    procedure :: missed => run_tally_missed
    procedure :: mended_share => run_tally_mended_share
    procedure :: overlaps_grew => run_tally_overlaps_grew
  end type run_tally_t

contains

  !> The estimated velocity error over its scale; 0 where nothing is to be expected to move.
  pure real(dp) function relative_error(solve)
    type(solve_report_t), intent(in) :: solve
    relative_error = 0.0_dp
    if (solve%velocity_scale > 0.0_dp) relative_error = solve%velocity_error/solve%velocity_scale
  end function relative_error

  !> Add the solve of a step.
  pure subroutine run_tally_add_solve(self, solve, kind, step)
    class(run_tally_t), intent(inout) :: self
    type(solve_report_t), intent(in) :: solve
    !> of its velocity scale
    character(len=*), intent(in) :: kind
    !> its number, from 1
    integer, intent(in) :: step

    self%solves = self%solves + 1
    if (solve%status /= solve_converged) then
      if (self%first_missed == 0) self%first_missed = step
      self%last_missed = step
    end if
    select case (solve%status)
    case (solve_converged)
      if (.not. solve%judged) then
        self%unjudged = self%unjudged + 1
      else if (.not. solve%accurate) then
        self%inaccurate = self%inaccurate + 1
      end if
    case (solve_stagnated)
      self%stagnated = self%stagnated + 1
      if (solve%creep%contacts > self%creep%contacts) self%creep = solve%creep
      if (solve%velocity_scale > 0.0_dp) self%worst_creep = max(self%worst_creep, solve%creep%change/solve%velocity_scale)
    case (solve_unbounded)
      self%unbounded = self%unbounded + 1
    case (solve_exhausted)
      self%exhausted = self%exhausted + 1
    case (solve_diverged)
      self%diverged = self%diverged + 1
    end select
    call add_kind(self, solve%velocity_scale, kind)
    if (solve%layered_sweeps > 0.0_dp) self%tried_layers = self%tried_layers + 1
    if (solve%layered) self%took_layers = self%took_layers + 1
    self%layered_sweeps = self%layered_sweeps + solve%layered_sweeps
    ! figures of a solve that diverged are no numbers
    if (solve%status == solve_diverged) return
    self%velocity_error = solve%velocity_error
    self%velocity_scale = solve%velocity_scale
    self%worst_residual = max(self%worst_residual, solve%residual)
    self%worst_error = max(self%worst_error, relative_error(solve))
    if (relative_error(solve) > far_off) self%far_off = self%far_off + 1
  end subroutine run_tally_add_solve

  pure subroutine add_kind(self, scale, kind)
    class(run_tally_t), intent(inout) :: self
    real(dp), intent(in) :: scale
    character(len=*), intent(in) :: kind
    integer :: k

    self%least_scale = min(self%least_scale, scale)
    self%most_scale = max(self%most_scale, scale)
    do k = 1, self%n_kinds
      if (self%kind(k) == kind) exit
    end do
    if (k > most_kinds) return
    self%n_kinds = max(self%n_kinds, k)
    self%kind(k) = kind
    self%of_kind(k) = self%of_kind(k) + 1
  end subroutine add_kind

  !> Add what moved in a step.
  pure subroutine run_tally_add_step(self, overlap, statistics, mended, shift, path, n_deep)
    class(run_tally_t), intent(inout) :: self
    !> largest one at the middle of the step [m]
    real(dp), intent(in) :: overlap
    !> with the pairs of pieces whose cores overlap, the points left out, and the bonds that are stretched
    type(interface_statistics_t), intent(in) :: statistics
    !> a projection has shifted grains by more than rounding
    logical, intent(in) :: mended
    !> means over the free grains [m]
    real(dp), intent(in) :: shift, path
    !> contacts that are pressed deep
    integer(i8), intent(in) :: n_deep

    self%steps = self%steps + 1
    if (self%steps == 1) then
      self%start_overlap = overlap
    else
      self%later_overlap = max(self%later_overlap, overlap)
    end if
    if (mended) self%projected = self%projected + 1
    if (n_deep > 0) self%pressed_deep = self%pressed_deep + 1
    if (statistics%overlapping_cores > 0) self%steps_with_cores = self%steps_with_cores + 1
    self%most_cores = max(self%most_cores, statistics%overlapping_cores)
    if (statistics%points_left_out > 0) self%steps_left_out = self%steps_left_out + 1
    self%most_left_out = max(self%most_left_out, statistics%points_left_out)
    if (statistics%stretched_bonds > 0) self%steps_stretched = self%steps_stretched + 1
    self%most_stretched = max(self%most_stretched, statistics%stretched_bonds)
    self%shift = self%shift + shift
    self%path = self%path + path
  end subroutine run_tally_add_step

  !> Solves that missed their criterion.
  pure integer(i8) function run_tally_missed(self) result(missed)
    class(run_tally_t), intent(in) :: self
    missed = self%stagnated + self%unbounded + self%exhausted + self%diverged
  end function run_tally_missed

  !> Share of the steps in which overlaps were projected.
  pure real(dp) function run_tally_mended_share(self) result(share)
    class(run_tally_t), intent(in) :: self
    share = real(self%projected, dp)/real(max(self%steps, 1_i8), dp)
  end function run_tally_mended_share

  !> Whether overlaps have grown: beyond those of the start and beyond what is allowed.
  pure logical function run_tally_overlaps_grew(self, allowed) result(grew)
    class(run_tally_t), intent(in) :: self
    !> [m]
    real(dp), intent(in) :: allowed
    grew = self%later_overlap > grown*max(self%start_overlap, allowed)
  end function run_tally_overlaps_grew

end module gravier_run_tally
