"""Laws of pairs of materials against formulas, in whole runs: which law is whose, friction that depends on the slip, adhesion and
liquid bridges that are pulled, bonds that break, and all of them on several ranks, in subdomains and after a restart."""
import unittest

import numpy as np

from gravier_runs import each, merged, run_case, write
from small_scenes import EPS, G, INERTIA, Grain, SmallScene, bodies_csv, plane

RADIUS, MASS = 0.05, 0.7
ROLLS_NOT = {"rotation": False}


def law(materials, kind, **values):
    return {"materials": [materials] if isinstance(materials, str) else list(materials), "kind": kind, **values}


def named(*names):
    return [{"name": name} for name in names]


def unit(dimension, axis):
    return np.eye(dimension)[axis]


class Materials(SmallScene):

    def test_two_kinds_on_two_slopes(self):
        """Grains that do not turn slide down with g (sin a - mu cos a), mu that of their pair with the plane; a pair without
        a law has the friction of the scene."""
        self.both(self.slopes)

    def slopes(self, dimension):
        along, up = unit(dimension, 0), unit(dimension, -1)
        for angle in (0.6,):
            grains = [Grain(RADIUS * up + 0.3 * k * along, material=k + 1) for k in range(3)]
            record = self.play(f"slopes {dimension} {angle}", grains, [plane(0 * up, up, material="steel", friction=0.35)],
                               G * (np.sin(angle) * along - np.cos(angle) * up), scene=ROLLS_NOT,
                               material=named("glass", "rubber", "wood", "steel"),
                               law=[law(("glass", "steel"), "coulomb", friction=0.1), law(("steel", "rubber"), "coulomb", friction=0.4)])
            for k, friction in enumerate((0.1, 0.4, 0.35)):
                way = 0.5 * G * (np.sin(angle) - friction * np.cos(angle)) * record.time ** 2
                # Moreau-Jean steps lead the parabola by h v / 2
                wanted = way + 0.0 * record.time
                speed = G * (np.sin(angle) - friction * np.cos(angle)) * record.time
                self.verify("grains of three materials on a slope", f"speed [m/s], mu = {friction}, {dimension}D",
                            record.velocity[:, k, 0], speed, self.rounding(record, speed.max()))
                self.verify("grains of three materials on a slope", f"way [m], mu = {friction}, {dimension}D",
                            record.position[:, k, 0] - 0.3 * k, wanted, self.rounding(record, 1.0))

    def test_no_contact(self):
        """Bodies of two materials whose law is none fly and fall through each other, from a start at which they overlap; others meet,
        on 1 and 2 ranks and in subdomains."""
        self.both(self.pass_through)

    def pass_through(self, dimension):
        along, up = unit(dimension, 0), unit(dimension, -1)
        # 1 and 2 overlap by half of a radius and pass, 3 and 4 meet at rest of each other's centre of mass, 5 falls through the ground, 6 lies on it
        grains = [Grain(0.0 * along, along, material=1), Grain(1.5 * RADIUS * along, -along, material=2),
                  Grain(along, along, material=1), Grain(along + 2.2 * RADIUS * along, -along, material=1),
                  Grain(2.0 * along + (RADIUS - 1.0) * up, material=2), Grain(3.0 * along + (RADIUS - 1.0) * up, material=1)]
        for ranks, subdomains in ((1, 1), (2, 3)):
            record = self.play(f"pass {dimension} {ranks}", grains, [plane(-1.0 * up, up, material="steel")], -G * up, ranks=ranks,
                               decomposition={"subdomains": subdomains}, solver={"method": "nscdd"},
                               material=named("glass", "air", "steel"), scene={"start_overlap": 0.1},
                               law=[law(("air", "glass"), "none"), law(("steel", "air"), "none")])
            time = record.time[-1]
            self.verify("no contact between two materials", f"ways of bodies that pass [m], {dimension}D",
                        record.position[-1, :2, 0], [time, 1.5 * RADIUS - time], self.rounding(record, 1.0))
            self.verify("no contact between two materials", f"speeds of equal bodies that meet [m/s], {dimension}D",
                        record.velocity[-1, 2:4, 0], 0.0, 1e-10)
            self.verify("no contact between two materials", f"speed through the ground, and on it [m/s], {dimension}D",
                        record.velocity[-1, 4:, -1], [-G * time, 0.0], 1e-10)

    def test_density(self):
        """Masses by the density of each material: two grains of one size that meet at equal speeds share their momentum."""
        text = "id,x,y,radius,vx,material\n1,0,0,0.05,1,1\n2,0.1,0,0.05,-1,2\n"
        directory = self.here("density")
        run = run_case({"scene": {"bodies": "file", "bodies_file": write(self.here("two.csv"), text), "gravity": [0.0, 0.0]},
                        "material": [{"name": "light", "density": 1000.0}, {"name": "heavy", "density": 3000.0}],
                        "time": {"step": self.step, "steps": 1}, "solver": {"tolerance": 1e-13}}, directory=directory)
        self.assert_status(run, 0)
        self.verify("two densities", "speed after the impact [m/s]", run.results()["/steps/1/bodies/velocity"][:, 0], -0.5, 1e-12)

    def test_unknown_material_of_a_grain(self):
        path = write(self.here("three.csv"), "id,x,y,radius,material\n7,0,0,0.05,1\n8,1,0,0.05,3\n")
        run = run_case({"scene": {"bodies": "file", "bodies_file": path}, "material": named("a", "b"), "time": {"step": 1e-3, "steps": 1}},
                       directory=self.here("unknown"))
        self.assert_status(run, 2)
        self.assertIn("three.csv: id 8: material 3: expected 1 to 2, the number of a &material of case.nml", run.stderr)
        for options in ((), ("--check",)):
            run = run_case({"scene": {"bodies": "file", "bodies_file": path}, "time": {"step": 1e-3, "steps": 1}},
                           directory=self.here("none"), options=options)
            self.assert_status(run, 2)
            self.assertEqual(run.stderr, f"gravier: error: {path}: id 8: material 3: expected 1, since case.nml has no &material\n")


