!> Contacts as packed arrays: pairs of columns in sweep order, contact data, and the columns of boundaries that turn.
module gravier_contact_packing
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_terms_t, rounded_gap
  use gravier_law_set, only: law_set_t
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, block_of, lane_of, rolling_radius, contact_tangents
  use gravier_sweep_order, only: group_contacts
  use gravier_subproblem, only: subproblem_t
  use gravier_moving_cell, only: cell_contacts_t
  use gravier_cell_response, only: image_velocity
  use gravier_halo, only: local_bodies_t
  use gravier_surface_velocity, only: contact_place_t, add_travel
  use gravier_pair_laws, only: law_of, terms_of, sends_back
  use gravier_contact_springs, only: pack_spring
  use gravier_bond_turning, only: find_bond_velocity
  use gravier_bonded_groups, only: bonded_groups_t, find_bonded_groups
  use gravier_physics, only: physics_t
  use gravier_narrow_phase, only: contact_list_t, place_of
  implicit none
  private
  public :: numbers_t, pack_contacts

  !> Columns of the grains of a view, 0 for those without one of their own, and of boundaries.
  type :: numbers_t
    integer, allocatable :: of_grain(:), of_boundary(:)
  end type numbers_t

  !> A contact while it is packed: its place in the sweep, lane and block, its places among those found and in the list of pairs,
  !> its candidate and its antagonist, a grain or minus a boundary, and the boundary that takes part, 0 for none.
  type :: packed_t
    integer :: c = 0, q = 0, g = 0, f = 0, p = 0, i = 0, j = 0, b = 0
    !> what its law makes of the step
    type(contact_terms_t) :: terms
  end type packed_t

