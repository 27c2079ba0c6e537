!> The effects that a scene has: they choose the kernels and what is allocated and exchanged, and the log names them.
module gravier_effects
  implicit none
  private
  public :: effects_t, n_effects, effect_name_length

  integer, parameter :: n_effects = 19, effect_name_length = 24

  !> Deduced from materials, bodies, boundaries and loads (gravier_scene), not declared.
  type :: effects_t
    !> some contact has mu > 0; some frictional contact sends its tangential velocity back; some moment resists rolling, or pivoting
    !> (of spheres); some body is neither a disk nor a sphere; some contact yields: these five choose the kernels
    logical :: friction = .false., tangential_restitution = .false., rolling = .false., shapes = .false., compliance = .false.
    !> what else contacts do: pivoting (in the kernels of rolling), normal restitution, cohesion; bonds, which have shifts along
    !> their tangents
    logical :: pivoting = .false., restitution = .false., cohesion = .false., bonds = .false.
    !> some grain turns; some axis is periodic; some boundary moves as prescribed, or is moved by forces; some grain is glued
    logical :: rotation = .false., periodic = .false., drives = .false., forces = .false., glued = .false.
    !> loads; grains are taken out; grains enter
    logical :: gravity = .false., body_force = .false., removal = .false., insertion = .false.
    !> the periodic cell deforms: contacts have shifts then, along their tangents too
    logical :: moving_cell = .false.
  contains
    procedure :: list => effects_list
  end type effects_t

contains

  !> All effects by name, and which of them there are.
  pure subroutine effects_list(self, names, on)
    class(effects_t), intent(in) :: self
    character(len=effect_name_length), intent(out) :: names(n_effects)
    logical, intent(out) :: on(n_effects)

    names(1) = "friction"
    on(1) = self%friction
    names(2) = "rotation"
    on(2) = self%rotation
    names(3) = "restitution"
    on(3) = self%restitution
    names(4) = "tangential restitution"
    on(4) = self%tangential_restitution
    names(5) = "rolling resistance"
    on(5) = self%rolling
    names(6) = "pivoting resistance"
    on(6) = self%pivoting
    names(7) = "cohesion"
    on(7) = self%cohesion
    names(8) = "compliance"
    on(8) = self%compliance
    names(9) = "periodic images"
    on(9) = self%periodic
    names(10) = "drives"
    on(10) = self%drives
    names(11) = "driven by forces"
    on(11) = self%forces
    names(12) = "glued grains"
    on(12) = self%glued
    names(13) = "shapes"
    on(13) = self%shapes
    names(14) = "gravity"
    on(14) = self%gravity
    names(15) = "body force"
    on(15) = self%body_force
    names(16) = "removal"
    on(16) = self%removal
    names(17) = "insertion"
    on(17) = self%insertion
    names(18) = "moving cell"
    on(18) = self%moving_cell
    names(19) = "bonds"
    on(19) = self%bonds
  end subroutine effects_list

end module gravier_effects
