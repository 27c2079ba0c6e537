!> From grains to the packed contact problem, and back: against the comparison of all pairs, which every rank can make,
!> places and velocities following from identifiers.
program test_problem_builder
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_set_t
  use gravier_detection, only: owner_point, rule_dual, rule_primal
  use gravier_contact_kernels, only: kernels_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_partition, only: choose_boxes
  use gravier_decomposition, only: decomposition_t
  use gravier_problem_builder, only: physics_t, interface_figures_t, build_problem, take_velocities, n_multiplicities
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 130, n_walls = 2
  real(dp), parameter :: alert = 0.03_dp, h = 0.125_dp
  real(dp), parameter :: gravity(3) = [0.5_dp, -3.0_dp, -7.0_dp]

  !> What brute force knows of a scene.
  type :: truth_t
    integer :: nd = 2
    real(dp) :: radius(n_grains) = 0.0_dp
    !> (nd, n_grains)
    real(dp), allocatable :: place(:, :)
    !> subdomain of the centre of each grain
    integer :: home(n_grains) = 0
    !> owner of the contact of grain i (lower) and grain j, or wall j - n_grains; 0 where there is none
    integer, allocatable :: owner(:, :)
    !> whether grain i carries a contact in subdomain s (n_grains, n_subdomains)
    logical, allocatable :: touches(:, :)
  end type truth_t

  type(communicator_t), target :: comm
  integer :: nd, k, visitors, manifold
  integer, parameter :: counts(*) = [1, 3, 7, 16]

  call start_parallel()
  call comm%init()
  visitors = 0
  manifold = 0
  do nd = 2, 3
    do k = 1, size(counts)
      call test_problem(nd, counts(k), .true., rule_dual, .false.)
      call test_problem(nd, counts(k), .true., rule_dual, .true.)
      call test_problem(nd, counts(k), .false., rule_dual, .false.)
      call test_problem(nd, counts(k), .true., rule_primal, .true.)
    end do
  end do
  call check(manifold > 0, "some grains are in three subdomains and more")
  call check(visitors > 0, "some shared grains carry no contact at home")
  call test_free_flight()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Component `i` of what grain `g` has.
  pure real(dp) function draw(g, i)
    integer, intent(in) :: g, i
    draw = hash_uniform(4, int(g, i8), i)
  end function draw

  subroutine make_scene(nd, n_subdomains, rotation, kind, by_cells, decomposition, truth)
    integer, intent(in) :: nd, n_subdomains, kind
    logical, intent(in) :: rotation, by_cells
    type(decomposition_t), intent(out) :: decomposition
    type(truth_t), intent(out) :: truth
    type(body_set_t) :: newcomers(1)
    type(error_t), allocatable :: error
    real(dp) :: lower(nd), upper(nd)
    integer, allocatable :: weights(:)
    integer :: boxes(3), g, d, nv

    nv = merge(3*nd - 3, nd, rotation)
    truth%nd = nd
    allocate (truth%place(nd, n_grains))
    do g = 1, n_grains
      truth%radius(g) = 0.03_dp + 0.09_dp*draw(g, 1)**2
      do d = 1, nd
        truth%place(d, g) = draw(g, 1 + d)
      end do
    end do
    call decomposition%init(comm, n_subdomains, nd, nv)
    decomposition%rule%alert_distance = alert
    decomposition%rule%largest_radius = maxval(truth%radius)
    decomposition%rule%kind = kind
    call make_grains(truth, nv, newcomers(1))
    call decomposition%bounding_box(newcomers, lower, upper)
    if (by_cells) then
      allocate (weights(newcomers(1)%n), source=1)
      call decomposition%partition%init_graph(comm, lower, upper, 0.15_dp, newcomers(1)%position, weights, n_subdomains, error)
    else
      boxes(:) = choose_boxes(lower, upper, n_subdomains)
      call decomposition%partition%init_grid(lower, upper, boxes, 0.1_dp, error)
    end if
    call check(.not. allocated(error), "partition")
    associate (walls => decomposition%walls)
      walls%n = n_walls
      allocate (walls%id(n_walls))
      allocate (walls%point(nd, n_walls), walls%normal(nd, n_walls), source=0.0_dp)
      walls%id(1) = n_grains + 1
      walls%id(2) = n_grains + 2
      walls%normal(nd, 1) = 1.0_dp
      walls%normal(1, 2) = -1.0_dp
      walls%point(1, 2) = 1.0_dp
    end associate
    call decomposition%settle(newcomers(1))
    call find_truth(decomposition, truth)
  end subroutine make_scene

  !> The grains that this rank brings.
  subroutine make_grains(truth, nv, bodies)
    type(truth_t), intent(in) :: truth
    integer, intent(in) :: nv
    type(body_set_t), intent(inout) :: bodies
    integer :: g, d, n

    call bodies%init(truth%nd, nv, (n_grains + comm%size - 1 - comm%rank)/comm%size)
    n = 0
    do g = comm%rank + 1, n_grains, comm%size
      n = n + 1
      bodies%id(n) = g
      bodies%position(:, n) = truth%place(:, g)
      bodies%radius(n) = truth%radius(g)
      bodies%mass(n) = 1.0_dp + draw(g, 5)
      bodies%inertia(n) = 0.1_dp + draw(g, 6)
      do d = 1, nv
        bodies%velocity(d, n) = draw(g, 6 + d) - 0.5_dp
      end do
    end do
  end subroutine make_grains

  subroutine find_truth(decomposition, truth)
    type(decomposition_t), intent(in) :: decomposition
    type(truth_t), intent(inout) :: truth
    integer :: i, j
    real(dp), dimension(truth%nd) :: foot, point
    real(dp) :: reach
    logical :: near

    allocate (truth%owner(n_grains, n_grains + n_walls), source=0)
    allocate (truth%touches(n_grains, decomposition%n_subdomains), source=.false.)
    do i = 1, n_grains
      truth%home(i) = decomposition%partition%owner(truth%place(:, i))
      do j = i + 1, n_grains + n_walls
        reach = truth%radius(i) + alert
        foot(:) = truth%place(:, i)
        if (j == n_grains + 1) then
          foot(truth%nd) = 0.0_dp
        else if (j == n_grains + 2) then
          foot(1) = 1.0_dp
        else
          reach = reach + truth%radius(min(j, n_grains))
          foot(:) = truth%place(:, min(j, n_grains))
        end if
        near = norm2(truth%place(:, i) - foot) <= reach
        if (.not. near) cycle
        point(:) = owner_point(decomposition%rule%kind, truth%place(:, i), foot, j > n_grains)
        truth%owner(i, j) = decomposition%partition%owner(point)
        truth%touches(i, truth%owner(i, j)) = .true.
        if (j <= n_grains) truth%touches(j, truth%owner(i, j)) = .true.
      end do
    end do
  end subroutine find_truth

  subroutine test_problem(nd, n_subdomains, friction, kind, by_cells)
    integer, intent(in) :: nd, n_subdomains, kind
    logical, intent(in) :: friction, by_cells
    type(decomposition_t), target :: decomposition
    type(truth_t) :: truth
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_figures_t) :: figures
    integer :: s

    call make_scene(nd, n_subdomains, friction, kind, by_cells, decomposition, truth)
    call kernels%choose(nd, friction, friction)
    physics%gravity(:) = gravity
    physics%friction = 0.25_dp
    physics%wall_friction = 0.75_dp
    physics%h = h
    call build_problem(decomposition, kernels, physics, problem, figures)
    call check_equal(size(problem%sub), size(decomposition%home), "one problem for each subdomain")
    call check_equal(problem%n_subdomains, n_subdomains, "subdomains of the scene")
    do s = 1, size(problem%sub)
      call check_bodies(problem, s, decomposition, truth)
      call check_contacts(problem, s, decomposition, truth)
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
      call check_equal(sub%n_columns, sub%n_bodies + n_walls, "grains and walls")
      right = all(sub%id(sub%n_bodies + 1:) == decomposition%walls%id)
      do b = 1, sub%n_bodies
        g = int(sub%id(b))
        right = right .and. truth%touches(g, sub%subdomain) .and. count(sub%id == g) == 1
        right = right .and. sub%home(b) == truth%home(g)
        right = right .and. sub%multiplicity(b) == count(truth%touches(g, :))
        right = right .and. all(abs(sub%position(:, b) - truth%place(:, g)) <= 0.0_dp)
        ! one rounding of numbers of size 1
        right = right .and. all(abs(sub%inverse_mass(1:kernels%nd, b)*(1.0_dp + draw(g, 5)) - 1.0_dp) <= 2*epsilon(1.0_dp))
        if (kernels%nv > kernels%nd) right = right .and. &
          & abs(sub%inverse_mass(kernels%nd + 1, b)*(0.1_dp + draw(g, 6)) - 1.0_dp) <= 2*epsilon(1.0_dp)
        do d = 1, kernels%nv
          right = right .and. abs(sub%v_free(d, b) - free_velocity(g, d, kernels%nd)) <= 4*epsilon(1.0_dp)
        end do
      end do
      right = right .and. maxval(abs(sub%v_free(:, sub%n_bodies + 1:))) <= 0.0_dp
      right = right .and. maxval(abs(sub%inverse_mass(:, sub%n_bodies + 1:))) <= 0.0_dp
      right = right .and. size(sub%inverse_mass, 1) == kernels%nw .and. size(sub%weight, 1) == kernels%nw
      call check(right, "bodies of a subdomain")
    end associate
  end subroutine check_bodies

  !> The contacts of a subdomain are those that it owns, each once, packed as the kernels want them.
  subroutine check_contacts(problem, s, decomposition, truth)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    type(decomposition_t), intent(in) :: decomposition
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
        right = right .and. right_contact(problem, s, c, i, j, decomposition, truth)
      end do
      right = right .and. maxval(abs(sub%impulse)) <= 0.0_dp .or. sub%n_contacts == 0
    end associate
    call check(right, "contacts of a subdomain as packed")
  end subroutine check_contacts

  !> Normal, gap, shift, levers and friction; a few roundings of numbers of size 1, of size 1/h for the shift.
  pure logical function right_contact(problem, s, c, i, j, decomposition, truth) result(right)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, c, i, j
    type(decomposition_t), intent(in) :: decomposition
    type(truth_t), intent(in) :: truth
    real(dp), parameter :: rounding = 32*epsilon(1.0_dp)
    real(dp) :: branch(truth%nd), gap, lever
    integer :: nd

    nd = truth%nd
    associate (sub => problem%sub(s))
      if (j > n_grains) then
        branch(:) = decomposition%walls%normal(:, j - n_grains)
        gap = dot_product(truth%place(:, i) - decomposition%walls%point(:, j - n_grains), branch) - truth%radius(i)
        right = all(abs(sub%hot(1:nd, c) - branch) <= 0.0_dp)
        lever = 0.0_dp
      else
        branch(:) = truth%place(:, i) - truth%place(:, j)
        gap = norm2(branch) - truth%radius(i) - truth%radius(j)
        right = all(abs(sub%hot(1:nd, c)*norm2(branch) - branch) <= rounding)
        lever = truth%radius(j)
      end if
      right = right .and. abs(sub%gap(c) - gap) <= rounding
      right = right .and. abs(sub%hot(nd + 1, c) - max(gap, 0.0_dp)/h) <= rounding/h
      if (problem%kernels%nc == 1) return
      right = right .and. abs(sub%hot(nd + 4, c) - truth%radius(i)) <= 0.0_dp
      right = right .and. abs(sub%hot(nd + 5, c) - lever) <= 0.0_dp
      right = right .and. abs(sub%hot(nd + 6, c) - merge(0.75_dp, 0.25_dp, j > n_grains)) <= 0.0_dp
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
    type(interface_figures_t), intent(in) :: figures
    type(truth_t), intent(in) :: truth
    integer(i8) :: expected(n_multiplicities)
    integer :: i, j, m, s, interactions, most, least

    expected(:) = 0
    interactions = 0
    do i = 1, n_grains
      m = min(count(truth%touches(i, :)), n_multiplicities)
      if (m > 0) expected(m) = expected(m) + 1
      do j = i + 1, n_grains
        if (truth%owner(i, j) > 0 .and. truth%home(i) /= truth%home(j)) interactions = interactions + 1
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

  !> Velocities come home from wherever the grain has contacts; grains without contacts fly on.
  subroutine check_velocities(decomposition, problem, physics, truth)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    type(physics_t), intent(in) :: physics
    type(truth_t), intent(in) :: truth
    integer :: s, b, d, g, nv
    logical :: right

    nv = problem%kernels%nv
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        do d = 1, nv
          problem%sub(s)%v_global(d, b) = 8*draw(int(problem%sub(s)%id(b)), 20 + d)
        end do
      end do
    end do
    call take_velocities(decomposition, physics, problem)
    right = .true.
    do s = 1, size(decomposition%home)
      associate (home => decomposition%home(s))
        do b = 1, home%n
          g = int(home%id(b))
          if (any(truth%touches(g, :)) .and. .not. truth%touches(g, truth%home(g))) visitors = visitors + 1
          do d = 1, nv
            if (any(truth%touches(g, :))) then
              right = right .and. abs(home%velocity(d, b) - 8*draw(g, 20 + d)) <= 0.0_dp
            else
              right = right .and. abs(home%velocity(d, b) - free_velocity(g, d, truth%nd)) <= 4*epsilon(1.0_dp)
            end if
          end do
        end do
      end associate
    end do
    call check(right, "velocities at home")
    visitors = int(comm%total(int(visitors, i8)))
  end subroutine check_velocities

  !> Without contacts: no bodies in the problem, figures of nothing, free velocities.
  subroutine test_free_flight()
    type(decomposition_t), target :: decomposition
    type(truth_t) :: truth
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_figures_t) :: figures
    integer :: s, k

    call make_scene(2, 3, .false., rule_dual, .false., decomposition, truth)
    decomposition%rule%alert_distance = -1.0_dp
    do s = 1, size(decomposition%home)
      decomposition%home(s)%radius(:) = 1.0e-6_dp
    end do
    call kernels%choose(2, .false., .false.)
    physics%gravity(:) = gravity
    physics%h = h
    call build_problem(decomposition, kernels, physics, problem, figures)
    call check_equal(problem%n_contacts, 0_i8, "flight: no contacts")
    call check(figures%bodies == 0 .and. all(figures%multiplicity == 0) .and. figures%most_contacts == 0 .and. &
      & figures%least_contacts == 0 .and. figures%interactions == 0, "flight: figures")
    call check_close(problem%force_scale, 0.0_dp, 0.0_dp, "flight: force scale")
    call take_velocities(decomposition, physics, problem)
    do s = 1, size(decomposition%home)
      do k = 1, decomposition%home(s)%n
        call check_close(decomposition%home(s)%velocity(2, k), &
          & free_velocity(int(decomposition%home(s)%id(k)), 2, 2), 4*epsilon(1.0_dp), "flight: velocity")
      end do
    end do
  end subroutine test_free_flight

end program test_problem_builder
