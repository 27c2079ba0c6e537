"""Samples between the boundaries of a case: grains inside drums, tubes and cones, on one side of what parts the box, and clear of what stands in it."""
import hashlib
import math
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, gravier, merged, namelist, write
from test_run_sample import Bodies

BASE = {
    "scene": {"dimension": 2, "bodies": "sample", "density": 2500.0, "friction": 0.5},
    "sample": {"container": "boundaries", "count": 120, "radii": "uniform", "radius_min": 0.009, "radius_max": 0.012, "file": "sample.h5"},
    "time": {"step": 1e-3, "steps": 0},
}
RADIUS = 0.2
DRUM = merged(BASE, {"scene": {"period_origin": [-RADIUS, -RADIUS]}, "sample": {"box": [2 * RADIUS] * 2},
                     "boundary": [{"name": "drum", "shape": "circle", "radius": RADIUS, "rotation": 3.0}]})
#: a box of 1 m by 0.4 m that a plate parts at 0.3 m
PARTED = merged(BASE, {"sample": {"box": [1.0, 0.4], "count": 60}, "boundary": [
    {"name": "plate", "shape": "segment", "point": [0.3, -1.0], "end": [0.3, 2.0]}, {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}]})


def make(case, directory, ranks=1, files=()):
    os.makedirs(directory, exist_ok=True)
    for name, text in dict(files).items():
        write(os.path.join(directory, name), text)
    write(os.path.join(directory, "sample.nml"), namelist(case))
    return gravier("sample.nml", ranks=ranks, directory=directory, program="gravier_sample")


def cone(sides, radii, heights):
    """A bucket of flat facets, closed at its lower end."""
    rings = [[(r * math.cos(2 * math.pi * k / sides), r * math.sin(2 * math.pi * k / sides), z) for k in range(sides)] for r, z in zip(radii, heights)]
    facets = []
    for k in range(sides):
        after = (k + 1) % sides
        low, high = rings
        facets += [(low[k], low[after], high[after]), (low[k], high[after], high[k]), ((0.0, 0.0, heights[0]), low[after], low[k])]
    return "solid cone\n" + "".join("facet normal 0 0 0\nouter loop\n" + "".join("vertex %r %r %r\n" % corner for corner in facet) +
                                    "endloop\nendfacet\n" for facet in facets) + "endsolid cone\n"


