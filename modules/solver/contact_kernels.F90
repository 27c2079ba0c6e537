!> The loops over contacts, one version per dimension and per set of effects, chosen once a run.
!>
!> Contacts are packed in sweep order, in blocks of `lanes`; contact c is lane lane_of(c) of block block_of(c):
!>   pair(1:2, c)  local numbers of the candidate i and the antagonist j
!>   hot           (lanes, nh, blocks): normal (nd), shift = max(gap, 0)/h, 1/W_nn, and with friction 1/W_tt, levers of i
!>                 and j, mu
!>   impulse       (lanes, nc, blocks): (n[, t[, s]]) [N s], compression positive
!> What is left of the last block is filled with contacts of no effect: all zero, between the first body and itself.
!> The first n_grouped contacts make whole blocks in which no two contacts share a moving body (gravier_sweep_order): these
!> are relaxed `lanes` at a time. A body is
!> a column of
!>   velocity      (nv) translation, then spin
!>   weight        inverse mass of each component of the translation, then, where bodies turn, inverse inertia (nw); zero
!>                 for what cannot move. Grains have the same mass along all axes, boundaries need not.
!> The normal points from the antagonist to the candidate; v = H^T V and R = H r (paper, section 1).
!>
!> Local operators are taken diagonal, which they are between bodies of equal components. With a body whose components
!> differ, W_nn is the exact one, and W_tt the largest eigenvalue of the tangential block: a relaxation with these two
!> lowers the energy of the contact whatever the entries off the diagonal, and its fixed points are the same.
module gravier_contact_kernels
  use gravier_kinds, only: dp
  implicit none
  private
  public :: kernels_t, contact_jacobian, global_impulse, tangents, local_operator
  public :: lanes, n_blocks, block_of, lane_of, contact_tangents, project_tangential, tangential_vectors, project_on_cones

  !> contacts of a block: long enough to hide the latency of square roots and divisions behind each other
  integer, parameter :: lanes = 16

  ! rows of `hot` that hold 1/W_nn and 1/W_tt
  integer, parameter :: operators_2d_frictionless(1) = [4], operators_3d_frictionless(1) = [5]
  integer, parameter :: operators_2d_friction(2) = [4, 5], operators_3d_friction(2) = [5, 6]

  abstract interface
    !> One Gauss-Seidel sweep: updates velocity and impulse; sums = (sum of |r - y|^2, sum of |r|^2) over the contacts, y being
    !> the impulse that the sweep started from.
    pure subroutine sweep_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
    end subroutine sweep_kernel
    !> The same, keeping v at each contact as it was when its law was solved.
    pure subroutine recording_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, law_velocity)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(inout), contiguous :: law_velocity(:, :, :)
    end subroutine recording_kernel
    !> From y = r + beta (r - previous), under which the velocities are; r goes into `previous`.
    pure subroutine momentum_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, beta, previous)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(in) :: beta
      real(dp), intent(inout), contiguous :: previous(:, :, :)
    end subroutine momentum_kernel
    !> Both.
    pure subroutine momentum_recording_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, beta, previous, law_velocity)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(in) :: beta
      real(dp), intent(inout), contiguous :: previous(:, :, :)
      real(dp), intent(inout), contiguous :: law_velocity(:, :, :)
    end subroutine momentum_recording_kernel
    !> reaction := reaction + H impulse.
    pure subroutine reaction_kernel(pair, hot, impulse, reaction)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), impulse(:, :, :)
      real(dp), intent(inout), contiguous :: reaction(:, :)
    end subroutine reaction_kernel
    !> contact_velocity := H^T velocity.
    pure subroutine velocity_kernel(pair, hot, velocity, contact_velocity)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), velocity(:, :)
      real(dp), intent(inout), contiguous :: contact_velocity(:, :, :)
    end subroutine velocity_kernel
    !> 1/W_nn and 1/W_tt into `hot`.
    pure subroutine operator_kernel(pair, hot, weight)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(inout), contiguous :: hot(:, :, :)
      real(dp), intent(in), contiguous :: weight(:, :)
    end subroutine operator_kernel
    !> sums = (sum of |r - P|^2, sum of |r|^2), P being the local solve with the undivided local operator.
    pure subroutine residual_kernel(pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
    end subroutine residual_kernel
  end interface

  type :: kernels_t
    !> space dimension, degrees of freedom of a body, rows of `weight`, components of an impulse, rows of `hot`
    integer :: nd = 2, nv = 2, nw = 2, nc = 1, nh = 4
    procedure(sweep_kernel), pointer, nopass :: sweep => null()
    procedure(recording_kernel), pointer, nopass :: sweep_recording => null()
    procedure(momentum_kernel), pointer, nopass :: sweep_momentum => null()
    procedure(momentum_recording_kernel), pointer, nopass :: sweep_momentum_recording => null()
    procedure(reaction_kernel), pointer, nopass :: add_reaction => null()
    procedure(velocity_kernel), pointer, nopass :: contact_velocity => null()
    procedure(operator_kernel), pointer, nopass :: set_operators => null()
    procedure(residual_kernel), pointer, nopass :: residual => null()
  contains
    procedure :: choose => kernels_choose
  end type kernels_t

contains

  !> Choose the loops for a dimension and the effects that the scene has.
  subroutine kernels_choose(self, dimension, friction)
    class(kernels_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: dimension
    !> some contact has mu > 0; without, no contact turns a grain and spins are none of its unknowns
    logical, intent(in) :: friction

    self%nd = dimension
    self%nv = dimension
    if (friction) self%nv = merge(3, 6, dimension == 2)
    self%nw = dimension + merge(1, 0, friction)
    self%nc = merge(dimension, 1, friction)
    self%nh = dimension + merge(6, 2, friction)
    if (friction .and. dimension == 2) then
      self%sweep => sweep_2d_friction
      self%sweep_recording => sweep_2d_friction_recording
      self%sweep_momentum => sweep_2d_friction_momentum
      self%sweep_momentum_recording => sweep_2d_friction_momentum_recording
      self%add_reaction => add_reaction_2d_friction
      self%contact_velocity => contact_velocity_2d_friction
      self%set_operators => set_operators_2d_friction
      self%residual => residual_2d_friction
    else if (friction) then
      self%sweep => sweep_3d_friction
      self%sweep_recording => sweep_3d_friction_recording
      self%sweep_momentum => sweep_3d_friction_momentum
      self%sweep_momentum_recording => sweep_3d_friction_momentum_recording
      self%add_reaction => add_reaction_3d_friction
      self%contact_velocity => contact_velocity_3d_friction
      self%set_operators => set_operators_3d_friction
      self%residual => residual_3d_friction
    else if (dimension == 2) then
      self%sweep => sweep_2d_frictionless
      self%sweep_recording => sweep_2d_frictionless_recording
      self%sweep_momentum => sweep_2d_frictionless_momentum
      self%sweep_momentum_recording => sweep_2d_frictionless_momentum_recording
      self%add_reaction => add_reaction_2d_frictionless
      self%contact_velocity => contact_velocity_2d_frictionless
      self%set_operators => set_operators_2d_frictionless
      self%residual => residual_2d_frictionless
    else
      self%sweep => sweep_3d_frictionless
      self%sweep_recording => sweep_3d_frictionless_recording
      self%sweep_momentum => sweep_3d_frictionless_momentum
      self%sweep_momentum_recording => sweep_3d_frictionless_momentum_recording
      self%add_reaction => add_reaction_3d_frictionless
      self%contact_velocity => contact_velocity_3d_frictionless
      self%set_operators => set_operators_3d_frictionless
      self%residual => residual_3d_frictionless
    end if
  end subroutine kernels_choose

#define LAW
#define RELAX(name) name/**/_blocks
#include "contact_sweeps.inc"
#undef RELAX
#define RELAX(name) name/**/_singles
#define RELAX_BLOCKS(name) name/**/_blocks
#define SWEEP(name) name
#define SINGLE
#include "contact_sweeps.inc"
#undef SINGLE
#undef RELAX
#undef RELAX_BLOCKS
#undef SWEEP
#undef LAW
#define RECORD
#define LAW , law_velocity
#define RELAX(name) name/**/_blocks_recording
#include "contact_sweeps.inc"
#undef RELAX
#define RELAX(name) name/**/_singles_recording
#define RELAX_BLOCKS(name) name/**/_blocks_recording
#define SWEEP(name) name/**/_recording
#define SINGLE
#include "contact_sweeps.inc"
#undef SINGLE
#undef RELAX
#undef RELAX_BLOCKS
#undef SWEEP
#undef LAW
#undef RECORD
#define MOMENTUM
#define LAW , beta, previous
#define RELAX(name) name/**/_blocks_momentum
#include "contact_sweeps.inc"
#undef RELAX
#define RELAX(name) name/**/_singles_momentum
#define RELAX_BLOCKS(name) name/**/_blocks_momentum
#define SWEEP(name) name/**/_momentum
#define SINGLE
#include "contact_sweeps.inc"
#undef SINGLE
#undef RELAX
#undef RELAX_BLOCKS
#undef SWEEP
#undef LAW
#define RECORD
#define LAW , beta, previous, law_velocity
#define RELAX(name) name/**/_blocks_momentum_recording
#include "contact_sweeps.inc"
#undef RELAX
#define RELAX(name) name/**/_singles_momentum_recording
#define RELAX_BLOCKS(name) name/**/_blocks_momentum_recording
#define SWEEP(name) name/**/_momentum_recording
#define SINGLE
#include "contact_sweeps.inc"
#undef SINGLE
#undef RELAX
#undef RELAX_BLOCKS
#undef SWEEP
#undef LAW

  !> Blocks that so many contacts take.
  pure integer function n_blocks(n_contacts)
    integer, intent(in) :: n_contacts
    n_blocks = (n_contacts + lanes - 1)/lanes
  end function n_blocks

  !> Block of contact `c`.
  pure integer function block_of(c)
    integer, intent(in) :: c
    block_of = (c - 1)/lanes + 1
  end function block_of

  !> Lane of contact `c` in its block.
  pure integer function lane_of(c)
    integer, intent(in) :: c
    lane_of = mod(c - 1, lanes) + 1
  end function lane_of

  !> Unit vectors t and s that make (n, t, s) direct, from n alone (Duff et al., JCGT 6(1), 2017).
  pure subroutine tangents(n, t, s)
    real(dp), intent(in) :: n(3)
    real(dp), intent(out) :: t(3), s(3)
    call find_frame(n(1), n(2), n(3), t(1), t(2), t(3), s(1), s(2), s(3))
  end subroutine tangents

  !> The same component by component, for loops over lanes.
  pure subroutine find_frame(nx, ny, nz, tx, ty, tz, sx, sy, sz)
    real(dp), intent(in) :: nx, ny, nz
    real(dp), intent(out) :: tx, ty, tz, sx, sy, sz
    real(dp) :: side, a, b

    side = sign(1.0_dp, nz)
    a = -1.0_dp/(side + nz)
    b = nx*ny*a
    tx = 1.0_dp + side*nx*nx*a
    ty = side*b
    tz = -side*nx
    sx = b
    sy = side + ny*ny*a
    sz = -ny
  end subroutine find_frame

  !> W_nn and the translational part of W_tt of two bodies [1/kg].
  pure subroutine local_operator(n, wi, wj, wn, wt)
    !> (nd) unit normal
    real(dp), intent(in), contiguous :: n(:)
    !> (nw) columns of `weight`
    real(dp), intent(in), contiguous :: wi(:), wj(:)
    real(dp), intent(out) :: wn, wt
    real(dp) :: t(3), s(3)

    if (size(n) == 2) then
      wn = normal_2d(n(2), wi, wj)
      wt = tangential_2d(n(1), wi, wj)
    else
      call tangents(n, t, s)
      wn = normal_3d(n(2), n(3), wi, wj)
      wt = tangential_3d(t, s, wi, wj)
    end if
  end subroutine local_operator

  !> W_nn of disks, the sum over d of n_d^2 (w_d,i + w_d,j), written so that it is exactly w_i + w_j where components are
  !> equal; and so the next ones.
  pure real(dp) function normal_2d(ny, wi, wj) result(w)
    real(dp), intent(in) :: ny, wi(2), wj(2)
    w = wi(1) + wj(1) + ny**2*((wi(2) - wi(1)) + (wj(2) - wj(1)))
  end function normal_2d

  pure real(dp) function normal_3d(ny, nz, wi, wj) result(w)
    real(dp), intent(in) :: ny, nz, wi(3), wj(3)
    w = wi(1) + wj(1) + (ny**2*((wi(2) - wi(1)) + (wj(2) - wj(1))) + nz**2*((wi(3) - wi(1)) + (wj(3) - wj(1))))
  end function normal_3d

  pure real(dp) function tangential_2d(nx, wi, wj) result(w)
    real(dp), intent(in) :: nx, wi(2), wj(2)
    w = wi(1) + wj(1) + nx**2*((wi(2) - wi(1)) + (wj(2) - wj(1)))
  end function tangential_2d

  !> The largest eigenvalue of the tangential block.
  pure real(dp) function tangential_3d(t, s, wi, wj) result(w)
    real(dp), intent(in) :: t(3), s(3), wi(3), wj(3)
    real(dp) :: y, z, tt, ss, ts

    ! of the block less (w_1,i + w_1,j) times the identity
    y = (wi(2) - wi(1)) + (wj(2) - wj(1))
    z = (wi(3) - wi(1)) + (wj(3) - wj(1))
    tt = t(2)**2*y + t(3)**2*z
    ss = s(2)**2*y + s(3)**2*z
    ts = t(2)*s(2)*y + t(3)*s(3)*z
    w = wi(1) + wj(1) + (0.5_dp*(tt + ss) + sqrt((0.5_dp*(tt - ss))**2 + ts**2))
  end function tangential_3d

  !> The impulse of contact `c` on its candidate in global axes [N s].
  pure subroutine global_impulse(kernels, hot, impulse, c, p)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in), contiguous :: hot(:, :, :), impulse(:, :, :)
    integer, intent(in) :: c
    !> (nd)
    real(dp), intent(out) :: p(:)
    real(dp) :: r(kernels%nc), n(kernels%nd), t(3), s(3)

    r(:) = impulse(lane_of(c), :, block_of(c))
    n(:) = hot(lane_of(c), 1:kernels%nd, block_of(c))
    p(:) = r(1)*n
    if (kernels%nc == 2) then
      p(1) = p(1) - r(2)*n(2)
      p(2) = p(2) + r(2)*n(1)
    else if (kernels%nc == 3) then
      call contact_tangents(hot, c, t, s)
      p(:) = p + r(2)*t + r(3)*s
    end if
  end subroutine global_impulse

  !> Unit vectors t and s of contact `c` of spheres.
  pure subroutine contact_tangents(hot, c, t, s)
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    real(dp), intent(out) :: t(3), s(3)
    real(dp) :: n(3)

    n(:) = hot(lane_of(c), 1:3, block_of(c))
    call tangents(n, t, s)
  end subroutine contact_tangents

  !> The tangential parts of the impulses of a block of spheres, from vectors in global axes of which they are projections.
  pure subroutine project_tangential(hot, vector, impulse)
    real(dp), intent(in) :: hot(lanes, 9), vector(lanes, 3)
    !> its normal parts are left
    real(dp), intent(inout) :: impulse(lanes, 3)
    real(dp) :: tx, ty, tz, sx, sy, sz
    integer :: q

    do q = 1, lanes
      call find_frame(hot(q, 1), hot(q, 2), hot(q, 3), tx, ty, tz, sx, sy, sz)
      impulse(q, 2) = vector(q, 1)*tx + vector(q, 2)*ty + vector(q, 3)*tz
      impulse(q, 3) = vector(q, 1)*sx + vector(q, 2)*sy + vector(q, 3)*sz
    end do
  end subroutine project_tangential

  !> The tangential parts of the impulses of a block of spheres as vectors in global axes.
  pure subroutine tangential_vectors(hot, impulse, vector)
    real(dp), intent(in) :: hot(lanes, 9), impulse(lanes, 3)
    real(dp), intent(out) :: vector(lanes, 3)
    real(dp) :: tx, ty, tz, sx, sy, sz
    integer :: q

    do q = 1, lanes
      call find_frame(hot(q, 1), hot(q, 2), hot(q, 3), tx, ty, tz, sx, sy, sz)
      vector(q, 1) = impulse(q, 2)*tx + impulse(q, 3)*sx
      vector(q, 2) = impulse(q, 2)*ty + impulse(q, 3)*sy
      vector(q, 3) = impulse(q, 2)*tz + impulse(q, 3)*sz
    end do
  end subroutine tangential_vectors

  !> Bring impulses into Coulomb's cones: r_n >= 0, |r_t| <= mu r_n.
  pure subroutine project_on_cones(kernels, n_contacts, hot, impulse)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n_contacts
    real(dp), intent(in), contiguous :: hot(:, :, :)
    real(dp), intent(inout), contiguous :: impulse(:, :, :)
    real(dp) :: bound, tangential
    integer :: c, q, g

    impulse(:, 1, :) = max(0.0_dp, impulse(:, 1, :))
    if (kernels%nc == 1) return
    do c = 1, n_contacts
      q = lane_of(c)
      g = block_of(c)
      bound = hot(q, kernels%nh, g)*impulse(q, 1, g)
      tangential = norm2(impulse(q, 2:, g))
      if (tangential > bound) impulse(q, 2:, g) = impulse(q, 2:, g)*(bound/tangential)
    end do
  end subroutine project_on_cones

  !> Rows of H^T of contact `c`: v = candidate . V_i + antagonist . V_j.
  pure subroutine contact_jacobian(kernels, hot, c, candidate, antagonist)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    !> (nc, nv)
    real(dp), intent(out) :: candidate(:, :), antagonist(:, :)
    real(dp) :: column(kernels%nh), t(3), s(3)
    integer :: nd, nc

    nd = kernels%nd
    nc = kernels%nc
    column(:) = hot(lane_of(c), :, block_of(c))
    candidate(:, :) = 0.0_dp
    candidate(1, 1:nd) = column(1:nd)
    antagonist(:, :) = 0.0_dp
    if (nc == 2) then
      candidate(2, 1) = -column(2)
      candidate(2, 2) = column(1)
      candidate(2, 3) = -column(6)
      antagonist(2, 3) = -column(7)
    else if (nc == 3) then
      call contact_tangents(hot, c, t, s)
      candidate(2, 1:3) = t
      candidate(3, 1:3) = s
      candidate(2, 4:6) = -column(7)*s
      candidate(3, 4:6) = column(7)*t
      antagonist(2, 4:6) = -column(8)*s
      antagonist(3, 4:6) = column(8)*t
    end if
    antagonist(:, 1:nd) = -candidate(:, 1:nd)
  end subroutine contact_jacobian

#define OF(name) name/**/_2d_frictionless
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_3d_frictionless
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_2d_friction
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_3d_friction
#include "contact_loops.inc"
#undef OF

  ! What the loops of contact_loops.inc do with one block, with the shapes of each law.

  pure subroutine react_2d_frictionless(pair, hot, impulse, reaction)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 4), impulse(lanes, 1)
    real(dp), intent(inout) :: reaction(2, *)
    integer :: q, i, j
    real(dp) :: px(lanes), py(lanes)

    px(:) = impulse(:, 1)*hot(:, 1)
    py(:) = impulse(:, 1)*hot(:, 2)
    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      reaction(1, i) = reaction(1, i) + px(q)
      reaction(2, i) = reaction(2, i) + py(q)
      reaction(1, j) = reaction(1, j) - px(q)
      reaction(2, j) = reaction(2, j) - py(q)
    end do
  end subroutine react_2d_frictionless

  pure subroutine react_3d_frictionless(pair, hot, impulse, reaction)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 5), impulse(lanes, 1)
    real(dp), intent(inout) :: reaction(3, *)
    integer :: q, i, j
    real(dp) :: px(lanes), py(lanes), pz(lanes)

    px(:) = impulse(:, 1)*hot(:, 1)
    py(:) = impulse(:, 1)*hot(:, 2)
    pz(:) = impulse(:, 1)*hot(:, 3)
    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      reaction(1, i) = reaction(1, i) + px(q)
      reaction(2, i) = reaction(2, i) + py(q)
      reaction(3, i) = reaction(3, i) + pz(q)
      reaction(1, j) = reaction(1, j) - px(q)
      reaction(2, j) = reaction(2, j) - py(q)
      reaction(3, j) = reaction(3, j) - pz(q)
    end do
  end subroutine react_3d_frictionless

  pure subroutine react_2d_friction(pair, hot, impulse, reaction)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 8), impulse(lanes, 2)
    real(dp), intent(inout) :: reaction(3, *)
    integer :: q, i, j
    real(dp) :: px(lanes), py(lanes)

    px(:) = impulse(:, 1)*hot(:, 1) - impulse(:, 2)*hot(:, 2)
    py(:) = impulse(:, 1)*hot(:, 2) + impulse(:, 2)*hot(:, 1)
    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      reaction(1, i) = reaction(1, i) + px(q)
      reaction(2, i) = reaction(2, i) + py(q)
      reaction(3, i) = reaction(3, i) - hot(q, 6)*impulse(q, 2)
      reaction(1, j) = reaction(1, j) - px(q)
      reaction(2, j) = reaction(2, j) - py(q)
      reaction(3, j) = reaction(3, j) - hot(q, 7)*impulse(q, 2)
    end do
  end subroutine react_2d_friction

  pure subroutine react_3d_friction(pair, hot, impulse, reaction)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 9), impulse(lanes, 3)
    real(dp), intent(inout) :: reaction(6, *)
    integer :: q, i, j
    real(dp) :: nx, ny, nz, tx, ty, tz, sx, sy, sz
    real(dp), dimension(lanes) :: px, py, pz, qx, qy, qz

    do q = 1, lanes
      nx = hot(q, 1)
      ny = hot(q, 2)
      nz = hot(q, 3)
      call find_frame(nx, ny, nz, tx, ty, tz, sx, sy, sz)
      px(q) = impulse(q, 1)*nx + impulse(q, 2)*tx + impulse(q, 3)*sx
      py(q) = impulse(q, 1)*ny + impulse(q, 2)*ty + impulse(q, 3)*sy
      pz(q) = impulse(q, 1)*nz + impulse(q, 2)*tz + impulse(q, 3)*sz
      qx(q) = impulse(q, 2)*sx - impulse(q, 3)*tx
      qy(q) = impulse(q, 2)*sy - impulse(q, 3)*ty
      qz(q) = impulse(q, 2)*sz - impulse(q, 3)*tz
    end do
    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      reaction(1, i) = reaction(1, i) + px(q)
      reaction(2, i) = reaction(2, i) + py(q)
      reaction(3, i) = reaction(3, i) + pz(q)
      reaction(4, i) = reaction(4, i) - hot(q, 7)*qx(q)
      reaction(5, i) = reaction(5, i) - hot(q, 7)*qy(q)
      reaction(6, i) = reaction(6, i) - hot(q, 7)*qz(q)
      reaction(1, j) = reaction(1, j) - px(q)
      reaction(2, j) = reaction(2, j) - py(q)
      reaction(3, j) = reaction(3, j) - pz(q)
      reaction(4, j) = reaction(4, j) - hot(q, 8)*qx(q)
      reaction(5, j) = reaction(5, j) - hot(q, 8)*qy(q)
      reaction(6, j) = reaction(6, j) - hot(q, 8)*qz(q)
    end do
  end subroutine react_3d_friction

  pure subroutine velocity_2d_frictionless(pair, hot, velocity, v)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 4), velocity(2, *)
    real(dp), intent(out) :: v(lanes, 1)
    integer :: q, i, j

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      v(q, 1) = (velocity(1, i) - velocity(1, j))*hot(q, 1) + (velocity(2, i) - velocity(2, j))*hot(q, 2)
    end do
  end subroutine velocity_2d_frictionless

  pure subroutine velocity_3d_frictionless(pair, hot, velocity, v)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 5), velocity(3, *)
    real(dp), intent(out) :: v(lanes, 1)
    integer :: q, i, j

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      v(q, 1) = (velocity(1, i) - velocity(1, j))*hot(q, 1) + (velocity(2, i) - velocity(2, j))*hot(q, 2) &
        & + (velocity(3, i) - velocity(3, j))*hot(q, 3)
    end do
  end subroutine velocity_3d_frictionless

  pure subroutine velocity_2d_friction(pair, hot, velocity, v)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 8), velocity(3, *)
    real(dp), intent(out) :: v(lanes, 2)
    integer :: q, i, j
    real(dp) :: dx, dy

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      dx = velocity(1, i) - velocity(1, j)
      dy = velocity(2, i) - velocity(2, j)
      v(q, 1) = dx*hot(q, 1) + dy*hot(q, 2)
      v(q, 2) = dy*hot(q, 1) - dx*hot(q, 2) - (hot(q, 6)*velocity(3, i) + hot(q, 7)*velocity(3, j))
    end do
  end subroutine velocity_2d_friction

  pure subroutine velocity_3d_friction(pair, hot, velocity, v)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 9), velocity(6, *)
    real(dp), intent(out) :: v(lanes, 3)
    integer :: q, i, j, d
    real(dp) :: nx, ny, nz, tx, ty, tz, sx, sy, sz, dv(lanes, 3), spin(lanes, 3)

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      do d = 1, 3
        dv(q, d) = velocity(d, i) - velocity(d, j)
        spin(q, d) = hot(q, 7)*velocity(3 + d, i) + hot(q, 8)*velocity(3 + d, j)
      end do
    end do
    do q = 1, lanes
      nx = hot(q, 1)
      ny = hot(q, 2)
      nz = hot(q, 3)
      call find_frame(nx, ny, nz, tx, ty, tz, sx, sy, sz)
      v(q, 1) = dv(q, 1)*nx + dv(q, 2)*ny + dv(q, 3)*nz
      v(q, 2) = dv(q, 1)*tx + dv(q, 2)*ty + dv(q, 3)*tz &
        & - (spin(q, 1)*sx + spin(q, 2)*sy + spin(q, 3)*sz)
      v(q, 3) = dv(q, 1)*sx + dv(q, 2)*sy + dv(q, 3)*sz &
        & + (spin(q, 1)*tx + spin(q, 2)*ty + spin(q, 3)*tz)
    end do
  end subroutine velocity_3d_friction

  ! W_nn and W_tt of a block [1/kg], at least the least positive number: contacts of no effect between bodies that cannot move
  ! have W = 0.

  pure subroutine weigh_2d_frictionless(pair, hot, weight, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 4), weight(2, *)
    real(dp), intent(out) :: w(lanes, 1)
    integer :: q

    do q = 1, lanes
      w(q, 1) = max(normal_2d(hot(q, 2), weight(:, pair(1, q)), weight(:, pair(2, q))), tiny(1.0_dp))
    end do
  end subroutine weigh_2d_frictionless

  pure subroutine weigh_3d_frictionless(pair, hot, weight, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 5), weight(3, *)
    real(dp), intent(out) :: w(lanes, 1)
    integer :: q

    do q = 1, lanes
      w(q, 1) = max(normal_3d(hot(q, 2), hot(q, 3), weight(:, pair(1, q)), weight(:, pair(2, q))), tiny(1.0_dp))
    end do
  end subroutine weigh_3d_frictionless

  pure subroutine weigh_2d_friction(pair, hot, weight, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 8), weight(3, *)
    real(dp), intent(out) :: w(lanes, 2)
    integer :: q, i, j

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      w(q, 1) = max(normal_2d(hot(q, 2), weight(1:2, i), weight(1:2, j)), tiny(1.0_dp))
      w(q, 2) = max(tangential_2d(hot(q, 1), weight(1:2, i), weight(1:2, j)) + weight(3, i)*hot(q, 6)**2 &
        & + weight(3, j)*hot(q, 7)**2, tiny(1.0_dp))
    end do
  end subroutine weigh_2d_friction

  pure subroutine weigh_3d_friction(pair, hot, weight, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 9), weight(4, *)
    real(dp), intent(out) :: w(lanes, 2)
    integer :: q, i, j
    real(dp) :: tx, ty, tz, sx, sy, sz, sum_w, y, z, tt, ss, ts

    do q = 1, lanes
      i = pair(1, q)
      j = pair(2, q)
      call find_frame(hot(q, 1), hot(q, 2), hot(q, 3), tx, ty, tz, sx, sy, sz)
      ! as normal_3d and tangential_3d, written out: arrays of three would keep the lanes from becoming vectors
      sum_w = weight(1, i) + weight(1, j)
      y = (weight(2, i) - weight(1, i)) + (weight(2, j) - weight(1, j))
      z = (weight(3, i) - weight(1, i)) + (weight(3, j) - weight(1, j))
      tt = ty**2*y + tz**2*z
      ss = sy**2*y + sz**2*z
      ts = ty*sy*y + tz*sz*z
      w(q, 1) = max(sum_w + (hot(q, 2)**2*y + hot(q, 3)**2*z), tiny(1.0_dp))
      w(q, 2) = max(sum_w + (0.5_dp*(tt + ss) + sqrt((0.5_dp*(tt - ss))**2 + ts**2)) + weight(4, i)*hot(q, 7)**2 &
        & + weight(4, j)*hot(q, 8)**2, tiny(1.0_dp))
    end do
  end subroutine weigh_3d_friction

  ! |r - P|^2 and |r|^2 added lane by lane.

  pure subroutine defect_2d_frictionless(pair, hot, weight, velocity, impulse, parts)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 4), weight(2, *), velocity(2, *), impulse(lanes, 1)
    real(dp), intent(inout) :: parts(lanes, 2)
    integer :: q
    real(dp) :: v(lanes, 1), w(lanes, 1), rn

    call velocity_2d_frictionless(pair, hot, velocity, v)
    call weigh_2d_frictionless(pair, hot, weight, w)
    do q = 1, lanes
      rn = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 3))/w(q, 1))
      parts(q, 1) = parts(q, 1) + (rn - impulse(q, 1))**2
      parts(q, 2) = parts(q, 2) + impulse(q, 1)**2
    end do
  end subroutine defect_2d_frictionless

  pure subroutine defect_3d_frictionless(pair, hot, weight, velocity, impulse, parts)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 5), weight(3, *), velocity(3, *), impulse(lanes, 1)
    real(dp), intent(inout) :: parts(lanes, 2)
    integer :: q
    real(dp) :: v(lanes, 1), w(lanes, 1), rn

    call velocity_3d_frictionless(pair, hot, velocity, v)
    call weigh_3d_frictionless(pair, hot, weight, w)
    do q = 1, lanes
      rn = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 4))/w(q, 1))
      parts(q, 1) = parts(q, 1) + (rn - impulse(q, 1))**2
      parts(q, 2) = parts(q, 2) + impulse(q, 1)**2
    end do
  end subroutine defect_3d_frictionless

  pure subroutine defect_2d_friction(pair, hot, weight, velocity, impulse, parts)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 8), weight(3, *), velocity(3, *), impulse(lanes, 2)
    real(dp), intent(inout) :: parts(lanes, 2)
    integer :: q
    real(dp) :: v(lanes, 2), w(lanes, 2), rn, rt

    call velocity_2d_friction(pair, hot, velocity, v)
    call weigh_2d_friction(pair, hot, weight, w)
    do q = 1, lanes
      rn = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 3))/w(q, 1))
      rt = max(-hot(q, 8)*rn, min(hot(q, 8)*rn, impulse(q, 2) - v(q, 2)/w(q, 2)))
      parts(q, 1) = parts(q, 1) + (rn - impulse(q, 1))**2 + (rt - impulse(q, 2))**2
      parts(q, 2) = parts(q, 2) + impulse(q, 1)**2 + impulse(q, 2)**2
    end do
  end subroutine defect_2d_friction

  pure subroutine defect_3d_friction(pair, hot, weight, velocity, impulse, parts)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 9), weight(4, *), velocity(6, *), impulse(lanes, 3)
    real(dp), intent(inout) :: parts(lanes, 2)
    integer :: q
    real(dp) :: v(lanes, 3), w(lanes, 2), rn, rt, rs, bound, reduction

    call velocity_3d_friction(pair, hot, velocity, v)
    call weigh_3d_friction(pair, hot, weight, w)
    do q = 1, lanes
      rn = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 4))/w(q, 1))
      bound = hot(q, 9)*rn
      rt = impulse(q, 2) - v(q, 2)/w(q, 2)
      rs = impulse(q, 3) - v(q, 3)/w(q, 2)
      reduction = bound/max(sqrt(rt*rt + rs*rs), bound, tiny(1.0_dp))
      parts(q, 1) = parts(q, 1) + (rn - impulse(q, 1))**2 + (rt*reduction - impulse(q, 2))**2 + (rs*reduction - impulse(q, 3))**2
      parts(q, 2) = parts(q, 2) + impulse(q, 1)**2 + impulse(q, 2)**2 + impulse(q, 3)**2
    end do
  end subroutine defect_3d_friction

end module gravier_contact_kernels
