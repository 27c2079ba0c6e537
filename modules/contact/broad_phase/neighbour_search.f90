!> Search for near pairs: grids of cells, one for each class of radii, find who is near whom; partitions of space decide
!> which subdomain a pair belongs to.
module gravier_neighbour_search
  use gravier_kinds, only: dp, i8
  use gravier_periodic, only: period_t, no_shift, shift_code, most_images
  use gravier_body_store, only: body_set_t
  use gravier_shape_library, only: point_counts_t
  use gravier_facet, only: near_facets_t
  use gravier_boundary, only: boundary_t
  use gravier_cell_order, only: sweep_order, place_of
  use gravier_cell_hash, only: cell_hash_t, cell_key, n_levels, last_cell
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_pair_places, only: has_facets, repeat_pairs
  use gravier_neighbour_rule, only: neighbour_rule_t, owner_point
  use gravier_region, only: region_t
  implicit none
  private
  public :: neighbour_search_t

  !> The search for the near pairs that belong to one subdomain: what it knows besides the grains.
  type :: neighbour_search_t
    type(neighbour_rule_t) :: rule
    type(period_t) :: period
    !> of the scene, which outlive the search
    type(boundary_t), pointer :: boundaries(:) => null()
    !> whose pairs are listed
    integer :: subdomain = 0
    !> whether the subdomain is all of space
    logical :: is_alone = .false.
    !> from which the cells of the order of pairs are counted [m]
    real(dp) :: corner(3) = 0.0_dp
    !> of the shapes of bodies, where these have some
    type(point_counts_t) :: counts
  contains
    procedure :: find => search_find
  end type neighbour_search_t

  !> The grains and periodic images of them, where pairs are searched, in the order of the cells of grids: one for each class of
  !> radii.
  type :: entries_t
    integer :: n = 0
    !> place among the bodies (n)
    integer, allocatable :: body(:)
    !> periods by which it is shifted (3, n, or 0 without a period)
    integer, allocatable :: shift(:, :)
    !> with the shift (nd, n) [m]
    real(dp), allocatable :: position(:, :)
    !> radius with margin (n) [m]
    real(dp), allocatable :: extent(:)
    !> class of the extent (n), and whether a class has an entry
    integer, allocatable :: level(:)
    logical :: used(0:n_levels - 1) = .false.
    !> corner from which cells are counted (nd), and the edge of the cells of each class [m]
    real(dp), allocatable :: lower(:)
    real(dp) :: edge(0:n_levels - 1) = 1.0_dp
    !> whose places in the order of cells are those of the entries
    type(cell_hash_t) :: hash
  contains
    procedure :: place => entries_place
    procedure :: are_near => entries_are_near
  end type entries_t

  !> offsets of the cells searched from a cell besides itself: half of its neighbours, so that a pair is met once
  integer, parameter :: half_stencil(3, 13) = reshape([ &
    & 1, 0, 0, -1, 1, 0, 0, 1, 0, 1, 1, 0, &
    & -1, -1, 1, 0, -1, 1, 1, -1, 1, -1, 0, 1, 0, 0, 1, 1, 0, 1, -1, 1, 1, 0, 1, 1, 1, 1, 1], [3, 13])