class SlipDependentFriction(SmallScene):
    values = {"static_friction": 0.5, "dynamic_friction": 0.2, "slip_scale": 0.01}

    def friction(self, slip):
        return 0.2 + 0.3 * np.exp(-np.abs(slip) / 0.01)

    def slide(self, title, angle, speed=0.0, **more):
        return self.play(title, [Grain((0, RADIUS), (speed, 0))], [plane((0, 0), (0, 1))],
                         (G * np.sin(angle), -G * np.cos(angle)), scene={"wall_material": "b", **ROLLS_NOT},
                         material=named("a", "b"), law=[law(("a", "b"), "velocity", **merged({"": self.values}, {"": more})[""])])

    def test_block_on_an_incline(self):
        """It stays below mu_s, though far above mu_d, and runs above."""
        record = self.slide("stays", np.arctan(0.49))
        self.verify("static and dynamic friction", "speed below mu_s [m/s]", record.velocity[-1, 0, 0], 0.0, 1e-12)
        angle = np.arctan(0.51)
        record = self.slide("runs", angle)
        speed = record.velocity[:, 0, 0]
        gained = self.step * G * (np.sin(angle) - self.friction(speed[:-1]) * np.cos(angle))
        self.verify("static and dynamic friction", "gain of speed in a step above mu_s [m/s]", np.diff(speed), gained,
                    self.rounding(record, speed.max()))
        self.assertGreater(speed[-1], 0.1)
        self.verify("static and dynamic friction", "acceleration at last [m/s^2]", (speed[-1] - speed[-2]) / self.step,
                    G * (np.sin(angle) - 0.2 * np.cos(angle)), 1e-3)

    def test_deceleration(self):
        """With a small scale the friction of what slides is mu_d."""
        record = self.slide("slides", 0.0, 1.0, slip_scale=1e-4)
        self.verify("static and dynamic friction", "speed of what slides on a floor [m/s]", record.velocity[:, 0, 0],
                    1.0 - 0.2 * G * record.time, self.rounding(record, 1.0))

    def test_spin_counts(self):
        """A grain that spins in place slips: the slip of both surfaces of a pair is that of the points that touch."""
        for name, boundaries in (("floor", [plane((0, 0), (0, 1), material="b")]),
                                 ("moving", [plane((0, 0), (0, 1), material="b", velocity=[0.3, 0.0])])):
            record = self.play("spin " + name, [Grain((0, RADIUS), spin=[-2.0])], boundaries, (0, -G), 8,
                               material=named("a", "b"), law=[law(("a", "b"), "velocity", **self.values)])
            belt = 0.3 if name == "moving" else 0.0
            slip = record.velocity[:-1, 0, 0] + RADIUS * record.spin[:-1, 0, 0] - belt
            self.assertGreater(np.abs(slip).min(), 0.01)
            gained = -np.sign(slip) * self.step * G * self.friction(slip)
            self.verify("a grain that spins on a floor", f"gain of speed in a step [m/s], floor {name}",
                        np.diff(record.velocity[:, 0, 0]), gained, 1e-12)
            self.verify("a grain that spins on a floor", f"gain of spin in a step [rad/s], floor {name}",
                        np.diff(record.spin[:, 0, 0]), gained / RADIUS / INERTIA[2], 1e-10)


