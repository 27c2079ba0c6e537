!> Sanity of an input file whose values have all been read: one message for each rule.
module gravier_config_check
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, is_size, bounded_text, size_text
  use gravier_config_types, only: config_t
  use gravier_config_key, only: key_t, kind_real, kind_logical
  use gravier_config_table, only: keys
  use gravier_method_options, only: method_features_t
  use gravier_method_registry, only: features_of, quoted_names, that_decompose
  use gravier_config_keys, only: choices_text
  use gravier_config_slots, only: slot_t, slot_of, group_count, belongs, chosen_word
  use gravier_config_report, only: report_t, expect, miss, is_given, reaches, shown_text, label
  use gravier_config_check_boundary, only: check_boundaries, check_contact
  use gravier_config_check_laws, only: check_materials, check_laws
  use gravier_config_check_sample, only: check_sample
  use gravier_config_check_insertion, only: check_insertions
  use gravier_config_check_region, only: check_regions
  implicit none
  private
  public :: check_dimension, check_config, grid_product

contains

  !> Fails unless dimension is 2 or 3, which other defaults and rules depend on.
  subroutine check_dimension(config, report, error)
    type(config_t), intent(in) :: config
    type(report_t), intent(in) :: report
    type(error_t), allocatable, intent(inout) :: error
    call expect(report, config%scene%dimension == 2 .or. config%scene%dimension == 3, "scene", "dimension", error)
  end subroutine check_dimension

  !> Fails (status_input) with the first rule that the input breaks.
  subroutine check_config(config, report, error)
    !> with defaults settled
    type(config_t), intent(in) :: config
    !> what the file gives; its instance comes back as it was
    type(report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error

    call check_keys(report, config, error)
    if (allocated(error)) return
    call check_scene(report, config, error)
    if (config%scene%bodies == "column") call check_column(report, config, error)
    if (config%scene%bodies == "lattice") call check_lattice(report, config, error)
    call check_materials(report, config, error)
    call check_boundaries(report, config, error)
    call check_laws(report, config, error)
    if (config%scene%bodies == "sample") call check_sample(report, config, error)
    call check_insertions(report, config, error)
    call check_time(report, config, error)
    call check_solver(report, config, error)
    call check_decomposition(report, config, error)
    call check_method(report, config, error)
    call check_enriched(report, config, error)
    call check_output(report, config, error)
    call check_regions(report, config, error)
  end subroutine check_config

  !> The rules of the table of keys, for every key of every group.
  subroutine check_keys(report, config, error)
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    !> a copy to point into
    type(config_t), target :: copy
    integer :: rule, k, instance

    copy = config
    do rule = 1, 4
      do k = 1, size(keys)
        do instance = 1, group_count(config, keys(k)%group)
          report%instance = instance
          if (rule == 1) call check_required(report, copy, keys(k), error)
          if (rule == 2) call check_owner(report, copy, keys(k), error)
          if (rule == 3) call check_planar(report, copy, keys(k), error)
          if (rule == 4) call check_magnitude(report, copy, keys(k), error)
          if (allocated(error)) return
        end do
      end do
    end do
    report%instance = 1
  end subroutine check_keys

  !> A key that has no default.
  subroutine check_required(report, config, key, error)
    type(report_t), intent(in) :: report
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    type(error_t), allocatable, intent(inout) :: error

    if (key%note /= "required") return
    if (key%required) then
      call miss(report, key%group, trim(key%name), error, "")
    else if (belongs(config, key, report%instance)) then
      call miss(report, key%group, trim(key%name), error, &
                trim(key%chooser)//" = '"//chosen_word(config, key, report%instance)//"'")
    end if
  end subroutine check_required

  !> A key that belongs to another choice: to other bodies, to another shape.
  subroutine check_owner(report, config, key, error)
    type(report_t), intent(in) :: report
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    type(error_t), allocatable, intent(inout) :: error

    if (.not. is_given(report, key%group, key%name)) return
    if (belongs(config, key, report%instance)) return
    call raise(error, status_input, report%file//": "//label(report, key%group)//" " &
               //shown_text(report, key%group, key%name)//": "//trim(key%name)//" belongs to "//trim(key%chooser)//" = " &
               //choices_text(key%chosen)//"; expected none where "//trim(key%chooser)//" = '" &
               //chosen_word(config, key, report%instance)//"'")
  end subroutine check_owner

  !> Entries that a vector does not have in 2D.
  subroutine check_planar(report, config, key, error)
    type(report_t), intent(in) :: report
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot
    character(len=:), allocatable :: what

    if (config%scene%dimension == 3 .or. key%count == 1) return
    slot = slot_of(config, key, report%instance)
    what = "a third component of 0"
    if (key%planar == 1) what = "one entry"
    if (key%kind == kind_logical) what = "a third component of .false."
    what = what//" where dimension = 2"
    if (key%kind == kind_real) &
      call expect(report, all(abs(slot%reals(key%planar + 1:)) <= 0.0_dp), key%group, trim(key%name), error, what)
    if (key%kind == kind_logical) &
      call expect(report, all(.not. slot%logicals(key%planar + 1:)), key%group, trim(key%name), error, what)
  end subroutine check_planar

  !> A number that sums of squares and products of a few of them survive. What is only compared, as a tolerance, is exempt, and
  !> so are directions, of which ratios count: they have no unit, are not coefficients of friction (>= 0), and not of a law.
  !> Numbers that must be above 0 and are not have a message of their own.
  subroutine check_magnitude(report, config, key, error)
    type(report_t), intent(in) :: report
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot

    if (key%kind /= kind_real) return
    if (key%unit == "" .and. key%allowed /= ">= 0" .and. key%group /= "law") return
    if (.not. is_given(report, key%group, key%name)) return
    slot = slot_of(config, key, report%instance)
    if (key%count == 1) then
      call expect(report, is_bounded(slot%real), key%group, trim(key%name), error, bounded_text)
      if (key%allowed == "> 0" .and. slot%real > 0.0_dp) &
        call expect(report, is_size(slot%real), key%group, trim(key%name), error, size_text)
    else
      call expect(report, all(is_bounded(slot%reals)), key%group, trim(key%name), error, "entries of at most 1e30 in size")
    end if
  end subroutine check_magnitude

  subroutine check_scene(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, scene%bodies /= "file" .or. scene%bodies_file /= "", "scene", "bodies_file", error)
      call expect(report, scene%density > 0.0_dp, "scene", "density", error)
      call check_contact(report, scene%dimension, scene%rotation, scene%contact, "scene", "", error)
      call check_contact(report, scene%dimension, scene%rotation, scene%wall_contact, "scene", "wall_", error)
      call expect(report, all(scene%period >= 0.0_dp), "scene", "period", error)
      call expect(report, all(scene%cell_pressure >= 0.0_dp), "scene", "cell_pressure", error)
      call expect(report, scene%cell_inertia > 0.0_dp, "scene", "cell_inertia", error)
      call expect(report, .not. any(scene%cell_pressure > 0.0_dp .and. abs(scene%cell_strain_rate) > 0.0_dp), "scene", &
                  "cell_strain_rate", error, "0 along the axes of "//shown_text(report, "scene", "cell_pressure"))
      call expect(report, .not. any(abs(scene%cell_shear_stress) > 0.0_dp .and. abs(scene%cell_shear_rate) > 0.0_dp), "scene", &
                  "cell_shear_rate", error, "0 for the components of "//shown_text(report, "scene", "cell_shear_stress"))
      call expect(report, reaches(report, "scene", "gravity", scene%dimension), "scene", "gravity", error, &
                  to_text(scene%dimension)//" numbers")
      call expect(report, scene%gravity_table == "" .or. .not. is_given(report, "scene", "gravity"), "scene", "gravity", error, &
                  "none where "//shown_text(report, "scene", "gravity_table")//" replaces it")
      call expect(report, scene%gravity_table /= "" .or. .not. scene%gravity_table_repeats, "scene", "gravity_table_repeats", &
                  error, ".false. without a gravity_table")
      call expect(report, scene%cell_table /= "" .or. .not. scene%cell_table_repeats, "scene", "cell_table_repeats", error, &
                  ".false. without a cell_table")
      call expect(report, scene%alert_distance >= 0.0_dp .or. .not. scene%alert_distance_given, "scene", "alert_distance", error)
      call expect(report, scene%skin >= 0.0_dp .or. .not. scene%skin_given, "scene", "skin", error)
      call expect(report, scene%list_steps >= 0.0_dp, "scene", "list_steps", error)
      call expect(report, scene%overlap_allowed > 0.0_dp .or. .not. scene%overlap_allowed_given, "scene", "overlap_allowed", error)
      call expect(report, scene%start_overlap >= 0.0_dp, "scene", "start_overlap", error)
    end associate
  end subroutine check_scene

  subroutine check_column(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, scene%column_count >= 1, "scene", "column_count", error)
      call expect(report, scene%radius > 0.0_dp, "scene", "radius", error)
      call expect(report, scene%mass > 0.0_dp, "scene", "mass", error)
    end associate
  end subroutine check_column

  subroutine check_lattice(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, positive(scene%lattice_count, scene%dimension), "scene", "lattice_count", error, &
                  counts_text(scene%dimension))
      call expect(report, grid_product(scene%lattice_count) > 0, "scene", "lattice_count", error, &
                  "at most "//to_text(huge(1))//" bodies")
      call expect(report, scene%radius_min > 0.0_dp, "scene", "radius_min", error)
      call expect(report, scene%radius_max > 0.0_dp, "scene", "radius_max", error)
      call expect(report, scene%radius_min <= scene%radius_max, "scene", "radius_min", error, &
                  "at most radius_max, here "//shown_text(report, "scene", "radius_max"))
    end associate
  end subroutine check_lattice

  subroutine check_time(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, config%time%step > 0.0_dp, "time", "step", error)
    call expect(report, config%time%steps >= 0, "time", "steps", error)
    call expect(report, config%time%theta >= 0.5_dp .and. config%time%theta <= 1.0_dp, "time", "theta", error)
    call expect(report, config%time%rest_energy >= 0.0_dp, "time", "rest_energy", error)
    call check_stops(report, config, error)
  end subroutine check_time

  !> What ends a run before its last step.
  subroutine check_stops(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    logical :: known
    integer :: b

    associate (time => config%time)
      known = time%stop_boundary == ""
      do b = 1, size(config%boundaries)
        known = known .or. config%boundaries(b)%name == time%stop_boundary
      end do
      call expect(report, known, "time", "stop_boundary", error, "the name of a boundary of the input")
      if (time%stop_boundary /= "") call miss(report, "time", "stop_displacement", error, &
                                              shown_text(report, "time", "stop_boundary"))
      if (time%stop_displacement_given) call miss(report, "time", "stop_boundary", error, "stop_displacement")
      call expect(report, time%stop_boundary /= "" .or. .not. time%stop_displacement_given, "time", "stop_boundary", error, &
                  "the name of the boundary that stop_displacement is for")
      call expect(report, time%stop_displacement > 0.0_dp .or. .not. time%stop_displacement_given, "time", "stop_displacement", &
                  error)
      call expect(report, time%stop_grains_at_most >= 0, "time", "stop_grains_at_most", error)
      call expect(report, time%stop_grains_at_least >= 1 .or. .not. time%stop_grains_at_least_given, "time", &
                  "stop_grains_at_least", error)
      call expect(report, time%stop_mass_at_most >= 0.0_dp .or. .not. time%stop_mass_at_most_given, "time", "stop_mass_at_most", &
                  error)
      call expect(report, time%stop_mass_at_least > 0.0_dp .or. .not. time%stop_mass_at_least_given, "time", "stop_mass_at_least", &
                  error)
      associate (scene => config%scene)
        ! a table is not read yet
        if (scene%cell_table == "") then
          call check_stop_strain(report, "strain", time%stop_cell_strain, scene%cell_strain_rate, scene%cell_pressure, error)
          call check_stop_strain(report, "shear", time%stop_cell_shear, scene%cell_shear_rate, scene%cell_shear_stress, error)
        end if
      end associate
    end associate
  end subroutine check_stops

  !> Strains that end the run are those of components of the cell that move, in the direction of a rate that is given.
  subroutine check_stop_strain(report, kind, ends, rate, stress, error)
    type(report_t), intent(in) :: report
    !> strain or shear
    character(len=*), intent(in) :: kind
    real(dp), intent(in) :: ends(3), rate(3), stress(3)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: rate_key, stress_key

    rate_key = "cell_"//kind//"_rate"
    stress_key = trim(merge("cell_shear_stress", "cell_pressure    ", kind == "shear"))
    call expect(report, .not. any(abs(ends) > 0.0_dp .and. .not. abs(rate) > 0.0_dp .and. .not. abs(stress) > 0.0_dp), "time", &
                "stop_cell_"//kind, error, "0 for components of the cell that neither "//rate_key//" nor "//stress_key//" moves")
    call expect(report, .not. any(ends*sign(1.0_dp, rate) < 0.0_dp .and. abs(rate) > 0.0_dp), "time", "stop_cell_"//kind, error, &
                "the sign of "//shown_text(report, "scene", rate_key))
  end subroutine check_stop_strain

  subroutine check_solver(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(method_features_t) :: features

    features = features_of(trim(config%solver%method))
    associate (solver => config%solver)
      call expect(report, solver%criterion /= "error" .or. config%scene%bodies == "column", "solver", "criterion", error, &
                  "'residual': the exact solution, and so the error, is known for bodies = 'column' only")
      call expect(report, solver%accuracy > 0.0_dp, "solver", "accuracy", error)
      call expect(report, solver%tolerance > 0.0_dp, "solver", "tolerance", error)
      call expect(report, solver%fallback_contacts >= 1, "solver", "fallback_contacts", error)
      call expect(report, solver%max_iterations >= 1, "solver", "max_iterations", error)
      call expect(report, solver%sweeps >= 1, "solver", "sweeps", error)
      call expect(report, solver%relaxation > 0.0_dp .and. solver%relaxation <= 1.0_dp, "solver", "relaxation", error)
      call expect(report, solver%acceleration == "none" .or. .not. features%relaxes .or. &
                  .not. solver%relaxation_given, "solver", "acceleration", error, &
                  "'none' where relaxation is given: acceleration needs a factor that adapts itself")
      call expect(report, solver%velocity_scale > 0.0_dp .or. .not. solver%velocity_scale_given, "solver", "velocity_scale", &
                  error)
      call expect(report, solver%spot_checks >= 0.0_dp .and. solver%spot_checks <= 1.0_dp, "solver", "spot_checks", error)
      call expect(report, solver%criterion == "velocity_error" .or. .not. solver%spot_checks_given .or. &
                  .not. solver%spot_checks > 0.0_dp, "solver", "spot_checks", error, &
                  "0 unless criterion = 'velocity_error', whose estimates the checks are about")
      call expect(report, solver%check_every >= 1, "solver", "check_every", error)
      call expect(report, solver%warm_start .or. .not. solver%sleeping, "solver", "sleeping", error, &
                  ".false. where warm_start = .false.: bodies that sleep keep their impulses from step to step")
      call expect(report, solver%sleep_after >= 1, "solver", "sleep_after", error)
      call expect(report, solver%sleep_speed > 0.0_dp .or. .not. solver%sleep_speed_given, "solver", "sleep_speed", error)
    end associate
  end subroutine check_solver

  subroutine check_decomposition(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (parts => config%decomposition)
      call expect(report, parts%subdomains >= 1, "decomposition", "subdomains", error)
      call expect(report, parts%repartition_every >= 0, "decomposition", "repartition_every", error)
      call expect(report, parts%repartition_imbalance > 1.0_dp .or. .not. abs(parts%repartition_imbalance) > 0.0_dp, &
                  "decomposition", "repartition_imbalance", error)
      if (.not. parts%grid_given) return
      call expect(report, parts%partition == "grid", "decomposition", "grid", error, &
                  "no grid where partition = '"//trim(parts%partition)//"': give subdomains, or partition = 'grid'")
      call expect(report, positive(parts%grid, config%scene%dimension), "decomposition", "grid", error, &
                  counts_text(config%scene%dimension))
      call expect(report, grid_product(parts%grid) > 0, "decomposition", "grid", error, &
                  "at most "//to_text(huge(1))//" subdomains")
      call expect(report, parts%subdomains == grid_product(parts%grid), "decomposition", "subdomains", error, &
                  to_text(grid_product(parts%grid))//", the product of "//shown_text(report, "decomposition", "grid"))
    end associate
  end subroutine check_decomposition

  !> One domain where the method has no subdomains.
  subroutine check_method(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(method_features_t) :: features
    character(len=:), allocatable :: key

    features = features_of(trim(config%solver%method))
    if (features%decomposes) return
    key = "subdomains"
    if (.not. is_given(report, "decomposition", key)) key = "grid"
    call expect(report, config%decomposition%subdomains == 1, "decomposition", key, error, &
                "one subdomain where &solver method = '"//trim(config%solver%method)//"'; for several use method = "// &
                & quoted_names(that_decompose, "'", "or"))
  end subroutine check_method

  subroutine check_enriched(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(method_features_t) :: features

    features = features_of(trim(config%solver%method))
    associate (enriched => config%enriched)
      call expect(report, enriched%interface == "mumps" .or. .not. features%direct_interface_only, "enriched", "interface", error, &
                  "'mumps' where &solver method = '"//trim(config%solver%method)//"': its interface problem is not symmetric")
      call expect(report, enriched%direction >= 0.0_dp, "enriched", "direction", error)
      call expect(report, enriched%cg_tolerance > 0.0_dp .and. enriched%cg_tolerance < 1.0_dp, "enriched", "cg_tolerance", &
                  error)
      call expect(report, enriched%cg_max_iterations >= 1, "enriched", "cg_max_iterations", error)
    end associate
  end subroutine check_enriched

  subroutine check_output(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    call expect(report, config%output%directory /= "", "output", "directory", error)
    call expect(report, config%output%directory(1:1) /= "~", "output", "directory", error, &
                "a path without ~, which a shell replaces and this program does not")
    call expect(report, config%output%every >= 0, "output", "every", error)
    call expect(report, config%output%history_every >= 1, "output", "history_every", error)
    call expect(report, config%output%checkpoint_every >= 0, "output", "checkpoint_every", error)
    call expect(report, config%output%fclib_step >= 0, "output", "fclib_step", error)
    call expect(report, config%output%fclib_step <= config%time%steps, "output", "fclib_step", error, &
                "at most "//shown_text(report, "time", "steps"))
    call expect(report, config%output%final_bodies .or. .not. config%output%final_forces, "output", "final_forces", error, &
                ".false. without final_bodies = .true., whose file holds them")
    call expect(report, config%output%checkpoint_seconds >= 0.0_dp, "output", "checkpoint_seconds", error)
    call expect(report, config%output%walltime >= 0.0_dp, "output", "walltime", error)
    ! a 0 is an entry that is left out
    associate (tracked => config%output%tracked_bodies)
      call expect(report, all(tracked >= 0), "output", "tracked_bodies", error)
      do i = 1, size(tracked)
        call expect(report, tracked(i) == 0 .or. count(tracked == tracked(i)) == 1, "output", "tracked_bodies", error, &
                    "each identifier once")
      end do
      call expect(report, any(tracked > 0) .or. .not. config%output%tracked_forces, "output", "tracked_forces", error, &
                  ".false. without tracked_bodies, whose forces it adds")
    end associate
  end subroutine check_output

  !> Are the counts along each axis positive, the third one 1 in 2D?
  pure logical function positive(counts, dimension)
    !> shape (3)
    integer, intent(in) :: counts(:)
    integer, intent(in) :: dimension
    positive = all(counts >= 1) .and. (dimension == 3 .or. counts(3) == 1)
  end function positive

  pure function counts_text(dimension) result(text)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: text
    text = to_text(dimension)//" integers >= 1 where dimension = "//to_text(dimension)
  end function counts_text

  !> Product of counts; 0 when one is not positive or when the product exceeds the largest integer.
  pure integer function grid_product(counts) result(total)
    !> shape (3)
    integer, intent(in) :: counts(:)
    total = 0
    if (any(counts < 1)) return
    if (product(real(counts, dp)) <= real(huge(1), dp)) total = product(counts)
  end function grid_product

end module gravier_config_check
