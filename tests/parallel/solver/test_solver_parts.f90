!> Parts of a solve on columns of disks and on single disks, whose answers are known: supports and ways to them, levels that sink,
!> a start layer by layer, impulses in vain, checks, the law as an equation, impulses that are fed back, the safeguard.
program test_solver_parts
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_memory_need, only: check_memory
  use gravier_contact_kernels, only: lanes, n_blocks, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_method, only: work_t
  use gravier_nlgs, only: nlgs_t
  use gravier_convergence_history, only: convergence_history_t
  use gravier_supports, only: supports_t, find_supports
  use gravier_ways, only: ways_t, list_closed, shorten_ways, unreached
  use gravier_levels, only: levels_t
  use gravier_layered_start, only: carry_loads
  use gravier_layer_trial, only: layer_trial_t
  use gravier_velocity_error, only: velocity_error_t, copies_ready, violations_allowed
  use gravier_residual_verdict, only: find_residual_verdict, excess_of, residual_ends, residual_waits, residual_in_vain
  use gravier_check_schedule, only: check_schedule_t
  use gravier_fresh_start, only: fresh_start_t
  use gravier_stagnation, only: stagnation_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  use gravier_vain_impulses, only: are_in_vain, speed_against
  use gravier_creeping_groups, only: creep_t, find_creep
  use gravier_proximal_law, only: proximal_law_t, parts_of
  use gravier_newton, only: newton_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_interface_problem, only: interface_field_t, make_field
  use gravier_impulse_feedback, only: impulse_feedback_t
  use gravier_direction_guard, only: direction_guard_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> some roundings of numbers of the order of ten
  real(dp), parameter :: rounding = 1.0e-13_dp
  type(communicator_t), target :: comm
  integer :: k

  call start_parallel()
  call comm%init()
  do k = 1, 3
    call check_ways(k)
    call check_levels(k)
    call check_depths(k)
  end do
  call check_layers()
  call check_layer_trial()
  call test_schedule(.false.)
  call test_schedule(.true.)
  call test_schedule_of_estimates()
  call test_ratio_of_a_run()
  call test_fresh_start()
  call check_vain_impulses()
  call check_tangential_shift()
  call check_stagnation()
  call check_creep(1)
  call check_creep(2)
  call check_law(2, rolling=.false.)
  call check_law(3, rolling=.false.)
  call check_law(2, rolling=.true.)
  call check_law(3, rolling=.true.)
  call check_newton()
  call check_feedback(0.0_dp, 0.8125_dp)
  call check_feedback(2.0_dp, 1.0_dp)
  call check_guard()
  call test_memory_need()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of disks of radius 1 and mass 1 under gravity 1, in a step of 1: the contact below disk k of n bears n + 1 - k.
  subroutine make_column(n, subdomains, more, sim, dimension, rolling)
    integer, intent(in) :: n, subdomains
    !> other groups
    character(len=*), intent(in) :: more
    type(simulation_t), intent(inout) :: sim
    integer, intent(in), optional :: dimension
    !> moments resist rolling and, in space, pivoting
    logical, intent(in), optional :: rolling
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    character(len=:), allocatable :: moments
    integer :: nd

    nd = 2
    if (present(dimension)) nd = dimension
    moments = ""
    if (present(rolling)) then
      if (rolling) moments = ", rolling_friction = 0.2"
      if (rolling .and. nd == 3) moments = moments//", pivoting_friction = 0.1"
    end if
    call parse_config("column", "&scene dimension = "//to_text(nd)//", bodies = 'column', column_count = "//to_text(n)// &
      & ", gravity = 0, "//trim(merge("-1   ", "0, -1", nd == 2))//", friction = 0.3"//moments//" /"//newline// &
      & "&time step = 1.0, steps = 1 /"//newline//"&decomposition subdomains = "//to_text(subdomains)//" /"//newline//more, &
      & config, error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "the column is made")
    if (allocated(error)) then
      if (comm%rank == 0) print "(a)", error%message
      call finish_checks()
    end if
    call sim%assemble(figures)
    call sim%problem%evaluate()
  end subroutine make_column

  !> The floor supports, a wall beside the column and a plane that loads hardly press against do not; ways count contacts and
  !> diameters from the floor.
  subroutine check_ways(subdomains)
    integer, intent(in) :: subdomains
    integer, parameter :: n = 5
    type(simulation_t) :: sim
    type(supports_t), allocatable :: supports(:)
    type(ways_t), allocatable :: ways(:)
    integer :: s, b, round

    ! two slopes touch the lowest disk, with normals at 0.6 and 0.28 to the way up
    call make_column(n, subdomains, "&boundary shape = 'plane', point = -1, 0, normal = 1, 0 /"//newline// &
      & "&boundary shape = 'plane', point = -0.8, 0.4, normal = 0.8, 0.6 /"//newline// &
      & "&boundary shape = 'plane', point = 0.96, 0.72, normal = -0.96, 0.28 /"//newline//"&solver method = 'nscdd' /", sim)
    call find_supports(sim%problem%sub, sim%problem%comm, sim%problem%load(1:sim%problem%nd), supports)
    do s = 1, size(supports)
      associate (sub => sim%problem%sub(s))
        do b = sub%n_grains + 1, sub%n_columns
          call check(supports(s)%column(b) .eqv. abs(sim%decomposition%boundaries(sub%boundary(b))%surface%axis(2)) > 0.5_dp, &
            & "the floor and the gentle slope support")
        end do
        call check(.not. any(supports(s)%column(1:sub%n_grains)), "grains do not")
      end associate
    end do
    allocate (ways(size(supports)))
    do round = 1, 2
      if (round == 1) call list_closed(sim%problem, ways)
      if (round == 2) call list_closed(sim%problem, ways, unit=2.0_dp)
      do s = 1, size(ways)
        where (supports(s)%column) ways(s)%length = 0.0_dp
      end do
      call shorten_ways(sim%problem%comm, sim%problem%shared, ways)
      do s = 1, size(ways)
        do b = 1, sim%problem%sub(s)%n_grains
          call check_close(ways(s)%length(b), sim%problem%sub(s)%id(b) - merge(0.0_dp, 0.5_dp, round == 1), rounding, &
            & "way from a disk to the floor")
        end do
      end do
    end do
    sim%problem%load(:) = 0.0_dp
    call find_supports(sim%problem%sub, sim%problem%comm, sim%problem%load(1:sim%problem%nd), supports)
    do s = 1, size(supports)
      call check(.not. any(supports(s)%column), "without a load nothing supports")
    end do
    ! contacts that are open and carry nothing are no way
    do s = 1, size(ways)
      associate (sub => sim%problem%sub(s))
        sub%gap(:) = 0.5_dp
        sub%hot(:, sim%problem%nd + 1, :) = 0.5_dp
      end associate
    end do
    call list_closed(sim%problem, ways)
    call check_equal(sum(ways%n_closed), 0, "open contacts are not closed")
    do s = 1, size(ways)
      call check(all(ways(s)%length >= unreached), "and lead nowhere")
      sim%problem%sub(s)%impulse(1, 1, :) = 1.0_dp
    end do
    call list_closed(sim%problem, ways)
    do s = 1, size(ways)
      call check_equal(ways(s)%n_closed, size(sim%problem%sub(s)%hot, 3), "contacts that press are")
    end do
    call sim%free()
  end subroutine check_ways

  !> Number of the upper disk of contact `c` of a column.
  pure integer function upper_of(sub, c) result(upper)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    integer :: k

    upper = 0
    do k = 1, 2
      if (sub%pair(k, c) <= sub%n_grains) upper = max(upper, int(sub%id(sub%pair(k, c))))
    end do
  end function upper_of

  !> With powers r . w = 0.65 0.1 l r in the contacts of level l, level l sinks by 0.1 l against the one below, and disk k by
  !> 0.05 k (k + 1).
  subroutine check_levels(subdomains)
    integer, intent(in) :: subdomains
    integer, parameter :: n = 4
    type(simulation_t) :: sim
    type(levels_t) :: levels
    real(dp) :: r, sinks(n)
    integer :: s, c, l

    call make_column(n, subdomains, "&solver method = 'nscdd' /", sim)
    call levels%start(sim%problem)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        allocate (levels%part(s)%power(lanes, n_blocks(sub%n_contacts)), source=0.0_dp)
        do c = 1, sub%n_contacts
          ! the upper one of its disks
          l = upper_of(sub, c)
          r = real(n + 1 - l, dp)
          sub%impulse(lane_of(c), 1, block_of(c)) = r
          levels%part(s)%power(lane_of(c), block_of(c)) = 0.65_dp*0.1_dp*l*r
        end do
      end associate
    end do
    do l = 1, n
      sinks(l) = 0.05_dp*l*(l + 1)
    end do
    call levels%add(sim%problem, real(n, dp), 1.0_dp)
    call check_equal(levels%most_depth, n, "depth of the column")
    call check_close(levels%fastest, sinks(n), rounding, "how fast the top sinks")
    call check_close(levels%error, sqrt(sum(sinks**2)/n), rounding, "mean by mass")
    ! each of the n levels may sink by the largest violation over the mean cosine
    call check_close(levels%fastest_body, n/0.65_dp, rounding, "bound on how fast a disk sinks")
    call check_close(levels%mean_of_bodies, n/0.65_dp, rounding, "bound on the mean over disks")
    call levels%follow(sim%problem, 1.0_dp)
    call check_close(levels%fastest_body, sinks(n), rounding, "how fast the top disk sinks")
    call check_close(levels%mean_of_bodies, sqrt(sum(sinks**2)/n), rounding, "mean over disks")
    ! no contact violates its law by more than 0.05
    call levels%follow(sim%problem, 0.05_dp)
    call check_close(levels%fastest_body, n*0.05_dp/0.65_dp, rounding, "powers beyond the largest violation are cut")
    call levels%forget()
    call check_close(levels%error + levels%fastest, 0.0_dp, 0.0_dp, "nothing is known any more")
    call sim%free()
  end subroutine check_levels

  !> Without a load nothing supports a column under a lid that forces move: depths are then counted from the floor alone, which
  !> moves as prescribed, up to the lid.
  subroutine check_depths(subdomains)
    integer, intent(in) :: subdomains
    integer, parameter :: n = 4
    type(simulation_t) :: sim
    type(levels_t) :: levels
    integer :: s, b

    call make_column(n, subdomains, "&boundary shape = 'plane', point = 0, 8, normal = 0, -1, free(2) = .true., mass = 1 /"// &
      & newline//"&solver method = 'nscdd' /", sim)
    sim%problem%load(:) = 0.0_dp
    call levels%start(sim%problem)
    call levels%find_depth(sim%problem)
    call check_equal(levels%most_depth, n + 1, "the lid is the deepest")
    do s = 1, size(sim%problem%sub)
      do b = 1, sim%problem%sub(s)%n_grains
        call check_equal(levels%part(s)%depth(b), int(sim%problem%sub(s)%id(b)), "depth of a disk")
      end do
    end do
    call sim%free()
  end subroutine check_depths

  !> A pass over layers brings a cold column near its impulses; it does nothing where the way is too short, and is given up in a
  !> layer that converges slowly.
  subroutine check_layers()
    integer, parameter :: n = 40
    type(simulation_t) :: sim
    type(work_t) :: work
    real(dp) :: sweeps, of_one_layer, worst
    logical :: carried
    integer :: s, b, c, l

    call make_column(n, 3, "&solver method = 'nscdd' /", sim)
    call carry_loads(sim%problem, 60.0_dp, work, sweeps, carried)
    call check_close(sweeps, 0.0_dp, 0.0_dp, "a way that is too short")
    call check(.not. (carried .or. sim%problem%any_impulse()), "leaves impulses as they are")
    call carry_loads(sim%problem, 10.0_dp, work, sweeps, carried)
    call check(sweeps > 0.0_dp .and. carried, "a pass")
    call check_work(sim%problem, work, sweeps)
    worst = 0.0_dp
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          l = upper_of(sub, c)
          worst = max(worst, abs(sub%impulse(lane_of(c), 1, block_of(c)) - real(n + 1 - l, dp))/(n + 1 - l))
        end do
      end associate
    end do
    worst = comm%highest(worst)
    ! each of seven layers ends at changes of 9e-4 a sweep, of which some tens are still to come
    call check(worst < 0.15_dp, "brings loads down to the floor")
    call sim%free()
    ! a heavy disk on light ones, whose impulses sweeps find slowly
    call make_column(n, 3, "&solver method = 'nscdd' /", sim)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do b = 1, sub%n_grains
          if (int(sub%id(b)) == n) sub%inverse_mass(:, b) = 1.0e-3_dp*sub%inverse_mass(:, b)
        end do
      end associate
    end do
    call carry_loads(sim%problem, 10.0_dp, work, of_one_layer, carried)
    call check(of_one_layer > 0.0_dp .and. of_one_layer < sweeps .and. .not. carried, "a pass that is given up")
    call check_work(sim%problem, work, sweeps + of_one_layer)
    call sim%free()
  end subroutine check_layers

  !> Relaxations of passes, over all ranks: those of their sweeps over all contacts.
  subroutine check_work(problem, work, sweeps)
    type(contact_problem_t), intent(in) :: problem
    type(work_t), intent(in) :: work
    real(dp), intent(in) :: sweeps
    integer(i8) :: relaxations(1)

    relaxations(1) = work%relaxations
    call comm%sum_counts(relaxations)
    call check_equal(relaxations(1), nint(sweeps*problem%n_contacts, i8), "relaxations of passes")
  end subroutine check_work

  !> A pass may be tried first where the residual at the start is large and there is a load.
  subroutine check_layer_trial()
    type(simulation_t) :: sim
    type(layer_trial_t) :: trial

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    call trial%start(sim%problem, 0.5_dp, 0.01_dp)
    call check(trial%calls(copies_ready), "a check to try a pass")
    call check(.not. trial%calls(copies_ready + 1), "and no other one")
    call trial%start(sim%problem, 0.05_dp, 0.01_dp)
    call check(.not. trial%calls(copies_ready), "none near the solution")
    sim%problem%load(:) = 0.0_dp
    call trial%start(sim%problem, 0.5_dp, 0.01_dp)
    call check(.not. trial%calls(copies_ready), "none without a load")
    call check(.not. trial%layered, "nothing was tried")
    call sim%free()
  end subroutine check_layer_trial

  !> Sums of an iteration that has moved impulses by a part `change` of them.
  subroutine set_progress(problem, change)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: change
    integer :: s

    if (.not. allocated(problem%progress)) allocate (problem%progress(2, size(problem%sub)))
    problem%progress(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      if (problem%sub(s)%subdomain == 1) then
        problem%progress(1, s) = change**2
        problem%progress(2, s) = 1.0_dp
      end if
    end do
    problem%progress_is_summed = .false.
  end subroutine set_progress

  !> Checks come with check_every; where the schedule chooses, those are left out whose expected figure, the ratio at the last check
  !> times the changes of the sweeps, is beyond 1.2 times the goal, nine in a row at most.
  subroutine test_schedule(chooses)
    logical, intent(in) :: chooses
    type(simulation_t) :: sim
    type(check_schedule_t) :: schedule
    type(nlgs_t) :: method
    integer :: iteration, made

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    schedule%check_every = 10
    schedule%chooses = chooses
    method%acceleration%on = .false.
    call check_equal(schedule%first_check(method), 10, "the first check of plain sweeps")
    call set_progress(sim%problem, 1.0e-2_dp)
    call check(.not. calls(schedule, sim%problem, method, 9), "no check before it is due")
    call check(calls(schedule, sim%problem, method, 10), "the first one is made")
    call schedule%note_check(10, 0.05_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    ! the ratio is 5 from here on
    call set_progress(sim%problem, 2.3e-4_dp)
    call check(calls(schedule, sim%problem, method, 20), "1.15 times the goal is expected")
    call set_progress(sim%problem, 2.5e-4_dp)
    call check(calls(schedule, sim%problem, method, 30) .neqv. chooses, "1.25 times the goal is expected")
    made = 0
    do iteration = 40, 160, 10
      if (calls(schedule, sim%problem, method, iteration)) made = made + 1
      if (made == 1 .and. chooses) exit
    end do
    call check_equal(iteration, merge(120, 170, chooses), "nine checks in a row are left out, and no tenth")
    call schedule%forget_ratio()
    call check(calls(schedule, sim%problem, method, 200), "without a ratio a check is made")
    method%acceleration%on = .true.
    call set_progress(sim%problem, 1.0e-2_dp)
    call check(calls(schedule, sim%problem, method, 210), "and so with momentum")
    ! the figure has fallen, the ratio is 4, and no pause is longer than 0.06 of the iterations made
    call schedule%note_check(210, 0.04_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    call set_progress(sim%problem, 2.0e-4_dp)
    call check(.not. calls(schedule, sim%problem, method, 223), "0.8 times the goal is expected, but too soon")
    call check(calls(schedule, sim%problem, method, 225) .eqv. chooses, "and late enough")
    call check_equal(schedule%first_check(method), merge(2, 10, chooses), "the first check of sweeps with momentum")
    call sim%free()
  end subroutine test_schedule

  !> Checks that ask for the estimate: none before it is trusted, unless what is nearly at rest may end the solve, then none
  !> within the root of 1.5 times the iterations made.
  subroutine test_schedule_of_estimates()
    type(simulation_t) :: sim
    type(check_schedule_t) :: schedule
    type(nlgs_t) :: method
    integer :: iteration

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    method%acceleration%on = .true.
    schedule%chooses = .true.
    schedule%by_estimate = .true.
    schedule%trusted = 4
    call set_progress(sim%problem, 1.0e-4_dp)
    call schedule%note_check(0, 2.9e-3_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    call check(calls(schedule, sim%problem, method, 2), "nearly at rest: a check before the estimate is trusted")
    call schedule%note_check(0, 3.1e-3_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    call check(.not. calls(schedule, sim%problem, method, 3), "far from rest: none before it is trusted")
    call check(calls(schedule, sim%problem, method, 4), "the first when it is trusted")
    call set_progress(sim%problem, 1.0_dp)
    call schedule%take_ratio(10.0_dp)
    call schedule%note_check(4, 2.0_dp, 1.0e-3_dp, is_known=.true., believed_from=7)
    call check_close(schedule%mean_ratio(0.0_dp), 10.0_dp, 0.0_dp, "what is not believed tells nothing of what follows")
    call check(.not. calls(schedule, sim%problem, method, 6), "far from the goal, no check")
    call check(calls(schedule, sim%problem, method, 7), "the first when the estimate is believed")
    ! the ratio is 15 from here on
    call schedule%note_check(4, 1.5e-3_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    call set_progress(sim%problem, 6.0e-5_dp)
    call check(.not. calls(schedule, sim%problem, method, 7), "0.9 times the goal is expected, but too soon")
    call check(calls(schedule, sim%problem, method, 8), "and late enough")
    call schedule%note_check(40, 9.0e-4_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    do iteration = 41, 60
      if (calls(schedule, sim%problem, method, iteration)) exit
    end do
    call check_equal(iteration, 49, "the root of 1.5 times the iterations made")
    call test_ratio_of_before(sim%problem, method)
    call sim%free()
  end subroutine test_schedule_of_estimates

  !> A solve that knows the ratio by which the last one ended, 10: no check where it does not expect the goal, but for regular ones,
  !> of which one is left out, or three far from the goal by a ratio of its own; one as soon as it expects the goal.
  subroutine test_ratio_of_before(problem, method)
    type(contact_problem_t), intent(inout) :: problem
    type(nlgs_t), intent(in) :: method
    type(check_schedule_t) :: schedule

    schedule%chooses = .true.
    schedule%by_estimate = .true.
    schedule%trusted = 4
    schedule%settled = .true.
    call schedule%note_check(0, 1.0_dp, 1.0e-3_dp, is_known=.false., believed_from=0)
    ! by half of this, 50 times the goal is expected
    call set_progress(problem, 1.0e-1_dp)
    call check(calls(schedule, problem, method, 4), "a settled scene is checked as soon as the estimate is trusted")
    call schedule%take_ratio(10.0_dp)
    call set_progress(problem, 1.4e-4_dp)
    call check_equal(first_call(schedule, problem, method), 20, "1.4 times the goal is expected: the second regular check")
    call set_progress(problem, 0.9e-4_dp)
    call check_equal(first_call(schedule, problem, method), 4, "the goal is expected")
    call schedule%note_check(4, 1.0_dp, 1.0e-3_dp, is_known=.false., believed_from=0)
    call check_close(schedule%mean_ratio(0.0_dp), 10.0_dp, 0.0_dp, "a bound tells less than the solve before")
    call schedule%note_check(4, 1.8e-3_dp, 1.0e-3_dp, is_known=.true., believed_from=0)
    call check_close(schedule%mean_ratio(0.0_dp), 20.0_dp, 1.0e-12_dp, "an estimate tells more")
    call check_close(schedule%mean_ratio(5.0_dp), 10.0_dp, 1.0e-12_dp, "what is left to the next solve is a mean")
    call set_progress(problem, 0.7e-4_dp)
    call check_equal(first_call(schedule, problem, method), 30, "1.4 times the goal is expected: the second regular check since")
    call set_progress(problem, 0.8e-4_dp)
    call check_equal(first_call(schedule, problem, method), 50, "1.6 times the goal is expected: the fourth since")
  end subroutine test_ratio_of_before

  !> The first iteration after which a schedule calls for a check, with the goal 1e-3.
  integer function first_call(schedule, problem, method)
    type(check_schedule_t), intent(inout) :: schedule
    type(contact_problem_t), intent(inout) :: problem
    type(nlgs_t), intent(in) :: method

    do first_call = 1, 99
      if (calls(schedule, problem, method, first_call)) exit
    end do
  end function first_call

  !> The ratio goes from the solve of one step to that of the next: where one is far too large 20 iterations follow the check that
  !> passes over layers ask for, and the estimate that the next check finds corrects it. A plane that moves along the column
  !> keeps it from rest.
  subroutine test_ratio_of_a_run()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error

    call make_column(4, 2, "&boundary shape = 'plane', point = -1, 0, normal = 1, 0, velocity = 0, 0.3 /"//newline// &
      & "&solver method = 'nscdd', acceleration = 'momentum' /", sim)
    call check_close(sim%figure_ratio, 0.0_dp, 0.0_dp, "none is known at first")
    sim%figure_ratio = 1.0e12_dp
    call sim%advance(figures, error)
    call check(.not. allocated(error), "a step is made")
    call check(figures%solve%iterations >= 24, "none but the check after 4 iterations in the 20 before")
    call check(sim%figure_ratio > 0.0_dp .and. sim%figure_ratio < 1.0e9_dp, "the ratio is that of this solve")
    call sim%free()
    call check_close(sim%figure_ratio, 0.0_dp, 0.0_dp, "another scene knows nothing of it")
  end subroutine test_ratio_of_a_run

  !> A method starts anew where impulses have fallen so far that the roundings of the first are a tenth of the tolerance: to
  !> 64 epsilon/(0.1 1e-2) of them. The count is that of the impulses of then.
  subroutine test_fresh_start()
    real(dp), parameter :: part = 64.0_dp*epsilon(1.0_dp)/1.0e-3_dp
    type(simulation_t) :: sim
    type(fresh_start_t) :: fresh
    type(velocity_error_t) :: velocity
    type(error_t), allocatable :: error
    logical :: anew

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    call velocity%start(sim%problem, 1.0_dp)
    sim%problem%impulse_scale = 2.0_dp
    call fresh%init(sim%problem, 1.0e-2_dp)
    anew = .false.
    sim%problem%impulse_scale = 2.01_dp*part
    call fresh%renew(sim%problem, sim%method, velocity, 5, anew, error)
    call check(.not. anew, "impulses that are not far below the first")
    sim%problem%impulse_scale = 1.99_dp*part
    call fresh%renew(sim%problem, sim%method, velocity, 6, anew, error)
    call check(anew .and. .not. allocated(error), "impulses that are")
    anew = .false.
    call fresh%renew(sim%problem, sim%method, velocity, 7, anew, error)
    call check(.not. anew, "and again only far below those of the start anew")
    call sim%free()
  end subroutine test_fresh_start

  !> Whether a schedule calls for a check after an iteration, with the goal 1e-3.
  logical function calls(schedule, problem, method, iteration)
    type(check_schedule_t), intent(inout) :: schedule
    type(contact_problem_t), intent(inout) :: problem
    type(nlgs_t), intent(in) :: method
    integer, intent(in) :: iteration
    type(convergence_history_t) :: history
    calls = schedule%calls(problem, method, iteration, 1.0e-3_dp, 1.0_dp, history)
  end function calls

  !> A solve has stagnated when waves have run to and fro, six times the depth, and not before; the impulses of a column are not in
  !> vain.
  !> Two groups in a column of ten: the impulses of the contacts below disks 3 and 4 have grown by 1, the upper one slides, and that
  !> below disk 9 by 0.8; all others by so little that they do not count. The impulse below disk 3 changes the velocity of disk 2 by
  !> -1, that below disk 4 that of disk 4 by 1, and disk 3 between them stays.
  subroutine check_creep(subdomains)
    integer, intent(in) :: subdomains
    integer, parameter :: n = 10
    type(simulation_t) :: sim
    type(kept_impulses_t), allocatable :: earlier(:), now(:)
    type(creep_t) :: creep
    integer :: s, c

    call make_column(n, subdomains, "&solver method = 'nscdd' /", sim)
    allocate (earlier(size(sim%problem%sub)), now(size(sim%problem%sub)))
    do s = 1, size(earlier)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          sub%impulse(lane_of(c), 1, block_of(c)) = 10.0_dp
        end do
        earlier(s)%value = sub%impulse
        do c = 1, sub%n_contacts
          associate (r => sub%impulse(lane_of(c), :, block_of(c)))
            select case (upper_of(sub, c))
            case (3)
              r(1) = r(1) + 1.0_dp
            case (4)
              r(1) = r(1) + 1.0_dp
              r(2) = 0.3_dp*r(1)
              earlier(s)%value(lane_of(c), 2, block_of(c)) = r(2)
            case (9)
              r(1) = r(1) + 0.8_dp
            case default
              r(1) = r(1) + 1.0e-3_dp
            end select
          end associate
        end do
        now(s)%value = sub%impulse
      end associate
    end do
    call find_creep(sim%problem, earlier, creep)
    call check(creep%contacts == 3, "contacts that creep")
    call check(creep%stuck == 2, "those of them that stick")
    if (subdomains == 1) then
      call check(creep%group_contacts == 2, "contacts of the largest group")
      call check(creep%group_grains == 3, "its grains")
      call check_close(creep%change, sqrt(2.0_dp/3.0_dp)*(1.0_dp - 1.0e-3_dp), 1.0e-12_dp, "what their velocities change by")
    else
      call check(creep%group_contacts >= 1 .and. creep%group_contacts <= 2, "a group is looked for in each subdomain")
    end if
    do s = 1, size(now)
      call check(all(abs(sim%problem%sub(s)%impulse - now(s)%value) <= 0.0_dp), "impulses stay as they are")
    end do
    call find_creep(sim%problem, now, creep)
    call check(creep%contacts == 0, "nothing changes, nothing creeps")
    call sim%free()
  end subroutine check_creep

  subroutine check_stagnation()
    type(simulation_t) :: sim
    type(stagnation_t) :: stagnation
    type(creep_t) :: creep
    real(dp), parameter :: figures(2) = 1.0_dp
    logical :: due, stagnates, in_vain

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    call stagnation%note(sim%problem, 10, figures, .true., 0.0_dp, due)
    call check(.not. due, "the first figure is a gain")
    call stagnation%note(sim%problem, 5000, figures, .true., 0.0_dp, due)
    call stagnation%judge(sim%problem, 5000, 834, stagnates, in_vain)
    call check(.not. stagnates, "5000 iterations are too few for a depth of 834")
    call stagnation%judge(sim%problem, 5000, 833, stagnates, in_vain)
    call check(stagnates .and. .not. in_vain, "and enough for one of 833")
    call stagnation%describe(sim%problem, creep)
    call check(creep%contacts == 0, "impulses that stay do not creep")
    call sim%free()
  end subroutine check_stagnation

  !> A disk between two planes that close on it: equal impulses from both are in vain, and unequal ones, or those of planes that
  !> open, or that do not come to touch it in the step, are not. Planes that close work against impulses, however unequal, so that
  !> no residual ends a solve.
  subroutine check_vain_impulses()
    type(simulation_t) :: sim
    type(kept_impulses_t), allocatable :: none(:), now(:)
    type(error_t), allocatable :: error
    integer :: s, c, round
    logical :: expected

    do round = 1, 4
      ! gravity is along the planes
      call make_column(1, 1, "&boundary shape = 'plane', point = -1, 0, normal = 1, 0, velocity = "// &
        & trim(merge("-1", " 1", round == 2))//", 0 /"//newline//"&boundary shape = 'plane', point = 1, 0, normal = -1, 0, "// &
        & "velocity = "//trim(merge(" 1", "-1", round == 2))//", 0 /"//newline//"&solver method = 'nscdd' /", sim)
      call sim%method%start(sim%problem, error)
      call check(.not. allocated(error), "start")
      expected = round == 1
      if (allocated(none)) deallocate (none, now)
      allocate (none(size(sim%problem%sub)), now(size(sim%problem%sub)))
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s))
          none(s)%value = 0.0_dp*sub%impulse
          do c = 1, sub%n_contacts
            ! nothing from the floor
            if (abs(sub%hot(lane_of(c), 2, block_of(c))) > 0.5_dp) cycle
            sub%impulse(lane_of(c), 1, block_of(c)) = 1.0e3_dp
            if (round == 4) sub%hot(lane_of(c), 3, block_of(c)) = 2.0_dp
            if (round == 3 .and. sub%hot(lane_of(c), 1, block_of(c)) > 0.0_dp) sub%impulse(lane_of(c), 1, block_of(c)) = 0.0_dp
          end do
        end associate
      end do
      call copy_impulses(sim%problem, now)
      call check_close(speed_against(sim%problem), merge(1.0_dp, 0.0_dp, mod(round, 2) == 1), 1.0e-12_dp, &
        & "speed of the walls against their impulses, less the gap over the step")
      call check(are_in_vain(sim%problem, none) .eqv. expected, "impulses that have grown: have they in vain?")
      call check(.not. are_in_vain(sim%problem, now), "impulses that have not grown are not in vain")
      call check_verdict(sim, 0, merge(residual_waits, residual_ends, mod(round, 2) == 1))
      ! the iteration before had none
      call check_verdict(sim, 1, merge(residual_in_vain, merge(residual_waits, residual_ends, round == 3), round == 1))
      do s = 1, size(now)
        call check(all(abs(sim%problem%sub(s)%impulse - now(s)%value) <= 0.0_dp), "impulses stay as they are")
        sim%problem%sub(s)%impulse(:, :, :) = -1.0_dp
      end do
      call restore_impulses(sim%problem, now)
      do s = 1, size(now)
        call check(all(abs(sim%problem%sub(s)%impulse - now(s)%value) <= 0.0_dp), "impulses that were kept")
      end do
      call sim%free()
    end do
  end subroutine check_vain_impulses

  !> A shift along the tangent, as of tangential restitution, works against the tangential impulse.
  subroutine check_tangential_shift()
    type(simulation_t) :: sim
    real(dp) :: expected
    integer :: s, c

    call make_column(1, 1, "&boundary shape = 'plane', point = -1, 0, normal = 1, 0, tangential_restitution = 0.5 /"//newline// &
      & "&solver method = 'nscdd' /", sim)
    expected = 0.0_dp
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), row => sim%problem%row)
        call check(row%shift_t > 0, "the law has a shift along the tangent")
        do c = 1, sub%n_contacts
          ! nothing from the floor
          if (abs(sub%hot(lane_of(c), 2, block_of(c))) > 0.5_dp) cycle
          sub%impulse(lane_of(c), 1:2, block_of(c)) = [1.0_dp, 0.2_dp]
          sub%hot(lane_of(c), row%shift, block_of(c)) = 0.1_dp
          sub%hot(lane_of(c), row%shift_t, block_of(c)) = -0.8_dp
          expected = 0.06_dp/sqrt(1.04_dp)
        end do
      end associate
    end do
    call check_close(speed_against(sim%problem), comm%highest(expected), 1.0e-12_dp, "speed of a shift along the tangent")
    call sim%free()
  end subroutine check_tangential_shift

  !> The verdict on a residual within its tolerance after some iterations.
  subroutine check_verdict(sim, iterations, expected)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: iterations, expected
    real(dp), parameter :: allowed = 1.0e-2_dp
    type(velocity_error_t) :: velocity
    integer :: verdict

    call velocity%start(sim%problem, allowed)
    call find_residual_verdict(sim%problem, sim%method, velocity, iterations, allowed, verdict)
    ! planes that open have left the disk: nothing that moves is in contact
    if (.not. sim%problem%rest_is_admissible) call check(excess_of(velocity, allowed) > 1.0_dp, "far beyond the accuracy")
    call check_equal(verdict, expected, "verdict after "//to_text(iterations)//" iterations")
    ! planes of 1 m/s work against the impulses
    call find_residual_verdict(sim%problem, sim%method, velocity, iterations, 1.1_dp, verdict)
    call check_equal(verdict, residual_ends, "planes that move within the accuracy are no contradiction")
    call find_residual_verdict(sim%problem, sim%method, velocity, iterations, 1.0e9_dp, verdict)
    call check_equal(verdict, residual_ends, "velocities within the accuracy")
    ! a single contact counts by itself, whatever the estimates for the whole are
    velocity%largest_violation = 2.0_dp*violations_allowed*max(allowed, velocity%criterion())
    call check_close(excess_of(velocity, allowed), velocity%largest_violation/(violations_allowed*allowed), 1.0e-12_dp, &
      & "a contact that violates its law")
    call check_close(excess_of(velocity, 0.0_dp), 0.0_dp, 0.0_dp, "nothing to compare with")
  end subroutine check_verdict

  !> F is 0 where impulses and velocities obey the law, whether contacts are open, or stick, slide, roll and pivot or not; near by,
  !> the step dr = c - L dv leaves of F what is of second order in its distance.
  subroutine check_law(dimension, rolling)
    integer, intent(in) :: dimension
    logical, intent(in) :: rolling
    real(dp), parameter :: alpha = 0.3_dp, away = 1.0e-5_dp
    type(simulation_t) :: sim
    type(proximal_law_t) :: law
    real(dp), allocatable :: v(:, :, :), dv(:, :, :), dr(:, :, :)
    real(dp) :: square, before
    integer :: s, c, q, g, i, nf

    call make_column(6, 1, "&boundary shape = 'plane', normal = "//trim(merge("1, 0   ", "1, 0, 0", dimension == 2))// &
      & ", point = "//trim(merge("-1, 0   ", "-1, 0, 0", dimension == 2))//" /"//newline//"&solver method = 'nscdd' /", sim, &
      & dimension, rolling)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), kernels => sim%problem%kernels, row => sim%problem%row)
        nf = kernels%nf
        call check_equal(parts_of(kernels%nc, kernels%nv), merge(dimension, 1, rolling), "parts that the normal impulse bounds")
        call law%init(kernels, sub)
        allocate (v, dv, dr, mold=sub%impulse)
        v(:, :, :) = 0.0_dp
        dv(:, :, :) = 0.0_dp
        do c = 1, sub%n_contacts
          q = lane_of(c)
          g = block_of(c)
          ! shifts are those of no scene here
          sub%hot(q, row%shift, g) = 0.01_dp*c
          sub%impulse(q, 1, g) = merge(0.0_dp, 1.0_dp + 0.1_dp*c, mod(c, 3) == 0)
          v(q, 1, g) = -sub%hot(q, row%shift, g) + merge(0.5_dp, 0.0_dp, mod(c, 3) == 0)
          call obey(c, sub%hot(q, row%friction, g)*sub%impulse(q, 1, g), sub%impulse(q, 2:nf, g), v(q, 2:nf, g), mod(c, 2) == 0)
          do i = 1, kernels%nc
            dv(q, i, g) = away*(hash_uniform(2, int(c, i8), i) - 0.5_dp)
          end do
          if (.not. rolling) cycle
          call obey(c, sub%hot(q, row%rolling_friction, g)*sub%impulse(q, 1, g), sub%impulse(q, nf + 1:2*nf - 1, g), &
            & v(q, nf + 1:2*nf - 1, g), mod(c, 4) < 2)
          if (dimension == 3) call obey(c, sub%hot(q, row%pivoting_friction, g)*sub%impulse(q, 1, g), sub%impulse(q, 6:6, g), &
            & v(q, 6:6, g), mod(c, 8) < 4)
        end do
        law%centre(:, :, :) = sub%impulse
        call law%evaluate(kernels, sub, v, alpha, square)
        call check_close(sqrt(square), 0.0_dp, rounding, "F of impulses and velocities that obey the law")
        v(:, :, :) = v + dv
        call law%evaluate(kernels, sub, v, alpha, before)
        call check(sqrt(before) > 0.1_dp*away, "F beside them")
        ! velocities go on by as much
        call law%linearise(kernels, sub, alpha)
        call law%find_step(dv, dr)
        sub%impulse(:, :, :) = sub%impulse + dr
        v(:, :, :) = v + dv
        call law%evaluate(kernels, sub, v, alpha, square)
        call check(square <= (1.0e2_dp*away)**2*before, "a step leaves what is of second order")
        deallocate (v, dv, dr)
      end associate
    end do
    call sim%free()
  end subroutine check_law

  !> A part of the impulse of contact `c` within its bound, and no velocity, or at its bound against a velocity.
  subroutine obey(c, bound, impulse, velocity, at_bound)
    integer, intent(in) :: c
    real(dp), intent(in) :: bound
    real(dp), intent(out) :: impulse(:), velocity(:)
    logical, intent(in) :: at_bound
    real(dp) :: way(size(impulse))
    integer :: i

    do i = 1, size(way)
      way(i) = hash_uniform(1, int(c, i8), i) - 0.5_dp
    end do
    way(:) = way/norm2(way)
    impulse(:) = merge(1.0_dp, 0.5_dp, at_bound)*bound*way
    velocity(:) = merge(-0.2_dp, 0.0_dp, at_bound)*way
  end subroutine obey

  !> Newton's method finds the impulses of a column, to a tolerance that sweeps do not reach in so few iterations.
  subroutine check_newton()
    integer, parameter :: n = 100
    type(simulation_t) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    integer :: s, c, l

    call parse_config("column", "&scene bodies = 'column', column_count = 100, gravity = 0, -1, friction = 0.3 /"//newline// &
      & "&time step = 1.0, steps = 1 /"//newline//"&decomposition subdomains = 2 /"//newline// &
      & "&solver method = 'newton', criterion = 'residual', tolerance = 1e-13, max_iterations = 3000, check_every = 1 /", config, &
      & error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "a column for Newton's method")
    if (allocated(error)) return
    select type (method => sim%method)
    type is (newton_t)
      call check(method%sweeps > 0, "the method is Newton's")
    class default
      call check(.false., "the method is Newton's")
    end select
    call sim%advance(figures, error)
    call check(.not. allocated(error), "a step by Newton's method")
    call check(figures%solve%residual <= 1.0e-13_dp, "the residual reaches its tolerance")
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          l = upper_of(sub, c)
          call check_close(sub%impulse(lane_of(c), 1, block_of(c)), real(n + 1 - l, dp), 1.0e-10_dp, "impulse of a column")
        end do
      end associate
    end do
    call sim%free()
  end subroutine check_newton

  !> One disk of 1 kg on a plane, W = 1, with the impulse 0.25 under a load of 1: V = -0.75. With l = 3 and the velocity v that
  !> solved the law, Y = l (v - V)/(1 + l), r~ = 0.25 + l (v - V - Y). Beyond r = 1 the energy rises again: v = 0 gives 0.8125,
  !> v = 2 would give 2.3125 and stops at 1.
  subroutine check_feedback(v, expected)
    real(dp), intent(in) :: v, expected
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(impulse_feedback_t) :: feedback
    type(interface_field_t), allocatable :: multipliers(:)
    type(error_t), allocatable :: error
    logical :: changed
    integer :: s

    call make_column(1, 1, "&solver method = 'nscdd' /", sim)
    matrix%direction%value = 3.0_dp
    matrix%direction%relative = .false.
    matrix%direction%active_only = .true.
    call put_impulse(sim%problem, 0.25_dp)
    call sim%problem%evaluate()
    do s = 1, size(sim%problem%sub)
      call sim%problem%sub(s)%share_masses(sim%problem%kernels, .true.)
    end do
    call matrix%start(sim%problem, error)
    call matrix%update(sim%problem, changed, error)
    call feedback%start(sim%problem)
    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%velocity(:, :) = sim%problem%sub(s)%v_global
      matrix%part(s)%law_velocity(:, :, :) = 0.0_dp
      matrix%part(s)%law_velocity(1, 1, 1) = v
      call matrix%enrich(sim%problem%kernels, sim%problem%sub(s), s, error)
      call feedback%keep_lead(s, matrix)
    end do
    call make_field(sim%problem%shared, multipliers)
    call feedback%take(sim%problem, matrix, multipliers, error)
    call check(.not. allocated(error), "impulses are fed back")
    call check_close(feedback%share, min(1.0_dp, 0.75_dp/(0.75_dp*(0.75_dp + v))), rounding, "part of the way that is taken")
    do s = 1, size(sim%problem%sub)
      call check_close(sim%problem%sub(s)%impulse(1, 1, 1), expected, rounding, "the impulse that is fed back")
      call check_close(sim%problem%sub(s)%velocity(2, 1), expected - 1.0_dp, rounding, "the velocity goes with it")
    end do
    call matrix%free()
    call sim%free()
  end subroutine check_feedback

  !> Three windows of five iterations that grow, the last by more than a factor 2, halve the direction and bring back the impulses
  !> from before the growth; an explosion takes it to a sixteenth at once; giving up takes it to 0.
  subroutine check_guard()
    type(simulation_t) :: sim
    type(direction_guard_t) :: guard
    real(dp) :: change
    integer :: window, i, s
    logical :: lowered

    call make_column(3, 2, "&solver method = 'nscdd' /", sim)
    call put_impulse(sim%problem, 1.0_dp)
    call guard%start(sim%problem)
    call check_close(guard%factor, 1.0_dp, 0.0_dp, "the whole direction at the start")
    change = 1.0e-3_dp
    do window = 1, 4
      do i = 1, 5
        ! the impulses after the first window are those to come back to
        call put_impulse(sim%problem, real(10*window + i, dp))
        call set_progress(sim%problem, change)
        call guard%watch(sim%problem, lowered)
        call check(lowered .eqv. (window == 4 .and. i == 5), "three windows must grow")
      end do
      change = 1.2_dp*change
    end do
    call check_close(guard%factor, 0.5_dp, 0.0_dp, "half of the direction")
    call check_equal(guard%lowered, 1, "lowered once")
    do s = 1, size(sim%problem%sub)
      call check_close(sim%problem%sub(s)%impulse(1, 1, 1), 15.0_dp, 0.0_dp, "impulses from before the growth")
    end do
    call set_progress(sim%problem, 1.0e6_dp)
    call guard%watch(sim%problem, lowered)
    call check(lowered, "an explosion lowers it at once")
    call check_close(guard%factor, 0.5_dp/16.0_dp, 0.0_dp, "to a sixteenth")
    call guard%give_up(sim%problem, lowered)
    call check(lowered .and. guard%factor <= 0.0_dp, "giving up leaves nothing of it")
    call sim%free()
  end subroutine check_guard

  !> Give the first contact of each subdomain an impulse.
  subroutine put_impulse(problem, r)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: r
    integer :: s

    do s = 1, size(problem%sub)
      problem%sub(s)%impulse(1, 1, 1) = r
    end do
  end subroutine put_impulse

  !> What no machine has is refused, on all ranks and with words that say what it is for; a little is not.
  subroutine test_memory_need()
    type(error_t), allocatable :: error

    call check_memory(comm, "a small thing", 1.0e3_dp, 8, error)
    call check(.not. allocated(error), "8 kB are there")
    call check_memory(comm, "a large thing", 1.0e18_dp, 8, error)
    call check(allocated(error), "8e18 bytes are not")
    if (allocated(error)) call check(index(error%message, "a large thing") == 1, "the message says what they are for")
  end subroutine test_memory_need

end program test_solver_parts
