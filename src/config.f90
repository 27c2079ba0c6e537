!> Reads an input file: Fortran namelist groups, of which every name and value is checked.
module gravier_config
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_config_types, only: config_t, scene_config_t, time_config_t, solver_config_t, decomposition_config_t, &
                                  enriched_config_t, output_config_t
  use gravier_config_keys, only: groups, keys, find_group, find_key, nearest_group, nearest_key, expected_text
  use gravier_config_scan, only: scan_t, assignment_t, scan_groups, excerpt
  use gravier_config_slots, only: slot_t, slot_of
  use gravier_config_value, only: read_value, most_entries
  use gravier_config_check, only: given_t, check_dimension, check_config, grid_product
  use gravier_config_write, only: write_active, write_key_reference
  implicit none
  private
  public :: parse_config, write_active, write_key_reference
  public :: config_t, scene_config_t, time_config_t, solver_config_t, decomposition_config_t, enriched_config_t, output_config_t

contains

  !> Reads and checks the text of an input file.
  !> Fails (status_input) with one line that names the file, the group, the key, the value and what was expected.
  subroutine parse_config(file, text, config, error)
    !> path, for messages
    character(len=*), intent(in) :: file
    !> content of the file
    character(len=*), intent(in) :: text
    !> complete when there is no error, defaults included
    type(config_t), target, intent(out) :: config
    type(error_t), allocatable, intent(out) :: error
    type(scan_t) :: found
    type(given_t) :: given(size(keys))

    config%file = file
    config%text = text
    call set_defaults(config, error)
    call scan_groups(file, text, found, error)
    if (.not. allocated(error)) call check_names(file, found, error)
    if (.not. allocated(error)) call read_dimension(config, found, given, error)
    if (.not. allocated(error)) call read_others(config, found, given, error)
    if (allocated(error)) return
    call settle(config, given)
    call check_config(config, given, error)
  end subroutine parse_config

  !> Gives every key the default of the table.
  subroutine set_defaults(config, error)
    type(config_t), target, intent(inout) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot
    logical :: touched(most_entries), failed
    integer :: k

    do k = 1, size(keys)
      slot = slot_of(config, keys(k))
      if (keys(k)%default == "''") then
        ! no word: a required choice, or an empty text
        if (associated(slot%choice)) slot%choice = ""
        if (associated(slot%text)) slot%text = ""
        cycle
      end if
      call read_value(keys(k), "", trim(keys(k)%default), slot, touched, failed)
      if (failed) call raise(error, status_input, "table of keys: default of &"//trim(keys(k)%group)//" " &
                             //trim(keys(k)%name)//" = "//trim(keys(k)%default)//": expected "//expected_text(keys(k)))
    end do
  end subroutine set_defaults

  !> Fails on a group or key that is not in the table, and on a missing group.
  subroutine check_names(file, found, error)
    character(len=*), intent(in) :: file
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    logical :: present_group(size(groups))
    integer :: g, i

    present_group = .false.
    do i = 1, found%n_groups
      g = find_group(found%groups(i)%name)
      if (g > 0) present_group(g) = .true.
      if (g == 0) call raise(error, status_input, file//": "//unknown_group(found%groups(i)%name))
    end do
    do i = 1, found%n_assignments
      associate (item => found%assignments(i))
        if (find_key(item%group, item%key) == 0) call raise(error, status_input, file//": "//unknown_key(item))
      end associate
    end do
    do g = 1, size(groups)
      if (groups(g)%required .and. .not. present_group(g)) &
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

  !> Reads the dimension, first because the default of gravity hangs on it, and sets that default.
  subroutine read_dimension(config, found, given, error)
    type(config_t), target, intent(inout) :: config
    type(scan_t), intent(in) :: found
    !> shape (number of keys)
    type(given_t), intent(inout) :: given(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    do i = 1, found%n_assignments
      if (is_dimension(found%assignments(i))) call read_assignment(config, found%assignments(i), given, error)
    end do
    if (allocated(error)) return
    call check_dimension(config, given, error)
    if (config%scene%dimension == 2) return
    config%scene%gravity(3) = config%scene%gravity(2)
    config%scene%gravity(2) = 0.0_dp
  end subroutine read_dimension

  subroutine read_others(config, found, given, error)
    type(config_t), target, intent(inout) :: config
    type(scan_t), intent(in) :: found
    !> shape (number of keys)
    type(given_t), intent(inout) :: given(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    do i = 1, found%n_assignments
      if (.not. is_dimension(found%assignments(i))) call read_assignment(config, found%assignments(i), given, error)
      if (allocated(error)) return
    end do
  end subroutine read_others

  pure logical function is_dimension(item)
    type(assignment_t), intent(in) :: item
    is_dimension = item%group == "scene" .and. item%key == "dimension"
  end function is_dimension

  !> Reads one assignment and notes it; fails on a bad value and on an entry that is already given.
  subroutine read_assignment(config, item, given, error)
    type(config_t), target, intent(inout) :: config
    type(assignment_t), intent(in) :: item
    !> shape (number of keys)
    type(given_t), intent(inout) :: given(:)
    type(error_t), allocatable, intent(inout) :: error
    type(slot_t) :: slot
    character(len=:), allocatable :: shown, place
    logical :: touched(most_entries), failed
    integer :: k

    k = find_key(item%group, item%key)
    slot = slot_of(config, keys(k))
    shown = item%key//excerpt(item%index)//" = "//excerpt(item%value)
    if (item%value == "") shown = shown//"(nothing)"
    place = config%file//": &"//item%group//" "//shown//": "
    call read_value(keys(k), item%index, item%value, slot, touched, failed)
    if (failed .and. keys(k)%count == 1 .and. item%index /= "") then
      call raise(error, status_input, place//"expected "//item%key//" without an index")
    else if (failed) then
      call raise(error, status_input, place//"expected "//expected_text(keys(k)))
    else if (any(given(k)%entries .and. touched)) then
      call raise(error, status_input, place//"expected once, but it is given twice, first as "//given(k)%shown)
    end if
    given(k)%entries = given(k)%entries .or. touched
    if (allocated(given(k)%shown)) shown = given(k)%shown//", "//shown
    given(k)%shown = shown
  end subroutine read_assignment

  !> Sets the values that hang on others.
  subroutine settle(config, given)
    type(config_t), intent(inout) :: config
    !> shape (number of keys)
    type(given_t), intent(in) :: given(:)

    associate (scene => config%scene, parts => config%decomposition)
      if (.not. any(given(find_key("scene", "wall_friction"))%entries)) scene%wall_friction = scene%friction
      scene%alert_given = any(given(find_key("scene", "alert_distance"))%entries)
      call fill_third(scene%dimension, scene%lattice_count)
      call fill_third(scene%dimension, parts%grid)
      if (any(given(find_key("decomposition", "subdomains"))%entries)) return
      if (grid_product(parts%grid) > 0) parts%subdomains = grid_product(parts%grid)
    end associate
  end subroutine settle

  !> One layer along the third axis in 2D, when counts are given and this one is not.
  pure subroutine fill_third(dimension, counts)
    integer, intent(in) :: dimension
    !> shape (3)
    integer, intent(inout) :: counts(:)
    if (dimension == 2 .and. any(counts(:2) /= 0) .and. counts(3) == 0) counts(3) = 1
  end subroutine fill_third

end module gravier_config
