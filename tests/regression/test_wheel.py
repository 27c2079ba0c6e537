"""The wheel of the Python package: it has what the tree has, and its commands run where nothing else of the tree is."""
import os
import re
import shutil
import subprocess
import sys
import unittest
import zipfile
from pathlib import Path

from gravier_runs import SOURCE, RunTestCase

import gravier
from gravier import commands

DRIVERS = Path(SOURCE) / "drivers"
try:
    from setuptools import build_meta
except ImportError:
    build_meta = None


class Wheel(RunTestCase):

    def test_lists(self):
        """The version of the program; each script gravier_NAME.py is a command, and its folder is in the wheel."""
        text = (DRIVERS / "pyproject.toml").read_text(encoding="utf-8")
        cmake = (Path(SOURCE) / "CMakeLists.txt").read_text(encoding="utf-8")
        self.assertEqual(re.search(r'^version = "([\d.]+)"', text, re.M)[1], re.search(r"project\(gravier VERSION ([\d.]+)", cmake)[1])
        scripts = {path.stem: path.parent.name for path in DRIVERS.glob("*/gravier_*.py")}
        self.assertGreater(len(scripts), 3)
        self.assertEqual(dict(re.findall(r'^(gravier_\w+) = "gravier.commands:(\w+)"', text, re.M)), {name: name for name in scripts})
        for name, folder in scripts.items():
            self.assertIn(f'"gravier.scripts.{folder}"', re.search(r"^packages = .*$", text, re.M)[0])
            self.assertIn(f'"gravier.scripts.{folder}" = "{folder}"', text)
            self.assertTrue(callable(getattr(commands, name)))
            self.assertEqual(commands.script_path(name), DRIVERS / folder / f"{name}.py")

    @unittest.skipUnless(build_meta and shutil.which("python3"), "no setuptools; expected a python3 with setuptools (apt install python3-setuptools)")
    def test_built_and_unpacked(self):
        """Built of a copy, unpacked alone: `import gravier` and each command, without the tree."""
        copy = self.here("drivers")
        shutil.copytree(DRIVERS, copy, ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
        build = f"from setuptools import build_meta; print(build_meta.build_wheel({self.here()!r}))"
        done = subprocess.run([sys.executable, "-c", build], cwd=copy, capture_output=True, text=True, check=False)
        if "error: invalid command 'bdist_wheel'" in done.stderr:
            self.skipTest("setuptools without wheel; expected a python3 with wheel (apt install python3-wheel)")
        self.assertEqual(done.returncode, 0, done.stderr)
        name = done.stdout.splitlines()[-1]
        self.assertRegex(name, r"^gravier-[\d.]+-py3-none-any\.whl$")
        site = self.here("site")
        with zipfile.ZipFile(self.here(name)) as wheel:
            held = set(wheel.namelist())
            wheel.extractall(site)
        shutil.rmtree(copy)
        self.assertTrue(any(path.endswith("LICENSE") for path in held))
        for folder in ("plot", "report", "import", "blocks", "measure", "join", "rough_walls"):
            for path in (DRIVERS / folder).glob("*.py"):
                self.assertIn(f"gravier/scripts/{folder}/{path.name}", held)
        for path in (DRIVERS / "python/gravier").glob("*.py"):
            self.assertIn(f"gravier/{path.name}", held)
        self.assertEqual(gravier.run({"scene": {"bodies": "column", "column_count": 3, "radius": 0.5, "mass": 2.0}, "time": {"step": 1e-2, "steps": 2},
                                      "output": {"directory": "results"}}, self.here("run")), 0)
        for command, arguments, status, words in (
                ("gravier_plot", ["packing", "run/results", "--dpi", "60"], 0, "run/results/packing.png"),
                ("gravier_report", ["run/results"], 0, "run/results/report.html"),
                ("gravier_measure", ["heap", "run/results"], 0, "run/results/heap.csv"),
                ("gravier_join", ["nothing.h5", "nothing.h5", "--out", "joined.h5"], 2, "gravier_join: error: nothing.h5: no such file"),
                ("gravier_rough_walls", ["nothing.h5", "--sides", "-y", "--out", "rough.h5"], 2, "gravier_rough_walls: error: nothing.h5: no such file"),
                ("gravier_blocks", ["wall", "--bricks", "2", "--courses", "2", "--size", "0.2", "0.1"], 0, "wall.shapes"),
                ("gravier_import", ["nothing", "--step", "1e-3"], 2, "gravier_import: error: ")):
            # as the wheel's script in bin/ does
            start = f"import sys, os; sys.argv[0] = {command!r}; from gravier.commands import {command} as start; " \
                    "import gravier; assert gravier.__file__.startswith(os.environ['PYTHONPATH']); sys.exit(start())"
            done = subprocess.run([sys.executable, "-c", start, *arguments], cwd=self.scratch, capture_output=True, text=True, check=False,
                                  env={**os.environ, "PYTHONPATH": site})
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertIn(words, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
