!> The loops over contacts: adjoint operators, exact local solves, blocks relaxed together, momentum, padding, the record
!> of law velocities, tangents, the residual.
program test_contact_kernels
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_effects, only: effects_t
  use gravier_random_hash, only: hash_uniform
  use gravier_contact_data, only: lanes, n_blocks, lane_of, block_of
  use gravier_contact_vectors, only: contact_jacobian, global_impulse, tangents, local_operator, rolling_radius, global_moment
  use gravier_contact_kernels, only: kernels_t
  use gravier_contact_operator, only: rolling_operator
  use gravier_test_contact_columns, only: contact_column, put_contact_column, same_contacts
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> Contacts of some bodies, of which the last two cannot move.
  type :: case_t
    type(kernels_t) :: kernels
    integer :: n = 0, n_grouped = 0
    !> packed as gravier_contact_kernels wants them
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: hot(:, :, :), impulse(:, :, :)
    !> (nw, n_columns), (nv, n_columns)
    real(dp), allocatable :: weight(:, :), velocity(:, :)
  end type case_t

  !> What sweeps carry along.
  type :: memory_t
    real(dp), allocatable :: law_velocity(:, :, :), previous(:, :, :)
  end type memory_t

  integer, parameter :: n_grains = 9, n_columns = 11
  !> numbers of size 1 throughout; sums of some ten of them
  real(dp), parameter :: rounding = 1.0e-13_dp
  integer :: dimension, k
  !> of the scene, and with a law that nothing uses
  type(effects_t) :: effects, more

  call MPI_Init()
  do dimension = 2, 3
    ! no friction, friction, and with tangential shift, rolling and both
    do k = 1, 5
      effects = effects_t(friction=k > 1, tangential_restitution=any(k == [3, 5]), rolling=k > 3)
      call test_choice(dimension, effects)
      call test_adjoint(dimension, effects)
      call test_velocity(dimension, effects)
      if (.not. effects%rolling) call test_one_contact(dimension, effects)
      if (effects%rolling) call test_rolling_contact(dimension, effects)
      if (effects%rolling) call test_moments(dimension, effects)
      call test_record(dimension, effects)
      call test_components(dimension, effects)
      call test_blocks(dimension, effects)
      call test_momentum(dimension, effects)
      call test_plain_loop(dimension, effects)
      call test_padding(dimension, effects)
      if (.not. effects%friction) cycle
      more = effects
      more%tangential_restitution = .true.
      if (.not. effects%tangential_restitution) call test_neutral(dimension, effects, more)
      more = effects
      more%rolling = .true.
      if (.not. effects%rolling) call test_neutral(dimension, effects, more)
    end do
    call test_neutral(dimension, effects_t(), effects_t(friction=.true.))
    call test_local_operator(dimension)
  end do
  call test_no_contacts()
  call test_tangents()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Uniform in (-1, 1).
  real(dp) function draw(trial, k, stream)
    integer, intent(in) :: trial, k, stream
    draw = 2*hash_uniform(trial, int(k, i8), stream) - 1.0_dp
  end function draw

  !> `n` contacts between random grains, every third on a wall.
  subroutine make_case(dimension, effects, n, trial, problem)
    integer, intent(in) :: dimension, n, trial
    type(effects_t), intent(in) :: effects
    type(case_t), intent(out) :: problem
    integer :: c, b, d

    call problem%kernels%choose(dimension, effects)
    associate (kernels => problem%kernels)
      call allocate_contacts(n, problem)
      allocate (problem%weight(kernels%nw, n_columns), problem%velocity(kernels%nv, n_columns))
      problem%weight(:, :) = 0.0_dp
      problem%velocity(:, :) = 0.0_dp
      do b = 1, n_grains
        problem%weight(1:dimension, b) = 1.5_dp + draw(trial, b, 1)
        if (effects%friction) problem%weight(kernels%nw, b) = 2.5_dp + draw(trial, b, 2)
        do d = 1, kernels%nv
          problem%velocity(d, b) = draw(trial, b, 2 + d)
        end do
      end do
      do c = 1, n
        call make_contact(problem, c, trial)
      end do
    end associate
  end subroutine make_case

  !> Room for `n` contacts of no effect.
  subroutine allocate_contacts(n, problem)
    integer, intent(in) :: n
    type(case_t), intent(inout) :: problem

    problem%n = n
    allocate (problem%pair(2, lanes*n_blocks(n)), source=1)
    allocate (problem%hot(lanes, problem%kernels%nh, n_blocks(n)), source=0.0_dp)
    allocate (problem%impulse(lanes, problem%kernels%nc, n_blocks(n)), source=0.0_dp)
  end subroutine allocate_contacts

  subroutine make_contact(problem, c, trial)
    type(case_t), intent(inout) :: problem
    integer, intent(in) :: c, trial
    integer :: i, j

    i = 1 + int(n_grains*hash_uniform(trial, int(c, i8), 10))
    j = 1 + mod(i + int((n_grains - 1)*hash_uniform(trial, int(c, i8), 11)), n_grains)
    if (mod(c, 3) == 0) j = n_grains + 1 + mod(c, 2)
    call put_contact(problem, c, trial, i, j, j > n_grains)
  end subroutine make_contact

  !> Contact `c` between bodies i and j, on whose weights its local operators depend.
  subroutine put_contact(problem, c, trial, i, j, on_wall)
    type(case_t), intent(inout) :: problem
    integer, intent(in) :: c, trial, i, j
    !> j is a wall, without lever
    logical, intent(in) :: on_wall
    real(dp) :: hot(problem%kernels%nh), impulse(problem%kernels%nc), wn, wt
    integer :: d, nd

    nd = problem%kernels%nd
    problem%pair(1, c) = i
    problem%pair(2, c) = j
    do d = 1, nd
      hot(d) = draw(trial, c, 11 + d)
    end do
    hot(1:nd) = hot(1:nd)/norm2(hot(1:nd))
    hot(nd + 1) = max(0.0_dp, 0.3_dp*draw(trial, c, 15))
    call local_operator(hot(1:nd), problem%weight(:, i), problem%weight(:, j), wn, wt)
    hot(nd + 2) = 1.0_dp/wn
    impulse(1) = max(0.0_dp, draw(trial, c, 16))
    if (problem%kernels%nc > 1) then
      hot(nd + 4) = 0.7_dp + 0.3_dp*draw(trial, c, 17)
      hot(nd + 5) = merge(0.0_dp, 0.7_dp + 0.3_dp*draw(trial, c, 18), on_wall)
      hot(nd + 3) = 1.0_dp/(wt + hot(nd + 4)**2*problem%weight(nd + 1, i) + hot(nd + 5)**2*problem%weight(nd + 1, j))
      hot(nd + 6) = 0.5_dp + 0.5_dp*draw(trial, c, 19)
      do d = 2, nd
        impulse(d) = draw(trial, c, 18 + d)
      end do
      do d = 1, merge(nd - 1, 0, problem%kernels%shift_row > 0)
        hot(problem%kernels%shift_row + d) = 0.5_dp*draw(trial, c, 21 + d)
      end do
      if (problem%kernels%rolling_row > 0) then
        associate (row => problem%kernels%rolling_row, nw => problem%kernels%nw)
          hot(row + 1) = rolling_radius(hot(nd + 4), hot(nd + 5))
          hot(row + 2) = 1.0_dp/(hot(row + 1)**2*(problem%weight(nw, i) + problem%weight(nw, j)))
          do d = 3, nd + 1
            hot(row + d) = 0.3_dp + 0.3_dp*draw(trial, c, 21 + d)
          end do
        end associate
        do d = nd + 1, problem%kernels%nc
          impulse(d) = 0.5_dp*draw(trial, c, 22 + d)
        end do
      end if
    end if
    call put_contact_column(hot, c, problem%hot)
    call put_contact_column(impulse, c, problem%impulse)
  end subroutine put_contact

  subroutine test_choice(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(kernels_t) :: kernels

    call kernels%choose(dimension, effects)
    call check_equal(kernels%nd, dimension, "space dimension")
    call check_equal(kernels%nv, merge(3*dimension - 3, dimension, effects%friction), "degrees of freedom")
    call check_equal(kernels%nw, dimension + merge(1, 0, effects%friction), "rows of weight")
    call check_equal(kernels%nf, merge(dimension, 1, effects%friction), "components of a force")
    call check_equal(kernels%nc, kernels%nf + merge(2*dimension - 3, 0, effects%rolling), "components of an impulse")
    call check_equal(kernels%nh, dimension + merge(6, 2, effects%friction) + merge(dimension - 1, 0, &
      & effects%tangential_restitution) + merge(dimension + 1, 0, effects%rolling), "rows of hot")
  end subroutine test_choice

  !> (H r) . V = r . (H^T V) for any r and V.
  subroutine test_adjoint(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: reaction(:, :), contact_velocity(:, :, :)
    integer :: trial

    do trial = 1, 20
      call make_case(dimension, effects, 30, trial, problem)
      allocate (reaction(problem%kernels%nv, n_columns), source=0.25_dp)
      allocate (contact_velocity, mold=problem%impulse)
      contact_velocity(:, :, :) = huge(1.0_dp)
      call problem%kernels%add_reaction(problem%pair, problem%hot, problem%impulse, reaction)
      call problem%kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, contact_velocity)
      ! what was in `reaction` stays: add_reaction adds
      call check_close(sum((reaction - 0.25_dp)*problem%velocity), sum(problem%impulse*contact_velocity), 10*rounding, &
        & "H and H^T are adjoint")
      deallocate (reaction, contact_velocity)
    end do
  end subroutine test_adjoint

  !> The moment of a contact on its candidate is what the rows of the Jacobian make of its last impulses; R* of two levers, and
  !> of one.
  subroutine test_moments(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: candidate(:, :), antagonist(:, :), r(:), moment(:)
    integer :: c, d

    call make_case(dimension, effects, 20, 7, problem)
    associate (kernels => problem%kernels)
      allocate (candidate(kernels%nc, kernels%nv), antagonist(kernels%nc, kernels%nv), r(kernels%nc))
      allocate (moment(kernels%nv - kernels%nd))
      do c = 1, 20
        call contact_jacobian(kernels, problem%hot, c, candidate, antagonist)
        call global_moment(kernels, problem%hot, problem%impulse, c, moment)
        r(:) = contact_column(problem%impulse, c)
        do d = 1, size(moment)
          call check_close(moment(d), sum(candidate(kernels%nf + 1:, kernels%nd + d)*r(kernels%nf + 1:)), rounding, &
            & "moment of a contact")
        end do
        associate (i => problem%pair(1, c), j => problem%pair(2, c), turn => kernels%nd + 1)
          call check_close(rolling_operator(kernels, problem%pair, problem%hot, c, problem%weight), &
            & sum(candidate(kernels%nc, turn:)**2)*problem%weight(turn, i) + sum(antagonist(kernels%nc, turn:)**2) &
            & *problem%weight(turn, j), rounding, "relative spin by a moment of one")
        end associate
      end do
    end associate
    call check_close(rolling_radius(1.0_dp, 3.0_dp), 0.75_dp, rounding, "effective radius of two grains")
    call check_close(rolling_radius(2.0_dp, 0.0_dp), 2.0_dp, rounding, "effective radius of a grain on a wall")
  end subroutine test_moments

  !> H^T V by the kernel, by the rows of the Jacobian, and by the motion of the two material points that touch:
  !> v = v_i + w_i x (-R_i n) - v_j - w_j x (R_j n), on (n, t, s).
  subroutine test_velocity(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: contact_velocity(:, :, :), candidate(:, :), antagonist(:, :), expected(:), found(:), hot(:)
    integer :: c, k, i, j
    logical :: by_rows, by_points

    call make_case(dimension, effects, 60, 31, problem)
    associate (kernels => problem%kernels)
      allocate (contact_velocity, mold=problem%impulse)
      allocate (candidate(kernels%nc, kernels%nv), antagonist(kernels%nc, kernels%nv))
      allocate (expected(kernels%nc), found(kernels%nc), hot(kernels%nh))
      call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, contact_velocity)
      by_rows = .true.
      by_points = .true.
      do c = 1, 60
        i = problem%pair(1, c)
        j = problem%pair(2, c)
        call contact_jacobian(kernels, problem%hot, c, candidate, antagonist)
        found(:) = contact_column(contact_velocity, c)
        hot(:) = contact_column(problem%hot, c)
        call point_velocity(kernels, hot, problem%velocity(:, i), problem%velocity(:, j), expected)
        do k = 1, kernels%nc
          by_rows = by_rows .and. abs(found(k) - sum(candidate(k, :)*problem%velocity(:, i)) &
            & - sum(antagonist(k, :)*problem%velocity(:, j))) <= rounding
          by_points = by_points .and. abs(found(k) - expected(k)) <= rounding
        end do
      end do
      call check(by_rows, "H^T V by the rows of the Jacobian")
      call check(by_points, "H^T V by the motion of the points that touch")
    end associate
  end subroutine test_velocity

  subroutine point_velocity(kernels, hot, vi, vj, v)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in) :: hot(:), vi(:), vj(:)
    real(dp), intent(out) :: v(:)
    real(dp) :: n(3), t(3), s(3), spin(3, 2), relative(3)
    integer :: nd

    nd = kernels%nd
    n(:) = 0.0_dp
    n(1:nd) = hot(1:nd)
    relative(:) = 0.0_dp
    relative(1:nd) = vi(1:nd) - vj(1:nd)
    spin(:, :) = 0.0_dp
    t(:) = 0.0_dp
    s(:) = 0.0_dp
    if (kernels%nc > 1) then
      if (nd == 2) then
        spin(3, 1) = vi(3)
        spin(3, 2) = vj(3)
      else
        spin(:, 1) = vi(4:6)
        spin(:, 2) = vj(4:6)
      end if
      call add_cross(relative, -hot(nd + 4), spin(:, 1), n)
      call add_cross(relative, -hot(nd + 5), spin(:, 2), n)
    end if
    v(1) = sum(relative*n)
    if (kernels%nf == 2) v(2) = relative(2)*n(1) - relative(1)*n(2)
    if (kernels%nf == 3) then
      call tangents(n, t, s)
      v(2) = sum(relative*t)
      v(3) = sum(relative*s)
    end if
    if (kernels%rolling_row == 0) return
    ! R* times the difference of the spins, of which disks have one
    spin(:, 1) = hot(kernels%rolling_row + 1)*(spin(:, 1) - spin(:, 2))
    if (nd == 2) then
      v(3) = spin(3, 1)
    else
      v(4) = sum(spin(:, 1)*t)
      v(5) = sum(spin(:, 1)*s)
      v(6) = sum(spin(:, 1)*n)
    end if
  end subroutine point_velocity

  !> a + factor b x c.
  pure subroutine add_cross(a, factor, b, c)
    real(dp), intent(inout) :: a(3)
    real(dp), intent(in) :: factor, b(3), c(3)
    a(1) = a(1) + factor*(b(2)*c(3) - b(3)*c(2))
    a(2) = a(2) + factor*(b(3)*c(1) - b(1)*c(3))
    a(3) = a(3) + factor*(b(1)*c(2) - b(2)*c(1))
  end subroutine add_cross

  !> One relaxation of one contact, from any impulse, ends at the solution of the law with the bodies' masses, which is
  !> unique: what the residual calls P, from any impulse too.
  subroutine test_one_contact(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: before(:, :), reaction(:, :)
    real(dp), allocatable, dimension(:, :, :) :: start, v, law_velocity, change
    real(dp) :: sums(3), changes(2)
    integer :: trial, regimes(3), regime, d

    regimes(:) = 0
    do trial = 1, 300
      call make_case(dimension, effects, 1, 1000 + trial, problem)
      ! every other contact is with a wall
      if (mod(trial, 2) == 0) call put_on_wall(problem)
      associate (kernels => problem%kernels, impulse => problem%impulse)
        allocate (v, law_velocity, change, mold=impulse)
        allocate (start, source=impulse)
        allocate (reaction(kernels%nv, n_columns))
        allocate (before(kernels%nv, n_columns), source=problem%velocity)
        call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, impulse, sums)
        law_velocity(:, :, :) = huge(1.0_dp)
        call kernels%sweep_recording(0, problem%pair, problem%hot, problem%weight, problem%velocity, impulse, changes, &
          & law_velocity)
        call check_close(changes(1), sums(1), 10*rounding, "sums of a sweep: changes squared")
        call check_close(changes(2), sum(impulse**2), 10*rounding, "sums of a sweep: impulses squared")
        call check_close(sums(1), sum((impulse - start)**2), 10*rounding, "residual: distance to the solution, squared")
        call check_close(sums(2), sum(start**2), rounding, "residual: impulse, squared")
        call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
        call check_law(problem, v(1, :, 1), regime)
        regimes(regime) = regimes(regime) + 1
        call check(all(abs(v - law_velocity) <= rounding), "law velocity = H^T V after the update")
        ! momentum: V changes by M^-1 H (r - r_old), and walls do not move
        change(:, :, :) = impulse - start
        reaction(:, :) = 0.0_dp
        call kernels%add_reaction(problem%pair, problem%hot, change, reaction)
        do d = 1, kernels%nv
          reaction(d, :) = reaction(d, :)*problem%weight(min(d, kernels%nw), :)
        end do
        call check(all(abs(problem%velocity - before - reaction) <= rounding), "velocities change by the impulses")
        ! the residual vanishes there: nothing but the rounding of numbers of size 1, squared
        call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, impulse, sums)
        call check_close(sums(1), 0.0_dp, rounding**2, "residual at the solution")
        if (regime == 1) call check_close(sums(2), 0.0_dp, 0.0_dp, "an open contact has no impulse")
        deallocate (v, law_velocity, change, reaction, start, before)
      end associate
    end do
    call check(regimes(1) > 10 .and. regimes(3) > 10, "open and closed contacts met")
    if (effects%friction) call check(regimes(2) > 10, "sliding contacts met")
  end subroutine test_one_contact

  !> The first contact's antagonist becomes a wall.
  subroutine put_on_wall(problem)
    type(case_t), intent(inout) :: problem
    real(dp) :: hot(problem%kernels%nh), wn
    integer :: nd, i

    nd = problem%kernels%nd
    i = problem%pair(1, 1)
    problem%pair(2, 1) = n_grains + 1
    wn = problem%weight(1, i)
    hot(:) = contact_column(problem%hot, 1)
    hot(nd + 2) = 1.0_dp/wn
    if (problem%kernels%nc > 1) then
      hot(nd + 5) = 0.0_dp
      hot(nd + 3) = 1.0_dp/(wn + hot(nd + 4)**2*problem%weight(nd + 1, i))
    end if
    if (problem%kernels%rolling_row > 0) then
      hot(problem%kernels%rolling_row + 1) = hot(nd + 4)
      hot(problem%kernels%rolling_row + 2) = 1.0_dp/(hot(nd + 4)**2*problem%weight(nd + 1, i))
    end if
    call put_contact_column(hot, 1, problem%hot)
  end subroutine put_on_wall

  !> Signorini and Coulomb at contact 1, of local velocity `v`. Regimes: 1 open, 2 sliding, 3 closed or sticking.
  subroutine check_law(problem, v, regime)
    type(case_t), intent(in) :: problem
    real(dp), intent(in) :: v(:)
    integer, intent(out) :: regime
    real(dp) :: impulse(problem%kernels%nc), hot(problem%kernels%nh), sliding(size(v) - 1), shifted, rn, bound, length
    integer :: nd

    nd = problem%kernels%nd
    impulse(:) = contact_column(problem%impulse, 1)
    hot(:) = contact_column(problem%hot, 1)
    rn = impulse(1)
    shifted = v(1) + hot(nd + 1)
    call check(rn >= 0.0_dp, "Signorini: no traction")
    call check(shifted >= -rounding, "Signorini: no penetration")
    call check_close(rn*shifted, 0.0_dp, rounding, "Signorini: one or the other")
    regime = merge(3, 1, rn > 0.0_dp)
    if (problem%kernels%nc == 1) return
    bound = hot(nd + 6)*rn
    length = norm2(impulse(2:))
    sliding(:) = v(2:)
    if (problem%kernels%shift_row > 0) sliding(:) = sliding + hot(problem%kernels%shift_row + 1:problem%kernels%shift_row + nd - 1)
    call check(length <= bound*(1.0_dp + 4*epsilon(1.0_dp)), "Coulomb: in the cone")
    if (norm2(sliding) > rounding) then
      if (rn > 0.0_dp) regime = 2
      call check_close(length, bound, rounding, "Coulomb: sliding on the cone")
      call check_close(sum(impulse(2:)*sliding), -length*norm2(sliding), rounding, "Coulomb: against the sliding")
    end if
  end subroutine check_law

  !> Sweeps that keep the law velocities do the same, to rounding (the two loops are compiled apart, and may contract
  !> products and sums differently); what they keep is what each contact had right after its own update, as a sweep
  !> cut off there shows. A moment changes the tangential velocity that the forces were solved with.
  subroutine test_record(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    integer, parameter :: n = 25
    type(case_t) :: plain, recording, short, one
    real(dp), allocatable :: law_velocity(:, :, :), v(:, :, :)
    real(dp) :: sums(2)
    integer :: sweep, c
    logical :: same, kept

    call make_case(dimension, effects, n, 41, plain)
    call make_case(dimension, effects, n, 41, recording)
    allocate (law_velocity, v, mold=plain%impulse)
    law_velocity(:, :, :) = 0.0_dp
    same = .true.
    kept = .true.
    do sweep = 1, 5
      short = recording
      call plain%kernels%sweep(0, plain%pair, plain%hot, plain%weight, plain%velocity, plain%impulse, sums)
      call recording%kernels%sweep_recording(0, recording%pair, recording%hot, recording%weight, recording%velocity, &
        & recording%impulse, sums, law_velocity)
      same = same .and. all(abs(plain%velocity - recording%velocity) <= rounding) &
        & .and. all(abs(plain%impulse - recording%impulse) <= rounding)
      do c = 1, n
        call take_contact(short, c, one)
        call one%kernels%sweep(0, one%pair, one%hot, one%weight, one%velocity, one%impulse, sums)
        call one%kernels%contact_velocity(one%pair, one%hot, one%velocity, v(:, :, 1:1))
        if (effects%rolling) v(1, 2:dimension, 1) = law_velocity(lane_of(c), 2:dimension, block_of(c))
        kept = kept .and. all(abs(v(1, :, 1) - law_velocity(lane_of(c), :, block_of(c))) <= rounding)
        short%velocity(:, :) = one%velocity
      end do
    end do
    call check(same, "sweeps that record do the same")
    call check(kept, "law velocities are those right after the update of each contact")
  end subroutine test_record

  !> The same bodies with contact `c` alone.
  subroutine take_contact(problem, c, one)
    type(case_t), intent(in) :: problem
    integer, intent(in) :: c
    type(case_t), intent(out) :: one

    one%kernels = problem%kernels
    allocate (one%weight, source=problem%weight)
    allocate (one%velocity, source=problem%velocity)
    call allocate_contacts(1, one)
    one%pair(:, 1) = problem%pair(:, c)
    one%hot(1, :, 1) = problem%hot(lane_of(c), :, block_of(c))
    one%impulse(1, :, 1) = problem%impulse(lane_of(c), :, block_of(c))
  end subroutine take_contact

  pure logical function same_bits(a, b)
    real(dp), intent(in) :: a(:, :), b(:, :)
    integer :: i, j

    same_bits = .true.
    do j = 1, size(a, 2)
      do i = 1, size(a, 1)
        same_bits = same_bits .and. transfer(a(i, j), 0_i8) == transfer(b(i, j), 0_i8)
      end do
    end do
  end function same_bits

  !> Bodies in whole blocks without common moving bodies, then some contacts that share them at will. In each block the
  !> bodies take part in another order; every third contact is on one of two bodies that move as prescribed. Weights differ
  !> by component, and some components of some bodies cannot move.
  subroutine make_blocks(dimension, effects, n_full, n_singles, trial, problem)
    integer, intent(in) :: dimension, n_full, n_singles, trial
    type(effects_t), intent(in) :: effects
    type(case_t), intent(out) :: problem
    integer, parameter :: n_moving = 2*lanes
    integer :: b, c, d, i, j, stride

    call problem%kernels%choose(dimension, effects)
    associate (kernels => problem%kernels)
      call allocate_contacts(n_full*lanes + n_singles, problem)
      problem%n_grouped = n_full*lanes
      allocate (problem%weight(kernels%nw, n_moving + 2), problem%velocity(kernels%nv, n_moving + 2))
      do b = 1, n_moving + 2
        do d = 1, kernels%nv
          problem%velocity(d, b) = draw(trial, b, 2 + d)
        end do
        problem%weight(:, b) = 0.0_dp
        if (b > n_moving) cycle
        do d = 1, kernels%nw
          problem%weight(d, b) = 1.5_dp + draw(trial, b, 20 + d)
        end do
        if (mod(b, 5) == 0) problem%weight(1 + mod(b, dimension), b) = 0.0_dp
      end do
      do c = 1, problem%n
        if (c <= problem%n_grouped) then
          ! an odd stride and a power of two of bodies: each body once a block
          stride = 2*((c - 1)/lanes) + 3
          i = 1 + mod((2*c - 2)*stride, n_moving)
          j = 1 + mod((2*c - 1)*stride, n_moving)
        else
          i = 1 + int(n_moving*hash_uniform(trial, int(c, i8), 10))
          j = 1 + mod(i + int((n_moving - 1)*hash_uniform(trial, int(c, i8), 11)), n_moving)
        end if
        if (mod(c, 3) == 0) j = n_moving + 1 + mod(c, 2)
        if (mod(c, 3) == 0 .and. mod(c, 2) == 0) then
          ! a glued grain may be the candidate
          call put_contact(problem, c, trial, j, i, .false.)
        else
          call put_contact(problem, c, trial, i, j, j > n_moving)
        end if
      end do
    end associate
  end subroutine make_blocks

  !> One sweep with what it may carry along.
  subroutine sweep_once(variant, n_grouped, problem, memory, sums)
    !> 1 plain, 2 recording, 3 with momentum, 4 both
    integer, intent(in) :: variant, n_grouped
    type(case_t), intent(inout) :: problem
    type(memory_t), intent(inout) :: memory
    real(dp), intent(out) :: sums(2)

    associate (kernels => problem%kernels, pair => problem%pair, hot => problem%hot, weight => problem%weight)
      select case (variant)
      case (1)
        call kernels%sweep(n_grouped, pair, hot, weight, problem%velocity, problem%impulse, sums)
      case (2)
        call kernels%sweep_recording(n_grouped, pair, hot, weight, problem%velocity, problem%impulse, sums, memory%law_velocity)
      case (3)
        call kernels%sweep_momentum(n_grouped, pair, hot, weight, problem%velocity, problem%impulse, sums, 0.4_dp, &
          & memory%previous)
      case (4)
        call kernels%sweep_momentum_recording(n_grouped, pair, hot, weight, problem%velocity, problem%impulse, sums, 0.4_dp, &
          & memory%previous, memory%law_velocity)
      end select
    end associate
  end subroutine sweep_once

  subroutine start_memory(problem, memory)
    type(case_t), intent(in) :: problem
    type(memory_t), intent(out) :: memory

    allocate (memory%law_velocity, memory%previous, mold=problem%impulse)
    memory%law_velocity(:, :, :) = 0.0_dp
    memory%previous(:, :, :) = 0.5_dp*problem%impulse
  end subroutine start_memory

  !> Blocks relaxed together end where their contacts relaxed one after the other in the same order do: velocities,
  !> impulses, sums and what sweeps carry along, up to roundings. A plain loop ends there too.
  subroutine test_blocks(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: singly, blocks
    type(memory_t) :: one_by_one, together
    real(dp) :: sums(2), singles(2)
    integer :: sweep, variant

    do variant = 1, 4
      call make_blocks(dimension, effects, 3, 7, 80 + variant, singly)
      blocks = singly
      call start_memory(singly, one_by_one)
      call start_memory(blocks, together)
      do sweep = 1, 4
        call sweep_once(variant, 0, singly, one_by_one, singles)
        call sweep_once(variant, blocks%n_grouped, blocks, together, sums)
        call check(all(abs(blocks%velocity - singly%velocity) <= 10*rounding), "blocks: velocities as contact by contact")
        call check(all(abs(blocks%impulse - singly%impulse) <= 10*rounding), "blocks: impulses as contact by contact")
        call check(all(abs(together%law_velocity - one_by_one%law_velocity) <= 10*rounding), &
          & "blocks: law velocities as contact by contact")
        call check(all(abs(together%previous - one_by_one%previous) <= 10*rounding), "blocks: previous impulses")
        ! sums of some tens of squares
        call check(all(abs(sums - singles) <= 100*rounding*(1.0_dp + singles)), "blocks: sums as contact by contact")
      end do
    end do
    call make_blocks(dimension, effects, 3, 7, 85, singly)
    blocks = singly
    call start_memory(blocks, together)
    call sweep_once(1, blocks%n_grouped, blocks, together, sums)
    call relax_plainly(singly, singles)
    call check(all(abs(blocks%velocity - singly%velocity) <= rounding), "blocks: velocities of a plain loop")
    call check(all(abs(blocks%impulse - singly%impulse) <= rounding), "blocks: impulses of a plain loop")
    call check(all(abs(sums - singles) <= 10*rounding*(1.0_dp + singles)), "blocks: sums of a plain loop")
  end subroutine test_blocks

  !> A sweep with momentum is the plain one from y = r + beta (r - previous), and leaves r.
  subroutine test_momentum(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem, plain
    type(memory_t) :: memory
    real(dp), allocatable :: start(:, :, :)
    real(dp) :: sums(2), expected(2)
    integer :: variant

    do variant = 3, 4
      call make_blocks(dimension, effects, 2, 5, 86 + variant, problem)
      plain = problem
      call start_memory(problem, memory)
      allocate (start, source=problem%impulse)
      plain%impulse(:, :, :) = plain%impulse + 0.4_dp*(plain%impulse - memory%previous)
      call sweep_once(variant, problem%n_grouped, problem, memory, sums)
      call check(all(abs(memory%previous - start) <= 0.0_dp), "momentum: leaves the impulses it found")
      call sweep_once(variant - 2, plain%n_grouped, plain, memory, expected)
      call check(all(abs(problem%velocity - plain%velocity) <= rounding), "momentum: velocities")
      call check(all(abs(problem%impulse - plain%impulse) <= rounding), "momentum: impulses")
      call check(all(abs(sums - expected) <= 10*rounding*(1.0_dp + expected)), "momentum: sums")
      deallocate (start)
    end do
  end subroutine test_momentum

  !> One sweep, contact by contact, by the rows of the Jacobian.
  subroutine relax_plainly(problem, sums)
    type(case_t), intent(inout) :: problem
    real(dp), intent(out) :: sums(2)
    real(dp), dimension(problem%kernels%nc, problem%kernels%nv) :: candidate, antagonist
    real(dp), dimension(problem%kernels%nc) :: r, change, v
    real(dp) :: hot(problem%kernels%nh)
    integer :: c, d, w, nd

    nd = problem%kernels%nd
    sums(:) = 0.0_dp
    do c = 1, problem%n
      associate (i => problem%pair(1, c), j => problem%pair(2, c), velocity => problem%velocity, weight => problem%weight)
        hot(:) = contact_column(problem%hot, c)
        r(:) = contact_column(problem%impulse, c)
        call contact_jacobian(problem%kernels, problem%hot, c, candidate, antagonist)
        v(:) = 0.0_dp
        do d = 1, problem%kernels%nv
          v(:) = v + candidate(:, d)*velocity(d, i) + antagonist(:, d)*velocity(d, j)
        end do
        change(:) = r
        call solve_forces(problem%kernels, hot, hot(nd + 2), hot(min(nd + 3, size(hot))), v, r)
        if (problem%kernels%rolling_row > 0) then
          ! the moments see the velocities that the forces leave
          do d = 1, problem%kernels%nv
            w = min(d, problem%kernels%nw)
            v(:) = v + candidate(:, d)*weight(w, i)*sum((r - change)*candidate(:, d)) &
              & + antagonist(:, d)*weight(w, j)*sum((r - change)*antagonist(:, d))
          end do
          call solve_moments(problem%kernels, hot, hot(problem%kernels%rolling_row + 2), v, r)
        end if
        change(:) = r - change
        sums(1) = sums(1) + sum(change**2)
        sums(2) = sums(2) + sum(r**2)
        call put_contact_column(r, c, problem%impulse)
        do d = 1, problem%kernels%nv
          w = min(d, problem%kernels%nw)
          velocity(d, i) = velocity(d, i) + weight(w, i)*sum(change*candidate(:, d))
          velocity(d, j) = velocity(d, j) + weight(w, j)*sum(change*antagonist(:, d))
        end do
      end associate
    end do
  end subroutine relax_plainly

  !> Forces r := P(r - v/W), v being the velocity under r.
  subroutine solve_forces(kernels, hot, per_wn, per_wt, v, r)
    type(kernels_t), intent(in) :: kernels
    !> (nh), (nc)
    real(dp), intent(in) :: hot(:), v(:)
    !> 1/W_nn, 1/W_tt [kg]
    real(dp), intent(in) :: per_wn, per_wt
    !> (nc)
    real(dp), intent(inout) :: r(:)
    integer :: nd

    nd = kernels%nd
    r(1) = max(0.0_dp, r(1) - (v(1) + hot(nd + 1))*per_wn)
    if (kernels%nc == 1) return
    r(2:nd) = r(2:nd) - v(2:nd)*per_wt
    if (kernels%shift_row > 0) r(2:nd) = r(2:nd) - hot(kernels%shift_row + 1:kernels%shift_row + nd - 1)*per_wt
    call cut(hot(nd + 6)*r(1), r(2:nd))
  end subroutine solve_forces

  !> The moments, with the normal force in r(1).
  subroutine solve_moments(kernels, hot, per_wr, v, r)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in) :: hot(:), v(:), per_wr
    real(dp), intent(inout) :: r(:)
    integer :: nd

    nd = kernels%nd
    r(nd + 1:) = r(nd + 1:) - v(nd + 1:)*per_wr
    call cut(hot(kernels%rolling_row + 3)*r(1), r(nd + 1:2*nd - 1))
    if (nd == 3) call cut(hot(kernels%rolling_row + 4)*r(1), r(6:6))
  end subroutine solve_moments

  pure subroutine cut(radius, part)
    real(dp), intent(in) :: radius
    real(dp), intent(inout) :: part(:)
    real(dp) :: length

    length = norm2(part)
    if (length > radius) part(:) = part*(radius/length)
  end subroutine cut

  !> Relaxations of one contact whose sliding and rolling are coupled: each lowers the energy 1/2 r.W r + r.(v_free + shift),
  !> once the normal impulse is that of the solution, and they end where all laws hold: r in the cones, and (-v) normal to them.
  subroutine test_rolling_contact(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: start(:, :, :), v(:, :, :)
    real(dp) :: sums(3), energy, last, hot(20)
    integer :: trial, k, rolls, closed, nd

    nd = dimension
    rolls = 0
    closed = 0
    do trial = 1, 200
      call make_case(dimension, effects, 1, 2000 + trial, problem)
      if (mod(trial, 2) == 0) call put_on_wall(problem)
      associate (kernels => problem%kernels, r => problem%impulse)
        allocate (v, start, mold=r)
        hot(1:kernels%nh) = problem%hot(1, :, 1)
        last = huge(1.0_dp)
        do k = 1, 200
          start(:, :, :) = r
          call kernels%sweep(0, problem%pair, problem%hot, problem%weight, problem%velocity, r, sums)
          call check_close(sums(1), sum((r - start)**2), rounding*(1.0_dp + sums(1)), "sums of a sweep: changes squared")
          call check_close(sums(2), sum(r**2), rounding*(1.0_dp + sums(2)), "sums of a sweep: impulses squared")
          ! 1/2 r.W r + r.v_free = 1/2 r.(v + v_free), and v_free = v - W r, which add_reaction and contact_velocity give
          call find_energy(problem, energy)
          call check(energy <= last + rounding, "a relaxation lowers the energy")
          last = energy
        end do
        call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, r, sums)
        call check_close(sums(1), 0.0_dp, (100*rounding)**2, "residual at the solution")
        call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
        if (.not. r(1, 1, 1) > 0.0_dp) then
          call check(all(abs(r) <= 0.0_dp), "an open contact has no moment")
        else
          closed = closed + 1
          if (kernels%shift_row > 0) v(1, 2:nd, 1) = v(1, 2:nd, 1) + hot(kernels%shift_row + 1:kernels%shift_row + nd - 1)
          call check_part(hot(nd + 6)*r(1, 1, 1), r(1, 2:nd, 1), v(1, 2:nd, 1))
          call check_part(hot(kernels%rolling_row + 3)*r(1, 1, 1), r(1, nd + 1:2*nd - 1, 1), v(1, nd + 1:2*nd - 1, 1))
          if (norm2(v(1, nd + 1:2*nd - 1, 1)) > 1.0e-3_dp) rolls = rolls + 1
          if (nd == 3) call check_part(hot(kernels%rolling_row + 4)*r(1, 1, 1), r(1, 6:6, 1), v(1, 6:6, 1))
        end if
        deallocate (v, start)
      end associate
    end do
    call check(rolls > 10 .and. closed - rolls > 10, "contacts that roll met, and contacts that do not")
  end subroutine test_rolling_contact

  !> Energy of contact 1 under its impulse.
  subroutine find_energy(problem, energy)
    type(case_t), intent(in) :: problem
    real(dp), intent(out) :: energy
    real(dp), allocatable :: v(:, :, :), wr(:, :, :), reaction(:, :)
    integer :: d, nd

    nd = problem%kernels%nd
    allocate (v, wr, mold=problem%impulse)
    allocate (reaction(problem%kernels%nv, n_columns), source=0.0_dp)
    associate (kernels => problem%kernels, r => problem%impulse)
      call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
      call kernels%add_reaction(problem%pair, problem%hot, r, reaction)
      do d = 1, kernels%nv
        reaction(d, :) = reaction(d, :)*problem%weight(min(d, kernels%nw), :)
      end do
      call kernels%contact_velocity(problem%pair, problem%hot, reaction, wr)
      v(1, 1, 1) = v(1, 1, 1) + problem%hot(1, nd + 1, 1)
      if (kernels%shift_row > 0) v(1, 2:nd, 1) = v(1, 2:nd, 1) + problem%hot(1, kernels%shift_row + 1:kernels%shift_row + nd - 1, 1)
      energy = sum(r(1, :, 1)*v(1, :, 1)) - 0.5_dp*sum(r(1, :, 1)*wr(1, :, 1))
    end associate
  end subroutine find_energy

  !> A part of an impulse in its disc, and the velocity against it only at the rim.
  subroutine check_part(bound, r, v)
    real(dp), intent(in) :: bound, r(:), v(:)
    real(dp), parameter :: settled = 1.0e-10_dp

    call check(norm2(r) <= bound + settled, "within the disc")
    ! r.v = -bound |v|: at rest, or at the rim and opposite
    call check_close(sum(r*v), -bound*norm2(v), settled, "dissipation is maximal")
  end subroutine check_part

  !> An effect switched on with its neutral value: velocities and impulses of the same bits as without it, sweep by sweep, in all
  !> versions of a sweep.
  subroutine test_neutral(dimension, effects, more)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects, more
    type(case_t) :: plain, forced
    type(memory_t) :: memory, forced_memory
    real(dp) :: sums(2), forced_sums(2)
    integer :: variant, sweep, nc, nh, nv

    do variant = 1, 4
      call make_blocks(dimension, effects, 3, 7, 180 + variant, plain)
      call make_blocks(dimension, more, 3, 7, 180 + variant, forced)
      nc = plain%kernels%nc
      nh = plain%kernels%nh
      nv = plain%kernels%nv
      if (.not. effects%friction) then
        ! mu = 0, and weights and velocities of the same numbers; a friction kernel knows more of both
        forced%hot(:, dimension + 6, :) = 0.0_dp
        forced%weight(1:dimension, :) = plain%weight
        forced%velocity(1:nv, :) = plain%velocity
        forced%hot(:, 1:nh, :) = plain%hot
        forced%impulse(:, 2:, :) = 0.0_dp
      else
        forced%hot(:, 1:dimension + 6, :) = plain%hot(:, 1:dimension + 6, :)
        if (more%tangential_restitution .and. .not. effects%tangential_restitution) &
          & forced%hot(:, forced%kernels%shift_row + 1:forced%kernels%shift_row + dimension - 1, :) = 0.0_dp
        if (more%rolling .and. .not. effects%rolling) then
          forced%hot(:, forced%kernels%rolling_row + 3:, :) = 0.0_dp
          forced%impulse(:, dimension + 1:, :) = 0.0_dp
        end if
      end if
      call start_memory(plain, memory)
      call start_memory(forced, forced_memory)
      do sweep = 1, 4
        call sweep_once(variant, plain%n_grouped, plain, memory, sums)
        call sweep_once(variant, forced%n_grouped, forced, forced_memory, forced_sums)
        call check(all(abs(forced%velocity(1:nv, :) - plain%velocity) <= 0.0_dp), "neutral: velocities")
        call check(all(abs(forced%impulse(:, 1:nc, :) - plain%impulse) <= 0.0_dp), "neutral: impulses")
        ! products may be contracted with sums otherwise
        call check(all(abs(forced_sums - sums) <= rounding*sums), "neutral: sums")
        call check(all(abs(forced%impulse(:, nc + 1:, :)) <= 0.0_dp), "neutral: nothing else")
      end do
    end do
  end subroutine test_neutral

  !> Reactions, contact velocities and residual against a plain loop over the contacts, padding being none of them.
  subroutine test_plain_loop(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: expected(:, :), reaction(:, :), v(:, :, :), wanted_v(:, :, :)
    real(dp) :: sums(3), wanted(2)
    integer :: n

    do n = 1, 3*lanes + 1, 5
      call make_blocks(dimension, effects, 0, n, 90 + n, problem)
      allocate (expected, reaction, mold=problem%velocity)
      allocate (v, wanted_v, source=problem%impulse)
      expected(:, :) = 0.5_dp
      reaction(:, :) = 0.5_dp
      call problem%kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
      call problem%kernels%add_reaction(problem%pair, problem%hot, problem%impulse, reaction)
      call problem%kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
      call loop_plainly(problem, wanted_v, expected, wanted)
      call check(all(abs(v - wanted_v) <= rounding), "plain loop: contact velocities")
      call check(all(abs(reaction - expected) <= rounding), "plain loop: reactions")
      ! sums of some tens of squares, relative to the largest; a defect is made of a velocity and a local operator, each rounded
      call check_close(sums(1), wanted(1), 4*rounding*(1.0_dp + wanted(1)), "plain loop: defects squared")
      call check_close(sums(2), wanted(2), rounding*(1.0_dp + wanted(2)), "plain loop: impulses squared")
      deallocate (expected, reaction, v, wanted_v)
    end do
  end subroutine test_plain_loop

  !> H^T V, reaction + H r and the sums of the residual, contact by contact, by the rows of the Jacobian.
  subroutine loop_plainly(problem, v, reaction, sums)
    type(case_t), intent(in) :: problem
    !> (lanes, nc, blocks), the padding left as it is; (nv, bodies)
    real(dp), intent(inout) :: v(:, :, :), reaction(:, :)
    real(dp), intent(out) :: sums(2)
    real(dp), dimension(problem%kernels%nc, problem%kernels%nv) :: candidate, antagonist
    real(dp), dimension(problem%kernels%nc) :: r, old, local
    real(dp) :: hot(problem%kernels%nh), p(problem%kernels%nd), wi(problem%kernels%nw), wj(problem%kernels%nw), wn, wt
    integer :: c, d, nd
    logical :: global

    nd = problem%kernels%nd
    sums(:) = 0.0_dp
    global = .true.
    do c = 1, problem%n
      associate (i => problem%pair(1, c), j => problem%pair(2, c))
        hot(:) = contact_column(problem%hot, c)
        old(:) = contact_column(problem%impulse, c)
        call contact_jacobian(problem%kernels, problem%hot, c, candidate, antagonist)
        call global_impulse(problem%kernels, problem%hot, problem%impulse, c, p)
        do d = 1, nd
          global = global .and. abs(p(d) - sum(old*candidate(:, d))) <= rounding
        end do
        local(:) = 0.0_dp
        do d = 1, problem%kernels%nv
          local(:) = local + candidate(:, d)*problem%velocity(d, i) + antagonist(:, d)*problem%velocity(d, j)
          reaction(d, i) = reaction(d, i) + sum(old*candidate(:, d))
          reaction(d, j) = reaction(d, j) + sum(old*antagonist(:, d))
        end do
        call put_contact_column(local, c, v)
        wi(:) = problem%weight(:, i)
        wj(:) = problem%weight(:, j)
        call local_operator(hot(1:nd), wi, wj, wn, wt)
        if (problem%kernels%nc > 1) wt = wt + hot(nd + 4)**2*wi(nd + 1) + hot(nd + 5)**2*wj(nd + 1)
        r(:) = old
        call solve_forces(problem%kernels, hot, 1.0_dp/wn, 1.0_dp/wt, local, r)
        if (problem%kernels%rolling_row > 0) call solve_moments(problem%kernels, hot, &
          & 1.0_dp/(hot(problem%kernels%rolling_row + 1)**2*(wi(nd + 1) + wj(nd + 1))), local, r)
        sums(1) = sums(1) + sum((r - old)**2)
        sums(2) = sums(2) + sum(old**2)
      end associate
    end do
    call check(global, "plain loop: impulses in global axes")
  end subroutine loop_plainly

  !> What fills the last block does nothing: the first body, with which it is in contact, keeps its bits when no contact of
  !> its own moves it, in the padding impulses, fields and law velocities stay the zeros that they are, and a second problem
  !> with other velocities of that body gives the other bodies the same bits.
  subroutine test_padding(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem, other
    type(memory_t) :: memory, fast
    real(dp), allocatable :: before(:, :), v(:, :, :), reaction(:, :), hot(:, :, :)
    real(dp) :: sums(3), others(3)
    integer :: n, variant

    do n = 1, 2*lanes - 1, 2
      call make_blocks(dimension, effects, 0, n, 100 + n, problem)
      where (problem%pair(:, 1:n) == 1) problem%pair(:, 1:n) = 2
      ! contacts of the second body with itself are left out
      call part_bodies(problem)
      ! a body that cannot move has W = 0 with itself
      if (mod(n, 4) == 1) problem%weight(:, 1) = 0.0_dp
      other = problem
      other%velocity(:, 1) = -1.0e3_dp*other%velocity(:, 1)
      allocate (before, source=problem%velocity)
      allocate (reaction(problem%kernels%nv, size(problem%velocity, 2)), source=0.0_dp)
      allocate (hot, source=problem%hot)
      allocate (v, mold=problem%impulse)
      call start_memory(problem, memory)
      call start_memory(other, fast)
      associate (kernels => problem%kernels)
        call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
        call kernels%residual(other%pair, other%hot, other%weight, other%velocity, other%impulse, others)
        call check(all(abs(sums - others) <= 0.0_dp), "padding: residual")
        call kernels%add_reaction(problem%pair, problem%hot, problem%impulse, reaction)
        call check(all(abs(reaction(:, 1)) <= 0.0_dp), "padding: no reaction")
        call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
        call check_padding(v, n, "contact velocities")
      end associate
      do variant = 1, 4
        call sweep_once(variant, 0, problem, memory, sums)
        call sweep_once(variant, 0, other, fast, others)
        call check(all(abs(sums - others) <= 0.0_dp), "padding: sums of sweeps")
      end do
      call check(same_bits(problem%velocity(:, 1:1), before(:, 1:1)), "padding: the first body keeps its velocity")
      call check(same_bits(problem%velocity(:, 2:), other%velocity(:, 2:)), "padding: the first body moves no other")
      call check_padding(problem%impulse, n, "impulses")
      call check_padding(problem%hot, n, "fields")
      call check_padding(memory%law_velocity, n, "law velocities")
      call check_padding(memory%previous, n, "previous impulses")
      call check_padding(fast%law_velocity, n, "law velocities, the first body being fast")
      call check(same_contacts(problem%hot, hot, n), "sweeps change no field")
      deallocate (before, v, reaction, hot)
    end do
  end subroutine test_padding

  !> Contacts that have become those of a body with itself are given to the next body.
  subroutine part_bodies(problem)
    type(case_t), intent(inout) :: problem
    integer :: c
    do c = 1, problem%n
      if (problem%pair(1, c) == problem%pair(2, c)) problem%pair(2, c) = problem%pair(2, c) + 1
    end do
  end subroutine part_bodies

  !> What follows the last contact is zero, of either sign.
  subroutine check_padding(field, n, name)
    real(dp), intent(in) :: field(:, :, :)
    integer, intent(in) :: n
    character(len=*), intent(in) :: name
    integer :: c
    logical :: right

    right = .true.
    do c = n + 1, lanes*size(field, 3)
      right = right .and. all(abs(field(lane_of(c), :, block_of(c))) <= 0.0_dp)
    end do
    call check(right, "padding: "//name)
  end subroutine check_padding

  !> Local operators of bodies whose components differ, against H^T W H: W_nn is its entry, W_tt the least value that makes
  !> |v|^2 no larger along any tangential direction; in 2D its entry. With equal components, w_i + w_j bit for bit.
  subroutine test_local_operator(dimension)
    integer, intent(in) :: dimension
    real(dp) :: n(dimension), wi(dimension), wj(dimension), sum_of(dimension), wn, wt, frame(3, 3), u(3), angle, largest
    integer :: trial, d, k

    do trial = 1, 200
      do d = 1, dimension
        n(d) = draw(61, trial, d)
        ! every other component of the antagonist does not move
        wi(d) = 1.5_dp + draw(62, trial, d)
        wj(d) = merge(1.5_dp + draw(63, trial, d), 0.0_dp, draw(64, trial, d) > 0.0_dp)
      end do
      n(:) = n/norm2(n)
      sum_of(:) = wi + wj
      call local_operator(n, wi, wj, wn, wt)
      call check_close(wn, sum(sum_of*n**2), rounding, "W_nn")
      if (dimension == 2) then
        largest = sum_of(1)*n(2)**2 + sum_of(2)*n(1)**2
      else
        frame(:, 1) = n
        call tangents(frame(:, 1), frame(:, 2), frame(:, 3))
        largest = 0.0_dp
        do k = 1, 2000
          angle = k*acos(-1.0_dp)/2000
          u(:) = cos(angle)*frame(:, 2) + sin(angle)*frame(:, 3)
          largest = max(largest, sum(sum_of*u**2))
        end do
      end if
      ! off the maximum by half a step of the angle, squared
      call check_close(wt, largest, 1.0e-5_dp, "W_tt")
      wi(:) = wi(1)
      wj(:) = wj(1)
      call local_operator(n, wi, wj, wn, wt)
      call check_close(wn, wi(1) + wj(1), 0.0_dp, "W_nn of equal components")
      call check_close(wt, wi(1) + wj(1), 0.0_dp, "W_tt of equal components")
    end do
  end subroutine test_local_operator

  !> A relaxation changes velocities by W H (r - r_old) component by component: what has weight 0 stays as it is.
  subroutine test_components(dimension, effects)
    integer, intent(in) :: dimension
    type(effects_t), intent(in) :: effects
    type(case_t) :: problem
    real(dp), allocatable :: before(:, :), start(:, :, :), reaction(:, :)
    real(dp) :: sums(3)
    integer :: b, d

    call make_case(dimension, effects, 30, 71, problem)
    associate (kernels => problem%kernels)
      do b = 1, n_columns
        do d = 1, dimension
          problem%weight(d, b) = max(0.0_dp, draw(72, b, d))
        end do
      end do
      allocate (before(kernels%nv, n_columns), source=problem%velocity)
      allocate (start, source=problem%impulse)
      allocate (reaction(kernels%nv, n_columns), source=0.0_dp)
      call kernels%sweep(0, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
      start(:, :, :) = problem%impulse - start
      call kernels%add_reaction(problem%pair, problem%hot, start, reaction)
      do d = 1, kernels%nv
        reaction(d, :) = reaction(d, :)*problem%weight(min(d, kernels%nw), :)
      end do
      call check(all(abs(problem%velocity - before - reaction) <= 100*rounding), "velocities change by components")
    end associate
  end subroutine test_components

  subroutine test_no_contacts()
    type(case_t) :: problem
    real(dp), allocatable :: before(:, :)
    real(dp) :: sums(3)
    integer :: k

    do k = 0, 3
      call make_case(2 + mod(k, 2), effects_t(friction=k > 1), 0, 1, problem)
      allocate (before(problem%kernels%nv, n_columns), source=problem%velocity)
      call problem%kernels%sweep(0, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
      call check_close(maxval(abs(sums(1:2))), 0.0_dp, 0.0_dp, "no contacts: no change")
      call problem%kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
      call check(same_bits(before, problem%velocity), "no contacts: nothing moves")
      call check_close(maxval(abs(sums)), 0.0_dp, 0.0_dp, "no contacts: no residual")
      deallocate (before)
    end do
  end subroutine test_no_contacts

  !> (n, t, s) is orthonormal and direct for any n: random ones, the axes, and near the pole where the formula changes.
  subroutine test_tangents()
    real(dp) :: n(3)
    integer :: k, d

    do k = 1, 2000
      do d = 1, 3
        n(d) = draw(51, k, d)
      end do
      call check_frame(n, "random")
    end do
    do d = 1, 3
      do k = -1, 1, 2
        n(:) = 0.0_dp
        n(d) = k
        call check_frame(n, "an axis")
        n(:) = -0.0_dp
        n(d) = k
        call check_frame(n, "an axis among negative zeros")
      end do
    end do
    do k = 1, 40
      do d = -1, 1, 2
        n(1) = 10.0_dp**(-k)
        n(2) = -2.0_dp*n(1)
        n(3) = d
        call check_frame(n, "near a pole")
        n(1) = 1.0_dp
        n(2) = 0.3_dp
        n(3) = d*10.0_dp**(-k)
        call check_frame(n, "near the equator")
      end do
    end do
  end subroutine test_tangents

  subroutine check_frame(direction, name)
    real(dp), intent(in) :: direction(3)
    character(len=*), intent(in) :: name
    real(dp), parameter :: tolerance = 8*epsilon(1.0_dp)
    real(dp) :: n(3), t(3), s(3)

    n(:) = direction/norm2(direction)
    call tangents(n, t, s)
    call check(abs(norm2(t) - 1.0_dp) <= tolerance .and. abs(norm2(s) - 1.0_dp) <= tolerance, "unit tangents: "//name)
    call check(abs(sum(n*t)) <= tolerance .and. abs(sum(n*s)) <= tolerance .and. abs(sum(t*s)) <= tolerance, &
      & "orthogonal tangents: "//name)
    call add_cross(s, -1.0_dp, n, t)
    call check(all(abs(s) <= tolerance), "a direct frame, s = n x t: "//name)
  end subroutine check_frame

end program test_contact_kernels
