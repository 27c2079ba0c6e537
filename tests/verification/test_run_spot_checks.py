"""Spot checks of runs: they change no bit of the results, say the same on any ranks, and foretell what a tenth of the error takes."""
import os
import re

import numpy as np

from gravier_runs import SOURCE, RunTestCase, contents, merged, run_case

from gravier import parse_namelist

SETTLING = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [12, 10], "radius_min": 0.008, "radius_max": 0.012,
              "friction": 0.3, "alert_distance": 0.003},
    "time": {"step": 1e-3, "steps": 800},
    "decomposition": {"subdomains": 4},
    "solver": {"method": "schwarz"},
    "output": {"directory": "results", "every": 200},
}
#: seconds are not those of another run
CLOCKS = ("seconds", "wall")


def lines(run):
    """The lines of the log about spot checks."""
    return re.search(r"\n(checked .*\n(?: +.*\n)*)", run.stdout)[1].splitlines()


class SpotChecks(RunTestCase):

    def test_settling(self):
        runs = {}
        for title, part, ranks in (("off", 0.0, 1), ("default", None, 1), ("two ranks", None, 2), ("often", 1.0, 1)):
            solver = {"solver": {"spot_checks": part}} if part is not None else {}
            runs[title] = run_case(merged(SETTLING, solver), ranks, self.here(title))
            self.assert_status(runs[title], 0)
        self.assertNotIn("\nchecked ", runs["off"].stdout)
        for title in ("default", "two ranks", "often"):
            with self.subTest(title):
                self.assert_same(runs["off"], runs[title])
        found = lines(runs["default"])
        self.assertEqual(found, lines(runs["two ranks"]))
        checked = re.fullmatch(r"checked     (\d+) solves? by going on to the accuracy 1.00E-02 and back, in (\d+) % more iterations"
                               r"(; \d+ of them reached it)?", found[0])
        self.assertGreaterEqual(int(checked[1]), 4, found)
        self.assertLessEqual(int(checked[2]), 10, found)
        # the goal is 0.1 of U; what is found agrees with what was estimated
        off, estimated = map(float, re.fullmatch(r" +velocities were off by (\S+) of U, root mean square, and by their estimates (\S+)",
                                                 found[1]).groups())
        self.assertLess(off, 0.1)
        self.assertGreater(estimated, 0.5 * off)
        self.assertLess(estimated, 5.0 * off)
        self.assertRegex(found[2], r" +forces of a single step were off by \d+ % at contacts, \d+ % in the mean stress, \d+ % on 'wall \d+', "
                                   r"\d+ % on 'wall \d+', on the others between the two")

    def assert_same(self, first, second):
        """The same history, but for clocks, and the same states."""
        before, after = first.history(), second.history()
        for name in before:
            if not any(clock in name for clock in CLOCKS):
                np.testing.assert_array_equal(before[name], after[name], name)
        before, after = (contents(run.path("results", "results.h5")) for run in (first, second))
        steps = [name for name in before if name.startswith("/steps/") and "wall" not in name]
        self.assertGreater(len(steps), 10)
        for name in steps:
            np.testing.assert_array_equal(before[name], after[name], name)

    def test_foretold(self):
        """What a tenth of the error takes, by the checks, beside a run that takes it: a factor of two is what the documents say."""
        with open(os.path.join(SOURCE, "data/scenes/shear.nml"), encoding="utf-8") as file:
            case = parse_namelist(file.read())
        case["scene"][0]["bodies_file"] = os.path.join(SOURCE, case["scene"][0]["bodies_file"])
        case = {group: keys if group == "boundary" else keys[0] for group, keys in case.items()}
        case = merged(case, {"time": {"steps": 300}, "output": {"directory": "results", "every": 0}})
        run = run_case(merged(case, {"solver": {"spot_checks": 0.3}}), 1, self.here("loose"))
        self.assert_status(run, 0)
        foretold = float(re.search(r"\n +at accuracy 1.00E-02: about (\S+) iterations, \S+ s, by \d+ solves continued to it\n", run.stdout)[1])
        tight = run_case(merged(case, {"solver": {"accuracy": 0.01, "tolerance": 1e-3, "spot_checks": 0.0}}), 1, self.here("tight"))
        self.assert_status(tight, 0)
        taken = tight.history()["iterations"].sum()
        self.assertLess(abs(np.log2(foretold / taken)), 1.0, (foretold, taken))

    def test_foretold_at_rest(self):
        """Where many solves find nothing to do, those of a run at less error do not either: what checks foretell is called a bound."""
        case = merged(SETTLING, {"time": {"steps": 3000}, "solver": {"method": "nlgs"}, "decomposition": {"subdomains": 1}})
        run = run_case(case, 1, self.here("loose"))
        self.assert_status(run, 0)
        said = re.search(r"\n +at accuracy 1.00E-02: at most about (\S+) iterations, \S+ s, by \d+ solves continued to it: (\d+) % of the solves needed "
                         r"no iteration, and solves of a run at that goal start from better impulses\n", run.stdout)
        self.assertTrue(said, run.stdout)
        self.assertEqual(int(said[2]), round(100.0 * np.mean(run.history()["iterations"] == 0)))
        tight = run_case(merged(case, {"solver": {"accuracy": 0.01, "spot_checks": 0.0}}), 1, self.here("tight"))
        self.assert_status(tight, 0)
        self.assertLess(tight.history()["iterations"].sum(), float(said[1]))

    def test_refused(self):
        for solver, text in (({"spot_checks": 1.5}, "&solver spot_checks = 1.5: expected a finite real number in [0, 1]"),
                             ({"spot_checks": 0.1, "criterion": "residual"},
                              "0 unless criterion = 'velocity_error', whose estimates the checks are about")):
            with self.subTest(text):
                run = run_case(merged(SETTLING, {"solver": solver}), 1, self.here("refused"))
                self.assert_status(run, 2)
                self.assertIn(text, run.stderr)
