!> A grid of equal cells over a box; points outside belong to the nearest cell of the border.
module gravier_cell_grid
  use gravier_kinds, only: dp, i4, i8
  implicit none
  private
  public :: cell_grid_t, count_along

  type :: cell_grid_t
    !> space dimension
    integer :: nd = 0
    !> cells along each axis; 1 beyond nd
    integer :: n(3) = 1
    !> lower corner [m]
    real(dp) :: origin(3) = 0.0_dp
    !> edge of a cell [m]
    real(dp) :: edge = 1.0_dp
  contains
    procedure :: init => cell_grid_init
    procedure :: locate => cell_grid_locate
    procedure :: cells => cell_grid_cells
    procedure :: flat => cell_grid_flat
  end type cell_grid_t

contains

  !> Cover the box [lower, upper] by cells of edge `edge` or larger, by doubling, so that there are at most
  !> `limit` cells (at least 1 along each axis), and fewer than huge(1) whatever the limit.
  pure subroutine cell_grid_init(self, lower, upper, edge, limit)
    class(cell_grid_t), intent(inout) :: self
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    !> smallest edge allowed [m]
    real(dp), intent(in) :: edge
    integer(i8), intent(in) :: limit
    real(dp) :: counts(3), most
    integer :: d

    self%nd = size(lower)
    self%n(:) = 1
    self%origin(:) = 0.0_dp
    self%origin(1:self%nd) = lower
    ! an edge of 0 could be doubled for ever
    self%edge = merge(edge, tiny(1.0_dp), abs(edge) > 0.0_dp)
    most = real(min(max(limit, 1_i8), huge(0_i4) - 1_i8), dp)
    do
      counts(:) = 1.0_dp
      if (self%edge > 0.25_dp*huge(1.0_dp)) exit
      do d = 1, self%nd
        counts(d) = count_along(lower(d), upper(d), self%edge)
      end do
      if (product(counts) <= most) exit
      self%edge = 2.0_dp*self%edge
    end do
    self%n(:) = nint(counts)
  end subroutine cell_grid_init

  !> Cells of edge `edge` along an axis from `lower` to `upper`, at most huge(1): extents whose difference or whose quotient
  !> has no number are cut off before.
  pure real(dp) function count_along(lower, upper, edge) result(cells)
    !> [m]
    real(dp), intent(in) :: lower, upper, edge
    real(dp) :: half

    half = 0.5_dp*upper - 0.5_dp*lower
    if (edge > 0.0_dp .and. half/real(huge(0_i4) - 1, dp) > 0.5_dp*edge) then
      cells = real(huge(0_i4), dp)
    else
      cells = aint(2.0_dp*(half/edge)) + 1.0_dp
    end if
  end function count_along

  !> Place of a point along each axis, from 0.
  pure subroutine cell_grid_locate(self, point, place)
    class(cell_grid_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: point(:)
    integer, intent(out) :: place(3)
    integer :: d
    real(dp) :: x

    place(:) = 0
    do d = 1, self%nd
      x = (point(d) - self%origin(d))/self%edge
      place(d) = int(min(max(x, 0.0_dp), real(self%n(d) - 1, dp)), i4)
    end do
  end subroutine cell_grid_locate

  !> Number of the cell at `place`, from 1; the last axis varies slowest, so that rows are stacked upwards.
  pure integer function cell_grid_flat(self, place) result(cell)
    class(cell_grid_t), intent(in) :: self
    integer, intent(in) :: place(3)
    cell = 1 + place(1) + self%n(1)*(place(2) + self%n(2)*place(3))
  end function cell_grid_flat

  !> Number of cells.
  pure integer function cell_grid_cells(self) result(cells)
    class(cell_grid_t), intent(in) :: self
    cells = product(self%n)
  end function cell_grid_cells

end module gravier_cell_grid
