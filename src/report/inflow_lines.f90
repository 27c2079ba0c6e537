!> What the log says of grains that enter: rates that a region cannot hold before a run, the balance of grains and of mass after it.
module gravier_inflow_lines
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_insertion, only: insertion_t, new_grain_t, most_a_step
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: inflow_warnings, entering_lines, population_lines, inflow_doubt

  character(len=*), parameter :: newline = new_line("a")
  !> fraction of a region that grains of about one radius fill which enter it as fast as they find places, in 2D and 3D: measured,
  !> from rest and with a velocity
  real(dp), parameter :: filled(2:3) = [0.45_dp, 0.27_dp]
  !> part of the grains that are owed, and their number, up to which those that wait for a place are no fault
  real(dp), parameter :: few_wait = 0.01_dp
  integer(i8), parameter :: one_waits = 1

contains

  !> Warnings, each a line ended by a newline, and their number: a scene without grains that none enter, masses below that of the
  !> first grain, rates at which grains enter faster than they leave the region, or of more grains than may enter in a step.
  subroutine inflow_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    type(new_grain_t) :: grain
    real(dp) :: rate, stay, most
    integer :: i

    text = ""
    number = 0
    if (simulation%n_grains == 0 .and. .not. simulation%inflow%exists()) then
      number = 1
      text = "warning     the scene has no grain, and no &insertion lets grains in"//newline
    end if
    do i = 1, size(simulation%inflow%insertions)
      associate (insertion => simulation%inflow%insertions(i))
        if (insertion%entered == 0 .and. insertion%most_grains > 0 .and. insertion%is_complete()) then
          number = number + 1
          grain = insertion%grain(1_i8)
          text = text//"warning     &insertion '"//insertion%name//"': no grain enters, since the first one has a mass of "// &
            & to_text(grain%mass, 3)//" kg: a mass above that lets grains in"//newline
          cycle
        end if
        rate = insertion%rate
        if (insertion%mass_rate < huge(1.0_dp)) rate = insertion%mass_rate/insertion%mean_mass()
        if (.not. rate < huge(1.0_dp)) cycle
        if (exceeds_steps(insertion, rate, simulation%physics%h, simulation%config%time%steps)) then
          number = number + 1
          text = text//"warning     &insertion '"//insertion%name//"': "//to_text(rate, 3)//" grains a second are "// &
            & to_text(rate*simulation%physics%h, 3)//" in a step, in which at most "//to_text(most_a_step)// &
            & " of an insertion enter: several insertions or smaller steps let more of them enter"//newline
        end if
        stay = min(mean_stay(insertion, simulation%physics%gravity), simulation%config%time%steps*simulation%physics%h)
        if (.not. stay > 0.0_dp) cycle
        most = filled(insertion%nd)*insertion%volume()/(insertion%radii%mean_volume()*stay)
        if (.not. rate > most .or. most*stay > insertion%most_grains) cycle
        number = number + 1
        text = text//"warning     &insertion '"//insertion%name//"': "//to_text(rate, 3)//" grains a second are more than its "// &
          & "region has places for before those that entered have left it, about "//to_text(most, 3)//" a second: a larger "// &
          & "region or velocity lets them enter"//newline
      end associate
    end do
  end subroutine inflow_warnings

  !> Whether more grains are owed in a step than may enter in one.
  pure logical function exceeds_steps(insertion, rate, step, steps) result(exceeds)
    type(insertion_t), intent(in) :: insertion
    !> of grains [1/s], length of a step [s]
    real(dp), intent(in) :: rate, step
    integer, intent(in) :: steps

    exceeds = rate*step > most_a_step .and. insertion%planned(steps*step) > most_a_step
  end function exceeds_steps

  !> Mean time that grains stay in a region they enter wherever there is a place, if their velocity or gravity takes them out; huge
  !> where neither moves them [s]. T is the time for the whole length. Grains that enter with a constant velocity v find places
  !> where the others come from alone, and stay T. Gravity draws grains that enter at rest apart, so that there are places
  !> everywhere, and the mean of the times from there is 2 T/3. In between, with the speed w after the whole length, it is taken as
  !> T (2 w + v)/(3 w).
  pure real(dp) function mean_stay(insertion, gravity) result(time)
    type(insertion_t), intent(in) :: insertion
    !> [m/s^2]
    real(dp), intent(in) :: gravity(3)
    real(dp) :: way(3), speed, last_speed, along, length

    time = huge(1.0_dp)
    speed = norm2(insertion%velocity)
    way(:) = insertion%velocity
    if (.not. speed > 0.0_dp) way(:) = gravity
    if (.not. norm2(way) > 0.0_dp) return
    way(:) = way/norm2(way)
    length = dot_product(abs(way), insertion%upper - insertion%lower)
    along = max(dot_product(gravity, way), 0.0_dp)
    last_speed = sqrt(speed**2 + 2.0_dp*along*length)
    time = 2.0_dp*length/(speed + last_speed)*(2.0_dp*last_speed + speed)/(3.0_dp*last_speed)
  end function mean_stay

  !> How many grains are to enter, a line each insertion, and the bytes that they take at least.
  function entering_lines(simulation, bytes) result(text)
    type(simulation_t), intent(in) :: simulation
    !> of a grain
    integer(i8), intent(in) :: bytes
    character(len=:), allocatable :: text
    real(dp) :: number
    integer :: i

    text = ""
    do i = 1, size(simulation%inflow%insertions)
      associate (insertion => simulation%inflow%insertions(i))
        number = insertion%planned(simulation%config%time%steps*simulation%physics%h)
        if (number < huge(1.0_dp)) then
          text = text//"  insertion '"//insertion%name//"': about "//to_text(nint(min(number, 1.0e18_dp), i8))// &
            & " grains enter until the end, taking at least "//to_text(int(min(number*bytes/1024.0_dp, 1.0e18_dp), i8) + 1)// &
            & " KiB more of all ranks"//newline
        else
          text = text//"  insertion '"//insertion%name//"': as many grains enter as find places; each takes at least "// &
            & to_text(bytes)//" bytes more"//newline
        end if
      end associate
    end do
  end function entering_lines

  !> The balance of free grains and of their mass, and how each insertion kept its rate; nothing in scenes that
  !> grains neither enter nor leave.
  function population_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer(i8) :: entered
    integer :: i

    text = ""
    if (.not. (simulation%inflow%exists() .or. simulation%effects%removal)) return
    entered = simulation%inflow%entered()
    text = "grains      "//to_text(simulation%n_grains - simulation%n_glued + simulation%left - entered)//" at the start + "// &
      & to_text(entered)//" entered - "//to_text(simulation%left)//" left = "//to_text(simulation%n_grains - simulation%n_glued)// &
      & "; mass "//to_text(simulation%first_mass, 7)//" + "//to_text(simulation%inflow%mass(), 7)//" - "// &
      & to_text(simulation%left_mass, 7)//" = "//to_text(simulation%mass, 7)//" kg"//newline
    do i = 1, size(simulation%inflow%insertions)
      text = text//insertion_line(simulation%inflow%insertions(i), simulation%time)//newline
    end do
  end function population_lines

  !> What an insertion has let in, and what it owes.
  function insertion_line(insertion, time) result(text)
    type(insertion_t), intent(in) :: insertion
    !> [s]
    real(dp), intent(in) :: time
    character(len=:), allocatable :: text
    integer(i8) :: grains
    real(dp) :: mass

    text = "insertion   '"//insertion%name//"': "//counted(insertion%entered, "grain")//" of "//to_text(insertion%mass, 7)// &
      & " kg entered"
    grains = insertion%grains_behind(time)
    mass = insertion%mass_behind(time)
    if (grains > 0) then
      text = text//", *** "//to_text(grains)//" fewer than its rate owes: "//why_behind(insertion, "they")
    else if (mass > 0.0_dp) then
      text = text//", *** "//to_text(mass, 3)//" kg less than its rate owes: "//why_behind(insertion, "grains")
    else if (insertion%is_complete()) then
      if (insertion%entered >= insertion%most_grains) then
        text = text//", its count is reached"
      else
        text = text//", its mass has room for no other grain"
      end if
    else if (insertion%rate < huge(1.0_dp) .or. insertion%mass_rate < huge(1.0_dp)) then
      text = text//", as many as its rate asks for"
    end if
    if (insertion%put_off > 0) text = text//"; grains were put off in "//counted(insertion%put_off, "step")
    if (insertion%held_back > 0) text = text//"; more than "//to_text(most_a_step)//" were to enter in "// &
      & counted(insertion%held_back, "step")
    if (insertion%most_grains < huge(1_i8) .and. insertion%entered < insertion%most_grains) text = text//"; "//to_text( &
      & insertion%most_grains - insertion%entered)//" of its count of "//to_text(insertion%most_grains)//" are still to enter"
  end function insertion_line

  !> That grains which rates owe have not entered, for the last words of a log, of the insertions that lack more than a few; empty
  !> where none does.
  function inflow_doubt(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer(i8) :: behind, owed, missing
    integer :: i

    text = ""
    behind = 0
    owed = 0
    do i = 1, size(simulation%inflow%insertions)
      associate (insertion => simulation%inflow%insertions(i))
        missing = insertion%grains_behind(simulation%time) + &
          & nint(insertion%mass_behind(simulation%time)/insertion%mean_mass(), i8)
        if (missing <= one_waits .or. missing <= few_wait*(missing + insertion%entered)) cycle
        behind = behind + missing
        owed = owed + missing + insertion%entered
      end associate
    end do
    if (behind == 0) return
    text = "; "//to_text(behind)//" of the "//to_text(owed)//" grains that rates of insertions owe have not entered"
  end function inflow_doubt

  !> What keeps an insertion from its rate: full regions, the most that may enter in a step, or both.
  pure function why_behind(insertion, they) result(text)
    type(insertion_t), intent(in) :: insertion
    !> the grains
    character(len=*), intent(in) :: they
    character(len=:), allocatable :: text

    text = they//" found no place"
    if (insertion%held_back == 0) return
    if (insertion%put_off == 0) text = ""
    if (text /= "") text = text//", and "
    text = text//"at most "//to_text(most_a_step)//" enter in a step"
  end function why_behind

end module gravier_inflow_lines
