!> What keeps bonded bodies together while they turn as one. A step moves places straight on, so that bonds whose velocities were 0
!> would let their bodies part by h w/2 of their distance for each radian. A body whose centre is at r from the axis of a rotation
!> with the spin w stays on its circle if it has, at the end of the step, the velocity
!>
!>     w x r + D(w) r,   D(w) r = T (w x (w x r) - T w^2 w x r)/(1 + T^2 w^2),   T = h/2,
!>
!> with the r of q_m. This is the Cayley transform: exact for theta = 1/2, of second order in h w for any other. A bond has the
!> difference of D(w) r of its two bodies as its velocity. Bodies that turn as one have one w, so that bonds around a ring do not
!> contradict each other. Orientations, and boundaries with all that is glued to them, turn exactly by themselves.
module gravier_bond_turning
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_boundary, only: boundary_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  use gravier_surface_velocity, only: contact_place_t, add_image_velocity, boundary_that_has
  implicit none
  private
  public :: find_bond_velocity, find_spin, find_branch

  !> way in a step, over the radius of the candidate, that is not worth a velocity: that of disks which turn by 1e-4 rad. Bonds of
  !> bodies at rest, which solves leave some velocity, have none then, and rest stays possible for them.
  real(dp), parameter :: negligible = 1.0e-8_dp

contains

  !> The velocity of an intact bond at the end of a step, candidate less antagonist.
  pure subroutine find_bond_velocity(view, boundaries, physics, p, place, velocity, common)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    !> place of the pair in the list of near pairs
    integer, intent(in) :: p
    !> where the bodies are joined: both arms lead to one point
    type(contact_place_t), intent(in) :: place
    !> (nd) [m/s]
    real(dp), intent(out) :: velocity(:)
    !> spin with which both bodies turn as one, where it is known [rad/s]
    real(dp), intent(in), optional :: common(3)
    real(dp) :: t, spin(3), arm(3), part(3), change(3)
    integer :: i, j, nd

    nd = size(velocity)
    call view%find_ends(p, i, j)
    t = 0.5_dp*physics%h
    if (present(common)) then
      arm(:) = place%arm_j - place%arm_i
      call find_circling(common, arm, t, change)
    else if (size(view%bodies%orientation, 1) > 0) then
      ! bodies with shapes: each turns about its centre, as its arm does
      call find_spin(view, boundaries, j, spin)
      call find_circling(spin, place%arm_j, t, change)
      call find_spin(view, boundaries, i, spin)
      call find_circling(spin, place%arm_i, t, part)
      change(:) = change - part
    else
      ! disks and spheres, which may roll on each other: the line between their centres turns, or that to the boundary with it
      if (j > 0) then
        call find_spin_of_branch(view, boundaries, physics, p, place, spin)
      else
        call find_spin(view, boundaries, j, spin)
      end if
      arm(:) = place%arm_j - place%arm_i
      call find_circling(spin, arm, t, change)
    end if
    call find_lacking(view, boundaries, j, place, t, part)
    change(:) = change + part
    call find_lacking(view, boundaries, i, place, t, part)
    change(:) = change - part
    if (norm2(change)*physics%h <= negligible*view%bodies%radius(i)) change(:) = 0.0_dp
    velocity(:) = change(1:nd)
  end subroutine find_bond_velocity

  !> D(w) r of the head of this module [m/s].
  pure subroutine find_circling(spin, arm, t, change)
    !> w [rad/s], r [m], T [s]
    real(dp), intent(in) :: spin(3), arm(3), t
    real(dp), intent(out) :: change(3)
    real(dp) :: turning(3)

    turning(:) = cross(spin, arm)
    call bend(spin, turning, t, change)
  end subroutine find_circling

  !> D(w) r from w x r.
  pure subroutine bend(spin, turning, t, change)
    real(dp), intent(in) :: spin(3), turning(3), t
    real(dp), intent(out) :: change(3)
    real(dp) :: square

    square = t*sum(spin**2)
    change(:) = cross(spin, turning)
    change(:) = t*(change - square*turning)/(1.0_dp + t*square)
  end subroutine bend

  !> D(w) r that the velocity of body `k` lacks because it is part of a turning boundary: at its centre or, of the boundary itself,
  !> at the contact; 0 of a free body [m/s].
  pure subroutine find_lacking(view, boundaries, k, place, t, change)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    type(contact_place_t), intent(in) :: place
    real(dp), intent(in) :: t
    real(dp), intent(out) :: change(3)
    real(dp) :: turning(3), spin(3)
    integer :: b, nd

    nd = view%bodies%nd
    change(:) = 0.0_dp
    b = boundary_that_has(view, k)
    if (b == 0) return
    turning(:) = 0.0_dp
    if (k > 0) then
      call boundaries(b)%last_velocity_at(view%bodies%position(:, k), turning(1:nd))
    else
      call boundaries(b)%last_velocity_at(place%on_wall(1:nd), turning(1:nd))
    end if
    turning(1:nd) = turning(1:nd) - boundaries(b)%last_velocity(1:nd)
    spin(:) = boundaries(b)%last_spin
    call bend(spin, turning, t, change)
  end subroutine find_lacking

  !> Spin of body `k` at the start of the step; what is part of a boundary turns with it [rad/s].
  pure subroutine find_spin(view, boundaries, k, spin)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    real(dp), intent(out) :: spin(3)
    integer :: b

    b = boundary_that_has(view, k)
    spin(:) = 0.0_dp
    if (b > 0) then
      spin(:) = boundaries(b)%last_spin
    else if (view%bodies%nd == 2) then
      spin(3) = view%bodies%velocity(3, k)
    else
      spin(:) = view%bodies%velocity(4:6, k)
    end if
  end subroutine find_spin

  !> Spin of the line between the centres of two disks or spheres at the start of the step, which may roll on each other: about
  !> itself it turns with the mean of their spins [rad/s].
  pure subroutine find_spin_of_branch(view, boundaries, physics, p, place, spin)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: p
    type(contact_place_t), intent(in) :: place
    real(dp), intent(out) :: spin(3)
    real(dp) :: v(3), axis(3), spins(3, 2), length
    integer :: i, j

    call view%find_ends(p, i, j)
    call find_spin(view, boundaries, i, spins(:, 1))
    call find_spin(view, boundaries, j, spins(:, 2))
    call find_branch(view, physics, p, place, axis, v)
    length = max(norm2(axis), tiny(1.0_dp))
    axis(:) = axis/length
    v(:) = v/length
    spin(:) = cross(axis, v)
    spin(:) = spin + 0.5_dp*(sum(axis*spins(:, 1)) + sum(axis*spins(:, 2)))*axis
  end subroutine find_spin_of_branch

  !> The branch of two grains at the start of the step, from the antagonist to the candidate [m], and its velocity [m/s].
  pure subroutine find_branch(view, physics, p, place, branch, v)
    type(local_bodies_t), intent(in) :: view
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: p
    type(contact_place_t), intent(in) :: place
    real(dp), intent(out) :: branch(3), v(3)
    real(dp) :: other(3)
    integer :: i, j, nd

    nd = view%bodies%nd
    v(:) = 0.0_dp
    other(:) = 0.0_dp
    call view%find_ends(p, i, j)
    v(1:nd) = view%bodies%velocity(1:nd, i)
    other(1:nd) = view%bodies%velocity(1:nd, j)
    call add_image_velocity(view, p, other(1:nd))
    v(:) = v - other
    branch(:) = place%arm_j - place%arm_i - (1.0_dp - physics%theta)*physics%h*v
  end subroutine find_branch

end module gravier_bond_turning
