"""Overlaps of long runs: they grow at a loose tolerance, and stay within what is allowed where places are projected.

A projection leaves a tenth of what is allowed at most, to first order in displacements that are themselves of that order, and sees
the velocities of the step that is over, not the loads of the next: a packing at rest keeps 1.5 times what is allowed."""
import unittest

import h5py
import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, differences, each, merged, run_case
from packings import settled_disks

RADIUS = 0.01
ALLOWED = 0.005 * RADIUS
DENSITY = 2500.0
PRESSURE = 2.0e4  # N/m
KEPT = 1.5
CASE = {
    "scene": {"dimension": 2, "bodies": "file", "friction": 0.3, "density": DENSITY, "overlap_allowed": ALLOWED},
    "time": {"step": 1e-3, "steps": 2000},
    # what a loose solve leaves is that of plain iterations
    "solver": {"acceleration": "none", "criterion": "residual", "tolerance": 1e-2, "max_iterations": 500},
    "output": {"directory": "results", "every": 0, "contacts": False, "final_bodies": True, "energy": True},
}
WITHOUT = {"scene": {"overlap_projection": False}}


def grains_file(path, centres, radii, group=None, planes=()):
    with h5py.File(path, "w") as file:
        file["bodies/id"] = np.arange(1, len(radii) + 1)
        file["bodies/position"] = centres
        file["bodies/radius"] = radii
        if group is not None:
            file["bodies/group"] = group
        if len(planes) > 0:
            file["walls/id"] = len(radii) + 1 + np.arange(len(planes))
            file["walls/point"] = np.array([point for point, _ in planes], float)
            file["walls/normal"] = np.array([normal for _, normal in planes], float)
    return path


def final_overlaps(run, period=None, low=None):
    """Largest overlap of two grains of the last state, and of a grain and the planes x_d = low[d] [m]."""
    with h5py.File(run.path("results", "final_bodies.h5")) as file:
        centres, radii = file["bodies/position"][:], file["bodies/radius"][:]
    apart = centres[:, None] - centres[None]
    if period is not None:
        apart -= np.where(period > 0.0, np.round(apart / np.where(period > 0.0, period, 1.0)), 0.0) * period
    overlap = radii[:, None] + radii[None] - np.linalg.norm(apart, axis=2)
    np.fill_diagonal(overlap, 0.0)
    beyond = 0.0 if low is None else max((low[d] - (centres[:, d] - radii)).max() for d in range(len(low)) if low[d] is not None)
    return overlap.max(), beyond


