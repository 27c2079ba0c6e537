!> From grains in their places to the packed contact problem of a step.
module gravier_problem_builder
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_detection, phase_interface, phase_setup
  use gravier_body_figures, only: body_figures_t
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_terms_t
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, block_of, lane_of, contact_jacobian, rolling_radius
  use gravier_sweep_order, only: group_contacts
  use gravier_body_mass, only: inverse_of_translation
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_surface_velocity, only: contact_place_t, find_start_velocity, approach_velocity
  use gravier_pair_laws, only: boundary_of, law_of, terms_of
  use gravier_physics, only: physics_t
  use gravier_narrow_phase, only: contact_list_t, find_contacts, place_of
  use gravier_sleeping, only: put_sleepers_last
  use gravier_interface, only: interface_statistics_t, find_interface, count_figures
  implicit none
  private
  public :: build_problem

  !> Columns of the grains of a view, 0 for those without one of their own, and of boundaries.
  type :: numbers_t
    integer, allocatable :: of_grain(:), of_boundary(:)
  end type numbers_t

  !> A contact while it is packed: its place in the sweep, lane and block, its places among those found and in the list of pairs,
  !> its
  !> candidate and its antagonist, a grain or minus a boundary, and the boundary that takes part, 0 for none.
  type :: packed_t
    integer :: c = 0, q = 0, g = 0, f = 0, p = 0, i = 0, j = 0, b = 0
  end type packed_t

