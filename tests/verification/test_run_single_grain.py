"""One disk or sphere, or a few, against formulas: fall, slide, roll, slip and roll, a wedge, a row that is struck.

The time stepping takes constant forces exactly: velocities are right to round-off in each step, and with theta = 1/2 so are the
positions, since a velocity that is linear in time is integrated by the mid-point rule without error. What is not right to
round-off is the step in which slip ends."""
import os
import unittest

import h5py
import numpy as np

from gravier_runs import RunTestCase, merged, run_case, write

G = 9.81
RADIUS = 0.05
MASS = 0.7
# spin of a disk or a sphere in units of m R^2
INERTIA = {2: 1 / 2, 3: 2 / 5}


def bodies(dimension, rows, planes):
    """A CSV file: rows of (position, velocity), planes of (point, normal)."""
    axes = "xyz"[:dimension]
    spins = ["omega"] if dimension == 2 else ["wx", "wy", "wz"]
    names = [*axes, *("v" + axis for axis in axes), *spins, *("n" + axis for axis in axes)]
    text = "id,shape,radius,mass," + ",".join(names) + "\n"
    for k, (position, velocity) in enumerate(rows):
        cells = [repr(float(value)) for value in (*position, *velocity)] + [""] * dimension
        text += f"{k + 1},grain,{RADIUS!r},{MASS!r}," + ",".join(cells) + "\n"
    for k, (point, normal) in enumerate(planes):
        cells = [repr(float(value)) for value in point] + [""] * (dimension + len(spins)) + [repr(float(v)) for v in normal]
        text += f"{1000 + k},plane,,," + ",".join(cells) + "\n"
    return text


class Motion:
    """Positions, velocities and impulses of all steps of a run; arrays (steps + 1, bodies, components)."""

    def __init__(self, path, step):
        with h5py.File(path) as file:
            states = [file[f"steps/{n}"] for n in range(len(file["steps"]))]
            self.position = np.array([state["bodies/position"] for state in states])
            self.velocity = np.array([state["bodies/velocity"] for state in states])
            self.impulse = [state["contacts/impulse"][:] for state in states[1:]]
        self.time = step * np.arange(len(states))