class Drift(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # in some packings, of 25 by 24 disks for one, deep overlaps grow by more than is accepted here, in whatever order contacts are swept
        cls.packing = settled_disks(cls.scratch, count=(24, 23))
        with h5py.File(cls.packing) as file:
            cls.centres, cls.radii = file["bodies/position"][:], file["bodies/radius"][:]
            cls.planes = list(zip(file["walls/point"][:], file["walls/normal"][:]))
        with h5py.File(settled_disks(cls.scratch + "/small", count=(14, 12))) as file:
            cls.small_centres, cls.small_radii = file["bodies/position"][:], file["bodies/radius"][:]
            cls.small_planes = list(zip(file["walls/point"][:], file["walls/normal"][:]))
        cls.unit = (DENSITY * np.pi * cls.radii**2).sum() * 9.81 * RADIUS

    def run_here(self, name, change=None, more=None, ranks=1):
        run = run_case(merged(CASE, {"scene": {"bodies_file": self.packing}}, change or {}, more or {}), ranks, self.here(name))
        self.assertIn(run.status, (0, 3), str(run))
        return run

    def test_loose_tolerance(self):
        """A packing at rest: overlaps grow on and on, or stay; and no kinetic energy comes of it."""
        without, kept = (run.history() for run in each(self.run_here, [("without", WITHOUT), ("with",)]))
        half = len(kept["step"]) // 2
        self.assertEqual(without["projected"].max(), 0)
        self.assertGreater(without["max_overlap"][-1], 2.0 * ALLOWED)
        self.assertGreater(without["max_overlap"][-1], 2.0 * without["max_overlap"][0])
        self.assertGreater(kept["projected"].sum(), 10)
        self.assertLess(kept["max_overlap"][half:].max(), KEPT * ALLOWED)
        # what a loose solve leaves of motion, with or without
        self.assertLess(kept["kinetic_energy"][half:].max(), 1e-3 * self.unit)
        self.assertLess(kept["kinetic_energy"][half:].mean(), 2.0 * max(kept["kinetic_energy"][:half].mean(),
                                                                       without["kinetic_energy"][half:].mean()))
        # the balance of velocities knows nothing of projections
        self.assertLess(np.abs(kept["energy_error"]).max(), 1e-12 * self.unit)

    def test_ranks_and_subdomains(self):
        """The same bits on 1 and 2 ranks; close on 1 and 4 subdomains."""
        grown = grains_file(self.here("grown a little.h5"), self.centres, 1.02 * self.radii, planes=self.planes)
        change = {"scene": {"bodies_file": grown}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4},
                  "time": {"steps": 300}}
        one, two, whole = each(self.run_here, [("1 rank", change), ("2 ranks", change, {}, 2),
                                               ("1 subdomain", change, {"decomposition": {"subdomains": 1}})])
        self.assertEqual([name for name in differences(one.results(), two.results()) if not name.startswith("/run")], [])
        self.assertGreater(one.history()["projected"].sum(), 10)
        for run in (one, whole):
            self.assertLess(run.history()["max_overlap"][-1], KEPT * ALLOWED)
        # the packing rises as its grains are larger, about as far on any partition
        heights = [run.history()["potential_energy"] / self.unit for run in (one, whole)]
        self.assertGreater(heights[0][-1] - heights[0][0], 0.1)
        self.assertLess(np.abs(heights[0] - heights[1]).max(), 0.1 * (heights[0][-1] - heights[0][0]))

    def frictionless(self, name, bodies, subdomains, steps, more=None):
        """Places and velocities of grains on which nothing acts, by step, in so many subdomains."""
        run = self.run_here(name, {
            "scene": {"bodies_file": bodies, "friction": 0.0, "gravity": [0.0, 0.0]}, "time": {"steps": steps},
            "solver": {"method": "nlgs" if subdomains == 1 else "nscdd", "tolerance": 1e-12},
            "decomposition": {"subdomains": subdomains}, "output": {"every": 1}}, more)
        self.assert_status(run, 0)
        found = run.results()
        return [[found[f"/steps/{step}/bodies/{what}"] for step in range(steps + 1)] for what in ("position", "velocity")]

    def test_chain_on_any_partition(self):
        """Disks in a row that push each other apart: however they are cut, their centre of mass stays, and they end where each gap
        is what is allowed, within the tenth that sweeps may leave of it."""
        rng = np.random.default_rng(7)
        radii = RADIUS * rng.uniform(0.6, 1.4, 40)
        x = np.append(0.0, np.cumsum(radii[1:] + radii[:-1] - rng.uniform(0.0, 0.1, 39) * RADIUS))
        path = grains_file(self.here("chain.h5"), np.stack([x, np.zeros(40)], axis=1), radii)
        runs = [places for places, _ in each(self.frictionless, [(f"chain {n}", path, n, 40, {"decomposition": {"grid": [n, 1]}})
                                                                for n in (1, 4, 8)])]
        centres = [[np.average(place[:, 0], weights=radii**2) for place in places] for places in runs]
        np.testing.assert_allclose(centres, centres[0][0], rtol=0.0, atol=1e-14)
        self.assertGreater(np.abs(runs[0][-1] - runs[0][0]).max(), 100.0 * ALLOWED)
        for places in runs[1:]:
            self.assertGreater(np.abs(places[1] - runs[0][1]).max(), 0.0, "the chain was not cut")
            self.assertLess(np.abs(places[-1] - runs[0][-1]).max(), 0.1 * 39 * ALLOWED)

    def test_packing_on_any_partition(self):
        """Projections end before they are exact, and elsewhere on other partitions: by what is allowed or so, as theory.md says,
        and not in velocities. Without them places are the same."""
        grown = grains_file(self.here("grown by a hundredth.h5"), self.centres, 1.01 * self.radii, planes=self.planes)
        # the figures of theory.md
        allowed = {"scene": {"overlap_allowed": 0.01 * RADIUS}}
        cases = [(f"places {n} {kind}", grown, n, 3, merged(allowed, more))
                 for kind, more in (("with", {}), ("without", WITHOUT)) for n in (1, 4, 16)]
        runs = each(self.frictionless, cases)
        for places, velocities in runs:
            np.testing.assert_array_equal(velocities, 0.0 * np.array(velocities))
        for places, _ in runs[3:]:
            np.testing.assert_array_equal(places, runs[3][0])
        moved = np.abs(runs[0][0][1] - runs[0][0][0]).max()
        self.assertGreater(moved, 5.0 * 0.01 * RADIUS)
        for places, _ in runs[1:3]:
            self.assertLess(np.linalg.norm(places[1] - runs[0][0][1], axis=1).max(), 1.5 * 0.01 * RADIUS)

    def test_deep_overlaps(self):
        """Overlaps of a fifth of the radius, in a box too narrow for the layers: they are undone within some hundred steps. On
        the way some may get deeper, by a half at most, since sweeps end before they are exact; grains fall into what opens, from
        a height that is a small part of their radius."""
        grown = grains_file(self.here("grown.h5"), self.centres, 1.1 * self.radii, planes=self.planes)
        change = {"scene": {"bodies_file": grown}, "time": {"steps": 500}, "solver": {"tolerance": 1e-3}}
        without, run = each(self.run_here, [("deep without", change, WITHOUT), ("deep", change)])
        history, free = run.history(), without.history()
        self.assertGreater(free["max_overlap"][-1], 0.19 * RADIUS)
        self.assertLess(history["max_overlap"].max(), 1.5 * history["max_overlap"][0])
        self.assertLess(history["max_overlap"][-1], KEPT * ALLOWED)
        overlap, beyond = final_overlaps(run, low=[0.0, 0.0])
        self.assertLess(max(overlap, beyond), KEPT * ALLOWED)
        self.assertLess(history["kinetic_energy"].max(), 4.0 * free["kinetic_energy"].max())
        self.assertLess(history["kinetic_energy"].max(), 0.01 * self.unit)
        # the projection has lifted the packing, and gave it no velocity
        self.assertGreater(history["potential_energy"][-1] - history["potential_energy"][0], self.unit)

    def glued_piston(self, name, more=None, ranks=1):
        """Disks that overlap each other, glued ones below and above: the upper ones are a piston that a force moves."""
        x, y = RADIUS * (2 * np.arange(10) + 1), 1.8 * RADIUS * np.arange(1, 7)
        free = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
        rows = [np.stack([x, np.full(10, height)], axis=1) for height in (0.0, y[-1] + 1.8 * RADIUS)]
        path = grains_file(self.here(name + ".h5"), np.concatenate([*rows, free]), np.full(80, RADIUS),
                           np.repeat([3, 4, 0], [10, 10, 60]))
        boundaries = [{"name": "bottom", "shape": "grains", "group": 3},
                      {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
                      {"name": "right", "shape": "plane", "normal": [-1.0, 0.0], "point": [20.0 * RADIUS, 0.0]},
                      {"name": "lid", "shape": "grains", "group": 4, "free": [False, True], "force": [0.0, -400.0], "mass": 5.0}]
        return self.run_here(name, {"scene": {"bodies_file": path}, "boundary": boundaries, "time": {"steps": 50},
                                    "solver": {"tolerance": 1e-8, "max_iterations": 5000}, "output": {"every": 1}}, more, ranks)

    def test_what_moves(self):
        """Projections move free grains, and a piston with the grains glued to it, along what is free. What moves as prescribed
        stays, here at rest."""
        run, without = each(self.glued_piston, [("glued piston",), ("glued piston without", WITHOUT)])
        moved, unmoved = run.results(), without.results()
        self.assertEqual(run.history()["projected"][:10].min(), 1)
        bottom, lid, free = slice(0, 10), slice(10, 20), slice(20, 80)
        ways = []
        for step in range(1, 51):
            places, start = (moved[f"/steps/{k}/bodies/position"] for k in (step, 0))
            self.assertTrue(np.array_equal(places[bottom], start[bottom]))
            before, now = (moved[f"/steps/{k}/boundaries/position"] for k in (step - 1, step))
            velocity = [moved[f"/steps/{k}/boundaries/velocity"] for k in (step - 1, step)]
            by_velocity = 0.5e-3 * (velocity[0] + velocity[1])[:, :2]
            np.testing.assert_allclose((now - before)[:3], by_velocity[:3], rtol=0.0, atol=1e-15)
            np.testing.assert_allclose((now - before)[3, 0], 0.0, rtol=0.0, atol=0.0)
            ways.append((now - before - by_velocity)[3, 1])
            # rigid, the sum of two roundings a step
            np.testing.assert_allclose(places[lid] - start[lid], np.tile(now[3] - moved["/steps/0/boundaries/position"][3], (10, 1)),
                                       rtol=0.0, atol=1e-14)
        # up, at most half the alert distance a step, a tenth of the radius
        self.assertGreater(sum(ways), 0.2 * RADIUS)
        self.assertLess(np.abs(ways).max(), 0.05 * RADIUS * (1.0 + 1e-9))
        first = [results["/steps/1/bodies/position"][free] for results in (moved, unmoved)]
        self.assertGreater(np.abs(first[0] - first[1]).max(), 0.02 * RADIUS)
        self.assertLess(np.linalg.norm(first[0] - first[1], axis=1).max(), 0.05 * RADIUS * (1.0 + 1e-9))
        for name in ("bodies", "boundaries"):
            self.assertTrue(np.array_equal(moved[f"/steps/1/{name}/velocity"], unmoved[f"/steps/1/{name}/velocity"]))
        places = moved["/steps/50/bodies/position"]
        self.assertTrue(np.all((places[free, 0] > 0.0) & (places[free, 0] < 20.0 * RADIUS)))
        self.assertLess(places[free, 1].max(), places[lid, 1].max())

    def pressed(self, name, more=None, ranks=1):
        """168 disks at rest between a floor, smooth sides and a lid that a pressure moves, which bears five times their weight."""
        width, top = self.small_planes[2][0][0], (self.small_centres[:, 1] + self.small_radii).max()
        path = grains_file(self.here(name + ".h5"), self.small_centres, self.small_radii)
        boundaries = [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0], "friction": 0.3},
                      {"name": "left", "shape": "plane", "normal": [1.0, 0.0], "friction": 0.0},
                      {"name": "right", "shape": "plane", "normal": [-1.0, 0.0], "point": [width, 0.0], "friction": 0.0},
                      {"name": "lid", "shape": "plane", "normal": [0.0, -1.0], "point": [0.0, top], "free": [False, True],
                       "pressure": PRESSURE, "mass": 20.0}]
        return self.run_here(name, {"scene": {"bodies_file": path, "overlap_allowed": 0.01 * RADIUS}, "boundary": boundaries,
                                    "time": {"step": 2e-3, "steps": 3000}, "output": {"boundary_forces": True}}, more, ranks)

    def test_pressed(self):
        """Under a lid, for long, at a loose tolerance: overlaps stay as they do without one, and the lid bears what it did."""
        kept, without = (run.history() for run in each(self.pressed, [("pressed",), ("pressed without", WITHOUT)]))
        half, allowed = len(kept["step"]) // 2, 0.01 * RADIUS
        late = slice(half, None)
        self.assertGreater(without["max_overlap"][-1], 10.0 * allowed)
        self.assertGreater(kept["projected"][late].mean(), 0.5)
        self.assertLess(np.quantile(kept["max_overlap"][late], 0.95), KEPT * allowed)
        # a solve that is accepted without a sweep may push some grain in, for a step or two
        self.assertLess(kept["max_overlap"][late].max(), 6.0 * allowed)
        # projections give no velocity: at rest, but for what a loose solve leaves, with and without
        mass = DENSITY * np.pi * (self.small_radii**2).sum()
        for history in (kept, without):
            self.assertLess(history["kinetic_energy"][late].mean(), 0.01 * mass * 9.81 * RADIUS)
            self.assertLess(np.abs(history["energy_error"]).max(), 1e-10 * mass * 9.81 * RADIUS)
        self.assertLess(kept["kinetic_energy"][late].mean(), 4.0 * without["kinetic_energy"][late].mean())
        # so the mean forces on lid and floor are those that keep the momentum: |change| <= sqrt(2 m E) at both ends
        seconds = 2e-3 * (len(kept["step"]) - half)
        width = self.small_planes[2][0][0]
        change = np.sqrt(2.0 * mass * kept["kinetic_energy"]) + np.sqrt(2.0 * 20.0 * kept["kinetic_boundaries"])
        slack = (change[half - 1] + change[-1]) / seconds + 1e-9
        lid, floor = (kept[f"force_y:{name}"][late].mean() for name in ("lid", "floor"))
        self.assertLess(abs(lid - PRESSURE * width), slack)
        self.assertLess(abs(-floor - lid - mass * 9.81), slack)
        self.assertLess(slack, 0.01 * PRESSURE * width)
        # the lid is where it is without: the overlaps that are gone do not lift it by a radius
        self.assertLess(abs(kept["position_y:lid"][-1] - without["position_y:lid"][-1]), RADIUS)

    def test_ranks_under_pistons(self):
        """The same bits on 1 and 2 ranks, and on 4 in `./gravier test long`, of which some know the lid by hearsay; a plane, and glued grains."""
        grid = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 8, "grid": [2, 4]}, "time": {"steps": 30}}
        for build, more in ((self.glued_piston, {"solver": {"tolerance": 1e-3}, "time": {"steps": 15}}),
                            (self.pressed, {"scene": {"overlap_allowed": 1e-3 * RADIUS}, "output": {"every": 10}})):
            runs = each(build, [(f"{build.__name__} {ranks}", merged(grid, more), ranks) for ranks in SOME_RANKS])
            self.assertGreater(runs[0].history()["projected"].sum(), 10)
            for run in runs[1:]:
                self.assertEqual([name for name in differences(runs[0].results(), run.results()) if not name.startswith("/run")], [])

    def test_periodic(self):
        """Overlaps across the sides of a cell are undone as those within: a lattice of 10 by 6 disks that overlap by a tenth."""
        period = np.array([10 * 2.1 * RADIUS, 6 * 2.1 * RADIUS])
        rng = np.random.default_rng(5)
        centres = np.stack(np.meshgrid(2.1 * RADIUS * np.arange(10), 2.1 * RADIUS * np.arange(6), indexing="ij"), -1).reshape(-1, 2)
        centres = np.mod(centres + rng.uniform(-0.2, 0.2, centres.shape) * RADIUS, period)
        path = grains_file(self.here("cell.h5"), centres, np.full(60, RADIUS))
        change = {"scene": {"bodies_file": path, "period": [*period, 0.0], "gravity": [0.0, 0.0]}, "time": {"steps": 100},
                  "decomposition": {"subdomains": 2}, "solver": {"method": "nscdd"}}
        run, without = each(self.run_here, [("cell", change), ("cell without", change, WITHOUT)])
        self.assertGreater(final_overlaps(without, period)[0], 0.1 * RADIUS)
        self.assertLess(final_overlaps(run, period)[0], KEPT * ALLOWED)
        # nothing moves it: no velocity at all
        self.assertEqual(run.history()["kinetic_energy"].max(), 0.0)


if __name__ == "__main__":
    unittest.main()
