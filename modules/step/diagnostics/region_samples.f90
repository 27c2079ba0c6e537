!> Sums over the bins of a region in one step or in several ones, and the figures that they make: means of a step, or over steps.
module gravier_region_samples
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_mean_region, only: region_grid_t
  implicit none
  private
  public :: region_samples_t, region_figures_t, sum_rows
  public :: centres, volume, mass, energy, ends, holders, momentum

  !> rows of the sums of a bin: centres of free grains inside, volume of grains, mass of free grains, twice their kinetic energy
  !> without spins; ends of contacts at free grains, and centres of these grains in the middle of the step; momentum (nd), stress
  !> times volume and step (nd**2)
  integer, parameter :: centres = 1, volume = 2, mass = 3, energy = 4, ends = 5, holders = 6, momentum = 6

  !> Figures of the bins of a region, the same on every rank.
  type :: region_figures_t
    integer :: n = 0
    !> steps that they are means of
    integer :: samples = 0
    !> corners (nd, n) [m]; volume (n) [m^3, m^2 in 2D]
    real(dp), allocatable :: lower(:, :), upper(:, :), volume(:)
    !> free grains whose centres are inside (n)
    real(dp), allocatable :: grains(:)
    !> volume of the grains inside over that of the bin (n)
    real(dp), allocatable :: solid_fraction(:)
    !> of the mass of free grains inside (nd, n) [m/s], and the mean square of what their velocities differ from that of their step,
    !> by axis (n) [m^2/s^2]
    real(dp), allocatable :: velocity(:, :), granular_temperature(:)
    !> of the contact forces, compression positive; row: force, column: branch (nd, nd, n) [Pa, N/m in 2D]
    real(dp), allocatable :: stress(:, :, :)
    !> in which a free grain with its centre inside touches something (n)
    real(dp), allocatable :: contacts_per_grain(:)
  contains
    procedure :: pressure => region_figures_pressure
  end type region_figures_t

  !> Sums of steps.
  type :: region_samples_t
    !> steps
    integer :: n = 0
    !> (rows, bins): that of `energy` is what velocities differ from the mean of their step
    real(dp), private, allocatable :: sums(:, :)
    !> of the bins: volume (bins), lower and upper corners (nd, bins)
    real(dp), private, allocatable :: volume(:), lower(:, :), upper(:, :)
  contains
    procedure :: start => region_samples_start
    procedure :: add => region_samples_add
    procedure :: find_figures => region_samples_find_figures
    procedure :: word_count => region_samples_word_count
    procedure :: get_state => region_samples_get_state
    procedure :: set_state => region_samples_set_state
  end type region_samples_t

