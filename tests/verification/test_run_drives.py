"""Boundaries that move, are moved, turn, end somewhere, let grains out or go away, and loads that change, against formulas."""
import unittest

import numpy as np

from gravier_runs import LONG

import gravier
from small_scenes import EPS, G, INERTIA, Grain, SmallScene, floats, plane
from time_tables import TimeTable

RADIUS, MASS = 0.05, 0.7


class Moves(SmallScene):

    def test_constant_velocity(self):
        """A plane at constant velocity drives what touches it, and is where it should be; it takes nothing to go on."""
        def check(dimension):
            along, speed = np.eye(dimension)[0], 0.375
            record = self.play(f"constant {dimension}", [Grain(RADIUS * along, radius=RADIUS)],
                               [plane(0 * along, along, velocity=floats(speed * along))], steps=100)
            case = f"plane at constant velocity, {dimension}D"
            self.verify(case, "speed of the grain before it [m/s]", record.velocity[1:, 0], speed * along, 1e-12)
            self.verify(case, "place of the plane [m]", record.boundary["position"][:, 0],
                        speed * record.time[:, None] * along, 1e-13)
            self.verify(case, "force on it from the second step on [N]", record.boundary["force"][2:, 0], 0.0,
                        10 * EPS * MASS / self.step)
        self.both(check)

    def test_table(self):
        """Faster until 0.125 s, then slower: the grain goes with the plane and then flies on."""
        def check(dimension):
            along = np.eye(dimension)[0]
            table = TimeTable([0.0, 0.125, 0.1875], {"vx": [0.0, 1.0, -0.5]})
            record = self.play(f"table {dimension}", [Grain(RADIUS * along, radius=RADIUS)],
                               [plane(0 * along, along, table="drive.csv")], steps=128, files={"drive.csv": table.text})
            speed = table.rates("vx", self.step, 128)
            case = f"plane driven by a table, {dimension}D"
            self.verify(case, "speed of the plane [m/s]", record.boundary["velocity"][1:, 0, 0], speed[1:], 1e-13)
            self.verify(case, "speed of the grain [m/s]", record.velocity[:, 0, 0], np.maximum.accumulate(np.concatenate([[0.0], speed[1:]])), 1e-12)
            self.verify(case, "place of the plane [m]", record.boundary["position"][:, 0, 0], table.ways("vx", self.step, 128), 1e-13)
        self.both(check)

    def test_oscillation(self):
        """A plane that moves by A (sin(2 pi f t + phase) - sin(phase)) beside its constant velocity, or beside its table, drives what is
        glued to nothing: where it is, of second order, and back after each period; about its pivot it turns by such an angle."""
        amplitude, frequency, phase = 0.02, 8.0, 0.7

        def check(dimension):
            along, up = np.eye(dimension)[0], np.eye(dimension)[-1]
            swing = {"oscillation": floats(amplitude * along), "frequency": frequency, "phase": phase}
            far = [Grain(3.0 * (along + up), radius=RADIUS)]
            away, case = {}, f"plane that oscillates, {dimension}D"
            for steps in (128, 256):
                for beside, drive in (("velocity", {"velocity": floats(0.25 * along)}), ("table", {"table": "drive.csv"})):
                    record = self.play(f"oscillates {dimension} {steps} {beside}", far, [plane(0 * along, along, **swing, **drive)], steps=steps,
                                       time={"step": 0.5 / steps}, files={"drive.csv": "time,vx\n0,0.25\n9,0.25\n"})
                    t = record.time
                    angle = 2.0 * np.pi * frequency * t + phase
                    speed = 0.25 + 2.0 * np.pi * frequency * amplitude * np.cos(angle)
                    self.verify(case, "speed of the plane [m/s]", record.boundary["velocity"][1:, 0, 0], speed[1:], 1e-12)
                    way = 0.25 * t + amplitude * (np.sin(angle) - np.sin(phase))
                    away[beside, steps] = np.abs(record.boundary["position"][:, 0, 0] - way).max()
                    # four periods
                    self.verify(case, "place of the plane after whole periods [m]", record.boundary["position"][-1, 0, 0], 0.125, 1e-13)
                self.assertLess(away["velocity", steps], 2.0 * amplitude * (2.0 * np.pi * frequency * 0.5 / steps) ** 2 / 12.0, case)
                self.assertLess(abs(away["velocity", steps] - away["table", steps]), 1e-14, case)
            self.assertGreater(np.log2(away["velocity", 128] / away["velocity", 256]), 1.95, case)
            turns = [0.3] if dimension == 2 else [0.0, 0.3, 0.0]
            record = self.play(f"rocks {dimension}", far, [plane(0 * along, along, rotation_oscillation=turns, frequency=frequency, phase=phase)],
                               steps=256, time={"step": 0.5 / 256})
            turned = 0.3 * (np.sin(2.0 * np.pi * frequency * record.time + phase) - np.sin(phase))
            normal = record.boundary["normal"][:, 0]
            self.verify(case, "angle of a plane that rocks [rad]", np.arcsin(-normal[:, -1] if dimension == 3 else normal[:, 1]), turned,
                        1.01 * 0.3 * (1.0 + np.sin(phase)) * (2.0 * np.pi * frequency * 0.5 / 256) ** 2 / 12.0)
        self.both(check)

    def test_repeats(self):
        """Tables of a boundary and of gravity that repeat are, bit for bit, the same tables written out. What a boundary and gravity do
        at the start of such a table, where they are slow, is compared with the speed that they come to."""
        rows, drive, pull = (0.0, 0.03125, 0.09375, 0.125), (0.0, 1.0, -1.0, 0.0), (-9.0, -11.0, -7.0, -9.0)

        def table(column, values, periods, constant=""):
            text = "time," + column + "\n"
            for k in range(periods):
                text += "".join(f"{time + 0.125 * k!r},{constant}{value!r}\n" for time, value in zip(rows[:3], values))
            return text + f"{0.125 * periods!r},{constant}{values[3]!r}\n"

        stack = [Grain([0.0, RADIUS * (2 * k + 1)], radius=RADIUS) for k in range(3)]
        once, often = ({"drive.csv": table("vx", drive, n), "g.csv": table("gx,gy", pull, n, "0.0,")} for n in (1, 8))
        floor = plane([0.0, 0.0], [0.0, 1.0], friction=0.5, table="drive.csv")
        repeated = self.play("repeats", stack, [dict(floor, table_repeats=True)], None, 256, time={"step": 1 / 256}, files=once,
                             scene={"gravity_table": "g.csv", "gravity_table_repeats": True})
        written = self.play("written out", stack, [floor], None, 256, time={"step": 1 / 256}, files=often, scene={"gravity_table": "g.csv"})
        np.testing.assert_array_equal(repeated.position, written.position)
        np.testing.assert_array_equal(repeated.velocity, written.velocity)
        self.assertGreater(np.abs(repeated.velocity[-100:]).max(), 0.1)
        # the next row of the table is a speed of 1 m/s, the load of a step 9/256 m/s: never less than that
        self.assertGreater(repeated.run.history()["velocity_scale"].min(), 6.9 / 256)

    def test_belt(self):
        """A block on a belt reaches its speed at u / (mu g)."""
        def check(dimension):
            mu, up = 0.4, np.eye(dimension)[-1]
            belt = 0.8 * (np.array([1.0, 0.0]) if dimension == 2 else np.array([0.6, -0.8, 0.0]))
            record = self.play(f"belt {dimension}", [Grain(RADIUS * up, radius=RADIUS)],
                               [plane(0 * up, up, velocity=floats(belt), friction=mu)], -G * up, 150, scene={"rotation": False})
            case = f"block on a belt, {dimension}D"
            speed = np.minimum(mu * G * record.time, 0.8)
            self.verify(case, "velocity [m/s]", record.velocity[:, 0], speed[:, None] * belt / 0.8, 1e-11)
            slips = np.linalg.norm(record.velocity[:, 0] - belt, axis=1) > 1e-10
            self.verify(case, "time until it goes with the belt [s]", record.time[np.argmin(slips)], 0.8 / (mu * G), self.step)
        self.both(check)

    def test_turning_circle(self):
        """A disk in a circle that turns: it slips, then its rim goes with the circle. At the lowest point it spins with
        Omega R / r."""
        ring, rate = 0.4, 3.0
        place = [0.0, -(ring - RADIUS)]
        circle = [{"shape": "circle", "point": [0.0, 0.0], "radius": ring, "rotation": rate, "friction": 0.3}]
        steady = self.play("steady circle", [Grain(place, spin=rate * ring / RADIUS, radius=RADIUS)], circle, (0, -G), 200)
        case = "disk in a turning circle"
        self.verify(case, "spin over Omega in the steady state", steady.spin / rate, ring / RADIUS, 1e-9)
        self.verify(case, "place of the disk in the steady state [m]", steady.position[:, 0], place, 1e-9)
        slow = self.play("spun up", [Grain(place, radius=RADIUS)], circle, (0, -G), 750)
        middle = slow.position[:-1, 0] + 0.5 * self.step * slow.velocity[:-1, 0]
        out = middle / np.linalg.norm(middle, axis=1)[:, None]
        tangent = np.column_stack([-out[:, 1], out[:, 0]])
        rim = np.sum(tangent * slow.velocity[1:, 0], axis=1) + RADIUS * slow.spin[1:, 0, 0]
        late = slow.time[1:] > 1.0
        self.verify(case, "speed of the rim at the contact once it rolls [m/s]", rim[late], rate * ring, 1e-9)
        # it swings about the lowest point
        self.assertLess(np.abs(slow.position[:, 0, 0]).max(), 0.5 * ring)

    def test_turntable(self):
        """On a table that turns, what sticks stays on its circle, and a ball that rolls goes round at 2/7 of the speed: of second order, and
        no friction is dissipated. With the velocity of the table at the place of contact the radius grew by pi w h in each turn."""
        rate, radius = 2.0 * np.pi, 0.2
        table = [plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], rotation=[0.0, 0.0, rate], friction=1.0)]
        for rolls, speed, bound in ((False, rate * radius, 1.0), (True, 2.0 / 7.0 * rate * radius, 2.0 / 7.0)):
            for theta in (0.5, 0.8):
                away = {}
                for steps in (256, 512):
                    ball = Grain([radius, 0.0, RADIUS], [0.0, speed, 0.0], [5.0 / 7.0 * rate * radius / RADIUS * rolls, 0.0, 0.0], radius=RADIUS)
                    record = self.play(f"turntable {rolls} {theta} {steps}", [ball], table, (0, 0, -G), steps, scene={"rotation": rolls},
                                       time={"step": 1.0 / steps, "theta": theta}, output={"energy": True, "every": steps})
                    turned = rate * bound
                    place = radius * np.array([np.cos(turned), np.sin(turned)])
                    away[steps] = np.linalg.norm(record.position[-1, 0, :2] - place)
                    friction = record.run.history()["dissipated_friction"]
                    self.assertLess(np.abs(friction).max(), 1e-3 * 0.5 * MASS * speed**2)
                case = f"{'ball that rolls' if rolls else 'block that sticks'} on a turntable, theta = {theta}"
                self.verify(case, "distance from where it should be after a turn of the table [m]", away[512], 0.0, 1.5e-4)
                self.assertGreater(np.log2(away[256] / away[512]), 1.8, case)

    def test_glued(self):
        """Glued grains turn about a pivot for 10^4 steps: distances stay and places are those of the turn."""
        def check(dimension):
            pivot = np.array([0.1, -0.2, 0.3])[:dimension]
            places = np.array([[0.5, 0.0, 0.0], [0.5, 0.1, 0.0], [0.6, 0.1, 0.2], [-0.3, 0.4, -0.1]])[:, :dimension]
            axis = np.array([0.0, 0.0, 1.0]) if dimension == 2 else np.array([2.0, -1.0, 2.0]) / 3
            rate = 1.7
            record = self.play(f"glued {dimension}", [Grain(place, radius=RADIUS, group=1) for place in places],
                               [{"shape": "grains", "group": 1, "pivot": floats(pivot),
                                 "rotation": rate if dimension == 2 else floats(rate * axis)}],
                               steps=10000, output={"every": 1000}, scene={"friction": 0.3})
            case = f"glued grains about a pivot, 10^4 steps, {dimension}D"

            def distances(places):
                return np.linalg.norm(places[:, None] - places[None], axis=-1)
            found = np.array([distances(state) for state in record.position])
            self.verify(case, "distances of the grains [m]", found, distances(places), 1e-12)
            arm = np.zeros((len(places), 3))
            arm[:, :dimension] = places - pivot
            angle = rate * record.time[:, None, None]
            turned = (np.cos(angle) * arm + np.sin(angle) * np.cross(axis, arm) +
                      (1 - np.cos(angle)) * (arm @ axis)[:, None] * axis)
            self.verify(case, "places [m]", record.position, turned[..., :dimension] + pivot, 1e-10)
            spin = [rate] if dimension == 2 else rate * axis
            self.verify(case, "spin [rad/s]", record.spin, np.broadcast_to(spin, record.spin.shape), 1e-14)
        self.both(check)


