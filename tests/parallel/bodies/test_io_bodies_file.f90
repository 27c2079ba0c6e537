!> Bodies files: round trips in both formats on any number of ranks, defaults, and everything that is refused.
program test_io_bodies_file
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_bodies_file, only: bodies_data_t, read_bodies, write_bodies
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a")
  type(communicator_t) :: comm
  character(len=:), allocatable :: base

  call start_parallel()
  call comm%init()
  base = scratch("io_bodies_"//to_text(comm%size))
  call test_hdf5(2, 37)
  call test_hdf5(3, 37)
  call test_hdf5(3, 2)
  call test_hdf5(2, 0)
  call test_same_file()
  call test_groups()
  call test_materials()
  call test_box()
  call test_csv_2d()
  call test_csv_3d()
  call test_csv_large()
  call test_csv_empty()
  call test_csv_groups()
  call test_csv_refused()
  call test_csv_planes_refused()
  call test_csv_cells_without_meaning()
  call test_hdf5_refused()
  call test_write_refused()
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

  !> The same error is wanted on every rank; it is taken away.
  subroutine expect(error, status, part, name)
    type(error_t), allocatable, intent(inout) :: error
    integer, intent(in) :: status
    character(len=*), intent(in) :: part, name
    character(len=:), allocatable :: first

    call check(allocated(error), name//": an error")
    first = ""
    if (allocated(error)) first = error%message
    call comm%broadcast_text(first, 0)
    if (.not. allocated(error)) return
    call check_equal(error%message, first, name//": the same error on all ranks")
    call check_equal(error%status, status, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    call check(index(error%message, base) == 1, name//": names the file: "//error%message)
    call check(index(error%message, lf) == 0, name//": one line")
    deallocate (error)
  end subroutine expect

  subroutine expect_none(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    if (allocated(error)) then
      call check(.false., name//": "//error%message)
      deallocate (error)
    else
      call check(.true., name)
    end if
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

  ! ------------------------------------------------------------------------------------------------ HDF5

  !> Body g (from 1) of n has the id 2g + 10; rank r holds those with mod(g, size) = r, last ones first.
  subroutine make_bodies(dimension, n, bodies)
    integer, intent(in) :: dimension, n
    type(bodies_data_t), intent(out) :: bodies
    integer :: g, k, own

    own = 0
    do g = 1, n
      if (mod(g, comm%size) == comm%rank) own = own + 1
    end do
    bodies%dimension = dimension
    bodies%n = own
    allocate (bodies%group(own), source=0)
    allocate (bodies%material(own), source=1)
    allocate (bodies%id(own), bodies%position(dimension, own), bodies%velocity(3*(dimension - 1), own))
    allocate (bodies%radius(own), bodies%mass(own))
    own = 0
    do g = n, 1, -1
      if (mod(g, comm%size) /= comm%rank) cycle
      own = own + 1
      bodies%id(own) = 2*g + 10
      bodies%radius(own) = 1.0_dp/(g + 1)
      bodies%mass(own) = 1.0_dp/(g + 2)
      do k = 1, dimension
        bodies%position(k, own) = g + 0.1_dp*k
      end do
      do k = 1, 3*(dimension - 1)
        bodies%velocity(k, own) = -g - 0.1_dp*k
      end do
    end do
    bodies%n_walls = dimension
    allocate (bodies%wall_id(dimension))
    allocate (bodies%wall_point(dimension, dimension), bodies%wall_normal(dimension, dimension), source=0.0_dp)
    do k = 1, dimension
      bodies%wall_id(k) = k
      bodies%wall_point(k, k) = -0.5_dp
      bodies%wall_normal(k, k) = 1
    end do
  end subroutine make_bodies

  subroutine test_hdf5(dimension, n)
    integer, intent(in) :: dimension, n
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call make_bodies(dimension, n, bodies)
    call write_bodies(comm, base//".h5", bodies, error)
    call expect_none(error, "writing")
    call read_bodies(comm, base//".h5", dimension, bodies, error)
    call expect_none(error, "reading")
    call check(allocated(bodies%mass), "masses")
    call check_bodies(bodies, dimension, n, 1.0_dp)
    call check_equal(bodies%n_walls, dimension, "number of walls")
    call check_equal(bodies%wall_id(dimension), int(dimension, i8), "id of a wall")
    call check_close(bodies%wall_point(dimension, dimension), -0.5_dp, 0.0_dp, "point of a wall")
    call check_close(bodies%wall_normal(dimension, dimension), 1.0_dp, 0.0_dp, "normal of a wall")

    ! no velocities, no masses, no walls; the name in capitals
    call make_bodies(dimension, n, bodies)
    call write_few(base//".HDF5", bodies, error)
    call expect_none(error, "writing what is required")
    call read_bodies(comm, base//".HDF5", dimension, bodies, error)
    call expect_none(error, "reading what is required")
    call check(.not. allocated(bodies%mass), "no masses")
    call check_equal(bodies%n_walls, 0, "no walls")
    call check_equal(size(bodies%wall_point, 1), dimension, "shape of no walls")
    call check(all(abs(bodies%velocity) <= 0), "at rest")
    call check_equal(size(bodies%velocity, 1), 3*(dimension - 1), "shape of velocities")
  end subroutine test_hdf5

  !> The rows of this rank are those of the block that falls to it.
  subroutine check_bodies(bodies, dimension, n, sign)
    type(bodies_data_t), intent(in) :: bodies
    integer, intent(in) :: dimension, n
    real(dp), intent(in) :: sign
    integer :: first, g, i, k

    first = n*comm%rank/comm%size
    call check_equal(bodies%total, int(n, i8), "number of all bodies")
    call check_equal(bodies%n, n*(comm%rank + 1)/comm%size - first, "number of bodies of the rank")
    call check_equal(size(bodies%id), bodies%n, "size of the arrays")
    do i = 1, bodies%n
      g = first + i
      call check_equal(bodies%id(i), 2_i8*g + 10, "id")
      call check_close(bodies%radius(i), 1.0_dp/(g + 1), 0.0_dp, "radius")
      if (allocated(bodies%mass)) call check_close(bodies%mass(i), 1.0_dp/(g + 2), 0.0_dp, "mass")
      do k = 1, dimension
        call check_close(bodies%position(k, i), g + 0.1_dp*k, 0.0_dp, "position")
      end do
      do k = 1, 3*(dimension - 1)
        call check_close(bodies%velocity(k, i), -sign*(g + 0.1_dp*k), 0.0_dp, "velocity")
      end do
    end do
  end subroutine check_bodies

  subroutine write_few(path, bodies, error)
    character(len=*), intent(in) :: path
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file

    call file%create(comm, path, error)
    call file%write_rows("/bodies/id", bodies%id, error)
    call file%write_rows("/bodies/position", bodies%position, error)
    call file%write_rows("/bodies/radius", bodies%radius, error)
    call file%close(error)
  end subroutine write_few

  !> The file does not depend on the rank that holds a body.
  subroutine test_same_file()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    character(len=:), allocatable :: first, second

    call make_bodies(3, 50, bodies)
    call write_bodies(comm, base//".h5", bodies, error)
    call read_bodies(comm, base//".h5", 3, bodies, error)
    first = content(base//".h5")
    call write_bodies(comm, base//".again.h5", bodies, error)
    second = content(base//".again.h5")
    call check(first == second .and. len(first) == len(second), "the same file however the bodies are spread")
    call expect_none(error, "writing twice")
  end subroutine test_same_file

  !> Glued grains keep their groups; a file without any has no dataset of them, and is read with zeros.
  subroutine test_groups()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    character(len=:), allocatable :: plain, free

    call make_bodies(2, 30, bodies)
    call write_bodies(comm, base//".h5", bodies, error)
    plain = content(base//".h5")
    call file%open(comm, base//".h5", error)
    call check(.not. file%exists("/bodies/group"), "no dataset where no grain is glued")
    call file%close(error)
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call write_bodies(comm, base//".h5", bodies, error)
    free = content(base//".h5")
    call check(plain == free .and. len(plain) == len(free), "no grain glued: the same file, read and written again")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect_none(error, "reading no groups")
    call check_equal(size(bodies%group), bodies%n, "size of no groups")
    call check(all(bodies%group == 0), "free grains")

    ! one glued grain, on one rank, and many
    call make_bodies(2, 30, bodies)
    bodies%group = merge(7, 0, bodies%id == 24)
    call write_bodies(comm, base//".h5", bodies, error)
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect_none(error, "reading one group")
    call check(all(bodies%group == merge(7, 0, bodies%id == 24)), "one glued grain")
    call make_bodies(2, 30, bodies)
    bodies%group = int(mod(bodies%id, 9_i8))
    where (bodies%id == 12) bodies%group = huge(1)
    call write_bodies(comm, base//".h5", bodies, error)
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect_none(error, "reading many groups")
    call check(all(bodies%group == merge(huge(1), int(mod(bodies%id, 9_i8)), bodies%id == 12)), "many glued grains")
    call check_bodies(bodies, 2, 30, 1.0_dp)

    call make_bodies(2, 30, bodies)
    bodies%group = merge(-1, 0, bodies%id == 40)
    call write_bodies(comm, base//".h5", bodies, error)
    call expect(error, status_failure, "/bodies/group: id 40: -1, but a group from 0 to 2147483647 was expected", &
      & "writing a negative group")
    call refuse_groups(-1_i8)
    call refuse_groups(2147483648_i8)
  end subroutine test_groups

  !> A file with this group of the last body.
  subroutine refuse_groups(group)
    integer(i8), intent(in) :: group
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    integer(i8), allocatable :: groups(:)

    call make_bodies(2, 8, bodies)
    allocate (groups(bodies%n), source=0_i8)
    where (bodies%id == 26) groups = group
    call file%create(comm, base//".h5", error)
    call file%write_rows("/bodies/id", bodies%id, error)
    call file%write_rows("/bodies/position", bodies%position, error)
    call file%write_rows("/bodies/radius", bodies%radius, error)
    call file%write_rows("/bodies/group", groups, error)
    call file%close(error)
    call expect_none(error, "writing a group to be refused")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, "/bodies/group: id 26: "//to_text(group)//", but a group from 0 to", "a group out of range")
  end subroutine refuse_groups

  !> Materials are read as written, and are 1 where there are none.
  subroutine test_materials()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    integer(i8), allocatable :: numbers(:)
    integer :: k

    do k = 1, 2
      call make_bodies(2, 8, bodies)
      allocate (numbers(bodies%n))
      numbers(:) = mod(bodies%id, 5_i8) + 1
      if (k == 2) where (bodies%id == 26) numbers = 0
      call file%create(comm, base//".h5", error)
      call file%write_rows("/bodies/id", bodies%id, error)
      call file%write_rows("/bodies/position", bodies%position, error)
      call file%write_rows("/bodies/radius", bodies%radius, error)
      call file%write_rows("/bodies/material", numbers, error)
      call file%close(error)
      call expect_none(error, "writing materials")
      call read_bodies(comm, base//".h5", 2, bodies, error)
      if (k == 1) call check(all(bodies%material == mod(bodies%id, 5_i8) + 1), "materials")
      deallocate (numbers)
    end do
    call expect(error, status_input, "/bodies/material: id 26: 0, but a material from 1 to", "a material out of range")
    call put(base//".csv", "id,x,y,radius,material"//lf//"5,1,2,0.5,3"//lf//"6,2,3,0.5,")
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "CSV with materials")
    call check(all(bodies%material == merge(3, 1, bodies%id == 5)), "materials of CSV")
    call put(base//".csv", "id,x,y,radius,material"//lf//"5,1,2,0.5,0")
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, "a material from 1 to 2147483647", "a material of 0")
  end subroutine test_materials

  !> A periodic box is read as written, and absent where there is none.
  subroutine test_box()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call make_bodies(3, 9, bodies)
    call write_bodies(comm, base//".h5", bodies, error)
    call read_bodies(comm, base//".h5", 3, bodies, error)
    call check(.not. bodies%has_box, "no box")
    call check_write_box([0.1_dp, -0.2_dp, 0.3_dp], [1.5_dp, 0.0_dp, 1.0_dp/3], error)
    call read_bodies(comm, base//".h5", 3, bodies, error)
    call expect_none(error, "reading a box")
    call check(bodies%has_box, "a box")
    call check(all(abs(bodies%origin - [0.1_dp, -0.2_dp, 0.3_dp]) <= 0), "its origin")
    call check(all(abs(bodies%period - [1.5_dp, 0.0_dp, 1.0_dp/3]) <= 0), "its period")
    call check_write_box([0.1_dp, -0.2_dp], [0.0_dp, 2.0_dp], error)
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect_none(error, "reading a box in 2D")
    call check(all(abs(bodies%origin - [0.1_dp, -0.2_dp, 0.0_dp]) <= 0), "its origin in 2D")
    call check(all(abs(bodies%period - [0.0_dp, 2.0_dp, 0.0_dp]) <= 0), "its period in 2D")

    call check_write_box([0.0_dp, 0.0_dp], [1.0_dp, -2.0_dp], error)
    call expect(error, status_failure, "/box/period: -2.00000000E+00, but a number >= 0 was expected", "writing a negative period")
    call refuse_layout("+/box/period", "/box/origin: missing")
    call refuse_layout("+/box/size", "/box/size: unknown; known are origin, period, edge, velocity")
    call refuse_box(1, 1.0_dp, "/box/origin: 1 numbers, but 2 were expected")
    call refuse_box(2, -1.0_dp, "/box/period: -1.00000000E+00, but a number >= 0 was expected")
    call refuse_box(2, ieee_value(1.0_dp, ieee_quiet_nan), "/box/period: NaN or infinity")
  end subroutine test_box

  subroutine check_write_box(origin, period, error)
    real(dp), intent(in), contiguous :: origin(:), period(:)
    type(error_t), allocatable, intent(inout) :: error
    type(bodies_data_t) :: bodies

    call make_bodies(size(origin), 9, bodies)
    bodies%has_box = .true.
    bodies%origin(1:size(origin)) = origin
    bodies%period(1:size(period)) = period
    call write_bodies(comm, base//".h5", bodies, error)
  end subroutine check_write_box

  !> A box of n numbers, all of one value.
  subroutine refuse_box(n, value, part)
    integer, intent(in) :: n
    real(dp), intent(in) :: value
    character(len=*), intent(in) :: part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    real(dp), allocatable :: origin(:), period(:)

    allocate (origin(merge(n, 0, comm%rank == 0)), source=0.0_dp)
    allocate (period(size(origin)), source=value)
    call make_bodies(2, 8, bodies)
    call file%create(comm, base//".h5", error)
    call file%write_rows("/bodies/id", bodies%id, error)
    call file%write_rows("/bodies/position", bodies%position, error)
    call file%write_rows("/bodies/radius", bodies%radius, error)
    call file%write_rows("/box/origin", origin, error)
    call file%write_rows("/box/period", period, error)
    call file%close(error)
    call expect_none(error, "writing a box to be refused")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, part, "a box with "//part)
  end subroutine refuse_box

  ! ------------------------------------------------------------------------------------------------ CSV

  subroutine test_csv_2d()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    integer :: g

    ! columns in any order, planes among the bodies, comments
    text = "radius,y,x,id,omega,vy,vx,shape,ny,nx,mass"//lf
    do g = 1, 9
      text = text//real_text(1.0_dp/(g + 1))//","//real_text(g + 0.2_dp)//","//real_text(g + 0.1_dp)//","//to_text(2*g + 10)// &
        & ","//real_text(-g - 0.3_dp)//","//real_text(-g - 0.2_dp)//","//real_text(-g - 0.1_dp)//",grain,,,"// &
        & real_text(1.0_dp/(g + 2))//lf
      if (g == 4) text = text//"# a floor"//lf//",-1,0.5,1,,,,Plane,3,-4,"//lf//lf
    end do
    call put(base//".csv", text)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "CSV in 2D")
    call check_bodies(bodies, 2, 9, 1.0_dp)
    call check(allocated(bodies%mass), "masses")
    call check_equal(bodies%n_walls, 1, "one wall on every rank")
    call check_equal(bodies%wall_id(1), 1_i8, "its id")
    call check_close(bodies%wall_point(1, 1), 0.5_dp, 0.0_dp, "its point, x")
    call check_close(bodies%wall_point(2, 1), -1.0_dp, 0.0_dp, "its point, y")
    ! 4/5 and 3/5 by two divisions and a root: a few roundings of numbers below 1
    call check_close(bodies%wall_normal(1, 1), -0.8_dp, 4*epsilon(1.0_dp), "its normal, x")
    call check_close(bodies%wall_normal(2, 1), 0.6_dp, 4*epsilon(1.0_dp), "its normal, y")
  end subroutine test_csv_2d

  function real_text(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(value, 17)
  end function real_text

  subroutine test_csv_3d()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", "id,x,y,z,radius,vz,wx,mass,shape"//lf//"5,1,2,3,0.5,,,,"//lf//"6,1e0,2.5,-3,0.25,7,8,,grain")
    call read_bodies(comm, base//".csv", 3, bodies, error)
    call expect_none(error, "CSV in 3D")
    call check_equal(bodies%total, 2_i8, "number of bodies")
    call check(.not. allocated(bodies%mass), "a column without masses is no column of masses")
    call check_equal(bodies%n_walls, 0, "no walls")
    call check_equal(size(bodies%velocity, 1), 6, "shape of velocities")
    if (comm%rank < comm%size - 1) return
    ! the last body is on the last rank
    call check_equal(bodies%id(bodies%n), 6_i8, "id")
    call check_close(bodies%position(3, bodies%n), -3.0_dp, 0.0_dp, "position")
    call check_close(bodies%velocity(2, bodies%n), 0.0_dp, 0.0_dp, "velocity of no column")
    call check_close(bodies%velocity(3, bodies%n), 7.0_dp, 0.0_dp, "velocity")
    call check_close(bodies%velocity(4, bodies%n), 8.0_dp, 0.0_dp, "rotation")
    if (bodies%n == 2) call check_close(bodies%velocity(3, 1), 0.0_dp, 0.0_dp, "velocity of an empty cell")
  end subroutine test_csv_3d

  !> Longer than the blocks it is read in.
  subroutine test_csv_large()
    integer, parameter :: n = 20000
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    character(len=20) :: line
    character(len=:), allocatable :: rows
    integer :: g

    allocate (character(len=21*n) :: rows)
    do g = 1, n
      write (line, "(i8, ',', i4, ',0,1.5')") g, mod(g, 1000)
      rows(21*g - 20:21*g) = line//lf
    end do
    call put(base//".csv", "id,x,y,radius"//lf//rows)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "a large CSV")
    call check_equal(bodies%total, int(n, i8), "number of all bodies")
    do g = 1, bodies%n
      call check_equal(bodies%id(g), int(n, i8)*comm%rank/comm%size + g, "id in a large file")
      call check_close(bodies%position(1, g), real(mod(bodies%id(g), 1000_i8), dp), 0.0_dp, "position in a large file")
    end do
  end subroutine test_csv_large

  subroutine test_csv_empty()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", "id,x,y,radius"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "no bodies at all")
    call check_equal(bodies%total, 0_i8, "number of no bodies")
    call check_equal(bodies%n_walls, 0, "number of no walls")
    call put(base//".csv", "id,x,y,radius,shape,nx,ny"//lf//"1,0,0,,plane,0,1"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "a wall and no bodies")
    call check_equal(bodies%total, 0_i8, "number of no bodies beside a wall")
    call check_equal(bodies%n_walls, 1, "number of walls without bodies")
  end subroutine test_csv_empty

  !> An empty cell is a free grain; the cell of a plane is empty or 0.
  subroutine test_csv_groups()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", "id,x,y,radius,group,shape,nx,ny"//lf//"1,0,0,1,3,,,"//lf//"2,0,0,1,,,,"//lf// &
      & "3,0,0,,0,plane,0,1"//lf//"4,0,0,1,0,,,"//lf//"5,0,0,1,2147483647,,,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "groups in CSV")
    call check(all(bodies%group == merge(3, 0, bodies%id == 1) + merge(huge(1), 0, bodies%id == 5)), "groups")
    call check(.not. bodies%has_box, "no box in CSV")
    call put(base//".csv", "id,x,y,radius"//lf//"1,0,0,1"//lf//"2,0,0,1"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect_none(error, "no groups in CSV")
    call check_equal(size(bodies%group), bodies%n, "size of no groups in CSV")
    call check(all(bodies%group == 0), "free grains in CSV")
    call put(base//".csv", "id,x,y,radius,group"//lf//"1,0,0,1,-1"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, 'line 2: column group: "-1", but a group from 0 to 2147483647 was expected', "a group below 0")
    call put(base//".csv", "id,x,y,radius,group"//lf//"1,0,0,1,2147483648"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, 'line 2: column group: "2147483648", but a group from 0', "a group too large")
    call put(base//".csv", "id,x,y,radius,group"//lf//"1,0,0,1,base"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, 'line 2: column group: "base", but a whole number', "a group that is a name")
  end subroutine test_csv_groups

  subroutine refuse_csv(header, row, part)
    character(len=*), intent(in) :: header, row, part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    ! good rows before and after, for all ranks to have some
    call put(base//".csv", header//lf//"101,1,2,0.5"//lf//"102,1,2,0.5"//lf//row//lf//"103,1,2,0.5"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, part, "CSV with "//row)
  end subroutine refuse_csv

  subroutine test_csv_refused()
    character(len=*), parameter :: plain = "id,x,y,radius"
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call refuse_csv("id,x,radius,y2", "1,2,3,4", "in 2D the columns id, x, y, radius are required, but the first "// &
      & "line is: id,x,radius,y2")
    call refuse_csv("id,x,y,r", "1,2,3,4", "columns id, x, y, radius are required")
    call refuse_csv("id,x,y,radius,z", "1,2,3,4,5", "column z is unknown in 2D; known are id, x, y, radius, vx, vy, omega, mass")
    call refuse_csv("id,x,y,radius,", "1,2,3,4,5", "column  is unknown in 2D")
    call refuse_csv("id,x,y,radius,x", "1,2,3,4,5", "column x appears twice")
    call refuse_csv(plain, "1,2,3", "line 4: 3 cells, but the header has 4")
    call refuse_csv(plain, "1,2,3,4,", "line 4: 5 cells, but the header has 4")
    call refuse_csv(plain, "one,2,3,4", 'line 4: column id: "one", but a whole number')
    call refuse_csv(plain, "0,2,3,4", 'line 4: column id: "0", but an id >= 1 was expected')
    call refuse_csv(plain, "-3,2,3,4", 'line 4: column id: "-3", but an id >= 1 was expected')
    call refuse_csv(plain, ",2,3,4", "line 4: column id: empty, but a whole number")
    call refuse_csv(plain, "1,abc,3,4", 'line 4: column x: "abc", but a finite number was expected')
    call refuse_csv(plain, "1,2,NaN,4", 'line 4: column y: "NaN", but a finite number was expected')
    call refuse_csv(plain, "1,2,-Infinity,4", 'line 4: column y: "-Infinity", but a finite number was expected')
    call refuse_csv(plain, "1,2,1e400,4", 'line 4: column y: "1e400", but a number of at most 1.79')
    call refuse_csv(plain, "1,,3,4", "line 4: column x: empty, but a finite number was expected")
    call refuse_csv(plain, "1,2,3,", "line 4: column radius: empty, but a finite number was expected")
    call refuse_csv(plain, "1,2,3,0", 'line 4: column radius: "0", but a radius > 0 was expected')
    call refuse_csv(plain, "1,2,3,-0.5", 'line 4: column radius: "-0.5", but a radius > 0 was expected')
    call refuse_csv(plain, "101,2,3,1", "id 101 appears twice")
    call refuse_csv(plain, "103,2,3,1", "id 103 appears twice")

    call put(base//".csv", "id,x,y,radius,mass"//lf//"1,0,0,1,1"//lf//"2,0,0,1,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, "id 2: column mass: empty, but other bodies have a mass", "a mass for some")
    call put(base//".csv", "id,x,y,radius,mass"//lf//"1,0,0,1,1"//lf//"2,0,0,1,0"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, 'line 3: column mass: "0", but a mass > 0 was expected', "a mass of zero")
    call put(base//".csv", "id,x,y,radius,vx"//lf//"1,0,0,1,inf"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, 'line 2: column vx: "inf"', "a velocity without end")
    call put(base//".csv", "")
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, "empty; a first line", "an empty file")
    call read_bodies(comm, base//".none.csv", 2, bodies, error)
    call expect(error, status_input, "cannot read this file: No such file", "a missing file")
    call read_bodies(comm, base//".txt", 2, bodies, error)
    call expect(error, status_input, "must end with .h5, .hdf5 or .csv", "an ending of no meaning")
    call read_bodies(comm, base, 2, bodies, error)
    call expect(error, status_input, "must end with .h5, .hdf5 or .csv", "no ending")
  end subroutine test_csv_refused

  subroutine refuse_plane(row, part)
    character(len=*), intent(in) :: row, part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", "id,x,y,radius,shape,nx,ny"//lf//"11,0,0,1,,,"//lf//row//lf//"12,0,0,1,grain,,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, part, "CSV with "//row)
  end subroutine refuse_plane

  subroutine test_csv_planes_refused()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call refuse_plane("1,0,0,,ball,,", 'line 3: column shape: "ball", but grain or plane was expected')
    call refuse_plane("1,0,0,,plane,0,0", 'line 3: column nx: "0", but a normal that is not zero was expected')
    call refuse_plane("1,0,0,,plane,,1", "line 3: column nx: empty, but a finite number was expected")
    call refuse_plane("1,0,0,,plane,nan,1", 'line 3: column nx: "nan", but a finite number was expected')
    call refuse_plane("1,,0,,plane,0,1", "line 3: column x: empty")
    call refuse_plane("0,0,0,,plane,0,1", 'line 3: column id: "0", but an id >= 1')
    call refuse_plane("1,0,0,inf,plane,0,1", 'line 3: column radius: "inf"')
    call refuse_plane("1,0,0,0.5,plane,0,1", &
      & 'line 3: column radius: "0.5", but an empty cell or 0 in the row of a plane was expected')
    call refuse_plane("12,0,0,,plane,0,1", "id 12 appears twice")
    call refuse_plane("2,0,0,,plane,0,1"//lf//"2,0,0,,plane,0,1", "id 2 appears twice")
    call put(base//".csv", "id,x,y,radius,shape"//lf//"1,0,0,,plane"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    call expect(error, status_input, "a plane needs the columns nx, ny", "a plane without normals")
  end subroutine test_csv_planes_refused

  subroutine refuse_cells(cells, part)
    character(len=*), intent(in) :: cells, part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call put(base//".csv", "id,x,y,radius,shape,nx,ny,vx,omega,mass,group,material"//lf//"11,0,0,1,,0,0,1,1,1,0,1"//lf// &
      & "12,0,0,0,plane,0,1,0,0,0,0,1"//lf//"13,0,0,1,,,,,,1,,"//lf//"14,0,0,"//cells//lf//"15,0,0,,plane,0,1,,,,,"//lf)
    call read_bodies(comm, base//".csv", 2, bodies, error)
    if (part == "") then
      call expect_none(error, cells)
    else
      call expect(error, status_input, part, "CSV with "//cells)
    end if
  end subroutine refuse_cells

  !> Cells that mean nothing in their row are empty or 0.
  subroutine test_csv_cells_without_meaning()
    character(len=*), parameter :: of_plane = " in the row of a plane"

    call refuse_cells("1,grain,,,,,1,,", "")
    call refuse_cells("1,grain,0,1,,,1,,", &
      & 'line 5: column ny: "1", but an empty cell or 0 in the row of a body (normals are of planes) was')
    call refuse_cells(",plane,0,1,-1,,,,", 'line 5: column vx: "-1", but an empty cell or 0'//of_plane//", which stands still, was")
    call refuse_cells(",plane,0,1,,2,,,", 'line 5: column omega: "2", but an empty cell or 0'//of_plane)
    call refuse_cells(",plane,0,1,,,5,,", 'line 5: column mass: "5", but an empty cell or 0'//of_plane)
    call refuse_cells(",plane,0,1,,,,4,", 'line 5: column group: "4", but an empty cell or 0'//of_plane)
    call refuse_cells(",plane,0,1,,,,,2", &
      & 'line 5: column material: "2", but an empty cell or 1'//of_plane//", whose material is "// &
      & "wall_material of &scene, was expected")
  end subroutine test_csv_cells_without_meaning

  ! ------------------------------------------------------------------------------------------------ refused HDF5

  !> Write four bodies with the given id, position and radius in the last row, and read them.
  subroutine refuse_hdf5(id, x, radius, part)
    integer(i8), intent(in) :: id
    real(dp), intent(in) :: x, radius
    character(len=*), intent(in) :: part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    bodies%n = merge(4, 0, comm%rank == comm%size - 1)
    allocate (bodies%id(bodies%n), bodies%position(2, bodies%n), bodies%radius(bodies%n))
    bodies%position = 0
    bodies%radius = 1
    if (bodies%n > 0) then
      bodies%id(1:3) = [1_i8, 2_i8, 3_i8]
      bodies%id(4) = id
      bodies%position(2, 4) = x
      bodies%radius(4) = radius
    end if
    call write_few(base//".h5", bodies, error)
    call expect_none(error, "writing what is to be refused")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, part, "HDF5 with "//part)
  end subroutine refuse_hdf5

  subroutine test_hdf5_refused()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error

    call refuse_hdf5(3_i8, 0.0_dp, 1.0_dp, "id 3 appears twice")
    call refuse_hdf5(0_i8, 0.0_dp, 1.0_dp, "/bodies/id: row 3 (counted from 0): 0, but an id >= 1 was expected")
    call refuse_hdf5(10_i8**18, 0.0_dp, 1.0_dp, &
      & "/bodies/id: row 3 (counted from 0): 1000000000000000000, but an id of at most 18 digits was expected")
    call refuse_hdf5(huge(1_i8), 0.0_dp, 1.0_dp, &
      & "/bodies/id: row 3 (counted from 0): 9223372036854775807 or more, but an id of at most 18 digits was expected")
    call refuse_hdf5(4_i8, ieee_value(1.0_dp, ieee_quiet_nan), 1.0_dp, "/bodies/position: id 4: NaN or infinity")
    call refuse_hdf5(4_i8, 0.0_dp, ieee_value(1.0_dp, ieee_positive_inf), "/bodies/radius: id 4: NaN or infinity")
    call refuse_hdf5(4_i8, 0.0_dp, 0.0_dp, "/bodies/radius: id 4: 0.00000000E+00, but a number > 0 was expected")
    call refuse_hdf5(4_i8, 0.0_dp, -2.0_dp, "/bodies/radius: id 4: -2.00000000E+00, but a number > 0 was expected")

    call make_bodies(2, 8, bodies)
    call write_few(base//".h5", bodies, error)
    call read_bodies(comm, base//".h5", 3, bodies, error)
    call expect(error, status_input, "/bodies/position: a dataset of shape (N, 2), but a dataset of shape (N, 3) was expected", &
      & "a file of another dimension")
    call refuse_layout("/bodies/id", "/bodies/id: missing")
    call refuse_layout("/bodies/position", "/bodies/position: missing")
    call refuse_layout("/bodies/radius", "/bodies/radius: missing")
    call refuse_layout("/bodies", "/bodies: missing; a group with id, position, velocity, radius, mass, group, material was "// &
      & "expected")
    call refuse_layout("+/bodies/masses", "/bodies/masses: unknown; known are id, position, velocity, radius, mass, group")
    call refuse_layout("+/walls/point", "/walls/id: missing")
    call refuse_layout("+/bodies/mass", "/bodies/mass: "//to_text(comm%size)//" rows, but /bodies/id has 8")
    call refuse_walls()
    call put(base//".h5", "not HDF5 at all")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, "not an HDF5 file", "a text file")
    call read_bodies(comm, base//".none.h5", 2, bodies, error)
    call expect(error, status_input, "cannot read this file: No such file", "a missing file")
  end subroutine test_hdf5_refused

  !> Leave a dataset out, or with + put one of a row a rank in.
  subroutine refuse_layout(which, part)
    character(len=*), intent(in) :: which, part
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    real(dp) :: one(1)

    one = 1
    call make_bodies(2, 8, bodies)
    call file%create(comm, base//".h5", error)
    if (which /= "/bodies/id" .and. which /= "/bodies") call file%write_rows("/bodies/id", bodies%id, error)
    if (which /= "/bodies/position" .and. which /= "/bodies") call file%write_rows("/bodies/position", bodies%position, error)
    if (which /= "/bodies/radius" .and. which /= "/bodies") call file%write_rows("/bodies/radius", bodies%radius, error)
    if (which(1:1) == "+") call file%write_rows(which(2:), one, error)
    call file%close(error)
    call expect_none(error, "writing a layout to be refused")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, part, "a layout with "//which)
  end subroutine refuse_layout

  subroutine refuse_walls()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    real(dp), allocatable :: zero(:, :)
    integer(i8) :: wall_id(1)

    call make_bodies(2, 8, bodies)
    allocate (zero(2, 1), source=0.0_dp)
    wall_id = 1000 + comm%rank
    call file%create(comm, base//".h5", error)
    call file%write_rows("/bodies/id", bodies%id, error)
    call file%write_rows("/bodies/position", bodies%position, error)
    call file%write_rows("/bodies/radius", bodies%radius, error)
    call file%write_rows("/walls/id", wall_id, error)
    call file%write_rows("/walls/point", zero, error)
    call file%write_rows("/walls/normal", zero, error)
    call file%close(error)
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, "/walls/normal: id 1000: zero, but a normal that is not zero was expected", "a zero normal")
    call make_bodies(2, 8, bodies)
    bodies%wall_id(2) = 14
    call write_bodies(comm, base//".h5", bodies, error)
    call expect_none(error, "a wall with the id of a body")
    call read_bodies(comm, base//".h5", 2, bodies, error)
    call expect(error, status_input, "id 14 appears twice, but ids must be unique among bodies and walls", "a wall like a body")
  end subroutine refuse_walls

  !> What is refused leaves an older file as it was, and nothing else behind.
  subroutine test_write_refused()
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    character(len=:), allocatable :: before
    logical :: exists

    call make_bodies(2, 8, bodies)
    call write_bodies(comm, base//".h5", bodies, error)
    call expect_none(error, "a good file")
    before = content(base//".h5")
    if (comm%rank == comm%size - 1) bodies%position(1, 1) = ieee_value(1.0_dp, ieee_quiet_nan)
    call write_bodies(comm, base//".h5", bodies, error)
    call expect(error, status_failure, "/bodies/position: id ", "writing NaN")
    call check(content(base//".h5") == before, "the older file is as it was")
    inquire (file=base//".h5.part", exist=exists)
    call check(.not. exists, "no unfinished file is left")
    call make_bodies(2, 8, bodies)
    call write_bodies(comm, base//".h5/none.h5", bodies, error)
    call expect(error, status_failure, "cannot create this file: Not a directory", "no such directory")
  end subroutine test_write_refused

  function content(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    integer :: unit, length

    open (newunit=unit, file=name, access="stream", form="unformatted", action="read", status="old")
    inquire (unit=unit, size=length)
    allocate (character(len=length) :: text)
    read (unit) text
    close (unit)
  end function content

end program test_io_bodies_file
