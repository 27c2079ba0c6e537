"""No statement gives a text a later part of itself, text = text(3:). gfortran makes the text shorter before it moves the characters, and the last
of them may be lost: a log said "in step 5!" in place of "in step 51". text_from in modules/base/core/text.f90 is for this."""
import glob
import os
import re
import unittest

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
#: a name gets a part of itself that does not begin with its first character
SHORTENED = re.compile(r"(?<![\w%])([a-z][\w%]*) = \1\((?!1?:)[^:\n]+:[^:\n]*\)[ \t]*(?:!.*)?$", re.MULTILINE)


class ShortenedTexts(unittest.TestCase):

    def test_no_statement(self):
        self.assertEqual([match[0] for match in SHORTENED.finditer("  text = text(3:)\n  if (a) self%b = self%b(k + 1:) ! c\n")],
                         ["text = text(3:)", "self%b = self%b(k + 1:) ! c"])
        self.assertEqual(SHORTENED.findall("  text = text(:3)\n  text = text(1:n)\n  text = text(3:)//'a'\n  text = text_from(text, 3)\n"), [])
        found, files = [], 0
        for folder in ("modules", "src", "drivers", "tests"):
            for ending in ("*.[fF]90", "*.fypp", "*.fypi"):
                for path in glob.glob(os.path.join(SOURCE, folder, "**", ending), recursive=True):
                    files += 1
                    with open(path, encoding="utf-8") as file:
                        found += [f"{os.path.relpath(path, SOURCE)}: {match[0]}" for match in SHORTENED.finditer(file.read())]
        self.assertGreater(files, 300)
        self.assertEqual(found, [])


if __name__ == "__main__":
    unittest.main()
