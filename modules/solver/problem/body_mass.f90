!> The mass matrix of a body and its inverse: the one place that knows how they are stored.
!>
!> The inverse mass matrix of a body is a column (nw): 1/m along each axis [1/kg] and, where bodies turn, 1/I [1/(kg m^2)], 0 for
!> what cannot move. The last row holds for all components of a velocity from there on, so that the matrix of disks and spheres is
!> diagonal and takes nd + 1 rows. Columns of `inverse_mass` are the undivided bodies, columns of `weight` the masses as a method
!> shares them out. A body with another matrix, such as one with three moments of inertia in its own axes, takes more rows and
!> another case in these procedures; only the loops over contacts of disks and spheres (gravier_kernel_table) read columns themselves.
module gravier_body_mass
  use gravier_kinds, only: dp
  implicit none
  private
  public :: can_move, inverse_of_translation, diagonal_mass, multiply_mass, mass_product
  public :: add_inverse_mass, subtract_inverse_mass, apply_inverse_mass, velocities_under, inverse_product, inverse_products

contains

  !> Whether component `d` of the velocity of a body can change.
  pure logical function can_move(inverse, d)
    !> column of the undivided body (nw)
    real(dp), intent(in), contiguous :: inverse(:)
    integer, intent(in) :: d
    can_move = inverse(min(d, size(inverse))) > 0.0_dp
  end function can_move

  !> One over the mass of a body [1/kg], 0 where it cannot move along any axis; axes that can move have the same mass.
  pure real(dp) function inverse_of_translation(inverse, nd)
    !> column of the undivided body (nw)
    real(dp), intent(in), contiguous :: inverse(:)
    !> 2 or 3
    integer, intent(in) :: nd
    inverse_of_translation = maxval(inverse(1:nd))
  end function inverse_of_translation

  !> Entry (d, d) of the mass matrix [kg, kg m^2], 0 for a component that cannot move.
  pure real(dp) function diagonal_mass(inverse, weight, d) result(mass)
    !> columns of the undivided body and of the masses that are asked for (nw)
    real(dp), intent(in), contiguous :: inverse(:), weight(:)
    integer, intent(in) :: d

    mass = 0.0_dp
    if (can_move(inverse, d)) mass = 1.0_dp/weight(min(d, size(weight)))
  end function diagonal_mass

  !> v := M v; 0 for components that cannot move.
  pure subroutine multiply_mass(inverse, weight, v)
    !> columns of the undivided body and of the masses that are asked for (nw)
    real(dp), intent(in), contiguous :: inverse(:), weight(:)
    !> (nv) [m/s, rad/s] in, [N s, N m s] out
    real(dp), intent(inout), contiguous :: v(:)
    integer :: d

    do d = 1, size(v)
      if (can_move(inverse, d)) then
        v(d) = v(d)/weight(min(d, size(weight)))
      else
        v(d) = 0.0_dp
      end if
    end do
  end subroutine multiply_mass

  !> a M b over the components that can move [J].
  pure real(dp) function mass_product(inverse, a, b) result(total)
    !> column of the undivided body (nw)
    real(dp), intent(in), contiguous :: inverse(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(in), contiguous :: a(:), b(:)
    real(dp) :: last
    integer :: d, nw

    nw = size(inverse)
    total = 0.0_dp
    do d = 1, nw - 1
      if (inverse(d) > 0.0_dp) total = total + a(d)*b(d)/inverse(d)
    end do
    last = 0.0_dp
    do d = nw, size(a)
      last = last + a(d)*b(d)
    end do
    if (inverse(nw) > 0.0_dp) total = total + last/inverse(nw)
  end function mass_product

  !> v := v + M^-1 p.
  pure subroutine add_inverse_mass(weight, p, v)
    !> (nw)
    real(dp), intent(in), contiguous :: weight(:)
    !> (nv) [N s, N m s]
    real(dp), intent(in), contiguous :: p(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(inout), contiguous :: v(:)
    integer :: d

    do d = 1, size(v)
      v(d) = v(d) + weight(min(d, size(weight)))*p(d)
    end do
  end subroutine add_inverse_mass

  !> v := v - M^-1 p.
  pure subroutine subtract_inverse_mass(weight, p, v)
    !> (nw)
    real(dp), intent(in), contiguous :: weight(:)
    !> (nv) [N s, N m s]
    real(dp), intent(in), contiguous :: p(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(inout), contiguous :: v(:)
    integer :: d

    do d = 1, size(v)
      v(d) = v(d) - weight(min(d, size(weight)))*p(d)
    end do
  end subroutine subtract_inverse_mass

  !> v := M^-1 p.
  pure subroutine apply_inverse_mass(weight, p, v)
    !> (nw)
    real(dp), intent(in), contiguous :: weight(:)
    !> (nv) [N s, N m s]
    real(dp), intent(in), contiguous :: p(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(out), contiguous :: v(:)
    integer :: d

    do d = 1, size(v)
      v(d) = weight(min(d, size(weight)))*p(d)
    end do
  end subroutine apply_inverse_mass

  !> v := v_free + M^-1 p of all bodies.
  pure subroutine velocities_under(inverse_mass, p, v_free, v)
    !> (nw, n)
    real(dp), intent(in), contiguous :: inverse_mass(:, :)
    !> (nv, n) [N s, N m s]
    real(dp), intent(in), contiguous :: p(:, :)
    !> (nv, n) [m/s, rad/s]
    real(dp), intent(in), contiguous :: v_free(:, :)
    real(dp), intent(inout), contiguous :: v(:, :)
    integer :: b, d, nw

    nw = size(inverse_mass, 1)
    do b = 1, size(v, 2)
      do d = 1, nw - 1
        v(d, b) = v_free(d, b) + inverse_mass(d, b)*p(d, b)
      end do
      do d = nw, size(v, 1)
        v(d, b) = v_free(d, b) + inverse_mass(nw, b)*p(d, b)
      end do
    end do
  end subroutine velocities_under

  !> a M^-1 b [J].
  pure real(dp) function inverse_product(weight, a, b) result(total)
    !> (nw)
    real(dp), intent(in), contiguous :: weight(:)
    !> (nv) [N s, N m s]
    real(dp), intent(in), contiguous :: a(:), b(:)
    integer :: d

    total = 0.0_dp
    do d = 1, size(a)
      total = total + weight(min(d, size(weight)))*a(d)*b(d)
    end do
  end function inverse_product

  !> The products x M^-1 x, x M^-1 y, y M^-1 y, x M^-1 z, y M^-1 z and z M^-1 z of impulses on bodies, a copy of a shared body
  !> counting with its part [J].
  subroutine inverse_products(inverse_mass, copies, x, y, z, products)
    !> (nw, bodies and more)
    real(dp), intent(in), contiguous :: inverse_mass(:, :)
    !> of each body (bodies)
    integer, intent(in), contiguous :: copies(:)
    !> (nv, bodies and more) [N s, N m s]
    real(dp), intent(in), contiguous :: x(:, :), y(:, :), z(:, :)
    real(dp), intent(out) :: products(:)
    real(dp) :: share, sums(6)
    integer :: b, d, nw

    nw = size(inverse_mass, 1)
    sums(:) = 0.0_dp
    do b = 1, size(copies)
      share = 1.0_dp/copies(b)
      do d = 1, nw - 1
        call add(share*inverse_mass(d, b), x(d, b), y(d, b), z(d, b))
      end do
      do d = nw, size(x, 1)
        call add(share*inverse_mass(nw, b), x(d, b), y(d, b), z(d, b))
      end do
    end do
    products(:) = sums

  contains

    subroutine add(inverse, x, y, z)
      real(dp), intent(in) :: inverse, x, y, z

      sums(1) = sums(1) + inverse*x*x
      sums(2) = sums(2) + inverse*x*y
      sums(3) = sums(3) + inverse*y*y
      sums(4) = sums(4) + inverse*x*z
      sums(5) = sums(5) + inverse*y*z
      sums(6) = sums(6) + inverse*z*z
    end subroutine add

  end subroutine inverse_products

end module gravier_body_mass
