"""One solution whatever the method, the number of subdomains, the partition and the rule: 540 settled disks with friction.

Impulses of a dense packing are not unique and are not compared. A solve that stops at a residual of `tolerance` leaves
impulses that are wrong by tolerance |r| in the norm of all contacts, that is velocities wrong by tolerance |r| / m if the
errors fell on one disk, and by some times that where errors of neighbours add up (measured here: 18 times). The bound is 60
times tolerance |r| / m, which is about 2 % of the speed g h that gravity would give in the step.

    GRAVIER_PACKING_TABLE=FILE /usr/bin/python3 -m unittest discover -s tests/verification -p test_run_packing.py

runs all 69 combinations instead of some and writes the table of iterations and velocity differences to FILE.
"""
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, each, run_case

TOLERANCE = 2e-6
STEP = 1e-3
GRAVITY = 9.81
DENSITY = 2500.0
METHODS = {
    "nscdd": {"solver": {"method": "nscdd", "sweeps": 5}},
    "schwarz": {"solver": {"method": "schwarz", "sweeps": 2, "relaxation": 0.5}},
    "schwarz_ec": {"solver": {"method": "schwarz_ec", "sweeps": 10, "relaxation": 0.5}},
    "nscdd_ep": {"solver": {"method": "nscdd_ep", "sweeps": 10}},
}


def combinations(everything):
    """(method, subdomains, partition, kind): without `everything`, one domain and two partitions that differ in all three; of schwarz_ec,
    whose interface solves take most of the time and grow in number with the subdomains, one in four (test_run_method_invariance.py has others)."""
    for method in METHODS:
        for subdomains in (1, 2, 4, 8, 16):
            for partition in ("grid", "metis"):
                for kind in ("dual", "primal"):
                    if subdomains == 1 and (partition, kind) != ("grid", "dual"):
                        continue
                    chosen = [(4, "metis", "primal")] if method == "schwarz_ec" else [(16, "metis", "primal"), (2, "grid", "dual")]
                    few = subdomains == 1 and method != "schwarz_ec" or (subdomains, partition, kind) in chosen
                    if everything or few:
                        yield method, subdomains, partition, kind


class Packing(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        settle = run_case({
            "scene": {"bodies": "lattice", "lattice_count": [90, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3,
                      "density": DENSITY, "alert_distance": 0.003},
            "time": {"step": STEP, "steps": 1500},
            "solver": {"tolerance": 1e-4, "max_iterations": 3000},
            "output": {"directory": ".", "every": 0, "final_bodies": True},
        }, directory=os.path.join(cls.scratch, "settle"))
        assert settle.status == 0, str(settle)
        cls.bodies = settle.path("final_bodies.h5")
        cls.reference = cls.solve("nlgs", 1, "grid", "dual")

    @classmethod
    def solve(cls, method, subdomains, partition, kind):
        """One step from a cold start."""
        name = f"{method}-{subdomains}-{partition}-{kind}"
        run = run_case({
            "scene": {"bodies": "file", "bodies_file": cls.bodies, "friction": 0.3},
            "time": {"step": STEP, "steps": 1},
            "solver": {"tolerance": TOLERANCE, "max_iterations": 40000, "check_every": 20, "warm_start": False,
                       **METHODS.get(method, {"solver": {"method": method, "sweeps": 10}})["solver"]},
            "decomposition": {"subdomains": subdomains, "partition": partition, "kind": kind},
        }, directory=os.path.join(cls.scratch, name))
        return run

    def bound(self):
        """60 tolerance |r| / m, with the lightest disk."""
        results = self.reference.results()
        mass = DENSITY * np.pi * results["/steps/1/bodies/radius"].min()**2
        return 60.0 * TOLERANCE * np.linalg.norm(results["/steps/1/contacts/impulse"]) / mass

    def test_velocities_agree(self):
        self.assert_status(self.reference, 0)
        table = os.environ.get("GRAVIER_PACKING_TABLE")
        expected = self.reference.results()["/steps/1/bodies/velocity"][:, :2]
        bound = self.bound()
        # the test could not tell a solution from free fall otherwise
        self.assertLess(bound, 0.04 * GRAVITY * STEP)
        jobs = list(combinations(bool(table)))
        rows = [("nlgs", 1, "grid", "dual", self.reference.history()["iterations"][0], 0.0)]
        for job, run in zip(jobs, each(self.solve, jobs)):
            with self.subTest(job):
                self.assert_status(run, 0)
                velocity = run.results()["/steps/1/bodies/velocity"][:, :2]
                difference = np.abs(velocity - expected).max()
                rows.append((*job, run.history()["iterations"][0], difference))
                self.assertLess(difference, bound)
                self.check_momentum(run)
        if table:
            with open(table, "w", encoding="ascii") as file:
                file.write("method,subdomains,partition,kind,iterations,velocity_difference\n")
                file.writelines(f"{m},{s},{p},{k},{int(i)},{d:.2e}\n" for m, s, p, k, i, d in rows)

    def check_momentum(self, run):
        """The walls carry the weight less the change of momentum, to rounding: velocities are made from the impulses."""
        results = run.results()
        with h5py.File(self.bodies) as file:
            mass, before = file["bodies/mass"][()], file["bodies/velocity"][:, 1]
            np.testing.assert_array_equal(file["bodies/id"][()], results["/steps/1/bodies/id"])
        change = np.sum(mass * (results["/steps/1/bodies/velocity"][:, 1] - before))
        weight = np.sum(mass) * GRAVITY * STEP
        normal, impulse = results["/steps/1/contacts/normal"], results["/steps/1/contacts/impulse"]
        on_wall = np.isin(results["/steps/1/contacts/antagonist"], results["/boundaries/id"])
        # t = (-ny, nx)
        upward = normal[:, 1] * impulse[:, 0] + normal[:, 0] * impulse[:, 1]
        self.assertLess(abs(np.sum(upward[on_wall]) - weight - change), 1e-11 * weight)


if __name__ == "__main__":
    unittest.main()
