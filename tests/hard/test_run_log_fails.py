"""A disk that is full for run.log alone: one rank has the error of a line, and all of them end with it."""
import os
import shutil
import subprocess
import unittest
import unittest.mock

from gravier_runs import RunTestCase, merged, run_case, write

#: as the disk has room for all but what holds a text
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
ssize_t write(int file, const void *text, size_t size) {
  static ssize_t (*whole)(int, const void *, size_t);
  const char *mark = getenv("FAILS_AT");
  if (!whole) whole = (ssize_t (*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
  if (mark && file > 2 && memmem(text, size, mark, strlen(mark))) { errno = ENOSPC; return -1; }
  return whole(file, text, size);
}
"""
CASE = {
    "scene": {"bodies": "lattice", "lattice_count": [8, 4], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3},
    "time": {"step": 1e-3, "steps": 6},
    "solver": {"method": "nscdd"},
    "decomposition": {"subdomains": 2},
    "output": {"directory": "results", "every": 2, "checkpoint_every": 4, "fclib_step": 3},
}


class LogFails(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            raise unittest.SkipTest("there is no C compiler")
        cls.shim = os.path.join(cls.scratch, "shim.so")
        subprocess.run([compiler, "-shared", "-fPIC", "-o", cls.shim, write(os.path.join(cls.scratch, "shim.c"), SHIM), "-ldl"], check=True)

    def failing(self, title, mark, groups=None, options=()):
        with unittest.mock.patch.dict(os.environ, {"LD_PRELOAD": self.shim, "FAILS_AT": mark}):
            run = run_case(merged(CASE, groups or {}), 2, self.here(title), options)
        self.assert_status(run, 4)
        self.assertIn("run.log: ", run.stderr)
        self.assertIn("no space left on device", run.stderr)
        return run

    def test_the_shim_fails_for_its_text_alone(self):
        with unittest.mock.patch.dict(os.environ, {"LD_PRELOAD": self.shim, "FAILS_AT": "no line has this"}):
            self.assert_status(run_case(CASE, 2, self.here("plain")), 0)

    def test_a_line_of_a_checkpoint(self):
        self.failing("checkpoint", "checkpoint  of step 4")

    def test_a_line_of_a_step_whose_problem_is_written(self):
        """The line of the step fails before its file is due."""
        run = self.failing("step", "       3   3.0")
        self.assertFalse(os.path.exists(run.path("results", "step_3.hdf5")))

    def test_the_line_of_a_restart_without_a_step_left(self):
        self.assert_status(run_case(CASE, 2, self.here("over")), 0)
        self.failing("over", "no step is left", options=("--restart",))

    def test_the_last_lines(self):
        self.failing("end", "finished    all")


if __name__ == "__main__":
    unittest.main()
