"""gravier.study: a run for every combination of values, and the table of its runs."""
import csv
import math
import os
import pathlib
import shutil
import time
import unittest
import unittest.mock
import warnings

from gravier_runs import RunTestCase, quick_launcher

import gravier

TIED = (("time", "step"), ("time", "steps"))
GROUND = {"name": "it's the ground", "shape": "plane", "normal": [0.0, 1.0]}


def csv_rows(path):
    """All rows of a table, the names of its columns first."""
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


class Study(RunTestCase):
    base = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
            "time": {"step": 1e-3, "steps": 300},
            "solver": {"method": "nscdd", "tolerance": 1e-4},
            "decomposition": {"subdomains": 2},
            "output": {"directory": "results", "every": 100, "trace": True}}

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # most of the time of such short runs is that of the launcher, which test_python.py has as it is
        cls.enterClassContext(unittest.mock.patch.dict(os.environ, {"MPIEXEC": quick_launcher(cls.scratch)}))

    def test_study(self):
        base = {**self.base, "time": {"step": 1e-3, "steps": 2}, "boundary": [GROUND]}
        points = list(gravier.study(base, {("scene", "friction"): [0.0, 0.4], ("time", "steps"): [2, 3]}, self.here("study")))
        self.assertEqual([tuple(point.values()) for point, _, _ in points], [(0.0, 2), (0.0, 3), (0.4, 2), (0.4, 3)])
        for point, place, status in points:
            run = gravier.Run(place / "results")
            self.assertEqual((run.case["scene"][0]["friction"], run.steps[-1], status), (*point.values(), 0))
        self.assertEqual(base["scene"]["friction"], 0.3)
        table = pathlib.Path(self.here("study/study.csv"))
        self.assertEqual([row[:5] for row in csv_rows(table)],
                         [["run", "status", "scene.friction", "time.steps", "steps_missed"], ["run_1", "0", "0.0", "2", "0"],
                          ["run_2", "0", "0.0", "3", "0"], ["run_3", "0", "0.4", "2", "0"], ["run_4", "0", "0.4", "3", "0"]])
        for ranks in (0, 1.5, math.nan, math.inf, "2", None):
            with self.assertRaisesRegex(gravier.CaseError, f"ranks = {ranks}: expected a whole number above 0"):
                gravier.run(base, self.here("none"), ranks=ranks)
        for changes, words in (({("scene",): [0.1]}, r"\('scene',\): expected \(group, key\), or \(group, name, key\)"),
                               ({"scene": [0.1]}, r"'scene': expected \(group, key\), or"),
                               ({("scene", "friction"): 0.1}, r"\('scene', 'friction'\): 0.1; expected a list of values$"),
                               ({("scene", "bodies"): "lattice"}, r"\('scene', 'bodies'\): 'lattice'; expected a list of values$"),
                               ({TIED: [(1e-3, 2, 3)]}, r": \(0.001, 2, 3\); expected a value for each of these 2 keys$"),
                               ({TIED: [1e-3]}, ": 0.001; expected a value for each of these 2 keys$"), ({(): [1]}, r"\(\): expected \(group, key\)"),
                               ({TIED: [(1e-3, 2)], ("time", "step"): [1e-3]}, r"\('time', 'step'\): changed twice; expected each key once$")):
            with self.assertRaisesRegex(gravier.CaseError, words):
                list(gravier.study(base, changes, self.here("none")))
        # keys that change together; a table of another origin is nobody's to replace
        for point, place, status in gravier.study(base, {TIED: [(1e-3, 2), (5e-4, 4)]}, self.here("tied")):
            time = gravier.Run(place / "results").case["time"][0]
            self.assertEqual((time["step"], time["steps"], status), (*point.values(), 0))
        self.assertEqual([row[:4] for row in csv_rows(self.here("tied/study.csv"))],
                         [["run", "status", "time.step", "time.steps"], ["run_1", "0", "0.001", "2"], ["run_2", "0", "0.0005", "4"]])
        table.write_text("mine\n")
        with self.assertRaisesRegex(gravier.CaseError, "study.csv: "):
            list(gravier.study(base, {("time", "steps"): [2]}, self.here("study")))
        self.assertEqual(table.read_text(), "mine\n")
        table.unlink()
        # a group that stands once is a list of one in what parse_namelist returns
        parsed = {group: keys if isinstance(keys, list) else [keys] for group, keys in base.items()}
        for point, place, status in gravier.study(parsed, {("time", "steps"): [2]}, self.here("parsed")):
            self.assertEqual((point, status), ({("time", "steps"): 2}, 0), place)
        with self.assertRaisesRegex(gravier.CaseError, "status 2: gravier: error: case.nml: &scene friction = -1"):
            list(gravier.study(base, {("scene", "friction"): [-1.0], ("output", "directory"): ["results"]}, self.here("refused")))
        self.assertEqual(pathlib.Path(self.here("refused/study.csv")).read_text(), "run,status,scene.friction,output.directory,steps_missed,worst_error,doubts\n")
        # one of several groups, by its name or its number
        several = {**base, "boundary": [{**GROUND, "name": "ground"}, {**GROUND, "name": "lower", "point": [0.0, -1.0]}]}
        for which in ("lower", 2):
            with self.assertWarnsRegex(UserWarning, "run_3, run_4 of an older study stay; this one has run_1 to run_2$"):
                for point, place, status in gravier.study(several, {("boundary", which, "friction"): [0.1, 0.7]}, self.here("study")):
                    case = gravier.Run(place / "results").case["boundary"]
                    self.assertEqual((case[1]["friction"], case[0].get("friction"), status), (point["boundary", which, "friction"], None, 0))
        self.assertNotIn("friction", several["boundary"][1])
        for what, words in ((("boundary", "name"), r"&boundary name: the group stands several times; expected \('boundary', name, 'name'\)"),
                            (("boundary", "lid", "friction"), "&boundary 'lid': no group of this name or number; expected one of 'ground', 'lower'"),
                            (("boundary", 3, "friction"), "&boundary 3: no group of this name or number"),
                            (("boundary", "lower", "table", "friction"), "expected \\(group, key\\), or \\(group, name, key\\)")):
            with self.assertRaisesRegex(gravier.CaseError, words):
                list(gravier.study(several, {what: [0.5]}, self.here("refused")))

    def test_results_in_the_table_of_a_study(self):
        """study.csv says how many steps of each run missed their goal and its worst velocity error, and has what the user measures."""
        # disks that fall meet after 34 steps, and one iteration does not solve that; a step that is discarded has no row in history.csv
        solver = {"method": "nlgs", "fallback": "none", "layered_start": False}
        base = {"scene": self.base["scene"], "time": {"step": 1e-3, "steps": 60}, "solver": solver, "output": {"directory": "out", "every": 10}}
        changes = {("solver", "max_iterations"): [10000, 1], ("solver", "on_failure"): ["continue", "discard"]}

        def measured(run):
            figures = {"height": run.bodies().position[:, 1].max(), "last": int(run.steps[-1]), "says": run.verdict()}
            # the order of the columns is that of the first run
            return figures if run.case["solver"][0]["max_iterations"] == 10000 else dict(reversed(list(figures.items())))
        found = list(gravier.study(base, changes, self.here("measured"), results=measured))
        header, *rows = csv_rows(self.here("measured/study.csv"))
        self.assertEqual(header, ["run", "status", "solver.max_iterations", "solver.on_failure", "steps_missed", "worst_error", "doubts", "height", "last", "says"])
        for row, (point, place, status) in zip(rows, found):
            row, run = dict(zip(header, row)), gravier.Run(place / "out")
            history = run.history()
            self.assertEqual(row["status"], str(status))
            self.assertEqual((float(row["height"]), int(row["last"])), (run.bodies().position[:, 1].max(), run.steps[-1]))
            self.assertEqual(row["says"], "converged" if status == 0 else "not converged")
            ratio = history.velocity_error[history.velocity_scale > 0] / history.velocity_scale[history.velocity_scale > 0]
            missed = (history.converged == 0).sum()
            if point["solver", "on_failure"] == "continue":
                self.assertEqual(int(row["steps_missed"]), missed)
                # the log has three digits
                self.assertLessEqual(abs(float(row["worst_error"]) / ratio.max() - 1), 0.006)
            else:
                self.assertEqual((int(row["steps_missed"]), missed), (int(status == 3), 0))
                self.assertEqual(float(row["worst_error"]) > 1, status == 3)
        self.assertEqual([status for _, _, status in found], [0, 0, 3, 3])
        self.assertGreater(int(rows[2][4]), 10)
        # a run without steps has no velocity error
        for _ in gravier.study({**base, "time": {"step": 1e-3, "steps": 0}}, {("scene", "seed"): [1]}, self.here("still")):
            pass
        self.assertEqual(csv_rows(self.here("still/study.csv"))[1], ["run_1", "0", "1", "", "", ""])
        for results, words in ((lambda run: 3.0, "results of run_1: 3.0; expected a dictionary of values by the names of their columns"),
                               (lambda run: {"status": 1}, "results of run_1: status: study.csv has a column of this name; expected another one"),
                               (lambda run: {"worst_error": 1}, "results of run_1: worst_error: study.csv has a column"),
                               (lambda run: {f"seed {run.case['scene'][0]['seed']}": 1},
                                "results of run_2: columns seed 2; expected those of the runs before, seed 1")):
            with self.assertRaisesRegex(gravier.CaseError, words):
                list(gravier.study(base, {("scene", "seed"): [1, 2], ("time", "steps"): [1]}, self.here("odd"), results=results))

    def test_runs_that_have_ended_stay(self):
        """A study that was stopped goes on: runs that have ended with their case stay, and their rows are those of before."""
        base = {"scene": {"bodies": "file", "bodies_file": "../../disk.csv"}, "boundary": [GROUND], "time": {"step": 1e-3, "steps": 20},
                "output": {"directory": "out", "every": 0}}
        pathlib.Path(self.here("disk.csv")).write_text("id,x,y,radius\n1,0.0,0.01,0.01\n")
        changes, place = {("scene", "friction"): [0.1, 0.2, 0.3]}, pathlib.Path(self.here("stopped"))

        def logs():
            return [(place / f"run_{number}/out/run.log").stat().st_mtime_ns for number in (1, 2, 3) if (place / f"run_{number}/out/run.log").exists()]

        def runs(words=None, **more):
            """Run numbers of a study with their status; it warns in these words."""
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                found = [(place.name, status) for _, place, status in gravier.study(base, changes, place, **more)]
            self.assertEqual([str(one.message) for one in said], [f"{place}: kept, as ended with the same case: {words}; fresh=True runs all"] if words else [])
            return found
        whole = [("run_1", 0), ("run_2", 0), ("run_3", 0)]
        for _ in zip(range(2), gravier.study(base, changes, place)):
            pass
        first = logs()
        self.assertEqual(len(first), 2)
        self.assertEqual(runs("run_1, run_2"), whole)
        self.assertEqual(logs()[:2], first)
        self.assertEqual([row[:3] for row in csv_rows(place / "study.csv")[1:]], [["run_1", "0", "0.1"], ["run_2", "0", "0.2"], ["run_3", "0", "0.3"]])
        # results that are gone, a run that was cut off, another value, a file that has changed
        shutil.rmtree(place / "run_1/out")
        log = place / "run_2/terminal.log"
        log.write_text(log.read_text().replace("\nfinished ", "\ninterrupted *** "))
        self.assertEqual(runs("run_3"), whole)
        changes["scene", "friction"][2] = 0.4
        self.assertEqual(runs("run_1, run_2"), whole)
        os.utime(self.here("disk.csv"), (time.time() + 5,) * 2)
        self.assertEqual(runs(), whole)
        os.utime(self.here("disk.csv"), (1e9, 1e9))
        self.assertEqual(runs("run_1, run_2, run_3"), whole)
        self.assertEqual(runs(fresh=True), whole)
        # one that did not converge keeps its status
        base.update(scene=self.base["scene"], time={"step": 1e-3, "steps": 60}, solver={"max_iterations": 1, "fallback": "none", "layered_start": False})
        self.assertEqual(runs(), [(name, 3) for name, _ in whole])
        self.assertEqual(runs("run_1, run_2, run_3"), [(name, 3) for name, _ in whole])


if __name__ == "__main__":
    unittest.main()
