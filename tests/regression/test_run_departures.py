"""Grains that leave through an outlet while neighbour lists last: lists stay as they are for the others, on any ranks and through
restarts, with the same bits."""
import os
import re
import unittest

import numpy as np

from gravier_runs import differences, merged, namelist, run_case, gravier, write
from loop_runs import LoopTestCase

RADIUS, COUNT, STEPS = 0.01, (14, 8), 60
FALL = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0, 0.0], "friction": 0.3},
    "boundary": [{"name": "out", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.1, 1.0]}],
    "time": {"step": 1e-3, "steps": STEPS},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 3},
    "output": {"every": 0, "checkpoint_every": 1000},
}
#: each step shears the cell by 0.005. Lists are due where half of the shear since the last ones, times the distance at which two of the
#: largest disks are listed, is more than the 2 mm that a disk may go: 64.5 mm are so after 13 steps, and 24.5 mm of the small disks
#: alone after 33
SHEAR = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0, 0.0], "friction": 0.3,
              "period": [0.2, 0.2], "cell_shear_rate": [0.5], "alert_distance": 0.0005, "skin": 0.004, "list_steps": 0},
    "time": {"step": 0.01, "steps": 60},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"every": 0, "checkpoint_every": 1000},
}
#: the loop that takes the large disk away between two lists
TAKE = """
with gravier.Simulation(case, quiet=True) as s:
    while s.goes_on:
        if s.made == 15:
            s.remove([1])
        s.step()
"""


