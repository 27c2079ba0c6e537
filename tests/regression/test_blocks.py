"""gravier_blocks: walls, towers, arches and Voronoi blocks run and stand, their volumes add up, and bad figures are refused."""
import os
import sys
import unittest

import h5py
import numpy as np
from forked_scripts import script
from gravier_runs import SOURCE, RunTestCase, gravier

import gravier as package
from gravier import blocks

PROGRAM = os.path.join(SOURCE, "drivers/blocks/gravier_blocks.py")
CASES = {
    # arguments, number of blocks, volume of all (None: of the formula in the test)
    "wall": (["wall", "--bricks", "4", "--courses", "5", "--size", "0.2", "0.08"], 22, 4 * 5 * 0.2 * 0.08),
    "thick wall": (["wall", "--bricks", "3", "--courses", "4", "--size", "0.2", "0.1", "0.06"], 14, 3 * 4 * 0.2 * 0.1 * 0.06),
    "tower": (["tower", "--levels", "8", "--size", "0.1", "0.05"], 8, 8 * 0.1 * 0.05),
    "planks": (["tower", "--levels", "6", "--size", "0.12", "0.02", "0.01", "--a-level", "3"], 18, 18 * 0.12 * 0.02 * 0.01),
    "arch": (["arch", "--voussoirs", "15", "--radius", "1", "--thickness", "0.15"], 15, 15 * np.sin(np.pi / 15) * 0.15),
    "vault": (["arch", "--voussoirs", "15", "--radius", "1", "--thickness", "0.15", "--depth", "0.4"], 15, 15 * np.sin(np.pi / 15) * 0.15 * 0.4),
    "tiles": (["voronoi", "--blocks", "60", "--size", "1.0", "0.7"], 60, 0.7),
    "stones": (["voronoi", "--blocks", "40", "--size", "1.0", "0.8", "0.6", "--seed", "3", "--relax", "0"], 40, 0.48),
}
DENSITY = 2000.0


def make(arguments, directory):
    return script(PROGRAM, *arguments, directory=directory)


