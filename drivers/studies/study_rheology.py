#!/usr/bin/env python3
"""Dense flow in sheared periodic cells under constant pressure, against published simulations: the friction and the solid fraction of disks
(F. da Cruz, S. Emam, M. Prochnow, J.-N. Roux and F. Chevoir, Physical Review E 72 (2005) 021309) and of spheres (S. Chialvo, J. Sun and
S. Sundaresan, Physical Review E 85 (2012) 021305; T. Hatano, Physical Review E 75 (2007) 060301).

    ./gravier study rheology [--out DIR] [--quick | --least I [I]]

The cell is sheared at the rate g along x over y, and its length along y is driven by a pressure P. With the mean diameter d, the mean mass m
and the inertial number I = g sqrt(m/P) of disks, g d sqrt(rho/P) of spheres, the flow has a friction mu = -sigma_xy/sigma_yy and a solid
fraction phi, means over the strain after the start. For disks with friction 0.4 the publication has mu = 0.25 + 1.1 I and
phi = 0.81 - 0.3 I. For spheres with friction 0.3 slow flow has mu = 0.357 and phi = 0.596, and mu rises as a power of I, with the exponent
0.28 +- 0.05 in the third publication.

Leaves in DIR study_rheology.csv, study_rheology_flow.csv, study_rheology.png and the runs. Exit status: 0 all rows are within their
bounds; 1 one is not."""
import sys
from pathlib import Path

import numpy as np
from oracle_table import Table
from study_support import OneLineParser, claimed, plt, positive, read_history, run, run_study, write_csv

from whole_file import save_figure

#: friction between grains, counts of the lattice that each run begins with, and its spacing, by dimension
FRICTION = {2: 0.4, 3: 0.3}
COUNTS = {2: [14, 14], 3: [6, 10, 6]}
SPACING = 1.28
#: inertial numbers, each with the strain over which means are taken: slower flows take more steps
NUMBERS = {2: {1e-4: 0.4, 3e-4: 0.8, 1e-3: 1.6, 3e-3: 6.4, 1e-2: 6.4, 3e-2: 6.4, 1e-1: 6.4},
           3: {1e-4: 0.4, 3e-4: 0.8, 1e-3: 1.6, 3e-3: 0.8, 1e-2: 16.0, 3e-2: 16.0, 1e-1: 32.0, 3e-1: 32.0}}
LEAST = {2: 1e-3, 3: 1e-3}
QUICK = {2: {1e-2: 1.6, 1e-1: 1.6}, 3: {1e-1: 0.4}}
#: flows up to here are slow: errors of their solves are compared with the rate times ten diameters, as between walls so far apart
SLOW = 1e-3
#: accuracy of slow flows of spheres, which Newton's method would have to solve to 0.1 step by step
SLOW_ACCURACY = 0.3
#: what the publications say of disks, and of slow flow of spheres
DISKS = {"mu": (0.25, 1.1), "phi": (0.81, -0.3)}
SPHERES = {"mu": 0.357, "phi": 0.596}
#: exponent of the friction of spheres in the third publication
EXPONENT = 0.28
#: accepted differences; that of the friction of the fastest flow, whose shocks are inelastic here
NEAR, FAST, NEAR_FAST = {"mu": 0.05, "phi": 0.02}, 0.05, 0.12
#: strain left out at the start, from the lattice and from the state of a faster flow
START, BEGUN = 0.4, 0.1


def step_of(number):
    """A step in units of d sqrt(rho/P): a strain of 0.005 sqrt(I), and of slow flows less. A contact takes up an impulse of about P d h in a
    step h, to which the velocity d g of the flow has the ratio I/h: where that is too small, solves do not find the velocities."""
    return 0.005 / np.sqrt(number) * min(1.0, 300.0 * number)


