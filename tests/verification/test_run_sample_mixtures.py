"""Samples of several materials, and samples that move: the same bytes on any number of ranks, shares and densities as asked for, a momentum
that is exact, a gas of elastic disks without a script, and what is refused."""
import hashlib
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, each, gravier, merged, namelist, run_case, write

DENSITY = {1: 1000.0, 2: 8000.0, 3: 500.0}
MIXTURE = {
    "scene": {"dimension": 3, "bodies": "sample", "density": 1000.0, "friction": 0.3},
    "sample": {"count": 900, "box": [0.3, 0.3], "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "file": "sample.h5",
               "grain_materials": "steel, cork", "material_shares": [1.0, 2.0], "velocity": [0.5, 0.0, -1.0],
               "velocity_spread": [2.0, 0.0, 1.0]},
    "material": [{"name": "glass"}, {"name": "steel", "density": 8000.0}, {"name": "cork", "density": 500.0}],
    "time": {"step": 1e-3, "steps": 0},
}
SHAPES = merged(MIXTURE, {"scene": {"shapes": "a.shapes"}})
#: 400 elastic disks in a periodic square
GAS = {
    "scene": {"dimension": 2, "bodies": "sample", "density": 1000.0, "restitution": 1.0, "gravity": [0.0, 0.0], "period": [0.2, 0.2]},
    "sample": {"count": 400, "radius": 0.001, "box": [0.2, 0.2], "velocity_spread": [1.0, 1.0]},
    "time": {"step": 5e-5, "steps": 200},
    "output": {"every": 200, "history_every": 100},
}


def sample(case, directory, ranks=1):
    os.makedirs(directory, exist_ok=True)
    write(os.path.join(directory, "a.shapes"), "shape die\ncube 0.5\n")
    write(os.path.join(directory, "case.nml"), namelist(case))
    return gravier("case.nml", ranks=ranks, directory=directory, program="gravier_sample")


class Bodies:
    def __init__(self, path):
        with h5py.File(path) as file:
            self.material, self.mass, self.radius, self.velocity, self.position = (
                file["bodies/" + name][()] for name in ("material", "mass", "radius", "velocity", "position"))


