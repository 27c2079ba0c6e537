"""A few trials of each fault, more of them in `./gravier test long`, as the command fault_trials.py has them by the hundred."""
import os
import subprocess
import sys
import unittest
import unittest.mock

import matplotlib.pyplot  # noqa: F401

import forked_scripts
from gravier_runs import LONG, RunTestCase

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fault_trials  # noqa: E402


class FaultTrials(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        server = forked_scripts.Server(cls.scratch)
        cls.addClassCleanup(server.stop)
        # figures that programs draw, in a copy of this one; scripts of Gravier are started each by itself
        instead = unittest.mock.patch.dict(os.environ, {"GRAVIER_PYTHON": server.interpreter(os.path.join(cls.scratch, "python3"))})
        instead.start()
        cls.addClassCleanup(instead.stop)

    def assert_right(self, figure, trials):
        print(figure, file=sys.stderr)
        self.assertEqual(figure.trials, trials)
        self.assertEqual(figure.wrong, [])

    def test_several_at_once(self):
        """Two that come to their end, and in `./gravier test long` three that go on until their time is over (test_run_two_at_once.py has
        such a run too)."""
        trials = 2 if LONG else 1
        self.assert_right(fault_trials.at_once(2, trials, self.here("at once")), trials)

    def test_full_disks(self):
        os.makedirs(self.here("mount"))
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8k", "gravier-test", self.here("mount")], capture_output=True, text=True,
                              check=False)
        if done.returncode != 0:
            reason = f"NOT TESTED: full disks, for want of the right to mount one: {done.stderr.strip()}"
            print(reason, file=sys.stderr)
            self.skipTest(reason)
        subprocess.run(["umount", "-l", self.here("mount")], check=True)
        # a size from all that a disk may have, or one of a small disk, by turns, for each kind; both in `./gravier test long`
        for first in (0, 1):
            kinds = fault_trials.KINDS[first::2]
            self.assert_right(fault_trials.full_disks(2, 1, self.here(f"disks {first}"), kinds, first), len(kinds))
            if LONG:
                kinds = fault_trials.KINDS[1 - first::2]
                self.assert_right(fault_trials.full_disks(2, 1, self.here(f"more disks {first}"), kinds, first), len(kinds))

    def test_kills(self):
        ranks = (1, 2, 4) if LONG else (1, 2)
        self.assert_right(fault_trials.kills(6, 2, self.here("kills"), ranks), 2 * len(ranks))


if __name__ == "__main__":
    unittest.main()
