"""Periodic cells that deform: grains that cross them, contacts across them, balances, symmetries, stresses that are held, and one result in any
number of subdomains, on any number of ranks and after a restart."""
import os
import re
import shutil

import numpy as np

from gravier_runs import SOME_RANKS, RunTestCase, each, gravier, merged, run_case, write
from cell_runs import EXACT, LATTICE, STEP, CellTestCase
from small_scenes import Grain, bodies_csv

import unittest


class Cell(CellTestCase):

    def test_free_grain(self):
        """A grain that nothing meets flies straight: its images are images by the edges of now. It starts with the velocity of the cell. (Of xy
        and yz together, whose product is a gradient, too, the cell would carry it along.)"""
        for dimension, period, shear in ((2, [1.0, 0.8], [3.0]), (3, [1.0, 0.8, 1.2], [3.0, -2.0, 0.0]), (3, [1.0, 0.8, 1.2], [0.0, 2.0, 1.5])):
            place, speed = np.array([0.3, 0.7, 0.9])[:dimension], np.array([0.7, 1.3, -2.1])[:dimension]
            found = self.grains(f"free {dimension} {shear}", [Grain(place, speed)], {"period": period, "cell_shear_rate": shear}, 500, 50)
            gradient = np.zeros((dimension, dimension))
            gradient[0, 1] = shear[0]
            if dimension == 3:
                gradient[0, 2], gradient[1, 2] = shear[1:]
            # half of the first step is made before the cell moves
            start = speed + gradient @ (place + speed * STEP / 2 - np.array(period) / 2)
            turned = np.zeros(dimension)
            for step in range(50, 501, 50):
                state = f"/steps/{step}/"
                edge, rate = found[state + "cell/edge"], found[state + "cell/velocity"]
                x, v, image = (found[state + f"bodies/{name}"][0] for name in ("position", "velocity", "image"))
                np.testing.assert_allclose(x + image @ edge, place + speed * STEP / 2 + start * STEP * (step - 0.5), rtol=0, atol=2e-11)
                np.testing.assert_allclose(v[:dimension] + image @ rate, start, rtol=0, atol=2e-11)
                self.assertLessEqual(abs(edge[1, 0]), 0.5 * period[0] + 0.1)
                turned = np.maximum(turned, np.abs(image))
            self.assertGreater(np.max(turned), 4)

    def test_falling_grain(self):
        """Gravity along x does on a grain that crosses the cell the work that its potential energy loses, tilts counted."""
        found = self.grains("falling", [Grain([0.3, 0.7], [0.0, 1.3], mass=2.0)],
                            {"period": [1.0, 0.8], "cell_shear_rate": [3.0], "gravity": [5.0, 0.0]}, 200, 50)
        for step in (50, 100, 200):
            state = f"/steps/{step}/"
            place = found[state + "bodies/position"][0] + found[state + "bodies/image"][0] @ found[state + "cell/edge"]
            self.assertAlmostEqual(found[state + "diagnostics@potential_energy"], -2.0 * 5.0 * place[0], delta=1e-10)
            self.assertGreater(abs(found[state + "bodies/image"][0, 1]), 0)

    def test_pair_across_the_cell(self):
        """Two disks that meet across the period along y. A cell that shrinks closes them with the velocity of its rate over their distance, which
        one impulse takes away; one that is sheared moves them past each other, without force where there is no friction."""
        radius, mass, length, rate = 0.1, 0.7, 1.0, -0.3
        pair = [Grain([0.5, 0.1], radius=radius, mass=mass), Grain([0.5, 0.9], radius=radius, mass=mass)]
        found = self.grains("closing", pair, {"period": [1.0, length], "cell_strain_rate": [0.0, rate]})
        impulse = -0.5 * mass * rate * 2 * radius
        np.testing.assert_allclose(found["/steps/1/contacts/impulse"][0], [impulse, 0.0], rtol=1e-10, atol=1e-12)
        # the cell takes them to +-0.4 rate, and the impulse takes them apart across the period
        speed = -0.4 * rate + impulse / mass
        np.testing.assert_allclose(found["/steps/1/bodies/velocity"][:, 1], [speed, -speed], rtol=1e-10)
        # both sides of the contact have one velocity, with that of the image
        self.assertAlmostEqual(speed - (-speed - rate * length), 0.0, delta=1e-12)
        for shear in (2.0, -2.0):
            found = self.grains(f"passing {shear}", pair, {"period": [1.0, length], "cell_shear_rate": [shear], "friction": 0.0})
            np.testing.assert_allclose(found["/steps/1/contacts/impulse"], 0.0, atol=1e-13)
            np.testing.assert_allclose(found["/steps/1/bodies/velocity"][:, :2], [[-0.4 * shear, 0.0], [0.4 * shear, 0.0]], rtol=1e-12, atol=1e-13)

    def test_rubbing_pair(self):
        """Pressed together and sheared, a pair across the period slides with the friction force, which also turns it: v_t from the cell is
        g times the distance."""
        radius, mass, friction = 0.1, 0.7, 0.05
        pair = [Grain([0.5, 0.1], radius=radius, mass=mass), Grain([0.5, 0.9], radius=radius, mass=mass)]
        found = self.grains("rubbing", pair, {"period": [1.0, 1.0], "cell_strain_rate": [0.0, -0.3], "cell_shear_rate": [2.0],
                                              "friction": friction})
        normal = 0.5 * mass * 0.3 * 0.2
        impulse = found["/steps/1/contacts/impulse"][0]
        self.assertAlmostEqual(impulse[0], normal, delta=1e-12)
        self.assertAlmostEqual(abs(impulse[1]), friction * normal, delta=1e-12)
        velocity = found["/steps/1/bodies/velocity"]
        # the upper image of the lower disk moves with +x, and is held back
        self.assertAlmostEqual(velocity[0, 0], -0.8 - friction * normal / mass, delta=1e-12)
        self.assertAlmostEqual(velocity[1, 0], 0.8 + friction * normal / mass, delta=1e-12)
        np.testing.assert_allclose(velocity[:, 2], -friction * normal * radius / (0.5 * mass * radius**2), rtol=1e-9)

    def test_rebound(self):
        """A shock across the period sends the relative velocity back, that of the image included; the second step parts them with it."""
        pair = [Grain([0.5, 0.099], [0.0, -1.0], mass=0.7, radius=0.1), Grain([0.5, 0.901], [0.0, 1.0], mass=0.7, radius=0.1)]
        found = self.grains("rebound", pair, {"period": [1.0, 1.0], "cell_strain_rate": [0.0, -0.5], "restitution": 0.5}, 2)
        rates = []
        for step in (1, 2):
            velocity = found[f"/steps/{step}/bodies/velocity"][:, 1]
            rates.append(velocity[0] + found[f"/steps/{step}/cell/velocity"][1, 1] - velocity[1])
        # it closes with 2 at the start of the first step, when the cell is at rest
        self.assertAlmostEqual(rates[0], 0.5 * 2.0, delta=1e-9)

    def test_compliant_pair(self):
        """The spring of a pair across the period is pressed by the way that the cell brings it nearer."""
        pair = [Grain([0.5, 0.1], radius=0.1, mass=0.7), Grain([0.5, 0.9], radius=0.1, mass=0.7)]
        law = {"material": [{"name": "a"}], "law": [{"materials": ["a"], "kind": "elastic", "normal_stiffness": 1000.0}], "time": {"step": 1e-3}}
        found = self.grains("compliant", pair, {"period": [1.0, 1.0], "cell_strain_rate": [0.0, -0.2]}, 20, 20, **law)
        state = "/steps/20/"
        place = found[state + "bodies/position"] + found[state + "bodies/image"] @ found[state + "cell/edge"]
        overlap = 0.2 - (found[state + "cell/edge"][1, 1] - (place[1, 1] - place[0, 1]))
        force = found[state + "contacts/impulse"][0, 0] / 1e-3
        # a step moves the pair by a fifteenth of the overlap
        self.assertGreater(overlap, 3e-4)
        self.assertAlmostEqual(force, 1000.0 * overlap, delta=0.1 * force)

    def test_memory_across_the_cell(self):
        """Bonded pairs that drift through a cell, whose edges are straightened several times, stay bonded in any number of subdomains, and have
        the same motion: a pair keeps its memory wherever it crosses a side of the cell or of a subdomain."""
        for dimension, motion in ((2, {"cell_shear_rate": [2.5]}), (2, {"cell_strain_rate": [-0.3, 0.2]}), (3, {"cell_shear_rate": [2.5, -2.0, 1.7]})):
            random = np.random.default_rng(4)
            places = [np.array(place) for place in np.ndindex(*[4] * dimension)]
            grains = []
            for place in places[::2]:
                centre = (place + 0.5) * 0.25 + random.uniform(-0.03, 0.03, dimension)
                way = random.normal(size=dimension)
                for sign in (-1, 1):
                    grains.append(Grain(centre + sign * 0.02 * way / np.linalg.norm(way), random.normal(size=dimension) * 0.3, radius=0.02, mass=0.01))
            law = {"materials": ["m"], "kind": "bonded", "bond_strength": 1e4, "bond_friction": 1.0, "bond_distance": 5e-3, "friction": 0.3}
            found = []
            for grid in ([1] * dimension, [2, 3, 2][:dimension]):
                found.append(self.grains(f"bonded pairs {dimension} {next(iter(motion))} {grid}", grains, {"period": [1.0] * dimension, "wall_material": "m", **motion},
                                         120, 120, material=[{"name": "m"}], law=[law], decomposition={"grid": grid}, solver={"method": "nscdd"},
                                         output={"bonds": True}))
            for one in found:
                self.assertEqual(one["/steps/120/diagnostics@bonds"], len(grains) // 2)
            # pairs that collide make more of what the solves differ by
            np.testing.assert_allclose(*(one["/steps/120/bodies/position"] for one in found), rtol=0, atol=1e-4)

    def test_cell_without_contacts(self):
        """Stresses accelerate a cell that nothing resists: K dG/dt = -V P, and V tau for a shear."""
        grains = [Grain([0.2, 0.2], radius=0.01, mass=2.0), Grain([0.7, 0.6], radius=0.01, mass=3.0)]
        found = self.grains("empty", grains, {"period": [1.0, 1.5], "cell_pressure": [0.0, 4.0], "cell_shear_stress": [0.5], "cell_inertia": 0.25})
        velocity, inertia = found["/steps/1/cell/velocity"], 0.25 * 5.0 * 1.5**2
        self.assertAlmostEqual(velocity[1, 1], -STEP * 1.5 * 4.0 / inertia * 1.5, delta=1e-14)
        self.assertAlmostEqual(velocity[1, 0], STEP * 1.5 * 0.5 / inertia * 1.5, delta=1e-14)

    def test_balances(self):
        """Momentum changes by nothing, energy by what the cell does; the pressure comes to be that which is held."""
        run = self.lattice("balances", {"time": {"steps": 200}, "output": {"every": 200}})
        found, history = run.results(), run.history()
        self.assertLess(np.max(np.abs(history["energy_error"])), 1e-11 * np.max(np.abs(history["boundary_work"])))
        late = history["time"] > 10.0
        self.assertAlmostEqual(np.mean(history["stress_yy"][late]), 1.0, delta=0.1)
        self.assertLess(np.mean(history["stress_xy"][late]), -0.15)
        mass = found["/steps/200/bodies/mass"] if "/steps/200/bodies/mass" in found else np.pi * found["/steps/200/bodies/radius"]**2
        state = "/steps/200/"
        edge, rate = found[state + "cell/edge"], found[state + "cell/velocity"]
        gradient = np.linalg.solve(edge, rate).T
        middle = np.array([3.8, 3.8])
        peculiar = found[state + "bodies/velocity"][:, :2] - (found[state + "bodies/position"] - middle) @ gradient.T
        # places are those of the end of the step, half a step after the velocities were carried along
        self.assertLess(np.max(np.abs(mass @ peculiar)) / mass.sum(), 2e-3)

    def test_one_result(self):
        """Subdomains change rounding alone; ranks and a restart nothing."""
        smooth = {"scene": {"friction": 0.0, "overlap_projection": False}, "solver": {"method": "nscdd", **EXACT}, "time": {"steps": 40}}
        whole = self.lattice("whole", merged(smooth, {"output": {"every": 40}})).results()
        for count in (4, 8):
            parts = self.lattice(f"parts {count}", merged(smooth, {"decomposition": {"subdomains": count}, "output": {"every": 40}})).results()
            for name in ("bodies/position", "bodies/velocity", "cell/edge"):
                np.testing.assert_allclose(parts["/steps/40/" + name], whole["/steps/40/" + name], rtol=0, atol=1e-6, err_msg=f"{count} {name}")
        several = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 8}}
        runs = {ranks: self.lattice(f"ranks {ranks}", several, ranks).results() for ranks in SOME_RANKS}
        here = self.here("restarted")
        os.makedirs(here)
        first = run_case(merged(LATTICE, several, {"time": {"steps": 33}, "output": {"checkpoint_every": 33}}), directory=here)
        self.assert_status(first, 0)
        last = run_case(merged(LATTICE, several, {"output": {"checkpoint_every": 33}}), ranks=2, directory=here, options=["--restart"])
        self.assert_status(last, 0)
        runs["restart"] = last.results()
        for kind, found in runs.items():
            for name in ("bodies/position", "bodies/velocity", "bodies/image", "cell/edge", "cell/velocity", "contacts/impulse"):
                np.testing.assert_array_equal(found["/steps/60/" + name], runs[1]["/steps/60/" + name], err_msg=f"{kind} {name}")

    def test_methods(self):
        """All methods find one result of frictionless contacts."""
        smooth = {"scene": {"friction": 0.0, "overlap_projection": False}, "time": {"steps": 24}, "output": {"every": 24}}
        # the 24 steps end with 68 contacts of 36 disks
        wanted = self.lattice("nlgs", merged(smooth, {"solver": {"method": "nlgs", **EXACT}})).results()
        for method in ("schwarz", "schwarz_ec", "nscdd_ep"):
            found = self.lattice(method, merged(smooth, {"solver": {"method": method, **EXACT}, "decomposition": {"subdomains": 4}})).results()
            for name in ("bodies/position", "cell/edge"):
                np.testing.assert_allclose(found["/steps/24/" + name], wanted["/steps/24/" + name], rtol=0, atol=1e-6, err_msg=f"{method} {name}")

    def test_mirror(self):
        """The mirror image of a scene, sheared the other way, stays its mirror image."""
        rng = np.random.default_rng(5)
        places = [np.array([x, y]) + rng.uniform(-0.02, 0.02, 2) for x in np.arange(5) * 0.22 + 0.11 for y in np.arange(5) * 0.22 + 0.11]
        speeds = rng.uniform(-1.0, 1.0, (25, 2))
        scene = {"period": [1.1, 1.1], "friction": 0.3, "overlap_projection": False}
        found = []
        for side in (1.0, -1.0):
            grains = [Grain([0.55 + side * (x - 0.55), y], [side * u, v], radius=0.08) for (x, y), (u, v) in zip(places, speeds)]
            found.append(self.grains(f"mirror {side}", grains, {**scene, "cell_shear_rate": [side * 3.0], "cell_strain_rate": [0.0, -1.0]}, 25, 25))
        x, y = (state["/steps/25/bodies/position"] + state["/steps/25/bodies/image"] @ state["/steps/25/cell/edge"] for state in found)
        np.testing.assert_allclose(x[:, 0] - 0.55, -(y[:, 0] - 0.55), rtol=0, atol=1e-7)
        np.testing.assert_allclose(x[:, 1], y[:, 1], rtol=0, atol=1e-7)
        self.assertGreater(len(found[0]["/steps/25/contacts/impulse"]), 5)

    def test_in_space(self):
        """Spheres under a pressure along z and a shear stress of x over z: both come to be held."""
        run = self.lattice("space", {"scene": {"dimension": 3, "lattice_count": [4, 4, 5], "gravity": [0.0] * 3, "period": [5.1, 5.1, 6.4],
                                               "list_steps": 0.0, "cell_shear_rate": [0.0] * 3, "cell_pressure": [0.0, 0.0, 1.0],
                                               "cell_shear_stress": [0.0, 0.05, 0.0]}, "time": {"steps": 150}, "output": {"every": 150}})
        history = run.history()
        late = history["time"] > 10.0
        self.assertAlmostEqual(np.mean(history["stress_zz"][late]), 1.0, delta=0.15)
        self.assertAlmostEqual(np.mean(history["stress_xz"][late]), -0.05, delta=0.03)
        self.assertLess(np.max(np.abs(history["energy_error"])), 1e-11 * np.max(np.abs(history["boundary_work"])))

    def test_jammed(self):
        """A jammed packing that is sheared very slowly: impulses that press it together move hardly any grain, and the cell as a whole. Solves
        end after a few iterations, and the stresses of all steps are those that are held, but for the 2 % that a slip adds for a few steps."""
        here = self.here("jammed")
        packing = {"scene": {"bodies": "sample", "friction": 0.3, "gravity": [0.0, 0.0], "period": [0.3, 0.3], "cell_pressure": [100.0, 100.0]},
                   "sample": {"count": 150, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "box": [0.3, 0.3],
                              "arrangement": "loose"},
                   "time": {"step": 1e-3, "steps": 1500},
                   "output": {"directory": "packed", "every": 0, "final_bodies": True, "final_forces": True}}
        self.assert_status(run_case(packing, directory=here), 0)
        shear = {"scene": {**packing["scene"], "bodies": "file", "bodies_file": "packed/final_bodies.h5", "cell_shear_rate": [1e-8]},
                 "time": {"step": 1e-3, "steps": 400}, "output": {"directory": "results", "every": 1, "stress": True}}
        shear["scene"].pop("period")
        run = run_case(shear, directory=here)
        self.assert_status(run, 0)
        history = run.history()
        self.assertLess(np.mean(history["iterations"]), 20)
        for component in ("xx", "yy"):
            np.testing.assert_allclose(history[f"stress_{component}"], 100.0, rtol=0, atol=5.0)

    def test_newton_takes_over(self):
        """Rough disks in a cell that pressures drive, at an accuracy that sweeps do not reach in all steps: Newton's method does in most of the
        others. What it compares with is measured anew after each answer of the cell."""
        case = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [12, 12], "radius_min": 0.3, "radius_max": 0.6, "friction": 1.5,
                          "density": 1.0, "gravity": [0.0, 0.0], "period": [15.3, 15.3], "cell_shear_rate": [0.2], "cell_pressure": [1.0, 1.0]},
                "time": {"step": 0.1, "steps": 100},
                "solver": {"acceleration": "none", "accuracy": 1e-5, "tolerance": 1e-10, "max_iterations": 2000, "fallback": "newton"},
                "output": {"directory": "results", "every": 0}}
        runs = each(lambda seed: run_case(merged(case, {"scene": {"seed": seed}}), directory=self.here(f"taken over {seed}")), [(3,), (4,)])
        found = [re.search(r"took over (\d+) solves? .*, (\d+) of which then reached it", run.stdout) for run in runs]
        taken, solved = (sum(int(counts[k]) for counts in found) for k in (1, 2))
        self.assertGreater(taken, 3)
        self.assertGreater(solved, 0.6 * taken)

    def test_light_cell(self):
        """A cell that stresses drive is warned of if it is lighter than (d/L)^2, with the length that they drive; one with given rates has no
        inertia."""
        for scene, expected in (({}, 1), ({"cell_inertia": 0.02}, 0), ({"cell_pressure": [0.0, 0.0]}, 0),
                                ({"period": [7.6, 12.0]}, 0), ({"period": [7.6, 12.0], "cell_pressure": [1.0, 1.0]}, 1)):
            scene = {"cell_inertia": 0.01, **scene}
            run = run_case(merged(LATTICE, {"scene": scene}), directory=self.here("light"), options=["--check"])
            self.assert_status(run, 0)
            self.assertEqual(len(re.findall(r"^warning     &scene cell_inertia = 1\.00E-02: so light a cell .* at least \(d/L\)\^2 = 1\.7\dE-02 "
                                            "would do$", run.stdout, re.M)), expected, run.stdout)

    def test_slow_cell(self):
        """A cell that answers to its stresses later than they turn is warned of, with the inertia that would do; one that is as light, one whose stress
        does not turn, and one with a given rate are not. The answer time goes with the root of the inertia."""
        here = self.here("slow")
        os.makedirs(here)
        times = []
        for name, scene, column, expected in (("slow", {}, "shear_stress_xy", 1), ("light", {"cell_inertia": 1e-3}, "shear_stress_xy", 0),
                                              ("once", {}, "shear_stress_xy", 0), ("rate", {}, "shear_rate_xy", 0)):
            last = "2,0.1" if name == "once" else "2,0.1\n6,-0.1\n8,0"
            table = write(f"{here}/{name}.csv", f"time,{column}\n0,0\n{last}\n")
            scene = {"cell_shear_rate": [0.0], "cell_inertia": 1.0, "cell_table": table, **scene}
            run = run_case(merged(LATTICE, {"scene": scene}), directory=self.here(f"slow {name}"), options=["--check"])
            self.assert_status(run, 0)
            found = re.findall(r"^warning     &scene cell_inertia = (\S+): a stress of cell_table turns after 4\.00E\+00 s, (\S+) of the times in which the "
                               r"cell answers, .*; at most (\S+) would do$", run.stdout, re.M)
            self.assertEqual(len(found), expected, run.stdout)
            for inertia, answers, most in np.array(found, float):
                self.assertAlmostEqual(most / (inertia * (answers / 15.0)**2), 1.0, delta=0.02)
            times.append(float(re.search(r"^ +the cell answers to stresses of 1\.00E\+00 N/m after about (\S+) s", run.stdout, re.M)[1]))
        self.assertAlmostEqual(times[1] / times[0], np.sqrt(1e-3), delta=3e-4)

    def test_refused(self):
        """What does not go with a cell that moves is refused by one line."""
        here = self.here("refused")
        os.makedirs(here)
        moving = " in a periodic cell that moves\n"
        for groups, message in (
                ({"boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]}]},
                 "&boundary: expected no boundaries and outlets" + moving),
                ({"insertion": [{"name": "in", "lower": [1.0, 1.0], "upper": [2.0, 2.0], "radius": 0.1, "rate": 1.0}]},
                 "&insertion: expected no insertion of grains" + moving),
                ({"region": [{"name": "r"}]}, "&region: expected no regions of means" + moving),
                ({"solver": {"sleeping": True}}, "&solver sleeping = .true.: expected .false." + moving),
                ({"solver": {"method": "newton"}},
                 "&solver method = 'newton': expected another method where stresses drive the periodic cell\n"),
                ({"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 5000}},
                 "&decomposition subdomains = 5000: expected 4096 at most" + moving),
                ({"scene": {"period": [7.6, 0.0], "cell_shear_rate": [0.0]}},
                 "&scene cell_strain_rate, or a stress in its place: expected a period along y\n"),
                ({"scene": {"period": [0.0, 7.6]}}, "&scene cell_shear_rate, or a stress in its place: expected a period along x\n")):
            run = run_case(merged(LATTICE, groups), directory=here)
            self.assert_status(run, 2)
            self.assertEqual(run.stderr, "gravier: error: case.nml: " + message)
            shutil.rmtree(os.path.join(here, "results"), ignore_errors=True)

    def test_shrunken(self):
        """A cell that has become shorter than its pairs reach ends the run, and so does one that would have no length or a negative one."""
        here = self.here("shrunken")
        os.makedirs(here)
        write(os.path.join(here, "grains.csv"), bodies_csv([Grain([0.5, 0.5], radius=0.05)]))
        for rate, line in ((-2.0, r"the periodic cell has shrunk to .* m; expected more than .* m along each axis"),
                           *((-share / STEP, "the periodic cell shrinks by more than its length in this step; expected rates of strain, pressures "
                              "and a &time step that shrink it little in a step") for share in (2.0, 2.5))):
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "grains.csv", "gravity": [0.0, 0.0], "period": [1.0, 1.0],
                                      "cell_strain_rate": [0.0, rate]}, "time": {"step": STEP, "steps": 200},
                            "output": {"directory": "results"}}, directory=here)
            self.assert_status(run, 4)
            self.assertRegex(run.stderr, r"step \d+: " + line)
            shutil.rmtree(os.path.join(here, "results"))


if __name__ == "__main__":
    unittest.main()
