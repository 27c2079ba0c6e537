!> Parts of files of bodies and shapes: checks of numbers, turns and sizes, shapes in HDF5, statements of libraries and the corners
!> that their words stand for; and what bodies of any shape weigh and how they turn.
program test_bodies_file_parts
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls
  use gravier_bodies_checks, only: check_ids, check_own_ids, check_numbers, check_own_numbers, check_whole, check_box, &
    & refuse_bad_numbers, direction, quantity, extent
  use gravier_bodies_shapes, only: read_body_shapes, write_body_shapes
  use gravier_hdf5_file, only: h5_file_t
  use gravier_csv_table, only: csv_table_t
  use gravier_bodies_cells, only: read_id, read_number, read_positive, read_quantities, expect_nothing
  use gravier_body_turn, only: settle_turn, settle_radius, take_principal_axes, is_fine_turn
  use gravier_quaternion, only: multiply_quaternions
  use gravier_shape_library, only: shape_library_t
  use gravier_shapes_file, only: parse_shapes
  use gravier_shapes_text, only: statement_t, split_statements, check_count, refuse_statement
  use gravier_shapes_words, only: is_generated, generate_corners
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_body_figures, only: body_figures_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a")
  real(dp), parameter :: pi = acos(-1.0_dp), tight = 1.0e-13_dp
  type(communicator_t) :: comm

  call start_parallel()
  call comm%init()
  call test_ids()
  call test_cells()
  call test_numbers()
  call test_box()
  call test_refusals()
  call test_turns()
  call test_radii()
  call test_there_and_back(2)
  call test_there_and_back(3)
  call test_statements()
  call test_bad_statements()
  call test_words()
  call test_bad_words()
  call test_figures()
  call test_figures_in_space()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A path for files of this test.
  function scratch(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    character(len=1000) :: directory
    integer :: length, stat

    call get_environment_variable("GRAVIER_TEST_DIR", directory, length, stat)
    path = name
    if (stat == 0 .and. length > 0) path = directory(1:length)//"/"//name
  end function scratch

  !> An error of input with a part of its message, which is taken away; no error where the part is empty.
  subroutine expect(error, part, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part, name

    if (.not. allocated(error)) then
      call check(len(part) == 0, name//": an error")
      return
    end if
    call check(len(part) > 0, name//": "//error%message)
    call check_equal(error%status, status_input, name//": its status")
    call check(index(error%message, part) > 0, name//": '"//part//"' in: "//error%message)
    deallocate (error)
  end subroutine expect

  subroutine test_ids()
    type(error_t), allocatable :: error
    integer(i8), parameter :: good(3) = [1_i8, 7_i8, 4000000000_i8], bad(3) = [5_i8, 1_i8, 0_i8]

    call check_own_ids("here", 10_i8, good, error)
    call expect(error, "", "ids from 1")
    call check_own_ids("here", 10_i8, bad, error)
    call expect(error, "here: row 12 (counted from 0): 0, but an id >= 1", "an id of 0")
    call check_ids(comm, "here", 0_i8, good, error)
    call expect(error, "", "ids on all ranks")
    call check_ids(comm, "here", 0_i8, bad, error)
    call expect(error, "here: row 2", "a bad id on all ranks")
    call check_own_ids("here", 0_i8, [10_i8**18 - 1], error)
    call expect(error, "", "an id of 18 digits")
    call check_own_ids("here", 0_i8, [10_i8**18], error)
    call expect(error, "here: row 0 (counted from 0): 1000000000000000000, but an id of at most 18 digits", "an id of 19 digits")
    call check_whole(comm, "file", "group", 0, good, good - 1, error)
    call expect(error, "id 4000000000: 3999999999, but a group from 0 to 2147483647", "a number that is too large")
    call check_whole(comm, "file", "material", 1, good(1:2), good(1:2), error)
    call expect(error, "", "numbers from the least one")
    call check_whole(comm, "file", "material", 1, good, bad, error)
    call expect(error, "file: /bodies/material: id 4000000000: 0, but a material from 1", "a number below the least one")
  end subroutine test_ids

  !> Cells of a row with their ranges; those without a meaning are empty or 0.
  subroutine test_cells()
    type(csv_table_t) :: table
    type(error_t), allocatable :: error
    real(dp) :: value, pair(2)
    integer(i8) :: id
    integer :: unit, number
    logical :: found

    open (newunit=unit, file=scratch("cells.csv"), action="write", status="replace")
    write (unit, "(a)") "a,b,c,d,e", "5,-1,0,,1e31"
    close (unit)
    call table%open(scratch("cells.csv"), error)
    call table%next_row(found, error)
    call expect(error, "", "a row")
    call read_id(table, 1, id, error)
    call check(id == 5 .and. .not. allocated(error), "an id")
    call read_id(table, 3, id, error)
    call expect(error, 'column c: "0", but an id >= 1', "an id of 0")
    call read_number(table, 4, "a material", 1, number, error)
    call check(number == 1 .and. .not. allocated(error), "an empty number is the least")
    call read_number(table, 2, "a group", 0, number, error)
    call expect(error, 'column b: "-1", but a group from 0', "a number below the least")
    call read_positive(table, 1, "a mass > 0", value, error)
    call check_close(value, 5.0_dp, 0.0_dp, "a mass")
    call read_positive(table, 3, "a mass > 0", value, error)
    call expect(error, 'column c: "0", but a mass > 0', "a mass of 0")
    pair(:) = 0.0_dp
    call read_quantities(table, [2, 4], .false., pair, error)
    call check_close(pair(1), -1.0_dp, 0.0_dp, "a quantity beside an empty cell")
    call read_quantities(table, [1, 5], .true., pair, error)
    call expect(error, 'column e: "1e31", but', "a quantity that is too large")
    call expect_nothing(table, [3, 4, 0], "a stone", error)
    call expect(error, "", "0, an empty cell, and a column that is not there")
    call expect_nothing(table, [3, 2], "a stone", error)
    call expect(error, 'line 2: column b: "-1", but an empty cell or 0 in the row of a stone', "a cell without meaning")
    call table%close()
  end subroutine test_cells

  subroutine test_numbers()
    real(dp) :: nan, infinity

    nan = ieee_value(nan, ieee_quiet_nan)
    infinity = ieee_value(infinity, ieee_positive_inf)
    call check_number(1.0_dp, direction, "", "a direction")
    call check_number(1.0e200_dp, direction, "", "a long direction")
    call check_number(nan, direction, "NaN or infinity", "no number")
    call check_number(infinity, quantity, "NaN or infinity", "infinity")
    call check_number(-1.0e30_dp, quantity, "", "a quantity")
    call check_number(1.0e31_dp, quantity, "was expected", "a quantity that is too large")
    call check_number(1.0e-30_dp, extent, "", "a small extent")
    call check_number(0.0_dp, extent, "but a number > 0", "an extent of 0")
    call check_number(-1.0_dp, extent, "but a number > 0", "an extent below 0")
    call check_number(1.0e-31_dp, extent, "was expected", "an extent that is too small")
  end subroutine test_numbers

  !> Check three numbers of two bodies, the last of which is a given one.
  subroutine check_number(value, kind, part, name)
    real(dp), intent(in) :: value
    integer, intent(in) :: kind
    character(len=*), intent(in) :: part, name
    integer(i8), parameter :: id(2) = [3_i8, 8_i8]
    type(error_t), allocatable :: error
    real(dp) :: values(3, 2)

    values(:, :) = 1.0_dp
    values(3, 2) = value
    call check_own_numbers("here", 3, id, values, kind, error)
    if (allocated(error)) call check(index(error%message, "here: id 8: ") == 1, name//": names place and id")
    call expect(error, part, name)
    call check_numbers(comm, "here", 3, id, values, kind, error)
    call expect(error, part, name//", on all ranks")
  end subroutine check_number

  subroutine test_box()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    bodies%origin(1) = -3.0_dp
    bodies%period(2) = 2.0_dp
    call check_box("file", bodies, error)
    call expect(error, "", "a box")
    bodies%period(1) = -2.0_dp
    call check_box("file", bodies, error)
    call expect(error, "file: /box/period: -2", "a negative period")
    bodies%period(1) = ieee_value(1.0_dp, ieee_positive_inf)
    call check_box("file", bodies, error)
    call expect(error, "/box/period: NaN or infinity", "an infinite period")
    bodies%period(1) = 1.0e31_dp
    call check_box("file", bodies, error)
    call expect(error, "/box/period: ", "a period that is too large")
    bodies%period(1) = 0.0_dp
    bodies%origin(3) = -1.0e31_dp
    call check_box("file", bodies, error)
    call expect(error, "/box/origin: ", "an origin too far away")
    bodies%origin(3) = ieee_value(1.0_dp, ieee_quiet_nan)
    call check_box("file", bodies, error)
    call expect(error, "/box/origin: NaN or infinity", "an origin that is no number")
  end subroutine test_box

  !> Two bodies and a wall.
  subroutine make_bodies(dimension, bodies)
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(out) :: bodies
    type(error_t), allocatable :: error

    call allocate_bodies(bodies, dimension, 3, .false., "bodies", error)
    call allocate_shapes(bodies, "bodies", error)
    call allocate_walls(bodies, dimension, 1, "walls", error)
    call check(.not. allocated(error), "room for bodies")
    bodies%total = 3
    bodies%id(:) = [11_i8, 12_i8, 15_i8]
    bodies%position(:, :) = 0.5_dp
    bodies%radius(:) = 1.0_dp
    bodies%wall_id(:) = 1
    bodies%wall_point(:, :) = 0.0_dp
    bodies%wall_normal(:, :) = 1.0_dp
  end subroutine make_bodies

  !> What would not be read is not written: the failure is one of the program.
  subroutine test_refusals()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call make_bodies(3, bodies)
    call refuse_bad_numbers(comm, "file", bodies, error)
    call expect(error, "", "bodies that may be written")
    bodies%radius(2) = 0.0_dp
    call refuse_bad_numbers(comm, "file", bodies, error)
    call check(allocated(error), "a body without a radius")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_failure, "is a failure")
    call check(index(error%message, "file: /bodies/radius: id 12: ") == 1, "it is named: "//error%message)
    deallocate (error)
    bodies%radius(2) = 1.0_dp
    bodies%wall_id(1) = 0
    call refuse_bad_numbers(comm, "file", bodies, error)
    call check(allocated(error), "a wall without an id")
    if (allocated(error)) call check(index(error%message, "/walls/id: row 0") > 0, "it is named: "//error%message)
  end subroutine test_refusals

  subroutine test_turns()
    real(dp), parameter :: quarter(4) = [sqrt(0.5_dp), 0.0_dp, 0.0_dp, sqrt(0.5_dp)], none(4) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
    real(dp) :: turn(4), before(4), expected(4), angle(1)
    logical :: possible

    turn(:) = [0.0_dp, 3.0_dp, 0.0_dp, -4.0_dp]
    call settle_turn(turn, possible)
    call check(possible, "a quaternion of length 5")
    call check_close(turn(2), 0.6_dp, tight, "is made a unit one")
    call check_close(turn(4), -0.8_dp, tight, "with its signs")
    before(:) = turn
    turn(2) = turn(2)*(1.0_dp + 2.0e-13_dp)
    before(2) = turn(2)
    call settle_turn(turn, possible)
    call check_close(maxval(abs(turn - before)), 0.0_dp, 0.0_dp, "one of length 1 but for rounding is left as it is")
    turn(:) = 0.0_dp
    call settle_turn(turn, possible)
    call check(.not. possible, "the quaternion 0 is no turn")
    angle(1) = 7.5_dp
    call settle_turn(angle, possible)
    call check(possible, "any angle is a turn")
    call check_close(angle(1), 7.5_dp, 0.0_dp, "and left as it is")
    call check(is_fine_turn(angle) .and. is_fine_turn([-1.0e8_dp]), "angles with their digits")
    call check(.not. is_fine_turn([1.0001e8_dp]), "an angle without its digits")
    call check(is_fine_turn(1.0e20_dp*quarter), "quaternions of any length have their digits")
    call take_principal_axes(quarter, angle)
    call check_close(angle(1), 7.5_dp, 0.0_dp, "as are angles by turns of axes")
    turn(:) = quarter
    call take_principal_axes(none, turn)
    call check_close(maxval(abs(turn - quarter)), 0.0_dp, 0.0_dp, "a shape in its own axes leaves turns as they are")
    call take_principal_axes(quarter, turn)
    call check_close(abs(turn(4)), 1.0_dp, tight, "two quarter turns are half a turn")
    turn(:) = [0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp]
    before(:) = turn
    call multiply_quaternions(before, quarter, expected)
    call take_principal_axes(quarter, turn)
    call check_close(maxval(abs(turn - expected)), 0.0_dp, tight, "the turn of the shape comes first")
  end subroutine test_turns

  subroutine test_radii()
    real(dp) :: radius
    logical :: agrees

    radius = 0.0_dp
    call settle_radius(5.0_dp, 0.5_dp, .true., radius, agrees)
    call check(agrees, "a scale without a radius")
    call check_close(radius, 2.5_dp, 0.0_dp, "makes one")
    radius = 7.0_dp
    call settle_radius(5.0_dp, 1.0_dp, .false., radius, agrees)
    call check(agrees, "a radius without a scale")
    call check_close(radius, 7.0_dp, 0.0_dp, "is kept")
    radius = 2.5_dp*(1.0_dp + 0.5e-9_dp)
    call settle_radius(5.0_dp, 0.5_dp, .true., radius, agrees)
    call check(agrees, "both, and they agree")
    radius = 2.5_dp*(1.0_dp + 2.0e-9_dp)
    call settle_radius(5.0_dp, 0.5_dp, .true., radius, agrees)
    call check(.not. agrees, "both, and they do not agree")
  end subroutine test_radii

  subroutine make_library(dimension, shapes)
    integer, intent(in) :: dimension
    type(shape_library_t), intent(out) :: shapes
    type(error_t), allocatable :: error

    if (dimension == 2) then
      call parse_shapes("a.shapes", "shape box"//lf//"polygon -1 -1 1 -1 1 1 -1 1"//lf//"shape coin"//lf//"disk 0 0 0.5", 2, &
        & shapes, error)
    else
      call parse_shapes("a.shapes", "shape box"//lf//"box 1 2 3"//lf//"shape rod"//lf//"capsule -1 0 0 1 0 0 0.5", 3, &
        & shapes, error)
    end if
    if (allocated(error)) call check(.false., error%message)
    call check_equal(shapes%n, 2, "a library")
  end subroutine make_library

  !> Shapes, sizes and turns come back from a file; names that the scene does not have are refused.
  subroutine test_there_and_back(dimension)
    integer, intent(in) :: dimension
    type(shape_library_t) :: shapes, others
    type(bodies_data_t) :: bodies, found
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: path

    path = scratch("bodies_file_parts.h5")
    call make_library(dimension, shapes)
    call make_bodies(dimension, bodies)
    bodies%shape(:) = [2, 0, 1]
    bodies%radius(:) = [3.0_dp, 0.25_dp, 1.5_dp]
    bodies%orientation(1, 2) = 0.6_dp
    if (dimension == 3) bodies%orientation(3, 2) = -0.8_dp
    call file%create(comm, path, error)
    call file%make_group("/bodies", error)
    call write_body_shapes(file, bodies, shapes, error)
    call file%close(error)
    call expect(error, "", "shapes are written")
    call file%open(comm, path, error)
    call make_bodies(dimension, found)
    found%radius(:) = [0.0_dp, 0.25_dp, 1.5_dp]
    call read_body_shapes(comm, file, path, 0_i8, shapes, found, error)
    call expect(error, "", "shapes are read")
    call check(all(found%shape == bodies%shape), "shapes come back")
    call check_close(maxval(abs(found%radius - bodies%radius)), 0.0_dp, tight, "sizes come back")
    call check_close(maxval(abs(found%orientation - bodies%orientation)), 0.0_dp, 0.0_dp, "turns come back to the bit")
    call make_bodies(dimension, found)
    found%radius(:) = 1.25_dp
    call read_body_shapes(comm, file, path, 0_i8, shapes, found, error)
    call expect(error, "/bodies/radius: id 11: 1.25000000E+00, but 0, or the radius", "a radius that is not that of the scale")
    call parse_shapes("b.shapes", "shape box"//lf//merge("disk 0 0 1    ", "sphere 0 0 0 1", dimension == 2), dimension, others, &
      & error)
    call make_bodies(dimension, found)
    call read_body_shapes(comm, file, path, 0_i8, others, found, error)
    call check(allocated(error), "a shape that the scene does not have")
    if (allocated(error)) deallocate (error)
    call file%close(error)
  end subroutine test_there_and_back

  !> Words, names, numbers over several lines, comments.
  subroutine test_statements()
    type(statement_t), allocatable :: found(:)
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text

    text = "# a library"//lf//lf//"shape  flat stone  # the first"//lf//achar(9)//"hull 1 2 3"//achar(13)//lf//"  4 -5e-1 6"//lf// &
      & "# between"//lf//"7 8 9"//lf//"rounding 0.25"//lf//"file stones/a b.obj"
    call split_statements("a.shapes", text, 3, found, error)
    call expect(error, "", "a text of statements")
    call check_equal(size(found), 4, "four statements")
    if (size(found) /= 4) return
    call check_equal(found(1)%word, "shape", "the word of the first")
    call check_equal(found(1)%text, "flat stone", "its name, without blanks around")
    call check_equal(found(1)%line, 3, "its line")
    call check_equal(size(found(1)%number), 0, "it has no numbers")
    call check_equal(found(2)%word, "hull", "the word of the second")
    call check_equal(size(found(2)%number), 9, "its numbers go over several lines")
    call check_close(found(2)%number(5), -0.5_dp, 0.0_dp, "one of them")
    call check_close(found(2)%number(9), 9.0_dp, 0.0_dp, "the last of them")
    call check_close(found(3)%number(1), 0.25_dp, 0.0_dp, "the number of the third")
    call check_equal(found(3)%line, 8, "its line")
    call check_equal(found(4)%text, "stones/a b.obj", "a path with a blank")
    call check_count("a.shapes", found(3), .true., "one number", error)
    call expect(error, "", "as many numbers as there should be")
    call check_count("a.shapes", found(3), .false., "two numbers", error)
    call expect(error, "a.shapes: line 8: rounding with 1 numbers: expected two numbers", "fewer of them")
    call refuse_statement("a.shapes", found(1), "why not", error)
    call expect(error, "a.shapes: line 3: why not", "a statement refused")
    text = ""
    call split_statements("a.shapes", char(239)//char(187)//char(191)//text, 2, found, error)
    call check_equal(size(found), 0, "nothing but a mark has no statements")
    ! more statements and numbers than there is room for at first
    call split_statements("a.shapes", repeat("disk 1 2 3"//lf, 40)//"polygon"//repeat(" 7", 100), 2, found, error)
    call check_equal(size(found), 41, "many statements")
    call check_equal(size(found(41)%number), 100, "many numbers")
    call check_close(sum(found(41)%number) + sum(found(40)%number), 706.0_dp, 0.0_dp, "none of which is lost")
  end subroutine test_statements

  subroutine refuse_text(text, dimension, part)
    character(len=*), intent(in) :: text, part
    integer, intent(in) :: dimension
    type(statement_t), allocatable :: found(:)
    type(error_t), allocatable :: error

    call split_statements("a.shapes", text, dimension, found, error)
    call expect(error, part, text)
  end subroutine refuse_text

  subroutine test_bad_statements()
    call refuse_text("1 2 3", 2, 'a.shapes: line 1: "1": expected shape and a name before any number')
    call refuse_text("shape a"//lf//"1", 2, 'line 2: "1": expected shape, rounding, polygon')
    call refuse_text("shape a"//lf//lf//"ellipse 1 2", 2, 'line 3: "ellipse": expected shape')
    call refuse_text("sphere 0 0 0 1", 2, '"sphere": expected')
    call refuse_text("polygon 0 0", 3, '"polygon": expected')
    call refuse_text("disk 0 x 1", 2, 'line 1: "x": expected a finite number')
    call refuse_text("disk 0 1e31 1", 2, 'line 1: "1e31": expected ')
    call refuse_text("disk 0 1e999 1", 2, 'line 1: "1e999": expected ')
  end subroutine test_bad_statements

  !> The corners of the only statement of a text.
  subroutine generate(text, dimension, corner, error)
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension
    real(dp), allocatable, intent(out) :: corner(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(statement_t), allocatable :: found(:)

    call split_statements("a.shapes", text, dimension, found, error)
    call check_equal(size(found), 1, text)
    if (size(found) == 1) call generate_corners("a.shapes", found(1), dimension, corner, error)
  end subroutine generate

  subroutine test_words()
    type(error_t), allocatable :: error
    real(dp), allocatable :: corner(:, :), moved(:, :)
    integer :: k

    call check(is_generated("regular") .and. is_generated("random_hull") .and. is_generated("icosahedron"), "words of corners")
    call check(.not. (is_generated("hull") .or. is_generated("box") .or. is_generated("")), "other words")
    call generate("regular 4 2", 2, corner, error)
    call expect(error, "", "a square")
    call check(all(shape(corner) == [2, 4]), "has four corners")
    call check_close(maxval(abs(abs(corner) - sqrt(2.0_dp))), 0.0_dp, tight, "at the same distances")
    call generate("regular 4 2 10 -20", 2, moved, error)
    call expect(error, "", "a square elsewhere")
    do k = 1, 4
      call check_close(moved(1, k) - corner(1, k), 10.0_dp, tight, "is moved along the first axis")
      call check_close(moved(2, k) - corner(2, k), -20.0_dp, tight, "and the second")
    end do
    call generate("cube 3", 3, corner, error)
    call expect(error, "", "a cube")
    call check(all(shape(corner) == [3, 8]), "has eight corners")
    call check_close(maxval(abs(abs(corner) - sqrt(3.0_dp))), 0.0_dp, tight, "a cube: its corners")
    call generate("tetrahedron 1 0 0 5", 3, corner, error)
    call check_close(sum(corner(3, :)), 20.0_dp, tight, "a tetrahedron elsewhere")
    call generate("random_hull 3 20 1 2 3", 3, corner, error)
    call expect(error, "", "a random stone")
    call check(all(shape(corner) == [3, 20]), "has the corners asked for")
    call check_close(maxval((corner(1, :))**2 + (corner(2, :)/2)**2 + (corner(3, :)/3)**2), 1.0_dp, tight, "on an ellipsoid")
    call generate("random_hull 3 7 1 2", 2, corner, error)
    call check(all(shape(corner) == [2, 7]), "a random polygon")
  end subroutine test_words

  subroutine refuse_words(text, dimension, part)
    character(len=*), intent(in) :: text, part
    integer, intent(in) :: dimension
    real(dp), allocatable :: corner(:, :)
    type(error_t), allocatable :: error

    call generate(text, dimension, corner, error)
    call expect(error, part, text)
  end subroutine refuse_words

  subroutine test_bad_words()
    call refuse_words("regular 4", 2, "regular with 1 numbers: expected a number of corners and a radius, and perhaps x and y")
    call refuse_words("regular 2 1", 2, "regular with corners 2.00000E+00: expected a whole number from 3 to 1000")
    call refuse_words("regular 4.5 1", 2, "regular with corners 4.50000E+00: expected a whole number")
    call refuse_words("regular 4 0", 2, "regular with a length of 0")
    call refuse_words("cube -1", 3, "cube with a length of -1")
    call refuse_words("cube 1 2", 3, "cube with 2 numbers: expected a radius, and perhaps x, y and z")
    call refuse_words("random_hull -1 9 1 1 1", 3, "random_hull with a seed -1.00000E+00: expected a whole number from 0")
    call refuse_words("random_hull 1 3 1 1 1", 3, "random_hull with corners 3.00000E+00: expected a whole number from 4")
    call refuse_words("random_hull 1 9 1 0", 2, "random_hull with a length of 0")
  end subroutine test_bad_words

  !> A square, a disk as a shape, and a disk, in the plane.
  subroutine test_figures()
    type(shape_library_t) :: shapes
    type(body_figures_t) :: figures
    type(body_set_t) :: bodies
    real(dp) :: energy, inverse(1), velocity(3)
    integer :: k

    call make_library(2, shapes)
    call figures%init(shapes)
    call bodies%init(body_layout_t(2, 3, 0, 1), 3)
    bodies%shape(:) = [1, 2, 0]
    bodies%radius(:) = [sqrt(2.0_dp), 3.0_dp, 3.0_dp]
    bodies%inertia(:) = [4.0_dp, 5.0_dp, 8.0_dp]
    bodies%orientation(:, :) = 0.3_dp
    call check_close(figures%volume_of(bodies, 1), 4.0_dp, tight, "the area of a square of side 2")
    call check_close(figures%volume_of(bodies, 2), 9*pi, 100*tight, "that of a disk that is a shape")
    call check_close(figures%volume_of(bodies, 3), 9*pi, 100*tight, "that of a disk")
    velocity(:) = [100.0_dp, 100.0_dp, 3.0_dp]
    do k = 1, 3
      energy = 1.0_dp
      call figures%add_rotation(bodies, k, velocity, energy)
      call check_close(energy, 1.0_dp + 4.5_dp*bodies%inertia(k), tight*energy, "the energy of a spin is added")
      call figures%find_inverse_inertia(bodies, k, inverse)
      call check_close(inverse(1), 1/bodies%inertia(k), tight, "one over the inertia")
      call figures%turn_freely(bodies, k, 0.5_dp, velocity)
      call check_close(velocity(3), 3.0_dp, 0.0_dp, "a spin in the plane stays")
    end do
  end subroutine test_figures

  !> A box 1 by 2 by 3 of density 1, and a sphere; principal axes are those of the scene, and turned by a quarter.
  subroutine test_figures_in_space()
    type(shape_library_t) :: shapes
    type(body_figures_t) :: figures
    type(body_set_t) :: bodies
    !> moments of inertia of the box
    real(dp), parameter :: moment(3) = [6.5_dp, 5.0_dp, 2.5_dp]
    real(dp) :: energy, inverse(6), velocity(6), before(6)
    integer :: d

    call make_library(3, shapes)
    call figures%init(shapes)
    call bodies%init(body_layout_t(3, 6, 0, 4), 2)
    bodies%shape(:) = [1, 0]
    bodies%radius(:) = [0.5_dp*sqrt(14.0_dp), 2.0_dp]
    bodies%inertia(:) = [6.5_dp, 3.0_dp]
    bodies%orientation(:, :) = 0.0_dp
    bodies%orientation(1, :) = 1.0_dp
    call check_close(figures%volume_of(bodies, 1), 6.0_dp, 10*tight, "the volume of a box")
    call check_close(figures%volume_of(bodies, 2), 32*pi/3, 100*tight, "that of a sphere")
    call figures%find_inverse_inertia(bodies, 1, inverse)
    do d = 1, 3
      call check_close(inverse(d), 1/moment(d), 10*tight, "a box along the axes: one over its inertia")
      velocity(:) = 0.0_dp
      velocity(3 + d) = 2.0_dp
      energy = 0.0_dp
      call figures%add_rotation(bodies, 1, velocity, energy)
      call check_close(energy, 2*moment(d), 100*tight, "its energy")
      before(:) = velocity
      call figures%turn_freely(bodies, 1, 0.01_dp, velocity)
      call check_close(maxval(abs(velocity - before)), 0.0_dp, 10*tight, "a spin about a principal axis stays")
    end do
    call check_close(maxval(abs(inverse(4:6))), 0.0_dp, tight, "its axes are principal")
    ! a quarter turn about the third axis changes the first two
    bodies%orientation(1, 1) = sqrt(0.5_dp)
    bodies%orientation(4, 1) = sqrt(0.5_dp)
    call figures%find_inverse_inertia(bodies, 1, inverse)
    call check_close(inverse(1), 1/moment(2), 10*tight, "a box that is turned: the first moment")
    call check_close(inverse(2), 1/moment(1), 10*tight, "a box that is turned: the second moment")
    ! any other spin changes, but not its energy to the order of the step
    velocity(4:6) = [1.0_dp, 2.0_dp, 3.0_dp]
    before(:) = velocity
    call figures%turn_freely(bodies, 1, 0.01_dp, velocity)
    call check(maxval(abs(velocity(4:6) - before(4:6))) > 1.0e-3_dp, "any other spin of a box changes")
    call check_close(maxval(abs(velocity(1:3) - before(1:3))), 0.0_dp, 0.0_dp, "but not its velocity")
    call figures%find_inverse_inertia(bodies, 2, inverse)
    call check_close(maxval(abs(inverse(1:3) - 1/3.0_dp)), 0.0_dp, tight, "a sphere: one over its inertia")
    call check_close(maxval(abs(inverse(4:6))), 0.0_dp, 0.0_dp, "a sphere: in all axes")
    before(:) = velocity
    call figures%turn_freely(bodies, 2, 0.01_dp, velocity)
    call check_close(maxval(abs(velocity - before)), 0.0_dp, 0.0_dp, "the spin of a sphere stays")
  end subroutine test_figures_in_space

end program test_bodies_file_parts
