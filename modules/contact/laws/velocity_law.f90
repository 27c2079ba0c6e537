!> Friction that depends on the slip: mu = mu_d + (mu_s - mu_d) exp(-|v_t|/v_s), with v_t at the start of the step. A small v_s
!> makes static and dynamic friction of it.
module gravier_velocity_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys
  implicit none
  private
  public :: velocity_law_t

  type, extends(contact_law_t) :: velocity_law_t
    private
    real(dp) :: static_friction = 0.0_dp, dynamic_friction = 0.0_dp
  contains
    procedure, nopass :: kind => velocity_kind
    procedure, nopass :: keys => velocity_keys
    procedure :: set => velocity_set
    procedure :: evaluate => velocity_evaluate
  end type velocity_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("static_friction", "", ">= 0", "", "friction coefficient without slip, mu_s"), &
    &  declared_key_t("dynamic_friction", "", ">= 0", "", "friction coefficient at large slip, mu_d"), &
    &  declared_key_t("slip_scale", "", "> 0", "m/s", &
    &           "slip v_s in mu_d + (mu_s - mu_d) exp(-v_t/v_s), v_t the slip at the start of the step"), &
    &  declared_key_t("restitution", "0.0", "in [0, 1]", "", "normal restitution coefficient"), &
    &  declared_key_t("tangential_restitution", "0.0", "in [0, 1]", "", &
    &                 "tangential restitution coefficient, where there is friction")]

contains

  pure function velocity_kind() result(kind)
    character(len=16) :: kind
    kind = "velocity"
  end function velocity_kind

  pure subroutine velocity_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine velocity_keys

  pure subroutine velocity_set(self, values)
    class(velocity_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%static_friction = values(1)
    self%dynamic_friction = values(2)
    self%slip_scale = values(3)
    self%largest%restitution = values(4)
    self%largest%tangential_restitution = values(5)
    self%largest%friction = max(self%static_friction, self%dynamic_friction)
    call self%set_resistance(values(6), values(7))
  end subroutine velocity_set

  pure subroutine velocity_evaluate(self, pair)
    class(velocity_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%dynamic_friction + (self%static_friction - self%dynamic_friction)*exp(-pair%slip/self%slip_scale)
    pair%terms%restitution = self%largest%restitution
    if (pair%terms%friction > 0.0_dp) pair%terms%tangential_restitution = self%largest%tangential_restitution
  end subroutine velocity_evaluate

end module gravier_velocity_law
