"""Balances of bodies with shapes: energies and works of impacts, of drives and of projections of overlaps; the stress of stacks and of
blocks under pressure, the forces on boundaries, and neighbours."""
import re
import unittest

import numpy as np

from gravier_runs import RunTestCase, each, merged, run_case
from shaped_scenes import body, box, lattice, prepare, shaped_case

DENSITY = 2500.0
SQUARE = {2: "shape block\npolygon -0.1 -0.1  0.1 -0.1  0.1 0.1  -0.1 0.1\n", 3: "shape block\nbox 0.2 0.2 0.2\n"}
FLAT_TURN = {2: 0.0, 3: [1.0, 0.0, 0.0, 0.0]}
TERMS = ("kinetic_translation", "kinetic_rotation", "kinetic_boundaries", "load_work", "boundary_work", "dissipated_normal",
         "dissipated_friction", "carried_away")


def up(dimension, height):
    return [0.0] * (dimension - 1) + [height]


def ground(dimension, **more):
    return {"shape": "plane", "point": [0.0] * dimension, "normal": up(dimension, 1.0), **more}


class ShapeBalances(RunTestCase):

    def play(self, title, dimension, rows, boundaries=(), *parts, ranks=1, library=None):
        directory = prepare(self.here(title), dimension, rows, library)
        run = run_case(shaped_case(dimension, boundaries, *parts), ranks, directory)
        self.assert_status(run, 0)
        return run

    def check_energy(self, run):
        """The balance closes to rounding: a rounding of the turnover a step."""
        history = run.history()
        turnover = sum(np.abs(history[name]) for name in TERMS)
        steps = history["step"]
        np.testing.assert_array_less(np.abs(history["energy_error"]), 8 * np.finfo(float).eps * (steps + 10) * turnover)
        off, turned = (float(number) for number in re.search(r"energy +balance off by (\S+) J; the sizes of its terms sum up to (\S+) J", run.stdout).groups())
        self.assertLess(off, 8 * np.finfo(float).eps * (steps[-1] + 10) * turned)
        self.assertGreater(history["dissipated_normal"][-1] + history["dissipated_friction"][-1], 1e-3 * turnover[-1])
        return history

    def test_energy(self):
        """Pours with restitution and friction, with overlaps that are projected, by subdomains, in a drum that turns."""
        energy = {"scene": {"friction": 0.3}, "output": {"energy": True}, "time": {"steps": 300}}
        returned = merged(energy, {"scene": {"restitution": 0.4, "tangential_restitution": 0.3, "overlap_allowed": 1e-5},
                                   "solver": {"method": "newton"}})
        parts = merged(energy, {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}, "scene": {"overlap_allowed": 1e-5}})
        drums = {2: {"shape": "circle", "point": [0.4, 0.4], "radius": 0.7, "rotation": [2.0]},
                 3: {"shape": "cylinder", "point": [0.3, 0.0, 0.4], "axis": [0.0, 1.0, 0.0], "radius": 0.6, "rotation": [0.0, 2.0, 0.0]}}
        for dimension in (2, 3):
            counts = (5, 4) if dimension == 2 else (3, 2, 3)
            rows, walls = lattice(counts, spacing=0.19), box(counts, 0.19)
            drum = [drums[dimension]] + [wall for wall in walls if dimension == 3 and abs(wall["normal"][1]) > 0.5]
            jobs = [(f"returned {dimension}", walls, returned), (f"parts {dimension}", walls, parts), (f"drum {dimension}", drum, energy)]
            runs = each(lambda title, walls, part, dimension=dimension, rows=rows: self.play(title, dimension, rows, walls, part), jobs)
            for (title, _, _), run in zip(jobs, runs):
                with self.subTest(title):
                    history = self.check_energy(run)
                    if title.startswith("drum"):
                        self.assertGreater(np.abs(history["boundary_work"]).max(), 1e-3 * history["load_work"].max())
                    else:
                        self.assertGreater(history["projected"].sum(), 5)

    def test_tumbling(self):
        """A polyhedron that spins and strikes the ground: what it loses is what the contact dissipates, and without friction and with
        restitution 1 it loses nothing."""
        rows = [body("askew", [0.0, 0.0, 0.3], [1.0, 0.3, 0.2, 0.1], [0.5, 0.0, -2.0], [6.0, -4.0, 9.0])]
        for title, friction, restitution in (("rebound", 0.0, 1.0), ("rough", 0.4, 0.5)):
            run = self.play(title, 3, rows, [ground(3)], {"scene": {"friction": friction, "restitution": restitution, "overlap_projection": False},
                                                         "time": {"steps": 400}, "output": {"energy": True},
                                                         "solver": {"method": "newton", "accuracy": 1e-9}})
            history = run.history()
            self.assertGreater(history["contacts"].sum(), 0)
            turnover = sum(np.abs(history[name]) for name in TERMS).max()
            self.assertLess(np.abs(history["energy_error"]).max(), 1e-12 * turnover)
            lost = history["dissipated_normal"][-1] + history["dissipated_friction"][-1]
            if restitution < 1.0:
                self.assertGreater(lost, 1e-2 * turnover)
            else:
                self.assertLess(abs(lost), 1e-9 * turnover)

    def test_stack(self):
        """Blocks on each other at rest: the ground carries their weight, the stress is that of the weights above, each block has as many
        neighbours as it touches bodies, and the volume is that of the blocks."""
        n, side = 4, 0.2
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                rows = [body("block", up(dimension, side * (k + 0.5)), FLAT_TURN[dimension]) for k in range(n)]
                run = self.play(f"stack {dimension}", dimension, rows, [ground(dimension)], {
                    "time": {"steps": 5}, "solver": {"method": "newton", "criterion": "residual", "tolerance": 1e-12},
                    "output": {"stress": True, "structure": True, "boundary_forces": True}}, library=SQUARE[dimension])
                history, results = run.history(), run.results()
                weight = 9.81 * DENSITY * side**dimension
                np.testing.assert_allclose(results["/steps/5/boundaries/force"][0], up(dimension, -n * weight), atol=1e-9 * weight)
                # force on the block by the one below times the way from there, over the volume; half of it at the ground
                vertical = sum(weight * (n - k) * (0.5 * side if k == 0 else side) for k in range(n)) / (n * side**dimension)
                axis = "xyz"[dimension - 1]
                self.assertAlmostEqual(history[f"stress_{axis}{axis}"][-1] / vertical, 1.0, delta=1e-9)
                self.assertLess(abs(history["stress_xx"][-1]), 1e-9 * vertical)
                self.assertAlmostEqual(history["volume"][-1] / (n * side**dimension), 1.0, delta=1e-9)
                self.assertAlmostEqual(history["solid_fraction"][-1], 1.0, delta=1e-9)
                self.assertAlmostEqual(history["coordination"][-1], (2 * (n - 1) + 1) / n, delta=1e-12)
                self.assertAlmostEqual(history["mechanical_coordination"][-1], (2 * (n - 1) + 1) / n, delta=1e-12)
                self.assertEqual(history["rattlers"][-1], 0)

    def test_pressure(self):
        """A block between a ground and a lid that a pressure drives has that stress, on 1 rank and in two subdomains."""
        pressure = 4000.0
        for dimension in (2, 3):
            rows = [body("block", up(dimension, 0.1), FLAT_TURN[dimension])]
            lid = {"shape": "plane", "point": up(dimension, 0.2), "normal": up(dimension, -1.0), "mass": 3.0,
                   "free": [False] * (dimension - 1) + [True], "force": up(dimension, -pressure * 0.2 ** (dimension - 1))}
            run = self.play(f"pressed {dimension}", dimension, rows, [ground(dimension), lid], {
                "scene": {"gravity": [0.0] * dimension, "friction": 0.3}, "time": {"steps": 20},
                "solver": {"method": "newton", "criterion": "residual", "tolerance": 1e-12},
                "output": {"stress": True, "boundary_forces": True}}, library=SQUARE[dimension])
            axis = "xyz"[dimension - 1]
            history = run.history()
            self.assertAlmostEqual(history[f"stress_{axis}{axis}"][-1] / pressure, 1.0, delta=1e-6)
            force = run.results()["/steps/20/boundaries/force"]
            np.testing.assert_allclose(force[0], -force[1], rtol=1e-8, atol=1e-6)


if __name__ == "__main__":
    unittest.main()
