"""compare_builds.py: a build is the same as itself, and one changed bit of a result, a column or a checkpoint is found by name."""
import os
import stat
import sys
import unittest

import compare_builds
from gravier_runs import PROGRAMS, RunTestCase, write

#: a program in the place of gravier: it runs the real one and changes what that wrote
SPOILER = """#!{python}
import subprocess, sys
import h5py, numpy as np
status = subprocess.call([{real!r}, *sys.argv[1:]])
{spoil}
sys.exit(status)
"""
#: change the lowest bit of the first number of a dataset
FLIP = """
with h5py.File({file!r}, "r+") as file:
    values = file[{dataset!r}][()]
    values.view(np.uint8).reshape(-1)[0] ^= 1
    file[{dataset!r}][...] = values
"""
#: change the last digit of the first row of a column
DIGIT = """
lines = open("results/history.csv").read().splitlines()
cells = lines[1].split(",")
at = lines[0].split(",").index("residual")
cells[at] = cells[at].replace("E", "1E") if "E" in cells[at] else cells[at] + "1"
lines[1] = ",".join(cells)
open("results/history.csv", "w").write("\\n".join(lines) + "\\n")
"""
ATTRIBUTE = """
with h5py.File("results/results.h5", "r+") as file:
    file["steps/1"].attrs["time"] = np.nextafter(file["steps/1"].attrs["time"], 2.0)
"""


class CompareBuilds(RunTestCase):

    def compare(self, new, pattern, **options):
        """Counts of a comparison of the build under test with another one, and its lines."""
        lines = []
        directory = self.here(f"{len(os.listdir(self.scratch))}")
        os.makedirs(directory)
        counts = compare_builds.compare_all(PROGRAMS, new, pattern, directory=directory, say=lines.append, **options)
        return counts, lines

    def spoiled(self, name, spoil):
        """Directory of a build whose gravier changes what it has written."""
        directory = self.here(name)
        os.makedirs(directory)
        text = SPOILER.format(python=sys.executable, real=os.path.join(PROGRAMS, "gravier"), spoil=spoil)
        path = write(os.path.join(directory, "gravier"), text)
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)
        return directory

    def test_the_same_build(self):
        counts, lines = self.compare(PROGRAMS, "data/columns/*")
        self.assertEqual(counts, (4, 0, 0), lines)
        self.assertEqual(sorted(lines)[0], "data/columns/problem1.nml (1 of 1 steps) on 1 rank: same")
        counts, lines = self.compare(PROGRAMS, "fclib/2D", ranks=(1,))
        self.assertEqual(counts, (1, 0, 0), lines)

    def test_studies_are_named(self):
        counts, lines = self.compare(PROGRAMS, "data/studies/columns*.nml", ranks=(2,))
        self.assertEqual(counts[1:], (0, 3), lines)
        self.assertIn("data/studies/columns.nml: left out: it is a study, which measures seconds; its case is compared", lines)

    def test_one_changed_number_is_found(self):
        position = "steps/1/bodies/position"
        for number, (spoil, found) in enumerate([
                (FLIP.format(file="results/results.h5", dataset=position), "results.h5 /" + position),
                (FLIP.format(file="results/checkpoint.h5", dataset="{table}"), None),
                (DIGIT, "history.csv residual"),
                (ATTRIBUTE, "results.h5 /steps/1@time")]):
            if found is None:
                table = self.first_table()
                spoil, found = spoil.replace("{table}", table), "checkpoint.h5 " + table
            with self.subTest(found):
                counts, lines = self.compare(self.spoiled(f"spoiled {number}", spoil), "data/columns/problem1.nml", ranks=(1,))
                self.assertEqual(counts, (0, 1, 0))
                self.assertEqual(lines, [f"data/columns/problem1.nml (1 of 1 steps) on 1 rank: DIFFERENT: {found}"])

    def first_table(self):
        """Name of a table of numbers in the checkpoint of the case."""
        case = next(case for case in compare_builds.data_cases(4, None, True)[0] if case.name == "data/columns/problem1.nml")
        directory = self.here("a checkpoint")
        os.makedirs(directory)
        found = case.act(PROGRAMS, directory, 1)
        return min(name.split(" ", 1)[1] for name, value in found.items()
                   if name.startswith("checkpoint.h5 ") and "@" not in name and getattr(value, "size", 0) > 4)

    def test_a_build_that_fails_is_not_the_same(self):
        counts, lines = self.compare(self.spoiled("failing", "status = 4"), "data/columns/problem1.nml", ranks=(1,))
        self.assertEqual(counts, (0, 1, 0))
        self.assertIn("new build: gravier ended with status 4", lines[0])


if __name__ == "__main__":
    unittest.main()
