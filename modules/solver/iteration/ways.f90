!> Shortest ways from bodies to others over closed contacts, counted in contacts or in lengths, across subdomains.
!>
!> Bodies whose way has become shorter wait in a queue to hand it on to those that they touch, until none can be shortened: where
!> each contact counts the same, every body waits once (breadth-first search). The result does not depend on the order, because each
!> way is a sum from its root on; nor on subdomains or ranks. What is prescribed hands on no way but its own.
module gravier_ways
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lanes
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  implicit none
  private
  public :: ways_t, list_closed, shorten_ways, unreached

  !> length of the way of what none leads to
  real(dp), parameter :: unreached = huge(1.0_dp)
  !> a contact is closed if its shift is below `rounded` times the largest free speed, because places are rounded, or below
  !> `soon_closed` times the velocity that errors are compared with, because errors of the step before leave such gaps
  real(dp), parameter :: rounded = 1.0e-3_dp, soon_closed = 0.1_dp

  !> Of one subdomain.
  type :: ways_t
    !> length of the way of each body, `unreached` where none is known (n_columns)
    real(dp), allocatable :: length(:)
    !> contacts that press or are closed
    integer :: n_closed = 0
    !> bodies that may move: the first columns
    integer, private :: n_bodies = 0
    !> where the neighbours of each body over such contacts begin, to `first(b + 1) - 1` (n_columns + 1); these, and the lengths of
    !> the ways to them (2 n_closed)
    integer, allocatable, private :: first(:), neighbour(:)
    real(dp), allocatable, private :: step(:)
    !> bodies whose way may be shortened, and those that have one to hand on (n_columns)
    logical, allocatable, private :: open(:), waits(:)
  end type ways_t

