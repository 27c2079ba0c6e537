!> Coulomb friction with Newton restitution (Moreau 1988).
module gravier_coulomb_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys
  implicit none
  private
  public :: coulomb_law_t

  type, extends(contact_law_t) :: coulomb_law_t
    real(dp) :: friction = 0.0_dp
  contains
    procedure, nopass :: kind => coulomb_kind
    procedure, nopass :: keys => coulomb_keys
    procedure :: set => coulomb_set
    procedure :: evaluate => coulomb_evaluate
  end type coulomb_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("restitution", "0.0", "in [0, 1]", "", "normal restitution coefficient"), &
    &  declared_key_t("tangential_restitution", "0.0", "in [0, 1]", "", &
    &                 "tangential restitution coefficient, where there is friction")]

contains

  pure function coulomb_kind() result(kind)
    character(len=16) :: kind
    kind = "coulomb"
  end function coulomb_kind

  pure subroutine coulomb_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine coulomb_keys

  pure subroutine coulomb_set(self, values)
    class(coulomb_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%is_constant = .true.
    self%friction = values(1)
    self%largest%restitution = values(2)
    self%largest%tangential_restitution = values(3)
    self%largest%friction = self%friction
    call self%set_resistance(values(4), values(5))
  end subroutine coulomb_set

  pure subroutine coulomb_evaluate(self, pair)
    class(coulomb_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%friction
    pair%terms%restitution = self%largest%restitution
    if (pair%terms%friction > 0.0_dp) pair%terms%tangential_restitution = self%largest%tangential_restitution
  end subroutine coulomb_evaluate

end module gravier_coulomb_law
