#!/usr/bin/env python3
"""Draw what runs left in their directories: packings with force chains, histories, convergence, movies; and samples."""
import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import matplotlib
    import numpy

    import gravier
except ImportError as missing:
    sys.exit(f"gravier_plot: {missing}; expected a python3 with h5py, numpy and matplotlib")
matplotlib.use("Agg")
import matplotlib.animation
import matplotlib.pyplot as plt
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap
from one_line import OneLineParser
from whole_file import save_figure, written

# slow is nearly white, so that the chains stand out; red on blue is safe for the colour-blind
SPEEDS = LinearSegmentedColormap.from_list("speeds", ["#f4f8fc", "#9ecae1", "#4292c6", "#08519c", "#08306b"])
TURNS = "PuOr"
CHAINS = "#b2182b"
WIDEST = 4.0  # chain of the largest force, points
FAINTEST = 0.02  # forces below this part of the largest are not drawn
LINES = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
LABELS = {"kinetic_energy": "kinetic energy [J]", "max_overlap": "largest overlap [m]", "wall_seconds": "wall time of a step [s]"}


def refuse(message):
    """One line, and the status of bad input."""
    print(f"gravier_plot: {message}", file=sys.stderr)
    sys.exit(2)


# ---- a packing

class View:
    """Directions across and up the picture, and towards the eye, of a scene in 2D or 3D."""

    def __init__(self, dimension, azimuth, elevation):
        self.flat = dimension == 2
        a, e = numpy.radians([azimuth, elevation])
        self.axes = numpy.array([[-numpy.sin(a), numpy.cos(a), 0.0],
                                 [-numpy.sin(e) * numpy.cos(a), -numpy.sin(e) * numpy.sin(a), numpy.cos(e)]])
        self.eye = numpy.array([numpy.cos(e) * numpy.cos(a), numpy.cos(e) * numpy.sin(a), numpy.sin(e)])

    def place(self, points):
        """(..., d) to (..., 2)."""
        return points if self.flat else points @ self.axes.T

    def order(self, points):
        """What is nearest to the eye comes last."""
        return numpy.arange(len(points)) if self.flat else numpy.argsort(points @ self.eye, kind="stable")


def quantity(run, step, bodies, kind):
    """Values to colour bodies by, their unit and their name; values None for no colour."""
    if kind == "none" or (kind == "radius" and bodies.radius.min() == bodies.radius.max()):
        return None, None, None
    if kind in ("speed", "rotation") and "velocity" not in bodies:
        refuse(f"{run.path}: no velocities; expected another --colour")
    if kind == "rotation" and run.dimension == 2:
        return bodies.spin[:, 0], "rad/s", "rotation, anticlockwise"
    if kind == "rotation":
        return numpy.linalg.norm(bodies.spin, axis=1), "rad/s", "rotation"
    if kind == "radius":
        return bodies.radius, "m", "radius"
    if kind == "pressure":
        return run.pressure(step), "N/m" if run.dimension == 2 else "Pa", "pressure"
    return numpy.linalg.norm(bodies.velocity, axis=1), "m/s", "speed"


def spread(values, kind):
    """Least and largest value of the colours: a few extreme bodies must not make all others look alike."""
    top = numpy.quantile(numpy.abs(values), 0.98) or numpy.abs(values).max() or 1.0
    if values.min() < 0.0:
        return -top, top
    return (values.min(), top) if kind == "radius" and values.min() < top else (0.0, top)


def colours(run, step, bodies, kind, limits=None):
    """Values to colour bodies by, their label, and how: a dictionary for a collection; values None for no colour. `limits` are those of
    the colours where several pictures share them."""
    if kind == "subdomain":
        values = run.subdomain(step)
        count = values.max()
        return values, "subdomain", {"cmap": plt.get_cmap("tab20", count), "norm": BoundaryNorm(numpy.arange(count + 1) + 0.5, count)}
    values, unit, name = quantity(run, step, bodies, kind)
    if values is None:
        return None, None, {}
    low, top = limits or spread(values, kind)
    power = 3 * int(numpy.floor(numpy.log10(top) / 3.0))
    label = f"{name} [$10^{{{power}}}$ {unit}]" if power != 0 else f"{name} [{unit}]"
    return values / 10.0**power, label, {"cmap": TURNS if low < 0.0 else SPEEDS, "norm": plt.Normalize(low / 10.0**power, top / 10.0**power)}


