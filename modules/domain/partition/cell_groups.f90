!> Which subdomain holds which cell: groups of subdomains with consecutive numbers, each group with a map of its cells that
!> only the ranks near it hold.
module gravier_cell_groups
  use gravier_kinds, only: i8
  use gravier_narrow, only: narrow
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_cell_map, only: cell_map_t
  implicit none
  private
  public :: cell_groups_t

  type :: group_map_t
    integer :: group = 0
    !> (length of the group): 0 where it is not known yet
    integer, allocatable :: subdomain(:)
  end type group_map_t

  !> All but the maps is the same on every rank.
  type :: cell_groups_t
    type(cell_map_t) :: cells
    integer :: n = 0
    integer, allocatable :: group_of_cell(:)
    !> (cells) whether the cell has an entry for each of its pieces in the map of its group, or one for all
    logical, allocatable :: in_pieces(:)
    !> (cells) entries before those of the cell in the map of its group
    integer, allocatable :: before(:)
    !> (n) entries of the map of each group
    integer(i8), allocatable :: length(:)
    !> (n + 1) first subdomain of each group
    integer, allocatable :: first(:)
    !> (n) place in maps, 0 for what this rank does not know
    integer, allocatable :: known(:)
    type(group_map_t), allocatable :: maps(:)
  contains
    procedure :: set => cell_groups_set
    procedure :: set_first => cell_groups_set_first
    procedure :: entry_at => cell_groups_entry_at
    procedure :: subdomain_at => cell_groups_subdomain_at
    procedure :: group_of => cell_groups_group_of
    procedure :: hold => cell_groups_hold
    procedure :: share => cell_groups_share
  end type cell_groups_t

  !> values of a map in a message record, which has two words more
  integer, parameter :: chunk = 126

