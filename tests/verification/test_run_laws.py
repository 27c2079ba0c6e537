"""The contact laws against formulas, in whole runs with &boundary planes: rebound, friction of what slides and of what rolls, a
wedge, three balls in a row. Moreau-Jean stepping takes constant forces exactly, so that what slides or rolls is right to
round-off in each step; the time of an impact or of a stop is known to a step."""
import unittest

import numpy as np

from small_scenes import EPS, G, INERTIA, Grain, SmallScene, plane

RADIUS, MASS = 0.05, 0.7


def unit(dimension, axis):
    return np.eye(dimension)[axis]


def inclines(dimension, angle):
    """An incline made by turning gravity, and by turning the plane: (name, normal, way down, gravity)."""
    along, up = unit(dimension, 0), unit(dimension, -1)
    if dimension == 3:
        # the way down lies along neither tangent of the contact
        along = np.array([0.6, -0.8, 0.0])
    yield "gravity", up, along, G * (np.sin(angle) * along - np.cos(angle) * up)
    yield "plane", np.cos(angle) * up + np.sin(angle) * along, np.cos(angle) * along - np.sin(angle) * up, -G * up


class Rebound(SmallScene):

    def drops(self, steps_per_second, restitution, seconds, heights):
        """Balls side by side that fall on a plane from their heights. They are not moved out of the overlap of a late impact:
        what is left then, `overlap_allowed`, does not go with h."""
        balls = [Grain((0.2 * k, RADIUS + height), radius=RADIUS) for k, height in enumerate(heights)]
        return self.play(f"drop {restitution} {steps_per_second}", balls, [plane((0, 0), (0, 1), restitution=restitution)],
                         (0, -G), int(seconds * steps_per_second), time={"step": 1.0 / steps_per_second},
                         scene={"overlap_projection": False})

    @staticmethod
    def heights(coarsest):
        """Heights about 1 m whose impacts fall evenly into a step of the coarsest run, and so into those of the others."""
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        return 0.5 * G * (np.sqrt(2.0 / G) + np.mod(golden * np.arange(48), 1.0) / coarsest) ** 2

    def test_apex(self):
        """The n-th apex is e^(2n) h0 but for an error of order 1 at least: the impact is up to half a step early or late. Where in the step it
        falls is a matter of chance, so that the error of one ball jumps with h; balls of many heights show the order. Early and late impacts
        balance: where all were late, the mean error was 0.66 to 0.82 steps, times 1/s."""
        restitution, rates = 0.7, np.array([64, 128, 256])
        heights, rms = self.heights(rates[0]), []
        for rate in rates:
            record = self.drops(rate, restitution, 1.75, heights)
            fall, height = record.velocity[:, :, 1], record.position[:, :, 1] - RADIUS
            errors = np.empty((3, len(heights)))
            for k, h0 in enumerate(heights):
                bounce = np.flatnonzero((fall[:-1, k] < 0) & (fall[1:, k] > 0)) + 1
                self.assertGreaterEqual(len(bounce), 3)
                ends = [*bounce, len(height)]
                for n in (1, 2, 3):
                    errors[n - 1, k] = height[ends[n - 1]:ends[n], k].max() / h0 - restitution ** (2 * n)
            rms.append(np.sqrt(np.mean(errors ** 2, axis=1)))
        for n in (1, 2, 3):
            order = -np.polyfit(np.log(rates), np.log([row[n - 1] for row in rms]), 1)[0]
            # v h, the way in a step at the impact, is what the height of an impact may be off, relative to h0
            self.verify("bouncing ball, e = 0.7", f"apex {n} / h0 at h = 1/{rates[-1]} s, worst of 48 balls",
                        restitution ** (2 * n) + errors[n - 1], restitution ** (2 * n), np.sqrt(2 * G) / rates[-1])
            self.assertGreater(order, 0.85)
            self.assertLess(abs(errors[n - 1].mean()) * rates[-1], 0.4)

    def test_rest(self):
        """At rest after t0 (1 + e) / (1 - e), t0 = sqrt(2 h0 / g), and for good. An impact that is early or late by the share d of a step
        shifts the end by h (1 - d (1 + e) / e): by at most h / e for e <= 1/2. Shifts have either sign."""
        restitution, rates = 0.5, np.array([64, 128, 256])
        heights = self.heights(rates[0])
        for rate in rates:
            record = self.drops(rate, restitution, 2.0, heights)
            moves = np.abs(record.velocity[:, :, 1]) > 1e-9
            last = len(moves) - 1 - np.argmax(moves[::-1], axis=0)
            wanted = np.sqrt(2 * heights / G) * (1 + restitution) / (1 - restitution)
            # bounces that are seen until the speed is g h, and two more until it is 0
            bounces = np.log(np.sqrt(2 / G) * rate) / np.log(1 / restitution) + 2
            self.verify("bouncing ball, e = 0.5", f"time until rest [s] at h = 1/{rate} s, worst of 48 balls", record.time[last],
                        wanted, bounces / restitution / rate)

    def test_pressure_of_a_gas(self):
        """Elastic disks whose impacts make the pressure of a gas, 2 phi X(phi) n T beside that of their motion, with the pair correlation at touch
        X = (1 - 7/16 phi)/(1 - phi)^2 (Henderson 1975). A disk goes 3.5 % of its diameter in a step. Where all impacts were late by half a step in
        the mean, as if the disks were smaller, the pressure was 13 % too low."""
        count, radius, share, step = 16, 0.01, 0.5, 5e-4
        edge = count * radius * np.sqrt(np.pi / share)
        draws = np.random.default_rng(3)
        velocity = draws.normal(0.0, 1.0, (count**2, 2))
        velocity -= velocity.mean(axis=0)
        disks = [Grain(((k % count + 0.5) * edge / count, (k // count + 0.5) * edge / count), v, radius=radius) for k, v in enumerate(velocity)]
        record = self.play("gas", disks, steps=4000, time={"step": step}, scene={"restitution": 1.0, "period": [edge, edge]},
                           output={"every": 0, "energy": True, "stress": True})
        history = record.run.history()
        self.assertGreater(history["kinetic_energy"][-1], 0.99 * history["kinetic_energy"][0])
        late = slice(1000, None)
        # energy of the disks over the area is n T in two dimensions
        impacts = 2.0 * share * (1.0 - 7.0 / 16.0 * share) / (1.0 - share) ** 2 * history["kinetic_energy"][late].mean() / edge**2
        self.verify("gas of 256 disks", "pressure of impacts [N/m]", history["pressure"][late].mean(), impacts, 0.05 * impacts)

    def test_gap(self):
        """Without rebound, the step that would close the gap takes its whole way up, no more: v = -gap / h. With rebound the
        contact is there from the overlap on, and sends back the speed that was there at the start of the step."""
        def check(dimension):
            up, speed, gap = unit(dimension, -1), 2.0, 0.004
            for restitution in (0.0, 0.6):
                ball = Grain((RADIUS + gap) * up, -speed * up, radius=RADIUS)
                record = self.play(f"gap {dimension} {restitution}", [ball], [plane(0 * up, up, restitution=restitution)],
                                   steps=6, scene={"alert_distance": 0.5})
                v = record.velocity[:, 0, -1]
                # gap at q_m, half a step after the start: 0.004 - 2/1024 > 0, then 0.004 - 6/1024 < 0
                if restitution > 0:
                    wanted = [-speed, -speed] + 5 * [restitution * speed]
                else:
                    middle = gap - 0.5 * self.step * speed
                    # the way of a step is v h, of which half is left to the gap at q_m of the next one
                    wanted = [-speed, -middle / self.step] + 5 * [0.0]
                self.verify(f"ball on a plane, {dimension}D, e = {restitution}", "speed [m/s] in the steps around the impact", v,
                            wanted, 1e-12)
        self.both(check)

    def test_cradle(self):
        """Three balls in touch, the first strikes with v0; all contacts act at once: (1 - 2e)/3, (1 + e)/3, (1 + e)/3 times v0."""
        def check(dimension):
            along, speed = unit(dimension, 0), 0.125
            for e in (0.0, 0.5, 1.0):
                balls = [Grain(k * along, (speed if k == 0 else 0.0) * along, radius=0.5) for k in range(3)]
                record = self.play(f"cradle {dimension} {e}", balls, steps=1, scene={"restitution": e})
                self.verify(f"three balls, {dimension}D, e = {e}", "v / v0", record.velocity[1, :, 0] / speed,
                            [(1 - 2 * e) / 3, (1 + e) / 3, (1 + e) / 3], 1e-10)
        self.both(check)

    def test_cradle_of_five(self):
        """Five balls, the first strikes with v0: in touch it bounces back with 0.6 v0 and the others go on together with 0.4 v0; with gaps between them the impacts follow each
        other, and the last one alone goes on with v0. Both keep momentum and energy."""
        def check(dimension):
            along, speed = unit(dimension, 0), 0.125
            for name, gap, wanted in (("in touch", 0.0, [-0.6, 0.4, 0.4, 0.4, 0.4]), ("with gaps", 2.0**-20, [0.0, 0.0, 0.0, 0.0, 1.0])):
                balls = [Grain((k * (1.0 + gap) - (0.0625 if k == 0 else 0.0)) * along, (speed if k == 0 else 0.0) * along, radius=0.5) for k in range(5)]
                record = self.play(f"cradle of five {name} {dimension}", balls, steps=600, scene={"restitution": 1.0, "alert_distance": 0.01})
                v = record.velocity[-1, :, 0] / speed
                self.verify(f"five balls {name}, {dimension}D", "v / v0", v, wanted, 1e-9)
                self.verify(f"five balls {name}, {dimension}D", "energy over that before", np.sum(v**2), 1.0, 1e-9)
        self.both(check)


class Block(SmallScene):
    """Bodies that do not turn: rotation = .false."""

    def test_incline(self):
        def check(dimension):
            angle = np.radians(28)
            for kind, normal, down, gravity in inclines(dimension, angle):
                for share in ((0.5, 0.999, 1.001, 1.5) if kind == "gravity" else (0.5, 1.001)):
                    mu = share * np.tan(angle)
                    block = Grain(RADIUS * normal, radius=RADIUS)
                    record = self.play(f"incline {dimension} {kind} {share}", [block], [plane(0 * normal, normal)], gravity,
                                       scene={"rotation": False, "friction": float(mu)})
                    a = 0.0 if share > 1 else G * (np.sin(angle) - mu * np.cos(angle))
                    # the place is off the plane by its rounding, and a gap of eps R is closed with the speed eps R / h
                    self.verify(f"block on an incline, {dimension}D, {kind} turned, mu = {share} tan", "velocity [m/s]",
                                record.velocity[:, 0], a * record.time[:, None] * down,
                                self.rounding(record, 3.0) + 10 * EPS * RADIUS / self.step)
                    self.verify(f"block on an incline, {dimension}D, {kind} turned, mu = {share} tan", "spin [rad/s]",
                                record.spin, 0.0, EPS)
        self.both(check)

    def test_stop(self):
        """Thrown along the flat: t = v0 / (mu g) within h, d = v0^2 / (2 mu g)."""
        def check(dimension):
            mu, speed = 0.43, 1.0
            up, along = unit(dimension, -1), unit(dimension, 0)
            if dimension == 3:
                along = np.array([0.6, 0.8, 0.0])
            block = Grain(RADIUS * up, speed * along, radius=RADIUS)
            record = self.play(f"stop {dimension}", [block], [plane(0 * up, up)], -G * up, 160,
                               scene={"rotation": False, "friction": mu})
            v = record.velocity[:, 0] @ along
            until = speed / (mu * G)
            case = f"sliding to a stop, {dimension}D"
            self.verify(case, "time [s]", record.time[np.argmax(np.abs(v) < 1e-12)], until, self.step)
            moves = record.time <= until
            self.verify(case, "velocity until then [m/s]", v[moves], speed - mu * G * record.time[moves],
                        self.rounding(record, speed))
            # in the step in which it stops, the speed falls from at most mu g h to 0 in a straight line instead of before
            self.verify(case, "way [m]", (record.position[-1, 0] - RADIUS * up) @ along, speed ** 2 / (2 * mu * G),
                        0.5 * mu * G * self.step ** 2)
        self.both(check)


class Roll(SmallScene):

    def rim(self, record, normal, along):
        """Speed of the rim at the contact relative to the centre, against the way: that of the centre where it rolls."""
        if record.dimension == 2:
            return RADIUS * record.spin[:, 0, 0] * (normal[0] * along[1] - normal[1] * along[0])
        return RADIUS * record.spin[:, 0] @ np.cross(normal, along)

    def test_incline(self):
        """Pure if tan <= mu (1 + m R^2/I), 3 mu for a disk and 7/2 mu for a sphere; then a = 2/3 or 5/7 g sin, else
        a = g (sin - mu cos) and the rim gains mu g cos m R^2/I."""
        def check(dimension):
            angle = np.radians(40)
            limit = np.tan(angle) / {2: 3.0, 3: 3.5}[dimension]
            name = {2: "disk", 3: "sphere"}[dimension]
            for kind, normal, down, gravity in inclines(dimension, angle):
                for share in ((2.0, 1.0001, 0.9999, 0.5) if kind == "gravity" else (1.0001, 0.5)):
                    mu = share * limit
                    record = self.play(f"roll {dimension} {kind} {share}", [Grain(RADIUS * normal, radius=RADIUS)],
                                       [plane(0 * normal, normal, friction=float(mu))], gravity)
                    rolls = share > 1
                    a = G * np.sin(angle) * {2: 2 / 3, 3: 5 / 7}[dimension] if rolls else \
                        G * (np.sin(angle) - mu * np.cos(angle))
                    turn = a if rolls else mu * G * np.cos(angle) / INERTIA[dimension]
                    case = f"{name} on an incline, {kind} turned, mu = {share} of the limit"
                    t = record.time[1:]
                    self.verify(case, "acceleration of the centre [m/s^2]", record.velocity[1:, 0] @ down / t, a, 1e-6 * a)
                    self.verify(case, "acceleration of the rim [m/s^2]", self.rim(record, normal, down)[1:] / t, turn,
                                1e-6 * turn)
        self.both(check)

    def test_slip_to_roll(self):
        """Thrown without spin: rolls from v0 / (3 mu g) on with 2/3 v0 (disk), from 2 v0 / (7 mu g) on with 5/7 v0 (sphere)."""
        def check(dimension):
            mu, speed = 0.31, 1.3
            up, along = unit(dimension, -1), unit(dimension, 0)
            record = self.play(f"throw {dimension}", [Grain(RADIUS * up, speed * along, radius=RADIUS)],
                               [plane(0 * up, up, friction=mu)], -G * up, 130)
            v, rim = record.velocity[:, 0, 0], self.rim(record, up, along)
            share, until = {2: (2 / 3, speed / (3 * mu * G)), 3: (5 / 7, 2 * speed / (7 * mu * G))}[dimension]
            case = f"{ {2: 'disk', 3: 'sphere'}[dimension]} thrown along the flat"
            self.verify(case, "time when it rolls [s]", record.time[np.argmax(np.abs(v - rim) < 1e-10)], until, self.step)
            rolls = record.time >= until + self.step
            self.verify(case, "speed then / v0", v[rolls] / speed, share, self.rounding(record, 1.0))
            self.verify(case, "speed of the rim then / v0", rim[rolls] / speed, share, self.rounding(record, 1.0))
        self.both(check)


class Wedge(SmallScene):

    def test_wedge(self):
        """At rest in a notch of two planes at +-alpha to the horizontal, no friction: each bears m g / (2 cos alpha)."""
        def check(dimension):
            for degrees in (10, 60, 80):
                angle = np.radians(degrees)
                up, across = unit(dimension, -1), unit(dimension, 0)
                sides = [np.cos(angle) * up + side * np.sin(angle) * across for side in (1, -1)]
                ball = Grain(RADIUS / np.cos(angle) * up, radius=RADIUS, mass=MASS)
                record = self.play(f"wedge {dimension} {degrees}", [ball], [plane(0 * up, side) for side in sides], -G * up, 5,
                                   output={"contacts": True})
                forces = np.array([contacts["impulse"][:, 0] for contacts in record.contacts[1:]]) / self.step
                self.assertEqual(forces.shape, (5, 2))
                wanted = MASS * G / (2 * np.cos(angle))
                self.verify(f"wedge at {degrees} degrees, {dimension}D", "force on a plane [N]", forces, wanted, 1e-10 * wanted)
        self.both(check)


if __name__ == "__main__":
    unittest.main()
