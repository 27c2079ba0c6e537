#!/usr/bin/env python3
"""Measure what runs left in their directories, against time: mixing and segregation, heaps and collapses, tests between walls,
discharge through outlets, contact forces and anisotropy; fields on a grid: density, velocity, granular temperature, stress;
and the sieve curve of a state or of a bodies file."""
import sys
from pathlib import Path

DRIVERS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(DRIVERS / "python"))
try:
    import numpy

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_measure: error: {missing}; expected a python3 with h5py and numpy (apt install python3-h5py)")
from gravier.field_files import ending_of  # noqa: E402
from gravier.force_networks import directions_of, distribution_of, networks, table_of  # noqa: E402
from gravier.joined_bodies import opened_file  # noqa: E402
from gravier.measured import write_measured  # noqa: E402
from gravier.mixing import split_radius  # noqa: E402
from gravier.wall_tests import sine_of_means, stresses_from, ways_through_air  # noqa: E402
from one_line import NEGATIVE, OneLineParser, finite, length, plain, positive, run_tool, steps_of, whole  # noqa: E402
from whole_file import PICTURES, claim, written  # noqa: E402

#: what its tables begin with, by the kind of measure
HEADS = {"mixing": b"step,time,mixing,", "heap": b"step,time,height,", "walls": b"step,time,axial_strain,", "outflow": b"step,time,(total_)?left,",
         "forces": b"step,time,contacts,normal_mean,", "fields": b"step,time,states,", "sieve": b"size,passing,", "distribution": b"force,contacts,", "directions": b"angle,count,"}
#: what a file of fields begins with, by its ending
IMAGES = {f".{ending}": rb'<\?xml version="1.0"\?>\n<VTKFile type="' + kind for ending, kind in (("vti", b"ImageData"), ("vts", b"StructuredGrid"))}
#: units of columns that have one; of stresses by the dimension
UNITS = {"time": "s", "height_difference": "m", "height": "m", "front_low": "m", "front_high": "m", "length": "m", "angle": "degrees",
         "angle_low": "degrees", "angle_high": "degrees", "total_left": "grains", "total_left_mass": "kg", "number_rate": "1/s", "mass_rate": "kg/s",
         "normal_mean": "N", "angle_c": "degrees", "angle_n": "degrees", "angle_t": "degrees"}


