!> How fast a packing sinks onto its supports where a solve has not converged, by levels and body by body.
!>
!> The depth of a body is the number of contacts to the nearest boundary that supports it. r . w is the power with which a contact
!> violates its law (gravier_velocity_error); over the force that the contact carries, 0.65 being the mean cosine between a normal
!> and the way down, it is the velocity by which the upper body sinks onto the lower one.
!>   by levels  s_l = sum r . w/(0.65 sum r_n) over the contacts between two depths; all that lies above sinks by
!>              e_l = s_1 + ... + s_l; L^2 = sum m_l e_l^2 over the mass. The sums are signed, so that scattered errors cancel.
!>   by bodies  e_b = sum (|r_n| e_j + r . w/0.65)/sum |r_n| over the contacts of a body with the bodies j of the depth below.
!> L is a mean by mass, in which a column of light bodies beside or on a heavy one is not seen; e_b sees it.
!> See doc/theory.md, section 24.
module gravier_levels
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_contact_kernels, only: lanes, lane_of, block_of
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_supports, only: supports_t, find_supports
  use gravier_ways, only: ways_t, list_closed, shorten_ways, unreached
  implicit none
  private
  public :: levels_t, level_part_t

  !> mean cosine between normals and the way down
  real(dp), parameter :: cosine = 0.65_dp
  !> rows that take turns in sums by level
  integer, parameter :: turns = 4
  !> depth of what no way leads to a boundary from
  integer, parameter :: afloat = -1

  !> What is held for one subdomain.
  type :: level_part_t
    !> r . w of each contact (lanes, blocks) [J]
    real(dp), allocatable :: power(:, :)
    !> contacts to a support, of each body (n_columns)
    integer, allocatable :: depth(:)
    !> contacts between two depths by ascending depth, and the first of each depth (n_contacts, 0:most_depth + 1)
    integer, allocatable, private :: contact(:), first(:)
  end type level_part_t

  type :: levels_t
    !> one a subdomain of this rank
    type(level_part_t), allocatable :: part(:)
    !> largest depth; negative while it is not known
    integer :: most_depth = -1
    !> L, and the largest |e_l|, by the last `add` [m/s]
    real(dp) :: error = 0.0_dp, fastest = 0.0_dp
    !> largest |e_b|, and the root of the mean of its square, each body counting the same; bounds on both as long as `follow` has
    !> not been called [m/s]
    real(dp) :: fastest_body = 0.0_dp, mean_of_bodies = 0.0_dp
    !> largest over the bodies of the smaller of |e_b| and the body's speed, by the last `follow`; 0 before it [m/s]
    real(dp) :: fastest_that_moves = 0.0_dp
  contains
    procedure :: start => levels_start
    procedure :: forget => levels_forget
    procedure :: find_depth => levels_find_depth
    procedure :: add => levels_add
    procedure :: follow => levels_follow
  end type levels_t