class Adhesion(SmallScene):
    force, reach = 3.0, 0.004

    def pull(self, title, force, dimension):
        """A plate below a grain that hangs at a ceiling, pulled with a force."""
        up = unit(dimension, -1)
        return self.play(title, [Grain(RADIUS * up)],
                         [plane(2 * RADIUS * up, -up, material="ceiling"),
                          plane(0 * up, up, material="plate", mass=0.5, free=[d == dimension - 1 for d in range(3)],
                                force=list(-force * np.array([0.0] * (3 - dimension) + list(up)) if dimension == 3 else
                                           [0.0, -force, 0.0]))],
                         steps=40, material=named("grain", "ceiling", "plate"),
                         law=[law(("grain", "ceiling"), "adhesive", adhesion=10 * self.force, adhesion_range=self.reach),
                              law(("grain", "plate"), "adhesive", adhesion=self.force, adhesion_range=self.reach)],
                         output={"boundary_forces": True, "contacts": True})

    def test_pull_off(self):
        self.both(self.pull_off)

    def pull_off(self, dimension):
        case = f"plate pulled from a grain, {dimension}D"
        record = self.pull(f"below {dimension}", 0.999 * self.force, dimension)
        self.verify(case, "way of the plate below the adhesion [m]", record.boundary["position"][-1, 1, dimension - 1], 0.0, 1e-12)
        self.verify(case, "tension below the adhesion [N]", record.boundary["force"][1:, 1, dimension - 1], 0.999 * self.force, 1e-9)
        self.verify(case, "impulse of the contact [N s]", record.contacts[-1]["impulse"][:, 0].max(), -0.999 * self.force * self.step,
                    1e-11)
        force = 1.5 * self.force
        record = self.pull(f"above {dimension}", force, dimension)
        speed = record.boundary["velocity"][:, 1, dimension - 1]
        gain = np.diff(speed) / self.step
        gap = -(record.boundary["position"][:-1, 1, dimension - 1] + 0.5 * self.step * speed[:-1])
        wanted = -np.where(gap <= self.reach, force - self.force, force) / 0.5
        self.assertGreater(gap[-1], 2 * self.reach)
        self.verify(case, "acceleration above the adhesion [m/s^2]", gain, wanted, 1e-7)

    def test_sleeping_pair_falls(self):
        """Two grains that hold each other a thousand times their weight fall as without `sleeping`: what they press each other with holds
        neither up. On the ground they come to rest."""
        def check(dimension):
            up, across = unit(dimension, -1), unit(dimension, 0)
            adhesive = law("a", "adhesive", adhesion=1000 * MASS * G, adhesion_range=1e-3, friction=0.5)
            pairs = [Grain(height * up + (side * RADIUS + place) * across, material=1)
                     for place, height in ((0.0, 1.0), (0.5, RADIUS)) for side in (-1, 1)]
            record = self.play(f"clinging {dimension}", pairs, [plane(0 * up, up)], -G * up, 60, material=named("a"), law=[adhesive],
                               solver={"tolerance": 1e-4, "sleeping": True, "sleep_after": 6, "warm_start": True})
            fall = -G * record.time
            self.verify(f"{dimension}D grains that cling and fall", "speed [m/s]", record.velocity[:, :2] @ up, fall[:, None], 0.02)
            self.verify(f"{dimension}D grains that cling on the ground", "speed [m/s]", record.velocity[-1, 2:], 0.0, 1e-6)
        self.both(check)

    def test_pull_beside_sleepers(self):
        """A grain whose weight is twice what a ceiling pulls it up with falls off while another falls asleep: files and balances have the
        whole pull in every step, also in those in which the contacts that are solved are not all there are."""
        grains = [Grain((-0.5, RADIUS), mass=MASS), Grain((0.5, 0.501 - RADIUS), velocity=(0.05, 0.1), mass=MASS, material=2),
                  Grain((-0.8, 1.01 * RADIUS), mass=MASS)]
        boundaries = [{**plane((0, 0), (0, 1)), "material": "dry"}, {**plane((0, 0.5), (0, -1)), "material": "wet"}]
        for kind, keys in (("adhesive", {"adhesion": 0.5 * MASS * G, "adhesion_range": 0.025}), ("elastic", {"pull_off_force": 0.5 * MASS * G, "normal_stiffness": 1e5})):
            with self.subTest(kind):
                record = self.play(f"asleep {kind}", grains, boundaries, (0.0, -G), 40, material=named("dry", "wet"), law=[law("wet", kind, friction=0.3, **keys)],
                                   scene={"friction": 0.3, "alert_distance": 0.03}, solver={"criterion": "velocity_error", "accuracy": 1e-6, "tolerance": 1e-4, "warm_start": True, "sleeping": True, "sleep_after": 5},
                                   output={"every": 1, "boundary_forces": True, "energy": True})
                history = record.run.history()
                self.assertIn(1.0, np.abs(np.diff(history["sleeping"])))
                gain = np.diff(record.velocity[:, 1, 1]) / self.step
                names = [name for name in history if name.startswith("force_y:")]
                self.verify(f"{kind} pull beside grains that fall asleep", "force on the ceiling [N]", history[names[1]][1:], -MASS * (gain[1:] + G), 1e-6)
                self.verify(f"{kind} pull beside grains that fall asleep", "error of the energy balance [J]", history["energy_error"], 0.0, 1e-9)

    def test_friction_of_adhesive_grains(self):
        """Without weight a grain on a plate that attracts it slides under a force above mu F: one of two masses does."""
        masses, pull, bound = np.array([0.99, 1.01]) * MASS, 0.3 * self.force / MASS, 0.3 * self.force
        record = self.play("shear", [Grain((k, RADIUS), mass=mass) for k, mass in enumerate(masses)], [plane((0, 0), (0, 1))], (pull, 0.0), 40,
                           scene={"wall_material": "a", **ROLLS_NOT}, material=named("a"),
                           law=[law("a", "adhesive", adhesion=self.force, adhesion_range=self.reach, friction=0.3)])
        self.verify("an adhesive grain without weight", "speed under 0.99 and 1.01 mu F [m/s]", record.velocity[-1, :, 0],
                    np.maximum(pull - bound / masses, 0.0) * record.time[-1], 1e-10)

    def test_column_stands(self):
        """A packing without walls, rows of three and of two disks, stands where it coheres, and spreads where not."""
        places = [((j - (1 - 0.5 * (k % 2))) * 2 * RADIUS, RADIUS + k * np.sqrt(3) * RADIUS) for k in range(6) for j in range(3 - k % 2)]
        heights = []
        for adhesion in (0.0, 100.0):
            record = self.play(f"column {adhesion}", [Grain(place) for place in places], [plane((0, 0), (0, 1))], (0, -G), 200,
                               scene={"wall_material": "a"}, solver={"tolerance": 1e-7, "warm_start": True},
                               material=named("a"), law=[law("a", "adhesive", adhesion=adhesion, adhesion_range=self.reach, friction=0.2)],
                               output={"every": 200})
            heights.append(record.position[-1, :, 1].max() / record.position[0, :, 1].max())
        self.assertGreater(heights[1], 0.999)
        self.assertLess(heights[0], 0.8)