def parse(arguments):
    parser = OneLineParser(prog="gravier_measure", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="mixing | heap | walls | outflow | forces | fields | sieve", parser_class=OneLineParser)
    mixing = kinds.add_parser("mixing", help="Lacey's index and segregation of two kinds of grains, in each written state")
    mixing.add_argument("--by", default="size", metavar="WHAT", help="size, material, or x, y, z: where grains were at the start (size)")
    mixing.add_argument("--value", metavar="V", help="the first kind has radii above V [m] (middle of the radii), is of material V (the second), or began above V [m] "
                        "(the median)")
    mixing.add_argument("--cell", type=positive, metavar="L", help="edge of the cells [m] (5 mean diameters, 3.5 in space)")
    heap = kinds.add_parser("heap", help="ends, run-out, height and slopes of a heap or a collapsed column, in each written state")
    heap.add_argument("--along", metavar="AXIS", help="x or y: in space a heap in a channel, in the place of a round one")
    heap.add_argument("--shares", type=finite, nargs=2, default=(0.1, 0.9), metavar=("LOW", "HIGH"), help="of the height, between which slopes are (0.1 0.9)")
    heap.add_argument("--width", type=positive, metavar="L", help="of the columns [m] (two mean diameters)")
    heap.add_argument("--floor", type=finite, metavar="Z", help="height of the floor [m] (that of the lowest grains)")
    walls = kinds.add_parser("walls", help="strains, void ratio, stress ratio and sin phi of a sample between planes (&output boundary_forces = .true.)")
    walls.add_argument("--axial", metavar="AXIS", help="axis of the load (the last one)")
    walls.add_argument("--lateral", metavar="AXES", help="axes whose mean stress the axial one is compared with (all others)")
    outflow = kinds.add_parser("outflow", help="number and mass of the grains that have left through outlets, and their rates")
    forces = kinds.add_parser("forces", help="distribution of contact forces, coordination, anisotropies and the strength that they make, in written states with contacts")
    forces.add_argument("--region", metavar="NAME", help="contacts and grains in this &region of the case (all)")
    forces.add_argument("--friction", type=positive, metavar="MU", help="coefficient of friction of all contacts between grains (that of the case)")
    forces.add_argument("--mean", type=whole(1), default=1, metavar="N", help="N states after each other make a row in the place of single ones")
    forces.add_argument("--distribution", type=Path, metavar="FILE", help="a table of the distribution of forces of all states, .csv")
    forces.add_argument("--width", type=positive, default=0.2, metavar="W", help="of its bins, in forces over their mean (0.2)")
    forces.add_argument("--directions", type=Path, metavar="FILE", help="a table of contacts and forces of all states by direction, .csv")
    forces.add_argument("--bins", type=whole(1), metavar="N", help="of directions (18 over half a turn, in space 9 over a quarter)")
    fields = kinds.add_parser("fields", help="solid fraction, density, velocity, granular temperature, stress and what follows from them on a grid, means over written states")
    fields.add_argument("--cell", type=positive, required=True, metavar="L", help="edge of the cells [m]; the nearest one of which a whole number fits into the scene is taken")
    fields.add_argument("--axes", metavar="AXES", help="of the grid, such as xz or z; fields are means along the others (all)")
    fields.add_argument("--states", type=steps_of, metavar="N,N:M", help="written steps and ranges of them as 5000:8000 or 5000:, ends included, or all (all after the start)")
    fields.add_argument("--smooth", type=positive, default=0.0, metavar="W", help="width of the kernel [m] (means over the cells)")
    fields.add_argument("--each", action="store_true", help="fields of each state by itself in the place of their mean")
    fields.add_argument("--vtk", type=Path, metavar="FILE", help="a file for ParaView, .vti, or .vts of a periodic cell that leans")
    fields.add_argument("--columns", metavar="A,B", help="of the picture (solid_fraction,velocity,granular_temperature,pressure,shear_ratio,inertial_number)")
    sieve = kinds.add_parser("sieve", help="the part of the mass that passes a sieve against its size, D10, D50, D60 and C_u, of a state or of a bodies file")
    sieve.add_argument("--step", type=whole(0), metavar="N", help="a written step (the last one)")
    sieve.add_argument("--sieves", type=length, nargs="+", metavar="SIZE", help="sizes of holes [m], or with their unit such as 0.063mm (40 from the smallest body to the largest one)")
    for kind in (forces, fields):
        kind.add_argument("--box", type=finite, nargs="+", metavar="X0", help="in the box X0 X1 Y0 Y1 [Z0 Z1] [m] (all)")
    for kind in (walls, outflow):
        kind.add_argument("--mean", type=whole(1), default=1, metavar="N", help="means of N steps after each other (rows of history.csv)")
    for kind in (mixing, heap, walls, outflow, forces, fields):
        kind.add_argument("--since", type=finite, default=0.0, metavar="T", help="time at which the process begins; what was before is left out [s] (0)")
    for kind in (mixing, heap, walls, outflow, forces, fields, sieve):
        kind.add_argument("--plot", type=Path, metavar="FILE", help="a picture of what is measured, .png or .svg (needs matplotlib)")
        kind._negative_number_matcher = NEGATIVE
        kind.add_argument("directory", type=Path, metavar="DIR", help=f"output directory of a run{', or a bodies file, .h5 or .csv' if kind is sieve else ''}")
        kind.add_argument("--out", type=Path, metavar="FILE", help=f"the table, .csv ({kind.prog.split()[-1]}.csv in DIR)")
    return parser.parse_args(arguments)


