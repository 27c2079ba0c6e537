!> How far a scene moves in the steps whose motion is not told from the errors of their solves. Such motion may be nothing but
!> errors of one sign, each within the accuracy. Ways are added up with their sense, so that what goes to and fro counts for
!> nothing: of the centre of mass of the free grains, of their spread about it, of the boundaries and of the cell that forces move.
!>
!> Velocities are those beside what all boundaries have in common. Where the bodies move as a whole, and by more than the errors of
!> solves, that is motion and no error. What moves then against the bodies may be error as before: the spread, and the way of
!> boundaries against the centre of mass.
!>
!> Bodies that move while most of the others rest do not hide the errors of these: where bodies with half of the mass of all that
!> are awake are slow, and move by less than the errors of solves in the mean, the step counts for them.
!>
!> The spread is that of a uniform velocity gradient, A = sum m (v - v_c) (x - x_c)^T/(M R), with the centre of mass c, the mass M
!> and the radius of gyration R of the grains. Its norm is at most the root mean square of v - v_c. Along periodic axes grains have
!> no place; there the cell may creep, at the velocity gradient times its edges.
!>
!> As the longest of these ways grows, solves aim at less error (gravier_refinement), and the ways end before they can be seen.
module gravier_drift
  use gravier_kinds, only: dp, i8
  use gravier_body_store, only: body_set_t
  use gravier_solve_report, only: solve_report_t, solve_converged
  use gravier_decomposition, only: decomposition_t
  use gravier_moving_cell, only: cell_motion_t
  use gravier_physics, only: physics_t
  use gravier_velocity_scale, only: velocity_scale_t
  implicit none
  private
  public :: drift_t, drift_words, drift_record, most_drift

  !> errors of its solve below which the motion of a step is not told from them
  real(dp), parameter :: unresolved_times = 2.0_dp
  !> Diameters by which a scene may move in such steps before it can be seen. From `free_part` of that on, solves aim at half of the
  !> error for each `halving_part`, down to the least share of the goal.
  real(dp), parameter :: most_drift = 0.01_dp, free_part = 0.4_dp, halving_part = 0.04_dp, least_share = 1.0e-3_dp
  !> times the errors of solves above which a grain is in the air, and a boundary moves freely
  real(dp), parameter :: in_air = 10.0_dp
  !> part of the mass of the bodies that are awake which has to rest where others move
  real(dp), parameter :: most_of_all = 0.5_dp

  !> ways: of the centre of mass, of the spread, of the cell; those of boundaries come behind them
  integer, parameter :: of_centre = 1, of_spread = 2, of_cell = 3
  !> terms of the sums over grains that are slow: m, m x, m v, m x^2, m v x^T, m v^2; and m of all that are awake
  integer, parameter :: in_mass = 1, in_place = 1, in_momentum = 4, in_square = 7, in_product = 10, in_energy = 20, in_all = 21, &
    & n_sums = 21

  !> its state, in words: the version of checkpoints, which changes with it
  character(len=*), parameter :: drift_record = "steps slow way"

  type :: drift_t
    !> steps whose motion is not told from errors, since the first step
    integer(i8) :: steps = 0
    !> root mean square velocity of the slow bodies in the last such step, where others moved; negative where none did [m/s]
    real(dp), private :: slow = -1.0_dp
    !> ways in these steps; vectors have three components, gradients nine by columns (9, ways) [m]
    real(dp), allocatable, private :: way(:, :)
  contains
    procedure :: note => drift_note
    procedure :: length => drift_length
    procedure :: goal_share => drift_goal_share
    procedure :: get_state => drift_get_state
    procedure :: set_state => drift_set_state
  end type drift_t