def box_around(bodies, planes, facets, view):
    """Corners of the box that holds the bodies, facets and, in 2D, the feet of the planes, with a margin."""
    centre, radius = view.place(bodies.position), bodies.radius[:, None]
    low, high = (centre - radius).min(axis=0), (centre + radius).max(axis=0)
    if len(facets) > 0:
        low, high = numpy.minimum(low, facets.min(axis=(0, 1))), numpy.maximum(high, facets.max(axis=(0, 1)))
    if view.flat and len(planes.position) > 0:
        # the point of a plane that is nearest to the middle of the bodies
        middle = 0.5 * (low + high)
        foot = middle - ((middle - planes.position) * planes.normal).sum(axis=1)[:, None] * planes.normal
        low, high = numpy.minimum(low, foot.min(axis=0)), numpy.maximum(high, foot.max(axis=0))
    margin = 0.015 * (high - low).max()
    return low - margin, high + margin


def present(run, step):
    """Boundaries that are there at a step, and where each one's keys are in the case: (table, list)."""
    rows = run.boundaries(step)
    known = {keys.get("name", f"boundary {k}"): keys for k, keys in enumerate(run.case.get("boundary", []), 1)}
    time = run.time(step)
    there = numpy.array([time < known.get(name, {}).get("remove_at", numpy.inf) for name in rows.name], dtype=bool)
    return gravier.Table({key: values[there] for key, values in rows.items()}), [known.get(name, {}) for name in rows.name[there]]


def draw_boundaries(axes, rows, keys, low, high):
    """Boundaries of a scene in 2D that have no facets: planes as lines across the picture, cut where another plane leaves them behind,
    segments and circles as they are (a segment that turns, as it was at the start)."""
    style = {"color": "0.25", "linewidth": 1.5, "solid_capstyle": "butt", "zorder": 3}
    length = numpy.linalg.norm(high - low)
    planes = rows.shape == "plane"
    for point, normal in zip(rows.position[planes], rows.normal[planes]):
        tangent = numpy.array([-normal[1], normal[0]])
        start = point + numpy.dot(0.5 * (low + high) - point, tangent) * tangent
        along = numpy.linspace(-length, length, 4001)
        line = start + along[:, None] * tangent
        free = numpy.ones(len(line), dtype=bool)
        for other, other_normal in zip(rows.position[planes], rows.normal[planes]):
            free &= (line - other) @ other_normal > -1e-3 * length
        axes.plot(*line[free].T, **style)
    for shape, point, key in zip(rows.shape, rows.position, keys):
        if shape == "segment" and "end" in key:
            end = point + numpy.subtract(key["end"], key.get("point", [0.0, 0.0]))[:2]
            axes.plot(*numpy.array([point, end]).T, **style)
        elif shape == "circle" and "radius" in key:
            axes.add_patch(plt.Circle(point, key["radius"], fill=False, edgecolor="0.25", linewidth=1.5, zorder=3))


def present_facets(run, step, view, rows):
    """Corners of the facets of the mesh walls that are there, in the plane of the picture (n, corners of a facet, 2)."""
    facets = run.facets(step)
    if facets is None:
        return numpy.zeros((0, run.dimension, 2))
    return view.place(facets.corners[numpy.isin(facets.boundary, rows.id)])


def draw_facets(axes, view, corners):
    """Facets: lines in 2D, sides of triangles behind the bodies in 3D."""
    if view.flat:
        axes.add_collection(LineCollection(corners, colors="0.25", linewidths=1.5, capstyle="round", zorder=3))
    else:
        axes.add_collection(PolyCollection(corners, facecolors="none", edgecolors="0.6", linewidths=0.3, zorder=0.5))


class Frame:
    """What pictures of one movie share: the box, the limits of the colours, the force of the thickest chain."""

    def __init__(self, low=None, high=None, limits=None, force=None):
        self.low, self.high, self.limits, self.force = low, high, limits, force


def shaped(bodies):
    """Whether some body is neither a disk nor a sphere."""
    return "shape" in bodies and "orientation" in bodies and bool(numpy.any(bodies.shape > 0))


