!> The closing summary of a run, in words: whether it converged, where its time went, what would halve it.
module gravier_run_summary
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_timers, only: phase_names, n_phases, phase_neighbourhood, phase_exchange, phase_factorise, phase_interface, &
    & phase_interface_solve, phase_reduction, phase_output
  use gravier_descent, only: at_tolerance
  use gravier_progress, only: duration_text
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: converged_text, time_text, halving_text

  !> phases that are named, the dearest first, and the least share that is [%]
  integer, parameter :: named = 4
  real(dp), parameter :: least_share = 3.0_dp
  !> contacts of rank 0 below which more ranks do not pay
  integer(i8), parameter :: contacts_a_rank = 5000

contains

  !> How many steps reached the tolerance, and in how many iterations.
  function converged_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    character(len=24) :: mean

    associate (effort => simulation%effort, tolerance => simulation%config%solver%tolerance)
      write (mean, "(f24.1)") real(effort%iterations, dp)/real(max(effort%solves, 1_i8), dp)
      if (simulation%failed == 0) then
        text = "yes: every solve reached the tolerance "//to_text(tolerance, 3)
      else
        text = "NO: "//to_text(simulation%failed)//" of "//to_text(simulation%step)//" solves did not reach the tolerance "// &
          & to_text(tolerance, 3)//"; at worst "//to_text(effort%worst, 3)
      end if
      text = text//"; "//trim(adjustl(mean))//" iterations a solve"
    end associate
  end function converged_text

  !> The dearest phases.
  function time_text(phases, seconds, steps) result(text)
    !> (n_phases), mean over the ranks [s]
    real(dp), intent(in) :: phases(n_phases)
    !> of the whole run [s]
    real(dp), intent(in) :: seconds
    integer(i8), intent(in) :: steps
    character(len=:), allocatable :: text
    logical :: told(n_phases)
    real(dp) :: mean, share
    character(len=16) :: row
    integer :: k, p

    text = duration_text(seconds)
    mean = seconds/real(max(steps, 1_i8), dp)
    if (mean < 1.0_dp) then
      write (row, "(f8.1)") 1000.0_dp*mean
      text = text//", "//trim(adjustl(row))//" ms a step"
    else
      text = text//", "//duration_text(mean)//" a step"
    end if
    told(:) = .false.
    do k = 1, named
      p = maxloc(phases, dim=1, mask=.not. told)
      share = 100.0_dp*phases(p)/max(seconds, tiny(seconds))
      if (share < least_share) exit
      told(p) = .true.
      text = text//trim(merge(": ", ", ", k == 1))//" "//trim(phase_names(p))//" "//to_text(nint(share))//" %"
    end do
  end function time_text

  !> What would halve the time of the run, as far as its own figures tell.
  function halving_text(simulation, phases, seconds, looser_seconds) result(text)
    type(simulation_t), intent(in) :: simulation
    !> (n_phases), mean over the ranks [s]
    real(dp), intent(in) :: phases(n_phases)
    !> of the whole run, of its solves with ten times the tolerance (negative: not known) [s]
    real(dp), intent(in) :: seconds, looser_seconds
    character(len=:), allocatable :: text
    real(dp) :: half, shared, lost

    half = 0.5_dp*seconds
    shared = phases(phase_exchange) + phases(phase_factorise) + phases(phase_interface_solve) + phases(phase_reduction) + &
      & phases(phase_interface)
    associate (effort => simulation%effort, config => simulation%config)
      lost = real(effort%iterations - effort%reached(at_tolerance), dp)/real(max(effort%iterations, 1_i8), dp)
      if (simulation%comm%size > simulation%decomposition%n_subdomains) then
        text = to_text(simulation%comm%size - simulation%decomposition%n_subdomains)//" of "// &
          & to_text(simulation%comm%size)//" ranks own no subdomain and wait: as many &decomposition subdomains, now "// &
          & to_text(simulation%decomposition%n_subdomains)//", or fewer ranks"
      else if (phases(phase_output) > half) then
        text = "output takes most of it: a larger &output every, now "//to_text(config%output%every)
      else if (effort%unreached(at_tolerance) > 0 .and. lost > 0.5_dp) then
        text = "solves that give up take most iterations: a &solver tolerance that they reach, now "// &
          & to_text(config%solver%tolerance, 3)//" and at worst "//to_text(effort%worst, 3)//", or another method; a smaller "// &
          & "max_iterations, now "//to_text(config%solver%max_iterations)//", leaves larger errors"
      else if (looser_seconds >= 0.0_dp .and. seconds - effort%seconds + looser_seconds <= half) then
        text = "ten times the tolerance: about "//duration_text(seconds - effort%seconds + looser_seconds)//" in all (estimated)"
      else if (shared > half .and. simulation%decomposition%n_subdomains > 1) then
        text = "the interface takes most of it: fewer &decomposition subdomains, now "// &
          & to_text(simulation%decomposition%n_subdomains)//", on fewer ranks"
      else if (phases(phase_neighbourhood) > half) then
        text = "neighbour lists take most of it: a larger &scene skin lets them last longer"
      else if (contacts_of(simulation) >= contacts_a_rank) then
        text = "twice the ranks, now "//to_text(simulation%comm%size)//", with as many &decomposition subdomains or more, now "// &
          & to_text(simulation%decomposition%n_subdomains)
      else
        text = "no single key does; a longer &time step makes fewer steps, at the price of accuracy"
      end if
    end associate
  end function halving_text

  !> Contacts of all subdomains of this rank.
  pure integer(i8) function contacts_of(simulation) result(contacts)
    type(simulation_t), intent(in) :: simulation
    integer :: s

    contacts = 0
    if (.not. allocated(simulation%problem%sub)) return
    do s = 1, size(simulation%problem%sub)
      contacts = contacts + simulation%problem%sub(s)%n_contacts
    end do
  end function contacts_of

end module gravier_run_summary
