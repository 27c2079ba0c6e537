"""Mesh walls against the analytic walls that they stand for: planes cut into triangles in any way, corners, edges that stick out, drums
of chords, boxes on floors, walls that are driven or loaded, floors as wide as the period."""
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, each, merged, run_case, write
import gravier
from mesh_scenes import box, floor, quadrangles, stl_bytes, stl_text, write_line
from shaped_scenes import body, prepare, shaped_case

G = 9.81
RADIUS = 0.05
#: an apex where seven faces meet, no two of them alike
SPIKE = "shape spike\nrounding 0.001\nhull 0 0 -0.1 " + " ".join(
    f"{0.08 * np.cos(angle):.6f} {0.06 * np.sin(angle):.6f} {0.05 + 0.01 * np.cos(5 * k):.6f}"
    for k, angle in enumerate(2 * np.pi * np.arange(7) / 7 + 0.1 * np.sin(3 * np.arange(7)))) + "\n"
MESH = {"name": "wall", "shape": "mesh", "file": "wall.stl"}
LINE = {"name": "wall", "shape": "mesh", "file": "wall.csv"}
TIGHT = {"solver": {"tolerance": 1e-11, "check_every": 1}}


def rotation(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn if np.linalg.det(turn) > 0 else -turn


def numbers(vector):
    return [float(x) for x in vector]


class Motion:
    """What a run left of all bodies and of the contacts; arrays by written state."""

    def __init__(self, run):
        self.found, self.directory = run.results(), run.path("results")
        self.steps = self.found.steps()
        self.position = self.all("bodies/position")
        self.velocity = self.all("bodies/velocity")

    def all(self, name):
        return np.array(self.found.of_steps(name))

    def contacts(self, step=-1):
        return self.found[f"/steps/{self.steps[step]}/contacts/impulse"]

    def most_contacts(self):
        return max(len(self.contacts(k)) for k in range(1, len(self.steps)))


class MeshWalls(RunTestCase):

    def play(self, title, dimension, rows, boundaries, *parts, mesh=None, line=None, ranks=1, library=None):
        """A run of bodies between boundaries, of which one may be a mesh."""
        directory = prepare(self.here(title), dimension, rows, library)
        if mesh is not None:
            write(os.path.join(directory, "wall.stl"), stl_text(mesh))
        if line is not None:
            write_line(os.path.join(directory, "wall.csv"), line)
        case = shaped_case(dimension, boundaries, {"scene": {"friction": 0.3}, "time": {"step": 1.0 / 512}, "output": {"every": 10}}, TIGHT, *parts)
        if all(row["shape"] == "grain" for row in rows):
            del case["scene"]["shapes"]
        run = run_case(case, ranks, directory)
        self.assert_status(run, 0)
        return Motion(run)

    def same(self, one, other, tolerance=1e-11):
        """The same motion and the same number of contacts."""
        np.testing.assert_allclose(one.position, other.position, rtol=0, atol=tolerance)
        np.testing.assert_allclose(one.velocity, other.velocity, rtol=0, atol=100 * tolerance)
        for k in range(1, len(one.steps)):
            self.assertEqual(len(one.contacts(k)), len(other.contacts(k)), f"contacts of step {k}")

    @staticmethod
    def ball(place, velocity=(0.0, 0.0, 0.0)):
        return body("grain", numbers(place), velocity=numbers(velocity), radius=RADIUS)

    def test_plane(self):
        """A ball rolls as on a plane over 2, 200 and 20 000 triangles, lying along the axes and turned."""
        for turn in (np.eye(3), rotation(3)):
            rows = [self.ball(turn @ [-1.3, -0.9, RADIUS], turn @ [1.5, 1.1, 0.0])]
            scene = {"scene": {"gravity": numbers(turn @ [0.5, 0.2, -G])}}
            plane = {"name": "wall", "shape": "plane", "normal": numbers(turn[:, 2])}
            name = "turned" if turn[0, 0] != 1.0 else "flat"
            wanted = self.play(f"{name} plane", 3, rows, [plane], scene)
            for count in (1, 10, 100):
                with self.subTest(name, triangles=2 * count**2):
                    self.same(wanted, self.play(f"{name} {count}", 3, rows, [MESH], scene, mesh=floor(count, 2.0, count, turn)), 1e-12)

    def test_single_precision(self):
        """Triangles of a binary file, which do not lie in one plane by its rounding, carry a ball that rolls along them."""
        turn = rotation(5)
        directory = self.here("single")
        prepare(directory, 3, [self.ball(turn @ [-1.3, -0.9, RADIUS + 1e-6], turn @ [1.5, 1.1, 0.0])])
        with open(os.path.join(directory, "wall.stl"), "wb") as file:
            file.write(stl_bytes(floor(40, 2.0, 4, turn)))
        case = shaped_case(3, [MESH], {"scene": {"friction": 0.3, "gravity": numbers(turn @ [0.0, 0.0, -G])}, "output": {"every": 10},
                                       "time": {"steps": 300}})
        del case["scene"]["shapes"]
        run = run_case(case, 1, directory)
        self.assert_status(run, 0)
        motion = Motion(run)
        height = motion.position[:, 0] @ turn[:, 2] - RADIUS
        # roundings of 1e-7 m, and what a ball rises over edges of such angles
        self.assertLess(np.abs(height).max(), 2e-5)
        rolling = motion.velocity[-1, 0, :3] @ turn
        # friction takes two sevenths of the sliding velocity
        np.testing.assert_allclose(rolling, [1.5 * 5 / 7, 1.1 * 5 / 7, 0.0], atol=2e-3)

    def test_corner(self):
        """In a box of twelve triangles a ball comes to rest in a corner, as between three planes. Without friction each contact carries a
        component of the weight; with friction there are more impulses than equations, and how they share it is not unique."""
        rows = [self.ball([0.2, 0.3, 0.25])]
        planes = [{"shape": "plane", "normal": numbers(normal)} for normal in np.eye(3)]
        for friction in (0.0, 0.3):
            scene = {"scene": {"gravity": [-3.0, -2.0, -9.0], "friction": friction}, "time": {"steps": 450}}
            wanted = self.play(f"corner of planes {friction}", 3, rows, planes, scene)
            found = self.play(f"corner of a box {friction}", 3, rows, [MESH], scene, mesh=box([0, 0, 0], [1, 1, 1]))
            self.same(wanted, found)
            self.assertEqual(len(found.contacts()), 3)
            if friction == 0.0:
                impulses = np.sort(found.contacts()[:, 0])
                np.testing.assert_allclose(impulses / impulses[0], [1.0, 1.5, 4.5], rtol=1e-8)
                np.testing.assert_allclose(impulses, np.sort(wanted.contacts()[:, 0]), rtol=1e-8)

    def test_edge(self):
        """A ball that rolls slowly over the edge of a table turns about it without slip, and leaves it where nothing presses any more:
        7/10 v^2 = 7/10 v0^2 + g R (1 - cos) and v^2 = g R cos."""
        first = 0.15
        rows = [body("grain", [-0.01, 0.013, RADIUS], velocity=[first, 0.0, 0.0], spin=[0.0, first / RADIUS, 0.0], radius=RADIUS)]
        table = np.concatenate([floor(4, 0.5, 1, shift=(-0.5, 0.0, 0.0)),
                                quadrangles(np.array([[[0.0, y, z] for z in (0.0, -0.2, -0.5)] for y in (-0.5, 0.1, 0.5)]))])
        wanted = (1.0 + 0.7 * first**2 / (G * RADIUS)) / 1.7
        for halved in (0, 2):
            motion = self.play(f"edge {halved}", 3, rows, [MESH], {"scene": {"friction": 5.0}, "time": {"step": 2.0**-9 / 2**halved, "steps": 150 * 2**halved},
                                                                      "output": {"every": 1}}, mesh=table)
            pressed = [k for k in range(1, len(motion.steps)) if len(motion.contacts(k)) > 0 and motion.contacts(k)[:, 0].max() > 1e-12]
            self.assertEqual(motion.most_contacts(), 1)
            last = motion.position[pressed[-1], 0]
            self.assertGreater(last[0], 0.0)
            gap = np.hypot(last[0], last[2]) - RADIUS
            self.assertLess(abs(gap), 2e-4 / 4**halved)
            # a step turns the ball by 0.02
            self.assertLess(abs(last[2] / np.hypot(last[0], last[2]) - wanted), 0.02 / 2**halved)
            np.testing.assert_allclose(motion.position[:, 0, 1], 0.013, atol=1e-12)

    def test_drum_of_chords(self):
        """A disk that falls into the lowest corner of a polygon has its centre as far from the drum's as R - r/cos(pi/n), which
        becomes R - r as 1/n^2."""
        large = 0.4
        def rest(n):
            angle = 2.0 * np.pi * (np.arange(n + 1) % n) / n - 0.5 * np.pi
            line = large * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            rows = [body("grain", [0.0, -0.34], radius=RADIUS)]
            motion = self.play(f"drum {n}", 2, rows, [LINE], {"scene": {"friction": 0.0}, "time": {"steps": 50}}, line=line)
            self.assertEqual(len(motion.contacts()), 2)
            np.testing.assert_allclose(motion.position[-1, 0, 0], 0.0, atol=1e-9)
            return -motion.position[-1, 0, 1]
        sides = [8, 16, 32, 64]
        errors = np.array([large - RADIUS - place for (place,) in each(lambda n: (rest(n),), [(n,) for n in sides])])
        np.testing.assert_allclose(errors, [RADIUS / np.cos(np.pi / n) - RADIUS for n in sides], rtol=1e-3)
        np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.1)

    def test_blocks_in_drums(self):
        """A square and a cube without friction swing in a drum of chords, of facets that are long and narrow in space, and lose what the
        bends take, 1/n of it; their sides, which lean over the joints of the chords, are not stopped there, be it one mesh or as many
        segments or rectangles."""
        large, half, start, steps = 0.16, 0.05, 0.5, 256
        away = np.sqrt(large**2 - half**2) - half - 1e-4
        swing = G * away * (1.0 - np.cos(start))
        across = np.array([np.sin(start), -np.cos(start)])

        def lost(dimension, n, whole):
            angle = 2.0 * np.pi * (np.arange(n + 1) % n) / n - 0.5 * np.pi
            ring = large / np.cos(np.pi / n) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            scene = {"scene": {"friction": 0.0}, "time": {"step": 1.0 / 1024, "steps": steps}, "output": {"every": 16}}
            if dimension == 2:
                row, wall = body("square", away * across, turn=start), {"line": ring}
            else:
                row = body("cube", [away * across[0], 0.0, away * across[1]], turn=[np.cos(0.5 * start), 0.0, -np.sin(0.5 * start), 0.0])
                wall = {"mesh": quadrangles(np.array([[(x, y, z) for y in (-0.5, 0.5)] for x, z in ring]))}
            walls = [LINE if dimension == 2 else MESH]
            if not whole:
                walls, wall = [{**chord(dimension, p, q), "name": f"w{k}"} for k, (p, q) in enumerate(zip(ring[:-1], ring[1:]))], {}
            motion = self.play(f"blocks {dimension} {n} {whole}", dimension, [row], walls, scene, **wall)
            v, spin = motion.velocity[:, 0, :dimension], motion.velocity[:, 0, dimension:]
            energy = 0.5 * (v**2).sum(1) + half**2 / 3.0 * (spin**2).sum(1) + G * motion.position[:, 0, dimension - 1]
            # it goes through the lowest place and up again
            self.assertLess(motion.position[:, 0, dimension - 1].min(), -0.98 * away)
            return (energy[0] - energy[-1]) / swing

        def chord(dimension, p, q):
            if dimension == 2:
                return {"shape": "segment", "point": numbers(p), "end": numbers(q)}
            return {"shape": "rectangle", "point": [p[0], -0.5, p[1]], "edge_a": [q[0] - p[0], 0.0, q[1] - p[1]], "edge_b": [0.0, 1.0, 0.0]}

        jobs = [(2, 180, True), (2, 720, True), (3, 180, True), (3, 360, True), (2, 180, False), (3, 180, False)]
        found = dict(zip(jobs, each(lambda *job: (lost(*job),), jobs)))
        for (dimension, n, whole), (share,) in found.items():
            with self.subTest(dimension=dimension, chords=n, whole=whole):
                self.assertLess(abs(share), 0.02 + 10.0 / n)

    def test_boxes(self):
        """A cube at rest, one that slides and one that lies askew in the air stand as on a plane: four points, with the same loads."""
        scene = {"time": {"steps": 100}, "scene": {"friction": 0.4}}
        cubes = {"rest": body("cube", [0.013, 0.021, 0.05]), "slide": body("cube", [0.013, 0.021, 0.05], velocity=[1.0, 0.7, 0.0]),
                 "pill": body("pill", [0.013, 0.021, 0.03], turn=[1.0, 0.0, 1.0, 0.0], velocity=[0.0, 0.2, 0.0])}
        for title, row in cubes.items():
            wanted = self.play(f"{title} on a plane", 3, [row], [{"shape": "plane", "normal": [0.0, 0.0, 1.0]}], scene)
            for count in (1, 7, 40):
                with self.subTest(title, count=count):
                    found = self.play(f"{title} on {count}", 3, [row], [MESH], scene, mesh=floor(count, 0.6, count))
                    self.same(wanted, found)
                    np.testing.assert_allclose(np.sort(found.contacts()[:, 0]), np.sort(wanted.contacts()[:, 0]), rtol=1e-6)
        self.assertEqual(len(wanted.contacts()), 2)

    def test_a_corner_that_is_deep(self):
        """Boxes and hulls that are deeper than their roundings after the step in which they meet a rectangle, a mesh or a large cube bounce as on a
        plane: the corner touches where it is."""
        scene = {"time": {"steps": 40}, "scene": {"gravity": [0.0, 0.0, 0.0], "restitution": 0.5}}
        turn, velocity = [0.9, 0.3, 0.2, 0.1], [0.0, 0.0, -1.0]
        rectangle = {"shape": "rectangle", "point": [-1.0, -1.0, 0.0], "edge_a": [2.0, 0.0, 0.0], "edge_b": [0.0, 2.0, 0.0]}
        for shape, height in (("cube", 0.1105), ("askew", 0.0885)):
            row = body(shape, [0.011, 0.023, height], turn=turn, velocity=velocity)
            wanted = self.play(f"{shape} on a plane", 3, [row], [{"shape": "plane", "normal": [0.0, 0.0, 1.0]}], scene)
            self.assertGreater(wanted.velocity[-1, 0, 2], 0.1)
            found = {"rectangle": self.play(f"{shape} on a rectangle", 3, [row], [rectangle], scene),
                     "mesh": self.play(f"{shape} on a mesh", 3, [row], [MESH], scene, mesh=floor(1, 2.0, 1)),
                     # a cube of 10 m is as good as fixed
                     "cube": self.play(f"{shape} on a cube", 3, [row, body("cube", [0.0, 0.0, -5.0], scale=100.0)], [], scene)}
            for name, motion in found.items():
                with self.subTest(shape, wall=name):
                    rounding = 1e-4 if name == "cube" else 1e-11
                    np.testing.assert_allclose(motion.velocity[-1, 0], wanted.velocity[-1, 0], rtol=0, atol=rounding)

    def test_a_corner_on_springs(self):
        """A corner goes deeper than its rounding into a floor on springs and comes back without its energy changed, with one point, whether the floor
        is a plane, a rectangle, a cylinder or a mesh on whose diagonal the corner lands, or beside it; also a corner where seven faces meet."""
        law = {"materials": ["m"], "kind": "elastic", "normal_stiffness": 1e5, "spring_theta": 0.5}
        scene = {"scene": {"gravity": [0.0, 0.0, 0.0], "friction": 0.0, "wall_material": "m"}, "material": [{"name": "m"}], "law": [law],
                 "time": {"step": 2e-4, "steps": 400}, "output": {"every": 10, "energy": True}}
        rectangle = {"shape": "rectangle", "point": [-1.0, -1.0, 0.0], "edge_a": [2.0, 0.0, 0.0], "edge_b": [0.0, 2.0, 0.0]}
        cylinder = {"shape": "cylinder", "point": [0.0, 0.0, 1e4], "axis": [1.0, 0.0, 0.0], "radius": 1e4}

        def drop(title, shape, place, *walls, **more):
            turn = [0.9, 0.3, 0.2, 0.1] if shape == "cube" else None
            row = body(shape, [*place, 0.13], turn=turn, velocity=[0.0, 0.0, -1.0])
            return self.play(f"{shape} {title}", 3, [row], walls, scene, library=SPIKE if shape == "spike" else None, **more)

        for shape in ("cube", "spike"):
            plane = drop("on a plane", shape, (0.0, 0.0), {"shape": "plane", "normal": [0.0, 0.0, 1.0]})
            deep = [plane.found[f"/steps/{step}/contacts/{{}}".format(name)] for name in ("point", "gap") for step in plane.steps[1:]
                    if len(plane.found[f"/steps/{step}/contacts/gap"])]
            landing = deep[0][0, :2]
            self.assertLess(min(gap.min() for gap in deep[len(deep) // 2:]), -3e-3)
            found = {"rectangle": drop("on a rectangle", shape, -landing, rectangle), "cylinder": drop("in a cylinder", shape, -landing, cylinder)}
            for beside in (0.0, 1e-4, 3e-4, 1e-3):
                found[f"mesh, {beside:g} beside"] = drop(f"mesh {beside}", shape, [beside, 0.0] - landing, MESH, mesh=floor(1, 2.0, 1))
            for name, motion in {"plane": plane, **found}.items():
                with self.subTest(shape, wall=name):
                    self.assertEqual(max(np.count_nonzero(motion.contacts(k)[:, 0]) for k in range(1, len(motion.steps))), 1)
                    # the wall of the cylinder rises by 1e-8 m in 1 cm, at a slope of 1e-6
                    np.testing.assert_allclose(motion.velocity[-1, 0], plane.velocity[-1, 0], rtol=0, atol=1e-3 if name == "cylinder" else 1e-9)
            history = gravier.Run(plane.directory).history()
            self.assertLess(abs(history["kinetic_energy"][-1] / history["kinetic_energy"][0] - 1), 2e-3)

    def test_a_side_over_a_flat_ridge(self):
        """A box on a roof so flat that springs press both of its slopes has points on both, whichever facets come first: it stands still, its
        lower ends bear the same on both sides, and a mirror gives the mirror image."""
        library = "shape box\nrounding 0.002\nbox 0.2 0.1 0.05\n"
        law = {"materials": "m", "kind": "elastic", "normal_stiffness": 1e4, "friction": 0.5, "spring_restitution": 0.3}
        for slope in (1e-4, 1e-3):
            a, b = (0.0, -1.0, 0.0), (0.0, 1.0, 0.0)
            left = [((-1.0, -1.0, -slope), a, b), ((-1.0, -1.0, -slope), b, (-1.0, 1.0, -slope))]
            right = [(a, (1.0, -1.0, -slope), (1.0, 1.0, -slope)), (a, (1.0, 1.0, -slope), b)]
            found = []
            for title, facets in (("left first", left + right), ("right first", right + left)):
                motion = self.play(f"ridge {slope} {title}", 3, [body("box", [0.0, 0.0, 0.0251], [1.0, 0.0, 0.0, 0.0])], [{**MESH, "material": "m"}],
                                   {"scene": {"friction": None}, "material": [{"name": "m", "density": 1000.0}], "law": [law],
                                    "time": {"step": 1e-3, "steps": 1000}, "output": {"every": 100}}, mesh=np.array(facets), library=library)
                found.append(motion)
                self.assertLess(np.abs(motion.velocity[-1]).max(), 1e-9, title)
                self.assertEqual(len(motion.contacts()), 6, title)
                place, force = motion.found["/steps/1000/contacts/point"], motion.contacts()[:, 0] / 1e-3
                self.assertAlmostEqual(force.sum(), 9.81, delta=1e-6)
                ends = [force[side * place[:, 0] > 0.05].sum() for side in (1, -1)]
                self.assertAlmostEqual(ends[0], ends[1], delta=1e-6 * force.sum())
            np.testing.assert_allclose(found[0].position[-1], found[1].position[-1], atol=1e-12)

    def test_rims(self):
        """Boxes that fall half over the straight rim of a mesh move as over that of a rectangle, whatever corners the rim has and however the mesh
        is cut, rigid and on springs, also where they are deeper than their roundings."""
        wide = 0.4
        corners = np.array([[0, -wide, 0], [wide, -wide, 0], [wide, wide, 0], [0, wide, 0], [0, 0.013, 0], [0, -0.2, 0]], float)
        meshes = {"two triangles": [(0, 1, 2), (0, 2, 3)], "a corner in the rim": [(0, 1, 4), (1, 2, 4), (2, 3, 4)],
                  "two corners in the rim": [(0, 1, 5), (1, 4, 5), (1, 2, 4), (2, 3, 4)]}
        rectangle = {"shape": "rectangle", "point": [0.0, -wide, 0.0], "edge_a": [wide, 0.0, 0.0], "edge_b": [0.0, 2 * wide, 0.0]}
        library = "shape plank\nrounding 0.001\nbox 0.12 0.03 0.03\n"
        law = {"materials": ["m"], "kind": "elastic", "normal_stiffness": 2e4, "spring_theta": 0.5}
        rigid = {"scene": {"friction": 0.0, "alert_distance": 0.01}, "time": {"step": 1e-3, "steps": 70}}
        springs = merged(rigid, {"scene": {"wall_material": "m"}, "material": [{"name": "m"}], "law": [law], "time": {"step": 5e-4, "steps": 140}})
        for title, scene, seeds in (("rigid", rigid, (6, 12)), ("springs", springs, (6, 39))):
            for seed in seeds:
                random = np.random.default_rng(seed)
                turn = random.normal(size=4)
                place = [random.uniform(-0.03, 0.02), 0.013 + random.uniform(-0.02, 0.02), 0.09]
                row = body("plank", place, turn=numbers(turn / np.linalg.norm(turn)), velocity=[0.0, 0.0, -1.0], spin=numbers(random.uniform(-5, 5, 3)))
                wanted = self.play(f"{title} {seed} rectangle", 3, [row], [rectangle], scene, library=library)
                self.assertGreater(np.abs(wanted.velocity[-1, 0] - wanted.velocity[0, 0]).max(), 1.0)
                for name, faces in meshes.items():
                    with self.subTest(title, seed=seed, mesh=name):
                        found = self.play(f"{title} {seed} {name}", 3, [row], [MESH], scene, mesh=corners[np.array(faces)], library=library)
                        np.testing.assert_allclose(found.velocity[-1, 0], wanted.velocity[-1, 0], rtol=0, atol=1e-6)

    def test_loads_of_a_box(self):
        """The four points of a cube at rest in the middle of a triangulated floor carry about a quarter of its weight each: balance fixes
        three sums of the four."""
        found = self.play("quarters", 3, [body("cube", [0.0, 0.0, 0.05])], [MESH], {"time": {"steps": 20}}, mesh=floor(8, 0.3, 2))
        force = found.contacts()[:, 0]
        self.assertEqual(len(force), 4)
        np.testing.assert_allclose(force, 0.25 * 2500.0 * 0.1**3 * G / 512, rtol=0.02)
        np.testing.assert_allclose(force.sum(), 2500.0 * 0.1**3 * G / 512, rtol=1e-9)

    def test_squares(self):
        """The same in the plane, on a line of many points, whose segments become one."""
        line = [(x, 0.0) for x in np.linspace(-1.0, 1.0, 81)]
        for title, row in {"rest": body("square", [0.013, 0.05]), "slide": body("square", [0.013, 0.05], velocity=[1.0, 0.0]),
                           "askew": body("square", [0.013, 0.1], turn=0.3), "disk": body("grain", [0.013, 0.06], velocity=[1.0, 0.0], radius=0.05)}.items():
            with self.subTest(title):
                wanted = self.play(f"{title} on a segment", 2, [row], [{"shape": "segment", "point": [-1.0, 0.0], "end": [1.0, 0.0]}])
                self.same(wanted, self.play(f"{title} on a line", 2, [row], [LINE], line=line))

    def test_drives(self):
        """A mesh of a rectangle moves as the rectangle does: with a velocity, turning, by a table, by a load."""
        corner, one, two = np.array([-0.5, -0.4, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.8, 0.0])
        grid = [[corner + i / 5 * one + j / 4 * two for j in range(5)] for i in range(6)]
        rectangle = {"name": "wall", "shape": "rectangle", "point": numbers(corner), "edge_a": numbers(one), "edge_b": numbers(two)}
        rows = [self.ball([0.05, 0.03, RADIUS]), self.ball([-0.2, 0.11, RADIUS + 0.01])]
        drives = {
            "velocity": {"velocity": [0.3, 0.1, 0.05]},
            "rotation": {"rotation": [0.2, 0.5, 1.0], "pivot": [0.1, 0.0, 0.0]},
            "table": {"table": "drive.csv"},
            "load": {"free": [False, False, True], "mass": 4.0, "force": [0.0, 0.0, 70.0]},
        }
        for title, keys in drives.items():
            with self.subTest(title):
                for wall in (rectangle, MESH):
                    directory = self.here(f"{title} {wall['shape']}")
                    os.makedirs(directory, exist_ok=True)
                    write(os.path.join(directory, "drive.csv"), "time,vx,vz\n0,0,0\n0.05,1,0.2\n0.1,-1,-0.2\n0.2,0.5,0\n")
                scene = {"time": {"steps": 110}, "output": {"vtk": True}}
                wanted = self.play(f"{title} rectangle", 3, rows, [{**rectangle, **keys}], scene)
                # the pivot of a rectangle is its corner unless told
                found = self.play(f"{title} mesh", 3, rows, [{**MESH, **keys}], scene, mesh=quadrangles(np.array(grid)))
                self.same(wanted, found)
                np.testing.assert_allclose(found.all("boundaries/force"), wanted.all("boundaries/force"), rtol=0, atol=1e-6)
                # both at the origin: they are written at the corner of the rectangle, and where the mesh has its point
                of_found, of_wanted = (run.all("boundaries/velocity") - np.pad(np.cross(run.all("boundaries/velocity")[..., 3:], run.all("boundaries/position")),
                                                                               ((0, 0), (0, 0), (0, 3))) for run in (found, wanted))
                np.testing.assert_allclose(of_found, of_wanted, rtol=0, atol=1e-9)
                if title == "rotation":
                    with h5py.File(os.path.join(found.directory, "boundaries.vtkhdf")) as file:
                        cells = file["VTKHDF/CellData/velocity"][:]
                        centres = file["VTKHDF/Points"][:].reshape(-1, 3, 3).mean(axis=1)
                    np.testing.assert_allclose(cells, np.cross(keys["rotation"], centres - keys["pivot"]), atol=1e-6)
                    self.has_turned(found.directory, np.array(grid), np.array(keys["rotation"]) * 110 / 512, np.array(keys["pivot"]))
        axes = found.all("boundaries/axes")[:, 0].reshape(-1, 3, 3)
        np.testing.assert_allclose(axes @ np.transpose(axes, (0, 2, 1)), np.broadcast_to(np.eye(3), axes.shape), atol=1e-12)

    def test_laws(self):
        """Bounces, rolling resistance, liquid bridges and bonds act as on a plane, while a ball goes from facet to facet."""
        material = {"material": [{"name": "stone"}], "scene": {"wall_material": "stone"}}
        laws = {
            "bounce": ([0.0, 0.0, 0.2], [0.7, 0.4, 0.0], {"scene": {"restitution": 0.6, "tangential_restitution": 0.3}}),
            "rolling": ([0.0, 0.0, RADIUS], [0.7, 0.4, 0.0], {"scene": {"rolling_friction": 0.1}}),
            "wet": ([0.0, 0.0, RADIUS], [0.7, 0.4, 0.4], {**material, "law": [{"materials": ["stone"], "kind": "capillary", "friction": 0.3,
                                                                             "capillarity": 20.0, "decay_length": 0.004, "debonding_distance": 0.01}]}),
            "bond": ([0.0, 0.0, RADIUS], [0.0, 0.0, 0.0], {**material, "scene": {"wall_material": "stone", "gravity": [20.0, 0.0, 5.0]}, "law": [
                {"materials": ["stone"], "kind": "bonded", "friction": 0.3, "bond_strength": 100.0, "bond_friction": 0.5, "bond_distance": 1e-3}]}),
        }
        for title, (place, velocity, part) in laws.items():
            with self.subTest(title):
                rows = [self.ball(place, velocity)]
                part = merged(part, {"time": {"steps": 150}, "solver": {"tolerance": 1e-10}})
                wanted = self.play(f"{title} on a plane", 3, rows, [{"name": "wall", "shape": "plane", "normal": [0.0, 0.0, 1.0]}], part)
                self.same(wanted, self.play(f"{title} on a mesh", 3, rows, [MESH], part, mesh=floor(30, 1.0, 6)), 1e-10)

    def has_turned(self, directory, grid, vector, pivot):
        """The facets that Python shows are where a rotation by a vector brings them."""
        facets = gravier.Run(directory).facets()
        angle = np.linalg.norm(vector)
        u = vector / angle
        cross = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        np.testing.assert_allclose(facets.corners, (quadrangles(grid) - pivot) @ turn.T + pivot, rtol=0, atol=1e-9)

    def test_period(self):
        """A floor as wide as the period has no seam: balls and cubes cross it as on a plane."""
        scene = {"scene": {"period": [1.2, 0.0, 0.0], "period_origin": [-0.6, 0.0, 0.0]}, "time": {"steps": 150}}
        for title, row in {"ball": self.ball([0.4, 0.0, RADIUS], [1.5, 0.0, 0.0]), "cube": body("cube", [0.4, 0.0, 0.05], velocity=[1.5, 0.1, 0.0])}.items():
            with self.subTest(title):
                wanted = self.play(f"{title} over a plane", 3, [row], [{"shape": "plane", "normal": [0.0, 0.0, 1.0]}], scene)
                found = self.play(f"{title} over a seam", 3, [row], [MESH], scene, mesh=floor(5, 0.6))
                self.same(wanted, found)
                self.assertTrue(np.any(found.all("bodies/image") != 0))

    def test_images_keep_their_springs(self):
        """A disk on the two ends of one facet, across a side of the cell: each end keeps its tangential spring, as where the facet lies in the
        middle of the cell, or is cut in two."""
        found = {}
        for title, lines, place in (("across", [(0.1, 0.9)], 0.0), ("cut", [(0.1, 0.5), (0.5, 0.9)], 0.0), ("within", [(-0.4, 0.4), (0.6, 1.4)], 0.5)):
            points = [x for line in lines for x in line]
            here = self.here(f"images {title}")
            os.makedirs(here)
            write(os.path.join(here, "wall.obj"), "".join(f"v {x} 0 0\n" for x in points)
                  + "".join(f"l {2 * k + 1} {2 * k + 2}\n" for k in range(len(lines))))
            write(os.path.join(here, "disk.csv"), f"id,shape,x,y,radius,material\n1,grain,{place},0.1733,0.2,1\n")
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "disk.csv", "density": 1000.0, "gravity": [0.0, -10.0],
                                      "wall_material": "m", "period": [1.0, 0.0] if title != "within" else [0.0, 0.0]},
                            "material": [{"name": "m"}],
                            "law": [{"materials": ["m"], "kind": "elastic", "friction": 0.5, "normal_stiffness": 1e5}],
                            "boundary": [{"shape": "mesh", "name": "wall", "file": "wall.obj", "material": "m"}],
                            "time": {"step": 5e-4, "steps": 600}, "solver": {"criterion": "residual", "tolerance": 1e-10},
                            "output": {"directory": "results", "every": 600}}, directory=here)
            self.assert_status(run, 0)
            bodies = run.results()
            found[title] = [bodies[f"/steps/600/bodies/{name}"][0, 1] for name in ("position", "velocity")]
        for title in ("cut", "within"):
            np.testing.assert_allclose(found["across"], found[title], rtol=1e-9, err_msg=title)

    def test_rest(self):
        """A heap of bodies at rest in a bowl of triangles starts its steps from the last ones: few iterations, one manifold at each place."""
        angle = 2.0 * np.pi * np.arange(25) / 24
        bowl = np.array([[[radius * np.cos(t), radius * np.sin(t), height] for t in angle]
                         for radius, height in ((0.02, 0.0), (0.15, 0.03), (0.3, 0.12), (0.4, 0.4))])
        rows = [self.ball([0.11 * i, 0.11 * j, 0.2 + 0.01 * i]) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        rows += [body("cube", [0.13 * i, 0.13 * j, 0.42], turn=[1.0, 0.2, 0.1 * i, 0.3]) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
        directory = prepare(self.here("bowl"), 3, rows)
        write(os.path.join(directory, "wall.stl"), stl_text(quadrangles(bowl)))
        case = shaped_case(3, [MESH], {"scene": {"friction": 0.5}, "time": {"step": 2e-3, "steps": 1000}, "output": {"every": 100}})
        run = run_case(case, 1, directory)
        self.assertIn(run.status, (0, 3), str(run))
        history = run.history()
        self.assertLess(np.median(history["iterations"][-100:]), 60)
        motion = Motion(run)
        self.assertGreater(motion.position[-1][:, 2].min(), 0.0)
        self.assertLess(np.abs(motion.velocity[-1][:, :3]).max(), 0.02)

    def test_cones(self):
        """A ball in the tip of a cone of 12 facets touches them all and stays on the axis. Of 100 facets 64 have a place: the log says so."""
        for sides, left_out in ((12, 0), (100, 36)):
            angle = 2.0 * np.pi * np.arange(sides + 1) / sides
            cone = np.array([[[0.2 * np.cos(a), 0.2 * np.sin(a), 0.2], [0.2 * np.cos(b), 0.2 * np.sin(b), 0.2], [0.0, 0.0, 0.0]]
                             for a, b in zip(angle[:-1], angle[1:])])
            directory = prepare(self.here(f"cone {sides}"), 3, [self.ball([0.0, 0.0, 1.001 * RADIUS * np.sqrt(1.0 + np.cos(np.pi / sides)**2)
                                                                          / np.cos(np.pi / sides)])])
            write(os.path.join(directory, "wall.stl"), stl_text(cone))
            # what is left out is left out in each step
            steps = 20 if left_out else 200
            case = shaped_case(3, [MESH], {"time": {"step": 1e-3, "steps": steps}, "output": {"every": steps}}, TIGHT)
            del case["scene"]["shapes"]
            run = run_case(case, 1, directory)
            self.assert_status(run, 0)
            motion = Motion(run)
            self.assertEqual(len(motion.contacts()), sides - left_out)
            self.assertEqual("in more points than are kept" in run.stdout, left_out > 0, run.stdout)
            if left_out:
                self.assertIn(f"at most {left_out} points of a step were left out", run.stdout)
            else:
                self.assertLess(np.abs(motion.velocity[-1][0, :2]).max(), 1e-9)

    def test_refused(self):
        """What no mesh can be is refused in one line with the file, before anything is computed."""
        rows = [self.ball([0.0, 0.0, RADIUS])]
        plain = stl_text(floor(1, 1.0))
        flat = stl_text(np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]]], dtype=float))
        for title, keys, text, wanted in (
                ("no file", {"file": "other.stl"}, plain, "boundary 'wall': file: other.stl"),
                ("no key", {"file": None}, plain, "file"),
                ("ending", {"file": "bodies.csv"}, plain, "expected a path that ends with .stl or .obj in 3D"),
                ("no area", {}, flat, "expected a facet with an area"),
                ("scale", {"scale": 0.0}, plain, "scale"),
                ("number", {}, plain.replace("vertex 1.0", "vertex one", 1), "\"one\", but a number was expected"),
                ("period", {}, stl_text(floor(1, 1.1)), "a width of at most the period"),
                ("plane", {"normal": [0.0, 0.0, 1.0]}, plain, "normal")):
            with self.subTest(title):
                directory = prepare(self.here(title), 3, rows)
                write(os.path.join(directory, "wall.stl"), text)
                wall = {key: value for key, value in {**MESH, **keys}.items() if value is not None}
                case = shaped_case(3, [wall], {"scene": {"period": [2.0, 0.0, 0.0]}} if title == "period" else {})
                del case["scene"]["shapes"]
                run = run_case(case, 1, directory, ["--check"])
                self.assert_status(run, 2)
                self.assertIn(wanted, run.stderr)
                self.assertEqual(len(run.stderr.strip().splitlines()), 1, run.stderr)

    def test_start_overlap(self):
        """A ball and a cube that lie in a wall at the start are refused."""
        for title, row in {"ball": self.ball([0.0, 0.0, 0.2 * RADIUS]), "cube": body("cube", [0.0, 0.0, 0.01])}.items():
            with self.subTest(title):
                directory = prepare(self.here(f"in the wall {title}"), 3, [row])
                write(os.path.join(directory, "wall.stl"), stl_text(floor(3, 1.0)))
                case = shaped_case(3, [MESH], {"scene": {"start_overlap": 0.1}})
                if title == "ball":
                    del case["scene"]["shapes"]
                run = run_case(case, 1, directory)
                self.assert_status(run, 2)
                self.assertIn("body 1 overlaps boundary 'wall'", run.stderr)


if __name__ == "__main__":
    unittest.main()
