!> The loops over compliant contacts: without compliance they are those of rigid ones, with it they solve the law for v + s + a r,
!> in blocks and one by one, with momentum, and with a record of the velocities.
program test_compliant_kernels
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_effects, only: effects_t
  use gravier_random_hash, only: hash_uniform
  use gravier_contact_data, only: lanes, n_blocks, lane_of, block_of
  use gravier_contact_kernels, only: kernels_t
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  !> Contacts c of a body c with one of the bodies after them, which cannot move: no two share a body that moves.
  type :: case_t
    type(kernels_t) :: kernels
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: hot(:, :, :), impulse(:, :, :), weight(:, :), velocity(:, :)
  end type case_t

  integer, parameter :: n = lanes + 3
  !> of numbers of size 1
  real(dp), parameter :: rounding = 1.0e-13_dp
  integer :: dimension, k, trial
  type(effects_t) :: effects
  !> contacts that stick, slide and are open
  integer :: met(3)

  call MPI_Init()
  met(:) = 0
  do dimension = 2, 3
    do k = 1, 3
      effects = effects_t(friction=.true., tangential_restitution=.true., rolling=k == 2, shapes=k == 3, compliance=.true.)
      do trial = 1, 20
        call test_neutral()
        call test_law()
        call test_record()
        call test_momentum()
      end do
    end do
  end do
  call check(all(met > 100), "contacts that stick, slide and are open met")
  call finish_checks()
  call MPI_Finalize()

