!> Contacts of two edges that are nearly parallel.
module gravier_edge_patch
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_contact_feature, only: feature_t, frame_t, lay_out_feature, edge_number
  use gravier_contact_patch, only: patch_point_t, add_point
  use gravier_manifold, only: feature_base
  implicit none
  private
  public :: add_edge_points

  !> edges that cross at a greater angle touch in one point; its sine
  real(dp), parameter :: most_sine = 0.2_dp
  !> ends of edges this near, in parts of the size of the pair, are at one place
  real(dp), parameter :: equal = 1.0e-5_dp

contains

  !> Both ends of the stretch where the edges lie side by side, with the gaps that they have there. No point where edges cross at a
  !> large angle or lie one behind the other.
  pure subroutine add_edge_points(a, b, feature_a, feature_b, frame, n, point)
    type(convex_piece_t), intent(in) :: a, b
    !> edges
    type(feature_t), intent(in) :: feature_a, feature_b
    type(frame_t), intent(in) :: frame
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    real(dp) :: x(3, 2), y(3, 2), along(2), s(2), t(2), ends(2), room, sense
    integer :: v(2), w(2), k, p, q, key

    call lay_out_feature(a, feature_a, frame, k, v, x)
    call lay_out_feature(b, feature_b, frame, k, w, y)
    call find_common_line(x, y, along)
    if (.not. dot_product(along, along) > 0.0_dp) return
    do k = 1, 2
      s(k) = dot_product(x(1:2, k), along)
      t(k) = dot_product(y(1:2, k), along)
    end do
    ends(1) = max(minval(s), minval(t))
    ends(2) = min(maxval(s), maxval(t))
    room = equal*min(feature_a%at%radius, feature_b%at%radius)
    if (ends(2) - ends(1) <= room) return
    do k = 1, 2
      sense = 2*k - 3
      ! the end of a bounds the stretch unless that of b does so clearly
      p = merge(1, 2, sense*s(1) > sense*s(2))
      q = merge(1, 2, sense*t(1) > sense*t(2))
      if (sense*s(p) <= sense*t(q) + room) then
        key = (v(p) - 1)*feature_base + edge_number(b, w(1), w(2))
      else
        key = edge_number(a, v(1), v(2))*feature_base + w(q) - 1
      end if
      call add_point(point_at(ends(k), key), frame%alert, min(feature_a%at%radius, feature_b%at%radius), n, point)
    end do

  contains

    !> The point at a place along the common line.
    pure function point_at(place, key) result(new)
      real(dp), intent(in) :: place
      integer, intent(in) :: key
      real(dp) :: on_a(3), on_b(3), way(3), reach_a, reach_b
      type(patch_point_t) :: new

      on_a(:) = x(:, 1) + (place - s(1))/(s(2) - s(1))*(x(:, 2) - x(:, 1))
      on_b(:) = y(:, 1) + (place - t(1))/(t(2) - t(1))*(y(:, 2) - y(:, 1))
      way(:) = on_a - on_b
      reach_a = feature_a%at%radius*a%rounding
      reach_b = feature_b%at%radius*b%rounding
      ! what of the way is along the normal may be below 0: by blending, or where cores overlap
      new%gap = sqrt(way(1)**2 + way(2)**2 + max(way(3), 0.0_dp)**2) + min(way(3), 0.0_dp) - reach_a - reach_b
      new%place(:) = 0.5_dp*(on_a + on_b)
      new%place(3) = new%place(3) + 0.5_dp*(reach_b - reach_a)
      new%key = key
    end function point_at

  end subroutine add_edge_points

  !> The direction half-way between those of two edges, 0 where they cross at a large angle.
  pure subroutine find_common_line(x, y, along)
    real(dp), intent(in) :: x(3, 2), y(3, 2)
    real(dp), intent(out) :: along(2)
    real(dp) :: u(2), v(2), length

    along(:) = 0.0_dp
    u(:) = x(1:2, 2) - x(1:2, 1)
    v(:) = y(1:2, 2) - y(1:2, 1)
    length = norm2(u)
    if (.not. length > 0.0_dp) return
    u(:) = u/length
    length = norm2(v)
    if (.not. length > 0.0_dp) return
    v(:) = v/length
    if (abs(u(1)*v(2) - u(2)*v(1)) >= most_sine) return
    along(:) = u + sign(1.0_dp, dot_product(u, v))*v
    along(:) = along/norm2(along)
  end subroutine find_common_line

end module gravier_edge_patch
