"""Diagnostics against what is known exactly: the energy balance is an identity of each step, lattices have known
coordination, fabric and stress, a base carries the weight.

Each step adds its works to running sums, with a rounding of some units of the last place of the largest: after n steps the
balance is off by some n times 1e-16 of what has been exchanged, for which 1e-12 leaves room. Static lattices are solved to a
residual of 1e-13; what a solve leaves of velocity and force there is below 1e-10 of the largest."""
import os
import re
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, differences, gravier, merged, namelist, steps_of, write

G = 9.81
RADIUS = 0.01
MASS = 0.5
ALL = {"output": {"energy": True, "stress": True, "structure": True, "boundary_forces": True, "boundary_power": True}}


def grains_csv(path, positions, velocities=None, radii=None):
    """A bodies file of grains of mass MASS."""
    positions = np.asarray(positions, dtype=float)
    axes = "xyz"[:positions.shape[1]]
    velocities = np.zeros_like(positions) if velocities is None else np.asarray(velocities, dtype=float)
    radii = np.full(len(positions), RADIUS) if radii is None else radii
    text = "id,radius,mass," + ",".join([*axes, *("v" + axis for axis in axes)]) + "\n"
    for k, (x, v) in enumerate(zip(positions, velocities)):
        text += f"{k + 1},{float(radii[k])!r},{MASS!r}," + ",".join(repr(float(number)) for number in (*x, *v)) + "\n"
    return write(path, text)


def lattice(*counts):
    """Centres of touching grains in the corner of the axes."""
    grid = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(-1, len(counts))
    return RADIUS * (2 * grid + 1)


def plane(name, axis, side, place, **more):
    """A &boundary group: a plane at `place` along an axis, grains on its side +1 or -1."""
    point, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    point[axis], normal[axis] = float(place), float(side)
    return {"name": name, "shape": "plane", "point": point, "normal": normal, **more}


def tensor(row, name, dimension):
    axes = "xyz"[:dimension]
    return np.array([[row[f"{name}_{a}{b}"][-1] for b in axes] for a in axes])


