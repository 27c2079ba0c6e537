!> Means over regions of a scene and profiles along an axis: solid fraction, velocity, granular temperature, stress, contacts.
module gravier_region_means
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_communicator, only: communicator_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_halo, only: halo_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_contact_branch, only: find_branch
  use gravier_scene_extent, only: find_extent, share_inside
  use gravier_body_part, only: turned_body_t
  use gravier_body_store, only: body_set_t
  use gravier_mean_region, only: mean_region_t, region_grid_t, share_list_t, region_words
  use gravier_region_samples, only: region_samples_t, region_figures_t, sum_rows, centres, volume, mass, energy, ends, holders, &
    & momentum
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: region_means_t, regions_key, samples_record

  !> by which the diagnostic is found among others; groups of the input ask for it, not a key of &output
  character(len=*), parameter :: regions_key = "region"

  !> what the state of the samples is: the version of checkpoints, which changes with it
  character(len=*), parameter :: samples_record = "measured; what is asked, words, steps, a bin sums volume lower upper"

  type, extends(diagnostic_t) :: region_means_t
    type(mean_region_t), allocatable :: region(:)
    !> of each region as a whole, in the last step that was measured
    type(region_figures_t), allocatable :: figures(:)
    !> of the free grains that reach into each region, as far as they do, where the run begins or goes on [kg]
    real(dp), allocatable :: mass_at_start(:)
    !> bins of each region in the steps since a state was last written that were sampled
    type(region_samples_t), private, allocatable :: samples(:)
    !> steps that were measured
    integer, private :: measured = 0
  contains
    procedure, nopass :: features => region_means_features
    procedure :: begin => region_means_begin
    procedure :: measure => region_means_measure
    procedure :: columns => region_means_columns
    procedure :: find_profiles => region_means_find_profiles
    procedure :: get_samples => region_means_get_samples
    procedure :: set_samples => region_means_set_samples
  end type region_means_t

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
    allocate (self%figures(size(self%region)), self%samples(size(self%region)))
    do r = 1, size(self%region)
      call take_figures(grids(r), sums(:, r:r), 1.0_dp, self%figures(r))
      call self%samples(r)%start(decomposition%nd, max(self%region(r)%bins, 1))
    end do
  end subroutine region_means_begin

  !> Measure each region as a whole, and sample the bins of those whose turn it is. Collective.
  subroutine region_means_measure(self, step)
    class(region_means_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    type(region_grid_t) :: grids(size(self%region))
    real(dp), allocatable :: sums(:, :)
    integer :: r

    call make_grids(self%region, step%decomposition, .false., grids)
    call sum_regions(grids, step%decomposition, sums, step%halo, step%problem)
    do r = 1, size(grids)
      call take_figures(grids(r), sums(:, r:r), step%physics%h, self%figures(r))
    end do
    self%measured = self%measured + 1
    call sample(self, step%decomposition, step%halo, step%problem, written=.false.)
  end subroutine region_means_measure

  !> Add the bins of the step that was solved last to the samples of regions: where a state is written, of those that do not have it
  !> yet, else of those whose turn it is. Collective.
  subroutine sample(self, decomposition, halo, problem, written)
    class(region_means_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    logical, intent(in) :: written
    type(mean_region_t) :: due(size(self%region))
    type(region_grid_t) :: grids(size(self%region))
    real(dp), allocatable :: sums(:, :)
    integer :: place(size(self%region)), r, n, k, first
    logical :: sampled

    n = 0
    do r = 1, size(due)
      sampled = self%region(r)%sample_every > 0
      if (sampled) sampled = mod(self%measured, self%region(r)%sample_every) == 0
      if (written) sampled = .not. sampled .or. self%samples(r)%n == 0
      if (.not. sampled) cycle
      n = n + 1
      place(n) = r
      due(n) = self%region(r)
    end do
    if (n == 0) return
    call make_grids(due(1:n), decomposition, .true., grids(1:n))
    call sum_regions(grids(1:n), decomposition, sums, halo, problem)
    first = 1
    do k = 1, n
      call self%samples(place(k))%add(grids(k), sums(:, first:first + grids(k)%n - 1))
      first = first + grids(k)%n
    end do
  end subroutine sample

  !> The bins of each region when a state is written: of the step that was solved last, whose halo and problem are still there, or
  !> the means of the samples since this was last called and of that step. Collective.
  subroutine region_means_find_profiles(self, decomposition, halo, problem, h, figures)
    class(region_means_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    !> [s]
    real(dp), intent(in) :: h
    !> (regions)
    type(region_figures_t), allocatable, intent(out) :: figures(:)
    integer :: r

    allocate (figures(size(self%region)))
    call sample(self, decomposition, halo, problem, written=.true.)
    do r = 1, size(figures)
      call self%samples(r)%find_figures(h, figures(r))
      call self%samples(r)%start(decomposition%nd, figures(r)%n)
    end do
  end subroutine region_means_find_profiles

  !> The samples that no state has been written of, bit by bit, and what they are samples of.
  subroutine region_means_get_samples(self, words)
    class(region_means_t), intent(in) :: self
    integer(i8), allocatable, intent(out) :: words(:)
    integer :: r, at, n

    n = 1
    do r = 1, size(self%region)
      n = n + region_words + 1 + self%samples(r)%word_count()
    end do
    allocate (words(n))
    words(1) = self%measured
    at = 1
    do r = 1, size(self%region)
      n = self%samples(r)%word_count()
      call self%region(r)%get_words(words(at + 1:at + region_words))
      at = at + region_words + 1
      words(at) = n
      call self%samples(r)%get_state(words(at + 1:at + n))
      at = at + n
    end do
  end subroutine region_means_get_samples

  !> Take samples that `get_samples` gave. A region of which something else was asked begins anew.
  subroutine region_means_set_samples(self, words)
    class(region_means_t), intent(inout) :: self
    integer(i8), intent(in) :: words(:)
    integer(i8) :: asked(region_words)
    integer :: r, at, n

    if (size(words) == 0) return
    self%measured = narrow(words(1))
    at = 1
    do while (at + region_words < size(words))
      n = narrow(words(at + region_words + 1))
      do r = 1, size(self%region)
        call self%region(r)%get_words(asked)
        if (all(asked == words(at + 1:at + region_words)) .and. n == self%samples(r)%word_count()) &
          & call self%samples(r)%set_state(words(at + region_words + 2:at + region_words + 1 + n))
      end do
      at = at + region_words + 1 + n
    end do
  end subroutine region_means_set_samples

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

  !> Figures of the sums of one step.
  subroutine take_figures(grid, sums, h, figures)
    type(region_grid_t), intent(in) :: grid
    !> (rows, n)
    real(dp), intent(in) :: sums(:, :)
    !> [s]
    real(dp), intent(in) :: h
    type(region_figures_t), intent(out) :: figures
    type(region_samples_t) :: one

    call one%start(grid%nd, grid%n)
    call one%add(grid, sums)
    call one%find_figures(h, figures)
  end subroutine take_figures

  !> The space of each region in the scene as it is. Collective.
  subroutine make_grids(regions, decomposition, binned, grids)
    type(mean_region_t), intent(in) :: regions(:)
    type(decomposition_t), intent(in) :: decomposition
    logical, intent(in) :: binned
    type(region_grid_t), intent(out) :: grids(:)
    real(dp), dimension(decomposition%nd) :: low, high, length, from, to
    integer :: r, k

    call find_extent(decomposition, .true., low, high, length)
    do r = 1, size(regions)
      associate (grid => grids(r))
        call regions(r)%make_grid(low, high, decomposition%period%length(1:decomposition%nd), binned, grid)
        from(:) = grid%lower
        to(:) = grid%upper
        do k = 1, grid%n
          from(grid%axis) = grid%side(k - 1)
          to(grid%axis) = grid%side(k)
          grid%volume(k) = grid%volume(k)*share_inside(decomposition%boundaries, from, to)
        end do
      end associate
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

    rows = sum_rows(decomposition%nd)
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

  !> Add the grains of a subdomain of this rank: each by the share of it that lies in a bin, at the end of the step.
  subroutine add_grains(grid, decomposition, s, bins)
    type(region_grid_t), intent(in) :: grid
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: s
    !> (rows, n)
    real(dp), intent(inout) :: bins(:, :)
    type(share_list_t) :: list
    type(turned_body_t) :: turned
    real(dp) :: m
    integer :: k, j, b, nd

    nd = grid%nd
    associate (owned => decomposition%owned(s))
      do k = 1, owned%n
        call share_grain(grid, decomposition, owned, k, turned, list)
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

  !> The shares of grain `k` in the bins.
  subroutine share_grain(grid, decomposition, bodies, k, turned, list)
    type(region_grid_t), intent(in) :: grid
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> room for a body with a shape
    type(turned_body_t), intent(inout) :: turned
    type(share_list_t), intent(inout) :: list

    call grid%share_ball(bodies%position(:, k), bodies%radius(k), list)
    if (bodies%no == 0 .or. list%n == 0) return
    if (bodies%shape(k) == 0 .or. (list%n == 1 .and. list%share(1) >= 1.0_dp)) return
    associate (shape => decomposition%shapes%shape(bodies%shape(k)))
      call turned%turn(shape, grid%nd, bodies%radius(k), bodies%orientation(:, k))
      call grid%share_body(bodies%position(:, k), shape, turned, list)
    end associate
  end subroutine share_grain

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
      do i = 1, view%n_bodies()
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

end module gravier_region_means
