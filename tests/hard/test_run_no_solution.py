"""Walls that close on grains: no step of that has a solution, none may count as converged, and the log says why, soon."""
import os
import re
import unittest

from closing_walls import impossible
from gravier_runs import LONG, RunTestCase, each, merged, run_case, write
from small_scenes import bodies_csv

#: methods that take their turns with the scenes, beside NLGS on one domain and NSCDD on two ranks
OTHERS = ["schwarz", "schwarz_ec", "nscdd_ep", "newton"]
#: iterations that may pass until the end of a solve without a solution
ENOUGH = 4000


class NoSolution(RunTestCase):

    def play(self, name, method, ranks, more, title=""):
        grains, groups = impossible()[name]
        directory = self.here(f"{title} {name} {method} {ranks}")
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies_csv(grains))
        groups = merged(groups, {"solver": {"method": method, "on_failure": "stop"}}, more)
        if method == "nlgs":
            groups["decomposition"]["subdomains"] = 1
        return run_case(groups, ranks, directory)

    def assert_refused(self, run, n_bodies):
        """The run ends with its first step without a solution, names the reason and two bodies, and has gone on for no longer than
        it takes to see that."""
        self.assert_status(run, 3)
        self.assertRegex(run.stdout, r"\*\*\* NOT CONVERGED: .*; no solution found: loads grow without bound in step \d+")
        self.assertNotIn("stagnation", run.stdout)
        named = re.search(r"\*\*\* largest impulse: contact of bodies (\d+) and (\d+)", run.stdout)
        self.assertIsNotNone(named)
        first, second = sorted(int(number) for number in named.groups())
        self.assertTrue(1 <= first < second <= n_bodies)
        history = run.history()
        self.assertEqual(history["converged"][-1], 0)
        self.assertLess(history["iterations"][-1], ENOUGH)
        self.assert_finite(history)

    def test_closing_walls(self):
        jobs = []
        for number, (name, (_, groups)) in enumerate(impossible().items()):
            # the enriched methods and Newton's do not serve moments
            other = "schwarz" if "rolling_friction" in groups["scene"] else OTHERS[number % len(OTHERS)]
            # the bits are the same on one rank and on two (test_run_rank_invariance.py): some are run on two, in `./gravier test long` more
            jobs += [(name, "nlgs", 1, {}), (name, "nscdd", 2 if LONG or number % 4 == 0 else 1, {}),
                     (name, other, 2 if number % (2 if LONG else 8) == 1 else 1, {})]
        for (name, method, ranks, _), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, ranks=ranks):
                grains, groups = impossible()[name]
                self.assert_refused(run, len(grains) + len(groups["boundary"]))

    def test_residual(self):
        """A residual is relative to the impulses: it falls where they grow without bound, and must not end a solve there."""
        names = ["one disk", "one sphere", "chain of 3", "chain of 10", "chain, masses over five decades", "disks in a box, sides close",
                 "gaps that close within the first step"]
        jobs = [(name, method, ranks, {"solver": {"criterion": "residual"}}, "residual") for name in names
                for method, ranks in (("nlgs", 1), ("nscdd", 2))]
        for (name, method, ranks, *_), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, ranks=ranks):
                self.assert_status(run, 3)
                self.assertIn("NOT CONVERGED: impulses exceed what any loads can cause", run.stdout)
                self.assertIn("no solution found: loads grow without bound in step", run.stdout)
                self.assertEqual(run.history()["converged"][-1], 0)

    def test_first_step_without_a_solution(self):
        """The walls reach the row within the fifth step: the four before it are right, and it is the one that is refused."""
        run = self.play("gaps that close in the fifth step", "nlgs", 1, {"output": {"every": 1}}, "first")
        self.assertEqual(list(run.history()["converged"]), [1, 1, 1, 1, 0])

    def test_steps_after_it(self):
        """A run that goes on is not told that overlaps of closing walls are a solution."""
        for method in ("nlgs", "nscdd"):
            run = self.play("chain of 3", method, 1, {"solver": {"on_failure": "continue"}, "time": {"steps": 5}}, "after")
            with self.subTest(method):
                self.assert_status(run, 3)
                self.assertEqual(list(run.history()["converged"]), [0] * 5)

    def test_walls_that_part(self):
        """The same walls with the opposite velocities, and walls that move together, have a solution."""
        for factors in ((-1.0, -1.0), (1.0, -1.0)):
            for name in ("chain of 3", "one sphere, friction 0.5, gravity"):
                boundaries = [dict(keys) for keys in impossible()[name][1]["boundary"]]
                for keys, factor in zip(boundaries, factors):
                    keys["velocity"] = [factor * v for v in keys["velocity"]]
                run = self.play(name, "nlgs", 1, {"boundary": boundaries, "time": {"steps": 3}}, f"{factors}")
                with self.subTest(name, factors=factors):
                    self.assert_status(run, 0)


if __name__ == "__main__":
    unittest.main()
