!> Occupied cells of grids of several edges, found by hashing: empty space costs nothing, however far bodies fly.
module gravier_cell_hash
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort
  implicit none
  private
  public :: cell_hash_t, cell_key, n_levels, last_cell

  !> grids of edges halved from one level to the next
  integer, parameter :: n_levels = 16
  !> numbers of cells along an axis, from 0 to last_cell
  integer, parameter :: bits = 19
  integer, parameter :: last_cell = 2**bits - 1

  !> Items grouped by cell.
  type :: cell_hash_t
    integer :: n_cells = 0
    !> items in the order of cells (items)
    integer, allocatable :: order(:)
    !> key of each occupied cell, and the first of its items in `order`, with one more entry at the end
    integer(i8), allocatable :: key(:)
    integer, allocatable :: first(:)
    !> open addressing: the cell that is found there, or 0; its size is a power of 2
    integer, private, allocatable :: slot(:)
  contains
    procedure :: init => cell_hash_init
    procedure :: find => cell_hash_find
  end type cell_hash_t

contains

  !> Key of the cell at `place` (each from 0) on a grid; clamped to the outermost cells.
  pure integer(i8) function cell_key(level, place) result(key)
    !> 0 to n_levels - 1
    integer, intent(in) :: level
    integer, intent(in) :: place(3)
    integer :: d

    key = level
    do d = 3, 1, -1
      key = ior(ishft(key, bits), int(min(max(place(d), 0), last_cell), i8))
    end do
  end function cell_key

  !> Group items by the keys of their cells.
  subroutine cell_hash_init(self, keys)
    class(cell_hash_t), intent(inout) :: self
    !> (items)
    integer(i8), intent(in), contiguous :: keys(:)
    integer :: k, at, room

    if (allocated(self%order)) deallocate (self%order, self%key, self%first, self%slot)
    allocate (self%order(size(keys)), self%key(size(keys)), self%first(size(keys) + 1))
    call argsort(keys, self%order)
    self%n_cells = 0
    do k = 1, size(keys)
      if (k > 1) then
        if (keys(self%order(k)) == keys(self%order(k - 1))) cycle
      end if
      self%n_cells = self%n_cells + 1
      self%key(self%n_cells) = keys(self%order(k))
      self%first(self%n_cells) = k
    end do
    self%first(self%n_cells + 1) = size(keys) + 1
    room = 16
    do while (room < 2*self%n_cells)
      room = 2*room
    end do
    allocate (self%slot(0:room - 1), source=0)
    do k = 1, self%n_cells
      at = start_of(self%key(k), room)
      do while (self%slot(at) /= 0)
        at = iand(at + 1, room - 1)
      end do
      self%slot(at) = k
    end do
  end subroutine cell_hash_init

  !> Number of the occupied cell of a key, 0 where it is empty.
  pure integer function cell_hash_find(self, key) result(cell)
    class(cell_hash_t), intent(in) :: self
    integer(i8), intent(in) :: key
    integer :: at

    at = start_of(key, size(self%slot))
    do
      cell = self%slot(at)
      if (cell == 0) return
      if (self%key(cell) == key) return
      at = iand(at + 1, size(self%slot) - 1)
    end do
  end function cell_hash_find

  !> Where the search for a key begins: its bits stirred by shifts (xorshift), which cannot overflow.
  pure integer function start_of(key, room) result(at)
    integer(i8), intent(in) :: key
    integer, intent(in) :: room
    integer(i8) :: mixed

    mixed = ieor(key, ishft(key, -21))
    mixed = ieor(mixed, ishft(mixed, 13))
    mixed = ieor(mixed, ishft(mixed, -7))
    mixed = ieor(mixed, ishft(mixed, 17))
    mixed = ieor(mixed, ishft(mixed, -29))
    at = narrow(iand(mixed, int(room - 1, i8)))
  end function start_of

end module gravier_cell_hash