def visible_polygons(outlines, view, order):
    """Polygons of bodies in the plane of the picture, in the order in which they are drawn, and the body of each: in 3D those that face
    the eye, the nearest last."""
    polygons, body = [], []
    for k in order:
        found = outlines[k]
        if not view.flat:
            found = [points for points in found if numpy.dot(newell(points), view.eye) > 0.0]
            found.sort(key=lambda points: numpy.mean(points @ view.eye))
        polygons += [view.place(points) for points in found]
        body += [k] * len(found)
    return polygons, numpy.array(body)


def newell(points):
    """Normal of a polygon in space, as long as twice its area."""
    return numpy.cross(points, numpy.roll(points, -1, axis=0)).sum(axis=0)


def draw_packing(run, step, options, frame=None):
    """A figure of one step: bodies by colour, boundaries, force chains by normal force."""
    frame = frame or Frame()
    step = run.find_step(step)
    bodies, contacts = run.bodies(step), run.contacts(step)
    if len(bodies) == 0:
        refuse(f"{run.path}: no body in step {step}; expected one at least")
    view = View(run.dimension, *options.view)
    rows, keys = present(run, step)
    planes = gravier.Table({name: rows[name][rows.shape == "plane"] for name in ("position", "normal")})
    facets = present_facets(run, step, view, rows)
    low, high = box_around(bodies, planes, facets, view) if frame.low is None else (frame.low, frame.high)
    size = (high - low) / (high - low).max()
    figure, axes = plt.subplots(figsize=(options.size * size[0] + 1.3, options.size * size[1] + 0.9))

    values, label, how = colours(run, step, bodies, options.colour, frame.limits)
    chains = options.chains and contacts is not None and len(contacts) > 0
    order, diameter = view.order(bodies.position), 2.0 * bodies.radius
    through = 0.25 if chains and not view.flat else 1.0
    # an outline would hide a body of a few points
    points = 72.0 * options.size / (high - low).max() * numpy.median(diameter)
    style = {"edgecolors": "0.55" if view.flat else "0.25", "linewidths": min(0.4, 0.06 * points), "alpha": through, **how}
    if shaped(bodies):
        polygons, order = visible_polygons(run.outlines(step), view, order)
        disks = PolyCollection(polygons, **style)
    else:
        disks = EllipseCollection(diameter[order], diameter[order], numpy.zeros_like(diameter), units="xy",
                                  offsets=view.place(bodies.position)[order], offset_transform=axes.transData, **style)
    if values is None:
        disks.set_facecolor("#dbe7f3")
    else:
        disks.set_array(values[order])
    axes.add_collection(disks)
    title = run.path.name if isinstance(run, gravier.BodiesFile) else f"step {step}, t = {run.time(step):.4g} s"
    title += f": {len(bodies)} {'bodies' if shaped(bodies) else 'disks' if view.flat else 'spheres'}"
    if contacts is not None:
        title += f", {len(contacts)} contacts"
    if chains:
        draw_chains(axes, run, step, view, frame.force)
    draw_facets(axes, view, facets)
    if view.flat:
        draw_boundaries(axes, rows, keys, low, high)
        axes.set(xlabel="x [m]", ylabel="y [m]")
    else:
        axes.set_axis_off()
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_title(title, fontsize=9, loc="left", pad=18 if chains else 6)
    if values is not None:
        bar = figure.colorbar(disks, cax=axes.inset_axes([1.02, 0.0, 0.025, 1.0]), label=label)
        bar.solids.set_alpha(1.0)
        if options.colour == "subdomain":
            bar.set_ticks(numpy.unique(values))
    return figure


def draw_chains(axes, run, step, view, force):
    """Force chains: a segment for each loaded contact, as thick as its normal force; `force` is that of the thickest."""
    segments, normal = run.chains(step)
    top = force or normal.max(initial=0.0)
    loaded = normal > FAINTEST * top
    if not loaded.any():
        return
    axes.add_collection(LineCollection(view.place(segments[loaded]), linewidths=WIDEST * normal[loaded] / top, colors=CHAINS,
                                       capstyle="round", zorder=2))
    axes.plot([], [], color=CHAINS, linewidth=WIDEST, label=f"normal force {float(f'{top:.2g}'):g} N")
    axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.0, frameon=False, fontsize=8)


