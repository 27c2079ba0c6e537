"""The estimated velocity error beside the true one: the small scenes of drivers/studies/study_error.py that need no packing, with their
bounds, and what gravier_error promises: the program's own estimates, the same table on any number of ranks, refusals in one line.

Estimates are made of a projection and a sum over levels, each good to a factor of about 2; the bounds are those of the study. Where
rest is the solution the estimate is at most the bound C, which is the error itself where all contacts press."""
import math
import os
import sys
import unittest

from gravier_runs import PROGRAMS, SOURCE, RunTestCase, gravier, namelist, write

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
os.environ.setdefault("GRAVIER_BIN_DIR", PROGRAMS)

COLUMN = {"scene": {"bodies": "column", "column_count": 30, "radius": 0.005, "mass": 0.2, "friction": 0.5},
          "time": {"step": 1e-3, "steps": 1}}


class Program(RunTestCase):

    def table(self, name, case, *options, ranks=1):
        directory = self.here(name)
        os.makedirs(directory, exist_ok=True)
        write(os.path.join(directory, "case.nml"), namelist(case))
        run = gravier("case.nml", *options, ranks=ranks, directory=directory, program="gravier_error")
        self.assert_status(run, 0)
        # text in front, numbers from `step` on
        with open(run.path("error.csv"), encoding="ascii") as file:
            header, *rows = [line.rstrip("\n").split(",") for line in file]
        names = header[header.index("step"):header.index("machine")]
        first = header.index("step") - len(header)
        return [dict(zip(names, map(str, row[first:]))) for row in rows]

    def test_column(self):
        """Cold, C is the error: all contacts press, and a gap does no work. With impulses lost contacts open for a while: up to a factor
        of 1.3 then, and never less than the error."""
        rows = self.table("column", COLUMN, "--rest", "--situations", "cold,lost:0.1", "--iterations", "4,8,20")
        self.assertEqual(len(rows), 6)
        for row in rows[:3]:
            self.assertAlmostEqual(float(row["estimate"]) / float(row["true_error"]), 1.0, delta=1e-6)
        for row in rows[3:]:
            self.assertTrue(1.0 - 1e-6 <= float(row["estimate"]) / float(row["true_error"]) <= 1.3, row)
        for row in rows:
            # a lower bound in a linear problem: all contacts press in the cold ones
            if row in rows[:3]:
                self.assertLessEqual(float(row["projection"]), float(row["true_error"]) * (1.0 + 1e-6))

    def test_scale(self):
        """Errors are divided by the velocity that a run compares them with, be it given or that of the loads of a step."""
        lid = {"name": "lid", "shape": "plane", "point": [0.0, 0.3], "normal": [0.0, -1.0], "free": [False, True], "mass": 1.0, "force": [0.0, -100.0]}
        for name, case in (("pulled", {"scene": {**COLUMN["scene"], "body_force": [0.0, -1e4]}}), ("given", {"solver": {"velocity_scale": 0.5}}),
                           ("lid", {"scene": {**COLUMN["scene"], "gravity": [0.0, 0.0]}, "boundary": [lid]})):
            case = {**COLUMN, **case, "output": {"directory": "results"}}
            (row,) = self.table(name, case, "--rest", "--situations", "cold", "--iterations", "8")
            run = gravier("case.nml", directory=self.here(name))
            self.assertAlmostEqual(float(row["velocity_scale"]) / run.history()["velocity_scale"][0], 1.0, delta=1e-6, msg=name)

    def test_same_as_the_solver(self):
        """A state looked at is that of a solve by the program with as many iterations, and so is its estimate; below 15 levels there is no
        pass over layers."""
        case = {**COLUMN, "scene": {**COLUMN["scene"], "column_count": 12}}
        rows = self.table("program", case, "--rest", "--situations", "program,cold", "--iterations", "4,6,10")
        own, program = rows[-3:], rows[:3]
        for a, b in zip(own, program):
            self.assertEqual(a["iterations"], b["iterations"])
            for key in ("residual", "true_error", "estimate"):
                self.assertAlmostEqual(float(a[key]) / float(b[key]), 1.0, delta=1e-6, msg=f"{key}: {a} {b}")

    def test_ranks(self):
        """Sums over ranks are made in one order: the same figures, but for seconds."""
        case = {**COLUMN, "solver": {"method": "nscdd"}, "decomposition": {"grid": [1, 4]}}
        one = self.table("one", case, "--situations", "cold,turned:20", "--iterations", "4,8")
        two = self.table("two", case, "--situations", "cold,turned:20", "--iterations", "4,8", ranks=2)
        for a, b in zip(one, two):
            self.assertEqual({key: a[key] for key in a if key not in ("seconds", "ranks")},
                             {key: b[key] for key in b if key not in ("seconds", "ranks")})

    def test_refusals(self):
        directory = self.here("refused")
        os.makedirs(directory, exist_ok=True)
        write(os.path.join(directory, "case.nml"), namelist(COLUMN))
        for options, said in ((["--situations", "warm"], "--situations 'warm': expected cold, program, lost:FRACTION of at most 1"),
                              (["--situations", "lost:2"], "--situations 'lost:2': expected"),
                              (["--iterations", "8,4"], "--iterations '8,4': expected integers >= 1 in ascending order"),
                              (["--tight", "0"], "--tight '0': expected a finite real number > 0"),
                              (["--steps"], "--steps '': expected an integer >= 1"),
                              (["--situations", ""], "--situations '': expected cold"), (["--situations", "cold,"], "--situations '': expected cold"),
                              (["--iterations", "4,8,"], "--iterations '4,8,': expected integers >= 1 in ascending order"),
                              (["--every", "2"], "--every '2': expected at most the number of --steps, 0"),
                              (["--steps", "3", "--every", "4"], "--every '4': expected at most the number of --steps, 3"),
                              (["--fast"], "unknown option --fast"), (["other.nml"], "more than one input file")):
            run = gravier("case.nml", *options, directory=directory, program="gravier_error")
            self.assert_status(run, 2)
            self.assertIn("gravier_error: error: " + said, run.stderr)


