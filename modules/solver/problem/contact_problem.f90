!> The contact problem of one step, subdomain by subdomain, and the quantities that judge its solution.
module gravier_contact_problem
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp, i8
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_body_mass, only: add_inverse_mass, velocities_under
  use gravier_moving_cell, only: cell_motion_t
  use gravier_subproblem, only: subproblem_t
  use gravier_effects, only: effects_t
  use gravier_contact_kernels, only: kernels_t, packed_layout_t, global_impulse, lanes, lane_of, block_of
  implicit none
  private
  public :: contact_problem_t, n_residual_sums

  !> sums that a residual is made of, see `take_residual`
  integer, parameter :: n_residual_sums = 4

  !> a defect of so many roundings of the largest term of R^d, a contact, is none
  real(dp), parameter :: rounding = 64.0_dp*epsilon(1.0_dp)

  !> The subproblems of a rank and what they have in common. The layout of their arrays is that of the kernels, with which
  !> `take_kernels` and `choose_kernels` set it.
  type, extends(packed_layout_t) :: contact_problem_t
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
    procedure :: choose_kernels => contact_problem_choose_kernels
    procedure :: take_kernels => contact_problem_take_kernels
    procedure :: cell_moves => contact_problem_cell_moves
    procedure :: cell_is_driven => contact_problem_cell_is_driven
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

  !> Choose the loops for a dimension and the effects that the scene has, and with them the layout of the packed arrays.
  subroutine contact_problem_choose_kernels(self, dimension, effects)
    class(contact_problem_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(kernels_t) :: kernels

    call kernels%choose(dimension, effects)
    call self%take_kernels(kernels)
  end subroutine contact_problem_choose_kernels

  !> Take loops that are chosen, and with them the layout of the packed arrays.
  pure subroutine contact_problem_take_kernels(self, kernels)
    class(contact_problem_t), intent(inout) :: self
    type(kernels_t), intent(in) :: kernels

    self%kernels = kernels
    self%packed_layout_t = kernels%packed_layout_t
  end subroutine contact_problem_take_kernels

  !> Whether the periodic cell moves in this step.
  pure logical function contact_problem_cell_moves(self) result(moves)
    class(contact_problem_t), intent(in) :: self
    moves = self%cell%moves
  end function contact_problem_cell_moves

  !> Whether stresses drive the cell, so that its motion is found along with the impulses.
  pure logical function contact_problem_cell_is_driven(self) result(is_driven)
    class(contact_problem_t), intent(in) :: self
    is_driven = self%cell%is_driven
  end function contact_problem_cell_is_driven

  !> Impulse r of contact `c` of subdomain `s` of this rank on its candidate, in global axes [N s].
  pure subroutine contact_problem_impulse_on_candidate(self, s, c, p)
    class(contact_problem_t), intent(in) :: self
    integer, intent(in) :: s, c
    !> (nd)
    real(dp), intent(out) :: p(:)
    real(dp) :: impulse(lanes, self%nc, 1)

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
        allocate (load(lanes, self%nc, size(sub%attraction, 2)), source=0.0_dp)
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
      call sub%react_to(self%kernels, sub%impulse)
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

    nd = self%nd
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