# ---- curves

def names_of(runs):
    """What tells the directories of runs apart: their paths without what all begin and end with."""
    parts = [run.directory.resolve().parts for run in runs]
    if len(set(parts)) < len(parts):
        return [str(run.directory) for run in runs]
    shortest = min(len(path) for path in parts)
    first = next((k for k in range(shortest) if len({path[k] for path in parts}) > 1), shortest - 1)
    last = next((k for k in range(1, shortest - first) if len({path[-k] for path in parts}) > 1), shortest - first)
    return ["/".join(path[first:len(path) - last + 1]) for path in parts]


def draw_history(runs, columns):
    """A figure with a panel for each column of history.csv against time, a line a run."""
    histories = [run.history() for run in runs]
    for run, history in zip(runs, histories):
        if len(history) == 0:
            refuse(f"{run.directory}/history.csv: no step; expected one at least")
        for name in columns:
            if name not in history:
                refuse(f"{run.directory}/history.csv: no column {name}; expected one of {', '.join(history)}")
    figure, panels = plt.subplots(len(columns), 1, figsize=(6.2, 0.4 + 1.75 * len(columns)), sharex=True, squeeze=False)
    for axes, name in zip(panels[:, 0], columns):
        for k, (label, history) in enumerate(zip(names_of(runs), histories)):
            axes.plot(history.time, history[name], color=LINES[k % len(LINES)], linewidth=1.2, label=label,
                      marker="o" if len(history) <= 50 else None, markersize=3)
        axes.set_ylabel(LABELS.get(name, name.replace("_", " ")))
        axes.grid(True, color="0.9", linewidth=0.6)
        values = numpy.concatenate([history[name] for history in histories])
        positive = values[values > 0.0]
        if name != "iterations" and values.min() >= 0.0 and len(positive) > 0 and positive.max() > 30.0 * positive.min():
            axes.set_yscale("log")
        elif values.min() >= 0.0:
            axes.set_ylim(0.0, 1.1 * values.max() or 1.0)
            axes.ticklabel_format(axis="y", scilimits=(-2, 4))
    panels[-1, 0].set_xlabel("time [s]")
    if len(runs) > 1:
        panels[0, 0].legend(fontsize=8)
    figure.align_ylabels(panels[:, 0])
    return figure


def velocity_scale(run, step):
    """U of a step, from history.csv; 0 where it has none."""
    history = run.history()
    if "velocity_scale" not in history or step not in history.step:
        return 0.0
    return float(history.velocity_scale[history.step == step][0])


def draw_convergence(runs, step):
    """A figure of residual, jump and velocity error over its scale against iterations, a line a run: of one step, that of most
    iterations unless told."""
    figure, axes = plt.subplots(figsize=(6.2, 4.0))
    for k, (run, label) in enumerate(zip(runs, names_of(runs))):
        trace = run.trace()
        held = numpy.unique(trace.step).astype(int) if len(trace) > 0 else []
        if len(held) == 0 or (step is not None and step not in held):
            refuse(f"{run.directory}/trace.csv: no step {step}; expected one of {', '.join(map(str, held)) or 'none, it has no row'}")
        drawn = trace.step[numpy.argmax(trace.iteration)] if step is None else step
        chosen = trace.step == drawn
        begin = "" if len(runs) == 1 else f"{label}, step {drawn:.0f}, "
        curves = {name: trace[name][chosen] for name in ("error", "residual", "jump") if name in trace}
        scale = velocity_scale(run, drawn)
        if "velocity_error" in trace and scale > 0.0:
            # before some iterations the error is not known, and a huge number stands for it
            ratio = trace.velocity_error[chosen] / scale
            curves["velocity error / U"] = numpy.where(ratio < 1e6, ratio, numpy.nan)
        styles = {"error": "-", "residual": "-" if "error" not in trace else "--", "jump": ":", "velocity error / U": "-."}
        for name, values in curves.items():
            if (values > 0.0).any():
                axes.plot(trace.iteration[chosen], numpy.where(values > 0.0, values, numpy.nan), styles[name],
                          color=LINES[k % len(LINES)], linewidth=1.2, label=begin + name)
        tolerance = run.case.get("solver", [{}])[0].get("tolerance")
        if tolerance is not None:
            axes.axhline(tolerance, color=LINES[k % len(LINES)], linewidth=0.6, label=begin + "tolerance")
    if len(runs) == 1:
        axes.set_title(f"step {drawn:.0f}", fontsize=9, loc="left")
    axes.set(xlabel="iteration", ylabel="residual, jump, velocity error / U", yscale="log")
    axes.grid(True, color="0.9", linewidth=0.6)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    return figure


