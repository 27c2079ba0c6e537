!> Contacts as packed arrays: pairs of columns in sweep order, contact data, and the columns of boundaries that turn.
module gravier_contact_packing
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_terms_t
  use gravier_law_set, only: law_set_t
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, block_of, lane_of, contact_jacobian, rolling_radius
  use gravier_sweep_order, only: group_contacts
  use gravier_contact_problem, only: subproblem_t
  use gravier_halo, only: local_bodies_t
  use gravier_surface_velocity, only: contact_place_t, find_start_velocity, approach_velocity, add_image_velocity
  use gravier_pair_laws, only: law_of, terms_of
  use gravier_contact_springs, only: pack_spring
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
    integer :: c, before
    type(packed_t) :: this

    allocate (pair(2, found%n), order(found%n))
    call find_pairs(view, found, boundaries, numbers, sub, pair)
    call group_contacts(pair, sub%n_bodies, order, sub%n_grouped)
    allocate (sub%pair(2, lanes*n_blocks(found%n)), source=1)
    allocate (sub%source(found%n), sub%gap(found%n))
    allocate (sub%hot(lanes, kernels%nh, n_blocks(found%n)))
    allocate (sub%impulse(lanes, kernels%nc, n_blocks(found%n)), source=0.0_dp)
    if (found%n > 0) sub%hot(:, :, n_blocks(found%n)) = 0.0_dp
    if (physics%laws%attracts) allocate (sub%attraction(lanes, n_blocks(found%n)), source=0.0_dp)
    if (physics%laws%yields) allocate (sub%spring(found%n))
    if (physics%cell%moves) allocate (sub%cell%branch(kernels%nd, found%n), sub%cell%way(kernels%nd, found%n), &
      & sub%cell%shift(kernels%nd, found%n))
    before = -1
    do c = 1, found%n
      this%c = c
      this%q = lane_of(c)
      this%g = block_of(c)
      this%f = order(c)
      this%p = found%source(this%f)
      this%i = view%list%candidate(this%p)
      this%j = view%list%antagonist(this%p)
      this%b = found%boundary(this%f)
      sub%source(c) = this%p
      sub%gap(c) = found%gap(this%f)
      sub%pair(:, c) = pair(:, this%f)
      if (this%b > 0) then
        if (boundaries(this%b)%turns()) call add_column(view, found, boundaries(this%b), kernels, this, sub)
      end if
      if (physics%cell%moves) call pack_image(view, this, sub)
      call take_terms(view, found, boundaries, physics%laws, before, this)
      call pack_terms(view, found, boundaries, kernels, physics, this, sub)
      if (physics%cell%moves) call keep_shifts(kernels, this, sub)
    end do
  end subroutine pack_contacts

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
  pure subroutine pack_image(view, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub

    associate (way => sub%cell%way(:, this%c))
      way(:) = 0.0_dp
      call view%period%add_shift(view%list%shift(this%p), 1, way)
      sub%cell%branch(:, this%c) = view%bodies%position(:, this%i) - view%bodies%position(:, this%j) - way
    end associate
  end subroutine pack_image

  !> Keep what the law alone adds to the velocities of a contact.
  pure subroutine keep_shifts(kernels, this, sub)
    type(kernels_t), intent(in) :: kernels
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub

    associate (row => kernels%row, shift => sub%cell%shift(:, this%c))
      shift(:) = 0.0_dp
      shift(1) = sub%hot(this%q, row%shift, this%g)
      if (row%shift_t > 0) shift(2:) = sub%hot(this%q, row%shift_t:row%shift_t + kernels%nd - 2, this%g)
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
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      b = found%boundary(f)
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

    associate (q => this%q, g => this%g, i => this%i, j => this%j, row => kernels%row, terms => this%terms)
      sub%hot(q, 1:kernels%nd, g) = found%normal(:, this%f)
      if (row%arm_i > 0) then
        call pack_arms(view, found, kernels, this, sub)
      else if (row%lever_i > 0) then
        sub%hot(q, row%lever_i, g) = merge(view%bodies%radius(i), 0.0_dp, view%bodies%glued(i) == 0)
        sub%hot(q, row%lever_j, g) = 0.0_dp
        if (j > 0) sub%hot(q, row%lever_j, g) = merge(view%bodies%radius(j), 0.0_dp, view%bodies%glued(j) == 0)
      end if
      if (terms%restitution > 0.0_dp) then
        sub%hot(q, row%shift, g) = terms%restitution*returned_velocity(view, found, boundaries, kernels, physics, &
          & this, sub)
      else
        sub%hot(q, row%shift, g) = terms%free_gap/physics%h
      end if
      if (allocated(sub%attraction)) sub%attraction(q, g) = physics%h*terms%attraction
      if (kernels%nc == 1) return
      sub%hot(q, row%friction, g) = terms%friction
      if (row%shift_t > 0) call pack_tangential_shift(view, found, boundaries, kernels, physics, this, sub)
      if (row%rolling_radius == 0) return
      sub%hot(q, row%rolling_radius, g) = rolling_radius(sub%hot(q, row%lever_i, g), sub%hot(q, row%lever_j, g))
      sub%hot(q, row%rolling_friction, g) = terms%rolling_friction
      if (kernels%nd == 3) sub%hot(q, row%pivoting_friction, g) = terms%pivoting_friction
    end associate
  end subroutine pack_terms

  !> Normal velocity at the start of the step as far as the contact sends it back. It counts where the contact opens, too: what
  !> strikes from behind would get energy from a contact that only holds. Where the loads of the step alone close it again,
  !> the contact comes to rest.
  real(dp) function returned_velocity(view, found, boundaries, kernels, physics, this, sub) result(returned)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    real(dp) :: free
    integer :: d

    if (kernels%row%arm_i > 0) then
      returned = returned_by_shapes(view, found, boundaries, kernels, physics, this, sub)
      return
    end if
    returned = approach_velocity(view, boundaries, this%p, found%gap(this%f), found%normal(:, this%f))
    if (returned <= 0.0_dp) return
    free = cell_adds(found, physics, this, sub)
    do d = 1, kernels%nd
      free = free + (sub%v_free(d, sub%pair(1, this%c)) - sub%v_free(d, sub%pair(2, this%c)))*found%normal(d, this%f)
    end do
    if (free < 0.0_dp) returned = 0.0_dp
  end function returned_velocity

  !> The same of bodies with shapes, at the point where they touch.
  real(dp) function returned_by_shapes(view, found, boundaries, kernels, physics, this, sub) result(returned)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    real(dp) :: rows(kernels%nc, kernels%nv, 2), vi(kernels%nv), vj(kernels%nv)

    call contact_jacobian(kernels, sub%hot, this%c, rows(:, :, 1), rows(:, :, 2))
    call find_start_velocities(view, found, boundaries, this, sub, vi, vj)
    returned = sum(rows(1, :, 1)*vi + rows(1, :, 2)*vj)
    if (returned <= 0.0_dp) return
    vi(:) = sub%v_free(:, sub%pair(1, this%c))
    vj(:) = sub%v_free(:, sub%pair(2, this%c))
    if (sum(rows(1, :, 1)*vi + rows(1, :, 2)*vj) + cell_adds(found, physics, this, sub) < 0.0_dp) returned = 0.0_dp
  end function returned_by_shapes

  !> What a cell that moves adds to the normal velocity without contacts.
  pure real(dp) function cell_adds(found, physics, this, sub)
    type(contact_list_t), intent(in) :: found
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(in) :: sub
    real(dp) :: added(size(found%normal, 1))

    cell_adds = 0.0_dp
    if (.not. physics%cell%moves) return
    added(:) = physics%cell%added(physics%cell%free, sub%cell%branch(:, this%c), sub%cell%way(:, this%c))
    cell_adds = sum(found%normal(:, this%f)*added)
  end function cell_adds

  !> Tangential velocity at the start of the step as far as the contact sends it back (Newton), or what springs make of it.
  subroutine pack_tangential_shift(view, found, boundaries, kernels, physics, this, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    type(boundary_t), intent(in) :: boundaries(:)
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(packed_t), intent(in) :: this
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: rows(kernels%nc, kernels%nv, 2), vi(kernels%nv), vj(kernels%nv), v(kernels%nd)
    integer :: d

    call contact_jacobian(kernels, sub%hot, this%c, rows(:, :, 1), rows(:, :, 2))
    call find_start_velocities(view, found, boundaries, this, sub, vi, vj)
    do d = 1, kernels%nd
      v(d) = sum(rows(d, :, 1)*vi + rows(d, :, 2)*vj)
    end do
    do d = 2, kernels%nd
      sub%hot(this%q, kernels%row%shift_t + d - 2, this%g) = this%terms%tangential_restitution*v(d)
    end do
    if (size(found%spring) > 0) call pack_spring(view%list, found%spring(this%f), kernels, physics%h, this%c, v, sub)
  end subroutine pack_tangential_shift

  !> Velocities at the start of the step: of a free grain, translation and spin; of a boundary, that of its point that is touched.
  !> Loads give grains no spin, so that the spin without contacts is that of the start, which in space goes round with the body and
  !> has its energy.
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
    call add_image_velocity(view, this%p, vj(1:nd))
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

end module gravier_contact_packing
