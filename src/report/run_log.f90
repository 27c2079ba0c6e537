!> The log of a run: what a person reads, on the terminal and in run.log.
module gravier_run_log
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text, counted, times_text, growing_text_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: n_phases
  use gravier_file_system, only: terminal_width
  use gravier_text_file, only: text_file_t
  use gravier_method, only: work_t
  use gravier_solve_report, only: solve_watch_t, solve_report_t, solve_converged, solve_diverged
  use gravier_config, only: write_active
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_memory_report, only: memory_report_t, report_memory
  use gravier_progress, only: progress_t, duration_text, warn_unconverged, warn_fast, warn_lowered, warn_acceleration, &
    & warn_relaxation, warn_partition, warn_springs, warn_deep, warn_fallen, note_balance, note_scale
  use gravier_scene_scales, only: scene_scales_t
  use gravier_scale_report, only: scale_lines, scale_warnings, error_scale_line, distance_line, most_by_spring, spring_warning, &
    & fast_warning
  use gravier_inflow_lines, only: inflow_warnings, entering_lines, population_lines
  use gravier_cell_lines, only: cell_strain_lines
  use gravier_region_lines, only: region_warnings
  use gravier_late_events, only: late_warnings, removal_lines, fallen_warning, forces_line
  use gravier_rounding_lines, only: rounding_warnings
  use gravier_sample_lines, only: grain_warnings
  use gravier_intact_bonds, only: count_bonds
  use gravier_run_tally, only: relative_error
  use gravier_accuracy_lines, only: accuracy_lines, goal_name
  use gravier_start_lines, only: banner_text, start_lines
  use gravier_step_lines, only: interface_lines, balance_text, failure_text
  use gravier_closing_lines, only: phase_lines, work_lines, cost_lines, summary_lines
  implicit none
  private
  public :: run_log_t

  character(len=*), parameter :: newline = new_line("a")
  !> back to the begin of a line of a terminal, which is wiped out
  character(len=*), parameter :: wipe = achar(13)//achar(27)//"[K"

  !> Lines go to the standard output, and to a file once it is open. On a terminal the steps are one line that changes, and their
  !> lines go to the file alone. On other ranks than 0 nothing is written, but collective calls must still be made there.
  type, extends(solve_watch_t) :: run_log_t
    type(communicator_t), pointer :: comm => null()
    type(text_file_t) :: file
    !> kept until the file is open
    type(growing_text_t), private :: early
    !> how often what is said
    type(progress_t), private :: progress
    !> rank 0 writes to a terminal of so many columns; a live line stands there
    logical, private :: live = .false., line_stands = .false.
    integer, private :: columns = 0
    !> lines go to the file alone
    logical :: quiet = .false.
    !> step that comes next; what its figure is and is compared with
    integer, private :: next_step = 1
    character(len=:), private, allocatable :: figure_name, goal_name
    !> of a line within a solve that could not be written
    type(error_t), private, allocatable :: unwritten
    !> up to the last step
    type(work_t), private :: told
    !> stiffest compliant contact that was warned of, by the product of the step and its frequency
    real(dp), private :: told_stiffest = 0.5_dp*most_by_spring
    !> kind of the velocity scale that was named last
    character(len=20), private :: scale_kind = ""
  contains
    procedure :: init => run_log_init
    procedure :: open => run_log_open
    procedure :: line => run_log_line
    procedure :: write_start => run_log_write_start
    procedure :: write_restart => run_log_write_restart
    procedure :: write_head => run_log_write_head
    procedure :: write_step => run_log_write_step
    procedure :: look => run_log_look
    procedure :: write_events => run_log_write_events
    procedure :: write_interface => run_log_write_interface
    procedure :: write_scales => run_log_write_scales
    procedure :: write_memory => run_log_write_memory
    procedure :: write_end => run_log_write_end
    procedure :: close => run_log_close
  end type run_log_t

