"""Solves that sweeps leave stagnated, and that Newton's method takes over: rows of a thousand disks, and a strip of bonded disks that is swung."""
import os
import re
import unittest

import numpy as np

from gravier_runs import RunTestCase, differences, merged, run_case, steps_of, write

RADIUS, STEP, GRAVITY = 0.01, 1e-3, 9.81
#: of the wall [m/s], of the hub [rad/s]
SPEED, SPIN = 0.1, 1.0
NONE = {"solver": {"fallback": "none"}}


def rows(places, group=None):
    """A bodies file of disks of 1 kg at these places; the first one is of the group."""
    head = "id,x,y,radius,mass" + (",group" if group else "")
    return head + "\n" + "".join(
        f"{k + 1},{x!r},{y!r},{RADIUS},1" + (f",{group if k == 0 else 0}" if group else "") + "\n" for k, (x, y) in enumerate(places))


def pushed(count):
    """A row of disks that a wall pushes: all take its velocity."""
    return rows([((2 * k + 1) * RADIUS, 0.0) for k in range(count)]), {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "gravity": [0.0, 0.0]},
        "boundary": [{"name": "wall", "shape": "plane", "normal": [1, 0], "velocity": [SPEED, 0.0]}],
        "time": {"step": STEP, "steps": 8}}


def swung(length, width):
    """A strip of bonded disks, of which a hub turns the first one: it turns as one body."""
    places = np.array([(2 * RADIUS * k + RADIUS * (j % 2), np.sqrt(3.0) * RADIUS * j) for j in range(width) for k in range(length)])
    return rows(places.tolist(), group=1), {
        "scene": {"dimension": 2, "bodies": "file", "bodies_file": "bodies.csv", "gravity": [0.0, 0.0], "wall_material": "m",
                  "overlap_projection": False},
        "material": [{"name": "m"}],
        "law": [{"materials": "m", "kind": "bonded", "friction": 0.9, "bond_strength": 1e9, "bond_friction": 0.9, "bond_distance": 1e-3}],
        "boundary": [{"name": "hub", "shape": "grains", "group": 1, "rotation": [SPIN], "pivot": [0.0, 0.0], "material": "m"}],
        "time": {"step": STEP, "steps": 1}}


