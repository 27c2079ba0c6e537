!> Writes the options in force for the log, and the reference of all keys.
module gravier_config_write
  use gravier_kinds, only: dp
  use gravier_text, only: to_text, growing_text_t
  use gravier_number_text, only: read_real
  use gravier_config_types, only: config_t
  use gravier_config_key, only: group_t, key_t, kind_integer, kind_real, kind_logical, kind_choice
  use gravier_config_table, only: groups, keys, fill_keys
  use gravier_config_keys, only: choices_text
  use gravier_config_slots, only: slot_t, slot_of, group_count, belongs
  implicit none
  private
  public :: write_active, write_key_reference

  !> Writes every option in force, one line each, as an input file that says the same.
  interface write_active
    module procedure write_active_unit
    module procedure write_active_text
  end interface write_active

  character(len=*), parameter :: newline = achar(10)

contains

  !> Writes the options in force to a unit.
  subroutine write_active_unit(unit, config)
    !> connected for formatted writing
    integer, intent(in) :: unit
    type(config_t), intent(in) :: config
    call write_lines(unit, active_text(config))
  end subroutine write_active_unit

  !> Gives the options in force as one text, each line ended by a newline.
  subroutine write_active_text(text, config)
    character(len=:), allocatable, intent(out) :: text
    type(config_t), intent(in) :: config
    text = active_text(config)
  end subroutine write_active_text

  !> Writes a text of lines that each end with a newline.
  subroutine write_lines(unit, text)
    integer, intent(in) :: unit
    character(len=*), intent(in) :: text
    integer :: first, length

    first = 1
    do while (first <= len(text))
      length = index(text(first:), newline) - 1
      write (unit, "(a)") text(first:first + length - 1)
      first = first + length + 1
    end do
  end subroutine write_lines

  !> The options in force as one text, each line ended by a newline.
  function active_text(config) result(text)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: text
    !> a copy to point into
    type(config_t), target :: copy
    type(growing_text_t) :: lines
    integer :: g, k, instance

    copy = config
    do g = 1, size(groups)
      do instance = 1, group_count(config, groups(g)%name)
        call lines%add("&"//trim(groups(g)%name)//newline)
        do k = 1, size(keys)
          if (keys(k)%group == groups(g)%name) call lines%add(active_line(copy, keys(k), instance))
        end do
        call lines%add("/"//newline)
      end do
    end do
    text = lines%get()
  end function active_text

  !> The line of one option with its newline, a comment where the program finds the value; empty for an option that does
  !> not count.
  function active_line(config, key, instance) result(line)
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    !> which of the groups of that name
    integer, intent(in) :: instance
    character(len=:), allocatable :: line
    type(slot_t) :: slot

    line = ""
    if (.not. in_force(config, key, instance)) return
    slot = slot_of(config, key, instance)
    line = "  "//trim(key%name)//" = "//value_text(key, slot)//newline
    if (.not. associated(slot%given)) return
    if (.not. slot%given) line = "  ! "//trim(key%name)//" = "//trim(key%note)//newline
  end function active_line

  !> Does an option count as its group stands? One that does not would be refused in the file.
  logical function in_force(config, key, instance)
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    !> which of the groups of that name
    integer, intent(in) :: instance
    type(slot_t) :: slot

    in_force = belongs(config, key, instance)
    if (key%group == "boundary" .and. key%name == "mass") in_force = any(config%boundaries(instance)%free)
    if (key%group == "scene" .and. key%name == "gravity") in_force = config%scene%gravity_table == ""
    if (key%group == "sample" .and. key%name == "solid_fraction") &
      in_force = in_force .and. config%sample%box(config%scene%dimension) <= 0.0_dp
    if (all([character(len=15) :: "grain_shapes", "grain_shares", "grain_materials", "material_shares", &
      & "tracked_bodies"] /= key%name)) return
    slot = slot_of(config, key, instance)
    if (associated(slot%text)) in_force = slot%text /= ""
    if (associated(slot%reals)) in_force = any(slot%reals > 0.0_dp)
    if (associated(slot%integers)) in_force = any(slot%integers > 0)
  end function in_force

  !> The value of a key as it would be typed after the equal sign; reading it back gives the same value.
  function value_text(key, slot) result(text)
    type(key_t), intent(in) :: key
    type(slot_t), intent(in) :: slot
    character(len=:), allocatable :: text
    integer :: i

    text = ""
    select case (key%kind)
    case (kind_integer)
      if (key%count == 1) text = to_text(slot%integer)
      if (key%count > 1) text = to_text(slot%integers(1))
      do i = 2, key%count
        text = text//", "//to_text(slot%integers(i))
      end do
    case (kind_real)
      if (key%count == 1) text = shortest(slot%real)
      if (key%count > 1) text = shortest(slot%reals(1))
      do i = 2, key%count
        text = text//", "//shortest(slot%reals(i))
      end do
    case (kind_logical)
      if (key%count == 1) text = logical_text(slot%logical)
      if (key%count > 1) text = logical_text(slot%logicals(1))
      do i = 2, key%count
        text = text//", "//logical_text(slot%logicals(i))
      end do
    case (kind_choice)
      text = "'"//trim(slot%choice)//"'"
    case default
      if (key%count == 1) text = quoted(trim(slot%text))
      if (key%count > 1) text = quoted(trim(slot%texts(1)))
      do i = 2, key%count
        if (slot%texts(i) /= "") text = text//", "//quoted(trim(slot%texts(i)))
      end do
    end select
  end function value_text

  pure function logical_text(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    text = trim(merge(".true. ", ".false.", value))
  end function logical_text

  !> The text in single quotes, those within it doubled.
  pure function quoted(text) result(literal)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: literal
    integer :: i
    literal = "'"
    do i = 1, len(text)
      literal = literal//text(i:i)
      if (text(i:i) == "'") literal = literal//"'"
    end do
    literal = literal//"'"
  end function quoted

  !> The fewest digits that give the value again.
  function shortest(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    real(dp) :: back
    integer :: n, size

    do n = 1, 17
      text = to_text(value, n)
      call read_real(text, back, size)
      if (.not. abs(back - value) > 0.0_dp) exit
    end do
    text = plain(text)
  end function shortest

  !> `-1.5E-001` as `-0.15`, `1.E+009` as `1.0E9`.
  pure function plain(scientific) result(text)
    !> one digit before the point, an exponent with its sign
    character(len=*), intent(in) :: scientific
    character(len=:), allocatable :: text
    character(len=:), allocatable :: figures
    integer :: first, n, exponent

    first = verify(scientific, "-")
    n = index(scientific, "E")
    figures = scientific(first:first)//scientific(first + 2:n - 1)
    read (scientific(n + 1:), *) exponent
    n = len(figures)
    if (exponent < -3 .or. exponent > 5) then
      if (n == 1) figures = figures//"0"
      text = figures(1:1)//"."//figures(2:)//"E"//to_text(exponent)
    else if (exponent < 0) then
      text = "0."//repeat("0", -exponent - 1)//figures
    else if (exponent >= n - 1) then
      text = figures//repeat("0", exponent - n + 1)//".0"
    else
      text = figures(:exponent + 1)//"."//figures(exponent + 2:)
    end if
    if (first > 1) text = "-"//text
  end function plain

  !> Writes the reference of all groups and keys in Markdown; doc/keys.md is this text.
  subroutine write_key_reference(unit)
    !> connected for formatted writing
    integer, intent(in) :: unit
    integer :: g, k

    call fill_keys()
    call write_lines(unit, preface())
    do g = 1, size(groups)
      call write_lines(unit, group_heading(groups(g)))
      do k = 1, size(keys)
        if (keys(k)%group == groups(g)%name) write (unit, "(a)") key_row(keys(k))
      end do
    end do
  end subroutine write_key_reference

  pure function preface() result(text)
    character(len=:), allocatable :: text
    text = "# Input groups and keys"//newline//newline &
           //"<!-- written by write_key_reference (src/input/config_write.f90); a test compares the two -->"//newline//newline &
           //"An input file is a text of Fortran namelist groups, `&name key = value ... /`, in any order."//newline &
           //"Units are SI. Names and words may be in any case; texts and words stand in quotes; `!` starts a comment."//newline &
           //"A list takes blanks or commas between its entries, `2*0.5` for `0.5, 0.5`, and `grid(2) = 4` for one entry." &
           //newline &
           //"A group or a key that is not on this page is refused, and so is one that is given twice;"//newline &
           //"`&boundary`, `&insertion`, `&material`, `&law` and `&region` may stand any number of times."//newline//newline &
           //"The shortest input:"//newline//newline &
           //"    &scene bodies = 'column' /"//newline &
           //"    &time  step = 0.01, steps = 10 /"//newline
  end function preface

  pure function group_heading(group) result(text)
    type(group_t), intent(in) :: group
    character(len=:), allocatable :: text
    text = newline//"## &"//trim(group%name)//newline//newline//trim(group%meaning)
    if (group%required) then
      text = text//" Required."
    else if (group%bodies /= "") then
      text = text//" Required with `bodies = '"//trim(group%bodies)//"'` of `&scene`, and only there."
    else if (group%repeated) then
      text = text//" May be absent, or stand any number of times."
    else
      text = text//" May be absent."
    end if
    text = text//newline//newline//"| key | value | unit | default | meaning |"//newline &
           //"|---|---|---|---|---|"//newline
  end function group_heading

  !> The row of a key in the table of its group.
  pure function key_row(key) result(row)
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: row

    row = "| `"//trim(key%name)//"` | "//kind_text_of(key)//" | "//trim(key%unit)//" | "
    if (key%note /= "") then
      row = row//trim(key%note)
    else
      row = row//"`"//trim(key%default)//"`"
    end if
    row = row//" | "//trim(key%meaning)
    if (key%chooser /= "") row = row//" (only with `"//trim(key%chooser)//"` = "//choices_text(key%chosen)//")"
    row = row//" |"
  end function key_row

  !> The kind, the number of entries and the allowed values.
  pure function kind_text_of(key) result(text)
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text

    select case (key%kind)
    case (kind_integer)
      text = "integer"
    case (kind_real)
      text = "real"
    case (kind_logical)
      text = "logical"
    case (kind_choice)
      text = choices_text(key%allowed)
      return
    case default
      text = "text"
    end select
    if (key%count > 1) text = "up to "//to_text(key%count)//" "//text//"s"
    if (key%kind == kind_integer .or. key%kind == kind_real) then
      if (key%allowed /= "") text = text//" "//trim(key%allowed)
    else if (key%allowed /= "") then
      text = text//", "//trim(key%allowed)
    end if
  end function kind_text_of

end module gravier_config_write
