!> Reads an input file: Fortran namelist groups, of which every name and value is checked.
module gravier_config
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_number_text, only: is_integer, read_integer
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_config_types, only: config_t, scene_config_t, time_config_t, solver_config_t, decomposition_config_t, &
                                  enriched_config_t, output_config_t, boundary_config_t, sample_config_t, insertion_config_t, &
                                  material_config_t, law_config_t, region_config_t, given_coefficients_t
  use gravier_config_key, only: kind_integer, kind_real
  use gravier_config_table, only: groups, keys, surface_rows, fill_keys
  use gravier_method_options, only: method_features_t, default_always, default_on_active
  use gravier_method_registry, only: features_of
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics
  use gravier_mean_region, only: unbounded
  use gravier_config_surfaces, only: surface_value
  use gravier_config_keys, only: find_group, find_key, nearest_group, nearest_key, expected_text
  use gravier_config_scan, only: scan_t, assignment_t, scan_groups, excerpt
  use gravier_config_slots, only: slot_t, slot_of, group_count, allocate_groups
  use gravier_config_value, only: read_value, most_entries
  use gravier_config_report, only: report_t, is_given, label
  use gravier_config_check, only: check_dimension, check_config, grid_product
  use gravier_config_write, only: write_active, write_key_reference
  implicit none
  private
  public :: parse_config, write_active, write_key_reference
  public :: config_t, scene_config_t, time_config_t, solver_config_t, decomposition_config_t, enriched_config_t, output_config_t
  public :: boundary_config_t, sample_config_t, insertion_config_t, material_config_t, law_config_t, region_config_t

