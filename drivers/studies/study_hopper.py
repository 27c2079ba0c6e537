#!/usr/bin/env python3
"""Discharge through openings of many widths D in a flat floor: Beverloo's law, Q ~ (D - k d)^(3/2) for disks through a slot and
(D - k d)^(5/2) for spheres through a square.

    ./gravier study hopper [--out DIR] [--quick]              about 4 minutes on one core; GRAVIER_BIN_DIR says where gravier is
    ./gravier study hopper [--out DIR] [--quick] --dimension 3    about 10 minutes

leaves in DIR study_hopper.csv, study_hopper_summary.csv and study_hopper.png, or the same with _3d. --quick takes fewer openings
and a shorter time. The closing table has each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is
missed."""
import argparse
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from oracle_table import Bounds
from study_support import (OneLineParser, claimed, draw_disks, lattice, plt, positive, read_bodies,
                           read_history, run, run_study, states, write_csv, write_hdf5)
from whole_file import save_figure

STEP = 5.0e-4  # s
DENSITY = 2500.0  # kg/m^3, kg/m^2 in 2D
BEVERLOO_K = 1.4
#: Beverloo's C of circles by experiments, and what makes it that of a slot and of a square of the same width: area times the root
#: of the hydraulic diameter, over D^(5/2)
CONSTANT, SHAPE = (0.55, 0.65), {2: 4.0 / np.pi * np.sqrt(2.0), 3: 4.0 / np.pi}
# radii [m], openings [mean diameters], half of the width [m], height of the loose fill [m], steps of the filling and of a
# discharge, share of the grains that leaves while the rate is measured, exponent of the law
PLANE = SimpleNamespace(smallest=0.004, largest=0.006, openings=(7.0, 9.5, 12.0, 15.0, 18.0), half=0.25, height=0.65, filling=800,
                        discharge=1400, share=0.5, exponent=1.5, name="study_hopper")
SPACE = SimpleNamespace(smallest=0.0045, largest=0.005, openings=(4.5, 5.5, 7.0, 8.5), half=0.08713, height=0.215, filling=800,
                        discharge=2000, share=0.35, exponent=2.5, name="study_hopper_3d")
#: of the quick form
QUICK = {2: {"openings": (8.0, 12.0, 18.0), "discharge": 1000},
         3: {"openings": (5.0, 8.5), "filling": 500, "discharge": 800, "height": 0.15}}


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
            "output": {"directory": ".", "every": every, "contacts": False, "final_bodies": final}}


