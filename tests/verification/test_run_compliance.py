"""Compliant contacts in whole runs against formulas: impacts on springs and dashpots, the force of Hertz, a tangential spring that
slides, energy, equilibria; bad input."""
import itertools

import numpy as np

from small_scenes import G, INERTIA, Grain, SmallScene, plane

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
                record = self.drop(f"hertz {pair} {wanted} {count}", 3, duration / count, 2 * count, law, pair=pair, every=1)
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


class Tangential(ComplianceScene):

    def test_slope(self):
        """On a slope below the angle of friction a ball that cannot turn comes to rest where m g sin a = k_t x, at both ends of its
        spring; beyond it slides with g (sin a - mu cos a)."""
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


class Input(ComplianceScene):

    def refused(self, title, **law):
        from gravier_runs import run_case
        run = run_case({"scene": {"bodies": "lattice", "lattice_count": [2, 2], "radius_min": 0.05, "radius_max": 0.05},
                        "material": MATERIAL, "law": [{"materials": ["m"], **law}], "time": {"step": 1e-3, "steps": 1}},
                       directory=self.here(title))
        self.assert_status(run, 2)
        self.assertEqual(len(run.stderr.strip().splitlines()), 1, run.stderr)
        return run.stderr

    def test_bad_values(self):
        for key, value, expected in (("normal_stiffness", -1.0, "at least 0"), ("spring_restitution", 0.0, "in (0, 1]"),
                                     ("spring_restitution", 1.5, "in (0, 1]"), ("spring_theta", 0.4, "in [0.5, 1]"),
                                     ("stiffness_ratio", 0.0, "greater than 0"), ("pull_off_force", -1.0, "at least 0")):
            text = self.refused(f"{key} {value}", **{"kind": "elastic", "normal_stiffness": 1e4, key: value})
            self.assertIn(key, text)
