!> The mass matrix of a body and its inverse: the one place that knows how moments of inertia are stored.
!>
!> The inverse mass matrix of a body is a column (nw): 1/m along each axis [1/kg] and, where bodies turn, 1/I [1/(kg m^2)], 0 for
!> what cannot move. The last row holds for all components of a velocity from there on, so that the matrix of disks and spheres is
!> diagonal and takes nd + 1 rows. In space, bodies with shapes have a symmetric matrix J^-1 in the place of 1/I: its entries xx,
!> yy, zz, xy, xz and yz in global axes are rows 4 to 9. Columns of `inverse_mass` are the undivided bodies, columns of `weight` the
!> masses as a method shares them out. Beside these procedures the loops over contacts (gravier_kernel_table) and
!> gravier_contact_operator read columns; others read their first rows alone, 1/m.
module gravier_body_mass
  use gravier_kinds, only: dp
  implicit none
  private
  public :: can_move, inverse_of_translation, mass_column, multiply_mass, mass_product, multiply_symmetric, invert_symmetric
  public :: add_inverse_mass, subtract_inverse_mass, apply_inverse_mass, velocities_under, inverse_product, inverse_products
  public :: are_uneven

  !> rows of a column with a symmetric matrix
  integer, parameter :: full = 9
  !> fraction of the bodies that have as much mass as all, were they as heavy as the mean of the mass, below which masses are uneven
  real(dp), parameter :: even_share = 0.25_dp

