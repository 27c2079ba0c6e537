#!/usr/bin/env python3
"""Inputs by trial: valid files and command lines of every kind are changed at random and given to the programs that read them.

    /usr/bin/python3 tests/hard/fuzz_inputs.py --count 20000 [--seed 1] [--kinds namelist bodies_hdf5 ...] [--keep findings]
    ... --kinds bodies_hdf5 --seed 1 --only 17          one trial once more

A finding is a crash, a backtrace, lines of HDF5, more than 20 s of processor time, a status that is not documented, an error that is not one
line naming the file, output that is no number, or status 0 where what was read is not what Python reads in the same file. Findings are
printed trial by trial and kept as directories with the files, the command and what it said; the last lines have the figures. Exit status 1
where there was one. The suite makes a few trials of each kind (test_run_fuzz_inputs.py)."""
import argparse
import contextlib
import io
import multiprocessing
import os
import random
import re
import resource
import runpy
import shutil
import sys
import tempfile
import time
import traceback

import h5py
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "support")]
from fault_trials import BOX, CRASH, Figure, kept, write_box, write_study  # noqa: E402
from fclib_problems import write_local  # noqa: E402
from gravier_runs import LONGEST_FILE, PROGRAMS, SOURCE, Said, alone, contents, differences, merged, namelist, read_csv, write  # noqa: E402
from mutations import EXTREMES, mutate_hdf5, mutate_namelist, mutate_table, mutate_text  # noqa: E402
from gravier import parse_namelist  # noqa: E402

#: numbers below it are read as 0
TINY = 1e-319
#: seconds of processor time
LONGEST = 20
#: beside those of the programs, signs of a crash in what is said
SIGNS = re.compile(CRASH.pattern + r"|HDF5-DIAG|HDF5 error|Fortran runtime|At line \d+ of|runtime error:|Sanitizer|MPI_ABORT|MPI_ERR")
#: scripts are run in a fork of this process
SCRIPTS = {"gravier_import": "drivers/import/gravier_import.py", "gravier_plot": "drivers/plot/gravier_plot.py"}
WALLS = """id,shape,x,y,radius,vx,vy,omega,mass,group,material,nx,ny
1,grain,0.0,0.1,0.1,0.5,0.0,1.5,2.0,0,1,,
2,grain,0.3,0.1,0.1,0.0,-1.0,0.0,1.0,1,2,,
5,grain,0.6,0.1,0.05,0.0,0.0,0.0,1.0,1,1,,
4,grain,0.9,0.1,0.1,0.0,0.0,0.0,3.0,0,1,,
9,plane,0.0,0.0,,,,,,,,0.0,1.0
"""
SPHERES = """# three spheres
id,x,y,z,radius,wz
3,0.0,0.0,0.5,0.1,0.5
2,0.3,0.0,0.5,0.1,0
1,0.6,1e-1,0.5,1d-1,-2
"""
GRAVITY = "time,gx,gy\n0,0,-9.81\n1e-3,1.0,-9.81\n0.5,-1.0,0\n"
DRIVE = "# a drive\ntime,vx,vy,omega\n0,0,0,0\n0.001,1e-2,0.5,1\n1,0,0,0\n"
RADII = "radius,share\n0.008,1\n0.01,2.5\n0.012,1\n"
#: cases that together have keys of every group
CASES = {
    "laws": {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "wall_material": "steel", "friction": 0.3, "title": "it's a title"},
             "boundary": [{"shape": "grains", "group": 1, "velocity": [0.1, 0.0], "rotation": [1.0], "pivot": [0.0, 0.0]},
                          {"name": "lid", "shape": "plane", "point": [0.0, 3.0], "normal": [0.0, -1.0], "free": [False, True], "mass": 2.0,
                           "force": [0.0, -1.0], "material": "steel"},
                          {"name": "ring", "shape": "circle", "point": [0.5, 0.5], "radius": 9.0, "table": "drive.csv"},
                          {"shape": "segment", "point": [-5.0, -1.0], "end": [5.0, -1.0], "remove_at": 0.5},
                          {"shape": "outlet", "point": [0.0, -4.0], "normal": [0.0, 1.0]}],
             "material": [{"name": "glass", "density": 2500.0}, {"name": "steel"}],
             "law": [{"materials": "glass", "kind": "velocity", "static_friction": 0.5, "dynamic_friction": 0.3, "slip_scale": 0.1},
                     {"materials": ["glass", "steel"], "kind": "adhesive", "adhesion": 0.1, "adhesion_range": 1e-3, "friction": 0.3}],
             "time": {"step": 1e-3, "steps": 3, "theta": 0.5},
             "solver": {"method": "schwarz", "sweeps": 2, "check_every": 2, "relaxation": 0.8, "tolerance": 1e-3, "criterion": "residual"},
             "decomposition": {"subdomains": 2, "grid": [2, 1]}, "output": {"directory": "results", "energy": True, "walltime": 100.0}},
    "space": {"scene": {"dimension": 3, "bodies": "lattice", "lattice_count": [3, 2, 4], "radius_min": 0.01, "radius_max": 0.012, "friction": 0.3,
                        "pivoting_friction": 0.1, "rolling_friction": 0.1, "gravity": [0.0, 0.5, -9.81], "seed": 7, "restitution": 0.5},
              "boundary": [{"shape": "rectangle", "point": [0.0, 0.0, -1.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 2.0, 0.0]},
                           {"shape": "cylinder", "point": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "radius": 5.0, "rotation": [0.0, 0.0, 1.0]}],
              "time": {"step": 1e-3, "steps": 2}, "solver": {"method": "nscdd", "acceleration": "momentum", "warm_start": False},
              "decomposition": {"subdomains": 4, "partition": "metis"}, "output": {"directory": "results", "every": 2, "vtk": True}},
    "sample": {"scene": {"dimension": 2, "bodies": "sample", "friction": 0.3, "period": [0.3, 0.0]},
               "sample": {"preparation": "none", "file": "grains.h5", "count": 30, "radii": "table", "radius_table": "radii.csv",
                          "box": [0.3, 0.0], "solid_fraction": 0.3, "seed": 5},
               "time": {"step": 1e-3, "steps": 0}, "output": {"directory": "results"}},
    "enriched": merged(BOX, {"solver": {"method": "nscdd_ep", "on_failure": "stop", "max_iterations": 50}, "scene": {"gravity_table": "gravity.csv"},
                             "enriched": {"direction": 1.0, "contacts": "active", "interface": "cg", "cg_tolerance": 1e-10},
                             "output": {"checkpoint_every": 2, "checkpoint_seconds": 60.0}}),
}


