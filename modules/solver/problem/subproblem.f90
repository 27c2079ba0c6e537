!> The contact problem of one subdomain: its contacts, the bodies that they touch, and what these say of each other.
module gravier_subproblem
  use gravier_kinds, only: dp, i8
  use gravier_body_mass, only: apply_inverse_mass, can_move, mass_product, multiply_mass
  use gravier_contact_spring, only: spring_step_t
  use gravier_moving_cell, only: cell_contacts_t
  use gravier_contact_kernels, only: kernels_t, lane_of, block_of, project_on_cones
  implicit none
  private
  public :: subproblem_t

  !> The contacts of one subdomain and the bodies they touch, packed in sweep order. Bodies 1 to n_grains are free
  !> grains, up to n_bodies follow boundaries that forces move, up to n_columns what moves as prescribed. Grains that sleep are
  !> among the last: they stand still.
  !>
  !> Attractions F of contacts are loads of the solve, and unilateral contact holds for r~_n = r_n + h F. `impulse`, `reaction` and
  !> `v_free` are always those of the solve, r~ and its loads, in the solve and after it. The impulse r on the bodies and what
  !> belongs to it are asked of `normal_impulse`, `contact_reaction`, `free_velocity` and `impulse_on_candidate`.
  type :: subproblem_t
    !> global number of the subdomain, from 1
    integer :: subdomain = 0
    integer :: n_grains = 0, n_bodies = 0, n_columns = 0, n_contacts = 0
    !> contacts in whole blocks without common bodies: the first ones
    integer :: n_grouped = 0
    !> pairs of pieces of bodies with shapes whose cores overlap: by more than both roundings
    integer :: overlapping_cores = 0
    !> points in which bodies touch, but for which their pairs have no place
    integer :: points_left_out = 0
    !> contacts whose intact bond is stretched
    integer :: stretched_bonds = 0
    !> identifiers (n_columns)
    integer(i8), allocatable :: id(:)
    !> subdomain that holds the centre of each grain, or keeps account of a boundary (n_bodies)
    integer, allocatable :: owner(:)
    !> place of each grain among those owned by this subdomain, 0 for those owned elsewhere (n_grains)
    integer, allocatable :: place(:)
    !> subdomains in which each body carries contacts (n_bodies)
    integer, allocatable :: multiplicity(:)
    !> factor of the mass of each body in the velocity error, where slow bodies are beside fast ones; not allocated: 1 (n_bodies)
    real(dp), allocatable :: concern(:)
    !> number of the boundary behind a column, 0 for a grain that sleeps (n_grains + 1 to n_columns)
    integer, allocatable :: boundary(:)
    !> of grains (n_grains) [m]
    real(dp), allocatable :: radius(:)
    !> of grains, where a force acts on their volume (n_grains) [m^3, m^2 in 2D]
    real(dp), allocatable :: volume(:)
    !> what the applied forces of a loop of the user's own add to the velocity of grains, where there are such (nd, n_grains) [m/s]
    real(dp), allocatable :: applied(:, :)
    !> velocity without contacts, M^-1 R^d, with attractions among the loads (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable :: v_free(:, :)
    !> largest of the terms of R^d, momenta at the start of the step and impulses of loads but attractions, of a body [N s]
    real(dp) :: largest_term = 0.0_dp
    !> velocity under the method's present loads (nv, n_columns)
    real(dp), allocatable :: velocity(:, :)
    !> velocity of the undivided bodies under all impulses (nv, n_columns), made by `evaluate`
    real(dp), allocatable :: v_global(:, :)
    !> H r~ (nv, n_columns), of all copies after `evaluate`; work space of methods [N s, N m s]
    real(dp), allocatable :: reaction(:, :)
    !> 1/m along each axis and, where bodies turn, 1/I of the undivided bodies, 0 for what cannot move (gravier_body_mass)
    !> (nw, n_columns)
    real(dp), allocatable :: inverse_mass(:, :)
    !> the same as the method divides masses among copies (nw, n_columns)
    real(dp), allocatable :: weight(:, :)
    !> (2, lanes*blocks), (lanes, nh, blocks), (lanes, nc, blocks): see gravier_contact_kernels
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: hot(:, :, :)
    !> r~, of which a normal part above 0 says that the bodies touch
    real(dp), allocatable :: impulse(:, :, :)
    !> where some law of the scene attracts: h F of the attraction F of each contact (lanes, blocks) [N s], and their load on the
    !> bodies, H (-h F n), of all copies (nv, n_columns) [N s, N m s]
    real(dp), allocatable :: attraction(:, :), attraction_load(:, :)
    !> where some law of the scene has springs: those of each contact (n_contacts)
    type(spring_step_t), allocatable :: spring(:)
    !> where some law of the scene has bonds: whether an intact one holds the contact (n_contacts)
    logical, allocatable :: joins(:)
    !> largest product of the step and the frequency sqrt(k W_nn) of a normal spring
    real(dp) :: stiffest = 0.0_dp
    !> compliant contacts that are pressed together, and the sum of h^2 k W_nn over them, of which only so much counts
    integer :: n_springs = 0
    real(dp) :: stiffness = 0.0_dp
    !> gap at q_m (n_contacts) [m]
    real(dp), allocatable :: gap(:)
    !> place of each contact in the neighbour list (n_contacts)
    integer, allocatable :: source(:)
    !> where the periodic cell moves
    type(cell_contacts_t) :: cell
  contains
    procedure :: share_masses => subproblem_share_masses
    procedure :: update_local_operator => subproblem_update_local_operator
    procedure :: start_without_impulses => subproblem_start_without_impulses
    procedure :: start_sweeps => subproblem_start_sweeps
    procedure :: take_impulses_off => subproblem_take_impulses_off
    procedure :: add_impulses => subproblem_add_impulses
    procedure :: project_impulses => subproblem_project_impulses
    procedure :: contact_velocity => subproblem_contact_velocity
    procedure :: add_reaction => subproblem_add_reaction
    procedure :: react_to => subproblem_react_to
    procedure :: reorder_grains => subproblem_reorder_grains
    procedure :: moves => subproblem_moves
    procedure :: multiply_mass => subproblem_multiply_mass
    procedure :: product_of => subproblem_product_of
    procedure :: normal_impulse => subproblem_normal_impulse
    procedure :: yields => subproblem_yields
    procedure :: is_bonded => subproblem_is_bonded
    procedure :: overlap => subproblem_overlap
    procedure :: contact_reaction => subproblem_contact_reaction
    procedure :: free_velocity => subproblem_free_velocity
  end type subproblem_t

contains

  !> Set the masses that sweeps work with: undivided, or shared equally between the copies, M~ = M/m (7)-(8).
  subroutine subproblem_share_masses(self, kernels, shared)
    class(subproblem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    logical, intent(in) :: shared
    integer :: b

    self%weight(:, :) = self%inverse_mass
    if (shared) then
      do b = 1, self%n_bodies
        self%weight(:, b) = self%multiplicity(b)*self%inverse_mass(:, b)
      end do
    end if
    call self%update_local_operator(kernels)
  end subroutine subproblem_share_masses

  !> Inverse diagonal of the local operators from `weight`, into the contact data.
  pure subroutine subproblem_update_local_operator(self, kernels, factors)
    class(subproblem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    !> relaxation factors of local solves in sweeps, of the normal, tangential and rolling part; 1 if absent
    real(dp), intent(in), optional :: factors(3)
    real(dp) :: taken(3)

    if (self%n_contacts == 0) return
    taken(:) = 1.0_dp
    if (present(factors)) taken(:) = factors
    call kernels%set_operators(self%pair, self%hot, self%weight, taken)
    ! contacts of no effect are all zero
    self%hot(lane_of(self%n_contacts) + 1:, :, block_of(self%n_contacts)) = 0.0_dp
  end subroutine subproblem_update_local_operator

  !> Reactions and velocities of a solve that starts without impulses.
  subroutine subproblem_start_without_impulses(self)
    class(subproblem_t), intent(inout) :: self
    self%reaction(:, :) = 0.0_dp
    self%v_global(:, :) = self%v_free
  end subroutine subproblem_start_without_impulses

  !> Masses as a method wants them, and velocities those of the undivided bodies, from which its sweeps start.
  subroutine subproblem_start_sweeps(self, kernels, shared_masses)
    class(subproblem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    !> see `share_masses`
    logical, intent(in) :: shared_masses

    call self%share_masses(kernels, shared_masses)
    self%velocity(:, :) = self%v_global
  end subroutine subproblem_start_sweeps

  !> Leave of the impulses what they have changed by since others.
  subroutine subproblem_take_impulses_off(self, others)
    class(subproblem_t), intent(inout) :: self
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: others(:, :, :)
    self%impulse(:, :, :) = self%impulse - others
  end subroutine subproblem_take_impulses_off

  !> Go from the impulses along a step.
  subroutine subproblem_add_impulses(self, length, step)
    class(subproblem_t), intent(inout) :: self
    !> part of the step
    real(dp), intent(in) :: length
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: step(:, :, :)
    self%impulse(:, :, :) = self%impulse + length*step
  end subroutine subproblem_add_impulses

  !> Bring the impulses into the cones of the laws.
  subroutine subproblem_project_impulses(self, kernels)
    class(subproblem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    call project_on_cones(kernels, self%n_contacts, self%hot, self%impulse)
  end subroutine subproblem_project_impulses

  !> v = H^T V of velocities of the bodies, for all contacts.
  pure subroutine subproblem_contact_velocity(self, kernels, velocity, v)
    class(subproblem_t), intent(in) :: self
    type(kernels_t), intent(in) :: kernels
    !> (nv, n_columns) [m/s, rad/s]
    real(dp), intent(in), contiguous :: velocity(:, :)
    !> (lanes, nc, blocks) [m/s]
    real(dp), intent(inout), contiguous :: v(:, :, :)

    call kernels%contact_velocity(self%pair, self%hot, velocity, v)
  end subroutine subproblem_contact_velocity

  !> R := R + H r of some impulses of the contacts.
  pure subroutine subproblem_add_reaction(self, kernels, impulse, reaction)
    class(subproblem_t), intent(in) :: self
    type(kernels_t), intent(in) :: kernels
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: impulse(:, :, :)
    !> (nv, n_columns), an array of the caller's [N s, N m s]
    real(dp), intent(inout), contiguous :: reaction(:, :)

    call kernels%add_reaction(self%pair, self%hot, impulse, reaction)
  end subroutine subproblem_add_reaction

  !> H r of some impulses of the contacts, into `reaction`.
  pure subroutine subproblem_react_to(self, kernels, impulse)
    class(subproblem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: impulse(:, :, :)

    self%reaction(:, :) = 0.0_dp
    call kernels%add_reaction(self%pair, self%hot, impulse, self%reaction)
  end subroutine subproblem_react_to

  !> Bring what is known of the grains into another order; columns of boundaries stay.
  subroutine subproblem_reorder_grains(self, grain)
    class(subproblem_t), intent(inout) :: self
    !> number so far of each grain
    integer, intent(in), contiguous :: grain(:)
    type(subproblem_t) :: old
    integer :: n, b

    call move_alloc(self%id, old%id)
    call move_alloc(self%owner, old%owner)
    call move_alloc(self%place, old%place)
    call move_alloc(self%multiplicity, old%multiplicity)
    call move_alloc(self%radius, old%radius)
    call move_alloc(self%volume, old%volume)
    call move_alloc(self%applied, old%applied)
    call move_alloc(self%v_free, old%v_free)
    call move_alloc(self%inverse_mass, old%inverse_mass)
    call move_alloc(self%cell%place, old%cell%place)
    allocate (self%id, source=old%id)
    allocate (self%owner, source=old%owner)
    allocate (self%place, mold=old%place)
    allocate (self%multiplicity, source=old%multiplicity)
    allocate (self%radius, mold=old%radius)
    if (allocated(old%volume)) allocate (self%volume, mold=old%volume)
    if (allocated(old%applied)) allocate (self%applied, mold=old%applied)
    allocate (self%v_free, source=old%v_free)
    allocate (self%inverse_mass, source=old%inverse_mass)
    if (allocated(old%cell%place)) allocate (self%cell%place, mold=old%cell%place)
    do n = 1, self%n_grains
      b = grain(n)
      self%id(n) = old%id(b)
      self%owner(n) = old%owner(b)
      self%place(n) = old%place(b)
      self%multiplicity(n) = old%multiplicity(b)
      self%radius(n) = old%radius(b)
      if (allocated(old%volume)) self%volume(n) = old%volume(b)
      if (allocated(old%applied)) self%applied(:, n) = old%applied(:, b)
      self%v_free(:, n) = old%v_free(:, b)
      self%inverse_mass(:, n) = old%inverse_mass(:, b)
      if (allocated(old%cell%place)) self%cell%place(:, n) = old%cell%place(:, b)
    end do
  end subroutine subproblem_reorder_grains

  !> Whether degree of freedom `d` of body `b` can move.
  pure logical function subproblem_moves(self, d, b) result(moves)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: d, b
    moves = can_move(self%inverse_mass(:, b), d)
  end function subproblem_moves

  !> v := M v of body `b` with the masses in `weight`; 0 for components that cannot move.
  pure subroutine subproblem_multiply_mass(self, b, v)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: b
    !> (nv) [m/s, rad/s] in, [N s, N m s] out
    real(dp), intent(inout), contiguous :: v(:)

    call multiply_mass(self%inverse_mass(:, b), self%weight(:, b), v)
  end subroutine subproblem_multiply_mass

  !> (a, b)_M of two velocities of the bodies that can move, a copy of a shared body counting with its part [J].
  pure real(dp) function subproblem_product_of(self, a, b) result(total)
    class(subproblem_t), intent(in) :: self
    !> (nv, n_columns)
    real(dp), intent(in), contiguous :: a(:, :), b(:, :)
    integer :: k

    total = 0.0_dp
    do k = 1, self%n_bodies
      total = total + mass_product(self%inverse_mass(:, k), a(:, k), b(:, k))/self%multiplicity(k)
    end do
  end function subproblem_product_of

  !> Normal impulse of contact `c` on its candidate, r_n = r~_n - h F [N s]; below 0 where the attraction pulls more than the bodies
  !> press.
  pure real(dp) function subproblem_normal_impulse(self, c) result(impulse)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: c

    impulse = self%impulse(lane_of(c), 1, block_of(c))
    if (allocated(self%attraction)) impulse = impulse - self%attraction(lane_of(c), block_of(c))
  end function subproblem_normal_impulse

  !> Whether contact `c` is compliant: its overlap is deformation, and no error.
  pure logical function subproblem_yields(self, c) result(yields)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: c

    yields = .false.
    if (allocated(self%spring)) yields = self%spring(c)%spring%yields()
  end function subproblem_yields

  !> Whether an intact bond holds contact `c`: its overlap is the length that it had when it was made, and no error.
  pure logical function subproblem_is_bonded(self, c) result(is_bonded)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: c

    is_bonded = .false.
    if (allocated(self%joins)) is_bonded = self%joins(c)
  end function subproblem_is_bonded

  !> Largest overlap of the contacts that yield, or of those that are rigid and not bonded; 0 where there is none [m].
  pure real(dp) function subproblem_overlap(self, yielding) result(overlap)
    class(subproblem_t), intent(in) :: self
    logical, intent(in) :: yielding
    integer :: c

    overlap = 0.0_dp
    if (allocated(self%spring) .or. allocated(self%joins)) then
      do c = 1, self%n_contacts
        if (self%is_bonded(c)) cycle
        if (self%yields(c) .eqv. yielding) overlap = max(overlap, -self%gap(c))
      end do
    else if (self%n_contacts > 0 .and. .not. yielding) then
      overlap = max(overlap, -minval(self%gap))
    end if
    ! a zero without a sign, whichever of two zeros was larger
    if (overlap <= 0.0_dp) overlap = 0.0_dp
  end function subproblem_overlap

  !> Impulse of all contacts on body `b`, component `d` of H r = H r~ - H h F n, once `evaluate` was called [N s, N m s].
  pure real(dp) function subproblem_contact_reaction(self, d, b) result(reaction)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: d, b

    reaction = self%reaction(d, b)
    if (allocated(self%attraction_load)) reaction = reaction + self%attraction_load(d, b)
  end function subproblem_contact_reaction

  !> Velocity of body `b` without contacts and without their attractions, component `d` [m/s, rad/s].
  pure real(dp) function subproblem_free_velocity(self, d, b) result(velocity)
    class(subproblem_t), intent(in) :: self
    integer, intent(in) :: d, b

    !> most degrees of freedom of a body
    real(dp) :: change(6)

    velocity = self%v_free(d, b)
    if (.not. allocated(self%attraction_load)) return
    call apply_inverse_mass(self%inverse_mass(:, b), self%attraction_load(:, b), change(1:size(self%v_free, 1)))
    ! the product is rounded by itself
    velocity = velocity - change(d)
  end function subproblem_free_velocity

end module gravier_subproblem
