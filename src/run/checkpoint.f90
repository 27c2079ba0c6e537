!> The state of a run between two steps, saved so that a run from it gives the bits of the run that was not interrupted, on
!> any number of ranks.
module gravier_checkpoint
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, text_from
  use gravier_periodic, only: period_words, period_record
  use gravier_narrow, only: take_count
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_body_store, only: body_record
  use gravier_boundary, only: boundary_words, boundary_record
  use gravier_insertion, only: insertion_words, insertion_record
  use gravier_inflow, only: given_words, given_record
  use gravier_population, only: population_words, population_record
  use gravier_backoff, only: backoff_words, backoff_record
  use gravier_fallback, only: fallback_words, fallback_record
  use gravier_refinement, only: refinement_words, refinement_record
  use gravier_drift, only: drift_words, drift_record
  use gravier_impulse_memory, only: pair_record
  use gravier_diagnostics, only: diagnostics_t
  use gravier_region_means, only: region_means_t, regions_key, samples_record
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics
  use gravier_partition, only: head_words, head_record
  use gravier_simulation, only: simulation_t
  use gravier_checkpoint_scene, only: check_scene, check_steps, check_removals, fixed_options
  use gravier_checkpoint_tables, only: save_tables, load_partition, load_grains, pack_boundaries
  implicit none
  private
  public :: save_checkpoint, load_checkpoint, checkpoint_name

  character(len=*), parameter :: checkpoint_name = "checkpoint.h5"
  character(len=*), parameter :: newline = achar(10)
  !> what the text of a loop's settings begins with: texts are not empty
  character(len=*), parameter :: settings_mark = "set:"

