#!/usr/bin/env python3
"""Examples of LMGC90 by LMGC90 itself and by Gravier, side by side: the same DATBOX, step, number of steps and law.

    ./gravier study side_by_side EXAMPLE... [--out DIR] --pylmgc90 PATH [--quick] [--steps N] [--settle M]

EXAMPLE is a directory with a command script and a DATBOX, or a script of the pre-processor that makes one; PATH is the directory that holds the package pylmgc90 as built with its module chipy.
LMGC90 runs the command script of the example as it is, in a copy, for N steps (100, quick 20). Gravier runs what gravier_import
makes of the DATBOX. With --settle LMGC90 makes M steps first, and its last state with its forces is the DATBOX of both: what is at
rest there has to stay at rest here. Gravier then runs once more without these forces. A body counts as moved that is farther than
2 % of its size from its start after 100 steps. Displacements are compared body by body in the last step, over the radius of the
ball that holds the body; kinetic energies are those of translation, in the last step; forces are means over the steps; seconds are
those of the processor, without the start. Leaves DIR/study_side_by_side.csv and .md and DIR/side_by_side.png. The closing table has
what both agree in beside what is accepted. Exit status: 0 all are held; 1 one is missed; 2 LMGC90 is not there."""
import os
import re
import resource
import runpy
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
from oracle_table import Bounds
from study_support import BINARIES, ENVIRONMENT, OneLineParser, claimed, emptied, plt, read_history, run_study, sized, states, whole, write_csv

import gravier
from study_lmgc90 import convert, generate


#: a body has moved that is farther from its start than this part of its size, after so many steps
MOVED, AFTER = 0.02, 100
FULL, QUICK = {"steps": 100}, {"steps": 20}


class Enough(Exception):
    """The steps that were asked for are made."""


def play_lmgc90(steps):
    """In a copy of an example: run its command script for so many steps and leave record.npz."""
    from pylmgc90 import chipy
    record = {"mass": [], "place": [], "velocity": [], "reaction": [], "seconds": []}
    clock = {"last": None}

    def of_all(name):
        kind = "RBDY2" if chipy.RBDY2_GetNbRBDY2() > 0 else "RBDY3"
        get, count = getattr(chipy, f"{kind}_GetBodyVector"), getattr(chipy, f"{kind}_GetNb{kind}")()
        return [get(name, k + 1) for k in range(count)]

    def note(inner):
        def step(*given):
            inner(*given)
            now = time.process_time()
            if not record["mass"]:
                two = chipy.RBDY2_GetNbRBDY2() > 0
                record["mass"] = list(chipy.RBDY2_GetAllMass() if two else chipy.RBDY3_GetAllMass())
            record["seconds"].append(np.nan if clock["last"] is None else now - clock["last"])
            for key, name in (("place", "Coor_"), ("velocity", "V____"), ("reaction", "Reac_")):
                record[key].append(of_all(name))
            if len(record["place"]) == steps:
                raise Enough
            clock["last"] = time.process_time()
        return step

    chipy.UpdateStep = note(chipy.UpdateStep)
    for name in ("WriteOut", "WriteDisplayFiles", "WritePostproFiles", "OpenDisplayFiles", "OpenPostproFiles", "CloseDisplayFiles",
                 "ClosePostproFiles"):
        setattr(chipy, name, lambda *given, **named: None)
    chipy.utilities_DisableLogMes = lambda: None
    script = next(iter(sorted(Path().glob("command*.py")) + sorted(Path().glob("run*.py"))))
    try:
        runpy.run_path(str(script), run_name="__main__")
    except Enough:
        pass
    dimension = 2 if len(record["place"][0][0]) == 3 else 3
    np.savez("record.npz", dimension=dimension, **{key: np.array(value) for key, value in record.items()})
    chipy.WriteLastDof()
    chipy.WriteLastVlocRloc()
    # its own end may leave with an error where files are closed that are not open
    sys.stdout.flush()
    os._exit(0)


def settled(example, place, options):
    """A copy of an example that begins where LMGC90 is after the steps of --settle."""
    by_lmgc90(example, place, options, options.settle)
    for name in ("DOF", "Vloc_Rloc"):
        shutil.copy(place / f"OUTBOX/{name}.LAST", place / f"DATBOX/{name}.INI")
    for name in ("record.npz", "said.txt"):
        (place / name).unlink()
    return place


