!> The interface that a partition makes: which bodies several subdomains share, their plan of exchange, and its figures.
module gravier_interface
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort, argsort_rows, find_sorted
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_shared_exchange, only: shared_part_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: interface_statistics_t, find_interface, count_figures, n_multiplicities

  !> multiplicities counted apart; the last counts that many and more
  integer, parameter :: n_multiplicities = 8

  !> The interface that a partition makes, over all subdomains.
  type :: interface_statistics_t
    !> bodies that carry contacts in several subdomains
    integer(i8) :: bodies = 0
    !> contacts between grains whose centres lie in different subdomains
    integer(i8) :: interactions = 0
    !> bodies in contact by multiplicity
    integer(i8) :: multiplicity(n_multiplicities) = 0
    !> contacts in the fullest and the emptiest subdomain
    integer(i8) :: most_contacts = 0, least_contacts = 0
    !> what one exchange takes, were every subdomain on a rank of its own: messages and numbers of all subdomains together,
    !> and of those with most
    integer(i8) :: neighbours = 0, values = 0, most_neighbours = 0, most_values = 0
    !> ghosts of all subdomains
    integer(i8) :: ghosts = 0
    !> pairs of pieces of bodies with shapes whose cores overlap
    integer(i8) :: overlapping_cores = 0
    !> points in which bodies touch, but for which their pairs have no place
    integer(i8) :: points_left_out = 0
    !> contacts whose intact bond is stretched
    integer(i8) :: stretched_bonds = 0
  end type interface_statistics_t

  !> Columns of a subproblem by what else is known of a body.
  type :: columns_t
    !> column of each grain owned by the subdomain, 0 where no contact touches it
    integer, allocatable :: at_home(:)
    !> columns of the other bodies, and their identifiers, ascending
    integer, allocatable :: away(:)
    integer(i8), allocatable :: away_id(:)
  contains
    procedure :: init => columns_init
  end type columns_t

