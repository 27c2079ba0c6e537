#!/usr/bin/env python3
"""Overlaps in long runs, with and without their projection: disks and spheres at rest in a box under gravity at loose
tolerances, disks in a slow drum, disks that begin with overlaps of a fifth of their radius, disks under a piston.

    ./gravier study drift [--out DIR] [--quick] [--gravier PROGRAM] [--steps 20000]     3 minutes on one core

leaves DIR/drift.csv (a row a run), DIR/drift_curves.csv (overlaps against time) and DIR/drift.png. --quick makes a tenth of the
steps. The closing table has each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
from pathlib import Path

import numpy as np
from oracle_table import Bounds
from study_support import (BINARIES, OneLineParser, claimed, lattice, plt, read_bodies, read_history,
                           run, run_study, sized, whole, write_csv, write_hdf5)
from whole_file import save_figure

SMALLEST, LARGEST = 0.008, 0.012  # m
RADIUS = 0.5 * (SMALLEST + LARGEST)
ALLOWED = 0.01 * RADIUS
DENSITY = 2500.0
FRICTION = 0.3
STEP = 1.0e-3  # s
DRUM, RATE = 0.34, 0.3  # m, rad/s
LOOSE = (1.0e-2, 1.0e-3, 1.0e-4)
PRESSURE, LID_MASS = 2.0e4, 20.0  # N/m, kg
GROWN = 1.1  # grains that touch overlap by a fifth of their radius once they are larger by a tenth
FULL, QUICK = {"steps": 20000}, {"steps": 2000}
#: excess that a projection leaves, over the overlap allowed or over the excess that it finds where that is larger
LEFT = 0.1
#: overlap over that allowed of a scene that drifts, and how much overlaps grow while they are removed
DRIFTED, GROWTH = 1.3, 4.0 / 3.0


def box(size):
    """Floor and sides; no lid."""
    dimension = len(size)
    sides = []
    for d in range(dimension):
        up = [float(k == d) for k in range(dimension)]
        sides.append({"name": f"low {d}", "shape": "plane", "normal": up})
        if d < dimension - 1:
            sides.append({"name": f"high {d}", "shape": "plane", "point": [size[d] * x for x in up],
                          "normal": [-x for x in up]})
    return sides


def lid(centres, radii):
    """A plane on the grains that a pressure moves, which bears several times their weight."""
    return {"name": "lid", "shape": "plane", "normal": [0.0, -1.0], "point": [0.0, (centres[:, 1] + radii).max()],
            "free": [False, True], "pressure": PRESSURE, "mass": LID_MASS}


def groups(dimension, bodies, steps, tolerance, projection, every):
    return {
        "scene": {"dimension": dimension, "bodies": "file", "bodies_file": bodies, "density": DENSITY, "friction": FRICTION,
                  "overlap_allowed": ALLOWED, "overlap_projection": projection},
        "time": {"step": STEP, "steps": steps},
        "solver": {"acceleration": "none", "criterion": "residual", "tolerance": tolerance, "max_iterations": 500, "check_every": 5},
        "output": {"directory": ".", "every": every, "contacts": False, "final_bodies": True, "energy": True, "structure": True,
                   "boundary_forces": True}}


def settle(options, name, centres, radii, boundaries):
    """Bodies file of the grains at rest, after exact solves."""
    folder = options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    write_hdf5(folder / "loose.h5", centres, radii)
    case = groups(centres.shape[1], "loose.h5", 600, 1.0e-4, True, 0)
    run(folder, case, boundaries, program=options.gravier)
    return folder / "final_bodies.h5"


def figures(folder, name, tolerance, projection, seconds, first, width):
    """A row of the table: what the run says of its second half, energies against its start."""
    history = read_history(folder)
    half = len(history["step"]) // 2
    radii = read_bodies(folder / "final_bodies.h5")[1]
    dimension = first.shape[1]
    mass = DENSITY * (np.pi * radii**2 if dimension == 2 else 4.0 / 3.0 * np.pi * radii**3)
    last = read_bodies(folder / "final_bodies.h5")[0]
    creep = (mass[:, None] * (last - first)).sum(0) / mass.sum()
    weight = mass.sum() * 9.81
    # what the loads, pressure included, do not account for: the work of the projection
    given = history["potential_energy"] + history["load_work"]
    if "position_y:lid" in history:
        given = given + PRESSURE * width * history["position_y:lid"] + history["boundary_work"]
    return {
        "run": name, "tolerance": tolerance, "projection": int(projection), "grains": len(radii), "steps": len(history["step"]),
        "largest_overlap": history["max_overlap"][half:].max() / RADIUS,
        "last_overlap": history["max_overlap"][-1] / RADIUS,
        "mean_overlap": history["overlap_mean"][-1] / RADIUS,
        # of a grain, in units of m g R
        "kinetic_energy": history["kinetic_energy"][half:].mean() / (weight * RADIUS),
        "largest_kinetic_energy": history["kinetic_energy"].max() / (weight * RADIUS),
        "potential_energy": (history["potential_energy"][-1] - history["potential_energy"][0]) / (weight * RADIUS),
        "projection_work": (given[-1] - given[0]) / (weight * RADIUS),
        "creep_up": creep[-1] / RADIUS, "creep_side": np.linalg.norm(creep[:-1]) / RADIUS,
        "projected": history["projected"].mean(), "listed": history["listed"].sum(),
        "sweeps": history["sweeps"].mean(), "seconds": seconds}, history


def promised(history, dimension):
    """Overlap over that allowed that each step may leave to the next one. In a step of residual e bodies that touch approach each
    other with at most W e |r|, where W is 1/m of both: a local solve would change an impulse by the approach over W, and all these
    changes together are e |r|. A step that is not projected adds the way of that in a step. One that is projected leaves a tenth of
    what it finds, which is the overlap of the next step."""
    lightest = DENSITY * (np.pi * SMALLEST**2 if dimension == 2 else 4.0 / 3.0 * np.pi * SMALLEST**3)
    forces = history["force_mean"] * np.sqrt((1.0 + history["force_deviation"]**2) * history["contacts"] * (1.0 + FRICTION**2))
    way = STEP**2 * 2.0 / lightest * history["residual"] * forces / ALLOWED
    excess = np.maximum(history["max_overlap"] / ALLOWED - 1.0, 0.0) + way
    return 1.0 + np.where(history["projected"] > 0, LEFT * np.maximum(1.0, excess), excess)


def accepted(rows, curves):
    """The closing table."""
    page = "doc/theory.md, Overlaps in long runs"
    table = Bounds()
    for row in rows:
        name, tolerance = row["run"], row["tolerance"]
        what, history = f"{name}, tolerance {tolerance:.0e}", curves[name, tolerance, bool(row["projection"])]
        if not row["projection"]:
            table.near(f"{what}, without the projection: work that no load does, over m g R of a grain", row["projection_work"],
                       0.0, 1e-9,
                       "balance of energy, to rounding")
            continue
        overlaps, half = history["max_overlap"] / ALLOWED, len(history["step"]) // 2
        before = promised(history, 3 if name == "spheres" else 2)[half - 1:-1]
        table.add(f"{what}: largest overlap over what the step before promises, second half", (overlaps[half:] / before).max(),
                  None, 1.0, f"{page}, Between projections")
        table.add(f"{what}: mean of the largest overlaps over that allowed, second half", overlaps[half:].mean(), None, 1.0 + LEFT,
                  f"{page}: a tenth is left")
        if name in ("disks", "spheres"):
            table.add(f"{what}: kinetic energy of a grain over m g R", row["kinetic_energy"], None, 9.81 * STEP**2 / (2.0 * RADIUS),
                      "rest: velocities below g h")
        if name == "grown":
            table.add(f"{what}: largest overlap over the first one", history["max_overlap"].max() / history["max_overlap"][0], None,
                      GROWTH,
                      f"{page}: a third at most while they are removed")
        other = next(r for r in rows if (r["run"], r["tolerance"], r["projection"]) == (name, tolerance, 0))
        if history["max_overlap"].max() <= ALLOWED:
            table.near(f"{what}: last overlap less that without the projection, over R",
                       row["last_overlap"] - other["last_overlap"], 0.0, 0.0,
                       f"{page}: such a run is not changed at all")
        if name == "piston" and tolerance == max(LOOSE):
            table.add(f"{what}: largest overlap without the projection, over that allowed",
                      other["largest_overlap"] * RADIUS / ALLOWED, DRIFTED,
                      None, f"{page}: 39; a scene without drift would show nothing")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/drift"), help="default: out/drift")
    parser.add_argument("--gravier", metavar="PROGRAM", type=Path, default=BINARIES / "gravier")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK['steps']} steps")
    parser.add_argument("--steps", type=whole(1), help=f"of the longest runs ({FULL['steps']}, quick {QUICK['steps']})")
    options = sized(parser.parse_args(), FULL, QUICK)
    claimed(options.out)
    rng = np.random.default_rng(19)
    cell = 2.05 * LARGEST
    flat, cube, mouth = [20.1 * cell, 20.1 * cell], [7.1 * cell, 7.1 * cell, 8.1 * cell], [DRUM, DRUM]
    drum = [{"name": "drum", "shape": "circle", "radius": DRUM, "friction": 0.8}]
    disks = settle(options, "disks", *lattice([0.0, 0.0], flat, SMALLEST, LARGEST, rng), box(flat))
    spheres = settle(options, "spheres", *lattice([0.0, 0.0, 0.0], cube, SMALLEST, LARGEST, rng), box(cube))
    drummed = settle(options, "in_drum", *lattice([-DRUM, -DRUM], mouth, SMALLEST, LARGEST, rng, lambda x, r:
                                                  (np.linalg.norm(x, axis=1) < DRUM - 1.05 * r) & (x[:, 1] < 0.02)), drum)
    centres, radii, _ = read_bodies(disks)
    pressed = [*box(flat), lid(centres, radii)]
    write_hdf5(options.out / "grown.h5", centres, GROWN * radii)
    turning = [{**drum[0], "rotation": RATE}]
    runs = [("disks", 2, disks, t, options.steps, box(flat)) for t in LOOSE]
    runs += [("spheres", 3, spheres, t, options.steps // 2, box(cube)) for t in LOOSE[:2]]
    runs += [("drum", 2, drummed, t, options.steps // 2, turning) for t in LOOSE[:2]]
    runs += [("grown", 2, options.out / "grown.h5", 1.0e-3, max(options.steps // 10, 1000), box(flat))]
    runs += [("piston", 2, disks, t, options.steps // 2, pressed) for t in LOOSE[:2]]
    rows, curves = [], {}
    for name, dimension, bodies, tolerance, steps, boundaries in runs:
        for projection in (False, True):
            folder = options.out / f"{name}_{tolerance:.0e}_{'with' if projection else 'without'}"
            seconds = run(folder, groups(dimension, str(Path(bodies).resolve()), steps, tolerance, projection, 0), boundaries,
                          program=options.gravier)
            row, history = figures(folder, name, tolerance, projection, seconds, read_bodies(bodies)[0]
                                   if name != "grown" else centres, flat[0])
            rows.append(row)
            curves[name, tolerance, projection] = history
            print(row, flush=True)
            write_csv(options.out / "drift.csv", {key: [row[key] for row in rows] for key in rows[0]})
    write_curves(options.out / "drift_curves.csv", curves)
    draw(options.out / "drift.png", curves)
    return accepted(rows, curves)


def envelope(history, parts=200):
    """Step, largest overlap and mean kinetic energy of so many parts of a run."""
    cuts = np.array_split(np.arange(len(history["step"])), min(parts, len(history["step"])))
    return (np.array([history["step"][cut[-1]] for cut in cuts]), np.array([history["max_overlap"][cut].max() for cut in cuts]),
            np.array([history["kinetic_energy"][cut].mean() for cut in cuts]))


def write_curves(path, curves):
    columns = {key: [] for key in ("run", "tolerance", "projection", "step", "largest_overlap", "kinetic_energy")}
    for (name, tolerance, projection), history in curves.items():
        for values in zip(*envelope(history)):
            for key, value in zip(columns, (name, tolerance, int(projection), int(values[0]), values[1] / RADIUS, values[2])):
                columns[key].append(value)
    write_csv(path, columns)


def draw(path, curves):
    """Largest overlap of each run, dashed without the projection."""
    panels = {"disks": "disks at rest", "spheres": "spheres at rest", "drum": "slow drum", "grown": "initial overlaps",
              "piston": "disks under a piston"}
    colours = dict(zip(LOOSE, ("#b2182b", "#08519c", "#238b45")))
    figure, axes = plt.subplots(2, 3, figsize=(14.0, 6.6), layout="constrained")
    axes.flat[len(panels)].axis("off")
    for panel, (name, title) in zip(axes.flat, panels.items()):
        for (run_name, tolerance, projection), history in curves.items():
            if run_name != name:
                continue
            step, overlap, _ = envelope(history)
            panel.semilogy(step, np.maximum(overlap / RADIUS, 1.0e-6), "-" if projection else "--", color=colours[tolerance],
                           linewidth=1.1, label=f"{tolerance:.0e}, {'with' if projection else 'without'}")
        panel.axhline(ALLOWED / RADIUS, color="0.4", linewidth=0.7)
        panel.set_title(title, fontsize=10)
        panel.set_xlabel("step")
        panel.locator_params(axis="x", nbins=5)
        panel.set_ylabel("largest overlap / mean radius")
        low, high = panel.get_ylim()
        panel.set_ylim(low, high * (high / low)**0.2)
        panel.legend(frameon=False, fontsize=7, loc="upper center", ncol=3 if name == "disks" else 2)
    save_figure(figure, path, dpi=130)


if __name__ == "__main__":
    run_study(main)
