!> Coulomb friction with a constant attraction up to a range.
module gravier_adhesive_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys
  implicit none
  private
  public :: adhesive_law_t

  type, extends(contact_law_t) :: adhesive_law_t
    real(dp) :: friction = 0.0_dp
    !> [N]
    real(dp), private :: adhesion = 0.0_dp
  contains
    procedure, nopass :: kind => adhesive_kind
    procedure, nopass :: keys => adhesive_keys
    procedure :: set => adhesive_set
    procedure :: evaluate => adhesive_evaluate
  end type adhesive_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("adhesion", "", ">= 0", "N", "attraction of two bodies within the range"), &
    &  declared_key_t("adhesion_range", "", "> 0", "m", "gap up to which they attract each other")]

contains

  pure function adhesive_kind() result(kind)
    character(len=16) :: kind
    kind = "adhesive"
  end function adhesive_kind

  pure subroutine adhesive_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine adhesive_keys

  pure subroutine adhesive_set(self, values)
    class(adhesive_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%friction = values(1)
    self%adhesion = values(2)
    self%range = values(3)
    self%attracts = .true.
    self%sees_velocity = .false.
    self%largest%friction = self%friction
    call self%set_resistance(values(4), values(5))
  end subroutine adhesive_set

  pure subroutine adhesive_evaluate(self, pair)
    class(adhesive_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%friction
    if (pair%gap <= self%range) pair%terms%attraction = self%adhesion
  end subroutine adhesive_evaluate

end module gravier_adhesive_law
