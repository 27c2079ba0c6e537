!> The local operator of a contact, W = H^T M^-1 H.
module gravier_contact_operator
  use gravier_kinds, only: dp
  use gravier_body_mass, only: inverse_product
  use gravier_contact_kernels, only: kernels_t, local_operator, contact_jacobian, lane_of, block_of
  implicit none
  private
  public :: find_local_operator, rolling_operator

contains

  !> W_nn and W_tt of contact `c` [1/kg], see gravier_contact_kernels; W_tt = W_nn without friction.
  pure subroutine find_local_operator(kernels, pair, hot, c, weight, w)
    type(kernels_t), intent(in) :: kernels
    !> (2, lanes*blocks), (lanes, nh, blocks): see gravier_contact_kernels
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    !> (nw, n_columns)
    real(dp), intent(in), contiguous :: weight(:, :)
    real(dp), intent(out) :: w(2)
    real(dp) :: normal(kernels%nd)
    integer :: nd, i, j, q, g

    if (kernels%has_shapes()) then
      call operator_between_shapes(kernels, pair, hot, c, weight, w)
      return
    end if
    nd = kernels%nd
    i = pair(1, c)
    j = pair(2, c)
    q = lane_of(c)
    g = block_of(c)
    normal(:) = hot(q, 1:nd, g)
    call local_operator(normal, weight(:, i), weight(:, j), w(1), w(2))
    if (kernels%nf > 1) then
      w(2) = w(2) + hot(q, kernels%row%lever_i, g)**2*weight(nd + 1, i) &
        & + hot(q, kernels%row%lever_j, g)**2*weight(nd + 1, j)
    else
      w(2) = w(1)
    end if
  end subroutine find_local_operator

  !> W_rr of contact `c` of kernels with rolling [1/kg]: its relative spin times R*, for a moment of R* about any axis; 0
  !> where neither body turns.
  pure real(dp) function rolling_operator(kernels, pair, hot, c, weight) result(w)
    type(kernels_t), intent(in) :: kernels
    !> (2, lanes*blocks), (lanes, nh, blocks): see gravier_contact_kernels
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    !> (nw, n_columns)
    real(dp), intent(in), contiguous :: weight(:, :)
    integer :: turning

    turning = kernels%nd + 1
    w = hot(lane_of(c), kernels%row%rolling_radius, block_of(c))**2*(weight(turning, pair(1, c)) + weight(turning, pair(2, c)))
  end function rolling_operator

  !> `find_local_operator` between bodies with shapes, by the rows of H^T, of which W = H^T M^-1 H is made; W_tt is the largest
  !> eigenvalue of its tangential block.
  pure subroutine operator_between_shapes(kernels, pair, hot, c, weight, w)
    type(kernels_t), intent(in) :: kernels
    !> (2, lanes*blocks), (lanes, nh, blocks): see gravier_contact_kernels
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(in), contiguous :: hot(:, :, :)
    integer, intent(in) :: c
    !> (nw, n_columns)
    real(dp), intent(in), contiguous :: weight(:, :)
    real(dp), intent(out) :: w(2)
    real(dp) :: jacobian(kernels%nc, kernels%nv, 2), entry(3, 3), a(kernels%nv), b(kernels%nv)
    integer :: k, l, body

    call contact_jacobian(kernels, hot, c, jacobian(:, :, 1), jacobian(:, :, 2))
    entry(:, :) = 0.0_dp
    do body = 1, 2
      do l = 1, kernels%nc
        a(:) = jacobian(l, :, body)
        do k = 1, l
          b(:) = jacobian(k, :, body)
          entry(k, l) = entry(k, l) + inverse_product(weight(:, pair(body, c)), a, b)
        end do
      end do
    end do
    w(1) = entry(1, 1)
    w(2) = entry(2, 2)
    if (kernels%nc == 3) w(2) = 0.5_dp*(entry(2, 2) + entry(3, 3)) + sqrt((0.5_dp*(entry(2, 2) - entry(3, 3)))**2 &
      & + entry(2, 3)**2)
  end subroutine operator_between_shapes

end module gravier_contact_operator
