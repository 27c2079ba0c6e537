"""A disk that is full for run.log alone: one rank has the error of a line, and all of them end with it. A limit of the size of files is an
error too, and a reader of the standard output that goes away is none."""
import os
import shutil
import subprocess
import unittest
import unittest.mock

from gravier_runs import ENVIRONMENT, PROGRAMS, RunTestCase, merged, namelist, run_case, write

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


class BrokenOutputs(RunTestCase):

    def run_by_shell(self, title, line):
        """Status and standard error of the program, whose call a line of a shell has."""
        directory = self.here(title)
        os.makedirs(directory)
        write(os.path.join(directory, "case.nml"), namelist(merged(CASE, {"time": {"steps": 400}, "output": {"every": 50}})))
        done = subprocess.run(["bash", "-c", line.format(gravier=os.path.join(PROGRAMS, "gravier"))], cwd=directory, capture_output=True, text=True,
                              env={**os.environ, **ENVIRONMENT}, check=False)
        return done.returncode, done.stderr, sorted(os.listdir(os.path.join(directory, "results")))

    def test_nobody_reads_the_standard_output(self):
        status, said, files = self.run_by_shell("head", "{gravier} case.nml | head -2 > /dev/null; exit ${{PIPESTATUS[0]}}")
        self.assertEqual((status, said), (0, ""))
        with open(self.here("head/results/run.log"), encoding="utf-8") as file:
            self.assertTrue(file.readlines()[-1].startswith("finished    all 400 steps"))
        self.assertEqual(files, ["checkpoint.h5", "history.csv", "results.h5", "run.log", "step_3.hdf5"])

    def test_a_limit_of_the_size_of_files(self):
        status, said, files = self.run_by_shell("limit", "ulimit -f 60; {gravier} case.nml > /dev/null")
        self.assertEqual((status, len(said.splitlines())), (4, 1), said)
        self.assertIn("File too large", said)
        self.assertEqual([name for name in files if ".part" in name or ".data" in name], [])


if __name__ == "__main__":
    unittest.main()