contains

  !> Words of the state of a drift.
  pure integer function drift_words(n_boundaries)
    integer, intent(in) :: n_boundaries
    drift_words = 2 + 9*(of_cell + n_boundaries)
  end function drift_words

  !> Add the ways of a step that has ended, if its solve has converged and the motion of its bodies against each other, or of most
  !> of them, is not told from the error of the solve. Collective.
  subroutine drift_note(self, decomposition, physics, impulses, mass, scale, solve)
    class(drift_t), intent(inout) :: self
    !> with the velocities of the end of the step
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> of the contacts on the boundaries (nd, boundaries) [N s]
    real(dp), intent(in) :: impulses(:, :)
    !> of the free grains [kg]
    real(dp), intent(in) :: mass
    !> of the step
    type(velocity_scale_t), intent(in) :: scale
    type(solve_report_t), intent(in) :: solve
    real(dp) :: velocity(9), spread(9), edge_velocity(9), frame(3), most, slow
    logical :: all_rest, as_a_whole
    integer :: b

    if (solve%status /= solve_converged) return
    most = unresolved_times*solve%velocity_error
    all_rest = scale%apart < most
    as_a_whole = all_rest .and. .not. scale%own < most
    frame(:) = scale%frame
    if (as_a_whole) frame(:) = scale%frame + scale%mean
    slow = -1.0_dp
    if (mass > 0.0_dp) call find_motion(decomposition, mass, frame, most, velocity, spread, slow)
    self%slow = -1.0_dp
    if (.not. all_rest) then
      if (slow < 0.0_dp .or. .not. slow < most) return
      self%slow = slow
    end if
    self%steps = self%steps + 1
    if (.not. allocated(self%way)) allocate (self%way(9, of_cell + size(decomposition%boundaries)), source=0.0_dp)
    if (mass > 0.0_dp) then
      if (as_a_whole) then
        ! loads of the step have changed the mean velocity
        frame(:) = frame + velocity(1:3)
      else
        call add_way(velocity, physics%h, most, self%way(:, of_centre))
      end if
      call add_way(spread, physics%h, most, self%way(:, of_spread))
    end if
    if (physics%cell%is_driven) then
      call find_edge_velocity(decomposition%period%length, physics%cell, edge_velocity)
      call add_way(edge_velocity, physics%h, most, self%way(:, of_cell))
    end if
    velocity(:) = 0.0_dp
    do b = 1, size(decomposition%boundaries)
      ! one that bears nothing moves freely
      if (.not. any(abs(impulses(:, b)) > 0.0_dp)) cycle
      associate (boundary => decomposition%boundaries(b))
        velocity(1:3) = merge(boundary%velocity - frame, 0.0_dp, boundary%free)
      end associate
      if (norm2(velocity) > in_air*most) cycle
      call add_way(velocity, physics%h, most, self%way(:, of_cell + b))
    end do
  end subroutine drift_note

  !> Add the way of a step at a velocity, of which no more counts than the errors may be.
  pure subroutine add_way(velocity, h, most, way)
    !> (9) [m/s], [s], [m/s]
    real(dp), intent(in) :: velocity(:), h, most
    !> (9) [m]
    real(dp), intent(inout) :: way(:)
    real(dp) :: speed

    speed = norm2(velocity)
    way(:) = way + (h*min(1.0_dp, most/max(speed, most)))*velocity
  end subroutine add_way

  !> Velocity of the centre of mass and of the spread of the free grains that are slow. Collective.
  subroutine find_motion(decomposition, mass, frame, most, velocity, spread, slow)
    type(decomposition_t), intent(in) :: decomposition
    !> of the free grains [kg]; velocity of the observer, and what errors may be [m/s]
    real(dp), intent(in) :: mass, frame(3), most
    !> (9) [m/s]
    real(dp), intent(out) :: velocity(9), spread(9)
    !> their root mean square velocity, where they are most of those that are awake; else -1 [m/s]
    real(dp), intent(out) :: slow
    real(dp) :: parts(n_sums, size(decomposition%owned)), sums(n_sums), square
    logical :: open(3)
    integer :: s, d, e, nd

    nd = decomposition%nd
    open(:) = .not. decomposition%period%length > 0.0_dp
    open(nd + 1:) = .false.
    parts(:, :) = 0.0_dp
    do s = 1, size(parts, 2)
      call add_grains(decomposition%owned(s), open, frame, most, parts(:, s))
    end do
    call decomposition%comm%sum_parts(parts, sums)
    velocity(:) = 0.0_dp
    spread(:) = 0.0_dp
    slow = -1.0_dp
    if (.not. sums(in_mass) > 0.0_dp) return
    if (sums(in_mass) >= most_of_all*sums(in_all)) slow = sqrt(sums(in_energy)/sums(in_mass))
    velocity(1:3) = sums(in_momentum + 1:in_momentum + 3)/mass
    square = 0.0_dp
    do d = 1, nd
      square = square + max(0.0_dp, sums(in_square + d) - sums(in_place + d)**2/sums(in_mass))
    end do
    if (.not. square > 0.0_dp) return
    do e = 1, nd
      if (.not. open(e)) cycle
      do d = 1, nd
        spread(3*(e - 1) + d) = (sums(in_product + 3*(e - 1) + d) - sums(in_momentum + d)*sums(in_place + e)/sums(in_mass))/ &
          & sqrt(square*mass)
      end do
    end do
  end subroutine find_motion

  !> Sums over the free grains that are owned by a subdomain; those that sleep, or that are so fast that they are in the air, have
  !> no part in them.
  pure subroutine add_grains(bodies, open, frame, most, part)
    type(body_set_t), intent(in) :: bodies
    !> axes along which grains have a place
    logical, intent(in) :: open(3)
    !> velocity of the observer, and what errors may be [m/s]
    real(dp), intent(in) :: frame(3), most
    real(dp), intent(inout) :: part(n_sums)
    real(dp) :: v(bodies%nd)
    integer :: k, r, d, e

    do r = 1, bodies%awake%n
      do k = bodies%awake%first(r), bodies%awake%last(r)
        if (bodies%glued(k) > 0) cycle
        part(in_all) = part(in_all) + bodies%mass(k)
        v(:) = bodies%velocity(1:bodies%nd, k) - frame(1:bodies%nd)
        if (norm2(v) > in_air*most) cycle
        associate (m => bodies%mass(k), nd => bodies%nd)
          part(in_mass) = part(in_mass) + m
          part(in_energy) = part(in_energy) + m*sum(v**2)
          do d = 1, nd
            part(in_momentum + d) = part(in_momentum + d) + m*v(d)
          end do
          do e = 1, nd
            if (.not. open(e)) cycle
            part(in_place + e) = part(in_place + e) + m*bodies%position(e, k)
            part(in_square + e) = part(in_square + e) + m*bodies%position(e, k)**2
            do d = 1, nd
              part(in_product + 3*(e - 1) + d) = part(in_product + 3*(e - 1) + d) + m*v(d)*bodies%position(e, k)
            end do
          end do
        end associate
      end do
    end do
  end subroutine add_grains

  !> Velocity at which edges of a cell go on that stresses move, by the components of the gradient.
  pure subroutine find_edge_velocity(length, cell, velocity)
    !> of the cell (3) [m]
    real(dp), intent(in) :: length(3)
    type(cell_motion_t), intent(in) :: cell
    !> (9) [m/s]
    real(dp), intent(out) :: velocity(9)
    integer :: d, e

    do e = 1, 3
      do d = 1, 3
        velocity(3*(e - 1) + d) = merge(cell%now(d, e)*length(e), 0.0_dp, cell%driven(d, e))
      end do
    end do
  end subroutine find_edge_velocity

  !> The longest of the ways [m].
  pure real(dp) function drift_length(self) result(length)
    class(drift_t), intent(in) :: self
    integer :: w

    length = 0.0_dp
    if (.not. allocated(self%way)) return
    do w = 1, size(self%way, 2)
      length = max(length, norm2(self%way(:, w)))
    end do
  end function drift_length

  !> The share of its goal that a solve should aim at: no less than that which it has in a scene without loads and drives, where
  !> errors are compared with the motion alone.
  pure real(dp) function drift_goal_share(self, scale) result(share)
    class(drift_t), intent(in) :: self
    !> of the step
    type(velocity_scale_t), intent(in) :: scale
    real(dp) :: halvings, apart

    share = 1.0_dp
    if (self%steps == 0 .or. .not. (scale%diameter > 0.0_dp .and. scale%value > 0.0_dp)) return
    halvings = (self%length()/(most_drift*scale%diameter) - free_part)/halving_part
    if (.not. halvings > 0.0_dp) return
    apart = scale%apart
    if (self%slow >= 0.0_dp) apart = min(apart, self%slow)
    share = min(1.0_dp, max(least_share, 2.0_dp**(-min(halvings, 64.0_dp)), scale%share*apart/scale%value))
  end function drift_goal_share

  pure subroutine drift_get_state(self, words)
    class(drift_t), intent(in) :: self
    !> drift_words
    integer(i8), intent(out) :: words(:)
    integer :: d, w

    words(:) = 0
    words(1) = self%steps
    words(2) = transfer(self%slow, 0_i8)
    if (.not. allocated(self%way)) return
    do w = 1, size(self%way, 2)
      do d = 1, 9
        words(2 + 9*(w - 1) + d) = transfer(self%way(d, w), 0_i8)
      end do
    end do
  end subroutine drift_get_state

  pure subroutine drift_set_state(self, words)
    class(drift_t), intent(inout) :: self
    !> drift_words
    integer(i8), intent(in) :: words(:)
    integer :: d, w

    self%steps = words(1)
    self%slow = transfer(words(2), 0.0_dp)
    if (allocated(self%way)) deallocate (self%way)
    if (self%steps == 0) return
    allocate (self%way(9, (size(words) - 2)/9))
    do w = 1, size(self%way, 2)
      do d = 1, 9
        self%way(d, w) = transfer(words(2 + 9*(w - 1) + d), 0.0_dp)
      end do
    end do
  end subroutine drift_set_state

end module gravier_drift
