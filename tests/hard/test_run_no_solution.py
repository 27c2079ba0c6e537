"""Walls that close on grains: no step of that has a solution, none may count as converged, and the log says why, soon."""
import csv
import os
import re
import unittest

from closing_walls import impossible
from gravier_runs import LONG, RunTestCase, each, gravier, merged, run_case, write
from small_scenes import bodies_csv

#: methods that take their turns with the scenes, beside NLGS on one domain and NSCDD on two ranks
OTHERS = ["schwarz", "schwarz_ec", "nscdd_ep", "newton"]
#: iterations that may pass until the end of a solve without a solution; a residual of plain sweeps falls as one over their number
ENOUGH, LIMIT = 4000, 10000
#: scenes whose first steps have a solution, and how many do at most: gaps close later, or what separates from a wall comes back
LATER = {"gaps that close in the fifth step": 4, "restitution": 3}
#: scenes that Schwarz-EC solves by the residual in `./gravier test long` alone: the 10000 iterations of one cost seconds, and it has four others
DEAR = {"disks in a box, all sides close", "chain of 40"}
RESIDUAL = {"solver": {"criterion": "residual", "max_iterations": LIMIT}}


def taking_turns():
    """(name, method, ranks) of all scenes: NLGS on one domain, NSCDD, and the other methods in turn. The bits are the same on one rank and on two
    (test_run_rank_invariance.py): some are run on two, in `./gravier test long` more."""
    for number, (name, (_, groups)) in enumerate(impossible().items()):
        # the enriched methods and Newton's do not serve moments
        other = "schwarz" if "rolling_friction" in groups["scene"] else OTHERS[number % len(OTHERS)]
        yield from ((name, "nlgs", 1), (name, "nscdd", 2 if LONG or number % 4 == 0 else 1),
                    (name, other, 2 if number % (2 if LONG else 8) == 1 else 1))


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

    def assert_refused(self, run, name, enough=ENOUGH):
        """The run ends with its first step without a solution, names the reason and two bodies, and has gone on for no longer than
        it takes to see that."""
        self.assert_status(run, 3)
        self.assertRegex(run.stdout, r"\*\*\* NOT CONVERGED: .*; no solution found: loads grow without bound in step \d+")
        self.assertNotIn("stagnation", run.stdout)
        named = re.search(r"\*\*\* largest impulse: contact of bodies (\d+) and (\d+)", run.stdout)
        self.assertIsNotNone(named)
        first, second = sorted(int(number) for number in named.groups())
        grains, groups = impossible()[name]
        self.assertTrue(1 <= first < second <= len(grains) + len(groups["boundary"]) + (not groups["boundary"]))
        history = run.history()
        self.assertEqual(list(history["converged"]), [1] * (len(history["step"]) - 1) + [0])
        self.assertLessEqual(len(history["step"]) - 1, LATER.get(name, 0))
        self.assertLess(history["iterations"][-1], enough)
        self.assert_finite(history)

    def test_closing_walls(self):
        jobs = [(*job, {}) for job in taking_turns()]
        self.assertGreaterEqual(len(impossible()), 24)
        for (name, method, ranks, _), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, ranks=ranks):
                self.assert_refused(run, name)

    def test_residual(self):
        """A residual is relative to the impulses: it falls where they grow without bound, and does not see light bodies beside heavy
        ones. It must not end a solve there."""
        # NSCDD in every fourth scene and on two ranks, the others on one: the criterion is the same in all methods
        jobs = [(name, method, ranks if LONG or method == "nscdd" else 1, RESIDUAL, "residual") for name, method, ranks in taking_turns()
                if LONG or (method != "nscdd" or ranks == 2) and not (method == "schwarz_ec" and name in DEAR)]
        for (name, method, ranks, *_), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, ranks=ranks):
                self.assert_refused(run, name, LIMIT + 1)

    def test_residual_of_another_tolerance(self):
        """One that plain sweeps do not reach, and one that is reached before impulses have grown by much."""
        names = ["one disk", "chain of 40", "disks in a box, all sides close", "wedge of friction", "light chain beside heavy disks"]
        jobs = [(name, method, ranks, merged(RESIDUAL, {"solver": {"tolerance": tolerance}}), f"{tolerance}") for name in names
                for tolerance in (1e-2, 1e-6) for method, ranks in (("nlgs", 1), ("schwarz", 2))]
        for (name, method, ranks, _, tolerance), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, ranks=ranks, tolerance=tolerance):
                self.assert_refused(run, name, LIMIT + 1)

    def test_as_problems(self):
        """The same steps as files of FCLIB: no method of gravier_fclib finds a solution, and one proves that there is none, unless it
        is friction alone that holds what the walls press out."""
        def solve(name):
            step = LATER.get(name, 0) + 1
            run = self.play(name, "nlgs", 1, {"solver": {"on_failure": "continue", "max_iterations": 1000}, "time": {"steps": step},
                                              "output": {"fclib_step": step}}, "problem")
            return gravier(os.path.join("results", f"step_{step}.hdf5"), "--method", "all", "--csv", "solved.csv",
                           directory=run.directory, program="gravier_fclib")

        names = [name for name, (_, groups) in impossible().items() if "rolling_friction" not in groups["scene"]]
        for name, run in zip(names, each(solve, [(name,) for name in names])):
            with self.subTest(name):
                self.assert_status(run, 3)
                with open(run.path("solved.csv"), encoding="ascii", newline="") as file:
                    rows = list(csv.DictReader(file))
                self.assertEqual([row["verdict"] for row in rows], ["no_solution"] * len(rows), rows)
                self.assertGreater(len(rows), 1)
                self.assertEqual(max(row["proof"] for row in rows), "0" if name == "wedge of friction" else "1")

    def test_first_step_without_a_solution(self):
        """The walls reach the row within the fifth step: the four before it are right, and it is the one that is refused."""
        run = self.play("gaps that close in the fifth step", "nlgs", 1, {"output": {"every": 1}}, "first")
        self.assertEqual(list(run.history()["converged"]), [1, 1, 1, 1, 0])

    def test_steps_after_it(self):
        """A run that goes on is not told that overlaps of closing walls are a solution, nor that impulses are right which the step
        before has left."""
        jobs = [(name, method, 1, merged(more, {"solver": {"on_failure": "continue"}, "time": {"steps": 5}}), f"after {bool(more)}")
                for more in ({}, RESIDUAL) for method in ("nlgs", "nscdd")
                for name in ("chain of 3", "wedge of friction", "disks in a box, all sides close")]
        for (name, method, _, more, _), run in zip(jobs, each(self.play, jobs)):
            with self.subTest(name, method=method, more=more):
                self.assert_status(run, 3)
                self.assertEqual(list(run.history()["converged"]), [0] * 5)

    def test_walls_that_part(self):
        """The same walls with the opposite velocities, and walls that move together, have a solution."""
        for factors in ((-1.0, -1.0), (1.0, -1.0)):
            for name in ("chain of 3", "one sphere, friction 0.5, gravity"):
                boundaries = [dict(keys) for keys in impossible()[name][1]["boundary"]]
                for keys, factor in zip(boundaries, factors):
                    keys["velocity"] = [factor * v for v in keys["velocity"]]
                for more in ({}, RESIDUAL):
                    run = self.play(name, "nlgs", 1, merged(more, {"boundary": boundaries, "time": {"steps": 3}}),
                                    f"{factors} {bool(more)}")
                    with self.subTest(name, factors=factors, more=more):
                        self.assert_status(run, 0)

    def test_walls_within_the_accuracy(self):
        """Walls of a thousandth of the velocity that the user counts are no error, and their grain may be in touch with both."""
        name = "one disk, slow walls, gravity"
        self.assertIn("velocity_scale", impossible()[name][1]["solver"])
        for more in ({}, RESIDUAL):
            run = self.play(name, "nlgs", 1, merged(more, {"solver": {"velocity_scale": 0.1}, "time": {"steps": 3}}), f"slow {bool(more)}")
            with self.subTest(more=more):
                self.assert_status(run, 0)


if __name__ == "__main__":
    unittest.main()
