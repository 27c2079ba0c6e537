!> Signorini's condition and Coulomb's law on one contact, v = W r + b with a full block W, solved exactly.
!>
!> Where b_n < 0 the contact closes: v_n = 0, and r = r_n (1, p) with |p| <= mu, r_n = -b_n/(W_nn + W_nt p). Multiplied by
!> W_nn + W_nt p > 0, the tangential velocity is affine in p: N p - c, N = -b_n W_tt + b_t W_nt, c = b_n W_tn - b_t W_nn. The
!> law asks for (N + l) p = c with l = 0 and |p| <= mu (stick) or l >= 0 and |p| = mu (slip): in two dimensions p is c/N cut
!> to [-mu, mu], in three l is the root of a secular equation. W_nn + W_nt p > 0 holds on the whole branch l > -min(eigenvalues
!> of N) where the symmetric part of W is positive definite, so that each root there is a solution.
module gravier_local_law
  use gravier_kinds, only: dp
  implicit none
  private
  public :: solve_law_2d, solve_law_3d

  !> Newton's steps and bisections on the secular equation; bisections alone end after these
  integer, parameter :: most_steps = 120
  !> |b_n|/|b| below which results are refined
  real(dp), parameter :: small_approach = 1.0e-2_dp
  !> a refinement that turns a direction by more [rad] is none
  real(dp), parameter :: largest_turn = 1.0e-2_dp

