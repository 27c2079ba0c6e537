"""Loads are carried across: what stands on supports stands on them from the first step on, by default, with every method that is
offered for it and on any number of ranks. A residual does not see whether it does: at 1e-4 a column of 100 disks falls.

Accepted: the ground carries the weight within 5 %, and nothing moves faster than 0.05 g h. The accuracy of a solve, a tenth of g h,
counts four times for what sinks as one, so that a column sinks at 0.1/4/1.54 = 0.016 g h at most; single bodies bounce faster."""
import unittest

import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, differences, each, merged, run_case, steps_of

G, STEP = 9.81, 1e-3


def column(count, steps, **groups):
    return merged({
        "scene": {"bodies": "column", "column_count": count, "radius": 0.5, "mass": 1.0},
        "time": {"step": STEP, "steps": steps},
        "output": {"directory": "results", "every": 1, "contacts": False, "boundary_forces": True},
    }, groups)


class Loads(RunTestCase):

    def assert_carried(self, run, weight):
        """Weight on the ground after each step [N], speeds of the bodies."""
        self.assert_status(run, 0)
        history = run.history()
        force = -next(values for name, values in history.items() if name.startswith("force_y"))
        self.assertLess(np.abs(force / weight - 1.0).max(), 0.05, run.directory)
        results = run.results()
        speeds = [np.abs(results[f"/steps/{k}/bodies/velocity"][:, :2]).max() for k in steps_of(results) if k > 0]
        self.assertLess(max(speeds) / (G * STEP), 0.05, run.directory)

    def test_columns(self):
        counts = 10, 30, 100
        runs = each(lambda n: run_case(column(n, 60), directory=self.here(f"column {n}")), [(n,) for n in counts])
        for n, run in zip(counts, runs):
            with self.subTest(count=n):
                self.assert_carried(run, n * G)

    def test_residual_alone(self):
        """The same column by the residual alone falls, and the run says so: the reason why it is not the default."""
        run = run_case(column(100, 20, solver={"criterion": "residual", "tolerance": 1e-4}), directory=self.here("by residual"))
        self.assert_status(run, 0)
        history = run.history()
        self.assertGreater((history["velocity_error"] / history["velocity_scale"]).max(), 0.3)

    def test_layers(self):
        """A cold start of a high column takes a pass over layers in the place of its many iterations."""
        with_layers, without = each(lambda name, on: run_case(column(100, 1, solver={"layered_start": on}), directory=self.here(name)),
                                    [("with", True), ("without", False)])
        self.assert_carried(with_layers, 100 * G)
        self.assert_status(without, 0)
        self.assertLess(with_layers.history()["iterations"][0], 0.5 * without.history()["iterations"][0])

    def test_subdomains_and_ranks(self):
        """Depths, sums of the estimate and layers cross subdomains, and are the same bits on any number of ranks."""
        for method in "nscdd", "schwarz", "newton":
            with self.subTest(method):
                case = column(100, 4, solver={"method": method}, decomposition={"subdomains": 4, "grid": [1, 4]},
                              scene={"friction": 0.5})
                runs = each(lambda n: run_case(case, n, self.here(f"{method} on {n}")), [(n,) for n in SOME_RANKS])
                self.assert_carried(runs[0], 100 * G)
                tables = [run.history() for run in runs]
                for table in tables:
                    for name in "wall_seconds", "solve_seconds":
                        del table[name]
                for run, table in zip(runs[1:], tables[1:]):
                    self.assert_status(run, 0)
                    self.assertEqual(differences(tables[0], table), [], "history")
                    self.assertEqual(differences(runs[0].results(), run.results()), [], "results")

    def test_units(self):
        """The estimate over its scale, and so the number of iterations, does not know of units."""
        cases = [column(40, 3, scene={"radius": 0.5 * length, "mass": mass, "gravity": [0.0, -G * length, 0.0]})
                 for length, mass in ((1.0, 1.0), (2.0**-20, 2.0**30))]
        runs = each(lambda k: run_case(cases[k], directory=self.here(f"unit {k}")), [(0,), (1,)])
        tables = [run.history() for run in runs]
        self.assertEqual(tables[0]["iterations"].tolist(), tables[1]["iterations"].tolist())
        ratios = [table["velocity_error"] / table["velocity_scale"] for table in tables]
        np.testing.assert_allclose(ratios[0], ratios[1], rtol=1e-9)


if __name__ == "__main__":
    unittest.main()
