!> A diagnostic of a test's own that looks at what boundaries give to the grains.
module own_pushes
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_boundary_push, only: find_earlier, find_mean_velocities, find_push
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: pushes_t

  !> Of the last boundary: impulse on the grains [N s], velocity at the start of the step and its mean at the contacts [m/s].
  type, extends(diagnostic_t) :: pushes_t
    real(dp) :: impulse(2) = 0.0_dp, start = 0.0_dp, mean = 0.0_dp
    integer :: contacts = 0
  contains
    procedure, nopass :: features => pushes_features
    procedure :: take_step => pushes_take_step
    procedure :: measure => pushes_measure
    procedure :: columns => pushes_columns
  end type pushes_t

contains

  pure function pushes_features() result(features)
    type(diagnostic_features_t) :: features
    features%key = "pushes"
  end function pushes_features

  subroutine pushes_take_step(self, step)
    class(pushes_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    type(boundary_t) :: earlier(size(step%decomposition%boundaries))
    real(dp) :: parts(4, size(step%problem%sub)), sums(4), p(2), m(1)
    real(dp), allocatable :: mean(:, :)
    integer :: s, c, column

    call find_earlier(step, earlier)
    self%start = earlier(size(earlier))%velocity(1)
    parts(:, :) = 0.0_dp
    do s = 1, size(parts, 2)
      associate (sub => step%problem%sub(s))
        allocate (mean(step%problem%nv, sub%n_columns))
        call find_mean_velocities(step, s, earlier, mean)
        do c = 1, sub%n_contacts
          if (all(sub%pair(:, c) <= sub%n_grains)) cycle
          call find_push(step%problem, s, c, column, p, m)
          if (sub%boundary(column) /= size(earlier)) cycle
          parts(1:2, s) = parts(1:2, s) + p
          parts(3, s) = parts(3, s) + mean(1, column)
          parts(4, s) = parts(4, s) + 1.0_dp
        end do
        deallocate (mean)
      end associate
    end do
    call step%decomposition%comm%sum_parts(parts, sums)
    self%impulse(:) = sums(1:2)
    self%contacts = nint(sums(4))
    self%mean = sums(3)/max(1, self%contacts)
  end subroutine pushes_take_step

  subroutine pushes_measure(self, step)
    class(pushes_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step

    associate (unused => self, unused_step => step)
    end associate
  end subroutine pushes_measure

  subroutine pushes_columns(self, list)
    class(pushes_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    call list%add("push", self%impulse(1))
  end subroutine pushes_columns

end module own_pushes

!> Impulses and velocities of a belt that goes to and fro under disks, and the power that follows from them.
program test_boundary_push
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_diagnostic, only: column_list_t
  use gravier_diagnostic_registry, only: diagnostic_holder_t
  use gravier_boundary_power, only: boundary_power_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use own_pushes, only: pushes_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_belt()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine test_belt()
    type(simulation_t) :: sim
    type(diagnostic_holder_t) :: list(2)
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(column_list_t) :: columns
    real(dp) :: last, largest
    integer :: step

    call make_scene(comm, "&scene bodies = 'lattice', lattice_count = 3, 2, radius_min = 0.1, radius_max = 0.1, "// &
      & "friction = 0.4 / &boundary shape = 'plane', normal = 0, 1, name = 'belt', friction = 0.4, oscillation = 0.1, 0, "// &
      & "frequency = 2 / &time step = 0.01, steps = 9 / &solver method = 'nscdd' / &decomposition subdomains = 2 /", sim)
    allocate (list(1)%diagnostic, source=pushes_t())
    allocate (list(2)%diagnostic, source=boundary_power_t())
    call sim%diagnostics%take(sim%decomposition, sim%physics, list, [.true., .true.])
    largest = 0.0_dp
    do step = 1, 9
      last = sim%decomposition%boundaries(size(sim%decomposition%boundaries))%velocity(1)
      call sim%advance(figures, error)
      call check(.not. allocated(error), "a step is made")
      associate (n => size(sim%decomposition%boundaries))
        associate (now => sim%decomposition%boundaries(n)%velocity(1))
          select type (pushes => sim%diagnostics%asked(1)%diagnostic)
          type is (pushes_t)
            call check_close(pushes%impulse(1), -sim%boundary_impulses(1, n), 1.0e-12_dp*abs(pushes%impulse(2)), &
              & "it is the opposite of what the belt gets")
            call check_close(pushes%impulse(2), -sim%boundary_impulses(2, n), 1.0e-12_dp*abs(pushes%impulse(2)), "upwards, too")
            call check_close(pushes%start, last, 1.0e-14_dp, "velocity of the start")
            if (pushes%contacts > 0) call check_close(pushes%mean, 0.5_dp*(last + now), 1.0e-14_dp, "mean velocity")
            select type (power => sim%diagnostics%asked(2)%diagnostic)
            type is (boundary_power_t)
              call check_close(power%power(n), pushes%impulse(1)*0.5_dp*(last + now)/sim%physics%h, &
                & 1.0e-12_dp*abs(pushes%impulse(2)/sim%physics%h), "power is force times mean velocity")
              largest = max(largest, abs(power%power(n)))
              call columns%clear()
              call power%columns(columns)
              call check_equal(columns%n, 4*n, "velocity, spin and power of each boundary")
              call check_equal(trim(columns%name(4*n)), "power:belt", "the last column")
              call check_close(columns%value(4*n - 3), now, 0.0_dp, "velocity of the end")
            end select
          end select
        end associate
      end associate
    end do
    call check(largest > 1.0_dp, "the belt works")
    call sim%free()
  end subroutine test_belt

end program test_boundary_push
