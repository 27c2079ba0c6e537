!> Partitions of space into subdomains: a grid of equal boxes (paper, (3)-(4)), or cells shared out by a graph partition.
module gravier_partition
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_region, only: region_t
  use gravier_cell_grid, only: cell_grid_t
  use gravier_body_store, only: body_set_t
  use gravier_graph_partition, only: partition_graph
  implicit none
  private
  public :: partition_t, choose_boxes, check_subdomains

  !> Points outside the box of the partition belong to the nearest subdomain of its border.
  type, extends(region_t) :: partition_t
    integer :: nd = 2
    integer :: n_subdomains = 1
    !> bounding box at the time of the partition [m]
    real(dp) :: lower(3) = 0.0_dp, upper(3) = 1.0_dp
    !> grid: boxes along each axis
    integer :: boxes(3) = 1
    !> graph: cells, and the subdomain of each; not allocated for a grid
    type(cell_grid_t) :: cells
    integer, allocatable :: subdomain_of_cell(:)
  contains
    procedure :: owner => partition_owner
    procedure :: near => partition_near
    procedure :: init_grid => partition_init_grid
    procedure :: init_graph => partition_init_graph
  end type partition_t

  !> cells of the graph, whatever the scene: what each rank holds of it stays bounded
  integer(i8), parameter :: cell_limit = 262144_i8
  !> cells wanted per subdomain where there are many subdomains
  integer(i8), parameter :: cells_per_subdomain = 64_i8

