"""Runs of Gravier and of LAMMPS for study_dem.py: seconds, and what each code leaves."""
import os
import re
import resource
import subprocess
import sys
import time

import numpy as np
from scipy.spatial import cKDTree
from study_support import BINARIES, ENVIRONMENT

from gravier.case import namelist

# each rank of either code on one core
ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
# a rank by itself, without the daemon that Open MPI starts otherwise
ALONE = {"OMPI_MCA_ess_singleton_isolated": "1"}


def timed(command, place, good=(0,), ranks=1):
    """Run a command on so many ranks in `place`, which keeps what it says in said.txt; its user seconds on the processor, or seconds on the
    clock if there are several ranks, which wait for each other."""
    launcher = [os.environ.get("MPIEXEC", "mpiexec"), "-n", str(ranks)] if ranks > 1 else []
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.monotonic()
    with open(place / "said.txt", "w", encoding="utf-8") as said:
        status = subprocess.run([str(word) for word in [*launcher, *command]], cwd=place, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
                                check=False, env={**ENVIRONMENT, **os.environ, **ONE_CORE, **({} if launcher else ALONE)}).returncode
    if status not in good:
        lines = (place / "said.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines() or ["nothing said"]
        # the launcher of several ranks has the last words
        reason = next((line for line in lines if "error: " in line.lower()), lines[-1])
        sys.exit(f"study_dem: {place}: {command[0]} ended with status {status}: {reason}")
    if launcher:
        return time.monotonic() - start
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


# ---- Gravier

def run_gravier(place, groups, boundaries=(), program="gravier", ranks=1):
    """Seconds of a run of `groups` and `boundaries` in `place`; solves that miss their accuracy are told by Log. Several ranks have a subdomain
    each beside each other, whose grains fall within it, by NSCDD, which has the momentum of the method of one."""
    if ranks > 1:
        groups = {**groups, "solver": {"method": "nscdd", **groups["solver"]}, "decomposition": {"grid": [ranks, 1, 1]}}
    place.mkdir(parents=True, exist_ok=True)
    (place / "case.nml").write_text(namelist({**groups, "boundary": list(boundaries)}), encoding="utf-8")
    return timed([(BINARIES / program).resolve(), "case.nml"], place, (0, 3), ranks)


class Log:
    """The closing lines of run.log: seconds of each phase, and counts."""

    def __init__(self, place):
        text = (place / "run.log").read_text(encoding="utf-8")
        rows = re.findall(r"^(\S.*?) +[\d.]+ +[\d.]+ +([\d.]+) +[\d.]+ %$", text, re.MULTILINE)
        self.phases = {name: float(seconds) for name, seconds in rows}
        self.whole = float(re.search(r"^whole run +([\d.]+)", text, re.MULTILINE)[1])
        self.solves, self.iterations = map(int, re.search(r"^solver +(\d+) solves, (\d+) iterations", text, re.MULTILINE).groups())
        built = re.search(r"of neighbours built (\w+)", text)
        self.lists = {"never": 0, "once": 1, "twice": 2}[built[1]] if built[1].isalpha() else int(built[1])
        projected = re.search(r"projected in (\d+) of", text)
        self.projected = int(projected[1]) if projected else 0
        missed = re.search(r"NO: (\d+) of \d+ solves", text)
        self.missed = int(missed[1]) if missed else 0

    def share(self, *names):
        """The part of the run that phases take."""
        return sum(self.phases.get(name, 0.0) for name in names) / self.whole


# ---- LAMMPS

def run_lammps(program, place, script, ranks=1):
    """Seconds of a run of LAMMPS."""
    place.mkdir(parents=True, exist_ok=True)
    (place / "in.lammps").write_text(script, encoding="ascii")
    return timed([program, "-in", "in.lammps", "-log", "log.lammps", "-screen", "none"], place, ranks=ranks)


def lammps_version(program):
    said = subprocess.run([program, "-h"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                          env={**ENVIRONMENT, **os.environ}).stdout
    name = re.search(r"^Large-scale Atomic/Molecular Massively Parallel Simulator - (.+)$", said, re.MULTILINE)
    return f"LAMMPS {name[1]}" if name else None


def read_thermo(place):
    """{column: values} of the table that LAMMPS prints."""
    text = (place / "log.lammps").read_text(encoding="utf-8")
    head, *rows = re.search(r"^(Step .*?)^Loop time", text, re.MULTILINE | re.DOTALL)[1].strip().splitlines()
    numbers = [row.split() for row in rows]
    numbers = np.array([row for row in numbers if len(row) == len(head.split()) and row[0].isdigit()], float)
    return dict(zip(head.split(), numbers.T))


def read_dump(path):
    """(step, {column: values}) of each state of a text dump of LAMMPS."""
    with open(path, encoding="ascii") as file:
        while file.readline():
            step = int(file.readline())
            file.readline()
            count = int(file.readline())
            for _ in range(4):
                file.readline()
            names = file.readline().split()[2:]
            yield step, dict(zip(names, np.array([file.readline().split() for _ in range(count)], float).T))


# ---- what is measured of grains

def solid_fraction(height, radii, lower, upper, area):
    """Part of the volume between two heights that spheres fill, whose parts above and below are cut off."""
    def below(level):
        h = np.clip(level - height + radii, 0.0, 2.0 * radii)
        return (np.pi * h**2 * (3.0 * radii - h) / 3.0).sum()
    return (below(upper) - below(lower)) / (area * (upper - lower))


def touching(centres, radii, period=None):
    """Pairs (n, 2) of spheres that overlap; periods along the axes, 0 where there is none."""
    centres = np.array(centres)
    if period is not None:
        wraps = np.asarray(period) > 0.0
        centres[:, wraps] %= np.asarray(period)[wraps]
    pairs = cKDTree(centres, boxsize=period).query_pairs(2.0 * radii.max(), output_type="ndarray")
    gap = centres[pairs[:, 0]] - centres[pairs[:, 1]]
    if period is not None:
        gap -= np.where(wraps, np.round(gap / np.where(wraps, period, 1.0)) * period, 0.0)
    return pairs[(gap**2).sum(1) < (radii[pairs[:, 0]] + radii[pairs[:, 1]])**2]


def contacts_a_grain(pairs, free):
    """Mean number of grains that a free grain touches; `free` is a mask of grains, `pairs` holds their rows."""
    return free[pairs].sum() / free.sum()


BATCHES = 5


def mean_and_error(values):
    """The mean of a series, and its standard error by the means of BATCHES parts one after the other; 0 where it is too short for that."""
    values = np.asarray(values)
    if len(values) < BATCHES:
        return float(values.mean()), 0.0
    parts = np.array([part.mean() for part in np.array_split(values, BATCHES)])
    return float(values.mean()), float(parts.std(ddof=1) / np.sqrt(BATCHES))


def rate_and_error(time, count):
    """The slope of a count against time, and its standard error by the slopes of BATCHES parts."""
    slopes = np.array([np.polyfit(t, n, 1)[0] for t, n in zip(np.array_split(time, BATCHES), np.array_split(count, BATCHES))])
    return float(np.polyfit(time, count, 1)[0]), float(slopes.std(ddof=1) / np.sqrt(BATCHES))
