!> Coulomb friction between elastic spheres: the normal force of Hertz, 4/3 E* sqrt(R*) x^(3/2), and the tangential stiffness of
!> Mindlin for its compression x, 8 G* sqrt(R* x), in a spring that slides where the bound of friction is reached.
!>
!> Over a step the springs are linear: their stiffness is that of the chord from the undeformed contact to a compression that the
!> start of the step predicts, so that forces are those of Hertz where the compression is at rest, and the error in time is of the
!> second order. A contact that closes is taken to be compressed by what it may close in the step, or by what an impact of its
!> velocity compresses it, whichever is less.
module gravier_hertz_law
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_pair_t, add_resistance_keys
  use gravier_elastic_law, only: spring_law_t, spring_keys
  implicit none
  private
  public :: hertz_law_t

  !> least compression that a stiffness is taken at, over the radius
  real(dp), parameter :: least = 1.0e-10_dp

  type, extends(spring_law_t) :: hertz_law_t
    !> 4/3 E*, 8 G* [Pa]
    real(dp) :: normal = 0.0_dp, tangential = 0.0_dp
  contains
    procedure, nopass :: kind => hertz_kind
    procedure, nopass :: keys => hertz_keys
    procedure :: set => hertz_set
    procedure :: evaluate => hertz_evaluate
  end type hertz_law_t

  type(declared_key_t), parameter :: law_keys(*) = &
    & [declared_key_t("friction", "0.0", ">= 0", "", "friction coefficient"), &
    &  declared_key_t("young_modulus", "", "> 0", "Pa", "Young's modulus of both bodies"), &
    &  declared_key_t("poisson_ratio", "0.25", "in [0, 0.5]", "", "Poisson's ratio of both bodies"), &
    &  spring_keys]

contains

  pure function hertz_kind() result(kind)
    character(len=16) :: kind
    kind = "hertz"
  end function hertz_kind

  pure subroutine hertz_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)
    call add_resistance_keys(law_keys, keys)
  end subroutine hertz_keys

  pure subroutine hertz_set(self, values)
    class(hertz_law_t), intent(inout) :: self
    real(dp), intent(in) :: values(:)

    self%normal = 4.0_dp/3.0_dp*values(2)/(2.0_dp*(1.0_dp - values(3)**2))
    self%tangential = 8.0_dp*values(2)/(4.0_dp*(1.0_dp + values(3))*(2.0_dp - values(3)))
    self%of_spheres = .true.
    call self%set_springs(values(1), values(4:9), 1.5_dp)
  end subroutine hertz_set

  pure subroutine hertz_evaluate(self, pair)
    class(hertz_law_t), intent(in) :: self
    type(contact_pair_t), intent(inout) :: pair
    real(dp) :: depth, approach

    call self%begin_pair(pair)
    pair%spring%hertz = self%normal*sqrt(pair%reduced_radius)
    approach = max(0.0_dp, -pair%normal_velocity)
    ! the greatest compression of an impact: m v^2/2 = 2/5 K x^(5/2)
    depth = min(pair%h*approach, (1.25_dp*pair%reduced_mass*approach**2/pair%spring%hertz)**0.4_dp)
    depth = max(-pair%gap, depth, least*pair%reduced_radius)
    pair%spring%stiffness(1) = pair%spring%hertz*sqrt(depth)
    pair%spring%stiffness(2) = self%tangential*sqrt(pair%reduced_radius*depth)
  end subroutine hertz_evaluate

end module gravier_hertz_law