class Containers(RunTestCase):

    def bodies(self, run):
        self.assert_status(run, 0)
        found = Bodies(run.path("sample.h5"))
        self.assertEqual(len(found.point), 0, "no planes of the box")
        return found

    def test_drum(self):
        """Disks in a drum, the same on one and on two ranks. They settle in it while it stands still, and a run in which it turns starts from their forces."""
        digests = set()
        for ranks in (1, 2):
            run = make(DRUM, self.here(f"loose-{ranks}"), ranks)
            with open(run.path("sample.h5"), "rb") as file:
                digests.add(hashlib.sha256(file.read()).hexdigest())
        self.assertEqual(len(digests), 1)
        loose = self.bodies(run)
        self.assertLess((np.linalg.norm(loose.position, axis=1) + loose.radius).max(), RADIUS)
        self.assertLess(loose.deepest(), 0.0)
        # wherever there is room, up and down, left and right
        for side in (loose.position[:, 0], loose.position[:, 1]):
            self.assertGreater((side > 0.5 * RADIUS).sum(), 10)
            self.assertGreater((side < -0.5 * RADIUS).sum(), 10)
        run = make(merged(DRUM, {"sample": {"preparation": "settled"}}), self.here("settled"))
        settled = self.bodies(run)
        self.assertIn("boundaries  stand still until the grains are at rest\n", run.stdout)
        self.assertRegex(run.stdout, r"sample      120 grains, coordination [23]\.\d+, largest overlap 0\.0\d+ mean radii, \d+ steps\n")
        self.assertLess((np.linalg.norm(settled.position, axis=1) + settled.radius).max(), RADIUS + 2e-4)
        self.assertLess(settled.position[:, 1].max(), 0.5 * RADIUS)
        # a heap that has slid round with the wall would lie to one side
        self.assertLess(abs(np.average(settled.position[:, 0], weights=settled.mass)), 0.02 * RADIUS)
        case = merged(DRUM, {"scene": {"bodies": "file", "bodies_file": "sample.h5", "period_origin": None}, "time": {"steps": 1},
                             "boundary": [{**DRUM["boundary"][0], "rotation": 0.0}]})
        del case["sample"]
        write(run.path("case.nml"), namelist(case))
        started = gravier("case.nml", directory=run.directory)
        self.assert_status(started, 0)
        self.assertRegex(started.stdout, r"start       from forces of the bodies file: (\d+) of its \1 contacts touch in the first step, with 100\.0 %")

    def test_tube_and_cone(self):
        """Spheres in a tube with a floor, and in a cone of facets: none lies outside, where the box goes on."""
        tube = merged(BASE, {"scene": {"dimension": 3, "period_origin": [-0.1, -0.1, -0.05]}, "sample": {"box": [0.2, 0.2, 0.25], "count": 150}, "boundary": [
            {"name": "tube", "shape": "cylinder", "radius": 0.1, "axis": [0.0, 0.0, 1.0]}, {"name": "floor", "shape": "plane", "normal": [0.0, 0.0, 1.0]}]})
        found = self.bodies(make(tube, self.here("tube")))
        self.assertLess((np.linalg.norm(found.position[:, :2], axis=1) + found.radius).max(), 0.1)
        self.assertGreater((found.position[:, 2] - found.radius).min(), 0.0)
        case = merged(BASE, {"scene": {"dimension": 3, "period_origin": [-0.2, -0.2, 0.0]}, "sample": {"box": [0.4, 0.4, 0.3], "preparation": "settled"},
                             "boundary": [{"name": "cone", "shape": "mesh", "file": "cone.stl"}]})
        found = self.bodies(make(case, self.here("cone"), files={"cone.stl": cone(24, (0.05, 0.2), (0.0, 0.3))}))
        self.assertEqual(len(found.id), 120)
        # a circle about the cone at the height of each grain, less half of it along the slope
        self.assertGreater((0.05 + 0.5 * found.position[:, 2] - np.linalg.norm(found.position[:, :2], axis=1) - found.radius).min(), -1e-3)
        self.assertGreater((found.position[:, 2] - found.radius).min(), -2e-4)
        self.assertLess(found.position[:, 2].max(), 0.2)

    def test_inner_point(self):
        """What parts the box leaves grains on the side of the inner point, which is the middle of the box by default."""
        for point, left in ((None, False), ([0.1, 0.2], True)):
            found = self.bodies(make(merged(PARTED, {"sample": {"inner_point": point}}), self.here(f"parted {left}")))
            side = (0.3 - found.position[:, 0]) * (1.0 if left else -1.0)
            self.assertGreater((side - found.radius).min(), 0.0)

    def test_mesh_as_wide_as_the_period(self):
        """A fin of a mesh that stands beside the end of a period keeps grains away on the other side of it, too; a tube across the end is filled as a whole."""
        case = merged(BASE, {"scene": {"period": [0.4, 0.0]}, "sample": {"container": "box", "box": [0.4, 0.5], "count": 120},
                             "boundary": [{"name": "bed", "shape": "mesh", "file": "bed.csv"}]})
        run = make(case, self.here("fin"), files={"bed.csv": "x,y\n0,0.01\n0.001,0.4\n0.002,0.01\n0.4,0.01\n"})
        self.assert_status(run, 0)
        found = Bodies(run.path("sample.h5"))
        beside = found.position[:, 1] < 0.4
        self.assertGreater(np.minimum(np.abs(found.position[beside, 0] - 0.002), np.abs(found.position[beside, 0] - 0.4)).min(), 0.008)
        tube = merged(BASE, {"scene": {"dimension": 3, "period": [0.4, 0.0, 0.0], "period_origin": [0.0, -0.1, -0.1]}, "sample": {
            "box": [0.4, 0.2, 0.2], "count": 200}, "boundary": [{"name": "tube", "shape": "cylinder", "radius": 0.1, "axis": [1.0, 0.0, 0.0]}]})
        found = self.bodies(make(tube, self.here("periodic tube")))
        self.assertLess((np.linalg.norm(found.position[:, 1:], axis=1) + found.radius).max(), 0.1)

    def test_obstacles(self):
        """Grains in a box keep clear of a plate that stands in it, on both sides."""
        case = merged(PARTED, {"sample": {"container": "box"}, "boundary": [{**PARTED["boundary"][0], "point": [0.3, 0.1], "end": [0.3, 0.3]}]})
        run = make(case, self.here("obstacle"))
        self.assert_status(run, 0)
        found = Bodies(run.path("sample.h5"))
        self.assertEqual(len(found.point), 4 - 1)
        # the plate is 0.2 m long
        beyond = np.abs(found.position[:, 1] - 0.2) - 0.1
        distance = np.hypot(found.position[:, 0] - 0.3, np.maximum(beyond, 0.0))
        self.assertGreater((distance - found.radius).min(), 0.0)
        self.assertGreater((found.position[:, 0] < 0.3).sum(), 5)

    def test_outlet(self):
        """Grains that leave through an outlet while the sample settles are counted in the log; those over the floor stay."""
        case = merged(BASE, {"sample": {"container": "box", "box": [0.6, 0.4], "count": 60, "preparation": "settled"}, "scene": {"period_origin": [0.0, 0.2]}})
        case["boundary"] = [{"name": "shelf", "shape": "segment", "point": [0.0, 0.4], "end": [0.3, 0.4]},
                            {"name": "out", "shape": "outlet", "point": [0.0, 0.22], "normal": [0.0, 1.0]}]
        run = make(case, self.here("outlet"))
        self.assert_status(run, 0)
        left = 60 - len(Bodies(run.path("sample.h5")).id)
        self.assertTrue(10 < left < 60)
        self.assertIn(f"warning     *** {left} grains left through outlets\n", run.stdout)

    def test_refused(self):
        """One line, status 2, no bodies file."""
        refused = {
            "without boundaries": ({}, "&sample container = 'boundaries': expected 'box' where the case has no &boundary"),
            "wall": ({"boundary": [{"name": "floor", "shape": "wall", "wall": "121"}]}, "expected 'box' where a &boundary has shape = 'wall'"),
            "compacted": ({"sample": {"preparation": "compacted", "pressure": 1.0}}, "expected 'box' where preparation = 'compacted'"),
            "lattice": ({"sample": {"arrangement": "lattice"}}, "expected 'box' where arrangement = 'lattice'"),
            "no height": ({"sample": {"box": [0.4, 0.0]}}, "expected sizes > 0 along all axes where container = 'boundaries'"),
            "point without use": ({"sample": {"container": "box", "inner_point": [0.0, 0.0]}}, "inner_point belongs to container = 'boundaries'"),
            "point at the drum": ({"sample": {"inner_point": [0.195, 0.0]}}, "where the largest grain with a radius of 1.20E-02 m has room, but it lies "
                                                                           "5.00E-03 m from the nearest boundary"),
            "point outside": ({"sample": {"inner_point": [0.3, 0.0]}}, "but it lies 1.00E-01 m behind the nearest boundary"),
            "too many": ({"sample": {"count": 300}}, "&sample box: too many grains for the space inside the boundaries, or a box that has little of this space: of 300 grains, "),
        }
        for name, (change, text) in refused.items():
            with self.subTest(name):
                case = merged(DRUM, change)
                if not change:
                    del case["boundary"]
                run = make(case, self.here("refused " + name))
                self.assert_status(run, 2)
                self.assertIn(text, run.stderr)
                self.assertEqual(len(run.stderr.splitlines()), 1)
                self.assertFalse(any(file.endswith((".h5", ".log")) for file in os.listdir(run.directory)))


if __name__ == "__main__":
    unittest.main()
