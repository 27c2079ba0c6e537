!> The state of a run between two steps, saved so that a run from it gives the bits of the run that was not interrupted, on
!> any number of ranks.
module gravier_checkpoint
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_time_table, only: time_table_t
  use gravier_narrow, only: narrow, take_count
  use gravier_body_store, only: body_layout_t, place_word, body_record
  use gravier_boundary, only: boundary_t, boundary_words, boundary_record
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_impulse_memory, only: list_impulses, match_impulses, pair_record
  use gravier_diagnostics, only: diagnostics_t
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics
  use gravier_partition, only: head_words, head_record, is_sound_head
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_config, only: write_active
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: save_checkpoint, load_checkpoint, checkpoint_name

  character(len=*), parameter :: checkpoint_name = "checkpoint.h5"
  character(len=*), parameter :: newline = achar(10)
  !> groups of the input that a run must go on with as it began
  character(len=*), parameter :: fixed_groups = "&scene &boundary &sample &material &law"

contains

  !> What the records of a checkpoint are, a line a kind, from the modules that make them: the version of the file.
  function records_text() result(text)
    character(len=:), allocatable :: text
    type(diagnostic_holder_t), allocatable :: diagnostics(:)
    integer :: k

    text = "grain: "//body_record//" position_now"//newline//"pair: "//pair_record//newline// &
      & "boundary: "//boundary_record//", "//to_text(boundary_words)//" words"//newline
    call registered_diagnostics(diagnostics)
    do k = 1, size(diagnostics)
      associate (features => diagnostics(k)%item%features())
        if (features%n_words > 0) text = text//trim(features%key)//": "//trim(features%record)//", "// &
          & to_text(features%n_words)//" words"//newline
      end associate
    end do
    text = text//"partition: "//head_record//", "//to_text(head_words)//" words"
  end function records_text

  !> Write a checkpoint, in the place of an older one when it is complete. Collective; errors are the same on all ranks.
  subroutine save_checkpoint(simulation, path, error)
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8), allocatable :: words(:)

    if (allocated(error)) return
    call file%create(simulation%comm, path, records_text(), error)
    call file%write_text("scene", fixed_options(simulation), error)
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
    call file%write_scalar("fast", simulation%fast, error)
    call file%write_scalar("last_written", int(simulation%last_written, i8), error)
    call file%write_scalar("lists_made", simulation%neighbourhoods%builds, error)
    associate (memory => simulation%neighbourhoods%memory)
      call file%write_scalar("impulse_entries", int(memory%n_impulse, i8), error)
      call file%write_scalar("law_row", int(memory%law_row, i8), error)
      call file%write_scalar("rest_row", int(memory%rest_row, i8), error)
    end associate
    call file%write_scalar("imbalance", simulation%imbalance, error)
    call file%write_scalar("reached_imbalance", simulation%reached_imbalance, error)
    call pack_boundaries(simulation%decomposition%boundaries, words)
    call file%write_array("boundaries", words, error)
    if (simulation%neighbourhoods%builds > 0) then
      call pack_boundaries(simulation%neighbourhoods%reference_boundaries, words)
      call file%write_array("boundaries_when_listed", words, error)
    end if
    words = real_words(simulation%boundary_impulses, size(simulation%boundary_impulses))
    call file%write_array("boundary_impulses", words, error)
    call save_diagnostics(simulation%diagnostics, file, error)
    call simulation%decomposition%partition%get_head(words)
    call file%write_array("partition", words, error)
    call save_tables(simulation, file, error)
    call file%commit(error)
  end subroutine save_checkpoint

  !> Take the state of a checkpoint into a simulation that was made from the same scene. Failure: status_input, with file
  !> and what does not fit. Collective; errors are the same on all ranks.
  subroutine load_checkpoint(simulation, path, error)
    type(simulation_t), intent(inout) :: simulation
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8) :: step, last_written, builds
    integer :: own_step, own_last
    integer(i8), allocatable :: words(:)

    if (allocated(error)) return
    call file%open(simulation%comm, path, records_text(), error)
    call check_scene(simulation, file, path, error)
    call file%read_scalar("step", step, error)
    call check_steps(simulation, step, path, error)
    call file%read_scalar("time", simulation%time, error)
    call file%read_scalar("grains", simulation%n_grains, error)
    call file%read_scalar("glued", simulation%n_glued, error)
    call file%read_scalar("failed", simulation%failed, error)
    call file%read_scalar("left", simulation%left, error)
    call file%read_scalar("fast", simulation%fast, error)
    call file%read_scalar("last_written", last_written, error)
    call file%read_scalar("lists_made", builds, error)
    call file%read_scalar("imbalance", simulation%imbalance, error)
    call file%read_scalar("reached_imbalance", simulation%reached_imbalance, error)
    call take_count(step, path//": step", own_step, error)
    ! -1 where none was written
    call take_count(last_written + 1, path//": last_written", own_last, error)
    call file%read_array("boundary_impulses", size(simulation%boundary_impulses), &
      & size(simulation%boundary_impulses), words, error)
    if (.not. allocated(error)) call take_reals(words, simulation%boundary_impulses, size(simulation%boundary_impulses))
    if (allocated(error)) then
      call file%close(error)
      return
    end if
    simulation%step = own_step
    simulation%last_written = own_last - 1
    simulation%restarted = .true.
    call simulation%make_subdomains()
    call load_partition(simulation, file, path, error)
    call load_grains(simulation, file, path, builds, error)
    if (.not. allocated(error)) call simulation%start_diagnostics()
    call load_diagnostics(simulation%diagnostics, file, error)
    call file%close(error)
  end subroutine load_checkpoint

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
      associate (features => all_kinds(k)%item%features())
        if (features%n_words == 0) cycle
        place = diagnostics%place(trim(features%key))
        allocate (words(merge(features%n_words, 0, place > 0)))
        if (place > 0) call diagnostics%asked(place)%item%get_state(words)
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
      associate (features => all_kinds(k)%item%features())
        if (features%n_words == 0) cycle
        call file%read_array(trim(features%array), 0, features%n_words, words, error)
        if (allocated(error)) return
        place = diagnostics%place(trim(features%key))
        if (place > 0 .and. size(words) == features%n_words) call diagnostics%asked(place)%item%set_state(words)
      end associate
    end do
  end subroutine load_diagnostics

  !> Refuse a checkpoint of another scene, naming the first option that differs.
  subroutine check_scene(simulation, file, path, error)
    type(simulation_t), intent(in) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
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
      if (.not. allocated(error)) call compare_options(path, before, fixed_options(simulation), config%file, error)
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

  !> Fails at the first line that differs between the options of a checkpoint and those of now.
  subroutine compare_options(path, before, now, input, error)
    character(len=*), intent(in) :: path, before, now, input
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: line_before, line_now
    integer :: at_before, at_now

    at_before = 1
    at_now = 1
    do while (at_before <= len(before) .or. at_now <= len(now))
      call next_line(before, at_before, line_before)
      call next_line(now, at_now, line_now)
      if (line_before == line_now) cycle
      call raise(error, status_input, input//": the scene is not that of "//path//": "//trim(adjustl(line_now))// &
        & ": expected "//trim(adjustl(line_before)))
      return
    end do
  end subroutine compare_options

  pure subroutine next_line(text, at, line)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(out) :: line
    integer :: length

    if (at > len(text)) then
      line = "(nothing)"
      return
    end if
    length = index(text(at:)//newline, newline) - 1
    line = text(at:at + length - 1)
    at = at + length + 1
  end subroutine next_line

  !> The options in force that must not change, a line each, and what tells contents of tables apart.
  function fixed_options(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    character(len=:), allocatable :: options, line
    integer :: at, b
    logical :: fixed

    call write_active(options, simulation%config)
    text = ""
    fixed = .false.
    at = 1
    do while (at <= len(options))
      call next_line(options, at, line)
      if (line(1:min(1, len(line))) == "&") fixed = index(fixed_groups//" ", line//" ") > 0
      ! starts are over
      if (index(line, "  title = ") == 1 .or. index(line, "  start_overlap = ") == 1) cycle
      if (fixed) text = text//line//newline
    end do
    call add_table(simulation%gravity_table, trim(simulation%config%scene%gravity_table))
    do b = 1, size(simulation%config%boundaries)
      call add_table(simulation%decomposition%boundaries(simulation%n_walls + b)%table, trim(simulation%config%boundaries(b)%table))
    end do

  contains

    subroutine add_table(table, path)
      type(time_table_t), intent(in) :: table
      character(len=*), intent(in) :: path

      if (allocated(table%has)) text = text//"contents of "//path//", digest "//to_text(table%digest())//newline
    end subroutine add_table

  end function fixed_options

  pure subroutine pack_boundaries(boundaries, words)
    type(boundary_t), intent(in) :: boundaries(:)
    integer(i8), allocatable, intent(out) :: words(:)
    integer :: b

    allocate (words(boundary_words*size(boundaries)))
    do b = 1, size(boundaries)
      call boundaries(b)%get_state(words((b - 1)*boundary_words + 1:b*boundary_words))
    end do
  end subroutine pack_boundaries

  pure subroutine unpack_boundaries(words, boundaries)
    type(boundary_t), intent(inout) :: boundaries(:)
    integer(i8), intent(in) :: words(boundary_words*size(boundaries))
    integer :: b

    do b = 1, size(boundaries)
      call boundaries(b)%set_state(words((b - 1)*boundary_words + 1:b*boundary_words))
    end do
  end subroutine unpack_boundaries

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

  !> By subdomain: the grains where they were when the lists were made, each with its place now; the impulses and states; the
  !> cells.
  subroutine save_tables(simulation, file, error)
    type(simulation_t), intent(in) :: simulation
    type(checkpoint_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), own(:, :), counts(:), map(:)
    integer :: s, n, k, n_subdomains

    n_subdomains = simulation%decomposition%n_subdomains
    associate (home => simulation%decomposition%home)
      allocate (counts(size(home)))
      call pack_grains(simulation, records, counts)
      call file%write_table("grains", n_subdomains, records, counts, error)
      if (simulation%neighbourhoods%builds > 0) then
        do s = 1, size(home)
          counts(s) = simulation%neighbourhoods%view(s)%list%n_kept()
        end do
        deallocate (records)
        allocate (records(2 + simulation%neighbourhoods%memory%words(), sum(counts)))
        n = 0
        do s = 1, size(home)
          call list_impulses(simulation%neighbourhoods%view(s), 0, own)
          records(:, n + 1:n + size(own, 2)) = own
          n = n + size(own, 2)
        end do
        call file%write_table("impulses", n_subdomains, records, counts, error)
      end if
      deallocate (records)
      do s = 1, size(home)
        call simulation%decomposition%partition%get_map(simulation%decomposition%subdomain_of(s), map)
        counts(s) = size(map)
      end do
      allocate (records(1, sum(counts)))
      n = 0
      do s = 1, size(home)
        call simulation%decomposition%partition%get_map(simulation%decomposition%subdomain_of(s), map)
        do k = 1, size(map)
          records(1, n + k) = map(k)
        end do
        n = n + size(map)
      end do
      call file%write_table("cells", n_subdomains, records, counts, error)
    end associate
  end subroutine save_tables

  subroutine pack_grains(simulation, records, counts)
    type(simulation_t), intent(in) :: simulation
    !> (words of a grain + nd, grains): its place is that of the lists, the last words are its place now
    integer(i8), allocatable, intent(out) :: records(:, :)
    !> (subdomains of this rank)
    integer(i8), intent(out) :: counts(:)
    type(body_layout_t) :: layout
    integer :: s, k, n, d, words, nd

    nd = simulation%decomposition%nd
    layout = simulation%decomposition%layout()
    words = layout%record_words()
    associate (home => simulation%decomposition%home)
      do s = 1, size(home)
        counts(s) = home(s)%n
      end do
      allocate (records(words + nd, sum(counts)))
      n = 0
      do s = 1, size(home)
        do k = 1, home(s)%n
          n = n + 1
          call home(s)%get_record(k, records(1:words, n))
          do d = 1, nd
            records(words + d, n) = transfer(home(s)%position(d, k), 0_i8)
            if (simulation%neighbourhoods%builds > 0) records(place_word - 1 + d, n) = &
              & transfer(simulation%neighbourhoods%reference(s)%position(d, k), 0_i8)
          end do
        end do
      end do
    end associate
  end subroutine pack_grains

  subroutine load_partition(simulation, file, path, error)
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: head(:), records(:, :), counts(:), words(:)
    integer, allocatable :: lengths(:)

    call file%read_array("partition", head_words, huge(head_words), head, error)
    call file%read_table("cells", simulation%decomposition%n_subdomains, 1, records, counts, error)
    if (allocated(error)) return
    if (.not. is_sound_head(head, simulation%decomposition%nd, simulation%decomposition%n_subdomains)) &
      & call raise(error, status_input, path//": the array partition is none of this scene in "// &
      & to_text(simulation%decomposition%n_subdomains)//" subdomains: the file is damaged")
    if (allocated(error)) return
    words = records(1, :)
    lengths = narrow(counts)
    call simulation%decomposition%partition%restore(simulation%comm, head, words, lengths)
  end subroutine load_partition

  !> Grains into their homes as when the lists were made, then the lists with their impulses, then everything to where it
  !> was when the checkpoint was written.
  subroutine load_grains(simulation, file, path, builds, error)
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: builds
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), counts(:), words(:), now(:)
    type(body_layout_t) :: layout
    integer :: s, k, n, d, nd, n_words, n_boundary

    associate (decomposition => simulation%decomposition)
      nd = decomposition%nd
      layout = decomposition%layout()
      n_words = layout%record_words()
      n_boundary = boundary_words*size(decomposition%boundaries)
      call file%read_table("grains", decomposition%n_subdomains, n_words + nd, records, counts, error)
      if (builds > 0) call file%read_array("boundaries_when_listed", n_boundary, n_boundary, words, error)
      call file%read_array("boundaries", n_boundary, n_boundary, now, error)
      if (builds > 0 .and. .not. allocated(error)) call check_reals(path//": the array boundaries_when_listed", words, error)
      if (.not. allocated(error)) call check_reals(path//": the array boundaries", now, error)
      if (.not. allocated(error)) call check_grains(simulation, path, records, error)
      call simulation%comm%agree(error)
      if (allocated(error)) return
      n = 0
      do s = 1, size(decomposition%home)
        call decomposition%home(s)%init(nd, decomposition%nv, decomposition%ni, narrow(counts(s)))
        do k = 1, decomposition%home(s)%n
          call decomposition%home(s)%set_record(k, records(1:n_words, n + k))
        end do
        n = n + decomposition%home(s)%n
      end do
      if (builds > 0) then
        call unpack_boundaries(words, decomposition%boundaries)
        call simulation%neighbourhoods%build(decomposition)
        simulation%neighbourhoods%builds = builds
        call load_impulses(simulation, file, path, error)
      end if
      n = 0
      do s = 1, size(decomposition%home)
        do k = 1, decomposition%home(s)%n
          do d = 1, nd
            decomposition%home(s)%position(d, k) = transfer(records(n_words + d, n + k), 0.0_dp)
          end do
        end do
        n = n + decomposition%home(s)%n
      end do
      call unpack_boundaries(now, decomposition%boundaries)
    end associate
  end subroutine load_grains

  !> Refuse grains of a file that no scene has. Errors may differ between ranks.
  subroutine check_grains(simulation, path, records, error)
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    !> (words of a grain and its place now, grains of this rank)
    integer(i8), intent(in), contiguous :: records(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(body_layout_t) :: layout
    character(len=:), allocatable :: field
    integer :: k

    layout = simulation%decomposition%layout()
    do k = 1, size(records, 2)
      field = layout%invalid_field(records(:, k), size(simulation%decomposition%boundaries), size(simulation%config%materials))
      if (len(field) > 0) call raise(error, status_input, path//": table grains: grain "//to_text(records(1, k))// &
        & " has a value of "//field//" that no grain has: the file is damaged")
      call check_reals(path//": table grains: grain "//to_text(records(1, k)), records(layout%record_words() + 1:, k), error)
      if (allocated(error)) return
    end do
  end subroutine check_grains

  !> Refuse reals of a file that are none to reckon with.
  subroutine check_reals(what, words, error)
    !> file and place, for the message
    character(len=*), intent(in) :: what
    integer(i8), intent(in) :: words(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, size(words)
      if (is_bounded(transfer(words(k), 0.0_dp))) cycle
      call raise(error, status_input, what//": "//bounded_text//" was expected: the file is damaged")
      return
    end do
  end subroutine check_reals

  subroutine load_impulses(simulation, file, path, error)
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), counts(:)
    integer(i8) :: n_impulse, law_row, rest_row
    type(pair_memory_t) :: kept
    integer :: s, n

    call file%read_scalar("impulse_entries", n_impulse, error)
    call file%read_scalar("law_row", law_row, error)
    call file%read_scalar("rest_row", rest_row, error)
    call take_count(n_impulse, path//": impulse_entries", kept%n_impulse, error)
    call take_count(law_row, path//": law_row", kept%law_row, error)
    call take_count(rest_row, path//": rest_row", kept%rest_row, error)
    call file%read_table("impulses", simulation%decomposition%n_subdomains, 2 + kept%words(), records, counts, error)
    if (allocated(error)) return
    n = 0
    do s = 1, size(simulation%neighbourhoods%view)
      call match_impulses(records(:, n + 1:n + narrow(counts(s))), kept, simulation%neighbourhoods%view(s))
      n = n + narrow(counts(s))
    end do
  end subroutine load_impulses

end module gravier_checkpoint