class Bridges(SmallScene):

    def test_bridge(self):
        """A grain at a ceiling, and a plate that is drawn away and comes back near: the bridge pulls with kappa R exp(-gap / lambda) up to
        the debonding distance, and does not form again where they do not touch."""
        capillarity, decay, debonding = 2.0, 0.003, 0.005
        table = "time,vy\n0,0\n0.01,0\n0.0100001,-0.05\n0.2,-0.05\n0.2000001,0.09\n0.3,0.09\n0.3000001,-0.05\n1,-0.05\n"
        record = self.play("bridge", [Grain((0, RADIUS), mass=0.1)],
                           [plane((0, 2 * RADIUS), (0, -1), material="ceiling"), plane((0, 0), (0, 1), material="plate", table="plate.csv")],
                           steps=200, files={"plate.csv": table}, material=named("grain", "ceiling", "plate"),
                           law=[law(("grain", "ceiling"), "adhesive", adhesion=10.0, adhesion_range=0.02),
                                law(("grain", "plate"), "capillary", capillarity=capillarity, decay_length=decay,
                                    debonding_distance=debonding)], output={"contacts": True})
        bridged, seen = True, set()
        for number, contacts in zip(record.step[1:], record.contacts[1:]):
            for antagonist, gap, impulse in zip(contacts["antagonist"], contacts["gap"], contacts["impulse"][:, 0]):
                if antagonist != 3:
                    continue
                bridged = bridged and gap <= debonding
                force = capillarity * RADIUS * np.exp(-max(gap, 0.0) / decay) if bridged else 0.0
                seen.add((bridged, gap > 0.5 * debonding))
                if gap > 0.0:
                    self.verify("a liquid bridge that is drawn", f"force at step {number} [N]", -impulse / self.step, force, 1e-9)
                else:
                    # between ceiling and plate, which both touch it, the forces on the grain are not unique
                    self.assertLessEqual(-impulse / self.step, force + 1e-9, number)
        self.assertEqual(len(seen), 4, seen)

    def test_bridges_at_the_start(self):
        """Pairs that do not touch have bridges at the start of a run up to a distance, and grains that come as near later have none."""
        capillarity, decay, gaps = 2.0, 0.003, (0.001, 0.003, 0.0042)
        grains = [Grain((x, 2 * RADIUS * y + gap * (y > 0))) for x, gap in zip((0.0, 1.0, 2.0), gaps) for y in (0, 1)]
        grains.append(Grain((0.5, 0.02 + 2 * RADIUS), velocity=(0.0, -0.5)))
        grains.append(Grain((0.5, 0.0)))
        for near in (0.0, 0.004):
            bridge = law("a", "capillary", capillarity=capillarity, decay_length=decay, debonding_distance=0.005,
                         **({"bridge_distance": near} if near else {}))
            record = self.play(f"bridges at the start {near}", grains, [], steps=17, material=named("a"), law=[bridge],
                               output={"contacts": True})
            contacts = record.contacts[1]
            found = {(first, second): -impulse / self.step for first, second, impulse in
                     zip(contacts["candidate"], contacts["antagonist"], contacts["impulse"][:, 0])}
            for k, gap in enumerate(gaps):
                force = capillarity * RADIUS * np.exp(-gap / decay) if gap <= near else 0.0
                pull = found.get((2 * k + 2, 2 * k + 1), found.get((2 * k + 1, 2 * k + 2), 0.0))
                self.verify("bridges at the start", f"force at a gap of {gap} m", pull, force, 1e-9)
            self.assertLess(record.position[-1, 6, 1] - record.position[-1, 7, 1] - 2 * RADIUS, 0.004)
            np.testing.assert_array_equal(record.velocity[-1, 6], [0.0, -0.5])


