!> The loops over contacts, one version per dimension and per set of effects, chosen once a run.
!>
!> Contacts are packed in sweep order, in blocks of `lanes`; contact c is lane lane_of(c) of block block_of(c):
!>   pair(1:2, c)  local numbers of the candidate i and the antagonist j
!>   hot           (lanes, nh, blocks): the contact data, whose rows contact_rows_t names (gravier_contact_data)
!>   impulse       (lanes, nc, blocks): (n[, t[, s]]) [N s], compression positive; with rolling the moment on i over R*: about
!>                 the axis of disks, (t, s, n) of spheres [N s]
!> What is left of the last block is filled with contacts of no effect: all zero, between the first body and itself.
!> The first n_grouped contacts make whole blocks in which no two contacts share a moving body (gravier_sweep_order): these
!> are relaxed `lanes` at a time. A body is a column of
!>   velocity      (nv) translation, then spin
!>   weight        inverse mass of each component of the translation, then, where bodies turn, inverse inertia (nw): one entry, or
!>                 in space with shapes the entries xx, yy, zz, xy, xz and yz of a symmetric matrix; zero for what cannot move.
!>                 Grains have the same mass along all axes, boundaries need not.
!> The normal points from the antagonist to the candidate; v = H^T V and R = H r (paper, section 1).
!>
!> Local operators are taken diagonal, which they are between bodies of equal components. With a body whose components
!> differ, W_nn is the exact one, and W_tt the largest eigenvalue of the tangential block: a relaxation with these two
!> lowers the energy of the contact whatever the entries off the diagonal, and its fixed points are the same. What couples
!> sliding and rolling, W_tr, is not zero but between grains of equal inverse inertia times radius: the rolling law is solved
!> after the tangential one, with the spins that this one leaves (Acary & Bourrier 2021 state the law as a cone complementarity).
!> A normal impulse turns bodies with shapes, so that W_nt is not zero between them: the tangential law is solved with the velocity
!> that the normal impulse leaves, W_nt and W_ns being part of the contact data.
!> A compliant contact yields by a r: its law holds for v + shift + a r, and its local operators are W + a.
module gravier_contact_kernels
  use gravier_effects, only: effects_t
  use gravier_contact_data, only: contact_rows_t, packed_layout_t, lanes, n_blocks, block_of, lane_of, &
    & rows_2d_frictionless, rows_2d_friction, rows_2d_friction_shift, rows_2d_friction_rolling, rows_2d_friction_shift_rolling, &
    & rows_3d_frictionless, rows_3d_friction, rows_3d_friction_shift, rows_3d_friction_rolling, rows_3d_friction_shift_rolling, &
    & rows_2d_shaped, rows_2d_shaped_shift, rows_3d_shaped, rows_3d_shaped_shift, rows_2d_compliant, rows_2d_compliant_rolling, &
    & rows_2d_shaped_compliant, rows_3d_compliant, rows_3d_compliant_rolling, rows_3d_shaped_compliant
  use gravier_kernel_table, only: kernel_table_t
  use gravier_sweeps_2d, only: choose_sweeps_2d
  use gravier_sweeps_3d, only: choose_sweeps_3d
  use gravier_block_loops_2d, only: choose_loops_2d
  use gravier_block_loops_3d, only: choose_loops_3d
  use gravier_contact_vectors, only: contact_jacobian, global_impulse, global_moment, tangents, local_operator, &
    & contact_arms, contact_tangents, project_tangential, tangential_vectors, project_on_cones, moment_vectors, project_moments, &
    & rolling_radius
  implicit none
  private
  public :: kernels_t, packed_layout_t
  ! this module is the door to the folder
  public :: lanes, n_blocks, block_of, lane_of, contact_jacobian, global_impulse, global_moment, tangents, local_operator
  public :: contact_tangents, project_tangential, tangential_vectors, project_on_cones, moment_vectors, project_moments
  public :: rolling_radius, contact_arms

  !> The loops for the effects of a scene.
  type, extends(kernel_table_t) :: kernels_t
  contains
    procedure :: choose => kernels_choose
  end type kernels_t

