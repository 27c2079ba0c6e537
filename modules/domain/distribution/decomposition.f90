!> Who owns which grain.
module gravier_decomposition
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort, find_sorted
  use gravier_periodic, only: period_t, most_images, shift_code
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_body_store, only: body_layout_t, body_set_t, append_bodies, place_word
  use gravier_shape_library, only: shape_library_t
  use gravier_body_figures, only: body_figures_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_rule, only: neighbour_rule_t
  use gravier_partition, only: partition_t, add_once
  implicit none
  private
  public :: decomposition_t

  !> Each rank owns a block of subdomains, each subdomain the grains whose centre it holds. Boundaries are everywhere.
  type :: decomposition_t
    type(communicator_t), pointer :: comm => null()
    type(partition_t) :: partition
    type(period_t) :: period
    !> the same lattice with the edges that it had before the last migration, of which shifts in older lists are
    type(period_t) :: older_period
    type(neighbour_rule_t) :: rule
    integer :: n_subdomains = 1
    !> space dimension, degrees of freedom of a body, entries of an image, of an orientation, of its rest and of an applied force
    integer :: nd = 2, nv = 3, ni = 0, no = 0, nr = 0, na = 0
    !> first subdomain of this rank; owned(s) belongs to subdomain first + s - 1
    integer :: first = 1
    type(body_set_t), allocatable :: owned(:)
    type(boundary_t), allocatable :: boundaries(:)
    !> the shapes of the bodies, the same on every rank
    type(shape_library_t) :: shapes
    type(body_figures_t) :: figures
    !> corners of the box that grains enter in, which partitions cover (nd, 2) [m]; not allocated where none enter
    real(dp), allocatable :: entry_box(:, :)
    !> identifiers of free grains that leave in the next step, ascending, the same on every rank; else not allocated
    integer(i8), allocatable :: dismissed(:)
  contains
    procedure :: init => decomposition_init
    procedure :: migrate => decomposition_migrate
    procedure :: deliver => decomposition_deliver
    procedure :: alert_distance => decomposition_alert_distance
    procedure :: find_near => decomposition_find_near
    procedure :: unpack_by_subdomain => decomposition_unpack_by_subdomain
    procedure :: bounding_box => decomposition_bounding_box
    procedure :: subdomain_of => decomposition_subdomain_of
    procedure :: layout => decomposition_layout
    procedure :: find_owned => decomposition_find_owned
    procedure :: free_mass => decomposition_free_mass
    procedure :: take_forces => decomposition_take_forces
  end type decomposition_t

