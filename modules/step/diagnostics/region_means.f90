!> Means over regions of a scene and profiles along an axis: solid fraction, velocity, granular temperature, stress, contacts.
module gravier_region_means
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_halo, only: halo_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_contact_branch, only: find_branch
  use gravier_scene_extent, only: find_extent
  use gravier_mean_region, only: mean_region_t, region_grid_t, share_list_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: region_means_t, region_figures_t, regions_key

  !> by which the diagnostic is found among others; groups of the input ask for it, not a key of &output
  character(len=*), parameter :: regions_key = "region"

  !> Figures of the bins of a region, the same on every rank.
  type :: region_figures_t
    integer :: n = 0
    !> corners (nd, n) [m]; volume (n) [m^3, m^2 in 2D]
    real(dp), allocatable :: lower(:, :), upper(:, :), volume(:)
    !> free grains whose centres are inside (n)
    real(dp), allocatable :: grains(:)
    !> volume of the grains inside over that of the bin (n)
    real(dp), allocatable :: solid_fraction(:)
    !> of the mass of free grains inside (nd, n) [m/s], and the mean square of what their velocities differ from it, by axis
    !> (n) [m^2/s^2]
    real(dp), allocatable :: velocity(:, :), granular_temperature(:)
    !> of the contact forces, compression positive; row: force, column: branch (nd, nd, n) [Pa, N/m in 2D]
    real(dp), allocatable :: stress(:, :, :)
    !> in which a free grain with its centre inside touches something (n)
    real(dp), allocatable :: contacts_per_grain(:)
  contains
    procedure :: pressure => region_figures_pressure
  end type region_figures_t

  type, extends(diagnostic_t) :: region_means_t
    type(mean_region_t), allocatable :: region(:)
    !> of each region as a whole, in the last step that was measured
    type(region_figures_t), allocatable :: figures(:)
    !> of the free grains that reach into each region, as far as they do, where the run begins or goes on [kg]
    real(dp), allocatable :: mass_at_start(:)
  contains
    procedure, nopass :: features => region_means_features
    procedure :: begin => region_means_begin
    procedure :: measure => region_means_measure
    procedure :: columns => region_means_columns
    procedure :: find_profiles => region_means_find_profiles
  end type region_means_t

  !> rows of the sums of a bin: centres of free grains inside, volume of grains, mass of free grains, twice their kinetic energy
  !> without spins; ends of contacts at free grains, and centres of these grains in the middle of the step; momentum (nd), stress
  !> times volume and step (nd**2)
  integer, parameter :: centres = 1, volume = 2, mass = 3, energy = 4, ends = 5, holders = 6, momentum = 6

