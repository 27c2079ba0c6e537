!> From grains in their places to the packed contact problem of a step, and back to velocities.
module gravier_problem_builder
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort, argsort_rows, find_sorted
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_shared_exchange, only: shared_part_t
  use gravier_timers, only: start_timer, stop_timer, phase_detection, phase_interface, phase_setup
  use gravier_periodic, only: period_t, shift_of_code
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_motion, only: grain_volume
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_contact_law, only: contact_pair_t, contact_terms_t
  use gravier_law_set, only: law_set_t
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, block_of, lane_of, contact_jacobian, rolling_radius
  use gravier_sweep_order, only: group_contacts
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_neighbourhood, only: neighbourhood_t, neighbourhoods_t
  use gravier_pair_laws, only: boundary_of, law_of, evaluate_pair
  implicit none
  private
  public :: physics_t, interface_figures_t, build_problem, take_velocities, take_displacements, n_multiplicities

  !> What acts on the grains of a scene.
  type :: physics_t
    !> at the present time [m/s^2], the first nd are used
    real(dp) :: gravity(3) = 0.0_dp
    !> on the volume of grains [N/m^3, N/m^2 in 2D]
    real(dp) :: body_force(3) = 0.0_dp
    !> friction and normal restitution between grains; boundaries have their own
    real(dp) :: friction = 0.0_dp, restitution = 0.0_dp
    !> tangential restitution, rolling and pivoting friction, likewise
    real(dp) :: tangential_restitution = 0.0_dp, rolling_friction = 0.0_dp, pivoting_friction = 0.0_dp
    !> laws of pairs of materials, which take their place
    type(law_set_t) :: laws
    !> the step is the first of the run
    logical :: first = .false.
    !> grains turn
    logical :: rotation = .true.
    !> step [s]
    real(dp) :: h = 1.0_dp
    !> steps at rest after which a contact sleeps, see gravier_sleeping; 0: none does
    integer :: sleep_after = 0
  contains
    procedure :: accelerate => physics_accelerate
  end type physics_t

  !> multiplicities counted apart; the last counts that many and more
  integer, parameter :: n_multiplicities = 8

  !> The interface that a partition makes, over all subdomains.
  type :: interface_figures_t
    !> bodies that carry contacts in several subdomains
    integer(i8) :: bodies = 0
    !> contacts between grains whose centres lie in different subdomains
    integer(i8) :: interactions = 0
    !> bodies in contact by multiplicity
    integer(i8) :: multiplicity(n_multiplicities) = 0
    !> contacts in the fullest and the emptiest subdomain
    integer(i8) :: most_contacts = 0, least_contacts = 0
    !> what one exchange takes, were every subdomain on a rank of its own: messages and numbers of all subdomains together,
    !> and of those with most
    integer(i8) :: neighbours = 0, values = 0, most_neighbours = 0, most_values = 0
    !> ghosts of all subdomains
    integer(i8) :: ghosts = 0
  end type interface_figures_t

  !> Gaps and normals of the pairs of a list that are contacts.
  type :: found_t
    integer :: n = 0
    !> those that do not sleep: the first ones, in whole blocks where others follow
    integer :: n_awake = 0
    !> place in the list (n)
    integer, allocatable :: source(:)
    !> (n) [m], (nd, n)
    real(dp), allocatable :: gap(:), normal(:, :)
    !> where a law is given (n)
    type(contact_terms_t), allocatable :: terms(:)
  end type found_t

  !> Columns of a subproblem by what else is known of a body.
  type :: columns_t
    !> column of each grain at home in the subdomain, 0 where no contact touches it
    integer, allocatable :: at_home(:)
    !> columns of the other bodies, and their identifiers, ascending
    integer, allocatable :: away(:)
    integer(i8), allocatable :: away_id(:)
  contains
    procedure :: init => columns_init
  end type columns_t

