!> What the log says of regions of means before a run: those in which there is nothing.
module gravier_region_lines
  use gravier_kinds, only: dp
  use gravier_region_means, only: region_means_t, regions_key
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: region_warnings

contains

  !> Warnings, each a line ended by a newline, and their number: regions into which no grain reaches, where none enter either.
  subroutine region_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    integer :: place, r

    text = ""
    number = 0
    place = simulation%diagnostics%place(regions_key)
    if (place == 0 .or. simulation%inflow%exists()) return
    select type (means => simulation%diagnostics%asked(place)%diagnostic)
    type is (region_means_t)
      do r = 1, size(means%region)
        if (means%mass_at_start(r) > 0.0_dp) cycle
        number = number + 1
        text = text//"warning     &region '"//means%region(r)%name//"': no grain reaches into it at the start"//new_line("a")
      end do
    end select
  end subroutine region_warnings

end module gravier_region_lines
