!> Impulses and velocities of a contact problem: put aside and put back, and how far velocities are from each other.
module gravier_error_fields
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: field_t, set_impulses, take_fields, take_velocities, scale_of, mass_of, distance

  !> Fields of all subdomains of this rank.
  type :: field_t
    !> (nv, n_columns) [m/s, rad/s]
    real(dp), allocatable :: velocity(:, :)
    !> (lanes, nc, blocks) [N s]
    real(dp), allocatable :: impulse(:, :, :)
  end type field_t

contains

  !> Impulses: those given, or zero.
  subroutine set_impulses(problem, fields)
    type(contact_problem_t), intent(inout) :: problem
    type(field_t), intent(in), optional :: fields(:)
    integer :: s

    do s = 1, size(problem%sub)
      if (present(fields)) then
        problem%sub(s)%impulse = fields(s)%impulse
      else
        problem%sub(s)%impulse(:, :, :) = 0.0_dp
      end if
    end do
  end subroutine set_impulses

  !> Copy impulses and velocities.
  subroutine take_fields(problem, fields)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), allocatable, intent(inout) :: fields(:)
    integer :: s

    if (.not. allocated(fields)) allocate (fields(size(problem%sub)))
    do s = 1, size(problem%sub)
      fields(s)%impulse = problem%sub(s)%impulse
      fields(s)%velocity = problem%sub(s)%v_global
    end do
  end subroutine take_fields

  subroutine take_velocities(problem, fields)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), intent(inout) :: fields(:)
    integer :: s

    do s = 1, size(problem%sub)
      fields(s)%velocity = problem%sub(s)%v_global
    end do
  end subroutine take_velocities

  !> g h; without gravity the root mean square velocity that bodies would have without contacts [m/s]. Collective.
  real(dp) function scale_of(simulation) result(scale)
    type(simulation_t), intent(in) :: simulation
    real(dp) :: parts(1, size(simulation%problem%sub)), sums(1), mass
    integer :: s

    scale = simulation%velocity_scale%value
    mass = mass_of(simulation%problem)
    ! without a grain in contact there is nothing to compare
    if (scale > 0.0_dp .or. .not. mass > 0.0_dp) return
    do s = 1, size(simulation%problem%sub)
      associate (sub => simulation%problem%sub(s))
        parts(1, s) = sub%product_of(sub%v_free, sub%v_free)
      end associate
    end do
    call simulation%problem%comm%sum_parts(parts, sums)
    scale = sqrt(sums(1)/mass)
  end function scale_of

  !> Mass of the grains in contact, each counted once [kg]. Collective.
  real(dp) function mass_of(problem) result(mass)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: parts(1, size(problem%sub)), sums(1)
    integer :: s, b

    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          parts(1, s) = parts(1, s) + 1.0_dp/(sub%inverse_mass(1, b)*sub%multiplicity(b))
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    mass = sums(1)
  end function mass_of

  !> |V - V*|_M over the root of the mass, V* being v_global of the problem, or rest [m/s]. Collective.
  real(dp) function distance(problem, state, mass, at_rest)
    type(contact_problem_t), intent(in) :: problem
    type(field_t), intent(in) :: state(:)
    real(dp), intent(in) :: mass
    logical, intent(in) :: at_rest
    real(dp) :: parts(1, size(state)), sums(1)
    real(dp), allocatable :: difference(:, :)
    integer :: s

    do s = 1, size(state)
      allocate (difference, source=state(s)%velocity)
      if (.not. at_rest) difference(:, :) = difference - problem%sub(s)%v_global
      parts(1, s) = problem%sub(s)%product_of(difference, difference)
      deallocate (difference)
    end do
    call problem%comm%sum_parts(parts, sums)
    distance = 0.0_dp
    if (mass > 0.0_dp) distance = sqrt(sums(1)/mass)
  end function distance

end module gravier_error_fields
