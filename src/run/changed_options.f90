!> What differs between the options of a checkpoint and those of the input file that goes on from it, and which of them may.
module gravier_changed_options
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, text_from, growing_text_t
  implicit none
  private
  public :: compare_options, next_line, group_end, tables_group, files_group, may_change

  character(len=*), parameter :: newline = achar(10)
  !> the last line of a group; groups of the paths of tables in time and of other files, each with what tells its contents apart
  character(len=*), parameter :: group_end = "/", tables_group = "&(tables)", files_group = "&(files)"
  !> begins a line of what differs, as the log has it
  character(len=*), parameter :: label = "changed     "
  !> stands for an option that one of the two does not have
  character(len=*), parameter :: nothing = "(nothing)"
  !> Keys that may change in a run that goes on: loads, drives and coefficients of contact. Nothing that a checkpoint keeps follows
  !> from them. Blanks stand around each.
  character(len=*), parameter :: coefficients = " friction restitution tangential_restitution rolling_friction pivoting_friction "
  character(len=*), parameter :: scene_keys = coefficients//"wall_friction wall_restitution wall_tangential_restitution "// &
    & "wall_rolling_friction wall_pivoting_friction gravity gravity_table gravity_table_repeats body_force cell_strain_rate "// &
    & "cell_shear_rate cell_pressure cell_shear_stress cell_table cell_table_repeats cell_inertia "
  character(len=*), parameter :: boundary_keys = coefficients//"velocity rotation oscillation rotation_oscillation frequency "// &
    & "phase free force pressure mass table table_repeats remove_at "
  !> keys of a law that may not, since bonds and bridges are made at the start; all others are coefficients
  character(len=*), parameter :: fixed_law_keys = " materials kind bond_distance bridge_distance "

  !> The options of a checkpoint and of an input file, and where these are.
  type :: comparison_t
    character(len=:), allocatable :: checkpoint, input
    !> options may differ where `may_change` allows it
    logical :: accepts = .false.
    !> those that do
    type(growing_text_t) :: changes
    !> of the group that is compared among those of its kind in a row
    integer :: number = 0
  end type comparison_t

