!> What a step does beside its solve, on scenes of a few grains whose answers are known: balances of energy, stress, structure,
!> sleeping, projections of overlaps, departures. Attractions, boundaries that turn and boundaries that forces move take part.
program test_step_parts
  use mpi_f08, only: MPI_Barrier, MPI_COMM_WORLD
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_energy_balance, only: energy_balance_t
  use gravier_grain_balance, only: grain_balance_t
  use gravier_mean_stress, only: mean_stress_t
  use gravier_contact_structure, only: contact_structure_t, bin_width, n_bins
  use gravier_intact_bonds, only: intact_bonds_t
  use gravier_removal, only: some_leave, remove_grains
  use gravier_overlap_projection, only: project_overlaps
  use gravier_deep_contacts, only: deep_contacts_t
  use gravier_sleeping, only: count_rest
  use gravier_borne_impulses, only: find_seen
  use gravier_waking, only: resting_t, watch_awake, wake_all
  use gravier_whole_problem, only: build_whole
  use gravier_supports, only: supports_t, find_supports
  use gravier_contact_problem, only: contact_problem_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> solves of a contact or two end at a residual of 1e-12: what rounding and a condition of 100 leave of numbers of the order
  !> of one
  real(dp), parameter :: solved = 1.0e-10_dp
  !> step [s], gravity [m/s^2]
  real(dp), parameter :: h = 0.01_dp, g = 9.81_dp
  !> keys that solve one contact exactly
  character(len=*), parameter :: exact = "&solver criterion = 'residual', tolerance = 1e-12, check_every = 1, "// &
    & "method = 'nscdd', "// &
    & "acceleration = 'none'"
  character(len=*), parameter :: all_figures = "&output energy = T, stress = T, structure = T, boundary_forces = T /"//newline
  type(communicator_t), target :: comm
  !> rows of the bodies file of the next scene
  character(len=240) :: added(64)
  integer :: n_added = 0
  !> scenes made so far
  integer :: n_scenes = 0

  call start_parallel()
  call comm%init()
  call check_impact(0.0_dp, "")
  call check_impact(0.0_dp, "adhesion")
  call check_impact(0.01_dp, "adhesion")
  call check_pull(0.0_dp)
  call check_pull(0.01_dp)
  call check_sliding(0.0_dp)
  call check_sliding(0.5_dp)
  call check_loads()
  call check_period()
  call check_turning_glued(1)
  call check_turning_glued(2)
  call check_structure(3.0_dp, 0.0_dp)
  call check_structure(-0.1_dp, 3.0_dp)
  call check_crowd()
  call check_bonds()
  call check_turning_rolling()
  call check_body_force_in_contact()
  call check_falling_lid()
  call check_departures()
  call check_sleeping()
  call check_moving_plane("0")
  call check_moving_plane("0.5")
  call check_chain_asleep()
  call check_chain_disturbed()
  call check_turned_sleeper(0.24_dp, 1)
  call check_turned_sleeper(0.36_dp, 2)
  call check_swept_off()
  call check_held()
  call check_stirred()
  call check_left_behind()
  call check_starting_boundary()
  call check_deep_contacts()
  call check_projection()
  call check_projected_row()
  call check_shared_lid()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A plane scene of the grains that add_grain has added since the last one, in two subdomains along x.
  subroutine make(sim, groups)
    type(simulation_t), intent(inout) :: sim
    !> the other groups of the input; &scene begins with what is common to all
    character(len=*), intent(in) :: groups
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=:), allocatable :: file
    integer :: unit, k

    n_scenes = n_scenes + 1
    file = "bodies_"//to_text(n_scenes)//".csv"
    if (comm%rank == 0) then
      open (newunit=unit, file=file, action="write", status="replace")
      write (unit, "(a)") "id,radius,mass,group,x,y,vx,vy,omega"
      do k = 1, n_added
        write (unit, "(a)") trim(added(k))
      end do
      close (unit)
    end if
    n_added = 0
    call MPI_Barrier(MPI_COMM_WORLD)
    call parse_config("parts", &
      & "&scene dimension = 2, bodies = 'file', start_overlap = 1, alert_distance = 0.02, bodies_file = '"// &
      & file//"', "//groups//newline//"&decomposition grid = 2, 1 /", config, error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "the scene is made")
    if (.not. allocated(error)) return
    if (comm%rank == 0) print "(a)", error%message
    call finish_checks()
  end subroutine make

  !> Add a disk of radius 0.1 m to the next scene.
  subroutine add_grain(id, mass, group, x, y, vx, vy, spin)
    integer, intent(in) :: id, group
    !> [kg], [m], [m/s], [rad/s]
    real(dp), intent(in) :: mass, x, y, vx, vy, spin

    n_added = n_added + 1
    write (added(n_added), "(i0, ',0.1,', es25.17, ',', i0, 5(',', es25.17))") id, mass, group, x, y, vx, vy, spin
  end subroutine add_grain

  subroutine advance(sim, figures)
    type(simulation_t), intent(inout) :: sim
    type(step_figures_t), intent(out) :: figures
    type(error_t), allocatable :: error

    call sim%advance(figures, error)
    call check(.not. allocated(error), "a step is made")
  end subroutine advance

  !> Component `d` of the velocity (1 to 3) or, with `of_place`, of the place of grain `id`: the same on all ranks; huge where
  !> there is no such grain.
  real(dp) function grain(sim, id, d, of_place)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: id, d
    logical, intent(in), optional :: of_place
    integer :: s, k

    grain = -huge(1.0_dp)
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) /= id) cycle
          if (present(of_place)) then
            grain = owned%position(d, k)
          else
            grain = owned%velocity(d, k)
          end if
        end do
      end associate
    end do
    grain = comm%highest(grain)
  end function grain

  !> The law of all pairs: friction, and an attraction on request.
  pure function law_text(kind) result(text)
    character(len=*), intent(in) :: kind
    character(len=:), allocatable :: text

    text = ""
    if (kind == "adhesion") text = "&material name = 'sticky' /"//newline// &
      & "&law materials = 'sticky', kind = 'adhesive', adhesion = 3.0, adhesion_range = 0.005 /"//newline
  end function law_text

  !> Masses 1 and 2 kg meet head-on at 1 and -0.5 m/s and stay together: the impulse on them is 1 N s and 0.75 J are lost, with an
  !> attraction or without, touching or overlapping.
  subroutine check_impact(overlap, kind)
    real(dp), intent(in) :: overlap
    character(len=*), intent(in) :: kind
    type(mean_stress_t) :: stress
    type(contact_structure_t) :: structure
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: branch

    ! q_m is half a step on from here: the places are chosen for the overlap there
    branch = 0.2_dp - overlap
    call add_grain(1, 1.0_dp, 0, -0.5_dp*branch - 0.5_dp*h, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 2.0_dp, 0, 0.5_dp*branch + 0.25_dp*h, 0.0_dp, -0.5_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F /"//newline//"&time step = 0.01, steps = 9 /"//newline// &
      & exact//" /"//newline//all_figures//law_text(kind))
    call check_close(sim%balance%kinetic, 0.75_dp, solved, "kinetic energy at the start")
    call advance(sim, figures)
    call check_close(figures%max_overlap, overlap, solved, "the overlap is as it was meant")
    call check_close(grain(sim, 1, 1), 0.0_dp, solved, "the first grain stops")
    call check_close(grain(sim, 2, 1), 0.0_dp, solved, "the second grain stops")
    call check_energy(energy_of(sim), 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.75_dp, 0.0_dp)
    call check_balance(sim%balance, 0.0_dp, 0.0_dp, -0.75_dp)
    ! 1 N s over a branch, in a box around both grains
    stress = stress_of(sim)
    call check_close(stress%stress(1, 1), branch/(h*0.2_dp*(0.2_dp + branch)), 1.0e-8_dp, "stress along the pair")
    call check_close(stress%stress(2, 2), 0.0_dp, solved, "and none across it")
    call check_close(stress%pressure(), 0.5_dp*stress%stress(1, 1), solved, "pressure")
    structure = structure_of(sim)
    call check_close(structure%force_mean, 1.0_dp/h, 1.0e-8_dp, "force")
    call check_close(structure%force_max, 1.0_dp/h, 1.0e-8_dp, "largest force")
    call check_columns(sim)
    call sim%free()
  end subroutine check_impact

  !> The diagnostics of a scene, as they are now.
  type(energy_balance_t) function energy_of(sim) result(energy)
    type(simulation_t), intent(in) :: sim

    associate (diagnostics => sim%diagnostics)
      select type (item => diagnostics%asked(diagnostics%place("energy"))%diagnostic)
      type is (energy_balance_t)
        energy = item
      end select
    end associate
  end function energy_of

  type(mean_stress_t) function stress_of(sim) result(stress)
    type(simulation_t), intent(in) :: sim

    associate (diagnostics => sim%diagnostics)
      select type (item => diagnostics%asked(diagnostics%place("stress"))%diagnostic)
      type is (mean_stress_t)
        stress = item
      end select
    end associate
  end function stress_of

  type(contact_structure_t) function structure_of(sim) result(structure)
    type(simulation_t), intent(in) :: sim

    associate (diagnostics => sim%diagnostics)
      select type (item => diagnostics%asked(diagnostics%place("structure"))%diagnostic)
      type is (contact_structure_t)
        structure = item
      end select
    end associate
  end function structure_of

  !> Columns carry the values of the components that they are named after.
  subroutine check_columns(sim)
    type(simulation_t), intent(in) :: sim
    type(energy_balance_t) :: energy
    type(mean_stress_t) :: stress
    type(contact_structure_t) :: structure
    integer :: k, found

    energy = energy_of(sim)
    stress = stress_of(sim)
    structure = structure_of(sim)
    found = 0
    associate (diagnostics => sim%diagnostics)
      do k = 1, diagnostics%n_columns
        select case (diagnostics%name(k))
        case ("kinetic_translation")
          call check_close(diagnostics%value(k), energy%translation, 0.0_dp, "column of the translation")
        case ("potential_energy")
          call check_close(diagnostics%value(k), energy%potential, 0.0_dp, "column of the potential")
        case ("load_work")
          call check_close(diagnostics%value(k), energy%load_work, 0.0_dp, "column of the work of loads")
        case ("dissipated_normal")
          call check_close(diagnostics%value(k), energy%dissipated_normal, 0.0_dp, "column of the energy")
        case ("stress_xx")
          call check_close(diagnostics%value(k), stress%stress(1, 1), 0.0_dp, "column of the stress")
        case ("coordination")
          call check_close(diagnostics%value(k), structure%coordination, 0.0_dp, "column of the structure")
        case default
          cycle
        end select
        found = found + 1
      end do
    end associate
    call check_equal(found, 6, "columns of all groups")
  end subroutine check_columns

  subroutine check_energy(energy, translation, rotation, load_work, boundary_work, carried_away, normal, tangential)
    type(energy_balance_t), intent(in) :: energy
    !> [J], the last two dissipated by normal and by tangential impulses
    real(dp), intent(in) :: translation, rotation, load_work, boundary_work, carried_away, normal, tangential

    call check_close(energy%translation, translation, solved, "energy of translation")
    call check_close(energy%rotation, rotation, solved, "energy of rotation")
    call check_close(energy%load_work, load_work, solved, "work of loads")
    call check_close(energy%boundary_work, boundary_work, solved, "work of boundaries")
    call check_close(energy%carried_away, carried_away, solved, "energy carried away")
    call check_close(energy%dissipated_normal, normal, solved, "dissipated by normal impulses")
    call check_close(energy%dissipated_friction, tangential, solved, "dissipated by tangential impulses")
    call check_close(energy%error(), 0.0_dp, solved, "the balance closes")
  end subroutine check_energy

  subroutine check_balance(balance, kinetic, load_work, contact_work)
    type(grain_balance_t), intent(in) :: balance
    !> of the grains; done on them by loads and by contacts [J]
    real(dp), intent(in) :: kinetic, load_work, contact_work

    call check_close(balance%kinetic, kinetic, solved, "balance of grains: kinetic energy")
    call check_close(balance%load_work, load_work, solved, "balance of grains: work of loads")
    call check_close(balance%contact_work, contact_work, solved, "balance of grains: work of contacts")
    call check_close(balance%error(), 0.0_dp, solved, "balance of grains: it closes")
  end subroutine check_balance

  !> The same masses part at 0.01 and 0.005 m/s under an attraction of 3 N, which holds them: an impulse of -0.01 N s, less than
  !> 0.03 N s. The contact carries a tension, touching or overlapping.
  subroutine check_pull(overlap)
    real(dp), intent(in) :: overlap
    type(mean_stress_t) :: stress
    type(contact_structure_t) :: structure
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: branch

    branch = 0.2_dp - overlap
    call add_grain(1, 1.0_dp, 0, -0.5_dp*branch + 0.5e-2_dp*h, 0.0_dp, -0.01_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 2.0_dp, 0, 0.5_dp*branch - 0.25e-2_dp*h, 0.0_dp, 0.005_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F /"//newline//"&time step = 0.01, steps = 9 /"//newline// &
      & exact//" /"//newline//all_figures//law_text("adhesion"))
    call advance(sim, figures)
    call check_close(grain(sim, 1, 1), 0.0_dp, solved, "an attraction holds the first grain")
    call check_close(grain(sim, 2, 1), 0.0_dp, solved, "an attraction holds the second grain")
    call check_energy(energy_of(sim), 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.75e-4_dp, 0.0_dp)
    call check_balance(sim%balance, 0.0_dp, 0.0_dp, -0.75e-4_dp)
    stress = stress_of(sim)
    call check_close(stress%stress(1, 1), -0.01_dp*branch/(h*0.2_dp*(0.2_dp + branch)), 1.0e-8_dp, &
      & "a tension is a negative stress")
    structure = structure_of(sim)
    call check_close(structure%force_mean, 0.01_dp/h, 1.0e-8_dp, "size of the tension")
    call check_close(structure%force_max, 0.0_dp, solved, "no compression")
    call check_close(structure%coordination, 1.0_dp, 0.0_dp, "a contact under tension carries")
    call check_equal(structure%rattlers, 2_i8, "grains with one contact rattle")
    call check_close(structure%fabric(1, 1), 1.0_dp, solved, "fabric along the pair")
    call check_equal(structure%histogram(nint(1.0_dp/bin_width) + 1) + structure%histogram(nint(1.0_dp/bin_width)), 1_i8, &
      & "a force of the mean is at the middle of the histogram")
    call sim%free()
  end subroutine check_pull

  !> A disk slides on a plane that moves at `speed`: mu m g h acts against the slip v - speed, which falls by 3 mu g h in the step.
  subroutine check_sliding(speed)
    !> [m/s]
    real(dp), intent(in) :: speed
    real(dp), parameter :: mu = 0.3_dp, m = 2.0_dp, v = 1.0_dp
    type(mean_stress_t) :: stress
    type(contact_structure_t) :: structure
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: p, slip

    call add_grain(1, 2.0_dp, 0, -0.5_dp*h, 0.1_dp, 1.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 1.0_dp, 5.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, -9.81, friction = 0.3, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0.3, velocity = "//to_text(speed)//", 0 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    p = mu*m*g*h
    ! I = m R^2/2: a force at the rim changes the slip three times as much as the velocity
    slip = (v - speed) - 1.5_dp*p/m
    call check_close(grain(sim, 1, 1), v - p/m, solved, "friction slows the disk down")
    call check_close(grain(sim, 1, 3), -2.0_dp*p/(m*0.1_dp), solved, "and turns it")
    ! the other disk falls
    call check_energy(energy_of(sim), 0.5_dp*m*(v - p/m)**2 + 0.5_dp*(g*h)**2, p**2/m, 0.5_dp*(g*h)**2, -p*speed, &
      & 0.0_dp, 0.0_dp, p*slip)
    call check_balance(sim%balance, 0.5_dp*m*(v - p/m)**2 + p**2/m + 0.5_dp*(g*h)**2, 0.5_dp*(g*h)**2, -p*(slip + speed))
    ! the force has a part along x, and the branch of 0.1 m is along y
    stress = stress_of(sim)
    call check_close(stress%stress(1, 2)*stress%volume, -p*0.1_dp/h, solved, "shear stress: row of the force, column of the branch")
    call check_close(stress%stress(2, 1)*stress%volume, 0.0_dp, solved, "and none the other way")
    structure = structure_of(sim)
    call check_close(structure%sliding_fraction, 1.0_dp, 0.0_dp, "the contact slides")
    call check_close(structure%fabric(2, 2), 0.0_dp, 0.0_dp, "the fabric is that of grains among each other")
    call check_close(sim%boundary_impulses(1, 1), p, solved, "the plane is dragged along")
    call check_close(sim%boundary_impulses(2, 1), -m*g*h, solved, "and pressed down")
    call sim%free()
  end subroutine check_sliding

  !> Gravity and a body force work on grains in flight; the potential is that of both, from the origin.
  subroutine check_loads()
    type(energy_balance_t) :: energy
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp), parameter :: pi = acos(-1.0_dp), volume = pi*0.01_dp, m = 2.0_dp
    real(dp) :: a(2), v(2), w(2), x(2)

    call add_grain(1, 2.0_dp, 0, 0.5_dp, 3.0_dp, 1.0_dp, 2.0_dp, 4.0_dp)
    call add_grain(2, 2.0_dp, 0, 3.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0.5, -9.81, body_force = 7, 3, overlap_projection = F /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    a = [0.5_dp + 7.0_dp*volume/m, -9.81_dp + 3.0_dp*volume/m]
    v = [1.0_dp, 2.0_dp]
    w = v + h*a
    x = [0.5_dp, 3.0_dp] + 0.5_dp*h*(v + w)
    call check_energy(energy_of(sim), 0.5_dp*m*(sum(w**2) + sum((h*a)**2)), 0.5_dp*(0.5_dp*m*0.01_dp)*16.0_dp, &
      & m*dot_product(h*a, 0.5_dp*(v + w)) + m*dot_product(h*a, 0.5_dp*h*a), 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call check_close(sim%balance%load_work, m*dot_product(h*a, 0.5_dp*(v + w)) + m*dot_product(h*a, 0.5_dp*h*a), solved, &
      & "balance of grains: work of both loads")
    call check_close(sim%balance%speeds, norm2(w) + norm2(h*a), solved, "sum of speeds")
    energy = energy_of(sim)
    call check_close(energy%potential, -m*(dot_product(a, x) + dot_product(a, [3.0_dp, 0.0_dp] + 0.5_dp*h*h*a)), &
      & 100*solved, "potential of both loads")
    call check_state(energy_of(sim))
    call check_columns(sim)
    call sim%free()
  end subroutine check_loads

  !> A grain leaves a periodic scene at 2 m/s and comes back on the other side, with a load along its way: its potential is that of
  !> the way that it has made.
  subroutine check_period()
    type(energy_balance_t) :: energy
    type(mean_stress_t) :: stress
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp), parameter :: m = 2.0_dp, a = 0.5_dp, t = 5*h, start = 3.95_dp
    integer :: k

    call add_grain(1, m, 0, start, 3.0_dp, 2.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, m, 0, 1.0_dp, 0.0_dp, -1.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0.5, 0, period = 4, 0, overlap_projection = F /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    do k = 1, 5
      call advance(sim, figures)
    end do
    energy = energy_of(sim)
    stress = stress_of(sim)
    ! along y from the lower grain to the upper one
    call check_close(stress%volume, 4.0_dp*3.2_dp, solved, "volume of a periodic scene")
    call check_close(stress%solid_fraction, 2.0_dp*acos(-1.0_dp)*0.01_dp/(4.0_dp*3.2_dp), solved, "solid fraction")
    call check_close(grain(sim, 1, 1, .true.), start + 2.0_dp*t + 0.5_dp*a*t**2 - 4.0_dp, solved, "it is back in the period")
    call check_close(energy%potential, -m*a*(start + 1.0_dp + t + a*t**2), solved, "potential of the way made")
    call check_close(energy%translation + energy%potential, 0.5_dp*m*5.0_dp - m*a*(start + 1.0_dp), solved, &
      & "what the potential loses is motion")
    call sim%free()
  end subroutine check_period

  !> A balance goes on from its state, bit for bit.
  subroutine check_state(energy)
    type(energy_balance_t), intent(in) :: energy
    type(energy_balance_t) :: one, other
    integer(i8) :: words(15), again(15)

    one = energy
    one%dissipated_moments(:) = [0.25_dp, 0.125_dp]
    call one%get_state(words)
    call other%set_state(words)
    call other%get_state(again)
    call check(all(words == again), "state of a balance")
    call check_close(other%error(), energy%error(), 0.0_dp, "its error")
    call check_close(other%turnover(), energy%turnover(), 0.0_dp, "its turnover")
    call check_close(other%potential, energy%potential, 0.0_dp, "its potential")
    call check_close(other%dissipated_moments(1), 0.25_dp, 0.0_dp, "what was lost to rolling")
    call check_close(other%dissipated_moments(2), 0.125_dp, 0.0_dp, "what was lost to pivoting")
  end subroutine check_state

  !> A grain of group 1 turns with a boundary about the origin at 2 rad/s; a free disk of 1 kg lies above it, at rest and without
  !> gravity, and is carried up by its approach and along by friction. It overlaps with the glued grain, at whose surface the
  !> boundary has the velocity that counts. The glued grain has identifier `glued`, so that it is candidate or antagonist.
  subroutine check_turning_glued(glued)
    integer, intent(in) :: glued
    real(dp), parameter :: overlap = 0.02_dp, spin = 2.0_dp
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: turn, x(2), u(2), along

    ! at q_m the glued grain has turned by half a step
    turn = 0.5_dp*h*spin
    x(1) = cos(turn)
    x(2) = sin(turn)
    call add_grain(glued, 1.0_dp, 1, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(3 - glued, 1.0_dp, 0, x(1), x(2) + 0.2_dp - overlap, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F, friction = 0.5 /"//newline// &
      & "&boundary shape = 'grains', group = 1, rotation = 2.0, pivot = 0, 0, friction = 0.5 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    call check_equal(figures%contacts, 1_i8, "one contact with a glued grain")
    ! (-w y, w x) at the surface of the glued grain, x + (0, 0.1)
    along = -spin*(x(2) + 0.1_dp)
    u(2) = spin*x(1)
    ! the contact is carried up: half of its way in a step changes what the boundary has there
    u(1) = along - spin*0.5_dp*h*u(2)
    call check_close(grain(sim, 3 - glued, 2), u(2), solved, "the free grain is carried up")
    ! a force at the rim moves the disk by a third of the slip, and turns it by the rest
    call check_close(grain(sim, 3 - glued, 1), u(1)/3.0_dp, solved, "and along by friction, which holds")
    call check_close(grain(sim, 3 - glued, 3), u(1)*2.0_dp/3.0_dp/0.1_dp, solved, "which turns it, too")
    ! the boundary works p u, along with its mean velocity at the contact; half of it is lost in the shock
    call check_energy(energy_of(sim), 0.5_dp*(u(2)**2 + u(1)**2/9.0_dp), u(1)**2/9.0_dp, 0.0_dp, &
      & u(2)**2 + along*u(1)/3.0_dp, 0.0_dp, 0.5_dp*u(2)**2, u(1)/3.0_dp*(along - 0.5_dp*u(1)))
    call check_balance(sim%balance, 0.5_dp*u(2)**2 + u(1)**2/6.0_dp, 0.0_dp, 0.5_dp*u(2)**2 + u(1)**2/6.0_dp)
    call check_close(sim%boundary_impulses(1, 1), -u(1)/3.0_dp, solved, "the boundary bears the impulse along")
    call check_close(sim%boundary_impulses(2, 1), -u(2), solved, "and the one across")
    call sim%free()
  end subroutine check_turning_glued

  !> Three disks in a row under 1 m/s from the left: chain of two contacts, figures of coordination. A fourth one, which touches
  !> nobody, decides where the scene is divided: apart from the chain, or through its middle.
  subroutine check_structure(x, y)
    !> of the fourth disk [m]
    real(dp), intent(in) :: x, y
    type(contact_structure_t) :: structure
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: forces(2)

    call add_grain(1, 1.0_dp, 0, -0.3_dp - 1.5_dp*h, 0.0_dp, 3.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, -0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(3, 1.0_dp, 0, 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(4, 1.0_dp, 0, x, y, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F, friction = 0 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    call check_equal(figures%interface_statistics%bodies, merge(1_i8, 0_i8, x < 0.0_dp), "disks that two subdomains share")
    ! all three end at 1 m/s: impulses 2 and 1
    forces = [2.0_dp, 1.0_dp]/h
    structure = structure_of(sim)
    call check_close(structure%force_mean, sum(forces)/2, 1.0e-7_dp, "mean force")
    call check_close(structure%force_max, forces(1), 1.0e-7_dp, "largest force")
    call check_close(structure%force_deviation, 1.0_dp/3.0_dp, 1.0e-8_dp, "deviation over mean")
    call check_close(structure%coordination, 4.0_dp/4.0_dp, 0.0_dp, "contacts of a grain: four ends, four grains")
    call check_close(structure%mechanical_coordination, 2.0_dp, 0.0_dp, "of the one that two contacts hold")
    call check_equal(structure%rattlers, 3_i8, "the other ones rattle")
    call check_close(structure%carrying_fraction, 1.0_dp, 0.0_dp, "both contacts carry")
    call check_equal(sum(structure%histogram), 2_i8, "both are in the histogram")
    call check_equal(structure%histogram(7), 1_i8, "2/3 of the mean")
    call check_equal(structure%histogram(14), 1_i8, "4/3 of the mean")
    call sim%free()
  end subroutine check_structure

  !> Twelve disks on a floor, one of them a thousand times as heavy and in overlap, one that slides; a thirteenth floats above the
  !> floor by less than the alert distance. One force is beyond the histogram.
  subroutine check_crowd()
    type(contact_structure_t) :: structure
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: heavy, light, mean
    integer :: k

    do k = 1, 13
      call add_grain(k, merge(1000.0_dp, 1.0_dp, k == 2), 0, 0.5_dp*k, merge(0.095_dp, merge(0.115_dp, 0.1_dp, k == 13), k == 2), &
        & merge(1.0_dp, 0.0_dp, k == 5), 0.0_dp, 0.0_dp)
    end do
    call make(sim, "gravity = 0, -9.81, friction = 0.3, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0.3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    heavy = 1000.0_dp*g
    light = g
    mean = (heavy + 11.0_dp*light)/12.0_dp
    structure = structure_of(sim)
    call check_close(structure%carrying_fraction, 12.0_dp/13.0_dp, 1.0e-15_dp, "what floats does not carry")
    call check_close(structure%sliding_fraction, 1.0_dp/12.0_dp, 1.0e-15_dp, "one contact slides")
    call check_close(structure%force_mean, mean, 1.0e-6_dp, "mean force of a crowd")
    call check_close(structure%force_max, heavy, 1.0e-6_dp, "force of the heavy one")
    call check_close(structure%force_deviation, sqrt(((heavy - mean)**2 + 11.0_dp*(light - mean)**2)/12.0_dp)/mean, 1.0e-8_dp, &
      & "deviation of a crowd")
    call check_close(structure%overlap_mean, 0.005_dp, solved, "mean overlap of those that overlap")
    call check_equal(structure%histogram(n_bins + 1), 1_i8, "more than ten times the mean")
    call check_equal(structure%histogram(n_bins), 0_i8, "nothing is in the last bin")
    call check_equal(structure%histogram(1), 11_i8, "a hundredth of the mean")
    call check_equal(structure%rattlers, 13_i8, "one contact holds nobody")
    call sim%free()
  end subroutine check_crowd

  !> Of three disks in a row that are bonded the last is torn off: its bond gives an impulse of 0.03 N s.
  subroutine check_bonds()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer :: k

    do k = 1, 3
      call add_grain(k, 1.0_dp, 0, 0.2_dp*(k - 2), 0.0_dp, merge(1.5_dp, 0.0_dp, k == 3), 0.0_dp, 0.0_dp)
    end do
    call make(sim, "gravity = 0, 0, overlap_projection = F /"//newline//"&time step = 0.01, steps = 9 /"//newline//exact// &
      & " /"//newline//"&output bonds = T /"//newline//"&material name = 'rock' /"//newline//"&law materials = 'rock', "// &
      & "kind = 'bonded', bond_strength = 3.0, bond_friction = 1.0, bond_distance = 0.01 /"//newline)
    do k = 1, 2
      call advance(sim, figures)
      associate (diagnostics => sim%diagnostics)
        select type (item => diagnostics%asked(diagnostics%place("bonds"))%diagnostic)
        type is (intact_bonds_t)
          call check_equal(item%bonds, 1_i8, "of two bonds one holds")
        end select
      end associate
    end do
    call check_close(grain(sim, 2, 1), 0.5_dp*3.0_dp*h, solved, "and shares what the other one bore")
    call sim%free()
  end subroutine check_bonds

  !> The scene of a boundary that turns, with resistance to rolling: its moment works on the boundary too, and the balance closes.
  subroutine check_turning_rolling()
    type(energy_balance_t) :: energy
    type(simulation_t) :: sim
    type(step_figures_t) :: figures

    call add_grain(1, 1.0_dp, 1, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 1.0_dp, 0.18_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F, friction = 0.5, rolling_friction = 0.3 /"//newline// &
      & "&boundary shape = 'grains', group = 1, rotation = 2.0, pivot = 0, 0, friction = 0.5, rolling_friction = 0.3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    energy = energy_of(sim)
    call check(energy%boundary_work > 1.0_dp, "the boundary works")
    call check_close(energy%error(), 0.0_dp, solved, "the balance closes with moments")
    call check_close(sim%balance%error(), 0.0_dp, solved, "balance of grains: it closes with moments")
    call sim%free()
  end subroutine check_turning_rolling

  !> A body force presses a disk that slides onto a floor: both balances close, and the floor bears the force.
  subroutine check_body_force_in_contact()
    real(dp), parameter :: force = 300.0_dp*acos(-1.0_dp)*0.01_dp, mu = 0.3_dp, m = 2.0_dp, v = 1.0_dp
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: p

    call add_grain(1, m, 0, 0.0_dp, 0.1_dp, v, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 1.0_dp, 5.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, body_force = 0, -300, friction = 0.3, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0.3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    p = mu*force*h
    call check_close(sim%boundary_impulses(2, 1), -force*h, solved, "a body force presses on the floor")
    call check_close(sim%balance%contact_work, -p*(v - 1.5_dp*p/m), solved, "balance of grains: friction under a body force")
    call check_close(sim%balance%error(), 0.0_dp, solved, "balance of grains: it closes under a body force")
    ! the other disk falls
    call check_energy(energy_of(sim), 0.5_dp*m*(v - p/m)**2 + 0.5_dp*(force*h)**2, p**2/m, 0.5_dp*(force*h)**2, 0.0_dp, 0.0_dp, &
      & 0.0_dp, p*(v - 1.5_dp*p/m))
    call sim%free()
  end subroutine check_body_force_in_contact

  !> A lid of 4 kg under 8 N that touches nothing: its energy is the work of the force, and goes with it.
  subroutine check_falling_lid()
    type(energy_balance_t) :: energy
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: v

    call add_grain(1, 1.0_dp, 0, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 2.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 3, normal = 0, -1, "// &
      & "free = F, T, mass = 4.0, force = 0, -8.0, remove_at = 0.02 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call advance(sim, figures)
    call advance(sim, figures)
    v = -2.0_dp*h*2.0_dp
    call check_close(sim%decomposition%boundaries(1)%velocity(2), v, solved, "velocity of a lid under a force")
    energy = energy_of(sim)
    call check_close(energy%boundaries, 2.0_dp*v**2, solved, "its kinetic energy")
    call check_close(energy%boundary_work, 2.0_dp*v**2, solved, "the work of the force")
    call check_close(energy%error(), 0.0_dp, solved, "the balance closes")
    call advance(sim, figures)
    energy = energy_of(sim)
    call check(.not. sim%decomposition%boundaries(1)%present, "the lid is taken away")
    call check_close(energy%boundaries, 0.0_dp, 0.0_dp, "and has no energy left")
    call check_close(energy%carried_away, 2.0_dp*v**2, solved, "which it takes along")
    call check_close(energy%boundary_work, 2.0_dp*v**2, solved, "and no force works on it")
    call check_close(energy%error(), 0.0_dp, solved, "the balance closes without it")
    call sim%free()
  end subroutine check_falling_lid

  !> A grain behind an outlet leaves with its energy, and a glued one with its boundary; others stay.
  subroutine check_departures()
    type(energy_balance_t) :: energy
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer(i8) :: n_free, n_glued
    real(dp) :: mass

    call add_grain(1, 1.0_dp, 0, 0.0_dp, 0.3_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 2.0_dp, 0, 1.0_dp, 0.003_dp, 0.0_dp, -1.0_dp, 3.0_dp)
    call add_grain(3, 1.0_dp, 0, 2.0_dp, 0.5_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(4, 1.0_dp, 1, 3.0_dp, 0.5_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(5, 1.0_dp, 1, 3.2_dp, -0.5_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    ! close to the middle of the scene, and a ghost to the other half
    call add_grain(6, 1.0_dp, 0, 1.55_dp, 3.0_dp, 0.0_dp, 0.5_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, overlap_projection = F /"//newline// &
      & "&boundary shape = 'outlet', point = 0, 0, normal = 0, 1 /"//newline//"&boundary shape = 'grains', group = 1 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /"//newline//all_figures)
    call check(.not. some_leave(sim%decomposition), "nobody is behind the outlet, and glued grains stay there")
    call remove_grains(sim%decomposition, .true., n_free, n_glued, mass)
    call check_equal(n_free + n_glued, 0_i8, "nobody leaves")
    call advance(sim, figures)
    call check_equal(figures%left, 1_i8, "the falling grain leaves")
    call check_close(sim%left_mass, 2.0_dp, 0.0_dp, "with its mass")
    call check_close(sim%mass, 3.0_dp, 0.0_dp, "and the free ones keep theirs")
    call check(grain(sim, 2, 2) <= -huge(1.0_dp), "it is the one that is behind the outlet")
    call check(grain(sim, 1, 2) > -1.0_dp, "a free grain stays")
    call check(grain(sim, 3, 2) > -1.0_dp, "and another one")
    call check(grain(sim, 5, 2) > -1.0_dp, "and a glued one behind the outlet")
    ! m v^2/2 and I w^2/2, I = m R^2/2
    energy = energy_of(sim)
    call check_close(energy%carried_away, 1.0_dp + 0.5_dp*0.01_dp*9.0_dp, solved, "it takes its energy along")
    call check_close(sim%balance%carried_away, 1.0_dp + 0.5_dp*0.01_dp*9.0_dp, solved, "balance of grains: likewise")
    call check_close(sim%balance%error(), 0.0_dp, solved, "balance of grains: it closes")
    sim%decomposition%boundaries(2)%present = .false.
    call check(some_leave(sim%decomposition), "glued grains leave with their boundary")
    call remove_grains(sim%decomposition, .true., n_free, n_glued, mass)
    call check_equal(n_free, 0_i8, "no free one leaves")
    call check_close(mass, 0.0_dp, 0.0_dp, "and no mass of free ones")
    call check_equal(n_glued, 2_i8, "both glued ones leave")
    call sim%free()
  end subroutine check_departures

  !> A disk on a plane.
  subroutine make_resting(sim, boundary, after)
    type(simulation_t), intent(inout) :: sim
    character(len=*), intent(in) :: boundary, after

    call add_grain(1, 1.0_dp, 0, 0.0_dp, 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 1.0_dp, 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, -9.81, friction = 0.5, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0.5"//boundary//" /"//newline// &
      & "&time step = 0.01, steps = 99 /"//newline//exact//", sleeping = T, sleep_after = "//after//", sleep_speed = 1e-3 /"// &
      & newline)
  end subroutine make_resting

  !> Steps at rest of grain `id`: the same on all ranks.
  integer function counted(sim, id)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: id
    integer :: s, k
    real(dp) :: most

    most = -1.0_dp
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) == id) most = owned%rest(k)
        end do
      end associate
    end do
    counted = nint(comm%highest(most))
  end function counted

  !> Wake grain `id`, and add to its vertical velocity, or to another component.
  subroutine push(sim, id, velocity, component)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: id
    real(dp), intent(in) :: velocity
    integer, intent(in), optional :: component
    integer :: s, k, d

    d = 2
    if (present(component)) d = component
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) /= id) cycle
          call owned%wake(k)
          owned%velocity(d, k) = owned%velocity(d, k) + velocity
        end do
      end associate
    end do
  end subroutine push

  !> Multiply the impulse that the list keeps of the contact of grain `id` with the plane.
  subroutine disturb(sim, id, factor)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: id
    real(dp), intent(in) :: factor
    integer :: s, p

    do s = 1, size(sim%halo%view)
      associate (view => sim%halo%view(s))
        do p = 1, view%list%n
          if (view%bodies%id(view%list%candidate(p)) == id .and. view%list%antagonist(p) < 0) &
            & view%list%impulse(1, p) = factor*view%list%impulse(1, p)
        end do
      end associate
    end do
  end subroutine disturb

  !> Grains count steps at rest, one a step; a change of the impulses on one by more than a twentieth begins anew; so do all where
  !> they are woken.
  subroutine check_sleeping()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer :: k

    call make_resting(sim, "", "6")
    ! the first step finds impulses that were not there before
    call advance(sim, figures)
    call check_equal(counted(sim, 1), 0, "a grain whose contact is new is not at rest")
    do k = 1, 3
      call advance(sim, figures)
      call check_equal(counted(sim, 1), k, "a step at rest counts")
    end do
    call disturb(sim, 1, 1.04_dp)
    call advance(sim, figures)
    call check_equal(counted(sim, 1), 4, "a change of four percent is rest")
    call disturb(sim, 1, 1.06_dp)
    call advance(sim, figures)
    call check_equal(counted(sim, 1), 0, "a change of six percent is not")
    call check_equal(counted(sim, 2), 5, "the other grain goes on")
    call advance(sim, figures)
    do k = 1, size(sim%problem%sub)
      sim%problem%sub(k)%v_global(3, 1:sim%problem%sub(k)%n_grains) = 1.0_dp
    end do
    call count_rest(sim%sleeping, .true., sim%halo%view, sim%problem, sim%decomposition)
    call check_equal(counted(sim, 1), 0, "a disk that spins is not at rest")
    do k = 1, 7
      call advance(sim, figures)
    end do
    call check_equal(counted(sim, 1), 6, "steps are counted as far as it takes to sleep")
    call check_equal(figures%asleep, 2_i8, "both contacts are left out")
    call check_equal(figures%contacts, 2_i8, "and are contacts still")
    call check_close(grain(sim, 1, 2), 0.0_dp, 0.0_dp, "what sleeps does not move")
    call sim%wake()
    call check_equal(counted(sim, 1), 0, "grains that are woken count from the start")
    call advance(sim, figures)
    call check_equal(figures%asleep, 0_i8, "and none is left out")
    call sim%free()
  end subroutine check_sleeping

  !> On a plane that moves, without friction, nothing changes, and yet disks are not taken to rest on it: of two, one upon the
  !> other, none counts a step while the plane moves, and both count them when it is at rest.
  subroutine check_moving_plane(speed)
    character(len=*), intent(in) :: speed
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer :: k

    call add_grain(1, 1.0_dp, 0, 0.0_dp, 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, 0.0_dp, 0.3_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(3, 1.0_dp, 0, 1.0_dp, 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, -9.81, friction = 0.5, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0, velocity = "//speed//", 0 /"//newline// &
      & "&time step = 0.01, steps = 99 /"//newline//exact//", sleeping = T, sleep_after = 6, sleep_speed = 1e-3 /"//newline)
    do k = 1, 5
      call advance(sim, figures)
    end do
    call check_equal(counted(sim, 1), merge(4, 0, speed == "0"), "steps at rest of the lower disk")
    call check_equal(counted(sim, 2), merge(4, 0, speed == "0"), "and of the one upon it")
    call sim%free()
  end subroutine check_moving_plane

  !> Disks of 1 kg, one upon the other on a plane, that sleep: three, or as many as are given.
  subroutine make_chain(sim, count)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in), optional :: count
    type(step_figures_t) :: figures
    integer :: k, n

    n = 3
    if (present(count)) n = count
    do k = 1, n
      call add_grain(k, 1.0_dp, 0, 0.0_dp, 0.2_dp*k - 0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    end do
    call make(sim, "gravity = 0, -9.81, friction = 0.5, overlap_projection = F /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, friction = 0.5 /"//newline// &
      & "&time step = 0.01, steps = 99 /"//newline//exact//", sleeping = T, sleep_after = 4, sleep_speed = 1 /"//newline// &
      & "&output every = 0 /"//newline)
    do k = 1, 7
      call advance(sim, figures)
    end do
    call check_equal(figures%asleep, int(n, i8), "a chain sleeps")
    call check_equal(sim%problem%n_contacts, 0_i8, "and leaves an empty problem")
  end subroutine make_chain

  !> What is left out comes back for whoever looks at all contacts. A small change of the impulses on a sleeper wakes nothing.
  subroutine check_chain_asleep()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    type(resting_t) :: resting
    type(contact_problem_t) :: whole
    type(supports_t), allocatable :: supports(:)
    integer :: s

    call make_chain(sim)
    call watch_awake(sim%decomposition, sim%halo, resting)
    call check_equal(resting%bodies, 3_i8, "bodies that sleep")
    call check_equal(resting%contacts, 3_i8, "and contacts that are left out")
    call build_whole(sim%decomposition, sim%halo, sim%physics, sim%problem, whole)
    call check_equal(whole%n_contacts, 3_i8, "another problem has them")
    do s = 1, size(whole%sub)
      call check(all(whole%sub(s)%boundary > 0), "in which no grain counts as one that cannot move")
      call check(all(sim%halo%view(s)%bodies%wakes_at > 0.0_dp), "though all of them sleep on")
    end do
    call check_equal(sim%problem%n_contacts, 0_i8, "beside the one that was solved")
    call check_close(sim%boundary_impulses(2, 1), 0.0_dp, 0.0_dp, "the plane feels what is solved alone")
    call sim%make_whole()
    call check_equal(sim%problem%n_contacts, 3_i8, "the whole problem has all contacts")
    call check_close(sim%boundary_impulses(2, 1), -3*g*h, solved, "and the plane bears all three")
    ! of the impulses on the disk below, 3 m g h, a tenth is 0.0294 N s
    call push(sim, 3, -0.029_dp)
    call advance(sim, figures)
    call check_equal(figures%tries, 1, "a small change is not noticed")
    call check_equal(figures%asleep, 2_i8, "the two others sleep on")
    call check_equal(sim%problem%n_contacts, 1_i8, "the problem is that of the upper contact")
    call check_close(grain(sim, 3, 2), 0.0_dp, solved, "beside a sleeper that cannot move")
    call find_supports(sim%problem%sub, sim%problem%comm, sim%problem%load(1:sim%problem%nd), supports)
    do s = 1, size(supports)
      call check(all(supports(s)%column(sim%problem%sub(s)%n_bodies + 1:)), "but bears what lies on it")
    end do
    call wake_all(sim%decomposition)
    call check_equal(counted(sim, 1), 0, "all are woken")
    call sim%halo%refresh(sim%decomposition)
    call watch_awake(sim%decomposition, sim%halo, resting)
    call check_equal(resting%bodies, 0_i8, "and none sleeps")
    call sim%free()
  end subroutine check_chain_asleep

  !> A blow wakes what it reaches, and the step is solved with it: the plane takes its momentum up, and the weights.
  subroutine check_chain_disturbed()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures

    call make_chain(sim)
    call push(sim, 3, -1.0_dp)
    call advance(sim, figures)
    call check_equal(figures%tries, 2, "a blow is noticed, and the step solved anew")
    call check_equal(figures%asleep, 0_i8, "with all awake that it reaches")
    call check_equal(sim%problem%n_contacts, 3_i8, "in the problem of all contacts")
    call check_close(sim%boundary_impulses(2, 1), -3*g*h - 1.0_dp, solved, "whose impulses carry its momentum through")
    call check_equal(counted(sim, 1), 0, "what is woken counts anew")
    call sim%free()
    call make_chain(sim)
    call push(sim, 3, 1.0_dp)
    call advance(sim, figures)
    call check_equal(figures%tries, 2, "a load that goes away is noticed")
    call check_close(sim%boundary_impulses(2, 1), -2*g*h, solved, "and the plane bears the two that stay")
    call sim%free()
    ! each solve wakes the next disk, with one below it, then two, then as many as are left
    call make_chain(sim, 8)
    call push(sim, 8, -1.0_dp)
    call advance(sim, figures)
    call check_equal(figures%tries, 4, "a blow goes down a chain of eight in three tries")
    call check_close(sim%boundary_impulses(2, 1), -8*g*h - 1.0_dp, 10*solved, "down to the plane")
    call sim%free()
    ! beside bodies that sleep a solve that does not reach its tolerance is made anew with all awake
    call make_chain(sim)
    call push(sim, 3, -0.014_dp)
    sim%control%tolerance = -1.0_dp
    sim%control%max_iterations = 3
    call advance(sim, figures)
    call check_equal(figures%asleep, 0_i8, "none sleeps where no solution is found")
    call check_equal(sim%problem%n_contacts, 3_i8, "all contacts are solved")
    call sim%free()
  end subroutine check_chain_disturbed

  !> A disk spins upon one that sleeps, and gives it a tangential impulse of a third of m R w. The momentum m (|v| + R |w|) of the
  !> sleeper by this is three times as large, as the moment of inertia is m R^2/2: it wakes where this exceeds a tenth of the normal
  !> impulses on it, 0.3 m g h, though the impulse itself is less than half of that.
  subroutine check_turned_sleeper(spin, tries)
    !> [rad/s]
    real(dp), intent(in) :: spin
    integer, intent(in) :: tries
    type(simulation_t) :: sim
    type(step_figures_t) :: figures

    call make_chain(sim, 2)
    call push(sim, 2, spin, 3)
    call advance(sim, figures)
    call check_equal(figures%tries, tries, "a sleeper that is turned wakes where it would move")
    call check_equal(figures%asleep, merge(1_i8, 0_i8, tries == 1), "and sleeps on where it would not")
    call sim%free()
  end subroutine check_turned_sleeper

  !> What lies on a sleeper is swept away so fast that the pair is no longer near: the sleeper wakes, and its support bears it
  !> alone.
  subroutine check_swept_off()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures

    call make_chain(sim, 2)
    call push(sim, 2, 0.0_dp)
    call advance(sim, figures)
    call check_equal(figures%asleep, 1_i8, "it sleeps beside what lies on it, and is awake")
    call push(sim, 2, 300.0_dp, 1)
    call advance(sim, figures)
    call check_equal(figures%tries, 2, "a load that is swept away is noticed")
    call check_close(sim%boundary_impulses(2, 1), -g*h, solved, "and the plane bears the disk that stays")
    call sim%free()
  end subroutine check_swept_off

  !> What a sleeper bears of the contacts that are left out: its weight where all sleep, with the weight of the disks upon it where
  !> these are awake; nothing where it is awake itself.
  subroutine check_held()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer, allocatable :: seen(:)
    integer :: k, s

    call make_chain(sim)
    do k = 1, 3
      call check_close(held(sim, k), g*h, solved, "contacts that are left out bear a disk")
    end do
    call sim%make_whole()
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), view => sim%halo%view(s))
        call find_seen(view%list, sub, seen)
        do k = 1, sub%n_columns
          if (seen(k) > 0) call check_equal(view%bodies%id(seen(k)), sub%id(k), "the grain behind a column")
          call check((seen(k) > 0) .eqv. (k <= sub%n_grains), "grains have a place, and boundaries none")
        end do
        call check_close(max(0.0_dp, maxval(abs(sub%v_global(:, 1:sub%n_grains)))), 0.0_dp, 0.0_dp, "what sleeps has no velocity")
      end associate
    end do
    do k = 1, 2
      call push(sim, 3, -0.02_dp)
      call advance(sim, figures)
      call check_equal(figures%asleep, 2_i8, "the two disks below sleep on")
      call check_close(held(sim, 1), g*h, solved, "between contacts that are left out")
      call check_close(held(sim, 2), 2*g*h, solved, "with the upper disk upon what they bear")
      call check_close(held(sim, 3), 0.0_dp, 0.0_dp, "which is awake")
    end do
    do k = 1, 6
      call advance(sim, figures)
    end do
    call check_equal(figures%asleep, 3_i8, "all sleep again")
    do k = 1, 3
      call check_close(held(sim, k), g*h, solved, "as they did before")
    end do
    call sim%wake()
    call check_close(held(sim, 1), 0.0_dp, 0.0_dp, "what is awake bears nothing of them")
    call sim%free()
  end subroutine check_held

  !> What has changed the impulses on a sleeper without waking it is not forgotten: all wake in the step whose number is the next
  !> multiple of ten times `sleep_after`, and fall asleep again. Where nothing has changed they do not wake.
  subroutine check_stirred()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer :: step

    call make_chain(sim)
    call push(sim, 3, -0.02_dp)
    do step = 8, 80
      call advance(sim, figures)
      call check_equal(counted_stirred(sim), merge(1, 0, step < 40), "the middle disk has borne a change until all wake")
      if (step < 16) cycle
      call check_equal(figures%asleep, merge(0_i8, 3_i8, step >= 40 .and. step < 44), "in steps 40 to 43 none sleeps")
      call check_equal(sim%problem%n_contacts, merge(3_i8, 0_i8, step >= 40 .and. step < 44), "and all contacts are solved")
    end do
    call sim%free()
  end subroutine check_stirred

  !> Grains, those of all ranks, that sleep under changed impulses.
  integer function counted_stirred(sim)
    type(simulation_t), intent(in) :: sim
    integer(i8) :: n(1)
    integer :: s

    n(1) = 0
    do s = 1, size(sim%decomposition%owned)
      n(1) = n(1) + sum(sim%decomposition%owned(s)%stirred)
    end do
    call comm%sum_counts(n)
    counted_stirred = narrow(n(1))
  end function counted_stirred

  !> Vertical impulse that grain `id` bears of the contacts that are left out: the same on all ranks [N s].
  real(dp) function held(sim, id)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: id
    integer :: s, k

    held = -huge(1.0_dp)
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) == id) held = owned%held(2, k)
        end do
      end associate
    end do
    held = comm%highest(held)
  end function held

  !> What sleeps on a grain that leaves the scene wakes in that step, and falls.
  subroutine check_left_behind()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures

    call make_chain(sim)
    sim%decomposition%dismissed = [2_i8]
    call advance(sim, figures)
    call check_equal(figures%left, 1_i8, "a grain leaves")
    call check_close(grain(sim, 3, 2), -g*h, solved, "the one above it falls")
    call check_close(grain(sim, 1, 2), 0.0_dp, solved, "and the one below it rests")
    call sim%free()
  end subroutine check_left_behind

  !> A plane on which disks sleep starts to move: they wake in that step and, with enough friction, roll with a third of its speed.
  subroutine check_starting_boundary()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer :: k, unit

    if (comm%rank == 0) then
      open (newunit=unit, file="start.csv", action="write", status="replace")
      write (unit, "(a)") "time,vx", "0,0", "0.095,0", "0.0951,0.03", "1,0.03"
      close (unit)
    end if
    call make_resting(sim, ", table = 'start.csv'", "4")
    do k = 1, 9
      call advance(sim, figures)
    end do
    call check_equal(figures%asleep, 2_i8, "disks sleep on a plane at rest")
    call advance(sim, figures)
    call check_equal(figures%asleep, 0_i8, "they wake when it starts")
    call check_equal(counted(sim, 2), 0, "and count no step at rest")
    ! from half a step before the end of the step to half a step after it, but for half of the jump
    call check_close(grain(sim, 1, 1), 0.995_dp*0.01_dp, solved, "a third of its speed")
    call check_close(grain(sim, 1, 3), 0.995_dp*0.2_dp, solved, "and roll: R w = 2 v against the plane")
    call sim%free()
  end subroutine check_starting_boundary

  !> Two disks that overlap by 0.6 of a radius, two that overlap by 0.4, and one whose centre is nearly on a plane: planes stop what
  !> is behind them, however deep.
  subroutine check_deep_contacts()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    type(deep_contacts_t) :: deep

    call add_grain(1, 1.0_dp, 0, -1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 1.0_dp, 0, -0.86_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(3, 1.0_dp, 0, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(4, 1.0_dp, 0, 1.16_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(5, 1.0_dp, 0, 0.0_dp, -1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0 /"//newline//"&boundary shape = 'plane', point = 0, -1.01, normal = 0, 1 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call sim%assemble(figures)
    call deep%find(sim%decomposition, sim%halo, sim%problem, 0.0_dp)
    call check_equal(int(deep%number), 0, "rigid disks are not looked at")
    call deep%find(sim%decomposition, sim%halo, sim%problem, 0.5_dp)
    call check_equal(int(deep%number), 1, "contacts that are deep")
    call check_close(deep%deepest, 0.6_dp, solved, "the deepest of them")
    call sim%free()
  end subroutine check_deep_contacts

  !> An overlap is taken back in inverse proportion to the masses, without a velocity; no grain moves by more than half the alert
  !> distance.
  subroutine check_projection()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp) :: shifts, x(2)
    real(dp), parameter :: allowed = 1.0e-3_dp, overlap = 5.0e-3_dp

    call add_grain(1, 1.0_dp, 0, -0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 3.0_dp, 0, 0.095_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, friction = 0.3, overlap_allowed = 1e-3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call sim%assemble(figures)
    call sim%problem%evaluate()
    call project_overlaps(sim%decomposition, sim%problem, h, allowed, shifts)
    call check_close(grain(sim, 1, 1, .true.), -0.1_dp - 0.75_dp*(overlap - allowed), solved, "the light grain gives way by 3/4")
    call check_close(grain(sim, 2, 1, .true.), 0.095_dp + 0.25_dp*(overlap - allowed), solved, "the heavy one by 1/4")
    call check_close(shifts, overlap - allowed, solved, "lengths of the shifts")
    call check_close(abs(grain(sim, 1, 1)) + abs(grain(sim, 2, 1)), 0.0_dp, 0.0_dp, "nothing gets a velocity")
    call sim%free()
    ! an approach of 0.2 m/s adds 0.002 in the next step, and half of it has come about in the middle of this one
    call add_grain(1, 1.0_dp, 0, -0.1_dp, 0.0_dp, 0.2_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 3.0_dp, 0, 0.095_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, friction = 0.3, overlap_allowed = 1e-3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call sim%assemble(figures)
    call sim%problem%evaluate()
    call project_overlaps(sim%decomposition, sim%problem, h, allowed, shifts)
    call check_close(shifts, overlap + 0.5_dp*h*0.2_dp + h*0.2_dp - allowed, solved, "lengths of the shifts with an approach")
    call sim%free()
    ! 0.08 too much: the light grain would move by 0.0585, and moves by 0.01
    call add_grain(1, 1.0_dp, 0, -0.1_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 3.0_dp, 0, 0.02_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, friction = 0.3, overlap_allowed = 2e-3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call advance(sim, figures)
    x(1) = grain(sim, 1, 1, .true.)
    x(2) = grain(sim, 2, 1, .true.)
    call check(figures%projected, "a step projects overlaps beyond what is allowed")
    call check_close(x(1), -0.1_dp - 0.01_dp, solved, "half the alert distance at most")
    call check_close(x(2), 0.02_dp + 0.01_dp/3.0_dp, solved, "the other grain in proportion")
    call sim%free()
  end subroutine check_projection

  !> Disks in a row overlap by what is allowed, but for two that overlap by more: what mends that pair moves the others, in whose
  !> contacts too much overlap comes about, and so on.
  subroutine check_projected_row()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp), parameter :: allowed = 1.0e-3_dp, excess = 4.0e-3_dp
    !> an overlap that a projection may leave, as a part of what was too much
    real(dp), parameter :: left = 0.1_dp*excess
    integer, parameter :: n = 48
    real(dp) :: x(n), before(n), shifts
    integer :: k

    do k = 1, n
      ! by a thousandth less than what is allowed, so that none of these is too much by rounding
      before(k) = (k - 0.5_dp*(n + 1))*(0.2_dp - 0.999_dp*allowed)
      if (k > n/4) before(k) = before(k) - excess
      call add_grain(k, 2.0_dp, 0, before(k), 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    end do
    call make(sim, "gravity = 0, 0, friction = 0.3, overlap_allowed = 1e-3 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call sim%assemble(figures)
    call sim%problem%evaluate()
    call project_overlaps(sim%decomposition, sim%problem, h, allowed, shifts)
    do k = 1, n
      x(k) = grain(sim, k, 1, .true.)
    end do
    do k = 2, n
      call check(x(k) - x(k - 1) >= 0.2_dp - allowed - left - solved, "no pair overlaps too much, wherever it is in the row")
    end do
    call check(x(n/4 - 5) - before(n/4 - 5) < 0.0_dp .and. x(n/4 + 6) - before(n/4 + 6) > 0.0_dp, "others give way, too")
    call check_close(sum(x) - sum(before), 0.0_dp, solved, "the centre of mass stays")
    call check_close(shifts, sum(abs(x - before)), solved, "lengths of the shifts")
    call sim%free()
  end subroutine check_projected_row

  !> A lid that forces move overlaps with two disks in two subdomains, and is as heavy as both in a projection: lid and disks share
  !> the excess in equal parts, whatever its own mass is. It moves alike on all ranks.
  subroutine check_shared_lid()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    real(dp), parameter :: allowed = 1.0e-3_dp, overlap = 5.0e-3_dp
    real(dp) :: top

    call add_grain(1, 2.0_dp, 0, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call add_grain(2, 2.0_dp, 0, 4.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp)
    call make(sim, "gravity = 0, 0, friction = 0.3, overlap_allowed = 1e-3 /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0.095, "// &
      & "normal = 0, -1, free = F, T, mass = 50.0, force = 0, 0 /"//newline// &
      & "&time step = 0.01, steps = 9 /"//newline//exact//" /")
    call advance(sim, figures)
    top = sim%decomposition%boundaries(1)%surface%point(2)
    call check_equal(figures%interface_statistics%bodies, 1_i8, "two subdomains share the lid")
    call check_close(figures%max_overlap, overlap, solved, "the overlap of the lid")
    call check_close(top, 0.095_dp + 0.5_dp*(overlap - allowed), solved, "the lid goes up by half of the excess")
    call check_close(grain(sim, 1, 2, .true.), -0.5_dp*(overlap - allowed), solved, "the first disk goes down by the other half")
    call check_close(grain(sim, 2, 2, .true.), -0.5_dp*(overlap - allowed), solved, "and so does the second one")
    call check_close(sim%decomposition%boundaries(1)%velocity(2), 0.0_dp, 0.0_dp, "the lid gets no velocity")
    call check_close(sim%decomposition%boundaries(1)%surface%point(1), 0.0_dp, 0.0_dp, "and stays along what is prescribed")
    call check_close(comm%highest(top) + comm%highest(-top), 0.0_dp, 0.0_dp, "all ranks have moved it alike")
    call sim%free()
  end subroutine check_shared_lid

end program test_step_parts
