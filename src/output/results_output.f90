!> results.h5: the states of bodies, boundaries and contacts, and the figures that hold for the scene as a whole.
module gravier_results_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_diagnostic, only: histogram_t
  use gravier_diagnostics, only: diagnostics_t
  use gravier_field_list, only: field_list_t
  use gravier_results_file, only: results_file_t, figures_t, accuracy_t
  use gravier_run_provenance, only: provenance_t
  use gravier_build_info, only: version
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_body_collector, only: collect_bodies, collect_boundaries, collect_cell
  use gravier_shape_tables, only: describe_shapes
  use gravier_pair_places, only: has_facets
  use gravier_facet_tables, only: describe_facets
  use gravier_contact_collector, only: collect_contacts
  use gravier_region_tables, only: collect_regions
  use gravier_output, only: output_t, of_states
  implicit none
  private
  public :: results_output_t

  type, extends(output_t) :: results_output_t
    private
    type(results_file_t) :: file
  contains
    procedure, nopass :: wanted => results_output_wanted
    procedure, nopass :: files => results_output_files
    procedure :: open => results_output_open
    procedure :: write => results_output_write
    procedure :: finish => results_output_finish
  end type results_output_t

  !> of a contact; NaN is looked for in this order
  character(len=10), parameter :: contact_fields(6) = [character(len=10) :: "normal", "impulse", "moment", "gap", "point", &
    & "elongation"]

contains

  !> Every run has one.
  pure logical function results_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%every >= 0
  end function results_output_wanted

  pure function results_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = "results.h5"
  end function results_output_files

  subroutine results_output_open(self, simulation, directory, command, error)
    class(results_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error
    type(provenance_t) :: run
    type(field_list_t) :: boundaries, facets
    type(field_list_t), allocatable :: shapes(:)

    self%stage = of_states
    self%schedule = schedule_t(every=simulation%config%output%every, last=simulation%config%time%steps)
    run%version = version
    run%command = command
    run%input_text = simulation%config%text
    if (simulation%restarted) then
      self%last = simulation%last_written
      if (simulation%step < simulation%config%time%steps) then
        call self%file%reopen(simulation%comm, directory//"results.h5", simulation%step, "bodies/radius", error, run)
      else
        call self%file%reopen(simulation%comm, directory//"results.h5", simulation%step, "bodies/radius", error)
      end if
      ! a run that ended in the step of its checkpoint has written this state
      if (self%file%has_last) self%last = simulation%step
      return
    end if
    run%dimension = simulation%config%scene%dimension
    run%period(:) = simulation%decomposition%period%length
    run%origin(:) = simulation%decomposition%period%origin
    call self%file%open(simulation%comm, directory//"results.h5", run, error)
    call describe_boundaries(simulation, boundaries)
    call self%file%write_table(boundaries, error)
    if (has_facets(simulation%decomposition%boundaries)) then
      call describe_facets(simulation, facets)
      call self%file%write_table(facets, error)
    end if
    if (.not. simulation%effects%shapes) return
    call describe_shapes(simulation%decomposition%shapes, simulation%decomposition%nd, shapes)
    call self%file%write_tables(shapes, error)
  end subroutine results_output_open

  !> What the boundaries are, once for the run.
  subroutine describe_boundaries(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    character(len=64) :: name(size(simulation%decomposition%boundaries))
    character(len=16) :: shape(size(simulation%decomposition%boundaries))
    real(dp), allocatable :: normal(:, :)
    integer :: b

    associate (boundaries => simulation%decomposition%boundaries)
      call table%init("boundaries", "id", size(boundaries))
      table%everywhere = .true.
      allocate (normal(simulation%decomposition%nd, size(boundaries)), source=0.0_dp)
      do b = 1, size(boundaries)
        table%key(1, b) = boundaries(b)%id
        name(b) = boundaries(b)%name
        shape(b) = boundaries(b)%shape_name()
        if (boundaries(b)%is_plane()) normal(:, b) = boundaries(b)%surface%axis(1:size(normal, 1))
      end do
    end associate
    call table%add_texts("name", name)
    call table%add_texts("shape", shape)
    call table%add_reals("normal", "", normal)
  end subroutine describe_boundaries

  !> Write the present state, with its contacts when they are asked for. Those of a state that comes from a checkpoint are not known
  !> before the next step. Collective.
  subroutine results_output_write(self, simulation, figures, seconds, error)
    class(results_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    type(accuracy_t), allocatable :: accuracy
    type(figures_t), allocatable :: of_scene
    type(field_list_t) :: table
    type(field_list_t), allocatable :: region(:)

    associate (unused => figures, unused_seconds => seconds)
    end associate
    if (simulation%tally%steps > 0) accuracy = accuracy_t(simulation%tally%velocity_error, simulation%tally%velocity_scale)
    call self%file%begin_step(simulation%step, simulation%time, error, accuracy)
    ! one table after the other is collected, written and let go
    call collect_bodies(simulation, table)
    call self%file%write_step_table(table, error)
    if (simulation%config%output%contacts .and. allocated(simulation%problem%sub)) then
      call collect_contacts(simulation, contact_fields, table)
      call self%file%write_step_table(table, error)
    end if
    call collect_boundaries(simulation, table)
    call self%file%write_step_table(table, error)
    if (simulation%effects%moving_cell) then
      call collect_cell(simulation, table)
      call self%file%write_step_table(table, error)
    end if
    call collect_figures(simulation%diagnostics, of_scene)
    if (allocated(of_scene)) call self%file%write_step_figures(of_scene, error)
    call collect_regions(simulation, region)
    if (allocated(region)) call self%file%write_step_regions(region, error)
    call self%file%end_step(error)
    ! a run that goes on from a checkpoint does not write it again
    simulation%last_written = simulation%step
  end subroutine results_output_write

  !> The diagnostics of the scene as a whole; not allocated where none are asked for, or no step was made.
  subroutine collect_figures(diagnostics, figures)
    type(diagnostics_t), intent(in) :: diagnostics
    type(figures_t), allocatable, intent(out) :: figures
    type(histogram_t), allocatable :: histograms(:)
    integer :: k, n

    n = 0
    do k = 1, diagnostics%n_columns
      if (diagnostics%in_results(k)) n = n + 1
    end do
    if (n == 0) return
    allocate (figures)
    allocate (character(len=len(diagnostics%name)) :: figures%name(n))
    allocate (figures%value(n))
    n = 0
    do k = 1, diagnostics%n_columns
      if (.not. diagnostics%in_results(k)) cycle
      n = n + 1
      figures%name(n) = diagnostics%name(k)
      figures%value(n) = diagnostics%value(k)
    end do
    call diagnostics%get_histograms(histograms)
    allocate (figures%histogram(size(histograms)))
    do k = 1, size(histograms)
      figures%histogram(k)%name = histograms(k)%name
      figures%histogram(k)%counts = histograms(k)%counts
      figures%histogram(k)%bin_width = histograms(k)%bin_width
    end do
  end subroutine collect_figures

  subroutine results_output_finish(self, error)
    class(results_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%file%close(error)
  end subroutine results_output_finish

end module gravier_results_output