def rate_of(history, number, share):
    """Grains a second that leave while the flow is steady, and how that changes from the first half of this time to the second,
    over it."""
    gone = number - history["grains"]
    # once the flow is steady, and while most of the fill is left
    steady = (history["time"] > 0.2) & (gone < share * number)
    time, gone = history["time"][steady], gone[steady]
    whole, *halves = (np.polyfit(time[part], gone[part], 1)[0]
                      for part in (slice(None), slice(len(time) // 2), slice(len(time) // 2, None)))
    # of a count of independent grains in each half
    spread = 2.0 / np.sqrt(max(gone[-1] - gone[0], 1))
    return whole, (halves[1] - halves[0]) / whole, spread


def accepted(d, case, exponent, k, constant, changes):
    """The closing table."""
    law, page = "Beverloo et al., Chem. Eng. Sci. 15 (1961) 260", "doc/validation.md"
    table = Bounds()
    table.near(f"exponent of the rate against D - {BEVERLOO_K:g} d", exponent, case.exponent, 0.1, f"{law}; {page}: +- 0.1")
    table.add(f"k with the exponent {2.0 * case.exponent:g}/2", k, 1.0, 3.0, f"{law}: 1.4; {page}: 1 to 3")
    table.add(f"C with this exponent and k = {BEVERLOO_K:g}", constant, *(SHAPE[d] * c for c in CONSTANT),
              f"{CONSTANT[0]:g} to {CONSTANT[1]:g} of circles (Nedderman 1992), by the hydraulic diameter")
    table.add("change of the rate over the time of a discharge, mean of all openings", np.mean([change for change, _ in changes]),
              *(sign * (0.1 + 2.0 * np.sqrt(np.sum([spread**2 for _, spread in changes])) / len(changes)) for sign in (-1.0, 1.0)),
              f"{law}: none by the height of the fill; a tenth, and two standard deviations of a count")
    return table.close()


def bulk_density(path, case, d):
    """Mass of the settled fill over the space that it takes, which is twice as high as its centre [kg/m^d]."""
    centres, radii, _ = read_bodies(path)
    volume = {2: np.pi, 3: 4.0 / 3.0 * np.pi}[d] * radii**d
    return DENSITY * volume.sum()**2 / ((2.0 * case.half)**(d - 1) * 2.0 * (volume @ centres[:, -1]))


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/hopper"), help="default: out/hopper")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2)
    parser.add_argument("--quick", action="store_true", help="fewer openings, a shorter time")
    parser.add_argument("--height", type=positive, help="of the loose fill [m]")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    options = parser.parse_args()
    d, case = options.dimension, {2: PLANE, 3: SPACE}[options.dimension]
    if options.quick:
        case = SimpleNamespace(**{**vars(case), **QUICK[d]})
    diameter = case.smallest + case.largest
    rng = np.random.default_rng(1961)
    claimed(options.out)
    low, high = [-case.half] * (d - 1) + [0.0], [case.half] * (d - 1) + [options.height or case.height]
    centres, radii = lattice(low, high, case.smallest, case.largest, rng)
    up = np.eye(d)[-1]
    if not options.measure:
        write_hdf5(options.out / "loose.h5", centres, radii)
        run(options.out / "fill", groups(case, d, "../loose.h5", case.filling, 0, True),
            [*sides(case, d), {"name": "floor", "shape": "plane", "normal": up}])
    mean_mass = DENSITY * {2: np.pi, 3: 4.0 / 3.0 * np.pi}[d] * (radii**d).mean()
    rates, histories, changes = [], [], []
    for opening in case.openings:
        folder = options.out / f"opening{opening:g}"
        if not options.measure:
            run(folder, groups(case, d, "../fill/final_bodies.h5", case.discharge, case.discharge // 2, False), [
                *sides(case, d), *floor(case, d, 0.5 * opening * diameter),
                {"name": "out", "shape": "outlet", "point": -0.03 * up, "normal": up}])
        history = read_history(folder)
        rate, *change = rate_of(history, len(radii), case.share)
        rates.append(mean_mass * rate)
        changes.append(change)
        histories.append((history["time"], len(radii) - history["grains"]))
    rates, width = np.array(rates), np.array(case.openings) * diameter
    # the exponent with Beverloo's k, and k with the exponent of the law
    exponent = np.polyfit(np.log(width - BEVERLOO_K * diameter), np.log(rates), 1)[0]
    slope, shift = np.polyfit(width, rates**(1.0 / case.exponent), 1)
    fitted = -shift / slope / diameter
    weight = bulk_density(options.out / "fill/final_bodies.h5", case, d) * np.sqrt(9.81)
    constant = slope**case.exponent / weight
    write_csv(options.out / f"{case.name}.csv", {"opening_diameters": case.openings, "opening": width, "mass_rate": rates})
    write_csv(options.out / f"{case.name}_summary.csv", {"quantity": ["exponent", "k", "C"],
                                                   "value": [float(exponent), float(fitted), float(constant)]})
    print({"exponent": float(exponent), "k": float(fitted), "C": float(constant)})
    draw(options.out, d, case, (width, rates, exponent), histories)
    usual = np.exp(np.mean(np.log(rates / (width - BEVERLOO_K * diameter)**case.exponent))) / weight
    return accepted(d, case, exponent, fitted, usual, changes)


def draw(out, d, case, found, histories):
    """Grains that have left against time, rates against openings, and the grains in the middle of a discharge."""
    width, rates, exponent = found
    diameter = case.smallest + case.largest
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
    shown = case.openings[len(case.openings) // 2]
    for number, time, state in states(out / f"opening{shown:g}/results.h5"):
        if number == case.discharge // 2:
            place = state["bodies/position"][:]
            # in 3D those behind the middle, the near ones last
            seen = np.argsort(-place[:, 1])[:np.count_nonzero(place[:, 1] > 0.0)] if d == 3 else np.arange(len(place))
            speed = np.linalg.norm(state["bodies/velocity"][:][seen, :d], axis=1)
            disks = draw_disks(right, place[seen][:, [0, -1]], state["bodies/radius"][:][seen], speed, "viridis", (0.0, 0.6))
            figure.colorbar(disks, ax=right, label="speed [m/s]", shrink=0.8)
            right.set_title(f"$D/d$ = {shown:g}, {time:.2g} s", fontsize=10)
    save_figure(figure, out / f"{case.name}.png", dpi=130)


if __name__ == "__main__":
    run_study(main)
