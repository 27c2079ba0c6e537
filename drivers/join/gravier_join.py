#!/usr/bin/env python3
"""Join bodies files: add an intruder, or another sample, to a sample. Bodies of the other files are renumbered; overlaps are refused."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import gravier
except ImportError as missing:
    sys.exit(f"gravier_join: error: {missing}; expected a python3 with h5py and numpy (apt install python3-h5py)")
from one_line import NEGATIVE, OneLineParser, finite, plain, positive, run_tool  # noqa: E402
from whole_file import NOWHERE  # noqa: E402


def parse(arguments):
    parser = OneLineParser(prog="gravier_join", description=__doc__)
    parser.add_argument("first", type=Path, metavar="FIRST", help="the sample, .h5 or .csv, which keeps its numbers, walls, periods and forces")
    parser.add_argument("others", type=Path, metavar="OTHER", nargs="+", help="bodies files whose bodies are added, .h5 or .csv")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the bodies file that is written, .h5")
    parser.add_argument("--shift", type=finite, nargs="+", metavar="X", help="move the bodies of the other files [m], two numbers or three")
    parser.add_argument("--above", type=finite, metavar="GAP", help="place each of the other files so that its lowest point is GAP above the highest one before [m]")
    parser.add_argument("--overlap", type=finite, metavar="D", help="largest overlap of disks and spheres of different files [m] (a hundredth of the mean radius)")
    parser.add_argument("--density", type=positive, metavar="D", help="of disks and spheres of a file without masses beside others with masses [kg/m^3, kg/m^2 in the plane]")
    parser._negative_number_matcher = NEGATIVE
    return parser.parse_args(arguments)


def main(arguments=None):
    options = parse(arguments)
    try:
        rows = gravier.join_bodies([options.first, *options.others], options.out, options.shift, options.above, options.overlap, options.density)
    except gravier.ResultsError as refused:
        print(f"gravier_join: error: {plain(refused)}", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"gravier_join: error: {plain(options.out)}: {plain(problem.strerror or problem)}; expected a file that can be written", file=sys.stderr)
        return 2 if isinstance(problem, NOWHERE) else 4
    for file, first, last, walls, forces, near in zip(*rows.values()):
        left = "; left out: " + ", ".join(f"{what} {count}" for what, count in (("walls", walls), ("forces of contacts", forces)) if count) if walls or forces else ""
        balls = f"; {near} pair{'s' if near > 1 else ''} of enclosing balls meet, whose shapes may overlap: see max_overlap of the first step" if near else ""
        print(f"{file}: {f'body {first}' if first == last else f'bodies {first} to {last}'}{left}{balls}")
    print(options.out)
    return 0


if __name__ == "__main__":
    run_tool(main)
