!> The contact data of a subdomain: where a contact stands in the packed arrays, and which row of the data holds what.
!>
!> Contacts are packed in sweep order, in blocks of `lanes`: contact c is lane lane_of(c) of block block_of(c), and row k of its
!> data is hot(lane_of(c), k, block_of(c)). A component of the contacts of a block thus lies together in memory.
module gravier_contact_data
  implicit none
  private
  public :: lanes, n_blocks, block_of, lane_of, contact_rows_t, packed_layout_t
  public :: rows_2d_frictionless, rows_2d_friction, rows_2d_friction_shift, rows_2d_friction_rolling
  public :: rows_2d_friction_shift_rolling, rows_2d_shaped, rows_2d_shaped_shift
  public :: rows_3d_frictionless, rows_3d_friction, rows_3d_friction_shift, rows_3d_friction_rolling
  public :: rows_3d_friction_shift_rolling, rows_3d_shaped, rows_3d_shaped_shift
  public :: rows_2d_compliant, rows_2d_compliant_rolling, rows_2d_shaped_compliant
  public :: rows_3d_compliant, rows_3d_compliant_rolling, rows_3d_shaped_compliant

  !> contacts of a block: long enough to hide the latency of square roots and divisions behind each other
  integer, parameter :: lanes = 16

  !> The rows of the contact data by name, 0 where a set of effects has none.
  type :: contact_rows_t
    !> rows of a contact
    integer :: total = 0
    !> unit normal, from the antagonist to the candidate
    integer :: nx = 0, ny = 0, nz = 0
    !> what the law adds to the normal velocity: the free gap over the time step or, with restitution, e v_n at the start of
    !> the step, or what the spring of a compliant contact makes of gap and velocity at the start [m/s]
    integer :: shift = 0
    !> relaxation factor over W_nn [kg]
    integer :: per_wnn = 0
    !> relaxation factor over W_tt [kg]
    integer :: per_wtt = 0
    !> distance along the normal from the centre of the candidate, and of the antagonist, to the contact; 0 of boundaries [m]
    integer :: lever_i = 0, lever_j = 0
    !> coefficient of friction
    integer :: friction = 0
    !> what the law adds to the tangential velocity along t and, of spheres, along s: e_t v_t at the start of the step, or what
    !> the spring of a compliant contact makes of its elongation and that velocity [m/s]
    integer :: shift_t = 0, shift_s = 0
    !> effective radius R* of rolling [m]
    integer :: rolling_radius = 0
    !> relaxation factor over W_rr [kg]
    integer :: per_wrr = 0
    !> coefficients of rolling and, of spheres, pivoting resistance
    integer :: rolling_friction = 0, pivoting_friction = 0
    !> of bodies with shapes: what couples the normal to the tangential directions, W_nt and, in space, W_ns [1/kg]
    integer :: w_nt = 0, w_ns = 0
    !> of bodies with shapes: in the plane, c x n of the arm c from the centre of the candidate, and of the antagonist, to the
    !> contact; in space, the first of the three components of either arm in global axes; 0 of boundaries [m]
    integer :: arm_i = 0, arm_j = 0
    !> compliances a along the normal and the tangents, 0 of a rigid contact: the law holds for v + shift + a r [1/kg]
    integer :: compliance_n = 0, compliance_t = 0
  end type contact_rows_t

  !> The layout of the packed arrays, which dimension and effects of a scene fix for a whole run. The loops have it, and so has the
  !> contact problem, whose arrays they work on.
  type :: packed_layout_t
    !> space dimension, degrees of freedom of a body, rows of `weight`, components of an impulse, those of them that are a
    !> force's (the first ones; the others are moments), rows of `hot`
    integer :: nd = 2, nv = 2, nw = 2, nc = 1, nf = 1, nh = 4
    !> row of `hot` that holds mu, and the rows before the tangential shift and before those of the rolling law; 0 where the
    !> kernels have no such effect
    integer :: friction_row = 0, shift_row = 0, rolling_row = 0
    !> all rows of `hot` by name
    type(contact_rows_t) :: row
  contains
    procedure :: has_shapes => packed_layout_has_shapes
    procedure :: has_rolling => packed_layout_has_rolling
    procedure :: has_compliance => packed_layout_has_compliance
  end type packed_layout_t

  type(contact_rows_t), parameter :: rows_2d_frictionless = contact_rows_t(total=4, nx=1, ny=2, shift=3, per_wnn=4)
  type(contact_rows_t), parameter :: rows_2d_friction = &
    & contact_rows_t(total=8, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8)
  type(contact_rows_t), parameter :: rows_2d_friction_shift = &
    & contact_rows_t(total=9, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9)
  type(contact_rows_t), parameter :: rows_2d_friction_rolling = &
    & contact_rows_t(total=11, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, &
    &                rolling_radius=9, per_wrr=10, rolling_friction=11)
  type(contact_rows_t), parameter :: rows_2d_friction_shift_rolling = &
    & contact_rows_t(total=12, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9, &
    &                rolling_radius=10, per_wrr=11, rolling_friction=12)
  type(contact_rows_t), parameter :: rows_2d_shaped = &
    & contact_rows_t(total=11, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, &
    &                w_nt=9, arm_i=10, arm_j=11)
  type(contact_rows_t), parameter :: rows_2d_shaped_shift = &
    & contact_rows_t(total=12, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9, &
    &                w_nt=10, arm_i=11, arm_j=12)

  type(contact_rows_t), parameter :: rows_2d_compliant = &
    & contact_rows_t(total=11, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9, &
    &                compliance_n=10, compliance_t=11)
  type(contact_rows_t), parameter :: rows_2d_compliant_rolling = &
    & contact_rows_t(total=14, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9, &
    &                rolling_radius=10, per_wrr=11, rolling_friction=12, compliance_n=13, compliance_t=14)
  type(contact_rows_t), parameter :: rows_2d_shaped_compliant = &
    & contact_rows_t(total=14, nx=1, ny=2, shift=3, per_wnn=4, per_wtt=5, lever_i=6, lever_j=7, friction=8, shift_t=9, &
    &                w_nt=10, arm_i=11, arm_j=12, compliance_n=13, compliance_t=14)

  type(contact_rows_t), parameter :: rows_3d_frictionless = contact_rows_t(total=5, nx=1, ny=2, nz=3, shift=4, per_wnn=5)
  type(contact_rows_t), parameter :: rows_3d_friction = &
    & contact_rows_t(total=9, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9)
  type(contact_rows_t), parameter :: rows_3d_friction_shift = &
    & contact_rows_t(total=11, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9, &
    &                shift_t=10, shift_s=11)
  type(contact_rows_t), parameter :: rows_3d_friction_rolling = &
    & contact_rows_t(total=13, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9, &
    &                rolling_radius=10, per_wrr=11, rolling_friction=12, pivoting_friction=13)
  type(contact_rows_t), parameter :: rows_3d_friction_shift_rolling = &
    & contact_rows_t(total=15, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9, &
    &                shift_t=10, shift_s=11, rolling_radius=12, per_wrr=13, rolling_friction=14, pivoting_friction=15)
  type(contact_rows_t), parameter :: rows_3d_shaped = &
    & contact_rows_t(total=15, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, friction=7, w_nt=8, w_ns=9, arm_i=10, arm_j=13)
  type(contact_rows_t), parameter :: rows_3d_shaped_shift = &
    & contact_rows_t(total=17, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, friction=7, shift_t=8, shift_s=9, &
    &                w_nt=10, w_ns=11, arm_i=12, arm_j=15)
  type(contact_rows_t), parameter :: rows_3d_compliant = &
    & contact_rows_t(total=13, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9, &
    &                shift_t=10, shift_s=11, compliance_n=12, compliance_t=13)
  type(contact_rows_t), parameter :: rows_3d_compliant_rolling = &
    & contact_rows_t(total=17, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, lever_i=7, lever_j=8, friction=9, &
    &                shift_t=10, shift_s=11, rolling_radius=12, per_wrr=13, rolling_friction=14, pivoting_friction=15, &
    &                compliance_n=16, compliance_t=17)
  type(contact_rows_t), parameter :: rows_3d_shaped_compliant = &
    & contact_rows_t(total=19, nx=1, ny=2, nz=3, shift=4, per_wnn=5, per_wtt=6, friction=7, shift_t=8, shift_s=9, &
    &                w_nt=10, w_ns=11, arm_i=12, arm_j=15, compliance_n=18, compliance_t=19)

