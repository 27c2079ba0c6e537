"""drivers/studies/study_dem.py: what it measures of grains against direct sums and known motions, its scenes as both codes read them,
and its smallest part."""
import contextlib
import io
import os
import shutil
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import matplotlib.pyplot  # noqa: F401
import numpy as np

import forked_scripts
from gravier_runs import LONG, PROGRAMS, SOURCE

sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
os.environ.setdefault("GRAVIER_BIN_DIR", PROGRAMS)
import dem_codes as codes  # noqa: E402
import dem_scenes as scenes  # noqa: E402
import study_dem  # noqa: E402

STUDY = os.path.join(SOURCE, "drivers/studies/study_dem.py")


class Measures(unittest.TestCase):

    def test_solid_fraction(self):
        """A layer through the middle of a sphere, with others above and below it: the integral of pi (r^2 - z^2). A whole sphere."""
        slab = np.pi * (0.5 * 1.0 - 0.5**3 / 3.0)
        value = codes.solid_fraction(np.array([0.0, 9.0, -9.0]), np.array([1.0, 1.0, 1.0]), -0.5, 0.5, 2.0)
        self.assertAlmostEqual(value, 2.0 * slab / 2.0, delta=1e-14)
        value = codes.solid_fraction(np.array([1.0]), np.array([1.0]), 0.0, 2.0, 4.0)
        self.assertAlmostEqual(value, 4.0 / 3.0 * np.pi / 8.0, delta=1e-14)

    def test_touching(self):
        """The pairs of all images, by a direct search, with and without periods, and with centres beyond the box."""
        rng = np.random.default_rng(3)
        centres, radii = rng.random((120, 3)) * [3.0, 2.0, 1.5] - [0.3, 0.0, 0.2], rng.uniform(0.1, 0.2, 120)
        for period in (None, [3.0, 2.0, 0.0]):
            found = {tuple(sorted(pair)) for pair in codes.touching(centres, radii, period).tolist()}
            shifts = [(0.0, 0.0)] if period is None else [(3.0 * i, 2.0 * j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            expected = {(a, b) for a in range(120) for b in range(a + 1, 120) for shift in shifts
                        if np.linalg.norm(centres[a] - centres[b] + [*shift, 0.0]) < radii[a] + radii[b]}
            self.assertGreater(len(expected), 50)
            self.assertEqual(found, expected)

    def test_contacts_a_grain(self):
        """Three in a row, of which the last is glued: the free ones have 1 and 2 contacts."""
        self.assertEqual(codes.contacts_a_grain(np.array([[0, 1], [1, 2]]), np.array([True, True, False])), 1.5)

    def test_errors(self):
        """Of a series of independent numbers, that of their mean, to what five batches can tell; of a line, nothing."""
        rng = np.random.default_rng(5)
        errors = [codes.mean_and_error(rng.normal(size=500))[1] for _ in range(200)]
        self.assertAlmostEqual(np.mean(np.square(errors)), 1.0 / 500.0, delta=0.2 / 500.0)
        time = np.linspace(0.0, 1.0, 100)
        rate, error = codes.rate_and_error(time, 3.0 - 7.0 * time)
        self.assertAlmostEqual(rate, -7.0, delta=1e-12)
        self.assertLess(error, 1e-12)

    def test_rebound(self):
        """An impact on a spring and a dashpot, integrated: RESTITUTION where the overlap ends, `rebound` where the force does."""
        x, v, step = 0.0, 1.0, 1.0e-5
        let_go = None
        while x >= 0.0:
            if let_go is None and x + 2.0 * scenes.DAMPING * v < 0.0:
                let_go = -v
            # the mid-point rule, whose error is far below the digits looked at
            middle = v - 0.5 * step * (x + 2.0 * scenes.DAMPING * v)
            x, v = x + step * middle, v - step * (x + 0.5 * step * v + 2.0 * scenes.DAMPING * middle)
        self.assertAlmostEqual(-v, scenes.RESTITUTION, delta=1e-4)
        self.assertAlmostEqual(let_go, scenes.rebound(scenes.DAMPING), delta=1e-4)


class Scenes(unittest.TestCase):

    def setUp(self):
        self.place = Path(self.enterContext(tempfile.TemporaryDirectory()))

    def test_data_file(self):
        """The grains of a bodies file and of a data file of LAMMPS are the same, to the digits of the latter."""
        settling = self.settling(3, 4, 5)
        rows = (settling.place / "start.data").read_text(encoding="ascii").split("Atoms # sphere")[1].split()
        rows = np.array(rows, float).reshape(-1, 7)
        import h5py
        with h5py.File(settling.place / "start.h5") as file:
            self.assertEqual(len(rows), settling.grains)
            np.testing.assert_allclose(rows[:, 4:], file["bodies/position"][:], rtol=1e-11)
            np.testing.assert_allclose(0.5 * rows[:, 2], file["bodies/radius"][:], rtol=1e-11)

    def settling(self, *count):
        settling = scenes.Settling(self.place, True, 1)
        settling.width, settling.depth, settling.height = (number * scenes.CELL for number in count or (6, 6, 12))
        settling.duration = 0.15
        settling.prepare()
        return settling

    def shear(self):
        shear = scenes.Shear(self.place, True, 1)
        shear.count, shear.period, shear.strain, shear.begin = 200, (0.014, 0.012), 0.008, 0.001
        shear.prepare()
        return shear

    def test_shear(self):
        """A short start by rigid and by compliant contacts: the lid bears the pressure and is dragged, and the volume is the same to a
        hundredth of its height."""
        shear = self.shear()
        for compliant in (False, True):
            setting = (shear.compliant if compliant else shear.settings)[0]
            seconds = codes.run_gravier(shear.place / f"run{compliant}", *shear.case(setting, compliant))
            self.assertGreater(seconds, 0.0)
            values = shear.of_gravier(shear.place / f"run{compliant}", compliant)
            self.assertGreater(values["stress ratio"][0], 0.0)
            self.assertLess(values["stress ratio"][0], shear.friction)
            self.assertAlmostEqual(values["volume over that at the start"][0], 1.0, delta=0.01)
            # between a gas and the most that spheres have
            self.assertGreater(values["contacts a grain"][0], 2.0)
            self.assertLess(values["contacts a grain"][0], 6.0)
            log = codes.Log(shear.place / f"run{compliant}")
            self.assertEqual(log.solves, round(shear.duration / setting.step))
            # how much of the time has a name hangs on the machine; none of it is counted twice
            self.assertTrue(0.3 < log.share(*log.phases) < 1.05, log.phases)

    def test_ranks(self):
        """Grains that settle on two ranks have a subdomain each, and are as dense as those on one; what is said of a wrong case is its error, and not
        the last words of the launcher."""
        settling = self.settling(5, 4, 8)
        found = []
        for ranks in (1, 2):
            place = settling.place / f"gravier{ranks}"
            codes.run_gravier(place, *settling.case(settling.settings[0]), ranks=ranks)
            self.assertIn(f"\nranks       {ranks}, subdomains {ranks} (grid {ranks} x 1 x 1", (place / "run.log").read_text(encoding="utf-8"))
            found.append(settling.of_gravier(place, False)["solid fraction"][0])
        self.assertAlmostEqual(found[1] / found[0], 1.0, delta=0.02)
        with self.assertRaisesRegex(SystemExit, "ended with status 2: .*friction = -1"):
            groups, boundaries = settling.case(settling.settings[0])
            codes.run_gravier(settling.place / "wrong", {**groups, "scene": {**groups["scene"], "friction": -1.0}}, boundaries, ranks=2)

    @unittest.skipUnless(shutil.which("lmp"), "LAMMPS is not there")
    def test_scripts(self):
        """LAMMPS runs all three; a load of springs ten times as stiff has shorter steps."""
        shear = self.shear()
        for times in (1.0, shear.stiffer):
            codes.run_lammps("lmp", shear.place / f"lammps{times}", shear.script(times))
            values = shear.of_lammps(shear.place / f"lammps{times}", times)
            self.assertGreater(values["stress ratio"][0], 0.0)
            self.assertAlmostEqual(values["volume over that at the start"][0], 1.0, delta=0.01)
        settling = self.settling()
        codes.run_lammps("lmp", settling.place / "lammps", settling.script())
        self.assertGreater(settling.of_lammps(settling.place / "lammps")["solid fraction"][0], 0.4)
        discharge = scenes.Discharge(self.place, True, settling)
        discharge.begin, discharge.duration = 0.05, 0.1
        discharge.prepare()
        codes.run_lammps("lmp", discharge.place / "lammps", discharge.script())
        self.assertGreater(discharge.of_lammps(discharge.place / "lammps")["flow [kg/s]"][0], 0.0)


class Command(unittest.TestCase):

    def run_study(self, *arguments):
        return forked_scripts.script(STUDY, *arguments)

    def run_small(self, *arguments):
        """Status and text of the study with a box of a tenth of the grains, which settles too early for its bounds."""
        class Small(scenes.Settling):
            def __init__(self, *more):
                super().__init__(*more)
                self.width, self.depth, self.height, self.duration = 5 * scenes.CELL, 4 * scenes.CELL, 8 * scenes.CELL, 0.1

        said = io.StringIO()
        with mock.patch.object(study_dem, "Settling", Small), mock.patch.object(sys, "argv", [STUDY, *arguments]), contextlib.redirect_stdout(said):
            return study_dem.main(), said.getvalue()

    def test_settling(self):
        """With stored figures: seconds are not compared, and the status tells whether a row is missed; in `./gravier test long` physics is within
        its bounds."""
        with tempfile.TemporaryDirectory() as place:
            arguments = "--quick", "--parts", "settling", "--lammps", "none", "--out", place
            if LONG:
                run = self.run_study(*arguments)
                status, text = run.returncode, run.stdout
            else:
                status, text = self.run_small(*arguments)
            self.assertIn("stored figures of", text)
            self.assertRegex(text, rf"(?m)^settling +solid fraction .* {'yes' if LONG else '(yes|NO)'}$")
            self.assertNotIn("seconds of LAMMPS", text)
            self.assertIn("seconds are not compared", text)
            self.assertEqual(status, 1 if " NO\n" in text else 0)
            for name in ("study_dem.csv", "study_dem.md"):
                self.assertTrue((Path(place) / name).exists(), name)

    def test_command_line(self):
        for arguments, words in ((("--lammps", "no such program"), "--lammps no such program: expected LAMMPS, or none"),
                                 (("--lammps", "none", "--record"), "--record: expected LAMMPS on this machine"),
                                 (("--ranks", "0"), "--ranks"), (("--ranks", "2", "--record", "--lammps", shutil.which("lmp") or "none"), "--record"),
                                 (("--parts", "walking"), "invalid choice: 'walking'")):
            run = self.run_study(*arguments)
            self.assertEqual((run.returncode, len(run.stderr.strip().splitlines())), (2, 1), run.stderr)
            self.assertIn(words, run.stderr)


if __name__ == "__main__":
    unittest.main()
