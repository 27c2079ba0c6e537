"""Integers of 64 bits become those of 32 in modules/base/core/narrow.f90 alone: no other source has int() without a kind, and int(x, i4) is for
reals, in the files that are named here."""
import glob
import os
import re
import unittest

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
#: files that make whole numbers of reals, or take bits of a word or an int of C, and how often
OTHERS = {"modules/base/core/sorting.f90": 2, "modules/bodies/generation/loose_packing.f90": 1, "modules/bodies/generation/placed_grains.f90": 2,
          "modules/bodies/shapes/convex_piece.f90": 2, "modules/contact/broad_phase/cell_grid.f90": 1, "modules/domain/partition/cell_levels.f90": 1, "modules/domain/partition/cell_map.f90": 4,
          "modules/step/diagnostics/contact_structure.f90": 1, "modules/step/diagnostics/mean_region.f90": 1,
          "modules/domain/partition/graph_partition.f90": 1, "modules/domain/partition/partition.f90": 2,
          "modules/io/files/file_system.f90": 1}


def conversions(path):
    """(line, arguments) of each int( in the code of a file."""
    with open(path, encoding="utf-8") as file:
        text = re.sub(r'"[^"\n]*"|!.*', lambda match: " " * len(match[0]), file.read())
    for match in re.finditer(r"(?<![\w%])int\(", text):
        depth, end, commas = 1, match.end(), []
        while depth:
            letter = text[end]
            depth += (letter in "([") - (letter in ")]")
            if letter == "," and depth == 1:
                commas.append(end)
            end += 1
        kind = text[commas[0] + 1:end - 1].strip() if commas else ""
        yield text.count("\n", 0, match.start()) + 1, kind


class Narrowing(unittest.TestCase):

    def test_one_procedure(self):
        found, wrong = {}, []
        for folder in ("modules", "src", "drivers"):
            for path in sorted(path for ending in ("*.[fF]90", "*.fypp", "*.fypi")
                               for path in glob.glob(os.path.join(SOURCE, folder, "**", ending), recursive=True)):
                name = os.path.relpath(path, SOURCE)
                if name == "modules/base/core/narrow.f90":
                    continue
                for line, kind in conversions(path):
                    if kind == "":
                        wrong.append(f"{name}:{line}: int() without a kind")
                    elif kind in ("i4", "int32"):
                        found[name] = found.get(name, 0) + 1
        self.assertEqual(wrong, [])
        self.assertEqual(found, OTHERS)


if __name__ == "__main__":
    unittest.main()