class Trial:
    """A command in a directory, the files that were changed, and a check of what the program did with them where its status is 0.
    `names` are files of which a message may name any; `status` those that are allowed; `same`: what was changed has no meaning."""

    def __init__(self, command, names, check=None, status=(0, 2), same=False):
        self.command, self.names, self.check, self.status, self.same = command, names, check, status, same


def run(command, place):
    """Run a program or a script by itself."""
    name = os.path.basename(command[0])
    if name in SCRIPTS or name == "reader.py":
        return forked(os.path.join(SOURCE, SCRIPTS[name]) if name in SCRIPTS else os.path.join(place, name), command[1:], place)
    return alone(command, place, seconds=LONGEST)


def forked(script, arguments, place):
    """Run a Python script in a fork of this process, which has its modules already."""
    out, err = os.path.join(place, ".stdout"), os.path.join(place, ".stderr")
    child = os.fork()
    if child == 0:
        status = 1
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + LONGEST,) * 2)
            resource.setrlimit(resource.RLIMIT_FSIZE, (LONGEST_FILE, LONGEST_FILE))
            resource.setrlimit(resource.RLIMIT_AS, (2**32, 2**32))
            os.chdir(place)
            for number, path in ((1, out), (2, err)):
                os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
            sys.stdout, sys.stderr = io.TextIOWrapper(open(1, "wb", closefd=False)), io.TextIOWrapper(open(2, "wb", closefd=False))
            sys.argv = [script.removesuffix(".py"), *arguments]
            sys.path.insert(0, os.path.dirname(script))
            try:
                runpy.run_path(script, run_name="__main__")
                status = 0
            except SystemExit as end:
                if isinstance(end.code, str):
                    print(end.code, file=sys.stderr)
                status = end.code if isinstance(end.code, int) else int(end.code is not None)
            except BaseException:  # as the interpreter does
                traceback.print_exc()
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    texts = []
    for path in (out, err):
        with open(path, "rb") as file:
            texts.append(file.read().decode(errors="replace"))
        os.remove(path)
    return Said(status, *texts)


