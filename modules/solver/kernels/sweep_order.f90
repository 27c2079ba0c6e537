!> The order in which a subdomain's contacts are swept: in blocks whose contacts share no moving body, the points of a pair of
!> bodies together.
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

  !> Contacts that stay together: each for itself, or the points in which a pair of bodies touches.
  type :: pairs_t
    integer :: n = 0
    !> most points of a pair
    integer :: most = 1
    !> first contact of each pair, and the one behind the last (n + 1); not allocated where each contact is for itself
    integer, allocatable :: first(:)
  contains
    procedure :: find => pairs_find
    procedure :: first_of => pairs_first_of
    procedure :: points_of => pairs_points_of
  end type pairs_t

  !> The blocks that are under way.
  type :: open_blocks_t
    !> pairs of each block
    integer :: member(lanes, 0:n_open - 1) = 0, filled(0:n_open - 1) = 0
    !> blocks, as bits, that are full; that hold pairs of so many points (most); that a body is in (n_moving)
    integer(i8) :: full = 0_i8
    integer(i8), allocatable :: with_points(:), of_body(:)
  contains
    procedure :: place => open_blocks_place
    procedure :: close => open_blocks_close
  end type open_blocks_t

contains

  !> Put contacts in blocks of `lanes` in which no moving body occurs twice, close to the order in which they come. A window
  !> slides over them: each contact takes a place in the first of `n_open` blocks that holds neither of its bodies; full blocks
  !> are done, those of the others move on with the window. What finds no place, as many contacts of one large body, is
  !> swept after the blocks, one contact at a time.
  !>
  !> The points in which a pair of bodies touches may stay together. A pair then takes one lane of as many blocks as it has points,
  !> which follow each other; the pairs of such a group of blocks have equally many points. The points of a pair that found no place
  !> follow each other.
  subroutine group_contacts(pair, n_moving, by_pairs, order, n_grouped)
    !> (2, n): bodies above n_moving cannot move, and blocks may share them
    integer, intent(in), contiguous :: pair(:, :)
    integer, intent(in) :: n_moving
    !> contacts one after the other with the same columns are points of a pair, and stay together
    logical, intent(in) :: by_pairs
    !> (n): the contacts in their new order, the first n_grouped of them in whole blocks
    integer, intent(out), contiguous :: order(:)
    integer, intent(out) :: n_grouped
    logical, allocatable :: grouped(:)
    integer :: waiting(n_open*lanes), n_waiting, next, taken, last, u, k, g
    type(pairs_t) :: pairs
    type(open_blocks_t) :: open

    n_grouped = 0
    call pairs%find(pair, by_pairs)
    allocate (grouped(pairs%n), source=.false.)
    if (pairs%n >= worth_grouping) then
      allocate (open%of_body(n_moving), open%with_points(pairs%most), source=0_i8)
      n_waiting = 0
      next = 1
      do while (next <= pairs%n)
        taken = n_waiting
        do k = 1, n_waiting
          call open%place(pairs, pair, n_moving, waiting(k))
        end do
        last = min(pairs%n, next - 1 + max(fresh, window - taken))
        do u = next, last
          call open%place(pairs, pair, n_moving, u)
        end do
        next = last + 1
        n_waiting = 0
        do g = 0, n_open - 1
          if (open%filled(g) == lanes) then
            call write_block(pairs, open%member(:, g), order, n_grouped)
            do k = 1, lanes
              grouped(open%member(k, g)) = .true.
            end do
          else
            waiting(n_waiting + 1:n_waiting + open%filled(g)) = open%member(1:open%filled(g), g)
            n_waiting = n_waiting + open%filled(g)
          end if
        end do
        call open%close(pairs, pair, n_moving)
      end do
    end if
    k = n_grouped
    do u = 1, pairs%n
      if (grouped(u)) cycle
      do g = 1, pairs%points_of(u)
        k = k + 1
        order(k) = pairs%first_of(u) + g - 1
      end do
    end do
  end subroutine group_contacts

  !> Put the points of the pairs of a full block, which have equally many, in their places.
  pure subroutine write_block(pairs, members, order, n_grouped)
    type(pairs_t), intent(in) :: pairs
    integer, intent(in) :: members(lanes)
    integer, intent(inout), contiguous :: order(:)
    integer, intent(inout) :: n_grouped
    integer :: point, lane

    do point = 1, pairs%points_of(members(1))
      do lane = 1, lanes
        order(n_grouped + lane) = pairs%first_of(members(lane)) + point - 1
      end do
      n_grouped = n_grouped + lanes
    end do
  end subroutine write_block

  !> Find what stays together.
  pure subroutine pairs_find(self, pair, by_pairs)
    class(pairs_t), intent(inout) :: self
    !> (2, n)
    integer, intent(in), contiguous :: pair(:, :)
    logical, intent(in) :: by_pairs
    integer :: c

    self%n = size(pair, 2)
    if (.not. by_pairs) return
    allocate (self%first(size(pair, 2) + 1))
    self%n = 0
    do c = 1, size(pair, 2)
      if (c > 1) then
        if (all(pair(:, c) == pair(:, c - 1))) cycle
      end if
      self%n = self%n + 1
      self%first(self%n) = c
    end do
    self%first(self%n + 1) = size(pair, 2) + 1
    do c = 1, self%n
      self%most = max(self%most, self%points_of(c))
    end do
  end subroutine pairs_find

  !> First contact of pair `u`.
  pure integer function pairs_first_of(self, u) result(first)
    class(pairs_t), intent(in) :: self
    integer, intent(in) :: u

    first = u
    if (allocated(self%first)) first = self%first(u)
  end function pairs_first_of

  !> Points of pair `u`.
  pure integer function pairs_points_of(self, u) result(points)
    class(pairs_t), intent(in) :: self
    integer, intent(in) :: u

    points = 1
    if (allocated(self%first)) points = self%first(u + 1) - self%first(u)
  end function pairs_points_of

  !> Give a pair a lane of the first block that holds none of its bodies and no pairs with another number of points; none where all
  !> blocks do.
  pure subroutine open_blocks_place(self, pairs, pair, n_moving, u)
    class(open_blocks_t), intent(inout) :: self
    type(pairs_t), intent(in) :: pairs
    integer, intent(in), contiguous :: pair(:, :)
    integer, intent(in) :: n_moving
    integer, intent(in) :: u
    integer(i8) :: taken
    integer :: i, j, points, other, g

    i = pair(1, pairs%first_of(u))
    j = pair(2, pairs%first_of(u))
    points = pairs%points_of(u)
    taken = self%full
    do other = 1, pairs%most
      if (other /= points) taken = ior(taken, self%with_points(other))
    end do
    if (i <= n_moving) taken = ior(taken, self%of_body(i))
    if (j <= n_moving) taken = ior(taken, self%of_body(j))
    g = trailz(not(taken))
    if (g == n_open) return
    self%with_points(points) = ibset(self%with_points(points), g)
    self%filled(g) = self%filled(g) + 1
    self%member(self%filled(g), g) = u
    if (self%filled(g) == lanes) self%full = ibset(self%full, g)
    if (i <= n_moving) self%of_body(i) = ibset(self%of_body(i), g)
    if (j <= n_moving) self%of_body(j) = ibset(self%of_body(j), g)
  end subroutine open_blocks_place

  !> Empty all blocks.
  pure subroutine open_blocks_close(self, pairs, pair, n_moving)
    class(open_blocks_t), intent(inout) :: self
    type(pairs_t), intent(in) :: pairs
    integer, intent(in), contiguous :: pair(:, :)
    integer, intent(in) :: n_moving
    integer :: g, k, side, b

    do g = 0, n_open - 1
      do k = 1, self%filled(g)
        do side = 1, 2
          b = pair(side, pairs%first_of(self%member(k, g)))
          if (b <= n_moving) self%of_body(b) = 0_i8
        end do
      end do
    end do
    self%filled(:) = 0
    self%full = 0_i8
    self%with_points(:) = 0_i8
  end subroutine open_blocks_close

end module gravier_sweep_order
