"""Periodic cells, and scenes on one domain and on several: what is one scene gives one result."""
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, differences, merged, run_case, settled_disks, write

LENGTH = 0.504
STEP = 1e-3


class Periodic(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run = run_case({
            "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [20, 10], "radius_min": 0.008, "radius_max": 0.012,
                      "friction": 0.3, "period": [LENGTH, 0.0]},
            "time": {"step": STEP, "steps": 220}, "solver": {"tolerance": 1e-3, "max_iterations": 3000},
            "output": {"directory": ".", "every": 0, "final_bodies": True}}, directory=cls.scratch)
        if run.status != 0:
            raise AssertionError(f"the layer was not made: {run}")
        cls.layer = run.path("final_bodies.h5")
        cls.case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": cls.layer, "friction": 0.0},
            "time": {"step": STEP, "steps": 1},
            "solver": {"tolerance": 1e-10, "max_iterations": 100000, "warm_start": False},
            "output": {"directory": "results", "stress": True, "energy": True}}

    def test_flight_round_the_cell(self):
        """A grain that nothing meets crosses the cell of a scene with one and with three periodic axes many times."""
        for dimension, period in ((2, [0.3, 0.0]), (3, [0.3, 0.2, 0.25])):
            here = self.here(f"flight {dimension}")
            os.makedirs(here)
            place, speed = np.array([0.1, 0.1, 0.1])[:dimension], np.array([7.3, 0.1, -4.1])[:dimension]
            write(os.path.join(here, "one.csv"), ",".join(["id", *"xyz"[:dimension], "radius", *(f"v{a}" for a in "xyz"[:dimension])])
                  + "\n" + ",".join(map(str, [1, *place, 0.01, *speed])) + "\n")
            run = run_case({"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "one.csv", "gravity": [0.0] * 3,
                                      "period": period},
                            "time": {"step": 1e-3, "steps": 400}, "output": {"directory": "results", "every": 100}}, directory=here)
            self.assert_status(run, 0)
            results = run.results()
            lengths = np.array(period)
            for step in (100, 200, 300, 400):
                x, image = results[f"/steps/{step}/bodies/position"][0], results[f"/steps/{step}/bodies/image"][0]
                np.testing.assert_allclose(x + image * lengths, place + speed * 1e-3 * step, rtol=0.0, atol=1e-12)
            self.assertGreater(abs(image[0]), 8)

    def test_a_layer_moved_by_half_a_period(self):
        """The same contacts, stress and velocities, wherever the cell is cut."""
        wanted = run_case(self.case, directory=self.here("as it is"))
        self.assert_status(wanted, 0)
        for title, shift in (("half", 0.5 * LENGTH), ("any", 0.137 * LENGTH)):
            here = self.here(f"moved {title}")
            os.makedirs(here)
            with h5py.File(self.layer) as old, h5py.File(os.path.join(here, "moved.h5"), "w") as new:
                for name in ("bodies", "walls", "box"):
                    old.copy(name, new)
                x = new["bodies/position"][:, 0] + shift
                new["bodies/position"][:, 0] = x - LENGTH * np.floor(x / LENGTH)
            run = run_case(merged(self.case, {"scene": {"bodies_file": "moved.h5"},
                                              "decomposition": {"subdomains": 4}, "solver": {"method": "nscdd"}}), directory=here)
            self.assert_status(run, 0)
            self.assert_same_step(wanted, run, 1e-8)

    def test_subdomains_and_ranks(self):
        """Same bits on any number of ranks; the same step within the tolerance in any number of subdomains."""
        wanted = run_case(self.case, directory=self.here("one domain"))
        for partition in ("grid", "metis"):
            for n in (2, 4, 7):
                case = merged(self.case, {"decomposition": {"subdomains": n, "partition": partition}, "solver": {"method": "nscdd"}})
                runs = [run_case(case, ranks, self.here(f"{partition} {n} {ranks}")) for ranks in (1, 2)]
                with self.subTest(partition, subdomains=n):
                    for run in runs:
                        self.assert_status(run, 0)
                    self.assertEqual(differences(runs[0].results(), runs[1].results()), [])
                    self.assertGreater(runs[0].history()["interface_bodies"][0], 0)
                    self.assert_same_step(wanted, runs[0], 1e-8)

    def assert_same_step(self, wanted, run, tolerance):
        """Pairs in contact, velocities, stress and kinetic energy of step 1, the last ones relative to their size."""
        first, second = wanted.results(), run.results()
        for name in ("candidate", "antagonist"):
            np.testing.assert_array_equal(first[f"/steps/1/contacts/{name}"], second[f"/steps/1/contacts/{name}"])
        # some pairs meet across the end of the cell
        x = dict(zip(first["/steps/1/bodies/id"], first["/steps/1/bodies/position"][:, 0]))
        across = [abs(x[i] - x[j]) > 0.5 * LENGTH for i, j in zip(first["/steps/1/contacts/candidate"],
                                                                 first["/steps/1/contacts/antagonist"]) if j in x]
        self.assertGreater(sum(across), 5)
        speed = np.abs(first["/steps/1/bodies/velocity"]).max()
        apart = np.abs(first["/steps/1/bodies/velocity"] - second["/steps/1/bodies/velocity"]).max()
        self.assertLess(apart, tolerance * max(speed, 9.81 * STEP) * 100)
        one, other = wanted.history(), run.history()
        for column in ("stress_xx", "stress_yy", "kinetic_energy", "dissipated_normal"):
            self.assertLess(abs(one[column][0] - other[column][0]), 1e-6 * max(abs(one["stress_yy"][0]), abs(one[column][0])), column)
        self.assertLess(abs(one["solid_fraction"][0] - other["solid_fraction"][0]), 1e-10)


class Domains(RunTestCase):
    """600 disks that still settle, on one domain and on several."""

    def test_velocities_stress_and_energy(self):
        packing = settled_disks(self.scratch, steps=250)
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": packing, "friction": 0.0},
                "time": {"step": STEP, "steps": 1}, "solver": {"tolerance": 1e-10, "max_iterations": 100000, "warm_start": False},
                "output": {"directory": "results", "stress": True, "energy": True}}
        wanted = run_case(case, directory=self.here("one"))
        self.assert_status(wanted, 0)
        for title, change in (("grid", {"subdomains": 6}), ("metis", {"subdomains": 9, "partition": "metis"})):
            run = run_case(merged(case, {"decomposition": change, "solver": {"method": "nscdd"}}), 2, self.here(title))
            with self.subTest(title):
                self.assert_status(run, 0)
                first, second = (r.results()["/steps/1/bodies/velocity"] for r in (wanted, run))
                self.assertLess(np.abs(first - second).max(), 1e-6 * np.abs(first).max())
                one, other = wanted.history(), run.history()
                for column in ("stress_xx", "stress_yy", "pressure", "kinetic_energy", "dissipated_normal"):
                    self.assertLess(abs(one[column][0] - other[column][0]), 1e-6 * abs(one[column][0]), column)


if __name__ == "__main__":
    unittest.main()
