"""A few bits of each kind of file that become others, as the command bit_flips.py has them by the hundred."""
import os
import sys
import unittest

from gravier_runs import RunTestCase

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bit_flips  # noqa: E402


class BitFlips(RunTestCase):

    def test_all_kinds(self):
        for figure in bit_flips.bit_flips(2, 10, self.here("flips")):
            print(figure, file=sys.stderr)
            self.assertEqual(figure.trials, 10)
            self.assertEqual(figure.wrong, [])


if __name__ == "__main__":
    unittest.main()