contains

  !> Compare the options of a checkpoint with those of now, texts of groups with an option a line. Fails (status_input) at the
  !> first one that must not differ; without `accepts` none may.
  subroutine compare_options(checkpoint, before, input, now, accepts, changes, error)
    !> path of the checkpoint, and its options
    character(len=*), intent(in) :: checkpoint, before
    !> path of the input file, and its options
    character(len=*), intent(in) :: input, now
    logical, intent(in) :: accepts
    !> a line for each option that differs: what it is and what it was
    character(len=:), allocatable, intent(out) :: changes
    type(error_t), allocatable, intent(inout) :: error
    type(comparison_t) :: comparison
    character(len=:), allocatable :: group_before, group_now, kind, last
    integer :: at_before, at_now, at

    comparison%checkpoint = checkpoint
    comparison%input = input
    comparison%accepts = accepts
    at_before = 1
    at_now = 1
    last = ""
    do while (at_before <= len(before) .or. at_now <= len(now))
      call next_group(before, at_before, group_before)
      call next_group(now, at_now, group_now)
      at = 1
      call next_line(group_now, at, kind)
      comparison%number = merge(comparison%number + 1, 1, kind == last)
      last = kind
      if (group_before /= group_now) call compare_groups(comparison, group_before, group_now, error)
      if (allocated(error)) exit
    end do
    changes = comparison%changes%get()
  end subroutine compare_options

  !> Compare two groups that stand at the same place.
  subroutine compare_groups(comparison, before, now, error)
    type(comparison_t), intent(inout) :: comparison
    character(len=*), intent(in) :: before, now
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group, was, line
    integer :: at

    at = 1
    call next_line(before, at, was)
    at = 1
    call next_line(now, at, group)
    if (was /= group) call judge_option(comparison, "", "", was, group, error)
    do while (at <= len(now) .and. .not. allocated(error))
      call next_line(now, at, line)
      was = line_of(before, key_of(line))
      if (was /= line) call judge_option(comparison, group, title_of(now, comparison%number), was, line, error)
    end do
    at = 1
    do while (at <= len(before) .and. .not. allocated(error))
      call next_line(before, at, was)
      if (line_of(now, key_of(was)) == nothing) &
        & call judge_option(comparison, group, title_of(now, comparison%number), was, nothing, error)
    end do
  end subroutine compare_groups

  !> Note an option that differs, or refuse it.
  subroutine judge_option(comparison, group, title, was, is, error)
    type(comparison_t), intent(inout) :: comparison
    !> line that begins the group, and what it is called
    character(len=*), intent(in) :: group, title
    !> lines of the option, or nothing
    character(len=*), intent(in) :: was, is
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: key, way

    key = key_of(is)
    if (is == nothing) key = key_of(was)
    if (group == tables_group .or. group == files_group) then
      ! a file that the other one does not have belongs to an option that differs
      if (was == nothing .or. is == nothing) return
      if (may_change(group, key) .and. comparison%accepts) then
        call comparison%changes%add(label//"contents of "//key//newline)
      else
        way = ""
        if (may_change(group, key)) way = ", or gravier --restart --changed"
        call raise(error, status_input, comparison%input//": contents of "//key//" are not those with which "// &
          & comparison%checkpoint//" was written: expected the file as it was then"//way)
      end if
    else if (may_change(group, key) .and. comparison%accepts) then
      call comparison%changes%add(label//title//" "//key//" = "//value_of(is)//", in the place of "// &
        & value_of(was)//newline)
    else
      way = "a new run that begins with a state of this one: its final_bodies.h5, or a file of gravier.write_bodies"
      if (may_change(group, key)) way = "gravier --restart --changed, which goes on with the new value"
      call raise(error, status_input, comparison%input//": the scene is not that of "//comparison%checkpoint//": "// &
        & shown(is, key)//": expected "//shown(was, key)//", or "//way)
    end if
  end subroutine judge_option

  !> Whether a run may go on with another value of a key.
  pure logical function may_change(group, key)
    !> line that begins the group
    character(len=*), intent(in) :: group, key

    select case (group)
    case ("&scene")
      may_change = index(scene_keys, " "//key//" ") > 0
    case ("&boundary")
      may_change = index(boundary_keys, " "//key//" ") > 0
    case ("&law")
      may_change = index(fixed_law_keys, " "//key//" ") == 0
    case default
      may_change = group == tables_group
    end select
  end function may_change

  !> What a group is called: its first line, with the name that it has; boundaries without one are called as in the log.
  function title_of(text, number) result(title)
    character(len=*), intent(in) :: text
    !> of the group among those of its kind
    integer, intent(in) :: number
    character(len=:), allocatable :: title, name
    integer :: at

    at = 1
    call next_line(text, at, title)
    name = line_of(text, "name")
    if (name == nothing) name = line_of(text, "materials")
    if (is_given(name)) then
      title = title//" "//value_of(name)
    else if (title == "&boundary") then
      title = title//" 'boundary "//to_text(number)//"'"
    end if
  end function title_of

  !> The line of a group that has a key, or nothing.
  function line_of(text, key) result(line)
    character(len=*), intent(in) :: text, key
    character(len=:), allocatable :: line
    integer :: at

    at = 1
    do while (at <= len(text))
      call next_line(text, at, line)
      if (key_of(line) == key) return
    end do
    line = nothing
  end function line_of

  !> An option with a key, or the line that begins a group, in a message.
  pure function shown(line, key) result(text)
    character(len=*), intent(in) :: line, key
    character(len=:), allocatable :: text

    text = trim(adjustl(line))
    if (line == tables_group) then
      text = "no further group"
    else if (.not. is_given(line)) then
      text = key//" not given"
    end if
  end function shown

  !> The key of a line `  key = value`, or of `  ! key = where the value comes from`; else the line.
  pure function key_of(line) result(key)
    character(len=*), intent(in) :: line
    character(len=:), allocatable :: key
    integer :: first, equals

    key = line
    equals = index(line, " = ")
    if (equals == 0) return
    first = verify(line, " !")
    key = line(first:equals - 1)
  end function key_of

  !> The value in such a line; `not given` where the program finds it, and where there is no line.
  pure function value_of(line) result(value)
    character(len=*), intent(in) :: line
    character(len=:), allocatable :: value

    value = "not given"
    if (is_given(line)) value = text_from(line, index(line, " = ") + 3)
  end function value_of

  !> Whether there is such a line, and its value is not one that the program finds.
  pure logical function is_given(line)
    character(len=*), intent(in) :: line
    is_given = line /= nothing .and. index(adjustl(line), "!") /= 1
  end function is_given

  !> The group that begins at a place of a text, and the place behind it; nothing at the end.
  pure subroutine next_group(text, at, group)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(out) :: group
    character(len=:), allocatable :: line
    integer :: first

    first = at
    line = ""
    do while (at <= len(text) .and. line /= group_end)
      call next_line(text, at, line)
    end do
    group = nothing
    if (at > first) group = text(first:min(at - 1, len(text)))
  end subroutine next_group

  !> The line that begins at a place of a text, and the place behind it; nothing at the end.
  pure subroutine next_line(text, at, line)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: at
    character(len=:), allocatable, intent(out) :: line
    integer :: length

    if (at > len(text)) then
      line = nothing
      return
    end if
    length = index(text(at:), newline) - 1
    if (length < 0) length = len(text) - at + 1
    line = text(at:at + length - 1)
    at = at + length + 1
  end subroutine next_line

end module gravier_changed_options
