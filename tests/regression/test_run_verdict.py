"""What Run.verdict and gravier_report say of a run that was restarted: the words of all its starts count, not those of the last one alone."""
import os
import sys
import unittest

from gravier_runs import SOURCE, RunTestCase, gravier, run_case

from gravier import Run
from gravier.run_words import convergence, verdict

sys.path.insert(0, os.path.join(SOURCE, "drivers/report"))
from run_log import RunLog  # noqa: E402
from verdict import BAD, converged  # noqa: E402

HEAD = "Gravier 0.1.0 (a), dense\n"
YES = f"{HEAD}converged   yes: every solve reached the accuracy\nfinished    all 9 steps reached the accuracy\n"
NONE = f"{HEAD}finished    no step was left to make after step 9\n"
MISSED = f"{HEAD}converged   NO: 3 of 9 solves did not reach the accuracy\nfinished    *** 3 of the steps did NOT\n"
REFUTED = f"{HEAD}converged   NO: 3 of 9 solves that spot checks continued were off\nfinished    *** 3 of 9 solves that spot checks\n"
ONLY = f"{HEAD}converged   only by the residual: every solve reached the tolerance\nfinished    every solve reached the residual\n"


class Verdict(RunTestCase):

    def test_of_all_starts(self):
        for text, said in ((HEAD, "not finished"), (YES, "converged"), (NONE, "converged"), (YES + NONE, "converged"), (MISSED, "not converged"),
                           # steps that were made anew are no longer counted
                           (MISSED + YES, "converged"), (REFUTED + YES, "not converged"), (REFUTED + NONE, "not converged"),
                           (MISSED + f"{HEAD}finished    *** 3 of the steps did NOT\n", "not converged"), (ONLY + NONE, "converged only by"),
                           (ONLY + YES, "converged only by"), (YES + ONLY, "converged only by"), (ONLY + MISSED, "not converged"),
                           (YES + HEAD, "not finished"), (YES + f"{HEAD}interrupted *** by SIGTERM\n", "not finished")):
            self.assertEqual(verdict(text), said, text)
        self.assertEqual(convergence(MISSED + NONE), "NO: 3 of 9 solves did not reach the accuracy")
        self.assertEqual(converged(RunLog(REFUTED + NONE), {}).grade, BAD)

    def test_no_step_left(self):
        """A run that did not converge has not converged after a restart that had no step left to make."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
                "time": {"step": 1e-3, "steps": 60}, "solver": {"max_iterations": 3, "fallback": "none"},
                "output": {"directory": "bad", "checkpoint_every": 60}}
        self.assert_status(run_case(case, 1, self.scratch), 3)
        run = Run(self.here("bad"))
        self.assertEqual(run.verdict(), "not converged")
        again = gravier("--restart", "case.nml", directory=self.scratch)
        self.assert_status(again, 3)
        self.assertNotIn("\nconverged ", again.stdout)
        self.assertEqual(run.verdict(), "not converged")


if __name__ == "__main__":
    unittest.main()
