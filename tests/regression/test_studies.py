"""`./gravier study NAME` needs no further words: each study writes in out/NAME, or in the directory of --out, has a quick form, and
ends with the status of its table."""
import contextlib
import io
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
from forked_scripts import script

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
sys.path.insert(0, os.path.join(SOURCE, "drivers/studies"))
import bounds_of_convergence  # noqa: E402
import bounds_of_methods  # noqa: E402
import study_biaxial  # noqa: E402
import study_choice  # noqa: E402
import study_collapse  # noqa: E402
import study_drift  # noqa: E402
import study_drum  # noqa: E402
import study_error  # noqa: E402
import study_hard  # noqa: E402
import study_hopper  # noqa: E402
import study_lmgc90  # noqa: E402
import study_loop  # noqa: E402
import study_side_by_side  # noqa: E402
import study_silo  # noqa: E402
import study_support  # noqa: E402
from oracle_table import Bounds  # noqa: E402

#: studies that write nothing or, unless asked, only in a directory that goes
NO_FILES = {"manifolds", "dem", "masonry"}
#: studies of files that a user has to name
NAMED = {"lmgc90": "examples", "side_by_side": "examples", "communication": "bodies"}
#: ends of a main by which the status is that of the rows of a study, or of its closing table
ENDS = (r"^    (sys\.exit\(|return )(1 if (table\.)?(misses|failures) else 0|int\(missed > 0\)|0 if all\(row\[-1\] == \"yes\")",
        r"^    return (accepted\(|table\.close\(\))")


def names():
    for path in sorted(Path(SOURCE, "drivers/studies").glob("study_*.py")):
        name = path.stem.removeprefix("study_")
        if name != "support":
            yield name, path.read_text(encoding="utf-8")


