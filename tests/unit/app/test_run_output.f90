!> Outputs of a test's own.
module own_outputs
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_schedule, only: schedule_t
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: output_t, of_states, of_each_step, of_end
  implicit none
  private
  public :: state_output_t, last_output_t, events

  !> what was called, in the order of the calls
  character(len=:), allocatable :: events

  !> Of states, each third step. It fails in step 4.
  type, extends(output_t) :: state_output_t
  contains
    procedure, nopass :: wanted => state_wanted
    procedure, nopass :: files => no_files
    procedure :: open => state_open
    procedure :: write => state_write
    procedure :: finish => state_finish
  end type state_output_t

  !> Of the end; what is not its own is that of every output.
  type, extends(output_t) :: last_output_t
  contains
    procedure, nopass :: wanted => last_wanted
    procedure, nopass :: files => no_files
    procedure :: open => last_open
    procedure :: write => last_write
  end type last_output_t

contains

  pure function no_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = ""
  end function no_files

  pure logical function state_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%time%steps > 0
  end function state_wanted

  subroutine state_open(self, simulation, directory, command, error)
    class(state_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => simulation, unused_error => error)
    end associate
    self%stage = of_states
    self%schedule = schedule_t(every=3)
    events = events//" open("//directory//" "//command//")"
  end subroutine state_open

  subroutine state_write(self, simulation, figures, seconds, error)
    class(state_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => self, unused_figures => figures)
    end associate
    events = events//" write("//to_text(simulation%step)//" "//to_text(nint(seconds))//")"
    if (simulation%step == 4) call raise(error, status_failure, "no room")
  end subroutine state_write

  subroutine state_finish(self, error)
    class(state_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => self, unused_error => error)
    end associate
    events = events//" finish"
  end subroutine state_finish

  !> By title.
  pure logical function last_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%scene%title == "with an end"
  end function last_wanted

  subroutine last_open(self, simulation, directory, command, error)
    class(last_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => simulation, unused_directory => directory, unused_command => command, unused_error => error)
    end associate
    self%stage = of_end
  end subroutine last_open

  subroutine last_write(self, simulation, figures, seconds, error)
    class(last_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => self, unused_figures => figures, unused_seconds => seconds, unused_error => error)
    end associate
    events = events//" end("//to_text(simulation%step)//")"
  end subroutine last_write

end module own_outputs

!> The outputs of a run together: those that are wanted are opened, written when they are due and once a step, and closed.
program test_run_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: after_solve, of_each_step, of_states, of_checkpoints, of_end
  use gravier_output_registry, only: register_output
  use gravier_run_output, only: run_output_t
  use own_outputs, only: state_output_t, last_output_t, events
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call register_output(state_output_t())
  call register_output(last_output_t())
  call test_run("with an end", .true., " write(7 0) end(7) finish")
  call test_run("without an end", .true., " write(7 0) finish")
  call test_run("with an end", .false., " finish")
  call test_failure()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine make(title, simulation, output)
    character(len=*), intent(in) :: title
    type(simulation_t), intent(inout) :: simulation
    type(run_output_t), intent(inout) :: output
    type(config_t) :: config
    type(error_t), allocatable :: error

    call parse_config("case", "&scene title = '"//title//"', bodies = 'column', column_count = 1, radius = 0.5 / "// &
      & "&time step = 0.01, steps = 7 / &output directory = '.', every = 5 /", config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    events = ""
    if (.not. allocated(error)) call output%open(simulation, "the command", error)
    call check(.not. allocated(error), "the outputs are opened")
    if (.not. allocated(error)) return
    print "(a)", error%message
    call finish_checks()
  end subroutine make

  !> Write the outputs of a stage in a step, as a run does.
  subroutine write_step(output, simulation, stage, step, error)
    type(run_output_t), intent(inout) :: output
    type(simulation_t), intent(inout) :: simulation
    integer, intent(in) :: stage, step
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: figures

    simulation%step = step
    events = ""
    call output%write(stage, simulation, figures, real(10*step, dp), error)
  end subroutine write_step

  !> A run of seven steps.
  subroutine test_run(title, keep_last, last_events)
    character(len=*), intent(in) :: title, last_events
    logical, intent(in) :: keep_last
    type(simulation_t) :: simulation
    type(run_output_t) :: output
    type(error_t), allocatable :: error

    call make(title, simulation, output)
    call check_equal(events, " open(./ the command)", "opened in the directory")
    call check(output%due(of_states, 3) .and. output%due(of_states, 5), "states are due where some output wants them")
    call check(.not. output%due(of_states, 4), "and in no other step")
    call check(output%due(of_each_step, 4), "rows are due in each step")
    call check(.not. output%due(after_solve, 3) .and. .not. output%due(of_end, 3), "nobody asked for problems, or for an end")
    call write_step(output, simulation, of_states, 0, error)
    call check_equal(events, " write(0 0)", "the start")
    call write_step(output, simulation, of_each_step, 3, error)
    call check_equal(events, "", "another stage")
    call write_step(output, simulation, of_states, 2, error)
    call check_equal(events, "", "it is not due")
    call write_step(output, simulation, of_states, 3, error)
    call check_equal(events, " write(3 30)", "it is due")
    call write_step(output, simulation, of_states, 3, error)
    call check_equal(events, "", "no step is written twice")
    call write_step(output, simulation, of_checkpoints, 7, error)
    call check(.not. allocated(error), "all is written")
    events = ""
    call output%finish(simulation, keep_last, error)
    call check_equal(events, last_events, "the end of a run "//title)
    call check(.not. allocated(error), "all is closed")
    call simulation%free()
  end subroutine test_run

  !> An output that fails ends no other one: all are closed.
  subroutine test_failure()
    type(simulation_t) :: simulation
    type(run_output_t) :: output
    type(error_t), allocatable :: error

    call make("with an end", simulation, output)
    call write_step(output, simulation, of_states, 4, error)
    call check(.not. allocated(error), "step 4 is not due")
    simulation%step = 4
    call output%write(of_states, simulation, step_figures_t(), 0.0_dp, error, always=.true.)
    call check(allocated(error), "an output fails")
    if (allocated(error)) call check_equal(error%message, "no room", "its words")
    events = ""
    call output%finish(simulation, .false., error)
    call check_equal(events, " finish", "it is closed after an error")
    call check(allocated(error), "the error stays")
    call simulation%free()
  end subroutine test_failure

end program test_run_output
