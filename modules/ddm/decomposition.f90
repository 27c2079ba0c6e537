!> Who owns which grain, and which grains each subdomain sees.
module gravier_decomposition
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_body_store, only: body_set_t, wall_set_t, append_bodies
  use gravier_detection, only: detection_rule_t, rule_primal
  use gravier_partition, only: partition_t
  implicit none
  private
  public :: decomposition_t, neighbourhood_t

  !> Each rank owns a block of subdomains, each subdomain the grains whose centre it holds. Walls are everywhere.
  type :: decomposition_t
    type(communicator_t), pointer :: comm => null()
    type(partition_t) :: partition
    type(detection_rule_t) :: rule
    integer :: n_subdomains = 1
    !> space dimension and degrees of freedom of a grain
    integer :: nd = 2, nv = 3
    !> first subdomain of this rank; home(s) belongs to subdomain first + s - 1
    integer :: first = 1
    type(body_set_t), allocatable :: home(:)
    type(wall_set_t) :: walls
  contains
    procedure :: init => decomposition_init
    procedure :: settle => decomposition_settle
    procedure :: look_around => decomposition_look_around
    procedure :: bounding_box => decomposition_bounding_box
  end type decomposition_t

  !> The grains that a subdomain sees: its own and the ghosts near it.
  type :: neighbourhood_t
    type(body_set_t) :: bodies
    !> subdomain that owns each, and for its own the place in home (n); 0 for ghosts
    integer, allocatable :: home(:), origin(:)
  end type neighbourhood_t

