"""`./gravier study NAME` needs no further words: each study writes in out/NAME, or in the directory of --out."""
import os
import re
import unittest
from pathlib import Path

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
#: studies that write nothing or, unless asked, only in a directory that goes
NO_FILES = {"manifolds", "dem", "masonry"}
#: studies of files that a user has to name
NAMED = {"lmgc90": "examples", "side_by_side": "examples", "communication": "bodies"}


class Studies(unittest.TestCase):

    def test_outputs(self):
        names = set()
        for path in sorted(Path(SOURCE, "drivers/studies").glob("study_*.py")):
            name, text = path.stem.removeprefix("study_"), path.read_text(encoding="utf-8")
            if name == "support":
                continue
            names.add(name)
            with self.subTest(name):
                positional = re.findall(r'add_argument\("(\w+)"', text)
                self.assertEqual(positional, [NAMED[name]] if name in NAMED else [])
                if name not in NO_FILES:
                    self.assertRegex(text, rf'add_argument\("--out", .*default=(?:Path\()?"out/{name}"')
        self.assertGreater(len(names), 15)
        self.assertLessEqual(NO_FILES | set(NAMED), names)


if __name__ == "__main__":
    unittest.main()
