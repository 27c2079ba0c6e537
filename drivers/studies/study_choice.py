#!/usr/bin/env python3
"""Step and accuracy of five small scenes: what a user would publish, its error, and what it costs.

    ./gravier study choice [--out DIR]                     some ten minutes on two cores; GRAVIER_BIN_DIR says where gravier is
    ./gravier study choice [--out DIR] --only shear drum   these alone
    ./gravier study choice [--out DIR] --quick             settling and biaxial alone, without the smallest step, four runs of each setting

leaves in DIR study_choice.csv, a row for each quantity of each setting, and prints the tables of doc/choosing.md. Each scene is one of data/ with a
shorter time or with fewer grains. Each setting, a step and an accuracy, has several runs, which begin from places of the grains that differ by
a ten-thousandth of a diameter (the lattice of the settling: from other radii). Values are means over these runs. The reference is the mean of the
setting with the smallest step and the tightest accuracy. The uncertainty of a deviation is twice its standard error, which has those of both means.
A value is right where its deviation is at most 2 % (of a change of volume: 10 %), or at most its uncertainty where this is larger. Seconds are
processor seconds of a run on one rank. Cost is seconds over those of the cheapest setting that is right. The closing table has the deviations of the
default accuracy and of the tight one beside what is accepted. Exit status: 0 all are held; 1 one is missed."""
import argparse
import resource
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from oracle_table import Bounds
from study_drum import surface_angle
from study_support import (BINARIES, SOURCE, OneLineParser, claimed, gravier, read_history,
                           run_study, sized, states, whole, write_hdf5, write_measured)

ACCURACIES = (0.3, 0.1, 0.03)
#: deviation that counts as none: of a change of volume, which is a small difference, and of all else
RIGHT_VOLUME, RIGHT = 0.1, 0.02
#: standard errors that make the uncertainty of a deviation, and those that the closing table allows to each of its forty
UNCERTAIN, FAR = 2.0, 3.0
#: how many times what is right three standard errors may be: figures that scatter more say nothing
CEILING = 5.0
#: share of the solves that may miss their accuracy
MISSED = 0.0025
#: by which places of grains differ between runs of one setting, in mean diameters. With a hundredth of this the runs stay alike for so long
#: that their scatter comes out too small
SHIFT = 1.0e-4


def settled(directory, groups):
    """Solid fraction under a level surface: the centre of mass is at half of its height."""
    for _, _, state in states(directory / "results.h5"):
        centres, radii = state["bodies/position"][:], state["bodies/radius"][:]
    scene = groups["scene"]
    width = 2.05 * scene["radius_max"] * scene["lattice_count"][0]
    area = np.pi * radii**2
    return {"solid fraction": area.sum()**2 / (2.0 * width * (area @ centres[:, 1]))}


def sheared(directory, _):
    """Shear force over normal force on the top row in the second half of the time."""
    history = read_history(directory)
    late = history["time"] > 0.5 * history["time"][-1]
    return {"stress ratio": abs(history["force_x:top"][late].mean() / history["force_y:top"][late].mean())}


def compressed(directory, groups):
    """Mean stress on the lid over that on the side at strains beyond 0.01, and dilation: volume at the end over that at the start, less 1."""
    history = read_history(directory)
    width, height = history["position_x:right"], history["position_y:lid"]
    points = {boundary["name"]: boundary["point"] for boundary in groups["boundary"] if boundary["name"] in ("right", "lid")}
    late = 1.0 - height / points["lid"][1] > 0.01
    ratio = abs(history["force_y:lid"][late] / width[late]).mean() / abs(history["force_x:right"][late] / height[late]).mean()
    return {"strength": ratio, "volume change": width[-1] * height[-1] / (points["right"][0] * points["lid"][1]) - 1.0}


def discharged(directory, _):
    """Disks a second that leave, while the hopper still holds 80 to 40 % of them."""
    history = read_history(directory)
    share = history["grains"] / history["grains"][0]
    steady = (share < 0.8) & (share > 0.4)
    return {"flow [1/s]": -np.polyfit(history["time"][steady], history["grains"][steady], 1)[0] if steady.sum() > 9 else np.nan}


def turned(directory, _):
    """Mean angle of the surface in the second half of the time."""
    found = [(time, surface_angle(state["bodies/position"][:])) for _, time, state in states(directory / "results.h5")]
    return {"angle [degrees]": np.mean([angle for time, angle in found if time > 0.5 * found[-1][0]])}


def lower_disks(position):
    """Grains of the hopper below a height."""
    return position[:, 1] < 0.3


