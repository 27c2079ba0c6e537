!> Partitions of space into subdomains: a grid of equal boxes (paper, (3)-(4)), or cells distributed by a graph partition.
module gravier_partition
  use gravier_kinds, only: dp, i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_region, only: region_t
  use gravier_box_counts, only: check_subdomains, refuse_too_many
  use gravier_cell_map, only: cell_map_t
  use gravier_cell_groups, only: cell_groups_t
  use gravier_cell_cut, only: cut_group
  use gravier_cell_levels, only: make_groups, cut_groups, cells_per_subdomain
  implicit none
  private
  public :: partition_t, add_once, is_sound_head, head_words, head_record

  !> kinds of a partition: boxes; cells with one map that every rank has; cells with a map for each group
  integer, parameter :: kind_boxes = 0, kind_cells = 1, kind_groups = 2
  !> words of a head before those of the groups
  integer, parameter :: head_words = 30
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: head_record = "kind dimensions subdomains cell_limit boxes cells split lower upper period "// &
    & "origin unit scale groups, firsts of groups, groups and pieces of cells"

  !> Points outside the box of the partition belong to the nearest subdomain of its border, but along periodic axes to that
  !> of their image inside.
  type, extends(region_t) :: partition_t
    integer :: nd = 2
    integer :: n_subdomains = 1
    !> the box that is divided, see `set_box` [m]
    real(dp) :: lower(3) = 0.0_dp, upper(3) = 1.0_dp
    !> set by the caller before init: period along each axis, 0 where there is none [m]; along a periodic axis the box is
    !> [lower, lower + period)
    real(dp) :: period(3) = 0.0_dp
    !> set by the caller before init_graph where another bound is wanted: cells of one graph, so that what a rank holds of
    !> them stays bounded whatever the scene
    integer(i8) :: cell_limit = 262144_i8
    !> grid: boxes along each axis
    integer :: boxes(3) = 1
    !> boxes or cells
    type(cell_map_t) :: cells
    !> the subdomains of the cells of a graph
    type(cell_groups_t) :: groups
    !> one of the kind_ constants
    integer, private :: kind = kind_boxes
  contains
    procedure :: owner => partition_owner
    procedure :: relay => partition_relay
    procedure :: near => partition_near
    procedure :: n_cells => partition_n_cells
    procedure :: set_box => partition_set_box
    procedure :: init_grid => partition_init_grid
    procedure :: init_graph => partition_init_graph
    procedure :: get_head => partition_get_head
    procedure :: get_map => partition_get_map
    procedure :: restore => partition_restore
  end type partition_t

