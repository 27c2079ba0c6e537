!> Coulomb friction with the force of a liquid bridge (Richefeu, El Youssoufi, Radjai 2006, Phys. Rev. E 73, 051304):
!> F = kappa R, R the geometric mean of the radii, times exp(-gap/lambda) where the gap is open. A bridge forms where two bodies
!> touch and breaks at the debonding distance; the pair remembers it. Pairs that are near at the start of a run may have one, too.
module gravier_capillary_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys, rounded_gap
  implicit none
  private
  public :: capillary_law_t

  !> state of a pair with a bridge
  integer, parameter :: bridged = 1

  type, extends(contact_law_t) :: capillary_law_t
    real(dp) :: friction = 0.0_dp
    !> [N/m]
    real(dp), private :: capillarity = 0.0_dp
    !> [m]
    real(dp), private :: decay_length = 1.0_dp, debonding_distance = 0.0_dp, bridge_distance = 0.0_dp
  contains
    procedure, nopass :: kind => capillary_kind
    procedure, nopass :: keys => capillary_keys
    procedure :: set => capillary_set
    procedure :: evaluate => capillary_evaluate
    procedure :: conclude => capillary_conclude
  end type capillary_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("capillarity", "", ">= 0", "N/m", &
    &            "attraction of touching grains over the geometric mean of their radii, 2 pi gamma cos(theta) in 3D"), &
    &  declared_key_t("decay_length", "", "> 0", "m", "gap over which the attraction falls by a factor e"), &
    &  declared_key_t("debonding_distance", "", "> 0", "m", "gap at which a bridge breaks"), &
    &  declared_key_t("bridge_distance", "0.0", ">= 0", "m", "gap up to which pairs have a bridge at the start of a run")]

contains

  pure function capillary_kind() result(kind)
    character(len=16) :: kind
    kind = "capillary"
  end function capillary_kind

  pure subroutine capillary_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine capillary_keys

  pure subroutine capillary_set(self, values)
    class(capillary_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%friction = values(1)
    self%capillarity = values(2)
    self%decay_length = values(3)
    self%debonding_distance = values(4)
    self%bridge_distance = values(5)
    self%range = self%debonding_distance
    self%attracts = .true.
    self%sees_velocity = .false.
    self%remembers = .true.
    self%largest%friction = self%friction
    call self%set_resistance(values(6), values(7))
  end subroutine capillary_set

  pure subroutine capillary_evaluate(self, pair)
    class(capillary_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%friction
    if (pair%gap <= rounded_gap*pair%radius .or. (pair%first .and. pair%gap <= self%bridge_distance)) pair%state = bridged
    if (pair%gap > self%debonding_distance) pair%state = 0
    if (pair%state == bridged) &
      & pair%terms%attraction = self%capillarity*pair%radius*exp(-max(pair%gap, 0.0_dp)/self%decay_length)
  end subroutine capillary_evaluate

  !> Bodies that come to touch in a step have a bridge from then on, though rounding may leave a gap.
  pure subroutine capillary_conclude(self, pair)
    class(capillary_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    if (pair%normal > 0.0_dp .and. pair%gap <= self%debonding_distance) pair%state = bridged
  end subroutine capillary_conclude

end module gravier_capillary_law