contains

  subroutine run_log_init(self, comm, quiet)
    class(run_log_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    !> nothing goes to the standard output
    logical, intent(in), optional :: quiet

    self%comm => comm
    self%early = growing_text_t()
    if (present(quiet)) self%quiet = quiet
    if (comm%rank == 0) self%columns = terminal_width()
    self%live = self%columns > 0 .and. .not. self%quiet
    call self%progress%begin()
  end subroutine run_log_init

  !> Open DIRECTORY/run.log and write into it what was said so far. Rank 0 may fail; the caller makes it known.
  subroutine run_log_open(self, path, continued, error)
    class(run_log_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> go on behind what the file holds
    logical, intent(in) :: continued
    type(error_t), allocatable, intent(inout) :: error

    if (self%comm%rank /= 0) return
    if (continued) then
      call self%file%continue(path, error)
      call self%file%append(self%early%get(), error)
    else
      call self%file%create(path, self%early%get(), error)
    end if
    self%early = growing_text_t()
  end subroutine run_log_open

  subroutine run_log_line(self, text, error)
    class(run_log_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(inout) :: error

    if (self%comm%rank /= 0) return
    call wipe_live_line(self)
    if (.not. self%quiet) then
      write (output_unit, "(a)") text
      flush (output_unit)
    end if
    call note_line(self, text, error)
  end subroutine run_log_line

  !> A line of the file alone.
  subroutine note_line(self, text, error)
    class(run_log_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(inout) :: error

    if (self%comm%rank /= 0) return
    if (self%file%is_open()) then
      call self%file%append(text//newline, error)
    else
      call self%early%add(text//newline)
    end if
  end subroutine note_line

  subroutine wipe_live_line(self)
    class(run_log_t), intent(inout) :: self

    if (.not. self%line_stands) return
    write (output_unit, "(a)", advance="no") wipe
    flush (output_unit)
    self%line_stands = .false.
  end subroutine wipe_live_line

  !> A warning of a kind, `number` times, where one is due.
  subroutine warn(self, kind, number, text, error)
    class(run_log_t), intent(inout) :: self
    integer, intent(in) :: kind
    integer(i8), intent(in) :: number
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: addition
    logical :: say

    call self%progress%warn(kind, number, say, addition)
    if (say) call self%line(text//addition, error)
  end subroutine warn

  !> Lines of a text, each ended by a newline.
  subroutine write_lines(self, text, indent, error)
    class(run_log_t), intent(inout) :: self
    character(len=*), intent(in) :: text, indent
    type(error_t), allocatable, intent(inout) :: error
    integer :: first, last

    first = 1
    do while (first <= len(text))
      last = index(text(first:), newline)
      if (last == 0) last = len(text) - first + 2
      call self%line(indent//text(first:first + last - 2), error)
      first = first + last
    end do
  end subroutine write_lines

  !> Banner, scene, decomposition and the options in force.
  subroutine run_log_write_start(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: options

    self%goal_name = goal_name(simulation)
    self%figure_name = trim(simulation%config%solver%criterion)
    if (self%figure_name == "velocity_error") self%figure_name = "weighted velocity error over U"
    call write_lines(self, banner_text(), "", error)
    call write_lines(self, start_lines(simulation, self%comm%size), "", error)
    call write_active(options, simulation%config)
    call write_lines(self, options, "  ", error)
  end subroutine run_log_write_start

  !> Where a run goes on from.
  subroutine run_log_write_restart(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    self%next_step = simulation%step + 1
    if (simulation%restarted) then
      call self%line("restart     from the checkpoint of step "//to_text(simulation%step), error)
    else
      call self%line("restart     no checkpoint in "//trim(simulation%config%output%directory)//": from the beginning", error)
    end if
  end subroutine run_log_write_restart

  !> Names of the columns of the step lines.
  subroutine run_log_write_head(self, error)
    class(run_log_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%line("    step       time [s]    contacts  iterations   residual  error/scale    overlap [m]  "// &
      & "energy [J]  wall [s]   remaining", error)
  end subroutine run_log_write_head

  !> After each step, the boundaries that were removed at its start; after the first one also how many bonds there are, and what its
  !> solve started from where the bodies file gives contacts with forces. Collective.
  subroutine run_log_write_events(self, simulation, figures, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: bonds

    call write_lines(self, removal_lines(simulation), "", error)
    if (simulation%step == 1 .and. simulation%physics%laws%breaks) then
      bonds = count_bonds(simulation%halo, simulation%decomposition, simulation%physics%laws)
      call self%line("bonds       "//to_text(bonds)//" after the first step", error)
    end if
    if (figures%started%given > 0) call self%line(forces_line(figures%started, simulation%physics%laws%yields), error)
  end subroutine run_log_write_events

  !> Contacts and interface as the partition makes them now.
  subroutine run_log_write_interface(self, figures, subdomains, error)
    class(run_log_t), intent(inout) :: self
    type(step_figures_t), intent(in) :: figures
    integer, intent(in) :: subdomains
    type(error_t), allocatable, intent(inout) :: error
    call write_lines(self, interface_lines(figures, subdomains), "", error)
  end subroutine run_log_write_interface

  !> Warnings where the step or the tolerance cannot hold what the scene is for, and their number; where `lines` are wanted, the
  !> scales of the scene before them, its first step having been assembled.
  subroutine run_log_write_scales(self, simulation, scales, lines, warnings, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(scene_scales_t), intent(in) :: scales
    logical, intent(in) :: lines
    integer, intent(out) :: warnings
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text, more
    integer :: number

    if (lines) call write_lines(self, scale_lines(simulation, scales)//error_scale_line(simulation)// &
      & distance_line(simulation), "", error)
    call scale_warnings(simulation, scales, text, warnings)
    call grain_warnings(simulation, scales%densities, more, number)
    call add()
    call inflow_warnings(simulation, more, number)
    call add()
    call region_warnings(simulation, more, number)
    call add()
    call late_warnings(simulation, more, number)
    call add()
    call rounding_warnings(simulation, more, number)
    call add()
    call write_lines(self, text, "", error)

  contains

    subroutine add()
      text = text//more
      warnings = warnings + number
    end subroutine add

  end subroutine run_log_write_scales

  !> What is kept in memory, array by array, and what a rank holds at most. Collective.
  subroutine run_log_write_memory(self, simulation, libraries, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> held by this rank before there was a scene [MiB]
    real(dp), intent(in) :: libraries
    type(error_t), allocatable, intent(inout) :: error
    type(memory_report_t) :: report
    integer :: k

    call report_memory(simulation, libraries, report)
    call self%line("memory      bytes of each item", error)
    do k = 1, size(report%items)
      associate (item => report%items(k))
        call self%line("  "//to_text(item%bytes)//" a "//item%name//", "//to_text(item%number)//" of them: "//item%arrays, error)
      end associate
    end do
    call self%line("  "//to_text(report%total/1024 + 1)//" KiB in all, "//to_text(report%most/1024 + 1)// &
      & " KiB on the rank with most", error)
    call write_lines(self, entering_lines(simulation, report%items(4)%bytes + report%items(5)%bytes), "", error)
    call self%line("  about "//to_text(nint(report%peak))//" MiB at most on a rank while it runs, with libraries, copies of "// &
      & "what is written and work space of solves", error)
  end subroutine run_log_write_memory

  !> A line of a step where one is due, and what there is to warn of.
  subroutine run_log_write_step(self, simulation, figures, seconds, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    character(len=160) :: row

    if (allocated(self%unwritten)) call move_alloc(self%unwritten, error)
    self%next_step = simulation%step + 1
    call self%progress%note_step(seconds)
    if (figures%solve%status == solve_diverged) then
      call write_recoveries(self, simulation, simulation%step + 1, error)
      call self%line("  *** "//failure_text(simulation, figures), error)
      return
    end if
    if (self%progress%line_due(simulation%step == simulation%config%time%steps)) then
      write (row, "(i8,es15.6,i12,i12,es11.2,es13.2,es15.3,es12.3,f10.3,1x,a11)") simulation%step, simulation%time, &
        & figures%contacts, figures%solve%iterations, figures%solve%residual, relative_error(figures%solve), figures%max_overlap, &
        & figures%kinetic_energy, seconds, remaining_text(self, simulation)
      if (self%live) then
        call note_line(self, trim(row), error)
      else
        call self%line(trim(row), error)
      end if
    end if
    call note_velocity_scale(self, simulation, error)
    call write_warnings(self, simulation, figures, error)
    if (self%live) call write_live_line(self, simulation, figures)
  end subroutine run_log_write_step

  !> Wall time that remains, where the number of steps is known.
  function remaining_text(self, simulation) result(text)
    class(run_log_t), intent(in) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = ""
    if (simulation%config%time%steps >= simulation%step) &
      & text = self%progress%remaining(simulation%config%time%steps - simulation%step)
  end function remaining_text

  !> A line within a long solve, where one is due; see solve_watch_t. On a terminal it takes the place of the live line.
  subroutine run_log_look(self, report)
    class(run_log_t), intent(inout) :: self
    type(solve_report_t), intent(in) :: report
    !> a figure above is of a velocity error that no check has estimated
    real(dp), parameter :: not_estimated = 1.0e100_dp
    character(len=:), allocatable :: text, figure
    real(dp) :: seconds

    if (self%comm%rank /= 0) return
    if (.not. self%progress%solve_line_due(seconds)) return
    figure = to_text(report%figure, 2)
    if (report%figure > not_estimated) figure = "not known"
    text = "step "//to_text(self%next_step)//" is being solved: "//to_text(report%iterations)//" iterations in "// &
      & duration_text(seconds)//", "//self%figure_name//" "//figure//" at the last check, "//self%goal_name// &
      & " "//to_text(report%goal, 2)
    if (self%live) then
      call note_line(self, "            "//text, self%unwritten)
      write (output_unit, "(2a)", advance="no") wipe, text(1:min(len(text), self%columns - 1))
      flush (output_unit)
      self%line_stands = .true.
    else
      call self%line("            "//text, self%unwritten)
    end if
  end subroutine run_log_look

  !> The line on a terminal that changes, where it is due.
  subroutine write_live_line(self, simulation, figures)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    character(len=:), allocatable :: text
    character(len=12) :: time, residual

    if (.not. self%progress%live_due()) return
    write (time, "(es9.3e2)") simulation%time
    write (residual, "(es8.1e2)") figures%solve%residual
    text = "step "//to_text(simulation%step)
    if (simulation%config%time%steps >= simulation%step) text = text//"/"//to_text(simulation%config%time%steps)
    text = text//"  "//trim(adjustl(time))//" s  "//to_text(figures%contacts)//" contacts  "// &
      & to_text(figures%solve%iterations)//" iterations  "//trim(adjustl(residual))
    if (remaining_text(self, simulation) /= "") text = text//"  "//remaining_text(self, simulation)//" remaining"
    write (output_unit, "(2a)", advance="no") wipe, text(1:min(len(text), self%columns - 1))
    flush (output_unit)
    self%line_stands = .true.
  end subroutine write_live_line

  !> Name the velocity that the error of a solve is compared with, after the first step and where another kind has come to rule.
  subroutine note_velocity_scale(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    associate (scale => simulation%velocity_scale)
      if (scale%kind == self%scale_kind) return
      self%scale_kind = scale%kind
      call warn(self, note_scale, 1_i8, "scale       from step "//to_text(simulation%step)//" on velocity errors are "// &
        & "compared with U = "//to_text(scale%value, 3)//" m/s ("//trim(scale%kind)//")", error)
    end associate
  end subroutine note_velocity_scale

  !> What a step has to warn of.
  subroutine write_warnings(self, simulation, figures, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error

    if (figures%divided) call warn(self, note_balance, 1_i8, "balance     "// &
      & balance_text(figures%rank_balance, figures%subdomain_balance)//", until this partition", error)
    if (allocated(figures%refusal)) call warn(self, warn_partition, 1_i8, "warning     space cannot be divided anew, and the "// &
      & "old partition is kept: "//figures%refusal, error)
    if (figures%fast > 0) call warn(self, warn_fast, figures%fast, "warning     "// &
      & fast_warning(simulation, figures%fast, simulation%step), error)
    if (figures%deep%number > 0) call warn(self, warn_deep, figures%deep%number, "warning     "// &
      & counted(figures%deep%number, "contact")// &
      & trim(merge(" overlaps", " overlap ", figures%deep%number == 1))//" by a quarter of a thickness and more in step "// &
      & to_text(simulation%step)//", at most by "// &
      & to_text(0.5_dp*figures%deep%deepest, 2)//" of it: bodies may come out on the other side", error)
    if (simulation%tally%stiffest > 2.0_dp*self%told_stiffest) then
      self%told_stiffest = simulation%tally%stiffest
      call warn(self, warn_springs, 1_i8, "warning     "//spring_warning(simulation), error)
    end if
    if (simulation%fallen%more > 0) call warn(self, warn_fallen, simulation%fallen%more, fallen_warning(simulation), error)
    call write_recoveries(self, simulation, simulation%step, error)
    if (figures%solve%status /= solve_converged) call warn(self, warn_unconverged, 1_i8, "  *** "// &
      & failure_text(simulation, figures)//" in step "//to_text(simulation%step), error)
  end subroutine write_warnings

  !> What a solve did against growth or standstill: the search direction l was lowered, the Nesterov momentum suspended, the
  !> relaxation factor lowered.
  subroutine write_recoveries(self, simulation, step, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: step
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: lowered, suspended, relaxed

    associate (work => simulation%method%work)
      lowered = work%lowered - self%told%lowered
      suspended = work%suspended - self%told%suspended
      relaxed = work%relaxed - self%told%relaxed
      self%told = work
    end associate
    if (lowered > 0) call warn(self, warn_lowered, lowered, &
      & "warning     the changes of the impulses grow or oscillate: search direction l lowered "//times_text(lowered)// &
      & " in step "//to_text(step), error)
    if (suspended > 0) call warn(self, warn_acceleration, suspended, "warning     accelerated sweeps make no progress: "// &
      & "Nesterov momentum suspended "//times_text(suspended)//" in step "//to_text(step), error)
    if (relaxed > 0) call warn(self, warn_relaxation, relaxed, &
      & "warning     the changes of the neighbours' impulses alternate in sign and do not fall: relaxation factor lowered "// &
      & times_text(relaxed)//" in step "//to_text(step), error)
  end subroutine write_recoveries

  !> Closing table: time by phase over the ranks, the work of the solver and the memory over all ranks; then, in words for a person,
  !> warnings, convergence and time. Collective.
  subroutine run_log_write_end(self, simulation, seconds, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> wall time of the run [s]
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: warnings
    real(dp) :: phases(n_phases)

    call write_lines(self, phase_lines(self%comm, seconds, phases), "", error)
    call write_lines(self, work_lines(self%comm, simulation), "", error)
    if (simulation%tally%steps > 0) then
      call write_lines(self, accuracy_lines(simulation), "", error)
      call write_lines(self, cost_lines(self%comm, simulation), "", error)
    end if
    call write_lines(self, population_lines(simulation), "", error)
    call write_lines(self, cell_strain_lines(simulation), "", error)
    warnings = self%progress%warnings()
    if (warnings /= "" .and. simulation%restarted) warnings = warnings//"; those since the restart"
    if (warnings /= "") call self%line("warnings    "//warnings, error)
    call write_lines(self, summary_lines(self%comm, simulation, phases, seconds), "", error)
  end subroutine run_log_write_end

  subroutine run_log_close(self, error)
    class(run_log_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call wipe_live_line(self)
    call self%file%close(error)
  end subroutine run_log_close

end module gravier_run_log