contains

  pure function region_means_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = regions_key
    features%meaning = "means over the regions of the input"
    ! results.h5 has them as tables
    features%of_scene = .false.
  end function region_means_features

  !> Find the mass of the grains that reach into the regions. Collective.
  subroutine region_means_begin(self, decomposition, physics)
    class(region_means_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(region_grid_t) :: grids(size(self%region))
    real(dp), allocatable :: sums(:, :)
    integer :: r

    associate (unused => physics)
    end associate
    call make_grids(self%region, decomposition, .false., grids)
    call sum_regions(grids, decomposition, sums)
    self%mass_at_start = sums(mass, :)
    allocate (self%figures(size(self%region)))
    do r = 1, size(self%region)
      call take_figures(grids(r), sums(:, r:r), 1.0_dp, self%figures(r))
    end do
  end subroutine region_means_begin

  !> Measure each region as a whole. Collective.
  subroutine region_means_measure(self, step)
    class(region_means_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step

    call find_figures(self%region, .false., step%decomposition, step%halo, step%problem, step%physics%h, self%figures)
  end subroutine region_means_measure

  !> The bins of each region in a step that was solved last, whose halo and problem are still there. Collective.
  subroutine region_means_find_profiles(self, decomposition, halo, problem, h, figures)
    class(region_means_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    !> [s]
    real(dp), intent(in) :: h
    !> (regions)
    type(region_figures_t), allocatable, intent(out) :: figures(:)

    allocate (figures(size(self%region)))
    call find_figures(self%region, .true., decomposition, halo, problem, h, figures)
  end subroutine region_means_find_profiles

  subroutine region_means_columns(self, list)
    class(region_means_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    character(len=*), parameter :: axes = "xyz"
    integer :: r, d, nd

    do r = 1, size(self%region)
      associate (name => self%region(r)%name, figures => self%figures(r))
        nd = size(figures%velocity, 1)
        call list%add(name//"_volume", figures%volume(1))
        call list%add(name//"_grains", figures%grains(1))
        call list%add(name//"_solid_fraction", figures%solid_fraction(1))
        do d = 1, nd
          call list%add(name//"_velocity_"//axes(d:d), figures%velocity(d, 1))
        end do
        call list%add(name//"_granular_temperature", figures%granular_temperature(1))
        call list%add_tensor(name//"_stress", figures%stress(:, :, 1))
        call list%add(name//"_pressure", figures%pressure(1))
        call list%add(name//"_contacts_per_grain", figures%contacts_per_grain(1))
      end associate
    end do
  end subroutine region_means_columns

  !> Figures of the regions as a whole, or of their bins. Collective.
  subroutine find_figures(regions, binned, decomposition, halo, problem, h, figures)
    type(mean_region_t), intent(in) :: regions(:)
    logical, intent(in) :: binned
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    !> [s]
    real(dp), intent(in) :: h
    !> (regions)
    type(region_figures_t), intent(inout) :: figures(:)
    type(region_grid_t) :: grids(size(regions))
    real(dp), allocatable :: sums(:, :)
    integer :: r, first

    call make_grids(regions, decomposition, binned, grids)
    call sum_regions(grids, decomposition, sums, halo, problem)
    first = 1
    do r = 1, size(regions)
      call take_figures(grids(r), sums(:, first:first + grids(r)%n - 1), h, figures(r))
      first = first + grids(r)%n
    end do
  end subroutine find_figures

  !> The space of each region in the scene as it is. Collective.
  subroutine make_grids(regions, decomposition, binned, grids)
    type(mean_region_t), intent(in) :: regions(:)
    type(decomposition_t), intent(in) :: decomposition
    logical, intent(in) :: binned
    type(region_grid_t), intent(out) :: grids(:)
    real(dp), dimension(decomposition%nd) :: low, high, length
    integer :: r

    call find_extent(decomposition, low, high, length)
    do r = 1, size(regions)
      call regions(r)%make_grid(low, high, decomposition%period%length(1:decomposition%nd), binned, grids(r))
    end do
  end subroutine make_grids

  !> Sums over grains and, where a problem is there, its contacts, in the bins of all regions one after the other. Those of a
  !> subdomain are added up in the order of its bodies and contacts, those of the subdomains exactly. Collective.
  subroutine sum_regions(grids, decomposition, sums, halo, problem)
    type(region_grid_t), intent(in) :: grids(:)
    type(decomposition_t), intent(in) :: decomposition
    !> (rows, bins)
    real(dp), allocatable, intent(out) :: sums(:, :)
    type(halo_t), intent(in), optional :: halo
    type(contact_problem_t), intent(in), optional :: problem
    real(dp), allocatable :: parts(:, :, :)
    integer :: s, r, first, rows, bins

    rows = momentum + decomposition%nd + decomposition%nd**2
    bins = sum(grids%n)
    allocate (parts(rows, bins, size(decomposition%owned)), source=0.0_dp)
    do s = 1, size(decomposition%owned)
      first = 1
      do r = 1, size(grids)
        associate (bin => parts(:, first:first + grids(r)%n - 1, s))
          call add_grains(grids(r), decomposition, s, bin)
          if (present(problem)) call add_contacts(grids(r), halo, problem, s, bin)
        end associate
        first = first + grids(r)%n
      end do
    end do
    allocate (sums(rows, bins))
    call sum_tables(decomposition%comm, rows*bins, size(decomposition%owned), parts, sums)
  end subroutine sum_regions

  !> Sum tables of the subdomains, number by number. Collective.
  subroutine sum_tables(comm, n, n_tables, parts, sums)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: n, n_tables
    real(dp), intent(in) :: parts(n, n_tables)
    real(dp), intent(out) :: sums(n)

    call comm%sum_parts(parts, sums)
  end subroutine sum_tables

  !> Add the grains of a subdomain of this rank: each by the share of its ball that lies in a bin, at the end of the step.
  subroutine add_grains(grid, decomposition, s, bins)
    type(region_grid_t), intent(in) :: grid
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: s
    !> (rows, n)
    real(dp), intent(inout) :: bins(:, :)
    type(share_list_t) :: list
    real(dp) :: m
    integer :: k, j, b, nd

    nd = grid%nd
    associate (owned => decomposition%owned(s))
      do k = 1, owned%n
        call grid%share_ball(owned%position(:, k), owned%radius(k), list)
        do j = 1, list%n
          b = list%bin(j)
          bins(volume, b) = bins(volume, b) + list%share(j)*decomposition%figures%volume_of(owned, k)
          if (owned%glued(k) > 0) cycle
          m = list%share(j)*owned%mass(k)
          bins(mass, b) = bins(mass, b) + m
          bins(energy, b) = bins(energy, b) + m*sum(owned%velocity(1:nd, k)**2)
          bins(momentum + 1:momentum + nd, b) = bins(momentum + 1:momentum + nd, b) + m*owned%velocity(1:nd, k)
        end do
        if (owned%glued(k) > 0) cycle
        b = grid%bin_of(owned%position(:, k))
        if (b > 0) bins(centres, b) = bins(centres, b) + 1.0_dp
      end do
    end associate
  end subroutine add_grains

  !> Add the contacts of a subdomain of this rank: p l^T by the share of the branch l that lies in a bin (Weber 1966); their ends at
  !> free grains, and all free grains, by the centres of these. Places are those of the middle of the step, at which contacts are
  !> found: a grain is in the same bin as the ends of its contacts.
  subroutine add_contacts(grid, halo, problem, s, bins)
    type(region_grid_t), intent(in) :: grid
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> (rows, n)
    real(dp), intent(inout) :: bins(:, :)
    type(share_list_t) :: list
    real(dp), dimension(grid%nd) :: p, branch, from, to
    integer :: c, j, b, d, i, row, nd

    nd = grid%nd
    associate (sub => problem%sub(s), view => halo%view(s))
      do i = 1, view%bodies%n
        if (view%origin(i) > 0 .and. view%bodies%glued(i) == 0) call add_one(holders, view%bodies%position(:, i))
      end do
      do c = 1, sub%n_contacts
        call find_branch(problem%kernels, sub, c, branch)
        call problem%impulse_on_candidate(s, c, p)
        i = view%list%candidate(sub%source(c))
        j = view%list%antagonist(sub%source(c))
        ! the branch begins at the antagonist; one that ends at a glued candidate begins at the centre of the antagonist
        if (view%bodies%glued(i) > 0 .and. j > 0) then
          from(:) = view%bodies%position(:, j)
          to(:) = from + branch
        else
          to(:) = view%bodies%position(:, i)
          from(:) = to - branch
        end if
        if (sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) then
          if (view%bodies%glued(i) == 0) call add_one(ends, view%bodies%position(:, i))
          if (j > 0) then
            if (view%bodies%glued(j) == 0) call add_one(ends, view%bodies%position(:, j))
          end if
        end if
        call grid%share_segment(from, to, list)
        do j = 1, list%n
          b = list%bin(j)
          do d = 1, nd
            row = momentum + d*nd
            bins(row + 1:row + nd, b) = bins(row + 1:row + nd, b) + list%share(j)*p*branch(d)
          end do
        end do
      end do
    end associate

  contains

    subroutine add_one(row, x)
      integer, intent(in) :: row
      real(dp), intent(in) :: x(:)
      integer :: bin

      bin = grid%bin_of(x)
      if (bin > 0) bins(row, bin) = bins(row, bin) + 1.0_dp
    end subroutine add_one

  end subroutine add_contacts

  !> From the sums of the bins of a region to their figures, which are 0 where there is nothing to divide by.
  pure subroutine take_figures(grid, sums, h, figures)
    type(region_grid_t), intent(in) :: grid
    !> (rows, n)
    real(dp), intent(in) :: sums(:, :)
    !> [s]
    real(dp), intent(in) :: h
    type(region_figures_t), intent(out) :: figures
    integer :: d, k, n, nd

    nd = grid%nd
    n = grid%n
    figures%n = n
    allocate (figures%lower(nd, n), figures%upper(nd, n), figures%solid_fraction(n), figures%velocity(nd, n), &
      & figures%granular_temperature(n), figures%stress(nd, nd, n), figures%contacts_per_grain(n), figures%volume(n), source=0.0_dp)
    figures%volume(:) = grid%volume
    figures%grains = sums(centres, :)
    do k = 1, n
      figures%lower(:, k) = grid%lower
      figures%upper(:, k) = grid%upper
      figures%lower(grid%axis, k) = grid%side(k - 1)
      figures%upper(grid%axis, k) = grid%side(k)
      if (sums(holders, k) > 0.0_dp) figures%contacts_per_grain(k) = sums(ends, k)/sums(holders, k)
      if (sums(mass, k) > 0.0_dp) then
        figures%velocity(:, k) = sums(momentum + 1:momentum + nd, k)/sums(mass, k)
        figures%granular_temperature(k) = max(sums(energy, k)/sums(mass, k) - sum(figures%velocity(:, k)**2), 0.0_dp)/nd
      end if
      if (.not. grid%volume > 0.0_dp) cycle
      figures%solid_fraction(k) = sums(volume, k)/grid%volume
      do d = 1, nd
        figures%stress(:, d, k) = sums(momentum + d*nd + 1:momentum + d*nd + nd, k)/(h*grid%volume)
      end do
    end do
  end subroutine take_figures

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

end module gravier_region_means
