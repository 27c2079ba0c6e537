#!/usr/bin/env python3
"""Faults by trial: several programs at once in one directory, full disks of random sizes, kills at random moments.

    /usr/bin/python3 tests/hard/fault_trials.py at_once --trials 30
    ... full_disks --trials 100 [--kinds run vtk ...]   100 random sizes for each kind of output; wants the right to mount
    ... kills --trials 200                              200 random moments on 1, on 2 and on 4 ranks

What is wrong is printed trial by trial; the last line has the figure. Exit status 1 where anything was wrong. The suite runs a few
trials of each (test_run_fault_trials.py)."""
import argparse
import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import h5py

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
from gravier_runs import SOURCE, contents, differences, gravier, merged, namelist, read_csv, run_case, steps_of, write  # noqa: E402
from killed_runs import Going  # noqa: E402

BOX = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 1e-3, "steps": 20},
    "solver": {"tolerance": 1e-2, "method": "nscdd"},
    "decomposition": {"subdomains": 4},
    "output": {"directory": "results", "every": 4, "trace": True},
}
#: files that appear at once, whole
WHOLE = ("checkpoint.h5", "final_bodies.h5", "step_20.hdf5", "grains.h5", "problem.hdf5")
#: signs of a crash in what is said
CRASH = re.compile(r"SIG[A-Z]+|Backtrace|signal \d+ \(|double free|Traceback")


class Figure:
    """What trials have led to."""

    def __init__(self, name):
        self.name, self.trials, self.ends, self.wrong = name, 0, {}, []

    def note(self, end, trial, problems):
        self.trials += 1
        self.ends[end] = self.ends.get(end, 0) + 1
        for problem in problems:
            self.wrong.append(f"{trial}: {problem}")
            print(f"WRONG {self.name}: {trial}: {problem}", flush=True)

    def __str__(self):
        ends = ", ".join(f"{count} {end}" for end, count in sorted(self.ends.items()))
        return f"{self.name}: {self.trials} trials ({ends}), {len(self.wrong)} wrong"


def unreadable(directory, pattern=None):
    """What is wrong with the files of a directory that have their names; those written aside are not looked at. `pattern` is a
    directory with the same files, whole."""
    problems = []
    for folder, _, names in os.walk(directory):
        for name in sorted(names):
            path = os.path.join(folder, name)
            if name.startswith(".") or name.endswith(".part") or ".part." in name:
                continue
            try:
                if name.endswith((".h5", ".hdf5", ".vtkhdf")):
                    found = contents(path)
                    if name == "results.h5":
                        problems += broken_steps(found)
                    if name in WHOLE and pattern:
                        there = set(contents(os.path.join(pattern, os.path.relpath(path, directory))))
                        if there != set(found):
                            problems.append(f"{name}: not whole: {sorted(there ^ set(found))[:3]}")
                    if name.endswith(".vtkhdf"):
                        problems += broken_pictures(path)
                elif name.endswith(".csv"):
                    read_csv_texts(path)
            except (OSError, KeyError, AssertionError, RuntimeError) as what:
                problems.append(f"{name}: {what}")
    return problems


