!> Coefficients of the law of contact: those that the grains of a scene, its walls and each boundary have.
module gravier_contact_coefficients
  use gravier_kinds, only: dp
  implicit none
  private
  public :: coefficients_t

  type :: coefficients_t
    real(dp) :: friction = 0.0_dp
    !> of the normal velocity: where it is not 0 a contact acts from touching on
    real(dp) :: restitution = 0.0_dp
    !> of the tangential velocity, likewise; without friction, which alone can send it back, it has no meaning
    real(dp) :: tangential_restitution = 0.0_dp
    !> the largest moments over R* r_n, with an attraction over R* r~_n: rolling and, of spheres, pivoting
    real(dp) :: rolling_friction = 0.0_dp, pivoting_friction = 0.0_dp
  contains
    procedure :: raise_to => coefficients_raise_to
  end type coefficients_t

contains

  !> Raise each coefficient to that of others where it is less.
  pure subroutine coefficients_raise_to(self, others)
    class(coefficients_t), intent(inout) :: self
    class(coefficients_t), intent(in) :: others

    self%friction = max(self%friction, others%friction)
    self%restitution = max(self%restitution, others%restitution)
    self%tangential_restitution = max(self%tangential_restitution, others%tangential_restitution)
    self%rolling_friction = max(self%rolling_friction, others%rolling_friction)
    self%pivoting_friction = max(self%pivoting_friction, others%pivoting_friction)
  end subroutine coefficients_raise_to

end module gravier_contact_coefficients
