"""Motion that is not told from the errors of solves: a scene that a load grows on stands still, and whatever moves in it is an error.
Solves aim at less error there, so that errors do not add up; where they cannot, the log names the motion and what resolves it."""
import re
import unittest

from small_scenes import Grain, SmallScene, plane

RADIUS, COUNT, STEPS = 0.05, 30, 512
#: as users have it, beside a tolerance of round-off in the other scenes
DEFAULTS = {"criterion": "velocity_error", "tolerance": 1e-2, "check_every": 10, "warm_start": True}


class Unresolved(SmallScene):

    def press(self, title, status=0, wind=0.0, sliders=None, **solver):
        """A column of disks, which moves sideways, under a lid whose force grows from 0 to 2 kN in a second. Other disks slide at these speeds, under
        gravity, on a rail beside it."""
        column = [Grain([0.0, RADIUS * (2 * k + 1)], [wind, 0.0], radius=RADIUS) for k in range(COUNT)]
        below = [plane([0.0, 0.0], [0.0, 1.0], name="floor")]
        if sliders is not None:
            column += [Grain([1.0 + k, RADIUS], [speed, 0.0], radius=RADIUS) for k, speed in enumerate(sliders)]
            below = [{"name": "floor", "shape": "segment", "point": [-0.2, 0.0], "end": [0.2, 0.0]},
                     {"name": "rail", "shape": "segment", "point": [0.5, 0.0], "end": [60.0, 0.0]}]
        lid = plane([0.0, 2 * COUNT * RADIUS], [0.0, -1.0], name="lid", free=[False, True], mass=0.7, table="force.csv")
        record = self.play(title, column, [*below, lid], (0.0, 0.0 if sliders is None else -9.81), STEPS, files={"force.csv": "time,fy\n0,0\n1,-2000\n"},
                           status=status, solver={**DEFAULTS, **solver}, output={"every": STEPS})
        return record, 2 * COUNT * RADIUS - record.boundary["position"][-1, len(below), 1]

    def test_a_load_that_grows(self):
        """At the default accuracy the lid stays, because solves aim at a smaller one, and the log says how many and at which."""
        record, down = self.press("default")
        told = re.search(r"\nrefined     (\d+) solves aimed at less error than the goal, down to the accuracy (\S+), so that errors do not add up where "
                         r"most bodies rest; all came to it\n", record.run.stdout)
        self.assertTrue(told, record.run.stdout)
        refined, aim = int(told[1]), float(told[2])
        self.assertTrue(0.85 * STEPS < refined <= STEPS, told[0])
        self.assertIn("\n            at another accuracy: not known, because solves aimed at less error\n", record.run.stdout)
        self.assertTrue(1e-4 <= aim < 1e-2, told[0])
        solver = re.search(r"\nsolver      (\d+) solves, (\d+) iterations,", record.run.stdout)
        self.assertEqual(int(solver[1]), STEPS)
        self.assertLess(int(solver[2]), 100 * STEPS)
        self.assertNotIn("\ndrift ", record.run.stdout)
        self.assertNotIn("see `drift`", record.run.stdout)
        self.assertLess(down, 0.02 * RADIUS)

    def test_moving_as_a_whole(self):
        """The lid stays, too, where the column moves past it and past the floor."""
        record, down = self.press("carried", wind=1.0)
        self.assertIn("\nrefined ", record.run.stdout)
        self.assertNotIn("\ndrift ", record.run.stdout)
        self.assertLess(down, 0.05 * RADIUS)

    def test_beside_what_moves(self):
        """The lid stays, too, where a few disks slide past the column. Where most of all slide, solves have the accuracy of a scene that moves."""
        _, alone = self.press("alone", sliders=[])
        for speed in (1.0, 5.0):
            record, down = self.press(f"beside {speed}", sliders=[speed, speed])
            self.assertIn("\nrefined ", record.run.stdout)
            self.assertNotIn("\ndrift ", record.run.stdout)
            self.assertLess(down, 1.1 * alone)
        record, _ = self.press("most move", sliders=[5.0] * (COUNT + 2))
        self.assertNotIn("\nrefined ", record.run.stdout)

    def test_told(self):
        """Solves that end by their residual aim at nothing else. The lid comes down, though nothing gives way, and the line `drift` says how far
        grains went with it. With the tolerance that it advises the line is gone, and the lid stays."""
        record, down = self.press("loose", criterion="residual", tolerance=1e-3)
        self.assertNotIn("\nrefined ", record.run.stdout)
        told = re.search(r"\ndrift       in (\d+) of 512 steps bodies moved no faster than twice the velocity error of the solve, and came (\S+) mean "
                         r"diameters away as a whole\n +that motion may be nothing but errors; the tolerance (\S+) would keep them below 1.0E-02 mean "
                         r"diameters\n", record.run.stdout)
        self.assertTrue(told, record.run.stdout)
        unresolved, drift, advised = int(told[1]), float(told[2]), float(told[3])
        self.assertGreater(unresolved, 0.9 * STEPS)
        self.assertGreater(down, RADIUS / 10)
        self.assertGreater(drift, 0.05)
        self.assertRegex(record.run.stdout.rstrip().splitlines()[-1], r"; in \d+ of the 512 steps bodies moved by no more than the errors of solves, and "
                         r"came \S+ mean diameters away: see `drift`; ")
        self.assertNotIn("which is looser", record.run.stdout)
        tight, stays = self.press("advised", criterion="residual", tolerance=advised)
        self.assertNotIn("\ndrift ", tight.run.stdout)
        self.assertLess(stays, 0.02 * RADIUS)

    def test_hard_to_hold(self):
        """Where the iterations that solves may make do not keep errors from adding up, the log says both."""
        record, _ = self.press("few", status=3, max_iterations=30)
        self.assertRegex(record.run.stdout, r"\nrefined .*; \d+ came to it, the others gave it up after \d+ iterations in all\n")
        self.assertRegex(record.run.stdout, r"\ndrift .*\n +that motion may be nothing but errors; a smaller &solver accuracy, which every solve has to "
                         r"reach, tells\n")

    def test_cell(self):
        """A periodic cell of grains that touch, under a pressure that grows, keeps its size."""
        count = 6
        grains = [Grain([RADIUS * (2 * i + 1), RADIUS * (2 * j + 1)], radius=RADIUS) for j in range(count) for i in range(count)]
        side = 2 * RADIUS * count
        record = self.play("cell", grains, [], (0.0, 0.0), STEPS, files={"p.csv": "time,pressure_x,pressure_y\n0,0,0\n1,20000,10000\n"},
                           solver=DEFAULTS, scene={"period": [side, side], "cell_table": "p.csv", "overlap_projection": False}, output={"every": STEPS})
        self.assertIn("\nrefined ", record.run.stdout)
        self.assertNotIn("\ndrift ", record.run.stdout)
        history = record.run.history()
        for axis in "xy":
            self.assertLess(abs(history["cell_strain_" + axis][-1]), 0.01 / count)

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
