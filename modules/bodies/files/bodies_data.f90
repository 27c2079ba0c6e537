!> Bodies and walls as read from a file, and the checks common to all formats.
module gravier_bodies_data
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow, take_count
  use gravier_room, only: room_for
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_memory_need, only: check_memory
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_sorting, only: argsort
  use gravier_given_contacts, only: given_contacts_t
  implicit none
  private
  public :: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls, find_own_rows, data_bytes, make_unit, check_unique_ids

  !> The rows of this rank, in the order of the file, and all walls. SI units.
  type :: bodies_data_t
    !> the program that writes them, which its file says; not allocated where nothing is written
    character(len=:), allocatable :: made_by
    !> 2 or 3
    integer :: dimension = 0
    !> rows of this rank, and of all ranks together
    integer :: n = 0
    integer(i8) :: total = 0
    !> (n): >= 1, unique among bodies and walls of all ranks
    integer(i8), allocatable :: id(:)
    !> (dimension, n)
    real(dp), allocatable :: position(:, :)
    !> 2D (3, n): vx, vy, omega; 3D (6, n): vx, vy, vz, wx, wy, wz; zero where the file has none
    real(dp), allocatable :: velocity(:, :)
    !> (n): > 0
    real(dp), allocatable :: radius(:)
    !> (n): > 0; not allocated when the file has no masses
    real(dp), allocatable :: mass(:)
    !> (n): 0 a free grain, k >= 1 a grain glued to the boundary of group k; zero where the file has none
    integer, allocatable :: group(:)
    !> (n): >= 1, number of the material; 1 where the file has none
    integer, allocatable :: material(:)
    !> (n): number of the shape in the library of the scene, 0 a disk or a sphere; radii are then those of the balls about the
    !> centres of mass that hold the bodies. Not allocated where the scene has no library
    integer, allocatable :: shape(:)
    !> with the shapes: 2D (1, n), angles [rad]; 3D (4, n), unit quaternions whose real part comes first
    real(dp), allocatable :: orientation(:, :)
    !> the same on all ranks
    integer :: n_walls = 0
    !> (n_walls)
    integer(i8), allocatable :: wall_id(:)
    !> (dimension, n_walls): a point of each plane, and its unit normal towards the free side
    real(dp), allocatable :: wall_point(:, :), wall_normal(:, :)
    !> whether the file has a periodic box, its lower corner and its lengths; an axis of length 0 is not periodic
    logical :: has_box = .false.
    real(dp) :: origin(3) = 0, period(3) = 0
    !> whether it is a cell that may be sheared and may move: tilts of its edges [m], rates of its lengths and tilts [m/s], as those
    !> of period_t
    logical :: has_edges = .false.
    real(dp) :: tilt(3) = 0, length_rate(3) = 0, tilt_rate(3) = 0
    !> from which the first solve starts; none where the file has none
    type(given_contacts_t) :: contacts
  end type bodies_data_t

