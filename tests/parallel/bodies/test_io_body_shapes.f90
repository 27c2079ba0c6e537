!> Shapes of bodies in bodies files: what both formats say and give back, on any number of ranks, and everything that is refused.
program test_io_body_shapes
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_shape_library, only: shape_library_t
  use gravier_shapes_file, only: parse_shapes
  use gravier_bodies_file, only: bodies_data_t, read_bodies, write_bodies
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a")
  real(dp), parameter :: rounding_error = 1.0e-14_dp
  type(communicator_t) :: comm
  type(shape_library_t) :: shapes
  character(len=:), allocatable :: base

  call start_parallel()
  call comm%init()
  base = scratch("io_body_shapes_"//to_text(comm%size))
  call make_library()
  call test_csv()
  call test_csv_space()
  call test_csv_refused()
  call test_there_and_back(2)
  call test_there_and_back(3)
  call test_hdf5_by_hand()
  call test_hdf5_refused()
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

  !> A brick of size 5 and a disk of size 0.1.
  subroutine make_library()
    type(error_t), allocatable :: error

    call parse_shapes("a.shapes", "shape brick"//lf//"polygon -4 -3 4 -3 4 3 -4 3"//lf//"shape Coin"//lf//"disk 0 0 0.1", 2, &
      & shapes, error)
    call expect_none(error, "a library")
  end subroutine make_library

  !> The same error is wanted on every rank; it is taken away.
  subroutine expect(error, part)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part
    character(len=:), allocatable :: first

    call check(allocated(error), part//": an error")
    first = ""
    if (allocated(error)) first = error%message
    call comm%broadcast_text(first, 0)
    if (.not. allocated(error)) return
    call check_equal(error%message, first, part//": the same error on all ranks")
    call check_equal(error%status, status_input, part//": status")
    call check(index(error%message, part) > 0, "'"//part//"' in: "//error%message)
    call check(index(error%message, base) == 1, part//": names the file: "//error%message)
    call check(index(error%message, lf) == 0, part//": one line")
    deallocate (error)
  end subroutine expect

  subroutine expect_none(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    call check(.not. allocated(error), name)
    if (allocated(error)) call check(.false., name//": "//error%message)
    if (allocated(error)) deallocate (error)
  end subroutine expect_none

  !> Rank 0 writes a file, for all to see.
  subroutine put(name, text)
    character(len=*), intent(in) :: name, text
    integer :: unit

    call comm%barrier()
    if (comm%rank == 0) then
      open (newunit=unit, file=name, access="stream", form="unformatted", action="write", status="replace")
      write (unit) text
      close (unit)
    end if
    call comm%barrier()
  end subroutine put

  ! ------------------------------------------------------------------------------------------------ CSV

  subroutine test_csv()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    integer :: i

    call put(base//".csv", "id,x,y,shape,scale,angle,radius,nx,ny"//lf//"1,0,0,brick,0.5,-1.25,,,"//lf//"2,0,0,,,0.75,0.3,,"//lf// &
      & "3,0,0,Coin,,,,,"//lf//"9,0,0,plane,,,,0,1"//lf//"4,0,0,brick,,,7.5,,"//lf//"5,0,0,brick,2,,10,,"//lf// &
      & "6,0,0,disk,,,1,,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error, shapes)
    call expect_none(error, "a table with shapes")
    call check_equal(bodies%total, 6_i8, "bodies of the table")
    call check_equal(bodies%n_walls, 1, "planes of the table")
    do i = 1, bodies%n
      select case (bodies%id(i))
      case (1_i8)
        call check_row(bodies, i, 1, 2.5_dp, -1.25_dp)
      case (2_i8)
        call check_row(bodies, i, 0, 0.3_dp, 0.75_dp)
      case (3_i8)
        call check_row(bodies, i, 2, 0.1_dp, 0.0_dp)
      case (4_i8)
        call check_row(bodies, i, 1, 7.5_dp, 0.0_dp)
      case (5_i8)
        call check_row(bodies, i, 1, 10.0_dp, 0.0_dp)
      case default
        call check_row(bodies, i, 0, 1.0_dp, 0.0_dp)
      end select
    end do

    ! a table of shapes alone needs no radii; one without shapes is read as without a library
    call put(base//".csv", "id,x,y,shape"//lf//"1,0,0,brick"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error, shapes)
    call expect_none(error, "a table without radii")
    if (bodies%n > 0) call check_row(bodies, 1, 1, 5.0_dp, 0.0_dp)
    call put(base//".csv", "id,x,y,radius"//lf//"1,0,0,2"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error, shapes)
    call expect_none(error, "a table without shapes")
    if (bodies%n > 0) call check_row(bodies, 1, 0, 2.0_dp, 0.0_dp)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call check(.not. allocated(bodies%shape), "no shapes without a library")
    call expect_none(error, "a table without a library")
  end subroutine test_csv

  subroutine check_row(bodies, i, shape, radius, angle)
    type(bodies_data_t), intent(in) :: bodies
    integer, intent(in) :: i, shape
    real(dp), intent(in) :: radius, angle

    call check_equal(bodies%shape(i), shape, "shape of id "//to_text(bodies%id(i)))
    call check_close(bodies%radius(i), radius, rounding_error*radius, "radius of id "//to_text(bodies%id(i)))
    call check_close(bodies%orientation(1, i), angle, 0.0_dp, "angle of id "//to_text(bodies%id(i)))
  end subroutine check_row

  !> Quaternions are made unit ones, and those of length 1 but for rounding are left as they are.
  subroutine test_csv_space()
    real(dp), parameter :: nearly(4) = [0.6_dp, 0.0_dp, 0.8_dp + 1.0e-15_dp, 0.0_dp]
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    real(dp) :: expected(4)
    integer :: i

    call put(base//".csv", "id,x,y,z,shape,qw,qx,qy,qz"//lf//"1,0,0,0,brick,0,0,0,-5"//lf//"2,0,0,0,brick,,,,"//lf// &
      & "3,0,0,0,brick,"//to_text(nearly(1), 17)//",,"//to_text(nearly(3), 17)//","//lf)
    call read_bodies(comm, base//".csv", 3, bodies, error, shapes)
    call expect_none(error, "quaternions")
    do i = 1, bodies%n
      expected(:) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
      if (bodies%id(i) == 1) expected(:) = [0.0_dp, 0.0_dp, 0.0_dp, -1.0_dp]
      if (bodies%id(i) == 3) expected(:) = nearly
      call check(all(abs(bodies%orientation(:, i) - expected) <= 0.0_dp), "quaternion of id "//to_text(bodies%id(i)))
    end do
  end subroutine test_csv_space

  subroutine refuse_csv(header, row, part, dimension)
    character(len=*), intent(in) :: header, row, part
    integer, intent(in) :: dimension
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", header//lf//row//lf)
    call read_bodies(comm, base//".csv", dimension, bodies, error, shapes)
    call expect(error, part)
  end subroutine refuse_csv

  subroutine test_csv_refused()
    character(len=*), parameter :: header = "id,x,y,shape,scale,angle,radius"
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call refuse_csv(header, "1,0,0,ball,,,", &
      & 'line 2: column shape: "ball", but grain, disk, sphere, plane or one of the shapes '// &
      & "brick, Coin was expected", 2)
    call refuse_csv(header, "1,0,0,coin,,,", 'line 2: column shape: "coin", but grain, disk', 2)
    call refuse_csv(header, "1,0,0,brick,0,,", 'line 2: column scale: "0", but a scale > 0 was expected', 2)
    call refuse_csv(header, "1,0,0,brick,-1,,", 'line 2: column scale: "-1", but a scale > 0 was expected', 2)
    call refuse_csv(header, "1,0,0,brick,x,,", 'line 2: column scale: "x", but a finite number was expected', 2)
    call refuse_csv(header, "1,0,0,brick,1e30,,", &
      & 'line 2: column shape: "brick", but a scale that makes a radius that is a number', 2)
    call refuse_csv(header, "1,0,0,brick,2,,9", &
      & 'line 2: column radius: "9", but an empty cell, or the radius of the shape, which '// &
      & "is 1.00000000E+01 at this scale, was expected", 2)
    call refuse_csv(header, "1,0,0,,2,,1", &
      & 'line 2: column scale: "2", but an empty cell for a body without a shape was expected', 2)
    call refuse_csv(header, "1,0,0,disk,,,", "line 2: column radius: empty, but a finite number was expected", 2)
    call refuse_csv(header, "1,0,0,brick,,nan,", 'line 2: column angle: "nan", but a finite number was expected', 2)
    call refuse_csv(header, "1,0,0,brick,,1e31,", 'line 2: column angle: "1e31", but a number of at most 1e30 in size', 2)
    call refuse_csv(header, "1,0,0,brick,,-1.0001e8,", 'line 2: column angle: "-1.0001e8", but an angle of at most 1e8 in size', 2)
    call refuse_csv(header//",nx,ny", "1,0,0,plane,2,,,0,1", &
      & 'line 2: column scale: "2", but an empty cell or 0 in the row of a plane', 2)
    call refuse_csv(header//",nx,ny", "1,0,0,plane,,0.4,,0,1", &
      & 'line 2: column angle: "0.4", but an empty cell or 0 in the row of', 2)
    call refuse_csv("id,x,y,z,shape,qw,qx,qy,qz,nx,ny,nz", "1,0,0,0,plane,1,,0,1,0,0,1", &
      & 'line 2: column qz: "1", but an empty cell or 0 in', 3)
    call refuse_csv("id,x,y,shape", "1,0,0,disk", &
      & 'line 2: column shape: "disk", but a shape (a disk or a sphere needs the column '// &
      & "radius) was expected", 2)
    call refuse_csv("id,x,y", "1,0,0", "in 2D the columns id, x, y, radius are required", 2)
    call refuse_csv("id,x,y,shape,qw", "1,0,0,brick,1", "column qw is unknown in 2D; known are", 2)
    call refuse_csv("id,x,y,z,shape,angle", "1,0,0,0,brick,1", "column angle is unknown in 3D; known are", 3)
    call refuse_csv("id,x,y,z,shape,qx", "1,0,0,0,brick,0", &
      & 'line 2: column qx: "0", but a quaternion that is not zero was expected', 3)

    call put(base//".csv", header//lf//"1,0,0,brick,,,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, "column scale is unknown in 2D; known are")
    call put(base//".csv", "id,x,y,radius,shape"//lf//"1,0,0,1,disk"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, 'line 2: column shape: "disk", but grain or plane was expected')
  end subroutine test_csv_refused

  ! ------------------------------------------------------------------------------------------------ HDF5

  !> Body g (from 1) of n has the id g and the shape mod(g, 3); rank r holds those with mod(g, size) = r, last ones first.
  subroutine make_bodies(dimension, n, bodies)
    integer, intent(in) :: dimension, n
    type(bodies_data_t), intent(out) :: bodies
    integer :: g, own, no

    no = merge(1, 4, dimension == 2)
    own = 0
    do g = 1, n
      if (mod(g, comm%size) == comm%rank) own = own + 1
    end do
    bodies%dimension = dimension
    bodies%n = own
    allocate (bodies%id(own), bodies%radius(own), bodies%mass(own), bodies%shape(own), bodies%orientation(no, own))
    allocate (bodies%group(own), source=0)
    allocate (bodies%material(own), source=1)
    allocate (bodies%position(dimension, own), bodies%velocity(3*(dimension - 1), own), source=0.0_dp)
    allocate (bodies%wall_id(0), bodies%wall_point(dimension, 0), bodies%wall_normal(dimension, 0))
    own = 0
    do g = n, 1, -1
      if (mod(g, comm%size) /= comm%rank) cycle
      own = own + 1
      bodies%id(own) = g
      call make_body(g, bodies%shape(own), bodies%radius(own), bodies%orientation(:, own))
      bodies%mass(own) = 1.0_dp/g
    end do
  end subroutine make_bodies

  !> Numbers without short forms.
  subroutine make_body(g, shape, radius, turn)
    integer, intent(in) :: g
    integer, intent(out) :: shape
    real(dp), intent(out) :: radius, turn(:)
    integer :: k

    shape = mod(g, 3)
    radius = 1.0_dp/(g + 2)
    if (shape > 0) radius = shapes%shape(shape)%size*radius
    do k = 1, size(turn)
      turn(k) = sin(real(g + k, dp))
    end do
    if (size(turn) == 4) turn(:) = turn/norm2(turn)
  end subroutine make_body

  !> What was written comes back to the bit.
  subroutine test_there_and_back(dimension)
    integer, intent(in) :: dimension
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    real(dp) :: radius, turn(merge(1, 4, dimension == 2))
    integer :: i, shape

    call make_bodies(dimension, 31, bodies)
    call write_bodies(comm, base//".h5", bodies, error, shapes)
    call expect_none(error, "writing shapes")
    call read_bodies(comm, base//".h5", dimension, bodies, error, shapes)
    call expect_none(error, "reading shapes")
    call check_equal(bodies%total, 31_i8, "bodies of the file")
    do i = 1, bodies%n
      call make_body(int(bodies%id(i)), shape, radius, turn)
      call check_equal(bodies%shape(i), shape, "shape of a body")
      call check_close(bodies%radius(i), radius, 0.0_dp, "radius of a body, to the bit")
      call check(all(abs(bodies%orientation(:, i) - turn) <= 0.0_dp), "orientation of a body, to the bit")
    end do
    call read_bodies(comm, base//".h5", dimension, bodies, error)
    call expect(error, "/bodies/orientation: unknown; known are")
  end subroutine test_there_and_back

  !> A file as a script would write it: names in an order of its own, no radii, angles as a column.
  subroutine write_by_hand(shape, scale, turn, names, error)
    integer(i8), intent(in) :: shape
    real(dp), intent(in) :: scale, turn
    !> empty: no attribute
    character(len=*), intent(in) :: names
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file
    integer(i8), allocatable :: id(:), numbers(:)
    real(dp), allocatable :: position(:, :), turns(:, :), scales(:)
    integer :: n

    n = merge(2, 0, comm%rank == 0)
    allocate (id(n), numbers(n), position(2, n), turns(1, n), scales(n))
    position(:, :) = 0.0_dp
    if (n > 0) then
      id(:) = [1_i8, 2_i8]
      numbers(1) = 1
      numbers(2) = shape
      scales(1) = 1.0_dp
      scales(2) = scale
      turns(1, 1) = 0.0_dp
      turns(1, 2) = turn
    end if
    call file%create(comm, base//".h5", error)
    call file%write_rows("/bodies/id", id, error)
    call file%write_rows("/bodies/position", position, error)
    call file%write_rows("/bodies/shape", numbers, error)
    if (names /= "") call file%write_attribute("/bodies/shape", "names", names, error)
    call file%write_rows("/bodies/scale", scales, error)
    call file%write_rows("/bodies/orientation", turns, error)
    call file%close(error)
    call expect_none(error, "a file by hand")
  end subroutine write_by_hand

  subroutine test_hdf5_by_hand()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    integer :: i

    call write_by_hand(2_i8, 0.5_dp, 1.5_dp, "Coin, brick", error)
    call read_bodies(comm, base//".h5", 2, bodies, error, shapes)
    call expect_none(error, "reading it")
    do i = 1, bodies%n
      if (bodies%id(i) == 1) call check_row(bodies, i, 2, 0.1_dp, 0.0_dp)
      if (bodies%id(i) == 2) call check_row(bodies, i, 1, 2.5_dp, 1.5_dp)
    end do
  end subroutine test_hdf5_by_hand

  subroutine refuse_hdf5(shape, scale, turn, names, part)
    integer(i8), intent(in) :: shape
    real(dp), intent(in) :: scale, turn
    character(len=*), intent(in) :: names, part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call write_by_hand(shape, scale, turn, names, error)
    call read_bodies(comm, base//".h5", 2, bodies, error, shapes)
    call expect(error, part)
  end subroutine refuse_hdf5

  subroutine test_hdf5_refused()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    integer :: i

    call refuse_hdf5(1_i8, 1.0_dp, 0.0_dp, "", "/bodies/shape: no attribute names; the names of the shapes with commas between")
    call refuse_hdf5(1_i8, 1.0_dp, 0.0_dp, "brick,ball", &
      & "/bodies/shape: attribute names: ball: expected one of the shapes of the "// &
      & "scene, brick, Coin")
    call refuse_hdf5(1_i8, 1.0_dp, 0.0_dp, "brick,Coin,brick,ball", &
      & "/bodies/shape: attribute names: ball: expected one of the shapes of the "// &
      & "scene, brick, Coin")
    call refuse_hdf5(4_i8, 1.0_dp, 0.0_dp, "brick,Coin,brick", &
      & "/bodies/shape: id 2: 4, but a number from 0 to 3, that of the last of its names")
    call refuse_hdf5(2_i8, 1.0_dp, 0.0_dp, "brick", &
      & "/bodies/shape: id 2: 2, but a number from 0 to 1, that of the last of its names")
    call refuse_hdf5(-1_i8, 1.0_dp, 0.0_dp, "brick", "/bodies/shape: id 2: -1, but a number from 0 to 1")
    call refuse_hdf5(1_i8, 0.0_dp, 0.0_dp, "brick", "/bodies/scale: id 2: 0.00000000E+00, but a number > 0 was expected")
    call refuse_hdf5(1_i8, 1.0_dp, 1.0001e8_dp, "brick", &
      & "/bodies/orientation: id 2: 1.00010000E+08, but an angle of at most 1e8 in size was expected")
    call refuse_hdf5(1_i8, 1.0_dp, 1.0e31_dp, "brick", "/bodies/orientation: id 2: 1.00000000E+31, but a number of at most 1e30")
    call refuse_hdf5(0_i8, 1.0_dp, 0.0_dp, "brick", "/bodies/radius: id 2: 0.00000000E+00, but a number > 0 was expected")

    call make_bodies(2, 8, bodies)
    call write_bodies(comm, base//".h5", bodies, error, shapes)
    shapes%shape(1)%size = 6.0_dp
    call read_bodies(comm, base//".h5", 2, bodies, error, shapes)
    call expect(error, "/bodies/radius: id 1: 1.66666667E+00, but 0, or the radius of the shape at this scale, 2.00000000E+00")
    call make_bodies(3, 8, bodies)
    do i = 1, bodies%n
      if (bodies%id(i) == 4) bodies%orientation(:, i) = 0.0_dp
    end do
    call write_bodies(comm, base//".h5", bodies, error, shapes)
    call read_bodies(comm, base//".h5", 3, bodies, error, shapes)
    call expect(error, "/bodies/orientation: id 4: zero, but a quaternion that is not zero was expected")
  end subroutine test_hdf5_refused

end program test_io_body_shapes
