"""What a run says other goals of its solves would take, against runs with these goals.

The intervals are wide: a solve shows one decade of its descent, and says between which numbers of iterations the next one lies. How
often they hold is in doc/accuracy.md."""
import os
import re

from gravier_runs import SOURCE, RunTestCase, merged, run_case
from packings import settled_disks

from gravier import parse_namelist

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


def iterations(run, goal):
    """Of a run, and the ends of its estimates at ten times and at a tenth of the goal; None for what it does not know."""
    found = {"all": int(re.search(r"solves? with (\d+) iterations? in all", run.stdout)[1]), "ten times": None, "a tenth of": None}
    for name, line in zip(("ten times", "a tenth of"), re.findall(rf"\n +at {goal} \S+: (.*)", run.stdout)):
        ends = re.match(r"(\d+) to (\d+) iterations, (\S+) to (\S+) s \(estimated\)", line)
        found[name] = (int(ends[1]), int(ends[2])) if ends else None
    return found


class Estimates(RunTestCase):

    def setUp(self):
        self.held = []

    def assert_most_hold(self):
        """An interval is an extrapolation: one in five may fail."""
        self.assertGreaterEqual(sum(self.held), 0.8 * len(self.held), self.held)

    def check(self, title, case, goals, known, **solver):
        """Intervals of runs with some goals, each a tenth of the one before, against the iterations of the others: `known` of them are
        known at least. Whether each one holds is noted."""
        runs = {}
        for goal in goals:
            keys = {"accuracy": goal, "tolerance": 0.1 * goal} if "criterion" not in solver else {"tolerance": goal}
            runs[goal] = run_case(merged(case, {"solver": {**keys, **solver}}), directory=self.here(f"{title} {goal}"))
            self.assertIn(runs[goal].status, (0, 3), str(runs[goal]))
        found = {goal: iterations(run, "tolerance" if "criterion" in solver else "accuracy") for goal, run in runs.items()}
        count = 0
        for loose, tight in zip(goals, goals[1:]):
            for ends, actual in ((found[tight]["ten times"], found[loose]["all"]), (found[loose]["a tenth of"], found[tight]["all"])):
                # an interval holds if solves get there
                if ends is None or runs[loose].status + runs[tight].status > 0:
                    continue
                count += 1
                self.held.append(ends[0] <= actual <= ends[1])
        self.assertGreaterEqual(count, known, f"{title}: {found}")
        # what the log says is what the history has
        for goal, run in runs.items():
            self.assertEqual(found[goal]["all"], run.history()["iterations"].sum())

    def test_settling(self):
        for acceleration in ("none", "momentum"):
            self.check(f"settling {acceleration}", DISKS, (1e-3, 1e-4), 2, acceleration=acceleration, criterion="residual")
            # to an accuracy of 1.0 solves of eight iterations have two checks, which do not show how errors decrease
            self.check(f"settling {acceleration} velocity", DISKS, (0.5, 0.05), 0 if acceleration == "none" else 2, acceleration=acceleration,
                       spot_checks=0.0)
        self.assert_most_hold()

    def test_rest(self):
        settled_disks(self.scratch)
        for acceleration in ("none", "momentum"):
            self.check(f"rest {acceleration}", REST, (1e-2, 1e-3, 1e-4), 3, acceleration=acceleration, criterion="residual")
            self.check(f"rest {acceleration} velocity", REST, (1.0, 0.1), 0 if acceleration == "none" else 1, acceleration=acceleration,
                       spot_checks=0.0)
        self.assert_most_hold()

    def test_shear(self):
        """Where errors fall fast, most solves show nothing of a decade: that is said, and no number."""
        with open(os.path.join(SOURCE, "data/scenes/shear.nml"), encoding="utf-8") as file:
            case = parse_namelist(file.read())
        case["scene"][0]["bodies_file"] = os.path.join(SOURCE, case["scene"][0]["bodies_file"])
        case = {group: keys if group == "boundary" else keys[0] for group, keys in case.items()}
        case = merged(case, {"time": {"steps": 30}, "output": {"directory": "results", "every": 0}})
        self.check("shear", case, (1.0, 0.1), 1, acceleration="none", spot_checks=0.0)
        self.assert_most_hold()
        run = run_case(merged(case, {"solver": {"accuracy": 0.1, "tolerance": 0.01, "acceleration": "none"}}), directory=self.here("fast"))
        self.assertIn("at accuracy 1.00E-02: not known: the solves ended too soon to show how errors decrease\n", run.stdout)


class Lines(RunTestCase):

    def test_lines(self):
        """Without and with the terms of the energy balance."""
        run = run_case(merged(DISKS, {"time": {"steps": 60}, "solver": {"criterion": "residual"}}), directory=self.here("plain"))
        balance = r"energy +balance off by (\S+) J; the sizes of its terms sum up to (\S+) J\n"
        off, turned = re.search(balance, run.stdout).groups()
        self.assertLess(float(off), 1e-12 * float(turned))
        accuracy = re.search(r"accuracy    residual at most (\S+) at the end of a solve, tolerance ([^ ;]+); "
                             r"velocity error at most (\S+) of U\n", run.stdout)
        history = run.history()
        self.assertAlmostEqual(float(accuracy[1]) / history["residual"].max(), 1.0, delta=6e-3)
        self.assertEqual(float(accuracy[2]), 1e-4)
        worst = (history["velocity_error"] / history["velocity_scale"]).max()
        self.assertAlmostEqual(float(accuracy[3]), worst, delta=6e-3 * worst)
        start, later = re.search(r"\noverlaps    in the first step at most (\S+) m, later at most (\S+) m, ", run.stdout).groups()
        self.assertAlmostEqual(float(start), history["max_overlap"][0], delta=6e-3 * history["max_overlap"][0])
        self.assertAlmostEqual(float(later), history["max_overlap"][1:].max(), delta=6e-3 * history["max_overlap"][1:].max())
        seconds = float(re.search(r"cost        (\S+) s in 60 solves", run.stdout)[1])
        self.assertAlmostEqual(seconds, history["solve_seconds"].sum(), delta=6e-3 * seconds)
        run = run_case(merged(DISKS, {"time": {"steps": 60}, "output": {"energy": True}}), directory=self.here("energy"))
        off, turned = re.search(balance, run.stdout).groups()
        self.assertLess(float(off), 1e-12 * float(turned))

    def test_not_reached(self):
        """Solves that give up: nothing is said of a tighter tolerance, and of a looser one only if they reached that."""
        few = {"time": {"steps": 60}, "solver": {"criterion": "residual", "tolerance": 1e-9, "max_iterations": 20}}
        run = run_case(merged(DISKS, few), directory=self.here("few"))
        self.assert_status(run, 3)
        failed = int((run.history()["converged"] == 0).sum())
        self.assertIn(f"at tolerance 1.00E-10: not known: {failed} solves did not reach the tolerance itself", run.stdout)
        self.assertRegex(run.stdout, r"at tolerance 1\.00E-08: not known: \d+ solves? did not reach it")
        self.assertNotIn("(estimated)", run.stdout)

    def test_free_flight(self):
        """No iterations, no estimates."""
        run = run_case(merged(DISKS, {"scene": {"lattice_count": [2, 2], "gravity": [0.0, 0.0]}, "time": {"steps": 3}}),
                       directory=self.here("flight"))
        self.assertIn("in 3 solves with 0 iterations in all\n", run.stdout)
        self.assertNotIn("estimated", run.stdout)