class Forces(SmallScene):

    def test_piston(self):
        """A piston of mass m pushed by F drives N grains in a row: a = F / (m + N m_g), whatever the method."""
        force, mass, n = 3.0, 1.3, 5
        ways = {"nlgs": {}, "nscdd": {}, "nscdd_ep": {"enriched": {"direction": 0.01}},
                "schwarz": {"solver": {"relaxation": 0.5}}, "schwarz_ec": {"solver": {"relaxation": 0.5}}}

        def check(dimension):
            along = np.eye(dimension)[0]
            grains = [Grain((2 * k + 1) * RADIUS * along, radius=RADIUS, mass=MASS) for k in range(n)]
            piston = plane(0 * along, along, free=[True, False, False][:dimension], mass=mass, force=floats(force * along))
            a = force / (mass + n * MASS)
            for method, more in ways.items():
                for parts, ranks in ((1, 1), (3, 1), (3, 2)):
                    if (method == "nlgs" and parts > 1) or (ranks > 1 and (method, dimension) != ("nscdd", 2)):
                        continue
                    if dimension == 3 and (parts == 1 or method not in ("nscdd", "nscdd_ep")):
                        continue
                    groups = {"solver": {"method": method, "max_iterations": 100000, **more.get("solver", {})},
                              "decomposition": {"subdomains": parts}, "enriched": more.get("enriched", {})}
                    record = self.play(f"piston {dimension} {method} {parts} {ranks}", grains, [piston], steps=5, ranks=ranks,
                                       **groups)
                    case = f"piston and {n} grains, {dimension}D, {method}, subdomains: {parts}"
                    speed = a * record.time[:, None]
                    self.verify(case, "speed of the piston [m/s]", record.boundary["velocity"][:, 0, :1], speed, 1e-9 * a)
                    self.verify(case, "speed of the grains [m/s]", record.velocity[:, :, 0], speed, 1e-9 * a)
        self.both(check)

    def test_moments(self):
        """The angular momentum of grains in a drum that turns and falls, about its axis, changes by the moment of gravity and the opposite of
        the moments on the drum and on a paddle of glued grains in it, with rolling friction and, in space, all three components."""
        def check(dimension):
            nd, up = dimension, np.eye(dimension)[-1]
            self.step = 1.0 / 4096
            rng = np.random.default_rng(3)
            places = [np.array([x, z]) for x in np.arange(-0.19, 0.2, 0.125) for z in np.arange(-0.25, 0.0, 0.125)]
            if dimension == 3:
                places = [np.array([y, *place]) for place in places for y in (-0.1, 0.02)]
            glued = [[0.0] * (nd - 2) + [0.05, 0.06], [0.0] * (nd - 2) + [-0.33, -0.02]]
            grains = [Grain(place + rng.uniform(-0.01, 0.01, nd), radius=RADIUS, mass=MASS) for place in places]
            grains += [Grain(place, radius=RADIUS, mass=MASS, group=1) for place in glued]
            laws = {"friction": 0.5, "rolling_friction": 0.2, **({"pivoting_friction": 0.1} if dimension == 3 else {})}
            turning = {"velocity": floats(-0.1 * up), **({"rotation": 3.0} if dimension == 2 else {"rotation": [3.0, 0.0, 0.0]})}
            drum = {"name": "drum", "shape": "circle", "point": [0.0, 0.0], "radius": 0.4, **turning, **laws}
            if dimension == 3:
                drum.update(shape="cylinder", point=[0.0, 0.0, 0.0], axis=[1.0, 0.0, 0.0])
            paddle = {"name": "paddle", "shape": "grains", "group": 1, "pivot": [0.0] * nd, **turning, **laws}
            record = self.play(f"drum {dimension}", grains, [drum, paddle], floats(-G * up), 1100, scene=laws, solver={"criterion": "velocity_error", "tolerance": 1e-2},
                               output={"every": 1, "contacts": True, "boundary_moments": True, "boundary_forces": True})
            history = record.run.history()
            free = slice(0, len(places))
            middle = record.position[:-1, free] + 0.5 * self.step * record.velocity[:-1, free] - record.boundary["position"][:-1, :1] \
                + 0.05 * self.step * up
            change = np.diff(record.velocity[:, free], axis=0) / self.step
            spin = INERTIA[dimension] * RADIUS**2 * np.diff(record.spin[:, free], axis=0) / self.step
            cross = np.cross(middle, change + G * up)
            balance = MASS * (cross.reshape(*cross.shape[:2], -1) + spin).sum(axis=1)
            names = ["z"] if dimension == 2 else ["x", "y", "z"]
            found = np.column_stack([history[f"moment_{name}:drum"] + history[f"moment_{name}:paddle"] for name in names])
            whole = np.abs(found).max()
            self.assertGreater(whole, 1.0)
            for one in ("drum", "paddle"):
                self.assertGreater(np.abs(history[f"moment_{names[0]}:{one}"]).max(), 0.1 * whole)
            # levers of disks and spheres are their radii: gaps of the drum and overlaps between grains are what is left
            self.verify(f"grains in a drum, {dimension}D", "moments [N m]", -found, balance, 2e-4 * whole)
            self.check_forces(gravier.Run(record.run.path("results")), [drum, paddle], history, names, whole)
        self.both(check)

    def check_forces(self, run, boundaries, history, names, whole):
        """The forces and moments that Python makes of the contacts are those on the boundaries, whose glued grains it knows."""
        for step in run.steps[5::97]:
            bodies, rows, forces = run.bodies(step), run.boundaries(step), run.forces(step)
            part_of = dict(zip(bodies.id, bodies.boundary)) | {number: number for number in rows.id}
            for number, boundary in zip(rows.id, boundaries):
                sign = np.array([(part_of[a] == number) * -1.0 + (part_of[c] == number) for c, a in zip(forces.candidate, forces.antagonist)])
                pivot = run.boundaries(step).position[rows.id == number][0] - 0.5 * run.time_step() * np.array(boundary["velocity"])
                name = boundary["name"]
                force = (sign[:, None] * forces.force).sum(axis=0)
                np.testing.assert_allclose(force, [history[f"force_{axis}:{name}"][step - 1] for axis in "xyz"[:run.dimension]], rtol=0, atol=1e-9 * whole)
                moment = np.cross(forces.point - pivot, forces.force).reshape(forces.moment.shape) + forces.moment
                np.testing.assert_allclose((sign[:, None] * moment).sum(axis=0), [history[f"moment_{axis}:{name}"][step - 1] for axis in names],
                                           rtol=0, atol=2e-4 * whole)

    def test_moment_where_overlaps_are_projected(self):
        """A floor that forces move is shifted by a projection in the first step: its moment is about the pivot that it had at the contact."""
        floor = plane([0.0, 0.0], [0.0, 1.0], free=[False, True], force=[0.0, 30.82], mass=3.0, name="floor", pivot=[0.0, 0.0])
        record = self.play("projected", [Grain([0.3, 0.095], radius=0.1, mass=3.0)], [floor], [3.0, -G], 3,
                           scene={"friction": 0.5, "rotation": False, "overlap_allowed": 1e-4},
                           output={"boundary_forces": True, "boundary_moments": True})
        history = record.run.history()
        self.assertGreater(history["projected"][0], 0)
        self.verify("grain on a floor that is shifted", "moment of the floor [N m]", history["moment_z:floor"][0], 0.3 * history["force_y:floor"][0], 1e-9)

    def test_moment_of_a_plane_in_a_period(self):
        """The lever of a contact with a plane is that of the image nearest to its pivot, whenever lists are made: a grain that slides over the
        side of the cell has the opposite lever from then on."""
        period, speed = 0.2, 1.0
        for skin in (0.001, 0.03):
            floor = plane([0.0, 0.0], [0.0, 1.0], name="floor", pivot=[0.5 * period, 0.0])
            self.step = 1e-3
            record = self.play(f"period {skin}", [Grain([0.15, 0.01], [speed, 0.0], radius=0.01, mass=1.0)], [floor], [0.0, -G], 120,
                               scene={"friction": 0.0, "period": [period, 0.0], "skin": skin},
                               output={"every": 0, "boundary_forces": True, "boundary_moments": True})
            history = record.run.history()
            place = 0.15 + speed * (history["time"] - 0.5 * self.step) - 0.5 * period
            lever = place - period * np.round(place / period)
            self.assertGreater(np.ptp(lever), 0.9 * period)
            self.verify("grain on a floor of a period", "moment [N m]", history["moment_z:floor"], lever * history["force_y:floor"], 1e-9)

    def test_piston_that_moves_at_the_start(self):
        """A piston with a velocity at the start is slowed down by its force, and meets a grain that stops it: both go on together."""
        mass, force, speed = 1.3, 2.0, 0.4

        def check(dimension):
            along = np.eye(dimension)[0]
            grain = Grain((RADIUS + 0.3) * along, radius=RADIUS, mass=MASS)
            piston = plane(0 * along, along, free=[True, False, False][:dimension], mass=mass, force=floats(-force * along), velocity=floats(speed * along))
            self.step = 1e-3
            record = self.play(f"moving piston {dimension}", [grain], [piston], steps=100)
            self.verify(f"piston with a velocity at the start, {dimension}D", "velocity [m/s]", record.boundary["velocity"][:, 0, 0],
                        speed - force / mass * record.time, 1e-12)
            near = self.play(f"moving piston that meets {dimension}", [Grain((RADIUS + 0.5 * self.step * speed) * along, radius=RADIUS, mass=MASS)],
                             [{**piston, "force": floats(0 * along)}], steps=2)
            self.verify(f"piston that meets a grain, {dimension}D", "velocity [m/s]", near.boundary["velocity"][-1, 0, 0],
                        speed * mass / (mass + MASS), 1e-9)
        self.both(check)

    def test_pressure(self):
        """Pressure moves a plane along its normal, with the area between the planes across; a second axis has the period."""
        def check(dimension):
            pressure, mass = 30.0, 6.0
            e = np.eye(dimension)
            planes = [plane(0 * e[0], e[0]), plane(2.0 * e[0], -e[0])]
            up = e[-1]
            lids = [plane(3.0 * up, -up, free=[d == dimension - 1 for d in range(3)], mass=mass, pressure=pressure),
                    plane(-1.0 * up, up)]
            period = {} if dimension == 2 else {"scene": {"period": [0.0, 1.5, 0.0]}}
            record = self.play(f"pressure {dimension}", [Grain(e.sum(axis=0), radius=RADIUS)], planes + lids, steps=20, **period)
            area = 2.0 if dimension == 2 else 3.0
            self.verify(f"plane under pressure, {dimension}D", "velocity [m/s]", record.boundary["velocity"][:, 2, :dimension],
                        -pressure * area / mass * record.time[:, None] * up, 1e-12)
            # one that leans is longer, and its normal turns as much of the force aside
            lids[0]["normal"] = floats(-up + 0.1 * e[0])
            leans = self.play(f"pressure on a plane that leans {dimension}", [Grain(e.sum(axis=0), radius=RADIUS)], planes + lids, steps=20, **period)
            self.verify(f"plane under pressure that leans, {dimension}D", "velocity [m/s]", leans.boundary["velocity"], record.boundary["velocity"], 1e-12)
        self.both(check)

    def test_pressure_between_planes_that_turn(self):
        """The sides of a box turn about their feet: the lid under pressure spans the way between them at its height, at any tilt. In space the
        other axis is periodic. The run ends with an error where the sides have turned by 84 degrees, and their distance says nothing any more."""
        pressure, wide, high, deep, rate = 30.0, 2.0, 0.5, 1.5, 4.0

        def play(name, dimension, rates, steps, status=0):
            up, along = np.eye(dimension)[dimension - 1], np.eye(dimension)[0]
            spins = [[-one] if dimension == 2 else [0.0, one, 0.0] for one in rates]
            sides = [plane(0 * up, along, rotation=spins[0]), plane(wide * along, -along, rotation=spins[1])]
            lid = plane(high * up, -up, free=[d == dimension - 1 for d in range(3)], mass=1e9, pressure=pressure)
            return self.play(name, [Grain(0.5 * wide * along, radius=RADIUS)], [*sides, plane(-5.0 * up, up), lid], steps=steps, status=status,
                             scene={"period": [0.0, deep, 0.0]} if dimension == 3 else {}, output={"every": 10})

        def check(dimension):
            area = 1.0 if dimension == 2 else deep
            steps = int(1.4 / (rate * self.step))
            for name, rates, width in (("both", (rate, rate), lambda angle: wide + 0 * angle), ("one", (0.0, rate), lambda angle: wide + high * np.tan(angle))):
                record = play(f"{name} turn {dimension}", dimension, rates, steps)
                # the load of a step is of the angle in its middle
                angles = rate * self.step * (np.arange(record.step[-1]) + 0.5)
                gained = np.concatenate([[0.0], np.cumsum(pressure * area * width(angles) * self.step / 1e9)])[record.step]
                self.verify(f"lid where {name} sides turn, {dimension}D", "momentum gained over the last one",
                            -record.boundary["velocity"][:, 3, dimension - 1] / gained[-1], gained / gained[-1], 1e-6)
        self.both(check)
        record = play("too far", 2, (rate, rate), 400, status=4)
        self.assertIn("boundary 'boundary 4': pressure: expected two planes that face each other along x, but one of them has turned", record.run.stderr)
        self.assertAlmostEqual(rate * self.step * record.step[-1], np.arccos(0.1), delta=11 * rate * self.step)

    def test_gravity_table(self):
        """Gravity that grows with t acts with its mean over each step: velocities are a t^2 / 2."""
        def check(dimension):
            axes = "xyz"[:dimension]
            rows = [[0.0] * dimension, [-2.0, -9.0, 4.0][:dimension]]
            text = ",".join(["time", *("g" + x for x in axes)]) + "\n"
            text += "".join(",".join(map(repr, [t, *row])) + "\n" for t, row in zip((0.0, 0.5), rows))
            record = self.play(f"gravity table {dimension}", [Grain([0.0] * dimension)], steps=200,
                               scene={"gravity_table": "g.csv"}, files={"g.csv": text})
            t, slope = record.time[:, None], 2.0 * np.array(rows[1])
            v = slope * t * t / 2
            self.verify(f"gravity from a table, {dimension}D", "velocity [m/s]", record.velocity[:, 0], v, 1e-12)
            written = np.transpose([record.run.history()["gravity_" + x] for x in axes])
            np.testing.assert_allclose(written, (slope * (t - self.step / 2))[1:], rtol=1e-12)
        self.both(check)

    def test_body_force(self):
        def check(dimension):
            force = np.array([3.0, -70.0, 20.0])[:dimension]
            record = self.play(f"body force {dimension}", [Grain([0.0] * dimension, radius=RADIUS, mass=MASS)], steps=200,
                               scene={"body_force": floats(force)})
            volume = np.pi * RADIUS ** 2 if dimension == 2 else 4 / 3 * np.pi * RADIUS ** 3
            self.verify(f"body force, {dimension}D", "velocity [m/s]", record.velocity[:, 0],
                        force * volume / MASS * record.time[:, None], 1e-12)
        self.both(check)


