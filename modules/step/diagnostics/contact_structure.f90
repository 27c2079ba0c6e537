!> How grains hold each other: coordination, fabric, sliding, distribution of forces, overlaps.
module gravier_contact_structure
  use gravier_kinds, only: dp, i4, i8
  use gravier_contact_law, only: unused
  use gravier_contact_kernels, only: kernels_t, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, histogram_t
  implicit none
  private
  public :: contact_structure_t, carrying_neighbours, n_bins, bin_width

  !> bins of the histogram of normal forces over their mean; one more counts what lies beyond
  integer, parameter :: n_bins = 100
  real(dp), parameter :: bin_width = 0.1_dp

  !> The same on every rank. A contact carries where its bodies touch: where the normal impulse of its solve is not zero.
  type, extends(diagnostic_t) :: contact_structure_t
    !> neighbours of a free grain that carry, on average: of all, and of those that two or more contacts hold. Bodies with shapes
    !> may touch a neighbour in several contacts; else each carrying contact is a neighbour
    real(dp) :: coordination = 0.0_dp, mechanical_coordination = 0.0_dp
    !> free grains with less than two carrying contacts
    integer(i8) :: rattlers = 0
    !> mean of n n^T over the carrying contacts between free grains (nd, nd)
    real(dp), allocatable :: fabric(:, :)
    !> part of the contacts that carries; part of the carrying contacts with friction that slides
    real(dp) :: carrying_fraction = 0.0_dp, sliding_fraction = 0.0_dp
    !> normal force of the carrying contacts: mean size, largest compression [N]; standard deviation over mean, of the sizes
    real(dp) :: force_mean = 0.0_dp, force_max = 0.0_dp, force_deviation = 0.0_dp
    !> over the contacts with overlap [m]
    real(dp) :: overlap_mean = 0.0_dp
    !> carrying contacts by normal force over mean (n_bins + 1)
    integer(i8) :: histogram(n_bins + 1) = 0
  contains
    procedure, nopass :: features => structure_features
    procedure :: begin => structure_begin
    procedure :: measure => structure_measure
    procedure :: columns => structure_columns
    procedure :: get_histogram => structure_get_histogram
  end type contact_structure_t

  !> Of a subdomain: numbers of carrying contacts of its bodies, in the first row, and of their neighbours, in the second (nv,
  !> n_columns).
  type :: tally_t
    real(dp), allocatable :: ends(:, :)
  end type tally_t

  !> places among the counts of contacts and grains
  integer, parameter :: carrying = 1, carrying_grains = 2, with_friction = 3, sliding = 4, overlapping = 5, &
    & ends = 6, held = 7, held_ends = 8, n_counts = 8

