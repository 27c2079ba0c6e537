!> What moves a periodic cell: rates of strain, or stresses that are held (gravier_moving_cell), constant or against time.
module gravier_cell_drive
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_periodic, only: period_t, gradient_times
  use gravier_moving_cell, only: cell_motion_t
  use gravier_time_table, only: time_table_t
  use gravier_body_store, only: body_set_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_cell_response, only: respond, carry_along
  use gravier_decomposition, only: decomposition_t
  use gravier_imposed_motion, only: steps_beside
  implicit none
  private
  public :: cell_drive_t, cell_components, cell_component, component_row, component_column, stress_sign, carry_grains, &
    & carry_bodies, take_cell, check_cell_size

  !> Components of the velocity gradient of a cell: three strains and the shears xy, xz and yz, by row and column.
  integer, parameter :: component_row(6) = [1, 2, 3, 1, 1, 2], component_column(6) = [1, 2, 3, 2, 3, 3]

  !> Matrices are 0 below the diagonal.
  type :: cell_drive_t
    !> velocity gradient of the components that are given [1/s]
    real(dp) :: rate(3, 3) = 0.0_dp
    !> stress held, compression positive, of the components that it drives [Pa, N/m in 2D]
    real(dp) :: stress(3, 3) = 0.0_dp
    logical :: driven(3, 3) = .false.
    !> inertia of the cell over that of its grains, M L^2 with the mass of the grains M and the length L along the axis
    real(dp) :: inertia = 1.0_dp
    !> rates and then stresses of the components that a cell has (cell_components), of which those that it has replace the others;
    !> without `has` where there is no table
    type(time_table_t) :: table
  contains
    procedure :: set_time => cell_drive_set_time
    procedure :: moved => cell_drive_moved
    procedure :: begin_step => cell_drive_begin_step
  end type cell_drive_t

contains

  !> How many components a cell of `nd` dimensions has.
  pure integer function cell_components(nd) result(n)
    integer, intent(in) :: nd
    n = 3*(nd - 1)
  end function cell_components

  !> The k-th of them, by its place in component_row and component_column.
  pure integer function cell_component(k, nd) result(component)
    integer, intent(in) :: k, nd
    component = merge(4, k, nd == 2 .and. k == 3)
  end function cell_component

  !> The component of the mean stress, in which compression is positive, that is held by a stress of the input: a pressure is that
  !> component, and a shear stress drives the cell along itself, so that contacts resist with a component of the other sign.
  pure real(dp) function stress_sign(row, column)
    integer, intent(in) :: row, column
    stress_sign = merge(1.0_dp, -1.0_dp, row == column)
  end function stress_sign

  !> Take the rates of the end of a step and the stresses in this step from the table, where there is one.
  pure subroutine cell_drive_set_time(self, nd, time, h)
    class(cell_drive_t), intent(inout) :: self
    integer, intent(in) :: nd
    !> end of the step, and step [s]
    real(dp), intent(in) :: time, h
    integer :: k, n

    if (.not. allocated(self%table%has)) return
    n = cell_components(nd)
    do k = 1, n
      associate (a => component_row(cell_component(k, nd)), b => component_column(cell_component(k, nd)))
        if (self%table%has(k)) self%rate(a, b) = self%table%rate_at(k, time, h)
        if (self%table%has(n + k)) self%stress(a, b) = stress_sign(a, b)*self%table%load_of(n + k, time, h)
      end associate
    end do
  end subroutine cell_drive_set_time

  !> The components that move at some time, by a rate or by a stress.
  pure function cell_drive_moved(self, nd) result(moved)
    class(cell_drive_t), intent(in) :: self
    integer, intent(in) :: nd
    logical :: moved(3, 3)
    integer :: k

    moved(:, :) = abs(self%rate) > 0.0_dp .or. self%driven
    if (.not. allocated(self%table%has)) return
    do k = 1, cell_components(nd)
      if (self%table%has(k)) moved(component_row(cell_component(k, nd)), component_column(cell_component(k, nd))) = .true.
    end do
  end function cell_drive_moved

  !> The motion of a step without contacts: of the cell at q_m, which has the rates of the start of the step.
  pure subroutine cell_drive_begin_step(self, period, nd, mass, h, time, motion)
    class(cell_drive_t), intent(inout) :: self
    type(period_t), intent(in) :: period
    integer, intent(in) :: nd
    !> of the grains [kg]; step [s]
    real(dp), intent(in) :: mass, h
    !> at the end of the step [s]
    real(dp), intent(in) :: time
    type(cell_motion_t), intent(out) :: motion
    real(dp) :: volume, gradient(3, 3)
    integer :: b

    motion%moves = period%moves
    if (.not. motion%moves) return
    call self%set_time(nd, time, h)
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
    if (allocated(self%table%has)) motion%fastest = fastest_beside(self, nd, time, h)
  end subroutine cell_drive_begin_step

  !> Norm of the rates that are given, the larger one of some steps before and after a time [1/s].
  pure real(dp) function fastest_beside(self, nd, time, h) result(fastest)
    type(cell_drive_t), intent(in) :: self
    integer, intent(in) :: nd
    !> [s]
    real(dp), intent(in) :: time, h
    real(dp) :: rate(3, 3)
    integer :: k, side

    fastest = 0.0_dp
    do side = -1, 1, 2
      rate(:, :) = merge(0.0_dp, self%rate, self%driven)
      do k = 1, cell_components(nd)
        if (self%table%has(k)) rate(component_row(cell_component(k, nd)), component_column(cell_component(k, nd))) = &
          & self%table%rate_at(k, time + side*steps_beside*h, h)
      end do
      fastest = max(fastest, norm2(rate))
    end do
  end function fastest_beside

  !> The motion of the cell under the impulses of a solve, which carries the grains in contact along. Collective.
  subroutine take_cell(problem, period)
    type(contact_problem_t), intent(inout) :: problem
    type(period_t), intent(inout) :: period

    call respond(problem)
    call carry_along(problem)
    call period%set_gradient(problem%cell%now)
  end subroutine take_cell

  !> Fail (status_failure) where a cell has collapsed, or has shrunk so far that pairs would meet across both sides of it.
  subroutine check_cell_size(decomposition, step, error)
    type(decomposition_t), intent(in) :: decomposition
    !> number of the step, for the message
    integer, intent(in) :: step
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: least, shortest

    if (decomposition%period%collapsed) then
      call raise(error, status_failure, "step "//to_text(step)//": the periodic cell shrinks by more than its length in this "// &
        & "step; expected rates of strain, pressures and a &time step that shrink it little in a step")
      return
    end if
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
    real(dp) :: centre(3), change(3, 3)
    integer :: s

    centre(:) = decomposition%period%centre()
    change(:, :) = motion%now - motion%before
    do s = 1, size(decomposition%owned)
      call carry_bodies(centre, change, decomposition%owned(s))
    end do
  end subroutine carry_grains

  !> Carry bodies along with a change of the velocity gradient of a cell.
  pure subroutine carry_bodies(centre, change, bodies)
    !> the middle of the cell [m], [1/s]
    real(dp), intent(in) :: centre(3), change(3, 3)
    type(body_set_t), intent(inout) :: bodies
    real(dp) :: place(bodies%nd), carried(bodies%nd)
    integer :: k, nd

    nd = bodies%nd
    do k = 1, bodies%n
      place(:) = bodies%position(:, k) - centre(1:nd)
      carried(:) = gradient_times(change, place)
      bodies%velocity(1:nd, k) = bodies%velocity(1:nd, k) + carried
    end do
  end subroutine carry_bodies

end module gravier_cell_drive
