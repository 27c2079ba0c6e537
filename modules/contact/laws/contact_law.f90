!> What a law of contact is: keys of its own in the input, and what it makes of a pair of bodies at the start of a step.
!>
!> The solver knows one law, that of Signorini and Coulomb with the terms of contact_terms_t, constant over a step. An attraction
!> F [N] costs it nothing: with r~_n = r_n + h F the law of the pair is Coulomb's in r~, and the pair force -h F n is a load.
module gravier_contact_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_contact_spring, only: spring_t
  implicit none
  private
  public :: contact_law_t, contact_pair_t, contact_terms_t, add_resistance_keys, unused, rounded_gap

  !> a contact slides whose friction is used but for this part
  real(dp), parameter :: unused = 1.0e-6_dp
  !> gap over the radius that is rounding: the bodies touch
  real(dp), parameter :: rounded_gap = 1.0e-9_dp

  !> keys of all laws with friction
  type(declared_key_t), parameter :: resistance_keys(2) = &
    & [declared_key_t("rolling_friction", "0.0", ">= 0", "", &
    &              "rolling friction coefficient: the largest moment over `R* r_n`, over `R* (r_n + h F)` under an attraction F"), &
    &  declared_key_t("pivoting_friction", "0.0", ">= 0", "", "pivoting friction coefficient, the same about the normal; 0 in 2D")]

  !> What holds at a contact over a step.
  type, extends(coefficients_t) :: contact_terms_t
    !> [N]
    real(dp) :: attraction = 0.0_dp
    !> gap that the bodies may close in the step [m]
    real(dp) :: free_gap = 0.0_dp
    !> the bodies are joined, across a gap or with an overlap, and move as one
    logical :: joins = .false.
  end type contact_terms_t

  !> A pair of bodies under its law.
  type :: contact_pair_t
    !> it is the first step of a run
    logical :: first = .false.
    !> at q_m [m]
    real(dp) :: gap = 0.0_dp
    !> geometric mean of the radii of two grains, the radius of a grain at a boundary [m]
    real(dp) :: radius = 0.0_dp
    !> of a law that sees it: relative velocity at the start of the step, along the normal, > 0 where the bodies part, and size of
    !> the tangential one [m/s]
    real(dp) :: normal_velocity = 0.0_dp, slip = 0.0_dp
    !> where some law has springs: step [s]; radius and mass of one sphere that meets a plane as the two bodies meet each other
    !> [m, kg]; what a pressure is multiplied with to be a force over a length, 2 `radius`, 1 in 2D [m, 1]
    real(dp) :: h = 0.0_dp, reduced_radius = 0.0_dp, reduced_mass = 0.0_dp, breadth = 1.0_dp
    !> what the pair remembers from step to step under a law with memory, 0 at first
    integer :: state = 0
    !> made by `evaluate`, from an ordinary contact without friction: its free gap is the gap where that is open
    type(contact_terms_t) :: terms
    !> made by `evaluate` where the law has springs; else rigid
    type(spring_t) :: spring
    !> once the step is solved: r~_n and |r_t| [N s]
    real(dp) :: normal = 0.0_dp, tangential = 0.0_dp
    !> once the step is solved, of a law that breaks: how fast the bodies part or slide on each other, beside what their joint
    !> allows, and the velocity up to which the solve may be wrong about that [m/s]
    real(dp) :: motion = 0.0_dp, uncertain = 0.0_dp
    !> how fast they part, < 0 where they come back [m/s]
    real(dp) :: parting = 0.0_dp
    !> the bodies of the scene move by more than errors of the solve are compared with
    logical :: in_motion = .false.
    !> made by `conclude`: it is at its limit, and the solve is not exact enough to tell whether it breaks
    logical :: doubtful = .false.
  end type contact_pair_t

  type, abstract :: contact_law_t
    !> some pair may have an attraction; pairs have states
    logical :: attracts = .false., remembers = .false.
    !> pairs that open or slide in a step never attract again
    logical :: breaks = .false.
    !> pairs have springs, whose elongations stay with them
    logical :: yields = .false.
    !> its terms depend on the relative velocity at the start of the step, which is not made for the pairs of other laws
    logical :: sees_velocity = .true.
    !> it has a meaning between spheres and planes alone
    logical :: of_spheres = .false.
    !> all its pairs have the same terms, which are then found once a run and not once a step and pair
    logical :: is_constant = .false.
    !> bodies of its two materials pass through each other: their pairs are never listed
    logical :: passes = .false.
    !> slip by which its friction changes from static to dynamic; huge where it does not [m/s]
    real(dp) :: slip_scale = huge(1.0_dp)
    !> the largest coefficients that it hands over; all but that of friction are the same for all its pairs
    type(coefficients_t) :: largest = coefficients_t()
    !> gap up to which bodies that have not been nearer act on each other [m]
    real(dp) :: range = 0.0_dp
    !> of values that keep the rules of their keys but do not go together: the first key at fault and what is expected of it
    character(len=24) :: fault_key = ""
    character(len=80) :: fault_expected = ""
  contains
    procedure(law_kind), deferred, nopass :: kind
    procedure(law_keys), deferred, nopass :: keys
    procedure(law_set), deferred :: set
    procedure(law_evaluate), deferred :: evaluate
    procedure :: conclude => contact_law_conclude
    procedure :: set_resistance => contact_law_set_resistance
  end type contact_law_t

  abstract interface
    !> Its word in the input.
    pure function law_kind() result(kind)
      implicit none
      character(len=16) :: kind
    end function law_kind
    !> Its keys. A key that several laws have is the same in all of them: default, rule, unit and meaning.
    pure subroutine law_keys(keys)
      import :: declared_key_t
      implicit none
      type(declared_key_t), allocatable, intent(out) :: keys(:)
    end subroutine law_keys
    !> Take the values of the keys, in their order.
    pure subroutine law_set(self, values)
      import :: contact_law_t, dp
      implicit none
      class(contact_law_t), intent(inout) :: self
      real(dp), intent(in) :: values(:)
    end subroutine law_set
    !> The terms of a pair over a step and, with a memory, its state: once a step and pair.
    pure subroutine law_evaluate(self, pair)
      import :: contact_law_t, contact_pair_t
      implicit none
      class(contact_law_t), intent(in) :: self
      type(contact_pair_t), intent(inout) :: pair
    end subroutine law_evaluate
  end interface

contains

  !> The state of a pair whose step is solved: it stays where the law remembers, unless the law says otherwise.
  pure subroutine contact_law_conclude(self, pair)
    class(contact_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair

    if (.not. self%remembers) pair%state = 0
  end subroutine contact_law_conclude

  !> The keys of a law with friction: its own, then those of the resistance to rolling and pivoting, which set_resistance takes.
  pure subroutine add_resistance_keys(own, keys)
    type(declared_key_t), intent(in) :: own(:)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(size(own) + 2))
    keys(1:size(own)) = own
    keys(size(own) + 1:) = resistance_keys
  end subroutine add_resistance_keys

  !> Take the values of the keys that add_resistance_keys adds.
  pure subroutine contact_law_set_resistance(self, rolling, pivoting)
    class(contact_law_t), intent(inout) :: self
    real(dp), intent(in) :: rolling, pivoting

    self%largest%rolling_friction = rolling
    self%largest%pivoting_friction = pivoting
  end subroutine contact_law_set_resistance

end module gravier_contact_law
