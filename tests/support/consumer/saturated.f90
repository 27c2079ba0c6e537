!> A law of one's own: Coulomb friction that falls off with the speed of sliding, friction = mu/(1 + speed/reference).
module saturated
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys
  implicit none
  private
  public :: saturated_t

  type, extends(contact_law_t) :: saturated_t
    real(dp) :: friction = 0.0_dp
    !> [m/s]
    real(dp) :: reference = 1.0_dp
  contains
    procedure, nopass :: kind => saturated_kind
    procedure, nopass :: keys => saturated_keys
    procedure :: set => saturated_set
    procedure :: evaluate => saturated_evaluate
  end type saturated_t

contains

  pure function saturated_kind() result(kind)
    character(len=16) :: kind
    kind = "saturated"
  end function saturated_kind

  pure subroutine saturated_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys([declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
      & declared_key_t("reference_speed", "", "> 0", "m/s", "speed of sliding at which friction is half of it")], keys)
  end subroutine saturated_keys

  pure subroutine saturated_set(self, values)
    class(saturated_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%friction = values(1)
    self%reference = values(2)
    self%largest%friction = self%friction
    call self%set_resistance(values(3), values(4))
  end subroutine saturated_set

  pure subroutine saturated_evaluate(self, pair)
    class(saturated_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    pair%terms%friction = self%friction/(1.0_dp + pair%slip/self%reference)
  end subroutine saturated_evaluate

end module saturated
