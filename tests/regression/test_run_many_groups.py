"""An input of thousands of groups is read, checked and written back in a time that grows as the number of groups does."""
import os
import resource
import unittest

from gravier_runs import RunTestCase, gravier, namelist, write


class ManyGroups(RunTestCase):

    def seconds(self, count):
        """Processor time of a check of so many boundaries."""
        boundaries = [{"name": f"plane {k}", "shape": "plane", "point": [0.0, -1.0 - k], "normal": [0.0, 1.0], "friction": 0.3, "restitution": 0.1}
                      for k in range(count)]
        case = {"scene": {"bodies": "column"}, "boundary": boundaries, "time": {"step": 1e-3, "steps": 1}}
        write(os.path.join(self.scratch, "case.nml"), namelist(case))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run = gravier("--check", "case.nml", directory=self.scratch)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.assert_status(run, 0)
        self.assertEqual(run.stdout.count("\n  &boundary\n"), count)
        return after.ru_utime - before.ru_utime

    def test_boundaries(self):
        # four times the groups take four times as long, not sixteen; measured: 4 times, 8 to 10 with a text for each pair of names, and 29 with
        # texts put together by copies
        self.seconds(10)
        few, many = self.seconds(1000), self.seconds(4000)
        self.assertLess(many, 10.0 * few)


if __name__ == "__main__":
    unittest.main()
