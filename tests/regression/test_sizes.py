"""Files and procedures stay short enough to be read: at most 500 lines a file, 80 lines a procedure with those within it, unless its comment
says why it `is long`, and seven arguments; lines have at most 132 characters, comments too."""
import os
import re
import unittest
from pathlib import Path

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
FILE, PROCEDURE, ARGUMENTS, LINE = 500, 80, 7, 132
#: kernels take packed arrays and numbers one by one, so that the compiler sees that these do not overlap
KERNELS = ("modules/solver/kernels/", "modules/contact/local/find_frame.fypi")
BEGIN = re.compile(r"^\s*(?!end\b)(?:[\w()=, ]+\s)?(?:subroutine|function)\s+([\w${}]+)\s*(\([^)]*\)?)?")
END = re.compile(r"^\s*end (?:subroutine|function)\b")


def sources():
    for folder in ("modules", "src", "drivers"):
        for path in sorted(Path(SOURCE, folder).rglob("*")):
            if path.suffix in (".f90", ".fypp", ".fypi"):
                yield path


def procedures(lines):
    """(name, first line, last line, number of arguments, the comment before it) of the procedures that are not within another, nor
    declared in an interface."""
    depth, interface = 0, False
    for number, line in enumerate(lines, 1):
        if re.match(r"^\s*(abstract )?interface\b", line):
            interface = True
        if re.match(r"^\s*end interface\b", line):
            interface = False
        if interface or line.lstrip().startswith("!"):
            continue
        if END.match(line):
            depth -= 1
            if depth == 0:
                yield name, first, number, arguments, comment
        elif BEGIN.match(line) and "procedure" not in line:
            depth += 1
            if depth > 1:
                continue
            name, first = BEGIN.match(line)[1], number
            head = line
            while head.rstrip().endswith("&"):
                number += 1
                head = head.rstrip().removesuffix("&") + lines[number - 1].strip().removeprefix("&")
            inside = re.search(rf"{re.escape(name)}\s*\(([^)]*)\)", head)
            arguments = len([word for word in inside[1].split(",") if word.strip()]) if inside else 0
            before = first - 1
            while before > 0 and lines[before - 1].lstrip().startswith("!"):
                before -= 1
            comment = " ".join(text.strip().lstrip("!> ") for text in lines[before:first - 1])


class Sizes(unittest.TestCase):
    maxDiff = None

    def test_files(self):
        found = [f"{path.relative_to(SOURCE)}: {count}" for path in sources()
                 if (count := len(path.read_text(encoding="utf-8").splitlines())) > FILE]
        self.assertEqual(found, [], f"more than {FILE} lines")

    def test_lines(self):
        """Compilers pass over comments that are too long; lines that fypp expands are not those that compilers read."""
        sources_and_tests = [path for path in [*sources(), *sorted(Path(SOURCE, "tests").rglob("*.f90"))] if path.suffix == ".f90"]
        found = [f"{path.relative_to(SOURCE)}:{number}: {len(line)} characters" for path in sources_and_tests
                 for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1) if len(line) > LINE]
        self.assertGreater(len(sources_and_tests), 400)
        self.assertEqual(found, [], f"more than {LINE} characters")

    def test_procedures(self):
        long, many, total = [], [], 0
        for path in sources():
            for name, first, last, arguments, comment in procedures(path.read_text(encoding="utf-8").splitlines()):
                total += 1
                place = f"{path.relative_to(SOURCE)}:{first}: {name}"
                if last - first + 1 > PROCEDURE and "is long" not in comment:
                    long.append(f"{place}: {last - first + 1} lines")
                if arguments > ARGUMENTS and not str(path.relative_to(SOURCE)).startswith(KERNELS):
                    many.append(f"{place}: {arguments} arguments")
        # a search that finds nothing would prove nothing
        self.assertGreater(total, 2500)
        self.assertEqual(long, [], f"more than {PROCEDURE} lines, and no reason in the comment")
        self.assertEqual(many, [], f"more than {ARGUMENTS} arguments")


if __name__ == "__main__":
    unittest.main()
