"""Measures of contact forces: distributions, anisotropies, coordination and strength, of contacts whose values are known, of crystals, of random ones and of runs."""
import os
import sys
import unittest

import matplotlib
import numpy as np

from forked_scripts import script
from gravier_runs import ENVIRONMENT, SOURCE, RunTestCase, merged, run_case
import gravier
from gravier.anisotropies import Anisotropy, angle_of, direction_of, size_of
from gravier.force_networks import tail_exponent, weak_exponent
from gravier.results import tangents

matplotlib.use("Agg")

R, STEP = 0.01, 1e-3


def deviator(size, angle):
    """The tensor D of size cos 2(theta - angle) = n.D n in the plane; the angle in degrees."""
    turn = 2.0 * np.radians(angle)
    return size * np.array([[np.cos(turn), np.sin(turn)], [np.sin(turn), -np.cos(turn)]])


def forces_of(normals, normal, tangential, mean=1.0):
    """Normal and tangential forces of the form that is fitted."""
    along, turned = np.einsum("ci,ij,cj->c", normals, normal, normals), normals @ tangential
    return mean * (1.0 + along), mean * (turned - np.sum(turned * normals, axis=1)[:, None] * normals)


def plane(angles):
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def sphere(count, rng):
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def directions_with(size, angle, count):
    """Angles at equal steps of the distribution (1 + a cos 2(theta - angle))/2 pi: means over them are those over it to rounding."""
    share, theta = (np.arange(count) + 0.5) / count, 2.0 * np.pi * (np.arange(count) + 0.5) / count
    for _ in range(60):
        theta -= (theta / (2.0 * np.pi) + size * np.sin(2.0 * theta) / (4.0 * np.pi) - share) * 2.0 * np.pi / (1.0 + size * np.cos(2.0 * theta))
    return theta + np.radians(angle)


class Made(gravier.Run):
    """A run of states that are told: positions, contacts as (candidate, antagonist, normal), and their impulses."""

    def __init__(self, position, pairs, normal, impulse, boundary=None, material=None, period=None, case=None, radius=R, point=None):
        self.path, self.directory, self.dimension = "made", "made", normal.shape[1]
        self.steps, self.times, self.case = np.array([0, 1]), np.array([0.0, STEP]), {"time": [{"step": STEP}], "scene": [{"friction": 0.5}], **(case or {})}
        self.period = np.zeros(self.dimension) if period is None else np.array(period)
        count = len(position)
        self.body_rows = gravier.Table(id=np.arange(1, count + 1), position=np.array(position, dtype=float), velocity=np.zeros((count, self.dimension)), radius=np.full(count, radius))
        for name, values in (("boundary", boundary), ("material", material)):
            if values is not None:
                self.body_rows[name] = np.array(values)
        pairs = np.array(pairs)
        self.contact_rows = gravier.Table(candidate=pairs[:, 0], antagonist=pairs[:, 1], normal=normal, gap=np.zeros(len(pairs)), impulse=impulse)
        if point is not None:
            self.contact_rows["point"] = np.array(point, dtype=float)

    def bodies(self, step=None):
        return self.body_rows

    def contacts(self, step=None):
        return self.contact_rows

    def cell(self, step=None):
        return None

    def case_at(self, step):
        return self.case


def pairs_apart(normals, normal, tangential, **more):
    """Pairs of bodies far from each other, one contact each, with forces given along n and as vectors across it."""
    axes = tangents(normals)
    impulse = STEP * np.column_stack([normal, *(np.sum(tangential * axis, axis=1) for axis in axes)])
    count, d = normals.shape
    low = np.zeros((count, d))
    low[:, 0] = 10.0 * R * np.arange(count)
    position = np.stack([low + 2.0 * R * normals, low], axis=1).reshape(-1, d)
    return Made(position, [(2 * k + 1, 2 * k + 2) for k in range(count)], normals, impulse, **more)


