!> Exchange of values between the subdomains that hold copies of the same body.
!>
!> A rank may own many subdomains: copies on the same rank are passed in memory, those on another rank in one
!> message per pair of ranks. Whatever is summed over the copies is summed in subdomain order, so that all copies
!> get the same bits on any number of ranks.
module gravier_shared_exchange
  use mpi_f08, only: MPI_Request, MPI_DOUBLE_PRECISION, MPI_STATUSES_IGNORE, MPI_Send_init, MPI_Recv_init, MPI_Startall, &
    & MPI_Waitall, MPI_Request_free
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: shared_exchange_t, shared_part_t

  !> The shared bodies of one subdomain and its message buffers. A slot stands for one copy of a shared body in
  !> another subdomain; slots are grouped by neighbour, in ascending order, and by identifier within a neighbour.
  type :: shared_part_t
    !> global number of the subdomain, from 1
    integer :: subdomain = 0
    integer :: n_shared = 0, n_slots = 0
    !> local number of each shared body, by ascending identifier (n_shared)
    integer, allocatable :: body(:)
    !> first sharer of each shared body (n_shared + 1)
    integer, allocatable :: first(:)
    !> subdomains that hold a copy, ascending, this one included, and the slot of each, 0 for this one
    integer, allocatable :: sharer(:), slot(:)
    !> place of this subdomain among the sharers of each shared body, from 1 (n_shared)
    integer, allocatable :: copy_rank(:)
    !> shared body that each slot is a copy of, and its local number (n_slots)
    integer, allocatable :: slot_shared(:), slot_body(:)
    !> neighbouring subdomains, ascending, and the first slot of each (one more entry at the end)
    integer, allocatable :: neighbour(:), neighbour_first(:)
    !> (width, n_slots): what goes out and what came in
    real(dp), allocatable :: send(:, :), recv(:, :)
  contains
    procedure :: multiplicity => shared_part_multiplicity
  end type shared_part_t

  !> A stretch of slots that travels to, or comes from, another rank.
  type :: segment_t
    !> local subdomain, first and last slot
    integer :: part = 0, from = 0, to = 0
  end type segment_t

  !> All that passes between this rank and another.
  type :: channel_t
    integer :: rank = 0, n_slots = 0
    !> stretches sent in order, and stretches received in order
    type(segment_t), allocatable :: outgoing(:), incoming(:)
    real(dp), allocatable :: send(:), recv(:)
  end type channel_t

  type :: shared_exchange_t
    type(communicator_t), pointer :: comm => null()
    !> one per subdomain of this rank
    type(shared_part_t), allocatable :: part(:)
    !> values per slot
    integer :: width = 0
    !> messages sent and values sent by this rank since `init`
    integer(i8) :: messages = 0, values = 0
    !> stretches passed in memory: the outgoing one and the incoming one of the same pair
    type(segment_t), allocatable, private :: near_from(:), near_to(:)
    type(channel_t), allocatable, private :: channel(:)
    !> which parts have slots in channels
    logical, allocatable, private :: far(:)
    !> persistent: one receive a channel, then one send a channel
    type(MPI_Request), allocatable, private :: requests(:)
  contains
    procedure :: init => shared_exchange_init
    procedure :: pass => shared_exchange_pass
    procedure :: n_shared => shared_exchange_n_shared
    procedure :: is_far => shared_exchange_is_far
    procedure :: start => shared_exchange_start
    procedure :: finish => shared_exchange_finish
    procedure :: load => shared_exchange_load
    procedure :: add_copies => shared_exchange_add_copies
    procedure :: sum_copies => shared_exchange_sum_copies
    procedure :: move_to => shared_exchange_move_to
    procedure :: free => shared_exchange_free
  end type shared_exchange_t

  integer, parameter :: tag = 11

