#!/usr/bin/env python3
"""Run-out of columns of disks of many aspect ratios a = height / width on a rough plane: (r - r0)/r0 goes like a for flat columns
and like a^(2/3) for tall ones.

    python3 drivers/study_collapse.py OUT       about 5 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves OUT/study_collapse.csv, OUT/study_collapse_summary.csv and OUT/study_collapse.png."""
import argparse
from pathlib import Path

import numpy as np
from study_support import draw_disks, lattice, plt, read_bodies, run, states, write_csv, write_hdf5

SMALLEST, LARGEST = 0.004, 0.006  # m
ASPECTS = (0.5, 0.75, 1.1, 1.6, 3.5, 5.0, 7.0, 10.0)
FLAT, TALL = 2.0, 3.0  # flat columns are below the one, tall ones above the other
STEP = 5.0e-4  # s
SETTLING = 0.4  # s


def fall(folder, width, centres, radii):
    """The run itself."""
    folder.mkdir(parents=True, exist_ok=True)
    write_hdf5(folder / "column.h5", centres, radii)
    height = centres[:, 1].max()
    steps = int((SETTLING + 5.0 * np.sqrt(height / 9.81)) / STEP)
    run(folder, {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": "column.h5", "density": 2500.0, "friction": 0.5,
                  "alert_distance": 1.5e-3, "skin": 2.5e-3},
        "time": {"step": STEP, "steps": steps},
        "solver": {"tolerance": 2.0e-3, "max_iterations": 500},
        "output": {"directory": ".", "every": int(SETTLING / STEP), "contacts": False, "final_bodies": True}}, [
            {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
            {"name": "left", "shape": "plane", "normal": [1.0, 0.0], "friction": 0.0},
            {"name": "gate", "shape": "plane", "point": [width, 0.0], "normal": [-1.0, 0.0], "friction": 0.0,
             "remove_at": SETTLING}])


def collapse(folder, aspect, grains, rng, measure):
    """Settle a column of about that ratio, take the gate away: width and height before, length after, last state. With
    `measure`, the run was made before."""
    # the lattice comes down by about a seventh when it settles
    cell = 2.05 * LARGEST
    width = cell * max(round(np.sqrt(grains / (1.17 * aspect))), 6)
    centres, radii = lattice([0.0, 0.0], [width, cell * round(grains / (width / cell))], SMALLEST, LARGEST, rng)
    if not measure:
        fall(folder, width, centres, radii)
    settled = [state["bodies/position"][:] for number, _, state in states(folder / "results.h5")
               if number == int(SETTLING / STEP)][0]
    # as high as a box of the same width and mean height of its centre
    height = 2.0 * settled[:, 1].mean()
    centres, radii, _ = read_bodies(folder / "final_bodies.h5")
    return width, height, length_of(centres, radii), (centres, radii)


def length_of(centres, radii):
    """Where the heap ends: the disks beyond are fewer than one full row, pi/4 diameters high, over two diameters."""
    bins = np.arange(0.0, centres[:, 0].max() + 8.0 * radii.mean(), 4.0 * radii.mean())
    thickness = np.histogram(centres[:, 0], bins, weights=np.pi * radii**2)[0] / np.diff(bins)
    return bins[np.flatnonzero(thickness < 0.5 * np.pi * radii.mean())[0]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", metavar="OUT", type=Path)
    parser.add_argument("--grains", type=int, default=1000)
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in OUT")
    options = parser.parse_args()
    rng = np.random.default_rng(2005)
    rows, heaps = [], []
    for aspect in ASPECTS:
        width, height, length, heap = collapse(options.out / f"a{aspect}", aspect, options.grains, rng, options.measure)
        rows.append((height / width, len(heap[1]), width, height, length, length / width - 1.0))
        heaps.append((width, *heap))
    ratio, number, width, height, length, out = np.array(rows).T
    write_csv(options.out / "study_collapse.csv", {"aspect": ratio, "grains": number, "width": width, "height": height,
                                             "length": length, "run_out": out})
    slopes = {}
    for name, chosen in (("flat", ratio < FLAT), ("tall", ratio > TALL)):
        slopes[name] = np.polyfit(np.log(ratio[chosen]), np.log(out[chosen]), 1)
    write_csv(options.out / "study_collapse_summary.csv", {"quantity": ["exponent_flat", "exponent_tall"],
                                                     "value": [float(slopes[name][0]) for name in ("flat", "tall")]})
    print({name: slope[0] for name, slope in slopes.items()})
    draw(options.out, ratio, out, slopes, heaps)


def draw(out, ratio, run_out, slopes, heaps):
    """Run-out against ratio, and the heaps of a flat and of a tall column, in units of the width of the column."""
    figure, axes = plt.subplot_mosaic("ab;ac", figsize=(11.0, 4.6), layout="constrained")
    axes["a"].loglog(ratio, run_out, "o", color="#08519c")
    for name, x in (("flat", np.array([0.4, 2.5])), ("tall", np.array([2.5, 12.0]))):
        power, factor = slopes[name]
        axes["a"].loglog(x, np.exp(factor) * x**power, "--", color="0.4", label=f"{name}: $a^{{{power:.2f}}}$")
    axes["a"].set_xlabel("$a$ = height / width")
    axes["a"].set_ylabel(r"run-out $(r - r_0)/r_0$")
    axes["a"].legend(frameon=False)
    for panel, k in (("b", 1), ("c", len(heaps) - 2)):
        width, centres, radii = heaps[k]
        draw_disks(axes[panel], centres / width, radii / width)
        axes[panel].axvline(1.0, color="#b2182b", linewidth=0.8)
        axes[panel].set_title(f"$a$ = {ratio[k]:.2g}", fontsize=10)
        axes[panel].set_xlabel("$x/r_0$")
    figure.savefig(out / "study_collapse.png", dpi=130)


if __name__ == "__main__":
    main()
