#!/usr/bin/env python3
"""Janssen's law in 2D: the vertical stress in a silo whose floor goes down slowly saturates with the depth,
sigma = rho g lambda (1 - exp(-z/lambda)), lambda = width / (2 mu K).

    ./gravier study silo [--out DIR] [--quick]           about 6 minutes on one core; GRAVIER_BIN_DIR says where gravier is

leaves in DIR study_silo.csv, study_silo_summary.csv and study_silo.png. --quick takes a lower fill and means over a shorter time.
The closing table has each measured quantity beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
from pathlib import Path

import numpy as np
from oracle_table import Bounds
from study_support import (OneLineParser, claimed, draw_disks, gravier, lattice, plt, read_history, run, run_study, sized, whole,
                           write_csv, write_hdf5)
from whole_file import save_figure

SMALLEST, LARGEST = 0.004, 0.006  # m
CELLS = 12  # grains across
WIDTH = CELLS * 2.05 * LARGEST
DENSITY = 2500.0  # kg/m^2
FRICTION = 0.5
STEP = 1.0e-3  # s
SPEED = 0.02  # of the floor [m/s]
SETTLING, WARMING = 700, 500  # steps
#: layers of the loose fill, and steps over which means are taken
FULL, QUICK = {"layers": 120, "sampling": 1000}, {"layers": 50, "sampling": 500}
SLICES = 24
#: sin phi of disks with this friction at constant volume, at most, by which the stresses of a fill are limited
SINE = 0.30


def lower(options, centres, radii):
    """Run the silo, whose floor goes down once the disks have settled."""
    write_hdf5(options.out / "loose.h5", centres, radii)
    # at once: a drive that is slower than the load of a step would set the scale of the accuracy while it begins
    (options.out / "floor.csv").write_text(f"time,vx,vy\n0,0,0\n{SETTLING * STEP},0,0\n{(SETTLING + 1) * STEP},0,{-SPEED}\n")
    run(options.out / "silo", {
        # loose disks fall as far as 3 mm in a step
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": "../loose.h5", "density": DENSITY, "friction": FRICTION,
                  "alert_distance": 3.0e-3, "skin": 2.5e-3},
        "time": {"step": STEP, "steps": SETTLING + WARMING + options.sampling},
        # stresses of single steps scatter by half of their mean: those of all steps are taken
        "region": [{"name": "layers", "axis": "y", "bins": SLICES, "sample_every": 1}],
        "output": {"directory": ".", "every": 100, "contacts": False, "boundary_forces": True}}, [
            {"name": "floor", "shape": "plane", "normal": [0.0, 1.0], "table": "../floor.csv"},
            {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
            {"name": "right", "shape": "plane", "point": [WIDTH, 0.0], "normal": [-1.0, 0.0]}])


def profiles(folder):
    """Means over all steps while the floor goes down, by layers from the top: depth of their middle, vertical and lateral stress,
    and the stress there of the fill without walls; then the stress on the floor, and friction and normal force of both sides."""
    found = gravier.Run(folder)
    layers = found.region_mean("layers", [step for step in found.steps if step > SETTLING + WARMING])
    up = slice(None, None, -1)
    depth = (layers.upper[-1, 1] - layers.centre[:, 1])[up]
    thick = layers.upper[0, 1] - layers.lower[0, 1]
    load = (DENSITY * 9.81 * thick * layers.solid_fraction)[up]
    history = read_history(folder)
    late = history["step"] > SETTLING + WARMING
    force = {name: history[name][late].mean()
             for name in ("force_y:floor", "force_x:left", "force_y:left", "force_x:right", "force_y:right")}
    return (depth, layers.stress[up, 1, 1], layers.stress[up, 0, 0], np.cumsum(load) - 0.5 * load, -force["force_y:floor"] / WIDTH,
            -force["force_y:left"] - force["force_y:right"], abs(force["force_x:left"]) + abs(force["force_x:right"]))


def accepted(summary):
    """The closing table."""
    page, law = "doc/validation.md, Silo", "Janssen's law"
    least, most = (1.0 - SINE) / (1.0 + SINE), (1.0 + SINE) / (1.0 - SINE)
    table = Bounds()
    table.add("vertical stress against Janssen's curve, largest difference over the saturated stress",
              summary["largest_difference"], 0.0, 0.1,
              f"{law}; a tenth, for one sample")
    table.near("stress on the floor over that of Janssen's law at its depth", summary["bottom_stress_over_law"], 1.0, 0.1,
               f"{law}; a tenth, for one sample ({page}: 0.91 of saturation)")
    table.add("stress on the floor over that of the fill without walls", summary["bottom_stress_over_hydrostatic"], 0.0,
              summary["saturation_most"], f"{law} with Rankine's least K and half of the friction")
    table.near("weight that floor and sides bear over the weight of the fill", summary["weight_borne"], 1.0, 0.03,
               "equilibrium; the floor goes down slowly")
    table.add("friction mobilised on the sides", summary["friction_mobilised"], 0.0, FRICTION, "Coulomb's law")
    table.add("lateral over vertical stress", summary["K_measured"], least, most,
              f"Rankine's active and passive states at sin phi = {SINE:g} (CEGEO benchmark, 2012)")
    table.near("friction times K of the fit, over mobilised friction times measured ratio of stresses",
               summary["K_fitted"] * FRICTION / (summary["friction_mobilised"] * summary["K_measured"]), 1.0, 0.1,
               f"equilibrium of a slice ({page}: 0.262 and 0.263)")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/silo"), help="default: out/silo")
    parser.add_argument("--quick", action="store_true", help="a lower fill, means over a shorter time")
    parser.add_argument("--layers", type=whole(1), help=f"of the loose fill ({FULL['layers']}, quick {QUICK['layers']})")
    parser.add_argument("--sampling", type=whole(1),
                        help=f"steps over which means are taken ({FULL['sampling']}, quick {QUICK['sampling']})")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    options = sized(parser.parse_args(), FULL, QUICK)
    claimed(options.out)
    centres, radii = lattice([0.0, 0.0], [WIDTH, options.layers * 2.05 * LARGEST], SMALLEST, LARGEST, np.random.default_rng(1895))
    if not options.measure:
        lower(options, centres, radii)
    depth, vertical, lateral, hydrostatic, bottom, held, pushed = profiles(options.out / "silo")
    weight = DENSITY * 9.81 * np.pi * (radii**2).sum()
    rho_g = np.polyfit(depth[3:], hydrostatic[3:], 1)[0]
    # least squares over lambda, for the depth that the grains fill
    lengths = np.linspace(0.2, 8.0, 2000) * WIDTH
    error = [((rho_g * x * (1.0 - np.exp(-depth / x)) - vertical)**2).sum() for x in lengths]
    length = lengths[int(np.argmin(error))]
    middle = slice(SLICES // 4, SLICES)
    ratio = (lateral[middle] / vertical[middle]).mean()
    summary = {"lambda_over_width": length / WIDTH, "K_fitted": WIDTH / (2.0 * FRICTION * length), "K_measured": float(ratio),
               "friction_mobilised": float(held / pushed), "bottom_stress_over_hydrostatic": float(bottom * WIDTH / weight),
               "bottom_stress_over_saturation": float(bottom / (rho_g * length)),
               "weight_borne": float((bottom * WIDTH + held) / weight)}
    print(summary)
    write_csv(options.out / "study_silo.csv", {"depth": depth, "vertical_stress": vertical, "lateral_stress": lateral,
                                         "hydrostatic": hydrostatic})
    write_csv(options.out / "study_silo_summary.csv", {"quantity": list(summary),
              "value": [float(value) for value in summary.values()]})
    # the floor is half of a layer below the middle of the last one
    floor = depth[-1] + depth[0]
    curve = rho_g * length * (1.0 - np.exp(-depth / length))
    draw(options.out / "study_silo.png", depth, (vertical, lateral, hydrostatic, curve), (length, summary["K_fitted"]),
         gravier.Run(options.out / "silo").bodies())
    weakest = WIDTH / (2.0 * 0.5 * FRICTION * (1.0 - SINE) / (1.0 + SINE))
    return accepted({**summary, "largest_difference": np.abs(curve - vertical).max() / (rho_g * length),
                     "bottom_stress_over_law": bottom / (rho_g * length * (1.0 - np.exp(-floor / length))),
                     "saturation_most": weakest * (1.0 - np.exp(-floor / weakest)) / floor})


def draw(path, depth, stresses, fit, disks):
    """Stresses against depth with Janssen's curve, of which `fit` has the length and K, and the disks at the end."""
    vertical, lateral, hydrostatic, curve = stresses
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 4.8), width_ratios=(3, 1), layout="constrained")
    left.plot(depth / WIDTH, hydrostatic / 1e3, "--", color="0.6", label=r"$\rho g z$")
    left.plot(depth / WIDTH, vertical / 1e3, "o", color="#08519c", label=r"$\sigma_{zz}$")
    left.plot(depth / WIDTH, lateral / 1e3, "s", color="#b2182b", markersize=4, label=r"$\sigma_{xx}$")
    left.plot(depth / WIDTH, curve / 1e3, color="0.2",
              label=rf"Janssen, $\lambda$ = {fit[0] / WIDTH:.2f} widths, $K$ = {fit[1]:.2f}")
    left.set_xlabel("depth / width")
    left.set_ylabel("stress [kN/m]")
    left.legend(frameon=False)
    draw_disks(right, disks.position, disks.radius)
    right.set_xlabel("x [m]")
    save_figure(figure, path, dpi=130)


if __name__ == "__main__":
    run_study(main)
