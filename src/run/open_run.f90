!> A run that is under way: what it begins with, its steps one by one, and its end. The program makes all steps; a loop of the
!> user's own (gravier_user_loop) may change the scene between two of them.
module gravier_open_run
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
  use gravier_own_files, only: check_own_files, forget_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_load_areas, only: check_load_areas
  use gravier_solve_report, only: solve_converged, solve_diverged
  use gravier_config, only: config_t
  use gravier_read_case, only: read_config
  use gravier_restart, only: restart_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_scene_scales, only: scene_scales_t
  use gravier_start_overlap, only: check_start_overlap
  use gravier_checkpoint, only: load_checkpoint, checkpoint_name
  use gravier_run_log, only: run_log_t
  use gravier_run_summary, only: verdict_text
  use gravier_accuracy_lines, only: goal_name
  use gravier_output, only: after_solve, of_each_step, of_states, of_checkpoints
  use gravier_run_output, only: run_output_t
  use gravier_output_files, only: check_paths, check_origins, refuse_directory, older_files, own_files
  use gravier_run_end, only: has_ended, end_line
  implicit none
  private
  public :: open_run_t

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

  type :: open_run_t
    type(simulation_t) :: simulation
    !> of the last step
    type(step_figures_t) :: figures
    !> from `finish` on: status_ok, status_unconverged where a solve missed its tolerance, status_failure where the run was
    !> interrupted
    integer :: status = status_ok
    type(run_log_t), private :: log
    type(run_output_t), private :: output
    type(interruption_t), private :: interruption
    type(output_lock_t), private :: lock
    !> the scene is made, so that there is a log; the files of the run are open
    logical, private :: is_made = .false., is_open = .false.
    !> the last step is one to keep; the run ends by a step that failed
    logical, private :: keep_last = .true., ends = .false.
    !> why the caller has stopped it
    character(len=:), allocatable, private :: stop_reason
  contains
    procedure :: begin => open_run_begin
    procedure :: goes_on => open_run_goes_on
    procedure :: step => open_run_step
    procedure :: tell => open_run_tell
    procedure :: write_checkpoint => open_run_write_checkpoint
    procedure :: stop => open_run_stop
    procedure :: finish => open_run_finish
  end type open_run_t

