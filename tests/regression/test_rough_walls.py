"""Rough walls from the outer grains of a sample (gravier.rough_walls): groups, planes and forces of the file that it writes, and a run from it."""
import os
import pathlib

import h5py
import numpy as np

from forked_scripts import script
from gravier_runs import SOURCE, RunTestCase, run_case, write
import gravier

RADIUS, COLUMNS, ROWS = 0.01, 8, 5


class RoughWalls(RunTestCase):

    def setUp(self):
        """A square lattice of disks that touch, between two planes and two that hold them along x, with a force at each contact."""
        os.makedirs(self.here(self.id()))
        self.sample = self.here(self.id(), "sample.h5")
        places = np.array([[RADIUS * (2 * i + 1), RADIUS * (2 * j + 1)] for j in range(ROWS) for i in range(COLUMNS)])
        up = [(COLUMNS * j + i + 1, COLUMNS * (j - 1) + i + 1 if j else -2) for j in range(ROWS) for i in range(COLUMNS)]
        top = [(COLUMNS * (ROWS - 1) + i + 1, -1) for i in range(COLUMNS)]
        side = [(COLUMNS * j + i + 1, COLUMNS * j + i) for j in range(ROWS) for i in range(1, COLUMNS)]
        self.pairs = np.array(up + top + side)
        normals = np.array([[0.0, 1.0]] * len(up) + [[0.0, -1.0]] * len(top) + [[1.0, 0.0]] * len(side))
        wide, high = 2 * RADIUS * COLUMNS, 2 * RADIUS * ROWS
        with h5py.File(self.sample, "w") as file:
            file["bodies/id"], file["bodies/position"], file["bodies/radius"] = np.arange(1, len(places) + 1), places, np.full(len(places), RADIUS)
            file["walls/id"] = [101, 102, 103, 104]
            file["walls/point"] = [[0.0, high], [0.0, 0.0], [0.0, 0.0], [wide, 0.0]]
            file["walls/normal"] = [[0.0, -1.0], [0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]]
            file["contacts/candidate"], file["contacts/antagonist"] = self.pairs.T
            file["contacts/normal"], file["contacts/force"] = normals, 3.0 * normals
            file["contacts/point"] = places[self.pairs[:, 0] - 1] - RADIUS * normals
            file["contacts/boundaries"] = np.array([b"wall 101\nwall 102"])

    def test_both_sides(self):
        """The outer rows are groups, their planes and the forces on these and within a row are gone; a run takes all that is left."""
        path = self.here(self.id(), "made/rough.h5")
        self.assertEqual(gravier.rough_walls(self.sample, path, {"+y": 7, "-y": 4}), {"+y": COLUMNS, "-y": COLUMNS})
        with h5py.File(path) as file:
            self.assertEqual(file["bodies/group"][()].tolist(), [4] * COLUMNS + [0] * (COLUMNS * (ROWS - 2)) + [7] * COLUMNS)
            self.assertEqual(file["walls/id"][()].tolist(), [103, 104])
            self.assertEqual(file["walls/normal"][()].tolist(), [[1.0, 0.0], [-1.0, 0.0]])
            pairs = np.transpose([file["contacts/candidate"], file["contacts/antagonist"]])
            row = (self.pairs - 1) // COLUMNS
            outer = (row[:, 0] == row[:, 1]) & np.isin(row[:, 0], (0, ROWS - 1))
            np.testing.assert_array_equal(pairs, self.pairs[(self.pairs[:, 1] > 0) & ~outer])
            self.assertEqual(file["contacts/force"].shape, pairs.shape)
        run = run_case({"scene": {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": "made/rough.h5", "density": 2500.0},
                        "boundary": [{"name": name, "shape": "grains", "group": group} for name, group in (("lower", 4), ("upper", 7))],
                        "time": {"step": 1e-3, "steps": 1}, "output": {"directory": "results"}}, 1, self.here(self.id()))
        self.assert_status(run, 0)
        self.assertIn(f"start       from forces of the bodies file: {len(pairs)} of its {len(pairs)} contacts touch in the first step", run.stdout)

    def test_command(self):
        """gravier_rough_walls writes the same file, with groups in the order of the sides, and refuses what the function refuses in one line."""
        path = self.here(self.id(), "made.h5")
        gravier.rough_walls(self.sample, path, {"+y": 1, "-y": 2})

        def call(*arguments):
            return script(os.path.join(SOURCE, "drivers/rough_walls/gravier_rough_walls.py"), *arguments, directory=self.here(self.id()))
        done = call("sample.h5", "--sides", "+y,-y", "--out", "rough.h5")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, f"+y: group 1, {COLUMNS} grains\n-y: group 2, {COLUMNS} grains\nrough.h5\n", ""))
        with h5py.File(path) as wanted, h5py.File(self.here(self.id(), "rough.h5")) as found:
            for name in ("bodies/group", "walls/id", "contacts/candidate", "contacts/antagonist", "contacts/force"):
                np.testing.assert_array_equal(found[name][()], wanted[name][()])
        done = call("sample.h5", "--sides", "-y,+y", "--depth", "0.035", "--out", "rough.h5")
        self.assertEqual(done.stdout, f"-y: group 1, {2 * COLUMNS} grains\n+y: group 2, {2 * COLUMNS} grains\nrough.h5\n")
        for arguments, words in ((["--sides", "-y,-y"], "--sides -y,-y: a side twice; expected each side once"), (["--sides", "-z"], "side '-z': expected + or - and one of x, y"),
                                 (["--sides", "-y", "--depth", "0"], "argument --depth: '0': expected a number > 0")):
            done = call("sample.h5", *arguments, "--out", "none.h5")
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
            self.assertIn(f"gravier_rough_walls: error: {words}", done.stderr)
            self.assertFalse(os.path.exists(self.here(self.id(), "none.h5")))

    def test_one_side(self):
        """Two rows along x; forces on a plane that stays keep it, whatever its place among the names."""
        path = self.here(self.id(), "rough.h5")
        self.assertEqual(gravier.rough_walls(self.sample, path, {"+y": 1}, 3.5 * RADIUS), {"+y": 2 * COLUMNS})
        with h5py.File(path) as file:
            self.assertEqual(file["contacts/boundaries"][()].tolist(), [b"wall 102"])
            self.assertEqual(np.sum(file["contacts/antagonist"][()] == -1), COLUMNS)
            self.assertEqual(file["contacts/antagonist"][()].min(), -1)
            self.assertEqual(file["walls/id"][()].tolist(), [102, 103, 104])

    def test_refusals(self):
        """What is no side, what has no plane or no grain, what is taken already; a file of another origin stays."""
        path = pathlib.Path(self.here(self.id(), "rough.h5"))
        for sides, depth, words in (({"up": 1}, None, "side 'up': expected \\+ or - and one of x, y$"), ({"-z": 1}, None, "side '-z': expected"),
                                    ({"-y": 0}, None, "-y: group 0: expected a whole number above 0$"), ({"-y": 1}, 0.0, "depth = 0.0: expected a length above 0"),
                                    ({"-y": 1}, 0.5 * RADIUS, "no grain nearer to -y than 0.005 m; expected a larger depth"),
                                    ({"-y": 1, "-x": 2}, None, "grains near -x are in group 1 already; expected sides farther apart, or a smaller depth")):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.rough_walls(self.sample, path, sides, depth)
            self.assertFalse(path.exists())
        write(path, "mine")
        with self.assertRaisesRegex(gravier.ResultsError, "rough.h5: "):
            gravier.rough_walls(self.sample, path, {"-y": 1})
        self.assertEqual(path.read_text(), "mine")
        path.unlink()
        with h5py.File(self.sample, "a") as file:
            del file["walls/id"], file["walls/normal"]
            file["walls/id"], file["walls/normal"] = [101, 102, 103, 104], [[0.0, 1.0]] * 4
        for sides, number in (({"+y": 1}, 0), ({"-y": 1}, 4)):
            with self.assertRaisesRegex(gravier.ResultsError, f"{number} planes on the side .y; expected one"):
                gravier.rough_walls(self.sample, path, sides)
