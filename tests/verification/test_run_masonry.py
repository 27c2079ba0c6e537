"""Blocks, arches and walls against analytic values: small cases of drivers/studies/study_masonry.py, each a little below and above
the place where it falls, and the invariances. Values of the linear programs of that study are written here."""
import os
import sys
import unittest

import numpy as np

from gravier_runs import PROGRAMS, SOURCE

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
os.environ.setdefault("GRAVIER_BIN_DIR", PROGRAMS)
import masonry_blocks as blocks  # noqa: E402
import masonry_motion as motion  # noqa: E402
import masonry_walls as walls  # noqa: E402
from oracle_table import Table  # noqa: E402

NEAR = 1.0e-4


class Masonry(unittest.TestCase):

    def check(self, part, *arguments):
        table = Table(quiet=True)
        part(table, *arguments)
        self.assertGreater(len(table.rows), 0)
        self.assertEqual(table.misses, [])

    def assert_border(self, stands, border, way):
        """It stands on one side of a border and falls on the other."""
        self.assertTrue(stands(border - way), border)
        self.assertFalse(stands(border + way), border)

    def test_slope(self):
        self.check(blocks.slope_statics)

    def test_slope_invariance(self):
        """Turns by right angles, mirror images, the order of bodies, subdomains and ranks."""
        self.check(blocks.slope_invariance)

    def test_toppling(self):
        """Angles, whatever the rounding, the number of sides, the side that is below and the order of bodies."""
        names, exact, stand = blocks.topplers()
        self.assertEqual([name for name, stands in zip(names, stand(exact - NEAR)) if not stands], [])
        self.assertEqual([name for name, stands in zip(names, stand(exact + NEAR)) if stands], [])

    def test_prisms(self):
        cases = [case for case in blocks.prism_cases(False) if "64 points" not in case[0]]
        stand, exact = blocks.prisms_stand(cases), np.arctan([case[-1] for case in cases])
        self.assertEqual([case[0] for case, stands in zip(cases, stand(exact - NEAR)) if not stands], [])
        self.assertEqual([case[0] for case, stands in zip(cases, stand(exact + NEAR)) if stands], [])

    def test_sliding_and_toppling(self):
        self.check(blocks.slide_topple, True)

    def test_rocking(self):
        self.check(blocks.rocking, True, ((1.0e-3, 1.0e-2, 2.0e-3),))

    def test_overhang(self):
        self.assertEqual(blocks.stacks_stand([0.999] * len(blocks.STACKS)), [True] * len(blocks.STACKS))
        self.assertEqual(blocks.stacks_stand([1.001] * len(blocks.STACKS)), [False] * len(blocks.STACKS))

    def test_wedge(self):
        for friction in (0.2, 0.8):
            self.assert_border(lambda angle, mu=friction: blocks.wedge_stands(angle, mu), 2.0 * np.arctan(friction), NEAR)

    def test_arch(self):
        """Least thickness and friction."""
        judge = walls.Judge()
        for n, thickness in ((9, 0.1021338), (27, 0.1067760)):
            self.assert_border(lambda t, n=n: judge.stands(walls.arch(n, t, walls.ROUGH)), thickness, -NEAR)
        self.assert_border(lambda mu: judge.stands(walls.arch(9, 0.15, mu)), 0.3335067, -NEAR)
        self.assertEqual(judge.missed, 0)

    def test_tilt(self):
        """A wall whose joints do not slide before it falls, and one that slides on its base."""
        judge = walls.Judge()
        self.assert_border(lambda lean: judge.stands(walls.wall(3, 8, 0.6, lean, 0.02)), 0.5244405, NEAR)
        self.assert_border(lambda lean: judge.stands(walls.wall(4, 4, 0.6, lean)), 0.6, NEAR)
        self.assertEqual(judge.missed, 0)

    def test_rest(self):
        """A wall at rest needs few iterations a step, does not sink and does not rock."""
        steps = 400
        found = walls.wall(8, 8, 0.5).run(steps, solver={}, output={"contacts": False})
        self.assertTrue(found.converged)
        self.assertLess(found.iterations[-steps // 5:].mean(), 5.0)
        # the accuracy that a case has unless told
        self.assertLess(found.speed(), 0.1)
        self.assertLess(np.abs(found.turn).max(), 1.0e-5)

    def test_landing(self):
        self.check(motion.landing, True)

    def test_invariance(self):
        """Falling polygons turned by right angles and mirrored, and a square made of four against one."""
        self.check(motion.invariance, True)


if __name__ == "__main__":
    unittest.main()