# ---- files

def save(figure, path, dpi=200):
    """PNG or SVG, by the ending of the path, without what would tell when."""
    save_figure(figure, path, dpi=dpi, bbox_inches="tight", metadata={"Software": None} if path.suffix == ".png" else {"Date": None})
    plt.close(figure)
    print(path)


def shared_frame(run, steps, options):
    """Box, colours and forces that hold for all steps of a movie."""
    view, lows, highs, limits, force = View(run.dimension, *options.view), [], [], [], 0.0
    for step in steps:
        bodies = run.bodies(step)
        rows, _ = present(run, step)
        planes = gravier.Table({name: rows[name][rows.shape == "plane"] for name in ("position", "normal")})
        low, high = box_around(bodies, planes, present_facets(run, step, view, rows), view)
        lows.append(low)
        highs.append(high)
        values = None if options.colour == "subdomain" else quantity(run, step, bodies, options.colour)[0]
        if values is not None and values.any():
            limits.append(spread(values, options.colour))
        if options.chains and run.contacts(step) is not None:
            force = max(force, run.chains(step)[1].max(initial=0.0))
    if not lows:
        refuse(f"{run.path}: no body in any step; expected one at least")
    return Frame(numpy.min(lows, axis=0), numpy.max(highs, axis=0), shared_limits(limits), force or None)


def shared_limits(limits):
    """Limits of colours that hold for several pictures, about 0 where one has negative values; None where there are none."""
    if not limits:
        return None
    low, top = min(least for least, _ in limits), max(most for _, most in limits)
    return (min(low, -top), max(-low, top)) if low < 0.0 else (low, top)


def draw_movie(run, options):
    """A movie (.gif, .mp4) or, for any other path, a directory of frames."""
    out = options.out or run.directory / "movie.gif"
    if out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        refuse(f"{out}: no program ffmpeg; expected a movie .gif, or a directory for frames")
    if out.suffix in (".avi", ".mkv", ".mov", ".webm"):
        refuse(f"{out}: expected a movie .gif or .mp4, or a directory for frames")
    movie = out.suffix in (".gif", ".mp4")
    try:
        (out.parent if movie else out).mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        refuse(f"{out}: {reason.strerror}; expected a place for files")
    steps = [step for step in run.steps if len(run.bodies(step)) > 0][::options.every]
    frame = shared_frame(run, steps, options)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) if movie else out
        for k, step in enumerate(steps):
            figure = draw_packing(run, step, options, frame)
            # frames of one size
            save_figure(figure, folder / f"frame_{k:05d}.png", dpi=100, metadata={"Software": None})
            plt.close(figure)
        if movie:
            join_frames(sorted(folder.glob("frame_*.png")), out, options.fps)
    print(out)


def join_frames(paths, out, fps):
    """A movie of pictures of one size, which are read one after the other: all of a long run would not fit into memory."""
    first = plt.imread(paths[0])
    height, width = first.shape[:2]
    figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
    image = figure.figimage(first)
    play = matplotlib.animation.FuncAnimation(figure, lambda k: [image.set_data(plt.imread(paths[k]))], frames=len(paths))
    try:
        with written(out) as part:
            play.save(part, writer="ffmpeg" if out.suffix == ".mp4" else "pillow", fps=fps)
    except subprocess.CalledProcessError as reason:
        refuse(f"{out}: ffmpeg ended with status {reason.returncode}; expected a movie .gif, or a directory for frames")
    plt.close(figure)