class Fits(unittest.TestCase):

    def test_plane(self):
        """Contacts and forces of given anisotropies in the plane are found to rounding, whatever their directions, and so is the strength: that of the formula of Rothenburg and Bathurst."""
        for a, at, n, nt, t, tt in ((0.3, 20.0, 0.5, 35.0, 0.1, 170.0), (0.2, 90.0, 0.4, 90.0, 0.15, 90.0), (0.0, 0.0, 0.7, 60.0, 0.0, 0.0)):
            with self.subTest(a=a, n=n, t=t):
                theta = directions_with(a, at, 400)
                normals = plane(theta)
                normal, tangential = forces_of(normals, deviator(n, nt), deviator(t, tt), 30.0)
                np.testing.assert_allclose(np.sum(tangential * tangents(normals)[0], axis=1), -30.0 * t * np.sin(2.0 * (theta - np.radians(tt))), atol=1e-12)
                fit = Anisotropy(normals, normal, tangential)
                self.assertAlmostEqual(fit.mean, 30.0, delta=1e-11)
                for tensor, size, angle in ((fit.contacts, a, at), (fit.normal, n, nt), (fit.tangential, t, tt)):
                    np.testing.assert_allclose(tensor, deviator(size, angle), atol=1e-12)
                    self.assertAlmostEqual(size_of(tensor), size, delta=1e-12)
                    if size:
                        self.assertAlmostEqual((angle_of(direction_of(tensor)) - angle + 90.0) % 180.0, 90.0, delta=1e-9)
                table = gravier.contact_forces(pairs_apart(normals, normal, tangential))
                for name, value in (("a_c", a), ("a_n", n), ("a_t", t), ("sin_phi_fitted", table.sin_phi[0])):
                    self.assertAlmostEqual(table[name][0], value, delta=1e-12, msg=name)
                if at == nt == tt:
                    self.assertAlmostEqual(table.sin_phi[0], 0.5 * (a + n + t) / (1.0 + 0.5 * a * n), delta=1e-12)
                    self.assertAlmostEqual(table.angle_c[0], at, delta=1e-9)
        # forces do not depend on how often their directions were met
        some = plane(np.array([0.1, 0.2, 0.5, 0.6, 2.0]))
        fit = Anisotropy(some, *forces_of(some, deviator(0.4, 10.0), deviator(0.2, 80.0)))
        np.testing.assert_allclose([fit.normal, fit.tangential], [deviator(0.4, 10.0), deviator(0.2, 80.0)], atol=1e-11)

    def test_space(self):
        """Tensors of forces in space are found to rounding, that of contacts to its rate; q/p is what the tensors say, and that of the stress where one of them is alone."""
        rng = np.random.default_rng(5)
        tensors = []
        for size in (0.5, 0.2):
            parts = rng.normal(size=(3, 3))
            parts += parts.T
            tensors.append(size * (parts - np.trace(parts) * np.eye(3) / 3.0) / np.abs(parts).max())
        normals = sphere(200, rng)
        fit = Anisotropy(normals, *forces_of(normals, *tensors, 7.0))
        np.testing.assert_allclose(fit.normal, tensors[0], atol=1e-12)
        np.testing.assert_allclose(fit.tangential, tensors[1], atol=1e-12)
        self.assertAlmostEqual(fit.mean, 7.0, delta=1e-11)
        uniaxial = np.diag([-0.2, -0.2, 0.4])
        self.assertAlmostEqual(size_of(uniaxial), 0.6, delta=1e-12)
        np.testing.assert_allclose(direction_of(uniaxial), [0.0, 0.0, 1.0], atol=1e-12)
        normals = sphere(400000, rng)
        normals = normals[rng.random(len(normals)) * 1.4 < 1.0 + np.einsum("ci,ij,cj->c", normals, uniaxial, normals)]
        fit = Anisotropy(normals, *forces_of(normals, uniaxial, uniaxial))
        np.testing.assert_allclose(fit.contacts, uniaxial, atol=5.0 * 7.5 / np.sqrt(len(normals)) * 0.4)
        # octahedra, icosahedra: directions over which means of products of four components are those of the sphere
        golden = 0.5 * (1.0 + np.sqrt(5.0))
        icosahedron = np.array([[0.0, s, t * golden] for s in (-1, 1) for t in (-1, 1)])
        icosahedron = np.concatenate([np.roll(icosahedron, k, axis=1) for k in range(3)]) / np.sqrt(1.0 + golden**2)
        zero = np.zeros((3, 3))
        for normal, tangential, expected in ((uniaxial, zero, 0.4 * 0.6), (zero, uniaxial, 0.6 * 0.6), (uniaxial, uniaxial, 0.6)):
            table = gravier.contact_forces(pairs_apart(icosahedron, *forces_of(icosahedron, normal, tangential)))
            self.assertAlmostEqual(table.q_over_p[0], expected, delta=1e-12)
            self.assertAlmostEqual(table.q_over_p_fitted[0], expected, delta=1e-12)
            self.assertAlmostEqual(table.a_c[0], 0.0, delta=1e-12)
            np.testing.assert_allclose([table.fabric_xx[0], table.fabric_zz[0], table.fabric_xy[0]], [1 / 3, 1 / 3, 0.0], atol=1e-12)
        np.testing.assert_allclose([table.axis_n_x[0], table.axis_n_y[0], table.axis_n_z[0]], [0.0, 0.0, 1.0], atol=1e-12)

    def test_isotropic(self):
        """Anisotropies of random directions without any fall as the root of the number of contacts."""
        rng = np.random.default_rng(11)
        for count in (1000, 100000):
            for normals, scale in ((plane(2.0 * np.pi * rng.random(count)), 2.0), (sphere(count, rng), np.sqrt(15.0 * 7.5) / 2.0)):
                fit = Anisotropy(normals, -np.log(rng.random(count)), np.zeros(normals.shape))
                self.assertLess(size_of(fit.contacts), 3.0 * scale / np.sqrt(count))
                self.assertLess(size_of(fit.normal), 4.0 * scale / np.sqrt(count))
                self.assertGreater(size_of(fit.normal), 0.02 * scale / np.sqrt(count))
                self.assertEqual(size_of(fit.tangential), 0.0)

    def test_too_few(self):
        """What contacts do not tell is nan, and what their directions leave open is 0."""
        fit = Anisotropy(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)))
        self.assertTrue(np.isnan([*fit.contacts.ravel(), *fit.stress().ravel(), fit.mean, angle_of(direction_of(fit.normal))]).all())
        square = plane(np.radians([0.0, 90.0, 180.0, 270.0]))
        fit = Anisotropy(square, np.array([1.0, 3.0, 1.0, 3.0]), np.zeros((4, 2)))
        np.testing.assert_allclose(fit.normal, [[-0.5, 0.0], [0.0, 0.5]], atol=1e-12)
        np.testing.assert_allclose(fit.contacts, 0.0, atol=1e-12)


