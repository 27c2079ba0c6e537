"""Memory: what `--check` expects a rank to hold at most is what runs hold, and the least that a grain takes is what it takes."""
import itertools
import os
import re
import subprocess
import sys
import unittest

from gravier_runs import PROGRAMS, RunTestCase, alone_environment, gravier, merged, namelist, run_case, write

#: grains of one radius on a lattice touch each other; of two radii most touch none
TOUCHING, LOOSE = {"radius_min": 0.01, "radius_max": 0.01}, {"radius_min": 0.008, "radius_max": 0.012}
PLANE, SPACE = {"dimension": 2, "lattice_count": [250, 200]}, {"dimension": 3, "lattice_count": [40, 40, 32]}
CASE = {"scene": {"bodies": "lattice", "friction": 0.3}, "time": {"step": 1e-3, "steps": 2},
        "solver": {"method": "nscdd", "max_iterations": 20}, "decomposition": {"subdomains": 4}, "output": {"directory": "results", "every": 0}}
#: bytes that src/run/run_memory.f90 takes for a grain, by dimension and friction
LEAST = {(2, 0.0): 520, (3, 0.0): 625, (2, 0.3): 635, (3, 0.3): 855}
#: says the most memory [KiB] that a program has held, of which it is the only child: usage of a child of the test would have the memory of
#: the test, and who looks at the program while it runs may miss its end
PEAK = """import os, sys
_, status, usage = os.wait4(os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ), 0)
print(usage.ru_maxrss, file=sys.stderr)
sys.exit(os.waitstatus_to_exitcode(status))
"""


class Memory(RunTestCase):

    def peak(self, case, ranks=1):
        """[MiB] that --check expects, and that a run held."""
        write(self.here("case.nml"), namelist(case))
        check = gravier("--check", "case.nml", ranks=ranks, directory=self.scratch)
        self.assert_status(check, 0)
        return int(re.search(r"\n  about (\d+) MiB at most on a rank", check.stdout)[1]), self.held(case, ranks)

    def held(self, case, ranks=1):
        """[MiB] that a run held."""
        run = run_case(case, ranks, self.here("run"))
        self.assertIn(run.status, (0, 3), run)
        return int(re.search(r"\nmemory      at most (\d+) MiB on a rank", run.stdout)[1])

    def test_estimate(self):
        for name, changes, ranks in (
                ("touching", {"scene": {**PLANE, **TOUCHING}}, 1),
                ("loose", {"scene": {**PLANE, **LOOSE}}, 2),
                ("touching spheres", {"scene": {**SPACE, **TOUCHING}}, 1),
                ("on two ranks", {"scene": {**SPACE, **TOUCHING}}, 2),
                ("without friction", {"scene": {**SPACE, **TOUCHING, "friction": 0.0}}, 1),
                ("pictures", {"scene": {**SPACE, **TOUCHING}, "output": {"vtk": True}}, 1),
                ("no contacts written", {"scene": {**SPACE, **TOUCHING}, "output": {"contacts": False}}, 1)):
            with self.subTest(name):
                expected, held = self.peak(merged(CASE, changes), ranks)
                self.assertGreaterEqual(expected, held)
                self.assertLessEqual(expected, 1.25 * held)

    def test_least_of_a_grain(self):
        """The peaks of two numbers of grains that touch no others."""
        for shape, counts in ((PLANE, ([250, 200], [500, 300])), (SPACE, ([40, 40, 32], [60, 60, 42]))):
            for friction in (0.0, 0.3):
                with self.subTest(dimension=shape["dimension"], friction=friction):
                    held = [self.held(merged(CASE, {"scene": {**shape, **LOOSE, "lattice_count": count, "friction": friction}}))
                            for count in counts]
                    grains = [int(count[0]) * count[1] * (count[2] if len(count) > 2 else 1) for count in counts]
                    least = LEAST[shape["dimension"], friction]
                    # the log has whole MiB
                    taken = 2**20 * (held[1] - held[0]) / (grains[1] - grains[0])
                    self.assertLess(abs(taken - least), 0.03 * least + 2**21 / (grains[1] - grains[0]))

    def sample_peak(self, count, dimension, arrangement, radii):
        """[bytes] that gravier_sample held for so many grains."""
        self.write_sample(count, dimension, arrangement, radii)
        with alone_environment() as environment:
            run = subprocess.run([sys.executable, "-IS", "-c", PEAK, os.path.join(PROGRAMS, "gravier_sample"), "sample.nml"], cwd=self.scratch,
                                 env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                 check=True)
        return 1024 * int(run.stderr)

    def sample_least(self, *kind):
        """[bytes] of a grain that gravier_sample refuses by."""
        self.write_sample(2 * 10**9, *kind)
        with alone_environment() as environment:
            run = subprocess.run(["sh", "-c", f"ulimit -v 6000000; exec {PROGRAMS}/gravier_sample sample.nml"], cwd=self.scratch,
                                 env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 4, run)
        return float(re.search(r"2000000000 grains: at least ([\d.]+) GB of memory are needed", run.stderr)[1]) / 2

    def write_sample(self, count, dimension, arrangement, radii):
        sizes = {"radius": 0.01} if radii == "single" else {"radius_min": 0.005, "radius_max": 0.01}
        width = round(0.024 * count**(1 / dimension) + 0.1, 4)
        write(self.here("sample.nml"), namelist({
            "scene": {"bodies": "sample", "dimension": dimension}, "time": {"step": 1e-3, "steps": 0},
            "sample": {"count": count, "arrangement": arrangement, "radii": radii, "box": [width] * (dimension - 1), "file": "grains.h5", **sizes}}))

    def test_least_of_a_sample(self):
        """What each grain takes beside the program itself is not below what gravier_sample refuses by, and a quarter above it at most."""
        few = 1000
        for dimension, placing in itertools.product((2, 3), (("lattice", "uniform"), ("loose", "uniform"), ("loose", "single"))):
            # of a lattice, which takes a tenth of the time, as many as the program itself weighs little beside
            many = 300000 if placing[0] == "lattice" else 200000
            with self.subTest(dimension=dimension, placing=placing):
                least = self.sample_least(dimension, *placing)
                taken = (self.sample_peak(many, dimension, *placing) - self.sample_peak(few, dimension, *placing)) / (many - few)
                self.assertGreaterEqual(taken, least)
                self.assertLessEqual(taken, 1.25 * least)


if __name__ == "__main__":
    unittest.main()
