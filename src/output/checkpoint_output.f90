!> checkpoint.h5, from which a run goes on. What tables and results hold by then is on the disk before it.
module gravier_checkpoint_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_file_system, only: remove_file
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_checkpoint, only: save_checkpoint, checkpoint_name
  use gravier_output, only: output_t, of_checkpoints
  implicit none
  private
  public :: checkpoint_output_t

  type, extends(output_t) :: checkpoint_output_t
    private
    character(len=:), allocatable :: path
  contains
    procedure, nopass :: wanted => checkpoint_output_wanted
    procedure, nopass :: files => checkpoint_output_files
    procedure :: open => checkpoint_output_open
    procedure :: write => checkpoint_output_write
  end type checkpoint_output_t

contains

  !> Every run may be asked for one by a signal or by its time.
  pure logical function checkpoint_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%checkpoint_every >= 0
  end function checkpoint_output_wanted

  pure function checkpoint_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = checkpoint_name
  end function checkpoint_output_files

  subroutine checkpoint_output_open(self, simulation, directory, command, error)
    class(checkpoint_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => command, unused_error => error)
    end associate
    self%stage = of_checkpoints
    self%schedule = schedule_t(every=simulation%config%output%checkpoint_every)
    self%path = directory//checkpoint_name
    ! what is begun now must not go on from the checkpoint of another run
    if (simulation%comm%rank == 0 .and. .not. simulation%restarted) call remove_file(self%path)
  end subroutine checkpoint_output_open

  subroutine checkpoint_output_write(self, simulation, figures, seconds, error)
    class(checkpoint_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => figures, unused_seconds => seconds)
    end associate
    call save_checkpoint(simulation, self%path, error)
  end subroutine checkpoint_output_write

end module gravier_checkpoint_output
