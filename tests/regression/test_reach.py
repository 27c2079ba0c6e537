"""Modules of the library keep to what is next to them: a procedure may use the components of an argument whose type belongs to another room,
but not reach through such a component into those of yet another type of other rooms. A room is a folder. What is counted are chains a%b%c of
data; asking a component a question, a%b%ask(), is none. A name that `associate` gives counts where it is given: loops name the element that
they work on. The application and the programs are not counted, because reports read through the whole run.

The count may only fall: whoever makes it smaller writes the new number here. Whoever would need one chain more passes the part that the
procedure works on, moves the procedure to the type whose data it uses, or gives that type a question that several places ask."""
import os
import re
import unittest
from collections import Counter
from pathlib import Path

SOURCE = os.environ.get("GRAVIER_SOURCE_DIR", os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..")))
#: what is left: loops over pairs, contacts and bodies that read arrays in place, what laws of the scene have in common, and the period
MOST = 181
#: an index or arguments, with three levels of parentheses
INDEX = r"(?:\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))"
CHAIN = re.compile(rf"(?<![\w%])(\w+){INDEX}?((?:\s*%\s*\w+{INDEX}?)+)")
TYPE = re.compile(r"^\s*type(?P<head>\s*,[^:\n]*)?\s*::\s*(?P<name>\w+)\s*\n(?P<body>.*?)^\s*end type", re.S | re.M)
DERIVED = re.compile(r"^\s*(?:type|class)\s*\(\s*(\w+)\s*\)[^:\n]*::(.*)$", re.M)
SIMPLE = re.compile(r"^\s*(?:integer|real|logical|character|complex|procedure)\b[^:\n]*(?:::|\))(.*)$", re.M)
PROCEDURE = re.compile(r"^  (?!end\b)(?:[\w()=, ]+ )?(?:subroutine|function)\s+\w+", re.M)


def parts(text):
    """What commas outside of parentheses separate."""
    found, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return found


def names(text):
    """Names that the right side of a declaration declares."""
    return [match[1].lower() for part in parts(text) if (match := re.match(r"\s*(\w+)", part))]


def without_comments(text):
    """The code, with continued lines joined. Texts lose what looks like a comment in them, which no chain is in."""
    text = re.sub(r"!.*", "", text)
    return re.sub(r"&[ \t]*\n(?:[ \t]*\n)*[ \t]*&?", "", text)


class Sources:
    def __init__(self):
        self.codes, self.room_of, self.components, self.parent = {}, {}, {}, {}
        for folder in ("modules", "src", "drivers"):
            for path in sorted(Path(SOURCE, folder).rglob("*")):
                if path.suffix in (".f90", ".fypp"):
                    code = without_comments(path.read_text(encoding="utf-8"))
                    self.codes[path.relative_to(SOURCE)] = code
                    for match in TYPE.finditer(code):
                        self.take_type(match, path.relative_to(SOURCE).parent)

    def take_type(self, match, room):
        name, body = match["name"].lower(), re.split(r"(?m)^\s*contains\s*$", match["body"])[0]
        self.room_of[name] = room
        self.components[name] = {n: "" for d in SIMPLE.finditer(body) for n in names(d[1])}
        self.components[name].update({n: d[1].lower() for d in DERIVED.finditer(body) for n in names(d[2])})
        extends = re.search(r"extends\s*\(\s*(\w+)", match["head"] or "")
        if extends:
            self.parent[name] = extends[1].lower()

    def component(self, of, name):
        """Type of a component, "" for numbers and texts, None where there is none of the name: it is bound."""
        while of in self.components:
            if name in self.components[of]:
                return self.components[of][name]
            of = self.parent.get(of)
        return None

    def steps(self, start, chain):
        """[(type, component, its type)] of a chain, from the type that it starts from."""
        found = []
        for name in chain:
            to = self.component(start, name)
            if to is None:
                break
            found.append((start, name, to))
            start = to
        return found

    def reaches(self):
        """Counter of (file, type, type of its component) for all chains of the library that go on from there."""
        count = Counter()
        for path, code in self.codes.items():
            if path.parts[0] != "modules":
                continue
            bounds = [match.start() for match in PROCEDURE.finditer(code)] + [len(code)]
            for begin, end in zip(bounds, bounds[1:]):
                self.look(path, code[begin:end], count)
        return count

    def look(self, path, code, count):
        known = {n: d[1].lower() for d in DERIVED.finditer(code) for n in names(d[2])}
        for match in CHAIN.finditer(code):
            steps = self.steps(known.get(match[1].lower()), self.links(match[2]))
            for (first, _, second), _ in zip(steps, steps[1:]):
                if self.is_reach(path, first, second):
                    count[(str(path), first, second)] += 1

    def is_reach(self, path, first, second):
        rooms = [self.room_of.get(name) for name in (first, second)]
        return None not in rooms and path.parent not in rooms

    @staticmethod
    def links(chain):
        return [name.lower() for name in re.findall(r"%\s*(\w+)", re.sub(INDEX, "", chain))]


class Reach(unittest.TestCase):

    def test_chains(self):
        sources = Sources()
        count = sources.reaches()
        # a search that finds nothing would prove nothing
        self.assertGreater(len(sources.components), 250)
        self.assertGreater(count.total(), 100)
        by_file = Counter()
        for (path, _, _), number in count.items():
            by_file[path] += number
        self.assertLessEqual(count.total(), MOST, f"chains; the files with most of them: {by_file.most_common(8)}")


if __name__ == "__main__":
    unittest.main()