contains

  pure function structure_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "structure"
    features%meaning = "write coordination (by pairs of bodies), fabric, sliding and forces (by points of contact)"
  end function structure_features

  subroutine structure_begin(self, decomposition, physics)
    class(contact_structure_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics

    associate (unused => physics)
    end associate
    allocate (self%fabric(decomposition%nd, decomposition%nd), source=0.0_dp)
  end subroutine structure_begin

  subroutine structure_columns(self, list)
    class(contact_structure_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list

    call list%add("coordination", self%coordination)
    call list%add("mechanical_coordination", self%mechanical_coordination)
    call list%add("rattlers", real(self%rattlers, dp))
    call list%add_tensor("fabric", self%fabric)
    call list%add("carrying_fraction", self%carrying_fraction)
    call list%add("sliding_fraction", self%sliding_fraction)
    call list%add("force_mean", self%force_mean)
    call list%add("force_deviation", self%force_deviation)
    call list%add("force_max", self%force_max)
    call list%add("overlap_mean", self%overlap_mean)
  end subroutine structure_columns

  !> Normal forces of the carrying contacts over their mean.
  subroutine structure_get_histogram(self, histogram)
    class(contact_structure_t), intent(in) :: self
    type(histogram_t), allocatable, intent(out) :: histogram

    allocate (histogram)
    histogram%name = "force_histogram"
    histogram%counts = self%histogram
    histogram%bin_width = bin_width
  end subroutine structure_get_histogram

  !> Measure the contacts of a step as it was solved. Collective.
  subroutine structure_measure(self, step)
    class(contact_structure_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    call measure_structure(self, step%problem, step%halo%view, step%n_free, step%physics%h)
  end subroutine structure_measure

  subroutine measure_structure(self, problem, views, n_free, h)
    type(contact_structure_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(local_bodies_t), intent(in) :: views(:)
    !> free grains of the scene
    integer(i8), intent(in) :: n_free
    !> [s]
    real(dp), intent(in) :: h
    real(dp) :: parts(problem%nd**2 + 2, size(problem%sub)), sums(problem%nd**2 + 2), largest
    integer(i8) :: counts(n_counts)
    integer :: s, c, nd

    nd = problem%nd
    parts(:, :) = 0.0_dp
    counts(:) = 0
    largest = 0.0_dp
    do s = 1, size(problem%sub)
      call count_contacts(problem%sub(s), problem%kernels, counts, parts(:, s))
      do c = 1, problem%sub(s)%n_contacts
        largest = max(largest, problem%sub(s)%normal_impulse(c))
      end do
    end do
    call count_ends(problem, views, counts)
    call problem%comm%sum_counts(counts)
    call problem%comm%sum_parts(parts, sums)
    self%force_max = problem%comm%highest(largest)/h
    self%coordination = ratio(real(counts(ends), dp), n_free)
    self%mechanical_coordination = ratio(real(counts(held_ends), dp), counts(held))
    self%rattlers = n_free - counts(held)
    do s = 1, nd
      self%fabric(:, s) = sums((s - 1)*nd + 1:s*nd)
    end do
    if (counts(carrying_grains) > 0) self%fabric(:, :) = self%fabric/real(counts(carrying_grains), dp)
    self%carrying_fraction = ratio(real(counts(carrying), dp), problem%n_contacts)
    self%sliding_fraction = ratio(real(counts(sliding), dp), counts(with_friction))
    self%force_mean = ratio(sums(nd**2 + 1), counts(carrying))/h
    self%overlap_mean = ratio(sums(nd**2 + 2), counts(overlapping))
    call distribute(self, problem, counts(carrying), h)
  end subroutine measure_structure

  !> Neighbours of a free grain that carry, on average: `coordination` by itself. Collective.
  real(dp) function carrying_neighbours(problem, halo, n_free)
    type(contact_problem_t), intent(inout) :: problem
    type(halo_t), intent(in) :: halo
    !> free grains of the scene
    integer(i8), intent(in) :: n_free
    integer(i8) :: counts(n_counts)

    counts(:) = 0
    call count_ends(problem, halo%view, counts)
    call problem%comm%sum_counts(counts)
    carrying_neighbours = ratio(real(counts(ends), dp), n_free)
  end function carrying_neighbours

  !> 0 where there is nothing to divide by.
  pure real(dp) function ratio(part, whole)
    real(dp), intent(in) :: part
    integer(i8), intent(in) :: whole

    ratio = 0.0_dp
    if (whole > 0) ratio = part/real(whole, dp)
  end function ratio

  !> Counts and sums (fabric, normal impulse, overlap) over the contacts of a subdomain.
  pure subroutine count_contacts(sub, kernels, counts, part)
    type(subproblem_t), intent(in) :: sub
    type(kernels_t), intent(in) :: kernels
    integer(i8), intent(inout) :: counts(n_counts)
    !> (nd**2 + 2)
    real(dp), intent(inout) :: part(:)
    real(dp) :: bound, held
    integer :: c, d, q, g, nd

    nd = kernels%nd
    do c = 1, sub%n_contacts
      if (sub%gap(c) < 0.0_dp) then
        counts(overlapping) = counts(overlapping) + 1
        part(nd**2 + 2) = part(nd**2 + 2) - sub%gap(c)
      end if
      q = lane_of(c)
      g = block_of(c)
      ! the impulse of the solve is above 0 where the bodies touch
      held = sub%impulse(q, 1, g)
      if (.not. held > 0.0_dp) cycle
      counts(carrying) = counts(carrying) + 1
      part(nd**2 + 1) = part(nd**2 + 1) + abs(sub%normal_impulse(c))
      if (kernels%nf > 1) then
        bound = sub%hot(q, kernels%row%friction, g)*held
        if (bound > 0.0_dp) then
          counts(with_friction) = counts(with_friction) + 1
          if (norm2(sub%impulse(q, 2:kernels%nf, g)) >= bound*(1.0_dp - unused)) counts(sliding) = counts(sliding) + 1
        end if
      end if
      if (any(sub%pair(:, c) > sub%n_grains)) cycle
      counts(carrying_grains) = counts(carrying_grains) + 1
      do d = 1, nd
        part((d - 1)*nd + 1:d*nd) = part((d - 1)*nd + 1:d*nd) + sub%hot(q, 1:nd, g)*sub%hot(q, d, g)
      end do
    end do
  end subroutine count_contacts

  !> Count the neighbours of free grains that carry, and those of grains that two or more carrying contacts hold. A shared grain is
  !> counted in the first of its subdomains. Collective.
  subroutine count_ends(problem, views, counts)
    type(contact_problem_t), intent(inout) :: problem
    type(local_bodies_t), intent(in) :: views(:)
    integer(i8), intent(inout) :: counts(n_counts)
    logical, allocatable :: counted_elsewhere(:)
    !> an exchange takes columns of nv
    type(tally_t) :: tally(size(problem%sub))
    integer :: s, b, k, n, neighbours

    do s = 1, size(problem%sub)
      allocate (tally(s)%ends(problem%nv, problem%sub(s)%n_columns), source=0.0_dp)
      call tally_contacts(problem%sub(s), views(s)%list, tally(s))
      call problem%shared%load(s, tally(s)%ends)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => problem%shared%part(s))
        allocate (counted_elsewhere(sub%n_bodies), source=.false.)
        do k = 1, part%n_shared
          counted_elsewhere(part%body(k)) = part%copy_rank(k) > 1
          call problem%shared%add_copies(s, k, tally(s)%ends(:, part%body(k)))
        end do
        do b = 1, sub%n_grains
          n = nint(tally(s)%ends(1, b))
          neighbours = nint(tally(s)%ends(2, b))
          if (counted_elsewhere(b)) cycle
          counts(ends) = counts(ends) + neighbours
          if (n < 2) cycle
          counts(held) = counts(held) + 1
          counts(held_ends) = counts(held_ends) + neighbours
        end do
        deallocate (counted_elsewhere)
      end associate
    end do
  end subroutine count_ends

  !> Count the carrying contacts and the neighbours of the bodies of a subdomain: the contacts of one pair are one neighbour.
  pure subroutine tally_contacts(sub, list, tally)
    type(subproblem_t), intent(in) :: sub
    type(neighbour_list_t), intent(in) :: list
    type(tally_t), intent(inout) :: tally
    !> of each place of the list, that where its pair begins
    integer, allocatable :: first(:)
    logical, allocatable :: met(:)
    integer :: c, k, p

    allocate (first(list%n))
    allocate (met(list%n), source=.false.)
    p = 1
    do while (p <= list%n)
      k = 1
      if (list%memory%key_row > 0) k = list%points_of(p)
      first(p:p + k - 1) = p
      p = p + k
    end do
    do c = 1, sub%n_contacts
      if (.not. sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) cycle
      p = first(sub%source(c))
      do k = 1, 2
        tally%ends(1, sub%pair(k, c)) = tally%ends(1, sub%pair(k, c)) + 1.0_dp
        if (.not. met(p)) tally%ends(2, sub%pair(k, c)) = tally%ends(2, sub%pair(k, c)) + 1.0_dp
      end do
      met(p) = .true.
    end do
  end subroutine tally_contacts

  !> Standard deviation and histogram of the normal forces over their mean. Collective.
  subroutine distribute(self, problem, n_carrying, h)
    type(contact_structure_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    integer(i8), intent(in) :: n_carrying
    real(dp), intent(in) :: h
    real(dp) :: part(size(problem%sub)), force
    integer :: s, c, bin

    part(:) = 0.0_dp
    self%histogram(:) = 0
    self%force_deviation = 0.0_dp
    ! attractions alone leave no force in a contact
    if (.not. self%force_mean > 0.0_dp) return
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          if (.not. sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) cycle
          force = abs(sub%normal_impulse(c))/(h*self%force_mean)
          part(s) = part(s) + (force - 1.0_dp)**2
          bin = n_bins + 1
          if (force < n_bins*bin_width) bin = min(int(force/bin_width, i4) + 1, n_bins)
          self%histogram(bin) = self%histogram(bin) + 1
        end do
      end associate
    end do
    call problem%comm%sum_counts(self%histogram)
    self%force_deviation = sqrt(ratio(problem%comm%sum_real(part), n_carrying))
  end subroutine distribute

end module gravier_contact_structure