contains

  !> Make ready for a solve. `add` and `follow` read the powers of the contacts, which whoever finds them makes room for.
  subroutine levels_start(self, problem)
    class(levels_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem

    allocate (self%part(size(problem%sub)))
  end subroutine levels_start

  !> Nothing is known of the errors any more.
  pure subroutine levels_forget(self)
    class(levels_t), intent(inout) :: self

    self%error = 0.0_dp
    self%fastest = 0.0_dp
    self%fastest_body = 0.0_dp
    self%fastest_that_moves = 0.0_dp
    self%mean_of_bodies = 0.0_dp
  end subroutine levels_forget

  !> Depth of every body: contacts to the nearest boundary that supports, over contacts that press or are closed; in parts without
  !> one, to the nearest that moves as prescribed, or else that forces move. It does not depend on subdomains or ranks. It is
  !> found once in a solve, and anew for each state that gravier_error looks at. Collective.
  subroutine levels_find_depth(self, problem)
    class(levels_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(supports_t), allocatable :: supports(:)
    type(ways_t) :: ways(size(self%part))
    real(dp) :: most
    integer :: s, b, round
    logical :: starts

    call find_supports(problem%sub, problem%comm, problem%load(1:problem%nd), supports)
    call list_closed(problem, ways)
    do round = 1, 3
      starts = .false.
      do s = 1, size(ways)
        associate (sub => problem%sub(s), length => ways(s)%length)
          do b = sub%n_grains + 1, sub%n_columns
            if (length(b) < unreached) cycle
            if (round == 1 .and. .not. supports(s)%column(b)) cycle
            if (round == 2 .and. any(sub%inverse_mass(1:problem%nd, b) > 0.0_dp)) cycle
            length(b) = 0.0_dp
            starts = .true.
          end do
        end associate
      end do
      if (problem%comm%any_true(starts)) call shorten_ways(problem%comm, problem%shared, ways)
    end do
    most = 0.0_dp
    do s = 1, size(ways)
      if (.not. allocated(self%part(s)%depth)) allocate (self%part(s)%depth(size(ways(s)%length)))
      do b = 1, size(ways(s)%length)
        self%part(s)%depth(b) = afloat
        if (.not. ways(s)%length(b) < unreached) cycle
        self%part(s)%depth(b) = nint(ways(s)%length(b))
        most = max(most, ways(s)%length(b))
      end do
      if (allocated(self%part(s)%contact)) deallocate (self%part(s)%contact, self%part(s)%first)
    end do
    self%most_depth = nint(problem%comm%highest(most))
  end subroutine levels_find_depth

  !> L, the fastest level, and bounds on what `follow` finds. Collective.
  subroutine levels_add(self, problem, mass, largest_violation)
    class(levels_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> by which L is divided [kg]
    real(dp), intent(in) :: mass
    !> largest |w| of a contact [m/s]
    real(dp), intent(in) :: largest_violation
    !> of each level: power r . w, force sum r_n, mass of its bodies (3 levels, subdomains)
    real(dp), allocatable :: parts(:, :), sums(:)
    !> power and force of the levels from 0, for what lies in none, in rows that take turns: additions do not wait for each other
    real(dp), allocatable :: crossing(:, :, :)
    real(dp) :: sinking, squares, heavy
    integer :: s, b, l, n, i, j, q, g, turn

    if (self%most_depth < 0) call self%find_depth(problem)
    call self%forget()
    n = self%most_depth
    if (n < 1) return
    allocate (parts(3*n, size(problem%sub)), sums(3*n), crossing(2, turns, 0:n))
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      crossing(:, :, :) = 0.0_dp
      associate (sub => problem%sub(s), part => self%part(s))
        do g = 1, size(sub%hot, 3)
          do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
            i = part%depth(sub%pair(1, (g - 1)*lanes + q))
            j = part%depth(sub%pair(2, (g - 1)*lanes + q))
            l = level_of(i, j)
            turn = mod(q, turns) + 1
            crossing(1, turn, l) = crossing(1, turn, l) + part%power(q, g)
            crossing(2, turn, l) = crossing(2, turn, l) + sub%impulse(q, 1, g)
          end do
        end do
        parts(1:n, s) = sum(crossing(1, :, 1:), dim=1)
        parts(n + 1:2*n, s) = sum(crossing(2, :, 1:), dim=1)
        do b = 1, sub%n_grains
          l = part%depth(b)
          if (l < 1) cycle
          heavy = 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
          if (allocated(sub%concern)) heavy = sub%concern(b)*heavy
          parts(2*n + l, s) = parts(2*n + l, s) + heavy
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
      self%fastest = max(self%fastest, abs(sinking))
      squares = squares + sums(2*n + l)*sinking**2
    end do
    if (mass > 0.0_dp) self%error = sqrt(squares/mass)
    self%fastest_body = n*largest_violation/cosine
    self%mean_of_bodies = self%fastest_body
  end subroutine levels_add

  !> The level that a contact between two depths crosses, 0 for none. Next to what is afloat there is only depth 0, which has none.
  pure integer function level_of(i, j) result(level)
    integer, intent(in) :: i, j
    level = merge(max(i, j), 0, abs(i - j) == 1)
  end function level_of

  !> How fast each body sinks, one depth after the other, after `add`. Subdomains exchange what they have found of the bodies that
  !> they share after each depth that has such. Collective.
  subroutine levels_follow(self, problem, largest_violation)
    class(levels_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> largest |w| of a contact, which no r . w over r_n should exceed by much [m/s]
    real(dp), intent(in) :: largest_violation
    type :: sum_t
      !> sums of |r_n| and of |r_n| e_j + r . w/0.65 over the contacts of this subdomain, over those of all (nv, n_columns)
      real(dp), allocatable :: own(:, :), all(:, :)
      !> e_b (n_columns)
      real(dp), allocatable :: sinks(:)
    end type sum_t
    type(sum_t) :: sums(size(self%part))
    real(dp) :: parts(2, size(self%part)), means(2), fastest(2), sinking
    !> 1 for depths that subdomains share bodies of
    real(dp), allocatable :: shared(:)
    integer :: s, b, l

    self%fastest_body = 0.0_dp
    self%fastest_that_moves = 0.0_dp
    self%mean_of_bodies = 0.0_dp
    if (self%most_depth < 1) return
    allocate (shared(self%most_depth), source=0.0_dp)
    do s = 1, size(self%part)
      if (.not. allocated(self%part(s)%contact)) call order_contacts(problem%sub(s), self%part(s), self%most_depth)
      allocate (sums(s)%own(problem%nv, size(self%part(s)%depth)), source=0.0_dp)
      allocate (sums(s)%sinks(size(self%part(s)%depth)), source=0.0_dp)
      if (problem%n_subdomains > 1) allocate (sums(s)%all, mold=sums(s)%own)
    end do
    if (problem%n_subdomains > 1) then
      call mark_shared_depths(self%part, problem%shared, shared)
      call problem%comm%highest_of(shared)
    end if
    do l = 1, self%most_depth
      do s = 1, size(self%part)
        call add_depth(problem%sub(s), self%part(s), l, largest_violation, sums(s)%own, sums(s)%sinks)
        if (shared(l) > 0.0_dp) call problem%shared%load(s, sums(s)%own)
      end do
      if (.not. shared(l) > 0.0_dp) cycle
      call problem%shared%pass()
      do s = 1, size(self%part)
        call sum_over_copies(problem%shared, s, sums(s)%own, sums(s)%all, sums(s)%sinks)
      end do
    end do
    parts(:, :) = 0.0_dp
    fastest(:) = 0.0_dp
    do s = 1, size(self%part)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          if (self%part(s)%depth(b) == afloat) cycle
          sinking = abs(sums(s)%sinks(b))
          fastest(1) = max(fastest(1), sinking)
          if (sinking > fastest(2)) fastest(2) = max(fastest(2), min(sinking, norm2(sub%v_global(1:problem%nd, b))))
          parts(1, s) = parts(1, s) + sinking**2/sub%multiplicity(b)
          parts(2, s) = parts(2, s) + 1.0_dp/sub%multiplicity(b)
        end do
      end associate
    end do
    call start_timer(phase_reduction)
    call problem%comm%sum_parts(parts, means)
    call problem%comm%highest_of(fastest)
    self%fastest_body = fastest(1)
    self%fastest_that_moves = fastest(2)
    call stop_timer(phase_reduction)
    if (means(2) > 0.0_dp) self%mean_of_bodies = sqrt(means(1)/means(2))
  end subroutine levels_follow

  !> Mark the depths that subdomains share bodies of.
  pure subroutine mark_shared_depths(part, exchange, shared)
    type(level_part_t), intent(in) :: part(:)
    type(shared_exchange_t), intent(in) :: exchange
    !> 1 for these, 0 for others
    real(dp), intent(inout), contiguous :: shared(:)
    integer :: s, k, depth

    do s = 1, size(part)
      associate (copies => exchange%part(s))
        do k = 1, copies%n_shared
          depth = part(s)%depth(copies%body(k))
          if (depth > 0) shared(depth) = 1.0_dp
        end do
      end associate
    end do
  end subroutine mark_shared_depths

  !> The sums of the shared bodies of subdomain `s` over all copies, which are passed on, and how fast these bodies sink.
  subroutine sum_over_copies(exchange, s, own, all, sinks)
    type(shared_exchange_t), intent(in) :: exchange
    integer, intent(in) :: s
    real(dp), intent(in), contiguous :: own(:, :)
    real(dp), intent(inout), contiguous :: all(:, :), sinks(:)
    integer :: k

    associate (copies => exchange%part(s))
      do k = 1, copies%n_shared
        all(:, copies%body(k)) = own(:, copies%body(k))
      end do
      call exchange%sum_copies(s, all, mean=.false.)
      do k = 1, copies%n_shared
        sinks(copies%body(k)) = mean_of(all(:, copies%body(k)))
      end do
    end associate
  end subroutine sum_over_copies

  !> List the contacts between two depths by depth.
  subroutine order_contacts(sub, part, most_depth)
    type(subproblem_t), intent(in) :: sub
    type(level_part_t), intent(inout) :: part
    integer, intent(in) :: most_depth
    integer :: next(0:most_depth), c, l

    allocate (part%contact(sub%n_contacts), part%first(0:most_depth + 1), source=0)
    do c = 1, sub%n_contacts
      l = level_of(part%depth(sub%pair(1, c)), part%depth(sub%pair(2, c)))
      part%first(l + 1) = part%first(l + 1) + 1
    end do
    part%first(0) = 1
    do l = 1, most_depth + 1
      part%first(l) = part%first(l) + part%first(l - 1)
    end do
    next(:) = part%first(0:most_depth)
    do c = 1, sub%n_contacts
      l = level_of(part%depth(sub%pair(1, c)), part%depth(sub%pair(2, c)))
      part%contact(next(l)) = c
      next(l) = next(l) + 1
    end do
  end subroutine order_contacts

  !> The sums of the bodies of a depth over their contacts with those of the depth below, and how fast they sink by these alone.
  subroutine add_depth(sub, part, depth, largest_violation, own, sinks)
    type(subproblem_t), intent(in) :: sub
    type(level_part_t), intent(in) :: part
    integer, intent(in) :: depth
    real(dp), intent(in) :: largest_violation
    real(dp), intent(inout), contiguous :: own(:, :), sinks(:)
    real(dp) :: force, power
    integer :: c, k, upper, lower

    do k = part%first(depth), part%first(depth + 1) - 1
      c = part%contact(k)
      upper = upper_of(c)
      lower = sub%pair(1, c) + sub%pair(2, c) - upper
      force = abs(sub%impulse(lane_of(c), 1, block_of(c)))
      power = part%power(lane_of(c), block_of(c))
      own(1, upper) = own(1, upper) + force
      own(2, upper) = own(2, upper) + force*sinks(lower) + sign(min(abs(power), force*largest_violation), power)/cosine
    end do
    do k = part%first(depth), part%first(depth + 1) - 1
      upper = upper_of(part%contact(k))
      sinks(upper) = mean_of(own(:, upper))
    end do

  contains

    pure integer function upper_of(contact) result(upper)
      integer, intent(in) :: contact
      upper = sub%pair(1, contact)
      if (part%depth(upper) /= depth) upper = sub%pair(2, contact)
    end function upper_of

  end subroutine add_depth

  !> e_b from its sums [m/s].
  pure real(dp) function mean_of(sums) result(mean)
    real(dp), intent(in), contiguous :: sums(:)
    mean = 0.0_dp
    if (sums(1) > 0.0_dp) mean = sums(2)/sums(1)
  end function mean_of

end module gravier_levels
