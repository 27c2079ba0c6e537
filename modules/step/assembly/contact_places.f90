!> Where bodies touch, by what the packed contacts know of it.
module gravier_contact_places
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: kernels_t, contact_arms, lane_of, block_of
  use gravier_subproblem, only: subproblem_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: find_contact_place

contains

  !> The place of contact `c` when it was detected: by the arm of the candidate or, where this is glued, that of the antagonist;
  !> between disks or spheres half-way between the surfaces.
  pure subroutine find_contact_place(kernels, view, sub, c, place)
    type(kernels_t), intent(in) :: kernels
    type(local_bodies_t), intent(in) :: view
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd) [m]
    real(dp), intent(out) :: place(:)
    real(dp) :: arm_i(kernels%nd), arm_j(kernels%nd)
    integer :: i, j

    call view%find_ends(sub%source(c), i, j)
    if (kernels%has_shapes()) then
      call contact_arms(kernels, sub%hot, c, arm_i, arm_j)
      place(:) = view%bodies%position(:, i) + arm_i
      if (view%bodies%glued(i) > 0 .and. j > 0) place(:) = view%bodies%position(:, max(j, 1)) + arm_j
    else
      place(:) = view%bodies%position(:, i) - (view%bodies%radius(i) + 0.5_dp*sub%gap(c))* &
        & sub%hot(lane_of(c), 1:kernels%nd, block_of(c))
    end if
  end subroutine find_contact_place

end module gravier_contact_places
