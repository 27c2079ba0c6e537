!> Whether a checkpoint is one of the scene that an input file makes now: the options in force that must not change.
module gravier_checkpoint_scene
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, growing_text_t
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_shape_names, only: library_digest
  use gravier_time_table, only: time_table_t
  use gravier_changed_options, only: compare_options, next_line, group_end, tables_group, files_group
  use gravier_config, only: config_t, write_active
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: check_scene, check_steps, check_removals, fixed_options

  character(len=*), parameter :: newline = achar(10)
  !> groups of the input that a run goes on with as it began, but for what may change where this is asked for
  character(len=*), parameter :: fixed_groups = "&scene &boundary &sample &insertion &material &law"

contains

  !> Refuse a checkpoint of another scene, naming the first option that differs.
  subroutine check_scene(simulation, file, path, accepts, error)
    !> gets the options that differ
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    !> loads, drives and coefficients of contact may differ
    logical, intent(in) :: accepts
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: before
    integer(i8) :: subdomains, grains
    real(dp) :: h, theta, radius

    call file%read_text("scene", before, error)
    call file%read_scalar("subdomains", subdomains, error)
    call file%read_scalar("time_step", h, error)
    call file%read_scalar("theta", theta, error)
    call file%read_scalar("grains_at_start", grains, error)
    call file%read_scalar("mean_radius_at_start", radius, error)
    if (allocated(error)) return
    associate (config => simulation%config)
      call expect(subdomains == config%decomposition%subdomains, "&decomposition subdomains", to_text(subdomains))
      call expect(.not. abs(h - config%time%step) > 0.0_dp, "&time step", to_text(h))
      call expect(.not. abs(theta - config%time%theta) > 0.0_dp, "&time theta", to_text(theta))
      if (.not. allocated(error)) call compare_options(path, before, config%file, &
        & fixed_options(simulation), accepts, simulation%changes, error)
      call check_velocities(simulation%changes, simulation%config, error)
    end associate
    if (allocated(error)) return
    if (grains /= simulation%n_first .or. abs(radius - simulation%decomposition%rule%mean_radius) > 0.0_dp) call raise(error, &
      & status_input, path//": the run began with "//to_text(grains)//" grains of mean radius "//to_text(radius)// &
      & " m; expected the bodies that "//simulation%config%file//" makes now, "//to_text(simulation%n_first)// &
      & " of mean radius "//to_text(simulation%decomposition%rule%mean_radius)//" m")

  contains

    subroutine expect(holds, option, value)
      logical, intent(in) :: holds
      character(len=*), intent(in) :: option, value

      if (.not. holds) call raise(error, status_input, simulation%config%file//": "//option//": expected "//value// &
        & ", with which "//path//" was written")
    end subroutine expect

  end subroutine check_scene

  !> Refuse another velocity of a boundary along components that forces move: it goes on with the one that it has.
  subroutine check_velocities(changes, config, error)
    character(len=*), intent(in) :: changes
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: b

    do b = 1, size(config%boundaries)
      associate (given => config%boundaries(b))
        if (.not. any(given%free .and. abs(given%velocity) > 0.0_dp)) cycle
        if (index(changes, title_of_boundary(given%name)//" velocity = ") == 0) cycle
        call raise(error, status_input, config%file//": "//title_of_boundary(given%name)//" velocity: expected 0 along what "// &
          & "forces move: there the boundary goes on with the velocity that it has")
        return
      end associate
    end do
  end subroutine check_velocities

  !> Refuse another time of removal for a boundary that is no longer there.
  subroutine check_removals(simulation, path, error)
    type(simulation_t), intent(in) :: simulation
    !> of the checkpoint
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer :: b

    if (allocated(error)) return
    do b = 1, size(simulation%config%boundaries)
      associate (boundary => simulation%decomposition%boundaries(simulation%n_walls + b), given => simulation%config%boundaries(b))
        if (boundary%present .or. given%remove_at <= simulation%time) cycle
        call raise(error, status_input, simulation%config%file//": "//title_of_boundary(given%name)//" remove_at: expected the "// &
          & "time at which it was removed, since it is no longer there in "//path)
        return
      end associate
    end do
  end subroutine check_removals

  !> A boundary as the changes have it.
  function title_of_boundary(name) result(title)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: title
    title = "&boundary '"//trim(name)//"'"
  end function title_of_boundary

  !> Refuse a checkpoint that is beyond the last step of the input.
  subroutine check_steps(simulation, step, path, error)
    type(simulation_t), intent(in) :: simulation
    integer(i8), intent(in) :: step
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error) .or. step <= simulation%config%time%steps) return
    call raise(error, status_input, simulation%config%file//": &time steps = "//to_text(simulation%config%time%steps)// &
      & ": expected "//to_text(step)//" at least, the step of "//path)
  end subroutine check_steps

  !> The options in force that must not change, a line each, and what tells contents of tables and meshes apart.
  function fixed_options(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    type(growing_text_t) :: lines, tables, files
    character(len=:), allocatable :: options, line
    integer :: at, b
    logical :: fixed

    call write_active(options, simulation%config)
    fixed = .false.
    at = 1
    do while (at <= len(options))
      call next_line(options, at, line)
      if (line(1:min(1, len(line))) == "&") fixed = index(fixed_groups//" ", line//" ") > 0
      ! starts are over
      if (index(line, "  title = ") == 1 .or. index(line, "  start_overlap = ") == 1) cycle
      if (fixed) call lines%add(line//newline)
    end do
    if (simulation%decomposition%shapes%n > 0) call add_contents(files, trim(simulation%config%scene%shapes), &
      & library_digest(simulation%decomposition%shapes))
    do b = 1, size(simulation%inflow%insertions)
      if (simulation%config%insertions(b)%radii == "table") call add_contents(files, &
        & trim(simulation%config%insertions(b)%radius_table), simulation%inflow%insertions(b)%radii%digest())
    end do
    call add_table(simulation%gravity_table, trim(simulation%config%scene%gravity_table))
    call add_table(simulation%cell_drive%table, trim(simulation%config%scene%cell_table))
    do b = 1, size(simulation%config%boundaries)
      associate (boundary => simulation%decomposition%boundaries(simulation%n_walls + b), given => simulation%config%boundaries(b))
        call add_table(boundary%drive%table, trim(given%table))
        if (boundary%is_faceted()) call add_contents(files, trim(given%file), boundary%surface%digest())
      end associate
    end do
    call lines%add(tables_group//newline//tables%get()//group_end//newline//files_group//newline//files%get()//group_end//newline)
    text = lines%get()

  contains

    subroutine add_table(table, path)
      type(time_table_t), intent(in) :: table
      character(len=*), intent(in) :: path

      if (allocated(table%has)) call add_contents(tables, path, table%digest())
    end subroutine add_table

    subroutine add_contents(kind, path, digest)
      type(growing_text_t), intent(inout) :: kind
      character(len=*), intent(in) :: path
      integer(i8), intent(in) :: digest

      call kind%add("  "//path//" = "//to_text(digest)//newline)
    end subroutine add_contents

  end function fixed_options

end module gravier_checkpoint_scene
