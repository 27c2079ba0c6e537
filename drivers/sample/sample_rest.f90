!> When the grains of a sample are at rest.
module gravier_sample_rest
  use gravier_kinds, only: dp
  use gravier_solve_report, only: solve_converged
  use gravier_load_areas, only: facing_area
  use gravier_simulation, only: simulation_t, step_figures_t
  implicit none
  private
  public :: rest_t

  !> steps in a row at rest
  integer, parameter :: steps_at_rest = 20
  !> by which the loads may be out of balance
  real(dp), parameter :: imbalance_allowed = 0.02_dp

  !> A step is one at rest when its solve converged, the mean kinetic energy of a grain, without the spins of disks and spheres, is
  !> below rest_tolerance m g R (settled) or rest_tolerance pressure R^nd (compacted), and the forces of the grains on the
  !> boundaries balance the loads:
  !> their sum the weight (settled); that on each free plane the pressure, and their sum nothing (compacted). Without the
  !> second condition grains that begin to fall, or wait for the planes to come, would be at rest. m and R are means.
  type :: rest_t
    logical :: compacted = .false.
    !> of the last step: mean kinetic energy over its scale, fraction of the loads that is not balanced, largest overlap [m]
    real(dp) :: energy = huge(1.0_dp), imbalance = 1.0_dp, overlap = 0.0_dp
    !> mean normal stress of the grains on each wall in the last step [Pa, N/m in 2D]
    real(dp), allocatable :: pressure(:)
    !> solves that failed so far
    integer :: failed = 0
    integer, private :: steps = 0
  contains
    procedure :: init => rest_init
    procedure :: judge => rest_judge
    procedure :: reached => rest_reached
  end type rest_t

contains

  subroutine rest_init(self, simulation)
    class(rest_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation

    self%compacted = simulation%config%sample%preparation == "compacted"
    allocate (self%pressure(simulation%n_walls), source=0.0_dp)
  end subroutine rest_init

  !> Look at a step that was made. Collective.
  subroutine rest_judge(self, simulation, figures)
    class(rest_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp) :: scale

    self%overlap = figures%max_overlap
    call measure_pressures(self, simulation)
    if (self%compacted) then
      self%imbalance = unbalanced_pressure(self, simulation)
      scale = simulation%config%sample%pressure*simulation%decomposition%rule%mean_radius**simulation%decomposition%nd
    else
      call weigh(simulation, scale, self%imbalance)
      scale = scale/simulation%n_grains*simulation%decomposition%rule%mean_radius
    end if
    self%energy = (simulation%balance%moving + energy_of_planes(simulation))/simulation%n_grains/scale
    if (figures%solve%status == solve_converged) then
      self%steps = self%steps + 1
    else
      self%steps = 0
      self%failed = self%failed + 1
    end if
    ! not a number is not rest
    if (.not. (self%energy <= simulation%config%sample%rest_tolerance .and. self%imbalance <= imbalance_allowed)) self%steps = 0
  end subroutine rest_judge

  !> Whether the last steps were all at rest.
  pure logical function rest_reached(self)
    class(rest_t), intent(in) :: self
    rest_reached = self%steps >= steps_at_rest
  end function rest_reached

  subroutine measure_pressures(self, simulation)
    type(rest_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    integer :: b, nd

    nd = simulation%decomposition%nd
    do b = 1, size(self%pressure)
      self%pressure(b) = -sum(simulation%boundary_impulses(:, b)*simulation%decomposition%boundaries(b)%surface%axis(1:nd))/ &
        & (simulation%physics%h*facing_area(simulation%decomposition, b))
    end do
  end subroutine measure_pressures

  !> Largest deviation of the stress on a free plane from the pressure, or of the sum of all forces from 0, over the pressure
  !> on a free plane.
  pure real(dp) function unbalanced_pressure(self, simulation) result(unbalanced)
    type(rest_t), intent(in) :: self
    type(simulation_t), intent(in) :: simulation
    real(dp) :: largest_area
    integer :: b

    unbalanced = 0.0_dp
    largest_area = 0.0_dp
    associate (pressure => simulation%config%sample%pressure)
      do b = 1, size(self%pressure)
        if (.not. simulation%decomposition%boundaries(b)%is_driven()) cycle
        unbalanced = max(unbalanced, abs(self%pressure(b)/pressure - 1.0_dp))
        largest_area = max(largest_area, facing_area(simulation%decomposition, b))
      end do
      unbalanced = max(unbalanced, norm2(sum(simulation%boundary_impulses, dim=2))/(simulation%physics%h*pressure*largest_area))
    end associate
  end function unbalanced_pressure

  !> Load on all grains, and the fraction of it that boundaries do not bear. Collective.
  subroutine weigh(simulation, weight, missing)
    type(simulation_t), intent(in) :: simulation
    !> [N]
    real(dp), intent(out) :: weight, missing
    real(dp), allocatable :: mass(:), volume(:)
    real(dp) :: force(simulation%decomposition%nd)
    integer :: s, k, n, nd

    nd = simulation%decomposition%nd
    allocate (mass(sum(simulation%decomposition%owned%n)), volume(sum(simulation%decomposition%owned%n)))
    n = 0
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          n = n + 1
          mass(n) = owned%mass(k)
          volume(n) = simulation%decomposition%figures%volume_of(owned, k)
        end do
      end associate
    end do
    force(:) = simulation%comm%sum_real(mass)*simulation%physics%gravity(1:nd) + &
      & simulation%comm%sum_real(volume)*simulation%physics%body_force(1:nd)
    weight = norm2(force)
    force(:) = force - sum(simulation%boundary_impulses, dim=2)/simulation%physics%h
    missing = norm2(force)/weight
  end subroutine weigh

  !> Kinetic energy of the boundaries that forces move [J].
  pure real(dp) function energy_of_planes(simulation) result(energy)
    type(simulation_t), intent(in) :: simulation
    integer :: b

    energy = 0.0_dp
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        energy = energy + 0.5_dp*boundary%mass*sum(boundary%velocity**2, mask=boundary%free)
      end associate
    end do
  end function energy_of_planes

end module gravier_sample_rest