def problems_of(trial, said, place):
    """What is wrong with how a program took its input."""
    text = said.stdout + said.stderr
    if said.status == "a hang" or said.status in (-24, -9, 152, 137):
        return [f"more than {LONGEST} s of processor time, or no end"]
    if SIGNS.search(text):
        return [f"a crash ({SIGNS.search(text)[0]}), status {said.status}: {said.stderr[-300:]!r}"]
    if said.status not in trial.status:
        return [f"status {said.status}: {said.stderr[-300:]!r}"]
    lines = said.stderr.split("\n")
    program = os.path.basename(next(word for word in trial.command if "gravier_job" in word or trial.command[0] != "/usr/bin/env"))
    if said.status == 2 or (said.status == 4 and said.stderr):
        if len(lines) != 2 or lines[1]:
            return [f"not one line: {said.stderr[:400]!r}"]
        begin = re.match(rf"(?:{program}: error|gravier_plot|gravier_import: error|reader): ", lines[0])
        if not begin:
            return [f"not an error of {program}: {lines[0][:300]!r}"]
        rest = lines[0][begin.end():]
        if said.status == 2 and trial.names and not any(rest.startswith(name) for name in trial.names) \
                and ": cannot read this file: No such file" not in rest:
            return [f"does not begin with the name of the file: {lines[0][:300]!r}"]
        if any(letter < " " or letter == "\x7f" for letter in lines[0]):
            return [f"characters that steer a terminal: {lines[0][:300]!r}"]
        return ["an error where nothing was changed: " + lines[0][:300]] if trial.same and said.status == 2 else []
    if said.stderr and program not in SCRIPTS:
        return [f"status {said.status}, but lines of error: {said.stderr[:300]!r}"]
    return trial.check(said) if trial.check and said.status == 0 else []


# ---------------------------------------------------------------------------------------------- what was read

def in_force(text):
    """[(group, {key: value})] of the options that a run says are in force."""
    lines = text.split("options in force\n")[1].split("\n")
    end = next(k for k, line in enumerate(lines) if line and not line.startswith(" "))
    return parse_namelist("\n".join(lines[:end]))


def same_value(given, found):
    given, found = (value if isinstance(value, list) else [value] for value in (given, found))
    if len(given) > len(found):
        return False
    for one, other in zip(given, found):
        if one is None:
            continue
        if isinstance(one, str):
            if not isinstance(other, str) or one.rstrip().lower() != other.rstrip().lower():
                return False
        elif isinstance(one, bool) or isinstance(other, (bool, str)):
            if one is not other:
                return False
        elif abs(one - other) > 1e-15 * abs(one):
            return False
    return True


def not_in_force(text, said):
    """Keys of a case, as Python reads them, that are not those in force."""
    problems, force = [], in_force(said.stdout)
    for group, several in parse_namelist(text).items():
        for number, keys in enumerate(several):
            for key, value in keys.items():
                name, _, place = key.partition("(")
                found = force.get(group, [])
                found = found[number].get(name) if number < len(found) else None
                if place and isinstance(found, list):
                    found = found[int(place.rstrip(") ").split(":")[0]) - 1:]
                if found is None or not same_value(value, found):
                    problems.append(f"&{group} {key} = {value!r}, but in force is {found!r}")
    return problems[:2]


def written(cell):
    return float(re.sub("[dD]", "e", cell))


def number(cell):
    value = written(cell)
    return 0.0 if abs(value) < TINY and re.search("[1-9]", re.split("[eEdD]", cell)[0]) else value


def table_rows(text):
    """Columns and rows of a table, as Python reads it."""
    lines = [line for line in re.split(r"\r\n|\n", text.removeprefix("\ufeff")) if line.strip() and not line.lstrip().startswith("#")]
    names, *rows = [[cell.strip() for cell in line.split(",")] for line in lines]
    return [name.lower() for name in names], rows


def csv_bodies(path):
    """{(id, quantity): value} of the grains of a table; glued ones have no velocity of their own."""
    with open(path, encoding="utf-8", errors="surrogateescape", newline="") as file:
        names, rows = table_rows(file.read())
    found = {}
    for row in rows:
        cells = dict(zip(names, row))
        if (cells.get("shape") or "grain").lower() == "grain":
            one = int(cells["id"])
            if cells.get("group") and number(cells["group"]) > 0:
                cells = {name: cell for name, cell in cells.items() if name[0] not in "vwo"}
            found.update({(one, name): number(cells[name]) for name in ("x", "y", "z", "radius", "vx", "vy", "vz", "omega", "wx", "wy", "wz", "mass", "group")
                          if cells.get(name)})
    return found


def hdf5_bodies(path, dimension=None):
    found = {}
    with h5py.File(path, "r") as file:
        bodies = file["bodies"]
        ids = bodies["id"][()]
        axes = "xyz"[:bodies["position"].shape[1] if dimension is None else dimension]
        names = {"position": list(axes), "velocity": ["v" + axis for axis in axes] + (["omega"] if len(axes) == 2 else ["wx", "wy", "wz"]),
                 "radius": ["radius"], "mass": ["mass"], "group": ["group"]}
        for name, columns in names.items():
            if name in bodies:
                values = np.asarray(bodies[name][()]).reshape(len(ids), len(columns))
                found.update({(int(one), column): float(values[row, k]) for row, one in enumerate(ids) for k, column in enumerate(columns)})
    glued = {one for (one, name), value in found.items() if name == "group" and value > 0}
    return {(one, name): value for (one, name), value in found.items() if one not in glued or name[0] not in "vwo"}


