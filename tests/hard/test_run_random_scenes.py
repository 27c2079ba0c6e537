"""Scenes made at random, by methods in turn, against what every run must obey. 24 scenes from a fixed number on; a longer search:

    GRAVIER_RANDOM_SCENES=1000 GRAVIER_RANDOM_FROM=24 GRAVIER_BIN_DIR=build/release/bin PYTHONPATH=tests/support \\
      /usr/bin/python3 -m unittest discover -s tests/hard -p test_run_random_scenes.py
"""
import os
import unittest

from gravier_runs import LONG, RunTestCase, each
from hard_cases import METHODS, disagreement, play
from random_scenes import methods, scene

FIRST = int(os.environ.get("GRAVIER_RANDOM_FROM", "0"))
COUNT = int(os.environ.get("GRAVIER_RANDOM_SCENES", "24"))


class RandomScenes(RunTestCase):

    def play(self, number):
        case = scene(number)
        runs = [play(case, title, METHODS[title], 1 + (number % (2 if LONG else 4) == 1), self.here(f"{number} {title}")) for title in methods(number)]
        wrong = [f"{run.method}: {words}" for run in runs for words in run.complaints()]
        return wrong + disagreement(*runs)

    def test_laws(self):
        numbers = range(FIRST, FIRST + COUNT)
        for number, wrong in zip(numbers, each(self.play, [(number,) for number in numbers])):
            with self.subTest(number):
                self.assertEqual(wrong, [])


if __name__ == "__main__":
    unittest.main()
