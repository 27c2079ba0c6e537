!> What boundaries and the cell impose on the grains: the largest difference of their velocities, now and where their drives turn
!> round.
module gravier_imposed_motion
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: imposed_motion_t, find_imposed, largest_imposed, steps_beside

  !> steps before and after a time within which drives are looked at
  integer, parameter :: steps_beside = 10
  !> steps in which a drive that begins from rest, or ends at rest, counts with more than its own velocity
  integer, parameter :: steps_of_start = 30

  !> Of a time.
  type :: imposed_motion_t
    !> largest difference of velocities [m/s]
    real(dp) :: difference = 0.0_dp
    !> velocity of all boundaries where they move alike, else 0 [m/s]
    real(dp) :: common(3) = 0.0_dp
    !> the larger of both: what bodies that touch boundaries may be carried with [m/s]
    real(dp) :: carries = 0.0_dp
    !> there is a boundary that grains touch
    logical :: bounded = .false.
  end type imposed_motion_t

contains

  !> What boundaries impose with the velocities that they have, and the cell with the rates of the step. Velocities differ by axis,
  !> over the boundaries that no force moves along it; rest is one of them where a single boundary is prescribed, and where there is
  !> gravity, whose direction a box that is shaken does not take along.
  pure subroutine find_imposed(nd, boundaries, lever, diameter, physics, motion)
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    !> how far each boundary reaches from its pivot (boundaries), diameter of the mean grain [m]
    real(dp), intent(in) :: lever(:), diameter
    type(physics_t), intent(in) :: physics
    type(imposed_motion_t), intent(out) :: motion
    real(dp) :: velocity(3, size(boundaries)), spin(3, size(boundaries))
    integer :: b

    do b = 1, size(boundaries)
      velocity(:, b) = boundaries(b)%velocity
      spin(:, b) = boundaries(b)%spin
    end do
    call compare(nd, boundaries, velocity, spin, lever, physics, motion)
    motion%difference = max(motion%difference, norm2(merge(0.0_dp, physics%cell%free, physics%cell%driven))*diameter)
    motion%carries = max(motion%difference, norm2(motion%common))
  end subroutine find_imposed

  !> The largest of the differences of a time and of the times ten steps before and after it, so that a drive that turns round
  !> counts with what it changes in ten steps: an error of a tenth of that is what it changes in one. A drive that begins from rest
  !> counts with what it comes to in 30 steps, so that its first velocities do not ask for solves that are needlessly exact, and one
  !> that ends likewise; one that has not begun yet does not count [m/s].
  pure real(dp) function largest_imposed(nd, boundaries, lever, diameter, physics, time, now) result(largest)
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    !> how far each boundary reaches from its pivot (boundaries), diameter of the mean grain [m]
    real(dp), intent(in) :: lever(:), diameter
    type(physics_t), intent(in) :: physics
    !> [s]
    real(dp), intent(in) :: time
    !> what is imposed at that time
    type(imposed_motion_t), intent(in) :: now
    real(dp) :: before
    logical :: changes
    integer :: b, side

    largest = max(now%difference, physics%cell%fastest*diameter)
    changes = .false.
    do b = 1, size(boundaries)
      changes = changes .or. boundaries(b)%drive%changes()
    end do
    if (.not. changes) return
    before = beside(-steps_beside)
    if (.not. max(now%difference, before) > 0.0_dp) return
    largest = max(largest, before, beside(steps_beside))
    do side = -1, 1, 2
      if (.not. beside(-side*steps_of_start) > 0.0_dp) largest = max(largest, beside(side*steps_of_start))
    end do

  contains

    !> The difference so many steps later, or earlier where they are negative [m/s].
    pure real(dp) function beside(steps)
      integer, intent(in) :: steps
      beside = difference_beside(nd, boundaries, lever, physics, time, steps*physics%h)
    end function beside

  end function largest_imposed

  !> What drives impose some duration after a time, or before it [m/s].
  pure real(dp) function difference_beside(nd, boundaries, lever, physics, time, duration) result(difference)
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    !> (boundaries) [m]
    real(dp), intent(in) :: lever(:)
    type(physics_t), intent(in) :: physics
    !> [s]; the duration is negative towards the past
    real(dp), intent(in) :: time, duration
    type(imposed_motion_t) :: beside
    real(dp) :: velocity(3, size(boundaries)), spin(3, size(boundaries)), then
    integer :: b, d

    do b = 1, size(boundaries)
      then = boundaries(b)%drive%time_beside(time, duration)
      do d = 1, 3
        velocity(d, b) = boundaries(b)%drive%velocity_at(d, then, physics%h)
        spin(d, b) = boundaries(b)%drive%spin_at(d, then, physics%h)
      end do
    end do
    call compare(nd, boundaries, velocity, spin, lever, physics, beside)
    difference = beside%difference
  end function difference_beside

  !> Compare velocities of boundaries.
  pure subroutine compare(nd, boundaries, velocity, spin, lever, physics, motion)
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    !> (3, boundaries) [m/s], [rad/s]
    real(dp), intent(in) :: velocity(:, :), spin(:, :)
    !> (boundaries) [m]
    real(dp), intent(in) :: lever(:)
    type(physics_t), intent(in) :: physics
    type(imposed_motion_t), intent(out) :: motion
    real(dp) :: low(nd), high(nd), turning
    integer :: b, d, n

    low(:) = huge(1.0_dp)
    high(:) = -huge(1.0_dp)
    turning = 0.0_dp
    n = 0
    do b = 1, size(boundaries)
      associate (boundary => boundaries(b))
        if (.not. boundary%present .or. boundary%lets_out()) cycle
        motion%bounded = .true.
        if (.not. all(boundary%free(1:nd))) n = n + 1
        do d = 1, nd
          if (boundary%free(d)) cycle
          low(d) = min(low(d), velocity(d, b))
          high(d) = max(high(d), velocity(d, b))
        end do
        turning = max(turning, norm2(spin(:, b))*lever(b))
      end associate
    end do
    if (n == 0) return
    do d = 1, nd
      ! along an axis along which forces move all, nothing is imposed
      if (low(d) > high(d)) low(d) = 0.0_dp
      high(d) = max(low(d), high(d))
    end do
    if (.not. (turning > 0.0_dp .or. any(high > low))) motion%common(1:nd) = low
    if (n == 1 .or. any(abs(physics%gravity(1:nd)) > 0.0_dp)) then
      low(:) = min(low, 0.0_dp)
      high(:) = max(high, 0.0_dp)
    end if
    motion%difference = max(norm2(high - low), turning)
  end subroutine compare

end module gravier_imposed_motion