contains

  !> Make room for `n_subdomains`, without grains.
  subroutine decomposition_init(self, comm, n_subdomains, nd, nv)
    class(decomposition_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    integer, intent(in) :: n_subdomains, nd, nv
    integer :: s, last

    self%comm => comm
    self%n_subdomains = n_subdomains
    self%nd = nd
    self%nv = nv
    self%first = comm%first_subdomain(comm%rank, n_subdomains)
    last = comm%first_subdomain(comm%rank + 1, n_subdomains) - 1
    if (allocated(self%home)) deallocate (self%home)
    allocate (self%home(last - self%first + 1))
    do s = 1, size(self%home)
      call self%home(s)%init(nd, nv, 0)
    end do
  end subroutine decomposition_init

  !> Corners of the box that holds all grains, radii included [m]; an empty scene has the unit box. Collective.
  subroutine decomposition_bounding_box(self, bodies, lower, upper)
    class(decomposition_t), intent(in) :: self
    !> grains of this rank, however grouped
    type(body_set_t), intent(in) :: bodies(:)
    !> (nd)
    real(dp), intent(out) :: lower(:), upper(:)
    real(dp) :: far(2*size(lower))
    integer :: s, d, nd

    nd = size(lower)
    far(:) = -huge(1.0_dp)
    do s = 1, size(bodies)
      do d = 1, nd
        if (bodies(s)%n == 0) cycle
        far(d) = max(far(d), maxval(bodies(s)%radius - bodies(s)%position(d, :)))
        far(nd + d) = max(far(nd + d), maxval(bodies(s)%position(d, :) + bodies(s)%radius))
      end do
    end do
    call self%comm%highest_of(far)
    lower(:) = -far(1:nd)
    upper(:) = far(nd + 1:)
    if (lower(1) > upper(1)) then
      lower(:) = 0.0_dp
      upper(:) = 1.0_dp
    end if
  end subroutine decomposition_bounding_box

  !> Bring every grain to the subdomain that holds its centre; grains of a subdomain are kept by ascending
  !> identifier. Collective.
  subroutine decomposition_settle(self, newcomers)
    class(decomposition_t), intent(inout) :: self
    !> grains of this rank without a home so far
    type(body_set_t), intent(in), optional :: newcomers
    type(body_set_t) :: leaving
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: k, owner

    call collect_leaving(self, leaving)
    if (present(newcomers)) call append_bodies(leaving, newcomers)
    allocate (records(leaving%record_words() + 1, leaving%n), destination(leaving%n))
    do k = 1, leaving%n
      owner = self%partition%owner(leaving%position(:, k))
      destination(k) = self%comm%rank_of(owner, self%n_subdomains)
      records(1, k) = owner
      call leaving%get_record(k, records(2:, k))
    end do
    call sparse_exchange(self%comm, records, destination, received)
    call take_in(self, received)
  end subroutine decomposition_settle

  !> Take the grains whose centre has left their subdomain out of it.
  subroutine collect_leaving(self, leaving)
    class(decomposition_t), intent(inout) :: self
    type(body_set_t), intent(out) :: leaving
    type(body_set_t) :: gone
    logical, allocatable :: stays(:)
    integer :: s, k

    call leaving%init(self%nd, self%nv, 0)
    do s = 1, size(self%home)
      allocate (stays(self%home(s)%n))
      do k = 1, self%home(s)%n
        stays(k) = self%partition%owner(self%home(s)%position(:, k)) == self%first + s - 1
      end do
      if (.not. all(stays)) then
        gone = self%home(s)
        call self%home(s)%keep_only(stays)
        stays(:) = .not. stays
        call gone%keep_only(stays)
        call append_bodies(leaving, gone)
      end if
      deallocate (stays)
    end do
  end subroutine collect_leaving

  !> Add the grains that have arrived to their subdomains.
  subroutine take_in(self, received)
    class(decomposition_t), intent(inout) :: self
    !> (1 + words of a grain, n), the first word being the subdomain
    integer(i8), intent(in), contiguous :: received(:, :)
    type(body_set_t), allocatable :: arrived(:)
    integer, allocatable :: order(:)
    integer :: s

    call unpack_by_subdomain(self, received, 1, arrived)
    do s = 1, size(self%home)
      if (arrived(s)%n == 0) cycle
      call append_bodies(self%home(s), arrived(s))
      allocate (order(self%home(s)%n))
      call argsort(self%home(s)%id, order)
      call self%home(s)%reorder(order)
      deallocate (order)
    end do
  end subroutine take_in

  !> Sort received grains by subdomain of this rank; the first `lead` words of a record are not of the grain, and
  !> the first of them is the subdomain.
  subroutine unpack_by_subdomain(self, received, lead, sets)
    class(decomposition_t), intent(in) :: self
    integer(i8), intent(in), contiguous :: received(:, :)
    integer, intent(in) :: lead
    type(body_set_t), allocatable, intent(out) :: sets(:)
    integer, allocatable :: counts(:)
    integer :: k, s

    allocate (sets(size(self%home)), counts(size(self%home)))
    counts(:) = 0
    do k = 1, size(received, 2)
      s = int(received(1, k)) - self%first + 1
      counts(s) = counts(s) + 1
    end do
    do s = 1, size(sets)
      call sets(s)%init(self%nd, self%nv, counts(s))
    end do
    counts(:) = 0
    do k = 1, size(received, 2)
      s = int(received(1, k)) - self%first + 1
      counts(s) = counts(s) + 1
      call sets(s)%set_record(counts(s), received(lead + 1:, k))
    end do
  end subroutine unpack_by_subdomain

  !> What each subdomain of this rank sees: its grains and the ghosts that may touch a contact it owns. The order
  !> is that of `home`, then ghosts by owner and identifier. Collective.
  subroutine decomposition_look_around(self, seen)
    class(decomposition_t), intent(in) :: self
    type(neighbourhood_t), allocatable, intent(out) :: seen(:)
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    type(body_set_t), allocatable :: ghosts(:)
    integer :: s, k, n

    call list_ghosts(self, records, destination)
    call sparse_exchange(self%comm, records, destination, received)
    call unpack_by_subdomain(self, received, 2, ghosts)
    allocate (seen(size(self%home)))
    do s = 1, size(seen)
      seen(s)%bodies = self%home(s)
      call append_bodies(seen(s)%bodies, ghosts(s))
      n = self%home(s)%n
      allocate (seen(s)%home(seen(s)%bodies%n), seen(s)%origin(seen(s)%bodies%n))
      seen(s)%home(1:n) = self%first + s - 1
      do k = 1, n
        seen(s)%origin(k) = k
      end do
      seen(s)%origin(n + 1:) = 0
    end do
    call note_owners(self, received, seen)
  end subroutine decomposition_look_around

  !> Records of the grains of this rank that other subdomains see: (seer, owner, grain).
  subroutine list_ghosts(self, records, destination)
    class(decomposition_t), intent(in) :: self
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer, allocatable, intent(out) :: destination(:)
    integer, allocatable :: near(:)
    integer :: s, k, j, n_near, n, round

    allocate (near(32))
    do round = 1, 2
      n = 0
      do s = 1, size(self%home)
        do k = 1, self%home(s)%n
          call self%partition%near(self%home(s)%position(:, k), reach_of(self%rule, self%home(s)%radius(k)), near, n_near)
          do j = 1, n_near
            if (near(j) == self%first + s - 1) cycle
            n = n + 1
            if (round == 1) cycle
            destination(n) = self%comm%rank_of(near(j), self%n_subdomains)
            records(1, n) = near(j)
            records(2, n) = self%first + s - 1
            call self%home(s)%get_record(k, records(3:, n))
          end do
        end do
      end do
      if (round == 1) allocate (records(6 + self%nd + self%nv, n), destination(n))
    end do
  end subroutine list_ghosts

  !> How far from its centre the contacts of a grain may have the point that decides their owner, or the candidate
  !> whose owner needs it [m].
  pure real(dp) function reach_of(rule, radius) result(reach)
    type(detection_rule_t), intent(in) :: rule
    real(dp), intent(in) :: radius
    reach = radius + rule%largest_radius
    if (rule%kind /= rule_primal) reach = 0.5_dp*reach
    reach = reach + rule%alert_distance
  end function reach_of

  !> Owner of each ghost, in the order in which unpack_by_subdomain put them.
  subroutine note_owners(self, received, seen)
    class(decomposition_t), intent(in) :: self
    integer(i8), intent(in), contiguous :: received(:, :)
    type(neighbourhood_t), intent(inout) :: seen(:)
    integer, allocatable :: next(:)
    integer :: k, s

    allocate (next(size(seen)))
    do s = 1, size(seen)
      next(s) = self%home(s)%n
    end do
    do k = 1, size(received, 2)
      s = int(received(1, k)) - self%first + 1
      next(s) = next(s) + 1
      seen(s)%home(next(s)) = int(received(2, k))
    end do
  end subroutine note_owners

end module gravier_decomposition
