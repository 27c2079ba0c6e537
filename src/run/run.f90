!> A whole run: from the path of an input file to files of results and an exit status.
module gravier_run
  use, intrinsic :: iso_fortran_env, only: error_unit
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_ok, status_input, status_unconverged, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_signals, only: catch_signals, take_signals
  use gravier_timers, only: reset_timers
  use gravier_body_store, only: body_set_t
  use gravier_given_contacts, only: given_contacts_t
  use gravier_file_system, only: make_directory
  use gravier_input_text, only: read_input_text
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_solve, only: solve_converged, solve_diverged
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_scene_scales, only: scene_scales_t
  use gravier_start_overlap, only: check_start_overlap
  use gravier_checkpoint, only: load_checkpoint, checkpoint_name
  use gravier_memory_report, only: peak_memory
  use gravier_run_log, only: run_log_t
  use gravier_run_summary, only: verdict_text
  use gravier_accuracy_lines, only: goal_name
  use gravier_output, only: after_solve, of_each_step, of_states, of_checkpoints
  use gravier_run_output, only: run_output_t
  use gravier_run_end, only: has_ended, end_line
  implicit none
  private
  public :: run_case, check_case, read_config, read_input, report_error

  !> times overlap_allowed: an overlap that is no longer one of rounding and tolerance
  real(dp), parameter :: worth_a_warning = 5.0_dp

  !> When a run began and what made it stop early.
  type :: interruption_t
    !> on the clock of this rank: of the program, of the first step, of the last checkpoint, of the end of the last step [s]
    real(dp) :: start = 0.0_dp, first_step = 0.0_dp, last_checkpoint = 0.0_dp, last_step = huge(1.0_dp)
    !> requests by SIGUSR1 that checkpoints have answered
    integer(i8) :: answered = 0
    !> longest step and longest checkpoint so far [s]
    real(dp) :: longest = 0.0_dp, dearest = 0.0_dp
    logical :: stops = .false.
    character(len=:), allocatable :: reason
  end type interruption_t

