"""A few bodies that move beside many that rest: the mean error of all says little of them."""
import os

import numpy as np

from gravier_runs import RunTestCase, run_case, write

RADIUS, ROW, STEP, STEPS, DENSITY, G = 0.01, 10, 1e-3, 60, 2500.0, 9.81
SPEED = 0.3 * G * STEP
#: of the row [kg]
MASS = ROW * DENSITY * np.pi * RADIUS**2


class FewMoving(RunTestCase):

    def push(self, title, idle, ranks=1, high=1, **groups):
        """A wall pushes a row of disks in contact along a floor; others lie on it in stacks of `high`. Impulse of the wall and its work, of those of the exact
        motion, in which all disks of the row have the speed of the wall from the first step on."""
        places = [(RADIUS * (2 * k + 1), RADIUS) for k in range(ROW)]
        places += [(1.0 + 3 * RADIUS * k, RADIUS * (2 * j + 1)) for k in range(idle) for j in range(high)]
        directory = self.here(title)
        os.mkdir(directory)
        write(self.here(title, "disks.csv"), "id,x,y,radius\n" + "".join(f"{k},{x!r},{y!r},{RADIUS}\n" for k, (x, y) in enumerate(places, 1)))
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "disks.csv", "friction": 0.0, "density": DENSITY},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
                             {"name": "wall", "shape": "segment", "point": [0.0, 1.5 * RADIUS], "end": [0.0, 0.1 * RADIUS], "velocity": [SPEED, 0.0]}],
                "time": {"step": STEP, "steps": STEPS},
                "output": {"directory": "results", "every": 0, "boundary_forces": True, "energy": True}, **groups}
        run = run_case(case, ranks, directory=directory)
        self.assert_status(run, 0)
        history = run.history()
        return -history["force_x:wall"].sum() * STEP / (MASS * SPEED), history["boundary_work"][-1] / (MASS * SPEED**2)

    def test_a_row_beside_others(self):
        """Where 5000 others lay on the floor, the row ran away from the wall with up to 1.7 times its speed. The mean by mass hid its error."""
        subdomains = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}}
        for title, idle, high, ranks, groups in (("alone", 0, 1, 1, {}), ("beside others", 1000, 1, 1, {}), ("beside stacks", 400, 3, 1, {}),
                                                 ("in subdomains", 1000, 1, 2, subdomains)):
            with self.subTest(title):
                impulse, work = self.push(title, idle, ranks, high, **groups)
                self.assertLess(abs(impulse - 1.0), 0.06)
                self.assertLess(abs(work - 1.0), 0.06)
