"""Every module of the library is used by name in a test program: one of tests/unit, tests/parallel or tests/verification."""
import glob
import os
import re
import subprocess
import sys
import unittest

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
KINDS = ("unit", "parallel", "verification")
#: modules that no test program uses by their own name, and the test of what they do
EXCEPTIONS = {
    # gravier_hdf5_file is made of them, by extension of types
    **dict.fromkeys(("gravier_hdf5_tree", "gravier_hdf5_attributes", "gravier_hdf5_properties",
                     "gravier_hdf5_rows", "gravier_hdf5_storage", "gravier_hdf5_tables"), "parallel/io/test_io_hdf5_file.f90"),
    # gravier_problem_builder is the one that packs contacts
    "gravier_contact_packing": "parallel/step/test_problem_builder.f90",
    # gravier_bodies_file is the door to both formats
    **dict.fromkeys(("gravier_bodies_csv", "gravier_bodies_hdf5"), "parallel/bodies/test_io_bodies_file.f90"),
    # h5py reads what it writes
    "gravier_vtkhdf_file": "hard/test_run_vtk.py",
    # it ends all processes
    "gravier_abandon": "verification/test_run_loop_refusals.py",
    # the linker calls it where memory ends
    "gravier_own_allocations": "hard/test_run_too_large.py",
}


def sources(folder):
    """Texts of the Fortran sources and templates below a folder, by path."""
    found = {}
    for path in sorted(path for kind in ("*.[fF]90", "*.fypp")
                       for path in glob.glob(os.path.join(SOURCE, folder, "**", kind), recursive=True)):
        with open(path, encoding="utf-8") as file:
            found[os.path.relpath(path, SOURCE)] = file.read()
    return found


def modules():
    """Names of the modules of the library, by their files."""
    names = {}
    for path, text in sources("modules").items():
        for name in re.findall(r"^\s*module\s+(gravier_\w+)\s*$", text, re.M):
            names[name] = path
    return names


def used():
    """Names of the modules that test programs use directly."""
    found = set()
    for kind in KINDS:
        for text in sources(os.path.join("tests", kind)).values():
            found |= set(re.findall(r"^\s*use\s*(?:::)?\s*(gravier_\w+)", text, re.M))
    return found


class ModuleTests(unittest.TestCase):

    def test_every_module_is_used(self):
        names = modules()
        self.assertGreater(len(names), 100, "modules are found")
        without = [f"{name} ({names[name]})" for name in sorted(set(names) - used() - set(EXCEPTIONS))]
        self.assertEqual(without, [], "modules without a direct test; write one (doc/developer_guide.md, 'A test')")

    def test_exceptions_are_needed(self):
        self.assertEqual(sorted(set(EXCEPTIONS) - set(modules())), [], "exceptions that are no modules")
        self.assertEqual(sorted(set(EXCEPTIONS) & used()), [], "exceptions that have a direct test")
        for test in EXCEPTIONS.values():
            self.assertTrue(os.path.isfile(os.path.join(SOURCE, "tests", test)), test)

    def test_changes_are_in_place(self):
        """Each change by which the power of the tests is measured still applies to its file."""
        listed = subprocess.run([sys.executable, os.path.join(SOURCE, "tests/support/power_of_tests.py"), "--list"], capture_output=True,
                                text=True, check=False)
        self.assertEqual(listed.returncode, 0, listed.stderr)


if __name__ == "__main__":
    unittest.main()
