!> Impulses and states of pairs from neighbour lists to those that are made anew. They stay where they are: a pair whose subdomain
!> has not changed takes them from the list before, by the places of its bodies. Only pairs that belong to another subdomain now
!> travel.
module gravier_memory_carrying
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort, argsort_rows
  use gravier_neighbour_rule, only: owner_point
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_impulse_memory, only: list_impulses, match_impulses
  implicit none
  private
  public :: carry_memory

contains

  !> Give the pairs of lists that were made anew what they kept in the lists before. Collective.
  subroutine carry_memory(decomposition, before, halo)
    !> with the partition that the lists were made for
    type(decomposition_t), intent(in) :: decomposition
    !> of the subdomains of this rank, with the places that decided on new lists
    type(local_bodies_t), intent(in) :: before(:)
    type(halo_t), intent(inout) :: halo
    integer(i8), allocatable :: records(:, :)
    integer, allocatable :: kept(:)
    integer :: s

    do s = 1, size(before)
      call before(s)%list%find_kept(kept)
      call carry_own(before(s), kept, halo%view(s))
    end do
    if (decomposition%n_subdomains == 1) return
    call gather_moved(decomposition, halo%memory%words(), before, records)
    call spread_moved(decomposition, records, halo)
  end subroutine carry_memory

  !> From a list of a subdomain to the next one. The points of a pair get what those before kept in their order.
  subroutine carry_own(before, kept, view)
    type(local_bodies_t), intent(in) :: before
    !> places of the pairs that keep something
    integer, intent(in), contiguous :: kept(:)
    type(local_bodies_t), intent(inout) :: view
    !> place of each body in the view before, 0 where it was not seen; kept pairs by their candidates, and the first of each
    integer, allocatable :: place(:), pair(:), first(:)
    integer :: p, k, i, j, repeated, wanted

    call find_places(before%bodies%id, view%bodies%id, place)
    call sort_by_candidate(before%list, kept, before%n_bodies(), pair, first)
    repeated = 0
    do p = 1, view%list%n
      repeated = merge(0, repeated + 1, view%list%begins(p))
      call view%find_ends(p, i, j)
      i = place(i)
      if (j > 0) j = place(j)
      if (i == 0 .or. j == 0) cycle
      wanted = repeated
      do k = first(i), first(i + 1) - 1
        if (before%list%antagonist(pair(k)) /= j) cycle
        if (wanted == 0) then
          call copy_memory(before%list, pair(k), p, view%list)
          exit
        end if
        wanted = wanted - 1
      end do
    end do
  end subroutine carry_own

  !> Place of each identifier among those before, 0 where it is not among them.
  subroutine find_places(before, now, place)
    integer(i8), intent(in), contiguous :: before(:), now(:)
    !> (now)
    integer, allocatable, intent(out) :: place(:)
    integer, allocatable :: order_before(:), order_now(:)
    integer :: k, b

    allocate (place(size(now)), source=0)
    allocate (order_before(size(before)), order_now(size(now)))
    call argsort(before, order_before)
    call argsort(now, order_now)
    b = 1
    do k = 1, size(now)
      do while (b <= size(before))
        if (before(order_before(b)) >= now(order_now(k))) exit
        b = b + 1
      end do
      if (b > size(before)) return
      if (before(order_before(b)) == now(order_now(k))) place(order_now(k)) = order_before(b)
    end do
  end subroutine find_places

  !> Pairs one candidate after the other, those of each in the order of the list.
  pure subroutine sort_by_candidate(list, pairs, n_bodies, sorted, first)
    type(neighbour_list_t), intent(in) :: list
    !> places in the list, ascending
    integer, intent(in), contiguous :: pairs(:)
    integer, intent(in) :: n_bodies
    !> (pairs), (n_bodies + 1)
    integer, allocatable, intent(out) :: sorted(:), first(:)
    integer, allocatable :: next(:)
    integer :: k, i

    allocate (sorted(size(pairs)), first(n_bodies + 1))
    first(:) = 0
    do k = 1, size(pairs)
      i = list%candidate(pairs(k))
      first(i + 1) = first(i + 1) + 1
    end do
    first(1) = 1
    do i = 1, n_bodies
      first(i + 1) = first(i) + first(i + 1)
    end do
    next = first
    do k = 1, size(pairs)
      i = list%candidate(pairs(k))
      sorted(next(i)) = pairs(k)
      next(i) = next(i) + 1
    end do
  end subroutine sort_by_candidate

  pure subroutine copy_memory(from, q, p, to)
    type(neighbour_list_t), intent(in) :: from
    integer, intent(in) :: q, p
    type(neighbour_list_t), intent(inout) :: to

    to%impulse(:, p) = from%impulse(:, q)
    to%spring(:, p) = from%spring(:, q)
    to%state(:, p) = from%state(:, q)
  end subroutine copy_memory

  !> What pairs keep that belong to other subdomains now, each with the point that decides on that.
  subroutine gather_moved(decomposition, words, before, records)
    type(decomposition_t), intent(in) :: decomposition
    !> of the memory
    integer, intent(in) :: words
    type(local_bodies_t), intent(in) :: before(:)
    !> (1 + nd + 2 + words, n): subdomain (to be set), point, candidate, antagonist, impulse, elongation, reference, states
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer(i8), allocatable :: own(:, :), more(:, :)
    integer, allocatable :: moved(:)
    integer :: s

    allocate (records(1 + decomposition%nd + 2 + words, 0))
    do s = 1, size(before)
      call find_moved(decomposition, before(s), decomposition%subdomain_of(s), moved)
      call list_impulses(before(s), 1 + decomposition%nd, moved, own)
      call write_points(decomposition, before(s), moved, own)
      allocate (more(size(own, 1), size(records, 2) + size(own, 2)))
      more(:, 1:size(records, 2)) = records
      more(:, size(records, 2) + 1:) = own
      call move_alloc(more, records)
    end do
  end subroutine gather_moved

  !> The pairs that keep something and belong to another subdomain than that of the list.
  subroutine find_moved(decomposition, view, subdomain, moved)
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: subdomain
    !> places in the list
    integer, allocatable, intent(out) :: moved(:)
    integer, allocatable :: kept(:)
    real(dp) :: point(decomposition%nd)
    integer :: k, n, turns(decomposition%nd)

    call view%list%find_kept(kept)
    n = 0
    do k = 1, size(kept)
      call find_point(decomposition, view, kept(k), point)
      ! subdomains of a cell that moves are parts of its box alone, as in deliver
      if (decomposition%period%moves) call decomposition%period%wrap(point, turns)
      if (decomposition%partition%owner(point) == subdomain) cycle
      n = n + 1
      kept(n) = kept(k)
    end do
    moved = kept(1:n)
  end subroutine find_moved

  !> The point that decides on the owner of pair `p` [m].
  subroutine find_point(decomposition, view, p, point)
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    !> (nd)
    real(dp), intent(out) :: point(:)
    real(dp) :: candidate(size(point)), antagonist(size(point))

    associate (list => view%list, position => view%bodies%position)
      point(:) = position(:, list%candidate(p))
      if (list%antagonist(p) < 0) return
      antagonist(:) = position(:, list%antagonist(p))
      if (size(list%shift) > 0) call decomposition%older_period%add_shift(list%shift(p), 1, antagonist)
      candidate(:) = point
      point(:) = owner_point(decomposition%rule%kind, candidate, antagonist)
    end associate
  end subroutine find_point

  subroutine write_points(decomposition, view, pairs, records)
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: view
    integer, intent(in), contiguous :: pairs(:)
    integer(i8), intent(inout), contiguous :: records(:, :)
    real(dp) :: point(decomposition%nd)
    integer :: n, d

    do n = 1, size(pairs)
      call find_point(decomposition, view, pairs(n), point)
      do d = 1, decomposition%nd
        records(1 + d, n) = transfer(point(d), 0_i8)
      end do
    end do
  end subroutine write_points

  !> Bring each record to the subdomain that owns its pair now. Collective.
  subroutine spread_moved(decomposition, records, halo)
    type(decomposition_t), intent(in) :: decomposition
    !> of gather_moved
    integer(i8), intent(inout), contiguous :: records(:, :)
    type(halo_t), intent(inout) :: halo
    integer(i8), allocatable :: received(:, :), keys(:, :), mine(:, :)
    integer, allocatable :: order(:)
    integer :: s, k, first, lead

    lead = 1 + decomposition%nd
    call decomposition%deliver(2, records, received)
    allocate (order(size(received, 2)), keys(1, size(received, 2)), mine(size(received, 1) - lead, size(received, 2)))
    keys(1, :) = received(1, :)
    call argsort_rows(keys, order)
    do k = 1, size(order)
      mine(:, k) = received(lead + 1:, order(k))
    end do
    k = 1
    do s = 1, size(halo%view)
      first = k
      do while (k <= size(order))
        if (received(1, order(k)) /= decomposition%subdomain_of(s)) exit
        k = k + 1
      end do
      call match_impulses(mine(:, first:k - 1), halo%memory, halo%view(s))
    end do
  end subroutine spread_moved

end module gravier_memory_carrying
