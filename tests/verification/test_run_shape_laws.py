"""Laws of contact and boundaries with shapes: rebounds, slopes, cohesion, bonds; segments, rectangles, drums, moving planes, glued bodies,
outlets, periods; piles that sleep."""
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, differences, gravier, merged, namelist, run_case, write
from shaped_scenes import body, lattice, prepare, shaped_case
from small_scenes import floats

G = 9.81
BLOCK = {2: "shape block\npolygon -0.1 -0.1  0.1 -0.1  0.1 0.1  -0.1 0.1\n", 3: "shape block\nbox 0.2 0.2 0.2\n"}
STILL = {2: 0.0, 3: [1.0, 0.0, 0.0, 0.0]}
EXACT = {"solver": {"method": "newton", "criterion": "residual", "tolerance": 1e-11, "max_iterations": 5000},
         "output": {"every": 1, "contacts": False}}


def up(dimension, height, along=0.0):
    return [along] + [0.0] * (dimension - 2) + [height]


def plane(dimension, height=0.0, **more):
    return {"shape": "plane", "point": up(dimension, height), "normal": up(dimension, 1.0), **more}


class ShapeLaws(RunTestCase):

    def play(self, title, dimension, rows, boundaries=(), *parts, ranks=1, library=None, status=0):
        directory = prepare(self.here(title), dimension, rows, library or BLOCK[dimension])
        run = run_case(shaped_case(dimension, boundaries, EXACT, *parts), ranks, directory)
        self.assert_status(run, status)
        return run

    def track(self, run, name="position", place=0):
        """Of a body, by its place in the order of identifiers, over all steps."""
        return np.array([values[place] for values in run.results().of_steps(f"bodies/{name}")])

    def test_bonded_blocks_turn(self):
        """Two bonded blocks, and two of which one is glued to a hub, turn as one body: 6 radians with 0.03 in a step. Blocks in space turn about
        an oblique axis, which precesses where nothing holds them. Their distance stays, and their spins agree."""
        for dimension in (2, 3):
            axis = np.array([0.0, 0.0, 1.0]) if dimension == 2 else np.array([1.0, 2.0, 2.0]) / 3.0
            rate, steps = 30.0, 200
            for held in (False, True):
                with self.subTest(dimension=dimension, held=held):
                    places = [np.array([-0.1, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])]
                    rows = [body("block", floats(place[:dimension]), STILL[dimension], floats(np.cross(rate * axis, place)[:dimension]),
                                 rate if dimension == 2 else floats(rate * axis), group=int(held and place[0] < 0.0)) for place in places]
                    hub = {"name": "hub", "shape": "grains", "group": 1, "material": "m", "rotation": [rate] if dimension == 2 else floats(rate * axis),
                           "pivot": [0.0, 0.0, 0.0]}
                    bond = {"materials": "m", "kind": "bonded", "bond_strength": 1e6, "bond_friction": 1.0, "bond_distance": 1e-4}
                    run = self.play(f"turning {dimension} {held}", dimension, rows, [hub] if held else [],
                                    {"scene": {"gravity": [0.0] * dimension}, "time": {"steps": steps, "step": 1e-3}, "material": [{"name": "m"}], "law": [bond]})
                    first, second = (self.track(run, place=place) for place in (0, 1))
                    np.testing.assert_allclose(np.linalg.norm(second - first, axis=1), 0.2, rtol=2e-5)
                    spins = [self.track(run, "velocity", place)[:, dimension:] for place in (0, 1)]
                    np.testing.assert_allclose(spins[0], spins[1], atol=1e-3 * rate)

    def test_bonded_capsules_turn(self):
        """Two capsules in one line, joined by a single bond at their ends, turn as one body: 6 radians with 0.03 in a step. Their ends stay together."""
        rate, steps = 30.0, 200
        rows = [body("rod", [x, 0.0], 0.0, [0.0, rate * x], rate) for x in (-0.08, 0.08)]
        bond = {"materials": "m", "kind": "bonded", "bond_strength": 1e6, "bond_friction": 1.0, "bond_distance": 1e-4}
        run = self.play("capsules", 2, rows, (), {"scene": {"gravity": [0.0, 0.0]}, "time": {"steps": steps, "step": 1e-3}, "material": [{"name": "m"}],
                                                  "law": [bond]}, library="shape rod\ncapsule -0.05 0 0.05 0 0.03\n")
        ends = []
        for place, side in ((0, 0.08), (1, -0.08)):
            turn = self.track(run, "orientation", place).reshape(-1)
            ends.append(self.track(run, place=place) + side * np.transpose([np.cos(turn), np.sin(turn)]))
        # orientations turn exactly and places by 2 atan(w h/2), which are 2e-6 rad apart in a step
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)
        np.testing.assert_allclose(self.track(run, "velocity", 1)[-1, 2], rate, rtol=1e-4)

    def test_bonded_blocks_in_rings_turn(self):
        """Six bonded squares and eight bonded cubes turn as one body by 0.1 rad in a step. Half-way through the step they overlap by more than
        their roundings and at their edges meet in points that are no bonds. Their energy and their distances stay, and solves take few iterations."""
        for dimension, counts in ((2, (3, 2)), (3, (2, 2, 2))):
            spin = 100.0 * (np.array([0.0, 0.0, 1.0]) if dimension == 2 else np.array([1.0, 2.0, 2.0]) / 3.0)
            places = [0.2 * (np.array([*place, 0.0][:3]) - (np.array([*counts, 1][:3]) - 1) / 2) for place in np.ndindex(*counts)]
            rows = [body("block", floats(place[:dimension]), STILL[dimension], floats(np.cross(spin, place)[:dimension]),
                         spin[2] if dimension == 2 else floats(spin)) for place in places]
            bond = {"materials": "m", "kind": "bonded", "bond_strength": 1e6, "bond_friction": 1.0, "bond_distance": 1e-3}
            for accuracy in (1e-1, 1e-3, 1e-6):
                with self.subTest(dimension=dimension, accuracy=accuracy):
                    run = self.play(f"ring {dimension} {accuracy}", dimension, rows, [],
                                    {"scene": {"gravity": [0.0] * dimension}, "time": {"steps": 60, "step": 1e-3}, "material": [{"name": "m"}], "law": [bond],
                                     "solver": {"method": "nlgs", "criterion": "velocity_error", "tolerance": None, "accuracy": accuracy}})
                    tracks = np.array([self.track(run, place=place) for place in range(len(places))])
                    ways = np.linalg.norm(tracks[:, None] - tracks[None], axis=3)
                    np.testing.assert_allclose(ways, np.broadcast_to(ways[:, :, :1], ways.shape), atol=2e-4)
                    history = run.history()
                    np.testing.assert_allclose(history["kinetic_energy"], history["kinetic_energy"][0], rtol=2e-4)
                    self.assertLess(np.mean(history["iterations"]), 20)

    def test_bonded_blocks_on_boundaries(self):
        """Blocks with strong bonds to a boundary stay where they are or go with it, at the default settings: a block that hangs on a wall, a block on a
        segment that turns, and a tower on a plate that swings, whose bonds would have to bear 753 N. A wall far away that moves changes nothing."""
        dimension = 2
        bond = {"materials": "m", "kind": "bonded", "bond_friction": 1.0, "bond_distance": 1e-4}
        far = {"shape": "segment", "point": [70.0, 0.0], "end": [70.0, 0.1], "velocity": [0.01, 0.0], "material": "m"}
        library = "shape block\npolygon -0.05 -0.05  0.05 -0.05  0.05 0.05  -0.05 0.05\n"

        def play(title, rows, boundaries, strength, steps, **scene):
            return self.play(title, dimension, rows, boundaries, {"scene": scene, "time": {"steps": steps, "step": 1e-3},
                                                                  "material": [{"name": "m", "density": 1000.0}], "law": [{**bond, "bond_strength": strength}], "output": {"every": steps},
                                                                  "solver": {"method": "nlgs", "criterion": None, "tolerance": None}}, library=library)

        wall = {"shape": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0], "material": "m"}
        for count, strength in ((1, 1e8), (3, 1e7), (3, 1e9)):
            for boundaries in ([wall], [wall, far]):
                with self.subTest("hangs", count=count, strength=strength, far=len(boundaries) > 1):
                    rows = [body("block", [0.05 + 0.1 * k, 0.0], 0.0) for k in range(count)]
                    run = play(f"hangs {count} {strength} {len(boundaries)}", rows, boundaries, strength, 500, gravity=[0.0, -G])
                    np.testing.assert_allclose(self.track(run, place=count - 1)[-1], [0.1 * count - 0.05, 0.0], atol=1e-4)
        for strength in (1e4, 1e6):
            with self.subTest("turns", strength=strength):
                hub = {"shape": "segment", "point": [0.05, -0.05], "end": [0.05, 0.05], "rotation": 5.0, "pivot": [0.0, 0.0], "material": "m"}
                run = play(f"turns {strength}", [body("block", [0.1, 0.0], 0.0, [0.0, 0.5], 5.0)], [hub], strength, 150, gravity=[0.0, 0.0])
                np.testing.assert_allclose(self.track(run)[-1], 0.1 * np.array([np.cos(0.75), np.sin(0.75)]), atol=1e-5)
        tower = [body("block", [0.0, 0.05 + 0.1 * k], 0.0) for k in range(3)]
        times = np.linspace(0.0, 0.401, 402)
        swing = [[float(time), float(np.sin(20.0 * time)), 0.0, 0.0] for time in times]
        for strength in (1200.0, 2000.0):
            with self.subTest("swings", strength=strength):
                title = f"swings {strength}"
                os.makedirs(self.here(title), exist_ok=True)
                write(f"{self.here(title)}/swing.csv", "time,vx,vy,omega\n" + "".join(",".join(map(repr, row)) + "\n" for row in swing))
                plate = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "table": "swing.csv", "material": "m"}
                run = play(title, tower, [plate], strength, 400, gravity=[0.0, -G])
                np.testing.assert_allclose(self.track(run, place=2)[-1], [(1.0 - np.cos(8.0)) / 20.0, 0.25], atol=1e-3)

    def test_stuck_to_boundaries_that_turn(self):
        """A block that sticks to a boundary by springs with an overlap, or by bonds over a gap, goes round with it about an axis in its surface and
        does not drift along it: both have their contact at one point. On a boundary at rest the moment takes what the block has not gained."""
        rate, half = 5.0, 0.1
        laws = {-1e-3: {"kind": "elastic", "normal_stiffness": 1e6, "pull_off_force": 1e3, "friction": 5.0, "spring_restitution": 0.3},
                2e-3: {"kind": "bonded", "bond_strength": 1e6, "bond_friction": 1.0, "bond_distance": 3e-3}}
        grounds = {"plane": plane, "segment": lambda _: {"shape": "segment", "point": [1.0, 0.0], "end": [-1.0, 0.0]},
                   "rectangle": lambda _: {"shape": "rectangle", "point": [-1.0, -1.0, 0.0], "edge_a": [2.0, 0.0, 0.0], "edge_b": [0.0, 2.0, 0.0]}}
        for dimension, gap, shape in ((2, -1e-3, "plane"), (2, 2e-3, "segment"), (3, -1e-3, "rectangle"), (3, 2e-3, "plane")):
            ground = {"name": "ground", **grounds[shape](dimension), "material": "m", "pivot": [0.0] * dimension}
            parts = {"material": [{"name": "m", "density": 1000.0}], "law": [{"materials": "m", **laws[gap]}]}, {"scene": {"alert_distance": 4e-3}}
            height = half + gap
            with self.subTest("turns", dimension=dimension, gap=gap, shape=shape):
                turning = {**ground, "rotation": [-rate] if dimension == 2 else [0.0, rate, 0.0]}
                start = body("block", up(dimension, height), STILL[dimension], up(dimension, 0.0, rate * height), turning["rotation"])
                # gravity would deform springs
                run = self.play(f"turning boundary {dimension} {gap} {shape}", dimension, [start], [turning], *parts,
                                {"scene": {"gravity": up(dimension, -G if gap > 0.0 else 0.0)}, "time": {"steps": 200}, "output": {"energy": True, "every": 200}})
                history = {name: np.array(floats(values)) for name, values in run.history().items() if "energy" in name or "dissipated" in name}
                scale = 1000.0 * (2.0 * half)**dimension * G * half
                self.assertLess(np.abs(history["energy_error"]).max(), 1e-10 * scale)
                self.assertLess(np.abs(history["dissipated_friction"]).max(), 1e-4 * scale)
                along = np.array(up(dimension, -np.sin(1.0), np.cos(1.0)))
                self.assertAlmostEqual(self.track(run)[-1] @ along, 0.0, delta=1e-5)
            with self.subTest("moment", dimension=dimension, gap=gap, shape=shape):
                run = self.play(f"moment {dimension} {gap} {shape}", dimension, [body("block", up(dimension, height), STILL[dimension])], [ground], *parts,
                                {"scene": {"gravity": up(dimension, 0.0, -G)}, "output": {"boundary_moments": True}, "time": {"steps": 50}})
                place, velocity = self.track(run), self.track(run, "velocity")
                mass = 1000.0 * (2.0 * half)**dimension
                spin = velocity[:, -1] if dimension == 2 else -velocity[:, -2]
                of_body = mass * (place[:, 0] * velocity[:, dimension - 1] - place[:, -1] * velocity[:, 0] + 4.0 * half**2 / 6.0 * spin)
                of_weight = mass * G * (place[1:, -1] + place[:-1, -1]) / 2.0
                moment = run.history()["moment_z:ground" if dimension == 2 else "moment_y:ground"]
                np.testing.assert_allclose(of_weight - np.diff(of_body) / 1e-3, np.array(floats(moment)) * (1 if dimension == 2 else -1),
                                           atol=1e-8 * mass * G)

    def test_flush_joints(self):
        """A block slides over the joint of two blocks side by side, loose on a plane or glued, of two segments or two rectangles: with or without
        friction it keeps the velocity that it has on one block, at any step."""
        for dimension in (2, 3):
            base = {2: "shape base\npolygon -0.5 -0.1  0.5 -0.1  0.5 0.1  -0.5 0.1\n", 3: "shape base\nbox 1.0 0.4 0.2\n"}[dimension]
            bases = [body("base", up(dimension, -0.1, x), STILL[dimension], scale=1.0) for x in (-0.5, 0.5)]
            if dimension == 2:
                sheets = [{"shape": "segment", "point": [x, 0.0], "end": [x + 1.0, 0.0]} for x in (-1.0, 0.0)]
            else:
                sheets = [{"shape": "rectangle", "point": [x, -0.5, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 1.0, 0.0]} for x in (-1.0, 0.0)]
            grounds = {"loose": (bases, [plane(dimension, -0.2)]), "glued": ([{**row, "group": 1} for row in bases], [{"shape": "grains", "group": 1}]),
                       "sheets": ([], sheets)}
            for name, (rows, walls) in grounds.items():
                for step, friction in ((1e-3, 0.3), (4e-4, 0.3), (1e-3, 0.0)):
                    with self.subTest(name, dimension=dimension, step=step, friction=friction):
                        slider = body("block", up(dimension, 0.1, -0.15), STILL[dimension], [2.0] + [0.0] * (dimension - 1), scale=1.0)
                        if name == "glued":
                            slider["group"] = 0
                        run = self.play(f"{name} {dimension} {step} {friction}", dimension, [slider, *rows], walls,
                                        {"scene": {"gravity": up(dimension, -G), "friction": friction}, "time": {"step": step, "steps": round(0.06 / step)}, "output": {"every": round(0.06 / step)}},
                                        library=BLOCK[dimension] + base)
                        velocity = self.track(run, "velocity")[-1]
                        np.testing.assert_allclose(velocity, [2.0 - 0.06 * friction * G] + [0.0] * (3 * dimension - 4), atol=2e-5)

    def test_joints_of_meshes(self):
        """A block, a capsule and a cluster of balls slide over the flush rim of a mesh, from another mesh, from a sheet, or within a mesh over a gap that
        its file has, and keep their velocity. They lost half of it. A step up stops a block."""
        balls = {2: "disk -0.15 0 0.1\ndisk 0.15 0 0.1\n", 3: "sphere -0.15 0 0 0.1\nsphere 0.15 0 0 0.1\n"}
        shapes = {"cluster": "shape cluster\n", "rod": "shape rod\n"}
        for dimension in (2, 3):
            files = {}
            for name, parts in (("one", [(-1.0, 0.0, 0.0)]), ("other", [(0.0, 1.0, 0.0)]), ("gap", [(-1.0, 0.0, 0.0), (2e-7, 1.0, 0.0)]),
                                ("step", [(-1.0, 0.0, 0.0), (0.0, 1.0, 0.02)])):
                files[name] = write(f"{self.scratch}/{name}{dimension}.obj", "".join(self.stretch(dimension, k, *part) for k, part in enumerate(parts)))
            mesh = {name: {"shape": "mesh", "file": path} for name, path in files.items()}
            sheet = {"shape": "segment", "point": [-1.0, 0.0], "end": [0.0, 0.0]} if dimension == 2 else \
                {"shape": "rectangle", "point": [-1.0, -0.5, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 1.0, 0.0]}
            library = BLOCK[dimension] + shapes["cluster"] + balls[dimension] + shapes["rod"] + \
                ("capsule -0.15 0 0.15 0 0.1\n" if dimension == 2 else "capsule -0.15 0 0 0.15 0 0 0.1\n")
            for shape, grounds in (("block", {"meshes": ["one", "other"], "sheet": [sheet, "other"], "gap": ["gap"], "step": ["step"]}),
                                   ("rod", {"meshes": ["one", "other"]}), ("cluster", {"meshes": ["one", "other"]})):
                for name, walls in grounds.items():
                    with self.subTest(shape, dimension=dimension, ground=name):
                        start = body(shape, up(dimension, 0.1, -0.25), STILL[dimension], [2.0] + [0.0] * (dimension - 1), scale=1.0)
                        run = self.play(f"{shape} {name} {dimension}", dimension, [start], [mesh.get(wall, wall) if isinstance(wall, str) else wall for wall in walls],
                                        {"scene": {"gravity": up(dimension, -G), "friction": 0.0}, "time": {"step": 1e-3, "steps": 150}, "output": {"every": 150}},
                                        library=library)
                        velocity = self.track(run, "velocity")[-1]
                        if name == "step":
                            self.assertLess(velocity[0], 1.5)
                        else:
                            np.testing.assert_allclose(velocity, [2.0] + [0.0] * (3 * dimension - 4), atol=2e-5)

    def test_a_gate_that_is_passed(self):
        """A plate lies tilted on the end of a wall, from which a gate goes on upwards that the plate passes through: it is held as if the gate were not
        there, by a mesh and by a segment, and with either as the gate."""
        line = {"wall": "v -1.0 0.0 0\nv 0.0 0.0 0\nl 1 2\n", "gate": "v 0.0 1.0 0\nv 0.0 0.0 0\nl 1 2\n"}
        mesh = {name: {"shape": "mesh", "file": write(f"{self.scratch}/{name}.obj", text), "material": name} for name, text in line.items()}
        segment = {"wall": {"shape": "segment", "point": [-1.0, 0.0], "end": [0.0, 0.0], "material": "wall"},
                   "gate": {"shape": "segment", "point": [0.0, 0.0], "end": [0.0, 1.0], "material": "gate"}}
        library = "shape plate\nrounding 0.015\npolygon -0.3 -0.02  0.3 -0.02  0.3 0.02  -0.3 0.02\n"
        laws = [{"materials": ["m", "gate"], "kind": "none"}, {"materials": ["m", "wall"], "kind": "coulomb", "friction": 1.0}]
        for wall in (mesh, segment):
            for gate in (mesh, segment):
                with self.subTest(wall=wall["wall"]["shape"], gate=gate["gate"]["shape"]):
                    directory = prepare(self.here(f"gate {wall['wall']['shape']} {gate['gate']['shape']}"), 2,
                                        [body("plate", [0.0, 0.02020041836800911], -0.1, material=1, scale=1.0)], library)
                    run = run_case(shaped_case(2, [wall["wall"], gate["gate"]], {
                        "scene": {"gravity": [0.0, -G]}, "material": [{"name": "m", "density": 1000.0}, {"name": "wall"}, {"name": "gate"}], "law": laws,
                        "time": {"step": 1e-3, "steps": 100}, "output": {"every": 100}}), 1, directory)
                    self.assert_status(run, 0)
                    self.assertLess(run.history()["max_overlap"].max(), 1e-7)

    @staticmethod
    def stretch(dimension, number, first, last, height):
        """A level stretch of an OBJ file, as the part of this number, from 0."""
        if dimension == 2:
            return f"v {first} {height} 0\nv {last} {height} 0\nl {2 * number + 1} {2 * number + 2}\n"
        corners = "".join(f"v {x} {y} {height}\n" for x, y in ((first, -0.5), (last, -0.5), (last, 0.5), (first, 0.5)))
        return corners + "f " + " ".join(str(4 * number + k) for k in (1, 2, 3, 4)) + "\n"

    def test_rebound(self):
        """A block that falls flat rebounds with e times its speed and without spin. One that falls on a corner keeps its angular momentum
        about that corner, and leaves with e times the speed of the corner."""
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                run = self.play(f"flat {dimension}", dimension, [body("block", up(dimension, 0.102), STILL[dimension], up(dimension, -1.0))],
                                [plane(dimension)], {"scene": {"restitution": 0.6, "gravity": [0.0] * dimension}, "time": {"steps": 10}})
                velocity = self.track(run, "velocity")[-1]
                np.testing.assert_allclose(velocity, up(dimension, 0.6) + [0.0] * (2 * dimension - 3), atol=1e-9)
                turn = 0.4 if dimension == 2 else [np.cos(0.2), np.sin(0.2) * 0.6, np.sin(0.2) * 0.8, 0.0]
                run = self.play(f"corner {dimension}", dimension, [body("block", up(dimension, 0.2), turn, up(dimension, -1.0), scale=1.0)],
                                [plane(dimension)], {"scene": {"restitution": 0.5, "gravity": [0.0] * dimension}, "time": {"steps": 120},
                                                     "output": {"contacts": True}})
                results, velocity = run.results(), self.track(run, "velocity")
                hit = next(step for step in range(1, 121) if f"/steps/{step}/contacts/impulse" in results
                           and np.any(results[f"/steps/{step}/contacts/impulse"] > 0.0))
                point = results[f"/steps/{hit}/contacts/point"][0]
                arm = point - (self.track(run)[hit - 1] + 0.5e-3 * velocity[hit - 1, :dimension])
                mass, inertia = results["/steps/0/bodies/mass"][0], results["/steps/0/bodies/mass"][0] * 0.2**2 / 6.0
                before, after = velocity[hit - 1], velocity[hit]
                impulse = mass * (after - before)[:dimension]
                np.testing.assert_allclose(impulse[:-1], 0.0, atol=1e-9 * mass)
                if dimension == 2:
                    self.assertAlmostEqual(inertia * (after - before)[2], arm[0] * impulse[1] - arm[1] * impulse[0], delta=1e-6 * mass)
                    speeds = [state[1] + state[2] * arm[0] for state in (before, after)]
                else:
                    np.testing.assert_allclose(inertia * (after - before)[3:], np.cross(arm, impulse), atol=1e-6 * mass)
                    speeds = [state[2] + np.cross(state[3:], arm)[2] for state in (before, after)]
                self.assertAlmostEqual(speeds[1], -0.5 * speeds[0], delta=1e-6)

    def test_clusters_on_springs(self):
        """A block of two pieces that falls on a plane of springs keeps its energy as a block of one piece does, while it leans to both sides:
        the seam is one spring at any lean. In space it is two of four."""
        library = {2: ("polygon -0.06 -0.03 0.06 -0.03 0.06 0.03 -0.06 0.03\n",
                       "polygon -0.06 -0.03 0 -0.03 0 0.03 -0.06 0.03\npolygon 0 -0.03 0.06 -0.03 0.06 0.03 0 0.03\n"),
                   3: ("box 0.12 0.06 0.06\n", "box 0.06 0.06 0.06 -0.03 0 0\nbox 0.06 0.06 0.06 0.03 0 0\n")}
        for dimension, shapes in library.items():
            for name, pieces in zip(("one", "two"), shapes):
                with self.subTest(dimension=dimension, pieces=name):
                    turn = 0.003 if dimension == 2 else [1.0, 0.0, -0.0015, 0.0]
                    directory = prepare(self.here(f"springs {dimension} {name}"), dimension, [body("s", up(dimension, 0.045), turn)],
                                        f"shape s\nrounding 0.003\n{pieces}")
                    law = {"materials": "m", "kind": "elastic", "friction": 0.0, "normal_stiffness": 1e6 if dimension == 2 else 6e4,
                           "spring_theta": 0.5}
                    case = shaped_case(dimension, [{**plane(dimension), "material": "m"}],
                                       {"scene": {"density": 1000.0, "friction": 0.0, "alert_distance": 0.01}, "material": [{"name": "m"}], "law": [law],
                                        "time": {"step": 5e-5, "steps": 8000}, "output": {"energy": True}})
                    run = run_case(case, 1, directory)
                    self.assert_status(run, 0)
                    history = run.history()
                    energy = history["kinetic_energy"] + history["potential_energy"] + history["elastic_energy"]
                    # the energy of the fall
                    scale = energy[0] * 0.015 / 0.045
                    self.assertGreater(history["elastic_energy"].max(), 0.5 * scale)
                    self.assertLess(np.abs(energy - energy[0]).max(), (5e-3 if dimension == 2 else 2e-2) * scale)

    def test_stress_between_walls(self):
        """The mean stress of a block on springs between a floor and a lid is that of the forces on them: overlaps take no part of the height."""
        for dimension, shape in ((2, "polygon -0.06 -0.03 0.06 -0.03 0.06 0.03 -0.06 0.03"), (3, "box 0.12 0.12 0.06")):
            directory = prepare(self.here(f"pressed {dimension}"), dimension, [body("s", up(dimension, 0.03)), body("s", up(dimension, 0.09))],
                                f"shape s\nrounding 0.003\n{shape}\n")
            law = {"materials": "m", "kind": "elastic", "friction": 0.3, "normal_stiffness": 1e5, "spring_restitution": 0.05}
            lid = {**plane(dimension), "name": "lid", "material": "m", "point": up(dimension, 0.12), "normal": up(dimension, -1.0), "free": [axis == dimension - 1 for axis in
                   range(dimension)], "mass": 5.0, "force": up(dimension, -200.0)}
            case = shaped_case(dimension, [{**plane(dimension), "material": "m"}, lid],
                               {"scene": {"density": 1000.0, "friction": 0.3}, "material": [{"name": "m"}], "law": [law], "solver": {"accuracy": 1e-6},
                                "time": {"step": 2e-4, "steps": 4000}, "output": {"every": 4000, "stress": True, "boundary_forces": True}})
            run = run_case(case, 1, directory)
            self.assert_status(run, 0)
            history, axis = run.history(), "xyz"[dimension - 1]
            bodies = run.results()["/steps/4000/bodies/position"][:, dimension - 1], run.results()["/steps/4000/bodies/mass"]
            height = history[f"position_{axis}:lid"][-1]
            # the lid is pressed in by overlaps of this part of the height
            self.assertGreater(0.12 - height, 1e-2 * height)
            moment = 200.0 * height + 9.81 * (bodies[0] * np.ravel(bodies[1])).sum()
            np.testing.assert_allclose(history[f"stress_{axis}{axis}"][-1] * history["volume"][-1], moment, rtol=1e-6)

    def test_slope(self):
        """A block on a slope sticks below the angle of friction, and slides as Coulomb has it above; materials have friction of their own."""
        slope, steps, h = 0.4, 50, 1e-3
        for dimension in (2, 3):
            gravity = up(dimension, -G * np.cos(slope), G * np.sin(slope))
            for friction in (0.8 * np.tan(slope), 1.2 * np.tan(slope)):
                for law in (False, True):
                    scene = {"scene": {"gravity": gravity, "friction": float(friction)}, "time": {"steps": steps, "step": h}, "output": {"every": 50}}
                    if law:
                        scene = merged(scene, {"scene": {"friction": 0.0, "wall_material": "rock"}, "material": [{"name": "rock"}],
                                               "law": [{"materials": "rock", "kind": "coulomb", "friction": float(friction)}]})
                    run = self.play(f"slope {dimension} {friction} {law}", dimension, [body("block", up(dimension, 0.1), STILL[dimension])],
                                    [plane(dimension)], scene)
                    speed = max(0.0, G * (np.sin(slope) - friction * np.cos(slope))) * steps * h
                    np.testing.assert_allclose(self.track(run, "velocity")[-1], up(dimension, 0.0, speed) + [0.0] * (2 * dimension - 3), atol=1e-7)

    def test_sent_back(self):
        """Tangential restitution sends the corner of a block back."""
        run = self.play("sent back", 2, [body("block", [0.0, 0.142], np.pi / 4, [1.0, -1.0])], [plane(2)], {
            "scene": {"restitution": 0.5, "tangential_restitution": 0.5, "friction": 10.0, "gravity": [0.0, 0.0]}, "time": {"steps": 10},
            "output": {"contacts": True}})
        velocity = self.track(run, "velocity")
        hit = int(np.argmax(np.abs(np.diff(velocity[:, 1])) > 0.1)) + 1
        point = run.results()[f"/steps/{hit}/contacts/point"][0]
        arm = point - (self.track(run)[hit - 1] + 0.5e-3 * velocity[hit - 1, :2])
        speeds = [np.array([v[0] - v[2] * arm[1], v[1] + v[2] * arm[0]]) for v in velocity[hit - 1:hit + 1]]
        np.testing.assert_allclose(speeds[1], -0.5 * speeds[0], atol=1e-6)

    def test_hanging(self):
        """A block hangs on another, which is glued, by cohesion or by a bond, through lists made anew and a restart; each point has a bond of
        its own. With less strength than its weight it falls."""
        for dimension in (2, 3):
            weight = 2500.0 * 0.2**dimension * G
            points = 2 if dimension == 2 else 4
            rows = [body("block", up(dimension, 0.3), STILL[dimension], group=1), body("block", up(dimension, 0.1), STILL[dimension], up(dimension, 0.5, 0.3), group=0)]
            roof = [{"shape": "grains", "group": 1, "velocity": up(dimension, 0.5, 0.3)}]
            for kind, part in (("adhesive", {"adhesion": 1.0, "adhesion_range": 1e-4}),
                               ("bonded", {"bond_strength": 1.0, "bond_friction": 0.5, "bond_distance": 1e-4})):
                for share in (1.3, 0.7):
                    law = {"materials": "rock", "kind": kind, "friction": 0.5, **part}
                    law["adhesion" if kind == "adhesive" else "bond_strength"] = share * weight / points
                    scene = {"scene": {"wall_material": "rock", "skin": 0.01}, "material": [{"name": "rock"}], "law": [law],
                             "time": {"steps": 60}, "output": {"checkpoint_every": 25, "every": 5}}
                    title = f"hanging {dimension} {kind} {share}"
                    run = self.play(title, dimension, rows, roof, scene)
                    lag = self.track(run)[-1, -1] - self.track(run, place=1)[-1, -1] - 0.2
                    if share < 1.0:
                        self.assertGreater(lag, 1e-3, title)
                        continue
                    self.assertLess(abs(lag), 1e-8, title)
                    self.assertGreater(run.history()["listed"].sum(), 1)
                    stopped = self.play(title + " stopped", dimension, rows, roof, merged(scene, {"time": {"steps": 25}}))
                    write(stopped.path("case.nml"), namelist(shaped_case(dimension, roof, EXACT, scene)))
                    again = gravier("--restart", "case.nml", ranks=2, directory=stopped.directory)
                    self.assert_status(again, 0)
                    self.assertEqual(differences({key: value for key, value in run.results().items() if "run@" not in key},
                                                 {key: value for key, value in again.results().items() if "run@" not in key}), [], title)

    def test_strength_of_a_joint(self):
        """A cube hangs on a wall by two bonds. Half of its weight is the least strength that holds its moment; 1.2 times as much, with a friction of
        0.6, is what holds it against sliding. It stands at 1.01 times the greater of both and falls at 0.98 times, whatever the method and the
        accuracy: plain sweeps and those of subdomains load one bond up to its limit and leave the other a reserve."""
        weight = 2500.0 * 0.04 * G
        wall = [{"shape": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0], "material": "m"}]
        solvers = [{}, {"accuracy": 1e-4}, {"acceleration": "none"}, {"method": "newton"}, {"method": "schwarz"}, {"method": "schwarz_ec"}, {"method": "nscdd"}]
        for friction in (1.1, 0.6):
            for number, solver in enumerate(solvers):
                for share in (1.01, 0.98):
                    with self.subTest(friction=friction, solver=solver, share=share):
                        directory = prepare(self.here(f"joint {friction} {number} {share}"), 2, [body("block", [0.1, 0.0], 0.0)], BLOCK[2])
                        bond = {"materials": "m", "kind": "bonded", "friction": 0.3, "bond_friction": friction, "bond_distance": 1e-4,
                                "bond_strength": share * weight * max(0.5, 0.5 / friction)}
                        run = run_case(shaped_case(2, wall, {"solver": solver, "material": [{"name": "m", "density": 2500.0}], "law": [bond],
                                                             "scene": {"gravity": [0.0, -G]}, "time": {"steps": 60, "step": 1e-3}, "output": {"every": 60}}), 1, directory)
                        self.assert_status(run, 0)
                        fall = -self.track(run)[-1, 1]
                        if share > 1.0:
                            self.assertLess(fall, 1e-5)
                        else:
                            self.assertGreater(fall, 2e-5)

    def test_clusters_on_each_other(self):
        """Two clusters of two disks, one on the other: their disks, which are the balls about the pieces, bear the upper one."""
        library = "shape pair\ndisk -0.1 0 0.1\ndisk 0.1 0 0.1\n"
        directory = prepare(self.here("pairs"), 2, [body("pair", [0.0, 0.1], 0.0), body("pair", [0.0, 0.3], 0.0)], library)
        run = run_case(shaped_case(2, [plane(2)], {"time": {"step": 1e-3, "steps": 50}, "output": {"every": 50}}), 1, directory)
        self.assert_status(run, 0)
        np.testing.assert_allclose(self.track(run, place=1)[-1], [0.0, 0.3], atol=1e-5)

    def test_thin_corners(self):
        """A triangle that falls about its thin tip lands on its side: its corners go into the ground by a step of their way, far less than
        the rounding, and in the plane as in space."""
        thin, leans = 0.1, 0.05
        points = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, np.tan(thin))])
        turned = np.array([[np.cos(leans), -np.sin(leans)], [np.sin(leans), np.cos(leans)]]) @ points.mean(axis=0) + [0.0, 1e-6]
        flat = "shape t\nrounding 0.001\npolygon " + " ".join(repr(float(x)) for x in points.ravel()) + "\n"
        solid = "shape t\nrounding 0.001\nhull " + " ".join(f"{float(x)!r} {y} {float(z)!r}" for y in (-0.5, 0.5) for x, z in points) + "\n"
        ends = {}
        for dimension, library, row in ((2, flat, body("t", floats(turned), leans)),
                                        (3, solid, body("t", floats([turned[0], 0.0, turned[1]]), floats([np.cos(leans / 2), 0.0, -np.sin(leans / 2), 0.0])))):
            directory = prepare(self.here(f"thin {dimension}"), dimension, [row], library)
            run = run_case(shaped_case(dimension, [plane(dimension)], {"scene": {"friction": 0.5, "density": 1000.0}, "solver": {"accuracy": 1e-5},
                                                                       "time": {"step": 2e-4, "steps": 750}, "output": {"every": 750}}), 1, directory)
            self.assert_status(run, 0)
            self.assertLess(run.history()["max_overlap"].max(), 0.05e-3)
            ends[dimension] = self.track(run)[-1]
        np.testing.assert_allclose(ends[2], ends[3][[0, 2]], atol=1e-6)

    def test_tiles_that_hang(self):
        """A tile thinner than the range of what holds it hangs on the four corners of its side, four times as strong as one: under a plane, a
        rectangle and in a cylinder, whose far corners are within the range too."""
        library = "shape tile\nrounding 0.0002\nbox 0.1 0.1 0.002\n"
        mass = 1000.0 * 0.1 * 0.1 * 0.002
        walls = {"plane": {"shape": "plane", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]},
                 "rectangle": {"shape": "rectangle", "point": [-1.0, -1.0, 0.0], "edge_a": [2.0, 0.0, 0.0], "edge_b": [0.0, 2.0, 0.0]},
                 "cylinder": {"shape": "cylinder", "point": [0.0, 0.0, 50.0], "axis": [0.0, 1.0, 0.0], "radius": 50.0}}
        laws = {"bonded": {"bond_strength": 1.0, "bond_distance": 3e-3, "bond_friction": 1.0}, "adhesive": {"adhesion": 1.0, "adhesion_range": 3e-3}}
        for name, wall in walls.items():
            for kind, keys in laws.items():
                for pull in (3.9, 4.1):
                    with self.subTest(wall=name, kind=kind, pull=pull):
                        directory = prepare(self.here(f"tile {name} {kind} {pull}"), 3, [body("tile", [0.0, 0.0, 0.001], STILL[3])], library)
                        run = run_case(shaped_case(3, [{**wall, "material": "m"}], {
                            "scene": {"gravity": [0.0, 0.0, pull / mass]}, "material": [{"name": "m", "density": 1000.0}],
                            "law": [{"materials": "m", "kind": kind, **keys}], "solver": {"accuracy": 1e-5},
                            "time": {"step": 1e-4, "steps": 20}, "output": {"every": 1}}), 1, directory)
                        self.assert_status(run, 0)
                        self.assertEqual(len(run.results()["/steps/1/contacts/impulse"]), 4)
                        speed = np.abs(self.track(run, "velocity")[-1]).max()
                        # what is not borne, 0.1 N of 4.1 at the start, moves it by 0.5 m/s2, faster with each bond that breaks
                        self.assertEqual(speed > 5e-4, pull > 4.0, speed)

    def test_strength_of_a_joint_that_turns(self):
        """The same cube at the height of the pivot about which the wall turns, but 1 m away: it pulls with its weight at the spin sqrt(g / 1 m)."""
        rate, steps = np.sqrt(G), 200
        wall = {"shape": "segment", "point": [0.0, -0.1], "end": [0.0, 0.1], "rotation": float(rate), "pivot": [0.1, 1.0], "material": "m"}
        for acceleration in ("momentum", "none"):
            for share in (1.01, 0.98):
                with self.subTest(acceleration=acceleration, share=share):
                    directory = prepare(self.here(f"turning joint {acceleration} {share}"), 2, [body("block", [0.1, 0.0], 0.0, [float(rate), 0.0], float(rate))], BLOCK[2])
                    bond = {"materials": "m", "kind": "bonded", "friction": 0.3, "bond_friction": 1.1, "bond_distance": 1e-4,
                            "bond_strength": share * 0.5 * 2500.0 * 0.04 * G}
                    run = run_case(shaped_case(2, [wall], {"solver": {"accuracy": 1e-4, "acceleration": acceleration}, "material": [{"name": "m", "density": 2500.0}],
                                                           "law": [bond], "scene": {"gravity": [0.0, 0.0]}, "time": {"steps": steps, "step": 1e-3}, "output": {"every": steps}}),
                                   1, directory)
                    self.assert_status(run, 0)
                    way = rate * 1e-3 * steps
                    apart = np.linalg.norm(self.track(run)[-1] - np.array([0.1 + np.sin(way), 1.0 - np.cos(way)]))
                    if share > 1.0:
                        self.assertLess(apart, 1e-5)
                    else:
                        self.assertGreater(apart, 1e-3)

    def test_equal_faces_that_attract(self):
        """Three equal cubes hang in a row on a wall and bear a fifth of what their bonds or their cohesion do, at default settings. What solves
        leave of velocities shifts and turns their faces a little against each other: they stay joined in four points each, at which their
        attractions act. Faces that differ by rounding alone had up to eight points, bonds were lost, and the row fell."""
        rows = [body("block", [0.05 + 0.1 * k, 0.0, 0.0], STILL[3], mass=1.0) for k in range(3)]
        wall = [{"shape": "plane", "point": [0.0, 0.0, 0.0], "normal": [1.0, 0.0, 0.0], "material": "m"}]
        for kind, keys in (("bonded", {"bond_strength": 75.0, "bond_friction": 5.0, "bond_distance": 1e-5}), ("adhesive", {"adhesion": 75.0, "adhesion_range": 1e-3})):
            with self.subTest(kind):
                directory = prepare(self.here(f"equal faces {kind}"), 3, rows, "shape block\nrounding 0.002\nbox 0.1 0.1 0.1\n")
                run = run_case(shaped_case(3, wall, {"material": [{"name": "m"}], "law": [{"materials": "m", "kind": kind, "friction": 0.3, **keys}],
                                                     "scene": {"gravity": [20.0, 0.0, 0.0]}, "time": {"steps": 800, "step": 1e-3}, "output": {"every": 800}}), 1, directory)
                self.assert_status(run, 0)
                self.assertEqual(set(run.history()["contacts"]), {12.0})
                np.testing.assert_allclose(self.track(run, place=2)[-1], [0.25, 0.0, 0.0], atol=1e-4)

    def test_equal_faces_on_springs(self):
        """A cube that is turned by 0.0005 to 0.005 rad about the vertical on an equal one stands on four springs, as if it were not turned."""
        for turn in (0.0, 5e-4, 5e-3):
            with self.subTest(turn=turn):
                rows = [body("block", [0.0, 0.0, 0.05], STILL[3], mass=1.0), body("block", [0.0, 0.0, 0.15], [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)], mass=1.0)]
                directory = prepare(self.here(f"twist {turn}"), 3, rows, "shape block\nrounding 0.002\nbox 0.1 0.1 0.1\n")
                law = {"materials": "m", "kind": "elastic", "friction": 0.5, "normal_stiffness": 1e5, "spring_restitution": 0.1}
                run = run_case(shaped_case(3, [{**plane(3), "material": "m"}], {"material": [{"name": "m"}], "law": [law], "solver": {"accuracy": 1e-4}, "output": {"every": 600},
                                                                                 "time": {"steps": 600, "step": 5e-4}}), 1, directory)
                self.assert_status(run, 0)
                np.testing.assert_allclose([self.track(run, place=k)[-1, 2] for k in (0, 1)], [0.05 - 2 * G / 4e5, 0.15 - 3 * G / 4e5], atol=2e-7)

    def test_stiffness_along_the_ground(self):
        """A prism of 16 sides and a cube stand on springs and are pulled along the ground by a load that rises slowly, at default settings. Nothing
        slides: they move by the shear of the springs and by that of rocking on them, along the load alone."""
        circle = [(0.5 * np.cos(np.pi * k / 8), 0.5 * np.sin(np.pi * k / 8)) for k in range(16)]
        prism = "hull " + " ".join(f"{float(x)!r} {float(y)!r} {z!r}" for z in (-0.5, 0.5) for x, y in circle)
        for name, text in (("prism", prism), ("cube", "box 1 1 1")):
            with self.subTest(name):
                n, k, weight, pull = 16 if name == "prism" else 4, 1e5, 10.0, 1.0
                library = f"shape block\nrounding 0.01\n{text}\n"
                directory = prepare(self.here(f"pulled {name}"), 3, [body("block", [0.0, 0.0, 0.5 - weight / (n * k)], STILL[3], mass=1.0)], library)
                write(f"{directory}/load.csv", f"time,gx,gy,gz\n0,0,0,{-weight}\n0.1,0,0,{-weight}\n1.1,{pull},0,{-weight}\n2,{pull},0,{-weight}\n")
                law = {"materials": "m", "kind": "elastic", "friction": 2.0, "normal_stiffness": k, "stiffness_ratio": 0.3, "spring_restitution": 0.1, "tangential_damping": 1.0}
                run = run_case(shaped_case(3, [{**plane(3), "material": "m"}], {"scene": {"gravity_table": "load.csv"}, "material": [{"name": "m"}], "law": [law],
                                                                                 "time": {"steps": 1400, "step": 1e-3}, "output": {"every": 1400, "contacts": True}}), 1, directory)
                self.assert_status(run, 0)
                along = run.results()["/steps/1400/contacts/point"][:, 0]
                self.assertEqual(len(along), n)
                place = self.track(run)[-1]
                exact = pull / (0.3 * n * k) + 0.25 * pull / (k * ((along - place[0]) ** 2).sum())
                np.testing.assert_allclose(place[:2] / exact, [1.0, 0.0], atol=2e-3)

    def test_edges(self):
        """Blocks on both sides of a segment or a rectangle, across its end, and under its corner, rest or pass; one that lies beyond it falls."""
        for dimension in (2, 3):
            sheet = {"shape": "segment", "point": [-0.5, 0.0], "end": [0.5, 0.0]} if dimension == 2 else {
                "shape": "rectangle", "point": [-0.5, -0.5, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 1.0, 0.0]}
            for sign in (1.0, -1.0):
                # on it, half across the end with its weight inside, half across with its weight outside, beyond
                places = [up(dimension, 0.1 * sign, x) for x in (0.0, 0.45, -0.55, 0.75)]
                run = self.play(f"edges {dimension} {sign}", dimension, [body("block", place, STILL[dimension]) for place in places], [sheet], {
                    "scene": {"gravity": up(dimension, -G * sign), "friction": 0.3}, "time": {"steps": 100}, "output": {"every": 50}})
                fall = [sign * (self.track(run, place=k)[-1, -1] - places[k][-1]) for k in range(4)]
                spin = np.abs(self.track(run, "velocity", 2)[-1, dimension:]).max()
                np.testing.assert_allclose(fall[:2], 0.0, atol=1e-8)
                self.assertGreater(spin, 0.3)
                self.assertTrue(-0.045 < fall[2] < -0.005, fall)
                self.assertAlmostEqual(fall[3], -0.5 * G * 0.1**2, delta=2e-3)

    def test_glued(self):
        """Glued bodies turn with their boundary, whose orientation and place are those of a rigid motion; what lies on a turning table of
        glued blocks turns with it."""
        rate, steps, h = 2.0, 200, 1e-3
        for dimension in (2, 3):
            spin = [rate] if dimension == 2 else [0.0, 0.0, rate]
            place = np.array([0.3, 0.0] + [0.0] * (dimension - 2))
            rows = [body("block", place.tolist(), STILL[dimension], group=1)]
            if dimension == 3:
                rows.append(body("block", [0.3, 0.0, 0.2], STILL[dimension], [0.0, 0.6, 0.0], [0.0, 0.0, rate], group=0, scale=0.5))
                rows[1]["z"] = 0.1 + 0.05
                rows[1].update(scale=0.5 * np.sqrt(0.03))
            table = [{"shape": "grains", "group": 1, "rotation": spin, "pivot": [0.0] * dimension, "velocity": [0.1] + [0.0] * (dimension - 1)}]
            run = self.play(f"glued {dimension}", dimension, rows, table, {"scene": {"friction": 0.9, "gravity": [0.0, 0.0, -G][:dimension] if
                            dimension == 3 else [0.0, 0.0]}, "time": {"steps": steps, "step": h}, "output": {"every": 50}})
            angle = rate * steps * h
            # the pivot moves with the boundary
            there = np.array([0.1 * steps * h + 0.3 * np.cos(angle), 0.3 * np.sin(angle)] + [0.0] * (dimension - 2))
            np.testing.assert_allclose(self.track(run)[-1], there, atol=1e-6)
            turned = self.track(run, "orientation")[-1]
            expected = [angle] if dimension == 2 else [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]
            np.testing.assert_allclose(turned, expected, atol=1e-9)
            if dimension == 3:
                carried = self.track(run, "velocity", 1)[-1]
                self.assertAlmostEqual(carried[5], rate, delta=1e-3)

    def test_moving_planes(self):
        """A plane that rises carries a block, a lid with a mass falls on it, and a periodic cell carries it round."""
        for dimension in (2, 3):
            floor = plane(dimension, velocity=up(dimension, 0.2, 0.5))
            run = self.play(f"lift {dimension}", dimension, [body("block", up(dimension, 0.1, 0.6), STILL[dimension])], [floor], {
                "scene": {"friction": 0.5, "period": [0.85] + [0.0] * (dimension - 1)}, "time": {"steps": 800}, "output": {"every": 100}})
            np.testing.assert_allclose(self.track(run, "velocity")[-1], up(dimension, 0.2, 0.5) + [0.0] * (2 * dimension - 3), atol=1e-7)
            self.assertEqual(run.results()["/steps/800/bodies/image"][0, 0], 1)
            lid = plane(dimension, 0.25, mass=2.0, free=[False] * (dimension - 1) + [True], force=up(dimension, -2.0 * G))
            lid["normal"] = up(dimension, -1.0)
            run = self.play(f"lid {dimension}", dimension, [body("block", up(dimension, 0.1), STILL[dimension])], [plane(dimension), lid], {
                "scene": {"friction": 0.5}, "time": {"steps": 200}, "output": {"every": 100}, "solver": {"tolerance": 1e-9}})
            force = run.results()["/steps/200/boundaries/force"]
            weight = 2500.0 * 0.2**dimension * G
            np.testing.assert_allclose(force[:, -1], [-weight - 2.0 * G, 2.0 * G], rtol=1e-6)
            self.assertAlmostEqual(run.results()["/steps/200/boundaries/position"][1, -1], 0.2, delta=1e-2)

    def test_outlet(self):
        """Bodies that fall through an outlet leave, on 1 and 3 ranks alike."""
        for dimension in (2, 3):
            rows = lattice((3, 2) if dimension == 2 else (2, 2, 2), spacing=0.2, height=0.5)
            outlet = {"shape": "outlet", "point": up(dimension, 0.0), "normal": up(dimension, 1.0)}
            for ranks in (1, 3):
                directory = prepare(self.here(f"outlet {dimension} {ranks}"), dimension, rows)
                run = run_case(shaped_case(dimension, [outlet], {"time": {"steps": 300, "step": 2e-3}, "solver": {"method": "nscdd"},
                                                                 "decomposition": {"subdomains": 3}, "output": {"energy": True}}), ranks, directory)
                self.assert_status(run, 0)
                self.assertEqual(run.history()["left"].sum(), len(rows))
                self.assertLess(abs(run.history()["energy_error"][-1]), 1e-10 * run.history()["load_work"][-1])

    def test_sleeping(self):
        """A stack of blocks falls asleep, stays where it is without sleep, and wakes where a disk strikes it."""
        for dimension in (2, 3):
            rows = [body("block", up(dimension, 0.2 * k + 0.1), STILL[dimension]) for k in range(3)]
            rows.append(body("grain", up(dimension, 3.0, 0.155), radius=0.08))
            lazy = {"sleeping": True, "sleep_after": 8, "criterion": "residual", "tolerance": 1e-6, "method": "nscdd", "sleep_speed": 1e-2}
            runs = [self.play(f"asleep {dimension} {sleeping}", dimension, rows, [plane(dimension)], {
                "scene": {"friction": 0.4}, "time": {"steps": 380, "step": 2e-3}, "output": {"every": 10},
                "solver": merged({"solver": lazy}, {"solver": {"sleeping": sleeping}})["solver"]}) for sleeping in (True, False)]
            sleeping = runs[0].history()["sleeping"]
            # all of the points, of 2 or 4 each; the disk strikes in step 344
            self.assertEqual(sleeping[300], 3 * (2 if dimension == 2 else 4))
            self.assertEqual(sleeping[344:].min(), 0)
            before = [self.track(run, "position", 2)[30] for run in runs]
            np.testing.assert_allclose(before[0], before[1], atol=1e-6)
            moved = [np.abs(self.track(run, "position", 2)[-1] - before[0]).max() for run in runs]
            self.assertGreater(min(moved), 1e-4)
            self.assertAlmostEqual(moved[0] / moved[1], 1.0, delta=0.05)

    def test_rolling_refused(self):
        for part in ({"scene": {"friction": 0.3, "rolling_friction": 0.1}, "boundary": [plane(2)]},
                     {"scene": {"friction": 0.3, "wall_material": "rock"}, "material": [{"name": "rock"}],
                      "law": [{"materials": "rock", "kind": "coulomb", "friction": 0.3}], "boundary": [plane(2, rolling_friction=0.1)]}):
            run = self.play(f"rolling {len(part)}", 2, [body("block", [0.0, 0.1], 0.0)], (), merged(part, {"solver": {"method": "nlgs"}}), status=2)
            self.assertEqual(run.stderr.count("\n"), 1)
            self.assertIn("rolling or pivoting friction: expected 0 where bodies have shapes", run.stderr)


if __name__ == "__main__":
    unittest.main()
