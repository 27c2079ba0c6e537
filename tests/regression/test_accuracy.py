"""gravier_accuracy: tables and figures of small studies, errors judged again here, ranks, statuses and bad input; the order of
convergence of a bouncing ball, and the shipped studies parse."""
import csv
import glob
import math
import os
import pathlib
import re
import shutil
import unittest.mock

import matplotlib.pyplot  # noqa: F401
import numpy as np

import forked_scripts
from gravier_runs import LONG, SOURCE, RunTestCase, gravier, merged, namelist, run_case, write

BALL = """id,shape,x,y,radius,nx,ny
1,grain,0.0,0.21,0.01,,
2,plane,0.0,0.0,,0,1
"""
BALL_CASE = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "ball.csv", "wall_restitution": 0.7},
    "time": {"step": 0.01, "steps": 100},
    "solver": {"criterion": "residual", "tolerance": 1e-10, "check_every": 1},
}
COLUMN_CASE = {
    "scene": {"bodies": "column", "column_count": 8, "gravity": [0.0, -1.0]},
    "time": {"step": 1.0, "steps": 1},
    "solver": {"criterion": "error", "tolerance": 1e-6, "check_every": 1},
}
DISKS = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 8], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3,
              "alert_distance": 0.003, "seed": 2},  # of seed 1 one step of the reference ends in a cycle above 1e-6
    "time": {"step": 1e-3, "steps": 120},
    "solver": {"criterion": "residual", "tolerance": 1e-4, "max_iterations": 20000},
}
TIMES = ["solve_seconds", "solve_seconds_low", "solve_seconds_high", "run_seconds", "run_seconds_low", "run_seconds_high"]


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


