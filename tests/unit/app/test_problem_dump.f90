!> The contact problem of a step as it is written: M V = H r + f gives the velocities that the step has led to, in the order of the
!> identifiers, and u = H^T V + w and r obey the law of each contact, whatever is shared, prescribed or frictionless.
program test_problem_dump
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_sparse_rows, only: sparse_rows_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t, read_fclib
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_problem_dump, only: write_problem
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> solves end at a residual of 1e-12, of numbers of the order of one and less
  real(dp), parameter :: solved = 1.0e-10_dp
  character(len=*), parameter :: disks = "id,radius,mass,x,y,vx,vy,omega", spheres = "id,radius,mass,x,y,z,vx,vy,vz"
  !> a pile on a floor: two below with different masses, one between them, one beside that slides
  character(len=40), parameter :: pile(4) = [character(len=40) :: "30,0.1,2,0,0.1,0,0,0", "4,0.1,3,0.2,0.1,0,0,0", &
    & "17,0.1,1,0.1,0.27320508,0,-0.5,3", "2,0.1,1,0.4,0.1,-1,0,0"]
  character(len=40), parameter :: three_spheres(3) = [character(len=40) :: "3,0.1,2,0,0,0.1,0.5,0,-1", &
    & "2,0.1,1,0,0.12,0.26,0,0,-2", "1,0.1,4,0.2,0,0.1,-1,0,0"]
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_pile("friction = 0.5", "velocity = 0.25, 0.1", "", 0.5_dp)
  call test_pile("friction = 0.5, restitution = 0.5, tangential_restitution = 0.5", "velocity = 0.25, 0.1", "", 0.5_dp)
  call test_pile("friction = 0", "velocity = 0.25, 0.1", "", 0.0_dp)
  call test_pile("friction = 0.5", "velocity = 0.25, 0, free = F, T, mass = 16, force = 0, 80", "", 0.5_dp)
  call test_pile("friction = 0.5", "velocity = 0.25, 0.1", "&decomposition grid = 2, 1 /", 0.5_dp)
  call test_glued()
  call test_spheres("friction = 0.5", 0.5_dp)
  call test_spheres("friction = 0", 0.0_dp)
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Make a scene, one step of it, and write the problem of the step.
  subroutine make(header, rows, groups, simulation, problem)
    character(len=*), intent(in) :: header, rows(:)
    !> the groups of the input, from the keys of &scene on
    character(len=*), intent(in) :: groups
    type(simulation_t), intent(inout) :: simulation
    type(fclib_global_t), allocatable, intent(out) :: problem
    type(fclib_local_t), allocatable :: local
    type(step_figures_t) :: figures
    type(config_t) :: config
    type(error_t), allocatable :: error
    integer :: unit, k

    open (newunit=unit, file="bodies.csv", action="write", status="replace")
    write (unit, "(a)") header
    do k = 1, size(rows)
      write (unit, "(a)") trim(rows(k))
    end do
    close (unit)
    call parse_config("case", "&scene bodies = 'file', bodies_file = 'bodies.csv', start_overlap = 1, overlap_projection = F, "// &
      & "alert_distance = 0.05, "//groups//newline//"&time step = 0.01, steps = 1 /"//newline// &
      & "&solver method = 'nscdd', criterion = 'residual', tolerance = 1e-12, max_iterations = 100000 /", config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    if (.not. allocated(error)) call simulation%advance(figures, error)
    if (.not. allocated(error)) call write_problem(simulation, "problem.hdf5", error)
    if (.not. allocated(error)) call read_fclib(comm, "problem.hdf5", local, problem, error)
    call check(.not. allocated(error), "a problem is written and read")
    if (allocated(error)) print "(a)", error%message
    if (.not. allocated(problem)) call finish_checks()
    call check(figures%solve%residual <= 1.0e-12_dp, "the step is solved")
  end subroutine make

  !> Disks of a pile on a floor, in one subdomain or two.
  subroutine test_pile(keys, boundary, groups, friction)
    character(len=*), intent(in) :: keys, boundary, groups
    real(dp), intent(in) :: friction
    type(simulation_t) :: simulation
    type(fclib_global_t), allocatable :: problem
    real(dp), allocatable :: v(:)
    integer :: nv, b

    call make(disks, pile, "gravity = 0, -10, "//keys//" /"//newline//"&boundary shape = 'plane', point = 0, 0, normal = 0, 1, "// &
      & boundary//" /"//newline//groups, simulation, problem)
    nv = simulation%problem%nv
    call check_law(simulation, problem, friction, v)
    call check_equal(size(problem%mu), 7, "contacts of the pile: three with the floor, four of the disks")
    ! identifiers 2, 4, 17, 30; a floor that forces move comes behind them
    b = merge(5, 4, index(boundary, "free") > 0)
    call check_equal(size(v), b*nv, "unknowns: each body once")
    call check_velocity(simulation, 2, v(1:nv))
    call check_velocity(simulation, 4, v(nv + 1:2*nv))
    call check_velocity(simulation, 17, v(2*nv + 1:3*nv))
    call check_velocity(simulation, 30, v(3*nv + 1:4*nv))
    if (b == 5) call check_close(v(4*nv + 2), simulation%decomposition%boundaries(1)%velocity(2), solved, "velocity of the floor")
    if (b == 5) call check_close(v(4*nv + 1), 0.25_dp, 0.0_dp, "what is prescribed is as it is")
    if (b == 5) call check_equal(problem%h%start(4*nv + 2) - problem%h%start(4*nv + 1), 0, "and no contact acts on it")
    call simulation%free()
  end subroutine test_pile

  !> Disk 2 is glued to a group that forces move: it is the candidate of its contact with disk 4, and its body stands behind that
  !> of the disk.
  subroutine test_glued()
    type(simulation_t) :: simulation
    type(fclib_global_t), allocatable :: problem
    real(dp), allocatable :: v(:)
    character(len=42) :: rows(4)
    integer :: k

    do k = 1, 4
      rows(k) = trim(pile(k))//merge(",1", ",0", k == 4)
    end do
    call make(disks//",group", rows, "gravity = 0, -10, friction = 0.5 /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, normal = 0, 1, velocity = 0, 0.1 /"//newline// &
      & "&boundary shape = 'grains', group = 1, free = T, T, mass = 5, force = -300, -50 /", simulation, problem)
    call check_law(simulation, problem, 0.5_dp, v)
    call check_equal(size(v), 4*3, "unknowns of three disks and a group")
    call check_velocity(simulation, 4, v(1:3))
    call check_velocity(simulation, 17, v(4:6))
    call check_velocity(simulation, 30, v(7:9))
    call check_close(v(10), simulation%decomposition%boundaries(2)%velocity(1), solved, "velocity of the group along x")
    call check_close(v(11), simulation%decomposition%boundaries(2)%velocity(2), solved, "velocity of the group along y")
    call simulation%free()
  end subroutine test_glued

  !> Spheres on a floor and on each other.
  subroutine test_spheres(keys, friction)
    character(len=*), intent(in) :: keys
    real(dp), intent(in) :: friction
    type(simulation_t) :: simulation
    type(fclib_global_t), allocatable :: problem
    real(dp), allocatable :: v(:)
    integer :: nv

    call make(spheres, three_spheres, "dimension = 3, gravity = 0, 0, -10, "//keys//" /"//newline// &
      & "&boundary shape = 'plane', point = 0, 0, 0, normal = 0, 0, 1, velocity = 0.25, -0.5, 0.1 /", simulation, problem)
    nv = simulation%problem%nv
    call check_law(simulation, problem, friction, v)
    call check_equal(problem%dimension, 3, "dimension of space")
    call check_equal(size(v), 3*nv, "unknowns of three spheres")
    call check_velocity(simulation, 1, v(1:nv))
    call check_velocity(simulation, 2, v(nv + 1:2*nv))
    call check_velocity(simulation, 3, v(2*nv + 1:3*nv))
    call simulation%free()
  end subroutine test_spheres

  !> Velocity of a grain at the end of the step.
  subroutine check_velocity(simulation, id, v)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: id
    real(dp), intent(in) :: v(:)
    integer :: s, k, d, n

    n = 0
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) /= id) cycle
          n = n + 1
          do d = 1, size(v)
            call check_close(v(d), owned%velocity(d, k), solved, "V is the velocity of its grain")
          end do
        end do
      end associate
    end do
    call check_equal(n, 1, "the grain is there")
  end subroutine check_velocity

  !> V of M V = H r + f; Signorini's condition and Coulomb's law for u = H^T V + w.
  subroutine check_law(simulation, problem, friction, v)
    type(simulation_t), intent(in) :: simulation
    type(fclib_global_t), intent(in) :: problem
    real(dp), intent(in) :: friction
    real(dp), allocatable, intent(out) :: v(:)
    real(dp), allocatable :: u(:, :)
    real(dp) :: bound, slip
    integer :: nd, i, k, c, pushing, at_rest

    nd = problem%dimension
    allocate (v(problem%h%n_rows), u(nd, size(problem%mu)))
    v(:) = problem%f
    do c = 1, size(problem%mu)
      u(:, c) = problem%w((c - 1)*nd + 1:c*nd)
    end do
    do i = 1, problem%h%n_rows
      do k = problem%h%start(i), problem%h%start(i + 1) - 1
        v(i) = v(i) + problem%h%value(k)*problem%r(1 + mod(problem%h%column(k) - 1, nd), 1 + (problem%h%column(k) - 1)/nd)
      end do
      v(i) = v(i)/mass_of(problem%m, i)
    end do
    do i = 1, problem%h%n_rows
      do k = problem%h%start(i), problem%h%start(i + 1) - 1
        associate (d => 1 + mod(problem%h%column(k) - 1, nd), contact => 1 + (problem%h%column(k) - 1)/nd)
          u(d, contact) = u(d, contact) + problem%h%value(k)*v(i)
        end associate
      end do
    end do
    pushing = 0
    at_rest = 0
    do c = 1, size(problem%mu)
      call check_close(problem%mu(c), friction, 0.0_dp, "coefficient of friction")
      call check(u(1, c) >= -solved, "nothing approaches")
      call check_close(problem%r(1, c)*u(1, c), 0.0_dp, solved, "what parts does not push")
      bound = friction*problem%r(1, c)
      slip = norm2(u(2:, c))
      call check(norm2(problem%r(2:, c)) <= bound + solved, "friction is within its cone")
      ! on the cone, and against the slip
      call check_close(dot_product(problem%r(2:, c), u(2:, c)) + bound*slip, 0.0_dp, solved, "friction acts against the slip")
      if (problem%r(1, c) > 1.0e-6_dp) pushing = pushing + 1
      if (slip <= solved) at_rest = at_rest + 1
    end do
    call check(pushing > 1, "some contacts push")
    if (friction > 0.0_dp .and. nd == 2) call check(at_rest > 0, "some contacts stick")
    call check_equal(count(abs(problem%r(1, :)) > 0.0_dp), count_impulses(simulation), "the impulses are those of the step")
    call check_frames(simulation, problem)
    call check_solution(v, u)
    call check_order()
  end subroutine check_law

  !> The entries of H that act on the translation of a grain are a frame: unit vectors at right angles. Where a contact has two
  !> grains, that of one is opposite to that of the other. In the plane t is n turned to the left.
  subroutine check_frames(simulation, problem)
    type(simulation_t), intent(in) :: simulation
    type(fclib_global_t), intent(in) :: problem
    real(dp) :: frame(problem%dimension, problem%dimension), other(problem%dimension, problem%dimension), sides(2)
    integer :: nd, nv, c, b, i, n

    nd = problem%dimension
    nv = simulation%problem%nv
    do c = 1, size(problem%mu)
      n = 0
      other(:, :) = 0.0_dp
      do b = 1, int(simulation%n_grains)
        call take_frame(problem%h, (b - 1)*nv, (c - 1)*nd, frame)
        if (.not. any(abs(frame) > 0.0_dp)) cycle
        n = n + 1
        do i = 1, nd
          call check_close(norm2(frame(:, i)), 1.0_dp, solved, "a vector of a frame")
          call check_close(dot_product(frame(:, i), frame(:, 1 + mod(i, nd))), 0.0_dp, solved, "vectors of a frame")
        end do
        if (nd == 2) then
          sides(1) = frame(1, 1)*frame(2, 2)
          sides(2) = frame(2, 1)*frame(1, 2)
          call check_close(sides(1) - sides(2), 1.0_dp, solved, "t is n turned to the left")
        end if
        other(:, :) = other + frame
      end do
      call check(n > 0, "a contact acts on a grain")
      if (n == 2) call check_close(maxval(abs(other)), 0.0_dp, solved, "action and reaction")
    end do
  end subroutine check_frames

  !> A block of H.
  pure subroutine take_frame(h, row, column, frame)
    type(sparse_rows_t), intent(in) :: h
    !> before its first row and column
    integer, intent(in) :: row, column
    real(dp), intent(out) :: frame(:, :)
    integer :: i, k

    frame(:, :) = 0.0_dp
    do i = 1, size(frame, 1)
      do k = h%start(row + i), h%start(row + i + 1) - 1
        associate (d => h%column(k) - column)
          if (d >= 1 .and. d <= size(frame, 2)) frame(i, d) = h%value(k)
        end associate
      end do
    end do
  end subroutine take_frame

  !> The velocities of the solution in the file are those of its equations.
  subroutine check_solution(v, u)
    real(dp), intent(in) :: v(:), u(:, :)
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    real(dp), allocatable :: bodies(:), contacts(:)
    integer :: c, d

    allocate (bodies(size(v)), contacts(size(u)), source=-huge(1.0_dp))
    call file%open(comm, "problem.hdf5", error)
    call file%read_rows("/solution/v", 0_i8, bodies, error)
    call file%read_rows("/solution/u", 0_i8, contacts, error)
    call check(.not. allocated(error), "velocities in the file")
    call file%leave()
    call check_close(maxval(abs(bodies - v)), 0.0_dp, solved, "velocities of the bodies in the file")
    do c = 1, size(u, 2)
      do d = 1, size(u, 1)
        call check_close(contacts((c - 1)*size(u, 1) + d), u(d, c), solved, "velocities of the contacts in the file")
      end do
    end do
  end subroutine check_solution

  !> The entries of a column of H stand in the order of their rows.
  subroutine check_order()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    integer(i8), allocatable :: start(:), row(:)
    integer(i8) :: n
    integer :: c, k
    logical :: ordered

    call file%open(comm, "problem.hdf5", error)
    call file%row_count("/fclib_global/H/p", n, error)
    allocate (start(n), source=0_i8)
    call file%read_rows("/fclib_global/H/p", 0_i8, start, error)
    allocate (row(start(n)), source=0_i8)
    call file%read_rows("/fclib_global/H/i", 0_i8, row, error)
    call check(.not. allocated(error), "rows of H in the file")
    call file%leave()
    ordered = .true.
    do c = 1, size(start) - 1
      do k = int(start(c)) + 2, int(start(c + 1))
        ordered = ordered .and. row(k - 1) < row(k)
      end do
    end do
    call check(ordered, "rows of a column in their order")
  end subroutine check_order

  !> The diagonal entry of a row of M, which is its only one.
  real(dp) function mass_of(m, i) result(mass)
    type(sparse_rows_t), intent(in) :: m
    integer, intent(in) :: i

    call check_equal(m%start(i + 1) - m%start(i), 1, "M is diagonal")
    mass = m%value(m%start(i))
  end function mass_of

  !> Contacts with a normal impulse.
  integer function count_impulses(simulation) result(n)
    type(simulation_t), intent(in) :: simulation
    integer :: s

    n = 0
    do s = 1, size(simulation%problem%sub)
      n = n + count(abs(simulation%problem%sub(s)%impulse(:, 1, :)) > 0.0_dp)
    end do
  end function count_impulses

end program test_problem_dump
