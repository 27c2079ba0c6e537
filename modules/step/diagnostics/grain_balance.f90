!> What every run can say of its energies at next to no cost: the kinetic energy of its grains, and how far it is from the works of
!> loads and of contacts on them. The works are taken body by body, from the impulses that the last evaluation of a solve has
!> summed up: no pass over contacts. Of the contacts it knows the work on grains alone, that of boundaries included; what it
!> dissipates, and where, is for gravier_energy_balance.
module gravier_grain_balance
  use gravier_kinds, only: dp
  use gravier_periodic, only: gradient_times
  use gravier_body_store, only: body_set_t
  use gravier_body_figures, only: body_figures_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_moving_cell, only: cell_motion_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: solved_step_t
  implicit none
  private
  public :: grain_balance_t, work_of_carrying

  !> Of the free grains since `begin`; the same on every rank [J].
  type :: grain_balance_t
    !> now, and at the start
    real(dp) :: kinetic = 0.0_dp, start = 0.0_dp
    !> done on them by gravity, body force and applied forces, and by the contacts
    real(dp) :: load_work = 0.0_dp, contact_work = 0.0_dp
    !> kinetic energy of grains that were taken out of the scene, less that of grains that entered
    real(dp) :: carried_away = 0.0_dp
    !> what counts of the kinetic energy for rest: of disks and spheres without their spins, since a spin about the normal of the
    !> only contact of a grain may last for ever and moves nothing
    real(dp) :: moving = 0.0_dp
    !> sum of their speeds now [m/s]
    real(dp) :: speeds = 0.0_dp
    !> sum of m v now [kg m/s]
    real(dp) :: momentum(3) = 0.0_dp
    !> with a body force, sum of V v now [m^4/s]
    real(dp), private :: flux(3) = 0.0_dp
  contains
    procedure :: begin => grain_balance_begin
    procedure :: take_step => grain_balance_take_step
    procedure :: error => grain_balance_error
    procedure :: turnover => grain_balance_turnover
  end type grain_balance_t

  !> places among the sums of a step; behind `in_momentum` and `in_flux` come three
  integer, parameter :: in_kinetic = 1, in_momentum = 1, in_flux = 4, in_contacts = 8, in_speeds = 9, in_moving = 10, n_sums = 10

