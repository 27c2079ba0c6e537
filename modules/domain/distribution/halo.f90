!> What each subdomain sees: its grains, the ghosts near them, and the near pairs it owns; made anew only when grains
!> have moved far enough.
module gravier_halo
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_periodic, only: period_t, gradient_times
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_body_store, only: body_layout_t, body_set_t, append_bodies
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_neighbour_rule, only: neighbour_rule_t
  use gravier_cell_order, only: sweep_order
  use gravier_neighbour_search, only: neighbour_search_t
  use gravier_decomposition, only: decomposition_t
  use gravier_list_reference, only: reference_t, note_bodies, note_boundaries, way_of
  implicit none
  private
  public :: local_bodies_t, halo_t, mask_t

  !> The grains that a subdomain sees, in an order that depends on them alone, and its near pairs.
  type :: local_bodies_t
    type(body_set_t) :: bodies
    !> subdomain that owns each, and for its own the place among the owned (n); 0 for ghosts
    integer, allocatable :: owner(:), origin(:)
    type(neighbour_list_t) :: list
    !> where bodies may sleep: which of them slept when the pairs to look at were found, not allocated where these have to be found
    !> anew (n); contacts among the pairs that are not looked at
    logical, allocatable :: asleep(:)
    integer :: n_resting = 0
    !> the cell as it is, for the velocities of images; set where it moves
    type(period_t) :: period
  contains
    procedure :: n_bodies => local_bodies_n_bodies
    procedure :: find_ends => local_bodies_find_ends
    procedure :: find_way => local_bodies_find_way
  end type local_bodies_t

  !> One of each body of a set, of those that stay.
  type :: mask_t
    logical, allocatable :: of(:)
  end type mask_t

  type :: place_t
    integer, allocatable :: of(:)
  end type place_t

  !> The halo of the subdomains of this rank, and who sends which grain to whom.
  type :: halo_t
    type(local_bodies_t), allocatable :: view(:)
    !> as they were when the lists were made
    type(reference_t), allocatable :: reference(:)
    type(boundary_t), allocatable :: reference_boundaries(:)
    type(period_t) :: reference_period
    !> ghosts sent: subdomain of this rank and place among its owned bodies (2, n); subdomain that sees it, and its rank (n)
    integer, private, allocatable :: sent(:, :), recipient(:), destination(:)
    !> ghosts received, in the order of arrival: subdomain of this rank and place among its local bodies (2, n)
    integer, private, allocatable :: arrival(:, :)
    !> to be set before the first list
    type(pair_memory_t) :: memory
    !> lists made so far
    integer(i8) :: builds = 0
    !> largest extent of a body when the lists were made [m]
    real(dp) :: largest_extent = 0.0_dp
    !> least coordinates of the bodies when lists were first made, from which the cells of orders are counted [m]
    real(dp) :: corner(3) = 0.0_dp
  contains
    procedure :: build => halo_build
    procedure :: refresh => halo_refresh
    procedure :: are_due => halo_are_due
    procedure :: drop => halo_drop
    procedure :: take_forces => halo_take_forces
  end type halo_t