class Mixtures(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        jobs = [(name, case, ranks) for name, case in (("mixture", MIXTURE), ("shapes", SHAPES)) for ranks in (1, 2)]
        runs = each(lambda name, case, ranks: sample(case, os.path.join(cls.scratch, f"{name} {ranks}"), ranks), jobs)
        cls.runs = {(name, ranks): run for (name, _, ranks), run in zip(jobs, runs)}

    def bodies(self, name):
        self.assert_status(self.runs[name, 1], 0)
        return Bodies(self.runs[name, 1].path("sample.h5"))

    def test_same_bytes_on_any_ranks(self):
        for name in ("mixture", "shapes"):
            digests = set()
            for ranks in (1, 2):
                with open(self.runs[name, ranks].path("sample.h5"), "rb") as file:
                    digests.add(hashlib.sha256(file.read()).hexdigest())
            self.assertEqual(len(digests), 1, name)

    def test_materials(self):
        """A third is steel, within four standard deviations; masses have the densities, and the height is that of the volumes."""
        for name, volume in (("mixture", 4 / 3 * np.pi), ("shapes", (2 / np.sqrt(3)) ** 3)):
            bodies = self.bodies(name)
            self.assertEqual(set(bodies.material), {2, 3})
            self.assertLess(abs(np.mean(bodies.material == 2) - 1 / 3), 4 * np.sqrt(2) / 3 / np.sqrt(900))
            # the radius says nothing of the material
            self.assertLess(abs(np.corrcoef(bodies.radius, bodies.material)[0, 1]), 4 / np.sqrt(900))
            np.testing.assert_allclose(bodies.mass, np.array([DENSITY[k] for k in bodies.material]) * volume * bodies.radius**3, rtol=1e-12)
            height = np.sum(4 / 3 * np.pi * bodies.radius**3) / (0.2 * 0.3 * 0.3)
            top = (bodies.position[:, 2] + bodies.radius).max()
            self.assertLessEqual(top, height * (1 + 1e-12))
            self.assertGreater(top, 0.97 * height)

    def test_velocities(self):
        """Uniform within the spread about the velocity of the whole, whose momentum is exact; no spins."""
        for name in ("mixture", "shapes"):
            bodies = self.bodies(name)
            momentum = bodies.mass @ bodies.velocity / bodies.mass.sum()
            np.testing.assert_allclose(momentum, [0.5, 0.0, -1.0, 0.0, 0.0, 0.0], atol=1e-14)
            self.assertFalse(bodies.velocity[:, 3:].any())
            self.assertFalse(bodies.velocity[:, 1].any())
            for d, spread in ((0, 2.0), (2, 1.0)):
                apart = bodies.velocity[:, d] - bodies.velocity[:, d].mean()
                self.assertLess(abs(apart.std() - spread / np.sqrt(3)), 4 * 0.26 * spread / np.sqrt(900))
                self.assertGreater(np.ptp(apart), 1.98 * spread)
                self.assertLessEqual(np.ptp(apart), 2 * spread)
            self.assertLess(abs(np.corrcoef(bodies.velocity[:, 0], bodies.velocity[:, 2])[0, 1]), 4 / np.sqrt(900))

    def test_equal_shares_and_a_single_name(self):
        """Without shares all materials are as likely; one name is that of all grains."""
        both = sample(merged(MIXTURE, {"sample": {"material_shares": None}}), self.here("equal"))
        self.assert_status(both, 0)
        self.assertLess(abs(np.mean(Bodies(both.path("sample.h5")).material == 2) - 0.5), 4 * 0.5 / np.sqrt(900))
        one = sample(merged(MIXTURE, {"sample": {"material_shares": None, "grain_materials": "cork"}}), self.here("one"))
        self.assert_status(one, 0)
        self.assertEqual(set(Bodies(one.path("sample.h5")).material), {3})

    def test_gas_without_a_script(self):
        """The momentum of a gas stays 0 and its energy what the draw gives, on one and two ranks alike."""
        runs = each(lambda ranks: run_case(GAS, ranks, self.here(f"gas {ranks}")), [(1,), (2,)])
        for run in runs:
            self.assert_status(run, 0)
        results = [run.results() for run in runs]
        first, last = (results[0][f"/steps/{step}/bodies/velocity"] for step in (0, 200))
        np.testing.assert_array_equal(last, results[1]["/steps/200/bodies/velocity"])
        self.assertLess(np.abs(first[:, :2].mean(axis=0)).max(), 1e-15)
        self.assertLess(np.abs(last[:, :2].mean(axis=0)).max(), 1e-13)
        energies = [np.sum(v[:, :2] ** 2) for v in (first, last)]
        self.assertLess(abs(energies[0] / 400 / (2 / 3) - 1), 4 * 0.63 / np.sqrt(400))
        self.assertLess(abs(energies[1] / energies[0] - 1), 1e-9)
        # they have met
        self.assertGreater(np.abs(last - first).max(), 0.5)

    def test_refused(self):
        """One line, status 2, no bodies file."""
        refused = {
            "unknown": ({"grain_materials": "steel, lead"}, "&sample grain_materials = 'steel, lead': expected 'glass', 'steel' or 'cork'"),
            "empty": ({"grain_materials": "steel,"}, "&sample grain_materials = 'steel,': expected the name of a material before and behind"),
            "shares": ({"material_shares": [1.0]}, "&sample material_shares = 1.0: expected a share above 0 for each of the 2 grain_materials"),
            "no names": ({"grain_materials": None}, "&sample material_shares = 1.0, 2.0: expected it where grain_materials has one name to 8"),
            "spread": ({"velocity_spread": [1.0, -1.0]}, "&sample velocity_spread = 1.0, -1.0: expected at most 3 finite real numbers >= 0"),
            "prepared": ({"preparation": "settled"}, "&sample velocity"),
        }
        for name, (change, text) in refused.items():
            with self.subTest(name):
                run = sample(merged(MIXTURE, {"sample": change}), self.here("refused-" + name))
                self.assert_status(run, 2)
                self.assertIn(text, run.stderr)
                self.assertEqual(len(run.stderr.splitlines()), 1)
                self.assertFalse(any(file.endswith((".h5", ".log")) for file in os.listdir(run.directory)))


if __name__ == "__main__":
    unittest.main()
