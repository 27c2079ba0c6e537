"""What ends a run before its last step: a boundary that has gone its way, a periodic cell that has been strained, a scene that is drained or
filled by number or by mass. The run ends at the same step on any ranks and through restarts, with its last state and checkpoint written and
the reason in its log."""
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, contents, differences, gravier, merged, namelist, run_case, steps_of, write

STEPS = 400
WALLS = [{"name": "left", "shape": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]},
         {"name": "right", "shape": "plane", "point": [0.24, 0.0], "normal": [-1.0, 0.0]}]
OUTLET = {"name": "out", "shape": "outlet", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
FEED = {"name": "feed", "lower": [0.02, 0.2], "upper": [0.22, 0.26], "rate": 500.0, "count": 60, "radii": "uniform", "radius_min": 0.004,
        "radius_max": 0.006, "velocity": [0.0, -0.8]}
#: 60 disks of 0.157 kg and more enter in 0.12 s, and fall through an outlet
FALL = {
    "scene": {"dimension": 2, "bodies": "none", "friction": 0.3, "density": 2000.0},
    "boundary": WALLS + [OUTLET],
    "insertion": [FEED],
    "time": {"step": 1e-3, "steps": STEPS},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 3},
    "output": {"every": 0, "checkpoint_every": 1000},
}
#: a belt under some disks, which moves by 1 mm in a step
BELT = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 3], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "boundary": [{"name": "belt", "shape": "segment", "point": [0.4, -0.05], "end": [0.0, -0.05], "velocity": [-0.6, -0.8]}],
    "time": {"step": 1e-3, "steps": STEPS, "stop_boundary": "belt", "stop_displacement": 0.05},
    "output": {"every": 0, "checkpoint_every": 1000},
}

#: loose grains in a cell that is sheared at a rate while its sides close: a step shears it by 0.01
CELL = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [8, 8], "radius_min": 0.4, "radius_max": 0.6, "friction": 0.3,
              "density": 1.0, "gravity": [0.0, 0.0], "period": [12.0, 12.0], "cell_shear_rate": [0.2], "cell_strain_rate": [0.0, -0.02]},
    "time": {"step": 0.05, "steps": STEPS},
    "output": {"every": 0, "checkpoint_every": 1000},
}


