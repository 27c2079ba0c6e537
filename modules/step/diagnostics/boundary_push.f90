!> What the boundaries give to the grains in a step, contact by contact: the impulses, and the mean of the velocities at its start
!> and at its end with which these do work.
module gravier_boundary_push
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_contact_kernels, only: kernels_t, contact_arms, global_moment, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_halo, only: local_bodies_t
  use gravier_diagnostic, only: solved_step_t
  implicit none
  private
  public :: find_earlier, find_mean_velocities, find_push

contains

  !> The boundaries with the velocities of the start of a step.
  subroutine find_earlier(step, earlier)
    type(solved_step_t), intent(in) :: step
    type(boundary_t), intent(out) :: earlier(:)
    integer :: b

    do b = 1, size(earlier)
      earlier(b) = step%decomposition%boundaries(b)
      earlier(b)%velocity(:) = earlier(b)%last_velocity
      earlier(b)%spin(:) = earlier(b)%last_spin
    end do
  end subroutine find_earlier

  !> Means of the velocities of the columns of a subproblem at the start and at the end of the step.
  subroutine find_mean_velocities(step, s, earlier, mean)
    type(solved_step_t), intent(in) :: step
    integer, intent(in) :: s
    !> boundaries with the velocities of the start of the step
    type(boundary_t), intent(in) :: earlier(:)
    !> (nv, n_columns)
    real(dp), intent(out), contiguous :: mean(:, :)

    associate (sub => step%problem%sub(s))
      call find_start(step, step%halo%view(s), sub, earlier, mean)
      mean(:, :) = 0.5_dp*(mean + sub%v_global)
    end associate
  end subroutine find_mean_velocities

  !> Impulse and moment that the boundary at a contact gives to the grain there, in the axes of the scene, and the column that
  !> stands for the boundary.
  subroutine find_push(problem, s, c, column, p, m)
    type(contact_problem_t), intent(in) :: problem
    !> subdomain and contact
    integer, intent(in) :: s, c
    integer, intent(out) :: column
    !> (nd) [N s]; of rolling and pivoting friction (nv - nd) [N m s]
    real(dp), intent(out) :: p(:), m(:)

    associate (sub => problem%sub(s))
      call problem%impulse_on_candidate(s, c, p)
      m(:) = 0.0_dp
      if (problem%has_rolling()) call global_moment(problem%kernels, sub%hot, sub%impulse, c, m)
      column = sub%pair(2, c)
      if (sub%pair(1, c) > sub%n_grains) then
        column = sub%pair(1, c)
        p(:) = -p
        m(:) = -m
      end if
    end associate
  end subroutine find_push

  !> Velocities of the columns of a subproblem at the start of the step; spins as they are at its end without moments, which have
  !> the same energy.
  subroutine find_start(step, view, sub, earlier, start)
    type(solved_step_t), intent(in) :: step
    type(local_bodies_t), intent(in) :: view
    type(subproblem_t), intent(in) :: sub
    type(boundary_t), intent(in) :: earlier(:)
    !> (nv, n_columns)
    real(dp), intent(out), contiguous :: start(:, :)
    integer :: c, i, j, nd

    nd = step%problem%nd
    start(:, :) = 0.0_dp
    do c = 1, sub%n_contacts
      call view%find_ends(sub%source(c), i, j)
      call fill(sub%pair(1, c), i)
      call fill(sub%pair(2, c), j)
    end do

  contains

    !> A column that stands for grain `k` of the view, or for a boundary.
    subroutine fill(column, k)
      integer, intent(in) :: column, k
      real(dp) :: point(nd), now(nd)

      if (column <= sub%n_grains) then
        start(:, column) = view%bodies%velocity(1:size(start, 1), k)
        call step%decomposition%figures%turn_freely(view%bodies, k, step%physics%h, start(:, column))
        return
      end if
      call find_touched_point(step%problem%kernels, view, sub, c, k, point)
      call earlier(sub%boundary(column))%velocity_at(point, start(1:nd, column))
      ! what the end of the step has of the travel of the body (add_travel), its start lacks
      if (earlier(sub%boundary(column))%drive%turns()) then
        call step%decomposition%boundaries(sub%boundary(column))%velocity_at(point, now)
        start(1:nd, column) = start(1:nd, column) - (sub%v_global(1:nd, column) - now)
      end if
      start(nd + 1:, column) = earlier(sub%boundary(column))%spin(merge(3, 1, nd == 2):size(start, 1) - nd + merge(2, 0, nd == 2))
    end subroutine fill

  end subroutine find_start

  !> Where a free grain touches boundary -k, or grain `k` that is part of one, at contact `c`.
  pure subroutine find_touched_point(kernels, view, sub, c, k, point)
    type(kernels_t), intent(in) :: kernels
    type(local_bodies_t), intent(in) :: view
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c, k
    !> (nd) [m]
    real(dp), intent(out) :: point(:)
    real(dp), dimension(size(point)) :: normal, arm_i, arm_j
    integer :: i, j

    call view%find_ends(sub%source(c), i, j)
    associate (bodies => view%bodies)
      normal(:) = sub%hot(lane_of(c), 1:size(point), block_of(c))
      if (kernels%has_shapes()) then
        call contact_arms(kernels, sub%hot, c, arm_i, arm_j)
        if (k == i) then
          point(:) = bodies%position(:, j) + arm_j
        else
          point(:) = bodies%position(:, i) + arm_i
        end if
      else if (k < 0) then
        point(:) = bodies%position(:, i) - (bodies%radius(i) + sub%gap(c))*normal
      else if (k == i) then
        point(:) = bodies%position(:, i) - bodies%radius(i)*normal
      else
        point(:) = bodies%position(:, j) + bodies%radius(j)*normal
      end if
    end associate
  end subroutine find_touched_point

end module gravier_boundary_push
