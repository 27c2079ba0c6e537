"""The sieve curve by mass: of sizes whose distribution is known, of bodies with shapes, of states and bodies files, and its command and picture."""
import os
import sys
import unittest

import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, run_case, write
import gravier
from gravier.bodies_table import BodiesTable

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import sieve_picture  # noqa: E402

MEASURE = os.path.join(SOURCE, "drivers/measure/gravier_measure.py")
COUNT = 4000


def bodies_csv(radii, dimension, **columns):
    """A bodies file of grains in a row."""
    names = "id,radius," + ",".join("xyz"[:dimension]) + "".join(f",{name}" for name in columns)
    rows = [",".join([str(k + 1), repr(float(radius)), *["0.0"] * (dimension - 1), repr(2.1 * radii.max() * k + radii.max()), *(repr(values[k]) for values in columns.values())])
            for k, radius in enumerate(radii)]
    return names + "\n" + "\n".join(rows) + "\n"


class Sieve(RunTestCase):

    def measure(self, *arguments, status=0):
        done = script(MEASURE, "sieve", *arguments, directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual(done.returncode, status, done.stderr)
        return done

    def test_known_distributions(self):
        """Diameters that are dealt out evenly from d0 to d1 have the mass (d^(n + 1) - d0^(n + 1)) / (d1^(n + 1) - d0^(n + 1)) below d, where masses go with d^n; those whose mass is even
        over the logarithm of the size have a straight line."""
        for dimension in (2, 3):
            low, high, n = 2e-3, 1e-2, dimension + 1
            size = low + (high - low) * (np.arange(COUNT) + 0.5) / COUNT
            path = write(self.here(f"even{dimension}.csv"), bodies_csv(np.random.default_rng(1).permutation(0.5 * size), dimension))
            table, sizes = gravier.sieve(BodiesTable(path)), gravier.sieve_sizes(BodiesTable(path))
            np.testing.assert_allclose(table.passing, 100.0 * (table.size**n - low**n) / (high**n - low**n), atol=0.1)
            np.testing.assert_allclose(table.grains, COUNT * (table.size - low) / (high - low), atol=1.0)
            self.assertEqual((table.passing[-1], table.grains[-1]), (100.0, COUNT))
            goal = {part: (low**n + part / 100 * (high**n - low**n))**(1 / n) for part in (10, 30, 50, 60)}
            for part, value in goal.items():
                np.testing.assert_allclose(sizes[f"D{part}"], value, rtol=1e-3)
            np.testing.assert_allclose((sizes.C_u[0], sizes.C_c[0]), (goal[60] / goal[10], goal[30]**2 / (goal[10] * goal[60])), rtol=2e-3)
        logarithms = np.geomspace(1e-3, 1e-2, COUNT)
        path = write(self.here("log.csv"), bodies_csv(0.5 * logarithms, 2, mass=np.full(COUNT, 0.1).tolist()))
        sizes = gravier.sieve_sizes(BodiesTable(path))
        np.testing.assert_allclose([sizes.D10[0], sizes.D60[0], sizes.C_u[0]], [10**-2.9, 10**-2.4, 10**0.5], rtol=2e-3)

    def test_two_sizes(self):
        """Sizes of a mixture of two are these two; grains of a group are rows of walls and do not count; a hole of a size lets it through."""
        radii = np.array([0.01] * 30 + [0.02] * 10 + [0.05] * 5)
        path = write(self.here("two.csv"), bodies_csv(radii, 2, group=[0] * 40 + [1] * 5))
        table, sizes = gravier.sieve(BodiesTable(path), sieves=[0.04, 0.02, 0.01, 0.03]), gravier.sieve_sizes(BodiesTable(path))
        np.testing.assert_array_equal(table.size, [0.01, 0.02, 0.03, 0.04])
        np.testing.assert_allclose(table.passing, [0.0, 300.0 / 7.0, 300.0 / 7.0, 100.0], rtol=1e-12)
        np.testing.assert_array_equal(table.grains, [0, 30, 30, 40])
        self.assertEqual((sizes.D10[0], sizes.D50[0], sizes.C_u[0]), (0.02, 0.04, 2.0))
        done = self.measure("two.csv", "--sieves", "20mm", "0.03")
        self.assertEqual(done.stdout, "D10 0.02 m, D30 0.02 m, D50 0.04 m, D60 0.04 m, C_u 2, C_c 0.5\ntwo_sieve.csv\n")
        with open(self.here("two_sieve.csv")) as file:
            self.assertEqual(file.read(), "size,passing,grains\n0.02,42.8571429,30\n0.03,42.8571429,30\n")

    def test_runs(self):
        """A run with shapes: the size is the diameter of the ball of the volume, as masses tell it. A bodies file of shapes has no volumes; the command reads one of spheres, and draws."""
        write(self.here("stones.shapes"), "shape die\ncube 1\n")
        case = {"scene": {"bodies": "sample", "dimension": 3, "shapes": "stones.shapes", "gravity": [0.0, 0.0, 0.0], "density": 2000.0},
                "sample": {"count": 40, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "grain_shapes": "die, sphere", "grain_shares": [1, 1],
                           "box": [0.07, 0.07]},
                "time": {"step": 1e-3, "steps": 2}, "output": {"directory": "stones", "every": 1, "final_bodies": True}}
        self.assert_status(run_case(case, directory=self.scratch), 0)
        run = gravier.Run(self.here("stones"))
        bodies = run.bodies()
        self.assertEqual(len(set(bodies.shape)), 2)
        size = np.sort((6.0 * bodies.mass / (np.pi * 2000.0))**(1.0 / 3.0))
        table, sizes = gravier.sieve(run, sieves=size), gravier.sieve_sizes(run, 0)
        np.testing.assert_allclose(table.passing, 100.0 * np.cumsum(size**3) / np.sum(size**3), rtol=1e-9)
        np.testing.assert_allclose(sizes.D50, size[np.searchsorted(np.cumsum(size**3), 0.5 * np.sum(size**3))], rtol=1e-9)
        done = self.measure("stones", "--step", "1", "--plot", "sieve.png")
        self.assertEqual(done.stdout.splitlines()[1:], ["stones/sieve.csv", "sieve.png"])
        self.assertGreater(os.path.getsize(self.here("sieve.png")), 5000)
        for arguments, words in ((["stones/final_bodies.h5"], "stones/final_bodies.h5: bodies with shapes, whose volumes this file does not have; expected the directory of a run"),
                                 (["stones", "--step", "7"], "no step 7; expected one of 0, 1, 2"), (["nothing.h5"], "nothing.h5"), (["stones", "--sieves", "0"], "'0': expected a number > 0"), (["stones", "--sieves", "3km"], "'3km': expected a number > 0, with the unit m, mm or um or without one")):
            self.assertIn(words, self.measure(*arguments, status=2).stderr)
        for group, name in (("sample", "grain_shapes"), ("sample", "grain_shares"), ("scene", "shapes")):
            del case[group][name]
        case["output"]["directory"] = "balls"
        self.assert_status(run_case(case, directory=self.scratch), 0)
        done = self.measure("balls/final_bodies.h5")
        self.assertEqual(done.stdout.splitlines()[1], "balls/final_bodies_sieve.csv")
        found, goal = gravier.read_table(self.here("balls/final_bodies_sieve.csv")), gravier.sieve(gravier.Run(self.here("balls")))
        np.testing.assert_allclose(found.passing, goal.passing, rtol=1e-8)

    def test_picture(self):
        """The size is on a logarithmic axis with numbers; bodies of one size are a step."""
        for radii in (0.01 * np.geomspace(0.5, 2.0, 50), np.full(9, 0.01)):
            path = write(self.here("some.csv"), bodies_csv(radii, 2))
            run = BodiesTable(path)
            axes = sieve_picture.draw_sieve(gravier.sieve(run), gravier.sieve_sizes(run)).axes[0]
            axes.figure.canvas.draw()
            self.assertEqual((axes.get_xscale(), axes.get_xlabel(), axes.get_ylabel()), ("log", "size [m]", "passing by mass [%]"))
            self.assertGreater(sum(bool(label.get_text()) for label in axes.get_xticklabels()), 2)
            self.assertEqual(axes.lines[0].get_ydata()[-1], 100.0)
            self.assertEqual(len(axes.get_legend().get_texts()), 4)
            sieve_picture.plt.close("all")


if __name__ == "__main__":
    unittest.main()