contains

  !> List the contacts that press or are closed; no way is known yet.
  subroutine list_closed(problem, ways, unit)
    type(contact_problem_t), intent(in) :: problem
    !> of the subdomains of this rank
    type(ways_t), intent(out) :: ways(:)
    !> of lengths [m]; absent, each contact counts 1
    real(dp), intent(in), optional :: unit
    real(dp) :: closed
    integer :: s, n
    !> of the closed contacts: their bodies and lengths
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: step(:)

    closed = max(rounded*problem%velocity_scale, soon_closed*problem%error_scale)
    do s = 1, size(ways)
      associate (sub => problem%sub(s))
        allocate (ways(s)%length(sub%n_columns), source=unreached)
        allocate (ways(s)%open(sub%n_columns), ways(s)%waits(sub%n_columns), source=.false.)
        allocate (pair(2, sub%n_contacts), step(sub%n_contacts))
        n = 0
        if (sub%n_contacts > 0) call take_closed(sub, problem%nd + 1, closed, n, pair, step, unit)
        ways(s)%n_closed = n
        ways(s)%n_bodies = sub%n_bodies
        call list_by_body(pair(:, 1:n), step(1:n), ways(s))
        deallocate (pair, step)
      end associate
    end do
  end subroutine list_closed

  !> The contacts of a subdomain that press or are closed.
  pure subroutine take_closed(sub, at, closed, n, pair, step, unit)
    type(subproblem_t), intent(in) :: sub
    !> row of the contact data that holds the shift
    integer, intent(in) :: at
    !> shift below which a contact counts as closed [m/s]
    real(dp), intent(in) :: closed
    !> how many they are
    integer, intent(out) :: n
    !> their bodies (2, contacts) and lengths (contacts), the first n
    integer, intent(inout), contiguous :: pair(:, :)
    real(dp), intent(inout), contiguous :: step(:)
    !> of lengths [m]
    real(dp), intent(in), optional :: unit
    real(dp) :: length
    integer :: g, q, c, k

    n = 0
    do g = 1, size(sub%hot, 3)
      do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
        c = (g - 1)*lanes + q
        if (sub%gap(c) > 0.0_dp .and. sub%hot(q, at, g) > closed .and. .not. sub%impulse(q, 1, g) > 0.0_dp) cycle
        n = n + 1
        pair(:, n) = sub%pair(:, c)
        step(n) = 1.0_dp
        if (.not. present(unit)) cycle
        length = sub%gap(c)
        do k = 1, 2
          if (sub%pair(k, c) <= sub%n_grains) length = length + sub%radius(sub%pair(k, c))
        end do
        step(n) = max(0.0_dp, length/unit)
      end do
    end do
  end subroutine take_closed

  !> List the neighbours of each body over closed contacts, in the order of these.
  pure subroutine list_by_body(pair, step, ways)
    !> bodies of the closed contacts (2, closed contacts), and their lengths
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: step(:)
    type(ways_t), intent(inout) :: ways
    integer :: c, k, b, n

    n = size(ways%open)
    allocate (ways%first(n + 1), source=0)
    allocate (ways%neighbour(2*size(step)), ways%step(2*size(step)))
    associate (first => ways%first)
      do c = 1, size(step)
        do k = 1, 2
          first(pair(k, c)) = first(pair(k, c)) + 1
        end do
      end do
      ! the ends of all, which become their beginnings while they are filled from behind
      do b = 2, n
        first(b) = first(b) + first(b - 1)
      end do
      first(n + 1) = 2*size(step) + 1
      do b = 1, n
        first(b) = first(b) + 1
      end do
      do c = size(step), 1, -1
        do k = 1, 2
          b = pair(k, c)
          first(b) = first(b) - 1
          ways%neighbour(first(b)) = pair(3 - k, c)
          ways%step(first(b)) = step(c)
        end do
      end do
    end associate
  end subroutine list_by_body

  !> Find the ways of all bodies that have none yet, from those whose length is known. Collective.
  subroutine shorten_ways(comm, shared, ways)
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(inout) :: shared
    type(ways_t), intent(inout) :: ways(:)
    real(dp), allocatable :: field(:, :)
    integer :: s, j, b
    logical :: changed, shares

    shares = .false.
    do s = 1, size(ways)
      ways(s)%open(:) = ways(s)%length >= unreached
      ways(s)%open(ways(s)%n_bodies + 1:) = .false.
      ways(s)%waits(:) = ways(s)%length < unreached
      shares = shares .or. shared%n_shared(s) > 0
      call shorten_own(ways(s))
    end do
    if (.not. comm%any_true(shares)) return
    do
      do s = 1, size(ways)
        allocate (field(shared%width, size(ways(s)%length)), source=0.0_dp)
        field(1, :) = ways(s)%length
        call shared%load(s, field)
        deallocate (field)
      end do
      call shared%pass()
      changed = .false.
      do s = 1, size(ways)
        associate (copies => shared%part(s), this => ways(s))
          shares = .false.
          do j = 1, copies%n_slots
            b = copies%slot_body(j)
            if (.not. (this%open(b) .and. copies%recv(1, j) < this%length(b))) cycle
            this%length(b) = copies%recv(1, j)
            this%waits(b) = .true.
            shares = .true.
          end do
          if (shares) call shorten_own(this)
          changed = changed .or. shares
        end associate
      end do
      if (.not. comm%any_true(changed)) exit
    end do
  end subroutine shorten_ways

  !> Shorten ways over the contacts of a subdomain until no body waits any more.
  pure subroutine shorten_own(ways)
    type(ways_t), intent(inout) :: ways
    !> bodies that wait, in a ring
    integer :: queue(size(ways%open)), n_waiting, head, b, i, j, k
    real(dp) :: way

    n_waiting = 0
    do b = 1, size(queue)
      if (.not. ways%waits(b)) cycle
      n_waiting = n_waiting + 1
      queue(n_waiting) = b
    end do
    head = 1
    do while (n_waiting > 0)
      i = queue(head)
      ways%waits(i) = .false.
      head = merge(1, head + 1, head == size(queue))
      n_waiting = n_waiting - 1
      do k = ways%first(i), ways%first(i + 1) - 1
        j = ways%neighbour(k)
        way = ways%length(i) + ways%step(k)
        if (.not. (way < ways%length(j) .and. ways%open(j))) cycle
        ways%length(j) = way
        if (ways%waits(j)) cycle
        ways%waits(j) = .true.
        n_waiting = n_waiting + 1
        queue(modulo(head + n_waiting - 2, size(queue)) + 1) = j
      end do
    end do
  end subroutine shorten_own

end module gravier_ways
