!> Occupied cells found by hashing: every item once, in its cell; nothing where nobody is.
program test_cell_hash
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: i8
  use gravier_cell_hash, only: cell_hash_t, cell_key, n_levels, last_cell
  use gravier_test_scenes, only: draw
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_keys()
  call test_items(1, 4)
  call test_items(1000, 3)
  call test_items(2000, last_cell + 1)
  call test_none()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Keys differ from level to level and from place to place, and ascend with the level, then z, y, x.
  subroutine test_keys()
    integer, parameter :: corners(2) = [0, last_cell]
    integer(i8) :: before, key
    integer :: level, x, y, z, place(3)
    logical :: ascending

    ascending = .true.
    before = -1
    do level = 0, n_levels - 1
      do z = 1, 2
        do y = 1, 2
          do x = 1, 2
            place(1) = corners(x)
            place(2) = corners(y)
            place(3) = corners(z)
            key = cell_key(level, place)
            ascending = ascending .and. key > before
            before = key
          end do
        end do
      end do
    end do
    call check(ascending, "keys of the cells at the corners of all levels")
    place(:) = last_cell + 1
    key = cell_key(1, place)
    place(:) = last_cell
    call check_equal(key, cell_key(1, place), "a place beyond the last cell is clamped")
    place(:) = -1
    key = cell_key(1, place)
    place(:) = 0
    call check_equal(key, cell_key(1, place), "a place before the first cell is clamped")
  end subroutine test_keys

  !> `n` items in cells from 0 to cells - 1 along each axis, twice with the same table.
  subroutine test_items(n, cells)
    integer, intent(in) :: n, cells
    type(cell_hash_t) :: hash
    integer(i8) :: keys(n)
    integer :: round, k, c, d, i, place(3)
    integer :: met(n)
    logical :: grouped, found

    do round = 1, 2
      do k = 1, n
        do d = 1, 3
          place(d) = int(cells*draw(round, k, d))
        end do
        keys(k) = cell_key(int(n_levels*draw(round, k, 4)), place)
      end do
      call hash%init(keys)
      met(:) = 0
      grouped = hash%first(1) == 1 .and. hash%first(hash%n_cells + 1) == n + 1
      found = .true.
      do c = 1, hash%n_cells
        grouped = grouped .and. hash%first(c + 1) > hash%first(c)
        found = found .and. hash%find(hash%key(c)) == c
        do i = hash%first(c), hash%first(c + 1) - 1
          met(hash%order(i)) = met(hash%order(i)) + 1
          grouped = grouped .and. keys(hash%order(i)) == hash%key(c)
        end do
      end do
      do c = 2, hash%n_cells
        grouped = grouped .and. hash%key(c) > hash%key(c - 1)
      end do
      call check(all(met == 1), "every item once")
      call check(grouped, "items grouped by cell, each cell once")
      call check(found, "every occupied cell is found")
      place(:) = cells
      if (cells <= last_cell) call check_equal(hash%find(cell_key(0, place)), 0, "an empty cell is not")
    end do
  end subroutine test_items

  subroutine test_none()
    type(cell_hash_t) :: hash
    integer(i8) :: keys(0)

    call hash%init(keys)
    call check_equal(hash%n_cells, 0, "no item, no cell")
    call check_equal(hash%find(0_i8), 0, "nothing in it")
  end subroutine test_none

end program test_cell_hash
