"""Newton's method: tolerances that sweeps do not reach, the velocities that sweeps approach, the same bits on any number of ranks, a
lattice with far more contacts than freedoms, and an honest end where it does not get there."""
import csv
import math
import re
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, merged, run_case, write
from packings import settled_disks

TIGHT = 1e-10


def lattice_csv(columns, rows, radius):
    """Equal disks in a hexagonal packing, pressed into each other by 1e-6 of their radius so that all neighbours touch."""
    near = 2 * radius * (1 - 1e-6)
    lines = ["id,radius,mass,x,y,vx,vy,omega"]
    for row in range(rows):
        for column in range(columns - row % 2):
            x = radius + near * (column + 0.5 * (row % 2))
            y = radius + near * row * math.sqrt(3) / 2
            lines.append(f"{len(lines)},{radius!r},1.0,{x!r},{y!r},0,0,0")
    return "\n".join(lines) + "\n"


class Newton(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.disks = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": settled_disks(cls.scratch), "friction": 0.3},
            "time": {"step": 1e-3, "steps": 1},
            "solver": {"method": "newton", "criterion": "residual", "tolerance": TIGHT, "max_iterations": 4000},
            "output": {"directory": "results", "trace": True},
        }

    @staticmethod
    def velocities(run):
        with h5py.File(run.path("results", "results.h5")) as file:
            return file["steps/1/bodies/velocity"][:]

    def test_tolerance_that_sweeps_do_not_reach(self):
        # 156 disks: Newton's method takes 350 to 560 iterations, where the 600 of the other tests take thousands
        disks = merged(self.disks, {"scene": {"bodies_file": settled_disks(self.here("few"), count=(12, 13))}})
        newton = run_case(disks, directory=self.here("newton"))
        self.assert_status(newton, 0)
        residual = newton.trace()["residual"]
        self.assertLessEqual(residual[-1], TIGHT)
        sweeps = run_case(merged(disks, {"solver": {"method": "nlgs", "acceleration": "momentum"}}),
                          directory=self.here("sweeps"))
        self.assert_status(sweeps, 3)
        # sweeps stagnate at 2e-7 to 1e-5, in as many iterations
        self.assertGreater(sweeps.trace()["residual"][-1], 1e3 * TIGHT)

    def test_column_against_exact_impulses(self):
        case = merged(self.disks, {"scene": {"bodies": "column", "bodies_file": None, "column_count": 300, "radius": 0.05,
                                             "friction": 0.0},
                                   "solver": {"criterion": "error", "tolerance": 1e-7}})
        for subdomains in (1, 5):
            run = run_case(merged(case, {"decomposition": {"subdomains": subdomains}}), directory=self.here(f"column{subdomains}"))
            self.assert_status(run, 0)
            self.assertNotIn(" 0 factorisations", run.stdout)
            # a grain moves by what the impulses lack, at most a few times 1e-7 of 300 weights
            self.assertLess(np.abs(self.velocities(run)).max(), 1e-4 * 9.81 * 1e-3)

    def test_same_bits_on_any_number_of_ranks(self):
        case = merged(self.disks, {"decomposition": {"subdomains": 4, "partition": "metis"},
                                   "solver": {"max_iterations": 312}})
        runs = [run_case(case, ranks=ranks, directory=self.here(f"ranks{ranks}")) for ranks in SOME_RANKS]
        first = runs[0].trace()
        self.assertGreater(len(first["residual"]), 30)
        for run in runs[1:]:
            for name in ("iteration", "residual", "jump"):
                np.testing.assert_array_equal(run.trace()[name], first[name])

    def test_lattice(self):
        # 3 contacts a disk and 6 impulses against 3 freedoms
        write(self.here("lattice.csv"), lattice_csv(20, 20, 0.01))
        case = merged(self.disks, {"scene": {"bodies_file": self.here("lattice.csv"), "friction": 0.5}})
        for subdomains in (1, 4):
            run = run_case(merged(case, {"decomposition": {"subdomains": subdomains}}), directory=self.here(f"lattice{subdomains}"))
            self.assert_status(run, 0)
            self.assertLessEqual(run.trace()["residual"][-1], TIGHT)

    def test_memory(self):
        """--check counts the arrays of the method: in 2D with friction a contact has 2 components, and 3 if it resists rolling."""
        for n, rolling in ((2, 0.0), (3, 0.1)):
            memory = {}
            for method in ("nlgs", "newton"):
                run = run_case(merged(self.disks, {"solver": {"method": method}, "scene": {"rolling_friction": rolling}}),
                               directory=self.here(f"memory {method} {n}"), options=("--check",))
                self.assert_status(run, 0)
                memory[method] = dict((name, int(size)) for size, name in re.findall(r"  (\d+) a (contact|body in contact)", run.stdout))
            # four impulses, a velocity; centre, F, c, softness and direction, a block; what is left of a part that is cut; two marks
            self.assertEqual(memory["newton"]["contact"] - memory["nlgs"]["contact"],
                             8 * (4 * n + n + 5 * n + n**2 + n - 1) + 4 * (1 + n - 1))
            self.assertEqual(memory["newton"]["body in contact"] - memory["nlgs"]["body in contact"], 8 * (3 + 3))

    def test_light_beside_heavy(self):
        """A heap of light disks beside two heavy ones, by whose weight the residual is rounding long before the light ones have their
        velocities: what is left of the defect still tells better impulses from worse ones, and sweeps take over where steps stand still."""
        places = [(20.0 + column + 0.5 * (row % 2), 0.5 + row * math.sqrt(0.75)) for row in range(30) for column in range(8)]
        lines = [f"{number},0.5,1e-13,{x!r},{y!r},0,0,0" for number, (x, y) in enumerate(places, 1)]
        lines += [f"{number},0.5,1,{x},0.5,0,0,0" for number, x in ((len(places) + 1, 35), (len(places) + 2, 36))]
        bodies = write(self.here("heap.csv"), "\n".join(["id,radius,mass,x,y,vx,vy,omega", *lines]) + "\n")
        run = run_case({
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": bodies, "friction": 0.25},
            "boundary": [{"shape": "plane", "normal": [0.0, 1.0]}, {"shape": "plane", "point": [19.5, 0.0], "normal": [1.0, 0.0]}],
            "time": {"step": 1e-3, "steps": 1},
            "solver": {"method": "newton", "accuracy": 1e-4, "tolerance": 1e-6, "fallback": "none", "max_iterations": 10000},
            "output": {"directory": "results", "every": 0}}, directory=self.here("heap"))
        self.assert_status(run, 0)
        self.assertGreater(int(re.search(r"(\d+) sweeps", run.stdout)[1]), 500)

    def test_honest_end(self):
        run = run_case(merged(self.disks, {"solver": {"max_iterations": 320}}), directory=self.here("short"))
        self.assert_status(run, 3)
        self.assertRegex(run.stdout, "did NOT reach the (accuracy|tolerance)")
        # what is left are the best impulses of all
        with open(run.path("results", "history.csv"), encoding="utf-8") as file:
            row = list(csv.DictReader(file))[-1]
        self.assertLessEqual(float(row["residual"]), min(run.trace()["residual"]))
        # and the log says so, to three digits
        said = float(re.search(r"^accuracy .*residual at most ([^ ;,]+)", run.stdout, re.M)[1])
        self.assertAlmostEqual(said / float(row["residual"]), 1.0, delta=6e-3)


if __name__ == "__main__":
    unittest.main()
