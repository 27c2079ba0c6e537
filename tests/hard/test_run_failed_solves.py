"""Solves that diverge or give up: noticed, said aloud, exit status 3, and nothing in the results that is not a result."""
import os
import re
import unittest

import numpy as np

from gravier_runs import RunTestCase, differences, each, how_often, merged, run_case, steps_of, write
from packings import settled_disks

# the packing 0.25 s after its start, dense and still moving: a step of it takes work
DIVERGING = {
    "schwarz": {"solver": {"method": "schwarz", "sweeps": 10, "relaxation": 1.0}, "decomposition": {"subdomains": 16}},
    "schwarz, many sweeps": {"solver": {"method": "schwarz", "sweeps": 50, "relaxation": 1.0}, "decomposition": {"subdomains": 16}},
    # the safeguard brings it down to Schwarz, which diverges too
    "schwarz_ec": {"solver": {"method": "schwarz_ec", "sweeps": 50, "relaxation": 1.0}, "decomposition": {"subdomains": 16},
                   "enriched": {"direction": 1.0, "contacts": "active"}},
}


class FailedSolves(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        packing = settled_disks(cls.scratch, steps=250, count=(18, 16))
        cls.case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": packing, "friction": 0.3},
            "time": {"step": 1e-3, "steps": 3},
            "solver": {"criterion": "residual", "tolerance": 1e-8, "max_iterations": 5000, "warm_start": False},
            "output": {"directory": "results", "trace": True},
        }

    def test_slow_solves_go_on(self):
        """A wall pushes a row of 100 disks. As long as the residual falls to its small tolerance, the velocity error is not known, and yet
        something is gained."""
        row = "id,x,y,radius,mass\n" + "".join(f"{k + 1},{0.01 + 0.02 * k!r},0,0.01,1\n" for k in range(100))
        case = {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": write(self.here("row.csv"), row), "gravity": [0.0, 0.0]},
            "boundary": [{"name": "wall", "shape": "plane", "normal": [1, 0], "velocity": [0.1, 0.0]}],
            "time": {"step": 1e-3, "steps": 1},
            "solver": {"accuracy": 1e-4, "tolerance": 1e-6, "max_iterations": 20000},
            "output": {"directory": "results", "every": 1},
        }
        run = run_case(case, directory=self.here("row"))
        self.assert_status(run, 0)
        self.assertLess(np.abs(run.results()["/steps/1/bodies/velocity"][:, 0] - 0.1).max(), 1e-4 * 0.1)
        # and one that is cut off names a figure
        run = run_case(merged(case, {"solver": {"max_iterations": 100}}), directory=self.here("cut"))
        self.assert_status(run, 3)
        worst = re.search(r"did not reach the accuracy 1.00E-04; at worst (\S+)(?: in the strictest of its conditions)?;", run.stdout)
        self.assertLess(float(worst.group(1)), 10.0)

    def assert_clean(self, run):
        """No NaN, no infinity, no unbelievable speed in any file."""
        results = run.results()
        self.assert_finite(results)
        for step in steps_of(results):
            self.assertLess(np.abs(results[f"/steps/{step}/bodies/velocity"][:, :2]).max(), 10.0)
        self.assert_finite(run.history())
        with open(run.path("results", "history.csv"), encoding="ascii") as file:
            text = file.read().lower()
        self.assertNotIn("nan", text)
        self.assertNotIn("inf", text)
        return results

    def assert_loud(self, run, words):
        self.assert_status(run, 3)
        with open(run.path("results", "run.log"), encoding="utf-8") as file:
            log = file.read()
        for text in (run.stdout, log):
            self.assertRegex(text, r"\*\*\* " + words)
            self.assertRegex(text, r"finished +\*\*\* \d+ of the steps did NOT reach the (accuracy|tolerance)")

    def test_divergence_is_noticed(self):
        """A step that diverged is never kept, whatever on_failure says, and ends the run."""
        jobs = [(title, choice, ranks) for k, title in enumerate(DIVERGING)
                for choice, ranks in (("continue", 1), ("stop", 2), ("discard", 2))[k % 2:k % 2 + 2]]
        jobs.append(("schwarz", "continue", 2))
        runs = each(lambda title, choice, ranks: run_case(
            merged(self.case, DIVERGING[title], {"solver": {"on_failure": choice}}), ranks,
            self.here(f"{title} {choice} {ranks}")), jobs)
        for (title, choice, ranks), run in zip(jobs, runs):
            with self.subTest(title, on_failure=choice, ranks=ranks):
                self.assert_loud(run, r"DIVERGED: step 1 after \d+ iterations of " + title.split(",")[0])
                self.assertIn("the last one is not in the results", run.stdout)
                # the start, and nothing of the step that diverged
                self.assertEqual(steps_of(self.assert_clean(run)), [0])
                self.assertEqual(len(run.history()["step"]), 0)

    def test_divergence_is_noticed_soon(self):
        """At most 20 iterations from the first check at which the residual is above that of the start to the stop, with checks at
        each iteration and at each tenth."""
        for every in (1, 10):
            for title in DIVERGING:
                with self.subTest(title, check_every=every):
                    case = merged(self.case, DIVERGING[title], {"solver": {"check_every": every}, "time": {"steps": 1}})
                    run = run_case(case, 1, self.here(f"soon {title} {every}"))
                    self.assert_loud(run, "DIVERGED")
                    end = int(re.search(r"DIVERGED: step 1 after (\d+) iterations", run.stdout).group(1))
                    # the way there, of which a step that diverged leaves nothing
                    run = run_case(merged(case, {"solver": {"max_iterations": end - every}}), 1, self.here(f"way {title} {every}"))
                    trace = run.trace()
                    onset = trace["iteration"][trace["residual"] > trace["residual"][0]][0]
                    self.assertLessEqual(end - onset, 20)

    def test_recoveries_are_said(self):
        """Where relaxation is lowered, or momentum suspended, the log says so in the step, counts it and sums it up at the end."""
        alone = {"time": {"steps": 1}}
        run = run_case(merged(self.case, DIVERGING["schwarz"], alone, {"solver": {"relaxation": None, "max_iterations": 60}}), 2,
                       self.here("relaxation"))
        self.assertNotIn("DIVERGED", run.stdout)
        self.assertRegex(run.stdout, r"warning +the changes of the neighbours' impulses alternate in sign and do not fall: relaxation factor "
                                     r"lowered (once|twice|\d+ times) in step 1")
        times, least = re.search(r"\nrelaxation +factor lowered (.+), to no less than (\S+)", run.stdout).groups()
        times = how_often(times)
        self.assertAlmostEqual(float(least), max(0.8 ** times, 0.25), places=2)
        self.assertIn(f"relaxation factors lowered {times}", run.stdout)
        # a body of 10^6 times the mass on a light one
        write(self.here("heavy.csv"), "id,x,y,radius,mass\n1,0,1,1,1\n2,0,3,1,1e6\n")
        run = run_case(merged(self.case, alone, {
            "scene": {"bodies_file": self.here("heavy.csv")}, "boundary": {"shape": "plane", "normal": [0.0, 1.0]},
            "solver": {"method": "nlgs", "max_iterations": 1000}}), 1, self.here("momentum"))
        # after 200 iterations without progress, and three starts anew of as many
        self.assertRegex(run.stdout, r"warning +accelerated sweeps make no progress: Nesterov momentum suspended once in step 1")
        restarts, suspended = re.search(r"\nnesterov +(\d+) restarts and (\d+) suspensions? of the momentum\n", run.stdout).groups()
        self.assertGreaterEqual(int(restarts), 3)
        self.assertEqual(suspended, "1")
        self.assertRegex(run.stdout, r"\nwarnings .*Nesterov momentum suspended 1")

    def test_divergence_after_good_steps(self):
        """A method that diverges only when the grains have met the ground: the steps before stay, whole and right."""
        case = merged(self.case, {"solver": {"method": "schwarz", "sweeps": 10, "relaxation": 1.0, "tolerance": 3e-2},
                                  "decomposition": {"subdomains": 16},
                                  "scene": {"bodies": "lattice", "bodies_file": None, "lattice_count": [20, 10],
                                            "radius_min": 0.008, "radius_max": 0.012},
                                  "time": {"steps": 200}, "output": {"every": 3, "final_bodies": True}})
        run = run_case(case, 2, self.here("late"))
        self.assert_loud(run, "DIVERGED")
        results = self.assert_clean(run)
        history = run.history()
        last = int(history["step"][-1])
        self.assertGreater(last, 5)
        self.assertLess(last, 200)
        # states are due every third step; the last good one is gone when it was not due
        self.assertEqual(steps_of(results), list(range(0, last + 1, 3)))
        self.assertTrue(np.all(history["converged"] == 1))
        self.assertFalse(os.path.exists(run.path("results", "final_bodies.h5")))
        # as a run that ends before
        short = run_case(merged(case, {"time": {"steps": last}, "output": {"final_bodies": False}}), 1, self.here("short"))
        self.assert_status(short, 0)
        written = {name: value for name, value in short.results().items() if not name.startswith("/run") and
                   (not name.startswith("/steps/") or int(name.split("/")[2].split("@")[0]) % 3 == 0)}
        self.assertEqual(differences(written, {name: value for name, value in results.items() if not name.startswith("/run")}), [])

    def test_momentum_against_contacts(self):
        """A tower whose light bottom bears what is heavy two contacts above: the residual is low while the heavy body falls, and the
        velocity error says so, whatever the subdomains and ranks."""
        write(self.here("tower.csv"), "id,x,y,radius,mass\n1,0,1,1,1\n2,0,3,1,1e2\n3,0,5,1,1e4\n")
        case = merged(self.case, {"scene": {"bodies_file": self.here("tower.csv"), "friction": 0.0}, "time": {"steps": 1},
                                  "boundary": {"shape": "plane", "normal": [0.0, 1.0]},
                                  "solver": {"method": "nscdd", "acceleration": "none", "criterion": "velocity_error", "tolerance": 2e-2,
                                             "max_iterations": 200}})
        for subdomains, ranks in ((1, 1), (3, 1), (3, 2)):
            with self.subTest(subdomains=subdomains, ranks=ranks):
                run = run_case(merged(case, {"decomposition": {"grid": [1, subdomains], "subdomains": subdomains}}), ranks,
                               self.here(f"tower {subdomains} {ranks}"))
                self.assert_loud(run, r"NOT CONVERGED: velocity error 9\.\d\dE-0?03 m/s above 1\.00E-0?01 of 9\.81E-0?03 m/s")
                self.assertLess(run.history()["residual"][0], 2e-2)

    def test_giving_up(self):
        """Three iterations do not do: the run goes on, stops with the step, or stops without it."""
        case = merged(self.case, {"solver": {"method": "nscdd", "max_iterations": 3}, "decomposition": {"subdomains": 4},
                                  "output": {"final_bodies": True}})
        for choice, steps in (("continue", [0, 1, 2, 3]), ("stop", [0, 1]), ("discard", [0])):
            for ranks in (1, 2):
                with self.subTest(choice, ranks=ranks):
                    run = run_case(merged(case, {"solver": {"on_failure": choice}}), ranks, self.here(f"{choice} {ranks}"))
                    self.assert_loud(run, r"NOT CONVERGED: residual \S+ above the tolerance 1.00E-0?08 after 3 iterations of nscdd")
                    self.assertEqual(run.stdout.count("NOT CONVERGED"), max(len(steps) - 1, 1))
                    self.assertEqual(steps_of(self.assert_clean(run)), steps)
                    history = run.history()
                    self.assertEqual(list(history["step"]), steps[1:])
                    self.assertTrue(np.all(history["converged"] == 0))
                    self.assertTrue(np.all(history["iterations"] == 3))
                    self.assertTrue(np.all(history["residual"] > 1e-8))
                    self.assertEqual("the last one is not in the results" in run.stdout, choice == "discard")
                    self.assertEqual(os.path.exists(run.path("results", "final_bodies.h5")), choice != "discard")

    def test_giving_up_and_converging(self):
        """Some steps give up, others do not: history tells which, and the exit status is 3."""
        case = merged(self.case, {"solver": {"method": "nlgs", "acceleration": "none", "tolerance": 1e-3, "max_iterations": 60,
                                             "warm_start": True},
                                  "time": {"steps": 12}, "output": {"every": 0}})
        run = run_case(case, 1, self.here("some"))
        self.assert_loud(run, "NOT CONVERGED")
        history = run.history()
        self.assertEqual(set(history["converged"]), {0.0, 1.0})
        self.assertTrue(np.array_equal(history["converged"] == 1, history["residual"] <= 1e-3))
        self.assertIn(f"{int((history['converged'] == 0).sum())} of the steps did NOT", run.stdout)
        self.assertEqual(steps_of(self.assert_clean(run)), [12])

    def test_oscillation_is_not_convergence(self):
        """Plain Schwarz with several sweeps oscillates on some partitions, neither growing nor settling."""
        case = merged(self.case, {"solver": {"method": "schwarz", "sweeps": 3, "relaxation": 1.0, "max_iterations": 1000,
                                             "on_failure": "discard"},
                                  "scene": {"friction": 0.1}, "decomposition": {"subdomains": 16, "kind": "primal"}})
        run = run_case(case, 2, self.here("oscillation"))
        self.assert_loud(run, "(NOT CONVERGED|DIVERGED)")
        self.assertEqual(steps_of(self.assert_clean(run)), [0])

    def test_speeds_beyond_numbers(self):
        """A plane that turns half way round in a step throws a grain ever farther, until squares of speeds overflow: in the solve,
        or for a light grain in its kinetic energy, first. The run ends with an error or a divergence, and no result is other
        than a number."""
        bodies = "id,x,y,radius,mass\n1,1,1,1,{0}\n2,30,1,1,{0}\n"
        # the plane has the identifier that follows on those of the bodies
        for mass, status, words in (
                ("1", 3, r"DIVERGED: step \d+ (.|\n)*contact of bodies 1 and 3: an impulse or a velocity whose square is not a finite"),
                ("1e-30", 4, r"step \d+: kinetic energy of body 1: not a finite number")):
            for ranks in (1, 2):
                with self.subTest(mass, ranks=ranks):
                    directory = self.here(f"overflow {mass} {ranks}")
                    os.makedirs(directory)
                    write(os.path.join(directory, "bodies.csv"), bodies.format(mass))
                    run = run_case({
                        "scene": {"bodies": "file", "bodies_file": "bodies.csv", "gravity": [0.0, 0.0]},
                        "boundary": {"shape": "plane", "normal": [0.0, 1.0], "rotation": 1.7},
                        "time": {"step": 1e3, "steps": 2000},
                        "output": {"directory": "results", "every": 0, "energy": True},
                    }, ranks, directory)
                    self.assert_status(run, status)
                    self.assertRegex(run.stdout + run.stderr, words)
                    self.assert_finite(run.results())
                    self.assert_finite(run.history())


if __name__ == "__main__":
    unittest.main()
