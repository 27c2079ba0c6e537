!> The branch of a contact, whose product with the impulse is what the contact gives to a mean stress.
module gravier_contact_branch
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: kernels_t, contact_arms, lane_of, block_of
  use gravier_subproblem, only: subproblem_t
  implicit none
  private
  public :: find_branch

contains

  !> The branch of contact `c`, that part of it which lies outside boundaries, from the antagonist to the candidate [m]. Of disks
  !> and spheres it is along the normal. Arms end in the middle of the gap, and branches on the surface of a boundary.
  pure subroutine find_branch(kernels, sub, c, branch)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd)
    real(dp), intent(out) :: branch(:)
    real(dp) :: arm_i(kernels%nd), arm_j(kernels%nd), length
    integer :: k

    if (kernels%has_shapes()) then
      call contact_arms(kernels, sub%hot, c, arm_i, arm_j)
      branch(:) = arm_j - arm_i
      if (maxval(sub%pair(:, c)) > sub%n_grains) &
        & branch(:) = branch + 0.5_dp*sub%gap(c)*sub%hot(lane_of(c), 1:kernels%nd, block_of(c))
      return
    end if
    length = sub%gap(c)
    do k = 1, 2
      if (sub%pair(k, c) <= sub%n_grains) length = length + sub%radius(sub%pair(k, c))
    end do
    branch(:) = length*sub%hot(lane_of(c), 1:kernels%nd, block_of(c))
  end subroutine find_branch

end module gravier_contact_branch
