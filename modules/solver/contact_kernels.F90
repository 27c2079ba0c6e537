!> The loops over contacts, one version per dimension and per set of effects, chosen once a run.
!>
!> A contact is a column of packed arrays in sweep order:
!>   pair(1:2)     local numbers of the candidate i and the antagonist j
!>   hot           normal (nd), shift = max(gap, 0)/h, 1/W_nn, and with friction 1/W_tt, levers of i and j, mu
!>   impulse       (n[, t[, s]]) [N s], compression positive
!> and a body a column of
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

  abstract interface
    !> One Gauss-Seidel sweep: updates velocity and impulse.
    pure subroutine sweep_kernel(pair, hot, weight, velocity, impulse)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :)
    end subroutine sweep_kernel
    !> The same, keeping v at each contact as it was when its law was solved.
    pure subroutine recording_kernel(pair, hot, weight, velocity, impulse, law_velocity)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :), law_velocity(:, :)
    end subroutine recording_kernel
    !> reaction := reaction + H impulse.
    pure subroutine reaction_kernel(pair, hot, impulse, reaction)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :), impulse(:, :)
      real(dp), intent(inout), contiguous :: reaction(:, :)
    end subroutine reaction_kernel
    !> contact_velocity := H^T velocity.
    pure subroutine velocity_kernel(pair, hot, velocity, contact_velocity)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :), velocity(:, :)
      real(dp), intent(inout), contiguous :: contact_velocity(:, :)
    end subroutine velocity_kernel
    !> sums = (sum of |r - P|^2, sum of |r|^2), P being the local solve with the undivided local operator.
    pure subroutine residual_kernel(pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :), weight(:, :), velocity(:, :), impulse(:, :)
      real(dp), intent(out) :: sums(2)
    end subroutine residual_kernel
  end interface

  type :: kernels_t
    !> space dimension, degrees of freedom of a body, rows of `weight`, components of an impulse, rows of `hot`
    integer :: nd = 2, nv = 2, nw = 2, nc = 1, nh = 4
    procedure(sweep_kernel), pointer, nopass :: sweep => null()
    procedure(recording_kernel), pointer, nopass :: sweep_recording => null()
    procedure(reaction_kernel), pointer, nopass :: add_reaction => null()
    procedure(velocity_kernel), pointer, nopass :: contact_velocity => null()
    procedure(residual_kernel), pointer, nopass :: residual => null()
  contains
    procedure :: choose => kernels_choose
  end type kernels_t

