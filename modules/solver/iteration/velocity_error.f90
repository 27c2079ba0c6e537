!> The velocity error of a solve, estimated without knowing the solution: |V - V*|_M over the root of the mass of the grains in
!> contact, a root mean square velocity. The natural-map residual does not see waves that are long against a grain; this does.
!>
!>   Y  projection of the error on what test impulses move (gravier_test_impulses); C where that is smaller, because no projection
!>      of the error is larger than the error.
!>   L  sum over levels: how fast all that lies above a depth sinks onto it (gravier_levels).
!>   E  = sqrt((a Y)^2 + (b L)^2), a = 3.2, because test impulses see but a part of long waves, and b = 0.6, because they see a part
!>      of what sinks, too. Both are measured.
!>   C  bound where everything prescribed is at rest and no contact sends velocities back: rest is admissible then, and
!>      C^2 = |V|_M^2 + 2 sum r_n s bounds the error of a convex problem. It costs nothing, and is the error where the solution is
!>      at rest. The estimate is the smaller of E and C, and C where that is below a tenth of the error allowed.
!> All are divided by the root of the mass. E is a mean by mass, which light bodies hide in. No contact may therefore violate its
!> law by much, and no body sink by much onto what is below it. Where nearly all bodies are at rest and some are faster, these may
!> roll or be in error: E has to be at most a third of what moves there. Where bodies move, 3.2 Y of each island of bodies that
!> impulses join (gravier_islands), by its own mass, has to be within the error allowed, too. See doc/theory.md, section 24.
module gravier_velocity_error
  use gravier_kinds, only: dp
  use gravier_body_mass, only: inverse_of_translation, are_uneven
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_levels, only: levels_t
  use gravier_test_impulses, only: test_impulses_t, projection_t
  implicit none
  private
  public :: velocity_error_t, copies_ready, violations_allowed

  !> weights of Y and of L in the estimate
  real(dp), parameter :: weight_of_projection = 3.2_dp, weight_of_levels = 0.6_dp
  !> fraction of the error allowed that bodies may move with where all could rest; factor of L in what is allowed
  real(dp), parameter :: share_at_rest = 0.1_dp, weight_of_sinking = 4.0_dp
  !> times the error allowed by which a contact may violate its law: the error is a mean by mass, which light bodies hide in
  real(dp), parameter :: violations_allowed = 5.0_dp
  !> times the error allowed by which a body may sink, and by which bodies may on average, each counting the same
  real(dp), parameter :: body_allowed = 5.0_dp, bodies_allowed = 1.0_dp
  !> times the error allowed by which what lies above a level may sink where what moves is at most so many times the error allowed
  real(dp), parameter :: sinking_allowed = 0.25_dp, nearly_at_rest = 3.0_dp
  !> times the error allowed above which a body counts as moving among bodies that are nearly at rest; least share of the error
  !> allowed that is asked for then
  real(dp), parameter :: speed_at_rest = 0.2_dp, least_share = 0.2_dp
  !> fraction of the velocity scale that the bodies of a scene nearly at rest have at most, however large the error allowed is
  real(dp), parameter :: slow = 0.3_dp
  !> rounding of velocities, over the largest free speed and the root of the number of contacts
  real(dp), parameter :: rounding = 1.0e-13_dp
  !> what is not known; its multiples and those of a weight are numbers still [m/s]
  real(dp), parameter :: unknown = 1.0e-3_dp*sqrt(huge(1.0_dp))
  !> iterations before which Y and L are not trusted
  integer, parameter :: copies_ready = 4

  type :: velocity_error_t
    !> mass of the grains in contact, or of all that can move where there are none [kg]
    real(dp) :: mass = 0.0_dp
    !> error allowed, and the C up to which what moves is asked for [m/s]
    real(dp), private :: allowed = 0.0_dp, most_at_rest = 0.0_dp
    !> whether Y and the largest violation are known
    logical :: is_assessed = .false.
    !> the residual is rounding, and so are the errors of all bodies, by the last `look_at_bodies`
    logical :: is_exact = .false.
    !> C and Y, as far as they are known, by the last `bound` or `assess` [m/s]
    real(dp) :: bound_by_rest = unknown, projection = unknown
    !> L and how fast bodies sink, by the last `add_levels`; 0 since `bound`
    type(levels_t) :: levels
    !> largest |w| of a contact, by the last `assess`; 0 since `bound` [m/s]
    real(dp) :: largest_violation = 0.0_dp
    !> whether few heavy bodies have most of the mass
    logical, private :: is_uneven = .false.
    !> whether L is known, and how fast bodies sink
    logical, private :: has_levels = .false., has_followed = .false.
    !> whether a body moves where nearly all are at rest, and the error is not known to be small against that
    logical, private :: is_restless = .false.
    !> whether E may be too small: nearly all bodies are at rest, contacts attract or impulses came from a pass over layers, and
    !> waves cannot have crossed all bodies yet; the same of what a boundary moves through bonds. Iterations made at the last
    !> `assess`, and before the last `begin_anew`.
    logical, private :: is_early = .false.
    !> largest Y of an island, or C of it where that is smaller; 0 as long as it is not asked for [m/s]
    real(dp), private :: projection_of_islands = 0.0_dp
    !> the iteration from which on E is believed of what a boundary moves through bonds, 0 where it is now
    integer :: believed_from = 0
    integer, private :: iterations = 0, begun_at = 0
    !> what finds Y
    type(test_impulses_t) :: tests
  contains
    procedure :: start => velocity_error_start
    procedure :: bound => velocity_error_bound
    procedure :: assess => velocity_error_assess
    procedure :: rests => velocity_error_rests
    procedure :: complete => velocity_error_complete
    procedure :: look_at_bodies => velocity_error_look_at_bodies
    procedure :: add_levels => velocity_error_add_levels
    procedure :: estimate => velocity_error_estimate
    procedure :: criterion => velocity_error_criterion
    procedure :: measure_of_start => velocity_error_measure_of_start
    procedure, private :: share_of_motion => velocity_error_share_of_motion
    procedure, private :: wave => velocity_error_wave
    procedure :: all_are_slow => velocity_error_all_are_slow
    procedure :: begin_anew => velocity_error_begin_anew
  end type velocity_error_t