class Bonds(SmallScene):

    def test_hanging_chains(self):
        self.hang("nlgs", {})

    def test_hanging_chains_in_subdomains(self):
        """Links lie between subdomains, and pass from one to another with their bonds."""
        for method in ("nscdd", "nscdd_ep"):
            with self.subTest(method=method):
                self.hang(method, {"solver": {"method": method, "tolerance": 1e-12}, "decomposition": {"grid": [1, 4], "repartition_every": 5}})

    def hang(self, method, groups):
        """Two chains of six disks hang; link k carries the weight of 6 - k of them. The bonds of one hold, the first of the other is
        too weak."""
        case, weight = f"chains of six that hang, {method}", MASS * G
        grains = [Grain((x, -(2 * k + 1) * RADIUS), material=material) for material, x in ((1, 0.0), (2, 1.0)) for k in range(6)]
        bond = {"bond_friction": 1.0, "bond_distance": 1e-6}
        record = self.play(method, grains, [plane((0, 0), (0, -1), material="ceiling")], (0, -G), 40, material=named("a", "b", "ceiling"),
                           law=[law(("a", "ceiling"), "bonded", bond_strength=100 * weight, **bond),
                                law(("ceiling", "b"), "bonded", bond_strength=100 * weight, **bond),
                                law("a", "bonded", bond_strength=5.01 * weight, **bond),
                                law("b", "bonded", bond_strength=4.9 * weight, **bond)], output={"contacts": True}, **groups)
        self.verify(case, "way below the strength of the bonds [m]", record.position[:, :6], record.position[:1, :6], 1e-10)
        ends = record.contacts[-1]
        tension = np.sort(-ends["impulse"][ends["candidate"] <= 6, 0]) / (weight * self.step)
        self.verify(case, "tension over the weight of a disk", tension, [1, 2, 3, 4, 5, 6], 1e-8)
        # the first step still has the pull of the bond that breaks
        fall = -G * record.time + 4.9 / 5 * G * self.step * (record.time > 0)
        self.verify(case, "speed of the disk that stays [m/s]", record.velocity[:, 6, 1], 0.0, 1e-9)
        self.verify(case, "speed of the five that fall [m/s]", record.velocity[:, 7:, 1], fall[:, None], 1e-8)

    def test_strength_of_a_block(self):
        """Layers of grains between two that are glued bear the sum of the bonds between two layers, whatever the method, at default settings. A
        load that grows by 1/128 of it in a step finds that as soon as the upper layers part by more than the error of solves, 0.1 U."""
        n, strength = 4, 2.0
        bond = law("a", "bonded", bond_strength=strength, bond_friction=1.0, bond_distance=1e-4, friction=0.5)

        def check(dimension):
            up, whole = unit(dimension, -1), n**(dimension - 1) * strength
            places = [np.array(place) for place in np.ndindex(*[n] * dimension)]
            grains = [Grain(2 * RADIUS * place, mass=1e-3, group={0: 1, n - 1: 2}.get(place[-1], 0)) for place in places]
            table = "time,%s\n0,%r\n1,%r\n" % ("fz" if dimension == 3 else "fy", 0.8 * whole, 4.8 * whole)
            for method in ("nlgs", "nscdd", "newton"):
                record = self.play(f"block {dimension} {method}", grains,
                                   [{"name": "low", "shape": "grains", "group": 1},
                                    {"name": "high", "shape": "grains", "group": 2, "free": [bool(x) for x in up], "mass": 0.016, "table": "load.csv"}], None, 40,
                                   files={"load.csv": table}, material=named("a"), law=[bond], solver={"method": method, "criterion": "velocity_error", "tolerance": 0.01,
                                   "check_every": 10, "warm_start": True, "max_iterations": 10000}, output={"every": 40, "boundary_forces": True, "bonds": True},
                                   decomposition={"subdomains": 1 if method == "nlgs" else 4})
                history = record.run.history()
                force = np.abs(history[f"force_{'xyz'[dimension - 1]}:low"])
                case = f"{dimension}D block of bonded grains, {method}"
                self.verify(case, "strength over the sum of the bonds", force.max() / whole, 1.0, 1e-3)
                # the mean load of step k is 0.8 + (k + 1/2)/128 of the strength W. j steps beyond it the boundary and a layer, of the mass M, part from
                # the others with h W j^2/(2 128 M); U = h W/(mass of the grains of a layer) is the load of a step
                torn = np.flatnonzero(force < 0.5 * whole)[0]
                layer = 1e-3 * n**(dimension - 1)
                self.assertGreater(torn, 25)
                self.assertLess(torn, 25.1 + np.sqrt(2 * 128 * 0.1 * (0.016 + layer) / layer))
                # between the layers, and in the two that are not glued; between two layers they are torn
                across, beside = n**(dimension - 1), (dimension - 1) * (n - 1) * n**(dimension - 2)
                self.assertEqual(set(history["bonds"][:torn - 9]), {3 * across + 2 * beside})
                self.assertIn(f"bonds       {3 * across + 2 * beside} after the first step\n", record.run.stdout)
                self.assertLessEqual(history["bonds"][-1], 2 * across + 2 * beside)
        self.both(check)

    def test_broken_for_good(self):
        """A disk is torn from a ceiling and thrown back at it: the bond does not form again."""
        record = self.play("torn", [Grain((0, -RADIUS))], [plane((0, 0), (0, -1), material="b")], None, 200,
                           scene={"gravity_table": "g.csv"}, files={"g.csv": "time,gx,gy\n0,0,-9\n0.05,0,-9\n0.0501,0,9\n0.3,0,9\n0.301,0,-5\n1,0,-5\n"},
                           material=named("a", "b"),
                           law=[law(("a", "b"), "bonded", bond_strength=8.0 * MASS, bond_friction=0.5, bond_distance=1e-6)])
        touched = np.abs(record.position[:, 0, 1] + RADIUS) < 1e-9
        again = np.flatnonzero(touched)[-1]
        self.assertGreater(record.time[again], 0.25)
        self.assertLess(record.time[again], 0.31)
        self.verify("a disk torn from a ceiling", "speed after it came back [m/s]", np.diff(record.velocity[again + 1:, 0, 1]) / self.step,
                    -5.0, 1e-8)

    def test_shear(self):
        """Without weight a bond withstands the shear mu_b F: of two masses one slides, then with the friction of nothing."""
        masses = np.array([0.99, 1.01]) * MASS
        record = self.play("sheared", [Grain((k, RADIUS), mass=mass) for k, mass in enumerate(masses)], [plane((0, 0), (0, 1))], (4.0, 0.0), 20,
                           scene={"wall_material": "a", **ROLLS_NOT}, material=named("a"),
                           law=[law("a", "bonded", bond_strength=8.0 * MASS, bond_friction=0.5, bond_distance=1e-6, friction=0.3)])
        gain = np.diff(record.velocity[:, :, 0], axis=0) / self.step
        self.verify("a sheared bond", "acceleration below mu_b F [m/s^2]", gain[:, 0], 0.0, 1e-9)
        self.verify("a sheared bond", "acceleration as it breaks [m/s^2]", gain[0, 1], 4.0 - 4.0 / 1.01, 1e-9)
        self.verify("a sheared bond", "acceleration once broken [m/s^2]", gain[1:, 1], 4.0, 1e-9)

    def test_moment(self):
        """A bond to a wall carries the weight of a grain by shear, of which it withstands mu_b F, and by a moment, of which it withstands
        mu_r R F: either alone, whatever the other. The grain whose bond bears less shear falls, the one whose bond bears less moment rolls."""
        weight = MASS * G

        def check(dimension):
            up, across = unit(dimension, -1), unit(dimension, 0)
            bond = {"bond_strength": weight, "bond_distance": 1e-6}
            record = self.play(f"held sideways {dimension}", [Grain(RADIUS * across + k * up, material=k + 1) for k in range(3)],
                               [plane(0 * up, across, material="wall")], -G * up, 40, material=named("a", "b", "c", "wall"),
                               solver={"acceleration": "none"}, output={"every": 1, "contacts": True},
                               law=[law((name, "wall"), "bonded", bond_friction=friction, rolling_friction=rolling, **bond)
                                    for name, friction, rolling in (("a", 1.2, 1.2), ("b", 0.8, 1.2), ("c", 1.2, 0.8))])
            case = f"{dimension}D grains bonded to a wall"
            self.verify(case, "speed of the one whose bond holds [m/s]", record.all_velocities[:, 0], 0.0, 1e-10)
            ends = record.contacts[-1]
            first = np.flatnonzero(ends["candidate"] == 1)[0]
            self.verify(case, "shear over the weight", np.linalg.norm(ends["impulse"][first, 1:]) / (weight * self.step), 1.0, 1e-9)
            moment = np.linalg.norm(ends["moment"][first])
            self.verify(case, "moment over that of the weight", moment / (weight * RADIUS * self.step), 1.0, 1e-9)
            self.assertLess(record.velocity[-1, 1] @ up, -0.5)
            # it rolls down: a force r_t at the wall with m a = m g - r_t, I w' = (r_t - 0.8 m g) R, a = R w'
            rolls = G * 0.2 / (1.0 + INERTIA[dimension])
            self.verify(case, "acceleration of the one that rolls [m/s^2]", -np.diff(record.velocity[:, 2] @ up)[:20] / self.step, rolls, 1e-8)
        self.both(check)


