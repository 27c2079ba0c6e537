"""Measures of states: mixing, heaps and tests between walls, of states whose values are known, with single grains astray, and of runs."""
import os
import re
import sys
import unittest

import matplotlib
import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, run_case, write
import gravier
from gravier.histories import History
from gravier.linked_grains import components, near_pairs
from gravier.mixing import lacey, split_radius
from gravier.wall_tests import sine_of_means

matplotlib.use("Agg")
sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
from curve_pictures import draw_history  # noqa: E402
from measure_pictures import draw_measured  # noqa: E402

R = 0.01


class States(gravier.Run):
    """States of grains as a run has them: positions, and radii R unless told."""

    def __init__(self, *states, radius=None, period=None, walls=()):
        self.path, self.dimension = "states", len(states[0][0])
        self.period = np.zeros(self.dimension) if period is None else np.array(period)
        self.steps, self.times = np.arange(len(states)), 0.1 * np.arange(len(states))
        self.case, self.walls = {"material": [{"name": "sand"}, {"name": "steel"}], "boundary": [{"name": "gate", "remove_at": 0.1}]}, walls
        self.states = [gravier.Table(id=np.arange(1, len(state) + 1), position=np.array(state, dtype=float),
                                     radius=np.full(len(state), R) if radius is None else np.resize(radius, len(state))) for state in states]

    def bodies(self, step=None):
        return self.states[-1 if step is None else step]

    def shapes(self):
        return []

    def boundaries(self, step=None):
        names, places, normals = zip(*self.walls) if self.walls else ((), (), ())
        return gravier.Table(name=np.array(names), shape=np.full(len(names), "plane"), position=np.array(places), normal=np.array(normals))


def grid(*counts):
    """Centres of touching grains on a square lattice in the corner of the axes, the last axis the slowest."""
    return R * (2.0 * np.stack(np.meshgrid(*(np.arange(count) for count in counts[::-1]), indexing="ij"), axis=-1).reshape(-1, len(counts))[:, ::-1] + 1.0)


class Mixing(unittest.TestCase):

    def test_separate_and_mixed(self):
        """Lacey's index of cells that hold one kind each is 0, of equal shares above 1 by what chance lacks, of random places 1 in the mean."""
        number = np.repeat(np.arange(20), 25)
        self.assertAlmostEqual(lacey(number, number < 7), 0.0, places=12)
        even = np.arange(500) % 5 < 2
        self.assertAlmostEqual(lacey(number, even), 1.0 / (1.0 - 19.0 / 499.0), places=12)
        # kinds dealt out at random, also where cells have 1 to 60 grains; 400 trials know the mean to a twentieth of their deviation
        rng = np.random.default_rng(7)
        for cells in (number, np.repeat(np.arange(20), np.linspace(1, 60, 20).astype(int))):
            found = [lacey(cells, rng.permutation(np.arange(len(cells)) % 5 < 2)) for _ in range(400)]
            self.assertAlmostEqual(np.mean(found), 1.0, delta=4.0 * np.std(found) / 20.0)
            self.assertLess(np.std(found), 0.05)
        self.assertTrue(np.isnan(lacey(np.zeros(9, int), np.arange(9) < 4)))
        self.assertTrue(np.isnan(lacey(np.arange(9), np.arange(9) < 4)))

    def test_halves_of_a_bed(self):
        """The upper half of a bed is told by its places in the first state, and ends below; the heights are those of the halves."""
        bed = grid(20, 20)
        mirrored = bed * [1.0, -1.0] + [0.0, 40.0 * R]
        mixed = bed[np.random.default_rng(3).permutation(400)]
        table = gravier.mixing(States(bed, mirrored, mixed), by="y", cell=10.0 * R)
        np.testing.assert_allclose(table.segregation[:2], [1.0, -1.0], rtol=1e-12)
        np.testing.assert_allclose(table.height_difference[:2], [20.0 * R, -20.0 * R], rtol=1e-12)
        self.assertLess(abs(table.segregation[2]), 0.2)
        np.testing.assert_array_equal([table.share, table.grains, table.cells], [[0.5] * 3, [400] * 3, [16] * 3])
        np.testing.assert_allclose(table.mixing[:2], 0.0, atol=1e-12)
        self.assertGreater(table.mixing[2], 0.9)
        self.assertEqual(len(gravier.mixing(States(bed, mirrored, mixed), by="y", since=0.15)), 1)
        fed = States(bed, mirrored)
        fed.case = {**fed.case, "insertion": [{}]}
        np.testing.assert_allclose(gravier.mixing(fed, by="y").segregation, [1.0, -1.0], rtol=1e-12, err_msg="a case in which grains could enter, but did not")
        fed.states.insert(0, gravier.Table({name: values[:-2] for name, values in fed.states[0].items()}))
        fed.steps, fed.times = np.arange(3), 0.1 * np.arange(3)
        with self.assertRaisesRegex(gravier.ResultsError, "grain 399 has entered after the first state, of step 0, and has no place y in it; expected mixing by size or material, or a time"):
            gravier.mixing(fed, by="y")
        self.assertEqual(len(gravier.mixing(fed, by="y", since=0.05)), 2)

    def test_sizes_and_materials(self):
        """Large grains under small ones have -1, by volume; the same kinds by material."""
        radius = np.array([2.0 * R] * 50 + [R] * 200)
        place = np.concatenate([2.0 * grid(10, 5), grid(20, 10) + [0.0, 20.0 * R]])
        run = States(place, radius=radius)
        table = gravier.mixing(run)
        self.assertAlmostEqual(table.segregation[0], -1.0, places=12)
        self.assertAlmostEqual(table.height_difference[0], -20.0 * R, places=12)
        self.assertEqual(table.share[0], 0.2)
        run.states[0]["material"] = np.where(radius > R, 2, 1)
        for value in (None, 2, "2", "steel"):
            self.assertEqual(gravier.mixing(run, by="material", value=value).segregation[0], table.segregation[0])
        self.assertAlmostEqual(gravier.mixing(run, by="material", value="sand").segregation[0], 1.0, places=12)

    def test_one_range_of_sizes(self):
        """The radius that divides sizes is known, and so is whether it divides two kinds or one range."""
        bed = grid(20, 20)
        for radius, value, known in ((np.linspace(1.0, 2.0, 400), None, (1.5, True)), (np.linspace(1.0, 2.0, 400), 1.2, (1.2, True)),
                                     (np.repeat([1.0, 2.0], 200), None, (1.5, False)), (np.concatenate([np.linspace(1.0, 1.2, 200), np.linspace(1.8, 2.0, 200)]), None, (1.5, False)),
                                     (np.repeat([1.0, 1.5, 2.0], [100, 100, 200]), None, (1.5, False)), (np.ones(400), 5.0, (5.0, False))):
            self.assertEqual(split_radius(States(bed, radius=radius), value), known)

    def test_stray_grain(self):
        """One grain of 400 that flies away changes nothing that matters."""
        bed = grid(20, 20)
        away = np.concatenate([bed[:-1], [[3.0, 50.0]]])
        table = gravier.mixing(States(bed, away), by="y", cell=10.0 * R)
        self.assertAlmostEqual(table.segregation[1], 1.0, delta=0.01)
        self.assertAlmostEqual(table.height_difference[1], 20.0 * R, delta=0.1 * R)
        self.assertAlmostEqual(table.mixing[1], 0.0, delta=0.01)

    def test_refusals(self):
        run = States(grid(4, 4))
        run.states[0]["material"] = np.ones(16, dtype=int)
        for words, options in (("states: all grains have radii of 0.01 m; expected two sizes or places, or another of --by size, material, x, y$", {}), ("by 'q': expected one of size, material, x, y", {"by": "q"}),
                               ("each written state are of one kind, and have radii of 0.01 to 0.01 m; expected a value that divides them, and not 0.5$", {"value": 0.5}),
                               ("each written state are of one kind, and began at y = 0.01 to 0.07 m; expected a value that divides them, and not 3$", {"by": "y", "value": 3}),
                               ("each written state are of one kind, of the materials sand; expected grains of material steel and others together$", {"by": "material"}),
                               ("material 'gold'; expected one of sand, steel", {"by": "material", "value": "gold"}),
                               ("cell -1: expected a length above 0", {"by": "x", "cell": -1}), ("x 'a': expected a number", {"by": "x", "value": "a"}),
                               ("no written state from 3 s on; expected a time of at most 0 s", {"by": "x", "since": 3.0})):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.mixing(run, **options)
        run.case = {"material": [{"name": "sand"}]}
        with self.assertRaisesRegex(gravier.ResultsError, "mixing by material of a case whose only material is sand; expected a second &material, or mixing by size or by x, y, where"):
            gravier.mixing(run, by="material")


