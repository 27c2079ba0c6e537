!> The exact solution of Coulomb's law on one contact: known answers, and the law itself on random blocks.
program test_local_law
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_friction_cone, only: project_on_cone
  use gravier_local_law, only: solve_law_2d, solve_law_3d
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  !> the law, relative to |b|: some roundings of a solution whose condition is bounded by the blocks drawn below
  real(dp), parameter :: exact = 1.0e-12_dp
  integer, parameter :: stick = 1, slip = 2, take_off = 3

  call check_known_answers()
  call check_random_blocks(2)
  call check_random_blocks(3)
  call check_singular_blocks()
  call check_projection()
  call finish_checks()

contains

  !> Blocks whose answers are known.
  subroutine check_known_answers()
    real(dp), parameter :: diagonal(9) = [2.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 4.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 4.0_dp]
    real(dp) :: r(3), r2(2)

    call solve_law_3d(diagonal, [1.0_dp, 3.0_dp, -5.0_dp], 0.5_dp, r)
    call check(all(abs(r) <= 0.0_dp), "a contact that opens carries nothing")
    call solve_law_3d(diagonal, [-2.0_dp, 0.4_dp, -0.8_dp], 0.5_dp, r)
    call check_close(maxval(abs(r - [1.0_dp, -0.1_dp, 0.2_dp])), 0.0_dp, exact, "stick: r = -b/W where that is in the cone")
    call solve_law_3d(diagonal, [-2.0_dp, 6.0_dp, -8.0_dp], 0.5_dp, r)
    call check_close(maxval(abs(r - [1.0_dp, -0.3_dp, 0.4_dp])), 0.0_dp, exact, "slip against the velocity, at mu r_n")
    call solve_law_3d(diagonal, [-2.0_dp, 6.0_dp, -8.0_dp], 0.0_dp, r)
    call check_close(maxval(abs(r - [1.0_dp, 0.0_dp, 0.0_dp])), 0.0_dp, 0.0_dp, "without friction only the normal impulse")
    call solve_law_3d(diagonal, [-2.0_dp, 6.0_dp, -8.0_dp], 1.0e12_dp, r)
    call check_close(maxval(abs(r - [1.0_dp, -1.5_dp, 2.0_dp])), 0.0_dp, exact, "a huge coefficient of friction: stick")
    call solve_law_2d([2.0_dp, 0.0_dp, 0.0_dp, 4.0_dp], [-2.0_dp, -8.0_dp], 0.5_dp, r2)
    call check_close(maxval(abs(r2 - [1.0_dp, 0.5_dp])), 0.0_dp, exact, "slip in two dimensions")
    ! W couples n and t: r_n (2 + mu) = 2 with r_t = mu r_n, and v_t = r_n (1 + 4 mu) - 8 < 0
    call solve_law_2d([2.0_dp, 1.0_dp, 1.0_dp, 4.0_dp], [-2.0_dp, -8.0_dp], 0.5_dp, r2)
    call check_close(maxval(abs(r2 - [0.8_dp, 0.4_dp])), 0.0_dp, exact, "slip with a full block")
  end subroutine check_known_answers

  !> The law on positive definite blocks, symmetric or not, nearly singular or not, for all frictions.
  subroutine check_random_blocks(dimension)
    integer, intent(in) :: dimension
    real(dp), parameter :: frictions(6) = [0.0_dp, 0.04_dp, 0.5_dp, 1.0_dp, 10.0_dp, 1.0e8_dp]
    real(dp) :: w(dimension, dimension), b(dimension), r(dimension), worst(3), defect
    integer :: k, state, met(3)

    worst = 0.0_dp
    met = 0
    do k = 1, 60000
      call draw_block(k, w, b)
      if (dimension == 2) then
        call solve_law_2d(w, b, frictions(1 + mod(k, 6)), r)
      else
        call solve_law_3d(w, b, frictions(1 + mod(k, 6)), r)
      end if
      call measure(w, b, frictions(1 + mod(k, 6)), r, state, defect)
      met(state) = met(state) + 1
      worst(state) = max(worst(state), defect)
    end do
    call check(all(met > 1000), "all three states are met")
    call check_close(worst(stick), 0.0_dp, exact, "stick on random blocks")
    call check_close(worst(slip), 0.0_dp, exact, "slip on random blocks")
    call check_close(worst(take_off), 0.0_dp, exact, "take-off on random blocks")
  end subroutine check_random_blocks

  !> W = A A^T + small diagonal + a skew part, and b in any direction.
  subroutine draw_block(k, w, b)
    integer, intent(in) :: k
    real(dp), intent(out) :: w(:, :), b(:)
    real(dp) :: a(size(b), size(b)), skew
    integer :: i, j, d

    d = size(b)
    do j = 1, d
      do i = 1, d
        a(i, j) = 2.0_dp*hash_uniform(1, int(k, i8), i + d*j) - 1.0_dp
      end do
      b(j) = 2.0_dp*hash_uniform(2, int(k, i8), j) - 1.0_dp
    end do
    ! an approach slow beside the slip, where rounding of the reduced problem would show
    if (mod(k, 7) == 0) b(1) = 1.0e-5_dp*b(1)
    w = matmul(a, transpose(a))
    ! from blocks of condition 1e3 to about 10
    do i = 1, d
      w(i, i) = w(i, i) + merge(1.0e-3_dp, 0.3_dp, mod(k, 3) == 0)
    end do
    if (mod(k, 2) == 0) return
    skew = hash_uniform(3, int(k, i8), 1) - 0.5_dp
    w(1, 2) = w(1, 2) + skew
    w(2, 1) = w(2, 1) - skew
  end subroutine draw_block

  !> State of a contact, and by how much the law is missed, relative to |b|.
  subroutine measure(w, b, mu, r, state, defect)
    real(dp), intent(in) :: w(:, :), b(:), mu, r(:)
    integer, intent(out) :: state
    real(dp), intent(out) :: defect
    real(dp) :: v(size(b)), scale, excess

    v = matmul(w, r)
    v = v + b
    scale = norm2(b) + norm2(w)*norm2(r)
    excess = norm2(r(2:)) - mu*r(1)
    if (r(1) <= 0.0_dp) then
      state = take_off
      defect = max(norm2(r), -v(1)/scale)
    else if (excess < -1.0e-12_dp*norm2(r)) then
      state = stick
      defect = norm2(v)/scale
    else
      state = slip
      ! v_n = 0, |r_t| = mu r_n, and v_t = -|v_t| r_t/|r_t|; without friction v_t is free
      defect = max(abs(v(1))/scale, abs(excess)/norm2(r))
      if (mu > 0.0_dp) defect = max(defect, norm2(v(2:) + norm2(v(2:))*r(2:)/norm2(r(2:)))/scale)
    end if
  end subroutine measure

  !> Singular blocks: a contact that cannot turn about one axis, and one that moves along a line only.
  subroutine check_singular_blocks()
    real(dp) :: w(3, 3), b(3), r(3), v(3), along(3), defect
    integer :: state, k

    along = [1.0_dp, 0.5_dp, -0.25_dp]
    do k = 1, 2000
      b(1) = -hash_uniform(4, int(k, i8), 1)
      b(2) = hash_uniform(4, int(k, i8), 2) - 0.5_dp
      b(3) = hash_uniform(4, int(k, i8), 3) - 0.5_dp
      w = dyad(along)
      ! rank 2, then 1; a velocity out of the range cannot be stopped by any impulse, which is slip
      if (mod(k, 2) == 0) w(2, 2) = w(2, 2) + 0.7_dp
      call solve_law_3d(w, b, 0.3_dp, r)
      call measure(w, b, 0.3_dp, r, state, defect)
      call check_close(defect, 0.0_dp, exact, "the law on a singular block")
    end do
    ! in the range of W: stick, by one of many impulses
    w = dyad(along)
    b = -along
    call solve_law_3d(w, b, 0.9_dp, r)
    v = matmul(w, r)
    call check_close(norm2(v + b), 0.0_dp, exact, "stick on a block of rank 1")
  end subroutine check_singular_blocks

  !> a a^T.
  pure function dyad(a) result(w)
    real(dp), intent(in) :: a(3)
    real(dp) :: w(3, 3)
    integer :: i

    do i = 1, 3
      w(:, i) = a*a(i)
    end do
  end function dyad

  !> The projection is the point of the cone from which x - p leads along the polar cone.
  subroutine check_projection()
    real(dp) :: x(3), p(3), mu, polar
    integer :: k

    do k = 1, 1000
      x(1) = hash_uniform(5, int(k, i8), 1) - 0.5_dp
      x(2) = hash_uniform(5, int(k, i8), 2) - 0.5_dp
      x(3) = hash_uniform(5, int(k, i8), 3) - 0.5_dp
      mu = 2.0_dp*hash_uniform(5, int(k, i8), 4)
      p = x
      call project_on_cone(p, mu)
      polar = (x(1) - p(1)) + mu*norm2(x(2:) - p(2:))
      call check_close(max(norm2(p(2:)) - mu*p(1), polar, abs(dot_product(x - p, p)), 0.0_dp), 0.0_dp, exact, &
        & "projection on the cone")
    end do
    ! on the axis, where products with mu = 0 have no sign
    do k = -1, 1
      p(1) = real(k, dp)
      p(2:) = 0.0_dp
      call project_on_cone(p, 0.0_dp)
      call check_close(p(1), real(max(k, 0), dp), 0.0_dp, "projection on the cone without friction, from its axis")
    end do
  end subroutine check_projection

end program test_local_law
