!> The log of a run: what a person reads, on the terminal and in run.log.
module gravier_run_log
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text, growing_text_t
  use gravier_communicator, only: communicator_t, mpi_library
  use gravier_timers, only: gather_timers, phase_names, n_phases
  use gravier_file_system, only: terminal_width
  use gravier_text_file, only: text_file_t
  use gravier_build_info, only: version, revision, compiler, build_type, hdf5_version, mumps_version, metis_version
  use gravier_effects, only: effects_t, n_effects, effect_name_length
  use gravier_scheme, only: work_t
  use gravier_descent, only: effort_t, tenfold
  use gravier_solve, only: solve_watch_t, solve_report_t, solve_converged, solve_diverged, solve_stagnated, solve_unbounded
  use gravier_config_types, only: solver_config_t
  use gravier_interface, only: interface_figures_t, n_multiplicities
  use gravier_config, only: config_t, write_active
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_memory_report, only: memory_report_t, report_memory, item_bytes, peak_memory
  use gravier_progress, only: progress_t, duration_text, warn_unconverged, warn_fast, warn_lowered, warn_momentum, &
    & warn_relaxation, warn_partition, note_balance, note_scale
  use gravier_scene_scales, only: scene_scales_t
  use gravier_scale_report, only: scale_lines, scale_warnings, error_scale_line
  use gravier_run_summary, only: converged_text, time_text, halving_text
  use gravier_energy_balance, only: energy_balance_t
  use gravier_run_tally, only: relative_error
  use gravier_accuracy_lines, only: accuracy_lines, goal_name
  implicit none
  private
  public :: run_log_t, banner_text

  character(len=*), parameter :: newline = new_line("a")
  !> back to the begin of a line of a terminal, which is wiped out
  character(len=*), parameter :: wipe = achar(13)//achar(27)//"[K"

  !> Lines go to the standard output, and to a file once it is open. On a terminal the steps are one line that changes, and their
  !> lines go to the file alone. On other ranks than 0 nothing is written, but collective calls must still be made there.
  type, extends(solve_watch_t) :: run_log_t
    type(communicator_t), pointer :: comm => null()
    type(text_file_t) :: file
    !> kept until the file is open
    type(growing_text_t) :: early
    !> how often what is said
    type(progress_t) :: progress
    !> rank 0 writes to a terminal of so many columns; a live line stands there
    logical :: live = .false., line_stands = .false.
    integer :: columns = 0
    !> step that comes next; what its figure is and is compared with
    integer :: next_step = 1
    character(len=:), allocatable :: figure_name, goal_name
    !> of a line within a solve that could not be written
    type(error_t), allocatable :: unwritten
    !> up to the last step
    type(work_t) :: told
    !> kind of the velocity scale that was named last
    character(len=20) :: scale_kind = ""
  contains
    procedure :: init => run_log_init
    procedure :: open => run_log_open
    procedure :: line => run_log_line
    procedure :: write_start => run_log_write_start
    procedure :: write_restart => run_log_write_restart
    procedure :: write_head => run_log_write_head
    procedure :: write_step => run_log_write_step
    procedure :: look => run_log_look
    procedure :: write_interface => run_log_write_interface
    procedure :: write_scales => run_log_write_scales
    procedure :: write_memory => run_log_write_memory
    procedure :: write_end => run_log_write_end
    procedure :: close => run_log_close
  end type run_log_t

