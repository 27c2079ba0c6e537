!> Moreau-Jean time stepping of bodies and their mass properties.
module gravier_motion
  use gravier_kinds, only: dp
  implicit none
  private
  public :: predict_position, advance_position
  public :: grain_volume, grain_mass, grain_inertia

  real(dp), parameter :: pi = acos(-1.0_dp)

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

end module gravier_motion
