"""Rolling and pivoting resistance and tangential restitution against formulas, in whole runs; neutral values; ranks and subdomains.
Moreau-Jean stepping takes constant forces and moments exactly, so that what rolls or spins is right to round-off in each step but the
one in which it stops."""
import os
import re
import unittest

import numpy as np

from gravier_runs import SOME_RANKS, contents, differences, gravier, read_csv
from small_scenes import EPS, G, INERTIA, Grain, SmallScene, floats, plane

RADIUS, MASS = 0.05, 0.7


class Rolling(SmallScene):

    def on_incline(self, title, dimension, slope, rolling, spin=0.0, **groups):
        """A grain on a plane that gravity makes an incline of tan(angle) = slope; x points down. It touches, and rolls at `spin`."""
        angle = np.arctan(slope)
        gravity = np.zeros(dimension)
        gravity[0], gravity[-1] = G * np.sin(angle), -G * np.cos(angle)
        place, velocity = np.zeros(dimension), np.zeros(dimension)
        place[-1] = RADIUS
        velocity[0] = spin * RADIUS
        # clockwise rolls to the right
        spins = [-spin] if dimension == 2 else [0.0, spin, 0.0]
        record = self.play(title, [Grain(place, velocity, spins, RADIUS, MASS)], [plane(np.zeros(dimension), np.eye(dimension)[-1])], gravity, 100,
                           scene={"friction": 0.9, "rolling_friction": rolling}, output={"every": 1, "contacts": True, "energy": True},
                           **groups)
        spin_of = record.spin[:, 0, :] @ ([-1.0] if dimension == 2 else [0.0, 1.0, 0.0])
        return record, record.velocity[:, 0, 0], spin_of, angle

    def test_on_glued_grains(self):
        """A grain that rolls down a glued grain, from 0.3 rad beside its top: the lever of rolling resistance is R_i R_j/(R_i + R_j)."""
        def check(dimension):
            rolling, begin, small, steps, step = 0.2, 0.3, 0.01, 60, 5e-4
            for radius in (0.01, 0.03):
                length, share = small + radius, rolling * radius / (small + radius)
                zero, place = np.zeros(dimension), np.zeros(dimension)
                place[0], place[-1] = length * np.sin(begin), length * np.cos(begin)
                grains = [Grain(zero, radius=radius, group=1), Grain(place, radius=small, mass=2.0)]
                records = [self.play(f"rolls {dimension} {radius} {order}", grains[::order], [{"shape": "grains", "group": 1}], -G * np.eye(dimension)[-1],
                                     steps, scene={"friction": 0.9, "rolling_friction": rolling}, time={"step": step}) for order in (1, -1)]
                # (1 + k) L a'' = g sin a - mu_r R*/R (g cos a - L a'^2), by the midpoint rule
                angle, rate, parts = begin, 0.0, 20000
                h = steps * step / parts
                for _ in range(parts):
                    angle += 0.5 * h * rate
                    rate += h * (G * np.sin(angle) - share * (G * np.cos(angle) - length * rate**2)) / ((1 + INERTIA[dimension]) * length)
                    angle += 0.5 * h * rate
                speeds = [np.linalg.norm(record.velocity[-1, free]) for record, free in zip(records, (1, 0))]
                self.verify(f"{dimension}D grain on a glued one of radius {radius}, in both orders", "speed [m/s]", speeds, length * rate, 5e-3 * length * rate)
        self.both(check)

    def test_incline(self):
        """It rolls iff tan(angle) > rolling friction, then with a = g (sin - mu_r cos)/(1 + I/(m R^2)), without sliding."""
        def check(dimension):
            for slope, rolling in ((0.2, 0.19), (0.2, 0.21)):
                record, speed, spin, angle = self.on_incline(f"incline {dimension} {slope} {rolling}", dimension, slope, rolling,
                                                             solver={"warm_start": True, "tolerance": 1e-11})
                a = max(0.0, G * (np.sin(angle) - rolling * np.cos(angle))) / (1 + INERTIA[dimension])
                case = f"{dimension}D grain on an incline of {slope}, rolling friction {rolling}"
                # a solve ends at 1e-13 of the impulses m g h
                tolerance = self.rounding(record, speed[-1] + 1.0) + 100 * 1e-12 * G * self.step
                self.verify(case, "velocity [m/s]", speed, a * record.time, tolerance)
                self.verify(case, "R spin [m/s]", RADIUS * spin, a * record.time, tolerance)
                # the balance of energies closes, and resistance does no work on what rests
                table = record.run.history()
                self.verify(case, "balance of energies [J]", table["energy_error"], 0.0, 1e-12)
                moment = record.contacts[-1]["moment"]
                if dimension == 3:
                    self.assertLess(abs(moment[0, 0]), 1e-12, "about the normal")
                # moments are kept from step to step: without them 9 and 10 iterations
                self.assertLessEqual(table["iterations"][2:].max(), 1)
                largest = rolling * RADIUS * MASS * G * np.cos(angle) * self.step
                if a > 0:
                    self.verify(case, "moment over its bound", np.abs(moment).sum() / largest, 1.0, 1e-9)
                else:
                    self.verify(case, "moment [N m s]", np.abs(moment).sum(), MASS * G * np.sin(angle) * RADIUS * self.step, 1e-9 * RADIUS)
        self.both(check)

    def test_slowing(self):
        """What rolls on a level plane slows down by mu_r g/(1 + I/(m R^2)) and rests after that for good."""
        def check(dimension):
            rolling, spin = 0.1, 2.0
            record, speed, _, _ = self.on_incline(f"slowing {dimension}", dimension, 0.0, rolling, spin)
            a = rolling * G / (1 + INERTIA[dimension])
            self.assertLess(spin * RADIUS / a, record.time[-1] - 2 * self.step)
            self.verify(f"{dimension}D grain rolling on a plane, rolling friction {rolling}", "velocity [m/s]", speed,
                        np.maximum(0.0, spin * RADIUS - a * record.time), self.rounding(record, 1.0) + 1e-11)
        self.both(check)

    def test_pivoting(self):
        """A sphere that spins about the normal stops after I w/(mu_p R m g); rolling friction alone does not hold it."""
        spin, start = 20.0, Grain((0, 0, RADIUS), None, (0, 0, 20.0), RADIUS, MASS)
        for pivoting in (0.2, 0.0):
            record = self.play(f"pivoting {pivoting}", [start], [plane((0, 0, 0), (0, 0, 1))], (0, 0, -G), 120,
                               scene={"friction": 0.3, "rolling_friction": 0.1, "pivoting_friction": pivoting}, output={"every": 1})
            rate = pivoting * RADIUS * MASS * G / (INERTIA[3] * MASS * RADIUS ** 2)
            if pivoting > 0:
                self.assertLess(spin / rate, record.time[-1] - 2 * self.step)
            self.verify(f"sphere spinning on a plane, pivoting friction {pivoting}", "spin [rad/s]", record.spin[:, 0, 2],
                        np.maximum(0.0, spin - rate * record.time), self.rounding(record, 20 * spin) + 1e-9)

    def test_unequal(self):
        """Two grains of unequal radii strike head on, without friction, and spin: each spin changes by mu_r R* r_n/I, R* = R1 R2/(R1 +
        R2), or both meet at the common spin."""
        def check(dimension):
            radii, masses, spins, v = (0.05, 0.02), (0.7, 0.05), (8.0, -3.0), 0.4
            axis = np.array([1.0]) if dimension == 2 else np.array([0.0, 0.6, 0.8])
            normal = np.eye(dimension)[0]
            inertia = [INERTIA[dimension] * m * r ** 2 for m, r in zip(masses, radii)]
            grains = [Grain(np.zeros(dimension), v * normal, spins[0] * axis, radii[0], masses[0]),
                      Grain(sum(radii) * normal, -v * normal, spins[1] * axis, radii[1], masses[1])]
            star = radii[0] * radii[1] / sum(radii)
            impulse = 2 * v / (1 / masses[0] + 1 / masses[1])
            for rolling in (0.01, 5.0):
                record = self.play(f"unequal {dimension} {rolling}", grains, steps=2,
                                   scene={"friction": 0.0, "rolling_friction": rolling, "pivoting_friction": 0.0}, output={"every": 1})
                most = (spins[0] - spins[1]) / (1 / inertia[0] + 1 / inertia[1])
                moment = min(most, rolling * star * impulse)
                self.assertEqual(moment == most, rolling == 5.0)
                for k, sign in ((0, -1), (1, 1)):
                    self.verify(f"{dimension}D grains of unequal radii strike, rolling friction {rolling}", f"spin of grain {k + 1} [rad/s]",
                                record.spin[-1, k], (spins[k] + sign * moment / inertia[k]) * axis, 1e-9)
        self.both(check)

    def test_drum(self):
        """Rolling friction acts on the spin relative to that of a boundary: a disk pressed on a wheel of many times its bound turns
        with it, and without tangential friction is driven by the moment alone."""
        record = self.play("wheel", [Grain((0, RADIUS))], [plane((0, 0), (0, 1), rotation=3.0)], (0, -G), 1,
                           scene={"friction": 0.0, "rolling_friction": 50.0}, output={"every": 1, "energy": True})
        self.verify("disk on a plane that turns, rolling friction alone", "spin [rad/s]", record.spin[-1, 0], 3.0, 1e-9)
        table = record.run.history()
        self.assertGreater(table["kinetic_rotation"][-1], 0.0)
        self.verify("disk on a plane that turns, rolling friction alone", "balance of energies [J]", table["energy_error"], 0.0, 1e-15)


