"""Compliant contacts in whole runs against formulas: impacts on springs and dashpots, the force of Hertz, a tangential spring that
slides, energy, equilibria; bad input."""
import itertools
import os
import re

import numpy as np

from gravier_runs import LONG, each, merged, run_case, write
from shaped_scenes import body, prepare, shaped_case
from small_scenes import EPS, G, Grain, SmallScene, plane

RADIUS, MASS, STIFFNESS = 0.05, 0.7, 7000.0
#: time and step of a half period of a ball on the plane
FREQUENCY = np.sqrt(STIFFNESS / MASS)
MATERIAL = [{"name": "m"}]


def elastic(**values):
    return {"materials": ["m"], "kind": "elastic", **values}


def rate(errors):
    """Order of convergence from the first to the last of errors at steps each half as long."""
    errors = np.abs(errors)
    return np.log2(errors[0] / errors[-1]) / (len(errors) - 1)


def up(dimension):
    return np.eye(dimension)[-1]


class ComplianceScene(SmallScene):

    def drop(self, title, dimension, step, steps, law, speed=1.0, lead=0.3, pair=False, **more):
        """A ball, or two that meet head on, `lead` steps of way before they touch."""
        self.step = step
        n = up(dimension)
        grains = [Grain((RADIUS + lead * step * speed) * n, -speed * n, radius=RADIUS, mass=MASS)]
        walls = [plane(0 * n, n, material="m")]
        if pair:
            grains = [Grain((RADIUS + 0.5 * lead * step * speed) * n * sign, -0.5 * speed * n * sign, radius=RADIUS, mass=MASS)
                      for sign in (1, -1)]
            walls = []
        output = {"every": steps if "every" not in more else more.pop("every"), "energy": True}
        return self.play(title, grains, walls, steps=steps, material=MATERIAL, law=[law], output=output, **more)


