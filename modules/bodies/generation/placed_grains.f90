!> Boxes with periodic axes, and grains in them that are found by their place.
module gravier_placed_grains
  use gravier_kinds, only: dp, i4, i8
  use gravier_narrow, only: narrow
  use gravier_text, only: to_text
  implicit none
  private
  public :: sample_box_t, placed_grains_t

  !> cells along an axis at most: numbers of cells then fit 64-bit integers
  integer, parameter :: most_cells = 2**20

  !> A box whose sides across an axis are either solid or the same, one period apart.
  type :: sample_box_t
    !> space dimension, 2 or 3
    integer :: nd = 0
    !> corners [m]; the entries beyond nd are not used
    real(dp) :: lower(3) = 0.0_dp, upper(3) = 0.0_dp
    logical :: periodic(3) = .false.
  contains
    procedure :: random_place => box_random_place
    procedure :: leaves_room => box_leaves_room
    procedure :: too_many => box_too_many
    procedure :: volume => box_volume
  end type sample_box_t

  !> Grains in a hash table of cells that are wider than any two grains reach. Grows as grains are put in.
  type :: placed_grains_t
    integer :: n = 0
    !> where true, a grain is in the way of those after it in the order of precedence only
    logical, private :: ordered = .false.
    type(sample_box_t), private :: box
    !> cells along each axis; 1 beyond nd
    integer, private :: cells(3) = 1
    !> periods [m], cells per metre
    real(dp), private :: length(3) = 1.0_dp, per_length(3) = 1.0_dp
    !> (nd, room), (room): centres and radii [m], identifiers
    real(dp), allocatable, private :: position(:, :), radius(:)
    integer(i8), allocatable, private :: id(:)
    !> first grain of a bucket of cells, (0:room - 1), and the next one in the same bucket (room); 0 for none
    integer, allocatable, private :: head(:), next(:)
  contains
    procedure :: init => placed_init
    procedure :: insert => placed_insert
    procedure :: blocks => placed_blocks
    procedure, private :: bucket => placed_bucket
    procedure, private :: overlaps => placed_overlaps
    procedure, private :: make_room => placed_make_room
  end type placed_grains_t

