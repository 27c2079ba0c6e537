!> Grains placed one in each cell of a lattice, at random within its cell: wide apart, and made without looking at others.
module gravier_lattice_packing
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_placed_grains, only: sample_box_t
  implicit none
  private
  public :: lattice_t, cell_edge

  !> room around a grain of the largest radius, relative to its diameter
  real(dp), parameter :: room = 1.05_dp

  !> Cubic cells (squares in 2D) from the lower corner of a box, filled row by row, the last axis upwards.
  type :: lattice_t
    !> space dimension
    integer :: nd = 0
    !> cells along each axis, those of the last one as many as are needed; 1 beyond nd
    integer(i8) :: cells(3) = 1
    !> lower corner, edge of a cell [m]
    real(dp) :: lower(3) = 0.0_dp, edge = 0.0_dp
  contains
    procedure :: init => lattice_init
    procedure :: height => lattice_height
    procedure :: place => lattice_place
  end type lattice_t

contains

  !> Make cells for `count` grains in a box. Failure (status_input, without the name of a file or key): a box narrower than a
  !> cell, or not high enough.
  pure subroutine lattice_init(self, box, largest, count, error)
    class(lattice_t), intent(inout) :: self
    !> where upper is at or below lower along the last axis, the height is free
    type(sample_box_t), intent(in) :: box
    !> largest radius [m]
    real(dp), intent(in) :: largest
    integer(i8), intent(in) :: count
    type(error_t), allocatable, intent(inout) :: error
    ! a width of whole cells may be a rounding less
    real(dp), parameter :: slack = 1.0_dp + 1e-9_dp
    real(dp) :: width
    integer :: d

    if (allocated(error)) return
    self%nd = box%nd
    self%lower(:) = box%lower
    self%edge = cell_edge(largest)
    self%cells(:) = 1
    do d = 1, box%nd - 1
      width = box%upper(d) - box%lower(d)
      ! no more cells than grains: numbers of cells stay in range
      self%cells(d) = int(min(width/self%edge*slack, real(count, dp)), i8)
      if (width/self%edge*slack < 1.0_dp) then
        call raise(error, status_input, "the box is "//to_text(width)//" m wide along axis "//to_text(d)// &
          & ", but a cell of the lattice is "//to_text(self%edge)//" m wide, 1.05 diameters of the largest grain")
        return
      end if
    end do
    d = box%nd
    self%cells(d) = 1 + (count - 1)/self%cells(1)
    if (d == 3) self%cells(d) = 1 + (self%cells(d) - 1)/self%cells(2)
    width = box%upper(d) - box%lower(d)
    if (width > 0.0_dp .and. self%height() > width*slack) call raise(error, status_input, "the box is "//to_text(width)// &
      & " m high, but a lattice of "//to_text(count)//" grains is "//to_text(self%height())//" m high")
  end subroutine lattice_init

  !> Edge of the cells for grains of radii up to `largest` [m].
  pure real(dp) function cell_edge(largest) result(edge)
    real(dp), intent(in) :: largest
    edge = room*2.0_dp*largest
  end function cell_edge

  !> Height of the lattice above the lower corner of the box [m].
  pure real(dp) function lattice_height(self) result(height)
    class(lattice_t), intent(in) :: self
    height = self%cells(self%nd)*self%edge
  end function lattice_height

  !> Put grains into their cells, that of grain `id` being number `id` from 1: a function of seed, identifier and radius alone.
  pure subroutine lattice_place(self, seed, id, radius, position)
    class(lattice_t), intent(in) :: self
    integer, intent(in) :: seed
    !> (n)
    integer(i8), intent(in), contiguous :: id(:)
    !> (n) [m]
    real(dp), intent(in), contiguous :: radius(:)
    !> centres, (nd, n) [m]
    real(dp), intent(out), contiguous :: position(:, :)
    integer(i8) :: cell
    integer :: k, d

    do k = 1, size(id)
      cell = id(k) - 1
      do d = 1, self%nd
        position(d, k) = self%lower(d) + (mod(cell, self%cells(d)) + 0.5_dp)*self%edge + &
          & (self%edge - 2.0_dp*radius(k))*(hash_uniform(seed, id(k), d) - 0.5_dp)
        cell = cell/self%cells(d)
      end do
    end do
  end subroutine lattice_place

end module gravier_lattice_packing