contains

  !> Impulse of one contact in two dimensions.
  pure subroutine solve_law_2d(w, b, mu, r)
    !> W_nn, W_tn, W_nt, W_tt; W_nn > 0
    real(dp), intent(in) :: w(4)
    !> velocity (n, t) without the impulse of this contact
    real(dp), intent(in) :: b(2)
    !> coefficient of friction >= 0
    real(dp), intent(in) :: mu
    !> impulse (n, t)
    real(dp), intent(out) :: r(2)
    real(dp) :: slope, load, ratio
    logical :: sticks

    r = 0.0_dp
    if (b(1) >= 0.0_dp) return
    slope = b(2)*w(3) - b(1)*w(4)
    load = b(1)*w(2) - b(2)*w(1)
    sticks = slope > 0.0_dp .and. abs(load) <= mu*slope
    if (sticks) then
      ratio = load/slope
    else if (load > 0.0_dp) then
      ratio = mu
    else if (load < 0.0_dp) then
      ratio = -mu
    else
      ratio = 0.0_dp
    end if
    r(1) = normal_impulse(w(1), w(1) + w(3)*ratio, b(1))
    r(2) = ratio*r(1)
    if (sticks .and. loses_digits(b)) call refine_stick_2d(w, b, r)
  end subroutine solve_law_2d

  !> Impulse of one contact in three dimensions.
  pure subroutine solve_law_3d(w, b, mu, r)
    !> the block by columns; W_nn > 0
    real(dp), intent(in) :: w(9)
    !> velocity (n, t, s) without the impulse of this contact
    real(dp), intent(in) :: b(3)
    !> coefficient of friction >= 0
    real(dp), intent(in) :: mu
    !> impulse (n, t, s)
    real(dp), intent(out) :: r(3)
    real(dp) :: slope(4), load(2), ratio(2)
    logical :: sticks

    r = 0.0_dp
    if (b(1) >= 0.0_dp) return
    slope(1) = b(2)*w(4) - b(1)*w(5)
    slope(2) = b(3)*w(4) - b(1)*w(6)
    slope(3) = b(2)*w(7) - b(1)*w(8)
    slope(4) = b(3)*w(7) - b(1)*w(9)
    load(1) = b(1)*w(2) - b(2)*w(1)
    load(2) = b(1)*w(3) - b(3)*w(1)
    call solve_on_disc(slope, load, mu, ratio, sticks)
    r(1) = normal_impulse(w(1), w(1) + w(4)*ratio(1) + w(7)*ratio(2), b(1))
    r(2) = ratio(1)*r(1)
    r(3) = ratio(2)*r(1)
    if (.not. loses_digits(b)) return
    if (sticks) then
      call refine_stick_3d(w, b, r)
    else if (mu > 0.0_dp) then
      call refine_slip(w, b, mu, r)
    end if
  end subroutine solve_law_3d

  !> Whether the approach is so slow beside the slip that refinement pays: N p - c loses digits as |b|/|b_n|.
  pure logical function loses_digits(b)
    real(dp), intent(in) :: b(:)
    loses_digits = abs(b(1)) < small_approach*maxval(abs(b))
  end function loses_digits

  !> -b_n/(W_nn + W_nt p). Where the block is not positive definite there may be no solution: then without friction.
  pure real(dp) function normal_impulse(w_normal, w_along, b_normal) result(r_normal)
    real(dp), intent(in) :: w_normal, w_along, b_normal

    if (w_along > epsilon(1.0_dp)*w_normal) then
      r_normal = -b_normal/w_along
    else
      r_normal = -b_normal/w_normal
    end if
  end function normal_impulse

  !> One step of Newton's method on v_n = 0 and the part of v_t across r_t = 0, in r_n and the direction of r_t.
  pure subroutine refine_slip(w, b, mu, r)
    real(dp), intent(in) :: w(9), b(3), mu
    real(dp), intent(inout) :: r(3)
    real(dp) :: v(3), along(2), slope(4), load(2), change(2), length
    logical :: regular

    length = length_of(r(2:3))
    if (length <= 0.0_dp) return
    along = r(2:3)/length
    v = b + w(1:3)*r(1) + w(4:6)*r(2) + w(7:9)*r(3)
    ! derivatives of v_n, then of the part across, by r_n and by the length of arc on the unit disc
    slope(1) = w(1) + mu*(w(4)*along(1) + w(7)*along(2))
    slope(2) = across(w(2) + mu*(w(5)*along(1) + w(8)*along(2)), w(3) + mu*(w(6)*along(1) + w(9)*along(2)))
    slope(3) = length*across(w(4), w(7))
    slope(4) = length*across(across(w(5), w(8)), across(w(6), w(9))) - (along(1)*v(2) + along(2)*v(3))
    load(1) = -v(1)
    load(2) = -across(v(2), v(3))
    call solve_shifted(slope, 0.0_dp, load, change, regular)
    if (.not. regular .or. abs(change(2)) > largest_turn) return
    r(1) = r(1) + change(1)
    r(2) = along(1) - change(2)*along(2)
    r(3) = along(2) + change(2)*along(1)
    r(2:3) = r(2:3)*(mu*r(1)/length_of(r(2:3)))

  contains

    !> of a vector (t, s), the part at a right angle to the direction of r_t
    pure real(dp) function across(t, s)
      real(dp), intent(in) :: t, s
      across = along(1)*s - along(2)*t
    end function across

  end subroutine refine_slip

  !> One step of refinement of W r + b = 0.
  pure subroutine refine_stick_2d(w, b, r)
    real(dp), intent(in) :: w(4), b(2)
    real(dp), intent(inout) :: r(2)
    real(dp) :: v(2), complement, change

    v = b + w(1:2)*r(1) + w(3:4)*r(2)
    complement = w(4) - w(2)*w(3)/w(1)
    if (complement <= epsilon(1.0_dp)*w(4)) return
    change = (w(2)/w(1)*v(1) - v(2))/complement
    r(1) = r(1) - (v(1) + w(3)*change)/w(1)
    r(2) = r(2) + change
  end subroutine refine_stick_2d

  !> The same in three dimensions.
  pure subroutine refine_stick_3d(w, b, r)
    real(dp), intent(in) :: w(9), b(3)
    real(dp), intent(inout) :: r(3)
    real(dp) :: v(3), complement(4), load(2), change(2)
    logical :: regular

    v = b + w(1:3)*r(1) + w(4:6)*r(2) + w(7:9)*r(3)
    complement(1:2) = w(5:6) - w(2:3)*(w(4)/w(1))
    complement(3:4) = w(8:9) - w(2:3)*(w(7)/w(1))
    load = w(2:3)*(v(1)/w(1)) - v(2:3)
    call solve_shifted(complement, 0.0_dp, load, change, regular)
    if (.not. regular) return
    r(1) = r(1) - (v(1) + w(4)*change(1) + w(7)*change(2))/w(1)
    r(2:3) = r(2:3) + change
  end subroutine refine_stick_3d

  !> p in the disc of radius mu with (N + l) p = c, l >= 0, and l = 0 unless |p| = mu.
  pure subroutine solve_on_disc(n, c, mu, p, inside)
    !> by columns
    real(dp), intent(in) :: n(4)
    real(dp), intent(in) :: c(2), mu
    real(dp), intent(out) :: p(2)
    !> l = 0, by a regular N
    logical, intent(out) :: inside
    real(dp) :: low, high, l, next, length, step(2)
    logical :: regular
    integer :: k

    p = 0.0_dp
    inside = .false.
    if (mu <= 0.0_dp .or. (abs(c(1)) <= 0.0_dp .and. abs(c(2)) <= 0.0_dp)) return
    low = greatest_pole(n)
    if (low <= 0.0_dp) then
      low = 0.0_dp
      call solve_shifted(n, 0.0_dp, c, p, inside)
      if (inside) inside = p(1)**2 + p(2)**2 <= mu**2
      if (inside) return
    end if
    ! |p| <= mu beyond `high`
    high = length_of(c)/mu + sqrt(n(1)**2 + n(2)**2 + n(3)**2 + n(4)**2)
    l = low
    do k = 1, most_steps
      call solve_shifted(n, l, c, p, regular)
      next = 0.5_dp*(low + high)
      if (.not. regular) then
        low = l
      else
        length = length_of(p)
        if (abs(length - mu) <= 2.0_dp*epsilon(mu)*mu) exit
        if (length > mu) then
          low = l
        else
          high = l
        end if
        ! Newton's step on 1/|p(l)| = 1/mu, which is nearly straight
        call solve_shifted(n, l, p, step, regular)
        next = l + (length - mu)/mu*length**2/dot_product(p, step)
        if (.not. (next > low .and. next < high)) next = 0.5_dp*(low + high)
      end if
      if (abs(next - l) <= epsilon(l)*abs(l)) exit
      l = next
    end do
    p = p*(mu/length_of(p))
  end subroutine solve_on_disc

  !> |x|, faster than norm2
  pure real(dp) function length_of(x)
    real(dp), intent(in) :: x(2)
    length_of = sqrt(x(1)**2 + x(2)**2)
  end function length_of

  !> Greatest l for which N + l is singular; negative where there is none above 0.
  pure real(dp) function greatest_pole(n) result(pole)
    real(dp), intent(in) :: n(4)
    real(dp) :: half_trace, determinant, discriminant

    half_trace = 0.5_dp*(n(1) + n(4))
    determinant = n(1)*n(4) - n(2)*n(3)
    pole = -1.0_dp
    if (half_trace > 0.0_dp .and. determinant > 0.0_dp) return
    discriminant = (0.5_dp*(n(1) - n(4)))**2 + n(2)*n(3)
    if (discriminant >= 0.0_dp) pole = sqrt(discriminant) - half_trace
  end function greatest_pole

  !> (N + l) x = c.
  pure subroutine solve_shifted(n, l, c, x, regular)
    real(dp), intent(in) :: n(4), l, c(2)
    real(dp), intent(out) :: x(2)
    logical, intent(out) :: regular
    real(dp) :: a, d, determinant

    a = n(1) + l
    d = n(4) + l
    determinant = a*d - n(2)*n(3)
    regular = abs(determinant) > epsilon(a)*max(abs(a*d), abs(n(2)*n(3)))
    x = c
    if (.not. regular) return
    x(1) = (d*c(1) - n(3)*c(2))/determinant
    x(2) = (a*c(2) - n(2)*c(1))/determinant
  end subroutine solve_shifted

end module gravier_local_law
