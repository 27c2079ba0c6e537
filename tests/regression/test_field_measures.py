"""Fields on a grid: sums that add up, balances of mass and momentum, gradients, kernels, periodic cells, and files, of states whose values are known and of runs."""
import base64
import os
import re
import sys
import unittest
import xml.etree.ElementTree

import matplotlib
import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, run_case, write
from test_force_measures import STEP, Made, R, plane
import gravier
from gravier.fields import Chosen
from gravier.field_grid import Grid, Kernel, reach_of
from gravier.field_sums import half_branches

matplotlib.use("Agg")
sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
EPS = 1e-12


class Grains(Made):
    """A state of grains that are told, with masses, velocities, planes and a periodic cell that moves; without contacts unless told."""

    def __init__(self, position, velocity=None, mass=None, contacts=None, walls=(), cell=None, **more):
        position = np.array(position, dtype=float)
        d = position.shape[1]
        pairs, normal, impulse = contacts or (np.zeros((0, 2), dtype=int), np.zeros((0, d)), np.zeros((0, d)))
        super().__init__(position, pairs, np.array(normal), np.array(impulse), **more)
        self.origin, self.walls, self.moving, self.has_contacts = np.zeros(d), walls, cell, contacts is not None
        self.body_rows["mass"] = np.ones(len(position)) if mass is None else np.resize(mass, len(position))
        if velocity is not None:
            self.body_rows["velocity"] = np.array(velocity, dtype=float)

    def contacts(self, step=None):
        return self.contact_rows if self.has_contacts and step != 0 else None

    def cell(self, step=None):
        return self.moving

    def shapes(self):
        return []

    def boundaries(self, step=None):
        places, normals = zip(*self.walls) if self.walls else ((), ())
        return gravier.Table(name=np.array([f"wall {k}" for k in range(len(places))]), shape=np.full(len(places), "plane"), position=np.array(places), normal=np.array(normals))


class States(Grains):
    """Several states of grains, each given by positions and velocities."""

    def __init__(self, *states, **more):
        super().__init__(*states[0], **more)
        self.tables = [gravier.Table({**self.body_rows, "id": np.arange(1, len(x) + 1), "position": np.array(x, dtype=float), "velocity": np.array(v, dtype=float), "radius": np.full(len(x), R),
                                      "mass": np.ones(len(x))}) for x, v in states]
        self.steps, self.times = np.arange(1, len(states) + 1), STEP * np.arange(1, len(states) + 1)

    def bodies(self, step=None):
        return self.tables[-1 if step is None else step - 1]


def at_random(count, box, seed=1):
    return np.random.default_rng(seed).random((count, len(box))) * box


def cell_volume(fields):
    """Of one cell, in space and in the plane also where fields are means along an axis."""
    return abs(np.linalg.det(fields.edges)) / np.prod(fields.shape)


def triangular(count):
    """The periodic triangular lattice of test_force_measures without anisotropy: positions, periods and contacts (pairs, normals, impulses) of forces of 5 N along the normals."""
    ways = plane(np.radians([0.0, 60.0, 120.0]))
    place = np.array([[i, j] for j in range(count) for i in range(count)])
    pairs = np.array([((i + di) % count + count * ((j + dj) % count) + 1, i + count * j + 1) for i, j in place for di, dj in ((1, 0), (0, 1), (-1, 1))])
    normals = np.tile(ways, (len(place), 1))
    period = [2.0 * R * count, 2.0 * R * count * np.sin(np.pi / 3.0)]
    impulse = STEP * 5.0 * np.tile([1.0, 0.0], (len(normals), 1))
    return np.mod(2.0 * R * (place @ ways[:2]), period), period, (pairs, normals, impulse)