contains

  !> Whether few heavy bodies have most of the mass, by the number of bodies, their mass and the sum of their squared masses.
  pure logical function are_uneven(number, mass, squares)
    !> [kg], [kg^2]
    real(dp), intent(in) :: number, mass, squares
    are_uneven = mass**2 < even_share*number*squares
  end function are_uneven

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

  !> The product of a symmetric matrix, given by its entries xx, yy, zz, xy, xz and yz, and a vector.
  pure subroutine multiply_symmetric(j, a, b)
    real(dp), intent(in) :: j(6), a(3)
    real(dp), intent(out) :: b(3)

    b(1) = j(1)*a(1) + j(4)*a(2) + j(5)*a(3)
    b(2) = j(4)*a(1) + j(2)*a(2) + j(6)*a(3)
    b(3) = j(5)*a(1) + j(6)*a(2) + j(3)*a(3)
  end subroutine multiply_symmetric

  !> The inverse of a symmetric matrix with positive eigenvalues, both by their entries xx, yy, zz, xy, xz and yz.
  pure subroutine invert_symmetric(j, inverse)
    real(dp), intent(in) :: j(6)
    real(dp), intent(out) :: inverse(6)
    real(dp) :: determinant

    inverse(1) = j(2)*j(3) - j(6)**2
    inverse(2) = j(1)*j(3) - j(5)**2
    inverse(3) = j(1)*j(2) - j(4)**2
    inverse(4) = j(5)*j(6) - j(4)*j(3)
    inverse(5) = j(4)*j(6) - j(5)*j(2)
    inverse(6) = j(4)*j(5) - j(6)*j(1)
    determinant = j(1)*inverse(1) + j(4)*inverse(4) + j(5)*inverse(5)
    inverse(:) = inverse/determinant
  end subroutine invert_symmetric

  !> Column `d` of the mass matrix [kg, kg m^2], 0 for a component that cannot move.
  pure subroutine mass_column(inverse, weight, d, column)
    !> columns of the undivided body and of the masses that are asked for (nw)
    real(dp), intent(in), contiguous :: inverse(:), weight(:)
    integer, intent(in) :: d
    !> (nv)
    real(dp), intent(out), contiguous :: column(:)

    column(:) = 0.0_dp
    column(d) = 1.0_dp
    call multiply_mass(inverse, weight, column)
  end subroutine mass_column

  !> v := M v; 0 for components that cannot move.
  pure subroutine multiply_mass(inverse, weight, v)
    !> columns of the undivided body and of the masses that are asked for (nw)
    real(dp), intent(in), contiguous :: inverse(:), weight(:)
    !> (nv) [m/s, rad/s] in, [N s, N m s] out
    real(dp), intent(inout), contiguous :: v(:)
    real(dp) :: inertia(6), spin(3)
    integer :: d

    do d = 1, merge(3, size(v), size(weight) == full)
      if (can_move(inverse, d)) then
        v(d) = v(d)/weight(min(d, size(weight)))
      else
        v(d) = 0.0_dp
      end if
    end do
    if (size(weight) < full) return
    spin(:) = v(4:6)
    v(4:6) = 0.0_dp
    if (.not. can_move(inverse, 4)) return
    call invert_symmetric(weight(4:9), inertia)
    call multiply_symmetric(inertia, spin, v(4:6))
  end subroutine multiply_mass

  !> a M b over the components that can move [J].
  pure real(dp) function mass_product(inverse, a, b) result(total)
    !> column of the undivided body (nw)
    real(dp), intent(in), contiguous :: inverse(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(in), contiguous :: a(:), b(:)
    real(dp) :: last, inertia(6), turned(3)
    integer :: d, nw

    nw = size(inverse)
    total = 0.0_dp
    if (nw == full) then
      do d = 1, 3
        if (inverse(d) > 0.0_dp) total = total + a(d)*b(d)/inverse(d)
      end do
      if (.not. inverse(4) > 0.0_dp) return
      call invert_symmetric(inverse(4:9), inertia)
      call multiply_symmetric(inertia, b(4:6), turned)
      total = total + dot_product(a(4:6), turned)
      return
    end if
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
    real(dp) :: turned(3)
    integer :: d

    do d = 1, merge(3, size(v), size(weight) == full)
      v(d) = v(d) + weight(min(d, size(weight)))*p(d)
    end do
    if (size(weight) < full) return
    call multiply_symmetric(weight(4:9), p(4:6), turned)
    v(4:6) = v(4:6) + turned
  end subroutine add_inverse_mass

  !> v := v - M^-1 p.
  pure subroutine subtract_inverse_mass(weight, p, v)
    !> (nw)
    real(dp), intent(in), contiguous :: weight(:)
    !> (nv) [N s, N m s]
    real(dp), intent(in), contiguous :: p(:)
    !> (nv) [m/s, rad/s]
    real(dp), intent(inout), contiguous :: v(:)
    real(dp) :: turned(3)
    integer :: d

    do d = 1, merge(3, size(v), size(weight) == full)
      v(d) = v(d) - weight(min(d, size(weight)))*p(d)
    end do
    if (size(weight) < full) return
    call multiply_symmetric(weight(4:9), p(4:6), turned)
    v(4:6) = v(4:6) - turned
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

    do d = 1, merge(3, size(v), size(weight) == full)
      v(d) = weight(min(d, size(weight)))*p(d)
    end do
    if (size(weight) == full) call multiply_symmetric(weight(4:9), p(4:6), v(4:6))
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
    if (nw == full) then
      do b = 1, size(v, 2)
        v(:, b) = v_free(:, b)
        call add_inverse_mass(inverse_mass(:, b), p(:, b), v(:, b))
      end do
      return
    end if
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
    real(dp) :: turned(3)
    integer :: d

    total = 0.0_dp
    do d = 1, merge(3, size(a), size(weight) == full)
      total = total + weight(min(d, size(weight)))*a(d)*b(d)
    end do
    if (size(weight) < full) return
    call multiply_symmetric(weight(4:9), b(4:6), turned)
    total = total + dot_product(a(4:6), turned)
  end function inverse_product

  !> The products x M^-1 x, x M^-1 y, y M^-1 y, x M^-1 z, y M^-1 z and z M^-1 z of impulses on bodies, a copy of a shared body
  !> counting with its part [J].
  subroutine inverse_products(inverse_mass, copies, x, y, z, products, factors)
    !> (nw, bodies and more)
    real(dp), intent(in), contiguous :: inverse_mass(:, :)
    !> of each body (bodies)
    integer, intent(in), contiguous :: copies(:)
    !> (nv, bodies and more) [N s, N m s]
    real(dp), intent(in), contiguous :: x(:, :), y(:, :), z(:, :)
    real(dp), intent(out) :: products(:)
    !> of the masses; not present: 1 (bodies)
    real(dp), intent(in), contiguous, optional :: factors(:)
    real(dp) :: share, sums(6)
    integer :: b, d, nw

    nw = size(inverse_mass, 1)
    sums(:) = 0.0_dp
    do b = 1, size(copies)
      share = 1.0_dp/copies(b)
      if (present(factors)) share = share/factors(b)
      if (nw == full) then
        call add_full(share, inverse_mass(:, b), x(:, b), y(:, b), z(:, b))
        cycle
      end if
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

    !> Of a body with a symmetric matrix.
    subroutine add_full(share, inverse, x, y, z)
      real(dp), intent(in) :: share
      real(dp), intent(in), contiguous :: inverse(:), x(:), y(:), z(:)

      sums(1) = sums(1) + share*inverse_product(inverse, x, x)
      sums(2) = sums(2) + share*inverse_product(inverse, x, y)
      sums(3) = sums(3) + share*inverse_product(inverse, y, y)
      sums(4) = sums(4) + share*inverse_product(inverse, x, z)
      sums(5) = sums(5) + share*inverse_product(inverse, y, z)
      sums(6) = sums(6) + share*inverse_product(inverse, z, z)
    end subroutine add_full

  end subroutine inverse_products

end module gravier_body_mass