contains

  !> Set the box that is to be divided, the bounding box of the scene: before `init_grid` or `init_graph`.
  pure subroutine partition_set_box(self, lower, upper)
    class(partition_t), intent(inout) :: self
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)

    self%nd = size(lower)
    self%lower(:) = 0.0_dp
    self%upper(:) = 1.0_dp
    self%lower(1:self%nd) = lower
    self%upper(1:self%nd) = upper
  end subroutine partition_set_box

  !> Equal boxes over the box that was set.
  subroutine partition_init_grid(self, boxes, edge, error)
    class(partition_t), intent(inout) :: self
    integer, intent(in) :: boxes(3)
    !> edge of a detection cell [m]: no more boxes than cells
    real(dp), intent(in) :: edge
    type(error_t), allocatable, intent(inout) :: error
    type(cell_groups_t) :: none

    self%kind = kind_boxes
    self%groups = none
    self%boxes(:) = boxes
    self%n_subdomains = int(min(product(real(boxes, dp)), real(huge(1), dp)), i4)
    associate (lower => self%lower(1:self%nd), upper => self%upper(1:self%nd))
      call self%cells%set_boxes(lower, upper, self%period(1:self%nd), boxes)
      call check_subdomains(lower, upper, edge, self%n_subdomains, error)
    end associate
  end subroutine partition_init_grid

  !> Cells of the box that was set, distributed so that each subdomain holds about as much weight and few neighbours are cut. Each
  !> rank gives points of its own. The graph that a rank cuts and what it keeps of the cells are bounded: where one graph of
  !> cell_limit cells gives each subdomain too few, its cells make groups of subdomains, and the group of a cell is cut by itself,
  !> more finely. Errors are the same on all ranks, and so is the partition on any number of ranks. Collective.
  subroutine partition_init_graph(self, comm, edge, points, weights, n_subdomains, error)
    class(partition_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> smallest edge of a cell [m]
    real(dp), intent(in) :: edge
    !> (nd, points of this rank) [m]
    real(dp), intent(in), contiguous :: points(:, :)
    !> (points of this rank): 0 and more
    integer, intent(in), contiguous :: weights(:)
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: weight(:)
    integer(i8) :: occupied
    real(dp) :: cell_edge
    integer :: k, cell, place(3)

    self%n_subdomains = n_subdomains
    cell_edge = edge
    call self%cells%set_cells(self%lower(1:self%nd), self%upper(1:self%nd), self%period(1:self%nd), cell_edge, self%cell_limit)
    allocate (weight(self%cells%cells()), source=0_i8)
    do k = 1, size(weights)
      call self%cells%locate(points(:, k), place)
      cell = self%cells%cell_at(place)
      weight(cell) = weight(cell) + weights(k)
    end do
    call comm%sum_counts(weight)
    occupied = count(weight > 0)
    if (cells_per_subdomain*n_subdomains <= self%cell_limit) then
      self%kind = kind_cells
      call refuse_too_many(n_subdomains, occupied, error)
      if (.not. allocated(error)) call cut_once(self, weight, error)
      call comm%agree(error)
    else
      self%kind = kind_groups
      ! as many pieces along the edge of a cell as leave them no smaller than asked for
      call self%cells%set_split(int(min(cell_edge/edge, real(huge(1), dp)), i4))
      call make_groups(self%groups, self%cells, weight, n_subdomains, self%cell_limit, error)
      call comm%agree(error)
      if (allocated(error)) return
      call cut_groups(self%groups, comm, points, weights, n_subdomains, occupied, error)
      call refuse_too_many(n_subdomains, occupied, error)
      call comm%agree(error)
      self%cells = self%groups%cells
    end if
  end subroutine partition_init_graph

  !> One graph, that every rank cuts by itself.
  subroutine cut_once(self, weight, error)
    class(partition_t), intent(inout) :: self
    !> (cells)
    integer(i8), intent(in), contiguous :: weight(:)
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: owner(:)

    call set_one_group(self)
    allocate (owner(size(weight)))
    call cut_group(self%groups, 1, weight, self%n_subdomains, owner, error)
    call move_alloc(owner, self%groups%maps(1)%subdomain)
  end subroutine cut_once

  subroutine set_one_group(self)
    class(partition_t), intent(inout) :: self
    integer, allocatable :: group_of_cell(:)
    logical, allocatable :: in_pieces(:)
    integer :: counts(1)

    allocate (group_of_cell(self%cells%cells()), source=1)
    allocate (in_pieces(self%cells%cells()), source=.true.)
    call self%groups%set(self%cells, 1, group_of_cell, in_pieces)
    counts(1) = self%n_subdomains
    call self%groups%set_first(counts)
    call self%groups%hold(1)
  end subroutine set_one_group

  !> Subdomain that holds a point; 0 where this rank does not know it: far from its own subdomains, see `relay`.
  pure integer function partition_owner(self, point) result(subdomain)
    class(partition_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    integer :: place(3)

    subdomain = 1
    if (self%n_subdomains == 1) return
    call self%cells%locate(point, place)
    subdomain = subdomain_at(self, place)
  end function partition_owner

  pure integer function subdomain_at(self, place) result(subdomain)
    class(partition_t), intent(in) :: self
    integer, intent(in) :: place(3)

    if (self%kind == kind_boxes) then
      subdomain = self%cells%cell_at(place)
    else
      subdomain = self%groups%subdomain_at(place)
    end if
  end function subdomain_at

  !> A subdomain on whose rank the owner of a point is known, whichever rank asks.
  pure integer function partition_relay(self, point) result(subdomain)
    class(partition_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    integer :: place(3)

    call self%cells%locate(point, place)
    if (self%kind == kind_groups) then
      subdomain = self%groups%first(self%groups%group_of_cell(self%cells%cell_at(place)))
    else
      subdomain = subdomain_at(self, place)
    end if
  end function partition_relay

  !> Subdomains that may hold a point within `reach` of any image of `point`, each once. Around points of the subdomains of
  !> this rank all are known as long as `reach` is no longer than the edge given to init_graph; elsewhere 0 stands for those
  !> that are not.
  pure subroutine partition_near(self, point, reach, list, n)
    class(partition_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in), contiguous :: point(:)
    real(dp), intent(in) :: reach
    !> the first n are set; grown where needed
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(out) :: n
    integer :: low(3), high(3), sides(3), x, y, z, place(3)

    n = 0
    if (self%n_subdomains == 1) then
      call add_once(list, n, 1)
      return
    end if
    call self%cells%range(point, reach, low, high)
    sides(:) = 1
    sides(1:self%nd) = self%cells%n(1:self%nd)*self%cells%split
    do z = low(3), high(3)
      place(3) = modulo(z, sides(3))
      do y = low(2), high(2)
        place(2) = modulo(y, sides(2))
        do x = low(1), high(1)
          place(1) = modulo(x, sides(1))
          call add_once(list, n, subdomain_at(self, place))
        end do
      end do
    end do
  end subroutine partition_near

  !> Cells that a graph partition shares out, over all groups; 0 for boxes.
  pure integer(i8) function partition_n_cells(self) result(n)
    class(partition_t), intent(in) :: self
    n = 0
    if (self%kind /= kind_boxes) n = sum(self%groups%length)
  end function partition_n_cells

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

  !> The partition in words but for the maps of its cells; the same on every rank.
  pure subroutine partition_get_head(self, words)
    class(partition_t), intent(in) :: self
    integer(i8), allocatable, intent(out) :: words(:)
    real(dp) :: reals(18)
    integer :: n, k, cell

    n = 0
    if (self%kind == kind_groups) n = self%groups%n + 1 + size(self%groups%group_of_cell)
    allocate (words(head_words + n), source=0_i8)
    words(1) = self%kind
    words(2) = self%nd
    words(3) = self%n_subdomains
    words(4) = self%cell_limit
    words(5:7) = self%boxes
    words(8:10) = self%cells%n
    words(11) = self%cells%split
    reals(1:3) = self%lower
    reals(4:6) = self%upper
    reals(7:9) = self%period
    reals(10:12) = self%cells%origin
    reals(13:15) = self%cells%unit
    reals(16:18) = self%cells%scale
    do k = 1, size(reals)
      words(11 + k) = transfer(reals(k), 1_i8)
    end do
    if (self%kind /= kind_groups) return
    n = self%groups%n
    words(head_words) = n
    words(head_words + 1:head_words + n + 1) = self%groups%first
    do cell = 1, size(self%groups%group_of_cell)
      words(head_words + n + 1 + cell) = 2_i8*self%groups%group_of_cell(cell) + merge(1, 0, self%groups%in_pieces(cell))
    end do
  end subroutine partition_get_head

  !> The words to be stored with a subdomain of this rank: the map of its group with the first one of each, none with the
  !> others.
  pure subroutine partition_get_map(self, subdomain, words)
    class(partition_t), intent(in) :: self
    integer, intent(in) :: subdomain
    integer(i8), allocatable, intent(out) :: words(:)
    integer :: g

    if (self%kind /= kind_boxes) then
      g = self%groups%group_of(subdomain)
      if (self%groups%first(g) == subdomain) then
        allocate (words(self%groups%length(g)))
        words(:) = self%groups%maps(self%groups%known(g))%subdomain
        return
      end if
    end if
    allocate (words(0))
  end subroutine partition_get_map

  !> The partition that get_head and get_map gave words of, on any number of ranks. Collective.
  subroutine partition_restore(self, comm, head, words, counts)
    class(partition_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> the same on every rank
    integer(i8), intent(in), contiguous :: head(:)
    !> of the subdomains of this rank, one after the other, and how many each has
    integer(i8), intent(in), contiguous :: words(:)
    integer, intent(in), contiguous :: counts(:)
    type(cell_groups_t) :: none

    call read_head(self, head)
    self%groups = none
    if (self%kind == kind_cells) then
      call set_one_group(self)
      call restore_one_map(self, comm, words)
    else if (self%kind == kind_groups) then
      call restore_maps(self, comm, head, words, counts)
    end if
  end subroutine partition_restore

  !> Whether words of a file may be the head of a partition of so many dimensions and subdomains.
  pure logical function is_sound_head(words, nd, n_subdomains) result(sound)
    integer(i8), intent(in), contiguous :: words(:)
    integer, intent(in) :: nd, n_subdomains
    real(dp) :: cells
    integer :: k

    sound = size(words) >= head_words
    if (.not. sound) return
    cells = product(real(words(8:10), dp))
    sound = words(2) == nd .and. words(3) == n_subdomains .and. words(4) > 0 .and. words(head_words) >= 0
    select case (words(1))
    case (kind_boxes)
      ! a cell is a box
      sound = sound .and. all(words(8:10) == words(5:7)) .and. abs(cells - n_subdomains) < 0.5_dp .and. &
        & size(words) == head_words
    case (kind_cells)
      sound = sound .and. cells <= real(words(4), dp) .and. size(words) == head_words
    case (kind_groups)
      sound = sound .and. size(words) == head_words + words(head_words) + 1 + nint(min(cells, real(huge(nd), dp)), i8)
    case default
      sound = .false.
    end select
    sound = sound .and. all(words(5:11) >= 1 .and. words(5:11) <= huge(nd))
    do k = 12, head_words - 1
      ! NaN is not
      sound = sound .and. abs(transfer(words(k), 1.0_dp)) <= huge(1.0_dp)
    end do
  end function is_sound_head

  subroutine read_head(self, head)
    class(partition_t), intent(inout) :: self
    integer(i8), intent(in), contiguous :: head(:)
    real(dp) :: reals(18)
    integer :: k

    self%kind = narrow(head(1))
    self%nd = narrow(head(2))
    self%n_subdomains = narrow(head(3))
    self%cell_limit = head(4)
    self%boxes(:) = narrow(head(5:7))
    self%cells%nd = self%nd
    self%cells%n(:) = narrow(head(8:10))
    self%cells%split = narrow(head(11))
    do k = 1, size(reals)
      reals(k) = transfer(head(11 + k), 1.0_dp)
    end do
    self%lower(:) = reals(1:3)
    self%upper(:) = reals(4:6)
    self%period(:) = reals(7:9)
    self%cells%origin(:) = reals(10:12)
    self%cells%unit(:) = reals(13:15)
    self%cells%scale(:) = reals(16:18)
    self%cells%period(:) = 0.0_dp
    self%cells%period(1:self%nd) = self%period(1:self%nd)
  end subroutine read_head

  !> Give every rank the map that was stored with subdomain 1.
  subroutine restore_one_map(self, comm, words)
    class(partition_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in), contiguous :: words(:)
    integer(i8), allocatable :: map(:)

    allocate (map(self%groups%length(1)), source=0_i8)
    if (comm%rank_of(1, self%n_subdomains) == comm%rank) map(:) = words(1:size(map))
    call comm%sum_counts(map)
    self%groups%maps(1)%subdomain(:) = narrow(map)
  end subroutine restore_one_map

  !> Take the maps stored with the subdomains of this rank, and share them.
  subroutine restore_maps(self, comm, head, words, counts)
    class(partition_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in), contiguous :: head(:), words(:)
    integer, intent(in), contiguous :: counts(:)
    integer, allocatable :: group_of_cell(:), holder(:)
    logical, allocatable :: in_pieces(:)
    integer :: n, cell, g, s, next

    n = narrow(head(head_words))
    allocate (group_of_cell(self%cells%cells()), in_pieces(self%cells%cells()), holder(n))
    do cell = 1, size(group_of_cell)
      group_of_cell(cell) = narrow(head(head_words + n + 1 + cell)/2)
      in_pieces(cell) = mod(head(head_words + n + 1 + cell), 2_i8) == 1
    end do
    call self%groups%set(self%cells, n, group_of_cell, in_pieces)
    self%groups%first(:) = narrow(head(head_words + 1:head_words + n + 1))
    do g = 1, n
      holder(g) = comm%rank_of(self%groups%first(g), self%n_subdomains)
    end do
    next = 0
    do s = 1, size(counts)
      if (counts(s) == 0) cycle
      g = self%groups%group_of(comm%first_subdomain(comm%rank, self%n_subdomains) + s - 1)
      call self%groups%hold(g)
      self%groups%maps(self%groups%known(g))%subdomain(:) = narrow(words(next + 1:next + counts(s)))
      next = next + counts(s)
    end do
    call self%groups%share(comm, holder)
  end subroutine restore_maps

end module gravier_partition