class Grids(unittest.TestCase):

    def test_lines(self):
        """The parts of lines in cells are those that clipping each line by the sides of each cell finds; outside of a closed grid nothing counts, and beyond an open one the last cell does."""
        rng = np.random.default_rng(3)
        for d in (2, 3):
            counts = (4, 3, 2)[:d]
            for wraps, is_open in ((False, False), (False, True), (True, True)):
                starts, ways = rng.random((60, d)) * 5.0 - 0.5, rng.normal(size=(60, d)) * 1.5
                starts[:5], ways[:5] = np.round(starts[:5]), np.round(ways[:5])
                ways[:5, 0] += 3.0
                grid = Grid(counts, [wraps] * d, np.zeros(d), np.diag(counts), (is_open, 0, np.zeros(d)))
                lines, cells, parts = grid.parts_of_lines(starts, ways)
                found = np.zeros((60, grid.size))
                np.add.at(found, (lines, cells), parts)
                expected = np.zeros_like(found)
                for corner in np.ndindex(*((14,) * d)):
                    low = np.array(corner, dtype=float) - 5.0
                    with np.errstate(divide="ignore", invalid="ignore"):
                        ends = np.sort(np.stack([(low - starts) / ways, (low + 1.0 - starts) / ways]), axis=0)
                    still = ways == 0.0
                    ends[0][still], ends[1][still] = np.where((starts >= low) & (starts < low + 1.0), -9.0, 9.0)[still], 9.0
                    share = np.maximum(np.minimum(ends[1].min(axis=1), 1.0) - np.maximum(ends[0].max(axis=1), 0.0), 0.0)
                    number = np.mod(low, counts) if wraps else np.clip(low, 0, np.array(counts) - 1) if is_open else low
                    if np.all((number >= 0) & (number < counts)):
                        expected[:, np.ravel_multi_index(number.astype(int), counts)] += share
                np.testing.assert_allclose(found, expected, atol=1e-12)
                if is_open:
                    np.testing.assert_allclose(found.sum(axis=1), 1.0, rtol=1e-14)

    def test_balls(self):
        """Sides through the centre halve a ball along each axis, one at half of the radius cuts the known segment off, and parts add up to the ball."""
        for d, ball, segment in ((2, np.pi, 1.0 / 3.0 - np.sqrt(3.0) / (4.0 * np.pi)), (3, 4.0 * np.pi / 3.0, 5.0 / 32.0)):
            grid = Grid([4] * d, [False] * d, np.zeros(d), 8.0 * np.eye(d), (True, 0, np.zeros(d)))
            box = grid.volumes_of_balls(np.full((1, d), 4.0), np.array([1.0])).reshape(grid.shape)
            np.testing.assert_allclose(box[(slice(1, 3),) * d], ball / 2**d, rtol=1e-14)
            point = np.array([[4.5] + [5.0] * (d - 1)])
            self.assertAlmostEqual(grid.volumes_of_balls(point, np.array([1.0])).reshape(grid.shape)[1].sum() / ball, segment, delta=1e-14)
            # along the normal of a side that leans the ball ends a radius from its centre
            edges = 8.0 * np.eye(d)
            edges[1, 0] = 6.0
            grid = Grid([8] + [1] * (d - 1), [True] * d, np.zeros(d), edges, (True, 0, np.zeros(d)))
            point = np.array([[4.0 * edges[0] + 4.0 * edges[1]]]).reshape(1, d) / 8.0 + 0.5 * np.eye(d)[:1] * np.hypot(1.0, 0.75)
            self.assertAlmostEqual(grid.volumes_of_balls(point, np.array([1.0]))[:4].sum() / ball, segment, delta=1e-13)
            for edges in (8.0 * np.eye(d), 8.0 * np.eye(d) + 3.0 * np.eye(d, k=-1)):
                grid = Grid([7] * d, [True] * d, np.zeros(d), edges, (True, 0, np.zeros(d)))
                radii = 0.2 + np.random.default_rng(2).random(50)
                self.assertAlmostEqual(grid.volumes_of_balls(at_random(50, [8.0] * d), radii).sum() / (ball * np.sum(radii**d)), 1.0, delta=EPS)

    def test_kernel(self):
        """Weights are those of a Gauss curve, add up to 1 and reach three widths; what is smoothed has the mean and the spread that it has to have."""
        self.assertEqual([reach_of(width) for width in (0.0, 0.2, 1.0, 1.01)], [0, 1, 3, 4])
        grid = Grid([41], [False], [0.0], [[41.0]], (True, 0, np.zeros(1)))
        one = np.zeros((1, 41))
        one[0, 20] = 1.0
        smooth = Kernel([3.0]).smooth(grid, one)[0]
        way = np.arange(41) - 20.0
        np.testing.assert_allclose([smooth.sum(), way @ smooth], [1.0, 0.0], atol=1e-14)
        self.assertAlmostEqual(way**2 @ smooth, 9.0, delta=0.3)
        np.testing.assert_allclose(smooth[20:25] / smooth[20], np.exp(-way[20:25]**2 / 18.0), rtol=0.01)
        # the cell at 20 is so many cells above those below it
        np.testing.assert_allclose(Kernel([3.0]).smooth(grid, one, [0])[0], -way * smooth, atol=1e-14)
        np.testing.assert_allclose(Kernel([3.0]).smooth(grid, one, [0, 0])[0], way**2 * smooth, atol=1e-13)
        wrapped = Grid([5], [True], [0.0], [[5.0]], (True, 0, np.zeros(1)))
        np.testing.assert_allclose(Kernel([4.0]).smooth(wrapped, np.ones((1, 5))), 1.0, rtol=1e-14)


