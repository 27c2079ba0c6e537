!> The files of a run: results.h5, history.csv, trace.csv, those for ParaView and the final bodies.
module gravier_run_output
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: start_timer, stop_timer, phase_output
  use gravier_file_system, only: remove_file
  use gravier_results_file, only: results_file_t, body_rows_t, contact_rows_t, boundary_rows_t, figures_t, &
    & accuracy_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_build_info, only: version
  use gravier_contact_structure, only: bin_width
  use gravier_diagnostics, only: diagnostics_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_final_bodies, only: write_final_bodies
  use gravier_picture_files, only: picture_files_t
  use gravier_problem_dump, only: write_problem
  use gravier_checkpoint, only: save_checkpoint, checkpoint_name
  implicit none
  private
  public :: run_output_t

  type :: run_output_t
    private
    type(communicator_t), pointer :: comm => null()
    character(len=:), allocatable :: directory
    type(results_file_t) :: results
    type(csv_writer_t) :: history, trace
    type(picture_files_t) :: pictures
    integer :: last_written = -1
  contains
    procedure :: open => run_output_open
    procedure :: write_row => run_output_write_row
    procedure :: write_state => run_output_write_state
    procedure :: write_checkpoint => run_output_write_checkpoint
    procedure :: write_problem => run_output_write_problem
    procedure :: finish => run_output_finish
  end type run_output_t

