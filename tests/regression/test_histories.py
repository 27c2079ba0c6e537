"""Rows of history.csv that is thinned: what they stand for, means over steps, and the measures that are made from them."""
import os
import unittest

import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, run_case, write
import gravier
from gravier.histories import History

R = 0.01


def whole(steps=60):
    """A history of all steps, with a force that is the number of the step squared, some grains that leave and some misses."""
    step = np.arange(1.0, steps + 1)
    return {"step": step, "time": 1e-3 * step, "force": step**2, "left": 2.0 * np.isin(step, (13, 14, 37)), "converged": 1.0 - np.isin(step, (5, 30, 37))}


def thin(columns, every):
    """The rows that such a history has with history_every."""
    step = columns["step"]
    kept = (step % every == 0) | (step == 1) | (step == step[-1]) | (columns["left"] > 0) | (columns["converged"] == 0)
    return {name: values[kept] for name, values in columns.items()}


class Histories(unittest.TestCase):

    def test_means_are_over_steps(self):
        """A row counts as often as it stands for steps of a block; blocks are those of the whole history, and counts are exact."""
        full, rows = whole(), History(thin(whole(), 7))
        self.assertEqual(rows.steps(), 60)
        for steps in (7, 10, 20, 25, 60):
            found, known = rows.means(steps), History(full).means(steps)
            for name in ("left", "converged"):
                np.testing.assert_allclose(found[name], known[name], atol=1e-15, err_msg=name)
            # each step has the values of the row at or behind it
            place = rows.step[np.searchsorted(rows.step, full["step"])]
            number = len(place) // steps
            for name, values in (("step", place), ("force", place**2), ("time", 1e-3 * place)):
                np.testing.assert_allclose(found[name], values[:steps * number].reshape(number, steps).mean(axis=1), rtol=1e-13, err_msg=name)
        with self.assertRaisesRegex(gravier.ResultsError, r"means of 6 steps of a history.csv with a row each 7 steps; expected 7 at least"):
            rows.means(6)
        for steps in (0, 61):
            with self.assertRaisesRegex(gravier.ResultsError, f"means of {steps} steps; expected 1 to 60, the steps that there are"):
                rows.means(steps)

    def test_windows(self):
        """A window of time begins behind the last step that ended before it, whether this step has a row or not."""
        for columns in (whole(), thin(whole(), 7)):
            rows = History(columns)
            for low, start in ((-1.0, 0), (0.0, 0), (0.0004, 0), (0.001, 1), (0.0099999, 9), (0.01, 10), (0.0105, 10), (0.02, 20)):
                later = rows.after(low)
                self.assertEqual((later.start, later.steps(), later.step[0] > start), (start, 60 - start, True), low)
                self.assertAlmostEqual(float(rows.time_of(later.start)), 1e-3 * start, places=15)
            self.assertEqual(len(rows.after(1.0)), 0)
            self.assertEqual(rows.after(1.0).steps(), 0)
            middle = rows.between(0.02, 0.0305)
            self.assertEqual((middle.start, middle.step[-1] <= 30, middle.steps() <= 10), (20, True, True))
            self.assertAlmostEqual(rows.after(0.03).means(30).left[0], 2.0 / 30.0, places=15)
        self.assertEqual(History({name: values[9:] for name, values in whole().items()}).start, 9)
        self.assertEqual(len(History({"step": np.zeros(0), "time": np.zeros(0)}).after(0.0)), 0)


