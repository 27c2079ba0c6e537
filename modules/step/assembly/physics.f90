!> What acts on the grains of a scene.
module gravier_physics
  use gravier_kinds, only: dp
  use gravier_body_store, only: body_set_t
  use gravier_body_figures, only: body_figures_t
  use gravier_law_set, only: law_set_t
  use gravier_moving_cell, only: cell_motion_t
  implicit none
  private
  public :: physics_t

  !> What acts on the grains of a scene.
  type :: physics_t
    !> at the present time [m/s^2], the first nd are used
    real(dp) :: gravity(3) = 0.0_dp
    !> on the volume of grains [N/m^3, N/m^2 in 2D]
    real(dp) :: body_force(3) = 0.0_dp
    !> laws of contact
    type(law_set_t) :: laws
    !> the step is the first of the run
    logical :: first = .false.
    !> grains turn; moments resist their rolling or pivoting; they resist pivoting
    logical :: rotation = .true., resists(2) = .false.
    !> step [s]; weight of the new velocity in the places
    real(dp) :: h = 1.0_dp, theta = 0.5_dp
    !> motion of the periodic cell in this step, without contacts until it is solved
    type(cell_motion_t) :: cell
  contains
    procedure :: accelerate => physics_accelerate
    procedure :: find_inverse_mass => physics_find_inverse_mass
  end type physics_t

contains

  !> Turn the velocity of grain `k` at the start of a step into that without contacts, M^-1 R^d = V_i + h M^-1 F
  !> (paper, (1)); no force here turns a grain, and a body with unlike moments of inertia changes its spin by itself.
  pure subroutine physics_accelerate(self, figures, bodies, k, v)
    class(physics_t), intent(in) :: self
    type(body_figures_t), intent(in) :: figures
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nv)
    real(dp), intent(inout), contiguous :: v(:)
    integer :: d

    if (bodies%no > 0) call figures%turn_freely(bodies, k, self%h, v)
    do d = 1, bodies%nd
      v(d) = v(d) + self%h*self%gravity(d)
    end do
    do d = 1, bodies%na
      v(d) = v(d) + self%h*bodies%force(d, k)/bodies%mass(k)
    end do
    if (.not. any(abs(self%body_force) > 0.0_dp)) return
    do d = 1, bodies%nd
      v(d) = v(d) + self%h*self%body_force(d)*figures%volume_of(bodies, k)/bodies%mass(k)
    end do
  end subroutine physics_accelerate

  !> The column of the inverse mass matrix of grain `k` (gravier_body_mass).
  pure subroutine physics_find_inverse_mass(self, figures, bodies, k, inverse)
    class(physics_t), intent(in) :: self
    type(body_figures_t), intent(in) :: figures
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nw)
    real(dp), intent(out), contiguous :: inverse(:)

    inverse(1:bodies%nd) = 1.0_dp/bodies%mass(k)
    inverse(bodies%nd + 1:) = 0.0_dp
    if (size(inverse) > bodies%nd .and. self%rotation) call figures%find_inverse_inertia(bodies, k, inverse(bodies%nd + 1:))
  end subroutine physics_find_inverse_mass

end module gravier_physics
