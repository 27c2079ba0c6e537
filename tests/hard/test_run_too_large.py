"""Counts beyond 2^31 and scenes beyond the memory: one line with the figure, status 2 for a count and 4 for the memory, never another
count, never a backtrace."""
import os
import resource
import subprocess
import unittest

import h5py
import numpy as np

from gravier_runs import ENVIRONMENT, MPIEXEC, PROGRAMS, RunTestCase, namelist, write

#: as many as a reader of 32 bits would take for 2
MANY = 2**32 + 2
CASE = {"scene": {"dimension": 2, "bodies": "lattice", "lattice_count": [10, 8], "radius_min": 0.008, "radius_max": 0.012},
        "time": {"step": 1e-3, "steps": 1}, "output": {"directory": "results", "every": 0}}


def limited(program, *arguments, directory, addresses=None):
    """Run a program by itself, with so many bytes of addresses."""
    def limit():
        if addresses:
            resource.setrlimit(resource.RLIMIT_AS, (addresses, addresses))
    return subprocess.run([os.path.join(PROGRAMS, program), *arguments], cwd=directory, env={**ENVIRONMENT, **os.environ}, text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, timeout=100, preexec_fn=limit, check=False)


class TooLarge(RunTestCase):

    def refused(self, run, status, pattern):
        self.assertEqual(run.returncode, status, run)
        self.assertRegex(run.stderr, pattern)
        self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)

    @staticmethod
    def start(command, directory):
        return subprocess.run(command, cwd=directory, env={**ENVIRONMENT, **os.environ}, text=True, stdin=subprocess.DEVNULL,
                              capture_output=True, timeout=100, check=False)

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
                         r"big\.nml: &scene lattice_count: 1000000000 grains: at least 550\.0 GB of memory are needed "
                         r"on this machine, where [\d.]+ [GM]B are free$")
        write(self.here("sample.nml"), namelist({
            "scene": {"bodies": "sample", "dimension": 2},
            "sample": {"preparation": "none", "file": "grains.h5", "count": 2**31 - 1, "radii": "uniform", "radius_min": 0.008,
                       "radius_max": 0.012, "box": [1000.0, 0.0], "solid_fraction": 0.3},
            "time": {"step": 1e-3, "steps": 0}}))
        self.refused(limited("gravier_sample", "sample.nml", directory=here, addresses=6 * 10**9), 4,
                     r"2147483647 grains: at least [\d.]+ GB of memory are needed on ")

    def test_limit_of_a_process(self):
        """What a rank may have is less than what the machine has."""
        case = self.case("run.nml", {"scene": {"lattice_count": [2000, 1000]}})
        # the launcher has no limit, and MPI enough to start
        run = self.start([MPIEXEC, "-n", "1", "sh", "-c", f"ulimit -v 700000; exec {PROGRAMS}/gravier {case}"], self.here(""))
        self.assertEqual(run.returncode, 4, run)
        self.assertRegex(run.stderr.splitlines()[0], r"run\.nml: &scene lattice_count: 2000000 grains: at least 1\.1 GB of memory are needed "
                         r"on a rank, which may still have [\d.]+ MB \(ulimit -v\)$")


if __name__ == "__main__":
    unittest.main()
