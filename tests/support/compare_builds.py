#!/usr/bin/python3
"""Compare two builds of Gravier bit for bit.

    python3 tests/support/compare_builds.py OLD_BIN NEW_BIN [--cases PATTERN] [--steps N] [--ranks 1 2] [--skip-large] [--keep DIR]
                                            [--added REGEX]

OLD_BIN and NEW_BIN are directories that hold gravier, gravier_fclib and gravier_sample. Both builds run every case on every number
of ranks (effects with one subdomain on one): the cases under data/, shortened to a few steps, and small scenes that cover methods
and effects. What they wrote is compared without tolerance: all datasets and attributes of results.h5, all columns of history.csv and
trace.csv, all tables of the checkpoint, bodies files, contact problems, and what gravier_fclib says of these. Only what names the
program or measures time is left out (LEFT_OUT). With --added, names are accepted that the new build alone has and that match the
whole expression; a name that the new build lacks, or has with other values, is never accepted. Each case prints one line, and the
last line counts them. The exit status is 0 only where all are the same; a case that does not run in both builds is not the same.
"""
import argparse
import concurrent.futures
import dataclasses
import fnmatch
import functools
import os
import re
import shutil
import sys
import tempfile
import threading
import time
from typing import Callable

from busy_scene import DRUM, write_drum
from gravier_runs import SOURCE, contents, differences, gravier, merged, namelist, read_cells, write
from gravier import parse_namelist

#: names of attributes and columns that say which program ran, where and how long
LEFT_OUT = re.compile(r"@(version|revision|command|host|date)$|seconds")
#: exit statuses of a run that went to its end: 3 where a solve missed its tolerance
ENDED = (0, 3)
#: steps of the small scenes: lattices fall for about 20 of them before they meet the ground
SMALL_STEPS = 45


@dataclasses.dataclass
class Case:
    """What both builds do in a directory of their own: `act(programs, directory, ranks)` returns {name: array} of all it wrote."""
    name: str
    act: Callable
    #: what the line says beside the name: how the case was reduced
    note: str = ""
    #: it has one subdomain, and no other rank would have anything to do: it runs on one rank
    alone: bool = False


class Failure(Exception):
    """A program did not end as it should: one line."""


def run(programs, program, *arguments, ranks, directory, ended=ENDED):
    """Run a program of a build, or fail with its last words."""
    try:
        done = gravier(*arguments, ranks=ranks, directory=directory, program=os.path.join(programs, program))
    except AssertionError as reason:
        raise Failure(str(reason)) from None
    if done.status not in ended:
        said = (done.stderr.strip() or done.launcher.strip() or done.stdout.strip()).splitlines()
        raise Failure(f"{program} ended with status {done.status}: {said[-1] if said else 'without a word'}")
    return done


def written(directory):
    """{file name: array} of all tables and HDF5 files below a directory, without what LEFT_OUT names. Other files are not compared."""
    found = {}
    for place, _, names in os.walk(directory):
        for file in names:
            path = os.path.join(place, file)
            if file.endswith((".h5", ".hdf5")):
                values = contents(path)
            elif file.endswith(".csv"):
                values = read_cells(path)
            else:
                continue
            where = os.path.relpath(path, directory)
            found.update({f"{where} {name}": value for name, value in values.items() if not LEFT_OUT.search(name)})
    return found


def run_groups(groups, programs, directory, ranks, stop=0):
    """Run an input; with `stop` as far as that step, and on from the checkpoint. Everything that is in its results."""
    if stop:
        write(os.path.join(directory, "case.nml"), namelist(merged(groups, {"time": {"steps": stop}})))
        run(programs, "gravier", "case.nml", ranks=ranks, directory=directory)
    write(os.path.join(directory, "case.nml"), namelist(groups))
    done = run(programs, "gravier", *(["--restart"] if stop else []), "case.nml", ranks=ranks, directory=directory)
    found = written(os.path.join(directory, "results"))
    if not any(name.startswith("results.h5 /steps/") for name in found):
        raise Failure("the run wrote no state")
    found["exit status"] = done.status
    return found


# ---- the cases under data/

def as_groups(path):
    """Groups of an input file as `merged` takes them: lists of what may stand several times."""
    with open(path, encoding="utf-8") as file:
        groups = parse_namelist(file.read())
    return {group: keys if group in ("boundary", "material", "law") else keys[0] for group, keys in groups.items()}


