"""Every message of the program is provoked once: those of the sources are collected, and each is found in what the runs of this file say,
or in what another test expects, or stands in the list of those that no input brings about, with the reason. What is asked of a message:
it names the file or the key, what was found and what was expected, or what to do."""
import os
import re
import subprocess
from pathlib import Path

import h5py
import numpy as np

from gravier_runs import PATIENCE, PROGRAMS, SOURCE, RunTestCase, alone_environment, merged, namelist, write

CASE = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [4, 3], "radius_min": 0.01, "radius_max": 0.01},
    "time": {"step": 1e-3, "steps": 2},
    "output": {"directory": "results", "checkpoint_every": 1},
}
PLANE = {"shape": "plane", "normal": [0.0, 1.0]}
STUDY = "&study title = 's', case = 'case.nml', kind = 'run', vary = 'tolerance', values = 1e-3, 1e-4 /\n"

#: messages that no input brings about, by a text of theirs: why
UNPROVOKED = {
    "cells in a group of subdomains; expected at most": "more than 2^31 entries of a graph",
    "the interface has more than 2^31 unknowns": "an interface of that size",
    "graph partition (METIS) failed": "within METIS",
    "cannot create this HDF5 file": "within HDF5: the directory is checked before",
    "cannot start the HDF5 library": "within HDF5",
    ": cannot close this file": "within the file system",
    "cannot write to this file: is the disk full?": "within HDF5; a full disk is met by test_run_full_disk at other places",
    "table of keys: default of": "a mistake in config_table.f90",
    "could be started": "a system without a shell",
    "motion of boundary": "numbers of the input are bounded; speeds that overflow are met first",
    'refuse("largest overlap")': "as the motion of boundaries",
    'refuse("residual")': "as the motion of boundaries",
    'refuse("jump")': "as the motion of boundaries",
    "not a finite number; expected speeds": "as the motion of boundaries",
    "cannot read this dataset": "within HDF5",
    "cannot remove this group": "within HDF5",
    '"boundary \'"//boundary%name//"\': "//name//" "//text': "made of the name of a boundary and of messages that are expected by themselves",
    "cannot copy ": "within HDF5",
    "cannot cut this table": "within HDF5",
    "cannot write rows of this table: is the disk full?": "within HDF5; a full disk is met by test_run_full_disk at other places",
}

CALL = re.compile(r"\bcall\s+(?:\w+%)*(raise|refuse|expect|fail|complain)\s*\(", re.I)
KEY = re.compile(r'"(\w+)", "(\w+)", error')
LITERAL = re.compile(r"\"((?:[^\"]|\"\")*)\"|'((?:[^']|'')*)'")


def statements(path):
    """Statements of a Fortran file without comments, continued lines joined: (line, text)."""
    text, first = "", 0
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        code = re.match(r"(?:[^\"'!]|\"[^\"]*\"|'[^']*')*", line)[0].strip()
        if not code:
            continue
        first = first if text else number
        text += code.removeprefix("&") if text else code
        if text.endswith("&"):
            text = text[:-1]
            continue
        yield first, text
        text = ""


def literals(text):
    return [a or b for a, b in LITERAL.findall(text)]


def sites():
    """Where messages are made: (place, name of the procedure, statement from its call on)."""
    for folder in ("modules", "src", "drivers"):
        for path in sorted(path for ending in ("*.[fF]90", "*.fypp", "*.fypi") for path in Path(SOURCE, folder).rglob(ending)):
            for line, text in statements(path):
                found = CALL.search(text)
                if found:
                    yield f"{path.relative_to(SOURCE)}:{line}", found[1], text[found.start():]


def worded(text):
    """Literals of several words."""
    return [part for part in literals(text) if re.search(r"[a-zA-Z]{2,}.*[a-zA-Z]{2,}", part) and " " in part.strip()]


