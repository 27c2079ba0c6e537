!> The table of all groups and keys of an input file: names, kinds, units, defaults, allowed values, meanings.
!> The reader, its messages and the reference in doc/keys.md all come from this table. The keys of the laws of contact, of the
!> shapes of boundaries and of the diagnostics come from their modules, the words of the methods from theirs.
module gravier_config_table
  use gravier_declared_keys, only: declared_key_t, collected_keys_t, kind_length
  use gravier_config_key, only: group_t, key_t, kind_integer, kind_real, kind_logical, kind_choice, kind_text
  use gravier_config_table_grains, only: made_keys, source_keys, prepared_keys, where_keys, material_keys
  use gravier_law_registry, only: collect_law_keys => law_keys
  use gravier_surface, only: surface_features_t
  use gravier_surface_registry, only: surface_holder_t, registered_surfaces, surface_keys, glued_grains, wall_of_bodies
  use gravier_method_options, only: method_features_t
  use gravier_method_registry, only: method_holder_t, registered_methods, method_words, quoted_names, all_methods, that_relax, &
    & accelerated, accelerated_on_active
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics
  implicit none
  private
  public :: groups, keys, surface_rows, fill_keys

  !> stands for the shapes of a boundary that carry forces, until the table is complete
  character(len=*), parameter :: solid_shapes = "(solid)"
  !> stands for the shapes whose facets a file has, until the table is complete
  character(len=*), parameter :: faceted_shapes = "(faceted)"
  ! fprettify leaves the tables as they are laid out here
  !&<
  type(group_t), parameter :: groups(*) = &
    [group_t("scene", .true., "The bodies, their loads and their contact laws."), &
     group_t("boundary", .false., "A boundary: a wall of some shape, glued grains, or an outlet.", repeated=.true.), &
     group_t("sample", .false., "The grains that are generated.", bodies="sample"), &
     group_t("insertion", .false., "Grains that enter the scene while the run goes on.", repeated=.true.), &
     group_t("material", .false., "A material of grains and boundaries: the first one is that of all grains unless the "// &
             "bodies file says another.", repeated=.true.), &
     group_t("law", .false., "The law of contact between two materials, in the place of friction and restitution of "// &
             "`&scene` and `&boundary`.", repeated=.true.), &
     group_t("time", .true., "The time steps."), &
     group_t("solver", .false., "The method that solves the contacts of every step, and when it stops."), &
     group_t("decomposition", .false., "The subdomains of the domain decomposition methods."), &
     group_t("enriched", .false., &
             "The enriched methods `schwarz_ec` and `nscdd_ep`; the other methods ignore this group."), &
     group_t("output", .false., "The results."), &
     group_t("region", .false., "A box, or bins along an axis, over which means are written.", repeated=.true.)]

  type(key_t), parameter :: scene_keys(*) = &
    [key_t("scene", "title", kind_text, "''", "", "a title for the log and the results"), &
     key_t("scene", "dimension", kind_integer, "2", "2 or 3", "disks in the plane (2) or spheres in space (3)"), &
     key_t("scene", "gravity", kind_real, "0, -9.81, 0", "", &
           "acceleration of gravity; its third component is 0 in 2D", &
           count=3, unit="m/s^2", note="`0, -9.81, 0` in 2D, `0, 0, -9.81` in 3D"), &
     key_t("scene", "gravity_table", kind_text, "''", "", &
           "path of a CSV file with columns `time,gx,gy` and, in 3D, `gz`, which replaces `gravity`: linear in time between "// &
           "its rows, constant outside"), &
     key_t("scene", "gravity_table_repeats", kind_logical, ".false.", "", &
           "the table begins anew after its last row, which is as the first"), &
     key_t("scene", "body_force", kind_real, "3*0", "", "force on each volume of the grains; its third component is 0 in 2D", &
           count=3, unit="N/m^3, N/m^2 in 2D"), &
     key_t("scene", "bodies", kind_choice, "''", "column lattice file sample none", &
           "where the bodies come from: a column of equal bodies, a loose lattice of random radii, a bodies file, or "// &
           "`&sample`; `none`: all grains enter by `&insertion`", &
           note="required", required=.true.), &
     key_t("scene", "bodies_file", kind_text, "''", "not empty", "path of the bodies file", &
           note="required", chooser="bodies", chosen="file"), &
     key_t("scene", "shapes", kind_text, "''", "", &
           "path of a [file of shapes](shapes.md#2-the-file-of-shapes), which bodies of the bodies file, of the sample or of "// &
           "insertions may have in the place of disks and spheres", &
           chooser="bodies", chosen="file sample none"), &
     key_t("scene", "column_count", kind_integer, "3", ">= 1", "number of bodies in the column", &
           chooser="bodies", chosen="column"), &
     key_t("scene", "radius", kind_real, "1.0", "> 0", "radius of each body", unit="m", chooser="bodies", chosen="column"), &
     key_t("scene", "mass", kind_real, "1.0", "> 0", "mass of each body", unit="kg", chooser="bodies", chosen="column"), &
     key_t("scene", "density", kind_real, "2500", "> 0", &
           "density of the bodies; with `bodies = 'file'`, where the file gives no masses", &
           unit="kg/m^3, kg/m^2 in 2D", chooser="bodies", chosen="lattice file sample none"), &
     key_t("scene", "lattice_count", kind_integer, "3*0", ">= 1", &
           "number of bodies along each axis: two entries in 2D, three in 3D", &
           count=3, note="required", chooser="bodies", chosen="lattice"), &
     key_t("scene", "radius_min", kind_real, "0", "> 0", "smallest radius", &
           unit="m", note="required", chooser="bodies", chosen="lattice"), &
     key_t("scene", "radius_max", kind_real, "0", "> 0", "largest radius, at least `radius_min`", &
           unit="m", note="required", chooser="bodies", chosen="lattice"), &
     key_t("scene", "seed", kind_integer, "1", "", "seed of the random radii", chooser="bodies", chosen="lattice"), &
     key_t("scene", "friction", kind_real, "0.0", ">= 0", "friction coefficient between bodies"), &
     key_t("scene", "wall_friction", kind_real, "-1", ">= 0", "friction coefficient between bodies and boundaries", &
           note="the value of `friction`"), &
     key_t("scene", "restitution", kind_real, "0.0", "in [0, 1]", "normal restitution coefficient between bodies"), &
     key_t("scene", "wall_restitution", kind_real, "-1", "in [0, 1]", &
           "normal restitution coefficient between bodies and boundaries", note="the value of `restitution`"), &
     key_t("scene", "tangential_restitution", kind_real, "0.0", "in [0, 1]", &
           "tangential restitution coefficient between bodies, where there is friction"), &
     key_t("scene", "wall_tangential_restitution", kind_real, "-1", "in [0, 1]", &
           "tangential restitution coefficient between bodies and boundaries", note="the value of `tangential_restitution`"), &
     key_t("scene", "rolling_friction", kind_real, "0.0", ">= 0", &
           "rolling friction coefficient between bodies: the largest moment over `R* r_n`, `R* = R_i R_j/(R_i + R_j)`"), &
     key_t("scene", "wall_rolling_friction", kind_real, "-1", ">= 0", &
           "rolling friction coefficient between bodies and boundaries, where `R* = R_i`", &
           note="the value of `rolling_friction`"), &
     key_t("scene", "pivoting_friction", kind_real, "0.0", ">= 0", &
           "pivoting friction coefficient between bodies: the same for the moment about the normal; 0 in 2D"), &
     key_t("scene", "wall_pivoting_friction", kind_real, "-1", ">= 0", &
           "pivoting friction coefficient between bodies and boundaries; 0 in 2D", note="the value of `pivoting_friction`"), &
     key_t("scene", "wall_material", kind_text, "''", "", &
           "name of the `&material` of the boundaries; without one no `&law` is theirs"), &
     key_t("scene", "rotation", kind_logical, ".true.", "", "grains turn where friction asks; "// &
           "`.false.`: they never turn, and spins of a bodies file are left out"), &
     key_t("scene", "period", kind_real, "3*0", ">= 0", &
           "length after which the scene repeats itself along each axis, 0: it does not; the third is 0 in 2D", &
           count=3, unit="m"), &
     key_t("scene", "period_origin", kind_real, "3*0", "", &
           "lower corner of the period, and of the box of a sample; its third component is 0 in 2D", count=3, unit="m"), &
     key_t("scene", "cell_strain_rate", kind_real, "3*0", "", &
           "rates of strain of the period along the axes, extension positive; the third is 0 in 2D", count=3, unit="1/s"), &
     key_t("scene", "cell_shear_rate", kind_real, "3*0", "", &
           "rates of shear of the period: of the velocity along x over y, along x over z, along y over z; one entry in 2D", &
           count=3, planar=1, unit="1/s"), &
     key_t("scene", "cell_pressure", kind_real, "3*0", ">= 0", &
           "normal stresses that drive the lengths of the period, compression positive, 0: the rate of strain is given", &
           count=3, unit="Pa, N/m in 2D"), &
     key_t("scene", "cell_shear_stress", kind_real, "3*0", "", &
           "shear stresses that drive the shear of the period, 0: the rate of shear is given; one entry in 2D", &
           count=3, planar=1, unit="Pa, N/m in 2D"), &
     key_t("scene", "cell_table", kind_text, "''", "", &
           "path of a CSV file with the column `time` and any of those of the moving cell, such as `strain_rate_x`, "// &
           "`shear_rate_xy`, `pressure_x` and `shear_stress_xy`, which replaces rates and stresses of the period: linear in "// &
           "time between its rows, constant outside"), &
     key_t("scene", "cell_table_repeats", kind_logical, ".false.", "", &
           "the table begins anew after its last row, which is as the first"), &
     key_t("scene", "cell_inertia", kind_real, "0.1", "> 0", &
           "inertia of the period that stresses drive, over the mass of the grains times the square of its length"), &
     key_t("scene", "alert_distance", kind_real, "-1", ">= 0", "gap below which two bodies make a contact", &
           unit="m", note="0.1 of the largest radius"), &
     key_t("scene", "skin", kind_real, "-1", ">= 0", &
           "gap beyond the alert distance up to which pairs are listed, so that neighbour lists last for several steps", &
           unit="m", note="0.2 of the mean radius"), &
     key_t("scene", "list_steps", kind_real, "10", ">= 0", &
           "steps for which neighbour lists leave a body room at its speed, beyond half the skin, at most half the mean radius"), &
     key_t("scene", "overlap_allowed", kind_real, "-1", "> 0", "overlap that grains may have", &
           unit="m", note="0.01 of the mean radius, or the least rounding"), &
     key_t("scene", "overlap_projection", kind_logical, ".true.", "", "remove overlaps by moving grains and free boundaries"), &
     key_t("scene", "start_overlap", kind_real, "0.5", ">= 0", &
           "largest overlap at the start, as a fraction of the smaller radius of two grains, or of the radius of a grain at a "// &
           "boundary; of a body with a shape half of its least thickness counts")]

  type(key_t), parameter :: shape_keys(*) = &
    [key_t("boundary", "name", kind_text, "''", "not empty", &
           "a name of its own, of at most 64 characters, for messages and results", &
           note="`'boundary K'`, K its number"), &
     key_t("boundary", "shape", kind_choice, "''", "", &
           "what it is: `segment` and `circle` in 2D, `rectangle` and `cylinder` in 3D only; `mesh`: facets of a file; "// &
           "`grains`: glued grains of the bodies file; `wall`: a plane that comes with the bodies; "// &
           "`outlet`: a plane behind which grains leave the scene", &
           note="required", required=.true.)]

  type(key_t), parameter :: boundary_keys(*) = &
    [key_t("boundary", "group", kind_integer, "0", ">= 1", "number of the group of grains in the bodies file", &
           note="required", chooser="shape", chosen=glued_grains), &
     key_t("boundary", "file", kind_text, "''", "not empty", &
           "path of the facets of a mesh: an STL or OBJ file of triangles or polygons in 3D, an OBJ file of lines or a CSV "// &
           "file of the points `x,y` of one line in 2D; see [mesh walls](user_guide.md#mesh-walls)", &
           note="required", chooser="shape", chosen=faceted_shapes), &
     key_t("boundary", "wall", kind_text, "''", "not empty", &
           "the wall of the bodies that it is: `'-x'`, `'+x'`, `'-y'`, ... by the side on which it lies, or the identifier of "// &
           "a wall of the bodies file", note="required", chooser="shape", chosen=wall_of_bodies), &
     key_t("boundary", "velocity", kind_real, "3*0", "", &
           "prescribed velocity; of a `free` component the velocity at the start; its third component is 0 in 2D", &
           count=3, unit="m/s"), &
     key_t("boundary", "rotation", kind_real, "3*0", "", &
           "prescribed rate of rotation: one entry in 2D, about the third axis; three in 3D; 0 where a component is `free`", &
           count=3, planar=1, unit="rad/s"), &
     key_t("boundary", "oscillation", kind_real, "3*0", "", &
           "amplitude A of an oscillation beside the other motion: at time t it has displaced the boundary from its place at "// &
           "time 0 by A [sin(2 pi `frequency` t + `phase`) - sin(`phase`)]; 0 where a component is `free`, and its third "// &
           "component in 2D", &
           count=3, unit="m"), &
     key_t("boundary", "rotation_oscillation", kind_real, "3*0", "", &
           "amplitude of a rotation in the same manner: one entry in 2D, three in 3D; 0 where a component is `free`", &
           count=3, planar=1, unit="rad"), &
     key_t("boundary", "frequency", kind_real, "0", "", "periods of the oscillation in a second, > 0; 0 without one", &
           unit="Hz", note="required with an oscillation"), &
     key_t("boundary", "phase", kind_real, "0", "", &
           "angle of the oscillation at time 0: with -1.5708 it starts from rest; 0 without one", unit="rad"), &
     key_t("boundary", "pivot", kind_real, "3*0", "", "the point it turns about", &
           count=3, unit="m", note="the value of `point`; for glued grains the origin"), &
     key_t("boundary", "free", kind_logical, "3*.false.", "", &
           "components of its translation that forces move; the third is `.false.` in 2D", &
           count=3, chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "force", kind_real, "3*0", "", "force on the free components, 0 on the others", &
           count=3, unit="N", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "pressure", kind_real, "0", "", &
           "pressure along `normal`, which lies along an axis with a free component. Its area has a side along each other "// &
           "axis: the period, or the distance of two planes that face each other along that axis and are not removed", &
           unit="Pa, N/m in 2D", chooser="shape", chosen="plane "//wall_of_bodies), &
     key_t("boundary", "mass", kind_real, "0", "> 0", "inertia of a boundary that has free components; only there", &
           unit="kg", note="required where a component is `free`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "table", kind_text, "''", "", &
           "path of a CSV file with a column `time` and any of `vx,vy,vz`, `omega` (2D) or `wx,wy,wz` (3D), `fx,fy,fz`, "// &
           "`pressure`, each in the place of a constant, which is then 0: linear in time, constant outside"), &
     key_t("boundary", "table_repeats", kind_logical, ".false.", "", &
           "the table begins anew after its last row, which is as the first"), &
     key_t("boundary", "friction", kind_real, "-1", ">= 0", "friction coefficient between grains and this boundary", &
           note="the value of `wall_friction` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "restitution", kind_real, "-1", "in [0, 1]", &
           "normal restitution coefficient between grains and this boundary", &
           note="the value of `wall_restitution` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "tangential_restitution", kind_real, "-1", "in [0, 1]", &
           "tangential restitution coefficient between grains and this boundary", &
           note="the value of `wall_tangential_restitution` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "rolling_friction", kind_real, "-1", ">= 0", &
           "rolling friction coefficient between grains and this boundary", &
           note="the value of `wall_rolling_friction` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "pivoting_friction", kind_real, "-1", ">= 0", &
           "pivoting friction coefficient between grains and this boundary; 0 in 2D", &
           note="the value of `wall_pivoting_friction` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "material", kind_text, "''", "", "name of its `&material`, and of that of grains glued to it", &
           note="the value of `wall_material` of `&scene`", chooser="shape", chosen=solid_shapes), &
     key_t("boundary", "remove_at", kind_real, "-1", ">= 0", "time at which the boundary is removed", &
           unit="s", note="never")]

  !> those of all laws; `kind` comes with its words, and each law has its own
  type(key_t), parameter :: law_keys(*) = &
    [key_t("law", "materials", kind_text, "''", "", &
           "names of the two materials; one name stands for pairs of that material", count=2, note="required", required=.true.), &
     key_t("law", "kind", kind_choice, "''", "", "the law, see [laws](laws.md)", note="required", required=.true.)]

  type(key_t), parameter :: time_keys(*) = &
    [key_t("time", "step", kind_real, "0", "> 0", "length of a time step", unit="s", note="required", required=.true.), &
     key_t("time", "steps", kind_integer, "0", ">= 0", "number of time steps", note="required", required=.true.), &
     key_t("time", "theta", kind_real, "0.5", "in [0.5, 1]", &
           "factor of the new velocity in the positions: 0.5 is the mid-point rule, 1 is implicit Euler"), &
     key_t("time", "rest_energy", kind_real, "0.0", ">= 0", &
           "the run ends when the kinetic energy of the grains, of disks and spheres without their spins, was at most this in "// &
           "10 steps, one after the other; 0: it does not", &
           unit="J"), &
     key_t("time", "stop_boundary", kind_text, "''", "", &
           "name of a `&boundary`: the run ends when it is `stop_displacement` away from its place at the start of the scene"), &
     key_t("time", "stop_displacement", kind_real, "-1", "> 0", "displacement of `stop_boundary` at which the run ends", &
           unit="m", note="never"), &
     key_t("time", "stop_cell_strain", kind_real, "3*0", "", &
           "strains of the period along the axes, extension positive, at any of which the run ends; 0: it does not", count=3), &
     key_t("time", "stop_cell_shear", kind_real, "3*0", "", &
           "shears of the period, as in `cell_shear_rate`, at any of which the run ends; 0: it does not; one entry in 2D", &
           count=3, planar=1), &
     key_t("time", "stop_grains_at_most", kind_integer, "0", ">= 0", &
           "the run ends when the scene has come down to so many grains that are not glued", note="never"), &
     key_t("time", "stop_grains_at_least", kind_integer, "0", ">= 1", &
           "the run ends when the scene has come up to so many grains that are not glued", note="never"), &
     key_t("time", "stop_mass_at_most", kind_real, "-1", ">= 0", &
           "the run ends when the mass of the grains that are not glued has come down to this", unit="kg", note="never"), &
     key_t("time", "stop_mass_at_least", kind_real, "-1", "> 0", &
           "the run ends when the mass of the grains that are not glued has come up to this", unit="kg", note="never")]

  type(key_t), parameter :: solver_keys(*) = &
    [key_t("solver", "method", kind_choice, "'nlgs'", "", ""), &
     key_t("solver", "criterion", kind_choice, "'velocity_error'", "velocity_error residual error", &
           "what ends a solve: the estimated velocity error, with the residual as a guard; the residual, where boundaries "// &
           "move with a velocity error of at most ten times `accuracy`; the known error on the impulses of `bodies = 'column'`"), &
     key_t("solver", "accuracy", kind_real, "0.1", "> 0", &
           "estimated velocity error over the velocity scale at which a solve has converged; with another criterion the "// &
           "closing lines count the solves that miss it"), &
     key_t("solver", "tolerance", kind_real, "1e-4", "> 0", &
           "residual, or error on the impulses, at which a solve has converged; with `velocity_error` both must be met", &
           note="1e-2 with `velocity_error`, else 1e-4"), &
     key_t("solver", "fallback", kind_choice, "'none'", "newton none", &
           "method that takes over a solve that stagnates or makes 2000 iterations in vain, if the problem has at most "// &
           "`fallback_contacts` contacts", &
           note="newton with `velocity_error`, else none"), &
     key_t("solver", "fallback_contacts", kind_integer, "10000", ">= 1", &
           "contacts of a problem that `fallback` takes over, at most"), &
     key_t("solver", "max_iterations", kind_integer, "10000", ">= 1", "iterations after which a solve gives up"), &
     key_t("solver", "sweeps", kind_integer, "1", ">= 1", "Gauss-Seidel sweeps in one iteration"), &
     key_t("solver", "relaxation", kind_real, "1.0", "in (0, 1]", &
           "relaxation factor: the fraction of a change of the neighbours' impulses that is applied", &
           note="found while iterating, from 1 down", chooser="method"), &
     key_t("solver", "acceleration", kind_choice, "'none'", "none momentum", &
           "`momentum`: accelerated sweeps, which start from impulses extrapolated from the last two iterations (Nesterov); "// &
           "not with a given `relaxation`. Default of", &
           note="by the method"), &
     key_t("solver", "velocity_scale", kind_real, "-1", "> 0", "velocity against which errors of a solve are compared", &
           unit="m/s", note="by rule"), &
     key_t("solver", "spot_checks", kind_real, "0.05", "in [0, 1]", &
           "part of the iterations that goes to comparisons of solves with ones of a tenth of the `accuracy`, "// &
           "which the closing lines sum up", note="0.05 with `velocity_error`, else none"), &
     key_t("solver", "check_every", kind_integer, "10", ">= 1", "iterations between two evaluations of the criterion"), &
     key_t("solver", "warm_start", kind_logical, ".true.", "", "start from the impulses of the previous step"), &
     key_t("solver", "layered_start", kind_logical, ".true.", "", &
           "carry loads by layers to the supports if a solve starts far from the solution (with `velocity_error` and gravity)"), &
     key_t("solver", "sleeping", kind_logical, ".false.", "", &
           "bodies at rest stand still and leave the contact problem until something disturbs them"), &
     key_t("solver", "sleep_after", kind_integer, "20", ">= 1", "steps at rest after which a body sleeps"), &
     key_t("solver", "sleep_speed", kind_real, "-1", "> 0", &
           "a body is at rest if its momentum is at most half of this times the root mean square of the impulses, and at "// &
           "most a twentieth of the normal impulses on it", &
           note="100 times `tolerance`"), &
     key_t("solver", "on_failure", kind_choice, "'continue'", "continue stop discard", &
           "after a solve that gave up: go on; write the step and stop; stop without it. "// &
           "One that diverged always stops without it")]

  type(key_t), parameter :: decomposition_keys(*) = &
    [key_t("decomposition", "partition", kind_choice, "'grid'", "grid metis", &
           "equal boxes, or occupied cells distributed by METIS"), &
     key_t("decomposition", "kind", kind_choice, "'dual'", "dual primal", &
           "a contact belongs to the subdomain of its midpoint, or of the centre of its candidate"), &
     key_t("decomposition", "grid", kind_integer, "3*0", ">= 1", &
           "boxes along each axis, two entries in 2D, three in 3D; only with `partition = 'grid'`", &
           count=3, note="found from `subdomains`"), &
     key_t("decomposition", "subdomains", kind_integer, "1", ">= 1", "number of subdomains; `method = 'nlgs'` has one", &
           note="the product of `grid` if given, else `1`"), &
     key_t("decomposition", "repartition_every", kind_integer, "0", ">= 0", "steps between two partitions; 0: never again"), &
     key_t("decomposition", "repartition_imbalance", kind_real, "0.0", "0 or > 1", &
           "a new partition is made if the largest over the mean number of contacts of a subdomain exceeds this value, and "// &
           "1.1 times what the last one reached, unless 16, 20, 24, 28, 32, 40, 48 ... steps have been made; 0: never")]

  type(key_t), parameter :: enriched_keys(*) = &
    [key_t("enriched", "direction", kind_real, "0", ">= 0", &
           "search direction l, which the safeguard lowers where the changes of the impulses grow", unit="1/W_aa or kg", &
           note="automatic"), &
     key_t("enriched", "direction_unit", kind_choice, "'relative'", "relative absolute", &
           "l in units of 1/W_aa, the inverse of the local operator of each contact, or in kg"), &
     key_t("enriched", "contacts", kind_choice, "'all'", "all active", &
           "contacts that take part: all, as in the paper; those that carry an impulse, and `nscdd_ep` feeds their impulses back", &
           note="`'all'`; `nscdd_ep` without `direction`: `'active'`"), &
     key_t("enriched", "interface", kind_choice, "'mumps'", "mumps cg", &
           "interface solve: direct, or conjugate gradient (`nscdd_ep` only; `newton` takes no other than `mumps`)"), &
     key_t("enriched", "cg_tolerance", kind_real, "1e-12", "in (0, 1)", &
           "relative residual at which the conjugate gradient stops (`nscdd_ep` with `interface = 'cg'` only)"), &
     key_t("enriched", "cg_max_iterations", kind_integer, "10000", ">= 1", &
           "iterations after which the conjugate gradient gives up (`nscdd_ep` with `interface = 'cg'` only)")]

  type(key_t), parameter :: output_keys(*) = &
    [key_t("output", "directory", kind_text, "'results'", "not empty", "directory of the results"), &
     key_t("output", "every", kind_integer, "1", ">= 0", "steps between two written states; 0: the last state only"), &
     key_t("output", "history_every", kind_integer, "1", ">= 1", &
           "steps between rows of `history.csv`, with the first and last step, those with events and missed goals"), &
     key_t("output", "contacts", kind_logical, ".true.", "", "write the contacts of each written state"), &
     key_t("output", "vtk", kind_logical, ".false.", "", &
           & "write `bodies.vtkhdf` and, with `contacts`, `contacts.vtkhdf` for ParaView, with each written state"), &
     key_t("output", "trace", kind_logical, ".false.", "", "write the convergence of every solve, check by check"), &
     key_t("output", "final_bodies", kind_logical, ".false.", "", &
           "write `final_bodies.h5`, a bodies file from which another scene starts"), &
     key_t("output", "final_forces", kind_logical, ".false.", "", &
           "write the forces of the contacts to `final_bodies.h5`, too: the first solve of the other scene starts from them"), &
     key_t("output", "checkpoint_every", kind_integer, "0", ">= 0", "steps between two checkpoints; 0: never"), &
     key_t("output", "fclib_step", kind_integer, "0", ">= 0", &
           "step whose contact problem is written to `step_N.hdf5` in the format of FCLIB; 0: none"), &
     key_t("output", "checkpoint_seconds", kind_real, "0.0", ">= 0", "wall time between two checkpoints; 0: never", unit="s"), &
     key_t("output", "walltime", kind_real, "0.0", ">= 0", &
           "wall time before which the run writes a checkpoint and stops; 0: it has no limit", unit="s"), &
     key_t("output", "tracked_bodies", kind_integer, "8*0", ">= 1", &
           "identifiers of bodies whose places and velocities `history.csv` has in each step", count=8, note="none"), &
     key_t("output", "tracked_forces", kind_logical, ".false.", "", &
           "write the force and the moment of all contacts on each of the `tracked_bodies`, too")]

  type(key_t), parameter :: region_keys(*) = &
    [key_t("region", "name", kind_text, "''", "letters, digits and underscores after a letter", &
           "a name of its own, with which its columns of history.csv begin", required=.true., note="required"), &
     key_t("region", "lower", kind_real, "3*-1e30", "", &
           "lower corner of the box; its third component is 0 in 2D. A component of -1e30 or left out: no side there", &
           count=3, unit="m", note="no side"), &
     key_t("region", "upper", kind_real, "3*1e30", "", &
           "upper corner of the box; its third component is 0 in 2D. A component of 1e30 or left out: no side there", &
           count=3, unit="m", note="no side"), &
     key_t("region", "bins", kind_integer, "1", "from 1 to 10000", &
           "bins of equal width along `axis`, whose means are in each written state", note="none"), &
     key_t("region", "axis", kind_choice, "''", "x y z", "axis along which there are `bins`", note="none"), &
     key_t("region", "sample_every", kind_integer, "1", ">= 1", &
           "steps from one sample to the next, of which the figures of a written state are the mean since the last one", &
           note="none: figures of the step itself")]
  !&>

  !> all keys, once `fill_keys` was called
  type(key_t), allocatable, protected :: keys(:)
  !> the keys of the shapes of boundaries among them
  type(collected_keys_t), protected :: surface_rows

contains

  !> Complete the table. Whoever reads it has called this before.
  subroutine fill_keys()
    type(diagnostic_holder_t), allocatable :: diagnostics(:)
    type(collected_keys_t) :: own
    type(key_t) :: row(1)
    integer :: k

    if (allocated(keys)) return
    allocate (keys(0))
    call add(scene_keys)
    call add(shape_keys)
    call surface_keys(surface_rows)
    do k = 1, size(surface_rows%keys)
      row(1) = row_of("boundary", "shape", surface_rows%keys(k)%key, surface_rows%keys(k)%kinds)
      call add(row)
    end do
    call add(boundary_keys)
    call complete_boundary_keys()
    call add(made_keys)
    call add(source_keys, "sample")
    call add(prepared_keys)
    call add(where_keys)
    call add(source_keys, "insertion")
    call add(material_keys)
    call add(law_keys)
    call collect_law_keys(own)
    keys(size(keys))%allowed = own%kinds
    do k = 1, size(own%keys)
      row(1) = row_of("law", "kind", own%keys(k)%key, own%keys(k)%kinds)
      call add(row)
    end do
    call add(time_keys)
    call add(solver_keys)
    call complete_solver_keys()
    call add(decomposition_keys)
    call add(enriched_keys)
    call add(output_keys)
    call registered_diagnostics(diagnostics)
    do k = 1, size(diagnostics)
      associate (features => diagnostics(k)%diagnostic%features())
        row(1) = key_t("output", features%key, kind_logical, ".false.", "", features%meaning)
      end associate
      call add(row)
    end do
    call add(region_keys)

  contains

    subroutine add(more, group)
      type(key_t), intent(in) :: more(:)
      !> of keys that have none
      character(len=*), intent(in), optional :: group
      type(key_t), allocatable :: longer(:)

      allocate (longer(size(keys) + size(more)))
      longer(:size(keys)) = keys
      longer(size(keys) + 1:) = more
      if (present(group)) longer(size(keys) + 1:)%group = group
      call move_alloc(longer, keys)
    end subroutine add

  end subroutine fill_keys

  !> What the shapes of boundaries say of themselves.
  subroutine complete_boundary_keys()
    type(surface_holder_t), allocatable :: surfaces(:)
    type(surface_features_t) :: features
    character(len=kind_length) :: solid, faceted
    integer :: k

    call registered_surfaces(surfaces)
    solid = ""
    faceted = ""
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      if (features%touches) solid = adjustl(trim(solid)//" "//features%kind)
      if (features%faceted) faceted = adjustl(trim(faceted)//" "//features%kind)
    end do
    do k = 1, size(keys)
      if (keys(k)%group /= "boundary") cycle
      if (keys(k)%name == "shape") keys(k)%allowed = trim(surface_rows%kinds)//" "//glued_grains//" "//wall_of_bodies
      if (keys(k)%chosen == solid_shapes) keys(k)%chosen = trim(solid)//" "//glued_grains//" "//wall_of_bodies
      if (keys(k)%chosen == faceted_shapes) keys(k)%chosen = faceted
    end do
  end subroutine complete_boundary_keys

  !> What the methods say of themselves.
  subroutine complete_solver_keys()
    type(method_holder_t), allocatable :: methods(:)
    type(method_features_t) :: features
    integer :: k, m

    do k = 1, size(keys)
      if (keys(k)%group /= "solver") cycle
      select case (keys(k)%name)
      case ("method")
        keys(k)%allowed = method_words(all_methods)
        call registered_methods(methods)
        do m = 1, size(methods)
          features = methods(m)%method%features()
          if (m > 1) keys(k)%meaning = trim(keys(k)%meaning)//";"
          keys(k)%meaning = adjustl(trim(keys(k)%meaning)//" "//features%meaning)
        end do
      case ("relaxation")
        keys(k)%chosen = method_words(that_relax)
      case ("acceleration")
        keys(k)%meaning = trim(keys(k)%meaning)//" "//quoted_names(accelerated, "`", "and")//" and, on active contacts, "// &
          & quoted_names(accelerated_on_active, "`", "and")
      end select
    end do
  end subroutine complete_solver_keys

  !> The row of a key that some kinds of a group have.
  pure type(key_t) function row_of(group, chooser, key, kinds) result(row)
    !> the group, and its key that says the kind; the kinds that have the key
    character(len=*), intent(in) :: group, chooser, kinds
    type(declared_key_t), intent(in) :: key

    row = key_t(group, key%name, kind_real, key%default, key%allowed, key%meaning, count=key%count, unit=key%unit, &
      & chooser=chooser, chosen=kinds)
    if (key%default /= "") return
    row%default = "0"
    if (key%count == 3) row%default = "3*0"
    row%note = "required"
  end function row_of

end module gravier_config_table