def flow(folder, dimension, number, taken, faster=None):
    """Shear at an inertial number: mu, phi and the standard errors of both, from means over eight parts of the strain that is taken. It begins
    with a loose lattice, or with the last state of a faster flow in its folder."""
    # grains of mean diameter 1 and of that mass, and P = 1
    density = {2: 4.0 / np.pi, 3: 6.0 / np.pi}[dimension]
    rate = number if dimension == 2 else number / np.sqrt(density)
    step = step_of(number)
    # the loose lattice comes together in some twenty units of time
    start = 20.0 + START / rate if faster is None else BEGUN / rate
    steps = int((start + taken / rate) / step)
    groups = {"scene": {"dimension": dimension, "gravity": [0.0] * 3, "density": float(density), "friction": FRICTION[dimension],
                        "cell_shear_rate": [float(rate)], "cell_pressure": [0.0, 1.0]},
              "time": {"step": float(step), "steps": steps}, "solver": {"max_iterations": 2000},
              "output": {"directory": ".", "every": steps, "stress": True, "final_bodies": True, "final_forces": True}}
    if faster is None:
        groups["scene"].update(bodies="lattice", lattice_count=COUNTS[dimension], radius_min=0.4, radius_max=0.6,
                               period=[SPACING * n for n in COUNTS[dimension]])
    else:
        groups["scene"].update(bodies="file", bodies_file=str(faster.resolve() / "final_bodies.h5"))
    if number <= SLOW:
        groups["solver"]["velocity_scale"] = float(10.0 * rate)
        if dimension == 3:
            groups["solver"]["accuracy"] = SLOW_ACCURACY
    run(folder, groups)
    history = read_history(folder)
    late = history["time"] >= start
    parts = [np.array_split(history[name][late], 8) for name in ("stress_xy", "stress_yy", "solid_fraction")]
    mu = [-np.mean(a) / np.mean(b) for a, b in zip(parts[0], parts[1])]
    phi = [np.mean(c) for c in parts[2]]
    return np.mean(mu), np.mean(phi), np.std(mu, ddof=1) / np.sqrt(8.0), np.std(phi, ddof=1) / np.sqrt(8.0)


def flows(folder, dimension, strains):
    """(I, mu, phi, errors of both) of each inertial number of `strains`, in their order. Slow flows of spheres begin where the next faster one
    of them has ended."""
    found, faster = {}, None
    for number in sorted(strains, reverse=True):
        place = folder / f"{dimension}d_{number:g}"
        found[number] = (number, *flow(place, dimension, number, strains[number], faster))
        faster = place if dimension == 3 and number <= SLOW else None
    return [found[number] for number in strains]


def with_exponent(n, numbers, values, errors):
    """mu_0 and s of mu = mu_0 + s I^n by least squares, each value weighted by its standard error, and how far off each value is, in such errors."""
    columns = np.stack([np.ones(len(numbers)), np.asarray(numbers)**n], axis=1) / np.asarray(errors)[:, None]
    fit, *_ = np.linalg.lstsq(columns, values / errors, rcond=None)
    return fit, columns @ fit - values / errors


def power_law(numbers, values, errors):
    """mu_0, s and n of mu = mu_0 + s I^n by least squares, each value weighted by its standard error, n between 0.1 and 1.5; and the standard
    error of n, or more where the values scatter by more than their errors about the law."""
    exponents, misses, fits = np.linspace(0.1, 1.5, 281), [], []
    for n in exponents:
        fit, off = with_exponent(n, numbers, values, errors)
        misses.append(np.sum(off**2))
        fits.append(fit)
    best = int(np.argmin(misses))
    near = exponents[misses <= misses[best] + max(1.0, misses[best] / max(1, len(numbers) - 3))]
    return *fits[best], exponents[best], 0.5 * np.ptp(near)