contains

  !> Create the files in the output directory, which exists, or go on with those of a run that was interrupted: what they
  !> hold of later steps goes. Collective; errors are the same on all ranks.
  subroutine run_output_open(self, simulation, command, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> the command line of the program
    character(len=*), intent(in) :: command
    type(error_t), allocatable, intent(inout) :: error

    self%comm => simulation%comm
    self%directory = trim(simulation%config%output%directory)//"/"
    if (simulation%restarted) then
      call self%results%reopen(self%comm, self%directory//"results.h5", simulation%step, error)
      self%last_written = simulation%last_written
    else
      ! what is begun now must not go on from the checkpoint of another run
      if (self%comm%rank == 0) call remove_file(self%directory//checkpoint_name)
      call self%results%open(self%comm, self%directory//"results.h5", version, command, simulation%config%text, &
        & simulation%config%scene%dimension, error)
      call write_boundaries(self, simulation, error)
    end if
    if (simulation%config%output%vtk) call self%pictures%open(simulation, self%directory, error)
    if (self%comm%rank == 0) then
      call open_table(self%history, self%directory//"history.csv", history_header(simulation), simulation, error)
      if (simulation%config%output%trace) call open_table(self%trace, self%directory//"trace.csv", trace_header(simulation), &
        & simulation, error)
    end if
    call self%comm%agree(error)
  end subroutine run_output_open

  subroutine open_table(table, path, header, simulation, error)
    type(csv_writer_t), intent(inout) :: table
    character(len=*), intent(in) :: path, header
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    if (simulation%restarted) then
      call table%resume(path, header, simulation%step, error)
    else
      call table%open(path, header, error)
    end if
  end subroutine open_table

  !> The columns, those of the diagnostics last.
  pure function history_header(simulation) result(header)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: header
    integer :: k

    header = "step,time,contacts,iterations,sweeps,residual,velocity_error,velocity_scale,jump,max_overlap,"// &
      & "kinetic_energy,wall_seconds,interface_bodies,converged,grains,left,fast,listed,divided,projected,"// &
      & "exchange_messages,exchange_values,most_messages,most_values,ghosts,solve_seconds"
    if (simulation%config%solver%sleeping) header = header//",sleeping,woken"
    do k = 1, simulation%diagnostics%n_columns
      header = header//","//trim(simulation%diagnostics%name(k))
    end do
  end function history_header

  pure function trace_header(simulation) result(header)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: header
    header = "step,iteration,residual,velocity_error,jump"
    if (simulation%config%solver%criterion == "error") header = header//",error"
  end function trace_header

  !> What the boundaries are, once.
  subroutine write_boundaries(self, simulation, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    character(len=64) :: name(size(simulation%decomposition%boundaries))
    character(len=16) :: shape(size(simulation%decomposition%boundaries))
    real(dp) :: normal(simulation%decomposition%nd, size(simulation%decomposition%boundaries))
    integer(i8) :: id(size(simulation%decomposition%boundaries))
    integer :: b

    associate (boundaries => simulation%decomposition%boundaries)
      do b = 1, size(boundaries)
        id(b) = boundaries(b)%id
        name(b) = boundaries(b)%name
        shape(b) = boundaries(b)%shape_name()
        normal(:, b) = 0.0_dp
        if (boundaries(b)%is_plane()) normal(:, b) = boundaries(b)%surface%axis(1:size(normal, 1))
      end do
      call self%results%write_boundaries(id, name, shape, normal, error)
    end associate
  end subroutine write_boundaries

  !> A row of the history, and the trace of the step. Collective.
  subroutine run_output_write_row(self, simulation, figures, seconds, converged, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    !> wall time of the step [s]
    real(dp), intent(in) :: seconds
    logical, intent(in) :: converged
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    call start_timer(phase_output)
    if (self%comm%rank == 0) then
      call self%history%add(simulation%step)
      call self%history%add(simulation%time)
      call self%history%add(figures%contacts)
      call self%history%add(figures%solve%iterations)
      call self%history%add(figures%solve%iterations*simulation%config%solver%sweeps)
      call self%history%add(figures%solve%residual)
      call self%history%add(figures%solve%velocity_error)
      call self%history%add(figures%solve%velocity_scale)
      call self%history%add(figures%solve%jump)
      call self%history%add(figures%max_overlap)
      call self%history%add(figures%kinetic_energy)
      call self%history%add(seconds)
      call self%history%add(figures%sharing%bodies)
      call self%history%add(merge(1, 0, converged))
      call self%history%add(simulation%n_grains)
      call self%history%add(figures%left)
      call self%history%add(figures%fast)
      call self%history%add(merge(1, 0, figures%listed))
      call self%history%add(merge(1, 0, figures%divided))
      call self%history%add(merge(1, 0, figures%projected))
      call self%history%add(figures%sharing%neighbours)
      call self%history%add(figures%sharing%values)
      call self%history%add(figures%sharing%most_neighbours)
      call self%history%add(figures%sharing%most_values)
      call self%history%add(figures%sharing%ghosts)
      call self%history%add(figures%solve%seconds)
      if (simulation%config%solver%sleeping) then
        call self%history%add(figures%asleep)
        call self%history%add(merge(1, 0, figures%solve%woken))
      end if
      do k = 1, simulation%diagnostics%n_columns
        call self%history%add(simulation%diagnostics%value(k))
      end do
      call self%history%end_row(error)
      if (self%trace%is_open()) call write_trace(self, simulation, figures, error)
    end if
    call self%comm%agree(error)
    call stop_timer(phase_output)
  end subroutine run_output_write_row

  subroutine write_trace(self, simulation, figures, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, figures%solve%n_trace
      call self%trace%add(simulation%step)
      call self%trace%add(nint(figures%solve%trace(1, k)))
      call self%trace%add(figures%solve%trace(2, k))
      call self%trace%add(figures%solve%trace(5, k))
      call self%trace%add(figures%solve%trace(3, k))
      if (simulation%config%solver%criterion == "error") call self%trace%add(figures%solve%trace(4, k))
      call self%trace%end_row(error)
    end do
  end subroutine write_trace

  !> Write bodies, and contacts when asked for, as step `step` of results.h5; a step written before is left. The contacts of
  !> a state that comes from a checkpoint are not known before the next step. Collective.
  subroutine run_output_write_state(self, simulation, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(body_rows_t) :: bodies
    type(contact_rows_t) :: contacts
    type(boundary_rows_t) :: boundaries
    type(figures_t), allocatable :: figures
    type(accuracy_t), allocatable :: accuracy

    if (self%last_written == simulation%step) return
    call start_timer(phase_output)
    call collect_bodies(simulation, bodies)
    call collect_boundaries(simulation, boundaries)
    call collect_figures(simulation%diagnostics, figures)
    if (simulation%tally%steps > 0) accuracy = accuracy_t(simulation%tally%velocity_error, simulation%tally%velocity_scale)
    if (simulation%config%output%contacts .and. allocated(simulation%problem%sub)) then
      call collect_contacts(simulation, contacts)
      call self%results%write_step(simulation%step, simulation%time, bodies, error, contacts, boundaries, figures, &
        & accuracy)
    else
      call self%results%write_step(simulation%step, simulation%time, bodies, error, boundaries=boundaries, &
        & figures=figures, accuracy=accuracy)
    end if
    if (simulation%config%output%vtk) call self%pictures%write_step(simulation, error)
    self%last_written = simulation%step
    call stop_timer(phase_output)
  end subroutine run_output_write_state

  !> The diagnostics of the scene as a whole; not allocated where none are asked for, or no step was made.
  subroutine collect_figures(diagnostics, figures)
    type(diagnostics_t), intent(in) :: diagnostics
    type(figures_t), allocatable, intent(out) :: figures

    if (diagnostics%n_of_scene == 0 .or. .not. diagnostics%measured) return
    allocate (figures)
    figures%name = diagnostics%name(1:diagnostics%n_of_scene)
    figures%value = diagnostics%value(1:diagnostics%n_of_scene)
    figures%bin_width = bin_width
    if (allocated(diagnostics%structure)) then
      figures%histogram = diagnostics%structure%histogram
    else
      allocate (figures%histogram(0))
    end if
  end subroutine collect_figures

  !> Where the boundaries are, how they move and what the grains did to them in the last step.
  subroutine collect_boundaries(simulation, rows)
    type(simulation_t), intent(in) :: simulation
    type(boundary_rows_t), intent(out) :: rows
    real(dp) :: place(3)
    integer :: b, nd, n

    nd = simulation%decomposition%nd
    associate (boundaries => simulation%decomposition%boundaries)
      n = size(boundaries)
      allocate (rows%id(n), rows%position(nd, n), rows%normal(nd, n), rows%velocity(3*nd - 3, n), rows%force(nd, n))
      do b = 1, n
        rows%id(b) = boundaries(b)%id
        call boundaries(b)%find_place(place)
        rows%position(:, b) = place(1:nd)
        rows%normal(:, b) = 0.0_dp
        if (boundaries(b)%is_plane()) rows%normal(:, b) = boundaries(b)%surface%axis(1:nd)
        rows%velocity(1:nd, b) = boundaries(b)%velocity(1:nd)
        rows%velocity(nd + 1:, b) = boundaries(b)%spin(merge(3, 1, nd == 2):)
        rows%force(:, b) = simulation%boundary_impulses(:, b)/simulation%physics%h
      end do
    end associate
  end subroutine collect_boundaries

  !> Grains of this rank; grains without spin are written with zeros for it.
  subroutine collect_bodies(simulation, rows)
    type(simulation_t), intent(in) :: simulation
    type(body_rows_t), intent(out) :: rows
    integer :: s, n, next, nd, nv

    nd = simulation%decomposition%nd
    nv = simulation%decomposition%nv
    n = sum(simulation%decomposition%home%n)
    allocate (rows%id(n), rows%position(nd, n), rows%velocity(3*nd - 3, n), rows%radius(n))
    if (simulation%decomposition%ni > 0) allocate (rows%image(nd, n))
    next = 0
    do s = 1, size(simulation%decomposition%home)
      associate (home => simulation%decomposition%home(s))
        n = home%n
        rows%id(next + 1:next + n) = home%id
        rows%position(:, next + 1:next + n) = home%position
        rows%velocity(1:nv, next + 1:next + n) = home%velocity
        rows%velocity(nv + 1:, next + 1:next + n) = 0.0_dp
        rows%radius(next + 1:next + n) = home%radius
        if (home%ni > 0) rows%image(:, next + 1:next + n) = home%image
        next = next + n
      end associate
    end do
  end subroutine collect_bodies

  !> Contacts of this rank; without friction the tangential impulses are written as zeros. Moments where the kernels have some.
  subroutine collect_contacts(simulation, rows)
    type(simulation_t), intent(in) :: simulation
    type(contact_rows_t), intent(out) :: rows
    real(dp) :: radius
    integer :: s, c, p, n, nd, nf

    nd = simulation%problem%kernels%nd
    nf = simulation%problem%kernels%nf
    n = sum(simulation%problem%sub%n_contacts)
    allocate (rows%candidate(n), rows%antagonist(n), rows%normal(nd, n), rows%gap(n))
    allocate (rows%impulse(nd, n), source=0.0_dp)
    if (simulation%problem%kernels%rolling_row > 0) allocate (rows%moment(2*nd - 3, n))
    n = 0
    do s = 1, size(simulation%problem%sub)
      associate (sub => simulation%problem%sub(s), view => simulation%neighbourhoods%view(s))
        do c = 1, sub%n_contacts
          n = n + 1
          p = sub%source(c)
          rows%candidate(n) = view%bodies%id(view%list%candidate(p))
          if (view%list%antagonist(p) > 0) then
            rows%antagonist(n) = view%bodies%id(view%list%antagonist(p))
          else
            rows%antagonist(n) = simulation%decomposition%boundaries(-view%list%antagonist(p))%id
          end if
          rows%normal(:, n) = sub%hot(lane_of(c), 1:nd, block_of(c))
          rows%gap(n) = sub%gap(c)
          rows%impulse(1:nf, n) = sub%impulse(lane_of(c), 1:nf, block_of(c))
          rows%impulse(1, n) = sub%normal_impulse(c)
          if (.not. allocated(rows%moment)) cycle
          radius = sub%hot(lane_of(c), simulation%problem%kernels%rolling_row + 1, block_of(c))
          ! that about the normal comes last in a sweep
          rows%moment(1, n) = radius*sub%impulse(lane_of(c), simulation%problem%kernels%nc, block_of(c))
          if (nd == 3) rows%moment(2:3, n) = radius*sub%impulse(lane_of(c), 4:5, block_of(c))
        end do
      end associate
    end do
  end subroutine collect_contacts

  !> Write the problem of the last step as step_N.hdf5. Collective.
  subroutine run_output_write_problem(self, simulation, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    call start_timer(phase_output)
    call write_problem(simulation, self%directory//"step_"//to_text(simulation%step)//".hdf5", error)
    call stop_timer(phase_output)
  end subroutine run_output_write_problem

  !> Write checkpoint.h5. What the tables and the results hold by then is on the disk before it. Collective.
  subroutine run_output_write_checkpoint(self, simulation, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    call start_timer(phase_output)
    simulation%last_written = self%last_written
    call save_checkpoint(simulation, self%directory//checkpoint_name, error)
    call stop_timer(phase_output)
  end subroutine run_output_write_checkpoint

  !> Write the last state and the final bodies, and close. Collective.
  subroutine run_output_finish(self, simulation, keep_last, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> whether the present state is one to keep
    logical, intent(in) :: keep_last
    type(error_t), allocatable, intent(inout) :: error

    if (keep_last) then
      call self%write_state(simulation, error)
      if (simulation%config%output%final_bodies) call write_final_bodies(simulation, self%directory//"final_bodies.h5", error)
    end if
    call self%results%close(error)
    call self%pictures%close(error)
    call self%history%close(error)
    if (self%trace%is_open()) call self%trace%close(error)
    call self%comm%agree(error)
  end subroutine run_output_finish

end module gravier_run_output