def wedge(degrees, half, dimension=2):
    """Grains of a lattice below the flanks of a wedge, or of a cone, of a slope and half a width."""
    high = half * np.tan(np.radians(degrees))
    count, rows = int(half / R) + 2, int(high / (2.0 * R)) + 2
    place = grid(*([2 * count] * (dimension - 1)), rows) - np.append(np.full(dimension - 1, 2.0 * count * R), 0.0)
    out = np.abs(place[:, 0]) if dimension == 2 else np.linalg.norm(place[:, :-1], axis=1)
    return place[place[:, -1] + R < high * (1.0 - out / half) + R]


#: far along the floor, thrown up, fallen under the floor, and in flight over a flank
ASTRAY = [[90.0, R], [0.0, 7.0], [0.3, -4.0], [0.25, 0.6]]


class Heaps(unittest.TestCase):

    def test_wedge(self):
        """Height, fronts and slopes of wedges, whatever their place, with and without grains that have gone astray."""
        for degrees in (15.0, 30.0, 44.0):
            with self.subTest(degrees=degrees):
                place = wedge(degrees, 1.0)
                found = gravier.heap(States(place, place + [0.37, 0.0], np.concatenate([place, ASTRAY])))
                high = place[:, 1].max() + R
                np.testing.assert_allclose(found.height, high, rtol=1e-12)
                # the last columns of a lattice are no full row beside each other
                last = np.abs(place[:, 0]).max() + R
                np.testing.assert_allclose(found.front_high - [0.0, 0.37, 0.0], last, atol=2.0 * R)
                np.testing.assert_allclose(found.front_low - [0.0, 0.37, 0.0], -last, atol=2.0 * R)
                np.testing.assert_allclose(found.length, found.front_high - found.front_low, rtol=1e-12)
                self.assertLess(np.abs(found.run_out).max(), 2.0 * R)
                # steps of a lattice, a diameter high in flanks of 13 rows and more
                np.testing.assert_allclose(np.concatenate([found.angle_low, found.angle_high]), degrees, atol=1.5)
                for name in found:
                    if name not in ("step", "time"):
                        self.assertAlmostEqual(found[name][2], found[name][0], delta=2.0 * R if "front" in name or name == "length" else 0.5, msg=name)

    def test_column_that_collapses(self):
        """A column has its width, no slopes, and no run-out; a wedge against a wall has one front, and the run-out of its length."""
        column, place = grid(20, 60), wedge(25.0, 1.2)
        found = gravier.heap(States(column, place[place[:, 0] > 0.0]))
        np.testing.assert_allclose([found.height[0], found.front_low[0], found.front_high[0]], [120.0 * R, 0.0, 40.0 * R], atol=0.21 * R)
        self.assertTrue(np.isnan([found.angle_low[0], found.angle_high[0], found.angle_low[1]]).all())
        self.assertAlmostEqual(found.run_out[1], 1.2 / 0.4 - 1.0, delta=0.15)
        self.assertAlmostEqual(found.angle_high[1], 25.0, delta=1.5)
        self.assertEqual(found.run_out[0], 0.0)
        later = gravier.heap(States(column, place[place[:, 0] > 0.0]), since=0.1)
        np.testing.assert_array_equal([later.step, later.run_out], [[1], [0.0]])

    def test_two_slopes(self):
        """Flanks of two slopes are told apart, and shares of the height choose the part of a flank."""
        left, right = wedge(20.0, 1.5), wedge(35.0, 1.5 * np.tan(np.radians(20.0)) / np.tan(np.radians(35.0)))
        place = np.concatenate([left[left[:, 0] < 0.0], right[right[:, 0] > 0.0]])
        found = gravier.heap(States(place))
        self.assertAlmostEqual(found.angle_low[0], 20.0, delta=1.0)
        self.assertAlmostEqual(found.angle_high[0], 35.0, delta=1.5)
        # a steep top upon a flat foot
        high = 1.5 * np.tan(np.radians(20.0))
        bent = left[(left[:, 1] < 0.5 * high) | (np.abs(left[:, 0]) < (high - left[:, 1]) / np.tan(np.radians(40.0)))]
        foot, top = gravier.heap(States(bent), shares=(0.1, 0.4)), gravier.heap(States(bent), shares=(0.55, 0.9))
        self.assertAlmostEqual(foot.angle_high[0], 20.0, delta=2.5)
        self.assertAlmostEqual(top.angle_high[0], 40.0, delta=4.0)

    def test_space(self):
        """A cone, and a wedge in a channel that is periodic across; single grains far away change nothing."""
        cone = wedge(30.0, 0.5, 3) + [0.11, -0.07, 0.0]
        found = gravier.heap(States(cone, np.concatenate([cone, [[70.0, 3.0, R], [0.0, 0.0, 9.0]]])))
        self.assertNotIn("front_low", found)
        np.testing.assert_allclose(found.angle, 30.0, atol=1.5)
        np.testing.assert_allclose(found.length, 0.5, atol=4.0 * R)
        np.testing.assert_allclose(found.height, cone[:, 2].max() + R, rtol=1e-12)
        flat = wedge(25.0, 0.6)
        for period in (None, [0.0, 8.0 * R, 0.0]):
            channel = np.concatenate([np.insert(flat, 1, y, axis=1) for y in R * (2.0 * np.arange(4) + 1.0)])
            found = gravier.heap(States(channel, period=period), along="x")
            np.testing.assert_allclose([found.angle_low[0], found.angle_high[0]], 25.0, atol=1.5)
            np.testing.assert_allclose([-found.front_low[0], found.front_high[0]], np.abs(flat[:, 0]).max(), atol=3.0 * R)

    def test_thin_front(self):
        """Below the foot of a wedge a row of grains with holes of 0.4 diameters belongs to the heap, and what lies 0.6 diameters away does not: neither the end
        of the heap nor its run-out depends on the width of columns."""
        place, radius = wedge(25.0, 1.2), 1.3 * R
        foot = place[:, 0].max()
        row = np.stack([foot + 2.8 * R * np.arange(1, 21), np.full(20, R)], axis=1)
        beyond = [[row[-1, 0] + 3.2 * R + 2.0 * R * k, R] for k in range(5)]
        run = States(grid(20, 60), np.concatenate([place[place[:, 0] > 0.0], row, beyond, ASTRAY]))
        for width in (0.5 * R, 2.0 * R, 4.0 * R, 8.0 * R):
            found = gravier.heap(run, width=width)
            np.testing.assert_allclose(found.front_high, [40.0 * R, row[-1, 0] + R], rtol=1e-12)
            self.assertAlmostEqual(found.run_out[1], found.length[1] / (40.0 * R) - 1.0, places=12)
        # of two sizes the gap is that of surfaces
        run = States(np.array([[radius, radius], [2.0 * radius + R, R], [2.0 * radius + 4.0 * R, R], [2.0 * radius + 7.5 * R, R]]), radius=[radius, R, R, R])
        self.assertAlmostEqual(gravier.heap(run).front_high[0], 2.0 * radius + 5.0 * R, places=12)

    def test_near_pairs(self):
        """Pairs of balls of many sizes within a gap, and what hangs together by them, are those of all pairs, in the plane and in space, with one ball far away."""
        rng = np.random.default_rng(5)
        for dimension, spread, gap in ((2, 0.0, 0.0), (2, 3.0, 0.01), (3, 0.5, 0.02), (3, 3.0, 0.0)):
            place, radius = rng.uniform(0.0, 1.0, (200, dimension)), 0.01 * np.exp(rng.uniform(0.0, spread, 200))
            place[7] = 1e9
            away = np.linalg.norm(place[:, None] - place[None], axis=2) - radius[:, None] - radius[None]
            known = (away <= gap) & ~np.eye(200, dtype=bool)
            found = np.zeros_like(known)
            i, j = near_pairs(place, radius, gap)
            found[i, j] = found[j, i] = True
            np.testing.assert_array_equal(found, known)
            reach = known | np.eye(200, dtype=bool)
            for _ in range(8):
                reach = reach.astype(float) @ reach > 0.0
            np.testing.assert_array_equal(components(200, i, j), reach.argmax(axis=1))

    def test_rods(self):
        """Rods that lie end to end hang together, though balls of their volume are far apart."""
        run = States(R * np.stack([1.0 + 2.2 * np.arange(10), np.ones(10)], axis=1))
        run.volumes = lambda bodies: 0.2 * np.pi * bodies.radius**2
        found = gravier.heap(run)
        self.assertAlmostEqual(found.front_high[0], (1.0 + 2.2 * 9 + np.sqrt(0.2)) * R, places=12)

    def test_end_across(self):
        """In space the end is a mean over the breadth of a channel, or over the rim of a round heap; grains hang together across a period too."""
        bed = grid(10, 20, 2)
        bed = bed[(bed[:, 0] < 10.0 * R) | (bed[:, 1] < 20.0 * R)]
        self.assertAlmostEqual(gravier.heap(States(bed), along="x").front_high[0], 15.0 * R, delta=R)
        # a row along y that only its image across the period links to the bed
        row = np.array([[20.0 * R + 0.01 * R, 39.99 * R + 2.5 * R, R], [22.0 * R, 39.99 * R + 2.5 * R, R]])
        for period, end in (([0.0, 42.5 * R, 0.0], 23.0 * R), (None, 20.0 * R)):
            found = gravier.heap(States(np.concatenate([grid(10, 20, 1), row]), period=period), along="x")
            self.assertLessEqual(found.front_high[0], end)
            self.assertEqual(found.front_high[0] > 20.0 * R, period is not None)
        disk = grid(60, 60, 1)
        disk = disk[np.hypot(disk[:, 0] - 60.0 * R, disk[:, 1] - 60.0 * R) < 40.0 * R]
        spoke = np.array([[100.0 * R + 2.0 * R * k, 60.0 * R, R] for k in range(1, 16)])
        round_one = gravier.heap(States(disk, np.concatenate([disk, spoke])))
        self.assertAlmostEqual(round_one.length[0], 40.0 * R, delta=1.5 * R)
        self.assertLess(round_one.length[1] - round_one.length[0], 2.0 * R)

    def test_channels_are_not_round(self):
        """A heap that fills a period, or the breadth between two walls, along one axis is refused as round; one in the middle of them is not, nor is a bed
        that fills both, or one beside a gate that is removed."""
        flat = wedge(25.0, 0.6)
        channel = np.concatenate([np.insert(flat, 1, y, axis=1) for y in R * (2.0 * np.arange(4) + 1.0)])
        cone = wedge(30.0, 0.5, 3)
        sides = [("a", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]), ("b", [0.0, 8.0 * R, 0.0], [0.0, -1.0, 0.0])]
        for run, words in ((States(channel, period=[0.0, 8.0 * R, 0.0]), "the period along y, so that the heap is not round; expected --along x"),
                           (States(channel, walls=sides), "the breadth between two walls along y, .* expected --along x"),
                           (States(channel[:, [1, 0, 2]], period=[8.0 * R, 0.0, 0.0]), "the period along x, .* expected --along y"),
                           (States(cone, channel, period=[0.0, 8.0 * R, 0.0]), "expected --along x")):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.heap(run)
        for run in (States(cone, period=[0.0, 4.0, 0.0]), States(grid(4, 4, 2), period=[8.0 * R, 8.0 * R, 0.0]), States(channel, walls=sides[:1]),
                    States(channel, walls=[sides[0], ("gate", *sides[1][1:])])):
            self.assertIn("angle", gravier.heap(run))

    def test_refusals(self):
        run = States(grid(3, 3))
        with self.assertRaisesRegex(gravier.ResultsError, r"floor 5: above all grains of all states; expected the height of the floor"):
            gravier.heap(run, floor=5.0)
        for words, options in (("along 'y': expected x", {"along": "y"}), ("shares 0.8 and 0.2", {"shares": (0.8, 0.2)}), ("width 0: expected", {"width": 0.0})):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.heap(run, **options)
        empty = States(grid(1, 1))
        empty.states[0] = gravier.Table({name: values[:0] for name, values in empty.states[0].items()})
        with self.assertRaisesRegex(gravier.ResultsError, "no written state has grains"):
            gravier.heap(empty)