class Stops(RunTestCase):

    def play(self, title, *parts, ranks=1):
        run = run_case(merged(*parts), ranks=ranks, directory=self.here(title))
        self.assert_status(run, 0)
        return run

    def state(self, directory):
        found = contents(os.path.join(directory, "results", "checkpoint.h5"))
        return {name: value for name, value in found.items() if "last_written" not in name}

    def again(self, run, *parts, ranks=1):
        """Change the case and go on from the checkpoint."""
        write(os.path.join(run.directory, "case.nml"), namelist(merged(*parts)))
        again = gravier("--restart", "case.nml", ranks=ranks, directory=run.directory)
        self.assert_status(again, 0)
        return again

    def ended(self, run, reason):
        """The step at which a run has ended, as the log says and with its last state and checkpoint."""
        count = len(run.history()["step"])
        self.assertLess(count, STEPS)
        self.assertIn(f"ended       after step {count} of {STEPS}: {reason}", run.stdout)
        self.assertEqual(steps_of(run.results())[-1], count)
        self.assertIn(f"checkpoint  of step {count} written", run.stdout)
        self.assertRegex(run.stdout.rstrip().splitlines()[-1], f"^finished    all {count} steps reached the accuracy")
        return count

    def check_ways(self, title, *parts, reason):
        """The same end on two ranks and through a restart; a restart after it has nothing to do."""
        whole = self.play(title, *parts)
        count = self.ended(whole, reason)
        two = self.play(title + "2", *parts, ranks=2)
        self.assertEqual(differences(self.state(whole.directory), self.state(two.directory)), [])
        part = self.play(title + "part", *parts, {"time": {"steps": count - 3}})
        for _ in range(2):
            again = self.again(part, *parts, ranks=2)
            self.assertEqual(len(again.history()["step"]), count)
            self.assertIn(f"ended       after step {count} of {STEPS}: {reason}", again.stdout)
            self.assertEqual(differences(self.state(whole.directory), self.state(part.directory)), [])
        return whole, count

    def test_displacement(self):
        whole, count = self.check_ways("belt", BELT, reason="boundary 'belt' has moved by 5.000000E-02 m, stop_displacement = 5.000000E-02 m")
        # 0.05 m at 1 m/s
        self.assertEqual(count, 50)
        more = self.again(whole, BELT, {"time": {"stop_displacement": 0.06}})
        self.assertEqual(len(more.history()["step"]), 60)

    def edges(self, run):
        """Edges of the cell at the end of a run, a row each."""
        return run.results()[f"/steps/{steps_of(run.results())[-1]}/cell/edge"]

    def test_sheared(self):
        """The shear is counted over more than a whole length of the cell, whose edges are replaced on the way. The cell does not move in the
        first half of the first step."""
        whole, count = self.check_ways("sheared", CELL, {"time": {"stop_cell_shear": [1.25]}},
                                       reason="the cell is sheared along x over y by 1.255")
        self.assertEqual(count, 126)
        self.assertLess(abs(self.edges(whole)[1, 0]), 6.1)
        more = self.again(whole, CELL, {"time": {"stop_cell_shear": [1.351]}})
        self.assertEqual(len(more.history()["step"]), 136)

    def test_compressed(self):
        """A strain is the logarithm of the length over that of the start, negative where the cell is compressed."""
        whole, count = self.check_ways("compressed", CELL, {"time": {"stop_cell_strain": [0.0, -0.1]}},
                                       reason="the cell is strained along y by -1.00")
        # 1e-3 a step, without half of the first
        self.assertEqual(count, 101)
        length = self.edges(whole)[1, 1] / 12.0
        self.assertLessEqual(length, np.exp(-0.1))
        self.assertGreater(length, np.exp(-0.101))

    def test_sheared_by_a_stress(self):
        """A cell that stresses drive, in three dimensions and along another component."""
        scene = {"scene": {"dimension": 3, "lattice_count": [6, 6, 6], "period": [9.0] * 3, "gravity": [0.0] * 3, "cell_shear_rate": None,
                           "cell_strain_rate": None, "cell_pressure": [0.0, 1.0, 1.0], "cell_shear_stress": [0.0, 0.0, -2.0]}}
        whole, count = self.check_ways("stress", CELL, scene, {"time": {"stop_cell_shear": [0.0, 0.0, -0.3], "stop_cell_strain": [0.0, 3.0, -3.0]}},
                                       reason="the cell is sheared along y over z by -3.")
        edges = self.edges(whole)
        self.assertAlmostEqual(edges[0, 1], 0.0)
        self.assertLess(count, STEPS)

    def test_drained(self):
        """Fewer grains at the beginning are no end: the scene has to come down to the number."""
        rule = {"time": {"stop_grains_at_most": 10}}
        whole, count = self.check_ways("drained", FALL, rule, reason="10 grains in the scene, stop_grains_at_most = 10")
        grains = whole.history()["grains"]
        self.assertLess(grains[0], 10)
        self.assertEqual(grains.max(), 60)
        self.assertEqual(grains[-1], 10)
        self.assertGreater(grains[-2], 10)
        more = self.again(whole, FALL, {"time": {"stop_grains_at_most": 0}})
        self.assertEqual(more.history()["grains"][-1], 0)
        self.assertGreater(len(more.history()["step"]), count)
        self.assertIn("0 grains in the scene, stop_grains_at_most = 0", more.stdout)

    def test_drained_by_mass(self):
        whole, _ = self.check_ways("light", FALL, {"time": {"stop_mass_at_most": 2.0}}, reason="1.")
        self.assertIn("kg of grains in the scene, stop_mass_at_most = 2.000000E+00 kg", whole.stdout)
        mass = whole.results()[f"/steps/{len(whole.history()['step'])}/bodies/mass"].sum()
        self.assertTrue(2.0 - 2000.0 * np.pi * 0.006 ** 2 < mass <= 2.0, mass)

    def test_filled(self):
        whole, count = self.check_ways("filled", FALL, {"time": {"stop_grains_at_least": 40}},
                                       reason="40 grains in the scene, stop_grains_at_least = 40")
        self.assertEqual(count, 80)
        self.assertEqual(whole.history()["grains"][-1], 40)

    def test_filled_by_mass(self):
        whole, count = self.check_ways("heavy", FALL, {"time": {"stop_mass_at_least": 5.0}}, reason="5.")
        self.assertIn("kg of grains in the scene, stop_mass_at_least = 5.000000E+00 kg", whole.stdout)
        mass = np.cumsum(whole.history()["entered_mass"])
        self.assertTrue(mass[-2] < 5.0 <= mass[-1])
        self.assertAlmostEqual(whole.results()[f"/steps/{count}/bodies/mass"].sum(), mass[-1], delta=1e-9)

    def test_more_at_the_start_is_no_end(self):
        run = self.play("full", BELT, {"time": {"stop_boundary": None, "stop_displacement": None, "steps": 5, "stop_grains_at_least": 10,
                                                "stop_mass_at_least": 0.1, "stop_grains_at_most": 100, "stop_mass_at_most": 1e3}})
        self.assertEqual(len(run.history()["step"]), 5)
        self.assertNotIn("ended ", run.stdout)

    def test_a_boundary_that_is_gone_ends_nothing(self):
        run = self.play("gone", BELT, {"boundary": [{**BELT["boundary"][0], "remove_at": 0.01}], "time": {"steps": 80}})
        self.assertEqual(len(run.history()["step"]), 80)
        self.assertNotIn("ended ", run.stdout)

    def test_the_same_steps(self):
        """A run that is ended early has the steps of one that is not."""
        whole = self.play("whole", FALL, {"time": {"steps": 100}})
        ended = self.play("short", FALL, {"time": {"stop_grains_at_least": 40}})
        for name, value in ended.history().items():
            if name not in ("wall_seconds", "solve_seconds"):
                np.testing.assert_array_equal(value, whole.history()[name][:80])

    def test_refused(self):
        lines = {
            "&time stop_boundary = 'lit': expected the name of a boundary of the input": {"stop_boundary": "lit"},
            "&time stop_displacement is missing: expected a finite real number > 0 (m), required by stop_boundary = 'belt'":
                {"stop_displacement": None},
            "&time stop_boundary is missing: expected a text in quotes": {"stop_boundary": None},
            "&time stop_boundary = '': expected the name of the boundary that stop_displacement is for": {"stop_boundary": ""},
            "&time stop_displacement = 0.0: expected a finite real number > 0 (m)": {"stop_displacement": 0.0},
            "&time stop_cell_shear = 0.5: expected 0 for components of the cell that neither cell_shear_rate nor cell_shear_stress moves":
                {"stop_cell_shear": [0.5]},
            "&time stop_grains_at_most = -1: expected an integer >= 0": {"stop_grains_at_most": -1},
            "&time stop_grains_at_least = 0: expected an integer >= 1": {"stop_grains_at_least": 0},
            "&time stop_mass_at_most = -1.0: expected a finite real number >= 0 (kg)": {"stop_mass_at_most": -1.0},
            "&time stop_mass_at_least = 0.0: expected a finite real number > 0 (kg)": {"stop_mass_at_least": 0.0},
        }
        for line, keys in lines.items():
            with self.subTest(line):
                run = run_case(merged(BELT, {"time": keys}), directory=self.here("bad"), options=("--check",))
                self.assert_status(run, 2)
                self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
                self.assertIn(line, run.stderr)


if __name__ == "__main__":
    unittest.main()
