!> What an input file says, as one type per namelist group.
!> The defaults are in the table of keys (gravier_config_keys) and nowhere else: fill a config_t with parse_config.
module gravier_config_types
  use gravier_kinds, only: dp
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_diagnostic_registry, only: diagnostic_place
  implicit none
  private
  public :: scene_config_t, time_config_t, solver_config_t, decomposition_config_t, enriched_config_t
  public :: output_config_t, boundary_config_t, grains_config_t, sample_config_t, insertion_config_t, material_config_t
  public :: law_config_t, region_config_t, config_t
  public :: given_coefficients_t, text_length, choice_length

  !> longest title or path
  integer, parameter :: text_length = 4096
  !> longest of the words among which a key lets the user choose
  integer, parameter :: choice_length = 16

  !> Which of some coefficients of contact are given.
  type :: given_coefficients_t
    logical :: friction = .false., restitution = .false., tangential_restitution = .false.
    logical :: rolling_friction = .false., pivoting_friction = .false.
  end type given_coefficients_t

  !> &scene: the bodies, their loads and their contact laws.
  type :: scene_config_t
    character(len=text_length) :: title
    !> 2 or 3
    integer :: dimension
    !> m/s^2; the third component is 0 in 2D
    real(dp) :: gravity(3)
    !> column, lattice, file, sample or none
    character(len=choice_length) :: bodies
    !> blank unless bodies is file
    character(len=text_length) :: bodies_file
    !> file of shapes; blank: all bodies are disks or spheres
    character(len=text_length) :: shapes
    integer :: column_count
    !> m, kg: the disks or spheres of the column
    real(dp) :: radius, mass
    !> kg/m^3 (kg/m^2 in 2D)
    real(dp) :: density
    !> the case gives it
    logical :: has_density = .false.
    !> bodies along each axis; in 2D the third entry is 1; all 0 unless bodies is lattice
    integer :: lattice_count(3)
    !> m; 0 unless bodies is lattice
    real(dp) :: radius_min, radius_max
    integer :: seed
    !> between grains, and with boundaries
    type(coefficients_t) :: contact, wall_contact
    !> of the boundaries; blank: none
    character(len=text_length) :: wall_material
    !> false: no grain turns; true: grains turn where friction asks
    logical :: rotation
    !> m; 0 along an axis that is not periodic; the third is 0 in 2D
    real(dp) :: period(3)
    !> m: lower corner of the period, and of the box of a sample
    real(dp) :: period_origin(3)
    !> what moves the cell: rates of strain along the axes, of shear xy, xz and yz [1/s], stresses in their place [Pa, N/m in 2D],
    !> and the inertia of what stresses drive over M L^2
    real(dp) :: cell_strain_rate(3), cell_shear_rate(3), cell_pressure(3), cell_shear_stress(3), cell_inertia
    !> N/m^3 (N/m^2 in 2D); the third component is 0 in 2D
    real(dp) :: body_force(3)
    !> CSV tables in time, of the gravity and of what moves the periodic cell; blank: none
    character(len=text_length) :: gravity_table, cell_table
    !> these tables begin anew after their last row
    logical :: gravity_table_repeats, cell_table_repeats
    !> m; negative when not given, see alert_distance_given
    real(dp) :: alert_distance
    !> false: the alert distance is 0.1 of the largest radius
    logical :: alert_distance_given = .false.
    !> m: distance within which neighbour lists stay valid; negative when not given
    real(dp) :: skin
    !> false: the skin is 0.2 of the mean radius
    logical :: skin_given = .false.
    !> steps for which lists leave fast bodies room
    real(dp) :: list_steps
    !> m; negative when not given
    real(dp) :: overlap_allowed
    !> false: the allowed overlap is 0.01 of the mean radius
    logical :: overlap_allowed_given = .false.
    logical :: overlap_projection
    !> largest overlap at the start, as a fraction of the smaller radius
    real(dp) :: start_overlap
  end type scene_config_t

  !> &time: the steps.
  type :: time_config_t
    !> s
    real(dp) :: step
    integer :: steps
    real(dp) :: theta
    !> J: kinetic energy of the grains at rest, which ends the run; 0: it does not
    real(dp) :: rest_energy
    !> name of a boundary; blank: none; m: displacement of it that ends the run
    character(len=text_length) :: stop_boundary
    real(dp) :: stop_displacement
    !> strains of the cell along the axes, and shears xy, xz and yz, that end the run; 0: that component does not
    real(dp) :: stop_cell_strain(3), stop_cell_shear(3)
    !> free grains, kg: what ends the run when the scene comes down or up to it
    integer :: stop_grains_at_most, stop_grains_at_least
    real(dp) :: stop_mass_at_most, stop_mass_at_least
    logical :: stop_displacement_given = .false., stop_grains_at_most_given = .false., stop_grains_at_least_given = .false.
    logical :: stop_mass_at_most_given = .false., stop_mass_at_least_given = .false.
  end type time_config_t

  !> &solver: the method of every step and when it stops.
  type :: solver_config_t
    !> nlgs, schwarz, schwarz_ec, nscdd, nscdd_ep or newton
    character(len=choice_length) :: method
    !> velocity_error, residual or error
    character(len=choice_length) :: criterion
    !> velocity error over the velocity scale
    real(dp) :: accuracy
    !> of the residual, or of the error on the impulses
    real(dp) :: tolerance
    !> false: 1e-2 where the velocity error ends solves, 1e-4 elsewhere
    logical :: tolerance_given = .false.
    !> newton or none: what takes over a solve that stagnates, and the contacts of its problem, at most
    character(len=choice_length) :: fallback
    integer :: fallback_contacts
    !> false: newton where the velocity error ends solves, none elsewhere
    logical :: fallback_given = .false.
    integer :: max_iterations, sweeps, check_every
    !> in (0, 1]
    real(dp) :: relaxation
    !> false: the factor is automatic
    logical :: relaxation_given = .false.
    !> m/s: velocity against which errors of a solve are compared; negative when not given
    real(dp) :: velocity_scale
    !> false: the velocity is found by rule
    logical :: velocity_scale_given = .false.
    !> part of the iterations that go to comparisons of solves with more exact ones
    real(dp) :: spot_checks
    logical :: spot_checks_given = .false.
    !> none or momentum
    character(len=choice_length) :: acceleration
    logical :: warm_start
    !> cold starts may go through layers first
    logical :: layered_start
    logical :: sleeping
    !> steps; momentum of a body at rest over the root mean square of the impulses
    integer :: sleep_after
    real(dp) :: sleep_speed
    logical :: sleep_speed_given = .false.
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
    !> false: the grid is found from subdomains
    logical :: grid_given = .false.
    !> total number; the product of grid when grid is given
    integer :: subdomains
    !> steps; 0 never
    integer :: repartition_every
    !> largest over mean number of contacts of a subdomain that asks for a new partition; 0 never
    real(dp) :: repartition_imbalance
  end type decomposition_config_t

  !> &enriched: the search direction of schwarz_ec and nscdd_ep.
  type :: enriched_config_t
    !> times 1/W_aa of each contact, or kg, as direction_unit says; the method's own choice where it is not given
    real(dp) :: direction
    logical :: direction_given = .false.
    !> relative or absolute
    character(len=choice_length) :: direction_unit
    !> interface solve: mumps or cg (nscdd_ep only); contacts that take part: all or active
    character(len=choice_length) :: interface, contacts
    real(dp) :: cg_tolerance
    integer :: cg_max_iterations
  end type enriched_config_t

  !> &output: the results.
  type :: output_config_t
    character(len=text_length) :: directory
    !> steps; 0 writes the last state only
    integer :: every
    logical :: contacts, trace, final_bodies, final_forces
    !> steps between two rows of history.csv
    integer :: history_every
    !> steps; 0 never
    integer :: checkpoint_every
    !> step whose problem is written as a file of FCLIB; 0 none
    integer :: fclib_step
    !> s of wall time; 0 never
    real(dp) :: checkpoint_seconds
    !> s: the run writes a checkpoint and stops before it has run so long; 0: no limit
    real(dp) :: walltime
    logical :: vtk
    !> identifiers of the bodies that history.csv follows; 0: none
    integer :: tracked_bodies(8)
    !> their forces are columns, too
    logical :: tracked_forces
    !> which diagnostics are asked for, in the order of the registry
    logical, allocatable :: diagnostics(:)
  contains
    procedure :: ask => output_config_ask
  end type output_config_t

  !> &boundary: one boundary. What does not belong to its shape keeps the default.
  type :: boundary_config_t
    !> unique; 'boundary K', K its number, when not given
    character(len=text_length) :: name
    !> word of a registered shape, grains or wall
    character(len=choice_length) :: shape
    !> (3, keys of all shapes): of the keys of gravier_surface_registry, in their order; of one with a single value the first
    real(dp), allocatable :: value(:, :)
    !> grains: the group of the bodies file
    integer :: group
    !> mesh: the file of its facets; blank for other shapes
    character(len=text_length) :: file
    !> wall: which of the walls of the bodies, as gravier_wall_side reads it; blank for other shapes
    character(len=text_length) :: wall
    !> m/s
    real(dp) :: velocity(3)
    !> rad/s; in 2D the first entry is the rate about z and the others are 0
    real(dp) :: rotation(3)
    !> m and rad, as velocity and rotation: amplitudes of an oscillation
    real(dp) :: oscillation(3), rotation_oscillation(3)
    !> Hz, > 0 where there is an oscillation, and rad
    real(dp) :: frequency, phase
    !> m: the point it turns about; the value of point when not given (0 for grains and walls)
    real(dp) :: pivot(3)
    logical :: pivot_given = .false.
    !> components of the translation that forces move
    logical :: free(3)
    !> N; 0 along components that are not free
    real(dp) :: force(3)
    !> Pa (N/m in 2D); 0 unless it is a plane that is free
    real(dp) :: pressure
    !> kg; > 0 where a component is free, else 0
    real(dp) :: mass
    !> CSV table of the motion and the loads in time; blank: none
    character(len=text_length) :: table
    !> it begins anew after its last row
    logical :: table_repeats
    !> wall_contact of &scene where not given
    type(coefficients_t) :: contact
    type(given_coefficients_t) :: contact_given
    !> name; wall_material of &scene when not given; blank: none
    character(len=text_length) :: material
    logical :: material_given = .false.
    !> s; the largest real number when not given
    real(dp) :: remove_at
    logical :: remove_at_given = .false.
  end type boundary_config_t

  !> What grains are drawn from at random. What does not belong to the choices keeps the default.
  type :: grains_config_t
    !> single, uniform, uniform_volume, log_normal or table
    character(len=choice_length) :: radii
    !> m: of single radii; bounds of the others
    real(dp) :: radius, radius_min, radius_max
    !> m; standard deviation of ln(radius/radius_mean): log_normal
    real(dp) :: radius_mean, radius_deviation
    !> CSV table of the radii and their shares
    character(len=text_length) :: radius_table
    !> names of shapes, with commas or blanks between; shares by number, all 0 for equal ones
    character(len=text_length) :: grain_shapes
    real(dp) :: grain_shares(8)
    integer :: seed
  end type grains_config_t

  !> &sample: the sample that is generated where bodies is sample. What does not belong to the choices keeps the default.
  type, extends(grains_config_t) :: sample_config_t
    !> lattice or loose
    character(len=choice_length) :: arrangement
    !> none, settled or compacted
    character(len=choice_length) :: preparation
    !> box or boundaries
    character(len=choice_length) :: container
    !> m, boundaries: the middle of the box where it is not given
    real(dp) :: inner_point(3)
    logical :: inner_point_given = .false.
    !> grains
    integer :: count
    !> names of materials, with commas or blanks between; shares by number, all 0 for equal ones
    character(len=text_length) :: grain_materials
    real(dp) :: material_shares(8)
    !> m/s: none
    real(dp) :: velocity(3), velocity_spread(3)
    !> m; the period along a periodic axis; the last may be 0: found from solid_fraction; the third is 0 in 2D
    real(dp) :: box(3)
    !> of a loose sample whose last size is 0
    real(dp) :: solid_fraction
    !> Pa (N/m in 2D): compacted
    real(dp) :: pressure
    !> kinetic energy of a grain at rest, in m g R (settled) or pressure R^dimension (compacted)
    real(dp) :: rest_tolerance
    !> settled, compacted
    integer :: max_steps
    !> the bodies file that gravier_sample writes
    character(len=text_length) :: file
  end type sample_config_t

  !> &insertion: grains that enter while the run goes on.
  type, extends(grains_config_t) :: insertion_config_t
    !> unique; 'insertion K', K its number, when not given
    character(len=text_length) :: name
    !> box or ball
    character(len=choice_length) :: region
    !> m: corners of the box, centre and radius of the ball
    real(dp) :: lower(3), upper(3), centre(3), region_radius
    !> 1/s, kg/s; at most one of them is given
    real(dp) :: rate, mass_rate
    logical :: rate_given = .false., mass_rate_given = .false.
    !> grains after which it ends; kg beyond which no grain enters
    integer :: count
    real(dp) :: mass
    logical :: count_given = .false., mass_given = .false.
    !> s
    real(dp) :: start, end
    logical :: end_given = .false.
    !> m/s
    real(dp) :: velocity(3), velocity_spread(3)
    !> name; blank: the first, if there is one
    character(len=text_length) :: material
    logical :: material_given = .false.
  end type insertion_config_t

  !> &material: one material.
  type :: material_config_t
    !> unique
    character(len=text_length) :: name
    !> kg/m^3 (kg/m^2 in 2D); that of &scene when not given
    real(dp) :: density
    logical :: density_given = .false.
  end type material_config_t

  !> &law: the law of a pair of materials.
  type :: law_config_t
    !> names of the materials; a blank one stands for the other
    character(len=text_length) :: materials(2)
    !> one of the registered kinds
    character(len=choice_length) :: kind
    !> of the keys of all laws, in their order in the table
    real(dp), allocatable :: value(:)
  end type law_config_t

  !> &region: a region of means.
  type :: region_config_t
    !> unique; begins the names of its columns
    character(len=text_length) :: name
    !> m: corners of the box, -1e30 and 1e30 where there is no side
    real(dp) :: lower(3), upper(3)
    logical :: lower_given = .false., upper_given = .false.
    !> of a profile
    integer :: bins
    logical :: bins_given = .false.
    !> steps between samples of the bins
    integer :: sample_every
    logical :: sample_every_given = .false.
    !> x, y, z or blank
    character(len=choice_length) :: axis
    logical :: axis_given = .false.
  end type region_config_t

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
    !> in the order of the file; shape (0) when it has none
    type(boundary_config_t), allocatable :: boundaries(:)
    !> in the order of the file; shapes (0) when it has none
    type(material_config_t), allocatable :: materials(:)
    type(law_config_t), allocatable :: laws(:)
    type(insertion_config_t), allocatable :: insertions(:)
    type(region_config_t), allocatable :: regions(:)
    !> defaults unless bodies is sample
    type(sample_config_t) :: sample
  end type config_t

contains

  !> Ask for the diagnostic with that key, where there is one.
  subroutine output_config_ask(self, key)
    class(output_config_t), intent(inout) :: self
    character(len=*), intent(in) :: key
    integer :: place

    place = diagnostic_place(key)
    if (place > 0) self%diagnostics(place) = .true.
  end subroutine output_config_ask

end module gravier_config_types
