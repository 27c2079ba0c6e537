!> The step and its parts on scenes of a few disks whose answers are known: motion to the middle and to the end, areas of loads,
!> when space is divided, the contact in which a solve failed, the tally of a run.
program test_time_stepper
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_time_table, only: time_table_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_solve_report, only: solve_report_t, solve_converged, solve_stagnated, solve_diverged
  use gravier_repartition, only: repartition_rule_t, repartition_is_due
  use gravier_load_areas, only: facing_area, find_load_areas
  use gravier_body_motion, only: move_to_middle, move_to_end, drive
  use gravier_fast_grains, only: count_fast
  use gravier_failed_contact, only: find_divergence, find_largest_impulse
  use gravier_interface, only: interface_statistics_t
  use gravier_run_tally, only: run_tally_t
  use gravier_search_direction, only: search_direction_t, chosen_direction
  use gravier_method_options, only: method_options_t
  use gravier_step_figures, only: step_figures_t
  use gravier_time_stepper, only: time_stepper_t
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> step [s], gravity [m/s^2]
  real(dp), parameter :: h = 0.01_dp, g = 10.0_dp
  !> one disk of 0.1 m
  character(len=*), parameter :: one = "&scene bodies = 'lattice', lattice_count = 1, 1, radius_min = 0.1, radius_max = 0.1, "// &
    & "gravity = 0, -10 / "
  character(len=*), parameter :: column = "&scene bodies = 'column', column_count = 3, radius = 0.5, gravity = 0, -10 / "
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_division()
  call test_areas()
  call test_motion()
  call test_step()
  call test_failed_contact()
  call test_tally()
  call test_direction()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> By schedule; by an imbalance that exceeds the limit and 1.1 times what the last division reached, or in a few steps
  !> the limit alone; never in step 0 or alone.
  subroutine test_division()
    integer, parameter :: again(13) = [16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 112, 128]
    integer :: n, step

    call check(.not. repartition_is_due(repartition_rule_t(subdomains=4), 7, 9.0_dp, 1.0_dp), "never without a rule")
    call check(repartition_is_due(repartition_rule_t(subdomains=4, every=5), 10, 1.0_dp, 1.0_dp), "each fifth step")
    call check(repartition_is_due(repartition_rule_t(subdomains=4, overdue=.true.), 7, 1.0_dp, 1.0_dp), "overdue")
    call check(.not. repartition_is_due(repartition_rule_t(subdomains=4, every=5), 11, 1.0_dp, 1.0_dp), "not in between")
    call check(.not. repartition_is_due(repartition_rule_t(subdomains=4, every=5), 0, 9.0_dp, 1.0_dp), "not in step 0")
    call check(.not. repartition_is_due(repartition_rule_t(subdomains=1, every=5), 10, 9.0_dp, 1.0_dp), "not of one subdomain")
    call check(repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), 3, 1.6_dp, 1.2_dp), "uneven")
    call check(.not. repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), 3, 1.4_dp, 1.2_dp), "even enough")
    call check(.not. repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), 3, 1.7_dp, 1.6_dp), &
      & "tried in vain before")
    call check(repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), 3, 1.8_dp, 1.6_dp), "worse than reached")
    n = 0
    do step = 1, 128
      if (.not. repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), step, 1.7_dp, 1.6_dp)) cycle
      n = n + 1
      call check_close(real(step, dp), real(again(min(n, size(again))), dp), 0.0_dp, "what was not cured is tried again")
      call check(.not. repartition_is_due(repartition_rule_t(subdomains=4, imbalance=1.5_dp), step, 1.4_dp, 1.6_dp), &
        & "even enough again")
    end do
    call check(n == size(again), "how often it is tried again")
  end subroutine test_division

  !> A box of 2 by 4 m whose right side forces move along x, and a segment of 1.5 m that they move along y.
  subroutine test_areas()
    type(simulation_t) :: simulation
    real(dp) :: area(5)

    call make_scene(comm, column//"&time step = 0.01, steps = 1 / "// &
      & "&boundary name = 'left', shape = 'plane', normal = 1, 0, point = -1, 0 / "// &
      & "&boundary name = 'right', shape = 'plane', normal = -1, 0, point = 1, 0, free = T, F, mass = 1.0, pressure = 5.0 / "// &
      & "&boundary name = 'lid', shape = 'plane', normal = 0, -1, point = 0, 4 / "// &
      & "&boundary name = 'bar', shape = 'segment', point = -0.8, 3.5, end = 0.7, 3.5, free = F, T, mass = 1.0 /", simulation)
    call check_close(facing_area(simulation%decomposition, 3), 4.0_dp, 1e-12_dp, "way between floor and lid")
    call check_close(facing_area(simulation%decomposition, 4), 2.0_dp, 1e-12_dp, "way between the sides")
    call find_load_areas(simulation%decomposition, area)
    call check_close(area(1), 0.0_dp, 0.0_dp, "no load on a side that rests")
    call check_close(area(3), 4.0_dp, 1e-12_dp, "area of the right side")
    call check_close(area(5), 1.5_dp, 1e-12_dp, "length of the bar")
    call simulation%free()
    call make_scene(comm, column//"&time step = 0.01, steps = 1 / "// &
      & "&boundary name = 'lid', shape = 'plane', normal = 0, -1, point = 0, 4, free = F, T, mass = 1.0, force = 0, -5 / "// &
      & "&boundary name = 'left', shape = 'plane', normal = 1, 0, point = -0.75, 0 / "// &
      & "&boundary name = 'ring', shape = 'circle', point = 0, 4, radius = 9, free = T, F, mass = 1.0, force = 2, 0 /", simulation)
    call check_close(facing_area(simulation%decomposition, 2), 0.0_dp, 0.0_dp, "no pressure works where nothing bounds the scene")
    call find_load_areas(simulation%decomposition, area(1:4))
    call check_close(area(2), 1.25_dp, 1e-12_dp, "a lid beside one plane works from there to the last grain")
    call check_close(area(4), 4.0_dp, 1e-12_dp, "another shape works on the way between the planes across its load")
    call simulation%free()
  end subroutine test_areas

  !> q_m = q + (1 - theta) h v, and from there theta h v: h v in all. Boundaries take the velocity of the end of the step.
  subroutine test_motion()
    type(simulation_t) :: simulation
    type(time_table_t) :: none
    real(dp), parameter :: theta = 0.75_dp, v(2) = [0.3_dp, -0.2_dp]
    real(dp) :: start(2)
    logical :: taken, changed

    call make_scene(comm, column// &
      & "&boundary name = 'ceiling', shape = 'plane', normal = 0, -1, point = 0, 9, velocity = 0, -2, "// &
      & "remove_at = 1 / &time step = 0.01, steps = 1 /", simulation)
    associate (owned => simulation%decomposition%owned(1), ceiling => simulation%decomposition%boundaries(2))
      start(:) = owned%position(:, 1)
      owned%velocity(1:2, 1) = v
      call move_to_middle(simulation%decomposition, simulation%physics, theta, 0.0_dp, .false., taken)
      call check(.not. taken, "nothing is taken away before its time")
      call check_close(norm2(owned%position(:, 1) - start - (1.0_dp - theta)*h*v), 0.0_dp, 1e-15_dp, "q_m")
      call check_close(ceiling%surface%point(2), 9.0_dp - 2.0_dp*(1.0_dp - theta)*h, 1e-12_dp, "boundary at the middle")
      call drive(simulation%decomposition, simulation%physics, none, 0.0_dp, changed)
      call check(.not. changed, "constant gravity")
      call move_to_end(simulation%decomposition, simulation%physics, theta, .false.)
      call check_close(norm2(owned%position(:, 1) - start - h*v), 0.0_dp, 1e-15_dp, "q_i+1")
      call check_close(ceiling%surface%point(2), 9.0_dp - 2.0_dp*h, 1e-12_dp, "boundary at the end")
      call move_to_middle(simulation%decomposition, simulation%physics, theta, 1.0_dp, .false., taken)
      call check(taken .and. .not. ceiling%present, "taken away when its time has come")
      call check_equal(int(count_fast(simulation%decomposition, simulation%physics)), 0, "none is fast")
      owned%velocity(2, 2) = 1.01_dp*owned%radius(2)/h
      owned%velocity(1, 3) = 0.99_dp*owned%radius(3)/h
      call check_equal(int(count_fast(simulation%decomposition, simulation%physics)), 1, "more than a radius in a step")
    end associate
    call simulation%free()
  end subroutine test_motion

  !> A disk alone in free fall, by the time stepper itself: v_n = -n g h, and with theta = 1/2 heights are exact.
  subroutine test_step()
    type(simulation_t), target :: simulation
    class(time_stepper_t), pointer :: stepper
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    real(dp) :: start
    integer :: n

    call make_scene(comm, one//"&time step = 0.01, steps = 9 /", simulation)
    stepper => simulation
    ! away from the walls of the lattice
    stepper%decomposition%owned(1)%position(2, 1) = 5.0_dp
    stepper%halo%builds = 0
    start = stepper%decomposition%owned(1)%position(2, 1)
    do n = 1, 5
      call stepper%advance(figures, error)
      call check(.not. allocated(error), "a step is made")
      call check_equal(figures%solve%status, solve_converged, "nothing to solve")
      associate (owned => stepper%decomposition%owned(1))
        call check_close(owned%velocity(2, 1), -n*g*h, 1e-12_dp, "velocity of the fall")
        call check_close(owned%position(2, 1), start - 0.5_dp*g*(n*h)**2, 1e-12_dp, "height of the fall")
      end associate
    end do
    call check_equal(stepper%step, 5, "steps made")
    call check_close(stepper%time, 5*h, 1e-15_dp, "time")
    call check_equal(int(stepper%tally%solves), 5, "solves in the tally")
    call check_equal(int(stepper%failed), 0, "none failed")
    call stepper%free()
    call check_equal(stepper%step, 0, "back to step 0")
  end subroutine test_step

  !> Of a column of three with friction: the bodies of the contact with a NaN, of that whose body has a velocity without a square,
  !> and of that with the largest impulse, all of whose components count.
  subroutine test_failed_contact()
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    character(len=:), allocatable :: cause
    integer :: c, top

    call make_scene(comm, "&scene bodies = 'column', column_count = 3, radius = 0.5, gravity = 0, -10, friction = 0.5 / "// &
      & "&time step = 0.01, steps = 1 /", simulation)
    call simulation%assemble(figures)
    associate (sub => simulation%problem%sub(1))
      call check_equal(sub%n_contacts, 3, "contacts of a column of three")
      call find_divergence(simulation%problem, cause)
      call check(.not. allocated(cause), "no cause where all numbers are finite")
      do c = 1, sub%n_contacts
        sub%impulse(lane_of(c), 1, block_of(c)) = 1.0_dp
      end do
      sub%impulse(lane_of(2), 1, block_of(2)) = 5.0_dp
      call find_largest_impulse(simulation%problem, cause)
      call check(index(cause, "largest impulse: contact of bodies "//text_of(simulation, 2)) == 1, "the largest impulse: "//cause)
      sub%impulse(lane_of(1), 2, block_of(1)) = -6.0_dp
      call find_largest_impulse(simulation%problem, cause)
      call check(index(cause, "largest impulse: contact of bodies "//text_of(simulation, 1)) == 1, "one that slides: "//cause)
      ! one contact has the uppermost disk, whose identifier is 3
      top = 1
      do c = 1, sub%n_contacts
        if (sub%id(sub%pair(1, c)) == 3 .or. sub%id(sub%pair(2, c)) == 3) top = c
      end do
      do c = 1, 2
        if (sub%id(sub%pair(c, top)) == 3) sub%velocity(2, sub%pair(c, top)) = 1e200_dp
      end do
      call find_divergence(simulation%problem, cause)
      call check(index(cause, "contact of bodies "//text_of(simulation, top)) == 1, "a velocity without a square: "//cause)
      do c = 1, 2
        if (sub%id(sub%pair(c, top)) == 3) sub%velocity(2, sub%pair(c, top)) = 0.0_dp
      end do
      sub%impulse(lane_of(3), 1, block_of(3)) = ieee_value(1.0_dp, ieee_quiet_nan)
      call find_divergence(simulation%problem, cause)
      call check(index(cause, "contact of bodies "//text_of(simulation, 3)) == 1, "the contact with a NaN: "//cause)
    end associate
    call simulation%free()
  end subroutine test_failed_contact

  !> Identifiers of the bodies of a contact, as messages have them.
  function text_of(simulation, contact) result(text)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: contact
    character(len=:), allocatable :: text
    character(len=24) :: number(2)
    integer :: k

    associate (sub => simulation%problem%sub(1))
      do k = 1, 2
        write (number(k), "(i0)") sub%id(sub%pair(k, contact))
      end do
    end associate
    text = trim(number(1))//" and "//trim(number(2))
  end function text_of

  !> Six solves and three steps.
  subroutine test_tally()
    type(run_tally_t) :: tally
    type(solve_report_t) :: solve

    solve%status = solve_converged
    solve%velocity_error = 0.02_dp
    solve%velocity_scale = 0.1_dp
    solve%residual = 2e-2_dp
    call tally%add_solve(solve, "load of a step", 1)
    ! reached another criterion: out of the accuracy, then too soon to tell, twice
    solve%accurate = .false.
    call tally%add_solve(solve, "load of a step", 2)
    solve%judged = .false.
    call tally%add_solve(solve, "load of a step", 3)
    call tally%add_solve(solve, "load of a step", 4)
    ! a pass over layers that the solve went on from, then one that it did not
    solve%layered_sweeps = 1.5_dp
    solve%layered = .true.
    solve%status = solve_stagnated
    solve%velocity_error = 0.06_dp
    solve%residual = 1e-2_dp
    call tally%add_solve(solve, "load of a step", 5)
    solve%layered = .false.
    solve%status = solve_diverged
    solve%velocity_error = 1e9_dp
    solve%velocity_scale = 0.4_dp
    call check_equal(tally%last_missed, 5, "last step that missed so far")
    call tally%add_solve(solve, "speeds", 6)
    call check_equal(int(tally%solves), 6, "solves")
    call check_equal(int(tally%inaccurate), 1, "out of the accuracy")
    call check_equal(int(tally%unjudged), 2, "ended too soon to tell")
    call check_equal(int(tally%missed()), 2, "missed")
    call check_equal(tally%first_missed, 5, "first step that missed")
    call check_equal(tally%last_missed, 6, "last step that missed")
    call check_equal(int(tally%tried_layers), 2, "passes over layers that were tried")
    call check_equal(int(tally%took_layers), 1, "and gone on from")
    call check_close(tally%layered_sweeps, 3.0_dp, 0.0_dp, "sweeps of both")
    call check_equal(int(tally%stagnated), 1, "stagnated")
    call check_equal(int(tally%diverged), 1, "diverged")
    call check_close(tally%worst_error, 0.6_dp, 1e-12_dp, "worst error over the scale, of those that are numbers")
    call check_equal(int(tally%far_off), 1, "beyond half of the scale")
    call check_close(tally%worst_residual, 2e-2_dp, 0.0_dp, "worst residual")
    call check_close(tally%least_scale, 0.1_dp, 0.0_dp, "smallest scale")
    call check_close(tally%most_scale, 0.4_dp, 0.0_dp, "largest scale")
    call check_equal(tally%n_kinds, 2, "kinds of scales")
    call check_equal(int(tally%of_kind(1)), 5, "solves of the first kind")
    call tally%add_step(0.3_dp, interface_statistics_t(), .true., 0.1_dp, 1.0_dp, 0_i8)
    call tally%add_step(0.1_dp, interface_statistics_t(overlapping_cores=4, stretched_bonds=2), .false., 0.0_dp, 2.0_dp, 3_i8)
    call tally%add_step(0.5_dp, interface_statistics_t(overlapping_cores=3, points_left_out=7), .false., 0.2_dp, 3.0_dp, 1_i8)
    call check_equal(int(tally%pressed_deep), 2, "steps with contacts that are pressed deep")
    call check_equal(int(tally%steps_left_out), 1, "steps in which points were left out")
    call check_equal(int(tally%most_left_out), 7, "the most points in one of them")
    call check_equal(int(tally%steps_with_cores), 2, "steps in which cores overlapped")
    call check_equal(int(tally%most_cores), 4, "the most pairs in one of them")
    call check_equal(int(tally%steps_stretched), 1, "steps in which bonds were stretched")
    call check_equal(int(tally%most_stretched), 2, "the most bonds in one of them")
    call check_close(tally%mended_share(), 1.0_dp/3.0_dp, 1e-12_dp, "share of steps with projections")
    call check_close(tally%start_overlap, 0.3_dp, 0.0_dp, "overlap of the start")
    call check_close(tally%later_overlap, 0.5_dp, 0.0_dp, "overlap of later steps")
    call check_close(tally%shift, 0.3_dp, 1e-12_dp, "shifts")
    call check_close(tally%path, 6.0_dp, 1e-12_dp, "paths")
    call check(.not. tally%overlaps_grew(0.1_dp), "0.5 is less than twice that of the start")
    tally%later_overlap = 0.61_dp
    call check(tally%overlaps_grew(0.1_dp), "more than twice that of the start")
    call check(.not. tally%overlaps_grew(0.4_dp), "but not more than twice what is allowed")
  end subroutine test_tally

  !> Given or chosen, and on which contacts.
  subroutine test_direction()
    type(search_direction_t) :: direction

    direction = chosen_direction(method_options_t(active_only=.true.), 7.0_dp, 2.0_dp)
    call check_close(direction%value, 7.0_dp, 0.0_dp, "chosen on active contacts")
    call check(direction%automatic .and. direction%active_only, "automatic, active")
    direction = chosen_direction(method_options_t(), 7.0_dp, 2.0_dp)
    call check_close(direction%value, 2.0_dp, 0.0_dp, "chosen on all contacts")
    direction = chosen_direction(method_options_t(direction_given=.true., direction=0.5_dp, direction_relative=.false.), &
      & 7.0_dp, 2.0_dp)
    call check_close(direction%value, 0.5_dp, 0.0_dp, "given")
    call check(.not. (direction%automatic .or. direction%relative), "given in kg")
  end subroutine test_direction

end program test_time_stepper
