!> The mean stress of a scene and the share of space that grains fill.
module gravier_mean_stress
  use gravier_kinds, only: dp
  use gravier_orientation, only: orientation_matrix
  use gravier_shape_library, only: shape_library_t
  use gravier_body_store, only: body_set_t
  use gravier_facing_planes, only: find_facing_planes
  use gravier_contact_kernels, only: kernels_t, contact_arms, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: mean_stress_t

  !> The same on every rank.
  type, extends(diagnostic_t) :: mean_stress_t
    !> of the contact forces, compression positive; row: force, column: branch (nd, nd) [Pa, N/m in 2D]
    real(dp), allocatable :: stress(:, :)
    !> of the space that the scene takes [m^3, m^2 in 2D]
    real(dp) :: volume = 0.0_dp
    real(dp) :: solid_fraction = 0.0_dp
  contains
    procedure, nopass :: features => mean_stress_features
    procedure :: begin => mean_stress_begin
    procedure :: measure => mean_stress_measure
    procedure :: columns => mean_stress_columns
    procedure :: pressure => mean_stress_pressure
  end type mean_stress_t

contains

  pure function mean_stress_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "stress"
    features%meaning = "write the mean stress and the solid fraction"
  end function mean_stress_features

  subroutine mean_stress_begin(self, decomposition, physics)
    class(mean_stress_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics

    associate (unused => physics)
    end associate
    allocate (self%stress(decomposition%nd, decomposition%nd), source=0.0_dp)
  end subroutine mean_stress_begin

  subroutine mean_stress_columns(self, list)
    class(mean_stress_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list

    call list%add_tensor("stress", self%stress)
    call list%add("pressure", self%pressure())
    call list%add("volume", self%volume)
    call list%add("solid_fraction", self%solid_fraction)
  end subroutine mean_stress_columns

  !> Measure a step at its end, whose places are those of the grains. Collective.
  subroutine mean_stress_measure(self, step)
    class(mean_stress_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    call measure_stress(self, step%decomposition, step%problem, step%physics%h)
  end subroutine mean_stress_measure

  !> Stress of the impulses of a step (Weber 1966), sigma = (1/(h V)) sum over the contacts of p l^T: p the impulse on the
  !> candidate, l the branch from the antagonist to the candidate at q_m, or from the place of contact to the grain where
  !> a boundary takes part. Places are those of the end of the step. Collective.
  subroutine measure_stress(self, decomposition, problem, h)
    type(mean_stress_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    !> [s]
    real(dp), intent(in) :: h
    real(dp) :: parts(decomposition%nd**2 + 1, size(problem%sub)), sums(decomposition%nd**2 + 1)
    integer :: s, k, nd

    nd = decomposition%nd
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      call add_contacts(problem, s, parts(1:nd**2, s))
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          parts(nd**2 + 1, s) = parts(nd**2 + 1, s) + decomposition%figures%volume_of(owned, k)
        end do
      end associate
    end do
    call decomposition%comm%sum_parts(parts, sums)
    self%volume = volume_of(decomposition)
    do k = 1, nd
      self%stress(:, k) = sums((k - 1)*nd + 1:k*nd)
    end do
    self%solid_fraction = sums(nd**2 + 1)
    if (.not. self%volume > 0.0_dp) return
    self%stress(:, :) = self%stress/(h*self%volume)
    self%solid_fraction = self%solid_fraction/self%volume
  end subroutine measure_stress

  !> Add p l^T of the contacts of a subdomain, column by column.
  pure subroutine add_contacts(problem, s, part)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> (nd**2) [N m s]
    real(dp), intent(inout) :: part(:)
    real(dp) :: p(problem%kernels%nd), branch(problem%kernels%nd)
    integer :: c, d, nd

    nd = problem%kernels%nd
    associate (sub => problem%sub(s))
      do c = 1, sub%n_contacts
        call problem%impulse_on_candidate(s, c, p)
        call find_branch(problem%kernels, sub, c, branch)
        do d = 1, nd
          part((d - 1)*nd + 1:d*nd) = part((d - 1)*nd + 1:d*nd) + p*branch(d)
        end do
      end do
    end associate
  end subroutine add_contacts

  !> The branch of contact `c`, that part of it which lies outside boundaries [m]. Of disks and spheres it is along the normal.
  pure subroutine find_branch(kernels, sub, c, branch)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd)
    real(dp), intent(out) :: branch(:)
    real(dp) :: arm_i(kernels%nd), arm_j(kernels%nd), length
    integer :: k

    if (kernels%row%arm_i > 0) then
      call contact_arms(kernels, sub%hot, c, arm_i, arm_j)
      branch(:) = arm_j - arm_i
      return
    end if
    length = sub%gap(c)
    do k = 1, 2
      if (sub%pair(k, c) <= sub%n_grains) length = length + sub%radius(sub%pair(k, c))
    end do
    branch(:) = length*sub%hot(lane_of(c), 1:kernels%nd, block_of(c))
  end subroutine find_branch

  !> Volume that the scene takes: along each axis the period, or else the way between the planes that shut it in, with the
  !> outermost points of the grains in the place of planes that are not there. Collective.
  real(dp) function volume_of(decomposition) result(volume)
    type(decomposition_t), intent(in) :: decomposition
    real(dp) :: extremes(2*decomposition%nd), reach(2*decomposition%nd), low, high
    integer :: s, k, d, nd

    nd = decomposition%nd
    extremes(:) = -huge(1.0_dp)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          call find_reach(decomposition%shapes, owned, k, reach)
          extremes(1:nd) = max(extremes(1:nd), reach(1:nd) - owned%position(:, k))
          extremes(nd + 1:) = max(extremes(nd + 1:), reach(nd + 1:) + owned%position(:, k))
        end do
      end associate
    end do
    call decomposition%comm%highest_of(extremes)
    volume = 1.0_dp
    do d = 1, nd
      if (decomposition%period%length(d) > 0.0_dp) then
        volume = volume*decomposition%period%length(d)
        cycle
      end if
      call find_facing_planes(decomposition%boundaries, d, low, high)
      if (.not. low > -huge(1.0_dp)) low = -extremes(d)
      if (.not. high < huge(1.0_dp)) high = extremes(nd + d)
      volume = volume*max(high - low, 0.0_dp)
    end do
  end function volume_of

  !> How far body `k` reaches from its centre, against each axis and then along each [m].
  pure subroutine find_reach(shapes, bodies, k, reach)
    type(shape_library_t), intent(in) :: shapes
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (2 nd)
    real(dp), intent(out) :: reach(:)
    real(dp) :: axes(3, 3), at(bodies%nd)
    integer :: p, v, d, nd

    reach(:) = bodies%radius(k)
    if (bodies%no == 0) return
    if (bodies%shape(k) == 0) return
    nd = bodies%nd
    axes(:, :) = 0.0_dp
    if (nd == 2) then
      axes(1, 1) = cos(bodies%orientation(1, k))
      axes(2, 1) = sin(bodies%orientation(1, k))
      axes(1, 2) = -axes(2, 1)
      axes(2, 2) = axes(1, 1)
    else
      call orientation_matrix(bodies%orientation(:, k), axes)
    end if
    reach(:) = -huge(1.0_dp)
    associate (shape => shapes%shape(bodies%shape(k)))
      do p = 1, size(shape%piece)
        do v = 1, size(shape%piece(p)%vertex, 2)
          do d = 1, nd
            at(d) = sum(axes(d, 1:nd)*shape%piece(p)%vertex(:, v))
          end do
          reach(1:nd) = max(reach(1:nd), bodies%radius(k)*(shape%piece(p)%rounding - at))
          reach(nd + 1:) = max(reach(nd + 1:), bodies%radius(k)*(shape%piece(p)%rounding + at))
        end do
      end do
    end associate
  end subroutine find_reach

  !> Mean of the diagonal [Pa, N/m in 2D].
  pure real(dp) function mean_stress_pressure(self) result(pressure)
    class(mean_stress_t), intent(in) :: self
    integer :: d

    pressure = 0.0_dp
    do d = 1, size(self%stress, 1)
      pressure = pressure + self%stress(d, d)/size(self%stress, 1)
    end do
  end function mean_stress_pressure

end module gravier_mean_stress
