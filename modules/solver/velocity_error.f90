!> The velocity error of a solve, estimated without knowing the solution: |V - V*|_M over the root of the mass of the grains in
!> contact, a root mean square velocity. The natural-map residual does not see waves that are long against a grain; this does.
!>
!> What is looked at is the velocity by which a contact violates its law, w = W (P(r - (v + s n)/W) - r). With e = V - V* and
!> the set of pressing and sticking contacts known, H^T e = -w there, so that any test impulse y gives y . w = -(M^-1 H y, e)_M.
!>   Y  projection of e on what test impulses move: b_i = y_i . w, G_ij = (h_i, h_j)_M, h_i = M^-1 H y_i, Y^2 = b^T G^+ b.
!>      The test impulses are w/W (local errors), r (a wrong total load), r less the impulses one iteration before (the wave that
!>      momentum carries), r less two older copies (slower waves behind it).
!>   L  sum over levels. The depth of a body is the number of contacts to the nearest boundary that supports it. The power
!>      of the violations between two levels over the force that crosses, 0.65 being the mean cosine between a normal and the
!>      way down, is the velocity by which all that lies above sinks: s_l = sum r . w/(0.65 sum r_n), e_l = s_1 + ... + s_l,
!>      L^2 = sum m_l e_l^2.
!>   E  = sqrt((a Y)^2 + L^2), a = 2.4, because test impulses see but a part of long waves. After a pass over layers
!>      (gravier_layered_start) long waves are gone, and a = 1.3.
!>      Where groups of contacts creep, test impulses of little motion make E too large. The mean violation, each contact weighed by
!>      r_n, over as many contacts as the depth D is long is more than any wave can be: E is at most 2 D sqrt(sum r_n |w|^2/sum r_n).
!>   C  bound where everything prescribed is at rest and no contact sends velocities back: rest is admissible then, and
!>      C^2 = |V|_M^2 + 2 sum r_n s bounds the error of a convex problem. It costs nothing, and is the error where the solution is
!>      at rest. The estimate is the smaller of E and C.
!> All are divided by the root of the mass. See doc/theory.md, section 24.
module gravier_velocity_error
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_contact_kernels, only: lanes, n_tests, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_scheme, only: scheme_t
  use gravier_dense_direct, only: projected_square
  use gravier_supports, only: supports_t, find_supports
  implicit none
  private
  public :: velocity_error_t, copies_ready, violations_allowed

  !> weight of Y in the estimate; mean cosine between normals and the way down
  real(dp), parameter :: weight_of_projection = 2.4_dp, weight_after_layers = 1.3_dp, cosine = 0.65_dp
  !> share of the error allowed that bodies may move with where all could rest; weight of L in what is allowed
  real(dp), parameter :: share_at_rest = 0.1_dp, weight_of_sinking = 4.0_dp
  !> times the error allowed by which a contact may violate its law: the error is a mean by mass, which light bodies hide in
  real(dp), parameter :: violations_allowed = 5.0_dp
  !> share of the largest eigenvalue of G below which it counts as 0
  real(dp), parameter :: rank_cut = 1.0e-10_dp
  !> copies of impulses kept; ratio between the iterations they are taken at; the first of them
  integer, parameter :: n_copies = 2, first_copy = 2
  real(dp), parameter :: copy_ratio = 4.0_dp/3.0_dp
  !> products of the velocities that test impulses make
  integer, parameter :: n_products = n_tests*(n_tests + 1)/2
  !> numbers before them
  integer, parameter :: n_powers = n_tests + 2
  !> the estimate is at most so many times the depth and the mean violation; the iteration from which on the depth is found for that
  real(dp), parameter :: most_waves = 2.0_dp
  integer, parameter :: settled = 20
  !> share of the largest free speed below which the shift of a closed contact is rounding of places
  real(dp), parameter :: rounded = 1.0e-3_dp
  !> what is not known; its multiples and those of a weight are numbers still [m/s]
  real(dp), parameter :: unknown = 1.0e-3_dp*sqrt(huge(1.0_dp))
  !> no way leads to a boundary
  integer, parameter :: unreached = -1
  !> iterations before which Y and L are not trusted
  integer, parameter :: copies_ready = 4

  !> The impulses of one subdomain some iterations ago (lanes, nc, blocks) [N s].
  type :: copy_t
    real(dp), allocatable :: impulse(:, :, :)
  end type copy_t

  !> What the estimate holds for one subdomain.
  type :: error_part_t
    !> r . w of each contact (lanes, blocks) [J]
    real(dp), allocatable :: power(:, :)
    !> H y of the test impulses, summed over copies of bodies (n_tests, nv, n_columns) [N s, N m s]
    real(dp), allocatable :: motion(:, :, :)
    type(copy_t) :: copy(n_copies)
    !> contacts to a support, of each body (n_columns)
    integer, allocatable :: depth(:)
  end type error_part_t

  type :: velocity_error_t
    !> mass of the grains in contact, or of all that can move where there are none [kg]
    real(dp) :: mass = 0.0_dp
    !> whether rest is admissible, so that C is a bound
    logical :: rest_is_admissible = .false.
    !> C, Y and L, as far as they are known, by the last `bound` and `project` [m/s]
    real(dp) :: bound_by_rest = unknown, projection = unknown, levels = 0.0_dp
    !> weight of Y
    real(dp) :: weight = weight_of_projection
    !> root mean square of w, weighed by r_n, by the last `project` [m/s]
    real(dp) :: mean_violation = 0.0_dp
    !> largest |w| of a contact, by the last `project`; 0 since `bound` [m/s]
    real(dp) :: largest_violation = 0.0_dp
    !> largest depth; negative while it is not known
    integer :: most_depth = -1
    !> iterations at which the copies were taken, the older one first, 0 for none; the next one
    integer, private :: taken_at(n_copies) = 0, next_copy = first_copy
    !> places of the copies in the parts, the older one first
    integer, private :: place(n_copies) = [1, 2]
    type(error_part_t), allocatable, private :: part(:)
  contains
    procedure :: start => velocity_error_start
    procedure :: keep_copy => velocity_error_keep_copy
    procedure :: copy_of => velocity_error_copy_of
    procedure :: bound => velocity_error_bound
    procedure :: project => velocity_error_project
    procedure :: add_levels => velocity_error_add_levels
    procedure :: estimate => velocity_error_estimate
    procedure :: criterion => velocity_error_criterion
    procedure, private :: wave => velocity_error_wave
    procedure :: excludes_violations => velocity_error_excludes_violations
    procedure :: find_depth => velocity_error_find_depth
    procedure :: forget_copies => velocity_error_forget_copies
  end type velocity_error_t