def draw(path, found):
    figure, axes = plt.subplots(1, 2, figsize=(8.6, 3.6), layout="constrained")
    line = np.geomspace(1e-4, 0.12, 100)
    for dimension, colour, mark, name in ((2, "#0072B2", "o", "disks, friction 0.4"), (3, "#D55E00", "s", "spheres, friction 0.3")):
        rows = np.array(found[dimension])
        for k, ax in enumerate(axes):
            ax.errorbar(rows[:, 0], rows[:, 1 + k], rows[:, 3 + k], fmt=mark, color=colour, markersize=5, capsize=2, label=name)
    for ax, key in zip(axes, ("mu", "phi")):
        a, b = DISKS[key]
        ax.plot(line, a + b * line, "-", color="#0072B2", linewidth=0.9, label="da Cruz et al. 2005")
        ax.axhline(SPHERES[key], color="#D55E00", linestyle="--", linewidth=0.9, label="slow limit, Chialvo et al. 2012")
        ax.set_xscale("log")
        ax.set_xlabel("inertial number I")
    rows = np.array(found[3])
    if len(rows) > 3:
        mu_0, s, n, _ = power_law(rows[:, 0], rows[:, 1], rows[:, 3])
        hatano, _ = with_exponent(EXPONENT, rows[:, 0], rows[:, 1], rows[:, 3])
        wide = np.geomspace(rows[:, 0].min(), rows[:, 0].max(), 100)
        axes[0].plot(wide, mu_0 + s * wide**n, "-", color="#D55E00", linewidth=0.9, label=f"spheres, fitted, exponent {n:.2f}")
        axes[0].plot(wide, hatano[0] + hatano[1] * wide**EXPONENT, ":", color="#D55E00", linewidth=1.2, label=f"exponent {EXPONENT} of Hatano 2007, fitted")
    axes[0].set_ylabel("friction of the flow, mu")
    axes[1].set_ylabel("solid fraction, phi")
    axes[0].legend(fontsize=8)
    save_figure(figure, path)


def compare(table, found):
    """The rows of disks at each I, and of spheres in slow flow."""
    for number, mu, phi, mu_error, phi_error in found[2]:
        for key, value, error in (("mu", mu, mu_error), ("phi", phi, phi_error)):
            a, b = DISKS[key]
            near = NEAR_FAST if key == "mu" and number > FAST else NEAR[key]
            table.add("disks", f"{key} at I = {number:g}, standard error {error:.0e}", value, a + b * number, None, near)
    for number, mu, phi, mu_error, phi_error in found[3]:
        slow = number <= 1e-2
        for key, value, error in (("mu", mu, mu_error), ("phi", phi, phi_error)):
            words = f"{key} at I = {number:g}, standard error {error:.0e}"
            if slow:
                table.add("spheres", words, value, SPHERES[key], None, NEAR[key])
            else:
                # a faster flow has more friction, and is not denser; how much is not known as well
                off = SPHERES[key] - value if key == "mu" else value - SPHERES[key]
                table.add("spheres", f"{words}, {'above' if key == 'mu' else 'below'} that of slow flow", value, SPHERES[key],
                          off if np.isnan(value) else max(off, 0.0), NEAR[key])
    if len(found[3]) > 3:
        rows = np.array(found[3])
        mu_0, s, n, error = power_law(rows[:, 0], rows[:, 1], rows[:, 3])
        table.add("spheres", f"exponent of mu = {mu_0:.3f} + {s:.2f} I^n, standard error {error:.0e}", n, EXPONENT)


def main():
    parser = OneLineParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/rheology"), help="default: out/rheology")
    parser.add_argument("--quick", action="store_true", help="fewer inertial numbers, and less strain")
    parser.add_argument("--least", type=positive, nargs="+", metavar="I", help="smallest inertial number of disks and of spheres, one or two "
                        "numbers (1e-3); the least there are is 1e-4")
    options = parser.parse_args()
    if options.least and len(options.least) > 2:
        parser.error("--least takes one or two numbers")
    if options.least and options.quick:
        parser.error("--quick has inertial numbers of its own; expected no --least beside it")
    least = dict(zip((2, 3), 2 * options.least)) if options.least else LEAST
    for dimension, taken in NUMBERS.items():
        if least[dimension] > max(taken):
            parser.error(f"--least {least[dimension]:g}: expected at most {max(taken):g}")
    claimed(options.out)
    found = {}
    for dimension in (2, 3):
        strains = QUICK[dimension] if options.quick else {number: taken for number, taken in NUMBERS[dimension].items() if number >= least[dimension]}
        found[dimension] = flows(options.out, dimension, strains)
    table = Table()
    compare(table, found)
    write_csv(options.out / "study_rheology.csv", {name: [row[k] for row in table.rows] for k, name in enumerate(table.HEADER)})
    rows = [(dimension, *row) for dimension in found for row in found[dimension]]
    write_csv(options.out / "study_rheology_flow.csv", {name: [row[k] for row in rows] for k, name in enumerate(
        ("dimension", "inertial_number", "mu", "phi", "mu_error", "phi_error"))})
    draw(options.out / "study_rheology.png", found)
    sys.exit(1 if table.misses else 0)


if __name__ == "__main__":
    run_study(main)
