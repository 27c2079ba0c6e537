!> The energy of a scene and where it comes from and goes to, step by step. The balance is an identity of the velocities
!> and impulses of each step: it closes to rounding whatever the tolerance of the solve.
module gravier_energy_balance
  use gravier_kinds, only: dp, i8
  use gravier_boundary, only: boundary_t
  use gravier_body_store, only: body_set_t
  use gravier_body_figures, only: body_figures_t
  use gravier_contact_kernels, only: lanes, n_blocks, lane_of, block_of
  use gravier_boundary_push, only: find_earlier, find_mean_velocities, find_push
  use gravier_cell_response, only: image_velocity
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_contact_springs, only: spring_energies
  use gravier_grain_balance, only: work_of_carrying
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: energy_balance_t

  !> Energies at the end of a step, and what was done since the start; the same on every rank [J].
  type, extends(diagnostic_t) :: energy_balance_t
    !> of the free grains, and of the free components of boundaries that forces move
    real(dp) :: translation = 0.0_dp, rotation = 0.0_dp, boundaries = 0.0_dp
    !> of the free grains in the loads of the present time, from the origin, unwrapped in periodic scenes
    real(dp) :: potential = 0.0_dp
    !> kinetic energy at the start
    real(dp), private :: start = 0.0_dp
    !> done by gravity and body force on the grains; by boundaries on grains where they move as prescribed, by a periodic cell that
    !> moves, and by the forces of the user on the others
    real(dp) :: load_work = 0.0_dp, boundary_work = 0.0_dp
    !> where contacts are compliant: of their springs along the normals and along the tangents; that at the start, and whether it is
    !> known. Whether moments resist rolling, and pivoting
    real(dp), private :: elastic(2) = 0.0_dp, elastic_start = 0.0_dp
    logical, private :: has_springs = .false., knows_springs = .false., resists(2) = .false.
    !> in contacts, by the normal and by the tangential impulses, and of these by moments against rolling and against pivoting; what
    !> springs store is not among it
    real(dp) :: dissipated_normal = 0.0_dp, dissipated_friction = 0.0_dp, dissipated_moments(2) = 0.0_dp
    !> kinetic energy of grains and boundaries that were taken out of the scene
    real(dp) :: carried_away = 0.0_dp
  contains
    procedure, nopass :: features => energy_features
    procedure :: begin => energy_begin
    procedure :: take_step => energy_take_step
    procedure :: measure => energy_measure
    procedure :: columns => energy_columns
    procedure :: error => energy_error
    procedure :: turnover => energy_turnover
    procedure :: get_state => energy_get_state
    procedure :: set_state => energy_set_state
  end type energy_balance_t

  !> words of the state of a balance, and what they are, in their order: the version of checkpoints, which changes with them
  integer, parameter :: energy_words = 15
  character(len=*), parameter :: energy_record = "translation rotation boundaries potential start load_work boundary_work "// &
    & "dissipated_normal dissipated_friction carried_away elastic elastic_start dissipated_rolling dissipated_pivoting"
  !> places among the sums of a step
  integer, parameter :: in_translation = 1, in_rotation = 2, in_start = 3, in_load = 4, in_normal = 5, in_friction = 6, &
    & in_boundary = 7, in_springs = 7, in_rolling = 12, in_pivoting = 13, n_sums = 13

