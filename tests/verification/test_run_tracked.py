"""Single bodies in history.csv: the places and velocities of the written states, places without periods, nothing of a body that the scene does not
have; the same on any ranks and through a restart."""
import os
import pathlib
import unittest

import numpy as np

from gravier_runs import differences, gravier, merged, run_case, write
from small_scenes import Grain, SmallScene

PERIOD, STEPS = 1.0, 120
#: grains that enter one by one, the second of them with the identifier 2
FEED = {"scene": {"bodies": "none", "dimension": 2, "gravity": [0.0, -9.81], "material": None},
        "insertion": [{"name": "feed", "lower": [0.0, 0.0], "upper": [1.0, 1.0], "radius": 0.05, "rate": 60.0, "count": 2}],
        "solver": {"method": "nscdd"}, "decomposition": {"partition": "grid", "grid": [2, 1]}, "time": {"step": 1.0 / 512, "steps": 40}}


class Tracked(SmallScene):

    def fly(self, title, dimension, ranks=1, steps=STEPS, **groups):
        """Three grains under gravity in a periodic scene: the first crosses the period again and again, the second turns and falls through an
        outlet, the third is not asked for."""
        spin = 2.0 if dimension == 2 else [1.0, 2.0, 3.0]
        more = [0.25] * (dimension - 2)
        grains = [Grain([0.5, *more, 0.7], [9.0, *more, 1.0]), Grain([0.2, *more, 0.0], [-0.5, *more, 0.0], spin), Grain([0.8, *more, 0.4])]
        low = [0.0] * (dimension - 1)
        case = merged({"scene": {"period": [PERIOD, *[0.5] * (dimension - 2), 0.0], "rotation": True},
                       "solver": {"method": "nscdd"}, "decomposition": {"partition": "grid", "grid": [4, *[1] * (dimension - 1)]},
                       "output": {"every": 1, "checkpoint_every": 40, "tracked_bodies": [2, 1]}}, groups)
        outlet = {"shape": "outlet", "point": [*low, -0.2], "normal": [*low, 1.0], "name": "out"}
        return self.play(title, grains, [outlet], [*low, -10.0], steps, ranks, **case)

    def test_values(self):
        def check(dimension):
            record = self.fly(f"values {dimension}", dimension)
            history = record.run.history()
            names = ["x", "y", "vx", "vy", "omega"] if dimension == 2 else ["x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"]
            self.assertEqual([name for name in history if name.startswith("body_")], [f"body_{name}:{k}" for k in (2, 1) for name in names])
            places = record.position + record.image * np.array([PERIOD, 0.5, 0.0][:dimension - 1] + [0.0])
            values = np.concatenate([places, record.all_velocities], axis=2)[1:]
            for body in (1, 2):
                columns = np.stack([history[f"body_{name}:{body}"] for name in names], axis=1)
                np.testing.assert_array_equal(columns, values[:, body - 1])
            self.assertGreater(history["body_x:1"][-1], 2.0 * PERIOD)
            self.assertEqual(history["left"][-1], 0)
            gone = np.isnan(history["body_x:2"])
            self.assertTrue(10 < np.argmax(gone) < STEPS and gone[np.argmax(gone):].all())
        self.both(check)

    def test_ranks_and_restart(self):
        """The same bits on two ranks, and where a run goes on from a checkpoint."""
        whole = self.fly("whole", 2).run.history()
        self.assertEqual(differences(*({name: value for name, value in history.items() if name.startswith("body_")} for history in
                                       (whole, self.fly("two", 2, ranks=2).run.history()))), [])
        first = self.fly("first", 2, steps=40).run
        case = os.path.join(first.directory, "case.nml")
        write(case, pathlib.Path(case).read_text(encoding="ascii").replace("steps = 40", f"steps = {STEPS}"))
        again = gravier("--restart", "case.nml", directory=first.directory)
        self.assert_status(again, 0)
        history = again.history()
        for name in (name for name in whole if name.startswith("body_")):
            np.testing.assert_array_equal(history[name], whole[name])

    def test_entering(self):
        """A body that enters is found when it is there."""
        run = run_case(merged(FEED, {"output": {"tracked_bodies": [2]}}), directory=self.here("enters"))
        self.assert_status(run, 0)
        history = run.history()
        there = ~np.isnan(history["body_x:2"])
        np.testing.assert_array_equal(there, np.cumsum(history["entered"]) >= 2)
        self.assertTrue(0 < there.sum() < 40)


if __name__ == "__main__":
    unittest.main()