contains

  !> Choose the loops for a dimension and the effects that the scene has.
  subroutine kernels_choose(self, dimension, friction, rotation)
    class(kernels_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: dimension
    !> some contact has mu > 0
    logical, intent(in) :: friction
    !> bodies carry a spin; needed with friction
    logical, intent(in) :: rotation

    self%nd = dimension
    self%nv = dimension
    if (rotation) self%nv = merge(3, 6, dimension == 2)
    self%nw = dimension + merge(1, 0, rotation)
    self%nc = merge(dimension, 1, friction)
    self%nh = dimension + merge(6, 2, friction)
    if (friction .and. dimension == 2) then
      self%sweep => sweep_2d_friction
      self%sweep_recording => sweep_2d_friction_recording
      self%add_reaction => add_reaction_2d_friction
      self%contact_velocity => contact_velocity_2d_friction
      self%residual => residual_2d_friction
    else if (friction) then
      self%sweep => sweep_3d_friction
      self%sweep_recording => sweep_3d_friction_recording
      self%add_reaction => add_reaction_3d_friction
      self%contact_velocity => contact_velocity_3d_friction
      self%residual => residual_3d_friction
    else
      if (dimension == 2) then
        self%sweep => sweep_2d_frictionless
        self%sweep_recording => sweep_2d_frictionless_recording
      else
        self%sweep => sweep_3d_frictionless
        self%sweep_recording => sweep_3d_frictionless_recording
      end if
      self%add_reaction => add_reaction_frictionless
      self%contact_velocity => contact_velocity_frictionless
      self%residual => residual_frictionless
    end if
  end subroutine kernels_choose

#define VARIANT(name) name
#define LAW
#include "contact_sweeps.inc"
#undef VARIANT
#undef LAW
#define VARIANT(name) name/**/_recording
#define LAW , law_velocity
#define RECORD
#include "contact_sweeps.inc"

  !> Unit vectors t and s that make (n, t, s) direct, from n alone (Duff et al., JCGT 6(1), 2017).
  pure subroutine tangents(n, t, s)
    real(dp), intent(in) :: n(3)
    real(dp), intent(out) :: t(3), s(3)
    real(dp) :: side, a, b

    side = sign(1.0_dp, n(3))
    a = -1.0_dp/(side + n(3))
    b = n(1)*n(2)*a
    t(1) = 1.0_dp + side*n(1)*n(1)*a
    t(2) = side*b
    t(3) = -side*n(1)
    s(1) = b
    s(2) = side + n(2)*n(2)*a
    s(3) = -n(2)
  end subroutine tangents

  !> W_nn and the translational part of W_tt of two bodies [1/kg].
  pure subroutine local_operator(n, wi, wj, wn, wt)
    !> (nd) unit normal
    real(dp), intent(in), contiguous :: n(:)
    !> (nw) columns of `weight`
    real(dp), intent(in), contiguous :: wi(:), wj(:)
    real(dp), intent(out) :: wn, wt
    real(dp) :: t(3), s(3)

    if (size(n) == 2) then
      wn = normal_2d(n, wi, wj)
      wt = tangential_2d(n, wi, wj)
    else
      call tangents(n, t, s)
      wn = normal_3d(n, wi, wj)
      wt = tangential_3d(t, s, wi, wj)
    end if
  end subroutine local_operator

  !> W_nn of disks, the sum over d of n_d^2 (w_d,i + w_d,j), written so that it is exactly w_i + w_j where components are
  !> equal; and so the next ones.
  pure real(dp) function normal_2d(n, wi, wj) result(w)
    real(dp), intent(in) :: n(2), wi(2), wj(2)
    w = wi(1) + wj(1) + n(2)**2*((wi(2) - wi(1)) + (wj(2) - wj(1)))
  end function normal_2d

  pure real(dp) function normal_3d(n, wi, wj) result(w)
    real(dp), intent(in) :: n(3), wi(3), wj(3)
    w = wi(1) + wj(1) + (n(2)**2*((wi(2) - wi(1)) + (wj(2) - wj(1))) + n(3)**2*((wi(3) - wi(1)) + (wj(3) - wj(1))))
  end function normal_3d

  pure real(dp) function tangential_2d(n, wi, wj) result(w)
    real(dp), intent(in) :: n(2), wi(2), wj(2)
    w = wi(1) + wj(1) + n(1)**2*((wi(2) - wi(1)) + (wj(2) - wj(1)))
  end function tangential_2d

  !> The largest eigenvalue of the tangential block.
  pure real(dp) function tangential_3d(t, s, wi, wj) result(w)
    real(dp), intent(in) :: t(3), s(3), wi(3), wj(3)
    real(dp) :: y, z, tt, ss, ts

    w = wi(1) + wj(1)
    ! the block less (w_1,i + w_1,j) times the identity
    y = (wi(2) - wi(1)) + (wj(2) - wj(1))
    z = (wi(3) - wi(1)) + (wj(3) - wj(1))
    if (.not. max(abs(y), abs(z)) > 0.0_dp) return
    tt = t(2)**2*y + t(3)**2*z
    ss = s(2)**2*y + s(3)**2*z
    ts = t(2)*s(2)*y + t(3)*s(3)*z
    w = w + (0.5_dp*(tt + ss) + sqrt((0.5_dp*(tt - ss))**2 + ts**2))
  end function tangential_3d

  !> The impulse of one contact on its candidate in global axes [N s].
  pure subroutine global_impulse(kernels, hot, impulse, p)
    type(kernels_t), intent(in) :: kernels
    !> columns of `hot` and `impulse`
    real(dp), intent(in), contiguous :: hot(:), impulse(:)
    !> (nd)
    real(dp), intent(out) :: p(:)
    real(dp) :: t(3), s(3)

    p(:) = impulse(1)*hot(1:kernels%nd)
    if (kernels%nc == 2) then
      p(1) = p(1) - impulse(2)*hot(2)
      p(2) = p(2) + impulse(2)*hot(1)
    else if (kernels%nc == 3) then
      call tangents(hot(1:3), t, s)
      p(:) = p + impulse(2)*t + impulse(3)*s
    end if
  end subroutine global_impulse

  !> Rows of H^T of one contact: v = candidate . V_i + antagonist . V_j.
  pure subroutine contact_jacobian(nd, nc, hot, candidate, antagonist)
    integer, intent(in) :: nd
    !> 1 without friction, nd with
    integer, intent(in) :: nc
    !> (nh) column of `hot`
    real(dp), intent(in), contiguous :: hot(:)
    !> (nc, nv)
    real(dp), intent(out) :: candidate(:, :), antagonist(:, :)
    real(dp) :: t(3), s(3)

    candidate(:, :) = 0.0_dp
    candidate(1, 1:nd) = hot(1:nd)
    antagonist(:, :) = 0.0_dp
    if (nc == 2) then
      candidate(2, 1) = -hot(2)
      candidate(2, 2) = hot(1)
      candidate(2, 3) = -hot(6)
      antagonist(2, 3) = -hot(7)
    else if (nc == 3) then
      call tangents(hot(1:3), t, s)
      candidate(2, 1:3) = t
      candidate(3, 1:3) = s
      candidate(2, 4:6) = -hot(7)*s
      candidate(3, 4:6) = hot(7)*t
      antagonist(2, 4:6) = -hot(8)*s
      antagonist(3, 4:6) = hot(8)*t
    end if
    antagonist(:, 1:nd) = -candidate(:, 1:nd)
  end subroutine contact_jacobian

  pure subroutine add_reaction_frictionless(pair, hot, impulse, reaction)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), impulse(:, :)
    real(dp), intent(inout), contiguous :: reaction(:, :)
    integer :: c, nd

    nd = size(hot, 1) - 2
    do c = 1, size(pair, 2)
      reaction(1:nd, pair(1, c)) = reaction(1:nd, pair(1, c)) + impulse(1, c)*hot(1:nd, c)
      reaction(1:nd, pair(2, c)) = reaction(1:nd, pair(2, c)) - impulse(1, c)*hot(1:nd, c)
    end do
  end subroutine add_reaction_frictionless

  pure subroutine contact_velocity_frictionless(pair, hot, velocity, contact_velocity)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), velocity(:, :)
    real(dp), intent(inout), contiguous :: contact_velocity(:, :)
    integer :: c, nd

    nd = size(hot, 1) - 2
    do c = 1, size(pair, 2)
      contact_velocity(1, c) = sum((velocity(1:nd, pair(1, c)) - velocity(1:nd, pair(2, c)))*hot(1:nd, c))
    end do
  end subroutine contact_velocity_frictionless

  pure subroutine residual_frictionless(pair, hot, weight, velocity, impulse, sums)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), weight(:, :), velocity(:, :), impulse(:, :)
    real(dp), intent(out) :: sums(2)
    integer :: c, i, j, nd
    real(dp) :: vn, wn, rn

    nd = size(hot, 1) - 2
    sums(:) = 0.0_dp
    do c = 1, size(pair, 2)
      i = pair(1, c)
      j = pair(2, c)
      vn = sum((velocity(1:nd, i) - velocity(1:nd, j))*hot(1:nd, c))
      if (nd == 2) then
        wn = normal_2d(hot(1:2, c), weight(1:2, i), weight(1:2, j))
      else
        wn = normal_3d(hot(1:3, c), weight(1:3, i), weight(1:3, j))
      end if
      rn = max(0.0_dp, impulse(1, c) - (vn + hot(nd + 1, c))/wn)
      sums(1) = sums(1) + (rn - impulse(1, c))**2
      sums(2) = sums(2) + impulse(1, c)**2
    end do
  end subroutine residual_frictionless

  pure subroutine add_reaction_2d_friction(pair, hot, impulse, reaction)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), impulse(:, :)
    real(dp), intent(inout), contiguous :: reaction(:, :)
    integer :: c, i, j
    real(dp) :: px, py

    do c = 1, size(pair, 2)
      i = pair(1, c)
      j = pair(2, c)
      px = impulse(1, c)*hot(1, c) - impulse(2, c)*hot(2, c)
      py = impulse(1, c)*hot(2, c) + impulse(2, c)*hot(1, c)
      reaction(1, i) = reaction(1, i) + px
      reaction(2, i) = reaction(2, i) + py
      reaction(3, i) = reaction(3, i) - hot(6, c)*impulse(2, c)
      reaction(1, j) = reaction(1, j) - px
      reaction(2, j) = reaction(2, j) - py
      reaction(3, j) = reaction(3, j) - hot(7, c)*impulse(2, c)
    end do
  end subroutine add_reaction_2d_friction

  pure subroutine contact_velocity_2d_friction(pair, hot, velocity, contact_velocity)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), velocity(:, :)
    real(dp), intent(inout), contiguous :: contact_velocity(:, :)
    integer :: c

    do c = 1, size(pair, 2)
      call velocity_2d(hot(:, c), velocity(:, pair(1, c)), velocity(:, pair(2, c)), contact_velocity(1, c), contact_velocity(2, c))
    end do
  end subroutine contact_velocity_2d_friction

  !> Normal and tangential velocity at a contact of disks.
  pure subroutine velocity_2d(hot, vi, vj, vn, vt)
    real(dp), intent(in), contiguous :: hot(:), vi(:), vj(:)
    real(dp), intent(out) :: vn, vt
    real(dp) :: dx, dy

    dx = vi(1) - vj(1)
    dy = vi(2) - vj(2)
    vn = dx*hot(1) + dy*hot(2)
    vt = dy*hot(1) - dx*hot(2) - hot(6)*vi(3) - hot(7)*vj(3)
  end subroutine velocity_2d

  pure subroutine residual_2d_friction(pair, hot, weight, velocity, impulse, sums)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), weight(:, :), velocity(:, :), impulse(:, :)
    real(dp), intent(out) :: sums(2)
    integer :: c, i, j
    real(dp) :: vn, vt, wn, wt, rn, rt

    sums(:) = 0.0_dp
    do c = 1, size(pair, 2)
      i = pair(1, c)
      j = pair(2, c)
      call velocity_2d(hot(:, c), velocity(:, i), velocity(:, j), vn, vt)
      wn = normal_2d(hot(1:2, c), weight(1:2, i), weight(1:2, j))
      wt = tangential_2d(hot(1:2, c), weight(1:2, i), weight(1:2, j))
      wt = wt + weight(3, i)*hot(6, c)**2 + weight(3, j)*hot(7, c)**2
      rn = max(0.0_dp, impulse(1, c) - (vn + hot(3, c))/wn)
      rt = max(-hot(8, c)*rn, min(hot(8, c)*rn, impulse(2, c) - vt/wt))
      sums(1) = sums(1) + (rn - impulse(1, c))**2 + (rt - impulse(2, c))**2
      sums(2) = sums(2) + impulse(1, c)**2 + impulse(2, c)**2
    end do
  end subroutine residual_2d_friction

  pure subroutine add_reaction_3d_friction(pair, hot, impulse, reaction)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), impulse(:, :)
    real(dp), intent(inout), contiguous :: reaction(:, :)
    integer :: c, i, j
    real(dp) :: t(3), s(3), p(3), turn(3)

    do c = 1, size(pair, 2)
      i = pair(1, c)
      j = pair(2, c)
      call tangents(hot(1:3, c), t, s)
      p(:) = impulse(1, c)*hot(1:3, c) + impulse(2, c)*t + impulse(3, c)*s
      turn(:) = impulse(2, c)*s - impulse(3, c)*t
      reaction(1:3, i) = reaction(1:3, i) + p
      reaction(4:6, i) = reaction(4:6, i) - hot(7, c)*turn
      reaction(1:3, j) = reaction(1:3, j) - p
      reaction(4:6, j) = reaction(4:6, j) - hot(8, c)*turn
    end do
  end subroutine add_reaction_3d_friction

  pure subroutine contact_velocity_3d_friction(pair, hot, velocity, contact_velocity)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), velocity(:, :)
    real(dp), intent(inout), contiguous :: contact_velocity(:, :)
    real(dp) :: t(3), s(3)
    integer :: c

    do c = 1, size(pair, 2)
      call tangents(hot(1:3, c), t, s)
      call velocity_3d(hot(:, c), t, s, velocity(:, pair(1, c)), velocity(:, pair(2, c)), contact_velocity(:, c))
    end do
  end subroutine contact_velocity_3d_friction

  !> Velocity (n, t, s) at a contact of spheres.
  pure subroutine velocity_3d(hot, t, s, vi, vj, v)
    real(dp), intent(in), contiguous :: hot(:), vi(:), vj(:)
    real(dp), intent(in) :: t(3), s(3)
    real(dp), intent(out) :: v(3)
    real(dp) :: dv(3), spin(3)

    dv(:) = vi(1:3) - vj(1:3)
    spin(:) = hot(7)*vi(4:6) + hot(8)*vj(4:6)
    v(1) = sum(dv*hot(1:3))
    v(2) = sum(dv*t) - sum(spin*s)
    v(3) = sum(dv*s) + sum(spin*t)
  end subroutine velocity_3d

  pure subroutine residual_3d_friction(pair, hot, weight, velocity, impulse, sums)
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :), weight(:, :), velocity(:, :), impulse(:, :)
    real(dp), intent(out) :: sums(2)
    integer :: c, i, j
    real(dp) :: t(3), s(3), v(3), wn, wt, rn, rt(2), length, bound

    sums(:) = 0.0_dp
    do c = 1, size(pair, 2)
      i = pair(1, c)
      j = pair(2, c)
      call tangents(hot(1:3, c), t, s)
      call velocity_3d(hot(:, c), t, s, velocity(:, i), velocity(:, j), v)
      wn = normal_3d(hot(1:3, c), weight(1:3, i), weight(1:3, j))
      wt = tangential_3d(t, s, weight(1:3, i), weight(1:3, j))
      wt = wt + weight(4, i)*hot(7, c)**2 + weight(4, j)*hot(8, c)**2
      rn = max(0.0_dp, impulse(1, c) - (v(1) + hot(4, c))/wn)
      rt(:) = impulse(2:3, c) - v(2:3)/wt
      bound = hot(9, c)*rn
      length = norm2(rt)
      if (length > bound) rt(:) = rt*(bound/length)
      sums(1) = sums(1) + (rn - impulse(1, c))**2 + sum((rt - impulse(2:3, c))**2)
      sums(2) = sums(2) + sum(impulse(:, c)**2)
    end do
  end subroutine residual_3d_friction

end module gravier_contact_kernels
