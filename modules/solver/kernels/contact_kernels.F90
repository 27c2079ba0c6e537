!> The loops over contacts, one version per dimension and per set of effects, chosen once a run.
!>
!> Contacts are packed in sweep order, in blocks of `lanes`; contact c is lane lane_of(c) of block block_of(c):
!>   pair(1:2, c)  local numbers of the candidate i and the antagonist j
!>   hot           (lanes, nh, blocks): normal (nd), shift, which the law adds to the normal velocity: play/h, or with restitution
!>                 e v_n of the start of the step; 1/W_nn; with friction 1/W_tt, levers of i and j, mu; with tangential
!>                 restitution the tangential shift (nd - 1); with rolling R*, 1/W_rr, rolling friction and, of spheres,
!>                 pivoting friction
!>   impulse       (lanes, nc, blocks): (n[, t[, s]]) [N s], compression positive; with rolling the moment on i over R*: about
!>                 the axis of disks, (t, s, n) of spheres [N s]
!> What is left of the last block is filled with contacts of no effect: all zero, between the first body and itself.
!> The first n_grouped contacts make whole blocks in which no two contacts share a moving body (gravier_sweep_order): these
!> are relaxed `lanes` at a time. A body is a column of
!>   velocity      (nv) translation, then spin
!>   weight        inverse mass of each component of the translation, then, where bodies turn, inverse inertia (nw); zero
!>                 for what cannot move. Grains have the same mass along all axes, boundaries need not.
!> The normal points from the antagonist to the candidate; v = H^T V and R = H r (paper, section 1).
!>
!> Local operators are taken diagonal, which they are between bodies of equal components. With a body whose components
!> differ, W_nn is the exact one, and W_tt the largest eigenvalue of the tangential block: a relaxation with these two
!> lowers the energy of the contact whatever the entries off the diagonal, and its fixed points are the same. What couples
!> sliding and rolling, W_tr, is not zero but between grains of equal inverse inertia times radius: the rolling law is solved
!> after the tangential one, with the spins that this one leaves (Acary & Bourrier 2021 state the law as a cone complementarity).
module gravier_contact_kernels
  use gravier_kinds, only: dp
  use gravier_effects, only: effects_t
  implicit none
  private
  public :: kernels_t, contact_jacobian, global_impulse, global_moment, tangents, local_operator
  public :: lanes, n_blocks, block_of, lane_of, contact_tangents, project_tangential, tangential_vectors, project_on_cones
  public :: moment_vectors, project_moments, rolling_radius

  !> contacts of a block: long enough to hide the latency of square roots and divisions behind each other
  integer, parameter :: lanes = 16

  ! rows of `hot` that hold 1/W_nn, 1/W_tt and 1/W_rr
  integer, parameter :: operators_2d_frictionless(1) = [4], operators_3d_frictionless(1) = [5]
  integer, parameter :: operators_2d_friction(2) = [4, 5], operators_3d_friction(2) = [5, 6]
  integer, parameter :: operators_2d_friction_shift(2) = [4, 5], operators_3d_friction_shift(2) = [5, 6]
  integer, parameter :: operators_2d_friction_roll(3) = [4, 5, 10], operators_3d_friction_roll(3) = [5, 6, 11]
  integer, parameter :: operators_2d_friction_full(3) = [4, 5, 11], operators_3d_friction_full(3) = [5, 6, 13]

  ! of each component of an impulse, which of these operators is its own
  integer, parameter :: own_2d_frictionless(1) = [1], own_3d_frictionless(1) = [1]
  integer, parameter :: own_2d_friction(2) = [1, 2], own_3d_friction(3) = [1, 2, 2]
  integer, parameter :: own_2d_friction_shift(2) = [1, 2], own_3d_friction_shift(3) = [1, 2, 2]
  integer, parameter :: own_2d_friction_roll(3) = [1, 2, 3], own_3d_friction_roll(6) = [1, 2, 2, 3, 3, 3]
  integer, parameter :: own_2d_friction_full(3) = [1, 2, 3], own_3d_friction_full(6) = [1, 2, 2, 3, 3, 3]

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
    !> 1/W_nn and, where the law has them, 1/W_tt and 1/W_rr into `hot`, times the share of each that sweeps take.
    pure subroutine operator_kernel(pair, hot, weight, share)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(inout), contiguous :: hot(:, :, :)
      real(dp), intent(in), contiguous :: weight(:, :)
      real(dp), intent(in) :: share(3)
    end subroutine operator_kernel
    !> sums = (sum of |r - P|^2, sum of |r|^2, sum of r_n times the shift), P being the local solve with the undivided local
    !> operator.
    pure subroutine residual_kernel(pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(3)
    end subroutine residual_kernel
    !> What the estimate of the velocity error needs (gravier_velocity_error), w = W (P - r) being the velocity by which a contact
    !> misses its law and W its undivided local operator: r . w of each contact, H y of the test impulses P - r and r - previous,
    !> added to `local` and `recent`, and sums. `largest` is raised to the largest |w|^2.
    pure subroutine tests_kernel(pair, hot, weight, velocity, impulse, previous, power, local, recent, sums, largest)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      !> previous: impulses of an earlier iteration (lanes, nc, blocks) [N s]
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :), impulse(:, :, :), previous(:, :, :)
      !> (lanes, blocks) [J]
      real(dp), intent(inout), contiguous :: power(:, :)
      !> (nv, n_columns) [N s, N m s]
      real(dp), intent(inout), contiguous :: local(:, :), recent(:, :)
      !> the three of a residual; of y . w with the tests P - r, r and r - previous
      real(dp), intent(out) :: sums(6)
      real(dp), intent(inout) :: largest
    end subroutine tests_kernel
  end interface

  type :: kernels_t
    !> space dimension, degrees of freedom of a body, rows of `weight`, components of an impulse, those of them that are a
    !> force's (the first ones; the others are moments), rows of `hot`
    integer :: nd = 2, nv = 2, nw = 2, nc = 1, nf = 1, nh = 4
    !> row of `hot` that holds mu, and the rows before the tangential shift and before those of the rolling law; 0 where the
    !> kernels have no such effect
    integer :: friction_row = 0, shift_row = 0, rolling_row = 0
    procedure(sweep_kernel), pointer, nopass :: sweep => null()
    procedure(recording_kernel), pointer, nopass :: sweep_recording => null()
    procedure(momentum_kernel), pointer, nopass :: sweep_momentum => null()
    procedure(momentum_recording_kernel), pointer, nopass :: sweep_momentum_recording => null()
    procedure(reaction_kernel), pointer, nopass :: add_reaction => null()
    procedure(velocity_kernel), pointer, nopass :: contact_velocity => null()
    procedure(operator_kernel), pointer, nopass :: set_operators => null()
    procedure(residual_kernel), pointer, nopass :: residual => null()
    procedure(tests_kernel), pointer, nopass :: make_tests => null()
  contains
    procedure :: choose => kernels_choose
  end type kernels_t