contains

  subroutine run_log_init(self, comm)
    class(run_log_t), intent(inout) :: self
    type(communicator_t), target, intent(in) :: comm
    self%comm => comm
    self%early = growing_text_t()
    if (comm%rank == 0) self%columns = terminal_width()
    self%live = self%columns > 0
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
    write (output_unit, "(a)") text
    flush (output_unit)
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

  !> Name, version and libraries of the program, in lines.
  function banner_text() result(text)
    character(len=:), allocatable :: text
    text = "Gravier "//version//" ("//revision//"), dense granular matter by nonsmooth contact dynamics"//newline// &
      & "built by "//compiler//", "//build_type//"; "//mpi_library()//", HDF5 "//hdf5_version//", MUMPS "//mumps_version// &
      & ", METIS "//metis_version//newline
  end function banner_text

  !> Banner, scene, decomposition and the options in force.
  subroutine run_log_write_start(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: options

    self%goal_name = goal_name(simulation)
    self%figure_name = trim(simulation%config%solver%criterion)
    if (self%figure_name == "velocity_error") self%figure_name = "velocity error with its weights over U"
    call write_lines(self, banner_text(), "", error)
    associate (config => simulation%config)
      call self%line(trim("case        "//config%file//"  "//config%scene%title), error)
      call self%line("ranks       "//to_text(self%comm%size)//", subdomains "//to_text(simulation%decomposition%n_subdomains)// &
        & " ("//boxes_text(simulation)//", "//trim(config%decomposition%kind)//" rule)", error)
      if (self%comm%size > simulation%decomposition%n_subdomains) call self%line("warning     "// &
        & to_text(self%comm%size - simulation%decomposition%n_subdomains)//" ranks own no subdomain and stay idle", error)
      call self%line("bodies      "//to_text(simulation%n_grains)//" grains, "// &
        & to_text(size(simulation%decomposition%boundaries))//trim(merge(" boundary  ", " boundaries", &
        & size(simulation%decomposition%boundaries) == 1)), error)
      call self%line("effects     "//to_text(config%scene%dimension)//"D: "//effects_text(simulation%effects, .true.), error)
      call self%line("off         "//effects_text(simulation%effects, .false.), error)
      call self%line("unknowns    "//cost_text(simulation), error)
      if (config%solver%sleeping) call self%line("sleeping    contacts of bodies at rest for "// &
        & to_text(config%solver%sleep_after)//" steps leave the sweeps; the residual is that of all contacts", error)
      call self%line("options in force", error)
      call write_active(options, config)
      call write_lines(self, options, "  ", error)
    end associate
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
      & "energy [J]  wall [s]       left", error)
  end subroutine run_log_write_head

  function boxes_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer :: d

    if (simulation%decomposition%partition%n_cells() > 0) then
      text = "METIS on "//to_text(simulation%decomposition%partition%n_cells())//" cells"
      return
    end if
    text = "grid "//to_text(simulation%decomposition%partition%boxes(1))
    do d = 2, simulation%decomposition%nd
      text = text//" x "//to_text(simulation%decomposition%partition%boxes(d))
    end do
  end function boxes_text

  !> Names of the effects that the scene has, or of those that it could have and does not pay for.
  function effects_text(effects, wanted) result(text)
    type(effects_t), intent(in) :: effects
    logical, intent(in) :: wanted
    character(len=:), allocatable :: text
    character(len=effect_name_length) :: names(n_effects)
    logical :: on(n_effects)
    integer :: k

    call effects%list(names, on)
    text = ""
    do k = 1, n_effects
      if (on(k) .eqv. wanted) text = text//", "//trim(names(k))
    end do
    if (text == "") text = ", nothing"
    text = text(3:)
  end function effects_text

  !> What the effects cost.
  function cost_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer(i8) :: contact, body, copy

    call item_bytes(simulation, contact, body, copy)
    associate (kernels => simulation%problem%kernels)
      text = to_text(kernels%nv)//" degrees of freedom a grain, "//to_text(kernels%nc)//" unknowns a contact, "// &
        & to_text(contact)//" bytes a contact, "//to_text(body)//" a body in contact, "//to_text(copy)// &
        & " an exchange and copy of a shared body"
    end associate
  end function cost_text

  !> Contacts and interface as the partition makes them now.
  subroutine run_log_write_interface(self, figures, subdomains, error)
    class(run_log_t), intent(inout) :: self
    type(step_figures_t), intent(in) :: figures
    integer, intent(in) :: subdomains
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text
    integer :: m

    associate (sharing => figures%sharing)
      text = "contacts    "//to_text(figures%contacts)//" ("//to_text(sharing%least_contacts)//" to "// &
        & to_text(sharing%most_contacts)//" a subdomain); interface: "//to_text(sharing%bodies)//" bodies, "// &
        & to_text(sharing%interactions)//" interactions; multiplicity"
      do m = 2, n_multiplicities
        if (sharing%multiplicity(m) == 0) cycle
        text = text//" "//to_text(m)//trim(merge("+", " ", m == n_multiplicities))//": "//to_text(sharing%multiplicity(m))
      end do
      if (sharing%bodies == 0) text = text//" 1 only"
    end associate
    call self%line(text, error)
    if (figures%sharing%neighbours == 0) return
    call self%line("exchange    "//exchange_text(figures%sharing, subdomains), error)
  end subroutine run_log_write_interface

  !> What an exchange of the interface costs a subdomain, whether its neighbours are on other ranks or on its own.
  function exchange_text(sharing, subdomains) result(text)
    type(interface_figures_t), intent(in) :: sharing
    integer, intent(in) :: subdomains
    character(len=:), allocatable :: text

    text = "a subdomain sends "//tenths(real(sharing%neighbours, dp)/subdomains)//" messages (at most "// &
      & to_text(sharing%most_neighbours)//") with "//to_text(8*sharing%values/subdomains)//" bytes (at most "// &
      & to_text(8*sharing%most_values)//") an iteration, and "//to_text(sharing%ghosts/subdomains)//" ghosts a step"
  end function exchange_text

  !> A number of moderate size with one decimal.
  function tenths(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=16) :: row

    write (row, "(f16.1)") value
    text = trim(adjustl(row))
  end function tenths

  !> Warnings where the step or the tolerance cannot hold what the scene is for, and their number; where `lines` are wanted, the
  !> scales of the scene before them, its first step having been assembled.
  subroutine run_log_write_scales(self, simulation, scales, lines, warnings, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(scene_scales_t), intent(in) :: scales
    logical, intent(in) :: lines
    integer, intent(out) :: warnings
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    if (lines) call write_lines(self, scale_lines(simulation, scales)//error_scale_line(simulation), "", error)
    call scale_warnings(simulation, scales, text, warnings)
    call write_lines(self, text, "", error)
  end subroutine run_log_write_scales

  !> What is kept in memory, array by array. Collective.
  subroutine run_log_write_memory(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(memory_report_t) :: report
    integer :: k

    call report_memory(simulation, report)
    call self%line("memory      bytes of each item", error)
    do k = 1, size(report%items)
      associate (item => report%items(k))
        call self%line("  "//to_text(item%bytes)//" a "//item%name//", "//to_text(item%number)//" of them: "//item%arrays, error)
      end associate
    end do
    call self%line("  "//to_text(report%total/1024 + 1)//" KiB in all, "//to_text(report%most/1024 + 1)// &
      & " KiB on the rank with most", error)
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
      write (row, "(i8,es15.6,i12,i12,es11.2,es13.2,es15.3,es12.3,f10.3,a11)") simulation%step, simulation%time, figures%contacts, &
        & figures%solve%iterations, figures%solve%residual, relative_error(figures%solve), figures%max_overlap, &
        & figures%kinetic_energy, seconds, left_text(self, simulation)
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

  !> Time left, where the number of steps is known.
  function left_text(self, simulation) result(text)
    class(run_log_t), intent(in) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text

    text = ""
    if (simulation%config%time%steps >= simulation%step) &
      & text = self%progress%left(simulation%config%time%steps - simulation%step)
  end function left_text

  !> A line within a long solve, where one is due; see solve_watch_t. On a terminal it takes the place of the live line.
  subroutine run_log_look(self, report)
    class(run_log_t), intent(inout) :: self
    type(solve_report_t), intent(in) :: report
    character(len=:), allocatable :: text
    real(dp) :: seconds

    if (self%comm%rank /= 0) return
    if (.not. self%progress%solve_line_due(seconds)) return
    text = "step "//to_text(self%next_step)//" is being solved: "//to_text(report%iterations)//" iterations in "// &
      & duration_text(seconds)//", "//self%figure_name//" "//to_text(report%figure, 2)//" at the last check, "//self%goal_name// &
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
    if (left_text(self, simulation) /= "") text = text//"  "//left_text(self, simulation)//" left"
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
      call warn(self, note_scale, 1_i8, "scale       from step "//to_text(simulation%step)//" on the error of a solve is "// &
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
      & balance_text(figures%rank_balance, figures%subdomain_balance)//" of the mean until this partition", error)
    if (figures%refused) call warn(self, warn_partition, 1_i8, "warning     the grains fill fewer cells than there are "// &
      & "subdomains: the old partition stays", error)
    if (figures%fast > 0) call warn(self, warn_fast, figures%fast, "warning     "//to_text(figures%fast)// &
      & " grains move by more than their radius in step "//to_text(simulation%step), error)
    call write_recoveries(self, simulation, simulation%step, error)
    if (figures%solve%status /= solve_converged) call warn(self, warn_unconverged, 1_i8, "  *** "// &
      & failure_text(simulation, figures)//" in step "//to_text(simulation%step), error)
  end subroutine write_warnings

  !> By what means a solve got over growth or standstill: l lowered, momentum put off, relaxation lowered.
  subroutine write_recoveries(self, simulation, step, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: step
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: lowered, put_off, relaxed

    associate (work => simulation%scheme%work)
      lowered = work%lowered - self%told%lowered
      put_off = work%put_off - self%told%put_off
      relaxed = work%relaxed - self%told%relaxed
      self%told = work
    end associate
    if (lowered > 0) call warn(self, warn_lowered, lowered, &
      & "warning     changes grew or went round in circles under l: lowered "//to_text(lowered)//" times in step "// &
      & to_text(step), error)
    if (put_off > 0) call warn(self, warn_momentum, put_off, "warning     no progress with momentum: put off "// &
      & to_text(put_off)//" times in step "//to_text(step), error)
    if (relaxed > 0) call warn(self, warn_relaxation, relaxed, &
      & "warning     changes of the neighbours' loads alternate and grow: relaxation lowered "//to_text(relaxed)// &
      & " times in step "//to_text(step), error)
  end subroutine write_recoveries

  !> How unevenly sweeps took time.
  function balance_text(ranks, subdomains) result(text)
    !> most over mean seconds of the ranks, and of the subdomains
    real(dp), intent(in) :: ranks, subdomains
    character(len=:), allocatable :: text
    character(len=24) :: row(2)

    write (row, "(f0.3)") ranks, subdomains
    text = "seconds in sweeps: slowest rank "//trim(row(1))//", slowest subdomain "//trim(row(2))
  end function balance_text

  !> What went wrong in a step.
  function failure_text(simulation, figures) result(text)
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    character(len=:), allocatable :: text

    associate (solve => figures%solve, solver => simulation%config%solver)
      if (solve%status == solve_diverged) then
        text = "DIVERGED: step "//to_text(simulation%step + 1)//" after "//to_text(solve%iterations)//" iterations of "// &
          & trim(solver%method)//"; the step is not kept"
      else
        text = "NOT CONVERGED: "//miss_text(solve, solver)//" after "//to_text(solve%iterations)//" iterations of "// &
          & trim(solver%method)
        if (solve%status == solve_stagnated) text = text//"; more iterations gain nothing (stagnation)"
        if (solve%status == solve_unbounded) text = text//"; no solution found: loads grow without bound"
      end if
    end associate
  end function failure_text

  !> What of the criterion a solve has missed.
  function miss_text(solve, solver) result(text)
    type(solve_report_t), intent(in) :: solve
    type(solver_config_t), intent(in) :: solver
    character(len=:), allocatable :: text

    if (solver%criterion == "error") then
      text = "error "//to_text(solve%error, 3)//" above the tolerance "//to_text(solver%tolerance, 3)
    else if (solver%criterion == "residual" .and. solve%status == solve_unbounded .and. solve%residual <= solver%tolerance) then
      text = "impulses larger than any loads can make"
    else if (solver%criterion == "residual" .or. solve%residual > solver%tolerance) then
      text = "residual "//to_text(solve%residual, 3)//" above the tolerance "//to_text(solver%tolerance, 3)
    else if (solve%violation > solve%violation_allowed .and. (solve%status == solve_unbounded .or. &
        & solve%velocity_error <= solver%accuracy*solve%velocity_scale)) then
      text = "a contact violates its law by "//to_text(solve%violation, 3)//" m/s, above "//to_text(solve%violation_allowed, 3)// &
        & " m/s,"
    else if (solve%velocity_error <= solver%accuracy*solve%velocity_scale) then
      ! what sinks, and what moves where the solution is at rest, counts more than in the estimate
      text = "velocity error with its weights "//to_text(solve%figure, 3)//" of U above the accuracy "//to_text(solver%accuracy, 3)
    else
      text = "velocity error "//to_text(solve%velocity_error, 3)//" m/s above "//to_text(solver%accuracy, 3)//" of "// &
        & to_text(solve%velocity_scale, 3)//" m/s"
    end if
  end function miss_text

  !> Closing table: time by phase over the ranks, the work of the solver and the memory over all ranks. Collective.
  subroutine run_log_write_end(self, simulation, seconds, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> wall time of the run [s]
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: mean(n_phases), least(n_phases), most(n_phases)
    character(len=100) :: row
    integer :: p

    call gather_timers(self%comm, mean, least, most)
    call self%line("phase                         mean [s]     min [s]     max [s]   share", error)
    do p = 1, n_phases
      write (row, "(a28,3f12.4,f7.1,' %')") phase_names(p), mean(p), least(p), most(p), 100.0_dp*mean(p)/max(seconds, tiny(seconds))
      call self%line(trim(row), error)
    end do
    write (row, "(a28,f12.4)") "whole run                   ", seconds
    call self%line(trim(row), error)
    call write_work(self, simulation, error)
    call write_accuracy(self, simulation, error)
    call write_summary(self, simulation, mean, seconds, error)
  end subroutine run_log_write_end

  !> In words, for a person: warnings, convergence, time. Collective.
  subroutine write_summary(self, simulation, phases, seconds, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> (n_phases), mean over the ranks, and of the run [s]
    real(dp), intent(in) :: phases(n_phases), seconds
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: warnings
    real(dp) :: iterations(3), looser_seconds(3)
    integer :: k

    iterations(1) = simulation%effort%looser()
    call simulation%effort%looser_range(iterations(2), iterations(3))
    do k = 1, size(iterations)
      looser_seconds(k) = self%comm%highest(simulation%effort%seconds_of(iterations(k)))
    end do
    warnings = self%progress%warnings()
    if (warnings /= "") call self%line("warnings    "//warnings, error)
    if (simulation%effort%solves == 0) return
    call self%line("converged   "//converged_text(simulation), error)
    call self%line("time        "//time_text(phases, seconds, simulation%effort%solves), error)
    call self%line("to halve it "//halving_text(simulation, phases, seconds, looser_seconds), error)
  end subroutine write_summary

  subroutine write_work(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(work_t) :: work
    integer(i8) :: counts(5)
    real(dp) :: ranks, subdomains

    work = simulation%scheme%work_done()
    counts(1) = work%relaxations
    counts(2) = work%analyses
    counts(3) = work%factorisations
    counts(4) = simulation%messages
    counts(5) = simulation%values
    call self%comm%sum_counts(counts)
    call self%line("solver      "//to_text(work%solves)//" solves, "//to_text(work%iterations)//" iterations, "// &
      & to_text(work%sweeps)//" sweeps, "//to_text(counts(1))//" contact relaxations", error)
    call self%line("interface   "//to_text(work%interface_solves)//" exchanges or solves, "//to_text(work%interface_iterations)// &
      & " iterations in them; factors of subdomains: "//to_text(counts(2))//" analyses, "//to_text(counts(3))// &
      & " factorisations", error)
    if (simulation%config%solver%sleeping) call self%line("sleeping    "//to_text(simulation%slept)// &
      & " contacts slept at the start of solves, of which "//to_text(simulation%woken)//" woke them to reach the tolerance", error)
    if (simulation%scheme%direction_text /= "") call self%line("direction   "//simulation%scheme%direction_text//"; lowered "// &
      & to_text(work%lowered)//" times", error)
    if (work%shortened + work%put_off > 0) call self%line("momentum    memory shortened "//to_text(work%shortened)// &
      & " times, put off "//to_text(work%put_off)//" times", error)
    if (work%relaxed > 0) call self%line("relaxation  lowered "//to_text(work%relaxed)//" times, to "// &
      & to_text(work%least_factor, 3)//" at least", error)
    if (simulation%decomposition%n_subdomains > 1) then
      call simulation%scheme%measure_balance(self%comm, simulation%decomposition%n_subdomains, ranks, subdomains)
      call self%line("balance     "//balance_text(ranks, subdomains)//" of the mean since the last partition", error)
    end if
    call self%line("lists       made "//to_text(simulation%neighbourhoods%builds)//" times", error)
    call self%line("memory      at most "//to_text(nint(self%comm%highest(peak_memory())))//" MiB on a rank", error)
    call self%line("messages    "//to_text(counts(4))//" between ranks, "//to_text(8*counts(5)/1024)//" KiB", error)
  end subroutine write_work

  !> What the accuracy of the run was, what its solves took, and what they would have taken with other tolerances. Collective.
  subroutine write_accuracy(self, simulation, error)
    class(run_log_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text
    real(dp) :: least, most, seconds

    associate (effort => simulation%effort)
      call write_lines(self, accuracy_lines(simulation), "", error)
      call self%line("            "//energy_text(simulation), error)
      seconds = self%comm%highest(effort%seconds)
      call self%line("cost        "//to_text(seconds, 3)//" s in "//to_text(effort%solves)//" solves of "// &
        & to_text(effort%iterations)//" iterations in all", error)
      if (effort%iterations == 0) return
      call effort%looser_range(least, most)
      text = "            at ten times the "//goal_name(simulation)//" "//estimate_text(self%comm, effort, least, most)
      if (effort%unreached(tenfold) > 0) text = text//": "//to_text(effort%unreached(tenfold))//" solves did not reach that"
      call self%line(text, error)
      call effort%tighter_range(least, most)
      text = "            at a tenth of the "//goal_name(simulation)//" "//estimate_text(self%comm, effort, least, most)
      if (simulation%failed > 0) then
        text = text//": "//to_text(simulation%failed)//" solves did not reach the "//goal_name(simulation)//" itself"
      else if (least < 0.0_dp) then
        text = text//": solves do not show how errors decay"
      else
        text = text//", if solves get there"
      end if
      call self%line(text, error)
    end associate
  end subroutine write_accuracy

  !> How far energies balance: of the whole scene where its terms are measured, else of the grains.
  function energy_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: off, turnover
    integer :: place

    off = simulation%balance%error()
    turnover = simulation%balance%turnover()
    place = simulation%diagnostics%place("energy")
    if (place > 0) then
      select type (energy => simulation%diagnostics%asked(place)%item)
      type is (energy_balance_t)
        off = energy%error()
        turnover = energy%turnover()
      end select
    end if
    text = "energy balance off by "//to_text(abs(off), 2)//" J, of "//to_text(turnover, 3)//" J turned over"
  end function energy_text

  !> What so many iterations would have taken. Collective.
  function estimate_text(comm, effort, least, most) result(text)
    type(communicator_t), intent(in) :: comm
    type(effort_t), intent(in) :: effort
    real(dp), intent(in) :: least, most
    character(len=:), allocatable :: text
    real(dp) :: seconds(2)

    text = "not known"
    if (least < 0.0_dp) return
    seconds(1) = comm%highest(effort%seconds_of(least))
    seconds(2) = comm%highest(effort%seconds_of(most))
    text = to_text(nint(least, i8))//" to "//to_text(nint(most, i8))//" iterations, "//to_text(seconds(1), 2)//" to "// &
      & to_text(seconds(2), 2)//" s (estimated)"
  end function estimate_text

  subroutine run_log_close(self, error)
    class(run_log_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call wipe_live_line(self)
    call self%file%close(error)
  end subroutine run_log_close

end module gravier_run_log
