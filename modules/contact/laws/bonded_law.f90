!> Bonds of Mohr's type: pairs that are near at the start of a run are bonded. An intact bond keeps the bodies from parting and
!> from closing, also where they turn as one (gravier_bond_turning), with tensions up to its strength F and shear
!> |r_t| <= mu_b (r_n + h F). One that opens or slides in a step is broken for good, and the law is Coulomb's from the next step on.
!> A bond at its limit whose bodies do not move against each other is intact: others bear what it does not. Which of several bonds
!> are at their limit is not unique between rigid bodies, so that the motion of the bodies decides.
module gravier_bonded_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys, unused
  implicit none
  private
  public :: bonded_law_t

  !> State of a pair with an intact bond; that of all others is 0. A bond at its limit may open by less than the solve may be wrong.
  !> Its state then counts how far it has opened, and `parts` stand for what the solve of one step may be wrong. It breaks beyond
  !> `most_opened` times that.
  integer, parameter :: intact = 1, parts = 1000, most_opened = 2

  type, extends(contact_law_t) :: bonded_law_t
    real(dp) :: friction = 0.0_dp
    !> [N]
    real(dp), private :: bond_strength = 0.0_dp
    real(dp), private :: bond_friction = 0.0_dp
    !> [m]
    real(dp), private :: bond_distance = 0.0_dp
  contains
    procedure, nopass :: kind => bonded_kind
    procedure, nopass :: keys => bonded_keys
    procedure :: set => bonded_set
    procedure :: evaluate => bonded_evaluate
    procedure :: conclude => bonded_conclude
  end type bonded_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("bond_strength", "", ">= 0", "N", "tension that an intact bond withstands"), &
    &  declared_key_t("bond_friction", "", "> 0", "", "friction coefficient of an intact bond, of r_n + h `bond_strength`"), &
    &  declared_key_t("bond_distance", "", "> 0", "m", "gap up to which pairs are bonded at the start of a run")]

contains

  pure function bonded_kind() result(kind)
    character(len=16) :: kind
    kind = "bonded"
  end function bonded_kind

  pure subroutine bonded_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine bonded_keys

  pure subroutine bonded_set(self, values)
    class(bonded_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%friction = values(1)
    self%bond_strength = values(2)
    self%bond_friction = values(3)
    self%bond_distance = values(4)
    self%range = self%bond_distance
    self%attracts = .true.
    self%sees_velocity = .false.
    self%remembers = .true.
    self%breaks = .true.
    self%largest%friction = max(self%friction, self%bond_friction)
    call self%set_resistance(values(5), values(6))
  end subroutine bonded_set

  pure subroutine bonded_evaluate(self, pair)
    class(bonded_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%friction
    if (pair%first .and. pair%gap <= self%bond_distance) pair%state = intact
    if (pair%state == 0) return
    pair%terms%friction = self%bond_friction
    pair%terms%attraction = self%bond_strength
    pair%terms%free_gap = 0.0_dp
    pair%terms%joins = .true.
  end subroutine bonded_evaluate

  !> A bond at its limit breaks if its bodies part or slide faster than the solve may be wrong. One that moves less is in doubt.
  !> Where bodies move, solves are compared with their motion, and a joint about which a long body turns opens slowly beside it.
  !> Such a bond breaks once it has opened for several steps in a row, because errors of solves do not keep their sign.
  pure subroutine bonded_conclude(self, pair)
    class(bonded_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    logical :: at_limit

    pair%doubtful = .false.
    if (pair%state == 0) return
    ! this holds of a bond under its full tension, too: both impulses are 0
    at_limit = pair%tangential >= (1.0_dp - unused)*self%bond_friction*pair%normal
    pair%doubtful = at_limit .and. .not. pair%motion > pair%uncertain
    if (.not. at_limit) then
      pair%state = intact
    else if (pair%doubtful .and. pair%in_motion .and. pair%uncertain > 0.0_dp) then
      pair%state = max(intact, pair%state + nint(parts*max(pair%parting/pair%uncertain, -real(most_opened, dp))))
      pair%doubtful = pair%state <= intact + most_opened*parts
    end if
    if (at_limit .and. .not. pair%doubtful) pair%state = 0
  end subroutine bonded_conclude

end module gravier_bonded_law
