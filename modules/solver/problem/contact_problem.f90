!> The contact problem of one step, subdomain by subdomain, and the quantities that judge its solution.
module gravier_contact_problem
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp, i8
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_body_mass, only: add_inverse_mass, apply_inverse_mass, can_move, mass_product, multiply_mass, velocities_under
  use gravier_contact_spring, only: spring_step_t
  use gravier_moving_cell, only: cell_motion_t, cell_contacts_t
  use gravier_contact_kernels, only: kernels_t, global_impulse, lanes, lane_of, block_of
  implicit none
  private
  public :: subproblem_t, contact_problem_t, n_residual_sums

  !> sums that a residual is made of, see `take_residual`
  integer, parameter :: n_residual_sums = 4

  !> a defect of so many roundings of the largest term of R^d, a contact, is none
  real(dp), parameter :: rounding = 64.0_dp*epsilon(1.0_dp)

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

  type :: contact_problem_t
    type(communicator_t), pointer :: comm => null()
    type(kernels_t) :: kernels
    !> subdomains of this rank
    type(subproblem_t), allocatable :: sub(:)
    type(shared_exchange_t) :: shared
    !> motion of the periodic cell in this step
    type(cell_motion_t) :: cell
    !> subdomains of the scene
    integer :: n_subdomains = 1
    !> of each subdomain, (sum of |r - y|^2, sum of |r|^2) of the first sweep of the last iteration, which started from y
    !> (2, subdomains) [N^2 s^2]
    real(dp), allocatable :: progress(:, :)
    !> their sums over all subdomains, once `sum_progress` was called; whoever changes `progress` clears the mark
    real(dp), private :: progress_sums(2) = 0.0_dp
    logical :: progress_is_summed = .false.
    !> contacts of all subdomains
    integer(i8) :: n_contacts = 0
    !> root mean square of the impulses, by the last `residual` [N s]
    real(dp) :: impulse_scale = 0.0_dp
    !> whether everything prescribed is at rest and no contact sends velocities back, so that rest obeys all laws; set by
    !> gravier_velocity_error
    logical :: rest_is_admissible = .false.
    !> whether some law of the scene attracts, so that contacts may hold bodies by traction
    logical :: attracts = .false.
    !> whether some boundary moves and bonds carry its motion from body to body
    logical :: carries = .false.
    !> sum of r_n times the shift and, where rest is admissible, |V|_M^2 of the bodies in contact, by the last `residual` [J]
    real(dp) :: shift_power = 0.0_dp, kinetic = 0.0_dp
    !> largest |R^d| of a body in contact [N s] and largest free speed of one [m/s]: the scales of the two errors
    real(dp) :: force_scale = 0.0_dp, velocity_scale = 0.0_dp
    !> change of velocity in a step by loads that are the same for all grains; 0 where there are none or their like (3) [m/s]
    real(dp) :: load(3) = 0.0_dp
    !> largest term of a sum R^d [N s], whose roundings no solve gets below: where loads take a momentum away, R^d has nothing else
    real(dp) :: rounded_scale = 0.0_dp
    !> velocity against which errors of a solve are compared, see gravier_velocity_scale; set by whoever builds the problem [m/s]
    real(dp) :: error_scale = 0.0_dp
    !> velocity that boundaries or the cell impose, and at least that of a drift that nobody would see; huge where they impose none
    !> [m/s]
    real(dp) :: drive_scale = huge(1.0_dp)
  contains
    procedure :: evaluate => contact_problem_evaluate
    procedure :: residual => contact_problem_residual
    procedure :: take_residual => contact_problem_take_residual
    procedure :: rounded_defect => contact_problem_rounded_defect
    procedure :: sum_progress => contact_problem_sum_progress
    procedure :: jump => contact_problem_jump
    procedure :: received_jump => contact_problem_received_jump
    procedure :: own_reactions => contact_problem_own_reactions
    procedure :: any_impulse => contact_problem_any_impulse
    procedure :: load_attraction => contact_problem_load_attraction
    procedure :: impulse_on_candidate => contact_problem_impulse_on_candidate
  end type contact_problem_t

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

  !> Impulse r of contact `c` of subdomain `s` of this rank on its candidate, in global axes [N s].
  pure subroutine contact_problem_impulse_on_candidate(self, s, c, p)
    class(contact_problem_t), intent(in) :: self
    integer, intent(in) :: s, c
    !> (nd)
    real(dp), intent(out) :: p(:)
    real(dp) :: impulse(lanes, self%kernels%nc, 1)

    associate (sub => self%sub(s), q => lane_of(c), g => block_of(c))
      impulse(q, :, 1) = sub%impulse(q, :, g)
      impulse(q, 1, 1) = sub%normal_impulse(c)
      call global_impulse(self%kernels, sub%hot(:, :, g:g), impulse, q, p)
    end associate
  end subroutine contact_problem_impulse_on_candidate

  !> Add the attractions to the loads, v_free := v_free + M^-1 attraction_load with attraction_load = H (-h F n). Collective.
  subroutine contact_problem_load_attraction(self)
    class(contact_problem_t), intent(inout) :: self
    real(dp), allocatable :: load(:, :, :)
    integer :: s, b

    do s = 1, size(self%sub)
      associate (sub => self%sub(s))
        allocate (load(lanes, self%kernels%nc, size(sub%attraction, 2)), source=0.0_dp)
        load(:, 1, :) = -sub%attraction
        if (.not. allocated(sub%attraction_load)) allocate (sub%attraction_load, mold=sub%v_free)
        sub%attraction_load(:, :) = 0.0_dp
        call self%kernels%add_reaction(sub%pair, sub%hot, load, sub%attraction_load)
        call self%shared%load(s, sub%attraction_load)
        deallocate (load)
      end associate
    end do
    call self%shared%pass()
    do s = 1, size(self%sub)
      associate (sub => self%sub(s))
        call self%shared%sum_copies(s, sub%attraction_load, mean=.false.)
        do b = 1, sub%n_columns
          call add_inverse_mass(sub%inverse_mass(:, b), sub%attraction_load(:, b), sub%v_free(:, b))
        end do
      end associate
    end do
  end subroutine contact_problem_load_attraction

  !> R_E = H_E r_E of subdomain `s` of this rank, into `reaction`.
  subroutine contact_problem_own_reactions(self, s)
    class(contact_problem_t), intent(inout) :: self
    integer, intent(in) :: s

    associate (sub => self%sub(s))
      sub%reaction(:, :) = 0.0_dp
      call self%kernels%add_reaction(sub%pair, sub%hot, sub%impulse, sub%reaction)
    end associate
  end subroutine contact_problem_own_reactions

  !> Velocities of the undivided bodies under all impulses, v_global = M^-1 (R^d + H r), with no decomposition in it
  !> but the order of the sums. Collective.
  subroutine contact_problem_evaluate(self)
    class(contact_problem_t), intent(inout) :: self
    integer :: s

    do s = 1, size(self%sub)
      call self%own_reactions(s)
      call self%shared%load(s, self%sub(s)%reaction)
    end do
    call self%shared%pass()
    do s = 1, size(self%sub)
      call self%shared%sum_copies(s, self%sub(s)%reaction, mean=.false.)
      associate (sub => self%sub(s))
        call velocities_under(sub%inverse_mass, sub%reaction, sub%v_free, sub%v_global)
      end associate
    end do
  end subroutine contact_problem_evaluate

  !> The residual of the impulses, with v_global as `evaluate` has made it: how far each is from its own exact local solve under
  !> all others, relative to the norm of all impulses (or to force_scale where all are zero). It knows of no method. NaN where
  !> some impulse is not finite. Collective.
  subroutine contact_problem_residual(self, residual, defect)
    class(contact_problem_t), intent(inout) :: self
    real(dp), intent(out) :: residual
    !> the same, not divided by the norm of the impulses [N s]
    real(dp), intent(out) :: defect
    real(dp) :: parts(n_residual_sums, size(self%sub)), sums(n_residual_sums)
    integer :: s

    parts(:, :) = 0.0_dp
    do s = 1, size(self%sub)
      associate (sub => self%sub(s))
        call self%kernels%residual(sub%pair, sub%hot, sub%inverse_mass, sub%v_global, sub%impulse, parts(1:3, s))
        if (self%rest_is_admissible) parts(4, s) = sub%product_of(sub%v_global, sub%v_global)
      end associate
    end do
    call start_timer(phase_reduction)
    call self%comm%sum_parts(parts, sums)
    call stop_timer(phase_reduction)
    call self%take_residual(sums, residual, defect)
  end subroutine contact_problem_residual

  !> The residual by its sums over all subdomains, as `residual` returns it.
  subroutine contact_problem_take_residual(self, sums, residual, defect)
    class(contact_problem_t), intent(inout) :: self
    !> of the squared defect, of the squared impulses, of r_n times the shift; |V|_M^2 where rest is admissible
    real(dp), intent(in) :: sums(n_residual_sums)
    real(dp), intent(out) :: residual, defect

    self%shift_power = sums(3)
    self%kinetic = sums(4)
    if (.not. all(ieee_is_finite(sums(1:2)))) then
      residual = ieee_value(residual, ieee_quiet_nan)
      defect = residual
      return
    end if
    defect = sqrt(sums(1))
    self%impulse_scale = sqrt(sums(2)/max(1_i8, self%n_contacts))
    if (defect <= self%rounded_defect()) then
      ! velocities are not known better; where impulses vanish, as in a group that flies on after a shock, no iteration
      ! would bring the defect below a part of them
      residual = 0.0_dp
    else if (sums(2) > 0.0_dp) then
      residual = sqrt(sums(1)/sums(2))
    else if (sums(1) > 0.0_dp) then
      residual = defect/self%force_scale
    else
      residual = 0.0_dp
    end if
  end subroutine contact_problem_take_residual

  !> A defect that is rounding [N s].
  pure real(dp) function contact_problem_rounded_defect(self) result(defect)
    class(contact_problem_t), intent(in) :: self
    defect = rounding*self%rounded_scale*sqrt(real(self%n_contacts, dp))
  end function contact_problem_rounded_defect

  !> Sums of `progress` over all subdomains of the scene, for acceleration, checks and safeguards: one reduction an iteration at
  !> most. Collective.
  subroutine contact_problem_sum_progress(self, sums)
    class(contact_problem_t), intent(inout) :: self
    real(dp), intent(out) :: sums(2)

    if (.not. self%progress_is_summed) then
      call start_timer(phase_reduction)
      call self%comm%sum_parts(self%progress, self%progress_sums)
      call stop_timer(phase_reduction)
      self%progress_is_summed = .true.
    end if
    sums(:) = self%progress_sums
  end subroutine contact_problem_sum_progress

  !> Largest difference of translation velocity between two copies of a body under the present loads of the
  !> subdomains, relative to velocity_scale. Collective.
  real(dp) function contact_problem_jump(self) result(jump)
    class(contact_problem_t), intent(inout) :: self
    integer :: s

    do s = 1, size(self%sub)
      call self%shared%load(s, self%sub(s)%velocity)
    end do
    call self%shared%pass()
    jump = self%received_jump()
  end function contact_problem_jump

  !> The same where the copies' velocities have just been passed. Collective.
  real(dp) function contact_problem_received_jump(self) result(jump)
    class(contact_problem_t), intent(in) :: self
    integer :: s, k, j, nd

    nd = self%kernels%nd
    jump = 0.0_dp
    do s = 1, size(self%sub)
      associate (part => self%shared%part(s))
        do j = 1, part%n_slots
          k = part%slot_body(j)
          jump = max(jump, norm2(part%recv(1:nd, j) - self%sub(s)%velocity(1:nd, k)))
        end do
      end associate
    end do
    call start_timer(phase_reduction)
    jump = self%comm%highest(jump)
    call stop_timer(phase_reduction)
    if (self%velocity_scale > 0.0_dp) jump = jump/self%velocity_scale
  end function contact_problem_received_jump

  !> Whether some impulse is not zero. Collective.
  logical function contact_problem_any_impulse(self) result(any_impulse)
    class(contact_problem_t), intent(in) :: self
    integer :: s

    any_impulse = .false.
    do s = 1, size(self%sub)
      any_impulse = any_impulse .or. any(abs(self%sub(s)%impulse) > 0.0_dp)
    end do
    any_impulse = self%comm%any_true(any_impulse)
  end function contact_problem_any_impulse

end module gravier_contact_problem
