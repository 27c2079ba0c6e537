!> What the log says of a sample before a run: that nobody has prepared it.
module gravier_sample_lines
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: sample_warnings

contains

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

end module gravier_sample_lines
