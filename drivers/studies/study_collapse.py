#!/usr/bin/env python3
"""Run-out of columns of many aspect ratios a, of disks between walls, a = height / width, or of spheres in a cylinder, a = height /
radius.
(r - r0)/r0 goes like a for flat columns, and for tall ones like a^(2/3) in 2D and a^(1/2) in 3D.

    ./gravier study collapse [--out DIR] [--quick]            about 10 minutes on one core; GRAVIER_BIN_DIR says where gravier is
    ./gravier study collapse [--out DIR] [--quick] --dimension 3  about 10 minutes

leaves in DIR study_collapse.csv, study_collapse_summary.csv and study_collapse.png, or the same with _3d. Columns of disks have
three samples each, whose run-outs differ by a tenth. --quick takes one sample of fewer columns, and in 3D of fewer grains, which are
too few for a slope of tall columns. The closing table has each measured quantity beside what is accepted. Exit status: 0 all are
held; 1 one is missed."""
import argparse
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from oracle_table import Bounds
from study_support import (OneLineParser, claimed, draw_disks, lattice, plt, read_bodies, read_history, run, run_study, states,
                           whole, write_csv, write_hdf5)
from whole_file import save_figure


STEP = 5.0e-4  # s
# radii [m], grains of a column, aspect ratios aimed at, flat columns below the one and tall ones above the other measured
# ratio, time until the gate is taken away [s], times that a fall from the height of the column is waited for, width of the bins in
# which a heap is measured [mean radii], alert distance [m], about the way of the fastest grain in a step, samples of each column,
# keys of &solver beside the defaults. Tall columns of spheres that come to rest between their walls take thousands of iterations at the
# default accuracy; where heaps end does not need it (doc/choosing.md, High friction)
PLANE = SimpleNamespace(smallest=0.004, largest=0.006, grains=1000, aspects=(0.5, 0.75, 1.1, 1.6, 3.5, 5.0, 7.0, 10.0), flat=2.0,
                        tall=3.0, settling=0.4, falls=5.0, bin=4.0, alert=1.5e-3, name="study_collapse", samples=3, solver={})
SPACE = SimpleNamespace(smallest=0.0045, largest=0.005, grains=6000, aspects=(0.5, 0.75, 1.1, 1.5, 3.0, 5.0, 8.0, 12.0),
                        flat=1.7, tall=1.7, settling=0.3, falls=4.0, bin=1.0, alert=2.0e-3, name="study_collapse_3d",
                        samples=1, solver={"accuracy": 0.3})
#: of the quick form
QUICK = {2: {"aspects": (0.5, 0.75, 1.1, 1.6, 5.0), "samples": 1},
         3: {"grains": 1500, "aspects": (0.5, 0.8, 1.1, 3.0), "falls": 3.0, "settling": 0.25}}
# published laws: exponent and range of the factor. In 2D the factors of experiments with sand (Lube) and of disks by contact
# dynamics (Staron and Hinch) are far apart. In 3D those of Lube are of columns hundreds of grains wide; narrow columns run less far
# (Warnett).
LUBE_2D, STARON = "Lube et al., Phys. Rev. E 72 (2005) 041301", "Staron and Hinch, J. Fluid Mech. 545 (2005) 1"
LUBE_3D, WARNETT = "Lube et al., J. Fluid Mech. 508 (2004) 175", "Warnett et al., Granular Matter 16 (2014) 115"
LAWS = {2: {"flat": (1.0, (1.2, 2.5), f"{LUBE_2D}: 1.2; {STARON}: 2.5"),
            "tall": (2.0 / 3.0, (1.9, 3.25), f"{LUBE_2D}: 1.9; {STARON}: 3.25")},
        3: {"flat": (1.0, (None, 1.24), f"{LUBE_3D}: 1.24; at most, {WARNETT}"),
            "tall": (0.5, (None, 1.6), f"{LUBE_3D}: 1.6; at most, {WARNETT}")}}
