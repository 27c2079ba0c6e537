"""Grains that leave through an outlet while neighbour lists last: lists stay as they are for the others, on any ranks and through
restarts, with the same bits."""
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, differences, merged, namelist, run_case, gravier, write

RADIUS, COUNT, STEPS = 0.01, (14, 8), 60
FALL = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0, 0.0], "friction": 0.3},
    "boundary": [{"name": "out", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.1, 1.0]}],
    "time": {"step": 1e-3, "steps": STEPS},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 3},
    "output": {"every": 0, "checkpoint_every": 1000},
}


def grains():
    """Rows of a bodies file: disks that drift down together and jostle, and a fast one in front, which lists leave most room."""
    rng = np.random.default_rng(5)
    rows = ["id,x,y,radius,vx,vy", f"1,0.1,-0.005,{RADIUS},0.0,-3.0"]
    for k in range(COUNT[0] * COUNT[1]):
        x = np.array([k % COUNT[0], k // COUNT[0] + 1.0]) * 2.1 * RADIUS + 0.1 * RADIUS * (rng.random(2) - 0.5)
        v = np.array([0.0, -1.0]) + 0.3 * (rng.random(2) - 0.5)
        rows.append(f"{k + 2},{x[0]:.12g},{x[1]:.12g},{RADIUS},{v[0]:.12g},{v[1]:.12g}")
    return "\n".join(rows) + "\n"


class Departures(RunTestCase):

    def play(self, title, steps, ranks=1):
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
        """Grains leave in many steps, of which few make lists; each leaves at the end of the step in whose middle it is behind."""
        table = self.play("straight", STEPS).history()
        leaving = table["left"] > 0
        self.assertGreater(leaving.sum(), 15)
        self.assertGreater((leaving & (table["listed"] == 0)).sum(), 10)
        self.assertLess(table["listed"].sum(), STEPS / 3)
        self.assertGreater(table["contacts"].max(), 20)
        self.assertEqual(table["left"][2], 1)
        self.assertTrue((COUNT[0] * COUNT[1] + 1 - np.cumsum(table["left"]) == table["grains"]).all())

    def test_ranks(self):
        tables = [self.history(self.play(f"on {ranks}", STEPS, ranks)) for ranks in (1, 2)]
        self.assertEqual(differences(*tables), [])

    def test_restart(self):
        """Just after the fast grain has left, and later, between two lists."""
        whole = self.history(self.play("whole", STEPS))
        for steps in (3, 33, 38):
            part = self.play(f"part {steps}", steps)
            write(os.path.join(part.directory, "case.nml"), namelist(FALL))
            again = gravier("--restart", "case.nml", ranks=2, directory=part.directory)
            self.assert_status(again, 0)
            self.assertEqual(differences(whole, self.history(again)), [], f"from step {steps} on")


if __name__ == "__main__":
    unittest.main()