contains

  !> Of one body, the least that it takes while it is read or made.
  pure integer function data_bytes(dimension) result(bytes)
    integer, intent(in) :: dimension
    bytes = 8*(4 + dimension + 3*(dimension - 1))
  end function data_bytes

  !> Room for n bodies at rest, free, of the first material. Failure: status_failure, without memory for them.
  subroutine allocate_bodies(bodies, dimension, n, with_masses, what, error)
    type(bodies_data_t), intent(inout) :: bodies
    integer, intent(in) :: dimension, n
    !> which are then to be set
    logical, intent(in) :: with_masses
    !> that has so many, for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: nv

    if (allocated(error)) return
    nv = 3*(dimension - 1)
    bodies%dimension = dimension
    bodies%n = n
    if (room_for(int(n, i8), data_bytes(dimension), what, error) < n) return
    allocate (bodies%id(n), bodies%position(dimension, n), bodies%radius(n), bodies%velocity(nv, n), bodies%group(n), &
      & bodies%material(n))
    if (with_masses) allocate (bodies%mass(n))
    bodies%group(:) = 0
    bodies%material(:) = 1
    bodies%velocity(:, :) = 0.0_dp
  end subroutine allocate_bodies

  !> Room for the shapes of the bodies, which are disks or spheres in the axes of the scene so far. Failure: status_failure, without
  !> memory for them.
  subroutine allocate_shapes(bodies, what, error)
    !> allocated
    type(bodies_data_t), intent(inout) :: bodies
    !> that has so many, for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    integer :: no

    if (allocated(error)) return
    no = merge(1, 4, bodies%dimension == 2)
    if (room_for(int(bodies%n, i8), 8*no + 4, what, error) < bodies%n) return
    allocate (bodies%shape(bodies%n), source=0)
    allocate (bodies%orientation(no, bodies%n), source=0.0_dp)
    if (no == 4) bodies%orientation(1, :) = 1.0_dp
  end subroutine allocate_shapes

  !> Room for n walls. Failure: status_failure, without memory for them.
  subroutine allocate_walls(bodies, dimension, n, what, error)
    type(bodies_data_t), intent(inout) :: bodies
    integer, intent(in) :: dimension, n
    !> that has so many, for the message
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    bodies%n_walls = n
    if (room_for(int(n, i8), 8*(1 + 2*dimension), what, error) < n) return
    allocate (bodies%wall_id(n), bodies%wall_point(dimension, n), bodies%wall_normal(dimension, n))
  end subroutine allocate_walls

  !> The block of rows of this rank: `n` rows from `first` (from 0) on; blocks differ by one row at most. Failure: status_input
  !> for more rows than a rank can count, status_failure for more than there is memory for. Collective.
  subroutine find_own_rows(comm, total, dimension, what, first, n, error)
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in) :: total
    integer, intent(in) :: dimension
    !> that has these rows, for the message
    character(len=*), intent(in) :: what
    integer(i8), intent(out) :: first
    integer, intent(out) :: n
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: each, rest, next

    ! total*rank might be too large a number
    each = total/comm%size
    rest = mod(total, int(comm%size, i8))
    first = each*comm%rank + rest*comm%rank/comm%size
    next = each*(comm%rank + 1) + rest*(comm%rank + 1)/comm%size
    call take_count(next - first, what//": rows of a rank", n, error)
    call comm%agree(error)
    call check_memory(comm, what//": "//to_text(total)//" grains", real(total, dp), data_bytes(dimension), error)
  end subroutine find_own_rows

  !> Scale a vector to length one; impossible for the zero vector. Safe for every size of a finite vector.
  pure subroutine make_unit(vector, possible)
    real(dp), intent(inout) :: vector(:)
    logical, intent(out) :: possible
    real(dp) :: greatest

    greatest = maxval(abs(vector))
    possible = greatest > 0
    if (.not. possible) return
    vector(:) = vector/greatest
    vector(:) = vector/norm2(vector)
  end subroutine make_unit

  !> Refuse ids that appear twice among the bodies of all ranks and the walls (status_input; the least such id is
  !> named). Collective.
  subroutine check_unique_ids(comm, path, bodies, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: ids(:, :), received(:, :)
    integer, allocatable :: owner(:)
    integer :: n_walls

    if (allocated(error)) return
    ! walls are known to all ranks: rank 0 speaks for them
    n_walls = merge(bodies%n_walls, 0, comm%rank == 0)
    allocate (ids(1, bodies%n + n_walls))
    ids(1, 1:bodies%n) = bodies%id
    ids(1, bodies%n + 1:) = bodies%wall_id(1:n_walls)
    allocate (owner(size(ids, 2)))
    owner(:) = narrow(mod(ids(1, :), int(comm%size, i8)))
    call sparse_exchange(comm, ids, owner, received)

    call keep_least_repeated(received, ids)
    deallocate (owner)
    allocate (owner(size(ids, 2)), source=0)
    call sparse_exchange(comm, ids, owner, received)
    if (size(received) > 0) then
      call raise(error, status_input, path//": id "//to_text(minval(received))//" appears twice, but ids must be unique among "// &
        & "bodies and walls")
    end if
    call comm%agree(error)
  end subroutine check_unique_ids

  !> The least id that appears more than once: one record, or none.
  subroutine keep_least_repeated(ids, least)
    !> (1, number of ids)
    integer(i8), intent(in), contiguous :: ids(:, :)
    integer(i8), allocatable, intent(out) :: least(:, :)
    integer(i8), allocatable :: keys(:)
    integer, allocatable :: order(:)
    integer :: i

    allocate (keys(size(ids, 2)), order(size(ids, 2)))
    keys(:) = ids(1, :)
    call argsort(keys, order)
    do i = 2, size(keys)
      if (keys(order(i)) /= keys(order(i - 1))) cycle
      allocate (least(1, 1), source=keys(order(i)))
      return
    end do
    allocate (least(1, 0))
  end subroutine keep_least_repeated

end module gravier_bodies_data