contains

  !> Gap within which a pair is a contact [m].
  pure real(dp) function decomposition_alert_distance(self) result(distance)
    class(decomposition_t), intent(in) :: self
    distance = self%rule%alert_distance
  end function decomposition_alert_distance

  !> Make room for `n_subdomains`, without grains.
  subroutine decomposition_init(self, comm, n_subdomains, layout, period)
    class(decomposition_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    integer, intent(in) :: n_subdomains
    !> of the bodies, with an image where the scene is periodic
    class(body_layout_t), intent(in) :: layout
    type(period_t), intent(in) :: period
    integer :: s, last

    self%comm => comm
    self%n_subdomains = n_subdomains
    self%nd = layout%nd
    self%nv = layout%nv
    self%ni = layout%ni
    self%no = layout%no
    self%nr = layout%nr
    self%na = layout%na
    self%period = period
    if (.not. allocated(self%boundaries)) allocate (self%boundaries(0))
    self%first = comm%first_subdomain(comm%rank, n_subdomains)
    last = comm%first_subdomain(comm%rank + 1, n_subdomains) - 1
    if (allocated(self%owned)) deallocate (self%owned)
    allocate (self%owned(last - self%first + 1))
    do s = 1, size(self%owned)
      call self%owned(s)%init(layout, 0)
    end do
  end subroutine decomposition_init

  !> Global number of subdomain `s` of this rank.
  pure integer function decomposition_subdomain_of(self, s) result(subdomain)
    class(decomposition_t), intent(in) :: self
    integer, intent(in) :: s
    subdomain = self%first + s - 1
  end function decomposition_subdomain_of

  !> The layout of the bodies of all subdomains.
  pure type(body_layout_t) function decomposition_layout(self) result(layout)
    class(decomposition_t), intent(in) :: self

    layout = body_layout_t(self%nd, self%nv, self%ni, self%no, self%nr, self%na)
  end function decomposition_layout

  !> Subdomain of this rank and place among its owned bodies of a grain.
  pure subroutine decomposition_find_owned(self, key, h, place)
    class(decomposition_t), intent(in) :: self
    !> owner and identifier
    integer(i8), intent(in) :: key(2)
    integer, intent(out) :: h, place

    h = narrow(key(1)) - self%first + 1
    place = find_sorted(self%owned(h)%id, key(2))
  end subroutine decomposition_find_owned

  !> Give all grains an applied force, of 0. The same on every rank.
  subroutine decomposition_take_forces(self)
    class(decomposition_t), intent(inout) :: self
    integer :: s

    self%na = self%nd
    do s = 1, size(self%owned)
      call self%owned(s)%take_forces()
    end do
  end subroutine decomposition_take_forces

  !> Mass of the grains that are not glued to boundaries [kg]. Collective.
  real(dp) function decomposition_free_mass(self) result(mass)
    class(decomposition_t), intent(in) :: self
    real(dp) :: parts(size(self%owned))
    integer :: s

    do s = 1, size(self%owned)
      parts(s) = sum(self%owned(s)%mass, mask=self%owned(s)%glued == 0)
    end do
    mass = self%comm%sum_real(parts)
  end function decomposition_free_mass

  !> Corners of the box that holds all grains, radii included [m], and the regions that grains enter in; along periodic axes just
  !> the period. An empty scene has the unit box. Collective.
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
    if (allocated(self%entry_box)) then
      far(1:nd) = max(far(1:nd), -self%entry_box(:, 1))
      far(nd + 1:) = max(far(nd + 1:), self%entry_box(:, 2))
    end if
    call self%comm%highest_of(far)
    lower(:) = -far(1:nd)
    upper(:) = far(nd + 1:)
    if (lower(1) > upper(1)) then
      lower(:) = 0.0_dp
      upper(:) = 1.0_dp
    end if
    do d = 1, nd
      if (.not. self%period%length(d) > 0.0_dp) cycle
      lower(d) = self%period%origin(d)
      upper(d) = self%period%origin(d) + self%period%length(d)
    end do
  end subroutine decomposition_bounding_box

  !> Bring every grain to the subdomain that holds its centre, wrapped into the period; grains of a subdomain are kept by
  !> ascending identifier. Collective.
  subroutine decomposition_migrate(self, newcomers)
    class(decomposition_t), intent(inout) :: self
    !> grains of this rank without an owner so far
    type(body_set_t), intent(in), optional :: newcomers
    type(body_set_t) :: leaving
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer :: k, s, turns(3)

    self%older_period = self%period
    call self%period%straighten(turns)
    if (self%ni > 0) then
      do s = 1, size(self%owned)
        call renumber_images(turns, self%owned(s))
        call wrap_grains(self%period, self%owned(s))
      end do
    end if
    call collect_leaving(self, leaving)
    if (present(newcomers)) call append_bodies(leaving, newcomers)
    if (self%ni > 0) call wrap_grains(self%period, leaving)
    allocate (records(leaving%record_words() + 1, leaving%n))
    do k = 1, leaving%n
      call leaving%get_record(k, records(2:, k))
    end do
    call self%deliver(place_word + 1, records, received)
    call take_in(self, received)
  end subroutine decomposition_migrate

  !> Count the images of grains by the edges that `straighten` of the period has taken.
  pure subroutine renumber_images(turns, bodies)
    integer, intent(in) :: turns(3)
    type(body_set_t), intent(inout) :: bodies
    integer :: k

    if (all(turns == 0)) return
    do k = 1, bodies%n
      associate (image => bodies%image(:, k))
        if (bodies%nd == 3) then
          image(2) = image(2) + turns(3)*image(3)
          image(1) = image(1) + turns(2)*image(3)
        end if
        image(1) = image(1) + turns(1)*image(2)
      end associate
    end do
  end subroutine renumber_images

  !> Bring grains into the period, counting their images. Where the cell moves, the image that is taken has a velocity of its own.
  pure subroutine wrap_grains(period, bodies)
    type(period_t), intent(in) :: period
    type(body_set_t), intent(inout) :: bodies
    integer :: k, turns(bodies%nd), shift(3)

    do k = 1, bodies%n
      call period%wrap(bodies%position(:, k), turns)
      bodies%image(:, k) = bodies%image(:, k) + turns
      if (.not. period%moves .or. all(turns == 0)) cycle
      shift(:) = 0
      shift(1:bodies%nd) = -turns
      call period%add_velocity(shift, bodies%velocity(1:bodies%nd, k))
    end do
  end subroutine wrap_grains

  !> Subdomains that may hold a point within `reach` of any image of `point`, each once. Partitions know nothing of a cell that
  !> moves: its images are asked for one by one.
  subroutine decomposition_find_near(self, point, reach, list, n)
    class(decomposition_t), intent(in) :: self
    !> (nd) in the cell [m]
    real(dp), intent(in), contiguous :: point(:)
    real(dp), intent(in) :: reach
    !> the first n are set; grown where needed
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(out) :: n
    integer, allocatable :: more(:)
    integer :: shifts(3, most_images), n_images, n_more, i, j
    real(dp) :: image(self%nd)

    if (.not. self%period%moves) then
      call self%partition%near(point, reach, list, n)
      return
    end if
    n = 0
    allocate (more(8))
    call self%period%find_images(point, reach, shifts, n_images)
    do i = 1, n_images
      image(:) = point
      call self%period%add_shift(shift_code(shifts(:, i)), 1, image)
      call self%partition%near(image, reach, more, n_more)
      do j = 1, n_more
        call add_once(list, n, more(j))
      end do
    end do
  end subroutine decomposition_find_near

  !> Bring records to the ranks of the subdomains that hold a point. Collective.
  subroutine decomposition_deliver(self, point_word, records, received)
    class(decomposition_t), intent(in) :: self
    !> first of the nd words that hold the point
    integer, intent(in) :: point_word
    !> (words, n), the first of them to be set here to the subdomain
    integer(i8), intent(inout), contiguous :: records(:, :)
    !> (words, n), by source subdomain as far as the records were so sorted
    integer(i8), allocatable, intent(out) :: received(:, :)
    integer(i8), allocatable :: arrived(:, :), onward(:, :), more(:, :)
    integer, allocatable :: destination(:)

    allocate (received(size(records, 1), 0))
    onward = records
    do
      call address(self, point_word, onward, destination)
      call sparse_exchange(self%comm, onward, destination, arrived)
      ! a rank that does not know the place of a point writes to one that does
      call address(self, point_word, arrived, destination)
      call split(arrived, destination, self%comm%rank, more, onward)
      call join(received, more)
      if (.not. self%comm%any_true(size(onward, 2) > 0)) exit
    end do
  end subroutine decomposition_deliver

  !> Subdomain and rank of each record, as far as known here.
  subroutine address(self, point_word, records, destination)
    class(decomposition_t), intent(in) :: self
    integer, intent(in) :: point_word
    integer(i8), intent(inout), contiguous :: records(:, :)
    integer, allocatable, intent(out) :: destination(:)
    real(dp) :: point(self%nd)
    integer :: k, d, owner, turns(self%nd)

    allocate (destination(size(records, 2)))
    do k = 1, size(records, 2)
      do d = 1, self%nd
        point(d) = transfer(records(point_word + d - 1, k), 0.0_dp)
      end do
      if (self%period%moves) call self%period%wrap(point, turns)
      owner = self%partition%owner(point)
      if (owner == 0) owner = self%partition%relay(point)
      records(1, k) = owner
      destination(k) = self%comm%rank_of(owner, self%n_subdomains)
    end do
  end subroutine address

  !> Records for a rank, and the others.
  pure subroutine split(records, destination, rank, own, others)
    integer(i8), intent(in), contiguous :: records(:, :)
    integer, intent(in), contiguous :: destination(:)
    integer, intent(in) :: rank
    integer(i8), allocatable, intent(out) :: own(:, :), others(:, :)
    integer :: k, n_own, n_others

    n_own = count(destination == rank)
    allocate (own(size(records, 1), n_own), others(size(records, 1), size(records, 2) - n_own))
    n_own = 0
    n_others = 0
    do k = 1, size(records, 2)
      if (destination(k) == rank) then
        n_own = n_own + 1
        own(:, n_own) = records(:, k)
      else
        n_others = n_others + 1
        others(:, n_others) = records(:, k)
      end if
    end do
  end subroutine split

  !> Add records behind others.
  pure subroutine join(records, more)
    integer(i8), allocatable, intent(inout) :: records(:, :)
    integer(i8), intent(in), contiguous :: more(:, :)
    integer(i8), allocatable :: all_of_them(:, :)

    if (size(more, 2) == 0) return
    allocate (all_of_them(size(records, 1), size(records, 2) + size(more, 2)))
    all_of_them(:, 1:size(records, 2)) = records
    all_of_them(:, size(records, 2) + 1:) = more
    call move_alloc(all_of_them, records)
  end subroutine join

  !> Take the grains whose centre has left their subdomain out of it.
  subroutine collect_leaving(self, leaving)
    class(decomposition_t), intent(inout) :: self
    type(body_set_t), intent(out) :: leaving
    type(body_set_t) :: gone
    logical, allocatable :: stays(:)
    integer :: s, k

    call leaving%init(self%layout(), 0)
    do s = 1, size(self%owned)
      allocate (stays(self%owned(s)%n))
      do k = 1, self%owned(s)%n
        stays(k) = self%partition%owner(self%owned(s)%position(:, k)) == self%subdomain_of(s)
      end do
      if (.not. all(stays)) then
        gone = self%owned(s)
        call self%owned(s)%keep_only(stays)
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

    call self%unpack_by_subdomain(received, 1, arrived)
    do s = 1, size(self%owned)
      if (arrived(s)%n == 0) cycle
      call append_bodies(self%owned(s), arrived(s))
      allocate (order(self%owned(s)%n))
      call argsort(self%owned(s)%id, order)
      call self%owned(s)%reorder(order)
      deallocate (order)
    end do
  end subroutine take_in

  !> Sort received grains by subdomain of this rank; the first `lead` words of a record are not of the grain, and
  !> the first of them is the subdomain.
  subroutine decomposition_unpack_by_subdomain(self, received, lead, sets)
    class(decomposition_t), intent(in) :: self
    integer(i8), intent(in), contiguous :: received(:, :)
    integer, intent(in) :: lead
    type(body_set_t), allocatable, intent(out) :: sets(:)
    integer, allocatable :: counts(:)
    integer :: k, s

    allocate (sets(size(self%owned)), counts(size(self%owned)))
    counts(:) = 0
    do k = 1, size(received, 2)
      s = narrow(received(1, k)) - self%first + 1
      counts(s) = counts(s) + 1
    end do
    do s = 1, size(sets)
      call sets(s)%init(self%layout(), counts(s))
    end do
    counts(:) = 0
    do k = 1, size(received, 2)
      s = narrow(received(1, k)) - self%first + 1
      counts(s) = counts(s) + 1
      call sets(s)%set_record(counts(s), received(lead + 1:, k))
    end do
  end subroutine decomposition_unpack_by_subdomain

end module gravier_decomposition
