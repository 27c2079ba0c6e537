!> What would halve the time of a run, from phases that are made up: the advice names what takes most, and nothing that is in vain.
program test_run_summary
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_timers, only: n_phases, phase_factorise, phase_interface_solve, phase_neighbourhood, phase_output, phase_sweep, &
    & phase_exchange, phase_check
  use gravier_run_summary, only: halving_text, converged_text, mending_text, verdict_text
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, finish_checks
  implicit none

  character(len=*), parameter :: column = "&scene bodies = 'column', column_count = 3, radius = 0.5, gravity = 0, -10 / "
  !> of a run [s]; costs of looser solves are not known
  real(dp), parameter :: seconds = 10.0_dp, unknown(3) = -1.0_dp
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_output()
  call test_newton()
  call test_waiting()
  call test_plain()
  call test_lists()
  call test_ranks()
  call test_refuted()
  call test_misses()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine test_output()
    type(simulation_t) :: simulation

    call make_scene(comm, column//"&time step = 0.01, steps = 100 / &output every = 10 /", simulation)
    call check(says(simulation, [phase_output], "a larger &output every, now 10"), "output that takes most of the time")
    call check(.not. says(simulation, [phase_neighbourhood], "&output"), "output that takes none of it")
    call check(says(simulation, [phase_neighbourhood], "neighbour lists take most of it: a larger &scene skin, now "), &
      & "neighbour lists that take most of the time")
    call simulation%free()
    call make_scene(comm, column//"&time step = 0.01, steps = 100 / &output every = 100 /", simulation)
    call check(.not. says(simulation, [phase_output], "&output every"), "no state is written but the first and the last")
    call simulation%free()
  end subroutine test_output

  subroutine test_newton()
    type(simulation_t) :: simulation

    call make_scene(comm, column//"&time step = 0.01, steps = 100 /", simulation)
    call check(.not. says(simulation, [phase_factorise, phase_interface_solve], "Newton's method"), "it has taken nothing over")
    simulation%fallback%taken = 1
    call check(says(simulation, [phase_factorise, phase_interface_solve], "Newton's method, which takes over solves that "// &
      & "stagnate"), "solves that it has taken over take most of the time")
    call check(.not. says(simulation, [phase_neighbourhood], "Newton's method"), "they take little of it")
    simulation%physics%laws%yields = .true.
    call check(.not. says(simulation, [phase_factorise, phase_interface_solve], "kind = 'elastic'"), "contacts that yield already")
    call simulation%free()
  end subroutine test_newton

  !> Ranks that wait for the slowest one are named with what evens out their work, as far as it is not in force.
  subroutine test_waiting()
    type(simulation_t) :: simulation
    character(len=*), parameter :: all = "partition = 'metis' and repartition_imbalance = 1.2 divides", waits = "ranks wait for"

    call make_scene(comm, column//"&time step = 0.01, steps = 100 /", simulation)
    call check(says(simulation, [phase_sweep, phase_exchange], all, 1.5_dp), "sweeps of 45 %, half of which more on one rank")
    call check(says(simulation, [phase_sweep, phase_exchange], " in 23 % of the time", 1.5_dp), "how long they wait")
    call check(.not. says(simulation, [phase_sweep, phase_exchange], waits, 1.4_dp), "they wait a little")
    call check(.not. says(simulation, [phase_output], waits, 2.0_dp), "sweeps take nothing")
    simulation%config%decomposition%repartition_imbalance = 1.5_dp
    call check(says(simulation, [phase_sweep], "&decomposition partition = 'metis' divides", 2.0_dp), "boxes that are made anew")
    simulation%config%decomposition%partition = "metis"
    call check(.not. says(simulation, [phase_sweep], waits, 2.0_dp), "nothing else is known to help")
    simulation%config%decomposition%repartition_imbalance = 0.0_dp
    call check(says(simulation, [phase_sweep], "&decomposition repartition_imbalance = 1.2 divides", 2.0_dp), "cells that stay")
    call simulation%free()
  end subroutine test_waiting

  !> Acceleration is advised where plain iterations are many and take most of the time, but not where they diverged, or where it is
  !> not to be had.
  subroutine test_plain()
    type(simulation_t) :: simulation
    character(len=*), parameter :: words = "plain iterations take most of it, 60 a solve: &solver acceleration = 'momentum'"

    call make_scene(comm, column//"&time step = 0.01, steps = 100 / &solver method = 'schwarz' /", simulation)
    simulation%effort%solves = 10
    simulation%effort%iterations = 600
    call check(says(simulation, [phase_sweep, phase_check], words), "many plain iterations")
    call check(.not. says(simulation, [phase_output], words), "they take nothing")
    simulation%config%solver%relaxation_given = .true.
    call check(.not. says(simulation, [phase_sweep], words), "a relaxation that is given")
    simulation%config%solver%relaxation_given = .false.
    simulation%tally%diverged = 1
    call check(.not. says(simulation, [phase_sweep], words), "solves that diverged")
    simulation%tally%diverged = 0
    simulation%config%solver%acceleration = "momentum"
    call check(.not. says(simulation, [phase_sweep], words), "they are accelerated")
    simulation%config%solver%acceleration = "none"
    simulation%config%solver%method = "newton"
    call check(.not. says(simulation, [phase_sweep], words), "a method without sweeps")
    simulation%config%solver%method = "nlgs"
    call check(says(simulation, [phase_sweep], words), "a method that has it by default")
    simulation%effort%iterations = 400
    call check(.not. says(simulation, [phase_sweep], words), "few iterations")
    call simulation%free()
  end subroutine test_plain

  !> Lists that are made in most steps and take a part of the time are named before more ranks.
  subroutine test_lists()
    type(simulation_t) :: simulation
    integer, parameter :: shared(4) = [phase_neighbourhood, phase_output, phase_sweep, phase_check]
    character(len=*), parameter :: words = "no change of one key suffices; neighbour lists, built in 51 of 100 steps, take "// &
      & "23 %: a larger &scene skin, now 7.00E-02 m, lets them last longer"

    call make_scene(comm, column//"&time step = 0.01, steps = 100 /", simulation)
    simulation%decomposition%rule%skin = 0.07_dp
    simulation%tally%steps = 100
    simulation%halo%builds = 51
    allocate (simulation%problem%sub(1))
    call check(says(simulation, shared, words), "lists of most steps")
    simulation%problem%sub(1)%n_contacts = 10000
    call check(says(simulation, shared, words), "lists of most steps, where more ranks would pay")
    call check(.not. says(simulation, [phase_neighbourhood, phase_output, phase_sweep, phase_check, phase_exchange], "skin"), &
      & "they take less than a fifth")
    simulation%halo%builds = 50
    call check(.not. says(simulation, shared, "skin"), "lists of every other step")
    call simulation%free()
  end subroutine test_lists

  !> More ranks are advised with subdomains, where the method has them, or with another method.
  subroutine test_ranks()
    type(simulation_t) :: simulation
    character(len=*), parameter :: words = "twice the ranks, now 1, with as many &decomposition subdomains or more, now 1", &
      & another = ", by a &solver method that has subdomains, such as 'nscdd'"

    call make_scene(comm, column//"&time step = 0.01, steps = 100 /", simulation)
    allocate (simulation%problem%sub(1))
    simulation%problem%sub(1)%n_contacts = 10000
    call check(says(simulation, [phase_sweep, phase_output], words//another), "a method of one domain")
    simulation%config%solver%method = "schwarz"
    simulation%config%solver%acceleration = "momentum"
    call check(says(simulation, [phase_sweep, phase_output], words), "a method of subdomains")
    call check(.not. says(simulation, [phase_sweep, phase_output], another), "it has them already")
    simulation%problem%sub(1)%n_contacts = 1000
    call check(.not. says(simulation, [phase_sweep, phase_output], words), "few contacts")
    call simulation%free()
  end subroutine test_ranks

  !> Solves that reached the accuracy by their estimates, of which spot checks have found too many wrong: the run has not converged.
  subroutine test_refuted()
    type(simulation_t) :: simulation

    call make_scene(comm, column//"&time step = 0.01, steps = 2 /", simulation)
    simulation%step = 2
    simulation%tally%steps = 2
    simulation%spot_checks%reached = 4
    simulation%spot_checks%beyond = 1
    call check(index(converged_text(simulation), "yes") == 1, "one of four says nothing")
    simulation%spot_checks%beyond = 2
    call check(index(converged_text(simulation), "NO: 2 of 4 solves that spot checks continued were off by more than twice the "// &
      & "accuracy 1.00E-01, though all reached it by their estimates") == 1, "two of four")
    call check(index(verdict_text(simulation), "*** 2 of 4 solves that spot checks continued") == 1, "the last words")
    call check(index(mending_text(simulation), "a smaller &solver accuracy") == 1, "what mends it")
    simulation%failed = 1
    simulation%tally%stagnated = 1
    call check(index(mending_text(simulation), "a smaller &solver accuracy") == 0, "not where solves missed it")
    call simulation%free()
  end subroutine test_refuted

  !> Solves that missed the accuracy by little have estimates of their errors, which the last words give; those without a solution,
  !> and those far from it, have none.
  subroutine test_misses()
    type(simulation_t) :: simulation
    character(len=*), parameter :: begin = " of the steps did NOT reach the accuracy: "
    character(len=:), allocatable :: expected
    integer :: round

    call make_scene(comm, column//"&time step = 0.01, steps = 2 /", simulation)
    simulation%step = 2
    simulation%tally%steps = 2
    do round = 1, 4
      simulation%failed = merge(2, 1, round == 4)
      simulation%tally%stagnated = merge(0, 1, round == 2)
      simulation%tally%unbounded = merge(1, 0, round == 2)
      simulation%tally%worst_error = merge(0.6_dp, 0.176_dp, round == 3)
      expected = "*** "//merge("2", "1", round == 4)//begin
      if (round == 1) then
        expected = expected//"by the estimates of their errors velocities were wrong by up to 0.18 times the velocity scale U"
      else
        expected = expected//"the accuracy of the results is not known"
      end if
      call check(index(verdict_text(simulation), expected) == 1, "the last words")
    end do
    ! most ended at max_iterations, and one found no solution
    simulation%tally%stagnated = 0
    simulation%tally%exhausted = 3
    do round = 0, 1
      simulation%tally%unbounded = round
      call check((index(mending_text(simulation), "more room") > 0) .eqv. round == 1, "more room where a solve has no solution")
    end do
    ! momentum may let solves diverge
    simulation%tally%unbounded = 0
    simulation%tally%diverged = 4
    do round = 0, 1
      simulation%config%solver%acceleration = trim(merge("none    ", "momentum", round == 0))
      call check((index(mending_text(simulation), "acceleration = 'none'") > 0) .eqv. round == 1, &
        & "no momentum where solves diverge")
    end do
    simulation%tally%diverged = 0
    ! all solves have stagnated, and no other method is left: a smaller step is offered, but not with rolling resistance
    simulation%tally%stagnated = 4
    simulation%tally%exhausted = 0
    simulation%tally%unbounded = 0
    simulation%config%solver%method = "newton"
    simulation%fallback%taken = simulation%tally%stagnated
    simulation%fallback%solved = 0
    do round = 0, 1
      simulation%effects%rolling = round == 1
      call check((index(mending_text(simulation), "smaller &time step") > 0) .eqv. round == 0, "a smaller step but with rolling")
      call check(index(mending_text(simulation), "contacts that yield") > 0, "contacts that yield where solves stagnate")
    end do
    ! Newton's method has failed as the second one: it is not offered as the first
    simulation%config%solver%method = "nlgs"
    call check(index(mending_text(simulation), "newton") == 0, "a method that has failed is not offered")
    call simulation%free()
  end subroutine test_misses

  !> Whether the advice has some words where these phases together take nine tenths of the time.
  logical function says(simulation, dear, words, slowest)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: dear(:)
    character(len=*), intent(in) :: words
    !> seconds of the slowest rank over the mean; 1 where absent
    real(dp), intent(in), optional :: slowest
    real(dp) :: phases(n_phases), ratio

    phases(:) = 0.0_dp
    phases(dear) = 0.9_dp*seconds/size(dear)
    ratio = 1.0_dp
    if (present(slowest)) ratio = slowest
    says = index(halving_text(simulation, phases, seconds, unknown, ratio), words) > 0
  end function says

end program test_run_summary
