!> The results file: what is in it, that it tells neither the number of ranks nor the time, and what is refused.
program test_io_results_file
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_negative_inf
  use mpi_f08, only: MPI_Comm, MPI_Comm_split, MPI_Comm_free, MPI_UNDEFINED, MPI_COMM_NULL, operator(/=)
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_results_file, only: results_file_t, body_rows_t, contact_rows_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_bodies = 23, n_contacts = 41
  character(len=*), parameter :: input_text = "&scene title = 'test' /"//new_line("a")//"&time step = 1e-3 /"//new_line("a")
  type(communicator_t) :: world
  character(len=:), allocatable :: path

  call start_parallel()
  call world%init()
  path = scratch("io_results_"//to_text(world%size)//".h5")
  call test_content(2)
  call test_content(3)
  call test_any_rank_count()
  call test_refused()
  call finish_checks()
  call world%free()
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

  subroutine expect(error, message, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: message, name

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_failure, name//": status")
    call check_equal(error%message, message, name//": message")
    deallocate (error)
  end subroutine expect

  !> Body g (from 1) has the id 3g + 100; the bodies of a rank are those whose number falls to it, last ones first, and
  !> rank 0 of several has none.
  subroutine make_bodies(comm, dimension, bodies)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: dimension
    type(body_rows_t), intent(out) :: bodies
    integer :: g, k, n

    n = 0
    do g = 1, n_bodies
      if (owner(comm, g) == comm%rank) n = n + 1
    end do
    allocate (bodies%id(n), bodies%position(dimension, n), bodies%velocity(3*(dimension - 1), n), bodies%radius(n))
    n = 0
    do g = n_bodies, 1, -1
      if (owner(comm, g) /= comm%rank) cycle
      n = n + 1
      bodies%id(n) = 3*g + 100
      bodies%radius(n) = 1.0_dp/g
      do k = 1, dimension
        bodies%position(k, n) = g + 0.1_dp*k
      end do
      do k = 1, 3*(dimension - 1)
        bodies%velocity(k, n) = -g - 0.01_dp*k
      end do
    end do
  end subroutine make_bodies

  !> Contact g is between the bodies of number g/3 + 1 and g/3 + 2 + mod(g, 3).
  subroutine make_contacts(comm, dimension, contacts)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: dimension
    type(contact_rows_t), intent(out) :: contacts
    integer :: g, k, n

    n = 0
    do g = 1, n_contacts
      if (owner(comm, g) == comm%rank) n = n + 1
    end do
    allocate (contacts%candidate(n), contacts%antagonist(n), contacts%normal(dimension, n), contacts%gap(n), &
      & contacts%impulse(dimension, n))
    n = 0
    do g = n_contacts, 1, -1
      if (owner(comm, g) /= comm%rank) cycle
      n = n + 1
      contacts%candidate(n) = 3*(g/3 + 1) + 100
      contacts%antagonist(n) = 3*(g/3 + 2 + mod(g, 3)) + 100
      contacts%gap(n) = -1e-6_dp*g
      do k = 1, dimension
        contacts%normal(k, n) = 0.5_dp*k + g
        contacts%impulse(k, n) = 0.25_dp*k - g
      end do
    end do
  end subroutine make_contacts

  pure integer function owner(comm, g)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: g
    owner = 0
    if (comm%size > 1) owner = 1 + mod(5*g + g/4, comm%size - 1)
  end function owner

  subroutine write_all(comm, name, dimension, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: name
    integer, intent(in) :: dimension
    type(error_t), allocatable, intent(inout) :: error
    type(results_file_t) :: results
    type(body_rows_t) :: bodies
    type(contact_rows_t) :: contacts
    real(dp) :: point(dimension, 2), normal(dimension, 2)

    point = 0
    point(1, 2) = 0.3_dp
    normal = 0
    normal(dimension, :) = 1
    call make_bodies(comm, dimension, bodies)
    call make_contacts(comm, dimension, contacts)
    call results%open(comm, name, "0.1.0", "gravier case.nml", input_text, dimension, error)
    call results%write_walls([1_i8, 2_i8], point, normal, error)
    call results%write_step(0, 0.0_dp, bodies, error)
    call results%write_step(10, 0.01_dp, bodies, error, contacts)
    call empty_step(results, dimension, error)
    call results%write_step(30, 0.03_dp, bodies, error)
    call results%close(error)
  end subroutine write_all

  !> A step of no bodies and no contacts.
  subroutine empty_step(results, dimension, error)
    type(results_file_t), intent(inout) :: results
    integer, intent(in) :: dimension
    type(error_t), allocatable, intent(inout) :: error
    type(body_rows_t) :: bodies
    type(contact_rows_t) :: contacts

    allocate (bodies%id(0), bodies%position(dimension, 0), bodies%velocity(3*(dimension - 1), 0), bodies%radius(0))
    allocate (contacts%candidate(0), contacts%antagonist(0), contacts%normal(dimension, 0), contacts%gap(0), &
      & contacts%impulse(dimension, 0))
    call results%write_step(20, 0.02_dp, bodies, error, contacts)
  end subroutine empty_step

  subroutine test_content(dimension)
    integer, intent(in) :: dimension
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    integer(i8) :: n
    real(dp) :: time

    call write_all(world, path, dimension, error)
    call expect_none(error, "writing")
    call file%open(world, path, error)
    call file%read_attribute("/run", "version", text, error)
    call check_equal(text, "0.1.0", "version")
    call file%read_attribute("/run", "command", text, error)
    call check_equal(text, "gravier case.nml", "command")
    call file%read_attribute("/run", "input_text", text, error)
    call check_equal(text, input_text, "input text")
    call file%read_attribute("/run", "dimension", n, error)
    call check_equal(n, int(dimension, i8), "dimension")
    call check_equal(file%member_count("/steps"), 4, "number of steps")
    call check(.not. file%exists("/steps/0/contacts"), "no contacts unless asked for")
    call file%read_attribute("/steps/10", "step", n, error)
    call check_equal(n, 10_i8, "number of the step")
    call file%read_attribute("/steps/10", "time", time, error)
    call check_close(time, 0.01_dp, 0.0_dp, "time of the step")
    call file%row_count("/steps/20/bodies/position", n, error)
    call check_equal(n, 0_i8, "a step of no bodies")
    call check_unit(file, "/steps/10/bodies/position", "m")
    call check_unit(file, "/steps/10/bodies/velocity", "m/s, rad/s")
    call check_unit(file, "/steps/10/bodies/radius", "m")
    call check_unit(file, "/steps/10/contacts/gap", "m")
    call check_unit(file, "/steps/10/contacts/impulse", "N s")
    call expect_none(error, "reading attributes")
    call check_rows(file, dimension)
    call file%close(error)
    call expect_none(error, "closing")
  end subroutine test_content

  subroutine check_unit(file, dataset, unit)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: dataset, unit
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text

    call file%read_attribute(dataset, "unit", text, error)
    call check_equal(text, unit, "unit of "//dataset)
  end subroutine check_unit

  !> Every row is there, in the order of the ids.
  subroutine check_rows(file, dimension)
    type(h5_file_t), intent(in) :: file
    integer, intent(in) :: dimension
    type(error_t), allocatable :: error
    integer(i8) :: id(n_bodies), candidate(n_contacts), antagonist(n_contacts), wall(2)
    real(dp) :: position(dimension, n_bodies), velocity(3*(dimension - 1), n_bodies), radius(n_bodies)
    real(dp) :: normal(dimension, n_contacts), gap(n_contacts), impulse(dimension, n_contacts), point(dimension, 2)
    integer :: g, k

    id = 0
    wall = 0
    candidate = 0
    antagonist = 0
    call file%read_rows("/steps/10/bodies/id", 0_i8, id, error)
    call file%read_rows("/steps/10/bodies/position", 0_i8, position, error)
    call file%read_rows("/steps/10/bodies/velocity", 0_i8, velocity, error)
    call file%read_rows("/steps/10/bodies/radius", 0_i8, radius, error)
    call file%read_rows("/steps/10/contacts/candidate", 0_i8, candidate, error)
    call file%read_rows("/steps/10/contacts/antagonist", 0_i8, antagonist, error)
    call file%read_rows("/steps/10/contacts/normal", 0_i8, normal, error)
    call file%read_rows("/steps/10/contacts/gap", 0_i8, gap, error)
    call file%read_rows("/steps/10/contacts/impulse", 0_i8, impulse, error)
    call file%read_rows("/walls/id", 0_i8, wall, error)
    call file%read_rows("/walls/point", 0_i8, point, error)
    call check(all(wall == [1, 2]), "walls")
    call check_close(point(1, 2), 0.3_dp, 0.0_dp, "point of a wall")
    call expect_none(error, "reading rows")
    if (world%rank > 0) return
    do g = 1, n_bodies
      call check_equal(id(g), 3_i8*g + 100, "id")
      call check_close(radius(g), 1.0_dp/g, 0.0_dp, "radius")
      call check_close(position(dimension, g), g + 0.1_dp*dimension, 0.0_dp, "position")
      call check_close(velocity(size(velocity, 1), g), -g - 0.01_dp*size(velocity, 1), 0.0_dp, "velocity")
    end do
    do g = 1, n_contacts
      call check_equal(candidate(g), 3_i8*(g/3 + 1) + 100, "candidate")
      call check_equal(antagonist(g), 3_i8*(g/3 + 2 + mod(g, 3)) + 100, "antagonist")
      call check_close(gap(g), -1e-6_dp*g, 0.0_dp, "gap")
      do k = 1, dimension
        call check_close(normal(k, g), 0.5_dp*k + g, 0.0_dp, "normal")
        call check_close(impulse(k, g), 0.25_dp*k - g, 0.0_dp, "impulse")
      end do
    end do
  end subroutine check_rows

  !> The same scene written by 1, 2, ... ranks, more than a second apart, gives the same file byte by byte.
  subroutine test_any_rank_count()
    type(communicator_t) :: comm
    type(MPI_Comm) :: some
    type(error_t), allocatable :: error
    character(len=:), allocatable :: first, other
    integer :: p

    do p = 1, world%size
      call MPI_Comm_split(world%mpi, merge(0, MPI_UNDEFINED, world%rank < p), world%rank, some)
      if (some /= MPI_COMM_NULL) then
        call comm%init(some)
        call write_all(comm, path//"."//to_text(p), 3, error)
        call expect_none(error, "writing on some ranks")
        call comm%free()
        call MPI_Comm_free(some)
      end if
      call execute_command_line("sleep 1.1")
      call world%barrier()
    end do
    call write_all(world, path, 3, error)
    call expect_none(error, "writing again")
    if (world%rank > 0) return
    first = content(path//".1")
    do p = 2, world%size
      other = content(path//"."//to_text(p))
      call check(first == other .and. len(first) == len(other), "the file of 1 rank and of "//to_text(p))
    end do
    other = content(path)
    call check(first == other .and. len(first) == len(other), "the file written now and before")
  end subroutine test_any_rank_count

  subroutine test_refused()
    type(results_file_t) :: results
    type(error_t), allocatable :: error
    type(body_rows_t) :: bodies
    type(contact_rows_t) :: contacts
    type(h5_file_t) :: file
    real(dp) :: nan

    nan = ieee_value(1.0_dp, ieee_quiet_nan)
    call results%open(world, path, "0.1.0", "gravier case.nml", input_text, 2, error)
    call make_bodies(world, 2, bodies)
    call make_contacts(world, 2, contacts)
    where (bodies%id == 103 .or. bodies%id == 109) bodies%velocity(3, :) = nan
    call results%write_step(1, 0.5_dp, bodies, error, contacts)
    call expect(error, path//": /steps/1/bodies/velocity, row of id 103: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN in a velocity")
    call make_bodies(world, 2, bodies)
    where (bodies%id == 169) bodies%radius = ieee_value(1.0_dp, ieee_negative_inf)
    call results%write_step(1, 0.5_dp, bodies, error)
    call expect(error, path//": /steps/1/bodies/radius, row of id 169: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "infinity in a radius")
    call make_bodies(world, 2, bodies)
    where (contacts%candidate == 112) contacts%impulse(2, :) = nan
    call results%write_step(1, 0.5_dp, bodies, error, contacts)
    call expect(error, path//": /steps/1/contacts/impulse, row of id 112: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN in an impulse")
    call results%write_step(1, nan, bodies, error)
    call expect(error, path//": /steps/1, attribute time: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN as time")
    call results%write_step(1, 0.5_dp, bodies, error)
    call expect_none(error, "a step after refused ones")
    call results%write_step(1, 0.5_dp, bodies, error)
    call expect(error, path//": /steps/1: is in the file already", "a step twice")
    call results%close(error)
    call expect_none(error, "closing after refusals")
    call file%open(world, path, error)
    call check_equal(file%member_count("/steps"), 1, "one step in the file")
    call check(.not. file%exists("/steps/1/contacts"), "the step that was good")
    call file%close(error)
    call expect_none(error, "reading after refusals")
    call results%open(world, path//"/none.h5", "", "", "", 2, error)
    call expect(error, path//"/none.h5: cannot create this file: Not a directory", "no such directory")
  end subroutine test_refused

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

end program test_io_results_file
