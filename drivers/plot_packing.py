#!/usr/bin/env python3
"""Draw what a run in two dimensions left in its directory: packing.png, the bodies, walls and force chains of one step
of results.h5, and history.png, the columns of history.csv against time."""
import argparse
import csv
import sys
from pathlib import Path

try:
    import h5py
    import matplotlib
    import numpy
except ImportError as missing:
    sys.exit(f"plot_packing.py: {missing}; expected a python3 with h5py, numpy and matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LinearSegmentedColormap

# slow is nearly white, so that the chains stand out; red on blue is safe for the colour-blind
SPEEDS = LinearSegmentedColormap.from_list("speeds", ["#f4f8fc", "#9ecae1", "#4292c6", "#08519c", "#08306b"])
CHAINS = "#b2182b"
WIDEST = 4.0  # chain of the largest impulse, points
FAINTEST = 0.02  # impulses below this part of the largest are not drawn


def refuse(message):
    """One line, and the status of bad input."""
    print(f"plot_packing.py: {message}", file=sys.stderr)
    sys.exit(2)


def read_group(parent, name):
    """The datasets of a group by their names; None where there is no such group."""
    return {key: value[()] for key, value in parent[name].items()} if name in parent else None


def read_boundaries(group):
    """Identifiers of all boundaries at a step, with points and normals of those that are planes."""
    rows = read_group(group, "boundaries")
    plane = numpy.linalg.norm(rows["normal"], axis=1) > 0.0
    return {"id": rows["id"], "point": rows["position"][plane], "normal": rows["normal"][plane]}


def read_state(path, step):
    """Step, time, boundaries, bodies and contacts (None where they were not written) of results.h5."""
    try:
        file = h5py.File(path, "r")
    except OSError:
        refuse(f"{path}: cannot read this file; expected the results of a run")
    with file:
        if "run" not in file or "steps" not in file:
            refuse(f"{path}: no groups /run and /steps; expected the results of a run")
        if file["run"].attrs["dimension"] != 2:
            refuse(f"{path}: a run in three dimensions; expected one in two")
        steps = sorted(int(name) for name in file["steps"])
        if step is None and steps:
            step = steps[-1]
        if step not in steps:
            refuse(f"{path}: no step {step}; expected one of {', '.join(map(str, steps)) or 'none, the file has no step'}")
        group = file[f"steps/{step}"]
        bodies = read_group(group, "bodies")
        if len(bodies["id"]) == 0:
            refuse(f"{path}: no body in step {step}; expected one at least")
        return step, float(group.attrs["time"]), read_boundaries(group), bodies, read_group(group, "contacts")


def chains(bodies, walls, contacts):
    """A segment for each loaded contact, and its normal impulse [N s]: from centre to centre, or from the centre to the
    wall. The ends come from the candidate and the normal, which points from the antagonist to the candidate."""
    loaded = contacts["impulse"][:, 0] > FAINTEST * contacts["impulse"][:, 0].max(initial=0.0)
    candidate, antagonist = contacts["candidate"][loaded], contacts["antagonist"][loaded]
    order = numpy.argsort(bodies["id"])
    row = order[numpy.searchsorted(bodies["id"], candidate, sorter=order)]
    reach = bodies["radius"][row] + contacts["gap"][loaded]
    between = ~numpy.isin(antagonist, walls["id"])
    reach[between] += bodies["radius"][order[numpy.searchsorted(bodies["id"], antagonist[between], sorter=order)]]
    start = bodies["position"][row]
    return numpy.stack([start, start - reach[:, None] * contacts["normal"][loaded]], axis=1), contacts["impulse"][loaded, 0]


def box_around(bodies, walls):
    """Corners of the box that holds the bodies and the feet of the walls, with a margin."""
    centre, radius = bodies["position"], bodies["radius"][:, None]
    low, high = (centre - radius).min(axis=0), (centre + radius).max(axis=0)
    if len(walls["point"]) > 0:
        # the point of a wall that is nearest to the middle of the bodies
        middle = 0.5 * (low + high)
        foot = middle - ((middle - walls["point"]) * walls["normal"]).sum(axis=1)[:, None] * walls["normal"]
        low, high = numpy.minimum(low, foot.min(axis=0)), numpy.maximum(high, foot.max(axis=0))
    margin = 0.015 * (high - low).max()
    return low - margin, high + margin


def draw_walls(axes, walls, low, high):
    """Each wall as a line across the picture, cut where another wall leaves it behind."""
    length = numpy.linalg.norm(high - low)
    for point, normal in zip(walls["point"], walls["normal"]):
        tangent = numpy.array([-normal[1], normal[0]])
        start = point + numpy.dot(0.5 * (low + high) - point, tangent) * tangent
        along = numpy.linspace(-length, length, 4001)
        line = start + along[:, None] * tangent
        free = numpy.ones(len(line), dtype=bool)
        for other, other_normal in zip(walls["point"], walls["normal"]):
            free &= (line - other) @ other_normal > -1e-3 * length
        axes.plot(*line[free].T, color="0.25", linewidth=1.5, solid_capstyle="butt", zorder=3)


def draw_packing(path, step, time, walls, bodies, contacts):
    """packing.png: disks by speed, walls, force chains by normal impulse."""
    low, high = box_around(bodies, walls)
    shape = (high - low) / (high - low).max()
    figure, axes = plt.subplots(figsize=(6.2 * shape[0] + 1.3, 6.2 * shape[1] + 0.9))
    speed = numpy.linalg.norm(bodies["velocity"][:, :2], axis=1)
    # a few fast disks must not make all others look alike
    top = numpy.quantile(speed, 0.98) or 1.0
    power = 3 * int(numpy.floor(numpy.log10(top) / 3.0))
    unit = f"$10^{{{power}}}$ m/s" if power != 0 else "m/s"
    diameter = 2.0 * bodies["radius"]
    disks = axes.add_collection(EllipseCollection(diameter, diameter, numpy.zeros_like(diameter), units="xy",
        offsets=bodies["position"], offset_transform=axes.transData, array=speed / 10.0**power, cmap=SPEEDS,
        edgecolors="0.55", linewidths=0.4))
    disks.set_clim(0.0, top / 10.0**power)
    title = f"step {step}, t = {time:.4g} s: {len(speed)} disks"
    if contacts is not None:
        segments, impulse = chains(bodies, walls, contacts)
        if len(impulse) > 0:
            axes.add_collection(LineCollection(segments, linewidths=WIDEST * impulse / impulse.max(), colors=CHAINS,
                                               capstyle="round", zorder=2))
            axes.plot([], [], color=CHAINS, linewidth=WIDEST, label=f"normal impulse {impulse.max():.2g} N s")
            axes.legend(loc="lower right", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False)
        title += f", {len(contacts['gap'])} contacts"
    draw_walls(axes, walls, low, high)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_title(title, fontsize=9, loc="left")
    figure.colorbar(disks, cax=axes.inset_axes([1.02, 0.0, 0.025, 1.0]), label=f"speed [{unit}]", extend="max")
    figure.savefig(path, dpi=200, bbox_inches="tight", metadata={"Software": None})
    plt.close(figure)


def draw_history(path, table):
    """history.png: iterations, residual and kinetic energy of each step."""
    try:
        with open(table, newline="") as file:
            rows = list(csv.DictReader(file))
    except OSError as reason:
        refuse(f"{table}: {reason.strerror}; expected the history of a run")
    if not rows:
        refuse(f"{table}: no step; expected one at least")
    time = [float(row["time"]) for row in rows]
    figure, panels = plt.subplots(3, 1, figsize=(6.2, 5.6), sharex=True)
    for axes, name, label in zip(panels, ("iterations", "residual", "kinetic_energy"),
                                 ("iterations", "residual", "kinetic energy [J]")):
        values = numpy.array([float(row[name]) for row in rows])
        axes.plot(time, values, color="#0072B2", linewidth=1.2, marker="o" if len(rows) <= 50 else None, markersize=3)
        axes.set_ylabel(label)
        axes.grid(True, color="0.9", linewidth=0.6)
        positive = values[values > 0.0]
        if name != "iterations" and len(positive) > 0 and positive.max() > 30.0 * positive.min():
            axes.set_yscale("log")
        else:
            axes.set_ylim(0.0, 1.1 * values.max() or 1.0)
            axes.ticklabel_format(axis="y", scilimits=(-2, 4))
    panels[-1].set_xlabel("time [s]")
    figure.align_ylabels(panels)
    figure.savefig(path, dpi=200, bbox_inches="tight", metadata={"Software": None})
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, metavar="DIR", help="output directory of the run")
    parser.add_argument("--step", type=int, metavar="N", help="a step that results.h5 holds; the last one unless told")
    arguments = parser.parse_args()

    plt.rcParams.update({"font.size": 9})
    draw_packing(arguments.directory / "packing.png", *read_state(arguments.directory / "results.h5", arguments.step))
    draw_history(arguments.directory / "history.png", arguments.directory / "history.csv")


if __name__ == "__main__":
    main()
