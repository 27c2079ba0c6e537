#!/usr/bin/env python3
"""Janssen's law in 2D: the vertical stress in a silo whose floor goes down slowly saturates with the depth,
sigma = rho g lambda (1 - exp(-z/lambda)), lambda = width / (2 mu K).

    ./gravier study silo [--out DIR]           about 3 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves in DIR study_silo.csv, study_silo_summary.csv and study_silo.png."""
import argparse
from pathlib import Path

import numpy as np
from study_support import draw_disks, lattice, plt, run, states, write_csv, write_hdf5
from whole_file import save_figure

SMALLEST, LARGEST = 0.004, 0.006  # m
CELLS = 12  # grains across
WIDTH = CELLS * 2.05 * LARGEST
DENSITY = 2500.0  # kg/m^2
FRICTION = 0.5
STEP = 1.0e-3  # s
SETTLING, WARMING, SAMPLING = 700, 500, 1000  # steps


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/silo"), help="default: out/silo")
    parser.add_argument("--layers", type=int, default=120)
    options = parser.parse_args()
    rng = np.random.default_rng(1895)
    options.out.mkdir(parents=True, exist_ok=True)
    centres, radii = lattice([0.0, 0.0], [WIDTH, options.layers * 2.05 * LARGEST], SMALLEST, LARGEST, rng)
    write_hdf5(options.out / "loose.h5", centres, radii)
    (options.out / "floor.csv").write_text(f"time,vx,vy\n0,0,0\n{SETTLING * STEP},0,0\n{(SETTLING + 100) * STEP},0,-0.02\n")
    run(options.out / "silo", {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": "../loose.h5", "density": DENSITY, "friction": FRICTION,
                  "alert_distance": 1.5e-3, "skin": 2.5e-3},
        "time": {"step": STEP, "steps": SETTLING + WARMING + SAMPLING},
        "solver": {"acceleration": "none", "tolerance": 1.0e-4, "max_iterations": 1000},
        "output": {"directory": ".", "every": 10}}, [
            {"name": "floor", "shape": "plane", "normal": [0.0, 1.0], "table": "../floor.csv"},
            {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
            {"name": "right", "shape": "plane", "point": [WIDTH, 0.0], "normal": [-1.0, 0.0]}])
    weight = DENSITY * np.pi * radii**2 * 9.81
    n, slices = len(radii), 24
    samples, bottom = [], []
    for number, _, state in states(options.out / "silo/results.h5"):
        if number <= SETTLING + WARMING:
            continue
        position = state["bodies/position"][:]
        top = np.quantile(position[:, 1], 0.995)
        floor = state["boundaries/position"][0, 1]
        bottom.append(-state["boundaries/force"][0, 1] / WIDTH)
        depth = np.linspace(0.0, top - floor, slices + 1)
        antagonist = state["contacts/antagonist"][:]
        row = state["contacts/candidate"][:] - 1
        impulse = state["contacts/impulse"][:] / STEP
        on_side = antagonist > n + 1
        # left: normal x, tangent y; right: normal -x, tangent -y
        up = np.where(antagonist == n + 2, 1.0, -1.0) * impulse[:, 1]
        z = top - position[row, 1]
        held = np.histogram(z[on_side], depth, weights=up[on_side])[0]
        pushed = np.histogram(z[on_side], depth, weights=impulse[on_side, 0])[0]
        load = np.histogram(top - position[:, 1], depth, weights=weight)[0]
        vertical = np.concatenate([[0.0], np.cumsum(load - held)]) / WIDTH
        samples.append((depth, vertical, np.concatenate([[0.0], pushed]) / (2.0 * np.diff(depth)[0]),
                        np.concatenate([[0.0], np.cumsum(load)]) / WIDTH, np.concatenate([[0.0], held])))
    depth, vertical, lateral, hydrostatic, held = np.array(samples).mean(axis=0)
    rho_g = np.polyfit(depth[3:], hydrostatic[3:], 1)[0]
    # least squares over lambda, for the depth that the grains fill
    lengths = np.linspace(0.2, 8.0, 2000) * WIDTH
    error = [((rho_g * x * (1.0 - np.exp(-depth / x)) - vertical)**2).sum() for x in lengths]
    length = lengths[int(np.argmin(error))]
    mobilised = held[3:].sum() / (lateral[3:].sum() * 2.0 * np.diff(depth)[0])
    middle = slice(slices // 4, slices + 1)
    ratio = (lateral[middle] / vertical[middle]).mean()
    summary = {"lambda_over_width": length / WIDTH, "K_fitted": WIDTH / (2.0 * FRICTION * length), "K_measured": float(ratio),
               "friction_mobilised": mobilised, "bottom_stress_over_hydrostatic": float(np.mean(bottom) / hydrostatic[-1]),
               "bottom_stress_over_saturation": float(np.mean(bottom) / (rho_g * length))}
    print(summary)
    write_csv(options.out / "study_silo.csv", {"depth": depth, "vertical_stress": vertical, "lateral_stress": lateral,
                                         "hydrostatic": hydrostatic})
    write_csv(options.out / "study_silo_summary.csv", {"quantity": list(summary),
              "value": [float(value) for value in summary.values()]})
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 4.8), width_ratios=(3, 1), layout="constrained")
    left.plot(depth / WIDTH, hydrostatic / 1e3, "--", color="0.6", label=r"$\rho g z$")
    left.plot(depth / WIDTH, vertical / 1e3, "o", color="#08519c", label=r"$\sigma_{zz}$")
    left.plot(depth / WIDTH, lateral / 1e3, "s", color="#b2182b", markersize=4, label=r"$\sigma_{xx}$ on the sides")
    left.plot(depth / WIDTH, rho_g * length * (1.0 - np.exp(-depth / length)) / 1e3, color="0.2",
              label=rf"Janssen, $\lambda$ = {length / WIDTH:.2f} widths, $K$ = {summary['K_fitted']:.2f}")
    left.set_xlabel("depth / width")
    left.set_ylabel("stress [kN/m]")
    left.legend(frameon=False)
    draw_disks(right, position, radii)
    right.set_xlabel("x [m]")
    save_figure(figure, options.out / "study_silo.png", dpi=130)


if __name__ == "__main__":
    main()
