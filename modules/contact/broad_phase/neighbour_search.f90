!> Search for near pairs: grids of cells, one for each class of radii, find who is near whom; partitions of space decide
!> which subdomain a pair belongs to.
module gravier_neighbour_search
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort_rows
  use gravier_periodic, only: period_t, no_shift, shift_code
  use gravier_body_store, only: body_set_t
  use gravier_shape_library, only: point_counts_t
  use gravier_facet, only: near_facets_t
  use gravier_boundary, only: boundary_t
  use gravier_cell_hash, only: cell_hash_t, cell_key, n_levels, last_cell
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_pair_places, only: has_facets, repeat_pairs
  use gravier_neighbour_rule, only: neighbour_rule_t, owner_point
  use gravier_region, only: region_t
  implicit none
  private
  public :: neighbour_search_t, sweep_order

  !> The search for the near pairs that belong to one subdomain: what it knows besides the grains.
  type :: neighbour_search_t
    type(neighbour_rule_t) :: rule
    type(period_t) :: period
    type(boundary_t), allocatable :: boundaries(:)
    !> whose pairs are listed
    integer :: subdomain = 0
    !> of the shapes of bodies, where these have some
    type(point_counts_t) :: counts
  contains
    procedure :: find => search_find
  end type neighbour_search_t

  !> The grains and periodic images of them, where pairs are searched, in grids of cells: one for each class of radii.
  type :: entries_t
    integer :: n = 0
    !> place among the bodies (n)
    integer, allocatable :: body(:)
    !> periods by which it is shifted (3, n); of a period alone
    integer, allocatable :: shift(:, :)
    !> with the shift (nd, n) [m]
    real(dp), allocatable :: position(:, :)
    !> class of the radius (n), and whether a class has an entry
    integer, allocatable :: level(:)
    logical :: used(0:n_levels - 1) = .false.
    !> corner from which cells are counted (nd), and the edge of the cells of each class [m]
    real(dp), allocatable :: lower(:)
    real(dp) :: edge(0:n_levels - 1) = 1.0_dp
    !> entries by their cells
    type(cell_hash_t) :: hash
  contains
    procedure :: place => entries_place
  end type entries_t

  !> offsets of the cells searched from a cell besides itself: half of its neighbours, so that a pair is met once
  integer, parameter :: half_stencil(3, 13) = reshape([ &
    & 1, 0, 0, -1, 1, 0, 0, 1, 0, 1, 1, 0, &
    & -1, -1, 1, 0, -1, 1, 1, -1, 1, -1, 0, 1, 0, 0, 1, 1, 0, 1, -1, 1, 1, 0, 1, 1, 1, 1, 1], [3, 13])

