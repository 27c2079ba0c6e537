#!/usr/bin/env python3
"""Angle of the surface in the rotating drum of data/scenes/drum.nml against time: it keeps its mean.

    ./gravier study drum [--out DIR]           about 2 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves in DIR study_drum.csv, study_drum_summary.csv and study_drum.png."""
import argparse
from pathlib import Path

import numpy as np
from study_support import SOURCE, draw_disks, plt, run, states, write_csv
from whole_file import save_figure

RADIUS, RATE = 0.2, 1.0  # m, rad/s
START = 2.0  # s, when the flow has become steady


def surface_angle(centres):
    """Slope of a line through the highest disks of slices across the middle of the drum [degrees]."""
    edges = np.linspace(-0.6, 0.6, 13) * RADIUS
    place = np.digitize(centres[:, 0], edges) - 1
    filled = [k for k in range(12) if np.any(place == k)]
    middle = 0.5 * (edges[1:] + edges[:-1])[filled]
    top = [centres[place == k, 1].max() for k in filled]
    return np.degrees(np.arctan(np.polyfit(middle, top, 1)[0]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/drum"), help="default: out/drum")
    options = parser.parse_args()
    run(options.out / "drum", {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": str(SOURCE / "data/scenes/drum.csv"), "density": 2500.0,
                  "friction": 0.5, "alert_distance": 1.5e-3},
        "time": {"step": 1.0e-3, "steps": 14000},
        "solver": {"acceleration": "none", "tolerance": 1.0e-3, "max_iterations": 1000},
        "output": {"directory": ".", "every": 20, "contacts": False}},
        [{"name": "drum", "shape": "circle", "radius": RADIUS, "rotation": RATE, "friction": 0.8}])
    rows, last = [], None
    for _, time, state in states(options.out / "drum/results.h5"):
        centres = state["bodies/position"][:]
        rows.append((time, surface_angle(centres)))
        last = centres, state["bodies/radius"][:], np.linalg.norm(state["bodies/velocity"][:][:, :2], axis=1)
    time, angle = np.array(rows).T
    steady = time > START
    first, second = np.array_split(angle[steady], 2)
    summary = {"angle": angle[steady].mean(), "deviation": angle[steady].std(), "angle_first_half": first.mean(),
               "angle_second_half": second.mean(), "froude": RATE**2 * RADIUS / 9.81}
    print(summary)
    write_csv(options.out / "study_drum.csv", {"time": time, "angle": angle})
    write_csv(options.out / "study_drum_summary.csv", {"quantity": list(summary),
              "value": [float(value) for value in summary.values()]})
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
    left.plot(time, angle, color="#08519c", linewidth=0.9)
    left.plot([START, time[-1]], [summary["angle"]] * 2, "--", color="#b2182b", label=f"mean {summary['angle']:.1f} degrees")
    left.set_xlabel("time [s]")
    left.set_ylabel("angle of the surface [degrees]")
    left.legend(frameon=False)
    disks = draw_disks(right, *last, "viridis", (0.0, np.quantile(last[2], 0.98)))
    right.add_patch(plt.Circle((0.0, 0.0), RADIUS, fill=False, color="0.2"))
    right.set_xlim(-1.03 * RADIUS, 1.03 * RADIUS)
    right.set_ylim(-1.03 * RADIUS, 1.03 * RADIUS)
    figure.colorbar(disks, ax=right, label="speed [m/s]", shrink=0.8)
    save_figure(figure, options.out / "study_drum.png", dpi=130)


if __name__ == "__main__":
    main()