class Statistics(unittest.TestCase):

    def test_exponential(self):
        """Forces at equal steps of an exponential distribution have its exponent, median, share below the mean and density."""
        count = 20000
        force = -np.log((np.arange(count) + 0.5) / count)
        theta = 2.0 * np.pi * np.random.default_rng(1).random(count)
        normals = plane(theta)
        run = pairs_apart(normals, 3.0 * force, 0.25 * 3.0 * force[:, None] * tangents(normals)[0])
        row = gravier.contact_forces(run)
        for name, value, off in (("normal_mean", 3.0, 1e-3), ("normal_median", np.log(2.0), 1e-3), ("below_mean", 1.0 - np.exp(-1.0), 1e-3), ("beta", 1.0, 1e-2), ("tangential_mean", 0.25, 1e-9),
                                 ("tangential_beta", 1.0, 1e-2), ("mobilised", 0.5, 1e-12), ("sliding", 0.0, 0.0), ("contacts", count, 0.0), ("grains", 2 * count, 0.0),
                                 ("coordination", 1.0, 0.0), ("rattlers", 2 * count, 0.0)):
            self.assertAlmostEqual(row[name][0], value, delta=off, msg=name)
        table = gravier.force_distribution(run, width=0.1)
        np.testing.assert_allclose([table.normal.sum() * 0.1, table.tangential.sum() * 0.1, table.contacts.sum()], [1.0, 1.0, count], rtol=1e-9)
        np.testing.assert_allclose(table.normal[:40], np.exp(-table.force[:40]), rtol=0.03)
        np.testing.assert_allclose(table.tangential[:40], np.exp(-table.force[:40]), rtol=0.03)
        rows = gravier.force_directions(run, bins=6)
        np.testing.assert_allclose(rows.contacts, 1.0, atol=0.06)
        np.testing.assert_allclose(rows.tangential, 0.25, atol=0.02)
        np.testing.assert_allclose(rows.angle, [0.0, 30.0, 60.0, 90.0, 120.0, 150.0])

    def test_exponents(self):
        """An exponent is the one whose exponential, cut at both ends, has the mean of the forces; negative ones too."""
        for beta in (-2.0, -0.3, 1e-9, 0.5, 1.4, 20.0):
            share = (np.arange(100000) + 0.5) / 100000
            force = 1.0 - np.log1p(share * np.expm1(-4.0 * beta)) / beta
            self.assertAlmostEqual(tail_exponent(force), beta, delta=1e-3)
        self.assertTrue(np.isnan([tail_exponent(np.array([0.5, 2.0])), weak_exponent(np.array([2.0]))]).all())
        self.assertAlmostEqual(weak_exponent(((np.arange(100000) + 0.5) / 100000)**2.0), -0.5, delta=1e-3)

    def test_friction(self):
        """Coefficients are those of the laws of the materials; contacts whose law has no constant one do not count. A given coefficient is that of all contacts."""
        normals = plane(np.radians([10.0, 40.0, 80.0, 120.0]))
        force = np.full(4, 2.0)
        across = 0.3 * tangents(normals)[0] * force[:, None]
        materials = [1, 1, 1, 2, 2, 2, 1, 3]
        case = {"scene": [{"friction": 0.6}], "material": [{"name": "glass"}, {"name": "steel"}, {"name": "glue"}],
                "law": [{"materials": ["steel", "glass"], "kind": "coulomb", "friction": 0.3}, {"materials": ["steel"], "kind": "velocity", "static_friction": 0.4},
                        {"materials": ["glass", "glue"], "kind": "elastic", "friction": 0.9, "pull_off_force": 1.0}]}
        row = gravier.contact_forces(pairs_apart(normals, force, across, material=materials, case=case))
        self.assertAlmostEqual(row.mobilised[0], 0.5 * (0.3 / 0.6 + 1.0), delta=1e-12)
        self.assertAlmostEqual(row.sliding[0], 0.5, delta=1e-12)
        row = gravier.contact_forces(pairs_apart(normals, force, across, material=materials, case=case), friction=0.4)
        self.assertAlmostEqual(row.mobilised[0], 0.75, delta=1e-12)
        self.assertTrue(np.isnan(gravier.contact_forces(pairs_apart(normals, force, across, case={"scene": [{}]})).mobilised[0]))

    def test_directions_in_space(self):
        """Means by the angle to z are those of the fit, also of contacts whose normals point down."""
        normals = sphere(100000, np.random.default_rng(2))
        tensor, turned = np.diag([-0.2, -0.2, 0.4]), np.diag([0.1, 0.1, -0.2])
        rows = gravier.force_directions(pairs_apart(normals, *forces_of(normals, tensor, turned)))
        theta = np.radians(rows.angle)
        np.testing.assert_allclose(rows.angle, 5.0 + 10.0 * np.arange(9))
        np.testing.assert_allclose(rows.normal, 1.0 + 0.4 * (1.5 * np.cos(theta)**2 - 0.5), atol=0.01)
        np.testing.assert_allclose(rows.tangential, 0.75 * 0.2 * np.sin(2.0 * theta), atol=0.01)
        np.testing.assert_allclose([rows.normal - rows.normal_fitted, rows.tangential - rows.tangential_fitted], 0.0, atol=0.01)
        np.testing.assert_allclose(rows.contacts, 1.0, atol=0.1)
        self.assertEqual(rows["count"].sum(), 100000)


