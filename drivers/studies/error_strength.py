"""Part of study_error.py: strength and change of volume of the shipped shear cell, biaxial and triaxial tests, beside runs that are
ten times as tight. Grains part ways over thousands of steps: two runs whose accuracies are a hundredth apart have strengths that differ
by some per cent. Each side is therefore the mean of several such runs."""
import concurrent.futures
import csv

import numpy as np
from study_support import BINARIES, SOURCE, gravier, write_measured

#: of the strength, of the change of volume, relative
STRENGTH, VOLUME = 0.03, 0.10
TIGHTER = 10.0
#: runs of a side, whose accuracies are so far apart; the biaxial and the triaxial test scatter most
RUNS, APART = {"shear": 4, "biaxial": 8, "triaxial": 8}, 0.01


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


def play(name, measure, out, factor, number, steps):
    """Means over the second half of run `number`, and the change of the volume from the first step to that mean."""
    case = gravier.parse_namelist((SOURCE / f"data/scenes/{name}.nml").read_text(encoding="utf-8"))
    groups = {group: keys if group == "boundary" else dict(keys[0]) for group, keys in case.items()}
    groups["scene"]["bodies_file"] = str(SOURCE / groups["scene"]["bodies_file"])
    groups["output"] = {"directory": "results", "every": 0, "contacts": False, "boundary_forces": True}
    if steps:
        groups["time"]["steps"] = steps
    solver = groups["solver"]
    solver["accuracy"] = solver.get("accuracy", 0.1) / factor * (1.0 - APART * number)
    if factor > 1.0:
        solver["tolerance"] = solver.get("tolerance", 1.0e-2) / factor
        solver["max_iterations"] = 10 * solver.get("max_iterations", 10000)
    place = out / f"{name}_{'tight' if factor > 1.0 else 'default'}_{number}"
    status = gravier.run(groups, place, 1, (BINARIES / "gravier").resolve())
    history = gravier.read_table(place / "results/history.csv")
    force, other, volume = measure(history, case)
    half = len(force) // 2
    return {"status": status, "strength": force[half:].sum() / other[half:].sum(), "volume_change": volume[half:].mean() / volume[0] - 1.0,
            "iterations": history["iterations"].sum(), "seconds": history["solve_seconds"].sum(),
            "missed": int((history["converged"] == 0).sum())}


def study_strength(out, steps=0):
    """The bounds that do not hold."""
    runs = {name: 1 if steps else number for name, number in RUNS.items()}
    print(f"\nstrength and change of volume at the settings of the shipped cases, and {TIGHTER:g} times as tight: means over the second half, "
          f"of several runs\nwhose accuracies are {100 * APART:g} % apart, with their standard errors\n")
    print(f"{'test':10}{'strength':>18}{'tight':>18}{'volume':>20}{'tight':>20}{'iterations':>12}{'tight':>10}{'missed':>8}{'tight':>7}")
    rows, failures = [], []
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        jobs = {(name, factor): [pool.submit(play, name, measure, out, factor, number, steps) for number in range(runs[name])]
                for name, measure in (("shear", shear), ("biaxial", biaxial), ("triaxial", triaxial)) for factor in (1.0, TIGHTER)}
    for name in dict.fromkeys(name for name, _ in jobs):
        sides = [[job.result() for job in jobs[name, factor]] for factor in (1.0, TIGHTER)]
        mean = [{key: np.mean([run[key] for run in side]) for key in side[0]} for side in sides]
        spread = [{key: np.std([run[key] for run in side], ddof=1) / np.sqrt(runs[name]) if runs[name] > 1 else np.nan for key in side[0]} for side in sides]
        print(f"{name:10}" + "".join(f"{mean[k]['strength']:9.4f} +-{spread[k]['strength']:7.4f}" for k in (0, 1))
              + "".join(f"{mean[k]['volume_change']:10.5f} +-{spread[k]['volume_change']:8.5f}" for k in (0, 1))
              + f"{mean[0]['iterations']:12.0f}{mean[1]['iterations']:10.0f}{mean[0]['missed']:8.0f}{mean[1]['missed']:7.0f}", flush=True)
        rows.append((name, *mean[0].values(), *spread[0].values(), *mean[1].values(), *spread[1].values()))
        for key, bound in (("strength", STRENGTH), ("volume_change", VOLUME)):
            off = abs(mean[0][key] / mean[1][key] - 1.0)
            if not off <= bound:
                failures.append(f"{name}: {key.replace('_', ' ')} {mean[0][key]:.4g} beside {mean[1][key]:.4g}: {100 * off:.1f} % apart, "
                                f"expected {100 * bound:.0f} %")
    keys = list(mean[0])
    names = [*keys, *[key + "_error" for key in keys], *["tight_" + key for key in keys], *[f"tight_{key}_error" for key in keys]]
    write_measured(out / "error_strength.csv", dict(zip(["test", *names], zip(*rows))))
    return failures
