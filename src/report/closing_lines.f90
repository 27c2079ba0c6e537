!> What the log of a run ends with: times by phase, the work of the solver, energies and costs, and a summary in words.
module gravier_closing_lines
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, times_text, counted
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: gather_timers, phase_names, n_phases
  use gravier_method, only: work_t
  use gravier_convergence_history, only: effort_t, tenfold
  use gravier_energy_balance, only: energy_balance_t
  use gravier_simulation, only: simulation_t
  use gravier_memory_report, only: peak_memory
  use gravier_run_summary, only: converged_text, mending_text, time_text, halving_text
  use gravier_accuracy_lines, only: goal_name, goal_text
  use gravier_step_lines, only: balance_text
  implicit none
  private
  public :: phase_lines, work_lines, cost_lines, summary_lines

  character(len=*), parameter :: newline = new_line("a")
  !> spot checks that are enough to tell what a tenth of the error takes
  integer, parameter :: enough_checks = 4

contains

  !> Table of the times by phase over the ranks, and the mean times. Collective.
  function phase_lines(comm, seconds, mean) result(text)
    type(communicator_t), intent(in) :: comm
    !> wall time of the run [s]
    real(dp), intent(in) :: seconds
    !> over the ranks [s]
    real(dp), intent(out) :: mean(n_phases)
    character(len=:), allocatable :: text
    real(dp) :: least(n_phases), most(n_phases)
    character(len=100) :: row
    integer :: p

    call gather_timers(comm, mean, least, most)
    text = "phase                         mean [s]     min [s]     max [s]  of run"//newline
    do p = 1, n_phases
      write (row, "(a28,3f12.4,f7.1,' %')") phase_names(p), mean(p), least(p), most(p), 100.0_dp*mean(p)/max(seconds, tiny(seconds))
      text = text//trim(row)//newline
    end do
    write (row, "(a28,f12.4)") "whole run                   ", seconds
    text = text//trim(row)//newline
  end function phase_lines

  !> What the solver did, and what it took of memory and messages. Collective.
  function work_lines(comm, simulation) result(text)
    type(communicator_t), intent(in) :: comm
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    type(work_t) :: work, more
    integer(i8) :: counts(5)
    real(dp) :: ranks, subdomains

    work = simulation%method%work_done()
    if (allocated(simulation%fallback%method)) then
      more = simulation%fallback%method%work_done()
      call work%add(more)
    end if
    counts(1) = work%relaxations
    counts(2) = work%analyses
    counts(3) = work%factorisations
    counts(4) = simulation%messages
    counts(5) = simulation%values
    call comm%sum_counts(counts)
    text = "solver      "//counted(work%solves, "solve")//", "//counted(work%iterations, "iteration")//", "// &
      & counted(work%sweeps, "sweep")//", "//counted(counts(1), "contact relaxation")//newline// &
      & "interface   "//to_text(work%interface_solves)//" exchanges between subdomains or solves of the interface, "// &
      & to_text(work%interface_iterations)//" iterations of conjugate gradients; matrices of subdomains: "//to_text(counts(2))// &
      & " analyses, "//to_text(counts(3))//" factorisations"//newline
    if (simulation%fallback%taken > 0) text = text//"fallback    "//fallback_text(simulation)//newline
    if (simulation%config%solver%sleeping) text = text//"sleeping    "//to_text(simulation%tally%slept)// &
      & " contacts of bodies asleep were left out, summed over all steps; "// &
      & counted(simulation%tally%woken, "further solve")//" because bodies woke"//newline
    if (simulation%method%direction_text /= "") text = text//"direction   "//simulation%method%direction_text//"; "// &
      & counted(work%lowered, "reduction")//" of l"//newline
    if (work%restarted + work%suspended > 0) text = text//"nesterov    "// &
      & counted(work%restarted, "restart")//" and "//counted(work%suspended, "suspension")//" of the momentum"//newline
    if (work%relaxed > 0) text = text//"relaxation  factor lowered "//times_text(work%relaxed)//", to no less than "// &
      & to_text(work%least_factor, 3)//newline
    if (simulation%decomposition%n_subdomains > 1) then
      call simulation%method%measure_balance(comm, simulation%decomposition%n_subdomains, ranks, subdomains)
      text = text//"balance     "//balance_text(ranks, subdomains)//", since the last partition"//newline
    end if
    text = text//"lists       of neighbours built "//times_text(int(simulation%halo%builds, i8))//newline// &
      & "memory      at most "//to_text(nint(comm%highest(peak_memory())))//" MiB on a rank"//newline// &
      & "messages    "//to_text(counts(4))//" between ranks, "//to_text(8*counts(5)/1024)//" KiB"//newline
  end function work_lines

  !> What the second method did.
  function fallback_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (fallback => simulation%fallback)
      text = "method '"//trim(simulation%config%solver%fallback)//"' took over "//counted(fallback%taken, "solve")// &
        & " that missed the "//goal_name(simulation)//", "//to_text(fallback%solved)//" of which then reached it, in "// &
        & counted(fallback%iterations, "iteration")
      if (fallback%passed_over > 0) text = text//"; "//counted(fallback%passed_over, "further one")// &
        & " it left alone, because too many before were in vain"
    end associate
  end function fallback_text

  !> How far energies balance, what the solves took, and what they would have taken with other tolerances. Collective.
  function cost_lines(comm, simulation) result(text)
    type(communicator_t), intent(in) :: comm
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: least, most

    associate (effort => simulation%effort)
      text = "energy      "//energy_text(simulation)//newline// &
        & "cost        "//to_text(comm%highest(effort%seconds), 3)//" s in "//counted(effort%solves, "solve")//" with "// &
        & counted(effort%iterations, "iteration")//" in all"//newline
      if (effort%iterations == 0) return
      if (simulation%refinement%refined > 0) then
        text = text//"            at another "//goal_name(simulation)//": not known, because solves aimed at less error"//newline
        return
      end if
      call effort%looser_range(least, most)
      text = text//"            at "//goal_text(simulation, 10.0_dp)//": "//estimate_text(comm, effort, least, most)
      if (effort%unreached(tenfold) > 0) text = text//": "//counted(effort%unreached(tenfold), "solve")//" did not reach it"
      text = text//newline//"            at "//goal_text(simulation, 0.1_dp)//": "
      if (simulation%spot_checks%made >= enough_checks) then
        text = text//checked_text(comm, simulation)//newline
        return
      end if
      call effort%tighter_range(least, most)
      text = text//estimate_text(comm, effort, least, most)
      if (simulation%failed > 0) then
        text = text//": "//counted(int(simulation%failed, i8), "solve")//" did not reach the "//goal_name(simulation)//" itself"
      else if (least < 0.0_dp) then
        text = text//": the solves ended too soon to show how errors decrease"
      else
        text = text//", if solves reach it"
      end if
      text = text//newline
    end associate
  end function cost_lines

  !> How far energies balance: of the whole scene where its terms are measured, else of the grains.
  function energy_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: off, turnover
    integer :: place

    off = simulation%balance%error()
    turnover = simulation%balance%turnover()
    place = simulation%diagnostics%place("energy")
    if (place > 0) then
      select type (energy => simulation%diagnostics%asked(place)%diagnostic)
      type is (energy_balance_t)
        off = energy%error()
        turnover = energy%turnover()
      end select
    end if
    text = "balance off by "//to_text(abs(off), 2)//" J; the sizes of its terms sum up to "//to_text(turnover, 3)//" J"
  end function energy_text

  !> What so many iterations would have taken. Collective.
  function estimate_text(comm, effort, least, most) result(text)
    type(communicator_t), intent(in) :: comm
    type(effort_t), intent(in) :: effort
    real(dp), intent(in) :: least, most
    character(len=:), allocatable :: text
    real(dp) :: seconds(2)

    text = "not known"
    if (least < 0.0_dp) return
    seconds(1) = comm%highest(effort%seconds_of(least))
    seconds(2) = comm%highest(effort%seconds_of(most))
    text = to_text(nint(least, i8))//" to "//to_text(nint(most, i8))//" iterations, "//to_text(seconds(1), 2)//" to "// &
      & to_text(seconds(2), 2)//" s (estimated)"
  end function estimate_text

  !> What a tenth of the error would have taken, by the solves that were continued to it. Collective.
  function checked_text(comm, simulation) result(text)
    type(communicator_t), intent(in) :: comm
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: iterations

    associate (checks => simulation%spot_checks, effort => simulation%effort)
      iterations = checks%times()*real(effort%iterations, dp)
      text = "about "//to_text(iterations, 2)//" iterations, "//to_text(comm%highest(effort%seconds_of(iterations)), 2)// &
        & " s, by "//counted(checks%made, "solve")//" continued to it"
      if (effort%often_idle()) then
        text = "at most "//text//": "//to_text(nint(100.0_dp*real(effort%idle, dp)/real(effort%solves, dp)))// &
          & " % of the solves needed no iteration, and solves of a run at that goal start from better impulses"
      else if (checks%reached < checks%made) then
        text = text//", or more: "//counted(checks%made - checks%reached, "check")// &
          & trim(merge(" was ", " were", checks%made - checks%reached == 1))//" given up"
      end if
    end associate
  end function checked_text

  !> In words, for a person: convergence and time; nothing of a run without a solve. Collective.
  function summary_lines(comm, simulation, phases, seconds) result(text)
    type(communicator_t), intent(in) :: comm
    type(simulation_t), intent(in) :: simulation
    !> (n_phases), mean over the ranks, and of the run [s]
    real(dp), intent(in) :: phases(n_phases), seconds
    character(len=:), allocatable :: text
    real(dp) :: iterations(3), looser_seconds(3), slowest, subdomains
    integer :: k

    text = ""
    iterations(1) = simulation%effort%looser()
    call simulation%effort%looser_range(iterations(2), iterations(3))
    do k = 1, size(iterations)
      looser_seconds(k) = comm%highest(simulation%effort%seconds_of(iterations(k)))
    end do
    slowest = 1.0_dp
    if (simulation%decomposition%n_subdomains > 1) &
      & call simulation%method%measure_balance(comm, simulation%decomposition%n_subdomains, slowest, subdomains)
    if (simulation%effort%solves == 0) return
    text = "converged   "//converged_text(simulation)//newline
    if (simulation%failed > 0 .or. simulation%spot_checks%refute()) text = text//"to mend it  "//mending_text(simulation)//newline
    text = text//"time        "//time_text(phases, seconds, simulation%effort%solves)//newline// &
      & "to halve it "//halving_text(simulation, phases, seconds, looser_seconds, slowest)//newline
  end function summary_lines

end module gravier_closing_lines