contains

  !> Make ready for a solve. Collective.
  subroutine velocity_error_start(self, problem, allowed)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> error [m/s]
    real(dp), intent(in) :: allowed
    !> mass of the grains, of all bodies that can move; squares of the grains' masses, number of grains
    real(dp) :: parts(4, size(problem%sub)), sums(4), heavy
    logical :: moves
    integer :: s, b, d

    self%allowed = allowed
    self%begun_at = 0
    self%most_at_rest = min(nearly_at_rest*allowed, slow*problem%error_scale)
    call self%tests%start(problem)
    call self%levels%start(problem)
    parts(:, :) = 0.0_dp
    moves = .false.
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), nd => problem%nd)
        do b = 1, sub%n_bodies
          heavy = inverse_of_translation(sub%inverse_mass(:, b), nd)
          if (.not. heavy > 0.0_dp) cycle
          heavy = 1.0_dp/heavy
          parts(2, s) = parts(2, s) + heavy/sub%multiplicity(b)
          if (b > sub%n_grains) cycle
          parts(1, s) = parts(1, s) + heavy/sub%multiplicity(b)
          parts(3, s) = parts(3, s) + heavy**2/sub%multiplicity(b)
          parts(4, s) = parts(4, s) + 1.0_dp/sub%multiplicity(b)
        end do
        do b = sub%n_grains + 1, sub%n_columns
          ! boundaries that forces move along some axes move as prescribed along the others
          do d = 1, problem%nv
            moves = moves .or. (abs(sub%v_free(d, b)) > 0.0_dp .and. .not. sub%moves(d, b))
          end do
        end do
        if (sub%n_contacts > 0) moves = moves .or. any(sub%hot(:, nd + 1, :) < 0.0_dp)
        if (problem%shift_row > 0 .and. sub%n_contacts > 0) moves = moves .or. &
          & any(abs(sub%hot(:, problem%shift_row + 1:problem%shift_row + nd - 1, :)) > 0.0_dp)
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    self%mass = merge(sums(1), sums(2), sums(1) > 0.0_dp)
    self%is_uneven = are_uneven(sums(4), sums(1), sums(3))
    problem%rest_is_admissible = .not. problem%comm%any_true(moves)
  end subroutine velocity_error_start

  !> C, from what `residual` of the problem has summed; nothing else is known then [m/s].
  subroutine velocity_error_bound(self, problem)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem

    self%is_assessed = .false.
    self%is_exact = .false.
    self%bound_by_rest = unknown
    self%projection = unknown
    call self%levels%forget()
    self%has_levels = .false.
    self%has_followed = .false.
    self%is_restless = .false.
    self%is_early = .false.
    self%believed_from = 0
    self%projection_of_islands = 0.0_dp
    self%largest_violation = 0.0_dp
    if (.not. (problem%rest_is_admissible .and. self%mass > 0.0_dp)) return
    self%bound_by_rest = sqrt(max(0.0_dp, problem%kinetic + 2.0_dp*problem%shift_power)/self%mass)
  end subroutine velocity_error_bound

  !> Whether no contact violates its law and no body sinks by more than what is allowed, told by the velocities of the bodies alone:
  !> where everything prescribed is at rest, a violation is at most twice the largest of them. Collective.
  logical function velocity_error_all_are_slow(self, problem) result(are_slow)
    class(velocity_error_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem

    are_slow = 2.0_dp*fastest_speed(problem) <= bodies_allowed*self%allowed
  end function velocity_error_all_are_slow

  !> The largest speed of a body, with that of its rim [m/s]. Collective.
  real(dp) function fastest_speed(problem) result(fastest)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: rim
    integer :: s, b

    fastest = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), nd => problem%nd)
        do b = 1, sub%n_bodies
          rim = 0.0_dp
          if (b <= sub%n_grains) rim = sub%radius(b)*norm2(sub%v_global(nd + 1:, b))
          fastest = max(fastest, norm2(sub%v_global(1:nd, b)) + rim)
        end do
      end associate
    end do
    fastest = problem%comm%highest(fastest)
  end function fastest_speed

  !> What is compared with the error that is allowed [m/s]: E with a larger factor of L, or C over a fraction of that error. What
  !> sinks as one creeps on with one sign from step to step, so that less of it is allowed. No contact may violate its law by much,
  !> no body sink by much, and no island be wrong by more than all may be. What moves where nearly all bodies are at rest has to be
  !> known better.
  pure real(dp) function velocity_error_criterion(self) result(criterion)
    class(velocity_error_t), intent(in) :: self
    criterion = max(self%largest_violation/violations_allowed, &
      & min(self%bound_by_rest/share_at_rest, self%wave(weight_of_sinking)), weight_of_projection*self%projection_of_islands)
    if (self%bound_by_rest <= nearly_at_rest*self%allowed) criterion = max(criterion, self%levels%fastest/sinking_allowed)
    if (self%has_followed) criterion = max(criterion, error_of_bodies(self))
    if (self%is_restless) criterion = max(criterion, self%wave(weight_of_sinking)/self%share_of_motion(), &
      & self%levels%fastest_that_moves/speed_at_rest)
    ! what is reported then is the bound by rest, which has to be within the error allowed, too
    if (self%is_early) criterion = max(criterion, self%bound_by_rest/merge(share_at_rest, 1.0_dp, self%is_restless))
  end function velocity_error_criterion

  !> The share of the error allowed that E may have where nearly all bodies are at rest and some move: C is what moves there.
  pure real(dp) function velocity_error_share_of_motion(self) result(share)
    class(velocity_error_t), intent(in) :: self
    share = max(least_share, min(1.0_dp, self%bound_by_rest/self%most_at_rest))
  end function velocity_error_share_of_motion

  !> What tells whether one start is better than another [m/s]: E, because single contacts that are far off are soon mended; but
  !> where few heavy bodies have most of the mass, in which the others hide, what the criterion compares.
  pure real(dp) function velocity_error_measure_of_start(self) result(measure)
    class(velocity_error_t), intent(in) :: self
    measure = self%estimate()
    if (self%is_uneven) measure = self%criterion()
  end function velocity_error_measure_of_start

  !> E with a weight on L [m/s].
  pure real(dp) function velocity_error_wave(self, weight) result(wave)
    class(velocity_error_t), intent(in) :: self
    real(dp), intent(in) :: weight

    wave = hypot(weight_of_projection*self%projection, weight*self%levels%error)
  end function velocity_error_wave

  !> Whether C alone says that what moves is no more than what may where all could rest.
  pure logical function velocity_error_rests(self) result(rests)
    class(velocity_error_t), intent(in) :: self
    rests = self%bound_by_rest <= share_at_rest*self%allowed
  end function velocity_error_rests

  !> The smaller of E and C [m/s]; C where E may be too small, and where C alone ends a solve.
  pure real(dp) function velocity_error_estimate(self) result(estimate)
    class(velocity_error_t), intent(in) :: self
    estimate = self%bound_by_rest
    if (self%is_exact) estimate = 0.0_dp
    if (.not. (self%is_early .or. self%rests())) estimate = min(estimate, self%wave(weight_of_levels))
  end function velocity_error_estimate

  !> C, Y and the largest violation, and the residual with them, with v_global and the reactions evaluated: one pass over
  !> the contacts and one reduction. Collective.
  subroutine velocity_error_assess(self, problem, method, iteration, residual, defect)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    !> as `residual` of the problem returns them
    real(dp), intent(out) :: residual, defect
    type(projection_t) :: found

    call self%tests%project(problem, method, iteration, self%levels%part, found)
    residual = found%residual
    defect = found%defect
    call self%bound(problem)
    self%is_assessed = .true.
    self%iterations = iteration
    self%largest_violation = found%largest_violation
    self%projection = 0.0_dp
    if (self%mass > 0.0_dp) self%projection = min(sqrt(found%square/self%mass), self%bound_by_rest)
  end subroutine velocity_error_assess

  !> L, after `assess`; and, where all else is within the error allowed, whether some body moves among bodies at rest, and how fast
  !> each body sinks if bounds do not tell enough. Where few heavy bodies have most of the mass, E says little of the others.
  !> Collective.
  subroutine velocity_error_add_levels(self, problem, method)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    !> times the error allowed that no body may sink by
    real(dp) :: limit
    !> iterations before which E is not believed: waves go down once after a pass, and down and up where bodies hold by traction
    integer :: early

    call self%levels%add(problem, self%mass, self%largest_violation)
    self%has_levels = .true.
    self%has_followed = .false.
    early = 0
    if (self%begun_at > 0) early = self%begun_at + self%levels%most_depth
    if (problem%attracts) early = self%begun_at + 2*self%levels%most_depth
    self%is_early = self%iterations < early .and. (problem%carries .or. self%bound_by_rest <= slow*problem%error_scale)
    self%believed_from = merge(early, 0, self%is_early .and. problem%carries)
    if (self%criterion() > self%allowed) return
    limit = merge(bodies_allowed, body_allowed, self%is_uneven)
    if (self%bound_by_rest <= self%most_at_rest) then
      ! bodies that hold by traction sway in waves that few iterations do not show
      if (problem%attracts .or. max(self%wave(weight_of_sinking)/self%share_of_motion(), &
        & self%levels%fastest_body/speed_at_rest) > self%allowed) &
        & self%is_restless = fastest_speed(problem) > speed_at_rest*self%allowed
      if (self%criterion() > self%allowed) return
      if (self%is_restless) limit = speed_at_rest
    end if
    ! the motion of a cell that stresses drive joins all bodies
    if ((self%is_restless .or. self%bound_by_rest > self%most_at_rest) .and. .not. problem%cell_is_driven()) then
      self%projection_of_islands = self%tests%project_islands(problem, method, self%iterations, self%mass)
      if (self%criterion() > self%allowed) return
    end if
    if (self%levels%fastest_body <= limit*self%allowed) return
    call self%levels%follow(problem, self%largest_violation)
    self%has_followed = .true.
  end subroutine velocity_error_add_levels

  !> The whole estimate, with v_global and the reactions evaluated. Collective.
  subroutine velocity_error_complete(self, problem, method, iteration)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    real(dp) :: residual, defect

    if (.not. self%is_assessed) call self%assess(problem, method, iteration, residual, defect)
    if (.not. self%has_levels) call self%add_levels(problem, method)
  end subroutine velocity_error_complete

  !> Find whether velocities are exact where the residual is rounding, with v_global and the reactions evaluated. Rounding is
  !> relative to the largest momentum of the scene, and bodies that are lighter by many orders may still be anywhere: no contact may
  !> violate its law by much, and no body sink by much, unless that is rounding of velocities itself. Collective.
  subroutine velocity_error_look_at_bodies(self, problem, method, iteration)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    real(dp) :: residual, defect, limit

    self%is_exact = problem%n_contacts == 0 .or. .not. self%allowed > 0.0_dp
    if (self%is_exact) return
    if (.not. self%is_assessed) call self%assess(problem, method, iteration, residual, defect)
    limit = max(self%allowed, rounding*sqrt(real(problem%n_contacts, dp))*problem%velocity_scale)
    if (error_of_bodies(self) <= limit .and. .not. self%has_levels) then
      call self%levels%add(problem, self%mass, self%largest_violation)
      self%has_levels = .true.
      if (error_of_bodies(self) > limit) then
        call self%levels%follow(problem, self%largest_violation)
        self%has_followed = .true.
      end if
    end if
    self%is_exact = error_of_bodies(self) <= limit
  end subroutine velocity_error_look_at_bodies

  !> What single contacts and bodies contribute to what is compared with the error that is allowed [m/s]; a bound on it as long as
  !> bodies have not been followed.
  pure real(dp) function error_of_bodies(self) result(error)
    class(velocity_error_t), intent(in) :: self
    error = max(self%largest_violation/violations_allowed, self%levels%fastest_body/body_allowed, &
      & self%levels%mean_of_bodies/bodies_allowed)
  end function error_of_bodies

  !> The iterations begin anew from other impulses.
  subroutine velocity_error_begin_anew(self, iteration)
    class(velocity_error_t), intent(inout) :: self
    !> made so far
    integer, intent(in) :: iteration

    self%is_assessed = .false.
    self%begun_at = iteration
    call self%tests%begin_anew(iteration)
  end subroutine velocity_error_begin_anew

end module gravier_velocity_error
