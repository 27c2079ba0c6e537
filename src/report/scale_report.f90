!> What the scales of a scene say to a person: lines of --check, and warnings where the step or the tolerance cannot hold what the
!> scene is for.
module gravier_scale_report
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_time_table, only: time_table_t
  use gravier_boundary_drive, only: drive_rates
  use gravier_cell_drive, only: cell_components
  use gravier_simulation, only: simulation_t
  use gravier_scene_scales, only: scene_scales_t
  implicit none
  private
  public :: scale_lines, scale_warnings, error_scale_line, distance_line, most_by_spring, spring_warning, fast_warning

  character(len=*), parameter :: newline = new_line("a")
  !> digits of a figure
  integer, parameter :: digits = 3

  !> mean diameter from which the unit of lengths is named [m]
  real(dp), parameter :: large_grains = 1.0_dp
  !> diameters by which loads may move a free grain in a step: that is h sqrt(P/rho)/d = 0.1 at the pressure of one layer of grains
  real(dp), parameter :: most_by_gravity = 1.0e-2_dp
  !> radii by which a grain may move in a step, lest it passes through others
  real(dp), parameter :: most_by_fall = 1.0_dp
  !> part of the slip scale of a law that errors may be
  real(dp), parameter :: most_of_slip = 0.5_dp
  !> radii of the smallest grain by which a boundary may move in a step
  real(dp), parameter :: most_by_boundary = 0.1_dp
  !> h sqrt(k/m) of the stiffest spring of a contact, six steps of a collision
  real(dp), parameter :: most_by_spring = 0.5_dp
  !> h sqrt(P/rho)/d
  real(dp), parameter :: most_relative_step = 0.1_dp
  !> fraction of the speed of a wall that errors may have in slow shear
  real(dp), parameter :: error_share = 0.05_dp
  !> relative rounding of a number that is written with `digits` digits: no warning comes for the mass that one has advised
  real(dp), parameter :: of_digits = 5.0e-3_dp
  !> part of the period of an oscillation that a step may take
  real(dp), parameter :: most_of_period = 0.1_dp
  !> part of the ups and downs of a table that steps should keep
  real(dp), parameter :: least_kept = 0.9_dp
  !> answer times of a cell between two turns of a stress that it holds: measured, where a shear to and fro has the strain of a
  !> light cell to a tenth
  real(dp), parameter :: least_answers = 15.0_dp

