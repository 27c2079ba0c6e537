!> The distance of the convex hulls of two sets of points in quadruple precision, by Wolfe's active set method (Math. Program. 11
!> (1976) 128): independent of the search that the program uses, and slow.
module gravier_hull_oracle
  use, intrinsic :: iso_fortran_env, only: real128
  use gravier_kinds, only: dp
  implicit none
  private
  public :: find_hull_distance, qp

  integer, parameter :: qp = real128
  integer, parameter :: most_steps = 1000
  !> gap of duality, in parts of distance times size, at which the search ends
  real(qp), parameter :: tight = 1.0e-24_qp

contains

  !> Distance of two hulls, and the vector from the nearest point of the second to that of the first; 0 where they overlap.
  subroutine find_hull_distance(x, y, v, sure)
    !> corners (3, n), (3, m)
    real(qp), intent(in) :: x(:, :), y(:, :)
    real(qp), intent(out) :: v(3)
    !> whether the gap of duality has closed
    logical, intent(out) :: sure
    real(qp) :: w(3, 5), share(5), scale
    integer :: pairs(2, 5), n, step, i, j

    scale = max(maxval(abs(x)), maxval(abs(y)))
    n = 1
    pairs(:, 1) = 1
    w(:, 1) = x(:, 1) - y(:, 1)
    share(1) = 1
    v(:) = w(:, 1)
    sure = .false.
    do step = 1, most_steps
      i = farthest(x, v, -1)
      j = farthest(y, v, 1)
      if (dot_product(v, v) - dot_product(v, x(:, i) - y(:, j)) <= tight*scale*sqrt(dot_product(v, v))) sure = .true.
      if (dot_product(v, v) <= (1.0e-28_qp*scale)**2) sure = .true.
      if (sure .or. any(pairs(1, 1:n) == i .and. pairs(2, 1:n) == j)) exit
      n = n + 1
      pairs(1, n) = i
      pairs(2, n) = j
      w(:, n) = x(:, i) - y(:, j)
      share(n) = 0
      call reduce(n, w, pairs, share, v)
      ! the origin is in a tetrahedron
      if (n == 4) v(:) = 0
      if (n == 4) sure = .true.
      if (sure) exit
    end do
    sure = sure .or. step < most_steps
  end subroutine find_hull_distance

  !> The point farthest along v or against it.
  pure integer function farthest(x, v, sense) result(best)
    real(qp), intent(in) :: x(:, :), v(3)
    integer, intent(in) :: sense
    real(qp) :: greatest, found
    integer :: k

    best = 1
    greatest = sense*dot_product(v, x(:, 1))
    do k = 2, size(x, 2)
      found = sense*dot_product(v, x(:, k))
      if (found <= greatest) cycle
      greatest = found
      best = k
    end do
  end function farthest

  !> Go to the nearest point of the hull of the corral: to that of its affine hull, or as far as shares stay above 0.
  subroutine reduce(n, w, pairs, share, v)
    integer, intent(inout) :: n
    real(qp), intent(inout) :: w(3, 5), share(5)
    integer, intent(inout) :: pairs(2, 5)
    real(qp), intent(out) :: v(3)
    real(qp) :: affine(5), part
    integer :: k, m, out

    do
      call solve_affine(n, w, affine)
      if (all(affine(1:n) > 0)) exit
      part = 1
      out = 0
      do k = 1, n
        if (affine(k) > 0) cycle
        if (share(k) - affine(k) > 0) then
          if (share(k)/(share(k) - affine(k)) < part .or. out == 0) then
            part = min(part, share(k)/(share(k) - affine(k)))
            out = k
          end if
        else
          part = 0
          out = k
        end if
      end do
      share(1:n) = share(1:n) + part*(affine(1:n) - share(1:n))
      m = 0
      do k = 1, n
        if (k == out) cycle
        m = m + 1
        share(m) = share(k)
        w(:, m) = w(:, k)
        pairs(:, m) = pairs(:, k)
      end do
      n = m
      if (n == 1) then
        affine(1) = 1
        exit
      end if
    end do
    share(1:n) = affine(1:n)
    v(:) = 0
    do k = 1, n
      v(:) = v + share(k)*w(:, k)
    end do
  end subroutine reduce

  !> Shares of the point of the affine hull that is nearest to the origin, by areas and volumes: squares of lengths alone would lose
  !> half of the digits where the points are nearly in a line or a plane.
  subroutine solve_affine(n, w, share)
    integer, intent(in) :: n
    real(qp), intent(in) :: w(3, 5)
    real(qp), intent(out) :: share(5)
    real(qp) :: d(3, 3), normal(3), other(3), whole
    integer :: k

    share(:) = 0
    do k = 1, min(3, n - 1)
      d(:, k) = w(:, k + 1) - w(:, 1)
    end do
    select case (n)
    case (2)
      share(2) = -dot_product(w(:, 1), d(:, 1))/dot_product(d(:, 1), d(:, 1))
    case (3)
      normal(:) = cross(d(:, 1), d(:, 2))
      whole = dot_product(normal, normal)
      other(:) = cross(d(:, 2), w(:, 1))
      if (whole > 0) share(2) = dot_product(other, normal)/whole
      other(:) = cross(w(:, 1), d(:, 1))
      if (whole > 0) share(3) = dot_product(other, normal)/whole
    case (4)
      normal(:) = cross(d(:, 2), d(:, 3))
      whole = dot_product(d(:, 1), normal)
      if (abs(whole) > 0) share(2) = -dot_product(w(:, 1), normal)/whole
      normal(:) = cross(d(:, 3), d(:, 1))
      if (abs(whole) > 0) share(3) = -dot_product(w(:, 1), normal)/whole
      normal(:) = cross(d(:, 1), d(:, 2))
      if (abs(whole) > 0) share(4) = -dot_product(w(:, 1), normal)/whole
    end select
    share(1) = 1 - sum(share(2:n))
  end subroutine solve_affine

  pure function cross(a, b) result(c)
    real(qp), intent(in) :: a(3), b(3)
    real(qp) :: c(3)

    c(1) = a(2)*b(3) - a(3)*b(2)
    c(2) = a(3)*b(1) - a(1)*b(3)
    c(3) = a(1)*b(2) - a(2)*b(1)
  end function cross

end module gravier_hull_oracle
