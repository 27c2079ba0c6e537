#!/usr/bin/env python3
"""Draw what runs left in their directories: packings with force chains, histories, convergence, profiles, movies; and samples."""
import argparse
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import matplotlib
    import numpy

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_plot: {missing}; expected a python3 with h5py, numpy and matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from curve_pictures import draw_convergence, draw_history, draw_profile
from movie_file import draw_movie
from one_line import NEGATIVE, OneLineParser, finite, run_tool, steps_of
from packing_picture import COLOURS, draw_packing
from picture_style import SETTINGS, PictureError, save_picture
from whole_file import PICTURES, claim


#: along the longer side of a picture in dots: its memory is the square of them
MOST_DOTS = 20000
#: columns of history.csv that are drawn unless told
HISTORY = "iterations,residual,kinetic_energy"


def refuse(message):
    """One line, and the status of bad input."""
    print(f"gravier_plot: {message}", file=sys.stderr)
    sys.exit(2)


def parse(arguments):
    parser = OneLineParser(prog="gravier_plot", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    one, several, look = (argparse.ArgumentParser(add_help=False) for _ in range(3))
    one.add_argument("directory", type=Path, metavar="DIR", help="output directory of a run (packing: or a bodies file .h5)")
    several.add_argument("directory", type=Path, metavar="DIR", nargs="+", help="output directories of runs, compared in one figure")
    for options in (one, several):
        options.add_argument("--out", type=Path, metavar="FILE",
                             help="picture, .png or .svg (movie: .gif, .mp4 or a directory of frames); in the first DIR unless told")
    look.add_argument("--colour", choices=COLOURS,
                      help="what colours the bodies (speed; of a bodies file, radius); subdomain needs &output vtk = .true.")
    look.add_argument("--chains", action=argparse.BooleanOptionalAction,
                      help="lines from centre to centre as thick as the normal force; in 2D unless told, spheres become transparent")
    look.add_argument("--regions", action="store_true", help="outlines of the groups &region, with their bins, and &insertion")
    look.add_argument("--view", type=float, nargs=2, metavar=("AZIMUTH", "ELEVATION"),
                      help="where the eye is in 3D, degrees (-60 20)")
    look.add_argument("--box", type=float, nargs="+", metavar=("X0", "X1"),
                      help="draw what is in the box X0 X1 Y0 Y1 Z0 Z1 alone: a part of a scene, or a slice of it")
    look.add_argument("--size", type=float, default=6.2, metavar="INCHES", help="longer side of the box (6.2)")
    packing = kinds.add_parser("packing", parents=[one, look], help="bodies, boundaries and force chains of a step")
    packing.add_argument("--step", type=int, metavar="N", help="a step that results.h5 holds; the last one unless told")
    packing.add_argument("--dpi", type=int, default=200, metavar="N", help="of a PNG (200)")
    history = kinds.add_parser("history", parents=[several], help="columns of history.csv, or of a table of gravier_measure, against time or another column")
    history.add_argument("--columns", metavar="A,B", help=f"{HISTORY} unless told, of another table all; -A changes the sign, A/B is a ratio, A-B a difference")
    # columns with a sign and numbers as -1e-3 are no options
    history._negative_number_matcher = re.compile(f"-[A-Za-z]|{NEGATIVE.pattern}")
    history.add_argument("--since", type=finite, metavar="T", help="draw the rows after this time alone [s]")
    history.add_argument("--until", type=finite, metavar="T", help="draw the rows up to this time alone [s]")
    history.add_argument("--table", default="history.csv", metavar="FILE", help="another table in each DIR, such as mixing.csv of gravier_measure")
    history.add_argument("--mean", type=int, default=1, metavar="N", help="means of N steps of history.csv after each other, of another table of N rows")
    history.add_argument("--against", default="time", metavar="COLUMN", help="another column than the time, such as a strain, or its opposite -COLUMN")
    convergence = kinds.add_parser("convergence", parents=[several], help="residual and jump of a solve (&output trace = .true.)")
    convergence.add_argument("--step", type=int, metavar="N", help="a step of trace.csv; that of most iterations unless told")
    profile = kinds.add_parser("profile", parents=[one], help="means over the bins of a &region against the position")
    profile.add_argument("--region", metavar="NAME", help="a region with bins; the only one unless told")
    profile.add_argument("--steps", type=steps_of, metavar="N,N:M", help="written steps and ranges of them as 5000:8000 or 5000:, ends included, or all; "
                         "unless told the last one, and with --mean all")
    profile.add_argument("--mean", action="store_true", help="the mean over the steps in the place of a line a step; velocities are weighted by the volume of grains")
    profile.add_argument("--columns", default="solid_fraction,velocity,stress", metavar="A,B", help="%(default)s unless told")
    # numbers as -1e-3 are no options
    packing._negative_number_matcher = NEGATIVE
    movie = kinds.add_parser("movie", parents=[one, look], help="all written steps")
    movie.add_argument("--every", type=int, default=1, metavar="N", help="every N-th written step (1)")
    movie.add_argument("--fps", type=float, default=10.0, metavar="N", help="frames a second (10)")
    movie._negative_number_matcher = NEGATIVE
    return parser.parse_args(arguments)


def check(options):
    """Refuse values of options that are no picture's."""
    if options.kind == "movie" and not (options.every >= 1 and 0.0 < options.fps < numpy.inf):
        refuse(f"--every {options.every} --fps {options.fps:g}: expected 1 or more, and a number > 0")
    if options.kind in ("packing", "movie"):
        if not 0.0 < options.size <= 1000.0:
            refuse(f"--size {options.size:g}: expected a size above 0, 1000 at most")
        if options.box and not numpy.isfinite(options.box).all():
            refuse(f"--box {' '.join(f'{number:g}' for number in options.box)}: expected numbers")
        if options.view and not numpy.isfinite(options.view).all():
            refuse(f"--view {options.view[0]:g} {options.view[1]:g}: expected two numbers")
    if options.kind == "history" and options.mean < 1:
        refuse(f"--mean {options.mean}: expected 1 or more")
    if options.kind == "history" and None not in (options.since, options.until) and options.since >= options.until:
        refuse(f"--since {options.since:g} --until {options.until:g}: expected an end after the begin")
    if options.kind == "packing" and not 1 <= options.dpi <= 10000:
        refuse(f"--dpi {options.dpi}: expected 1 to 10000")
    if options.kind == "movie" or (options.kind == "packing" and (options.out is None or options.out.suffix != ".svg")):
        dpi = options.dpi if options.kind == "packing" else 100
        if options.size * dpi > MOST_DOTS:
            refuse(f"--size {options.size:g}: {options.size * dpi:.0f} dots at {dpi} an inch; expected {MOST_DOTS} at most")


def draw(options):
    """Draw what is asked for, into --out or the first directory."""
    directories = options.directory if isinstance(options.directory, list) else [options.directory]
    sample = options.kind == "packing" and directories[0].suffix == ".h5"
    out = options.out or (directories[0].with_suffix(".png") if sample else directories[0] / f"{Path(options.table).stem if options.kind == 'history' else options.kind}.png")
    if options.kind != "movie":
        claim(out, PICTURES)
    if sample and (options.regions or options.chains):
        raise PictureError(f"{directories[0]}: a bodies file has no regions and no chains; expected no --regions and no --chains, or the directory of a run")
    runs = [gravier.BodiesFile(directories[0])] if sample else [gravier.Run(directory) for directory in directories]
    if options.kind in ("packing", "movie") and options.colour is None:
        options.colour = "radius" if sample else "speed"
    if options.kind in ("packing", "movie"):
        if options.view and runs[0].dimension == 2:
            raise PictureError(f"{directories[0]}: a scene in the plane; expected no --view")
        options.chains = runs[0].dimension == 2 if options.chains is None else options.chains
    if options.kind == "movie":
        draw_movie(runs[0], options)
        return
    if options.kind == "packing":
        figure = draw_packing(runs[0], options.step, options)
    elif options.kind == "history":
        columns = options.columns or (HISTORY if options.table == "history.csv" else "")
        figure = draw_history(runs, columns.split(",") if columns else None, options.against, options.mean, options.table, (options.since, options.until))
    elif options.kind == "profile":
        figure = draw_profile(runs[0], options.region, options.steps, options.columns.split(","), options.mean)
    else:
        figure = draw_convergence(runs, options.step)
    save_picture(figure, out, options.dpi if options.kind == "packing" else 200)
    print(out)


def main(arguments=None):
    options = parse(arguments)
    plt.rcParams.update(SETTINGS)
    check(options)
    try:
        draw(options)
    except (gravier.ResultsError, PictureError) as reason:
        refuse(reason)
    except MemoryError:
        refuse("there is not enough memory for this picture; expected a smaller one, or fewer bodies")


if __name__ == "__main__":
    run_tool(main)