class Studies(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        server = forked_scripts.Server(cls.scratch)
        cls.addClassCleanup(server.stop)
        #: draws figures in a copy of this program, which has what they import
        cls.python = server.interpreter(os.path.join(cls.scratch, "python3"))

    def study(self, title, case, study, *others, ranks=1, files=(), status=0, drawn=False):
        """Make a study of `case` in a directory of its own; its run and tables. Figures, which take longer than most studies, are drawn
        where they are looked at."""
        directory = self.here(title)
        os.makedirs(directory, exist_ok=True)
        for name, text in dict(files).items():
            write(os.path.join(directory, name), text)
        write(os.path.join(directory, "case.nml"), namelist(case))
        text = namelist({"study": {"case": "case.nml", "directory": "out", "repeats": 1, **study}})
        values = study.get("values")
        if isinstance(values, str):
            text = text.replace("'" + values + "'", values)
        write(os.path.join(directory, "study.nml"), text + "\n".join(others))
        with unittest.mock.patch.dict(os.environ, {"GRAVIER_PYTHON": self.python if drawn else "true"}):
            run = gravier("study.nml", ranks=ranks, directory=directory, program="gravier_accuracy")
        self.assert_status(run, status)
        if status == 2:
            return run, None, None
        return run, read(run.path("out", "accuracy.csv")), read(run.path("out", "accuracy_summary.csv"))

    def assert_figures(self, run):
        for name in ("accuracy.png", "accuracy.svg"):
            self.assertGreater(os.path.getsize(run.path("out", name)), 1000)


class BouncingBall(Studies):

    def test_order(self):
        """Positions are of first order in the step: Moreau-Jean is of first order where there are shocks, at any theta. Errors
        depend on where in a step a shock falls, by a factor of about 2: over six halvings of the step that bends a fitted slope by 0.2."""
        steps = ", ".join(repr(0.01 / 2**k) for k in range(7))
        run, rows, summary = self.study("ball", BALL_CASE, {"kind": "run", "vary": "step", "values": steps, "reference": "exact",
                                                            "samples": 50},
                                        "&variant name = 'half', theta = 0.5 /", "&variant name = 'one', theta = 1.0 /",
                                        files={"ball.csv": BALL}, drawn=True)
        orders = {row["variant"]: float(row["value"]) for row in summary if row["figure"] == "order_position"}
        self.assertEqual(sorted(orders), ["half", "one"])
        for variant, order in orders.items():
            self.assertTrue(0.8 <= order <= 1.2, f"{variant}: {order}")
            of = [row for row in rows if row["variant"] == variant]
            self.assertEqual([int(row["steps"]) for row in of], [100 * 2**k for k in range(7)])
            fit = np.polyfit([math.log(float(row["step"])) for row in of], [math.log(float(row["position_error"])) for row in of], 1)
            self.assertAlmostEqual(order, fit[0], places=9)
        self.assert_figures(run)

    def test_flight(self):
        """Before the first shock the mid-point rule is exact and implicit Euler is off by g h t/2, at the end g h T/2."""
        case = merged(BALL_CASE, {"time": {"steps": 10}})
        _, rows, _ = self.study("flight", case, {"kind": "run", "vary": "step", "values": "0.01, 0.005", "reference": "exact"},
                                "&variant name = 'half', theta = 0.5 /", "&variant name = 'one', theta = 1.0 /", files={"ball.csv": BALL})
        for row in rows:
            expected = 0.0 if row["variant"] == "half" else 9.81 * float(row["step"]) * 0.1 / 2
            self.assertAlmostEqual(float(row["position_error"]), expected, delta=1e-14)
            self.assertLess(float(row["velocity_error"]), 1e-14)

    def test_shocks(self):
        """The exact motion after two shocks, by another formula."""
        _, rows, _ = self.study("shocks", BALL_CASE, {"kind": "run", "vary": "step", "values": "0.01", "reference": "exact"},
                                "&variant name = 'half' /", files={"ball.csv": BALL})
        run = run_case(merged(BALL_CASE, {"output": {"every": 100}}), directory=self.here("shocks"))
        height = run.results()["/steps/100/bodies/position"][0, 1] - 0.01
        g, e, first = 9.81, 0.7, math.sqrt(2 * 0.2 / 9.81)
        speed, time = e * g * first, first
        while time + 2 * speed / g < 1.0:
            time += 2 * speed / g
            speed *= e
        exact = speed * (1.0 - time) - g * (1.0 - time)**2 / 2
        self.assertAlmostEqual(float(rows[0]["position_error"]), abs(height - exact), delta=1e-12)


class Columns(Studies):

    def test_solve(self):
        """One row a check; iterations as gravier's own trace has them."""
        run, rows, summary = self.study("solve", COLUMN_CASE, {"kind": "solve", "repeats": 3}, "&variant name = 'NLGS' /",
                                        "&variant name = 'NSCDD', method = 'nscdd', grid = 1, 2 /", drawn=True)
        trace = run_case(merged(COLUMN_CASE, {"output": {"trace": True}}), directory=self.here("trace")).trace()
        nlgs = [row for row in rows if row["variant"] == "NLGS"]
        self.assertEqual([int(row["iteration"]) for row in nlgs], list(trace["iteration"]))
        self.assertEqual([float(row["error"]) for row in nlgs], list(trace["error"]))
        self.assertEqual({row["subdomains"] for row in rows if row["variant"] == "NSCDD"}, {"2"})
        seconds = [float(row["seconds"]) for row in nlgs]
        self.assertTrue(seconds[0] >= 0.0 and all(low <= high for low, high in zip(seconds, seconds[1:])))
        for row in rows:
            self.assertLessEqual(float(row["seconds_low"]), float(row["seconds"]))
            self.assertTrue(row["machine"] and row["compiler"] and row["version"] and row["flags"] and row["date"])
        self.assertEqual({row["machine"] for row in summary}, {rows[0]["machine"]})
        found = {(row["variant"], row["figure"]): float(row["value"]) for row in summary}
        reached = next(int(row["iteration"]) for row in nlgs if float(row["error"]) <= 1e-3)
        self.assertEqual(found[("NLGS", "iterations_to_1e-3")], reached)
        self.assertNotIn(("NLGS", "iterations_to_1e-7"), found)
        self.assert_figures(run)

    def test_exact_column(self):
        """At rest a column does not move: the error of positions is how far it sinks, that of the impulses is known."""
        run, rows, _ = self.study("exact", COLUMN_CASE, {"kind": "run", "vary": "tolerance", "values": "1e-2, 1e-4, 1e-6",
                                                         "reference": "exact"},
                                  "&variant name = 'NLGS', criterion = 'residual' /", drawn=True)
        for error in ("position_error", "force_error"):
            errors = [float(row[error]) for row in rows]
            self.assertTrue(errors[0] > 10 * errors[1] > 100 * errors[2] > 0.0, errors)
        self.assertEqual({row["stress_error"] for row in rows}, {""})
        self.assert_figures(run)
        # without quantities to compare, the errors against the tolerance stand in the second panel
        with open(run.path("out", "accuracy.svg"), encoding="utf-8") as file:
            self.assertEqual(file.read().count("impulses, relative"), 2)

    def test_size(self):
        """The growth of plain NLGS on columns is quadratic; other scenes are compared with nothing."""
        _, rows, summary = self.study("size", COLUMN_CASE, {"kind": "run", "vary": "column_count", "values": "8, 16, 32"},
                                      "&variant name = 'NLGS', acceleration = 'none' /")
        self.assertEqual([int(row["grains"]) for row in rows], [8, 16, 32])
        self.assertEqual({row["position_error"] for row in rows}, {""})
        growth = next(float(row["value"]) for row in summary if row["figure"] == "growth_iterations")
        self.assertTrue(1.8 < growth < 2.2, growth)

    def test_unconverged(self):
        """Tables are written, the status is 3."""
        run, rows, _ = self.study("missed", COLUMN_CASE, {"kind": "solve"}, "&variant name = 'few', max_iterations = 5 /", status=3)
        self.assertEqual(len(rows), 6)
        self.assertIn("*** 1 of the solves did NOT reach their tolerance", run.stdout)

    def test_residual_and_overlap(self):
        """The column of the residual has that, where the velocity error ends solves, too; no two columns have one name."""
        case = merged(DISKS, {"solver": {"criterion": "velocity_error", "tolerance": 0.5}})
        run, rows, _ = self.study("columns of runs", case, {"kind": "run", "vary": "accuracy", "values": "10.0, 5.0", "samples": 1, "reference": "none", "quantities": ["max_overlap"]},
                                  "&variant name = 'NLGS' /")
        names = pathlib.Path(run.path("out", "accuracy.csv")).read_text(encoding="utf-8").splitlines()[0].split(",")
        self.assertEqual(len(names), len(set(names)))
        for row in rows:
            self.assertTrue(0.0 < float(row["residual"]) <= 0.5, row)
            self.assertGreater(float(row["largest_overlap"]), float(row["max_overlap"]))

    def test_summary_of_missed_solves(self):
        """The summary says of which variant, and of a reference, solves missed their tolerance."""
        case = merged(DISKS, {"time": {"steps": 60}, "solver": {"max_iterations": 2}})
        _, rows, summary = self.study("missed runs", case, {"kind": "run", "vary": "tolerance", "values": "1e9, 1e-6", "samples": 1, "quantities": ["pressure"]},
                                      "&reference tolerance = 1.0e-6 /", "&variant name = 'NLGS' /", status=3)
        missed = {(row["variant"], row["value"]): int(row["failed"]) for row in rows}
        found = {row["variant"]: int(float(row["value"])) for row in summary if row["figure"] == "failed_solves"}
        self.assertEqual(missed["NLGS", "1e9"], 0)
        self.assertGreater(missed["NLGS", "1e-6"], 0)
        self.assertEqual(found, {"NLGS": missed["NLGS", "1e-6"], "reference": missed["reference", ""]})


class Packing(Studies):
    ASKED = {"kind": "run", "vary": "tolerance", "values": "1e-1, 1e-2, 1e-3", "samples": 4, "knee": 0.02,
             "quantities": ["pressure", "kinetic_energy"]}
    VARIANTS = ["&reference tolerance = 1.0e-6 /", "&variant name = 'NLGS' /",
                "&variant name = 'NSCDD', method = 'nscdd', subdomains = 4, acceleration = 'momentum' /"]

    def test_errors_and_knee(self):
        """Errors are those of the states that gravier writes; the knee is what the table says."""
        run, rows, summary = self.study("packing", DISKS, self.ASKED, *self.VARIANTS, drawn=True)
        self.assertEqual(len(rows), 7)
        runs = {tolerance: run_case(merged(DISKS, {"solver": {"tolerance": tolerance}, "output": {"every": 30, "stress": True}}),
                                    directory=self.here(f"run {tolerance}")) for tolerance in (1e-2, 1e-6)}
        states = {tolerance: one.results() for tolerance, one in runs.items()}
        difference = [states[1e-2][f"/steps/{n}/bodies/position"] - states[1e-6][f"/steps/{n}/bodies/position"] for n in (30, 60, 90, 120)]
        row = next(row for row in rows if row["variant"] == "NLGS" and row["value"] == "1e-2")
        self.assertAlmostEqual(float(row["position_error"]) / math.sqrt(np.mean(np.sum(np.array(difference)**2, axis=2))), 1.0, places=9)
        histories = {tolerance: one.history() for tolerance, one in runs.items()}
        self.assertEqual(int(row["iterations"]), histories[1e-2]["iterations"].sum())
        means = {tolerance: history["pressure"].mean() for tolerance, history in histories.items()}
        self.assertAlmostEqual(float(row["pressure"]) / means[1e-2], 1.0, places=12)
        self.assertAlmostEqual(float(row["pressure_error"]), abs(means[1e-2] / means[1e-6] - 1.0), places=9)
        stress = {t: np.array([h["stress_" + a].mean() for a in ("xx", "xy", "yx", "yy")]) for t, h in histories.items()}
        self.assertAlmostEqual(float(row["stress_error"]), np.linalg.norm(stress[1e-2] - stress[1e-6]) / np.linalg.norm(stress[1e-6]), places=9)
        found = {(row["variant"], row["figure"]): float(row["value"]) for row in summary}
        for variant in ("NLGS", "NSCDD"):
            of = {float(row["value"]): float(row["pressure_error"]) for row in rows if row["variant"] == variant}
            good = [t for t in of if all(of[s] <= 0.02 for s in of if s <= t)]
            self.assertEqual(found.get((variant, "knee:pressure")), max(good, default=None))
        self.assert_figures(run)

    def test_ranks(self):
        """All but times is the same on 1 and 2 ranks, and in `./gravier test long` on 4, with solves as accurate as above."""
        asked, variants = {**self.ASKED, "repeats": 2}, self.VARIANTS
        if not LONG:
            asked, variants = {**asked, "values": "1e-1, 1e-2"}, ["&reference tolerance = 1.0e-4 /", *variants[1:]]
        tables = []
        for ranks in (1, 2, 4) if LONG else (1, 2):
            _, rows, _ = self.study(f"on {ranks}", DISKS, asked, *variants, ranks=ranks)
            tables.append([{name: cell for name, cell in row.items() if name not in TIMES + ["ranks"]} for row in rows])
        for table in tables[1:]:
            self.assertEqual(tables[0], table)


class BadInput(Studies):

    def refused(self, title, study, message, *others, case=None, files=()):
        run, _, _ = self.study(title, case or COLUMN_CASE, study, *others, status=2, files=files)
        self.assertEqual(run.stderr.count("\n"), 1, str(run))
        self.assertRegex(run.stderr, "^gravier_accuracy: error: study.nml" + message)
        self.assertFalse(os.path.exists(run.path("out")))

    def test_study(self):
        solve, runs = {"kind": "solve"}, {"kind": "run", "vary": "tolerance", "values": "1e-2"}
        for number, (study, message, others) in enumerate((
                ({"kind": "walk"}, ": &study kind = 'walk': expected 'solve' or 'run'", ()),
                ({}, ": &study kind is missing: expected 'solve' or 'run'", ()),
                ({**solve, "colour": 1}, r": unknown key 'colour' in &study: expected one of title case", ()),
                ({**solve, "repeats": 0}, ": &study repeats = 0: expected an integer >= 1", ()),
                ({**solve, "samples": 2}, ": &study samples = 2: expected without it, where kind = 'solve'", ()),
                ({**solve, "title": 3}, ": &study title = 3: expected a text in quotes", ()),
                ({**solve}, ": unknown group &scene: expected one of &study &reference &variant", ("&scene /",)),
                ({**solve}, ": group &reference belongs to kind = 'run'", ("&reference tolerance = 1 /",)),
                ({**runs, "knee": 2.0}, r": &study knee = 2.0: expected a finite real number in \(0, 1\)", ()),
                ({**runs, "vary": "colour"}, ": &study vary = 'colour': expected a key of a case", ()),
                ({**runs, "vary": "steps"}, ": &study vary = 'steps': expected a key of a case", ()),
                ({**runs, "values": "1e-2, x"}, ": 'case' of case.nml: &solver tolerance = x: expected a finite real number > 0", ()),
                ({**runs, "samples": 7}, ": &study samples = 7: expected a divisor of all numbers of steps, 1 among them", ()),
                ({**runs, "quantities": "colour"}, ": &study quantities: 'colour': expected some of kinetic_energy", ("&reference tolerance = 1e-6 /",)),
                (runs, ": group &reference is missing: expected keys of a run that is tighter than the others, or reference = 'none'", ()),
                ({**runs, "vary": "step", "values": "0.3"}, ": &study values: 0.3: expected steps that divide the duration", ()),
                ({**runs, "vary": "radius", "reference": "tight"}, ": &study reference = 'tight': expected 'exact' or 'none'", ()),
                ({**runs}, ": &reference step, steps: expected the duration of 'case', 1.00000E", ("&reference steps = 2 /",)),
                ({**runs}, ": &variant tolerance = 1: expected without it, since &study vary = 'tolerance'",
                 ("&variant name = 'a', tolerance = 1 /",)),
                ({**runs}, ": &variant radius = 1: expected no key of &scene, where reference = 'tight'", ("&variant name = 'a', radius = 1 /",)),
                ({**solve}, r": &variant \(number 1\) name is missing", ("&variant method = 'nlgs' /",)),
                ({**solve}, ": &variant name = 'a': expected a name of its own", ("&variant name = 'a' /", "&variant name = 'a' /")),
                ({**solve}, ": &variant sweeps = 2: expected once, but it is given twice", ("&variant name = 'a', sweeps = 1, sweeps = 2 /",)),
                ({**runs, "vary": "bins"}, ": &study vary = 'bins': expected a key of a case", ()),
                ({**solve}, r": &variant gravity\(2\) = -10: expected gravity without an index: with all its entries, which replace those of the case", ("&variant gravity(2) = -10 /",)),
                ({**solve}, ": unknown key 'directory' in &variant: expected a key of a case",
                 ("&variant name = 'a', directory = 'b' /",)),
                ({**solve}, ": 'a' of case.nml: &solver method = 'nlsg': expected 'nlgs'", ("&variant name = 'a', method = 'nlsg' /",)))):
            with self.subTest(message=message):
                self.refused(f"study {number}", study, message, *others)

    def test_case(self):
        """Errors of the case are its own; a motion that is not known is refused before a run."""
        run, _, _ = self.study("bad case", merged(COLUMN_CASE, {"time": {"step": -1.0}}), {"kind": "solve"}, status=2)
        self.assertRegex(run.stderr, "^gravier_accuracy: error: case.nml: &time step = -1.0: expected")
        self.refused("two balls", {"kind": "run", "vary": "step", "values": "0.01", "reference": "exact"},
                     ": &study reference = 'exact': expected 'tight' or 'none'", case=BALL_CASE,
                     files={"ball.csv": BALL + "3,grain,1.0,0.21,0.01,,\n"})
        material = {"material": [{"name": "m"}], "scene": {"wall_material": "m"}, "law": [{"materials": "m", "kind": "coulomb"}]}
        for name, case in (("law", material), ("removed", {"boundary": [{"name": "w", "shape": "wall", "wall": "2", "remove_at": 0.2}]})):
            self.refused(f"ball, {name}", {"kind": "run", "vary": "step", "values": "0.01", "reference": "exact"},
                         ": &study reference = 'exact': expected 'tight' or 'none'", case=merged(BALL_CASE, case), files={"ball.csv": BALL})
        known = {**COLUMN_CASE, "solver": {}, "time": {"step": 1e-3, "steps": 10}}
        for name, case in (("pulled", {"scene": {"body_force": [0.0, -1.0]}}), ("table", {"scene": {"gravity": None, "gravity_table": "g.csv"}}),
                           ("ground that goes", {"boundary": [{"name": "g", "shape": "wall", "wall": "-y", "remove_at": 0.005}]}),
                           ("ground that moves", {"boundary": [{"name": "g", "shape": "wall", "wall": "-y", "velocity": [0.0, 1.0]}]}),
                           ("lid", {"boundary": [{"name": "lid", "shape": "plane", "point": [0.0, 9.0], "normal": [0.0, -1.0]}]}),
                           ("law", material), ("tilted", {"scene": {"gravity": [1.0, -9.81]}})):
            self.refused(f"column, {name}", {"kind": "run", "vary": "step", "values": "1e-3", "reference": "exact"},
                         ": &study reference = 'exact': expected 'tight' or 'none'", case=merged(known, case), files={"g.csv": "time,gy\n0,-9.81\n"})
        self.refused("no steps", {"kind": "run", "vary": "tolerance", "values": "1e-2", "reference": "none"},
                     ": 'case' of case.nml: &time steps = 0: expected an integer >= 1",
                     case=merged(COLUMN_CASE, {"time": {"steps": 0}}))

    def test_command_line(self):
        for arguments, message in (((), "expected one study, but 0 arguments are given"), (("a", "b"), "expected one study, but 2"),
                                   (("--fast",), "unknown option --fast"), (("none.nml",), "none.nml: ")):
            run = gravier(*arguments, directory=self.scratch, program="gravier_accuracy")
            self.assert_status(run, 2)
            self.assertTrue(run.stderr.startswith("gravier_accuracy: error: " + message), str(run))
        run = gravier("--help", directory=self.scratch, program="gravier_accuracy")
        self.assert_status(run, 0)
        self.assertIn("usage: gravier_accuracy STUDY.nml", run.stdout)
        run = gravier("--version", directory=self.scratch, program="gravier_accuracy")
        self.assertTrue(run.stdout.startswith("Gravier "))


class Shipped(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        os.symlink(os.path.join(SOURCE, "data"), os.path.join(cls.scratch, "data"))

    def test_cases_and_studies(self):
        """Every study is read, and refused for nothing but a packing that is not there or what is put in here."""
        studies = [path for path in sorted(glob.glob(os.path.join(SOURCE, "data/studies/*.nml")))
                   if not path.endswith(("_case.nml", "_settle.nml"))]
        self.assertGreater(len(studies), 8)
        for path in studies:
            with open(path, encoding="utf-8") as file:
                text = file.read()
            name = os.path.basename(path)
            # the reading alone: quantities that there are not are refused once the scene is made
            text = re.sub(r"quantities = .*", "", text)
            probe = "quantities = 'no such quantity'\n/" if "kind = 'run'" in text and "'exact'" not in text else "/"
            text = re.sub(r"^/", probe, text, count=1, flags=re.M)
            if probe == "/":
                text = re.sub(r"directory = '", "directory = '/dev/null/", text)
            write(self.here(name), text)
            run = gravier(name, directory=self.scratch, program="gravier_accuracy")
            self.assert_status(run, 2)
            self.assertRegex(run.stderr, r"no such quantity|final_bodies\.h5|/dev/null/", str(run))

    def test_ball(self):
        """One of them as it is."""
        shutil.copy(os.path.join(SOURCE, "data/studies/ball.nml"), self.here("ball.nml"))
        run = gravier("ball.nml", directory=self.scratch, program="gravier_accuracy")
        self.assert_status(run, 0)
        self.assertIn("order_position", run.stdout)
