!> Bodies that sleep: they stand still, and leave the contact problem, until something disturbs them.
!>
!> Let l be the lesser of `speed` times the root mean square of all impulses and of a `share` of the sum S of the normal impulses
!> on a grain. The grain is at rest in a step where the momentum left to it, m (|v| + R |w|), is at most l/2, and the changes of the
!> normal impulses on it since the last step at most a `settled` share of S. Where some law attracts, the momentum is at most
!> `share` times the sum H r of the contacts' impulses on it too, which is all that holds a body up: those that cling to each other
!> press each other with more. Impulses of a boundary that moves count as changed. A step counts where the grains that it touches
!> are at rest too. A grain that has counted half of `after` steps stands still: what the impulses of solves do not balance would
!> else add up, step by step. After `after` steps it sleeps. Errors of solves go to and fro, and what carries a grain does not:
!> before a grain stands still its mean velocity over the steps that it has counted is at most a `wandering` share of the velocity
!> error that solves may leave, or it counts anew.
!>
!> Contacts between grains that sleep, or with boundaries at rest, leave the problem with the impulses that they have. Contacts with
!> grains that are awake stay: there the sleeper is a body that cannot move. Where the impulses of a solve and those that were left
!> out would together give it a momentum of more than the l of the step in which it fell asleep, it wakes with those around it, and
!> the step is solved anew. Changes that wake none are marked, and all wake some steps later (gravier_waking). See doc/theory.md,
!> section 12.
module gravier_sleeping
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_body_mass, only: inverse_of_translation, multiply_mass
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_velocity_return, only: find_senders
  use gravier_borne_impulses, only: contacts_t, find_seen, leave_out
  implicit none
  private
  public :: sleeping_rule_t, count_rest, may_push, momentum_of

  !> momentum of a body at rest with what may change while it sleeps, and changes of the impulses on it in a step, over the normal
  !> impulses on it
  real(dp), parameter :: share = 0.1_dp, settled = 0.05_dp
  !> the same momentum over that of the velocity which boundaries impose: a body that a slow boundary carries is not at rest
  real(dp), parameter :: share_of_drive = 0.2_dp
  !> mean velocity of a body that may stand still, over the accepted velocity error
  real(dp), parameter :: wandering = 0.03_dp

  !> What the contacts of the bodies of a subdomain say.
  type :: rest_t
    !> sums over contacts: normal impulses, and by how much they have changed [N s]; contacts with bodies that are not at rest
    !> (nv, n_columns)
    real(dp), allocatable :: sums(:, :), restless(:, :)
    !> whether each column is at rest (n_columns)
    logical, allocatable :: rests(:)
    !> steps at rest, with this one (n_grains); places in the view (n_columns)
    integer, allocatable :: steps(:), seen(:)
    !> what the step leaves to the grains: momenta of those that fall asleep [N s, N m s], velocities of others (nv, n_grains)
    real(dp), allocatable :: left(:, :)
  end type rest_t

  type :: sleeping_rule_t
    !> steps at rest after which a body sleeps; 0: none does
    integer :: after = 0
    !> twice the largest momentum of a body at rest over the root mean square of the impulses
    real(dp) :: speed = 0.0_dp
    !> accepted velocity error over its scale
    real(dp) :: accuracy = 0.0_dp
  end type sleeping_rule_t

