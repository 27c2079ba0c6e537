!> A graph partition on two levels: cells are cut into groups, and the cells of each group, in pieces, into subdomains.
module gravier_cell_levels
  use gravier_kinds, only: dp, i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_sorting, only: argsort_rows
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_cell_map, only: cell_map_t
  use gravier_cell_groups, only: cell_groups_t
  use gravier_cell_cut, only: cut_group, refuse_overflow
  implicit none
  private
  public :: make_groups, cut_groups, share_out, cells_per_subdomain

  !> cells wanted per subdomain, over all cells that are not empty
  integer(i8), parameter :: cells_per_subdomain = 64_i8
  !> wanted: few enough that the map of a group goes to few ranks, enough that the number of subdomains of a group can be
  !> about as its weight
  integer, parameter :: subdomains_per_group = 32, least_per_group = 4
  !> cells wanted per group, so that it can be round
  integer, parameter :: cells_per_group = 4

contains

  !> Cut the cells into groups of about as much weight and about as many cells, so that neither grows without bound; the same
  !> groups on every rank.
  subroutine make_groups(groups, cells, weight, n_subdomains, cell_limit, error)
    type(cell_groups_t), intent(inout) :: groups
    !> split as far as it may be
    type(cell_map_t), intent(in) :: cells
    !> (cells) of all ranks
    integer(i8), intent(in), contiguous :: weight(:)
    integer, intent(in) :: n_subdomains
    !> entries wanted at most in the graph of a group
    integer(i8), intent(in) :: cell_limit
    type(error_t), allocatable, intent(inout) :: error
    type(cell_map_t) :: fine
    type(cell_groups_t) :: whole
    integer(i8), allocatable :: mixed(:)
    integer, allocatable :: owner(:)
    logical, allocatable :: flag(:)
    integer(i8) :: occupied, total
    integer :: cell, n

    occupied = count(weight > 0)
    total = sum(weight)
    fine = cells
    call fine%set_split(split_for(cells, occupied, cells_per_subdomain*n_subdomains))
    n = number_of_groups(occupied, fine%pieces(), n_subdomains, cell_limit)
    allocate (mixed(size(weight)), source=0_i8)
    do cell = 1, size(weight)
      if (weight(cell) > 0) mixed(cell) = 100 + int(100.0_dp*(real(weight(cell), dp)*real(occupied, dp)/real(total, dp)), i8)
    end do
    allocate (owner(size(weight)), source=1)
    whole%cells = cells
    call whole%cells%set_split(1)
    allocate (flag(size(weight)), source=.true.)
    call whole%set(whole%cells, 1, owner, flag)
    if (occupied > 0) call cut_group(whole, 1, mixed, n, owner, error)
    flag(:) = weight > 0
    call groups%set(fine, max(1, maxval(owner)), owner, flag)
    call refuse_overflow(maxval(groups%length), error)
  end subroutine make_groups

  !> Cut the groups that make_groups made into subdomains, each in its pieces. The graph of a group is cut on one rank, and its map
  !> given to the ranks that own subdomains of it or next to it. Without enough occupied pieces for all subdomains nothing is cut:
  !> see `occupied`. Collective; an error is that of all ranks.
  subroutine cut_groups(groups, comm, points, weights, n_subdomains, occupied, error)
    type(cell_groups_t), intent(inout) :: groups
    type(communicator_t), intent(in) :: comm
    !> (nd, points of this rank) [m]; (points of this rank)
    real(dp), intent(in), contiguous :: points(:, :)
    integer, intent(in), contiguous :: weights(:)
    integer, intent(in) :: n_subdomains
    !> pieces that are not empty; too few where less than n_subdomains
    integer(i8), intent(out) :: occupied
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), sums(:, :)
    integer, allocatable :: counts(:), holder(:)
    integer :: g

    call gather_pieces(groups, comm, points, weights, records)
    allocate (sums(groups%n, 2), counts(groups%n), holder(groups%n))
    call sum_pieces(records, sums(:, 1), sums(:, 2))
    call comm%sum_counts(sums(:, 1))
    call comm%sum_counts(sums(:, 2))
    occupied = sum(sums(:, 1))
    if (occupied < n_subdomains) return
    call share_out(sums(:, 2), sums(:, 1), n_subdomains, counts)
    call groups%set_first(counts)
    call cut_own_groups(groups, comm, records, error)
    call comm%agree(error)
    if (allocated(error)) return
    do g = 1, groups%n
      holder(g) = comm%rank_of(g, groups%n)
    end do
    call groups%share(comm, holder)
  end subroutine cut_groups

  !> Pieces along the edge of a cell for `wanted` pieces in all.
  pure integer function split_for(cells, occupied, wanted) result(split)
    type(cell_map_t), intent(in) :: cells
    integer(i8), intent(in) :: occupied, wanted

    split = 1
    do while (split < cells%split .and. int(split, i8)**cells%nd < (wanted - 1)/max(1_i8, occupied) + 1)
      split = split + 1
    end do
  end function split_for

  !> Groups for the cells that are not empty. By weight and by cells a group is up to twice the mean: four times as many as
  !> fill cell_limit leave room.
  pure integer function number_of_groups(occupied, pieces, n_subdomains, cell_limit) result(n)
    integer(i8), intent(in) :: occupied, pieces, cell_limit
    integer, intent(in) :: n_subdomains
    real(dp) :: wanted

    wanted = 4.0_dp*real(occupied, dp)*real(pieces, dp)/real(cell_limit, dp)
    wanted = max(wanted, real(n_subdomains, dp)/subdomains_per_group)
    n = int(min(wanted, real(occupied/cells_per_group, dp), real(n_subdomains/least_per_group, dp)), i4)
    n = max(1, n)
  end function number_of_groups

  !> Weights of the pieces, brought to the ranks that cut their groups: (group, entry, weight), sorted, each once.
  subroutine gather_pieces(groups, comm, points, weights, records)
    type(cell_groups_t), intent(in) :: groups
    type(communicator_t), intent(in) :: comm
    real(dp), intent(in), contiguous :: points(:, :)
    integer, intent(in), contiguous :: weights(:)
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer(i8), allocatable :: own(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: k, n, place(3)

    allocate (own(3, count(weights > 0)))
    n = 0
    do k = 1, size(weights)
      if (weights(k) <= 0) cycle
      n = n + 1
      call groups%cells%locate(points(:, k), place)
      own(1, n) = groups%group_of_cell(groups%cells%cell_at(place))
      own(2, n) = groups%entry_at(place)
      own(3, n) = weights(k)
    end do
    call merge_records(own, records)
    allocate (destination(size(records, 2)))
    do k = 1, size(destination)
      destination(k) = comm%rank_of(narrow(records(1, k)), groups%n)
    end do
    call sparse_exchange(comm, records, destination, received)
    call merge_records(received, records)
  end subroutine gather_pieces

  !> Sort records (group, entry, weight) and add up those of the same entry.
  subroutine merge_records(records, merged)
    integer(i8), intent(in), contiguous :: records(:, :)
    integer(i8), allocatable, intent(out) :: merged(:, :)
    integer(i8), allocatable :: work(:, :)
    integer, allocatable :: order(:)
    integer :: k, n

    allocate (order(size(records, 2)), work(3, size(records, 2)))
    call argsort_rows(records, order)
    n = 0
    do k = 1, size(order)
      if (n > 0) then
        if (all(work(1:2, n) == records(1:2, order(k)))) then
          work(3, n) = work(3, n) + records(3, order(k))
          cycle
        end if
      end if
      n = n + 1
      work(:, n) = records(:, order(k))
    end do
    allocate (merged(3, n))
    merged(:, :) = work(:, 1:n)
  end subroutine merge_records

  !> Pieces of each group and their weight.
  pure subroutine sum_pieces(records, pieces, weight)
    !> (group, entry, weight), each entry once
    integer(i8), intent(in), contiguous :: records(:, :)
    !> (groups)
    integer(i8), intent(out), contiguous :: pieces(:), weight(:)
    integer :: k

    pieces(:) = 0
    weight(:) = 0
    do k = 1, size(records, 2)
      pieces(records(1, k)) = pieces(records(1, k)) + 1
      weight(records(1, k)) = weight(records(1, k)) + records(3, k)
    end do
  end subroutine sum_pieces

  !> Numbers of subdomains about as the weights, at least 1 and at most `most` each, so that the largest weight per
  !> subdomain is least: below the mean times total/(total - groups) where `most` does not bind.
  pure subroutine share_out(weight, most, total, counts)
    !> (groups); most is at least 1, and their sum at least total, which is at least the number of groups
    integer(i8), intent(in), contiguous :: weight(:), most(:)
    integer, intent(in) :: total
    !> (groups)
    integer, intent(out), contiguous :: counts(:)
    real(dp) :: low, high, load
    integer :: g, k

    ! the least load that `total` can bear, by bisection
    low = 0.0_dp
    high = real(maxval(weight), dp)
    do k = 1, 80
      load = 0.5_dp*(low + high)
      if (count_for(weight, most, load) <= total) then
        high = load
      else
        low = load
      end if
    end do
    do g = 1, size(counts)
      counts(g) = needed_for(weight(g), most(g), high)
    end do
    do k = sum(counts) + 1, total
      g = maxloc(real(weight, dp)/counts, dim=1, mask=counts < most)
      counts(g) = counts(g) + 1
    end do
  end subroutine share_out

  !> Subdomains that a group needs so that none bears more than `load`, or as many as it can have.
  pure integer function needed_for(weight, most, load) result(needed)
    integer(i8), intent(in) :: weight, most
    real(dp), intent(in) :: load
    needed = max(1, ceiling(min(real(weight, dp)/load, real(min(most, int(huge(1), i8)), dp))))
  end function needed_for

  pure integer(i8) function count_for(weight, most, load) result(counted)
    integer(i8), intent(in), contiguous :: weight(:), most(:)
    real(dp), intent(in) :: load
    integer :: g

    counted = 0
    do g = 1, size(weight)
      counted = counted + needed_for(weight(g), most(g), load)
    end do
  end function count_for

  !> Cut the groups that this rank has the pieces of.
  subroutine cut_own_groups(groups, comm, records, error)
    type(cell_groups_t), intent(inout) :: groups
    type(communicator_t), intent(in) :: comm
    !> (group, entry, weight), sorted
    integer(i8), intent(in), contiguous :: records(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: weight(:)
    integer, allocatable :: owner(:)
    integer :: g, k

    k = 1
    do g = 1, groups%n
      if (comm%rank_of(g, groups%n) /= comm%rank) cycle
      allocate (weight(groups%length(g)), source=0_i8)
      allocate (owner(groups%length(g)))
      do while (k <= size(records, 2))
        if (records(1, k) /= g) exit
        weight(records(2, k)) = records(3, k)
        k = k + 1
      end do
      call cut_group(groups, g, weight, groups%first(g + 1) - groups%first(g), owner, error)
      if (allocated(error)) return
      owner(:) = owner + groups%first(g) - 1
      call groups%hold(g)
      call move_alloc(owner, groups%maps(groups%known(g))%subdomain)
      deallocate (weight)
    end do
  end subroutine cut_own_groups

end module gravier_cell_levels
