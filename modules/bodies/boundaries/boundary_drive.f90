!> What a user prescribes of a boundary: a motion, as constants, a table against time and an oscillation that is added to them,
!> and loads, as constants or a table.
module gravier_boundary_drive
  use gravier_kinds, only: dp
  use gravier_time_table, only: time_table_t
  implicit none
  private
  public :: boundary_drive_t, drive_names, drive_rates

  !> Quantities that a table may give. `gives` asks by these names.
  integer, parameter, public :: drives_velocity = 1, drives_spin = 2, drives_force = 3, drives_pressure = 4

  real(dp), parameter :: two_pi = 8.0_dp*atan(1.0_dp)
  !> columns of the table in 2D and 3D, which column_of knows by their places
  character(len=*), parameter :: names_2d = "vx vy omega fx fy pressure"
  character(len=*), parameter :: names_3d = "vx vy vz wx wy wz fx fy fz pressure"
  integer, parameter :: columns_2d = 6

  !> In 2D vectors have a third component of 0, and spins only a third one.
  type :: boundary_drive_t
    !> constants [m/s], [rad/s], where no table says otherwise
    real(dp) :: velocity(3) = 0.0_dp, spin(3) = 0.0_dp
    !> of components that are free [N]; [Pa], or [N/m] in 2D
    real(dp) :: force(3) = 0.0_dp, pressure = 0.0_dp
    !> amplitudes A of the displacement [m] and of the rotation [rad] since time 0, A (sin(2 pi f t + phase) - sin(phase))
    real(dp) :: oscillation(3) = 0.0_dp, rotation_oscillation(3) = 0.0_dp
    !> f [Hz], phase [rad]
    real(dp) :: frequency = 0.0_dp, phase = 0.0_dp
    !> of quantities that replace the constants; without `has` where there is none
    type(time_table_t) :: table
    !> a loop of the user's own has set the drive, so that the spin may jump between two steps
    logical :: steered = .false.
  contains
    procedure :: velocity_at => boundary_drive_velocity_at
    procedure :: time_beside => boundary_drive_time_beside
    procedure :: spin_at => boundary_drive_spin_at
    procedure :: force_at => boundary_drive_force_at
    procedure :: pressure_at => boundary_drive_pressure_at
    procedure :: gives => boundary_drive_gives
    procedure :: oscillates => boundary_drive_oscillates
    procedure :: find_extremes => boundary_drive_find_extremes
    procedure :: moves => boundary_drive_moves
    procedure :: turns => boundary_drive_turns
    procedure :: turns_about => boundary_drive_turns_about
    procedure :: find_axis => boundary_drive_find_axis
    procedure :: changes => boundary_drive_changes
    procedure :: changes_after => boundary_drive_changes_after
  end type boundary_drive_t