contains

  !> Choose the loops for a dimension and the effects that the scene has.
  subroutine kernels_choose(self, dimension, effects)
    class(kernels_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: dimension
    !> without friction no contact turns a disk or a sphere, spins are none of its unknowns, and tangential restitution and rolling
    !> have no meaning; where bodies have shapes, spins are unknowns, and rolling has none; compliant contacts are in the kernels of
    !> friction, with a tangential shift, which bonds have, too
    type(effects_t), intent(in) :: effects
    logical :: friction, shifted, rolling, compliant

    compliant = effects%compliance
    friction = effects%friction .or. effects%shapes .or. compliant
    shifted = (friction .and. (effects%tangential_restitution .or. effects%moving_cell .or. effects%bonds)) .or. compliant
    rolling = effects%friction .and. effects%rolling .and. .not. effects%shapes
    if (dimension == 2) then
      self%row = rows_of_disks(friction, shifted, rolling, effects%shapes, compliant)
      call choose_sweeps_2d(self, friction, shifted, rolling, effects%shapes, compliant)
      call choose_loops_2d(self, friction, shifted, rolling, effects%shapes, compliant)
    else
      self%row = rows_of_spheres(friction, shifted, rolling, effects%shapes, compliant)
      call choose_sweeps_3d(self, friction, shifted, rolling, effects%shapes, compliant)
      call choose_loops_3d(self, friction, shifted, rolling, effects%shapes, compliant)
    end if
    self%nd = dimension
    self%nf = merge(dimension, 1, friction)
    self%nv = dimension
    if (friction) self%nv = 3*dimension - 3
    self%nw = dimension + merge(1, 0, friction)
    if (dimension == 3 .and. effects%shapes) self%nw = 9
    self%nc = self%nf
    if (rolling) self%nc = self%nc + 2*dimension - 3
    self%nh = self%row%total
    self%friction_row = self%row%friction
    self%shift_row = max(self%row%shift_t - 1, 0)
    self%rolling_row = max(self%row%rolling_radius - 1, 0)
  end subroutine kernels_choose

  pure type(contact_rows_t) function rows_of_disks(friction, shifted, rolling, shaped, compliant) result(row)
    logical, intent(in) :: friction, shifted, rolling, shaped, compliant

    row = rows_2d_frictionless
    if (friction) row = rows_2d_friction
    if (shifted) row = rows_2d_friction_shift
    if (rolling) row = rows_2d_friction_rolling
    if (shifted .and. rolling) row = rows_2d_friction_shift_rolling
    if (shaped) row = rows_2d_shaped
    if (shaped .and. shifted) row = rows_2d_shaped_shift
    if (compliant) row = rows_2d_compliant
    if (compliant .and. rolling) row = rows_2d_compliant_rolling
    if (compliant .and. shaped) row = rows_2d_shaped_compliant
  end function rows_of_disks

  pure type(contact_rows_t) function rows_of_spheres(friction, shifted, rolling, shaped, compliant) result(row)
    logical, intent(in) :: friction, shifted, rolling, shaped, compliant

    row = rows_3d_frictionless
    if (friction) row = rows_3d_friction
    if (shifted) row = rows_3d_friction_shift
    if (rolling) row = rows_3d_friction_rolling
    if (shifted .and. rolling) row = rows_3d_friction_shift_rolling
    if (shaped) row = rows_3d_shaped
    if (shaped .and. shifted) row = rows_3d_shaped_shift
    if (compliant) row = rows_3d_compliant
    if (compliant .and. rolling) row = rows_3d_compliant_rolling
    if (compliant .and. shaped) row = rows_3d_shaped_compliant
  end function rows_of_spheres

end module gravier_contact_kernels