contains

  !> Run a case. Everything that can be refused is refused before a file is touched. Collective.
  subroutine run_case(comm, path, command, restart, status, error)
    type(communicator_t), target, intent(in) :: comm
    !> of the input file
    character(len=*), intent(in) :: path
    !> the command line, for the record
    character(len=*), intent(in) :: command
    !> go on from the checkpoint in the output directory, if there is one
    logical, intent(in) :: restart
    !> status_ok, or status_unconverged where a solve missed its tolerance
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(simulation_t) :: simulation
    type(body_set_t), allocatable :: grains
    type(run_log_t) :: log
    type(run_output_t) :: output
    type(interruption_t) :: interruption
    type(output_lock_t) :: lock

    status = status_ok
    interruption%start = MPI_Wtime()
    call catch_signals()
    call reset_timers()
    call log%init(comm)
    call read_config(comm, path, config, error)
    allocate (grains)
    if (.not. allocated(error)) call simulation%make(comm, config, grains, error)
    ! a restart reads what another run may still write, a run that begins may be refused before there is a directory
    if (restart) call claim_directory(comm, config, command, lock, error)
    if (.not. allocated(error)) call start(simulation, grains, restart, error)
    ! what they took is for the steps
    deallocate (grains)
    if (.not. restart) call claim_directory(comm, config, command, lock, error)
    if (.not. allocated(error)) then
      call write_beginning(simulation, log, restart, lock%unknown, error)
      call output%open(simulation, command, error)
      if (allocated(error)) then
        call output%finish(simulation, .false., error)
      else
        call run_steps(simulation, log, output, interruption, status, error)
      end if
      call log%close(error)
      call simulation%free()
    end if
    call lock%release()
  end subroutine run_case

  !> What the log begins with, and the file that it goes to. Collective.
  subroutine write_beginning(simulation, log, restart, unlocked, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    !> whether this was asked for; whether nothing keeps others out of the directory
    logical, intent(in) :: restart, unlocked
    type(error_t), allocatable, intent(inout) :: error
    type(scene_scales_t) :: scales
    character(len=:), allocatable :: directory
    integer :: warnings

    directory = trim(simulation%config%output%directory)
    call log%write_start(simulation, error)
    call scales%find(simulation)
    call log%write_scales(simulation, scales, .false., warnings, error)
    if (unlocked) call log%line("warning     the file system of "//directory// &
      & " keeps no locks: a second run there is not refused", error)
    if (restart) call log%write_restart(simulation, error)
    call log%write_head(error)
    call log%open(directory//"/run.log", simulation%restarted, error)
    call simulation%comm%agree(error)
  end subroutine write_beginning

  !> Share the grains of the scene out, or take the state of the checkpoint that the output directory holds. Collective.
  subroutine start(simulation, grains, restart, error)
    type(simulation_t), intent(inout) :: simulation
    type(body_set_t), intent(in) :: grains
    logical, intent(in) :: restart
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: path
    logical :: exists

    path = trim(simulation%config%output%directory)//"/"//checkpoint_name
    exists = .false.
    if (restart .and. simulation%comm%rank == 0) inquire (file=path, exist=exists)
    if (simulation%comm%any_true(exists)) then
      call load_checkpoint(simulation, path, error)
      simulation%given = given_contacts_t()
    else
      call simulation%start(grains, error)
      call check_start_overlap(simulation, error)
    end if
  end subroutine start

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
    libraries = peak_memory()
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    call check_start_overlap(simulation, error)
    if (allocated(error)) return
    call log%write_start(simulation, error)
    call scales%find(simulation)
    call simulation%assemble(figures)
    call log%write_started(figures, error)
    call log%write_interface(figures, simulation%decomposition%n_subdomains, error)
    call log%write_scales(simulation, scales, .true., warnings, error)
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

  !> Read the input file on rank 0 and parse it on all. Collective; errors are the same on all ranks.
  subroutine read_config(comm, path, config, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    call read_input(comm, path, text, error)
    if (allocated(error)) return
    call parse_config(path, text, config, error)
    call comm%agree(error)
  end subroutine read_config

  !> The whole of a file as text, on all ranks. Collective; errors are the same on all ranks.
  subroutine read_input(comm, path, text, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(inout) :: error

    call read_input_text(comm, path, text, error)
  end subroutine read_input

  !> Make the output directory and take its lock, or say why it cannot be used. Collective.
  subroutine claim_directory(comm, config, command, lock, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: command
    type(output_lock_t), intent(inout) :: lock
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason

    if (allocated(error)) return
    if (comm%rank == 0) then
      call make_directory(trim(config%output%directory), reason)
      if (allocated(reason)) call raise(error, status_input, config%file//": &output directory = '"// &
        & trim(config%output%directory)//"': expected a directory that can be written to: "//reason%message)
    end if
    call comm%agree(error)
    call lock%take_directory(comm, trim(config%output%directory), command, error)
  end subroutine claim_directory

  !> The time loop. Collective.
  subroutine run_steps(simulation, log, output, interruption, status, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    type(run_output_t), intent(inout) :: output
    !> its start is known
    type(interruption_t), intent(inout) :: interruption
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: figures
    real(dp) :: step_start
    !> of a last line that cannot be written after an error
    type(error_t), allocatable :: unsaid
    logical :: keep_last, ends

    interruption%first_step = MPI_Wtime()
    interruption%last_checkpoint = interruption%first_step
    keep_last = .true.
    ends = .false.
    if (.not. simulation%restarted) call output%write(of_states, simulation, figures, 0.0_dp, error)
    do while (.not. is_over(simulation) .and. .not. ends .and. .not. allocated(error))
      step_start = MPI_Wtime()
      call simulation%advance(figures, error, watch=log)
      if (allocated(error)) exit
      call log%write_started(figures, error)
      call log%write_step(simulation, figures, MPI_Wtime() - step_start, error)
      if (allocated(figures%cause)) call log%line("            *** "//figures%cause, error)
      if (simulation%step == 1) call log%write_interface(figures, simulation%decomposition%n_subdomains, error)
      if (figures%solve%status /= solve_diverged) call output%write(after_solve, simulation, figures, 0.0_dp, error)
      call judge(simulation, figures, ends, keep_last)
      if (keep_last) call output%write(of_each_step, simulation, figures, MPI_Wtime() - step_start, error)
      ! the last state comes before the last checkpoint
      if (keep_last) call output%write(of_states, simulation, figures, 0.0_dp, error, always=has_ended(simulation))
      call simulation%comm%agree(error)
      if (.not. ends .and. .not. allocated(error)) call attend(simulation, figures, log, output, interruption, error)
      if (interruption%stops) exit
    end do
    if (allocated(error)) keep_last = .false.
    call output%finish(simulation, keep_last .and. .not. interruption%stops, error)
    if (allocated(error)) then
      call log%line("stopped     *** by an error after "//to_text(simulation%step)//" steps; results until then in "// &
        & trim(simulation%config%output%directory), unsaid)
      return
    end if
    if (simulation%comm%rank == 0) call check_own_files(error)
    call simulation%comm%agree(error)
    if (allocated(error)) then
      call log%line("lost        *** files of this run in "//trim(simulation%config%output%directory)// &
        & " were replaced or removed", unsaid)
      return
    end if
    if (figures%contacts > 0 .and. simulation%step > 1) call log%write_interface(figures, simulation%decomposition%n_subdomains, &
      & error)
    call log%write_end(simulation, MPI_Wtime() - interruption%first_step, error)
    if (has_ended(simulation)) call log%line(end_line(simulation), error)
    if (simulation%failed > 0) status = status_unconverged
    if (interruption%stops) then
      status = status_failure
      call log%line("interrupted *** "//interruption%reason//" after step "//to_text(simulation%step)//" of "// &
        & to_text(simulation%config%time%steps)//"; gravier --restart goes on from "// &
        & trim(simulation%config%output%directory)//"/"//checkpoint_name, error)
    else
      call write_verdict(simulation, log, keep_last, error)
    end if
    call simulation%comm%agree(error)
  end subroutine run_steps

  !> Whether all steps are made, or a rule of &time ends the run.
  logical function is_over(simulation)
    type(simulation_t), intent(in) :: simulation
    is_over = simulation%step >= simulation%config%time%steps
    if (.not. is_over) is_over = has_ended(simulation)
  end function is_over

  !> Between two steps: write a checkpoint where one is due by steps, by time, by SIGUSR1, at the end, or because the run
  !> has to stop by SIGTERM or for want of time. Collective.
  subroutine attend(simulation, figures, log, output, interruption, error)
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    type(run_log_t), intent(inout) :: log
    type(run_output_t), intent(inout) :: output
    type(interruption_t), intent(inout) :: interruption
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: asked(3), requests
    logical :: stops, due
    real(dp) :: now

    call take_signals(stops, requests)
    requests = simulation%comm%largest(requests)
    now = MPI_Wtime()
    associate (config => simulation%config%output)
      ! clocks of ranks differ: what one of them finds counts for all
      asked(:) = 0
      if (stops) asked(1) = 1
      if (config%checkpoint_seconds > 0.0_dp .and. now - interruption%last_checkpoint >= config%checkpoint_seconds) asked(2) = 1
      interruption%longest = max(interruption%longest, now - interruption%last_step)
      if (config%walltime > 0.0_dp .and. now - interruption%start + time_to_stop(interruption) >= config%walltime) asked(3) = 1
      interruption%last_step = now
      call simulation%comm%sum_counts(asked)
      due = asked(2) > 0 .or. requests > interruption%answered
      interruption%answered = requests
      due = due .or. output%due(of_checkpoints, simulation%step)
      if (is_over(simulation)) then
        ! one that may be prolonged
        due = due .or. config%checkpoint_every > 0 .or. config%checkpoint_seconds > 0.0_dp .or. config%walltime > 0.0_dp
      else if (asked(1) > 0) then
        interruption%reason = "by SIGTERM"
      else if (asked(3) > 0) then
        interruption%reason = "at the walltime of "//to_text(config%walltime, 4)//" s"
      end if
    end associate
    interruption%stops = allocated(interruption%reason)
    if (.not. (due .or. interruption%stops)) return
    call output%write(of_checkpoints, simulation, figures, 0.0_dp, error, always=.true.)
    interruption%last_checkpoint = MPI_Wtime()
    interruption%dearest = max(interruption%dearest, interruption%last_checkpoint - now)
    if (.not. allocated(error)) call log%line("checkpoint  of step "//to_text(simulation%step)//" written in "// &
      & to_text(interruption%last_checkpoint - now, 3)//" s", error)
    interruption%last_step = MPI_Wtime()
  end subroutine attend

  !> Time that one more step, a checkpoint and the end of the run may take [s].
  pure real(dp) function time_to_stop(interruption) result(seconds)
    type(interruption_t), intent(in) :: interruption
    seconds = 2.0_dp*interruption%longest + 2.0_dp*interruption%dearest + 1.0_dp
  end function time_to_stop

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

  !> The last word: did it converge, are the results those of the law, and where are they.
  subroutine write_verdict(simulation, log, kept, error)
    type(simulation_t), intent(in) :: simulation
    type(run_log_t), intent(inout) :: log
    logical, intent(in) :: kept
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    if (simulation%fast > 0) call log%line("warning     "//to_text(simulation%fast)//" times a grain moved by more than its "// &
      & "radius in a step, and may have passed through others: use a smaller &time step", error)
    if (simulation%largest_overlap/worth_a_warning > simulation%overlap_allowed) call log%line("warning     overlaps of up to "// &
      & to_text(simulation%largest_overlap, 3)//" m, far beyond the overlap_allowed of "//to_text(simulation%overlap_allowed, 3)// &
      & " m: the solves leave errors that add up; use a smaller &time step or &solver "//goal_name(simulation), error)
    text = "finished    "//verdict_text(simulation)
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