contains

  !> Make ready for a solve. Collective.
  subroutine velocity_error_start(self, problem)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> mass of the grains, of all bodies that can move
    real(dp) :: parts(2, size(problem%sub)), sums(2), heavy
    logical :: moves
    integer :: s, b

    allocate (self%part(size(problem%sub)))
    parts(:, :) = 0.0_dp
    moves = .false.
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), nd => problem%kernels%nd)
        do b = 1, sub%n_bodies
          if (.not. any(sub%inverse_mass(1:nd, b) > 0.0_dp)) cycle
          heavy = 1.0_dp/(maxval(sub%inverse_mass(1:nd, b))*sub%multiplicity(b))
          if (b <= sub%n_grains) parts(1, s) = parts(1, s) + heavy
          parts(2, s) = parts(2, s) + heavy
        end do
        moves = moves .or. any(abs(sub%v_free(:, sub%n_bodies + 1:)) > 0.0_dp)
        if (sub%n_contacts > 0) moves = moves .or. any(sub%hot(:, nd + 1, :) < 0.0_dp)
        if (problem%kernels%shift_row > 0 .and. sub%n_contacts > 0) moves = moves .or. &
          & any(abs(sub%hot(:, problem%kernels%shift_row + 1:problem%kernels%shift_row + nd - 1, :)) > 0.0_dp)
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    self%mass = merge(sums(1), sums(2), sums(1) > 0.0_dp)
    self%rest_is_admissible = .not. problem%comm%any_true(moves)
  end subroutine velocity_error_start

  !> Keep a copy of the impulses after an iteration, where one is due.
  subroutine velocity_error_keep_copy(self, problem, iteration)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: iteration
    integer :: s

    if (iteration < self%next_copy) return
    self%next_copy = max(iteration + 1, nint(iteration*copy_ratio))
    self%place(:) = n_copies + 1 - self%place
    self%taken_at(1) = self%taken_at(2)
    self%taken_at(2) = iteration
    do s = 1, size(self%part)
      self%part(s)%copy(self%place(2))%impulse = problem%sub(s)%impulse
    end do
  end subroutine velocity_error_keep_copy

  !> The older copy of the impulses of subdomain `s`, or those that it has now where there is none.
  pure subroutine velocity_error_copy_of(self, problem, s, impulse)
    class(velocity_error_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> (lanes, nc, blocks) [N s]
    real(dp), allocatable, intent(out) :: impulse(:, :, :)

    if (self%taken_at(1) > 0) then
      impulse = self%part(s)%copy(self%place(1))%impulse
    else
      impulse = problem%sub(s)%impulse
    end if
  end subroutine velocity_error_copy_of

  !> C, from what `residual` of the problem has summed; Y, L and the largest violation are not known then [m/s].
  subroutine velocity_error_bound(self, problem)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem

    self%bound_by_rest = unknown
    self%projection = unknown
    self%levels = 0.0_dp
    self%largest_violation = 0.0_dp
    if (.not. (self%rest_is_admissible .and. self%mass > 0.0_dp)) return
    self%bound_by_rest = sqrt(max(0.0_dp, problem%kinetic + 2.0_dp*problem%shift_power)/self%mass)
  end subroutine velocity_error_bound

  !> Whether no contact violates its law by more than what is allowed where the error may be `limit`, told by the velocities of the
  !> bodies alone: where everything prescribed is at rest, a violation is at most twice the largest of them. Collective.
  logical function velocity_error_excludes_violations(self, problem, limit) result(excludes)
    class(velocity_error_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    !> [m/s]
    real(dp), intent(in) :: limit
    real(dp) :: fastest, rim
    integer :: s, b

    fastest = 0.0_dp
    do s = 1, size(self%part)
      associate (sub => problem%sub(s), nd => problem%kernels%nd)
        do b = 1, sub%n_bodies
          rim = 0.0_dp
          if (b <= sub%n_grains) rim = sub%radius(b)*norm2(sub%v_global(nd + 1:, b))
          fastest = max(fastest, norm2(sub%v_global(1:nd, b)) + rim)
        end do
      end associate
    end do
    excludes = 2.0_dp*problem%comm%highest(fastest) <= violations_allowed*limit
  end function velocity_error_excludes_violations

  !> What is compared with the error that is allowed [m/s]: E with more weight on L, or C over a share of the error allowed. What
  !> sinks as one creeps on with one sign from step to step, so that less of it is allowed. No contact may violate its law by much.
  pure real(dp) function velocity_error_criterion(self) result(criterion)
    class(velocity_error_t), intent(in) :: self
    criterion = max(self%largest_violation/violations_allowed, &
      & min(self%bound_by_rest/share_at_rest, self%wave(weight_of_sinking)))
  end function velocity_error_criterion

  !> E with a weight on L, and at most D times the mean violation, so many times, where the depth D is known [m/s].
  pure real(dp) function velocity_error_wave(self, weight_of_levels) result(wave)
    class(velocity_error_t), intent(in) :: self
    real(dp), intent(in) :: weight_of_levels

    wave = hypot(self%weight*self%projection, weight_of_levels*self%levels)
    if (self%most_depth > 0 .and. self%projection < unknown) wave = min(wave, &
      & weight_of_levels*most_waves*self%most_depth*self%mean_violation)
  end function velocity_error_wave

  !> The smaller of E and C [m/s].
  pure real(dp) function velocity_error_estimate(self) result(estimate)
    class(velocity_error_t), intent(in) :: self
    estimate = min(self%bound_by_rest, self%wave(1.0_dp))
  end function velocity_error_estimate

  !> Y, with v_global evaluated. Collective.
  subroutine velocity_error_project(self, problem, scheme, iteration)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(scheme_t), intent(in) :: scheme
    integer, intent(in) :: iteration
    !> b, sums of r_n |w|^2 and of r_n, then the columns of the upper triangle of G
    real(dp) :: parts(n_powers + n_products, size(problem%sub)), sums(n_powers + n_products), largest(1)
    logical :: knows_last, knows(n_copies)
    integer :: s

    knows_last = scheme%momentum%on .and. .not. scheme%momentum%resting .and. iteration > 0
    knows(:) = self%taken_at > 0 .and. self%taken_at < iteration
    parts(:, :) = 0.0_dp
    largest(1) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => self%part(s))
        if (.not. allocated(part%motion)) then
          allocate (part%motion(n_tests, problem%kernels%nv, sub%n_columns), part%power(lanes, size(sub%hot, 3)))
        end if
        part%motion(:, :, :) = 0.0_dp
        if (sub%n_contacts == 0) cycle
        ! what is not known makes a test impulse of 0, or one twice, which tells nothing
        if (.not. knows(2)) then
          if (knows_last) call make_tests(sub, part, scheme%momentum%part(s)%impulse, sub%impulse, sub%impulse)
          if (.not. knows_last) call make_tests(sub, part, sub%impulse, sub%impulse, sub%impulse)
        else
          associate (recent => part%copy(self%place(2))%impulse, old => part%copy(self%place(merge(1, 2, knows(1))))%impulse)
            if (knows_last) call make_tests(sub, part, scheme%momentum%part(s)%impulse, recent, old)
            if (.not. knows_last) call make_tests(sub, part, recent, recent, old)
          end associate
        end if
      end associate
    end do
    call sum_motions(problem, self%part)
    do s = 1, size(problem%sub)
      call add_products(problem%sub(s), self%part(s)%motion, parts(n_powers + 1:, s))
    end do
    call start_timer(phase_reduction)
    call problem%comm%sum_parts(parts, sums)
    call problem%comm%highest_of(largest)
    call stop_timer(phase_reduction)
    self%largest_violation = sqrt(largest(1))
    if (iteration >= settled .and. self%most_depth < 0) call self%find_depth(problem)
    self%projection = 0.0_dp
    if (self%mass > 0.0_dp) self%projection = sqrt(projection_of(sums(1:n_tests), sums(n_powers + 1:))/self%mass)
    self%mean_violation = 0.0_dp
    if (sums(n_powers) > 0.0_dp) self%mean_violation = sqrt(max(0.0_dp, sums(n_tests + 1))/sums(n_powers))

  contains

    subroutine make_tests(sub, part, last, recent, old)
      type(subproblem_t), intent(in) :: sub
      type(error_part_t), intent(inout) :: part
      real(dp), intent(in), contiguous :: last(:, :, :), recent(:, :, :), old(:, :, :)

      call problem%kernels%make_tests(sub%pair, sub%hot, sub%inverse_mass, sub%v_global, sub%impulse, last, recent, old, &
        & part%power, part%motion, parts(1:n_powers, s), largest(1))
    end subroutine make_tests

  end subroutine velocity_error_project

  !> Sum H y over the copies of bodies, test by test. Collective.
  subroutine sum_motions(problem, part)
    type(contact_problem_t), intent(inout) :: problem
    type(error_part_t), intent(inout) :: part(:)
    real(dp), allocatable :: field(:, :)
    integer :: s, t

    if (problem%n_subdomains == 1) return
    do t = 1, n_tests
      do s = 1, size(part)
        field = part(s)%motion(t, :, :)
        call problem%shared%load(s, field)
      end do
      call problem%shared%pass()
      do s = 1, size(part)
        field = part(s)%motion(t, :, :)
        call problem%shared%sum_copies(s, field, mean=.false.)
        part(s)%motion(t, :, :) = field
      end do
    end do
  end subroutine sum_motions

  !> b^T G^+ b [J].
  real(dp) function projection_of(b, products) result(square)
    !> (n_tests); columns of the upper triangle of G
    real(dp), intent(in), contiguous :: b(:), products(:)
    real(dp) :: g(size(b), size(b))
    integer :: i, j, at

    at = 0
    do j = 1, size(b)
      do i = 1, j
        at = at + 1
        g(i, j) = products(at)
        g(j, i) = products(at)
      end do
    end do
    square = projected_square(g, b, rank_cut)
  end function projection_of

  !> The products (h_i, h_j)_M of the velocities h = M^-1 H y, i <= j, a copy of a shared body counting with its part.
  pure subroutine add_products(sub, motion, products)
    type(subproblem_t), intent(in) :: sub
    !> H y, summed over copies (n_tests, nv, n_columns)
    real(dp), intent(in), contiguous :: motion(:, :, :)
    !> (n_products)
    real(dp), intent(inout) :: products(:)
    real(dp) :: acting(n_tests, n_tests), inverse
    integer :: b, d, t, j, at

    acting(:, :) = 0.0_dp
    do b = 1, sub%n_bodies
      do d = 1, size(motion, 2)
        inverse = sub%inverse_mass(min(d, size(sub%inverse_mass, 1)), b)/sub%multiplicity(b)
        do j = 1, n_tests
          do t = 1, n_tests
            acting(t, j) = acting(t, j) + inverse*motion(j, d, b)*motion(t, d, b)
          end do
        end do
      end do
    end do
    at = 0
    do j = 1, n_tests
      do t = 1, j
        at = at + 1
        products(at) = acting(t, j)
      end do
    end do
  end subroutine add_products

  !> L, after `project`. Collective.
  subroutine velocity_error_add_levels(self, problem)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> of each level: power r . w, force sum r_n, mass of its bodies (3 levels, subdomains)
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: sinking, squares
    integer :: s, c, b, l, n, i, j, q, g

    if (self%most_depth < 0) call self%find_depth(problem)
    self%levels = 0.0_dp
    n = self%most_depth
    if (n < 1) return
    allocate (parts(3*n, size(problem%sub)), sums(3*n))
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => self%part(s))
        do c = 1, sub%n_contacts
          i = part%depth(sub%pair(1, c))
          j = part%depth(sub%pair(2, c))
          if (abs(i - j) /= 1 .or. i == unreached .or. j == unreached) cycle
          l = max(i, j)
          q = lane_of(c)
          g = block_of(c)
          parts(l, s) = parts(l, s) + part%power(q, g)
          parts(n + l, s) = parts(n + l, s) + sub%impulse(q, 1, g)
        end do
        do b = 1, sub%n_grains
          l = part%depth(b)
          if (l > 0) parts(2*n + l, s) = parts(2*n + l, s) + 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
        end do
      end associate
    end do
    call start_timer(phase_reduction)
    call problem%comm%sum_parts(parts, sums)
    call stop_timer(phase_reduction)
    sinking = 0.0_dp
    squares = 0.0_dp
    do l = 1, n
      if (sums(n + l) > 0.0_dp) sinking = sinking + sums(l)/(cosine*sums(n + l))
      self%largest_violation = max(self%largest_violation, abs(sinking))
      squares = squares + sums(2*n + l)*sinking**2
    end do
    if (self%mass > 0.0_dp) self%levels = sqrt(squares/self%mass)
  end subroutine velocity_error_add_levels

  !> Depth of every body: contacts to the nearest boundary that supports, over contacts that press or are closed; in parts without
  !> one, to the nearest that moves as prescribed, or else that forces move. It does not depend on subdomains or ranks. Collective.
  subroutine velocity_error_find_depth(self, problem)
    class(velocity_error_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(supports_t), allocatable :: supports(:)
    real(dp) :: most
    integer :: s, b, round
    logical :: starts

    do s = 1, size(problem%sub)
      if (.not. allocated(self%part(s)%depth)) allocate (self%part(s)%depth(problem%sub(s)%n_columns))
      self%part(s)%depth(:) = unreached
    end do
    call find_supports(problem, supports)
    do round = 1, 3
      starts = .false.
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s), depth => self%part(s)%depth)
          do b = sub%n_grains + 1, sub%n_columns
            if (depth(b) /= unreached) cycle
            if (round == 1 .and. .not. supports(s)%column(b)) cycle
            if (round == 2 .and. any(sub%inverse_mass(1:problem%kernels%nd, b) > 0.0_dp)) cycle
            depth(b) = 0
            starts = .true.
          end do
        end associate
      end do
      if (problem%comm%any_true(starts)) call spread_depth(problem, self%part)
    end do
    most = 0.0_dp
    do s = 1, size(problem%sub)
      if (size(self%part(s)%depth) > 0) most = max(most, real(maxval(self%part(s)%depth), dp))
    end do
    self%most_depth = nint(problem%comm%highest(most))
  end subroutine velocity_error_find_depth

  !> Depths from those that are known, across subdomains. Collective.
  subroutine spread_depth(problem, part)
    type(contact_problem_t), intent(inout) :: problem
    type(error_part_t), intent(inout) :: part(:)
    !> ways of a subdomain: neighbours of body b are towards(first(b):first(b + 1) - 1)
    type :: ways_t
      integer, allocatable :: first(:), towards(:)
      !> bodies whose depth may still be found or lowered
      logical, allocatable :: open(:)
      real(dp), allocatable :: field(:, :)
    end type ways_t
    type(ways_t) :: ways(size(part))
    integer :: s, b, j, d
    logical :: changed, shares

    shares = .false.
    do s = 1, size(part)
      call list_ways(problem%sub(s), problem%kernels%nd + 1, rounded*problem%velocity_scale, ways(s)%first, ways(s)%towards)
      shares = shares .or. problem%shared%part(s)%n_slots > 0
      ways(s)%open = part(s)%depth == unreached
      ways(s)%open(problem%sub(s)%n_bodies + 1:) = .false.
      call search_breadth_first(ways(s)%first, ways(s)%towards, ways(s)%open, part(s)%depth)
    end do
    if (.not. problem%comm%any_true(shares)) return
    do s = 1, size(part)
      allocate (ways(s)%field(problem%kernels%nv, problem%sub(s)%n_columns), source=0.0_dp)
    end do
    do
      do s = 1, size(part)
        ways(s)%field(1, :) = real(part(s)%depth, dp)
        call problem%shared%load(s, ways(s)%field)
      end do
      call problem%shared%pass()
      changed = .false.
      do s = 1, size(part)
        associate (shared => problem%shared%part(s), depth => part(s)%depth)
          shares = .false.
          do j = 1, shared%n_slots
            d = nint(shared%recv(1, j))
            b = shared%slot_body(j)
            if (d == unreached .or. .not. ways(s)%open(b) .or. (depth(b) /= unreached .and. depth(b) <= d)) cycle
            depth(b) = d
            shares = .true.
          end do
          if (shares) call search_breadth_first(ways(s)%first, ways(s)%towards, ways(s)%open, depth)
          changed = changed .or. shares
        end associate
      end do
      if (.not. problem%comm%any_true(changed)) exit
    end do
  end subroutine spread_depth

  !> The contacts that press or are closed, as lists of neighbours.
  subroutine list_ways(sub, at, closed, first, towards)
    type(subproblem_t), intent(in) :: sub
    !> row of `hot` that holds the shift
    integer, intent(in) :: at
    !> shift below which a contact counts as closed [m/s]
    real(dp), intent(in) :: closed
    integer, allocatable, intent(out) :: first(:), towards(:)
    integer, allocatable :: next(:)
    logical :: counts
    integer :: c, k, round

    allocate (first(sub%n_columns + 1), next(sub%n_columns + 1), source=0)
    do round = 1, 2
      do c = 1, sub%n_contacts
        counts = sub%gap(c) <= 0.0_dp .or. sub%hot(lane_of(c), at, block_of(c)) <= closed .or. &
          & sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp
        if (.not. counts) cycle
        do k = 1, 2
          associate (b => sub%pair(k, c))
            if (round == 1) then
              next(b) = next(b) + 1
            else
              towards(next(b)) = sub%pair(3 - k, c)
              next(b) = next(b) + 1
            end if
          end associate
        end do
      end do
      if (round == 2) exit
      first(1) = 1
      do k = 1, sub%n_columns
        first(k + 1) = first(k) + next(k)
      end do
      allocate (towards(first(sub%n_columns + 1) - 1))
      next(:) = first
    end do
  end subroutine list_ways

  !> Lower depths to one more than that of the nearest neighbour, until nothing changes.
  subroutine search_breadth_first(first, towards, open, depth)
    integer, intent(in), contiguous :: first(:), towards(:)
    logical, intent(in), contiguous :: open(:)
    integer, intent(inout), contiguous :: depth(:)
    integer, allocatable :: front(:), next(:)
    integer :: b, d, k, n, m, level, most

    allocate (front(size(depth)), next(size(depth)))
    most = maxval(depth)
    level = -1
    n = 0
    do
      level = level + 1
      ! bodies that start at this level join those just reached
      if (level <= most) then
        do b = 1, size(depth)
          if (depth(b) /= level) cycle
          n = n + 1
          front(n) = b
        end do
      end if
      if (n == 0 .and. level > most) exit
      m = 0
      do k = 1, n
        do d = first(front(k)), first(front(k) + 1) - 1
          b = towards(d)
          if (.not. open(b) .or. (depth(b) /= unreached .and. depth(b) <= level + 1)) cycle
          depth(b) = level + 1
          m = m + 1
          next(m) = b
        end do
      end do
      n = m
      front(1:n) = next(1:n)
      if (level < most) n = 0
    end do
  end subroutine search_breadth_first

  !> Forget the copies: the iterations begin anew from other impulses.
  subroutine velocity_error_forget_copies(self, iteration, layered)
    class(velocity_error_t), intent(inout) :: self
    !> made so far
    integer, intent(in) :: iteration
    !> those of a pass over layers
    logical, intent(in) :: layered

    self%weight = merge(weight_after_layers, weight_of_projection, layered)
    self%taken_at(:) = 0
    self%next_copy = iteration + first_copy
  end subroutine velocity_error_forget_copies

end module gravier_velocity_error
