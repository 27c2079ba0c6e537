!> Which pairs are looked at while some bodies sleep, and what wakes these: impulses that would move them, a boundary that begins to
!> move, impulses that change. All wake where gravity or the load of a boundary changes (gravier_sleeping has the rule).
module gravier_waking
  use gravier_kinds, only: dp, i8
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_contact_problem, only: contact_problem_t
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_removal, only: some_leave, find_staying
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_physics, only: physics_t
  use gravier_body_store, only: body_set_t
  use gravier_body_mass, only: add_inverse_mass
  use gravier_pair_laws, only: boundary_of
  use gravier_borne_impulses, only: contacts_t, impulses_t, find_borne
  use gravier_sleeping, only: sleeping_rule_t, may_push, momentum_of
  implicit none
  private
  public :: resting_t, watch_step, watch_awake, wake_disturbed, wake_left_behind, wake_all

  !> momentum of a sleeping body, over that which wakes it, from which on its impulses count as changed
  real(dp), parameter :: unnoticed = 1.0e-3_dp
  !> numbers of steps at rest until a body sleeps, after which all wake if impulses on some have changed
  integer, parameter :: rounds = 10

  !> What is left out of a problem.
  type :: resting_t
    !> bodies that sleep; contacts between them, or between them and boundaries
    integer(i8) :: bodies = 0, contacts = 0
  end type resting_t

  !> One of each body of a view.
  type :: marks_t
    logical, allocatable :: of(:)
  end type marks_t

