"""The study of rheology: its power law on values of a known one, its bounds, and a quick run."""
import csv
import os
import sys
import unittest

import numpy as np

from gravier_runs import SOURCE, StudyTestCase

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
import oracle_table  # noqa: E402
import study_rheology  # noqa: E402


class Rheology(StudyTestCase):

    study = os.path.join(SOURCE, "drivers/studies/study_rheology.py")

    def test_power_law(self):
        numbers = np.array([1e-4, 1e-3, 1e-2, 3e-2, 1e-1])
        for mu_0, s, n in ((0.36, 0.3, 0.5), (0.25, 1.1, 1.0), (0.3, 0.2, 0.28)):
            errors = np.array([0.01, 0.01, 0.001, 0.001, 0.001])
            *found, error = study_rheology.power_law(numbers, mu_0 + s * numbers**n, errors)
            np.testing.assert_allclose(found, (mu_0, s, n), atol=0.02)
            # a value counts by its error
            *found, _ = study_rheology.power_law(numbers, mu_0 + s * numbers**n + [0.05, 0.0, 0.0, 0.0, 0.0], np.array([1.0, *errors[1:]]))
            np.testing.assert_allclose(found, (mu_0, s, n), atol=0.02)
            self.assertLess(error, 0.1)
            *_, scattered = study_rheology.power_law(numbers, mu_0 + s * numbers**n + [0.0, 0.0, 0.01, -0.01, 0.0], errors)
            self.assertGreater(scattered, error)

    def test_bounds(self):
        """Values of the publications are within the bounds; those beyond are not."""
        def misses(mu, phi):
            table = oracle_table.Table(quiet=True)
            study_rheology.compare(table, {2: [(1e-3, 0.2511 + mu, 0.8097 + phi, 0.01, 0.001)], 3: [(1e-4, 0.357 + mu, 0.596 + phi, 0.01, 0.001)]})
            return len(table.misses)
        self.assertEqual([misses(0.0, 0.0), misses(0.049, -0.019), misses(0.051, 0.0), misses(0.0, 0.021)], [0, 0, 2, 2])

        def of_fast_spheres(mu, phi):
            table = oracle_table.Table(quiet=True)
            study_rheology.compare(table, {2: [], 3: [(0.1, mu, phi, 0.01, 0.001)]})
            return len(table.misses)
        self.assertEqual([of_fast_spheres(0.411, 0.55), of_fast_spheres(0.30, 0.55), of_fast_spheres(0.411, 0.62), of_fast_spheres(np.nan, np.nan)],
                         [0, 1, 1, 2])

    def test_quick(self):
        """Friction and solid fraction of disks are those of the publication; the status says what the table does."""
        done = self.run_study("--out", "out", "--quick")
        with open(self.here("out", "study_rheology.csv"), encoding="ascii", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(done.returncode, int(any(row["within"] == "NO" for row in rows)), done.stderr)
        self.assertEqual([row["oracle"] for row in rows], ["disks"] * 4 + ["spheres"] * 2)
        self.assertEqual([row["within"] for row in rows], ["yes"] * 6, rows)
        self.assertTrue(os.path.exists(self.here("out", "study_rheology.png")))

    def test_steps(self):
        """Slow flows have steps in which the flow is not lost against the impulses, fast ones those of a strain of 0.005 sqrt(I)."""
        for number, step in ((1e-4, 0.015), (1e-3, 0.0474342), (1e-2, 0.05), (1e-1, 0.0158114)):
            self.assertAlmostEqual(study_rheology.step_of(number), step, places=6)

    def test_refused(self):
        for arguments in (("--slow",), ("--least", "1e-3", "1e-3", "1e-3"), ("--least", "slow"), ("--least", "5"), ("--quick", "--least", "1e-3")):
            done = self.run_study(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
