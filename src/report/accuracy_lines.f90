!> The closing lines of a run about its accuracy: errors of velocities, overlaps and what mended them, passes over layers.
module gravier_accuracy_lines
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_run_tally, only: run_tally_t
  use gravier_drift, only: most_drift
  use gravier_spot_checks, only: checked_share
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: accuracy_lines, error_line, scale_range_line, spot_check_lines, drift_lines, drifts, overlap_lines, layer_line, &
    & creep_lines, goal_name, goal_text, mean_size_name, percent, plain

  character(len=*), parameter :: newline = new_line("a"), indent = "            "

contains

  !> All of them, each ended by a newline.
  function accuracy_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = error_line(simulation)//scale_range_line(simulation%tally)//spot_check_lines(simulation)//drift_lines(simulation)// &
      & overlap_lines(simulation)//layer_line(simulation%tally)//creep_lines(simulation%tally)
    if (.not. simulation%restarted) return
    text = text//indent//"these lines are of the "//to_text(simulation%tally%solves)//" steps since the restart"
    if (drifts(simulation)) text = text//"; `drift` is of all steps"
    text = text//newline
  end function accuracy_lines

  !> What a solve has to reach, in a word.
  function goal_name(simulation) result(name)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: name

    name = "tolerance"
    if (simulation%config%solver%criterion == "velocity_error") name = "accuracy"
  end function goal_name

  !> The goal of a solve with its number, or with another one: so many times it.
  function goal_text(simulation, times) result(text)
    type(simulation_t), intent(in) :: simulation
    real(dp), intent(in), optional :: times
    character(len=:), allocatable :: text
    real(dp) :: goal

    goal = simulation%config%solver%tolerance
    if (goal_name(simulation) == "accuracy") goal = simulation%config%solver%accuracy
    if (present(times)) goal = times*goal
    text = goal_name(simulation)//" "//to_text(goal, 3)
  end function goal_text

  !> What the criterion has left at worst, and what else is known of the error.
  function error_line(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    character(len=:), allocatable :: error

    associate (solver => simulation%config%solver, tally => simulation%tally)
      error = "velocity error at most "//to_text(tally%worst_error, 3)//" of U"
      if (solver%criterion == "velocity_error") then
        text = error//" at the end of a solve, accuracy "//to_text(solver%accuracy, 3)//"; residual at most "// &
          & to_text(tally%worst_residual, 3)//", tolerance "//to_text(solver%tolerance, 3)
      else
        text = trim(solver%criterion)//" at most "//to_text(simulation%effort%worst, 3)//" at the end of a solve, tolerance "// &
          & to_text(solver%tolerance, 3)//"; "//error
      end if
    end associate
    text = "accuracy    "//text//newline
  end function error_line

  !> Which velocities errors were compared with.
  function scale_range_line(tally) result(text)
    type(run_tally_t), intent(in) :: tally
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    if (tally%solves == 0) return
    text = indent//"U from "//to_text(tally%least_scale, 3)//" to "//to_text(tally%most_scale, 3)//" m/s: "
    do k = 1, tally%n_kinds
      if (k > 1) text = text//", "
      text = text//trim(tally%kind(k))//" in "//counted(tally%of_kind(k), "solve")
    end do
    text = text//newline
  end function scale_range_line

  !> What spot checks have found of the velocities and forces of single steps; nothing where there was none.
  function spot_check_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = ""
    associate (checks => simulation%spot_checks, effort => simulation%effort)
      if (checks%made == 0) return
      text = "checked     "//counted(checks%made, "solve")//" by going on to the "//goal_text(simulation, checked_share)// &
        & " and back, in "//percent(real(checks%further, dp)/real(max(effort%iterations, 1_i8), dp))//" more iterations"
      if (checks%reached < checks%made) text = text//"; "//to_text(checks%reached)//" of them reached it"
      text = text//newline
      if (checks%reached == 0) return
      text = text//indent//"velocities were off by "//to_text(checks%mean(checks%found), 2)// &
        & " of U, root mean square, and by their estimates "//to_text(checks%mean(checks%estimated), 2)
      if (checks%beyond > 0) text = text//"; by more than twice the accuracy in "//to_text(checks%beyond)//" of "// &
        & to_text(checks%reached)
      text = text//newline
      text = text//indent//"forces of a single step were off by "//percent(checks%contacts%share())//" at contacts, "// &
        & percent(checks%stress%share())//" in the mean stress"//boundary_text(simulation)//newline
    end associate
  end function spot_check_lines

  !> How far forces on boundaries are off in single steps: on that where they are off most and on that where they are off least.
  function boundary_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer :: b, n, worst, best

    text = ""
    n = 0
    associate (checks => simulation%spot_checks%boundary)
      do b = 1, size(checks)
        if (.not. checks(b)%whole > 0.0_dp) cycle
        n = n + 1
        if (n == 1) then
          worst = b
          best = b
        end if
        if (checks(b)%share() > checks(worst)%share()) worst = b
        if (checks(b)%share() < checks(best)%share()) best = b
      end do
      if (n > 0) text = ", "//percent(checks(worst)%share())//" on "//name_of(worst)
      if (n > 1) text = text//", "//percent(checks(best)%share())//" on "//name_of(best)
      if (n > 2) text = text//", on the others between the two"
    end associate

  contains

    function name_of(boundary) result(name)
      integer, intent(in) :: boundary
      character(len=:), allocatable :: name
      name = "'"//trim(simulation%decomposition%boundaries(boundary)%name)//"'"
    end function name_of

  end function boundary_text

  !> Whether the scene has moved visibly, as a whole, in steps whose motion is not told from the errors of their solves.
  pure logical function drifts(simulation)
    type(simulation_t), intent(in) :: simulation
    drifts = simulation%drift%length() > most_drift*simulation%velocity_scale%diameter
  end function drifts

  !> How far the scene has come in steps whose motion is not told from the errors of their solves, where that can be seen, and what
  !> resolves it; and what solves did about it. Errors are about proportional to the goal: half of the goal which would keep the way
  !> below a bound does so.
  function drift_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: way

    text = ""
    associate (drift => simulation%drift, refinement => simulation%refinement)
      if (refinement%refined > 0) then
        text = "refined     "//counted(refinement%refined, "solve")//" aimed at less error than the goal, down to the "// &
          & goal_text(simulation, refinement%least_share)//", so that "
        if (refinement%for_bonds < refinement%refined) text = text//"errors do not add up where most bodies rest"
        if (refinement%for_bonds > 0 .and. refinement%for_bonds < refinement%refined) text = text//" and "
        if (refinement%for_bonds > 0) text = text//"bonds break where they should, in "//counted(refinement%for_bonds, "solve")
        text = text//"; "
        if (refinement%reached == refinement%refined) then
          text = text//"all came to it"//newline
        else
          text = text//to_text(refinement%reached)//" came to it, the others gave it up after "// &
            & counted(refinement%in_vain, "iteration")//" in all"//newline
        end if
        if (refinement%in_doubt > 0) text = text//indent//"in "//counted(refinement%in_doubt, "step")// &
          & " solves to less error did not tell whether bonds at their limits break: a larger &solver max_iterations "// &
          & "helps, of which they take a quarter"//newline
      end if
      if (.not. drifts(simulation)) return
      way = drift%length()/simulation%velocity_scale%diameter
      text = text//"drift       in "//to_text(drift%steps)//" of "//counted(int(simulation%step, i8), "step")// &
        & " bodies moved no faster than twice the velocity error of the solve, and came "//plain(way)// &
        & " mean diameters away as a whole"//newline//indent//"that motion may be nothing but errors; "
      if (refinement%refined > 0) then
        text = text//"a smaller &solver "//goal_name(simulation)//", which every solve has to reach, tells"//newline
      else
        text = text//"the "//goal_text(simulation, 0.5_dp*most_drift/way)//" would keep them below "//plain(most_drift)// &
          & " mean diameters"//newline
      end if
    end associate
  end function drift_lines

  !> Overlaps at the start and later, and by how much projections have shifted the grains.
  function overlap_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (tally => simulation%tally, size => simulation%mean_half_thickness)
      text = "overlaps    in the first step at most "//to_text(tally%start_overlap, 3)//" m, later at most "// &
        & to_text(tally%later_overlap, 3)//" m"
      if (size > 0.0_dp) text = text//", "//to_text(tally%later_overlap/size, 2)//" of "//mean_size_name(simulation)
      if (simulation%physics%laws%yields) text = text//", of rigid contacts"
      text = text//newline
      if (simulation%physics%laws%yields) text = text//spring_line(simulation)
      if (simulation%overlap_allowed >= huge(1.0_dp)) then
        text = text//indent//"overlaps are not projected"//newline
      else if (tally%projected == 0) then
        text = text//indent//"no step projected overlaps"//newline
      else
        text = text//indent//"projected in "//to_text(tally%projected)//" of "//to_text(tally%steps)//" steps ("// &
          & percent(tally%mended_share())//"): shifts of a grain add up to "//to_text(tally%shift, 3)//" m on average"
        if (tally%path > 0.0_dp) text = text//", "//to_text(tally%shift/tally%path, 2)//" of its path of "// &
          & to_text(tally%path, 3)//" m"
        text = text//newline
      end if
      if (tally%steps_with_cores > 0) then
        text = text//indent//"in "//to_text(tally%steps_with_cores)//" of "//to_text(tally%steps)// &
          & " steps bodies overlapped by more than their roundings, in one step at most "//to_text(tally%most_cores)//" pairs"
        if (simulation%physics%laws%yields) text = text//"; where contacts yield, give the shapes a larger rounding"
        text = text//newline
      end if
      if (tally%steps_left_out > 0) text = text//"warning     in "//to_text(tally%steps_left_out)//" of "// &
        & counted(tally%steps, "step")//" bodies touched each other or a mesh in more points than are kept, which are the "// &
        & "deepest; at most "//counted(tally%most_left_out, "point")//" of a step were left out. Forces may be wrong there"//newline
      if (tally%steps_stretched > 0) text = text//"warning     in "//to_text(tally%steps_stretched)//" of "// &
        & counted(tally%steps, "step")//" intact bonds had gaps beyond those at which pairs are bonded, in one step at most "// &
        & to_text(tally%most_stretched)//": errors of solves add up to that, and a bond is lost where its pair is out of "// &
        & "reach; a smaller accuracy helps"//newline
    end associate
  end function overlap_lines

  !> How far compliant contacts were deformed, and how stiff they are for the step.
  function spring_line(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (tally => simulation%tally, size => simulation%mean_half_thickness)
      text = indent//"compliant contacts are deformed by at most "//to_text(tally%deformation, 3)//" m"
      if (size > 0.0_dp) text = text//", "//to_text(tally%deformation/size, 2)//" of "//mean_size_name(simulation)
      text = text//"; h sqrt(k/m) at most "//to_text(tally%stiffest, 3)//newline
    end associate
  end function spring_line

  !> What overlaps are compared with.
  function mean_size_name(simulation) result(name)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: name

    name = "the mean radius"
    if (simulation%effects%shapes) name = "half of the mean thickness"
    if (simulation%inflow%exists()) name = name//" of the smallest grains, those of the start or of an &insertion"
  end function mean_size_name

  !> A fraction as people write it; what is not 0 is not written as 0.
  pure function percent(share) result(text)
    real(dp), intent(in) :: share
    character(len=:), allocatable :: text

    text = to_text(nint(100.0_dp*share))//" %"
    if (share > 0.0_dp .and. nint(100.0_dp*share) == 0) text = "less than 1 %"
    if (share < 1.0_dp .and. nint(100.0_dp*share) == 100) text = "more than 99 %"
  end function percent

  !> A number as people write it, with two decimals where it has a few digits before them.
  pure function plain(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=16) :: row

    text = to_text(value, 2)
    if (value < 0.05_dp .or. value >= 1000.0_dp) return
    write (row, "(f8.2)") value
    text = trim(adjustl(row))
  end function plain

  !> Whether solves went through a pass over layers; nothing where none did.
  function layer_line(tally) result(text)
    type(run_tally_t), intent(in) :: tally
    character(len=:), allocatable :: text

    text = ""
    if (tally%tried_layers == 0) return
    text = "layers      "//counted(tally%tried_layers, "solve")//" made a pass over layers, "//to_text(tally%took_layers)// &
      & " of them continued from it; the passes took as much work as "//counted(nint(tally%layered_sweeps, i8), "sweep")//newline
  end function layer_line

  !> What still changed in solves that stagnated; nothing where none did, or no contact has friction.
  function creep_lines(tally) result(text)
    type(run_tally_t), intent(in) :: tally
    character(len=:), allocatable :: text

    text = ""
    associate (creep => tally%creep)
      if (creep%contacts == 0) return
      text = "creep       in solves that stagnate, the impulses of up to "//counted(creep%contacts, "contact")// &
        & " go on changing; "//percent(real(creep%stuck, dp)/real(creep%contacts, dp))//" of these contacts stick"//newline// &
        & indent//"the largest group of them joins "//counted(creep%group_grains, "grain")//" by "// &
        & counted(creep%group_contacts, "contact")//newline// &
        & indent//"velocities in such a group differ by up to "//to_text(tally%worst_creep, 2)// &
        & " of U between iterates: neither they nor the forces there are known more exactly"//newline// &
        & indent//"contacts with springs (&law kind = 'elastic') have one solution"//newline
    end associate
  end function creep_lines

end module gravier_accuracy_lines
