#!/usr/bin/env python3
"""The distribution of forces between disks in biaxial compression, rigid and with springs, against published simulations: Radjai, Jean, Moreau
and Roux, Physical Review Letters 77 (1996) 274.

    ./gravier study forces [--out DIR] [--quick]

The shipped scene data/scenes/biaxial.nml is run with rigid contacts and with springs of kappa = 10 000. Of the normal forces f between disks
over their mean in each state while the sample yields, the study takes the distribution P: above the mean it falls as exp(-beta f), with
beta = 1.4 in the publication; below the mean it goes as f^alpha, with alpha = -0.3; some two fifths of the forces are above the mean.
Both exponents are those of largest likelihood. P is no pure power of f here: the slope in a part of the range is shown beside. Rigid forces are one of many possible sets, and those of springs are unique: their distributions should not differ.

Leaves in DIR study_forces.csv, study_forces.png and the runs. Exit status: 0 all rows are within their bounds; 1 one is not."""
import sys
from pathlib import Path

import numpy as np
from oracle_table import Table
from study_support import SOURCE, OneLineParser, claimed, plt, run, run_study, states, write_csv

from gravier.force_networks import STRONG, tail_exponent, weak_exponent
from whole_file import save_figure

#: exponents of the publication
BETA, ALPHA = 1.4, -0.3
#: forces over their mean of which the slope is shown; beta is fitted to those in STRONG, alpha to all forces below the mean
MIDDLE = (0.02, 0.5)
PRESSURE = 1000.0  # N/m
STEP = 1.0e-3  # s
#: from this step on the sample yields at a strain of a tenth and more, where its volume hardly changes
YIELDS = 2000
SIDES = {"floor": ([0.0, 0.0], [0.0, 1.0], {}), "left": ([0.0, 0.0], [1.0, 0.0], {}),
         "right": ([0.3567266, 0.0], [-1.0, 0.0], {"free": [True, False], "pressure": PRESSURE, "mass": 1.0}),
         "lid": ([0.0, 0.6218765], [0.0, -1.0], {"velocity": [0.0, -0.03]})}


def compress(folder, compliant, steps):
    """Run the scene; the forces over their mean, of all states while it yields."""
    groups = {"scene": {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": str(SOURCE / "data/scenes/biaxial.csv"),
                        "density": 2500.0, "friction": 0.5, "wall_friction": 0.0},
              "time": {"step": STEP, "steps": steps}, "solver": {"max_iterations": 5000},
              "output": {"directory": ".", "every": 40, "contacts": True}}
    if compliant:
        groups["scene"]["wall_material"] = "wall"
        groups["material"] = [{"name": "disk", "density": 2500.0}, {"name": "wall"}]
        spring = {"kind": "elastic", "stiffness_number": 1.0e4, "stiffness_pressure": PRESSURE, "spring_restitution": 0.3}
        groups["law"] = [{"materials": ["disk"], "friction": 0.5, **spring}, {"materials": ["disk", "wall"], **spring}]
    run(folder, groups, [{"name": name, "shape": "plane", "point": point, "normal": normal, **more}
                         for name, (point, normal, more) in SIDES.items()])
    found = []
    for number, _, state in states(folder / "results.h5"):
        if number >= YIELDS:
            forces = state["contacts/impulse"][:, 0]
            forces = forces[(forces > 0.0) & (state["contacts/antagonist"][:] <= len(state["bodies/id"]))]
            found.append(forces / forces.mean())
    return np.concatenate(found)


def exponents(forces):
    """beta, alpha and the share of forces above the mean."""
    return tail_exponent(forces, *STRONG), weak_exponent(forces), np.mean(forces > 1.0)


def slope(forces):
    """Slope of the histogram of the forces in MIDDLE in the logarithm, in equal bins of the logarithm."""
    edges = np.geomspace(*MIDDLE, 11)
    density = np.histogram(forces, edges)[0] / np.diff(edges)
    return np.polyfit(np.log(np.sqrt(edges[1:] * edges[:-1])), np.log(density), 1)[0]


def draw(path, found):
    figure, axes = plt.subplots(figsize=(5.0, 3.6), layout="constrained")
    edges = np.linspace(0.0, 6.0, 31)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for (name, forces), colour, mark in zip(found.items(), ("#0072B2", "#D55E00"), "os"):
        axes.semilogy(middle, np.histogram(forces, edges, density=True)[0], mark, color=colour, markersize=4, label=name)
    line = np.linspace(1.0, 6.0, 2)
    axes.semilogy(line, 0.55 * np.exp(-BETA * (line - 1.0)), "k-", linewidth=0.8, label=f"exp(-{BETA} f), Radjai et al. 1996")
    axes.set_xlabel("normal force over its mean, f")
    axes.set_ylabel("probability density")
    axes.legend()
    save_figure(figure, path)


def main():
    parser = OneLineParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/forces"), help="default: out/forces")
    parser.add_argument("--quick", action="store_true", help="two thirds of the strain")
    options = parser.parse_args()
    claimed(options.out)
    table, found, values = Table(), {}, {}
    for name in ("rigid", "springs"):
        found[name] = compress(options.out / name, name == "springs", 4000 if options.quick else 6000)
        values[name] = exponents(found[name])
        beta, alpha, share = values[name]
        table.add(name, f"beta, of {np.sum(found[name] > STRONG[0])} forces above the mean", beta, BETA, None, 0.3)
        table.add(name, f"alpha, of {np.sum(found[name] < 1.0)} forces below it", alpha, ALPHA, None, 0.2)
        table.add(name, f"slope of the forces from {MIDDLE[0]:g} to {MIDDLE[1]:g} of it", slope(found[name]))
        table.add(name, "share of forces above the mean", share, 0.4, None, 0.05)
    for k, what in enumerate(("beta", "alpha", "share above the mean")):
        table.add("both", f"{what}, springs against rigid", values["springs"][k], values["rigid"][k], None, (0.15, 0.1, 0.02)[k])
    write_csv(options.out / "study_forces.csv", {name: [row[k] for row in table.rows] for k, name in enumerate(table.HEADER)})
    draw(options.out / "study_forces.png", found)
    sys.exit(1 if table.misses else 0)


if __name__ == "__main__":
    run_study(main)
