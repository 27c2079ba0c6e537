!> No friction, with Newton restitution.
module gravier_frictionless_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t
  implicit none
  private
  public :: frictionless_law_t

  type, extends(contact_law_t) :: frictionless_law_t
  contains
    procedure, nopass :: kind => frictionless_kind
    procedure, nopass :: keys => frictionless_keys
    procedure :: set => frictionless_set
    procedure :: evaluate => frictionless_evaluate
  end type frictionless_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("restitution", "0.0", "in [0, 1]", "", "normal restitution coefficient")]

contains

  pure function frictionless_kind() result(kind)
    character(len=16) :: kind
    kind = "frictionless"
  end function frictionless_kind

  pure subroutine frictionless_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    allocate (keys, source=law_keys)
  end subroutine frictionless_keys

  pure subroutine frictionless_set(self, values)
    class(frictionless_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%is_constant = .true.
    self%largest%restitution = values(1)
  end subroutine frictionless_set

  pure subroutine frictionless_evaluate(self, pair)
    class(frictionless_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    pair%terms%restitution = self%largest%restitution
  end subroutine frictionless_evaluate

end module gravier_frictionless_law