#: difference of an exponent, and of a factor over it, that a fit to a few columns may have
NEAR = 0.1


def column_2d(case, aspect, grains, rng):
    """Width, centres and radii of loose disks, no bumps, walls."""
    # the lattice comes down by about a seventh when it settles
    cell = 2.05 * case.largest
    width = cell * max(round(np.sqrt(grains / (1.17 * aspect))), 6)
    centres, radii = lattice([0.0, 0.0], [width, cell * round(grains / (width / cell))], case.smallest, case.largest, rng)
    return width, centres, radii, np.empty((0, 2)), [
        {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
        {"name": "left", "shape": "plane", "normal": [1.0, 0.0], "friction": 0.0},
        {"name": "gate", "shape": "plane", "point": [width, 0.0], "normal": [-1.0, 0.0], "friction": 0.0,
         "remove_at": case.settling}]


def column_3d(case, aspect, grains, rng):
    """Radius of the cylinder, centres and radii of loose spheres, centres of bumps, walls."""
    mean = 0.5 * (case.smallest + case.largest)
    # solid fraction 0.58 when it has settled
    radius = mean * np.cbrt(4.0 / 3.0 * grains / (0.58 * aspect))
    high = 2.5 * aspect * radius + 4.0 * case.largest
    centres, radii = lattice([-radius, -radius, 0.6 * mean], [radius, radius, 0.6 * mean + high], case.smallest,
                             case.largest, rng, lambda x, largest: np.hypot(x[:, 0], x[:, 1]) < radius - 1.03 * largest)
    centres, radii = centres[:grains], radii[:grains]
    # a triangle of bumps 1.5 diameters apart, which no sphere passes without climbing, as far as the heap gets
    reach, apart = radius * (1.0 + 2.0 * min(aspect, np.sqrt(aspect))), 3.0 * mean
    k = np.arange(-int(1.2 * reach / apart) - 1, int(1.2 * reach / apart) + 2)
    column, row = (a.ravel() for a in np.meshgrid(np.arange(2 * k[0], 2 * k[-1] + 1), k))
    bumps = apart * np.column_stack([column + 0.5 * row, np.sqrt(0.75) * row, 0.0 * row])
    bumps = bumps[np.hypot(bumps[:, 0], bumps[:, 1]) < reach]
    bumps[:, 2] = -0.41 * mean
    return radius, centres, radii, bumps, [
        {"name": "floor", "shape": "plane", "normal": [0.0, 0.0, 1.0]},
        {"name": "bumps", "shape": "grains", "group": 1},
        {"name": "gate", "shape": "cylinder", "axis": [0.0, 0.0, 1.0], "radius": radius, "friction": 0.0,
         "remove_at": case.settling}]


def fall(folder, case, column):
    """The run itself."""
    _, centres, radii, bumps, walls = column
    folder.mkdir(parents=True, exist_ok=True)
    write_hdf5(folder / "column.h5", np.concatenate([centres, bumps]), np.concatenate([radii, np.full(len(bumps), radii.mean())]),
               np.repeat([0, 1], [len(radii), len(bumps)]) if len(bumps) else None)
    height = centres[:, -1].max()
    steps = int((case.settling + case.falls * np.sqrt(height / 9.81)) / STEP)
    run(folder, {
        "scene": {"dimension": centres.shape[1], "bodies": "file", "bodies_file": "column.h5", "density": 2500.0, "friction": 0.5,
                  "alert_distance": case.alert, "skin": 2.5e-3},
        "time": {"step": STEP, "steps": steps},
        "solver": case.solver,
        "output": {"directory": ".", "every": int(case.settling / STEP), "contacts": False, "final_bodies": True}}, walls)


def collapse(folder, case, column, measure):
    """Settle a column, take the gate away: width and height before, length after, last state. With `measure`, the run was made
    before."""
    if not measure:
        fall(folder, case, column)
    width, n = column[0], len(column[2])
    settled = [state["bodies/position"][:n] for number, _, state in states(folder / "results.h5")
               if number == int(case.settling / STEP)][0]
    # as high as a box of the same width and mean height of its centre
    height = 2.0 * settled[:, -1].mean()
    centres, radii, _ = read_bodies(folder / "final_bodies.h5")
    return width, height, length_of(centres[:n], radii[:n], case.bin), (centres[:n], radii[:n])


def ends(place, volume, ground, layer, bins):
    """Where a layer of grains ends that begins at 0: from each of the first bins on the first bin whose grains, over its ground, are thinner than
    `layer` [m], its lower end. `place` (n) are distances from the beginning [m], `volume` (n) those of grains, `ground` gives area or length
    between 0 and a distance, `bins` the width of bins, the number of places of the first bin and the place from which bins count [m]."""
    wide, places, inner = bins
    found = []
    for first in np.arange(places) / places * wide:
        # one of more bins than grains is empty, however far away a grain is
        edges = np.arange(first, min(place.max(initial=0.0) + 3.0 * wide, first + (len(place) + 5) * wide), wide)
        thickness = np.histogram(place, edges, weights=volume)[0] / np.diff(ground(edges))
        thickness[edges[:-1] < inner] = np.inf
        found.append(edges[np.flatnonzero(thickness < layer)[0]])
    return np.array(found)


def length_of(centres, radii, wide, places=20):
    """Where the heap ends: the grains beyond, in a bin or ring of width `wide` mean radii, are fewer than one full row or layer, a
    grain on each square of its diameter. It is the mean of as many places of the first bin as told, which are evenly apart in its
    width: with one place alone the end would be known to a bin."""
    d, mean = centres.shape[1], radii.mean()
    place = centres[:, 0] if d == 2 else np.hypot(centres[:, 0], centres[:, 1])
    unit = {2: np.pi, 3: 4.0 / 3.0 * np.pi}[d]
    # a ring about the axis that has no room for some grains may be empty in the middle of a heap
    return np.mean(ends(place, unit * radii**d, (lambda x: x) if d == 2 else (lambda r: np.pi * r**2), unit * mean**d / (2.0 * mean)**(d - 1),
                        (wide * mean, places, 4.0 * mean if d == 3 else 0.0)))


def accepted(dimension, columns, chosen, slopes):
    """The closing table; columns: ratio, run-out, and half a bin over the run-out of each, zero where it gives no margin; chosen:
    the flat
    and the tall ones."""
    ratio, out, bins = columns
    table = Bounds()
    for name, (exponent, (low, high), source) in LAWS[dimension].items():
        span = f"{name} columns, a from {ratio[chosen[name]].min():.2g} to {ratio[chosen[name]].max():.2g}"
        factor = np.exp(np.mean(np.log(out[chosen[name]] / ratio[chosen[name]]**exponent)))
        table.add(f"run-out over a^{exponent:.2g} of {name} columns", factor, None if low is None else (1.0 - NEAR) * low,
                  (1.0 + NEAR) * high,
                  f"{source}; a tenth")
        if chosen[name].sum() < 2:
            continue
        place = np.log(ratio[chosen[name]])
        place -= place.mean()
        # of a slope through places that are anywhere in their bins
        spread = 2.0 * np.sqrt((place**2 @ bins[chosen[name]]**2) / 3.0) / (place @ place)
        table.near(f"exponent of the run-out of {span}", slopes[name][0], exponent, NEAR + spread,
                   f"{LUBE_2D if dimension == 2 else LUBE_3D}; doc/validation.md: +- {NEAR:g}"
                   + (f"; two deviations of a bin, {spread:.2g}" if spread > 0.0 else ""))
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/collapse"), help="default: out/collapse")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2)
    parser.add_argument("--quick", action="store_true", help="fewer columns, of fewer spheres")
    parser.add_argument("--grains", type=whole(1), help="in each column: 1000 disks or 6000 spheres, about")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    options = parser.parse_args()
    claimed(options.out)
    case, make = {2: (PLANE, column_2d), 3: (SPACE, column_3d)}[options.dimension]
    if options.quick:
        case = SimpleNamespace(**{**vars(case), **QUICK[options.dimension]})
    rows, heaps, missed, solves = [], [], 0, 0
    for sample in range(case.samples):
        rng = np.random.default_rng(2005 + sample)
        for aspect in case.aspects:
            folder = options.out / f"a{aspect}_{sample}"
            column = make(case, aspect, options.grains or case.grains, rng)
            width, height, length, heap = collapse(folder, case, column, options.measure)
            rows.append((height / width, sample, len(heap[1]), width, height, length, length / width - 1.0))
            heaps.append((width, *heap))
            history = read_history(folder)
            missed, solves = missed + int((history["converged"] == 0).sum()), solves + len(history["step"])
    ratio, sample, number, width, height, length, out = np.array(rows).T
    write_csv(options.out / f"{case.name}.csv", {"aspect": ratio, "sample": sample, "grains": number, "width": width,
                                           "height": height, "length": length, "run_out": out})
    print(f"{missed} of {solves} solves missed the accuracy")
    chosen = {"flat": ratio < case.flat, "tall": ratio > case.tall}
    # of one column there is no exponent
    slopes = {name: np.polyfit(np.log(ratio[those]), np.log(out[those]), 1) for name, those in chosen.items() if those.sum() > 1}
    write_csv(options.out / f"{case.name}_summary.csv", {"quantity": [f"exponent_{name}" for name in slopes],
                                                   "value": [float(slope[0]) for slope in slopes.values()]})
    print({name: slope[0] for name, slope in slopes.items()})
    draw(options.out / f"{case.name}.png", ratio, out, slopes, heaps[:len(case.aspects)])
    # few grains and columns: a place within a bin makes more of a slope
    bins = options.quick * 0.5 * case.bin * np.array([heap[2].mean() for heap in heaps]) / (length - width)
    return accepted(options.dimension, (ratio, out, bins), chosen, slopes)


def draw(path, ratio, run_out, slopes, heaps):
    """Run-out against ratio, and the heaps of a flat and of a tall column, in units of the width of the column; spheres from the
    side, the near ones last."""
    figure, axes = plt.subplot_mosaic("ab;ac", figsize=(11.0, 4.6), layout="constrained")
    axes["a"].loglog(ratio, run_out, "o", color="#08519c")
    for name, (power, factor) in slopes.items():
        x = np.array({"flat": [0.4, 2.5], "tall": [2.5, 12.0]}[name])
        axes["a"].loglog(x, np.exp(factor) * x**power, "--", color="0.4", label=f"{name}: $a^{{{power:.2f}}}$")
    space = heaps[0][1].shape[1] == 3
    axes["a"].set_xlabel("$a$ = height / " + ("radius" if space else "width"))
    axes["a"].set_ylabel(r"run-out $(r - r_0)/r_0$")
    axes["a"].legend(frameon=False)
    for panel, k in (("b", 1), ("c", len(heaps) - 2)):
        width, centres, radii = heaps[k]
        if space:
            order = np.argsort(-centres[:, 1])
            centres, radii = centres[order][:, [0, 2]], radii[order]
            axes[panel].axvline(-1.0, color="#b2182b", linewidth=0.8)
        draw_disks(axes[panel], centres / width, radii / width)
        if space:
            # without the few that roll away
            axes[panel].set_xlim(-1.3 * (1.0 + run_out[k]), 1.3 * (1.0 + run_out[k]))
            axes[panel].locator_params(axis="y", nbins=3)
        axes[panel].axvline(1.0, color="#b2182b", linewidth=0.8)
        axes[panel].set_title(f"$a$ = {ratio[k]:.2g}", fontsize=10)
        axes[panel].set_xlabel("$x/r_0$")
    save_figure(figure, path, dpi=130)


if __name__ == "__main__":
    run_study(main)
