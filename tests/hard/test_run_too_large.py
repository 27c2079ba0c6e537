"""Counts beyond 2^31 and scenes beyond the memory: one line with the figure, status 2 for a count and 4 for the memory, never another
count, never a backtrace."""
import os
import re
import resource
import subprocess
import unittest

import h5py
import numpy as np

from gravier_runs import ENVIRONMENT, MPIEXEC, PATIENCE, PROGRAMS, RunTestCase, each, gravier, namelist, write
from killed_runs import compile_shim

#: as many as a reader of 32 bits would take for 2
MANY = 2**32 + 2
CASE = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012},
        "time": {"step": 1e-3, "steps": 1}, "output": {"directory": "results", "every": 0}}
# a process whose own code, not that of libraries, gets no memory from its n-th allocation of some size on
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
extern void *__libc_malloc(size_t);
extern void *__libc_realloc(void *, size_t);
static long n = 0, at = -1;
static int fails(size_t size, void *caller) {
  Dl_info where;
  if (at < 0) at = atol(getenv("FAILS_AT"));
  if (size < 2000 || !dladdr(caller, &where) || !where.dli_fname || !strstr(where.dli_fname, "/gravier")) return 0;
  if (++n < at) return 0;
  errno = ENOMEM;
  return 1;
}
__attribute__((destructor)) static void tell(void) { fprintf(stderr, "own allocations: %ld\n", n); }
void *malloc(size_t size) { return fails(size, __builtin_return_address(0)) ? NULL : __libc_malloc(size); }
void *realloc(void *old, size_t size) { return fails(size, __builtin_return_address(0)) ? NULL : __libc_realloc(old, size); }
"""


def limited(program, *arguments, directory, addresses=None):
    """Run a program by itself, with so many bytes of addresses."""
    def limit():
        if addresses:
            resource.setrlimit(resource.RLIMIT_AS, (addresses, addresses))
    return subprocess.run([os.path.join(PROGRAMS, program), *arguments], cwd=directory, env={**ENVIRONMENT, **os.environ}, text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE, preexec_fn=limit, check=False)


class TooLarge(RunTestCase):

    def refused(self, run, status, pattern):
        self.assertEqual(run.returncode, status, run)
        self.assertRegex(run.stderr, pattern)
        self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)

    @staticmethod
    def start(command, directory):
        return subprocess.run(command, cwd=directory, env={**ENVIRONMENT, **os.environ}, text=True, stdin=subprocess.DEVNULL,
                              capture_output=True, timeout=PATIENCE, check=False)

    def case(self, name, changes):
        write(self.here(name), namelist({group: {**keys, **changes.get(group, {})} for group, keys in {**{key: {} for key in changes}, **CASE}
                                        .items()}))
        return name

    def bodies(self, name, rows, walls=1, columns=2):
        """A bodies file whose datasets have lengths and no contents."""
        with h5py.File(self.here(name), "w") as file:
            for key, shape, kind in (("bodies/id", (rows,), "i8"), ("bodies/position", (rows, columns), "f8"), ("bodies/radius", (rows,), "f8"),
                                     ("walls/id", (walls,), "i8"), ("walls/point", (walls, 2), "f8"), ("walls/normal", (walls, 2), "f8")):
                file.create_dataset(key, shape, kind)
            if rows < 10:
                file["bodies/id"][:], file["bodies/radius"][:] = np.arange(1, rows + 1), 1.0
        write(self.here(name + ".nml"), namelist({**CASE, "scene": {"dimension": 2, "bodies": "file", "bodies_file": name}}))
        return name + ".nml"

    def test_rows_beyond_counts(self):
        here = self.here("")
        self.refused(limited("gravier", self.bodies("rows.h5", MANY), directory=here), 2,
                     rf"rows\.h5: /bodies: rows of a rank: {MANY}, but 0 to 2147483647 was expected$")
        self.refused(limited("gravier", self.bodies("walls.h5", 2, walls=MANY), directory=here), 2,
                     rf"walls\.h5: /walls/id: rows: {MANY}, but 0 to 2147483647 was expected$")
        self.refused(limited("gravier", self.bodies("columns.h5", 2, columns=MANY), directory=here), 2,
                     r"columns\.h5: /bodies/position: a dataset of shape \(N, 2147483647\), but .*\(N, 2\) was expected$")

    def test_contact_problem_beyond_counts(self):
        with h5py.File(self.here("problem.h5"), "w") as file:
            file["fclib_local/spacedim"] = np.array([2], "i4")
            file.create_dataset("fclib_local/vectors/mu", (MANY,), "f8")
        self.refused(limited("gravier_fclib", "problem.h5", directory=self.here("")), 2,
                     rf"/fclib_local/vectors/mu: numbers: {MANY}, but 0 to 2147483647 was expected$")

    def test_input_beyond_counts(self):
        for name, changes in (("lattice.nml", {"scene": {"lattice_count": [2000000000, 2000000000]}}),
                              ("number.nml", {"scene": {"lattice_count": [4294967298, 1]}}),
                              ("steps.nml", {"time": {"steps": 4294967298}})):
            self.refused(limited("gravier", self.case(name, changes), directory=self.here("")), 2, name)

    def test_more_than_there_is(self):
        here = self.here("")
        big = self.case("big.nml", {"scene": {"lattice_count": [100000, 10000]}})
        for arguments in ((big,), ("--check", big)):
            self.refused(limited("gravier", *arguments, directory=here, addresses=6 * 10**9), 4,
                         r"big\.nml: &scene lattice_count: 1000000000 grains: at least 520\.0 GB of memory are needed "
                         r"on this machine, where [\d.]+ [GM]B are free$")
        write(self.here("sample.nml"), namelist({
            "scene": {"bodies": "sample", "dimension": 2},
            "sample": {"preparation": "none", "file": "grains.h5", "count": 2**31 - 1, "radii": "uniform", "radius_min": 0.008,
                       "radius_max": 0.012, "box": [1000.0, 0.0], "solid_fraction": 0.3},
            "time": {"step": 1e-3, "steps": 0}}))
        self.refused(limited("gravier_sample", "sample.nml", directory=here, addresses=6 * 10**9), 4,
                     r"sample\.nml: &sample count: 2147483647 grains: at least 493\.9 GB of memory are needed on this machine, where ")

    def test_many_enter_and_leave(self):
        """How many grains of an insertion a scene with an outlet has at once is not known: it is not refused; without an outlet it is."""
        falling = {"scene": {"dimension": 2, "bodies": "none"}, "time": {"step": 1e-3, "steps": 10**9},
                   "insertion": [{"name": "feed", "lower": [0.0, 0.0], "upper": [1.0, 0.1], "rate": 1e3, "radius": 0.01}],
                   "boundary": [{"name": "out", "shape": "outlet", "point": [0.0, -0.2], "normal": [0.0, 1.0]}]}
        for shape, status in (("outlet", 0), ("plane", 4)):
            falling["boundary"][0]["shape"] = shape
            write(self.here("feed.nml"), namelist(falling))
            run = gravier("--check", "feed.nml", directory=self.here(""))
            self.assertEqual(run.status, status, str(run))
            self.assertEqual("feed.nml: &insertion 'feed': 1000000000 grains: at least" in run.stderr, status == 4, str(run))

    def test_limit_of_a_process(self):
        """What a rank may have is less than what the machine has."""
        case = self.case("run.nml", {"scene": {"lattice_count": [2000, 1000]}})
        # the launcher has no limit, and MPI enough to start
        run = self.start([MPIEXEC, "-n", "1", "sh", "-c", f"ulimit -v 700000; exec {PROGRAMS}/gravier {case}"], self.here(""))
        self.assertEqual(run.returncode, 4, run)
        self.assertRegex(run.stderr.splitlines()[0], r"run\.nml: &scene lattice_count: 2000000 grains: at least 1\.0 GB of memory are needed "
                         r"on a rank, which may still have [\d.]+ MB \(ulimit -v\)$")

        # rows of grains alone would fit, and a file of before stays as it was
        def sample(count):
            write(self.here("sample.nml"), namelist({
                "scene": {"bodies": "sample", "dimension": 2},
                "sample": {"count": count, "radii": "uniform", "radius_min": 0.008, "radius_max": 0.012, "box": 10.0, "file": "grains.h5"},
                "time": {"step": 1e-3, "steps": 0}}))

        def content():
            with open(self.here("grains.h5"), "rb") as file:
                return file.read()

        sample(1000)
        self.assertEqual(self.start([f"{PROGRAMS}/gravier_sample", "sample.nml"], self.here("")).returncode, 0)
        before = content()
        sample(6000000)
        for ranks, needed in ((1, r"1\.4 GB"), (2, r"690\.0 MB")):
            run = self.start([MPIEXEC, "-n", str(ranks), "sh", "-c", f"ulimit -v 900000; exec {PROGRAMS}/gravier_sample sample.nml"], self.here(""))
            self.assertEqual(run.returncode, 4, run)
            self.assertRegex(run.stderr.splitlines()[0], rf"sample\.nml: &sample count: 6000000 grains: at least {needed} of memory are needed "
                             r"on a rank, which may still have [\d.]+ MB \(ulimit -v\)$")
        self.assertEqual(content(), before)

    def test_no_memory_while_running(self):
        """Whatever allocation fails, from the first to those of the last step: one line and status 4 on 1 and 2 ranks, of which one
        gets no more memory. Before the program asked after each of its own, a quarter of these runs crashed."""
        shim = compile_shim(self.scratch, SHIM)
        case = self.case("without.nml", {"scene": {"lattice_count": [20, 20], "friction": 0.3}, "time": {"steps": 6},
                                         "solver": {"method": "nscdd", "max_iterations": 20}, "decomposition": {"subdomains": 4},
                                         "output": {"every": 3, "checkpoint_every": 3}})

        def run(ranks, at):
            folder = self.here(f"without {ranks} {at}")
            os.makedirs(folder)
            script = f'if [ "${{OMPI_COMM_WORLD_RANK:-$PMI_RANK}}" = {ranks - 1} ]; then export LD_PRELOAD={shim} FAILS_AT={at}; fi; ' \
                     f"ulimit -c 0; exec {PROGRAMS}/gravier ../{case}"
            return self.start([MPIEXEC, "-n", str(ranks), "sh", "-c", script], folder)

        for ranks, count in ((1, 24), (2, 12)):
            whole = run(ranks, 10**9)
            self.assertEqual(whole.returncode, 0, whole)
            number = int(re.search(r"own allocations: (\d+)", whole.stderr)[1])
            self.assertGreater(number, 100)
            points = [1 + number * k // count for k in range(count)]
            for at, ended in zip(points, each(run, [(ranks, at) for at in points])):
                with self.subTest(ranks=ranks, at=at):
                    said = [line for line in ended.stderr.splitlines() if "gravier: error: " in line]
                    self.assertEqual((ended.returncode, len(said)), (4, 1), ended)
                    self.assertRegex(said[0], r"gravier: error: out of memory: [\d.]+ kB could not be allocated; ")
                    self.assertNotIn("Segmentation", ended.stderr)


if __name__ == "__main__":
    unittest.main()
