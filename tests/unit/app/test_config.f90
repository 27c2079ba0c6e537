!> Input files: values, defaults, syntax, and the message of every rule.
program test_config
  use, intrinsic :: iso_fortran_env, only: iostat_end
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, status_input
  use gravier_config_surfaces, only: surface_value
  use gravier_diagnostic_registry, only: diagnostic_place
  use gravier_config, only: config_t, scene_config_t, boundary_config_t, parse_config, write_active, write_key_reference
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: time_keys = "step steps theta rest_energy stop_boundary stop_displacement stop_cell_strain "// &
    & "stop_cell_shear stop_grains_at_most stop_grains_at_least stop_mass_at_most stop_mass_at_least"

  character(len=*), parameter :: newline = achar(10), tab = achar(9), carriage = achar(13)
  !> a group &time that is in order
  character(len=*), parameter :: time = " &time step = 0.1, steps = 5 / "
  !> an input that is in order, to which a group can be added
  character(len=*), parameter :: column = "&scene bodies = 'column' /" // time
  character(len=*), parameter :: lattice_keys = " lattice_count = 4, 5 radius_min = 0.1 radius_max = 0.2 "
  character(len=*), parameter :: positive = "expected a finite real number > 0"
  character(len=*), parameter :: third = "expected a third component of 0 where dimension = 2"
  character(len=*), parameter :: plane_keys = " shape = 'plane' normal = 0, 1 "
  character(len=*), parameter :: solid_shapes = "'plane', 'segment', 'rectangle', 'circle', 'cylinder', 'mesh', 'grains' or 'wall'"

  call MPI_Init()
  call test_whole_file()
  call test_defaults()
  call test_defaults_in_space()
  call test_derived_values()
  call test_limits()
  call test_words_of_choices()
  call test_syntax_of_names()
  call test_syntax_of_values()
  call test_syntax_of_texts()
  call test_long_texts()
  call test_failures_leave_nothing_behind()
  call test_refused_files()
  call test_refused_names()
  call test_refused_duplicates()
  call test_refused_kinds()
  call test_refused_numbers()
  call test_refused_entries()
  call test_rules_of_scene()
  call test_rules_of_bodies()
  call test_rules_of_lattice()
  call test_rules_of_time_and_solver()
  call test_rules_of_decomposition()
  call test_rules_of_enriched_and_output()
  call test_boundaries()
  call test_boundary_defaults()
  call test_boundary_logicals()
  call test_messages_of_groups()
  call test_shapes()
  call test_keys_of_shapes()
  call test_rules_of_boundary()
  call test_rules_of_free_boundary()
  call test_planar_boundaries()
  call test_materials()
  call test_laws()
  call test_sample()
  call test_keys_of_sample()
  call test_rules_of_sample()
  call test_empty_names()
  call test_rules_of_box()
  call test_active_options()
  call test_active_groups()
  call test_round_trip()
  call test_reference()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Parses a text that must be in order.
  subroutine accept(text, name, config)
    character(len=*), intent(in) :: text, name
    type(config_t), intent(out) :: config
    type(error_t), allocatable :: error
    call parse_config("case.nml", text, config, error)
    if (allocated(error)) then
      call check_equal(error%message, "", name // " is accepted")
    else
      call check(.true., name // " is accepted")
    end if
  end subroutine accept

  !> Parses a text that must be refused with this message after the name of the file.
  subroutine refuse(text, message)
    character(len=*), intent(in) :: text, message
    type(config_t) :: config
    type(error_t), allocatable :: error
    call parse_config("case.nml", text, config, error)
    call check(allocated(error), "refused: " // message)
    if (.not. allocated(error)) return
    call check_equal(error%message, "case.nml: " // message, "message")
    call check_equal(error%status, status_input, "status of: " // message)
    call check(index(error%message, newline) == 0, "one line: " // message)
  end subroutine refuse

  !> Text of an input: keys of &scene, and groups after it.
  pure function scene(keys, groups) result(text)
    character(len=*), intent(in) :: keys
    character(len=*), intent(in), optional :: groups
    character(len=:), allocatable :: text
    text = "&scene " // keys // " /" // time
    if (present(groups)) text = text // groups
  end function scene

  subroutine test_whole_file()
    type(config_t) :: config
    character(len=:), allocatable :: text

    text = whole_file()
    call accept(text, "a file with every group", config)
    call check_equal(config%file, "case.nml", "file")
    call check_equal(config%text, text, "text")
    call check_equal(config%scene%title, "three spheres", "title")
    call check_equal(config%scene%dimension, 3, "dimension")
    call check_close(config%scene%gravity(1), 0.5_dp, 0.0_dp, "gravity(1)")
    call check_close(config%scene%gravity(2), -0.25_dp, 0.0_dp, "gravity(2)")
    call check_close(config%scene%gravity(3), -1.5_dp, 0.0_dp, "gravity(3)")
    call check_equal(config%scene%bodies, "column", "bodies")
    call check_equal(config%scene%column_count, 7, "column_count")
    call check_close(config%scene%radius, 0.5_dp, 0.0_dp, "radius")
    call check_close(config%scene%mass, 2.0_dp, 0.0_dp, "mass")
    call check_close(config%scene%contact%friction, 0.375_dp, 0.0_dp, "friction")
    call check_close(config%scene%wall_contact%friction, 0.625_dp, 0.0_dp, "wall_friction")
    call check_close(config%scene%alert_distance, 0.125_dp, 0.0_dp, "alert_distance")
    call check(config%scene%alert_distance_given, "alert_distance_given")
    call check_whole_effects(config%scene)
    call check_close(config%time%step, 0.0078125_dp, 0.0_dp, "step")
    call check_equal(config%time%steps, 40, "steps")
    call check_close(config%time%theta, 0.75_dp, 0.0_dp, "theta")
    call check_close(config%time%rest_energy, 0.001_dp, 0.0_dp, "rest_energy")
    call check_whole_methods(config)
  end subroutine test_whole_file

  subroutine check_whole_effects(scene)
    type(scene_config_t), intent(in) :: scene

    call check_close(scene%contact%restitution, 0.25_dp, 0.0_dp, "restitution")
    call check_close(scene%wall_contact%restitution, 0.75_dp, 0.0_dp, "wall_restitution")
    call check(.not. scene%rotation, "rotation")
    call check_vector(scene%period, [0.0_dp, 8.0_dp, 16.0_dp], "period")
    call check_vector(scene%period_origin, [-1.0_dp, -2.0_dp, -3.0_dp], "period_origin")
    call check_vector(scene%body_force, [4.0_dp, 5.0_dp, 6.0_dp], "body_force")
    call check_vector(scene%cell_strain_rate, [0.0_dp, 0.5_dp, 0.0_dp], "cell_strain_rate")
    call check_vector(scene%cell_shear_rate, [0.25_dp, 0.0_dp, 0.0_dp], "cell_shear_rate")
    call check_vector(scene%cell_pressure, [0.0_dp, 0.0_dp, 7.0_dp], "cell_pressure")
    call check_vector(scene%cell_shear_stress, [0.0_dp, 0.0_dp, -2.0_dp], "cell_shear_stress")
    call check_equal(scene%cell_table, "cell.csv", "cell_table")
    call check(scene%cell_table_repeats .and. .not. scene%gravity_table_repeats, "a table that repeats, and one that is not there")
    call check_close(scene%cell_inertia, 0.5_dp, 0.0_dp, "cell_inertia")
    call check_close(scene%skin, 0.375_dp, 0.0_dp, "skin")
    call check(scene%skin_given, "skin_given")
    call check_close(scene%overlap_allowed, 0.0625_dp, 0.0_dp, "overlap_allowed")
    call check(scene%overlap_allowed_given, "overlap_allowed_given")
    call check(.not. scene%overlap_projection, "overlap_projection")
    call check_close(scene%start_overlap, 0.25_dp, 0.0_dp, "start_overlap")
    call check_close(scene%list_steps, 12.0_dp, 0.0_dp, "list_steps")
  end subroutine check_whole_effects

  !> The values of a key of the shape of a boundary.
  subroutine check_surface(boundary, key, expected, name)
    type(boundary_config_t), intent(in) :: boundary
    character(len=*), intent(in) :: key, name
    real(dp), intent(in) :: expected(3)
    real(dp) :: values(3)

    values = surface_value(boundary, key)
    call check_vector(values, expected, name)
  end subroutine check_surface

  subroutine check_vector(vector, expected, name)
    !> shape (3)
    real(dp), intent(in) :: vector(:), expected(:)
    character(len=*), intent(in) :: name
    call check(all(abs(vector - expected) <= 0.0_dp), name)
  end subroutine check_vector

  pure function whole_file() result(text)
    character(len=:), allocatable :: text
    text = "&scene title = 'three spheres', dimension = 3, gravity = 0.5, -0.25, -1.5" // newline &
      // "  bodies = 'column', column_count = 7, radius = 0.5, mass = 2.0, friction = 0.375" // newline &
      // "  wall_friction = 0.625, restitution = 0.25, wall_restitution = 0.75, rotation = .false." // newline &
      // "  period = 0, 8, 16, period_origin = -1, -2, -3, body_force = 4, 5, 6" // newline &
      // "  alert_distance = 0.125, skin = 0.375, overlap_allowed = 0.0625, overlap_projection = .false." // newline &
      // "  start_overlap = 0.25, list_steps = 12, cell_strain_rate = 0, 0.5, cell_shear_rate = 0.25" // newline &
      // "  cell_pressure = 0, 0, 7, cell_shear_stress = 0, 0, -2, cell_table = 'cell.csv', cell_inertia = 0.5" // newline &
      // "  cell_table_repeats = T" // newline &
      // "/" // newline // "&boundary shape = 'plane', normal = 0, 0, 2 /" // newline &
      // "&time step = 0.0078125, steps = 40, theta = 0.75, rest_energy = 0.001 /" // newline &
      // "&solver method = 'nscdd_ep', criterion = 'error', tolerance = 0.03125, max_iterations = 50, sweeps = 3" // newline &
      // "  velocity_scale = 0.1875, check_every = 5, warm_start = .false., on_failure = 'stop'" // newline &
      // "  accuracy = 0.375, layered_start = .false. /" // newline &
      // "&decomposition partition = 'grid', kind = 'primal', grid = 1, 2, 3, subdomains = 6" // newline &
      // "  repartition_every = 9, repartition_imbalance = 1.5 /" // newline &
      // "&enriched direction = 2.5, direction_unit = 'absolute', contacts = 'active', interface = 'cg'" // newline &
      // "  cg_tolerance = 0.0625, cg_max_iterations = 77 /" // newline &
      // "&output directory = 'out', every = 4, contacts = .false., trace = .true., final_bodies = .true." // newline &
      // "  history_every = 5, checkpoint_every = 6, checkpoint_seconds = 60, walltime = 3600" // newline &
      // "  fclib_step = 3, stress = .true." // newline &
      // "  tracked_bodies = 17, 203, tracked_forces = .true." // newline &
      // "  energy = .true." // newline &
      // "  structure = .true., boundary_forces = .true., vtk = .true. /" // newline
  end function whole_file

  subroutine check_whole_methods(config)
    type(config_t), intent(in) :: config

    call check_equal(config%solver%method, "nscdd_ep", "method")
    call check_equal(config%solver%criterion, "error", "criterion")
    call check_close(config%solver%accuracy, 0.375_dp, 0.0_dp, "accuracy")
    call check(.not. config%solver%layered_start, "layered_start")
    call check_close(config%solver%tolerance, 0.03125_dp, 0.0_dp, "tolerance")
    call check_equal(config%solver%max_iterations, 50, "max_iterations")
    call check_equal(config%solver%sweeps, 3, "sweeps")
    call check_equal(config%solver%check_every, 5, "check_every")
    call check_close(config%solver%velocity_scale, 0.1875_dp, 0.0_dp, "velocity_scale")
    call check(config%solver%velocity_scale_given, "velocity_scale_given")
    call check(.not. config%solver%warm_start, "warm_start")
    call check_equal(config%solver%on_failure, "stop", "on_failure")
    call check_equal(config%decomposition%partition, "grid", "partition")
    call check_equal(config%decomposition%kind, "primal", "kind")
    call check(all(config%decomposition%grid == [1, 2, 3]), "grid")
    call check_equal(config%decomposition%subdomains, 6, "subdomains")
    call check_equal(config%decomposition%repartition_every, 9, "repartition_every")
    call check_close(config%decomposition%repartition_imbalance, 1.5_dp, 0.0_dp, "repartition_imbalance")
    call check_close(config%enriched%direction, 2.5_dp, 0.0_dp, "direction")
    call check_equal(config%enriched%direction_unit, "absolute", "direction_unit")
    call check_equal(config%enriched%contacts, "active", "contacts of enriched")
    call check_equal(config%enriched%interface, "cg", "interface")
    call check_close(config%enriched%cg_tolerance, 0.0625_dp, 0.0_dp, "cg_tolerance")
    call check_equal(config%enriched%cg_max_iterations, 77, "cg_max_iterations")
    call check_equal(config%output%directory, "out", "directory")
    call check_equal(config%output%every, 4, "every")
    call check(.not. config%output%contacts, "contacts of output")
    call check(config%output%trace, "trace")
    call check(config%output%final_bodies, "final_bodies")
    call check_equal(config%output%history_every, 5, "history_every")
    call check_equal(config%output%checkpoint_every, 6, "checkpoint_every")
    call check_equal(config%output%fclib_step, 3, "fclib_step")
    call check(all(config%output%tracked_bodies(:3) == [17, 203, 0]), "tracked_bodies")
    call check(config%output%tracked_forces, "tracked_forces")
    call check_close(config%output%checkpoint_seconds, 60.0_dp, 0.0_dp, "checkpoint_seconds")
    call check_close(config%output%walltime, 3600.0_dp, 0.0_dp, "walltime")
    call check(asks(config, "energy"), "energy")
    call check(asks(config, "stress"), "stress")
    call check(asks(config, "structure"), "structure")
    call check(config%output%vtk, "vtk")
    call check(asks(config, "boundary_forces"), "boundary_forces")
  end subroutine check_whole_methods

  !> Whether the diagnostic with that key is asked for.
  logical function asks(config, key)
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: key

    asks = config%output%diagnostics(diagnostic_place(key))
  end function asks

  subroutine test_defaults()
    type(config_t) :: config

    call accept(column, "the shortest file", config)
    call check_equal(config%scene%title, "", "default title")
    call check_equal(config%scene%dimension, 2, "default dimension")
    call check_close(config%scene%gravity(1), 0.0_dp, 0.0_dp, "default gravity(1)")
    call check_close(config%scene%gravity(2), -9.81_dp, 0.0_dp, "default gravity(2) in 2D")
    call check_close(config%scene%gravity(3), 0.0_dp, 0.0_dp, "default gravity(3) in 2D")
    call check_equal(config%scene%bodies_file, "", "default bodies_file")
    call check_equal(config%scene%column_count, 3, "default column_count")
    call check_close(config%scene%radius, 1.0_dp, 0.0_dp, "default radius")
    call check_close(config%scene%mass, 1.0_dp, 0.0_dp, "default mass")
    call check_close(config%scene%density, 2500.0_dp, 0.0_dp, "default density")
    call check(all(config%scene%lattice_count == 0), "default lattice_count")
    call check_close(config%scene%radius_min, 0.0_dp, 0.0_dp, "default radius_min")
    call check_close(config%scene%radius_max, 0.0_dp, 0.0_dp, "default radius_max")
    call check_equal(config%scene%seed, 1, "default seed")
    call check_close(config%scene%contact%friction, 0.0_dp, 0.0_dp, "default friction")
    call check_close(config%scene%wall_contact%friction, 0.0_dp, 0.0_dp, "default wall_friction")
    call check(config%scene%alert_distance < 0.0_dp, "default alert_distance")
    call check(.not. config%scene%alert_distance_given, "default alert_distance_given")
    call check_default_effects(config%scene)
    call check_equal(size(config%boundaries), 0, "no boundary by default")
    call check_close(config%time%theta, 0.5_dp, 0.0_dp, "default theta")
    call check_close(config%time%rest_energy, 0.0_dp, 0.0_dp, "default rest_energy")
    call check_default_methods(config)
  end subroutine test_defaults

  subroutine check_default_effects(scene)
    type(scene_config_t), intent(in) :: scene

    call check_close(scene%contact%restitution, 0.0_dp, 0.0_dp, "default restitution")
    call check_close(scene%wall_contact%restitution, 0.0_dp, 0.0_dp, "default wall_restitution")
    call check(scene%rotation, "default rotation")
    call check_vector(scene%period, spread(0.0_dp, 1, 3), "default period")
    call check_vector(scene%period_origin, spread(0.0_dp, 1, 3), "default period_origin")
    call check_vector(scene%body_force, spread(0.0_dp, 1, 3), "default body_force")
    call check_equal(scene%gravity_table, "", "default gravity_table")
    call check_vector(scene%cell_strain_rate, spread(0.0_dp, 1, 3), "default cell_strain_rate")
    call check_vector(scene%cell_shear_rate, spread(0.0_dp, 1, 3), "default cell_shear_rate")
    call check_vector(scene%cell_pressure, spread(0.0_dp, 1, 3), "default cell_pressure")
    call check_vector(scene%cell_shear_stress, spread(0.0_dp, 1, 3), "default cell_shear_stress")
    call check_equal(scene%cell_table, "", "default cell_table")
    call check_close(scene%cell_inertia, 0.1_dp, 0.0_dp, "default cell_inertia")
    call check(.not. scene%skin_given, "default skin_given")
    call check(.not. scene%overlap_allowed_given, "default overlap_allowed_given")
    call check(scene%overlap_projection, "default overlap_projection")
    call check_close(scene%start_overlap, 0.5_dp, 0.0_dp, "default start_overlap")
    call check_close(scene%list_steps, 10.0_dp, 0.0_dp, "default list_steps")
  end subroutine check_default_effects

  subroutine check_default_methods(config)
    type(config_t), intent(in) :: config

    call check_equal(config%solver%method, "nlgs", "default method")
    call check_equal(config%solver%criterion, "velocity_error", "default criterion")
    call check_close(config%solver%accuracy, 0.1_dp, 0.0_dp, "default accuracy")
    call check_close(config%solver%tolerance, 1.0e-2_dp, 0.0_dp, "default tolerance with the velocity error")
    call check(config%solver%layered_start, "default layered_start")
    call check_equal(config%solver%max_iterations, 10000, "default max_iterations")
    call check_equal(config%solver%sweeps, 1, "default sweeps")
    call check_close(config%solver%relaxation, 1.0_dp, 0.0_dp, "default relaxation")
    call check_equal(config%solver%check_every, 10, "default check_every")
    call check(.not. config%solver%velocity_scale_given, "default velocity_scale is found by rule")
    call check_close(config%solver%spot_checks, 0.05_dp, 0.0_dp, "default spot_checks")
    call check(.not. config%solver%spot_checks_given, "default spot_checks")
    call check(config%solver%warm_start, "default warm_start")
    call check_equal(config%solver%on_failure, "continue", "default on_failure")
    call check_equal(config%decomposition%partition, "grid", "default partition")
    call check_equal(config%decomposition%kind, "dual", "default kind")
    call check(all(config%decomposition%grid == 0), "default grid")
    call check_equal(config%decomposition%subdomains, 1, "default subdomains")
    call check_equal(config%decomposition%repartition_every, 0, "default repartition_every")
    call check_close(config%decomposition%repartition_imbalance, 0.0_dp, 0.0_dp, "default repartition_imbalance")
    call check(.not. config%enriched%direction_given, "default direction is automatic")
    call check_equal(config%enriched%direction_unit, "relative", "default direction_unit")
    call check_equal(config%enriched%contacts, "all", "default contacts of enriched")
    call check_equal(config%enriched%interface, "mumps", "default interface")
    call check_close(config%enriched%cg_tolerance, 1.0e-12_dp, 0.0_dp, "default cg_tolerance")
    call check_equal(config%enriched%cg_max_iterations, 10000, "default cg_max_iterations")
    call check_equal(config%output%directory, "results", "default directory")
    call check_equal(config%output%every, 1, "default every")
    call check(config%output%contacts, "default contacts of output")
    call check(.not. config%output%trace, "default trace")
    call check(.not. config%output%final_bodies, "default final_bodies")
    call check_equal(config%output%history_every, 1, "default history_every")
    call check_equal(config%output%checkpoint_every, 0, "default checkpoint_every")
    call check_equal(config%output%fclib_step, 0, "default fclib_step")
    call check(all(config%output%tracked_bodies == 0), "no tracked_bodies by default")
    call check(.not. config%output%tracked_forces, "default tracked_forces")
    call check_close(config%output%checkpoint_seconds, 0.0_dp, 0.0_dp, "default checkpoint_seconds")
    call check_close(config%output%walltime, 0.0_dp, 0.0_dp, "default walltime")
    call check(.not. asks(config, "energy"), "default energy")
    call check(.not. asks(config, "stress"), "default stress")
    call check(.not. asks(config, "structure"), "default structure")
    call check(.not. config%output%vtk, "default vtk")
    call check(.not. asks(config, "boundary_forces"), "default boundary_forces")
  end subroutine check_default_methods

  subroutine test_defaults_in_space()
    type(config_t) :: config

    call accept(scene("bodies = 'column' dimension = 3"), "3D", config)
    call check_close(config%scene%gravity(2), 0.0_dp, 0.0_dp, "default gravity(2) in 3D")
    call check_close(config%scene%gravity(3), -9.81_dp, 0.0_dp, "default gravity(3) in 3D")
    call accept(scene("gravity(1) = 1.5 bodies = 'column' dimension = 3"), "gravity before dimension", config)
    call check_close(config%scene%gravity(1), 1.5_dp, 0.0_dp, "gravity(1) given alone")
    call check_close(config%scene%gravity(3), -9.81_dp, 0.0_dp, "gravity(3) where only gravity(1) is given")
  end subroutine test_defaults_in_space

  subroutine test_derived_values()
    type(config_t) :: config

    call accept(scene("bodies = 'column' friction = 0.25"), "friction alone", config)
    call check_close(config%scene%wall_contact%friction, 0.25_dp, 0.0_dp, "wall_friction follows friction")
    call accept(scene("bodies = 'column' friction = 0.25 wall_friction = 0"), "wall_friction", config)
    call check_close(config%scene%wall_contact%friction, 0.0_dp, 0.0_dp, "wall_friction given as 0")
    call accept(scene("bodies = 'column' restitution = 0.25"), "restitution alone", config)
    call check_close(config%scene%wall_contact%restitution, 0.25_dp, 0.0_dp, "wall_restitution follows restitution")
    call accept(scene("bodies = 'column' restitution = 1 wall_restitution = 0"), "wall_restitution", config)
    call check_close(config%scene%wall_contact%restitution, 0.0_dp, 0.0_dp, "wall_restitution given as 0")
    call accept(scene("bodies = 'column' skin = 0"), "skin = 0", config)
    call check(config%scene%skin_given, "skin_given where skin = 0")
    call accept(scene("bodies = 'column' alert_distance = 0"), "alert_distance = 0", config)
    call check(config%scene%alert_distance_given, "alert_distance_given where alert_distance = 0")
    call accept(scene("bodies = 'lattice'" // lattice_keys), "a lattice in 2D", config)
    call check(all(config%scene%lattice_count == [4, 5, 1]), "one layer of a lattice in 2D")
    call accept(scene("bodies = 'file' bodies_file = 'a.h5' density = 3"), "a bodies file", config)
    call check_equal(config%scene%bodies_file, "a.h5", "bodies_file")
    call accept(column // "&solver method = 'nscdd' / &decomposition grid = 3, 4 /", "a grid in 2D", config)
    call check_equal(config%decomposition%subdomains, 12, "subdomains of a grid")
    call check(all(config%decomposition%grid == [3, 4, 1]), "one layer of a grid in 2D")
    call accept(column // "&solver method = 'nscdd' / &decomposition grid = 3, 4, 1, subdomains = 12 /", "both", config)
    call accept(column // "&solver method = 'schwarz' / &decomposition partition = 'metis', subdomains = 5 /", "metis", config)
    call check_equal(config%decomposition%subdomains, 5, "subdomains alone")
    call accept(column // "&decomposition grid = 1, 1 /", "nlgs on a grid of one box", config)
    call accept(column // "&enriched interface = 'cg' /", "enriched keys with another method", config)
  end subroutine test_derived_values

  !> Values at the ends of what is allowed.
  subroutine test_limits()
    type(config_t) :: config

    call accept("&scene bodies = 'column' column_count = 1 / &time step = 1, steps = 0, theta = 1 /", "no step", config)
    call check_equal(config%time%steps, 0, "steps = 0")
    call accept("&scene bodies = 'column' / &time step = 1, steps = 1, theta = 0.5 /", "theta = 0.5", config)
    call accept(column // "&solver max_iterations = 1, sweeps = 1, check_every = 1 /", "counts of 1", config)
    call accept(column // "&enriched direction = 0, cg_max_iterations = 1 / &output every = 0 /", "direction = 0", config)
    call check_close(config%enriched%direction, 0.0_dp, 0.0_dp, "direction = 0")
    call check_equal(config%output%every, 0, "every = 0")
    call accept(scene("bodies = 'lattice' lattice_count = 1, 1 radius_min = 1 radius_max = 1 seed = -3"), "one radius", config)
    call check_equal(config%scene%seed, -3, "seed = -3")
  end subroutine test_limits

  !> Every word of every choice, and any case.
  subroutine test_words_of_choices()
    call accept_words("solver", "method", "nlgs schwarz schwarz_ec nscdd nscdd_ep newton")
    call accept_words("solver", "criterion", "velocity_error residual error")
    call accept_words("solver", "on_failure", "continue stop discard")
    call accept_words("decomposition", "partition", "grid metis")
    call accept_words("decomposition", "kind", "dual primal")
    call accept_words("enriched", "direction_unit", "relative absolute")
    call accept_words("enriched", "contacts", "all active")
    call accept_words("enriched", "interface", "mumps cg CG")
  end subroutine test_words_of_choices

  subroutine accept_words(group, key, words)
    character(len=*), intent(in) :: group, key
    !> separated by blanks
    character(len=*), intent(in) :: words
    type(config_t) :: config
    integer :: first, length

    first = 1
    do while (first <= len(words))
      length = index(words(first:) // " ", " ") - 1
      call accept(column // "&" // group // " " // key // " = '" // words(first:first + length - 1) // "' /", &
        key // " = " // words(first:first + length - 1), config)
      first = first + length + 1
    end do
    call refuse(column // "&" // group // " " // key // " = 'others' /", &
      "&" // group // " " // key // " = 'others': expected " // listed(group, key))
  end subroutine accept_words

  pure function listed(group, key) result(text)
    character(len=*), intent(in) :: group, key
    character(len=:), allocatable :: text
    select case (group // " " // key)
    case ("solver method")
      text = "'nlgs', 'schwarz', 'schwarz_ec', 'nscdd', 'nscdd_ep' or 'newton'"
    case ("solver criterion")
      text = "'velocity_error', 'residual' or 'error'"
    case ("solver on_failure")
      text = "'continue', 'stop' or 'discard'"
    case ("decomposition partition")
      text = "'grid' or 'metis'"
    case ("decomposition kind")
      text = "'dual' or 'primal'"
    case ("enriched direction_unit")
      text = "'relative' or 'absolute'"
    case ("enriched contacts")
      text = "'all' or 'active'"
    case default
      text = "'mumps' or 'cg'"
    end select
  end function listed

  subroutine test_syntax_of_names()
    type(config_t) :: config

    call accept("&SCENE BODIES='column'/&Time Step=0.1 STEPS=5&End", "any case, no blanks, &end", config)
    call check_equal(config%time%steps, 5, "steps before &End")
    call accept("&scene" // carriage // newline // "bodies" // tab // "=" // tab // "'column'" // carriage // newline &
      // "/" // carriage // newline // time // carriage // newline, "CRLF and tabs", config)
    call check_equal(config%scene%bodies, "column", "bodies between CRLF and tabs")
    call accept("&scene bodies = 'column' / &time steps" // newline // "=" // newline // "5" // newline // "step = 0.1 /", &
      "an assignment on three lines", config)
    call check_equal(config%time%steps, 5, "steps on three lines")
    call accept("! first = 1 /" // newline // "&scene ! &time" // newline // "bodies = 'column'! it's" // newline &
      // "friction = 0.5 ! friction = 0.75" // newline // "/ ! end" // newline // time, "comments", config)
    call check_close(config%scene%contact%friction, 0.5_dp, 0.0_dp, "friction before a comment")
    call accept(char(239) // char(187) // char(191) // column, "a byte order mark", config)
    call accept(column // "&solver / &output&end", "groups without keys", config)
    call accept("&scene, bodies = 'column',, friction = 0.5, /" // time, "commas between assignments", config)
  end subroutine test_syntax_of_names

  subroutine test_syntax_of_values()
    type(config_t) :: config

    call accept(scene("bodies='column'friction=.5 wall_friction=+1d-1,dimension=02"), "numbers", config)
    call check_close(config%scene%contact%friction, 0.5_dp, 0.0_dp, "friction = .5")
    call check_close(config%scene%wall_contact%friction, 0.1_dp, 0.0_dp, "wall_friction = +1d-1")
    call check_equal(config%scene%dimension, 2, "dimension = 02")
    call accept("&scene bodies = 'column' radius = 1 mass = 2. / &time step = 1E-2, steps = +7,/", "more numbers", config)
    call check_close(config%time%step, 0.01_dp, 0.0_dp, "step = 1E-2")
    call check_equal(config%time%steps, 7, "steps = +7")
    call accept(scene("bodies = 'column' gravity = 2*0.5 ! two" // newline // ", 0"), "a repeat count on two lines", config)
    call check_close(config%scene%gravity(2), 0.5_dp, 0.0_dp, "gravity(2) by a repeat count")
    call check_close(config%scene%gravity(3), 0.0_dp, 0.0_dp, "gravity(3) after a comment")
    call accept(scene("bodies = 'column' gravity = , -1.5"), "a null value", config)
    call check_close(config%scene%gravity(1), 0.0_dp, 0.0_dp, "gravity(1) by default")
    call check_close(config%scene%gravity(2), -1.5_dp, 0.0_dp, "gravity(2) after a null value")
    call accept(scene("dimension = 3 bodies = 'column' gravity (2) = 1 gravity( 1 ) = 2, gravity(3:3) = 4"), "entries", config)
    call check_close(config%scene%gravity(1), 2.0_dp, 0.0_dp, "gravity( 1 )")
    call check_close(config%scene%gravity(2), 1.0_dp, 0.0_dp, "gravity (2)")
    call check_close(config%scene%gravity(3), 4.0_dp, 0.0_dp, "gravity(3:3)")
    call accept(column // "&output contacts = F trace = true final_bodies = .T. every = 3 /", "logicals", config)
    call check(.not. config%output%contacts, "contacts = F")
    call check(config%output%trace, "trace = true")
    call check(config%output%final_bodies, "final_bodies = .T.")
    call check_equal(config%output%every, 3, "the key after a logical")
  end subroutine test_syntax_of_values

  subroutine test_syntax_of_texts()
    type(config_t) :: config

    call accept(scene("bodies = 'column' title = 'it''s / & ! = ""a"" friction = 1'"), "single quotes", config)
    call check_equal(config%scene%title, "it's / & ! = ""a"" friction = 1", "title in single quotes")
    call accept(scene("bodies = ""column"" title = ""it's """"here"""" /"""), "double quotes", config)
    call check_equal(config%scene%title, "it's ""here"" /", "title in double quotes")
    call accept(scene("bodies = 'column' title = ''"), "an empty text", config)
    call check_equal(config%scene%title, "", "an empty title")
    call accept(scene("bodies = 'column' title = ''''"), "a text of one quote", config)
    call check_equal(config%scene%title, "'", "a title of one quote")
    call accept(scene("bodies = 'column' title = '  two  blanks'"), "blanks in a text", config)
    call check_equal(config%scene%title, "  two  blanks", "blanks in a title")
    call accept(scene("title = 'results/run 1' bodies = 'column'"), "a path", config)
    call check_equal(config%scene%bodies, "column", "the key after a path")
  end subroutine test_syntax_of_texts

  !> A text has 4096 characters at most, doubled quotes counted once.
  subroutine test_long_texts()
    type(config_t) :: config

    call accept(scene("bodies = 'column' title = '" // repeat("a", 4095) // "b'"), "4096 characters", config)
    call check_equal(config%scene%title, repeat("a", 4095) // "b", "a title of 4096 characters")
    call accept(scene("bodies = 'column' title = '" // repeat("''", 4096) // "'"), "4096 quotes", config)
    call check_equal(config%scene%title, repeat("'", 4096), "a title of 4096 quotes")
    call refuse(scene("bodies = 'column' title = '" // repeat("a", 4097) // "'"), &
      "&scene title = '" // repeat("a", 79) // "...: expected a text in quotes, at most 4096 characters")
    call refuse(scene("bodies = 'column' title = '" // repeat("''", 4097) // "'"), &
      "&scene title = '" // repeat("'", 79) // "...: expected a text in quotes, at most 4096 characters")
  end subroutine test_long_texts

  !> The library of gfortran 12 skips the first namelist read after some that failed.
  subroutine test_failures_leave_nothing_behind()
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=4), parameter :: bad(*) = ["1e- ", "1e=3", "1.d$", "abc ", "1.0."]
    integer :: i

    do i = 1, size(bad)
      call refuse("&scene bodies = 'column' / &time step = " // trim(bad(i)) // " /", &
        "&time step = " // trim(bad(i)) // ": " // positive // " (s)")
      ! nothing in between: any write to a variable would hide what a failed read leaves behind
      call parse_config("case.nml", "&scene bodies = 'column' / &time step = " // bad(i) // " /", config, error)
      call parse_config("case.nml", column, config, error)
      call check(.not. allocated(error), "a file after step = " // bad(i) // " is accepted")
      call check_close(config%time%step, 0.1_dp, 0.0_dp, "step after " // bad(i))
      call check_equal(config%time%steps, 5, "steps after " // bad(i))
    end do
  end subroutine test_failures_leave_nothing_behind

  subroutine test_refused_files()
    character(len=*), parameter :: outside = &
      "' stands outside a group (a group is &name key = value ... /, and a text needs quotes)"
    character(len=*), parameter :: empty = "empty file: expected namelist groups, &scene and &time at least"

    call refuse("", empty)
    call refuse(" " // newline // tab // "! nothing = 0" // newline, empty)
    call refuse("scene: 3 bodies" // newline // column, "not a namelist: line 1: 'scene: 3 bodies" // outside)
    call refuse(column // newline // "end" // newline, "not a namelist: line 2: 'end" // outside)
    call refuse("&scene bodies = 'column' / friction = 1" // newline // time, "not a namelist: line 1: 'friction = 1" // outside)
    call refuse(column // newline // "&output directory = a/b /", "not a namelist: line 2: 'b /" // outside)
    call refuse("&scene bodies = 'column'" // newline // time, &
      "group &scene (line 1) is not closed: expected / before &time (line 2)")
    call refuse("&scene bodies = 'column' /" // newline // "&time step = 1 steps = 1 ! /", &
      "group &time (line 2) is not closed: expected / before the end of the file")
    call refuse("&scene bodies = 'column", "&scene bodies = 'column: expected a quote that closes on its line (line 1)")
    call refuse("&scene" // newline // "title = ""a' / " // newline // "/" // time, &
      "&scene title = ""a' /: expected a quote that closes on its line (line 2)")
    call refuse("& scene bodies = 'column' /" // time, "line 1: expected the name of a group after &")
    call refuse("&scene" // newline // "bodies 'column' /" // time, &
      "&scene (line 2): expected key = value, found 'bodies 'column' / &time step = 0.1, steps = 5 /'")
    call refuse("&scene 3 = 4 /" // time, "&scene (line 1): expected key = value, found '3 = 4 / &time step = 0.1, steps = 5 /'")
    call refuse("&scene friction(1 = 2 /" // newline // ") /", "&scene (line 1): expected key = value, found 'friction(1 = 2 /'")
    call refuse("&scene friction(1", "&scene (line 1): expected key = value, found 'friction(1'")
    call refuse("&scene friction", "&scene (line 1): expected key = value, found 'friction'")
    call refuse("&scene friction =", "group &scene (line 1) is not closed: expected / before the end of the file")
    call refuse("&", "line 1: expected the name of a group after &")
  end subroutine test_refused_files

  subroutine test_refused_names()
    call refuse(column // "&solvr /", "unknown group &solvr; did you mean &solver?")
    call refuse(column // "&physics /", &
      "unknown group &physics: expected one of &scene &boundary &sample &insertion &material &law &time &solver &decomposition " &
      // "&enriched &output &region")
    call refuse(column // "&solver methd = 'nlgs' /", "unknown key 'methd' in &solver; did you mean 'method'?")
    call refuse(column // "&solver METHDO = 'nlgs' /", "unknown key 'methdo' in &solver; did you mean 'method'?")
    call refuse(column // "&time sweeps = 3 /", "group &time is given twice (lines 1 and 1): expected once")
    call refuse("&scene / &time sweeps = 3 /", "unknown key 'sweeps' in &time; it belongs to &solver")
    call refuse("&scene / &time length = 3 /", "unknown key 'length' in &time: expected one of "//time_keys)
    call refuse("&scene / &time sweep = 3 /", "unknown key 'sweep' in &time: expected one of "//time_keys)
    call refuse("&scene / &time " // repeat("step", 15) // " = 3 /", &
      "unknown key '" // repeat("step", 15) // "' in &time: expected one of "//time_keys)
    call refuse("&scene bodies = 'column' /", "group &time is missing: expected &time ... /")
    call refuse(time, "group &scene is missing: expected &scene ... /")
    call refuse("&scene /" // time, "&scene bodies is missing: expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse("&scene bodies = 'column' / &time steps = 1 /", &
      "&time step is missing: expected a finite real number > 0 (s)")
    call refuse("&scene bodies = 'column' / &time step = 1 /", "&time steps is missing: expected an integer >= 0")
  end subroutine test_refused_names

  subroutine test_refused_duplicates()
    call refuse(column // newline // "&scene /", "group &scene is given twice (lines 1 and 2): expected once")
    call refuse(scene("bodies = 'column' friction = 0.5 friction = 0.25"), &
      "&scene friction = 0.25: expected once, but it is given twice, first as friction = 0.5")
    call refuse(scene("bodies = 'column' gravity(2) = 1 gravity = 3*0"), &
      "&scene gravity = 3*0: expected once, but it is given twice, first as gravity(2) = 1")
    call refuse(scene("bodies = 'column' gravity(1:2) = 0, 1 gravity(3) = 0 gravity(2) = 5"), &
      "&scene gravity(2) = 5: expected once, but it is given twice, first as gravity(1:2) = 0, 1, gravity(3) = 0")
    call refuse(scene("dimension = 2 dimension = 3 bodies = 'column'"), &
      "&scene dimension = 3: expected once, but it is given twice, first as dimension = 2")
  end subroutine test_refused_duplicates

  !> Values that are not of the key's kind.
  subroutine test_refused_kinds()
    call refuse(scene("bodies = column"), "&scene bodies = column: expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(scene("bodies = 'columns'"), "&scene bodies = 'columns': expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(scene("bodies = 'column lattice'"), &
      "&scene bodies = 'column lattice': expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(scene("bodies = ''"), "&scene bodies = '': expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(scene("bodies = 3"), "&scene bodies = 3: expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(scene("bodies = 'column' title = 3"), "&scene title = 3: expected a text in quotes, at most 4096 characters")
    call refuse(scene("bodies = 'column' title = 'a', 'b'"), &
      "&scene title = 'a', 'b': expected a text in quotes, at most 4096 characters")
    call refuse(scene("bodies = 'column' column_count = 2.5"), "&scene column_count = 2.5: expected an integer >= 1")
    call refuse(scene("bodies = 'column' column_count = 'a'"), "&scene column_count = 'a': expected an integer >= 1")
    call refuse(scene("bodies = 'column' column_count = 99999999999"), &
      "&scene column_count = 99999999999: expected an integer >= 1, at most 2147483647")
    call refuse(column // "&output trace = yes /", "&output trace = yes: expected .true. or .false.")
    call refuse(column // "&output trace = tomato /", "&output trace = tomato: expected .true. or .false.")
    call refuse(column // "&output trace = 1 /", "&output trace = 1: expected .true. or .false.")
    call refuse(column // "&output trace = /", "&output trace = (nothing): expected .true. or .false.")
    call refuse(column // "&output directory = , /", &
      "&output directory = (nothing): expected a text in quotes, not empty, at most 4096 characters")
  end subroutine test_refused_kinds

  !> Numbers that are none, or not finite.
  subroutine test_refused_numbers()
    call refuse_radius("1,5")
    call refuse_radius("1 2")
    call refuse_radius("1;")
    call refuse_radius("one")
    call refuse_radius("1.0f")
    call refuse_radius("(1, 2)")
    call refuse_radius("1*")
    call refuse_radius("NaN")
    call refuse_radius("inf")
    call refuse_radius("-Infinity")
    call refuse_radius("1e999")
    call refuse_radius("1-1")
    call refuse_radius("1+1")
    call refuse_radius("1.5-3")
    call refuse_radius("infinity")
    call refuse(scene("bodies = 'column' gravity = 0, 1-1"), &
      "&scene gravity = 0, 1-1: expected at most 3 finite real numbers (m/s^2)")
    call refuse(scene("bodies = 'column' gravity = 2*1+1"), &
      "&scene gravity = 2*1+1: expected at most 3 finite real numbers (m/s^2)")
    call refuse_radius("1 .5 ! a comment" // newline // "2", "1 .5 2")
    call refuse(scene("bodies = 'column' radius = mass = 1"), "&scene radius = (nothing): " // positive // " (m)")
    call refuse(scene("bodies = 'column' gravity = 0, nan"), &
      "&scene gravity = 0, nan: expected at most 3 finite real numbers (m/s^2)")
    call refuse(column // "&solver tolerance = 1e400 /", "&solver tolerance = 1e400: " // positive)
  end subroutine test_refused_numbers

  subroutine refuse_radius(value, shown)
    character(len=*), intent(in) :: value
    !> the value in the message, if not the same
    character(len=*), intent(in), optional :: shown
    character(len=:), allocatable :: quoted
    quoted = value
    if (present(shown)) quoted = shown
    call refuse(scene("bodies = 'column' radius = " // value), "&scene radius = " // quoted // ": " // positive // " (m)")
  end subroutine refuse_radius

  !> Entries that a key does not have.
  subroutine test_refused_entries()
    call refuse(scene("bodies = 'column' gravity = 4*0"), &
      "&scene gravity = 4*0: expected at most 3 finite real numbers (m/s^2)")
    call refuse(column // "&decomposition grid(4) = 1 /", "&decomposition grid(4) = 1: expected at most 3 integers >= 1")
    call refuse(column // "&decomposition grid(0) = 1 /", "&decomposition grid(0) = 1: expected at most 3 integers >= 1")
    call refuse(column // "&decomposition grid(a) = 1 /", "&decomposition grid(a) = 1: expected at most 3 integers >= 1")
    call refuse(column // "&decomposition grid() = 1 /", "&decomposition grid() = 1: expected at most 3 integers >= 1")
    call refuse(column // "&solver sweeps(1) = 1 /", "&solver sweeps(1) = 1: expected sweeps without an index")
  end subroutine test_refused_entries

  subroutine test_rules_of_scene()
    call refuse(scene("bodies = 'column' dimension = 4"), "&scene dimension = 4: expected an integer 2 or 3")
    call refuse(scene("bodies = 'column' dimension = 1"), "&scene dimension = 1: expected an integer 2 or 3")
    call refuse(scene("bodies = 'column' gravity = 0, 0, -9.81"), &
      "&scene gravity = 0, 0, -9.81: expected a third component of 0 where dimension = 2")
    call refuse(scene("bodies = 'column' friction = -0.5"), &
      "&scene friction = -0.5: expected a finite real number >= 0")
    call refuse(scene("bodies = 'column' wall_friction = -1"), &
      "&scene wall_friction = -1: expected a finite real number >= 0")
    call refuse(scene("bodies = 'column' alert_distance = -1"), &
      "&scene alert_distance = -1: expected a finite real number >= 0 (m)")
    call refuse(scene("bodies = 'column' restitution = 1.5"), &
      "&scene restitution = 1.5: expected a finite real number in [0, 1]")
    call refuse(scene("bodies = 'column' restitution = -0.5"), &
      "&scene restitution = -0.5: expected a finite real number in [0, 1]")
    call refuse(scene("bodies = 'column' wall_restitution = -1"), &
      "&scene wall_restitution = -1: expected a finite real number in [0, 1]")
    call refuse(scene("bodies = 'column' wall_restitution = 2"), &
      "&scene wall_restitution = 2: expected a finite real number in [0, 1]")
    call refuse(scene("bodies = 'column' period = 1, -1"), &
      "&scene period = 1, -1: expected at most 3 finite real numbers >= 0 (m)")
    call refuse(scene("bodies = 'column' period(3) = 1"), "&scene period(3) = 1: " // third)
    call refuse(scene("bodies = 'column' period_origin = 0, 0, 1"), "&scene period_origin = 0, 0, 1: " // third)
    call refuse(scene("bodies = 'column' cell_pressure = 0, -2"), &
      "&scene cell_pressure = 0, -2: expected at most 3 finite real numbers >= 0 (Pa, N/m in 2D)")
    call refuse(scene("bodies = 'column' cell_inertia = 0"), "&scene cell_inertia = 0: expected a finite real number > 0")
    call refuse(scene("bodies = 'column' cell_strain_rate = 0, 1 cell_pressure = 1, 2"), &
      "&scene cell_strain_rate = 0, 1: expected 0 along the axes of cell_pressure = 1, 2")
    call refuse(scene("bodies = 'column' cell_shear_rate = 1 cell_shear_stress = 2"), &
      "&scene cell_shear_rate = 1: expected 0 for the components of cell_shear_stress = 2")
    call refuse(scene("bodies = 'column' cell_shear_rate = 1, 2"), &
      "&scene cell_shear_rate = 1, 2: expected one entry where dimension = 2")
    call refuse(scene("bodies = 'column' body_force(3) = -1"), "&scene body_force(3) = -1: " // third)
    call refuse(scene("bodies = 'column' skin = -1"), "&scene skin = -1: expected a finite real number >= 0 (m)")
    call refuse(scene("bodies = 'column' overlap_allowed = 0"), "&scene overlap_allowed = 0: " // positive // " (m)")
    call refuse(scene("bodies = 'column' list_steps = -1"), "&scene list_steps = -1: expected a finite real number >= 0")
    call refuse(scene("bodies = 'column' start_overlap = -1"), "&scene start_overlap = -1: expected a finite real number >= 0")
    call refuse(scene("bodies = 'column' rotation = 0"), "&scene rotation = 0: expected .true. or .false.")
    call refuse(scene("bodies = 'column' column_count = 0"), "&scene column_count = 0: expected an integer >= 1")
    call refuse(scene("bodies = 'column' radius = 0"), "&scene radius = 0: " // positive // " (m)")
    call refuse(scene("bodies = 'column' mass = 0"), "&scene mass = 0: " // positive // " (kg)")
    call refuse(scene("bodies = 'file' bodies_file = 'a.h5' density = 0"), &
      "&scene density = 0: " // positive // " (kg/m^3, kg/m^2 in 2D)")
    call refuse(scene("bodies = 'file'"), "&scene bodies_file is missing: expected a text in quotes, not empty, " &
      // "at most 4096 characters, required by bodies = 'file'")
    call refuse(scene("bodies = 'file' bodies_file = ' '"), &
      "&scene bodies_file = ' ': expected a text in quotes, not empty, at most 4096 characters")
  end subroutine test_rules_of_scene

  !> Keys that belong to another kind of bodies.
  subroutine test_rules_of_bodies()
    call refuse_stranger("column", "", "bodies_file = 'a.h5'", "'file'")
    call refuse_stranger("column", "", "density = 1", "'lattice', 'file', 'sample' or 'none'")
    call refuse_stranger("column", "", "lattice_count = 1, 1", "'lattice'")
    call refuse_stranger("column", "", "radius_min = 1", "'lattice'")
    call refuse_stranger("column", "", "radius_max = 1", "'lattice'")
    call refuse_stranger("column", "", "seed = 1", "'lattice'")
    call refuse_stranger("file", "bodies_file = 'a.h5'", "column_count = 3", "'column'")
    call refuse_stranger("file", "bodies_file = 'a.h5'", "seed = 1", "'lattice'")
    call refuse_stranger("lattice", lattice_keys, "column_count = 3", "'column'")
    call refuse_stranger("lattice", lattice_keys, "radius = 1", "'column'")
    call refuse_stranger("lattice", lattice_keys, "mass = 1", "'column'")
    call refuse_stranger("lattice", lattice_keys, "bodies_file = 'a.h5'", "'file'")
  end subroutine test_rules_of_bodies

  subroutine refuse_stranger(bodies, keys, assignment, owners, groups)
    !> the kind of bodies, and the keys that it needs
    character(len=*), intent(in) :: bodies, keys
    !> what does not belong there, and to what it belongs
    character(len=*), intent(in) :: assignment, owners
    !> that the bodies need
    character(len=*), intent(in), optional :: groups
    character(len=:), allocatable :: key
    key = assignment(:index(assignment, " ") - 1)
    call refuse(scene("bodies = '" // bodies // "' " // keys // " " // assignment, groups), "&scene " // assignment // ": " &
      // key // " belongs to bodies = " // owners // "; expected none where bodies = '" // bodies // "'")
  end subroutine refuse_stranger

  subroutine test_rules_of_lattice()
    character(len=*), parameter :: lattice = "bodies = 'lattice' radius_min = 0.1 radius_max = 0.2 "
    character(len=*), parameter :: counted = "bodies = 'lattice' lattice_count = 2, 2 "

    call refuse(scene(lattice), &
      "&scene lattice_count is missing: expected at most 3 integers >= 1, required by bodies = 'lattice'")
    call refuse(scene(lattice // "lattice_count = 3"), &
      "&scene lattice_count = 3: expected 2 integers >= 1 where dimension = 2")
    call refuse(scene(lattice // "lattice_count = 3, 4, 5"), &
      "&scene lattice_count = 3, 4, 5: expected 2 integers >= 1 where dimension = 2")
    call refuse(scene(lattice // "lattice_count = 3, 4 dimension = 3"), &
      "&scene lattice_count = 3, 4: expected 3 integers >= 1 where dimension = 3")
    call refuse(scene(lattice // "lattice_count = 3, -4"), &
      "&scene lattice_count = 3, -4: expected 2 integers >= 1 where dimension = 2")
    call refuse(scene(lattice // "lattice_count = 2*65536"), &
      "&scene lattice_count = 2*65536: expected at most 2147483647 bodies")
    call refuse(scene(counted // "radius_max = 1"), &
      "&scene radius_min is missing: " // positive // " (m), required by bodies = 'lattice'")
    call refuse(scene(counted // "radius_min = 1"), &
      "&scene radius_max is missing: " // positive // " (m), required by bodies = 'lattice'")
    call refuse(scene(counted // "radius_min = 0 radius_max = 1"), "&scene radius_min = 0: " // positive // " (m)")
    call refuse(scene(counted // "radius_min = 1 radius_max = -1"), "&scene radius_max = -1: " // positive // " (m)")
    call refuse(scene(counted // "radius_min = 1 radius_max = 0"), "&scene radius_max = 0: " // positive // " (m)")
    call refuse(scene(counted // "radius_min = 2 radius_max = 1"), &
      "&scene radius_min = 2: expected at most radius_max, here radius_max = 1")
    call refuse(scene(counted // "radius_min = 1 radius_max = 1 density = -1"), &
      "&scene density = -1: " // positive // " (kg/m^3, kg/m^2 in 2D)")
  end subroutine test_rules_of_lattice

  !> A strain ends a run where that component of the cell moves, and in its direction.
  subroutine test_rules_of_stop_strains()
    character(len=*), parameter :: steps = " / &time step = 1 steps = 1 "
    type(config_t) :: config

    call accept("&scene bodies = 'column' cell_strain_rate = 0, -2, cell_shear_stress = 3" // steps &
      // "stop_cell_strain = 0, -0.5 stop_cell_shear = -0.25 /", "strains that end the run", config)
    call check_vector(config%time%stop_cell_strain, [0.0_dp, -0.5_dp, 0.0_dp], "stop_cell_strain")
    call check_vector(config%time%stop_cell_shear, [-0.25_dp, 0.0_dp, 0.0_dp], "stop_cell_shear")
    call accept("&scene bodies = 'column' cell_pressure = 4" // steps // "stop_cell_strain = 0.5 /", "of a pressure", config)
    call accept("&scene bodies = 'column' cell_table = 'c.csv'" // steps // "stop_cell_strain = 0.5 /", "of a table", config)
    call refuse("&scene bodies = 'column'" // steps // "stop_cell_strain = 0, 0.5 /", "&time stop_cell_strain = 0, 0.5: expected " &
      // "0 for components of the cell that neither cell_strain_rate nor cell_pressure moves")
    call refuse("&scene bodies = 'column' cell_strain_rate = 1, 1" // steps // "stop_cell_shear = 1 /", &
      "&time stop_cell_shear = 1: expected 0 for components of the cell that neither cell_shear_rate nor cell_shear_stress moves")
    call refuse("&scene bodies = 'column' cell_strain_rate = 0, -2" // steps // "stop_cell_strain = 0, 0.5 /", &
      "&time stop_cell_strain = 0, 0.5: expected the sign of cell_strain_rate = 0, -2")
    call refuse("&scene bodies = 'column' cell_shear_rate = 2" // steps // "stop_cell_shear = -1 /", &
      "&time stop_cell_shear = -1: expected the sign of cell_shear_rate = 2")
    call refuse("&scene bodies = 'column' cell_shear_rate = 2" // steps // "stop_cell_shear = 1, 1 /", &
      "&time stop_cell_shear = 1, 1: expected one entry where dimension = 2")
  end subroutine test_rules_of_stop_strains

  subroutine test_rules_of_time_and_solver()
    character(len=*), parameter :: bodies = "&scene bodies = 'column' / "

    call refuse(bodies // "&time step = 0 steps = 1 /", "&time step = 0: " // positive // " (s)")
    call refuse(bodies // "&time step = -1e-3 steps = 1 /", "&time step = -1e-3: " // positive // " (s)")
    call refuse(bodies // "&time step = 1 steps = -1 /", "&time steps = -1: expected an integer >= 0")
    call refuse(bodies // "&time step = 1 steps = 1 theta = 0.25 /", &
      "&time theta = 0.25: expected a finite real number in [0.5, 1]")
    call refuse(bodies // "&time step = 1 steps = 1 theta = 1.5 /", &
      "&time theta = 1.5: expected a finite real number in [0.5, 1]")
    call test_rules_of_stop_strains()
    call refuse(scene("bodies = 'lattice'" // lattice_keys, "&solver criterion = 'error' /"), &
      "&solver criterion = 'error': expected 'residual': the exact solution, and so the error, is known for " &
      // "bodies = 'column' only")
    call refuse(column // "&solver tolerance = 0 /", "&solver tolerance = 0: " // positive)
    call refuse(column // "&solver accuracy = 0 /", "&solver accuracy = 0: " // positive)
    call refuse(column // "&solver max_iterations = 0 /", "&solver max_iterations = 0: expected an integer >= 1")
    call refuse(column // "&solver sweeps = 0 /", "&solver sweeps = 0: expected an integer >= 1")
    call refuse(column // "&solver method = 'schwarz' relaxation = 0.0 /", &
      "&solver relaxation = 0.0: expected a finite real number in (0, 1]")
    call refuse(column // "&solver method = 'schwarz' relaxation = 1.5 /", &
      "&solver relaxation = 1.5: expected a finite real number in (0, 1]")
    call refuse(column // "&solver relaxation = 0.5 /", "&solver relaxation = 0.5: relaxation belongs to method = 'schwarz' or " &
      // "'schwarz_ec'; expected none where method = 'nlgs'")
    call refuse(scene("bodies = 'column' gravity_table = 'g.csv' gravity = 0, -1"), &
      "&scene gravity = 0, -1: expected none where gravity_table = 'g.csv' replaces it")
    call refuse(column // "&solver check_every = 0 /", "&solver check_every = 0: expected an integer >= 1")
    call refuse(column // "&solver spot_checks = -0.1 /", "&solver spot_checks = -0.1: expected a finite real number in [0, 1]")
    call refuse(column // "&solver velocity_scale = 0 /", "&solver velocity_scale = 0: " // positive // " (m/s)")
  end subroutine test_rules_of_time_and_solver

  subroutine test_rules_of_decomposition()
    character(len=*), parameter :: nscdd = column // "&solver method = 'nscdd' / &decomposition "
    character(len=*), parameter :: one = &
      "expected one subdomain where &solver method = 'nlgs'; for several use method = 'schwarz', 'schwarz_ec', 'nscdd', "// &
      & "'nscdd_ep' or 'newton'"

    call refuse(nscdd // "subdomains = 0 /", "&decomposition subdomains = 0: expected an integer >= 1")
    call refuse(nscdd // "repartition_every = -1 /", "&decomposition repartition_every = -1: expected an integer >= 0")
    call refuse(nscdd // "repartition_imbalance = 1 /", &
      "&decomposition repartition_imbalance = 1: expected a finite real number 0 or > 1")
    call refuse(nscdd // "repartition_imbalance = -2 /", &
      "&decomposition repartition_imbalance = -2: expected a finite real number 0 or > 1")
    call refuse(nscdd // "partition = 'metis' grid = 2, 2 /", &
      "&decomposition grid = 2, 2: expected no grid where partition = 'metis': give subdomains, or partition = 'grid'")
    call refuse(nscdd // "grid = 2 /", "&decomposition grid = 2: expected 2 integers >= 1 where dimension = 2")
    call refuse(nscdd // "grid = 2, 2, 2 /", "&decomposition grid = 2, 2, 2: expected 2 integers >= 1 where dimension = 2")
    call refuse(nscdd // "grid = 2, -2 /", "&decomposition grid = 2, -2: expected 2 integers >= 1 where dimension = 2")
    call refuse(nscdd // "grid = 0, 0, 0 /", "&decomposition grid = 0, 0, 0: expected 2 integers >= 1 where dimension = 2")
    call refuse(nscdd // "partition = 'metis' grid = 3*0 /", &
      "&decomposition grid = 3*0: expected no grid where partition = 'metis': give subdomains, or partition = 'grid'")
    call refuse(nscdd // "grid = 2*1000000 /", "&decomposition grid = 2*1000000: expected at most 2147483647 subdomains")
    call refuse(scene("bodies = 'column' dimension = 3", "&solver method = 'nscdd' / &decomposition grid(1:2) = 2, 2 /"), &
      "&decomposition grid(1:2) = 2, 2: expected 3 integers >= 1 where dimension = 3")
    call refuse(nscdd // "grid(2) = 3 grid(1) = 2 subdomains = 5 /", &
      "&decomposition subdomains = 5: expected 6, the product of grid(2) = 3, grid(1) = 2")
    call refuse(nscdd // "grid(2) = 3 grid(1) = 2 subdomains = 7 /", &
      "&decomposition subdomains = 7: expected 6, the product of grid(2) = 3, grid(1) = 2")
    call refuse(column // "&decomposition subdomains = 4 /", "&decomposition subdomains = 4: " // one)
    call refuse(column // "&decomposition grid = 2, 3 /", "&decomposition grid = 2, 3: " // one)
  end subroutine test_rules_of_decomposition

  subroutine test_rules_of_enriched_and_output()
    call refuse(column // "&enriched direction = -1 /", &
      "&enriched direction = -1: expected a finite real number >= 0 (1/W_aa or kg)")
    call refuse(column // "&enriched cg_tolerance = 0 /", "&enriched cg_tolerance = 0: expected a finite real number in (0, 1)")
    call refuse(column // "&enriched cg_tolerance = 1 /", "&enriched cg_tolerance = 1: expected a finite real number in (0, 1)")
    call refuse(column // "&enriched cg_max_iterations = 0 /", "&enriched cg_max_iterations = 0: expected an integer >= 1")
    call refuse(column // "&output directory = '~/run' /", &
      "&output directory = '~/run': expected a path without ~, which a shell replaces and this program does not")
    call refuse(column // "&output directory = '' /", &
      "&output directory = '': expected a text in quotes, not empty, at most 4096 characters")
    call refuse(column // "&output every = -1 /", "&output every = -1: expected an integer >= 0")
    call refuse(column // "&output tracked_bodies = 1, -2 /", &
      & "&output tracked_bodies = 1, -2: expected at most 8 integers >= 1")
    call refuse(column // "&output tracked_bodies = 1, 2, 1 /", &
      & "&output tracked_bodies = 1, 2, 1: expected each identifier once")
    call refuse(column // "&output tracked_forces = .true. /", &
      & "&output tracked_forces = .true.: expected .false. without tracked_bodies, whose forces it adds")
    call refuse(column // "&output fclib_step = -1 /", "&output fclib_step = -1: expected an integer >= 0")
    call refuse(column // "&output history_every = 0 /", "&output history_every = 0: expected an integer >= 1")
    call refuse(column // "&output checkpoint_every = -1 /", "&output checkpoint_every = -1: expected an integer >= 0")
    call refuse(column // "&output checkpoint_seconds = -1 /", &
      "&output checkpoint_seconds = -1: expected a finite real number >= 0 (s)")
    call refuse(column // "&output walltime = -1 /", "&output walltime = -1: expected a finite real number >= 0 (s)")
  end subroutine test_rules_of_enriched_and_output

  !> Any number of boundaries, in the order of the file.
  subroutine test_boundaries()
    type(config_t) :: config

    call accept("&boundary name = 'floor'" // plane_keys // "friction = 0.5 remove_at = 3 /" &
      // scene("bodies = 'column' wall_friction = 0.25 wall_restitution = 0.75") &
      // "&boundary shape = 'circle' radius = 2 point = 1, 2 pivot = 3, 4 rotation = 5 velocity = 6, 7 table = 't.csv'" &
      // " table_repeats = T oscillation = 0.5, 0.25 rotation_oscillation = 0.125 frequency = 11 phase = -12 /" &
      // "&BOUNDARY Name = ""a, 'lid'"" shape = 'plane' normal = 0, -1 free(2) = T mass = 8 force(2) = -9 pressure = 10" &
      // " restitution = 0.125 /", "three boundaries", config)
    call check_equal(size(config%boundaries), 3, "number of boundaries")
    if (size(config%boundaries) /= 3) return
    associate (floor => config%boundaries(1), drum => config%boundaries(2), lid => config%boundaries(3))
      call check_equal(floor%name, "floor", "name of the 1st")
      call check_equal(drum%name, "boundary 2", "default name of the 2nd")
      call check_equal(lid%name, "a, 'lid'", "name of the 3rd")
      call check_equal(floor%shape, "plane", "shape of the 1st")
      call check_equal(drum%shape, "circle", "shape of the 2nd")
      call check_surface(floor, "normal", [0.0_dp, 1.0_dp, 0.0_dp], "normal of the 1st")
      call check_surface(lid, "normal", [0.0_dp, -1.0_dp, 0.0_dp], "normal of the 3rd")
      call check_close(floor%contact%friction, 0.5_dp, 0.0_dp, "friction of the 1st")
      call check_close(drum%contact%friction, 0.25_dp, 0.0_dp, "friction of the 2nd is wall_friction")
      call check(floor%contact_given%friction .and. .not. drum%contact_given%friction, "friction_given")
      call check_close(lid%contact%restitution, 0.125_dp, 0.0_dp, "restitution of the 3rd")
      call check_close(drum%contact%restitution, 0.75_dp, 0.0_dp, "restitution of the 2nd is wall_restitution")
      call check(lid%contact_given%restitution .and. .not. drum%contact_given%restitution, "restitution_given")
      call check_close(floor%remove_at, 3.0_dp, 0.0_dp, "remove_at of the 1st")
      call check(floor%remove_at_given .and. .not. drum%remove_at_given, "remove_at_given")
      call check(drum%remove_at > 1.0e300_dp, "the 2nd is never taken away")
      call check_surface(drum, "radius", [2.0_dp, 0.0_dp, 0.0_dp], "radius of the 2nd")
      call check_surface(drum, "point", [1.0_dp, 2.0_dp, 0.0_dp], "point of the 2nd")
      call check_vector(drum%pivot, [3.0_dp, 4.0_dp, 0.0_dp], "pivot of the 2nd")
      call check(drum%pivot_given .and. .not. lid%pivot_given, "pivot_given")
      call check_vector(drum%rotation, [5.0_dp, 0.0_dp, 0.0_dp], "rotation of the 2nd")
      call check_vector(drum%velocity, [6.0_dp, 7.0_dp, 0.0_dp], "velocity of the 2nd")
      call check_equal(drum%table, "t.csv", "table of the 2nd")
      call check(drum%table_repeats .and. .not. lid%table_repeats, "table_repeats")
      call check_vector(drum%oscillation, [0.5_dp, 0.25_dp, 0.0_dp], "oscillation of the 2nd")
      call check_vector(drum%rotation_oscillation, [0.125_dp, 0.0_dp, 0.0_dp], "rotation_oscillation of the 2nd")
      call check_close(drum%frequency, 11.0_dp, 0.0_dp, "frequency")
      call check_close(drum%phase, -12.0_dp, 0.0_dp, "phase")
      call check(all(lid%free .eqv. [.false., .true., .false.]), "free of the 3rd")
      call check_vector(lid%force, [0.0_dp, -9.0_dp, 0.0_dp], "force of the 3rd")
      call check_close(lid%pressure, 10.0_dp, 0.0_dp, "pressure of the 3rd")
      call check_close(lid%mass, 8.0_dp, 0.0_dp, "mass of the 3rd")
    end associate
  end subroutine test_boundaries

  subroutine test_boundary_defaults()
    type(config_t) :: config

    call accept(column // "&boundary" // plane_keys // "point = 1, 2 /", "a plane", config)
    associate (plane => config%boundaries(1))
      call check_equal(plane%name, "boundary 1", "default name")
      call check_surface(plane, "point", [1.0_dp, 2.0_dp, 0.0_dp], "point")
      call check_vector(plane%pivot, [1.0_dp, 2.0_dp, 0.0_dp], "default pivot")
      call check_vector(plane%velocity, spread(0.0_dp, 1, 3), "default velocity")
      call check_vector(plane%rotation, spread(0.0_dp, 1, 3), "default rotation of a boundary")
      call check_vector(plane%force, spread(0.0_dp, 1, 3), "default force")
      call check_close(plane%pressure, 0.0_dp, 0.0_dp, "default pressure")
      call check(.not. any(plane%free), "default free")
      call check_equal(plane%table, "", "default table")
      call check_close(plane%contact%friction, 0.0_dp, 0.0_dp, "default friction of a boundary")
      call check_close(plane%contact%restitution, 0.0_dp, 0.0_dp, "default restitution of a boundary")
    end associate
    call accept(column // "&boundary" // plane_keys // "/", "a plane through the origin", config)
    call check_surface(config%boundaries(1), "point", [0.0_dp, 0.0_dp, 0.0_dp], "default point")
    call accept(column // "&boundary" // plane_keys // "point = 1, 2 pivot(1) = 3 /", "half a pivot", config)
    call check_vector(config%boundaries(1)%pivot, [3.0_dp, 2.0_dp, 0.0_dp], "pivot(1) given alone")
  end subroutine test_boundary_defaults

  !> Lists of logicals.
  subroutine test_boundary_logicals()
    character(len=*), parameter :: plane = "&boundary shape = 'plane' normal = 1, 1, 1 mass = 1 "
    character(len=*), parameter :: space = "&scene bodies = 'column' dimension = 3 /" // time
    character(len=*), parameter :: expected = ": expected at most 3 of .true. or .false."
    type(config_t) :: config

    call accept(space // plane // "free = T, .false. True /", "three logicals", config)
    call check(all(config%boundaries(1)%free .eqv. [.true., .false., .true.]), "free = T, .false. True")
    call accept(space // plane // "free = 2*.true. /", "a repeat count", config)
    call check(all(config%boundaries(1)%free .eqv. [.true., .true., .false.]), "free = 2*.true.")
    call accept(space // plane // "free(3) = .t. free(1:2) = f, f /", "entries of a logical", config)
    call check(all(config%boundaries(1)%free .eqv. [.false., .false., .true.]), "free(3) and free(1:2)")
    call accept(space // plane // "free = , T /", "a null value in a list of logicals", config)
    call check(all(config%boundaries(1)%free .eqv. [.false., .true., .false.]), "free = , T")
    call refuse(space // plane // "free = tomato /", "&boundary (the 1st) free = tomato" // expected)
    call refuse(space // plane // "free = T tomato /", "&boundary (the 1st) free = T tomato" // expected)
    call refuse(space // plane // "free = 4*T /", "&boundary (the 1st) free = 4*T" // expected)
    call refuse(space // plane // "free = 3* /", "&boundary (the 1st) free = 3*" // expected)
    call refuse(space // plane // "free = x*T /", "&boundary (the 1st) free = x*T" // expected)
    call refuse(space // plane // "free = 2*2*T /", "&boundary (the 1st) free = 2*2*T" // expected)
    call refuse(space // plane // "free = *T /", "&boundary (the 1st) free = *T" // expected)
    call refuse(space // plane // "free = 1 /", "&boundary (the 1st) free = 1" // expected)
    call refuse(space // plane // "free = /", "&boundary (the 1st) free = (nothing)" // expected)
    call refuse(space // plane // "free = T free(1) = T /", &
      "&boundary (the 1st) free(1) = T: expected once, but it is given twice, first as free = T")
    call refuse(column // "&output trace = T, T /", "&output trace = T, T: expected .true. or .false.")
  end subroutine test_boundary_logicals

  !> Messages name the group and which one.
  subroutine test_messages_of_groups()
    character(len=*), parameter :: plane = "&boundary" // plane_keys // "/ "
    integer :: i
    character(len=:), allocatable :: many

    call refuse(column // plane // "&boundary radius = -1 shape = 'circle' name = 'lid' /", &
      "&boundary (the 2nd, 'lid') radius = -1: " // positive // " (m)")
    call refuse(column // plane // plane // "&boundary radius = one name = 'it''s' /", &
      "&boundary (the 3rd, 'it''s') radius = one: " // positive // " (m)")
    call refuse(column // "&boundary radius = one / " // plane, "&boundary (the 1st) radius = one: " // positive // " (m)")
    call refuse(column // plane // "&boundary name = lid /", &
      "&boundary (the 2nd) name = lid: expected a text in quotes, not empty, at most 4096 characters")
    call refuse(column // plane // "&boundary name = 'a' name = 'b' /", &
      "&boundary (the 2nd, 'a') name = 'b': expected once, but it is given twice, first as name = 'a'")
    call refuse(column // plane // "&boundary shap = 'plane' /", "unknown key 'shap' in &boundary; did you mean 'shape'?")
    call refuse(column // "&boundry /", "unknown group &boundry; did you mean &boundary?")
    call refuse(column // plane // "&boundary name = 'b' /", "&boundary (the 2nd, 'b') shape is missing: expected 'plane', " &
      // "'segment', 'rectangle', 'circle', 'cylinder', 'outlet', 'mesh', 'grains' or 'wall'")
    many = column
    do i = 1, 21
      many = many // plane
      if (i == 3) call refuse(many // "&boundary name = '' /", "&boundary (the 4th, '') shape is missing: expected 'plane', " &
        // "'segment', 'rectangle', 'circle', 'cylinder', 'outlet', 'mesh', 'grains' or 'wall'")
      if (i == 10) call refuse(many // "&boundary group = a /", "&boundary (the 11th) group = a: expected an integer >= 1")
    end do
    call refuse(many // "&boundary group = a /", "&boundary (the 22nd) group = a: expected an integer >= 1")
  end subroutine test_messages_of_groups

  !> Each shape in its dimension, and not in the other.
  subroutine test_shapes()
    character(len=*), parameter :: in_plane = "'plane', 'segment', 'circle', 'outlet', " // &
      & "'mesh', 'grains' or 'wall' where dimension = 2"
    character(len=*), parameter :: in_space = "'plane', 'rectangle', 'cylinder', 'outlet', " // &
      & "'mesh', 'grains' or 'wall' where dimension = 3"
    character(len=*), parameter :: file = "&scene bodies = 'file' bodies_file = 'a.h5' /" // time
    character(len=*), parameter :: space = "&scene bodies = 'file' bodies_file = 'a.h5' dimension = 3 /" // time
    character(len=*), parameter :: segment = "&boundary shape = 'segment' end = 1, 1 /"
    character(len=*), parameter :: rectangle = "&boundary shape = 'rectangle' edge_a = 1, 2, 2 edge_b = 0, 1, -1 /"
    character(len=*), parameter :: circle = "&boundary shape = 'circle' radius = 1 /"
    character(len=*), parameter :: cylinder = "&boundary shape = 'cylinder' radius = 1 axis = 1, 1, 1 /"
    character(len=*), parameter :: others = "&boundary" // plane_keys // "/ &boundary shape = 'outlet' normal(1) = -1 / " &
      // "&boundary shape = 'grains' group = 1 /"
    type(config_t) :: config

    call accept(file // segment // circle // others, "the shapes of the plane", config)
    call check_surface(config%boundaries(1), "end", [1.0_dp, 1.0_dp, 0.0_dp], "end of a segment")
    call check_equal(config%boundaries(5)%group, 1, "group of grains")
    call accept(space // rectangle // cylinder // others, "the shapes of space", config)
    call check_surface(config%boundaries(1), "edge_a", [1.0_dp, 2.0_dp, 2.0_dp], "edge_a of a rectangle")
    call check_surface(config%boundaries(1), "edge_b", [0.0_dp, 1.0_dp, -1.0_dp], "edge_b of a rectangle")
    call check_surface(config%boundaries(2), "axis", [1.0_dp, 1.0_dp, 1.0_dp], "axis of a cylinder")
    call refuse(space // segment, "&boundary (the 1st) shape = 'segment': expected " // in_space)
    call refuse(space // circle, "&boundary (the 1st) shape = 'circle': expected " // in_space)
    call refuse(file // "&boundary shape = 'rectangle' edge_a = 1, 0 edge_b = 0, 1 /", &
      "&boundary (the 1st) shape = 'rectangle': expected " // in_plane)
    call refuse(file // "&boundary shape = 'cylinder' axis(1) = 1 radius = 1 /", &
      "&boundary (the 1st) shape = 'cylinder': expected " // in_plane)
    call refuse(column // "&boundary shape = 'grains' group = 1 /", "&boundary (the 1st) shape = 'grains': expected another " &
      // "shape where bodies = 'column': the groups of grains come from a bodies file")
  end subroutine test_shapes

  !> Keys that a shape needs, and keys that it does not have.
  subroutine test_keys_of_shapes()
    character(len=*), parameter :: numbers = "expected at most 3 finite real numbers"

    call refuse_without("shape = 'plane'", "normal", numbers // " not all 0, required by shape = 'plane'")
    call refuse_without("shape = 'outlet'", "normal", numbers // " not all 0, required by shape = 'outlet'")
    call refuse_without("shape = 'segment'", "end", numbers // " (m), required by shape = 'segment'")
    call refuse_without("shape = 'rectangle' edge_b = 0, 1", "edge_a", &
      numbers // " not all 0 (m), required by shape = 'rectangle'")
    call refuse_without("shape = 'rectangle' edge_a = 0, 1", "edge_b", &
      numbers // " not all 0 (m), required by shape = 'rectangle'")
    call refuse_without("shape = 'circle'", "radius", positive // " (m), required by shape = 'circle'")
    call refuse_without("shape = 'cylinder' radius = 1", "axis", numbers // " not all 0, required by shape = 'cylinder'")
    call refuse_without("shape = 'cylinder' axis(1) = 1", "radius", positive // " (m), required by shape = 'cylinder'")
    call refuse_without("shape = 'grains'", "group", "expected an integer >= 1, required by shape = 'grains'")
    call refuse_foreign("grains", "group = 1", "point(1) = 1", &
      "'plane', 'segment', 'rectangle', 'circle', 'cylinder', 'outlet' or 'mesh'")
    call refuse_foreign("circle", "radius = 1", "normal(1) = 1", "'plane' or 'outlet'")
    call refuse_foreign("plane", "normal(1) = 1", "end(1) = 1", "'segment'")
    call refuse_foreign("plane", "normal(1) = 1", "edge_a = 0, 1", "'rectangle'")
    call refuse_foreign("plane", "normal(1) = 1", "edge_b = 0, 1", "'rectangle'")
    call refuse_foreign("plane", "normal(1) = 1", "axis = 0, 1", "'cylinder'")
    call refuse_foreign("plane", "normal(1) = 1", "radius = 1", "'circle' or 'cylinder'")
    call refuse_foreign("plane", "normal(1) = 1", "group = 1", "'grains'")
    call refuse_foreign("circle", "radius = 1", "pressure = 1", "'plane' or 'wall'")
    call refuse_foreign("outlet", "normal(1) = 1", "free = T", solid_shapes)
    call refuse_foreign("outlet", "normal(1) = 1", "force(1) = 1", solid_shapes)
    call refuse_foreign("outlet", "normal(1) = 1", "mass = 1", solid_shapes)
    call refuse_foreign("outlet", "normal(1) = 1", "friction = 1", solid_shapes)
    call refuse_foreign("outlet", "normal(1) = 1", "restitution = 1", solid_shapes)
  end subroutine test_keys_of_shapes

  subroutine refuse_without(keys, key, message)
    !> of &boundary, and the one that is not there
    character(len=*), intent(in) :: keys, key, message
    call refuse(column // "&boundary " // keys // " /", "&boundary (the 1st) " // key // " is missing: " // message)
  end subroutine refuse_without

  subroutine refuse_foreign(shape, keys, assignment, owners)
    !> the shape, and the keys that it needs
    character(len=*), intent(in) :: shape, keys
    !> what does not belong there, and to what it belongs
    character(len=*), intent(in) :: assignment, owners
    call refuse(column // "&boundary shape = '" // shape // "' " // keys // " " // assignment // " /", &
      "&boundary (the 1st) " // assignment // ": " // assignment(:scan(assignment, " (") - 1) // " belongs to shape = " &
      // owners // "; expected none where shape = '" // shape // "'")
  end subroutine refuse_foreign

  subroutine test_rules_of_boundary()
    character(len=*), parameter :: numbers = "expected at most 3 finite real numbers not all 0"
    character(len=*), parameter :: file = "&scene bodies = 'file' bodies_file = 'a.h5' dimension = 3 /" // time
    character(len=*), parameter :: rectangle = "&boundary shape = 'rectangle' edge_a = 1, 0 "
    character(len=*), parameter :: plane = column // "&boundary name = 'a'" // plane_keys
    character(len=*), parameter :: first = "&boundary (the 1st) "
    character(len=*), parameter :: own = "expected a name of its own, but the 1st has it too"
    type(config_t) :: config

    call refuse(plane // "/ &boundary name = 'a'" // plane_keys // "/", "&boundary (the 2nd, 'a') name = 'a': " // own)
    call refuse(column // "&boundary name = 'boundary 2'" // plane_keys // "/ &boundary" // plane_keys // "/", &
      "&boundary (the 2nd) name: " // own)
    ! a comma and a quote are `_` in names of columns
    call refuse(column // "&boundary name = 'a,b'" // plane_keys // "/ &boundary name = 'a_b'" // plane_keys // "/", &
      "&boundary (the 2nd, 'a_b') name = 'a_b': expected a name of its own in the columns of history.csv, but the 1st is " &
      // "'a_b' there too")
    call refuse(plane // "/ &boundary name = 'x,'" // plane_keys // "/ &boundary name = 'x""'" // plane_keys // "/", &
      "&boundary (the 3rd, 'x""') name = 'x""': expected a name of its own in the columns of history.csv, but the 2nd is " &
      // "'x_' there too")
    call accept(column // "&boundary name = 'a,b'" // plane_keys // "/ &boundary name = 'a b'" // plane_keys // "/", &
      "names that differ in columns", config)
    call accept(column // "&boundary name = '" // repeat("a", 64) // "'" // plane_keys // "/", "a name of 64 characters", config)
    call refuse(column // "&boundary name = '" // repeat("a", 65) // "'" // plane_keys // "/", &
      "&boundary (the 1st, '" // repeat("a", 65) // "') name = '" // repeat("a", 65) &
      // "': expected at most 64 characters, here 65")
    call refuse(column // "&boundary name = ' '" // plane_keys // "/", &
      "&boundary (the 1st, ' ') name = ' ': expected a text in quotes, not empty, at most 4096 characters")
    call refuse(column // "&boundary shape = 'plane' normal = 3*0 /", first // "normal = 3*0: " // numbers)
    call refuse(column // "&boundary shape = 'segment' point = 1, 2 end = 1, 2 /", &
      first // "end = 1, 2: expected another point than point")
    call refuse(file // "&boundary shape = 'rectangle' edge_a = 3*0 edge_b = 0, 1 /", &
      first // "edge_a = 3*0: " // numbers // " (m)")
    call refuse(file // rectangle // "edge_b = 3*0 /", first // "edge_b = 3*0: " // numbers // " (m)")
    call refuse(file // rectangle // "edge_b = 2e-6, 1 /", &
      first // "edge_b = 2e-6, 1: expected an edge at right angles to edge_a = 1, 0, within 1e-6")
    call accept(file // rectangle // "edge_b = 0.5e-6, 1 /", "edges at right angles within 1e-6", config)
    call accept(file // rectangle // "edge_b = 0, 1e-29 /", "a very short edge", config)
    call refuse(file // rectangle // "edge_b = 0, 1e-300 /", first // "edge_b = 0, 1e-300: expected a length of at least 1e-30 m")
    call refuse(file // "&boundary shape = 'cylinder' axis = 0 radius = 1 /", first // "axis = 0: " // numbers)
    call refuse(file // "&boundary shape = 'cylinder' axis = 1 radius = 0 /", first // "radius = 0: " // positive // " (m)")
    call refuse(column // "&boundary shape = 'circle' radius = 0 /", first // "radius = 0: " // positive // " (m)")
    call refuse(file // "&boundary shape = 'grains' group = 0 /", first // "group = 0: expected an integer >= 1")
    call refuse(plane // "friction = -1 /", "&boundary (the 1st, 'a') friction = -1: expected a finite real number >= 0")
    call refuse(plane // "restitution = -0.5 /", &
      "&boundary (the 1st, 'a') restitution = -0.5: expected a finite real number in [0, 1]")
    call refuse(plane // "restitution = 1.5 /", &
      "&boundary (the 1st, 'a') restitution = 1.5: expected a finite real number in [0, 1]")
    call refuse(plane // "remove_at = -1 /", &
      "&boundary (the 1st, 'a') remove_at = -1: expected a finite real number >= 0 (s)")
  end subroutine test_rules_of_boundary

  subroutine test_rules_of_free_boundary()
    character(len=*), parameter :: plane = column // "&boundary shape = 'plane' normal = 0, 1 "
    character(len=*), parameter :: first = "&boundary (the 1st) "
    character(len=*), parameter :: no_pressure = "expected 0 where no component along normal is free"
    type(config_t) :: config

    call accept(plane // "free = F, T mass = 2 force(2) = 3 pressure = 4 velocity = 5 /", "a free plane", config)
    call accept(plane // "free = 3*F force = 3*0 pressure = 0 rotation = 1 /", "a plane whose loads are 0", config)
    call refuse(plane // "free = T /", first // "mass is missing: " // positive // " (kg), required by free = T")
    call refuse(plane // "free = T mass = 0 /", first // "mass = 0: " // positive // " (kg)")
    call refuse(plane // "mass = 1 /", first // "mass = 1: expected none where no component is free")
    call refuse(plane // "free = T mass = 1 rotation = 1 /", &
      first // "rotation = 1: expected 0 where a component of the translation is free")
    call refuse(plane // "free = T mass = 1 force = 1, 1 /", &
      first // "force = 1, 1: expected 0 along each component that is not free")
    call refuse(plane // "free = T mass = 1 oscillation = 1 frequency = 1 /", &
      first // "oscillation = 1: expected 0 along each component that is free")
    call accept(plane // "free = T mass = 1 oscillation(2) = 1 frequency = 1 /", "an oscillation across a free component", config)
    call refuse(plane // "free = T mass = 1 rotation_oscillation = 1 frequency = 1 /", &
      first // "rotation_oscillation = 1: expected 0 where a component of the translation is free")
    call refuse(plane // "oscillation = 1 /", first // "frequency: expected > 0 where the boundary oscillates")
    call refuse(plane // "rotation_oscillation = 1 frequency = -1 /", &
      first // "frequency = -1: expected > 0 where the boundary oscillates")
    call refuse(plane // "frequency = 1 /", first // "frequency = 1: expected 0 without an oscillation")
    call refuse(plane // "phase = 1 /", first // "phase = 1: expected 0 without an oscillation")
    call refuse(plane // "table_repeats = T /", first // "table_repeats = T: expected .false. without a table")
    call refuse(scene("bodies = 'column' gravity_table_repeats = T"), &
      "&scene gravity_table_repeats = T: expected .false. without a gravity_table")
    call refuse(scene("bodies = 'column' cell_table_repeats = T"), &
      "&scene cell_table_repeats = T: expected .false. without a cell_table")
    call refuse(plane // "pressure = 1 /", first // "pressure = 1: " // no_pressure)
    call refuse(plane // "free = T, F mass = 1 pressure = 1 /", first // "pressure = 1: " // no_pressure)
  end subroutine test_rules_of_free_boundary

  !> What has no third component in 2D; a rotation has one.
  subroutine test_planar_boundaries()
    character(len=*), parameter :: plane = column // "&boundary" // plane_keys
    character(len=*), parameter :: first = "&boundary (the 1st) "
    character(len=*), parameter :: space = "&scene bodies = 'column' dimension = 3 /" // time
    type(config_t) :: config

    call refuse(plane // "point(3) = 1 /", first // "point(3) = 1: " // third)
    call refuse(column // "&boundary shape = 'plane' normal = 0, 0, 1 /", first // "normal = 0, 0, 1: " // third)
    call refuse(column // "&boundary shape = 'segment' end = 1, 1, 1 /", first // "end = 1, 1, 1: " // third)
    call refuse(plane // "velocity(3) = 1 /", first // "velocity(3) = 1: " // third)
    call refuse(plane // "pivot(3) = 1 /", first // "pivot(3) = 1: " // third)
    call refuse(plane // "force(3) = 1 /", first // "force(3) = 1: " // third)
    call refuse(plane // "free(3) = T mass = 1 /", &
      first // "free(3) = T: expected a third component of .false. where dimension = 2")
    call refuse(plane // "rotation = 0, 0, 1 /", first // "rotation = 0, 0, 1: expected one entry where dimension = 2")
    call refuse(plane // "rotation = 0, 1 /", first // "rotation = 0, 1: expected one entry where dimension = 2")
    call accept(space // "&boundary" // plane_keys // "point(3) = 1 velocity(3) = 2 pivot(3) = 3 rotation = 4, 5, 6 /", &
      "a plane in 3D", config)
    call check_vector(config%boundaries(1)%rotation, [4.0_dp, 5.0_dp, 6.0_dp], "rotation in 3D")
  end subroutine test_planar_boundaries

  !> Text of an input with a sample: keys of &sample, and more keys of &scene.
  pure function sample(keys, scene_keys) result(text)
    character(len=*), intent(in) :: keys
    character(len=*), intent(in), optional :: scene_keys
    character(len=:), allocatable :: text
    text = ""
    if (present(scene_keys)) text = scene_keys
    text = "&scene bodies = 'sample' " // text // " /" // time // "&sample " // keys // " /"
  end function sample

  subroutine test_sample()
    character(len=*), parameter :: shortest = "count = 10 radius = 0.5 box = 4 "
    character(len=*), parameter :: grains = "count = 10 radius = 0.5 box = 4, 5 "
    type(config_t) :: config

    call accept(sample(shortest), "the shortest sample", config)
    associate (made => config%sample)
      call check_equal(made%arrangement, "loose", "default arrangement")
      call check_equal(made%preparation, "none", "default preparation")
      call check_equal(made%radii, "single", "default radii")
      call check_equal(made%count, 10, "count")
      call check_close(made%radius, 0.5_dp, 0.0_dp, "radius of a sample")
      call check_vector(made%box, [4.0_dp, 0.0_dp, 0.0_dp], "box")
      call check_close(made%solid_fraction, 0.35_dp, 0.0_dp, "default solid_fraction in 2D")
      call check_equal(made%seed, 1, "default seed of a sample")
      call check_equal(made%file, "sample.h5", "default file")
      call check_close(made%rest_tolerance, 1.0e-6_dp, 0.0_dp, "default rest_tolerance")
      call check_equal(made%max_steps, 100000, "default max_steps")
    end associate
    call accept(sample("count = 10 radius = 0.5 box = 4, 5", "dimension = 3 density = 2"), "a sample in 3D", config)
    call check_close(config%sample%solid_fraction, 0.2_dp, 0.0_dp, "default solid_fraction in 3D")
    call check_close(config%scene%density, 2.0_dp, 0.0_dp, "density of a sample")
    call accept(sample("arrangement = 'lattice' preparation = 'settled' count = 10 radii = 'uniform' radius_min = 1 " &
      // "radius_max = 1 box = 40, 50 seed = 7 rest_tolerance = 1e-3 max_steps = 20 file = 'a.h5'"), "a lattice", config)
    call check_equal(config%sample%seed, 7, "seed of a sample")
    call check_close(config%sample%rest_tolerance, 1.0e-3_dp, 0.0_dp, "rest_tolerance")
    call check_equal(config%sample%max_steps, 20, "max_steps")
    call check_equal(config%sample%file, "a.h5", "file of a sample")
    call accept(sample("preparation = 'compacted' pressure = 100 count = 10 radii = 'log_normal' radius_min = 1 " &
      // "radius_max = 3 radius_mean = 2 radius_deviation = 0.5 solid_fraction = 0.5", "period = 40"), "log-normal", config)
    call check_close(config%sample%pressure, 100.0_dp, 0.0_dp, "pressure of a sample")
    call check_close(config%sample%radius_mean, 2.0_dp, 0.0_dp, "radius_mean")
    call check_close(config%sample%radius_deviation, 0.5_dp, 0.0_dp, "radius_deviation")
    call check_close(config%sample%solid_fraction, 0.5_dp, 0.0_dp, "solid_fraction")
    call check_vector(config%sample%box, [40.0_dp, 0.0_dp, 0.0_dp], "a box takes the period")
    call accept(sample("count = 10 radii = 'table' radius_table = 'r.csv' box = 0, 5", "period(1) = 40"), "a table", config)
    call check_equal(config%sample%radius_table, "r.csv", "radius_table")
    call check_vector(config%sample%box, [40.0_dp, 5.0_dp, 0.0_dp], "a box with the period along one axis")
    call accept(sample(grains // "grain_shapes = 'a, disk, b' grain_shares = 3, 1, 0.5", "shapes = 'a.shapes'"), "shapes", config)
    call check_equal(config%sample%grain_shapes, "a, disk, b", "shapes of grains")
    call check_equal(config%sample%grain_materials, "", "default materials of grains")
    call check_close(config%sample%material_shares(1), 0.0_dp, 0.0_dp, "default shares of materials")
    call check_close(maxval(abs(config%sample%velocity_spread)), 0.0_dp, 0.0_dp, "default spread of velocities")
    call check_close(config%sample%grain_shares(3), 0.5_dp, 0.0_dp, "a share of grains")
  end subroutine test_sample

  !> Keys that a choice needs, and keys that it does not have; the group itself.
  subroutine test_keys_of_sample()
    character(len=*), parameter :: bounded = "'uniform', 'uniform_volume' or 'log_normal'"

    call refuse(column // "&sample count = 1 radius = 1 /", &
      "group &sample belongs to bodies = 'sample'; expected none where bodies = 'column'")
    call refuse("&scene bodies = 'sample' /" // time, &
      "group &sample is missing: expected &sample ... /, required by bodies = 'sample'")
    call refuse(sample("count = 1 radius = 1 box = 1") // "&sample /", &
      "group &sample is given twice (lines 1 and 1): expected once")
    call refuse("&scene /" // time // "&sample /", &
      "&scene bodies is missing: expected 'column', 'lattice', 'file', 'sample' or 'none'")
    call refuse(sample("radius = 1 box = 1"), "&sample count is missing: expected an integer >= 1")
    call refuse(sample("count = 1 box = 1"), "&sample radius is missing: " // positive // " (m), required by radii = 'single'")
    call refuse(sample("count = 1 box = 1 radii = 'uniform' radius_max = 1"), &
      "&sample radius_min is missing: " // positive // " (m), required by radii = 'uniform'")
    call refuse(sample("count = 1 box = 1 radii = 'uniform_volume' radius_min = 1"), &
      "&sample radius_max is missing: " // positive // " (m), required by radii = 'uniform_volume'")
    call refuse(sample("count = 1 box = 1 radii = 'log_normal' radius_min = 1 radius_max = 1 radius_deviation = 1"), &
      "&sample radius_mean is missing: " // positive // " (m), required by radii = 'log_normal'")
    call refuse(sample("count = 1 box = 1 radii = 'log_normal' radius_min = 1 radius_max = 1 radius_mean = 1"), &
      "&sample radius_deviation is missing: " // positive // ", at most 1000, required by radii = 'log_normal'")
    call refuse(sample("count = 1 box = 1 radii = 'table'"), "&sample radius_table is missing: expected a text in quotes, " &
      // "not empty, at most 4096 characters, required by radii = 'table'")
    call refuse(sample("count = 1 box = 1 radius = 1 preparation = 'compacted'"), &
      "&sample pressure is missing: " // positive // " (Pa, N/m in 2D), required by preparation = 'compacted'")
    call refuse_extra("radii", "single", "radius_min = 1", bounded)
    call refuse_extra("radii", "single", "radius_max = 1", bounded)
    call refuse_extra("radii", "single", "radius_mean = 1", "'log_normal'")
    call refuse_extra("radii", "single", "radius_deviation = 1", "'log_normal'")
    call refuse_extra("radii", "single", "radius_table = 'a'", "'table'")
    call refuse_extra("preparation", "settled", "pressure = 1", "'compacted'")
    call refuse_extra("preparation", "none", "rest_tolerance = 1", "'settled' or 'compacted'")
    call refuse_extra("preparation", "none", "max_steps = 1", "'settled' or 'compacted'")
    call refuse_extra("arrangement", "lattice", "solid_fraction = 0.5", "'loose'")
    call refuse(sample("count = 1 box = 1 radii = 'uniform' radius_min = 1 radius_max = 1 radius = 1"), &
      "&sample radius = 1: radius belongs to radii = 'single'; expected none where radii = 'uniform'")
    call refuse_stranger("sample", "", "seed = 1", "'lattice'", "&sample count = 1 radius = 1 box = 1 /")
  end subroutine test_keys_of_sample

  subroutine refuse_extra(choice, word, assignment, owners)
    !> a choice of &sample and its word
    character(len=*), intent(in) :: choice, word
    !> what does not belong there, and to what it belongs
    character(len=*), intent(in) :: assignment, owners
    call refuse(sample("count = 1 box = 1 radius = 1 " // choice // " = '" // word // "' " // assignment), &
      "&sample " // assignment // ": " // assignment(:index(assignment, " ") - 1) // " belongs to " // choice // " = " &
      // owners // "; expected none where " // choice // " = '" // word // "'")
  end subroutine refuse_extra

  subroutine test_rules_of_sample()
    character(len=*), parameter :: boxed = "count = 1 box = 1 "
    character(len=*), parameter :: made = boxed // "radius = 1 "
    character(len=*), parameter :: uniform = boxed // "radii = 'uniform' "
    character(len=*), parameter :: log_normal = boxed // "radii = 'log_normal' radius_min = 1 radius_max = 2 "
    character(len=*), parameter :: between = &
      "expected a radius from radius_min to radius_max, here radius_min = 1 and radius_max = 2"

    call refuse(sample("count = 0 box = 1 radius = 1"), "&sample count = 0: expected an integer >= 1")
    call refuse(sample(boxed // "radius = 0"), "&sample radius = 0: " // positive // " (m)")
    call refuse(sample(uniform // "radius_min = 0 radius_max = 1"), "&sample radius_min = 0: " // positive // " (m)")
    call refuse(sample(uniform // "radius_min = 1 radius_max = 0"), "&sample radius_max = 0: " // positive // " (m)")
    call refuse(sample(uniform // "radius_min = 2 radius_max = 1"), &
      "&sample radius_min = 2: expected at most radius_max, here radius_max = 1")
    call refuse(sample(log_normal // "radius_mean = 0 radius_deviation = 1"), &
      "&sample radius_mean = 0: " // positive // " (m)")
    call refuse(sample(log_normal // "radius_mean = 0.5 radius_deviation = 1"), "&sample radius_mean = 0.5: " // between)
    call refuse(sample(log_normal // "radius_mean = 3 radius_deviation = 1"), "&sample radius_mean = 3: " // between)
    call refuse(sample(log_normal // "radius_mean = 1 radius_deviation = 0"), &
      "&sample radius_deviation = 0: " // positive // ", at most 1000")
    call refuse(sample(log_normal // "radius_mean = 1 radius_deviation = 1e4"), "&sample radius_deviation = 1e4: " // positive &
      // ", at most 1000")
    call refuse(sample(boxed // "radii = 'table' radius_table = ''"), &
      "&sample radius_table = '': expected a text in quotes, not empty, at most 4096 characters")
    call refuse(sample(made // "solid_fraction = 0"), "&sample solid_fraction = 0: expected a finite real number in (0, 0.6)")
    call refuse(sample(made // "solid_fraction = 0.6"), &
      "&sample solid_fraction = 0.6: expected a finite real number in (0, 0.6)")
    call refuse(sample(made // "preparation = 'compacted' pressure = 0"), &
      "&sample pressure = 0: " // positive // " (Pa, N/m in 2D)")
    call refuse(sample(made // "preparation = 'settled' rest_tolerance = 0"), "&sample rest_tolerance = 0: " // positive)
    call refuse(sample(made // "preparation = 'settled' max_steps = 0"), "&sample max_steps = 0: expected an integer >= 1")
    call refuse(sample(made // "preparation = 'settled'", "gravity = 3*0"), "&sample preparation = 'settled': " &
      // "expected another one where gravity does not point down the last axis")
    call refuse(sample(made // "preparation = 'settled'", "period(2) = 1"), "&sample preparation = 'settled': " &
      // "expected another one where the last axis is periodic")
    call refuse(sample(made // "grain_materials = 'a'"), &
      "&sample grain_materials = 'a': expected the name of a &material, and there is none")
    call refuse(sample(made // "velocity_spread = -1"), &
      "&sample velocity_spread = -1: expected at most 3 finite real numbers >= 0 (m/s)")
    call refuse(sample(made // "file = ''"), &
      "&sample file = '': expected a text in quotes, not empty, at most 4096 characters")
    call refuse(sample(made // "file = 'a.csv'"), "&sample file = 'a.csv': expected a name with the ending .h5 or .hdf5")
    call refuse(sample(made // "grain_shapes = 'a'"), &
      "&sample grain_shapes = 'a': expected shapes of &scene, the path of the file that has them")
    call refuse(sample(made // "grain_shares = 1", "shapes = 'b'"), &
      "&sample grain_shares = 1: expected it where grain_shapes has one name to 8")
    call refuse(sample(made // "grain_shapes = 'a,b' grain_shares = 1", "shapes = 'b'"), &
      "&sample grain_shares = 1: expected a share above 0 for each of the 2 grain_shapes")
    call refuse(sample(made // "grain_shapes = 'a' grain_shares = 1, 1", "shapes = 'b'"), &
      "&sample grain_shares = 1, 1: expected a share above 0 for each of the 1 grain_shapes")
    call refuse(sample(made // "grain_shapes = 'a,b,c,d,e,f,g,h,i' grain_shares = 1", "shapes = 'b'"), &
      "&sample grain_shares = 1: expected it where grain_shapes has one name to 8")
    call refuse(sample(made // "grain_shapes = 'a' grain_shares = 9*1", "shapes = 'b'"), &
      "&sample grain_shares = 9*1: expected at most 8 finite real numbers > 0")
    call refuse(sample(made // "arrangement = 'dense'"), "&sample arrangement = 'dense': expected 'lattice' or 'loose'")
    call refuse(sample(made // "preparation = 'shaken'"), &
      "&sample preparation = 'shaken': expected 'none', 'settled' or 'compacted'")
    call refuse(sample(boxed // "radii = 'normal'"), &
      "&sample radii = 'normal': expected 'single', 'uniform', 'uniform_volume', 'log_normal' or 'table'")
  end subroutine test_rules_of_sample

  !> A comma in a list of names has a name on both sides.
  subroutine test_empty_names()
    character(len=*), parameter :: lists(5) = [character(len=5) :: ",", "a,,b", "a, ,b", ", a", "a, "]
    character(len=:), allocatable :: assignment
    type(config_t) :: config
    integer :: k

    do k = 1, size(lists)
      assignment = "grain_shapes = '" // trim(lists(k)) // "'"
      call refuse(sample("count = 1 box = 1 radius = 1 " // assignment, "shapes = 'b'"), "&sample " // assignment &
        // ": expected the name of a shape before and behind each comma")
    end do
    call accept(sample("count = 1 box = 1 radius = 1 grain_shapes = ' a , b'", "shapes = 'b'"), "blanks beside a comma", config)
  end subroutine test_empty_names

  subroutine test_rules_of_box()
    character(len=*), parameter :: grains = "count = 1 radius = 1 "
    character(len=*), parameter :: needed = "&sample box is missing: expected at most 3 finite real numbers >= 0 (m), " &
      // "required by each axis that is not periodic but the last"
    character(len=*), parameter :: sizes = "expected sizes > 0, of which the last may be 0"
    type(config_t) :: config

    call refuse(sample(grains), needed)
    call refuse(sample(grains, "period(1) = 1 dimension = 3"), needed)
    call accept(sample(grains, "period(1:2) = 1, 2 dimension = 3"), "no box where all axes but the last are periodic", config)
    call refuse(sample(grains // "box = 0, 1"), "&sample box = 0, 1: " // sizes)
    call refuse(sample(grains // "box = 1", "dimension = 3"), "&sample box = 1: " // sizes)
    call refuse(sample(grains // "box = 1, -1"), "&sample box = 1, -1: expected at most 3 finite real numbers >= 0 (m)")
    call refuse(sample(grains // "box = 1, 1, 1"), "&sample box = 1, 1, 1: " // third)
    call refuse(sample(grains // "box = 1, 1", "period = 0, 2"), &
      "&sample box = 1, 1: expected the same sizes as &scene period = 0, 2 along each axis that is periodic")
    call refuse(sample(grains // "box = 1, 1 solid_fraction = 0.5"), &
      "&sample solid_fraction = 0.5: expected none where the last size of the box is given")
    call refuse(sample(grains // "box = 1 solid_fraction = 0.5", "period(2) = 1"), &
      "&sample solid_fraction = 0.5: expected none where the last size of the box is given")
  end subroutine test_rules_of_box

  !> The options in force are those that count: none of another kind of bodies.
  subroutine test_active_options()
    type(config_t) :: config
    character(len=:), allocatable :: text

    call accept(column // "&solver tolerance = 2.5d-7 /", "a file to write back", config)
    call write_active(text, config)
    call check_line(text, "&scene")
    call check_line(text, "  bodies = 'column'")
    call check_line(text, "  step = 0.1")
    call check_line(text, "  tolerance = 2.5E-7")
    call check_line(text, "  cg_tolerance = 1.0E-12")
    call check_line(text, "  gravity = 0.0, -9.81, 0.0")
    call check_line(text, "  column_count = 3")
    call check_line(text, "  warm_start = .true.")
    call check_line(text, "  ! alert_distance = 0.1 of the largest radius")
    call check(index(text, "seed") == 0, "no line of a key of the lattice")
    call check(index(text, "bodies_file") == 0, "no line of a key of the bodies file")
    call check_written(text, config)
  end subroutine test_active_options

  subroutine test_materials()
    type(config_t) :: config
    character(len=*), parameter :: two = "&scene bodies = 'file' bodies_file = 'b.csv' /" &
      // time // "&material name = 'a' density = 1000 / &material name = 'b' / "

    call accept(two // "&boundary" // plane_keys // "material = 'b' / &boundary" // plane_keys // "/", "two materials", config)
    call check_close(config%materials(1)%density, 1000.0_dp, 0.0_dp, "density that is given")
    call check_close(config%materials(2)%density, config%scene%density, 0.0_dp, "density of the scene")
    call check_equal(trim(config%boundaries(1)%material), "b", "material of a boundary")
    call check_equal(trim(config%boundaries(2)%material), "", "no material")
    call refuse(two // "&material name = 'a' /", &
      "&material (the 3rd, 'a') name = 'a': expected a name of its own, but the 1st has it too")
    call refuse(two // "&material name = 'c' density = 0 /", &
      "&material (the 3rd, 'c') density = 0: expected a finite real number > 0 (kg/m^3, kg/m^2 in 2D)")
    call refuse(two // "&material density = 1 /", "&material (the 3rd) name is missing: expected a text in quotes, not empty, " &
      // "at most 4096 characters")
    call refuse(two // "&boundary" // plane_keys // "material = 'c' /", &
      "&boundary (the 1st) material = 'c': expected 'a' or 'b'")
    call refuse(column // "&boundary" // plane_keys // "material = 'c' /", &
      "&boundary (the 1st) material = 'c': expected the name of a &material, and there is none")
    call refuse(scene("bodies = 'column' wall_material = 'c'"), &
      "&scene wall_material = 'c': expected the name of a &material, and there is none")
    call refuse(column // "&material name = 'a' density = 1 /", &
      "&material (the 1st, 'a') density = 1: expected none where bodies = 'column': mass is the mass of each body")
  end subroutine test_materials

  subroutine test_laws()
    type(config_t) :: config
    character(len=*), parameter :: two = column // "&material name = 'a' / &material name = 'b' / "
    character(len=*), parameter :: coulomb = "&law materials = 'a', 'b' kind = 'coulomb' friction = 0.3 / "
    character(len=*), parameter :: texts = "expected at most 2 texts in quotes, none of them empty, at most 4096 characters"
    character(len=*), parameter :: wet = "&law materials = 'a' kind = 'adhesive' adhesion = 1 adhesion_range = 0.1 / "
    character(len=:), allocatable :: text

    call accept(two // coulomb // wet, "two laws", config)
    call check_equal(trim(config%laws(1)%materials(2)), "b", "second material of a law")
    call check_equal(trim(config%laws(2)%materials(2)), "", "a law of one material")
    call write_active(text, config)
    call check_line(text, "  materials = 'a', 'b'")
    call check_line(text, "  materials = 'a'")
    call check_line(text, "  adhesion_range = 0.1")
    call check_written(text, config)
    call refuse(two // "&law materials = 'a', 'c' kind = 'coulomb' /", "&law (the 1st) materials = 'a', 'c': expected 'a' or 'b'")
    call refuse(two // "&law materials = a kind = 'coulomb' /", &
      "&law (the 1st) materials = a: " // texts)
    call refuse(two // "&law materials = 'a', 'b', 'a' kind = 'coulomb' /", &
      "&law (the 1st) materials = 'a', 'b', 'a': " // texts)
    call refuse(two // "&law materials = 'a', '' kind = 'coulomb' /", "&law (the 1st) materials = 'a', '': " // texts)
    call refuse(two // "&law materials = ' ', 'a' kind = 'coulomb' /", "&law (the 1st) materials = ' ', 'a': " // texts)
    call refuse(two // "&law materials = 'a' materials(2) = ' ' kind = 'coulomb' /", "&law (the 1st) materials(2) = ' ': " // texts)
    call accept(two // "&law materials(2) = 'b' materials(1) = 'a' kind = 'coulomb' /", "names one by one", config)
    call check_equal(trim(config%laws(1)%materials(2)), "b", "second material by its index")
    call accept(two // "&law materials = 'a', ""b"" kind = 'coulomb' /", "names in quotes of both kinds", config)
    call check_equal(trim(config%laws(1)%materials(2)), "b", "second material in other quotes than the first")
    call refuse(two // "&law kind = 'coulomb' /", &
      "&law (the 1st) materials is missing: " // texts)
    call refuse(two // "&law materials = 'a' /", &
      "&law (the 1st) kind is missing: expected 'coulomb', 'frictionless', 'none', 'velocity', 'adhesive', 'capillary', "// &
      "'bonded', 'elastic' or 'hertz'")
    call refuse(two // coulomb // "&law materials = 'b', 'a' kind = 'frictionless' /", &
      "&law (the 2nd) materials = 'b', 'a': expected a pair of its own, but the 1st has it too")
    call refuse(two // "&law materials = 'a' kind = 'coulomb' adhesion = 1 /", &
      "&law (the 1st) adhesion = 1: adhesion belongs to kind = 'adhesive'; expected none where kind = 'coulomb'")
    call refuse(two // "&law materials = 'a' kind = 'adhesive' adhesion = 1 /", &
      "&law (the 1st) adhesion_range is missing: expected a finite real number > 0 (m), required by kind = 'adhesive'")
    call refuse(two // "&law materials = 'a' kind = 'coulomb' restitution = 2 /", &
      "&law (the 1st) restitution = 2: expected a finite real number in [0, 1]")
    call refuse(two // "&law materials = 'a' kind = 'coulomb' friction = -1 /", &
      "&law (the 1st) friction = -1: expected a finite real number >= 0")
    call refuse(two // "&law materials = 'a' kind = 'adhesive' adhesion = 1 adhesion_range = 0 /", &
      "&law (the 1st) adhesion_range = 0: expected a finite real number > 0 (m)")
    call refuse(scene("bodies = 'column' alert_distance = 0.05") // "&material name = 'a' / " // wet, &
      "&scene alert_distance = 0.05: expected at least 1.000E-01 m, the largest range of a &law")
    call refuse(column // "&solver criterion = 'error' / &material name = 'a' / " // wet, &
      "&solver criterion = 'error': expected 'residual' where there is a &law: the exact solution is that of the scene's law")
  end subroutine test_laws

  !> Each boundary with what is given or matters for its shape; the sample where there is one.
  subroutine test_active_groups()
    type(config_t) :: config
    character(len=:), allocatable :: text

    call accept(column // "&boundary shape = 'circle' radius = 2 friction = 0.5 free(2) = T mass = 3 / " &
      // "&boundary" // plane_keys // "/", "boundaries to write back", config)
    call write_active(text, config)
    call check(index(text, "&sample") == 0, "no group of a sample")
    call check_equal(text(index(text, "&boundary"):index(text, "&time") - 1), "&boundary" // newline &
      // "  name = 'boundary 1'" // newline // "  shape = 'circle'" // newline // "  point = 0.0, 0.0, 0.0" // newline &
      // "  radius = 2.0" // newline // "  velocity = 0.0, 0.0, 0.0" // newline // "  rotation = 0.0, 0.0, 0.0" // newline &
      // "  oscillation = 0.0, 0.0, 0.0" // newline // "  rotation_oscillation = 0.0, 0.0, 0.0" // newline &
      // "  frequency = 0.0" // newline // "  phase = 0.0" // newline &
      // "  ! pivot = the value of `point`; for glued grains the origin" // newline &
      // "  free = .false., .true., .false." // newline &
      // "  force = 0.0, 0.0, 0.0" // newline // "  mass = 3.0" // newline // "  table = ''" // newline &
      // "  table_repeats = .false." // newline &
      // "  friction = 0.5" // newline // "  ! restitution = the value of `wall_restitution` of `&scene`" // newline &
      // "  ! tangential_restitution = the value of `wall_tangential_restitution` of `&scene`" // newline &
      // "  ! rolling_friction = the value of `wall_rolling_friction` of `&scene`" // newline &
      // "  ! pivoting_friction = the value of `wall_pivoting_friction` of `&scene`" // newline &
      // "  ! material = the value of `wall_material` of `&scene`" // newline &
      // "  ! remove_at = never" // newline // "/" // newline // "&boundary" // newline &
      // "  name = 'boundary 2'" // newline // "  shape = 'plane'" // newline // "  point = 0.0, 0.0, 0.0" // newline &
      // "  normal = 0.0, 1.0, 0.0" // newline // "  velocity = 0.0, 0.0, 0.0" // newline &
      // "  rotation = 0.0, 0.0, 0.0" // newline &
      // "  oscillation = 0.0, 0.0, 0.0" // newline // "  rotation_oscillation = 0.0, 0.0, 0.0" // newline &
      // "  frequency = 0.0" // newline // "  phase = 0.0" // newline &
      // "  ! pivot = the value of `point`; for glued grains the origin" // newline &
      // "  free = .false., .false., .false." // newline // "  force = 0.0, 0.0, 0.0" // newline &
      // "  pressure = 0.0" // newline // "  table = ''" // newline &
      // "  table_repeats = .false." // newline &
      // "  ! friction = the value of `wall_friction` of `&scene`" // newline &
      // "  ! restitution = the value of `wall_restitution` of `&scene`" // newline &
      // "  ! tangential_restitution = the value of `wall_tangential_restitution` of `&scene`" // newline &
      // "  ! rolling_friction = the value of `wall_rolling_friction` of `&scene`" // newline &
      // "  ! pivoting_friction = the value of `wall_pivoting_friction` of `&scene`" // newline &
      // "  ! material = the value of `wall_material` of `&scene`" // newline &
      // "  ! remove_at = never" // newline // "/" // newline, "boundaries written back")
    call accept(sample("count = 10 radius = 0.5 box = 4"), "a sample to write back", config)
    call write_active(text, config)
    call check_equal(text(index(text, "&sample"):index(text, "&time") - 1), "&sample" // newline &
      // "  arrangement = 'loose'" // newline // "  preparation = 'none'" // newline // "  container = 'box'" // newline &
      // "  count = 10" // newline &
      // "  radii = 'single'" // newline // "  radius = 0.5" // newline // "  velocity = 0.0, 0.0, 0.0" // newline &
      // "  velocity_spread = 0.0, 0.0, 0.0" // newline // "  box = 4.0, 0.0, 0.0" // newline &
      // "  solid_fraction = 0.35" // newline // "  seed = 1" // newline // "  file = 'sample.h5'" // newline &
      // "/" // newline, "a sample written back")
    call check(index(text, "&boundary") == 0, "no group of a boundary")
  end subroutine test_active_groups

  subroutine check_line(text, line)
    character(len=*), intent(in) :: text, line
    call check(index(newline // text, newline // line // newline) > 0, "written line: " // line)
  end subroutine check_line

  !> The unit gets the same text, line by line.
  subroutine check_written(text, config)
    character(len=*), intent(in) :: text
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: written
    character(len=100) :: line
    integer :: unit, status

    open (newunit=unit, status="scratch", action="readwrite")
    call write_active(unit, config)
    rewind (unit)
    written = ""
    do
      read (unit, "(a)", iostat=status) line
      if (status /= 0) exit
      written = written // trim(line) // newline
    end do
    close (unit)
    call check_equal(written, text, "options written to a unit")
  end subroutine check_written

  !> What is written back reads as the same.
  subroutine test_round_trip()
    call check_round_trip(column, "a column")
    call check_round_trip(whole_file(), "a whole file")
    call check_round_trip(scene("bodies = 'column' gravity_table = 'g.csv'"), "a table of gravity")
    call check_round_trip(scene("bodies = 'column' cell_table = 'c.csv'"), "a table of the cell")
    call check_round_trip(column // "&solver method = 'schwarz' relaxation = 0.5 /", "a given relaxation")
    call check_round_trip(scene("bodies = 'lattice' alert_distance = 1e-300 density = 1234567.125" // lattice_keys), &
      "a lattice")
    call check_round_trip(scene("bodies = 'file' bodies_file = 'it''s/here' friction = 0.1 " &
      // "wall_friction = 0.30000000000000004"), "a bodies file")
    call check_round_trip(column // "&solver method = 'nscdd' tolerance = 1.7976931348623157e308 / " &
      // "&decomposition grid = 3, 2 /", "a grid")
    call check_round_trip(scene("bodies = 'file' bodies_file = 'a.h5' dimension = 3 wall_friction = 0.1") &
      // "&boundary shape = 'rectangle' name = 'it''s' edge_a = 1, 2, 2 edge_b = 0, 1, -1 restitution = 0.3 / " &
      // "&boundary shape = 'grains' group = 3 pivot = 1, 2, 3 rotation = 4, 5, 6 remove_at = 0.7 / " &
      // "&boundary shape = 'cylinder' radius = 0.1 axis = 1 free(3) = T mass = 2 force(3) = -0.1 / " &
      // "&boundary shape = 'plane' normal = 0, 0, -1 free(3) = T mass = 2 pressure = 1e5 friction = 0 / " &
      // "&boundary shape = 'outlet' normal = 1 table = 't.csv' /", "boundaries")
    call check_round_trip(sample("count = 10 radius = 0.1 box = 4, 5"), "a sample in a full box")
    call check_round_trip(sample("count = 10 radius = 0.1 solid_fraction = 0.4", "period = 0.3"), "a periodic sample")
    call check_round_trip(sample("count = 10 radius = 0.1 box = 4 grain_shapes = 'a b' grain_shares = 1, 2.5", "shapes = 'c'"), &
      "a sample with shapes")
    call check_round_trip(sample("count = 10 radius = 0.1 box = 4 grain_materials = 'a b' material_shares = 1, 2.5 " &
      // "velocity = 1, 2 velocity_spread = 3") // "&material name = 'a' / &material name = 'b' /", "a mixture that moves")
    call check_round_trip(sample("count = 10 radii = 'table' radius_table = 'a' box = 4 arrangement = 'lattice' " &
      // "preparation = 'compacted' pressure = 3"), "a compacted lattice")
  end subroutine test_round_trip

  subroutine check_round_trip(text, name)
    character(len=*), intent(in) :: text, name
    type(config_t) :: config, again
    character(len=:), allocatable :: written, written_again

    call accept(text, name, config)
    call write_active(written, config)
    call accept(written, name // " written back", again)
    call write_active(written_again, again)
    call check_equal(written_again, written, name // " written back twice")
    call check_close(again%scene%density, config%scene%density, 0.0_dp, "density of " // name)
    call check_close(again%scene%wall_contact%friction, config%scene%wall_contact%friction, 0.0_dp, "wall_friction of " // name)
    call check_close(again%scene%alert_distance, config%scene%alert_distance, 0.0_dp, "alert_distance of " // name)
    call check_close(again%solver%tolerance, config%solver%tolerance, 0.0_dp, "tolerance of " // name)
    call check_equal(again%scene%bodies_file, config%scene%bodies_file, "bodies_file of " // name)
    call check_equal(again%decomposition%subdomains, config%decomposition%subdomains, "subdomains of " // name)
  end subroutine check_round_trip

  !> doc/keys.md is what write_key_reference writes; with GRAVIER_WRITE_KEYS=1 in the environment it is written again.
  subroutine test_reference()
    character(len=1000) :: directory, again
    integer :: unit, written, line
    character(len=1000) :: expected, found
    integer :: status, status_written

    call get_environment_variable("GRAVIER_SOURCE_DIR", directory, status=status)
    if (status /= 0) directory = "."
    call get_environment_variable("GRAVIER_WRITE_KEYS", again)
    if (again == "1") call write_reference(trim(directory) // "/doc/keys.md")
    open (newunit=written, status="scratch", action="readwrite")
    call write_key_reference(written)
    rewind (written)
    open (newunit=unit, file=trim(directory) // "/doc/keys.md", status="old", action="read", iostat=status)
    call check_equal(status, 0, "doc/keys.md can be read")
    line = 0
    do while (status == 0)
      line = line + 1
      read (written, "(a)", iostat=status_written) expected
      read (unit, "(a)", iostat=status) found
      call check_equal(status, status_written, "lines of doc/keys.md (GRAVIER_WRITE_KEYS=1 writes it again)")
      if (status == 0) call check_equal(found, expected, "doc/keys.md (GRAVIER_WRITE_KEYS=1 writes it again)")
    end do
    call check_equal(status, iostat_end, "doc/keys.md is read to its end")
    call check(line > 60, "doc/keys.md has a line for each key")
    close (written)
    if (status == iostat_end) close (unit)
  end subroutine test_reference

  subroutine write_reference(path)
    character(len=*), intent(in) :: path
    integer :: unit
    open (newunit=unit, file=path, status="replace", action="write")
    call write_key_reference(unit)
    close (unit)
  end subroutine write_reference

end program test_config
