"""What Run.verdict and gravier_report say of a run that was restarted: the words of all its starts count, not those of the last one alone."""
import csv
import os
import re
import subprocess
import sys
import unittest

import h5py
from gravier_runs import ENVIRONMENT, PATIENCE, PROGRAMS, SOURCE, RunTestCase, gravier, merged, namelist, run_case, write

from gravier import Run, study
from gravier.run_words import convergence, doubts, verdict

sys.path.insert(0, os.path.join(SOURCE, "drivers/report"))
from run_log import RunLog  # noqa: E402
from gravier_report import Folder, asked_section  # noqa: E402
from verdict import BAD, accurate, converged, error_ratio  # noqa: E402

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
                           (f"{HEAD}finished    *** 3 of the steps did NOT\n", "not converged"), (YES + HEAD, "not finished"), (YES + f"{HEAD}interrupted *** by SIGTERM\n", "not finished")):
            self.assertEqual(verdict(text), said, text)
        self.assertEqual(convergence(MISSED + NONE), "NO: 3 of 9 solves did not reach the accuracy")
        self.assertEqual(converged(RunLog(REFUTED + NONE), {}).grade, BAD)

    def test_doubts(self):
        """What the last words say behind their begin are doubts, of all starts, but for projections of little account; a directory may have any name."""
        begin, end = f"{HEAD}converged   yes: every solve reached the accuracy\nfinished    all 60 steps reached the accuracy", "; results in a; b, but c\n"
        for words, told in (("", ""), ("; 330 times something moved too far for the step", "330 times something moved too far for the step"),
                            ("; overlaps were projected in 98 % of them: the results are not those of the contact law; overlaps came to 2.06 of the mean radius",
                             "overlaps were projected in 98 % of the steps: the results are not those of the contact law; overlaps came to 2.06 of the mean radius"),
                            ("; overlaps were projected in 98 % of them, by 0.3 % of the paths of grains; errors and overlaps are those since the restart", ""),
                            ("; overlaps were projected in 98 % of them, by 3.2E-02 % of the paths of grains, which is too little to matter", ""),
                            (", but velocities were wrong by up to 5.29 times the velocity scale U in 20 of them; 3 grains had fallen below all boundaries",
                             "velocities were wrong by up to 5.29 times the velocity scale U in 20 of the steps; 3 grains had fallen below all boundaries")):
            said = "converged with doubts" if told else "converged"
            self.assertEqual((doubts(begin + words + end), verdict(begin + words + end)), (told, said))
            self.assertEqual((doubts(begin + words + end + NONE), verdict(begin + words + end + YES)), (told, said))
            self.assertEqual(doubts(2 * (begin + words + end)), told)
        self.assertEqual(doubts(MISSED), "")
        # a start that was interrupted has no last words
        for share, way, depth, told in ((59, "1.3E-01", "2.1E+00", "overlaps were projected in 98 % of the 60 steps before an interruption: the results are not those of the contact law; "
                                         "overlaps came to 2.1 of the mean radius"), (6, "1.3E-01", "1.0E-01", ""), (59, "9.9E-03", "1.1E-01", "overlaps came to 0.11 of the mean radius")):
            part = (f"{HEAD}overlaps    in the first step at most 0.00E+00 m, later at most 1.03E-02 m, {depth} of the mean radius\n            projected in {share} of 60 steps (98 %): "
                    f"shifts of a grain add up to 6.78E-03 m on average, {way} of its path of 5.22E-02 m\n")
            self.assertEqual(doubts(f"{part}interrupted *** at the walltime\n{YES}"), told)
            self.assertEqual(doubts(f"{part}finished    all 60 steps reached the accuracy; results in out\n"), "")

    def test_step_that_is_too_long(self):
        """Grains that fall by more than their radius in a step: the verdict, the table of a study and gravier_job tell of it, though each solve has converged."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [10, 10], "radius_min": 0.004, "radius_max": 0.006, "friction": 0.3},
                "time": {"step": 2e-2, "steps": 60}, "output": {"directory": "big", "every": 10}}
        (_, place, status), = study(case, {("scene", "seed"): [1]}, self.here("study"))
        run = Run(place / "big")
        self.assertEqual((status, run.verdict()), (0, "converged with doubts"))
        self.assertRegex(run.doubts(), r"^overlaps were projected in \d+ % of the steps: the results are not those of the contact law; .*; \d+ times something moved too far for the step$")
        with open(self.here("study/study.csv"), newline="", encoding="utf-8") as file:
            row, = csv.DictReader(file)
        self.assertEqual((row["status"], row["steps_missed"], row["doubts"]), ("0", "0", run.doubts()))
        write(self.here("big.nml"), namelist(case))
        done = subprocess.run(["sh", os.path.join(SOURCE, "drivers/jobs/gravier_job"), "big.nml"], cwd=self.scratch, capture_output=True, text=True, timeout=PATIENCE,
                              check=False, env={**os.environ, **ENVIRONMENT, "PATH": f"{PROGRAMS}:{os.environ['PATH']}", "GRAVIER_LAUNCH": "env"})
        self.assertEqual((done.returncode, done.stderr), (0, f"gravier_job: big: the results are in doubt: {run.doubts()}\n"))

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

    def test_keys_that_restarts_change(self):
        """The case of each restart is kept with its first step, the report tells what has changed, and steps are judged by the goal of their time."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
                "time": {"step": 1e-3, "steps": 60}, "solver": {"accuracy": 0.5}, "output": {"directory": "out", "every": 20, "checkpoint_every": 20}}
        fine = merged(case, {"time": {"steps": 80}, "solver": {"accuracy": 1e-3}})
        self.assert_status(run_case(case, 1, self.scratch), 0)
        for groups in (fine, fine, merged(fine, {"solver": {"accuracy": 0.2}})):
            # the last restart has no step left to make
            self.assert_status(run_case(groups, 1, self.scratch, options=["--restart"]), 0)
        run = Run(self.here("out"))
        self.assertEqual([(start.step, start.command, start.case["solver"][0]["accuracy"]) for start in run.starts],
                         [(0, "gravier case.nml", 0.5), (61, "gravier --restart case.nml", 1e-3)])
        self.assertEqual((run.case, run.input_text, run.command), (run.starts[1].case, namelist(fine), "gravier --restart case.nml"))
        self.assertEqual([run.case_at(step)["solver"][0]["accuracy"] for step in (0, 60, 61, 80)], [0.5, 0.5, 1e-3, 1e-3])
        history = run.history()
        ratio = error_ratio(history)
        self.assertTrue((ratio[history.step <= 60] > 1e-3).any(), "steps that a later goal would condemn")
        folder = Folder(self.here("out"))
        answer = accurate(folder.log, history, folder.solvers())
        self.assertEqual(answer.grade, "good", answer.text)
        self.assertTrue(answer.text.endswith("with a goal of 0.5, 0.001 from step 61 on."), answer.text)
        page = asked_section(folder)
        text = re.sub(r"<[^>]*>", " ", page[page.index("from step"):])
        self.assertEqual(text.split(), "from step group key before then 61 &amp;time steps 60 80 61 &amp;solver accuracy 0.5 0.001".split())
        with h5py.File(run.path) as file:
            self.assertEqual(list(file["run/restarts"]), ["61"])


if __name__ == "__main__":
    unittest.main()