# case, simulated time [s], steps [s], seconds between states (0: the last alone), what is measured, grains that are kept, changes of boundaries
SCENES = {
    "settling": SimpleNamespace(case="demo/settle", time=0.8, steps=(2.0e-3, 1.0e-3, 5.0e-4), every=0.8, measure=settled),
    "shear": SimpleNamespace(case="scenes/shear", time=2.0, steps=(2.0e-3, 1.0e-3, 5.0e-4), every=0.0, measure=sheared),
    "biaxial": SimpleNamespace(case="scenes/biaxial", time=1.0, steps=(2.0e-3, 1.0e-3, 5.0e-4), every=0.0, measure=compressed),
    "discharge": SimpleNamespace(case="scenes/hopper", time=0.9, steps=(1.0e-3, 5.0e-4), every=0.0, measure=discharged,
                                 keep=lower_disks, gate=0.3),
    "drum": SimpleNamespace(case="scenes/drum", time=2.4, steps=(2.0e-3, 1.0e-3, 5.0e-4), every=0.04, measure=turned),
}


def groups_of(scene, directory, step, accuracy, realisation):
    """The case of a run, with its grains where they are not a lattice."""
    text = (SOURCE / f"data/{scene.case}.nml").read_text(encoding="utf-8")
    groups = {name: several if name == "boundary" else several[0] for name, several in gravier.parse_namelist(text).items()}
    steps = round(scene.time / step)
    groups["time"].update(step=step, steps=steps)
    groups["solver"].update(accuracy=accuracy)
    groups["output"] = {"directory": ".", "every": round(scene.every / step), "contacts": False, "boundary_forces": "boundary" in groups}
    for boundary in groups.get("boundary", ()):
        if "remove_at" in boundary:
            boundary["remove_at"] = scene.gate
    if groups["scene"]["bodies"] == "lattice":
        groups["scene"]["seed"] += realisation
        return groups
    table = np.genfromtxt(SOURCE / groups["scene"]["bodies_file"], delimiter=",", names=True, skip_header=1)
    position = np.stack([table[axis] for axis in "xyz" if axis in table.dtype.names], 1)
    radius, group = table["radius"], table["group"].astype(int) if "group" in table.dtype.names else None
    if hasattr(scene, "keep"):
        kept = scene.keep(position)
        position, radius = position[kept], radius[kept]
    # glued grains stay where they are
    shift = np.random.default_rng(realisation).uniform(-SHIFT, SHIFT, position.shape) * 2.0 * radius.mean()
    position = position + shift * (realisation > 0 if group is None else ((group == 0) & (realisation > 0))[:, None])
    write_hdf5(directory / "start.h5", position, radius, group)
    groups["scene"]["bodies_file"] = "start.h5"
    return groups


def run_one(job):
    """What a run gives, what it costs, and the share of its solves that missed the accuracy; where `measure` is true of a run that was made."""
    out, measure, name, step, accuracy, realisation = job
    scene, directory = SCENES[name], out / f"{name}_{step:g}_{accuracy:g}_{realisation}"
    directory.mkdir(parents=True, exist_ok=True)
    groups = groups_of(scene, directory, step, accuracy, realisation)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not measure:
        gravier.run(groups, directory, 1, (BINARIES / "gravier").resolve())
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        (directory / "seconds").write_text(f"{seconds}\n", encoding="ascii")
    seconds = float((directory / "seconds").read_text(encoding="ascii"))
    history = read_history(directory)
    found = SimpleNamespace(name=name, step=step, accuracy=accuracy, realisation=realisation, values=scene.measure(directory, groups),
                            seconds=seconds, missed=1.0 - history["converged"].mean(), iterations=history["iterations"].sum())
    print(f"{directory.name}: {seconds:.1f} s, {100.0 * found.missed:.1f} % of the solves missed, {found.values}", flush=True)
    return found


def jobs_of(options):
    """All runs, the long ones first."""
    jobs = [(name, step, accuracy, k) for name in options.only for step in SCENES[name].steps for accuracy in ACCURACIES
            for k in range(options.realisations)]
    return [(options.out, options.measure, *job) for job in sorted(jobs, key=lambda job: job[1] * job[2])]


def right_within(quantity):
    """The deviation of a quantity that counts as none."""
    return RIGHT_VOLUME if quantity == "volume change" else RIGHT