class Crystals(unittest.TestCase):

    @staticmethod
    def triangular(count, normal, tangential, **more):
        """A periodic triangular lattice of disks, with the forces of the form that is fitted."""
        ways = plane(np.radians([0.0, 60.0, 120.0]))
        place = np.array([[i, j] for j in range(count) for i in range(count)])
        pairs, normals = [], []
        for k, (i, j) in enumerate(place):
            for way, (di, dj) in zip(ways, ((1, 0), (0, 1), (-1, 1))):
                pairs.append(((i + di) % count + count * ((j + dj) % count) + 1, k + 1))
                normals.append(way)
        normals = np.array(normals)
        position = 2.0 * R * (place @ ways[:2])
        wide, high = 2.0 * R * count, 2.0 * R * count * np.sin(np.pi / 3.0)
        force, across = forces_of(normals, normal, tangential, 5.0)
        impulse = STEP * np.column_stack([force, np.sum(across * tangents(normals)[0], axis=1)])
        return Made(np.mod(position, [wide, high]), pairs, normals, impulse, period=[wide, high], **more)

    def test_triangular(self):
        """Each disk has six neighbours, contacts have no anisotropy, forces that of their form, and the strength follows from it exactly."""
        run = self.triangular(8, deviator(0.4, 30.0), deviator(0.1, 30.0))
        row = gravier.contact_forces(run)
        for name, value in (("coordination", 6.0), ("rattlers", 0.0), ("contacts", 192.0), ("normal_mean", 5.0), ("a_c", 0.0), ("a_n", 0.4), ("a_t", 0.1), ("angle_n", 30.0), ("sin_phi", 0.25), ("sin_phi_fitted", 0.25)):
            self.assertAlmostEqual(row[name][0], value, delta=1e-11, msg=name)
        rows = gravier.force_directions(run, bins=3)
        np.testing.assert_array_equal(rows["count"], [64, 64, 64])
        np.testing.assert_allclose(rows.contacts, 1.0, rtol=1e-12)

    def test_windows(self):
        """A box takes the disks and contacts in it, also across the period; windows that are none are refused."""
        run = self.triangular(8, deviator(0.0, 0.0), deviator(0.0, 0.0))
        high = 2.0 * R * np.sin(np.pi / 3.0)
        # two rows of the eight with the contacts along them, and those between them; lower sides count
        for low in (-0.5 * high, 1.5 * high, 6.5 * high):
            row = gravier.contact_forces(run, box=[0.003, 0.003 + 16.0 * R, low, low + 2.0 * high])
            self.assertEqual((row.grains[0], row.coordination[0]), (16.0, 6.0))
            self.assertEqual(row.contacts[0] % 8.0, 0.0)
            self.assertAlmostEqual(row.contacts[0], 48.0, delta=16.0)
        self.assertEqual(gravier.contact_forces(run, box=[0.0, 16.0 * R, -0.25 * high, 0.25 * high]).contacts[0], 8.0)
        for options, words in (({"box": [0.0, 1.0]}, "expected x0 x1 y0 y1, each lower side"), ({"box": [0.0, 0.0, 1.0, 2.0]}, "each lower side below"),
                               ({"box": [0.0, 1.0, 0.0, 1.0], "region": "a"}, "expected one of them"), ({"mean": 2}, "whole number of states from 1 to 1"), ({"friction": -1.0}, "friction -1.0: expected a number > 0")):
            with self.assertRaisesRegex(gravier.ResultsError, words):
                gravier.contact_forces(run, **options)
        for bins in (0, 1.5):
            with self.assertRaisesRegex(gravier.ResultsError, "expected a whole number above 0"):
                gravier.force_directions(run, bins=bins)
        with self.assertRaisesRegex(gravier.ResultsError, "width 0: expected a number above 0"):
            gravier.force_distribution(run, width=0)

    def test_who_counts(self):
        """Contacts with boundaries, glued grains and those that pull do not count as contacts between grains; boundaries and glued grains are neighbours. The points of a pair are one
        neighbour, and two of them hold a grain."""
        place = [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [6.0, 0.0], [8.0, 0.0], [10.0, 0.0]]
        pairs = [(2, 1), (3, 2), (3, 2), (4, 3), (5, 4), (6, 5), (1, 99)]
        normals = np.array([[1.0, 0.0]] * 7)
        impulse = STEP * np.array([[2.0, 0.0], [1.0, 0.0], [3.0, 0.0], [4.0, 1.0], [-1.0, 0.0], [5.0, 0.0], [7.0, 0.0]])
        run = Made(place, pairs, normals, impulse, boundary=[0, 0, 0, 0, 0, 42], radius=1.0,
                   point=[[1.0, 0.0], [3.0, -0.5], [3.0, 0.5], [5.0, 0.0], [7.0, 0.0], [9.0, 0.0], [-1.0, 0.0]])
        row = gravier.contact_forces(run)
        self.assertEqual((row.contacts[0], row.grains[0], row.rattlers[0]), (4.0, 5.0, 2.0))
        self.assertAlmostEqual(row.normal_mean[0], 2.5, delta=1e-12)
        # 1: boundary, 2; 2: 1, 3; 3: 2, 4; 4: 3; 5: glued
        self.assertAlmostEqual(row.coordination[0], 8.0 / 5.0, delta=1e-12)
        # the branches are those from centre to centre
        self.assertAlmostEqual(row.sin_phi[0], np.hypot(1.0, 0.1), delta=1e-12)


