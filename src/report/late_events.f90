!> What the log says of events that have their time: boundaries that are removed, and those that a run ends before, insertions that
!> begin and boundaries that are removed only after its end, grains that have fallen below all boundaries, and forces to start from.
module gravier_late_events
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text, counted
  use gravier_given_impulses, only: started_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: late_warnings, removal_lines, fallen_warning, forces_line

  character(len=*), parameter :: newline = new_line("a")
  !> part of a step that roundings of times take
  real(dp), parameter :: rounded = 1.0e-6_dp

contains

  !> Warnings, each a line ended by a newline, and their number.
  subroutine late_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    !> of the last step [s]
    real(dp) :: end
    integer :: i

    text = ""
    number = 0
    end = simulation%time + (simulation%config%time%steps - simulation%step)*simulation%physics%h
    do i = 1, size(simulation%inflow%insertions)
      associate (insertion => simulation%inflow%insertions(i))
        if (insertion%start >= end .and. end > simulation%time) call warn("&insertion", insertion%name, "start", insertion%start, &
          & "grains enter")
      end associate
    end do
    do i = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(i))
        ! it goes with the first step that begins then
        if (boundary%remove_at > end - (1.0_dp - rounded)*simulation%physics%h .and. boundary%remove_at < huge(end) .and. &
          & end > simulation%time) call warn("&boundary", boundary%name, "remove_at", boundary%remove_at, "it is removed")
      end associate
    end do

  contains

    subroutine warn(group, name, key, value, event)
      character(len=*), intent(in) :: group, name, key
      !> [s]
      real(dp), intent(in) :: value
      !> what does not happen
      character(len=*), intent(in) :: event

      number = number + 1
      text = text//"warning     "//group//" '"//name//"': "//key//" = "//to_text(value, 6)//" s, and the run ends at "// &
        & to_text(end, 6)//" s, before "//event//newline
    end subroutine warn

  end subroutine late_warnings

  !> What a run started from where the bodies file gives contacts with forces.
  function forces_line(started, yields) result(text)
    type(started_t), intent(in) :: started
    !> some contacts have springs, whose forces follow from their overlaps
    logical, intent(in) :: yields
    character(len=:), allocatable :: text
    integer(i8) :: per_mille

    ! rounded down, so that 100.0 are all
    per_mille = int(1000.0_dp*started%share*(1.0_dp + epsilon(1.0_dp)), i8)
    text = "start       from forces of the bodies file: "//to_text(started%matched)//" of its "//to_text(started%given)// &
      & " contacts touch in the first step, with "//to_text(per_mille/10)//"."//to_text(mod(per_mille, 10_i8))// &
      & " % of its normal forces"
    if (yields) text = text//"; springs press by their overlaps"
  end function forces_line

  !> The boundaries that were removed at the start of the last step, each a line ended by a newline.
  function removal_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    !> start of the last step [s]
    real(dp) :: start
    integer :: b

    text = ""
    start = simulation%time - (1.0_dp - rounded)*simulation%physics%h
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        if (boundary%remove_at > start .or. boundary%remove_at <= start - simulation%physics%h) cycle
        text = text//"removed     boundary '"//boundary%name//"' at the start of step "//to_text(simulation%step)//newline
      end associate
    end do
  end function removal_lines

  !> That grains have fallen below all boundaries.
  function fallen_warning(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    associate (fallen => simulation%fallen)
      text = "warning     "//counted(fallen%number, "grain")//trim(merge(" has ", " have", fallen%number == 1))// &
        & " fallen below all boundaries by step "//to_text(simulation%step)//", grain "//to_text(fallen%first)// &
        & trim(merge("           ", " among them", fallen%number == 1))// &
        & ": no boundary there stops a grain, and one of shape 'outlet' would remove it"
    end associate
  end function fallen_warning

end module gravier_late_events
