!> Moreau-Jean time stepping of bodies and their mass properties.
module gravier_motion
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_orientation, only: orientation_matrix
  implicit none
  private
  public :: predict_position, advance_position
  public :: grain_volume, grain_mass, grain_inertia
  public :: free_spin, inertia_in_global_axes, spin_energy

  real(dp), parameter :: pi = acos(-1.0_dp)
  !> steps of Newton's method at most for a spin, and the change over the spin that ends them
  integer, parameter :: most_steps = 20
  real(dp), parameter :: last_change = 1.0e-15_dp

contains

  !> Configuration where contacts are detected, q_m = q_i + (1 - theta) h V_i [m].
  pure elemental real(dp) function predict_position(q, v, h, theta) result(q_m)
    real(dp), intent(in) :: q, v, h, theta
    q_m = q + (1.0_dp - theta)*h*v
  end function predict_position

  !> Configuration at the end of the step, q_{i+1} = q_m + theta h V_{i+1} [m].
  pure elemental real(dp) function advance_position(q_m, v, h, theta) result(q)
    real(dp), intent(in) :: q_m, v, h, theta
    q = q_m + theta*h*v
  end function advance_position

  !> Area of a disk [m^2] or volume of a sphere [m^3].
  pure real(dp) function grain_volume(dimension, radius) result(volume)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: radius
    if (dimension == 2) then
      volume = pi*radius**2
    else
      volume = 4.0_dp/3.0_dp*pi*radius**3
    end if
  end function grain_volume

  !> Mass of a homogeneous disk (density in kg/m^2) or sphere (kg/m^3) [kg].
  pure real(dp) function grain_mass(dimension, radius, density) result(mass)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: radius, density
    mass = density*grain_volume(dimension, radius)
  end function grain_mass

  !> Moment of inertia of a homogeneous disk, m R^2/2, or sphere, 2 m R^2/5 [kg m^2].
  pure real(dp) function grain_inertia(dimension, radius, mass) result(inertia)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: radius, mass
    inertia = merge(0.5_dp, 0.4_dp, dimension == 2)*mass*radius**2
  end function grain_inertia

  !> The spin of a body with three principal moments of inertia after a time without moments. In the axes of the body it obeys
  !> Euler's equations I w' = (I w) x w, which are integrated by the midpoint rule: it keeps the energy and the size of the angular
  !> momentum of the body exactly, whatever the time step, and is of second order. A rotation about the spin changes neither, so
  !> that the axes at the middle of the step serve for all of it. Equal moments leave the spin as it is.
  pure subroutine free_spin(principal, orientation, duration, spin)
    !> principal moments of inertia over any one scale
    real(dp), intent(in) :: principal(3)
    !> unit quaternion at the middle of the step
    real(dp), intent(in) :: orientation(4)
    !> [s]
    real(dp), intent(in) :: duration
    !> in global axes [rad/s]
    real(dp), intent(inout) :: spin(3)
    real(dp), dimension(3) :: before, after, middle, defect, change, slope
    real(dp) :: axes(3, 3), matrix(3, 3), difference(3)
    integer :: k

    difference(1) = (principal(2) - principal(3))/principal(1)
    difference(2) = (principal(3) - principal(1))/principal(2)
    difference(3) = (principal(1) - principal(2))/principal(3)
    if (.not. maxval(abs(difference)) > 0.0_dp .or. .not. norm2(spin) > 0.0_dp) return
    call orientation_matrix(orientation, axes)
    do k = 1, 3
      before(k) = sum(axes(:, k)*spin)
      matrix(k, k) = 1.0_dp
    end do
    after(:) = before
    slope(:) = 0.5_dp*duration*difference
    do k = 1, most_steps
      middle(:) = 0.5_dp*(before + after)
      defect(1) = after(1) - before(1) - duration*difference(1)*middle(2)*middle(3)
      defect(2) = after(2) - before(2) - duration*difference(2)*middle(3)*middle(1)
      defect(3) = after(3) - before(3) - duration*difference(3)*middle(1)*middle(2)
      ! row k has its derivative with respect to the other two components
      matrix(1, 2) = -slope(1)*middle(3)
      matrix(1, 3) = -slope(1)*middle(2)
      matrix(2, 1) = -slope(2)*middle(3)
      matrix(2, 3) = -slope(2)*middle(1)
      matrix(3, 1) = -slope(3)*middle(2)
      matrix(3, 2) = -slope(3)*middle(1)
      call solve_three(matrix, defect, change)
      after(:) = after - change
      if (norm2(change) <= last_change*norm2(after)) exit
    end do
    spin(:) = matmul(axes, after)
  end subroutine free_spin

  !> Solve three equations by Cramer's rule.
  pure subroutine solve_three(matrix, right, x)
    real(dp), intent(in) :: matrix(3, 3), right(3)
    real(dp), intent(out) :: x(3)
    real(dp) :: determinant, a(3), b(3)

    a(:) = cross(matrix(:, 2), matrix(:, 3))
    determinant = sum(matrix(:, 1)*a)
    x(1) = sum(right*a)/determinant
    b(:) = cross(right, matrix(:, 3))
    x(2) = sum(matrix(:, 1)*b)/determinant
    b(:) = cross(matrix(:, 2), right)
    x(3) = sum(matrix(:, 1)*b)/determinant
  end subroutine solve_three

  !> The symmetric matrix with given eigenvalues along the axes of a body, by its entries xx, yy, zz, xy, xz and yz in global axes:
  !> of principal moments of inertia the inertia, of one over them its inverse.
  pure subroutine inertia_in_global_axes(principal, orientation, entries)
    real(dp), intent(in) :: principal(3)
    !> unit quaternion
    real(dp), intent(in) :: orientation(4)
    real(dp), intent(out) :: entries(6)
    real(dp) :: axes(3, 3)
    integer :: k

    call orientation_matrix(orientation, axes)
    entries(:) = 0.0_dp
    do k = 1, 3
      entries(1) = entries(1) + principal(k)*axes(1, k)**2
      entries(2) = entries(2) + principal(k)*axes(2, k)**2
      entries(3) = entries(3) + principal(k)*axes(3, k)**2
      entries(4) = entries(4) + principal(k)*axes(1, k)*axes(2, k)
      entries(5) = entries(5) + principal(k)*axes(1, k)*axes(3, k)
      entries(6) = entries(6) + principal(k)*axes(2, k)*axes(3, k)
    end do
  end subroutine inertia_in_global_axes

  !> Energy of the rotation of a body in space [J].
  pure real(dp) function spin_energy(principal, orientation, spin) result(energy)
    !> principal moments of inertia [kg m^2]
    real(dp), intent(in) :: principal(3)
    !> unit quaternion
    real(dp), intent(in) :: orientation(4)
    !> in global axes [rad/s]
    real(dp), intent(in) :: spin(3)
    real(dp) :: axes(3, 3)
    integer :: k

    call orientation_matrix(orientation, axes)
    energy = 0.0_dp
    do k = 1, 3
      energy = energy + 0.5_dp*principal(k)*sum(axes(:, k)*spin)**2
    end do
  end function spin_energy

end module gravier_motion
