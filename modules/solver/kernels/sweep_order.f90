!> The order in which a subdomain's contacts are swept: in blocks whose contacts share no moving body.
module gravier_sweep_order
  use gravier_kinds, only: i8
  use gravier_contact_kernels, only: lanes
  implicit none
  private
  public :: group_contacts

  !> blocks under way at a time
  integer, parameter :: n_open = 64
  !> contacts that a window takes: a part of what its blocks hold, so that most find a place; and at least so many new ones
  integer, parameter :: window = 3*n_open*lanes/4, fresh = window/3
  !> below so many contacts blocks stay few and incomplete: a subdomain keeps its order
  integer, parameter :: worth_grouping = 16*lanes

contains

  !> Put contacts in blocks of `lanes` in which no moving body occurs twice, close to the order in which they come. A window
  !> slides over them: each contact takes a place in the first of `n_open` blocks that holds neither of its bodies; full blocks
  !> are done, those of the others move on with the window. What finds no place, as many contacts of one large body, is
  !> swept after the blocks, one contact at a time.
  subroutine group_contacts(pair, n_moving, order, n_grouped)
    !> (2, n): bodies above n_moving cannot move, and blocks may share them
    integer, intent(in), contiguous :: pair(:, :)
    integer, intent(in) :: n_moving
    !> (n): the contacts in their new order, the first n_grouped of them in whole blocks
    integer, intent(out), contiguous :: order(:)
    integer, intent(out) :: n_grouped
    !> blocks, as bits, that a body is in
    integer(i8), allocatable :: blocks_of(:)
    logical, allocatable :: grouped(:)
    integer :: member(lanes, 0:n_open - 1), filled(0:n_open - 1), waiting(n_open*lanes), n_waiting, next, taken, last, c, k, g
    integer(i8) :: full

    n_grouped = 0
    allocate (grouped(size(order)), source=.false.)
    if (size(order) >= worth_grouping) then
      allocate (blocks_of(n_moving), source=0_i8)
      n_waiting = 0
      next = 1
      do while (next <= size(order))
        full = 0_i8
        filled(:) = 0
        taken = n_waiting
        do k = 1, n_waiting
          call place(waiting(k))
        end do
        last = min(size(order), next - 1 + max(fresh, window - taken))
        do c = next, last
          call place(c)
        end do
        next = last + 1
        n_waiting = 0
        do g = 0, n_open - 1
          do k = 1, filled(g)
            call forget(pair(1, member(k, g)))
            call forget(pair(2, member(k, g)))
          end do
          if (filled(g) == lanes) then
            order(n_grouped + 1:n_grouped + lanes) = member(:, g)
            do k = 1, lanes
              grouped(member(k, g)) = .true.
            end do
            n_grouped = n_grouped + lanes
          else
            waiting(n_waiting + 1:n_waiting + filled(g)) = member(1:filled(g), g)
            n_waiting = n_waiting + filled(g)
          end if
        end do
      end do
    end if
    call append_others(grouped, order, n_grouped)

  contains

    !> Give a contact a place in the first open block that holds neither of its bodies, if there is one.
    subroutine place(c)
      integer, intent(in) :: c
      integer(i8) :: taken_by

      taken_by = full
      if (pair(1, c) <= n_moving) taken_by = ior(taken_by, blocks_of(pair(1, c)))
      if (pair(2, c) <= n_moving) taken_by = ior(taken_by, blocks_of(pair(2, c)))
      g = trailz(not(taken_by))
      if (g == n_open) return
      filled(g) = filled(g) + 1
      member(filled(g), g) = c
      if (filled(g) == lanes) full = ibset(full, g)
      if (pair(1, c) <= n_moving) blocks_of(pair(1, c)) = ibset(blocks_of(pair(1, c)), g)
      if (pair(2, c) <= n_moving) blocks_of(pair(2, c)) = ibset(blocks_of(pair(2, c)), g)
    end subroutine place

    !> A body is in no open block any more.
    subroutine forget(b)
      integer, intent(in) :: b
      if (b <= n_moving) blocks_of(b) = 0_i8
    end subroutine forget

  end subroutine group_contacts

  !> The contacts that are in no block, after those that are.
  pure subroutine append_others(grouped, order, n_grouped)
    logical, intent(in), contiguous :: grouped(:)
    integer, intent(inout), contiguous :: order(:)
    integer, intent(in) :: n_grouped
    integer :: c, k

    k = n_grouped
    do c = 1, size(order)
      if (grouped(c)) cycle
      k = k + 1
      order(k) = c
    end do
  end subroutine append_others

end module gravier_sweep_order