contains

  !> Begin with the grains as they are. Collective.
  subroutine grain_balance_begin(self, decomposition, physics)
    class(grain_balance_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    real(dp) :: parts(n_sums, size(decomposition%owned)), sums(n_sums)
    integer :: s

    parts(:, :) = 0.0_dp
    do s = 1, size(parts, 2)
      call add_grains(decomposition%figures, decomposition%owned(s), physics, parts(:, s))
    end do
    call decomposition%comm%sum_parts(parts, sums)
    call keep_motion(self, sums)
    self%start = self%kinetic
    self%load_work = 0.0_dp
    self%contact_work = 0.0_dp
    self%carried_away = 0.0_dp
  end subroutine grain_balance_begin

  !> Take the works of a step into account, with the impulses on the bodies of the problem as `evaluate` sums them. Collective.
  subroutine grain_balance_take_step(self, step)
    class(grain_balance_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: parts(n_sums, size(step%problem%sub)), sums(n_sums), kinetic, momentum(3), flux(3)
    integer :: s, nd

    nd = step%decomposition%nd
    if (step%others .or. step%problem%cell_moves()) then
      kinetic = self%kinetic
      parts(:, :) = 0.0_dp
      do s = 1, size(parts, 2)
        associate (view => step%halo%view(s))
          call add_grains(step%decomposition%figures, view%bodies, step%physics, parts(:, s), view%origin)
        end associate
      end do
      call step%decomposition%comm%sum_parts(parts, sums)
      call keep_motion(self, sums)
      self%carried_away = self%carried_away + (kinetic - self%kinetic)
    end if
    momentum(:) = self%momentum
    flux(:) = self%flux
    parts(:, :) = 0.0_dp
    do s = 1, size(step%problem%sub)
      call add_grains(step%decomposition%figures, step%decomposition%owned(s), step%physics, parts(:, s))
      call add_contact_work(step%problem%sub(s), step%physics, nd, step%problem%nv, parts(in_contacts, s))
      if (step%problem%cell_moves()) parts(in_contacts, s) = parts(in_contacts, s) + work_of_carrying(step%halo%view(s), &
        & step%decomposition, s, step%physics%cell)
    end do
    call step%decomposition%comm%sum_parts(parts, sums)
    call keep_motion(self, sums)
    ! h F . (v_i + v_{i+1})/2, summed over the grains
    associate (physics => step%physics)
      self%load_work = self%load_work + 0.5_dp*physics%h*(dot_product(physics%gravity(1:nd), momentum(1:nd) + &
        & self%momentum(1:nd)) + dot_product(physics%body_force(1:nd), flux(1:nd) + self%flux(1:nd)))
    end associate
    if (step%decomposition%na > 0) self%load_work = self%load_work + applied_work(step)
    self%contact_work = self%contact_work + sums(in_contacts)
  end subroutine grain_balance_take_step

  !> Work of the applied forces in a step, h f . (v_i + v_{i+1})/2 over the free grains [J]. Collective.
  real(dp) function applied_work(step) result(work)
    type(solved_step_t), intent(in) :: step
    real(dp) :: parts(size(step%halo%view))
    integer :: s, k, nd

    nd = step%decomposition%nd
    parts(:) = 0.0_dp
    do s = 1, size(parts)
      associate (bodies => step%halo%view(s)%bodies, origin => step%halo%view(s)%origin, owned => step%decomposition%owned(s))
        do k = 1, bodies%n
          if (origin(k) == 0 .or. bodies%glued(k) > 0) cycle
          parts(s) = parts(s) + 0.5_dp*step%physics%h*dot_product(bodies%force(:, k), bodies%velocity(1:nd, k) + &
            & owned%velocity(1:nd, origin(k)))
        end do
      end associate
    end do
    work = step%decomposition%comm%sum_real(parts)
  end function applied_work

  pure subroutine keep_motion(self, sums)
    class(grain_balance_t), intent(inout) :: self
    real(dp), intent(in) :: sums(n_sums)

    self%kinetic = sums(in_kinetic)
    self%moving = sums(in_moving)
    self%speeds = sums(in_speeds)
    self%momentum(:) = sums(in_momentum + 1:in_momentum + 3)
    self%flux(:) = sums(in_flux + 1:in_flux + 3)
  end subroutine keep_motion

  !> Sums over the free grains that are owned by a subdomain; those that sleep have no part in them.
  pure subroutine add_grains(figures, bodies, physics, part, origin)
    type(body_figures_t), intent(in) :: figures
    type(body_set_t), intent(in) :: bodies
    type(physics_t), intent(in) :: physics
    real(dp), intent(inout) :: part(n_sums)
    !> of a view: its grains with 0 are ghosts (n)
    integer, intent(in), optional :: origin(:)
    integer :: k, r

    do r = 1, bodies%awake%n
      do k = bodies%awake%first(r), bodies%awake%last(r)
        if (bodies%glued(k) > 0) cycle
        if (present(origin)) then
          if (origin(k) == 0) cycle
        end if
        call add_grain(figures, bodies, k, physics, part)
      end do
    end do
  end subroutine add_grains

  !> Add kinetic energy, speed and momentum of grain `k`.
  pure subroutine add_grain(figures, bodies, k, physics, part)
    type(body_figures_t), intent(in) :: figures
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    type(physics_t), intent(in) :: physics
    real(dp), intent(inout) :: part(n_sums)
    real(dp) :: volume, square
    integer :: d, nd

    nd = bodies%nd
    square = sum(bodies%velocity(1:nd, k)**2)
    part(in_kinetic) = part(in_kinetic) + 0.5_dp*bodies%mass(k)*square
    part(in_speeds) = part(in_speeds) + sqrt(square)
    part(in_moving) = part(in_moving) + 0.5_dp*bodies%mass(k)*square
    call figures%add_rotation(bodies, k, bodies%velocity(:, k), part(in_kinetic))
    if (bodies%no > 0) then
      if (bodies%shape(k) > 0) call figures%add_rotation(bodies, k, bodies%velocity(:, k), part(in_moving))
    end if
    do d = 1, nd
      part(in_momentum + d) = part(in_momentum + d) + bodies%mass(k)*bodies%velocity(d, k)
    end do
    if (.not. any(abs(physics%body_force) > 0.0_dp)) return
    volume = figures%volume_of(bodies, k)
    do d = 1, nd
      part(in_flux + d) = part(in_flux + d) + volume*bodies%velocity(d, k)
    end do
  end subroutine add_grain

  !> Add (H r) . (v_i + v_{i+1})/2 over the grains in contact of a subdomain; copies share it. With the free velocity v_f and its
  !> part h F/m by the loads, v_i = v_f - h F/m.
  pure subroutine add_contact_work(sub, physics, nd, nv, work)
    type(subproblem_t), intent(in) :: sub
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: nd, nv
    real(dp), intent(inout) :: work
    real(dp) :: twice, volume
    integer :: b, d
    logical :: has_body_force

    has_body_force = any(abs(physics%body_force) > 0.0_dp)
    do b = 1, sub%n_grains
      twice = 0.0_dp
      do d = 1, nd
        twice = twice + sub%contact_reaction(d, b)*((sub%free_velocity(d, b) + sub%v_global(d, b)) - physics%h*physics%gravity(d))
      end do
      if (has_body_force) then
        volume = sub%volume(b)
        do d = 1, nd
          twice = twice - sub%contact_reaction(d, b)*(physics%h*physics%body_force(d)*volume*sub%inverse_mass(d, b))
        end do
      end if
      if (allocated(sub%applied)) then
        do d = 1, nd
          twice = twice - sub%contact_reaction(d, b)*sub%applied(d, b)
        end do
      end if
      do d = nd + 1, nv
        twice = twice + sub%contact_reaction(d, b)*(sub%free_velocity(d, b) + sub%v_global(d, b))
      end do
      work = work + 0.5_dp*twice/sub%multiplicity(b)
    end do
  end subroutine add_contact_work

  !> Work on the grains that a subdomain owns by carrying them along with the change of a cell's velocity, m (G' - G) x .
  !> (v_i + v_{i+1})/2 [J].
  pure real(dp) function work_of_carrying(view, decomposition, s, motion) result(work)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: s
    type(cell_motion_t), intent(in) :: motion
    real(dp) :: centre(3), change(3, 3), place(decomposition%nd), carried(decomposition%nd)
    integer :: k, nd

    nd = decomposition%nd
    centre(:) = decomposition%period%centre()
    change(:, :) = motion%now - motion%before
    work = 0.0_dp
    do k = 1, view%n_bodies()
      if (view%origin(k) == 0) cycle
      associate (before => view%bodies%velocity(1:nd, k), after => decomposition%owned(s)%velocity(1:nd, view%origin(k)))
        place(:) = view%bodies%position(:, k) - centre(1:nd)
        carried(:) = gradient_times(change, place)
        work = work + 0.5_dp*view%bodies%mass(k)*sum(carried*(before + after))
      end associate
    end do
  end function work_of_carrying

  !> What the balance lacks since the start [J]: rounding, whatever the tolerance, and what was taken from grains that stand still.
  pure real(dp) function grain_balance_error(self) result(error)
    class(grain_balance_t), intent(in) :: self
    error = (self%kinetic - self%start) - self%load_work - self%contact_work + self%carried_away
  end function grain_balance_error

  !> Energy that the terms of the balance stand for: sum of their sizes [J].
  pure real(dp) function grain_balance_turnover(self) result(turnover)
    class(grain_balance_t), intent(in) :: self
    turnover = self%kinetic + self%start + abs(self%load_work) + abs(self%contact_work) + abs(self%carried_away)
  end function grain_balance_turnover

end module gravier_grain_balance