class Runs(RunTestCase):

    def piston(self, name, output):
        """Two disks on springs below a lid that comes down at 0.01 m/s."""
        os.makedirs(self.here(name))
        write(self.here(name, "one.csv"), f"id,radius,mass,x,y\n1,{R},1.0,{R},{R}\n2,{R},1.0,{3.0 * R},{R}\n")
        case = {"scene": {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": "one.csv"}, "material": {"name": "sand"},
                "law": {"materials": "sand", "kind": "elastic", "normal_stiffness": 1e5},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}, {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
                             {"name": "right", "shape": "plane", "point": [4.0 * R, 0.0], "normal": [-1.0, 0.0]},
                             {"name": "lid", "shape": "plane", "point": [0.0, 2.0 * R], "normal": [0.0, -1.0], "velocity": [0.0, -0.01]}],
                "time": {"step": 1e-3, "steps": 100}, "solver": {"accuracy": 1e-6}, "output": {"directory": ".", "boundary_forces": True, **output}}
        for wall in case["boundary"]:
            wall["material"] = "sand"
        self.assert_status(run_case(case, 1, self.here(name)), 0)
        return gravier.Run(self.here(name))

    def test_wall_tests(self):
        """Strains of thinned rows refer to a row or a written state; means of steps are near those of all steps."""
        full, part = self.piston("full", {"every": 0}), self.piston("part", {"every": 30, "history_every": 10})
        every, found = gravier.wall_test(full), gravier.wall_test(part)
        self.assertEqual(found.step.tolist(), [1, *range(10, 101, 10)])
        for since in (0.0, 0.0295, 0.0495):
            # step 30 has a row and a state, 50 a row
            known, rows = gravier.wall_test(full, since=since), gravier.wall_test(part, since=since)
            for name in ("axial_strain", "void_ratio", "axial_stress"):
                np.testing.assert_array_equal(rows[name], known[name][np.isin(known.step, rows.step)], name)
        means, known = gravier.wall_test(part, mean=20), gravier.wall_test(full, mean=20)
        self.assertEqual(len(means), 5)
        # a row stands for the nine steps before it too, in strains as in stresses
        np.testing.assert_allclose(means.step[1:] - known.step[1:], 4.5, rtol=1e-12)
        np.testing.assert_allclose(np.interp(means.step[1:], every.step, every.axial_strain), means.axial_strain[1:], rtol=1e-9)
        np.testing.assert_allclose(np.interp(means.step[1:], every.step, every.axial_stress), means.axial_stress[1:], rtol=1e-4)
        with self.assertRaisesRegex(gravier.ResultsError, "no row and no written state of step 46, the first one after 0.0455 s, .* such as 0.0395 s, before step 40"):
            gravier.wall_test(part, since=0.0455)
        self.assertEqual(gravier.wall_test(part, since=0.0395).axial_strain[0], 0.0)
        with self.assertRaisesRegex(gravier.ResultsError, "means of 5 steps of a history.csv with a row each 10 steps"):
            gravier.wall_test(part, mean=5)
        # a state without a row
        state = self.piston("state", {"every": 25, "history_every": 10})
        rows, known = gravier.wall_test(state, since=0.0245), gravier.wall_test(full, since=0.0245)
        self.assertEqual(rows.step[0], 30)
        np.testing.assert_allclose(rows.axial_strain, known.axial_strain[np.isin(known.step, rows.step)], rtol=1e-12)

    def test_way_through_air(self):
        """The time that leaves the way of a plane out is one to which strains can refer."""
        part = self.piston("air", {"every": 0, "history_every": 10})
        table = os.path.join(part.directory, "history.csv")
        rows = gravier.read_table(table)
        rows["force_y:lid"][rows.step <= 40] = 0.0
        gravier.write_table(table, rows, 17)
        command = os.path.join(SOURCE, "drivers/measure/gravier_measure.py")
        done = script(command, "walls", "air", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("\nlid bears nothing before 0.05 s, ", done.stdout)
        self.assertIn("; --since 0.0495 leaves it out\n", done.stdout)
        done = script(command, "walls", "air", "--since", "0.0495", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertNotIn("bears nothing", done.stdout)

    def test_outflow(self):
        """What has left after so many steps, and the rates, are those of the whole history."""
        tables = {}
        for name, every in (("all", 1), ("some", 40)):
            os.makedirs(self.here(f"fall {name}"))
            write(self.here(f"fall {name}", "column.csv"), "id,x,y,radius\n" + "".join(f"{k},0.0,{0.0495 * k},0.01\n" for k in range(1, 11)))
            case = {"scene": {"bodies": "file", "bodies_file": "column.csv", "density": 2500.0},
                    "boundary": [{"name": "out", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.0, 1.0]}], "time": {"step": 1e-3, "steps": 400},
                    "output": {"directory": ".", "every": 0, "history_every": every}}
            self.assert_status(run_case(case, 1, self.here(f"fall {name}")), 0)
            tables[name] = gravier.Run(self.here(f"fall {name}"))
        self.assertLess(len(tables["some"].history()), 30)
        for mean, since in ((15, 0.0), (70, 0.1505), (150, 0.05)):
            known, found = (gravier.outflow(tables[name], mean, since) for name in ("all", "some"))
            for name in known:
                np.testing.assert_allclose(found[name], known[name], rtol=1e-12, atol=1e-12, err_msg=f"{name} {mean}")
        self.assertEqual(gravier.outflow(tables["some"]).total_left[-1], 10)


if __name__ == "__main__":
    unittest.main()