class Impacts(ComplianceScene):

    def rebounds(self, title, dimension, law, counts, frequency=FREQUENCY, **more):
        found = []
        for count in counts:
            record = self.drop(f"{title} {dimension} {count}", dimension, np.pi / frequency / count, 2 * count, law, **more)
            v = record.velocity[-1, :, -1]
            found.append(v[0] if len(v) == 1 else v[0] - v[1])
        return np.array(found)

    def test_elastic_impact(self):
        """Without a dashpot a ball comes back with its velocity, and two do: the second order in the step at theta = 1/2. At theta
        = 1 the step damps by exp(-pi h omega/2) to first order."""
        for dimension, pair in itertools.product((2, 3), (False, True)):
            with self.subTest(dimension=dimension, pair=pair):
                frequency = FREQUENCY * np.sqrt(1 + pair)
                law = elastic(normal_stiffness=STIFFNESS, spring_theta=0.5)
                found = self.rebounds(f"elastic {pair}", dimension, law, (20, 40, 80), frequency, pair=pair)
                self.assertGreater(rate(found - 1), 1.9)
                self.verify("impact on a spring", f"restitution, h omega = pi/80, {'two balls' if pair else 'plane'}, {dimension}D",
                            found[-1], 1, 1e-5)
        law = elastic(normal_stiffness=STIFFNESS)
        found = self.rebounds("damped by the step", 3, law, (80, 160))
        self.verify("impact on a spring, theta = 1", "restitution, h omega = pi/160", found[-1], np.exp(-np.pi**2 / 320), 2e-4)
        self.assertGreater(rate(found - np.exp(-np.pi**2 / 2 / np.array([80, 160]))), 1.8)

    def test_oblique_impact(self):
        """A ball whose springs swing at the same frequency along both directions sticks all through its impact. Its velocity follows
        that of the spring from where it touches in a step, and that of its contact comes back reversed: of the second order."""
        speed = 0.5
        for dimension, lead in itertools.product((2, 3), (0.0, 0.3, 0.8)):
            share = 1 / 3 if dimension == 2 else 2 / 7
            law = elastic(normal_stiffness=STIFFNESS, stiffness_ratio=share, friction=1.0, spring_theta=0.5)
            with self.subTest(dimension=dimension, lead=lead):
                errors = []
                for count in (20, 40, 80):
                    self.step = np.pi / FREQUENCY / count
                    n = up(dimension)
                    ball = Grain((RADIUS + lead * self.step) * n, speed * np.eye(dimension)[0] - n, radius=RADIUS, mass=MASS)
                    record = self.play(f"oblique {dimension} {lead} {count}", [ball], [plane(0 * n, n, material="m")], steps=2 * count,
                                       material=MATERIAL, law=[law], output={"every": count // 2})
                    phase = FREQUENCY * (record.time[[1, -1]] - lead * self.step)
                    exact = 1 - share * (1 - np.cos(np.minimum(phase, np.pi)))
                    errors.append(record.velocity[[1, -1], 0, 0] / speed - exact)
                for part, when in zip(np.transpose(errors), ("at the largest compression", "rebound")):
                    self.assertGreater(rate(part), 1.8)
                    self.verify("oblique impact on springs", f"velocity {when}, h omega = pi/80, {dimension}D", part[-1], 0, 1e-4)

    def test_restitution(self):
        """The dashpot returns the restitution asked for, of a ball on a plane and of two, whatever their speed: second order."""
        for wanted, pair, speed in ((0.8, False, 1.0), (0.5, True, 1.0), (0.5, False, 0.01), (0.1, False, 1.0)):
            law = elastic(normal_stiffness=STIFFNESS, spring_restitution=wanted, spring_theta=0.5)
            found = self.rebounds(f"restitution {wanted} {pair} {speed}", 3, law, (40, 160), FREQUENCY * np.sqrt(1 + pair),
                                  pair=pair, speed=speed) / speed
            self.verify("impact on a spring and a dashpot", f"restitution {wanted} at {speed} m/s", found[-1], wanted, 4e-5)

    def test_time_of_contact(self):
        """A ball is in contact for pi/omega: it comes back to where it touched then."""
        count = 400
        record = self.drop("time", 3, np.pi / FREQUENCY / count, count + 40, elastic(normal_stiffness=STIFFNESS, spring_theta=0.5),
                           every=1)
        gap = record.position[:, 0, -1] - RADIUS
        inside = np.nonzero(gap < 0)[0]
        # straight lines through the first and the last crossing
        first, last = inside[0], inside[-1]
        begin = record.time[first] - gap[first] / record.velocity[first, 0, -1]
        end = record.time[last] - gap[last] / record.velocity[last, 0, -1]
        self.verify("impact on a spring", "time of contact times omega over pi", (end - begin) * FREQUENCY / np.pi, 1, 2e-4)
        self.verify("impact on a spring", "greatest compression times omega over v", -gap.min() * FREQUENCY, 1, 2e-5)

    def test_hertz(self):
        """Of elastic spheres: x_max = (5 m v^2/(4 K))^(2/5), time of contact 2.9433 x_max/v (Landau and Lifshitz), restitution by the
        dashpot."""
        young, poisson = 1.0e7, 0.3
        for pair, wanted in ((False, 1.0), (True, 1.0), (False, 0.6)):
            law = {"materials": ["m"], "kind": "hertz", "young_modulus": young, "poisson_ratio": poisson, "spring_theta": 0.5,
                   "spring_restitution": wanted}
            k = 4 / 3 * young / (2 * (1 - poisson**2)) * np.sqrt(RADIUS / (1 + pair))
            deepest = (1.25 * MASS / (1 + pair) / k) ** 0.4
            duration = 2.9432751 * deepest
            rebound, depth = [], []
            for count in (50, 100, 200):
                # all states of the last run alone, whose depth and time of contact are compared
                record = self.drop(f"hertz {pair} {wanted} {count}", 3, duration / count, 2 * count, law, pair=pair,
                                   every=1 if count == 200 else 2 * count)
                z, v = record.position[:, :, -1], record.velocity[:, :, -1]
                gap = z[:, 0] - RADIUS if not pair else z[:, 0] - z[:, 1] - 2 * RADIUS
                v = v[:, 0] if not pair else v[:, 0] - v[:, 1]
                rebound.append(v[-1])
                depth.append(-gap.min())
            inside = np.nonzero(gap < 0)[0]
            begin, end = (record.time[i] - gap[i] / v[i] for i in (inside[0], inside[-1]))
            title = f"Hertz, {'two spheres' if pair else 'plane'}"
            self.verify(title, f"restitution {wanted}", rebound[-1], wanted, 1e-3)
            # a dashpot that sets in with the fourth root of the compression leaves the order 5/4
            self.assertGreater(rate(np.array(rebound) - wanted), 1.7 if wanted == 1 else 1.2, (title, rebound))
            if wanted == 1:
                self.verify(title, "greatest compression over that of the formula", depth[-1] / deepest, 1, 1e-3)
                self.verify(title, "time of contact over that of the formula", (end - begin) / duration, 1, 1e-3)

    def test_sliding_impact(self):
        """A fast ball slides all through its impact, with friction against the way it goes: it loses mu (1 + e) v_n of its speed whatever the
        tangential dashpot is. The springs of Hertz and Mindlin never hold more than the energy of the impact along the normal."""
        friction, wanted, speed = 0.3, 0.6, 20.0
        laws = {"elastic": {"normal_stiffness": STIFFNESS},
                "hertz": {"young_modulus": 1.0e7, "poisson_ratio": 0.3}}
        for (kind, keys), count in itertools.product(laws.items(), (100, 400)):
            law = {"materials": ["m"], "kind": kind, "friction": friction, "spring_theta": 0.5, "spring_restitution": wanted,
                   "tangential_damping": 1.0, **keys}
            duration = np.pi / FREQUENCY
            if kind == "hertz":
                k = 4 / 3 * 1.0e7 / (2 * (1 - 0.3**2)) * np.sqrt(RADIUS)
                duration = 2.9432751 * (1.25 * MASS / k) ** 0.4
            self.step = duration / count
            ball = Grain([0.0, 0.0, RADIUS + 0.3 * self.step], [speed, 0.0, -1.0], radius=RADIUS, mass=MASS)
            record = self.play(f"sliding {kind} {count}", [ball], [plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], material="m")], steps=2 * count,
                               material=MATERIAL, law=[law], output={"every": 2 * count, "energy": True})
            rebound = record.velocity[-1, 0, -1]
            self.verify(f"sliding impact, {kind}", f"loss of speed over mu (1 + e) v_n, {count} steps",
                        (speed - record.velocity[-1, 0, 0]) / (friction * (1 + rebound)), 1, 1e-9)
            if kind == "hertz":
                self.assertLess(record.run.history()["elastic_energy"].max(), 0.5 * MASS)