contains

  !> Choose the loops for a dimension and the effects that the scene has.
  subroutine kernels_choose(self, dimension, effects)
    class(kernels_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: dimension
    !> without friction no contact turns a grain, spins are none of its unknowns, and the other two effects have no meaning
    type(effects_t), intent(in) :: effects

    self%nd = dimension
    self%nf = merge(dimension, 1, effects%friction)
    self%nv = dimension
    if (effects%friction) self%nv = 3*dimension - 3
    self%nw = dimension + merge(1, 0, effects%friction)
    self%nc = self%nf
    self%nh = dimension + merge(6, 2, effects%friction)
    self%friction_row = merge(self%nh, 0, effects%friction)
    self%shift_row = 0
    self%rolling_row = 0
    if (effects%friction .and. effects%tangential_restitution) then
      self%shift_row = self%nh
      self%nh = self%nh + dimension - 1
    end if
    if (effects%friction .and. effects%rolling) then
      self%rolling_row = self%nh
      self%nh = self%nh + dimension + 1
      self%nc = self%nc + 2*dimension - 3
    end if
    if (dimension == 2) then
      call choose_2d(self, effects)
    else
      call choose_3d(self, effects)
    end if
  end subroutine kernels_choose

  subroutine choose_2d(self, effects)
    class(kernels_t), intent(inout) :: self
    type(effects_t), intent(in) :: effects

    if (.not. effects%friction) then
#define OF(name) name/**/_2d_frictionless
#include "contact_choice.inc"
#undef OF
    else if (effects%rolling .and. effects%tangential_restitution) then
#define OF(name) name/**/_2d_friction_full
#include "contact_choice.inc"
#undef OF
    else if (effects%rolling) then
#define OF(name) name/**/_2d_friction_roll
#include "contact_choice.inc"
#undef OF
    else if (effects%tangential_restitution) then
#define OF(name) name/**/_2d_friction_shift
#include "contact_choice.inc"
#undef OF
    else
#define OF(name) name/**/_2d_friction
#include "contact_choice.inc"
#undef OF
    end if
  end subroutine choose_2d

  subroutine choose_3d(self, effects)
    class(kernels_t), intent(inout) :: self
    type(effects_t), intent(in) :: effects

    if (.not. effects%friction) then
#define OF(name) name/**/_3d_frictionless
#include "contact_choice.inc"
#undef OF
    else if (effects%rolling .and. effects%tangential_restitution) then
#define OF(name) name/**/_3d_friction_full
#include "contact_choice.inc"
#undef OF
    else if (effects%rolling) then
#define OF(name) name/**/_3d_friction_roll
#include "contact_choice.inc"
#undef OF
    else if (effects%tangential_restitution) then
#define OF(name) name/**/_3d_friction_shift
#include "contact_choice.inc"
#undef OF
    else
#define OF(name) name/**/_3d_friction
#include "contact_choice.inc"
#undef OF
    end if
  end subroutine choose_3d

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
    if (kernels%nf == 2) then
      p(1) = p(1) - r(2)*n(2)
      p(2) = p(2) + r(2)*n(1)
    else if (kernels%nf == 3) then
      call contact_tangents(hot, c, t, s)
      p(:) = p + r(2)*t + r(3)*s
    end if
  end subroutine global_impulse

  !> The moment of contact `c` on its candidate, of kernels with rolling [N m s].
  pure subroutine global_moment(kernels, hot, impulse, c, m)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in), contiguous :: hot(:, :, :), impulse(:, :, :)
    integer, intent(in) :: c
    !> (nv - nd)
    real(dp), intent(out) :: m(:)
    real(dp) :: r(kernels%nc), t(3), s(3)

    r(:) = hot(lane_of(c), kernels%rolling_row + 1, block_of(c))*impulse(lane_of(c), :, block_of(c))
    if (kernels%nd == 2) then
      m(1) = r(3)
    else
      call contact_tangents(hot, c, t, s)
      m(:) = r(4)*t + r(5)*s + r(6)*hot(lane_of(c), 1:3, block_of(c))
    end if
  end subroutine global_moment

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

  !> The moments of the impulses of a block of spheres, over R*, as vectors in global axes.
  pure subroutine moment_vectors(hot, impulse, vector)
    real(dp), intent(in) :: hot(lanes, 3), impulse(lanes, 6)
    real(dp), intent(out) :: vector(lanes, 3)
    real(dp) :: tx, ty, tz, sx, sy, sz
    integer :: q

    do q = 1, lanes
      call find_frame(hot(q, 1), hot(q, 2), hot(q, 3), tx, ty, tz, sx, sy, sz)
      vector(q, 1) = impulse(q, 4)*tx + impulse(q, 5)*sx + impulse(q, 6)*hot(q, 1)
      vector(q, 2) = impulse(q, 4)*ty + impulse(q, 5)*sy + impulse(q, 6)*hot(q, 2)
      vector(q, 3) = impulse(q, 4)*tz + impulse(q, 5)*sz + impulse(q, 6)*hot(q, 3)
    end do
  end subroutine moment_vectors

  !> The inverse.
  pure subroutine project_moments(hot, vector, impulse)
    real(dp), intent(in) :: hot(lanes, 3), vector(lanes, 3)
    !> its other parts are left
    real(dp), intent(inout) :: impulse(lanes, 6)
    real(dp) :: tx, ty, tz, sx, sy, sz
    integer :: q

    do q = 1, lanes
      call find_frame(hot(q, 1), hot(q, 2), hot(q, 3), tx, ty, tz, sx, sy, sz)
      impulse(q, 4) = vector(q, 1)*tx + vector(q, 2)*ty + vector(q, 3)*tz
      impulse(q, 5) = vector(q, 1)*sx + vector(q, 2)*sy + vector(q, 3)*sz
      impulse(q, 6) = vector(q, 1)*hot(q, 1) + vector(q, 2)*hot(q, 2) + vector(q, 3)*hot(q, 3)
    end do
  end subroutine project_moments

  !> R* = R_i R_j/(R_i + R_j) of two levers [m]; of one where the other is 0, a boundary's.
  pure real(dp) function rolling_radius(lever_i, lever_j) result(radius)
    real(dp), intent(in) :: lever_i, lever_j

    radius = max(lever_i, lever_j)
    if (min(lever_i, lever_j) > 0.0_dp) radius = lever_i*lever_j/(lever_i + lever_j)
  end function rolling_radius

  !> Bring impulses into the cones of the laws: r_n >= 0, |r_t| <= mu r_n, and the moments in theirs.
  pure subroutine project_on_cones(kernels, n_contacts, hot, impulse)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n_contacts
    real(dp), intent(in), contiguous :: hot(:, :, :)
    real(dp), intent(inout), contiguous :: impulse(:, :, :)
    integer :: c, q, g, nd

    nd = kernels%nd
    impulse(:, 1, :) = max(0.0_dp, impulse(:, 1, :))
    if (kernels%nc == 1) return
    do c = 1, n_contacts
      q = lane_of(c)
      g = block_of(c)
      call cut(hot(q, kernels%friction_row, g)*impulse(q, 1, g), impulse(q, 2:nd, g))
      if (kernels%rolling_row == 0) cycle
      call cut(hot(q, kernels%rolling_row + 3, g)*impulse(q, 1, g), impulse(q, nd + 1:2*nd - 1, g))
      if (nd == 3) call cut(hot(q, kernels%rolling_row + 4, g)*impulse(q, 1, g), impulse(q, 6:6, g))
    end do

  contains

    !> Bring a part of an impulse into the disc of a radius.
    pure subroutine cut(radius, part)
      real(dp), intent(in) :: radius
      real(dp), intent(inout) :: part(:)
      real(dp) :: length

      length = norm2(part)
      if (length > radius) part(:) = part*(radius/length)
    end subroutine cut

  end subroutine project_on_cones

  !> Rows of H^T of contact `c`: v = candidate . V_i + antagonist . V_j.
  pure subroutine contact_jacobian(kernels, hot, c, candidate, antagonist)
    type(kernels_t), intent(in) :: kernels
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    !> (nc, nv)
    real(dp), intent(out) :: candidate(:, :), antagonist(:, :)
    real(dp) :: column(kernels%nh), t(3), s(3), radius
    integer :: nd, nc

    nd = kernels%nd
    nc = kernels%nc
    radius = 0.0_dp
    if (kernels%rolling_row > 0) radius = hot(lane_of(c), kernels%rolling_row + 1, block_of(c))
    column(:) = hot(lane_of(c), :, block_of(c))
    candidate(:, :) = 0.0_dp
    candidate(1, 1:nd) = column(1:nd)
    antagonist(:, :) = 0.0_dp
    if (kernels%nf == 2) then
      candidate(2, 1) = -column(2)
      candidate(2, 2) = column(1)
      candidate(2, 3) = -column(6)
      antagonist(2, 3) = -column(7)
      if (nc > 2) candidate(3, 3) = radius
      if (nc > 2) antagonist(3, 3) = -radius
    else if (kernels%nf == 3) then
      call contact_tangents(hot, c, t, s)
      candidate(2, 1:3) = t
      candidate(3, 1:3) = s
      candidate(2, 4:6) = -column(7)*s
      candidate(3, 4:6) = column(7)*t
      antagonist(2, 4:6) = -column(8)*s
      antagonist(3, 4:6) = column(8)*t
      if (nc > 3) then
        candidate(4, 4:6) = radius*t
        candidate(5, 4:6) = radius*s
        candidate(6, 4:6) = radius*column(1:3)
        antagonist(4:6, 4:6) = -candidate(4:6, 4:6)
      end if
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
#define OF(name) name/**/_2d_friction_shift
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_3d_friction_shift
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_2d_friction_roll
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_3d_friction_roll
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_2d_friction_full
#include "contact_loops.inc"
#undef OF
#define OF(name) name/**/_3d_friction_full
#include "contact_loops.inc"
#undef OF

  ! What the loops of contact_loops.inc do with one block, with the shapes of each law; those with friction are at the end.

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

  ! The changes P - r by which a local solve with the undivided local operator would correct each impulse of a block, and that
  ! operator.

  pure subroutine correct_2d_frictionless(pair, hot, weight, velocity, impulse, correction, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 4), weight(2, *), velocity(2, *), impulse(lanes, 1)
    real(dp), intent(out) :: correction(lanes, 1), w(lanes, 1)
    integer :: q
    real(dp) :: v(lanes, 1)

    call velocity_2d_frictionless(pair, hot, velocity, v)
    call weigh_2d_frictionless(pair, hot, weight, w)
    do q = 1, lanes
      correction(q, 1) = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 3))/w(q, 1)) - impulse(q, 1)
    end do
  end subroutine correct_2d_frictionless

  pure subroutine correct_3d_frictionless(pair, hot, weight, velocity, impulse, correction, w)
    integer, intent(in) :: pair(2, lanes)
    real(dp), intent(in) :: hot(lanes, 5), weight(3, *), velocity(3, *), impulse(lanes, 1)
    real(dp), intent(out) :: correction(lanes, 1), w(lanes, 1)
    integer :: q
    real(dp) :: v(lanes, 1)

    call velocity_3d_frictionless(pair, hot, velocity, v)
    call weigh_3d_frictionless(pair, hot, weight, w)
    do q = 1, lanes
      correction(q, 1) = max(0.0_dp, impulse(q, 1) - (v(q, 1) + hot(q, 4))/w(q, 1)) - impulse(q, 1)
    end do
  end subroutine correct_3d_frictionless

#include "contact_friction_blocks.inc"
#define SHIFTED
#include "contact_friction_blocks.inc"
#define ROLLING
#include "contact_friction_blocks.inc"
#undef SHIFTED
#include "contact_friction_blocks.inc"
#undef ROLLING

end module gravier_contact_kernels
