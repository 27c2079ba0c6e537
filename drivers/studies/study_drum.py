#!/usr/bin/env python3
"""Angle of the surface in the rotating drum of data/scenes/drum.nml against time: it keeps its mean.

    ./gravier study drum [--out DIR] [--quick]           about 2 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves in DIR study_drum.csv, study_drum_summary.csv and study_drum.png. --quick takes a shorter time. The closing table has each
measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
from pathlib import Path

import numpy as np
from oracle_table import Bounds
from study_support import SOURCE, OneLineParser, claimed, draw_disks, error_of, plt, read_history, run, run_study, states, write_csv
from whole_file import save_figure

RADIUS, RATE = 0.2, 1.0  # m, rad/s
START = 2.0  # s, when the flow has become steady
DENSITY = 2500.0  # kg/m^2
FULL, QUICK = 14000, 5000  # steps of 1 ms
#: angles of heaps of disks: that of the friction at constant volume in biaxial tests with this friction (sin phi at least 0.25),
#: and that at which a disk rolls off a close row of its like
SLOWEST, STEEPEST = np.degrees(np.arcsin(0.25)), 30.0


def surface_angle(centres):
    """Slope of a line through the highest disks of slices across the middle of the drum [degrees]."""
    edges = np.linspace(-0.6, 0.6, 13) * RADIUS
    place = np.digitize(centres[:, 0], edges) - 1
    filled = [k for k in range(12) if np.any(place == k)]
    middle = 0.5 * (edges[1:] + edges[:-1])[filled]
    top = [centres[place == k, 1].max() for k in filled]
    return np.degrees(np.arctan(np.polyfit(middle, top, 1)[0]))


def accepted(history, angles, moments):
    """The closing table; moments: of the weight about the axis of the drum, at the states of the steady flow."""
    first, second = np.array_split(angles, 2)
    work, time = (history[name][history["time"] > START] for name in ("boundary_work", "time"))
    power = (work[-1] - work[0]) / (time[-1] - time[0])
    table = Bounds()
    table.add("angle of the surface [degrees]", angles.mean(), SLOWEST, STEEPEST,
              "friction at constant volume (CEGEO benchmark, 2012: sin phi 0.25) to a disk on a close row of its like (30)")
    table.near("angle in the second half of the time less that in the first [degrees]", second.mean() - first.mean(), 0.0,
               max(1.0, 3.0 * np.hypot(error_of(first, 4), error_of(second, 4))),
               "steady flow (doc/validation.md, Drum); a degree, or three standard errors")
    table.near("power of the drum over rate times moment of the weight", power / (RATE * abs(moments.mean())), 1.0, 0.05,
               "balance of angular momentum; a twentieth, for what the flow has at the ends")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/drum"), help="default: out/drum")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} steps in the place of {FULL}")
    options = parser.parse_args()
    claimed(options.out)
    run(options.out / "drum", {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": str(SOURCE / "data/scenes/drum.csv"), "density": DENSITY,
                  "friction": 0.5, "alert_distance": 1.5e-3},
        "time": {"step": 1.0e-3, "steps": QUICK if options.quick else FULL},
        "output": {"directory": ".", "every": 20, "contacts": False, "energy": True}},
        [{"name": "drum", "shape": "circle", "radius": RADIUS, "rotation": RATE, "friction": 0.8}])
    rows, moments, last = [], [], None
    for _, time, state in states(options.out / "drum/results.h5"):
        centres = state["bodies/position"][:]
        rows.append((time, surface_angle(centres)))
        moments.append(9.81 * DENSITY * np.pi * (state["bodies/radius"][:]**2 @ centres[:, 0]))
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
    return accepted(read_history(options.out / "drum"), angle[steady], np.array(moments)[steady])


if __name__ == "__main__":
    run_study(main)
