!> Where grains are at some instants of a run: states to compare, and motions that are known exactly.
module gravier_accuracy_motion
  use gravier_known_column, only: what_else_acts
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: state_t, distance_t, exact_motion_t, take_state, compare_states, unknown

  !> an error that is not known
  real(dp), parameter :: unknown = -1.0_dp
  !> speed of a ball that rests, relative to that of its first shock
  real(dp), parameter :: rest = 1.0e-9_dp

  !> All grains of a scene in the order of their identifiers, in blocks over the ranks.
  type :: state_t
    integer :: nd = 2
    integer(i8), allocatable :: id(:)
    !> places, without leaps in periodic scenes, and velocities of translation (2 nd, n) [m, m/s]
    real(dp), allocatable :: motion(:, :)
  end type state_t

  !> How far states of two runs are from each other; `unknown` where they have not the same grains.
  type :: distance_t
    !> root of the mean square over all grains, and largest [m]; root of the mean square [m/s]
    real(dp) :: position = unknown, position_max = unknown, velocity = unknown
  end type distance_t

  !> The motion of a column, which rests, or of one grain that falls upon a plane.
  type :: exact_motion_t
    type(state_t) :: start
    !> out of the plane; zero for what rests
    real(dp), allocatable :: normal(:)
    !> distance from the plane, speed away from it, gravity towards it [m, m/s, m/s^2]
    real(dp) :: gap = 0.0_dp, speed = 0.0_dp, gravity = 0.0_dp
    real(dp) :: restitution = 0.0_dp
  contains
    procedure :: init => exact_motion_init
    procedure :: at => exact_motion_at
  end type exact_motion_t

