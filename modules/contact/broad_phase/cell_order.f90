!> Points in the order of cells, in which contacts are swept.
module gravier_cell_order
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort, argsort_rows, is_before
  use gravier_cell_hash, only: last_cell
  implicit none
  private
  public :: sweep_order, place_of

contains

  !> Order of points along rows of cells, the last axis slowest, then by identifier. Cells are counted from a given corner, so that
  !> two points keep their order whatever other points there are.
  subroutine sweep_order(points, corner, edge, id, order)
    !> (nd, n) [m]
    real(dp), intent(in), contiguous :: points(:, :)
    !> of a cell (nd) [m]
    real(dp), intent(in) :: corner(:)
    !> of the cells [m]
    real(dp), intent(in) :: edge
    !> (identifiers of a point, n)
    integer(i8), intent(in), contiguous :: id(:, :)
    !> (n) permutation to apply
    integer, intent(out), contiguous :: order(:)
    integer(i8), allocatable :: keys(:)
    integer, allocatable :: place(:, :)
    real(dp) :: before(size(points, 1)), way(size(points, 1))
    integer(i8) :: low(3), cells(3)
    integer :: k, first

    allocate (keys(size(points, 2)), place(3, size(points, 2)))
    ! half of the cells lie before the corner
    before(:) = -0.5_dp*(real(last_cell, dp) + 1.0_dp)*edge
    low(:) = last_cell
    cells(:) = 0
    do k = 1, size(points, 2)
      way(:) = points(:, k) - corner
      place(:, k) = place_of(way, before, edge)
      low(:) = min(low, int(place(:, k), i8))
      cells(:) = max(cells, int(place(:, k), i8) + 1)
    end do
    cells(:) = cells - low
    do k = 1, size(points, 2)
      keys(k) = place(1, k) - low(1) + cells(1)*(place(2, k) - low(2) + cells(2)*(place(3, k) - low(3)))
    end do
    call argsort(keys, order)
    first = 1
    do k = 2, size(order) + 1
      if (k <= size(order)) then
        if (keys(order(k)) == keys(order(first))) cycle
      end if
      call sort_by_id(id, order(first:k - 1))
      first = k
    end do
  end subroutine sweep_order

  !> Sort the points of a cell by their identifiers: there are few of them.
  subroutine sort_by_id(id, order)
    integer(i8), intent(in), contiguous :: id(:, :)
    integer, intent(inout), contiguous :: order(:)
    !> points that are sorted one by one
    integer, parameter :: few = 32
    integer(i8), allocatable :: own(:, :)
    integer, allocatable :: place(:), sorted(:)
    integer :: k, j, this

    if (size(order) > few) then
      allocate (own(size(id, 1), size(order)), place(size(order)))
      do k = 1, size(order)
        own(:, k) = id(:, order(k))
      end do
      call argsort_rows(own, place)
      sorted = order
      do k = 1, size(order)
        order(k) = sorted(place(k))
      end do
      return
    end if
    do k = 2, size(order)
      this = order(k)
      j = k
      do while (j > 1)
        if (.not. is_before(id(:, this), id(:, order(j - 1)))) exit
        order(j) = order(j - 1)
        j = j - 1
      end do
      order(j) = this
    end do
  end subroutine sort_by_id

  !> Cell of a point along each axis, from 0 at `lower`. Far out the numbers begin again, so that cells stay small wherever
  !> a grain has flown: what shares a number with cells far away is told from them by its distance.
  pure function place_of(point, lower, edge) result(place)
    real(dp), intent(in) :: point(:), lower(:), edge
    integer :: place(3), d
    !> a number that i8 can hold
    real(dp), parameter :: farthest = 2.0_dp**62
    integer(i8) :: cell

    place(:) = 0
    do d = 1, size(point)
      cell = int(min(max((point(d) - lower(d))/edge, 0.0_dp), farthest), i8)
      place(d) = narrow(iand(cell, int(last_cell, i8)))
    end do
  end function place_of

end module gravier_cell_order
