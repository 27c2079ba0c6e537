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
        write(self.here("wall.csv"), "x,y\n0,-0.1\n0,0.01\n0,0.1\n")
        write(self.here("wall.obj"), "v 0 -0.1 -0.1\nv 0 0.1 -0.1\nv 0 0.1 0.1\nv 0 -0.1 0.1\nf 1 2 3\nf 1 3 4\n")
        line, square = ({"shape": "mesh", "file": "../wall." + ending} for ending in ("csv", "obj"))
        for title, dimension, grains, wall, scene, force in (
                ("disks", 2, "disks.csv", segment, {}, 2 * FRICTION * FORCE), ("spheres", 3, "spheres.csv", rectangle, {}, 2 * FRICTION * FORCE),
                ("boxes", 2, "boxes.csv", segment, {"shapes": "../boxes.shapes", "density": 2500.0, "rotation": True}, 2 * FRICTION * FORCE),
                ("disks on a mesh", 2, "disks.csv", line, {}, 2 * FRICTION * FORCE), ("spheres on a mesh", 3, "spheres.csv", square, {}, 2 * FRICTION * FORCE),
                ("boxes on a mesh", 2, "boxes.csv", line, {"shapes": "../boxes.shapes", "density": 2500.0, "rotation": True}, 2 * FRICTION * FORCE),
                ("beyond", 2, "disks.csv", beyond, {}, 0.0)):
            with self.subTest(title):
                np.testing.assert_allclose(self.pull(title, dimension, grains, wall, **scene)[5:], force, rtol=1e-3, atol=1e-9)

    def test_thin_bodies_on_a_wall(self):
        """A brick on a thin plate on the ground, whatever the ground is: the wall below both is between none of their surfaces."""
        write(self.here("flat.shapes"), "shape brick\npolygon -0.01 -0.005 0.01 -0.005 0.01 0.005 -0.01 0.005\n"
                                        "shape plate\npolygon -0.01 -0.0002 0.01 -0.0002 0.01 0.0002 -0.01 0.0002\n")
        write(self.here("pile.csv"), "id,x,y,shape\n1,0,0.0002,plate\n2,0,0.0054,brick\n")
        write(self.here("ground.csv"), "x,y\n-0.1,0\n0.1,0\n")
        for name, ground in (("plane", {"shape": "plane", "normal": [0.0, 1.0]}), ("segment", {"shape": "segment", "point": [-0.1, 0.0], "end": [0.1, 0.0]}),
                             ("mesh", {"shape": "mesh", "file": "../ground.csv"})):
            with self.subTest(name):
                case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../pile.csv", "shapes": "../flat.shapes", "friction": 0.5},
                        "boundary": [ground], "time": {"step": 1e-3, "steps": 200}, "output": {"directory": "results", "every": 200}}
                run = run_case(case, directory=self.here("pile " + name))
                self.assert_status(run, 0)
                self.assertAlmostEqual(run.results("results")["/steps/200/bodies/position"][1, 1], 0.0054, delta=2e-5)

    def test_meshes_between_subdomains(self):
        """A mesh that parts a packing is between grains of other subdomains, too: no pair of grains across it has a contact."""
        write(self.here("bed.csv"), "id,x,y,radius\n" + "".join(
            f"{8 * j + i + 1},{RADIUS * (2 * i - 7)!r},{RADIUS * (2 * j + 1)!r},{RADIUS}\n" for j in range(8) for i in range(8)))
        write(self.here("parting.csv"), "x,y\n0,-0.1\n0,0.06\n0,0.3\n")
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "../bed.csv", "friction": 0.5}, "boundary": [
            {"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
            *({"name": name, "shape": "plane", "point": [sign * 8 * RADIUS, 0.0], "normal": [-sign, 0.0]} for name, sign in (("left", -1.0), ("right", 1.0))),
            {"name": "parting", "shape": "mesh", "file": "../parting.csv"}],
            "time": {"step": 1e-3, "steps": 20}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4, "grid": [1, 4]},
            "output": {"directory": "results", "every": 20}}
        for grid, ranks in (([1, 4], 1), ([4, 1], 1), ([4, 1], 2), ([2, 2], 2)):
            with self.subTest(grid=grid, ranks=ranks):
                run = run_case(merged(case, {"decomposition": {"grid": grid}}), ranks=ranks, directory=self.here(f"bed {grid} {ranks}"))
                self.assert_status(run, 0)
                found = run.results("results")
                one, other = (np.asarray(found[f"/steps/20/contacts/{name}"]) for name in ("candidate", "antagonist"))
                pairs = (one <= 64) & (other <= 64)
                self.assertGreater(pairs.sum(), 90)
                self.assertFalse((((one[pairs] - 1) % 8 < 4) != ((other[pairs] - 1) % 8 < 4)).any())