contains

  !> Find out which subdomains hold a copy of each body: every subdomain tells the owner of a grain owned elsewhere that it
  !> touches it, and so of boundaries that forces move; the owner tells all of them, itself included, of each other. Most
  !> grains are touched by their owner only, and are in no record. Collective.
  subroutine find_interface(decomposition, problem)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    integer(i8), allocatable :: records(:, :), received(:, :), answers(:, :)
    integer, allocatable :: destination(:)
    type(shared_part_t), allocatable :: part(:)
    type(columns_t) :: columns(size(problem%sub))
    integer :: s, b, n, round

    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          if (round == 1) call columns(s)%init(sub, decomposition%owned(s)%n)
          do b = 1, sub%n_bodies
            if (b <= sub%n_grains) then
              if (sub%place(b) > 0) cycle
            end if
            n = n + 1
            if (round == 1) cycle
            records(1, n) = sub%id(b)
            records(2, n) = sub%subdomain
            records(3, n) = merge(sub%owner(b), 0, b <= sub%n_grains)
            destination(n) = decomposition%comm%rank_of(sub%owner(b), decomposition%n_subdomains)
          end do
        end associate
      end do
      if (round == 1) allocate (records(3, n), destination(n))
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    call add_owners(decomposition, columns, received)
    call answer_sharers(decomposition, received, answers, destination)
    call sparse_exchange(decomposition%comm, answers, destination, received)
    allocate (part(size(problem%sub)))
    call sort_out_sharers(received, decomposition, columns, problem%sub, part)
    do s = 1, size(part)
      call number_shared_first(problem%sub(s), part(s)%body(1:part(s)%n_shared))
    end do
    call problem%shared%init(decomposition%comm, part, decomposition%n_subdomains, problem%nv)
  end subroutine find_interface

  subroutine columns_init(self, sub, n_home)
    class(columns_t), intent(inout) :: self
    type(subproblem_t), intent(in) :: sub
    !> grains owned by the subdomain
    integer, intent(in) :: n_home
    integer, allocatable :: away(:), order(:)
    integer :: b, n

    allocate (self%at_home(n_home), source=0)
    n = 0
    do b = 1, sub%n_grains
      if (sub%place(b) > 0) then
        self%at_home(sub%place(b)) = b
      else
        n = n + 1
      end if
    end do
    n = n + sub%n_bodies - sub%n_grains
    allocate (self%away(n), self%away_id(n), away(n), order(n))
    n = 0
    do b = 1, sub%n_bodies
      if (b <= sub%n_grains) then
        if (sub%place(b) > 0) cycle
      end if
      n = n + 1
      away(n) = b
      self%away_id(n) = sub%id(b)
    end do
    call argsort(self%away_id, order)
    do n = 1, size(order)
      self%away(n) = away(order(n))
      self%away_id(n) = sub%id(self%away(n))
    end do
  end subroutine columns_init

  !> Add the touches of owners to those (body, subdomain, owner) of others.
  subroutine add_owners(decomposition, columns, touches)
    type(decomposition_t), intent(in) :: decomposition
    type(columns_t), intent(in) :: columns(:)
    !> (3, n)
    integer(i8), allocatable, intent(inout) :: touches(:, :)
    integer(i8), allocatable :: longer(:, :)
    integer(i8) :: key(2)
    integer, allocatable :: order(:)
    integer :: k, n, h, place

    allocate (longer(3, 2*size(touches, 2)), order(size(touches, 2)))
    n = size(touches, 2)
    longer(:, 1:n) = touches
    call argsort_rows(touches, order)
    do k = 1, size(order)
      associate (touch => touches(:, order(k)))
        if (touch(3) == 0) cycle
        if (k > 1) then
          if (touches(1, order(k - 1)) == touch(1)) cycle
        end if
        key(1) = touch(3)
        key(2) = touch(1)
        call decomposition%find_owned(key, h, place)
        if (columns(h)%at_home(place) == 0) cycle
        n = n + 1
        longer(1, n) = touch(1)
        longer(2:3, n) = touch(3)
      end associate
    end do
    touches = longer(:, 1:n)
  end subroutine add_owners

  !> Of the touches (body, subdomain, owner) of the bodies of this rank, tell each subdomain of a shared grain of all
  !> sharers: records (subdomain told, grain, sharer).
  subroutine answer_sharers(decomposition, touches, answers, destination)
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), intent(in), contiguous :: touches(:, :)
    integer(i8), allocatable, intent(out) :: answers(:, :)
    integer, allocatable, intent(out) :: destination(:)
    integer, allocatable :: order(:)
    integer :: k, last, a, b, n, round

    allocate (order(size(touches, 2)))
    call argsort_rows(touches, order)
    do round = 1, 2
      n = 0
      k = 1
      do while (k <= size(order))
        last = k
        do while (last < size(order))
          if (touches(1, order(last + 1)) /= touches(1, order(k))) exit
          last = last + 1
        end do
        if (last > k) then
          do a = k, last
            do b = k, last
              n = n + 1
              if (round == 1) cycle
              answers(1, n) = touches(2, order(a))
              answers(2, n) = touches(1, order(a))
              answers(3, n) = touches(2, order(b))
              destination(n) = decomposition%comm%rank_of(narrow(touches(2, order(a))), decomposition%n_subdomains)
            end do
          end do
        end if
        k = last + 1
      end do
      if (round == 1) allocate (answers(3, n), destination(n))
    end do
  end subroutine answer_sharers

  !> Write the sharers of each subdomain of this rank into its part of the exchange, by ascending identifier.
  subroutine sort_out_sharers(received, decomposition, columns, sub, part)
    !> (subdomain told, body, sharer)
    integer(i8), intent(in), contiguous :: received(:, :)
    type(decomposition_t), intent(in) :: decomposition
    type(columns_t), intent(in) :: columns(:)
    type(subproblem_t), intent(inout) :: sub(:)
    type(shared_part_t), intent(inout) :: part(:)
    integer, allocatable :: order(:)
    integer :: s, k, last

    allocate (order(size(received, 2)))
    call argsort_rows(received, order)
    k = 1
    do s = 1, size(part)
      last = k - 1
      do while (last < size(order))
        if (received(1, order(last + 1)) /= sub(s)%subdomain) exit
        last = last + 1
      end do
      part(s)%subdomain = sub(s)%subdomain
      associate (owned => decomposition%owned(s))
        call fill_part(received, order(k:last), owned%id(1:owned%n), columns(s), sub(s), part(s))
      end associate
      k = last + 1
    end do
  end subroutine sort_out_sharers

  subroutine fill_part(received, order, home_id, columns, sub, part)
    integer(i8), intent(in), contiguous :: received(:, :)
    !> places in `received` of the records of this subdomain, by body and sharer
    integer, intent(in), contiguous :: order(:)
    !> identifiers of the grains owned here, ascending
    integer(i8), intent(in), contiguous :: home_id(:)
    type(columns_t), intent(in) :: columns
    type(subproblem_t), intent(inout) :: sub
    type(shared_part_t), intent(inout) :: part
    integer(i8) :: id
    integer :: k, place

    allocate (part%body(size(order)), part%first(size(order) + 1), part%sharer(size(order)))
    part%n_shared = 0
    id = -1
    do k = 1, size(order)
      if (received(2, order(k)) /= id) then
        id = received(2, order(k))
        part%n_shared = part%n_shared + 1
        place = find_sorted(columns%away_id, id)
        if (place > 0) then
          part%body(part%n_shared) = columns%away(place)
        else
          part%body(part%n_shared) = columns%at_home(find_sorted(home_id, id))
        end if
        part%first(part%n_shared) = k
      end if
      part%sharer(k) = narrow(received(3, order(k)))
    end do
    part%first(part%n_shared + 1) = size(order) + 1
    do k = 1, part%n_shared
      sub%multiplicity(part%body(k)) = part%first(k + 1) - part%first(k)
    end do
  end subroutine fill_part

  !> Give the shared grains the first numbers, in the order of the exchange, so that it reads and writes their velocities in a
  !> row. The others keep their order.
  subroutine number_shared_first(sub, shared)
    type(subproblem_t), intent(inout) :: sub
    !> numbers of the shared bodies; boundaries among them keep theirs
    integer, intent(inout), contiguous :: shared(:)
    integer :: number(sub%n_columns), grain(sub%n_grains)
    integer :: b, c, k, n

    if (size(shared) == 0) return
    number(:) = 0
    n = 0
    do k = 1, size(shared)
      if (shared(k) <= sub%n_grains) call give_number(shared(k))
    end do
    do b = 1, sub%n_grains
      if (number(b) == 0) call give_number(b)
    end do
    do b = sub%n_grains + 1, sub%n_columns
      number(b) = b
    end do
    do k = 1, size(shared)
      shared(k) = number(shared(k))
    end do
    do c = 1, sub%n_contacts
      sub%pair(1, c) = number(sub%pair(1, c))
      sub%pair(2, c) = number(sub%pair(2, c))
    end do
    call sub%reorder_grains(grain)

  contains

    subroutine give_number(b)
      integer, intent(in) :: b

      n = n + 1
      number(b) = n
      grain(n) = b
    end subroutine give_number

  end subroutine number_shared_first

  !> Count the contacts of all subdomains, and the interface. Each body is counted in the first of the subdomains that share it.
  !> Collective.
  subroutine count_figures(decomposition, views, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: views(:)
    type(contact_problem_t), intent(inout) :: problem
    type(interface_statistics_t), intent(out) :: figures
    integer(i8) :: counts(n_multiplicities + 8)
    real(dp) :: extremes(4)
    integer :: s, c, k, m

    counts(:) = 0
    extremes(:) = 0.0_dp
    extremes(2) = -huge(1.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => problem%shared%part(s))
        ! bodies that are shared stand once, and others have one copy
        counts(1) = counts(1) + sub%n_bodies - part%n_shared
        do k = 1, part%n_shared
          if (part%copy_rank(k) > 1) cycle
          m = min(sub%multiplicity(part%body(k)), n_multiplicities)
          counts(m) = counts(m) + 1
        end do
        do c = 1, merge(sub%n_contacts, 0, problem%n_subdomains > 1)
          if (any(sub%pair(:, c) > sub%n_grains)) cycle
          if (sub%owner(sub%pair(1, c)) /= sub%owner(sub%pair(2, &
            & c))) counts(n_multiplicities + 1) = counts(n_multiplicities + 1) + 1
        end do
        counts(n_multiplicities + 2) = counts(n_multiplicities + 2) + sub%n_contacts
        extremes(1) = max(extremes(1), real(sub%n_contacts, dp))
        extremes(2) = max(extremes(2), -real(sub%n_contacts, dp))
        counts(n_multiplicities + 3) = counts(n_multiplicities + 3) + size(part%neighbour)
        counts(n_multiplicities + 4) = counts(n_multiplicities + 4) + int(part%n_slots, i8)*problem%shared%width
        counts(n_multiplicities + 5) = counts(n_multiplicities + 5) + count(views(s)%origin == 0)
        extremes(3) = max(extremes(3), real(size(part%neighbour), dp))
        extremes(4) = max(extremes(4), real(part%n_slots, dp)*problem%shared%width)
        counts(n_multiplicities + 6) = counts(n_multiplicities + 6) + sub%overlapping_cores
        counts(n_multiplicities + 7) = counts(n_multiplicities + 7) + sub%stretched_bonds
        counts(n_multiplicities + 8) = counts(n_multiplicities + 8) + sub%points_left_out
      end associate
    end do
    call decomposition%comm%sum_counts(counts)
    call decomposition%comm%highest_of(extremes)
    figures%multiplicity(:) = counts(1:n_multiplicities)
    figures%bodies = sum(counts(2:n_multiplicities))
    figures%interactions = counts(n_multiplicities + 1)
    figures%overlapping_cores = counts(n_multiplicities + 6)
    figures%stretched_bonds = counts(n_multiplicities + 7)
    figures%points_left_out = counts(n_multiplicities + 8)
    figures%most_contacts = nint(extremes(1), i8)
    figures%least_contacts = nint(-extremes(2), i8)
    figures%neighbours = counts(n_multiplicities + 3)
    figures%values = counts(n_multiplicities + 4)
    figures%ghosts = counts(n_multiplicities + 5)
    figures%most_neighbours = nint(extremes(3), i8)
    figures%most_values = nint(extremes(4), i8)
    problem%n_contacts = counts(n_multiplicities + 2)
  end subroutine count_figures

end module gravier_interface
