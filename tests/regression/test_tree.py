"""Only what belongs to the project is in the repository: nothing that a test or a run has left."""
import os
import subprocess
import unittest

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
TOP = {".ci", ".fprettify.rc", ".gitignore", "CHANGELOG.md", "CITATION.cff", "CMakeLists.txt", "CMakePresets.json", "CONTRIBUTING.md",
       "LICENSE", "README.md", "cmake", "data", "doc", "drivers", "fortitude.toml", "gravier", "mkdocs.yml", "modules",
       "src", "tests"}
#: endings of what programs write
WRITTEN = (".h5", ".bad", ".vtkhdf", ".log", ".mod", ".o", ".pyc")
#: folders with inputs and references that are such files
REFERENCES = ("data/", "tests/", "doc/")


def tracked():
    done = subprocess.run(["git", "ls-files", "-z"], cwd=SOURCE, capture_output=True, text=True, check=False)
    return [name for name in done.stdout.split("\0") if name] if done.returncode == 0 else []


@unittest.skipUnless(tracked(), "not a repository")
class Tree(unittest.TestCase):

    def test_top_level(self):
        self.assertEqual(sorted({name.split("/")[0] for name in tracked()} - TOP), [], "files of the top level that are not of the project")

    def test_nothing_written_is_kept(self):
        left = [name for name in tracked() if name.endswith(WRITTEN) and not name.startswith(REFERENCES)]
        self.assertEqual(left, [], "files that a program has written")


if __name__ == "__main__":
    unittest.main()
