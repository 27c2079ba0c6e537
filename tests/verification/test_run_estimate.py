"""What a run says its other tolerances would take, against runs with these tolerances.

The band is a factor of 2 on iterations. Packings that settle and packings at rest keep to it; a packing at rest with momentum does
so between 1e-3 and 1e-4 only, where its iterations settle. What leaves the band is in doc/accuracy.md."""
import re

from gravier_runs import RunTestCase, merged, run_case, settled_disks

DISKS = {
    "scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [16, 16], "radius_min": 0.008, "radius_max": 0.012,
              "friction": 0.3, "alert_distance": 0.003},
    "time": {"step": 1e-3, "steps": 250},
    "solver": {"max_iterations": 50000},
    "output": {"directory": "results", "every": 0, "contacts": False},
}
REST = {
    "scene": {"dimension": 2, "bodies": "file", "bodies_file": "../final_bodies.h5", "friction": 0.3},
    "time": {"step": 1e-3, "steps": 20},
    "solver": {"max_iterations": 50000},
    "output": {"directory": "results", "every": 0, "contacts": False},
}


def iterations(run):
    """Of a run, and its estimates at ten times and at a tenth of the tolerance; None for what it does not know."""
    found = {"all": int(re.search(r"solves of (\d+) iterations in all", run.stdout)[1])}
    for name in ("ten times", "a tenth of"):
        number = re.search(rf"at {name} the tolerance about \S+ s, (\d+) iterations", run.stdout)
        found[name] = int(number[1]) if number else None
    return found


class Estimates(RunTestCase):

    def check(self, title, case, tolerances, **solver):
        """Estimates of runs at some tolerances, each a tenth of the one before, against each other."""
        runs = {}
        for tolerance in tolerances:
            runs[tolerance] = run_case(merged(case, {"solver": {"tolerance": tolerance, **solver}}),
                                       directory=self.here(f"{title} {tolerance}"))
            self.assert_status(runs[tolerance], 0)
        found = {tolerance: iterations(run) for tolerance, run in runs.items()}
        for loose, tight in zip(tolerances, tolerances[1:]):
            self.assertTrue(0.5 <= found[tight]["ten times"] / found[loose]["all"] <= 2.0, f"{title}: {found}")
            self.assertTrue(0.5 <= found[loose]["a tenth of"] / found[tight]["all"] <= 2.0, f"{title}: {found}")
        # what the log says is what the history has
        for tolerance, run in runs.items():
            self.assertEqual(found[tolerance]["all"], run.history()["iterations"].sum())

    def test_settling(self):
        self.check("settling", DISKS, (1e-3, 1e-4, 1e-5), acceleration="none")
        self.check("settling with momentum", DISKS, (1e-3, 1e-4, 1e-5), acceleration="momentum")

    def test_rest(self):
        settled_disks(self.scratch)
        self.check("rest", REST, (1e-3, 1e-4, 1e-5), acceleration="none")
        self.check("rest with momentum", REST, (1e-3, 1e-4), acceleration="momentum")


class Lines(RunTestCase):

    def test_lines(self):
        """Without and with the terms of the energy balance."""
        run = run_case(merged(DISKS, {"time": {"steps": 60}}), directory=self.here("plain"))
        balance = r"energy balance off by (\S+) J, of (\S+) J turned over\n"
        off, turned = re.search(balance, run.stdout).groups()
        self.assertLess(float(off), 1e-12 * float(turned))
        accuracy = re.search(r"accuracy    residual at most (\S+) at the end of a solve, tolerance (\S+); overlap at most (\S+) m", run.stdout)
        history = run.history()
        self.assertAlmostEqual(float(accuracy[1]) / history["residual"].max(), 1.0, delta=6e-3)
        self.assertEqual(float(accuracy[2]), 1e-4)
        self.assertAlmostEqual(float(accuracy[3]), history["max_overlap"].max(), delta=6e-3 * history["max_overlap"].max())
        seconds = float(re.search(r"cost        (\S+) s in 60 solves", run.stdout)[1])
        self.assertAlmostEqual(seconds, history["solve_seconds"].sum(), delta=6e-3 * seconds)
        run = run_case(merged(DISKS, {"time": {"steps": 60}, "output": {"energy": True}}), directory=self.here("energy"))
        off, turned = re.search(balance, run.stdout).groups()
        self.assertLess(float(off), 1e-12 * float(turned))

    def test_not_reached(self):
        """Solves that give up: nothing is said of a tighter tolerance, and of a looser one only if they reached that."""
        few = {"time": {"steps": 60}, "solver": {"tolerance": 1e-9, "max_iterations": 20}}
        run = run_case(merged(DISKS, few), directory=self.here("few"))
        self.assert_status(run, 3)
        failed = int((run.history()["converged"] == 0).sum())
        self.assertIn(f"at a tenth of the tolerance not known: {failed} solves did not reach the tolerance itself", run.stdout)
        self.assertRegex(run.stdout, r"at ten times the tolerance not known: \d+ solves did not reach that")
        self.assertNotIn("tolerance about", run.stdout)

    def test_free_flight(self):
        """No iterations, no estimates."""
        run = run_case(merged(DISKS, {"scene": {"lattice_count": [2, 2], "gravity": [0.0, 0.0]}, "time": {"steps": 3}}),
                       directory=self.here("flight"))
        self.assertIn("in 3 solves of 0 iterations in all\n", run.stdout)
        self.assertNotIn("estimated", run.stdout)