class Messages(RunTestCase):
    said = ""

    def run_program(self, *arguments, program="gravier", status=2, directory=None):
        """What a program says on its standard error; it ends with the status."""
        with alone_environment() as environment:
            done = subprocess.run([os.path.join(PROGRAMS, program), *arguments], cwd=directory or self.scratch, capture_output=True, text=True,
                                  env=environment, timeout=PATIENCE, check=False)
        with self.subTest(program, arguments=arguments):
            self.assertEqual(done.returncode, status, f"{done.stdout[-500:]}{done.stderr}")
        type(self).said += done.stderr
        return done.stderr

    def refuse(self, text, *words, arguments=("--check",)):
        write(self.here("bad.nml"), text)
        said = self.run_program(*arguments, "bad.nml")
        self.assertEqual(said.count("gravier: error:"), 1, said)
        self.has(said, words)

    def has(self, said, words):
        for word in words:
            with self.subTest(word):
                self.assertIn(word, said)

    def provoke_cases(self):
        def bad(*parts):
            return namelist(merged(CASE, *parts))
        for name, value, also in (("edge_a", [0.0, 0.0, 0.0], {"edge_b": [0.0, 1.0, 0.0]}), ("edge_b", [0.0, 0.0, 0.0], {"edge_a": [1.0, 0.0, 0.0]})):
            self.refuse(bad({"scene": {"dimension": 3, "lattice_count": [2, 2, 2]}, "boundary": {"shape": "rectangle", name: value, **also}}), name)
        self.refuse(bad({"scene": {"dimension": 3, "lattice_count": [2, 2, 2]}, "boundary": {"shape": "cylinder", "radius": 1.0, "axis": [0.0, 0.0, 0.0]}}),
                    "axis = 0.0", "expected")
        self.refuse(bad({"boundary": {**PLANE, "normal": [0.0, 0.0]}}), "normal = ", "expected")
        self.refuse(bad({"scene": {"period": [0.01, 0.0]}}), "&scene period: expected at least", "the width of the lattice")
        self.refuse("&scene bodies = 'file', bodies_file = 'pair.csv', period = 0.22, 0.0 /\n&time step = 1e-3, steps = 1 /\n",
                    "&scene period: expected more than", "two diameters of the largest grain")
        self.refuse(bad({"scene": {"lattice_count": [100000, 100000]}}), "expected at most 2147483647 bodies")
        self.refuse(bad({"scene": {"friction": -1.0}}), "&scene friction = -1.0: expected a finite real number >= 0")
        for group, prefix in (("scene", ""), ("scene", "wall_"), ("boundary", "")):
            for name in ("friction", "restitution", "tangential_restitution", "rolling_friction", "pivoting_friction"):
                given = {**(PLANE if group == "boundary" else {}), prefix + name: -1.0}
                self.refuse(bad({group: given}), f"&{group}", f"{prefix}{name} = -1.0: expected")
        self.refuse(bad({"material": {"name": "glass"}, "law": {"materials": "glass", "kind": "coulomb", "friction": -1.0}}),
                    "&law", "friction = -1.0: expected a finite real number >= 0")
        self.refuse(bad({"scene": {"bodies": "sample", "lattice_count": None, "radius_min": None, "radius_max": None},
                         "sample": {"count": 10, "radius": 0.01, "box": [0.01, 0.0]}}), "&sample box", "the largest grain has a diameter")
        self.refuse(bad({"boundary": {**PLANE, "free": [False, True], "mass": 0.0}}), "mass = 0.0", "expected a finite real number > 0")
        feed = {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}
        for given in ({"radii": "table", "radius_table": ""}, {"radii": "uniform", "radius_min": 0.0, "radius_max": 1.0},
                      {"radii": "uniform", "radius_min": 1.0, "radius_max": 0.0},
                      {"radii": "log_normal", "radius_min": 1.0, "radius_max": 1.0, "radius_deviation": 0.1, "radius_mean": 0.0},
                      {"radii": "log_normal", "radius_min": 1.0, "radius_max": 1.0, "radius_mean": 1.0, "radius_deviation": 0.0}):
            name, value = next((name, value) for name, value in given.items() if value in ("", 0.0))
            self.refuse(bad({"insertion": {**feed, **given}}), f"&insertion (the 1st) {name} = {value!r}: expected")
        self.refuse(bad({"insertion": {"lower": [1e9, 0.0], "upper": [1.1e9, 1.0], "radius": 0.01}}),
                    "&insertion 'insertion 1': a region as far as 1.100E+09 m from the origin: expected at most")
        write(self.here("radii.csv"), "radius,share\n1e-200,1\n")
        self.refuse(bad({"scene": {"bodies": "sample", "lattice_count": None, "radius_min": None, "radius_max": None},
                         "sample": {"count": 10, "radii": "table", "radius_table": "radii.csv", "box": [1.0, 0.0]}}),
                    "radii.csv: line 2: column radius", "from 1e-30")

    def provoke_bodies(self):
        for text, *words in (("id,shape,x,y,radius\n1,plane,0,0,\n", "a plane needs the columns nx"), ("id,x,y,radius\n0,0,0,1\n", "an id >= 1"),
                             ("id,x,y,radius\n1,here,0,1\n", '"here", but a', "number was expected")):
            write(self.here("bodies.csv"), text)
            self.refuse("&scene bodies = 'file', bodies_file = 'bodies.csv' /\n&time step = 1e-3, steps = 1 /\n", "bodies.csv: line 2", *words)
        write(self.here("bodies.csv"), "id,x,y,radius,material\n1,0,0,1,2\n")
        self.refuse("&scene bodies = 'file', bodies_file = 'bodies.csv' /\n&time step = 1e-3, steps = 1 /\n",
                    "bodies.csv: id 1: material 2: expected 1, since bad.nml has no &material")
        for position, word in (([[0.0, 0.0]], "1 rows, but /bodies/id has 2"), ([[0.0, 0.0], [np.nan, 0.0]], "id 2: NaN or infinity"),
                               ([[b"a", b"b"]] * 2, "not made of numbers")):
            with h5py.File(self.here("bodies.h5"), "w") as file:
                file["bodies/id"], file["bodies/position"], file["bodies/radius"] = [1, 2], np.array(position), [1.0, 1.0]
            self.refuse("&scene bodies = 'file', bodies_file = 'bodies.h5' /\n&time step = 1e-3, steps = 1 /\n", "bodies.h5: /bodies/position", word)

    def provoke_shapes(self):
        write(self.here("bodies.csv"), "id,x,y,shape\n1,0,0,a\n")
        disk = "disk 0 0 1\n"
        for text, *words in (("", "no shapes: expected shape and a name, then its pieces"),
                             ("shape plane\n" + disk, "line 1: shape plane: expected another name", "stand for themselves in bodies files"),
                             ("shape a\nrounding 0\n" + disk, "line 2: rounding 0.00000000E+00: expected a number from 1e-30"),
                             ("shape a\npolygon 0 0 1 0 2 0\n", "line 2: shape a: a polygon without area")):
            write(self.here("a.shapes"), text)
            self.refuse("&scene bodies = 'file', bodies_file = 'bodies.csv', shapes = 'a.shapes' /\n&time step = 1e-3, steps = 1 /\n",
                        "a.shapes: ", *words)

    def provoke_restarts(self):
        write(self.here("case.nml"), namelist(CASE))
        self.run_program("case.nml", status=0)
        for change, words in (({"time": {"step": 2e-3}}, ("&time step", "expected 1.0")), ({"time": {"theta": 1.0}}, ("&time theta", "expected 5.0")),
                              ({"scene": {"rotation": False}}, ("the scene is not that of", "expected", "final_bodies.h5, or a file of gravier.write_bodies")),
                              ({"scene": {"friction": 0.7}}, ("the scene is not that of", "expected", "gravier --restart --changed, which goes on with the new value")),
                              ({"time": {"steps": 1}}, ("steps",))):
            self.refuse(namelist(merged(CASE, change)), *words, arguments=("--restart",))
        for spoil, words in ((lambda steps: steps.move("1", "first"), ('/steps: a member "first"', "numbers of steps were expected")),
                             (lambda steps: steps["1"].attrs.modify("step", 7), ("/steps/1: step 7 inside",)),
                             (lambda steps: steps.file.pop("steps"), ("/steps: missing", "the results of a run were expected"))):
            self.run_program("case.nml", status=0)
            with h5py.File(self.here("results", "results.h5"), "r+") as file:
                spoil(file["steps"])
            self.has(self.run_program("--restart", "case.nml"), words)
        self.run_program("case.nml", status=0)
        with open(self.here("results", "history.csv"), encoding="ascii") as file:
            rows = file.read().splitlines()
        write(self.here("results", "history.csv"), "\n".join([rows[0], "x" + rows[1], rows[2]]) + "\n")
        self.assertIn("history.csv: line 2", self.run_program("--restart", "case.nml"))
        write(self.here("case.nml"), namelist(merged(CASE, {"output": {"vtk": True}})))
        self.run_program("case.nml", status=0)
        with h5py.File(self.here("results", "bodies.vtkhdf"), "r+") as file:
            del file["VTKHDF/PointData/radius"]
        self.assertIn("bodies.vtkhdf: no field radius, but one was expected", self.run_program("--restart", "case.nml"))
        write(self.here("case.nml"), namelist(CASE))

    def provoke_studies(self):
        for text, words in (
                ("&variant name = 'a' /\n", ("group &study is missing",)),
                (STUDY.replace("'case.nml'", "''"), ("&study case = ''", "expected the path of a case")),
                (STUDY.replace("kind =", "directory = '', kind ="), ("expected a directory",)),
                (STUDY.replace("1e-3, 1e-4", "''"), ("expected",)),
                (STUDY.replace("values = 1e-3, 1e-4", "values ="), ("expected values, with commas between",)),
                (STUDY.replace("kind =", "quantities = energy, kind ="), ("expected texts in quotes, with commas between",)),
                (STUDY.replace("'run'", "'walk'"), ("expected 'solve' or 'run'",)),
                (STUDY + "&variant name = '' /\n", ("expected a name",)),
                (STUDY + "&variant sweeps = 2 /\n", ("&variant (number 1) name is missing",)),
                (STUDY.replace("case = 'case.nml', ", ""), ("&study case",)),
                (STUDY.replace("'tolerance'", "'steps'"), ("expected a key of a case, but of &output, &boundary, &sample, &material, &law, &insertion or &region, and not 'steps'",)),
                (STUDY.replace("'tolerance', values = 1e-3, 1e-4", "'step', values = 7e-4"), ("expected steps that divide the duration",))):
            write(self.here("study.nml"), text)
            self.has(self.run_program("study.nml", program="gravier_accuracy"), words)

    def provoke_programs(self):
        self.assertIn("expected the name of a kernel", self.run_program("--kernel", "", program="gravier_bench"))
        self.assertIn("--csv", self.run_program("--csv", "/proc/nowhere/bench.csv", program="gravier_bench"))
        with h5py.File(self.here("singular.hdf5"), "w") as file:
            problem = file.create_group("fclib_global")
            problem["spacedim"] = [2]
            for name, rows, columns, entries in (("M", 2, 2, [(0, 0, 1.0)]), ("H", 2, 2, [(0, 0, 1.0), (1, 1, 1.0)])):
                matrix = problem.create_group(name)
                matrix["m"], matrix["n"], matrix["nz"], matrix["nzmax"] = [rows], [columns], [len(entries)], [len(entries)]
                matrix["i"], matrix["p"] = [e[0] for e in entries], [e[1] for e in entries]
                matrix["x"] = [e[2] for e in entries]
            for name, values in (("f", [0.0, 0.0]), ("w", [0.0, 0.0]), ("mu", [0.3])):
                problem[f"vectors/{name}"] = np.array(values)
        self.assertIn("expected a regular one", self.run_program("singular.hdf5", program="gravier_fclib"))
        self.has(self.run_program("singular.hdf5", "--csv", "./singular.hdf5", program="gravier_fclib"),
                 ("./singular.hdf5: expected another file for a table than the problem singular.hdf5",))
        self.has(self.run_program("singular.hdf5", "--csv", "t.csv", "--profile", "./t.csv", program="gravier_fclib"),
                 ("./t.csv: expected a file of its own for each of --csv, --profile and the problems of --write",))
        self.has(self.run_program("singular.hdf5", "--csv", "table.nml", program="gravier_fclib"),
                 ("table.nml: expected a name that ends in .csv, as it becomes a table",))
        write(self.here("notes.csv"), "mine\n")
        self.has(self.run_program("singular.hdf5", "--csv", "notes.csv", program="gravier_fclib"),
                 ("notes.csv: there is something else, which is not replaced; expected the name of no file, or of a table that this program has made",))

    def test_every_message_is_provoked(self):
        write(self.here("pair.csv"), "id,x,y,radius\n1,0.05,0.05,0.05\n2,0.16,0.05,0.05\n")
        self.provoke_cases()
        self.provoke_bodies()
        self.provoke_shapes()
        self.provoke_restarts()
        self.provoke_studies()
        self.provoke_programs()
        tests = {path: path.read_text(encoding="utf-8") for kind in ("*.py", "*.f90") for path in Path(SOURCE, "tests").rglob(kind)
                 if path.name != Path(__file__).name}
        everything = "\n".join(tests.values())
        expected = {part for text in tests.values() for part in literals(text) if len(part) >= 8}
        found = list(sites())
        self.assertGreater(len(found), 280)
        every_literal = [part for _, _, text in found for part in worded(text)]
        unknown, used = [], set()
        for place, procedure, text in found:
            reasons = [fragment for fragment in UNPROVOKED if fragment in text]
            if self.is_said(text, procedure, everything):
                continue
            # a word that another test expects of something else may stand in a message that nothing brings about
            used.update(reasons)
            if self.is_expected(text, expected, every_literal):
                continue
            if procedure == "expect" and KEY.search(text):
                self.provoke_key(*KEY.search(text).groups())
            elif not reasons:
                unknown.append(f"{place}: {text[:150]}")
        self.assertEqual(unknown, [], "messages that no test provokes:\n" + "\n".join(unknown))
        self.assertEqual(sorted(set(UNPROVOKED) - used), [], "reasons of messages that are not there, or that a test provokes")

    def provoke_key(self, group, key):
        """Give a key that no other test gives a bad value the value -1, which no range has."""
        parts = {"boundary": {"boundary": {**PLANE, key: -1}}}.get(group, {group: {key: -1}})
        write(self.here("bad.nml"), namelist(merged(CASE, parts)))
        self.has(self.run_program("--check", "bad.nml"), (f"{key} = -1: expected",))

    def is_said(self, text, procedure, everything):
        """Whether a line of this file's runs has the literals of the statement in their order, or a test gives the key a bad value."""
        parts = [part for part in literals(text) if re.search(r"\w", part)]
        keys = KEY.search(text)
        if procedure == "expect" and keys:
            group, key = keys[1], keys[2]
            return bool(re.search(rf'key\("{group}", "{key}"|boundary_key\("{key}"|&{group}(?: \([^)]*\))? {key}\b', everything + self.said))
        # messages made of other messages alone are met wherever those are
        return not parts or bool(re.search(".*".join(map(re.escape, parts)), self.said))

    @staticmethod
    def is_expected(text, expected, every_literal):
        """Whether a test expects a part of one of the statement's literals that few others have, or all of it."""
        for part in worded(text):
            for wanted in expected:
                if wanted in part and sum(wanted in other for other in every_literal) <= 3:
                    return True
                if len(part) >= 12 and part.strip(" :;,'") in wanted:
                    return True
        return False


if __name__ == "__main__":
    import unittest
    unittest.main()
