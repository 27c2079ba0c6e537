"""The study of poured Platonic solids: its measure on places that are known, a small run, and what it says of its verdict."""
import os
import sys
import types
import unittest

import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, MPIEXEC, PROGRAMS, SOURCE, RunTestCase

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
import study_platonic  # noqa: E402
from gravier.shapes import Piece, Shape  # noqa: E402

PROGRAM = os.path.join(SOURCE, "drivers/studies/study_platonic.py")


def cube():
    """The shape of a cube whose corners are at 1 from its centre."""
    corner = np.array([[(k >> d & 1) * 2.0 - 1.0 for d in range(3)] for k in range(8)]) / np.sqrt(3.0)
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return Shape("cube", 1.0, 8.0 / 3.0**1.5, np.full(3, 0.2), [Piece(1e-3, corner, corner, faces)])


class Platonic(RunTestCase):

    def run_study(self, *arguments):
        environment = {**ENVIRONMENT, **os.environ, "GRAVIER_BIN_DIR": PROGRAMS, "MPIEXEC": MPIEXEC}
        return script(PROGRAM, *arguments, directory=self.scratch, environment=environment)

    def test_measure(self):
        """Cubes in rows, each at 1.25 edges from the next and turned by a quarter about an axis: 0.8^3 within five standard deviations."""
        edge, side = study_platonic.SIZE, 6
        place = (np.stack(np.meshgrid(*[np.arange(side)] * 2, np.arange(12), indexing="ij"), -1).reshape(-1, 3) + 0.5) * 1.25 * edge
        half = np.sqrt(0.5)
        turns = np.array([[1.0, 0.0, 0.0, 0.0], [half, half, 0.0, 0.0], [half, 0.0, 0.0, -half]])[np.arange(len(place)) % 3]
        bodies = types.SimpleNamespace(position=place, radius=np.full(len(place), edge * np.sqrt(3.0) / 2.0), orientation=turns)
        run = types.SimpleNamespace(bodies=lambda: bodies, shapes=lambda: [cube()])
        measured, _, height = study_platonic.solid_fraction(run, 1.25 * side, np.random.default_rng(1))
        top = 0.75 * np.quantile(place[:, 2], 0.95)
        self.assertAlmostEqual(height, top / edge - 2.0, places=9)
        # the share of the height that layers fill, of which each has 0.8^2
        heights = np.linspace(2.0 * edge, top, 200001)
        filled = np.mean(np.abs(heights / (1.25 * edge) % 1.0 - 0.5) < 0.4) * 0.64
        self.assertLess(abs(measured - filled), 5 * np.sqrt(0.25 / study_platonic.POINTS))

    def test_small_run(self):
        """60 cubes come to rest as a heap that is neither a gas nor a wall; the status says what the table does."""
        done = self.run_study("--out", "out", "--count", "60", "--solids", "cube")
        self.assertIn(done.returncode, (0, 1), done.stderr)
        with open(self.here("out", "study_platonic.csv"), encoding="ascii") as file:
            names, row = (line.strip().split(",") for line in file)
        found = dict(zip(names, row))
        self.assertEqual(found["accepted"], "yes" if done.returncode == 0 else "NO")
        self.assertGreater(float(found["measured"]), 0.45)
        self.assertLess(float(found["measured"]), 0.75)
        # a speed of 1 m/s while they rain
        self.assertLess(float(found["speed_at_end"]), 1e-2)
        self.assertIn("solid fraction", done.stdout)

    def test_refused(self):
        for arguments, text in ((("--out", "out", "--count", "3"), "--count 3: expected 20 or more"),
                                (("--out", "out", "--solids", "ball"), "invalid choice: 'ball'"), (("--slow",), "--slow")):
            done = self.run_study(*arguments)
            self.assertEqual(done.returncode, 2)
            self.assertIn(text, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
