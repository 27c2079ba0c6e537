!> No contact: bodies of the two materials pass through each other.
module gravier_none_law
  use gravier_declared_keys, only: declared_key_t
  use gravier_kinds, only: dp
  use gravier_contact_law, only: contact_law_t, contact_pair_t
  implicit none
  private
  public :: none_law_t

  type, extends(contact_law_t) :: none_law_t
  contains
    procedure, nopass :: kind => none_kind
    procedure, nopass :: keys => none_keys
    procedure :: set => none_set
    procedure :: evaluate => none_evaluate
  end type none_law_t

contains

  pure function none_kind() result(kind)
    character(len=16) :: kind
    kind = "none"
  end function none_kind

  pure subroutine none_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    allocate (keys(0))
  end subroutine none_keys

  !> It has no values; the pairs of its materials are not listed.
  pure subroutine none_set(self, values)
    class(none_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%is_constant = size(values) == 0
    self%passes = .true.
  end subroutine none_set

  !> No pair gets here; one that did would have the terms of a contact without friction.
  pure subroutine none_evaluate(self, pair)
    class(none_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    pair%terms%restitution = self%largest%restitution
  end subroutine none_evaluate

end module gravier_none_law