class Energies(ComplianceScene):

    def test_ball_that_swings(self):
        """A ball that stays on the plane swings with omega' = 2/h atan(h omega/2), and neither energy nor amplitude drift."""
        count, periods = 20, 500
        self.step = 2 * np.pi / FREQUENCY / count
        rest = MASS * G / STIFFNESS
        n = up(3)
        record = self.play("swing", [Grain((RADIUS - 1.5 * rest) * n, radius=RADIUS, mass=MASS)], [plane(0 * n, n, material="m")],
                           -G * n, steps=count * periods, material=MATERIAL,
                           law=[elastic(normal_stiffness=STIFFNESS, spring_theta=0.5)], output={"every": 97, "energy": True})
        z = record.position[:, 0, -1] - RADIUS + rest
        turned = 2 / self.step * np.arctan(0.5 * self.step * FREQUENCY)
        self.verify("ball that swings on a plane", "place [m]", z, -0.5 * rest * np.cos(turned * record.time), 1e-8 * rest)
        history = record.run.history()
        total = history["kinetic_translation"] + history["elastic_energy"] + history["potential_energy"]
        self.verify("ball that swings on a plane", "energy over that of the start", total / total[0], 1, 1e-11)
        self.verify("ball that swings on a plane", "dissipated [J]", history["dissipated_normal"], 0, 1e-11 * abs(total[0]))

    def test_chain(self):
        """Compressed balls between two walls swing in their modes, omega = 2 sqrt(k/m) sin(j pi/(2 (n + 1))), as the step has it:
        omega' = 2/h atan(h omega/2). Long waves run with the speed of sound d sqrt(k/m)."""
        n, depth, small = 9, 1e-3, 1e-5
        along = np.array([1.0, 0.0, 0.0])
        self.step = 0.2 / FREQUENCY
        pitch = 2 * RADIUS - depth
        number = np.arange(1, n + 1)
        for mode in (1, 2, 9):
            shape = np.sin(mode * np.pi * number / (n + 1))
            grains = [Grain((RADIUS - depth + (k - 1) * pitch) * along, small * shape[k - 1] * FREQUENCY * along, radius=RADIUS,
                            mass=MASS) for k in number]
            end = 2 * (RADIUS - depth) + (n - 1) * pitch
            record = self.play(f"chain {mode}", grains,
                               [plane(0 * along, along, material="m"), plane(end * along, -along, material="m")], steps=400, material=MATERIAL, law=[elastic(normal_stiffness=STIFFNESS, spring_theta=0.5)],
                               output={"every": 50}, scene={"start_overlap": 0.1})
            frequency = 2 * FREQUENCY * np.sin(mode * np.pi / (2 * (n + 1)))
            turned = 2 / self.step * np.arctan(0.5 * self.step * frequency)
            wanted = small * FREQUENCY * shape * np.cos(turned * record.time[:, None])
            self.verify("chain of nine balls between walls", f"velocity of mode {mode} [m/s]", record.velocity[:, :, 0], wanted,
                        1e-9 * small * FREQUENCY)

    def test_balance_of_damped_impacts(self):
        """Energies close to rounding with dashpots, friction and sliding springs, and what is lost is dissipated."""
        for dimension in (2, 3):
            axes = np.eye(dimension)
            grains = [Grain(0.1 * (k % 3) * axes[0] + (0.1 + 0.12 * (k // 3)) * axes[-1], (0.3 - 0.1 * k) * axes[0] - axes[-1],
                            radius=RADIUS, mass=MASS) for k in range(9)]
            self.step = 0.02 / FREQUENCY
            record = self.play(f"balance {dimension}", grains, [plane(0 * axes[0], axes[-1], material="m")], -G * axes[-1], steps=400,
                               material=MATERIAL, output={"every": 400, "energy": True}, solver={"tolerance": 1e-10},
                               law=[elastic(normal_stiffness=STIFFNESS, spring_restitution=0.7, friction=0.4, tangential_damping=0.5,
                                            spring_theta=0.5)])
            history = record.run.history()
            start = 0.5 * MASS * sum(np.sum(np.square(grain.velocity)) for grain in grains)
            self.assertLess(np.abs(history["energy_error"]).max(), 1e-11 * start)
            self.assertGreater(history["elastic_energy"].max(), 0.05 * start)
            # a sliding or parting contact may give back roundings only
            for name in ("dissipated_normal", "dissipated_friction"):
                self.assertGreater(history[name][-1], 0.01 * start)
                self.assertGreater(np.diff(history[name]).min(), -1e-3 * start)


class Input(ComplianceScene):

    def refused(self, title, **law):
        more = law.pop("more", {})
        run = run_case(merged({"scene": {"bodies": "lattice", "lattice_count": [2, 2], "radius_min": 0.05, "radius_max": 0.05},
                               "material": MATERIAL, "law": [{"materials": ["m"], **law}], "time": {"step": 1e-3, "steps": 1}}, more),
                       directory=self.here(title))
        self.assert_status(run, 2)
        self.assertEqual(len(run.stderr.strip().splitlines()), 1, run.stderr)
        return run.stderr

    def test_bad_values(self):
        for key, value, expected in (("normal_stiffness", -1.0, ">= 0"), ("spring_restitution", 0.0, "in (0, 1]"),
                                     ("spring_restitution", 1.5, "in (0, 1]"), ("spring_theta", 0.4, "in [0.5, 1]"),
                                     ("stiffness_ratio", 0.0, "> 0"), ("pull_off_force", -1.0, ">= 0")):
            text = self.refused(f"{key} {value}", **{"kind": "elastic", "normal_stiffness": 1e4, key: value})
            self.assertIn(f"&law (the 1st) {key} = {value}: expected a finite real number {expected}", text)
        for key in ("stiffness_ratio", "tangential_damping"):
            self.assertIn(f"&law (the 1st) {key} = 1e+305: expected a number of at most 1e30 in size",
                          self.refused(f"{key} huge", kind="elastic", normal_stiffness=1e4, **{key: 1e305}))
        self.assertIn("&law (the 1st) pivoting_friction = 0.2: expected a finite real number >= 0; 0 where dimension = 2",
                      self.refused("pivoting disks", kind="elastic", normal_stiffness=1e4, pivoting_friction=0.2))
        text = self.refused("poisson", kind="hertz", young_modulus=1e7, poisson_ratio=0.6, more={"scene": {"dimension": 3, "lattice_count": [2, 2, 2]}})
        self.assertIn("poisson_ratio = 0.6: expected a finite real number in [0, 0.5]", text)

    def test_values_that_do_not_go_together(self):
        either = "expected either a normal_stiffness or a stiffness_number greater than 0"
        self.assertIn(f"&law (the 1st) normal_stiffness: {either}", self.refused("none", kind="elastic"))
        self.assertIn("stiffness_number = 1.0: expected 0 beside a normal_stiffness, which is given too",
                      self.refused("both", kind="elastic", normal_stiffness=1.0, stiffness_number=1.0, stiffness_pressure=1.0))
        self.assertIn("stiffness_pressure: expected a pressure greater than 0",
                      self.refused("no pressure", kind="elastic", stiffness_number=1e4))
        self.assertIn("stiffness_pressure = 1.0: expected 0 without a stiffness_number, which it would multiply",
                      self.refused("pressure alone", kind="elastic", normal_stiffness=1.0, stiffness_pressure=1.0))
        self.assertIn("kind = 'hertz': expected a law that holds in 2D", self.refused("disks", kind="hertz", young_modulus=1e7))
        self.assertIn("fclib_step = 1: expected none where contacts are compliant",
                      self.refused("fclib", kind="elastic", normal_stiffness=1e4, more={"output": {"fclib_step": 1}}))

    def test_hertz_is_of_spheres(self):
        directory = self.here("blocks")
        os.makedirs(directory)
        write(os.path.join(directory, "a.shapes"), "shape block\nrounding 0.002\nbox 0.1 0.1 0.1\n")
        write(os.path.join(directory, "bodies.csv"), "id,x,y,z,shape,scale\n1,0,0,1,block,1\n2,0,0,2,block,1\n")
        run = run_case({"scene": {"dimension": 3, "bodies": "file", "bodies_file": "bodies.csv", "shapes": "a.shapes"},
                        "material": MATERIAL, "law": [{"materials": ["m"], "kind": "hertz", "young_modulus": 1e7}],
                        "time": {"step": 1e-3, "steps": 1}}, directory=directory)
        self.assert_status(run, 2)
        self.assertIn("case.nml: &law kind = 'hertz': expected another, as 'elastic', where bodies have shapes: this one is of spheres",
                      run.stderr)

    def test_stiffness_that_the_step_does_not_resolve(self):
        """The log names h sqrt(k/m) and the step that would do, in a run and in --check, and is silent where the step is fine."""
        self.step = 0.02 / FREQUENCY
        n = up(3)
        grain = Grain((RADIUS - 1e-6) * n, radius=RADIUS, mass=MASS)
        for factor, warned in ((1.0, False), (50.0, True)):
            stiffness = STIFFNESS * factor**2
            record = self.play(f"warning {factor}", [grain], [plane(0 * n, n, material="m")], -G * n, steps=3, material=MATERIAL,
                               law=[elastic(normal_stiffness=stiffness)])
            lines = [line for line in record.run.stdout.splitlines() if "h sqrt(k/m)" in line]
            self.assertEqual(sum("warning" in line for line in lines), warned, lines)
            self.assertIn("compliant contacts are deformed by at most", lines[-1])
            if warned:
                figures = re.search(r"h sqrt\(k/m\) = (\S+) at .*; at most (\S+) s would do", lines[0])
                np.testing.assert_allclose([float(figure) for figure in figures.groups()], [1.0, 0.5 * self.step], rtol=1e-2)


class Tangential(ComplianceScene):

    def test_slope(self):
        """On a slope below the angle of friction a ball that cannot turn comes to rest where m g sin a = k_t x; beyond it slides with
        g (sin a - mu cos a)."""
        ratio, friction = 0.4, 0.5
        self.step = 0.05 / FREQUENCY
        for dimension, angle in itertools.product((2, 3), (0.3, 0.8)):
            along, n = np.eye(dimension)[0], up(dimension)
            pull = np.sin(angle)
            record = self.play(f"slope {dimension} {angle}", [Grain((RADIUS - MASS * G * np.cos(angle) / STIFFNESS) * n, radius=RADIUS,
                                                                   mass=MASS)],
                               [plane(0 * n, n, material="m")], G * (pull * along - np.cos(angle) * n), steps=4000, material=MATERIAL,
                               law=[elastic(normal_stiffness=STIFFNESS, friction=friction, stiffness_ratio=ratio,
                                            spring_restitution=0.2, tangential_damping=1.0)], scene={"rotation": False},
                               output={"every": 1000})
            if np.tan(angle) < friction:
                self.verify(f"ball on a slope, {dimension}D", "elongation [m]", record.position[-1, 0, 0],
                            MASS * G * pull / (ratio * STIFFNESS), 1e-12)
            else:
                self.verify(f"ball on a slope, {dimension}D", "acceleration [m/s^2]",
                            (record.velocity[-1, 0, 0] - record.velocity[-2, 0, 0]) / (1000 * self.step),
                            G * (pull - friction * np.cos(angle)), 1e-9)

    def test_loop(self):
        """Mindlin's loading and unloading with linear springs: a ball pressed between two planes that are driven to and fro against each
        other stays where it is. The tangential force follows the displacement with the stiffness k_t between the bounds of friction: a
        loop of hysteresis, to rounding."""
        ratio, friction, depth, speed = 0.4, 0.5, 1e-3, 0.01
        # thirty steps from no force to sliding: each state is written, and the discrete law is followed to rounding at any step
        self.step = 1.0 / 256
        # amplitudes over the displacement at which sliding begins
        yields = friction * depth / ratio
        turns = np.cumsum([0, 1.5, 2.5, 1.5, 2.7, 0.4]) * yields / speed
        turns = (np.round(turns / self.step) * self.step).tolist()
        tables = {}
        for name, sign in (("up.csv", -1), ("down.csv", 1)):
            rows = ["time,vx"]
            for begin, end in zip(turns[:-1], turns[1:]):
                rows += [f"{begin + (begin > 0) * self.step / 2!r},{sign * speed!r}", f"{end - self.step / 2!r},{sign * speed!r}"]
                sign = -sign
            tables[name] = "\n".join(rows) + "\n"
        for dimension, theta in itertools.product((2, 3), (0.5, 1.0)):
            n = up(dimension)
            record = self.play(f"loop {dimension} {theta}", [Grain(0 * n, radius=RADIUS, mass=MASS)],
                               [plane(-(RADIUS - depth) * n, n, material="m", table="down.csv"),
                                plane((RADIUS - depth) * n, -n, material="m", table="up.csv")], steps=int(turns[-1] / self.step) - 1,
                               files=tables, material=MATERIAL, output={"every": 1, "contacts": True},
                               law=[elastic(normal_stiffness=STIFFNESS, friction=friction, stiffness_ratio=ratio,
                                            spring_theta=theta)],
                               scene={"rotation": False, "start_overlap": 0.1})
            states = record.contacts[1:]
            normal = np.array([state["impulse"][0, 0] for state in states]) / self.step
            found = np.array([state["impulse"][0, 1] for state in states]) / self.step
            # t = -x on the lower plane, x in space; the force on the ball follows the plane
            found *= -1 if dimension == 2 else 1
            self.verify(f"ball between planes driven to and fro, {dimension}D", "place [m]", record.position, 0, 1e-15)
            self.verify(f"ball between planes driven to and fro, {dimension}D", "normal force [N]", normal, STIFFNESS * depth, 1e-10)
            v = record.boundary["velocity"][:, 0, 0]
            v[0] = speed
            # displacement at the instant of the spring, from that of the middle of each step
            x = np.concatenate([[0], np.cumsum(0.5 * self.step * (v[:-1] + v[1:]))])
            middle = x[:-1] + 0.5 * self.step * v[:-1]
            at = middle - (1 - theta)**2 * self.step * v[:-1] + theta**2 * self.step * v[1:]
            # the spring begins at the start of the first step
            force, kept = [], middle[0]
            for k, here in enumerate(at):
                elongation = np.clip(kept + here - middle[k], -yields, yields)
                force.append(ratio * STIFFNESS * elongation)
                # at the middle of the next step
                if k + 1 < len(at):
                    kept = elongation + middle[k + 1] - here
            bound = friction * STIFFNESS * depth
            self.verify(f"ball between planes driven to and fro, {dimension}D", f"tangential force [N], theta = {theta}", found, force,
                        1e-11 * bound)
            self.assertGreater(np.max(force), 0.999 * bound)
            self.assertLess(np.min(force), -0.999 * bound)


class Turning(ComplianceScene):

    def test_plate_on_a_turntable(self):
        """A plate that sticks to a turntable goes round with it: its springs turn with both. Springs that keep their direction in space let it
        creep by 2 pi times their elongation in each revolution, 3e-3 rad here. Energies balance to rounding."""
        here = self.here("turntable")
        os.makedirs(here)
        write(os.path.join(here, "plate.shapes"), "shape plate\nbox 0.1 0.1 0.02\n")
        turn = 2.0 * np.pi
        write(os.path.join(here, "plate.csv"), f"id,x,y,z,shape,vy,wz,material\n1,0.2,0,0.0098,plate,{0.2 * turn!r},{turn!r},1\n")
        run = run_case({"scene": {"dimension": 3, "bodies": "file", "bodies_file": "plate.csv", "shapes": "plate.shapes", "density": 1500.0,
                                  "wall_material": "m"},
                        "material": MATERIAL,
                        "law": [elastic(normal_stiffness=2e4, friction=2.0, spring_restitution=0.3, tangential_damping=1.0)],
                        "boundary": [{"name": "table", "shape": "plane", "normal": [0.0, 0.0, 1.0], "rotation": [0.0, 0.0, turn]}],
                        "time": {"step": 1e-3, "steps": 3000}, "solver": {"accuracy": 1e-6},
                        "output": {"directory": "results", "every": 1000, "energy": True}}, directory=here)
        self.assert_status(run, 0)
        found = run.results()
        places = [found[f"/steps/{step}/bodies/position"][0] for step in (2000, 3000)]
        angles = [np.arctan2(place[1], place[0]) for place in places]
        self.assertLess(abs(angles[1] - angles[0]), 2e-4)
        self.assertLess(np.abs(run.history()["energy_error"]).max(), 1e-12)


    def test_ball_that_lands_spinning(self):
        """A ball that spins about the normal of an oblique impact, and sticks: its spring turns while it is stretched, and that takes no energy
        but for the second order of the step. A spring that turned before or after it is stretched would give 1e-4 J."""
        here = self.here("spinning")
        os.makedirs(here)
        write(os.path.join(here, "ball.csv"), "id,x,y,z,radius,vx,vz,wz,material\n1,0,0,0.05,0.05,0.5,-1,300,1\n")
        run = run_case({"scene": {"dimension": 3, "bodies": "file", "bodies_file": "ball.csv", "density": 1500.0, "wall_material": "m"},
                        "material": MATERIAL,
                        "law": [elastic(normal_stiffness=2e5, stiffness_ratio=2 / 7, friction=1.0, spring_theta=0.5)],
                        "boundary": [{"name": "ground", "shape": "plane", "normal": [0.0, 0.0, 1.0]}],
                        "time": {"step": 1e-4, "steps": 90}, "solver": {"accuracy": 1e-9},
                        "output": {"directory": "results", "every": 0, "energy": True}}, directory=here)
        self.assert_status(run, 0)
        history = run.history()
        self.assertGreater(history["elastic_energy"].max(), 0.1)
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-12)
        self.assertLess(np.abs(history["dissipated_friction"][:60]).max(), 1e-6)


class Attraction(ComplianceScene):

    def test_pull_off(self):
        """A ball that hangs under a plane by the attraction of bodies that touch, k x = F - m g; a stronger pull tears it off."""
        for dimension, pull in itertools.product((2, 3), (0.9, 1.1)):
            n = up(dimension)
            force = 20.0
            weight = pull * force / MASS
            self.step = 0.05 / FREQUENCY
            depth = (force - MASS * weight) / STIFFNESS
            record = self.play(f"hangs {dimension} {pull}", [Grain(-(RADIUS - max(depth, 1e-5)) * n, radius=RADIUS, mass=MASS)],
                               [plane(0 * n, -n, material="m")], -weight * n, steps=2000, material=MATERIAL,
                               law=[elastic(normal_stiffness=STIFFNESS, pull_off_force=force, spring_restitution=0.3)],
                               output={"every": 2000})
            place = record.position[-1, 0, -1]
            if pull < 1:
                self.verify(f"ball that hangs on a plane, {dimension}D", "place [m]", place, -RADIUS + depth, 1e-12)
            else:
                self.assertLess(place, -RADIUS - 0.5 * (weight - force / MASS) * (0.5 * record.time[-1])**2)


class RigidLimit(ComplianceScene):

    def test_column_and_block(self):
        """One step of a column at rest that gravity presses, and of one that slides on a slope: velocities tend to those of rigid
        contacts with the first order of 1/k."""
        for friction, pull in ((0.0, 0.0), (0.3, 0.5), (0.8, 0.5)):
            found, stiffnesses = [], [1e9, 1e10, 1e11]
            grains = [Grain([0, 0, (2 * k + 1) * RADIUS], radius=RADIUS, mass=MASS) for k in range(6)]
            gravity = G * np.array([np.sin(pull), 0, -np.cos(pull)])
            self.step = 1e-3
            # friction on the ground alone: a column that slides or sticks as one
            walls = [plane([0, 0, 0], [0, 0, 1], material="m")]
            options = {"steps": 1, "material": MATERIAL, "scene": {"rotation": False}, "solver": {"tolerance": 1e-14}}
            rigid = self.play(f"rigid {friction} {pull}", grains, walls, gravity,
                              law=[{"materials": ["m"], "kind": "coulomb", "friction": friction}], **options)
            for stiffness in stiffnesses:
                record = self.play(f"column {friction} {pull} {stiffness}", grains, walls, gravity,
                                   law=[elastic(normal_stiffness=stiffness, friction=friction)], **options)
                found.append(np.abs(record.velocity[-1] - rigid.velocity[-1]).max())
            order = np.log10(np.array(found[:-1]) / found[1:])
            self.assertTrue(np.all(np.abs(order - 1) < 0.05), (friction, pull, found))
            self.verify("column of six as stiffness grows", f"distance of the velocities from the rigid ones [m/s], friction {friction}",
                        found[-1], 0, 1e-4)

    def test_mirror_of_a_square_that_tips(self):
        """A square tips from a corner onto its side, and its mirror image does: one point becomes two, and the one that stays keeps the elongation of
        its spring in both."""
        library = "shape square\nrounding 0.001\npolygon -0.05 -0.05  0.05 -0.05  0.05 0.05  -0.05 0.05\n"
        ground = {"name": "ground", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
        lean = np.radians(24.0)
        place = [0.0, 0.05 * np.sqrt(2.0) * np.cos(np.pi / 4 - lean) - 3e-4]
        found = []
        for sign in (1.0, -1.0):
            directory = prepare(self.here(f"tips {sign}"), 2, [body("square", place, turn=sign * lean, spin=-2.0 * sign)], library)
            run = run_case(shaped_case(2, [ground], {
                "scene": {"wall_material": "m", "alert_distance": 0.1}, "material": MATERIAL,
                "law": [elastic(normal_stiffness=1e5, friction=0.5, spring_theta=0.5, spring_restitution=0.3, tangential_damping=0.5)],
                "time": {"step": 5e-4, "steps": 120}, "solver": {"criterion": "residual", "tolerance": 1e-10},
                "output": {"every": 120, "boundary_forces": True}}), directory=directory)
            self.assert_status(run, 0)
            force = run.history()["force_x:ground"]
            self.assertGreater(np.abs(force).max(), 100.0)
            found.append((sign * force, run.results()["/steps/120/bodies/velocity"][0] * [sign, 1.0, sign]))
        for one, other in zip(*found):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(one).max())

    def test_seam(self):
        """Two squares side by side are one body with three points on a plane, whatever its tilt: the corners at the seam are one point. The body
        sinks by m g/3k; it sank by a quarter less when it leaned by more than 1e-5 rad."""
        library = "shape two\npolygon -0.1 -0.05  0 -0.05  0 0.05  -0.1 0.05\npolygon 0 -0.05  0.1 -0.05  0.1 0.05  0 0.05\n"
        ground = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
        for pull in (0.0, 1e-4, 1e-2):
            directory = prepare(self.here(f"seam {pull}"), 2, [body("two", [0.0, 0.05])], library)
            run = run_case(shaped_case(2, [ground], {
                "scene": {"density": 2500.0, "gravity": [pull, -G], "wall_material": "m"}, "material": MATERIAL,
                "law": [elastic(normal_stiffness=1e5, friction=0.5, spring_restitution=0.2, tangential_damping=1.0)],
                "time": {"steps": 1500}, "output": {"every": 1500}}), directory=directory)
            self.assert_status(run, 0)
            found = run.results()
            self.assertEqual(len(found["/steps/1500/contacts/gap"]), 3)
            self.assertAlmostEqual(found["/steps/1500/bodies/position"][0, 1], 0.05 - 50.0 * G / 3e5, delta=1e-8)


class Loads(ComplianceScene):

    def test_load_on_stiff_springs(self):
        """At the default accuracy the forces below a load that has come to stay are right, and so is what the springs hold, however stiff they are for the
        step: errors are compared with what the load does to the springs in a step. A load that swings by a part of it is followed."""
        count, load, step = 20, 100.0, 1.0 / 1024
        slow = {"criterion": "velocity_error", "tolerance": 1e-2, "check_every": 10, "warm_start": True}
        self.step = step
        for stiffness, swing in ((1e6, 0.0), (1e7, 0.0), (1e8, 0.0), (1e7, 0.05)):
            column = [Grain([0.0, RADIUS * (2 * k + 1)], radius=RADIUS) for k in range(count)]
            walls = [plane([0.0, 0.0], [0.0, 1.0], name="base", material="m"),
                     plane([0.0, 2 * RADIUS * count], [0.0, -1.0], name="push", material="m", free=[False, True], mass=2 * MASS, table="push.csv")]
            time = np.arange(0, 2049, 16) * step
            force = load * np.minimum(2.0 * time, 1.0) * (1.0 + swing * np.sin(2 * np.pi * time))
            table = "time,fy\n" + "\n".join(f"{t!r},{-f!r}" for t, f in zip(time.tolist(), force.tolist())) + "\n"
            record = self.play(f"load {stiffness:g} {swing:g}", column, walls, (0.0, 0.0), 2048, files={"push.csv": table}, solver=slow, material=MATERIAL,
                               law=[elastic(normal_stiffness=stiffness, spring_restitution=0.3)], output={"every": 0, "boundary_forces": True, "energy": True})
            history = record.run.history()
            late = history["time"] > 1.0
            wanted = -np.interp(history["time"], time, force)
            at = f"load on springs of {stiffness:g} N/m, swings by {swing:g}"
            self.verify(at, "force on the base [N]", history["force_y:base"][late], wanted[late], 0.012 * load)
            if swing == 0.0:
                # each contact bears it
                self.verify(at, "energy of the springs [J]", history["elastic_energy"][late], 0.5 * (count + 1) * load**2 / stiffness,
                            0.03 * 0.5 * (count + 1) * load**2 / stiffness)
            # h F/m over 1 + h^2 k/m, the mean over contacts of two disks, one on the base and one under the lid, at most 20 each
            squares = sum(number * min(step**2 * stiffness * inverse / MASS, 20.0) for number, inverse in ((count - 1, 2.0), (1, 1.0), (1, 1.5))) / (count + 1)
            self.verify(at, "velocity scale [m/s]", history["velocity_scale"][-1], step * load / MASS / (1.0 + squares), 1e-3 * step * load / MASS)
            self.assertRegex(record.run.stdout, r" m/s: load on springs in \d+ solves")

    def test_load_on_springs_beside_a_slider(self):
        """What stiff springs hold is right beside a body that is fast, against whose motion other errors are compared: the energy varied by a fifth."""
        count, load, stiffness = 20, 100.0, 1e8
        self.step = 1.0 / 1024
        grains = [Grain([0.0, RADIUS * (2 * k + 1)], radius=RADIUS) for k in range(count)] + [Grain([20.0 * RADIUS, RADIUS], [5.0, 0.0], radius=RADIUS, material=2)]
        walls = [{"name": "base", "shape": "segment", "point": [-2 * RADIUS, 0.0], "end": [2 * RADIUS, 0.0], "material": "m"},
                 {"name": "rail", "shape": "segment", "point": [10.0 * RADIUS, 0.0], "end": [30.0, 0.0], "friction": 0.0, "material": "n"},
                 {"name": "push", "shape": "segment", "point": [-2 * RADIUS, 2 * RADIUS * count], "end": [2 * RADIUS, 2 * RADIUS * count], "material": "m",
                  "free": [False, True], "mass": 2 * MASS, "force": [0.0, -load]}]
        record = self.play("springs beside a slider", grains, walls, (0.0, -G), 2000, solver={"criterion": "velocity_error", "tolerance": 1e-2, "check_every": 10,
                           "warm_start": True}, material=[*MATERIAL, {"name": "n"}],
                           law=[elastic(normal_stiffness=stiffness, spring_restitution=0.3, tangential_damping=0.5)],
                           output={"every": 0, "energy": True})
        history = record.run.history()
        self.assertGreater(history["velocity_scale"].min(), 0.2)
        forces = load + MASS * G * np.arange(count + 1)
        wanted = np.sum(forces**2) / (2 * stiffness)
        self.verify("load on springs beside a slider", "energy of the springs [J]", history["elastic_energy"][1000:], wanted, 0.06 * wanted)

    def test_springs_that_bear_nothing(self):
        """A wall with springs above rigid disks at rest that it does not touch changes nothing, and one that touches a few of them counts among
        all contacts that bear something."""
        disks = [Grain([0.0, RADIUS * (2 * k + 1)], radius=RADIUS) for k in range(3)]
        roof = plane([0.0, 6.04 * RADIUS], [0.0, -1.0], name="roof", material="m")
        step, stiffness = 1.0 / 1024, 1e6
        self.step = step
        slow = {"criterion": "velocity_error", "tolerance": 1e-2, "check_every": 10, "warm_start": True}
        for title, floor in (("above", {}), ("below", {"material": "m"})):
            record = self.play(title, [Grain(one.place, radius=RADIUS, material=2) for one in disks], [plane([0.0, 0.0], [0.0, 1.0], name="floor", **floor), roof],
                               (0.0, -G), 600, solver=slow, material=[{"name": "m"}, {"name": "n"}],
                               law=[{"materials": ["m", "n"], "kind": "elastic", "normal_stiffness": stiffness, "spring_restitution": 0.2}],
                               scene={"alert_distance": 0.1 * RADIUS}, output={"every": 0})
            squares = step**2 * stiffness / MASS / 3.0 if floor else 0.0
            self.verify(f"springs {title} rigid disks", "velocity scale [m/s]", record.run.history()["velocity_scale"][-1], step * G / (1.0 + squares), 1e-12)


class Invariance(ComplianceScene):

    def case(self, dimension, **law):
        count = [5, 6] if dimension == 2 else [3, 3, 4]
        return {"scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": count, "radius_min": 0.04, "radius_max": 0.06,
                          "wall_material": "m"},
                "material": MATERIAL,
                "law": [elastic(**{"normal_stiffness": 1e6, "friction": 0.5, "spring_restitution": 0.5, "tangential_damping": 0.5, **law})],
                "time": {"step": 1e-3, "steps": 240}, "solver": {"criterion": "residual", "tolerance": 1e-6},
                "decomposition": {"subdomains": 4}, "output": {"directory": "results", "every": 60, "contacts": True, "energy": True}}

    @staticmethod
    def states(run):
        return {name: value.tobytes() for name, value in run.results().items() if hasattr(value, "tobytes") and "/bodies/" in name
                or "/contacts/" in name}

    def test_ranks_and_restart(self):
        """The same bits on 1 and 2 ranks, disks on 4 too, and after a restart on another number, with elongations, moments and the
        attraction. `./gravier test long` has all on 4 and NSCDD-EP to the end of the fall."""
        for dimension, method, law in ((2, "nscdd", {"rolling_friction": 0.1}), (3, "nscdd_ep", {"pull_off_force": 0.2}),
                                       (3, "schwarz", {"spring_theta": 0.6})):
            with self.subTest(dimension=dimension, method=method):
                # an exchange of the interface of NSCDD-EP costs more than the sweeps between two of them
                steps = 240 if LONG or method != "nscdd_ep" else 100
                case = merged(self.case(dimension, **law), {"solver": {"method": method}, "time": {"steps": steps}})
                name = f"{dimension} {method}"
                runs = each(lambda ranks: run_case(case, ranks, self.here(f"{name} {ranks}")), [(1,), (2,)] + [(4,)] * (LONG or dimension == 2))
                half = steps // 2 // 60 * 60 or 60
                stopped = merged(case, {"time": {"steps": half}, "output": {"checkpoint_every": half}})
                self.assert_status(run_case(stopped, 2, self.here(f"{name} stopped")), 0)
                runs.append(run_case(case, 1, self.here(f"{name} stopped"), options=["--restart"]))
                for run in runs:
                    self.assert_status(run, 0)
                for run in runs[1:]:
                    self.assertEqual(self.states(run), self.states(runs[0]))
                history = runs[0].history()
                self.assertGreater(history["contacts"][-1], 20)
                scale = history["kinetic_translation"].max()
                self.verify("balls that fall on each other, compliant", f"error of the energy balance over the energy, {name}",
                            history["energy_error"] / scale, 0.0, 1e-10)
                np.testing.assert_array_equal(runs[-1].history()["energy_error"][-1], history["energy_error"][-1])

    def test_overlaps_are_deformation(self):
        """Soft balls lie in each other by more than what rigid ones may, and nothing is projected."""
        run = run_case(merged(self.case(3, normal_stiffness=2e3), {"scene": {"overlap_allowed": 1e-4},
                                                                                 "decomposition": {"subdomains": 1}}), directory=self.here("soft"))
        self.assert_status(run, 0)
        self.assertIn("no step projected overlaps", run.stdout)
        self.assertEqual(run.history()["max_overlap"].max(), 0)
        gaps = np.concatenate([value.ravel() for name, value in run.results().items() if name.endswith("/contacts/gap")])
        self.assertLess(gaps.min(), -1e-3)


