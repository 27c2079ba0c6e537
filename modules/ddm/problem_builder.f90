!> From grains in their places to the packed contact problem of a step, and back to velocities.
module gravier_problem_builder
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort, argsort_rows, find_sorted
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_shared_exchange, only: shared_part_t
  use gravier_timers, only: start_timer, stop_timer, phase_neighbourhood, phase_detection, phase_interface, phase_setup
  use gravier_body_store, only: wall_set_t
  use gravier_motion, only: make_free_velocity
  use gravier_cell_grid, only: cell_grid_t
  use gravier_contact_list, only: contact_list_t
  use gravier_detection, only: detect_contacts, sort_bodies
  use gravier_contact_kernels, only: kernels_t
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_decomposition, only: decomposition_t, neighbourhood_t
  implicit none
  private
  public :: physics_t, interface_figures_t, build_problem, take_velocities, n_multiplicities

  !> What the contacts of a scene need to know.
  type :: physics_t
    !> [m/s^2], the first nd are used
    real(dp) :: gravity(3) = 0.0_dp
    !> friction coefficients between grains, and of grains on walls
    real(dp) :: friction = 0.0_dp, wall_friction = 0.0_dp
    !> step [s]
    real(dp) :: h = 1.0_dp
  end type physics_t

  !> multiplicities counted apart; the last counts that many and more
  integer, parameter :: n_multiplicities = 8

  !> The interface that a partition makes, over all subdomains.
  type :: interface_figures_t
    !> grains that carry contacts in several subdomains
    integer(i8) :: bodies = 0
    !> contacts between grains whose centres lie in different subdomains
    integer(i8) :: interactions = 0
    !> grains in contact by multiplicity
    integer(i8) :: multiplicity(n_multiplicities) = 0
    !> contacts in the fullest and the emptiest subdomain
    integer(i8) :: most_contacts = 0, least_contacts = 0
  end type interface_figures_t

