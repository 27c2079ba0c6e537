"""Only what belongs to the project is in the repository: nothing that a test or a run has left. Texts of the build fit into lines of Fortran."""
import os
import re
import subprocess
import tempfile
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


class TextsOfTheBuild(unittest.TestCase):

    def test_paths_of_every_length(self):
        """A source tree may have a path of any length: what CMake writes for the longest declaration has at most 132 columns, and is the path."""
        with open(os.path.join(SOURCE, "cmake/build_info.f90.in"), encoding="utf-8") as file:
            declaration = max(re.findall(r"(?m)^(  character.* = )@", file.read()), key=len)
        paths = ["/" + "d" * (length - 1) for length in range(1, 260)]
        with tempfile.TemporaryDirectory() as scratch:
            script = os.path.join(scratch, "texts.cmake")
            with open(script, "w", encoding="utf-8") as file:
                file.write(f"cmake_minimum_required(VERSION 3.20)\ninclude({SOURCE}/cmake/FortranText.cmake)\n")
                file.writelines(f'fortran_text(text "{path}")\nfile(APPEND {scratch}/texts "${{text}}\\n")\n' for path in paths)
            subprocess.run(["cmake", "-P", script], check=True, timeout=60)
            with open(os.path.join(scratch, "texts"), encoding="utf-8") as file:
                texts = re.sub(r" &\n    & //", "\0", file.read()).splitlines()
        self.assertEqual(len(texts), len(paths))
        for text, path in zip(texts, paths):
            pieces = text.split("\0")
            self.assertLessEqual(len(declaration) + len(pieces[0]) + len(" &"), 132, path)
            self.assertTrue(all(len("    & //") + len(piece) + len(" &") <= 132 for piece in pieces[1:]), path)
            self.assertEqual("".join(piece[1:-1] for piece in pieces), path)


if __name__ == "__main__":
    unittest.main()
