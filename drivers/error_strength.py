"""Part of study_error.py: strength and change of volume of the shipped shear cell, biaxial and triaxial tests, beside runs that are
ten times as tight."""
import csv

import numpy as np
from study_support import BINARIES, SOURCE, gravier, write_measured

#: of the strength, of the change of volume, relative
STRENGTH, VOLUME = 0.03, 0.10
TIGHTER = 10.0


def shear(history, case):
    """Force along the flow and across it on the top row, and the height of the cell."""
    with open(SOURCE / case["scene"][0]["bodies_file"], newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    heights = {group: np.mean([float(row["y"]) for row in rows if row["group"] == group]) for group in ("1", "2")}
    return abs(history["force_x:top"]), abs(history["force_y:top"]), heights["2"] - heights["1"] + history["position_y:top"]


def biaxial(history, case):
    """Force on the lid, that of the lateral pressure on it, and the area."""
    wide, high = history["position_x:right"], history["position_y:lid"]
    return abs(history["force_y:lid"]), pressure_of(case, "right") * wide, wide * high


def triaxial(history, case):
    """Force on the lid, that of the lateral pressure on it, and the volume."""
    wide, deep, high = history["position_x:right"], history["position_y:back"], history["position_z:lid"]
    return abs(history["force_z:lid"]), pressure_of(case, "right") * wide * deep, wide * deep * high


def pressure_of(case, name):
    return next(boundary["pressure"] for boundary in case["boundary"] if boundary["name"] == name)


def play(name, measure, out, factor, steps):
    """Means over the second half of a run, and the change of the volume from the first step to that mean."""
    case = gravier.parse_namelist((SOURCE / f"data/scenes/{name}.nml").read_text(encoding="utf-8"))
    groups = {group: keys if group == "boundary" else dict(keys[0]) for group, keys in case.items()}
    groups["scene"]["bodies_file"] = str(SOURCE / groups["scene"]["bodies_file"])
    groups["output"] = {"directory": "results", "every": 0, "contacts": False, "boundary_forces": True}
    if steps:
        groups["time"]["steps"] = steps
    if factor > 1.0:
        solver = groups["solver"]
        solver["accuracy"] = solver.get("accuracy", 0.1) / factor
        solver["tolerance"] = solver.get("tolerance", 1.0e-2) / factor
        solver["max_iterations"] = 10 * solver.get("max_iterations", 10000)
    place = out / f"{name} {'tight' if factor > 1.0 else 'default'}".replace(" ", "_")
    status = gravier.run(groups, place, 1, (BINARIES / "gravier").resolve())
    history = gravier.read_table(place / "results/history.csv")
    force, other, volume = measure(history, case)
    half = len(force) // 2
    return {"status": status, "strength": force[half:].sum() / other[half:].sum(), "volume_change": volume[half:].mean() / volume[0] - 1.0,
            "iterations": history["iterations"].sum(), "seconds": history["solve_seconds"].sum(),
            "missed": int((history["converged"] == 0).sum())}


def study_strength(out, steps=0):
    """The bounds that do not hold."""
    print(f"\nstrength and change of volume at the settings of the shipped cases, and {TIGHTER:g} times as tight: means over the second half\n")
    print(f"{'test':10}{'strength':>10}{'tight':>10}{'volume':>12}{'tight':>12}{'iterations':>12}{'tight':>10}{'missed':>8}{'tight':>7}")
    rows, failures = [], []
    for name, measure in (("shear", shear), ("biaxial", biaxial), ("triaxial", triaxial)):
        default, tight = play(name, measure, out, 1.0, steps), play(name, measure, out, TIGHTER, steps)
        print(f"{name:10}{default['strength']:10.4f}{tight['strength']:10.4f}{default['volume_change']:12.5f}{tight['volume_change']:12.5f}"
              f"{default['iterations']:12.0f}{tight['iterations']:10.0f}{default['missed']:8d}{tight['missed']:7d}", flush=True)
        rows.append((name, *default.values(), *tight.values()))
        for key, bound in (("strength", STRENGTH), ("volume_change", VOLUME)):
            off = abs(default[key] / tight[key] - 1.0)
            if not off <= bound:
                failures.append(f"{name}: {key.replace('_', ' ')} {default[key]:.4g} beside {tight[key]:.4g}: {100 * off:.1f} % apart, expected "
                                f"{100 * bound:.0f} %")
    keys = list(default)
    write_measured(out / "error_strength.csv", dict(zip(["test", *keys, *["tight_" + key for key in keys]], zip(*rows))))
    return failures
