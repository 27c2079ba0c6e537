!> What ends a run before its last step: grains that have come to rest, that were drained or filled in, a boundary that has gone its
!> way, a periodic cell that has been strained.
module gravier_run_end
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: has_ended, end_line

  !> steps, one after the other, of a scene that has come to rest
  integer, parameter :: steps_at_rest = 10
  !> part of the weight of grains at rest that boundaries may miss in a step, by errors of solves or by single grains that move
  real(dp), parameter :: may_miss = 0.1_dp
  !> fraction of a displacement or of a strain that roundings of many steps take
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
    integer :: b

    why = ""
    if (rests(simulation)) then
      if (simulation%n_grains == simulation%n_glued) then
        why = "no grain is left"
        return
      end if
      why = "the kinetic energy of the grains, without spins of disks and spheres, was at most "// &
        & to_text(simulation%rest_energy, 3)//" J in "//to_text(steps_at_rest)//" steps"
      if (simulation%inflow%is_blocked(simulation%time)) why = why//", and grains that are still to enter found no place"
      do b = 1, size(simulation%decomposition%boundaries)
        if (still_moves(simulation, b)) why = why//"; boundary '"//simulation%decomposition%boundaries(b)%name//"' still moves"
      end do
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
      else if (is_watched(simulation)) then
        way = displacement(simulation)
        if (way >= (1.0_dp - rounding)*time%stop_displacement) why = "boundary '"//trim(time%stop_boundary)//"' has moved by "// &
          & to_text(way, 7)//" m, stop_displacement = "//to_text(time%stop_displacement, 7)//" m"
      end if
    end associate
    if (why == "" .and. simulation%decomposition%period%moves) why = strain_reason(simulation)
  end function reason

  !> The component of the strain of the cell that ends the run; empty where none does.
  function strain_reason(simulation) result(why)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: why
    character(len=*), parameter :: strained(3) = ["strained along x", "strained along y", "strained along z"]
    character(len=*), parameter :: sheared(3) = ["sheared along x over y", "sheared along x over z", "sheared along y over z"]
    real(dp) :: strain(3)

    why = ""
    associate (period => simulation%decomposition%period, time => simulation%config%time)
      strain(:) = simulation%cell_strain()
      call look(strained, strain, "stop_cell_strain", time%stop_cell_strain)
      call look(sheared, period%shear, "stop_cell_shear", time%stop_cell_shear)
    end associate

  contains

    !> Strains of which one has come up to its end, in its direction.
    subroutine look(words, found, key, ends)
      character(len=*), intent(in) :: words(3), key
      real(dp), intent(in) :: found(3), ends(3)
      integer :: d

      do d = 1, 3
        if (.not. abs(ends(d)) > 0.0_dp .or. why /= "") cycle
        if (found(d)*sign(1.0_dp, ends(d)) >= (1.0_dp - rounding)*abs(ends(d))) why = "the cell is "//words(d)//" by "// &
          & to_text(found(d), 7)//", "//key//" = "//to_text(ends(d), 7)
      end do
    end subroutine look

  end function strain_reason

  !> Whether the scene rests, something bears it, and nothing that could move it comes or came in the last steps: no boundary that
  !> goes, no change of gravity or of what moves a boundary. Steps in which grains are to enter later do not count as quiet.
  pure logical function rests(simulation)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: since
    integer :: b

    rests = simulation%rest_energy > 0.0_dp .and. simulation%quiet >= steps_at_rest
    if (.not. rests) return
    since = (simulation%step - steps_at_rest)*simulation%physics%h
    rests = is_borne(simulation)
    if (allocated(simulation%gravity_table%has)) rests = rests .and. .not. simulation%gravity_table%changes_after(since)
    if (allocated(simulation%cell_drive%table%has)) rests = rests .and. .not. simulation%cell_drive%table%changes_after(since)
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        rests = rests .and. .not. (boundary%remove_at > since .and. boundary%remove_at < huge(1.0_dp))
        if (boundary%present) rests = rests .and. .not. boundary%drive%changes_after(since)
      end associate
    end do
  end function rests

  !> Whether boundaries bear the grains in the last step, but for a tenth of their weight, and contacts bear something in a cell
  !> that stresses drive: what begins to move is slow, too. Body forces are not looked at.
  pure logical function is_borne(simulation) result(borne)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: weight(simulation%decomposition%nd)

    associate (physics => simulation%physics, nd => simulation%decomposition%nd)
      borne = .true.
      if (any(physics%cell%driven)) borne = simulation%problem%impulse_scale > 0.0_dp
      weight(:) = simulation%mass*physics%h*physics%gravity(1:nd)
      if (.not. norm2(weight) > 0.0_dp .or. any(abs(physics%body_force) > 0.0_dp)) return
      borne = borne .and. norm2(weight - sum(simulation%boundary_impulses, dim=2)) <= may_miss*norm2(weight)
    end associate
  end function is_borne

  !> Whether boundary `b` moves by a velocity that is given, or moves under a force and touches no grain.
  pure logical function still_moves(simulation, b)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: b

    associate (boundary => simulation%decomposition%boundaries(b))
      still_moves = boundary%is_moved()
      if (boundary%is_driven()) still_moves = still_moves .or. (norm2(boundary%velocity) > 0.0_dp .and. &
        & .not. norm2(simulation%boundary_impulses(:, b)) > 0.0_dp)
      still_moves = still_moves .and. boundary%touches()
    end associate
  end function still_moves

  !> Whether the boundary of stop_boundary is there: one that is removed has no place.
  pure logical function is_watched(simulation)
    type(simulation_t), intent(in) :: simulation

    is_watched = simulation%watched > 0
    if (is_watched) is_watched = simulation%decomposition%boundaries(simulation%watched)%present
  end function is_watched

  !> How far the boundary of stop_boundary is from its place at the start of the scene [m].
  real(dp) function displacement(simulation) result(way)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: place(3)

    call simulation%decomposition%boundaries(simulation%watched)%find_place(place)
    way = norm2(place - simulation%watched_from)
  end function displacement

end module gravier_run_end
