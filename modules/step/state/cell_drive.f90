!> What moves a periodic cell: rates of strain, or stresses that are held (gravier_moving_cell).
module gravier_cell_drive
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_periodic, only: period_t, gradient_times
  use gravier_moving_cell, only: cell_motion_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_cell_response, only: respond, carry_along
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: cell_drive_t, carry_grains, take_cell, check_cell_size

  !> Matrices are 0 below the diagonal.
  type :: cell_drive_t
    !> velocity gradient of the components that are given [1/s]
    real(dp) :: rate(3, 3) = 0.0_dp
    !> stress held, compression positive, of the components that it drives [Pa, N/m in 2D]
    real(dp) :: stress(3, 3) = 0.0_dp
    logical :: driven(3, 3) = .false.
    !> inertia of the cell over that of its grains, M L^2 with the mass of the grains M and the length L along the axis
    real(dp) :: inertia = 1.0_dp
  contains
    procedure :: begin_step => cell_drive_begin_step
  end type cell_drive_t

contains

  !> The motion of a step without contacts: of the cell at q_m, which has the rates of the start of the step.
  pure subroutine cell_drive_begin_step(self, period, nd, mass, h, motion)
    class(cell_drive_t), intent(in) :: self
    type(period_t), intent(in) :: period
    integer, intent(in) :: nd
    !> of the grains [kg]; step [s]
    real(dp), intent(in) :: mass, h
    type(cell_motion_t), intent(out) :: motion
    real(dp) :: volume, gradient(3, 3)
    integer :: b

    motion%moves = period%moves
    if (.not. motion%moves) return
    motion%driven(:, :) = self%driven
    motion%is_driven = any(self%driven)
    gradient(:, :) = period%gradient()
    motion%before(:, :) = gradient
    motion%free(:, :) = self%rate
    volume = product(period%length(1:nd))
    do b = 1, nd
      motion%inertia(:, b) = self%inertia*mass*period%length(b)**2
    end do
    where (self%driven)
      motion%impulse = h*self%stress
      motion%free = motion%before - volume*motion%impulse/motion%inertia
    end where
    motion%now(:, :) = motion%free
  end subroutine cell_drive_begin_step

  !> The motion of the cell under the impulses of a solve, which carries the grains in contact along. Collective.
  subroutine take_cell(problem, period)
    type(contact_problem_t), intent(inout) :: problem
    type(period_t), intent(inout) :: period

    call respond(problem)
    call carry_along(problem)
    call period%set_gradient(problem%cell%now)
  end subroutine take_cell

  !> Fail (status_failure) where a cell has shrunk so far that pairs would meet across both sides of it.
  subroutine check_cell_size(decomposition, step, error)
    type(decomposition_t), intent(in) :: decomposition
    !> number of the step, for the message
    integer, intent(in) :: step
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: least, shortest

    least = 2.0_dp*(2.0_dp*decomposition%rule%largest_radius + decomposition%rule%range())
    associate (length => decomposition%period%length)
      shortest = minval(length, mask=length > 0.0_dp)
    end associate
    if (shortest <= least) call raise(error, status_failure, "step "//to_text(step)//": the periodic cell has shrunk to "// &
      & to_text(shortest, 4)//" m; expected more than "//to_text(least, 4)//" m along each axis")
  end subroutine check_cell_size

  !> Carry the grains of this rank along with the change of the cell's velocity in a step.
  pure subroutine carry_grains(decomposition, motion)
    type(decomposition_t), intent(inout) :: decomposition
    type(cell_motion_t), intent(in) :: motion
    real(dp) :: centre(3), change(3, 3), place(decomposition%nd), carried(decomposition%nd)
    integer :: s, k, nd

    nd = decomposition%nd
    centre(:) = decomposition%period%centre()
    change(:, :) = motion%now - motion%before
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          place(:) = owned%position(:, k) - centre(1:nd)
          carried(:) = gradient_times(change, place)
          owned%velocity(1:nd, k) = owned%velocity(1:nd, k) + carried
        end do
      end associate
    end do
  end subroutine carry_grains

end module gravier_cell_drive