contains

  !> Pack the contacts in the order in which they are swept, with the columns of boundaries that turn: first normals, levers and
  !> coefficients, one contact after the other; then what depends on the velocities at the start of the step, which the loops over
  !> contacts of the solver make of those of the bodies.
  subroutine pack_contacts(view, found, boundaries, numbers, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    !> gets the order of the sweep
    type(contact_list_t), intent(inout) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(numbers_t), intent(in) :: numbers
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer, allocatable :: pair(:, :)
    !> velocities of the columns at the start of the step (nv, n_columns), where some law needs them; else (nv, 0) [m/s, rad/s]
    real(dp), allocatable :: start(:, :)
    integer :: c, before
    logical :: needs_start
    type(packed_t) :: this

    allocate (pair(2, found%n), found%order(found%n))
    call find_pairs(view, found, boundaries, numbers, sub, pair)
    call group_contacts(pair, sub%n_bodies, found%order, sub%n_grouped)
    allocate (sub%pair(2, lanes*n_blocks(found%n)), source=1)
    allocate (sub%source(found%n), sub%gap(found%n))
    allocate (sub%hot(lanes, kernels%nh, n_blocks(found%n)))
    allocate (sub%impulse(lanes, kernels%nc, n_blocks(found%n)), source=0.0_dp)
    if (found%n > 0) sub%hot(:, :, n_blocks(found%n)) = 0.0_dp
    if (physics%laws%attracts) allocate (sub%attraction(lanes, n_blocks(found%n)), source=0.0_dp)
    if (physics%laws%yields) allocate (sub%spring(found%n))
    needs_start = physics%laws%returns .or. physics%laws%yields
    if (needs_start) then
      call find_start_velocities(view, boundaries, numbers, kernels, sub, start)
    else
      allocate (start(kernels%nv, 0))
    end if
    before = -1
    do c = 1, found%n
      call find_packed(view, found, c, this)
      sub%source(c) = this%p
      sub%gap(c) = found%gap(this%f)
      sub%pair(:, c) = pair(:, this%f)
      call take_terms(view, found, boundaries, physics%laws, before, this)
      if (this%b > 0) then
        if (boundaries(this%b)%drive%turns()) call add_column(view, found, boundaries(this%b), physics, this, sub, start)
      end if
      if (physics%cell%moves) call pack_image(view, this, sub%cell)
      call pack_terms(view, found, kernels, physics%h, this, sub)
    end do
    if (needs_start) call pack_returned(view, found, boundaries, kernels, physics, start, sub)
    if (physics%laws%breaks) call pack_bonds(view, found, boundaries, kernels, physics, sub)
    do c = 1, merge(found%n, 0, physics%cell%moves)
      call keep_shifts(kernels, sub%hot, c, sub%cell)
    end do
  end subroutine pack_contacts

  !> Contact `c` of the sweep, to be packed.
  pure subroutine find_packed(view, found, c, this)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: c
    !> keeps the terms of the contact before
    type(packed_t), intent(inout) :: this

    this%c = c
    this%q = lane_of(c)
    this%g = block_of(c)
    this%f = found%order(c)
    this%p = found%source(this%f)
    call view%find_ends(this%p, this%i, this%j)
    this%b = found%boundary(this%f)
  end subroutine find_packed

  !> What the law of a contact makes of the step. Without laws of materials, and where no law has other terms for each pair, all
  !> contacts with one boundary have the same, and so have all between grains.
  pure subroutine take_terms(view, found, boundaries, laws, before, this)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    !> boundary of the contact before, negative for the first
    integer, intent(inout) :: before
    !> with the terms of the contact before
    type(packed_t), intent(inout) :: this

    if (size(found%terms) > 0) then
      this%terms = found%terms(this%f)
    else if (this%b /= before .or. laws%n > 0) then
      this%terms = terms_of(laws, law_of(view, boundaries, laws, this%p), found%gap(this%f))
      before = this%b
    else
      this%terms%free_gap = max(found%gap(this%f), 0.0_dp)
    end if
  end subroutine take_terms

  !> Branch of a contact and way to the image that it meets, in a cell that moves.
  pure subroutine pack_image(view, this, cell)
    type(local_bodies_t), intent(in) :: view
    type(packed_t), intent(in) :: this
    type(cell_contacts_t), intent(inout) :: cell

    associate (way => cell%way(:, this%c))
      way(:) = 0.0_dp
      call view%period%add_shift(view%list%shift(this%p), 1, way)
      cell%branch(:, this%c) = view%bodies%position(:, this%i) - view%bodies%position(:, this%j) - way
    end associate
  end subroutine pack_image

  !> Keep what the law alone adds to the velocities of a contact.
  pure subroutine keep_shifts(kernels, hot, c, cell)
    type(kernels_t), intent(in) :: kernels
    !> the contact data
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    type(cell_contacts_t), intent(inout) :: cell

    associate (row => kernels%row, shift => cell%shift(:, c), q => lane_of(c), g => block_of(c))
      shift(:) = 0.0_dp
      shift(1) = hot(q, row%shift, g)
      if (row%shift_t > 0) shift(2:) = hot(q, row%shift_t:row%shift_t + kernels%nd - 2, g)
    end associate
  end subroutine keep_shifts

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
      call view%find_ends(p, i, j)
      b = found%boundary(f)
      if (b > 0) then
        column = merge(sub%n_bodies + 1, numbers%of_boundary(b), boundaries(b)%drive%turns())
        pair(1, f) = merge(column, numbers%of_grain(i), view%bodies%glued(i) > 0)
        pair(2, f) = column
        if (view%bodies%glued(i) > 0) pair(2, f) = numbers%of_grain(j)
      else
        pair(1, f) = numbers%of_grain(i)
        pair(2, f) = numbers%of_grain(j)
      end if
    end do
  end subroutine find_pairs

  !> The point of a turning boundary that a contact touches, as a body of its own. Bonds hold its bodies on their circles by
  !> themselves.
  subroutine add_column(view, found, boundary, physics, this, sub, start)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundary
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    real(dp), intent(inout), contiguous :: start(:, :)
    real(dp) :: points(size(found%normal, 1), 2), carried(size(found%normal, 1))
    integer :: nd, side, first

    nd = size(points, 1)
    first = merge(3, 1, nd == 2)
    side = merge(1, 2, view%bodies%glued(this%i) > 0)
    sub%n_columns = sub%n_columns + 1
    sub%id(sub%n_columns) = boundary%id
    sub%boundary(sub%n_columns) = this%b
    call find_touching_points(view, found, this, points)
    sub%pair(side, this%c) = sub%n_columns
    associate (v => sub%v_free(:, sub%n_columns))
      call boundary%velocity_at(points(:, side), v(1:nd))
      ! levers of boundaries are 0: rolling alone sees the spin
      v(nd + 1:) = boundary%spin(first:first - 1 + size(v) - nd)
    end associate
    if (size(start, 2) > 0) call boundary%last_velocity_at(points(:, side), start(1:nd, sub%n_columns))
    if (this%terms%joins) return
    ! half of the way to the contact of the next step, and back to that of the last one
    associate (k => merge(this%j, this%i, side == 1), bodies => view%bodies, normal => found%normal(:, this%f), h => physics%h)
      call boundary%velocity_at(bodies%position(:, k), carried)
      call add_travel(bodies%velocity(1:nd, k), carried, boundary%velocity(1:nd), boundary%spin, normal, 0.5_dp*h, &
        & sub%v_free(1:nd, sub%n_columns))
      if (size(start, 2) == 0) return
      call boundary%last_velocity_at(bodies%position(:, k), carried)
      call add_travel(bodies%velocity(1:nd, k), carried, boundary%last_velocity(1:nd), boundary%last_spin, normal, -0.5_dp*h, &
        & start(1:nd, sub%n_columns))
    end associate
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
    place = place_of(view, found, this%f, this%terms%joins)
    points(:, 1) = view%bodies%position(:, this%i) + place%arm_i(1:nd)
    if (this%j > 0) then
      points(:, 2) = view%bodies%position(:, this%j) + place%arm_j(1:nd)
    else
      points(:, 2) = place%on_wall(1:nd)
    end if
  end subroutine find_touching_points

  !> The contact data: normal and levers, and what the law of the pair makes of the step, whatever the velocities.
  subroutine pack_terms(view, found, kernels, h, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(kernels_t), intent(in) :: kernels
    !> [s]
    real(dp), intent(in) :: h
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: reach, radius_j

    associate (q => this%q, g => this%g, i => this%i, j => this%j, row => kernels%row, terms => this%terms)
      sub%hot(q, 1:kernels%nd, g) = found%normal(:, this%f)
      if (row%arm_i > 0) then
        call pack_arms(view, found, kernels, this, sub)
      else if (row%lever_i > 0) then
        reach = 0.0_dp
        if (terms%joins) reach = merge(0.5_dp, 1.0_dp, j > 0)*found%gap(this%f)
        sub%hot(q, row%lever_i, g) = merge(view%bodies%radius(i) + reach, 0.0_dp, view%bodies%glued(i) == 0)
        sub%hot(q, row%lever_j, g) = 0.0_dp
        if (j > 0) sub%hot(q, row%lever_j, g) = merge(view%bodies%radius(j) + reach, 0.0_dp, view%bodies%glued(j) == 0)
      end if
      sub%hot(q, row%shift, g) = terms%free_gap/h
      if (allocated(sub%attraction)) then
        sub%attraction(q, g) = h*terms%attraction
        ! what touches, but for rounding, may start as if its attraction did nothing: the bodies press against each other by as much
        if (.not. terms%free_gap > rounded_gap*view%bodies%radius(i)) sub%impulse(q, 1, g) = h*terms%attraction
      end if
      if (kernels%nc == 1) return
      sub%hot(q, row%friction, g) = terms%friction
      if (row%shift_t > 0) sub%hot(q, row%shift_t:row%shift_t + kernels%nd - 2, g) = 0.0_dp
      if (row%rolling_radius == 0) return
      ! glued grains roll on free ones as grains do, though they have no lever
      radius_j = 0.0_dp
      if (j > 0) radius_j = view%bodies%radius(j)
      sub%hot(q, row%rolling_radius, g) = rolling_radius(view%bodies%radius(i), radius_j)
      sub%hot(q, row%rolling_friction, g) = terms%rolling_friction
      if (kernels%nd == 3) sub%hot(q, row%pivoting_friction, g) = terms%pivoting_friction
    end associate
  end subroutine pack_terms

  !> Velocities at the start of the step, by columns: of grains and of boundaries that do not turn; those that turn have a column a
  !> contact, which `add_column` fills. Loads give grains no spin, so that the spin without contacts is that of the start, which in
  !> space goes round with the body and has its energy.
  pure subroutine find_start_velocities(view, boundaries, numbers, kernels, sub, start)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(numbers_t), intent(in) :: numbers
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable, intent(out) :: start(:, :)
    integer :: k, b

    allocate (start, mold=sub%v_free)
    start(:, sub%n_grains + 1:) = 0.0_dp
    do k = 1, size(numbers%of_grain)
      b = numbers%of_grain(k)
      if (b == 0) cycle
      start(:, b) = view%bodies%velocity(1:kernels%nv, k)
      if (b <= sub%n_grains) start(kernels%nd + 1:, b) = sub%v_free(kernels%nd + 1:, b)
    end do
    do k = 1, size(boundaries)
      if (numbers%of_boundary(k) == 0 .or. boundaries(k)%drive%turns()) cycle
      start(1:kernels%nd, numbers%of_boundary(k)) = boundaries(k)%last_velocity(1:kernels%nd)
    end do
  end subroutine find_start_velocities

  !> What contacts send back of their velocities at the start of the step (Newton), and what springs make of them. A normal velocity
  !> at which the bodies part is sent back where the contact opens, too: what strikes from behind would get energy from a contact
  !> that only holds. Where the loads of the step alone close it again, the contact comes to rest.
  subroutine pack_returned(view, found, boundaries, kernels, physics, start, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    real(dp), intent(in), contiguous :: start(:, :)
    type(subproblem_t), intent(inout) :: sub
    !> velocities of the contacts at the start of the step, and without contacts (lanes, nc, blocks) [m/s]
    real(dp), allocatable :: v(:, :, :), free(:, :, :)
    !> velocity of the image that the candidate meets, along n, t and s [m/s]
    real(dp) :: image(kernels%nd)
    type(packed_t) :: this
    integer :: c, before, nd

    nd = kernels%nd
    allocate (v, mold=sub%impulse)
    call sub%contact_velocity(kernels, start, v)
    if (physics%laws%returns) then
      allocate (free, mold=v)
      call sub%contact_velocity(kernels, sub%v_free, free)
    end if
    before = -1
    do c = 1, found%n
      call find_packed(view, found, c, this)
      call take_terms(view, found, boundaries, physics%laws, before, this)
      associate (q => this%q, g => this%g, row => kernels%row, terms => this%terms)
        if (physics%cell%moves) then
          image(:) = image_velocity(sub, nd, c, physics%cell%before)
          v(q, 1:kernels%nf, g) = v(q, 1:kernels%nf, g) - image(1:kernels%nf)
        end if
        if (sends_back(terms)) then
          if (physics%cell%moves) free(q, 1, g) = free(q, 1, g) + cell_adds(found, physics, this, sub)
          sub%hot(q, row%shift, g) = terms%restitution*v(q, 1, g)
          if (v(q, 1, g) > 0.0_dp .and. free(q, 1, g) < 0.0_dp) sub%hot(q, row%shift, g) = 0.0_dp
        end if
        if (row%shift_t == 0) cycle
        sub%hot(q, row%shift_t:row%shift_t + nd - 2, g) = terms%tangential_restitution*v(q, 2:nd, g)
        if (size(found%spring) > 0) call pack_spring(view%list, found%spring(this%f), kernels, physics, c, v(q, 1:nd, g), sub)
      end associate
    end do
  end subroutine pack_returned

  !> The velocities that bonds have in bodies that turn: shifts of the law, which holds for v + shift. Other contacts between bodies
  !> that bonds make one let them come as near as they do in turning, and hold them against sliding from there.
  subroutine pack_bonds(view, found, boundaries, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: velocity(kernels%nd), t(3), s(3), spin(3), shift
    type(bonded_groups_t) :: groups
    type(contact_place_t) :: place
    type(packed_t) :: this
    logical :: known, joins
    integer :: c

    allocate (sub%joins(found%n))
    call find_bonded_groups(view, boundaries, physics, found, groups)
    do c = 1, found%n
      call find_packed(view, found, c, this)
      joins = found%terms(this%f)%joins
      sub%joins(c) = joins
      call groups%find_spin(view, boundaries, found, this%f, known, spin)
      if (.not. (known .or. joins)) cycle
      place = place_of(view, found, this%f, joins)
      if (known) then
        call find_bond_velocity(view, boundaries, physics, this%p, place, velocity, spin)
      else
        call find_bond_velocity(view, boundaries, physics, this%p, place, velocity)
      end if
      associate (contact => sub%hot(this%q, :, this%g), row => kernels%row)
        shift = -sum(velocity*contact(1:kernels%nd))
        if (.not. joins) shift = max(shift, contact(row%shift))
        contact(row%shift) = shift
        if (kernels%nd == 2) then
          contact(row%shift_t) = contact(2)*velocity(1) - contact(1)*velocity(2)
        else
          call contact_tangents(sub%hot, c, t, s)
          contact(row%shift_t) = -sum(velocity*t)
          contact(row%shift_s) = -sum(velocity*s)
        end if
      end associate
    end do
  end subroutine pack_bonds

  !> What a cell that moves adds to the normal velocity without contacts.
  pure real(dp) function cell_adds(found, physics, this, sub)
    type(contact_list_t), intent(in) :: found
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    real(dp) :: added(size(found%normal, 1))

    added(:) = physics%cell%added(physics%cell%free, sub%cell%branch(:, this%c), sub%cell%way(:, this%c))
    cell_adds = sum(found%normal(:, this%f)*added)
  end function cell_adds

  !> The arms of a contact between bodies with shapes (contact_rows_t); those of grains that are part of a boundary are 0.
  pure subroutine pack_arms(view, found, kernels, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(kernels_t), intent(in) :: kernels
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    type(contact_place_t) :: place
    logical :: free

    place = place_of(view, found, this%f, this%terms%joins)
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

end module gravier_contact_packing
