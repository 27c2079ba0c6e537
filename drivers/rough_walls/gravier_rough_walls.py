#!/usr/bin/env python3
"""Make rough walls of glued grains in the place of planes on the sides of a sample, for a shear test or an incline, say."""
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import gravier
except ImportError as missing:
    sys.exit(f"gravier_rough_walls: error: {missing}; expected a python3 with h5py and numpy (apt install python3-h5py)")
from one_line import OneLineParser, plain, positive, run_tool  # noqa: E402
from whole_file import NOWHERE  # noqa: E402

#: what begins with a minus and is a side, or some with commas between
SIDES = re.compile(r"-[a-z](,[-+][a-z])*$")


def parse(arguments):
    parser = OneLineParser(prog="gravier_rough_walls", description=__doc__)
    parser.add_argument("sample", type=Path, metavar="SAMPLE", help="a bodies file with planes, such as one of gravier_sample, .h5 or .csv")
    parser.add_argument("--sides", required=True, metavar="SIDE,SIDE", help="-x, +x, -y, ...: the first one becomes group 1, the next one group 2")
    parser.add_argument("--depth", type=positive, metavar="D", help="grains whose centres are nearer to the plane than this are glued [m] (the mean diameter)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the bodies file that is written, .h5")
    parser._negative_number_matcher = SIDES
    return parser.parse_args(arguments)


def main(arguments=None):
    options = parse(arguments)
    sides = options.sides.split(",")
    if len(set(sides)) < len(sides):
        print(f"gravier_rough_walls: error: --sides {plain(options.sides)}: a side twice; expected each side once", file=sys.stderr)
        return 2
    try:
        found = gravier.rough_walls(options.sample, options.out, {side: number for number, side in enumerate(sides, 1)}, options.depth)
    except gravier.ResultsError as refused:
        print(f"gravier_rough_walls: error: {plain(refused)}", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"gravier_rough_walls: error: {plain(options.out)}: {plain(problem.strerror or problem)}; expected a file that can be written", file=sys.stderr)
        return 2 if isinstance(problem, NOWHERE) else 4
    for number, (side, count) in enumerate(found.items(), 1):
        print(f"{side}: group {number}, {count} grain{'s' if count > 1 else ''}")
    print(options.out)
    return 0


if __name__ == "__main__":
    run_tool(main)
