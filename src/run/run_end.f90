!> What ends a run before its last step: grains that have come to rest, that were drained or filled in, a boundary that has gone its
!> way.
module gravier_run_end
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: has_ended, end_line

  !> steps, one after the other, of a scene that has come to rest
  integer, parameter :: steps_at_rest = 10
  !> fraction of a displacement that roundings of many steps take
  real(dp), parameter :: rounding = 1.0e-9_dp

contains

  !> Whether a rule of &time ends the run now. The same on all ranks, and in a run that goes on from a checkpoint.
  logical function has_ended(simulation)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: why

    why = reason(simulation)
    has_ended = why /= ""
  end function has_ended

  !> The line of the log, for a run that has ended so.
  function end_line(simulation) result(line)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: line

    line = "ended       after step "
    if (rests(simulation)) line = "at rest     after step "
    line = line//to_text(simulation%step)//" of "//to_text(simulation%config%time%steps)//": "//reason(simulation)
  end function end_line

  !> Why the run ends now; empty where it does not.
  function reason(simulation) result(why)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: why
    integer(i8) :: grains
    real(dp) :: way

    why = ""
    if (rests(simulation)) then
      why = "the kinetic energy of the grains was at most "//to_text(simulation%rest_energy, 3)//" J in "// &
        & to_text(steps_at_rest)//" steps"
      return
    end if
    grains = simulation%n_grains - simulation%n_glued
    associate (time => simulation%config%time, seen => simulation%population, mass => simulation%mass)
      if (time%stop_grains_at_most_given .and. grains <= time%stop_grains_at_most .and. seen%most > time%stop_grains_at_most) then
        why = counted(grains, "grain")//" in the scene, stop_grains_at_most = "//to_text(time%stop_grains_at_most)
      else if (time%stop_grains_at_least_given .and. grains >= time%stop_grains_at_least .and. &
        & seen%fewest < time%stop_grains_at_least) then
        why = counted(grains, "grain")//" in the scene, stop_grains_at_least = "//to_text(time%stop_grains_at_least)
      else if (time%stop_mass_at_most_given .and. mass <= time%stop_mass_at_most .and. seen%heaviest > time%stop_mass_at_most) then
        why = to_text(mass, 7)//" kg of grains in the scene, stop_mass_at_most = "//to_text(time%stop_mass_at_most, 7)//" kg"
      else if (time%stop_mass_at_least_given .and. mass >= time%stop_mass_at_least .and. &
        & seen%lightest < time%stop_mass_at_least) then
        why = to_text(mass, 7)//" kg of grains in the scene, stop_mass_at_least = "//to_text(time%stop_mass_at_least, 7)//" kg"
      else if (simulation%watched > 0) then
        way = displacement(simulation)
        if (way >= (1.0_dp - rounding)*time%stop_displacement) why = "boundary '"//trim(time%stop_boundary)//"' has moved by "// &
          & to_text(way, 7)//" m, stop_displacement = "//to_text(time%stop_displacement, 7)//" m"
      end if
    end associate
  end function reason

  !> Whether the scene rests, in a run that ends by that.
  pure logical function rests(simulation)
    type(simulation_t), intent(in) :: simulation
    rests = simulation%rest_energy > 0.0_dp .and. simulation%quiet >= steps_at_rest
  end function rests

  !> How far the boundary of stop_boundary is from its place at the start of the scene [m].
  real(dp) function displacement(simulation) result(way)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: place(3)

    call simulation%decomposition%boundaries(simulation%watched)%find_place(place)
    way = norm2(place - simulation%watched_from)
  end function displacement

end module gravier_run_end