def judged(function, *given):
    """Status of a closing table and what is printed."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        status = function(*given)
    return status, said.getvalue()


class Studies(unittest.TestCase):

    def test_outputs(self):
        found = set()
        for name, text in names():
            found.add(name)
            with self.subTest(name):
                positional = re.findall(r'add_argument\("(\w+)"', text)
                self.assertEqual(positional, [NAMED[name]] if name in NAMED else [])
                if name not in NO_FILES:
                    self.assertRegex(text, rf'add_argument\("--out", .*default=(?:Path\()?"out/{name}"')
        self.assertGreater(len(found), 15)
        self.assertLessEqual(NO_FILES | set(NAMED), found)

    def test_options(self):
        """Numbers that make no sense are refused in one line, and no study writes into a directory with anything else in it."""
        for name, text in names():
            with self.subTest(name):
                self.assertNotRegex(text, r"argparse\.ArgumentParser\(|type=int\b(?!, choices)|type=float\b")
                self.assertRegex(text, r"(?m)^    run_study\(main\)$")
                if name != "manifolds":
                    self.assertIn("claimed(options.out)", text)
        with tempfile.TemporaryDirectory() as place:
            Path(place, "mine.txt").touch()
            for name, options, line in (
                    ("silo", ["--layers", "0"], "argument --layers: '0': expected an integer >= 1; see"),
                    ("manifolds", ["--count", "-3"], "argument --count: '-3': expected an integer >= 1; see"),
                    ("hard", ["--ranks", "x"], "argument --ranks: 'x': expected an integer >= 1; see"),
                    ("hard", ["--cases", "("], "--cases (: expected a regular expression: "),
                    ("biaxial", ["--rate", "-1"], "argument --rate: '-1': expected a number > 0; see"),
                    ("convergence", ["--parts", "none"], "--parts none: expected some of "),
                    ("communication", ["none.h5", "--out", place], "none.h5: no such file; expected a bodies file"),
                    ("masonry", ["--out", place], f"{place}: there is something that no study has made, which is not replaced; expected another --out"),
                    ("sound", ["--out", place], f"{place}: there is something that no study has made")):
                with self.subTest(name=name, options=options):
                    run = script(os.path.join(SOURCE, f"drivers/studies/study_{name}.py"), *options, directory=place)
                    self.assertEqual(run.returncode, 2, run.stderr)
                    self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
                    self.assertIn(line, run.stderr)
            self.assertEqual(os.listdir(place), ["mine.txt"])
            # what a study has made is taken over by the next one, and a file that is missing is told
            made = study_support.claimed(os.path.join(place, "made"))
            (made / "study.csv").touch()
            self.assertEqual(study_support.claimed(made), made)
            self.assertTrue((made / "study.csv").exists())
            self.assertFalse((study_support.emptied(made) / "study.csv").exists())

            def main():
                open(os.path.join(place, "none"), encoding="utf-8").close()
            with contextlib.redirect_stderr(io.StringIO()) as said, self.assertRaises(SystemExit) as end:
                study_support.run_study(main)
            self.assertEqual(end.exception.code, 2)
            self.assertIn(f"{place}/none: No such file or directory\n", said.getvalue())

    def test_programs_of_tests(self):
        """A study that runs a program of the tests names it in the line that the launcher reads."""
        pattern = re.search(r"sed -n 's/\^(TEST_PROGRAM = .*)\$/", Path(SOURCE, "gravier").read_text(encoding="utf-8"))[1]
        pattern = re.compile("^" + pattern.replace("\\(", "(").replace("\\)", ")") + "$", re.MULTILINE)
        named = {}
        for path in sorted(Path(SOURCE, "drivers/studies").glob("*.py")):
            text = path.read_text(encoding="utf-8")
            if re.search(r"tests\W+bin", text) or "TEST_PROGRAM" in text:
                named[path.name] = pattern.findall(text)
        self.assertIn("study_manifolds.py", named)
        for name, programs in named.items():
            self.assertEqual(len(programs), 1, name)
            kind, test = programs[0].removeprefix("test_").split("_", 1)
            self.assertTrue(Path(SOURCE, "tests", kind, f"test_{test}.f90").is_file(), programs[0])

    def test_quick_forms_and_statuses(self):
        """Each study has --quick, says its exit status, and ends with that of a table."""
        for name, text in names():
            with self.subTest(name):
                main = text[text.index("\ndef main("):]
                self.assertTrue(re.search(r'add_argument\("--quick"', text), "has no --quick")
                self.assertTrue(re.search(r"(?is)exit\s+status|ends with\s+status|the status\s+is", text),
                                "does not say its status")
                self.assertTrue(re.search("|".join(ENDS), main, re.MULTILINE), "does not end with the status of its table")
                self.assertIn("    run_study(main)", text, "does not leave its status")


class ClosingTable(unittest.TestCase):
    """The table by which studies end, and those of single studies with values that are held and with one that is not."""

    def scratch(self):
        """A directory that goes with the test."""
        place = tempfile.TemporaryDirectory(prefix="gravier-studies-")
        self.addCleanup(place.cleanup)
        return place.name

    def close(self, *rows):
        table = Bounds()
        for row in rows:
            table.add(*row)
        return judged(table.close)

    def test_rows(self):
        good, low = ("a", 1.0, 0.5, 1.5, "law"), ("b", 0.4, 0.5, 1.5, "law")
        status, said = self.close(good)
        self.assertEqual(status, 0)
        self.assertRegex(said, r"a +\| 1 +\| 0\.5 to 1\.5 +\| law +\| held")
        self.assertIn("1 of 1 within their bounds", said)
        status, said = self.close(good, low)
        self.assertEqual(status, 1)
        self.assertRegex(said, r"b +\| 0\.4 .*\| missed")
        for value in (1.6, np.nan, np.inf, -np.inf):
            self.assertEqual(self.close(("c", value, 0.5, 1.5, "law"))[0], 1, value)
        self.assertEqual(self.close(("d", 9.0, 0.5, None, "law"))[0], 0)
        self.assertEqual(self.close(("d", 0.4, 0.5, None, "law"))[0], 1)
        self.assertEqual(self.close(("e", -9.0, None, 1.5, "law"))[0], 0)
        self.assertEqual(self.close(("e", 1.6, None, 1.5, "law"))[0], 1)
        self.assertEqual(self.close(("f", np.nan, None, 1.5, "law"))[0], 1)
        # nothing compared is nothing shown
        self.assertEqual(self.close()[0], 1)

    def breaks(self, function, good, changes):
        """A table of the good values is held; each change of one of them breaks it."""
        status, said = judged(function, good)
        self.assertEqual(status, 0, said)
        for name, value in changes.items():
            status, said = judged(function, {**good, name: value})
            self.assertEqual((status, len(re.findall(r"\| missed$", said, re.MULTILINE))), (1, 1), f"{name} {value}\n{said}")

    def test_silo(self):
        self.breaks(study_silo.accepted, {
            "largest_difference": 0.05, "bottom_stress_over_law": 0.97, "bottom_stress_over_hydrostatic": 0.3,
            "saturation_most": 0.46,
            "weight_borne": 1.0, "friction_mobilised": 0.23, "K_measured": 1.16, "K_fitted": 0.53},
            {"largest_difference": 0.2, "bottom_stress_over_law": 1.2, "bottom_stress_over_hydrostatic": 0.9, "weight_borne": 0.9,
             "K_fitted": 0.7})

    def test_silo_profiles(self):
        """Means are of the steps after the warming alone; depths are from the top; forces are per step."""
        late = study_silo.SETTLING + study_silo.WARMING
        lower = np.array([[0.0, 0.1 * k] for k in range(4)])
        layers = SimpleNamespace(lower=lower, upper=lower + [0.15, 0.1], centre=lower + [0.075, 0.05], solid_fraction=np.full(4, 0.8),
                                 stress=np.array([np.diag([k, 10.0 * k]) for k in (4.0, 3.0, 2.0, 1.0)]))
        asked = []
        found = SimpleNamespace(steps=[0, late, late + 100, late + 200], region_mean=lambda name, steps: asked.append((name, steps)) or layers)
        history = {"step": np.array([late, late + 1, late + 2]), "force_y:floor": np.array([-99.0, -1.0, -2.0]),
                   "force_y:left": np.array([99.0, -3.0, -5.0]), "force_y:right": np.array([99.0, -1.0, -1.0]),
                   "force_x:left": np.array([99.0, -8.0, -8.0]), "force_x:right": np.array([99.0, 10.0, 10.0])}
        with mock.patch.object(study_silo.gravier, "Run", lambda folder: found), mock.patch.object(study_silo, "read_history", lambda folder: history):
            depth, vertical, lateral, load, floor, held, pushed = study_silo.profiles("silo")
        self.assertEqual(asked, [("layers", [late + 100, late + 200])])
        np.testing.assert_allclose(depth, [0.05, 0.15, 0.25, 0.35])
        np.testing.assert_allclose(vertical, [10.0, 20.0, 30.0, 40.0])
        np.testing.assert_allclose(lateral, [1.0, 2.0, 3.0, 4.0])
        np.testing.assert_allclose(load, 0.8 * study_silo.DENSITY * 9.81 * depth)
        np.testing.assert_allclose([floor * study_silo.WIDTH, held, pushed], [1.5, 5.0, 18.0])

    def test_hopper(self):
        def judge(given):
            return study_hopper.accepted(2, study_hopper.PLANE, given["exponent"], given["k"], given["C"],
                                         [(given["change"], 0.01)] * 4)
        self.breaks(judge, {"exponent": 1.52, "k": 1.6, "C": 1.05, "change": 0.02},
                    {"exponent": 1.7, "k": 0.9, "C": 1.5, "change": -0.3})

    def test_collapse(self):
        ratio = np.array([0.4, 0.8, 4.0, 8.0])
        chosen = {"flat": ratio < 2.0, "tall": ratio > 3.0}

        def judge(given):
            out = np.concatenate([given["flat"] * ratio[:2]**given["by"], given["tall"] * ratio[2:]**given["to"]])
            slopes = {"flat": (given["by"], 0.0), "tall": (given["to"], 0.0)}
            return study_collapse.accepted(2, (ratio, out, np.full(4, 1e-3)), chosen, slopes)
        self.breaks(judge, {"flat": 2.0, "tall": 2.5, "by": 1.0, "to": 0.67}, {"flat": 4.0, "tall": 5.0, "by": 1.2, "to": 0.5})

    def test_end_of_a_heap(self):
        """The end of three rows of disks goes with the last disk, not from bin to bin; a cone of spheres ends where its layers do."""
        radius, wide = 0.005, 4.0

        def beyond(last, places):
            x = np.arange(last, 0.0, -2.0 * radius)
            rows = np.concatenate([np.column_stack([x, np.full_like(x, y)]) for y in (1.0, 3.0, 5.0)])
            return study_collapse.length_of(rows, np.full(len(rows), radius), wide, places) - last
        ends = np.linspace(0.5013, 0.5213, 9)
        found = np.array([beyond(last, 20) for last in ends])
        self.assertLess(np.ptp(found), 1.01 * wide * radius / 20)
        self.assertLess(np.abs(found).max(), wide * radius)
        # one bin alone knows the end to its width
        self.assertGreater(np.ptp([beyond(last, 1) for last in ends]), 0.7 * wide * radius)
        # six layers of spheres at random, of which none is about the axis
        rng = np.random.default_rng(5)
        place = rng.uniform(-0.2, 0.2, (9600, 3))
        distance = np.hypot(place[:, 0], place[:, 1])
        place = place[(distance < 0.2) & (distance > 1.5 * radius)]
        self.assertAlmostEqual(study_collapse.length_of(place, np.full(len(place), radius), 1.0), 0.2, delta=wide * radius)

    def test_drum(self):
        time = np.linspace(0.0, 14.0, 1401)

        def judge(given):
            angles = given["angle"] + np.tile([1.0, -1.0], 300) + np.repeat([0.0, given["more"]], 300)
            return study_drum.accepted({"time": time, "boundary_work": given["power"] * time}, angles, np.full(600, 3.0))
        self.breaks(judge, {"angle": 25.0, "more": 0.0, "power": 3.0}, {"angle": 35.0, "more": 5.0, "power": 3.5})

    def test_biaxial(self):
        good = {"solid_fraction_inner": 0.845, "coordination_mu0": 3.97, "pressure_right": 1.0, "pressure_lid": 1.0,
                "sin_phi": 0.29,
                "sin_phi_peak": 0.42, "solid_fraction_last": 0.81, "solid_fraction_box": 0.844,
                "largest_overlap_over_radius": 0.011}
        self.breaks(lambda given: study_biaxial.accepted(given, 5000), good, {
            "solid_fraction_inner": 0.8, "coordination_mu0": 4.5, "pressure_right": 1.1, "pressure_lid": 0.9, "sin_phi": 0.32,
            "sin_phi_peak": 0.2, "solid_fraction_box": 0.8, "largest_overlap_over_radius": 0.02})
        self.assertEqual(judged(study_biaxial.accepted, {**good, "sin_phi": 0.32}, 600)[0], 0)

    def test_solver_of_biaxial(self):
        """The velocity error ends solves of the compression, unless a residual is told."""
        place, made = Path(self.scratch()), []
        options = SimpleNamespace(out=place, rate=0.01, strain=0.15, step=2e-3, tolerance=None, max_iterations=400, acceleration="none")
        with mock.patch.object(study_biaxial, "run", lambda folder, groups, walls: made.append(groups["solver"])):
            for options.tolerance in (None, 1e-3):
                study_biaxial.compress(options, np.array([[0.01, 0.01]]), np.array([0.01]), np.array([1.0, 1.0]))
        self.assertEqual(made[0], {})
        self.assertEqual((made[1]["criterion"], made[1]["tolerance"], made[1]["max_iterations"], made[1]["acceleration"]),
                         ("residual", 1e-3, 400, "none"))

    def test_drift(self):
        def judge(given):
            rows, curves = [], {}
            for name in ("disks", "piston"):
                for projection in (0, 1):
                    rows.append({"run": name, "tolerance": 1e-2, "projection": projection, "projection_work": given["work"],
                                 "largest_overlap": given["without"], "kinetic_energy": given["energy"]})
                    # a step that is projected, and one that is not, whose residual lets an approach pass
                    curves[name, 1e-2, bool(projection)] = {
                        "step": np.arange(4),
                        "max_overlap": study_drift.ALLOWED * np.array([2.0, 2.0, given["after"], given["later"]]),
                        "projected": np.array([1, 1, 0, 0]), "residual": np.full(4, given["residual"]),
                        "force_mean": np.full(4, 100.0), "force_deviation": np.ones(4), "contacts": np.full(4, 900)}
            return study_drift.accepted(rows, curves)
        good = {"work": 0.0, "after": 0.9, "later": 1.25, "residual": 1e-2, "without": 0.1, "energy": 1e-5}
        self.breaks(judge, good, {"without": 0.01, "energy": 1e-3})
        for change in ({"work": 0.1}, {"after": 1.4, "later": 0.5}, {"residual": 1e-4}, {"after": 1.0}):
            self.assertEqual(judged(judge, {**good, **change})[0], 1, change)

    def test_choice(self):
        def judge(given):
            return study_choice.accepted([{"scene": "settling", "step": 1e-3, "accuracy": 0.1, "quantity": "q",
                                           "standard_error": 0.015, **given}])
        self.breaks(judge, {"deviation": 0.04, "missed": 0.0}, {"deviation": 0.05, "missed": 0.01})
        # figures that scatter too much say nothing
        self.assertEqual(judged(judge, {"deviation": 1.9, "missed": 0.0, "standard_error": 0.7})[0], 1)

    def test_convergence(self):
        def of_newton(given):
            table = Bounds()
            bounds_of_convergence.of_newton(table, [{"friction": 0.3, "ends by": "error 0.1", "method": method, "converged": 1,
                                                     "error": given["error"]
                                                     if method == "nlgs" else 0.09, "iterations": given[method]}
                                                     for method in ("nlgs", "newton")])
            return table.close()
        self.breaks(of_newton, {"error": 0.09, "nlgs": 47, "newton": 47}, {"error": 0.2, "newton": 60})

        def of_heights(given):
            table = Bounds()
            bounds_of_convergence.of_heights(table, [{"by": "momentum", "high": high, "momentum: sweeps to true error 0.1": sweeps,
                                                      "program: sweeps to true error 0.1": "-" if given["lost"] else sweeps,
                                                      "true error at the end": given["error"] if high == 10 else 0.05}
                                                     for high, sweeps in ((10, 34), (20, given["sweeps"]))])
            return table.close()
        good = {"sweeps": 66, "lost": False, "error": 0.05}
        self.breaks(of_heights, good, {"error": 0.2})
        for change in ({"sweeps": 200}, {"lost": True}):
            self.assertEqual(judged(of_heights, {**good, **change})[0], 1)

    def test_methods(self):
        def judge(given):
            same = {"packing": "disks 1e3", "friction": "0.3", "subdomains": "8", "sweeps": "3", "momentum": "True"}
            rows = [{**same, "method": method, "direction": direction, "to error 0.3": given[method], "to 0.001": ""}
                    for method, direction in (("nscdd", ""), ("nscdd_ep", "automatic"))]
            columns = [{"method": "NSCDD-EP, l = 1e4, all", "sweeps": "10", "subdomains": str(n), "iterations": found}
                       for n, found in ((2, given.get("fewest", "8")), (16, given["columns"]), (64, "45"))]
            return bounds_of_methods.accepted(rows, columns, {"disks": {"newton": given["apart"]}})
        good = {"nscdd": "74", "nscdd_ep": "24", "columns": "10", "apart": 1e-3}
        self.breaks(judge, good, {"nscdd_ep": "50", "columns": "20", "apart": 1e-2})
        # where one of both does not get there
        self.assertEqual(judged(judge, {**good, "nscdd": ""})[0], 0)
        self.assertEqual(judged(judge, {**good, "nscdd_ep": ""})[0], 1)
        # columns no solve of which ends
        self.assertEqual(judged(judge, {**good, "columns": "", "fewest": ""})[0], 1)

    def test_hard(self):
        def judge(given):
            options = SimpleNamespace(broken=[None, ("tower, light on heavy", "nlgs", 1) if given["broken"] else None],
                                      apart=[given["apart"]])
            return study_hard.accepted(options,
                                       [{"case": "tower, light on heavy", "method": "nlgs", "ranks": 1, "status": given["status"]}])
        self.breaks(judge, {"broken": False, "apart": False, "status": "converged"},
                    {"broken": True, "apart": True, "status": "3 of 10 steps"})

    def test_nothing_compared(self):
        """A study of cases that there are none of is refused; estimates none of which has a true error beside it are a failure."""
        place = self.scratch()
        for arguments, words in ((("--cases", "nosuch"), "--cases nosuch: no case has a name that matches"),
                                 (("--cases", "tower", "--methods", "nosuch"), "--methods nosuch: expected one of ")):
            done = subprocess.run([sys.executable, os.path.join(SOURCE, "drivers/studies/study_hard.py"), "--out", place, *arguments],
                                  capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 2, done.stdout)
            self.assertIn(words, done.stderr)
        with contextlib.redirect_stdout(io.StringIO()):
            self.assertIn("nothing is compared", " ".join(study_error.judge_estimate([], Path(place))))
            self.assertIn("no scene has it in its name", " ".join(study_error.study_estimate(Path(place), True, "nosuch")))

    def test_directories_of_others(self):
        """What no study has made stays; a directory of an older study is emptied."""
        place = study_support.claimed(self.scratch())
        (place / "cube").mkdir()
        (place / "cube/mine.txt").write_text("mine")
        done = subprocess.run([sys.executable, os.path.join(SOURCE, "drivers/studies/study_platonic.py"), "--out", str(place), "--solids", "cube", "--count", "20"],
                              capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, len(done.stderr.splitlines())), (2, 1), done.stderr)
        self.assertIn("cube: there is something that no study has made, which is not replaced; expected another --out", done.stderr)
        self.assertEqual([path.name for path in (place / "cube").iterdir()], ["mine.txt"])
        made = study_support.emptied(place / "own")
        (made / "older.txt").write_text("older")
        self.assertEqual([path.name for path in study_support.emptied(made).iterdir()], [study_support.MARK])

    def test_lmgc90(self):
        def judge(given):
            return study_lmgc90.accepted([{"example": "RIGID_3D/Wall_PR", "lacks": "", **given}])
        self.breaks(judge, {"imports": "yes", "steps": 20, "status": "0"}, {"imports": "no", "steps": 0, "status": "4"})
        self.assertEqual(judged(study_lmgc90.accepted, [])[0], 1)
        # one of the page that has a script in the place of a DATBOX counts only where there is a pre-processor
        wall = {"example": "RIGID_3D/Wall_PR", "imports": "yes", "steps": 20, "status": "0", "lacks": ""}
        for lacks, status in ((f"gen_sample.py {study_lmgc90.UNTRIED}", 0), ("gen_sample.py: more than 300 s", 1)):
            ball = {"example": "RIGID_3D/1SP_PL", "imports": "no", "steps": "", "status": "", "lacks": lacks}
            self.assertEqual(judged(study_lmgc90.accepted, [wall, ball])[0], status, lacks)

    def test_page_of_hard_cases(self):
        """Cases that all methods solve are named, and the others have a line each."""
        names = list(study_hard.cases())[:3]
        rows = [{"case": name, "method": method, "status": "converged", "wrong": "", "iterations": 10} for name in names for method in ("nlgs", "schwarz")]
        rows[3]["status"], rows[5]["wrong"] = "not converged in 1 of 2 steps", "cone"
        text = study_hard.page(rows)
        self.assertIn(f"solve 1 of the 3 cases: {names[0]}. These", text)
        self.assertEqual(re.findall(r"(?m)^\| (.*?) \|", text)[1:], names[1:])
        self.assertIn("**cone**", text)

    def test_loop(self):
        good = {"ratio": 1.03, "error": 0.008, "differ": 0, "compared": 90}
        for quick in (False, True):
            self.breaks(lambda given, quick=quick: study_loop.accepted(given, quick), good, {"ratio": 1.05, "differ": 1, "error": 0.05})
        self.assertEqual(judged(study_loop.accepted, {**good, "error": 0.02, "ratio": 1.0}, False)[0], 1)
        # what the forms tell at their largest errors
        for quick, error, ratio in ((False, 0.01, 1.041), (True, 0.04, 1.101)):
            self.assertEqual(judged(study_loop.accepted, {**good, "error": error, "ratio": ratio}, quick)[0], 1)
        # starts and other work of a pair cancel: steps of 2 and 3 s after starts of 10 and 20 s, on a machine that is slower by factors
        slower = np.array([1.0, 1.5, 0.7, 2.0])[:, None]
        seconds = [slower * (np.array([10.0, 20.0]) + number * np.array([2.0, 3.0])) for number in (10, 50)]
        row = study_loop.measured(4, (10, seconds[0]), (50, seconds[1]))
        self.assertAlmostEqual(row["ratio"], 1.5)
        self.assertAlmostEqual(row["error"], 0.0)
        self.assertAlmostEqual(row["start"], 12.5)
        self.assertAlmostEqual(row["program"], 2.5)

    def test_side_by_side(self):
        good = {"example": "wall", "mass_ratio": 1.0, "mean_force_on_ground_over_weight_gravier": 0.98,
                "mean_force_on_ground_over_weight_lmgc90": 1.0,
                "forces_found": 1.0, "moved_gravier": 0, "moved_lmgc90": 0, "steps": 20, "largest_difference_over_size": 1e-3,
                "median_difference_over_size": 1e-3, "energy_gravier": 1.1, "energy_lmgc90": 1.0}
        bad = {"mass_ratio": 0.98, "mean_force_on_ground_over_weight_gravier": 0.5, "forces_found": 0.5}
        self.breaks(lambda given: study_side_by_side.accepted([given], False), good, {**bad, "largest_difference_over_size": 0.1})
        self.breaks(lambda given: study_side_by_side.accepted([given], False), {**good, "steps": 100},
                    {**bad, "median_difference_over_size": 0.1, "energy_gravier": 2.0})
        self.breaks(lambda given: study_side_by_side.accepted([given], True), good, {**bad, "moved_gravier": 29})


if __name__ == "__main__":
    unittest.main()