class Sheared(States):
    """A periodic cell with a grain, whose stress turns from step to step."""

    directory = "states"

    def __init__(self, principal, angles):
        """Principal stresses, and the angles by which their axes are turned in the plane of x and the last axis."""
        super().__init__(np.full((1, len(principal)), 1.0), period=np.full(len(principal), 1.0))
        axes, last = "xyz"[:len(principal)], len(principal) - 1
        columns = {"step": np.arange(1.0, len(angles) + 1), "time": 0.1 * np.arange(1, len(angles) + 1), "grains": np.ones(len(angles))}
        turn = np.array([np.eye(len(principal))] * len(angles))
        turn[:, 0, 0] = turn[:, last, last] = np.cos(angles)
        turn[:, 0, last], turn[:, last, 0] = -np.sin(angles), np.sin(angles)
        stress = turn @ np.diag(principal) @ turn.transpose(0, 2, 1)
        columns.update({f"stress_{a}{b}": stress[:, i, j] for i, a in enumerate(axes) for j, b in enumerate(axes)})
        self.columns = columns

    def history(self):
        return History(self.columns)


class WallTests(RunTestCase):

    def squeezed(self, name, dimension=2, boundaries=None, more=None, steps=20, law=None):
        """A grain between planes that forces press together, or those that are given."""
        os.makedirs(self.here(name))
        axes = "xyz"[:dimension]
        write(self.here(name, "one.csv"), f"id,radius,mass,{','.join(axes)}\n1,{R},1.0,{','.join([str(R)] * dimension)}\n")
        unit = np.eye(dimension)
        planes = [{"name": f"low {axis}", "shape": "plane", "normal": list(unit[k])} for k, axis in enumerate(axes)]
        planes += boundaries or [{"name": f"high {axis}", "shape": "plane", "point": list(2.0 * R * unit[k]), "normal": list(-unit[k]),
                                  "free": [bool(entry) for entry in unit[k]], "pressure": pressure, "mass": 1.0}
                                 for k, (axis, pressure) in enumerate(zip(axes, (1000.0, 2000.0, 3000.0)))]
        output = {"directory": ".", "every": 1000, "boundary_forces": True, **(more or {})}
        laws = {"material": {"name": "sand"}, "law": {"materials": "sand", **law}} if law else {}
        scene = {"dimension": dimension, "gravity": [0.0] * 3, "bodies": "file", "bodies_file": "one.csv", **({"wall_material": "sand"} if law else {})}
        run = run_case({"scene": scene, **laws, "boundary": planes,
                        "time": {"step": 1e-3, "steps": steps}, "solver": {"accuracy": 1e-6}, "output": output}, 1, self.here(name))
        self.assert_status(run, 0)
        return gravier.Run(self.here(name))

    def test_strength(self):
        """A disk under 1000 N/m across and 2000 N/m from above has a ratio of 2 and sin phi = 1/3, a sphere that under 3000 Pa ratios of 2 and 3;
        stresses are those of the walls and, where they are asked for, of the contacts."""
        for stress in (False, True):
            found = gravier.wall_test(self.squeezed(f"disk {stress}", more={"stress": stress}), mean=5)
            self.assertEqual(list(found), ["step", "time", "axial_strain", "lateral_strain_x", "volumetric_strain", "void_ratio", "solid_fraction", "axial_stress",
                                           "lateral_stress", "stress_ratio", "sin_phi"])
            np.testing.assert_allclose(found.step, [3.0, 8.0, 13.0, 18.0])
            for name, value in (("axial_stress", 2000.0), ("lateral_stress", 1000.0), ("stress_ratio", 2.0), ("sin_phi", 1.0 / 3.0), ("solid_fraction", np.pi / 4.0),
                                ("void_ratio", 4.0 / np.pi - 1.0)):
                np.testing.assert_allclose(found[name][-1], value, rtol=1e-6, err_msg=name)
        run = self.squeezed("sphere", 3)
        for options, ratio in (({}, 2.0), ({"lateral": "x"}, 3.0), ({"lateral": ["y"]}, 1.5), ({"axial": "x"}, 0.4)):
            self.assertAlmostEqual(gravier.wall_test(run, **options).stress_ratio[-1], ratio, places=6)
        self.assertAlmostEqual(gravier.wall_test(run).solid_fraction[-1], np.pi / 6.0, places=6)

    def test_principal_stresses(self):
        """sin phi is that of the principal stresses, whatever their axes; of means it is that of the mean stresses."""
        for principal in ((300.0, 100.0), (300.0, 250.0, 100.0), (100.0, 150.0, 300.0)):
            angles = np.radians([0.0, 20.0, 45.0, 90.0, 45.0, 45.0])
            run = Sheared(principal, angles)
            found = gravier.wall_test(run)
            np.testing.assert_allclose(found.sin_phi, 0.5, rtol=1e-12)
            # along the axes there is nothing to see at 45 degrees
            np.testing.assert_allclose(found.axial_stress[2], 200.0)
            # turned by 45 and 90 degrees: 2 cos 45 degrees of shear and difference are left of 2
            self.assertAlmostEqual(gravier.wall_test(run, mean=2).sin_phi[1], 0.5 * np.sqrt(0.5), places=12)
            self.assertAlmostEqual(sine_of_means(run, (None, None, 1), 2), gravier.wall_test(run, mean=4, since=0.25).sin_phi[0], places=12)
            self.assertAlmostEqual(sine_of_means(run, (None, None, 2), 1), gravier.wall_test(run, mean=4, since=0.25).sin_phi[0], places=12)
            self.assertAlmostEqual(sine_of_means(run, (None, None, 1), 0), gravier.wall_test(run, mean=6).sin_phi[0], places=12)

    def test_way_through_air(self):
        """A lid that is 0.8 radii above the grain and comes down at 0.1 m/s bears nothing for 80 steps of 1 ms; the command says when and how much strain this is."""
        walls = [{"name": "side", "shape": "plane", "point": [2.0 * R, 0.0], "normal": [-1.0, 0.0]},
                 {"name": "lid", "shape": "plane", "point": [0.0, 2.8 * R], "normal": [0.0, -1.0], "velocity": [0.0, -0.1]}]
        self.squeezed("air", boundaries=walls, more={"stress": True}, steps=81, law={"kind": "elastic", "normal_stiffness": 1e6})
        measured = script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), "walls", "air", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((measured.returncode, measured.stderr), (0, ""))
        found = re.search(r"\nlid bears nothing before (\S+) s, and strains count (\S+) for its way until then; --since \1 leaves it out\n", measured.stdout)
        self.assertTrue(found, measured.stdout)
        # the floor, which does not move, bears nothing either
        self.assertEqual(measured.stdout.count("bears nothing"), 1)
        self.assertAlmostEqual(float(found[1]), 0.08, delta=0.0015)
        self.assertAlmostEqual(float(found[2]), 0.1 * 0.079 / (2.8 * R), delta=0.006)
        later = script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), "walls", "air", "--since", found[1], directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual(later.returncode, 0, later.stderr)
        self.assertNotIn("bears nothing", later.stdout)

    def test_strains(self):
        """A lid that comes down at 0.1 m/s and a side that goes out at 0.05 m/s: strains are those of their ways since the end of a step; old walls that
        are removed at once do not count."""
        sides = [{"name": "side", "shape": "plane", "point": [8.0 * R, 0.0], "normal": [-1.0, 0.0], "velocity": [0.05, 0.0]},
                 {"name": "lid, of steel", "shape": "plane", "point": [0.0, 8.0 * R], "normal": [0.0, -1.0], "velocity": [0.0, -0.1]},
                 {"name": "old", "shape": "plane", "point": [0.0, 9.0 * R], "normal": [0.0, -1.0], "remove_at": 0.0}]
        run = self.squeezed("strains", boundaries=sides)
        for since, first in ((0.0, 1), (0.0095, 10)):
            found = gravier.wall_test(run, since=since)
            time = 1e-3 * np.arange(first, 21)
            wide, high = 8.0 * R + 0.05 * time, 8.0 * R - 0.1 * time
            np.testing.assert_allclose(found.time, time, rtol=1e-9)
            np.testing.assert_allclose(found.axial_strain, 1.0 - high / high[0], atol=1e-12)
            np.testing.assert_allclose(found.lateral_strain_x, 1.0 - wide / wide[0], atol=1e-12)
            np.testing.assert_allclose(found.volumetric_strain, 1.0 - wide * high / (wide * high)[0], atol=1e-12)
            np.testing.assert_allclose(found.void_ratio, wide * high / (np.pi * R**2) - 1.0, rtol=1e-12)
        for words, options in (("20 steps after 0 s; expected 30", {"mean": 30}), ("axial 'z'", {"axial": "z"}), ("lateral 'y'", {"lateral": "y"}),
                               ("0 steps after 9 s", {"since": 9.0})):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.wall_test(run, **options)
        thin = self.squeezed("thin", boundaries=sides, more={"history_every": 7})
        whole, found = (gravier.wall_test(one) for one in (run, thin))
        self.assertEqual(found.step.tolist(), [1, 7, 14, 20])
        for name in ("axial_strain", "lateral_strain_x", "volumetric_strain"):
            np.testing.assert_array_equal(found[name], whole[name][found.step.astype(int) - 1])
        np.testing.assert_array_equal(gravier.wall_test(thin, since=0.0065).step, [7, 14, 20])
        with self.assertRaisesRegex(gravier.ResultsError, r"thin/history.csv: no row and no written state of step 10, the first one after 0.0095 s, to "
                                    r"which strains refer; expected a time before a step that has one, such as 0.0065 s, before step 7$"):
            gravier.wall_test(thin, since=0.0095)
        with self.assertRaisesRegex(gravier.ResultsError, r"no column position_x:low x; &output boundary_forces"):
            gravier.wall_test(self.squeezed("no forces", more={"boundary_forces": False}))
        sides[2].pop("remove_at")
        with self.assertRaisesRegex(gravier.ResultsError, r"2 planes on the side \+y: lid_ of steel, old; expected one on each side"):
            gravier.wall_test(self.squeezed("two lids", boundaries=sides))

    def test_periodic(self):
        """A cell that is periodic across: its size is the period, and stresses need those of the contacts."""
        os.makedirs(self.here("cell"))
        write(self.here("cell", "one.csv"), f"id,radius,mass,x,y\n1,{R},1.0,{R},{R}\n")
        case = {"scene": {"dimension": 2, "gravity": [0.0, 0.0], "bodies": "file", "bodies_file": "one.csv", "period": [5.0 * R, 0.0], "alert_distance": 0.1 * R, "skin": 0.1 * R},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
                             {"name": "lid", "shape": "plane", "point": [0.0, 2.0 * R], "normal": [0.0, -1.0], "free": [False, True], "pressure": 50.0, "mass": 1.0}],
                "time": {"step": 1e-3, "steps": 10}, "solver": {"accuracy": 1e-6}, "output": {"directory": ".", "boundary_forces": True}}
        self.assert_status(run_case(case, 1, self.here("cell")), 0)
        with self.assertRaisesRegex(gravier.ResultsError, "no column stress_xx, which a periodic axis needs"):
            gravier.wall_test(gravier.Run(self.here("cell")))
        case["output"]["stress"] = True
        self.assert_status(run_case(case, 1, self.here("cell")), 0)
        found = gravier.wall_test(gravier.Run(self.here("cell")))
        self.assertAlmostEqual(found.axial_stress[-1], 50.0, places=5)
        self.assertAlmostEqual(found.solid_fraction[-1], np.pi / 10.0, places=6)
        self.assertAlmostEqual(found.lateral_stress[-1], 0.0, places=9)


