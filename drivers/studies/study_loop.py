#!/usr/bin/env python3
"""What a step costs in a loop of Python, over what it costs in the program.

    ./gravier study loop [--quick] [--pairs N] [--steps N] [--out DIR]

10 000 spheres on a lattice fall into a box, once in the program and once in a loop that asks `goes_on` and calls `step`, in turn, so that
both meet the same other work of the machine. Runs of N and of a fifth as many steps tell the processor time of a step from that of the
start, in which Python imports its modules. The results of both, on one and on two ranks, have to be the same bits; on two ranks the loop
needs mpi4py. Leaves DIR/loop.csv and the runs, in some ten minutes. --quick makes fewer pairs of shorter runs, in a minute. Exit status: 0 a step of the loop
costs at most 1.02 of one of the program, but for two standard errors of the median of the ratios, and these errors are at most 0.01, with
--quick 0.04; 1 otherwise. The full form therefore tells a step that is 4 % dearer, and the quick one a step that is 10 % dearer."""
import os
import resource
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
from oracle_table import Bounds
from study_support import BINARIES, ENVIRONMENT, SOURCE, OneLineParser, claimed, emptied, gravier, run_study, sized, whole, write_measured

CASE = {"scene": {"dimension": 3, "bodies": "lattice", "lattice_count": [22, 22, 21], "radius_min": 0.009, "radius_max": 0.011, "friction": 0.3},
        "time": {"step": 1e-3}, "output": {"directory": "results", "history_every": 1000}}
LOOP = """import sys
if sys.argv[1:] == ["2"]:
    from mpi4py import MPI
import gravier
with gravier.Simulation("case.nml", quiet=True) as s:
    while s.goes_on:
        s.step()
"""
FULL, QUICK = {"pairs": 12, "steps": 500}, {"pairs": 6, "steps": 150}
#: what a step of the loop may cost over one of the program, and the standard error of the ratio that still tells it
MOST, ERROR = 1.02, {False: 0.01, True: 0.04}


def seconds_of(place, steps, command):
    """Processor time of a run in a directory of its own [s]."""
    emptied(place)
    (place / "case.nml").write_text(gravier.namelist({**CASE, "time": {**CASE["time"], "steps": steps}, "output": {**CASE["output"], "every": steps}}),
                                    encoding="utf-8")
    # the package is that of this tree, and its library that of the programs
    more = {"PYTHONPATH": str(SOURCE / "drivers/python"), "GRAVIER_BIN_DIR": str(BINARIES.resolve())}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=place, env={**ENVIRONMENT, **os.environ, **more}, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"study_loop: {place}: status {done.returncode}: {(done.stderr or done.stdout).strip()[-300:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def commands(ranks):
    """The program and the loop on a number of ranks."""
    launch = [os.environ.get("MPIEXEC", "mpiexec"), "-n", str(ranks)] if ranks > 1 else []
    return {"program": [*launch, str((BINARIES / "gravier").resolve()), "case.nml"], "loop": [*launch, sys.executable, "-c", LOOP, str(ranks)]}


def numbers(path):
    """All datasets of a results file."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.__setitem__(name, item[()]) if isinstance(item, h5py.Dataset) else None)
    return found


def differing(out, steps):
    """Number of datasets of the four results that differ from those of the program on one rank, and of those compared."""
    wanted, differ, compared = None, 0, 0
    for ranks in (1, 2):
        for name, command in commands(ranks).items():
            place = out / f"{name}_{ranks}"
            seconds_of(place, steps, command)
            found = numbers(place / "results/results.h5")
            if wanted is None:
                wanted = found
                continue
            differ += len(set(found) ^ set(wanted)) + sum(not np.array_equal(found[key], wanted[key]) for key in set(found) & set(wanted))
            compared += len(wanted)
    return differ, compared


def measured(pairs, short, long):
    """From the seconds of each pair (pairs, program and loop) of short and long runs, a number of steps and seconds each: cost of a step in
    both [s], the median of its ratios, the standard error of that, and what the loop's start costs more [s]."""
    step = (long[1] - short[1]) / (long[0] - short[0])
    ratio = step[:, 1] / step[:, 0]
    start = long[1] - step * long[0]
    return {"pairs": pairs, "program": np.median(step[:, 0]), "loop": np.median(step[:, 1]), "ratio": np.median(ratio),
            "error": 1.2533 * np.std(ratio, ddof=1) / np.sqrt(pairs), "start": np.median(start[:, 1] - start[:, 0])}


def accepted(row, quick):
    """The closing table."""
    table = Bounds()
    table.add("standard error of the ratio of steps", row["error"], 0.0, ERROR[quick], "a larger one tells nothing: more --pairs, or less other work")
    table.add("cost of a step, loop over program, less two errors", row["ratio"] - 2.0 * row["error"], None, MOST, "2 % of the program")
    table.add(f"datasets that differ, of {row['compared']}", row["differ"], 0, 0, "the same bits on 1 and 2 ranks (doc/loop.md)")
    return table.close()


def main():
    parser = OneLineParser(prog="study_loop", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK['pairs']} pairs of {QUICK['steps']} steps")
    parser.add_argument("--pairs", type=whole(2), help=f"pairs of runs ({FULL['pairs']})")
    parser.add_argument("--steps", type=whole(10), help=f"steps of a run ({FULL['steps']})")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/loop"), help="directory of the table and the runs; default: out/loop")
    options = sized(parser.parse_args(), FULL, QUICK)
    options.out = options.out.resolve()
    out = claimed(options.out)
    lengths = (options.steps // 5, options.steps)
    seconds = np.empty((2, options.pairs, 2))
    for pair in range(options.pairs):
        # the one that comes first changes from pair to pair
        order = [(k, *command) for k, command in enumerate(commands(1).items())][::1 - 2 * (pair % 2)]
        for length, steps in enumerate(lengths):
            for k, name, command in order:
                seconds[length, pair, k] = seconds_of(out / name, steps, command)
    row = measured(options.pairs, (lengths[0], seconds[0]), (lengths[1], seconds[1]))
    row["differ"], row["compared"] = differing(out, lengths[0])
    write_measured(out / "loop.csv", {"steps": np.repeat(lengths, options.pairs), "program_seconds": seconds[:, :, 0].ravel(), "loop_seconds": seconds[:, :, 1].ravel()})
    print(f"a step of {np.prod(CASE['scene']['lattice_count'])} spheres: {1e3 * row['program']:.3f} ms in the program and {1e3 * row['loop']:.3f} ms in the loop, "
          f"ratio {row['ratio']:.4f} with a standard error of {row['error']:.4f}; the start of the loop takes {row['start']:.2f} s more; {out / 'loop.csv'}")
    return accepted(row, options.quick)


if __name__ == "__main__":
    run_study(main)
