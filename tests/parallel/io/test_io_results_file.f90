!> The results file: what is in it, that it tells neither the number of ranks nor the time, and what is refused.
program test_io_results_file
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_negative_inf
  use mpi_f08, only: MPI_Comm, MPI_Comm_split, MPI_Comm_free, MPI_UNDEFINED, MPI_COMM_NULL, operator(/=)
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_results_file, only: results_file_t, accuracy_t
  use gravier_run_provenance, only: provenance_t
  use gravier_test_results_rows, only: body_rows_t, contact_rows_t, boundary_rows_t, run_of, write_rows, write_boundaries
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_bodies = 23, n_contacts = 41
  character(len=20), parameter :: names(2) = [character(len=20) :: "floor", "tambour étroit"]
  character(len=9), parameter :: shapes(2) = [character(len=9) :: "plane", "circle"]
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
  call test_reopen()
  call test_restarts()
  call test_reopen_refused()
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

  subroutine expect(error, message, name, status)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: message, name
    integer, intent(in), optional :: status
    integer :: expected

    expected = status_failure
    if (present(status)) expected = status

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, expected, name//": status")
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
    type(boundary_rows_t) :: boundaries

    call make_bodies(comm, dimension, bodies)
    call make_contacts(comm, dimension, contacts)
    call make_boundaries(dimension, boundaries)
    call results%open(comm, name, run_of(input_text, dimension), error)
    call write_boundaries(results, boundaries%id, names, shapes, boundaries%normal, error)
    call write_rows(results, 0, 0.0_dp, bodies, error)
    call write_rows(results, 10, 0.01_dp, bodies, error, contacts, boundaries)
    call empty_step(results, dimension, error)
    call make_images(dimension, bodies)
    deallocate (boundaries%normal)
    call write_rows(results, 30, 0.03_dp, bodies, error, boundaries=boundaries, accuracy=accuracy_t(1.0e-3_dp, 2.0e-2_dp))
    call results%close(error)
  end subroutine write_all

  !> The body of id g has gone g - 110, 2 (g - 110), ... periods.
  subroutine make_images(dimension, bodies)
    integer, intent(in) :: dimension
    type(body_rows_t), intent(inout) :: bodies
    integer :: k

    allocate (bodies%image(dimension, size(bodies%id)))
    do k = 1, dimension
      bodies%image(k, :) = k*int(bodies%id - 110)
    end do
  end subroutine make_images

  !> Two boundaries of which only the first has a normal.
  subroutine make_boundaries(dimension, boundaries)
    integer, intent(in) :: dimension
    type(boundary_rows_t), intent(out) :: boundaries
    integer :: k

    boundaries%id = [1_i8, 2_i8]
    allocate (boundaries%normal(dimension, 2), source=0.0_dp)
    boundaries%normal(dimension, 1) = 1
    allocate (boundaries%position(dimension, 2), boundaries%velocity(3*(dimension - 1), 2), boundaries%force(dimension, 2))
    do k = 1, 2
      boundaries%position(:, k) = 0.1_dp*k
      boundaries%velocity(:, k) = 0.2_dp*k
      boundaries%force(:, k) = 0.3_dp*k
    end do
  end subroutine make_boundaries

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
    call write_rows(results, 20, 0.02_dp, bodies, error, contacts)
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
    call file%read_attribute("/steps/30", "velocity_error", time, error)
    call check_close(time, 1.0e-3_dp, 0.0_dp, "velocity error of the step")
    call file%read_attribute("/steps/30", "velocity_scale", time, error)
    call check_close(time, 2.0e-2_dp, 0.0_dp, "velocity scale of the step")
    call file%row_count("/steps/20/bodies/position", n, error)
    call check_equal(n, 0_i8, "a step of no bodies")
    call check_unit(file, "/steps/10/bodies/position", "m")
    call check_unit(file, "/steps/10/bodies/velocity", "m/s, rad/s")
    call check_unit(file, "/steps/10/bodies/radius", "m")
    call check_unit(file, "/steps/10/boundaries/position", "m")
    call check_unit(file, "/steps/10/boundaries/velocity", "m/s, rad/s")
    call check_unit(file, "/steps/10/boundaries/force", "N")
    call check_unit(file, "/steps/10/contacts/gap", "m")
    call check_unit(file, "/steps/10/contacts/impulse", "N s")
    call expect_none(error, "reading attributes")
    call check_rows(file, dimension)
    call check_boundaries(file, dimension)
    call check_images(file, dimension)
    call file%close(error)
    call check_texts()
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
    integer(i8) :: id(n_bodies), candidate(n_contacts), antagonist(n_contacts)
    real(dp) :: position(dimension, n_bodies), velocity(3*(dimension - 1), n_bodies), radius(n_bodies)
    real(dp) :: normal(dimension, n_contacts), gap(n_contacts), impulse(dimension, n_contacts)
    integer :: g, k

    id = 0
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

  subroutine check_boundaries(file, dimension, after)
    type(h5_file_t), intent(in) :: file
    integer, intent(in) :: dimension
    !> present: the last step was written again
    logical, intent(in), optional :: after
    type(error_t), allocatable :: error
    type(boundary_rows_t) :: expected, found

    call make_boundaries(dimension, expected)
    found = expected
    found%id = 0
    found%position = 0
    found%normal = 0
    found%velocity = 0
    found%force = 0
    call file%read_rows("/steps/10/boundaries/id", 0_i8, found%id, error)
    call file%read_rows("/steps/10/boundaries/position", 0_i8, found%position, error)
    call file%read_rows("/steps/10/boundaries/normal", 0_i8, found%normal, error)
    call file%read_rows("/steps/10/boundaries/velocity", 0_i8, found%velocity, error)
    call file%read_rows("/steps/10/boundaries/force", 0_i8, found%force, error)
    call expect_none(error, "reading boundaries")
    call check(all(found%id == expected%id), "ids of boundaries")
    call check(all(abs(found%position - expected%position) <= 0), "positions of boundaries")
    call check(all(abs(found%normal - expected%normal) <= 0), "normals of boundaries")
    call check(all(abs(found%velocity - expected%velocity) <= 0), "velocities of boundaries")
    call check(all(abs(found%force - expected%force) <= 0), "forces on boundaries")
    found%id = 0
    found%normal = 0
    call file%read_rows("/boundaries/id", 0_i8, found%id, error)
    call file%read_rows("/boundaries/normal", 0_i8, found%normal, error)
    call expect_none(error, "reading what boundaries are")
    call check(all(found%id == expected%id), "ids of all boundaries")
    call check(all(abs(found%normal - expected%normal) <= 0), "normals of all boundaries")
    call check(.not. file%exists("/steps/0/boundaries"), "no boundaries unless given")
    if (present(after)) return
    call check(file%exists("/steps/30/boundaries/force"), "boundaries without contacts")
    call check(.not. file%exists("/steps/30/boundaries/normal"), "no normals unless given")
  end subroutine check_boundaries

  subroutine check_images(file, dimension)
    type(h5_file_t), intent(in) :: file
    integer, intent(in) :: dimension
    type(error_t), allocatable :: error
    integer(i8) :: image(dimension, n_bodies)
    integer :: g, k

    image = 0
    call file%read_rows("/steps/30/bodies/image", 0_i8, image, error)
    call expect_none(error, "reading images")
    do g = 1, n_bodies
      do k = 1, dimension
        call check_equal(image(k, g), int(k*(3*g - 10), i8), "image")
      end do
    end do
    call check(.not. file%exists("/steps/10/bodies/image"), "no images unless given")
  end subroutine check_images

  !> The texts as h5py shows them.
  subroutine check_texts()
    character(len=1000) :: python
    integer :: stat

    call get_environment_variable("GRAVIER_PYTHON", python)
    if (world%rank > 0 .or. python == "") return
    call execute_command_line(trim(python)//" -c ""import h5py; f = h5py.File('"//path//"')['boundaries']; "// &
      & "assert list(f['name'].asstr()) == ['floor', 'tambour étroit'], list(f['name']); "// &
      & "assert list(f['shape'].asstr()) == ['plane', 'circle'], list(f['shape'])""", exitstat=stat)
    call check_equal(stat, 0, "names and shapes of boundaries in Python")
  end subroutine check_texts

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
    call results%open(world, path, run_of(input_text, 2), error)
    call make_bodies(world, 2, bodies)
    call make_contacts(world, 2, contacts)
    where (bodies%id == 103 .or. bodies%id == 109) bodies%velocity(3, :) = nan
    call write_rows(results, 1, 0.5_dp, bodies, error, contacts)
    call expect(error, path//": /steps/1/bodies/velocity, row of id 103: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN in a velocity")
    call make_bodies(world, 2, bodies)
    where (bodies%id == 169) bodies%radius = ieee_value(1.0_dp, ieee_negative_inf)
    call write_rows(results, 1, 0.5_dp, bodies, error)
    call expect(error, path//": /steps/1/bodies/radius, row of id 169: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "infinity in a radius")
    call make_bodies(world, 2, bodies)
    where (contacts%candidate == 112) contacts%impulse(2, :) = nan
    call write_rows(results, 1, 0.5_dp, bodies, error, contacts)
    call expect(error, path//": /steps/1/contacts/impulse, row of id 112: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN in an impulse")
    call write_rows(results, 1, nan, bodies, error)
    call expect(error, path//": /steps/1, attribute time: NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written", "NaN as time")
    call write_rows(results, 1, 0.5_dp, bodies, error, accuracy=accuracy_t(nan, 1.0_dp))
    call expect(error, path//": /steps/1, attribute velocity_error or velocity_scale: NaN or infinity, but finite numbers were "// &
      & "expected; nothing of it is written", "NaN as velocity error")
    call write_rows(results, 1, 0.5_dp, bodies, error)
    call expect_none(error, "a step after refused ones")
    call write_rows(results, 1, 0.5_dp, bodies, error)
    call expect(error, path//": /steps/1: is in the file already", "a step twice")
    call results%close(error)
    call expect_none(error, "closing after refusals")
    call file%open(world, path, error)
    call check_equal(file%member_count("/steps"), 1, "one step in the file")
    call check(.not. file%exists("/steps/1/contacts"), "the step that was good")
    call file%close(error)
    call expect_none(error, "reading after refusals")
    call results%open(world, path//"/none.h5", run_of("", 2), error)
    call expect(error, path//"/none.h5.part: cannot create this file: Not a directory", "no such directory")
  end subroutine test_refused

  !> Later steps go, earlier ones stay as they were, and the run can go on, as often as it likes.
  subroutine test_reopen()
    type(results_file_t) :: results
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    type(body_rows_t) :: bodies
    type(contact_rows_t) :: contacts
    type(boundary_rows_t) :: boundaries
    integer :: round, step

    call make_bodies(world, 3, bodies)
    call make_contacts(world, 3, contacts)
    call make_boundaries(3, boundaries)
    call write_all(world, path, 3, error)
    call results%reopen(world, path, 30, "bodies/radius", error)
    call results%close(error)
    call expect_none(error, "reopened for nothing")
    call check_steps([0, 10, 20, 30])
    call file%open(world, path, error)
    call check_images(file, 3)
    call file%close(error)
    do round = 1, 3
      call results%reopen(world, path, 19, "bodies/radius", error)
      call expect_none(error, "reopening")
      do step = 20, 500, 20
        call write_rows(results, step, 0.001_dp*step, bodies, error, contacts, boundaries)
      end do
      call results%close(error)
      call expect_none(error, "steps after reopening")
      call check_steps([0, 10, (step, step=20, 500, 20)])
      call file%open(world, path, error)
      call check_rows(file, 3)
      call check_boundaries(file, 3, after=.true.)
      call check_equal(n_rows(file, "/steps/20/contacts/gap"), int(n_contacts, i8), "contacts of a step written again")
      call file%close(error)
    end do
    call results%reopen(world, path, -1, "bodies/radius", error)
    call write_rows(results, 0, 0.0_dp, bodies, error)
    call results%close(error)
    call expect_none(error, "reopening from the start")
    call check_steps([0])
  end subroutine test_reopen

  !> What is run from a step on is kept until this step is made anew.
  subroutine test_restarts()
    type(results_file_t) :: results
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    type(provenance_t) :: run
    character(len=:), allocatable :: text

    call write_all(world, path, 3, error)
    run = run_of("&second /", 2)
    call check_equal(run%bytes(), 30_i8, "bytes of the three texts")
    call results%reopen(world, path, 20, "bodies/radius", error, run)
    call results%close(error)
    call results%reopen(world, path, 25, "bodies/radius", error, run_of("&third /", 2))
    call results%close(error)
    ! as of a restart without a step left
    call results%reopen(world, path, 30, "bodies/radius", error)
    call results%close(error)
    call expect_none(error, "restarts")
    call file%open(world, path, error)
    call check_equal(file%member_count("/run/restarts"), 2, "two restarts")
    call file%read_attribute("/run/restarts/21", "input_text", text, error)
    call check(text == "&second /", "the input of the first restart")
    call file%read_attribute("/run/restarts/26", "command", text, error)
    call check(text == "gravier case.nml", "the command of the second restart")
    call file%close(error)
    ! the first one once more, and steps before it
    call results%reopen(world, path, 20, "bodies/radius", error, run_of("&fourth /", 2))
    call results%close(error)
    call file%open(world, path, error)
    call check_equal(file%member_count("/run/restarts"), 1, "restarts from step 21 on are replaced")
    call file%read_attribute("/run/restarts/21", "input_text", text, error)
    call check(text == "&fourth /", "the input of the last restart")
    call file%close(error)
    call results%reopen(world, path, 5, "bodies/radius", error)
    call results%close(error)
    call file%open(world, path, error)
    call check_equal(file%member_count("/run/restarts"), 0, "no step of a restart is left")
    call file%close(error)
    call expect_none(error, "restarts that are replaced")
  end subroutine test_restarts

  integer(i8) function n_rows(file, dataset) result(n)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: dataset
    type(error_t), allocatable :: error
    call file%row_count(dataset, n, error)
  end function n_rows

  subroutine check_steps(steps)
    integer, intent(in) :: steps(:)
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    integer :: i

    call file%open(world, path, error)
    call expect_none(error, "reading steps")
    call check_equal(file%member_count("/steps"), size(steps), "number of steps")
    do i = 1, size(steps)
      call check_equal(n_rows(file, "/steps/"//to_text(steps(i))//"/bodies/radius"), int(n_bodies, i8)*merge(0, 1, &
        & steps(i) == 20 .and. size(steps) == 4), "bodies of step "//to_text(steps(i)))
    end do
    call file%close(error)
  end subroutine check_steps

  !> What cannot be gone on with ends in one line, and is left as it is.
  subroutine test_reopen_refused()
    type(results_file_t) :: results
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: whole
    integer :: i

    call results%reopen(world, path//".none", 3, "bodies/radius", error)
    call expect(error, path//".none: cannot read this file: No such file or directory", "no file", status_input)
    call put("a text")
    call results%reopen(world, path//".cut", 3, "bodies/radius", error)
    call expect(error, path//".cut: not an HDF5 file", "a text file", status_input)
    call write_all(world, path, 3, error)
    whole = content(path)
    do i = 1, 9
      call put(whole(1:i*(len(whole) - 1)/9))
      call results%reopen(world, path//".cut", 3, "bodies/radius", error)
      call expect(error, path//".cut: truncated or damaged HDF5 file", "a file cut short", status_input)
    end do
    call file%create(world, path//".cut", error)
    call file%close(error)
    call results%reopen(world, path//".cut", 3, "bodies/radius", error)
    call expect(error, path//".cut: /run: attribute dimension is missing or not one number of its kind", "another HDF5 file", &
      & status_input)
    call refuse_members("12x", '/steps: a member "12x", but numbers of steps were expected')
    call refuse_members("7", "/steps/7: attribute step is missing or not one number of its kind")
    call refuse_members("8", "/steps/8/bodies/radius: missing")
    call results%close(error)
    call expect_none(error, "closing what was refused")
  end subroutine test_reopen_refused

  !> A file with a group that is no step, or a step without its content.
  subroutine refuse_members(name, message)
    character(len=*), intent(in) :: name, message
    type(results_file_t) :: results
    type(h5_file_t) :: file
    type(error_t), allocatable :: error

    call file%create(world, path//".cut", error)
    call file%make_group("/run", error)
    call file%write_attribute("/run", "dimension", 2, error)
    call file%make_group("/steps/"//name, error)
    if (name == "8") call file%write_attribute("/steps/8", "step", 8, error)
    call file%close(error)
    call expect_none(error, "writing what is to be refused")
    call results%reopen(world, path//".cut", 30, "bodies/radius", error)
    call expect(error, path//".cut: "//message, "a strange step", status_input)
  end subroutine refuse_members

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit

    call world%barrier()
    if (world%rank == 0) then
      open (newunit=unit, file=path//".cut", access="stream", form="unformatted", action="write", status="replace")
      write (unit) text
      close (unit)
    end if
    call world%barrier()
  end subroutine put

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