class TangentialRestitution(SmallScene):

    def strike(self, title, dimension, friction, normal, tangential, velocity, spin, **solver):
        place = np.zeros(dimension)
        place[-1] = RADIUS
        record = self.play(title, [Grain(place, velocity, spin, RADIUS, MASS)], [plane(np.zeros(dimension), np.eye(dimension)[-1])], steps=2,
                           scene={"friction": friction, "restitution": normal, "tangential_restitution": tangential,
                                  "overlap_projection": False}, output={"every": 1}, solver=solver)
        return record.velocity[-1, 0], record.spin[-1, 0]

    def test_methods(self):
        """Newton's method and the enriched ones know the tangential shift: sticking and sliding."""
        for friction in (5.0, 0.05):
            found = [self.strike(f"method {friction} {method}", 2, friction, 0.5, 0.6, (0.8, -0.5), 3.0, method=method)
                     for method in ("nlgs", "newton", "nscdd_ep", "schwarz_ec")]
            for velocity, spin in found[1:]:
                self.verify(f"disk strikes a plane, mu {friction}, Newton's method and enriched ones", "velocity and R spin [m/s]",
                            np.append(velocity, RADIUS * spin), np.append(found[0][0], RADIUS * found[0][1]), 1e-10)

    def test_oblique(self):
        """A grain strikes a plane: the point of contact leaves with -e_t of its velocity where it sticks, and with what the cone allows
        where it slides; kinetic energy never grows, and e = e_t = 1 keeps it."""
        def check(dimension):
            k = INERTIA[dimension]
            along = np.array([1.0]) if dimension == 2 else np.array([0.6, -0.8])
            for friction, normal, tangential in ((5.0, 0.0, 0.6), (5.0, 1.0, 1.0), (0.05, 0.5, 0.6)):
                speed, down, turn = 0.8, 0.5, 3.0
                # turn about the axis that carries the lowest point the same way as the centre
                axis = np.array([1.0]) if dimension == 2 else np.array([-along[1], along[0], 0.0]) * -1.0
                velocity = np.append(speed * along, -down)
                after, spin = self.strike(f"oblique {dimension} {friction} {normal} {tangential}", dimension, friction, normal, tangential,
                                          velocity, turn * axis)
                # velocity of the lowest point: v + w x (-R n)
                slip = speed + turn * RADIUS * (1.0 if dimension == 2 else np.cross(axis, [0, 0, -1])[:2] @ along)
                wanted = (1 + tangential) * slip / (1 / MASS + 1 / (k * MASS))
                impulse = min(wanted, friction * MASS * (1 + normal) * down)
                case = f"{dimension}D grain strikes a plane, mu {friction}, e {normal}, e_t {tangential}"
                self.verify(case, "velocity [m/s]", after, np.append((speed - impulse / MASS) * along, normal * down), 1e-12)
                lever = 1.0 if dimension == 2 else np.cross(axis, [0, 0, -1])[:2] @ along
                self.verify(case, "spin [rad/s]", spin, (turn - lever * impulse / (k * MASS * RADIUS)) * axis, 1e-11)
                before = 0.5 * MASS * (velocity @ velocity + k * (RADIUS * turn) ** 2)
                energy = 0.5 * MASS * (after @ after + k * RADIUS ** 2 * spin @ spin)
                self.assertLessEqual(energy, before * (1 + 1e-12))
                if normal == tangential == 1.0:
                    self.verify(case, "kinetic energy over that before", energy / before, 1.0, 1e-12)
        self.both(check)

    def test_energy(self):
        """Many grains in a box without gravity, e = e_t: no shock gives energy, whatever strikes whatever."""
        def check(dimension):
            generator = np.random.default_rng(7)
            n = 4 if dimension == 2 else 3
            grains = [Grain(0.11 * (np.array(place) + 1.0), generator.normal(size=dimension), 20 * generator.normal(size=2 * dimension - 3),
                            0.05, generator.uniform(0.2, 1.0)) for place in np.ndindex(*[n] * dimension)]
            size = 0.11 * (n + 1)
            walls = [plane(size * side * np.eye(dimension)[d], (1 - 2 * side) * np.eye(dimension)[d])
                     for d in range(dimension) for side in (0, 1)]
            e = 0.6 if dimension == 2 else 1.0
            record = self.play(f"box {dimension}", grains, walls, steps=150,
                               scene={"friction": 0.4, "restitution": e, "tangential_restitution": e, "overlap_projection": False},
                               output={"every": 0, "energy": True}, solver={"tolerance": 1e-11, "max_iterations": 50000})
            table = record.run.history()
            energy = table["kinetic_translation"] + table["kinetic_rotation"]
            self.assertTrue(np.all(np.diff(energy) <= 1e-9 * energy[0]), f"{dimension}D e = {e}: energy grows")
            self.assertLess(energy[-1], 0.999 * energy[0])
        self.both(check)