class Shapes(SmallScene):

    def normals(self, title, places, boundary):
        record = self.play(title, [Grain(place, radius=RADIUS) for place, _ in places], [boundary], steps=1,
                           scene={"alert_distance": 0.02}, output={"contacts": True})
        contacts = record.contacts[1]
        self.assertEqual(list(contacts["candidate"]), list(range(1, len(places) + 1)))
        for k, (place, foot) in enumerate(places):
            branch = np.array(place) - np.array(foot)
            distance = np.linalg.norm(branch)
            self.verify(title, "normal", contacts["normal"][k], branch / distance, 1e-13)
            self.verify(title, "gap [m]", contacts["gap"][k], distance - RADIUS, 1e-15)

    def test_segment(self):
        """Beside the middle and over the ends, on either side."""
        self.normals("grains at a segment", [([0.5, 0.06], [0.5, 0.0]), ([0.2, -0.052], [0.2, 0.0]),
                                             ([-0.03, 0.05], [0.0, 0.0]), ([1.04, -0.04], [1.0, 0.0])],
                     {"shape": "segment", "point": [0.0, 0.0], "end": [1.0, 0.0]})

    def test_rectangle(self):
        """Over the face, beside an edge, at two corners."""
        self.normals("grains at a rectangle",
                     [([0.5, 0.3, 0.06], [0.5, 0.3, 0.0]), ([0.4, 0.2, -0.055], [0.4, 0.2, 0.0]),
                      ([-0.03, 0.3, 0.05], [0.0, 0.3, 0.0]), ([0.8, 0.64, 0.04], [0.8, 0.6, 0.0]),
                      ([-0.03, -0.02, 0.045], [0.0, 0.0, 0.0]), ([1.03, 0.62, -0.045], [1.0, 0.6, 0.0])],
                     {"shape": "rectangle", "point": [0.0, 0.0, 0.0], "edge_a": [1.0, 0.0, 0.0], "edge_b": [0.0, 0.6, 0.0]})

    def test_directions_of_any_length(self):
        """The square of a normal or of an axis may be beyond the range of numbers: only its direction counts."""
        down = np.array([0.6, 0.0, -0.8])
        for title, boundary in (("plane", lambda length: plane([0, 0, 0], -length * down)),
                                ("cylinder", lambda length: {"shape": "cylinder", "point": [0.0, 0.0, 0.0], "radius": 0.3,
                                                             "axis": floats(length * np.array([0.8, 0.0, 0.6]))})):
            wanted = None
            for length in (1.0, 1e-200, 1e200):
                record = self.play(f"{title} of {length}", [Grain(-0.1 * down)], [boundary(length)], G * down, 150)
                wanted = record.position if wanted is None else wanted
                self.verify(f"{title}, direction of length {length}", "place of a grain [m]", record.position, wanted, 1e-14)
            self.assertGreater(np.abs(wanted[-1] - wanted[0]).max(), 0.04)

    def test_removal_at_times_in_decimals(self):
        """A boundary goes in the first step that begins at its time, also where the time of the step is smaller by rounding: 57 steps of 3e-4 s."""
        for step, count in ((3e-4, 57), (3e-4, 301), (6e-4, 57), (1e-3, 57)):
            self.step = step
            record = self.play(f"gone after {count} of {step}", [Grain((0.0, RADIUS), radius=RADIUS)], [plane((0, 0), (0, 1), remove_at=round(count * step, 7))],
                               (0.0, -G), count + 3, output={"every": 1})
            self.verify("a plane that is removed", f"speed after {count} steps of {step} s [m/s]", record.velocity[:, 0, 1],
                        -G * step * np.maximum(record.step - count, 0), 1e-12)

    def test_removal(self):
        """A ball at rest falls from the time on when its ground is taken away."""
        def check(dimension):
            up = np.eye(dimension)[-1]
            record = self.play(f"removal {dimension}", [Grain(RADIUS * up, radius=RADIUS)],
                               [plane(0 * up, up, remove_at=0.125)], -G * up, 100)
            self.verify(f"ground taken away, {dimension}D", "velocity [m/s]", record.velocity[:, 0],
                        -G * np.maximum(record.time - 0.125, 0.0)[:, None] * up, 1e-12)
        self.both(check)

    def test_outlet(self):
        """Grains that fall through an outlet are counted and gone, one after the other; a scene without any goes on. Disks on two ranks and
        spheres on one, and in `./gravier test long` both on both."""
        def check(dimension):
            e, n = np.eye(dimension), 4
            heights = 0.1 + 0.13 * np.arange(n)
            grains = [Grain(0.4 * k * e[0] + height * e[-1], radius=RADIUS) for k, height in enumerate(heights)]
            for ranks in (1, 2) if LONG else (4 - dimension,):
                outlet = {"shape": "outlet", "point": [0.0] * dimension, "normal": floats(e[-1])}
                record = self.play(f"outlet {dimension} {ranks}", grains, [outlet], -G * e[-1], 200, ranks,
                                   solver={"method": "nscdd"}, decomposition={"subdomains": 2})
                left = record.run.history()["left"]
                case = f"falling out, {dimension}D, ranks: {ranks}"
                self.verify(case, "grains that have left", left.sum(), n, 0.5)
                self.assertEqual([len(ids) for ids in record.present], [n, *(n - np.cumsum(left).astype(int))])
                gone = record.time[1:][left > 0]
                self.assertEqual(len(gone), n)
                # gone at the end of the first step in whose middle the centre is behind
                self.verify(case, "times [s]", gone, np.sqrt(2 * heights / G) + self.step, 0.5 * self.step + 1e-12)
        self.both(check)


if __name__ == "__main__":
    unittest.main()