contains

  !> Rows of the sums of a bin.
  pure integer function sum_rows(nd) result(rows)
    integer, intent(in) :: nd
    rows = momentum + nd + nd**2
  end function sum_rows

  !> No step yet, of so many bins.
  pure subroutine region_samples_start(self, nd, bins)
    class(region_samples_t), intent(inout) :: self
    integer, intent(in) :: nd, bins

    if (.not. allocated(self%sums)) allocate (self%sums(sum_rows(nd), bins), self%volume(bins), self%lower(nd, bins), &
      & self%upper(nd, bins))
    self%n = 0
    self%sums(:, :) = 0.0_dp
    self%volume(:) = 0.0_dp
    self%lower(:, :) = 0.0_dp
    self%upper(:, :) = 0.0_dp
  end subroutine region_samples_start

  !> Add the sums of a step.
  pure subroutine region_samples_add(self, grid, sums)
    class(region_samples_t), intent(inout) :: self
    type(region_grid_t), intent(in) :: grid
    !> (rows, bins)
    real(dp), intent(in) :: sums(:, :)
    real(dp) :: corner(grid%nd)
    integer :: k, nd

    nd = grid%nd
    self%n = self%n + 1
    do k = 1, grid%n
      self%sums(:energy - 1, k) = self%sums(:energy - 1, k) + sums(:energy - 1, k)
      self%sums(energy + 1:, k) = self%sums(energy + 1:, k) + sums(energy + 1:, k)
      if (sums(mass, k) > 0.0_dp) self%sums(energy, k) = self%sums(energy, k) + &
        & max(sums(energy, k) - sum(sums(momentum + 1:momentum + nd, k)**2)/sums(mass, k), 0.0_dp)
      self%volume(k) = self%volume(k) + grid%volume(k)
      corner(:) = grid%lower
      corner(grid%axis) = grid%side(k - 1)
      self%lower(:, k) = self%lower(:, k) + corner
      corner(:) = grid%upper
      corner(grid%axis) = grid%side(k)
      self%upper(:, k) = self%upper(:, k) + corner
    end do
  end subroutine region_samples_add

  !> The means of the steps added, each weighted by what it divides: velocities by mass, stresses and solid fractions by volume.
  !> They are 0 where there is nothing to divide by.
  pure subroutine region_samples_find_figures(self, h, figures)
    class(region_samples_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: h
    type(region_figures_t), intent(out) :: figures
    integer :: d, k, n, nd

    nd = size(self%lower, 1)
    n = size(self%volume)
    figures%n = n
    figures%samples = self%n
    allocate (figures%lower(nd, n), figures%upper(nd, n), figures%solid_fraction(n), figures%velocity(nd, n), figures%grains(n), &
      & figures%granular_temperature(n), figures%stress(nd, nd, n), figures%contacts_per_grain(n), figures%volume(n), source=0.0_dp)
    if (self%n == 0) return
    do k = 1, n
      associate (sums => self%sums(:, k))
        figures%volume(k) = self%volume(k)/self%n
        figures%lower(:, k) = self%lower(:, k)/self%n
        figures%upper(:, k) = self%upper(:, k)/self%n
        figures%grains(k) = sums(centres)/self%n
        if (sums(holders) > 0.0_dp) figures%contacts_per_grain(k) = sums(ends)/sums(holders)
        if (sums(mass) > 0.0_dp) then
          figures%velocity(:, k) = sums(momentum + 1:momentum + nd)/sums(mass)
          figures%granular_temperature(k) = sums(energy)/(nd*sums(mass))
        end if
        if (.not. self%volume(k) > 0.0_dp) cycle
        figures%solid_fraction(k) = sums(volume)/self%volume(k)
        do d = 1, nd
          figures%stress(:, d, k) = sums(momentum + d*nd + 1:momentum + d*nd + nd)/(h*self%volume(k))
        end do
      end associate
    end do
  end subroutine region_samples_find_figures

  !> Words of the state.
  pure integer function region_samples_word_count(self) result(n)
    class(region_samples_t), intent(in) :: self
    n = 1 + size(self%sums) + size(self%volume) + size(self%lower) + size(self%upper)
  end function region_samples_word_count

  !> The state bit by bit.
  subroutine region_samples_get_state(self, words)
    class(region_samples_t), intent(in) :: self
    !> (word_count)
    integer(i8), intent(out) :: words(:)
    integer :: at, k

    words(1) = self%n
    at = 1
    do k = 1, size(self%volume)
      call put(self%sums(:, k))
      call put(self%volume(k:k))
      call put(self%lower(:, k))
      call put(self%upper(:, k))
    end do

  contains

    subroutine put(values)
      real(dp), intent(in) :: values(:)
      integer :: i

      do i = 1, size(values)
        words(at + i) = transfer(values(i), 0_i8)
      end do
      at = at + size(values)
    end subroutine put

  end subroutine region_samples_get_state

  !> Take a state that `get_state` gave of as many bins.
  subroutine region_samples_set_state(self, words)
    class(region_samples_t), intent(inout) :: self
    !> (word_count)
    integer(i8), intent(in) :: words(:)
    integer :: at, k

    self%n = narrow(words(1))
    at = 1
    do k = 1, size(self%volume)
      call take(self%sums(:, k))
      call take(self%volume(k:k))
      call take(self%lower(:, k))
      call take(self%upper(:, k))
    end do

  contains

    subroutine take(values)
      real(dp), intent(inout) :: values(:)
      integer :: i

      do i = 1, size(values)
        values(i) = transfer(words(at + i), 0.0_dp)
      end do
      at = at + size(values)
    end subroutine take

  end subroutine region_samples_set_state

  !> Mean of the diagonal of the stress in bin `k` [Pa, N/m in 2D].
  pure real(dp) function region_figures_pressure(self, k) result(pressure)
    class(region_figures_t), intent(in) :: self
    integer, intent(in) :: k
    integer :: d, nd

    nd = size(self%velocity, 1)
    pressure = 0.0_dp
    do d = 1, nd
      pressure = pressure + self%stress(d, d, k)/nd
    end do
  end function region_figures_pressure

end module gravier_region_samples
