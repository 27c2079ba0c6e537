!> Bodies that go past each other. A contact that is open lets its bodies come no nearer than its gap along its normal, which stands
!> still for the step. Where two corners or edges go past each other, as those of bricks that slide over a joint, the normal turns
!> on the way, and bodies that would not have met are stopped. Their gap is made so large here that the velocity which they have is
!> free.
module gravier_clear_path
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross, make_rotation, rotate
  use gravier_convex_piece, only: convex_piece_t
  use gravier_manifold, only: manifold_t
  use gravier_seen_body, only: seen_body_t
  use gravier_piece_meeting, only: room_t, nearest_t, find_nearest_points
  implicit none
  private
  public :: clear_path

  !> angle by which the normal has to turn for a path to be looked at [rad]
  real(dp), parameter :: turned = 0.02_dp
  !> overlap on the way that is none, over the roundings of both pieces, and over the radii of both bodies where that is less
  real(dp), parameter :: touching = 0.1_dp, small = 1.0e-4_dp
  !> halvings of the path: a way of a thousand roundings is known to `touching` then
  integer, parameter :: halvings = 16

  !> Two pieces at a time of their path.
  type :: instant_t
    !> [s]; gap [m], and the rate at which it changes [m/s]
    real(dp) :: time = 0.0_dp, gap = 0.0_dp, rate = 0.0_dp
    real(dp) :: normal(3) = 0.0_dp
  end type instant_t

contains

  !> Widen the gaps of two pieces that close in the step but do not meet on their way with the velocities that they have.
  subroutine clear_path(piece_a, piece_b, h, a, b, room, manifold)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    !> [s]
    real(dp), intent(in) :: h
    !> candidate, at the origin, and antagonist
    type(seen_body_t), intent(in) :: a, b
    type(room_t), intent(inout) :: room
    type(manifold_t), intent(inout) :: manifold
    type(instant_t) :: ends(2)
    real(dp) :: rate(manifold%n), v(3), reach, least, gap, slip
    integer :: c
    logical :: closes

    if (manifold%n == 0) return
    reach = a%radius*piece_a%rounding + b%radius*piece_b%rounding
    least = min(touching*reach, small*(a%radius + b%radius))
    gap = minval(manifold%gap(1:manifold%n))
    if (manifold%cores_overlap .or. .not. gap > -least) return
    closes = .false.
    slip = 0.0_dp
    do c = 1, manifold%n
      call relative_velocity(a, b, manifold%point(:, c), v)
      rate(c) = dot_product(v, manifold%normal)
      slip = max(slip, norm2(v))
      closes = closes .or. manifold%gap(c) + h*rate(c) < 0.0_dp
    end do
    if (.not. closes) return
    ! the normal turns with the spins, and by the slip over the distance of the cores at most
    slip = slip/max(reach + gap, tiny(1.0_dp))
    if (h*(slip + norm2(a%spin) + norm2(b%spin)) < turned) return
    ends(1) = instant_t(0.0_dp, gap, minval(rate), manifold%normal)
    call look(piece_a, piece_b, h, a, b, room, ends(2))
    if (ends(2)%gap < -least) return
    if (.not. dot_product(ends(1)%normal, ends(2)%normal) < cos(turned)) return
    if (.not. is_clear(piece_a, piece_b, a, b, least, room, ends)) return
    do c = 1, manifold%n
      manifold%gap(c) = max(manifold%gap(c), -h*rate(c))
    end do
  end subroutine clear_path

  !> Whether the gap stays above minus `least` between two instants. Along a straight way it is a convex function of time, so that
  !> two tangents bound it from below.
  logical function is_clear(piece_a, piece_b, a, b, least, room, ends) result(clear)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    !> [m]
    real(dp), intent(in) :: least
    type(room_t), intent(inout) :: room
    type(instant_t), intent(in) :: ends(2)
    type(instant_t) :: low, high, middle
    integer :: n

    low = ends(1)
    high = ends(2)
    clear = .false.
    do n = 1, halvings
      if (high%gap < -least) return
      clear = .not. high%rate > low%rate .or. high%rate <= 0.0_dp .or. low%rate >= 0.0_dp
      if (.not. clear) clear = low%gap + low%rate*meeting_time(low, high) >= -least
      if (clear) return
      call look(piece_a, piece_b, 0.5_dp*(low%time + high%time), a, b, room, middle)
      if (middle%gap < -least) return
      if (middle%rate < 0.0_dp) then
        low = middle
      else
        high = middle
      end if
    end do
  end function is_clear

  !> From the first of two instants to where their tangents cross [s].
  pure real(dp) function meeting_time(low, high) result(time)
    type(instant_t), intent(in) :: low, high
    time = (high%gap - low%gap - high%rate*(high%time - low%time))/(low%rate - high%rate)
  end function meeting_time

  !> Two pieces after some time on their way. The gap is far below 0 where their cores overlap.
  subroutine look(piece_a, piece_b, time, a, b, room, instant)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    !> [s]
    real(dp), intent(in) :: time
    type(seen_body_t), intent(in) :: a, b
    type(room_t), intent(inout) :: room
    type(instant_t), intent(out) :: instant
    type(seen_body_t) :: moved_a, moved_b
    type(nearest_t) :: near
    real(dp) :: v(3)

    moved_a = a
    moved_b = b
    call move(time, moved_a)
    call move(time, moved_b)
    moved_b%centre(:) = moved_b%centre - moved_a%centre
    moved_a%centre(:) = 0.0_dp
    call find_nearest_points(piece_a, piece_b, moved_a, moved_b, room, near)
    instant%time = time
    instant%gap = -huge(1.0_dp)
    if (near%overlap) return
    instant%normal(:) = near%normal
    instant%gap = near%gap
    call relative_velocity(moved_a, moved_b, near%point, v)
    instant%rate = dot_product(v, near%normal)
  end subroutine look

  !> Move a body with its velocity and its spin.
  pure subroutine move(time, body)
    real(dp), intent(in) :: time
    type(seen_body_t), intent(inout) :: body
    real(dp) :: turn(3, 3), angle(3)
    integer :: d

    body%centre(:) = body%centre + time*body%velocity
    body%angle = body%angle + time*body%spin(3)
    angle(:) = time*body%spin
    call make_rotation(angle, turn)
    do d = 1, 3
      call rotate(turn, body%axes(:, d))
    end do
  end subroutine move

  !> Velocity of body a against body b at a point, seen from the centre of a [m/s].
  pure subroutine relative_velocity(a, b, point, v)
    type(seen_body_t), intent(in) :: a, b
    !> [m]
    real(dp), intent(in) :: point(3)
    real(dp), intent(out) :: v(3)
    real(dp) :: arm(3), turning(3)

    turning(:) = cross(a%spin, point)
    v(:) = a%velocity - b%velocity + turning
    arm(:) = point - b%centre
    turning(:) = cross(b%spin, arm)
    v(:) = v - turning
  end subroutine relative_velocity

end module gravier_clear_path
