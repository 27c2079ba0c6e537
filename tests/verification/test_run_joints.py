"""Walls made of several segments or rectangles: disks and spheres go over their joints as over one surface, and touch a joint once."""
import unittest

import numpy as np

from small_scenes import Grain, SmallScene

RADIUS, MASS, STEP = 0.01, 0.1, 1.0 / 1024
CORNERS = (-0.3, 0.0, 0.1, 0.2, 0.6)
PULL = 5.0


def floor(dimension, corners, **keys):
    """A level floor of as many boundaries as there are stretches between the corners."""
    pieces = []
    for first, last in zip(corners[:-1], corners[1:]):
        if dimension == 2:
            piece = {"shape": "segment", "point": [first, 0.0], "end": [last, 0.0]}
        else:
            piece = {"shape": "rectangle", "point": [first, -0.1, 0.0], "edge_a": [last - first, 0.0, 0.0], "edge_b": [0.0, 0.2, 0.0]}
        pieces.append({**piece, **keys})
    return pieces


def place(dimension, x, height):
    return [x, height] if dimension == 2 else [x, 0.01, height]


class Joints(SmallScene):
    step = STEP

    def test_sliding(self):
        """A grain without friction keeps its velocity over the joints of a floor, at any speed, from rectangles or segments to a mesh and back;
        it lost a quarter of its energy and hopped before."""
        def check(dimension):
            for speed in (1.0, 3.0, 6.0):
                velocity = np.zeros(dimension)
                velocity[0] = speed
                slides = [Grain(place(dimension, -0.1013, RADIUS), velocity, radius=RADIUS, mass=MASS)]
                mixed = floor(dimension, CORNERS)
                files = {}
                if dimension == 2:
                    files = {"line.csv": "x,y\n0.0,0.0\n0.05,0.0\n0.1,0.0\n"}
                    mixed[1] = {"shape": "mesh", "file": "line.csv"}
                for name, boundaries in (("pieces", floor(dimension, CORNERS)), ("backwards", floor(dimension, CORNERS)[::-1]), ("mixed", mixed)):
                    record = self.play(f"slides {dimension} {speed} {name}", slides, boundaries, -9.81 * np.eye(dimension)[-1],
                                       # to beyond the last joint
                                       int(0.33 / speed / STEP), files=files, output={"energy": True, "every": round(3 / speed) if speed < 2 else 1})
                    case = f"grain that slides over the joints of a floor, {dimension}D, {name}"
                    self.verify(case, "velocity [m/s]", record.velocity[1:, 0], velocity, 1e-10)
                    self.verify(case, "height [m]", record.position[:, 0, -1], RADIUS, 1e-12)
        self.both(check)

    def test_attractions(self):
        """At a joint and near it an attraction acts once: a grain that is pulled from the floor holds below its strength, leaves above it, and
        is not drawn to the joint. So it is where meshes meet, or a mesh and a segment."""
        files = {f"{name}.csv": "x,y\n" + "".join(f"{x},0.0\n" for x in corners) for name, corners in (("left", (-0.3, -0.05, 0.0)), ("right", (0.0, 0.05, 0.3)))}
        left, right = ({"shape": "mesh", "file": name} for name in files)

        def check(dimension):
            pieces = floor(dimension, (-0.3, 0.0, 0.3))
            floors = [(pieces, (-0.05, 0.0, 1.2e-8, -1.7e-8, 3e-8, 5e-6, 2e-3))]
            if dimension == 2:
                floors += [(walls, (0.0, 1.2e-8, 2e-3)) for walls in ([left, right], [left, pieces[1]], [pieces[0], right])]
            kinds = {"adhesive": {"adhesion": PULL, "adhesion_range": 5e-4}, "bonded": {"bond_strength": PULL, "bond_friction": 1.0, "bond_distance": 1e-4},
                     "capillary": {"capillarity": PULL / RADIUS, "decay_length": 1e-3, "debonding_distance": 5e-4}}
            for kind, keys in kinds.items():
                for number, (walls, x) in enumerate((walls, x) for walls, places in floors for x in places):
                    for share in (0.95, 1.05):
                        up = share * PULL / MASS * np.eye(dimension)[-1]
                        record = self.play(f"{kind} {dimension} {number} {share}", [Grain(place(dimension, x, RADIUS), radius=RADIUS, mass=MASS)], walls, up,
                                           60, files=files, scene={"wall_material": "a"}, material=[{"name": "a"}],
                                           law=[{"materials": ["a"], "kind": kind, **keys}], output={"every": 60})
                        way = record.position[-1, 0] - record.position[0, 0]
                        case = f"{kind}, {dimension}D, {x} m from a joint of {' and '.join(w['shape'] for w in walls)}, pulled with {share} of its strength"
                        self.assertLess(abs(way[0]), 2e-7, case)
                        if share < 1.0:
                            self.assertLess(way[-1], 1e-8, case)
                        else:
                            self.assertGreater(way[-1], 1e-3, case)
        self.both(check)

    def test_hollows_and_ridges(self):
        """A disk in a hollow of two segments touches both, on their ridge it touches one, whichever comes first; a law that leaves pairs out
        leaves the other segment as it is."""
        slope = np.array([0.1, 0.05])
        out = slope[::-1] * [-1.0, 1.0] / np.linalg.norm(slope)
        hollow = [{"shape": "segment", "point": [0.0, 0.0], "end": [side * 0.1, 0.05]} for side in (1, -1)]
        ridge = [{"shape": "segment", "point": [0.0, 0.0], "end": [side * 0.1, -0.05]} for side in (1, -1)]
        height = RADIUS / out[1]
        for name, boundaries, y, count in (("hollow", hollow, height, 2), ("ridge", ridge, RADIUS, 1), ("ridge, backwards", ridge[::-1], RADIUS, 1)):
            record = self.play(name, [Grain([0.0, y], radius=RADIUS, mass=MASS)], boundaries, (0.0, -9.81), 3,
                               output={"contacts": True})
            self.assertEqual(len(record.contacts[-1]["gap"]), count, name)
            self.verify(name, "place of the disk [m]", record.position[-1, 0], [0.0, y], 1e-9)
        # however shallow a hollow is, something holds what lies in it, beside a mesh, too; ends may be apart by rounding and more
        for angle in (1e-7, 5e-6, 5e-4, 1.9e-3, 0.01):
            for apart in (0.0, 1e-4 * RADIUS):
                ends = [[side * apart, 0.0] for side in (1, -1)]
                sides = [{"shape": "segment", "point": end, "end": [side * 0.1, 0.1 * np.tan(0.5 * angle)]} for side, end in zip((1, -1), ends)]
                line = f"x,y\n{-apart!r},0.0\n-0.1,{0.1 * np.tan(0.5 * angle)!r}\n"
                for name, boundaries in (("segments", sides), ("backwards", sides[::-1]), ("a mesh", [sides[0], {"shape": "mesh", "file": "line.csv"}])):
                    for x in (0.0, 2e-4 * RADIUS, -2e-4 * RADIUS):
                        held = self.play(f"hollow {angle} {apart} {name} {x}", [Grain([x, RADIUS / np.cos(0.5 * angle)], radius=RADIUS, mass=MASS)],
                                         boundaries, (0.0, -9.81), 40, files={"line.csv": line}, output={"every": 40},
                                         solver={"criterion": "velocity_error", "tolerance": 1e-2})
                        self.assertGreater(held.position[-1, 0, 1], 0.999 * RADIUS, f"{angle} {apart} {name} {x}")
        passes = [dict(ridge[0], material="air"), dict(ridge[1], material="stone")]
        record = self.play("left out", [Grain([0.0, RADIUS], radius=RADIUS, mass=MASS)], passes, (0.0, -9.81), 3,
                           material=[{"name": "grain"}, {"name": "air"}, {"name": "stone"}], law=[{"materials": ["grain", "air"], "kind": "none"}],
                           output={"contacts": True})
        self.assertEqual(len(record.contacts[-1]["gap"]), 1)
        self.verify("left out", "place of the disk [m]", record.position[-1, 0], [0.0, RADIUS], 1e-9)


if __name__ == "__main__":
    unittest.main()