class Fallback(RunTestCase):

    def play(self, name, scene, *changes, ranks=1, restart=False):
        directory = self.here(name)
        if not restart:
            os.makedirs(directory)
            write(os.path.join(directory, "bodies.csv"), scene[0])
        case = merged(scene[1], {"output": {"directory": "results", "every": 1}}, *changes)
        return run_case(case, ranks, directory, ["--restart"] if restart else [])

    def assert_taken_over(self, run):
        """All that stagnated was taken over, and brought to the accuracy."""
        self.assert_status(run, 0)
        said = re.search(r"\nfallback    method 'newton' took over (\d+) solves? that missed the accuracy, (\d+) of which then reached it, in (\d+) iterations\n",
                         run.stdout)
        self.assertTrue(said, run.stdout)
        self.assertEqual(said[1], said[2])
        self.assertGreater(int(said[3]), 0)

    def assert_lost(self, run):
        self.assert_status(run, 3)
        self.assertRegex(run.stdout, r"\nconverged   NO: .*; \d+ stagnated(, \d+ ended at max_iterations)?, in steps? \d+( to \d+)?\n")
        self.assertIn("\nto mend it  &solver fallback = 'newton' takes over solves that stagnate\n", run.stdout)
        self.assertNotIn("\nfallback  ", run.stdout)

    def test_pushed_row(self):
        """All disks have the speed of the wall, with the same bits on one rank and on two, and after a restart."""
        scene = pushed(1000)
        parts = {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}}
        self.assert_lost(self.play("row without", scene, NONE))
        alone = self.play("row", scene)
        one, two = self.play("row in parts", scene, parts), self.play("row on two ranks", scene, parts, ranks=2)
        for run in (alone, one, two):
            self.assert_taken_over(run)
            results = run.results()
            for step in steps_of(results)[1:]:
                velocity = results[f"/steps/{step}/bodies/velocity"][:, 0]
                # the mean error is within the accuracy; a single disk may be farther off
                self.assertLess(np.sqrt(np.mean((velocity - SPEED) ** 2)), 0.1 * SPEED)
        self.assertEqual(differences(one.results(), two.results()), [])
        self.play("row again", scene, parts, {"time": {"steps": 4}, "output": {"checkpoint_every": 4}})
        again = self.play("row again", scene, parts, {"output": {"checkpoint_every": 4}}, restart=True)
        self.assert_status(again, 0)
        self.assertEqual(differences(one.results(), again.results()), ["/run@input_text"])

    def test_column(self):
        """The ground carries a column of 1000 disks in each of 100 steps, and no disk falls."""
        case = {"scene": {"dimension": 2, "bodies": "column", "column_count": 1000, "radius": RADIUS, "mass": 1.0, "friction": 0.5},
                "time": {"step": STEP, "steps": 100}}
        self.assert_lost(self.play("column without", ("", case), NONE))
        run = self.play("column", ("", case), {"output": {"boundary_forces": True}})
        self.assert_taken_over(run)
        results = run.results()
        fastest = [np.abs(results[f"/steps/{step}/bodies/velocity"]).max() for step in steps_of(results)]
        self.assertEqual(len(fastest), 101)
        self.assertLess(max(fastest), 0.5 * GRAVITY * STEP)
        history = run.history()
        force = next(history[name] for name in history if name.startswith("force_y"))
        self.assertLess(np.abs(np.abs(force) / (1000 * GRAVITY) - 1.0).max(), 0.05)

    def test_swung_strip(self):
        """A strip of bonded disks turns with its hub."""
        scene = swung(60, 4)
        self.assert_lost(self.play("strip without", scene, NONE))
        run = self.play("strip", scene)
        self.assert_taken_over(run)
        results = run.results()
        place, velocity = (results[f"/steps/{step}/bodies/{name}"] for step, name in ((0, "position"), (1, "velocity")))
        exact = SPIN * np.stack([-place[:, 1], place[:, 0]], axis=1)
        self.assertLess(np.sqrt(np.mean(np.sum((velocity[:, :2] - exact) ** 2, axis=1))), 0.1 * run.history()["velocity_scale"][0])

    def test_plain_sweeps(self):
        """Accelerated sweeps oscillate in some steps of 27 spheres that settle under a lid, and stagnate. Plain ones, which then come, and
        momentum that begins anew solve half of these steps: of 300 steps some 21 to 24 are missed. Without them 48 were. Newton's method solves the
        others."""
        case = {"scene": {"dimension": 3, "bodies": "file", "bodies_file": "bodies.csv", "density": 2500.0, "gravity": [0.0, 1.0, -9.81],
                          "wall_material": "g"},
                "material": [{"name": "g"}],
                "law": [{"materials": "g", "kind": "hertz", "young_modulus": 1e8, "spring_restitution": 0.4, "friction": 0.4, "rolling_friction": 0.3}],
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0, 0, 1]},
                             {"name": "lid", "shape": "plane", "point": [0.0, 0.0, 0.0305], "normal": [0, 0, -1], "free": [False, False, True],
                              "mass": 0.01, "force": [0.0, 0.0, -0.5]}],
                "time": {"step": 2e-4, "steps": 150}, "solver": {"accuracy": 1e-3, "fallback": "none"}}
        missed = 0
        for seed in (1, 2):
            random = np.random.default_rng(seed)
            places = [(0.0101 * i + random.uniform(0, 2e-4), 0.0101 * j + random.uniform(0, 2e-4), 0.0052 + 0.0101 * k)
                      for i in range(3) for j in range(3) for k in range(3)]
            lines = [f"{n + 1},{x!r},{y!r},{z!r},0.005,{0.1 * (n % 3 - 1)!r}" for n, (x, y, z) in enumerate(places)]
            bodies = "\n".join(["id,x,y,z,radius,vx", *lines]) + "\n"
            run = self.play(f"spheres {seed}", (bodies, case))
            self.assertIn(run.status, (0, 3))
            missed += (run.history()["converged"] == 0).sum()
            self.assert_taken_over(self.play(f"spheres {seed} by both", (bodies, case), {"solver": {"fallback": "newton"}}))
        self.assertLess(missed, 36)
        # plain sweeps that are cut off come after solves that have stagnated
        run = self.play("spheres cut off", (bodies, case), {"solver": {"max_iterations": 1500}})
        self.assert_status(run, 3)
        self.assertRegex(run.stdout, r"\nconverged   NO: .*\d+ stagnated")

    def test_limits(self):
        """Problems with more contacts than `fallback_contacts` are left as they are, and the log says which key to change."""
        scene = pushed(1000)
        run = self.play("large", scene, {"solver": {"fallback_contacts": 999}})
        self.assert_status(run, 3)
        self.assertNotIn("\nfallback  ", run.stdout)
        self.assertIn("\nto mend it  a larger &solver fallback_contacts, now 999: Newton's method takes over solves of so many contacts at most\n",
                      run.stdout)

    def test_moments(self):
        """Newton's method takes over solves with moments, too: of a row of disks that do not roll well on each other."""
        row, case = pushed(1000)
        scene = row, merged(case, {"scene": {"friction": 0.5, "rolling_friction": 0.1}})
        self.assert_lost(self.play("rolls without", scene, NONE))
        self.assert_taken_over(self.play("rolls", scene))


if __name__ == "__main__":
    unittest.main()
