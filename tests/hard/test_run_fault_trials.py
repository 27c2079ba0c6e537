"""A few trials of each fault, as the command fault_trials.py has them by the hundred."""
import os
import subprocess
import sys
import unittest

from gravier_runs import RunTestCase

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import fault_trials  # noqa: E402


class FaultTrials(RunTestCase):

    def assert_right(self, figure, trials):
        print(figure, file=sys.stderr)
        self.assertEqual(figure.trials, trials)
        self.assertEqual(figure.wrong, [])

    def test_several_at_once(self):
        self.assert_right(fault_trials.at_once(2, 2, self.here("at once")), 2)

    def test_full_disks(self):
        os.makedirs(self.here("mount"))
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8k", "gravier-test", self.here("mount")], capture_output=True, text=True,
                              check=False)
        if done.returncode != 0:
            reason = f"NOT TESTED: full disks, for want of the right to mount one: {done.stderr.strip()}"
            print(reason, file=sys.stderr)
            self.skipTest(reason)
        subprocess.run(["umount", "-l", self.here("mount")], check=True)
        # a size from all that a disk may have, and one of a small disk, for each kind
        self.assert_right(fault_trials.full_disks(2, 2, self.here("disks")), 2 * len(fault_trials.KINDS))

    def test_kills(self):
        self.assert_right(fault_trials.kills(6, 2, self.here("kills")), 6)


if __name__ == "__main__":
    unittest.main()
