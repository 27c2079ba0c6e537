!> What boundaries and the cell impose on the grains: the largest difference of their velocities, now and where their drives turn
!> round.
module gravier_imposed_motion
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: imposed_motion_t, find_imposed, largest_imposed, steps_beside, unseen

  !> steps before and after a time within which drives are looked at
  integer, parameter :: steps_beside = 10
  !> times at most at which a slow drive is looked at: the last one is 5e9 steps away
  integer, parameter :: most_looks = 30
  !> diameters by which grains may drift without anybody's seeing it
  real(dp), parameter :: unseen = 0.01_dp

  !> Of a time.
  type :: imposed_motion_t
    !> largest difference of velocities [m/s]
    real(dp) :: difference = 0.0_dp
    !> velocity of all boundaries where they move alike, else 0 [m/s]
    real(dp) :: common(3) = 0.0_dp
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
  end subroutine find_imposed

  !> The largest of three differences [m/s]: that of a time; those ten steps before and after it, so that a drive which starts from
  !> rest or turns round counts with what it changes in ten steps, because an error of a tenth of that is what it changes in one;
  !> where one of these is not 0, the mean over the time in which tables move grains by a way that nobody sees, because errors of
  !> a tenth of that add up to a tenth of this way.
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
    logical :: changes, oscillates
    integer :: b, side

    largest = max(now%difference, physics%cell%fastest*diameter)
    changes = .false.
    oscillates = .false.
    do b = 1, size(boundaries)
      changes = changes .or. boundaries(b)%drive%changes()
      oscillates = oscillates .or. boundaries(b)%drive%oscillates()
    end do
    if (.not. changes) return
    do side = -1, 1, 2
      largest = max(largest, difference_beside(nd, boundaries, lever, physics, time, side*steps_beside*physics%h))
    end do
    if (oscillates .or. .not. largest > 0.0_dp) return
    do side = -1, 1, 2
      largest = max(largest, mean_difference(nd, boundaries, lever, physics, time, side*unseen*diameter))
    end do
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
        velocity(d, b) = boundaries(b)%drive%velocity_at(d, then)
        spin(d, b) = boundaries(b)%drive%spin_at(d, then)
      end do
    end do
    call compare(nd, boundaries, velocity, spin, lever, physics, beside)
    difference = beside%difference
  end function difference_beside

  !> The mean of what tables impose over the time, from now on or until now, in which they move grains by a way; 0 where they do not
  !> move them so far [m/s]. Times are looked at that are 10, 20, 40, ... steps away, with straight lines between them.
  pure real(dp) function mean_difference(nd, boundaries, lever, physics, time, way) result(mean)
    integer, intent(in) :: nd
    type(boundary_t), intent(in) :: boundaries(:)
    !> (boundaries) [m]
    real(dp), intent(in) :: lever(:)
    type(physics_t), intent(in) :: physics
    !> [s]; the way is negative towards the past [m]
    real(dp), intent(in) :: time, way
    real(dp) :: left, near, far, start, duration
    integer :: k

    mean = 0.0_dp
    if (.not. abs(way) > 0.0_dp) return
    left = abs(way)
    start = 0.0_dp
    near = difference_beside(nd, boundaries, lever, physics, time, 0.0_dp)
    duration = steps_beside*physics%h
    do k = 1, most_looks
      ! nothing moved before the first step
      if (way < 0.0_dp) duration = min(duration, time - start)
      if (.not. duration > 0.0_dp) return
      far = difference_beside(nd, boundaries, lever, physics, time, sign(start + duration, way))
      if (0.5_dp*(near + far)*duration >= left) exit
      left = left - 0.5_dp*(near + far)*duration
      start = start + duration
      near = far
      duration = start
    end do
    if (k > most_looks) return
    ! the part of this interval in which a difference that grows from `near` by (far - near)/duration makes what is left
    mean = abs(way)/(start + 2.0_dp*left/(near + sqrt(near**2 + 2.0_dp*left*(far - near)/duration)))
  end function mean_difference

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
