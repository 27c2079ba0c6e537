!> What gravier_error measures, and what comes of it: the plan of a case, the situations in it, and a row for each state looked at.
module gravier_error_plan
  use gravier_kinds, only: dp, i8
  use gravier_config, only: config_t
  implicit none
  private
  public :: plan_t, situation_t, reference_t, row_t
  public :: start_cold, start_lost, start_turned, start_loose

  !> impulses at the start: zero; converged with a fraction of them set to zero; converged before gravity turned; converged, and
  !> velocities of the grains drawn at random
  integer, parameter :: start_cold = 1, start_lost = 2, start_turned = 3, start_loose = 4

  !> How a solve starts.
  type :: situation_t
    integer :: start = start_cold
    !> of contacts whose impulses are lost; angle by which gravity turns [degrees]; velocities over the velocity scale
    real(dp) :: amount = 0.0_dp
  end type situation_t

  !> What is measured of a case.
  type :: plan_t
    type(config_t) :: config
    type(situation_t), allocatable :: situations(:)
    !> iterations after which a solve is looked at, in ascending order
    integer, allocatable :: iterations(:)
    !> steps made before; of these, every so many is looked at after its solve, 0 for none
    integer :: steps = 0, every = 0
    !> the exact velocities are zero; otherwise those of a solve that goes on to a residual, or to so many iterations
    logical :: at_rest = .false.
    real(dp) :: tight = 1.0e-10_dp
    integer :: limit = 20000
    !> plain sweeps after these, where the residual is not reached
    integer :: sweeps = 20000
    !> solve by the program's own control, too, from zero impulses
    logical :: by_program = .false.
  end type plan_t

  !> The solve that takes the place of an exact solution.
  type :: reference_t
    real(dp) :: residual = 0.0_dp
    !> its own estimate, and how far its velocities have still gone in the second half of its sweeps [m/s]
    real(dp) :: estimate = 0.0_dp, spread = 0.0_dp
    integer :: iterations = 0
  end type reference_t

  !> One state that was looked at. Velocities are root mean squares over the mass of the grains in contact [m/s].
  type :: row_t
    character(len=:), allocatable :: situation
    !> step of the run, 0 for the solves after it; iterations made
    integer :: step = 0, iterations = 0
    real(dp) :: residual = 0.0_dp
    !> distance from the exact velocities, and its estimate
    real(dp) :: true_error = 0.0_dp, estimate = 0.0_dp
    !> what the estimate is made of, see gravier_velocity_error; negative where the solver has kept it to itself
    real(dp) :: projection = -1.0_dp, levels = -1.0_dp, bound = -1.0_dp
    integer :: depth = -1
    !> contacts relaxed over contacts, and seconds of the solve on this rank, without the time of looking at its states [s]
    real(dp) :: sweeps = 0.0_dp, seconds = 0.0_dp
    !> sweeps of a pass over layers, 0 without one, and whether the solve went on from it; of solves by the program
    real(dp) :: layered_sweeps = 0.0_dp
    logical :: layered = .false.
    !> all zero where the exact velocities are known
    type(reference_t) :: reference
    !> velocity that errors are compared with [m/s]; contacts, and mass of the grains in contact [kg]
    real(dp) :: scale = 0.0_dp, mass = 0.0_dp
    integer(i8) :: grains = 0, contacts = 0
  end type row_t

end module gravier_error_plan