def by_lmgc90(example, place, options, steps):
    shutil.copytree(example, emptied(place), dirs_exist_ok=True)
    for script in [*place.glob("command*.py"), *place.glob("run*.py")]:
        text = script.read_text(encoding="latin-1")
        script.write_text(re.sub(r"^(\s*nb_?steps?\s*=\s*)\d+", rf"\g<1>{steps}", text, flags=re.MULTILINE), encoding="latin-1")
    with open(place / "said.txt", "w", encoding="utf-8") as said:
        subprocess.run([sys.executable, str(Path(__file__).resolve()), "--play", str(steps)], cwd=place, stdout=said, stderr=said, check=False,
                       stdin=subprocess.DEVNULL,
                       env={**os.environ, "PYTHONPATH": str(options.pylmgc90.resolve()), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    text = (place / "said.txt").read_text(encoding="latin-1")
    if not (place / "record.npz").exists():
        said = text.strip().splitlines() or ["nothing said"]
        # the last line that tells of an error: LMGC90 ends with advice on packages
        wrong = [line for line in said if re.search(r"error|not present|not found", line, re.IGNORECASE)]
        sys.exit(f"study_side_by_side: LMGC90 did not run {example.name}: {(wrong or said)[-1].strip()}")
    record = dict(np.load(place / "record.npz"))
    record["iterations"] = [int(number) for number in re.findall(r"NLGS(?:3D)? ITERATION\s*:\s*(\d+)", text)]
    return record


def by_gravier(example, place, options):
    """Run with every step written, then once for the seconds; with forces to start from once more without them."""
    emptied(place)
    _, _, _, refused, _ = convert(example, place, options)
    if refused:
        sys.exit(f"study_side_by_side: {example.name} does not import: {refused}")
    text = (place / "case.nml").read_text(encoding="utf-8")
    runs = [("start", 0, 0), ("bare", 0, options.steps), ("full", 1, options.steps)]
    with h5py.File(place / "case.h5") as file:
        if "contacts" in file:
            runs.append(("cold", 1, options.steps))
            with h5py.File(place / "cold.h5", "w") as cold:
                file.copy("bodies", cold)
    spent = []
    for name, every, steps in runs:
        if name == "cold":
            text = text.replace("'case.h5'", "'cold.h5'")
        changed = re.sub(r"every = \d+", f"every = {every}", text).replace("'case_results'", f"'{name}'")
        (place / f"{name}.nml").write_text(re.sub(r"steps = \d+", f"steps = {steps}", changed), encoding="utf-8")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([str((BINARIES / "gravier").resolve()), f"{name}.nml"], cwd=place, check=False, stdin=subprocess.DEVNULL,
                       stdout=subprocess.DEVNULL, env={**ENVIRONMENT, **os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return (spent[1] - spent[0]) / options.steps


def count_moved(ways, size):
    """How many bodies have moved by ways (steps, bodies) that count from the first one."""
    return int((ways[min(AFTER, len(ways)) - 1] > MOVED * size).sum())


def ways_here(folder, free):
    """Ways of the free bodies after each step of a run (steps, bodies)."""
    places = np.array([group["bodies/position"][:] for number, _, group in states(folder / "results.h5")])
    return np.linalg.norm(places[1:] - places[0], axis=2)[:, free]


def compare(example, options):
    name = example.name
    ours, theirs = options.out / name / "gravier", options.out / name / "lmgc90"
    if not (example / "DATBOX/BODIES.DAT").exists():
        example, lacks = generate(example, options.out / "generated" / name, options.pylmgc90)
        if lacks:
            sys.exit(f"study_side_by_side: {name} does not run: {lacks}")
    if options.settle:
        example = settled(example, options.out / name / "settled", options)
    record = by_lmgc90(example, theirs, options, options.steps)
    seconds = by_gravier(example, ours, options)
    d = int(record["dimension"])
    steps = [(number, time_of, {key: group[f"bodies/{key}"][:] for key in ("id", "position", "velocity", "mass")}, group["boundaries/force"][:]
              if "boundaries" in group else np.zeros((1, d))) for number, time_of, group in states(ours / "full/results.h5")]
    identifier = steps[0][2]["id"]
    free = (identifier <= len(record["mass"])) & (steps[0][2]["mass"] > 0)
    moved = np.array([body["position"] - steps[0][2]["position"] for _, _, body, _ in steps])
    # the bodies of LMGC90 in the order of those here; what is glued to boundaries here is none of the free ones
    walls = {int(word) for word in re.findall(r"name = 'body (\d+)", (ours / "case.nml").read_text(encoding="utf-8"))}
    free &= ~np.isin(identifier, sorted(walls))
    place = record["place"][:, identifier[free] - 1, :d]
    # its states are those of the ends of steps 1, 2, ...
    first = next(k for k, step in enumerate(steps) if step[0] == 1)
    count = min(len(place), len(steps) - first)
    drift = np.linalg.norm((place[:count] - place[0]) - (moved[first:first + count] - moved[first])[:, free], axis=2)
    mass = steps[0][2]["mass"][free]
    size = np.asarray(gravier.Run(ours / "full").bodies(0).radius)[free]
    ours_energy = [0.5 * (mass * (body["velocity"][free, :d]**2).sum(1)).sum() for _, _, body, _ in steps[first:first + count]]
    theirs_mass = record["mass"][identifier[free] - 1]
    theirs_energy = 0.5 * (theirs_mass * (record["velocity"][:count, identifier[free] - 1, :d]**2).sum(2)).sum(1)
    up = d - 1
    weight = mass.sum() * 9.81
    ground = sorted(walls)
    theirs_force = record["reaction"][:count, np.array(ground) - 1, up].sum(1).mean()
    ours_force = np.mean([step[3][:, up].sum() for step in steps[first:first + count]])
    history = read_history(ours / "full")
    row = {"example": name, "bodies": int(free.sum()), "steps": count, "largest_difference_over_size": float((drift[-1] / size).max()),
           "median_difference_over_size": float(np.median(drift[-1] / size)),
           "largest_way_over_size_lmgc90": float((np.linalg.norm(place[count - 1] - place[0], axis=1) / size).max()),
           "largest_way_over_size_gravier": float((np.linalg.norm(moved[first + count - 1] - moved[first], axis=1)[free] / size).max()),
           "moved_lmgc90": count_moved(np.linalg.norm(place - place[0], axis=2), size),
           "moved_gravier": count_moved(ways_here(ours / "full", free), size),
           "moved_gravier_without_forces": count_moved(ways_here(ours / "cold", free), size) if (ours / "cold").is_dir() else float("nan"),
           "forces_found": forces_found(ours),
           "mass_ratio": float((theirs_mass / mass).mean()),
           "energy_lmgc90": float(theirs_energy[-1]), "energy_gravier": float(ours_energy[-1]),
           "mean_force_on_ground_over_weight_lmgc90": float(theirs_force / weight), "mean_force_on_ground_over_weight_gravier": float(ours_force / weight),
           "iterations_lmgc90": float(np.mean(record["iterations"])) if record["iterations"] else float("nan"),
           "iterations_gravier": float(np.mean(history["iterations"])),
           "seconds_lmgc90": float(np.nanmean(record["seconds"])), "seconds_gravier": float(seconds)}
    return row, (d, theirs_energy, np.array(ours_energy), record, identifier, free, ours / "full", count, first, size)


def forces_found(folder):
    """Which part of the contacts with forces the first step has found; NaN where none are given."""
    found = re.search(r"^start  .*: (\d+) of its (\d+) contacts", (folder / "full/run.log").read_text(encoding="utf-8"), re.MULTILINE)
    return int(found[1]) / int(found[2]) if found else float("nan")


def draw(rows, kept, path):
    """Places of the last step by both, and the kinetic energies."""
    figure, axes = plt.subplots(len(rows), 3, figsize=(12, 3.2 * len(rows)), squeeze=False)
    for (row, (d, theirs, ours, record, identifier, free, folder, count, first, size)), line in zip(zip(rows, kept), axes):
        run = gravier.Run(folder)
        start, last = run.bodies(0), run.bodies(count)
        outlines = run.outlines(count)
        plane = [0, d - 1]
        there = record["place"][count - 1, identifier[free] - 1][:, :d] - record["place"][0, identifier[free] - 1][:, :d] \
            + np.asarray(run.bodies(1).position)[free]
        for axis, title, places in ((line[0], "LMGC90", there), (line[1], "Gravier", np.asarray(last.position)[free])):
            way = np.linalg.norm(places - np.asarray(start.position)[free], axis=1) / size
            shown = axis.scatter(*places[:, plane].T, c=way, s=2)
            for k, polygons in zip(np.flatnonzero(free), (outlines[k] for k in np.flatnonzero(free))):
                shift = places[np.searchsorted(np.flatnonzero(free), k)] - np.asarray(last.position)[k]
                for polygon in polygons:
                    closed = (np.vstack([polygon, polygon[:1]]) + shift)[:, plane]
                    axis.plot(*closed.T, lw=0.3, color="0.4")
            axis.set_aspect("equal")
            axis.set_title(f"{row['example']}, step {count}: {title}", fontsize=8)
            figure.colorbar(shown, ax=axis, shrink=0.7).set_label("way / size", fontsize=7)
            axis.tick_params(labelsize=6)
        for values, title, style in ((theirs, "LMGC90", "-"), (ours, "Gravier", "--")):
            line[2].semilogy(np.arange(1, len(values) + 1), np.maximum(values, 1e-30), style, label=title)
        line[2].set_xlabel("step", fontsize=7)
        line[2].set_ylabel("kinetic energy of translation [J]", fontsize=7)
        line[2].tick_params(labelsize=6)
        line[2].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=130)


def accepted(rows, settled_before):
    """The closing table."""
    page = "doc/lmgc90.md, Side by side"
    table = Bounds()
    for row in rows:
        name = row["example"]
        table.add(f"{name}: mass in LMGC90 over mass here", row["mass_ratio"], 0.99, 1.09,
                  f"the same densities; {page}: 1.08 of clusters")
        # over the weight that each program gives the bodies; before anything has reached the ground both forces are 0
        table.near(f"{name}: mean force on the ground over the weight, here less LMGC90", row["mean_force_on_ground_over_weight_gravier"] -
                   row["mean_force_on_ground_over_weight_lmgc90"] / row["mass_ratio"], 0.0, 0.05, f"{page}: up to 0.03; a twentieth of the weight")
        if np.isfinite(row["forces_found"]):
            table.add(f"{name}: contacts with forces that the first step finds", row["forces_found"], 0.99, 1.0,
                      f"{page}: 1108 of 1116, or all")
        if settled_before:
            table.add(f"{name}: bodies that move here", row["moved_gravier"], 0, row["moved_lmgc90"],
                      "what is at rest there is at rest here")
        elif row["steps"] <= QUICK["steps"]:
            table.add(f"{name}: largest difference of places over the size", row["largest_difference_over_size"], 0.0, 2e-3,
                      f"{page}: 1.2e-3 after 20 steps")
        else:
            table.add(f"{name}: median difference of places over the size", row["median_difference_over_size"], 0.0, 5e-3,
                      f"{page}: up to 3e-3 after 200 steps")
            table.add(f"{name}: kinetic energy, here over LMGC90", row["energy_gravier"] / row["energy_lmgc90"], 0.75, 1.25,
                      f"{page}: 0.96 to 1.20")
    return table.close()


def main():
    if sys.argv[1:2] == ["--play"]:
        play_lmgc90(int(sys.argv[2]))
    parser = OneLineParser(prog="study_side_by_side", description=__doc__.splitlines()[0])
    parser.add_argument("examples", type=Path, nargs="+", help="directories with a DATBOX and a command script")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/side_by_side"), help="directory of the tables, the picture and the runs; default: out/side_by_side")
    parser.add_argument("--pylmgc90", type=Path, required=True, help="directory that holds the Python package pylmgc90")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK['steps']} steps")
    parser.add_argument("--steps", type=whole(1), help=f"steps ({FULL['steps']}, quick {QUICK['steps']})")
    parser.add_argument("--settle", type=whole(0), default=0, help="steps that LMGC90 makes before (0)")
    options = sized(parser.parse_args(), FULL, QUICK)
    options.out = options.out.resolve()
    there = subprocess.run([sys.executable, "-c", "from pylmgc90 import chipy; chipy.Initialize"], capture_output=True, text=True, check=False,
                           env={**os.environ, "PYTHONPATH": str(options.pylmgc90.resolve())})
    if there.returncode:
        print(f"study_side_by_side: LMGC90 is not in {options.pylmgc90}: {(there.stderr.strip().splitlines() or ['?'])[-1]}: expected a directory with "
              "pylmgc90 and its module chipy", file=sys.stderr)
        return 2
    claimed(options.out)
    results = [compare(example.resolve(), options) for example in options.examples]
    rows, kept = [row for row, _ in results], [kept for _, kept in results]
    write_csv(options.out / "study_side_by_side.csv", {name: [row[name] for row in rows] for name in rows[0]})
    names = list(rows[0])
    lines = ["| | " + " | ".join(row["example"] for row in rows) + " |", "|---|" + "---|" * len(rows)]
    lines += [f"| {name.replace('_', ' ')} | " + " | ".join(f"{row[name]:.3g}" for row in rows) + " |" for name in names[1:]]
    (options.out / "study_side_by_side.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))
    draw(rows, kept, options.out / "side_by_side.png")
    return accepted(rows, options.settle > 0)


if __name__ == "__main__":
    run_study(main)
