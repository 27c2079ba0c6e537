!> A whole run: from the path of an input file to files of results and an exit status.
module gravier_run
  use, intrinsic :: iso_fortran_env, only: error_unit
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: reset_timers
  use gravier_file_system, only: make_directory, check_readable
  use gravier_solve, only: solve_converged, solve_diverged
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_run_log, only: run_log_t
  use gravier_run_output, only: run_output_t
  implicit none
  private
  public :: run_case, check_case, read_config, report_error

contains

  !> Run a case. Everything that can be refused is refused before a file is touched. Collective.
  subroutine run_case(comm, path, command, status, error)
    type(communicator_t), target, intent(in) :: comm
    !> of the input file
    character(len=*), intent(in) :: path
    !> the command line, for the record
    character(len=*), intent(in) :: command
    !> status_ok, or status_unconverged where a solve missed its tolerance
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(simulation_t) :: simulation
    type(run_log_t) :: log
    type(run_output_t) :: output

    status = status_ok
    call reset_timers()
    call log%init(comm)
    call read_config(comm, path, config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    if (.not. allocated(error)) call prepare_directory(comm, config, error)
    if (allocated(error)) return
    call log%write_start(simulation, error)
    call log%write_head(error)
    call log%open(trim(config%output%directory)//"/run.log", error)
    call comm%agree(error)
    call output%open(simulation, command, error)
    if (.not. allocated(error)) call run_steps(simulation, log, output, status, error)
    call log%close(error)
    call simulation%free()
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

    call log%init(comm)
    call read_config(comm, path, config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    if (allocated(error)) return
    call log%write_start(simulation, error)
    call simulation%assemble(figures)
    call log%write_interface(figures, error)
    call log%write_memory(simulation, figures, error)
    call log%line("checked     no error found; nothing was run", error)
    call simulation%free()
  end subroutine check_case

  !> Read the input file on rank 0 and parse it on all. Collective; errors are the same on all ranks.
  subroutine read_config(comm, path, config, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    text = ""
    if (comm%rank == 0) call read_text(path, text, error)
    call comm%agree(error)
    if (allocated(error)) return
    call comm%broadcast_text(text, 0)
    call parse_config(path, text, config, error)
    call comm%agree(error)
  end subroutine read_config

  !> The whole of a file as text.
  subroutine read_text(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(inout) :: text
    type(error_t), allocatable, intent(inout) :: error
    integer :: unit, length, stat

    call check_readable(path, error)
    if (allocated(error)) return
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=stat)
    if (stat == 0) then
      inquire (unit=unit, size=length)
      if (allocated(text)) deallocate (text)
      allocate (character(len=max(length, 0)) :: text)
      if (length > 0) read (unit, iostat=stat) text
      close (unit)
    end if
    if (stat /= 0) call raise(error, status_input, path//": cannot read this file; expected a text file of namelist groups")
  end subroutine read_text

  !> Make the output directory, or say why it cannot be used. Collective.
  subroutine prepare_directory(comm, config, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason

    if (comm%rank == 0) then
      call make_directory(trim(config%output%directory), reason)
      if (allocated(reason)) call raise(error, status_input, config%file//": &output directory = '"// &
        & trim(config%output%directory)//"': expected a directory that can be written to: "//reason%message)
    end if
    call comm%agree(error)
  end subroutine prepare_directory

  !> The time loop. Collective.
  subroutine run_steps(simulation, log, output, status, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    type(run_output_t), intent(inout) :: output
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: figures
    real(dp) :: start, step_start
    !> of a last line that cannot be written after an error
    type(error_t), allocatable :: unsaid
    integer :: failed
    logical :: keep_last, ends

    start = MPI_Wtime()
    failed = 0
    keep_last = .true.
    ends = .false.
    if (simulation%config%output%every > 0) call output%write_state(simulation, error)
    do while (simulation%step < simulation%config%time%steps .and. .not. ends .and. .not. allocated(error))
      step_start = MPI_Wtime()
      call simulation%advance(figures, error)
      if (allocated(error)) exit
      if (figures%solve%status /= solve_converged) failed = failed + 1
      call log%write_step(simulation, figures, MPI_Wtime() - step_start, error)
      if (simulation%step == 1) call log%write_interface(figures, error)
      call judge(simulation, figures, ends, keep_last)
      if (keep_last) call write_step(simulation, figures, MPI_Wtime() - step_start, output, error)
      call simulation%comm%agree(error)
    end do
    if (allocated(error)) keep_last = .false.
    call output%finish(simulation, keep_last, error)
    if (allocated(error)) then
      call log%line("stopped     *** by an error after "//to_text(simulation%step)//" steps; results until then in "// &
        & trim(simulation%config%output%directory), unsaid)
      return
    end if
    call log%write_end(simulation, MPI_Wtime() - start, error)
    if (failed > 0) status = status_unconverged
    call write_verdict(simulation, log, failed, keep_last, error)
    call simulation%comm%agree(error)
  end subroutine run_steps

  !> What a step that failed leads to, as on_failure says. A step that diverged is never kept.
  subroutine judge(simulation, figures, ends, keep)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    logical, intent(out) :: ends, keep

    ends = .false.
    keep = .true.
    if (figures%solve%status == solve_converged) return
    ends = simulation%config%solver%on_failure /= "continue" .or. figures%solve%status == solve_diverged
    keep = simulation%config%solver%on_failure /= "discard" .and. figures%solve%status /= solve_diverged
  end subroutine judge

  subroutine write_step(simulation, figures, seconds, output, error)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(run_output_t), intent(inout) :: output
    type(error_t), allocatable, intent(inout) :: error

    call output%write_row(simulation, figures, seconds, figures%solve%status == solve_converged, error)
    if (simulation%config%output%every == 0) return
    if (mod(simulation%step, simulation%config%output%every) == 0) call output%write_state(simulation, error)
  end subroutine write_step

  !> The last word: did it converge, and where are the results.
  subroutine write_verdict(simulation, log, failed, kept, error)
    type(simulation_t), intent(in) :: simulation
    type(run_log_t), intent(inout) :: log
    integer, intent(in) :: failed
    logical, intent(in) :: kept
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    text = "finished    all "//to_text(simulation%step)//" steps reached the tolerance"
    if (failed > 0) text = "finished    *** "//to_text(failed)//" of the steps did NOT reach the tolerance"
    if (.not. kept) text = text//"; the last one is not in the results"
    call log%line(text//"; results in "//trim(simulation%config%output%directory), error)
  end subroutine write_verdict

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
