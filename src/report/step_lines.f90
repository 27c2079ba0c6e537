!> What the log of a run says of a step: its contacts and interface, how unevenly its sweeps took time, and what went wrong.
module gravier_step_lines
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_solve_report, only: solve_report_t, solve_diverged, solve_stagnated, solve_unbounded
  use gravier_interface, only: interface_statistics_t, n_multiplicities
  use gravier_config_types, only: solver_config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  implicit none
  private
  public :: interface_lines, balance_text, failure_text

  character(len=*), parameter :: newline = new_line("a")

contains

  !> Contacts and interface as the partition makes them, in one line or two.
  function interface_lines(figures, subdomains) result(text)
    type(step_figures_t), intent(in) :: figures
    integer, intent(in) :: subdomains
    character(len=:), allocatable :: text, bodies
    integer :: m

    associate (interface_statistics => figures%interface_statistics)
      text = "contacts    "//to_text(figures%contacts)
      if (subdomains == 1) then
        text = text//" in one subdomain, no interface"//newline
        return
      end if
      bodies = ""
      do m = 2, n_multiplicities
        if (interface_statistics%multiplicity(m) == 0) cycle
        bodies = bodies//", "//to_text(interface_statistics%multiplicity(m))//" in "//to_text(m)// &
          & trim(merge(" or more", "        ", m == n_multiplicities))//" subdomains"
      end do
      if (bodies /= "") bodies = " ("//bodies(3:)//")"
      text = text//", "//to_text(interface_statistics%least_contacts)//" to "// &
        & to_text(interface_statistics%most_contacts)//" a subdomain; interface: "//to_text(interface_statistics%bodies)// &
        & " bodies"//bodies//", "//to_text(interface_statistics%interactions)//" interactions"//newline
    end associate
    if (figures%interface_statistics%neighbours > 0) text = text//"exchange    "//exchange_text(figures%interface_statistics, &
      & subdomains)//newline
  end function interface_lines

  !> What an exchange of the interface costs a subdomain, whether its neighbours are on other ranks or on its own.
  function exchange_text(interface_statistics, subdomains) result(text)
    type(interface_statistics_t), intent(in) :: interface_statistics
    integer, intent(in) :: subdomains
    character(len=:), allocatable :: text

    text = "a subdomain sends "//tenths(real(interface_statistics%neighbours, dp)/subdomains)//" messages (at most "// &
      & to_text(interface_statistics%most_neighbours)//") with "//to_text(8*interface_statistics%values/subdomains)// &
      & " bytes (at most "// &
      & to_text(8*interface_statistics%most_values)//") an iteration, and "//to_text(interface_statistics%ghosts/subdomains)// &
      & " ghosts a step"
  end function exchange_text

  !> A number of moderate size with one decimal.
  function tenths(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=16) :: row

    write (row, "(f16.1)") value
    text = trim(adjustl(row))
  end function tenths

  !> How unevenly sweeps took time.
  function balance_text(ranks, subdomains) result(text)
    !> most over mean seconds of the ranks, and of the subdomains
    real(dp), intent(in) :: ranks, subdomains
    character(len=:), allocatable :: text
    character(len=24) :: row(2)

    write (row, "(f0.3)") ranks, subdomains
    text = "time of sweeps over its mean: "//trim(row(1))//" on the slowest rank, "//trim(row(2))//" in the slowest subdomain"
  end function balance_text

  !> What went wrong in a step.
  function failure_text(simulation, figures) result(text)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    character(len=:), allocatable :: text

    associate (solve => figures%solve, solver => simulation%config%solver)
      if (solve%status == solve_diverged) then
        text = "DIVERGED: step "//to_text(simulation%step + 1)//" after "//to_text(solve%iterations)//" iterations of "// &
          & trim(solver%method)//"; the step is not kept"
      else
        text = "NOT CONVERGED: "//miss_text(solve, solver)//" after "//to_text(solve%iterations)//" iterations of "// &
          & trim(solver%method)
        if (solve%status == solve_stagnated) text = text//"; more iterations gain nothing (stagnation)"
        if (solve%status == solve_unbounded) text = text//"; no solution found: loads grow without bound"
      end if
    end associate
  end function failure_text

  !> What of the criterion a solve has missed.
  function miss_text(solve, solver) result(text)
    type(solve_report_t), intent(in) :: solve
    type(solver_config_t), intent(in) :: solver
    character(len=:), allocatable :: text

    if (solver%criterion == "error") then
      text = "error "//to_text(solve%error, 3)//" above the tolerance "//to_text(solver%tolerance, 3)
    else if (solver%criterion == "residual" .and. solve%status == solve_unbounded .and. solve%residual <= solver%tolerance) then
      text = "impulses exceed what any loads can cause"
    else if (solve%residual > solver%tolerance) then
      text = "residual "//to_text(solve%residual, 3)//" above the tolerance "//to_text(solver%tolerance, 3)
    else if (solve%violation > solve%violation_allowed .and. (solve%status == solve_unbounded .or. &
        & solve%velocity_error <= solver%accuracy*solve%velocity_scale)) then
      text = "a contact violates its law by "//to_text(solve%violation, 3)//" m/s, above "//to_text(solve%violation_allowed, 3)// &
        & " m/s,"
    else if (solve%velocity_error <= solver%accuracy*solve%velocity_scale) then
      ! what sinks, and what moves where the solution is at rest, counts more than in the estimate
      text = "weighted velocity error "//to_text(solve%figure, 3)//" of U above the accuracy "//to_text(solver%accuracy, 3)
    else
      text = "velocity error "//to_text(solve%velocity_error, 3)//" m/s above "//to_text(solver%accuracy, 3)//" of "// &
        & to_text(solve%velocity_scale, 3)//" m/s"
    end if
  end function miss_text

end module gravier_step_lines