contains

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
      call search_class(self, bodies, region, entries, list)
      if (count(entries%used) > 1) call search_larger(self, bodies, region, entries, list)
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
    allocate (entries%extent(entries%n))
    do e = 1, entries%n
      entries%extent(e) = extent(entries%body(e))
      l = level_of(entries%extent(e), largest)
      entries%level(e) = l
      entries%used(l) = .true.
      place(:) = entries%place(e, l)
      keys(e) = cell_key(l, place)
    end do
    call entries%hash%init(keys)
    call reorder_entries(entries)
  end subroutine hash_entries

  !> Put entries in the order of their cells.
  subroutine reorder_entries(entries)
    type(entries_t), intent(inout) :: entries
    type(entries_t) :: old
    integer :: e, from

    call move_alloc(entries%body, old%body)
    call move_alloc(entries%level, old%level)
    call move_alloc(entries%extent, old%extent)
    call move_alloc(entries%position, old%position)
    call move_alloc(entries%shift, old%shift)
    allocate (entries%body(entries%n), entries%level(entries%n), entries%extent(entries%n))
    allocate (entries%position(size(old%position, 1), entries%n))
    allocate (entries%shift(3, size(old%shift, 2)))
    do e = 1, entries%n
      from = entries%hash%order(e)
      entries%body(e) = old%body(from)
      entries%level(e) = old%level(from)
      entries%extent(e) = old%extent(from)
      entries%position(:, e) = old%position(:, from)
      if (size(old%shift, 2) > 0) entries%shift(:, e) = old%shift(:, from)
    end do
  end subroutine reorder_entries

  !> Whether two entries are so near that their bodies may touch before lists are made anew.
  pure logical function entries_are_near(self, a, b, alert) result(are_near)
    class(entries_t), intent(in) :: self
    integer, intent(in) :: a, b
    !> [m]
    real(dp), intent(in) :: alert
    real(dp) :: square
    integer :: d

    square = 0.0_dp
    do d = 1, size(self%position, 1)
      square = square + (self%position(d, a) - self%position(d, b))**2
    end do
    are_near = square <= (self%extent(a) + self%extent(b) + alert)**2
  end function entries_are_near

  !> Cell of entry e in the grid of a class.
  pure function entries_place(self, e, level) result(place)
    class(entries_t), intent(in) :: self
    integer, intent(in) :: e, level
    integer :: place(3)
    place(:) = place_of(self%position(:, e), self%lower, self%edge(level))
  end function entries_place

  !> List the grains of the subdomain that are near a boundary. Where there are facets, those of other subdomains are looked at,
  !> too, since facets may lie between a grain and one of these.
  subroutine search_boundaries(self, bodies, extent, owned, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    real(dp), intent(in), contiguous :: extent(:)
    integer, intent(in), contiguous :: owned(:)
    type(neighbour_list_t), intent(inout) :: list
    integer :: k, b
    real(dp) :: distance, normal(bodies%nd), range(size(self%boundaries))
    type(near_facets_t) :: near
    logical :: is_own

    if (has_facets(self%boundaries)) allocate (list%at_facets(bodies%n), source=.false.)
    do b = 1, size(self%boundaries)
      range(b) = self%rule%alert_distance + self%rule%margin(norm2(self%boundaries(b)%velocity))
    end do
    do k = 1, bodies%n
      is_own = owned(k) == self%subdomain .and. bodies%glued(k) == 0
      if (.not. (is_own .or. allocated(list%at_facets))) cycle
      do b = 1, size(self%boundaries)
        if (.not. self%boundaries(b)%touches()) cycle
        if (self%rule%filter%lets_pass(bodies, self%boundaries, k, -b)) cycle
        if (self%boundaries(b)%is_faceted()) then
          call self%boundaries(b)%find_facets(bodies%position(:, k), extent(k) + range(b), near)
          if (near%n == 0) cycle
          list%at_facets(k) = .true.
          if (is_own) call list%add(k, -b, no_shift)
          cycle
        end if
        if (.not. is_own) cycle
        call self%boundaries(b)%locate(bodies%position(:, k), distance, normal)
        if (distance - extent(k) <= range(b)) call list%add(k, -b, no_shift)
      end do
    end do
  end subroutine search_boundaries

  !> List the near pairs of entries of one class: those in a cell, and those in cells that touch.
  subroutine search_class(self, bodies, region, entries, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    class(region_t), intent(in) :: region
    type(entries_t), intent(in) :: entries
    type(neighbour_list_t), intent(inout) :: list
    integer :: cell, other, a, b, l, k, place(3), near(3)

    associate (hash => entries%hash, alert => self%rule%alert_distance)
      do cell = 1, hash%n_cells
        a = hash%first(cell)
        l = entries%level(a)
        place(:) = entries%place(a, l)
        do a = hash%first(cell), hash%first(cell + 1) - 1
          do b = a + 1, hash%first(cell + 1) - 1
            if (entries%are_near(a, b, alert)) call add_pair(self, bodies, region, entries, a, b, list)
          end do
        end do
        do k = 1, merge(4, 13, bodies%nd == 2)
          near(:) = iand(place + half_stencil(:, k), last_cell)
          other = hash%find(cell_key(l, near))
          if (other == 0 .or. other == cell) cycle
          do a = hash%first(cell), hash%first(cell + 1) - 1
            do b = hash%first(other), hash%first(other + 1) - 1
              if (entries%are_near(a, b, alert)) call add_pair(self, bodies, region, entries, a, b, list)
            end do
          end do
        end do
      end do
    end associate
  end subroutine search_class

  !> List the near pairs of two classes. A grain of a larger class never lies farther off than one of the cells of that class.
  subroutine search_larger(self, bodies, region, entries, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
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
                if (entries%are_near(a, b, self%rule%alert_distance)) call add_pair(self, bodies, region, entries, a, b, list)
              end do
            end do
          end do
        end do
      end do
    end do
  end subroutine search_larger

  !> List entries a and b, which are near, where the subdomain owns their pair and this is the one of its images that counts.
  subroutine add_pair(self, bodies, region, entries, a, b, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    class(region_t), intent(in) :: region
    type(entries_t), intent(in) :: entries
    integer, intent(in) :: a, b
    type(neighbour_list_t), intent(inout) :: list
    integer :: i, j, shift(3), periods(3)
    real(dp) :: antagonist(3), point(3)
    logical :: periodic
    integer :: nd

    i = entries%body(a)
    j = entries%body(b)
    nd = bodies%nd
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
    if (periodic .or. .not. self%is_alone) then
      antagonist(1:nd) = bodies%position(:, j)
      if (periodic) call self%period%add_shift(shift_code(shift), 1, antagonist(1:nd))
      point(1:nd) = owner_point(self%rule%kind, bodies%position(:, i), antagonist(1:nd))
      if (periodic) then
        if (.not. is_where_owned(self%period, point(1:nd), periods)) return
      end if
      if (region%owner(point(1:nd)) /= self%subdomain) return
    end if
    call list%add(i, j, merge(shift_code(shift), no_shift, periodic))
  end subroutine add_pair

  !> Put the pairs in sweep order of their owner points.
  subroutine sort_list(self, bodies, memory, list)
    type(neighbour_search_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    type(pair_memory_t), intent(in) :: memory
    type(neighbour_list_t), intent(inout) :: list
    integer(i8), allocatable :: id(:, :)
    real(dp), allocatable :: point(:, :)
    integer, allocatable :: order(:)
    real(dp) :: antagonist(bodies%nd)
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
    call sweep_order(point, self%corner(1:nd), self%rule%sweep_edge(), id, order)
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
    integer :: k, i, round, n, n_images, shifts(3, most_images)
    real(dp) :: largest

    if (.not. period%on()) then
      entries%n = bodies%n
      entries%position = bodies%position
      allocate (entries%body(bodies%n), entries%shift(3, 0))
      do k = 1, bodies%n
        entries%body(k) = k
      end do
      return
    end if
    largest = maxval(extent)
    do round = 1, 2
      n = 0
      do k = 1, bodies%n
        call period%find_images(bodies%position(:, k), extent(k) + largest + rule%alert_distance, shifts, n_images)
        do i = 1, n_images
          n = n + 1
          if (round == 1) cycle
          entries%body(n) = k
          entries%shift(:, n) = shifts(:, i)
          entries%position(:, n) = bodies%position(:, k)
          call period%add_shift(shift_code(shifts(:, i)), 1, entries%position(:, n))
        end do
      end do
      entries%n = n
      if (round == 1) allocate (entries%body(n), entries%shift(3, n), entries%position(bodies%nd, n))
    end do
  end subroutine make_entries

end module gravier_neighbour_search
