"""The study of sound: its matrix of springs on a pair that is known, the quick run, and a verdict that can fail."""
import csv
import os
import sys
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

from gravier_runs import PROGRAMS, SOURCE, StudyTestCase

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
import study_sound  # noqa: E402


class Sound(StudyTestCase):

    study = os.path.join(SOURCE, "drivers/studies/study_sound.py")

    def test_matrix_of_a_pair(self):
        """Two disks through the side of the cell: a stretch costs k, a slide the tangential stiffness, a common turn about the middle
        of both nothing."""
        r = study_sound.RADIUS
        pair = study_sound.Cell([[0.5 * r, 0.0], [9.5 * r, 0.0]], [r, r], (10.0 * r + 0.999 * r, 0.0), True)
        self.assertEqual(len(pair.contacts()[0]), 1)
        k = pair.stiffness()
        for motion, energy in (((1, 0, 0, 0, 0, 0), study_sound.STIFFNESS), ((0, 1, 0, 0, 0, 0), study_sound.RATIO * study_sound.STIFFNESS),
                               ((1, 1, 0, 1, 1, 0), 0.0), ((0, 0, 1 / r, 0, 0, -1 / r), 0.0),
                               ((0, 0, 1 / r, 0, 0, 1 / r), 4.0 * study_sound.RATIO * study_sound.STIFFNESS)):
            motion = np.array(motion, float)
            self.assertAlmostEqual(motion @ k @ motion, energy, delta=1e-9 * study_sound.STIFFNESS)

    def test_quick(self):
        done = self.run_study("--out", "out", "--quick")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        with open(self.here("out", "study_sound.csv"), encoding="ascii", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual({row["oracle"] for row in rows}, {"chain", "lattice", "sticking", "packing"})
        self.assertEqual({row["within"] for row in rows}, {"yes", ""})
        self.assertLess(max(float(row["measured"]) for row in rows if "effective" in row["quantity"]), 1.0)

    def test_verdict(self):
        """Springs a tenth stiffer than those of the expected mode swing faster by the root of that, far outside the bounds."""
        chain = study_sound.chain(8)
        run = study_sound.run

        def stiffer(folder, groups):
            groups["law"][0]["normal_stiffness"] *= 1.1
            return run(folder, groups)

        with mock.patch.object(study_sound, "run", stiffer), mock.patch("study_support.BINARIES", PROGRAMS):
            found, expected, _ = chain.swing(Path(self.here("stiffer")), 1, 0)
        self.assertAlmostEqual(found / expected, np.sqrt(1.1), delta=2e-3)

    def test_refused(self):
        done = self.run_study("--slow")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
