"""Walls without a thickness: bodies on their two sides do not touch each other through them."""
import numpy as np

from gravier_runs import RunTestCase, merged, run_case, write

RADIUS, FORCE, FRICTION = 0.01, 100.0, 0.3
BOX = "shape box\npolygon -0.01 -0.01 0.01 -0.01 0.01 0.01 -0.01 0.01\n"


class ThinWalls(RunTestCase):

    def pull(self, title, dimension, grains, wall, **scene):
        """Two bodies that planes press with FORCE each against a wall between them, which is drawn away along itself: the force that this takes."""
        def along(value):
            return [value, *[0.0] * (dimension - 1)]
        free = [True, *[False] * (dimension - 1)]
        case = {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "../" + grains, "gravity": [0.0] * dimension, "friction": 0.8,
                          "wall_friction": 0.8, "rotation": False, **scene},
                "boundary": [{"name": "left", "shape": "plane", "point": along(-2 * RADIUS), "normal": along(1.0), "free": free, "mass": 1.0,
                              "force": along(FORCE)},
                             {"name": "right", "shape": "plane", "point": along(2 * RADIUS), "normal": along(-1.0), "free": free, "mass": 1.0,
                              "force": along(-FORCE)},
                             {"name": "wall", "friction": FRICTION, "velocity": [0.0, 1e-3, 0.0][:dimension], **wall}],
                "time": {"step": 1e-3, "steps": 50}, "output": {"directory": "results", "every": 0, "boundary_forces": True}}
        run = run_case(merged(case, {}), directory=self.here(title))
        self.assert_status(run, 0)
        return -run.history()["force_y:wall"]

    def test_rod_between_two(self):
        """Disks and boxes on a segment, spheres on a rectangle: friction on both sides. Beyond the end of the wall the bodies do touch."""
        write(self.here("disks.csv"), f"id,x,y,radius\n1,{-RADIUS},0,{RADIUS}\n2,{RADIUS},0,{RADIUS}\n")
        write(self.here("boxes.csv"), f"id,x,y,shape\n1,{-RADIUS},0,box\n2,{RADIUS},0,box\n")
        write(self.here("spheres.csv"), f"id,x,y,z,radius\n1,{-RADIUS},0,0,{RADIUS}\n2,{RADIUS},0,0,{RADIUS}\n")
        write(self.here("boxes.shapes"), BOX)
        segment = {"shape": "segment", "point": [0.0, -0.1], "end": [0.0, 0.1]}
        rectangle = {"shape": "rectangle", "point": [0.0, -0.1, -0.1], "edge_a": [0.0, 0.2, 0.0], "edge_b": [0.0, 0.0, 0.2]}
        beyond = {"shape": "segment", "point": [0.0, 0.05], "end": [0.0, 0.1]}
        for title, dimension, grains, wall, scene, force in (
                ("disks", 2, "disks.csv", segment, {}, 2 * FRICTION * FORCE), ("spheres", 3, "spheres.csv", rectangle, {}, 2 * FRICTION * FORCE),
                ("boxes", 2, "boxes.csv", segment, {"shapes": "../boxes.shapes", "density": 2500.0, "rotation": True}, 2 * FRICTION * FORCE),
                ("beyond", 2, "disks.csv", beyond, {}, 0.0)):
            with self.subTest(title):
                np.testing.assert_allclose(self.pull(title, dimension, grains, wall, **scene)[5:], force, rtol=1e-3, atol=1e-9)
