"""All hard cases by a selection of methods: NSCDD, every fourth case on two ranks (the bits are the same, test_run_rank_invariance.py), and
one of the other methods in turn on one. In `./gravier test long` NSCDD is on two ranks but where steps are many or solves slow. Methods
whose iterations are dear make a few steps, in which what is thrown meets. The table of all methods is drivers/studies/study_hard.py."""
import unittest

import numpy as np

from gravier_runs import LONG, RunTestCase, differences, each
from hard_cases import BASE, METHODS, cases, disagreement, methods_of, play, units

CASES = cases()
OTHERS = [title for title in METHODS if title != "nscdd"]
DEAR_STEPS = 8


def selection(number, case):
    """(title, groups, ranks) of the runs of a case."""
    if case.methods:
        # some on two ranks, of each method
        return [(title, groups, 2 if k % 5 == 0 else 1) for k, (title, groups) in enumerate(case.methods.items())]
    ranks = 1 if case.slow or case.steps >= 100 or not (LONG or number % 4 == 0) else 2
    return [(title, METHODS[title], ranks) for title, ranks in (("nscdd", ranks), (OTHERS[number % len(OTHERS)], 1))]


class HardCases(RunTestCase):
    #: runs of cases by the name of the case, the method and the number of ranks
    played = {}

    def run_once(self, case, title, groups, ranks):
        key = case.name, title, ranks
        if key not in self.played:
            self.played[key] = play(case, title, groups, ranks, self.here(f"{list(CASES).index(case.name)} {title} {ranks}"), dear_steps=DEAR_STEPS)
        return self.played[key]

    def play(self, number, case):
        runs = [self.run_once(case, title, groups, ranks) for title, groups, ranks in selection(number, case)]
        wrong = [f"{run.method}: {words}" for run in runs for words in run.complaints()]
        return wrong + [words for run in runs[1:] for words in disagreement(runs[0], run)]

    def check_cases(self, quarter):
        """Every fourth of the cases."""
        chosen = [(number, case) for number, case in enumerate(CASES.values()) if number % 4 == quarter]
        self.assertGreater(len(chosen), 5)
        for (_, case), wrong in zip(chosen, each(self.play, chosen)):
            with self.subTest(case.name):
                self.assertEqual(wrong, [])

    def test_first_quarter(self):
        self.check_cases(0)

    def test_second_quarter(self):
        self.check_cases(1)

    def test_third_quarter(self):
        self.check_cases(2)

    def test_last_quarter(self):
        self.check_cases(3)

    def test_no_direction_is_nscdd(self):
        """l = 0 is NSCDD, bit for bit."""
        case = CASES["no direction"]
        first, *others = [self.run_once(case, title, groups, 1).run.results() for title, groups in case.methods.items()]
        for other in others:
            self.assertEqual([name for name in differences(first, other) if not name.startswith("/run")], [])

    def test_units(self):
        """Units that are powers of two change no digit (large lengths do, since the norm2 of gfortran rounds otherwise above 1);
        a mirrored or turned scene has the same velocities."""
        for title in ("nlgs", "nscdd, accelerated"):
            base = play(BASE, title, METHODS[title], 1, self.here(f"base {title}")).record
            for case in units():
                with self.subTest(case.name, method=title):
                    record = self.run_once(case, title, METHODS[title], 1).record
                    scale = case.change
                    wanted = base.velocity @ scale.turn.T * (scale.length / scale.time)
                    spin = base.spin * np.linalg.det(scale.turn) / scale.time
                    if np.array_equal(scale.turn, np.eye(2)) and scale.length <= 1.0:
                        self.assertTrue(np.array_equal(record.velocity, wanted) and np.array_equal(record.spin, spin))
                    else:
                        self.assertLess(np.abs(record.velocity - wanted).max(), case.agree * np.abs(wanted).max())


class Suite(unittest.TestCase):

    def test_every_method_is_in_turn(self):
        """Each method is run by some case."""
        run = {title for number, case in enumerate(CASES.values()) for title, _, _ in selection(number, case)}
        self.assertLessEqual(set(METHODS), run)
        self.assertTrue(all(set(methods_of(case)) for case in CASES.values()))


if __name__ == "__main__":
    unittest.main()
