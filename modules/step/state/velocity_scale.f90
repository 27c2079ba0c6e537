!> The velocity against which errors of a solve are compared. A residual is small against the impulses of a step, whatever
!> moves; an error of velocities has to be small against what moves: in slow shear against the speed of the wall, in settling
!> against what loads do in a step, in fast flow against the motion itself.
!>
!>     load   what loads do to the mean grain in a step (mass m, diameter d):
!>            h |g + f/rho|, h p d^2/m (2D: h p d/m) of a boundary on which forces p A act, or of a stress that a cell holds;
!>            root mean square of what applied forces add to velocities; of attractions, where there is no other load
!>     drive  largest difference of imposed velocities; of a cell that deforms, its rate of strain times d; now, ten steps
!>            before or ten steps later, which counts where a drive turns round, 30 steps where it begins or ends at rest
!>     creep  0.01 d/T, the drift that nobody would see in the simulated time T
!>     own    root mean square velocity of the bodies in contact at the start of the step, beside that of a cell that deforms. Spins
!>            of bodies that are no disks or spheres count with their energy, because they bring surfaces towards each other
!>     apart  the same beside the mean velocity of the bodies: what they move against each other
!>     stress of bodies that nothing loads or drives and that do not move, but that are wedged between fixed ones: root mean
!>            square of the normal impulses that the step starts from, over m
!>     bonds  what the mean strength of bonds that break for good gives to the mean grain in a step
!>     s      mean over the contacts that bear something of h^2 k/m, at most 20 each, with the stiffness k along the normal of
!>            compliant ones, 0 of rigid ones, and the mass m that bodies have there for each other, half of that of one of two
!>            equal grains. An error that is a part of what a load does to velocities in a step changes forces by s times this part
!>            of the load. A load on springs counts 1/(1 + s) times.
!>     U      = max(U_q, 0.3 f own);  U_q = min(load, max(drive, creep)) where both are there, else the one that is there, else
!>            stress; f = sqrt(1 - e^2), at least 0.05, where e is the largest coefficient of restitution
!> Where there are bonds, U is at most max(U_q, 0.2 bonds), and 0.2 bonds is the load where there is no other. Bonds, and
!> attractions that would bring grains together from the end of their range in one step, balance each other inside of bodies, and
!> say as little of what moves as the strength of a wall: where they alone are the load, U_q is min(load, creep).
module gravier_velocity_scale
  use gravier_kinds, only: dp
  use gravier_periodic, only: gradient_times
  use gravier_communicator, only: communicator_t
  use gravier_motion, only: grain_volume
  use gravier_body_mass, only: mass_product, are_uneven
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_boundary_levers, only: find_levers
  use gravier_imposed_motion, only: imposed_motion_t, find_imposed, largest_imposed
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: velocity_scale_t

  !> share of the motion that goes on which an error may be compared with
  real(dp), parameter :: share_of_own = 0.3_dp
  !> The smallest value of f = sqrt(1 - e^2). It is small because errors of solves add energy, which impacts that lose none never
  !> take away again.
  real(dp), parameter :: least_lost = 0.05_dp
  !> Bodies count as wedged if they move by less than this part of the velocity that the impulses of a step would give to the mean
  !> grain. After impacts they move by half of it and more.
  real(dp), parameter :: little_motion = 0.2_dp
  !> diameters by which grains may drift in the simulated time
  real(dp), parameter :: drift = 0.01_dp
  !> The part of the velocity that bonds could give to the mean grain in a step which U may have at most: the motion as a whole says
  !> nothing of the forces that bonds have to bear.
  real(dp), parameter :: share_of_bonds = 0.2_dp
  !> A body is slow if its own scale is below this part of U. Where U_q is 0, an own scale is at least so much of U.
  real(dp), parameter :: slow_part = 0.25_dp, least_own = 1.0e-3_dp
  !> s from which on the kind of a load names springs
  real(dp), parameter :: much_stiffer = 0.1_dp
  !> the kinds of U where it is the motion that goes on, where bonds limit that, and where loads press springs
  character(len=*), parameter :: of_motion = "motion of the bodies", of_bonds = "strength of bonds", &
    & of_springs = "load on springs"

  type :: velocity_scale_t
    !> what can be meant by the velocity of a scene, and which velocity counts [m/s]
    real(dp) :: load = 0.0_dp, drive = 0.0_dp, creep = 0.0_dp, apart = 0.0_dp, own = 0.0_dp, stress = 0.0_dp, value = 0.0_dp
    !> the one that counts
    character(len=20) :: kind = "none"
    !> diameter [m] and mass [kg] of the mean grain; 0 without grains
    real(dp) :: diameter = 0.0_dp, mass = 0.0_dp
    !> simulated time [s]; 0: none
    real(dp) :: duration = 0.0_dp
    !> largest coefficient of restitution of the laws; s, 0 without compliant contacts
    real(dp) :: restitution = 0.0_dp, stiffness = 0.0_dp
    !> the load is that of attractions, in the place of another one, and holds bodies together
    logical :: internal = .false.
    !> what the mean attraction of a bond that may break for good gives to the mean grain in a step; 0 without bonds [m/s]
    real(dp) :: bonds = 0.0_dp
    !> U_q [m/s], and the part of the motion that errors are compared with
    real(dp) :: quiet = 0.0_dp, share = 0.0_dp
    !> value that the user gives in the place of all rules; 0: none [m/s]
    real(dp) :: given = 0.0_dp
    !> velocity of the observer: that which all boundaries have in common, or of the whole scene where there are none [m/s]
    real(dp) :: frame(3) = 0.0_dp
    !> mean velocity of the bodies in contact at the start of the step beside `frame`, by mass [m/s]
    real(dp) :: mean(3) = 0.0_dp
    !> how far from its pivot each boundary reaches grains (boundaries) [m]
    real(dp), allocatable :: lever(:)
  contains
    procedure :: moves => velocity_scale_moves
    procedure :: init => velocity_scale_init
    procedure :: measure => velocity_scale_measure
    procedure :: load_of => velocity_scale_load_of
    procedure :: pressure_of => velocity_scale_pressure_of
    procedure, private :: choose => velocity_scale_choose
  end type velocity_scale_t

