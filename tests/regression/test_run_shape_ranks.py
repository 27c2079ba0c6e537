"""Pours of bodies with shapes have the same bits on any number of ranks and through restarts: polygons, polyhedra and clusters that cross
subdomains, with lists made anew, migration, new partitions and sleep. Disks of other shapes by NSCDD run on four ranks too; all of them do in
`./gravier test long`."""
import os
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, contents, differences, each, gravier, merged, namelist, run_case, write
from shaped_scenes import LIBRARY, box, lattice, prepare, shaped_case

COUNTS = {2: (6, 5), 3: (3, 3, 3)}
SPACING = {2: 0.17, 3: 0.19}
BASE = {
    "scene": {"friction": 0.3},
    "time": {"step": 2e-3, "steps": 160},
    "solver": {"method": "nscdd", "tolerance": 1e-2, "max_iterations": 2000},
    "decomposition": {"subdomains": 6, "partition": "metis", "repartition_every": 40},
    "output": {"every": 20, "trace": True, "energy": True, "structure": True, "stress": True, "boundary_forces": True, "final_bodies": True},
}
PERIODIC = {"scene": {"period": [1.02, 0.0]}, "decomposition": {"partition": "grid"}}
# of each dimension
METHODS = {
    2: {"nscdd": {}, "schwarz_ec": {"solver": {"method": "schwarz_ec"}, "time": {"steps": 120}}, "newton": {"solver": {"method": "newton"}}},
    3: {"schwarz": {"solver": {"method": "schwarz", "sweeps": 2}, "time": {"step": 4e-3, "steps": 100}},
        "nscdd_ep": {"solver": {"method": "nscdd_ep"}, "time": {"step": 4e-3, "steps": 100}},
        "returned": {"scene": {"restitution": 0.2, "tangential_restitution": 0.2}, "solver": {"method": "newton"}}},
}
SLEEP = {"scene": {"restitution": 0.0}, "time": {"step": 4e-3, "steps": 220}, "output": {"every": 55},
         "solver": {"method": "nscdd", "sleeping": True, "sleep_after": 6, "sleep_speed": 3.0, "criterion": "residual", "tolerance": 1e-3}}


class ShapeRanks(RunTestCase):

    def case(self, dimension, *parts):
        walls = box(COUNTS[dimension], SPACING[dimension])
        if any("period" in part.get("scene", {}) for part in parts):
            walls = walls[-1:]
        return shaped_case(dimension, walls, BASE, *parts)

    def play(self, title, dimension, ranks, *parts):
        directory = prepare(self.here(f"{title} {dimension} {ranks}"), dimension, lattice(COUNTS[dimension], spacing=SPACING[dimension]))
        return run_case(self.case(dimension, *parts), ranks, directory)

    def state(self, run):
        """All that a run leaves and that is no time on the clock."""
        found = {name: value for name, value in run.results().items() if not name.startswith("/run@")}
        for table in (run.history(), run.trace()):
            found.update({name: value for name, value in table.items() if not name.endswith("_seconds")})
        found.update({f"final{name}": value for name, value in contents(run.path("results", "final_bodies.h5")).items()
                      if not name.startswith("/run@")})
        return found

    def compare(self, title, dimension, *parts):
        runs = each(lambda ranks: self.play(title, dimension, ranks, *parts), [(1,), (2,)] + [(4,)] * (LONG or (title, dimension) == ("nscdd", 2)))
        for run in runs:
            # a solve that gives up is the same everywhere too
            self.assertIn(run.status, (0, 3), str(run))
        for run in runs[1:]:
            self.assertEqual(differences(self.state(runs[0]), self.state(run)), [], f"{title} {dimension}")
        return runs[0]

    def test_methods(self):
        for dimension in (2, 3):
            for title, part in METHODS[dimension].items():
                with self.subTest(title, dimension=dimension):
                    history = self.compare(title, dimension, part).history()
                    # a comparison of runs that do nothing would prove nothing
                    self.assertGreater(history["contacts"].max(), 10 if title == "returned" else 30)
                    self.assertGreater(history["interface_bodies"].max(), 0 if title == "returned" else 2)
                    self.assertGreater(history["divided"].sum(), 1)
                    self.assertGreater(history["listed"].sum(), 10)

    def test_periodic(self):
        for dimension, period in ((2, PERIODIC), (3, merged(PERIODIC, {"scene": {"period": [0.57, 0.57, 0.0]}}))):
            with self.subTest(dimension=dimension):
                run = self.compare("periodic", dimension, period)
                self.assertTrue(np.any(run.results()["/steps/160/bodies/image"] != 0))

    def test_sleeping(self):
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                self.assertGreater(self.compare("asleep", dimension, SLEEP).history()["sleeping"].max(), 10)

    def test_restart(self):
        """Stops right after a list was made and long after, with sleep and without, and other numbers of ranks afterwards; a checkpoint of
        another library is refused."""
        for dimension, title, part, stop in ((2, "awake", METHODS[2]["newton"], 87), (3, "awake", {}, 110), (2, "sleep", SLEEP, 181),
                                            (3, "bound", {"scene": {"restitution": 0.4}, "solver": {"method": "newton"}}, 95)):
            with self.subTest(title, dimension=dimension):
                part = merged(part, {"output": {"every": 20, "checkpoint_every": stop}})
                straight = self.play(f"straight {title}", dimension, 2, part)
                steps = straight.history()["step"][-1]
                stopped = self.play(f"stopped {title}", dimension, 1, merged(part, {"time": {"steps": stop}}))
                for run in (straight, stopped):
                    self.assertIn(run.status, (0, 3), str(run))
                directory = stopped.directory
                write(os.path.join(directory, "case.nml"), namelist(self.case(dimension, part)))
                again = gravier("--restart", "case.nml", ranks=4 if LONG or title == "awake" and dimension == 3 else 2, directory=directory)
                self.assertIn(again.status, (0, 3), str(again))
                self.assertIn(f"from the checkpoint of step {stop}\n", again.stdout)
                self.assertGreater(steps, stop)
                there, here = self.state(straight), self.state(again)
                if stop % 20:
                    # the run that nothing stops writes no state there
                    here = {name: value for name, value in here.items() if not name.startswith(f"/steps/{stop}/")
                            and not name.split("@")[0] == f"/steps/{stop}"}
                self.assertEqual(differences(there, here), [])
                write(os.path.join(directory, "bodies.shapes"), LIBRARY[dimension].replace("0.04\n", "0.041\n", 1))
                other = gravier("--restart", "case.nml", ranks=2, directory=directory)
                self.assert_status(other, 2)
                self.assertIn("contents of bodies.shapes", other.stderr)


if __name__ == "__main__":
    unittest.main()