class SingleGrain(RunTestCase):
    step = 1.0 / 512
    steps = 150

    def move(self, title, dimension, rows, planes, friction, gravity, **more):
        directory = self.here(f"{title} {dimension}D")
        case = merged({
            "scene": {"dimension": dimension, "bodies": "file", "bodies_file": "bodies.csv", "friction": float(friction),
                      "gravity": [float(g) for g in gravity] + [0.0] * (3 - dimension)},
            "time": {"step": self.step, "steps": self.steps},
            # from zero impulses one sweep solves a contact exactly
            "solver": {"tolerance": 1e-13, "check_every": 1, "warm_start": False},
            "output": {"directory": "results"},
        }, more.get("case", {}))
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies(dimension, rows, planes))
        run = run_case(case, more.get("ranks", 1), directory)
        self.assert_status(run, 0)
        return Motion(run.path("results", "results.h5"), case["time"]["step"])

    def both(self, check):
        """check(dimension) for disks and spheres."""
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                check(dimension)

    def close(self, found, wanted, scale):
        """Equal to the rounding of one addition a step, each of a number no larger than `scale`."""
        np.testing.assert_allclose(found, np.broadcast_to(wanted, np.shape(found)), rtol=0,
                                   atol=2 * self.steps * np.finfo(float).eps * scale)

    @staticmethod
    def flat(dimension):
        """A ground through the origin, a place on it, the way along it, and the sign of the spin that rolls along it."""
        up = np.eye(dimension)[-1]
        along = np.eye(dimension)[0]
        return (np.zeros(dimension), up), RADIUS * up, along, up

    def start(self, dimension, speed=0.0, spin=0.0):
        """Velocity along the first axis, and the spin of a body that rolls along it with speed `spin` times radius."""
        velocity = np.zeros(3 * dimension - 3)
        velocity[0] = speed
        velocity[self.turn(dimension)[0]] = self.turn(dimension)[1] * spin
        return velocity

    @staticmethod
    def turn(dimension):
        """Place of the spin about the axis across the way, and its sign where the body rolls forward: a disk rolls to the right
        clockwise; a sphere rolls along x with a positive spin about y."""
        return (2, -1) if dimension == 2 else (4, 1)

    def rim(self, motion, dimension):
        """Speed of the rim, positive where the body rolls forward."""
        place, sign = self.turn(dimension)
        return sign * RADIUS * motion.velocity[:, 0, place]

    def test_free_fall(self):
        def check(dimension):
            gravity = np.array([0.3, -1.7, -9.0])[:dimension]
            start = np.array([0.1, 2.0, -0.7])[:dimension]
            velocity = np.array([0.4, 3.0, -0.2])[:dimension]
            spin = np.array([0.5, -11.0, 7.0])[:2 * dimension - 3]
            for friction in (0.0, 0.3):
                for theta in (0.5, 1.0):
                    motion = self.move(f"fall {friction} {theta}", dimension, [(start, [*velocity, *spin])], [], friction, gravity,
                                       case={"time": {"theta": theta}})
                    t = motion.time[:, None]
                    self.close(motion.velocity[:, 0, :dimension], velocity + gravity * t, 5.0)
                    self.close(motion.velocity[:, 0, dimension:], spin, 11.0)
                    # q_{n+1} = q_n + h ((1 - theta) V_n + theta V_{n+1})
                    late = (theta - 0.5) * self.step * gravity * t
                    self.close(motion.position[:, 0], start + velocity * t + 0.5 * gravity * t ** 2 + late, 5.0)
        self.both(check)

    def test_slide_without_friction(self):
        """Down an incline with a = g sin; the spin that the body had, it keeps."""
        def check(dimension):
            ground, place, along, up = self.flat(dimension)
            angle = np.radians(35)
            motion = self.move("slide", dimension, [(place, self.start(dimension, 0.2, 3.0))], [ground], 0.0,
                               G * (np.sin(angle) * along - np.cos(angle) * up))
            t = motion.time
            self.close(motion.velocity[:, 0, 0], 0.2 + G * np.sin(angle) * t, 3.0)
            self.close(motion.position[:, 0, 0], 0.2 * t + 0.5 * G * np.sin(angle) * t ** 2, 1.0)
            self.close(motion.position[:, 0, -1 if dimension == 2 else 2], RADIUS, RADIUS)
            self.close(self.rim(motion, dimension), 3.0 * RADIUS, 3.0 * RADIUS)
            for impulse in motion.impulse:
                self.close(impulse, [[MASS * G * np.cos(angle) * self.step] + [0.0] * (dimension - 1)], MASS * G * self.step)
        self.both(check)

    def test_roll_down(self):
        """a = g sin / (1 + I / m R^2): 2/3 g sin for a disk, 5/7 g sin for a sphere."""
        def check(dimension):
            ground, place, along, up = self.flat(dimension)
            angle = np.radians(40)
            share = INERTIA[dimension] / (1 + INERTIA[dimension])
            # a little more than what rolling needs
            friction = 1.02 * share * np.tan(angle)
            motion = self.move("roll", dimension, [(place, self.start(dimension))], [ground], friction,
                               G * (np.sin(angle) * along - np.cos(angle) * up))
            t = motion.time
            acceleration = G * np.sin(angle) * {2: 2 / 3, 3: 5 / 7}[dimension]
            self.close(motion.velocity[:, 0, 0], acceleration * t, 2.0)
            self.close(self.rim(motion, dimension), acceleration * t, 2.0)
            self.close(motion.position[:, 0, 0], 0.5 * acceleration * t ** 2, 1.0)
            for impulse in motion.impulse:
                weight = MASS * G * self.step
                self.close(impulse[:, 0], weight * np.cos(angle), weight)
                self.close(np.linalg.norm(impulse[:, 1:], axis=1), weight * share * np.sin(angle), weight)
        self.both(check)

    def test_slip_down(self):
        """With less friction than rolling needs: a = g (sin - mu cos), and the rim is driven by mu m g cos."""
        def check(dimension):
            ground, place, along, up = self.flat(dimension)
            angle = np.radians(50)
            friction = 0.98 * INERTIA[dimension] / (1 + INERTIA[dimension]) * np.tan(angle)
            motion = self.move("slip", dimension, [(place, self.start(dimension))], [ground], friction,
                               G * (np.sin(angle) * along - np.cos(angle) * up))
            t = motion.time
            self.close(motion.velocity[:, 0, 0], G * (np.sin(angle) - friction * np.cos(angle)) * t, 3.0)
            self.close(self.rim(motion, dimension), friction * G * np.cos(angle) / INERTIA[dimension] * t, 3.0)
        self.both(check)

    def test_inclined_plane(self):
        """As test_roll_down, with the plane tilted and not gravity, and a normal of any length, also one whose square is no number."""
        def check(dimension, length):
            angle = np.radians(20)
            axes = np.eye(dimension)
            down = np.cos(angle) * axes[0] - np.sin(angle) * axes[-1]
            normal = np.sin(angle) * axes[0] + np.cos(angle) * axes[-1]
            point = 0.3 * axes[0] - 0.2 * axes[-1]
            motion = self.move(f"incline {length}", dimension, [(point + 0.7 * down + RADIUS * normal, self.start(dimension))],
                               [(point, length * normal)], 0.5, -G * axes[-1])
            acceleration = G * np.sin(angle) * {2: 2 / 3, 3: 5 / 7}[dimension]
            speed = motion.velocity[:, 0, :dimension]
            # the place is off the plane by its rounding, and a gap of eps R is closed with the speed eps R / h
            rounding = 10 * np.finfo(float).eps / self.step
            np.testing.assert_allclose(speed @ down, acceleration * motion.time, rtol=0, atol=rounding)
            np.testing.assert_allclose(speed @ normal, 0.0, rtol=0, atol=rounding)
            np.testing.assert_allclose(self.rim(motion, dimension), acceleration * motion.time, rtol=0, atol=rounding)
        for length in (12.3, 1e-200, 1e200):
            with self.subTest(length=length):
                self.both(lambda dimension, length=length: check(dimension, length))

    def test_slip_then_roll(self):
        """Thrown along the flat without spin: slips until t = v0 k / (mu g), k = I / (I + m R^2), then rolls with (1 - k) v0: 2/3 of
        it for a disk at v0 / (3 mu g), 5/7 for a sphere at 2 v0 / (7 mu g)."""
        def check(dimension):
            ground, place, _, up = self.flat(dimension)
            friction, speed = 0.31, 1.3
            motion = self.move("slip and roll", dimension, [(place, self.start(dimension, speed))], [ground], friction, -G * up)
            share = INERTIA[dimension] / (1 + INERTIA[dimension])
            until = speed * share / (friction * G)
            slips = motion.time <= until
            rolls = motion.time >= until + self.step
            self.assertGreater(min(slips.sum(), rolls.sum()), 25)
            self.close(motion.velocity[slips, 0, 0], speed - friction * G * motion.time[slips], speed)
            self.close(motion.velocity[rolls, 0, 0], speed * {2: 2 / 3, 3: 5 / 7}[dimension], speed)
            self.close(self.rim(motion, dimension)[rolls], speed * {2: 2 / 3, 3: 5 / 7}[dimension], speed)
        self.both(check)

    def test_slide_to_a_stop(self):
        """Thrown with so much backspin that slip and speed end together: t = v0 / (mu g), d = v0^2 / (2 mu g)."""
        def check(dimension):
            ground, place, _, up = self.flat(dimension)
            friction, speed = 0.43, 1.0
            backspin = -speed / RADIUS / INERTIA[dimension]
            motion = self.move("stop", dimension, [(place, self.start(dimension, speed, backspin))], [ground], friction, -G * up)
            until = speed / (friction * G)
            moves = motion.time <= until
            stands = motion.time >= until + self.step
            self.assertGreater(min(moves.sum(), stands.sum()), 25)
            self.close(motion.velocity[moves, 0, 0], speed - friction * G * motion.time[moves], speed)
            self.close(motion.velocity[stands], 0.0, speed / RADIUS / INERTIA[dimension])
            # in the step in which it stops, the speed falls from at most mu g h to 0 in a straight line instead of before
            way = speed ** 2 / (2 * friction * G)
            np.testing.assert_allclose(motion.position[stands, 0, 0], way, rtol=0, atol=0.5 * friction * G * self.step ** 2)
        self.both(check)

    def test_wedge(self):
        """At rest between two planes at angles of +-alpha to the horizontal: each bears m g / (2 cos alpha)."""
        def check(dimension):
            angle = np.radians(33)
            axes = np.eye(dimension)
            normals = [np.cos(angle) * axes[-1] + side * np.sin(angle) * axes[0] for side in (1, -1)]
            place = RADIUS / np.cos(angle) * axes[-1]
            motion = self.move("wedge", dimension, [(place, self.start(dimension))], [(np.zeros(dimension), n) for n in normals],
                               0.0, -G * axes[-1], case={"time": {"steps": 5}})
            for impulse in motion.impulse:
                np.testing.assert_allclose(impulse[:, 0] / self.step, MASS * G / (2 * np.cos(angle)), rtol=1e-10)
            np.testing.assert_allclose(motion.velocity, 0.0, atol=1e-12)
        self.both(check)

    def test_struck_row(self):
        """Three equal bodies in a row and in touch, the first with v0, no rebound: all go on with v0 / 3."""
        def check(dimension):
            axes = np.eye(dimension)
            rows = [(2 * RADIUS * k * axes[0], self.start(dimension, 1.5 if k == 0 else 0.0)) for k in range(3)]
            motion = self.move("row", dimension, rows, [], 0.0, np.zeros(dimension), case={"time": {"steps": 3}})
            np.testing.assert_allclose(motion.velocity[1:, :, 0], 0.5, rtol=1e-10)
            np.testing.assert_allclose(motion.velocity[1:, :, 1:], 0.0, atol=1e-12)
        self.both(check)

    def test_row_flies_on(self):
        """Twenty in a row, the first one thrown at the others. After the shock no contact carries anything, and what the warm
        start has left of the impulses must go without the solve asking for a precision that numbers do not have."""
        def check(dimension):
            axes = np.eye(dimension)
            rows = [(2 * RADIUS * k * axes[0], self.start(dimension, 2.0 if k == 0 else 0.0)) for k in range(20)]
            for friction in (0.0, 0.3):
                for tolerance in (1e-4, 1e-10):
                    motion = self.move(f"flight {friction} {tolerance}", dimension, rows, [], friction, np.zeros(dimension),
                                       case={"time": {"steps": 20}, "solver": {"tolerance": tolerance, "warm_start": True,
                                                                               "check_every": 10}})
                    # momentum to round-off, speeds to what the tolerance leaves: sqrt(20) impulses of up to 19/20 m v0 in
                    # norm, times 1 / (1 - cos^2(pi / 40)) = 163 for the rate of the sweeps on a row of 20
                    self.close(motion.velocity[1:, :, 0].mean(1), 0.1, 2.0)
                    np.testing.assert_allclose(motion.velocity[-1, :, 0], 0.1, rtol=0, atol=163 * 2.0 * 20 ** 0.5 * tolerance)
        self.both(check)

    def test_roll_through_subdomains(self):
        """Two bodies that roll towards each other through four subdomains on two ranks, each as if alone."""
        def check(dimension):
            ground, place, along, up = self.flat(dimension)
            rows = [(place, self.start(dimension, 2.0, 2.0 / RADIUS)),
                    (place + 1.6 * along, self.start(dimension, -2.0, -2.0 / RADIUS))]
            motion = self.move("subdomains", dimension, rows, [ground], 0.5, -G * up, ranks=2,
                               case={"solver": {"method": "nscdd"}, "decomposition": {"grid": [4, 1, 1][:dimension]}})
            t = motion.time
            self.assertLess(motion.position[-1, 0, 0] + 2 * RADIUS, motion.position[-1, 1, 0])
            self.assertGreater(motion.position[-1, 0, 0], 0.4)
            for k, sign in ((0, 1), (1, -1)):
                self.close(motion.velocity[:, k, 0], 2.0 * sign, 2.0)
                self.close(motion.position[:, k, 0], 1.6 * k + 2.0 * sign * t, 2.0)
        self.both(check)


if __name__ == "__main__":
    unittest.main()
