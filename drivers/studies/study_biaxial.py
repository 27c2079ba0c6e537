#!/usr/bin/env python3
"""Biaxial compression of 5000 disks, Rmax/Rmin = 3 (CEGEO benchmark, 2012): isotropic compaction without friction between
smooth walls, then compression at constant lateral pressure with friction 0.5.

    ./gravier study biaxial [--out DIR] [--quick]        about 10 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves in DIR study_biaxial.csv (the stress-strain curve), study_biaxial_summary.csv and study_biaxial.png. --quick takes 600 disks.
The closing table has each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
from pathlib import Path

import numpy as np
from oracle_table import Bounds
from study_support import (OneLineParser, claimed, draw_disks, loose, plt, positive, radii_by_volume, read_bodies,
                           read_history, run, run_study, sized, states, whole, write_csv, write_hdf5)
from whole_file import save_figure

PRESSURE = 1000.0  # N/m
DENSITY = 2500.0  # kg/m^2
SMALLEST = 0.005  # m
STEP = 1.0e-3  # s, to compact
REST_STEP = 1.0e-2  # s, to come to rest
#: to compress [s]: 0.08 of the time in which the pressure moves a disk by its diameter
SHEAR_STEP = 2.0e-3
LAYER = 6.0 * SMALLEST  # m, along the walls, where disks lie less densely
#: at rest contacts are counted by their forces, which the default accuracy leaves off by several per cent
AT_REST = {"accuracy": 0.01}
#: disks, and vertical strain rate relative to the first height [1/s]: the inertia of a sample makes its stresses oscillate, more those
#: of a large one and at a high rate
FULL, QUICK = {"grains": 5000, "rate": 0.01}, {"grains": 600, "rate": 0.03}
#: share of the strain from which on the volume is constant: the solid fraction of 5000 disks changes by 0.003 from there to the end
LATE = 0.6
#: largest overlap over what is allowed, a hundredth of the mean radius, where solves and projections do what the theory says
EXCESS = 1.3
#: standard deviation of sin phi among five samples of 600 disks; it falls as the root of their number
SCATTER = 0.013


def walls(size, mass, lid):
    """Floor and left side stay, the right side bears the pressure, the lid is as told."""
    return [
        {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
        {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
        {"name": "right", "shape": "plane", "point": [size[0], 0.0], "normal": [-1.0, 0.0], "free": [True, False],
         "pressure": PRESSURE, "mass": mass},
        {"name": "lid", "shape": "plane", "point": [0.0, size[1]], "normal": [0.0, -1.0], **lid}]


def scene(path, friction, alert):
    """Without gravity; the walls are smooth."""
    return {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": path, "density": DENSITY,
            "friction": friction, "wall_friction": 0.0, "alert_distance": alert}


def size_of(state):
    """Of the box between the walls."""
    position = state["boundaries/position"][:]
    return np.array([position[2, 0], position[3, 1]])


def pressures(state):
    """Mean normal stress of the grains on the right side and on the lid."""
    force, size = state["boundaries/force"][:], size_of(state)
    return abs(force[2, 0]) / size[1], abs(force[3, 1]) / size[0]


def inner_fraction(centres, radii, size, layer):
    """Share of the box less a layer along its walls that disks fill, by counting points."""
    steps = 600
    grid = np.stack(np.meshgrid(*[np.linspace(layer, size[d] - layer, steps) for d in (0, 1)], indexing="ij"), -1).reshape(-1, 2)
    filled = np.zeros((steps, steps), bool)
    spacing = (size - 2.0 * layer) / (steps - 1)
    for centre, radius in zip(centres, radii):
        low = np.maximum(((centre - radius - layer) / spacing).astype(int), 0)
        high = np.minimum(((centre + radius - layer) / spacing).astype(int) + 2, steps)
        if np.any(high <= low):
            continue
        view = tuple(slice(low[d], high[d]) for d in (0, 1))
        points = grid.reshape(steps, steps, 2)[view]
        filled[view] |= ((points - centre)**2).sum(-1) < radius**2
    return filled.mean()


def coordination(state, n, layer):
    """Of the grains farther than `layer` from the walls: mean number of loaded contacts, that number without the rattlers,
    grains that fewer than three others hold (once rattlers are away), and the share of these."""
    position, size = state["bodies/position"][:], size_of(state)
    inner = np.all((position > layer) & (position < size - layer), axis=1)
    impulse = state["contacts/impulse"][:, 0]
    loaded = impulse > 1e-3 * impulse[impulse > 0.0].mean()
    a, b = state["contacts/candidate"][:][loaded], state["contacts/antagonist"][:][loaded]
    number = np.bincount(a, minlength=n + 6) + np.bincount(b, minlength=n + 6)
    everyone = number[1:n + 1][inner].mean()
    alive = np.ones(n + 6, bool)
    while True:
        keep = alive[a] & alive[b]
        number = np.bincount(a[keep], minlength=n + 6) + np.bincount(b[keep], minlength=n + 6)
        lost = alive & (number < 3)
        lost[0] = lost[n + 1:] = False
        if not lost[1:n + 1].any():
            break
        alive[lost] = False
    held = alive[1:n + 1] & inner
    if not held.any():
        return everyone, 0.0, 1.0
    return everyone, number[1:n + 1][held].mean(), 1.0 - held.sum() / inner.sum()


def compact(options, size, mass):
    """Press the loose disks of DIR/loose.h5 together, then let them come to rest with exact solves."""
    free_lid = {"free": [False, True], "pressure": PRESSURE, "mass": mass}
    run(options.out / "compaction", {
        "scene": scene("../loose.h5", 0.0, 0.4 * SMALLEST),
        "time": {"step": STEP, "steps": options.compaction_steps},
        "output": {"directory": ".", "every": 0, "final_bodies": True}}, walls(size, mass, free_lid))
    size = [size_of(state) for _, _, state in states(options.out / "compaction/results.h5")][-1]
    run(options.out / "rest", {
        "scene": scene("../compaction/final_bodies.h5", 0.0, 0.2 * SMALLEST),
        "time": {"step": REST_STEP, "steps": 200},
        "solver": AT_REST,
        "output": {"directory": ".", "every": 0, "final_bodies": True}}, walls(size, mass, free_lid))


def compress(options, centres, radii, size):
    """Bring the lid down at constant lateral pressure. The side weighs as much as two disks: a heavy one runs ahead of them and
    comes back."""
    mass = 2.0 * DENSITY * np.pi * (radii**2).mean()
    write_hdf5(options.out / "compact.h5", centres, radii)
    speed = options.rate * size[1]
    steps = int(options.strain / options.rate / options.step)
    # the velocity error ends solves, unless a residual is told
    solver = {} if options.tolerance is None else {
        "criterion": "residual", "tolerance": options.tolerance, "max_iterations": options.max_iterations,
        "acceleration": options.acceleration, "check_every": 10}
    run(options.out / "shear", {
        "scene": scene("../compact.h5", 0.5, 0.2 * SMALLEST),
        "time": {"step": options.step, "steps": steps},
        "solver": solver,
        "output": {"directory": ".", "every": max(1, steps // 250), "final_bodies": True, "boundary_forces": True}},
        walls(size, mass, {"velocity": [0.0, -speed]}))


def stress_strain(folder, size, volume):
    """Axial and lateral strain, stresses on lid and side over the pressure, sin phi, solid fraction and coordination of each state,
    as columns. Stresses are means over all steps since the state before."""
    history, rows, before = read_history(folder), [], 0
    sides = {"lid": abs(history["force_y:lid"]) / history["position_x:right"],
             "right": abs(history["force_x:right"]) / history["position_y:lid"]}
    for number, _, state in states(folder / "results.h5"):
        box = size_of(state)
        if number > 0:
            steps = (history["step"] > before) & (history["step"] <= number)
            top, side = (sides[name][steps].mean() for name in ("lid", "right"))
            rows.append((1.0 - box[1] / size[1], box[0] / size[0] - 1.0, top / PRESSURE, side / PRESSURE,
                         (top - side) / (top + side), volume / box.prod(), coordination(state, len(state["bodies/id"]), LAYER)[1]))
        before = number
    return np.array(rows).T


def accepted(summary, n):
    """The closing table of n disks. Samples smaller than that of the benchmark may have sin phi farther off."""
    off = 2.0 * SCATTER * np.sqrt(QUICK["grains"] / n) if n < FULL["grains"] else 0.0
    benchmark, page = "CEGEO benchmark, 2012", "doc/validation.md, Biaxial compression"
    table = Bounds()
    table.add("solid fraction without friction, away from the walls", summary["solid_fraction_inner"], 0.84, 0.85,
              f"{benchmark}; {page}")
    table.near("coordination without friction and rattlers", summary["coordination_mu0"], 4.0, 0.1,
               f"isostatic packing of disks: 4; {page}: about 4; a tenth, for contacts that have opened")
    for name, side in (("right", "side"), ("lid", "lid")):
        table.near(f"pressure of the disks on the {side} over that applied", summary[f"pressure_{name}"], 1.0, 0.01,
                   "equilibrium; a hundredth")
    table.add("sin phi with friction 0.5, at constant volume", summary["sin_phi"], 0.25 - off, 0.30 + off,
              f"{benchmark}: 0.25 to 0.30; {page}" + (f"; two standard deviations of samples of {n} disks" if off else ""))
    table.add("peak of sin phi over that at constant volume", summary["sin_phi_peak"] / summary["sin_phi"], 1.0, None,
              f"a dense sample has a peak; {page}: 0.40 and 0.30")
    table.near("solid fraction at constant volume", summary["solid_fraction_last"], 0.81, 0.02,
               "slow flow of disks (da Cruz et al., Phys. Rev. E 72 (2005) 021309); 0.02 as in the study of dense flow")
    table.add("solid fraction at the end over that at the start", summary["solid_fraction_last"] / summary["solid_fraction_box"],
              None, 1.0,
              "a dense sample dilates (Reynolds)")
    table.add("largest overlap over the mean radius", summary["largest_overlap_over_radius"], None, 0.01 * EXCESS,
              f"doc/theory.md, Overlaps in long runs: {EXCESS:g} of what is allowed")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/biaxial"), help="default: out/biaxial")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK['grains']} disks")
    parser.add_argument("--grains", type=whole(1), help=f"disks ({FULL['grains']}, quick {QUICK['grains']})")
    parser.add_argument("--seed", type=whole(0), default=2012, help="of the radii and places at the start (2012)")
    parser.add_argument("--compaction-steps", type=whole(0), default=1500)
    parser.add_argument("--compacted", action="store_true", help="start from the disks that an earlier run left in DIR/rest")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    parser.add_argument("--rate", type=positive,
                        help=f"vertical strain rate, relative to the first height [1/s] ({FULL['rate']:g}, quick {QUICK['rate']:g})")
    parser.add_argument("--step", type=positive, default=SHEAR_STEP, help=f"of time while the lid comes down [s] ({SHEAR_STEP:g})")
    parser.add_argument("--tolerance", type=positive,
                        help="residual at which solves end while the lid comes down; without it they end by the velocity error")
    parser.add_argument("--max-iterations", type=whole(1), default=1000, help="of the same solves, with --tolerance")
    parser.add_argument("--acceleration", choices=["none", "momentum"], default="momentum",
                        help="of the same solves, with --tolerance")
    parser.add_argument("--strain", type=positive, default=0.25, help="vertical strain at the end (0.25)")
    options = sized(parser.parse_args(), FULL, QUICK)
    claimed(options.out)
    n = options.grains
    rng = np.random.default_rng(options.seed)
    radii = radii_by_volume(n, SMALLEST, 3.0 * SMALLEST, 2, rng)
    volume = np.pi * (radii**2).sum()
    size = np.full(2, np.sqrt(volume / 0.58))
    mass = 10.0 * DENSITY * size[0] * 2.0 * radii.mean()
    if not (options.compacted or options.measure):
        write_hdf5(options.out / "loose.h5", loose(radii, [0.0, 0.0], size, rng), radii)
        compact(options, size, mass)
    for _, _, state in states(options.out / "rest/results.h5"):
        if "contacts" in state:
            last = {"size": size_of(state), "pressure": pressures(state), "coordination": coordination(state, n, LAYER)}
    centres, _, _ = read_bodies(options.out / "rest/final_bodies.h5")
    size = last["size"]
    inner = inner_fraction(centres, radii, size, LAYER)
    summary = {"solid_fraction_inner": inner, "solid_fraction_box": volume / size.prod(),
               "coordination_mu0": last["coordination"][1], "coordination_mu0_all": last["coordination"][0],
               "rattlers_mu0": last["coordination"][2],
               "pressure_right": last["pressure"][0] / PRESSURE, "pressure_lid": last["pressure"][1] / PRESSURE}
    print(summary, flush=True)

    if not options.measure:
        compress(options, centres, radii, size)
    strain, lateral, top, side, sine, fraction, number = stress_strain(options.out / "shear", size, volume)
    write_csv(options.out / "study_biaxial.csv", {"axial_strain": strain, "lateral_strain": lateral, "axial_stress": top,
        "lateral_stress": side, "sin_phi": sine, "solid_fraction": fraction, "coordination": number})
    history = read_history(options.out / "shear")
    # the volume has become constant
    late = strain > LATE * options.strain
    # a peak is one before that; stresses fluctuate, and the mean of their ratio is not that of their means
    mean_top, mean_side = (np.convolve(stress[~late], np.ones(9) / 9.0, "valid") for stress in (top, side))
    last_top, last_side = top[late].mean(), side[late].mean()
    summary.update(sin_phi_peak=((mean_top - mean_side) / (mean_top + mean_side)).max(),
                   sin_phi=(last_top - last_side) / (last_top + last_side), sin_phi_deviation=sine[late].std(),
                   solid_fraction_least=fraction.min(), solid_fraction_most=fraction.max(), solid_fraction_last=fraction[-1],
                   largest_overlap_over_radius=history["max_overlap"].max() / radii.mean(),
                   median_overlap_over_radius=np.median(history["max_overlap"]) / radii.mean(),
                   sweeps=history["sweeps"].mean(), converged=history["converged"].mean(),
                   projected=history["projected"].mean(),
                   inertial_number=options.rate * 2.0 * radii.mean() * np.sqrt(DENSITY / PRESSURE))
    write_csv(options.out / "study_biaxial_summary.csv", {"quantity": list(summary),
              "value": [float(value) for value in summary.values()]})
    print(summary)
    draw(options.out, strain, sine, fraction, centres, radii)
    return accepted(summary, n)


def draw(out, strain, sine, fraction, start, radii):
    """Stress and solid fraction against strain; how far the disks have turned shows where shear has gone."""
    end, _, _ = read_bodies(out / "shear/final_bodies.h5")
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
    left.axhspan(0.25, 0.30, color="0.9", label="CEGEO, large strain")
    left.plot(strain, sine, linewidth=0.8, color="#08519c")
    left.set_xlabel("axial strain")
    left.set_ylabel(r"$\sin\varphi = (\sigma_1 - \sigma_2)/(\sigma_1 + \sigma_2)$", color="#08519c")
    left.set_ylim(0.0, None)
    left.legend(loc="lower right", frameon=False)
    twin = left.twinx()
    twin.plot(strain, fraction, color="#b2182b", linewidth=1.0)
    twin.set_ylabel("solid fraction", color="#b2182b")
    # way of each disk relative to the mean way of its place in the box
    design = np.column_stack([np.ones(len(start)), start])
    odd = end - design @ np.linalg.lstsq(design, end, rcond=None)[0]
    way = np.linalg.norm(odd, axis=1) / radii.mean()
    disks = draw_disks(right, end, radii, way, "magma_r", (0.0, np.quantile(way, 0.98)))
    figure.colorbar(disks, ax=right, label="way besides the mean strain / mean radius", shrink=0.8)
    right.set_xlabel("x [m]")
    right.set_ylabel("y [m]")
    save_figure(figure, out / "study_biaxial.png", dpi=130)


if __name__ == "__main__":
    run_study(main)