def not_read(given, found):
    """Values of a bodies file that are not those of the state at the start."""
    wrong = [f"id {one}: {name} = {value!r}, but {found.get((one, name), 0.0)!r} was read" for (one, name), value in given.items()
             if not abs(value - found.get((one, name), 0.0)) <= 1e-15 * abs(value) + TINY]
    return wrong[:2] + [f"id {one} is not in the file" for one, _ in found if (one, "radius") not in given][:1]


def not_finite(results):
    return [f"{name}: NaN or infinity" for name, value in contents(results).items() if np.asarray(value).dtype.kind == "f"
            and not np.all(np.isfinite(value))][:2] if os.path.exists(results) else []


# ---------------------------------------------------------------------------------------------- kinds

def program(name):
    return os.path.join(PROGRAMS, name)


def read(path):
    with open(path, "rb") as file:
        return file.read()


class Kinds:
    """Directories of valid files, and a trial of each kind in a copy of one of them: KIND(draw, place) makes it."""

    def __init__(self, directory):
        self.directory = directory
        self.names = [name[6:] for name in dir(self) if name.startswith("trial_")]
        said = alone([program("gravier"), "--keys"], ".").stdout
        self.keys = []
        for part in re.split(r"^## &", said, flags=re.M)[1:]:
            self.keys += [(part.split()[0], key) for key in re.findall(r"^\| `(\w+)` \|", part, re.M)]
        self.words = ([key for _, key in self.keys] + ["&" + group for group, _ in self.keys] + sorted(set(re.findall(r"'[a-z_]+'", said))) + ["/"])
        self.make_cases(os.path.join(directory, "cases"))
        self.make_run(os.path.join(directory, "run"))
        self.make_problems(os.path.join(directory, "problems"))
        write_box(os.path.join(directory, "boxes"))
        self.good = {}

    def make_cases(self, place):
        os.makedirs(place)
        os.symlink(os.path.join(SOURCE, "data"), os.path.join(place, "data"))
        for name, text in {"bodies.csv": WALLS, "spheres.csv": SPHERES, "gravity.csv": GRAVITY, "drive.csv": DRIVE, "radii.csv": RADII}.items():
            write(os.path.join(place, name), text)
        self.cases = {name + ".nml": namelist(groups) for name, groups in CASES.items()}
        for name in ("data/scenes/hopper.nml", "data/scenes/triaxial.nml", "data/samples/compacted_2d.nml", "data/columns/problem2.nml"):
            self.cases[os.path.basename(name)] = read(os.path.join(SOURCE, name)).decode()
        for name, text in self.cases.items():
            write(os.path.join(place, name), text)
        for name, dimension, bodies in (("csv2", 2, "bodies.csv"), ("csv3", 3, "spheres.csv")):
            write(os.path.join(place, name + ".nml"), namelist(self.start_case(dimension, bodies)))
        write_study(place)
        write(os.path.join(place, "template.nml"), namelist(merged(BOX, {"scene": {"title": "@tag@"}, "output": {"directory": "@run@"}})).replace("0.3", "@mu@", 1))
        write(os.path.join(place, "list.csv"), "mu,tag\n0.1,7\n0.2,8\n")

    @staticmethod
    def start_case(dimension, bodies):
        """A case of no steps that writes what it has read."""
        planar = dimension == 2
        return {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": bodies},
                "boundary": [{"shape": "grains", "group": 1}] if planar else [], "material": [{"name": "a"}, {"name": "b"}],
                "time": {"step": 1e-3, "steps": 0}, "output": {"directory": "results", "final_bodies": True, "every": 0}}

    def make_run(self, place):
        """A run in 2D with every output, and bodies files of it and of the tables."""
        os.makedirs(place)
        case = merged(BOX, {"scene": {"lattice_count": [4, 3]}, "time": {"steps": 4}, "decomposition": {"subdomains": 2},
                            "output": {"every": 2, "vtk": True, "checkpoint_every": 4, "final_bodies": True, "energy": True}})
        write(os.path.join(place, "case.nml"), namelist(case))
        write(os.path.join(place, "on.nml"), namelist(merged(case, {"time": {"steps": 6}})))
        self.must(alone([program("gravier"), "case.nml"], place))
        shutil.copy(os.path.join(place, "results/final_bodies.h5"), os.path.join(place, "bodies.h5"))
        with h5py.File(os.path.join(place, "bodies.h5"), "a") as file:
            # of neighbours and of a wall, whether they touch or not
            file["contacts/candidate"], file["contacts/antagonist"] = file["bodies/id"][:3], [*file["bodies/id"][1:3], -1]
            file["contacts/boundaries"] = np.array([f"wall {file['walls/id'][0]}".encode()])
            for name, row in (("normal", [0.0, 1.0]), ("force", [0.1, 1.0]), ("point", [0.0, 0.0])):
                file[f"contacts/{name}"] = [row] * 3
        cases = os.path.join(self.directory, "cases")
        for name, dimension, bodies in (("h2", 2, "csv2"), ("h3", 3, "csv3")):
            self.must(alone([program("gravier"), bodies + ".nml"], cases))
            os.replace(os.path.join(cases, "results/final_bodies.h5"), os.path.join(place, name + ".h5"))
            shutil.rmtree(os.path.join(cases, "results"))
            write(os.path.join(place, name + ".nml"), namelist(self.start_case(dimension, name + ".h5")))
        write(os.path.join(place, "h1.nml"), namelist(merged(self.start_case(2, "bodies.h5"), {"boundary": []})))
        from bit_flips import READER
        write(os.path.join(place, "reader.py"), f"import sys\nsys.path.insert(0, {os.path.join(SOURCE, 'drivers/python')!r})\n" + READER.replace(
            'f"{reason}', 'f"reader: {reason}'))

    def make_problems(self, place):
        os.makedirs(place)
        w = np.eye(6) + 0.1
        q, mu = np.array([-1.0, 0.2, 0.1, -2.0, 0.3, 0.0]), np.array([0.3, 0.4])
        for form in ("rows", "columns", "triplets"):
            write_local(os.path.join(place, form + ".hdf5"), w, q, mu, form)
        write_local(os.path.join(place, "plane.hdf5"), np.eye(4) + 0.1, q[:4], mu, dimension=2)
        write_local(os.path.join(place, "constraints.hdf5"), w, q, mu, constraints=(np.full((6, 1), 0.1), np.array([[2.0]]), np.array([0.1])))
        run_place = os.path.join(place, "run")
        os.makedirs(run_place)
        write(os.path.join(run_place, "case.nml"), namelist(merged(BOX, {"scene": {"lattice_count": [3, 2]}, "time": {"steps": 2},
                                                                          "solver": {"method": "nlgs"}, "decomposition": {"subdomains": 1},
                                                                          "output": {"fclib_step": 2, "every": 0}})))
        self.must(alone([program("gravier"), "case.nml"], run_place))
        shutil.copy(os.path.join(run_place, "results/step_2.hdf5"), os.path.join(place, "global.hdf5"))
        shutil.rmtree(run_place)

    @staticmethod
    def must(said):
        if said.status != 0:
            raise AssertionError(f"{said.status}: {said.stderr}{said.stdout[-300:]}")

    def fill(self, place, source):
        shutil.copytree(os.path.join(self.directory, source), place, symlinks=True)

    def change_text(self, draw, path, words=(), others=()):
        write(path, mutate_text(draw, read(path), words, others))

    def change_csv(self, draw, path, words=()):
        if draw.random() < 0.5:
            try:
                write(path, mutate_table(draw, read(path).decode()))
                return
            except (ValueError, IndexError):
                pass
        self.change_text(draw, path, words)

    # ---- the trials

    def trial_namelist(self, draw, place):
        self.fill(place, "cases")
        name = draw.choice(list(self.cases))
        path, same = os.path.join(place, name), False
        if draw.random() < 0.55:
            text, same = mutate_namelist(draw, self.cases[name], self.keys)
            write(path, text)
        else:
            self.change_text(draw, path, self.words, [text.encode() for text in self.cases.values()])

        def check(said):
            problems = not_in_force(read(path).decode(errors="replace"), said)
            if same and not problems and self.base(name) != in_force(said.stdout):
                problems = ["what is in force is not what was"]
            return problems
        return Trial([program("gravier"), "--check", name], self.files_of(name), check, (0, 2, 4), same)

    def files_of(self, name):
        """A message on a case may name a file that it reads."""
        return (name, "bodies.csv", "spheres.csv", "gravity.csv", "drive.csv", "radii.csv", "data/", "&scene bodies_file", *EXTREMES)

    def base(self, name):
        if name not in self.good:
            said = alone([program("gravier"), "--check", name], os.path.join(self.directory, "cases"))
            self.must(said)
            self.good[name] = in_force(said.stdout)
        return self.good[name]

    def trial_bodies_csv(self, draw, place):
        self.fill(place, "cases")
        case, name = draw.choice((("csv2.nml", "bodies.csv"), ("csv2.nml", "bodies.csv"), ("csv3.nml", "spheres.csv")))
        path = os.path.join(place, name)
        self.change_csv(draw, path, ("grain", "plane", "id", "x", "radius", "vx", "mass", "group"))

        def check(_):
            return not_read(csv_bodies(path), hdf5_bodies(os.path.join(place, "results/final_bodies.h5")))
        return Trial([program("gravier"), case], (name, case), check, (0, 2, 4))

    def trial_bodies_hdf5(self, draw, place):
        self.fill(place, "run")
        name = draw.choice(("h1", "h2", "h3"))
        file = {"h1": "bodies.h5"}.get(name, name + ".h5")
        path = os.path.join(place, file)
        mutate_hdf5(draw, path)

        def check(_):
            try:
                given = hdf5_bodies(path)
            except (OSError, KeyError, TypeError, ValueError) as reason:
                return [f"Python does not read it: {reason!r}"]
            return not_read(given, hdf5_bodies(os.path.join(place, "results/final_bodies.h5")))
        shutil.rmtree(os.path.join(place, "results"))
        return Trial([program("gravier"), name + ".nml"], (file, name + ".nml"), check, (0, 2, 4))

    def trial_checkpoint(self, draw, place):
        self.fill(place, "run")
        mutate_hdf5(draw, os.path.join(place, "results/checkpoint.h5"))
        return Trial([program("gravier"), "--restart", "on.nml"], ("results/", "on.nml", "step "),
                     lambda _: not_finite(os.path.join(place, "results/results.h5")), (0, 2, 3, 4))

    def trial_restart(self, draw, place):
        """What a run adds to: results, tables and pictures."""
        self.fill(place, "run")
        name = draw.choice(("results.h5", "results.h5", "history.csv", "trace.csv", "bodies.vtkhdf", "contacts.vtkhdf"))
        path = os.path.join(place, "results", name)
        if name.endswith(".csv"):
            self.change_csv(draw, path)
        else:
            mutate_hdf5(draw, path)
        return Trial([program("gravier"), "--restart", "on.nml"], ("results/", "on.nml"), lambda _: self.went_on(place), (0, 2))

    def went_on(self, place):
        """The states after the restart are those of a restart from undamaged files."""
        if "states" not in self.good:
            other = place + " good"
            self.fill(other, "run")
            self.must(alone([program("gravier"), "--restart", "on.nml"], other))
            self.good["states"] = self.last_state(other)
            shutil.rmtree(other)
        return [f"after the restart another {name}" for name in differences(self.last_state(place), self.good["states"])[:1]]

    @staticmethod
    def last_state(place):
        """The state of the last step, and the table of all of them, which is read as a whole; of older states no run reads all."""
        for name in ("history", "trace"):
            read_csv(os.path.join(place, "results", name + ".csv"))
        found = {}
        with h5py.File(os.path.join(place, "results/results.h5"), "r") as file:
            file["steps/6"].visititems(lambda name, item: found.update({name: item[()]} if isinstance(item, h5py.Dataset) else {}))
        return found

    def trial_table(self, draw, place):
        self.fill(place, "cases")
        case, name = draw.choice((("laws", "drive.csv"), ("enriched", "gravity.csv"), ("sample", "radii.csv")))
        path = os.path.join(place, name)
        self.change_csv(draw, path, ("time", "vx", "fx", "gx", "gz", "radius", "share"))

        def check(_):
            """The table as Python reads it, written anew, gives the same run."""
            found = kept(os.path.join(place, "results"))
            names, rows = table_rows(read(path).decode("utf-8", errors="surrogateescape"))
            write(path, "\n".join([",".join(names), *(",".join(repr(written(cell)) for cell in row) for row in rows)]) + "\n")
            again = alone([program("gravier"), case + ".nml"], place)
            if again.status != 0:
                return [f"Python reads what is refused: {again.stderr[:200]!r}"]
            return [f"Python reads other numbers: {one}" for one in differences(found, kept(os.path.join(place, "results")))[:1]]
        return Trial([program("gravier"), case + ".nml"], (name, case + ".nml", "step "), check, (0, 2, 3, 4))

    def trial_fclib(self, draw, place):
        self.fill(place, "problems")
        name = draw.choice(sorted(os.listdir(place)))
        path = os.path.join(place, name)
        mutate_hdf5(draw, path)

        def check(_):
            return not_finite(os.path.join(place, "out", name))
        return Trial([program("gravier_fclib"), "--max-iterations", "2000", "--write", "out", name], (name,), check, (0, 2, 3, 4))

    def trial_results(self, draw, place):
        self.fill(place, "run")
        mutate_hdf5(draw, os.path.join(place, "results/results.h5"))
        return Trial([os.path.join(place, "reader.py"), "results"], ("results",))

    def trial_plot(self, draw, place):
        self.fill(place, "run")
        name = draw.choice(("results.h5", "history.csv", "trace.csv"))
        path = os.path.join(place, "results", name)
        if name.endswith(".csv"):
            self.change_csv(draw, path)
        else:
            mutate_hdf5(draw, path)
        what = "packing" if name == "results.h5" else "history" if name == "history.csv" else "convergence"
        return Trial(["gravier_plot", what, "results", "--out", "a.png"], ("results",))

    def trial_import(self, draw, place):
        self.fill(place, "boxes")
        name = draw.choice(sorted(os.listdir(os.path.join(place, "DATBOX"))))
        self.change_text(draw, os.path.join(place, "DATBOX", name))
        return Trial(["gravier_import", "DATBOX", "--step", "1e-3", "--steps", "2", "--out", "case"], ("DATBOX", "case", "gravier --check"),
                     None, (0, 2))

    def trial_study(self, draw, place):
        self.fill(place, "cases")
        name = draw.choice(("study.nml", "study.nml", "study_case.nml"))
        path = os.path.join(place, name)
        if draw.random() < 0.5:
            write(path, mutate_namelist(draw, read(path).decode(), self.keys + [("study", key) for key in STUDY_KEYS] + [("variant", "name")])[0])
        else:
            self.change_text(draw, path, self.words)
        self.bound(path)
        return Trial([program("gravier_accuracy"), "study.nml"], ("study", "step ", *self.files_of(name)), None, (0, 2, 3, 4))

    def trial_sample(self, draw, place):
        self.fill(place, "cases")
        path = os.path.join(place, "sample.nml")
        text = self.cases["sample.nml"]
        if draw.random() < 0.5:
            write(path, mutate_namelist(draw, text, self.keys)[0])
        else:
            self.change_text(draw, path, self.words)
        self.bound(path)
        return Trial([program("gravier_sample"), "sample.nml"], self.files_of("sample.nml") + ("step ",), None, (0, 2, 3, 4))

    @staticmethod
    def bound(path):
        """Numbers that ask for hours of work become smaller."""
        text = read(path)
        write(path, re.sub(rb"(?<![\d.eEdD+-])\d{4,}(?![\d.eEdD])", b"77", text))

    def trial_job(self, draw, place):
        self.fill(place, "cases")
        name = draw.choice(("list.csv", "list.csv", "template.nml"))
        self.change_csv(draw, os.path.join(place, name), ("@run@", "@mu@", "@tag@", "@none@", "mu"))
        return Trial(["/usr/bin/env", "GRAVIER_LAUNCH=env", "GRAVIER_PROGRAM=true", "sh", program("gravier_job"), "--list", "list.csv", "template.nml"],
                     (), None, (0, 2))

    def trial_command(self, draw, place):
        self.fill(place, "cases")
        words = ["laws.nml", "space.nml", "sample.nml", "study.nml", "nothing.nml", "bodies.csv", "results", "", " ", "-", "--", "---", ".", "/",
                 "/dev/null", "a b.nml", "é.nml", "x" * 300, "x" * 5000, "list.csv", "problems", *EXTREMES]
        words = [word for word in words if "\x00" not in word]
        name, options = draw.choice(list(COMMANDS.items()))
        own = [option for option in options.split() if option.startswith("-")]
        given = [word for word in options.split() if not word.startswith("-")]
        line = []
        for _ in range(draw.choice((0, 1, 1, 2, 2, 3, 4, 6))):
            if own and draw.random() < 0.6:
                line.append(draw.choice(own))
                if draw.random() < 0.7:
                    line.append(draw.choice(words + 3 * given))
            else:
                line.append(draw.choice(words + 2 * given))
        if draw.random() < 0.2 and line:
            k = draw.randrange(len(line))
            line[k] = draw.choice((line[k] + "=1", line[k][:-1], line[k].upper(), line[k] + "x"))
        # none that measures for minutes
        line = [word if not re.fullmatch(r"\+?0*\d{4,18}", word) else "50" for word in line]
        if name == "gravier_bench" and not set(line) & {"--kernel", "--help", "-h"}:
            line.append("--nothing")
        if name == "gravier_bench" and "--kernel" in line:
            line = [word if word != "--contacts" else "--sweeps" for word in line]
        start = [name] if name in SCRIPTS else [program(name)]
        return Trial(["/usr/bin/env", "GRAVIER_LAUNCH=env", "GRAVIER_PROGRAM=true", "sh", program(name), *line] if name == "gravier_job" else start + line,
                     (), None, (0, 2, 3, 4))


