!> What grains do to boundaries: impulses of a step, and the velocities and displacements of boundaries that forces move.
module gravier_boundary_loads
  use gravier_kinds, only: dp
  use gravier_orientation, only: turn_orientation
  use gravier_boundary, only: boundary_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: sum_boundary_impulses, take_boundary_velocities, take_boundary_displacements, carry_glued, set_glued_velocities

contains

  !> Impulse of all contacts on each boundary [N s], exactly the same whatever the number of ranks. Collective.
  subroutine sum_boundary_impulses(decomposition, problem, impulses)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    !> (nd, boundaries)
    real(dp), allocatable, intent(out) :: impulses(:, :)
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: p(decomposition%nd)
    integer :: s, c, b, nd, first

    nd = decomposition%nd
    allocate (impulses(nd, size(decomposition%boundaries)), source=0.0_dp)
    allocate (parts(size(impulses), size(problem%sub)), sums(size(impulses)), source=0.0_dp)
    if (size(sums) == 0) return
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          if (all(sub%pair(:, c) <= sub%n_grains)) cycle
          call problem%impulse_on_candidate(s, c, p)
          if (sub%pair(2, c) > sub%n_grains) then
            b = sub%boundary(sub%pair(2, c))
            p(:) = -p
          else
            b = sub%boundary(sub%pair(1, c))
          end if
          if (b == 0) cycle
          first = (b - 1)*nd
          parts(first + 1:first + nd, s) = parts(first + 1:first + nd, s) + p
        end do
      end associate
    end do
    call decomposition%comm%sum_parts(parts, sums)
    do b = 1, size(impulses, 2)
      impulses(:, b) = sums((b - 1)*nd + 1:b*nd)
    end do
  end subroutine sum_boundary_impulses

  !> Velocities at the end of the step of the boundaries that forces move.
  subroutine take_boundary_velocities(decomposition, impulses)
    type(decomposition_t), intent(inout) :: decomposition
    !> (nd, boundaries) of the contacts [N s]
    real(dp), intent(in), contiguous :: impulses(:, :)
    integer :: b, d

    do b = 1, size(decomposition%boundaries)
      associate (boundary => decomposition%boundaries(b))
        do d = 1, decomposition%nd
          if (boundary%free(d)) boundary%velocity(d) = boundary%velocity(d) + impulses(d, b)/boundary%mass
        end do
      end associate
    end do
  end subroutine take_boundary_velocities

  !> Move the boundaries that forces move, and the grains glued to them, by what v_global holds in the place of
  !> velocities [m]. All copies of a boundary hold the same bits; ranks without one learn them. Collective.
  subroutine take_boundary_displacements(decomposition, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: ways(:)
    integer :: s, k, b, nd

    nd = decomposition%nd
    allocate (ways(nd*size(decomposition%boundaries)), source=-huge(1.0_dp))
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do k = sub%n_grains + 1, sub%n_bodies
          b = sub%boundary(k)
          ways((b - 1)*nd + 1:b*nd) = sub%v_global(1:nd, k)
        end do
      end associate
    end do
    call decomposition%comm%highest_of(ways)
    ! nothing touches it
    where (ways <= -huge(1.0_dp)) ways = 0.0_dp
    do b = 1, size(decomposition%boundaries)
      call decomposition%boundaries(b)%shift(ways((b - 1)*nd + 1:b*nd))
    end do
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          b = owned%glued(k)
          if (b > 0) owned%position(:, k) = owned%position(:, k) + ways((b - 1)*nd + 1:b*nd)
        end do
      end associate
    end do
  end subroutine take_boundary_displacements

  !> Move glued grains with their boundaries, which have not moved yet, for a time.
  subroutine carry_glued(decomposition, duration)
    type(decomposition_t), intent(inout) :: decomposition
    !> [s]
    real(dp), intent(in) :: duration
    integer :: s, k

    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) == 0) cycle
          call decomposition%boundaries(owned%glued(k))%carry(duration, owned%position(:, k))
          if (owned%no > 0) call turn_with(decomposition%boundaries(owned%glued(k)), duration, owned%orientation(:, k))
        end do
      end associate
    end do
  end subroutine carry_glued

  !> Turn a body as a boundary turns for a time.
  pure subroutine turn_with(boundary, duration, orientation)
    type(boundary_t), intent(in) :: boundary
    !> [s]
    real(dp), intent(in) :: duration
    real(dp), intent(inout) :: orientation(:)

    if (size(orientation) == 1) then
      call turn_orientation(orientation, boundary%spin(3:3), duration)
    else
      call turn_orientation(orientation, boundary%spin, duration)
    end if
  end subroutine turn_with

  !> Give glued grains the velocity of their boundary where they are, and its spin.
  subroutine set_glued_velocities(decomposition)
    type(decomposition_t), intent(inout) :: decomposition
    integer :: s, k, nd

    nd = decomposition%nd
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) == 0) cycle
          associate (boundary => decomposition%boundaries(owned%glued(k)))
            call boundary%velocity_at(owned%position(:, k), owned%velocity(1:nd, k))
            if (owned%nv == nd + 1) owned%velocity(nd + 1, k) = boundary%spin(3)
            if (owned%nv == nd + 3) owned%velocity(nd + 1:, k) = boundary%spin
          end associate
        end do
      end associate
    end do
  end subroutine set_glued_velocities

end module gravier_boundary_loads
