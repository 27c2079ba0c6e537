#!/usr/bin/env python3
"""Measure what runs left in their directories, against time: mixing and segregation, heaps and collapses, tests between walls,
discharge through outlets, contact forces and anisotropy."""
import sys
from pathlib import Path

DRIVERS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(DRIVERS / "python"))
try:
    import numpy

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_measure: error: {missing}; expected a python3 with h5py and numpy (apt install python3-h5py)")
from gravier.force_networks import directions_of, distribution_of, networks, table_of  # noqa: E402
from gravier.measured import write_measured  # noqa: E402
from gravier.mixing import split_radius  # noqa: E402
from gravier.wall_tests import sine_of_means, stresses_from, ways_through_air  # noqa: E402
from one_line import NEGATIVE, OneLineParser, finite, plain, positive, run_tool, whole  # noqa: E402
from whole_file import PICTURES, claim, written  # noqa: E402

#: what its tables begin with, by the kind of measure
HEADS = {"mixing": b"step,time,mixing,", "heap": b"step,time,height,", "walls": b"step,time,axial_strain,", "outflow": b"step,time,left,",
         "forces": b"step,time,contacts,normal_mean,", "distribution": b"force,contacts,", "directions": b"angle,count,"}
#: units of columns that have one; of stresses by the dimension
UNITS = {"time": "s", "height_difference": "m", "height": "m", "front_low": "m", "front_high": "m", "length": "m", "angle": "degrees",
         "angle_low": "degrees", "angle_high": "degrees", "left": "grains", "left_mass": "kg", "number_rate": "1/s", "mass_rate": "kg/s",
         "normal_mean": "N", "angle_c": "degrees", "angle_n": "degrees", "angle_t": "degrees"}


def parse(arguments):
    parser = OneLineParser(prog="gravier_measure", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="mixing | heap | walls | outflow | forces", parser_class=OneLineParser)
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
    forces.add_argument("--box", type=finite, nargs="+", metavar="X0", help="contacts and grains in the box X0 X1 Y0 Y1 [Z0 Z1] [m] (all)")
    forces.add_argument("--friction", type=positive, metavar="MU", help="coefficient of friction of all contacts between grains (that of the case)")
    forces.add_argument("--mean", type=whole(1), default=1, metavar="N", help="N states after each other make a row in the place of single ones")
    forces.add_argument("--distribution", type=Path, metavar="FILE", help="a table of the distribution of forces of all states, .csv")
    forces.add_argument("--width", type=positive, default=0.2, metavar="W", help="of its bins, in forces over their mean (0.2)")
    forces.add_argument("--directions", type=Path, metavar="FILE", help="a table of contacts and forces of all states by direction, .csv")
    forces.add_argument("--bins", type=whole(1), metavar="N", help="of directions (18 over half a turn, in space 9 over a quarter)")
    forces.add_argument("--plot", type=Path, metavar="FILE", help="a picture of both, .png or .svg (needs matplotlib)")
    for kind in (walls, outflow):
        kind.add_argument("--mean", type=whole(1), default=1, metavar="N", help="means of N steps after each other in the place of single steps")
    for kind in (mixing, heap, walls, outflow, forces):
        kind._negative_number_matcher = NEGATIVE
        kind.add_argument("--since", type=finite, default=0.0, metavar="T", help="time at which the process begins; what was before is left out [s] (0)")
        kind.add_argument("directory", type=Path, metavar="DIR", help="output directory of a run")
        kind.add_argument("--out", type=Path, metavar="FILE", help=f"the table, .csv ({kind.prog.split()[-1]}.csv in DIR)")
    return parser.parse_args(arguments)


def measure(run, options):
    if options.kind == "mixing":
        return gravier.mixing(run, options.by, options.value, options.cell, options.since)
    if options.kind == "heap":
        return gravier.heap(run, options.along, options.shares, options.width, options.floor, options.since)
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


def draw(tables, together, dimension, path):
    """The picture of the forces; matplotlib and the modules of gravier_plot are loaded only here."""
    sys.path.insert(0, str(DRIVERS / "plot"))
    try:
        import matplotlib
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
    except ImportError as missing:
        raise gravier.ResultsError(f"{missing}; expected a python3 with matplotlib (apt install python3-matplotlib), or no --plot") from None
    from force_pictures import draw_forces
    from picture_style import SETTINGS, PictureError, save_picture
    plt.rcParams.update(SETTINGS)
    try:
        save_picture(draw_forces(tables["distribution"], tables["directions"], together.beta[0], dimension), path)
    except PictureError as refused:
        raise gravier.ResultsError(str(refused)) from None


def in_words(row, run):
    """A row of a table: its names, values and units. Components of tensors and of directions in space are in the table alone."""
    unit = "N/m" if run.dimension == 2 else "Pa"
    return ", ".join(f"{name.replace('_', ' ')} {value:.4g} {UNITS.get(name) or (unit if name.endswith('_stress') else '')}".rstrip()
                     for name, value in row.items() if name != "step" and not name.startswith(("fabric_", "axis_")))


def said(table, run, options, together=None):
    """The last row in words, of a test its strength, and of forces those of all states."""
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
        lines += [f"{plain(name)} bears nothing before {time:.6g} s, and strains count {strain:.3g} for its way until then; --since {time:.6g} leaves it out"
                  for name, time, strain in ways_through_air(run, options.since)]
    if together:
        lines.append(f"all states: {in_words({name: values[0] for name, values in together.items() if name != 'time'}, run)}")
    return lines


def main(arguments=None):
    options = parse(arguments)
    places = {options.kind: options.out or options.directory / f"{options.kind}.csv"}
    places.update({name: getattr(options, name, None) for name in ("distribution", "directions") if getattr(options, name, None)})
    for name, place in places.items():
        claim(place, {".csv": HEADS[name]})
    picture = getattr(options, "plot", None)
    if picture:
        claim(picture, PICTURES)
    together = None
    try:
        run = gravier.Run(options.directory)
        if options.kind == "forces":
            tables, together = measure_forces(run, options)
        else:
            tables = {options.kind: measure(run, options)}
        lines = said(tables[options.kind], run, options, together)
        if picture:
            draw(tables, together, run.dimension, picture)
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
    print("\n".join([*lines, *map(str, places.values()), *([str(picture)] if picture else [])]))
    return 0


if __name__ == "__main__":
    run_tool(main)
