"""Bonded bodies that nothing holds, at default settings: they turn as the rigid bodies that they are, however strong their bonds."""
import unittest

import numpy as np
from small_scenes import Grain, SmallScene
from test_run_pair_laws import MASS, RADIUS, law, named

STEP = 1e-3  # s
RATE = 5.0  # rad/s
DEFAULTS = {"criterion": "velocity_error", "tolerance": 0.01, "check_every": 10, "warm_start": True, "max_iterations": 20000}


def lattice(dimension, apart):
    """Centres of 16 disks or 27 spheres, about the origin, each moved by up to a hundredth of a radius: no two gaps are alike."""
    n = 4 if dimension == 2 else 3
    places = [(i + 0.5 * ((j + k) % 2), j * 3**0.5 / 2 + (k % 2) / (2 * 3**0.5), k * (2 / 3)**0.5)[:dimension]
              for k in range(n if dimension == 3 else 1) for j in range(n) for i in range(n)]
    places = (2 * RADIUS + apart) * np.array(places)
    places += np.random.default_rng(5).uniform(-0.01 * RADIUS, 0.01 * RADIUS, places.shape)
    return places - places.mean(axis=0)


class Turning(SmallScene):
    step = STEP

    def turn(self, title, places, axis, strength, steps, rate=RATE, **groups):
        """Bonded grains that turn about their centre with `rate`: their record, and the distances of all pairs at the start and at the end."""
        spin = rate * np.array(axis) / np.linalg.norm(axis)
        dimension = places.shape[1]
        velocities = np.cross(spin, np.pad(places, ((0, 0), (0, 3 - dimension))))[:, :dimension]
        grains = [Grain(place, velocity, spin[2] if dimension == 2 else spin) for place, velocity in zip(places, velocities)]
        bond = law("a", "bonded", bond_strength=strength, bond_friction=1.0, bond_distance=0.2 * RADIUS)
        groups.setdefault("solver", DEFAULTS)
        groups.setdefault("scene", {"overlap_projection": False})
        record = self.play(title, grains, [], None, steps, material=named("a"), law=[bond], output={"every": steps // 10}, **groups)
        first, second = np.triu_indices(len(places), 1)
        distance = np.linalg.norm(record.position[:, first] - record.position[:, second], axis=-1)
        return record, np.abs(distance / distance[0] - 1.0)

    def check_rigid(self, title, record, stretch):
        """Distances stay, energy and angular momentum too: the spin of the rigid body is the same in all states."""
        dimension = record.position.shape[2]
        inertia = (0.5 if dimension == 2 else 0.4) * RADIUS**2
        squares = (record.velocity**2).sum(axis=(1, 2)) + inertia * (record.spin**2).sum(axis=(1, 2))
        place, velocity = (np.pad(values, ((0, 0), (0, 0), (0, 3 - dimension))) for values in (record.position, record.velocity))
        spin = np.pad(record.spin, ((0, 0), (0, 0), (3 - record.spin.shape[2], 0)))
        momentum = (np.cross(place, velocity) + inertia * spin).sum(axis=1)
        self.verify(title, "change of distances", stretch, 0.0, 3e-5)
        self.verify(title, "change of energy", squares / squares[0], 1.0, 1e-5)
        self.verify(title, "change of angular momentum", momentum / np.linalg.norm(momentum[0]), momentum[0] / np.linalg.norm(momentum[0]), 1e-7)

    def test_whatever_the_strength(self):
        """Disks and spheres with gaps and overlaps turn by two radians. With strong bonds they flew apart, and the run said that it had converged."""
        for dimension, axis in ((2, (0, 0, 1)), (3, (1, 2, 3))):
            for strength in (20.0 * MASS, 1e4 * MASS, 1e8 * MASS):
                for apart in (-0.02 * RADIUS, 0.05 * RADIUS):
                    title = f"{dimension}D, bonds of {strength / MASS:g} m, apart by {apart:g} m"
                    with self.subTest(title):
                        record, stretch = self.turn(title, lattice(dimension, apart), axis, strength, 400)
                        self.check_rigid(title, record, stretch)

    def test_projection(self):
        """The overlap of bonded grains is the length of their bond. Projections take it for none, and move bonded grains together where others are
        too deep in them: bodies that overlap grew by a tenth, and gained angular momentum."""
        for dimension, axis in ((2, (0, 0, 1)), (3, (1, 2, 3))):
            title = f"{dimension}D, bodies that overlap, with projections"
            with self.subTest(title):
                record, stretch = self.turn(title, lattice(dimension, -0.1 * RADIUS), axis, 1e4 * MASS, 200, scene={"overlap_projection": True})
                self.check_rigid(title, record, stretch)
                self.assertIn("no step projected overlaps", record.run.stdout)
                self.assertLess(record.run.history()["max_overlap"].max(), 1e-3 * RADIUS)
        # a triangle of bonded disks beside a free one that is too deep in it
        triangle = [[0.0, 0.0], [1.9 * RADIUS, 0.0], [0.95 * RADIUS, 1.7 * RADIUS]]
        grains = [Grain(place, material=1) for place in triangle] + [Grain([0.95 * RADIUS, 3.4 * RADIUS], material=2)]
        bond = law("a", "bonded", bond_strength=1e6 * MASS, bond_friction=1.0, bond_distance=0.2 * RADIUS)
        record = self.play("one too deep", grains, [], None, 40, material=named("a", "b"), law=[bond], solver=DEFAULTS, output={"every": 40})
        self.assertIn("projected in ", record.run.stdout)
        apart = np.linalg.norm(record.position[:, [0, 1, 2]] - record.position[:, [1, 2, 0]], axis=2)
        self.verify("a body of bonded disks that is projected", "distances of its disks [m]", apart[-1], apart[0], 1e-4 * RADIUS)
        self.assertGreater(record.position[-1, 3, 1] - record.position[-1, 2, 1], 1.97 * RADIUS)

    def test_chain(self):
        """Three disks in a row are hinged to each other, and stay a row: 3 turns with 0.094 rad in a step."""
        places = np.array([[-2.0 * RADIUS, 0.0], [0.0, 0.0], [2.0 * RADIUS, 0.0]])
        record, stretch = self.turn("a row", places, (0, 0, 1), 1e6 * MASS, 200, rate=94.0, solver={**DEFAULTS, "accuracy": 1e-6})
        self.verify("a row of three that turns", "change of distances", stretch, 0.0, 1e-8)
        self.verify("a row of three that turns", "speed of the ends", np.linalg.norm(record.velocity[:, ::2], axis=-1), 94.0 * 2.0 * RADIUS, 1e-6)

    def test_places_at_the_end_of_a_step(self):
        """`theta` of 1 and 0.75: of first order elsewhere, but bodies stay together."""
        for theta in (0.75, 1.0):
            record, stretch = self.turn(f"theta {theta}", lattice(2, 0.0), (0, 0, 1), 1e4 * MASS, 400, time={"theta": theta})
            self.verify(f"theta {theta}", "change of distances", stretch, 0.0, 2e-4)

    def test_spheres_that_gear(self):
        """Unequal spheres of a cubic lattice roll on each other as it turns, at tight accuracies: their bonds do not contradict each other, and
        hold, though they bear a tenth of their strength. They broke one after the other."""
        places = 2.2 * RADIUS * np.array([(i, j, k) for k in range(2) for j in range(2) for i in range(3)], dtype=float)
        rng = np.random.default_rng(3)
        places += rng.uniform(-0.02 * RADIUS, 0.02 * RADIUS, places.shape)
        places -= places.mean(axis=0)
        radii = rng.uniform(0.85 * RADIUS, RADIUS, len(places))
        spin = RATE * np.array([3.0, 2.0, -1.0]) / 14**0.5
        grains = [Grain(place, np.cross(spin, place), spin, radius=radius, mass=MASS * (radius / RADIUS)**3) for place, radius in zip(places, radii)]
        near = [(i, j) for i in range(12) for j in range(i) if np.linalg.norm(places[i] - places[j]) < 2.6 * RADIUS]
        self.assertEqual(len(near), 20)
        for accuracy in (0.1, 1e-3, 1e-4):
            record = self.play(f"gearing {accuracy}", grains, [], None, 300, material=named("a"), output={"every": 30},
                               law=[law("a", "bonded", bond_strength=200.0 * MASS, bond_friction=1.0, bond_distance=0.6 * RADIUS)],
                               solver={**DEFAULTS, "accuracy": accuracy})
            mass = np.array([grain.mass for grain in grains])[:, None]
            inertia = 0.4 * mass * radii[:, None]**2
            energy = (mass * record.velocity**2).sum(axis=(1, 2)) + (inertia * record.spin**2).sum(axis=(1, 2))
            self.verify("spheres that gear", f"change of energy, accuracy {accuracy}", energy[-1] / energy[1], 1.0, 2e-3)
            stretch = [np.linalg.norm(record.position[-1, i] - record.position[-1, j]) / np.linalg.norm(places[i] - places[j]) - 1.0 for i, j in near]
            self.verify("spheres that gear", f"change of distances, accuracy {accuracy}", stretch, 0.0, 5e-3)

    def test_subdomains_and_methods(self):
        """The same in subdomains, on two ranks, by the other methods."""
        for method in ("nscdd", "schwarz_ec", "newton"):
            title = f"{method} in space"
            groups = {"solver": {**DEFAULTS, "accuracy": 1e-3, "method": method}}
            if method != "newton":
                groups.update(decomposition={"grid": [2, 2, 1]}, ranks=2)
            record, stretch = self.turn(title, lattice(3, 0.0), (1, 2, 3), 1e4 * MASS, 100, **groups)
            self.check_rigid(title, record, stretch)

    def test_on_boundaries(self):
        """A disk hangs from a disk that is glued to a hub, and one is pressed at a drum, both of which turn: they go round with them, by two turns."""
        turned = 2.0 * 2.0 * np.pi
        steps = round(turned / (RATE * STEP))
        turned = steps * RATE * STEP
        hub = {"name": "hub", "shape": "grains", "group": 1, "material": "a", "rotation": [RATE], "pivot": [0.0, 0.0]}
        drum = {"shape": "circle", "point": [0.0, 0.0], "radius": 21.0 * RADIUS, "rotation": [RATE], "material": "a"}
        bond = law("a", "bonded", bond_strength=1e6 * MASS, bond_friction=1.0, bond_distance=0.2 * RADIUS)
        for title, gap in (("touching", 0.0), ("with a gap", 0.1 * RADIUS)):
            places = {"hub": [(3.0 * RADIUS, 0.0), (5.0 * RADIUS + gap, 0.0)], "drum": [(0.0, 20.0 * RADIUS - gap)]}
            for name, boundary in (("hub", hub), ("drum", drum)):
                grains = [Grain(place, (-RATE * place[1], RATE * place[0]), RATE, group=int(name == "hub" and k == 0))
                          for k, place in enumerate(places[name])]
                record = self.play(f"{name} {title}", grains, [boundary], None, steps, material=named("a"), law=[bond], solver=DEFAULTS, scene={"overlap_projection": False},
                                   output={"every": steps // 8})
                angle = RATE * record.time
                radius = np.hypot(*places[name][-1])
                start = np.arctan2(places[name][-1][1], places[name][-1][0])
                exact = radius * np.stack((np.cos(start + angle), np.sin(start + angle)), axis=-1)
                self.verify(f"{name} {title}", "place over the radius", record.position[:, -1] / RADIUS, exact / RADIUS, 1e-2)
                self.verify(f"{name} {title}", "distance over the radius", np.linalg.norm(record.position[:, -1], axis=-1) / RADIUS, radius / RADIUS, 1e-4)

    def test_log_of_stretched_bonds(self):
        """A chain falls because its solves are given up: bonds open by more than those at which pairs are bonded, and the log says so. Of one
        that hangs it says nothing."""
        for most, status in ((2, 3), (5000, 0)):
            grains = [Grain((0.0, -(2 * k + 1) * RADIUS)) for k in range(40)]
            record = self.play(f"at most {most}", grains, [{"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, -1.0], "material": "a"}],
                               (0.0, -9.81), 400, status=status, scene={"alert_distance": 2e-4}, material=named("a"),
                               law=[law("a", "bonded", bond_strength=1e6, bond_friction=1.0, bond_distance=1e-6)],
                               solver={**DEFAULTS, "max_iterations": most, "check_every": 1, "fallback": "none", "layered_start": False}, output={"every": 0})
            self.assertEqual("intact bonds had gaps beyond those at which pairs are bonded" in record.run.stdout, status == 3)


if __name__ == "__main__":
    unittest.main()