contains

  !> Take the mean grain and the levers from a scene as it was made: they stay, so that a run that goes on from a checkpoint
  !> compares with the same velocity. Collective.
  subroutine velocity_scale_init(self, comm, grains, boundaries, duration, given)
    class(velocity_scale_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    !> of this rank
    type(body_set_t), intent(in) :: grains
    type(boundary_t), intent(in) :: boundaries(:)
    !> simulated time [s], and velocity of the user, 0 for none [m/s]
    real(dp), intent(in) :: duration, given
    real(dp), allocatable :: parts(:, :)
    real(dp) :: sums(3)
    integer :: k

    allocate (parts(3, grains%n))
    do k = 1, grains%n
      parts(1, k) = grains%radius(k)
      parts(2, k) = grains%mass(k)
      parts(3, k) = 1.0_dp
    end do
    call comm%sum_parts(parts, sums)
    self%diameter = 0.0_dp
    self%mass = 0.0_dp
    if (sums(3) > 0.0_dp) then
      self%diameter = 2.0_dp*sums(1)/sums(3)
      self%mass = sums(2)/sums(3)
    end if
    self%duration = duration
    self%given = given
    if (allocated(self%lever)) deallocate (self%lever)
    allocate (self%lever(size(boundaries)))
    call find_levers(grains, boundaries, self%lever)
    call comm%highest_of(self%lever)
  end subroutine velocity_scale_init

  !> Find the velocity of a step from its contact problem, whose boundaries hold the velocities of the end of the step as far as
  !> no contact acts on them, and tell the problem. One reduction. Collective.
  subroutine velocity_scale_measure(self, decomposition, physics, problem, time, area)
    class(velocity_scale_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    !> end of the step [s]
    real(dp), intent(in) :: time
    !> that the load on each boundary works on (boundaries) [m^2, m in 2D]
    real(dp), intent(in) :: area(:)
    type(imposed_motion_t) :: motion
    !> squares and number of attractions, of impulses where nothing loads or drives; number, masses and their squares of grains;
    !> sum of h^2 k/m over compliant contacts, number of contacts that bear something; mass and twice the energy of all bodies, and
    !> along each axis the mass of those that move freely and their momentum
    real(dp) :: parts(11 + 2*decomposition%nd, size(problem%sub)), sums(11 + 2*decomposition%nd)
    real(dp) :: attraction
    logical :: idle
    integer :: s

    call find_imposed(decomposition%nd, decomposition%boundaries, self%lever, self%diameter, physics, motion)
    self%drive = largest_imposed(decomposition%nd, decomposition%boundaries, self%lever, self%diameter, physics, time, motion)
    self%restitution = physics%laws%most_restitution
    self%load = self%load_of(decomposition%nd, decomposition%boundaries, physics, time, area)
    idle = .not. (self%load > 0.0_dp .or. self%drive > 0.0_dp)
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      if (allocated(problem%sub(s)%attraction)) call add_attraction(problem%sub(s), parts(1:2, s))
      if (idle) call add_impulses(problem%sub(s), parts(3:4, s))
      call add_masses(problem%sub(s), parts(5:7, s))
      if (physics%laws%yields) call add_stiffness(problem%sub(s), parts(8:9, s))
      call add_grains(problem%sub(s), physics, motion%common, problem%has_shapes(), parts(10:, s))
      call add_driven(problem%sub(s), decomposition%boundaries, motion%common, parts(10:, s))
    end do
    call problem%comm%sum_parts(parts, sums)
    if (decomposition%na > 0) self%load = max(self%load, applied_load(problem))
    attraction = 0.0_dp
    if (sums(2) > 0.0_dp .and. self%mass > 0.0_dp) attraction = sqrt(sums(1)/sums(2))/self%mass
    self%bonds = merge(attraction, 0.0_dp, physics%laws%breaks)
    ! attractions hold bodies together and move none of them but where there is no other load
    if (self%load > 0.0_dp) attraction = 0.0_dp
    self%internal = attraction > 0.0_dp .and. (physics%laws%breaks .or. &
      & (physics%laws%range > 0.0_dp .and. physics%h*attraction > physics%laws%range))
    if (attraction > 0.0_dp) self%load = merge(share_of_bonds, 1.0_dp, physics%laws%breaks)*attraction
    self%stress = 0.0_dp
    if (sums(4) > 0.0_dp .and. self%mass > 0.0_dp) self%stress = sqrt(sums(3)/sums(4))/self%mass
    self%stiffness = 0.0_dp
    if (sums(9) > 0.0_dp) self%stiffness = sums(8)/sums(9)
    if (self%duration > 0.0_dp) self%creep = drift*self%diameter/self%duration
    call find_motion(decomposition%nd, sums(10:), self%own, self%mean(1:decomposition%nd), self%apart)
    self%frame(:) = motion%common
    if (.not. motion%bounded) then
      ! nothing holds a scene without boundaries: its mean motion is none
      self%frame(:) = self%mean
      self%mean(:) = 0.0_dp
      self%own = self%apart
    end if
    call self%choose()
    call set_concerns(self, physics, self%frame, sums(5:7), problem)
    problem%error_scale = self%value
    problem%drive_scale = huge(1.0_dp)
    ! what a drive carries is not at rest, be it that all boundaries move alike: here the present velocities count
    if (motion%carries > 0.0_dp) problem%drive_scale = max(motion%carries, self%creep)
  end subroutine velocity_scale_measure

  !> Whether bodies move by more than what errors are compared with.
  pure logical function velocity_scale_moves(self) result(moves)
    class(velocity_scale_t), intent(in) :: self
    moves = self%own > self%value
  end function velocity_scale_moves

  !> Squares of the impulses of attraction and their number.
  pure subroutine add_attraction(sub, sums)
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: sums(2)

    sums(1) = sum(sub%attraction**2)
    sums(2) = real(count(sub%attraction > 0.0_dp), dp)
  end subroutine add_attraction

  !> Squares of the normal impulses that the step starts from, and their number.
  pure subroutine add_impulses(sub, sums)
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: sums(2)

    sums(1) = sum(sub%impulse(:, 1, :)**2)
    sums(2) = real(count(sub%impulse(:, 1, :) > 0.0_dp), dp)
  end subroutine add_impulses

  !> The sum of h^2 k/m over the compliant contacts that are pressed together, and the number of these and of rigid ones that the
  !> step starts with an impulse.
  pure subroutine add_stiffness(sub, sums)
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: sums(2)
    integer :: c

    sums(1) = sub%stiffness
    sums(2) = real(sub%n_springs, dp)
    do c = 1, sub%n_contacts
      if (sub%yields(c)) cycle
      if (sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) sums(2) = sums(2) + 1.0_dp
    end do
  end subroutine add_stiffness

  !> Number, mass and squared masses of the grains. One that several subdomains share counts in equal parts.
  pure subroutine add_masses(sub, sums)
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: sums(3)
    real(dp) :: m
    integer :: b

    do b = 1, sub%n_grains
      m = 1.0_dp/sub%inverse_mass(1, b)
      sums(1) = sums(1) + 1.0_dp/sub%multiplicity(b)
      sums(2) = sums(2) + m/sub%multiplicity(b)
      sums(3) = sums(3) + m**2/sub%multiplicity(b)
    end do
  end subroutine add_masses

  !> The motion of the bodies from its sums: root mean square velocity beside that of the observer, mean velocity (nd), and root
  !> mean square beside that [m/s].
  pure subroutine find_motion(nd, sums, own, mean, apart)
    integer, intent(in) :: nd
    !> mass, twice the energy beside the velocity of the observer, mass and momentum along each axis (2 + 2 nd)
    real(dp), intent(in) :: sums(:)
    real(dp), intent(out) :: own, mean(:), apart
    integer :: d

    own = sqrt(sums(2)/max(sums(1), tiny(1.0_dp)))
    mean(:) = 0.0_dp
    apart = sums(2)
    do d = 1, nd
      if (sums(2 + d) > 0.0_dp) mean(d) = sums(2 + nd + d)/sums(2 + d)
      apart = apart - mean(d)*sums(2 + nd + d)
    end do
    apart = sqrt(max(apart, 0.0_dp)/max(sums(1), tiny(1.0_dp)))
  end subroutine find_motion

  !> Mass, twice the energy, and mass and momentum along each axis of the grains at the start of the step. Loads of the step are
  !> taken out of the velocities again: at rest under gravity these are h g, which is no motion. A grain that several subdomains
  !> share counts in equal parts.
  pure subroutine add_grains(sub, physics, frame, shaped, sums)
    type(subproblem_t), intent(in) :: sub
    type(physics_t), intent(in) :: physics
    !> velocity of the observer [m/s]
    real(dp), intent(in) :: frame(3)
    !> there are bodies that are no disks or spheres
    logical, intent(in) :: shaped
    !> (2 + 2 nd)
    real(dp), intent(inout) :: sums(:)
    real(dp) :: v(3), m
    integer :: b, nd

    nd = (size(sums) - 2)/2
    do b = 1, sub%n_grains
      call find_own_velocity(sub, physics, b, v(1:nd))
      v(1:nd) = v(1:nd) - frame(1:nd)
      m = 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
      sums(1) = sums(1) + m
      sums(2) = sums(2) + m*sum(v(1:nd)**2)
      if (shaped) sums(2) = sums(2) + m*square_of_spin(sub, b, nd)
      sums(3:2 + nd) = sums(3:2 + nd) + m
      sums(3 + nd:) = sums(3 + nd:) + m*v(1:nd)
    end do
  end subroutine add_grains

  !> The square of the velocity that has the energy of the spin of a grain, without what attractions add to it [m^2/s^2].
  pure real(dp) function square_of_spin(sub, b, nd) result(square)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: b, nd
    real(dp) :: spin(size(sub%v_free, 1))
    integer :: d

    spin(:) = 0.0_dp
    do d = nd + 1, size(spin)
      spin(d) = sub%free_velocity(d, b)
    end do
    square = sub%inverse_mass(1, b)*mass_product(sub%inverse_mass(:, b), spin, spin)
  end function square_of_spin

  !> The velocity of a grain at the start of the step, beside that of a cell that deforms.
  pure subroutine find_own_velocity(sub, physics, b, v)
    type(subproblem_t), intent(in) :: sub
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: b
    !> (nd) [m/s]
    real(dp), intent(out) :: v(:)
    real(dp) :: carried(size(v)), m, volume
    integer :: nd

    nd = size(v)
    m = 1.0_dp/sub%inverse_mass(1, b)
    volume = 0.0_dp
    if (allocated(sub%volume)) volume = sub%volume(b)
    v(:) = sub%v_free(1:nd, b) - physics%h*(physics%gravity(1:nd) + physics%body_force(1:nd)*volume/m)
    if (allocated(sub%applied)) v(:) = v - sub%applied(:, b)
    if (physics%cell%moves) then
      carried(:) = gradient_times(physics%cell%before, sub%cell%place(:, b))
      v(:) = v - carried
    end if
    if (allocated(sub%attraction_load)) v(:) = v - sub%inverse_mass(1, b)*sub%attraction_load(1:nd, b)
  end subroutine find_own_velocity

  !> What errors of single bodies count for in the estimate. Where the motion of the bodies is what errors are compared with, slow
  !> ones among them are to be as exact as if they were alone: their errors count as much more as their own velocity is smaller, and
  !> light ones as if they had the mass of the mean grain. Where few heavy bodies have most of the mass of those in contact, all
  !> light ones count as if they had the mean mass of these.
  subroutine set_concerns(self, physics, frame, masses, problem)
    class(velocity_scale_t), intent(in) :: self
    type(physics_t), intent(in) :: physics
    !> velocity of the observer [m/s]
    real(dp), intent(in) :: frame(3)
    !> number, mass and squared masses of the grains in contact
    real(dp), intent(in) :: masses(3)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: v(problem%nd), own, limit, least, mean
    logical :: moves, is_uneven
    integer :: s, b

    moves = self%kind == of_motion .or. self%kind == of_bonds
    is_uneven = are_uneven(masses(1), masses(2), masses(3))
    mean = masses(2)/max(masses(1), 1.0_dp)
    limit = slow_part*self%value
    least = merge(self%quiet, least_own*self%value, self%quiet > 0.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        if (allocated(sub%concern)) deallocate (sub%concern)
        if (.not. (moves .or. is_uneven)) cycle
        allocate (sub%concern(sub%n_bodies), source=1.0_dp)
        do b = 1, sub%n_grains
          if (is_uneven) sub%concern(b) = max(1.0_dp, mean*sub%inverse_mass(1, b))
          if (.not. moves) cycle
          call find_own_velocity(sub, physics, b, v)
          own = norm2(v - frame(1:size(v)))
          if (problem%has_shapes()) own = hypot(own, sqrt(square_of_spin(sub, b, size(v))))
          own = max(least, self%share*own)
          if (own < limit) sub%concern(b) = (limit/own)**2*max(1.0_dp, self%mass*sub%inverse_mass(1, b))
        end do
      end associate
    end do
  end subroutine set_concerns

  !> What applied forces add to the velocities of grains in contact in a step, as a root mean square by mass [m/s]. Collective.
  real(dp) function applied_load(problem) result(load)
    type(contact_problem_t), intent(in) :: problem
    !> mass, and mass times squares
    real(dp) :: parts(2, size(problem%sub)), sums(2), m
    integer :: s, b

    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          m = 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
          parts(1, s) = parts(1, s) + m
          parts(2, s) = parts(2, s) + m*sum(sub%applied(:, b)**2)
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    load = 0.0_dp
    if (sums(1) > 0.0_dp) load = sqrt(sums(2)/sums(1))
  end function applied_load

  !> The same of boundaries that forces move, along the components that are free.
  pure subroutine add_driven(sub, boundaries, frame, sums)
    type(subproblem_t), intent(in) :: sub
    type(boundary_t), intent(in) :: boundaries(:)
    real(dp), intent(in) :: frame(3)
    !> (2 + 2 nd)
    real(dp), intent(inout) :: sums(:)
    real(dp) :: v((size(sums) - 2)/2), m
    integer :: b, nd

    nd = size(v)
    do b = sub%n_grains + 1, sub%n_bodies
      associate (boundary => boundaries(sub%boundary(b)))
        m = boundary%mass/sub%multiplicity(b)
        v(:) = merge(boundary%last_velocity(1:nd) - frame(1:nd), 0.0_dp, boundary%free(1:nd))
        sums(1) = sums(1) + m
        sums(2) = sums(2) + m*sum(v**2)
        sums(3:2 + nd) = sums(3:2 + nd) + merge(m, 0.0_dp, boundary%free(1:nd))
        sums(3 + nd:) = sums(3 + nd:) + m*v
      end associate
    end do
  end subroutine add_driven

  !> What loads but attractions do to the mean grain in a step [m/s]. Gravity and the force on volumes count together, as they act.
  pure real(dp) function velocity_scale_load_of(self, nd, boundaries, physics, time, area) result(load)
    class(velocity_scale_t), intent(in) :: self
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    !> end of the step in which the loads of boundaries act [s]; (boundaries) [m^2, m in 2D]
    real(dp), intent(in) :: time, area(:)
    integer :: b

    load = 0.0_dp
    if (.not. self%mass > 0.0_dp) return
    load = physics%h*norm2(physics%gravity(1:nd) + physics%body_force(1:nd)*grain_volume(nd, 0.5_dp*self%diameter)/self%mass)
    if (physics%cell%is_driven) load = max(load, maxval(abs(physics%cell%impulse))*self%diameter**(nd - 1)/self%mass)
    do b = 1, size(boundaries)
      ! what is smaller than a grain presses on one with all of its force
      load = max(load, physics%h*self%pressure_of(nd, boundaries(b), time, physics%h, area(b))* &
        & min(area(b), self%diameter**(nd - 1))/self%mass)
    end do
  end function velocity_scale_load_of

  !> Force on a boundary over the area that it works on [Pa, N/m in 2D]; 0 where no force moves it.
  pure real(dp) function velocity_scale_pressure_of(self, nd, boundary, time, step, area) result(pressure)
    class(velocity_scale_t), intent(in) :: self
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundary
    !> end of the step and step [s], [m^2, m in 2D]
    real(dp), intent(in) :: time, step, area
    real(dp) :: force(nd)

    pressure = 0.0_dp
    if (.not. (boundary%is_driven() .and. boundary%present .and. area > 0.0_dp) .or. self%diameter <= 0.0_dp) return
    call boundary%applied_force(nd, time, step, area, force)
    pressure = norm2(force)/area
  end function velocity_scale_pressure_of

  !> The rule.
  pure subroutine velocity_scale_choose(self)
    class(velocity_scale_t), intent(inout) :: self
    real(dp) :: slow, load

    if (self%given > 0.0_dp) then
      self%value = self%given
      self%kind = "given"
      return
    end if
    load = self%load/(1.0_dp + self%stiffness)
    self%value = load
    self%kind = "load of a step"
    if (self%stiffness > much_stiffer) self%kind = of_springs
    if (.not. self%load > 0.0_dp) self%kind = "none"
    if (.not. (self%load > 0.0_dp .or. self%drive > 0.0_dp) .and. self%own < little_motion*self%stress) then
      self%value = self%stress/(1.0_dp + self%stiffness)
      self%kind = "contact forces"
    end if
    slow = max(self%drive, self%creep)
    if ((self%drive > 0.0_dp .or. self%internal .and. slow > 0.0_dp) .and. (slow < load .or. .not. load > 0.0_dp)) then
      self%value = slow
      self%kind = "drive"
      if (self%creep > self%drive) self%kind = "creep"
    end if
    self%quiet = self%value
    if (self%internal .and. .not. self%drive > 0.0_dp) self%quiet = 0.0_dp
    self%share = share_of_own*max(sqrt(1.0_dp - min(self%restitution, 1.0_dp)**2), least_lost)
    if (self%share*self%own > self%value) then
      self%value = self%share*self%own
      self%kind = of_motion
      if (.not. (self%bonds > 0.0_dp .and. self%value > max(self%quiet, share_of_bonds*self%bonds))) return
      self%value = max(self%quiet, share_of_bonds*self%bonds)
      self%kind = of_bonds
    end if
  end subroutine velocity_scale_choose

end module gravier_velocity_scale