def measure(run, options):
    if options.kind == "mixing":
        return gravier.mixing(run, options.by, options.value, options.cell, options.since)
    if options.kind == "heap":
        return gravier.heap(run, options.along, options.shares, options.width, options.floor, options.since)
    if options.kind == "sieve":
        return gravier.sieve(run, options.step, options.sieves)
    if options.kind == "outflow":
        return gravier.outflow(run, options.mean, options.since)
    return gravier.wall_test(run, options.axial, options.lateral, options.mean, options.since)


def measure_forces(run, options):
    """The tables of the forces by kind, and the row of all states together."""
    found = networks(run, options.region, options.box, options.friction, options.since)
    tables = {"forces": table_of(found, options.mean)}
    if options.distribution or options.plot:
        tables["distribution"] = distribution_of(found, options.width)
    if options.directions or options.plot:
        tables["directions"] = directions_of(found, options.bins)
    return tables, table_of(found, len(found))


def measure_fields(run, options):
    """The fields of the chosen states, a list: of all together, or of each."""
    if options.plot and len(options.axes or "xyz"[:run.dimension]) == 3:
        raise gravier.ResultsError(f"--plot {options.plot}: a grid of three axes; expected two axes or one for a picture, such as --axes xz")
    asked = (run, options.cell, options.axes, options.states, options.smooth, options.box, options.since)
    found = gravier.fields_of_states(*asked) if options.each else [gravier.fields(*asked)]
    if options.vtk and options.vtk.suffix != ending_of(found[0]):
        raise gravier.ResultsError(f"--vtk {options.vtk}: expected a name that ends in {ending_of(found[0])}")
    return found


def images_of(options, fields):
    """The files of the fields, by their places: of each state one with its step in its name."""
    return {options.vtk.with_stem(f"{options.vtk.stem}_{one.step[0]:08d}") if options.each else options.vtk: one for one in fields} if options.vtk else {}


def table_of_fields(fields):
    """The rows of all states one below the other, a column a component."""
    flat = [one.flat() for one in fields]
    return gravier.Table({name: numpy.concatenate([columns[name] for columns in flat]) for name in flat[0] if all(name in columns for columns in flat)})


def draw(options, run, tables, together):
    """The picture of what is measured; matplotlib and the modules of gravier_plot are loaded only here."""
    sys.path.insert(0, str(DRIVERS / "plot"))
    try:
        import matplotlib
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
    except ImportError as missing:
        raise gravier.ResultsError(f"{missing}; expected a python3 with matplotlib (apt install python3-matplotlib), or no --plot") from None
    from picture_style import SETTINGS, PictureError, save_picture
    plt.rcParams.update(SETTINGS)
    try:
        if options.kind == "forces":
            from force_pictures import draw_forces
            figure = draw_forces(tables["distribution"], tables["directions"], together.beta[0], run.dimension)
        elif options.kind == "fields":
            from field_pictures import draw_fields
            from picture_space import Walls
            walls = Walls(run, int(together[-1].step[0])) if run.dimension == 2 else None
            figure = draw_fields(together[-1], options.columns.split(",") if options.columns else None, walls)
        elif options.kind == "sieve":
            from sieve_picture import draw_sieve
            figure = draw_sieve(tables["sieve"], gravier.sieve_sizes(run, options.step))
        else:
            from measure_pictures import draw_measured
            figure = draw_measured(options.kind, tables[options.kind], run.dimension)
        save_picture(figure, options.plot)
    except PictureError as refused:
        raise gravier.ResultsError(str(refused)) from None


def in_words(row, run):
    """A row of a table: its names, values and units. Components of tensors and of directions in space are in the table alone."""
    unit = "N/m" if run.dimension == 2 else "Pa"
    return ", ".join(f"{name.replace('_', ' ')} {value:.4g} {UNITS.get(name) or (unit if name.endswith('_stress') else '')}".rstrip()
                     for name, value in row.items() if name != "step" and not name.startswith(("fabric_", "axis_")))


