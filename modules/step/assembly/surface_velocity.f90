!> Velocities at the start of a step of what takes part in a pair: grains, boundaries and grains that are part of one.
!>
!> A body is a grain of a view, by its number there, or a boundary, by its negative number. Grains glued to a boundary move with it.
module gravier_surface_velocity
  use gravier_kinds, only: dp
  use gravier_periodic, only: shift_of_code
  use gravier_rotation, only: cross
  use gravier_boundary, only: boundary_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: contact_place_t, round_place, find_start_velocity, find_surface_velocity, find_wall_point, &
    & add_image_velocity, boundary_that_has, add_travel, round_normal_velocity

  !> part of a velocity that counts as its rounding
  real(dp), parameter :: rounded = 1.0e-12_dp

  !> Where two bodies touch.
  type :: contact_place_t
    !> from the centre of the candidate, and of an antagonist that is a grain, to the contact [m]
    real(dp) :: arm_i(3) = 0.0_dp, arm_j(3) = 0.0_dp
    !> where an antagonist that is a boundary is touched: on its surface by disks and spheres, at the end of the arm by bodies with
    !> shapes [m]
    real(dp) :: on_wall(3) = 0.0_dp
  end type contact_place_t

contains

  !> Where the disks or spheres of pair `p` touch, or one of them a boundary: on their surfaces, across the gap. Both arms of bodies
  !> that are joined lead to one point, in the middle of the gap or on the boundary.
  pure type(contact_place_t) function round_place(view, p, gap, normal, joined) result(place)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    !> [m]
    real(dp), intent(in) :: gap
    !> (nd) from the antagonist to the candidate
    real(dp), intent(in) :: normal(:)
    logical, intent(in) :: joined
    real(dp) :: reach
    integer :: i, j, nd

    nd = size(normal)
    call view%find_ends(p, i, j)
    reach = merge(merge(0.5_dp, 1.0_dp, j > 0)*gap, 0.0_dp, joined)
    place%arm_i(1:nd) = -(view%bodies%radius(i) + reach)*normal
    if (j > 0) then
      place%arm_j(1:nd) = (view%bodies%radius(j) + reach)*normal
    else
      call find_wall_point(view, i, gap, normal, place%on_wall(1:nd))
    end if
  end function round_place

  !> Velocity of body `k`: of a free grain, translation and spin; of a boundary, the velocity of its material at a point, as a
  !> translation without spin.
  pure subroutine find_start_velocity(view, boundaries, k, point, v)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    !> (nd) where a boundary is touched, which a free grain does not read [m]
    real(dp), intent(in) :: point(:)
    !> (nd to the components that a body has) [m/s, rad/s]
    real(dp), intent(out) :: v(:)
    integer :: b

    b = boundary_that_has(view, k)
    if (b == 0) then
      v(:) = view%bodies%velocity(1:size(v), k)
    else
      v(:) = 0.0_dp
      call boundaries(b)%last_velocity_at(point, v(1:size(point)))
    end if
  end subroutine find_start_velocity

  !> Velocity along the normal of the disks or spheres of pair `p`, or of one and a boundary, at the start of a step [m/s]. Spins of
  !> free grains have no part in it, nor does it matter where along the normal a boundary is touched.
  pure real(dp) function round_normal_velocity(view, boundaries, p, normal) result(velocity)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: p
    !> (nd) from the antagonist to the candidate
    real(dp), intent(in) :: normal(:)
    real(dp) :: v(size(normal)), w(size(normal))
    integer :: i, j

    call view%find_ends(p, i, j)
    call find_start_velocity(view, boundaries, i, view%bodies%position(:, i), v)
    call find_start_velocity(view, boundaries, j, view%bodies%position(:, merge(j, i, j > 0)), w)
    if (j > 0) call add_image_velocity(view, p, w)
    velocity = sum((v - w)*normal)
  end function round_normal_velocity

  !> Add to the velocity of a turning boundary at a contact what it changes by while the contact travels as the centre of the body
  !> does: with the boundary along the normal, with the body across it. A body goes on from one place of contact to that of the next
  !> step with the velocity of the end of a step. With that of the boundary at the first place, what sticks to a turntable would
  !> leave its circle by pi w h of the radius in each turn. The normal is that of the contact, and the velocity along it stays.
  pure subroutine add_travel(body, carried, pivot, spin, normal, time, velocity)
    !> velocities of the body, of the boundary at the centre of the body, and of its pivot (nd) [m/s]
    real(dp), intent(in) :: body(:), carried(:), pivot(:)
    !> of the boundary [rad/s]
    real(dp), intent(in) :: spin(3)
    !> of the contact (nd)
    real(dp), intent(in) :: normal(:)
    !> for which the contact travels [s]
    real(dp), intent(in) :: time
    !> (nd) [m/s]
    real(dp), intent(inout) :: velocity(:)
    real(dp) :: way(3), change(3), whole
    integer :: nd

    nd = size(velocity)
    way(:) = 0.0_dp
    way(1:nd) = time*(body - pivot + sum((carried - body)*normal)*normal)
    change(:) = cross(spin, way)
    whole = norm2(change)
    change(1:nd) = change(1:nd) - sum(change(1:nd)*normal)*normal
    ! in a drum that turns about its axis the change lies along the normal, but for rounding
    if (norm2(change(1:nd)) > rounded*whole) velocity(:) = velocity + change(1:nd)
  end subroutine add_travel

  !> The boundary that body `k` is, or is glued to; 0 of a free grain.
  pure integer function boundary_that_has(view, k) result(b)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: k

    b = -k
    if (k > 0) b = view%bodies%glued(k)
  end function boundary_that_has

  !> Velocity of grain `k` at the point of its surface that `arm` leads to from its centre.
  pure subroutine find_surface_velocity(view, boundaries, k, arm, v)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    !> (nd) [m]
    real(dp), intent(in) :: arm(:)
    !> (nd) [m/s]
    real(dp), intent(out) :: v(:)
    real(dp) :: point(size(arm))
    integer :: nd

    nd = size(arm)
    point(:) = view%bodies%position(:, k) + arm
    call find_start_velocity(view, boundaries, k, point, v)
    if (view%bodies%glued(k) > 0) return
    associate (spin => view%bodies%velocity(nd + 1:, k))
      if (size(spin) == 1) then
        v(1) = v(1) - spin(1)*arm(2)
        v(2) = v(2) + spin(1)*arm(1)
      else if (size(spin) == 3) then
        v(1) = v(1) + spin(2)*arm(3) - spin(3)*arm(2)
        v(2) = v(2) + spin(3)*arm(1) - spin(1)*arm(3)
        v(3) = v(3) + spin(1)*arm(2) - spin(2)*arm(1)
      end if
    end associate
  end subroutine find_surface_velocity

  !> Add to the velocity of the antagonist of pair `p` that of the image which the candidate meets, in a cell that moves.
  pure subroutine add_image_velocity(view, p, v)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    !> (nd) [m/s]
    real(dp), intent(inout) :: v(:)
    integer :: shift(3)

    if (.not. view%period%moves) return
    shift(:) = shift_of_code(view%list%shift(p))
    call view%period%add_velocity(shift, v)
  end subroutine add_image_velocity

  !> Point of the surface of a boundary that grain `i` is nearest to.
  pure subroutine find_wall_point(view, i, gap, normal, point)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: i
    !> [m]
    real(dp), intent(in) :: gap
    !> (nd) from the boundary to the grain
    real(dp), intent(in) :: normal(:)
    !> (nd) [m]
    real(dp), intent(out) :: point(:)
    point(:) = view%bodies%position(:, i) - (view%bodies%radius(i) + gap)*normal
  end subroutine find_wall_point

end module gravier_surface_velocity
