!> Equal cells over the box of a partition, on axes that may be periodic; each cell may be split into equal pieces.
module gravier_cell_map
  use gravier_kinds, only: dp, i4, i8
  use gravier_periodic, only: wrap
  use gravier_cell_grid, only: cell_grid_t
  implicit none
  private
  public :: cell_map_t

  !> A place counts pieces along each axis, from 0. Points outside the box belong to the nearest piece of the border along
  !> axes that are not periodic, and to that of their image inside along those that are.
  type :: cell_map_t
    integer :: nd = 2
    !> cells along each axis; 1 beyond nd
    integer :: n(3) = 1
    !> pieces of a cell along each axis
    integer :: split = 1
    !> lower corner; period, 0 along axes that have none [m]
    real(dp) :: origin(3) = 0.0_dp, period(3) = 0.0_dp
    !> `scale` cells are `unit` long [m]
    real(dp) :: unit(3) = 1.0_dp, scale(3) = 1.0_dp
  contains
    procedure :: set_boxes => cell_map_set_boxes
    procedure :: set_cells => cell_map_set_cells
    procedure :: set_split => cell_map_set_split
    procedure :: cells => cell_map_cells
    procedure :: pieces => cell_map_pieces
    procedure :: locate => cell_map_locate
    procedure :: range => cell_map_range
    procedure :: cell_at => cell_map_cell_at
    procedure :: piece_at => cell_map_piece_at
    procedure :: place_of => cell_map_place_of
    procedure :: around => cell_map_around
  end type cell_map_t

  !> pieces along an axis, so that those a few boxes away can be counted too
  integer, parameter :: most_places = 2**29