contains

  pure function energy_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "energy"
    features%meaning = "write the energies and works of each step"
    features%n_words = energy_words
    features%array = "energy_balance"
    features%record = energy_record
  end function energy_features

  subroutine energy_columns(self, list)
    class(energy_balance_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list

    call list%add("kinetic_translation", self%translation)
    call list%add("kinetic_rotation", self%rotation)
    call list%add("kinetic_boundaries", self%boundaries)
    call list%add("potential_energy", self%potential)
    if (self%has_springs) call list%add("elastic_energy", sum(self%elastic))
    call list%add("load_work", self%load_work)
    call list%add("boundary_work", self%boundary_work)
    call list%add("dissipated_normal", self%dissipated_normal)
    call list%add("dissipated_friction", self%dissipated_friction)
    if (self%resists(1)) then
      call list%add("dissipated_sliding", self%dissipated_friction - sum(self%dissipated_moments))
      call list%add("dissipated_rolling", self%dissipated_moments(1))
      if (self%resists(2)) call list%add("dissipated_pivoting", self%dissipated_moments(2))
    end if
    call list%add("carried_away", self%carried_away)
    call list%add("energy_error", self%error())
  end subroutine energy_columns

  !> Begin with the scene as it is. Collective.
  subroutine energy_begin(self, decomposition, physics)
    class(energy_balance_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    real(dp) :: parts(2, size(decomposition%owned)), sums(2)
    integer :: s, k, b

    self%has_springs = physics%laws%yields
    self%resists(:) = physics%resists
    self%knows_springs = .false.
    self%elastic(:) = 0.0_dp
    self%elastic_start = 0.0_dp
    self%load_work = 0.0_dp
    self%boundary_work = 0.0_dp
    self%dissipated_normal = 0.0_dp
    self%dissipated_friction = 0.0_dp
    self%dissipated_moments(:) = 0.0_dp
    self%carried_away = 0.0_dp
    parts(:, :) = 0.0_dp
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) == 0) call add_kinetic(decomposition%figures, owned, k, owned%velocity(:, k), parts(1, s), parts(2, s))
        end do
      end associate
    end do
    call decomposition%comm%sum_parts(parts, sums)
    self%translation = sums(1)
    self%rotation = sums(2)
    self%boundaries = 0.0_dp
    do b = 1, size(decomposition%boundaries)
      self%boundaries = self%boundaries + kinetic_of(decomposition%boundaries(b), decomposition%boundaries(b)%velocity)
    end do
    self%start = self%translation + self%rotation + self%boundaries
  end subroutine energy_begin

  !> Add the kinetic energies of grain `k` at a velocity.
  pure subroutine add_kinetic(figures, bodies, k, velocity, translation, rotation)
    type(body_figures_t), intent(in) :: figures
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nv)
    real(dp), intent(in), contiguous :: velocity(:)
    real(dp), intent(inout) :: translation, rotation

    translation = translation + 0.5_dp*bodies%mass(k)*sum(velocity(1:bodies%nd)**2)
    call figures%add_rotation(bodies, k, velocity, rotation)
  end subroutine add_kinetic

  !> Kinetic energy of the free components of a boundary; 0 once it is removed.
  pure real(dp) function kinetic_of(boundary, velocity) result(energy)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: velocity(3)

    energy = 0.0_dp
    if (boundary%present) energy = 0.5_dp*boundary%mass*sum(velocity**2, mask=boundary%free)
  end function kinetic_of

  !> Take the works of a step into account. Collective.
  subroutine energy_take_step(self, step)
    class(energy_balance_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    type(boundary_t) :: earlier(size(step%decomposition%boundaries))
    real(dp) :: parts(n_sums, size(step%problem%sub)), sums(n_sums), springs(2, 2)
    integer :: s

    call find_earlier(step, earlier)
    parts(:, :) = 0.0_dp
    do s = 1, size(step%problem%sub)
      call add_grains(step%halo%view(s), step%decomposition, s, step%physics, parts(:, s))
      call add_contacts(step, earlier, s, parts(:, s))
      if (step%problem%cell_moves()) parts(in_boundary, s) = parts(in_boundary, s) + work_of_carrying(step%halo%view(s), &
        & step%decomposition, s, step%physics%cell)
      if (.not. self%has_springs) cycle
      call spring_energies(step%problem, s, step%halo%view, step%physics, springs)
      parts(in_springs + 1:in_springs + 2, s) = springs(:, 1)
      parts(in_springs + 3:in_springs + 4, s) = springs(:, 2)
    end do
    call step%decomposition%comm%sum_parts(parts, sums)
    if (step%others) then
      self%carried_away = self%carried_away + (self%translation + self%rotation - sums(in_start))
    else if (step%problem%cell_moves()) then
      ! grains that cross the cell have the velocity of another image; in a step before which bodies were taken away or set, that
      ! is a part of what these have carried away
      self%boundary_work = self%boundary_work - (self%translation + self%rotation - sums(in_start))
    end if
    self%translation = sums(in_translation)
    self%rotation = sums(in_rotation)
    self%load_work = self%load_work + sums(in_load)
    self%dissipated_normal = self%dissipated_normal + sums(in_normal)
    self%dissipated_friction = self%dissipated_friction + sums(in_friction)
    self%dissipated_moments(:) = self%dissipated_moments + sums(in_rolling:in_pivoting)
    self%boundary_work = self%boundary_work + sums(in_boundary)
    if (self%has_springs) call take_springs(self, sums(in_springs + 1:in_springs + 2), sums(in_springs + 3:in_springs + 4))
    call take_boundaries(self, step%decomposition%boundaries, step%boundary_impulses)
  end subroutine energy_take_step

  !> What the springs have stored in a step is not dissipated.
  pure subroutine take_springs(self, before, after)
    type(energy_balance_t), intent(inout) :: self
    !> along the normals and along the tangents, at the start of the step and at its end [J]
    real(dp), intent(in) :: before(2), after(2)

    if (.not. self%knows_springs) then
      self%elastic(:) = before
      self%elastic_start = sum(before)
      self%knows_springs = .true.
    end if
    self%dissipated_normal = self%dissipated_normal - (after(1) - self%elastic(1))
    self%dissipated_friction = self%dissipated_friction - (after(2) - self%elastic(2))
    self%elastic(:) = after
  end subroutine take_springs

  !> Energies of the grains of a subdomain, and the work of the loads on them, h F . (V_i + V_{i+1})/2.
  pure subroutine add_grains(view, decomposition, s, physics, part)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: s
    type(physics_t), intent(in) :: physics
    real(dp), intent(inout) :: part(n_sums)
    real(dp) :: fall(decomposition%nv), rotation
    integer :: k

    rotation = 0.0_dp
    do k = 1, view%n_bodies()
      if (view%origin(k) == 0 .or. view%bodies%glued(k) > 0) cycle
      associate (before => view%bodies%velocity(:, k), after => decomposition%owned(s)%velocity(:, view%origin(k)), &
        & figures => decomposition%figures)
        call add_kinetic(figures, view%bodies, k, after, part(in_translation), part(in_rotation))
        call add_kinetic(figures, view%bodies, k, before, part(in_start), rotation)
        fall(:) = 0.0_dp
        call physics%accelerate(figures, view%bodies, k, fall)
        part(in_load) = part(in_load) + view%bodies%mass(k)*sum(fall*(0.5_dp*(before + after)))
      end associate
    end do
    part(in_start) = part(in_start) + rotation
  end subroutine add_grains

  !> Dissipation in the contacts of a subdomain, -r . (v_i + v_{i+1})/2 with the H of q_m, and the work of boundaries at
  !> them.
  subroutine add_contacts(step, earlier, s, part)
    type(solved_step_t), intent(in) :: step
    !> boundaries with the velocities of the start of the step
    type(boundary_t), intent(in) :: earlier(:)
    integer, intent(in) :: s
    real(dp), intent(inout) :: part(n_sums)
    real(dp), allocatable :: mean(:, :), v(:, :, :)
    integer :: c, q, g, last

    associate (sub => step%problem%sub(s), kernels => step%problem%kernels)
      allocate (mean(kernels%nv, sub%n_columns), v(lanes, kernels%nc, n_blocks(sub%n_contacts)))
      call find_mean_velocities(step, s, earlier, mean)
      call sub%contact_velocity(kernels, mean, v)
      do c = 1, sub%n_contacts
        q = lane_of(c)
        g = block_of(c)
        if (step%problem%cell_moves()) call add_cell_work(c)
        part(in_normal) = part(in_normal) - sub%normal_impulse(c)*v(q, 1, g)
        part(in_friction) = part(in_friction) - sum(sub%impulse(q, 2:, g)*v(q, 2:, g))
        if (kernels%rolling_row > 0) then
          ! in space about t and s, and last about the normal
          last = kernels%nf + kernels%nd - 1
          part(in_rolling) = part(in_rolling) - sum(sub%impulse(q, kernels%nf + 1:last, g)*v(q, kernels%nf + 1:last, g))
          part(in_pivoting) = part(in_pivoting) - sum(sub%impulse(q, last + 1:, g)*v(q, last + 1:, g))
        end if
        if (any(sub%pair(:, c) > sub%n_grains)) call add_boundary_work(c)
      end do
    end associate

  contains

    !> The image that a contact meets moves with the cell, as a boundary does.
    subroutine add_cell_work(c)
      integer, intent(in) :: c
      real(dp) :: image(step%problem%nd), mean_gradient(3, 3)
      integer :: nf

      associate (sub => step%problem%sub(s), cell => step%problem%cell)
        nf = step%problem%nf
        mean_gradient(:, :) = 0.5_dp*(cell%before + cell%now)
        image(:) = image_velocity(sub, step%problem%nd, c, mean_gradient)
        v(q, 1:nf, g) = v(q, 1:nf, g) - image(1:nf)
        part(in_boundary) = part(in_boundary) + sub%normal_impulse(c)*image(1) + sum(sub%impulse(q, 2:nf, g)*image(2:nf))
      end associate
    end subroutine add_cell_work

    subroutine add_boundary_work(c)
      integer, intent(in) :: c
      real(dp) :: p(step%problem%nd), m(step%problem%nv - step%problem%nd)
      integer :: column, d

      call find_push(step%problem, s, c, column, p, m)
      associate (nd => step%problem%nd, sub => step%problem%sub(s))
        do d = 1, nd
          if (.not. earlier(sub%boundary(column))%free(d)) part(in_boundary) = part(in_boundary) + p(d)*mean(d, column)
        end do
        if (step%problem%has_rolling()) part(in_boundary) = part(in_boundary) + sum(m*mean(nd + 1:, column))
      end associate
    end subroutine add_boundary_work

  end subroutine add_contacts

  !> Energies of the boundaries that forces move, and the work of these forces.
  pure subroutine take_boundaries(self, boundaries, impulses)
    type(energy_balance_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundaries(:)
    !> (nd, boundaries)
    real(dp), intent(in), contiguous :: impulses(:, :)
    real(dp) :: before, after, applied
    integer :: b, d

    before = 0.0_dp
    after = 0.0_dp
    do b = 1, size(boundaries)
      associate (boundary => boundaries(b))
        before = before + kinetic_of(boundary, boundary%last_velocity)
        after = after + kinetic_of(boundary, boundary%velocity)
        do d = 1, size(impulses, 1)
          if (.not. boundary%free(d) .or. .not. boundary%present) cycle
          applied = boundary%mass*(boundary%velocity(d) - boundary%last_velocity(d)) - impulses(d, b)
          self%boundary_work = self%boundary_work + applied*0.5_dp*(boundary%velocity(d) + boundary%last_velocity(d))
        end do
      end associate
    end do
    self%carried_away = self%carried_away + (self%boundaries - before)
    self%boundaries = after
  end subroutine take_boundaries

  !> Measure the potential energy in the places that grains have at the end of the step, -(m g + f V) . x. Collective.
  subroutine energy_measure(self, step)
    class(energy_balance_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: part(size(step%decomposition%owned)), x(step%decomposition%nd)
    integer :: s, k, d

    part(:) = 0.0_dp
    do s = 1, size(part)
      associate (decomposition => step%decomposition, load => step%physics, owned => step%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) > 0) cycle
          x(:) = owned%position(:, k)
          if (owned%ni > 0) call decomposition%period%unwrap(owned%image(:, k), x)
          do d = 1, owned%nd
            part(s) = part(s) - (owned%mass(k)*load%gravity(d) + decomposition%figures%volume_of(owned, k)*load%body_force(d))*x(d)
          end do
        end do
      end associate
    end do
    self%potential = step%decomposition%comm%sum_real(part)
  end subroutine energy_measure

  !> What the balance lacks since the start [J]: rounding, and what was taken from grains that stand still (gravier_sleeping).
  pure real(dp) function energy_error(self) result(error)
    class(energy_balance_t), intent(in) :: self
    error = ((self%translation + self%rotation + self%boundaries) - self%start) - self%load_work - self%boundary_work + &
      & self%dissipated_normal + self%dissipated_friction + self%carried_away + (sum(self%elastic) - self%elastic_start)
  end function energy_error

  !> Energy that the terms of the balance stand for: sum of their sizes [J].
  pure real(dp) function energy_turnover(self) result(turnover)
    class(energy_balance_t), intent(in) :: self
    turnover = self%translation + self%rotation + self%boundaries + self%start + abs(self%load_work) + abs(self%boundary_work) + &
      & abs(self%dissipated_normal) + abs(self%dissipated_friction) + abs(self%carried_away) + sum(self%elastic) + &
      & self%elastic_start
  end function energy_turnover

  !> All of the balance, bit for bit.
  pure subroutine energy_get_state(self, words)
    class(energy_balance_t), intent(in) :: self
    !> (energy_words)
    integer(i8), intent(out) :: words(:)

    words(1) = transfer(self%translation, 0_i8)
    words(2) = transfer(self%rotation, 0_i8)
    words(3) = transfer(self%boundaries, 0_i8)
    words(4) = transfer(self%potential, 0_i8)
    words(5) = transfer(self%start, 0_i8)
    words(6) = transfer(self%load_work, 0_i8)
    words(7) = transfer(self%boundary_work, 0_i8)
    words(8) = transfer(self%dissipated_normal, 0_i8)
    words(9) = transfer(self%dissipated_friction, 0_i8)
    words(10) = transfer(self%carried_away, 0_i8)
    words(11) = transfer(self%elastic(1), 0_i8)
    words(12) = transfer(self%elastic(2), 0_i8)
    words(13) = transfer(self%elastic_start, 0_i8)
    words(14) = transfer(self%dissipated_moments(1), 0_i8)
    words(15) = transfer(self%dissipated_moments(2), 0_i8)
  end subroutine energy_get_state

  pure subroutine energy_set_state(self, words)
    class(energy_balance_t), intent(inout) :: self
    !> (energy_words)
    integer(i8), intent(in) :: words(:)

    self%translation = transfer(words(1), 0.0_dp)
    self%rotation = transfer(words(2), 0.0_dp)
    self%boundaries = transfer(words(3), 0.0_dp)
    self%potential = transfer(words(4), 0.0_dp)
    self%start = transfer(words(5), 0.0_dp)
    self%load_work = transfer(words(6), 0.0_dp)
    self%boundary_work = transfer(words(7), 0.0_dp)
    self%dissipated_normal = transfer(words(8), 0.0_dp)
    self%dissipated_friction = transfer(words(9), 0.0_dp)
    self%carried_away = transfer(words(10), 0.0_dp)
    self%elastic(1) = transfer(words(11), 0.0_dp)
    self%elastic(2) = transfer(words(12), 0.0_dp)
    self%elastic_start = transfer(words(13), 0.0_dp)
    self%dissipated_moments(1) = transfer(words(14), 0.0_dp)
    self%dissipated_moments(2) = transfer(words(15), 0.0_dp)
    self%knows_springs = .true.
  end subroutine energy_set_state

end module gravier_energy_balance
