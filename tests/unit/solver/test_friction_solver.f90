!> Packed contact problems with full blocks: evaluation, measures, and every method on a stack of boxes, whose contacts are more
!> than its bodies can tell apart, and on random problems; problems without a solution.
program test_friction_solver
  use, intrinsic :: ieee_arithmetic, only: ieee_get_halting_mode, ieee_invalid, ieee_quiet_nan, ieee_set_flag, &
    & ieee_set_halting_mode, ieee_value
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows
  use gravier_random_hash, only: hash_uniform
  use gravier_delassus, only: delassus_t, most_impulse
  use gravier_unbounded, only: growth_t, growth_none, growth_marked, growth_proven, find_growth, note_growth
  use gravier_alart_curnier, only: alart_curnier_t
  use gravier_friction_solver, only: friction_control_t, friction_methods, friction_report_t, solve_friction, &
    & verdict_solved, verdict_not_converged, verdict_no_solution
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: gravity = 10.0_dp, step = 0.01_dp, mass = 2.0_dp
  ! a higher stack topples on the slopes below
  integer, parameter :: boxes = 3

  call MPI_Init()
  call check_packing()
  call check_units()
  call check_jacobian(2)
  call check_jacobian(3)
  call check_stack(0.2_dp, 0.3_dp)
  call check_stack(0.5_dp, 0.3_dp)
  call check_turns()
  call check_best_is_kept()
  call check_start_is_kept()
  call check_mass_on_a_wire()
  call check_random(2, 24)
  call check_random(3, 24)
  ! beyond the order of dense factors
  call check_random(3, 60)
  call check_growth()
  call check_marks()
  call check_no_solution()
  call check_huge_impulses()
  call check_approach()
  call check_refusals()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Unit cubes one on the other on a plane that rises by the angle whose tangent is `slope`: four contacts at the corners of
  !> each face, of frame n = z, t = x, s = y, W and q from the bodies.
  subroutine make_stack(slope, friction, between, problem)
    !> between: friction of the boxes on each other
    real(dp), intent(in) :: slope, friction, between
    type(delassus_t), intent(inout) :: problem
    real(dp) :: h(6*boxes, 12*boxes), w(12*boxes, 12*boxes), free(6*boxes), q(12*boxes), mu(4*boxes)
    real(dp) :: corner(3)
    integer :: b, c, k

    h = 0.0_dp
    free = 0.0_dp
    do b = 1, boxes
      free(6*b - 5) = step*gravity*slope/sqrt(1.0_dp + slope**2)
      free(6*b - 3) = -step*gravity/sqrt(1.0_dp + slope**2)
      do c = 1, 4
        k = 12*(b - 1) + 3*(c - 1)
        corner(1) = merge(0.5_dp, -0.5_dp, c <= 2)
        corner(2) = merge(0.5_dp, -0.5_dp, mod(c, 2) == 0)
        corner(3) = -0.5_dp
        call add_wrench(h(6*b - 5:6*b, k + 1:k + 3), corner, 1.0_dp)
        corner(3) = 0.5_dp
        if (b > 1) call add_wrench(h(6*b - 11:6*b - 6, k + 1:k + 3), corner, -1.0_dp)
      end do
    end do
    mu = between
    mu(1:4) = friction
    ! the inertia of a cube of side 1 is m/6
    w = 0.0_dp
    do k = 1, size(w, 2)
      do c = 1, size(w, 1)
        do b = 1, size(h, 1)
          w(c, k) = w(c, k) + h(b, c)*h(b, k)*merge(1.0_dp, 6.0_dp, mod(b - 1, 6) < 3)/mass
        end do
      end do
    end do
    do c = 1, size(q)
      q(c) = sum(h(:, c)*free)
    end do
    call pack(3, w, q, mu, problem)
  end subroutine make_stack

  !> Force along z, x and y, and its moment, at a point.
  subroutine add_wrench(h, at, sign)
    real(dp), intent(inout) :: h(:, :)
    real(dp), intent(in) :: at(3), sign
    real(dp) :: along(3)
    integer :: i

    do i = 1, 3
      along = 0.0_dp
      along(1 + mod(i + 1, 3)) = sign
      h(1:3, i) = along
      h(4, i) = at(2)*along(3) - at(3)*along(2)
      h(5, i) = at(3)*along(1) - at(1)*along(3)
      h(6, i) = at(1)*along(2) - at(2)*along(1)
    end do
  end subroutine add_wrench

  !> Hand a full matrix over row by row.
  subroutine pack(dimension, w, q, mu, problem)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: w(:, :)
    real(dp), intent(in), contiguous :: q(:), mu(:)
    type(delassus_t), intent(inout) :: problem
    type(error_t), allocatable :: error
    type(sparse_rows_t) :: rows
    integer :: row(size(w)), column(size(w)), i, j, k
    real(dp) :: value(size(w))

    k = 0
    do j = 1, size(w, 2)
      do i = 1, size(w, 1)
        k = k + 1
        row(k) = i
        column(k) = j
        value(k) = w(i, j)
      end do
    end do
    rows = compressed_rows(size(w, 1), size(w, 2), row, column, value)
    call problem%init(dimension, rows, q, mu, error)
    call check(.not. allocated(error), "a problem of contacts is packed")
  end subroutine pack

  !> W = A A^T of more columns than rows where `surplus` > 0, of deficient rank where it is < 0, and slightly skew.
  subroutine make_random(seed, dimension, contacts, surplus, skew, problem)
    integer, intent(in) :: seed, dimension, contacts, surplus
    real(dp), intent(in) :: skew
    type(delassus_t), intent(inout) :: problem
    real(dp) :: a(dimension*contacts, dimension*contacts + surplus), w(dimension*contacts, dimension*contacts)
    real(dp) :: q(dimension*contacts), mu(contacts), v(size(a, 2))
    integer :: i, j, n

    n = dimension*contacts
    do j = 1, size(a, 2)
      v(j) = hash_uniform(seed, int(j, i8), 1) - 0.5_dp
      do i = 1, n
        a(i, j) = hash_uniform(seed, int(i + n*j, i8), 2) - 0.5_dp
      end do
    end do
    w = matmul(a, transpose(a))
    ! velocities that bodies have: the problem has a solution
    q = matmul(a, v)
    do i = 1, n - 1
      w(i, i + 1) = w(i, i + 1) + skew*w(i, i)
      w(i + 1, i) = w(i + 1, i) - skew*w(i, i)
    end do
    do i = 1, contacts
      mu(i) = hash_uniform(seed, int(i, i8), 3)
    end do
    call pack(dimension, w, q, mu, problem)
  end subroutine make_random

  !> v = W r + q of the packed problem.
  subroutine check_packing()
    type(delassus_t) :: problem
    type(sparse_rows_t) :: w
    type(error_t), allocatable :: error
    real(dp) :: r(2, 2), v(2, 2)

    ! an entry in two parts, a coupling that is 0
    w = compressed_rows(4, 4, [1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4], [1, 2, 1, 1, 2, 4, 1, 3, 4, 3, 4], &
      & [1.0_dp, 0.5_dp, 1.0_dp, 0.5_dp, 3.0_dp, 7.0_dp, 0.0_dp, 4.0_dp, 0.0_dp, 0.0_dp, 5.0_dp])
    call problem%init(2, w, [1.0_dp, 2.0_dp, 3.0_dp, 4.0_dp], [0.3_dp, 0.3_dp], error)
    call check(.not. allocated(error), "a matrix by rows is packed")
    r(:, 1) = [1.0_dp, 10.0_dp]
    r(:, 2) = [100.0_dp, 1000.0_dp]
    call problem%velocity(r, v)
    call check_close(maxval(abs(v(:, 1) - [8.0_dp, 7032.5_dp])), 0.0_dp, 1.0e-10_dp, "W r + q with a coupling")
    call check_close(maxval(abs(v(:, 2) - [403.0_dp, 5004.0_dp])), 0.0_dp, 1.0e-10_dp, "W r + q without")
    call check_equal(size(problem%other), 1, "entries that are 0 couple nothing")
    call check_close(problem%stiffness(1), 2.5_dp, 0.0_dp, "mean diagonal")
  end subroutine check_packing

  !> A change of the units of impulses changes e, not es.
  subroutine check_units()
    type(delassus_t) :: problem, scaled
    real(dp) :: r(3, 5), v(3, 5), e, es, e_scaled, es_scaled
    integer :: a

    call make_random(1, 3, 5, 3, 0.0_dp, problem)
    do a = 1, 5
      r(1, a) = a
      r(2, a) = 0.1_dp*a
      r(3, a) = -0.2_dp*a
    end do
    call problem%velocity(r, v)
    call problem%measure(r, v, e, es)
    scaled = problem
    scaled%own = 1.0e-5_dp*problem%own
    scaled%coupling = 1.0e-5_dp*problem%coupling
    scaled%stiffness = 1.0e-5_dp*problem%stiffness
    r = 1.0e5_dp*r
    call scaled%velocity(r, v)
    call scaled%measure(r, v, e_scaled, es_scaled)
    call check_close(es_scaled, es, 1.0e-12_dp*es, "es does not depend on units")
    call check(abs(e_scaled - e) > 0.1_dp*e, "e does")
  end subroutine check_units

  !> The blocks of the Jacobian against a central difference.
  subroutine check_jacobian(dimension)
    integer, intent(in) :: dimension
    real(dp), parameter :: h = 1.0e-6_dp
    type(delassus_t) :: problem
    type(alart_curnier_t) :: law
    real(dp) :: r(dimension, 30), dr(dimension, 30), difference(dimension, 30), product(dimension, 30), ignored
    integer :: a, i

    call make_random(2, dimension, 30, 5, 0.1_dp, problem)
    do a = 1, 30
      do i = 1, dimension
        r(i, a) = hash_uniform(3, int(a, i8), i) - merge(0.2_dp, 0.5_dp, i == 1)
        dr(i, a) = hash_uniform(4, int(a, i8), i) - 0.5_dp
      end do
    end do
    call law%init(problem)
    difference = r + h*dr
    call law%evaluate(problem, difference, ignored)
    product = law%f
    difference = r - h*dr
    call law%evaluate(problem, difference, ignored)
    difference = (product - law%f)/(2.0_dp*h)
    call law%evaluate(problem, r, ignored)
    call law%differentiate(problem)
    do a = 1, 30
      product(:, a) = 0.0_dp
      call add_product(law%own(:, a), dr(:, a), product(:, a))
      do i = problem%first(a), problem%first(a + 1) - 1
        call add_product(law%coupling(:, i), dr(:, problem%other(i)), product(:, a))
      end do
    end do
    ! the difference of second order leaves h^2 times third derivatives, rounding 1e-16/h
    call check_close(maxval(abs(product - difference)), 0.0_dp, 1.0e-7_dp*maxval(abs(product)), "Jacobian of F")
  end subroutine check_jacobian

  !> y + A x, A by columns.
  subroutine add_product(a, x, y)
    real(dp), intent(in) :: a(:), x(:)
    real(dp), intent(inout) :: y(:)
    integer :: j

    do j = 1, size(x)
      y = y + a((j - 1)*size(x) + 1:j*size(x))*x(j)
    end do
  end subroutine add_product

  !> Below the angle of friction the stack stays, above it slides as one; every face bears the boxes above it.
  subroutine check_stack(slope, friction)
    real(dp), intent(in) :: slope, friction
    real(dp), parameter :: tolerance = 1.0e-11_dp
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    real(dp) :: r(3, 4*boxes), v(3, 4*boxes), weight, sliding
    integer :: b, m, plain

    ! at the same friction everywhere, boxes that slide as one would be about to slide on each other
    call make_stack(slope, friction, 2.0_dp*friction, problem)
    weight = step*gravity/sqrt(1.0_dp + slope**2)
    sliding = weight*max(0.0_dp, slope - friction)
    plain = 0
    do m = 1, size(friction_methods)
      call solve(problem, trim(friction_methods(m)), tolerance, r, report)
      if (friction_methods(m) == "nlgs") plain = report%sweeps
      if (friction_methods(m) == "momentum") call check(report%sweeps < plain, "stack: momentum spares sweeps")
      call check(report%converged, "stack: "//trim(friction_methods(m))//" converges")
      call problem%velocity(r, v)
      ! |defect| <= tolerance |q|, and the sum over a face is as well conditioned as the stack is high
      do b = 1, boxes
        call check_close(sum(r(1, 4*b - 3:4*b)), mass*weight*(boxes + 1 - b), 1.0e-8_dp*mass*weight, "stack: weight on a face")
      end do
      ! contacts at the limit of friction miss the law by less than they slip
      call check_close(maxval(abs(v(2, 1:4) - sliding)), 0.0_dp, 1.0e-7_dp*weight, "stack: velocity on the plane")
      call check_close(maxval(abs(v(:, 5:))), 0.0_dp, 1.0e-7_dp*weight, "stack: boxes rest on each other")
    end do
  end subroutine check_stack

  !> Boxes about to slide on each other while they slide as one: sweeps creep, the default goes on with Newton's method.
  subroutine check_turns()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    real(dp) :: r(3, 4*boxes)

    call make_stack(0.5_dp, 0.3_dp, 0.3_dp, problem)
    call solve(problem, "nlgs", 1.0e-11_dp, r, report)
    call check(.not. report%converged, "sweeps creep")
    call solve(problem, "auto", 1.0e-11_dp, r, report)
    call check(report%converged, "sweeps and Newton's steps in turn converge")
    call check(report%newton_steps > 0, "by Newton's steps")
    call check(report%sweeps + report%newton_steps < 5000, "soon")
  end subroutine check_turns

  !> Sweeps that follow Newton's steps on boxes that slide end farther off than these: wherever the budget ends, the best impulses
  !> are the result. The first budget lasts beyond the first of Newton's steps, the others end in the sweeps behind them.
  subroutine check_best_is_kept()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    type(friction_control_t) :: control
    type(error_t), allocatable :: error
    real(dp) :: r(3, 4*boxes), v(3, 4*boxes), first, later
    integer :: k, sweeps

    call make_stack(0.5_dp, 0.3_dp, 0.3_dp, problem)
    control%method = "auto"
    ! never met
    control%tolerance = 1.0e-30_dp
    first = huge(first)
    sweeps = 0
    do k = 0, 6
      control%max_iterations = 320 + 20*k
      r = 0.0_dp
      call solve_friction(problem, control, r, report, error)
      call check(.not. allocated(error) .and. report%newton_steps > 0, "sweeps and Newton's steps in turn")
      call problem%velocity(r, v)
      later = problem%figure(r, v)
      if (k == 0) first = later
      if (k == 0) sweeps = report%sweeps
      call check(later <= first, "a longer budget leaves no worse impulses")
    end do
    call check(report%sweeps > sweeps, "sweeps came behind Newton's steps")
  end subroutine check_best_is_kept

  !> A mass that can move along a wire alone strikes a rough plane: its local operator is singular, so that sweeps may stand still
  !> without a solution. Newton's method takes over.
  subroutine check_mass_on_a_wire()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    type(error_t), allocatable :: error
    real(dp), parameter :: frictions(0:2) = [0.1_dp, 0.3_dp, 1.0_dp]
    real(dp) :: along(2), w(2, 2), q(2), mu(1), r(2, 1), angle
    integer :: k, n_taken

    n_taken = 0
    do k = 0, 59
      angle = (5.0_dp + 2.9_dp*k)*acos(-1.0_dp)/180.0_dp
      along(1) = sin(angle)
      along(2) = cos(angle)
      w(:, 1) = along*along(1)
      w(:, 2) = along*along(2)
      q(:) = -0.88_dp*along
      mu(:) = frictions(mod(k, 3))
      call pack(2, w, q, mu, problem)
      r(:, :) = 0.0_dp
      call solve_friction(problem, friction_control_t("auto"), r, report, error)
      call check(.not. allocated(error) .and. report%converged, "a mass on a wire")
      call check(report%sweeps < 2500, "sweeps that stand still are no promise")
      if (report%newton_steps > 0) n_taken = n_taken + 1
    end do
    call check(n_taken > 0, "on some wires sweeps stand still")
  end subroutine check_mass_on_a_wire

  !> Proximal points: of the many solutions of a stack, that near the start is found, self-stress included.
  subroutine check_start_is_kept()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    type(friction_control_t) :: control
    type(error_t), allocatable :: error
    real(dp) :: r(3, 4*boxes), first(3, 4*boxes), weightless(3, 4*boxes)
    integer :: a, i

    call make_stack(0.1_dp, 0.5_dp, 0.5_dp, problem)
    do a = 1, 4*boxes
      do i = 1, 3
        r(i, a) = 0.05_dp*merge(1.0_dp, 0.5_dp, i == 1)*hash_uniform(6, int(a, i8), i)
      end do
    end do
    control%method = "newton"
    control%tolerance = 1.0e-7_dp
    call solve_friction(problem, control, r, report, error)
    call check(report%converged, "a stack under self-stress")
    first = r
    control%tolerance = 1.0e-11_dp
    call solve_friction(problem, control, r, report, error)
    call check(report%converged, "the same, more exactly")
    call check_close(maxval(abs(r - first)), 0.0_dp, 1.0e-4_dp*maxval(abs(first)), "self-stress stays")
    weightless = 0.0_dp
    call solve_friction(problem, control, weightless, report, error)
    call check(maxval(abs(weightless - first)) > 1.0e-2_dp*maxval(abs(first)), "another start, another self-stress")
  end subroutine check_start_is_kept

  !> Every method on problems with more and with less motions than impulses, symmetric or not: the law itself.
  subroutine check_random(dimension, contacts)
    integer, intent(in) :: dimension, contacts
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    real(dp) :: r(dimension, contacts)
    integer :: k, m

    do k = 1, 4
      call make_random(10 + k, dimension, contacts, merge(6, -10, k <= 2), merge(1.0e-3_dp, 0.0_dp, mod(k, 2) == 0), problem)
      do m = 1, size(friction_methods)
        call solve(problem, trim(friction_methods(m)), 1.0e-11_dp, r, report)
        call check(report%converged, "random problem: "//trim(friction_methods(m))//" converges")
        call check_law(problem, r)
      end do
    end do
  end subroutine check_random

  !> Signorini's condition and Coulomb's law of each contact. The measure bounds s |r - P|, and so velocities to 1e-11 |q| and
  !> impulses to 1e-11 |q|/s, up to a factor of some units.
  subroutine check_law(problem, r)
    type(delassus_t), intent(in) :: problem
    real(dp), intent(in), contiguous :: r(:, :)
    real(dp) :: v(size(r, 1), size(r, 2)), scale, worst
    integer :: a

    call problem%velocity(r, v)
    scale = norm2(problem%q)
    worst = 0.0_dp
    do a = 1, problem%n_contacts
      worst = max(worst, -v(1, a), -problem%stiffness(a)*r(1, a), min(v(1, a), problem%stiffness(a)*r(1, a)), &
        & problem%stiffness(a)*(norm2(r(2:, a)) - problem%mu(a)*r(1, a)), &
        & min(norm2(v(2:, a)), problem%stiffness(a)*(problem%mu(a)*r(1, a) - norm2(r(2:, a)))))
      ! power of friction: against the velocity
      worst = max(worst, (dot_product(v(2:, a), r(2:, a)) + problem%mu(a)*r(1, a)*norm2(v(2:, a)))/max(norm2(r(:, a)), 1.0_dp))
    end do
    call check_close(worst, 0.0_dp, 1.0e-9_dp*scale, "Coulomb's law on every contact")
  end subroutine check_law

  subroutine solve(problem, method, tolerance, r, report)
    type(delassus_t), intent(in) :: problem
    character(len=*), intent(in) :: method
    real(dp), intent(in) :: tolerance
    real(dp), intent(out), contiguous :: r(:, :)
    type(friction_report_t), intent(out) :: report
    type(friction_control_t) :: control
    type(error_t), allocatable :: error

    control%method = method
    control%tolerance = tolerance
    r = 0.0_dp
    call solve_friction(problem, control, r, report, error)
    call check(.not. allocated(error), method//" runs")
  end subroutine solve

  !> A grain of mass 1 that does not turn, between two walls whose normals rise from the x axis by an angle: 0 is a grain between
  !> parallel walls, more a wedge that is open along y. The walls move along their normals.
  subroutine make_squeeze(angle, friction, speeds, problem)
    real(dp), intent(in) :: angle, friction
    !> of the walls, towards the grain
    real(dp), intent(in) :: speeds(2)
    type(delassus_t), intent(inout) :: problem
    real(dp) :: h(2, 4), w(4, 4), q(4), mu(2)

    h(1, :) = cos(angle)
    h(2, :) = sin(angle)
    h(1, 2) = -sin(angle)
    h(2, 2) = cos(angle)
    h(1, 3) = -cos(angle)
    h(1, 4) = -sin(angle)
    h(2, 4) = -cos(angle)
    w = matmul(transpose(h), h)
    q = 0.0_dp
    q(1) = -speeds(1)
    q(3) = -speeds(2)
    mu = friction
    call pack(2, w, q, mu, problem)
  end subroutine make_squeeze

  !> Impulses that no solution can have prove that there is none; the bound on impulses of a solution is one.
  subroutine check_growth()
    type(delassus_t) :: problem
    type(growth_t) :: growth
    type(friction_report_t) :: report
    real(dp) :: z(2, 2), r(2, 2)

    call make_squeeze(0.0_dp, 0.5_dp, [0.3_dp, 0.2_dp], problem)
    z = reshape([1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp], [2, 2])
    call find_growth(problem, z, growth)
    call check_equal(growth%kind, growth_proven, "closing walls: balanced impulses are a proof")
    ! W z = 0 up to rounding
    call check(growth%bound > 1.0e12_dp, "closing walls: no impulses suffice")
    ! H z = -1, so |W z|/s is 1 for each contact; z.q = -0.3 - 2 0.2, max|q| = 0.3
    z = reshape([1.0_dp, 0.0_dp, 2.0_dp, 0.0_dp], [2, 2])
    call find_growth(problem, z, growth)
    call check_equal(growth%kind, growth_none, "closing walls: impulses out of balance are none")
    call check_equal(growth%contact, 2, "the contact of the largest impulse")
    call check_close(growth%bound, 0.7_dp/(2.0_dp*0.3_dp), 1.0e-14_dp, "bound on impulses of a solution")
    ! one wall follows the other
    call make_squeeze(0.0_dp, 0.5_dp, [0.3_dp, -0.3_dp], problem)
    z = reshape([1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp], [2, 2])
    call find_growth(problem, z, growth)
    call check_equal(growth%kind, growth_none, "walls that move alike: no growth")
    ! the grain slides out with speed c/sin(angle), by impulses c/(2 sin(angle)**2)
    call make_squeeze(0.01_dp, 0.0_dp, [1.0_dp, 1.0_dp], problem)
    z = reshape([1.0_dp, 0.0_dp, 1.0_dp, 0.0_dp], [2, 2])
    call find_growth(problem, z, growth)
    call check_equal(growth%kind, growth_none, "narrow wedge: it has a solution")
    call solve(problem, "auto", 1.0e-8_dp, r, report)
    call check_equal(report%verdict, verdict_solved, "narrow wedge: solved")
    call check_close(r(1, 1), 0.5_dp/sin(0.01_dp)**2, 1.0e-6_dp*r(1, 1), "narrow wedge: impulse")
    call check(growth%bound > 1.0_dp .and. growth%bound <= report%impulse, "narrow wedge: the bound is below the impulses")
  end subroutine check_growth

  !> Impulses with friction in them mark growth, and prove nothing; two marks one after the other end an iteration.
  subroutine check_marks()
    type(delassus_t) :: problem
    type(growth_t) :: growth
    real(dp) :: z(2, 2), along_x(2, 2)

    call make_squeeze(0.2_dp, 0.5_dp, [1.0_dp, 1.0_dp], problem)
    along_x = reshape([cos(0.2_dp), -sin(0.2_dp), cos(0.2_dp), sin(0.2_dp)], [2, 2])
    z = along_x
    call note_growth(problem, z, growth)
    call check_equal(growth%kind, growth_marked, "wedge: balanced impulses with friction are a mark")
    call check(.not. growth%ends(), "one mark does not end an iteration")
    z = along_x
    call note_growth(problem, z, growth)
    call check(growth%ends(), "two do")
    z = -along_x
    call note_growth(problem, z, growth)
    call check_equal(growth%marks, 0, "marks count one after the other")
    call make_squeeze(0.2_dp, 0.1_dp, [1.0_dp, 1.0_dp], problem)
    z = along_x
    call note_growth(problem, z, growth)
    call check_equal(growth%kind, growth_none, "wedge with little friction: such impulses are outside of the cones")
  end subroutine check_marks

  !> Every method says so, soon, in the smallest cases: parallel walls, and a wedge in which friction jams the grain.
  subroutine check_no_solution()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    real(dp) :: r(2, 2)
    integer :: m, k

    do k = 1, 2
      call make_squeeze(merge(0.0_dp, 0.2_dp, k == 1), 0.5_dp, [1.0_dp, 1.0_dp], problem)
      do m = 1, size(friction_methods)
        call solve(problem, trim(friction_methods(m)), 1.0e-8_dp, r, report)
        call check(.not. report%converged, "no solution: "//trim(friction_methods(m))//" does not converge")
        call check_equal(report%verdict, verdict_no_solution, "no solution: "//trim(friction_methods(m))//" says so")
        call check_equal(report%growth%kind, merge(growth_proven, growth_marked, k == 1), "no solution: proof for parallel walls")
        call check(report%sweeps + report%newton_steps < 1000, "no solution: soon")
      end do
    end do
  end subroutine check_no_solution

  !> Impulses so large that q is lost beside them leave a measure of 0 and are not a solution.
  subroutine check_huge_impulses()
    type(delassus_t) :: problem
    type(friction_report_t) :: report
    type(friction_control_t) :: control
    type(error_t), allocatable :: error
    real(dp) :: r(2, 2)

    call make_squeeze(0.0_dp, 0.5_dp, [1.0_dp, -1.0_dp], problem)
    r = reshape([1.0e17_dp, 0.0_dp, 1.0e17_dp, 0.0_dp], [2, 2])
    control%method = "newton"
    control%max_iterations = 1
    call solve_friction(problem, control, r, report, error)
    call check(report%consistent <= control%tolerance, "huge impulses: the measure is blind")
    call check_equal(report%verdict, verdict_not_converged, "huge impulses: not converged")
    call check(report%impulse > most_impulse .and. report%worst(2) > 0, "huge impulses: named")
  end subroutine check_huge_impulses

  !> Of 400 contacts one approaches: hardly seen by the measure of all, as 1 by the velocities of approach.
  subroutine check_approach()
    integer, parameter :: n = 400
    type(delassus_t) :: problem
    type(error_t), allocatable :: error
    real(dp) :: q(2*n), one(2*n), mu(n), r(2, n), v(2, n), e, es, approach, impulse
    integer :: i, diagonal(2*n), contacts(2)
    logical :: halts

    q = 0.0_dp
    q(1::2) = -1.0_dp
    mu = 0.3_dp
    one = 1.0_dp
    diagonal = [(i, i=1, 2*n)]
    call problem%init(2, compressed_rows(2*n, 2*n, diagonal, diagonal, one), q, mu, error)
    call check(.not. allocated(error), "contacts that share no body are packed")
    r = 0.0_dp
    r(1, :) = 1.0_dp
    r(1, 7) = 1.0_dp - 1.0e-6_dp
    call problem%velocity(r, v)
    call problem%measure(r, v, e, es)
    call problem%find_extremes(r, v, approach, impulse, contacts)
    call check_close(es, 1.0e-6_dp/sqrt(real(n, dp)), 1.0e-14_dp, "measure of one contact of many")
    call check_close(approach, 1.0e-6_dp, 1.0e-14_dp, "its velocity of approach")
    call check_equal(contacts(1), 7, "the contact that approaches")
    call check_close(problem%figure(r, v), 1.0e-7_dp, 1.0e-14_dp, "what a tolerance is compared with")
    ! a Debug build stops where one arises
    call ieee_get_halting_mode(ieee_invalid, halts)
    call ieee_set_halting_mode(ieee_invalid, .false.)
    v(2, 3) = ieee_value(1.0_dp, ieee_quiet_nan)
    call check(problem%figure(r, v) >= huge(1.0_dp), "what is no number meets no tolerance")
    call ieee_set_flag(ieee_invalid, .false.)
    call ieee_set_halting_mode(ieee_invalid, halts)
  end subroutine check_approach

  !> A method that does not exist, a budget too small, a contact that nothing moves.
  subroutine check_refusals()
    type(delassus_t) :: problem
    type(friction_control_t) :: control
    type(friction_report_t) :: report
    type(sparse_rows_t) :: w
    type(error_t), allocatable :: error
    real(dp) :: r(3, 4*boxes)

    call make_stack(0.2_dp, 0.3_dp, 0.6_dp, problem)
    control%method = "auto"
    control%max_iterations = 3
    r = 0.0_dp
    call solve_friction(problem, control, r, report, error)
    call check(.not. report%converged, "a budget of 3 sweeps is too small")
    call check_equal(report%sweeps + report%newton_steps, 3, "and is kept")
    control%method = "simplex"
    call solve_friction(problem, control, r, report, error)
    call check(allocated(error), "a method that does not exist")
    deallocate (error)
    w = compressed_rows(2, 2, [1, 2], [1, 2], [0.0_dp, 1.0_dp])
    call problem%init(2, w, [1.0_dp, 1.0_dp], [0.3_dp], error)
    call check(allocated(error), "a contact whose normal impulse moves nothing")
  end subroutine check_refusals

end program test_friction_solver
