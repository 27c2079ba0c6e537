"""The study of forces: its exponents on forces drawn from known distributions, and a quick run."""
import csv
import os
import sys
import unittest

import numpy as np

from gravier_runs import SOURCE, StudyTestCase

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
import study_forces  # noqa: E402


class Forces(StudyTestCase):

    study = os.path.join(SOURCE, "drivers/studies/study_forces.py")

    def test_exponents(self):
        """Forces above 1 fall as exp(-beta f), and those below go as f^alpha, by construction."""
        rng = np.random.default_rng(3)
        for beta, alpha, share in ((1.4, -0.3, 0.4), (0.8, 0.5, 0.7), (2.5, 0.0, 0.2)):
            n = 400000
            strong = 1.0 - np.log(rng.random(int(share * n))) / beta
            weak = rng.random(n - len(strong))**(1.0 / (1.0 + alpha))
            found = study_forces.exponents(np.concatenate([strong, weak]))
            for value, expected, off in zip(found, (beta, alpha, share), (0.02, 0.03, 1e-12)):
                self.assertAlmostEqual(value, expected, delta=off)
            self.assertAlmostEqual(study_forces.slope(weak), alpha, delta=0.03)
        # weak forces that are no power of f: even from a tenth of the mean on, as many again below
        even = np.concatenate([rng.random(90000) * 0.9 + 0.1, rng.random(90000) * 0.1])
        self.assertAlmostEqual(study_forces.exponents(even)[1], -1.0 / np.log(even).mean() - 1.0, delta=1e-12)
        self.assertLess(study_forces.exponents(even)[1], -0.4)

    def test_quick(self):
        """The strong forces are those of the publication; the status says what the table does."""
        done = self.run_study("--out", "out", "--quick")
        with open(self.here("out", "study_forces.csv"), encoding="ascii", newline="") as file:
            rows = {(row["oracle"], row["quantity"].split(",")[0]): row for row in csv.DictReader(file)}
        self.assertEqual(done.returncode, int(any(row["within"] == "NO" for row in rows.values())), done.stderr)
        self.assertEqual(len(rows), 11)
        for name in ("rigid", "springs"):
            self.assertEqual(rows[name, "beta"]["within"], "yes", rows)
            self.assertEqual(rows[name, "alpha"]["within"], "yes", rows)
            self.assertEqual(rows[name, "share of forces above the mean"]["within"], "yes", rows)
        self.assertTrue(os.path.exists(self.here("out", "study_forces.png")))

    def test_refused(self):
        done = self.run_study("--slow")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
