!> A box cut into bricks, one for each rank, and records on their way to the ranks whose bricks they concern.
module gravier_bricks
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_placed_grains, only: sample_box_t
  implicit none
  private
  public :: outbox_t, bricks_t

  !> Records to be sent, and the ranks they go to.
  type :: outbox_t
    integer :: n = 0
    !> (words of a record, room), (room)
    integer(i8), allocatable :: records(:, :)
    integer, allocatable :: destination(:)
  contains
    procedure :: init => outbox_init
    procedure :: add => outbox_add
    procedure :: exchange => outbox_exchange
  end type outbox_t

  !> Bricks into which the box is cut, one for each rank, numbered from 0 with the first axis fastest.
  type :: bricks_t
    type(sample_box_t) :: box
    !> along each axis; 1 beyond nd
    integer :: n(3) = 1
  contains
    procedure :: init => bricks_init
    procedure :: rank_of => bricks_rank_of
    procedure :: add_within_reach => bricks_add_within_reach
  end type bricks_t

contains

  !> Become empty, with room for `room` records of `words` words at first.
  pure subroutine outbox_init(self, words, room)
    class(outbox_t), intent(inout) :: self
    integer, intent(in) :: words, room

    self%n = 0
    if (allocated(self%records)) deallocate (self%records, self%destination)
    allocate (self%records(words, max(room, 1)), self%destination(max(room, 1)))
  end subroutine outbox_init

  !> Add a record for `rank`.
  pure subroutine outbox_add(self, rank, record)
    class(outbox_t), intent(inout) :: self
    integer, intent(in) :: rank
    integer(i8), intent(in) :: record(:)
    integer(i8), allocatable :: records(:, :)
    integer, allocatable :: destination(:)

    if (self%n == size(self%destination)) then
      allocate (records(size(self%records, 1), 2*self%n), destination(2*self%n))
      records(:, 1:self%n) = self%records
      destination(1:self%n) = self%destination
      call move_alloc(records, self%records)
      call move_alloc(destination, self%destination)
    end if
    self%n = self%n + 1
    self%records(:, self%n) = record
    self%destination(self%n) = rank
  end subroutine outbox_add

  !> Send the records, and receive what others sent here. Collective.
  subroutine outbox_exchange(self, comm, received)
    class(outbox_t), intent(in) :: self
    type(communicator_t), intent(in) :: comm
    !> (words of a record, number received)
    integer(i8), allocatable, intent(out) :: received(:, :)
    call sparse_exchange(comm, self%records(:, 1:self%n), self%destination(1:self%n), received)
  end subroutine outbox_exchange

  !> Cut the box into `n_bricks`, along the longest edge of a brick again and again.
  pure subroutine bricks_init(self, box, n_bricks)
    class(bricks_t), intent(inout) :: self
    type(sample_box_t), intent(in) :: box
    integer, intent(in) :: n_bricks
    integer :: left, factor, d

    self%box = box
    self%n(:) = 1
    left = n_bricks
    do while (left > 1)
      factor = largest_prime(left)
      d = maxloc((box%upper(1:box%nd) - box%lower(1:box%nd))/self%n(1:box%nd), dim=1)
      self%n(d) = self%n(d)*factor
      left = left/factor
    end do
  end subroutine bricks_init

  !> Largest prime factor of `n` > 1.
  pure integer function largest_prime(n) result(factor)
    integer, intent(in) :: n
    integer :: left

    left = n
    factor = 2
    do while (factor < left)
      if (mod(left, factor) == 0) then
        left = left/factor
      else
        factor = factor + 1
      end if
    end do
  end function largest_prime

  !> Rank that has the brick of a point of the box.
  pure integer function bricks_rank_of(self, position) result(rank)
    class(bricks_t), intent(in) :: self
    real(dp), intent(in) :: position(:)
    integer :: d

    rank = 0
    do d = self%box%nd, 1, -1
      rank = rank*self%n(d) + min(max(brick_at(self, d, position(d)), 0), self%n(d) - 1)
    end do
  end function bricks_rank_of

  !> Place of the brick at a coordinate along an axis, outside of 0 to n - 1 beyond the box.
  pure integer function brick_at(self, d, x) result(place)
    type(bricks_t), intent(in) :: self
    integer, intent(in) :: d
    real(dp), intent(in) :: x
    place = floor((x - self%box%lower(d))/(self%box%upper(d) - self%box%lower(d))*self%n(d))
  end function brick_at

  !> Add a record for every rank that has a brick within `reach` of a point.
  pure subroutine bricks_add_within_reach(self, position, reach, record, outbox)
    class(bricks_t), intent(in) :: self
    real(dp), intent(in) :: position(:), reach
    integer(i8), intent(in) :: record(:)
    type(outbox_t), intent(inout) :: outbox
    ! a little farther, for the rounding of a point into its brick
    real(dp), parameter :: slack = 1.0_dp + 1e-6_dp
    integer :: first(3), last(3), i, j, k, d

    first(:) = 0
    last(:) = 0
    do d = 1, self%box%nd
      first(d) = brick_at(self, d, position(d) - reach*slack)
      last(d) = brick_at(self, d, position(d) + reach*slack)
      if (.not. self%box%periodic(d)) then
        first(d) = max(first(d), 0)
        last(d) = min(last(d), self%n(d) - 1)
      else if (last(d) - first(d) >= self%n(d)) then
        ! around the period: all of them, each once
        first(d) = 0
        last(d) = self%n(d) - 1
      end if
    end do
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          call outbox%add(modulo(i, self%n(1)) + self%n(1)*(modulo(j, self%n(2)) + self%n(2)*modulo(k, self%n(3))), record)
        end do
      end do
    end do
  end subroutine bricks_add_within_reach

end module gravier_bricks