contains

  !> Reads and checks the text of an input file.
  !> Fails (status_input) with one line that names the file, the group, the key, the value and what was expected.
  subroutine parse_config(file, text, config, error, changes)
    !> path, for messages
    character(len=*), intent(in) :: file
    !> content of the file
    character(len=*), intent(in) :: text
    !> complete when there is no error, defaults included
    type(config_t), target, intent(out) :: config
    type(error_t), allocatable, intent(out) :: error
    !> assignments to groups that stand once at most, in place of those that the text has for the same keys
    type(assignment_t), intent(in), optional :: changes(:)
    type(scan_t) :: found
    type(report_t) :: report
    type(diagnostic_holder_t), allocatable :: diagnostics(:)
    !> groups of each name of the table in the file
    integer :: counts(size(groups)), k

    call fill_keys()
    config%file = file
    config%text = text
    report%file = file
    call scan_groups(file, text, found, error)
    if (present(changes) .and. .not. allocated(error)) call found%change(changes)
    if (.not. allocated(error)) call check_names(file, found, error)
    if (allocated(error)) return
    do k = 1, size(groups)
      counts(k) = number_of_groups(found, groups(k)%name)
    end do
    call allocate_groups(config, counts)
    do k = 1, size(config%boundaries)
      allocate (config%boundaries(k)%value(3, size(surface_rows%keys)), source=0.0_dp)
    end do
    do k = 1, size(config%laws)
      allocate (config%laws(k)%value(count(keys%group == "law" .and. keys%kind == kind_real)))
    end do
    call registered_diagnostics(diagnostics)
    allocate (config%output%diagnostics(size(diagnostics)), source=.false.)
    allocate (report%given(size(keys), max(1, maxval(counts))))
    call set_defaults(config, error)
    call read_first(config, found, report, error)
    if (.not. allocated(error)) call read_others(config, found, report, error)
    if (.not. allocated(error)) call check_owned_groups(config, found, error)
    if (allocated(error)) return
    call apply_defaults(config, report)
    call check_config(config, report, error)
  end subroutine parse_config

  pure integer function number_of_groups(found, name) result(n)
    type(scan_t), intent(in) :: found
    character(len=*), intent(in) :: name
    integer :: i
    n = 0
    do i = 1, found%n_groups
      if (found%groups(i)%name == name) n = n + 1
    end do
  end function number_of_groups

  !> Gives every key of every group the default of the table.
  subroutine set_defaults(config, error)
    !> its boundaries are allocated
    type(config_t), target, intent(inout) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot
    logical :: touched(most_entries), failed
    integer :: k, instance, n

    do k = 1, size(keys)
      ! &sample has defaults where it does not belong
      n = 1
      if (groups(find_group(keys(k)%group))%repeated) n = group_count(config, keys(k)%group)
      do instance = 1, n
        slot = slot_of(config, keys(k), instance)
        if (keys(k)%default == "''") then
          ! no word: a required choice, or an empty text
          if (associated(slot%choice)) slot%choice = ""
          if (associated(slot%text)) slot%text = ""
          if (associated(slot%texts)) slot%texts = ""
          cycle
        end if
        call read_value(keys(k), "", trim(keys(k)%default), slot, touched, failed)
        if (failed) call raise(error, status_input, "table of keys: default of &"//trim(keys(k)%group)//" " &
                               //trim(keys(k)%name)//" = "//trim(keys(k)%default)//": expected "//expected_text(keys(k)))
      end do
    end do
  end subroutine set_defaults

  !> Fails on a group or key that is not in the table, on a group given twice that may stand once, and on a missing group.
  subroutine check_names(file, found, error)
    character(len=*), intent(in) :: file
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    integer :: first(size(groups)), g, i

    ! where each group of the table stands first
    first = 0
    do i = 1, found%n_groups
      g = find_group(found%groups(i)%name)
      if (g == 0) then
        call raise(error, status_input, file//": "//unknown_group(found%groups(i)%name))
      else if (first(g) == 0) then
        first(g) = i
      else if (.not. groups(g)%repeated) then
        call raise(error, status_input, file//": group &"//trim(groups(g)%name)//" is given twice (lines " &
                   //to_text(found%groups(first(g))%line)//" and "//to_text(found%groups(i)%line)//"): expected once")
      end if
    end do
    do i = 1, found%n_assignments
      associate (item => found%assignments(i))
        if (find_key(item%group, item%key) == 0) call raise(error, status_input, file//": "//unknown_key(item))
      end associate
    end do
    do g = 1, size(groups)
      if (groups(g)%required .and. first(g) == 0) &
        call raise(error, status_input, file//": group &"//trim(groups(g)%name)//" is missing: expected &" &
                   //trim(groups(g)%name)//" ... /")
    end do
  end subroutine check_names

  function unknown_group(name) result(message)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: message
    integer :: g, nearest

    message = "unknown group &"//excerpt(name)
    nearest = nearest_group(name)
    if (nearest > 0) then
      message = message//"; did you mean &"//trim(groups(nearest)%name)//"?"
      return
    end if
    message = message//": expected one of"
    do g = 1, size(groups)
      message = message//" &"//trim(groups(g)%name)
    end do
  end function unknown_group

  function unknown_key(item) result(message)
    type(assignment_t), intent(in) :: item
    character(len=:), allocatable :: message
    integer :: k, nearest

    message = "unknown key '"//excerpt(item%key)//"' in &"//trim(item%group)
    do k = 1, size(keys)
      if (keys(k)%name /= item%key) cycle
      message = message//"; it belongs to &"//trim(keys(k)%group)
      return
    end do
    nearest = nearest_key(item%group, item%key)
    if (nearest > 0) then
      message = message//"; did you mean '"//trim(keys(nearest)%name)//"'?"
      return
    end if
    message = message//": expected one of"
    do k = 1, size(keys)
      if (keys(k)%group == item%group) message = message//" "//trim(keys(k)%name)
    end do
  end function unknown_key

  !> Reads what others hang on: the dimension, and sets the defaults that depend on it; the names of boundaries, materials,
  !> insertions and regions, which messages quote.
  subroutine read_first(config, found, report, error)
    type(config_t), target, intent(inout) :: config
    type(scan_t), intent(in) :: found
    type(report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    do i = 1, found%n_assignments
      if (.not. allocated(error) .and. comes_first(found%assignments(i))) &
        call read_assignment(config, found%assignments(i), report, error)
    end do
    if (allocated(error)) return
    call check_dimension(config, report, error)
    if (config%scene%dimension == 2) return
    config%scene%gravity(3) = config%scene%gravity(2)
    config%scene%gravity(2) = 0.0_dp
    config%sample%solid_fraction = 0.2_dp
  end subroutine read_first

  subroutine read_others(config, found, report, error)
    type(config_t), target, intent(inout) :: config
    type(scan_t), intent(in) :: found
    type(report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    do i = 1, found%n_assignments
      if (.not. comes_first(found%assignments(i))) call read_assignment(config, found%assignments(i), report, error)
      if (allocated(error)) return
    end do
  end subroutine read_others

  pure logical function comes_first(item)
    type(assignment_t), intent(in) :: item
    select case (item%group)
    case ("scene"); comes_first = item%key == "dimension"
    case ("boundary", "material", "insertion", "region"); comes_first = item%key == "name"
    case default; comes_first = .false.
    end select
  end function comes_first

  !> Reads one assignment and notes it; fails on a bad value and on an entry that is already given.
  subroutine read_assignment(config, item, report, error)
    type(config_t), target, intent(inout) :: config
    type(assignment_t), intent(in) :: item
    !> its instance is that of the assignment afterwards
    type(report_t), intent(inout) :: report
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot
    character(len=:), allocatable :: shown, place
    logical :: touched(most_entries), failed
    integer :: k

    k = find_key(item%group, item%key)
    report%instance = item%instance
    slot = slot_of(config, keys(k), item%instance)
    shown = item%key//excerpt(item%index)//" = "//excerpt(item%value)
    if (item%value == "") shown = shown//"(nothing)"
    place = config%file//": "//label(report, item%group)//" "//shown//": "
    call read_value(keys(k), item%index, item%value, slot, touched, failed)
    associate (given => report%given(k, item%instance))
      if (failed .and. keys(k)%count == 1 .and. item%index /= "") then
        call raise(error, status_input, place//"expected "//item%key//" without an index")
      else if (failed .and. keys(k)%kind == kind_integer .and. is_too_large(item%value)) then
        call raise(error, status_input, place//"expected "//expected_text(keys(k))//", at most "//to_text(huge(1)))
      else if (failed) then
        call raise(error, status_input, place//"expected "//expected_text(keys(k)))
      else if (any(given%entries .and. touched)) then
        call raise(error, status_input, place//"expected once, but it is given twice, first as "//given%shown)
      end if
      given%entries = given%entries .or. touched
      given%by_index = given%by_index .or. item%index /= ""
      if (allocated(given%shown)) shown = given%shown//", "//shown
      given%shown = shown
      given%value = excerpt(item%value)
    end associate
    if (associated(slot%given)) slot%given = .true.
  end subroutine read_assignment

  !> Whether a text is an integer that no key can have.
  pure logical function is_too_large(text)
    character(len=*), intent(in) :: text
    integer(i8) :: value
    logical :: fits

    call read_integer(text, value, fits)
    is_too_large = is_integer(text) .and. (.not. fits .or. abs(value) > huge(1))
  end function is_too_large

  !> Fails on a group that belongs to other bodies, and on a missing group that the bodies ask for.
  subroutine check_owned_groups(config, found, error)
    type(config_t), intent(in) :: config
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    logical :: is_there
    integer :: g

    do g = 1, size(groups)
      if (groups(g)%bodies == "" .or. config%scene%bodies == "") cycle
      is_there = number_of_groups(found, groups(g)%name) > 0
      if (is_there .and. group_count(config, groups(g)%name) == 0) then
        call raise(error, status_input, config%file//": group &"//trim(groups(g)%name)//" belongs to bodies = '" &
                   //trim(groups(g)%bodies)//"'; expected none where bodies = '"//trim(config%scene%bodies)//"'")
      else if (group_count(config, groups(g)%name) > 0 .and. .not. is_there) then
        call raise(error, status_input, config%file//": group &"//trim(groups(g)%name)//" is missing: expected &" &
                   //trim(groups(g)%name)//" ... /, required by bodies = '"//trim(groups(g)%bodies)//"'")
      end if
    end do
  end subroutine check_owned_groups

  !> Sets the values that hang on others.
  subroutine apply_defaults(config, report)
    type(config_t), intent(inout) :: config
    type(report_t), intent(inout) :: report
    type(given_coefficients_t) :: given
    type(method_features_t) :: features
    integer :: i

    report%instance = 1
    associate (scene => config%scene, parts => config%decomposition, sample => config%sample)
      config%scene%has_density = is_given(report, "scene", "density")
      given%friction = is_given(report, "scene", "wall_friction")
      given%restitution = is_given(report, "scene", "wall_restitution")
      given%tangential_restitution = is_given(report, "scene", "wall_tangential_restitution")
      given%rolling_friction = is_given(report, "scene", "wall_rolling_friction")
      given%pivoting_friction = is_given(report, "scene", "wall_pivoting_friction")
      call apply_contact_defaults(given, scene%contact, scene%wall_contact)
      call fill_third(scene%dimension, scene%lattice_count)
      call fill_third(scene%dimension, parts%grid)
      where (.not. abs(sample%box) > 0.0_dp) sample%box = scene%period
      if (grid_product(parts%grid) > 0 .and. .not. is_given(report, "decomposition", "subdomains")) &
        parts%subdomains = grid_product(parts%grid)
    end associate
    features = features_of(trim(config%solver%method))
    if (features%active_by_default .and. .not. config%enriched%direction_given) then
      if (.not. is_given(report, "enriched", "contacts")) config%enriched%contacts = "active"
    end if
    if (.not. is_given(report, "solver", "acceleration")) then
      if (features%accelerated_by_default == default_always .or. &
          (features%accelerated_by_default == default_on_active .and. config%enriched%contacts == "active")) then
        config%solver%acceleration = "momentum"
      end if
    end if
    if (.not. config%solver%tolerance_given .and. config%solver%criterion == "velocity_error") config%solver%tolerance = 1.0e-2_dp
    if (.not. config%solver%fallback_given .and. config%solver%criterion == "velocity_error") config%solver%fallback = "newton"
    if (.not. config%solver%sleep_speed_given) config%solver%sleep_speed = 100.0_dp*min(config%solver%tolerance, 1.0_dp)
    do i = 1, size(config%materials)
      if (.not. config%materials(i)%density_given) config%materials(i)%density = config%scene%density
    end do
    do i = 1, size(config%boundaries)
      report%instance = i
      call apply_boundary_defaults(config%scene, report, config%boundaries(i))
    end do
    do i = 1, size(config%insertions)
      report%instance = i
      if (.not. is_given(report, "insertion", "name")) config%insertions(i)%name = "insertion "//to_text(i)
    end do
    report%instance = 1
    if (config%scene%dimension == 3) return
    ! no side along an axis that is not there
    do i = 1, size(config%regions)
      if (abs(config%regions(i)%lower(3)) >= unbounded) config%regions(i)%lower(3) = 0.0_dp
      if (abs(config%regions(i)%upper(3)) >= unbounded) config%regions(i)%upper(3) = 0.0_dp
    end do
  end subroutine apply_defaults

  subroutine apply_boundary_defaults(scene, report, boundary)
    type(scene_config_t), intent(in) :: scene
    !> of the instance of the boundary
    type(report_t), intent(in) :: report
    type(boundary_config_t), intent(inout) :: boundary
    real(dp) :: point(3)

    if (.not. is_given(report, "boundary", "name")) boundary%name = "boundary "//to_text(report%instance)
    point = surface_value(boundary, "point")
    where (.not. report%given(find_key("boundary", "pivot"), report%instance)%entries(:3)) boundary%pivot = point
    call apply_contact_defaults(boundary%contact_given, scene%wall_contact, boundary%contact)
    if (.not. boundary%material_given) boundary%material = scene%wall_material
    if (.not. boundary%remove_at_given) boundary%remove_at = huge(boundary%remove_at)
  end subroutine apply_boundary_defaults

  !> Take the coefficients that are not given from others.
  pure subroutine apply_contact_defaults(given, others, contact)
    type(given_coefficients_t), intent(in) :: given
    type(coefficients_t), intent(in) :: others
    type(coefficients_t), intent(inout) :: contact

    if (.not. given%friction) contact%friction = others%friction
    if (.not. given%restitution) contact%restitution = others%restitution
    if (.not. given%tangential_restitution) contact%tangential_restitution = others%tangential_restitution
    if (.not. given%rolling_friction) contact%rolling_friction = others%rolling_friction
    if (.not. given%pivoting_friction) contact%pivoting_friction = others%pivoting_friction
  end subroutine apply_contact_defaults

  !> One layer along the third axis in 2D, when counts are given and this one is not.
  pure subroutine fill_third(dimension, counts)
    integer, intent(in) :: dimension
    !> shape (3)
    integer, intent(inout) :: counts(:)
    if (dimension == 2 .and. any(counts(:2) /= 0) .and. counts(3) == 0) counts(3) = 1
  end subroutine fill_third

end module gravier_config