STUDY_KEYS = ("title", "case", "directory", "kind", "vary", "values", "reference", "samples", "repeats", "quantities")
#: programs with their options and words that these take
COMMANDS = {
    "gravier": "--check --restart --help -h --version --keys laws.nml enriched.nml",
    "gravier_sample": "--help --version -h sample.nml",
    "gravier_fclib": "--method --tolerance --max-iterations --warm --csv --profile --write --help auto nlgs momentum newton all nlgs,newton 1e-3 10",
    "gravier_accuracy": "--help --version study.nml",
    "gravier_columns": "--out --count --subdomains --tolerance --help 5 2 1e-3",
    "gravier_bench": "--quick --csv --rounds --seconds --contacts --spheres --iterations --triad --kernel --sweeps --recording --help 2 10",
    "gravier_error": "--out --situations --iterations --steps --every --rest --tight --limit --sweeps --help error.nml cold lost:0.5 turned:10 1,2 program 2",
    "gravier_import": "--step --steps --out --period --planes --slip --help DATBOX 1e-3 10 case",
    "gravier_plot": "--out --help packing history convergence movie --colour --chains --step results speed",
    "gravier_job": "--seconds --ranks --fresh --list --row --help laws.nml list.csv template.nml 1 2 10",
}
#: of each hundred trials
SHARES = {"namelist": 30, "bodies_csv": 12, "bodies_hdf5": 14, "checkpoint": 10, "restart": 6, "table": 7, "fclib": 8, "results": 2, "plot": 0.5,
          "import": 2, "study": 2, "sample": 2, "job": 1.5, "command": 3}

