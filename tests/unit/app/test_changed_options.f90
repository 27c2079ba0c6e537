!> Which options of an input file may differ from those of a checkpoint, and what is said of them.
program test_changed_options
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_config_table, only: keys, fill_keys
  use gravier_changed_options, only: compare_options, may_change, next_line, group_end, tables_group, files_group
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: nl = achar(10)
  character(len=*), parameter :: scene = "&scene"//nl//"  friction = 0.3"//nl//"  ! wall_friction = the value of `friction`"//nl// &
    & "  radius_min = 1.0"//nl//group_end//nl
  character(len=*), parameter :: lid = "&boundary"//nl//"  name = 'lid'"//nl//"  velocity = 0.0, 0.0, 0.0"//nl//group_end//nl
  character(len=*), parameter :: tables = tables_group//nl//"  a.csv = 17"//nl//group_end//nl
  character(len=*), parameter :: files = files_group//nl//"  a.stl = 5"//nl//group_end//nl
  character(len=*), parameter :: text = scene//lid//tables//files

  call equal_texts()
  call values_that_may_change()
  call values_that_may_not()
  call options_on_one_side()
  call contents_of_files()
  call keys_of_the_table()
  call lines_of_a_text()
  call finish_checks()

contains

  !> Changes and message of a comparison.
  subroutine compare(now, accepts, changes, message)
    character(len=*), intent(in) :: now
    logical, intent(in) :: accepts
    character(len=:), allocatable, intent(out) :: changes, message
    type(error_t), allocatable :: error

    call compare_options("c.h5", text, "a.nml", now, accepts, changes, error)
    message = ""
    if (allocated(error)) message = error%message
  end subroutine compare

  !> The text with other words in the place of some of it.
  function with(old, new) result(now)
    character(len=*), intent(in) :: old, new
    character(len=:), allocatable :: now
    integer :: at

    at = index(text, old)
    now = text(1:at - 1)//new//text(at + len(old):)
  end function with

  subroutine equal_texts()
    character(len=:), allocatable :: changes, message

    call compare(text, .false., changes, message)
    call check(changes == "" .and. message == "", "a case that is as it was")
    call compare(text, .true., changes, message)
    call check(changes == "" .and. message == "", "a case that is as it was where changes are allowed")
  end subroutine equal_texts

  subroutine values_that_may_change()
    character(len=:), allocatable :: changes, message
    type(error_t), allocatable :: error

    call compare(with("friction = 0.3", "friction = 0.5"), .true., changes, message)
    call check(message == "", "a friction may change")
    call check(changes == "changed     &scene friction = 0.5, in the place of 0.3"//nl, "it is told: "//changes)
    call compare(with("friction = 0.3", "friction = 0.5"), .false., changes, message)
    call check(changes == "" .and. message == "a.nml: the scene is not that of c.h5: friction = 0.5: expected friction = 0.3, "// &
      & "or gravier --restart --changed, which goes on with the new value", "only where this is asked for: "//message)
    call compare(with("! wall_friction = the value of `friction`", "wall_friction = 0.1"), .true., changes, message)
    call check(changes == "changed     &scene wall_friction = 0.1, in the place of not given"//nl, &
      & "a key that was not given: "//changes)
    call compare(with("velocity = 0.0, 0.0", "velocity = 1.0, 0.0"), .true., changes, message)
    call check(changes == "changed     &boundary 'lid' velocity = 1.0, 0.0, 0.0, in the place of 0.0, 0.0, 0.0"//nl, &
      & "a boundary is called by its name: "//changes)
    call compare_options("c.h5", nameless("1.0")//nameless("1.0"), "a.nml", nameless("1.0")//nameless("2.0"), .true., changes, &
      & error)
    call check(changes == "changed     &boundary 'boundary 2' phase = 2.0, in the place of 1.0"//nl, "or by its number: "//changes)
  end subroutine values_that_may_change

  !> A boundary that is called by its number.
  function nameless(phase) result(group)
    character(len=*), intent(in) :: phase
    character(len=:), allocatable :: group
    group = "&boundary"//nl//"  ! name = 'boundary K', K its number"//nl//"  phase = "//phase//nl//group_end//nl
  end function nameless

  subroutine values_that_may_not()
    character(len=:), allocatable :: changes, message

    call compare(with("radius_min = 1.0", "radius_min = 2.0"), .true., changes, message)
    call check(message == "a.nml: the scene is not that of c.h5: radius_min = 2.0: expected radius_min = 1.0, or a new run "// &
      & "that begins with a state of this one: its final_bodies.h5, or a file of gravier.write_bodies", "radii stay: "//message)
    call compare(with("'lid'", "'cap'"), .true., changes, message)
    call check(message /= "", "names stay")
    call compare(with(lid, ""), .true., changes, message)
    call check(index(message, "expected &boundary") > 0, "a boundary stays")
    call compare(with(lid, lid//lid), .true., changes, message)
    call check(index(message, "&boundary: expected no further group") > 0, "no boundary is added: "//message)
  end subroutine values_that_may_not

  subroutine options_on_one_side()
    character(len=:), allocatable :: changes, message

    call compare(with("  velocity", "  mass = 2.0"//nl//"  velocity"), .true., changes, message)
    call check(changes == "changed     &boundary 'lid' mass = 2.0, in the place of not given"//nl, &
      & "an option of now alone: "//changes)
    call compare(with("  velocity = 0.0, 0.0, 0.0"//nl, ""), .true., changes, message)
    call check(changes == "changed     &boundary 'lid' velocity = not given, in the place of 0.0, 0.0, 0.0"//nl, &
      & "an option of then alone: "//changes)
    call compare(with("  radius_min = 1.0"//nl, ""), .true., changes, message)
    call check(index(message, "radius_min not given: expected radius_min = 1.0") > 0, "one that may not change: "//message)
    call compare(with("! wall_friction = the value of `friction`", "wall_friction = 0.1"), .false., changes, message)
    call check(index(message, "wall_friction = 0.1: expected wall_friction not given") > 0, "one that was not given: "//message)
  end subroutine options_on_one_side

  subroutine contents_of_files()
    character(len=:), allocatable :: changes, message

    call compare(with("a.csv = 17", "a.csv = 18"), .true., changes, message)
    call check(changes == "changed     contents of a.csv"//nl .and. message == "", "a table may change: "//changes//message)
    call compare(with("a.csv = 17", "a.csv = 18"), .false., changes, message)
    call check(message == "a.nml: contents of a.csv are not those with which c.h5 was written: expected the file "// &
      & "as it was then, or gravier --restart --changed", "where this is asked for: "//message)
    call compare(with("a.stl = 5", "a.stl = 6"), .true., changes, message)
    call check(message == "a.nml: contents of a.stl are not those with which c.h5 was written: expected the file as it was then", &
      & "a mesh stays: "//message)
    call compare(with("  a.csv = 17"//nl, ""), .true., changes, message)
    call check(changes == "" .and. message == "", "the key of a table tells that there is none any more")
  end subroutine contents_of_files

  !> What may change is a key of its group, so that no word of the lists is a misspelt one.
  subroutine keys_of_the_table()
    character(len=*), parameter :: of_scene(*) = [character(len=32) :: "friction", "wall_pivoting_friction", "gravity", &
      & "gravity_table_repeats", "body_force", "cell_strain_rate", "cell_shear_rate", "cell_pressure", "cell_shear_stress", &
      & "cell_table", "cell_table_repeats", "cell_inertia"]
    integer :: k, n(3)

    call fill_keys()
    n(:) = 0
    do k = 1, size(keys)
      if (keys(k)%group == "scene" .and. may_change("&scene", trim(keys(k)%name))) n(1) = n(1) + 1
      if (keys(k)%group == "boundary" .and. may_change("&boundary", trim(keys(k)%name))) n(2) = n(2) + 1
      if (keys(k)%group == "law" .and. .not. may_change("&law", trim(keys(k)%name))) n(3) = n(3) + 1
    end do
    ! as many as the lists of gravier_changed_options have
    call check_equal(n(1), 21, "keys of &scene that may change")
    call check_equal(n(2), 18, "keys of &boundary that may change")
    call check_equal(n(3), 4, "keys of &law that may not")
    do k = 1, size(of_scene)
      call check(may_change("&scene", trim(of_scene(k))), trim(of_scene(k))//" may change")
    end do
    call check(.not. (may_change("&scene", "cell") .or. may_change("&insertion", "rate") .or. &
      & may_change("&boundary", "point") .or. may_change(files_group, "a.stl")), "what may not")
  end subroutine keys_of_the_table

  subroutine lines_of_a_text()
    character(len=:), allocatable :: line
    integer :: at

    at = 1
    call next_line("one"//nl//nl//"three", at, line)
    call check(line == "one", "the first line")
    call next_line("one"//nl//nl//"three", at, line)
    call check(line == "" .and. at == 6, "an empty line, at "//to_text(at))
    call next_line("one"//nl//nl//"three", at, line)
    call check(line == "three", "the last line")
    call next_line("one"//nl//nl//"three", at, line)
    call check(line == "(nothing)", "nothing behind it")
  end subroutine lines_of_a_text

end program test_changed_options