class Diagnostics(RunTestCase):

    def run_here(self, title, groups, boundaries=(), ranks=1, options=()):
        """Run `groups` and boundaries, of which there are several groups of one name. Of many steps the histories alone are looked at."""
        groups = merged({"output": {"every": 0 if groups["time"]["steps"] > 50 else 1}}, groups)
        directory = self.here(title)
        os.makedirs(directory, exist_ok=True)
        text = namelist(groups) + "".join(namelist({"boundary": one}) for one in boundaries)
        write(os.path.join(directory, "case.nml"), text)
        run = gravier(*options, "case.nml", ranks=ranks, directory=directory)
        self.assert_status(run, 0)
        return run

    # ---- energy

    def stirred(self, dimension, **scene):
        """Grains thrown about between a moving floor, a stirrer that turns and a lid that a force presses down."""
        counts = (6, 5) if dimension == 2 else (3, 3, 4)
        centres = 1.15 * lattice(*counts)
        width = 1.15 * 2 * RADIUS * counts[0]
        top = 1.15 * 2 * RADIUS * counts[-1] + 3 * RADIUS
        up = dimension - 1
        speeds = np.random.default_rng(3).normal(0.0, 0.4, centres.shape)
        path = grains_csv(self.here(f"stirred{dimension}.csv"), centres, speeds)
        floor_velocity = [0.3, 0.05, 0.0] if dimension == 2 else [0.3, -0.1, 0.05]
        free = [False] * 3
        free[up] = True
        force = [0.0] * 3
        force[up] = -30.0
        boundaries = [plane("floor", up, 1, -RADIUS, velocity=floor_velocity),
                      plane("lid", up, -1, top, free=free, force=force, mass=2.0)]
        for d in range(up):
            boundaries += [plane(f"low {d}", d, 1, -RADIUS), plane(f"high {d}", d, -1, width + RADIUS)]
        middle = 0.5 * width
        if dimension == 2:
            boundaries.append({"name": "stirrer", "shape": "segment", "point": [middle - RADIUS, 0.0, 0.0],
                               "end": [middle + RADIUS, 0.0, 0.0], "rotation": [9.0, 0.0, 0.0], "pivot": [middle, 0.0, 0.0]})
        else:
            boundaries.append({"name": "stirrer", "shape": "rectangle", "point": [middle - RADIUS, middle - RADIUS, -0.5 * RADIUS],
                               "edge_a": [2 * RADIUS, 0.0, 0.0], "edge_b": [0.0, 2 * RADIUS, 0.0],
                               "rotation": [0.0, 2.0, 5.0], "velocity": [0.0, 0.0, 0.1], "pivot": [middle, middle, 0.0]})
        case = {
            "scene": {"dimension": dimension, "bodies": "file", "bodies_file": path, "friction": 0.4, "restitution": 0.6,
                      "wall_restitution": 0.3, "gravity": [0.7, -0.5, -G][-dimension:] + [0.0] * (3 - dimension),
                      "body_force": [40.0] + [0.0] * (dimension - 1) + [0.0] * (3 - dimension),
                      "alert_distance": 0.2 * RADIUS, "overlap_projection": False, **scene},
            "time": {"step": 5e-4, "steps": 300},
            # the balance closes whatever the tolerance
            "solver": {"method": "nscdd", "tolerance": 1e-2, "max_iterations": 1000},
            "decomposition": {"subdomains": 3},
        }
        return case, boundaries

    def exchanged(self, history):
        return np.max(np.abs([history[name] for name in ("load_work", "boundary_work", "dissipated_normal",
                                                         "dissipated_friction", "kinetic_translation", "kinetic_rotation")]))

    def check_balance(self, history):
        scale = self.exchanged(history)
        self.assertLess(np.abs(history["energy_error"]).max(), 1e-12 * scale)
        total = history["kinetic_translation"] + history["kinetic_rotation"]
        np.testing.assert_allclose(total, history["kinetic_energy"], rtol=1e-12)

    def test_balance_closes(self):
        """Each dimension with each theta, one of them on two ranks; `./gravier test long` has all on both."""
        for dimension in (2, 3):
            for theta in (0.5, 0.7):
                for ranks in (1, 2) if LONG else (2,) if (dimension == 2) == (theta == 0.7) else (1,):
                    with self.subTest(dimension=dimension, theta=theta, ranks=ranks):
                        case, boundaries = self.stirred(dimension)
                        run = self.run_here(f"balance {dimension} {theta} {ranks}", merged(case, ALL, {"time": {"theta": theta}, "output": {"every": 300}}),
                                            boundaries, ranks)
                        history = run.history()
                        self.check_balance(history)
                        # everything takes part
                        scale = self.exchanged(history)
                        for name in ("dissipated_normal", "dissipated_friction", "boundary_work", "load_work",
                                     "kinetic_boundaries", "kinetic_rotation"):
                            self.assertGreater(np.abs(history[name]).max(), 1e-4 * scale, name)
                        if theta == 0.5:
                            # the work of constant loads is the potential that grains lose
                            kept = history["potential_energy"] + history["load_work"]
                            self.assertLess(np.ptp(kept), 1e-12 * max(scale, np.abs(kept).max()))
                        # friction takes, but in a step in which the stirrer wedges a grain in: the velocity before it may lie along the
                        # impulse that holds the grain
                        self.assertGreater(np.mean(np.diff(history["dissipated_friction"]) > -0.02 * scale), 0.99)
                        self.assertGreater(history["dissipated_friction"][100], 0.0)

    def test_balance_of_what_leaves(self):
        """Grains fall through an outlet; a lid that carries energy is taken away."""
        case, boundaries = self.stirred(2)
        for b in boundaries:
            if b["name"] == "floor":
                b.update({"shape": "outlet", "velocity": None})
        boundaries = [{key: value for key, value in b.items() if value is not None} for b in boundaries if b["name"] != "stirrer"]
        boundaries[1]["remove_at"] = 0.06
        run = self.run_here("leave", merged(case, ALL), boundaries)
        history = run.history()
        self.check_balance(history)
        self.assertGreater(history["carried_away"][-1], 0.1 * self.exchanged(history))
        self.assertGreater(history["kinetic_boundaries"][100], 0.0)
        self.assertEqual(history["kinetic_boundaries"][-1], 0.0)

    def balance_line(self, run):
        """What the log says that the balance of the grains is off by, and has turned over [J]."""
        off, turned = re.search(r"energy +balance off by (\S+) J; the sizes of its terms sum up to (\S+) J", run.stdout).groups()
        return float(off), float(turned)

    def test_balance_of_every_run(self):
        """Without `energy`: the log has the balance of the grains alone, which closes as well, to the same bits on any number of
        ranks, with grains that leave, by an enriched method, after a restart. It turns over what the columns of `energy` say."""
        case, boundaries = self.stirred(2)
        case = merged(case, {"time": {"steps": 120}})
        lid = next(b for b in boundaries if b["name"] == "lid")
        for key in ("free", "force", "mass"):
            del lid[key]
        low = next(b for b in boundaries if b["name"] == "low 0")
        low["shape"] = "outlet"
        history = self.run_here("all columns", merged(case, ALL), boundaries).history()
        last = {name: column[-1] for name, column in history.items()}
        start = history["kinetic_translation"] + history["kinetic_rotation"] - history["load_work"] - history["boundary_work"] + \
            history["dissipated_normal"] + history["dissipated_friction"] + history["carried_away"]
        expected = last["kinetic_energy"] + start[-1] + abs(last["load_work"]) + last["carried_away"] + \
            abs(last["boundary_work"] - last["dissipated_normal"] - last["dissipated_friction"])
        self.assertGreater(last["carried_away"], 1e-3 * expected)
        plain = self.run_here("plain", case, boundaries)
        off, turned = self.balance_line(plain)
        self.assertLess(off, 1e-12 * turned)
        # three digits are printed
        self.assertAlmostEqual(turned, expected, delta=6e-3 * expected)
        self.assertEqual(self.balance_line(self.run_here("plain 2", case, boundaries, 2)), (off, turned))
        off, turned = self.balance_line(self.run_here("enriched", merged(case, {"solver": {"method": "nscdd_ep"}}), boundaries))
        self.assertLess(off, 1e-12 * turned)
        # from a checkpoint on it is that of what follows
        half = merged(case, {"time": {"steps": 60}, "output": {"checkpoint_every": 60}})
        self.run_here("half", half, boundaries)
        rest = self.run_here("half", merged(half, {"time": {"steps": 120}}), boundaries, options=("--restart",))
        off, turned = self.balance_line(rest)
        self.assertLess(off, 1e-12 * turned)
        self.assertNotAlmostEqual(turned, expected, delta=0.1 * expected)

    def test_balance_of_shared_grains_of_any_size(self):
        """A force on volumes does its work on those of the grains themselves, also where subdomains share them."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [8, 6], "radius_min": 0.005, "radius_max": 0.012, "friction": 0.3,
                          "body_force": [3000.0, -5000.0]},
                "time": {"step": 1e-3, "steps": 150}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}}
        off, turned = self.balance_line(self.run_here("sizes", case, []))
        self.assertLess(off, 1e-12 * turned)

    def test_balance_without_iterations(self):
        """Solves that end where they start, since impulses of the last step are good enough, by a method that keeps reactions of
        subdomains: the work of contacts is that of whole impulses."""
        counts = (7, 6)
        path = grains_csv(self.here("idle.csv"), lattice(*counts))
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.5},
                "time": {"step": 1e-3, "steps": 6},
                "solver": {"method": "schwarz", "tolerance": 0.2}, "decomposition": {"subdomains": 4}}
        run = self.run_here("idle", case, [plane("floor", 1, 1, 0.0)])
        self.assertIn(0, run.history()["iterations"])
        off, turned = self.balance_line(run)
        self.assertLess(off, 1e-12 * turned)

    def test_balance_in_a_period(self):
        """A fall along a periodic axis: the potential goes on where places begin anew, under loads from a table."""
        path = grains_csv(self.here("period.csv"), 1.5 * lattice(4, 4), radii=np.full(16, RADIUS))
        case = {"scene": {"bodies": "file", "bodies_file": path, "gravity": [3.0, 0.0, 0.0], "friction": 0.3,
                          "period": [0.13, 0.13, 0.0], "overlap_projection": False},
                "time": {"step": 1e-3, "steps": 700}, "decomposition": {"subdomains": 1}}
        history = self.run_here("period", merged(case, ALL)).history()
        self.check_balance(history)
        weight = 16 * MASS * 3.0
        way = 0.5 * 3.0 * history["time"]**2
        np.testing.assert_allclose(history["load_work"], weight * way, rtol=1e-11)
        np.testing.assert_allclose(np.diff(history["potential_energy"]), -weight * np.diff(way), rtol=1e-7)

    def test_dissipation_of_a_shock(self):
        """Two disks meet head on with restitution e: 1 - e^2 of their energy is lost. A disk that slides loses m mu g x."""
        path = grains_csv(self.here("shock.csv"), [[0.0, 0.0], [2.5 * RADIUS, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
        case = {"scene": {"bodies": "file", "bodies_file": path, "gravity": [0.0] * 3, "restitution": 0.5},
                "time": {"step": 1e-3, "steps": 10}}
        history = self.run_here("shock", merged(case, ALL)).history()
        np.testing.assert_allclose(history["dissipated_normal"][-1], 0.75 * MASS, rtol=1e-12)
        self.assertEqual(history["dissipated_friction"][-1], 0.0)
        path = grains_csv(self.here("slide.csv"), [[0.0, RADIUS]], [[1.0, 0.0]])
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.25, "wall_friction": 0.25, "rotation": False},
                "time": {"step": 1e-3, "steps": 100}, "solver": {"tolerance": 1e-13}}
        history = self.run_here("slide", merged(case, ALL), [plane("floor", 1, 1, 0.0)]).history()
        way = 0.1 - 0.5 * 0.25 * G * 0.1**2
        np.testing.assert_allclose(history["dissipated_friction"][-1], MASS * 0.25 * G * way, rtol=1e-11)
        np.testing.assert_array_equal(history["sliding_fraction"], 1.0)

    def thrown(self, title, row, scene, dimension=2):
        """A grain of radius RADIUS on a floor, with `row` of velocities of the bodies file, over 0.1 s; names of its diagnostics are those of history.csv."""
        axes = "xyz"[:dimension]
        path = write(self.here(f"{title}.csv"), f"id,radius,mass,{','.join(axes)},{','.join(row)}\n1,{RADIUS!r},{MASS!r},{'0.0,' * (dimension - 1)}{RADIUS!r},"
                     + ",".join(repr(value) for value in row.values()) + "\n")
        case = {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": path, **scene}, "time": {"step": 1e-3, "steps": 100},
                "solver": {"tolerance": 1e-13, "max_iterations": 100000}}
        history = self.run_here(title, merged(case, ALL), [plane("floor", dimension - 1, 1, 0.0)]).history()
        self.check_balance(history)
        return history

    def test_dissipation_of_rolling(self):
        """A disk that rolls without sliding loses mu_r m g x to rolling, one that slides without turning mu m g x to sliding, and one that does both the
        works of friction along its slip and of the moment along its turn. A sphere that spins about the normal loses to pivoting. The parts sum up to
        the dissipation of friction; without resistance there are none."""
        time, weight = 1e-3 * np.arange(1, 101), MASS * G
        parts = ("dissipated_sliding", "dissipated_rolling")
        # rolls: a moment of mu_r m g R slows down m + I/R^2 = 3 m/2
        rolls = self.thrown("rolls", {"vx": 1.0, "omega": -1.0 / RADIUS}, {"friction": 0.8, "rolling_friction": 0.1})
        way = time - 0.5 * (2.0 / 3.0) * 0.1 * G * time**2
        np.testing.assert_allclose(rolls["dissipated_rolling"], 0.1 * weight * way, rtol=1e-9)
        self.assertLess(np.abs(rolls["dissipated_sliding"]).max(), 1e-9 * rolls["dissipated_rolling"][-1])
        # slides: the moment holds the disk
        slides = self.thrown("slides", {"vx": 1.0}, {"friction": 0.1, "rolling_friction": 0.2})
        way = time - 0.5 * 0.1 * G * time**2
        np.testing.assert_allclose(slides["dissipated_sliding"], 0.1 * weight * way, rtol=1e-9)
        self.assertLess(np.abs(slides["dissipated_rolling"]).max(), 1e-9 * slides["dissipated_sliding"][-1])
        # both: the rest of the moment turns it, I = m R^2/2
        both = self.thrown("both", {"vx": 1.0}, {"friction": 0.1, "rolling_friction": 0.05})
        turn = 0.05 * G * time**2
        np.testing.assert_allclose(both["dissipated_rolling"], 0.05 * weight * turn, rtol=1e-9)
        np.testing.assert_allclose(both["dissipated_sliding"], 0.1 * weight * (way - turn), rtol=1e-9)
        for history in (rolls, slides, both):
            np.testing.assert_allclose(sum(history[name] for name in parts), history["dissipated_friction"], rtol=1e-14)
            self.assertNotIn("dissipated_pivoting", history)
        # spins about the normal, I = 2 m R^2/5, while it rolls along x at the same time
        both = self.thrown("spins", {"vx": 1.0, "wy": 1.0 / RADIUS, "wz": 300.0}, {"friction": 0.8, "rolling_friction": 0.1, "pivoting_friction": 0.05}, 3)
        np.testing.assert_allclose(both["dissipated_pivoting"], 0.05 * weight * RADIUS * (300.0 * time - 0.5 * 2.5 * 0.05 * G / RADIUS * time**2), rtol=1e-9)
        np.testing.assert_allclose(both["dissipated_rolling"], 0.1 * weight * (time - 0.5 * 0.1 * G / 1.4 * time**2), rtol=1e-9)
        self.assertLess(np.abs(both["dissipated_sliding"]).max(), 1e-9 * both["dissipated_rolling"][-1])
        self.assertNotIn("dissipated_pivoting", self.thrown("no pivoting", {"vx": 1.0}, {"friction": 0.1, "rolling_friction": 0.2}, 3))
        for name in parts:
            self.assertNotIn(name, self.thrown("no resistance", {"vx": 1.0}, {"friction": 0.1}))

    def test_dissipation_of_many(self):
        """The parts of stirred grains sum up to the whole on one and two ranks, with the same bits, and over a restart."""
        for dimension in (2, 3):
            case, boundaries = self.stirred(dimension, rolling_friction=0.1, pivoting_friction=0.05 * (dimension - 2))
            case = merged(case, ALL, {"time": {"steps": 100}, "output": {"every": 100, "checkpoint_every": 60}})
            one, two = (self.run_here(f"many {dimension} {ranks}", case, boundaries, ranks) for ranks in (1, 2))
            history = one.history()
            self.check_balance(history)
            names = ["dissipated_sliding", "dissipated_rolling", "dissipated_pivoting"][:dimension]
            scale = np.abs(history["dissipated_friction"]).max()
            np.testing.assert_allclose(sum(history[name] for name in names), history["dissipated_friction"], rtol=0.0, atol=1e-14 * scale)
            # moments take, but in steps in which a grain is struck: the velocity before it may lie along the impulse
            for name in names[1:]:
                self.assertGreater(history[name][-1], 1e-3 * scale)
                self.assertGreater(np.mean(np.diff(history[name]) > -1e-3 * scale), 0.9, name)
            first = merged(case, {"time": {"steps": 60}, "output": {"checkpoint_every": 60}})
            self.run_here(f"part {dimension}", first, boundaries)
            rest = self.run_here(f"part {dimension}", case, boundaries, options=("--restart",))
            for name in ("dissipated_friction", *names):
                np.testing.assert_array_equal(two.history()[name], history[name])
                np.testing.assert_array_equal(rest.history()[name], history[name])

    def test_work_of_a_belt(self):
        """A disk laid upon a belt: the belt does m mu g v t, the disk takes half of m (mu g t)^2, slip takes the rest."""
        path = grains_csv(self.here("belt.csv"), [[0.0, RADIUS]])
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.25, "rotation": False},
                "time": {"step": 1e-3, "steps": 100}, "solver": {"tolerance": 1e-13}}
        history = self.run_here("belt", merged(case, ALL), [plane("belt", 1, 1, 0.0, velocity=[1.0, 0.0, 0.0], friction=0.25)]
                                ).history()
        force = MASS * 0.25 * G
        np.testing.assert_allclose(history["boundary_work"], force * history["time"], rtol=1e-11)
        np.testing.assert_allclose(history["dissipated_friction"], force * history["time"] -
                                   0.5 * force**2 / MASS * history["time"]**2, rtol=1e-11)
        np.testing.assert_allclose(history["force_x:belt"], -force, rtol=1e-11)

    # ---- stress

    def test_base_carries_the_weight(self):
        """A lattice with friction between two walls, in a slanting gravity."""
        counts = (7, 6)
        path = grains_csv(self.here("base.csv"), lattice(*counts))
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.5, "wall_friction": 0.5,
                          "gravity": [0.15 * G, -G, 0.0]},
                "time": {"step": 1e-3, "steps": 3},
                "solver": {"method": "nscdd", "tolerance": 1e-13, "max_iterations": 100000},
                "decomposition": {"subdomains": 4}}
        boundaries = [plane("floor", 1, 1, 0.0), plane("left", 0, 1, 0.0), plane("right", 0, -1, 2 * RADIUS * counts[0])]
        weight = np.prod(counts) * MASS * G
        for ranks in (1, 2):
            run = self.run_here(f"base {ranks}", merged(case, ALL), boundaries, ranks)
            history = run.history()
            self.assertLess(history["kinetic_energy"].max(), 1e-18)
            for k, share in enumerate((0.15, -1.0)):
                carried = sum(history[f"force_{'xy'[k]}:{b['name']}"] for b in boundaries)
                self.assertLess(np.abs(carried - share * weight).max(), 1e-10 * weight)
            self.assertLess(history["force_y:floor"][-1], -0.9 * weight)
            stress = tensor(history, "stress", 2)
            self.assertLess(abs(stress[0, 1] - stress[1, 0]), 1e-10 * np.trace(stress))
            self.assertGreater(abs(stress[0, 1]), 1e-3 * np.trace(stress))
            self.assertEqual(history["position_x:right"][-1], 2 * RADIUS * counts[0])
            np.testing.assert_allclose(history["volume"], 4 * RADIUS**2 * np.prod(counts), rtol=1e-8)
            np.testing.assert_allclose(history["solid_fraction"], np.pi / 4, rtol=1e-8)

    def test_stress_of_a_column(self):
        """Contact k below grain k carries the weight of n - k + 1 grains over a branch of two radii, one at the ground."""
        n = 9
        path = grains_csv(self.here("column.csv"), lattice(1, n))
        case = {"scene": {"bodies": "file", "bodies_file": path},
                "time": {"step": 1e-3, "steps": 1}, "solver": {"tolerance": 1e-14, "max_iterations": 100000}}
        history = self.run_here("column", merged(case, ALL), [plane("floor", 1, 1, 0.0)]).history()
        forces = MASS * G * np.arange(n, 0, -1)
        branches = RADIUS * np.array([1] + [2] * (n - 1))
        volume = 2 * RADIUS * 2 * RADIUS * n
        stress = tensor(history, "stress", 2)
        np.testing.assert_allclose(stress[1, 1], np.sum(forces * branches) / volume, rtol=1e-10)
        self.assertLess(np.abs([stress[0, 0], stress[0, 1], stress[1, 0]]).max(), 1e-12 * stress[1, 1])
        np.testing.assert_allclose(history["pressure"][-1], 0.5 * stress[1, 1], rtol=1e-12)
        np.testing.assert_allclose(history["force_max"][-1], n * MASS * G, rtol=1e-10)
        np.testing.assert_allclose(history["force_mean"][-1], forces.mean(), rtol=1e-10)
        np.testing.assert_allclose(history["force_deviation"][-1], forces.std() / forces.mean(), rtol=1e-10)
        # one contact holds the uppermost grain
        self.assertEqual(history["coordination"][-1], (2 * n - 1) / n)
        self.assertEqual(history["mechanical_coordination"][-1], (2 * n - 2) / (n - 1))
        self.assertEqual(history["rattlers"][-1], 1)

    def pressed(self, counts, title, ranks):
        """A lattice in a box of which a force presses one plane along each axis."""
        dimension, pressure = len(counts), 120.0
        path = grains_csv(self.here(title + ".csv"), lattice(*counts))
        boundaries = []
        for d, count in enumerate(counts):
            free, force = [False] * 3, [0.0] * 3
            free[d] = True
            force[d] = -pressure * (2 * RADIUS)**(dimension - 1) * float(np.prod(counts) // count)
            boundaries += [plane(f"low {d}", d, 1, 0.0),
                           plane(f"high {d}", d, -1, 2 * RADIUS * count, free=free, force=force, mass=1.0)]
        case = {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": path, "gravity": [0.0] * 3},
                "time": {"step": 1e-3, "steps": 2},
                "solver": {"method": "nscdd", "tolerance": 1e-13, "max_iterations": 200000, "check_every": 50},
                "decomposition": {"subdomains": 3},
                "output": {"every": 1}}
        return self.run_here(title, merged(case, ALL), boundaries, ranks), pressure

    def test_pressed_lattice(self):
        """Mean stress is the pressure of the walls, the mean force follows from it; coordination and fabric are known. How the
        rows share the force of a plane is not."""
        for counts in ((5, 4), (3, 2, 4)):
            for ranks in (1, 2):
                with self.subTest(counts=counts, ranks=ranks):
                    dimension = len(counts)
                    run, pressure = self.pressed(counts, f"pressed {dimension} {ranks}", ranks)
                    history = run.history()
                    self.assertLess(np.abs(tensor(history, "stress", dimension) - pressure * np.eye(dimension)).max(),
                                    1e-9 * pressure)
                    np.testing.assert_allclose(history["pressure"][-1], pressure, rtol=1e-9)
                    n = np.prod(counts)
                    between = np.array([n // count * (count - 1) for count in counts])
                    at_walls = sum(2 * n // count for count in counts)
                    fabric = tensor(history, "fabric", dimension)
                    self.assertLess(np.abs(fabric - np.diag(between / between.sum())).max(), 1e-12)
                    self.assertEqual(history["coordination"][-1], (2 * between.sum() + at_walls) / n)
                    self.assertEqual(history["mechanical_coordination"][-1], history["coordination"][-1])
                    self.assertEqual(history["rattlers"][-1], 0)
                    self.assertEqual(history["carrying_fraction"][-1], 1.0)
                    force = pressure * (2 * RADIUS)**(dimension - 1)
                    np.testing.assert_allclose(history["force_mean"][-1], force, rtol=1e-9)
                    for d in range(dimension):
                        np.testing.assert_allclose(history[f"force_{'xyz'[d]}:high {d}"][-1], force * n / counts[d], rtol=1e-9)
                    results = run.results()
                    forces = results["/steps/2/contacts/impulse"][:, 0] / 1e-3
                    np.testing.assert_allclose(history["force_deviation"][-1], forces.std() / forces.mean(), rtol=1e-10)
                    np.testing.assert_allclose(history["force_max"][-1], forces.max(), rtol=1e-14)
                    expected = np.append(np.histogram(forces / forces.mean(), bins=100, range=(0.0, 10.0))[0], 0)
                    np.testing.assert_array_equal(results["/steps/2/diagnostics/force_histogram"], expected)
                    self.assertEqual(results["/steps/2/diagnostics@pressure"], history["pressure"][-1])
                    self.assertNotIn("/steps/0/diagnostics", results)

    def test_inside_a_drum(self):
        """Seven disks in a circle fill 7 (R/R_c)^2 of it. A force on a lid over one sphere in a cylinder makes a mean stress of the force over the
        cross-section, in all of the scene and in a region of half of its height; of the half of its width, half of the volume."""
        angles = np.arange(6) * np.pi / 3
        seven = np.vstack([[0.0, 0.0], 2 * RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1)])
        circle = {"name": "ring", "shape": "circle", "radius": 3.01 * RADIUS}
        case = {"scene": {"bodies": "file", "bodies_file": grains_csv(self.here("seven.csv"), seven), "gravity": [0.0, 0.0]},
                "time": {"step": 1e-3, "steps": 1}}
        history = self.run_here("circle", merged(case, ALL), [circle]).history()
        np.testing.assert_allclose(history["solid_fraction"], 7 / 3.01**2, rtol=1e-13)
        np.testing.assert_allclose(history["volume"], np.pi * (3.01 * RADIUS)**2, rtol=1e-13)
        path, force, wide = grains_csv(self.here("one.csv"), [[0.0, 0.0, RADIUS]]), 10.0, 5 * RADIUS
        boundaries = [plane("floor", 2, 1, 0.0), plane("lid", 2, -1, 2 * RADIUS, free=[False, False, True], force=[0.0, 0.0, -force], mass=0.1),
                      {"name": "tube", "shape": "cylinder", "radius": wide, "axis": [0.0, 0.0, 1.0]}]
        case = {"scene": {"dimension": 3, "bodies": "file", "bodies_file": path, "gravity": [0.0] * 3}, "time": {"step": 1e-3, "steps": 1},
                "solver": {"tolerance": 1e-12, "accuracy": 1e-10},
                "region": {"name": "half", "upper": [1e30, 1e30, RADIUS], "axis": "x", "bins": 2}}
        run = self.run_here("cylinder", merged(case, ALL), boundaries)
        history = run.history()
        np.testing.assert_allclose(history["stress_zz"], force / (np.pi * wide**2), rtol=1e-9)
        np.testing.assert_allclose(history["volume"], np.pi * wide**2 * 2 * RADIUS, rtol=1e-13)
        np.testing.assert_allclose(history["half_stress_zz"], force / (np.pi * wide**2), rtol=1e-9)
        np.testing.assert_allclose(history["half_volume"], np.pi * wide**2 * RADIUS, rtol=1e-13)
        # a sphere that fills the tube: the force works on its cross-section
        boundaries[2]["radius"] = 1.0000001 * RADIUS
        run = self.run_here("narrow", merged(case, ALL), boundaries)
        pressure = re.search(r"pressure P = (\S+) Pa", gravier("--check", "case.nml", directory=run.directory).stdout)
        self.assertAlmostEqual(float(pressure[1]) * np.pi * RADIUS**2 / force, 1.0, delta=5e-3)

    def test_sticking_and_flying(self):
        """A disk at rest on a slope of less than the angle of friction does not slide when it must not turn; another flies."""
        path = grains_csv(self.here("stick.csv"), [[0.0, RADIUS], [0.0, 10 * RADIUS], [0.0, 20 * RADIUS]])
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.25, "wall_friction": 0.25, "rotation": False,
                          "gravity": [0.2 * G, -G, 0.0]},
                "time": {"step": 1e-4, "steps": 2}, "solver": {"tolerance": 1e-13}}
        history = self.run_here("stick", merged(case, ALL), [plane("floor", 1, 1, 0.0)]).history()
        np.testing.assert_array_equal(history["sliding_fraction"], 0.0)
        np.testing.assert_array_equal(history["rattlers"], 3)
        np.testing.assert_array_equal(history["mechanical_coordination"], 0.0)
        np.testing.assert_allclose(history["coordination"], 1 / 3, rtol=1e-15)

    def test_mean_overlap(self):
        """Gaps and branches of a column that starts with overlaps."""
        heights = RADIUS * np.array([0.98, 2.95, 4.96])
        path = grains_csv(self.here("overlap.csv"), [[0.0, y] for y in heights])
        case = {"scene": {"bodies": "file", "bodies_file": path, "overlap_projection": False},
                "time": {"step": 1e-4, "steps": 1}}
        run = self.run_here("overlap", merged(case, ALL), [plane("floor", 1, 1, 0.0)])
        history, results = run.history(), run.results()
        forces = results["/steps/1/contacts/impulse"][:, 0] / 1e-4
        # pairs in the order of the candidates: the ground, the two upon it
        by_pair = dict(zip(zip(results["/steps/1/contacts/candidate"], results["/steps/1/contacts/antagonist"] > 3), forces))
        moment = by_pair[1, True] * heights[0] + by_pair[1, False] * (heights[1] - heights[0])
        self.assertGreater(by_pair[1, False], 0.0)
        np.testing.assert_allclose(history["stress_yy"] * history["volume"], moment, rtol=1e-12)
        # 0.02, 0.03; the third pair is apart by 0.01
        np.testing.assert_allclose(history["overlap_mean"], 0.025 * RADIUS, rtol=1e-12)
        np.testing.assert_allclose(history["max_overlap"], 0.03 * RADIUS, rtol=1e-12)

    # ---- where it is computed

    def test_ranks_and_subdomains(self):
        case, boundaries = self.stirred(2, restitution=0.0, wall_restitution=0.0)
        case = merged(case, ALL, {"solver": {"tolerance": 1e-12, "max_iterations": 20000}, "time": {"steps": 40},
                                  "output": {"every": 10}})
        runs = {}
        for subdomains, ranks in ((4, 1), (4, 2), (4, 3), (1, 1)):
            runs[subdomains, ranks] = self.run_here(f"ranks {subdomains} {ranks}",
                                                    merged(case, {"decomposition": {"subdomains": subdomains}}), boundaries, ranks)
        first = runs[4, 1].history()
        for ranks in (2, 3):
            other = runs[4, ranks].history()
            for name, values in first.items():
                if not name.endswith("_seconds"):
                    np.testing.assert_array_equal(other[name], values, name)
            with open(runs[4, 1].path("results", "results.h5"), "rb") as one, \
                    open(runs[4, ranks].path("results", "results.h5"), "rb") as two:
                self.assertEqual(one.read(), two.read())
        alone = runs[1, 1].history()
        # the contacts of so loose a scene are few, and their impulses unique
        names = list(first)
        for name in names[names.index("kinetic_translation"):]:
            # whether a contact without overlap counts in the mean is a matter of rounding
            if name not in ("energy_error", "overlap_mean"):
                scale = np.abs(first[name]).max()
                self.assertLessEqual(np.abs(alone[name] - first[name]).max(), 1e-6 * scale, name)

    def test_restart(self):
        """The balance goes on from a checkpoint, to the same bits on other ranks."""
        case, boundaries = self.stirred(2)
        case = merged(case, ALL, {"output": {"checkpoint_every": 30, "every": 10}})
        whole = self.run_here("whole", merged(case, {"time": {"steps": 60}}), boundaries)
        self.run_here("restarted", merged(case, {"time": {"steps": 30}}), boundaries)
        again = self.run_here("restarted", merged(case, {"time": {"steps": 60}}), boundaries, 2, options=["--restart"])
        history = again.history()
        self.assertGreater(np.abs(history["power:lid"]).max(), 0.0)
        for name, values in whole.history().items():
            if not name.endswith("_seconds"):
                np.testing.assert_array_equal(history[name], values, name)
        self.assertEqual([name for name in differences(whole.results(), again.results()) if "/run@" not in name], [])

    def test_only_what_is_asked_for(self):
        case, boundaries = self.stirred(2)
        case = merged(case, {"time": {"steps": 2}, "output": {"every": 1}})
        plain = self.run_here("plain", case, boundaries)
        columns = len(plain.history())
        self.assertFalse([name for name in plain.results() if "diagnostics" in name])
        more = {"energy": 10, "stress": 7, "structure": 13, "boundary_forces": 4 * len(boundaries), "boundary_moments": len(boundaries), "boundary_power": 4 * len(boundaries)}
        for group, count in more.items():
            run = self.run_here(group, merged(case, {"output": {group: True}}), boundaries)
            history, results = run.history(), run.results()
            self.assertEqual(len(history), columns + count, group)
            for step in steps_of(results)[1:]:
                attributes = [name for name in results if name.startswith(f"/steps/{step}/diagnostics@")]
                self.assertEqual(len(attributes), 0 if group.startswith("boundary_") else count, group)
            # nothing else changes
            for name, values in plain.history().items():
                if not name.endswith("_seconds"):
                    np.testing.assert_array_equal(history[name], values, name)

    # ---- rows of history.csv

    def test_thinned_history(self):
        """Rows of each seventh step, of those with counts, of the first and of the last one are those of the whole history, also through a restart; sums of
        counts are those of all steps, and a hole is refused."""
        case = {"scene": {"dimension": 2, "bodies": "none", "friction": 0.3}, "time": {"step": 1e-3, "steps": 200},
                "boundary": {"name": "hole", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
                "insertion": {"lower": [0.0, 0.05], "upper": [0.2, 0.1], "rate": 200.0, "radius": 0.008, "velocity": [0.0, -0.5]},
                "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 2}, "output": {"every": 0, "checkpoint_every": 90}}
        thin = merged(case, {"output": {"history_every": 7}})
        whole = gravier("case.nml", directory=self.written("whole", case))
        self.assert_status(whole, 0)
        every = whole.history()
        counted = (every["left"] > 0) | (every["entered"] > 0) | (every["fast"] > 0)
        rows = (every["step"] % 7 == 0) | counted | np.isin(every["step"], (1, 200))
        self.assertTrue(0 < (every["left"] > 0).sum() < 200 and rows.sum() < 150, rows.sum())
        for title, ranks in (("thin", 1), ("ranks", 2)):
            part = self.written(title, merged(thin, {"time": {"steps": 91}}))
            self.assert_status(gravier("case.nml", directory=part, ranks=ranks), 0)
            write(os.path.join(part, "case.nml"), namelist(thin))
            run = gravier("--restart", "case.nml", directory=part)
            self.assert_status(run, 0)
            found = run.history()
            for name, values in every.items():
                if not name.endswith("_seconds"):
                    np.testing.assert_array_equal(found[name], values[rows], name)
        for name in ("left", "left_mass", "entered"):
            self.assertAlmostEqual(found[name].sum(), every[name].sum(), delta=1e-12 * every[name].sum())
        write(os.path.join(part, "case.nml"), namelist(merged(case, {"time": {"steps": 210}})))
        refused = gravier("--restart", "case.nml", directory=part)
        self.assert_status(refused, 2)
        self.assertIn("were expected", refused.stdout + refused.stderr)

    def written(self, title, case):
        """A directory with this case."""
        directory = self.here(f"rows {title}")
        os.makedirs(directory)
        write(os.path.join(directory, "case.nml"), namelist(case))
        return directory


if __name__ == "__main__":
    unittest.main()