KINDS = None


def one_trial(task):
    """(kind, number, end, problems, directory that is kept)."""
    kind, seed, trial_number, root, keep = task
    draw = random.Random(f"{seed} {kind} {trial_number}")
    place = os.path.join(root, f"at {os.getpid()}")
    shutil.rmtree(place, ignore_errors=True)
    # numpy has a generator of its own
    trial = getattr(KINDS, "trial_" + kind)(draw, place)
    before = place + " before"
    if keep:
        shutil.rmtree(before, ignore_errors=True)
        shutil.copytree(place, before, symlinks=True)
    said = run(trial.command, place)
    try:
        problems = problems_of(trial, said, place)
    except Exception:  # of the check: Python reads what a program takes otherwise, or not at all
        problems = [f"the check: {traceback.format_exc(limit=-2).strip().splitlines()[-1]}"]
    if problems and keep:
        kept_at = os.path.join(keep, f"{kind} {seed} {trial_number}")
        shutil.rmtree(kept_at, ignore_errors=True)
        shutil.copytree(before, kept_at, symlinks=True)
        write(os.path.join(kept_at, "FINDING"), "\n".join([
            f"python3 tests/hard/fuzz_inputs.py --kinds {kind} --seed {seed} --only {trial_number}", repr(trial.command), *problems,
            f"status {said.status}", said.stderr, said.stdout]).encode(errors="replace"))
    shutil.rmtree(place, ignore_errors=True)
    return kind, trial_number, f"status {said.status}", problems