contains

  !> Number of subdomains that hold shared body `k`.
  pure integer function shared_part_multiplicity(self, k) result(multiplicity)
    class(shared_part_t), intent(in) :: self
    integer, intent(in) :: k
    multiplicity = self%first(k + 1) - self%first(k)
  end function shared_part_multiplicity

  !> Complete the plan. On entry each part holds `subdomain`, `n_shared`, `body`, `first` and `sharer`, for shared
  !> bodies in ascending order of identifier.
  subroutine shared_exchange_init(self, comm, part, n_subdomains, width)
    class(shared_exchange_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    type(shared_part_t), allocatable, intent(inout) :: part(:)
    !> of the whole scene; rank_of of the communicator tells where each lives
    integer, intent(in) :: n_subdomains
    !> values per slot
    integer, intent(in) :: width
    integer :: p

    self%comm => comm
    self%width = width
    self%messages = 0
    self%values = 0
    call move_alloc(part, self%part)
    do p = 1, size(self%part)
      call number_slots(self%part(p), width)
    end do
    call find_near(self)
    call find_channels(self, n_subdomains)
  end subroutine shared_exchange_init

  !> Give the slots of a part their numbers.
  subroutine number_slots(part, width)
    type(shared_part_t), intent(inout) :: part
    integer, intent(in) :: width
    integer, allocatable :: next(:)
    integer :: k, j, s

    call list_neighbours(part)
    allocate (next(size(part%neighbour)))
    next(:) = part%neighbour_first(1:size(next))
    part%n_slots = part%neighbour_first(size(next) + 1) - 1
    allocate (part%slot(size(part%sharer)), source=0)
    allocate (part%slot_shared(part%n_slots), part%slot_body(part%n_slots), part%copy_rank(part%n_shared))
    allocate (part%send(width, part%n_slots), part%recv(width, part%n_slots), source=0.0_dp)
    do k = 1, part%n_shared
      do j = part%first(k), part%first(k + 1) - 1
        if (part%sharer(j) == part%subdomain) then
          part%copy_rank(k) = j - part%first(k) + 1
        else
          s = place_of(part%neighbour, part%sharer(j))
          part%slot(j) = next(s)
          part%slot_shared(next(s)) = k
          part%slot_body(next(s)) = part%body(k)
          next(s) = next(s) + 1
        end if
      end do
    end do
  end subroutine number_slots

  !> Neighbours in ascending order, and where their slots begin.
  subroutine list_neighbours(part)
    type(shared_part_t), intent(inout) :: part
    integer, allocatable :: found(:), counts(:)
    integer :: j, s, k

    allocate (found(0))
    do j = 1, part%first(part%n_shared + 1) - 1
      s = part%sharer(j)
      if (s /= part%subdomain) call insert(found, s)
    end do
    allocate (counts(size(found)), source=0)
    do j = 1, part%first(part%n_shared + 1) - 1
      k = place_of(found, part%sharer(j))
      if (k > 0) counts(k) = counts(k) + 1
    end do
    allocate (part%neighbour_first(size(found) + 1))
    part%neighbour_first(1) = 1
    do k = 1, size(found)
      part%neighbour_first(k + 1) = part%neighbour_first(k) + counts(k)
    end do
    call move_alloc(found, part%neighbour)
  end subroutine list_neighbours

  !> Add `value` to an ascending list, unless it is there.
  pure subroutine insert(list, value)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in) :: value
    integer, allocatable :: longer(:)
    integer :: k

    if (place_of(list, value) > 0) return
    k = count(list < value)
    allocate (longer(size(list) + 1), source=value)
    longer(1:k) = list(1:k)
    longer(k + 2:) = list(k + 1:)
    call move_alloc(longer, list)
  end subroutine insert

  !> Place of `value` in an ascending list, 0 where absent.
  pure integer function place_of(list, value) result(place)
    integer, intent(in), contiguous :: list(:)
    integer, intent(in) :: value
    integer :: low, high

    low = 1
    high = size(list)
    do while (low <= high)
      place = (low + high)/2
      if (list(place) == value) return
      if (list(place) < value) then
        low = place + 1
      else
        high = place - 1
      end if
    end do
    place = 0
  end function place_of

  !> Local number of a subdomain on this rank, 0 where it lives elsewhere.
  pure integer function local_part(self, subdomain) result(p)
    class(shared_exchange_t), intent(in) :: self
    integer, intent(in) :: subdomain
    p = 0
    if (size(self%part) == 0) return
    p = subdomain - self%part(1)%subdomain + 1
    if (p < 1 .or. p > size(self%part)) p = 0
  end function local_part

  !> Pairs of subdomains that live both on this rank.
  subroutine find_near(self)
    class(shared_exchange_t), intent(inout) :: self
    integer :: p, q, j, k, n, round

    do round = 1, 2
      n = 0
      do p = 1, size(self%part)
        do j = 1, size(self%part(p)%neighbour)
          q = local_part(self, self%part(p)%neighbour(j))
          if (q == 0) cycle
          n = n + 1
          if (round == 1) cycle
          k = place_of(self%part(q)%neighbour, self%part(p)%subdomain)
          self%near_from(n) = stretch(self%part(p), p, j)
          self%near_to(n) = stretch(self%part(q), q, k)
        end do
      end do
      if (round == 1) then
        if (allocated(self%near_from)) deallocate (self%near_from, self%near_to)
        allocate (self%near_from(n), self%near_to(n))
      end if
    end do
  end subroutine find_near

  !> The slots of neighbour `j` of a part.
  pure type(segment_t) function stretch(part, p, j)
    type(shared_part_t), intent(in) :: part
    integer, intent(in) :: p, j
    stretch%part = p
    stretch%from = part%neighbour_first(j)
    stretch%to = part%neighbour_first(j + 1) - 1
  end function stretch

  !> Hand the plan over, with the channels: a copy would leave its requests with the memory of this one, and never be given back.
  subroutine shared_exchange_move_to(self, other)
    !> is left without a plan
    class(shared_exchange_t), intent(inout) :: self
    !> the plan that it has is given back
    type(shared_exchange_t), intent(inout) :: other

    call other%free()
    other%comm => self%comm
    other%width = self%width
    other%messages = self%messages
    other%values = self%values
    call move_alloc(self%part, other%part)
    call move_alloc(self%near_from, other%near_from)
    call move_alloc(self%near_to, other%near_to)
    call move_alloc(self%far, other%far)
    call move_alloc(self%channel, other%channel)
    call move_alloc(self%requests, other%requests)
  end subroutine shared_exchange_move_to

  !> Give back the channels and their persistent requests.
  subroutine shared_exchange_free(self)
    class(shared_exchange_t), intent(inout) :: self
    integer :: r

    if (.not. allocated(self%channel)) return
    do r = 1, size(self%requests)
      call MPI_Request_free(self%requests(r))
    end do
    deallocate (self%channel, self%requests)
  end subroutine shared_exchange_free

  !> One channel per rank that owns a neighbour. Both ends list the pairs (sender, receiver) in ascending order.
  subroutine find_channels(self, n_subdomains)
    class(shared_exchange_t), intent(inout) :: self
    integer, intent(in) :: n_subdomains
    integer, allocatable :: ranks(:)
    integer :: p, j, c, r

    allocate (ranks(0))
    do p = 1, size(self%part)
      do j = 1, size(self%part(p)%neighbour)
        r = self%comm%rank_of(self%part(p)%neighbour(j), n_subdomains)
        if (r /= self%comm%rank) call insert(ranks, r)
      end do
    end do
    call self%free()
    if (allocated(self%far)) deallocate (self%far)
    allocate (self%far(size(self%part)), source=.false.)
    allocate (self%channel(size(ranks)), self%requests(2*size(ranks)))
    do c = 1, size(ranks)
      call fill_channel(self%channel(c), ranks(c))
      call MPI_Recv_init(self%channel(c)%recv, size(self%channel(c)%recv), MPI_DOUBLE_PRECISION, ranks(c), tag, self%comm%mpi, &
        & self%requests(c))
      call MPI_Send_init(self%channel(c)%send, size(self%channel(c)%send), MPI_DOUBLE_PRECISION, ranks(c), tag, self%comm%mpi, &
        & self%requests(size(ranks) + c))
    end do

  contains

    subroutine fill_channel(channel, rank)
      type(channel_t), intent(inout) :: channel
      integer, intent(in) :: rank
      integer :: p, j, k, n_pairs
      integer, allocatable :: order(:)
      integer(i8), allocatable :: far(:)

      channel%rank = rank
      n_pairs = 0
      do p = 1, size(self%part)
        do j = 1, size(self%part(p)%neighbour)
          if (self%comm%rank_of(self%part(p)%neighbour(j), n_subdomains) == rank) n_pairs = n_pairs + 1
        end do
      end do
      allocate (channel%outgoing(n_pairs), channel%incoming(n_pairs), order(n_pairs), far(n_pairs))
      k = 0
      do p = 1, size(self%part)
        do j = 1, size(self%part(p)%neighbour)
          if (self%comm%rank_of(self%part(p)%neighbour(j), n_subdomains) /= rank) cycle
          k = k + 1
          channel%outgoing(k) = stretch(self%part(p), p, j)
          self%far(p) = .true.
          far(k) = self%part(p)%neighbour(j)
        end do
      end do
      ! outgoing is ordered by (own, far); what comes in was ordered by its sender, as (far, own)
      call argsort(far, order)
      do k = 1, n_pairs
        channel%incoming(k) = channel%outgoing(order(k))
      end do
      channel%n_slots = sum(channel%outgoing%to - channel%outgoing%from + 1)
      allocate (channel%send(self%width*channel%n_slots), channel%recv(self%width*channel%n_slots), source=0.0_dp)
    end subroutine fill_channel

  end subroutine find_channels

  !> Send `send` of all parts and fill `recv` of all parts. Collective over the ranks that share bodies.
  subroutine shared_exchange_pass(self)
    class(shared_exchange_t), intent(inout) :: self
    call self%start()
    call self%finish()
  end subroutine shared_exchange_pass

  !> Bodies that part `p` shares with other subdomains.
  pure integer function shared_exchange_n_shared(self, p) result(n_shared)
    class(shared_exchange_t), intent(in) :: self
    integer, intent(in) :: p
    n_shared = self%part(p)%n_shared
  end function shared_exchange_n_shared

  !> Whether part `p` shares bodies with subdomains on other ranks.
  pure logical function shared_exchange_is_far(self, p) result(is_far)
    class(shared_exchange_t), intent(in) :: self
    integer, intent(in) :: p
    is_far = self%far(p)
  end function shared_exchange_is_far

  !> Begin to send what parts that share bodies with other ranks have loaded; `finish` ends it. In between, the other parts
  !> may be loaded. Collective over the ranks that share bodies.
  subroutine shared_exchange_start(self)
    class(shared_exchange_t), intent(inout), target, asynchronous :: self
    integer :: c, n

    n = size(self%channel)
    do c = 1, n
      call gather_channel(self%channel(c))
      self%messages = self%messages + 1
      self%values = self%values + size(self%channel(c)%send)
    end do
    call MPI_Startall(2*n, self%requests)

  contains

    subroutine gather_channel(channel)
      type(channel_t), intent(inout) :: channel
      integer :: k, s, at
      at = 0
      do k = 1, size(channel%outgoing)
        do s = channel%outgoing(k)%from, channel%outgoing(k)%to
          channel%send(at + 1:at + self%width) = self%part(channel%outgoing(k)%part)%send(:, s)
          at = at + self%width
        end do
      end do
    end subroutine gather_channel

  end subroutine shared_exchange_start

  !> Fill `recv` of all parts once all are loaded and `start` was called. Collective over the ranks that share bodies.
  subroutine shared_exchange_finish(self)
    class(shared_exchange_t), intent(inout), target, asynchronous :: self
    integer :: c, k

    do k = 1, size(self%near_from)
      self%part(self%near_to(k)%part)%recv(:, self%near_to(k)%from:self%near_to(k)%to) = &
        & self%part(self%near_from(k)%part)%send(:, self%near_from(k)%from:self%near_from(k)%to)
    end do
    call MPI_Waitall(size(self%requests), self%requests, MPI_STATUSES_IGNORE)
    do c = 1, size(self%channel)
      call scatter_channel(self%channel(c))
    end do

  contains

    subroutine scatter_channel(channel)
      type(channel_t), intent(in) :: channel
      integer :: k, s, at
      at = 0
      do k = 1, size(channel%incoming)
        do s = channel%incoming(k)%from, channel%incoming(k)%to
          self%part(channel%incoming(k)%part)%recv(:, s) = channel%recv(at + 1:at + self%width)
          at = at + self%width
        end do
      end do
    end subroutine scatter_channel

  end subroutine shared_exchange_finish

  !> Put the values of the shared bodies of part `p` into its outgoing slots.
  subroutine shared_exchange_load(self, p, field)
    class(shared_exchange_t), intent(inout) :: self
    integer, intent(in) :: p
    !> (at least width, bodies of the subdomain)
    real(dp), intent(in), contiguous :: field(:, :)
    integer :: s, d, b

    associate (part => self%part(p))
      do s = 1, part%n_slots
        b = part%slot_body(s)
        ! too short to gain from vectors
        !GCC$ novector
        do d = 1, self%width
          part%send(d, s) = field(d, b)
        end do
      end do
    end associate
  end subroutine shared_exchange_load

  !> Replace the value of shared body `k` in part `p` by the sum over all its copies, in subdomain order.
  pure subroutine shared_exchange_add_copies(self, p, k, value)
    class(shared_exchange_t), intent(in) :: self
    integer, intent(in) :: p, k
    !> (at least width): on entry the copy of this part
    real(dp), intent(inout), contiguous :: value(:)
    real(dp) :: own(self%width)
    integer :: j, i

    do i = 1, self%width
      own(i) = value(i)
      value(i) = 0.0_dp
    end do
    do j = self%part(p)%first(k), self%part(p)%first(k + 1) - 1
      if (self%part(p)%slot(j) == 0) then
        value(1:self%width) = value(1:self%width) + own
      else
        value(1:self%width) = value(1:self%width) + self%part(p)%recv(:, self%part(p)%slot(j))
      end if
    end do
  end subroutine shared_exchange_add_copies

  !> Replace the values of all shared bodies of part `p` by their sums over all copies, in subdomain order, or by their means.
  subroutine shared_exchange_sum_copies(self, p, field, mean)
    class(shared_exchange_t), intent(in) :: self
    integer, intent(in) :: p
    !> (at least width, bodies of the subdomain)
    real(dp), intent(inout), contiguous :: field(:, :)
    logical, intent(in) :: mean
    real(dp) :: half
    integer :: k, d, b, s, copies

    half = merge(0.5_dp, 1.0_dp, mean)
    associate (part => self%part(p))
      do k = 1, part%n_shared
        b = part%body(k)
        copies = part%first(k + 1) - part%first(k)
        if (copies > 2) then
          call self%add_copies(p, k, field(:, b))
          if (mean) field(1:self%width, b) = field(1:self%width, b)/copies
          cycle
        end if
        ! two copies, as almost always: the order does not matter, and the slot of this one is 0
        s = part%slot(part%first(k)) + part%slot(part%first(k) + 1)
        ! too short to gain from vectors
        !GCC$ novector
        do d = 1, self%width
          field(d, b) = half*(field(d, b) + part%recv(d, s))
        end do
      end do
    end associate
  end subroutine shared_exchange_sum_copies

end module gravier_shared_exchange