class Restitution(SmallScene):

    def test_weight_ends_a_rebound(self):
        """Balls fall for five steps and spring back with e = 1/5, at the speed that their weight takes away in the next step: free,
        they come to rest but for rounding, of either sign, which no solve gets below, and no contact asks for more."""
        def check(dimension):
            up, along = np.eye(dimension)[-1], np.eye(dimension)[0]
            balls = [Grain((0.05 + 13.0 * G * self.step**2) * up + 0.2 * k * along, mass=0.3 + 0.17 * k) for k in range(9)]
            record = self.play(f"end of a rebound {dimension}", balls, [plane(0 * up, up)], -G * up,
                               steps=10, scene={"restitution": 0.2},
                               solver={"tolerance": 1e-6, "check_every": 10, "warm_start": True, "max_iterations": 100, "acceleration": "none"})
            weight = G * self.step
            rounded = 40 * EPS * weight
            self.verify(f"{dimension}D ball", "speed after the rebound [m/s]", record.velocity[6] @ up, weight, rounded)
            self.verify(f"{dimension}D ball", "speed once the weight has taken it away [m/s]", record.velocity[7] @ up, 0.0, rounded)
            self.assertLessEqual(record.run.history()["residual"].max(), 1e-6)
        self.both(check)


class Neutral(SmallScene):
    """An effect with a value too small to count: 1e-300 chooses its kernels, and every trajectory keeps its bits. What stands for
    round-off is the 1e-300 themselves."""

    def pile(self, title, dimension, ranks=1, extra=(), steps=40, ground=(), sides=True, speed=0.0, spin=None, **scene):
        """Grains on the ground, a plane that may have more keys, between side walls that may be left out."""
        generator = np.random.default_rng(3)
        n = (5, 6) if dimension == 2 else (3, 3, 3)
        grains = [Grain(0.0501 + 0.1 * np.array(place) + 0.0002 * generator.uniform(size=dimension), None, spin,
                        generator.uniform(0.045, 0.05)) for place in np.ndindex(*n)]
        for grain in grains if speed > 0.0 else ():
            grain.velocity = [float(v) for v in speed * generator.normal(size=dimension)]
        walls = [plane(np.zeros(dimension), np.eye(dimension)[-1], **dict(ground))]
        walls += [plane(0.1003 * n[d] * side * np.eye(dimension)[d], (1 - 2 * side) * np.eye(dimension)[d])
                  for d in range(dimension - 1) for side in (0, 1) if sides]
        groups = dict(extra)
        walls += groups.pop("boundary", [])
        gravity = scene.pop("gravity", np.append(np.zeros(dimension - 1), -G))
        solver = {"tolerance": 1e-6, "check_every": 10, "warm_start": True, **groups.pop("solver", {})}
        return self.play(title, grains, walls, gravity, steps, ranks, scene=scene, solver=solver,
                         output={"every": 10, "contacts": True}, **groups)

    def test_values(self):
        tiny = 1e-300
        pairs = {
            "friction": ({"friction": 0.0}, {"friction": tiny}),
            "rolling": ({"friction": 0.4}, {"friction": 0.4, "rolling_friction": tiny}),
            "tangential": ({"friction": 0.4, "restitution": 0.5}, {"friction": 0.4, "restitution": 0.5, "tangential_restitution": tiny}),
            # a law with restitution acts from touching on: so does one without, where nothing else is a contact
            "restitution": ({"friction": 0.4, "alert_distance": 0.0}, {"friction": 0.4, "alert_distance": 0.0, "restitution": tiny}),
            "body force": ({"friction": 0.4}, {"friction": 0.4, "body_force": [tiny]}),
        }

        def check(dimension):
            for name, scenes in pairs.items():
                if dimension == 3 and name in ("restitution", "body force"):
                    continue
                scenes = [{key: value * dimension if key == "body_force" else value for key, value in scene.items()} for scene in scenes]
                plain, forced = [self.pile(f"neutral {dimension} {name} {k}", dimension, **scene) for k, scene in enumerate(scenes)]
                self.assertTrue(np.abs(plain.all_velocities[-1]).max() > 1e-4, name)
                for quantity in ("position", "all_velocities"):
                    self.assertEqual(np.abs(getattr(plain, quantity) - getattr(forced, quantity)).max() > 1e-290, False, f"{name} {quantity}")
                self.assertLessEqual(len(plain.contacts[-1]["gap"]), len(forced.contacts[-1]["gap"]))
        self.both(check)

    def test_motions_and_loads(self):
        """What moves by nothing, a cell that nothing crosses, loads of nothing, sleep that nothing falls into."""
        tiny = 1e-300

        def check(dimension):
            up, along = np.eye(dimension)[-1], np.eye(dimension)[0]
            outlet = {"shape": "outlet", "point": floats(-5.0 * up), "normal": floats(up)}
            turn = [tiny] if dimension == 2 else floats(tiny * along)
            weightless = {"gravity": np.zeros(dimension), "speed": 0.3, "friction": 0.4}
            plain = {"friction": 0.4}
            # effects that the log names, what both runs have, what one of them has more
            pairs = {
                "drives": (plain, {"ground": {"velocity": floats(tiny * along)}}),
                "drives, a table": (plain, {"ground": {"table": "still.csv"}, "extra": {"files": {"still.csv": "time,vx\n0,0\n1,0\n"}}}),
                "drives, turning": (plain, {"ground": {"rotation": turn}}),
                "driven by forces": (plain, {"ground": {"free": [True] + [False] * (dimension - 1), "mass": 1e30}}),
                "periodic images": ({**plain, "sides": False}, {"period": [64.0] + [0.0] * (dimension - 1)}),
                "gravity": (weightless, {"gravity": tiny * along}),
                "rotation": ({"friction": 0.0}, {"spin": [tiny] * (2 * dimension - 3)}),
                "removal": (plain, {"extra": {"boundary": [outlet]}}),
                # no grain of the mean radius or more enters before the end
                "insertion": (plain, {"extra": {"insertion": [{"lower": [0.0] * dimension, "upper": [9.0] * dimension, "radius": 0.049,
                                                               "start": 1e6}]}}),
                "sleeping": (plain, {"extra": {"solver": {"sleeping": True, "sleep_after": 1, "sleep_speed": tiny}}}),
            }
            for name, (common, more) in pairs.items():
                without, run = [self.pile(f"neutral {dimension} {name} {k}", dimension, **{**common, **change})
                                for k, change in enumerate(({}, more))]
                with self.subTest(name):
                    # the run has the effect, the other one does not
                    said = [re.search(r"^effects +(.*(?:\n {6,}.*)*)", record.run.stdout, re.M)[1] for record in (without, run)]
                    if name == "sleeping":
                        self.assertEqual(run.run.history()["sleeping"].sum(), 0)
                    else:
                        self.assertEqual([name.split(",")[0] in words for words in said], [False, True], said)
                    self.assertGreater(np.abs(without.all_velocities[-1]).max(), 1e-4)
                    for quantity in ("position", "all_velocities"):
                        apart = np.abs(getattr(without, quantity) - getattr(run, quantity)).max()
                        # what pushes a boundary of 1e30 kg lets it move at all
                        self.assertLess(apart, 1e-30 if name == "driven by forces" else 1e-290, quantity)
        self.both(check)

    ALL = {"friction": 0.4, "restitution": 0.3, "tangential_restitution": 0.3, "rolling_friction": 0.1}

    def everything(self, dimension):
        return {**self.ALL, **({"pivoting_friction": 0.05} if dimension == 3 else {})}

    def test_ranks(self):
        """The same bits on 1 and 2 ranks, and on 4 in `./gravier test long`, impulses and moments in four subdomains that are cut anew."""
        def check(dimension):
            found = []
            for ranks in SOME_RANKS:
                record = self.pile(f"ranks {dimension} {ranks}", dimension, ranks, extra={
                    "solver": {"method": "nscdd", "tolerance": 1e-4}, "decomposition": {"subdomains": 4, "partition": "grid", "repartition_every": 15}},
                    **self.everything(dimension))
                self.assertGreater(np.abs(record.contacts[-1]["moment"]).max(), 0.0)
                found.append({name: value for name, value in record.run.results().items() if not name.startswith("/run")})
            for other in found[1:]:
                self.assertEqual(differences(found[0], other), [])
        self.both(check)

    def test_subdomains(self):
        """NSCDD in four subdomains ends where NLGS does: both at 1e-11 of the impulses, in ten steps of 27 or 30 grains."""
        def check(dimension):
            # shocks at restitution end in one of several ways
            laws = {**self.everything(dimension), "restitution": 0.0, "tangential_restitution": 0.0}
            runs = [self.pile(f"method {dimension} {method}", dimension, extra={
                "solver": {"method": method, "tolerance": 1e-11, "max_iterations": 100000},
                "decomposition": {"subdomains": 1 if method == "nlgs" else 4}}, steps=10, **laws)
                for method in ("nlgs", "nscdd")]
            self.verify(f"{dimension}D pile with rolling and pivoting friction, NSCDD in 4 subdomains", "velocities [m/s]", runs[1].all_velocities[-1],
                        runs[0].all_velocities[-1], 1e-6)
        self.both(check)

    def test_restart(self):
        """A run that goes on from a checkpoint has the bits of one that was not interrupted: moments are in it."""
        whole = self.pile("whole", 3, steps=20, **self.everything(3))
        half = self.pile("half", 3, steps=10, **self.everything(3), extra={})
        case = os.path.join(half.run.directory, "case.nml")
        with open(case, encoding="ascii") as file:
            text = file.read()
        with open(case, "w", encoding="ascii") as file:
            file.write(text.replace("steps = 10", "steps = 20"))
        run = gravier("--restart", "case.nml", directory=half.run.directory)
        self.assert_status(run, 0)
        found = [contents(os.path.join(directory, "results", "results.h5")) for directory in (whole.run.directory, half.run.directory)]
        found = [{name: value for name, value in one.items() if name.startswith("/steps/20")} for one in found]
        self.assertIn("/steps/20/contacts/moment", found[0])
        self.assertEqual(differences(*found), [])


if __name__ == "__main__":
    unittest.main()
