#!/usr/bin/env python3
"""Discharge through openings of many widths D in a flat floor: Beverloo's law, Q ~ (D - k d)^(3/2) for disks through a slot and
(D - k d)^(5/2) for spheres through a square.

    ./gravier study hopper [--out DIR]                     about 4 minutes on one core; GRAVIER_BIN_DIR says where gravier is
    ./gravier study hopper [--out DIR] --dimension 3       about 5 minutes

leaves in DIR study_hopper.csv, study_hopper_summary.csv and study_hopper.png, or the same with _3d."""
import argparse
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from study_support import draw_disks, lattice, plt, read_history, run, states, write_csv, write_hdf5
from whole_file import save_figure

STEP = 5.0e-4  # s
DENSITY = 2500.0  # kg/m^3, kg/m^2 in 2D
BEVERLOO_K = 1.4
# radii [m], openings [mean diameters], half of the width [m], height of the loose fill [m], steps of the filling and of a
# discharge, share of the grains that leaves while the rate is measured, exponent of the law
PLANE = SimpleNamespace(smallest=0.004, largest=0.006, openings=(7.0, 9.5, 12.0, 15.0, 18.0), half=0.25, height=0.65, filling=800,
                        discharge=1400, share=0.5, exponent=1.5, name="study_hopper",
                        solver={"acceleration": "none", "tolerance": 2.0e-3, "max_iterations": 500})
SPACE = SimpleNamespace(smallest=0.0045, largest=0.005, openings=(4.5, 5.5, 7.0, 8.5), half=0.08713, height=0.215, filling=800,
                        discharge=2000, share=0.35, exponent=2.5, name="study_hopper_3d",
                        solver={"tolerance": 2.0e-3, "max_iterations": 500, "acceleration": "momentum"})


def sides(case, d):
    """Two planes across each horizontal axis."""
    return [{"name": f"{side} {'xy'[k]}", "shape": "plane", "point": -sign * case.half * np.eye(d)[k],
             "normal": sign * np.eye(d)[k]} for k in range(d - 1) for side, sign in (("low", 1.0), ("high", -1.0))]


