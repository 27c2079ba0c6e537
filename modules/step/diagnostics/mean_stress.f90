!> The mean stress of a scene and the share of space that grains fill.
module gravier_mean_stress
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_contact_branch, only: find_branch
  use gravier_scene_extent, only: find_extent, share_inside
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: mean_stress_t, sum_moments

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
    real(dp) :: parts(1, size(problem%sub)), filled(1)
    real(dp), dimension(decomposition%nd) :: low, high, length
    real(dp), allocatable :: moments(:)
    integer :: s, k, nd

    nd = decomposition%nd
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          parts(1, s) = parts(1, s) + decomposition%figures%volume_of(owned, k)
        end do
      end associate
    end do
    call decomposition%comm%sum_parts(parts, filled)
    call sum_moments(problem, moments)
    call find_extent(decomposition, .true., low, high, length)
    self%volume = product(length)*share_inside(decomposition%boundaries, low, high)
    do k = 1, nd
      self%stress(:, k) = moments((k - 1)*nd + 1:k*nd)
    end do
    self%solid_fraction = filled(1)
    if (.not. self%volume > 0.0_dp) return
    self%stress(:, :) = self%stress/(h*self%volume)
    self%solid_fraction = self%solid_fraction/self%volume
  end subroutine measure_stress

  !> Sum of p l^T over all contacts, column by column (nd**2) [N m s]. Collective.
  subroutine sum_moments(problem, moments)
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable, intent(out) :: moments(:)
    real(dp) :: parts(problem%nd**2, size(problem%sub))
    integer :: s

    allocate (moments(problem%nd**2))
    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      call add_contacts(problem, s, parts(:, s))
    end do
    call problem%comm%sum_parts(parts, moments)
  end subroutine sum_moments

  !> Add p l^T of the contacts of a subdomain, column by column.
  pure subroutine add_contacts(problem, s, part)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> (nd**2) [N m s]
    real(dp), intent(inout) :: part(:)
    real(dp) :: p(problem%nd), branch(problem%nd)
    integer :: c, d, nd

    nd = problem%nd
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
