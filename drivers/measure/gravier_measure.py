#!/usr/bin/env python3
"""Measure what runs left in their directories, against time: mixing and segregation, heaps and collapses, tests between walls,
discharge through outlets."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import numpy

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_measure: error: {missing}; expected a python3 with h5py and numpy (apt install python3-h5py)")
from gravier.measured import write_measured  # noqa: E402
from gravier.mixing import split_radius  # noqa: E402
from gravier.wall_tests import sine_of_means, stresses_from, ways_through_air  # noqa: E402
from one_line import NEGATIVE, OneLineParser, finite, plain, positive, run_tool, whole  # noqa: E402
from whole_file import claim, written  # noqa: E402

#: what its tables begin with, by the kind of measure
HEADS = {"mixing": b"step,time,mixing,", "heap": b"step,time,height,", "walls": b"step,time,axial_strain,", "outflow": b"step,time,left,"}
#: units of columns that have one; of stresses by the dimension
UNITS = {"time": "s", "height_difference": "m", "height": "m", "front_low": "m", "front_high": "m", "length": "m", "angle": "degrees",
         "angle_low": "degrees", "angle_high": "degrees", "left": "grains", "left_mass": "kg", "number_rate": "1/s", "mass_rate": "kg/s"}


def parse(arguments):
    parser = OneLineParser(prog="gravier_measure", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="mixing | heap | walls | outflow", parser_class=OneLineParser)
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
    for kind in (walls, outflow):
        kind.add_argument("--mean", type=whole(1), default=1, metavar="N", help="means of N steps after each other in the place of single steps")
    for kind in (mixing, heap, walls, outflow):
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


def said(table, run, options):
    """The last row in words, and of a test its strength."""
    unit = "N/m" if run.dimension == 2 else "Pa"
    last = [f"{name.replace('_', ' ')} {values[-1]:.4g} {UNITS.get(name) or (unit if name.endswith('_stress') else '')}".rstrip()
            for name, values in table.items() if name != "step"]
    lines = [f"last row: {', '.join(last)}"]
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
    return lines


def main(arguments=None):
    options = parse(arguments)
    out = options.out or options.directory / f"{options.kind}.csv"
    kinds = {".csv": HEADS[options.kind]}
    claim(out, kinds)
    try:
        run = gravier.Run(options.directory)
        table = measure(run, options)
        lines = said(table, run, options)
    except gravier.ResultsError as refused:
        print(f"gravier_measure: error: {plain(refused)}", file=sys.stderr)
        return 2
    with written(out, kinds) as part:
        write_measured(part, run, table)
    print("\n".join([*lines, str(out)]))
    return 0


if __name__ == "__main__":
    run_tool(main)
