!> Cells of a partition: places of points and of pieces, groups of cells and their maps, which only the ranks near them hold, and
!> the cut of a group into parts, on rows and boxes of cells whose answers are known.
program test_cells
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_cell_map, only: cell_map_t
  use gravier_cell_groups, only: cell_groups_t
  use gravier_cell_cut, only: cut_group, refuse_overflow
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: no_period(2) = [0.0_dp, 0.0_dp]
  type(communicator_t) :: comm

  call start_parallel()
  call comm%init()
  call check_places()
  call check_cells_of_edge()
  call check_around()
  call check_range()
  call check_entries()
  call check_sharing()
  call check_cut()
  call check_filled()
  call check_balance()
  call check_refusal()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Cells of half a metre over a box of 2 m by 1 m, and pieces of a sixth.
  subroutine check_places()
    type(cell_map_t) :: map
    integer :: place(3)

    call map%set_boxes([0.0_dp, 0.0_dp], [2.0_dp, 1.0_dp], no_period, [4, 2, 1])
    call check_equal(map%cells(), 8, "cells")
    call check_equal(map%pieces(), 1_i8, "a cell in one piece")
    call map%locate([0.6_dp, 0.7_dp], place)
    call check(all(place == [1, 1, 0]), "the cell of a point")
    call check_equal(map%cell_at(place), 6, "its number")
    call map%set_split(3)
    call check_equal(map%pieces(), 9_i8, "pieces of a cell")
    call map%locate([0.6_dp, 0.7_dp], place)
    call check(all(place == [3, 4, 0]), "the piece of a point")
    call check_equal(map%cell_at(place), 6, "the cell of the piece")
    call check_equal(map%piece_at(place), 3, "the piece in its cell")
    call map%place_of(6, 3, place)
    call check(all(place == [3, 4, 0]), "and back")
    call map%locate([-5.0_dp, 7.0_dp], place)
    call check(all(place == [0, 5, 0]), "a point outside belongs to the border")
    call map%set_boxes([0.0_dp, 0.0_dp], [2.0_dp, 1.0_dp], [2.0_dp, 0.0_dp], [4, 2, 1])
    call map%locate([4.6_dp, 0.7_dp], place)
    call check(all(place == [1, 1, 0]), "along a period, to its image inside")
    call map%locate([-0.1_dp, 0.7_dp], place)
    call check(all(place == [3, 1, 0]), "on the other side, too")
    call map%set_boxes([0.0_dp, 0.0_dp], [1.5_dp, 1.0_dp], [2.0_dp, 0.0_dp], [4, 2, 1])
    call map%locate([1.4_dp, 0.7_dp], place)
    call check(all(place == [2, 1, 0]), "boxes fill the period, not the extent of what is in it")
  end subroutine check_places

  !> Along a period a whole number of cells, none smaller than asked for.
  subroutine check_cells_of_edge()
    type(cell_map_t) :: map
    real(dp) :: edge

    edge = 0.3_dp
    call map%set_cells([0.0_dp, 0.0_dp], [2.0_dp, 1.0_dp], [2.0_dp, 0.0_dp], edge, 1000_i8)
    call check_close(edge, 0.3_dp, 1.0e-12_dp, "cells as small as asked for")
    call check_equal(map%n(1), 6, "six of them fill the period")
    call check(map%n(2) >= 3, "and the box")
    call check_close(map%unit(1)/map%scale(1), 1.0_dp/3.0_dp, 1.0e-15_dp, "the length of those along the period")
  end subroutine check_cells_of_edge

  !> Neighbours of a corner: three without periods, five with one; each says along how many axes it lies apart.
  subroutine check_around()
    type(cell_map_t) :: map
    integer :: list(3, 26), apart(26), n

    call map%set_boxes([0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp], no_period, [4, 3, 1])
    call map%around([0, 0, 0], list, apart, n)
    call check_equal(n, 3, "neighbours of a corner")
    call check_equal(count(apart(1:n) == 1), 2, "two across faces")
    call map%around([1, 1, 0], list, apart, n)
    call check_equal(n, 8, "neighbours of a cell inside")
    call check_equal(count(apart(1:n) == 2), 4, "four at corners")
    call map%set_boxes([0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp], [1.0_dp, 0.0_dp], [4, 3, 1])
    call map%around([0, 0, 0], list, apart, n)
    call check_equal(n, 5, "neighbours of a corner with a period")
    call check(any(list(1, 1:n) == 3 .and. list(2, 1:n) == 0), "one on the other side")
  end subroutine check_around

  !> Every point within reach of another one lies in the range of places around it; and a short reach has a short range.
  subroutine check_range()
    type(cell_map_t) :: map
    real(dp) :: a(2), b(2), reach
    integer :: k, d, low(3), high(3), place(3), sides(2)
    logical :: inside

    call map%set_boxes([0.0_dp, -1.0_dp], [2.0_dp, 1.0_dp], [2.0_dp, 0.0_dp], [5, 4, 1])
    call map%set_split(2)
    sides(:) = [10, 8]
    do k = 1, 2000
      reach = 0.5_dp*hash_uniform(1, int(k, i8), 1)
      do d = 1, 2
        a(d) = 3.0_dp*hash_uniform(2, int(k, i8), d) - 1.0_dp
        b(d) = a(d) + 0.7_dp*reach*(2*hash_uniform(3, int(k, i8), d) - 1.0_dp)
      end do
      call map%range(a, reach, low, high)
      call map%locate(b, place)
      inside = low(2) <= place(2) .and. place(2) <= high(2)
      inside = inside .and. modulo(place(1) - low(1), sides(1)) <= high(1) - low(1)
      call check(inside, "a point within reach is in the range")
      call check(high(1) - low(1) < sides(1), "no place stands twice")
      if (reach < 0.1_dp) call check(high(1) - low(1) <= 2 .and. high(2) - low(2) <= 2, "a short reach has a short range")
    end do
  end subroutine check_range

  !> Two groups over four cells, one of which has one entry for all of its four pieces.
  subroutine check_entries()
    type(cell_map_t) :: map
    type(cell_groups_t) :: groups
    integer :: s

    call map%set_boxes([0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp], no_period, [2, 2, 1])
    call map%set_split(2)
    call groups%set(map, 2, [1, 2, 1, 2], [.true., .false., .true., .true.])
    call check(all(groups%length == [8_i8, 5_i8]), "entries of the groups")
    call check(all(groups%before == [0, 0, 4, 1]), "entries before those of each cell")
    call check_equal(groups%entry_at([0, 0, 0]), 1, "the first entry of a group")
    call check_equal(groups%entry_at([3, 1, 0]), 1, "any piece of the cell with one entry")
    call check_equal(groups%entry_at([1, 3, 0]), 8, "the last piece of the third cell")
    call check_equal(groups%entry_at([2, 3, 0]), 4, "a piece of the fourth")
    call groups%set_first([3, 2])
    call check(all(groups%first == [1, 4, 6]), "subdomains of the groups")
    do s = 1, 5
      call check_equal(groups%group_of(s), merge(1, 2, s <= 3), "group of a subdomain")
    end do
    call check_equal(groups%subdomain_at([0, 0, 0]), 0, "no map is known yet")
    call groups%hold(2)
    groups%maps(groups%known(2))%subdomain(:) = [4, 5, 4, 5, 5]
    call check_equal(groups%subdomain_at([3, 1, 0]), 4, "the subdomain of the cell with one entry")
    call check_equal(groups%subdomain_at([2, 3, 0]), 5, "and of a piece")
    call check_equal(groups%subdomain_at([1, 3, 0]), 0, "the other map is not known")
  end subroutine check_entries

  !> Twelve groups in a row, a cell of 144 pieces each, more than a message record holds. Each rank gets the maps of its groups and
  !> of those that touch them, and no others.
  subroutine check_sharing()
    integer, parameter :: n = 12
    type(cell_map_t) :: map
    type(cell_groups_t) :: groups
    integer :: g, k, holder(n), ones(n), place(3), first, last
    logical :: pieces(n), needed

    call map%set_boxes([0.0_dp, 0.0_dp], [12.0_dp, 1.0_dp], no_period, [n, 1, 1])
    call map%set_split(12)
    pieces(:) = .true.
    ones(:) = 1
    call groups%set(map, n, [(g, g=1, n)], pieces)
    call groups%set_first(ones)
    do g = 1, n
      ! the map of a group is made by a rank that need not own its subdomain
      holder(g) = mod(g, comm%size)
      if (holder(g) /= comm%rank) cycle
      call groups%hold(g)
      do k = 1, 144
        groups%maps(groups%known(g))%subdomain(k) = 1000*g + k
      end do
    end do
    call groups%share(comm, holder)
    first = comm%first_subdomain(comm%rank, n)
    last = comm%first_subdomain(comm%rank + 1, n) - 1
    do g = 1, n
      needed = first - 1 <= g .and. g <= last + 1
      call check(groups%known(g) > 0 .eqv. needed, "a rank knows the maps near it, and no others")
      do k = 1, 144
        call map%place_of(g, k - 1, place)
        call check_equal(groups%subdomain_at(place), merge(1000*g + k, 0, needed), "an entry of a map")
      end do
    end do
  end subroutine check_sharing

  !> Two clusters in a row of cells make two parts, numbered as they are met; what is empty goes to the nearer one.
  subroutine check_cut()
    type(cell_map_t) :: map
    type(cell_groups_t) :: groups
    type(error_t), allocatable :: error
    integer :: owner(6)
    logical :: pieces(6)

    call map%set_boxes([0.0_dp, 0.0_dp], [6.0_dp, 1.0_dp], no_period, [6, 1, 1])
    pieces(:) = .true.
    call groups%set(map, 1, [1, 1, 1, 1, 1, 1], pieces)
    call cut_group(groups, 1, [5_i8, 5_i8, 0_i8, 0_i8, 5_i8, 5_i8], 2, owner, error)
    call check(.not. allocated(error), "a cut")
    call check(all(owner == [1, 1, 1, 2, 2, 2]), "two clusters, and the empty cells near them")
    call cut_group(groups, 1, [0_i8, 5_i8, 5_i8, 0_i8, 0_i8, 0_i8], 1, owner, error)
    call check(all(owner == 1), "one part has all")
  end subroutine check_cut

  !> A cell that is not in pieces belongs to the part of the nearest piece of a cell next to it, and parts two pieces of a cell.
  subroutine check_filled()
    type(cell_map_t) :: map
    type(cell_groups_t) :: groups
    type(error_t), allocatable :: error
    integer :: owner(9)

    call map%set_boxes([0.0_dp, 0.0_dp], [3.0_dp, 1.0_dp], no_period, [3, 1, 1])
    call map%set_split(2)
    call groups%set(map, 1, [1, 1, 1], [.true., .false., .true.])
    call check_equal(groups%length(1), 9_i8, "two cells in four pieces, and one whole")
    ! pieces of the first cell: left and right below, left and right above
    call cut_group(groups, 1, [7_i8, 0_i8, 7_i8, 0_i8, 0_i8, 7_i8, 7_i8, 7_i8, 0_i8], 2, owner, error)
    call check(.not. allocated(error), "a cut")
    call check(all(owner(1:4) == 1), "the first cell, its empty pieces included")
    call check(all(owner(6:9) == 2), "the last cell")
    call check_equal(owner(5), 1, "the whole cell goes to its first neighbour")
  end subroutine check_filled

  !> Equal weights are shared out equally, and parts hang together: of 8 by 8 cells in 4 parts 16 each, as METIS allows 3 %.
  subroutine check_balance()
    type(cell_map_t) :: map
    type(cell_groups_t) :: groups
    type(error_t), allocatable :: error
    integer :: owner(64), ones(64), k, part, seen, n, j, list(3, 26), apart(26), place(3)
    integer(i8) :: weight(64)
    logical :: pieces(64), reached(64)

    call map%set_boxes([0.0_dp, 0.0_dp], [8.0_dp, 8.0_dp], no_period, [8, 8, 1])
    pieces(:) = .true.
    ones(:) = 1
    weight(:) = 10
    call groups%set(map, 1, ones, pieces)
    call cut_group(groups, 1, weight, 4, owner, error)
    call check(.not. allocated(error), "a cut of a square")
    call check_equal(owner(1), 1, "the first cell is of the first part")
    do part = 1, 4
      call check(abs(count(owner == part) - 16) <= 1, "equal parts")
      ! spread from one cell of the part
      reached(:) = .false.
      reached(findloc_of(owner, part)) = .true.
      do
        seen = count(reached)
        do k = 1, 64
          if (.not. reached(k)) cycle
          call map%place_of(k, 0, place)
          call map%around(place, list, apart, n)
          do j = 1, n
            if (owner(map%cell_at(list(:, j))) == part) reached(map%cell_at(list(:, j))) = .true.
          end do
        end do
        if (count(reached) == seen) exit
      end do
      call check_equal(count(reached), count(owner == part), "a part hangs together")
    end do
  end subroutine check_balance

  pure integer function findloc_of(list, value) result(place)
    integer, intent(in) :: list(:), value
    do place = 1, size(list)
      if (list(place) == value) return
    end do
  end function findloc_of

  !> Groups of more entries than 32 bits count edges of.
  subroutine check_refusal()
    type(error_t), allocatable :: error

    call refuse_overflow(82000000_i8, error)
    call check(.not. allocated(error), "as many cells as edges can be counted of")
    call refuse_overflow(82000001_i8, error)
    call check(allocated(error), "one more is refused")
  end subroutine check_refusal

end program test_cells