contains

  !> What the records of a checkpoint are, a line a kind, from the modules that make them: the version of the file.
  function records_text() result(text)
    character(len=:), allocatable :: text
    type(diagnostic_holder_t), allocatable :: diagnostics(:)
    integer :: k

    text = "grain: "//body_record//" position_now speed_when_listed"//newline//"pair: "//pair_record//newline// &
      & "boundary: "//boundary_record//", "//to_text(boundary_words)//" words"//newline// &
      & "cell: "//period_record//", "//to_text(period_words)//" words"//newline// &
      & "insertion: "//insertion_record//", "//to_text(insertion_words)//" words"//newline// &
      & "given grains: "//given_record//", "//to_text(given_words)//" words"//newline// &
      & "population: "//population_record//", "//to_text(population_words)//" words"//newline// &
      & "passes: "//backoff_record//", "//to_text(backoff_words)//" words"//newline// &
      & "second method: "//fallback_record//", "//to_text(fallback_words)//" words"//newline// &
      & "refinement: "//refinement_record//", "//to_text(refinement_words)//" words"//newline// &
      & "drift: "//drift_record//newline//"solves: figure_ratio"//newline
    call registered_diagnostics(diagnostics)
    do k = 1, size(diagnostics)
      associate (features => diagnostics(k)%diagnostic%features())
        if (features%n_words > 0) text = text//trim(features%key)//": "//trim(features%record)//", "// &
          & to_text(features%n_words)//" words"//newline
      end associate
    end do
    text = text//"regions: "//samples_record//newline
    text = text//"layout: degrees_of_freedom"//newline//"lists: largest_extent_when_listed, corner_of_orders"//newline
    text = text//"files: names"//newline//"loop: names of settings"//newline
    text = text//"partition: "//head_record//", "//to_text(head_words)//" words; division"
  end function records_text

  !> Write a checkpoint, in the place of an older one when it is complete. Collective; errors are the same on all ranks.
  subroutine save_checkpoint(simulation, path, error)
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8), allocatable :: words(:)
    integer(i8) :: seen(population_words), passes(backoff_words), takeovers(fallback_words), refinements(refinement_words)

    if (allocated(error)) return
    call file%create(simulation%comm, path, records_text(), error)
    call file%write_text("scene", fixed_options(simulation), error)
    call file%write_text("files", simulation%files, error)
    call file%write_text("set_by_loop", settings_mark//simulation%set_by_loop, error)
    call file%write_scalar("subdomains", int(simulation%decomposition%n_subdomains, i8), error)
    call file%write_scalar("time_step", simulation%physics%h, error)
    call file%write_scalar("theta", simulation%config%time%theta, error)
    call file%write_scalar("grains_at_start", simulation%n_first, error)
    call file%write_scalar("mean_radius_at_start", simulation%decomposition%rule%mean_radius, error)
    call file%write_scalar("step", int(simulation%step, i8), error)
    call file%write_scalar("time", simulation%time, error)
    call file%write_scalar("grains", simulation%n_grains, error)
    call file%write_scalar("glued", simulation%n_glued, error)
    call file%write_scalar("failed", simulation%failed, error)
    call file%write_scalar("left", simulation%left, error)
    call file%write_scalar("mass", simulation%mass, error)
    call file%write_scalar("left_mass", simulation%left_mass, error)
    call file%write_scalar("first_mass", simulation%first_mass, error)
    call file%write_scalar("fast", simulation%fast, error)
    call file%write_scalar("rest_energy", simulation%rest_energy, error)
    call file%write_scalar("quiet", int(simulation%quiet, i8), error)
    call file%write_scalar("last_written", int(simulation%last_written, i8), error)
    call file%write_scalar("lists_made", simulation%halo%builds, error)
    call file%write_scalar("largest_extent_when_listed", simulation%halo%largest_extent, error)
    words = real_words(simulation%halo%corner, size(simulation%halo%corner))
    call file%write_array("corner_of_orders", words, error)
    call file%write_scalar("next_id", simulation%inflow%next_id, error)
    call simulation%population%get_state(seen)
    call file%write_array("population", seen, error)
    call simulation%pass_backoff%get_state(passes)
    call file%write_array("passes", passes, error)
    call simulation%fallback%get_state(takeovers)
    call file%write_array("second_method", takeovers, error)
    call simulation%refinement%get_state(refinements)
    call file%write_array("refinement", refinements, error)
    deallocate (words)
    allocate (words(drift_words(size(simulation%decomposition%boundaries))))
    call simulation%drift%get_state(words)
    call file%write_array("drift", words, error)
    call file%write_scalar("figure_ratio", simulation%figure_ratio, error)
    call simulation%inflow%get_state(words)
    call file%write_array("insertions", words, error)
    associate (memory => simulation%halo%memory)
      call file%write_scalar("impulse_entries", int(memory%n_impulse, i8), error)
      call file%write_scalar("spring_entries", int(memory%n_spring, i8), error)
      call file%write_scalar("law_row", int(memory%law_row, i8), error)
      call file%write_scalar("touch_row", int(memory%touch_row, i8), error)
      call file%write_scalar("may_sleep", int(simulation%decomposition%nr, i8), error)
      call file%write_scalar("degrees_of_freedom", int(simulation%decomposition%nv, i8), error)
      call file%write_scalar("key_row", int(memory%key_row, i8), error)
    end associate
    call file%write_scalar("imbalance", simulation%imbalance, error)
    call file%write_scalar("reached_imbalance", simulation%reached_imbalance, error)
    call pack_boundaries(simulation%decomposition%boundaries, words)
    call file%write_array("boundaries", words, error)
    if (simulation%halo%builds > 0) then
      call pack_boundaries(simulation%halo%reference_boundaries, words)
      call file%write_array("boundaries_when_listed", words, error)
    end if
    words = cell_words(simulation)
    call file%write_array("cell", words, error)
    words = real_words(simulation%boundary_impulses, size(simulation%boundary_impulses))
    call file%write_array("boundary_impulses", words, error)
    call save_diagnostics(simulation%diagnostics, file, error)
    call save_samples(simulation%diagnostics, file, error)
    call simulation%decomposition%partition%get_head(words)
    call file%write_array("partition", words, error)
    call file%write_text("division", simulation%division%text(), error)
    call save_tables(simulation, file, error)
    call file%commit(error)
  end subroutine save_checkpoint

  !> Take the state of a checkpoint into a simulation that was made from the same scene. Failure: status_input, with file
  !> and what does not fit. Collective; errors are the same on all ranks.
  subroutine load_checkpoint(simulation, path, accepts, error)
    type(simulation_t), intent(inout) :: simulation
    character(len=*), intent(in) :: path
    !> loads, drives and coefficients of contact may be others
    logical, intent(in) :: accepts
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8) :: step, last_written, builds, quiet
    integer :: own_step, own_last, own_quiet, n
    real(dp) :: rest_energy
    integer(i8), allocatable :: words(:)
    character(len=:), allocatable :: division

    if (allocated(error)) return
    call file%open(simulation%comm, path, records_text(), error)
    call check_scene(simulation, file, path, accepts, error)
    call file%read_scalar("step", step, error)
    call check_steps(simulation, step, path, error)
    call file%read_text("files", simulation%files, error)
    call file%read_text("set_by_loop", simulation%set_before, error)
    call file%read_text("division", division, error)
    call file%read_scalar("time", simulation%time, error)
    call file%read_scalar("grains", simulation%n_grains, error)
    call file%read_scalar("glued", simulation%n_glued, error)
    call file%read_scalar("failed", simulation%failed, error)
    call file%read_scalar("left", simulation%left, error)
    call file%read_scalar("mass", simulation%mass, error)
    call file%read_scalar("left_mass", simulation%left_mass, error)
    call file%read_scalar("first_mass", simulation%first_mass, error)
    call file%read_scalar("fast", simulation%fast, error)
    call file%read_scalar("rest_energy", rest_energy, error)
    call file%read_scalar("quiet", quiet, error)
    call file%read_scalar("last_written", last_written, error)
    call file%read_scalar("lists_made", builds, error)
    call file%read_scalar("imbalance", simulation%imbalance, error)
    call file%read_scalar("reached_imbalance", simulation%reached_imbalance, error)
    call file%read_scalar("next_id", simulation%inflow%next_id, error)
    call load_insertions(simulation, file, path, error)
    call file%read_array("population", population_words, population_words, words, error)
    if (.not. allocated(error)) call simulation%population%set_state(words)
    call file%read_array("passes", backoff_words, backoff_words, words, error)
    if (.not. allocated(error)) call simulation%pass_backoff%set_state(words)
    call file%read_array("second_method", fallback_words, fallback_words, words, error)
    if (.not. allocated(error)) call simulation%fallback%set_state(words)
    call file%read_array("refinement", refinement_words, refinement_words, words, error)
    if (.not. allocated(error)) call simulation%refinement%set_state(words)
    n = drift_words(size(simulation%decomposition%boundaries))
    call file%read_array("drift", n, n, words, error)
    if (.not. allocated(error)) call simulation%drift%set_state(words)
    call file%read_scalar("figure_ratio", simulation%figure_ratio, error)
    call take_count(step, path//": step", own_step, error)
    ! -1 where none was written
    call take_count(last_written + 1, path//": last_written", own_last, error)
    call take_count(quiet, path//": quiet", own_quiet, error)
    call file%read_array("boundary_impulses", size(simulation%boundary_impulses), &
      & size(simulation%boundary_impulses), words, error)
    if (.not. allocated(error)) call take_reals(words, simulation%boundary_impulses, size(simulation%boundary_impulses))
    if (allocated(error)) then
      call file%close(error)
      return
    end if
    simulation%step = own_step
    simulation%last_written = own_last - 1
    ! steps that were at rest by another measure do not count
    if (.not. abs(rest_energy - simulation%rest_energy) > 0.0_dp .and. simulation%changes == "") simulation%quiet = own_quiet
    simulation%restarted = .true.
    simulation%division%overdue = division /= simulation%division%text() .and. simulation%division%subdomains > 1
    simulation%set_before = text_from(simulation%set_before, len(settings_mark) + 1)
    call simulation%make_subdomains()
    call load_partition(simulation, file, path, error)
    call load_grains(simulation, file, path, builds, error)
    if (simulation%changes /= "") call check_removals(simulation, path, error)
    if (.not. allocated(error) .and. simulation%changes /= "") call simulation%wake()
    if (.not. allocated(error)) call simulation%start_diagnostics()
    call load_diagnostics(simulation%diagnostics, file, error)
    call load_samples(simulation%diagnostics, file, error)
    call file%close(error)
  end subroutine load_checkpoint

  !> The accounts of the grains that a loop has placed and of the insertions. Failure (status_input): accounts that no run has.
  subroutine load_insertions(simulation, file, path, error)
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: words(:)
    logical :: sound
    integer :: n

    n = given_words + insertion_words*size(simulation%inflow%insertions)
    call file%read_array("insertions", n, n, words, error)
    if (allocated(error)) return
    call simulation%inflow%set_state(words, sound)
    if (.not. sound) call raise(error, status_input, path// &
      & ": the array insertions has an account that no run has: the file is damaged")
  end subroutine load_insertions

  !> The states of all diagnostics that have one; no words of those that are not asked for.
  subroutine save_diagnostics(diagnostics, file, error)
    type(diagnostics_t), intent(in) :: diagnostics
    type(checkpoint_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    type(diagnostic_holder_t), allocatable :: all_kinds(:)
    integer(i8), allocatable :: words(:)
    integer :: k, place

    call registered_diagnostics(all_kinds)
    do k = 1, size(all_kinds)
      associate (features => all_kinds(k)%diagnostic%features())
        if (features%n_words == 0) cycle
        place = diagnostics%place(trim(features%key))
        allocate (words(merge(features%n_words, 0, place > 0)))
        if (place > 0) call diagnostics%asked(place)%diagnostic%get_state(words)
        call file%write_array(trim(features%array), words, error)
        deallocate (words)
      end associate
    end do
  end subroutine save_diagnostics

  !> Take the states of diagnostics that are asked for now and were asked for then. One that begins now has no past.
  subroutine load_diagnostics(diagnostics, file, error)
    type(diagnostics_t), intent(inout) :: diagnostics
    type(checkpoint_file_t), intent(in) :: file
    type(error_t), allocatable, intent(inout) :: error
    type(diagnostic_holder_t), allocatable :: all_kinds(:)
    integer(i8), allocatable :: words(:)
    integer :: k, place

    call registered_diagnostics(all_kinds)
    do k = 1, size(all_kinds)
      associate (features => all_kinds(k)%diagnostic%features())
        if (features%n_words == 0) cycle
        call file%read_array(trim(features%array), 0, features%n_words, words, error)
        if (allocated(error)) return
        place = diagnostics%place(trim(features%key))
        if (place > 0 .and. size(words) == features%n_words) call diagnostics%asked(place)%diagnostic%set_state(words)
      end associate
    end do
  end subroutine load_diagnostics

  !> Samples of regions that no state has been written of yet; no words where there are no regions.
  subroutine save_samples(diagnostics, file, error)
    type(diagnostics_t), intent(in) :: diagnostics
    type(checkpoint_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: words(:)
    integer :: place

    place = diagnostics%place(regions_key)
    allocate (words(0))
    if (place > 0) then
      select type (means => diagnostics%asked(place)%diagnostic)
      type is (region_means_t)
        call means%get_samples(words)
      end select
    end if
    call file%write_array("region_samples", words, error)
  end subroutine save_samples

  subroutine load_samples(diagnostics, file, error)
    type(diagnostics_t), intent(inout) :: diagnostics
    type(checkpoint_file_t), intent(in) :: file
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: words(:)
    integer :: place

    call file%read_array("region_samples", 0, huge(1), words, error)
    if (allocated(error)) return
    place = diagnostics%place(regions_key)
    if (place == 0) return
    select type (means => diagnostics%asked(place)%diagnostic)
    type is (region_means_t)
      call means%set_samples(words)
    end select
  end subroutine load_samples

  !> The cell now, and as it was when the lists were made.
  pure function cell_words(simulation) result(words)
    type(simulation_t), intent(in) :: simulation
    integer(i8) :: words(2*period_words)

    call simulation%decomposition%period%get_state(words(1:period_words))
    words(period_words + 1:) = words(1:period_words)
    if (simulation%halo%builds > 0) call simulation%halo%reference_period%get_state(words(period_words + 1:))
  end function cell_words

  pure function real_words(values, n) result(words)
    integer, intent(in) :: n
    real(dp), intent(in) :: values(n)
    integer(i8) :: words(n)
    integer :: k

    do k = 1, n
      words(k) = transfer(values(k), 0_i8)
    end do
  end function real_words

  pure subroutine take_reals(words, values, n)
    integer(i8), intent(in), contiguous :: words(:)
    integer, intent(in) :: n
    real(dp), intent(inout) :: values(n)
    integer :: k

    do k = 1, min(n, size(words))
      values(k) = transfer(words(k), 0.0_dp)
    end do
  end subroutine take_reals

end module gravier_checkpoint