class Uniqueness(ComplianceScene):
    kappa, pressure = 1e4, 2000.0

    def test_forces_do_not_depend_on_the_way(self):
        """Packings made at a friction of 0.3, solved anew at 0.5 to 1.0 with kappa = 1e4 and a step of h sqrt(k/m) = 3: methods and
        subdomains find the same forces, within 2000 sweeps to 1e-10. One friction each, and all three in `./gravier test long`."""
        made = {"scene": {"bodies": "lattice", "friction": 0.3}, "time": {"step": 1e-3, "steps": 350},
                "solver": {"acceleration": "none", "criterion": "residual", "tolerance": 1e-3, "max_iterations": 20000},
                "output": {"directory": ".", "every": 0, "final_bodies": True}}
        packings = {"C": {"dimension": 3, "lattice_count": [7, 7, 7], "radius_min": 0.008, "radius_max": 0.012, "seed": 1},
                    "G": {"dimension": 2, "lattice_count": [20, 30], "radius_min": 0.006, "radius_max": 0.014, "seed": 1}}
        # of the stiffest contact, measured: h sqrt(k/m) = 3
        steps = {"C": 2.8e-4, "G": 1.6e-4}
        pressures = {"C": 2060.0, "G": 5900.0}
        ways = [("nlgs", 1), ("nscdd", 8), ("nscdd", 64), ("nscdd_ep", 8), ("schwarz", 8), ("schwarz_ec", 8), ("newton", 8)]
        for name, scene in packings.items():
            packed = run_case(merged(made, {"scene": scene}), directory=self.here(f"packing {name}"))
            self.assert_status(packed, 0)
            for friction in (0.5, 0.8, 1.0) if LONG else (1.0,) if name == "C" else (0.5,):
                case = {"scene": {"dimension": scene["dimension"], "bodies": "file", "bodies_file": packed.path("final_bodies.h5"),
                                  "wall_material": "m", "start_overlap": 0.5},
                        "material": MATERIAL, "law": [elastic(friction=friction, stiffness_number=self.kappa,
                                                              stiffness_pressure=pressures[name])],
                        "time": {"step": steps[name], "steps": 1},
                        "solver": {"criterion": "residual", "tolerance": 1e-13, "max_iterations": 20000},
                        "output": {"directory": "results", "every": 1, "contacts": True, "trace": True}}
                runs = each(lambda method, subdomains: run_case(merged(case, {
                    "solver": {"method": method}, "decomposition": {"subdomains": subdomains}}),
                    directory=self.here(f"{name} {friction} {method} {subdomains}")), ways)
                first = None
                for (method, subdomains), run in zip(ways, runs):
                    self.assert_status(run, 0)
                    trace = run.trace()
                    taken = trace["iteration"][np.nonzero(trace["residual"] <= 1e-10)[0][0]]
                    self.assertLessEqual(taken, 2000, (name, friction, method, subdomains))
                    impulse = run.results()["/steps/1/contacts/impulse"]
                    first = impulse if first is None else first
                    scale = np.sqrt(np.mean(np.sum(first**2, axis=1)))
                    self.verify("forces of compliant contacts", f"{name}, friction {friction}, {method} in {subdomains}: impulses over "
                                "their root mean square", impulse / scale, first / scale, 1e-8)
