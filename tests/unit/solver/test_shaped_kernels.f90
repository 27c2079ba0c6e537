!> The loops over contacts between bodies with shapes, in the plane and in space, against the rows of H^T and the mass matrices
!> written out: random contacts of random bodies.
program test_shaped_kernels
  use gravier_kinds, only: dp
  use gravier_effects, only: effects_t
  use gravier_contact_kernels, only: kernels_t, lanes, contact_jacobian, contact_arms, tangents
  use gravier_body_mass, only: add_inverse_mass, inverse_product
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-12_dp
  integer, parameter :: n_bodies = 5, n_contacts = 7
  !> entries of a symmetric matrix with positive eigenvalues
  real(dp), parameter :: inertia(6) = [2.0_dp, 3.0_dp, 1.0_dp, 0.5_dp, -0.25_dp, 0.125_dp]

  !> A problem of one block, the last contacts of which have no effect.
  type :: packing_t
    integer :: pair(2, lanes) = 1
    real(dp), allocatable :: hot(:, :, :), weight(:, :), velocity(:, :), impulse(:, :, :)
  end type packing_t

  call test_all(2, .false.)
  call test_all(2, .true.)
  call test_all(3, .false.)
  call test_all(3, .true.)
  call test_disk()
  call finish_checks()

contains

  subroutine test_all(nd, shifted)
    integer, intent(in) :: nd
    logical, intent(in) :: shifted
    type(kernels_t) :: kernels
    type(packing_t) :: packing

    call kernels%choose(nd, effects_t(shapes=.true., friction=.true., tangential_restitution=shifted))
    call fill(kernels, packing)
    call test_velocities(kernels, packing)
    call test_reactions(kernels, packing)
    call test_operators(kernels, packing)
    call test_arms(kernels, packing)
    call test_sweep(kernels, packing)
    call test_versions(kernels, packing)
  end subroutine test_all

  !> Random contacts between bodies 1 to 5, of which the last one cannot move.
  subroutine fill(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(out) :: packing
    real(dp) :: normal(3)
    integer, parameter :: seed(64) = 12345
    integer :: c, b, k

    call random_seed(put=seed)
    allocate (packing%hot(lanes, kernels%nh, 1), packing%impulse(lanes, kernels%nc, 1), source=0.0_dp)
    allocate (packing%weight(kernels%nw, n_bodies), packing%velocity(kernels%nv, n_bodies))
    call random_number(packing%velocity)
    packing%velocity(:, :) = packing%velocity - 0.5_dp
    packing%weight(:, :) = 0.0_dp
    do b = 1, n_bodies - 1
      packing%weight(1:kernels%nd, b) = 1.0_dp/b
      packing%weight(kernels%nd + 1:, b) = 2.0_dp
      if (kernels%nd == 3) packing%weight(4:9, b) = inertia*b
    end do
    do c = 1, n_contacts
      packing%pair(1, c) = mod(c, n_bodies - 1) + 1
      packing%pair(2, c) = merge(n_bodies, mod(c + 1, n_bodies - 1) + 1, c > 4)
      call random_number(packing%hot(c, :, 1))
      packing%hot(c, :, 1) = packing%hot(c, :, 1) - 0.5_dp
      normal(:) = packing%hot(c, 1:3, 1)
      packing%hot(c, 1:kernels%nd, 1) = normal(1:kernels%nd)/norm2(normal(1:kernels%nd))
      packing%hot(c, kernels%row%friction, 1) = 0.4_dp
      call random_number(packing%impulse(c, :, 1))
      do k = 2, kernels%nc
        packing%impulse(c, k, 1) = 0.2_dp*(packing%impulse(c, k, 1) - 0.5_dp)*packing%impulse(c, 1, 1)
      end do
    end do
    call kernels%set_operators(packing%pair, packing%hot, packing%weight, [1.0_dp, 1.0_dp, 1.0_dp])
    packing%hot(n_contacts + 1:, :, :) = 0.0_dp
  end subroutine fill

  subroutine rows_of(kernels, packing, c, jacobian)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    integer, intent(in) :: c
    real(dp), intent(out) :: jacobian(:, :, :)

    call contact_jacobian(kernels, packing%hot, c, jacobian(:, :, 1), jacobian(:, :, 2))
  end subroutine rows_of

  !> v = H^T V.
  subroutine test_velocities(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), v(lanes, kernels%nc, 1), expected
    integer :: c, k

    call kernels%contact_velocity(packing%pair, packing%hot, packing%velocity, v)
    do c = 1, n_contacts
      call rows_of(kernels, packing, c, jacobian)
      do k = 1, kernels%nc
        expected = sum(jacobian(k, :, 1)*packing%velocity(:, packing%pair(1, c)) &
          & + jacobian(k, :, 2)*packing%velocity(:, packing%pair(2, c)))
        call check_close(v(c, k, 1), expected, rounding, "velocity of a contact")
      end do
    end do
  end subroutine test_velocities

  !> R = H r.
  subroutine test_reactions(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), reaction(kernels%nv, n_bodies), expected(kernels%nv, n_bodies)
    integer :: c, k, side

    reaction(:, :) = 0.0_dp
    expected(:, :) = 0.0_dp
    call kernels%add_reaction(packing%pair, packing%hot, packing%impulse, reaction)
    do c = 1, n_contacts
      call rows_of(kernels, packing, c, jacobian)
      do side = 1, 2
        do k = 1, kernels%nc
          associate (b => packing%pair(side, c))
            expected(:, b) = expected(:, b) + jacobian(k, :, side)*packing%impulse(c, k, 1)
          end associate
        end do
      end do
    end do
    call check_close(maxval(abs(reaction - expected)), 0.0_dp, rounding, "reactions of impulses")
  end subroutine test_reactions

  !> 1/W_nn, 1/W_tt and the couplings, with W = H^T M^-1 H.
  subroutine test_operators(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    real(dp) :: w(3, 3), largest
    integer :: c

    do c = 1, n_contacts
      call find_matrix(kernels, packing, c, w)
      call check_close(packing%hot(c, kernels%row%per_wnn, 1), 1.0_dp/w(1, 1), rounding, "one over W_nn")
      largest = w(2, 2)
      if (kernels%nd == 3) largest = 0.5_dp*(w(2, 2) + w(3, 3)) + hypot(0.5_dp*(w(2, 2) - w(3, 3)), w(2, 3))
      call check_close(packing%hot(c, kernels%row%per_wtt, 1), 1.0_dp/largest, rounding, "one over W_tt")
      call check_close(packing%hot(c, kernels%row%w_nt, 1), w(1, 2), rounding, "W_nt")
      if (kernels%nd == 3) call check_close(packing%hot(c, kernels%row%w_ns, 1), w(1, 3), rounding, "W_ns")
    end do
  end subroutine test_operators

  subroutine find_matrix(kernels, packing, c, w)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    integer, intent(in) :: c
    real(dp), intent(out) :: w(3, 3)
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), a(kernels%nv), b(kernels%nv)
    integer :: k, l, side

    w(:, :) = 0.0_dp
    call rows_of(kernels, packing, c, jacobian)
    do side = 1, 2
      do l = 1, kernels%nc
        do k = 1, kernels%nc
          a(:) = jacobian(k, :, side)
          b(:) = jacobian(l, :, side)
          w(k, l) = w(k, l) + inverse_product(packing%weight(:, packing%pair(side, c)), a, b)
        end do
      end do
    end do
  end subroutine find_matrix

  !> The moment of a direction e about a centre is c x e, with the arm c.
  subroutine test_arms(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), arm_i(kernels%nd), arm_j(kernels%nd), moment
    integer :: c, nd

    nd = kernels%nd
    do c = 1, n_contacts
      call rows_of(kernels, packing, c, jacobian)
      call contact_arms(kernels, packing%hot, c, arm_i, arm_j)
      ! the last component of the moment
      moment = arm_i(1)*jacobian(1, 2, 1) - arm_i(2)*jacobian(1, 1, 1)
      call check_close(jacobian(1, kernels%nv, 1), moment, rounding, "moment of a normal impulse on the candidate")
      moment = arm_j(1)*jacobian(2, 2, 2) - arm_j(2)*jacobian(2, 1, 2)
      call check_close(jacobian(2, kernels%nv, 2), moment, rounding, "moment of a tangential impulse on the antagonist")
    end do
  end subroutine test_arms

  !> A sweep over single contacts relaxes one after the other: the normal law, then the tangential one with the velocity that the
  !> normal impulse leaves.
  subroutine test_sweep(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    type(packing_t) :: after, expected
    real(dp) :: sums(2), change, total
    integer :: c

    after = packing
    expected = packing
    call kernels%sweep(0, after%pair, after%hot, after%weight, after%velocity, after%impulse, sums)
    change = 0.0_dp
    total = 0.0_dp
    do c = 1, n_contacts
      call relax(kernels, c, expected)
      change = change + sum((expected%impulse(c, :, 1) - packing%impulse(c, :, 1))**2)
      total = total + sum(expected%impulse(c, :, 1)**2)
    end do
    call check_close(maxval(abs(after%impulse - expected%impulse)), 0.0_dp, rounding, "impulses of a sweep")
    call check_close(maxval(abs(after%velocity - expected%velocity)), 0.0_dp, rounding, "velocities of a sweep")
    call check_close(sums(1), change, rounding, "squares of the changes")
    call check_close(sums(2), total, rounding, "squares of the impulses")
  end subroutine test_sweep

  subroutine relax(kernels, c, packing)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: c
    type(packing_t), intent(inout) :: packing
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), v(kernels%nc), r(kernels%nc), w(3, 3), p(kernels%nv), length
    integer :: k, side

    call find_matrix(kernels, packing, c, w)
    call rows_of(kernels, packing, c, jacobian)
    do k = 1, kernels%nc
      v(k) = sum(jacobian(k, :, 1)*packing%velocity(:, packing%pair(1, c)) &
        & + jacobian(k, :, 2)*packing%velocity(:, packing%pair(2, c)))
    end do
    r(:) = packing%impulse(c, :, 1)
    associate (contact => packing%hot(c, :, 1), row => kernels%row)
      r(1) = max(0.0_dp, r(1) - (v(1) + contact(row%shift))/w(1, 1))
      v(2:) = v(2:) + w(2:kernels%nc, 1)*(r(1) - packing%impulse(c, 1, 1))
      if (row%shift_t > 0) v(2:) = v(2:) + contact(row%shift_t:row%shift_t + kernels%nc - 2)
      r(2:) = r(2:) - v(2:)*contact(row%per_wtt)
      length = norm2(r(2:))
      if (length > contact(row%friction)*r(1)) r(2:) = r(2:)*(contact(row%friction)*r(1)/length)
    end associate
    do side = 1, 2
      p(:) = 0.0_dp
      do k = 1, kernels%nc
        p(:) = p + jacobian(k, :, side)*(r(k) - packing%impulse(c, k, 1))
      end do
      call add_inverse_mass(packing%weight(:, packing%pair(side, c)), p, packing%velocity(:, packing%pair(side, c)))
    end do
    packing%impulse(c, :, 1) = r
  end subroutine relax

  !> The other versions of a sweep do the same, and what they are named for.
  subroutine test_versions(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(in) :: packing
    type(packing_t) :: plain, other
    real(dp) :: sums(2), law_velocity(lanes, kernels%nc, 1), previous(lanes, kernels%nc, 1), residuals(3)

    plain = packing
    call kernels%sweep(0, plain%pair, plain%hot, plain%weight, plain%velocity, plain%impulse, sums)
    other = packing
    law_velocity(:, :, :) = 0.0_dp
    call kernels%sweep_recording(0, other%pair, other%hot, other%weight, other%velocity, other%impulse, sums, law_velocity)
    call check_close(maxval(abs(other%impulse - plain%impulse)), 0.0_dp, rounding, "a sweep that records")
    call check(any(abs(law_velocity(1:n_contacts, 1, 1)) > 0.0_dp), "it records velocities")
    other = packing
    previous(:, :, :) = packing%impulse
    call kernels%sweep_momentum(0, other%pair, other%hot, other%weight, other%velocity, other%impulse, sums, 0.5_dp, previous)
    call check_close(maxval(abs(other%impulse - plain%impulse)), 0.0_dp, rounding, "nothing to extrapolate from")
    call check_close(maxval(abs(previous - packing%impulse)), 0.0_dp, rounding, "what was kept for the next sweep")
    call kernels%residual(packing%pair, packing%hot, packing%weight, packing%velocity, packing%impulse, residuals)
    call check(residuals(1) > 0.0_dp, "the start is no solution")
    call solve(kernels, plain)
    call kernels%residual(plain%pair, plain%hot, plain%weight, plain%velocity, plain%impulse, residuals)
    call check_close(residuals(1), 0.0_dp, 1.0e-20_dp, "what sweeps end in obeys all laws")
  end subroutine test_versions

  subroutine solve(kernels, packing)
    type(kernels_t), intent(in) :: kernels
    type(packing_t), intent(inout) :: packing
    real(dp) :: sums(2)
    integer :: k

    do k = 1, 20000
      call kernels%sweep(0, packing%pair, packing%hot, packing%weight, packing%velocity, packing%impulse, sums)
    end do
  end subroutine solve

  !> A disk on a fixed body has the same local solve as in the loops for disks.
  subroutine test_disk()
    type(kernels_t) :: round, shaped
    real(dp) :: weight(3, 2), velocity(3, 2), same(3, 2), impulse(lanes, 2, 1), sums(2)
    real(dp), allocatable :: hot(:, :, :), flat(:, :, :)
    integer :: pair(2, lanes)

    call round%choose(2, effects_t(friction=.true.))
    call shaped%choose(2, effects_t(friction=.true., shapes=.true.))
    pair(:, :) = 1
    pair(2, 1) = 2
    weight(:, 1) = [0.5_dp, 0.5_dp, 4.0_dp]
    weight(:, 2) = 0.0_dp
    velocity(:, :) = 0.0_dp
    velocity(:, 1) = [1.0_dp, -2.0_dp, 0.5_dp]
    same(:, :) = velocity
    allocate (hot(lanes, round%nh, 1), flat(lanes, shaped%nh, 1), source=0.0_dp)
    hot(1, 2, 1) = 1.0_dp
    hot(1, round%row%lever_i, 1) = 0.25_dp
    hot(1, round%row%friction, 1) = 0.3_dp
    flat(1, 2, 1) = 1.0_dp
    flat(1, shaped%row%lever_i, 1) = 0.25_dp
    flat(1, shaped%row%friction, 1) = 0.3_dp
    call round%set_operators(pair, hot, weight, [1.0_dp, 1.0_dp, 1.0_dp])
    call shaped%set_operators(pair, flat, weight, [1.0_dp, 1.0_dp, 1.0_dp])
    impulse(:, :, :) = 0.0_dp
    call round%sweep(0, pair, hot, weight, velocity, impulse, sums)
    impulse(:, :, :) = 0.0_dp
    call shaped%sweep(0, pair, flat, weight, same, impulse, sums)
    call check_close(maxval(abs(velocity - same)), 0.0_dp, 1.0e-15_dp, "a disk among bodies with shapes")
  end subroutine test_disk

end program test_shaped_kernels
