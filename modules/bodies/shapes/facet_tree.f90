!> A tree of boxes around facets, by which those near a point are found without a look at all.
module gravier_facet_tree
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  implicit none
  private
  public :: facet_tree_t, box_distance

  !> part of a facet by which it is taken to be larger, so that no line passes between two that share an edge
  real(dp), parameter :: seam = 1.0e-9_dp

  !> facets of a leaf, at most
  integer, parameter :: of_leaf = 4
  !> more levels than the tree of any number of facets has
  integer, parameter :: most_levels = 64

  !> Each node holds the facets order(first:last). Those of a leaf are looked at one by one; the two halves of another node stand at
  !> `half` and behind it.
  type :: facet_tree_t
    private
    integer :: n_nodes = 0
    integer, allocatable :: order(:)
    integer, allocatable :: first(:), last(:), half(:)
    !> (3, nodes) [m]
    real(dp), allocatable :: low(:, :), high(:, :)
  contains
    procedure :: build => facet_tree_build
    procedure :: find => facet_tree_find
    procedure :: parts => facet_tree_parts
  end type facet_tree_t

contains

  !> Sort facets into the tree: nodes are halved at the median of the middles of their facets along the longest side of their box.
  subroutine facet_tree_build(self, corner)
    class(facet_tree_t), intent(out) :: self
    !> (3, corners of a facet, facets) [m]
    real(dp), intent(in), contiguous :: corner(:, :, :)
    real(dp), allocatable :: middle(:, :)
    integer :: n, k, node, axis, split

    n = size(corner, 3)
    allocate (self%order(n), middle(n, 3))
    do k = 1, n
      self%order(k) = k
      do axis = 1, 3
        middle(k, axis) = 0.5_dp*(minval(corner(axis, :, k)) + maxval(corner(axis, :, k)))
      end do
    end do
    allocate (self%first(2*n), self%last(2*n), self%half(2*n), source=0)
    allocate (self%low(3, 2*n), self%high(3, 2*n))
    self%n_nodes = 1
    self%first(1) = 1
    self%last(1) = n
    node = 0
    ! nodes behind this one are those that it and its like are halved into
    do while (node < self%n_nodes)
      node = node + 1
      call enclose(self, node, corner)
      if (self%last(node) - self%first(node) < of_leaf) cycle
      axis = maxloc(self%high(:, node) - self%low(:, node), dim=1)
      split = (self%first(node) + self%last(node))/2
      call put_median(self%order(self%first(node):self%last(node)), middle(:, axis), split - self%first(node) + 1)
      self%half(node) = self%n_nodes + 1
      self%first(self%n_nodes + 1) = self%first(node)
      self%last(self%n_nodes + 1) = split
      self%first(self%n_nodes + 2) = split + 1
      self%last(self%n_nodes + 2) = self%last(node)
      self%n_nodes = self%n_nodes + 2
    end do
  end subroutine facet_tree_build

  !> The box of a node.
  pure subroutine enclose(self, node, corner)
    class(facet_tree_t), intent(inout) :: self
    integer, intent(in) :: node
    real(dp), intent(in), contiguous :: corner(:, :, :)
    integer :: k, c

    self%low(:, node) = huge(1.0_dp)
    self%high(:, node) = -huge(1.0_dp)
    do k = self%first(node), self%last(node)
      do c = 1, size(corner, 2)
        self%low(:, node) = min(self%low(:, node), corner(:, c, self%order(k)))
        self%high(:, node) = max(self%high(:, node), corner(:, c, self%order(k)))
      end do
    end do
  end subroutine enclose

  !> Put a list into such an order that the value at `place` is no less than those before it and no more than those behind it
  !> (Hoare's selection; of equal values the number decides, so that the order is one).
  pure subroutine put_median(list, value, place)
    integer, intent(inout), contiguous :: list(:)
    !> by the numbers of the list
    real(dp), intent(in), contiguous :: value(:)
    integer, intent(in) :: place
    integer :: low, high, i, j, pivot, kept

    low = 1
    high = size(list)
    do while (low < high)
      pivot = list((low + high)/2)
      i = low
      j = high
      do while (i <= j)
        do while (is_before(list(i), pivot))
          i = i + 1
        end do
        do while (is_before(pivot, list(j)))
          j = j - 1
        end do
        if (i > j) exit
        kept = list(i)
        list(i) = list(j)
        list(j) = kept
        i = i + 1
        j = j - 1
      end do
      if (place <= j) then
        high = j
      else if (place >= i) then
        low = i
      else
        exit
      end if
    end do

  contains

    pure logical function is_before(a, b)
      integer, intent(in) :: a, b

      is_before = value(a) < value(b)
      if (.not. is_before .and. .not. value(b) < value(a)) is_before = a < b
    end function is_before

  end subroutine put_median

  !> Numbers of the facets whose leaves are within `reach` of a point: all that are as near, and some that are not.
  pure subroutine facet_tree_find(self, point, reach, n, found)
    class(facet_tree_t), intent(in) :: self
    real(dp), intent(in) :: point(3)
    !> [m]
    real(dp), intent(in) :: reach
    integer, intent(out) :: n
    !> with room for n or more
    integer, allocatable, intent(inout) :: found(:)
    integer :: stack(most_levels), top, node, k

    n = 0
    if (.not. allocated(found)) allocate (found(64))
    if (self%n_nodes == 0) return
    top = 1
    stack(1) = 1
    do while (top > 0)
      node = stack(top)
      top = top - 1
      if (box_distance(self%low(:, node), self%high(:, node), point) > reach) cycle
      if (self%half(node) > 0) then
        stack(top + 1) = self%half(node) + 1
        stack(top + 2) = self%half(node)
        top = top + 2
        cycle
      end if
      do k = self%first(node), self%last(node)
        if (n == size(found)) call lengthen(found)
        n = n + 1
        found(n) = self%order(k)
      end do
    end do
  end subroutine facet_tree_find

  !> Whether a facet lies between two points: the line from one to the other goes through it.
  pure logical function facet_tree_parts(self, corner, from, to) result(parts)
    class(facet_tree_t), intent(in) :: self
    !> (3, corners of a facet, facets), those that the tree was built of [m]
    real(dp), intent(in), contiguous :: corner(:, :, :)
    real(dp), intent(in) :: from(3), to(3)
    real(dp) :: low(3), high(3)
    integer :: stack(most_levels), top, node, k

    parts = .false.
    if (self%n_nodes == 0) return
    low(:) = min(from, to)
    high(:) = max(from, to)
    top = 1
    stack(1) = 1
    do while (top > 0)
      node = stack(top)
      top = top - 1
      if (any(self%low(:, node) > high) .or. any(self%high(:, node) < low)) cycle
      if (self%half(node) > 0) then
        stack(top + 1) = self%half(node) + 1
        stack(top + 2) = self%half(node)
        top = top + 2
        cycle
      end if
      do k = self%first(node), self%last(node)
        parts = goes_through(corner(:, :, self%order(k)), from, to)
        if (parts) return
      end do
    end do
  end function facet_tree_parts

  !> Whether a line goes through a triangle, or in the plane through a segment.
  pure logical function goes_through(corner, from, to) result(through)
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp), intent(in) :: from(3), to(3)
    real(dp), dimension(3) :: normal, edge, other, foot, turned
    real(dp) :: before, behind
    integer :: c

    edge(:) = corner(:, 2) - corner(:, 1)
    if (size(corner, 2) == 2) then
      normal(1) = -edge(2)
      normal(2) = edge(1)
      normal(3) = 0.0_dp
    else
      other(:) = corner(:, 3) - corner(:, 1)
      normal(:) = cross(edge, other)
    end if
    before = dot_product(normal, from - corner(:, 1))
    behind = dot_product(normal, to - corner(:, 1))
    through = (before > 0.0_dp) .neqv. (behind > 0.0_dp)
    if (.not. through) return
    foot(:) = from + before/(before - behind)*(to - from)
    if (size(corner, 2) == 2) then
      through = abs(dot_product(edge, foot - corner(:, 1))/dot_product(edge, edge) - 0.5_dp) <= 0.5_dp + seam
      return
    end if
    do c = 1, 3
      edge(:) = corner(:, mod(c, 3) + 1) - corner(:, c)
      other(:) = foot - corner(:, c)
      turned(:) = cross(edge, other)
      through = dot_product(normal, turned) >= -seam*dot_product(normal, normal)
      if (.not. through) return
    end do
  end function goes_through

  pure subroutine lengthen(list)
    integer, allocatable, intent(inout) :: list(:)
    integer, allocatable :: longer(:)

    allocate (longer(2*size(list)))
    longer(1:size(list)) = list
    call move_alloc(longer, list)
  end subroutine lengthen

  !> Distance of a point from a box, 0 within it [m].
  pure real(dp) function box_distance(low, high, point) result(distance)
    real(dp), intent(in) :: low(3), high(3), point(3)
    real(dp) :: way(3)

    way(:) = max(low - point, point - high, 0.0_dp)
    distance = norm2(way)
  end function box_distance

end module gravier_facet_tree
