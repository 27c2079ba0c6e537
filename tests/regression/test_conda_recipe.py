"""The conda recipe: rattler-build renders it, and refuses a wrong field; it has the version of the program and the packages of the environment
that the launcher asks for."""
import os
import re
import subprocess
import unittest
from pathlib import Path

from gravier_runs import SOURCE, RunTestCase

PACKAGING = Path(SOURCE) / "cmake/packaging"
RECIPE = PACKAGING / "conda/recipe.yaml"
PYTHON = os.environ.get("GRAVIER_DOCS_PYTHON", "")
RENDER = """import sys, rattler_build
for one in rattler_build.Stage0Recipe.from_yaml(sys.stdin.read()).render(rattler_build.VariantConfig()):
    print(one)
"""


def has_rattler():
    return bool(PYTHON) and subprocess.run([PYTHON, "-c", "import rattler_build"], capture_output=True, check=False).returncode == 0


def packages(text):
    """Names of the packages of a list in YAML, without their versions."""
    return set(re.findall(r"^ *- ([\w-]+)[^\n/]*$", text, re.M))


class Recipe(RunTestCase):

    def test_version_and_packages(self):
        text = RECIPE.read_text(encoding="utf-8")
        cmake = (Path(SOURCE) / "CMakeLists.txt").read_text(encoding="utf-8")
        self.assertEqual(re.search(r'^  version: "([\d.]+)"', text, re.M)[1], re.search(r"project\(gravier VERSION ([\d.]+)", cmake)[1])
        environment = (PACKAGING / "environment.yml").read_text(encoding="utf-8").split("dependencies:")[1]
        needed = {"matplotlib-base" if name == "matplotlib" else name for name in packages(environment)} - {"c-compiler", "fortran-compiler"}
        self.assertEqual(packages(re.search(r"^requirements:\n(.*?)^tests:", text, re.M | re.S)[1]), needed)
        # both want the build of HDF5 with MPI
        self.assertIn("- hdf5 * mpi_openmpi*\n", text)

    @unittest.skipUnless(has_rattler(), "NO RATTLER-BUILD: the conda recipe was not rendered; pip install py-rattler-build for GRAVIER_DOCS_PYTHON")
    def test_rendered(self):
        text = RECIPE.read_text(encoding="utf-8")

        def render(recipe):
            return subprocess.run([PYTHON, "-c", RENDER], input=recipe, capture_output=True, text=True, check=False)
        done = render(text)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("package='gravier', version='" + re.search(r'^  version: "([\d.]+)"', text, re.M)[1], done.stdout)
        for right, wrong in (("  host:\n", "  hosts:\n"), (">=3.20", ">>3.20"), ("compiler('c')", "kompiler('c')"), ("license: BSD-3-Clause", "license: BSD 3")):
            self.assertIn(right, text)
            self.assertNotEqual(render(text.replace(right, wrong)).returncode, 0, wrong)


if __name__ == "__main__":
    unittest.main()