contains

  !> Order of points along rows of cells, the last axis slowest, then by identifier: it depends on the set of points alone.
  subroutine sweep_order(points, lower, edge, id, order)
    !> (nd, n) [m]
    real(dp), intent(in), contiguous :: points(:, :)
    !> corner from which cells are counted (nd), and their edge [m]
    real(dp), intent(in) :: lower(:), edge
    !> (identifiers of a point, n)
    integer(i8), intent(in), contiguous :: id(:, :)
    !> (n) permutation to apply
    integer, intent(out), contiguous :: order(:)
    integer(i8), allocatable :: keys(:, :)
    integer :: k, place(3)

    allocate (keys(1 + size(id, 1), size(points, 2)))
    do k = 1, size(points, 2)
      place(:) = place_of(points(:, k), lower, edge)
      keys(1, k) = cell_key(0, place)
      keys(2:, k) = id(:, k)
    end do
    call argsort_rows(keys, order)
  end subroutine sweep_order

  !> Cell of a point along each axis, from 0 at `lower`. Far out the numbers begin again, so that cells stay small wherever
  !> a grain has flown: what shares a number with cells far away is told from them by its distance.
  pure function place_of(point, lower, edge) result(place)
    real(dp), intent(in) :: point(:), lower(:), edge
    integer :: place(3), d
    !> a number that i8 can hold
    real(dp), parameter :: farthest = 2.0_dp**62
    integer(i8) :: cell

    place(:) = 0
    do d = 1, size(point)
      cell = int(min(max((point(d) - lower(d))/edge, 0.0_dp), farthest), i8)
      place(d) = narrow(iand(cell, int(last_cell, i8)))
    end do
  end function place_of

  !> List the near pairs that belong to the subdomain, in sweep order, with nothing kept.
  subroutine search_find(self, bodies, owned, region, memory, list)
    class(neighbour_search_t), intent(in) :: self
    !> the grains that the subdomain sees, wrapped into the period
    type(body_set_t), intent(in) :: bodies
    !> (n) subdomain that holds each grain's centre
    integer, intent(in), contiguous :: owned(:)
    !> which says the subdomain of a point
    class(region_t), intent(in) :: region
    !> what the list keeps of each pair
    type(pair_memory_t), intent(in) :: memory
    type(neighbour_list_t), intent(inout) :: list
    type(entries_t) :: entries
    real(dp), allocatable :: extent(:)
    integer :: k

    call list%init(self%period%on(), 4*bodies%n + 16)
    if (bodies%n > 0) then
      allocate (extent(bodies%n))
      do k = 1, bodies%n
        extent(k) = self%rule%extent(bodies%radius(k), norm2(bodies%velocity(1:bodies%nd, k)))
      end do
      call make_entries(bodies, extent, self%period, self%rule, entries)
      call hash_entries(entries, extent, self%rule)
      call search_boundaries(self, bodies, extent, owned, list)
      call search_class(self, bodies, extent, region, entries, list)
      if (count(entries%used) > 1) call search_larger(self, bodies, extent, region, entries, list)
    end if
    call sort_list(self, bodies, memory, list)
  end subroutine search_find

  !> Sort entries into the cells of their classes.
  subroutine hash_entries(entries, extent, rule)
    type(entries_t), intent(inout) :: entries
    !> of the bodies [m]
    real(dp), intent(in), contiguous :: extent(:)
    type(neighbour_rule_t), intent(in) :: rule
    integer(i8), allocatable :: keys(:)
    real(dp) :: lower(size(entries%position, 1)), largest
    integer :: e, l, place(3)

    lower(:) = minval(entries%position, dim=2)
    entries%lower = lower
    largest = maxval(extent)
    do l = 0, n_levels - 1
      entries%edge(l) = 2.0_dp*largest*0.5_dp**l + rule%alert_distance
      if (.not. entries%edge(l) > 0.0_dp) entries%edge(l) = 1.0_dp
    end do
    allocate (keys(entries%n), entries%level(entries%n))
    do e = 1, entries%n
      l = level_of(extent(entries%body(e)), largest)
      entries%level(e) = l
      entries%used(l) = .true.
      place(:) = entries%place(e, l)
      keys(e) = cell_key(l, place)
    end do
    call entries%hash%init(keys)
  end subroutine hash_entries

  !> Cell of entry e in the grid of a class.
  pure function entries_place(self, e, level) result(place)
    class(entries_t), intent(in) :: self
    integer, intent(in) :: e, level
    integer :: place(3)
    place(:) = place_of(self%position(:, e), self%lower, self%edge(level))
  end function entries_place

  !> List the grains of the subdomain that are near a boundary.
  subroutine search_boundaries(self, bodies, extent, owned, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    integer, intent(in), contiguous :: owned(:)
    type(neighbour_list_t), intent(inout) :: list
    integer :: k, b
    real(dp) :: distance, normal(bodies%nd), range(size(self%boundaries))
    type(near_facets_t) :: near

    do b = 1, size(self%boundaries)
      range(b) = self%rule%alert_distance + self%rule%margin(norm2(self%boundaries(b)%velocity))
    end do
    do k = 1, bodies%n
      if (owned(k) /= self%subdomain .or. bodies%glued(k) > 0) cycle
      do b = 1, size(self%boundaries)
        if (.not. self%boundaries(b)%touches()) cycle
        if (self%rule%filter%lets_pass(bodies, self%boundaries, k, -b)) cycle
        if (self%boundaries(b)%is_faceted()) then
          call self%boundaries(b)%find_facets(bodies%position(:, k), extent(k) + range(b), near)
          if (near%n > 0) call list%add(k, -b, no_shift)
          cycle
        end if
        call self%boundaries(b)%locate(bodies%position(:, k), distance, normal)
        if (distance - extent(k) <= range(b)) call list%add(k, -b, no_shift)
      end do
    end do
  end subroutine search_boundaries

  !> List the near pairs of entries of one class: those in a cell, and those in cells that touch.
  subroutine search_class(self, bodies, extent, region, entries, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    class(region_t), intent(in) :: region
    type(entries_t), intent(in) :: entries
    type(neighbour_list_t), intent(inout) :: list
    integer :: cell, other, a, b, l, k, place(3), near(3)

    associate (hash => entries%hash)
      do cell = 1, hash%n_cells
        a = hash%order(hash%first(cell))
        l = entries%level(a)
        place(:) = entries%place(a, l)
        do a = hash%first(cell), hash%first(cell + 1) - 1
          do b = a + 1, hash%first(cell + 1) - 1
            call test_pair(self, bodies, extent, region, entries, hash%order(a), hash%order(b), list)
          end do
        end do
        do k = 1, merge(4, 13, bodies%nd == 2)
          near(:) = iand(place + half_stencil(:, k), last_cell)
          other = hash%find(cell_key(l, near))
          if (other == 0 .or. other == cell) cycle
          do a = hash%first(cell), hash%first(cell + 1) - 1
            do b = hash%first(other), hash%first(other + 1) - 1
              call test_pair(self, bodies, extent, region, entries, hash%order(a), hash%order(b), list)
            end do
          end do
        end do
      end do
    end associate
  end subroutine search_class

  !> List the near pairs of two classes. A grain of a larger class never lies farther off than one of the cells of that class.
  subroutine search_larger(self, bodies, extent, region, entries, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    class(region_t), intent(in) :: region
    type(entries_t), intent(in) :: entries
    type(neighbour_list_t), intent(inout) :: list
    integer :: other, a, b, l, x, y, z, layers, place(3), near(3)

    layers = merge(1, 0, bodies%nd == 3)
    do a = 1, entries%n
      do l = 0, entries%level(a) - 1
        if (.not. entries%used(l)) cycle
        place(:) = entries%place(a, l)
        do z = -layers, layers
          do y = -1, 1
            do x = -1, 1
              near(1) = place(1) + x
              near(2) = place(2) + y
              near(3) = place(3) + z
              near(:) = iand(near, last_cell)
              other = entries%hash%find(cell_key(l, near))
              if (other == 0) cycle
              do b = entries%hash%first(other), entries%hash%first(other + 1) - 1
                call test_pair(self, bodies, extent, region, entries, a, entries%hash%order(b), list)
              end do
            end do
          end do
        end do
      end do
    end do
  end subroutine search_larger

  !> List entries a and b where they are near, the subdomain owns their pair, and this is the one of its images that counts.
  subroutine test_pair(self, bodies, extent, region, entries, a, b, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    class(region_t), intent(in) :: region
    type(entries_t), intent(in) :: entries
    integer, intent(in) :: a, b
    type(neighbour_list_t), intent(inout) :: list
    integer :: i, j, shift(3), periods(3)
    real(dp) :: antagonist(3), point(3), square
    logical :: periodic
    integer :: d, nd

    i = entries%body(a)
    j = entries%body(b)
    nd = bodies%nd
    square = 0.0_dp
    do d = 1, nd
      square = square + (entries%position(d, a) - entries%position(d, b))**2
    end do
    if (square > (extent(i) + extent(j) + self%rule%alert_distance)**2) return
    if (bodies%glued(i) > 0 .and. bodies%glued(j) > 0) return
    if (allocated(self%rule%filter%passes)) then
      if (self%rule%filter%lets_pass(bodies, self%boundaries, i, j)) return
    end if
    periodic = self%period%on()
    shift(:) = 0
    if (periodic) then
      if (i == j) return
      shift(:) = entries%shift(:, b) - entries%shift(:, a)
      periods(:) = entries%shift(:, a)
      if (bodies%id(j) < bodies%id(i)) then
        shift(:) = -shift
        periods(:) = entries%shift(:, b)
      end if
    end if
    if (bodies%id(j) < bodies%id(i)) then
      i = entries%body(b)
      j = entries%body(a)
    end if
    antagonist(1:nd) = bodies%position(:, j)
    if (periodic) antagonist(1:nd) = antagonist(1:nd) + shift(1:nd)*self%period%length(1:nd)
    point(1:nd) = owner_point(self%rule%kind, bodies%position(:, i), antagonist(1:nd))
    if (periodic) then
      if (.not. is_where_owned(self%period, point(1:nd), periods)) return
    end if
    if (region%owner(point(1:nd)) /= self%subdomain) return
    call list%add(i, j, merge(shift_code(shift), no_shift, periodic))
  end subroutine test_pair

  !> Put the pairs in sweep order of their owner points.
  subroutine sort_list(self, bodies, memory, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    type(pair_memory_t), intent(in) :: memory
    type(neighbour_list_t), intent(inout) :: list
    integer(i8), allocatable :: id(:, :)
    real(dp), allocatable :: point(:, :)
    integer, allocatable :: order(:)
    real(dp) :: antagonist(bodies%nd), lower(bodies%nd)
    integer :: p, nd

    nd = bodies%nd
    allocate (id(2, list%n), point(nd, list%n), order(list%n))
    do p = 1, list%n
      id(1, p) = bodies%id(list%candidate(p))
      if (list%antagonist(p) < 0) then
        id(2, p) = list%antagonist(p)
        point(:, p) = bodies%position(:, list%candidate(p))
      else
        id(2, p) = bodies%id(list%antagonist(p))
        antagonist(:) = bodies%position(:, list%antagonist(p))
        if (self%period%on()) call self%period%add_shift(list%shift(p), 1, antagonist)
        point(:, p) = owner_point(self%rule%kind, bodies%position(:, list%candidate(p)), antagonist)
      end if
    end do
    lower(:) = 0.0_dp
    if (list%n > 0) lower(:) = minval(point, dim=2)
    call sweep_order(point, lower, self%rule%sweep_edge(), id, order)
    if (bodies%no > 0 .or. has_facets(self%boundaries)) call repeat_pairs(self%counts, self%boundaries, self%rule, bodies, &
      & list, order)
    call list%finish(order, memory)
  end subroutine sort_list

  !> Class of a radius: the grid whose cells are as large as its pairs need.
  pure integer function level_of(radius, largest) result(level)
    real(dp), intent(in) :: radius, largest
    real(dp) :: half

    level = 0
    half = 0.5_dp*largest
    do while (radius <= half .and. level < n_levels - 1)
      level = level + 1
      half = 0.5_dp*half
    end do
  end function level_of

  !> Whether a pair is met where its owner point lies in the cell: of all its images one is. The point is wrapped.
  logical function is_where_owned(period, point, periods)
    type(period_t), intent(in) :: period
    !> owner point of the image whose candidate is not shifted (nd) [m]
    real(dp), intent(inout) :: point(:)
    !> by which the candidate is shifted in the image met
    integer, intent(in) :: periods(3)
    integer :: turns(3)

    turns(:) = 0
    call period%wrap(point, turns(1:size(point)))
    is_where_owned = all(periods == -turns)
  end function is_where_owned

  !> The grains and those of their periodic images that may meet another one.
  subroutine make_entries(bodies, extent, period, rule, entries)
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    type(period_t), intent(in) :: period
    type(neighbour_rule_t), intent(in) :: rule
    type(entries_t), intent(out) :: entries
    integer :: k, x, y, z, low(3), high(3), round, n
    real(dp) :: largest

    if (.not. period%on()) then
      entries%n = bodies%n
      entries%position = bodies%position
      allocate (entries%body(bodies%n))
      do k = 1, bodies%n
        entries%body(k) = k
      end do
      return
    end if
    largest = maxval(extent)
    do round = 1, 2
      n = 0
      do k = 1, bodies%n
        call image_range(bodies%position(:, k), extent(k) + largest + rule%alert_distance, low, high)
        do z = low(3), high(3)
          do y = low(2), high(2)
            do x = low(1), high(1)
              n = n + 1
              if (round == 1) cycle
              entries%body(n) = k
              entries%shift(1, n) = x
              entries%shift(2, n) = y
              entries%shift(3, n) = z
              entries%position(:, n) = bodies%position(:, k) + entries%shift(1:bodies%nd, n)*period%length(1:bodies%nd)
            end do
          end do
        end do
      end do
      entries%n = n
      if (round == 1) allocate (entries%body(n), entries%shift(3, n), entries%position(bodies%nd, n))
    end do

  contains

    !> Shifts that leave a grain within `margin` of the cell.
    pure subroutine image_range(x, margin, low, high)
      real(dp), intent(in) :: x(:), margin
      integer, intent(out) :: low(3), high(3)
      integer :: d

      low(:) = 0
      high(:) = 0
      do d = 1, size(x)
        if (.not. period%length(d) > 0.0_dp) cycle
        if (x(d) - period%origin(d) <= margin) high(d) = 1
        if (period%origin(d) + period%length(d) - x(d) <= margin) low(d) = -1
      end do
    end subroutine image_range

  end subroutine make_entries

end module gravier_neighbour_search