contains

  !> Uniform in (-1, 1).
  real(dp) function draw(c, stream)
    integer, intent(in) :: c, stream
    draw = 2*hash_uniform(100*dimension + 1000*k + trial, int(c, i8), stream) - 1.0_dp
  end function draw

  !> The contacts; the same but for compliances with the effects of compliant and of rigid ones.
  subroutine make_case(chosen, compliance, problem)
    type(effects_t), intent(in) :: chosen
    !> factor of the compliances
    real(dp), intent(in) :: compliance
    type(case_t), intent(out) :: problem
    integer :: c, d

    call problem%kernels%choose(dimension, chosen)
    associate (kernels => problem%kernels)
      allocate (problem%pair(2, lanes*n_blocks(n)), source=1)
      allocate (problem%hot(lanes, kernels%nh, n_blocks(n)), problem%impulse(lanes, kernels%nc, n_blocks(n)), source=0.0_dp)
      allocate (problem%weight(kernels%nw, 2*n), problem%velocity(kernels%nv, 2*n), source=0.0_dp)
      do c = 1, n
        problem%pair(1, c) = c
        problem%pair(2, c) = n + c
        problem%weight(1:dimension, c) = 1.5_dp + draw(c, 1)
        problem%weight(dimension + 1:min(kernels%nw, 2*dimension), c) = 2.5_dp + draw(c, 2)
        do d = 1, kernels%nv
          problem%velocity(d, c) = draw(c, 2 + d)
        end do
        do d = 1, kernels%nc
          problem%impulse(lane_of(c), d, block_of(c)) = draw(c, 10 + d)
        end do
        problem%impulse(lane_of(c), 1, block_of(c)) = abs(draw(c, 11))
        call fill(problem, c, compliance)
      end do
      call kernels%set_operators(problem%pair, problem%hot, problem%weight, [1.0_dp, 1.0_dp, 1.0_dp])
      problem%hot(lane_of(n) + 1:, :, block_of(n)) = 0.0_dp
    end associate
  end subroutine make_case

  subroutine fill(problem, c, compliance)
    type(case_t), intent(inout) :: problem
    integer, intent(in) :: c
    real(dp), intent(in) :: compliance
    real(dp) :: normal(dimension)
    integer :: d

    do d = 1, dimension
      normal(d) = draw(c, 20 + d)
    end do
    associate (contact => problem%hot(lane_of(c), :, block_of(c)), row => problem%kernels%row)
      contact(1:dimension) = normal/norm2(normal)
      contact(row%shift) = 0.5_dp*draw(c, 25)
      contact(row%friction) = 0.6_dp + 0.4_dp*draw(c, 26)
      do d = 0, dimension - 2
        contact(row%shift_t + d) = draw(c, 27 + d)
      end do
      if (row%lever_i > 0) contact(row%lever_i) = 0.5_dp + 0.4_dp*draw(c, 30)
      if (row%arm_i > 0) contact(row%arm_i) = 0.3_dp*draw(c, 31)
      if (row%arm_i > 0 .and. dimension == 3) then
        contact(row%arm_i + 1) = 0.3_dp*draw(c, 32)
        contact(row%arm_i + 2) = 0.3_dp*draw(c, 33)
      end if
      if (row%rolling_radius > 0) contact(row%rolling_radius) = 0.5_dp
      if (row%rolling_friction > 0) contact(row%rolling_friction) = 0.2_dp
      if (row%pivoting_friction > 0) contact(row%pivoting_friction) = 0.1_dp
      if (row%compliance_n == 0) return
      contact(row%compliance_n) = compliance*(1.0_dp + draw(c, 34))
      contact(row%compliance_t) = compliance*(2.0_dp + draw(c, 35))
    end associate
  end subroutine fill

  !> Compliances of 0 leave what rigid contacts do.
  subroutine test_neutral()
    type(case_t) :: compliant, rigid
    type(effects_t) :: without
    real(dp) :: sums(2), others(2), found(3), expected(3)

    without = effects
    without%compliance = .false.
    call make_case(effects, 0.0_dp, compliant)
    call make_case(without, 0.0_dp, rigid)
    call compliant%kernels%residual(compliant%pair, compliant%hot, compliant%weight, compliant%velocity, compliant%impulse, found)
    call rigid%kernels%residual(rigid%pair, rigid%hot, rigid%weight, rigid%velocity, rigid%impulse, expected)
    call check(all(abs(found - expected) <= rounding*(1.0_dp + abs(expected))), "residual without compliance")
    call compliant%kernels%sweep(lanes, compliant%pair, compliant%hot, compliant%weight, compliant%velocity, compliant%impulse, &
      & sums)
    call rigid%kernels%sweep(lanes, rigid%pair, rigid%hot, rigid%weight, rigid%velocity, rigid%impulse, others)
    call check_close(maxval(abs(compliant%impulse - rigid%impulse)), 0.0_dp, rounding, "impulses without compliance")
    call check_close(maxval(abs(compliant%velocity - rigid%velocity)), 0.0_dp, rounding, "velocities without compliance")
    call check_close(sums(1), others(1), rounding*others(1), "changes without compliance")
  end subroutine test_neutral

  !> Relaxations end where r_n >= 0 and v_n + s + a r_n >= 0 exclude each other, and where r_t is in its disc, against v_t + s_t +
  !> a_t r_t at its rim; the residual and the tests of the velocity error are 0 there. Blocks do what single contacts do.
  subroutine test_law()
    type(case_t) :: problem, singles
    real(dp), allocatable :: v(:, :, :), previous(:, :, :), kept(:, :, :), power(:, :), local(:, :), recent(:, :)
    real(dp) :: sums(2), found(3), tests(6), largest, bound, slip(dimension - 1)
    integer :: sweep, c

    call make_case(effects, 0.7_dp, problem)
    call make_case(effects, 0.7_dp, singles)
    call problem%kernels%sweep(lanes, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
    call singles%kernels%sweep(0, singles%pair, singles%hot, singles%weight, singles%velocity, singles%impulse, sums)
    call check_close(maxval(abs(problem%impulse - singles%impulse)), 0.0_dp, rounding, "blocks and single contacts")
    do sweep = 1, 400
      call problem%kernels%sweep(lanes, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums)
    end do
    associate (kernels => problem%kernels, row => problem%kernels%row)
      allocate (v, previous, mold=problem%impulse)
      allocate (kept(lanes, dimension, 0))
      allocate (power(lanes, n_blocks(n)))
      allocate (local, recent, mold=problem%velocity)
      call kernels%residual(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, found)
      call check_close(found(1), 0.0_dp, rounding**2*n, "residual at the solution")
      previous(:, :, :) = 0.0_dp
      local(:, :) = 0.0_dp
      recent(:, :) = 0.0_dp
      largest = 0.0_dp
      call kernels%make_tests(problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, problem%impulse, &
        & previous, power, local, recent, kept, tests, largest)
      call check_close(sqrt(largest), 0.0_dp, 100*rounding, "violation at the solution")
      call kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
      do c = 1, n
        associate (contact => problem%hot(lane_of(c), :, block_of(c)), r => problem%impulse(lane_of(c), :, block_of(c)), &
          & u => v(lane_of(c), :, block_of(c)))
          u(1) = u(1) + contact(row%shift) + contact(row%compliance_n)*r(1)
          call check(r(1) >= 0.0_dp .and. u(1) >= -10*rounding .and. abs(r(1)*u(1)) <= 10*rounding, "the normal law")
          slip(:) = u(2:dimension) + contact(row%shift_t:row%shift_t + dimension - 2) + contact(row%compliance_t)*r(2:dimension)
          bound = contact(row%friction)*r(1)
          call check(norm2(r(2:dimension)) <= bound*(1.0_dp + rounding) + rounding, "the bound of friction")
          if (.not. r(1) > 0.0_dp) then
            met(3) = met(3) + 1
          else if (norm2(r(2:dimension)) < bound*(1.0_dp - 1.0e-9_dp)) then
            met(1) = met(1) + 1
            call check_close(norm2(slip), 0.0_dp, 100*rounding, "what sticks is held by its spring")
          else
            met(2) = met(2) + 1
            call check_close(norm2(r(2:dimension)*norm2(slip) + bound*slip), 0.0_dp, 100*rounding, "what slides is held back")
          end if
        end associate
      end do
    end associate
  end subroutine test_law

  !> The velocity that is recorded is that of the contact under the impulse that solves its law. Between bodies with shapes the
  !> parts of an impulse change each other's velocities, and it is not.
  subroutine test_record()
    type(case_t) :: problem
    real(dp), allocatable :: recorded(:, :, :), v(:, :, :)
    real(dp) :: sums(2)

    if (effects%shapes) return
    call make_case(effects, 0.7_dp, problem)
    allocate (recorded, v, mold=problem%impulse)
    recorded(:, :, :) = 0.0_dp
    call problem%kernels%sweep_recording(lanes, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, &
      & sums, recorded)
    call problem%kernels%contact_velocity(problem%pair, problem%hot, problem%velocity, v)
    call check_close(maxval(abs(recorded(:, 1:1, :) - v(:, 1:1, :))), 0.0_dp, rounding, "recorded normal velocity")
    ! grains have one mass along all axes: their tangential operator is exact; rolling changes what it leaves
    if (.not. effects%rolling) call check_close(maxval(abs(recorded(:, 2:dimension, :) - v(:, 2:dimension, :))), 0.0_dp, rounding, &
      & "recorded tangential velocity")
  end subroutine test_record

  !> A sweep with momentum is a plain one from the extrapolated impulses, under which the velocities are.
  subroutine test_momentum()
    type(case_t) :: problem, plain
    real(dp), allocatable :: previous(:, :, :), earlier(:, :, :), recorded(:, :, :)
    real(dp), parameter :: beta = 0.4_dp
    real(dp) :: sums(2), others(2)

    call make_case(effects, 0.7_dp, problem)
    call make_case(effects, 0.7_dp, plain)
    allocate (previous, earlier, recorded, mold=problem%impulse)
    previous(:, :, :) = 0.3_dp*problem%impulse
    earlier(:, :, :) = previous
    plain%impulse(:, :, :) = plain%impulse + beta*(plain%impulse - earlier)
    call plain%kernels%sweep(lanes, plain%pair, plain%hot, plain%weight, plain%velocity, plain%impulse, others)
    call problem%kernels%sweep_momentum(lanes, problem%pair, problem%hot, problem%weight, problem%velocity, problem%impulse, sums, &
      & beta, previous)
    call check_close(maxval(abs(problem%impulse - plain%impulse)), 0.0_dp, rounding, "impulses with momentum")
    call make_case(effects, 0.7_dp, problem)
    previous(:, :, :) = earlier
    recorded(:, :, :) = 0.0_dp
    call problem%kernels%sweep_momentum_recording(lanes, problem%pair, problem%hot, problem%weight, problem%velocity, &
      & problem%impulse, sums, beta, previous, recorded)
    call check_close(maxval(abs(problem%impulse - plain%impulse)), 0.0_dp, rounding, "impulses with momentum and a record")
    call check_close(sums(1), others(1), rounding*others(1), "changes with momentum")
  end subroutine test_momentum

end program test_compliant_kernels