#: a packing that takes the place of a file that another run has to write, by dimension
LATTICE = {2: [16, 12], 3: [6, 6, 6]}


def make_packings(programs, directory):
    """Small packings, made once by the old build: {dimension: path}."""
    paths = {}
    for dimension, count in LATTICE.items():
        place = os.path.join(directory, f"packing_{dimension}d")
        os.makedirs(place)
        run_groups({
            "scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": count, "radius_min": 0.008, "radius_max": 0.012,
                      "friction": 0.3, "alert_distance": 0.003},
            "time": {"step": 1e-3, "steps": 200},
            "solver": {"criterion": "residual", "tolerance": 1e-3},
            "output": {"every": 0, "final_bodies": True},
        }, programs, place, 1)
        paths[dimension] = os.path.join(place, "results", "final_bodies.h5")
    return paths


def run_data(groups, packings, programs, directory, ranks):
    """A case of data/: its files are found below `data`, and a small packing stands for those of other runs."""
    os.symlink(os.path.join(SOURCE, "data"), os.path.join(directory, "data"))
    if groups["scene"].get("bodies_file", "").startswith("out/"):
        groups = merged(groups, {"scene": {"bodies_file": packings()[groups["scene"].get("dimension", 2)]}})
    return run_groups(groups, programs, directory, ranks)


def run_sample(groups, programs, directory, ranks):
    """A sample of gravier_sample."""
    write(os.path.join(directory, "sample.nml"), namelist(groups))
    run(programs, "gravier_sample", "sample.nml", ranks=ranks, directory=directory)
    found = written(directory)
    if "sample.h5 /bodies/position" not in found:
        raise Failure("gravier_sample wrote no bodies")
    return found