contains

  !> Names of the columns of a table of drives, with a blank between two.
  pure function drive_names(nd) result(names)
    integer, intent(in) :: nd
    character(len=:), allocatable :: names

    names = names_3d
    if (nd == 2) names = names_2d
  end function drive_names

  !> How many of these columns, which come first, are velocities and spins.
  pure integer function drive_rates(nd)
    integer, intent(in) :: nd
    drive_rates = merge(3, 6, nd == 2)
  end function drive_rates

  !> The column of the table that gives a quantity along or about axis `k`, 0 where there is none.
  pure integer function column_of(self, quantity, k) result(column)
    type(boundary_drive_t), intent(in) :: self
    !> one of those that `gives` knows
    integer, intent(in) :: quantity
    !> 1 of a pressure
    integer, intent(in) :: k

    column = 0
    if (.not. allocated(self%table%has)) return
    if (size(self%table%has) == columns_2d) then
      ! a plane has two axes and turns about the third
      if (quantity == drives_spin) then
        if (k == 3) column = 3
      else if (k < 3) then
        column = k
        if (quantity == drives_force) column = 3 + k
        if (quantity == drives_pressure) column = 6
      end if
    else
      column = 3*(quantity - 1) + k
    end if
    if (column > 0) then
      if (.not. self%table%has(column)) column = 0
    end if
  end function column_of

  !> A quantity at the end of a step, or in that step if it is a load: what the table gives, else the constant.
  pure real(dp) function given(self, quantity, k, time, step, constant) result(value)
    type(boundary_drive_t), intent(in) :: self
    integer, intent(in) :: quantity, k
    real(dp), intent(in) :: time, step, constant
    integer :: column

    value = constant
    column = column_of(self, quantity, k)
    if (column == 0) return
    if (quantity == drives_velocity .or. quantity == drives_spin) then
      value = self%table%rate_at(column, time, step)
    else
      value = self%table%load_of(column, time, step)
    end if
  end function given

  !> d/dt of sin(2 pi f t + phase) [1/s].
  pure real(dp) function rate_of_sine(self, time) result(rate)
    type(boundary_drive_t), intent(in) :: self
    real(dp), intent(in) :: time

    ! whole periods are taken out first, so that a long time costs no digits of the cosine
    rate = two_pi*self%frequency*cos(two_pi*modulo(self%frequency*time, 1.0_dp) + self%phase)
  end function rate_of_sine

  !> Prescribed velocity along axis `d` at the end of a step [m/s].
  pure real(dp) function boundary_drive_velocity_at(self, d, time, step) result(velocity)
    class(boundary_drive_t), intent(in) :: self
    integer, intent(in) :: d
    !> [s]
    real(dp), intent(in) :: time, step

    velocity = given(self, drives_velocity, d, time, step, self%velocity(d))
    if (abs(self%oscillation(d)) > 0.0_dp) velocity = velocity + self%oscillation(d)*rate_of_sine(self, time)
  end function boundary_drive_velocity_at

  !> Prescribed rate of rotation about axis `k` at the end of a step [rad/s].
  pure real(dp) function boundary_drive_spin_at(self, k, time, step) result(spin)
    class(boundary_drive_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time, step

    spin = given(self, drives_spin, k, time, step, self%spin(k))
    if (abs(self%rotation_oscillation(k)) > 0.0_dp) spin = spin + self%rotation_oscillation(k)*rate_of_sine(self, time)
  end function boundary_drive_spin_at

  !> A time beside another one, by some duration or by a quarter of the period of an oscillation, if that is shorter [s].
  pure real(dp) function boundary_drive_time_beside(self, time, duration) result(beside)
    class(boundary_drive_t), intent(in) :: self
    !> [s]; the duration is negative towards the past
    real(dp), intent(in) :: time, duration

    beside = time + duration
    if (self%oscillates()) beside = time + sign(min(abs(duration), 0.25_dp/self%frequency), duration)
  end function boundary_drive_time_beside

  !> Force of the user along axis `d` in the step that ends at a time [N].
  pure real(dp) function boundary_drive_force_at(self, d, time, step) result(force)
    class(boundary_drive_t), intent(in) :: self
    integer, intent(in) :: d
    !> [s]
    real(dp), intent(in) :: time, step
    force = given(self, drives_force, d, time, step, self%force(d))
  end function boundary_drive_force_at

  !> Pressure of the user in the step that ends at a time [Pa, N/m in 2D].
  pure real(dp) function boundary_drive_pressure_at(self, time, step) result(pressure)
    class(boundary_drive_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time, step
    pressure = given(self, drives_pressure, 1, time, step, self%pressure)
  end function boundary_drive_pressure_at

  !> Whether the table gives a quantity along or about axis `k`.
  pure logical function boundary_drive_gives(self, quantity, k) result(gives)
    class(boundary_drive_t), intent(in) :: self
    !> drives_velocity, drives_spin, drives_force or drives_pressure
    integer, intent(in) :: quantity
    !> 1 of a pressure
    integer, intent(in) :: k
    gives = column_of(self, quantity, k) > 0
  end function boundary_drive_gives

  !> Whether there is an oscillation.
  pure logical function boundary_drive_oscillates(self) result(oscillates)
    class(boundary_drive_t), intent(in) :: self
    oscillates = any(abs(self%oscillation) > 0.0_dp) .or. any(abs(self%rotation_oscillation) > 0.0_dp)
  end function boundary_drive_oscillates

  !> The first times >= 0 at which an oscillation is fastest, forwards and backwards [s].
  pure subroutine boundary_drive_find_extremes(self, times)
    class(boundary_drive_t), intent(in) :: self
    real(dp), intent(out) :: times(2)

    times(1) = modulo(-self%phase/two_pi, 1.0_dp)/self%frequency
    times(2) = modulo(0.5_dp - self%phase/two_pi, 1.0_dp)/self%frequency
  end subroutine boundary_drive_find_extremes

  !> Whether it may move the boundary at some time.
  pure logical function boundary_drive_moves(self) result(moves)
    class(boundary_drive_t), intent(in) :: self
    moves = any(abs(self%velocity) > 0.0_dp) .or. any(abs(self%spin) > 0.0_dp) .or. self%changes()
  end function boundary_drive_moves

  !> Whether it may turn the boundary at some time.
  pure logical function boundary_drive_turns(self) result(turns)
    class(boundary_drive_t), intent(in) :: self

    turns = any(abs(self%spin) > 0.0_dp) .or. any(abs(self%rotation_oscillation) > 0.0_dp)
    if (allocated(self%table%has)) turns = turns .or. self%turns_about(1) .or. self%turns_about(2) .or. self%turns_about(3)
  end function boundary_drive_turns

  !> Whether it may turn the boundary about axis `k` at some time.
  pure logical function boundary_drive_turns_about(self, k) result(turns)
    class(boundary_drive_t), intent(in) :: self
    integer, intent(in) :: k
    turns = abs(self%spin(k)) > 0.0_dp .or. abs(self%rotation_oscillation(k)) > 0.0_dp .or. column_of(self, drives_spin, k) > 0
  end function boundary_drive_turns_about

  !> The axis that it turns about at all times, of unit length; 0 where there is none.
  pure subroutine boundary_drive_find_axis(self, axis)
    class(boundary_drive_t), intent(in) :: self
    real(dp), intent(out) :: axis(3)
    integer :: k, n

    axis(:) = 0.0_dp
    n = 0
    do k = 1, 3
      if (.not. self%turns_about(k)) cycle
      n = n + 1
      axis(k) = 1.0_dp
    end do
    if (n <= 1) return
    axis(:) = 0.0_dp
    if (self%changes() .or. .not. norm2(self%spin) > 0.0_dp) return
    axis(:) = self%spin/norm2(self%spin)
  end subroutine boundary_drive_find_axis

  !> Whether a quantity may have different values at different times.
  pure logical function boundary_drive_changes(self) result(changes)
    class(boundary_drive_t), intent(in) :: self
    changes = self%oscillates() .or. allocated(self%table%has)
  end function boundary_drive_changes

  !> Whether some quantity has another value later than it has at a time.
  pure logical function boundary_drive_changes_after(self, time) result(changes)
    class(boundary_drive_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time

    changes = .false.
    if (allocated(self%table%has)) changes = self%table%changes_after(time)
    changes = changes .or. self%oscillates()
  end function boundary_drive_changes_after

end module gravier_boundary_drive
