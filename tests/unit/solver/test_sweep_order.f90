!> The order in which contacts are swept: blocks that share no moving body, close to the order that contacts came in.
program test_sweep_order
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_contact_kernels, only: lanes
  use gravier_sweep_order, only: group_contacts
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> contacts that are worth grouping, and how far a window reaches: 3/4 of what 64 blocks hold
  integer, parameter :: threshold = 16*lanes, window = 48*lanes
  !> bodies; the last two cannot move
  integer, parameter :: n_random = 400

  call MPI_Init()
  call test_few()
  call test_lattice()
  call test_random()
  call test_large_body()
  call test_prescribed()
  call test_chain()
  call test_ring()
  call finish_checks()
  call MPI_Finalize()

contains

  !> What holds for any contacts: a permutation of them, whole blocks in which no moving body occurs twice, and what found
  !> no block in ascending order.
  subroutine check_order(pair, n_moving, order, n_grouped, name)
    !> (2, n)
    integer, intent(in) :: pair(:, :), n_moving, order(:), n_grouped
    character(len=*), intent(in) :: name
    integer, allocatable :: met(:), last_block(:)
    integer :: k, side, b
    logical :: apart

    allocate (met(size(order)), last_block(n_moving), source=0)
    do k = 1, size(order)
      met(order(k)) = met(order(k)) + 1
    end do
    call check(all(met == 1), name//": every contact once")
    call check(n_grouped >= 0 .and. n_grouped <= size(order) .and. mod(n_grouped, lanes) == 0, name//": whole blocks")
    apart = .true.
    do k = 1, n_grouped
      do side = 1, 2
        b = pair(side, order(k))
        if (b > n_moving) cycle
        apart = apart .and. last_block(b) /= (k - 1)/lanes + 1
        last_block(b) = (k - 1)/lanes + 1
      end do
    end do
    call check(apart, name//": no moving body twice in a block")
    call check(all(order(n_grouped + 2:) > order(n_grouped + 1:size(order) - 1)), name//": the rest in ascending order")
  end subroutine check_order

  pure logical function is_natural(order)
    integer, intent(in) :: order(:)
    integer :: k

    is_natural = .true.
    do k = 1, size(order)
      is_natural = is_natural .and. order(k) == k
    end do
  end function is_natural

  !> Mean number of places that the grouped contacts move.
  pure real(dp) function mean_move(order, n_grouped)
    integer, intent(in) :: order(:), n_grouped
    integer :: k

    mean_move = 0.0_dp
    do k = 1, n_grouped
      mean_move = mean_move + abs(order(k) - k)
    end do
    mean_move = mean_move/max(n_grouped, 1)
  end function mean_move

  !> No contacts, and fewer than are worth grouping: the order stays; from there on contacts are grouped.
  subroutine test_few()
    integer :: pair(2, threshold), order(threshold), n, c, n_grouped

    do c = 1, threshold
      pair(1, c) = 2*c - 1
      pair(2, c) = 2*c
    end do
    do n = 0, threshold
      order(:) = 0
      call group_contacts(pair(:, 1:n), 2*threshold, order(1:n), n_grouped)
      call check_order(pair(:, 1:n), 2*threshold, order(1:n), n_grouped, "few")
      call check_equal(n_grouped, merge(n, 0, n == threshold), "few: grouped")
      if (n < threshold) call check(is_natural(order(1:n)), "few: the natural order")
    end do
  end subroutine test_few

  !> Contacts of a square lattice row by row, each body with the next one and with the one above.
  subroutine test_lattice()
    integer, parameter :: edge = 120
    integer, allocatable :: pair(:, :), order(:)
    integer :: x, y, b, n, side, n_grouped

    allocate (pair(2, 2*edge*edge), order(2*edge*edge))
    n = 0
    do y = 1, edge
      do x = 1, edge
        b = x + (y - 1)*edge
        do side = 1, 2
          if (merge(x, y, side == 1) == edge) cycle
          n = n + 1
          pair(1, n) = b
          pair(2, n) = b + merge(1, edge, side == 1)
        end do
      end do
    end do
    call group_contacts(pair(:, 1:n), edge*edge, order(1:n), n_grouped)
    call check_order(pair(:, 1:n), edge*edge, order(1:n), n_grouped, "lattice")
    ! all but what the last window leaves incomplete
    call check(n_grouped > n - window, "lattice: nearly all grouped")
    call check(mean_move(order(1:n), n_grouped) <= window, "lattice: close to the order that contacts came in")
  end subroutine test_lattice

  !> Any pairs, of bodies near each other in their numbers; some on bodies that cannot move. Sizes around those of a window.
  subroutine test_random()
    integer, parameter :: sizes(*) = [threshold, threshold + 1, window - 1, window, window + 1, 5*window + 3]
    integer, allocatable :: pair(:, :), order(:)
    integer :: k, c, n_grouped

    do k = 1, size(sizes)
      allocate (pair(2, sizes(k)), order(sizes(k)))
      do c = 1, size(order)
        pair(1, c) = 1 + int((n_random - 2)*hash_uniform(k, int(c, i8), 1))
        pair(2, c) = 1 + mod(pair(1, c) + int(30*hash_uniform(k, int(c, i8), 2)), n_random)
      end do
      call group_contacts(pair, n_random - 2, order, n_grouped)
      call check_order(pair, n_random - 2, order, n_grouped, "random")
      call check(n_grouped > 0, "random: some grouped")
      call check(mean_move(order, n_grouped) <= window, "random: close to the order that contacts came in")
      deallocate (pair, order)
    end do
  end subroutine test_random

  !> One body takes part in every other contact, thousands of them. A window of contacts places one with it in each of its
  !> blocks at most: most of these contacts are swept singly. The others, between pairs of their own, are grouped but for
  !> what the last window leaves incomplete.
  subroutine test_large_body()
    integer, parameter :: n = 8000, large = 2*n + 1
    integer :: pair(2, n), order(n), c, k, n_grouped, with_large

    do c = 1, n
      pair(1, c) = 2*c - 1
      pair(2, c) = 2*c
      ! as candidate and as antagonist in turn
      if (mod(c, 4) == 0) pair(1, c) = large
      if (mod(c, 4) == 2) pair(2, c) = large
    end do
    call group_contacts(pair, large, order, n_grouped)
    call check_order(pair, large, order, n_grouped, "large body")
    with_large = 0
    do k = n_grouped + 1, n
      if (any(pair(:, order(k)) == large)) with_large = with_large + 1
    end do
    call check(n - n_grouped - with_large <= window, "large body: contacts of others grouped")
    call check(with_large > n/4, "large body: its contacts one at a time")
    call check(with_large < n - n_grouped .or. with_large <= n/2, "large body: none lost")
  end subroutine test_large_body

  !> All contacts with one of two bodies that cannot move: blocks share them, in the order that contacts came in.
  subroutine test_prescribed()
    integer, parameter :: n = 4*window
    integer :: pair(2, n), order(n), c, k, n_grouped

    do c = 1, n
      ! the one that cannot move is the antagonist, at times the candidate
      k = merge(2, 1, mod(c, 7) == 0)
      pair(k, c) = c
      pair(3 - k, c) = n + 1 + mod(c, 2)
    end do
    call group_contacts(pair, n, order, n_grouped)
    call check_order(pair, n, order, n_grouped, "prescribed")
    call check_equal(n_grouped, n, "prescribed: all grouped")
    call check(is_natural(order), "prescribed: nothing in the way")
  end subroutine test_prescribed

  !> Each body touches the next one: neighbours of the chain go to different blocks.
  subroutine test_chain()
    integer, parameter :: n = 6*window + 5
    integer :: pair(2, n), order(n), c, n_grouped

    do c = 1, n
      pair(1, c) = c
      pair(2, c) = c + 1
    end do
    call group_contacts(pair, n + 1, order, n_grouped)
    call check_order(pair, n + 1, order, n_grouped, "chain")
    call check(n_grouped > n - window, "chain: nearly all grouped")
    ! odd and even contacts fill blocks in turn
    call check_close(mean_move(order, n_grouped), 0.5_dp*lanes, 0.5_dp*lanes, "chain: close to the order")
  end subroutine test_chain

  !> A few bodies in a ring touch again and again, each in more contacts than there are blocks under way: what was in a
  !> block that is done does not keep its bodies from others.
  subroutine test_ring()
    integer, parameter :: n = 20*window, bodies = 4*lanes
    integer, allocatable :: pair(:, :), order(:)
    integer :: c, n_grouped

    allocate (pair(2, n), order(n))
    do c = 1, n
      pair(1, c) = 1 + mod(c, bodies)
      pair(2, c) = 1 + mod(c + 1, bodies)
    end do
    call group_contacts(pair, bodies, order, n_grouped)
    call check_order(pair, bodies, order, n_grouped, "ring")
    call check(n_grouped > n - window, "ring: nearly all grouped")
  end subroutine test_ring

end program test_sweep_order