class Sums(unittest.TestCase):

    def test_mass(self):
        """The integral of the density is the mass, and that of the solid fraction the volume, with and without smoothing, over any axes, with and without periods."""
        for d in (2, 3):
            box = np.array([0.5, 0.3, 0.4])[:d]
            for period in (np.zeros(d), box, box * ([1.0] + [0.0] * (d - 1))):
                run = Grains(at_random(200, box), mass=np.random.default_rng(2).random(200), period=period)
                for axes in ("x", "xy", "xyz"[:d]):
                    for smooth in (0.0, 0.03):
                        fields = gravier.fields(run, 0.06, axes=axes, smooth=smooth)
                        volume = cell_volume(fields)
                        self.assertAlmostEqual(fields.density.sum() * volume / run.bodies().mass.sum(), 1.0, delta=EPS)
                        self.assertAlmostEqual(fields.solid_fraction.sum() * volume / run.volumes(run.bodies()).sum(), 1.0, delta=EPS)
                        self.assertAlmostEqual(fields.grains.sum() / 200.0, 1.0, delta=EPS)
                        np.testing.assert_allclose(np.nansum(fields.density[:, None] * fields.velocity, axis=0), 0.0)

    def test_stress_of_contacts(self):
        """The integral of the stress of contacts is the sum of force by branch, with and without smoothing: that of all branches of a periodic lattice, and that of the ways to the boundaries."""
        position, period, contacts = triangular(8)
        for shift in ([0.0, 0.0], [0.013, 0.031]):
            run = Grains(np.mod(position + shift, period), contacts=contacts, period=period)
            expected = 5.0 * 2.0 * R * 64.0 * 1.5 * np.eye(2)
            np.testing.assert_allclose(np.einsum("ca,cb->ab", run.forces().force, run._branches(1, run.bodies(), run.contacts())), expected, atol=EPS)
            for options in ({}, {"smooth": 0.02}, {"axes": "x"}, {"axes": "y", "smooth": 0.05}):
                fields = gravier.fields(run, 0.015, **options)
                np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), expected, rtol=EPS, atol=EPS)
                self.assertAlmostEqual(np.nansum(fields.coordination * fields.grains) / 64.0, 6.0, delta=EPS)
        # one grain on a plane, whose force acts at its surface, and a glued one beside
        run = Grains([[0.5, R], [0.5 + 2.0 * R, R]], contacts=([(1, 9), (2, 1)], np.array([[0.0, 1.0], [1.0, 0.0]]), STEP * np.array([[3.0, 1.0], [2.0, 0.0]])), boundary=[0, 9],
                     walls=[([0.0, 0.0], [0.0, 1.0])])
        run.contact_rows["gap"] = np.array([0.1, -0.2]) * R
        fields = gravier.fields(run, 0.004, smooth=0.003)
        # force (-1, 3) from the plane, 1.1 R below, and (-2, 0) from the glued grain, 0.8 R beside
        np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), R * np.array([[2.0 * 0.8, -1.1], [0.0, 3.3]]), atol=EPS)
        self.assertAlmostEqual(fields.grains.sum(), 1.0, delta=EPS)

    def test_shapes(self):
        """Ways of bodies with shapes lead from each centre to the point, so that the integral is that of the branches, also across a period."""
        run = Grains([[0.01, 0.05], [0.09, 0.06]], contacts=([(2, 1)], np.array([[-1.0, 0.0]]), STEP * np.array([[2.0, 1.0]])), period=[0.1, 0.0], point=[[-0.002, 0.057]])
        for smooth in (0.0, 0.01):
            fields = gravier.fields(run, 0.01, smooth=smooth)
            np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), np.outer([-2.0, -1.0], [-0.02, 0.01]), rtol=EPS)
        body, contact, way, sign = half_branches(run, (1, None), run.bodies(), run.contacts())
        np.testing.assert_allclose(way, [[0.008, -0.003], [-0.012, 0.007]], atol=1e-15)
        np.testing.assert_array_equal([body, contact, sign], [[1, 0], [0, 0], [1.0, -1.0]])

    def test_cells_add_up(self):
        """Four cells have the sums of the one that they make."""
        position, period, contacts = triangular(8)
        rng = np.random.default_rng(4)
        run = Grains(position, velocity=rng.normal(size=position.shape), contacts=contacts, period=period)
        box = [0.0, 0.16, 0.02, 0.1]
        fine, coarse = gravier.fields(run, 0.02, box=box), gravier.fields(run, 0.04, box=box)
        self.assertEqual((fine.shape, coarse.shape), ((8, 4), (4, 2)))
        for name in ("density", "solid_fraction", "contact_stress"):
            values = fine.grid(name)
            np.testing.assert_allclose(values.reshape(4, 2, 2, 2, *values.shape[2:]).mean(axis=(1, 3)), coarse.grid(name), rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(fine.grid("grains").reshape(4, 2, 2, 2).sum(axis=(1, 3)), coarse.grid("grains"))
        momentum = np.nan_to_num(fine.grid("velocity")) * fine.grid("density")[..., None]
        np.testing.assert_allclose(momentum.reshape(4, 2, 2, 2, 2).mean(axis=(1, 3)), coarse.grid("velocity") * coarse.grid("density")[..., None], rtol=1e-12, atol=1e-9)

    def test_translations(self):
        """A shift by a period changes nothing, and one by whole cells shifts the fields; a box takes the images that lie in it."""
        position, period, contacts = triangular(8)
        period = np.array(period)
        # no grain and no contact on the side of a cell, where rounding decides
        position, velocity = position + [0.0031, 0.0023], np.random.default_rng(5).normal(size=position.shape)
        first = gravier.fields(Grains(position, velocity, contacts=contacts, period=period), 0.02, smooth=0.015)
        edge = period / first.shape
        for shift, rolled in ((period, (0, 0)), (-2.0 * period, (0, 0)), ([0.0, period[1]], (0, 0)), (edge * [3.0, 2.0], (3, 2))):
            fields = gravier.fields(Grains(position + shift, velocity, contacts=contacts, period=period), 0.02, smooth=0.015)
            for name in ("density", "solid_fraction", "velocity", "temperature", "gradient", "contact_stress", "kinetic_stress", "coordination"):
                values = first.grid(name)
                np.testing.assert_allclose(fields.grid(name), np.roll(values, rolled, axis=(0, 1)), rtol=1e-9, atol=1e-9 * np.abs(values).max(), err_msg=name)
        run = Grains(position, velocity, contacts=contacts, period=period)
        low, high = -0.25 * period, 0.75 * period
        box = np.stack([low, high], axis=1).ravel()
        whole, half = gravier.fields(run, 0.02, box=box), gravier.fields(run, 0.02, box=[low[0], 0.25 * period[0], low[1], high[1]])
        self.assertAlmostEqual(whole.grains.sum(), 64.0, delta=EPS)
        for name in ("density", "contact_stress"):
            np.testing.assert_allclose(whole.grid(name)[:half.shape[0]], half.grid(name), rtol=1e-9, atol=1e-9 * np.abs(half[name]).max())


class Velocities(unittest.TestCase):

    def test_linear_field(self):
        """The gradient of a linear field is found to rounding wherever grains are, also where a kernel smooths it, with periods along which it is constant, and along some axes alone."""
        for d in (2, 3):
            gradient, box = np.random.default_rng(6).normal(size=(d, d)), np.full(d, 0.3)
            position = at_random(400 if d == 2 else 3000, box)
            for smooth in (0.0, 0.03):
                fields = gravier.fields(Grains(position, position @ gradient.T + 0.1), 0.05, smooth=smooth)
                known = np.isfinite(fields.shear_rate)
                self.assertGreater(known.sum(), 0.9 * np.count_nonzero(fields.density))
                np.testing.assert_allclose(fields.gradient[known], np.tile(gradient, (known.sum(), 1, 1)), atol=1e-7)
                rates = 0.5 * (gradient + gradient.T) - np.trace(gradient) / d * np.eye(d)
                np.testing.assert_allclose(fields.shear_rate[known], np.sqrt(2.0 * np.sum(rates**2)), atol=1e-7)
            shear = np.zeros((d, d))
            shear[0, d - 1] = 2.0
            for axes, smooth in (("xyz"[:d], 0.03), ("xyz"[d - 1], 0.0)):
                fields = gravier.fields(Grains(position, position @ shear.T, period=[0.3] + [0.0] * (d - 1)), 0.05, axes=axes, smooth=smooth)
                known = fields.density > 1e-6 * fields.density.max()
                np.testing.assert_allclose(fields.gradient[known], np.tile(shear, (known.sum(), 1, 1)), atol=1e-7)
                np.testing.assert_allclose(fields.shear_rate[known], 2.0, atol=1e-7)
        # neighbours along one axis alone do not tell the other one, nor does a cell that has none
        fields = gravier.fields(Grains([[0.05, 0.05], [0.15, 0.05], [0.25, 0.25]], [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]), 0.1, box=[0.0, 0.3, 0.0, 0.3])
        self.assertFalse(np.isfinite(fields.gradient).any())

    def test_temperature(self):
        """Two grains that fly apart have a temperature and a kinetic stress; a body of grains that moves as one has none."""
        run = Grains([[0.02, 0.02], [0.03, 0.02]], [[1.0 + 3.0, 2.0], [1.0 - 3.0, 2.0]], mass=0.5, contacts=([(2, 1)], np.array([[1.0, 0.0]]), STEP * np.array([[0.0, 0.0]])))
        fields = gravier.fields(run, 0.1, box=[0.0, 0.1, 0.0, 0.1])
        np.testing.assert_allclose([*fields.velocity[0], *fields.temperature[0], fields.granular_temperature[0], fields.density[0]], [1.0, 2.0, 9.0, 0.0, 4.5, 100.0], rtol=EPS)
        np.testing.assert_allclose(fields.kinetic_stress[0], [[900.0, 0.0], [0.0, 0.0]], atol=1e-9)
        np.testing.assert_allclose([fields.pressure[0], fields.shear_ratio[0]], [450.0, 1.0], rtol=EPS)
        fields = gravier.fields(Grains(at_random(100, [0.3, 0.3]), np.tile([3.0, -2.0], (100, 1))), 0.05, smooth=0.04)
        np.testing.assert_allclose(np.nan_to_num(fields.granular_temperature), 0.0, atol=1e-13)

    def test_shear_within_the_kernel(self):
        """A shear within the kernel adds nothing to the temperature, and to the kinetic stress its rate times the width of the kernel, squared, as the documentation has it."""
        y = (np.arange(6000) + 0.5) / 6000.0
        run = Grains(np.stack([np.full(6000, 0.5), y], axis=1), np.stack([2.0 * y, 0.0 * y], axis=1), contacts=([(2, 1)], np.array([[1.0, 0.0]]), np.zeros((1, 2))))
        run.body_rows["radius"] = np.full(6000, 1e-4)
        for cell, smooth, width in ((0.05, 0.0, 0.05**2 / 12.0), (0.02, 0.06, 0.06**2 + 0.02**2 / 6.0), (0.02, 0.02, 0.02**2 + 0.02**2 / 6.0)):
            fields = gravier.fields(run, cell, axes="y", smooth=smooth)
            inside = np.abs(fields.y - 0.5) < 0.2
            np.testing.assert_allclose(fields.temperature[inside], 0.0, atol=1e-13)
            # the Gauss curve is cut at three widths
            np.testing.assert_allclose(fields.kinetic_stress[inside, 0, 0] / fields.density[inside], 4.0 * width, rtol=0.04 if smooth else 1e-3)
        # a linear field has no temperature anywhere, and fluctuations of one kind have theirs beside any linear field
        position, still = at_random(2000, [0.3, 0.3]), np.where(np.arange(2000) % 2 == 0, 1.0, -1.0)[:, None] * [3.0, 0.0]
        gradient = np.array([[1.0, 30.0], [-20.0, 5.0]])
        for smooth in (0.0, 0.02):
            rows = [gravier.fields(Grains(position, velocity), 0.05, smooth=smooth) for velocity in (position @ gradient.T, still, still + position @ gradient.T)]
            known = rows[0].grains > 30.0
            np.testing.assert_allclose(rows[0].temperature[known], 0.0, atol=1e-9)
            np.testing.assert_allclose(rows[1].temperature[known], rows[2].temperature[known], atol=1e-9)
            self.assertAlmostEqual(rows[1].temperature[known, 0].mean(), 9.0, delta=0.6)

    def test_means_over_states(self):
        """Velocities are weighted by mass, densities by time; the fields of each state by itself have the densities whose mean that is. Fluctuations are those about the mean of all states."""
        one, three = [[0.05, 0.05]], [[0.05, 0.05], [0.02, 0.05], [0.08, 0.05]]
        run = States((one, [[4.0, 0.0]]), (three, [[0.0, 0.0]] * 3))
        box = [0.0, 0.1, 0.0, 0.1]
        fields = gravier.fields(run, 0.1, box=box)
        np.testing.assert_allclose([fields.velocity[0, 0], fields.density[0], fields.grains[0], fields.temperature[0, 0]], [1.0, 200.0, 2.0, 3.0], rtol=EPS)
        self.assertEqual((fields.step[0], fields.states[0], fields.time[0]), (2, 2, 2.0 * STEP))
        each = gravier.fields_of_states(run, 0.1, box=box)
        np.testing.assert_allclose([state.density[0] for state in each], [100.0, 300.0], rtol=EPS)
        np.testing.assert_allclose([state.velocity[0, 0] for state in each], [4.0, 0.0])
        self.assertEqual([len(gravier.fields_of_states(run, 0.1, **options)) for options in ({}, {"steps": 2}, {"since": 1.5 * STEP}, {"steps": [(None, 1)]})], [2, 1, 1, 1])
        # the grid is that of all states
        self.assertEqual(len({state.shape for state in gravier.fields_of_states(run, 0.01)}), 1)
        self.assertNotIn("pressure", fields)
        # stresses and coordination are means over the states that have contacts
        position, period, contacts = triangular(4)
        run = Grains(position, contacts=contacts, period=period)
        alone = gravier.fields(run, 1.0)
        run.steps, run.times, held = np.array([1, 2]), np.array([STEP, 2.0 * STEP]), run.contacts
        run.contacts = lambda step=None: held() if step == 1 else None
        both = gravier.fields(run, 1.0)
        np.testing.assert_allclose([both.pressure, both.coordination, both.states], [alone.pressure, alone.coordination, [2]], rtol=EPS)


class Cells(unittest.TestCase):

    @staticmethod
    def sheared(rate, tilt):
        """The triangular lattice in a cell that is sheared at a rate, with the velocities of the homogeneous motion and forces of 5 N."""
        position, period, contacts = triangular(8)
        edge = np.array([[period[0], 0.0], [tilt * period[0], period[1]]])
        moved = np.linalg.inv(np.diag(period))
        position = position @ moved @ edge
        cell = gravier.Table(axis=np.array([1, 2]), edge=edge, velocity=np.array([[0.0, 0.0], [rate * period[1], 0.0]]), origin=np.zeros((2, 1)))
        velocity = np.zeros_like(position)
        velocity[:, 0] = rate * (position[:, 1] - 0.5 * period[1])
        # in the box of the lengths, with the velocity of the image
        return Grains(np.mod(position, period), velocity, contacts=contacts, period=period, cell=cell), edge

    def test_homogeneous_motion(self):
        """A homogeneous shear has its gradient, no temperature and no kinetic stress in cells that lean with the periodic cell; stress and mass add up."""
        for tilt in (0.0, 0.25):
            run, edge = self.sheared(3.0, tilt)
            for smooth in (0.0, 0.02):
                fields = gravier.fields(run, 0.03, smooth=smooth)
                np.testing.assert_allclose(fields.edges, edge, atol=EPS)
                np.testing.assert_allclose(fields.gradient, np.tile([[0.0, 3.0], [0.0, 0.0]], (len(fields), 1, 1)), atol=1e-10)
                np.testing.assert_allclose(fields.velocity[:, 0], 3.0 * (fields.y - 0.5 * edge[1, 1]), atol=1e-12)
                np.testing.assert_allclose(fields.granular_temperature, 0.0, atol=1e-12)
                np.testing.assert_allclose([fields.density.sum() * cell_volume(fields), fields.solid_fraction.sum() * cell_volume(fields)], [64.0, 64.0 * np.pi * R**2], rtol=EPS)
                np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), 5.0 * 2.0 * R * 96.0 * np.eye(2), atol=1e-11)

    def test_middle_of_the_step(self):
        """Contacts are those of the middle of the step, when grains and the cell were half of a step behind: the ways of both grains meet there, with points of contact and without. A kernel is as wide along an edge that
        leans as along the others."""
        run, edge = self.sheared(40.0, 0.25)
        moved, cell = run.in_the_middle(1)
        np.testing.assert_allclose(cell.edge[1], edge[1] - [0.5 * STEP * 40.0 * edge[1, 1], 0.0], rtol=EPS)
        bodies, contacts = run.bodies(), run.contacts()
        row, other = run._rows(bodies, contacts)
        apart = (moved.position[other] - moved.position[row]) @ np.linalg.inv(cell.edge)
        apart = (apart - np.round(apart)) @ cell.edge
        contacts["normal"], contacts["gap"] = -apart / np.linalg.norm(apart, axis=1)[:, None], np.linalg.norm(apart, axis=1) - 2.0 * R
        for points in (False, True):
            if points:
                contacts["point"] = moved.position[row] + 0.5 * apart
            body, contact, way, _ = half_branches(run, (1, cell.edge[::-1]), moved, contacts)
            np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.5 * np.linalg.norm(apart, axis=1)[contact], rtol=1e-12)
            ends = (moved.position[body] + way) @ np.linalg.inv(cell.edge)
            ways = ends[:len(row)] - ends[len(row):]
            np.testing.assert_allclose(ways, np.round(ways), atol=1e-9)
            fields = gravier.fields(run, 0.03)
            expected = np.einsum("ca,cb->ab", 5.0 * contacts.normal, -apart)
            np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), expected, rtol=1e-12, atol=1e-12)
        chosen = Chosen(run, 0.02, "xy", 0.02, None)
        chosen.frame([1])
        grid, kernel = chosen.grid_of(run.cell())
        for weights, count, along in zip(kernel.weights, grid.count, np.linalg.norm(edge, axis=1)):
            self.assertEqual(len(weights) // 2, reach_of(0.02 * count / along))

    def test_inertial_number(self):
        """Shear rate times diameter times the root of the density of the grains over the pressure; the shear stress over the pressure of a known stress."""
        run, edge = self.sheared(3.0, 0.0)
        fields = gravier.fields(run, 1.0)
        pressure = 5.0 * 2.0 * R * 96.0 / np.linalg.det(edge)
        np.testing.assert_allclose([fields.pressure[0], fields.shear_ratio[0], fields.shear_rate[0]], [pressure, 0.0, 3.0], atol=1e-9)
        self.assertAlmostEqual(fields.inertial_number[0], 3.0 * 2.0 * R * np.sqrt(1.0 / (np.pi * R**2) / pressure), delta=1e-12)
        # what shears alone: (s1 - s2)/(s1 + s2)
        run.contact_rows["impulse"] = run.contact_rows.impulse * np.where(np.arange(192) % 3 == 0, 3.0, 1.0)[:, None]
        stress = gravier.fields(run, 1.0).contact_stress[0]
        values = np.linalg.eigvalsh(0.5 * (stress + stress.T))
        self.assertAlmostEqual(gravier.fields(run, 1.0).shear_ratio[0], (values[1] - values[0]) / values.sum(), delta=1e-12)


class Refusals(unittest.TestCase):

    def test_words(self):
        run, cell = Grains(at_random(20, [0.3, 0.3]), period=[0.3, 0.0]), Cells.sheared(1.0, 0.0)[0]
        for words, chosen, options in (("cell 0: expected a length above 0", run, {"cell": 0}), ("cell nan", run, {"cell": np.nan}), ("smooth -1: expected a length of at least 0", run, {"smooth": -1}),
                                       ("axes 'xz': expected some of x, y", run, {"axes": "xz"}), ("axes 'xx'", run, {"axes": "xx"}), ("axes ''", run, {"axes": ""}),
                                       ("expected x0 x1 y0 y1, each lower side below", run, {"box": [0.0, 1.0]}), ("expected a box of at most a period", run, {"box": [0.0, 0.4, 0.0, 1.0]}),
                                       ("a periodic cell that moves; expected no box", cell, {"box": [0.0, 0.1, 0.0, 0.1]}), (r"cell 1e-05: 30000 x \d+ cells; expected 1000000 at most", run, {"cell": 1e-5}),
                                       ("no written state from 5 s on", run, {"since": 5.0}), ("no step 7", run, {"steps": [7]})):
            with self.subTest(words), self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.fields(chosen, **{"cell": 0.1, **options})
        # glued grains alone have a volume and nothing else
        run.body_rows["boundary"] = np.ones(20, dtype=int)
        fields = gravier.fields(run, 0.1, smooth=0.05)
        self.assertAlmostEqual(fields.solid_fraction.sum() * cell_volume(fields), 20.0 * np.pi * R**2, delta=EPS)
        self.assertFalse(fields.density.any() or np.isfinite(fields.velocity).any() or np.isfinite(fields.temperature).any())
        # grains without a contact have no stress of contacts
        run = Grains(at_random(20, [0.3, 0.3]), contacts=(np.zeros((0, 2), dtype=int), np.zeros((0, 2)), np.zeros((0, 2))))
        fields = gravier.fields(run, 0.1)
        self.assertFalse(fields.contact_stress.any() or np.isfinite(fields.shear_ratio).any() or np.nan_to_num(fields.coordination).any())
        del run.body_rows["mass"]
        with self.assertRaisesRegex(gravier.ResultsError, "no mass of the bodies"):
            gravier.fields(run, 0.1)


class Runs(RunTestCase):

    @classmethod
    def setUpClass(cls):
        """Disks on a floor, periodic along x, and with regions between walls; spheres and polygons between walls."""
        super().setUpClass()
        disks = {"bodies": "lattice", "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3}
        output = {"every": 1, "stress": True, "structure": True}
        cls.cases = {
            "floor": {"scene": {**disks, "lattice_count": [8, 10], "period": [0.22, 0.0]}, "time": {"step": 1e-3, "steps": 250}, "output": {**output, "directory": "floor", "every": 249}},
            "rest": {"scene": {**disks, "lattice_count": [8, 10], "period": [0.22, 0.0]}, "time": {"step": 1e-3, "steps": 800}, "output": {**output, "directory": "rest", "every": 0}},
            "walls": {"scene": {**disks, "lattice_count": [10, 10]}, "time": {"step": 1e-3, "steps": 300}, "output": {**output, "directory": "walls", "every": 100},
                      "region": [{"name": "bed", "lower": [-1e30, 0.0], "upper": [1e30, 0.3], "axis": "y", "bins": 10}, {"name": "part", "lower": [0.05, 0.03], "upper": [0.15, 0.09], "axis": "x", "bins": 5}]},
            "spheres": {"scene": {**disks, "dimension": 3, "lattice_count": [4, 4, 4]}, "time": {"step": 1e-3, "steps": 200}, "output": {**output, "directory": "spheres", "every": 200},
                        "region": {"name": "bed", "lower": [-1e30, -1e30, 0.0], "upper": [1e30, 1e30, 0.12], "axis": "z", "bins": 4}}}
        for case in cls.cases.values():
            run = run_case(case, 1, cls.scratch)
            assert run.status == 0, run

    def open(self, name):
        return gravier.Run(self.here(name))

    def test_momentum_balance(self):
        """In a bed with a period the stress across a height bears, in each cell, the weight and the inertia of all grains above, to rounding: the line integrals along branches balance momentum exactly."""
        run = self.open("floor")
        before, after = run.bodies(249), run.bodies(250)
        middle = after.position - 0.5e-3 * after.velocity
        load = after.mass * (9.81 + (after.velocity[:, 1] - before.velocity[:, 1]) / 1e-3)
        for cell, smooth in ((0.011, 0.0), (0.02, 0.03)):
            fields = gravier.fields(run, cell, axes="y", steps=[250], smooth=smooth)
            edge = fields.size[0]
            grid = Grid([len(fields)], [False], [fields.corner[1]], [[len(fields) * edge]], (True, 0, np.zeros(1)))
            above = np.array([np.sum(load * np.clip((middle[:, 1] - low) / edge, 0.0, 1.0)) for low in fields.corner[1] + edge * np.arange(len(fields))])
            above[fields.y < 0.0] = 0.0
            expected = Kernel([smooth / edge]).smooth(grid, above[None])[0] if smooth else above
            np.testing.assert_allclose(fields.contact_stress[:, 1, 1] * 0.22, expected, atol=1e-9 * load.sum())
            self.assertGreater(expected.max(), 0.5 * after.mass.sum() * 9.81)
        # at rest the weight alone, to the accuracy of the solves
        run = self.open("rest")
        fields, bodies = gravier.fields(run, 0.02, axes="y"), run.bodies()
        above = [np.sum(9.81 * bodies.mass * np.clip((bodies.position[:, 1] - low) / fields.size[0], 0.0, 1.0)) for low in fields.corner[1] + fields.size[0] * np.arange(len(fields))]
        np.testing.assert_allclose(fields.contact_stress[:, 1, 1] * 0.22, above, atol=1e-3 * 9.81 * bodies.mass.sum())

    def test_regions(self):
        """Solid fractions and stresses of cells along one axis are those of the bins of a region, which the program measures."""
        run = self.open("walls")
        ends = np.sort([row for name, row in zip(run.boundaries().normal, run.boundaries().position[:, 0]) if abs(name[0]) > 0.9])
        for step in (100, 200, 300):
            bed = run.region("bed", step)
            fields = gravier.fields(run, 0.03, axes="y", steps=[step], box=[*ends, 0.0, 0.3])
            np.testing.assert_allclose(fields.contact_stress, bed.stress, atol=1e-12 * max(1.0, np.abs(bed.stress).max()))
            # the parts of overlaps that lie beyond the walls belong to the bins
            np.testing.assert_allclose(fields.solid_fraction, bed.solid_fraction, atol=1e-4)
            part = run.region("part", step)
            fields = gravier.fields(run, 0.02, axes="x", steps=[step], box=[0.05, 0.15, 0.03, 0.09])
            np.testing.assert_allclose(fields.contact_stress, part.stress, atol=1e-12 * max(1.0, np.abs(part.stress).max()))
            np.testing.assert_allclose(fields.solid_fraction, part.solid_fraction, atol=1e-12)
        run = self.open("spheres")
        sides = [np.sort(run.boundaries().position[np.abs(run.boundaries().normal[:, axis]) > 0.9, axis]) for axis in (0, 1)]
        bed, fields = run.region("bed"), gravier.fields(run, 0.03, axes="z", box=[*sides[0], *sides[1], 0.0, 0.12])
        np.testing.assert_allclose(fields.contact_stress, bed.stress, atol=1e-12 * np.abs(bed.stress).max())
        np.testing.assert_allclose(fields.solid_fraction, bed.solid_fraction, atol=1e-4)
        whole = gravier.fields(run, 0.03, smooth=0.01)
        self.assertEqual(len(whole.shape), 3)
        np.testing.assert_allclose(whole.contact_stress.sum(axis=0) * cell_volume(whole), (bed.stress * bed.volume[:, None, None]).sum(axis=0), atol=1e-9 * np.abs(bed.stress).max())

    def test_bodies_with_shapes(self):
        """A brick, a cluster of two and a capsule: the solid fractions of layers are those of a region, which cuts them, to a few thousandths; the integral of the stress is that of history.csv, and the volume all of it."""
        write(self.here("three.shapes"), "shape brick\npolygon -0.1 -0.04  0.1 -0.04  0.1 0.04  -0.1 0.04\nshape ell\npolygon 0 0  0.1 0  0.1 0.04  0 0.04\npolygon 0 0.04  0.04 0.04  0.04 0.1  0 0.1\n"
                                         "shape pill\ncapsule -0.05 0  0.05 0  0.03\n")
        write(self.here("three.csv"), "id,x,y,shape,angle,radius,nx,ny\n1,0.1,0.041,brick,,,,\n2,0.13,0.13,ell,0.3,,,\n3,0.2,0.3,pill,0.2,,,\n4,0.3,0.04,,,0.03,,\n5,0,0,plane,,,0,1\n")
        run = run_case({"scene": {"bodies": "file", "bodies_file": "three.csv", "shapes": "three.shapes", "friction": 0.5}, "time": {"step": 1e-3, "steps": 120},
                        "region": {"name": "bed", "lower": [-0.5, 0.0], "upper": [0.8, 0.6], "axis": "y", "bins": 12}, "output": {"directory": "three", "every": 0, "stress": True}}, 1, self.scratch)
        self.assert_status(run, 0)
        run = self.open("three")
        fields, bed = gravier.fields(run, 0.05, axes="y", box=[-0.5, 0.8, 0.0, 0.6]), run.region("bed")
        np.testing.assert_allclose(fields.solid_fraction, bed.solid_fraction, atol=4e-3 * bed.solid_fraction.max())
        fields, history = gravier.fields(run, 0.05, smooth=0.04), run.history()
        self.assertAlmostEqual(fields.solid_fraction.sum() * cell_volume(fields) / run.volumes(run.bodies()).sum(), 1.0, delta=EPS)
        stress = np.array([[history[f"stress_{a}{b}"][-1] for b in "xy"] for a in "xy"]) * history.volume[-1]
        self.assertGreater(stress[1, 1], 0.0)
        np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), stress, atol=1e-7 * np.abs(stress).max())

    def test_points_of_shapes(self):
        """Points fill polyhedra, capsules and balls evenly: halves hold halves of them, and all are inside."""
        corner = np.array([[x, y, z] for z in (-0.2, 0.2) for y in (-0.3, 0.3) for x in (-0.9, 0.9)])
        faces = [np.array(face) for face in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))]
        for pieces, half in (([gravier.Piece(0.0, corner, corner, faces)], [0.9, 0.3, 0.2]), ([gravier.Piece(0.3, corner[:1] * 0.0, corner[:1] * 0.0, [])], [0.3] * 3),
                             ([gravier.Piece(0.2, corner[:2] + [0.0, 0.3, 0.2], corner[:2] + [0.0, 0.3, 0.2], [])], [1.1, 0.2, 0.2])):
            points = gravier.Shape("a", 1.0, 1.0, np.ones(3), pieces).points(2000)
            self.assertEqual(len(points), 2000)
            self.assertTrue(np.all(np.abs(points) <= half))
            np.testing.assert_allclose(np.mean(points > 0.0, axis=0), 0.5, atol=0.01)
            self.assertTrue(np.all(np.abs(points).max(axis=0) > 0.95 * np.array(half)))

    def test_history(self):
        """Mean stress and coordination over all cells are those of history.csv."""
        run, history = self.open("floor"), self.open("floor").history()
        fields = gravier.fields(run, 0.03, steps=[250])
        stress = np.array([[history[f"stress_{a}{b}"][-1] for b in "xy"] for a in "xy"]) * history.volume[-1]
        np.testing.assert_allclose(fields.contact_stress.sum(axis=0) * cell_volume(fields), stress, atol=1e-7 * np.abs(stress).max())
        counted = fields.grains > 0.0
        self.assertAlmostEqual(np.average(fields.coordination[counted], weights=fields.grains[counted]), history.coordination[-1], delta=1e-9)

    def measure(self, *arguments):
        return script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), *arguments, directory=self.scratch, environment=ENVIRONMENT)

    def test_command(self):
        """The command writes a table that knows of its run, files for ParaView of each state or of all, and a picture; bad options are one line."""
        done = self.measure("fields", "walls", "--cell", "0.02", "--smooth", "0.01", "--vtk", "fields.vti", "--plot", "fields.png")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"^\d+ x \d+ cells of 0.0\d+ x 0.0\d+ m along x, y; mean of 3 states, the last one of step 300; grains 100, largest solid fraction 0\.\d+, granular temperature .*, pressure .*\n")
        self.assertTrue(done.stdout.endswith("walls/fields.csv\nfields.vti\nfields.png\n"), done.stdout)
        run = self.open("walls")
        fields, table = gravier.fields(run, 0.02, smooth=0.01), gravier.read_table(self.here("walls/fields.csv"))
        for name, values in fields.flat().items():
            np.testing.assert_allclose(table[name], values, rtol=1e-8, err_msg=name)
        self.assertEqual(list(table)[-1], "run_checksum")
        arrays = self.arrays("fields.vti")
        np.testing.assert_array_equal(arrays["density"], fields.grid("density").T.ravel())
        np.testing.assert_array_equal(arrays["contact_stress"].reshape(-1, 3, 3)[:, :2, :2], fields.grid("contact_stress").transpose(1, 0, 2, 3).reshape(-1, 2, 2))
        self.assertEqual(arrays["TimeValue"][0], 0.3)
        done = self.measure("fields", "walls", "--cell", "0.02", "--axes", "y", "--states", "100,250:", "--each", "--vtk", "each.vti", "--out", "each.csv", "--plot", "each.svg")
        self.assertEqual(done.returncode, 0, done.stderr)
        table = gravier.read_table(self.here("each.csv"))
        np.testing.assert_array_equal(np.unique(table.step), [100, 300])
        self.assertEqual(self.arrays("each_00000100.vti")["velocity"].shape, (len(table) // 2 * 3,))
        for arguments, words in ((["walls"], "--cell"), (["walls", "--cell", "0.02", "--vtk", "a.vtk"], "a.vtk: expected a name that ends in .vti or .vts"),
                                 (["walls", "--cell", "0.02", "--vtk", "a.vts"], "a.vts: expected a name that ends in .vti"), (["walls", "--cell", "-1"], "expected a number > 0"),
                                 (["walls", "--cell", "0.02", "--states", "1:2:3"], "expected all, or steps and ranges"), (["walls", "--cell", "0.02", "--axes", "q"], "axes 'q': expected some of x, y"),
                                 (["spheres", "--cell", "0.02", "--plot", "a.png"], "expected two axes or one for a picture"),
                                 (["walls", "--cell", "0.02", "--columns", "charm", "--plot", "a.png"], "no column charm of these fields; expected one of velocity"),
                                 (["walls", "--cell", "0.02", "--out", "walls/history.csv"], "another kind or origin")):
            with self.subTest(arguments=arguments):
                done = self.measure("fields", *arguments)
                self.assertEqual((done.returncode, done.stdout), (2, ""))
                self.assertRegex(done.stderr, rf"^gravier_measure: error: .*{words}.*\n$")

    def arrays(self, name):
        """Of a file of VTK in XML, by name."""
        found = {}
        for node in xml.etree.ElementTree.parse(self.here(name)).getroot().iter("DataArray"):
            raw = base64.b64decode(node.text)
            self.assertEqual(int(np.frombuffer(raw[:8], "<u8")[0]), len(raw) - 8)
            found[node.get("Name")] = np.frombuffer(raw[8:], "<f8")
        return found

    def test_images(self):
        """Cells of an image, of a slice in space and of a cell that leans lie where their centres are."""
        fields = gravier.fields(self.open("spheres"), 0.02, axes="xz")
        fields.write_vtk(self.here("slice.vti"))
        with open(self.here("slice.vti"), encoding="ascii") as file:
            text = file.read()
        extent, origin, spacing = (np.array(re.search(rf'{name}="([^"]*)"', text)[1].split(), dtype=float) for name in ("WholeExtent", "Origin", "Spacing"))
        np.testing.assert_array_equal(extent, [0, fields.shape[0], 0, 0, 0, fields.shape[1]])
        np.testing.assert_allclose((origin + 0.5 * spacing)[[0, 2]], [fields.x[0], fields.z[0]], rtol=1e-12)
        self.assertAlmostEqual(origin[1], fields.corner[1] + 0.5 * fields.edges[1, 1], delta=1e-12)
        leaning, edge = Cells.sheared(1.0, 0.25)
        fields = gravier.fields(leaning, 0.03)
        with self.assertRaisesRegex(gravier.ResultsError, "expected a name that ends in .vts"):
            fields.write_vtk(self.here("cell.vti"))
        fields.write_vtk(self.here("cell.vts"))
        points = self.arrays("cell.vts")["points"].reshape(fields.shape[1] + 1, fields.shape[0] + 1, 3)
        np.testing.assert_allclose(points[-1, -1, :2], edge.sum(axis=0), rtol=1e-12)
        middles = 0.25 * (points[1:, 1:] + points[:-1, 1:] + points[1:, :-1] + points[:-1, :-1])[..., :2]
        np.testing.assert_allclose(middles.transpose(1, 0, 2).reshape(-1, 2), np.stack([fields.x, fields.y], axis=1), rtol=1e-12)

    def test_pictures(self):
        """A panel for each column with its unit, blank where there are no grains, equal scales; profiles along one axis."""
        from field_pictures import colours_of, draw_fields, layout
        fields = gravier.fields(self.open("walls"), 0.02, steps=[300])
        figure = draw_fields(fields)
        panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
        self.assertEqual([re.sub(r"\$.*\$ ", "", axes.get_title(loc="left")) for axes in panels], ["solid fraction", "speed [m/s]", "granular temperature [m²/s²]", "pressure [N/m]", "shear stress ratio |τ|/p", "inertial number"])
        for axes in panels:
            self.assertEqual(axes.get_aspect(), 1.0)
            blank = np.ma.getmaskarray(axes.collections[0].get_array()).ravel()
            self.assertTrue(np.all(blank[fields.solid_fraction < 0.01]))
        self.assertEqual(len(draw_fields(fields, ["contact_stress_xy"]).axes), 2)
        figure = draw_fields(gravier.fields(self.open("walls"), 0.02, axes="y"), ["velocity", "contact_stress", "density"])
        self.assertEqual([axes.get_xlabel() for axes in figure.axes], ["velocity [m/s]", "contact stress [N/m]", "density [kg/m²]"])
        self.assertEqual(len(figure.axes[1].lines), 3)
        # panels beside each other that are high, below each other where they are wide
        self.assertEqual([layout(6, slope)[0] for slope in (0.1, 1.0, 4.0)], [1, 2, 3])
        style, ends = colours_of(np.array([-1.0, 1.0, np.nan]))
        self.assertEqual((style["norm"].vmin, style["cmap"]), (-style["norm"].vmax, "PuOr"))
        self.assertEqual(colours_of(np.full(3, np.nan))[1], "neither")


if __name__ == "__main__":
    unittest.main()