class Command(RunTestCase):

    @classmethod
    def setUpClass(cls):
        """A column of disks of two sizes, of which the large ones lie below, collapses when a gate is taken away."""
        super().setUpClass()
        cls.directory = cls.here(cls, "run")
        os.makedirs(cls.directory)
        place = np.concatenate([1.4 * grid(4, 3), grid(5, 15) * [1.1, 1.0] + [0.0, 8.6 * R]])
        radius = np.array([1.4 * R] * 12 + [R] * 75)
        rows = "".join(f"{k + 1},{x!r},{y!r},{r!r}\n" for k, ((x, y), r) in enumerate(zip(place.tolist(), radius.tolist())))
        write(os.path.join(cls.directory, "column.csv"), "id,x,y,radius\n" + rows)
        case = {"scene": {"dimension": 2, "bodies": "file", "bodies_file": "column.csv", "friction": 0.5, "wall_friction": 0.5, "density": 2500.0, "alert_distance": 0.002},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}, {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
                             {"name": "gate", "shape": "plane", "point": [11.3 * R, 0.0], "normal": [-1.0, 0.0], "remove_at": 0.05}],
                "time": {"step": 1e-3, "steps": 800}, "output": {"directory": "results", "every": 50, "contacts": False}}
        run = run_case(case, 1, cls.directory)
        assert run.status == 0, run

    def measure(self, *arguments):
        return script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), *arguments, directory=self.directory, environment=ENVIRONMENT)

    def test_collapse(self):
        """The table of the command has what the function returns; the column spreads to more than twice its width and half of its height, and small grains stay above
        large ones and mix with them."""
        done = self.measure("heap", "results", "--since", "0.05")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"^last row: time 0\.8 s, height 0\.\d+ m, front low .*, run out \d.*\nresults/heap\.csv\n$")
        found, known = (gravier.read_table(os.path.join(self.directory, "results/heap.csv")),
                        gravier.heap(gravier.Run(os.path.join(self.directory, "results")), since=0.05))
        self.assertEqual(list(found), [*known, "run_checksum"])
        for name in known:
            np.testing.assert_allclose(found[name], known[name], rtol=1e-8)
        self.assertEqual(found.step.tolist(), list(range(50, 801, 50)))
        self.assertAlmostEqual(found.length[0], 11.3 * R, delta=1.5 * R)
        self.assertGreater(found.run_out[-1], 1.2)
        self.assertLess(found.height[-1], 0.6 * found.height[0])
        self.assertTrue(5.0 < found.angle_high[-1] < 40.0, found.angle_high[-1])
        done = self.measure("mixing", "results", "--cell", "0.05", "--out", "sizes.csv")
        self.assertEqual((done.returncode, done.stdout.splitlines()[1:]), (0, ["the first kind has radii above 0.012 m", "sizes.csv"]), done.stderr)
        sizes = gravier.read_table(os.path.join(self.directory, "sizes.csv"))
        np.testing.assert_allclose(sizes.share, 12 / 87)
        self.assertAlmostEqual(sizes.segregation[0], -1.0, places=6)
        self.assertTrue(np.all(sizes.segregation < -0.2) and sizes.mixing[0] < 0.4)

    def test_outflow(self):
        """Disks that fall one after the other through an outlet: numbers and masses add up, rates are those of a row, and what left before does not count."""
        case = {"scene": {"bodies": "file", "bodies_file": "column.csv", "density": 2500.0},
                "boundary": [{"name": "out", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.0, 1.0]}], "time": {"step": 1e-3, "steps": 400},
                "output": {"directory": "out", "every": 0}}
        radius = 0.01 + 0.001 * np.arange(10)
        write(self.here("column.csv"), "id,x,y,radius\n" + "".join(f"{k + 1},0.0,{0.0495 * (k + 1)},{radius[k]}\n" for k in range(10)))
        self.assert_status(run_case(case, 1, self.scratch), 0)
        run, mass = gravier.Run(self.here("out")), 2500.0 * np.pi * radius**2
        # a disk is behind the outlet in the middle of the step in which it leaves
        step = np.ceil(np.sqrt(2.0 * 0.0495 * np.arange(1, 11) / 9.81) / 1e-3 + 0.5)
        for mean, since in ((1, 0.0), (50, 0.0), (70, 0.1505), (150, 0.0)):
            found = gravier.outflow(run, mean, since)
            first = np.floor(since / 1e-3)
            ends = first + mean * np.arange(1, (400 - first) // mean + 1)
            np.testing.assert_array_equal(found.step, ends)
            np.testing.assert_allclose(found.time, 1e-3 * ends, rtol=1e-12)
            number = np.array([((step > first) & (step <= end)).sum() for end in ends])
            total = np.array([mass[(step > first) & (step <= end)].sum() for end in ends])
            self.assertLessEqual(np.abs(found.total_left - number).max(), int(mean == 1), "a disk that is at the outlet within rounding may leave a step later")
            if mean > 1:
                np.testing.assert_allclose(found.total_left_mass, total, rtol=1e-12)
                np.testing.assert_allclose(found.mass_rate, np.diff(total, prepend=0.0) / (mean * 1e-3), rtol=1e-12)
                np.testing.assert_allclose(found.number_rate, np.diff(number, prepend=0) / (mean * 1e-3), rtol=1e-12)
        self.assertEqual(gravier.outflow(run, 400).total_left[-1], 10)
        # names of earlier versions are refused with the new ones
        for name in ("left", "left_mass"):
            words = f"column {name} of an outflow is now total_{name}; {name} is that of single steps, in history.csv"
            with self.assertRaisesRegex(AttributeError, words):
                getattr(gravier.outflow(run, 400), name)
            with self.assertRaisesRegex(KeyError, words):
                gravier.outflow(run, 400)[name]
        for options, words in (({"mean": 0}, "mean 0: expected a whole number of steps above 0"), ({"mean": 401}, "400 steps after 0 s; expected 401 at least"),
                               ({"since": 0.4}, "0 steps after 0.4 s; expected 1 at least")):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.outflow(run, **options)
        done = script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), "outflow", "out", "--mean", "400", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout, f"last row: time 0.4 s, total left 10 grains, total left mass {mass.sum():.4g} kg, number rate 25 1/s, mass rate "
                                      f"{mass.sum() / 0.4:.4g} kg/s\nout/outflow.csv\n")
        np.testing.assert_allclose(gravier.read_table(self.here("out/outflow.csv")).total_left_mass, [mass.sum()], rtol=1e-8)
        plot = os.path.join(SOURCE, "drivers/plot/gravier_plot.py")
        done = script(plot, "history", "out", "--table", "outflow.csv", "--columns", "left_mass", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (2, "gravier_plot: out/outflow.csv: column left_mass of an outflow is now total_left_mass; left_mass is that of single steps, in history.csv\n"))
        # a table of an earlier version is not drawn, and is written anew
        with open(self.here("out/outflow.csv")) as file:
            text = file.read()
        with open(self.here("out/outflow.csv"), "w") as file:
            file.write(text.replace("total_", ""))
        done = script(plot, "history", "out", "--table", "outflow.csv", "--columns", "left_mass", directory=self.scratch, environment=ENVIRONMENT)
        self.assertIn("out/outflow.csv: column left_mass of an outflow is now total_left_mass", done.stderr)
        done = script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), "outflow", "out", "--mean", "400", directory=self.scratch, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_pictures(self):
        """Columns of a table that have numbers, or those that are told, have a panel each."""
        path = os.path.join(self.directory, "results/heap.csv")
        gravier.write_table(path, gravier.heap(gravier.Run(os.path.join(self.directory, "results"))))
        runs = [gravier.Run(os.path.join(self.directory, "results"))]
        figure = draw_history(runs, None, table="heap.csv")
        self.assertEqual([axes.get_ylabel() for axes in figure.axes if "low" not in axes.get_ylabel()],
                         ["height [m]", "front high [m]", "length [m]", "run-out", "angle high [degrees]"])
        self.assertEqual([axes.get_ylabel() for axes in draw_history(runs, ["run_out"], table="heap.csv").axes], ["run-out"])
        done = script(os.path.join(SOURCE, "drivers/plot/gravier_plot.py"), "history", "results", "--table", "heap.csv", directory=self.directory, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "results/heap.png\n", ""))
        done = script(os.path.join(SOURCE, "drivers/plot/gravier_plot.py"), "history", "results", "--table", "walls.csv", directory=self.directory, environment=ENVIRONMENT)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr, "gravier_plot: results/walls.csv: No such file or directory; expected a table that a run wrote\n")

    def test_pictures_of_tables(self):
        """Each kind of table has a picture with a panel for each measure, with its unit; curves that a table does not have are left out. The command draws it."""
        run = gravier.Run(os.path.join(self.directory, "results"))
        rows = {name: np.linspace(0.1, 0.2, 5) for name in ("step", "time", "axial_strain", "volumetric_strain", "void_ratio", "axial_stress", "lateral_stress", "sin_phi", "total_left_mass", "mass_rate",
                                                             "number_rate", "height", "length", "run_out", "angle")}
        for kind, table, dimension, labels, lines in (
                ("heap", gravier.heap(run), 2, ["ends [m]", "size [m]", "run-out", "angle [degrees]"], [2, 2, 1, 2]), ("heap", gravier.Table(rows), 3, ["size [m]", "run-out", "angle [degrees]"], [2, 1, 1]),
                ("mixing", gravier.mixing(run), 2, ["mixing M", "segregation", "height difference [m]"], [2, 1, 1]),
                ("walls", gravier.Table(rows), 3, ["stress [Pa]", "sin φ", "volumetric strain", "void ratio"], [2, 1, 1, 1]),
                ("walls", gravier.Table(rows), 2, ["stress [N/m]", "sin φ", "volumetric strain", "void ratio"], [2, 1, 1, 1]),
                ("outflow", gravier.Table(rows), 2, ["mass that has left [kg]", "mass rate [kg/s]", "grains a second [1/s]"], [1, 1, 1])):
            with self.subTest(kind, dimension=dimension):
                figure = draw_measured(kind, table, dimension)
                self.assertEqual([axes.get_ylabel() for axes in figure.axes], labels)
                self.assertEqual([len(axes.lines) for axes in figure.axes], lines)
                self.assertEqual(figure.axes[-1].get_xlabel(), "axial strain" if kind == "walls" else "time [s]")
        for kind in ("heap", "mixing"):
            done = self.measure(kind, "results", "--plot", f"{kind}.png", "--out", f"{kind}.csv")
            self.assertEqual((done.returncode, done.stderr, done.stdout.splitlines()[-1]), (0, "", f"{kind}.png"))
        done = self.measure("heap", "results", "--plot", "heap.csv")
        self.assertEqual((done.returncode, done.stderr), (2, "gravier_measure: error: heap.csv: expected a name that ends in .png or .svg\n"))

    def test_refusals(self):
        """One line and status 2; what is there stays."""
        write(os.path.join(self.directory, "mine.csv"), "name,value\n")
        for arguments, words in ((["heap", "results", "--out", "mine.csv"], "mine.csv: there is a file of another kind or origin"),
                                 (["heap", "results", "--out", "results/history.csv"], "history.csv: there is a file of another kind or origin"),
                                 (["heap", "results", "--out", "heap.txt"], "heap.txt: expected a name that ends in .csv"),
                                 (["heap", "nothing"], "nothing/results.h5: no such file"), (["walls", "results"], "no column position_x:left; &output boundary_forces = .true. writes it"),
                                 (["mixing", "results", "--by", "material"], "results.h5: mixing by material of a case without &material, whose grains are of one material; expected a second &material, or mixing by size"), (["heap", "results", "--width", "-1"], "expected a number > 0"),
                                 (["walls", "results", "--mean", "0"], "expected an integer >= 1"),
                                 (["outflow", "results"], "no column left_mass; expected a run with a boundary of shape outlet"), (["heap", "results", "--floor", "nan"], "'nan': expected a number")):
            with self.subTest(arguments=arguments):
                done = self.measure(*arguments)
                self.assertEqual((done.returncode, done.stdout), (2, ""))
                self.assertRegex(done.stderr, rf"^gravier_measure: error: .*{words}.*\n$")
        with open(os.path.join(self.directory, "mine.csv"), encoding="ascii") as file:
            self.assertEqual(file.read(), "name,value\n")


if __name__ == "__main__":
    unittest.main()
