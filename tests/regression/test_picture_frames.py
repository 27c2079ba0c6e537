"""The frame of a picture of bodies: one grain far away does not take it, and a note says how many grains are outside."""
import os
import sys
import types
import unittest

import matplotlib.collections
import matplotlib.pyplot as plt
import numpy as np
from gravier_runs import SOURCE, RunTestCase, write

import gravier

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import gravier_plot  # noqa: E402
import packing_picture  # noqa: E402
import picture_space  # noqa: E402

#: disks of a block, in each direction, and their radius
SIDE, RADIUS = 12, 0.01
GROUND = {"name": "ground", "shape": "plane", "normal": [0.0, 1.0]}


class Frames(RunTestCase):

    def scene(self, name, far, side=SIDE, dimension=2, steps=1):
        """A block of grains on the ground and some far away, after some steps."""
        grid = np.stack(np.meshgrid(*[np.arange(side) * 2.1 * RADIUS] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
        grid[:, -1] += RADIUS
        os.makedirs(self.here(name))
        rows = [f"{k},{','.join(map(str, place))},{RADIUS}" for k, place in enumerate([*grid, *far], 1)]
        write(self.here(name, "bodies.csv"), "\n".join([f"id,{','.join('xyz'[:dimension])},radius", *rows]) + "\n")
        normal = [0.0] * (dimension - 1) + [1.0]
        gravier.run({"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "bodies.csv", "friction": 0.3},
                     "boundary": [{**GROUND, "normal": normal}], "time": {"step": 1e-3, "steps": steps},
                     "output": {"directory": "results", "every": 1}}, self.here(name))
        return gravier.Run(self.here(name, "results"))

    def draw(self, run, frame=None, step=None, **options):
        figure = packing_picture.draw_packing(run, step, types.SimpleNamespace(**{
            "view": (-60.0, 20.0), "size": 5.0, "colour": "speed", "chains": True, "regions": False, "box": None, **options}), frame)
        self.addCleanup(plt.close, figure)
        axes = figure.axes[0]
        return axes, [text.get_text() for text in axes.texts if "outside" in text.get_text()], np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())

    def test_one_far_away(self):
        """The frame is that of the block, whichever side the others are on, and the picture says how many these are."""
        wide, alone = 2.1 * RADIUS * SIDE, self.scene("alone", [])
        _, notes, *sizes = self.draw(alone)
        self.assertEqual(notes, [])
        for name, far in (("right", [[50.0, RADIUS]]), ("left", [[-50.0, RADIUS]]), ("up", [[0.1, 50.0]]), ("oblique", [[50.0, 50.0]])):
            axes, notes, *found = self.draw(self.scene(name, far))
            self.assertEqual(notes, ["1 grain outside"], name)
            np.testing.assert_allclose(found, sizes, rtol=1e-3, err_msg=name)
            self.assertIn("145 disks", axes.get_title(loc="left"))
            drawn = next(one for one in axes.collections if isinstance(one, matplotlib.collections.EllipseCollection))
            self.assertEqual(len(drawn.get_offsets()), SIDE**2)
        # the two of the outermost percentiles that are in the block are drawn; of two far off neither is
        self.assertEqual(self.draw(self.scene("two", [[-50.0, RADIUS], [70.0, RADIUS]]))[1], ["2 grains outside"])
        # three times as large is not too large, and a wall belongs to the scene however long it is
        _, notes, across, _ = self.draw(self.scene("near", [[2.5 * wide, RADIUS]]))
        self.assertEqual(notes, [])
        self.assertGreater(across, 2.5 * wide)
        # a few grains are no crowd
        self.assertEqual(self.draw(self.scene("few", [[50.0, RADIUS]], side=5))[1], [])
        # one part in ten is no stray
        self.assertEqual(self.draw(self.scene("many", [[50.0 + k, RADIUS] for k in range(15)]))[1], [])

    def test_walls_belong_to_the_frame(self):
        """Grains may be far from each other within walls, which are shown as ever."""
        bodies = self.scene("walled", [[2.0, RADIUS]]).bodies(0)
        walls = types.SimpleNamespace(planes=lambda: (np.zeros((0, 2)), np.zeros((0, 2))), facets=np.zeros((0, 2, 2)), cylinders=lambda: [], polygons=lambda: [])
        low, high = picture_space.frame_around(bodies, walls)
        self.assertLess(high[0], 0.3)
        walls.polygons = lambda: [np.array([[0.0, 0.0], [2.1, 0.0]])]
        low, high = picture_space.frame_around(bodies, walls)
        self.assertAlmostEqual(high[0], 2.1)
        walls.polygons = lambda: [np.array([[0.0, 0.0], [1.0, 0.0]])]
        self.assertAlmostEqual(picture_space.frame_around(bodies, walls)[1][0], 2.0 + RADIUS)

    def test_in_space_and_in_movies(self):
        """A sphere outside of the box is not drawn, and all pictures of a movie have the frame of the others."""
        run = self.scene("space", [[30.0, 0.1, RADIUS]], side=5, dimension=3, steps=2)
        axes, notes, *_ = self.draw(run, chains=False)
        self.assertEqual(notes, ["1 grain outside"])
        self.assertLess(np.ptp(axes.get_xlim()), 0.5)
        options = types.SimpleNamespace(view=None, size=5.0, colour="speed", chains=False, regions=False, box=None)
        frame = packing_picture.shared_frame(run, [0, 1, 2], options)
        self.assertLess(np.max(frame.high - frame.low), 0.2)
        for step in (0, 2):
            self.assertEqual(self.draw(run, frame, step, chains=False, view=None)[1], notes)
        # a box that is asked for is that, and all is there to be asked for
        self.assertEqual(self.draw(run, chains=False, box=[29.0, 31.0, 0.0, 1.0, 0.0, 1.0])[1], [])
        gravier_plot.main(["packing", self.here("space/results"), "--out", self.here("space.png"), "--dpi", "50"])
        self.assertTrue(os.path.getsize(self.here("space.png")) > 0)


if __name__ == "__main__":
    unittest.main()