def said_of_fields(fields):
    """The grid, and the largest values of the last fields."""
    last, size = fields[-1], " x ".join(f"{edge:.4g}" for edge in fields[-1].size)
    states = f"mean of {last.states[0]} states, the last one" if last.states[0] > 1 else "state"
    largest = [f"{name.replace('_', ' ')} {numpy.max(last[name], initial=0.0, where=numpy.isfinite(last[name])):.4g}" for name in ("solid_fraction", "granular_temperature", "pressure") if name in last]
    return [f"{' x '.join(map(str, last.shape))} cells of {size} m along {', '.join(last.axes)}; {states} of step {last.step[0]}; grains {last.grains.sum():.6g}, largest {', '.join(largest)}"]


def said(table, run, options, together=None):
    """The last row in words, of a test its strength, and of forces those of all states."""
    if options.kind == "fields":
        return said_of_fields(together)
    if options.kind == "sieve":
        return [", ".join(f"{name} {values[0]:.4g}{' m' if name.startswith('D') else ''}" for name, values in gravier.sieve_sizes(run, options.step).items())]
    lines = [f"last row: {in_words({name: values[-1] for name, values in table.items()}, run)}"]
    if options.kind == "mixing" and options.by == "size":
        limit, one_range = split_radius(run, options.value, options.since)
        lines.append(f"the first kind has radii above {limit:.4g} m" + ("; radii have no gap there: this divides one range of sizes, not two kinds" if one_range else ""))
    if options.kind == "walls":
        sine = numpy.where(numpy.isfinite(table.sin_phi), table.sin_phi, -numpy.inf)
        peak, first = int(sine.argmax()), min(int(0.6 * len(table)), len(table) - 1)
        last = sine_of_means(run, (options.axial, options.lateral, options.mean), first, options.since)
        lines.append(f"sin phi: largest {sine[peak]:.3g} at an axial strain of {table.axial_strain[peak]:.4g}, of the means of the last {len(table) - first} rows "
                     f"{last:.3g}; stresses are {stresses_from(run)}")
        lines += [f"{plain(name)} bears nothing before {time:.6g} s, and strains count {strain:.3g} for its way until then; --since {later:.6g} leaves it out"
                  for name, time, strain, later in ways_through_air(run, options.since)]
    if together:
        lines.append(f"all states: {in_words({name: values[0] for name, values in together.items() if name != 'time'}, run)}")
    return lines


def main(arguments=None):
    options = parse(arguments)
    of_file = options.kind == "sieve" and options.directory.suffix in (".h5", ".csv")
    places = {options.kind: options.out or (options.directory.with_name(f"{options.directory.stem}_sieve.csv") if of_file else options.directory / f"{options.kind}.csv")}
    places.update({name: getattr(options, name, None) for name in ("distribution", "directions") if getattr(options, name, None)})
    for name, place in places.items():
        claim(place, {".csv": HEADS[name]})
    if options.plot:
        claim(options.plot, PICTURES)
    if getattr(options, "vtk", None):
        claim(options.vtk, IMAGES)
    together, images = None, {}
    try:
        run = opened_file(options.directory) if of_file else gravier.Run(options.directory)
        if options.kind == "forces":
            tables, together = measure_forces(run, options)
        elif options.kind == "fields":
            together = measure_fields(run, options)
            tables, images = {"fields": table_of_fields(together)}, images_of(options, together)
        else:
            tables = {options.kind: measure(run, options)}
        lines = said(tables[options.kind], run, options, together)
        if options.plot:
            draw(options, run, tables, together)
    except gravier.ResultsError as refused:
        print(f"gravier_measure: error: {plain(refused)}", file=sys.stderr)
        return 2
    for name, place in places.items():
        with written(place, {".csv": HEADS[name]}) as part:
            # tables without steps are those of all states together
            if "step" in tables[name]:
                write_measured(part, run, tables[name])
            else:
                gravier.write_table(part, tables[name], 9)
    for place, one in images.items():
        with written(place, IMAGES) as part:
            one.write_vtk(part)
    print("\n".join([*lines, *map(str, [*places.values(), *images]), *([str(options.plot)] if options.plot else [])]))
    return 0


if __name__ == "__main__":
    run_tool(main)
