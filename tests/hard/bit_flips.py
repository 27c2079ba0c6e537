#!/usr/bin/env python3
"""Bits of files that become others: each kind of file that is read is damaged at random places and read again.

    /usr/bin/python3 tests/hard/bit_flips.py --trials 500 [--seed 1] [--kinds checkpoint bodies ...]

A file is refused by one line that names it and status 2, or it is read as if nothing had happened: never a crash, a backtrace, a hang, or
another result with status 0. What is wrong is printed trial by trial; the last line has the figure. Exit status 1 where anything was
wrong. The suite runs a few trials of each (test_run_bit_flips.py)."""
import argparse
import os
import random
import re
import shutil
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from fault_trials import BOX, CRASH, Figure, kept  # noqa: E402
from gravier_runs import PROGRAMS, SOURCE, alone, contents, differences, merged, namelist, write  # noqa: E402

CASE = merged(BOX, {"time": {"steps": 4}, "output": {"every": 2, "trace": False, "checkpoint_every": 4, "final_bodies": True, "fclib_step": 4,
                                                     "energy": True}})
#: reads all that the Python module reads of results, says it on one line
READER = """
import sys
import numpy as np
import gravier
try:
    run = gravier.Run(sys.argv[1])
    said = [run.version, run.command, run.input_text, run.dimension, run.steps.tolist(), run.times.tolist()]
    for step in run.steps:
        said += [run.velocity_error(step), run.velocity_scale(step), sorted(run.diagnostics(step).items())]
        for table in (run.bodies(step), run.boundaries(step), run.contacts(step) or {}):
            said += [(name, np.asarray(values).tolist()) for name, values in table.items()]
    print(said)
except gravier.ResultsError as reason:
    sys.stderr.write(f"{reason}\\n")
    sys.exit(2)
"""


class Kind:
    """A kind of file: its name in the directory where the trial is, what reads it, and what it led to."""

    def __init__(self, name, read, result):
        self.name, self.read, self.result = name, read, result


def prepare(directory):
    """One run, whose files are read in all the trials; kinds by name."""
    write(os.path.join(directory, "case.nml"), namelist(CASE))
    run = alone([os.path.join(PROGRAMS, "gravier"), "case.nml"], directory)
    if run.status != 0:
        raise AssertionError(run.stderr)
    results = os.path.join(directory, "results")
    shutil.copy(os.path.join(results, "final_bodies.h5"), os.path.join(directory, "bodies.h5"))
    shutil.copy(os.path.join(results, "step_4.hdf5"), os.path.join(directory, "problem.hdf5"))
    write_table(os.path.join(results, "final_bodies.h5"), os.path.join(directory, "bodies.csv"))
    write(os.path.join(directory, "on.nml"), namelist(merged(CASE, {"time": {"steps": 6}, "output": {"final_bodies": False, "fclib_step": 0}})))
    for file in ("bodies.h5", "bodies.csv"):
        scene = {key: value for key, value in CASE["scene"].items() if not key.startswith(("lattice", "radius"))}
        write(os.path.join(directory, file + ".nml"), namelist({**CASE, "scene": {**scene, "bodies": "file", "bodies_file": file},
                                                                "output": {"directory": "results", "every": 2}}))
    write(os.path.join(directory, "reader.py"), READER)
    os.environ["PYTHONPATH"] = os.path.join(SOURCE, "drivers/python")

    def program(name, *arguments):
        return [os.path.join(PROGRAMS, name), *arguments]

    def history(place, _):
        return kept(os.path.join(place, "results"))

    def solved(place, _):
        return contents(os.path.join(place, "out", "problem.hdf5"))

    return {
        "checkpoint": Kind("results/checkpoint.h5", program("gravier", "--restart", "on.nml"), history),
        "bodies": Kind("bodies.h5", program("gravier", "bodies.h5.nml"), history),
        "table": Kind("bodies.csv", program("gravier", "bodies.csv.nml"), history),
        "results": Kind("results/results.h5", [sys.executable, "reader.py", "results"], lambda _, run: {"said": np.array(run.stdout)}),
        "fclib": Kind("problem.hdf5", program("gravier_fclib", "--write", "out", "problem.hdf5"), solved),
    }