contains

  !> Lines, each ended by a newline; none without grains.
  function scale_lines(simulation, scales) result(text)
    type(simulation_t), intent(in) :: simulation
    type(scene_scales_t), intent(in) :: scales
    character(len=:), allocatable :: text
    real(dp) :: g

    text = ""
    if (.not. scales%diameter > 0.0_dp) return
    associate (h => simulation%config%time%step, boundaries => simulation%decomposition%boundaries)
      g = norm2(scales%acceleration)
      text = "scales      mean diameter d = "//figure(scales%diameter)//" m"
      ! such grains are rare, and millimetres are easily taken for the unit of lengths
      if (scales%diameter >= large_grains) text = text//" (lengths are in metres)"
      if (g > 0.0_dp) text = text//"; g h = "//figure(g*h)//" m/s, "//figure(g*h**2/scales%diameter)// &
        & " mean diameters a step; sqrt(g d) = "//figure(sqrt(g*scales%diameter))//" m/s"
      text = text//newline
      if (scales%pressure > 0.0_dp) text = text//"            pressure P = "//figure(scales%pressure)// &
        & pressure_unit(simulation)//" on '"//boundaries(scales%pressed)%name//"'; sqrt(P/rho) = "// &
        & figure(sqrt(scales%pressure/scales%density))//" m/s, h sqrt(P/rho)/d = "//figure(scales%relative_step(h))//newline
      if (scales%rate > 0.0_dp) then
        text = text//"            rate "//figure(scales%rate)//" 1/s by '"//boundaries(scales%driver)%name//"', rate d = "// &
          & figure(scales%rate*scales%diameter)//" m/s"
        if (scales%pressure > 0.0_dp) text = text//"; inertial number I = "//figure(scales%inertial_number())
        text = text//newline
      end if
      if (any(simulation%cell_drive%driven)) text = text//"            the cell answers to stresses of "// &
        & figure(largest_stress(simulation))//pressure_unit(simulation)//" after about "//figure(answer_time(simulation))// &
        & " s (cell_inertia = "//figure(simulation%cell_drive%inertia)//")"//newline
      if (scales%speed > 0.0_dp) text = text//"            fastest boundary '"//boundaries(scales%fastest)%name//"': "// &
        & figure(scales%speed)//" m/s, "//figure(2.0_dp*scales%speed*h/scales%diameter)//" mean radii a step"//newline
    end associate
  end function scale_lines

  !> Of a scene whose first step has been assembled.
  function error_scale_line(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = "            velocity errors are compared with U = "//figure(simulation%velocity_scale%value)//" m/s ("// &
      & trim(simulation%velocity_scale%kind)//")"//newline
  end function error_scale_line

  !> The distances that decide what is a contact, how long lists last and which overlaps are removed, whatever rule gives them.
  function distance_line(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (rule => simulation%decomposition%rule)
      text = "distances   contacts have gaps of at most "//figure(rule%alert_distance)//" m (alert_distance), lists reach "// &
        & figure(rule%skin)//" m further (skin)"
      if (simulation%overlap_allowed < huge(1.0_dp)) text = text//", overlaps above "//figure(simulation%overlap_allowed)// &
        & " m are projected (overlap_allowed)"
    end associate
    text = text//newline
  end function distance_line

  !> Warnings, each a line ended by a newline, and their number.
  subroutine scale_warnings(simulation, scales, text, number)
    type(simulation_t), intent(in) :: simulation
    type(scene_scales_t), intent(in) :: scales
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    !> velocity error that solves may leave to the mean grain [m/s]
    real(dp) :: error
    real(dp) :: g, a, most, half
    character(len=:), allocatable :: halves, least

    text = ""
    number = 0
    if (.not. scales%diameter > 0.0_dp) return
    associate (h => simulation%config%time%step, solver => simulation%config%solver, d => scales%diameter)
      half = 0.5_dp*d
      halves = " mean radii"
      least = " radii of the smallest grain"
      if (simulation%effects%shapes) then
        half = simulation%mean_half_thickness
        halves = " times half of the mean thickness"
        least = " times half of the thickness of the thinnest grain"
      end if
      g = norm2(scales%acceleration)
      if (g*h**2 > most_by_gravity*d) call warn_step("loads move a free grain by "//figure(g*h**2/d)// &
        & " mean diameters in it", sqrt(most_by_gravity*d/g))
      if (h*sqrt(2.0_dp*g*scales%fall) > most_by_fall*half) call warn_step("a grain that falls "//figure(scales%fall)// &
        & " m to the lowest support moves by "//figure(h*sqrt(2.0_dp*g*scales%fall)/half)// &
        & halves//" in it and may pass through others", most_by_fall*half/sqrt(2.0_dp*g*scales%fall))
      if (h*scales%entering_speed > most_by_fall*half) call warn_step("grains that enter are at up to "// &
        & figure(scales%entering_speed)//" m/s where they have fallen to the lowest support, move by "// &
        & figure(h*scales%entering_speed/half)//halves//" in it and may pass through others", &
        & most_by_fall*half/scales%entering_speed)
      if (scales%speed*h > most_by_boundary*scales%smallest .and. scales%smallest > 0.0_dp) call warn_step("boundary '"// &
        & simulation%decomposition%boundaries(scales%fastest)%name//"' moves by "//figure(scales%speed*h/scales%smallest)// &
        & least//" in it", most_by_boundary*scales%smallest/scales%speed)
      if (simulation%tally%stiffest > most_by_spring) call warn(spring_warning(simulation))
      call warn(cell_warning(simulation, d))
      call warn(table_warning(simulation))
      call warn(oscillation_warning(simulation))
      a = scales%relative_step(h)
      if (a > most_relative_step) call warn_step("h sqrt(P/rho)/d = "//figure(a)//" under the pressure on '"// &
        & simulation%decomposition%boundaries(scales%pressed)%name//"'", h*most_relative_step/a)
      error = solver%accuracy*max(g*h, scales%load)/(1.0_dp + simulation%velocity_scale%stiffness)
      if (scales%gain > 0.0_dp .and. scales%gain < (1.0_dp - of_digits)*error .and. solver%criterion == "velocity_error") then
        associate (boundary => simulation%decomposition%boundaries(scales%heaviest))
          call warn("boundary '"//boundary%name//"': its load gives it "//figure(scales%gain)//" m/s in a step, less than the "// &
            & "error of "//figure(error)//" m/s that solves may leave: forces under it may be wrong in single steps; a mass of "// &
            & "at most "//figure(boundary%mass*scales%gain/error)//" kg would do")
        end associate
      end if
      call warn(slip_warning(simulation, error))
      ! error over speed of the wall = 2 tolerance a/I = 2 tolerance load/(rate d), measured
      if (scales%shear .and. scales%load > 0.0_dp .and. solver%criterion == "residual") then
        most = error_share*scales%rate*d/(2.0_dp*scales%load)
        if (solver%tolerance > most) call warn("&solver tolerance = "//figure(solver%tolerance)// &
          & ": solves leave errors of about "//figure(error_share*solver%tolerance/most)//" of the speed of '"// &
          & simulation%decomposition%boundaries(scales%driver)%name//"' in shear at I = "//figure(scales%inertial_number())// &
          & "; at most "//figure(most)//" would do, or a smaller &time step")
      end if
    end associate

  contains

    subroutine warn_step(why, most)
      character(len=*), intent(in) :: why
      !> [s]
      real(dp), intent(in) :: most
      call warn("&time step = "//figure(simulation%config%time%step)//" s: "//why//"; at most "//figure(most)//" s would do")
    end subroutine warn_step

    !> Nothing where the line is empty.
    subroutine warn(line)
      character(len=*), intent(in) :: line
      if (line == "") return
      text = text//"warning     "//line//newline
      number = number + 1
    end subroutine warn

  end subroutine scale_warnings

  !> That errors of solves are more than a part of the smallest slip scale of a law; else empty.
  function slip_warning(simulation, error) result(text)
    type(simulation_t), intent(in) :: simulation
    !> velocity error that solves may leave to the mean grain [m/s]
    real(dp), intent(in) :: error
    character(len=:), allocatable :: text
    real(dp) :: most

    text = ""
    associate (slip => simulation%physics%laws%slip_scale, solver => simulation%config%solver)
      if (.not. (error > most_of_slip*slip .and. solver%criterion == "velocity_error")) return
      most = most_of_slip*solver%accuracy*slip/error
      text = "&law slip_scale = "//figure(slip)//" m/s: solves may leave errors of "//figure(error)// &
        & " m/s, which take contacts out of their static friction; an accuracy of at most "//figure(most)// &
        & " would do, or a smaller &time step"
    end associate
  end function slip_warning

  !> That a cell is so light that it answers to a change of impulses by more than the contacts themselves, or too heavy; else empty.
  function cell_warning(simulation, diameter) result(text)
    type(simulation_t), intent(in) :: simulation
    !> of the mean grain [m]
    real(dp), intent(in) :: diameter
    character(len=:), allocatable :: text
    real(dp) :: shortest, least
    integer :: k

    text = ""
    associate (drive => simulation%cell_drive, length => simulation%decomposition%period%length)
      if (.not. any(drive%driven)) return
      shortest = huge(shortest)
      do k = 1, simulation%decomposition%nd
        if (any(drive%driven(:, k))) shortest = min(shortest, length(k))
      end do
      least = (diameter/shortest)**2
      text = answer_warning(simulation)
      if (drive%inertia < least) text = "&scene cell_inertia = "//figure(drive%inertia)//": so light a cell moves too far in "// &
        & "an iteration for solves to end; at least (d/L)^2 = "//figure(least)//" would do"
    end associate
  end function cell_warning

  !> The largest stress that a cell is to hold, at any time; 0 where it holds none [Pa, N/m in 2D].
  real(dp) function largest_stress(simulation) result(most)
    type(simulation_t), intent(in) :: simulation
    integer :: k, n

    most = 0.0_dp
    associate (drive => simulation%cell_drive)
      if (any(drive%driven)) most = maxval(abs(drive%stress), mask=drive%driven)
      if (.not. allocated(drive%table%has)) return
      n = cell_components(simulation%decomposition%nd)
      do k = n + 1, 2*n
        if (drive%table%has(k)) most = max(most, maxval(abs(drive%table%value(k, :))))
      end do
    end associate
  end function largest_stress

  !> Time in which the largest of the stresses held gives the slowest component of the cell a rate of one over this time; 0 of a
  !> cell that no stress drives [s].
  real(dp) function answer_time(simulation) result(time)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: longest, volume, most
    integer :: k

    time = 0.0_dp
    most = largest_stress(simulation)
    associate (drive => simulation%cell_drive, length => simulation%decomposition%period%length, nd => simulation%decomposition%nd)
      if (.not. (any(drive%driven) .and. most > 0.0_dp)) return
      longest = 0.0_dp
      volume = 1.0_dp
      do k = 1, nd
        if (any(drive%driven(:, k))) longest = max(longest, length(k))
        volume = volume*length(k)
      end do
      time = longest*sqrt(drive%inertia*simulation%mass/(volume*most))
    end associate
  end function answer_time

  !> That a stress of the cell turns before the cell has answered to it; else empty.
  function answer_warning(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: turn, answers
    integer :: k, n

    text = ""
    associate (drive => simulation%cell_drive)
      if (.not. (any(drive%driven) .and. allocated(drive%table%has))) return
      n = cell_components(simulation%decomposition%nd)
      turn = huge(turn)
      do k = n + 1, 2*n
        if (drive%table%has(k)) turn = min(turn, drive%table%shortest_half_cycle(k))
      end do
      answers = turn/answer_time(simulation)
      if (.not. answers < least_answers) return
      text = "&scene cell_inertia = "//figure(drive%inertia)//": a stress of cell_table turns after "//figure(turn)//" s, "// &
        & figure(answers)//" of the times in which the cell answers, so that contacts bear other stresses than those held and "// &
        & "strains may be wrong; at most "//figure(drive%inertia*(answers/least_answers)**2)//" would do"
    end associate
  end function answer_warning

  !> That steps pass over the ups and downs of a table, the one of which they keep the least part; else empty.
  function table_warning(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: least
    integer :: b

    text = ""
    least = least_kept
    associate (nd => simulation%decomposition%nd)
      call look(simulation%gravity_table, 0, "&scene gravity_table = '"//trim(simulation%config%scene%gravity_table)//"'")
      call look(simulation%cell_drive%table, cell_components(nd), "&scene cell_table = '"// &
        & trim(simulation%config%scene%cell_table)//"'")
      do b = 1, size(simulation%decomposition%boundaries)
        associate (boundary => simulation%decomposition%boundaries(b))
          call look(boundary%drive%table, drive_rates(nd), "boundary '"//boundary%name//"': its table")
        end associate
      end do
    end associate

  contains

    subroutine look(table, n_rates, name)
      type(time_table_t), intent(in) :: table
      !> columns of velocities, spins or rates, which come first
      integer, intent(in) :: n_rates
      character(len=*), intent(in) :: name
      real(dp) :: kept

      if (.not. allocated(table%has)) return
      kept = table%kept_variation(n_rates, simulation%config%time%step, simulation%config%time%steps)
      if (.not. kept < least) return
      least = kept
      text = name//" turns within steps: they keep "//to_text(nint(100.0_dp*kept))// &
        & " % of its ups and downs; a smaller &time step keeps more"
    end subroutine look

  end function table_warning

  !> That steps do not follow an oscillation, the fastest one; else empty.
  function oscillation_warning(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: most
    integer :: b

    text = ""
    most = most_of_period
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        if (.not. boundary%drive%frequency*simulation%config%time%step > most) cycle
        most = boundary%drive%frequency*simulation%config%time%step
        text = "boundary '"//boundary%name//"': a period of its oscillation has "//figure(1.0_dp/most)// &
          & " steps; a &time step of at most "//figure(most_of_period/boundary%drive%frequency)//" s follows it"
      end associate
    end do
  end function oscillation_warning

  !> That the way of grains in a step is too long.
  function fast_warning(simulation, fast, step) result(text)
    type(simulation_t), intent(in) :: simulation
    !> how many
    integer(i8), intent(in) :: fast
    integer, intent(in) :: step
    character(len=:), allocatable :: text

    text = ", or of a boundary towards it, is longer than the radius"
    if (simulation%effects%shapes) text = &
      & ", of an end that turns, or of a boundary towards it, is longer than half of the thickness"
    text = "in step "//to_text(step)//" the way of "//counted(fast, "grain")//text
  end function fast_warning

  !> That the step does not resolve the collisions of the stiffest compliant contacts.
  function spring_warning(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (h => simulation%config%time%step, stiffest => simulation%tally%stiffest)
      text = "&time step = "//figure(h)//" s: h sqrt(k/m) = "//figure(stiffest)//" at the stiffest compliant contact, so that "// &
        & "collisions are not resolved and spring_restitution does not hold; at most "//figure(h*most_by_spring/stiffest)// &
        & " s would do"
    end associate
  end function spring_warning

  pure function pressure_unit(simulation) result(unit)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: unit
    unit = trim(merge(" N/m", " Pa ", simulation%decomposition%nd == 2))
  end function pressure_unit

  !> A number as people write it where that is short.
  function figure(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(value, digits)
  end function figure

end module gravier_scale_report