def block():
    """A block of bonded disks, of two materials, that falls on an edge; it lies across the side x = 0 of a period of 1 m."""
    turn, places = 0.3, []
    for k in range(6):
        for j in range(6 - k % 2):
            x, y = (2 * j + k % 2) * RADIUS, k * np.sqrt(3) * RADIUS
            places.append(((np.cos(turn) * x - np.sin(turn) * y - 0.2) % 1.0, 0.06 + np.sin(turn) * x + np.cos(turn) * y))
    return [Grain(place, (0.0, -2.0), material=1 + k % 2) for k, place in enumerate(places)]


class Decomposed(SmallScene):
    """A block that breaks as it falls, with bonds, bridges and adhesion, in subdomains and across a period."""

    def case(self, **more):
        path = self.here("block.csv")
        write(path, bodies_csv(block()))
        return merged({
            "scene": {"bodies": "file", "bodies_file": path, "wall_material": "floor", "gravity": [0.0, -G],
                      "period": [1.0, 0.0]},
            "boundary": [plane((0, 0), (0, 1))],
            "material": named("a", "b", "floor"),
            "law": [law("a", "bonded", bond_strength=60.0, bond_friction=0.8, bond_distance=1e-6, friction=0.3),
                    law(("a", "b"), "bonded", bond_strength=30.0, bond_friction=0.5, bond_distance=1e-6, friction=0.3),
                    law("b", "capillary", capillarity=100.0, decay_length=0.002, debonding_distance=0.005, friction=0.3),
                    law(("a", "floor"), "adhesive", adhesion=5.0, adhesion_range=0.003, friction=0.4),
                    law(("b", "floor"), "velocity", static_friction=0.5, dynamic_friction=0.2, slip_scale=0.01)],
            "time": {"step": 1e-3, "steps": 60},
            "solver": {"method": "nscdd", "criterion": "residual", "tolerance": 1e-6},
            "decomposition": {"grid": [2, 2], "repartition_every": 7},
            "output": {"every": 20, "energy": True, "structure": True, "stress": True, "directory": "results"},
        }, more)

    def test_ranks_and_restart(self):
        case = self.case()
        # the problem that one of them writes for FCLIB leaves no trace
        runs = each(lambda ranks, written: run_case(merged(case, {"output": {"fclib_step": written}}), ranks, self.here(f"ranks {ranks}")),
                    [(1, 0), (2, 20), (4, 0)])
        stopped = merged(case, {"time": {"steps": 33}, "output": {"checkpoint_every": 33}})
        self.assert_status(run_case(stopped, 2, self.here("stopped")), 0)
        runs.append(run_case(case, 1, self.here("stopped"), options=["--restart"]))
        for run in runs:
            self.assert_status(run, 0)
        for run in runs[1:]:
            self.assertEqual(self.states(run), self.states(runs[0]))
        history = runs[0].history()
        # some bonds broke: what holds to the end is not what there was, and not nothing
        self.assertLess(history["coordination"][-1], 0.9 * history["coordination"][0])
        self.assertGreater(history["coordination"][-1], 1.0)
        scale = history["kinetic_translation"].max()
        self.verify("a block that breaks", "error of the energy balance over the energy", history["energy_error"] / scale, 0.0, 1e-10)

    @staticmethod
    def states(run):
        """Bits of the states at the same steps of all runs."""
        return {name: np.asarray(value).tobytes() for name, value in run.results().items()
                if name.startswith(("/steps/0/", "/steps/20/", "/steps/40/", "/steps/60/")) and "@" not in name}

    def test_no_attraction(self):
        """Laws whose attraction is zero are Coulomb's, bit for bit."""
        kinds = [("coulomb", {}), ("adhesive", {"adhesion": 0.0, "adhesion_range": 1e-3}),
                 ("capillary", {"capillarity": 0.0, "decay_length": 1e-3, "debonding_distance": 1e-3})]
        runs = each(lambda kind, values: run_case(self.case(law=[law("a", kind, friction=0.3, **values)], material=named("a", "b", "floor")),
                                                  1, self.here(kind)), kinds)
        for run in runs:
            self.assert_status(run, 0)
            self.assertEqual(self.states(run), self.states(runs[0]))


if __name__ == "__main__":
    unittest.main()