def floor(case, d, half):
    """A floor with an opening of half width `half`, which sticks out a little behind the sides."""
    far = case.half + 0.02
    if d == 2:
        return [{"name": "left floor", "shape": "segment", "point": [-far, 0.0], "end": [-half, 0.0]},
                {"name": "right floor", "shape": "segment", "point": [far, 0.0], "end": [half, 0.0]}]
    # four rectangles around the square, each along one of its edges as far as the sides, turned by 90 degrees from one to the next
    turns = [np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    return [{"name": f"floor {k + 1}", "shape": "rectangle", "point": turn @ [half, -half, 0.0],
             "edge_a": turn @ [far - half, 0.0, 0.0], "edge_b": turn @ [0.0, far + half, 0.0]} for k, turn in enumerate(turns)]


def groups(case, d, path, steps, every, final):
    return {"scene": {"dimension": d, "bodies": "file", "bodies_file": path, "density": DENSITY, "friction": 0.5,
                      "alert_distance": 1.5e-3, "skin": 2.5e-3},
            "time": {"step": STEP, "steps": steps},
            "solver": case.solver,
            "output": {"directory": ".", "every": every, "contacts": False, "final_bodies": final}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/hopper"), help="default: out/hopper")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2)
    parser.add_argument("--height", type=float, help="of the loose fill [m]")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    options = parser.parse_args()
    d, case = options.dimension, {2: PLANE, 3: SPACE}[options.dimension]
    diameter = case.smallest + case.largest
    rng = np.random.default_rng(1961)
    options.out.mkdir(parents=True, exist_ok=True)
    low, high = [-case.half] * (d - 1) + [0.0], [case.half] * (d - 1) + [options.height or case.height]
    centres, radii = lattice(low, high, case.smallest, case.largest, rng)
    up = np.eye(d)[-1]
    if not options.measure:
        write_hdf5(options.out / "loose.h5", centres, radii)
        run(options.out / "fill", groups(case, d, "../loose.h5", case.filling, 0, True),
            [*sides(case, d), {"name": "floor", "shape": "plane", "normal": up}])
    mean_mass = DENSITY * {2: np.pi, 3: 4.0 / 3.0 * np.pi}[d] * (radii**d).mean()
    rates, histories = [], []
    for opening in case.openings:
        folder = options.out / f"opening{opening:g}"
        if not options.measure:
            run(folder, groups(case, d, "../fill/final_bodies.h5", case.discharge, case.discharge // 2, False), [
                *sides(case, d), *floor(case, d, 0.5 * opening * diameter),
                {"name": "out", "shape": "outlet", "point": -0.03 * up, "normal": up}])
        history = read_history(folder)
        gone = len(radii) - history["grains"]
        # once the flow is steady, and while most of the fill is left
        steady = (history["time"] > 0.2) & (gone < case.share * len(radii))
        rates.append(mean_mass * np.polyfit(history["time"][steady], gone[steady], 1)[0])
        histories.append((history["time"], gone))
    rates, width = np.array(rates), np.array(case.openings) * diameter
    # the exponent with Beverloo's k, and k with the exponent of the law
    exponent = np.polyfit(np.log(width - BEVERLOO_K * diameter), np.log(rates), 1)[0]
    slope, shift = np.polyfit(width, rates**(1.0 / case.exponent), 1)
    fitted = -shift / slope / diameter
    constant = slope**case.exponent / ({2: 0.8, 3: 0.56}[d] * DENSITY * np.sqrt(9.81))
    write_csv(options.out / f"{case.name}.csv", {"opening_diameters": case.openings, "opening": width, "mass_rate": rates})
    write_csv(options.out / f"{case.name}_summary.csv", {"quantity": ["exponent", "k", "C"],
                                                   "value": [float(exponent), float(fitted), float(constant)]})
    print(exponent, fitted, constant)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13.0, 4.2), layout="constrained")
    for opening, (time, gone) in zip(case.openings, histories):
        left.plot(time, gone, label=f"$D/d$ = {opening:g}")
    left.set_xlabel("time [s]")
    left.set_ylabel("grains that have left")
    left.legend(frameon=False, fontsize=8)
    middle.loglog(width / diameter - BEVERLOO_K, rates, "o", color="#08519c")
    x = np.array([width[0] / diameter - BEVERLOO_K, width[-1] / diameter - BEVERLOO_K])
    middle.loglog(x, np.exp(np.log(rates / (width / diameter - BEVERLOO_K)**case.exponent).mean()) * x**case.exponent, "--",
                  color="0.4", label=f"exponent {2.0 * case.exponent:g}/2")
    middle.set_xlabel("$D/d - 1.4$")
    middle.set_ylabel("mass rate [kg/s]")
    middle.set_title(f"fitted exponent {exponent:.2f}", fontsize=10)
    middle.legend(frameon=False)
    shown = case.openings[2]
    for number, time, state in states(options.out / f"opening{shown:g}/results.h5"):
        if number == case.discharge // 2:
            place = state["bodies/position"][:]
            # in 3D those behind the middle, the near ones last
            seen = np.argsort(-place[:, 1])[:np.count_nonzero(place[:, 1] > 0.0)] if d == 3 else np.arange(len(place))
            speed = np.linalg.norm(state["bodies/velocity"][:][seen, :d], axis=1)
            disks = draw_disks(right, place[seen][:, [0, -1]], state["bodies/radius"][:][seen], speed, "viridis", (0.0, 0.6))
            figure.colorbar(disks, ax=right, label="speed [m/s]", shrink=0.8)
            right.set_title(f"$D/d$ = {shown:g}, {time:.2g} s", fontsize=10)
    save_figure(figure, options.out / f"{case.name}.png", dpi=130)


if __name__ == "__main__":
    main()