def parse(arguments):
    parser = OneLineParser(prog="gravier_plot", description=__doc__)
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    one, several, look = (argparse.ArgumentParser(add_help=False) for _ in range(3))
    one.add_argument("directory", type=Path, metavar="DIR", help="output directory of a run (packing: or a bodies file .h5)")
    several.add_argument("directory", type=Path, metavar="DIR", nargs="+", help="output directories of runs, compared in one figure")
    for options in (one, several):
        options.add_argument("--out", type=Path, metavar="FILE",
                             help="picture, .png or .svg (movie: .gif, .mp4 or a directory of frames); in the first DIR unless told")
    look.add_argument("--colour", choices=("speed", "rotation", "pressure", "radius", "subdomain", "none"),
                      help="what colours the bodies (speed; of a bodies file, radius); subdomain needs &output vtk = .true.")
    look.add_argument("--chains", action=argparse.BooleanOptionalAction,
                      help="lines from centre to centre as thick as the normal force; in 2D unless told, spheres become transparent")
    look.add_argument("--view", type=float, nargs=2, default=(-60.0, 20.0), metavar=("AZIMUTH", "ELEVATION"),
                      help="where the eye is in 3D, degrees (-60 20)")
    look.add_argument("--size", type=float, default=6.2, metavar="INCHES", help="longer side of the box (6.2)")
    packing = kinds.add_parser("packing", parents=[one, look], help="bodies, boundaries and force chains of a step")
    packing.add_argument("--step", type=int, metavar="N", help="a step that results.h5 holds; the last one unless told")
    packing.add_argument("--dpi", type=int, default=200, metavar="N", help="of a PNG (200)")
    history = kinds.add_parser("history", parents=[several], help="columns of history.csv against time")
    history.add_argument("--columns", default="iterations,residual,kinetic_energy", metavar="A,B", help="%(default)s unless told")
    convergence = kinds.add_parser("convergence", parents=[several], help="residual and jump of a solve (&output trace = .true.)")
    convergence.add_argument("--step", type=int, metavar="N", help="a step of trace.csv; that of most iterations unless told")
    movie = kinds.add_parser("movie", parents=[one, look], help="all written steps")
    movie.add_argument("--every", type=int, default=1, metavar="N", help="every N-th written step (1)")
    movie.add_argument("--fps", type=float, default=10.0, metavar="N", help="frames a second (10)")
    return parser.parse_args(arguments)


def main(arguments=None):
    options = parse(arguments)
    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "gravier"})
    if options.out and options.kind != "movie" and options.out.suffix not in (".png", ".svg"):
        refuse(f"--out {options.out}: expected a path that ends in .png or .svg")
    if options.kind == "movie" and not (options.every >= 1 and 0.0 < options.fps < numpy.inf):
        refuse(f"--every {options.every} --fps {options.fps:g}: expected 1 or more, and a number > 0")
    if options.kind in ("packing", "movie") and not (0.0 < options.size <= 1000.0 and numpy.isfinite(options.view).all()):
        refuse(f"--size {options.size:g} --view {options.view[0]:g} {options.view[1]:g}: expected a size above 0, 1000 at most, and two numbers")
    if options.kind == "packing" and not 1 <= options.dpi <= 10000:
        refuse(f"--dpi {options.dpi}: expected 1 to 10000")
    directories = options.directory if isinstance(options.directory, list) else [options.directory]
    try:
        sample = options.kind == "packing" and directories[0].suffix == ".h5"
        runs = [gravier.BodiesFile(directories[0])] if sample else [gravier.Run(directory) for directory in directories]
        if options.kind in ("packing", "movie") and options.colour is None:
            options.colour = "radius" if sample else "speed"
        if options.kind in ("packing", "movie") and options.chains is None:
            options.chains = runs[0].dimension == 2
        out = options.out or (directories[0].with_suffix(".png") if sample else directories[0] / f"{options.kind}.png")
        if options.kind == "packing":
            save(draw_packing(runs[0], options.step, options), out, options.dpi)
        elif options.kind == "movie":
            draw_movie(runs[0], options)
        elif options.kind == "history":
            save(draw_history(runs, options.columns.split(",")), out)
        else:
            save(draw_convergence(runs, options.step), out)
    except gravier.ResultsError as reason:
        refuse(reason)


if __name__ == "__main__":
    main()