def fuzz(seed, count, directory, kinds=None, keep=None, workers=2, only=None):
    """`count` trials over all kinds; a figure a kind."""
    global KINDS
    os.environ["GRAVIER_PYTHON"] = "/bin/true"  # no figures
    KINDS = Kinds(os.path.join(directory, "source"))
    shares = {kind: SHARES[kind] for kind in kinds or SHARES}
    numbers = {kind: range(max(1, round(count * share / sum(shares.values())))) for kind, share in shares.items()}
    if only is not None:
        numbers = {kind: [only] for kind in shares}
    tasks = [(kind, seed, one, directory, keep) for kind, ones in numbers.items() for one in ones]
    # those that take long are not the last ones
    random.Random(seed).shuffle(tasks)
    figures = {kind: Figure(f"fuzz, {kind}") for kind in shares}
    with multiprocessing.get_context("fork").Pool(workers) as pool:
        # a command that is interrupted has figures of what it did
        with contextlib.suppress(KeyboardInterrupt):
            for kind, one, end, problems in pool.imap_unordered(one_trial, tasks, chunksize=4):
                figures[kind].note(end, f"--kinds {kind} --seed {seed} --only {one}", problems)
                done = sum(figure.trials for figure in figures.values())
                if done % 1000 == 0:
                    print(f"fuzz: {done} of {len(tasks)} trials", flush=True)
    return list(figures.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", choices=SHARES)
    parser.add_argument("--only", type=int, help="the number of one trial")
    parser.add_argument("--keep", default="findings", help="directory of what is found")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    directory = tempfile.mkdtemp(prefix="gravier-fuzz-", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None)
    started = time.monotonic()
    try:
        figures = fuzz(options.seed, options.count, directory, options.kinds, os.path.abspath(options.keep), options.workers, options.only)
    finally:
        shutil.rmtree(directory, ignore_errors=True)
    for figure in figures:
        print(figure)
    wrong = sum(len(figure.wrong) for figure in figures)
    print(f"fuzz: {sum(figure.trials for figure in figures)} trials, seed {options.seed}, {time.monotonic() - started:.0f} s, {wrong} wrong")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
