!> What every output of a run is: a file, or a few that belong together, with a schedule of its own.
module gravier_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  implicit none
  private
  public :: output_t, after_solve, of_each_step, of_states, of_checkpoints, of_end

  !> The stage of a step at which an output is written, in their order: once the step is solved, whether it is kept or not; as a row
  !> of a step that is kept; as a state, which is also that of the start and of the end; between two steps; once the run is over and
  !> its last state is kept.
  integer, parameter :: after_solve = 1, of_each_step = 2, of_states = 3, of_checkpoints = 4, of_end = 5

  type, abstract :: output_t
    !> one of the constants above, and the steps in which it is due there; both from `open` on
    integer :: stage = of_states
    type(schedule_t) :: schedule
    !> step written last, -1: none; no step is written twice
    integer :: last = -1
  contains
    procedure(wanted_interface), deferred, nopass :: wanted
    procedure(files_interface), deferred, nopass :: files
    procedure(open_interface), deferred :: open
    procedure(write_interface), deferred :: write
    procedure :: sync => output_sync
    procedure :: finish => output_finish
  end type output_t

  abstract interface
    !> Whether an input asks for it.
    pure logical function wanted_interface(config)
      import :: config_t
      implicit none
      type(config_t), intent(in) :: config
    end function wanted_interface

    !> The names of the files that it has in the output directory, with commas between.
    pure function files_interface(config) result(names)
      import :: config_t
      implicit none
      type(config_t), intent(in) :: config
      character(len=:), allocatable :: names
    end function files_interface

    !> Create the files in the output directory or, where the simulation is restarted, go on with those that are there: what they
    !> hold of later steps goes. It sets stage and schedule even after an error, which is the same on all ranks. Rank 0 may fail
    !> alone. Collective.
    subroutine open_interface(self, simulation, directory, command, error)
      import :: output_t, simulation_t, error_t
      implicit none
      class(output_t), intent(inout) :: self
      type(simulation_t), intent(in) :: simulation
      !> with a slash at its end; the command line of the program
      character(len=*), intent(in) :: directory, command
      type(error_t), allocatable, intent(inout) :: error
    end subroutine open_interface

    !> Write the present step; without effect after an error, which is the same on all ranks. Rank 0 may fail alone. Collective.
    subroutine write_interface(self, simulation, figures, seconds, error)
      import :: output_t, simulation_t, step_figures_t, error_t, dp
      implicit none
      class(output_t), intent(inout) :: self
      !> nothing of its motion is changed
      type(simulation_t), intent(inout) :: simulation
      !> of the step, and its wall time [s]; defaults at the start
      type(step_figures_t), intent(in) :: figures
      real(dp), intent(in) :: seconds
      type(error_t), allocatable, intent(inout) :: error
    end subroutine write_interface
  end interface

contains

  !> Bring what a checkpoint counts on to the disk, before one is written. By default nothing. Rank 0 may fail alone. Collective.
  subroutine output_sync(self, error)
    class(output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    associate (unused_self => self, unused => error)
    end associate
  end subroutine output_sync

  !> Close the files; called also after an error, and for files that could not be opened. By default nothing. Collective.
  subroutine output_finish(self, error)
    class(output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    associate (unused_self => self, unused => error)
    end associate
  end subroutine output_finish

end module gravier_output
