!> What an input file says, as one type per namelist group.
!> The defaults are in the table of keys (gravier_config_keys) and nowhere else: fill a config_t with parse_config.
module gravier_config_types
  use gravier_kinds, only: dp
  implicit none
  private
  public :: scene_config_t, time_config_t, solver_config_t, decomposition_config_t, enriched_config_t
  public :: output_config_t, config_t
  public :: text_length, choice_length

  !> longest title or path
  integer, parameter :: text_length = 4096
  !> longest of the words among which a key lets the user choose
  integer, parameter :: choice_length = 16

  !> &scene: the bodies, their loads and their contact laws.
  type :: scene_config_t
    character(len=text_length) :: title
    !> 2 or 3
    integer :: dimension
    !> m/s^2; the third component is 0 in 2D
    real(dp) :: gravity(3)
    !> column, lattice or file
    character(len=choice_length) :: bodies
    !> blank unless bodies is file
    character(len=text_length) :: bodies_file
    integer :: column_count
    !> m, kg: the disks or spheres of the column
    real(dp) :: radius, mass
    !> kg/m^3 (kg/m^2 in 2D)
    real(dp) :: density
    !> bodies along each axis; in 2D the third entry is 1; all 0 unless bodies is lattice
    integer :: lattice_count(3)
    !> m; 0 unless bodies is lattice
    real(dp) :: radius_min, radius_max
    integer :: seed
    real(dp) :: friction, wall_friction
    !> m; negative when not given, see alert_given
    real(dp) :: alert_distance
    !> false: the alert distance is 0.1 of the largest radius
    logical :: alert_given = .false.
  end type scene_config_t

  !> &time: the steps.
  type :: time_config_t
    !> s
    real(dp) :: step
    integer :: steps
    real(dp) :: theta
  end type time_config_t

  !> &solver: the method of every step and when it stops.
  type :: solver_config_t
    !> nlgs, schwarz, schwarz_ec, nscdd or nscdd_ep
    character(len=choice_length) :: method
    !> residual or error
    character(len=choice_length) :: criterion
    real(dp) :: tolerance
    integer :: max_iterations, sweeps, check_every
    !> in (0, 1]
    real(dp) :: relaxation
    logical :: warm_start
    !> continue, stop or discard
    character(len=choice_length) :: on_failure
  end type solver_config_t

  !> &decomposition: the subdomains.
  type :: decomposition_config_t
    !> grid or metis
    character(len=choice_length) :: partition
    !> dual or primal
    character(len=choice_length) :: kind
    !> subdomains along each axis; all 0 when not given; once given, the third entry is 1 in 2D
    integer :: grid(3)
    !> total number; the product of grid when grid is given
    integer :: subdomains
    !> steps; 0 never
    integer :: repartition_every
  end type decomposition_config_t

  !> &enriched: the search direction of schwarz_ec and nscdd_ep.
  type :: enriched_config_t
    !> times 1/W_aa of each contact, or kg, as direction_unit says
    real(dp) :: direction
    !> relative or absolute
    character(len=choice_length) :: direction_unit
    !> all or active
    character(len=choice_length) :: contacts
    !> mumps or cg (nscdd_ep only)
    character(len=choice_length) :: interface
      real(dp) :: cg_tolerance
      integer :: cg_max_iterations
      end type enriched_config_t

      !> &output: the results.
      type :: output_config_t
        character(len=text_length) :: directory
        !> steps; 0 writes the last state only
        integer :: every
        logical :: contacts, trace, final_bodies
      end type output_config_t

      !> A whole input file.
      type :: config_t
        !> path and content of the file
        character(len=:), allocatable :: file, text
        type(scene_config_t) :: scene
        type(time_config_t) :: time
        type(solver_config_t) :: solver
        type(decomposition_config_t) :: decomposition
        type(enriched_config_t) :: enriched
        type(output_config_t) :: output
      end type config_t

      end module gravier_config_types