def compare(runs):
    """Rows of the table of one scene: each quantity of each setting against the reference."""
    settings = {}
    for one in runs:
        settings.setdefault((one.step, one.accuracy), []).append(one)
    rows = []
    for quantity in runs[0].values:
        values = {key: np.array([one.values[quantity] for one in several]) for key, several in settings.items()}
        mean = {key: found.mean() for key, found in values.items()}
        variance = {key: found.var(ddof=1) / len(found) for key, found in values.items()}
        reference = min(settings)
        for key, several in settings.items():
            deviation = mean[key] / mean[reference] - 1.0
            error = np.sqrt(variance[key] + (variance[reference] if key != reference else 0.0)) / abs(mean[reference])
            rows.append({"scene": several[0].name, "step": key[0], "accuracy": key[1], "runs": len(several), "quantity": quantity,
                         "value": float(mean[key]), "deviation": float(deviation), "standard_error": float(error),
                         "right": int(abs(deviation) <= max(right_within(quantity), UNCERTAIN * error)),
                         "missed": float(np.mean([one.missed for one in several])),
                         "iterations": float(np.mean([one.iterations for one in several])),
                         "seconds": float(np.mean([one.seconds for one in several]))})
    wrong = {(row["step"], row["accuracy"]) for row in rows if not row["right"]}
    cheapest = min(row["seconds"] for row in rows if (row["step"], row["accuracy"]) not in wrong)
    return [{**row, "cost": row["seconds"] / cheapest} for row in rows]


def print_table(rows):
    """Of all scenes, a line a setting."""
    print("\n| scene | step [ms] | accuracy | value | deviation [%] | solves that missed [%] | seconds | cost |")
    print("|---|---:|---:|---|---:|---:|---:|---:|")
    settings = {}
    for row in rows:
        settings.setdefault((row["scene"], row["step"], row["accuracy"]), []).append(row)
    for (name, step, accuracy), several in sorted(settings.items(), key=lambda one: (list(SCENES).index(one[0][0]), -one[0][1], -one[0][2])):
        values = ", ".join(f"{row['quantity']} {row['value']:.4g}" for row in several)
        deviations = ", ".join(f"{100.0 * row['deviation']:+.1f} ± {100.0 * UNCERTAIN * row['standard_error']:.1f}" for row in several)
        print(f"| {name} | {1e3 * step:g} | {accuracy:g} | {values} | {deviations} | {100.0 * several[0]['missed']:.2f} | "
              f"{several[0]['seconds']:.1f} | {several[0]['cost']:.2g} |")


def accepted(rows):
    """The closing table. Settings with an accuracy of 0.3 are shown alone: the page says how they deviate."""
    page = "doc/choosing.md, Measured"
    table = Bounds()
    for row in rows:
        if row["accuracy"] > 0.1:
            continue
        case = f"{row['scene']}, step {1e3 * row['step']:g} ms, accuracy {row['accuracy']:g}"
        right = right_within(row["quantity"])
        table.near(f"{case}: deviation of {row['quantity']} [%]", 100.0 * row["deviation"], 0.0,
                   100.0 * max(right, min(FAR * row["standard_error"], CEILING * right)),
                   f"{page}: 2 % (a change of volume: 10 %), or three standard errors; at most {CEILING:g} times as much")
    for name in dict.fromkeys(row["scene"] for row in rows):
        table.add(f"{name}: share of the solves that missed, the most of all settings [%]", 100.0 * max(row["missed"] for row in rows if
                  row["scene"] == name), None, 100.0 * MISSED, f"{page}: up to 0.25")
    return table.close()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/choice"), help="default: out/choice")
    parser.add_argument("--quick", action="store_true", help="settling and biaxial alone, without the smallest step")
    parser.add_argument("--only", nargs="+", choices=list(SCENES), metavar="SCENE", help="scenes to run")
    parser.add_argument("--realisations", type=whole(2), help="runs of each setting, 2 or more (8; 4 with --quick)")
    parser.add_argument("--jobs", type=whole(1), default=2, help="runs at the same time")
    parser.add_argument("--measure", action="store_true", help="measure what an earlier run left in DIR")
    options = sized(parser.parse_args(), {"only": list(SCENES), "realisations": 8}, {"only": ["settling", "biaxial"], "realisations": 4})
    claimed(options.out)
    if options.quick:
        for scene in SCENES.values():
            scene.steps = scene.steps[:2]
    with ProcessPoolExecutor(options.jobs) as pool:
        runs = list(pool.map(run_one, jobs_of(options)))
    rows = [row for name in options.only for row in compare([one for one in runs if one.name == name])]
    write_measured(options.out / "study_choice.csv", {key: [row[key] for row in rows] for key in rows[0]})
    print_table(rows)
    return accepted(rows)


if __name__ == "__main__":
    run_study(main)
