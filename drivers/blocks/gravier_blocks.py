#!/usr/bin/env python3
"""Make a case of Gravier of blocks: a wall in running bond, a tower, an arch, Voronoi blocks.

    gravier_blocks wall --bricks N --courses N --size LENGTH [THICKNESS] HEIGHT
    gravier_blocks tower --levels N --size LENGTH [WIDTH] HEIGHT [--a-level N]
    gravier_blocks arch --voussoirs N --radius R --thickness T [--depth D]
    gravier_blocks voronoi --blocks N --size LX [LY] LZ [--seed N] [--relax N]

Two lengths make a case of the plane, three one of space. Each writes NAME.shapes, NAME.csv and NAME.nml, which runs."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import gravier.blocks as blocks
except ImportError as missing:
    sys.exit(f"gravier_blocks: error: {missing}: expected a python3 with h5py and numpy (apt install python3-h5py)")
from one_line import OneLineParser, plain, run_tool  # noqa: E402


def parse(arguments):
    parser = OneLineParser(prog="gravier_blocks", description="Make a case of Gravier of blocks. Lengths are in m; two make a case of the "
                           "plane, three one of space.")
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="wall | tower | arch | voronoi", parser_class=OneLineParser)
    wall = kinds.add_parser("wall", help="bricks in running bond")
    wall.add_argument("--bricks", type=int, required=True, metavar="N", help="bricks of a course")
    wall.add_argument("--courses", type=int, required=True, metavar="N")
    tower = kinds.add_parser("tower", help="blocks one upon the other, or levels of planks across each other")
    tower.add_argument("--levels", type=int, required=True, metavar="N")
    tower.add_argument("--a-level", type=int, default=1, metavar="N", help="planks side by side in a level (1)")
    arch = kinds.add_parser("arch", help="a semicircular arch of voussoirs")
    arch.add_argument("--voussoirs", type=int, required=True, metavar="N")
    arch.add_argument("--radius", type=float, required=True, metavar="R", help="of the middle line")
    arch.add_argument("--thickness", type=float, required=True, metavar="T")
    arch.add_argument("--depth", type=float, metavar="D", help="makes a case of space")
    voronoi = kinds.add_parser("voronoi", help="Voronoi blocks of a rectangle, or of a box, which needs scipy")
    voronoi.add_argument("--blocks", type=int, required=True, metavar="N")
    voronoi.add_argument("--seed", type=int, default=1, metavar="N", help="of the random places (1)")
    voronoi.add_argument("--relax", type=int, default=3, metavar="N", help="times that places move to the centres of their blocks (3)")
    for kind, what in ((wall, "a brick"), (tower, "a block"), (voronoi, "the whole")):
        kind.add_argument("--size", type=float, nargs="+", required=True, metavar="L", help=f"lengths of {what}, the height last")
    for kind in (wall, tower, arch, voronoi):
        kind.add_argument("--out", default=None, metavar="NAME", help="the files are NAME.nml, NAME.csv and NAME.shapes (the kind)")
        kind.add_argument("--friction", type=float, default=0.7, help="(0.7)")
        kind.add_argument("--density", type=float, default=2000.0, help="[kg/m^3, kg/m^2 in the plane] (2000)")
        kind.add_argument("--step", type=float, default=1e-3, metavar="H", help="time step [s] (1e-3)")
        kind.add_argument("--steps", type=int, default=200, metavar="N", help="(200)")
    return parser.parse_args(arguments)


def make(options):
    if options.kind == "wall":
        return blocks.wall(options.bricks, options.courses, options.size)
    if options.kind == "tower":
        return blocks.tower(options.levels, options.size, options.a_level)
    if options.kind == "arch":
        return blocks.arch(options.voussoirs, options.radius, options.thickness, options.depth)
    return blocks.voronoi(options.blocks, options.size, options.seed, options.relax)


def check(options):
    """Refuse figures of the case."""
    for name, least in (("friction", 0.0), ("density", sys.float_info.min), ("step", sys.float_info.min), ("steps", 0)):
        value = getattr(options, name)
        if not least <= value < float("inf"):
            raise blocks.BlocksError(f"--{name} {value:g}: expected a finite number {'>' if least else '>='} 0")
    if getattr(options, "seed", 0) < 0:
        raise blocks.BlocksError(f"--seed {options.seed}: expected a number >= 0")


def main(arguments=None):
    options = parse(arguments)
    try:
        check(options)
        made = make(options)
        files = made.write(options.out or options.kind, friction=options.friction, density=options.density, step=options.step,
                           steps=options.steps)
    except blocks.BlocksError as refused:
        print(f"gravier_blocks: error: {plain(refused)}", file=sys.stderr)
        return 2
    except OSError as problem:
        print(f"gravier_blocks: error: {plain(problem.filename or options.out)}: {plain(problem.strerror or problem)}", file=sys.stderr)
        return 4
    print(f"{len(made.bodies)} blocks, volume {made.volume:.9g}: {', '.join(files)}")
    return 0


if __name__ == "__main__":
    run_tool(main)
