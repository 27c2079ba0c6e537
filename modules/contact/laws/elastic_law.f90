!> Coulomb friction between bodies that yield: linear springs along the normal and the tangents, of which the second slides where
!> the bound of friction is reached (Cundall and Strack 1979), and dashpots (gravier_contact_spring).
!>
!> The normal stiffness is given in N/m, or as a number kappa by which a pressure P is multiplied: k = kappa P d with the mean
!> diameter d of a pair, in 2D k = kappa P (Roux and Combe 2002). Bodies that touch may hold each other with a constant force.
module gravier_elastic_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_spring, only: spring_t, damping_ratio
  use gravier_contact_law, only: contact_law_t, contact_pair_t, add_resistance_keys, rounded_gap
  implicit none
  private
  public :: elastic_law_t, spring_law_t, spring_keys

  !> What laws with springs have in common.
  type, extends(contact_law_t), abstract :: spring_law_t
    real(dp) :: friction = 0.0_dp
    !> what all pairs have in common
    type(spring_t) :: spring = spring_t()
    !> [N]
    real(dp), private :: pull_off = 0.0_dp
  contains
    procedure :: set_springs => spring_law_set_springs
    procedure :: begin_pair => spring_law_begin_pair
  end type spring_law_t

  type, extends(spring_law_t) :: elastic_law_t
    !> [N/m]; kappa; [Pa, N/m in 2D]
    real(dp) :: stiffness = 0.0_dp, number = 0.0_dp, pressure = 0.0_dp
    !> tangential stiffness over the normal one
    real(dp), private :: ratio = 1.0_dp
  contains
    procedure, nopass :: kind => elastic_kind
    procedure, nopass :: keys => elastic_keys
    procedure :: set => elastic_set
    procedure :: evaluate => elastic_evaluate
  end type elastic_law_t

  !> keys of all laws with springs
  type(declared_key_t), parameter :: spring_keys(*) = &
    & [declared_key_t("spring_restitution", "1.0", "in (0, 1]", "", &
    &   "part of its velocity that an impact returns, about 1e-4 at least; it sets the dashpot of the normal spring"), &
    &  declared_key_t("tangential_damping", "0.0", ">= 0", "", "tangential dashpot over the normal one"), &
    &  declared_key_t("spring_theta", "1.0", "in [0.5, 1]", "", &
    &    "weight of the end of the step in the forces of the springs: 0.5 keeps energy, 1 damps what the step does not resolve"), &
    &  declared_key_t("pull_off_force", "0.0", ">= 0", "N", "attraction of two bodies that touch")]

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("normal_stiffness", "0.0", ">= 0", "N/m", "stiffness of the normal spring; or give `stiffness_number`"), &
    &  declared_key_t("stiffness_number", "0.0", ">= 0", "", &
    &                 "stiffness of the normal spring over `stiffness_pressure` and, in 3D, the mean diameter of the pair"), &
    &  declared_key_t("stiffness_pressure", "0.0", ">= 0", "Pa", "pressure for `stiffness_number`; N/m in 2D"), &
    &  declared_key_t("stiffness_ratio", "0.2857142857143", "> 0", "", "tangential stiffness over the normal one"), &
    &  spring_keys]

contains

  !> Set what laws with springs have in common.
  pure subroutine spring_law_set_springs(self, friction, values, exponent)
    class(spring_law_t), intent(inout) :: self
    !> friction coefficient; of `spring_keys` and of the two resistances to rolling
    real(dp), intent(in) :: friction, values(:)
    !> of the force of the normal spring as a power of its compression: 1 or 3/2
    real(dp), intent(in) :: exponent

    self%friction = friction
    self%spring%damping = damping_ratio(values(1), exponent)
    self%spring%tangential_damping = values(2)
    self%spring%weight = values(3)
    self%pull_off = values(4)
    self%attracts = self%pull_off > 0.0_dp
    self%yields = .true.
    self%largest%friction = self%friction
    call self%set_resistance(values(5), values(6))
  end subroutine spring_law_set_springs

  !> Give a pair its friction, its attraction and its springs but for their stiffness.
  pure subroutine spring_law_begin_pair(self, pair)
    class(spring_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    pair%terms%friction = self%friction
    if (pair%gap <= rounded_gap*pair%radius) pair%terms%attraction = self%pull_off
    pair%spring = self%spring
  end subroutine spring_law_begin_pair

  pure function elastic_kind() result(kind)
    character(len=16) :: kind
    kind = "elastic"
  end function elastic_kind

  pure subroutine elastic_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine elastic_keys

  pure subroutine elastic_set(self, values)
    class(elastic_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%stiffness = values(2)
    self%number = values(3)
    self%pressure = values(4)
    self%ratio = values(5)
    call self%set_springs(values(1), values(6:11), 1.0_dp)
    self%sees_velocity = .false.
    self%fault_key = ""
    if (self%stiffness > 0.0_dp .and. self%number > 0.0_dp) then
      self%fault_key = "stiffness_number"
      self%fault_expected = "0 beside a normal_stiffness, which is given too"
    else if (.not. (self%stiffness > 0.0_dp .or. self%number > 0.0_dp)) then
      self%fault_key = "normal_stiffness"
      self%fault_expected = "either a normal_stiffness or a stiffness_number greater than 0"
    else if (self%number > 0.0_dp .and. .not. self%pressure > 0.0_dp) then
      self%fault_key = "stiffness_pressure"
      self%fault_expected = "a pressure greater than 0, which the stiffness_number multiplies"
    else if (self%pressure > 0.0_dp .and. .not. self%number > 0.0_dp) then
      self%fault_key = "stiffness_pressure"
      self%fault_expected = "0 without a stiffness_number, which it would multiply"
    end if
  end subroutine elastic_set

  pure subroutine elastic_evaluate(self, pair)
    class(elastic_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    call self%begin_pair(pair)
    pair%spring%stiffness(1) = self%stiffness
    if (self%number > 0.0_dp) pair%spring%stiffness(1) = self%number*self%pressure*pair%breadth
    pair%spring%stiffness(2) = self%ratio*pair%spring%stiffness(1)
  end subroutine elastic_evaluate

end module gravier_elastic_law