contains

  !> Describe the groups; no map is known yet.
  pure subroutine cell_groups_set(self, cells, n, group_of_cell, in_pieces)
    class(cell_groups_t), intent(inout) :: self
    type(cell_map_t), intent(in) :: cells
    integer, intent(in) :: n
    !> (cells) each
    integer, intent(in), contiguous :: group_of_cell(:)
    logical, intent(in), contiguous :: in_pieces(:)
    integer :: cell, g

    self%cells = cells
    self%n = n
    self%group_of_cell = group_of_cell
    self%in_pieces = in_pieces
    if (allocated(self%length)) deallocate (self%length, self%before, self%known, self%first)
    if (allocated(self%maps)) deallocate (self%maps)
    allocate (self%before(size(group_of_cell)), self%known(n), self%first(n + 1), source=0)
    allocate (self%length(n), source=0_i8)
    allocate (self%maps(0))
    do cell = 1, size(group_of_cell)
      g = group_of_cell(cell)
      ! a length that outgrows integers is refused by whoever makes the map
      self%before(cell) = narrow(min(self%length(g), int(huge(1), i8)))
      self%length(g) = self%length(g) + merge(cells%pieces(), 1_i8, in_pieces(cell))
    end do
  end subroutine cell_groups_set

  !> Give each group so many subdomains.
  pure subroutine cell_groups_set_first(self, counts)
    class(cell_groups_t), intent(inout) :: self
    !> (n)
    integer, intent(in), contiguous :: counts(:)
    integer :: g

    self%first(1) = 1
    do g = 1, self%n
      self%first(g + 1) = self%first(g) + counts(g)
    end do
  end subroutine cell_groups_set_first

  !> Entry of the piece at `place` in the map of the group of its cell.
  pure integer function cell_groups_entry_at(self, place) result(entry_number)
    class(cell_groups_t), intent(in) :: self
    integer, intent(in) :: place(3)
    integer :: cell

    cell = self%cells%cell_at(place)
    entry_number = self%before(cell) + 1
    if (self%in_pieces(cell)) entry_number = entry_number + self%cells%piece_at(place)
  end function cell_groups_entry_at

  !> Subdomain of the piece at `place`, 0 where this rank does not know it.
  pure integer function cell_groups_subdomain_at(self, place) result(subdomain)
    class(cell_groups_t), intent(in) :: self
    integer, intent(in) :: place(3)
    integer :: k

    k = self%known(self%group_of_cell(self%cells%cell_at(place)))
    subdomain = 0
    if (k > 0) subdomain = self%maps(k)%subdomain(self%entry_at(place))
  end function cell_groups_subdomain_at

  !> Group of a subdomain.
  pure integer function cell_groups_group_of(self, subdomain) result(g)
    class(cell_groups_t), intent(in) :: self
    integer, intent(in) :: subdomain
    integer :: high, middle

    g = 1
    high = self%n
    do while (g < high)
      middle = g + (high - g + 1)/2
      if (self%first(middle) <= subdomain) then
        g = middle
      else
        high = middle - 1
      end if
    end do
  end function cell_groups_group_of

  !> Make room for the map of a group, and know it.
  subroutine cell_groups_hold(self, group)
    class(cell_groups_t), intent(inout) :: self
    integer, intent(in) :: group
    type(group_map_t), allocatable :: more(:)
    integer :: k

    k = count(self%known > 0) + 1
    if (k > size(self%maps)) then
      allocate (more(2*k + 2))
      more(1:k - 1) = self%maps(1:k - 1)
      call move_alloc(more, self%maps)
    end if
    self%known(group) = k
    self%maps(k)%group = group
    allocate (self%maps(k)%subdomain(self%length(group)), source=0)
  end subroutine cell_groups_hold

  !> Give the map of each group, known to one rank so far, to the ranks that own subdomains of it or of a group that touches
  !> it. Afterwards each rank knows these maps and no others. Collective.
  subroutine cell_groups_share(self, comm, holder)
    class(cell_groups_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> (n) rank that knows the map
    integer, intent(in), contiguous :: holder(:)
    logical, allocatable :: needed(:)
    integer(i8), allocatable :: requests(:, :), received(:, :), records(:, :)
    integer, allocatable :: destination(:)

    call find_needed(self, comm, needed)
    call ask(needed, holder, comm%rank, requests, destination)
    call sparse_exchange(comm, requests, destination, received)
    call answer(self, received, records, destination)
    call sparse_exchange(comm, records, destination, received)
    call forget(self, needed)
    call take(self, received)
  end subroutine cell_groups_share

  !> The groups of the subdomains of this rank, and those that touch them.
  subroutine find_needed(self, comm, needed)
    type(cell_groups_t), intent(in) :: self
    type(communicator_t), intent(in) :: comm
    logical, allocatable, intent(out) :: needed(:)
    logical :: mine(self%n)
    integer :: g, cell, k, n_list, apart(26), list(3, 26), place(3), n_subdomains, low, high
    type(cell_map_t) :: whole

    n_subdomains = self%first(self%n + 1) - 1
    low = comm%first_subdomain(comm%rank, n_subdomains)
    high = comm%first_subdomain(comm%rank + 1, n_subdomains) - 1
    do g = 1, self%n
      mine(g) = low <= high .and. self%first(g) <= high .and. self%first(g + 1) > low
    end do
    allocate (needed(self%n))
    needed(:) = mine
    whole = self%cells
    call whole%set_split(1)
    do cell = 1, size(self%group_of_cell)
      if (.not. mine(self%group_of_cell(cell))) cycle
      call whole%place_of(cell, 0, place)
      call whole%around(place, list, apart, n_list)
      do k = 1, n_list
        needed(self%group_of_cell(whole%cell_at(list(:, k)))) = .true.
      end do
    end do
  end subroutine find_needed

  !> Requests (group, rank that asks) for the maps that other ranks know, and these.
  pure subroutine ask(wanted, holder, rank, requests, destination)
    logical, intent(in), contiguous :: wanted(:)
    integer, intent(in), contiguous :: holder(:)
    integer, intent(in) :: rank
    integer(i8), allocatable, intent(out) :: requests(:, :)
    integer, allocatable, intent(out) :: destination(:)
    integer :: g, k

    k = count(wanted .and. holder /= rank)
    allocate (requests(2, k), destination(k))
    k = 0
    do g = 1, size(wanted)
      if (.not. wanted(g) .or. holder(g) == rank) cycle
      k = k + 1
      requests(1, k) = g
      requests(2, k) = rank
      destination(k) = holder(g)
    end do
  end subroutine ask

  !> Records (group, entries before, values) of the maps asked for.
  subroutine answer(self, requests, records, destination)
    type(cell_groups_t), intent(in) :: self
    integer(i8), intent(in), contiguous :: requests(:, :)
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer, allocatable, intent(out) :: destination(:)
    integer :: r, n, g, start, stop_at

    n = 0
    do r = 1, size(requests, 2)
      n = n + (narrow(self%length(requests(1, r))) + chunk - 1)/chunk
    end do
    allocate (records(chunk + 2, n), destination(n))
    n = 0
    do r = 1, size(requests, 2)
      g = narrow(requests(1, r))
      do start = 0, narrow(self%length(g)) - 1, chunk
        n = n + 1
        stop_at = min(start + chunk, narrow(self%length(g)))
        destination(n) = narrow(requests(2, r))
        records(1, n) = g
        records(2, n) = start
        records(3:, n) = 0
        records(3:2 + stop_at - start, n) = self%maps(self%known(g))%subdomain(start + 1:stop_at)
      end do
    end do
  end subroutine answer

  !> Keep only the maps that are needed.
  subroutine forget(self, needed)
    type(cell_groups_t), intent(inout) :: self
    logical, intent(in), contiguous :: needed(:)
    type(group_map_t), allocatable :: old(:)
    integer, allocatable :: known(:)
    integer :: g

    call move_alloc(self%maps, old)
    call move_alloc(self%known, known)
    allocate (self%known(self%n), source=0)
    allocate (self%maps(0))
    do g = 1, self%n
      if (known(g) == 0 .or. .not. needed(g)) cycle
      call self%hold(g)
      call move_alloc(old(known(g))%subdomain, self%maps(self%known(g))%subdomain)
    end do
  end subroutine forget

  subroutine take(self, records)
    type(cell_groups_t), intent(inout) :: self
    integer(i8), intent(in), contiguous :: records(:, :)
    integer :: r, g, start, n

    do r = 1, size(records, 2)
      g = narrow(records(1, r))
      start = narrow(records(2, r))
      if (self%known(g) == 0) call self%hold(g)
      n = min(chunk, narrow(self%length(g)) - start)
      self%maps(self%known(g))%subdomain(start + 1:start + n) = narrow(records(3:2 + n, r))
    end do
  end subroutine take

end module gravier_cell_groups
