"""What stands still: columns side by side, a periodic tower, a bonded beam and a bonded strip that hangs, at default settings, made by drivers/studies/study_error.py.

The velocity error is a mean by mass. One column of several, or a part that sways, could move by more than what is allowed; a body that
is faster than nearly all others, which are at rest, therefore asks for a smaller error."""
import os
import pathlib
import sys
import unittest

import numpy as np

from gravier_runs import PROGRAMS, SOURCE, RunTestCase, differences, each, merged, run_case, steps_of

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
os.environ.setdefault("GRAVIER_BIN_DIR", PROGRAMS)

GRAVITY, STEP = 9.81, 1e-3
#: what nothing may move faster than, over g h
SPEED = 0.05
#: steps, subdomains, ranks of each run
RUNS = {"columns": (500, 1, 1), "columns in four subdomains": (100, 4, 1), "columns on two ranks": (100, 4, 2),
        "tower": (100, 1, 1), "beam": (60, 1, 1), "strip": (60, 1, 1)}


class Standing(RunTestCase):

    def play(self, name, steps, subdomains, ranks):
        import study_error

        make = {"columns": study_error.towers((10, 20, 40, 80, 160)), "tower": study_error.tower(10, 40),
                "beam": study_error.beam(60, 10), "strip": study_error.hanging(4, 30)}[name.split()[0]]
        directory = pathlib.Path(self.here(name))
        directory.mkdir()
        more = {"time": {"steps": steps}, "output": {"directory": "results", "every": 1, "contacts": False}}
        if subdomains > 1:
            more |= {"solver": {"method": "nscdd"}, "decomposition": {"subdomains": subdomains}}
        return run_case(merged(make(directory), more), ranks, str(directory))

    def test_nothing_moves(self):
        found = dict(zip(RUNS, each(self.play, [(name, *options) for name, options in RUNS.items()])))
        for name, run in found.items():
            with self.subTest(name):
                # a solve of the tower stagnates, and the run says so
                if name == "tower" and run.status == 3:
                    self.assertIn("NO: ", run.stdout)
                else:
                    self.assert_status(run, 0)
                results = run.results()
                fastest = max(np.linalg.norm(results[f"/steps/{step}/bodies/velocity"][:, :2], axis=1).max() for step in steps_of(results))
                self.assertLessEqual(fastest, SPEED * GRAVITY * STEP)
        one, two = (found[name].results() for name in ("columns in four subdomains", "columns on two ranks"))
        self.assertEqual(differences(one, two), [])

    def test_one_of_many(self):
        """Of 40 columns of 80 disks one has gaps of up to a tenth of g h^2 between its disks, which the others do not feel. How fast it
        sinks is estimated body by body; by the mean over all columns alone it would have 0.063 of g h on average."""
        import study_error

        steps, count, high = 150, 40, 80
        gaps = np.random.default_rng(1).random(high) * 0.1 * GRAVITY * STEP**2
        heights = study_error.DIAMETER * (0.5 + np.arange(high))
        centres = [(2.0 * study_error.DIAMETER * (1 + place), y)
                   for place in range(count) for y in (heights if place else heights + np.cumsum(gaps))]
        directory = pathlib.Path(self.here("one of many"))
        directory.mkdir()
        study_error.write_bodies(directory / "bodies.h5", np.array(centres), np.full(len(centres), 0.5 * study_error.DIAMETER))
        run = run_case(merged(study_error.case("columns"), {
            "boundary": [study_error.FLOOR], "time": {"steps": steps},
            "output": {"directory": "results", "every": 1, "contacts": False}}), 1, str(directory))
        self.assert_status(run, 0)
        results = run.results()
        late = [np.abs(results[f"/steps/{step}/bodies/velocity"]).max() for step in steps_of(results) if step > steps / 3]
        self.assertLess(np.mean(late), SPEED * GRAVITY * STEP)


if __name__ == "__main__":
    unittest.main()