contains

  !> So many boxes along each axis.
  pure subroutine cell_map_set_boxes(self, lower, upper, period, boxes)
    class(cell_map_t), intent(inout) :: self
    !> (nd) [m]; along a periodic axis the box is one period long
    real(dp), intent(in) :: lower(:), upper(:), period(:)
    integer, intent(in) :: boxes(3)

    call set_origin(self, lower, period)
    self%n(:) = boxes
    self%unit(1:self%nd) = merge(period, upper - lower, period > 0.0_dp)
    self%scale(:) = real(boxes, dp)
  end subroutine cell_map_set_boxes

  !> Cells of edge `edge` or larger, at most `limit`. Along a periodic axis a whole number of cells fills the period.
  pure subroutine cell_map_set_cells(self, lower, upper, period, edge, limit)
    class(cell_map_t), intent(inout) :: self
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:), period(:)
    !> the smallest edge allowed before, the edge of the cells after [m]
    real(dp), intent(inout) :: edge
    integer(i8), intent(in) :: limit
    type(cell_grid_t) :: grid
    integer :: d

    call set_origin(self, lower, period)
    call grid%init(lower, upper, edge, limit)
    edge = grid%edge
    self%n(:) = grid%n
    self%unit(1:self%nd) = edge
    do d = 1, self%nd
      if (.not. period(d) > 0.0_dp) cycle
      self%n(d) = max(1, int(min(period(d)/edge, real(grid%n(d), dp)), i4))
      self%unit(d) = period(d)
      self%scale(d) = real(self%n(d), dp)
    end do
  end subroutine cell_map_set_cells

  pure subroutine set_origin(self, lower, period)
    class(cell_map_t), intent(inout) :: self
    real(dp), intent(in) :: lower(:), period(:)

    self%nd = size(lower)
    self%split = 1
    self%origin(:) = 0.0_dp
    self%period(:) = 0.0_dp
    self%unit(:) = 1.0_dp
    self%scale(:) = 1.0_dp
    self%origin(1:self%nd) = lower
    self%period(1:self%nd) = period
  end subroutine set_origin

  !> Split every cell into `split` pieces along each axis, or as many as places can count.
  pure subroutine cell_map_set_split(self, split)
    class(cell_map_t), intent(inout) :: self
    integer, intent(in) :: split
    self%split = max(1, min(split, most_places/maxval(self%n)))
  end subroutine cell_map_set_split

  !> Number of cells.
  pure integer function cell_map_cells(self) result(cells)
    class(cell_map_t), intent(in) :: self
    cells = product(self%n)
  end function cell_map_cells

  !> Pieces of a cell.
  pure integer(i8) function cell_map_pieces(self) result(pieces)
    class(cell_map_t), intent(in) :: self
    pieces = int(self%split, i8)**self%nd
  end function cell_map_pieces

  !> Place of the piece that holds a point.
  pure subroutine cell_map_locate(self, point, place)
    class(cell_map_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: point(:)
    integer, intent(out) :: place(3)
    real(dp) :: x
    integer :: d, turns

    place(:) = 0
    do d = 1, self%nd
      call wrap(point(d), self%origin(d), self%period(d), x, turns)
      place(d) = inner_place(self, d, x)
    end do
  end subroutine cell_map_locate

  !> Place along axis `d` of the coordinate `x`, or the nearest inside. The cell is found first, so that it does not depend
  !> on the pieces.
  pure integer function inner_place(self, d, x) result(place)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: d
    real(dp), intent(in) :: x
    real(dp) :: y
    integer :: cell

    ! by halves: the whole way may have no number
    y = 2.0_dp*((0.5_dp*x - 0.5_dp*self%origin(d))/self%unit(d)*self%scale(d))
    cell = int(min(max(y, 0.0_dp), real(self%n(d) - 1, dp)), i4)
    place = cell
    if (self%split == 1) return
    y = min(max(y - cell, 0.0_dp), 1.0_dp)
    place = cell*self%split + min(int(y*self%split, i4), self%split - 1)
  end function inner_place

  !> Places within `reach` of any image of a point, along each axis. Along periodic axes they may lie outside the box, to
  !> be taken modulo the number of pieces, and none stands twice.
  pure subroutine cell_map_range(self, point, reach, low, high)
    class(cell_map_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: point(:)
    real(dp), intent(in) :: reach
    integer, intent(out) :: low(3), high(3)
    real(dp) :: margin, wide, x
    integer :: d, turns

    low(:) = 0
    high(:) = 0
    ! a little more than reach, so that rounding excludes nobody
    margin = reach*(1.0_dp + 1.0e-9_dp) + 1.0e-12_dp*maxval(abs(point))
    do d = 1, self%nd
      if (.not. self%period(d) > 0.0_dp) then
        low(d) = inner_place(self, d, point(d) - margin)
        high(d) = inner_place(self, d, point(d) + margin)
        cycle
      end if
      wide = margin + 1.0e-12_dp*(abs(self%origin(d)) + self%period(d))
      high(d) = self%n(d)*self%split - 1
      if (wide >= 0.5_dp*self%period(d)) cycle
      call wrap(point(d), self%origin(d), self%period(d), x, turns)
      low(d) = outer_place(self, d, x - wide)
      high(d) = min(outer_place(self, d, x + wide), low(d) + high(d))
    end do
  end subroutine cell_map_range

  !> Place along a periodic axis of a coordinate less than a period outside the box.
  pure integer function outer_place(self, d, x) result(place)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: d
    real(dp), intent(in) :: x
    real(dp) :: y
    integer :: cell

    y = (x - self%origin(d))/self%unit(d)*self%scale(d)
    cell = floor(y)
    place = cell*self%split + min(int((y - cell)*self%split, i4), self%split - 1)
  end function outer_place

  !> Number of the cell that holds the piece at `place`, from 1; the first axis varies fastest.
  pure integer function cell_map_cell_at(self, place) result(cell)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: place(3)
    if (self%split == 1) then
      cell = 1 + place(1) + self%n(1)*(place(2) + self%n(2)*place(3))
    else
      cell = 1 + place(1)/self%split + self%n(1)*(place(2)/self%split + self%n(2)*(place(3)/self%split))
    end if
  end function cell_map_cell_at

  !> Number of the piece at `place` in its cell, from 0.
  pure integer function cell_map_piece_at(self, place) result(piece)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: place(3)
    piece = 0
    if (self%split == 1) return
    piece = mod(place(1), self%split) + self%split*mod(place(2), self%split)
    if (self%nd == 3) piece = piece + self%split**2*mod(place(3), self%split)
  end function cell_map_piece_at

  !> Place of a piece (from 0) of a cell (from 1).
  pure subroutine cell_map_place_of(self, cell, piece, place)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: cell, piece
    integer, intent(out) :: place(3)
    integer :: d, rest_of_cell, rest_of_piece

    rest_of_cell = cell - 1
    rest_of_piece = piece
    place(:) = 0
    do d = 1, self%nd
      place(d) = mod(rest_of_cell, self%n(d))*self%split + mod(rest_of_piece, self%split)
      rest_of_cell = rest_of_cell/self%n(d)
      rest_of_piece = rest_of_piece/self%split
    end do
  end subroutine cell_map_place_of

  !> The places around a place, each once, and along how many axes each lies apart.
  pure subroutine cell_map_around(self, place, list, apart, n)
    class(cell_map_t), intent(in) :: self
    integer, intent(in) :: place(3)
    integer, intent(out) :: list(3, 26), apart(26), n
    integer :: low(3), high(3), sides(3), x, y, z, d, other(3)

    sides(:) = 1
    sides(1:self%nd) = self%n(1:self%nd)*self%split
    do d = 1, 3
      low(d) = max(place(d) - 1, 0)
      high(d) = min(place(d) + 1, sides(d) - 1)
      ! with two places or fewer all of them are between these already
      if (.not. self%period(d) > 0.0_dp .or. sides(d) < 3) cycle
      low(d) = place(d) - 1
      high(d) = place(d) + 1
    end do
    list(:, :) = 0
    apart(:) = 0
    n = 0
    do z = low(3), high(3)
      do y = low(2), high(2)
        do x = low(1), high(1)
          other(1) = modulo(x, sides(1))
          other(2) = modulo(y, sides(2))
          other(3) = modulo(z, sides(3))
          if (all(other == place)) cycle
          n = n + 1
          list(:, n) = other
          apart(n) = count(other /= place)
        end do
      end do
    end do
  end subroutine cell_map_around

end module gravier_cell_map