def grains():
    """Rows of a bodies file: disks that drift down together and jostle, and a fast one in front, which lists leave most room."""
    rng = np.random.default_rng(5)
    rows = ["id,x,y,radius,vx,vy", f"1,0.1,-0.005,{RADIUS},0.0,-3.0"]
    for k in range(COUNT[0] * COUNT[1]):
        x = np.array([k % COUNT[0], k // COUNT[0] + 1.0]) * 2.1 * RADIUS + 0.1 * RADIUS * (rng.random(2) - 0.5)
        v = np.array([0.0, -1.0]) + 0.3 * (rng.random(2) - 0.5)
        rows.append(f"{k + 2},{x[0]:.12g},{x[1]:.12g},{RADIUS},{v[0]:.12g},{v[1]:.12g}")
    return "\n".join(rows) + "\n"


class Departures(LoopTestCase):

    def fall(self, title, steps, ranks=1):
        directory = self.here(title)
        os.makedirs(directory)
        write(os.path.join(directory, "grains.csv"), grains())
        run = run_case(merged(FALL, {"time": {"steps": steps}}), ranks, directory)
        self.assert_status(run, 0)
        return run

    def history(self, run):
        """All but the figures of the clock and of messages between ranks."""
        table = run.history()
        for name in ("wall_seconds", "solve_seconds", "exchange_messages", "exchange_values", "most_messages", "most_values"):
            table.pop(name, None)
        return table

    def test_lists_last(self):
        """Grains leave in many steps, of which few make lists; each leaves in the step in whose middle it is behind."""
        run = self.fall("straight", STEPS)
        table = run.history()
        leaving = table["left"] > 0
        np.testing.assert_array_equal(table["left_mass"] > 0, leaving)
        gone = float(re.search(r"\ngrains .* mass \S+ \+ \S+ - (\S+) = ", run.stdout)[1])
        self.assertAlmostEqual(table["left_mass"].sum(), gone, delta=1e-6 * gone)
        self.assertGreater(leaving.sum(), 15)
        self.assertGreater((leaving & (table["listed"] == 0)).sum(), 10)
        self.assertLess(table["listed"].sum(), STEPS / 3)
        self.assertGreater(table["contacts"].max(), 20)
        self.assertEqual(table["left"][2], 1)
        self.assertTrue((COUNT[0] * COUNT[1] + 1 - np.cumsum(table["left"]) == table["grains"]).all())

    def test_moment(self):
        """Disks that pass the outlet before and after the place (1 - theta) h of a step leave in this step and in the next; their energy
        is that of the end of the step before."""
        for theta, left in ((0.5, [2, 1, 0]), (0.75, [1, 2, 0]), (1.0, [0, 3, 0])):
            for ranks in (1, 2):
                with self.subTest(theta=theta, ranks=ranks):
                    directory = self.here(f"moment {theta} {ranks}")
                    os.makedirs(directory)
                    # ways of 1 mm in a step
                    write(os.path.join(directory, "grains.csv"), "id,x,y,radius,vy,mass\n1,0,0.0002,0.01,-1,2\n2,1,0.0004,0.01,-1,2\n"
                          "3,2,0.0009,0.01,-1,2\n4,3,0.5,0.01,0,2\n")
                    run = run_case({**FALL, "boundary": [{"name": "out", "shape": "outlet", "normal": [0.0, 1.0]}],
                                    "time": {"step": 1e-3, "steps": 3, "theta": theta}, "decomposition": {"subdomains": 2},
                                    "output": {"every": 1, "energy": True}}, ranks, directory)
                    self.assert_status(run, 0)
                    table = run.history()
                    self.assertEqual(table["left"].tolist(), left)
                    self.assertEqual(table["grains"].tolist(), (4 - np.cumsum(left)).tolist())
                    np.testing.assert_allclose(table["carried_away"], np.cumsum(left), rtol=1e-12)

    def test_boundary_that_is_removed(self):
        """It stays in tables with a force of 0, and moves on as its drive says; one at rest stays where it was."""
        directory = self.here("gate")
        os.makedirs(directory)
        write(os.path.join(directory, "grains.csv"), "id,x,y,radius\n1,0,0.01,0.01\n2,1,0.01,0.01\n")
        gate = {"shape": "plane", "normal": [0.0, 1.0], "remove_at": 0.002}
        run = run_case({**FALL, "scene": {**FALL["scene"], "gravity": [0.0, -10.0]},
                        "boundary": [{**gate, "name": "up", "velocity": [0.0, 0.1]}, {**gate, "name": "still"}],
                        "time": {"step": 1e-3, "steps": 4}, "output": {"every": 1, "boundary_forces": True}}, 1, directory)
        self.assert_status(run, 0)
        table = run.history()
        np.testing.assert_allclose(table["position_y:up"], [1e-4, 2e-4, 3e-4, 4e-4], rtol=1e-12)
        self.assertEqual(table["position_y:still"].tolist(), [0.0] * 4)
        self.assertTrue((table["force_y:up"][:2] + table["force_y:still"][:2] < 0).all())
        states = run.results()
        for step in (3, 4):
            self.assertEqual((table["force_y:up"][step - 1], table["force_y:still"][step - 1]), (0.0, 0.0))
            self.assertEqual(states[f"/steps/{step}/boundaries/force"].tolist(), [[0.0, 0.0]] * 2)
            np.testing.assert_allclose(states[f"/steps/{step}/boundaries/position"], [[0.0, 1e-4 * step], [0.0, 0.0]], rtol=1e-12)

    def test_ranks(self):
        tables = [self.history(self.fall(f"on {ranks}", STEPS, ranks)) for ranks in (1, 2)]
        self.assertEqual(differences(*tables), [])

    def test_restart(self):
        """Just after the fast grain has left, and later, between two lists."""
        whole = self.history(self.fall("whole", STEPS))
        for steps in (3, 33, 38):
            part = self.fall(f"part {steps}", steps)
            write(os.path.join(part.directory, "case.nml"), namelist(FALL))
            again = gravier("--restart", "case.nml", ranks=2, directory=part.directory)
            self.assert_status(again, 0)
            self.assertEqual(differences(whole, self.history(again)), [], f"from step {steps} on")

    def test_largest_grain_leaves_a_sheared_cell(self):
        """How soon lists of a cell that moves are made anew depends on the largest grain that was there when they were made, before
        and after a restart, and then on the largest of those that stay."""
        rows = ["id,x,y,radius", "1,0.1,0.1,0.03"]
        rows += [f"{k + 2},{0.05 * (k % 4) + 0.025},{0.15 * (k // 4) + 0.025},{RADIUS}" for k in range(8)]
        runs = []
        for title, steps in (("kept", 60), ("taken", 60), ("taken half", 18)):
            os.makedirs(self.here(title))
            write(self.here(title, "grains.csv"), "\n".join(rows) + "\n")
            groups = merged(SHEAR, {"time": {"steps": steps}})
            runs.append(self.play(title, groups, TAKE) if "taken" in title else run_case(groups, directory=self.here(title)))
            self.assert_status(runs[-1], 0)
        kept, whole, half = runs
        write(half.path("case.nml"), namelist(SHEAR))
        again = gravier("--restart", "case.nml", directory=half.directory)
        self.assert_status(again, 0)
        self.assertEqual(differences(self.history(whole), self.history(again)), [])
        listed = [np.flatnonzero(run.history()["listed"]) for run in (kept, whole)]
        self.assertEqual(list(np.diff(listed[0])), [13] * (len(listed[0]) - 1))
        self.assertEqual(list(np.diff(listed[1])), [13, 13, 33])
        self.assertEqual(list(listed[0][:3]), list(listed[1][:3]))


if __name__ == "__main__":
    unittest.main()
