!> A whole run: from the path of an input file to files of results and an exit status.
module gravier_run
  use, intrinsic :: iso_fortran_env, only: error_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_config, only: config_t
  use gravier_read_case, only: read_config
  use gravier_restart, only: restart_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_scale_report, only: fast_warning
  use gravier_scene_scales, only: scene_scales_t
  use gravier_start_overlap, only: check_start_overlap
  use gravier_memory_report, only: peak_memory
  use gravier_run_log, only: run_log_t
  use gravier_open_run, only: open_run_t
  use gravier_output_files, only: check_paths, check_origins
  implicit none
  private
  public :: run_case, check_case, report_error

contains

  !> Run a case. Everything that can be refused is refused before a file is touched. Collective.
  subroutine run_case(comm, path, command, restart, status, error)
    type(communicator_t), target, intent(in) :: comm
    !> of the input file
    character(len=*), intent(in) :: path
    !> the command line, for the record
    character(len=*), intent(in) :: command
    type(restart_t), intent(in) :: restart
    !> status_ok, or status_unconverged where a solve missed its tolerance
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(open_run_t) :: run

    call run%begin(comm, path, command, restart, error)
    do while (run%goes_on())
      if (allocated(error)) exit
      call run%step(error)
    end do
    call run%finish(error)
    status = run%status
  end subroutine run_case

  !> Read and check a case, and say what a run would do. Nothing is written to disk. Collective.
  subroutine check_case(comm, path, error)
    type(communicator_t), target, intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(run_log_t) :: log
    type(scene_scales_t) :: scales
    !> held before there was a scene [MiB]
    real(dp) :: libraries
    integer :: warnings

    call log%init(comm)
    call read_config(comm, path, config, error)
    call check_paths(comm, config, error)
    call check_origins(comm, config, "", error)
    libraries = peak_memory()
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    call check_start_overlap(simulation, error)
    if (allocated(error)) return
    call log%write_start(simulation, error)
    call scales%find(simulation)
    call simulation%assemble(figures)
    call log%write_events(simulation, figures, error)
    call log%write_interface(figures, simulation%decomposition%n_subdomains, error)
    call log%write_scales(simulation, scales, .true., warnings, error)
    if (figures%fast > 0) then
      call log%line("warning     "//fast_warning(simulation, figures%fast, 1), error)
      warnings = warnings + 1
    end if
    call log%write_memory(simulation, libraries, error)
    select case (warnings)
    case (0)
      call log%line("checked     no error found; nothing was run", error)
    case (1)
      call log%line("checked     no error found, 1 warning; nothing was run", error)
    case default
      call log%line("checked     no error found, "//to_text(warnings)//" warnings; nothing was run", error)
    end select
    call simulation%free()
  end subroutine check_case

  !> Print the one line of an error, on rank 0, to the standard error.
  subroutine report_error(comm, error)
    type(communicator_t), intent(in) :: comm
    type(error_t), intent(in) :: error
    if (comm%rank /= 0) return
    write (error_unit, "(a)") "gravier: error: "//error%message
    ! another rank that leaves with an error status makes the launcher end this one: nothing may wait in a buffer
    flush (error_unit)
  end subroutine report_error

end module gravier_run