contains

  !> Turn the velocity of grain `k` at the start of a step into that without contacts, M^-1 R^d = V_i + h M^-1 F
  !> (paper, (1)); no force here turns a grain.
  pure subroutine physics_accelerate(self, bodies, k, v)
    class(physics_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nv)
    real(dp), intent(inout) :: v(:)
    integer :: d

    do d = 1, bodies%nd
      v(d) = v(d) + self%h*self%gravity(d)
    end do
    if (.not. any(abs(self%body_force) > 0.0_dp)) return
    do d = 1, bodies%nd
      v(d) = v(d) + self%h*self%body_force(d)*grain_volume(bodies%nd, bodies%radius(k))/bodies%mass(k)
    end do
  end subroutine physics_accelerate

  !> Find the contacts among the near pairs at the present places (q_m) and pack them, subdomain by subdomain. Impulses
  !> start from zero. Boundaries hold the velocities that they have at the end of the step as far as no contact acts on
  !> them. Collective.
  subroutine build_problem(decomposition, neighbourhoods, kernels, physics, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    !> states of pairs are those of the step afterwards
    type(neighbourhoods_t), intent(inout) :: neighbourhoods
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    type(interface_figures_t), intent(out) :: figures
    type(found_t) :: found
    integer :: s

    problem%comm => decomposition%comm
    problem%kernels = kernels
    problem%n_subdomains = decomposition%n_subdomains
    if (allocated(problem%sub)) deallocate (problem%sub)
    allocate (problem%sub(size(neighbourhoods%view)))
    do s = 1, size(problem%sub)
      associate (view => neighbourhoods%view(s))
        call start_timer(phase_detection)
        call find_contacts(view, decomposition, physics, found)
        found%n_awake = found%n
        if (physics%sleep_after > 0) call put_sleepers_last(view, decomposition%boundaries, physics%sleep_after, found)
        call stop_timer(phase_detection)
        call start_timer(phase_setup)
        problem%sub(s)%subdomain = decomposition%subdomain_of(s)
        call pack_subproblem(view, found, decomposition, kernels, physics, problem%sub(s))
        call stop_timer(phase_setup)
      end associate
    end do
    call start_timer(phase_interface)
    call find_interface(decomposition, problem)
    call count_figures(decomposition, neighbourhoods, problem, figures)
    if (physics%laws%attracts) call problem%load_attraction()
    call find_scales(problem)
    call stop_timer(phase_interface)
  end subroutine build_problem

  !> Narrow phase: gaps and normals of the near pairs, of which those within the alert distance are contacts. A law with
  !> restitution acts from the moment of touching on (Moreau 1988), so that its contacts have no positive gap.
  subroutine find_contacts(view, decomposition, physics, found)
    type(neighbourhood_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(found_t), intent(inout) :: found
    integer :: p, i, j, nd
    real(dp) :: branch(decomposition%nd), normal(decomposition%nd), distance, gap, alert
    type(contact_terms_t) :: terms

    nd = decomposition%nd
    if (allocated(found%source)) deallocate (found%source, found%gap, found%normal, found%terms)
    allocate (found%source(view%list%n), found%gap(view%list%n), found%normal(nd, view%list%n))
    allocate (found%terms(merge(view%list%n, 0, physics%laws%n > 0)))
    found%n = 0
    alert = decomposition%rule%alert_distance
    do p = 1, view%list%n
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      if (j > 0) then
        branch(:) = view%bodies%position(:, i) - view%bodies%position(:, j)
        if (size(view%list%shift) > 0) call shift_back(decomposition%period, view%list%shift(p), branch)
        distance = norm2(branch)
        gap = distance - view%bodies%radius(i) - view%bodies%radius(j)
        if (is_far()) cycle
        if (distance > 0.0_dp) then
          normal(:) = branch/distance
        else
          ! coincident centres have no normal: take the vertical, so that the law can part them
          normal(:) = 0.0_dp
          normal(nd) = 1.0_dp
        end if
      else
        if (.not. decomposition%boundaries(-j)%present) cycle
        call decomposition%boundaries(-j)%locate(view%bodies%position(:, i), distance, normal)
        gap = distance - view%bodies%radius(i)
        if (is_far()) cycle
      end if
      call find_terms()
      if (is_far()) cycle
      if (gap > 0.0_dp .and. (terms%restitution > 0.0_dp .or. terms%tangential_restitution > 0.0_dp)) cycle
      found%n = found%n + 1
      found%source(found%n) = p
      found%gap(found%n) = gap
      found%normal(:, found%n) = normal
      if (size(found%terms) > 0) found%terms(found%n) = terms
    end do

  contains

    !> Whether the pair is no contact: beyond the alert distance, and with nothing to remember.
    logical function is_far()
      is_far = gap > alert
      if (is_far .and. size(view%list%state) > 0) is_far = view%list%state(p) == 0
    end function is_far

    subroutine find_terms()
      type(contact_pair_t) :: pair
      integer :: l

      l = law_of(view, decomposition%boundaries, physics%laws, p)
      if (l == 0) then
        terms = scene_terms(view, decomposition%boundaries, physics, p, gap)
        return
      end if
      pair%first = physics%first
      pair%gap = gap
      if (size(view%list%state) > 0) pair%state = view%list%state(p)
      call evaluate_pair(view, decomposition%boundaries, physics%laws, l, p, normal, pair)
      if (size(view%list%state) > 0) view%list%state(p) = pair%state
      terms = pair%terms
    end subroutine find_terms

  end subroutine find_contacts

  !> Put the contacts that have been at rest for `after` steps behind the others; so many of them stay before that these fill
  !> whole blocks. A contact with a boundary that moves as prescribed does not sleep.
  subroutine put_sleepers_last(view, boundaries, after, found)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: after
    type(found_t), intent(inout) :: found
    type(found_t) :: old
    logical, allocatable :: asleep(:)
    integer :: c, b, n, round

    allocate (asleep(found%n))
    do c = 1, found%n
      asleep(c) = view%list%impulse(size(view%list%impulse, 1), found%source(c)) >= after
      b = boundary_of(view, found%source(c))
      if (b > 0) asleep(c) = asleep(c) .and. .not. boundaries(b)%is_moved()
    end do
    found%n_awake = min(found%n, lanes*n_blocks(count(.not. asleep)))
    n = found%n_awake - count(.not. asleep)
    do c = 1, found%n
      if (n == 0) exit
      if (.not. asleep(c)) cycle
      asleep(c) = .false.
      n = n - 1
    end do
    if (found%n_awake == found%n) return
    old = found
    n = 0
    do round = 1, 2
      do c = 1, found%n
        if (asleep(c) .neqv. round == 2) cycle
        n = n + 1
        found%source(n) = old%source(c)
        found%gap(n) = old%gap(c)
        found%normal(:, n) = old%normal(:, c)
        if (size(old%terms) > 0) found%terms(n) = old%terms(c)
      end do
    end do
  end subroutine put_sleepers_last

  !> Take the shift of the antagonist into account in the way from it to the candidate.
  pure subroutine shift_back(period, code, branch)
    type(period_t), intent(in) :: period
    integer, intent(in) :: code
    !> (nd) [m]
    real(dp), intent(inout) :: branch(:)
    integer :: shift(3), d

    shift(:) = shift_of_code(code)
    do d = 1, size(branch)
      branch(d) = branch(d) - shift(d)*period%length(d)
    end do
  end subroutine shift_back

  !> The terms of pair `p` where no law is given: the scene's values, or those of the boundary that takes part.
  pure type(contact_terms_t) function scene_terms(view, boundaries, physics, p, gap) result(terms)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: p
    !> [m]
    real(dp), intent(in) :: gap
    integer :: b

    b = boundary_of(view, p)
    terms%play = max(gap, 0.0_dp)
    terms%friction = physics%friction
    terms%restitution = physics%restitution
    terms%tangential_restitution = physics%tangential_restitution
    terms%rolling = physics%rolling_friction
    terms%pivoting = physics%pivoting_friction
    if (b > 0) then
      terms%friction = boundaries(b)%friction
      terms%restitution = boundaries(b)%restitution
      terms%tangential_restitution = boundaries(b)%tangential_restitution
      terms%rolling = boundaries(b)%rolling_friction
      terms%pivoting = boundaries(b)%pivoting_friction
    end if
    ! friction alone can send a tangential velocity back
    if (.not. terms%friction > 0.0_dp) terms%tangential_restitution = 0.0_dp
  end function scene_terms

  !> Number the bodies that contacts touch and pack bodies and contacts. Free grains come first, in the order in which contacts
  !> meet them, so that a sweep walks through memory (number_shared_first then puts shared ones before the others); then
  !> boundaries that forces move, then columns of bodies with prescribed velocities: one a boundary, or one a contact where
  !> the boundary turns.
  subroutine pack_subproblem(view, found, decomposition, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: view
    type(found_t), intent(in) :: found
    type(decomposition_t), intent(in) :: decomposition
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer, allocatable :: number_of(:), column_of(:)
    integer :: c, p, b, n

    associate (list => view%list, boundaries => decomposition%boundaries)
      allocate (number_of(view%bodies%n), column_of(size(boundaries)), source=0)
      n = 0
      sub%n_grains = 0
      do c = 1, found%n
        p = found%source(c)
        call number(list%candidate(p))
        if (list%antagonist(p) > 0) call number(list%antagonist(p))
        b = boundary_of(view, p)
        if (b == 0) cycle
        column_of(b) = 1
        if (boundaries(b)%turns()) n = n + 1
      end do
      sub%n_contacts = found%n
      sub%n_bodies = sub%n_grains
      do b = 1, size(boundaries)
        if (column_of(b) == 0 .or. .not. boundaries(b)%is_driven()) cycle
        sub%n_bodies = sub%n_bodies + 1
        column_of(b) = sub%n_bodies
      end do
      sub%n_columns = sub%n_bodies
      do b = 1, size(boundaries)
        if (column_of(b) == 0 .or. boundaries(b)%is_driven() .or. boundaries(b)%turns()) cycle
        sub%n_columns = sub%n_columns + 1
        column_of(b) = sub%n_columns
      end do
      call allocate_bodies(kernels, sub%n_columns + n, sub)
      call pack_grains(view, number_of, kernels, physics, sub)
      do b = 1, size(boundaries)
        if (column_of(b) == 0 .or. boundaries(b)%turns()) cycle
        call pack_boundary(boundaries(b), b, column_of(b), decomposition%n_subdomains, kernels, sub)
      end do
    end associate
    call pack_contacts(view, found, decomposition%boundaries, number_of, column_of, kernels, physics, sub)

  contains

    !> Give grain `k` the next number, unless it has one or is part of a boundary.
    subroutine number(k)
      integer, intent(in) :: k

      if (number_of(k) > 0 .or. view%bodies%glued(k) > 0) return
      sub%n_grains = sub%n_grains + 1
      number_of(k) = sub%n_grains
    end subroutine number

  end subroutine pack_subproblem

  subroutine allocate_bodies(kernels, n_columns, sub)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n_columns
    type(subproblem_t), intent(inout) :: sub

    allocate (sub%id(n_columns), sub%home(sub%n_bodies), sub%place(sub%n_grains))
    allocate (sub%position(kernels%nd, sub%n_grains), sub%radius(sub%n_grains))
    allocate (sub%v_free(kernels%nv, n_columns), sub%inverse_mass(kernels%nw, n_columns), source=0.0_dp)
    ! what the solve sets before it reads them
    allocate (sub%velocity(kernels%nv, n_columns), sub%v_global(kernels%nv, n_columns), sub%reaction(kernels%nv, n_columns), &
      & sub%weight(kernels%nw, n_columns))
    allocate (sub%multiplicity(sub%n_bodies), source=1)
    allocate (sub%boundary(sub%n_grains + 1:n_columns), source=0)
  end subroutine allocate_bodies

  subroutine pack_grains(view, number_of, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: view
    integer, intent(in), contiguous :: number_of(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer :: k, b

    do k = 1, size(number_of)
      b = number_of(k)
      if (b == 0) cycle
      sub%id(b) = view%bodies%id(k)
      sub%home(b) = view%home(k)
      sub%place(b) = view%origin(k)
      sub%position(:, b) = view%bodies%position(:, k)
      sub%radius(b) = view%bodies%radius(k)
      sub%v_free(:, b) = view%bodies%velocity(1:kernels%nv, k)
      call physics%accelerate(view%bodies, k, sub%v_free(:, b))
      associate (before => view%bodies%velocity(1:kernels%nd, k), after => sub%v_free(1:kernels%nd, b))
        sub%largest_term = max(sub%largest_term, view%bodies%mass(k)*max(norm2(before), norm2(after - before)))
      end associate
      sub%inverse_mass(1:kernels%nd, b) = 1.0_dp/view%bodies%mass(k)
      if (kernels%nw > kernels%nd .and. physics%rotation) sub%inverse_mass(kernels%nw, b) = 1.0_dp/view%bodies%inertia(k)
    end do
  end subroutine pack_grains

  !> A boundary as a column. One that forces move is a body shared by the subdomains that touch it, with one of all
  !> subdomains to keep account of them.
  subroutine pack_boundary(boundary, b, column, n_subdomains, kernels, sub)
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: b, column, n_subdomains
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(inout) :: sub
    integer :: d

    sub%id(column) = boundary%id
    sub%boundary(column) = b
    sub%v_free(1:kernels%nd, column) = boundary%velocity(1:kernels%nd)
    if (column > sub%n_bodies) return
    sub%home(column) = mod(b - 1, n_subdomains) + 1
    do d = 1, kernels%nd
      if (.not. boundary%free(d)) cycle
      sub%inverse_mass(d, column) = 1.0_dp/boundary%mass
      sub%largest_term = max(sub%largest_term, boundary%mass*abs(boundary%last_velocity(d)), &
        & boundary%mass*abs(boundary%velocity(d) - boundary%last_velocity(d)))
    end do
  end subroutine pack_boundary

  subroutine pack_contacts(view, found, boundaries, number_of, column_of, kernels, physics, sub)
    type(neighbourhood_t), intent(in) :: view
    type(found_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    !> of the grains of the view, 0 for those without a column of their own; of the boundaries
    integer, intent(in), contiguous :: number_of(:), column_of(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer, allocatable :: pair(:, :), order(:)
    integer :: c, f, p, b, i, j, q, g, nd
    type(contact_terms_t) :: terms

    nd = kernels%nd
    allocate (pair(2, found%n), order(found%n))
    call find_pairs()
    sub%n_awake = found%n_awake
    call group_contacts(pair(:, 1:sub%n_awake), sub%n_bodies, order(1:sub%n_awake), sub%n_grouped)
    call group_contacts(pair(:, sub%n_awake + 1:), sub%n_bodies, order(sub%n_awake + 1:), sub%n_grouped_asleep)
    order(sub%n_awake + 1:) = sub%n_awake + order(sub%n_awake + 1:)
    allocate (sub%pair(2, lanes*n_blocks(found%n)), source=1)
    allocate (sub%source(found%n), sub%gap(found%n))
    allocate (sub%hot(lanes, kernels%nh, n_blocks(found%n)))
    allocate (sub%impulse(lanes, kernels%nc, n_blocks(found%n)), source=0.0_dp)
    if (found%n > 0) sub%hot(:, :, n_blocks(found%n)) = 0.0_dp
    if (physics%laws%attracts) allocate (sub%attraction(lanes, n_blocks(found%n)), source=0.0_dp)
    do c = 1, found%n
      f = order(c)
      q = lane_of(c)
      g = block_of(c)
      sub%source(c) = found%source(f)
      sub%gap(c) = found%gap(f)
      sub%pair(:, c) = pair(:, f)
      p = found%source(f)
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      b = boundary_of(view, p)
      if (b > 0) then
        if (boundaries(b)%turns()) call add_column()
      end if
      sub%hot(q, 1:nd, g) = found%normal(:, f)
      if (size(found%terms) > 0) then
        terms = found%terms(f)
      else
        terms = scene_terms(view, boundaries, physics, p, found%gap(f))
      end if
      if (terms%restitution > 0.0_dp) then
        sub%hot(q, nd + 1, g) = terms%restitution*returned()
      else
        sub%hot(q, nd + 1, g) = terms%play/physics%h
      end if
      if (allocated(sub%attraction)) sub%attraction(q, g) = physics%h*terms%attraction
      if (kernels%nc == 1) cycle
      sub%hot(q, nd + 4, g) = merge(view%bodies%radius(i), 0.0_dp, view%bodies%glued(i) == 0)
      sub%hot(q, nd + 5, g) = 0.0_dp
      if (j > 0) sub%hot(q, nd + 5, g) = merge(view%bodies%radius(j), 0.0_dp, view%bodies%glued(j) == 0)
      sub%hot(q, nd + 6, g) = terms%friction
      if (kernels%shift_row > 0) call pack_tangential_shift()
      if (kernels%rolling_row > 0) call pack_rolling()
    end do

  contains

    !> Columns of candidates and antagonists in the order in which contacts were found; of a boundary that turns, one that
    !> cannot move stands for the columns that `add_column` makes.
    subroutine find_pairs()
      integer :: column

      do f = 1, found%n
        p = found%source(f)
        i = view%list%candidate(p)
        j = view%list%antagonist(p)
        b = boundary_of(view, p)
        if (b > 0) then
          column = merge(sub%n_bodies + 1, column_of(b), boundaries(b)%turns())
          pair(1, f) = merge(column, number_of(i), view%bodies%glued(i) > 0)
          pair(2, f) = column
          if (view%bodies%glued(i) > 0) pair(2, f) = number_of(j)
        else
          pair(1, f) = number_of(i)
          pair(2, f) = number_of(j)
        end if
      end do
    end subroutine find_pairs

    !> The point of a turning boundary that this contact touches, as a body of its own.
    subroutine add_column()
      real(dp) :: point(nd)

      sub%n_columns = sub%n_columns + 1
      sub%id(sub%n_columns) = boundaries(b)%id
      sub%boundary(sub%n_columns) = b
      if (j < 0) then
        call find_surface_point(point)
      else if (view%bodies%glued(i) > 0) then
        point(:) = view%bodies%position(:, i) - view%bodies%radius(i)*found%normal(:, f)
      else
        point(:) = view%bodies%position(:, j) + view%bodies%radius(j)*found%normal(:, f)
      end if
      call boundaries(b)%velocity_at(point, sub%v_free(1:nd, sub%n_columns))
      ! levers of boundaries are 0: rolling alone sees the spin
      sub%v_free(nd + 1:, sub%n_columns) = boundaries(b)%spin(merge(3, 1, nd == 2):merge(2, 0, nd == 2) + kernels%nv - nd)
      sub%pair(merge(1, 2, view%bodies%glued(i) > 0), c) = sub%n_columns
    end subroutine add_column

    !> Tangential velocity at the start of the step as far as the contact sends it back (Newton).
    subroutine pack_tangential_shift()
      real(dp) :: rows(kernels%nc, kernels%nv, 2), vi(kernels%nv), vj(kernels%nv)
      integer :: d

      call contact_jacobian(kernels, sub%hot, c, rows(:, :, 1), rows(:, :, 2))
      call find_start_velocity(i, vi)
      call find_start_velocity(j, vj)
      do d = 2, nd
        sub%hot(q, kernels%shift_row + d - 1, g) = terms%tangential_restitution*sum(rows(d, :, 1)*vi + rows(d, :, 2)*vj)
      end do
    end subroutine pack_tangential_shift

    !> Velocity at the start of the step of grain `k` of the view or, with its spin left out, of the boundary that the grain or the
    !> negative number stands for, where the free grain touches it.
    subroutine find_start_velocity(k, v)
      integer, intent(in) :: k
      !> (nv)
      real(dp), intent(out) :: v(:)
      real(dp) :: point(nd)

      v(:) = 0.0_dp
      if (k < 0) then
        call find_surface_point(point)
      else if (view%bodies%glued(k) == 0) then
        v(:) = view%bodies%velocity(1:kernels%nv, k)
        return
      else
        point(:) = view%bodies%position(:, k) + merge(-1, 1, k == i)*view%bodies%radius(k)*found%normal(:, f)
      end if
      call boundaries(b)%last_velocity_at(point, v(1:nd))
    end subroutine find_start_velocity

    !> R* and the coefficients of rolling and, of spheres, pivoting.
    subroutine pack_rolling()
      associate (row => kernels%rolling_row)
        sub%hot(q, row + 1, g) = rolling_radius(sub%hot(q, nd + 4, g), sub%hot(q, nd + 5, g))
        sub%hot(q, row + 3, g) = terms%rolling
        if (nd == 3) sub%hot(q, row + 4, g) = terms%pivoting
      end associate
    end subroutine pack_rolling

    !> Point of the surface of a boundary that the candidate is nearest to.
    pure subroutine find_surface_point(point)
      real(dp), intent(out) :: point(nd)
      point(:) = view%bodies%position(:, i) - (view%bodies%radius(i) + found%gap(f))*found%normal(:, f)
    end subroutine find_surface_point

    !> Normal velocity at the start of the step as far as the contact sends it back. It counts where the contact opens, too: what
    !> strikes from behind would get energy from a contact that only holds. Where the loads of the step alone close it again,
    !> the contact comes to rest.
    real(dp) function returned()
      returned = approach()
      if (returned <= 0.0_dp) return
      if (sum((sub%v_free(1:nd, sub%pair(1, c)) - sub%v_free(1:nd, sub%pair(2, c)))*found%normal(:, f)) < 0.0_dp) returned = 0.0_dp
    end function returned

    !> Normal velocity at the start of the step.
    real(dp) function approach()
      real(dp) :: v(nd), point(nd), surface(nd)

      v(:) = view%bodies%velocity(1:nd, i)
      if (j > 0) then
        v(:) = v - view%bodies%velocity(1:nd, j)
      else
        call find_surface_point(point)
        call boundaries(b)%last_velocity_at(point, surface)
        v(:) = v - surface
      end if
      approach = sum(v*found%normal(:, f))
    end function approach

  end subroutine pack_contacts

  !> Find out which subdomains hold a copy of each body: every subdomain tells the owner of a grain at home elsewhere that it
  !> touches it, and so of boundaries that forces move; the owner tells all of them, itself included, of each other. Most
  !> grains are touched at home only, and are in no record. Collective.
  subroutine find_interface(decomposition, problem)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    integer(i8), allocatable :: records(:, :), received(:, :), answers(:, :)
    integer, allocatable :: destination(:)
    type(shared_part_t), allocatable :: part(:)
    type(columns_t) :: columns(size(problem%sub))
    integer :: s, b, n, round

    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          if (round == 1) call columns(s)%init(sub, decomposition%home(s)%n)
          do b = 1, sub%n_bodies
            if (b <= sub%n_grains) then
              if (sub%place(b) > 0) cycle
            end if
            n = n + 1
            if (round == 1) cycle
            records(1, n) = sub%id(b)
            records(2, n) = sub%subdomain
            records(3, n) = merge(sub%home(b), 0, b <= sub%n_grains)
            destination(n) = decomposition%comm%rank_of(sub%home(b), decomposition%n_subdomains)
          end do
        end associate
      end do
      if (round == 1) allocate (records(3, n), destination(n))
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    call add_owners(decomposition, columns, received)
    call answer_sharers(decomposition, received, answers, destination)
    call sparse_exchange(decomposition%comm, answers, destination, received)
    allocate (part(size(problem%sub)))
    call sort_out_sharers(received, decomposition, columns, problem, part)
    do s = 1, size(part)
      call number_shared_first(problem%sub(s), part(s)%body(1:part(s)%n_shared))
    end do
    call problem%shared%init(decomposition%comm, part, decomposition%n_subdomains, problem%kernels%nv)
  end subroutine find_interface

  subroutine columns_init(self, sub, n_home)
    class(columns_t), intent(inout) :: self
    type(subproblem_t), intent(in) :: sub
    !> grains at home in the subdomain
    integer, intent(in) :: n_home
    integer, allocatable :: away(:), order(:)
    integer :: b, n

    allocate (self%at_home(n_home), source=0)
    n = 0
    do b = 1, sub%n_grains
      if (sub%place(b) > 0) then
        self%at_home(sub%place(b)) = b
      else
        n = n + 1
      end if
    end do
    n = n + sub%n_bodies - sub%n_grains
    allocate (self%away(n), self%away_id(n), away(n), order(n))
    n = 0
    do b = 1, sub%n_bodies
      if (b <= sub%n_grains) then
        if (sub%place(b) > 0) cycle
      end if
      n = n + 1
      away(n) = b
      self%away_id(n) = sub%id(b)
    end do
    call argsort(self%away_id, order)
    do n = 1, size(order)
      self%away(n) = away(order(n))
      self%away_id(n) = sub%id(self%away(n))
    end do
  end subroutine columns_init

  !> Add the touches of owners to those (body, subdomain, owner) of others.
  subroutine add_owners(decomposition, columns, touches)
    type(decomposition_t), intent(in) :: decomposition
    type(columns_t), intent(in) :: columns(:)
    !> (3, n)
    integer(i8), allocatable, intent(inout) :: touches(:, :)
    integer(i8), allocatable :: longer(:, :)
    integer(i8) :: key(2)
    integer, allocatable :: order(:)
    integer :: k, n, h, place

    allocate (longer(3, 2*size(touches, 2)), order(size(touches, 2)))
    n = size(touches, 2)
    longer(:, 1:n) = touches
    call argsort_rows(touches, order)
    do k = 1, size(order)
      associate (touch => touches(:, order(k)))
        if (touch(3) == 0) cycle
        if (k > 1) then
          if (touches(1, order(k - 1)) == touch(1)) cycle
        end if
        key(1) = touch(3)
        key(2) = touch(1)
        call find_home(decomposition, key, h, place)
        if (columns(h)%at_home(place) == 0) cycle
        n = n + 1
        longer(1, n) = touch(1)
        longer(2:3, n) = touch(3)
      end associate
    end do
    touches = longer(:, 1:n)
  end subroutine add_owners

  !> Of the touches (body, subdomain, owner) of the bodies of this rank, tell each subdomain of a shared grain of all
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
  subroutine sort_out_sharers(received, decomposition, columns, problem, part)
    !> (subdomain told, body, sharer)
    integer(i8), intent(in), contiguous :: received(:, :)
    type(decomposition_t), intent(in) :: decomposition
    type(columns_t), intent(in) :: columns(:)
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
      associate (home => decomposition%home(s))
        call fill_part(received, order(k:last), home%id(1:home%n), columns(s), problem%sub(s), part(s))
      end associate
      k = last + 1
    end do
  end subroutine sort_out_sharers

  subroutine fill_part(received, order, home_id, columns, sub, part)
    integer(i8), intent(in), contiguous :: received(:, :)
    !> places in `received` of the records of this subdomain, by body and sharer
    integer, intent(in), contiguous :: order(:)
    !> identifiers of the grains at home here, ascending
    integer(i8), intent(in), contiguous :: home_id(:)
    type(columns_t), intent(in) :: columns
    type(subproblem_t), intent(inout) :: sub
    type(shared_part_t), intent(inout) :: part
    integer(i8) :: id
    integer :: k, place

    allocate (part%body(size(order)), part%first(size(order) + 1), part%sharer(size(order)))
    part%n_shared = 0
    id = -1
    do k = 1, size(order)
      if (received(2, order(k)) /= id) then
        id = received(2, order(k))
        part%n_shared = part%n_shared + 1
        place = find_sorted(columns%away_id, id)
        if (place > 0) then
          part%body(part%n_shared) = columns%away(place)
        else
          part%body(part%n_shared) = columns%at_home(find_sorted(home_id, id))
        end if
        part%first(part%n_shared) = k
      end if
      part%sharer(k) = int(received(3, order(k)))
    end do
    part%first(part%n_shared + 1) = size(order) + 1
    do k = 1, part%n_shared
      sub%multiplicity(part%body(k)) = part%first(k + 1) - part%first(k)
    end do
  end subroutine fill_part

  !> Give the shared grains the first numbers, in the order of the exchange, so that it reads and writes their velocities in a
  !> row. The others keep their order.
  subroutine number_shared_first(sub, shared)
    type(subproblem_t), intent(inout) :: sub
    !> numbers of the shared bodies; boundaries among them keep theirs
    integer, intent(inout), contiguous :: shared(:)
    integer :: number(sub%n_columns), grain(sub%n_grains)
    integer :: b, c, k, n

    if (size(shared) == 0) return
    number(:) = 0
    n = 0
    do k = 1, size(shared)
      if (shared(k) <= sub%n_grains) call give_number(shared(k))
    end do
    do b = 1, sub%n_grains
      if (number(b) == 0) call give_number(b)
    end do
    do b = sub%n_grains + 1, sub%n_columns
      number(b) = b
    end do
    do k = 1, size(shared)
      shared(k) = number(shared(k))
    end do
    do c = 1, sub%n_contacts
      sub%pair(1, c) = number(sub%pair(1, c))
      sub%pair(2, c) = number(sub%pair(2, c))
    end do
    call reorder()

  contains

    subroutine give_number(b)
      integer, intent(in) :: b

      n = n + 1
      number(b) = n
      grain(n) = b
    end subroutine give_number

    !> What is known of the grains.
    subroutine reorder()
      type(subproblem_t) :: old

      call move_alloc(sub%id, old%id)
      call move_alloc(sub%home, old%home)
      call move_alloc(sub%place, old%place)
      call move_alloc(sub%multiplicity, old%multiplicity)
      call move_alloc(sub%position, old%position)
      call move_alloc(sub%radius, old%radius)
      call move_alloc(sub%v_free, old%v_free)
      call move_alloc(sub%inverse_mass, old%inverse_mass)
      allocate (sub%id, source=old%id)
      allocate (sub%home, source=old%home)
      allocate (sub%place, mold=old%place)
      allocate (sub%multiplicity, source=old%multiplicity)
      allocate (sub%position, mold=old%position)
      allocate (sub%radius, mold=old%radius)
      allocate (sub%v_free, source=old%v_free)
      allocate (sub%inverse_mass, source=old%inverse_mass)
      do n = 1, sub%n_grains
        b = grain(n)
        sub%id(n) = old%id(b)
        sub%home(n) = old%home(b)
        sub%place(n) = old%place(b)
        sub%multiplicity(n) = old%multiplicity(b)
        sub%position(:, n) = old%position(:, b)
        sub%radius(n) = old%radius(b)
        sub%v_free(:, n) = old%v_free(:, b)
        sub%inverse_mass(:, n) = old%inverse_mass(:, b)
      end do
    end subroutine reorder

  end subroutine number_shared_first

  !> Count the interface. Each grain is counted in the first of the subdomains that share it. Collective.
  subroutine count_figures(decomposition, neighbourhoods, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    type(neighbourhoods_t), intent(in) :: neighbourhoods
    type(contact_problem_t), intent(inout) :: problem
    type(interface_figures_t), intent(out) :: figures
    integer(i8) :: counts(n_multiplicities + 6)
    real(dp) :: extremes(4)
    logical, allocatable :: counted_elsewhere(:)
    integer :: s, b, c, k, m

    counts(:) = 0
    extremes(:) = 0.0_dp
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
          if (any(sub%pair(:, c) > sub%n_grains)) cycle
          if (sub%home(sub%pair(1, c)) /= sub%home(sub%pair(2, c))) counts(n_multiplicities + 1) = counts(n_multiplicities + 1) + 1
        end do
        counts(n_multiplicities + 2) = counts(n_multiplicities + 2) + sub%n_contacts
        extremes(1) = max(extremes(1), real(sub%n_contacts, dp))
        extremes(2) = max(extremes(2), -real(sub%n_contacts, dp))
        counts(n_multiplicities + 3) = counts(n_multiplicities + 3) + size(part%neighbour)
        counts(n_multiplicities + 4) = counts(n_multiplicities + 4) + int(part%n_slots, i8)*problem%shared%width
        counts(n_multiplicities + 5) = counts(n_multiplicities + 5) + count(neighbourhoods%view(s)%origin == 0)
        extremes(3) = max(extremes(3), real(size(part%neighbour), dp))
        extremes(4) = max(extremes(4), real(part%n_slots, dp)*problem%shared%width)
        counts(n_multiplicities + 6) = counts(n_multiplicities + 6) + sub%n_contacts - sub%n_awake
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
    figures%neighbours = counts(n_multiplicities + 3)
    figures%values = counts(n_multiplicities + 4)
    figures%ghosts = counts(n_multiplicities + 5)
    figures%most_neighbours = nint(extremes(3), i8)
    figures%most_values = nint(extremes(4), i8)
    problem%n_contacts = counts(n_multiplicities + 2)
    problem%n_asleep = counts(n_multiplicities + 6)
  end subroutine count_figures

  !> Scales of the residual, of the jump and of roundings: largest |R^d|, over the components that can move, largest free speed,
  !> and largest term of R^d of a body in contact. What moves as prescribed counts with the mass of the heaviest grain that it may
  !> strike. Collective.
  subroutine find_scales(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: scales(3), moving(problem%kernels%nd), speed, lightest
    integer :: s, b, d, nd

    nd = problem%kernels%nd
    scales(:) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        lightest = huge(1.0_dp)
        do b = 1, sub%n_bodies
          scales(2) = max(scales(2), norm2(sub%v_free(1:nd, b)))
          moving(:) = sub%v_free(1:nd, b)
          do d = 1, nd
            if (.not. sub%moves(d, b)) moving(d) = 0.0_dp
          end do
          ! all components that move have the same mass
          if (.not. any(sub%inverse_mass(1:nd, b) > 0.0_dp)) cycle
          scales(1) = max(scales(1), norm2(moving)/maxval(sub%inverse_mass(1:nd, b)))
          lightest = min(lightest, maxval(sub%inverse_mass(1:nd, b)))
        end do
        do b = sub%n_bodies + 1, sub%n_columns
          speed = norm2(sub%v_free(1:nd, b))
          scales(1) = max(scales(1), speed/lightest)
          scales(2) = max(scales(2), speed)
        end do
        scales(3) = max(scales(3), sub%largest_term)
        if (allocated(sub%attraction)) scales(3) = max(scales(3), maxval(sub%attraction))
      end associate
    end do
    call problem%comm%highest_of(scales)
    problem%force_scale = scales(1)
    problem%velocity_scale = scales(2)
    problem%rounded_scale = max(scales(1), scales(3))
  end subroutine find_scales

  !> Velocities at the end of the step: those of the solved problem (v_global) for grains in contact, free ones for
  !> the others. A shared grain whose owner has no contact on it gets its velocity from its first sharer. Grains glued to
  !> a boundary are left. Collective.
  subroutine take_velocities(decomposition, physics, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(in) :: problem
    integer :: s, k

    do s = 1, size(decomposition%home)
      associate (home => decomposition%home(s))
        do k = 1, home%n
          if (home%glued(k) == 0) call physics%accelerate(home, k, home%velocity(:, k))
        end do
      end associate
    end do
    call bring_home(decomposition, problem, displace=.false.)
  end subroutine take_velocities

  !> Move the grains in contact by what v_global holds in the place of velocities [m]. Collective.
  subroutine take_displacements(decomposition, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    call bring_home(decomposition, problem, displace=.true.)
  end subroutine take_displacements

  !> Bring v_global of the grains in contact to where they are at home: in this subdomain by their places, in others by
  !> records (owner, grain, velocity). Collective.
  subroutine bring_home(decomposition, problem, displace)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    !> they are displacements, not velocities
    logical, intent(in) :: displace
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    real(dp) :: v(problem%kernels%nv)
    integer :: s, b, k, d, h, place

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          if (sub%place(b) > 0) call put(s, sub%place(b), sub%v_global(:, b))
        end do
      end associate
    end do
    call list_returns(decomposition, problem, records, destination)
    call sparse_exchange(decomposition%comm, records, destination, received)
    do k = 1, size(received, 2)
      call find_home(decomposition, received(1:2, k), h, place)
      do d = 1, size(v)
        v(d) = transfer(received(2 + d, k), 0.0_dp)
      end do
      call put(h, place, v)
    end do

  contains

    subroutine put(h, place, v)
      !> subdomain of this rank, and place there
      integer, intent(in) :: h, place
      !> (nv)
      real(dp), intent(in) :: v(:)

      associate (home => decomposition%home(h))
        if (displace) then
          home%position(:, place) = home%position(:, place) + v(1:decomposition%nd)
        else
          home%velocity(1:size(v), place) = v
        end if
      end associate
    end subroutine put

  end subroutine bring_home

  !> Subdomain of this rank and place in its home of a grain.
  pure subroutine find_home(decomposition, key, h, place)
    type(decomposition_t), intent(in) :: decomposition
    !> owner and identifier
    integer(i8), intent(in) :: key(2)
    integer, intent(out) :: h, place

    h = int(key(1)) - decomposition%first + 1
    place = find_sorted(decomposition%home(h)%id, key(2))
  end subroutine find_home

  !> Records (owner, grain, velocity) of the grains in contact that are at home in none of their sharers, from the first of
  !> them.
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
          allocate (sends(sub%n_bodies), source=.false.)
          do b = 1, sub%n_grains
            sends(b) = sub%place(b) == 0
          end do
          do k = 1, part%n_shared
            b = part%body(k)
            if (b > sub%n_grains) cycle
            sends(b) = part%rung(k) == 1 .and. .not. any(part%sharer(part%first(k):part%first(k + 1) - 1) == sub%home(b))
          end do
          do b = 1, sub%n_grains
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
