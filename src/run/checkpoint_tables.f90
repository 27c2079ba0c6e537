!> The tables of a checkpoint by subdomain: grains, impulses and states of pairs, cells of the partition; and the boundaries.
module gravier_checkpoint_tables
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_periodic, only: period_words
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_narrow, only: narrow, take_count
  use gravier_shape_library, only: shape_library_t
  use gravier_body_store, only: body_layout_t, body_set_t, place_word
  use gravier_boundary, only: boundary_t, boundary_words
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_impulse_memory, only: list_impulses, match_impulses
  use gravier_partition, only: head_words, is_sound_head
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: save_tables, load_partition, load_grains, pack_boundaries

contains

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

  !> By subdomain: the grains where they were when the lists were made, each with its place now; the impulses and states; the
  !> cells.
  subroutine save_tables(simulation, file, error)
    type(simulation_t), intent(in) :: simulation
    type(checkpoint_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), own(:, :), counts(:), map(:)
    integer, allocatable :: kept(:)
    integer :: s, n, k, n_subdomains

    n_subdomains = simulation%decomposition%n_subdomains
    associate (owned => simulation%decomposition%owned)
      allocate (counts(size(owned)))
      call pack_grains(simulation, records, counts)
      call file%write_table("grains", n_subdomains, records, counts, error)
      if (simulation%halo%builds > 0) then
        do s = 1, size(owned)
          call simulation%halo%view(s)%list%find_kept(kept)
          counts(s) = size(kept)
        end do
        deallocate (records)
        allocate (records(2 + simulation%halo%memory%words(), sum(counts)))
        n = 0
        do s = 1, size(owned)
          call simulation%halo%view(s)%list%find_kept(kept)
          call list_impulses(simulation%halo%view(s), 0, kept, own)
          records(:, n + 1:n + size(own, 2)) = own
          n = n + size(own, 2)
        end do
        call file%write_table("impulses", n_subdomains, records, counts, error)
      end if
      deallocate (records)
      do s = 1, size(owned)
        call simulation%decomposition%partition%get_map(simulation%decomposition%subdomain_of(s), map)
        counts(s) = size(map)
      end do
      allocate (records(1, sum(counts)))
      n = 0
      do s = 1, size(owned)
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
    !> (words of a grain + nd + 1, grains): its place is that of the lists; then its place now, and its speed when the lists were
    !> made
    integer(i8), allocatable, intent(out) :: records(:, :)
    !> (subdomains of this rank)
    integer(i8), intent(out) :: counts(:)
    type(body_layout_t) :: layout
    integer(i8), allocatable :: whole(:)
    integer :: s, k, n, d, words, nd

    nd = simulation%decomposition%nd
    layout = simulation%decomposition%layout()
    words = layout%saved_words()
    allocate (whole(layout%record_words()))
    associate (owned => simulation%decomposition%owned)
      do s = 1, size(owned)
        counts(s) = owned(s)%n
      end do
      allocate (records(words + nd + 1, sum(counts)))
      n = 0
      do s = 1, size(owned)
        do k = 1, owned(s)%n
          n = n + 1
          call owned(s)%get_record(k, whole)
          records(1:words, n) = whole(1:words)
          do d = 1, nd
            records(words + d, n) = transfer(owned(s)%position(d, k), 0_i8)
            if (simulation%halo%builds > 0) records(place_word - 1 + d, n) = &
              & transfer(simulation%halo%reference(s)%position(d, k), 0_i8)
          end do
          records(words + nd + 1, n) = 0_i8
          if (simulation%halo%builds > 0) records(words + nd + 1, n) = transfer(simulation%halo%reference(s)%speed(k), 0_i8)
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
      & call raise(error, status_input, path//": the array partition does not fit this scene in "// &
      & to_text(simulation%decomposition%n_subdomains)//" subdomains: the file is damaged")
    if (allocated(error)) return
    words = records(1, :)
    lengths = narrow(counts)
    call simulation%decomposition%partition%restore(simulation%comm, head, words, lengths)
  end subroutine load_partition

  !> Grains to their owners as when the lists were made, then the lists with their impulses, then everything to where it
  !> was when the checkpoint was written.
  subroutine load_grains(simulation, file, path, builds, error)
    type(simulation_t), intent(inout) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: builds
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), counts(:), words(:), now(:), cell(:), corner(:)
    type(body_layout_t) :: layout, kept
    real(dp) :: least_extent
    integer :: s, k, n, d, nd, n_words, n_boundary

    associate (decomposition => simulation%decomposition)
      nd = decomposition%nd
      layout = decomposition%layout()
      n_words = layout%record_words()
      n_boundary = boundary_words*size(decomposition%boundaries)
      call read_layout(simulation, file, path, kept, error)
      call file%read_table("grains", decomposition%n_subdomains, kept%saved_words() + nd + 1, records, counts, error)
      if (.not. allocated(error)) call refit(kept, layout, nd + 1, records)
      call file%read_scalar("largest_extent_when_listed", least_extent, error)
      call file%read_array("corner_of_orders", 3, 3, corner, error)
      if (.not. allocated(error)) call check_reals(path//": the array corner_of_orders", corner, error)
      if (builds > 0) call file%read_array("boundaries_when_listed", n_boundary, n_boundary, words, error)
      call file%read_array("boundaries", n_boundary, n_boundary, now, error)
      call file%read_array("cell", 2*period_words, 2*period_words, cell, error)
      if (.not. allocated(error)) call check_reals(path//": the array cell", cell, error)
      if (builds > 0 .and. .not. allocated(error)) call check_reals(path//": the array boundaries_when_listed", words, error)
      if (.not. allocated(error)) call check_reals(path//": the array boundaries", now, error)
      if (.not. allocated(error)) call check_grains(simulation, path, records, error)
      call simulation%comm%agree(error)
      if (allocated(error)) return
      n = 0
      do s = 1, size(decomposition%owned)
        call decomposition%owned(s)%init(decomposition%layout(), narrow(counts(s)))
        do k = 1, decomposition%owned(s)%n
          call take_grain(records(1:n_words, n + k), layout%nv > kept%nv, decomposition%shapes, decomposition%owned(s), k)
          ! lists ask for the speed that there was
          decomposition%owned(s)%velocity(:, k) = 0.0_dp
          decomposition%owned(s)%velocity(1, k) = transfer(records(n_words + nd + 1, n + k), 0.0_dp)
        end do
        n = n + decomposition%owned(s)%n
      end do
      if (builds > 0) then
        call unpack_boundaries(words, decomposition%boundaries)
        call decomposition%period%set_state(cell(period_words + 1:))
        do d = 1, size(corner)
          simulation%halo%corner(d) = transfer(corner(d), 0.0_dp)
        end do
        call simulation%halo%build(decomposition, least_extent)
        simulation%halo%builds = builds
        call load_impulses(simulation, file, path, error)
      end if
      n = 0
      do s = 1, size(decomposition%owned)
        do k = 1, decomposition%owned(s)%n
          call take_grain(records(1:n_words, n + k), layout%nv > kept%nv, decomposition%shapes, decomposition%owned(s), k)
          do d = 1, nd
            decomposition%owned(s)%position(d, k) = transfer(records(n_words + d, n + k), 0.0_dp)
          end do
        end do
        n = n + decomposition%owned(s)%n
      end do
      call unpack_boundaries(now, decomposition%boundaries)
      call decomposition%period%set_state(cell(1:period_words))
    end associate
  end subroutine load_grains

  !> Grain `k` of a subdomain, from its record.
  pure subroutine take_grain(record, turns_now, shapes, bodies, k)
    integer(i8), intent(in) :: record(:)
    !> it did not turn before, so that its record has no moment of inertia
    logical, intent(in) :: turns_now
    type(shape_library_t), intent(in) :: shapes
    type(body_set_t), intent(inout) :: bodies
    integer, intent(in) :: k

    call bodies%set_record(k, record)
    if (turns_now) bodies%inertia(k) = shapes%inertia(0, bodies%nd, bodies%radius(k), bodies%mass(k))
  end subroutine take_grain

  !> The layout of the grains of a checkpoint, which may sleep or turn where those of the scene do not, or the other way round.
  subroutine read_layout(simulation, file, path, kept, error)
    type(simulation_t), intent(in) :: simulation
    type(checkpoint_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(body_layout_t), intent(out) :: kept
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: may_sleep, freedoms
    integer :: nd

    kept = simulation%decomposition%layout()
    nd = kept%nd
    call file%read_scalar("may_sleep", may_sleep, error)
    call file%read_scalar("degrees_of_freedom", freedoms, error)
    if (allocated(error)) return
    if (may_sleep < 0 .or. may_sleep > 1) call raise(error, status_input, path// &
      & ": may_sleep: 0 or 1 was expected: the file is damaged")
    if (freedoms /= nd .and. freedoms /= 3*nd - 3) call raise(error, status_input, path//": degrees_of_freedom: "// &
      & to_text(nd)//" or "//to_text(3*nd - 3)//" was expected: the file is damaged")
    if (allocated(error)) return
    if (freedoms > kept%nv) call raise(error, status_input, simulation%config%file//": no grain turns without friction, and "// &
      & "those of "//path//" turn: expected a friction above 0 of some contacts, however small")
    kept%nr = narrow(may_sleep)
    kept%nv = narrow(freedoms)
  end subroutine read_layout

  !> Give records of grains the words of another layout; what follows them stays.
  subroutine refit(kept, layout, more, records)
    type(body_layout_t), intent(in) :: kept, layout
    !> words behind those of a grain
    integer, intent(in) :: more
    !> (words of a grain and more, grains)
    integer(i8), allocatable, intent(inout) :: records(:, :)
    integer(i8), allocatable :: fitted(:, :)
    integer :: k, before, now

    if (kept%nv == layout%nv .and. kept%nr == layout%nr) return
    before = kept%saved_words()
    now = layout%saved_words()
    allocate (fitted(now + more, size(records, 2)))
    do k = 1, size(records, 2)
      call layout%refit(kept, records(1:before, k), fitted(1:now, k))
      fitted(now + 1:, k) = records(before + 1:, k)
    end do
    call move_alloc(fitted, records)
  end subroutine refit

  !> Refuse grains of a file that no scene has. Errors may differ between ranks.
  subroutine check_grains(simulation, path, records, error)
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    !> (words of a grain, its place now and its speed when the lists were made; grains of this rank)
    integer(i8), intent(in), contiguous :: records(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(body_layout_t) :: layout
    character(len=:), allocatable :: field
    integer :: k

    layout = simulation%decomposition%layout()
    do k = 1, size(records, 2)
      field = layout%invalid_field(records(:, k), size(simulation%decomposition%boundaries), size(simulation%config%materials), &
        & simulation%decomposition%shapes%n)
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
    integer(i8) :: n_impulse, n_spring, law_row, touch_row, key_row
    type(pair_memory_t) :: kept
    integer :: s, n

    call file%read_scalar("impulse_entries", n_impulse, error)
    call file%read_scalar("spring_entries", n_spring, error)
    call file%read_scalar("law_row", law_row, error)
    call file%read_scalar("touch_row", touch_row, error)
    call file%read_scalar("key_row", key_row, error)
    call take_count(n_impulse, path//": impulse_entries", kept%n_impulse, error)
    call take_count(n_spring, path//": spring_entries", kept%n_spring, error)
    call take_count(law_row, path//": law_row", kept%law_row, error)
    call take_count(touch_row, path//": touch_row", kept%touch_row, error)
    call take_count(key_row, path//": key_row", kept%key_row, error)
    call file%read_table("impulses", simulation%decomposition%n_subdomains, 2 + kept%words(), records, counts, error)
    if (allocated(error)) return
    n = 0
    do s = 1, size(simulation%halo%view)
      call match_impulses(records(:, n + 1:n + narrow(counts(s))), kept, simulation%halo%view(s))
      n = n + narrow(counts(s))
    end do
  end subroutine load_impulses

end module gravier_checkpoint_tables