contains

  !> Find the pairs to look at in a new step, in views that are up to date. Collective.
  subroutine watch_step(rule, step, decomposition, halo, resting)
    type(sleeping_rule_t), intent(in) :: rule
    !> that is to be made
    integer, intent(in) :: step
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(resting_t), intent(out) :: resting

    call wake_stirred(rule, step, decomposition, halo)
    call watch_awake(decomposition, halo, resting)
  end subroutine watch_step

  !> Find the pairs to look at, in views that are up to date. What sleeps near boundaries that move wakes. Collective.
  subroutine watch_awake(decomposition, halo, resting)
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(resting_t), intent(out) :: resting
    type(marks_t) :: exposed(size(halo%view))
    integer(i8) :: counts(2)
    integer :: s
    logical :: some

    some = .false.
    do s = 1, size(halo%view)
      if (allocated(halo%view(s)%asleep) .and. any(begins(decomposition%boundaries))) deallocate (halo%view(s)%asleep)
      call watch(decomposition%boundaries, halo%view(s), exposed(s)%of)
      some = some .or. any(exposed(s)%of)
    end do
    if (decomposition%comm%any_true(some)) then
      call wake_marked(decomposition, halo, exposed)
      do s = 1, size(halo%view)
        call watch(decomposition%boundaries, halo%view(s), exposed(s)%of)
      end do
    end if
    counts(:) = 0
    do s = 1, size(halo%view)
      counts(1) = counts(1) + count(decomposition%owned(s)%wakes_at > 0.0_dp)
      counts(2) = counts(2) + halo%view(s)%n_resting
    end do
    call decomposition%comm%sum_counts(counts)
    resting%bodies = counts(1)
    resting%contacts = counts(2)
  end subroutine watch_awake

  !> Whether a boundary that was at rest begins to move, but for what forces make of it.
  pure elemental logical function begins(boundary)
    type(boundary_t), intent(in) :: boundary
    begins = boundary%is_moved() .and. .not. (any(abs(boundary%last_velocity) > 0.0_dp .and. .not. boundary%free) .or. &
      & any(abs(boundary%last_spin) > 0.0_dp))
  end function begins

  !> The pairs of a view to look at, where others sleep now than before: those with a grain that is awake. A grain that sleeps is
  !> not looked at beside boundaries, which are at rest or expose it.
  subroutine watch(boundaries, view, exposed)
    type(boundary_t), intent(in) :: boundaries(:)
    type(local_bodies_t), intent(inout) :: view
    !> (bodies) sleeping grains near boundaries that move
    logical, allocatable, intent(out) :: exposed(:)
    integer, allocatable :: watched(:)
    logical :: asleep(view%n_bodies()), sleeps_i, sleeps_j
    integer :: p, n, b

    allocate (exposed(view%n_bodies()), source=.false.)
    asleep(:) = view%bodies%wakes_at > 0.0_dp
    if (allocated(view%asleep)) then
      if (all(asleep .eqv. view%asleep)) return
    end if
    view%asleep = asleep
    view%n_resting = 0
    associate (list => view%list)
      if (allocated(list%watched)) deallocate (list%watched)
      if (.not. any(asleep)) then
        list%state(list%memory%touch_row, :) = 0
        return
      end if
      allocate (watched(list%n))
      n = 0
      do p = 1, list%n
        sleeps_i = asleep(list%candidate(p))
        sleeps_j = .false.
        if (list%antagonist(p) > 0) sleeps_j = asleep(list%antagonist(p))
        b = boundary_of(view, p)
        if (.not. (sleeps_i .or. sleeps_j)) list%state(list%memory%touch_row, p) = 0
        if ((sleeps_i .and. sleeps_j) .or. ((sleeps_i .or. sleeps_j) .and. b > 0)) then
          view%n_resting = view%n_resting + list%state(list%memory%touch_row, p)
          if (b == 0) cycle
          if (.not. may_push(boundaries(b))) cycle
          if (sleeps_i) exposed(list%candidate(p)) = .true.
          if (sleeps_j) exposed(list%antagonist(p)) = .true.
        else
          n = n + 1
          watched(n) = p
        end if
      end do
      allocate (list%watched(n))
      list%watched(:) = watched(1:n)
    end associate
  end subroutine watch

  !> Wake the bodies that the impulses of a solve and those left out would move, and those around them. Collective.
  subroutine wake_disturbed(decomposition, halo, physics, problem, rings, woken)
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(physics_t), intent(in) :: physics
    !> solved
    type(contact_problem_t), intent(in) :: problem
    !> how many neighbours away
    integer, intent(in) :: rings
    !> whether some body was woken; views and pairs to look at are those of before where none was
    logical, intent(out) :: woken
    type(contacts_t) :: every(size(problem%sub))
    type(impulses_t) :: borne(size(decomposition%owned))
    type(marks_t) :: around(size(halo%view))
    integer :: s, ring

    do s = 1, size(problem%sub)
      allocate (every(s)%are(problem%sub(s)%n_contacts), source=.true.)
    end do
    call find_borne(decomposition, halo%view, problem, every, .false., borne)
    call wake_moved(decomposition, physics, problem%nw, borne, woken)
    woken = decomposition%comm%any_true(woken)
    if (.not. woken) return
    call halo%refresh(decomposition)
    do ring = 1, rings
      do s = 1, size(halo%view)
        call mark_neighbours(halo%view(s), around(s)%of)
      end do
      call wake_marked(decomposition, halo, around)
    end do
  end subroutine wake_disturbed

  !> Wake the grains of this rank that would get too large a momentum. Those are asked on which an impulse has changed.
  subroutine wake_moved(decomposition, physics, nw, borne, woken)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    !> rows of an inverse mass
    integer, intent(in) :: nw
    !> impulses of the contacts that were solved
    type(impulses_t), intent(in) :: borne(:)
    logical, intent(out) :: woken
    real(dp) :: momentum
    integer :: s, k
    logical :: touched

    woken = .false.
    do s = 1, size(borne)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          touched = any(abs(borne(s)%on(:, k)) > 0.0_dp)
          if (.not. owned%sleeps(k) .or. (owned%steady(k) .and. .not. touched)) cycle
          momentum = momentum_under(owned, k, borne(s)%on(:, k))
          if (momentum > owned%wakes_at(k)) then
            call owned%wake(k)
            woken = .true.
          else
            ! what touches it now may be gone in the next step
            owned%steady(k) = .not. touched
            if (momentum > unnoticed*owned%wakes_at(k)) owned%stirred(k) = 1
          end if
        end do
      end associate
    end do

  contains

    !> Momentum that grain `k` would get from loads, from these impulses and from those of the contacts that are left out [N s].
    pure real(dp) function momentum_under(bodies, k, impulse) result(momentum)
      type(body_set_t), intent(in) :: bodies
      integer, intent(in) :: k
      !> (nv)
      real(dp), intent(in) :: impulse(:)
      real(dp), dimension(size(impulse)) :: v, total
      real(dp) :: inverse(nw)

      v(:) = 0.0_dp
      total(:) = bodies%held(1:size(v), k) + impulse
      call physics%accelerate(decomposition%figures, bodies, k, v)
      call physics%find_inverse_mass(decomposition%figures, bodies, k, inverse)
      call add_inverse_mass(inverse, total, v)
      momentum = momentum_of(v, bodies%nd, bodies%radius(k), 1.0_dp/bodies%mass(k))
    end function momentum_under

  end subroutine wake_moved

  !> Wake what sleeps beside grains that are about to leave the scene, if some are, in views that are up to date. Collective.
  subroutine wake_left_behind(decomposition, halo)
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(marks_t) :: around(size(halo%view))
    logical, allocatable :: stays(:)
    integer :: s, p, i, j

    if (.not. some_leave(decomposition)) return
    do s = 1, size(halo%view)
      associate (view => halo%view(s))
        call find_staying(decomposition, view%bodies, stays)
        allocate (around(s)%of(view%n_bodies()), source=.false.)
        do p = 1, view%list%n
          call view%find_ends(p, i, j)
          if (j < 0) cycle
          if (stays(i) .eqv. stays(j)) cycle
          if (view%bodies%sleeps(i)) around(s)%of(i) = .true.
          if (view%bodies%sleeps(j)) around(s)%of(j) = .true.
        end do
      end associate
    end do
    call wake_marked(decomposition, halo, around)
  end subroutine wake_left_behind

  !> Mark what sleeps beside a body that has just woken.
  subroutine mark_neighbours(view, around)
    type(local_bodies_t), intent(in) :: view
    !> (bodies)
    logical, allocatable, intent(out) :: around(:)
    logical :: woken(view%n_bodies())
    integer :: p, i, j

    allocate (around(view%n_bodies()), source=.false.)
    woken(:) = view%asleep .and. .not. view%bodies%wakes_at > 0.0_dp
    if (.not. any(woken)) return
    do p = 1, view%list%n
      call view%find_ends(p, i, j)
      if (j < 0) cycle
      if (woken(i) .and. view%bodies%sleeps(j)) around(j) = .true.
      if (woken(j) .and. view%bodies%sleeps(i)) around(i) = .true.
    end do
  end subroutine mark_neighbours

  !> Wake bodies that subdomains see, and bring the views up to date. Collective.
  subroutine wake_marked(decomposition, halo, marked)
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(marks_t), intent(in) :: marked(:)
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: s, k, n, h, place

    n = 0
    do s = 1, size(marked)
      n = n + count(marked(s)%of)
    end do
    allocate (records(2, n), destination(n))
    n = 0
    do s = 1, size(marked)
      associate (view => halo%view(s))
        do k = 1, view%n_bodies()
          if (.not. marked(s)%of(k)) cycle
          n = n + 1
          destination(n) = decomposition%comm%rank_of(view%owner(k), decomposition%n_subdomains)
          records(1, n) = view%owner(k)
          records(2, n) = view%bodies%id(k)
        end do
      end associate
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    do k = 1, size(received, 2)
      call decomposition%find_owned(received(1:2, k), h, place)
      call decomposition%owned(h)%wake(place)
    end do
    call halo%refresh(decomposition)
  end subroutine wake_marked

  !> Every `rounds` times `after` steps, if impulses on bodies that sleep have changed: wake all, in views that are up to date.
  !> Changes that wake no single body then go on to all that bear them, and contacts that yield have the time to do so. Collective.
  subroutine wake_stirred(rule, step, decomposition, halo)
    type(sleeping_rule_t), intent(in) :: rule
    !> that is to be made
    integer, intent(in) :: step
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    integer :: s
    logical :: some

    if (modulo(step, rule%after) /= 0 .or. modulo(step/rule%after, rounds) /= 0) return
    some = .false.
    do s = 1, size(decomposition%owned)
      some = some .or. any(decomposition%owned(s)%stirred > 0)
    end do
    if (.not. decomposition%comm%any_true(some)) return
    call wake_all(decomposition)
    call halo%refresh(decomposition)
  end subroutine wake_stirred

  !> Wake all bodies of this rank; views are to be brought up to date.
  pure subroutine wake_all(decomposition)
    type(decomposition_t), intent(inout) :: decomposition
    integer :: s, k

    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        call decomposition%owned(s)%wake(k)
      end do
    end do
  end subroutine wake_all

end module gravier_waking
