!> The loops over contacts: adjoint operators, exact local solves, the record of law velocities, tangents, the residual.
program test_contact_kernels
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_contact_kernels, only: kernels_t, contact_jacobian, tangents, local_operator
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> Contacts of some bodies, of which the last two cannot move.
  type :: case_t
    type(kernels_t) :: kernels
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: hot(:, :), weight(:, :), velocity(:, :), impulse(:, :)
  end type case_t

  integer, parameter :: n_grains = 9, n_columns = 11
  !> numbers of size 1 throughout; sums of some ten of them
  real(dp), parameter :: rounding = 1.0e-13_dp
  integer :: dimension, k
  logical :: friction, rotation

  call MPI_Init()
  do dimension = 2, 3
    do k = 1, 3
      friction = k == 3
      rotation = k > 1
      call test_choice(dimension, friction, rotation)
      call test_adjoint(dimension, friction, rotation)
      call test_velocity(dimension, friction, rotation)
      call test_one_contact(dimension, friction, rotation)
      call test_record(dimension, friction, rotation)
      call test_components(dimension, friction, rotation)
    end do
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
  subroutine make_case(dimension, friction, rotation, n, trial, problem)
    integer, intent(in) :: dimension, n, trial
    logical, intent(in) :: friction, rotation
    type(case_t), intent(out) :: problem
    integer :: c, b, d

    call problem%kernels%choose(dimension, friction, rotation)
    associate (kernels => problem%kernels)
      allocate (problem%pair(2, n), problem%hot(kernels%nh, n), problem%impulse(kernels%nc, n))
      allocate (problem%weight(kernels%nw, n_columns), problem%velocity(kernels%nv, n_columns))
      problem%weight(:, :) = 0.0_dp
      problem%velocity(:, :) = 0.0_dp
      do b = 1, n_grains
        problem%weight(1:dimension, b) = 1.5_dp + draw(trial, b, 1)
        if (rotation) problem%weight(kernels%nw, b) = 2.5_dp + draw(trial, b, 2)
        do d = 1, kernels%nv
          problem%velocity(d, b) = draw(trial, b, 2 + d)
        end do
      end do
      do c = 1, n
        call make_contact(problem, c, trial)
      end do
    end associate
  end subroutine make_case

  subroutine make_contact(problem, c, trial)
    type(case_t), intent(inout) :: problem
    integer, intent(in) :: c, trial
    real(dp) :: wn
    integer :: i, j, d, nd

    nd = problem%kernels%nd
    i = 1 + int(n_grains*hash_uniform(trial, int(c, i8), 10))
    j = 1 + mod(i + int((n_grains - 1)*hash_uniform(trial, int(c, i8), 11)), n_grains)
    if (mod(c, 3) == 0) j = n_grains + 1 + mod(c, 2)
    problem%pair(1, c) = i
    problem%pair(2, c) = j
    do d = 1, nd
      problem%hot(d, c) = draw(trial, c, 11 + d)
    end do
    problem%hot(1:nd, c) = problem%hot(1:nd, c)/norm2(problem%hot(1:nd, c))
    problem%hot(nd + 1, c) = max(0.0_dp, 0.3_dp*draw(trial, c, 15))
    wn = problem%weight(1, i) + problem%weight(1, j)
    problem%hot(nd + 2, c) = 1.0_dp/wn
    problem%impulse(1, c) = max(0.0_dp, draw(trial, c, 16))
    if (problem%kernels%nc == 1) return
    problem%hot(nd + 4, c) = 0.7_dp + 0.3_dp*draw(trial, c, 17)
    problem%hot(nd + 5, c) = 0.7_dp + 0.3_dp*draw(trial, c, 18)
    if (j > n_grains) problem%hot(nd + 5, c) = 0.0_dp
    problem%hot(nd + 3, c) = 1.0_dp/(wn + problem%hot(nd + 4, c)**2*problem%weight(nd + 1, i) + &
      & problem%hot(nd + 5, c)**2*problem%weight(nd + 1, j))
    problem%hot(nd + 6, c) = 0.5_dp + 0.5_dp*draw(trial, c, 19)
    do d = 2, nd
      problem%impulse(d, c) = draw(trial, c, 18 + d)
    end do
  end subroutine make_contact

  subroutine test_choice(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    type(kernels_t) :: kernels

    call kernels%choose(dimension, friction, rotation)
    call check_equal(kernels%nd, dimension, "space dimension")
    call check_equal(kernels%nv, merge(3*dimension - 3, dimension, rotation), "degrees of freedom")
    call check_equal(kernels%nw, dimension + merge(1, 0, rotation), "rows of weight")
    call check_equal(kernels%nc, merge(dimension, 1, friction), "components of an impulse")
    call check_equal(kernels%nh, dimension + merge(6, 2, friction), "rows of hot")
  end subroutine test_choice

  !> (H r) . V = r . (H^T V) for any r and V.
  subroutine test_adjoint(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    type(case_t) :: problem
    real(dp), allocatable :: reaction(:, :), contact_velocity(:, :)
    integer :: trial

    do trial = 1, 20
      call make_case(dimension, friction, rotation, 30, trial, problem)
      allocate (reaction(problem%kernels%nv, n_columns), contact_velocity(problem%kernels%nc, 30))
      reaction(:, :) = 0.25_dp
      contact_velocity(:, :) = huge(1.0_dp)
      call problem%kernels%add_reaction(problem%pair, problem%hot, problem%impulse, reaction)
      call problem%kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, contact_velocity)
      ! what was in `reaction` stays: add_reaction adds
      call check_close(sum((reaction - 0.25_dp)*problem%velocity), sum(problem%impulse*contact_velocity), 10*rounding, &
        & "H and H^T are adjoint")
      deallocate (reaction, contact_velocity)
    end do
  end subroutine test_adjoint

  !> H^T V by the kernel, by the rows of the Jacobian, and by the motion of the two material points that touch:
  !> v = v_i + w_i x (-R_i n) - v_j - w_j x (R_j n), on (n, t, s).
  subroutine test_velocity(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    type(case_t) :: problem
    real(dp), allocatable :: contact_velocity(:, :), candidate(:, :), antagonist(:, :), expected(:)
    integer :: c, k, i, j
    logical :: by_rows, by_points

    call make_case(dimension, friction, rotation, 60, 31, problem)
    associate (kernels => problem%kernels)
      allocate (contact_velocity(kernels%nc, 60), candidate(kernels%nc, kernels%nv), antagonist(kernels%nc, kernels%nv))
      allocate (expected(kernels%nc))
      call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, contact_velocity)
      by_rows = .true.
      by_points = .true.
      do c = 1, 60
        i = problem%pair(1, c)
        j = problem%pair(2, c)
        call contact_jacobian(kernels%nd, kernels%nc, problem%hot(:, c), candidate, antagonist)
        call point_velocity(kernels, problem%hot(:, c), problem%velocity(:, i), problem%velocity(:, j), expected)
        do k = 1, kernels%nc
          by_rows = by_rows .and. abs(contact_velocity(k, c) - sum(candidate(k, :)*problem%velocity(:, i)) &
            & - sum(antagonist(k, :)*problem%velocity(:, j))) <= rounding
          by_points = by_points .and. abs(contact_velocity(k, c) - expected(k)) <= rounding
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
    if (kernels%nc > 1) then
      spin(:, :) = 0.0_dp
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
    if (kernels%nc == 2) v(2) = relative(2)*n(1) - relative(1)*n(2)
    if (kernels%nc == 3) then
      call tangents(n, t, s)
      v(2) = sum(relative*t)
      v(3) = sum(relative*s)
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
  subroutine test_one_contact(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    type(case_t) :: problem
    real(dp), allocatable :: before(:, :), start(:, :), reaction(:, :), v(:, :), law_velocity(:, :), change(:, :)
    real(dp) :: sums(2)
    integer :: trial, regimes(3), regime, d

    regimes(:) = 0
    do trial = 1, 300
      call make_case(dimension, friction, rotation, 1, 1000 + trial, problem)
      ! every other contact is with a wall
      if (mod(trial, 2) == 0) call put_on_wall(problem)
      associate (kernels => problem%kernels, impulse => problem%impulse)
        allocate (v(kernels%nc, 1), law_velocity(kernels%nc, 1), change(kernels%nc, 1), reaction(kernels%nv, n_columns))
        allocate (start(kernels%nc, 1), source=impulse)
        allocate (before(kernels%nv, n_columns), source=problem%velocity)
        call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, impulse, sums)
        law_velocity(:, :) = huge(1.0_dp)
        call kernels%sweep_recording(problem%pair, problem%hot, problem%weight, problem%velocity, impulse, law_velocity)
        call check_close(sums(1), sum((impulse - start)**2), 10*rounding, "residual: distance to the solution, squared")
        call check_close(sums(2), sum(start**2), rounding, "residual: impulse, squared")
        call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
        call check_law(problem, v(:, 1), regime)
        regimes(regime) = regimes(regime) + 1
        call check(all(abs(v - law_velocity) <= rounding), "law velocity = H^T V after the update")
        ! momentum: V changes by M^-1 H (r - r_old), and walls do not move
        change(:, :) = impulse - start
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
    if (friction) call check(regimes(2) > 10, "sliding contacts met")
  end subroutine test_one_contact

  !> The first contact's antagonist becomes a wall.
  subroutine put_on_wall(problem)
    type(case_t), intent(inout) :: problem
    real(dp) :: wn
    integer :: nd, i

    nd = problem%kernels%nd
    i = problem%pair(1, 1)
    problem%pair(2, 1) = n_grains + 1
    wn = problem%weight(1, i)
    problem%hot(nd + 2, 1) = 1.0_dp/wn
    if (problem%kernels%nc == 1) return
    problem%hot(nd + 5, 1) = 0.0_dp
    problem%hot(nd + 3, 1) = 1.0_dp/(wn + problem%hot(nd + 4, 1)**2*problem%weight(nd + 1, i))
  end subroutine put_on_wall

  !> Signorini and Coulomb at contact 1, of local velocity `v`. Regimes: 1 open, 2 sliding, 3 closed or sticking.
  subroutine check_law(problem, v, regime)
    type(case_t), intent(in) :: problem
    real(dp), intent(in) :: v(:)
    integer, intent(out) :: regime
    real(dp) :: shifted, rn, bound, length
    integer :: nd

    nd = problem%kernels%nd
    rn = problem%impulse(1, 1)
    shifted = v(1) + problem%hot(nd + 1, 1)
    call check(rn >= 0.0_dp, "Signorini: no traction")
    call check(shifted >= -rounding, "Signorini: no penetration")
    call check_close(rn*shifted, 0.0_dp, rounding, "Signorini: one or the other")
    regime = merge(3, 1, rn > 0.0_dp)
    if (problem%kernels%nc == 1) return
    bound = problem%hot(nd + 6, 1)*rn
    length = norm2(problem%impulse(2:, 1))
    call check(length <= bound*(1.0_dp + 4*epsilon(1.0_dp)), "Coulomb: in the cone")
    if (norm2(v(2:)) > rounding) then
      if (rn > 0.0_dp) regime = 2
      call check_close(length, bound, rounding, "Coulomb: sliding on the cone")
      call check_close(sum(problem%impulse(2:, 1)*v(2:)), -length*norm2(v(2:)), rounding, "Coulomb: against the sliding")
    end if
  end subroutine check_law

  !> Sweeps that keep the law velocities do the same, to rounding (the two loops are compiled apart, and may contract
  !> products and sums differently); what they keep is what each contact had right after its own update, as a sweep
  !> cut off there shows.
  subroutine test_record(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    integer, parameter :: n = 25
    type(case_t) :: plain, recording, short
    real(dp), allocatable :: law_velocity(:, :), v(:, :)
    integer :: sweep, c
    logical :: same, kept

    call make_case(dimension, friction, rotation, n, 41, plain)
    call make_case(dimension, friction, rotation, n, 41, recording)
    allocate (law_velocity(plain%kernels%nc, n), source=0.0_dp)
    allocate (v(plain%kernels%nc, 1), source=0.0_dp)
    same = .true.
    kept = .true.
    do sweep = 1, 5
      short = recording
      call plain%kernels%sweep(plain%pair, plain%hot, plain%weight, plain%velocity, plain%impulse)
      call recording%kernels%sweep_recording(recording%pair, recording%hot, recording%weight, recording%velocity, &
        & recording%impulse, law_velocity)
      same = same .and. all(abs(plain%velocity - recording%velocity) <= rounding) &
        & .and. all(abs(plain%impulse - recording%impulse) <= rounding)
      do c = 1, n
        call short%kernels%sweep(short%pair(:, c:c), short%hot(:, c:c), short%weight, short%velocity, short%impulse(:, c:c))
        call short%kernels%contact_velocity(short%pair(:, c:c), short%hot(:, c:c), short%velocity, v)
        kept = kept .and. all(abs(v(:, 1) - law_velocity(:, c)) <= rounding)
      end do
    end do
    call check(same, "sweeps that record do the same")
    call check(kept, "law velocities are those right after the update of each contact")
  end subroutine test_record

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
  subroutine test_components(dimension, friction, rotation)
    integer, intent(in) :: dimension
    logical, intent(in) :: friction, rotation
    type(case_t) :: problem
    real(dp), allocatable :: before(:, :), start(:, :), reaction(:, :)
    integer :: b, d

    call make_case(dimension, friction, rotation, 30, 71, problem)
    associate (kernels => problem%kernels)
      do b = 1, n_columns
        do d = 1, dimension
          problem%weight(d, b) = max(0.0_dp, draw(72, b, d))
        end do
      end do
      allocate (before(kernels%nv, n_columns), source=problem%velocity)
      allocate (start(kernels%nc, 30), source=problem%impulse)
      allocate (reaction(kernels%nv, n_columns), source=0.0_dp)
      call kernels%sweep(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse)
      start(:, :) = problem%impulse - start
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
    real(dp) :: sums(2)
    integer :: k

    do k = 0, 3
      call make_case(2 + mod(k, 2), k > 1, k > 1, 0, 1, problem)
      allocate (before(problem%kernels%nv, n_columns), source=problem%velocity)
      call problem%kernels%sweep(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse)
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