class Bounds(RunTestCase):

    def test_small_scenes(self):
        """All but the scenes that need a packing."""
        import study_error

        chosen = [scene for scene in study_error.scenes() if scene.quick and scene.share_of is None and scene.name != "column of 1000"]
        self.assertGreater(len(chosen), 8)
        rows = [row for scene in chosen for row in study_error.measure_scene(scene, study_error.Path(self.scratch))]
        states = [study_error.State(row) for row in rows]
        counted = [state for state in states if state.counts()]
        self.assertGreater(len(counted), 40)
        usual = sum(state.is_usual() for state in counted)
        self.assertGreaterEqual(usual, study_error.SHARE * len(counted), [(s.row["scene"], s.row["situation"], s.iterations, s.ratio)
                                                                           for s in counted if not s.is_usual()])
        least = min(counted, key=lambda state: state.ratio)
        self.assertGreaterEqual(least.ratio, study_error.LEAST, (least.row["scene"], least.row["situation"], least.iterations))

    def test_bonded_bodies(self):
        """Of bonded bodies the bound by rest is the error itself. The estimate without it, which stands alone where something
        prescribed moves, is at least half of the error: attractions of the bonds, a thousand times the weights, do not hide the load."""
        import study_error

        chosen = [scene for scene in study_error.scenes() if scene.name.startswith("bonded")]
        self.assertGreaterEqual(len(chosen), 7)
        rows = [row for scene in chosen for row in study_error.measure_scene(scene, study_error.Path(self.scratch))]
        counted = [row for row in rows if study_error.State(row).counts()]
        self.assertGreater(len(counted), 70)
        for row in counted:
            estimate = math.hypot(2.8 * float(row["projection"]), float(row["levels"])) if float(row["projection"]) >= 0.0 else \
                float(row["estimate"])
            self.assertGreater(estimate, study_error.LEAST * float(row["true_error"]), row)


if __name__ == "__main__":
    unittest.main()