contains

  !> Equal boxes over the bounding box of the scene.
  subroutine partition_init_grid(self, lower, upper, boxes, edge, error)
    class(partition_t), intent(inout) :: self
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    integer, intent(in) :: boxes(3)
    !> edge of a detection cell [m]: no more boxes than cells
    real(dp), intent(in) :: edge
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(self%subdomain_of_cell)) deallocate (self%subdomain_of_cell)
    call set_box(self, lower, upper)
    self%boxes(:) = boxes
    self%n_subdomains = product(boxes)
    call check_subdomains(lower, upper, edge, self%n_subdomains, error)
  end subroutine partition_init_grid

  !> Refuse more subdomains than detection cells; cheap, whatever their number.
  subroutine check_subdomains(lower, upper, edge, n_subdomains, error)
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    !> edge of a detection cell [m]
    real(dp), intent(in) :: edge
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    type(cell_grid_t) :: cells

    call cells%init(lower, upper, edge, huge(0_i4) - 1_i8)
    call refuse_too_many(n_subdomains, cells%cells(), error)
  end subroutine check_subdomains

  subroutine refuse_too_many(n_subdomains, n_cells, error)
    integer, intent(in) :: n_subdomains, n_cells
    type(error_t), allocatable, intent(inout) :: error

    if (n_subdomains > n_cells) call raise(error, status_input, "&decomposition subdomains = "//to_text(n_subdomains)// &
      & ": more subdomains than detection cells; expected at most "//to_text(n_cells)//" for this scene")
  end subroutine refuse_too_many

  subroutine set_box(self, lower, upper)
    class(partition_t), intent(inout) :: self
    real(dp), intent(in) :: lower(:), upper(:)

    self%nd = size(lower)
    self%lower(:) = 0.0_dp
    self%upper(:) = 1.0_dp
    self%lower(1:self%nd) = lower
    self%upper(1:self%nd) = upper
  end subroutine set_box

  !> Boxes along each axis for `n_subdomains`: of all factorisations, the one that cuts the least surface.
  pure function choose_boxes(lower, upper, n_subdomains) result(boxes)
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    integer, intent(in) :: n_subdomains
    integer :: boxes(3)
    integer :: a, b, c
    real(dp) :: extent(3), cut, least

    extent(:) = 1.0_dp
    extent(1:size(lower)) = max(upper - lower, tiny(1.0_dp))
    extent(:) = extent/maxval(extent(1:size(lower)))
    boxes(:) = 1
    boxes(1) = n_subdomains
    least = huge(1.0_dp)
    do a = 1, n_subdomains
      if (mod(n_subdomains, a) /= 0) cycle
      do b = 1, n_subdomains/a
        if (mod(n_subdomains/a, b) /= 0) cycle
        c = n_subdomains/(a*b)
        if (size(lower) == 2 .and. c > 1) cycle
        cut = (a - 1)*extent(2)*extent(3) + (b - 1)*extent(1)*extent(3) + (c - 1)*extent(1)*extent(2)
        if (cut < least) then
          least = cut
          boxes(1) = a
          boxes(2) = b
          boxes(3) = c
        end if
      end do
    end do
  end function choose_boxes

  !> Cells shared out so that each subdomain holds about as many grains and few neighbours are cut. Each rank
  !> gives its own grains; the number of cells is bounded, so that what a rank holds does not grow with the scene.
  !> Collective; every rank computes the same partition.
  subroutine partition_init_graph(self, comm, lower, upper, edge, bodies, n_subdomains, error)
    class(partition_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    !> smallest edge of a cell [m]
    real(dp), intent(in) :: edge
    !> of the subdomains of this rank
    type(body_set_t), intent(in) :: bodies(:)
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: grains(:)
    integer, allocatable :: vertex(:)
    integer(i4), allocatable :: part(:)
    integer :: s, k, cell, n

    call set_box(self, lower, upper)
    self%n_subdomains = n_subdomains
    call self%cells%init(lower, upper, edge, max(cell_limit, cells_per_subdomain*n_subdomains))
    allocate (grains(self%cells%cells()), source=0_i8)
    do s = 1, size(bodies)
      do k = 1, bodies(s)%n
        cell = self%cells%index_of(bodies(s)%position(:, k))
        grains(cell) = grains(cell) + 1
      end do
    end do
    call comm%sum_counts(grains)
    allocate (vertex(size(grains)), source=0)
    n = 0
    do cell = 1, size(grains)
      if (grains(cell) == 0) cycle
      n = n + 1
      vertex(cell) = n
    end do
    call refuse_too_many(n_subdomains, n, error)
    if (allocated(error)) return
    allocate (part(n))
    call cut_cells(self%cells, grains, vertex, n_subdomains, part, error)
    if (allocated(error)) return
    call number_cells(self, vertex, part)
  end subroutine partition_init_graph

  !> Build the graph of occupied cells and cut it. Cells that share a face weigh more than those that share a corner.
  subroutine cut_cells(cells, grains, vertex, n_parts, part, error)
    type(cell_grid_t), intent(in) :: cells
    integer(i8), intent(in), contiguous :: grains(:)
    integer, intent(in), contiguous :: vertex(:)
    integer, intent(in) :: n_parts
    integer(i4), intent(out), contiguous :: part(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i4), allocatable :: first(:), neighbour(:), edge_weight(:), vertex_weight(:)
    integer :: cell, other, v, n, list(26), apart(26), n_list, k

    allocate (first(size(part) + 1), vertex_weight(size(part)), neighbour(26*size(part)), edge_weight(26*size(part)))
    n = 0
    do cell = 1, size(vertex)
      v = vertex(cell)
      if (v == 0) cycle
      first(v) = n + 1
      vertex_weight(v) = int(min(grains(cell), 1000000_i8), i4)
      call list_neighbours(cells, cell, list, apart, n_list)
      do k = 1, n_list
        other = list(k)
        if (vertex(other) == 0) cycle
        n = n + 1
        neighbour(n) = vertex(other)
        edge_weight(n) = int(min(grains(cell), grains(other), 100000_i8), i4)*merge(4, 1, apart(k) == 1)
      end do
    end do
    first(size(part) + 1) = n + 1
    call partition_graph(first, neighbour(1:n), vertex_weight, edge_weight(1:n), n_parts, part, error)
  end subroutine cut_cells

  !> The cells around a cell, and along how many axes each lies apart.
  pure subroutine list_neighbours(cells, cell, list, apart, n)
    type(cell_grid_t), intent(in) :: cells
    integer, intent(in) :: cell
    integer, intent(out) :: list(26), apart(26), n
    integer :: place(3), other(3), x, y, z

    place(1) = mod(cell - 1, cells%n(1))
    place(2) = mod((cell - 1)/cells%n(1), cells%n(2))
    place(3) = (cell - 1)/(cells%n(1)*cells%n(2))
    list(:) = 0
    apart(:) = 0
    n = 0
    do z = max(place(3) - 1, 0), min(place(3) + 1, cells%n(3) - 1)
      do y = max(place(2) - 1, 0), min(place(2) + 1, cells%n(2) - 1)
        do x = max(place(1) - 1, 0), min(place(1) + 1, cells%n(1) - 1)
          other(1) = x
          other(2) = y
          other(3) = z
          if (all(other == place)) cycle
          n = n + 1
          list(n) = cells%flat(other)
          apart(n) = count(other /= place)
        end do
      end do
    end do
  end subroutine list_neighbours

  !> Give subdomains numbers in the order in which the cells meet them, and every empty cell to a near subdomain.
  subroutine number_cells(self, vertex, part)
    class(partition_t), intent(inout) :: self
    integer, intent(in), contiguous :: vertex(:)
    integer(i4), intent(in), contiguous :: part(:)
    integer, allocatable :: number_of(:), queue(:)
    integer :: cell, n, head, tail, list(26), apart(26), n_list, k

    if (allocated(self%subdomain_of_cell)) deallocate (self%subdomain_of_cell)
    allocate (self%subdomain_of_cell(size(vertex)), number_of(self%n_subdomains), source=0)
    allocate (queue(size(vertex)))
    n = 0
    tail = 0
    do cell = 1, size(vertex)
      if (vertex(cell) == 0) cycle
      if (number_of(part(vertex(cell))) == 0) then
        n = n + 1
        number_of(part(vertex(cell))) = n
      end if
      self%subdomain_of_cell(cell) = number_of(part(vertex(cell)))
      tail = tail + 1
      queue(tail) = cell
    end do
    head = 1
    do while (head <= tail)
      call list_neighbours(self%cells, queue(head), list, apart, n_list)
      do k = 1, n_list
        if (self%subdomain_of_cell(list(k)) > 0) cycle
        self%subdomain_of_cell(list(k)) = self%subdomain_of_cell(queue(head))
        tail = tail + 1
        queue(tail) = list(k)
      end do
      head = head + 1
    end do
  end subroutine number_cells

  !> Subdomain that holds a point.
  pure integer function partition_owner(self, point) result(subdomain)
    class(partition_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    integer :: d, place

    if (allocated(self%subdomain_of_cell)) then
      subdomain = self%subdomain_of_cell(self%cells%index_of(point))
      return
    end if
    subdomain = 0
    do d = self%nd, 1, -1
      place = box_along(self, d, point(d))
      subdomain = subdomain*self%boxes(d) + place
    end do
    subdomain = subdomain + 1
  end function partition_owner

  !> Box along axis `d`, from 0, that holds coordinate `x`.
  pure integer function box_along(self, d, x) result(place)
    class(partition_t), intent(in) :: self
    integer, intent(in) :: d
    real(dp), intent(in) :: x
    real(dp) :: y

    y = (x - self%lower(d))/(self%upper(d) - self%lower(d))*self%boxes(d)
    place = int(min(max(y, 0.0_dp), real(self%boxes(d) - 1, dp)))
  end function box_along

  !> Subdomains that may hold a point within `reach` of `point`, each once.
  pure subroutine partition_near(self, point, reach, list, n)
    class(partition_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in), contiguous :: point(:)
    real(dp), intent(in) :: reach
    !> the first n are set; grown where needed
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(out) :: n
    integer :: low(3), high(3), x, y, z, d, place(3)
    real(dp) :: margin, corner(size(point))

    low(:) = 0
    high(:) = 0
    ! a little more than reach, so that rounding excludes nobody
    margin = reach*(1.0_dp + 1.0e-9_dp) + 1.0e-12_dp*maxval(abs(point))
    if (allocated(self%subdomain_of_cell)) then
      corner(:) = point - margin
      call self%cells%locate(corner, low)
      corner(:) = point + margin
      call self%cells%locate(corner, high)
    else
      do d = 1, self%nd
        low(d) = box_along(self, d, point(d) - margin)
        high(d) = box_along(self, d, point(d) + margin)
      end do
    end if
    n = 0
    do z = low(3), high(3)
      do y = low(2), high(2)
        do x = low(1), high(1)
          place(1) = x
          place(2) = y
          place(3) = z
          if (allocated(self%subdomain_of_cell)) then
            call add_once(list, n, self%subdomain_of_cell(self%cells%flat(place)))
          else
            call add_once(list, n, 1 + x + self%boxes(1)*(y + self%boxes(2)*z))
          end if
        end do
      end do
    end do
  end subroutine partition_near

  !> Add `value` to the first `n` of `list` unless it is there.
  pure subroutine add_once(list, n, value)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(inout) :: n
    integer, intent(in) :: value
    integer, allocatable :: longer(:)

    if (any(list(1:n) == value)) return
    if (n == size(list)) then
      allocate (longer(2*n + 8))
      longer(1:n) = list(1:n)
      call move_alloc(longer, list)
    end if
    n = n + 1
    list(n) = value
  end subroutine add_once

end module gravier_partition