class Runs(RunTestCase):

    @classmethod
    def setUpClass(cls):
        """A periodic cell of disks under shear, in which all contacts are between grains."""
        super().setUpClass()
        cls.case = {"scene": {"bodies": "lattice", "lattice_count": [8, 8], "radius_min": 0.004, "radius_max": 0.006, "friction": 0.4, "gravity": [0.0, 0.0],
                              "period": [0.11, 0.11], "cell_shear_rate": 2.0, "cell_pressure": [0.0, 100.0]},
                    "time": {"step": 5e-4, "steps": 1200}, "output": {"directory": "cell", "every": 100, "stress": True, "structure": True}}
        run = run_case(cls.case, 1, cls.scratch)
        assert run.status == 0, run

    def compare(self, run, strength):
        """Coordination, rattlers, fabric, shares of friction and the stress are those of history.csv."""
        found, history = gravier.contact_forces(run), run.history()
        rows = np.searchsorted(history.step, found.step)
        some = found.contacts > 10
        self.assertGreater(some.sum(), 2)
        np.testing.assert_allclose(found.coordination, history.coordination[rows], rtol=1e-12)
        np.testing.assert_allclose(found.rattlers, history.rattlers[rows], rtol=1e-12)
        np.testing.assert_allclose(found.normal_mean[some], history.force_mean[rows][some], rtol=1e-9)
        np.testing.assert_allclose(found.sliding[some], history.sliding_fraction[rows][some], atol=1e-12)
        axes = "xyz"[:run.dimension]
        stress = np.array([[0.5 * (history[f"stress_{a}{b}"] + history[f"stress_{b}{a}"])[rows] for b in axes] for a in axes]).transpose(2, 0, 1)[some]
        deviators = stress / (np.trace(stress, axis1=1, axis2=2) / run.dimension)[:, None, None] - np.eye(run.dimension)
        np.testing.assert_allclose(found[strength][some], [size_of(part) for part in deviators], rtol=1e-6)
        return found[strength][-3:].mean(), found[f"{strength}_fitted"][-3:].mean()

    def test_sheared_cell(self):
        """In the plane; the mean strength that anisotropies make is near that of the stress."""
        measured, fitted = self.compare(gravier.Run(self.here("cell")), "sin_phi")
        self.assertAlmostEqual(fitted / measured, 1.0, delta=0.35)
        with self.assertRaisesRegex(gravier.ResultsError, "a cell that is sheared; expected no region and no box"):
            gravier.contact_forces(gravier.Run(self.here("cell")), box=[0.0, 0.1, 0.0, 0.1])

    def test_spheres(self):
        """The same in space."""
        case = merged(self.case, {"scene": {"dimension": 3, "lattice_count": [5, 5, 5], "gravity": [0.0] * 3, "period": [0.07] * 3, "cell_shear_rate": None, "cell_pressure": [100.0, 100.0, 200.0]},
                                  "time": {"steps": 400}, "output": {"directory": "spheres", "every": 50}})
        self.assert_status(run_case(case, 1, self.scratch), 0)
        self.compare(gravier.Run(self.here("spheres")), "q_over_p")

    def test_region(self):
        """A region of the case is a window: grains are those that it counts."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.004, "radius_max": 0.006, "friction": 0.4},
                "region": [{"name": "core", "lower": [0.03, 0.02], "upper": [0.09, 0.06]}], "time": {"step": 1e-3, "steps": 200}, "output": {"directory": "bed", "every": 100}}
        self.assert_status(run_case(case, 1, self.scratch), 0)
        run = gravier.Run(self.here("bed"))
        found = gravier.contact_forces(run, region="core")
        np.testing.assert_array_equal(found.grains, [run.history().core_grains[99], run.history().core_grains[199]])
        np.testing.assert_array_equal(found.contacts, gravier.contact_forces(run, box=[0.03, 0.09, 0.02, 0.06]).contacts)
        with self.assertRaisesRegex(gravier.ResultsError, "no region edge in step 100; expected one of core"):
            gravier.contact_forces(run, region="edge")

    def measure(self, *arguments):
        return script(os.path.join(SOURCE, "drivers/measure/gravier_measure.py"), "forces", *arguments, directory=self.scratch, environment=ENVIRONMENT)

    def test_command(self):
        """The tables of the command have what the functions return, and the picture shows them."""
        done = self.measure("cell", "--since", "0.1", "--mean", "2", "--distribution", "p.csv", "--directions", "d.csv", "--plot", "f.png")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertRegex(done.stdout, r"^last row: time 0\.525 s, contacts \d.*, normal mean [\d.]+ N, .*\nall states: contacts .*sin phi [\d.]+\ncell/forces\.csv\np\.csv\nd\.csv\nf\.png\n$")
        run = gravier.Run(self.here("cell"))
        for path, known in (("cell/forces.csv", gravier.contact_forces(run, mean=2, since=0.1)), ("p.csv", gravier.force_distribution(run, since=0.1)),
                            ("d.csv", gravier.force_directions(run, since=0.1))):
            found = gravier.read_table(self.here(path))
            self.assertEqual(list(found), [*known, *(["run_checksum"] if "step" in known else [])])
            for name in known:
                np.testing.assert_allclose(found[name], known[name], rtol=1e-8, atol=1e-12, err_msg=name)
        with open(self.here("f.png"), "rb") as file:
            self.assertEqual(file.read(4), b"\x89PNG")
        done = self.measure("cell", "--plot", "f.svg", "--out", "again.csv", "--friction", "0.8")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertTrue(np.all(gravier.read_table(self.here("again.csv")).mobilised <= 0.5 + 1e-9))
        for arguments, words in ((["cell", "--box", "0", "1"], "box 0 1: expected x0 x1 y0 y1"), (["cell", "--plot", "f.txt"], "f.txt: expected a name that ends in .png or .svg"),
                                 (["cell", "--since", "9"], "no written state from 9 s on"), (["cell", "--region", "core"], "no region core in step 100; expected one of none"),
                                 (["cell", "--distribution", "cell/forces.csv"], "another kind or origin"), (["cell", "--out", "cell/history.csv"], "another kind or origin")):
            with self.subTest(arguments=arguments):
                done = self.measure(*arguments)
                self.assertEqual((done.returncode, done.stdout), (2, ""))
                self.assertRegex(done.stderr, rf"^gravier_measure: error: .*{words}.*\n$")

    def test_picture(self):
        """The distribution has both forces and the exponential, and the roses go all around."""
        sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
        from force_pictures import draw_forces
        run = gravier.Run(self.here("cell"))
        directions = gravier.force_directions(run)
        figure = draw_forces(gravier.force_distribution(run), directions, 1.25, 2)
        self.assertEqual([axes.get_title() for axes in figure.axes], ["", "contacts", "normal forces\nover their mean", "tangential forces\nover the normal mean, light below 0"])
        self.assertEqual([text.get_text() for text in figure.axes[0].get_legend().get_texts()], ["normal forces", "sizes of tangential forces", "exp(-1.25 f), fitted from 1 to 5"])
        heights = [bar.get_height() for bar in figure.axes[1].patches]
        np.testing.assert_allclose(heights, np.tile(directions.contacts, 2), rtol=1e-12)
        self.assertEqual([len(axes.patches) for axes in figure.axes[1:]], [36] * 3)
        # without friction there are no tangential forces
        tables = [gravier.Table({**table, "tangential": 0.0 * table["tangential"]}) for table in (gravier.force_distribution(run), directions)]
        figure = draw_forces(*tables, 1.25, 2)
        self.assertEqual([axes.get_title() for axes in figure.axes], ["", "contacts", "normal forces\nover their mean"])
        self.assertEqual([text.get_text() for text in figure.axes[0].get_legend().get_texts()], ["normal forces", "exp(-1.25 f), fitted from 1 to 5"])


if __name__ == "__main__":
    unittest.main()