def data_cases(steps, packings, skip_large):
    """The cases under data/, and lines about those that are left out."""
    cases, left_out = [], []
    for folder in sorted(os.listdir(os.path.join(SOURCE, "data"))):
        for file in sorted(os.listdir(os.path.join(SOURCE, "data", folder))):
            if not file.endswith(".nml"):
                continue
            name = f"data/{folder}/{file}"
            groups = as_groups(os.path.join(SOURCE, name))
            if "study" in groups:
                left_out.append((name, "it is a study, which measures seconds; its case is compared"))
                continue
            if folder == "large" and skip_large:
                left_out.append((name, "--skip-large"))
                continue
            if folder == "samples":
                reduced = {"count": 150, "file": "sample.h5"}
                box = groups["sample"].get("box")
                note = "150 grains"
                if groups["sample"].get("preparation"):
                    # as high as wide, loose and soon at rest
                    reduced.update(box=0.3, rest_tolerance=1e-2)
                    note += " that rest at 1e-2"
                elif box is not None:
                    reduced["box"] = [side * (150 / groups["sample"]["count"]) ** (1 / 3) for side in box]
                cases.append(Case(name, functools.partial(run_sample, merged(groups, {"sample": reduced})), note))
                continue
            few = min(steps, groups["time"]["steps"])
            notes = [f"{few} of {groups['time']['steps']} steps"]
            changes = {"time": {"steps": few},
                       "output": {"directory": "results", "every": max(1, few // 2), "checkpoint_every": few, "contacts": True,
                                  "trace": True, "energy": True, "stress": True, "structure": True, "boundary_forces": True}}
            if groups["scene"]["bodies"] == "lattice":
                dimension = groups["scene"]["dimension"]
                changes["scene"] = {"lattice_count": LATTICE[dimension]}
                # as far as the ground, and further
                changes["time"]["steps"] = changes["output"]["checkpoint_every"] = SMALL_STEPS
                notes = [f"{SMALL_STEPS} of {groups['time']['steps']} steps", "a small lattice"]
            if groups["scene"].get("bodies_file", "").startswith("out/"):
                notes.append(f"a small packing in the place of {groups['scene']['bodies_file']}")
            if groups.get("decomposition", {}).get("subdomains", 0) > 8:
                changes["decomposition"] = {"subdomains": 8}
                notes.append("8 subdomains")
            cases.append(Case(name, functools.partial(run_data, merged(groups, changes), packings), ", ".join(notes)))
    return cases, left_out


# ---- small scenes

METHODS = {
    "nlgs": {"solver": {"method": "nlgs", "acceleration": "none"}, "decomposition": {"subdomains": 1}},
    "nlgs, momentum": {"solver": {"method": "nlgs", "acceleration": "momentum"}, "decomposition": {"subdomains": 1}},
    "nscdd": {"solver": {"method": "nscdd", "acceleration": "none", "sweeps": 2}},
    "nscdd, momentum, metis": {"solver": {"method": "nscdd", "acceleration": "momentum"},
                               "decomposition": {"partition": "metis", "repartition_every": 13}},
    "nscdd, primal": {"solver": {"method": "nscdd"}, "decomposition": {"kind": "primal"}},
    "nscdd_ep": {"solver": {"method": "nscdd_ep"}},
    "nscdd_ep, all, cg": {"solver": {"method": "nscdd_ep"}, "enriched": {"direction": 0.3, "interface": "cg"}},
    "nscdd_ep, active": {"solver": {"method": "nscdd_ep", "acceleration": "none"},
                         "enriched": {"direction": 10.0, "contacts": "active"}},
    "schwarz": {"solver": {"method": "schwarz"}},
    "schwarz, momentum, metis": {"solver": {"method": "schwarz", "acceleration": "momentum"}, "decomposition": {"partition": "metis"}},
    "schwarz, relaxed": {"solver": {"method": "schwarz", "relaxation": 0.7, "warm_start": False}},
    "schwarz_ec": {"solver": {"method": "schwarz_ec"}, "enriched": {"direction": 0.3}},
    "newton": {"solver": {"method": "newton"}},
}


def floor(dimension, **more):
    """The plane at height 0."""
    return {"shape": "plane", "point": [0.0] * dimension, "normal": upward(dimension), **more}


def upward(dimension, factor=1.0):
    return [0.0] * (dimension - 1) + [factor]


def one_law(dimension, kind, **values):
    """Grains and walls of one material."""
    if dimension == 2:
        values.pop("pivoting_friction", None)
    return {"scene": {"wall_material": "stuff", "friction": None}, "material": [{"name": "stuff"}],
            "law": [{"materials": "stuff", "kind": kind, **values}]}


def rolling(dimension):
    return {"scene": {"rolling_friction": 0.1, **({"pivoting_friction": 0.05} if dimension == 3 else {})}}


def lid(dimension, height):
    """A plane above the grains that its weight and a force move."""
    return [{"shape": "plane", "name": "lid", "point": upward(dimension, height), "normal": upward(dimension, -1.0),
             "free": [False] * (dimension - 1) + [True], "mass": 0.8, "force": upward(dimension, -30.0)}]


def belt(dimension):
    return [floor(dimension, name="belt", velocity=[0.4] + [0.0] * (dimension - 1), friction=0.6)]


def turning(dimension):
    """A plane that turns about an axis below the grains."""
    return [floor(dimension, name="plate", rotation=[0.5] if dimension == 2 else [0.0, 0.5, 0.0], pivot=[0.05] * (dimension - 1) + [-0.1])]


#: effects: input groups of a dimension, each given to a method with one domain and to one with several
EFFECTS = {
    "rolling friction": rolling,
    "no friction": lambda d: {"scene": {"friction": 0.0}},
    "restitution": lambda d: {"scene": {"restitution": 0.6, "tangential_restitution": 0.4, "wall_restitution": 0.3}},
    "restitution, rolling": lambda d: merged(rolling(d), {"scene": {"restitution": 0.5, "tangential_restitution": 0.3}}),
    "adhesion": lambda d: one_law(d, "adhesive", friction=0.3, adhesion=2.0, adhesion_range=1e-3),
    "adhesion, rolling": lambda d: one_law(d, "adhesive", friction=0.3, adhesion=2.0, adhesion_range=1e-3, rolling_friction=0.2,
                                           pivoting_friction=0.1),
    "capillary": lambda d: one_law(d, "capillary", friction=0.3, capillarity=300.0, decay_length=2e-4, debonding_distance=5e-4),
    "bonds": lambda d: one_law(d, "bonded", friction=0.3, bond_strength=5.0, bond_friction=0.6, bond_distance=1.5e-3),
    "velocity law": lambda d: one_law(d, "velocity", static_friction=0.6, dynamic_friction=0.2, slip_scale=0.05, restitution=0.2),
    "frictionless law": lambda d: one_law(d, "frictionless", restitution=0.2),
    "periodic": lambda d: {"scene": {"period": [0.26 if d == 2 else 0.13] + [0.0] * (d - 1), "gravity": [2.0, *upward(d, -9.81)[1:]]},
                           "boundary": [floor(d)]},
    "lid": lambda d: {"boundary": lid(d, 0.26 if d == 2 else 0.135), "scene": {"overlap_allowed": 1e-6}},
    "belt": lambda d: {"boundary": belt(d)},
    "turning plate": lambda d: {"boundary": turning(d)},
    "sleeping": lambda d: {"solver": {"sleeping": True, "sleep_after": 2, "sleep_speed": 10.0}, "time": {"steps": SMALL_STEPS + 15}},
    "implicit Euler": lambda d: {"time": {"theta": 1.0}, "solver": {"warm_start": False}},
    "residual": lambda d: {"solver": {"criterion": "residual", "tolerance": 1e-4, "layered_start": False}},
}
#: methods of the effects, in turn
PAIRS = (("nlgs, momentum", "nscdd, momentum, metis"), ("nlgs", "nscdd, primal"), ("nlgs, momentum", "schwarz, momentum, metis"))


def small(dimension, *changes):
    """A lattice of grains that falls into a box."""
    return merged({
        "scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": [10, 8] if dimension == 2 else [5, 4, 4],
                  "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
        "time": {"step": 1e-3, "steps": SMALL_STEPS},
        "solver": {"max_iterations": 300},
        "decomposition": {"subdomains": 4},
        "output": {"directory": "results", "every": 9, "trace": True, "energy": True, "stress": True, "structure": True,
                   "boundary_forces": True, "checkpoint_every": SMALL_STEPS, "final_bodies": True},
    }, *changes)


def run_drum(groups, stop, programs, directory, ranks):
    write_drum(directory)
    return run_groups(groups, programs, directory, ranks, stop)


def run_fclib(groups, programs, directory, ranks, problem):
    """Write the contact problem of a step; gravier_fclib solves that of the old build by each of its methods."""
    found = run_groups(groups, programs, directory, ranks)
    path = problem(os.path.join(directory, "results", f"step_{groups['output']['fclib_step']}.hdf5"))
    run(programs, "gravier_fclib", "--method", "all", "--csv", "fclib.csv", "--write", "solved", "--max-iterations", "2000", path,
        ranks=1, directory=directory)
    found.update({f"gravier_fclib {name}": value for name, value in read_cells(os.path.join(directory, "fclib.csv")).items()
                  if not LEFT_OUT.search(name)})
    found.update({f"gravier_fclib {name}": value for name, value in written(os.path.join(directory, "solved")).items()})
    return found


def fclib_case(name, groups):
    """The problem of the old build is given to both: a build that writes another one is found once, and not once more as a solver
    that differs."""
    first = {}
    lock = threading.Lock()

    def act(programs, directory, ranks):
        def problem(path):
            with lock:
                if ranks not in first:
                    first[ranks] = os.path.abspath(path)
                return first[ranks]
        return run_fclib(groups, programs, directory, ranks, problem)

    return Case(name, act)


def small_cases():
    """Methods and effects, in 2D and 3D."""
    cases = []
    for dimension in (2, 3):
        title = f"{dimension}D"
        for method, groups in METHODS.items():
            cases.append(Case(f"method/{method}, {title}", functools.partial(run_groups, small(dimension, groups))))
        for number, (effect, groups) in enumerate(EFFECTS.items()):
            for method in PAIRS[number % len(PAIRS)]:
                changed = merged(METHODS[method], groups(dimension))
                cases.append(Case(f"effect/{effect}, {method}, {title}", functools.partial(run_groups, small(dimension, changed)),
                                  alone=method.startswith("nlgs")))
        last = {"time": {"steps": SMALL_STEPS}, "output": {"fclib_step": SMALL_STEPS, "every": 0}}
        cases.append(fclib_case(f"fclib/{title}", small(dimension, last, {"decomposition": {"subdomains": 1}})))
    cases.append(Case("scene/drum", functools.partial(run_drum, DRUM, 0)))
    cases.append(Case("scene/drum, restarted", functools.partial(run_drum, DRUM, 31)))
    return cases


# ---- the comparison

def compare(case, builds, ranks, directory, added=None):
    """Complaints about a case: names of what differs, or why it did not run. What the new build alone has and `added`
    matches is none."""
    found = []
    for build in ("old", "new"):
        place = os.path.join(directory, build)
        os.makedirs(place)
        try:
            found.append(case.act(builds[build], place, ranks))
        except (Failure, OSError) as reason:
            return [f"{build} build: {reason}"]
    old, new = found
    if added:
        new = {name: value for name, value in new.items() if name in old or not re.fullmatch(added, name)}
    return differences(old, new)


def line_of(case, ranks, wrong, shown=4):
    words = "same" if not wrong else "DIFFERENT: " + "; ".join(wrong[:shown])
    if len(wrong) > shown:
        words += f"; and {len(wrong) - shown} more"
    note = f" ({case.note})" if case.note else ""
    return f"{case.name}{note} on {ranks} rank{'' if ranks == 1 else 's'}: {words}"


def compare_all(old, new, pattern="*", steps=4, ranks=(1, 2), skip_large=False, directory=".", say=print, added=None):
    """Compare all cases whose names match a pattern: (same, different, left out)."""
    builds = {"old": os.path.abspath(old), "new": os.path.abspath(new)}
    lock = threading.Lock()

    @functools.lru_cache(None)
    def made():
        return make_packings(builds["old"], directory)

    def packings():
        # one thread makes them, the other ones wait
        with lock:
            return made()

    cases, left_out = data_cases(steps, packings, skip_large)
    cases += small_cases()
    cases = [case for case in cases if fnmatch.fnmatch(case.name, pattern)]
    left_out = [(name, reason) for name, reason in left_out if fnmatch.fnmatch(name, pattern)]
    for name, reason in left_out:
        say(f"{name}: left out: {reason}")
    same = different = 0
    for count in ranks:
        # two processes at once
        with concurrent.futures.ThreadPoolExecutor(max(1, 2 // count)) as pool:
            jobs = {}
            for case in cases:
                if case.alone and count > 1:
                    continue
                place = os.path.join(directory, f"{re.sub('[^A-Za-z0-9_]+', '_', case.name)}_np{count}")
                jobs[pool.submit(compare, case, builds, count, place, added)] = case, place
            for job in concurrent.futures.as_completed(jobs):
                case, place = jobs[job]
                wrong = job.result()
                say(line_of(case, count, wrong))
                same, different = same + (not wrong), different + bool(wrong)
                if not wrong and not case.name.startswith("fclib/"):
                    shutil.rmtree(place)
    return same, different, len(left_out)


def main():
    parser = argparse.ArgumentParser(description="Compare two builds of Gravier bit for bit.")
    parser.add_argument("old", metavar="OLD_BIN", help="directory of the programs of one build")
    parser.add_argument("new", metavar="NEW_BIN", help="directory of the programs of the other build")
    parser.add_argument("--cases", default="*", metavar="PATTERN", help="cases whose names match, as 'data/*' or '*periodic*'")
    parser.add_argument("--steps", type=int, default=4, metavar="N", help="steps of the cases under data/ (4)")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2], metavar="R", help="numbers of ranks (1 2)")
    parser.add_argument("--skip-large", action="store_true", help="leave out data/large instead of reducing it")
    parser.add_argument("--keep", metavar="DIR", help="keep what the cases that differ wrote, in a directory that does not exist yet")
    parser.add_argument("--added", metavar="REGEX", help="accept names that match as a whole and that the new build alone has, as "
                        r"'results\.h5 /steps/\d+/bodies/(mass|material)(@.*)?'")
    options = parser.parse_args()
    for programs in (options.old, options.new):
        if not os.path.isfile(os.path.join(programs, "gravier")):
            parser.error(f"{programs}: expected a directory with gravier")
    start = time.monotonic()
    directory = os.path.abspath(options.keep) if options.keep else tempfile.mkdtemp(prefix="gravier-compare-")
    if options.keep:
        os.makedirs(directory)
    try:
        same, different, left_out = compare_all(options.old, options.new, options.cases, options.steps, options.ranks,
                                                options.skip_large, directory, lambda line: print(line, flush=True), options.added)
    finally:
        if not options.keep:
            shutil.rmtree(directory, ignore_errors=True)
    print(f"{same} the same, {different} different, {left_out} left out, in {time.monotonic() - start:.0f} s")
    # a pattern that matches nothing compares nothing
    return 0 if same and not different else 1


if __name__ == "__main__":
    sys.exit(main())