contains

  !> Whether a boundary moves or forces may move it, so that nothing near it sleeps.
  pure elemental logical function may_push(boundary)
    type(boundary_t), intent(in) :: boundary
    may_push = boundary%is_moved() .or. boundary%is_driven()
  end function may_push

  !> Count the steps at rest of the grains of a solved problem, before its impulses are kept; those that fall asleep get the
  !> momentum that wakes them, and bear the contacts that are left out from now on. Grains that are in no contact start anew.
  !> Collective.
  subroutine count_rest(rule, stops, views, problem, decomposition)
    type(sleeping_rule_t), intent(in) :: rule
    !> grains may come to stand still: v_global of those at rest becomes zero
    logical, intent(in) :: stops
    type(local_bodies_t), intent(inout) :: views(:)
    !> v_global is evaluated, and `reaction` what it is evaluated with
    type(contact_problem_t), intent(inout) :: problem
    type(decomposition_t), intent(inout) :: decomposition
    type(rest_t) :: rest(size(problem%sub))
    type(contacts_t) :: leaving(size(problem%sub))
    integer :: s, b

    do s = 1, size(problem%sub)
      call sum_impulses(decomposition%boundaries, views(s)%list, problem%sub(s), problem%nv, rest(s)%sums)
      call problem%shared%load(s, rest(s)%sums)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, rest(s)%sums, mean=.false.)
      call find_rest(rule, decomposition%boundaries, problem, s, rest(s))
      call problem%shared%load(s, rest(s)%restless)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), view => views(s), own => rest(s))
        call problem%shared%sum_copies(s, own%restless, mean=.false.)
        call find_seen(view%list, sub, own%seen)
        allocate (own%steps(sub%n_grains), source=0)
        allocate (own%left(problem%nv, sub%n_grains))
        own%left(:, :) = sub%v_global(:, 1:sub%n_grains)
        do b = 1, sub%n_grains
          if (.not. own%rests(b) .or. own%restless(1, b) > 0.0_dp) cycle
          own%steps(b) = min(view%bodies%rest(own%seen(b)) + 1, merge(rule%after, rule%after - 1, stops))
          if (own%steps(b) >= rule%after) call multiply_mass(sub%inverse_mass(:, b), sub%inverse_mass(:, b), own%left(:, b))
          if (stops .and. 2*own%steps(b) >= rule%after) sub%v_global(:, b) = 0.0_dp
        end do
        call find_leaving(sub, rule%after, own%steps, leaving(s)%are)
      end associate
    end do
    call bring_home(rule, problem, rest, decomposition)
    call leave_out(problem, leaving, views, decomposition)
  end subroutine count_rest

  !> l [N s]: twice the momentum that a body at rest may have, and that which wakes it.
  pure real(dp) function waking_momentum(rule, problem, pressing, mass)
    type(sleeping_rule_t), intent(in) :: rule
    type(contact_problem_t), intent(in) :: problem
    !> normal impulses on the body [N s], its mass [kg]
    real(dp), intent(in) :: pressing, mass
    waking_momentum = min(rule%speed*problem%impulse_scale, share*pressing, carried_momentum(problem, mass))
  end function waking_momentum

  !> Momentum that a body has where boundaries or the cell carry it, as far as that matters; huge where they do not move [N s].
  pure real(dp) function carried_momentum(problem, mass)
    type(contact_problem_t), intent(in) :: problem
    !> [kg]
    real(dp), intent(in) :: mass
    carried_momentum = huge(1.0_dp)
    if (problem%drive_scale < huge(1.0_dp)) carried_momentum = share_of_drive*mass*problem%drive_scale
  end function carried_momentum

  !> Sums over the contacts of each body of a subdomain: normal impulses, and by how much they have changed since the step before.
  subroutine sum_impulses(boundaries, list, sub, nv, sums)
    type(boundary_t), intent(in) :: boundaries(:)
    type(neighbour_list_t), intent(in) :: list
    type(subproblem_t), intent(in) :: sub
    !> degrees of freedom of a body, those of an exchange
    integer, intent(in) :: nv
    !> (nv, n_columns)
    real(dp), allocatable, intent(out) :: sums(:, :)
    real(dp) :: r, change
    integer :: c, k

    allocate (sums(nv, sub%n_columns), source=0.0_dp)
    do c = 1, sub%n_contacts
      r = sub%impulse(lane_of(c), 1, block_of(c))
      change = abs(r - list%impulse(1, sub%source(c)))
      do k = 1, 2
        if (sub%pair(k, c) <= sub%n_grains) cycle
        if (sub%boundary(sub%pair(k, c)) == 0) cycle
        if (may_push(boundaries(sub%boundary(sub%pair(k, c))))) change = r
      end do
      do k = 1, 2
        sums(1, sub%pair(k, c)) = sums(1, sub%pair(k, c)) + r
        sums(2, sub%pair(k, c)) = sums(2, sub%pair(k, c)) + change
      end do
    end do
  end subroutine sum_impulses

  !> Which bodies of subdomain `s` of this rank are at rest, and the contacts of each with others that are not.
  subroutine find_rest(rule, boundaries, problem, s, rest)
    type(sleeping_rule_t), intent(in) :: rule
    type(boundary_t), intent(in) :: boundaries(:)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> with the sums over all copies
    type(rest_t), intent(inout) :: rest
    integer :: b, c, k

    associate (sub => problem%sub(s))
      allocate (rest%rests(sub%n_columns), source=.true.)
      allocate (rest%restless, mold=rest%sums)
      rest%restless(:, :) = 0.0_dp
      do b = 1, sub%n_columns
        if (b <= sub%n_grains) then
          rest%rests(b) = rest%sums(2, b) <= settled*rest%sums(1, b) .and. &
            & is_slow(sub, problem%nd, &
            & 0.5_dp*waking_momentum(rule, problem, rest%sums(1, b), 1.0_dp/sub%inverse_mass(1, b)), b)
        else if (sub%boundary(b) > 0) then
          rest%rests(b) = .not. may_push(boundaries(sub%boundary(b)))
        end if
      end do
      do c = 1, sub%n_contacts
        do k = 1, 2
          if (.not. rest%rests(sub%pair(k, c))) rest%restless(1, sub%pair(3 - k, c)) = rest%restless(1, sub%pair(3 - k, c)) + 1.0_dp
        end do
      end do
    end associate
  end subroutine find_rest

  !> m (|v| + R |w|) of a velocity of a grain [N s].
  pure real(dp) function momentum_of(v, nd, radius, inverse) result(momentum)
    !> (nv)
    real(dp), intent(in), contiguous :: v(:)
    !> space dimension
    integer, intent(in) :: nd
    !> [m], [1/kg]
    real(dp), intent(in) :: radius, inverse
    momentum = (norm2(v(1:nd)) + radius*norm2(v(nd + 1:)))/inverse
  end function momentum_of

  !> Whether the momentum of grain `b` is small, beside what acts on it.
  pure logical function is_slow(sub, nd, limit, b)
    type(subproblem_t), intent(in) :: sub
    !> space dimension
    integer, intent(in) :: nd
    !> of the momentum [N s]
    real(dp), intent(in) :: limit
    integer, intent(in) :: b
    real(dp) :: momentum, reaction(nd)
    integer :: d

    momentum = momentum_of(sub%v_global(:, b), nd, sub%radius(b), inverse_of_translation(sub%inverse_mass(:, b), nd))
    is_slow = limit > 0.0_dp .and. momentum <= limit
    if (.not. allocated(sub%attraction_load)) return
    do d = 1, nd
      reaction(d) = sub%contact_reaction(d, b)
    end do
    is_slow = is_slow .and. momentum <= share*norm2(reaction)
  end function is_slow

  !> Contacts all of whose grains sleep from now on.
  pure subroutine find_leaving(sub, after, steps, leaving)
    type(subproblem_t), intent(in) :: sub
    !> steps at rest after which a body sleeps; steps at rest (n_grains)
    integer, intent(in) :: after
    integer, intent(in), contiguous :: steps(:)
    !> (n_contacts)
    logical, allocatable, intent(out) :: leaving(:)
    integer :: c, k

    allocate (leaving(sub%n_contacts), source=.true.)
    do c = 1, sub%n_contacts
      do k = 1, 2
        ! the others sleep already, or are boundaries
        if (sub%pair(k, c) <= sub%n_grains) leaving(c) = leaving(c) .and. steps(sub%pair(k, c)) >= after
      end do
    end do
  end subroutine find_leaving

  !> Bring steps at rest, the momenta that wake and what is left to the owners of the grains, in this subdomain by their places, in
  !> others by records (owner, grain, steps, momentum, what is left). Collective.
  subroutine bring_home(rule, problem, rest, decomposition)
    type(sleeping_rule_t), intent(in) :: rule
    type(contact_problem_t), intent(in) :: problem
    type(rest_t), intent(in) :: rest(:)
    type(decomposition_t), intent(inout) :: decomposition
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    logical, allocatable :: sends(:)
    real(dp) :: left(problem%nv)
    integer :: s, b, k, r, h, place, n, round, d

    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do r = 1, owned%awake%n
          do k = owned%awake%first(r), owned%awake%last(r)
            if (.not. owned%wakes_at(k) > 0.0_dp) owned%rest(k) = 0
          end do
        end do
      end associate
    end do
    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          call find_senders(problem, s, sends)
          do b = 1, sub%n_grains
            if (round == 1 .and. sub%place(b) > 0) call put(s, sub%place(b), rest(s)%steps(b), waking(s, b), rest(s)%left(:, b))
            if (.not. sends(b)) cycle
            n = n + 1
            if (round == 1) cycle
            destination(n) = decomposition%comm%rank_of(sub%owner(b), decomposition%n_subdomains)
            records(1, n) = sub%owner(b)
            records(2, n) = sub%id(b)
            records(3, n) = rest(s)%steps(b)
            records(4, n) = transfer(waking(s, b), 0_i8)
            do d = 1, size(left)
              records(4 + d, n) = transfer(rest(s)%left(d, b), 0_i8)
            end do
          end do
        end associate
      end do
      if (round == 1) allocate (records(4 + size(left), n), destination(n))
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    do k = 1, size(received, 2)
      call decomposition%find_owned(received(1:2, k), h, place)
      do d = 1, size(left)
        left(d) = transfer(received(4 + d, k), 0.0_dp)
      end do
      call put(h, place, narrow(received(3, k)), transfer(received(4, k), 0.0_dp), left)
    end do
    ! a cell that moves carries all grains along
    if (problem%cell_moves()) return
    do s = 1, size(decomposition%owned)
      call decomposition%owned(s)%awake%leave_out(decomposition%owned(s)%wakes_at)
    end do

  contains

    !> The momentum that wakes grain `b` of subdomain `s` of this rank, l [N s].
    pure real(dp) function waking(s, b)
      integer, intent(in) :: s, b
      waking = waking_momentum(rule, problem, rest(s)%sums(1, b), 1.0_dp/problem%sub(s)%inverse_mass(1, b))
    end function waking

    !> Set what is known of grain `place` of subdomain `h` of this rank.
    subroutine put(h, place, steps, momentum, left)
      integer, intent(in) :: h, place, steps
      !> that wakes it [N s]; what is left to it (nv) [N s, N m s], or of one that does not sleep [m/s, rad/s]
      real(dp), intent(in) :: momentum, left(:)

      decomposition%owned(h)%rest(place) = steps
      call note_motion(rule%after, rule%accuracy*problem%error_scale, place, left, decomposition%owned(h))
      if (steps < rule%after) return
      decomposition%owned(h)%wakes_at(place) = momentum
      decomposition%owned(h)%held(1:size(left), place) = -left
    end subroutine put

  end subroutine bring_home

  !> Sum up the velocities of body `k` over its steps at rest until it stands still. In the last one before that it counts anew if
  !> their mean is more than errors of solves leave.
  pure subroutine note_motion(after, accepted, k, velocity, bodies)
    !> steps after which a body sleeps; it stands still from half of them on
    integer, intent(in) :: after
    !> velocity error that solves may leave [m/s]
    real(dp), intent(in) :: accepted
    integer, intent(in) :: k
    !> of the step (nv) [m/s, rad/s]
    real(dp), intent(in) :: velocity(:)
    type(body_set_t), intent(inout) :: bodies

    associate (steps => bodies%rest(k), sum_of => bodies%wandered(1:size(velocity), k))
      if (steps == 0 .or. 2*steps >= after) return
      if (steps == 1) sum_of(:) = 0.0_dp
      sum_of(:) = sum_of + velocity
      if (2*(steps + 1) < after) return
      if (momentum_of(sum_of, bodies%nd, bodies%radius(k), 1.0_dp) > steps*wandering*accepted) steps = 0
    end associate
  end subroutine note_motion

end module gravier_sleeping
