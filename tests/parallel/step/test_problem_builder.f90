!> From grains to the packed contact problem, and back: against the comparison of all pairs, which every rank can make,
!> places and velocities following from identifiers.
program test_problem_builder
  use gravier_effects, only: effects_t
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_rule, only: rule_dual, rule_primal
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_nlgs, only: nlgs_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_boundary_loads, only: sum_boundary_impulses, take_boundary_velocities, set_glued_velocities, carry_glued
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_pair_laws, only: set_default_laws
  use gravier_physics, only: physics_t
  use gravier_interface, only: interface_statistics_t, n_multiplicities
  use gravier_problem_builder, only: build_problem
  use gravier_velocity_return, only: take_velocities
  use gravier_test_scenes, only: cloud_t, near_pair_t, draw_number => draw, plane, make_decomposition
  use gravier_test_contact_columns, only: contact_column
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 130, n_walls = 2
  real(dp), parameter :: alert = 0.03_dp, skin = 0.02_dp, h = 0.125_dp
  real(dp), parameter :: gravity(3) = [0.5_dp, -3.0_dp, -7.0_dp]

  !> What brute force knows of a scene.
  type :: truth_t
    integer :: nd = 2
    type(cloud_t) :: cloud
    !> subdomain of the centre of each grain
    integer :: owned(n_grains) = 0
    !> owner of the contact of grain i (lower) and grain j, or wall j - n_grains; 0 where there is none
    integer, allocatable :: owner(:, :)
    !> whether grain i carries a contact in subdomain s (n_grains, n_subdomains)
    logical, allocatable :: touches(:, :)
    !> gap and branch of grain i and grain j, or unit normal of wall j - n_grains
    real(dp), allocatable :: gap(:, :), branch(:, :, :)
  end type truth_t

  type(communicator_t), target :: comm
  integer :: nd, k, visitors, manifold, grouped
  integer, parameter :: counts(*) = [1, 3, 7, 16]

  call start_parallel()
  call comm%init()
  visitors = 0
  manifold = 0
  grouped = 0
  do nd = 2, 3
    do k = 1, size(counts)
      call test_problem(nd, 0, counts(k), .true., rule_dual, .false.)
      call test_problem(nd, 0, counts(k), .true., rule_dual, .true.)
      call test_problem(nd, 0, counts(k), .false., rule_dual, .false.)
      call test_problem(nd, 0, counts(k), .true., rule_primal, .true.)
    end do
    ! across periods along the walls
    call test_problem(nd, 2**(nd - 2), 7, .true., rule_dual, .true.)
    call test_problem(nd, 2**(nd - 2), 7, .true., rule_primal, .false.)
  end do
  call check(manifold > 0, "some grains are in three subdomains and more")
  call check(comm%total(int(grouped, i8)) > 0, "some contacts are relaxed together")
  call check(visitors > 0, "some shared grains carry no contact owned")
  do nd = 2, 3
    do k = 1, size(counts)
      call test_spins(nd, counts(k))
    end do
  end do
  call test_free_flight()
  do k = 1, 2
    call test_boundaries(k, .false.)
    call test_boundaries(k, .true.)
    call test_restitution_gap(k)
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Component `i` of what grain `g` has.
  pure real(dp) function draw(g, i)
    integer, intent(in) :: g, i
    draw = draw_number(4, g, i)
  end function draw

  subroutine make_scene(nd, axes, n_subdomains, rotation, kind, by_cells, decomposition, truth)
    integer, intent(in) :: nd, axes, n_subdomains, kind
    logical, intent(in) :: rotation, by_cells
    type(decomposition_t), intent(inout) :: decomposition
    type(truth_t), intent(out) :: truth
    real(dp) :: origin(nd), axis(nd)
    integer :: w

    truth%nd = nd
    call truth%cloud%init(nd, n_grains, 0.03_dp, 0.11_dp, 4)
    call truth%cloud%make_periodic(axes)
    decomposition%rule = truth%cloud%rule(alert, skin, kind)
    allocate (decomposition%boundaries(n_walls))
    origin(:) = 0.0_dp
    axis(:) = 0.0_dp
    axis(nd) = 1.0_dp
    decomposition%boundaries(1) = plane(n_grains + 1, origin, axis)
    origin(1) = 1.0_dp
    axis(1) = -1.0_dp
    axis(nd) = 0.0_dp
    decomposition%boundaries(2) = plane(n_grains + 2, origin, axis)
    do w = 1, n_walls
      decomposition%boundaries(w)%contact%friction = 0.75_dp
    end do
    call make_decomposition(comm, truth%cloud, n_subdomains, merge(3*nd - 3, nd, rotation), by_cells, decomposition)
    call find_truth(decomposition, truth)
  end subroutine make_scene

  subroutine find_truth(decomposition, truth)
    type(decomposition_t), intent(in) :: decomposition
    type(truth_t), intent(inout) :: truth
    type(near_pair_t), allocatable :: pairs(:)
    real(dp) :: other(truth%nd), point(truth%nd), branch(truth%nd), gap
    integer :: i, p, w, nd

    nd = truth%nd
    allocate (truth%owner(n_grains, n_grains + n_walls), source=0)
    allocate (truth%touches(n_grains, decomposition%n_subdomains), source=.false.)
    allocate (truth%gap(n_grains, n_grains + n_walls), truth%branch(nd, n_grains, n_grains + n_walls), source=0.0_dp)
    associate (place => truth%cloud%place, boundaries => decomposition%boundaries)
      call truth%cloud%near_pairs(alert, pairs)
      do p = 1, size(pairs)
        call truth%cloud%find_antagonist(pairs(p), other)
        point(:) = place(:, pairs(p)%i)
        if (decomposition%rule%kind == rule_dual) point(:) = (point + other)/2
        branch(:) = place(:, pairs(p)%i) - other
        call note(truth, pairs(p)%i, pairs(p)%j, decomposition%partition%owner(point), pairs(p)%gap, branch)
      end do
      do i = 1, n_grains
        truth%owned(i) = decomposition%partition%owner(place(:, i))
        point(:) = place(:, i)
        do w = 1, n_walls
          branch(:) = boundaries(w)%surface%axis(1:nd)
          gap = sum((point - boundaries(w)%surface%point(1:nd))*branch) - truth%cloud%radius(i)
          call note(truth, i, n_grains + w, truth%owned(i), gap, branch)
        end do
      end do
    end associate
  end subroutine find_truth

  !> Note a contact, unless the gap is too large.
  subroutine note(truth, i, j, owner, gap, branch)
    type(truth_t), intent(inout) :: truth
    integer, intent(in) :: i, j, owner
    real(dp), intent(in) :: gap, branch(:)

    if (gap > alert) return
    truth%owner(i, j) = owner
    truth%touches(i, owner) = .true.
    if (j <= n_grains) truth%touches(j, owner) = .true.
    truth%gap(i, j) = gap
    truth%branch(:, i, j) = branch
  end subroutine note

  subroutine test_problem(nd, axes, n_subdomains, friction, kind, by_cells)
    integer, intent(in) :: nd, axes, n_subdomains, kind
    logical, intent(in) :: friction, by_cells
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(truth_t) :: truth
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    integer :: s

    call make_scene(nd, axes, n_subdomains, friction, kind, by_cells, decomposition, truth)
    call kernels%choose(nd, effects_t(friction=friction))
    physics%gravity(:) = gravity
    call set_default_laws(physics%laws, coefficients_t(friction=0.25_dp), decomposition%boundaries)
    physics%h = h
    halo%memory%n_impulse = 4
    call halo%build(decomposition)
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(size(problem%sub), size(decomposition%owned), "one problem for each subdomain")
    call check_equal(problem%n_subdomains, n_subdomains, "subdomains of the scene")
    do s = 1, size(problem%sub)
      call check_bodies(problem, s, decomposition, truth)
      call check_contacts(problem, s, truth)
      call check_sharers(problem, s, truth)
    end do
    call check_figures(problem, figures, truth)
    call check_scales(problem, truth)
    call check_velocities(decomposition, problem, physics, truth)
  end subroutine test_problem

  pure real(dp) function free_velocity(g, d, nd)
    integer, intent(in) :: g, d, nd
    free_velocity = draw(g, 6 + d) - 0.5_dp
    if (d <= nd) free_velocity = free_velocity + h*gravity(d)
  end function free_velocity

  !> The bodies of a subdomain are those that carry contacts in it, each once, then the walls.
  subroutine check_bodies(problem, s, decomposition, truth)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    type(decomposition_t), intent(in) :: decomposition
    type(truth_t), intent(in) :: truth
    integer :: b, g, d
    logical :: right

    associate (sub => problem%sub(s), kernels => problem%kernels)
      call check_equal(sub%subdomain, decomposition%first + s - 1, "number of the subdomain")
      call check_equal(sub%n_bodies, count(truth%touches(:, sub%subdomain)), "grains in contact")
      call check_equal(sub%n_grains, sub%n_bodies, "no boundary is moved by forces")
      right = size(sub%id) == sub%n_columns
      do b = sub%n_bodies + 1, sub%n_columns
        right = right .and. sub%id(b) == decomposition%boundaries(sub%boundary(b))%id
        if (b > sub%n_bodies + 1) right = right .and. sub%boundary(b) > sub%boundary(b - 1)
      end do
      g = 0
      do d = 1, n_walls
        if (any(truth%owner(:, n_grains + d) == sub%subdomain)) g = g + 1
      end do
      call check_equal(sub%n_columns - sub%n_bodies, g, "walls in contact")
      do b = 1, sub%n_bodies
        g = int(sub%id(b))
        right = right .and. truth%touches(g, sub%subdomain) .and. count(sub%id == g) == 1
        right = right .and. sub%owner(b) == truth%owned(g)
        right = right .and. sub%multiplicity(b) == count(truth%touches(g, :))
        right = right .and. abs(sub%radius(b) - truth%cloud%radius(g)) <= 0.0_dp
        ! one rounding of numbers of size 1
        right = right .and. all(abs(sub%inverse_mass(1:kernels%nd, b)*(1.0_dp + draw(g, 5)) - 1.0_dp) <= 2*epsilon(1.0_dp))
        if (kernels%nv > kernels%nd) right = right .and. &
          & abs(sub%inverse_mass(kernels%nd + 1, b)*(0.1_dp + draw(g, 6)) - 1.0_dp) <= 2*epsilon(1.0_dp)
        do d = 1, kernels%nv
          right = right .and. abs(sub%v_free(d, b) - free_velocity(g, d, kernels%nd)) <= 4*epsilon(1.0_dp)
        end do
      end do
      right = right .and. all(abs(sub%v_free(:, sub%n_bodies + 1:)) <= 0.0_dp)
      right = right .and. all(abs(sub%inverse_mass(:, sub%n_bodies + 1:)) <= 0.0_dp)
      right = right .and. size(sub%inverse_mass, 1) == kernels%nw .and. size(sub%weight, 1) == kernels%nw
      call check(right, "bodies of a subdomain")
    end associate
  end subroutine check_bodies

  !> The contacts of a subdomain are those that it owns, each once, packed as the kernels want them.
  subroutine check_contacts(problem, s, truth)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    type(truth_t), intent(in) :: truth
    logical, allocatable :: met(:, :)
    logical :: right
    integer :: c, i, j

    allocate (met(n_grains, n_grains + n_walls), source=.false.)
    right = .true.
    associate (sub => problem%sub(s))
      call check_equal(sub%n_contacts, count(truth%owner == sub%subdomain), "contacts of a subdomain")
      do c = 1, sub%n_contacts
        i = int(sub%id(sub%pair(1, c)))
        j = int(sub%id(sub%pair(2, c)))
        right = right .and. i < j .and. .not. met(i, j) .and. truth%owner(i, j) == sub%subdomain
        met(i, j) = .true.
        right = right .and. right_contact(problem, s, c, i, j, truth)
      end do
      right = right .and. maxval(abs(sub%impulse)) <= 0.0_dp .or. sub%n_contacts == 0
    end associate
    call check(right, "contacts of a subdomain as packed")
    call check_blocks(problem, s)
  end subroutine check_contacts

  !> In the blocks that are relaxed together no body occurs twice that forces move; walls may. What fills the last block is
  !> without effect.
  subroutine check_blocks(problem, s)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    integer, allocatable :: last_block(:)
    integer :: c, side
    logical :: apart, padded

    associate (sub => problem%sub(s))
      allocate (last_block(sub%n_columns), source=0)
      apart = mod(sub%n_grouped, lanes) == 0 .and. sub%n_grouped <= sub%n_contacts
      do c = 1, sub%n_grouped
        do side = 1, 2
          if (sub%pair(side, c) > sub%n_bodies) cycle
          apart = apart .and. last_block(sub%pair(side, c)) /= block_of(c)
          last_block(sub%pair(side, c)) = block_of(c)
        end do
      end do
      call check(apart, "blocks without common bodies")
      padded = size(sub%pair, 2) == lanes*n_blocks(sub%n_contacts) .and. size(sub%hot, 3) == n_blocks(sub%n_contacts)
      do c = sub%n_contacts + 1, size(sub%pair, 2)
        padded = padded .and. all(sub%pair(:, c) == 1) .and. all(abs(sub%hot(lane_of(c), :, block_of(c))) <= 0.0_dp)
      end do
      call check(padded, "the last block is filled with contacts of no effect")
      grouped = grouped + sub%n_grouped
    end associate
  end subroutine check_blocks

  !> Normal, gap, shift, levers and friction; a few roundings of numbers of size 1, of size 1/h for the shift.
  pure logical function right_contact(problem, s, c, i, j, truth) result(right)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, c, i, j
    type(truth_t), intent(in) :: truth
    real(dp), parameter :: rounding = 32*epsilon(1.0_dp)
    real(dp) :: branch(truth%nd), gap, lever, hot(problem%nh)
    integer :: nd

    nd = truth%nd
    associate (sub => problem%sub(s))
      branch(:) = truth%branch(:, i, j)
      gap = truth%gap(i, j)
      lever = 0.0_dp
      if (j <= n_grains) lever = truth%cloud%radius(j)
      hot(:) = contact_column(sub%hot, c)
      right = all(abs(hot(1:nd)*norm2(branch) - branch) <= rounding)
      right = right .and. abs(sub%gap(c) - gap) <= rounding
      right = right .and. abs(hot(nd + 1) - max(gap, 0.0_dp)/h) <= rounding/h
      if (problem%nc == 1) return
      right = right .and. abs(hot(nd + 4) - truth%cloud%radius(i)) <= 0.0_dp
      right = right .and. abs(hot(nd + 5) - lever) <= 0.0_dp
      right = right .and. abs(hot(nd + 6) - merge(0.75_dp, 0.25_dp, j > n_grains)) <= 0.0_dp
    end associate
  end function right_contact

  !> Shared bodies by ascending identifier, with all subdomains that touch them.
  subroutine check_sharers(problem, s, truth)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    type(truth_t), intent(in) :: truth
    integer :: k, j, g, n
    logical :: right

    associate (part => problem%shared%part(s), sub => problem%sub(s))
      right = part%subdomain == sub%subdomain .and. part%n_shared == count(sub%multiplicity > 1)
      do k = 1, part%n_shared
        g = int(sub%id(part%body(k)))
        if (k > 1) right = right .and. sub%id(part%body(k - 1)) < g
        n = 0
        do j = 1, problem%n_subdomains
          if (.not. truth%touches(g, j)) cycle
          right = right .and. part%sharer(part%first(k) + n) == j
          n = n + 1
        end do
        right = right .and. part%multiplicity(k) == n
      end do
      call check(right, "sharers of the shared bodies")
    end associate
  end subroutine check_sharers

  subroutine check_figures(problem, figures, truth)
    type(contact_problem_t), intent(in) :: problem
    type(interface_statistics_t), intent(in) :: figures
    type(truth_t), intent(in) :: truth
    integer(i8) :: expected(n_multiplicities)
    integer :: i, j, m, s, interactions, most, least

    expected(:) = 0
    interactions = 0
    do i = 1, n_grains
      m = min(count(truth%touches(i, :)), n_multiplicities)
      if (m > 0) expected(m) = expected(m) + 1
      do j = i + 1, n_grains
        if (truth%owner(i, j) > 0 .and. truth%owned(i) /= truth%owned(j)) interactions = interactions + 1
      end do
    end do
    most = 0
    least = huge(1)
    do s = 1, problem%n_subdomains
      most = max(most, count(truth%owner == s))
      least = min(least, count(truth%owner == s))
    end do
    call check(all(figures%multiplicity == expected), "grains by multiplicity")
    call check_equal(figures%bodies, sum(expected(2:)), "interface bodies")
    call check_equal(figures%interactions, int(interactions, i8), "interface interactions")
    call check_equal(figures%most_contacts, int(most, i8), "contacts of the fullest subdomain")
    call check_equal(figures%least_contacts, int(least, i8), "contacts of the emptiest subdomain")
    call check_equal(problem%n_contacts, int(count(truth%owner > 0), i8), "contacts of the scene")
    manifold = manifold + int(sum(expected(3:)))
  end subroutine check_figures

  !> The scales are over grains in contact: largest free speed and largest |R^d|. Some roundings of numbers below 4.
  subroutine check_scales(problem, truth)
    type(contact_problem_t), intent(in) :: problem
    type(truth_t), intent(in) :: truth
    real(dp) :: speed, fastest, strongest, v(truth%nd)
    integer :: g, d

    fastest = 0.0_dp
    strongest = 0.0_dp
    do g = 1, n_grains
      if (.not. any(truth%touches(g, :))) cycle
      do d = 1, truth%nd
        v(d) = free_velocity(g, d, truth%nd)
      end do
      speed = norm2(v)
      fastest = max(fastest, speed)
      strongest = max(strongest, speed*(1.0_dp + draw(g, 5)))
    end do
    call check_close(problem%velocity_scale, fastest, 32*epsilon(1.0_dp), "velocity scale")
    call check_close(problem%force_scale, strongest, 32*epsilon(1.0_dp), "force scale")
  end subroutine check_scales

  !> Velocities come to the owner from wherever the grain has contacts; grains without contacts fly on.
  subroutine check_velocities(decomposition, problem, physics, truth)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    type(physics_t), intent(in) :: physics
    type(truth_t), intent(in) :: truth
    integer :: s, b, d, g, nv
    logical :: right

    nv = problem%nv
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        do d = 1, nv
          problem%sub(s)%v_global(d, b) = 8*draw(int(problem%sub(s)%id(b)), 20 + d)
        end do
      end do
    end do
    call take_velocities(decomposition, physics, problem)
    right = .true.
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do b = 1, owned%n
          g = int(owned%id(b))
          if (any(truth%touches(g, :)) .and. .not. truth%touches(g, truth%owned(g))) visitors = visitors + 1
          do d = 1, nv
            if (any(truth%touches(g, :))) then
              right = right .and. abs(owned%velocity(d, b) - 8*draw(g, 20 + d)) <= 0.0_dp
            else
              right = right .and. abs(owned%velocity(d, b) - free_velocity(g, d, truth%nd)) <= 4*epsilon(1.0_dp)
            end if
          end do
        end do
      end associate
    end do
    call check(right, "velocities owned")
    visitors = int(comm%total(int(visitors, i8)))
  end subroutine check_velocities

  !> Without friction grains that turn keep their spins, bit for bit, and no spin is among the unknowns: the problem holds
  !> velocities of nd components, whatever the bodies have, and its impulses change translations.
  subroutine test_spins(nd, n_subdomains)
    integer, intent(in) :: nd, n_subdomains
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(truth_t) :: truth
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    type(nlgs_t) :: nlgs
    type(error_t), allocatable :: error
    real(dp) :: jump
    integer :: s, k, d, g, pushed
    logical :: small, kept

    call make_scene(nd, 0, n_subdomains, .true., rule_dual, .true., decomposition, truth)
    call check_equal(decomposition%nv, 3*nd - 3, "spins: bodies have them")
    call kernels%choose(nd, effects_t(friction=.false.))
    physics%gravity(:) = gravity
    physics%h = h
    halo%memory%n_impulse = 4
    call halo%build(decomposition)
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%nv, nd, "spins: unknowns of a body")
    small = .true.
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        small = small .and. size(sub%v_free, 1) == nd .and. size(sub%velocity, 1) == nd .and. size(sub%v_global, 1) == nd
        small = small .and. size(sub%reaction, 1) == nd .and. size(sub%weight, 1) == nd .and. size(sub%inverse_mass, 1) == nd
      end associate
    end do
    call check(small, "spins: none stored among the unknowns")
    call nlgs%start(problem, error)
    call nlgs%iterate(problem, .false., jump, error)
    call problem%evaluate()
    call take_velocities(decomposition, physics, problem)
    kept = .true.
    pushed = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          g = int(owned%id(k))
          do d = nd + 1, 3*nd - 3
            kept = kept .and. abs(owned%velocity(d, k) - (draw(g, 6 + d) - 0.5_dp)) <= 0.0_dp
          end do
          do d = 1, nd
            if (abs(owned%velocity(d, k) - free_velocity(g, d, nd)) > 0.01_dp) pushed = pushed + 1
          end do
        end do
      end associate
    end do
    call check(kept, "spins: the bits that they had")
    call check(comm%total(int(pushed, i8)) > n_grains, "spins: contacts push grains")
  end subroutine test_spins

  !> Without contacts: no bodies in the problem, figures of nothing, free velocities.
  subroutine test_free_flight()
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(truth_t) :: truth
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    integer :: s, k

    call make_scene(2, 0, 3, .false., rule_dual, .false., decomposition, truth)
    decomposition%rule%alert_distance = -1.0_dp
    decomposition%rule%skin = 0.0_dp
    do s = 1, size(decomposition%owned)
      decomposition%owned(s)%radius(:) = 1.0e-6_dp
    end do
    call kernels%choose(2, effects_t(friction=.false.))
    physics%gravity(:) = gravity
    physics%h = h
    halo%memory%n_impulse = 4
    call halo%build(decomposition)
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 0_i8, "flight: no contacts")
    call check(figures%bodies == 0 .and. all(figures%multiplicity == 0) .and. figures%most_contacts == 0 .and. &
      & figures%least_contacts == 0 .and. figures%interactions == 0, "flight: figures")
    call check_close(problem%force_scale, 0.0_dp, 0.0_dp, "flight: force scale")
    call take_velocities(decomposition, physics, problem)
    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        call check_close(decomposition%owned(s)%velocity(2, k), &
          & free_velocity(int(decomposition%owned(s)%id(k)), 2, 2), 4*epsilon(1.0_dp), "flight: velocity")
      end do
    end do
  end subroutine test_free_flight

  !> A grain on a turning floor with restitution, one glued to a moving boundary, one upon it, one under a lid that forces
  !> move.
  subroutine make_boundary_scene(n_subdomains, height, turning, decomposition)
    integer, intent(in) :: n_subdomains
    !> of the first grain over the floor [m]
    real(dp), intent(in) :: height
    !> the boundary of the glued grain turns too
    logical, intent(in) :: turning
    type(decomposition_t), intent(inout) :: decomposition
    type(cloud_t) :: cloud
    type(boundary_t) :: glue
    integer :: s

    call cloud%init(2, 4, 0.1_dp, 0.1_dp, 1)
    cloud%place(1, :) = [0.2_dp, 0.8_dp, 0.8_dp, 0.5_dp]
    cloud%place(2, :) = [0.1_dp, 0.1_dp, 0.29_dp, 0.8515625_dp]
    cloud%place(2, 1) = cloud%place(2, 1) + height
    decomposition%rule = cloud%rule(alert, skin, rule_dual)
    allocate (decomposition%boundaries(3))
    associate (floor => decomposition%boundaries(1), lid => decomposition%boundaries(2))
      floor = plane(11, [0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp])
      floor%drive%spin(3) = 2.0_dp
      floor%spin(3) = 2.0_dp
      floor%velocity(1) = 0.5_dp
      floor%last_velocity(2) = 0.3_dp
      floor%last_spin(3) = 1.0_dp
      floor%contact%restitution = 0.5_dp
      lid = plane(12, [0.0_dp, 0.95_dp], [0.0_dp, -1.0_dp])
      lid%free(2) = .true.
      lid%mass = 4.0_dp
      lid%velocity(2) = -0.25_dp
      lid%last_velocity(2) = -0.5_dp
      lid%contact%restitution = 0.25_dp
    end associate
    glue%id = 13
    glue%velocity(1:2) = [0.125_dp, 0.5_dp]
    glue%last_velocity(2) = -0.25_dp
    glue%contact%friction = 0.3_dp
    glue%contact%restitution = 0.5_dp
    glue%pivot(1) = 0.8_dp
    if (turning) glue%drive%spin(3) = 1.0_dp
    if (turning) glue%spin(3) = 1.0_dp
    decomposition%boundaries(3) = glue
    call make_decomposition(comm, cloud, n_subdomains, 3, .false., decomposition)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        where (owned%id == 2) owned%glued = 3
        where (owned%id == 1) owned%velocity(2, :) = -0.7_dp
        where (owned%id == 4) owned%velocity(2, :) = 0.0_dp
      end associate
    end do
    call set_glued_velocities(decomposition)
  end subroutine make_boundary_scene

  subroutine test_boundaries(n_subdomains, turning)
    integer, intent(in) :: n_subdomains
    logical, intent(in) :: turning
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    integer :: s, c
    integer(i8) :: id

    call make_boundary_scene(n_subdomains, 0.0_dp, turning, decomposition)
    call kernels%choose(2, effects_t(friction=.true.))
    call set_default_laws(physics%laws, coefficients_t(friction=0.1_dp), decomposition%boundaries)
    physics%h = h
    halo%memory%n_impulse = 2
    call halo%build(decomposition)
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 3_i8, "boundaries: contacts")
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          id = max(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
          select case (int(id))
          case (11)
            call check_floor(problem, s, c)
          case (12)
            call check_lid(problem, s, c)
          case (13)
            call check_glued(problem, s, c, turning)
          end select
          ! impulses of 2, 3, 4
          sub%impulse(lane_of(c), 1, block_of(c)) = id - 9
        end do
      end associate
    end do
    call check_loads(decomposition, problem, physics, turning)
  end subroutine test_boundaries

  !> Number 1 touches the point (0.2, 0) of the floor.
  subroutine check_floor(problem, s, c)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, c
    real(dp) :: hot(problem%nh)
    integer :: j

    associate (sub => problem%sub(s))
      j = sub%pair(2, c)
      hot(:) = contact_column(sub%hot, c)
      call check(j > sub%n_bodies, "floor: moves as prescribed")
      call check_equal(sub%boundary(j), 1, "floor: its number")
      ! the contact goes up with 0.4 m/s, for half a step
      call check_close(sub%v_free(1, j), 0.5_dp - 2.0_dp*0.5_dp*h*0.4_dp, 8*epsilon(1.0_dp), "floor: velocity along")
      call check_close(sub%v_free(2, j), 0.4_dp, 8*epsilon(1.0_dp), "floor: velocity of the point touched")
      call check_close(maxval(abs(sub%inverse_mass(:, j))), 0.0_dp, 0.0_dp, "floor: cannot be moved")
      ! e (v - v of the floor before) = 0.5 (-0.7 - 0.3 - 0.2)
      call check_close(hot(3), -0.6_dp, 8*epsilon(1.0_dp), "floor: shift of the law by restitution")
      call check_close(hot(6), 0.1_dp, 0.0_dp, "floor: lever of the grain")
      call check_close(hot(7), 0.0_dp, 0.0_dp, "floor: no lever")
    end associate
  end subroutine check_floor

  subroutine check_lid(problem, s, c)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, c
    integer :: j

    associate (sub => problem%sub(s))
      j = sub%pair(2, c)
      call check(j > sub%n_grains .and. j <= sub%n_bodies, "lid: a body")
      call check_equal(sub%boundary(j), 2, "lid: its number")
      call check_close(sub%v_free(2, j), -0.25_dp, 0.0_dp, "lid: free velocity")
      ! e (v - v of the lid before) along (0, -1)
      call check_close(sub%hot(lane_of(c), 3, block_of(c)), -0.125_dp, 8*epsilon(1.0_dp), "lid: the velocity before is sent back")
      call check_close(sub%inverse_mass(2, j), 0.25_dp, 0.0_dp, "lid: inertia of the free component")
      call check(all(abs(sub%inverse_mass([1, 3], j)) <= 0.0_dp), "lid: other components cannot move")
      call check_equal(sub%owner(j), mod(1, problem%n_subdomains) + 1, "lid: one subdomain keeps account of it")
      call check(.not. sub%moves(1, j) .and. sub%moves(2, j) .and. .not. sub%moves(3, j), "lid: what moves")
    end associate
  end subroutine check_lid

  !> The glued grain 2 is the candidate, 3 the antagonist upon it; they touch at (0.8, 0.2).
  subroutine check_glued(problem, s, c, turning)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, c
    logical, intent(in) :: turning
    real(dp) :: hot(problem%nh)
    integer :: i

    associate (sub => problem%sub(s))
      i = sub%pair(1, c)
      hot(:) = contact_column(sub%hot, c)
      call check(i > sub%n_bodies .and. sub%id(sub%pair(2, c)) == 3, "glued: its boundary is the candidate")
      call check_close(hot(2), -1.0_dp, 8*epsilon(1.0_dp), "glued: normal towards the candidate")
      call check_close(sub%gap(c), -0.01_dp, 8*epsilon(1.0_dp), "glued: gap")
      ! the two part at the start, and the boundary comes up in the step
      call check_close(hot(3), 0.0_dp, 0.0_dp, "glued: nothing is sent back where the contact closes again")
      call check_close(sub%v_free(1, i), merge(-0.075_dp, 0.125_dp, turning), 8*epsilon(1.0_dp), "glued: velocity along")
      call check_close(sub%v_free(2, i), 0.5_dp, 8*epsilon(1.0_dp), "glued: velocity")
      call check_close(hot(6), 0.0_dp, 0.0_dp, "glued: no lever")
      call check_close(hot(7), 0.1_dp, 0.0_dp, "glued: lever of the free grain")
      call check_close(hot(8), 0.3_dp, 0.0_dp, "glued: friction of the boundary")
    end associate
  end subroutine check_glued

  !> Impulses on boundaries, the velocity that one takes from them; glued grains keep and follow their boundary.
  subroutine check_loads(decomposition, problem, physics, turning)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    type(physics_t), intent(in) :: physics
    logical, intent(in) :: turning
    real(dp), allocatable :: impulses(:, :)
    real(dp), parameter :: rounding = 32*epsilon(1.0_dp)
    integer :: s, k

    call problem%evaluate()
    call sum_boundary_impulses(decomposition, problem, impulses)
    call check_close(impulses(2, 1), -2.0_dp, rounding, "impulse on the floor")
    call check_close(impulses(2, 2), 3.0_dp, rounding, "impulse on the lid")
    call check_close(impulses(2, 3), -4.0_dp, rounding, "impulse on a glued grain")
    call check_close(maxval(abs(impulses(1, :))), 0.0_dp, rounding, "no impulse along")
    call take_velocities(decomposition, physics, problem)
    call take_boundary_velocities(decomposition, impulses)
    call check_close(decomposition%boundaries(2)%velocity(2), 0.5_dp, rounding, "velocity of the lid")
    call check_close(decomposition%boundaries(1)%velocity(2), 0.0_dp, 0.0_dp, "velocity of the floor")
    call carry_glued(decomposition, 0.5_dp)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) /= 2) cycle
          call check_close(owned%velocity(1, k), merge(0.025_dp, 0.125_dp, turning), rounding, "a glued grain keeps its velocity")
          ! an arm of 0.1 m that turns by half a radian
          call check_close(owned%position(1, k), 0.8625_dp - merge(0.1_dp*sin(0.5_dp), 0.0_dp, turning), rounding, "carried, x")
          call check_close(owned%position(2, k), 0.25_dp + merge(0.1_dp*cos(0.5_dp), 0.1_dp, turning), rounding, "carried, y")
        end do
      end associate
    end do
  end subroutine check_loads

  !> With restitution a grain that does not touch within half a step has no contact; without it has.
  subroutine test_restitution_gap(n_subdomains)
    integer, intent(in) :: n_subdomains
    type(decomposition_t) :: decomposition
    type(halo_t) :: halo
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures

    call make_boundary_scene(n_subdomains, 0.01_dp, .false., decomposition)
    call kernels%choose(2, effects_t(friction=.true.))
    call set_default_laws(physics%laws, coefficients_t(), decomposition%boundaries)
    halo%memory%n_impulse = 2
    call halo%build(decomposition)
    ! 0.01 m at 1.2 m/s, 0.2 m/s of it by the spin of the floor
    physics%h = 0.017_dp
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 3_i8, "restitution: a contact that closes within half a step")
    physics%h = 0.016_dp
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 2_i8, "restitution: no contact that does not")
    call physics%laws%set_default(1, coefficients_t())
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 3_i8, "no restitution: contacts within the alert distance")
    decomposition%boundaries(1)%present = .false.
    call build_problem(decomposition, halo, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 2_i8, "a boundary that was removed has no contact")
  end subroutine test_restitution_gap

end program test_problem_builder