contains

  !> Make a scene and open the files of its run. Everything that can be refused is refused before a file is touched. `finish` must
  !> follow, after an error too. Errors are the same on all ranks. Collective.
  subroutine open_run_begin(self, comm, path, command, restart, error, quiet)
    class(open_run_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    !> of the input file
    character(len=*), intent(in) :: path
    !> the command line, for the record
    character(len=*), intent(in) :: command
    type(restart_t), intent(in) :: restart
    type(error_t), allocatable, intent(inout) :: error
    !> the log goes to its file alone
    logical, intent(in), optional :: quiet
    type(config_t) :: config
    type(body_set_t), allocatable :: grains
    character(len=:), allocatable :: older

    self%interruption%start = MPI_Wtime()
    call catch_signals()
    call reset_timers()
    call self%log%init(comm, quiet)
    call read_config(comm, path, config, error)
    call check_paths(comm, config, error)
    if (.not. restart%asked) call check_origins(comm, config, "", error)
    allocate (grains)
    if (.not. allocated(error)) call self%simulation%make(comm, config, grains, error)
    ! a restart reads what another run may still write, a run that begins may be refused before there is a directory
    if (restart%asked) call claim_directory(comm, config, command, self%lock, error)
    if (.not. allocated(error)) call start(self%simulation, grains, restart, error)
    if (restart%asked .and. .not. allocated(error)) call check_origins(comm, config, self%simulation%files, error)
    ! what they took is for the steps
    deallocate (grains)
    if (.not. restart%asked) call claim_directory(comm, config, command, self%lock, error)
    if (allocated(error)) return
    self%is_made = .true.
    older = ""
    if (comm%rank == 0 .and. .not. self%simulation%restarted) older = older_files(config)
    ! files of an older run may be refused, before the log says anything
    call self%output%open(self%simulation, command, error)
    if (allocated(error)) return
    call self%simulation%note_files(own_files(config))
    call write_beginning(self%simulation, self%log, restart%asked, self%lock%unknown, older, error)
    if (allocated(error)) return
    self%is_open = .true.
    self%interruption%first_step = MPI_Wtime()
    self%interruption%last_checkpoint = self%interruption%first_step
    if (.not. self%simulation%restarted) then
      call self%output%write(of_states, self%simulation, self%figures, 0.0_dp, error)
    else if (is_over(self)) then
      call self%log%line("warning     no step is left to make: what the solve of a step gives (contacts and their forces, "// &
        & "diagnostics, VTK, FCLIB) is not written anew", error)
      call comm%agree(error)
    end if
  end subroutine open_run_begin

  !> Whether there is a step to make. The same on all ranks.
  logical function open_run_goes_on(self) result(goes_on)
    class(open_run_t), intent(in) :: self

    goes_on = self%is_open .and. .not. (self%ends .or. self%interruption%stops)
    if (goes_on) goes_on = .not. is_over(self)
  end function open_run_goes_on

  !> Write lines into the log. Errors are the same on all ranks. Collective.
  subroutine open_run_tell(self, lines, error)
    class(open_run_t), intent(inout) :: self
    !> each with its newline
    character(len=*), intent(in) :: lines
    type(error_t), allocatable, intent(inout) :: error

    call write_lines(self%log, lines, error)
    call self%simulation%comm%agree(error)
  end subroutine open_run_tell

  !> Write lines into a log.
  subroutine write_lines(log, lines, error)
    type(run_log_t), intent(inout) :: log
    !> each with its newline
    character(len=*), intent(in) :: lines
    type(error_t), allocatable, intent(inout) :: error
    integer :: first, last

    first = 1
    do while (first <= len(lines))
      last = first + index(lines(first:), new_line("a")) - 2
      call log%line(lines(first:last), error)
      first = last + 2
    end do
  end subroutine write_lines

  !> Make one step and write what is due then. After an error, which is the same on all ranks, the run is to be finished.
  !> Collective.
  subroutine open_run_step(self, error)
    class(open_run_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: step_start

    step_start = MPI_Wtime()
    associate (simulation => self%simulation, figures => self%figures, log => self%log)
      call check_load_areas(simulation%decomposition, error)
      call simulation%advance(figures, error, watch=log)
      if (allocated(error)) return
      call simulation%fallen%note_step(simulation%step, simulation%decomposition, simulation%physics, &
        & allocated(simulation%gravity_table%has))
      call log%write_events(simulation, figures, error)
      call log%write_step(simulation, figures, MPI_Wtime() - step_start, error)
      if (allocated(figures%cause)) call log%line("            *** "//figures%cause, error)
      if (simulation%step == 1) call log%write_interface(figures, simulation%decomposition%n_subdomains, error)
      if (figures%solve%status /= solve_diverged) call self%output%write(after_solve, simulation, figures, 0.0_dp, error)
      call judge(self)
      if (self%keep_last) call self%output%write(of_each_step, simulation, figures, MPI_Wtime() - step_start, error)
      ! the last state comes before the last checkpoint
      if (self%keep_last) call self%output%write(of_states, simulation, figures, 0.0_dp, error, always=has_ended(simulation))
      call simulation%comm%agree(error)
      if (.not. self%ends .and. .not. allocated(error)) call attend(self, error)
    end associate
  end subroutine open_run_step

  !> Write a checkpoint now. Errors are the same on all ranks. Collective.
  subroutine open_run_write_checkpoint(self, error)
    class(open_run_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: now

    now = MPI_Wtime()
    call self%output%write(of_checkpoints, self%simulation, self%figures, 0.0_dp, error, always=.true.)
    associate (interruption => self%interruption)
      interruption%last_checkpoint = MPI_Wtime()
      interruption%dearest = max(interruption%dearest, interruption%last_checkpoint - now)
      if (.not. allocated(error)) call self%log%line("checkpoint  of step "//to_text(self%simulation%step)//" written in "// &
        & to_text(interruption%last_checkpoint - now, 3)//" s", error)
      call self%simulation%comm%agree(error)
      interruption%last_step = MPI_Wtime()
    end associate
  end subroutine open_run_write_checkpoint

  !> End a run after the present step, with its last state and checkpoint written as at the end that a rule of &time brings. Without
  !> effect once the run is over. Errors are the same on all ranks. Collective.
  subroutine open_run_stop(self, reason, error)
    class(open_run_t), intent(inout) :: self
    !> for the log
    character(len=*), intent(in) :: reason
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (.not. self%goes_on()) return
    self%stop_reason = reason
    call self%output%write(of_states, self%simulation, self%figures, 0.0_dp, error, always=.true.)
    if (.not. allocated(error)) call attend(self, error)
  end subroutine open_run_stop

  !> End a run: write what belongs to its end, close its files, and say how it went. A run that might go on is stopped first.
  !> Errors are the same on all ranks. Collective.
  subroutine open_run_finish(self, error)
    class(open_run_t), intent(inout) :: self
    !> of a step, or of the beginning; else what happens now
    type(error_t), allocatable, intent(inout) :: error

    if (self%is_open) then
      call self%stop("its loop has ended", error)
      call conclude(self, error)
    else if (self%is_made) then
      call self%output%finish(self%simulation, .false., error)
    end if
    if (self%is_made) then
      call self%log%close(error)
      call self%simulation%comm%agree(error)
      call self%simulation%free()
    end if
    self%is_made = .false.
    self%is_open = .false.
    call self%lock%release()
    call forget_own_files()
  end subroutine open_run_finish

  !> Close the outputs, and say in the log what became of the run. Collective.
  subroutine conclude(self, error)
    type(open_run_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    !> of a last line that cannot be written after an error
    type(error_t), allocatable :: unsaid

    associate (simulation => self%simulation, log => self%log, interruption => self%interruption)
      if (allocated(error)) self%keep_last = .false.
      call self%output%finish(simulation, self%keep_last .and. .not. interruption%stops, error)
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
      if (self%figures%contacts > 0 .and. simulation%step > 1) call log%write_interface(self%figures, &
        & simulation%decomposition%n_subdomains, error)
      call simulation%fallen%look(simulation%decomposition, simulation%physics, allocated(simulation%gravity_table%has))
      call log%write_end(simulation, MPI_Wtime() - interruption%first_step, error)
      if (has_ended(simulation)) then
        call log%line(end_line(simulation), error)
      else if (allocated(self%stop_reason)) then
        call log%line("ended       after step "//to_text(simulation%step)//" of "//to_text(simulation%config%time%steps)//": "// &
          & self%stop_reason, error)
      end if
      if (simulation%failed > 0 .or. simulation%spot_checks%refute()) self%status = status_unconverged
      if (interruption%stops) then
        self%status = status_failure
        call log%line("interrupted *** "//interruption%reason//" after step "//to_text(simulation%step)//" of "// &
          & to_text(simulation%config%time%steps)//"; gravier --restart goes on from "// &
          & trim(simulation%config%output%directory)//"/"//checkpoint_name, error)
      else
        call write_verdict(simulation, log, self%keep_last, error)
      end if
      call simulation%comm%agree(error)
    end associate
  end subroutine conclude

  !> What the log begins with, and the file that it goes to. Collective.
  subroutine write_beginning(simulation, log, restart, unlocked, older, error)
    type(simulation_t), intent(inout) :: simulation
    type(run_log_t), intent(inout) :: log
    !> whether this was asked for; whether nothing keeps others out of the directory
    logical, intent(in) :: restart, unlocked
    !> files of an older run, on rank 0; empty where there are none
    character(len=*), intent(in) :: older
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
    if (older /= "") call log%line("warning     "//directory//" holds files of an older run, which stay as they are: "// &
      & older, error)
    if (restart) call log%write_restart(simulation, error)
    call write_lines(log, simulation%changes, error)
    if (simulation%set_before /= "") call log%line("warning     a loop had set: "//simulation%set_before// &
      & ". What the case has instead acts from here on, until it is set again", error)
    call log%write_head(error)
    call log%open(directory//"/run.log", simulation%restarted, error)
    call simulation%comm%agree(error)
  end subroutine write_beginning

  !> Share the grains of the scene out, or take the state of the checkpoint that the output directory holds. Collective.
  subroutine start(simulation, grains, restart, error)
    type(simulation_t), intent(inout) :: simulation
    type(body_set_t), intent(in) :: grains
    type(restart_t), intent(in) :: restart
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: path
    logical :: exists

    path = trim(simulation%config%output%directory)//"/"//checkpoint_name
    exists = .false.
    if (restart%asked .and. simulation%comm%rank == 0) inquire (file=path, exist=exists)
    if (simulation%comm%any_true(exists)) then
      call load_checkpoint(simulation, path, restart%accepts, error)
      simulation%given = given_contacts_t()
    else
      call simulation%start(grains, error)
      call check_start_overlap(simulation, error)
    end if
  end subroutine start

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
      if (allocated(reason)) call refuse_directory(config, reason, error)
    end if
    call comm%agree(error)
    call lock%take_directory(comm, trim(config%output%directory), command, error)
  end subroutine claim_directory

  !> Whether all steps are made, the caller has stopped the run, or a rule of &time ends it.
  logical function is_over(self)
    class(open_run_t), intent(in) :: self

    is_over = self%simulation%step >= self%simulation%config%time%steps .or. allocated(self%stop_reason)
    if (.not. is_over) is_over = has_ended(self%simulation)
  end function is_over

  !> Between two steps: write a checkpoint where one is due by steps, by time, by SIGUSR1, at the end, or because the run
  !> has to stop by SIGTERM or for want of time. Collective.
  subroutine attend(self, error)
    class(open_run_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: asked(3), requests
    logical :: stops, due
    real(dp) :: now

    call take_signals(stops, requests)
    requests = self%simulation%comm%largest(requests)
    now = MPI_Wtime()
    associate (config => self%simulation%config%output, interruption => self%interruption)
      ! clocks of ranks differ: what one of them finds counts for all
      asked(:) = 0
      if (stops) asked(1) = 1
      if (config%checkpoint_seconds > 0.0_dp .and. now - interruption%last_checkpoint >= config%checkpoint_seconds) asked(2) = 1
      interruption%longest = max(interruption%longest, now - interruption%last_step)
      if (config%walltime > 0.0_dp .and. now - interruption%start + time_to_stop(interruption) >= config%walltime) asked(3) = 1
      interruption%last_step = now
      call self%simulation%comm%sum_counts(asked)
      due = asked(2) > 0 .or. requests > interruption%answered
      interruption%answered = requests
      due = due .or. self%output%due(of_checkpoints, self%simulation%step)
      if (is_over(self)) then
        ! one that may be prolonged
        due = due .or. config%checkpoint_every > 0 .or. config%checkpoint_seconds > 0.0_dp .or. config%walltime > 0.0_dp
      else if (asked(1) > 0) then
        interruption%reason = "by SIGTERM"
      else if (asked(3) > 0) then
        interruption%reason = "at the walltime of "//to_text(config%walltime, 4)//" s"
      end if
      interruption%stops = allocated(interruption%reason)
      if (due .or. interruption%stops) call self%write_checkpoint(error)
    end associate
  end subroutine attend

  !> Time that one more step, a checkpoint and the end of the run may take [s].
  pure real(dp) function time_to_stop(interruption) result(seconds)
    type(interruption_t), intent(in) :: interruption
    seconds = 2.0_dp*interruption%longest + 2.0_dp*interruption%dearest + 1.0_dp
  end function time_to_stop

  !> What a step that failed leads to, as on_failure says. A step that diverged is never kept.
  subroutine judge(self)
    type(open_run_t), intent(inout) :: self

    associate (solve => self%figures%solve, on_failure => self%simulation%config%solver%on_failure)
      self%ends = .false.
      self%keep_last = .true.
      if (solve%status == solve_converged) return
      self%ends = on_failure /= "continue" .or. solve%status == solve_diverged
      self%keep_last = on_failure /= "discard" .and. solve%status /= solve_diverged
    end associate
  end subroutine judge

  !> The last word: did it converge, are the results those of the law, and where are they.
  subroutine write_verdict(simulation, log, kept, error)
    type(simulation_t), intent(in) :: simulation
    type(run_log_t), intent(inout) :: log
    logical, intent(in) :: kept
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    if (simulation%fast > 0) call log%line("warning     "//to_text(simulation%fast)// &
      & " times a grain, or a boundary towards it, moved by more than "// &
      & trim(merge("half of its thickness", "its radius           ", simulation%effects%shapes))// &
      & " in a step, and may have passed through something: use a smaller &time step", error)
    if (simulation%largest_overlap/worth_a_warning > simulation%overlap_allowed) then
      text = "the solves leave errors that add up; use a smaller &time step or &solver "//goal_name(simulation)
      ! a contact that sends bodies back begins at the first overlap that a step finds
      if (simulation%effects%restitution) &
        & text = "bodies that rebound overlap by up to their way in a step before they do, and "//text
      if (simulation%largest_overlap <= simulation%tally%start_overlap) text = "there were as large ones in the middle of "// &
        & "the first step, which come from the places and the velocities of the start"
      call log%line("warning     overlaps of up to "//to_text(simulation%largest_overlap, 3)//" m, far beyond the "// &
        & "overlap_allowed of "//to_text(simulation%overlap_allowed, 3)//" m: "//text, error)
    end if
    text = "finished    "//verdict_text(simulation)
    if (.not. kept) text = text//"; the last one is not in the results"
    call log%line(text//"; results in "//trim(simulation%config%output%directory), error)
  end subroutine write_verdict

end module gravier_open_run