contains

  !> Bodies that a subdomain sees.
  pure integer function local_bodies_n_bodies(self) result(n_bodies)
    class(local_bodies_t), intent(in) :: self
    n_bodies = self%bodies%n
  end function local_bodies_n_bodies

  !> The bodies of a near pair: places of candidate and antagonist, or minus the number of a boundary as the antagonist.
  pure subroutine local_bodies_find_ends(self, p, i, j)
    class(local_bodies_t), intent(in) :: self
    !> place of the pair in the list
    integer, intent(in) :: p
    integer, intent(out) :: i, j

    i = self%list%candidate(p)
    j = self%list%antagonist(p)
  end subroutine local_bodies_find_ends

  !> Way from the candidate of a near pair to the centre of its antagonist, or of the image of it that the candidate meets. The
  !> antagonist is a grain.
  pure subroutine local_bodies_find_way(self, p, period, way)
    class(local_bodies_t), intent(in) :: self
    !> place of the pair in the list
    integer, intent(in) :: p
    type(period_t), intent(in) :: period
    !> (nd) [m]
    real(dp), intent(out) :: way(:)

    way(:) = self%bodies%position(:, self%list%antagonist(p)) - self%bodies%position(:, self%list%candidate(p))
    if (size(self%list%shift) > 0) call period%add_shift(self%list%shift(p), 1, way)
  end subroutine local_bodies_find_way

  !> Make the local bodies and lists from the grains as they have migrated. Collective.
  subroutine halo_build(self, decomposition, least_extent)
    class(halo_t), intent(inout) :: self
    type(decomposition_t), intent(in), target :: decomposition
    !> largest extent of bodies that were there when the lists were first made, and have left since [m]
    real(dp), intent(in), optional :: least_extent
    type(body_set_t), allocatable :: ghosts(:)
    integer(i8), allocatable :: records(:, :), received(:, :)
    type(neighbour_search_t) :: search
    integer :: s

    search%rule = decomposition%rule
    call find_largest_extent(decomposition, search%rule)
    if (present(least_extent)) search%rule%largest_extent = max(search%rule%largest_extent, least_extent)
    self%largest_extent = search%rule%largest_extent
    if (self%builds == 0 .and. .not. present(least_extent)) call find_corner(decomposition, self%corner)
    search%corner(:) = self%corner
    call plan_ghosts(self, decomposition, search%rule)
    call write_ghosts(self, decomposition, records)
    call sparse_exchange(decomposition%comm, records, self%destination, received)
    call decomposition%unpack_by_subdomain(received, 2, ghosts)
    if (allocated(self%view)) deallocate (self%view)
    if (allocated(self%reference)) deallocate (self%reference)
    allocate (self%view(size(decomposition%owned)), self%reference(size(decomposition%owned)))
    call make_views(self, decomposition, ghosts, received)
    search%period = decomposition%period
    search%is_alone = decomposition%n_subdomains == 1
    search%boundaries => decomposition%boundaries
    search%counts = decomposition%shapes%counts
    do s = 1, size(self%view)
      call note_bodies(decomposition%owned(s), self%reference(s))
      associate (view => self%view(s))
        search%subdomain = decomposition%subdomain_of(s)
        view%period = decomposition%period
        call search%find(view%bodies, view%owner, decomposition%partition, self%memory, view%list)
      end associate
    end do
    call note_boundaries(decomposition%boundaries, self%reference_boundaries)
    self%reference_period = decomposition%period
    self%builds = self%builds + 1
  end subroutine halo_build

  !> The least coordinates of all bodies, 0 without bodies. Collective.
  subroutine find_corner(decomposition, corner)
    type(decomposition_t), intent(in) :: decomposition
    real(dp), intent(out) :: corner(3)
    integer :: s, d

    corner(:) = 0.0_dp
    do d = 1, decomposition%nd
      corner(d) = huge(1.0_dp)
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          if (owned%n > 0) corner(d) = min(corner(d), minval(owned%position(d, 1:owned%n)))
        end associate
      end do
      corner(d) = decomposition%comm%lowest(corner(d))
      if (.not. corner(d) < huge(1.0_dp)) corner(d) = 0.0_dp
    end do
  end subroutine find_corner

  !> The largest extent of all bodies, into the rule. Collective.
  subroutine find_largest_extent(decomposition, rule)
    type(decomposition_t), intent(in) :: decomposition
    type(neighbour_rule_t), intent(inout) :: rule
    integer :: s, k

    rule%largest_extent = 0.0_dp
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          rule%largest_extent = max(rule%largest_extent, rule%extent(owned%radius(k), norm2(owned%velocity(1:owned%nd, k))))
        end do
      end associate
    end do
    rule%largest_extent = decomposition%comm%highest(rule%largest_extent)
  end subroutine find_largest_extent

  !> Find the grains of this rank that other subdomains see.
  subroutine plan_ghosts(self, decomposition, rule)
    class(halo_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> with the largest extent
    type(neighbour_rule_t), intent(in) :: rule
    integer, allocatable :: near(:)
    integer :: s, k, j, n_near, n, round
    real(dp) :: reach

    if (allocated(self%sent)) deallocate (self%sent, self%recipient, self%destination)
    allocate (near(32))
    do round = 1, 2
      n = 0
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          do k = 1, owned%n
            reach = rule%reach(owned%radius(k), norm2(owned%velocity(1:owned%nd, k)))
            call decomposition%find_near(owned%position(:, k), reach, near, n_near)
            do j = 1, n_near
              if (near(j) == decomposition%subdomain_of(s)) cycle
              n = n + 1
              if (round == 1) cycle
              self%sent(1, n) = s
              self%sent(2, n) = k
              self%recipient(n) = near(j)
              self%destination(n) = decomposition%comm%rank_of(near(j), decomposition%n_subdomains)
            end do
          end do
        end associate
      end do
      if (round == 1) allocate (self%sent(2, n), self%recipient(n), self%destination(n))
    end do
  end subroutine plan_ghosts

  !> Records (recipient, owner, grain).
  subroutine write_ghosts(self, decomposition, records)
    class(halo_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), allocatable, intent(out) :: records(:, :)
    type(body_layout_t) :: layout
    integer :: n

    layout = decomposition%layout()
    allocate (records(2 + layout%record_words(), size(self%recipient)))
    do n = 1, size(self%recipient)
      records(1, n) = self%recipient(n)
      records(2, n) = decomposition%subdomain_of(self%sent(1, n))
      call decomposition%owned(self%sent(1, n))%get_record(self%sent(2, n), records(3:, n))
    end do
  end subroutine write_ghosts

  !> Put own grains and ghosts together, in sweep order, and note where each ghost went.
  subroutine make_views(self, decomposition, ghosts, received)
    class(halo_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: ghosts(:)
    !> (recipient, owner, grain)
    integer(i8), intent(in), contiguous :: received(:, :)
    integer, allocatable :: next(:)
    integer :: s, k, n

    if (allocated(self%arrival)) deallocate (self%arrival)
    allocate (self%arrival(2, size(received, 2)), next(size(self%view)))
    do s = 1, size(self%view)
      associate (view => self%view(s))
        view%bodies = decomposition%owned(s)
        call append_bodies(view%bodies, ghosts(s))
        n = decomposition%owned(s)%n
        allocate (view%owner(view%bodies%n), view%origin(view%bodies%n))
        view%owner(1:n) = decomposition%subdomain_of(s)
        do k = 1, n
          view%origin(k) = k
        end do
        view%origin(n + 1:) = 0
        next(s) = n
      end associate
    end do
    do k = 1, size(received, 2)
      s = narrow(received(1, k)) - decomposition%first + 1
      next(s) = next(s) + 1
      self%view(s)%owner(next(s)) = narrow(received(2, k))
      self%arrival(1, k) = s
      self%arrival(2, k) = next(s)
    end do
    call sort_views(self, decomposition)
  end subroutine make_views

  subroutine sort_views(self, decomposition)
    class(halo_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), allocatable :: id(:, :)
    integer, allocatable :: order(:), owner(:), origin(:), place(:), offset(:)
    integer :: s, k

    allocate (offset(size(self%view) + 1))
    offset(1) = 0
    do s = 1, size(self%view)
      offset(s + 1) = offset(s) + self%view(s)%bodies%n
    end do
    allocate (place(offset(size(offset))))
    do s = 1, size(self%view)
      associate (view => self%view(s))
        allocate (order(view%bodies%n), id(1, view%bodies%n))
        id(1, :) = view%bodies%id
        call sweep_order(view%bodies%position, self%corner(1:view%bodies%nd), decomposition%rule%sweep_edge(), id, order)
        call view%bodies%reorder(order)
        call move_alloc(view%owner, owner)
        call move_alloc(view%origin, origin)
        allocate (view%owner(size(order)), view%origin(size(order)))
        do k = 1, size(order)
          view%owner(k) = owner(order(k))
          view%origin(k) = origin(order(k))
          place(offset(s) + order(k)) = k
        end do
        deallocate (order, id)
      end associate
    end do
    do k = 1, size(self%arrival, 2)
      self%arrival(2, k) = place(offset(self%arrival(1, k)) + self%arrival(2, k))
    end do
  end subroutine sort_views

  !> Bring the places, velocities and what else changes in every step up to date of the local bodies. Collective.
  subroutine halo_refresh(self, decomposition)
    class(halo_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), allocatable :: records(:, :), received(:, :)
    type(body_layout_t) :: layout
    integer :: s, k, n, r

    layout = decomposition%layout()
    allocate (records(layout%renewed_words(), size(self%recipient)))
    do n = 1, size(self%recipient)
      call decomposition%owned(self%sent(1, n))%get_renewed(self%sent(2, n), records(:, n))
    end do
    call sparse_exchange(decomposition%comm, records, self%destination, received)
    do n = 1, size(received, 2)
      call self%view(self%arrival(1, n))%bodies%set_renewed(self%arrival(2, n), received(:, n))
    end do
    do s = 1, size(self%view)
      associate (view => self%view(s), owned => decomposition%owned(s))
        if (decomposition%period%moves) view%period = decomposition%period
        if (owned%awake%have_all(owned%n)) call view%bodies%awake%take_all(view%bodies%n)
        do r = 1, view%bodies%awake%n
          do k = view%bodies%awake%first(r), view%bodies%awake%last(r)
            if (view%origin(k) > 0) call view%bodies%renew(k, owned, view%origin(k))
          end do
        end do
        if (owned%nr > 0) call view%bodies%awake%leave_out(view%bodies%wakes_at)
      end associate
    end do
  end subroutine halo_refresh

  !> Drop the bodies that leave the scene from views and lists, which stay valid for the others. The bodies are those whose mask is
  !> false, of the grains of this rank and of all that its subdomains see; a ghost and its grain leave together.
  subroutine halo_drop(self, owned_stays, view_stays)
    class(halo_t), intent(inout) :: self
    !> of the subdomains of this rank
    type(mask_t), intent(in) :: owned_stays(:), view_stays(:)
    type(place_t) :: owned(size(owned_stays)), seen(size(view_stays))
    integer :: s, k, n

    do s = 1, size(self%view)
      call number_places(owned_stays(s)%of, owned(s)%of)
      call number_places(view_stays(s)%of, seen(s)%of)
      call drop_references(self%reference(s), owned(s)%of)
      associate (view => self%view(s))
        do k = 1, view%bodies%n
          if (seen(s)%of(k) == 0) cycle
          n = view%origin(k)
          if (n > 0) n = owned(s)%of(n)
          view%owner(seen(s)%of(k)) = view%owner(k)
          view%origin(seen(s)%of(k)) = n
        end do
        call view%bodies%keep_only(view_stays(s)%of)
        call shorten(view%owner, view%bodies%n)
        call shorten(view%origin, view%bodies%n)
        call view%list%drop(seen(s)%of)
        if (allocated(view%asleep)) deallocate (view%asleep)
      end associate
    end do
    n = 0
    do k = 1, size(self%recipient)
      if (owned(self%sent(1, k))%of(self%sent(2, k)) == 0) cycle
      n = n + 1
      self%sent(1, n) = self%sent(1, k)
      self%sent(2, n) = owned(self%sent(1, k))%of(self%sent(2, k))
      self%recipient(n) = self%recipient(k)
      self%destination(n) = self%destination(k)
    end do
    call shorten_columns(self%sent, n)
    call shorten(self%recipient, n)
    call shorten(self%destination, n)
    n = 0
    do k = 1, size(self%arrival, 2)
      if (seen(self%arrival(1, k))%of(self%arrival(2, k)) == 0) cycle
      n = n + 1
      self%arrival(1, n) = self%arrival(1, k)
      self%arrival(2, n) = seen(self%arrival(1, k))%of(self%arrival(2, k))
    end do
    call shorten_columns(self%arrival, n)
  end subroutine halo_drop

  !> New places of what stays, 0 for the others.
  pure subroutine number_places(stays, place)
    logical, intent(in), contiguous :: stays(:)
    integer, allocatable, intent(out) :: place(:)
    integer :: k, n

    allocate (place(size(stays)), source=0)
    n = 0
    do k = 1, size(stays)
      if (.not. stays(k)) cycle
      n = n + 1
      place(k) = n
    end do
  end subroutine number_places

  !> What lists were made for, of the grains that stay. Spare room stays.
  pure subroutine drop_references(reference, place)
    type(reference_t), intent(inout) :: reference
    integer, intent(in), contiguous :: place(:)
    integer :: k, n

    n = 0
    do k = 1, size(place)
      if (place(k) == 0) cycle
      n = n + 1
      reference%position(:, n) = reference%position(:, k)
      reference%speed(n) = reference%speed(k)
    end do
  end subroutine drop_references

  !> Keep the first numbers, or columns.
  pure subroutine shorten(list, n)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in) :: n
    integer, allocatable :: kept(:)

    allocate (kept(n))
    kept(:) = list(1:n)
    call move_alloc(kept, list)
  end subroutine shorten

  pure subroutine shorten_columns(table, n)
    integer, allocatable, intent(inout) :: table(:, :)
    integer, intent(in) :: n
    integer, allocatable :: kept(:, :)

    allocate (kept(size(table, 1), n))
    kept(:, :) = table(:, 1:n)
    call move_alloc(kept, table)
  end subroutine shorten_columns

  !> Whether some pair outside the lists may have come within the alert distance: a grain has gone farther than its margin, or a
  !> boundary farther than its own and what all grains have left of theirs. In a cell that moves, ways are those besides the motion
  !> F of the cell, and what the cell brings nearer by deforming is a part |F - 1| of the distance of a pair. Collective.
  logical function halo_are_due(self, decomposition) result(due)
    class(halo_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> least that a grain has left of its margin
    real(dp) :: left, strain(3, 3), centre(3), nearer
    real(dp) :: way(decomposition%nd), place(decomposition%nd), carried(decomposition%nd)
    integer :: s, k, b, d, nd

    due = .true.
    if (.not. allocated(self%view)) return
    nd = decomposition%nd
    nearer = 0.0_dp
    strain(:, :) = 0.0_dp
    associate (rule => decomposition%rule, moves => decomposition%period%moves)
      if (moves) then
        strain(:, :) = decomposition%period%strain_since(self%reference_period)
        do d = 1, 3
          strain(d, d) = strain(d, d) - 1.0_dp
        end do
        centre(:) = decomposition%period%centre()
        nearer = 0.5_dp*norm2(strain)*(2.0_dp*self%largest_extent + rule%alert_distance)
      end if
      left = huge(1.0_dp)
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s), before => self%reference(s))
          do k = 1, owned%n
            way(:) = owned%position(:, k) - before%position(:, k)
            if (moves) then
              place(:) = before%position(:, k) - centre(1:nd)
              carried(:) = gradient_times(strain, place)
              way(:) = way - carried
            end if
            left = min(left, rule%margin(before%speed(k)) - nearer - norm2(way))
          end do
        end associate
      end do
      left = -decomposition%comm%highest(-left)
      due = left < 0.0_dp
      do b = 1, size(decomposition%boundaries)
        associate (now => decomposition%boundaries(b), before => self%reference_boundaries(b))
          due = due .or. way_of(now, before) > rule%margin(norm2(before%velocity)) + left
        end associate
      end do
    end associate
  end function halo_are_due

  !> Give all local bodies an applied force, of 0, where there are any yet.
  subroutine halo_take_forces(self)
    class(halo_t), intent(inout) :: self
    integer :: s

    if (.not. allocated(self%view)) return
    do s = 1, size(self%view)
      call self%view(s)%bodies%take_forces()
    end do
  end subroutine halo_take_forces

end module gravier_halo
