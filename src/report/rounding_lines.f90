!> What the log says where numbers cannot hold a scene: places so far from the origin that motion is rounded away.
module gravier_rounding_lines
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_boundary_drive, only: drives_velocity
  use gravier_accuracy_lines, only: plain
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: rounding_warnings

  character(len=*), parameter :: newline = new_line("a")
  !> part of the way of a step that rounding of places may be
  real(dp), parameter :: most_rounded = 1.0e-3_dp

contains

  !> Warnings, each a line ended by a newline, and their number. A body moves in two halves of a step. Rounding makes each half
  !> wrong by up to half of the spacing of numbers at its place, so that a step is wrong by up to this spacing over its length. The
  !> errors have one sign as long as the velocity stays the same. The velocities looked at are the velocity scale and the constant
  !> velocities of boundaries. Collective.
  subroutine rounding_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    real(dp) :: far, place(3)
    integer :: s, b, d

    text = ""
    number = 0
    far = 0.0_dp
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        if (owned%n > 0) far = max(far, maxval(abs(owned%position(:, 1:owned%n))))
      end associate
    end do
    far = simulation%comm%highest(far)
    call look_at(far, simulation%velocity_scale%value, "bodies")
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        call boundary%find_place(place)
        ! along an axis that a table or forces move there is no constant
        do d = 1, simulation%decomposition%nd
          if (boundary%drive%gives(drives_velocity, d) .or. boundary%free(d)) cycle
          call look_at(abs(place(d)), abs(boundary%drive%velocity(d)), "&boundary '"//boundary%name//"'")
        end do
      end associate
    end do

  contains

    subroutine look_at(far, speed, who)
      !> largest coordinate [m], and [m/s]
      real(dp), intent(in) :: far, speed
      character(len=*), intent(in) :: who
      real(dp) :: way

      way = speed*simulation%physics%h
      if (.not. spacing(far) > most_rounded*way .or. .not. way > 0.0_dp) return
      number = number + 1
      text = text//"warning     "//who//" at "//to_text(far, 3)//" m: numbers there are "//to_text(spacing(far), 2)// &
        & " m apart, and a step at "//to_text(speed, 3)//" m/s is "//to_text(way, 3)// &
        & " m: rounding changes such motion by up to "//plain(100.0_dp*min(1.0_dp, spacing(far)/way))// &
        & " %; put the origin nearer to the scene"//newline
    end subroutine look_at

  end subroutine rounding_warnings

end module gravier_rounding_lines
