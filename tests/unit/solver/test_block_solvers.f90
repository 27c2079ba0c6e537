!> Contact problems with full blocks whose solutions are chosen beforehand: sweeps, Newton's method and their linear systems find
!> them; elimination of bodies and constraints against the equations that it starts from.
program test_block_solvers
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, no_columns
  use gravier_communicator, only: communicator_t
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t, read_fclib
  use gravier_fclib_writer, only: write_fclib_local
  use gravier_condensation, only: multipliers_t, condense, eliminate_constraints
  use gravier_delassus, only: delassus_t
  use gravier_unbounded, only: growth_t, growth_none
  use gravier_block_system, only: block_system_t
  use gravier_block_sweeps, only: sweep_control_t, sweep_blocks, solve_by_sweeps
  use gravier_contact_newton, only: contact_newton_t, newton_control_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  integer, parameter :: opens = 0, sticks = 1, slips = 2

  call MPI_Init()
  call check_first_sweep()
  call check_momentum()
  call check_solvers(2, 9)
  call check_solvers(3, 9)
  call check_system(2, 12)
  ! orders 162 and more have sparse factors
  call check_system(3, 54)
  call check_condensation(.false.)
  call check_condensation(.true.)
  call check_elimination()
  call check_fclib()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A number in (-1, 1).
  pure real(dp) function draw(seed, k)
    integer, intent(in) :: seed, k
    draw = 2*hash_uniform(seed, int(k, i8), 1) - 1.0_dp
  end function draw

  pure function dense_matrix(seed, n, m) result(a)
    integer, intent(in) :: seed, n, m
    real(dp) :: a(n, m)
    integer :: i, j

    do j = 1, m
      do i = 1, n
        a(i, j) = draw(seed, i + n*(j - 1))
      end do
    end do
  end function dense_matrix

  !> y = y + A x.
  pure subroutine add_product(a, x, y)
    real(dp), intent(in), contiguous :: a(:, :), x(:)
    real(dp), intent(inout), contiguous :: y(:)
    integer :: i, j

    do j = 1, size(a, 2)
      do i = 1, size(a, 1)
        y(i) = y(i) + a(i, j)*x(j)
      end do
    end do
  end subroutine add_product

  !> y = y + A^T x.
  pure subroutine add_transposed(a, x, y)
    real(dp), intent(in), contiguous :: a(:, :), x(:)
    real(dp), intent(inout), contiguous :: y(:)
    integer :: i, j

    do j = 1, size(a, 2)
      do i = 1, size(a, 1)
        y(j) = y(j) + a(i, j)*x(i)
      end do
    end do
  end subroutine add_transposed

  !> y = y + A x.
  pure subroutine add_sparse(a, x, y)
    type(sparse_rows_t), intent(in) :: a
    real(dp), intent(in), contiguous :: x(:)
    real(dp), intent(inout), contiguous :: y(:)
    integer :: i, k

    do i = 1, a%n_rows
      do k = a%start(i), a%start(i + 1) - 1
        y(i) = y(i) + a%value(k)*x(a%column(k))
      end do
    end do
  end subroutine add_sparse

  !> Columns one after the other, times a factor.
  pure subroutine flatten(columns, factor, flat)
    real(dp), intent(in), contiguous :: columns(:, :)
    real(dp), intent(in) :: factor
    real(dp), intent(out), contiguous :: flat(:)
    integer :: j, n

    n = size(columns, 1)
    do j = 1, size(columns, 2)
      flat((j - 1)*n + 1:j*n) = factor*columns(:, j)
    end do
  end subroutine flatten

  !> Put a block that is given by columns into row i and column j of blocks of order d.
  pure subroutine put_block(block, d, i, j, dense)
    real(dp), intent(in), contiguous :: block(:)
    integer, intent(in) :: d, i, j
    real(dp), intent(inout), contiguous :: dense(:, :)
    integer :: k, l

    do l = 1, d
      do k = 1, d
        dense((i - 1)*d + k, (j - 1)*d + l) = block(k + (l - 1)*d)
      end do
    end do
  end subroutine put_block

  function sparse(a) result(matrix)
    real(dp), intent(in) :: a(:, :)
    type(sparse_rows_t) :: matrix
    integer :: i, j, n, row(size(a)), column(size(a))
    real(dp) :: value(size(a))

    n = 0
    do i = 1, size(a, 1)
      do j = 1, size(a, 2)
        if (.not. abs(a(i, j)) > 0.0_dp) cycle
        n = n + 1
        row(n) = i
        column(n) = j
        value(n) = a(i, j)
      end do
    end do
    matrix = compressed_rows(size(a, 1), size(a, 2), row(1:n), column(1:n), value(1:n))
  end function sparse

  !> One sweep over two contacts without friction, by hand: r_1 = 2/2, r_2 = (3 - r_1)/2.
  subroutine check_first_sweep()
    type(delassus_t) :: problem
    type(error_t), allocatable :: error
    type(sweep_control_t) :: control
    type(growth_t) :: growth
    real(dp) :: w(4, 4), r(2, 2), moved, figure
    integer :: k, sweeps

    w(:, :) = 0.0_dp
    do k = 1, 4
      w(k, k) = 2.0_dp
    end do
    w(1, 3) = 1.0_dp
    w(3, 1) = 1.0_dp
    call problem%init(2, sparse(w), [-2.0_dp, 5.0_dp, -3.0_dp, 1.0_dp], [0.0_dp, 0.0_dp], error)
    call check(.not. allocated(error), "problem of two contacts")
    r(:, :) = 0.0_dp
    call sweep_blocks(problem, r, moved)
    call check_close(r(1, 1), 1.0_dp, 1.0e-15_dp, "the first contact of a sweep")
    call check_close(r(1, 2), 1.0_dp, 1.0e-15_dp, "the second one sees it")
    call check_close(maxval(abs(r(2, :))), 0.0_dp, 0.0_dp, "no friction")
    call check_close(moved, sqrt(8.0_dp/39.0_dp), 1.0e-14_dp, "what it has moved: |s dr|/|q|")
    control%acceleration = .true.
    control%tolerance = 1.0e-13_dp
    call solve_by_sweeps(problem, control, r, sweeps, figure, growth)
    call check_close(r(1, 1), 1.0_dp/3.0_dp, 1.0e-11_dp, "2 r_1 + r_2 = 2")
    call check_close(r(1, 2), 4.0_dp/3.0_dp, 1.0e-11_dp, "r_1 + 2 r_2 = 3")
    control%most_sweeps = 3
    r(:, :) = 0.0_dp
    call solve_by_sweeps(problem, control, r, sweeps, figure, growth)
    call check_equal(sweeps, 3, "no more sweeps than allowed")
  end subroutine check_first_sweep

  !> A column of equal bodies, W_nn = 2 and -1 between neighbours: sweeps carry a change one contact further each and take a number
  !> in proportion to the square of their number, with momentum one in proportion to their number.
  subroutine check_momentum()
    integer, parameter :: n = 60
    type(delassus_t) :: problem
    type(error_t), allocatable :: error
    type(sweep_control_t) :: control
    type(growth_t) :: growth
    real(dp), allocatable :: w(:, :)
    real(dp) :: r(2, n), expected(2, n), q(2*n), flat(2*n), mu(n), figure
    integer :: k, sweeps(2)

    allocate (w(2*n, 2*n), source=0.0_dp)
    expected(:, :) = 0.0_dp
    mu(:) = 0.0_dp
    do k = 1, n
      w(2*k - 1, 2*k - 1) = merge(1.0_dp, 2.0_dp, k == 1)
      w(2*k, 2*k) = 2.0_dp
      expected(1, k) = real(n + 1 - k, dp)
    end do
    do k = 2, n
      w(2*k - 3, 2*k - 1) = -1.0_dp
      w(2*k - 1, 2*k - 3) = -1.0_dp
    end do
    call flatten(expected, -1.0_dp, flat)
    q(:) = 0.0_dp
    call add_product(w, flat, q)
    call problem%init(2, sparse(w), q, mu, error)
    call check(.not. allocated(error), "problem of a column")
    control%tolerance = 1.0e-10_dp
    do k = 1, 2
      control%acceleration = k == 2
      r(:, :) = 0.0_dp
      call solve_by_sweeps(problem, control, r, sweeps(k), figure, growth)
      ! the smallest eigenvalue of W is (pi/(2 n))^2
      call check_close(maxval(abs(r - expected)), 0.0_dp, 1.0e-6_dp, "impulses of a column")
    end do
    call check(sweeps(2) < sweeps(1)/5, "momentum takes a small part of the sweeps")
  end subroutine check_momentum

  !> Contacts that open, stick and slip in turn: impulses and velocities are chosen, and q = v - W r. Couplings are weak against the
  !> blocks on the diagonal, so that there is one solution.
  subroutine make_problem(dimension, n, problem, w, r)
    integer, intent(in) :: dimension, n
    type(delassus_t), intent(inout) :: problem
    real(dp), allocatable, intent(out) :: w(:, :), r(:, :)
    type(error_t), allocatable :: error
    real(dp) :: v(dimension, n), way(dimension - 1), mu(n), flat(dimension*n), q(dimension*n)
    integer :: a, k

    w = dense_matrix(dimension, dimension*n, dimension*n)
    do a = 1, size(w, 1)
      do k = 1, a
        w(k, a) = 0.02_dp*(w(k, a) + w(a, k))
        w(a, k) = w(k, a)
      end do
    end do
    ! contacts that are far apart are not coupled
    do a = 1, n - 4
      w((a + 3)*dimension + 1:, (a - 1)*dimension + 1:a*dimension) = 0.0_dp
      w((a - 1)*dimension + 1:a*dimension, (a + 3)*dimension + 1:) = 0.0_dp
    end do
    do k = 1, dimension*n
      w(k, k) = w(k, k) + 1.0_dp + 0.3_dp*abs(draw(7, k))
    end do
    allocate (r(dimension, n))
    v(:, :) = 0.0_dp
    r(:, :) = 0.0_dp
    do a = 1, n
      mu(a) = 0.2_dp + 0.1_dp*abs(draw(8, a))
      do k = 1, dimension - 1
        way(k) = draw(9, 3*a + k)
      end do
      way(:) = way/norm2(way)
      select case (mod(a, 3))
      case (opens)
        v(1, a) = 0.5_dp
        v(2:, a) = 0.3_dp*way
      case (sticks)
        r(1, a) = 1.0_dp + abs(draw(10, a))
        r(2:, a) = 0.5_dp*mu(a)*r(1, a)*way
      case (slips)
        r(1, a) = 1.0_dp + abs(draw(10, a))
        r(2:, a) = mu(a)*r(1, a)*way
        v(2:, a) = -0.4_dp*way
      end select
    end do
    call flatten(r, -1.0_dp, flat)
    call flatten(v, 1.0_dp, q)
    call add_product(w, flat, q)
    call problem%init(dimension, sparse(w), q, mu, error)
    call check(.not. allocated(error), "problem with a chosen solution")
  end subroutine make_problem

  !> Sweeps, plain and with momentum, and Newton's method find the chosen impulses.
  subroutine check_solvers(dimension, n)
    integer, intent(in) :: dimension, n
    type(delassus_t) :: problem
    type(error_t), allocatable :: error
    type(sweep_control_t) :: control
    type(contact_newton_t) :: newton
    type(growth_t) :: growth
    real(dp), allocatable :: w(:, :), expected(:, :), r(:, :)
    real(dp) :: figure
    integer :: k, sweeps, steps

    call make_problem(dimension, n, problem, w, expected)
    allocate (r, mold=expected)
    control%tolerance = 1.0e-13_dp
    do k = 1, 2
      r(:, :) = 0.0_dp
      control%acceleration = k == 2
      call solve_by_sweeps(problem, control, r, sweeps, figure, growth)
      call check(figure <= control%tolerance, "sweeps reach their tolerance")
      call check_close(maxval(abs(r - expected)), 0.0_dp, 1.0e-11_dp, "sweeps find the impulses")
      call check_equal(growth%kind, growth_none, "no growth")
      call check(sweeps < 16, "in few sweeps: couplings are a tenth of the diagonal")
    end do
    r(:, :) = 0.0_dp
    growth = growth_t()
    call newton%init(problem, error)
    call newton%solve(problem, newton_control_t(tolerance=1.0e-13_dp, most_steps=300), r, steps, figure, growth)
    call check(.not. allocated(error), "Newton's method")
    call check_close(maxval(abs(r - expected)), 0.0_dp, 1.0e-11_dp, "Newton's method finds the impulses")
    call check(steps < 7, "in few steps")
    call newton%solve(problem, newton_control_t(tolerance=1.0e-12_dp, most_steps=300), r, steps, figure, growth)
    call check_equal(steps, 0, "a solution takes no step")
    call newton%free()
  end subroutine check_solvers

  !> A system of general blocks against its product with the solution.
  subroutine check_system(dimension, n)
    integer, intent(in) :: dimension, n
    type(delassus_t) :: problem
    type(block_system_t) :: system
    type(error_t), allocatable :: error
    real(dp), allocatable :: w(:, :), r(:, :), own(:, :), coupling(:, :), dense(:, :), x(:, :), b(:, :)
    real(dp) :: flat(dimension*n), rest(dimension*n)
    integer :: a, c, k, d
    logical :: regular

    d = dimension
    call make_problem(d, n, problem, w, r)
    own = dense_matrix(21, d**2, n)
    coupling = dense_matrix(22, d**2, size(problem%other))
    coupling(:, :) = 0.1_dp*coupling
    allocate (dense(d*n, d*n), source=0.0_dp)
    do a = 1, n
      do k = 1, d
        own(1 + (k - 1)*(d + 1), a) = own(1 + (k - 1)*(d + 1), a) + 4.0_dp
      end do
      call put_block(own(:, a), d, a, a, dense)
      do k = problem%first(a), problem%first(a + 1) - 1
        c = problem%other(k)
        call put_block(coupling(:, k), d, a, c, dense)
      end do
    end do
    b = dense_matrix(23, d, n)
    x = b
    call system%init(problem, error)
    call check(.not. allocated(error), "linear system")
    call system%solve(own, coupling, x, regular)
    call check(regular, "a regular system")
    call flatten(x, 1.0_dp, flat)
    call flatten(b, -1.0_dp, rest)
    call add_product(dense, flat, rest)
    call check_close(maxval(abs(rest)), 0.0_dp, 1.0e-12_dp, "its solution")
    own(:, 1) = 0.0_dp
    coupling(:, problem%first(1):problem%first(2) - 1) = 0.0_dp
    x = b
    call system%solve(own, coupling, x, regular)
    call check(.not. regular, "rows of zeros are no regular system")
    call system%free()
  end subroutine check_system

  !> For any impulses r the eliminated problem says v = W r + q and l. With M diagonal, V = M^-1 (H r + G l + f) must satisfy
  !> G^T V + b = 0 and v = H^T V + w. With `without`, there are no constraints.
  subroutine check_condensation(without)
    logical, intent(in) :: without
    integer, parameter :: n = 6, contacts = 2, m = 3*contacts
    type(fclib_global_t) :: global
    type(fclib_local_t) :: local
    type(multipliers_t) :: multipliers
    type(error_t), allocatable :: error
    real(dp) :: h(n, m), mass(n, n), v(m), big_v(n), minus(n), impulses(3, contacts), r(m)
    real(dp), allocatable :: g(:, :), l(:)
    integer :: k, p

    p = merge(0, 2, without)
    h = dense_matrix(31, n, m)
    allocate (g(n, p))
    g(:, :) = dense_matrix(32, n, p)
    mass(:, :) = 0.0_dp
    do k = 1, n
      mass(k, k) = 1.5_dp + draw(33, k)
    end do
    global%dimension = 3
    global%m = sparse(mass)
    global%h = sparse(h)
    global%g = sparse(g)
    allocate (global%f(n), global%b(p), global%w(m), global%mu(contacts))
    do k = 1, n
      global%f(k) = draw(34, k)
    end do
    do k = 1, p
      global%b(k) = draw(35, k)
    end do
    do k = 1, m
      global%w(k) = draw(36, k)
      r(k) = draw(37, k)
    end do
    do k = 1, contacts
      impulses(:, k) = r(3*k - 2:3*k)
    end do
    global%mu(:) = [0.3_dp, 0.7_dp]
    call condense(global, local, multipliers, error)
    call check(.not. allocated(error), "elimination of bodies")
    call multipliers%evaluate(impulses, l)
    call check_equal(size(l), p, "multipliers")
    big_v = global%f
    call add_product(h, r, big_v)
    call add_product(g, l, big_v)
    do k = 1, n
      big_v(k) = big_v(k)/mass(k, k)
    end do
    v(:) = local%q - global%w
    call add_sparse(local%w, r, v)
    minus(:) = -big_v
    call add_transposed(h, minus, v)
    call check_close(maxval(abs(v)), 0.0_dp, 1.0e-12_dp, "v = H^T V + w")
    call check_close(maxval(abs(local%mu - [0.3_dp, 0.7_dp])), 0.0_dp, 0.0_dp, "friction stays")
    if (p == 0) return
    call add_transposed(g, big_v, global%b)
    call check_close(maxval(abs(global%b)), 0.0_dp, 1.0e-12_dp, "G^T V + b = 0")
    g(:, 2) = g(:, 1)
    global%g = sparse(g)
    call condense(global, local, multipliers, error)
    call check(allocated(error), "constraints that say the same twice are refused")
  end subroutine check_condensation

  !> For any impulses, with the multipliers l that are found, V^T r + R l + s = 0, and v = W r + V l + q is what the eliminated
  !> problem says.
  subroutine check_elimination()
    integer, parameter :: m = 4, p = 2
    type(fclib_local_t) :: local
    type(multipliers_t) :: multipliers
    type(error_t), allocatable :: error
    real(dp) :: w(m, m), v(m, p), r_matrix(p, p), q(m), r(m), velocity(m), impulses(2, 2), rest(p)
    real(dp), allocatable :: l(:)
    integer :: k

    w = dense_matrix(41, m, m)
    v = dense_matrix(42, m, p)
    r_matrix = dense_matrix(43, p, p)
    do k = 1, m
      q(k) = draw(44, k)
      r(k) = draw(45, k)
    end do
    local%dimension = 2
    local%w = sparse(w)
    local%coupling = sparse(v)
    local%constraint = sparse(r_matrix)
    local%q = q
    local%s = [0.4_dp, -0.9_dp]
    local%mu = [0.1_dp, 0.2_dp]
    call eliminate_constraints(local, multipliers, error)
    call check(.not. allocated(error), "elimination of constraints")
    impulses(:, 1) = r(1:2)
    impulses(:, 2) = r(3:4)
    call multipliers%evaluate(impulses, l)
    rest(:) = [0.4_dp, -0.9_dp]
    call add_transposed(v, r, rest)
    call add_product(r_matrix, l, rest)
    call check_close(maxval(abs(rest)), 0.0_dp, 1.0e-12_dp, "V^T r + R l + s = 0")
    ! W r + V l + q less what the eliminated problem says
    velocity(:) = local%q
    call add_sparse(local%w, r, velocity)
    velocity(:) = q - velocity
    call add_product(w, r, velocity)
    call add_product(v, l, velocity)
    call check_close(maxval(abs(velocity)), 0.0_dp, 1.0e-12_dp, "v = W r + V l + q")
  end subroutine check_elimination

  !> A problem that is written is read again as it was.
  subroutine check_fclib()
    type(communicator_t) :: comm
    type(fclib_local_t) :: local
    type(fclib_local_t), allocatable :: again
    type(fclib_global_t), allocatable :: global
    type(error_t), allocatable :: error
    real(dp) :: w(4, 4), x(4), y(4)
    integer :: k

    call comm%init()
    w = dense_matrix(51, 4, 4)
    local%dimension = 2
    local%w = sparse(w)
    local%coupling = no_columns(4)
    local%constraint = no_columns(0)
    local%q = [1.0_dp, -2.0_dp, 3.0_dp, -4.0_dp]
    allocate (local%s(0))
    local%mu = [0.25_dp, 0.5_dp]
    local%r = reshape([0.1_dp, 0.2_dp, 0.3_dp, 0.4_dp], [2, 2])
    call write_fclib_local(comm, "problem.hdf5", local, error)
    call read_fclib(comm, "problem.hdf5", again, global, error)
    call check(.not. allocated(error), "a problem is written and read")
    call check(allocated(again) .and. .not. allocated(global), "it is a local one")
    if (allocated(error)) print "(a)", error%message
    if (.not. allocated(again)) return
    call check_equal(again%dimension, 2, "its dimension")
    call check_close(maxval(abs(again%q - local%q)), 0.0_dp, 0.0_dp, "q")
    call check_close(maxval(abs(again%mu - local%mu)), 0.0_dp, 0.0_dp, "mu")
    do k = 1, 4
      x(:) = 0.0_dp
      x(k) = 1.0_dp
      y(:) = -w(:, k)
      call add_sparse(again%w, x, y)
      call check_close(maxval(abs(y)), 0.0_dp, 0.0_dp, "a column of W")
    end do
    call check(allocated(again%r), "it has a solution")
    if (allocated(again%r)) call check_close(maxval(abs(again%r - local%r)), 0.0_dp, 0.0_dp, "its impulses")
    call comm%free()
  end subroutine check_fclib

end program test_block_solvers
