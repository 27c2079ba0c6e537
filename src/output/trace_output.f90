!> trace.csv: how the solve of each step came down, a row a check.
module gravier_trace_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: output_t, of_each_step
  use gravier_history_output, only: open_table
  implicit none
  private
  public :: trace_output_t

  type, extends(output_t) :: trace_output_t
    private
    type(csv_writer_t) :: table
    !> the criterion is the error of the impulses, which is known
    logical :: has_error = .false.
  contains
    procedure, nopass :: wanted => trace_output_wanted
    procedure, nopass :: files => trace_output_files
    procedure :: open => trace_output_open
    procedure :: write => trace_output_write
    procedure :: sync => trace_output_sync
    procedure :: finish => trace_output_finish
  end type trace_output_t

contains

  pure logical function trace_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%trace
  end function trace_output_wanted

  pure function trace_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = "trace.csv"
  end function trace_output_files

  subroutine trace_output_open(self, simulation, directory, command, error)
    class(trace_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: header

    associate (unused => command)
    end associate
    self%stage = of_each_step
    self%schedule = schedule_t(every=1)
    self%has_error = simulation%config%solver%criterion == "error"
    header = "step,iteration,residual,velocity_error,jump"
    if (self%has_error) header = header//",error"
    call open_table(self%table, directory, "trace.csv", header, simulation, error)
  end subroutine trace_output_open

  !> Write the rows of a step, on rank 0.
  subroutine trace_output_write(self, simulation, figures, seconds, error)
    class(trace_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    associate (unused => seconds)
    end associate
    if (simulation%comm%rank /= 0) return
    associate (trace => figures%solve%trace)
      do k = 1, figures%solve%n_trace
        call self%table%add(simulation%step)
        call self%table%add(nint(trace(1, k)))
        call self%table%add(trace(2, k))
        call self%table%add(trace(5, k))
        call self%table%add(trace(3, k))
        if (self%has_error) call self%table%add(trace(4, k))
        call self%table%end_row(error)
      end do
    end associate
  end subroutine trace_output_write

  subroutine trace_output_sync(self, error)
    class(trace_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%table%sync(error)
  end subroutine trace_output_sync

  subroutine trace_output_finish(self, error)
    class(trace_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    if (self%table%is_open()) call self%table%close(error)
  end subroutine trace_output_finish

end module gravier_trace_output