contains

  !> The grains as they are. Collective.
  subroutine take_state(simulation, state)
    type(simulation_t), intent(in) :: simulation
    type(state_t), intent(out) :: state
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: motion(:, :)
    integer :: s, k, n, nd

    nd = simulation%decomposition%nd
    allocate (records(1 + 2*nd, sum(simulation%decomposition%owned%n)), motion(2*nd, sum(simulation%decomposition%owned%n)))
    n = 0
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          n = n + 1
          records(1, n) = owned%id(k)
          motion(1:nd, n) = owned%position(:, k)
          if (owned%ni > 0) motion(1:nd, n) = motion(1:nd, n) + owned%image(:, k)*simulation%decomposition%period%length(1:nd)
          motion(nd + 1:, n) = owned%velocity(1:nd, k)
        end do
      end associate
    end do
    call pack_reals(2*nd, motion, 2, records)
    call order_rows(simulation%comm, 1, records, ordered)
    state%nd = nd
    state%id = ordered(1, :)
    call unpack_reals(ordered, 2, 2*nd, state%motion)
  end subroutine take_state

  !> Distance over states at the same instants. Collective.
  subroutine compare_states(comm, states, others, distance)
    type(communicator_t), intent(in) :: comm
    type(state_t), intent(in) :: states(:), others(:)
    type(distance_t), intent(out) :: distance
    real(dp), allocatable :: parts(:, :)
    real(dp) :: sums(2), largest
    integer :: i, n, k, nd
    logical :: differ

    if (size(states) == 0 .or. size(states) /= size(others)) return
    differ = .false.
    do i = 1, size(states)
      differ = differ .or. size(states(i)%id) /= size(others(i)%id)
      if (.not. differ) differ = any(states(i)%id /= others(i)%id)
    end do
    if (comm%any_true(differ)) return
    nd = states(1)%nd
    n = 0
    do i = 1, size(states)
      n = n + size(states(i)%id)
    end do
    allocate (parts(2, n))
    largest = 0.0_dp
    n = 0
    do i = 1, size(states)
      do k = 1, size(states(i)%id)
        n = n + 1
        parts(1, n) = sum((states(i)%motion(1:nd, k) - others(i)%motion(1:nd, k))**2)
        parts(2, n) = sum((states(i)%motion(nd + 1:, k) - others(i)%motion(nd + 1:, k))**2)
        largest = max(largest, parts(1, n))
      end do
    end do
    call comm%sum_parts(parts, sums)
    sums(:) = sums/real(max(comm%total(int(n, i8)), 1_i8), dp)
    distance%position = sqrt(sums(1))
    distance%position_max = sqrt(comm%highest(largest))
    distance%velocity = sqrt(sums(2))
  end subroutine compare_states

  !> Whether the motion of a scene that has not moved yet is known, and what it is. Collective.
  subroutine exact_motion_init(self, simulation, known)
    class(exact_motion_t), intent(out) :: self
    type(simulation_t), intent(in) :: simulation
    logical, intent(out) :: known
    integer :: nd

    nd = simulation%decomposition%nd
    call take_state(simulation, self%start)
    allocate (self%normal(nd), source=0.0_dp)
    known = simulation%config%scene%bodies == "column"
    if (known) then
      associate (gravity => simulation%config%scene%gravity(1:nd))
        known = what_else_acts(simulation%config) == "" .and. gravity(nd) < 0.0_dp .and. .not. any(abs(gravity(1:nd - 1)) > 0.0_dp)
      end associate
    else
      call find_fall(self, simulation, known)
    end if
  end subroutine exact_motion_init

  !> One free grain over one plane at rest, gravity and velocity along its normal. Collective.
  subroutine find_fall(motion, simulation, known)
    type(exact_motion_t), intent(inout) :: motion
    type(simulation_t), intent(in) :: simulation
    logical, intent(out) :: known
    !> gap, speed away from the plane and towards it, and what must not be: an overlap, other speeds
    real(dp) :: along(4), gap, speed
    integer :: s, nd

    nd = motion%start%nd
    associate (boundaries => simulation%decomposition%boundaries, scene => simulation%config%scene)
      known = simulation%n_grains == 1 .and. simulation%n_glued == 0 .and. size(boundaries) == 1 .and. &
        & size(simulation%config%laws) + size(simulation%config%insertions) == 0 .and. &
        & scene%gravity_table == "" .and. .not. any(abs(scene%body_force) > 0.0_dp) .and. .not. simulation%decomposition%period%on()
      if (known) known = boundaries(1)%is_plane() .and. .not. boundaries(1)%is_driven() .and. &
        & boundaries(1)%remove_at >= huge(1.0_dp) .and. .not. boundaries(1)%drive%moves() .and. &
        & .not. any(abs(boundaries(1)%velocity) > 0.0_dp) .and. .not. any(abs(boundaries(1)%spin) > 0.0_dp)
      if (.not. known) return
      motion%normal(:) = boundaries(1)%surface%axis(1:nd)
      motion%gravity = -dot_product(scene%gravity(1:nd), motion%normal)
      motion%restitution = boundaries(1)%contact%restitution
      ! the rank that has the grain tells the others
      along(:) = 0.0_dp
      do s = 1, size(simulation%decomposition%owned)
        associate (owned => simulation%decomposition%owned(s))
          if (owned%n == 0) cycle
          gap = dot_product(owned%position(:, 1) - boundaries(1)%surface%point(1:nd), motion%normal) - owned%radius(1)
          speed = dot_product(owned%velocity(1:nd, 1), motion%normal)
          along(1) = max(gap, 0.0_dp)
          along(2) = max(speed, 0.0_dp)
          along(3) = max(-speed, 0.0_dp)
          along(4) = max(-gap, 0.0_dp) + norm2(owned%velocity(1:nd, 1) - speed*motion%normal) + sum(abs(owned%velocity(nd + 1:, 1)))
        end associate
      end do
      call simulation%comm%highest_of(along)
      motion%gap = along(1)
      motion%speed = along(2) - along(3)
      known = motion%gravity > 0.0_dp .and. .not. along(4) > 0.0_dp .and. &
        & norm2(scene%gravity(1:nd) + motion%gravity*motion%normal) <= 1.0e-12_dp*motion%gravity
    end associate
  end subroutine find_fall

  !> The state at a time.
  subroutine exact_motion_at(self, time, state)
    class(exact_motion_t), intent(in) :: self
    !> since the start [s]
    real(dp), intent(in) :: time
    type(state_t), intent(out) :: state
    real(dp) :: gap, speed
    integer :: k, nd

    state = self%start
    if (.not. any(abs(self%normal) > 0.0_dp)) return
    nd = state%nd
    gap = self%gap
    speed = self%speed
    call fall(self%gravity, self%restitution, time, gap, speed)
    do k = 1, size(state%id)
      state%motion(1:nd, k) = state%motion(1:nd, k) + (gap - self%gap)*self%normal
      state%motion(nd + 1:, k) = speed*self%normal
    end do
  end subroutine exact_motion_at

  !> A point that falls upon a plane and leaves it with a part of its speed, after a time.
  pure subroutine fall(gravity, restitution, time, gap, speed)
    !> [m/s^2], [s]
    real(dp), intent(in) :: gravity, restitution, time
    !> [m, m/s]
    real(dp), intent(inout) :: gap, speed
    real(dp) :: left, shock, first, flight

    left = time
    first = sqrt(speed**2 + 2.0_dp*gravity*gap)
    do
      shock = sqrt(speed**2 + 2.0_dp*gravity*gap)
      if (shock <= rest*first) then
        gap = 0.0_dp
        speed = 0.0_dp
        return
      end if
      flight = (speed + shock)/gravity
      if (flight >= left) exit
      left = left - flight
      gap = 0.0_dp
      speed = restitution*shock
    end do
    gap = gap + speed*left - 0.5_dp*gravity*left**2
    speed = speed - gravity*left
  end subroutine fall

end module gravier_accuracy_motion
