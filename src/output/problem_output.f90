!> step_N.hdf5: the contact problem of one step, whether it was solved well or not.
module gravier_problem_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_schedule, only: schedule_t
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_problem_dump, only: write_problem
  use gravier_output, only: output_t, after_solve
  implicit none
  private
  public :: problem_output_t

  type, extends(output_t) :: problem_output_t
    private
    character(len=:), allocatable :: directory
  contains
    procedure, nopass :: wanted => problem_output_wanted
    procedure, nopass :: files => problem_output_files
    procedure :: open => problem_output_open
    procedure :: write => problem_output_write
  end type problem_output_t

contains

  pure logical function problem_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%fclib_step > 0
  end function problem_output_wanted

  pure function problem_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    names = ""
    if (config%output%fclib_step > 0) names = name_of(config%output%fclib_step)
  end function problem_output_files

  !> The file of a step.
  pure function name_of(step) result(name)
    integer, intent(in) :: step
    character(len=:), allocatable :: name
    name = "step_"//to_text(step)//".hdf5"
  end function name_of

  subroutine problem_output_open(self, simulation, directory, command, error)
    class(problem_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => command, unused_error => error)
    end associate
    self%stage = after_solve
    self%schedule = schedule_t(at=simulation%config%output%fclib_step)
    self%directory = directory
  end subroutine problem_output_open

  subroutine problem_output_write(self, simulation, figures, seconds, error)
    class(problem_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => figures, unused_seconds => seconds)
    end associate
    call write_problem(simulation, self%directory//name_of(simulation%step), error)
  end subroutine problem_output_write

end module gravier_problem_output
