!> The cells of a group distributed among its subdomains: the graph of the occupied pieces, cut by METIS, and what is empty
!> given to a near subdomain.
module gravier_cell_cut
  use gravier_kinds, only: i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_cell_map, only: cell_map_t
  use gravier_cell_groups, only: cell_groups_t
  use gravier_graph_partition, only: partition_graph
  implicit none
  private
  public :: cut_group, refuse_overflow

  !> sums of weights that METIS forms stay below
  integer(i8), parameter :: most_weight = 2_i8**30
  !> neighbours of a piece
  integer, parameter :: most_neighbours = 26
  !> entries of a map, so that 32 bits count the edges of its graph: below 2^31/most_neighbours
  integer(i8), parameter :: most_entries = 82000000_i8

contains

  !> Refuse groups whose graph has more entries than 32-bit indices count.
  pure subroutine refuse_overflow(entries, error)
    !> entries of the largest map
    integer(i8), intent(in) :: entries
    type(error_t), allocatable, intent(inout) :: error

    if (entries > most_entries) call raise(error, status_failure, "graph partition: "//to_text(entries)// &
      & " cells in a group of subdomains; expected at most "//to_text(most_entries)//": fewer subdomains, or a grid")
  end subroutine refuse_overflow

  !> Cut group `g` into `n_parts` parts, numbered from 1 as the pieces with weight meet them. METIS may leave some empty.
  subroutine cut_group(groups, g, weight, n_parts, owner, error)
    type(cell_groups_t), intent(in) :: groups
    integer, intent(in) :: g, n_parts
    !> (length of the group): 0 for empty pieces and for all cells that are not in pieces
    integer(i8), intent(in), contiguous :: weight(:)
    !> (length of the group): the part of each entry
    integer, intent(out), contiguous :: owner(:)
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: cell_of(:), vertex(:)
    integer(i4), allocatable :: part(:)
    integer :: cell, k, n

    owner(:) = 1
    allocate (cell_of(size(weight)), vertex(size(weight)))
    k = 0
    do cell = 1, size(groups%group_of_cell)
      if (groups%group_of_cell(cell) /= g) cycle
      n = merge(narrow(groups%cells%pieces()), 1, groups%in_pieces(cell))
      cell_of(k + 1:k + n) = cell
      k = k + n
    end do
    n = 0
    do k = 1, size(weight)
      vertex(k) = 0
      if (weight(k) == 0) cycle
      n = n + 1
      vertex(k) = n
    end do
    allocate (part(n))
    call cut_pieces(groups, cell_of, weight, vertex, n_parts, part, error)
    if (allocated(error)) return
    call number_pieces(groups, cell_of, vertex, part, owner)
    call fill_cells(groups, g, owner)
  end subroutine cut_group

  !> Build the graph of occupied pieces and cut it. Pieces that share a face have a larger weight than those that share a corner.
  subroutine cut_pieces(groups, cell_of, weight, vertex, n_parts, part, error)
    type(cell_groups_t), intent(in) :: groups
    !> (entries) each
    integer, intent(in), contiguous :: cell_of(:), vertex(:)
    integer(i8), intent(in), contiguous :: weight(:)
    integer, intent(in) :: n_parts
    integer(i4), intent(out), contiguous :: part(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i4), allocatable :: first(:), neighbour(:), vertex_weight(:), edge_weight(:)
    integer(i8), allocatable :: heavy(:), edge(:)
    integer :: k, n, j, n_list, list(most_neighbours), apart(most_neighbours)

    n = merge(8, most_neighbours, groups%cells%nd == 2)*size(part)
    allocate (first(size(part) + 1), heavy(size(part)), neighbour(n), edge(n))
    n = 0
    do k = 1, size(vertex)
      if (vertex(k) == 0) cycle
      first(vertex(k)) = n + 1
      heavy(vertex(k)) = min(weight(k), 1000000_i8)
      call list_around(groups, cell_of(k), k, list, apart, n_list)
      do j = 1, n_list
        if (vertex(list(j)) == 0) cycle
        n = n + 1
        neighbour(n) = vertex(list(j))
        edge(n) = min(weight(k), weight(list(j)), 100000_i8)*merge(4, 1, apart(j) == 1)
      end do
    end do
    first(size(part) + 1) = n + 1
    call lighten(heavy, vertex_weight)
    call lighten(edge(1:n), edge_weight)
    call partition_graph(first, neighbour(1:n), vertex_weight, edge_weight, n_parts, part, error)
  end subroutine cut_pieces

  !> Weights whose sum METIS can form: divided where it is too large.
  pure subroutine lighten(weight, light)
    integer(i8), intent(in), contiguous :: weight(:)
    integer(i4), allocatable, intent(out) :: light(:)
    integer(i8) :: divisor
    integer :: k

    divisor = 1 + sum(weight)/most_weight
    allocate (light(size(weight)))
    do k = 1, size(weight)
      light(k) = narrow(max(1_i8, weight(k)/divisor))
    end do
  end subroutine lighten

  !> Entries of the pieces around entry `k`, of cell `cell`, that belong to the same group and to cells in pieces.
  pure subroutine list_around(groups, cell, k, list, apart, n)
    type(cell_groups_t), intent(in) :: groups
    integer, intent(in) :: cell, k
    integer, intent(out) :: list(most_neighbours), apart(most_neighbours), n
    integer :: place(3), places(3, 26), all_apart(26), n_places, j, other

    call groups%cells%place_of(cell, k - 1 - groups%before(cell), place)
    call groups%cells%around(place, places, all_apart, n_places)
    list(:) = 0
    apart(:) = 0
    n = 0
    do j = 1, n_places
      other = groups%cells%cell_at(places(:, j))
      if (groups%group_of_cell(other) /= groups%group_of_cell(cell) .or. .not. groups%in_pieces(other)) cycle
      n = n + 1
      list(n) = groups%entry_at(places(:, j))
      apart(n) = all_apart(j)
    end do
  end subroutine list_around

  !> Give parts numbers in the order in which the pieces meet them, and every empty piece to a near part.
  subroutine number_pieces(groups, cell_of, vertex, part, owner)
    type(cell_groups_t), intent(in) :: groups
    integer, intent(in), contiguous :: cell_of(:), vertex(:)
    integer(i4), intent(in), contiguous :: part(:)
    !> (entries): 0 for cells that are not in pieces
    integer, intent(out), contiguous :: owner(:)
    integer, allocatable :: number_of(:), queue(:)
    integer :: k, n, j, head, tail, n_list, list(most_neighbours), apart(most_neighbours)

    allocate (number_of(maxval(part)), source=0)
    allocate (queue(size(vertex)))
    owner(:) = 0
    n = 0
    tail = 0
    do k = 1, size(vertex)
      if (vertex(k) == 0) cycle
      if (number_of(part(vertex(k))) == 0) then
        n = n + 1
        number_of(part(vertex(k))) = n
      end if
      owner(k) = number_of(part(vertex(k)))
      tail = tail + 1
      queue(tail) = k
    end do
    head = 1
    do while (head <= tail)
      call list_around(groups, cell_of(queue(head)), queue(head), list, apart, n_list)
      do j = 1, n_list
        if (owner(list(j)) > 0) cycle
        owner(list(j)) = owner(queue(head))
        tail = tail + 1
        queue(tail) = list(j)
      end do
      head = head + 1
    end do
  end subroutine number_pieces

  !> Give the cells of the group that are not in pieces to the part of the nearest piece of a cell next to them.
  subroutine fill_cells(groups, g, owner)
    type(cell_groups_t), intent(in) :: groups
    integer, intent(in) :: g
    integer, intent(inout), contiguous :: owner(:)
    type(cell_map_t) :: whole
    integer, allocatable :: queue(:)
    integer :: cell, other, head, tail, j, n_list, list(3, 26), apart(26), place(3), near(3)

    if (all(groups%in_pieces .or. groups%group_of_cell /= g)) return
    whole = groups%cells
    call whole%set_split(1)
    allocate (queue(count(groups%group_of_cell == g)))
    tail = 0
    do cell = 1, size(groups%group_of_cell)
      if (groups%group_of_cell(cell) /= g .or. .not. groups%in_pieces(cell)) cycle
      tail = tail + 1
      queue(tail) = cell
    end do
    head = 1
    do while (head <= tail)
      call whole%place_of(queue(head), 0, place)
      call whole%around(place, list, apart, n_list)
      do j = 1, n_list
        other = whole%cell_at(list(:, j))
        if (groups%group_of_cell(other) /= g .or. groups%in_pieces(other)) cycle
        if (owner(groups%before(other) + 1) > 0) cycle
        call find_piece_towards(groups%cells, place, list(:, j), near)
        owner(groups%before(other) + 1) = owner(groups%entry_at(near))
        tail = tail + 1
        queue(tail) = other
      end do
      head = head + 1
    end do
  end subroutine fill_cells

  !> Place of the piece of the cell at `cell` that lies towards its neighbour at `other`.
  pure subroutine find_piece_towards(cells, cell, other, place)
    type(cell_map_t), intent(in) :: cells
    !> in cells
    integer, intent(in) :: cell(3), other(3)
    !> in pieces
    integer, intent(out) :: place(3)
    integer :: d

    place(:) = 0
    do d = 1, cells%nd
      if (other(d) == cell(d)) then
        place(d) = cell(d)*cells%split + cells%split/2
      else if (other(d) - cell(d) == 1 .or. other(d) - cell(d) < -1) then
        place(d) = (cell(d) + 1)*cells%split - 1
      else
        place(d) = cell(d)*cells%split
      end if
    end do
  end subroutine find_piece_towards

end module gravier_cell_cut