class BlockStructures(RunTestCase):

    def test_structures_stand(self):
        """The masses of the run are density times the volume, and nothing moves by more than the tolerance lets it."""
        for name, (arguments, number, volume) in CASES.items():
            with self.subTest(name):
                os.makedirs(self.here(name))
                made = make([*arguments, "--out", "case"], self.here(name))
                self.assertEqual((made.returncode, made.stderr), (0, ""))
                self.assertIn(f"{number} blocks, volume {volume:.9g}: case.shapes, case.csv, case.nml", made.stdout)
                run = gravier("case.nml", directory=self.here(name))
                self.assert_status(run, 0)
                self.assertIn("\nfinished    all 200 steps reached the accuracy; results", run.stdout)
                results = package.Run(run.path("case_results"))
                first, last = results.bodies(0), results.bodies()
                self.assertEqual(len(first.id), number)
                np.testing.assert_allclose(first.mass.sum(), DENSITY * volume, rtol=1e-9)
                # a free step alone makes 1e-2 m/s
                self.assertLess(np.abs(last.position - first.position).max(), 1e-4)
                self.assertLess(np.abs(last.velocity).max(), 1e-3)

    def test_planes_bear_the_weight(self):
        os.makedirs(self.here("weight"))
        made = blocks.wall(3, 3, (0.2, 0.08))
        made.write(self.here("weight", "case"))
        self.assert_status(gravier("case.nml", directory=self.here("weight")), 0)
        with h5py.File(self.here("weight", "case_results", "results.h5")) as file:
            force = file["steps/200/boundaries/force"][()]
        self.assertAlmostEqual(abs(force[0, 1]) / (DENSITY * made.volume * 9.81), 1.0, delta=1e-3)

    def test_bond(self):
        """No joint of a course lies above one of the course below."""
        made = blocks.wall(5, 4, (0.2, 0.08))
        ends = {}
        for shape, place, _ in made.bodies:
            half = 0.1 if shape == "brick" else 0.05
            ends.setdefault(round(place[1], 9), set()).update({round(place[0] - half, 9), round(place[0] + half, 9)})
        courses = [ends[height] for height in sorted(ends)]
        self.assertEqual(len(courses), 4)
        for low, high in zip(courses, courses[1:]):
            self.assertEqual(low & high, {0.0, 1.0})

    def test_voronoi_cells(self):
        """In the plane every point lies in the block whose place is nearest: areas by counting; the same seed makes the same blocks."""
        size = np.array([1.0, 0.7])
        rng = np.random.default_rng(5)
        place = rng.random((30, 2)) * size
        points = rng.random((40000, 2)) * size
        nearest = ((points[:, None] - place)**2).sum(axis=2).argmin(axis=1)
        for k, corner in enumerate(blocks._cells_2d(place, size)):
            area = blocks._centre(corner)[1]
            share = area / 0.7
            self.assertLess(abs(np.mean(nearest == k) - share), 5 * np.sqrt(share * (1 - share) / 40000))
        texts = [blocks.voronoi(20, size, seed=seed).shapes_text() for seed in (4, 4, 5)]
        self.assertEqual(texts[0], texts[1])
        self.assertNotEqual(texts[0], texts[2])

    def test_refused(self):
        """One line, status 2, no files."""
        os.makedirs(self.here("refused"))
        wall, arch = CASES["wall"][0], CASES["arch"][0]
        for arguments, text in (
                ([*wall[:2], "0", *wall[3:]], "bricks 0: expected a whole number of at least 1"),
                ([*wall[:6], "0.2"], "size 0.2: expected 2 or 3 finite numbers > 0"),
                ([*wall[:6], "0.2", "-1"], "size 0.2 -1: expected 2 or 3 finite numbers > 0"),
                ([*wall[:6], "0.2", "nan"], "size 0.2 nan: expected 2 or 3 finite numbers > 0"),
                ([*wall[:6], "0.2", "much"], "argument --size: invalid float value: 'much'"),
                ([*arch[:6], "2"], "thickness 2: expected less than twice the radius, 2"),
                ([*arch, "--friction", "-1"], "--friction -1: expected a finite number >= 0"),
                ([*arch, "--step", "0"], "--step 0: expected a finite number > 0"),
                (["tower", "--levels", "2", "--size", "1", "1", "--a-level", "2"], "2 blocks of a level: expected 1"),
                (["tower", "--levels", "2", "--size", "1", "0.6", "1", "--a-level", "2"], "2 planks of width 0.6 side by side"),
                (["voronoi", "--blocks", "3", "--size", "1", "1", "--seed", "-1"], "--seed -1: expected a number >= 0"),
                (["heap"], "invalid choice: 'heap'"), ([], "wall | tower | arch | voronoi")):
            with self.subTest(text):
                made = make(arguments, self.here("refused"))
                self.assertEqual(made.returncode, 2, made.stderr)
                self.assertIn(text, made.stderr)
                self.assertEqual(made.stderr.count("\n"), 1)
                self.assertEqual(os.listdir(self.here("refused")), [])

    def test_without_scipy(self):
        """Blocks of a box say what they need."""
        hidden = {name: sys.modules.pop(name) for name in list(sys.modules) if name.split(".")[0] == "scipy"}
        sys.modules["scipy"] = sys.modules["scipy.spatial"] = None
        try:
            with self.assertRaisesRegex(blocks.BlocksError, "Voronoi blocks of a box need scipy"):
                blocks.voronoi(5, (1.0, 1.0, 1.0))
            self.assertAlmostEqual(blocks.voronoi(5, (1.0, 2.0)).volume, 2.0, places=12)
        finally:
            del sys.modules["scipy"], sys.modules["scipy.spatial"]
            sys.modules.update(hidden)


if __name__ == "__main__":
    unittest.main()
