#!/usr/bin/env python3
"""Discharge of disks through openings of many widths D in a flat floor: Beverloo's law in 2D, Q ~ (D - k d)^(3/2).

    python3 drivers/study_hopper.py OUT         about 4 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves OUT/study_hopper.csv, OUT/study_hopper_summary.csv and OUT/study_hopper.png."""
import argparse
from pathlib import Path

import numpy as np
from study_support import draw_disks, lattice, plt, read_history, run, states, write_csv, write_hdf5

SMALLEST, LARGEST = 0.004, 0.006  # m
DIAMETER = SMALLEST + LARGEST
OPENINGS = (7.0, 9.5, 12.0, 15.0, 18.0)  # diameters
HALF = 0.25  # m, half of the width
STEP = 5.0e-4  # s
DENSITY = 2500.0  # kg/m^2
BEVERLOO_K = 1.4


def sides():
    return [{"name": "left", "shape": "plane", "point": [-HALF, 0.0], "normal": [1.0, 0.0]},
            {"name": "right", "shape": "plane", "point": [HALF, 0.0], "normal": [-1.0, 0.0]}]


def groups(path, steps, every, final):
    return {"scene": {"dimension": 2, "bodies": "file", "bodies_file": path, "density": DENSITY, "friction": 0.5,
                      "alert_distance": 1.5e-3, "skin": 2.5e-3},
            "time": {"step": STEP, "steps": steps},
            "solver": {"tolerance": 2.0e-3, "max_iterations": 500},
            "output": {"directory": ".", "every": every, "contacts": False, "final_bodies": final}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", metavar="OUT", type=Path)
    parser.add_argument("--height", type=float, default=0.65, help="of the loose fill [m]")
    options = parser.parse_args()
    rng = np.random.default_rng(1961)
    options.out.mkdir(parents=True, exist_ok=True)
    centres, radii = lattice([-HALF, 0.0], [HALF, options.height], SMALLEST, LARGEST, rng)
    write_hdf5(options.out / "loose.h5", centres, radii)
    run(options.out / "fill", groups("../loose.h5", 800, 0, True),
        [*sides(), {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}])
    mean_mass = DENSITY * np.pi * (radii**2).mean()
    rates, histories = [], []
    for opening in OPENINGS:
        half = 0.5 * opening * DIAMETER
        folder = options.out / f"opening{opening:g}"
        run(folder, groups("../fill/final_bodies.h5", 1400, 700, False), [
            *sides(),
            {"name": "left floor", "shape": "segment", "point": [-HALF - 0.02, 0.0], "end": [-half, 0.0]},
            {"name": "right floor", "shape": "segment", "point": [HALF + 0.02, 0.0], "end": [half, 0.0]},
            {"name": "out", "shape": "outlet", "point": [0.0, -0.03], "normal": [0.0, 1.0]}])
        history = read_history(folder)
        gone = len(radii) - history["grains"]
        # once the flow is steady, and while more than half of the fill is left
        steady = (history["time"] > 0.2) & (gone < 0.5 * len(radii))
        rates.append(mean_mass * np.polyfit(history["time"][steady], gone[steady], 1)[0])
        histories.append((history["time"], gone))
    rates, width = np.array(rates), np.array(OPENINGS) * DIAMETER
    # the exponent with Beverloo's k, and k with the exponent 3/2
    exponent = np.polyfit(np.log(width - BEVERLOO_K * DIAMETER), np.log(rates), 1)[0]
    slope, shift = np.polyfit(width, rates**(2.0 / 3.0), 1)
    fitted = -shift / slope / DIAMETER
    constant = slope**1.5 / (0.8 * DENSITY * np.sqrt(9.81))
    write_csv(options.out / "study_hopper.csv", {"opening_diameters": OPENINGS, "opening": width, "mass_rate": rates})
    write_csv(options.out / "study_hopper_summary.csv", {"quantity": ["exponent", "k", "C"],
                                                   "value": [float(exponent), float(fitted), float(constant)]})
    print(exponent, fitted, constant)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13.0, 4.2), layout="constrained")
    for opening, (time, gone) in zip(OPENINGS, histories):
        left.plot(time, gone, label=f"$D/d$ = {opening:g}")
    left.set_xlabel("time [s]")
    left.set_ylabel("disks that have left")
    left.legend(frameon=False, fontsize=8)
    middle.loglog(width / DIAMETER - BEVERLOO_K, rates, "o", color="#08519c")
    x = np.array([width[0] / DIAMETER - BEVERLOO_K, width[-1] / DIAMETER - BEVERLOO_K])
    middle.loglog(x, np.exp(np.log(rates / (width / DIAMETER - BEVERLOO_K)**1.5).mean()) * x**1.5, "--", color="0.4",
                  label="exponent 3/2")
    middle.set_xlabel("$D/d - 1.4$")
    middle.set_ylabel("mass rate [kg/s]")
    middle.set_title(f"fitted exponent {exponent:.2f}", fontsize=10)
    middle.legend(frameon=False)
    for number, _, state in states(options.out / f"opening{OPENINGS[2]:g}/results.h5"):
        if number == 700:
            speed = np.linalg.norm(state["bodies/velocity"][:][:, :2], axis=1)
            disks = draw_disks(right, state["bodies/position"][:], state["bodies/radius"][:], speed, "viridis", (0.0, 0.6))
            figure.colorbar(disks, ax=right, label="speed [m/s]", shrink=0.8)
    right.set_title(f"$D/d$ = {OPENINGS[2]:g}, 0.35 s", fontsize=10)
    figure.savefig(options.out / "study_hopper.png", dpi=130)


if __name__ == "__main__":
    main()