contains

  !> Detect the contacts at the present places (q_m) and pack them, subdomain by subdomain. Impulses start from
  !> zero. Collective.
  subroutine build_problem(decomposition, kernels, physics, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    type(interface_figures_t), intent(out) :: figures
    type(neighbourhood_t), allocatable :: seen(:)
    type(contact_list_t) :: contacts
    type(cell_grid_t) :: grid
    integer, allocatable :: order(:), first(:)
    real(dp) :: edge
    integer :: s

    call start_timer(phase_neighbourhood)
    call decomposition%look_around(seen)
    call stop_timer(phase_neighbourhood)
    problem%comm => decomposition%comm
    problem%kernels = kernels
    problem%n_subdomains = decomposition%n_subdomains
    if (allocated(problem%sub)) deallocate (problem%sub)
    allocate (problem%sub(size(seen)))
    edge = 2.0_dp*decomposition%rule%largest_radius + decomposition%rule%alert_distance
    do s = 1, size(seen)
      call start_timer(phase_detection)
      call sort_bodies(seen(s)%bodies, edge, grid, order, first)
      call reorder(seen(s), order)
      call detect_contacts(seen(s)%bodies, grid, first, decomposition%walls, decomposition%partition, &
        & decomposition%first + s - 1, decomposition%rule, contacts)
      call stop_timer(phase_detection)
      call start_timer(phase_setup)
      problem%sub(s)%subdomain = decomposition%first + s - 1
      call pack_subproblem(seen(s), contacts, decomposition%walls, kernels, physics, problem%sub(s))
      call stop_timer(phase_setup)
    end do
    call start_timer(phase_interface)
    call find_interface(decomposition, problem)
    call count_figures(decomposition, problem, figures)
    call find_scales(problem)
    call stop_timer(phase_interface)
  end subroutine build_problem

  subroutine reorder(seen, order)
    type(neighbourhood_t), intent(inout) :: seen
    integer, intent(in), contiguous :: order(:)
    integer, allocatable :: home(:), origin(:)
    integer :: k

    call seen%bodies%reorder(order)
    call move_alloc(seen%home, home)
    call move_alloc(seen%origin, origin)
    allocate (seen%home(size(order)), seen%origin(size(order)))
    do k = 1, size(order)
      seen%home(k) = home(order(k))
      seen%origin(k) = origin(order(k))
    end do
  end subroutine reorder

  !> Number the bodies that contacts touch, in their order, and pack bodies and contacts.
  subroutine pack_subproblem(seen, contacts, walls, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: seen
    type(contact_list_t), intent(in) :: contacts
    type(wall_set_t), intent(in) :: walls
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer, allocatable :: number_of(:)
    integer :: c, k

    allocate (number_of(seen%bodies%n), source=0)
    do c = 1, contacts%n
      number_of(contacts%candidate(c)) = 1
      if (contacts%antagonist(c) > 0) number_of(contacts%antagonist(c)) = 1
    end do
    sub%n_bodies = 0
    do k = 1, seen%bodies%n
      if (number_of(k) == 0) cycle
      sub%n_bodies = sub%n_bodies + 1
      number_of(k) = sub%n_bodies
    end do
    sub%n_columns = sub%n_bodies + walls%n
    sub%n_contacts = contacts%n
    call pack_bodies(seen, number_of, walls, kernels, physics, sub)
    call pack_contacts(seen, contacts, number_of, kernels, physics, sub)
  end subroutine pack_subproblem

  subroutine pack_bodies(seen, number_of, walls, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: seen
    integer, intent(in), contiguous :: number_of(:)
    type(wall_set_t), intent(in) :: walls
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer :: k, b

    allocate (sub%id(sub%n_columns), sub%home(sub%n_bodies), sub%position(kernels%nd, sub%n_bodies))
    allocate (sub%v_free(kernels%nv, sub%n_columns), sub%velocity(kernels%nv, sub%n_columns), &
      & sub%v_global(kernels%nv, sub%n_columns), sub%reaction(kernels%nv, sub%n_columns), &
      & sub%inverse_mass(kernels%nw, sub%n_columns), sub%weight(kernels%nw, sub%n_columns), source=0.0_dp)
    allocate (sub%multiplicity(sub%n_bodies), source=1)
    do k = 1, size(number_of)
      b = number_of(k)
      if (b == 0) cycle
      sub%id(b) = seen%bodies%id(k)
      sub%home(b) = seen%home(k)
      sub%position(:, b) = seen%bodies%position(:, k)
      sub%v_free(:, b) = seen%bodies%velocity(:, k)
      call make_free_velocity(sub%v_free(:, b), physics%gravity(1:kernels%nd), physics%h)
      sub%inverse_mass(1:kernels%nd, b) = 1.0_dp/seen%bodies%mass(k)
      if (kernels%nw > kernels%nd) sub%inverse_mass(kernels%nw, b) = 1.0_dp/seen%bodies%inertia(k)
    end do
    sub%id(sub%n_bodies + 1:) = walls%id
  end subroutine pack_bodies

  subroutine pack_contacts(seen, contacts, number_of, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: seen
    type(contact_list_t), intent(in) :: contacts
    integer, intent(in), contiguous :: number_of(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer :: c, nd
    logical :: on_wall

    nd = kernels%nd
    allocate (sub%pair(2, contacts%n))
    allocate (sub%hot(kernels%nh, contacts%n), sub%impulse(kernels%nc, contacts%n), source=0.0_dp)
    allocate (sub%gap(contacts%n))
    do c = 1, contacts%n
      on_wall = contacts%antagonist(c) < 0
      sub%pair(1, c) = number_of(contacts%candidate(c))
      sub%gap(c) = contacts%gap(c)
      sub%hot(1:nd, c) = contacts%normal(:, c)
      sub%hot(nd + 1, c) = max(contacts%gap(c), 0.0_dp)/physics%h
      if (on_wall) then
        sub%pair(2, c) = sub%n_bodies - contacts%antagonist(c)
      else
        sub%pair(2, c) = number_of(contacts%antagonist(c))
      end if
      if (kernels%nc == 1) cycle
      sub%hot(nd + 4, c) = seen%bodies%radius(contacts%candidate(c))
      if (on_wall) then
        sub%hot(nd + 6, c) = physics%wall_friction
      else
        sub%hot(nd + 5, c) = seen%bodies%radius(contacts%antagonist(c))
        sub%hot(nd + 6, c) = physics%friction
      end if
    end do
  end subroutine pack_contacts

  !> Find out which subdomains hold a copy of each grain: every subdomain tells the owner of a grain that it
  !> touches it, the owner tells all of them of each other. Collective.
  subroutine find_interface(decomposition, problem)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    integer(i8), allocatable :: records(:, :), received(:, :), answers(:, :)
    integer, allocatable :: destination(:)
    type(shared_part_t), allocatable :: part(:)
    integer :: s, b, n

    n = 0
    do s = 1, size(problem%sub)
      n = n + problem%sub(s)%n_bodies
    end do
    allocate (records(2, n), destination(n))
    n = 0
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        n = n + 1
        records(1, n) = problem%sub(s)%id(b)
        records(2, n) = problem%sub(s)%subdomain
        destination(n) = decomposition%comm%rank_of(problem%sub(s)%home(b), decomposition%n_subdomains)
      end do
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    call answer_sharers(decomposition, received, answers, destination)
    call sparse_exchange(decomposition%comm, answers, destination, received)
    allocate (part(size(problem%sub)))
    call sort_out_sharers(received, problem, part)
    call problem%shared%init(decomposition%comm, part, decomposition%n_subdomains, problem%kernels%nv)
  end subroutine find_interface

  !> Of the touches (grain, subdomain) of the grains of this rank, tell each subdomain of a shared grain of all
  !> sharers: records (subdomain told, grain, sharer).
  subroutine answer_sharers(decomposition, touches, answers, destination)
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), intent(in), contiguous :: touches(:, :)
    integer(i8), allocatable, intent(out) :: answers(:, :)
    integer, allocatable, intent(out) :: destination(:)
    integer, allocatable :: order(:)
    integer :: k, last, a, b, n, round

    allocate (order(size(touches, 2)))
    call argsort_rows(touches, order)
    do round = 1, 2
      n = 0
      k = 1
      do while (k <= size(order))
        last = k
        do while (last < size(order))
          if (touches(1, order(last + 1)) /= touches(1, order(k))) exit
          last = last + 1
        end do
        if (last > k) then
          do a = k, last
            do b = k, last
              n = n + 1
              if (round == 1) cycle
              answers(1, n) = touches(2, order(a))
              answers(2, n) = touches(1, order(a))
              answers(3, n) = touches(2, order(b))
              destination(n) = decomposition%comm%rank_of(int(touches(2, order(a))), decomposition%n_subdomains)
            end do
          end do
        end if
        k = last + 1
      end do
      if (round == 1) allocate (answers(3, n), destination(n))
    end do
  end subroutine answer_sharers

  !> Write the sharers of each subdomain of this rank into its part of the exchange, by ascending identifier.
  subroutine sort_out_sharers(received, problem, part)
    !> (subdomain told, grain, sharer)
    integer(i8), intent(in), contiguous :: received(:, :)
    type(contact_problem_t), intent(inout) :: problem
    type(shared_part_t), intent(inout) :: part(:)
    integer, allocatable :: order(:)
    integer :: s, k, last

    allocate (order(size(received, 2)))
    call argsort_rows(received, order)
    k = 1
    do s = 1, size(part)
      last = k - 1
      do while (last < size(order))
        if (received(1, order(last + 1)) /= problem%sub(s)%subdomain) exit
        last = last + 1
      end do
      part(s)%subdomain = problem%sub(s)%subdomain
      call fill_part(received, order(k:last), problem%sub(s), part(s))
      k = last + 1
    end do
  end subroutine sort_out_sharers

  subroutine fill_part(received, order, sub, part)
    integer(i8), intent(in), contiguous :: received(:, :)
    !> places in `received` of the records of this subdomain, by grain and sharer
    integer, intent(in), contiguous :: order(:)
    type(subproblem_t), intent(inout) :: sub
    type(shared_part_t), intent(inout) :: part
    integer, allocatable :: by_id(:)
    integer(i8), allocatable :: sorted_id(:)
    integer(i8) :: id
    integer :: k, b

    allocate (by_id(sub%n_bodies), sorted_id(sub%n_bodies))
    call argsort(sub%id(1:sub%n_bodies), by_id)
    do b = 1, sub%n_bodies
      sorted_id(b) = sub%id(by_id(b))
    end do
    allocate (part%body(size(order)), part%first(size(order) + 1), part%sharer(size(order)))
    part%n_shared = 0
    id = -1
    do k = 1, size(order)
      if (received(2, order(k)) /= id) then
        id = received(2, order(k))
        part%n_shared = part%n_shared + 1
        part%body(part%n_shared) = by_id(find_sorted(sorted_id, id))
        part%first(part%n_shared) = k
      end if
      part%sharer(k) = int(received(3, order(k)))
    end do
    part%first(part%n_shared + 1) = size(order) + 1
    do k = 1, part%n_shared
      sub%multiplicity(part%body(k)) = part%first(k + 1) - part%first(k)
    end do
  end subroutine fill_part

  !> Count the interface. Each grain is counted in the first of the subdomains that share it. Collective.
  subroutine count_figures(decomposition, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    type(interface_figures_t), intent(out) :: figures
    integer(i8) :: counts(n_multiplicities + 2)
    real(dp) :: extremes(2)
    logical, allocatable :: counted_elsewhere(:)
    integer :: s, b, c, k, m

    counts(:) = 0
    extremes(1) = 0.0_dp
    extremes(2) = -huge(1.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => problem%shared%part(s))
        allocate (counted_elsewhere(sub%n_bodies), source=.false.)
        do k = 1, part%n_shared
          counted_elsewhere(part%body(k)) = part%rung(k) > 1
        end do
        do b = 1, sub%n_bodies
          if (counted_elsewhere(b)) cycle
          m = min(sub%multiplicity(b), n_multiplicities)
          counts(m) = counts(m) + 1
        end do
        do c = 1, sub%n_contacts
          if (sub%pair(2, c) > sub%n_bodies) cycle
          if (sub%home(sub%pair(1, c)) /= sub%home(sub%pair(2, c))) counts(n_multiplicities + 1) = counts(n_multiplicities + 1) + 1
        end do
        counts(n_multiplicities + 2) = counts(n_multiplicities + 2) + sub%n_contacts
        extremes(1) = max(extremes(1), real(sub%n_contacts, dp))
        extremes(2) = max(extremes(2), -real(sub%n_contacts, dp))
        deallocate (counted_elsewhere)
      end associate
    end do
    call decomposition%comm%sum_counts(counts)
    call decomposition%comm%highest_of(extremes)
    figures%multiplicity(:) = counts(1:n_multiplicities)
    figures%bodies = sum(counts(2:n_multiplicities))
    figures%interactions = counts(n_multiplicities + 1)
    figures%most_contacts = nint(extremes(1), i8)
    figures%least_contacts = nint(-extremes(2), i8)
    problem%n_contacts = counts(n_multiplicities + 2)
  end subroutine count_figures

  !> Scales of the residual and of the jump: largest |R^d|, over the components that can move, and largest free speed of a
  !> body in contact. Collective.
  subroutine find_scales(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: scales(2), moving(problem%kernels%nd)
    integer :: s, b, d, nd

    nd = problem%kernels%nd
    scales(:) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_bodies
          scales(2) = max(scales(2), norm2(sub%v_free(1:nd, b)))
          moving(:) = sub%v_free(1:nd, b)
          do d = 1, nd
            if (.not. sub%moves(d, b)) moving(d) = 0.0_dp
          end do
          ! all components that move have the same mass
          if (any(sub%inverse_mass(1:nd, b) > 0.0_dp)) scales(1) = max(scales(1), &
            & norm2(moving)/maxval(sub%inverse_mass(1:nd, b)))
        end do
      end associate
    end do
    call problem%comm%highest_of(scales)
    problem%force_scale = scales(1)
    problem%velocity_scale = scales(2)
  end subroutine find_scales

  !> Velocities at the end of the step: those of the solved problem (v_global) for grains in contact, free ones for
  !> the others. A shared grain whose owner has no contact on it gets its velocity from its first sharer. Collective.
  subroutine take_velocities(decomposition, physics, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(in) :: problem
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: s, k, d, h

    do s = 1, size(decomposition%home)
      associate (home => decomposition%home(s))
        do k = 1, home%n
          call make_free_velocity(home%velocity(:, k), physics%gravity(1:home%nd), physics%h)
        end do
      end associate
    end do
    call list_returns(decomposition, problem, records, destination)
    call sparse_exchange(decomposition%comm, records, destination, received)
    do k = 1, size(received, 2)
      h = int(received(1, k)) - decomposition%first + 1
      associate (home => decomposition%home(h))
        s = find_sorted(home%id, received(2, k))
        do d = 1, home%nv
          home%velocity(d, s) = transfer(received(2 + d, k), 0.0_dp)
        end do
      end associate
    end do
  end subroutine take_velocities

  !> Records (owner, grain, velocity) of the grains in contact, one per grain: from its owner where that is a
  !> sharer, else from the first sharer.
  subroutine list_returns(decomposition, problem, records, destination)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer, allocatable, intent(out) :: destination(:)
    logical, allocatable :: sends(:)
    integer :: s, b, k, d, n, round

    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s), part => problem%shared%part(s))
          allocate (sends(sub%n_bodies), source=.true.)
          do k = 1, part%n_shared
            b = part%body(k)
            sends(b) = sub%home(b) == sub%subdomain
            if (part%rung(k) == 1) sends(b) = sends(b) .or. &
              & .not. any(part%sharer(part%first(k):part%first(k + 1) - 1) == sub%home(b))
          end do
          do b = 1, sub%n_bodies
            if (.not. sends(b)) cycle
            n = n + 1
            if (round == 1) cycle
            destination(n) = decomposition%comm%rank_of(sub%home(b), decomposition%n_subdomains)
            records(1, n) = sub%home(b)
            records(2, n) = sub%id(b)
            do d = 1, problem%kernels%nv
              records(2 + d, n) = transfer(sub%v_global(d, b), 0_i8)
            end do
          end do
          deallocate (sends)
        end associate
      end do
      if (round == 1) allocate (records(2 + problem%kernels%nv, n), destination(n))
    end do
  end subroutine list_returns

end module gravier_problem_builder
