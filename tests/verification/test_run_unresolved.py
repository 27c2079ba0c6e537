"""Motion that is not told from the errors of solves: a scene that a load grows on stands still, and whatever moves in it is an error,
which the log names together with the accuracy that resolves it."""
import re
import unittest

from small_scenes import Grain, SmallScene, plane

RADIUS, COUNT, STEPS = 0.05, 30, 512
#: as users have it, beside a tolerance of round-off in the other scenes
DEFAULTS = {"criterion": "velocity_error", "tolerance": 1e-2, "check_every": 10, "warm_start": True}


class Unresolved(SmallScene):

    def press(self, title, **solver):
        """A column of disks under a lid whose force grows from 0 to 2 kN in a second."""
        column = [Grain([0.0, RADIUS * (2 * k + 1)], radius=RADIUS) for k in range(COUNT)]
        floor = plane([0.0, 0.0], [0.0, 1.0], name="floor")
        lid = plane([0.0, 2 * COUNT * RADIUS], [0.0, -1.0], name="lid", free=[False, True], mass=0.7, table="force.csv")
        record = self.play(title, column, [floor, lid], (0.0, 0.0), STEPS, files={"force.csv": "time,fy\n0,0\n1,-2000\n"},
                           solver={**DEFAULTS, **solver}, output={"every": STEPS})
        self.assert_status(record.run, 0)
        return record, 2 * COUNT * RADIUS - record.boundary["position"][-1, 1, 1]

    def test_a_load_that_grows(self):
        """At the default accuracy the lid comes down, though nothing gives way, and the line `drift` says how far grains went with it. With the
        accuracy that it advises the line is gone, and the lid stays."""
        record, down = self.press("default")
        told = re.search(r"\ndrift       in (\d+) of 512 steps bodies moved no faster than twice the velocity error of the solve, and came (\S+) mean "
                         r"diameters away as a whole\n +that motion may be nothing but errors; the accuracy (\S+) would keep them below 1.0E-02 mean diameters\n",
                         record.run.stdout)
        self.assertTrue(told, record.run.stdout)
        unresolved, drift, advised = int(told[1]), float(told[2]), float(told[3])
        self.assertGreater(unresolved, 0.9 * STEPS)
        self.assertGreater(down, RADIUS / 10)
        self.assertGreater(drift, 0.05)
        self.assertRegex(record.run.stdout.rstrip().splitlines()[-1], r"^finished    all 512 steps reached the accuracy.*; in \d+ of them bodies moved by no "
                         r"more than the errors of solves, and came \S+ mean diameters away: see `drift`; ")
        self.assertNotIn("which is looser", record.run.stdout)
        tight, stays = self.press("advised", accuracy=advised)
        self.assertNotIn("\ndrift ", tight.run.stdout)
        self.assertNotIn("see `drift`", tight.run.stdout)
        self.assertLess(stays, 0.02 * RADIUS)

    def test_deep(self):
        """Overlaps that stay deep are named by the last line, those that are small are not."""
        for depth in (0.3, 0.05):
            pair = [Grain([0.0, 0.0], radius=RADIUS), Grain([(2.0 - depth) * RADIUS, 0.0], radius=RADIUS)]
            record = self.play(f"deep {depth}", pair, [], (0.0, 0.0), 4, scene={"overlap_projection": False})
            last = record.run.stdout.rstrip().splitlines()[-1]
            self.assertEqual("; overlaps came to 0.30 of the mean radius; " in last, depth == 0.3, last)

    def test_what_moves_or_rests(self):
        """Grains that fall, come to rest and stay there for a second have no such line, and neither have grains on a belt that is slow."""
        pile = [Grain([0.11 * (k % 5), RADIUS + 0.11 * (k // 5)], radius=RADIUS) for k in range(25)]
        box = [plane([0.0, 0.0], [0.0, 1.0], friction=0.5), plane([-0.06, 0.0], [1.0, 0.0]), plane([0.5, 0.0], [-1.0, 0.0])]
        rest = self.play("rest", pile, box, (0.0, -9.81), 1024, solver=DEFAULTS, output={"every": 1024}, scene={"friction": 0.3})
        self.assertNotIn("drift", rest.run.stdout)
        belt = plane([0.0, 0.0], [0.0, 1.0], friction=0.5, velocity=[1e-3, 0.0])
        slow = self.play("belt", pile[:5], [belt], (0.0, -9.81), 256, solver=DEFAULTS, output={"every": 256})
        self.assertNotIn("drift", slow.run.stdout)


if __name__ == "__main__":
    unittest.main()
