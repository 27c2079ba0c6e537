!> Motion of grains and boundaries over a step: to the middle, by drives, and to the end (gravier_motion has the rule).
module gravier_body_motion
  use gravier_kinds, only: dp
  use gravier_time_table, only: time_table_t
  use gravier_orientation, only: turn_orientation
  use gravier_motion, only: predict_position, advance_position
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_load_areas, only: facing_area
  use gravier_boundary_loads, only: carry_glued, set_glued_velocities
  implicit none
  private
  public :: move_to_middle, drive, move_to_end

  !> part of a step by which times that are written in decimals are before those of steps
  real(dp), parameter :: rounded = 1.0e-6_dp

contains

  !> q_m of grains and boundaries; boundaries whose time has come are taken away.
  subroutine move_to_middle(decomposition, physics, theta, time, some_glued, taken_away)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    !> of the end of the step in positions; time at its start [s]
    real(dp), intent(in) :: theta, time
    !> grains are glued to boundaries
    logical, intent(in) :: some_glued
    !> whether a boundary was taken away
    logical, intent(out) :: taken_away
    real(dp) :: part
    integer :: s, b, k, r, nd

    taken_away = .false.
    nd = decomposition%nd
    part = (1.0_dp - theta)*physics%h
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do r = 1, owned%awake%n
          do k = owned%awake%first(r), owned%awake%last(r)
            if (owned%glued(k) == 0) owned%position(:, k) = predict_position(owned%position(:, k), owned%velocity(1:nd, k), &
              & physics%h, theta)
          end do
        end do
        if (owned%no > 0) call turn_bodies(owned, part)
      end associate
    end do
    if (some_glued) call carry_glued(decomposition, part)
    call decomposition%period%move(part)
    do b = 1, size(decomposition%boundaries)
      associate (boundary => decomposition%boundaries(b))
        call boundary%move(part)
        if (.not. boundary%present .or. time + rounded*physics%h < boundary%remove_at) cycle
        boundary%present = .false.
        taken_away = .true.
      end associate
    end do
  end subroutine move_to_middle

  !> Turn the free bodies for a time at the spins that they have.
  pure subroutine turn_bodies(bodies, duration)
    type(body_set_t), intent(inout) :: bodies
    !> [s]
    real(dp), intent(in) :: duration
    integer :: k, r

    do r = 1, bodies%awake%n
      do k = bodies%awake%first(r), bodies%awake%last(r)
        if (bodies%glued(k) == 0) call turn_orientation(bodies%orientation(:, k), bodies%velocity(bodies%nd + 1:, k), duration)
      end do
    end do
  end subroutine turn_bodies

  !> Gravity in the step, and the velocities of boundaries at its end without contacts.
  subroutine drive(decomposition, physics, gravity_table, time, changed)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(inout) :: physics
    type(time_table_t), intent(in) :: gravity_table
    !> at the start of the step [s]
    real(dp), intent(in) :: time
    !> whether gravity has changed, or the load of a boundary
    logical, intent(out) :: changed
    real(dp) :: force(decomposition%nd), end_time
    integer :: b, d, nd

    changed = .false.
    nd = decomposition%nd
    end_time = time + physics%h
    if (allocated(gravity_table%has)) then
      do d = 1, nd
        if (.not. gravity_table%has(d)) cycle
        physics%gravity(d) = gravity_table%load_of(d, end_time, physics%h)
        changed = changed .or. abs(physics%gravity(d) - gravity_table%load_of(d, time, physics%h)) > 0.0_dp
      end do
    end if
    do b = 1, size(decomposition%boundaries)
      associate (boundary => decomposition%boundaries(b))
        boundary%last_velocity(:) = boundary%velocity
        boundary%last_spin(:) = boundary%spin
        call boundary%prescribe(nd, end_time, physics%h)
        if (.not. boundary%is_driven()) cycle
        changed = changed .or. boundary%load_changes(end_time, physics%h)
        call boundary%applied_force(nd, end_time, physics%h, facing_area(decomposition, b), force)
        do d = 1, nd
          if (boundary%free(d)) boundary%velocity(d) = boundary%velocity(d) + physics%h*force(d)/boundary%mass
        end do
      end associate
    end do
  end subroutine drive

  !> q_{i+1} of grains and boundaries.
  subroutine move_to_end(decomposition, physics, theta, some_glued)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    real(dp), intent(in) :: theta
    logical, intent(in) :: some_glued
    integer :: s, b, k, r, nd

    nd = decomposition%nd
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do r = 1, owned%awake%n
          do k = owned%awake%first(r), owned%awake%last(r)
            if (owned%glued(k) == 0) owned%position(:, k) = advance_position(owned%position(:, k), owned%velocity(1:nd, k), &
              & physics%h, theta)
          end do
        end do
        if (owned%no > 0) call turn_bodies(owned, theta*physics%h)
      end associate
    end do
    if (some_glued) call carry_glued(decomposition, theta*physics%h)
    call decomposition%period%move(theta*physics%h)
    do b = 1, size(decomposition%boundaries)
      call decomposition%boundaries(b)%move(theta*physics%h)
    end do
    if (some_glued) call set_glued_velocities(decomposition)
  end subroutine move_to_end

end module gravier_body_motion