contains

  !> The blocks that so many contacts take.
  pure integer function n_blocks(n_contacts)
    integer, intent(in) :: n_contacts
    n_blocks = (n_contacts + lanes - 1)/lanes
  end function n_blocks

  !> The block of contact `c`, from 1 on.
  pure integer function block_of(c)
    integer, intent(in) :: c
    block_of = (c - 1)/lanes + 1
  end function block_of

  !> The lane of contact `c` in its block, from 1 on.
  pure integer function lane_of(c)
    integer, intent(in) :: c
    lane_of = mod(c - 1, lanes) + 1
  end function lane_of

  !> Whether bodies may have shapes, so that contacts have arms instead of levers.
  pure logical function packed_layout_has_shapes(self) result(has_shapes)
    class(packed_layout_t), intent(in) :: self
    has_shapes = self%row%arm_i > 0
  end function packed_layout_has_shapes

  !> Whether contacts resist rolling, so that impulses have moments.
  pure logical function packed_layout_has_rolling(self) result(has_rolling)
    class(packed_layout_t), intent(in) :: self
    has_rolling = self%row%rolling_radius > 0
  end function packed_layout_has_rolling

  !> Whether contacts may be compliant.
  pure logical function packed_layout_has_compliance(self) result(has_compliance)
    class(packed_layout_t), intent(in) :: self
    has_compliance = self%row%compliance_n > 0
  end function packed_layout_has_compliance

end module gravier_contact_data
