!> How each boundary moves, and the power that it gives to the grains.
module gravier_boundary_power
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_boundary_push, only: find_earlier, find_mean_velocities, find_push
  use gravier_boundary_forces, only: name_in_columns
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, name_length
  implicit none
  private
  public :: boundary_power_t

  !> Of each boundary, the same on every rank.
  type, extends(diagnostic_t) :: boundary_power_t
    !> as columns can have them (boundaries)
    character(len=name_length), private, allocatable :: name(:)
    !> of its point at the end of the step (nd, boundaries) [m/s], and its spin there: about the third axis in 2D, about three in 3D
    !> (1 or 3, boundaries) [rad/s]; 0 once it is removed
    real(dp), private, allocatable :: velocity(:, :), spin(:, :)
    !> mean of the step: work on the grains over the step (boundaries) [W]
    real(dp), allocatable :: power(:)
  contains
    procedure, nopass :: features => boundary_power_features
    procedure :: begin => boundary_power_begin
    procedure :: take_step => boundary_power_take_step
    procedure :: measure => boundary_power_measure
    procedure :: columns => boundary_power_columns
  end type boundary_power_t

contains

  pure function boundary_power_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "boundary_power"
    features%meaning = "write velocity, spin and power of each boundary"
    features%of_scene = .false.
  end function boundary_power_features

  !> Take the names of the boundaries.
  subroutine boundary_power_begin(self, decomposition, physics)
    class(boundary_power_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    integer :: b, n

    associate (boundaries => decomposition%boundaries, nd => decomposition%nd, unused => physics)
      n = size(boundaries)
      allocate (self%name(n))
      allocate (self%velocity(nd, n), self%spin(2*nd - 3, n), self%power(n), source=0.0_dp)
      do b = 1, n
        self%name(b) = name_in_columns(boundaries(b)%name)
        call take_motion(self, b, boundaries(b))
      end do
    end associate
  end subroutine boundary_power_begin

  !> Velocity and spin of boundary `b`.
  pure subroutine take_motion(self, b, boundary)
    type(boundary_power_t), intent(inout) :: self
    integer, intent(in) :: b
    type(boundary_t), intent(in) :: boundary
    real(dp) :: place(3)

    self%velocity(:, b) = 0.0_dp
    self%spin(:, b) = 0.0_dp
    if (.not. boundary%present) return
    call boundary%find_place(place)
    call boundary%velocity_at(place(1:size(self%velocity, 1)), self%velocity(:, b))
    self%spin(:, b) = boundary%spin(4 - size(self%spin, 1):3)
  end subroutine take_motion

  !> Sum the works at the contacts, impulse times mean velocity of the boundary where it touches and moment times mean spin, the
  !> same whatever the number of ranks. Collective.
  subroutine boundary_power_take_step(self, step)
    class(boundary_power_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    type(boundary_t) :: earlier(size(self%power))
    real(dp) :: parts(size(self%power), size(step%problem%sub))
    integer :: s

    if (size(self%power) == 0) return
    call find_earlier(step, earlier)
    parts(:, :) = 0.0_dp
    do s = 1, size(step%problem%sub)
      call add_works(step, earlier, s, parts(:, s))
    end do
    call step%decomposition%comm%sum_parts(parts, self%power)
    self%power(:) = self%power/step%physics%h
  end subroutine boundary_power_take_step

  !> Works on the grains at the contacts of a subdomain, by boundary [J].
  subroutine add_works(step, earlier, s, work)
    type(solved_step_t), intent(in) :: step
    !> boundaries with the velocities of the start of the step
    type(boundary_t), intent(in) :: earlier(:)
    integer, intent(in) :: s
    !> (boundaries)
    real(dp), intent(inout) :: work(:)
    real(dp) :: p(step%problem%nd), m(step%problem%nv - step%problem%nd)
    real(dp), allocatable :: mean(:, :)
    integer :: c, b, column

    associate (sub => step%problem%sub(s), nd => step%problem%nd)
      allocate (mean(step%problem%nv, sub%n_columns))
      call find_mean_velocities(step, s, earlier, mean)
      do c = 1, sub%n_contacts
        if (all(sub%pair(:, c) <= sub%n_grains)) cycle
        call find_push(step%problem, s, c, column, p, m)
        b = sub%boundary(column)
        work(b) = work(b) + (sum(p*mean(1:nd, column)) + sum(m*mean(nd + 1:, column)))
      end do
    end associate
  end subroutine add_works

  subroutine boundary_power_measure(self, step)
    class(boundary_power_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    integer :: b

    do b = 1, size(self%power)
      call take_motion(self, b, step%decomposition%boundaries(b))
    end do
  end subroutine boundary_power_measure

  subroutine boundary_power_columns(self, list)
    class(boundary_power_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    character(len=*), parameter :: axes = "xyz"
    integer :: b, d, axis

    do b = 1, size(self%power)
      do d = 1, size(self%velocity, 1)
        call list%add("velocity_"//axes(d:d)//":"//trim(self%name(b)), self%velocity(d, b))
      end do
      do d = 1, size(self%spin, 1)
        axis = 3 - size(self%spin, 1) + d
        call list%add("spin_"//axes(axis:axis)//":"//trim(self%name(b)), self%spin(d, b))
      end do
      call list%add("power:"//trim(self%name(b)), self%power(b))
    end do
  end subroutine boundary_power_columns

end module gravier_boundary_power
