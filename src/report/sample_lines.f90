!> What the log says of the grains of a scene before a run: of a sample, that nobody has prepared it; of those of a bodies file,
!> that they have other masses than the case says; of those that nothing holds, that they fall.
module gravier_sample_lines
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_config_laws, only: density_of
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: grain_warnings

  !> part of a density by which masses of a file may differ from it
  real(dp), parameter :: of_masses = 0.01_dp
  !> digits of a density
  integer, parameter :: digits = 3

contains

  !> Warnings, each a line ended by a newline, and their number.
  subroutine grain_warnings(simulation, densities, text, number)
    type(simulation_t), intent(in) :: simulation
    !> of the materials by the masses of a bodies file (materials, at least one), 0 where it gives none [kg/m^3, kg/m^2 in 2D]
    real(dp), intent(in) :: densities(:)
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    character(len=:), allocatable :: of_density, of_fall
    integer :: more(2)

    call sample_warnings(simulation, text, number)
    call density_warnings(simulation, densities, of_density, more(1))
    call falling_warnings(simulation, of_fall, more(2))
    text = text//of_density//of_fall
    number = number + sum(more)
  end subroutine grain_warnings

  !> A warning, a line ended by a newline, and the number of warnings: a sample that is to be prepared, which gravier_sample does
  !> and a run does not.
  subroutine sample_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number

    text = ""
    number = 0
    associate (config => simulation%config)
      if (config%scene%bodies /= "sample" .or. config%sample%preparation == "none" .or. simulation%step > 0) return
      number = 1
      text = "warning     &sample preparation = '"//trim(config%sample%preparation)//"': gravier_sample prepares grains, and "// &
        & "a run of gravier starts from them as they are placed; make their file by gravier_sample, and start from it with "// &
        & "&scene bodies = 'file'"//new_line("a")
    end associate
  end subroutine sample_warnings

  !> Warnings, each a line ended by a newline, and their number: densities of the case that have no effect, because the bodies file
  !> gives masses, which are those of others.
  subroutine density_warnings(simulation, found, text, number)
    type(simulation_t), intent(in) :: simulation
    !> densities of the materials by the masses of a bodies file (materials, at least one), 0 where it gives none
    !> [kg/m^3, kg/m^2 in 2D]
    real(dp), intent(in) :: found(:)
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    character(len=:), allocatable :: key
    integer :: i

    text = ""
    number = 0
    associate (config => simulation%config)
      do i = 1, size(found)
        if (.not. (found(i) > 0.0_dp .and. abs(found(i) - density_of(config, i)) > of_masses*density_of(config, i))) cycle
        key = ""
        if (config%scene%has_density) key = "&scene"
        if (size(config%materials) > 0) then
          if (config%materials(i)%density_given) key = "&material '"//trim(config%materials(i)%name)//"'"
        end if
        if (key == "") cycle
        number = number + 1
        text = text//"warning     "//key//" density = "//to_text(density_of(config, i), digits)//" has no effect: the bodies "// &
          & "file gives masses, which are those of a density of "//to_text(found(i), digits)//new_line("a")
      end do
    end associate
  end subroutine density_warnings

  !> A warning, a line ended by a newline, and the number of warnings: the scene repeats itself along gravity and has no boundary,
  !> so that all grains fall together, without an end.
  subroutine falling_warnings(simulation, text, number)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable, intent(out) :: text
    integer, intent(out) :: number
    character(len=*), parameter :: axes = "xyz"
    integer :: d, nd

    text = ""
    number = 0
    associate (scene => simulation%config%scene)
      nd = scene%dimension
      if (size(simulation%decomposition%boundaries) > 0 .or. scene%gravity_table /= "") return
      do d = 1, nd
        if (.not. (scene%period(d) > 0.0_dp .and. abs(scene%gravity(d)) > 0.0_dp)) cycle
        number = 1
        text = "warning     nothing holds the grains against gravity along "//axes(d:d)//", where the scene is periodic and "// &
          & "has no boundary: all of them fall together. &scene gravity = "//trim(merge("0, 0   ", "0, 0, 0", nd == 2))// &
          & " switches gravity off"//new_line("a")
        return
      end do
    end associate
  end subroutine falling_warnings

end module gravier_sample_lines