def read_csv_texts(path):
    """A table whose cells may be texts: a header and whole rows."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if not text.endswith("\n") or len({line.count(",") for line in text.splitlines() if '"' not in line}) != 1:
        raise AssertionError("not a table of whole rows")


def broken_steps(found):
    """States that lack a part of what the others have."""
    def parts(step):
        return {name.split("/", 3)[3] for name in found if name.startswith(f"/steps/{step}/")}
    problems = [f"results.h5: no {name}" for name in ("/run@input_text", "/steps") if name not in found]
    steps = [step for step in steps_of(found) if step > 0]
    return problems + [f"results.h5: step {step} is not whole" for step in steps if parts(step) != parts(steps[0])]


def broken_pictures(path):
    """A temporal PolyData whose tables hold what its number of steps promises."""
    with h5py.File(path, "r") as file:
        root = file["VTKHDF"]
        steps = int(root["Steps"].attrs["NSteps"])
        points = int(root["NumberOfPoints"][:steps].sum())
        if len(root["Steps/Values"]) < steps or len(root["NumberOfPoints"]) < steps or len(root["Points"]) < points:
            return [f"{os.path.basename(path)}: {steps} steps, but not their tables"]
    return []


def what_is_said(run, allowed=(0, 4)):
    """What is wrong with how a run ended: its status, and one line for an error."""
    problems = []
    if run.status not in allowed:
        problems.append(f"status {run.status}")
    if CRASH.search(run.stdout + run.stderr):
        problems.append("a crash: " + CRASH.search(run.stdout + run.stderr)[0])
    # the script of a figure says what was wrong before the program says that there is none
    own = [line for line in run.stderr.splitlines() if not line.startswith(("mca_fbtl", "plot_"))]
    if run.status in (2, 4) and not (len(own) == 1 and re.match(r"(gravier|tile)\w*: error: ", own[0])):
        problems.append(f"not one line of error: {run.stderr[:300]!r}")
    return problems


# ---------------------------------------------------------------------------------------------- full disks

def write_fclib(directory):
    """A problem of two contacts with a long description, which is copied, and its name."""
    import numpy as np
    from fclib_problems import write_local
    write_local(os.path.join(directory, "problem.hdf5"), np.eye(6) + 0.1, np.array([-1.0, 0.2, 0.1, -2.0, 0.3, 0.0]), np.array([0.3, 0.4]))
    with h5py.File(os.path.join(directory, "problem.hdf5"), "a") as file:
        file["fclib_local/info/description"] = np.bytes_("two contacts " * 20000)
    return "problem.hdf5"


def write_error_case(directory):
    write(os.path.join(directory, "error.nml"), namelist(merged(BOX, {"scene": {"lattice_count": [4, 3]}, "solver": {"method": "nlgs"},
                                                                      "decomposition": {"subdomains": 1}})))
    return "error.nml"


def write_study(directory):
    write(os.path.join(directory, "study_case.nml"), namelist(merged(BOX, {"scene": {"lattice_count": [4, 3]},
                                                                           "decomposition": {"subdomains": 1}})))
    write(os.path.join(directory, "study.nml"), "&study title = 'two', case = 'study_case.nml', directory = 'study', kind = 'solve', repeats = 1 /\n"
          "&variant name = 'NLGS', method = 'nlgs' /\n")
    return "study.nml"


def write_box(place):
    """A DATBOX of two disks on a wall."""
    os.makedirs(os.path.join(place, "DATBOX"))
    body = "$bdyty\n RBDY2{0:7d}\n$blmty\n PLAIN      1  behav  stone  avrd= 0.0000000D+00  gyrd= 0.0000000D+00\n$nodty\n NO3xx      1                " \
           "coo1= {1:13.7e}  coo2= {2:13.7e}  coo3= 0.0000000D+00\n$tacty\n {3}\n$$$$$$\n"
    disk = "DISKx      1  color  BLUEx  byrd= 0.1000000D+00"
    wall = "JONCx      1  color  WALLx  axe1= 0.1000000D+01  axe2= 0.1000000D-01"
    files = {
        "BODIES.DAT": "! File BODIES\n" + body.format(1, 0.0, 0.1, disk) + body.format(2, 0.3, 0.1, disk) + body.format(3, 0.0, -0.01, wall),
        "BULK_BEHAV.DAT": "$gravy\n                   grv1= 0.0000000D+00  grv2=-9.8100000D+00  grv3= 0.0000000D+00\n\n$behav  lawty\n"
                          " stone  RIGID                           Umas= 0.2500000D+04\n",
        "TACT_BEHAV.DAT": "$behav  lawty\n iqsc0  IQS_CLB                         fric= 0.3000000D+00\n" + "".join(
            "$seety\n cdbdy  cdtac  cdcol  behav  anbdy  antac  ancol\n RBDY2  DISKx  BLUEx  iqsc0  RBDY2  " + other + "  0.2000000D-02\n"
            for other in ("DISKx  BLUEx", "JONCx  WALLx")),
        "DRV_DOF.DAT": "! DOF\n$bdyty\n RBDY2      3\n$nodty\n NO3xx      1\n"
                       "$dofty  numbr [CT......+......AMP..*..cos.(..OMEGA.*.time.+.PHI..)]...*...[RAMPI.....+.....RAMP.*.time]\n"
                       + "".join(f" vlocy{k:7d}  0.0000000D+00  0.0000000D+00  0.0000000D+00  0.0000000D+00  0.1000000D+01  0.0000000D+00\n"
                                 for k in (1, 2, 3)) + "$$$$$$\n"}
    for name, text in files.items():
        write(os.path.join(place, "DATBOX", name), text)


def write_sample(directory, name, file, count):
    """A loose sample of disks in a square that is as large as they need."""
    write(os.path.join(directory, name), namelist({
        "scene": {"bodies": "sample", "dimension": 2, "friction": 0.3},
        "sample": {"preparation": "none", "file": file, "count": count, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012,
                   "box": 0.03 * count ** 0.5, "solid_fraction": 0.3},
        "time": {"step": 1e-3, "steps": 0}}))


def prepare(kind, directory):
    """Write the input of a kind of output, which goes to `disk`; the program and its arguments."""
    changes = {
        "run": {},
        "vtk": {"output": {"vtk": True, "every": 1}},
        "checkpoint": {"output": {"checkpoint_every": 1, "every": 0, "contacts": False}},
        "fclib_step": {"output": {"fclib_step": 20, "every": 0, "contacts": False}},
        "final_bodies": {"output": {"final_bodies": True, "every": 0, "contacts": False}, "scene": {"lattice_count": [30, 20]}},
    }
    if kind in changes:
        write(os.path.join(directory, "case.nml"), namelist(merged(BOX, {"output": {"directory": "disk/results"}}, changes[kind])))
        return "gravier", ["case.nml"]
    if kind == "sample":
        write_sample(directory, "sample.nml", "disk/grains.h5", 1500)
        return "gravier_sample", ["sample.nml"]
    if kind == "fclib_write":
        return "gravier_fclib", ["--write", "disk/out", "--csv", "disk/table.csv", "--profile", "disk/profile.csv", write_fclib(directory)]
    if kind == "error_table":
        return "gravier_error", ["--out", "disk/error.csv", "--iterations", "1,2,4", write_error_case(directory)]
    if kind == "accuracy":
        name = write_study(directory)
        with open(os.path.join(directory, name), encoding="utf-8") as file:
            text = file.read()
        write(os.path.join(directory, name), text.replace("'study'", "'disk/study'"))
        return "gravier_accuracy", [name]
    if kind == "columns":
        return "gravier_columns", ["--count", "4", "--subdomains", "2", "--out", "disk/columns"]
    if kind == "bench":
        return "gravier_bench", ["--quick", "--rounds", "1", "--seconds", "0.001", "--contacts", "300", "--spheres", "300", "--iterations", "2",
                                 "--triad", "1000", "--csv", "disk/bench.csv"]
    return prepare_script(kind, directory)


def prepare_script(kind, directory):
    """Input of a script, which this Python runs."""
    if kind == "import":
        write_box(directory)
        return sys.executable, [os.path.join(SOURCE, "drivers/import/gravier_import.py"), "DATBOX", "--step", "1e-3", "--steps", "2", "--out", "disk/case"]
    run = run_case(merged(BOX, {"scene": {"lattice_count": [20, 16]}, "time": {"steps": 4}, "output": {"final_bodies": True}}), 1, directory)
    if run.status != 0:
        raise AssertionError(str(run))
    if kind == "tile":
        return sys.executable, [os.path.join(SOURCE, "drivers/studies/tile_bodies.py"), "results/final_bodies.h5", "disk/tiled.h5", "--copies", "20"]
    pictures = {"picture": ["packing", "results", "--out", "disk/packing.png"], "movie": ["movie", "results", "--out", "disk/frames"]}
    return sys.executable, [os.path.join(SOURCE, "drivers/plot/gravier_plot.py"), *pictures[kind]]


#: kinds of output; those from `import` on are of scripts, on one rank
KINDS = ("run", "vtk", "checkpoint", "fclib_step", "final_bodies", "sample", "fclib_write", "error_table", "accuracy", "columns", "bench", "import",
         "tile", "picture", "movie")


def used(directory):
    """Bytes of the blocks of all files."""
    return sum(512 * os.stat(os.path.join(folder, name)).st_blocks for folder, _, names in os.walk(directory) for name in names)


def full_disks(random_seed, trials, directory, kinds=KINDS, first=0):
    """`trials` random sizes of the disk for each kind of output, on 1 or 2 ranks, some of them with files of an older run there. Those of
    an even number, of which `first` is the first, are small disks."""
    figure = Figure("full disks")
    for kind in kinds:
        draw = random.Random(f"{random_seed} {kind}")
        place = os.path.join(directory, kind)
        disk = os.path.join(place, "disk")
        os.makedirs(disk)
        program, arguments = prepare(kind, place)
        free = gravier(*arguments, program=program, directory=place)
        if free.status != 0:
            raise AssertionError(f"{kind}: {free}")
        pattern = os.path.join(place, "free")
        os.rename(disk, pattern)
        os.makedirs(disk)
        most = 1.6 * used(pattern) + 300e3
        for trial in range(first, first + trials):
            # small disks meet the beginnings of files, large ones their ends
            kilobytes = int(draw.uniform(8, most / 1024) if trial % 2 else 8 * (most / 8192) ** draw.random())
            ranks = draw.choice((1, 2)) if program.startswith("gravier") else 1
            name = f"{kind} {trial}: {kilobytes} kB, {ranks} ranks"
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "gravier-trial", disk], check=True)
            try:
                problems, end = [], "no end"
                try:
                    run = gravier(*arguments, program=program, ranks=ranks, directory=place)
                    problems = what_is_said(run, (0, 2, 4)) + unreadable(disk, pattern)
                    end = f"status {run.status}"
                except AssertionError as what:
                    problems.append(str(what))
                figure.note(end, name, problems)
            finally:
                subprocess.run(["umount", "-l", disk], check=True)
    return figure


# ---------------------------------------------------------------------------------------------- kills

def kills(random_seed, trials, directory, all_ranks=(1, 2, 4)):
    """`trials` random moments for each number of ranks: all ranks, one of them, or the launcher is killed. Then all files are whole, and
    a restart, at once, comes to the end of the run that nothing stopped, bit by bit."""
    figure = Figure("kills")
    case = merged(BOX, {"output": {"vtk": True, "every": 1, "checkpoint_every": 1, "final_bodies": True, "fclib_step": 20}})
    straight = os.path.join(directory, "straight")
    started = time.monotonic()
    run = Going(case, 2, straight)
    status, said = run.end()
    if status != 0:
        raise AssertionError(said)
    length = time.monotonic() - started
    wanted = state(os.path.join(straight, "results"))
    # a command that is interrupted has the figure of what it did
    with contextlib.suppress(KeyboardInterrupt):
        for ranks in all_ranks:
            draw = random.Random(f"{random_seed} {ranks}")
            for trial in range(trials):
                place = os.path.join(directory, f"killed {ranks} {trial}")
                whom = draw.choice(("all ranks", "one rank", "the launcher"))
                # a run begins with the start of its ranks, which writes nothing
                moment = draw.uniform(0.1, 1.1) * length
                name = f"{ranks} ranks, trial {trial}: {whom} after {moment:.3f} s"
                run = Going(case, ranks, place)
                time.sleep(moment)
                if whom == "the launcher":
                    run.process.kill()
                else:
                    run.send(signal.SIGKILL, 1 if whom == "one rank" else None)
                results = os.path.join(place, "results")
                problems, end = [], f"{ranks} ranks"
                if whom == "the launcher":
                    # a restart at once, while ranks may still live
                    run.process.wait()
                else:
                    begun = os.path.exists(results)
                    try:
                        run.end(timeout=300)
                    except AssertionError as what:
                        # Open MPI's launcher may wait for ever for a rank that dies while it starts, before the program has begun
                        end = f"{ranks} ranks whose launcher hung before the program began"
                        problems = [str(what)] if begun else []
                    problems += unreadable(results, os.path.join(straight, "results"))
                try:
                    again = gravier("--restart", "case.nml", ranks=draw.choice((1, 2)), directory=place)
                    problems += what_is_said(again, (0,)) + unreadable(results, os.path.join(straight, "results"))
                    if again.status == 0:
                        problems += [f"differs: {name}" for name in differences(wanted, state(results))[:3]]
                except AssertionError as what:
                    problems.append(str(what))
                run.end()
                figure.note(end, name, problems)
                shutil.rmtree(place)
    return figure


def state(results):
    """All that a run leaves and that is not a time on the clock, or the history of its file."""
    found = {}
    for name in ("results.h5", "checkpoint.h5", "final_bodies.h5", "step_20.hdf5"):
        found.update({f"{name} {key}": value for key, value in contents(os.path.join(results, name)).items()
                      if not key.startswith(("/run/", "/run@"))})
    for name in ("history", "trace"):
        rows = read_csv(os.path.join(results, f"{name}.csv"))
        found.update({f"{name} {key}": value for key, value in rows.items() if not key.endswith("_seconds")})
    return found


# ---------------------------------------------------------------------------------------------- several at once

def at_once(random_seed, trials, directory):
    """Two or three runs in one directory, begun nearly together: all that are not refused end as if they had been alone, and the files
    are those of the last one, whole."""
    figure = Figure("at once")
    draw = random.Random(random_seed)
    frictions = (0.1, 0.3, 0.5)
    cases = [merged(BOX, {"scene": {"friction": friction}, "output": {"checkpoint_every": 5}}) for friction in frictions]
    alone = []
    for k, case in enumerate(cases):
        place = os.path.join(directory, f"alone {k}")
        os.makedirs(place)
        write(os.path.join(place, "case.nml"), namelist(case))
        if gravier("case.nml", directory=place).status != 0:
            raise AssertionError("a run alone failed")
        alone.append(kept(os.path.join(place, "results")))
    for trial in range(trials):
        place = os.path.join(directory, f"trial {trial}")
        os.makedirs(place)
        number = 2 + trial % 2
        # of those that go on until their time is over, all but one are refused
        long = trial % 2 == 1
        plan = [(k, draw.choice((1, 2)), draw.uniform(0, 0.3), draw.choice(([], ["--restart"]))) for k in range(number)]
        runs = [None] * number

        def begin(k, ranks, delay, options, place=place, long=long, runs=runs):
            case = merged(cases[k], {"time": {"steps": 1000000}, "output": {"walltime": 9.0, "every": 1000}} if long else {})
            write(os.path.join(place, f"case_{k}.nml"), namelist(case))
            time.sleep(delay)
            try:
                runs[k] = gravier(*options, f"case_{k}.nml", ranks=ranks, directory=place)
            except AssertionError as what:
                runs[k] = what

        threads = [threading.Thread(target=begin, args=arguments) for arguments in plan]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        problems, ends = [], []
        for k, run in enumerate(runs):
            if isinstance(run, AssertionError):
                problems.append(str(run))
                continue
            ends.append(run.status)
            refused = run.status == 2 and ("another program writes here" in run.stderr or "checkpoint.h5" in run.stderr
                                           or "expected friction" in run.stderr)
            if refused:
                problems += what_is_said(run, (2,))
            elif long and run.status == 4 and "interrupted *** at the walltime" in run.stdout and not run.stderr:
                pass
            elif run.status != 0 or long:
                problems.append(f"run {k}: {run}")
        if long and ends.count(4) != 1:
            problems.append(f"statuses {ends}: expected that one run goes on and the others are refused")
        if not long and 0 not in ends:
            problems.append(f"statuses {ends}: no run came to its end")
        results = os.path.join(place, "results")
        problems += unreadable(results)
        if not long and not any(differences(one, kept(results)) == [] for one in alone):
            problems.append("the files are not those of one of the runs")
        if os.path.exists(os.path.join(results, ".gravier.lock")):
            problems.append("a lock file is left")
        figure.note(f"{number} runs", f"trial {trial}: {plan}, statuses {ends}", problems)
        shutil.rmtree(place)
    return figure


def kept(results):
    """What results and history hold, but for times on the clock and what says how the run was started."""
    found = {key: value for key, value in contents(os.path.join(results, "results.h5")).items() if not key.startswith(("/run/", "/run@"))}
    rows = read_csv(os.path.join(results, "history.csv"))
    found.update({f"history {key}": value for key, value in rows.items() if not key.endswith("_seconds")})
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("fault", choices=("at_once", "full_disks", "kills"))
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=KINDS, help="of outputs, for full disks")
    parser.add_argument("--ranks", type=int, nargs="*", default=(1, 2, 4), help="of runs that are killed")
    options = parser.parse_args()
    directory = tempfile.mkdtemp(prefix="gravier-trials-")
    try:
        if options.fault == "full_disks":
            figure = full_disks(options.seed, options.trials, directory, options.kinds)
        elif options.fault == "kills":
            figure = kills(options.seed, options.trials, directory, options.ranks)
        else:
            figure = at_once(options.seed, options.trials, directory)
    finally:
        shutil.rmtree(directory, ignore_errors=True)
    print(figure)
    sys.exit(1 if figure.wrong else 0)


if __name__ == "__main__":
    main()
