!> The keys of the groups that make grains: &sample, &insertion and &material.
module gravier_config_table_grains
  use gravier_config_key, only: key_t, kind_integer, kind_real, kind_choice, kind_text
  implicit none
  private
  public :: made_keys, source_keys, prepared_keys, where_keys, material_keys

  !> distributions of the radii that have bounds
  character(len=*), parameter :: bounded_radii = "uniform uniform_volume log_normal"

  ! fprettify leaves the tables as they are laid out here
  !&<
  !> of &sample: those before and behind the keys in common
  type(key_t), parameter :: made_keys(*) = &
    [key_t("sample", "arrangement", kind_choice, "'loose'", "lattice loose", &
           "grains in the cells of a lattice, or at random without touching"), &
     key_t("sample", "preparation", kind_choice, "'none'", "none settled compacted", &
           "what `gravier_sample` does with the grains: nothing, let gravity settle them, or compact them"), &
     key_t("sample", "container", kind_choice, "'box'", "box boundaries", &
           "what holds the grains: planes on the sides of the box, or the boundaries of the case. Loose grains are placed "// &
           "clear of all boundaries"), &
     key_t("sample", "inner_point", kind_real, "3*0", "", &
           "a point inside the boundaries; grains are placed only where a straight line from there meets no boundary; its "// &
           "third component is 0 in 2D", &
           count=3, unit="m", note="the middle of the box", chooser="container", chosen="boundaries"), &
     key_t("sample", "count", kind_integer, "0", ">= 1", "number of grains", note="required", required=.true.)]

  type(key_t), parameter :: prepared_keys(*) = &
    [key_t("sample", "grain_materials", kind_text, "''", "", &
           "names of the `&material` groups that grains are dealt out to at random, with commas between", &
           note="the first, for all grains"), &
     key_t("sample", "material_shares", kind_real, "8*0", "> 0", &
           "fractions by number of the first eight `grain_materials`, to any scale", &
           count=8, planar=8, note="equal fractions"), &
     key_t("sample", "velocity", kind_real, "3*0", "", &
           "velocity of the sample as a whole; its third component is 0 in 2D", &
           count=3, unit="m/s", chooser="preparation", chosen="none"), &
     key_t("sample", "velocity_spread", kind_real, "3*0", ">= 0", &
           "most by which each component of the velocity of a grain is drawn above or below `velocity`, all values as likely; "// &
           "then all are moved by the same velocity so that the momentum is that of `velocity`", &
           count=3, unit="m/s", chooser="preparation", chosen="none"), &
     key_t("sample", "box", kind_real, "3*0", ">= 0", &
           "size of the box along each axis; if the last is 0, the lattice or `solid_fraction` determines it; "// &
           "the third is 0 in 2D", &
           count=3, unit="m", note="the period, along an axis that is periodic"), &
     key_t("sample", "solid_fraction", kind_real, "0.35", "in (0, 0.6)", &
           "fraction of the box that the grains fill, or the balls that enclose those with shapes, if its last size is 0; "// &
           "random positions reach about 0.53 in 2D and 0.35 in 3D for grains of one radius in a wide box, and "// &
           "0.45 in a 2D box two diameters wide; a fraction that leaves grains without a place is refused", &
           note="`0.35` in 2D, `0.2` in 3D", chooser="arrangement", chosen="loose"), &
     key_t("sample", "seed", kind_integer, "1", "", "seed of the random radii, places, shapes, materials and velocities"), &
     key_t("sample", "pressure", kind_real, "0", "> 0", "pressure on the box", &
           unit="Pa, N/m in 2D", note="required", chooser="preparation", chosen="compacted"), &
     key_t("sample", "rest_tolerance", kind_real, "1e-6", "> 0", &
           "mean kinetic energy of a grain at rest, of disks and spheres without their spins, over m g R (settled) or over "// &
           "`pressure` R^`dimension` (compacted)", &
           chooser="preparation", chosen="settled compacted"), &
     key_t("sample", "max_steps", kind_integer, "100000", ">= 1", "steps after which the preparation gives up", &
           chooser="preparation", chosen="settled compacted"), &
     key_t("sample", "file", kind_text, "'sample.h5'", "not empty", &
           "the bodies file that `gravier_sample` writes, with the ending .h5 or .hdf5")]

  !> what the groups that draw grains at random have in common; the table gives these keys the name of a group
  type(key_t), parameter :: source_keys(*) = &
    [key_t("", "radii", kind_choice, "'single'", "single uniform uniform_volume log_normal table", &
           "distribution of the radii: one radius, uniform by number, uniform by volume, log-normal, or from a table"), &
     key_t("", "radius", kind_real, "0", "> 0", "radius of all grains", &
           unit="m", note="required", chooser="radii", chosen="single"), &
     key_t("", "radius_min", kind_real, "0", "> 0", "smallest radius", &
           unit="m", note="required", chooser="radii", chosen=bounded_radii), &
     key_t("", "radius_max", kind_real, "0", "> 0", "largest radius, at least `radius_min`", &
           unit="m", note="required", chooser="radii", chosen=bounded_radii), &
     key_t("", "radius_mean", kind_real, "0", "> 0", &
           "radius whose logarithm is the mean of the logarithms, from `radius_min` to `radius_max`", &
           unit="m", note="required", chooser="radii", chosen="log_normal"), &
     key_t("", "radius_deviation", kind_real, "0", "> 0, at most 1000", "standard deviation of ln(radius/`radius_mean`)", &
           note="required", chooser="radii", chosen="log_normal"), &
     key_t("", "radius_table", kind_text, "''", "not empty", "path of a CSV file with columns `radius,share`", &
           note="required", chooser="radii", chosen="table"), &
     key_t("", "grain_shapes", kind_text, "''", "", &
           "names of the shapes that grains have, of the file `shapes` of `&scene`, with commas between; `disk` in 2D and "// &
           "`sphere` in 3D stand for themselves. Radii are those of the balls about the centres of mass that enclose the grains", &
           note="all shapes of the file"), &
     key_t("", "grain_shares", kind_real, "8*0", "> 0", &
           "fractions by number of the first eight `grain_shapes`, to any scale", &
           count=8, planar=8, note="equal fractions")]

  !> of &insertion: those before the keys in common
  type(key_t), parameter :: where_keys(*) = &
    [key_t("insertion", "name", kind_text, "''", "not empty", "a name of its own, for messages and the log", &
           note="`'insertion K'`, K its number"), &
     key_t("insertion", "region", kind_choice, "'box'", "box ball", &
           "where grains enter, wholly inside: a box, or a ball (in 2D a disk)"), &
     key_t("insertion", "lower", kind_real, "3*0", "", "lower corner of the box; its third component is 0 in 2D", &
           count=3, unit="m", note="required", chooser="region", chosen="box"), &
     key_t("insertion", "upper", kind_real, "3*0", "", "upper corner of the box; its third component is 0 in 2D", &
           count=3, unit="m", note="required", chooser="region", chosen="box"), &
     key_t("insertion", "centre", kind_real, "3*0", "", "centre of the ball; its third component is 0 in 2D", &
           count=3, unit="m", note="required", chooser="region", chosen="ball"), &
     key_t("insertion", "region_radius", kind_real, "0", "> 0", "radius of the ball", &
           unit="m", note="required", chooser="region", chosen="ball"), &
     key_t("insertion", "rate", kind_real, "-1", "> 0", &
           "grains that enter in a second; without `rate` and `mass_rate` they enter as fast as they find places", &
           unit="1/s", note="no bound"), &
     key_t("insertion", "mass_rate", kind_real, "-1", "> 0", "mass that enters in a second, in the place of `rate`", &
           unit="kg/s", note="no bound"), &
     key_t("insertion", "count", kind_integer, "0", ">= 1", "grains after which it ends", note="no bound"), &
     key_t("insertion", "mass", kind_real, "-1", "> 0", "mass beyond which no grain enters", unit="kg", note="no bound"), &
     key_t("insertion", "start", kind_real, "0.0", ">= 0", "time from which grains enter", unit="s"), &
     key_t("insertion", "end", kind_real, "-1", "> 0", "time from which no grain enters any more, later than `start`", &
           unit="s", note="never"), &
     key_t("insertion", "velocity", kind_real, "3*0", "", "velocity of the grains that enter; its third component is 0 in 2D", &
           count=3, unit="m/s"), &
     key_t("insertion", "velocity_spread", kind_real, "3*0", ">= 0", &
           "most by which each component of the velocity of a grain is above or below `velocity`, all values as likely", &
           count=3, unit="m/s"), &
     key_t("insertion", "material", kind_text, "''", "not empty", "name of the `&material` of the grains", &
           note="the first"), &
     key_t("insertion", "seed", kind_integer, "1", "", "seed of the random places, radii, velocities and shapes")]

  type(key_t), parameter :: material_keys(*) = &
    [key_t("material", "name", kind_text, "''", "not empty", "a name of its own", note="required", required=.true.), &
     key_t("material", "density", kind_real, "-1", "> 0", "density of its grains, where the bodies file gives no masses", &
           unit="kg/m^3, kg/m^2 in 2D", note="the value of `density` of `&scene`")]
  !&>

end module gravier_config_table_grains