contains

  !> Find the contacts among the near pairs at the present places (q_m) and pack them, subdomain by subdomain. Impulses
  !> start from zero. Boundaries hold the velocities that they have at the end of the step as far as no contact acts on
  !> them. Collective.
  subroutine build_problem(decomposition, halo, kernels, physics, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    !> states of pairs are those of the step afterwards
    type(halo_t), intent(inout) :: halo
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    type(interface_statistics_t), intent(out) :: figures
    type(contact_list_t) :: found
    integer :: s

    problem%comm => decomposition%comm
    problem%kernels = kernels
    problem%n_subdomains = decomposition%n_subdomains
    if (allocated(problem%sub)) deallocate (problem%sub)
    allocate (problem%sub(size(halo%view)))
    do s = 1, size(problem%sub)
      associate (view => halo%view(s))
        call start_timer(phase_detection)
        call find_contacts(view, decomposition, physics, found)
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
    call count_figures(decomposition, halo, problem, figures)
    if (physics%laws%attracts) call problem%load_attraction()
    call find_scales(problem)
    call stop_timer(phase_interface)
  end subroutine build_problem

  !> Number the bodies that contacts touch and pack bodies and contacts. Free grains come first, in the order in which contacts
  !> meet them, so that a sweep walks through memory (number_shared_first then puts shared ones before the others); then
  !> boundaries that forces move, then columns of bodies with prescribed velocities: one a boundary, or one a contact where
  !> the boundary turns.
  subroutine pack_subproblem(view, found, decomposition, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(decomposition_t), intent(in) :: decomposition
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    type(numbers_t) :: numbers
    integer :: c, p, b, n

    associate (list => view%list, boundaries => decomposition%boundaries)
      allocate (numbers%of_grain(view%bodies%n), numbers%of_boundary(size(boundaries)), source=0)
      n = 0
      sub%n_grains = 0
      do c = 1, found%n
        p = found%source(c)
        call number(list%candidate(p))
        if (list%antagonist(p) > 0) call number(list%antagonist(p))
        b = boundary_of(view, p)
        if (b == 0) cycle
        numbers%of_boundary(b) = 1
        if (boundaries(b)%turns()) n = n + 1
      end do
      sub%n_contacts = found%n
      sub%overlapping_cores = found%overlapping_cores
      sub%n_bodies = sub%n_grains
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. .not. boundaries(b)%is_driven()) cycle
        sub%n_bodies = sub%n_bodies + 1
        numbers%of_boundary(b) = sub%n_bodies
      end do
      sub%n_columns = sub%n_bodies
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. boundaries(b)%is_driven() .or. boundaries(b)%turns()) cycle
        sub%n_columns = sub%n_columns + 1
        numbers%of_boundary(b) = sub%n_columns
      end do
      call allocate_bodies(kernels, sub%n_columns + n, sub)
      if (any(abs(physics%body_force) > 0.0_dp)) allocate (sub%volume(sub%n_grains))
      call pack_grains(view, numbers%of_grain, decomposition%figures, kernels, physics, sub)
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. boundaries(b)%turns()) cycle
        call pack_boundary(boundaries(b), b, numbers%of_boundary(b), decomposition%n_subdomains, kernels, sub)
      end do
    end associate
    call pack_contacts(view, found, decomposition%boundaries, numbers, kernels, physics, sub)

  contains

    !> Give grain `k` the next number, unless it has one or is part of a boundary.
    subroutine number(k)
      integer, intent(in) :: k

      if (numbers%of_grain(k) > 0 .or. view%bodies%glued(k) > 0) return
      sub%n_grains = sub%n_grains + 1
      numbers%of_grain(k) = sub%n_grains
    end subroutine number

  end subroutine pack_subproblem

  subroutine allocate_bodies(kernels, n_columns, sub)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n_columns
    type(subproblem_t), intent(inout) :: sub

    allocate (sub%id(n_columns), sub%owner(sub%n_bodies), sub%place(sub%n_grains), sub%radius(sub%n_grains))
    allocate (sub%v_free(kernels%nv, n_columns), sub%inverse_mass(kernels%nw, n_columns), source=0.0_dp)
    ! what the solve sets before it reads them
    allocate (sub%velocity(kernels%nv, n_columns), sub%v_global(kernels%nv, n_columns), sub%reaction(kernels%nv, n_columns), &
      & sub%weight(kernels%nw, n_columns))
    allocate (sub%multiplicity(sub%n_bodies), source=1)
    allocate (sub%boundary(sub%n_grains + 1:n_columns), source=0)
  end subroutine allocate_bodies

  subroutine pack_grains(view, number_of, figures, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in), contiguous :: number_of(:)
    type(body_figures_t), intent(in) :: figures
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer :: k, b

    do k = 1, size(number_of)
      b = number_of(k)
      if (b == 0) cycle
      sub%id(b) = view%bodies%id(k)
      sub%owner(b) = view%owner(k)
      sub%place(b) = view%origin(k)
      sub%radius(b) = view%bodies%radius(k)
      sub%v_free(:, b) = view%bodies%velocity(1:kernels%nv, k)
      call physics%accelerate(figures, view%bodies, k, sub%v_free(:, b))
      associate (before => view%bodies%velocity(1:kernels%nd, k), after => sub%v_free(1:kernels%nd, b))
        sub%largest_term = max(sub%largest_term, view%bodies%mass(k)*max(norm2(before), norm2(after - before)))
      end associate
      sub%inverse_mass(1:kernels%nd, b) = 1.0_dp/view%bodies%mass(k)
      if (allocated(sub%volume)) sub%volume(b) = figures%volume_of(view%bodies, k)
      if (kernels%nw > kernels%nd .and. physics%rotation) call figures%find_inverse_inertia(view%bodies, k, &
        & sub%inverse_mass(kernels%nd + 1:, b))
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
    sub%owner(column) = mod(b - 1, n_subdomains) + 1
    do d = 1, kernels%nd
      if (.not. boundary%free(d)) cycle
      sub%inverse_mass(d, column) = 1.0_dp/boundary%mass
      sub%largest_term = max(sub%largest_term, boundary%mass*abs(boundary%last_velocity(d)), &
        & boundary%mass*abs(boundary%velocity(d) - boundary%last_velocity(d)))
    end do
  end subroutine pack_boundary

  !> Pack the contacts in the order in which they are swept, with the columns of boundaries that turn.
  subroutine pack_contacts(view, found, boundaries, numbers, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(numbers_t), intent(in) :: numbers
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer, allocatable :: pair(:, :), order(:)
    integer :: c
    type(packed_t) :: this

    allocate (pair(2, found%n), order(found%n))
    call find_pairs(view, found, boundaries, numbers, sub, pair)
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
      this%c = c
      this%q = lane_of(c)
      this%g = block_of(c)
      this%f = order(c)
      this%p = found%source(this%f)
      this%i = view%list%candidate(this%p)
      this%j = view%list%antagonist(this%p)
      this%b = boundary_of(view, this%p)
      sub%source(c) = this%p
      sub%gap(c) = found%gap(this%f)
      sub%pair(:, c) = pair(:, this%f)
      if (this%b > 0) then
        if (boundaries(this%b)%turns()) call add_column(view, found, boundaries(this%b), kernels, this, sub)
      end if
      call pack_terms(view, found, boundaries, kernels, physics, this, sub)
    end do
  end subroutine pack_contacts

  !> Columns of candidates and antagonists in the order in which contacts were found; of a boundary that turns, one that cannot move
  !> stands for the columns that `add_column` makes.
  subroutine find_pairs(view, found, boundaries, numbers, sub, pair)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(numbers_t), intent(in) :: numbers
    type(subproblem_t), intent(in) :: sub
    !> (2, found)
    integer, intent(out), contiguous :: pair(:, :)
    integer :: f, p, i, j, b, column

    do f = 1, found%n
      p = found%source(f)
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      b = boundary_of(view, p)
      if (b > 0) then
        column = merge(sub%n_bodies + 1, numbers%of_boundary(b), boundaries(b)%turns())
        pair(1, f) = merge(column, numbers%of_grain(i), view%bodies%glued(i) > 0)
        pair(2, f) = column
        if (view%bodies%glued(i) > 0) pair(2, f) = numbers%of_grain(j)
      else
        pair(1, f) = numbers%of_grain(i)
        pair(2, f) = numbers%of_grain(j)
      end if
    end do
  end subroutine find_pairs

  !> The point of a turning boundary that a contact touches, as a body of its own.
  subroutine add_column(view, found, boundary, kernels, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundary
    type(kernels_t), intent(in) :: kernels
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: points(kernels%nd, 2)
    integer :: nd

    nd = kernels%nd
    sub%n_columns = sub%n_columns + 1
    sub%id(sub%n_columns) = boundary%id
    sub%boundary(sub%n_columns) = this%b
    call find_touching_points(view, found, this, points)
    call boundary%velocity_at(points(:, merge(1, 2, view%bodies%glued(this%i) > 0)), sub%v_free(1:nd, sub%n_columns))
    ! levers of boundaries are 0: rolling alone sees the spin
    sub%v_free(nd + 1:, sub%n_columns) = boundary%spin(merge(3, 1, nd == 2):merge(2, 0, nd == 2) + kernels%nv - nd)
    sub%pair(merge(1, 2, view%bodies%glued(this%i) > 0), this%c) = sub%n_columns
  end subroutine add_column

  !> The points of the candidate and of the antagonist that touch (nd, 2) [m].
  pure subroutine find_touching_points(view, found, this, points)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(packed_t), intent(in) :: this
    real(dp), intent(out) :: points(:, :)
    type(contact_place_t) :: place
    integer :: nd

    nd = size(points, 1)
    place = place_of(view, found, this%f)
    points(:, 1) = view%bodies%position(:, this%i) + place%arm_i(1:nd)
    if (this%j > 0) then
      points(:, 2) = view%bodies%position(:, this%j) + place%arm_j(1:nd)
    else
      points(:, 2) = place%on_wall(1:nd)
    end if
  end subroutine find_touching_points

  !> The contact data: normal and levers, and what the law of the pair makes of the step.
  subroutine pack_terms(view, found, boundaries, kernels, physics, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    type(contact_terms_t) :: terms

    if (size(found%terms) > 0) then
      terms = found%terms(this%f)
    else
      terms = terms_of(physics%laws, law_of(view, boundaries, physics%laws, this%p), found%gap(this%f))
    end if
    associate (q => this%q, g => this%g, i => this%i, j => this%j, row => kernels%row)
      sub%hot(q, 1:kernels%nd, g) = found%normal(:, this%f)
      if (row%arm_i > 0) then
        call pack_arms(view, found, kernels, this, sub)
      else if (row%lever_i > 0) then
        sub%hot(q, row%lever_i, g) = merge(view%bodies%radius(i), 0.0_dp, view%bodies%glued(i) == 0)
        sub%hot(q, row%lever_j, g) = 0.0_dp
        if (j > 0) sub%hot(q, row%lever_j, g) = merge(view%bodies%radius(j), 0.0_dp, view%bodies%glued(j) == 0)
      end if
      if (terms%restitution > 0.0_dp) then
        sub%hot(q, row%shift, g) = terms%restitution*returned_velocity(view, found, boundaries, kernels, this, sub)
      else
        sub%hot(q, row%shift, g) = terms%free_gap/physics%h
      end if
      if (allocated(sub%attraction)) sub%attraction(q, g) = physics%h*terms%attraction
      if (kernels%nc == 1) return
      sub%hot(q, row%friction, g) = terms%friction
      if (row%shift_t > 0) call pack_tangential_shift(view, found, boundaries, kernels, terms%tangential_restitution, this, sub)
      if (row%rolling_radius == 0) return
      sub%hot(q, row%rolling_radius, g) = rolling_radius(sub%hot(q, row%lever_i, g), sub%hot(q, row%lever_j, g))
      sub%hot(q, row%rolling_friction, g) = terms%rolling_friction
      if (kernels%nd == 3) sub%hot(q, row%pivoting_friction, g) = terms%pivoting_friction
    end associate
  end subroutine pack_terms

  !> Normal velocity at the start of the step as far as the contact sends it back. It counts where the contact opens, too: what
  !> strikes from behind would get energy from a contact that only holds. Where the loads of the step alone close it again,
  !> the contact comes to rest.
  real(dp) function returned_velocity(view, found, boundaries, kernels, this, sub) result(returned)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    real(dp) :: rows(kernels%nc, kernels%nv, 2), vi(kernels%nv), vj(kernels%nv)
    integer :: nd

    if (kernels%row%arm_i > 0) then
      call contact_jacobian(kernels, sub%hot, this%c, rows(:, :, 1), rows(:, :, 2))
      call find_start_velocities(view, found, boundaries, this, sub, vi, vj)
      returned = sum(rows(1, :, 1)*vi + rows(1, :, 2)*vj)
      if (returned <= 0.0_dp) return
      vi(:) = sub%v_free(:, sub%pair(1, this%c))
      vj(:) = sub%v_free(:, sub%pair(2, this%c))
      if (sum(rows(1, :, 1)*vi + rows(1, :, 2)*vj) < 0.0_dp) returned = 0.0_dp
      return
    end if
    nd = size(found%normal, 1)
    returned = approach_velocity(view, boundaries, this%p, found%gap(this%f), found%normal(:, this%f))
    if (returned <= 0.0_dp) return
    if (sum((sub%v_free(1:nd, sub%pair(1, this%c)) - sub%v_free(1:nd, sub%pair(2, this%c)))*found%normal(:, this%f)) < 0.0_dp) &
      & returned = 0.0_dp
  end function returned_velocity

  !> Tangential velocity at the start of the step as far as the contact sends it back (Newton).
  subroutine pack_tangential_shift(view, found, boundaries, kernels, restitution, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    !> tangential
    real(dp), intent(in) :: restitution
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: rows(kernels%nc, kernels%nv, 2), vi(kernels%nv), vj(kernels%nv)
    integer :: d

    call contact_jacobian(kernels, sub%hot, this%c, rows(:, :, 1), rows(:, :, 2))
    call find_start_velocities(view, found, boundaries, this, sub, vi, vj)
    do d = 2, kernels%nd
      sub%hot(this%q, kernels%row%shift_t + d - 2, this%g) = restitution*sum(rows(d, :, 1)*vi + rows(d, :, 2)*vj)
    end do
  end subroutine pack_tangential_shift

  !> Velocities at the start of the step: of a free grain, translation and spin; of a boundary, that of its point that is touched. Loads
  !> give grains no spin, so that the spin without contacts is that of the start, which in space goes round with the body and has its
  !> energy.
  subroutine find_start_velocities(view, found, boundaries, this, sub, vi, vj)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    !> (nv) [m/s, rad/s]
    real(dp), intent(out) :: vi(:), vj(:)
    real(dp) :: points(size(found%normal, 1), 2)
    integer :: nd

    nd = size(points, 1)
    call find_touching_points(view, found, this, points)
    call find_start_velocity(view, boundaries, this%i, points(:, 1), vi)
    call find_start_velocity(view, boundaries, this%j, points(:, 2), vj)
    associate (i => sub%pair(1, this%c), j => sub%pair(2, this%c))
      if (i <= sub%n_grains) vi(nd + 1:) = sub%v_free(nd + 1:, i)
      if (j <= sub%n_grains) vj(nd + 1:) = sub%v_free(nd + 1:, j)
    end associate
  end subroutine find_start_velocities

  !> The arms of a contact between bodies with shapes (contact_rows_t); those of grains that are part of a boundary are 0.
  pure subroutine pack_arms(view, found, kernels, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(kernels_t), intent(in) :: kernels
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    type(contact_place_t) :: place
    logical :: free

    place = place_of(view, found, this%f)
    if (view%bodies%glued(this%i) > 0) place%arm_i(:) = 0.0_dp
    free = .false.
    if (this%j > 0) free = view%bodies%glued(this%j) == 0
    if (.not. free) place%arm_j(:) = 0.0_dp
    associate (row => kernels%row, contact => sub%hot(this%q, :, this%g), normal => found%normal(:, this%f))
      if (kernels%nd == 3) then
        contact(row%arm_i:row%arm_i + 2) = place%arm_i
        contact(row%arm_j:row%arm_j + 2) = place%arm_j
      else
        contact(row%lever_i) = -sum(place%arm_i(1:2)*normal)
        contact(row%lever_j) = sum(place%arm_j(1:2)*normal)
        contact(row%arm_i) = place%arm_i(1)*normal(2) - place%arm_i(2)*normal(1)
        contact(row%arm_j) = place%arm_j(1)*normal(2) - place%arm_j(2)*normal(1)
      end if
    end associate
  end subroutine pack_arms

  !> Scales of the residual, of the jump and of roundings: largest |R^d|, over the components that can move, largest free speed,
  !> and largest term of R^d of a body in contact. What moves as prescribed counts with the mass of the heaviest grain that it may
  !> strike. Collective.
  subroutine find_scales(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: scales(3), moving(problem%kernels%nd), speed, lightest, inverse
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
          inverse = inverse_of_translation(sub%inverse_mass(:, b), nd)
          if (.not. inverse > 0.0_dp) cycle
          scales(1) = max(scales(1), norm2(moving)/inverse)
          lightest = min(lightest, inverse)
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

end module gravier_problem_builder