def write_table(bodies, path):
    """A bodies file as a table, with its checksum."""
    import gravier
    rows = gravier.BodiesFile(bodies)
    grains, walls = rows.bodies(), rows.boundaries()
    lines = ["id,shape,x,y,radius,vx,vy,omega,nx,ny"]
    for k, number in enumerate(grains.id):
        cells = [*grains.position[k], grains.radius[k], *grains.velocity[k], *grains.spin[k]]
        lines.append(f"{number},grain," + ",".join(f"{float(cell)!r}" for cell in cells) + ",,")
    for k, number in enumerate(walls.id):
        (x, y), (nx, ny) = walls.position[k], walls.normal[k]
        lines.append(f"{number},plane,{float(x)!r},{float(y)!r},,,,,{float(nx)!r},{float(ny)!r}")
    write(path, "\n".join(lines) + "\n")
    gravier.seal(path)


def problems_of(kind, run, place, wanted):
    """What is wrong with the end of a program that read a damaged file."""
    said = run.stdout + run.stderr if kind.name != "results/results.h5" else run.stderr
    if CRASH.search(said) or run.status not in (0, 2):
        return [f"status {run.status}: {said[-300:]!r}"]
    if run.status == 2:
        lines = run.stderr.splitlines()
        if len(lines) != 1 or os.path.basename(kind.name) not in lines[0]:
            return [f"not one line that names the file: {run.stderr[:300]!r}"]
        return []
    return [f"another result: {name}" for name in differences(wanted, kind.result(place, run))[:1]]


def flip(kind, source, directory, figure, draw, trials, refusals):
    """`trials` damaged files of one kind."""
    place = os.path.join(directory, "trial")
    shutil.copytree(source, place)
    wanted = kind.result(place, alone(kind.read, place))
    shutil.rmtree(place)
    for trial in range(trials):
        shutil.copytree(source, place)
        path = os.path.join(place, kind.name)
        with open(path, "rb") as file:
            data = bytearray(file.read())
        at, bit = draw.randrange(len(data)), draw.randrange(8)
        data[at] ^= 1 << bit
        with open(path, "wb") as file:
            file.write(data)
        run = alone(kind.read, place)
        figure.note({0: "read as before", 2: "refused"}.get(run.status, "wrong"), f"{kind.name}: byte {at}, bit {bit}",
                    problems_of(kind, run, place, wanted))
        if run.status == 2:
            reason = re.sub(r"\d+", "N", run.stderr.strip())
            refusals[reason] = refusals.get(reason, 0) + 1
        shutil.rmtree(place)


def bit_flips(random_seed, trials, directory, kinds=None, show=False):
    """`trials` random bits of each kind of file; a figure a kind."""
    source = os.path.join(directory, "source")
    os.makedirs(source)
    known = prepare(source)
    figures = []
    for name in kinds or known:
        figure, refusals = Figure(f"bit flips, {name}"), {}
        flip(known[name], source, directory, figure, random.Random(f"{random_seed} {name}"), trials, refusals)
        figures.append(figure)
        if show:
            for reason, count in sorted(refusals.items(), key=lambda item: -item[1]):
                print(f"    {count:4d} {reason[:180]}")
            print(figure, flush=True)
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", choices=("checkpoint", "bodies", "table", "results", "fclib"))
    options = parser.parse_args()
    directory = tempfile.mkdtemp(prefix="gravier-flips-")
    try:
        figures = bit_flips(options.seed, options.trials, directory, options.kinds, show=True)
    finally:
        shutil.rmtree(directory, ignore_errors=True)
    print(f"bit flips: {sum(figure.trials for figure in figures)} trials, {sum(len(figure.wrong) for figure in figures)} wrong")
    sys.exit(1 if any(figure.wrong for figure in figures) else 0)


if __name__ == "__main__":
    main()