contains

  !> A point of the box from `nd` random numbers: anywhere along a periodic axis, else so that the grain is wholly inside.
  pure subroutine box_random_place(self, radius, x, position)
    class(sample_box_t), intent(in) :: self
    !> [m], at most half of the box
    real(dp), intent(in) :: radius
    !> (nd), in (0, 1)
    real(dp), intent(in) :: x(:)
    !> (nd) [m]; lower <= position < upper along a periodic axis
    real(dp), intent(out) :: position(:)
    real(dp) :: low, high
    integer :: d

    do d = 1, self%nd
      low = self%lower(d)
      high = self%upper(d)
      if (self%periodic(d)) then
        position(d) = low + (high - low)*x(d)
        ! the last number below 1 may round to the upper side
        if (position(d) >= high) position(d) = low
      else
        low = low + radius
        high = max(high - radius, low)
        position(d) = min(low + (high - low)*x(d), high)
      end if
    end do
  end subroutine box_random_place

  !> Whether there is room for a grain at a place in the box, other grains aside.
  pure logical function box_leaves_room(self, radius, position) result(room)
    class(sample_box_t), intent(in) :: self
    !> [m]; (nd) [m]
    real(dp), intent(in) :: radius, position(:)

    associate (unused_self => self, unused_radius => radius, unused_position => position)
    end associate
    room = .true.
  end function box_leaves_room

  !> What is wrong where grains find no places.
  pure function box_too_many(self, fraction) result(text)
    class(sample_box_t), intent(in) :: self
    !> that all grains fill of the box
    real(dp), intent(in) :: fraction
    character(len=:), allocatable :: text

    associate (unused => self)
    end associate
    text = "solid fraction "//to_text(fraction, 3)//" is too high"
  end function box_too_many

  !> [m^nd]
  pure real(dp) function box_volume(self) result(volume)
    class(sample_box_t), intent(in) :: self
    volume = product(self%upper(1:self%nd) - self%lower(1:self%nd))
  end function box_volume

  !> Become an empty set of grains of radii up to `largest`, to be asked about grains of radii up to `largest`.
  subroutine placed_init(self, box, largest, ordered)
    class(placed_grains_t), intent(inout) :: self
    type(sample_box_t), intent(in) :: box
    !> [m]
    real(dp), intent(in) :: largest
    !> whether precedence counts
    logical, intent(in) :: ordered
    ! a little wider than two grains reach, for the rounding of a point into its cell
    real(dp), parameter :: slack = 1.0_dp + 1e-6_dp
    integer :: d

    self%n = 0
    self%ordered = ordered
    self%box = box
    self%cells(:) = 1
    do d = 1, box%nd
      self%length(d) = box%upper(d) - box%lower(d)
      self%cells(d) = max(1, int(min(self%length(d)/(2.0_dp*largest*slack), real(most_cells, dp)), i4))
      self%per_length(d) = self%cells(d)/self%length(d)
    end do
    if (.not. allocated(self%head)) then
      call self%make_room(64)
    else
      self%head(:) = 0
    end if
  end subroutine placed_init

  !> Put a grain in.
  subroutine placed_insert(self, id, radius, position)
    class(placed_grains_t), intent(inout) :: self
    integer(i8), intent(in) :: id
    !> [m]
    real(dp), intent(in) :: radius
    !> (nd) [m]
    real(dp), intent(in) :: position(:)
    integer :: place(3), b

    if (self%n == size(self%id)) call self%make_room(2*self%n)
    self%n = self%n + 1
    self%id(self%n) = id
    self%radius(self%n) = radius
    self%position(:, self%n) = position
    call find_cell(self, position, place)
    b = self%bucket(place)
    self%next(self%n) = self%head(b)
    self%head(b) = self%n
  end subroutine placed_insert

  !> Grow to `room` grains, a power of 2, and as many buckets.
  subroutine placed_make_room(self, room)
    class(placed_grains_t), intent(inout) :: self
    integer, intent(in) :: room
    real(dp), allocatable :: position(:, :), radius(:)
    integer(i8), allocatable :: id(:)
    integer :: place(3), k, b

    allocate (position(self%box%nd, room), radius(room), id(room))
    if (self%n > 0) then
      position(:, 1:self%n) = self%position
      radius(1:self%n) = self%radius
      id(1:self%n) = self%id
    end if
    call move_alloc(position, self%position)
    call move_alloc(radius, self%radius)
    call move_alloc(id, self%id)
    if (allocated(self%head)) deallocate (self%head, self%next)
    allocate (self%head(0:room - 1), source=0)
    allocate (self%next(room), source=0)
    do k = 1, self%n
      call find_cell(self, self%position(:, k), place)
      b = self%bucket(place)
      self%next(k) = self%head(b)
      self%head(b) = k
    end do
  end subroutine placed_make_room

  !> Place of the cell of a point along each axis, from 0.
  pure subroutine find_cell(self, point, place)
    class(placed_grains_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    integer, intent(out) :: place(3)
    integer :: d

    place(:) = 0
    do d = 1, self%box%nd
      place(d) = min(max(int((point(d) - self%box%lower(d))*self%per_length(d), i4), 0), self%cells(d) - 1)
    end do
  end subroutine find_cell

  !> Bucket of a cell. Cells of a row along the first axis are neighbours in memory; rows are scattered.
  pure integer function placed_bucket(self, place) result(bucket)
    class(placed_grains_t), intent(in) :: self
    integer, intent(in) :: place(3)
    integer(i8) :: row

    row = place(2)*2654435761_i8 + place(3)*3266489917_i8
    row = ieor(row, shiftr(row, 15))
    bucket = narrow(iand(place(1) + row, int(size(self%head) - 1, i8)))
  end function placed_bucket

  !> True when a grain overlaps one of the set, or one of the set that precedes it where precedence counts: a larger one,
  !> or one of the same radius and a smaller identifier.
  pure logical function placed_blocks(self, id, radius, position) result(blocks)
    class(placed_grains_t), intent(in) :: self
    integer(i8), intent(in) :: id
    real(dp), intent(in) :: radius, position(:)
    integer :: cells(3, 3), n(3), place(3), i, j, k, g

    blocks = .false.
    if (self%n == 0) return
    call find_neighbours(self, position, cells, n)
    do k = 1, n(3)
      place(3) = cells(k, 3)
      do j = 1, n(2)
        place(2) = cells(j, 2)
        do i = 1, n(1)
          place(1) = cells(i, 1)
          g = self%head(self%bucket(place))
          do while (g > 0)
            blocks = self%overlaps(g, id, radius, position)
            if (blocks) return
            g = self%next(g)
          end do
        end do
      end do
    end do
  end function placed_blocks

  !> Cells along each axis that are next to a point, the nearest first, since most overlaps are found there.
  pure subroutine find_neighbours(self, point, cells, n)
    class(placed_grains_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    !> (3, axis), and how many of them
    integer, intent(out) :: cells(3, 3), n(3)
    integer :: place(3), side, try, d, c

    call find_cell(self, point, place)
    cells(:, :) = 0
    n(:) = 1
    do d = 1, self%box%nd
      cells(1, d) = place(d)
      side = merge(1, -1, (point(d) - self%box%lower(d))*self%per_length(d) - place(d) > 0.5_dp)
      do try = 1, 2
        c = place(d) + side
        side = -side
        if (self%box%periodic(d)) c = modulo(c, self%cells(d))
        if (c < 0 .or. c >= self%cells(d) .or. any(cells(1:n(d), d) == c)) cycle
        n(d) = n(d) + 1
        cells(n(d), d) = c
      end do
    end do
  end subroutine find_neighbours

  !> Whether grain `g` of the set is in the way of a grain; the nearest image counts along periodic axes.
  pure logical function placed_overlaps(self, g, id, radius, position) result(overlaps)
    class(placed_grains_t), intent(in) :: self
    integer, intent(in) :: g
    integer(i8), intent(in) :: id
    real(dp), intent(in) :: radius, position(:)
    real(dp) :: distance, square
    integer :: d

    square = 0.0_dp
    do d = 1, self%box%nd
      distance = abs(position(d) - self%position(d, g))
      if (self%box%periodic(d)) distance = min(distance, self%length(d) - distance)
      square = square + distance**2
    end do
    overlaps = square < (radius + self%radius(g))**2
    if (self%ordered .and. overlaps) then
      overlaps = self%radius(g) > radius .or. (self%radius(g) >= radius .and. self%id(g) < id)
    end if
  end function placed_overlaps

end module gravier_placed_grains
